#include "image.h"

#include "geometry/transform.h"
#include "plane.h"

umb_image umb_image_of_bounds(const umb_raster_map *map, const umb_image_bounds *b)
{
    umb_image image = {{1, 1, 0, 0}, 0.0f};
    if (!(b->x_max >= 0.0 && b->y_max >= 0.0 && b->x_min <= map->width && b->y_min <= map->height)) {
        return image;
    }
    int32_t x_last = (int32_t)map->width - 1;
    int32_t x0 = umb_pixel_floor(b->x_min - UMB_PIXEL_SLACK),
            x1 = umb_pixel_floor(b->x_max + UMB_PIXEL_SLACK);
    int32_t y0 = umb_raster_map_row_at(map, b->y_min, -map->rows.slack),
            y1 = umb_raster_map_row_at(map, b->y_max, map->rows.slack);
    x0 = x0 < 0 ? 0 : x0 > x_last ? x_last : x0;
    x1 = x1 < x0 ? x0 : x1 > x_last ? x_last : x1;
    image.rect.x0 = (int16_t)x0;
    image.rect.y0 = (int16_t)y0;
    image.rect.x1 = (int16_t)x1;
    image.rect.y1 = (int16_t)y1;
    double z = map->orthographic ? -b->w_min : 1.0 / b->w_min;
    image.nearness = (float)(z + 0x1p-22 * fabs(z));
    return image;
}

/* A box under a transform as the view sees it: its middle, and half of each of its three edges. A
 * corner is the middle with each half edge added or taken off. With fewer than 16 roundings to each
 * coordinate, each relative to a term whose sum over the box is bounded by reach (times the map's
 * scale), 16 units of that cover them. */
typedef struct turned_box {
    umb_view_point middle;
    umb_view_point half[3];
    double reach; /* at least the sum of absolute components of d at every corner */
    double slop; /* each vertex in the box has its world vertex within this, per axis, of its exact image */
} turned_box;

static umb_view_point see(const umb_raster_map *map, const double d[3])
{
    umb_vec3 v = umb_vec3_from_double(d);
    umb_view_point p = {umb_vec3_dot(map->x, v), umb_vec3_dot(map->y, v), umb_vec3_dot(map->w, v),
                        umb_vec3_sum_abs(v)};
    return p;
}

static turned_box turn_box(const umb_raster_map *map, const umb_aabb *box, const umb_transform *t,
                           bool identity)
{
    const double eye[3] = {map->eye.x, map->eye.y, map->eye.z};
    double middle[3], half[3], far_corner[3];
    turned_box r;
    for (int i = 0; i < 3; ++i) {
        middle[i] = 0.5 * ((double)box->min[i] + box->max[i]);
        half[i] = 0.5 * ((double)box->max[i] - box->min[i]);
        far_corner[i] = fabs(middle[i]) + half[i];
    }
    double d[3], edge[3][3] = {{0}};
    r.slop = 0.0;
    for (int i = 0; i < 3; ++i) {
        if (identity) {
            d[i] = middle[i] - eye[i];
            edge[i][i] = half[i];
            continue;
        }
        const float *m = t->m[i];
        d[i] = m[0] * middle[0] + m[1] * middle[1] + m[2] * middle[2] + m[3] - eye[i];
        double size = fabs((double)m[3]);
        for (int j = 0; j < 3; ++j) {
            edge[j][i] = m[j] * half[j];
            size += fabs((double)m[j]) * far_corner[j];
        }
        r.slop = 0x1p-23 * size > r.slop ? 0x1p-23 * size : r.slop;
    }
    r.middle = see(map, d);
    /* Rounding of the world coordinate itself is relative to its terms, which slop has the sum
     * of. */
    r.reach = r.middle.reach + 0x1p24 * r.slop;
    for (int j = 0; j < 3; ++j) {
        r.half[j] = see(map, edge[j]);
        r.reach += r.half[j].reach;
    }
    return r;
}

static umb_view_point box_corner(const turned_box *b, int k)
{
    umb_view_point p = b->middle;
    for (int j = 0; j < 3; ++j) {
        double sign = (k >> j & 1) != 0 ? 1.0 : -1.0;
        p.x += sign * b->half[j].x;
        p.y += sign * b->half[j].y;
        p.w += sign * b->half[j].w;
    }
    p.reach = b->reach;
    return p;
}

/* The view's six sides as g(X, Y, W) >= 0 inside: depth, then the raster's borders. */
enum { SIDES = 6 };

static double side_value(const umb_raster_map *m, int side, const umb_view_point *v)
{
    double one = m->orthographic ? 1.0 : v->w;
    switch (side) {
    case 0:
        return v->w - m->least_w;
    case 1:
        return m->most_w - v->w;
    case 2:
        return v->x + m->cx * one;
    case 3:
        return (m->width - m->cx) * one - v->x;
    case 4:
        return v->y + m->cy * one;
    default:
        return (m->height - m->cy) * one - v->y;
    }
}

/* How far outside a computed point may lie when the true one does not: 64 units of what its error
 * is relative to. */
static double side_slack(const umb_raster_map *m, int side, double reach)
{
    if (side < 2) {
        return 64.0 * UMB_U * (reach + fabs(m->least_w) + (side == 1 ? fabs(m->most_w) : 0.0));
    }
    double across = fabs(m->cx) + fabs(m->cy) + m->width + m->height;
    return 64.0 * UMB_U * (m->scale * reach + across * (m->orthographic ? 1.0 : reach));
}

/* True if the box lies beyond one of the raster's borders. What lies beyond near is tested by its
 * image instead, which is cheaper. */
static bool box_beside(const umb_raster_map *map, const turned_box *box)
{
    double across = map->scale + fabs(map->cx) + fabs(map->cy) + map->width + map->height;
    for (int side = 2; side < SIDES; ++side) {
        double most = -INFINITY;
        for (int k = 0; k < 8; ++k) {
            umb_view_point p = box_corner(box, k);
            double g = side_value(map, side, &p);
            most = g > most ? g : most;
        }
        if (most < -(side_slack(map, side, box->reach) + 3.0 * box->slop * across)) {
            return true;
        }
    }
    return false;
}

umb_depth_place umb_image_of_part(const umb_raster_map *map, const umb_aabb *part,
                                  const umb_transform *transform, bool identity,
                                  umb_image_bounds *out)
{
    turned_box box = turn_box(map, part, transform, identity);
    double deep = fabs(box.half[0].w) + fabs(box.half[1].w) + fabs(box.half[2].w);
    double off = 16.0 * UMB_U * box.reach + 3.0 * box.slop;
    out->w_min = box.middle.w - deep - off;
    out->w_max = box.middle.w + deep + off;
    if (out->w_max < map->least_w || out->w_min > map->most_w) {
        return UMB_DEPTH_OUTSIDE;
    }
    /* The bound of a projected corner holds while W's own error is a small part of W. */
    if (!(out->w_min >= map->least_w) || (!map->orthographic && !(out->w_min > 4.0 * off))) {
        return box_beside(map, &box) ? UMB_DEPTH_OUTSIDE : UMB_DEPTH_CROSSING;
    }
    out->x_min = out->y_min = INFINITY;
    out->x_max = out->y_max = -INFINITY;
    for (int k = 0; k < 8; ++k) {
        umb_raster_point p = umb_raster_map_project(map, box_corner(&box, k), 16.0);
        double a = map->scale + fabs(p.x - map->cx) + fabs(p.y - map->cy);
        double error = p.error + 3.0 * box.slop * (map->orthographic ? map->scale : a / out->w_min);
        out->x_min = p.x - error < out->x_min ? p.x - error : out->x_min;
        out->y_min = p.y - error < out->y_min ? p.y - error : out->y_min;
        out->x_max = p.x + error > out->x_max ? p.x + error : out->x_max;
        out->y_max = p.y + error > out->y_max ? p.y + error : out->y_max;
    }
    return UMB_DEPTH_BEYOND;
}

/* Cut a convex polygon at one side, moved outwards by slack. Returns the number of corners left; -1 if all are, and
 * out is not written. */
static int cut_polygon(const umb_raster_map *map, int side, double slack, const umb_view_point *in,
                       int count, umb_view_point *out)
{
    double g[3 + SIDES];
    bool inside = true;
    for (int i = 0; i < count; ++i) {
        g[i] = side_value(map, side, &in[i]) + slack;
        inside = inside && g[i] >= 0.0;
    }
    if (inside) {
        return -1;
    }
    int kept = 0;
    for (int i = 0; i < count; ++i) {
        int next = i + 1 < count ? i + 1 : 0;
        const umb_view_point *p = &in[i], *q = &in[next];
        if (g[i] >= 0.0) {
            out[kept++] = *p;
        }
        if ((g[i] >= 0.0) != (g[next] >= 0.0)) {
            double t = g[i] / (g[i] - g[next]);
            umb_view_point cut = {p->x + t * (q->x - p->x), p->y + t * (q->y - p->y),
                                  p->w + t * (q->w - p->w), p->reach};
            out[kept++] = cut;
        }
    }
    return kept;
}

/* Nearness of a triangle from its plane; when that is edge-on, from its nearest corner alone. */
static void bound_nearness(const umb_raster_map *map, const float corner[3], const umb_face *face,
                           double w_min, umb_outline *o)
{
    double most = map->orthographic ? -w_min : 1.0 / w_min;
    o->most = most + 0x1p-22 * fabs(most);
    umb_plane_nearness plane = {0.0, 0.0, o->most, 0.0};
    (void)umb_face_nearness(map, face, corner, &plane);
    o->gx = plane.gx;
    o->gy = plane.gy;
    o->g0 = plane.g0 + plane.error;
}

umb_depth_place umb_outline_of_triangle(const umb_raster_map *map, const float corner[3][3],
                                        const umb_face *face, umb_outline *outline,
                                        umb_image_bounds *out)
{
    umb_view_point polygon[2][3 + SIDES];
    double reach = 0.0;
    for (int i = 0; i < 3; ++i) {
        polygon[0][i] = umb_raster_map_point(map, corner[i]);
        reach = polygon[0][i].reach > reach ? polygon[0][i].reach : reach;
    }
    int count = 3, now = 0;
    for (int side = 0; side < SIDES && count > 0; ++side) {
        if (side == 1 && isinf(map->most_w)) {
            continue;
        }
        int left = cut_polygon(map, side, side_slack(map, side, reach), polygon[now], count,
                               polygon[1 - now]);
        if (left >= 0) {
            count = left;
            now = 1 - now;
        }
    }
    if (count == 0) {
        return UMB_DEPTH_OUTSIDE;
    }
    double error = 64.0 * UMB_U * reach;
    out->w_min = out->x_min = out->y_min = INFINITY;
    out->w_max = out->x_max = out->y_max = -INFINITY;
    outline->count = (uint32_t)count;
    outline->error = 0.0;
    for (int i = 0; i < count; ++i) {
        umb_view_point v = polygon[now][i];
        if (!map->orthographic && !(v.w > 2.0 * error)) {
            return UMB_DEPTH_CROSSING;
        }
        v.reach = reach;
        umb_raster_point p = umb_raster_map_project(map, v, 64.0);
        outline->x[i] = p.x;
        outline->y[i] = p.y;
        outline->error = p.error > outline->error ? p.error : outline->error;
        out->w_min = v.w - error < out->w_min ? v.w - error : out->w_min;
        out->w_max = v.w + error > out->w_max ? v.w + error : out->w_max;
        out->x_min = p.x - p.error < out->x_min ? p.x - p.error : out->x_min;
        out->y_min = p.y - p.error < out->y_min ? p.y - p.error : out->y_min;
        out->x_max = p.x + p.error > out->x_max ? p.x + p.error : out->x_max;
        out->y_max = p.y + p.error > out->y_max ? p.y + p.error : out->y_max;
    }
    bound_nearness(map, corner[0], face, out->w_min, outline);
    return UMB_DEPTH_BEYOND;
}

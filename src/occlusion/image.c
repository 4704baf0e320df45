#include "image.h"

#include "geometry/transform.h"

umb_image umb_image_of_bounds(const umb_raster_map *map, const umb_image_bounds *b)
{
    umb_image image = {{1, 1, 0, 0}, 0.0f};
    if (!(b->x_max >= 0.0 && b->y_max >= 0.0 && b->x_min <= map->width && b->y_min <= map->height)) {
        return image;
    }
    double x_last = map->width - 1.0, y_last = map->height - 1.0;
    double x0 = floor(b->x_min), x1 = ceil(b->x_max) - 1.0;
    double y0 = floor(b->y_min), y1 = ceil(b->y_max) - 1.0;
    x0 = x0 < 0.0 ? 0.0 : x0 > x_last ? x_last : x0;
    y0 = y0 < 0.0 ? 0.0 : y0 > y_last ? y_last : y0;
    x1 = x1 < x0 ? x0 : x1 > x_last ? x_last : x1;
    y1 = y1 < y0 ? y0 : y1 > y_last ? y_last : y1;
    image.rect.x0 = (int16_t)x0;
    image.rect.y0 = (int16_t)y0;
    image.rect.x1 = (int16_t)x1;
    image.rect.y1 = (int16_t)y1;
    double z = map->orthographic ? -b->w_min : 1.0 / b->w_min;
    image.nearness = (float)(z + 0x1p-22 * fabs(z));
    return image;
}

/* The corners of a box as the view sees them. slop: every vertex in the box has a world vertex within
 * this, per axis, of its exact image. */
static double place_corners(const umb_raster_map *map, const umb_aabb *part, const umb_transform *t,
                            bool identity, umb_view_point corner[8])
{
    const double eye[3] = {map->eye.x, map->eye.y, map->eye.z};
    double slop = 0.0;
    for (int k = 0; k < 8; ++k) {
        double p[3], d[3];
        for (int i = 0; i < 3; ++i) {
            p[i] = (k >> i & 1) != 0 ? part->max[i] : part->min[i];
        }
        for (int i = 0; i < 3; ++i) {
            double world = p[i], size = 0.0;
            if (!identity) {
                const float *m = t->m[i];
                world = m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3];
                size = fabs(m[0] * p[0]) + fabs(m[1] * p[1]) + fabs(m[2] * p[2]) + fabs(m[3]);
            }
            slop = 0x1p-23 * size > slop ? 0x1p-23 * size : slop;
            d[i] = world - eye[i];
        }
        umb_vec3 v = umb_vec3_from_double(d);
        corner[k].x = umb_vec3_dot(map->x, v);
        corner[k].y = umb_vec3_dot(map->y, v);
        corner[k].w = umb_vec3_dot(map->w, v);
        corner[k].reach = umb_vec3_sum_abs(v);
    }
    return slop;
}

umb_depth_place umb_image_of_part(const umb_raster_map *map, const umb_aabb *part,
                                  const umb_transform *transform, bool identity, umb_image_bounds *out)
{
    umb_view_point corner[8];
    double slop = place_corners(map, part, transform, identity, corner);
    double w_max = -INFINITY;
    out->w_min = INFINITY;
    for (int k = 0; k < 8; ++k) {
        double error = 8.0 * UMB_U * corner[k].reach + 3.0 * slop;
        out->w_min = corner[k].w - error < out->w_min ? corner[k].w - error : out->w_min;
        w_max = corner[k].w + error > w_max ? corner[k].w + error : w_max;
    }
    if (w_max < map->near_depth || out->w_min > map->far_depth) {
        return UMB_DEPTH_OUTSIDE;
    }
    if (!(out->w_min >= map->near_depth)) {
        return UMB_DEPTH_CROSSING;
    }
    out->x_min = out->y_min = INFINITY;
    out->x_max = out->y_max = -INFINITY;
    for (int k = 0; k < 8; ++k) {
        umb_raster_point p = umb_raster_map_project(map, corner[k], 8.0);
        double a = map->scale + fabs(p.x - map->cx) + fabs(p.y - map->cy);
        double error = p.error + 3.0 * slop * (map->orthographic ? map->scale : a / out->w_min);
        out->x_min = p.x - error < out->x_min ? p.x - error : out->x_min;
        out->y_min = p.y - error < out->y_min ? p.y - error : out->y_min;
        out->x_max = p.x + error > out->x_max ? p.x + error : out->x_max;
        out->y_max = p.y + error > out->y_max ? p.y + error : out->y_max;
    }
    return UMB_DEPTH_BEYOND;
}

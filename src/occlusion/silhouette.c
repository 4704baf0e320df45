#include "silhouette.h"

#include <string.h>

#include "base/memory.h"
#include "geometry/transform.h"
#include "plane.h"

/* Slack of a cut point, in units 2^-53 of scale * reach: the interpolation of two vertices. */
#define CUT_SLACK 16.0

/* Vectors of doubles are loaded whole. */
#define PADDING 8

bool umb_silhouette_reserve(umb_silhouette *s, const umb_allocator *a, uint32_t vertices,
                            uint32_t triangles, uint32_t edges)
{
    size_t *c = s->capacity;
    size_t v = (size_t)vertices + PADDING, chords = triangles; /* a cut triangle adds one */
    double **per_vertex[9] = {&s->d[0], &s->d[1], &s->d[2],       &s->x,        &s->y,
                              &s->off,  &s->w,    &s->near_least, &s->near_most};
    for (int i = 0; i < 9; ++i) {
        if (!umb_memory_reserve(a, (void **)per_vertex[i], &c[i], v, sizeof(double))) {
            return false;
        }
    }
    return umb_memory_reserve(a, (void **)&s->sides, &c[9], triangles, sizeof *s->sides) &&
           umb_memory_reserve(a, (void **)&s->front, &c[10], triangles, sizeof *s->front) &&
           umb_memory_reserve(a, (void **)&s->edges, &c[11], edges + chords, sizeof *s->edges) &&
           umb_memory_reserve(a, (void **)&s->triangles, &c[12], triangles, sizeof *s->triangles);
}

void umb_silhouette_free(umb_silhouette *s, const umb_allocator *a)
{
    const size_t *c = s->capacity;
    double *per_vertex[9] = {s->d[0], s->d[1], s->d[2],       s->x,        s->y,
                             s->off,  s->w,    s->near_least, s->near_most};
    for (int i = 0; i < 9; ++i) {
        umb_memory_free(a, per_vertex[i], c[i] * sizeof(double));
    }
    umb_memory_free(a, s->sides, c[9] * sizeof *s->sides);
    umb_memory_free(a, s->front, c[10] * sizeof *s->front);
    umb_memory_free(a, s->edges, c[11] * sizeof *s->edges);
    umb_memory_free(a, s->triangles, c[12] * sizeof *s->triangles);
    memset(s, 0, sizeof *s);
}

/* ---- which triangles ------------------------------------------------------------------------ */

static bool kept(const umb_silhouette *s, uint32_t v)
{
    return s->w[v] >= s->cut_depth;
}

static umb_face world_face(const umb_raster_map *map, const umb_occluder *o, const uint32_t corner[3],
                           float world[3][3])
{
    for (int i = 0; i < 3; ++i) {
        const float *p = o->mesh->positions[corner[i]];
        if (o->identity) {
            memcpy(world[i], p, sizeof world[i]);
        } else {
            umb_transform_point(&o->transform, p, world[i]);
        }
    }
    return umb_face_of(map, world[0], world[1], world[2]);
}

/* The greatest error of a triangle's corners. */
static double corner_error(const umb_silhouette *s, const uint32_t k[3])
{
    double a = s->off[k[0]], b = s->off[k[1]], c = s->off[k[2]];
    a = a > b ? a : b;
    return a > c ? a : c;
}

/* How a triangle is turned: +1 if its corners surely run counter-clockwise as seen, -1 if clockwise. On the
 * raster of rows that turn right-handed counter-clockwise is a negative area (y grows downwards). Corners are
 * off by error e in each coordinate: the area by 2 e S + 8 e^2 with S the sum of the four differences, and by 8
 * units of S^2 for rounding. A triangle that is cut is judged in the world. */
static int8_t seen_side(const umb_silhouette *s, const umb_raster_map *map, const umb_occluder *o,
                        const uint32_t k[3])
{
    if (s->cut && !(kept(s, k[0]) && kept(s, k[1]) && kept(s, k[2]))) {
        float world[3][3];
        umb_face f = world_face(map, o, k, world);
        return f.distance > f.error ? 1 : f.distance < -f.error ? -1 : 0;
    }
    double x1 = s->x[k[1]] - s->x[k[0]], y1 = s->y[k[1]] - s->y[k[0]];
    double x2 = s->x[k[2]] - s->x[k[0]], y2 = s->y[k[2]] - s->y[k[0]];
    double sum = (fabs(x1) + fabs(y1)) + (fabs(x2) + fabs(y2)), e = 4.0 * corner_error(s, k);
    double area = x1 * y2 - x2 * y1, off = e * (sum + e) + 0x1p-50 * (sum * sum);
    return (int8_t)(area > off ? -map->turn : area < -off ? map->turn : 0);
}

/* ---- the near cut --------------------------------------------------------------------------- */

typedef struct point {
    double x, y, off;
} point;

/* Where an edge meets the cut depth. Operands are in one order whatever the edge's direction, so
 * that a triangle's chord and its neighbour's cut edge end in the same point to the bit. */
static point cut_edge(umb_silhouette *s, const umb_raster_map *map, uint32_t k, uint32_t l)
{
    double t = (s->cut_depth - s->w[l]) / (s->w[k] - s->w[l]);
    umb_vec3 dk = {s->d[0][k], s->d[1][k], s->d[2][k]}, dl = {s->d[0][l], s->d[1][l], s->d[2][l]};
    double xl = umb_vec3_dot(map->x, dl), yl = umb_vec3_dot(map->y, dl);
    umb_view_point v;
    v.x = xl + t * (umb_vec3_dot(map->x, dk) - xl);
    v.y = yl + t * (umb_vec3_dot(map->y, dk) - yl);
    v.w = s->cut_depth;
    v.reach = s->reach;
    umb_raster_point p = umb_raster_map_project(map, v, CUT_SLACK);
    s->error = p.error > s->error ? p.error : s->error;
    s->x_min = p.x < s->x_min ? p.x : s->x_min;
    s->y_min = p.y < s->y_min ? p.y : s->y_min;
    s->x_max = p.x > s->x_max ? p.x : s->x_max;
    s->y_max = p.y > s->y_max ? p.y : s->y_max;
    return (point){p.x, p.y, p.error};
}

static void add_edge(umb_silhouette *s, point p, point q, int32_t multiplicity)
{
    umb_outline_edge *e = &s->edges[s->edge_count++];
    bool down = q.y > p.y;
    e->x_top = down ? p.x : q.x;
    e->x_low = down ? q.x : p.x;
    e->y_min = down ? p.y : q.y;
    e->y_max = down ? q.y : p.y;
    e->count = down ? multiplicity : -multiplicity;
    double dx = e->x_low - e->x_top, dy = e->y_max - e->y_min;
    e->flat = dy <= 1e-12 * fabs(dx) || dy < 1e-200;
    e->slope = e->flat ? 0.0 : dx / dy;
    /* Interpolating x is off by less than 16 units of the two ends. */
    e->error = (p.off > q.off ? p.off : q.off) + 16.0 * UMB_U * (fabs(p.x) + fabs(q.x));
}

/* Where the cut crosses a front triangle, its chord joins the boundary:
 *
 *        b                       corners in index order, times side; the chord runs from where the
 *       / \      beyond cut      boundary leaves the kept part to where it comes back.
 *   ---o---o---  cut depth
 *     /     \                                                                                       */
static void add_chord(umb_silhouette *s, const umb_raster_map *map, const uint32_t corner[3], int8_t side)
{
    point leave = {0.0, 0.0, 0.0}, come = leave;
    for (int i = 0; i < 3; ++i) {
        uint32_t p = corner[i], q = corner[(i + 1) % 3];
        if (kept(s, p) && !kept(s, q)) {
            leave = cut_edge(s, map, p, q);
        } else if (!kept(s, p) && kept(s, q)) {
            come = cut_edge(s, map, q, p);
        }
    }
    add_edge(s, leave, come, side * map->turn);
}

static void find_front(umb_silhouette *s, const umb_raster_map *map, const umb_occluder *o)
{
    const umb_mesh *mesh = o->mesh;
    int8_t front = o->mirrored ? -1 : 1;
    s->front_count = 0;
    for (uint32_t i = 0; i < mesh->triangle_count; ++i) {
        const uint32_t *k = mesh->triangles[i];
        int8_t seen = seen_side(s, map, o, k);
        s->sides[i] = seen == front || mesh->two_sided[i] != 0 ? seen : 0;
        if (s->sides[i] == 0) {
            continue;
        }
        uint32_t kept_count = !s->cut ? 3u : (uint32_t)kept(s, k[0]) + kept(s, k[1]) + kept(s, k[2]);
        if (kept_count > 0) {
            s->front[s->front_count++] = i;
        }
        if (kept_count == 1 || kept_count == 2) {
            add_chord(s, map, k, s->sides[i]);
        }
    }
}

static void find_outline(umb_silhouette *s, const umb_raster_map *map, const umb_mesh *mesh)
{
    for (uint32_t i = 0; i < mesh->edge_count; ++i) {
        const umb_edge *e = &mesh->edges[i];
        int32_t net = s->sides[e->f0];
        if (e->f1 != UMB_NONE) {
            int32_t other = s->sides[e->f1 & ~UMB_EDGE_SAME];
            net += (e->f1 & UMB_EDGE_SAME) != 0 ? other : -other;
        }
        if (net == 0) {
            continue;
        }
        point p = {s->x[e->v0], s->y[e->v0], s->off[e->v0]}, q = {s->x[e->v1], s->y[e->v1], s->off[e->v1]};
        if (s->cut) {
            bool keep0 = kept(s, e->v0), keep1 = kept(s, e->v1);
            if (!keep0 && !keep1) {
                continue;
            }
            if (!keep0) {
                p = cut_edge(s, map, e->v1, e->v0);
            } else if (!keep1) {
                q = cut_edge(s, map, e->v0, e->v1);
            }
        }
        add_edge(s, p, q, net * map->turn);
    }
}

bool umb_silhouette_find(umb_silhouette *s, const umb_raster_map *map, const umb_occluder *occluder)
{
    s->edge_count = 0;
    find_front(s, map, occluder);
    if (s->front_count == 0) {
        return false;
    }
    find_outline(s, map, occluder->mesh);
    if (s->cut) {
        double cut = map->orthographic ? -s->cut_depth : 1.0 / s->cut_depth;
        s->most = cut + 0x1p-40 * fabs(cut);
    }
    return s->x_max - s->x_min >= 1.0 && s->x_max > 0.0 && s->y_max > 0.0 && s->x_min < map->width &&
           s->y_min < map->height;
}

/* ---- depth ---------------------------------------------------------------------------------- */

double umb_silhouette_plane_error(const umb_silhouette *s, const umb_silhouette_plane *p, double error)
{
    double size = fabs(p->gx) * (fabs(s->x_min) + fabs(s->x_max)) +
                  fabs(p->gy) * (fabs(s->y_min) + fabs(s->y_max));
    return (fabs(p->gx) + fabs(p->gy)) * error + 0x1p-50 * (size + s->near_size);
}

void umb_silhouette_offsets(const umb_silhouette *s, const umb_silhouette_plane *p, const uint32_t corner[3],
                            double *least, double *most)
{
    *least = INFINITY;
    *most = -INFINITY;
    for (int i = 0; i < 3; ++i) {
        uint32_t k = corner[i];
        double at = s->near_least[k] - (p->gx * s->x[k] + p->gy * s->y[k]);
        *least = at < *least ? at : *least;
        *most = at > *most ? at : *most;
    }
}

static double far_corner(const umb_silhouette *s, const uint32_t corner[3])
{
    /* Corners that the cut takes away are nearer than those it leaves. */
    double least = INFINITY;
    for (int i = 0; i < 3; ++i) {
        uint32_t k = corner[i];
        least = kept(s, k) && s->near_least[k] < least ? s->near_least[k] : least;
    }
    return least;
}

void umb_silhouette_plane_of(const umb_silhouette *s, const umb_raster_map *map, const umb_occluder *o,
                             uint32_t triangle, umb_silhouette_plane *p)
{
    const uint32_t *k = o->mesh->triangles[triangle];
    p->far_corner = far_corner(s, k);
    if (s->cut && !(kept(s, k[0]) && kept(s, k[1]) && kept(s, k[2]))) {
        float world[3][3];
        umb_face face = world_face(map, o, k, world);
        umb_plane_nearness g = {0.0, 0.0, p->far_corner, 0.0};
        (void)umb_face_nearness(map, &face, world[0], &g);
        p->gx = g.gx;
        p->gy = g.gy;
        /* Its relative 2^-22 is less than this part of its largest value over the raster. */
        double size = fabs(g.gx) * (map->width + 32.0) + fabs(g.gy) * (map->height + 8.0) + fabs(g.g0);
        p->low = g.g0 - g.error - 0x1p-22 * size;
        return;
    }
    double x1 = s->x[k[1]] - s->x[k[0]], y1 = s->y[k[1]] - s->y[k[0]];
    double x2 = s->x[k[2]] - s->x[k[0]], y2 = s->y[k[2]] - s->y[k[0]];
    double z1 = s->near_least[k[1]] - s->near_least[k[0]], z2 = s->near_least[k[2]] - s->near_least[k[0]];
    double scale = 1.0 / (x1 * y2 - x2 * y1), most;
    p->gx = (z1 * y2 - z2 * y1) * scale;
    p->gy = (z2 * x1 - z1 * x2) * scale;
    umb_silhouette_offsets(s, p, k, &p->low, &most);
    p->low -= umb_silhouette_plane_error(s, p, corner_error(s, k));
}

bool umb_silhouette_shares_plane(const umb_silhouette *s, umb_silhouette_plane *p, const uint32_t corner[3])
{
    if (s->cut && !(kept(s, corner[0]) && kept(s, corner[1]) && kept(s, corner[2]))) {
        return false;
    }
    double least, most, alike = 0x1p-12 * fabs(p->far_corner);
    umb_silhouette_offsets(s, p, corner, &least, &most);
    if (!(fabs(least - p->low) < alike && fabs(most - p->low) < alike)) {
        return false;
    }
    least -= umb_silhouette_plane_error(s, p, corner_error(s, corner));
    p->low = least < p->low ? least : p->low;
    double far = far_corner(s, corner);
    p->far_corner = far < p->far_corner ? far : p->far_corner;
    return true;
}

/* The three sides of an image, turned inwards. With corners off by an error each, the value at a raster point is
 * off by at most the error times twice the lengths involved, doubled; in floats each of five roundings adds a
 * unit of the terms' sizes over the raster, 8 units taken. */
static void find_sides(umb_front_triangle *t, const umb_silhouette *s, const umb_raster_map *map,
                       const uint32_t k[3])
{
    double area = (s->x[k[1]] - s->x[k[0]]) * (s->y[k[2]] - s->y[k[0]]) -
                  (s->y[k[1]] - s->y[k[0]]) * (s->x[k[2]] - s->x[k[0]]);
    double turn = area < 0.0 ? -1.0 : 1.0;
    double raster = map->width + 32.0 + map->height + 8.0, error = corner_error(s, k);
    t->sided = true;
    for (int i = 0; i < 3; ++i) {
        uint32_t a = k[i], b = k[(i + 1) % 3];
        double dx = turn * (s->x[b] - s->x[a]), dy = turn * (s->y[b] - s->y[a]);
        double reach = raster + fabs(s->x[a]) + fabs(s->y[a]), length = fabs(dx) + fabs(dy);
        double e0 = dy * s->x[a] - dx * s->y[a];
        double off = 4.0 * error * (reach + length) + 16.0 * UMB_U * length * reach +
                     0x1p-21 * (length * raster + fabs(e0));
        if (!(length * raster + fabs(e0) + off < 1e30)) {
            t->sided = false;
            return;
        }
        t->ex[i] = (float)-dy;
        t->ey[i] = (float)dx;
        t->most[i] = (float)(e0 + off);
        t->least[i] = (float)(e0 - off);
    }
}

static uint16_t tile_of(double x, double width)
{
    return (uint16_t)((uint32_t)(x < 0.0 ? 0.0 : x > width - 1.0 ? width - 1.0 : x) / 32u);
}

/* Tiles of an image; all of them where it is cut. The first row of tiles is returned. */
static uint32_t find_tiles(umb_front_triangle *t, const umb_silhouette *s, const umb_raster_map *map,
                           const uint32_t k[3], bool whole)
{
    double x_min = -INFINITY, x_max = INFINITY, y_min = -INFINITY, y_max = INFINITY;
    if (whole) {
        double off = corner_error(s, k);
        x_min = fmin(s->x[k[0]], fmin(s->x[k[1]], s->x[k[2]])) - off - 0x1p-30;
        x_max = fmax(s->x[k[0]], fmax(s->x[k[1]], s->x[k[2]])) + off;
        y_min = fmin(s->y[k[0]], fmin(s->y[k[1]], s->y[k[2]])) - off;
        y_max = fmax(s->y[k[0]], fmax(s->y[k[1]], s->y[k[2]])) + off;
    }
    t->tx0 = tile_of(x_min, map->width);
    t->tx1 = tile_of(x_max, map->width);
    t->ty1 = (uint16_t)(umb_raster_map_row_at(map, y_max, map->rows.slack) / 8);
    return (uint32_t)umb_raster_map_row_at(map, y_min, -map->rows.slack) / 8;
}

void umb_silhouette_set_plane(umb_front_triangle *t, const umb_raster_map *map, const umb_silhouette_plane *p)
{
    double size = fabs(p->gx) * (map->width + 32.0) + fabs(p->gy) * (map->height + 8.0) + fabs(p->low);
    bool fits = size < 1e30;
    t->far_corner = (float)(p->far_corner - 0x1p-22 * fabs(p->far_corner));
    t->gx = fits ? (float)p->gx : 0.0f;
    t->gy = fits ? (float)p->gy : 0.0f;
    t->low = fits ? (float)(p->low - 0x1p-21 * size) : t->far_corner;
}

void umb_silhouette_depths(umb_silhouette *s, const umb_raster_map *map, const umb_occluder *o)
{
    s->triangle_count = 0;
    for (uint32_t i = 0; i < s->front_count; ++i) {
        const uint32_t *k = o->mesh->triangles[s->front[i]];
        umb_front_triangle *t = &s->triangles[s->triangle_count++];
        bool whole = !s->cut || (kept(s, k[0]) && kept(s, k[1]) && kept(s, k[2]));
        umb_silhouette_plane p;
        umb_silhouette_plane_of(s, map, o, s->front[i], &p);
        umb_silhouette_set_plane(t, map, &p);
        t->sided = false;
        if (whole) {
            find_sides(t, s, map, k);
        }
        t->next = find_tiles(t, s, map, k, whole);
    }
}

#include "silhouette.h"

#include <string.h>

#include "base/memory.h"
#include "geometry/transform.h"
#include "plane.h"

/* Slack, in units 2^-53 of scale * reach: a vertex has one subtraction, one product and two sums in
 * each term; a cut adds the interpolation of two vertices. */
#define VERTEX_SLACK 5.0
#define CUT_SLACK 16.0

enum { EDGES, TRIANGLES, VIEWS, POINTS, WORLD, SIDES };

bool umb_silhouette_reserve(umb_silhouette *s, const umb_allocator *a, uint32_t vertices,
                            uint32_t triangles, uint32_t edges)
{
    size_t *c = s->capacity;
    size_t chords = triangles; /* every triangle that the near depth cuts adds one */
    return umb_memory_reserve(a, (void **)&s->edges, &c[EDGES], edges + chords, sizeof *s->edges) &&
           umb_memory_reserve(a, (void **)&s->triangles, &c[TRIANGLES], triangles,
                              sizeof *s->triangles) &&
           umb_memory_reserve(a, (void **)&s->views, &c[VIEWS], vertices, sizeof *s->views) &&
           umb_memory_reserve(a, (void **)&s->points, &c[POINTS], vertices, sizeof *s->points) &&
           umb_memory_reserve(a, (void **)&s->world, &c[WORLD], vertices, sizeof *s->world) &&
           umb_memory_reserve(a, (void **)&s->sides, &c[SIDES], triangles, sizeof *s->sides);
}

void umb_silhouette_free(umb_silhouette *s, const umb_allocator *a)
{
    const size_t *c = s->capacity;
    umb_memory_free(a, s->edges, c[EDGES] * sizeof *s->edges);
    umb_memory_free(a, s->triangles, c[TRIANGLES] * sizeof *s->triangles);
    umb_memory_free(a, s->views, c[VIEWS] * sizeof *s->views);
    umb_memory_free(a, s->points, c[POINTS] * sizeof *s->points);
    umb_memory_free(a, s->world, c[WORLD] * sizeof *s->world);
    umb_memory_free(a, s->sides, c[SIDES] * sizeof *s->sides);
    memset(s, 0, sizeof *s);
}

/* World, view and raster position of every vertex. The cut is placed 64 units of the mesh's
 * reach beyond near_cut: then what is kept, rounding included, is truly beyond it. */
static bool place_vertices(umb_silhouette *s, const umb_raster_map *map, const umb_occluder *o)
{
    const umb_mesh *mesh = o->mesh;
    double reach = 0.0;
    for (uint32_t v = 0; v < mesh->block_position_count; ++v) {
        if (o->identity) {
            memcpy(s->world[v], mesh->positions[v], sizeof s->world[v]);
        } else {
            umb_transform_point(&o->transform, mesh->positions[v], s->world[v]);
        }
        s->views[v] = umb_raster_map_point(map, s->world[v]);
        reach = s->views[v].reach > reach ? s->views[v].reach : reach;
    }
    s->cut_depth = map->near_cut + 64.0 * UMB_U * (reach + fabs(map->near_cut));
    bool any = false;
    for (uint32_t v = 0; v < mesh->block_position_count; ++v) {
        if (s->views[v].w >= s->cut_depth) {
            s->points[v] = umb_raster_map_project(map, s->views[v], VERTEX_SLACK);
            any = true;
        }
    }
    return any;
}

/* +1: blocks, corners counter-clockwise as seen; -1: blocks, clockwise; 0: does not surely block. */
static int8_t side_of(const umb_face *f, bool mirrored, bool two_sided)
{
    int8_t seen = f->distance > f->error ? 1 : f->distance < -f->error ? -1 : 0;
    int8_t front = mirrored ? -1 : 1;
    return seen == front || two_sided ? seen : 0;
}

/* Nearness of a vertex, rounded away from the eye by more than its error. */
static double vertex_nearness(const umb_raster_map *map, umb_view_point v)
{
    double w = v.w + VERTEX_SLACK * UMB_U * v.reach;
    return map->orthographic ? -(w + 4.0 * UMB_U * fabs(w)) : (1.0 - 4.0 * UMB_U) / w;
}

/* Where an edge meets the cut depth. Operands are in one order whatever the edge's direction, so
 * that a triangle's chord and its neighbour's cut edge end in the same point to the bit. */
static umb_raster_point cut_edge(const umb_silhouette *s, const umb_raster_map *map, uint32_t kept,
                                 uint32_t lost)
{
    const umb_view_point *k = &s->views[kept], *l = &s->views[lost];
    double t = (s->cut_depth - l->w) / (k->w - l->w);
    umb_view_point v;
    v.x = l->x + t * (k->x - l->x);
    v.y = l->y + t * (k->y - l->y);
    v.w = s->cut_depth;
    v.reach = k->reach > l->reach ? k->reach : l->reach;
    return umb_raster_map_project(map, v, CUT_SLACK);
}

static void add_edge(umb_silhouette *s, const umb_raster_point *p, const umb_raster_point *q,
                     int32_t multiplicity)
{
    umb_outline_edge *e = &s->edges[s->edge_count++];
    e->x0 = p->x;
    e->y0 = p->y;
    e->x1 = q->x;
    e->y1 = q->y;
    e->error = p->error > q->error ? p->error : q->error;
    e->multiplicity = multiplicity;
}

typedef struct box {
    double x_min, y_min, x_max, y_max;
} box;

static void grow(box *b, const umb_raster_point *p)
{
    b->x_min = p->x - p->error < b->x_min ? p->x - p->error : b->x_min;
    b->y_min = p->y - p->error < b->y_min ? p->y - p->error : b->y_min;
    b->x_max = p->x + p->error > b->x_max ? p->x + p->error : b->x_max;
    b->y_max = p->y + p->error > b->y_max ? p->y + p->error : b->y_max;
}

static bool kept(const umb_silhouette *s, uint32_t v)
{
    return s->views[v].w >= s->cut_depth;
}

/* The image box of a front triangle; where the cut crosses it, its chord joins the boundary:
 *
 *        b                       corners in index order, times side; the chord runs from where the
 *       / \      beyond cut      boundary leaves the kept part to where it comes back.
 *   ---o---o---  cut depth
 *     /     \                                                                                       */
static bool cut_triangle(umb_silhouette *s, const umb_raster_map *map, const uint32_t corner[3],
                         int8_t side, box *image)
{
    umb_raster_point leave, come;
    bool crossed = false, any = false;
    for (int i = 0; i < 3; ++i) {
        uint32_t p = corner[i], q = corner[(i + 1) % 3];
        if (kept(s, p)) {
            grow(image, &s->points[p]);
            any = true;
            if (!kept(s, q)) {
                leave = cut_edge(s, map, p, q);
                grow(image, &leave);
                crossed = true;
            }
        } else if (kept(s, q)) {
            come = cut_edge(s, map, q, p);
            grow(image, &come);
        }
    }
    if (crossed) {
        add_edge(s, &leave, &come, side * map->turn);
    }
    return any;
}

static float float_down(double v)
{
    double low = v - 0x1p-22 * fabs(v) - 1e-30;
    return low < -1e30 ? -1e30f : low > 1e30 ? 1e30f : (float)low;
}

static float float_up(double v)
{
    return -float_down(-v);
}

/* The three sides of an image, turned inwards. With ends off by an error each and rounding of a few
 * units, the value at a raster point is off by at most the error times twice the lengths involved,
 * doubled. */
static void find_sides(umb_depth_triangle *t, const umb_raster_map *map,
                       const umb_raster_point *const p[3])
{
    double area = (p[1]->x - p[0]->x) * (p[2]->y - p[0]->y) -
                  (p[1]->y - p[0]->y) * (p[2]->x - p[0]->x);
    double turn = area < 0.0 ? -1.0 : 1.0;
    double raster = (double)map->width + map->height;
    t->side_count = 3;
    for (int i = 0; i < 3; ++i) {
        const umb_raster_point *a = p[i], *b = p[(i + 1) % 3];
        double dx = turn * (b->x - a->x), dy = turn * (b->y - a->y);
        double reach = raster + fabs(a->x) + fabs(a->y), length = fabs(dx) + fabs(dy);
        double error = a->error > b->error ? a->error : b->error;
        t->ex[i] = -dy;
        t->ey[i] = dx;
        t->e0[i] = dy * a->x - dx * a->y;
        t->margin[i] = 4.0 * error * (reach + length) + 16.0 * UMB_U * length * reach;
    }
}

void umb_silhouette_depth(const umb_silhouette *s, const umb_raster_map *map,
                          const umb_front_triangle *front, umb_depth_triangle *out)
{
    const uint32_t *corner = front->corner;
    umb_plane_nearness plane = {0.0, 0.0, front->least, 0.0};
    (void)umb_face_nearness(map, &front->face, s->world[corner[0]], &plane);
    out->gx = plane.gx;
    out->gy = plane.gy;
    out->g0 = plane.g0 - plane.error;
    out->least = front->least;
    out->side_count = 0;
    if (kept(s, corner[0]) && kept(s, corner[1]) && kept(s, corner[2])) {
        const umb_raster_point *const p[3] = {&s->points[corner[0]], &s->points[corner[1]],
                                              &s->points[corner[2]]};
        find_sides(out, map, p);
    }
}

static void add_triangle(umb_silhouette *s, const umb_raster_map *map, const umb_face *f,
                         const uint32_t corner[3], const box *image)
{
    umb_front_triangle *t = &s->triangles[s->triangle_count++];
    memcpy(t->corner, corner, sizeof t->corner);
    t->face = *f;
    /* Corners that the cut takes away are nearer than those it leaves. */
    t->least = INFINITY;
    double most = -INFINITY;
    for (int i = 0; i < 3; ++i) {
        if (kept(s, corner[i])) {
            double z = vertex_nearness(map, s->views[corner[i]]);
            t->least = z < t->least ? z : t->least;
            most = z > most ? z : most;
        } else {
            most = map->orthographic ? -s->cut_depth : 1.0 / s->cut_depth;
        }
    }
    s->most = most > s->most ? most : s->most;
    t->x_min = float_down(image->x_min);
    t->y_min = float_down(image->y_min);
    t->x_max = float_up(image->x_max);
    t->y_max = float_up(image->y_max);
}

static void find_front(umb_silhouette *s, const umb_raster_map *map, const umb_occluder *o)
{
    const umb_mesh *mesh = o->mesh;
    for (uint32_t i = 0; i < mesh->triangle_count; ++i) {
        const uint32_t *corner = mesh->triangles[i];
        umb_face f = umb_face_of(map, s->world[corner[0]], s->world[corner[1]], s->world[corner[2]]);
        s->sides[i] = side_of(&f, o->mirrored, mesh->two_sided[i] != 0);
        if (s->sides[i] == 0) {
            continue;
        }
        box image = {INFINITY, INFINITY, -INFINITY, -INFINITY};
        if (cut_triangle(s, map, corner, s->sides[i], &image)) {
            add_triangle(s, map, &f, corner, &image);
            s->x_min = image.x_min < s->x_min ? image.x_min : s->x_min;
            s->y_min = image.y_min < s->y_min ? image.y_min : s->y_min;
            s->x_max = image.x_max > s->x_max ? image.x_max : s->x_max;
            s->y_max = image.y_max > s->y_max ? image.y_max : s->y_max;
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
        bool keep0 = kept(s, e->v0), keep1 = kept(s, e->v1);
        if (net == 0 || (!keep0 && !keep1)) {
            continue;
        }
        umb_raster_point cut;
        const umb_raster_point *p = &s->points[e->v0], *q = &s->points[e->v1];
        if (!keep0) {
            cut = cut_edge(s, map, e->v1, e->v0);
            p = &cut;
        } else if (!keep1) {
            cut = cut_edge(s, map, e->v0, e->v1);
            q = &cut;
        }
        add_edge(s, p, q, net * map->turn);
    }
}

bool umb_silhouette_find(umb_silhouette *s, const umb_raster_map *map, const umb_occluder *occluder)
{
    s->edge_count = 0;
    s->triangle_count = 0;
    s->x_min = s->y_min = INFINITY;
    s->x_max = s->y_max = -INFINITY;
    s->most = -INFINITY;
    if (!place_vertices(s, map, occluder)) {
        return false;
    }
    find_front(s, map, occluder);
    if (s->triangle_count == 0 || s->x_max - s->x_min < 1.0 || s->y_max - s->y_min < 1.0 ||
        !(s->x_max > 0.0 && s->y_max > 0.0 && s->x_min < map->width && s->y_min < map->height)) {
        return false;
    }
    find_outline(s, map, occluder->mesh);
    return true;
}

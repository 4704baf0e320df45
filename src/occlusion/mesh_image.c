#include "mesh_image.h"

#include <string.h>

#include "base/memory.h"

static bool reserve_fill(umb_mesh_scratch *s, const umb_allocator *a, size_t columns, size_t rows)
{
    umb_mesh_fill *f = &s->fill;
    if (!umb_memory_reserve(a, (void **)&f->tiles, &s->tile_capacity, columns, UMB_ROW_TILE_BYTES) ||
        !umb_memory_reserve(a, (void **)&f->state, &s->state_capacity, columns, 1) ||
        !umb_memory_reserve(a, (void **)&f->list, &s->list_capacity, columns, sizeof *f->list) ||
        !umb_memory_reserve(a, (void **)&f->edges, &s->edge_capacity, rows, sizeof *f->edges) ||
        !umb_memory_reserve(a, (void **)&f->triangles, &s->triangle_capacity, rows, sizeof *f->triangles)) {
        return false;
    }
    memset(f->state, 0, columns);
    return true;
}

static bool reserve_silhouette(umb_mesh_scratch *s, const umb_allocator *a, const umb_committed *scene)
{
    if (s->structure == scene->structure + 1) {
        return true;
    }
    /* Known but for the last change: what that put in place is looked at alone. */
    bool known = s->structure != 0 && s->structure == scene->structure;
    uint32_t vertices = 0, triangles = 0, edges = 0;
    for (uint32_t i = 0, n = known ? scene->replaced_count : scene->occluder_count; i < n; ++i) {
        uint32_t number = known ? scene->replaced[i] : i;
        if (number >= scene->occluder_count) {
            continue;
        }
        const umb_mesh *m = scene->occluders[number].mesh;
        vertices = m->block_position_count > vertices ? m->block_position_count : vertices;
        triangles = m->triangle_count > triangles ? m->triangle_count : triangles;
        edges = m->edge_count > edges ? m->edge_count : edges;
    }
    if (!umb_silhouette_reserve(&s->silhouette, a, vertices, triangles, edges)) {
        return false;
    }
    s->structure = scene->structure + 1;
    return true;
}

bool umb_mesh_scratch_reserve(umb_mesh_scratch *s, const umb_allocator *a, const umb_raster_map *map,
                              const umb_committed *scene)
{
    size_t columns = (map->width + UMB_TILE_WIDTH - 1) / UMB_TILE_WIDTH;
    size_t rows = (map->height + UMB_TILE_HEIGHT - 1) / UMB_TILE_HEIGHT;
    return reserve_fill(s, a, columns, rows) && reserve_silhouette(s, a, scene);
}

void umb_mesh_scratch_free(umb_mesh_scratch *s, const umb_allocator *a)
{
    umb_silhouette_free(&s->silhouette, a);
    umb_memory_free(a, s->fill.tiles, s->tile_capacity * UMB_ROW_TILE_BYTES);
    umb_memory_free(a, s->fill.state, s->state_capacity);
    umb_memory_free(a, s->fill.list, s->list_capacity * sizeof *s->fill.list);
    umb_memory_free(a, s->fill.edges, s->edge_capacity * sizeof *s->fill.edges);
    umb_memory_free(a, s->fill.triangles, s->triangle_capacity * sizeof *s->fill.triangles);
    memset(s, 0, sizeof *s);
}

static uint16_t row_of_tiles(const umb_raster_map *map, double y, double widen)
{
    return (uint16_t)(umb_raster_map_row_at(map, y, widen) / UMB_TILE_HEIGHT);
}

static uint32_t column_of_tiles(const umb_raster_map *map, double x)
{
    double last = map->width - 1.0;
    return (uint32_t)(x < 0.0 ? 0.0 : x > last ? last : x) / UMB_TILE_WIDTH;
}

/* The window, and which edge and triangle begins in which row of tiles. Edges beside the window in height are
 * left out; those beside it in width count. */
static void list_edges(umb_mesh_scratch *m, const umb_raster_map *map)
{
    umb_silhouette *s = &m->silhouette;
    umb_mesh_fill *f = &m->fill;
    double slack = map->rows.slack;
    f->tx0 = column_of_tiles(map, s->x_min - s->error - 1.0);
    f->tx1 = column_of_tiles(map, s->x_max + s->error);
    f->ty0 = row_of_tiles(map, s->y_min - s->error, -slack);
    f->ty1 = row_of_tiles(map, s->y_max + s->error, slack);
    for (uint32_t ty = f->ty0; ty <= f->ty1; ++ty) {
        f->edges[ty] = f->triangles[ty] = UMB_NONE;
    }
    for (uint32_t i = 0; i < s->edge_count; ++i) {
        umb_outline_edge *e = &s->edges[i];
        if (e->y_max + e->error < 0.0 || e->y_min - e->error > map->height) {
            continue;
        }
        uint16_t row0 = row_of_tiles(map, e->y_min - e->error, -slack);
        e->row1 = row_of_tiles(map, e->y_max + e->error, slack);
        row0 = row0 < f->ty0 ? (uint16_t)f->ty0 : row0;
        e->next = f->edges[row0];
        f->edges[row0] = i;
    }
}

/* Planes are used when they are at no corner of the front farther than this part of its depth. */
#define PLANES_FIT 0x1p-6

/* A plane in floats, and how far it must be lowered to lie under all of the front: under its corners, since both
 * are affine between them. A front that is cut has corners that are not kept. */
static void store_plane(const umb_silhouette *s, const umb_raster_map *map, const umb_occluder *o,
                        const umb_silhouette_plane *p, umb_fill_plane *out)
{
    umb_front_triangle t;
    umb_silhouette_set_plane(&t, map, p);
    *out = (umb_fill_plane){t.gx, t.gy, t.low, t.far_corner, -INFINITY};
    if (s->cut) {
        return;
    }
    umb_silhouette_plane every = *p;
    every.low = INFINITY;
    every.far_corner = s->far_corner; /* what stands in for a plane that floats cannot hold */
    for (uint32_t i = 0; i < s->front_count; ++i) {
        double least, most;
        umb_silhouette_offsets(s, p, o->mesh->triangles[s->front[i]], &least, &most);
        every.low = least < every.low ? least : every.low;
    }
    every.low -= umb_silhouette_plane_error(s, p, s->error);
    umb_silhouette_set_plane(&t, map, &every);
    if (t.gx == out->gx && t.gy == out->gy) {
        out->every = t.low;
    }
}

/* True if the planes together give the front's corners about the depth that they have: where the front bulges in one
 * place and is hollow in another, they do not. */
static bool planes_fit(const umb_mesh_scratch *m, const umb_occluder *o)
{
    const umb_silhouette *s = &m->silhouette;
    const umb_mesh_fill *f = &m->fill;
    for (uint32_t i = 0; i < s->front_count && !s->cut; ++i) {
        for (int j = 0; j < 3; ++j) {
            uint32_t k = o->mesh->triangles[s->front[i]][j];
            double some = INFINITY, every = -INFINITY;
            for (uint32_t p = 0; p < f->plane_count; ++p) {
                const umb_fill_plane *plane = &f->planes[p];
                double at = plane->gx * s->x[k] + plane->gy * s->y[k], low = at + plane->low;
                low = low > plane->least ? low : plane->least;
                some = low < some ? low : some;
                every = at + plane->every > every ? at + plane->every : every;
            }
            double bound = some > every ? some : every;
            if (bound < s->near_least[k] - PLANES_FIT * fabs(s->near_least[k])) {
                return false;
            }
        }
    }
    return !s->cut;
}

/* The planes of the front, a triangle at a time; false if there are too many. */
static bool list_planes(umb_mesh_scratch *m, const umb_raster_map *map, const umb_occluder *o)
{
    const umb_silhouette *s = &m->silhouette;
    umb_mesh_fill *f = &m->fill;
    umb_silhouette_plane planes[UMB_FILL_PLANES];
    uint32_t count = 0;
    for (uint32_t i = 0; i < s->front_count; ++i) {
        const uint32_t *corner = o->mesh->triangles[s->front[i]];
        bool shared = false;
        for (uint32_t k = 0; k < count && !shared; ++k) {
            shared = umb_silhouette_shares_plane(s, &planes[k], corner);
        }
        if (!shared && count == UMB_FILL_PLANES) {
            return false;
        }
        if (!shared) {
            umb_silhouette_plane_of(s, map, o, s->front[i], &planes[count++]);
        }
    }
    for (uint32_t k = 0; k < count; ++k) {
        store_plane(s, map, o, &planes[k], &f->planes[k]);
    }
    f->plane_count = count;
    return count == 1 || planes_fit(m, o);
}

/* Depth of the front: by planes, or one bound if its image is small; else triangle by triangle. */
static void list_depths(umb_mesh_scratch *m, const umb_raster_map *map, const umb_occluder *o)
{
    umb_silhouette *s = &m->silhouette;
    umb_mesh_fill *f = &m->fill;
    int32_t rows = umb_raster_map_row_at(map, s->y_max, 0.0) - umb_raster_map_row_at(map, s->y_min, 0.0);
    if (!s->cut && (s->x_max - s->x_min) * (rows + 1.0) < UMB_PLANE_PIXELS) {
        float least = (float)(s->far_corner - 0x1p-22 * fabs(s->far_corner));
        f->planes[0] = (umb_fill_plane){0.0f, 0.0f, least, least, least};
        f->plane_count = 1;
        return;
    }
    if (list_planes(m, map, o)) {
        return;
    }
    f->plane_count = 0;
    umb_silhouette_depths(s, map, o);
    for (uint32_t i = 0; i < s->triangle_count; ++i) {
        umb_front_triangle *t = &s->triangles[i];
        uint32_t row = t->next < f->ty0 ? f->ty0 : t->next > f->ty1 ? f->ty1 : t->next;
        t->next = f->triangles[row];
        f->triangles[row] = i;
    }
}

/* What a mesh of fewer pixels than this across covers is not worth its many edges. */
#define LEAST_PIXELS 4

static bool is_tiny(const umb_silhouette *s, const umb_raster_map *map)
{
    return !s->cut && (s->x_max - s->x_min < LEAST_PIXELS ||
                       umb_raster_map_row(map, s->y_max) - umb_raster_map_row(map, s->y_min) < LEAST_PIXELS);
}

bool umb_mesh_image_find(umb_mesh_scratch *m, const umb_raster_map *map, const umb_occluder *o)
{
    umb_silhouette *s = &m->silhouette;
    return s->any && !is_tiny(s, map) && umb_silhouette_find(s, map, o);
}

void umb_mesh_image_list(umb_mesh_scratch *m, const umb_raster_map *map, const umb_occluder *o)
{
    list_edges(m, map);
    list_depths(m, map, o);
}

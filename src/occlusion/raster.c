/* The strict silhouette raster, after the incremental occlusion maps of Gummerus 5.5: each
 * occluder's silhouette is filled a row of tiles at a time, its depth bounded a sub-tile at a time,
 * and the result merged into one buffer of covered pixels. docs/conservative.md proves that nothing
 * seen is hidden. */
#include <string.h>

#include "base/memory.h"
#include "method.h"
#include "raster_kernels.h"
#include "silhouette.h"

typedef struct raster {
    umb_allocator allocator;
    const umb_raster_kernels *kernels;
    umb_raster_map map;
    const umb_committed *scene;
    uint64_t structure; /* of the scene that the scratch was sized for; 0: none */
    umb_coverage coverage;
    umb_silhouette silhouette;
    umb_mesh_fill fill;
    umb_convex convex; /* of the occluder convex_of, UMB_NONE: of none */
    umb_convex_result convex_found;
    uint32_t convex_of;
    size_t tile_capacity, state_capacity, list_capacity, edge_capacity, triangle_capacity;
} raster;

static umb_result create(const umb_allocator *allocator, umb_isa isa, void **state)
{
    raster *r = umb_memory_allocate_zero(allocator, 1, sizeof *r);
    if (r == NULL) {
        return UMB_ERROR_MEMORY;
    }
    r->allocator = *allocator;
    r->kernels = umb_raster_kernels_get(isa);
    *state = r;
    return UMB_OK;
}

static void destroy(void *state)
{
    raster *r = state;
    umb_allocator a = r->allocator;
    umb_coverage_free(&r->coverage, &a);
    umb_silhouette_free(&r->silhouette, &a);
    umb_memory_free(&a, r->fill.tiles, r->tile_capacity * UMB_ROW_TILE_BYTES);
    umb_memory_free(&a, r->fill.state, r->state_capacity);
    umb_memory_free(&a, r->fill.list, r->list_capacity * sizeof *r->fill.list);
    umb_memory_free(&a, r->fill.edges, r->edge_capacity * sizeof *r->fill.edges);
    umb_memory_free(&a, r->fill.triangles, r->triangle_capacity * sizeof *r->fill.triangles);
    umb_memory_free(&a, r, sizeof *r);
}

static bool reserve_fill(raster *r)
{
    const umb_allocator *a = &r->allocator;
    size_t columns = r->coverage.columns, rows = r->coverage.rows;
    umb_mesh_fill *f = &r->fill;
    if (!umb_memory_reserve(a, (void **)&f->tiles, &r->tile_capacity, columns, UMB_ROW_TILE_BYTES) ||
        !umb_memory_reserve(a, (void **)&f->state, &r->state_capacity, columns, 1) ||
        !umb_memory_reserve(a, (void **)&f->list, &r->list_capacity, columns, sizeof *f->list) ||
        !umb_memory_reserve(a, (void **)&f->edges, &r->edge_capacity, rows, sizeof *f->edges) ||
        !umb_memory_reserve(a, (void **)&f->triangles, &r->triangle_capacity, rows, sizeof *f->triangles)) {
        return false;
    }
    memset(f->state, 0, columns);
    return true;
}

static bool reserve_silhouette(raster *r, const umb_committed *scene)
{
    if (r->structure == scene->structure + 1) {
        return true;
    }
    uint32_t vertices = 0, triangles = 0, edges = 0;
    for (uint32_t i = 0; i < scene->occluder_count; ++i) {
        const umb_mesh *m = scene->occluders[i].mesh;
        vertices = m->block_position_count > vertices ? m->block_position_count : vertices;
        triangles = m->triangle_count > triangles ? m->triangle_count : triangles;
        edges = m->edge_count > edges ? m->edge_count : edges;
    }
    if (!umb_silhouette_reserve(&r->silhouette, &r->allocator, vertices, triangles, edges)) {
        return false;
    }
    r->structure = scene->structure + 1;
    return true;
}

static umb_result prepare(void *state, const umb_raster_map *map, const umb_committed *scene)
{
    raster *r = state;
    r->map = *map;
    r->scene = scene;
    r->convex_of = UMB_NONE;
    if (!umb_coverage_resize(&r->coverage, &r->allocator, map->width, map->height) ||
        !reserve_fill(r) ||
        !reserve_silhouette(r, scene)) {
        return UMB_ERROR_MEMORY;
    }
    umb_coverage_clear(&r->coverage);
    return UMB_OK;
}

static uint32_t hides(const void *state, const umb_projected *boxes, uint32_t mask)
{
    const raster *r = state;
    return r->kernels->hides(&r->coverage, boxes, mask);
}

static bool hidden(const void *state, const umb_image *image, const umb_outline *outline)
{
    const raster *r = state;
    if (image->rect.x0 > image->rect.x1 ||
        r->kernels->hides_rect(&r->coverage, image->rect, image->nearness)) {
        return true;
    }
    if (outline == NULL) {
        return false;
    }
    umb_convex polygon;
    umb_convex_of_outline(outline, &r->map, &polygon);
    return r->kernels->hides_convex(&r->coverage, &r->map, &polygon, image->rect);
}

static bool open_at(const void *state, double x, double y, double nearness)
{
    const umb_coverage *c = &((const raster *)state)->coverage;
    if (!(x >= 0.0 && y >= 0.0 && x < c->width && y < c->height)) {
        return false;
    }
    uint32_t column = (uint32_t)x, row = (uint32_t)umb_raster_map_row_at(&((const raster *)state)->map, y, 0.0);
    const umb_tile
        *t = &c->tiles[(size_t)(row / UMB_TILE_HEIGHT) * c->columns + column / UMB_TILE_WIDTH];
    uint32_t r = row % UMB_TILE_HEIGHT, bit = column % UMB_TILE_WIDTH;
    return (t->mask[r] >> bit & 1u) == 0 || t->z[4 * (r / 4) + bit / 8] < nearness;
}

/* The convex image of an occluder; asked for and drawn one after the other, it is found once. */
static umb_convex_result find_convex(raster *r, uint32_t occluder)
{
    const umb_occluder *o = &r->scene->occluders[occluder];
    if (r->convex_of != occluder) {
        r->convex_of = occluder;
        r->kernels->place(&r->silhouette, &r->map, o);
        r->convex_found = !r->silhouette.any  ? UMB_CONVEX_NOTHING
                          : r->silhouette.cut ? UMB_CONVEX_OTHER
                                              : r->kernels->find_convex(&r->map, o, &r->silhouette, &r->convex);
    }
    return r->convex_found;
}

static bool is_body(const umb_mesh *mesh)
{
    return mesh->convex && mesh->triangle_count <= UMB_CONVEX_TRIANGLES;
}

static bool hides_body(void *state, uint32_t occluder, const umb_image *image)
{
    raster *r = state;
    if (!is_body(r->scene->occluders[occluder].mesh) || find_convex(r, occluder) == UMB_CONVEX_OTHER ||
        !r->silhouette.any || r->silhouette.cut) {
        return false;
    }
    return r->kernels->hides_convex(&r->coverage, &r->map, &r->convex, image->rect);
}

static uint16_t row_of_tiles(const raster *r, double y, double widen)
{
    return (uint16_t)(umb_raster_map_row_at(&r->map, y, widen) / UMB_TILE_HEIGHT);
}

static uint32_t column_of_tiles(const raster *r, double x)
{
    double last = r->map.width - 1.0;
    return (uint32_t)(x < 0.0 ? 0.0 : x > last ? last : x) / UMB_TILE_WIDTH;
}

/* The window, and which edge and triangle begins in which row of tiles. Edges beside the window in height are
 * left out; those beside it in width count. */
static void list_edges(raster *r)
{
    umb_silhouette *s = &r->silhouette;
    umb_mesh_fill *f = &r->fill;
    double slack = r->map.rows.slack;
    f->tx0 = column_of_tiles(r, s->x_min - s->error - 1.0);
    f->tx1 = column_of_tiles(r, s->x_max + s->error);
    f->ty0 = row_of_tiles(r, s->y_min - s->error, -slack);
    f->ty1 = row_of_tiles(r, s->y_max + s->error, slack);
    for (uint32_t ty = f->ty0; ty <= f->ty1; ++ty) {
        f->edges[ty] = f->triangles[ty] = UMB_NONE;
    }
    for (uint32_t i = 0; i < s->edge_count; ++i) {
        umb_outline_edge *e = &s->edges[i];
        if (e->y_max + e->error < 0.0 || e->y_min - e->error > r->map.height) {
            continue;
        }
        uint16_t row0 = row_of_tiles(r, e->y_min - e->error, -slack);
        e->row1 = row_of_tiles(r, e->y_max + e->error, slack);
        row0 = row0 < f->ty0 ? (uint16_t)f->ty0 : row0;
        e->next = f->edges[row0];
        f->edges[row0] = i;
    }
}

/* Planes are used when they are at no corner of the front farther than this part of its depth. */
#define PLANES_FIT 0x1p-6

/* A plane in floats, and how far it must be lowered to lie under all of the front: under its corners, since both
 * are affine between them. A front that is cut has corners that are not kept. */
static void store_plane(const raster *r, const umb_occluder *o, const umb_silhouette_plane *p,
                        umb_fill_plane *out)
{
    const umb_silhouette *s = &r->silhouette;
    umb_front_triangle t;
    umb_silhouette_set_plane(&t, &r->map, p);
    *out = (umb_fill_plane){t.gx, t.gy, t.low, t.far_corner, -INFINITY};
    if (s->cut) {
        return;
    }
    umb_silhouette_plane every = *p;
    every.low = INFINITY;
    for (uint32_t i = 0; i < s->front_count; ++i) {
        double least, most;
        umb_silhouette_offsets(s, p, o->mesh->triangles[s->front[i]], &least, &most);
        every.low = least < every.low ? least : every.low;
    }
    every.low -= umb_silhouette_plane_error(s, p, s->error);
    umb_silhouette_set_plane(&t, &r->map, &every);
    if (t.gx == out->gx && t.gy == out->gy) {
        out->every = t.low;
    }
}

/* True if the planes together give the front's corners about the depth that they have: where the front bulges in one
 * place and is hollow in another, they do not. */
static bool planes_fit(const raster *r, const umb_occluder *o)
{
    const umb_silhouette *s = &r->silhouette;
    const umb_mesh_fill *f = &r->fill;
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
static bool list_planes(raster *r, const umb_occluder *o)
{
    const umb_silhouette *s = &r->silhouette;
    umb_mesh_fill *f = &r->fill;
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
            umb_silhouette_plane_of(s, &r->map, o, s->front[i], &planes[count++]);
        }
    }
    for (uint32_t k = 0; k < count; ++k) {
        store_plane(r, o, &planes[k], &f->planes[k]);
    }
    f->plane_count = count;
    return count == 1 || planes_fit(r, o);
}

/* Depth of the front: by planes, or one bound if its image is small; else triangle by triangle. */
static void list_depths(raster *r, const umb_occluder *o)
{
    umb_silhouette *s = &r->silhouette;
    umb_mesh_fill *f = &r->fill;
    int32_t rows = umb_raster_map_row_at(&r->map, s->y_max, 0.0) - umb_raster_map_row_at(&r->map, s->y_min, 0.0);
    if (!s->cut && (s->x_max - s->x_min) * (rows + 1.0) < UMB_PLANE_PIXELS) {
        float least = (float)(s->far_corner - 0x1p-22 * fabs(s->far_corner));
        f->planes[0] = (umb_fill_plane){0.0f, 0.0f, least, least, least};
        f->plane_count = 1;
        return;
    }
    if (list_planes(r, o)) {
        return;
    }
    f->plane_count = 0;
    umb_silhouette_depths(s, &r->map, o);
    for (uint32_t i = 0; i < s->triangle_count; ++i) {
        umb_front_triangle *t = &s->triangles[i];
        uint32_t row = t->next < f->ty0 ? f->ty0 : t->next > f->ty1 ? f->ty1 : t->next;
        t->next = f->triangles[row];
        f->triangles[row] = i;
    }
}

/* What a mesh of fewer pixels than this across covers is not worth its many edges. */
#define LEAST_PIXELS 4

static bool is_tiny(const raster *r)
{
    const umb_silhouette *s = &r->silhouette;
    return !s->cut && (s->x_max - s->x_min < LEAST_PIXELS ||
                       umb_raster_map_row(&r->map, s->y_max) - umb_raster_map_row(&r->map, s->y_min) < LEAST_PIXELS);
}

static bool occlude(void *state, uint32_t occluder, umb_cull_stats *stats)
{
    raster *r = state;
    const umb_occluder *o = &r->scene->occluders[occluder];
    umb_silhouette *s = &r->silhouette;
    bool body = is_body(o->mesh);
    umb_convex_result found = UMB_CONVEX_OTHER;
    if (body) {
        found = find_convex(r, occluder);
    } else {
        r->convex_of = UMB_NONE;
        r->kernels->place(s, &r->map, o);
    }
    if (found == UMB_CONVEX_OTHER) {
        if (!s->any || is_tiny(r) || !umb_silhouette_find(s, &r->map, o)) {
            return false;
        }
        found = body ? umb_convex_of_silhouette(s, &r->map, o, &r->convex) : UMB_CONVEX_OTHER;
        r->convex_of = UMB_NONE;
    }
    if (found == UMB_CONVEX_NOTHING) {
        return false;
    }
    stats->occluders += 1;
    if (found == UMB_CONVEX_READY) {
        stats->edges += r->convex.edge_count;
        return r->kernels->fill_convex(&r->coverage, &r->map, &r->convex);
    }
    stats->edges += s->edge_count;
    list_edges(r);
    list_depths(r, o);
    return r->kernels->fill_mesh(&r->coverage, &r->map, s, &r->fill);
}

static const umb_coverage *buffer(const void *state)
{
    return &((const raster *)state)->coverage;
}

const umb_method_ops umb_raster_method = {
    "raster", UMB_CLASS_STRICT, create, destroy, prepare, hides, hidden, hides_body, open_at, occlude, buffer,
};

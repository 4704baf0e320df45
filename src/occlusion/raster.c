/* The strict silhouette raster, after the incremental occlusion maps of Gummerus 5.5: each
 * occluder's silhouette is filled a row of tiles at a time, its depth bounded a sub-tile at a time,
 * and the result merged into one buffer of covered pixels. docs/conservative.md proves that nothing
 * seen is hidden. */
#include "ahead.h"
#include "base/memory.h"
#include "mesh_image.h"
#include "method.h"
#include "raster_kernels.h"

typedef struct raster {
    umb_allocator allocator;
    const umb_raster_kernels *kernels;
    umb_raster_map map;
    const umb_committed *scene;
    umb_coverage coverage;
    umb_mesh_scratch scratch;
    umb_convex convex; /* of the occluder convex_of, UMB_NONE: of none */
    umb_convex_result convex_found;
    uint32_t convex_of;
    uint32_t approached, placed; /* the occluder whose vertices the scratch holds: relative to the eye; on the raster */
    umb_ahead ahead;
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
    umb_mesh_scratch_free(&r->scratch, &a);
    umb_ahead_free(&r->ahead, &a);
    umb_memory_free(&a, r, sizeof *r);
}

/* The scratch is used for something else. */
static void forget(raster *r)
{
    r->convex_of = r->approached = r->placed = UMB_NONE;
}

static umb_result prepare(void *state, const umb_raster_map *map, const umb_committed *scene)
{
    raster *r = state;
    r->map = *map;
    r->scene = scene;
    forget(r);
    if (!umb_coverage_resize(&r->coverage, &r->allocator, map->width, map->height) ||
        !umb_mesh_scratch_reserve(&r->scratch, &r->allocator, map, scene)) {
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

/* o: the occluder, or what of it its object says. */
static void approach(raster *r, uint32_t occluder, const umb_occluder *o)
{
    if (r->approached != occluder) {
        forget(r);
        r->approached = occluder;
        r->kernels->approach(&r->scratch.silhouette, &r->map, o);
    }
}

/* The same again. */
static void place(raster *r, uint32_t occluder, const umb_occluder *o)
{
    if (r->placed != occluder) {
        approach(r, occluder, o);
        r->placed = occluder;
        r->kernels->place(&r->scratch.silhouette, &r->map);
    }
}

/* The convex image of an occluder; asked for and drawn one after the other, it is found once. */
static umb_convex_result find_convex(raster *r, uint32_t occluder)
{
    const umb_silhouette *s = &r->scratch.silhouette;
    place(r, occluder, &r->scene->occluders[occluder]);
    if (r->convex_of != occluder) {
        r->convex_of = occluder;
        r->convex_found = !s->any  ? UMB_CONVEX_NOTHING
                          : s->cut ? UMB_CONVEX_OTHER
                                   : r->kernels->find_convex(&r->map, &r->scene->occluders[occluder], s, &r->convex);
    }
    return r->convex_found;
}

static bool is_body(const umb_mesh *mesh)
{
    return mesh->convex && mesh->triangle_count <= UMB_CONVEX_TRIANGLES;
}

/* An object says where its body is, too, and is at hand: its occluder, which nobody has looked at yet, is somewhere in a
 * large list. */
static bool hides_body(void *state, const umb_object *o, const umb_image *image)
{
    raster *r = state;
    if (!is_body(o->mesh)) {
        return false;
    }
    const umb_occluder body = {.mesh = o->mesh, .transform = o->transform, .identity = o->identity};
    umb_silhouette *s = &r->scratch.silhouette;
    approach(r, o->occluder, &body);
    if (r->placed != o->occluder && r->kernels->shows_corner(&r->coverage, s, &r->map)) { /* as most that may be seen do */
        return false;
    }
    place(r, o->occluder, &body);
    if (!s->any || s->cut || find_convex(r, o->occluder) == UMB_CONVEX_OTHER) {
        return false;
    }
    return r->kernels->hides_convex(&r->coverage, &r->map, &r->convex, image->rect);
}

/* The same whether a helper has found the image or it is found now. */
static uint32_t occlude_with_mesh(raster *r, uint32_t occluder, umb_cull_stats *stats)
{
    const umb_ahead_image *image = umb_ahead_take(&r->ahead, occluder);
    uint32_t edge_count;
    bool drawn;
    uint32_t changed = 0;
    if (image != NULL) {
        drawn = image->drawn;
        edge_count = drawn ? image->edge_count : 0;
        changed = drawn ? r->kernels->merge_list(&r->coverage, &image->list) : 0;
    } else {
        const umb_occluder *o = &r->scene->occluders[occluder];
        umb_silhouette *s = &r->scratch.silhouette;
        forget(r);
        r->kernels->approach(s, &r->map, o);
        r->kernels->place(s, &r->map);
        drawn = umb_mesh_image_find(&r->scratch, &r->map, o);
        edge_count = drawn ? s->edge_count : 0;
        if (drawn) {
            umb_mesh_image_list(&r->scratch, &r->map, o);
            changed = r->kernels->fill_mesh(&r->coverage, &r->map, s, &r->scratch.fill);
        }
    }
    stats->occluders += drawn;
    stats->edges += edge_count;
    umb_ahead_note(&r->ahead, occluder, edge_count);
    return changed;
}

static uint32_t draw_convex(raster *r, umb_cull_stats *stats)
{
    stats->occluders += 1;
    stats->edges += r->convex.edge_count;
    return r->kernels->fill_convex(&r->coverage, &r->map, &r->convex);
}

static uint32_t occlude(void *state, uint32_t occluder, const umb_aabb *box, umb_cull_stats *stats)
{
    raster *r = state;
    if (box != NULL) {
        r->convex_of = UMB_NONE;
        umb_convex_result found = r->kernels->find_box(&r->map, box, &r->convex);
        if (found != UMB_CONVEX_OTHER) {
            return found == UMB_CONVEX_READY ? draw_convex(r, stats) : 0;
        }
    }
    const umb_occluder *o = &r->scene->occluders[occluder];
    umb_silhouette *s = &r->scratch.silhouette;
    if (!is_body(o->mesh)) {
        return occlude_with_mesh(r, occluder, stats);
    }
    umb_convex_result found = find_convex(r, occluder);
    if (found == UMB_CONVEX_OTHER) {
        forget(r);
        if (!umb_mesh_image_find(&r->scratch, &r->map, o)) {
            return 0;
        }
        found = umb_convex_of_silhouette(s, &r->map, o, &r->convex);
    }
    if (found == UMB_CONVEX_NOTHING) {
        return 0;
    }
    if (found == UMB_CONVEX_READY) {
        return draw_convex(r, stats);
    }
    stats->occluders += 1;
    stats->edges += s->edge_count;
    umb_mesh_image_list(&r->scratch, &r->map, o);
    return r->kernels->fill_mesh(&r->coverage, &r->map, s, &r->scratch.fill);
}

static uint32_t look_ahead(void *state, uint32_t workers)
{
    raster *r = state;
    return umb_ahead_begin(&r->ahead, &r->allocator, r->kernels, &r->map, r->scene, workers);
}

static void help(void *state, uint32_t helper)
{
    umb_ahead_help(&((raster *)state)->ahead, helper);
}

static void finish(void *state)
{
    umb_ahead_end(&((raster *)state)->ahead);
}

static const umb_coverage *buffer(const void *state)
{
    return &((const raster *)state)->coverage;
}

const umb_method_ops umb_raster_method = {
    .name = "raster",
    .class_ = UMB_CLASS_STRICT,
    .create = create,
    .destroy = destroy,
    .prepare = prepare,
    .hides = hides,
    .hidden = hidden,
    .hides_body = hides_body,
    .open_at = open_at,
    .occlude = occlude,
    .buffer = buffer,
    .look_ahead = look_ahead,
    .help = help,
    .finish = finish,
};

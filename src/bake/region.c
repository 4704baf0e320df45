#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/isa.h"
#include "region_state.h"

#define DEFAULT_EFFORT 512

umb_result umb_region_fail(const umb_region *region, umb_result code, const char *format, ...)
{
    if (region->error != NULL) {
        va_list arguments;
        va_start(arguments, format);
        (void)vsnprintf(region->error->text, sizeof region->error->text, format, arguments);
        va_end(arguments);
        region->error->code = code;
    }
    return code;
}

umb_result umb_region_create(umb_index *index, const umb_region_def *def, umb_region **out)
{
    static const umb_region_def defaults = {0};
    def = def != NULL ? def : &defaults;
    *out = NULL;
    const umb_allocator *a = umb_scene_allocator(umb_index_scene(index));
    umb_isa isa;
    umb_result result = umb_isa_resolve(def->isa, &isa);
    umb_region *region = result == UMB_OK ? umb_memory_allocate_zero(a, 1, sizeof *region) : NULL;
    if (region == NULL) {
        umb_region failed = {.error = def->error};
        return result != UMB_OK
                   ? umb_region_fail(&failed, result, "this library has no kernels for %s", umb_isa_name(def->isa))
                   : umb_region_fail(&failed, UMB_ERROR_MEMORY, "no memory for a region engine");
    }
    region->index = index;
    region->allocator = *a;
    region->tasks = def->tasks;
    region->error = def->error;
    region->kernels = umb_umbra_kernels_get(isa);
    region->pieces.allocator = &region->allocator;
    region->found.allocator = &region->allocator;
    *out = region;
    return UMB_OK;
}

void umb_region_destroy(umb_region *region)
{
    if (region == NULL) {
        return;
    }
    umb_allocator a = region->allocator;
    umb_region_destroy(region->part);
    umb_solid_tree_free(&region->solid_tree, &a);
    umb_solids_free(&region->found);
    umb_memory_free(&a, region->solids.items, region->solids.capacity * sizeof *region->solids.items);
    umb_pieces_free(&region->pieces);
    for (int i = 0; i < UMB_REGION_MAPS; ++i) {
        umb_ray_map_free(&region->maps[i], &a);
    }
    umb_memory_free(&a, region->known, region->known_capacity);
    umb_memory_free(&a, region->used, region->used_capacity * sizeof *region->used);
    umb_memory_free(&a, region->queue, region->queue_capacity * sizeof *region->queue);
    umb_memory_free(&a, region->pvs, region->pvs_capacity * sizeof *region->pvs);
    umb_memory_free(&a, region->refined, region->refined_capacity * sizeof *region->refined);
    umb_memory_free(&a, region->verdicts, region->verdict_capacity);
    umb_memory_free(&a, region, sizeof *region);
}

static umb_result check_query(const umb_region *region, const umb_region_query *q)
{
    for (int k = 0; k < 3; ++k) {
        if (!(q->min[k] >= -1e15 && q->max[k] <= 1e15)) {
            return umb_region_fail(region, UMB_ERROR_ARGUMENT, "the cell's corners must be finite, at most 1e15");
        }
        if (!(q->min[k] <= q->max[k])) {
            return umb_region_fail(region, UMB_ERROR_ARGUMENT, "the cell is inverted along %c", "xyz"[k]);
        }
    }
    if ((unsigned)q->up > UMB_UP_NONE || q->umbrae > 8 ||
        (q->resolution != 0 && (q->resolution < 64 || q->resolution > 2048))) {
        return umb_region_fail(region, UMB_ERROR_ARGUMENT, "up, umbrae or resolution out of range");
    }
    if (q->outer != 0.0 && !(q->outer > 1.0 && q->outer <= 1e6)) {
        return umb_region_fail(region, UMB_ERROR_ARGUMENT, "outer must be above 1 and at most 1e6");
    }
    if (q->up == UMB_UP_NONE && (q->outer != 0.0 || q->half_umbra)) {
        return umb_region_fail(region, UMB_ERROR_ARGUMENT, "squares and half umbrae need a vertical");
    }
    if (!(q->near_depth >= 0.0 && q->near_depth <= 1e15)) {
        return umb_region_fail(region, UMB_ERROR_ARGUMENT, "near_depth must be finite and not negative");
    }
    return UMB_OK;
}

/* ---- public --------------------------------------------------------------------------------- */

static uint32_t triangles_of(const umb_object *o)
{
    return o->mesh != NULL ? o->mesh->seen_count : 0;
}

static uint64_t sum_triangles(const umb_committed *c, const uint32_t *ids, uint32_t count)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < count; ++i) {
        sum += triangles_of(&c->objects[ids[i]]);
    }
    return sum;
}

static int by_id(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

/* An object whose parts are in several slots was found several times. */
static uint32_t once_each(uint32_t *ids, uint32_t count)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; ++i) {
        if (kept == 0 || ids[kept - 1] != ids[i]) {
            ids[kept++] = ids[i];
        }
    }
    return kept;
}

static double largest(const umb_region_query *q, const umb_tree *tree)
{
    double reach = 0.0;
    for (int k = 0; k < 3; ++k) {
        reach = fmax(reach, fmax(fabs(q->min[k]), fabs(q->max[k])));
        reach = fmax(reach, fmax(fabs((double)tree->bounds.min[k]), fabs((double)tree->bounds.max[k])));
    }
    return reach;
}

/* The query with its defaults, and a cell that is nowhere thinner than what numbers of the scene's size can tell apart:
 * a larger cell sees more. */
static void set_cell(umb_region *region, const umb_region_query *query)
{
    umb_region_query *q = &region->query;
    *q = *query;
    uint32_t resolution = q->resolution != 0 ? q->resolution : 512, side = UMB_TILE * UMB_TILE;
    q->resolution = (resolution + side - 1) / side * side;
    q->umbrae = q->half_umbra ? 1 : q->umbrae != 0 ? q->umbrae : q->up == UMB_UP_NONE ? 8 : 2;
    uint32_t up = q->up == UMB_UP_NONE ? UMB_NONE : q->up == UMB_UP_Y ? 1 : q->up == UMB_UP_Z ? 2 : 0;
    for (uint32_t k = 0; k < 3; ++k) {
        double middle = 0.5 * (q->min[k] + q->max[k]), least = 0x1p-22 * region->reach;
        if (k != up && !(q->max[k] - q->min[k] >= 2.0 * least)) {
            q->min[k] = fmin(q->min[k], middle - least);
            q->max[k] = fmax(q->max[k], middle + least);
        }
    }
    umb_box_corners(q->min, q->max, region->corners);
}

static double surface_of(const umb_aabb *b)
{
    double x = (double)b->max[0] - b->min[0], y = (double)b->max[1] - b->min[1], z = (double)b->max[2] - b->min[2];
    double surface = 2.0 * (x * y + y * z + z * x);
    return surface > 0.0 && surface < INFINITY ? surface : 0.0; /* of no points: none */
}

static void count_objects(umb_region *region, const umb_committed *c)
{
    region->objects = 0;
    region->triangles = 0;
    region->surface = 0.0;
    for (uint32_t i = 0; i < c->object_count; ++i) {
        if (c->objects[i].live) {
            region->objects += 1;
            region->triangles += triangles_of(&c->objects[i]);
            region->surface += surface_of(&c->objects[i].bounds);
        }
    }
}

static umb_result prepare(umb_region *region, const umb_region_query *query)
{
    const umb_tree *tree = umb_index_tree(region->index);
    const umb_committed *c = umb_scene_committed(umb_index_scene(region->index));
    if (tree->version != c->version) {
        return umb_region_fail(region, UMB_ERROR_STATE, "the index could not follow the last commit");
    }
    /* Room for one at least: no list is NULL, which sorting would not take. */
    if (!umb_memory_reserve(&region->allocator, (void **)&region->pvs, &region->pvs_capacity,
                            (size_t)tree->object_count + 1, sizeof *region->pvs) ||
        !umb_memory_reserve(&region->allocator, (void **)&region->refined, &region->refined_capacity,
                            (size_t)c->object_count + 1, sizeof *region->refined) ||
        !umb_memory_reserve(&region->allocator, (void **)&region->verdicts, &region->verdict_capacity,
                            (size_t)tree->object_count + 1, 1) ||
        !umb_memory_reserve(&region->allocator, (void **)&region->known, &region->known_capacity,
                            (size_t)c->occluder_count + 1, 1)) {
        return UMB_ERROR_MEMORY;
    }
    if (region->version != c->version) {
        memset(region->known, 0, region->known_capacity);
        region->version = c->version;
        count_objects(region, c);
    }
    region->answer.stats.objects = region->objects;
    region->answer.stats.triangles = region->triangles;
    region->pieces.known = region->known;
    region->reach = largest(query, tree);
    set_cell(region, query);
    return UMB_OK;
}

umb_result umb_region_solve(umb_region *region, const umb_region_query *query, umb_region_answer *out)
{
    const umb_committed *c = umb_scene_committed(umb_index_scene(region->index));
    memset(out, 0, sizeof *out);
    memset(&region->answer, 0, sizeof region->answer);
    region->solved = false;
    umb_result result = check_query(region, query);
    if (result != UMB_OK) {
        return result;
    }
    result = prepare(region, query);
    result = result == UMB_OK ? umb_region_walk(region) : result;
    if (result != UMB_OK) {
        return result == UMB_ERROR_MEMORY ? umb_region_fail(region, result, "no memory for a view cell") : result;
    }
    umb_region_answer *a = &region->answer;
    qsort(region->pvs, a->pvs_count, sizeof *region->pvs, by_id);
    a->pvs_count = once_each(region->pvs, a->pvs_count);
    a->stats.mapped = a->pvs_count;
    a->stats.mapped_triangles = sum_triangles(c, region->pvs, a->pvs_count);
    memset(region->verdicts, UMB_LEFT, a->pvs_count);
    if (!query->maps_only && umb_region_look(region) != UMB_OK) {
        return umb_region_fail(region, UMB_ERROR_MEMORY, "no memory for a view cell");
    }
    a->pvs = region->pvs;
    a->stats.pvs_triangles = sum_triangles(c, a->pvs, a->pvs_count);
    region->solved = true;
    *out = *a;
    return UMB_OK;
}

umb_result umb_region_refine(umb_region *region, uint32_t effort, umb_region_answer *out)
{
    memset(out, 0, sizeof *out);
    if (!region->solved) {
        return umb_region_fail(region, UMB_ERROR_STATE, "there is no solved cell to refine");
    }
    umb_region_answer *a = &region->answer;
    if ((region->query.maps_only && umb_region_find_bodies(region) != UMB_OK) ||
        umb_region_decide_parts(region, effort != 0 ? effort : DEFAULT_EFFORT) != UMB_OK) {
        return umb_region_fail(region, UMB_ERROR_MEMORY, "no memory to refine %u objects", a->pvs_count);
    }
    a->refined_count = a->stats.undecided = 0;
    for (uint32_t i = 0; i < a->pvs_count; ++i) {
        if (region->verdicts[i] != UMB_HIDDEN) {
            region->refined[a->refined_count++] = a->pvs[i];
        }
        a->stats.undecided += region->verdicts[i] == UMB_UNDECIDED ? 1 : 0;
    }
    a->refined = region->refined;
    a->stats.refined_triangles = sum_triangles(umb_scene_committed(umb_index_scene(region->index)), a->refined,
                                               a->refined_count);
    *out = *a;
    return UMB_OK;
}

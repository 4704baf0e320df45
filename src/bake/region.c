#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/isa.h"
#include "region_state.h"

#define MOST_SOLIDS 32

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
    region->isa = isa;
    region->solids.allocator = &region->allocator;
    *out = region;
    return UMB_OK;
}

void umb_region_destroy(umb_region *region)
{
    if (region == NULL) {
        return;
    }
    umb_allocator a = region->allocator;
    umb_solids_free(&region->solids);
    umb_memory_free(&a, region->pvs, region->pvs_capacity * sizeof *region->pvs);
    umb_memory_free(&a, region->refined, region->refined_capacity * sizeof *region->refined);
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
    if ((unsigned)q->up > UMB_UP_X || q->umbrae > 8 ||
        (q->resolution != 0 && (q->resolution < 64 || q->resolution > 2048))) {
        return umb_region_fail(region, UMB_ERROR_ARGUMENT, "up, umbrae or resolution out of range");
    }
    if (q->outer != 0.0 && !(q->outer > 1.0 && q->outer <= 1e6)) {
        return umb_region_fail(region, UMB_ERROR_ARGUMENT, "outer must be above 1 and at most 1e6");
    }
    if (!(q->near_depth >= 0.0 && q->near_depth <= 1e15)) {
        return umb_region_fail(region, UMB_ERROR_ARGUMENT, "near_depth must be finite and not negative");
    }
    return UMB_OK;
}

/* ---- what may block ----------------------------------------------------------------------------- */

/* Square of the distance between a box and the cell. */
static double gap_squared(const umb_region_query *q, const umb_aabb *b)
{
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) {
        double below = q->min[k] - b->max[k], above = b->min[k] - q->max[k];
        double gap = fmax(0.0, fmax(below, above));
        sum += gap * gap;
    }
    return sum;
}

static double area(const umb_aabb *b)
{
    double x = (double)b->max[0] - b->min[0], y = (double)b->max[1] - b->min[1];
    double z = (double)b->max[2] - b->min[2];
    return x * y + y * z + z * x;
}

/* The occluders with the largest area for their distance. */
static umb_result choose_solids(umb_region *region)
{
    const umb_committed *c = umb_scene_committed(umb_index_scene(region->index));
    double least_gap = 4.0 * region->query.near_depth, scores[MOST_SOLIDS];
    uint32_t chosen[MOST_SOLIDS], count = 0;
    for (uint32_t i = 0; i < c->occluder_count; ++i) {
        double gap = gap_squared(&region->query, &c->occluders[i].bounds);
        if (!c->occluders[i].mesh->convex || gap < least_gap * least_gap) {
            continue;
        }
        double score = area(&c->occluders[i].bounds) / (gap + 1e-30);
        if (count == MOST_SOLIDS && score <= scores[count - 1]) {
            continue;
        }
        uint32_t at = count < MOST_SOLIDS ? count++ : count - 1;
        for (; at > 0 && scores[at - 1] < score; --at) {
            scores[at] = scores[at - 1];
            chosen[at] = chosen[at - 1];
        }
        scores[at] = score;
        chosen[at] = i;
    }
    for (uint32_t k = 0; k < count; ++k) {
        bool added;
        umb_result result = umb_solids_add(&region->solids, &c->occluders[chosen[k]], chosen[k],
                                           (const double(*)[3])region->corners, &added);
        if (result != UMB_OK) {
            return result;
        }
        region->answer.stats.occluders += added ? 1 : 0;
    }
    return UMB_OK;
}

static bool box_hidden(umb_region *region, const double min[3], const double max[3])
{
    double corners[8][3];
    umb_box_corners(min, max, corners);
    umb_corners cell = {(const double(*)[3])region->corners, 8}, box = {(const double(*)[3])corners, 8};
    region->answer.stats.queries += 1;
    for (size_t i = 0; i < region->solids.count; ++i) {
        if (umb_solid_blocks(&region->solids, &region->solids.items[i], cell, box, true) == 64) {
            return true;
        }
    }
    return false;
}

static void walk(umb_region *region, const umb_tree *tree, uint32_t number)
{
    const umb_node *n = umb_tree_node(tree, number);
    region->answer.stats.nodes += 1;
    for (uint32_t s = 0; s < n->count; ++s) {
        double min[3], max[3];
        for (int k = 0; k < 3; ++k) {
            min[k] = n->min[k][s];
            max[k] = n->max[k][s];
        }
        uint32_t kind = n->ref[s] & UMB_REF_KIND;
        if (kind == UMB_REF_OCCLUDER || box_hidden(region, min, max)) {
            continue;
        }
        if (kind == UMB_REF_NODE) {
            walk(region, tree, n->ref[s] & UMB_REF_NUMBER);
        } else {
            region->pvs[region->answer.pvs_count++] = n->ref[s] & UMB_REF_NUMBER;
        }
    }
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

static umb_result prepare(umb_region *region, const umb_region_query *query)
{
    const umb_tree *tree = umb_index_tree(region->index);
    const umb_committed *c = umb_scene_committed(umb_index_scene(region->index));
    if (tree->version != c->version) {
        return umb_region_fail(region, UMB_ERROR_STATE, "the index could not follow the last commit");
    }
    if (!umb_memory_reserve(&region->allocator, (void **)&region->pvs, &region->pvs_capacity, tree->object_count,
                            sizeof *region->pvs) ||
        !umb_memory_reserve(&region->allocator, (void **)&region->refined, &region->refined_capacity,
                            c->object_count, sizeof *region->refined)) {
        return UMB_ERROR_MEMORY;
    }
    region->query = *query;
    umb_box_corners(query->min, query->max, region->corners);
    region->solids.count = region->solids.plane_count = 0;
    region->solids.reach = largest(query, tree);
    for (uint32_t i = 0; i < c->object_count; ++i) {
        if (c->objects[i].live) {
            region->answer.stats.objects += 1;
            region->answer.stats.triangles += triangles_of(&c->objects[i]);
        }
    }
    return UMB_OK;
}

umb_result umb_region_solve(umb_region *region, const umb_region_query *query, umb_region_answer *out)
{
    const umb_tree *tree = umb_index_tree(region->index);
    const umb_committed *c = umb_scene_committed(umb_index_scene(region->index));
    memset(out, 0, sizeof *out);
    memset(&region->answer, 0, sizeof region->answer);
    region->solved = false;
    umb_result result = check_query(region, query);
    if (result != UMB_OK) {
        return result;
    }
    result = prepare(region, query);
    result = result == UMB_OK ? choose_solids(region) : result;
    if (result != UMB_OK) {
        return result == UMB_ERROR_MEMORY ? umb_region_fail(region, result, "no memory for a view cell") : result;
    }
    if (tree->node_count > 0) {
        for (uint32_t k = 0; k < (tree->flat ? tree->node_count : 1); ++k) {
            walk(region, tree, k);
        }
    }
    umb_region_answer *a = &region->answer;
    qsort(region->pvs, a->pvs_count, sizeof *region->pvs, by_id);
    a->pvs_count = once_each(region->pvs, a->pvs_count);
    a->pvs = region->pvs;
    a->stats.pvs_triangles = sum_triangles(c, a->pvs, a->pvs_count);
    region->solved = true;
    *out = *a;
    return UMB_OK;
}

umb_result umb_region_refine(umb_region *region, uint32_t effort, umb_region_answer *out)
{
    (void)effort;
    memset(out, 0, sizeof *out);
    if (!region->solved) {
        return umb_region_fail(region, UMB_ERROR_STATE, "there is no solved cell to refine");
    }
    umb_region_answer *a = &region->answer;
    memcpy(region->refined, a->pvs, a->pvs_count * sizeof *a->pvs);
    a->refined = region->refined;
    a->refined_count = a->stats.undecided = a->pvs_count;
    a->stats.refined_triangles = a->stats.pvs_triangles;
    *out = *a;
    return UMB_OK;
}

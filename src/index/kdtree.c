/* kd-trees. A box that a plane cuts becomes two parts, one in each half; a plane goes through a face of some box, where
 * it cuts fewer than beside it.
 *
 * The parts of the cells that are still to be cut are kept on one stack:
 *
 *     first                                    top
 *     | below only | cut | above only | ... | cut, above only |    the upper half is copied to the top, the lower
 *     | lower half       |            | ... | upper half      |    one stays; when it is done, the upper one comes
 *     | upper half                    | ...                        down: no part is there more than twice
 */
#include "kdtree.h"

#include <math.h>
#include <string.h>

#include "base/sort.h"
#include "cells.h"
#include "cut.h"

/* Cells with no more parts are leaves: one node holds them. */
#define LEAF_PARTS 4
/* The slots that parts may take beyond one an item, in units of the count. Each cell has a share by what it holds. */
#define MOST_EXTRA 2
/* Above this count the plane is looked for in bins first. */
#define EXACT_PARTS 1024
#define BINS 64
/* What opening a cell costs, in tests of a box. */
#define OPEN_COST 1.0

typedef struct kd {
    umb_cells cells;
    umb_index_rule rule;
    umb_bvh_item *stack;
    size_t top, capacity;
    uint64_t *faces, *scratch; /* of one cell's parts, twice the count of items each */
    size_t face_capacity, scratch_capacity;
    uint32_t most_depth;
} kd;

typedef struct cell {
    size_t first; /* on the stack */
    uint32_t count, depth;
    uint64_t extra; /* slots that cuts may still cost */
} cell;

typedef struct plane {
    int axis;
    float at;
    double cost;
} plane;

/* ---- faces ---------------------------------------------------------------------------------- */

/* One word: place, then lower faces after upper ones. */
static uint64_t face_word(float at, bool lower)
{
    return (uint64_t)umb_sort_float(at) << 32 | (lower ? 1 : 0);
}

static float face_place(uint64_t word)
{
    uint32_t bits = (uint32_t)(word >> 32);
    bits = (bits & 0x80000000u) != 0 ? bits & 0x7FFFFFFFu : ~bits;
    float at;
    memcpy(&at, &bits, sizeof(at));
    return at;
}

/* How a plane would divide a cell's parts: those that reach below it, and above it. */
typedef struct division {
    uint32_t below, above;
} division;

typedef struct sweep {
    const kd *k;
    const cell *c;
    umb_aabb box; /* of the parts */
    int axis;
    double whole; /* area of box, or its extent when flat */
} sweep;

static uint32_t cut_count(const cell *c, division d)
{
    return d.below + d.above - c->count;
}

static double size_of(const sweep *s, const umb_aabb *box)
{
    double area = umb_half_area(s->box.min, s->box.max);
    return area > 0.0 ? umb_half_area(box->min, box->max)
                      : (double)(box->max[s->axis]) - box->min[s->axis];
}

/* Expected tests below the cell (MacDonald and Booth 1990). */
static double area_cost(const sweep *s, float at, division d)
{
    umb_aabb low = s->box, high = s->box;
    low.max[s->axis] = high.min[s->axis] = at;
    double area = size_of(s, &low) * d.below + size_of(s, &high) * d.above;
    return OPEN_COST + area / s->whole;
}

/* Cuts, and far less than one for the distance from the middle; none for planes that leave too little on a side. */
static double median_cost(const sweep *s, division d)
{
    uint32_t cuts = cut_count(s->c, d);
    double off = fabs((double)d.below - d.above) / s->c->count;
    return off > 0.25 || 2 * cuts > s->c->count ? INFINITY : cuts + 0.5 * off;
}

static void consider(const sweep *s, float at, division d, plane *best)
{
    if (d.below == 0 || d.above == 0 || cut_count(s->c, d) > s->c->extra ||
        (d.below == s->c->count && d.above == s->c->count)) {
        return;
    }
    double cost = s->k->rule == UMB_RULE_MEDIAN ? median_cost(s, d) : area_cost(s, at, d);
    if (cost < best->cost) {
        *best = (plane){s->axis, at, cost};
    }
}

/* Try the planes through all faces from `from` to `to`. */
static void sweep_faces(const sweep *s, float from, float to, plane *best)
{
    const umb_bvh_item *parts = s->k->stack + s->c->first;
    uint64_t *faces = s->k->faces;
    uint32_t n = 0;
    division d = {0, s->c->count};
    for (uint32_t i = 0; i < s->c->count; ++i) {
        float low = parts[i].min[s->axis], high = parts[i].max[s->axis];
        if (low < from) {
            ++d.below;
        } else if (low <= to) {
            faces[n++] = face_word(low, true);
        }
        if (high < from) {
            --d.above;
        } else if (high <= to) {
            faces[n++] = face_word(high, false);
        }
    }
    const uint64_t *sorted = umb_sort_words(faces, s->k->scratch, n);
    for (uint32_t i = 0; i < n;) {
        uint32_t place = (uint32_t)(sorted[i] >> 32);
        float at = face_place(sorted[i]);
        for (; i < n && sorted[i] == (uint64_t)place << 32; ++i) {
            --d.above;
        }
        consider(s, at, d, best);
        for (; i < n && sorted[i] >> 32 == place; ++i) {
            ++d.below;
        }
    }
}

/* Where the best plane lies roughly: the two bins beside it. */
static void sweep_bins(const sweep *s, plane *best)
{
    const umb_bvh_item *parts = s->k->stack + s->c->first;
    uint32_t lows[BINS] = {0}, highs[BINS] = {0};
    double low = s->box.min[s->axis], extent = s->box.max[s->axis] - low, scale = BINS / extent;
    for (uint32_t i = 0; i < s->c->count; ++i) {
        int from = (int)((parts[i].min[s->axis] - low) * scale), to = (int)((parts[i].max[s->axis] - low) * scale);
        ++lows[from < BINS ? from : BINS - 1];
        ++highs[to < BINS ? to : BINS - 1];
    }
    division d = {0, s->c->count};
    for (int b = 1; b < BINS; ++b) {
        d.below += lows[b - 1];
        d.above -= highs[b - 1];
        consider(s, (float)(low + extent * b / BINS), d, best);
    }
}

/* ---- choosing a plane ----------------------------------------------------------------------- */

static umb_aabb box_of_parts(const kd *k, const cell *c)
{
    const umb_bvh_item *parts = k->stack + c->first;
    umb_aabb b;
    memcpy(b.min, parts[0].min, sizeof(b.min));
    memcpy(b.max, parts[0].max, sizeof(b.max));
    for (uint32_t i = 1; i < c->count; ++i) {
        for (int a = 0; a < 3; ++a) {
            b.min[a] = parts[i].min[a] < b.min[a] ? parts[i].min[a] : b.min[a];
            b.max[a] = parts[i].max[a] > b.max[a] ? parts[i].max[a] : b.max[a];
        }
    }
    return b;
}

static void try_axis(sweep *s, int axis, plane *best)
{
    float low = s->box.min[axis], high = s->box.max[axis];
    s->axis = axis;
    s->whole = size_of(s, &s->box);
    if (!(low < high) || !(s->whole > 0.0)) {
        return;
    }
    if (s->k->rule == UMB_RULE_MEDIAN || s->c->count <= EXACT_PARTS) {
        sweep_faces(s, low, high, best);
        return;
    }
    sweep_bins(s, best);
}

/* Bins know only roughly what a plane divides: take the best face near it, or in a gap of bins the best of all. */
static void refine(sweep *s, plane *best)
{
    double low = s->box.min[best->axis], step = (s->box.max[best->axis] - low) / BINS, at = best->at;
    s->axis = best->axis;
    s->whole = size_of(s, &s->box);
    best->cost = INFINITY;
    sweep_faces(s, (float)(at - step), (float)(at + step), best);
    if (isinf(best->cost)) {
        sweep_faces(s, s->box.min[s->axis], s->box.max[s->axis], best);
    }
}

static bool choose(const kd *k, const cell *c, plane *best)
{
    sweep s = {.k = k, .c = c, .box = box_of_parts(k, c)};
    best->cost = INFINITY;
    if (k->rule == UMB_RULE_MEDIAN) {
        for (uint32_t turn = 0; turn < 3 && isinf(best->cost); ++turn) {
            try_axis(&s, (int)((c->depth + turn) % 3), best);
        }
        return !isinf(best->cost);
    }
    for (int axis = 0; axis < 3; ++axis) {
        try_axis(&s, axis, best);
    }
    if (!isinf(best->cost) && c->count > EXACT_PARTS) {
        refine(&s, best);
    }
    return best->cost < c->count;
}

/* ---- recursion ------------------------------------------------------------------------------ */

static void swap(umb_bvh_item *a, umb_bvh_item *b)
{
    umb_bvh_item t = *a;
    *a = *b;
    *b = t;
}

/* Order a cell's parts: below a plane, cut by it, above. Returns how many are below, and sets how many are cut. What
 * lies in the plane is below. */
static uint32_t sort_parts(umb_bvh_item *parts, uint32_t count, const plane *p, uint32_t *cut)
{
    uint32_t low = 0, at = 0, high = count;
    while (at < high) {
        if (!(parts[at].max[p->axis] > p->at)) {
            swap(&parts[low++], &parts[at++]);
        } else if (!(parts[at].min[p->axis] < p->at)) {
            swap(&parts[at], &parts[--high]);
        } else {
            ++at;
        }
    }
    *cut = high - low;
    return low;
}

static uint32_t build(kd *k, const cell *c);

static uint32_t build_halves(kd *k, const cell *c, const plane *p)
{
    uint32_t cut, middle, below = sort_parts(k->stack + c->first, c->count, p, &cut);
    uint32_t above = c->count - below;
    size_t top = k->top;
    if (!umb_memory_reserve(k->cells.allocator, (void **)&k->stack, &k->capacity, top + above,
                            sizeof(k->stack[0]))) {
        k->cells.failed = true;
        return UMB_NONE;
    }
    memcpy(k->stack + top, k->stack + c->first + below, above * sizeof(k->stack[0]));
    for (uint32_t i = 0; i < cut; ++i) {
        k->stack[c->first + below + i].max[p->axis] = p->at;
        k->stack[top + i].min[p->axis] = p->at;
    }
    k->top = top + above;
    uint64_t extra = c->extra - cut, lower = extra * (below + cut) / (c->count + cut);
    cell half = {c->first, below + cut, c->depth + 1, lower};
    uint32_t left = build(k, &half);
    middle = k->cells.count;
    memmove(k->stack + c->first, k->stack + top, above * sizeof(k->stack[0]));
    k->top = top;
    half = (cell){c->first, above, c->depth + 1, extra - lower};
    uint32_t right = build(k, &half);
    umb_cell_cut where = {.axis = (uint8_t)p->axis, .at = p->at};
    return umb_cells_join(&k->cells, left, middle, right, &where);
}

static uint32_t build(kd *k, const cell *c)
{
    plane p;
    if (c->count <= LEAF_PARTS || c->depth >= k->most_depth || k->cells.failed || !choose(k, c, &p)) {
        return umb_cells_add_leaf(&k->cells, k->stack + c->first, c->count);
    }
    return build_halves(k, c, &p);
}

static bool start(kd *k, const umb_bvh_item *items, uint32_t count)
{
    const umb_allocator *a = k->cells.allocator;
    if (!umb_memory_reserve(a, (void **)&k->stack, &k->capacity, count, sizeof(k->stack[0])) ||
        !umb_memory_reserve(a, (void **)&k->faces, &k->face_capacity, 2 * (size_t)count, sizeof(k->faces[0])) ||
        !umb_memory_reserve(a, (void **)&k->scratch, &k->scratch_capacity, 2 * (size_t)count,
                            sizeof(k->scratch[0]))) {
        return false;
    }
    memcpy(k->stack, items, count * sizeof(items[0]));
    k->top = count;
    return true;
}

umb_result umb_kdtree_build(const umb_allocator *a, umb_index_rule rule, const umb_bvh_item *items, uint32_t count,
                            umb_built *out)
{
    kd k = {.rule = rule, .most_depth = 8 + 3 * (32u - (uint32_t)__builtin_clz(count)) / 2};
    umb_result result = UMB_ERROR_MEMORY;
    umb_cells_start(&k.cells, a);
    *out = (umb_built){0};
    if (start(&k, items, count)) {
        cell all = {0, count, 0, (uint64_t)MOST_EXTRA * count};
        uint32_t root = build(&k, &all);
        result = umb_cells_finish(&k.cells, root, out);
    }
    umb_memory_free(a, k.stack, k.capacity * sizeof(k.stack[0]));
    umb_memory_free(a, k.faces, k.face_capacity * sizeof(k.faces[0]));
    umb_memory_free(a, k.scratch, k.scratch_capacity * sizeof(k.scratch[0]));
    umb_cells_free(&k.cells);
    return result;
}

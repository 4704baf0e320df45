/* kd-trees. A box that a plane cuts becomes two parts, one in each half; a plane goes through a face of some box, where
 * it cuts fewer than beside it.
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
/* Bittner, Aila: how far from the middle of a cell a plane may be, of its extent. */
#define WINDOW 0.125
/* Aila: what fills more of its cell than this stays there. */
#define FILLED 0.5
/* What opening a cell costs, in tests of a box. */
#define OPEN_COST 1.0

typedef struct kd {
    umb_cells cells;
    umb_index_rule rule;
    uint64_t *faces, *scratch; /* of one cell's parts, twice the count of items each */
    size_t face_capacity, scratch_capacity;
    uint32_t most_depth;
} kd;

typedef struct cell {
    umb_cell_run run;
    uint32_t depth;
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
    return d.below + d.above - c->run.count;
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
    double off = fabs((double)d.below - d.above) / s->c->run.count;
    return off > 0.25 || 2 * cuts > s->c->run.count ? INFINITY : cuts + 0.5 * off;
}

/* Cuts, and far less than one for the distance from the middle of the cell. */
static double middle_cost(const sweep *s, float at, division d)
{
    double low = s->box.min[s->axis], extent = s->box.max[s->axis] - low;
    return cut_count(s->c, d) + fabs((at - low) / extent - 0.5);
}

static double cost_of(const sweep *s, float at, division d)
{
    switch (s->k->rule) {
    case UMB_RULE_MEDIAN:
        return median_cost(s, d);
    case UMB_RULE_BITTNER:
    case UMB_RULE_AILA:
        return middle_cost(s, at, d);
    default:
        return area_cost(s, at, d);
    }
}

static void consider(const sweep *s, float at, division d, plane *best)
{
    if (d.below == 0 || d.above == 0 || cut_count(s->c, d) > s->c->extra ||
        (d.below == s->c->run.count && d.above == s->c->run.count)) {
        return;
    }
    double cost = cost_of(s, at, d);
    if (cost < best->cost) {
        *best = (plane){s->axis, at, cost};
    }
}

/* Try the planes through all faces from `from` to `to`. */
static void sweep_faces(const sweep *s, float from, float to, plane *best)
{
    const umb_bvh_item *parts = s->k->cells.stack + s->c->run.first;
    uint64_t *faces = s->k->faces;
    uint32_t n = 0;
    division d = {0, s->c->run.count};
    for (uint32_t i = 0; i < s->c->run.count; ++i) {
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
    const umb_bvh_item *parts = s->k->cells.stack + s->c->run.first;
    uint32_t lows[BINS] = {0}, highs[BINS] = {0};
    double low = s->box.min[s->axis], extent = s->box.max[s->axis] - low, scale = BINS / extent;
    for (uint32_t i = 0; i < s->c->run.count; ++i) {
        int from = (int)((parts[i].min[s->axis] - low) * scale), to = (int)((parts[i].max[s->axis] - low) * scale);
        ++lows[from < BINS ? from : BINS - 1];
        ++highs[to < BINS ? to : BINS - 1];
    }
    division d = {0, s->c->run.count};
    for (int b = 1; b < BINS; ++b) {
        d.below += lows[b - 1];
        d.above -= highs[b - 1];
        consider(s, (float)(low + extent * b / BINS), d, best);
    }
}

/* ---- choosing a plane ----------------------------------------------------------------------- */

static void try_axis(sweep *s, int axis, plane *best)
{
    float low = s->box.min[axis], high = s->box.max[axis];
    s->axis = axis;
    s->whole = size_of(s, &s->box);
    if (!(low < high) || !(s->whole > 0.0)) {
        return;
    }
    if (s->k->rule == UMB_RULE_MEDIAN || s->c->run.count <= EXACT_PARTS) {
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

/* Across the longest side: a face near the middle, or where there is none the middle. */
static void try_middle(sweep *s, plane *best)
{
    int axis = 0;
    double extent[3];
    for (int i = 0; i < 3; ++i) {
        extent[i] = (double)s->box.max[i] - s->box.min[i];
        axis = extent[i] > extent[axis] ? i : axis;
    }
    double middle = s->box.min[axis] + 0.5 * extent[axis];
    s->axis = axis;
    sweep_faces(s, (float)(middle - WINDOW * extent[axis]), (float)(middle + WINDOW * extent[axis]), best);
    if (isinf(best->cost)) {
        const umb_bvh_item *parts = s->k->cells.stack + s->c->run.first;
        float at = (float)middle;
        division d = {0, 0};
        for (uint32_t i = 0; i < s->c->run.count; ++i) {
            d.below += parts[i].min[axis] < at || parts[i].max[axis] <= at;
            d.above += parts[i].max[axis] > at;
        }
        consider(s, at, d, best);
    }
}

static bool choose(const kd *k, const cell *c, plane *best)
{
    sweep s = {.k = k, .c = c, .box = umb_cells_box(&k->cells, c->run)};
    best->cost = INFINITY;
    if (k->rule == UMB_RULE_MEDIAN) {
        for (uint32_t turn = 0; turn < 3 && isinf(best->cost); ++turn) {
            try_axis(&s, (int)((c->depth + turn) % 3), best);
        }
        return !isinf(best->cost);
    }
    if (k->rule == UMB_RULE_BITTNER || k->rule == UMB_RULE_AILA) {
        try_middle(&s, best);
        return best->cost < 0.5 * c->run.count;
    }
    for (int axis = 0; axis < 3; ++axis) {
        try_axis(&s, axis, best);
    }
    if (!isinf(best->cost) && c->run.count > EXACT_PARTS) {
        refine(&s, best);
    }
    return best->cost < c->run.count;
}

/* ---- recursion ------------------------------------------------------------------------------ */

static uint32_t build(kd *k, const cell *c);

static uint32_t build_halves(kd *k, const cell *c, const plane *p)
{
    size_t top = k->cells.top;
    cell lower = {c->run, c->depth + 1, 0}, upper = lower;
    uint32_t cut = umb_cells_divide(&k->cells, &lower.run, p->axis, p->at, &upper.run);
    lower.extra = umb_cells_share(c->extra - cut, lower.run, upper.run);
    upper.extra = c->extra - cut - lower.extra;
    uint32_t left = build(k, &lower), middle = k->cells.count;
    umb_cells_bring_down(&k->cells, c->run.first, &upper.run, top);
    uint32_t right = build(k, &upper);
    umb_cell_cut where = {.axis = (uint8_t)p->axis, .at = p->at};
    return umb_cells_join(&k->cells, left, middle, right, &where);
}

static double volume_of(const float min[3], const float max[3])
{
    return ((double)max[0] - min[0]) * ((double)max[1] - min[1]) * ((double)max[2] - min[2]);
}

/* Move to the front what is about as large as its cell: cutting it gains nothing. Returns how many. */
static uint32_t sift_large(kd *k, const cell *c)
{
    umb_bvh_item *parts = k->cells.stack + c->run.first;
    umb_aabb box = umb_cells_box(&k->cells, c->run);
    double least = FILLED * volume_of(box.min, box.max);
    uint32_t n = 0;
    for (uint32_t i = 0; i < c->run.count && least > 0.0; ++i) {
        if (volume_of(parts[i].min, parts[i].max) >= least) {
            umb_bvh_item t = parts[i];
            parts[i] = parts[n];
            parts[n++] = t;
        }
    }
    return n;
}

/* What is large stays, the rest is cut. */
static uint32_t build_with_own(kd *k, const cell *c, uint32_t own)
{
    static const umb_cell_cut none = {.axis = UMB_CELL_NO_PLANE};
    cell rest = *c;
    rest.run.first += own;
    rest.run.count -= own;
    uint32_t left = umb_cells_add_leaf(&k->cells, (umb_cell_run){c->run.first, own}), middle = k->cells.count;
    return umb_cells_join(&k->cells, left, middle, build(k, &rest), &none);
}

static uint32_t build(kd *k, const cell *c)
{
    plane p;
    uint32_t own = k->rule == UMB_RULE_AILA && c->run.count > LEAF_PARTS ? sift_large(k, c) : 0;
    if (own > 0) {
        return build_with_own(k, c, own);
    }
    if (c->run.count <= LEAF_PARTS || c->depth >= k->most_depth || k->cells.failed || !choose(k, c, &p)) {
        return umb_cells_add_leaf(&k->cells, c->run);
    }
    return build_halves(k, c, &p);
}

umb_result umb_kdtree_build(const umb_allocator *a, umb_index_rule rule, const umb_bvh_item *items, uint32_t count,
                            umb_built *out)
{
    kd k = {.rule = rule, .most_depth = 8 + 3 * (32u - (uint32_t)__builtin_clz(count)) / 2};
    umb_result result = UMB_ERROR_MEMORY;
    umb_cells_start(&k.cells, a, items, count);
    *out = (umb_built){0};
    if (umb_memory_reserve(a, (void **)&k.faces, &k.face_capacity, 2 * (size_t)count, sizeof(k.faces[0])) &&
        umb_memory_reserve(a, (void **)&k.scratch, &k.scratch_capacity, 2 * (size_t)count, sizeof(k.scratch[0]))) {
        cell all = {{0, count}, 0, (uint64_t)MOST_EXTRA * count};
        uint32_t root = build(&k, &all);
        result = umb_cells_finish(&k.cells, root, out);
    }
    umb_memory_free(a, k.faces, k.face_capacity * sizeof(k.faces[0]));
    umb_memory_free(a, k.scratch, k.scratch_capacity * sizeof(k.scratch[0]));
    umb_cells_free(&k.cells);
    return result;
}

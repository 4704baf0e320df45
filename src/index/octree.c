/* Octrees and quadtrees (Gummerus 3.4).
 *
 * Regular ones cut a cube in its middle, across every axis, again and again; what a plane cuts is on both sides. Each cell
 * is a wide node, and so has an exact order by eye-siding number.
 *
 * The others leave items whole: what does not go into a child stays with the cell. Irregular ones (Shagam and Pfeiffer
 * 2003) cut where the items are, and leave out planes that too many of them cross. Loose ones let go what is
 * small enough into the child that its middle is in; a child's items then reach into its neighbours, by half a child
 * at most. Which boxes overlap is not known, so there is no exact order.
 */
#include "octree.h"

#include <math.h>

#include "cells.h"

/* Cells with no more items are not cut: one node holds them. */
#define LEAF_PARTS 8
/* The slots that parts may take beyond one an item, in units of the count; each cell has a share by what it holds. */
#define MOST_EXTRA 3
/* Items may lie in one point, or in many orders of magnitude. */
#define MOST_DEPTH 24
/* Irregular: a plane that crosses more than one item in so many is left out, unless it is the best. */
#define CROSSED 8

typedef struct octree {
    umb_cells cells;
    umb_index_rule rule;
    uint32_t axes;
} octree;

typedef struct cell {
    umb_cell_run run;
    umb_aabb box; /* regular: the cube; loose too */
    uint32_t depth;
    uint64_t extra; /* slots that cuts may still cost */
} cell;

static uint32_t build(octree *o, const cell *c);

/* ---- cutting parts -------------------------------------------------------------------------- */

static float middle_of(float low, float high)
{
    return 0.5f * low + 0.5f * high;
}

/* Cut across the axes from this one on, then build what is in the octant. */
static uint32_t build_octant(octree *o, const cell *c, const umb_cell_point *p, int axis, uint32_t octant)
{
    while (axis < 3 && (p->axes >> axis & 1u) == 0) {
        ++axis;
    }
    if (c->run.count == 0) {
        return UMB_NONE;
    }
    if (axis == 3) {
        cell child = *c;
        child.depth += 1;
        uint32_t subtree = build(o, &child);
        umb_cells_set_octant(&o->cells, subtree, octant);
        return subtree;
    }
    size_t top = o->cells.top;
    cell lower = *c, upper = *c;
    lower.box.max[axis] = upper.box.min[axis] = p->at[axis];
    umb_cells_divide(&o->cells, &lower.run, axis, p->at[axis], &upper.run);
    lower.extra = umb_cells_share(c->extra, lower.run, upper.run);
    upper.extra = c->extra - lower.extra;
    uint32_t left = build_octant(o, &lower, p, axis + 1, octant), middle = o->cells.count;
    umb_cells_bring_down(&o->cells, c->run.first, &upper.run, top);
    uint32_t right = build_octant(o, &upper, p, axis + 1, octant | 1u << axis);
    umb_cell_cut where = {.axis = (uint8_t)axis, .group = UMB_CELL_INNER, .at = p->at[axis]};
    return umb_cells_join(&o->cells, left, middle, right, &where);
}

static uint32_t build_regular(octree *o, const cell *c)
{
    umb_cell_point p = {.axes = o->axes};
    bool cuts = false;
    uint32_t most;
    for (int i = 0; i < 3; ++i) {
        p.at[i] = middle_of(c->box.min[i], c->box.max[i]);
        bool inside = p.at[i] > c->box.min[i] && p.at[i] < c->box.max[i];
        p.axes &= inside ? 7u : ~(1u << i);
        cuts = cuts || (p.axes >> i & 1u) != 0;
    }
    uint64_t sum = umb_cells_count_octants(&o->cells, c->run, &p, &most);
    if (!cuts || sum - c->run.count > c->extra || (most == c->run.count && sum > most)) {
        return umb_cells_add_leaf(&o->cells, c->run);
    }
    cell rest = *c;
    rest.extra -= sum - c->run.count;
    uint32_t subtree = build_octant(o, &rest, &p, 0, 0);
    umb_cells_set_point(&o->cells, subtree, &p);
    return subtree;
}

/* ---- leaving items whole -------------------------------------------------------------------- */

static float centre_of(const umb_bvh_item *item, int axis)
{
    return middle_of(item->min[axis], item->max[axis]);
}

static double extent_of(const umb_bvh_item *item, uint32_t axes)
{
    double most = 0.0;
    for (int i = 0; i < 3; ++i) {
        double extent = (double)item->max[i] - item->min[i];
        most = (axes >> i & 1u) != 0 && extent > most ? extent : most;
    }
    return most;
}

/* Which items stay with the cell: those that some plane crosses, or that are larger than a child. */
typedef struct sieve {
    umb_cell_point point;
    bool loose;
    double largest; /* loose: what goes into a child */
} sieve;

static bool stays(const sieve *s, const umb_bvh_item *item)
{
    if (s->loose) {
        return extent_of(item, s->point.axes) > s->largest;
    }
    for (int i = 0; i < 3; ++i) {
        if ((s->point.axes >> i & 1u) != 0 && item->min[i] < s->point.at[i] && item->max[i] > s->point.at[i]) {
            return true;
        }
    }
    return false;
}

static bool is_above(const sieve *s, const umb_bvh_item *item, int axis)
{
    return s->loose ? centre_of(item, axis) > s->point.at[axis] : item->max[axis] > s->point.at[axis];
}

/* Move to the front what a question is true of (axis < 0: that it stays; else that it is not above). Returns how many. */
static uint32_t sift(octree *o, umb_cell_run run, const sieve *s, int axis)
{
    umb_bvh_item *items = o->cells.stack + run.first;
    uint32_t n = 0;
    for (uint32_t k = 0; k < run.count; ++k) {
        if (axis < 0 ? stays(s, &items[k]) : !is_above(s, &items[k], axis)) {
            umb_bvh_item t = items[k];
            items[k] = items[n];
            items[n++] = t;
        }
    }
    return n;
}

static const umb_cell_cut no_plane = {.axis = UMB_CELL_NO_PLANE};

static uint32_t build_whole_octant(octree *o, const cell *c, const sieve *s, int axis)
{
    while (axis < 3 && (s->point.axes >> axis & 1u) == 0) {
        ++axis;
    }
    if (c->run.count == 0 || axis == 3) {
        cell child = *c;
        child.depth += 1;
        return c->run.count == 0 ? UMB_NONE : build(o, &child);
    }
    cell lower = *c, upper = *c;
    lower.box.max[axis] = upper.box.min[axis] = s->point.at[axis];
    lower.run.count = sift(o, c->run, s, axis);
    upper.run.first += lower.run.count;
    upper.run.count -= lower.run.count;
    uint32_t left = build_whole_octant(o, &lower, s, axis + 1), middle = o->cells.count;
    uint32_t right = build_whole_octant(o, &upper, s, axis + 1);
    return umb_cells_join(&o->cells, left, middle, right, &no_plane);
}

/* The mean of the items' middles, each weighted by the inverse of its radius: many small ones decide. */
static void find_mean(const octree *o, const cell *c, umb_cell_point *p)
{
    const umb_bvh_item *items = o->cells.stack + c->run.first;
    double least = extent_of(&items[0], 7), sum[3] = {0, 0, 0}, weights = 0.0;
    umb_aabb box = umb_cells_box(&o->cells, c->run);
    for (uint32_t k = 0; k < c->run.count; ++k) {
        double extent = extent_of(&items[k], 7);
        least = extent > 0.0 && (extent < least || least == 0.0) ? extent : least;
    }
    for (uint32_t k = 0; k < c->run.count; ++k) {
        double extent = extent_of(&items[k], 7);
        double weight = least > 0.0 ? least / (extent > least ? extent : least) : 1.0; /* points: the least extent */
        weights += weight;
        for (int i = 0; i < 3; ++i) {
            sum[i] += weight * centre_of(&items[k], i);
        }
    }
    for (int i = 0; i < 3; ++i) {
        p->at[i] = (float)(sum[i] / weights);
        p->axes &= p->at[i] > box.min[i] && p->at[i] < box.max[i] ? 7u : ~(1u << i);
    }
}

/* Leave out the planes that cross many items, but for the best of them. */
static void drop_planes(const octree *o, const cell *c, umb_cell_point *p)
{
    const umb_bvh_item *items = o->cells.stack + c->run.first;
    uint32_t crossed[3] = {0, 0, 0}, kept = 0;
    int best = -1;
    for (int i = 0; i < 3; ++i) {
        if ((p->axes >> i & 1u) == 0) {
            continue;
        }
        for (uint32_t k = 0; k < c->run.count; ++k) {
            crossed[i] += items[k].min[i] < p->at[i] && items[k].max[i] > p->at[i];
        }
        kept |= crossed[i] <= c->run.count / CROSSED ? 1u << i : 0;
        best = best < 0 || crossed[i] < crossed[best] ? i : best;
    }
    p->axes = kept != 0 ? kept : best >= 0 ? 1u << best : 0;
}

static uint32_t build_whole(octree *o, const cell *c)
{
    sieve s = {.point = {.axes = o->axes}, .loose = o->rule == UMB_RULE_LOOSE};
    if (s.loose) {
        int axis = __builtin_ctz(o->axes);
        s.largest = 0.5 * ((double)c->box.max[axis] - c->box.min[axis]);
        for (int i = 0; i < 3; ++i) {
            s.point.at[i] = middle_of(c->box.min[i], c->box.max[i]);
        }
    } else {
        find_mean(o, c, &s.point);
        drop_planes(o, c, &s.point);
    }
    uint32_t own = sift(o, c->run, &s, -1);
    if (own == c->run.count || s.point.axes == 0) {
        return umb_cells_add_leaf(&o->cells, c->run);
    }
    umb_cell_run kept = {c->run.first, own};
    cell others = *c;
    others.run.first += own;
    others.run.count -= own;
    uint32_t left = umb_cells_add_leaf(&o->cells, kept), middle = o->cells.count;
    uint32_t right = build_whole_octant(o, &others, &s, 0);
    return umb_cells_join(&o->cells, left, middle, right, &no_plane);
}

/* ---- all of it ------------------------------------------------------------------------------ */

static uint32_t build(octree *o, const cell *c)
{
    if (c->run.count <= LEAF_PARTS || c->depth >= MOST_DEPTH || o->cells.failed) {
        return umb_cells_add_leaf(&o->cells, c->run);
    }
    return o->rule == UMB_RULE_DEFAULT ? build_regular(o, c) : build_whole(o, c);
}

/* A cube whose side is the longest extent; in the units of floats, so where it would leave their range it is cut. */
static umb_aabb cube_around(umb_aabb box)
{
    float side = 0.0f;
    for (int i = 0; i < 3; ++i) {
        side = fmaxf(side, box.max[i] - box.min[i]);
    }
    for (int i = 0; i < 3; ++i) {
        float end = box.min[i] + side;
        box.max[i] = isfinite(end) && end > box.max[i] ? end : box.max[i];
    }
    return box;
}

uint32_t umb_octree_flat_axes(const umb_bvh_item *items, uint32_t count)
{
    double extent[3];
    for (int i = 0; i < 3; ++i) {
        float low = items[0].min[i], high = items[0].max[i];
        for (uint32_t k = 1; k < count; ++k) {
            low = items[k].min[i] < low ? items[k].min[i] : low;
            high = items[k].max[i] > high ? items[k].max[i] : high;
        }
        extent[i] = (double)high - low;
    }
    int least = extent[1] <= extent[0] ? 1 : 0;
    least = extent[2] < extent[least] ? 2 : least;
    return 7u & ~(1u << least);
}

umb_result umb_octree_build(const umb_allocator *a, umb_index_rule rule, uint32_t axes, const umb_bvh_item *items,
                            uint32_t count, umb_built *out)
{
    octree o = {.rule = rule, .axes = axes};
    umb_result result = UMB_ERROR_MEMORY;
    umb_cells_start(&o.cells, a, items, count);
    *out = (umb_built){0};
    if (!o.cells.failed) {
        cell all = {{0, count}, cube_around(umb_cells_box(&o.cells, (umb_cell_run){0, count})), 0,
                    (uint64_t)MOST_EXTRA * count};
        uint32_t root = build(&o, &all);
        result = umb_cells_finish(&o.cells, root, out);
    }
    umb_cells_free(&o.cells);
    return result;
}

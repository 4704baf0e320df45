#include "voxels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "slot_choice.h"

#define MOST_LEVELS 10u
#define PER_VOXEL 4.0

/* What cell a node is, in umb_node.cell. */
enum { CELL_ROOT = 1, CELL_LARGE = 2, CELL_TOP = 3 };

static uint32_t cell_of(uint32_t level, uint32_t octant)
{
    return 16u + level * 8u + octant;
}

/* ---- the grid ------------------------------------------------------------------------------- */

static double longest_side(const float min[], const float max[])
{
    double longest = 0.0;
    for (int i = 0; i < 3; ++i) {
        double side = (double)max[i] - min[i];
        longest = side > longest ? side : longest;
    }
    return longest;
}

/* The power of two that sides are near to: of all that have any, the mean of the exponents. */
static double usual_side(const umb_bvh_item *items, uint32_t count)
{
    int64_t sum = 0, sized = 0;
    for (uint32_t k = 0; k < count; ++k) {
        double side = longest_side(items[k].min, items[k].max);
        if (side > 0.0) {
            int exponent;
            (void)frexp(side, &exponent);
            sum += exponent;
            sized += 1;
        }
    }
    return sized > 0 ? ldexp(1.0, (int)(sum / sized)) : 0.0;
}

umb_voxels umb_voxels_choose(const umb_bvh_item *items, uint32_t count)
{
    umb_voxels v = {{0, 0, 0}, 1.0, 0};
    if (count == 0) {
        return v;
    }
    double high[3], extent = 0.0;
    for (int i = 0; i < 3; ++i) {
        v.origin[i] = high[i] = items[0].min[i];
        for (uint32_t k = 1; k < count; ++k) {
            v.origin[i] = items[k].min[i] < v.origin[i] ? items[k].min[i] : v.origin[i];
            high[i] = items[k].min[i] > high[i] ? items[k].min[i] : high[i];
        }
        extent = high[i] - v.origin[i] > extent ? high[i] - v.origin[i] : extent;
    }
    /* Flat and thin scenes have fewer voxels across: the cube of them all counts as if it were filled. */
    double filled = extent / cbrt(count / PER_VOXEL), edge = 2.0 * usual_side(items, count);
    edge = edge > filled ? edge : filled;
    if (!(extent > 0.0) || !(edge > 0.0)) {
        v.scale = edge > 0.0 ? 1.0 / edge : 0.0;
        return v;
    }
    while (v.levels < MOST_LEVELS && ldexp(edge, (int)v.levels) <= extent) {
        v.levels += 1;
    }
    edge = ldexp(edge, (int)v.levels) <= extent ? ldexp(extent, -(int)v.levels) * 1.0001 : edge;
    v.scale = 1.0 / edge;
    return v;
}

typedef struct voxel {
    uint32_t at[3];
    bool large; /* it belongs to none */
} voxel;

/* Beyond the grid's ends are the voxels at its ends. */
static voxel voxel_of(const umb_voxels *v, const umb_aabb *box)
{
    voxel out = {{0, 0, 0}, longest_side(box->min, box->max) * v->scale > 1.0};
    double last = ldexp(1.0, (int)v->levels) - 1.0;
    for (int i = 0; i < 3; ++i) {
        double at = ((double)box->min[i] - v->origin[i]) * v->scale;
        out.at[i] = at >= last ? (uint32_t)last : at > 0.0 ? (uint32_t)at : 0;
    }
    return out;
}

static bool same(const voxel *a, const voxel *b)
{
    return a->large ? b->large : !b->large && a->at[0] == b->at[0] && a->at[1] == b->at[1] && a->at[2] == b->at[2];
}

/* ---- its nodes ------------------------------------------------------------------------------ */

/* The child of a node that is a cell, made if it is not there. UMB_NONE without memory. */
static uint32_t child(umb_tree_edit *e, uint32_t number, uint32_t cell, const umb_aabb *box)
{
    umb_node *node = &e->tree.nodes[number];
    for (uint32_t slot = 0; slot < node->count; ++slot) {
        if (umb_slot_is_node(node, slot) && e->tree.nodes[node->ref[slot]].cell == cell) {
            umb_slot_grow(node, slot, box);
            umb_bvh_mark(&e->tree.marks, number);
            return node->ref[slot];
        }
    }
    uint32_t made = umb_tree_edit_new_node(e, number);
    if (made != UMB_NONE) {
        e->tree.nodes[made].cell = cell;
        umb_tree_edit_put(e, number, box, made);
    }
    return made;
}

static uint32_t root_of(umb_tree_edit *e)
{
    if (e->tree.node_count > 0) {
        return 0;
    }
    uint32_t root = umb_tree_edit_new_node(e, UMB_NONE);
    if (root != UMB_NONE) {
        e->tree.nodes[root].cell = CELL_ROOT;
    }
    return root;
}

void umb_voxels_insert(const umb_voxels *v, umb_tree_edit *e, const umb_aabb *box, uint32_t ref)
{
    voxel in = voxel_of(v, box);
    uint32_t node = root_of(e);
    if (node != UMB_NONE) {
        node = child(e, node, in.large ? CELL_LARGE : CELL_TOP, box);
    }
    for (uint32_t level = in.large ? 0 : v->levels; level-- > 0 && node != UMB_NONE;) {
        uint32_t octant = (in.at[0] >> level & 1u) | (in.at[1] >> level & 1u) << 1 | (in.at[2] >> level & 1u) << 2;
        node = child(e, node, cell_of(level, octant), box);
    }
    if (node != UMB_NONE) {
        umb_tree_edit_insert(e, UMB_WAY_CHEAPEST, node, UMB_NONE, box, ref);
    } else {
        e->failed = true;
    }
}

void umb_voxels_move(const umb_voxels *v, umb_tree_edit *e, const umb_aabb *box, uint32_t ref)
{
    uint32_t place = umb_tree_edit_place(e, ref);
    umb_aabb old = umb_slot_box(&e->tree.nodes[place / UMB_NODE_WIDTH], place % UMB_NODE_WIDTH);
    voxel from = voxel_of(v, &old), to = voxel_of(v, box);
    if (same(&from, &to)) {
        umb_tree_edit_set_box(e, ref, box);
    } else {
        umb_tree_edit_remove(e, ref, UMB_NONE);
        umb_voxels_insert(v, e, box, ref);
    }
}

/* ---- building ------------------------------------------------------------------------------- */

/* The bits of three numbers in turn: neighbours in space are neighbours in this order. */
static uint32_t interleave(const uint32_t at[3])
{
    uint32_t code = 0;
    for (uint32_t bit = 0; bit < MOST_LEVELS; ++bit) {
        for (uint32_t i = 0; i < 3; ++i) {
            code |= (at[i] >> bit & 1u) << (3 * bit + i);
        }
    }
    return code;
}

static int by_code(const void *a, const void *b)
{
    const umb_bvh_item *x = a, *y = b;
    uint32_t s, t;
    memcpy(&s, &x->min[3], sizeof s);
    memcpy(&t, &y->min[3], sizeof t);
    if (s != t) {
        return s < t ? -1 : 1;
    }
    return x->ref < y->ref ? -1 : x->ref > y->ref;
}

static umb_aabb box_of(const umb_bvh_item *item)
{
    return (umb_aabb){{item->min[0], item->min[1], item->min[2]}, {item->max[0], item->max[1], item->max[2]}};
}

void umb_voxels_build(const umb_voxels *v, umb_tree_edit *e, umb_bvh_item *items, uint32_t count)
{
    for (uint32_t k = 0; k < count; ++k) { /* the fourth lane is nobody's: the code goes there */
        umb_aabb box = box_of(&items[k]);
        voxel in = voxel_of(v, &box);
        uint32_t code = interleave(in.at);
        memcpy(&items[k].min[3], &code, sizeof code);
    }
    qsort(items, count, sizeof items[0], by_code);
    for (uint32_t k = 0; k < count && !e->failed; ++k) {
        umb_aabb box = box_of(&items[k]);
        umb_voxels_insert(v, e, &box, items[k].ref);
    }
}

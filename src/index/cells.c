#include "cells.h"

#include <string.h>

#include "cut.h"

void umb_cells_start(umb_cells *c, const umb_allocator *a)
{
    *c = (umb_cells){.allocator = a, .ordered = true};
}

void umb_cells_free(umb_cells *c)
{
    umb_memory_free(c->allocator, c->items, c->item_capacity * sizeof(c->items[0]));
    umb_memory_free(c->allocator, c->splits, c->split_capacity * sizeof(c->splits[0]));
    umb_memory_free(c->allocator, c->cuts, c->cut_capacity * sizeof(c->cuts[0]));
    *c = (umb_cells){0};
}

static bool make_room(umb_cells *c, uint32_t more)
{
    size_t need = (size_t)c->count + more;
    c->failed = c->failed || need > UMB_REF_NUMBER ||
                !umb_memory_reserve(c->allocator, (void **)&c->items, &c->item_capacity, need, sizeof(c->items[0])) ||
                !umb_memory_reserve(c->allocator, (void **)&c->splits, &c->split_capacity, need,
                                    sizeof(c->splits[0])) ||
                !umb_memory_reserve(c->allocator, (void **)&c->cuts, &c->cut_capacity, need, sizeof(c->cuts[0]));
    return !c->failed;
}

uint32_t umb_cells_add_leaf(umb_cells *c, const umb_bvh_item *parts, uint32_t count)
{
    if (count == 0 || !make_room(c, count)) {
        return UMB_NONE;
    }
    uint32_t first = c->count;
    memcpy(c->items + first, parts, count * sizeof(parts[0]));
    c->count += count;
    for (uint32_t k = first + 1; k < c->count; ++k) {
        c->cuts[k] = (umb_cell_cut){.axis = UMB_CELL_NO_PLANE};
    }
    return umb_bvh_split_run(c->items, first, c->count, c->splits);
}

uint32_t umb_cells_join(umb_cells *c, uint32_t left, uint32_t middle, uint32_t right, const umb_cell_cut *cut)
{
    if (left == UMB_NONE || right == UMB_NONE || c->failed) {
        return left == UMB_NONE ? right : left;
    }
    c->splits[middle] = (umb_bvh_split){.left = left, .right = right};
    c->cuts[middle] = *cut;
    c->ordered = c->ordered && cut->axis != UMB_CELL_NO_PLANE;
    return middle;
}

static umb_aabb add_boxes(const umb_aabb *a, const umb_aabb *b)
{
    umb_aabb c;
    for (int i = 0; i < 3; ++i) {
        c.min[i] = a->min[i] < b->min[i] ? a->min[i] : b->min[i];
        c.max[i] = a->max[i] > b->max[i] ? a->max[i] : b->max[i];
    }
    return c;
}

static umb_aabb bounds_of(const umb_cells *c)
{
    umb_aabb b;
    memcpy(b.min, c->items[0].min, sizeof(b.min));
    memcpy(b.max, c->items[0].max, sizeof(b.max));
    for (uint32_t k = 1; k < c->count; ++k) {
        umb_aabb box;
        memcpy(box.min, c->items[k].min, sizeof(box.min));
        memcpy(box.max, c->items[k].max, sizeof(box.max));
        b = add_boxes(&b, &box);
    }
    return b;
}

/* The cut of a subtree, and its box. */
static umb_cut cut_all(umb_cells *c, const umb_cut_costs *costs, uint32_t node, umb_aabb *box)
{
    if (node & UMB_BVH_ITEM) {
        const umb_bvh_item *item = &c->items[node & ~UMB_BVH_ITEM];
        memcpy(box->min, item->min, sizeof(box->min));
        memcpy(box->max, item->max, sizeof(box->max));
        return (umb_cut){{0}};
    }
    umb_bvh_split *s = &c->splits[node];
    umb_aabb right_box;
    umb_cut left = cut_all(c, costs, s->left, box);
    umb_cut right = cut_all(c, costs, s->right, &right_box);
    *box = add_boxes(box, &right_box);
    return umb_cut_split(costs, s, umb_half_area(box->min, box->max), &left, &right);
}

umb_result umb_cells_finish(umb_cells *c, uint32_t root, umb_built *out)
{
    *out = (umb_built){0};
    if (c->failed) {
        return UMB_ERROR_MEMORY;
    }
    umb_aabb all = bounds_of(c), box;
    umb_cut_costs costs = umb_cut_costs_of(umb_half_area(all.min, all.max), c->count);
    cut_all(c, &costs, root, &box);
    return umb_bvh_lay_out(c->allocator, c->items, c->splits, root, c->ordered ? c->cuts : NULL, out);
}

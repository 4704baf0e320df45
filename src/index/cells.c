#include "cells.h"

#include <string.h>

#include "cut.h"

void umb_cells_start(umb_cells *c, const umb_allocator *a, const umb_bvh_item *items, uint32_t count)
{
    *c = (umb_cells){.allocator = a, .ordered = true};
    if (count == 0) {
        return;
    }
    if (umb_memory_reserve(a, (void **)&c->stack, &c->stack_capacity, count, sizeof(c->stack[0]))) {
        memcpy(c->stack, items, count * sizeof(items[0]));
        c->top = count;
    } else {
        c->failed = true;
    }
}

void umb_cells_free(umb_cells *c)
{
    umb_memory_free(c->allocator, c->items, c->item_capacity * sizeof(c->items[0]));
    umb_memory_free(c->allocator, c->splits, c->split_capacity * sizeof(c->splits[0]));
    umb_memory_free(c->allocator, c->cuts, c->cut_capacity * sizeof(c->cuts[0]));
    umb_memory_free(c->allocator, c->points, c->point_capacity * sizeof(c->points[0]));
    umb_memory_free(c->allocator, c->planes, c->plane_capacity * sizeof(c->planes[0]));
    umb_memory_free(c->allocator, c->stack, c->stack_capacity * sizeof(c->stack[0]));
    *c = (umb_cells){0};
}

static umb_aabb box_of(const umb_bvh_item *item)
{
    umb_aabb b;
    memcpy(b.min, item->min, sizeof(b.min));
    memcpy(b.max, item->max, sizeof(b.max));
    return b;
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

void umb_cells_push(umb_cells *c, const umb_bvh_item *part)
{
    if (umb_memory_reserve(c->allocator, (void **)&c->stack, &c->stack_capacity, c->top + 1, sizeof(c->stack[0]))) {
        c->stack[c->top++] = *part;
    } else {
        c->failed = true;
    }
}

uint32_t umb_cells_add_plane(umb_cells *c, const float points[3][3])
{
    if (!umb_memory_reserve(c->allocator, (void **)&c->planes, &c->plane_capacity, (size_t)c->plane_count + 1,
                            sizeof(c->planes[0]))) {
        c->failed = true;
        return 0;
    }
    memcpy(c->planes[c->plane_count].points, points, sizeof(c->planes[0].points));
    return c->plane_count++;
}

umb_aabb umb_cells_box(const umb_cells *c, umb_cell_run run)
{
    umb_aabb b = box_of(&c->stack[run.first]);
    for (uint32_t k = 1; k < run.count; ++k) {
        umb_aabb box = box_of(&c->stack[run.first + k]);
        b = add_boxes(&b, &box);
    }
    return b;
}

static void swap(umb_bvh_item *a, umb_bvh_item *b)
{
    umb_bvh_item t = *a;
    *a = *b;
    *b = t;
}

/* Order parts: below a plane, cut by it, above. Returns how many are below, and sets how many are cut. */
static uint32_t sort_parts(umb_bvh_item *parts, uint32_t count, int axis, float at, uint32_t *cut)
{
    uint32_t low = 0, i = 0, high = count;
    while (i < high) {
        if (!(parts[i].max[axis] > at)) {
            swap(&parts[low++], &parts[i++]);
        } else if (!(parts[i].min[axis] < at)) {
            swap(&parts[i], &parts[--high]);
        } else {
            ++i;
        }
    }
    *cut = high - low;
    return low;
}

uint32_t umb_cells_divide(umb_cells *c, umb_cell_run *run, int axis, float at, umb_cell_run *upper)
{
    uint32_t cut, below = sort_parts(c->stack + run->first, run->count, axis, at, &cut);
    *upper = (umb_cell_run){c->top, run->count - below};
    if (!umb_memory_reserve(c->allocator, (void **)&c->stack, &c->stack_capacity, c->top + upper->count,
                            sizeof(c->stack[0]))) {
        c->failed = true;
        *run = *upper = (umb_cell_run){run->first, 0};
        return 0;
    }
    memcpy(c->stack + upper->first, c->stack + run->first + below, upper->count * sizeof(c->stack[0]));
    for (uint32_t k = 0; k < cut; ++k) {
        c->stack[run->first + below + k].max[axis] = at;
        c->stack[upper->first + k].min[axis] = at;
    }
    c->top += upper->count;
    run->count = below + cut;
    return cut;
}

void umb_cells_bring_down(umb_cells *c, size_t first, umb_cell_run *upper, size_t top)
{
    memmove(c->stack + first, c->stack + upper->first, upper->count * sizeof(c->stack[0]));
    upper->first = first;
    c->top = top;
}

uint64_t umb_cells_share(uint64_t slots, umb_cell_run lower, umb_cell_run upper)
{
    uint64_t all = (uint64_t)lower.count + upper.count;
    return all > 0 ? slots * lower.count / all : 0;
}

uint64_t umb_cells_count_octants(const umb_cells *c, umb_cell_run run, const umb_cell_point *p, uint32_t *most)
{
    const umb_bvh_item *parts = c->stack + run.first;
    uint32_t in[8] = {0};
    for (uint32_t k = 0; k < run.count; ++k) {
        uint32_t low = 0, high = 0; /* the octants of its corners */
        for (int i = 0; i < 3; ++i) {
            bool above = (p->axes >> i & 1u) != 0 && parts[k].max[i] > p->at[i];
            high |= above ? 1u << i : 0;
            low |= above && !(parts[k].min[i] < p->at[i]) ? 1u << i : 0;
        }
        for (uint32_t octant = low; octant <= high; ++octant) {
            in[octant] += (octant & ~high) == 0 && (low & ~octant) == 0;
        }
    }
    uint64_t sum = 0;
    *most = 0;
    for (int octant = 0; octant < 8; ++octant) {
        sum += in[octant];
        *most = in[octant] > *most ? in[octant] : *most;
    }
    return sum;
}

uint32_t umb_cells_add_leaf(umb_cells *c, umb_cell_run run)
{
    if (run.count == 0 || !make_room(c, run.count)) {
        return UMB_NONE;
    }
    uint32_t first = c->count;
    memcpy(c->items + first, c->stack + run.first, run.count * sizeof(c->items[0]));
    c->count += run.count;
    for (uint32_t k = first; k < c->count; ++k) {
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
    uint8_t octant = c->cuts[middle].octant[1];
    c->cuts[middle] = *cut;
    c->cuts[middle].octant[1] = octant;
    c->ordered = c->ordered && cut->axis != UMB_CELL_NO_PLANE;
    return middle;
}

void umb_cells_set_octant(umb_cells *c, uint32_t subtree, uint32_t octant)
{
    if (subtree != UMB_NONE && !c->failed) {
        c->cuts[subtree & ~UMB_BVH_ITEM].octant[subtree >> 31] = (uint8_t)octant;
    }
}

void umb_cells_set_point(umb_cells *c, uint32_t subtree, const umb_cell_point *point)
{
    if (subtree == UMB_NONE || c->failed || (subtree & UMB_BVH_ITEM) != 0 ||
        c->cuts[subtree].group != UMB_CELL_INNER) {
        return;
    }
    if (!umb_memory_reserve(c->allocator, (void **)&c->points, &c->point_capacity, c->cut_capacity,
                            sizeof(c->points[0]))) {
        c->failed = true;
        return;
    }
    c->cuts[subtree].group = UMB_CELL_TOP;
    c->points[subtree] = *point;
}

static umb_aabb bounds_of(const umb_cells *c)
{
    umb_aabb b = box_of(&c->items[0]);
    for (uint32_t k = 1; k < c->count; ++k) {
        umb_aabb box = box_of(&c->items[k]);
        b = add_boxes(&b, &box);
    }
    return b;
}

/* Slots of a group's split. */
static uint32_t slots_of(const umb_cells *c, uint32_t node)
{
    bool inner = (node & UMB_BVH_ITEM) == 0 && c->cuts[node].group == UMB_CELL_INNER;
    return inner ? slots_of(c, c->splits[node].left) + slots_of(c, c->splits[node].right) : 1;
}

/* No choice: what a group's splits are cut into is its octants. */
static umb_cut cut_group(umb_cells *c, const umb_cut_costs *costs, uint32_t node, double area, double below)
{
    umb_bvh_split *s = &c->splits[node];
    uint32_t left = slots_of(c, s->left), all = left + slots_of(c, s->right);
    bool top = c->cuts[node].group == UMB_CELL_TOP;
    double cost = below + (top ? area * costs->inverse_root_area + costs->node_cost : 0.0);
    umb_cut cut;
    for (uint32_t j = 1; j <= UMB_NODE_WIDTH; ++j) {
        s->pick[j - 1] = (uint8_t)(top ? (j == UMB_NODE_WIDTH ? left : 0) : (j >= all ? left : 0));
        cut.cost[j - 1] = (float)cost;
    }
    return cut;
}

/* The cut of a subtree, and its box. */
static umb_cut cut_all(umb_cells *c, const umb_cut_costs *costs, uint32_t node, umb_aabb *box)
{
    if (node & UMB_BVH_ITEM) {
        *box = box_of(&c->items[node & ~UMB_BVH_ITEM]);
        return (umb_cut){{0}};
    }
    umb_bvh_split *s = &c->splits[node];
    umb_aabb right_box;
    umb_cut left = cut_all(c, costs, s->left, box);
    umb_cut right = cut_all(c, costs, s->right, &right_box);
    *box = add_boxes(box, &right_box);
    double area = umb_half_area(box->min, box->max);
    return c->cuts[node].group != UMB_CELL_ALONE
               ? cut_group(c, costs, node, area, (double)left.cost[1] + right.cost[1])
               : umb_cut_split(costs, s, area, &left, &right);
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
    umb_result result =
        umb_bvh_lay_out(c->allocator, c->items, c->splits, root, c->ordered ? c->cuts : NULL, c->points, out);
    if (result == UMB_OK && c->ordered && c->plane_count > 0) {
        size_t bytes = c->plane_count * sizeof(c->planes[0]);
        out->planes = umb_memory_allocate(c->allocator, bytes);
        if (out->planes == NULL) {
            umb_built_free(out, c->allocator);
            return UMB_ERROR_MEMORY;
        }
        memcpy(out->planes, c->planes, bytes);
        out->plane_count = c->plane_count;
    }
    return result;
}

/* Grids of equal cells (Gummerus 3.3). An item is in each cell that it reaches into. Cells are found through blocks of
 * them: as in an octree, but halved by their number, so any dimensions will do (Tai and Hsu 3.1). Empty cells are
 * nowhere; a block with a single part is not cut into cells.
 *
 * Nested grids have a grid of their own in each cell that holds much (Hillesland and others 2002).
 */
#include "grid.h"

#include <math.h>

#include "cells.h"

/* Items a cell, on average. */
#define CELL_ITEMS 4.0
/* Cells are not smaller than the average item, and so many along an axis at most. */
#define MOST_CELLS 256
/* Nested: cells with more parts have a grid, up to so many levels. */
#define CROWD 32
#define MOST_LEVELS 6
/* The slots that parts may take beyond one an item, in units of the count; each block has a share by what it holds. */
#define MOST_EXTRA 3

typedef struct lines {
    float at[3][MOST_CELLS + 1]; /* the planes between cells */
    uint32_t cells[3];
} lines;

typedef struct grid {
    umb_cells tree;
    umb_index_rule rule;
} grid;

/* Cells from first to end along each axis. */
typedef struct block {
    umb_cell_run run;
    uint32_t first[3], end[3], level;
    uint64_t extra;
} block;

static uint32_t build_grid(grid *g, umb_cell_run run, uint32_t level, uint64_t extra);

/* ---- how many cells ------------------------------------------------------------------------- */

static double mean_extent(const grid *g, umb_cell_run run)
{
    const umb_bvh_item *parts = g->tree.stack + run.first;
    double sum = 0.0;
    for (uint32_t k = 0; k < run.count; ++k) {
        double most = 0.0;
        for (int i = 0; i < 3; ++i) {
            most = fmax(most, (double)parts[k].max[i] - parts[k].min[i]);
        }
        sum += most;
    }
    return sum / run.count;
}

static uint32_t cells_along(double extent, double side)
{
    double cells = ceil(extent / side);
    return cells < 1.0 ? 1 : cells > MOST_CELLS ? MOST_CELLS : (uint32_t)cells;
}

/* The most cells along the longest side for which the grid has no more than are wanted, none smaller than the mean item:
 * tried one after the other, for roots round differently everywhere. */
static double side_of(const grid *g, umb_cell_run run, const umb_aabb *box)
{
    double extent[3], longest = 0.0, mean = mean_extent(g, run), side = INFINITY;
    for (int i = 0; i < 3; ++i) {
        extent[i] = (double)box->max[i] - box->min[i];
        longest = fmax(longest, extent[i]);
    }
    for (uint32_t n = 1; n <= MOST_CELLS && longest / n >= mean && longest > 0.0; ++n) {
        double cells = 1.0;
        for (int i = 0; i < 3; ++i) {
            cells *= cells_along(extent[i], longest / n);
        }
        if (n > 1 && cells * CELL_ITEMS > run.count) {
            break;
        }
        side = longest / n;
    }
    return side;
}

static void draw_lines(const umb_aabb *box, double side, lines *l)
{
    for (int i = 0; i < 3; ++i) {
        double extent = (double)box->max[i] - box->min[i];
        uint32_t n = cells_along(extent, side);
        l->cells[i] = n;
        for (uint32_t k = 0; k <= n; ++k) {
            l->at[i][k] = (float)(box->min[i] + extent * k / n);
        }
    }
}

/* ---- blocks --------------------------------------------------------------------------------- */

static uint32_t build_block(grid *g, const lines *l, const block *b);

/* Cut a block across the axes from this one on, then build the piece. */
static uint32_t build_piece(grid *g, const lines *l, const block *b, const umb_cell_point *p, int axis,
                            uint32_t octant)
{
    while (axis < 3 && (p->axes >> axis & 1u) == 0) {
        ++axis;
    }
    if (b->run.count == 0 || axis == 3) {
        uint32_t subtree = b->run.count == 0 ? UMB_NONE : build_block(g, l, b);
        umb_cells_set_octant(&g->tree, subtree, octant);
        return subtree;
    }
    size_t top = g->tree.top;
    block lower = *b, upper = *b;
    lower.end[axis] = upper.first[axis] = (b->first[axis] + b->end[axis]) / 2;
    umb_cells_divide(&g->tree, &lower.run, axis, p->at[axis], &upper.run);
    lower.extra = umb_cells_share(b->extra, lower.run, upper.run);
    upper.extra = b->extra - lower.extra;
    uint32_t left = build_piece(g, l, &lower, p, axis + 1, octant), middle = g->tree.count;
    umb_cells_bring_down(&g->tree, b->run.first, &upper.run, top);
    uint32_t right = build_piece(g, l, &upper, p, axis + 1, octant | 1u << axis);
    umb_cell_cut where = {.axis = (uint8_t)axis, .group = UMB_CELL_INNER, .at = p->at[axis]};
    return umb_cells_join(&g->tree, left, middle, right, &where);
}

static uint32_t build_cell(grid *g, const block *b)
{
    bool nested = g->rule == UMB_RULE_NESTED && b->run.count > CROWD && b->level < MOST_LEVELS;
    return nested ? build_grid(g, b->run, b->level + 1, b->extra) : umb_cells_add_leaf(&g->tree, b->run);
}

static uint32_t build_block(grid *g, const lines *l, const block *b)
{
    umb_cell_point p = {.axes = 0};
    for (int i = 0; i < 3; ++i) {
        p.at[i] = l->at[i][(b->first[i] + b->end[i]) / 2];
        p.axes |= b->end[i] - b->first[i] > 1 ? 1u << i : 0;
    }
    if (p.axes == 0) {
        return build_cell(g, b);
    }
    uint32_t most;
    uint64_t extra = umb_cells_count_octants(&g->tree, b->run, &p, &most) - b->run.count;
    if (b->run.count == 1 || extra > b->extra) {
        return umb_cells_add_leaf(&g->tree, b->run);
    }
    block rest = *b;
    rest.extra -= extra;
    uint32_t subtree = build_piece(g, l, &rest, &p, 0, 0);
    umb_cells_set_point(&g->tree, subtree, &p);
    return subtree;
}

/* A grid over a run, whose cells share the extra slots. */
static uint32_t build_grid(grid *g, umb_cell_run run, uint32_t level, uint64_t extra)
{
    umb_aabb box = umb_cells_box(&g->tree, run);
    lines l;
    draw_lines(&box, side_of(g, run, &box), &l);
    block all = {.run = run, .end = {l.cells[0], l.cells[1], l.cells[2]}, .level = level, .extra = extra};
    return build_block(g, &l, &all);
}

umb_result umb_grid_build(const umb_allocator *a, umb_index_rule rule, const umb_bvh_item *items, uint32_t count,
                          umb_built *out)
{
    grid g = {.rule = rule};
    umb_result result = UMB_ERROR_MEMORY;
    umb_cells_start(&g.tree, a, items, count);
    *out = (umb_built){0};
    if (!g.tree.failed) {
        uint32_t root = build_grid(&g, (umb_cell_run){0, count}, 0, (uint64_t)MOST_EXTRA * count);
        result = umb_cells_finish(&g.tree, root, out);
    }
    umb_cells_free(&g.tree);
    return result;
}

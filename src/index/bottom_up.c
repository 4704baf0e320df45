/* Groups stand in a row along a space-filling curve. In each round each one looks for the nearest among its neighbours in
 * the row, and those that choose one another become one (Meister and Bittner 2018, parallel locally-ordered clustering).
 * Of the pairs of the least size one at least agrees, so each round joins some. */
#include "bottom_up.h"

#include <math.h>
#include <string.h>

#include "base/scratch.h"
#include "base/sort.h"
#include "cells.h"
#include "cut.h"

/* How far a group looks to either side. */
#define RADIUS 12
/* Groups this high wait until there are no others; then all are joined in pairs. */
#define MOST_HEIGHT 40

typedef struct group {
    float min[3], max[3];
    uint32_t left, right; /* groups; UMB_NONE in left: item number right */
    uint32_t height;
} group;

typedef struct rows {
    group *groups; /* all there ever were */
    uint32_t *row, *next, *nearest;
    uint32_t group_count, count;
    bool spheres;
} rows;

/* Ten bits of each of three numbers, one after the other. */
static uint32_t spread(uint32_t x)
{
    x = (x | x << 16) & 0x030000FFu;
    x = (x | x << 8) & 0x0300F00Fu;
    x = (x | x << 4) & 0x030C30C3u;
    return (x | x << 2) & 0x09249249u;
}

static uint32_t curve_place(const umb_bvh_item *item, const umb_aabb *box)
{
    uint32_t code = 0;
    for (int i = 0; i < 3; ++i) {
        double extent = (double)box->max[i] - box->min[i];
        double at = 0.5 * ((double)item->min[i] + item->max[i]) - box->min[i];
        double part = extent > 0.0 ? 1024.0 * (at / extent) : 0.0;
        uint32_t cell = part < 1023.0 ? (uint32_t)part : 1023;
        code |= spread(cell) << i;
    }
    return code;
}

/* What two groups would be like as one; INFINITY: too high. */
static double size_together(const rows *r, uint32_t a, uint32_t b)
{
    const group *x = &r->groups[a], *y = &r->groups[b];
    if (x->height >= MOST_HEIGHT || y->height >= MOST_HEIGHT) {
        return INFINITY;
    }
    float min[3], max[3];
    double square = 0.0;
    for (int i = 0; i < 3; ++i) {
        min[i] = x->min[i] < y->min[i] ? x->min[i] : y->min[i];
        max[i] = x->max[i] > y->max[i] ? x->max[i] : y->max[i];
        square += ((double)max[i] - min[i]) * ((double)max[i] - min[i]);
    }
    return r->spheres ? square : umb_half_area(min, max);
}

static uint32_t find_nearest(const rows *r, uint32_t at)
{
    uint32_t from = at > RADIUS ? at - RADIUS : 0, end = r->count - at > RADIUS ? at + RADIUS + 1 : r->count;
    uint32_t best = at ^ 1u; /* of several as near as each other: every second one is another's partner */
    double least = best >= from && best < end ? size_together(r, r->row[at], r->row[best]) : INFINITY;
    best = isinf(least) ? UMB_NONE : best;
    for (uint32_t k = from; k < end; ++k) {
        double size = k != at ? size_together(r, r->row[at], r->row[k]) : INFINITY;
        if (size < least) {
            least = size;
            best = k;
        }
    }
    return best;
}

static uint32_t join(rows *r, uint32_t a, uint32_t b)
{
    const group *x = &r->groups[a], *y = &r->groups[b];
    group *g = &r->groups[r->group_count];
    for (int i = 0; i < 3; ++i) {
        g->min[i] = x->min[i] < y->min[i] ? x->min[i] : y->min[i];
        g->max[i] = x->max[i] > y->max[i] ? x->max[i] : y->max[i];
    }
    g->left = a;
    g->right = b;
    g->height = 1 + (x->height > y->height ? x->height : y->height);
    return r->group_count++;
}

static void pair_up(rows *r)
{
    uint32_t kept = 0;
    for (uint32_t k = 0; k < r->count; ++k) {
        r->nearest[k] = find_nearest(r, k);
    }
    for (uint32_t k = 0; k < r->count; ++k) {
        uint32_t with = r->nearest[k];
        bool agree = with != UMB_NONE && r->nearest[with] == k;
        if (agree && k < with) {
            r->next[kept++] = join(r, r->row[k], r->row[with]);
        } else if (!agree) {
            r->next[kept++] = r->row[k];
        }
    }
    if (kept == r->count) { /* all are high */
        kept = 0;
        for (uint32_t k = 0; k < r->count; k += 2) {
            r->next[kept++] = k + 1 < r->count ? join(r, r->row[k], r->row[k + 1]) : r->row[k];
        }
    }
    uint32_t *t = r->row;
    r->row = r->next;
    r->next = t;
    r->count = kept;
}

/* The binary tree of a group, as cells. */
static uint32_t emit(umb_cells *c, const rows *r, uint32_t number)
{
    static const umb_cell_cut none = {.axis = UMB_CELL_NO_PLANE};
    const group *g = &r->groups[number];
    if (g->left == UMB_NONE) {
        return umb_cells_add_leaf(c, (umb_cell_run){g->right, 1});
    }
    uint32_t left = emit(c, r, g->left), middle = c->count;
    return umb_cells_join(c, left, middle, emit(c, r, g->right), &none);
}

static void line_up(rows *r, const umb_cells *c, uint32_t count, uint64_t *words, uint64_t *scratch)
{
    umb_aabb box = umb_cells_box(c, (umb_cell_run){0, count});
    for (uint32_t i = 0; i < count; ++i) {
        words[i] = (uint64_t)curve_place(&c->stack[i], &box) << 32 | i;
    }
    const uint64_t *sorted = umb_sort_words(words, scratch, count);
    for (uint32_t k = 0; k < count; ++k) {
        uint32_t item = (uint32_t)sorted[k];
        group *g = &r->groups[k];
        memcpy(g->min, c->stack[item].min, sizeof(g->min));
        memcpy(g->max, c->stack[item].max, sizeof(g->max));
        g->left = UMB_NONE;
        g->height = 0;
        g->right = item;
        r->row[k] = k;
    }
    r->count = r->group_count = count;
}

umb_result umb_bottom_up_build(const umb_allocator *a, bool spheres, const umb_bvh_item *items, uint32_t count,
                               umb_built *out)
{
    umb_scratch scratch = {.allocator = a};
    umb_cells cells;
    rows r = {.spheres = spheres};
    umb_result result = UMB_ERROR_MEMORY;
    umb_cells_start(&cells, a, items, count);
    r.groups = umb_scratch_get(&scratch, 2 * (size_t)count, sizeof(r.groups[0]));
    r.row = umb_scratch_get(&scratch, count, sizeof(r.row[0]));
    r.next = umb_scratch_get(&scratch, count, sizeof(r.next[0]));
    r.nearest = umb_scratch_get(&scratch, count, sizeof(r.nearest[0]));
    uint64_t *words = umb_scratch_get(&scratch, 2 * (size_t)count, sizeof(words[0]));
    *out = (umb_built){0};
    if (!scratch.failed && !cells.failed) {
        line_up(&r, &cells, count, words, words + count);
        while (r.count > 1) {
            pair_up(&r);
        }
        uint32_t root = emit(&cells, &r, r.row[0]);
        result = umb_cells_finish(&cells, root, out);
    }
    umb_scratch_free(&scratch);
    umb_cells_free(&cells);
    return result;
}

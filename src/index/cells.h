/* Trees of cells: what the builders that cut space have in common. A builder goes down from the whole scene and says how
 * each cell is cut and which parts of items are in its leaves; what comes out is a binary tree over parts, laid out
 * in wide nodes like any other. Within a leaf parts are in a tree of boxes. */
#ifndef UMB_CELLS_H
#define UMB_CELLS_H

#include "bvh.h"

/* No cut: what is on the two sides may overlap. */
#define UMB_CELL_NO_PLANE 4u

/* How one split of the binary tree came about. */
typedef struct umb_cell_cut {
    uint8_t axis; /* 0 .. 2; UMB_ORDER_TILTED; UMB_CELL_NO_PLANE */
    union {
        float at;
        uint32_t number; /* of a tilted plane */
    };
} umb_cell_cut;

/* A tree that is being built. */
typedef struct umb_cells {
    const umb_allocator *allocator;
    umb_bvh_item *items; /* parts, by leaves, from left to right */
    umb_bvh_split *splits; /* split k has the parts before k on its left (bvh.h) */
    umb_cell_cut *cuts;    /* of the splits */
    uint32_t count;
    bool failed;           /* no memory, or too many parts: all that follows does nothing */
    bool ordered;          /* every split above the leaves has a plane */
    size_t item_capacity, split_capacity, cut_capacity;
} umb_cells;

void umb_cells_start(umb_cells *c, const umb_allocator *a);
void umb_cells_free(umb_cells *c);

/* A leaf that holds these parts. Returns its subtree: UMB_NONE when it is empty. */
uint32_t umb_cells_add_leaf(umb_cells *c, const umb_bvh_item *parts, uint32_t count);
/* Two subtrees side by side; either may be UMB_NONE. middle: the number of parts before the right one was begun. */
uint32_t umb_cells_join(umb_cells *c, uint32_t left, uint32_t middle, uint32_t right, const umb_cell_cut *cut);
/* Lay out the tree in wide nodes. out: nodes and orders are the caller's to free. */
umb_result umb_cells_finish(umb_cells *c, uint32_t root, umb_built *out);

#endif

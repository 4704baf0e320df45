/* Trees of cells: what the builders that cut space have in common. A builder goes down from the whole scene and says how
 * each cell is cut and which parts of items are in its leaves; what comes out is a binary tree over parts, laid out
 * in wide nodes like any other. Within a leaf parts are in a tree of boxes. */
#ifndef UMB_CELLS_H
#define UMB_CELLS_H

#include "bvh.h"

/* No cut: what is on the two sides may overlap. */
#define UMB_CELL_NO_PLANE 4u

/* Splits of one octree node, of which its wide node is made: nothing else is in it. */
typedef enum umb_cell_group {
    UMB_CELL_ALONE = 0,
    UMB_CELL_INNER, /* below another split of the same node */
    UMB_CELL_TOP    /* the first one of a node */
} umb_cell_group;

/* How one split of the binary tree came about. Split k and item k share an entry. */
typedef struct umb_cell_cut {
    uint8_t axis; /* 0 .. 2; UMB_ORDER_TILTED; UMB_CELL_NO_PLANE */
    uint8_t group;
    uint8_t octant[2]; /* of split k and of item k, if it is what an octant holds: which one */
    union {
        float at;
        uint32_t number; /* of a tilted plane */
    };
} umb_cell_cut;

/* Where the planes of an octree node meet, and which there are, a bit for each axis. */
typedef struct umb_cell_point {
    float at[3];
    uint32_t axes;
} umb_cell_point;

/* Parts that lie side by side on a tree's stack. */
typedef struct umb_cell_run {
    size_t first;
    uint32_t count;
} umb_cell_run;

/* A tree that is being built. */
typedef struct umb_cells {
    const umb_allocator *allocator;
    umb_bvh_item *items; /* parts, by leaves, from left to right */
    umb_bvh_split *splits; /* split k has the parts before k on its left (bvh.h) */
    umb_cell_cut *cuts;    /* of the splits */
    umb_tilted_plane *planes; /* that cuts name */
    uint32_t plane_count;
    umb_cell_point *points; /* of splits that are TOP of a group; NULL: there are none */
    /* Parts of the cells that are still to be cut:
     *
     *     run                                      top
     *     | below only | cut | above only | ... | cut, above only |    the upper half is copied to the top, the lower
     *     | lower half       |            | ... | upper half      |    one stays; when it is done, the upper one comes
     *     | upper half                    | ...                        down: no part is there more than twice
     */
    umb_bvh_item *stack;
    size_t top;
    uint32_t count;
    bool failed;           /* no memory, or too many parts: all that follows does nothing */
    bool ordered;          /* every split above the leaves has a plane */
    size_t item_capacity, split_capacity, cut_capacity, point_capacity, stack_capacity,
        plane_capacity;
} umb_cells;

/* Begin, with these items on the stack, as the run from 0 on. */
void umb_cells_start(umb_cells *c, const umb_allocator *a, const umb_bvh_item *items, uint32_t count);
void umb_cells_free(umb_cells *c);

/* Put a part on top of the stack. */
void umb_cells_push(umb_cells *c, const umb_bvh_item *part);
/* The number of a plane, for cuts. */
uint32_t umb_cells_add_plane(umb_cells *c, const float points[3][3]);
/* The box of a run that is not empty. */
umb_aabb umb_cells_box(const umb_cells *c, umb_cell_run run);
/* Cut a run in two: it becomes what is below the plane, *upper is what is above. What lies in the plane is below.
 * Returns how many parts were cut; their halves share the plane. */
uint32_t umb_cells_divide(umb_cells *c, umb_cell_run *run, int axis, float at, umb_cell_run *upper);
/* The lower half is done with: put the upper one in its place. top: the stack's before umb_cells_divide(). */
void umb_cells_bring_down(umb_cells *c, size_t first, umb_cell_run *upper, size_t top);

/* The lower half's part of so many slots that may still be used, by what it holds. */
uint64_t umb_cells_share(uint64_t slots, umb_cell_run lower, umb_cell_run upper);

/* How many parts there would be in the octants around a point, all together, and in the fullest. */
uint64_t umb_cells_count_octants(const umb_cells *c, umb_cell_run run, const umb_cell_point *p, uint32_t *most);

/* A leaf that holds these parts. Returns its subtree: UMB_NONE when it is empty. */
uint32_t umb_cells_add_leaf(umb_cells *c, umb_cell_run run);
/* Two subtrees side by side; either may be UMB_NONE. middle: the number of parts before the right one was begun. */
uint32_t umb_cells_join(umb_cells *c, uint32_t left, uint32_t middle, uint32_t right, const umb_cell_cut *cut);
/* A subtree is what is in one octant of the node that is being made. */
void umb_cells_set_octant(umb_cells *c, uint32_t subtree, uint32_t octant);
/* The splits from here down whose group is INNER are one octree node. */
void umb_cells_set_point(umb_cells *c, uint32_t subtree, const umb_cell_point *point);
/* Lay out the tree in wide nodes. out: nodes and orders are the caller's to free. */
umb_result umb_cells_finish(umb_cells *c, uint32_t root, umb_built *out);

#endif

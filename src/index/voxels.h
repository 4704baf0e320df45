/* A regular grid whose voxels overlap (Tai and Hsu 3.1), as an octree-like hierarchy in the shared tree layout.
 *
 * The scene is scaled so that a voxel is a unit cube. An object belongs to the voxel of its box's minimum corner, found by
 * cutting off decimals, and to no other: each voxel is taken to reach one voxel further along each axis. What is longer
 * than a voxel is kept apart, in a tree of boxes. Nodes of eight voxels, of eight of those, and so on are there as far as
 * something is in them. */
#ifndef UMB_VOXELS_H
#define UMB_VOXELS_H

#include "tree_edit.h"

typedef struct umb_voxels {
    double origin[3], scale; /* voxel: (corner - origin) * scale, without decimals */
    uint32_t levels;         /* two to the power of this are the voxels of a side */
} umb_voxels;

/* Voxels about twice as long as things are as a rule, and large enough to hold four on average; at most 1,024 a side. */
umb_voxels umb_voxels_choose(const umb_bvh_item *items, uint32_t count);

/* Put an item, which is nowhere, where it belongs. */
void umb_voxels_insert(const umb_voxels *v, umb_tree_edit *e, const umb_aabb *box, uint32_t ref);

/* An item that is in the tree has another box. As long as its voxel is the same that is all. */
void umb_voxels_move(const umb_voxels *v, umb_tree_edit *e, const umb_aabb *box, uint32_t ref);

/* Fill an empty tree, in an order that keeps neighbours together. Changes the items' order. */
void umb_voxels_build(const umb_voxels *v, umb_tree_edit *e, umb_bvh_item *items, uint32_t count);

#endif

/* Octrees and quadtrees: cells are cut by up to three planes at once. */
#ifndef UMB_OCTREE_H
#define UMB_OCTREE_H

#include "bvh.h"

/* Build over count >= 1 items; axes: a bit for each axis that cells are cut across. Rules: DEFAULT, IRREGULAR, LOOSE
 * (umb_index_rule). UMB_ERROR_MEMORY leaves nothing behind. */
umb_result umb_octree_build(const umb_allocator *a, umb_index_rule rule, uint32_t axes, const umb_bvh_item *items,
                            uint32_t count, umb_built *out);
/* The two axes along which items spread most, for quadtrees. */
uint32_t umb_octree_flat_axes(const umb_bvh_item *items, uint32_t count);

#endif

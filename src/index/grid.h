/* Regular grids, with an octree of their cells above them, and grids in crowded cells. */
#ifndef UMB_GRID_H
#define UMB_GRID_H

#include "bvh.h"

/* Build over count >= 1 items. Rules: DEFAULT, NESTED. UMB_ERROR_MEMORY leaves nothing behind. */
umb_result umb_grid_build(const umb_allocator *a, umb_index_rule rule, const umb_bvh_item *items, uint32_t count,
                          umb_built *out);

#endif

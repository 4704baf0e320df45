/* Cutting space by planes across an axis. */
#ifndef UMB_KDTREE_H
#define UMB_KDTREE_H

#include "bvh.h"

/* Build a kd-tree over count >= 1 items by one of its rules (Gummerus 3.5). The order of items may change.
 * UMB_ERROR_MEMORY leaves nothing behind. */
umb_result umb_kdtree_build(const umb_allocator *a, umb_index_rule rule, const umb_bvh_item *items, uint32_t count,
                            umb_built *out);

#endif

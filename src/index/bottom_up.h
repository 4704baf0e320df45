/* Bounding volume hierarchies from the leaves up. */
#ifndef UMB_BOTTOM_UP_H
#define UMB_BOTTOM_UP_H

#include "bvh.h"

/* Build over count >= 1 items: near ones are grouped, then near groups (Gummerus 3.1). spheres: groups are near whose
 * common sphere is small, else those whose box has little surface. UMB_ERROR_MEMORY leaves nothing behind. */
umb_result umb_bottom_up_build(const umb_allocator *a, bool spheres, const umb_bvh_item *items, uint32_t count,
                               umb_built *out);

#endif

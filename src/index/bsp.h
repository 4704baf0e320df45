/* BSP trees: space cut by the planes of what is in it. */
#ifndef UMB_BSP_H
#define UMB_BSP_H

#include "bvh.h"

/* Build over count >= 1 items of a scene by the rule and the options of def. Objects that are their shape, and occluders,
 * are taken as their triangles, others as their boxes. UMB_ERROR_MEMORY leaves nothing behind. */
umb_result umb_bsp_build(const umb_allocator *a, const umb_index_def *def, const umb_committed *scene,
                         const umb_bvh_item *items, uint32_t count, umb_built *out);

#endif

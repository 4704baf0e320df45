/* Occluders far away into occlusion maps. */
#ifndef UMB_RAY_FAR_H
#define UMB_RAY_FAR_H

#include "ray_map.h"

/* Draw a blocker with one interval for all the pixels that it covers. False, with nothing drawn, if it is near, or if
 * that would lose more than a pixel's width in height somewhere. half: as for umb_ray_map_block. */
bool umb_ray_map_block_far(umb_ray_map *map, const umb_umbra_kernels *kernels, const umb_ray_blocker *b, bool half);

#endif

/* Small scenes of convex polygons and boxes on a lattice, for methods that hide by planes: pieces that touch, that share
 * edges and corners, that are folded, whose outline together has dents and holes; eyes on their planes. */
#ifndef PATCH_SCENES_H
#define PATCH_SCENES_H

#include "micro_scenes.h"

uint32_t patch_scene_kinds(void);
/* Make scene number i, of kind i % patch_scene_kinds(); free it with micro_scene_free(). False when memory is short. */
bool patch_scene_make(uint64_t i, micro_scene *out);

#endif

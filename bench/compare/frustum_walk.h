/* The library's frustum test alone: every object's box against the frustum, ids in the order they are
 * met. What is above this in a frame is order, occlusion and the visible set. */
#ifndef FRUSTUM_WALK_H
#define FRUSTUM_WALK_H

#include "umbrage/umbrage.h"

typedef struct frustum_walk frustum_walk;

frustum_walk *frustum_walk_create(const umb_index *index, uint32_t object_count);
void frustum_walk_destroy(frustum_walk *f);

/* Over a flat index all rows, else the tree from its root, without tests below nodes that lie wholly
 * inside. */
uint32_t frustum_walk_frame(frustum_walk *f, const umb_view *view, const uint32_t **objects);

#endif

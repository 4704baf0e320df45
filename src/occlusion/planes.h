/* The planes method: see planes.c. */
#ifndef UMB_PLANES_H
#define UMB_PLANES_H

#include "blocker_set.h"
#include "planes_kernels.h"

extern const umb_method_ops umb_planes_method;

/* How boxes and edges are compared; answers are the same. By default DIRECT, or CACHED where UMB_COHERENCE_PLANES is
 * on: this is for measurements of the others. */
typedef enum umb_planes_way {
    UMB_PLANES_DEFAULT,
    UMB_PLANES_DIRECT, /* planes through the eye and each edge, found once a frame */
    UMB_PLANES_TABLE,  /* tangent planes of each box and edge, by table (tangent.h) */
    UMB_PLANES_CACHED  /* the same, kept at the nodes (planes_cache.h) */
} umb_planes_way;

void umb_planes_go(void *state, umb_planes_way way);
/* Boxes and edges whose planes were kept, and whose had to be made, since the method was created. */
void umb_planes_count(const void *state, uint64_t *kept, uint64_t *made);

#endif

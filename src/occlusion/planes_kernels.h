/* Eight boxes against the half-spaces of a blocker, built for each instruction set from one source. */
#ifndef UMB_PLANES_KERNELS_H
#define UMB_PLANES_KERNELS_H

#include "blocker_set.h"

/* A node's boxes relative to the origin of blockers: the lower face along each axis, then the upper ones. */
typedef struct umb_near_boxes {
    float face[6][UMB_NODE_WIDTH];
    float reach[UMB_NODE_WIDTH]; /* at least the sum of |x - origin| of any point */
} umb_near_boxes;

/* What floats can say of boxes and a half-space, a bit for each box: all of the box is in it; not all of it is; none
 * is; some is. What neither of a pair says is too close to tell. */
typedef struct umb_sides {
    uint8_t in, open, out, part;
} umb_sides;

/* Tangent planes of an edge and eight boxes (tangent.h), n . x = offset: all of a box is past the edge on the occluder's
 * side where n . p > offset at the viewpoint p for the supporting plane, some of it where it is so for the separating
 * one. */
typedef struct umb_edge_planes {
    float supporting[4][UMB_NODE_WIDTH], separating[4][UMB_NODE_WIDTH];
    float size;     /* at least the sum of |x| of a point of the edge */
    uint8_t known;  /* boxes whose planes are there */
    uint8_t unsure; /* of these, those whose planes doubles could not tell */
} umb_edge_planes;

typedef struct umb_planes_kernels {
    umb_isa isa;
    void (*place)(const umb_node *node, const float high[3], const float low[3], umb_near_boxes *out);
    /* Stops where all boxes of the mask are out of half-spaces before `may_stop`; returns how many were looked at. */
    uint32_t (*sides)(const umb_near_boxes *boxes, const umb_half_space *spaces, uint32_t count, uint32_t may_stop,
                      uint32_t mask, umb_sides *out);
    /* p: the viewpoint and 1, or where it lies in a direction and 0. */
    umb_sides (*tangent_sides)(const umb_edge_planes *planes, const float p[4]);
} umb_planes_kernels;

/* NULL when the set is not available. All of them give the same bits. */
const umb_planes_kernels *umb_planes_kernels_get(umb_isa isa);

extern const umb_planes_kernels umb_planes_kernels_scalar;
extern const umb_planes_kernels umb_planes_kernels_sse4;
extern const umb_planes_kernels umb_planes_kernels_avx2;
extern const umb_planes_kernels umb_planes_kernels_neon;

#endif

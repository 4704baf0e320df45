/* A view's frustum made ready for culling boxes: which planes, in which form, with which error
 * bound. */
#ifndef UMB_FRUSTUM_H
#define UMB_FRUSTUM_H

#include "index/tree.h"
#include "umbrage/view.h"

#define UMB_FRUSTUM_PLANES (6 + UMB_MAX_CLIP_PLANES)

/* g(p) = n.(p - eye) + c, at least 0 inside. Scaled by a power of two so that the largest component
 * of n lies in [1/8, 1/4]: no product of floats overflows, whatever the box. */
typedef struct umb_frustum_plane {
    float n[3];
    float c;
    float slack; /* the part of the rounding bound that does not depend on the box */
    /* Along each axis the face of a box that is farther along n, and the other one, as the box kernels find
     * them in their list of faces. */
    uint8_t farther[3], nearer[3];
} umb_frustum_plane;

typedef struct umb_frustum {
    float eye_high[3], eye_low[3]; /* their sum is the eye, to 48 bits */
    uint16_t plane_count;
    uint16_t all_planes; /* a bit for each plane: what the root is tested against */
    umb_frustum_plane planes[UMB_FRUSTUM_PLANES]; /* left, right, bottom, top, near, far or not, extra */
} umb_frustum;

/* The view must have passed umb_view_check(). */
void umb_frustum_prepare(umb_frustum *f, const umb_view *view);

struct umb_box_kernels;

/* Test a node's eight boxes against the planes in the mask `planes` (Gummerus 4.2 to 4.4: the
 * corner farthest along a plane's normal and the nearest one, masking, plane coherency).
 *   returns   a bit for each slot that is outside one of these planes, and for each empty slot
 *   remember  this node's own byte, 0 at first: the plane to begin with; becomes the plane that all eight
 *             boxes were outside of. May be NULL. It never changes the answer
 *   left      for each slot the planes that its contents are still to be tested against; 0: wholly
 *             inside all of them (and 0 for slots outside)
 * Safe direction: a box that touches the closed frustum of view.h, in real numbers, is never outside;
 * a plane is only left out when the whole box is on its inner side. */
uint32_t umb_frustum_test_node(const umb_frustum *f, const struct umb_box_kernels *kernels,
                               const umb_node *node, uint16_t planes, uint8_t *remember,
                               uint16_t left[UMB_NODE_WIDTH]);

#endif

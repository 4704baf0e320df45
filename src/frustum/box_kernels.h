/* What is done with a node's eight boxes at once, built for each instruction set from one
 * source. */
#ifndef UMB_BOX_KERNELS_H
#define UMB_BOX_KERNELS_H

#include "frustum.h"

/* The map of a raster: with d = p - eye, X = x.d, Y = y.d, W = w.d,
 *     perspective    pixel = (X / W + cx, Y / W + cy)
 *     orthographic   pixel = (X + cx, Y + cy)
 * These numbers are taken as they are: they define the map, so that only its evaluation has an error,
 * which the kernel bounds by itself. */
typedef struct umb_projector {
    double eye[3];
    double x[3], y[3], w[3];
    double cx, cy;
    bool orthographic;
} umb_projector;

/* Bounds of the image of each box: every point of the closed box has its true image and its true W
 * within them. Perspective: a box that reaches W <= 0, or comes so near to it that the bound of W's
 * rounding matters, has the range +-UMB_PROJECTED_ALL in x and y; w_min may be negative then. Boxes
 * with w_min > 0 and a smaller range lie in front of the eye. Nothing is infinite, nothing is
 * NaN. */
typedef struct umb_projected {
    double x_min[UMB_NODE_WIDTH], x_max[UMB_NODE_WIDTH];
    double y_min[UMB_NODE_WIDTH], y_max[UMB_NODE_WIDTH];
    double w_min[UMB_NODE_WIDTH], w_max[UMB_NODE_WIDTH];
} umb_projected;

#define UMB_PROJECTED_ALL 1e30

typedef struct umb_box_kernels {
    umb_isa isa;
    /* umb_frustum_test_node(); *tests becomes the number of planes that all eight boxes were tested
     * against (with plane coherency fewer than planes has). */
    uint32_t (*cull)(const umb_frustum *f, const umb_node *node, uint16_t planes, uint8_t *remember,
                     uint16_t left[UMB_NODE_WIDTH], uint32_t *tests);
    void (*project)(const umb_node *node, const umb_projector *p, umb_projected *out);
} umb_box_kernels;

/* The kernels of an instruction set, AUTO for the best; NULL when it is not available. All of them
 * give the same bits. */
const umb_box_kernels *umb_box_kernels_get(umb_isa isa);

extern const umb_box_kernels umb_box_kernels_scalar;
extern const umb_box_kernels umb_box_kernels_sse4;
extern const umb_box_kernels umb_box_kernels_avx2;
extern const umb_box_kernels umb_box_kernels_neon;

#endif

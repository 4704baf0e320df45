/* What is done with a node's eight boxes at once, built for each instruction set from one
 * source. */
#ifndef UMB_BOX_KERNELS_H
#define UMB_BOX_KERNELS_H

#include "frustum.h"

/* The map of a raster: with d = p - eye, X = x.d, Y = y.d, W = w.d
 *     perspective    image = (X / W + cx, Y / W + cy)
 *     orthographic   image = (X + cx, Y + cy)
 * and the row of a height y = slope y + extra clamp(y - from, 0, span), which the raster's own table is
 * within slack rows of. Made from doubles, which define the map; the kernel bounds what floats lose. */
typedef struct umb_projector {
    float eye_high[3], eye_low[3]; /* their sum is the eye, to 48 bits */
    float x[3], y[3], w[3];
    float cx, cy;
    float size_x, size_y, size_w; /* largest absolute components of x, y, w */
    float eye_size;               /* what the eye's own rounding is relative to, in units of a box's reach */
    float slope, extra, from, span, slack;
    float width, height; /* pixels */
    int32_t vertical;    /* 0..2: x and w have no component along this axis and y no other one; -1: none */
    int32_t orthographic;
} umb_projector;

/* The image of each box, outer: pixels that any point of it may touch, as far as they are on the raster,
 * and depths that hold its W. The image is meaningful for boxes of the mask testable: those that lie in
 * front of the eye by more than what rounding can do to W. Slots that are not have zeros. */
typedef struct umb_projected {
    int32_t x0[UMB_NODE_WIDTH], y0[UMB_NODE_WIDTH], x1[UMB_NODE_WIDTH], y1[UMB_NODE_WIDTH];
    float nearness[UMB_NODE_WIDTH]; /* at least 1 / W, orthographic -W, of every point of the box */
    float w_min[UMB_NODE_WIDTH], w_max[UMB_NODE_WIDTH];
    uint32_t testable; /* a bit for each slot */
    uint32_t beside;   /* testable, and no point of it is on the raster */
    uint32_t nodes, objects; /* slots that name such */
} umb_projected;

/* What a projector is made from. */
typedef struct umb_projector_def {
    const double *eye, *x, *y, *w; /* three each */
    double cx, cy;
    float slope, extra, from, span, slack;
    uint32_t width, height;
    int vertical;
    bool orthographic;
} umb_projector_def;

void umb_projector_prepare(umb_projector *p, const umb_projector_def *def);

/* Where the frustum kernels keep a face of their eight boxes: the lower ones first, eight floats each. */
static inline uint8_t umb_box_face(int axis, bool upper)
{
    return (uint8_t)(((upper ? 3 : 0) + axis) * UMB_NODE_WIDTH);
}

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

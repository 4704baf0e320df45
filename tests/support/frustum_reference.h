/* A box against the planes of a view, in long double. */
#ifndef FRUSTUM_REFERENCE_H
#define FRUSTUM_REFERENCE_H

#include <math.h>

#include "frustum/box_kernels.h"
#include "random_boxes.h"

/* g of each plane as view.h defines it, not normalised, at the box's corner farthest along the
 * normal (most) and at the opposite one (least), and a bound of what long double loses. */
typedef struct reference {
    long double most, least, size, length;
} reference;

static inline reference evaluate(const long double n[3], long double c, const double eye[3],
                          const umb_aabb *b)
{
    reference r = {c, c, fabsl(c), 0};
    for (int i = 0; i < 3; ++i) {
        long double low = n[i] * ((long double)b->min[i] - eye[i]);
        long double high = n[i] * ((long double)b->max[i] - eye[i]);
        r.most += low > high ? low : high;
        r.least += low > high ? high : low;
        r.size += fabsl(n[i]) * (fabsl(b->min[i]) + fabsl(b->max[i]) + fabsl(eye[i]));
        r.length += n[i] * n[i];
    }
    r.length = sqrtl(r.length);
    return r;
}

static inline uint32_t references(const umb_view *v, const umb_aabb *b, reference out[UMB_FRUSTUM_PLANES])
{
    const double *axes[4] = {v->right, v->right, v->up, v->up};
    const double bounds[4] = {v->x_min, v->x_max, v->y_min, v->y_max};
    bool deep = v->projection == UMB_PERSPECTIVE;
    uint32_t count = 0;
    for (int k = 0; k < 4; ++k) {
        long double sign = k % 2 == 0 ? 1 : -1;
        long double n[3];
        for (int i = 0; i < 3; ++i) {
            n[i] = sign * (axes[k][i] - (deep ? (long double)bounds[k] * v->forward[i] : 0));
        }
        out[count++] = evaluate(n, deep ? 0 : -sign * bounds[k], v->eye, b);
    }
    long double ahead[3] = {v->forward[0], v->forward[1], v->forward[2]};
    long double back[3] = {-ahead[0], -ahead[1], -ahead[2]};
    out[count++] = evaluate(ahead, -(long double)v->near_depth, v->eye, b);
    if (!isinf(v->far_depth)) {
        out[count++] = evaluate(back, v->far_depth, v->eye, b);
    }
    for (uint32_t k = 0; k < v->plane_count; ++k) {
        static const double zero[3] = {0, 0, 0};
        long double n[3] = {v->planes[k][0], v->planes[k][1], v->planes[k][2]};
        out[count++] = evaluate(n, v->planes[k][3], zero, b);
    }
    return count;
}

/* A box alone against the frustum, by the scalar kernel: 0 outside, 1 crossing, 2 inside. *sound: what touches the frustum in long
 * double is not outside, and what is inside is inside there, too. */
static inline uint8_t place_of_box(const umb_view *v, const umb_frustum *f, const umb_aabb *box, bool *sound)
{
    uint16_t left[UMB_NODE_WIDTH];
    umb_node node = node_of(box, 1);
    uint32_t outside = umb_frustum_test_node(f, umb_box_kernels_get(UMB_ISA_SCALAR), &node, f->all_planes, NULL, left);
    uint8_t place = (outside & 1u) != 0 ? 0 : left[0] != 0 ? 1 : 2;
    reference r[UMB_FRUSTUM_PLANES];
    uint32_t planes = references(v, box, r);
    bool touches = true, within = true;
    for (uint32_t k = 0; k < planes; ++k) {
        touches = touches && r[k].most >= 0x1p-58L * r[k].size;
        within = within && r[k].least > -0x1p-58L * r[k].size;
    }
    *sound = (!touches || place != 0) && (place != 2 || within);
    return place;
}

#endif

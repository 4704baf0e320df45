/* Random views and boxes, plain and adversarial, for tests of the rooms frustum and index. */
#ifndef RANDOM_BOXES_H
#define RANDOM_BOXES_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "index/tree.h"
#include "umbrage/view.h"

/* UMBRAGE_TEST_SIZE: a number for each size. */
static inline uint32_t for_size(uint32_t small, uint32_t normal, uint32_t full)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    char first = size != NULL ? size[0] : 'n';
    return first == 's' ? small : first == 'f' ? full : normal;
}

/* xorshift64*; never zero. */
static inline uint64_t random_next(uint64_t *state)
{
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    return *state * 0x2545F4914F6CDD1Du;
}

static inline uint32_t random_below(uint64_t *state, uint32_t n)
{
    return (uint32_t)((random_next(state) >> 32) * n >> 32);
}

/* In [low, high). */
static inline double random_in(uint64_t *state, double low, double high)
{
    return low + (high - low) * ((double)(random_next(state) >> 11) * 0x1p-53);
}

/* Either sign, sizes spread evenly over the powers of ten. */
static inline double random_power(uint64_t *state, double low_exponent, double high_exponent)
{
    double v = pow(10.0, random_in(state, low_exponent, high_exponent));
    return random_next(state) & 1 ? v : -v;
}

/* scale: how far eye and target may be from the origin. Every fourth view is orthographic, every
 * third is turned about axes only; some have no far plane, some have extra planes, some are
 * off-centre. */
static inline umb_view random_view(uint64_t *state, double scale)
{
    umb_view v;
    double eye[3], target[3], up[3];
    umb_result result = UMB_ERROR_ARGUMENT;
    while (result != UMB_OK) {
        for (int i = 0; i < 3; ++i) {
            eye[i] = random_in(state, -scale, scale);
            target[i] = random_in(state, -scale, scale);
            up[i] = random_in(state, -1.0, 1.0);
        }
        if (random_below(state, 3) == 0) {
            uint32_t axis = random_below(state, 3);
            for (int i = 0; i < 3; ++i) {
                eye[i] = (float)eye[i];
                target[i] = eye[i] + ((uint32_t)i == axis ? 4.0 : 0.0);
                up[i] = (uint32_t)i == (axis + 1) % 3 ? -2.0 : 0.0;
            }
        }
        double near_depth = scale * random_in(state, 0.001, 0.3);
        double far_depth = near_depth + scale * random_in(state, 0.1, 3.0);
        double aspect = random_in(state, 0.3, 3.0);
        if (random_below(state, 4) == 0) {
            result = umb_view_look_at_ortho(&v, eye, target, up, scale * random_in(state, 0.05, 2.0),
                                            aspect, near_depth - 0.1 * scale, far_depth);
        } else {
            result = umb_view_look_at(&v, eye, target, up, random_in(state, 0.05, 2.8), aspect,
                                      near_depth,
                                      random_below(state, 4) == 0 ? INFINITY : far_depth);
        }
    }
    if (random_below(state, 3) == 0) {
        double shift = random_in(state, -1.0, 1.0) * (v.x_max - v.x_min);
        v.x_min += shift;
        v.x_max += shift;
    }
    if (random_below(state, 3) == 0) {
        v.plane_count = 1 + random_below(state, UMB_MAX_CLIP_PLANES);
        for (uint32_t k = 0; k < v.plane_count; ++k) {
            double at = 0.0;
            for (int i = 0; i < 3; ++i) {
                v.planes[k][i] = random_in(state, -3.0, 3.0);
                at += v.planes[k][i] * (v.eye[i] + 0.3 * scale * random_in(state, -1.0, 1.0));
            }
            v.planes[k][3] = -at;
        }
    }
    return v;
}

static inline void box_order(umb_aabb *b)
{
    for (int i = 0; i < 3; ++i) {
        if (b->min[i] > b->max[i]) {
            float t = b->min[i];
            b->min[i] = b->max[i];
            b->max[i] = t;
        }
    }
}

/* A box around some place within reach of the view: of any shape from point to sheet to crate. */
static inline umb_aabb random_box(uint64_t *state, const double near_to[3], double scale)
{
    umb_aabb b;
    for (int i = 0; i < 3; ++i) {
        double at = near_to[i] + scale * random_in(state, -2.0, 2.0);
        double size = random_below(state, 4) == 0 ? 0.0
                                                  : scale * pow(10.0, random_in(state, -6, 0.3));
        b.min[i] = (float)(at - size);
        b.max[i] = (float)(at + size);
    }
    return b;
}

/* Boxes of absurd sizes: denormal, huge, half-infinite sheets, zero. */
static inline umb_aabb absurd_box(uint64_t *state)
{
    static const float values[] = {0.0f,   -0.0f,   1e-45f,   -1e-45f, 1e-38f, -1e-38f, 1e-20f,
                                   1.0f,   -1.0f,   1e7f,     -1e7f,   1e20f,  -1e20f,  1e30f,
                                   -1e30f, 3.4e38f, -3.4e38f, 0.1f,    -0.1f,  123.0f};
    umb_aabb b;
    for (int i = 0; i < 3; ++i) {
        b.min[i] = values[random_below(state, sizeof(values) / sizeof(values[0]))];
        b.max[i] = random_below(state, 3) == 0
                       ? b.min[i]
                       : values[random_below(state, sizeof(values) / sizeof(values[0]))];
    }
    box_order(&b);
    return b;
}

/* A node of count boxes, padded as the tree's layout says. */
static inline umb_node node_of(const umb_aabb *boxes, uint32_t count)
{
    umb_node n;
    memset(&n, 0, sizeof(n));
    n.count = count;
    n.parent = UMB_NONE;
    for (uint32_t s = 0; s < UMB_NODE_WIDTH; ++s) {
        const umb_aabb *b = &boxes[s < count ? s : 0];
        for (int i = 0; i < 3; ++i) {
            n.min[i][s] = b->min[i];
            n.max[i][s] = b->max[i];
        }
        n.ref[s] = s < count ? UMB_REF_OBJECT | s : UMB_NONE;
    }
    return n;
}

#endif

/* Whether a box and a frustum have a point in common, surely. */
#ifndef BOX_MEETS_H
#define BOX_MEETS_H

#include "frustum_reference.h"

/* n.p + c >= 0, scaled so that n has length 1. */
typedef struct half_space {
    long double n[3], c;
} half_space;

static inline uint32_t half_spaces_of(const umb_view *v, const umb_aabb *b, half_space *out)
{
    /* Two boxes tell the plane of a view's reference: its value at the origin and along the axes. */
    uint32_t count = 0;
    const umb_aabb zero = {{0, 0, 0}, {0, 0, 0}};
    reference at[4][UMB_FRUSTUM_PLANES];
    count = references(v, &zero, at[0]);
    for (int i = 0; i < 3; ++i) {
        umb_aabb unit = zero;
        unit.min[i] = unit.max[i] = 1;
        references(v, &unit, at[1 + i]);
    }
    for (uint32_t k = 0; k < count; ++k) {
        for (int i = 0; i < 3; ++i) {
            out[k].n[i] = (at[1 + i][k].most - at[0][k].most) / at[0][k].length;
        }
        out[k].c = at[0][k].most / at[0][k].length;
    }
    for (int i = 0; i < 3; ++i) {
        out[count] = (half_space){{0, 0, 0}, -(long double)b->min[i]};
        out[count++].n[i] = 1;
        out[count] = (half_space){{0, 0, 0}, (long double)b->max[i]};
        out[count++].n[i] = -1;
    }
    return count;
}

static inline long double half_space_at(const half_space *h, const long double p[3])
{
    return h->n[0] * p[0] + h->n[1] * p[1] + h->n[2] * p[2] + h->c;
}

/* Where three planes meet; false if they are close to parallel. */
static inline bool corner_of(const half_space *a, const half_space *b, const half_space *c, long double p[3])
{
    const long double *u = a->n, *v = b->n, *w = c->n;
    long double vw[3] = {v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]};
    long double wu[3] = {w[1] * u[2] - w[2] * u[1], w[2] * u[0] - w[0] * u[2], w[0] * u[1] - w[1] * u[0]};
    long double uv[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
    long double det = u[0] * vw[0] + u[1] * vw[1] + u[2] * vw[2];
    for (int i = 0; i < 3; ++i) {
        p[i] = -(a->c * vw[i] + b->c * wu[i] + c->c * uv[i]) / det;
    }
    return fabsl(det) > 1e-9L;
}

/* True only if there is a common point, with `margin` to spare at every side that is not the box's own. The corners of
 * what they share are found, and their middle is looked at. */
static inline bool box_surely_meets(const umb_view *v, const umb_aabb *b, long double margin)
{
    half_space h[UMB_FRUSTUM_PLANES + 6];
    uint32_t n = half_spaces_of(v, b, h), corners = 0;
    long double middle[3] = {0, 0, 0};
    for (uint32_t i = 0; i < n; ++i) {
        for (uint32_t j = i + 1; j < n; ++j) {
            for (uint32_t k = j + 1; k < n; ++k) {
                long double p[3];
                bool in = corner_of(&h[i], &h[j], &h[k], p);
                for (uint32_t m = 0; m < n && in; ++m) {
                    in = m == i || m == j || m == k || half_space_at(&h[m], p) >= 0;
                }
                for (int a = 0; a < 3 && in; ++a) {
                    middle[a] += p[a];
                }
                corners += in;
            }
        }
    }
    bool meets = corners > 0;
    for (int a = 0; a < 3 && meets; ++a) {
        middle[a] /= corners;
    }
    for (uint32_t m = 0; m < n && meets; ++m) {
        meets = half_space_at(&h[m], middle) >= (m < n - 6 ? margin : 0);
    }
    return meets;
}

#endif

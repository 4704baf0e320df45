/* On which side of the sight-lines past an edge something lies.
 *
 * Seen from where an occluder is seen counter-clockwise, each edge a -> b has the occluder on its left. With d a
 * point's place relative to the eye p
 *
 *     g(x) = ((b - p) x (a - p)) . (x - p)          parallel sight-lines along f:  ((b - a) x f) . (x - a)
 *
 * is greater than 0 for points x on the occluder's side of the plane through p and the edge: sight-lines to them pass
 * on that side. In doubles g is off by at most error times the sum of |x - p|, which is derived in
 * docs/conservative.md, 14. */
#ifndef UMB_SIGHT_H
#define UMB_SIGHT_H

#include "geometry/vec.h"
#include "method.h"

typedef struct umb_sight {
    umb_vec3 n, from;
    double error;
} umb_sight;

static inline umb_sight umb_sight_past(const umb_viewer *v, uint32_t point, const float a[3], const float b[3])
{
    umb_vec3 at = umb_vec3_from_double(v->points[point]), va = umb_vec3_from_float(a), vb = umb_vec3_from_float(b);
    umb_vec3 first = v->parallel ? umb_vec3_sub(vb, va) : umb_vec3_sub(vb, at);
    umb_vec3 second = v->parallel ? at : umb_vec3_sub(va, at);
    umb_sight s = {umb_vec3_cross(first, second), v->parallel ? va : at,
                   0x1p-49 * umb_vec3_sum_abs(first) * umb_vec3_sum_abs(second)};
    return s;
}

/* 1: surely on the occluder's side; -1: surely on the other; 0: too close to tell. Overflow is 0. */
static inline int umb_sight_side(const umb_sight *s, umb_vec3 x)
{
    umb_vec3 d = umb_vec3_sub(x, s->from);
    double value = umb_vec3_dot(s->n, d), bound = s->error * umb_vec3_sum_abs(d);
    return value > bound ? 1 : value < -bound ? -1 : 0;
}

#endif

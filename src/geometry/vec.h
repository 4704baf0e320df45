/* Double-precision vectors for set-up work. Sums always run x, then y, then z, and nothing is fused
 * (-ffp-contract=off), so that every build rounds alike. */
#ifndef UMB_VEC_H
#define UMB_VEC_H

#include <math.h>

#include "umbrage/geometry.h"

typedef struct umb_vec3 {
    double x, y, z;
} umb_vec3;

static inline umb_vec3 umb_vec3_make(double x, double y, double z)
{
    umb_vec3 v = {x, y, z};
    return v;
}

static inline umb_vec3 umb_vec3_from_double(const double p[3])
{
    return umb_vec3_make(p[0], p[1], p[2]);
}

static inline umb_vec3 umb_vec3_from_float(const float p[3])
{
    return umb_vec3_make(p[0], p[1], p[2]);
}

static inline umb_vec3 umb_vec3_add(umb_vec3 a, umb_vec3 b)
{
    return umb_vec3_make(a.x + b.x, a.y + b.y, a.z + b.z);
}

static inline umb_vec3 umb_vec3_sub(umb_vec3 a, umb_vec3 b)
{
    return umb_vec3_make(a.x - b.x, a.y - b.y, a.z - b.z);
}

static inline umb_vec3 umb_vec3_scale(umb_vec3 a, double s)
{
    return umb_vec3_make(a.x * s, a.y * s, a.z * s);
}

static inline double umb_vec3_dot(umb_vec3 a, umb_vec3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline umb_vec3 umb_vec3_cross(umb_vec3 a, umb_vec3 b)
{
    return umb_vec3_make(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

/* Sum of absolute values: the norm that the rounding bounds are written in. */
static inline double umb_vec3_sum_abs(umb_vec3 a)
{
    return fabs(a.x) + fabs(a.y) + fabs(a.z);
}

static inline double umb_vec3_length(umb_vec3 a)
{
    return sqrt(umb_vec3_dot(a, a));
}

#endif

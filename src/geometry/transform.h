/* The one place where a shape's vertex becomes a world vertex (umb_transform says how it
 * rounds). */
#ifndef UMB_TRANSFORM_H
#define UMB_TRANSFORM_H

#include <string.h>

#include "vec.h"

/* True if every entry is zero or the matrix is the identity: vertices are kept as they are. */
bool umb_transform_is_identity(const umb_transform *t);

/* True if the linear part turns counter-clockwise into clockwise (negative determinant, in
 * double). */
bool umb_transform_mirrors(const umb_transform *t);

/* World vertex: each row summed in double, in order, rounded once to float. */
static inline void umb_transform_point(const umb_transform *t, const float p[3], float out[3])
{
    for (int i = 0; i < 3; ++i) {
        out[i] = (float)((double)t->m[i][0] * p[0] + (double)t->m[i][1] * p[1] +
                         (double)t->m[i][2] * p[2] + (double)t->m[i][3]);
    }
}

/* The same of what is known to stand where its shape does. */
static inline void umb_transform_vertex(const umb_transform *t, bool identity, const float p[3], float out[3])
{
    if (identity) {
        memcpy(out, p, 3 * sizeof *out);
    } else {
        umb_transform_point(t, p, out);
    }
}

#endif

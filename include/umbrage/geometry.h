/* Boxes and transforms. Units are the user's own (metres in our scenes). */
#ifndef UMBRAGE_GEOMETRY_H
#define UMBRAGE_GEOMETRY_H

#include "base.h"

#ifdef __cplusplus
extern "C" {
#endif

/* An axis-aligned box, closed: its faces belong to it. min <= max in every component, all
 * finite. */
typedef struct umb_aabb {
    float min[3];
    float max[3];
} umb_aabb;

/* An affine map of column vectors, three rows of four, translation last:
 *   out[i] = m[i][0]*x + m[i][1]*y + m[i][2]*z + m[i][3].
 * A world vertex is that sum computed in double, in the order written, rounded once to float; the
 * library and its oracle agree on this to the bit. All zero means the identity. */
typedef struct umb_transform {
    float m[3][4];
} umb_transform;

#ifdef __cplusplus
}
#endif
#endif

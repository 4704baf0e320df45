/* Exact tests on float points: decisions, never approximations. */
#ifndef UMB_COLLINEAR_H
#define UMB_COLLINEAR_H

#include <stdbool.h>

/* Sign (-1, 0, 1) of the z component of (b - a) x (c - a), from the coordinates i and j of the
 * points; exact for all finite floats. */
int umb_collinear_turn(const float a[3], const float b[3], const float c[3], int i, int j);

/* True if the three points lie exactly on one line (two may be equal). */
bool umb_collinear(const float a[3], const float b[3], const float c[3]);

/* True if p lies exactly on the segment from a to b and is neither end. */
bool umb_collinear_inside(const float a[3], const float b[3], const float p[3]);

#endif

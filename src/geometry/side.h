/* On which side of a plane through three points of floats something of doubles lies, decided exactly. */
#ifndef UMB_SIDE_H
#define UMB_SIDE_H

/* Sign (-1, 0, 1) of det(b - a, c - a, p - a): 1 if p lies where a, b, c are seen counter-clockwise. Exact for finite
 * floats and for p whose components are 0 or between 2^-500 and 2^500. */
int umb_side_of_point(const float plane[3][3], const double p[3]);
/* The same for a direction: the sign of det(b - a, c - a, d). */
int umb_side_of_direction(const float plane[3][3], const double d[3]);

#endif

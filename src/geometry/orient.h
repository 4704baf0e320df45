/* On which side of a plane through three points a fourth lies, decided exactly. */
#ifndef UMB_ORIENT_H
#define UMB_ORIENT_H

/* Sign (-1, 0, 1) of the determinant of the rows b - a, c - a, d - a: 1 if d lies where a, b, c are
 * seen counter-clockwise, 0 if the four points lie in one plane. Exact for all finite floats; not 0
 * when a coordinate is not finite. */
int umb_orient(const float a[3], const float b[3], const float c[3], const float d[3]);

/* The same without its shortcuts, for tests. */
int umb_orient_by_sum(const float a[3], const float b[3], const float c[3], const float d[3]);

#endif

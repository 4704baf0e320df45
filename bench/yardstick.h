/* The unit that times are given in: one plain pass of the frustum test over all boxes of a
 * scene. */
#ifndef YARDSTICK_H
#define YARDSTICK_H

#include <stdint.h>

/* Test count boxes, six arrays of components (min x, y, z, max x, y, z), against six planes (inside
 * where n.p + d >= 0), in float, by the corner farthest along each normal, with no bound of
 * rounding. Bit i of mask is set when box i is not outside; count need not be a multiple of eight,
 * the arrays must reach to one. In AVX2 where the processor has it: as fast as the obvious loop
 * gets. */
void yardstick_frustum_pass(const float *soa_boxes[6], uint32_t count, const float planes[6][4],
                            uint8_t *mask);

#endif

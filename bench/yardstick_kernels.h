/* The two builds of the yardstick's loop. corner: for each plane the three component arrays of the
 * corners farthest along its normal. */
#ifndef YARDSTICK_KERNELS_H
#define YARDSTICK_KERNELS_H

#include <stdint.h>

void yardstick_pass_avx2(const float *corner[6][3], uint32_t count, const float planes[6][4],
                         uint8_t *mask);

#endif

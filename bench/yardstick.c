/* Choosing the corners and the build of the pass. */
#include "yardstick.h"

#include "yardstick_kernels.h"

static void pass_plain(const float *corner[6][3], uint32_t count, const float planes[6][4],
                       uint8_t *mask)
{
    for (uint32_t i = 0; i < count; i += 8) {
        uint32_t inside[8] = {1, 2, 4, 8, 16, 32, 64, 128};
        uint32_t bits = 0;
        for (int k = 0; k < 6; ++k) {
            for (uint32_t j = 0; j < 8; ++j) {
                float g = corner[k][0][i + j] * planes[k][0] + corner[k][1][i + j] * planes[k][1] +
                          corner[k][2][i + j] * planes[k][2] + planes[k][3];
                inside[j] = g < 0.0f ? 0u : inside[j];
            }
        }
        for (uint32_t j = 0; j < 8; ++j) {
            bits |= inside[j];
        }
        mask[i / 8] = (uint8_t)bits;
    }
}

void yardstick_frustum_pass(const float *soa_boxes[6], uint32_t count, const float planes[6][4],
                            uint8_t *mask)
{
    const float *corner[6][3];
    for (int k = 0; k < 6; ++k) {
        for (int axis = 0; axis < 3; ++axis) {
            corner[k][axis] = soa_boxes[planes[k][axis] < 0.0f ? axis : axis + 3];
        }
    }
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) {
        yardstick_pass_avx2(corner, count, planes, mask);
        return;
    }
#endif
    pass_plain(corner, count, planes, mask);
}

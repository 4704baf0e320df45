/* The pass in AVX2. */
#include "yardstick_kernels.h"

#if defined(__AVX2__)
typedef float v8f __attribute__((vector_size(32)));
typedef int32_t v8i __attribute__((vector_size(32)));

static inline v8f load(const float *p)
{
    v8f v;
    __builtin_memcpy(&v, p, sizeof(v));
    return v;
}

void yardstick_pass_avx2(const float *corner[6][3], uint32_t count, const float planes[6][4],
                         uint8_t *mask)
{
    for (uint32_t i = 0; i < count; i += 8) {
        v8i outside = {0};
        for (int k = 0; k < 6; ++k) {
            v8f g = load(corner[k][0] + i) * planes[k][0] + load(corner[k][1] + i) * planes[k][1] +
                    load(corner[k][2] + i) * planes[k][2] + planes[k][3];
            outside |= g < 0.0f;
        }
        mask[i / 8] = (uint8_t)~__builtin_ia32_movmskps256((v8f)outside);
    }
}
#endif

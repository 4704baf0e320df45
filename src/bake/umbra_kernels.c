#include "umbra_kernels.h"

#include <math.h>

#include "base/isa.h"

const umb_umbra_kernels *umb_umbra_kernels_get(umb_isa isa)
{
    if (umb_isa_resolve(isa, &isa) != UMB_OK) {
        return NULL;
    }
    switch (isa) {
#if defined(UMB_HAVE_SSE4)
    case UMB_ISA_SSE4:
        return &umb_umbra_kernels_sse4;
#endif
#if defined(UMB_HAVE_AVX2)
    case UMB_ISA_AVX2:
        return &umb_umbra_kernels_avx2;
#endif
#if defined(UMB_HAVE_NEON)
    case UMB_ISA_NEON:
        return &umb_umbra_kernels_neon;
#endif
    default:
        return &umb_umbra_kernels_scalar;
    }
}

void umb_umbra_clear(umb_umbra_tile *tiles, uint32_t umbrae, uint64_t live)
{
    for (uint32_t k = 0; k < umbrae; ++k) {
        umb_umbra_tile *t = &tiles[k];
        for (int i = 0; i < 64; ++i) {
            float empty = k > 0 || (live >> i & 1) != 0 ? INFINITY : -INFINITY;
            t->top[i] = t->top_far[i] = -empty;
            t->bottom[i] = t->bottom_far[i] = t->depth[i] = empty;
        }
    }
}

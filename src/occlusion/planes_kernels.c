#include "planes_kernels.h"

#include "base/isa.h"

const umb_planes_kernels *umb_planes_kernels_get(umb_isa isa)
{
    if (umb_isa_resolve(isa, &isa) != UMB_OK) {
        return NULL;
    }
    switch (isa) {
#if defined(UMB_HAVE_SSE4)
    case UMB_ISA_SSE4:
        return &umb_planes_kernels_sse4;
#endif
#if defined(UMB_HAVE_AVX2)
    case UMB_ISA_AVX2:
        return &umb_planes_kernels_avx2;
#endif
#if defined(UMB_HAVE_NEON)
    case UMB_ISA_NEON:
        return &umb_planes_kernels_neon;
#endif
    default:
        return &umb_planes_kernels_scalar;
    }
}

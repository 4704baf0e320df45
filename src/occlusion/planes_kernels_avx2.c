/* planes_kernels.inl for AVX2. */
#include "planes_kernels.h"

#if defined(UMB_HAVE_AVX2)
#define KERNELS umb_planes_kernels_avx2
#define ISA UMB_ISA_AVX2
#include "planes_kernels.inl"
#endif

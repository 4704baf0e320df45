/* box_kernels.inl for AVX2. */
#include "box_kernels.h"

#if defined(UMB_HAVE_AVX2)
#define KERNELS umb_box_kernels_avx2
#define ISA UMB_ISA_AVX2
#include "box_kernels.inl"
#endif

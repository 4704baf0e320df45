/* umbra_kernels.inl for AVX2. */
#include "umbra_kernels.h"

#if defined(UMB_HAVE_AVX2)
#define KERNELS umb_umbra_kernels_avx2
#define ISA UMB_ISA_AVX2
#include "umbra_kernels.inl"
#endif

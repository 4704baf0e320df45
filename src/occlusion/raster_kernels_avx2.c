/* raster_kernels.inl for AVX2. */
#include "raster_kernels.h"

#if defined(UMB_HAVE_AVX2)
#define KERNELS umb_raster_kernels_avx2
#define ISA UMB_ISA_AVX2
#include "raster_kernels.inl"
#endif

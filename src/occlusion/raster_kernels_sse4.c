/* raster_kernels.inl for SSE4.1. */
#include "raster_kernels.h"

#if defined(UMB_HAVE_SSE4)
#define KERNELS umb_raster_kernels_sse4
#define ISA UMB_ISA_SSE4
#include "raster_kernels.inl"
#endif

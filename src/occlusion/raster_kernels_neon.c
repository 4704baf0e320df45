/* raster_kernels.inl for NEON, which every 64-bit ARM processor has. */
#include "raster_kernels.h"

#if defined(UMB_HAVE_NEON)
#define KERNELS umb_raster_kernels_neon
#define ISA UMB_ISA_NEON
#include "raster_kernels.inl"
#endif

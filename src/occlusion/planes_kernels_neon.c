/* planes_kernels.inl for NEON. */
#include "planes_kernels.h"

#if defined(UMB_HAVE_NEON)
#define KERNELS umb_planes_kernels_neon
#define ISA UMB_ISA_NEON
#include "planes_kernels.inl"
#endif

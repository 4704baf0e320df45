/* planes_kernels.inl for SSE4. */
#include "planes_kernels.h"

#if defined(UMB_HAVE_SSE4)
#define KERNELS umb_planes_kernels_sse4
#define ISA UMB_ISA_SSE4
#include "planes_kernels.inl"
#endif

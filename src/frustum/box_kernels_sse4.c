/* box_kernels.inl for SSE4.1. */
#include "box_kernels.h"

#if defined(UMB_HAVE_SSE4)
#define KERNELS umb_box_kernels_sse4
#define ISA UMB_ISA_SSE4
#include "box_kernels.inl"
#endif

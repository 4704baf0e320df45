/* box_kernels.inl for NEON, which every 64-bit ARM processor has. */
#include "box_kernels.h"

#if defined(UMB_HAVE_NEON)
#define KERNELS umb_box_kernels_neon
#define ISA UMB_ISA_NEON
#include "box_kernels.inl"
#endif

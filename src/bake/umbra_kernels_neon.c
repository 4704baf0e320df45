/* umbra_kernels.inl for NEON. */
#include "umbra_kernels.h"

#if defined(UMB_HAVE_NEON)
#define KERNELS umb_umbra_kernels_neon
#define ISA UMB_ISA_NEON
#include "umbra_kernels.inl"
#endif

/* umbra_kernels.inl for SCALAR. */
#include "umbra_kernels.h"

#define KERNELS umb_umbra_kernels_scalar
#define ISA UMB_ISA_SCALAR
#include "umbra_kernels.inl"

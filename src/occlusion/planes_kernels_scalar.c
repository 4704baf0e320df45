/* planes_kernels.inl without vectors: the specification that every other instruction set must
 * equal. */
#include "planes_kernels.h"

#define KERNELS umb_planes_kernels_scalar
#define ISA UMB_ISA_SCALAR
#include "planes_kernels.inl"

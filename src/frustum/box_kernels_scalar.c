/* box_kernels.inl without vectors: the specification that every other instruction set must
 * equal. */
#include "box_kernels.h"

#define KERNELS umb_box_kernels_scalar
#define ISA UMB_ISA_SCALAR
#include "box_kernels.inl"

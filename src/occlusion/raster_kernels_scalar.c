/* raster_kernels.inl without vectors: the specification that every other instruction set must
 * equal. */
#include "raster_kernels.h"

#define KERNELS umb_raster_kernels_scalar
#define ISA UMB_ISA_SCALAR
#include "raster_kernels.inl"

/* umbra_kernels.inl with a mistake: see UMB_MUTANT there. */
#include "mutants.h"

#define KERNELS mutant_1
#define ISA UMB_ISA_SCALAR
#define UMB_MUTANT 1
#include "bake/umbra_kernels.inl"

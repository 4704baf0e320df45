/* umbra_kernels.inl with a mistake: see UMB_MUTANT there. */
#include "mutants.h"

#define KERNELS mutant_4
#define ISA UMB_ISA_SCALAR
#define UMB_MUTANT 4
#include "bake/umbra_kernels.inl"

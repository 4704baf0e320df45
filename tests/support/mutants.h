/* Kernels of umbrae with a mistake planted in each. */
#ifndef MUTANTS_H
#define MUTANTS_H

#include "bake/umbra_kernels.h"

#define MUTANT_COUNT 4

extern const umb_umbra_kernels mutant_1, mutant_2, mutant_3, mutant_4;

#endif

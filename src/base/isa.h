/* Which kernels run. An instruction set counts as built in when the build defines UMB_HAVE_SSE4,
 * UMB_HAVE_AVX2 or UMB_HAVE_NEON for this room (it does so for the kernel files that it
 * compiles). */
#ifndef UMB_ISA_H
#define UMB_ISA_H

#include "umbrage/base.h"

/* What isa stands for: AUTO becomes the best one available. UMB_ERROR_ARGUMENT when the one named
 * is missing; *out is then UMB_ISA_SCALAR. */
umb_result umb_isa_resolve(umb_isa isa, umb_isa *out);

#endif

/* The planes method: see planes.c. */
#ifndef UMB_PLANES_H
#define UMB_PLANES_H

#include "blocker_set.h"
#include "planes_kernels.h"

extern const umb_method_ops umb_planes_method;

#endif

/* What the files of bounding volumes share. */
#ifndef UMB_BOUNDS_PARTS_H
#define UMB_BOUNDS_PARTS_H

#include "umbrage/bounds.h"

/* Fill in the corners and edges of a frustum whose axes and bounds are there; bounds_exact.c. */
void umb_bounds_find_edges(umb_bounds_frustum *f);

#endif

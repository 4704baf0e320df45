/* The best-first walk of the index, for methods that are fed occluders front to back. */
#ifndef UMB_BEST_FIRST_H
#define UMB_BEST_FIRST_H

#include "culler_state.h"

/* Walk, with whatever tasks there are: what may be seen is in w->culler->found then, in no order. Everything must have
 * been reserved, and the method prepared. */
void umb_best_first_run(umb_walk *w);

#endif

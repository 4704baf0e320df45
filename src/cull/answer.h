/* From what a walk found to what a culler answers. */
#ifndef UMB_ANSWER_H
#define UMB_ANSWER_H

#include "culler_state.h"

/* Without occlusion: all that is in view. */
void umb_answer_in_view(umb_walk *w);
/* With a method that chooses its occluders first. UMB_ERROR_MEMORY: it found none. */
umb_result umb_answer_chosen(umb_walk *w);
/* Once what may be seen is found: whole objects, without what masks and candidates leave out, in order. */
void umb_answer_finish(umb_walk *w);

#endif

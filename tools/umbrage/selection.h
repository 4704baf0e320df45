/* --only and --without: lists of objects on the command line. */
#ifndef SELECTION_H
#define SELECTION_H

#include "setup.h"

/* What the scene's objects are to the command: bits by number, NULL where all are. */
struct selection {
    uint32_t *only;    /* candidates */
    uint32_t *without; /* left out of the world: they are in another layer than the view */
};

/* Read the lists, and put the objects into layers; before the scene is welded. Sets s->selection if there is any list. */
int selection_start(setup *s, const options *o);
/* Give the candidates to a culler. */
umb_result selection_restrict(const setup *s, umb_culler *culler);
void selection_free(selection *x);

/* The view of what is left. */
void selection_mask_view(const setup *s, umb_view *view);
/* True if the object may be reported. */
bool selection_asks(const setup *s, uint32_t object);
/* Make the model what is left, for the oracle. */
void selection_strip_model(setup *s);

#endif

/* Where a method that chooses first has its occluders from: the search over the index, or with UMB_COHERENCE_LEAVES the
 * list of the leaf that the viewer is in, as large as they look from where the viewer is. Which of them it can use is left
 * to the method. */
#ifndef UMB_CHOOSER_H
#define UMB_CHOOSER_H

#include "leaf_lists.h"

/* Lists are three times as long as what is wanted, and within these: of what looks large about a third is in view. */
enum { UMB_CHOOSER_LEAST = 192, UMB_CHOOSER_MOST = 768 };

typedef struct umb_chooser {
    umb_selector selector;
    umb_leaf_lists lists;
    const umb_choice *choice;
    const umb_box_kernels *kernels;
    const umb_leaf_entry *list; /* NULL: the search goes on */
    uint64_t order[UMB_CHOOSER_MOST], room[UMB_CHOOSER_MOST]; /* scores and places in the list, sorted */
    const uint64_t *sorted;
    uint32_t count, at; /* of these */
} umb_chooser;

void umb_chooser_create(umb_chooser *c, const umb_allocator *a);
void umb_chooser_free(umb_chooser *c);

/* How many a frame is to have: what was asked for, or the method's usual number, at most so many. */
static inline uint32_t umb_chooser_budget(const umb_choice *choice, uint32_t usual, uint32_t most)
{
    uint32_t budget = choice->budget != 0 ? choice->budget : usual;
    return budget < most ? budget : most;
}

/* Begin to choose so many for a frame. */
umb_result umb_chooser_begin(umb_chooser *c, const umb_choice *choice, const umb_box_kernels *kernels, uint32_t wanted);
/* The next one; false when there is none. */
bool umb_chooser_next(umb_chooser *c, umb_pick *out);
/* True if memory ran out on the way. */
static inline bool umb_chooser_failed(const umb_chooser *c)
{
    return c->selector.failed;
}

/* Make all lists now that frames to come would make, if the choice has them (the view is not looked at). */
umb_result umb_chooser_prepare(umb_chooser *c, const umb_choice *choice, const umb_box_kernels *kernels, uint32_t wanted);

/* What may hide a thing that stands at a place from the viewer: the best first. */
const umb_leaf_entry *umb_chooser_near(umb_chooser *c, const double place[3], uint32_t *count);
/* True if an occluder is one of this frame's: of the layers in view, and standing where the scene says. */
bool umb_chooser_takes(const umb_chooser *c, uint32_t occluder);
/* An entry as a pick. */
umb_pick umb_chooser_pick(const umb_chooser *c, const umb_leaf_entry *e);

#endif

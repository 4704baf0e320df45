/* Blockers that are made while the walk runs, each once a frame: of occluders near what is asked about (Coorg and Teller
 * 1997, 5: detail objects). */
#ifndef UMB_NEAR_BLOCKERS_H
#define UMB_NEAR_BLOCKERS_H

#include "blocker_set.h"
#include "chooser.h"

enum { UMB_NEAR_BLOCKERS_MOST = 256 };

typedef struct umb_near_blockers {
    uint64_t *keys;    /* open table; 0: empty */
    uint32_t *numbers; /* beside them: of a blocker, or UMB_NONE: it hides nothing */
    uint32_t size, used;
    uint32_t chosen;   /* blockers below this one were there before the walk */
    size_t key_capacity, number_capacity;
} umb_near_blockers;

/* A new frame, whose blockers have been chosen; there is room for UMB_NEAR_BLOCKERS_MOST more. False without memory. */
bool umb_near_blockers_begin(umb_near_blockers *n, const umb_allocator *a, const umb_blockers *b);
void umb_near_blockers_free(umb_near_blockers *n, const umb_allocator *a);

/* The blocker of an entry, made now if it was not; UMB_NONE: it hides nothing, or there is no room, or it is one of the
 * chosen ones, which have been asked. */
uint32_t umb_near_blockers_get(umb_near_blockers *n, umb_blockers *b, const umb_chooser *c, const umb_leaf_entry *e);

#endif

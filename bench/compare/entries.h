/* Who takes part: the rivals, and the library in its configurations. To compare one more configuration,
 * add a line to the table in entries.c. */
#ifndef ENTRIES_H
#define ENTRIES_H

#include "world.h"

/* Why a contestant is in a contest. */
enum {
    ENTRY_STILL = 1,  /* views that have nothing to do with one another */
    ENTRY_MOTION = 2, /* frames in sequence */
    ENTRY_SCENE = 4   /* real scenes */
};

typedef struct entry {
    const char *name;
    const char *about; /* what it promises: "strict", "samples", "frustum" */
    bool ours;         /* hiding what can be seen is a defect */
    bool standard;     /* the one that all others are put in relation to */
    void *self;
    /* A whole frame: ids of the objects reported. UINT32_MAX: it failed. */
    uint32_t (*frame)(void *self, const umb_view *view, const uint32_t **objects);
    void (*destroy)(void *self);
    double apart_ms;   /* work outside the frame, once for every change of the scene */
    const char *apart; /* what that is; NULL: none */
} entry;

enum { ENTRIES_MOST = 32 };

/* All contestants of one kind of contest. Returns how many; 0: no memory. */
uint32_t entries_make(const world *w, uint32_t why, entry out[ENTRIES_MOST]);
void entries_free(entry *entries, uint32_t count);

#endif

/* Exact decisions about a whole object: is every point of it covered from sight? (cover.c) */
#ifndef COVER_H
#define COVER_H

#include "oracle.h"

typedef enum cover_verdict {
    COVER_OPEN,   /* undecided: too much work, or something left that no double can name */
    COVER_HIDDEN, /* no sight-line to any point of the object is free, exactly */
    COVER_SEEN    /* out holds a confirmed sight-line */
} cover_verdict;

/* How many blockers are looked at, over all of an object's triangles, before it is given up. */
#define COVER_ACCUSED 100000u
#define COVER_ASKED                                                                                \
    500u /* for objects that nothing speaks against; also, the first open triangle ends it */

/* For one renderer (TRUTH_*). */
cover_verdict oracle_cover(const truth *t, const oracle_view *v, uint32_t object, uint8_t renderer,
                           uint32_t effort, truth_witness *out);

#endif

/* Objects that move by themselves, as last committed: what a culler needs to know of their volumes. */
#ifndef UMB_MOTION_H
#define UMB_MOTION_H

#include "mesh.h"
#include "umbrage/motion.h"

/* An entry of the queue of expiries: a binary heap, the first to expire at its root. */
typedef struct umb_expiry {
    double until;
    uint32_t mover;
} umb_expiry;

typedef struct umb_motion {
    umb_pose_source source;
    const uint32_t *objects;     /* per mover; UMB_NONE where the number is not in use */
    const umb_expiry *expiries;  /* of those whose volume ever expires */
    const uint32_t *exact;       /* those that were seen of late: not a volume, but where they are at `time` is known */
    uint32_t number_count;       /* every mover's number is below */
    uint32_t count, expiry_count, exact_count, fuzzy;
    double time; /* volumes hold from here on, each until it expires. INFINITY: a commit failed, none is to be trusted */
} umb_motion;

/* Call meet for each mover whose volume has expired before a time: work proportional to their number. */
void umb_motion_expired(const umb_motion *motion, double time, void (*meet)(void *user, uint32_t mover), void *user);

/* Ask for a pose; false: nothing is known. */
bool umb_motion_ask(const umb_pose_source *source, uint32_t object, double time, umb_pose *out);

/* What a culler was told of a mover, and what became of it. Of an exact one it need not be told. */
typedef struct umb_posed {
    uint32_t mover, object;
    double time;
    umb_pose pose;
    umb_aabb bounds, block_bounds; /* of the object and of what it hides with, at that pose */
    bool known;             /* else the rest is of no use: nobody could say where it is */
    bool identity, mirrored;
    bool expired;           /* it was asked for because its volume had expired */
    bool shown;             /* it was reported */
    uint32_t frame;         /* the culler's frame in which it was last met */
} umb_posed;

#endif

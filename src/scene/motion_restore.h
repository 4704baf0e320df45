/* Movers of a scene that is read from a capture. */
#ifndef UMB_MOTION_RESTORE_H
#define UMB_MOTION_RESTORE_H

#include "scene.h"

typedef struct umb_stored_mover {
    uint32_t object;
    bool exact, fuzzy;
} umb_stored_mover;

/* Movers are numbered as they are listed. */
typedef struct umb_stored_motion {
    const umb_stored_mover *movers;
    const umb_expiry *expiries; /* as umb_motion.expiries */
    const uint32_t *exact;      /* ascending */
    uint32_t mover_count, expiry_count, exact_count;
    double time;                /* the scene's */
    umb_pose_source source;
} umb_stored_motion;

/* Let objects of a scene that has never been committed move by themselves, from the volumes that are their bounds, and
 * commit. UMB_ERROR_ARGUMENT: the lists contradict themselves or the scene. */
umb_result umb_motion_restore(umb_scene *scene, const umb_stored_motion *stored);

#endif

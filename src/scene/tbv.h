/* Temporal bounding volumes (Sudarsky and Gotsman; Gummerus 3.8): boxes that hold a moving object for a while. */
#ifndef UMB_TBV_H
#define UMB_TBV_H

#include "motion.h"

/* What is known of an object at one time. */
typedef struct umb_tbv_start {
    const umb_aabb *local; /* of its shape, in the shape's coordinates; NULL: bounds are all that is known */
    const umb_pose *pose;
    const umb_aabb *bounds; /* in the world, at the pose */
} umb_tbv_start;

/* A box that holds the object from its pose's time on for so many seconds, if the promise of def is kept: everything
 * drawn for it, as the floats that transforms close to the exact motion yield. docs/conservative.md has the proof. */
umb_aabb umb_tbv_swept(const umb_motion_def *def, const umb_tbv_start *start, double seconds);

#endif

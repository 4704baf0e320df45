/* --moving: a share of the objects goes round and round by itself, while the rows of a path are looked at. */
#ifndef MOVING_H
#define MOVING_H

#include "setup.h"

/* What moves, and how. It is what the scene's callback is given. */
struct moving {
    const model *model;
    umb_transform *rest; /* of all objects, at time 0 */
    bool *moves;
    double share, speed; /* of the objects; in units a second */
    int axes[2];         /* of the plane that they move in: across the way up */
};

/* Choose what moves, by numbers alone, and give the scene its motions; with weld, join the rest. Sets s->moving. */
int moving_start(setup *s, const options *o, bool weld);
void moving_free(moving *m);

/* Tell the scene the time of a view, as each frame of a program does. */
umb_result moving_advance(const setup *s, const umb_view *view);
/* Make the model what the scene is at a time, for the oracle. */
void moving_pose_model(setup *s, double time);

#endif

/* A town of which some objects move by themselves, by every kind of promise, and what is needed to know better: each
 * one's true pose at any time, a scene in which they are moved there, and a model of that for the oracle. */
#ifndef MOVING_TOWN_H
#define MOVING_TOWN_H

#include "io/model.h"

typedef struct moving_town {
    model *model, *posed;  /* as loaded; as it is at some time */
    camera_path path;
    umb_motion_def *motions;
    bool *moves;
    double (*pivots)[3];   /* in the mesh's coordinates: the middle of its box */
} moving_town;

/* From a generator's spec. Every third object stands still. */
void moving_town_make(moving_town *t, const char *spec);
void moving_town_free(moving_town *t);

/* umb_pose_source.pose; user is the town. */
bool moving_town_pose(void *user, uint32_t object, double time, umb_pose *out);
umb_aabb moving_town_bounds(const moving_town *t, uint32_t object, double time);
/* Make posed what the town is at a time. */
void moving_town_pose_model(moving_town *t, double time);

/* A committed scene; its objects have their motions if moving, else they are where they are at time 0. */
umb_scene *moving_town_scene(const moving_town *t, const umb_allocator *allocator, bool moving);
/* Set all motions of a scene, without a commit. */
umb_result moving_town_start(const moving_town *t, umb_scene *scene);
/* Move all of a scene without motions to where they are, and commit. */
void moving_town_move_all(const moving_town *t, umb_scene *scene, double time);

/* A view of a walk that goes on from frame to frame. */
umb_view moving_town_view(const moving_town *t, uint32_t frame, double time);

#endif

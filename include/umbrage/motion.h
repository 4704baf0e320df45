/* Objects that move by themselves, and what it takes to leave the hidden ones alone: temporal bounding volumes
 * (Sudarsky and Gotsman; Gummerus 3.8; Batagelo and Wu 3).
 *
 * An object is given a motion: a promise of how fast it is, or of a volume that it never leaves. The scene then keeps,
 * in place of its bounds, a volume that holds it until an expiry. As long as that volume is hidden or out of view, the
 * object costs nothing, and where it is nobody asks. Its pose is asked for, through one callback,
 *
 *   by umb_cull, when its volume is seen, or no longer holds it at the view's time: it is then tested with its true
 *     bounds, in the same frame, and hides what is behind it where it truly is. A volume never hides anything
 *   by umb_scene_commit, when its volume has expired by the scene's time: it gets a new one; and while it is in sight
 *
 *     umb_scene_set_poses(scene, &(umb_pose_source){where_is, world});
 *     umb_scene_set_motion(scene, id, &(umb_motion_def){.max_speed = 3});
 *     for (;;) {
 *         umb_scene_set_time(scene, now);
 *         umb_scene_commit(scene);
 *         view.time = now;
 *         umb_cull(culler, &view, &seen);
 *     }
 *
 * How long a volume holds is adapted to each object: one that expires unseen is followed by one for twice as long; one
 * that is seen while its object is hidden, at once by one for half as long, and so is one that is hidden, but so large that culls
 * come upon it again and again. An object that was itself reported since the last
 * commit (or before it, if no view has been answered since) is put where it is by each commit, as if it were moved by
 * hand, until it no longer is.
 */
#ifndef UMBRAGE_MOTION_H
#define UMBRAGE_MOTION_H

#include "scene.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Where an object is at some time, and where it is going. */
typedef struct umb_pose {
    umb_transform transform; /* of its shape; all zero: the identity. Each number is the exact one rounded to float */
    umb_aabb bounds;         /* all zero: the shape's own. An object without a shape needs them */
    /* How its pivot moves and how it turns about it from now on, in units and radians a second (spin: along the axis,
       right-handed). The motion's max_speed, max_acceleration and max_spin are deviations from this. Zero: unknown. */
    double velocity[3], spin[3];
    double holds; /* seconds that velocity and spin, with those deviations, hold for; 0: always */
} umb_pose;

/* Tells poses. pose: fill in *out, which is zeroed before, for an object at a time in seconds. It must be a pure
 * function of object and time, and callable from several threads at once (each culler calls it from its walk, a commit
 * from the committing thread); it must call nothing of the scene. False, or a pose that the rules of
 * umb_scene_move_object() refuse: nothing is known, the object is reported as visible and hides nothing. */
typedef struct umb_pose_source {
    bool (*pose)(void *user, uint32_t object, double time, umb_pose *out);
    void *user;
} umb_pose_source;

typedef enum umb_motion_kind {
    UMB_MOTION_SPEED = 0, /* its volume grows from where it was last known to be, by what is said of its speed */
    /* It never leaves def.volume: a door, a lift, a train on its rails. That never expires. If something is promised of its
       speed or spin too, volumes as above take its place while it is seen and the object is not. */
    UMB_MOTION_VOLUME = 1
} umb_motion_kind;

/* What is promised of an object, whatever happens to it until its motion is set anew. */
typedef struct umb_motion_def {
    umb_motion_kind kind;
    /* UMB_MOTION_SPEED: the object moves as a whole, and may turn about a pivot. The pivot is, s seconds after a pose,
       within max_speed s + max_acceleration s^2 / 2 of where that pose's velocity takes it; the object is turned by
       at most max_spin s radians away from where its spin takes it. All of them 0 or more; INFINITY: unknown (a
       sphere around the pivot then holds it however it turns). What changes its form keeps to bounds about the pivot
       if max_speed is that of its fastest point and max_spin is 0. UMB_MOTION_VOLUME: all of them 0: unknown. */
    double max_speed, max_acceleration, max_spin;
    double pivot[3];  /* in the shape's coordinates */
    umb_aabb volume;  /* VOLUME: the volume. SPEED: a volume that it does not leave either; all zero: none */
    double first_period; /* seconds that the first volume holds for; 0: 1 */
    double least_period, most_period; /* bounds of the adapted ones; 0: 0.125 and 64 */
    /* The promise is likely, not certain (a fuzzy volume). While the scene has such an object, answers are of class
       approximate: an object that has left its volume may be hidden until it is asked for. */
    bool fuzzy;
} umb_motion_def;

/* Where poses come from; copied. At once: no cull may be going on. Needed before the first motion. */
UMB_API umb_result umb_scene_set_poses(umb_scene *scene, const umb_pose_source *source);

/* Let an object move by itself from the next commit on, or change how; def is copied. NULL: it stands still from then
 * on, at its pose at the scene's time. Such an object cannot be moved by umb_scene_move_object() (UMB_ERROR_STATE);
 * umb_scene_object_bounds() gives its volume. Dissolves welds as moving does; welding leaves it out. Errors:
 * UMB_ERROR_ARGUMENT for negative or NaN numbers, a volume that is no box; UMB_ERROR_STATE without a source of poses. */
UMB_API umb_result umb_scene_set_motion(umb_scene *scene, uint32_t object, const umb_motion_def *def);

/* The time, in seconds, from the next commit on; finite. Volumes that have expired by then are renewed by it: its work
 * is proportional to their number. A view may be of any time (umb_view.time): what its volume does not hold at that time
 * is asked for by the cull. So views at or shortly after the scene's time are cheap; for a view before it, every moving
 * object is asked for. A time before the last one renews every volume. */
UMB_API umb_result umb_scene_set_time(umb_scene *scene, double seconds);

/* What the last commit did for moving objects, and how many there are. */
typedef struct umb_motion_stats {
    uint32_t movers;   /* objects that move by themselves */
    uint32_t fuzzy;    /* of them, those whose promise is not certain */
    uint32_t exact;    /* of them, those that are put where they are, because they were reported */
    uint32_t renewed;  /* volumes made by the last commit */
    uint32_t expired;  /* of these: because the one before had expired */
    uint32_t revealed; /* of these: because the one before was seen and its object was not */
    uint32_t costly;   /* of these: because the one before was hidden and often tested */
    uint32_t asked;    /* poses that the last commit asked for */
    double period;     /* mean of the periods of all volumes that expire, in seconds */
} umb_motion_stats;

UMB_API void umb_scene_get_motion_stats(const umb_scene *scene, umb_motion_stats *out);

#ifdef __cplusplus
}
#endif
#endif

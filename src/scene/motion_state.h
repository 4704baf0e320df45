/* What a scene knows of its objects that move by themselves, for the files of this room alone. */
#ifndef UMB_MOTION_STATE_H
#define UMB_MOTION_STATE_H

#include <stdatomic.h>

#include "expiries.h"
#include "ids.h"
#include "scene.h"

struct umb_object_slot;

/* What is known of an object that moves by itself: what every commit looks at, */
typedef struct umb_mover_slot {
    double known_at; /* when its pose was known; its volume grows from there */
    double period;   /* that its volume was made to hold for */
    uint64_t shown;  /* the last commit that heard of its being reported */
    uint8_t why;     /* UMB_DUE_*: it is in the list of those that are due, for these reasons; 0: it is not */
    uint8_t tested;  /* how often a culler said so of its volume since it was made */
    uint8_t vain;    /* how often on end that made a smaller one, and it did not help */
    bool placed;     /* its pose is known */
    bool seen;       /* its volume was seen since it was made */
    bool exact;      /* its volume is where it is at the scene's time, no more */
} umb_mover_slot;

/* and what is looked at when a volume is made. */
typedef struct umb_mover_promise {
    umb_motion_def def;
    umb_pose known; /* of an exact one: out of date */
} umb_mover_promise;

enum {
    UMB_DUE_FRESH = 1u << 0,    /* its motion is new */
    UMB_DUE_EXPIRED = 1u << 1,  /* its volume no longer holds */
    UMB_DUE_REVEALED = 1u << 2, /* its volume was seen and it was not */
    UMB_DUE_STOP = 1u << 3,     /* it is to stand still, or was removed */
    UMB_DUE_SHOWN = 1u << 4,    /* it was reported lately, or before that */
    UMB_DUE_COSTLY = 1u << 5    /* its volume was hidden, but walks came upon it often */
};

/* The movers of a scene. */
typedef struct umb_movers_state {
    umb_pose_source source;
    umb_ids ids;
    umb_mover_slot *slots;
    umb_mover_promise *promises;
    uint32_t *objects;  /* of each; UMB_NONE where the number is not in use */
    uint32_t *due;      /* whose volumes are to be made anew, each once; room for all */
    uint32_t *exact, *next_exact; /* as committed, and from the next commit on */
    umb_expiries expiries;
    size_t slot_capacity, promise_capacity, object_capacity, due_capacity, exact_capacity, next_exact_capacity;
    uint32_t due_count, exact_count, next_exact_count, count, fuzzy;
    double time;        /* from the next commit on */
    double made_at;     /* the time at the last commit, though it failed */
    uint64_t commit;    /* its number */
    uint32_t blind;     /* commits on end, this one included, before which no culler has answered anything */
    umb_motion_stats stats;
    umb_scene_witness *witnesses;
    atomic_flag witness_lock;
} umb_movers_state;

/* The first steps of a commit for what moves by itself: moves objects, as umb_scene_move_object() does, to
 * volumes made anew, and cannot fail. Until umb_motion_committed() has been called, volumes are not to be trusted. */
void umb_motion_commit(umb_scene *scene);
void umb_motion_committed(umb_scene *scene);
/* True if where the object is at the scene's time is known, though it moves. */
bool umb_motion_is_exact(const umb_scene *scene, const struct umb_object_slot *slot);
/* The origin has moved: everybody is to be asked anew. */
void umb_motion_shift(umb_scene *scene, const double shift[3]);
/* The object of a slot has another shape, whose bounds where the object was last known to be are these; NULL: it has none. */
void umb_motion_reshape(umb_scene *scene, struct umb_object_slot *slot, const umb_aabb *bounds);
/* The object of a slot is removed. */
void umb_motion_remove(umb_scene *scene, const struct umb_object_slot *slot);
void umb_motion_free(umb_scene *scene);
size_t umb_motion_memory(const umb_scene *scene);

/* motion.c. Put a mover into the list of those that are due, for a reason more. */
void umb_motion_make_due(umb_movers_state *m, uint32_t mover, uint8_t why);
/* What readers see moved with the arrays. */
void umb_motion_publish_arrays(umb_scene *scene);

/* motion_volume.c. Make the volume of a mover that is due, or what there is in its place. */
void umb_motion_make_volume(umb_scene *scene, uint32_t mover);
/* Let it stand where it is now. Its number stays in use until readers no longer know it. */
void umb_motion_stop(umb_scene *scene, uint32_t mover);
/* True if volumes can be made that are smaller than the one given. */
bool umb_motion_grows(const umb_motion_def *def);
/* True if it was seen of late, and is likely to be seen again: as long as it is, it is put where it is at each commit, like
 * anything that is moved, which costs less than to ask for it in the walk. Where nobody has looked since the last commit, what
 * was seen before counts, but not for long. */
bool umb_motion_is_shown(const umb_movers_state *m, const umb_mover_slot *mover);

/* witnesses.c. Hear all cullers. Their order decides nothing: the latest pose counts, and poses of one time are one. */
void umb_witnesses_listen(umb_scene *scene);

#endif

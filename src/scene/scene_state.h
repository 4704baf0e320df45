/* What a scene is made of, for the files of this room alone. Two states live side by side: the one
 * that calls change, and the one that readers see until the next commit. */
#ifndef UMB_SCENE_STATE_H
#define UMB_SCENE_STATE_H

#include <stdatomic.h>

#include "expiries.h"
#include "ids.h"
#include "placement.h"
#include "scene.h"

enum { UMB_SLOT_FREE = 0, UMB_SLOT_USED = 1, UMB_SLOT_REMOVED = 2 };

/* Where a shape stands: shared by objects and hand-made occluders. */
typedef struct umb_placement {
    umb_transform transform;
    double at[3];          /* its translation before it was rounded to floats */
    umb_aabb block_bounds; /* of the blocking world vertices; zero when there is none */
    umb_shape shape;
    bool identity, mirrored;
} umb_placement;

typedef struct umb_object_slot {
    umb_placement placement;
    umb_aabb bounds;
    uint32_t flags;
    uint32_t mask, tag;
    uint32_t weld; /* group it is welded into, or UMB_NONE */
    uint32_t mover; /* its number in movers, or UMB_NONE */
    uint8_t state;
    bool touched; /* is in the list of touched objects */
} umb_object_slot;

typedef struct umb_occluder_slot {
    umb_placement placement;
    uint32_t number; /* of the committed occluder; UMB_NONE: there is none */
    uint32_t mask;
    uint8_t state;
    bool open;    /* it hides nothing for now */
    bool touched; /* is in the list of touched occluders */
} umb_occluder_slot;

/* Objects joined into occluders of their own; one block of memory, meshes apart. */
typedef struct umb_weld_group {
    uint32_t *members; /* ascending */
    umb_mesh **meshes; /* in world coordinates */
    uint32_t *numbers; /* of the committed occluders, if committed */
    uint32_t member_count, mesh_count;
    uint32_t mask; /* of all members */
    bool committed;
    size_t bytes;                /* of this block */
    struct umb_weld_group *next; /* among the retired */
} umb_weld_group;

/* What a committed occluder is made of, beside the owner that it names itself. */
typedef struct umb_occluder_source {
    umb_weld_group *group; /* NULL: owned or hand-made */
    uint32_t index;        /* of the group's mesh, or the hand-made occluder */
    bool replaced;         /* its number is in the list */
} umb_occluder_source;

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

/* The movers of a scene; motion.c. */
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

struct umb_scene {
    umb_allocator allocator;
    umb_error *error;
    double origin[3];

    umb_mesh **shapes; /* shape number - 1 */
    size_t shape_capacity;
    uint32_t shape_count;

    umb_ids object_ids;
    umb_object_slot *objects;
    size_t object_capacity;

    umb_ids occluder_ids;
    umb_occluder_slot *occluders;
    size_t occluder_capacity;

    umb_weld_group **groups; /* NULL where dissolved */
    size_t group_capacity;
    uint32_t group_count;
    umb_weld_group *retired; /* dissolved, but the committed occluders may still use their meshes */

    /* Changed since the last commit, each once; there is always room for all. */
    uint32_t *touched, *touched_occluders;
    size_t touched_capacity, touched_occluder_capacity;
    uint32_t touched_count, touched_occluder_count;
    bool structure_changed, groups_changed;
    bool listeners_behind; /* one failed in the last commit */

    umb_committed committed;
    umb_object *committed_objects;
    umb_occluder *committed_occluders;
    uint32_t *committed_masks; /* of the occluders */
    umb_occluder_source *sources; /* of the committed occluders */
    uint32_t *committed_moved, *committed_came, *committed_went, *committed_replaced;
    size_t committed_object_capacity, committed_occluder_capacity, source_capacity;
    size_t committed_mask_capacity;
    size_t committed_moved_capacity, committed_came_capacity, committed_went_capacity, committed_replaced_capacity;
    umb_scene_listener *listeners;
    umb_movers_state moving;
};

/* The mesh of a shape, NULL for 0. */
const umb_mesh *umb_scene_mesh(const umb_scene *scene, umb_shape shape);

/* True if the object may hide at all, by its own shape or by a weld. */
bool umb_scene_object_hides(const umb_scene *scene, const umb_object_slot *slot);

/* Note that an object changed. */
void umb_scene_touch_object(umb_scene *scene, uint32_t object);

/* The committed occluders are numbered densely, owned ones first. Each call renumbers two others at most, and lists
 * the numbers that hold another occluder than before. Room has been made. occluders.c */
void umb_occluders_add_owned(umb_scene *scene, const umb_occluder *occluder);
void umb_occluders_add_free(umb_scene *scene, const umb_occluder *occluder, umb_weld_group *group, uint32_t index);
void umb_occluders_remove(umb_scene *scene, uint32_t number);
/* The same number, owned by the same object, is another occluder. */
void umb_occluders_change(umb_scene *scene, uint32_t number, const umb_occluder *occluder);

/* Note that a hand-made occluder changed: the commit takes it out and puts it in again. */
void umb_scene_renew_occluder(umb_scene *scene, uint32_t occluder);
/* Put a shape where it has been found to be. */
void umb_scene_place(umb_placement *p, const umb_transform *transform, const umb_outcome *seen);

/* motion.c. The first steps of a commit for what moves by itself: moves objects, as umb_scene_move_object() does, to
 * volumes made anew, and cannot fail. Until umb_motion_committed() has been called, volumes are not to be trusted. */
void umb_motion_commit(umb_scene *scene);
void umb_motion_committed(umb_scene *scene);
/* True if where the object is at the scene's time is known, though it moves. */
bool umb_motion_is_exact(const umb_scene *scene, const umb_object_slot *slot);
/* A box of a world whose origin moved, a little larger. */
umb_aabb umb_scene_shift_box(const umb_aabb *b, const double shift[3]);
/* The origin has moved: everybody is to be asked anew. */
void umb_motion_shift(umb_scene *scene, const double shift[3]);
/* The object of a slot has another shape, whose bounds where the object was last known to be are these; NULL: it has none. */
void umb_motion_reshape(umb_scene *scene, umb_object_slot *slot, const umb_aabb *bounds);
/* The object of a slot is removed. */
void umb_motion_remove(umb_scene *scene, const umb_object_slot *slot);
void umb_motion_free(umb_scene *scene);
size_t umb_motion_memory(const umb_scene *scene);

/* Let the members of a group hide by their own shapes again. */
void umb_weld_dissolve(umb_scene *scene, uint32_t group);
void umb_weld_group_free(const umb_allocator *allocator, umb_weld_group *group);
void umb_weld_free_retired(umb_scene *scene);

#endif

/* What a scene is made of, for the files of this room alone. Two states live side by side: the one
 * that calls change, and the one that readers see until the next commit. */
#ifndef UMB_SCENE_STATE_H
#define UMB_SCENE_STATE_H

#include "ids.h"
#include "motion_state.h"
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

/* A box of a world whose origin moved, a little larger. */
umb_aabb umb_scene_shift_box(const umb_aabb *b, const double shift[3]);

/* Let the members of a group hide by their own shapes again. */
void umb_weld_dissolve(umb_scene *scene, uint32_t group);
void umb_weld_group_free(const umb_allocator *allocator, umb_weld_group *group);
void umb_weld_free_retired(umb_scene *scene);

#endif

/* What a scene is made of, for the files of this room alone. Two states live side by side: the one
 * that calls change, and the one that readers see until the next commit. */
#ifndef UMB_SCENE_STATE_H
#define UMB_SCENE_STATE_H

#include "ids.h"
#include "scene.h"

enum { UMB_SLOT_FREE = 0, UMB_SLOT_USED = 1, UMB_SLOT_REMOVED = 2 };

/* Where a shape stands: shared by objects and hand-made occluders. */
typedef struct umb_placement {
    umb_transform transform;
    umb_aabb block_bounds; /* of the blocking world vertices; zero when there is none */
    umb_shape shape;
    bool identity, mirrored;
} umb_placement;

typedef struct umb_object_slot {
    umb_placement placement;
    umb_aabb bounds;
    uint32_t flags;
    uint32_t weld; /* group it is welded into, or UMB_NONE */
    uint8_t state;
    bool moved; /* is in the list of moved objects */
} umb_object_slot;

typedef struct umb_occluder_slot {
    umb_placement placement;
    uint8_t state;
} umb_occluder_slot;

/* Objects joined into occluders of their own; one block of memory, meshes apart. */
typedef struct umb_weld_group {
    uint32_t *members; /* ascending */
    umb_mesh **meshes; /* in world coordinates */
    uint32_t member_count, mesh_count;
    size_t bytes;                /* of this block */
    struct umb_weld_group *next; /* among the retired */
} umb_weld_group;

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

    uint32_t *moved; /* objects with new boxes since the last commit */
    size_t moved_capacity;
    uint32_t moved_count;
    bool structure_changed;
    bool listeners_behind; /* one failed in the last commit */

    umb_committed committed;
    umb_object *committed_objects;
    umb_occluder *committed_occluders;
    uint32_t *committed_moved;
    size_t committed_object_capacity, committed_occluder_capacity, committed_moved_capacity;
    umb_scene_listener *listeners;
};

/* The mesh of a shape, NULL for 0. */
const umb_mesh *umb_scene_mesh(const umb_scene *scene, umb_shape shape);

/* True if the object may hide at all, by its own shape or by a weld. */
bool umb_scene_object_hides(const umb_scene *scene, const umb_object_slot *slot);

/* Let the members of a group hide by their own shapes again. */
void umb_weld_dissolve(umb_scene *scene, uint32_t group);
void umb_weld_group_free(const umb_allocator *allocator, umb_weld_group *group);
void umb_weld_free_retired(umb_scene *scene);

#endif

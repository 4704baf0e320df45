/* Commits: the changed state becomes the one that readers see. */
#include "scene_state.h"

static bool owns_occluder(const umb_scene *scene, const umb_object_slot *slot)
{
    return slot->weld == UMB_NONE && umb_scene_object_hides(scene, slot);
}

static umb_occluder make_occluder(const umb_scene *scene, const umb_placement *p, uint32_t owner)
{
    umb_occluder o = {.mesh = umb_scene_mesh(scene, p->shape),
                      .transform = p->transform,
                      .bounds = p->block_bounds,
                      .owner = owner,
                      .identity = p->identity,
                      .mirrored = p->mirrored};
    return o;
}

static umb_occluder make_welded(const umb_mesh *mesh)
{
    umb_occluder o = {.mesh = mesh,
                      .transform = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}},
                      .bounds = mesh->block_bounds,
                      .owner = UMB_NONE,
                      .identity = true};
    return o;
}

static umb_object make_object(const umb_scene *scene, const umb_object_slot *slot, uint32_t occluder)
{
    umb_object o = {.occluder = occluder};
    if (slot->state == UMB_SLOT_USED) {
        o.bounds = slot->bounds;
        o.mesh = umb_scene_mesh(scene, slot->placement.shape);
        o.transform = slot->placement.transform;
        o.used = true;
        o.live = (slot->flags & UMB_OBJECT_IGNORED) == 0;
        o.identity = slot->placement.identity;
        o.refine = o.mesh != NULL && (slot->flags & UMB_OBJECT_IS_SHAPE) != 0;
    }
    return o;
}

static uint64_t count_occluders(const umb_scene *scene)
{
    uint64_t count = 0;
    for (uint32_t i = 0; i < scene->object_ids.used; ++i) {
        count += owns_occluder(scene, &scene->objects[i]) ? 1 : 0;
    }
    for (uint32_t i = 0; i < scene->group_count; ++i) {
        count += scene->groups[i] != NULL ? scene->groups[i]->mesh_count : 0;
    }
    for (uint32_t i = 0; i < scene->occluder_ids.used; ++i) {
        count += scene->occluders[i].state == UMB_SLOT_USED ? 1 : 0;
    }
    return count;
}

static void fill_objects(umb_scene *scene)
{
    umb_committed *c = &scene->committed;
    c->object_count = scene->object_ids.used;
    c->occluder_count = 0;
    for (uint32_t i = 0; i < c->object_count; ++i) {
        umb_object_slot *slot = &scene->objects[i];
        uint32_t occluder = UMB_NONE;
        if (owns_occluder(scene, slot)) {
            occluder = c->occluder_count++;
            scene->committed_occluders[occluder] = make_occluder(scene, &slot->placement, i);
        }
        scene->committed_objects[i] = make_object(scene, slot, occluder);
        slot->moved = false;
        if (slot->state == UMB_SLOT_REMOVED) {
            slot->state = UMB_SLOT_FREE;
        }
    }
    c->first_free_occluder = c->occluder_count;
}

static void fill_stand_alone(umb_scene *scene)
{
    umb_committed *c = &scene->committed;
    for (uint32_t i = 0; i < scene->group_count; ++i) {
        const umb_weld_group *g = scene->groups[i];
        for (uint32_t k = 0; g != NULL && k < g->mesh_count; ++k) {
            scene->committed_occluders[c->occluder_count++] = make_welded(g->meshes[k]);
        }
    }
    for (uint32_t i = 0; i < scene->occluder_ids.used; ++i) {
        umb_occluder_slot *slot = &scene->occluders[i];
        if (slot->state == UMB_SLOT_USED) {
            scene->committed_occluders[c->occluder_count++] = make_occluder(scene, &slot->placement,
                                                                            UMB_NONE);
        } else {
            slot->state = UMB_SLOT_FREE;
        }
    }
}

/* Write everything anew. Memory is made sure of first: after that nothing can fail, so readers
 * never see half a commit. */
static umb_result commit_structure(umb_scene *scene)
{
    uint64_t occluders = count_occluders(scene);
    if (occluders > (1u << 30)) {
        return umb_scene_fail(scene, UMB_ERROR_LIMIT, "more than 2^30 occluders");
    }
    if (!umb_memory_reserve(&scene->allocator, (void **)&scene->committed_objects,
                            &scene->committed_object_capacity, scene->object_ids.used,
                            sizeof *scene->committed_objects) ||
        !umb_memory_reserve(&scene->allocator, (void **)&scene->committed_occluders,
                            &scene->committed_occluder_capacity, (size_t)occluders,
                            sizeof *scene->committed_occluders) ||
        !umb_memory_reserve(&scene->allocator, (void **)&scene->committed_moved,
                            &scene->committed_moved_capacity, scene->object_ids.used,
                            sizeof *scene->committed_moved)) {
        /* Reserving may have moved an array: readers keep a valid one. */
        scene->committed.objects = scene->committed_objects;
        scene->committed.occluders = scene->committed_occluders;
        scene->committed.moved = scene->committed_moved;
        return umb_scene_fail(scene, UMB_ERROR_MEMORY, "out of memory for a commit");
    }
    fill_objects(scene);
    fill_stand_alone(scene);
    umb_ids_commit(&scene->object_ids);
    umb_ids_commit(&scene->occluder_ids);
    scene->committed.structure += 1;
    scene->committed.moved_count = 0;
    return UMB_OK;
}

/* Only what a move changes. The two lists of moved objects change places. */
static void commit_moved(umb_scene *scene)
{
    for (uint32_t i = 0; i < scene->moved_count; ++i) {
        umb_object_slot *slot = &scene->objects[scene->moved[i]];
        const umb_placement *p = &slot->placement;
        umb_object *object = &scene->committed_objects[scene->moved[i]];
        object->bounds = slot->bounds;
        object->transform = p->transform;
        object->identity = p->identity;
        if (object->occluder != UMB_NONE) {
            umb_occluder *occluder = &scene->committed_occluders[object->occluder];
            occluder->transform = p->transform;
            occluder->bounds = p->block_bounds;
            occluder->identity = p->identity;
            occluder->mirrored = p->mirrored;
        }
        slot->moved = false;
    }
    uint32_t *moved = scene->moved;
    size_t capacity = scene->moved_capacity;
    scene->moved = scene->committed_moved;
    scene->moved_capacity = scene->committed_moved_capacity;
    scene->committed_moved = moved;
    scene->committed_moved_capacity = capacity;
    scene->committed.moved_count = scene->moved_count;
}

umb_result umb_scene_commit(umb_scene *scene)
{
    bool changed = scene->structure_changed || scene->moved_count > 0;
    if (scene->structure_changed) {
        umb_result result = commit_structure(scene);
        if (result != UMB_OK) {
            return result;
        }
    } else if (changed) {
        commit_moved(scene);
    }
    scene->moved_count = 0;
    scene->structure_changed = false;
    scene->committed.objects = scene->committed_objects;
    scene->committed.occluders = scene->committed_occluders;
    scene->committed.moved = scene->committed_moved;
    scene->committed.version += changed ? 1 : 0;
    umb_weld_free_retired(scene);
    if (!changed && !scene->listeners_behind) {
        return UMB_OK;
    }
    umb_result result = UMB_OK;
    for (umb_scene_listener *l = scene->listeners; l != NULL; l = l->next) {
        umb_result r = l->update(l->user);
        result = result == UMB_OK ? r : result;
    }
    scene->listeners_behind = result != UMB_OK;
    return result;
}

const umb_committed *umb_scene_committed(const umb_scene *scene)
{
    return &scene->committed;
}

void umb_scene_listen(umb_scene *scene, umb_scene_listener *listener)
{
    listener->next = scene->listeners;
    scene->listeners = listener;
}

void umb_scene_unlisten(umb_scene *scene, umb_scene_listener *listener)
{
    for (umb_scene_listener **l = &scene->listeners; *l != NULL; l = &(*l)->next) {
        if (*l == listener) {
            *l = listener->next;
            return;
        }
    }
}

bool umb_scene_object_bounds(const umb_scene *scene, uint32_t object, umb_aabb *out)
{
    const umb_committed *c = &scene->committed;
    if (object >= c->object_count || !c->objects[object].used) {
        return false;
    }
    *out = c->objects[object].bounds;
    return true;
}

uint32_t umb_scene_occluder_count(const umb_scene *scene)
{
    return scene->committed.occluder_count;
}

bool umb_scene_bounds(const umb_scene *scene, umb_aabb *out)
{
    const umb_committed *c = &scene->committed;
    bool any = false;
    for (uint32_t i = 0; i < c->object_count; ++i) {
        const umb_object *o = &c->objects[i];
        if (!o->live) {
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            out->min[k] = !any || o->bounds.min[k] < out->min[k] ? o->bounds.min[k] : out->min[k];
            out->max[k] = !any || o->bounds.max[k] > out->max[k] ? o->bounds.max[k] : out->max[k];
        }
        any = true;
    }
    return any;
}

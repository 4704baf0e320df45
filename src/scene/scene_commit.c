/* Commits: the changed state becomes the one that readers see. */
#include "scene_state.h"

#define MOST_OCCLUDERS (1u << 30)

static bool owns_occluder(const umb_scene *scene, const umb_object_slot *slot)
{
    return slot->weld == UMB_NONE && umb_scene_object_hides(scene, slot);
}

static bool moves(const umb_scene *scene, const umb_object_slot *slot)
{
    return slot->mover != UMB_NONE && !umb_motion_is_exact(scene, slot);
}

static umb_occluder make_occluder(const umb_scene *scene, const umb_placement *p, uint32_t owner)
{
    umb_occluder o = {.mesh = umb_scene_mesh(scene, p->shape),
                      .transform = p->transform,
                      .bounds = p->block_bounds,
                      .owner = owner,
                      .identity = p->identity,
                      .mirrored = p->mirrored};
    o.moves = owner != UMB_NONE && moves(scene, &scene->objects[owner]);
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

/* A transform that scales and moves along the axes alone rounds equal coordinates alike: the corners of a box are the
 * corners of the box of its world vertices. */
static bool is_box(const umb_object *o, const umb_placement *p)
{
    const float (*m)[4] = p->transform.m;
    bool along = o->identity || (m[0][1] == 0.0f && m[0][2] == 0.0f && m[1][0] == 0.0f &&
                                 m[1][2] == 0.0f && m[2][0] == 0.0f && m[2][1] == 0.0f);
    for (int i = 0; i < 3; ++i) {
        along = along && o->bounds.min[i] == p->block_bounds.min[i] && o->bounds.max[i] == p->block_bounds.max[i];
    }
    return o->boxed && (o->mover == UMB_NONE || o->exact) && along;
}

static umb_object make_object(const umb_scene *scene, const umb_object_slot *slot, uint32_t occluder)
{
    umb_object o = {.occluder = occluder, .mover = UMB_NONE};
    if (slot->state == UMB_SLOT_USED) {
        o.bounds = slot->bounds;
        o.mesh = umb_scene_mesh(scene, slot->placement.shape);
        o.transform = slot->placement.transform;
        o.mask = slot->mask;
        o.used = true;
        o.mover = slot->mover;
        o.exact = umb_motion_is_exact(scene, slot);
        o.live = (slot->flags & UMB_OBJECT_IGNORED) == 0;
        o.identity = slot->placement.identity;
        o.refine = o.mesh != NULL && (slot->flags & UMB_OBJECT_IS_SHAPE) != 0;
        o.body = o.refine && o.mesh->convex && o.mesh->seen_count == o.mesh->triangle_count;
        o.boxed = o.body && o.mesh->box;
        o.box = is_box(&o, &slot->placement);
    }
    return o;
}

/* ---- memory --------------------------------------------------------------------------------- */

/* How many occluders a commit may add. */
static uint64_t count_new_occluders(const umb_scene *scene)
{
    uint64_t count = (uint64_t)scene->touched_count + scene->touched_occluder_count;
    for (uint32_t i = 0; scene->groups_changed && i < scene->group_count; ++i) {
        const umb_weld_group *g = scene->groups[i];
        count += g != NULL && !g->committed ? g->mesh_count : 0;
    }
    return count;
}

static bool reserve(umb_scene *scene, size_t occluders)
{
    const umb_allocator *a = &scene->allocator;
    size_t objects = scene->object_ids.used;
    return umb_memory_reserve(a, (void **)&scene->committed_objects, &scene->committed_object_capacity, objects,
                              sizeof *scene->committed_objects) &&
           umb_memory_reserve(a, (void **)&scene->committed_occluders, &scene->committed_occluder_capacity, occluders,
                              sizeof *scene->committed_occluders) &&
           umb_memory_reserve(a, (void **)&scene->committed_masks, &scene->committed_mask_capacity, occluders,
                              sizeof *scene->committed_masks) &&
           umb_memory_reserve_zero(a, (void **)&scene->sources, &scene->source_capacity, occluders, sizeof *scene->sources) &&
           umb_memory_reserve(a, (void **)&scene->committed_replaced, &scene->committed_replaced_capacity, occluders,
                              sizeof *scene->committed_replaced) &&
           umb_memory_reserve(a, (void **)&scene->committed_moved, &scene->committed_moved_capacity, objects,
                              sizeof *scene->committed_moved) &&
           umb_memory_reserve(a, (void **)&scene->committed_came, &scene->committed_came_capacity, scene->touched_count,
                              sizeof *scene->committed_came) &&
           umb_memory_reserve(a, (void **)&scene->committed_went, &scene->committed_went_capacity, scene->touched_count,
                              sizeof *scene->committed_went);
}

/* Where readers find the arrays. */
static void show(umb_scene *scene)
{
    umb_committed *c = &scene->committed;
    c->objects = scene->committed_objects;
    c->occluders = scene->committed_occluders;
    c->occluder_masks = scene->committed_masks;
    c->moved = scene->committed_moved;
    c->came = scene->committed_came;
    c->went = scene->committed_went;
    c->replaced = scene->committed_replaced;
}

/* ---- changes -------------------------------------------------------------------------------- */

static void forget_replaced(umb_scene *scene)
{
    umb_committed *c = &scene->committed;
    for (uint32_t i = 0; i < c->replaced_count; ++i) {
        scene->sources[scene->committed_replaced[i]].replaced = false;
    }
    c->replaced_count = c->came_count = c->went_count = 0;
}

/* Numbers of objects that the readers have not seen yet. */
static void extend_objects(umb_scene *scene)
{
    umb_committed *c = &scene->committed;
    for (; c->object_count < scene->object_ids.used; ++c->object_count) {
        scene->committed_objects[c->object_count] = (umb_object){.occluder = UMB_NONE};
    }
}

static void remove_occluders(umb_scene *scene)
{
    for (uint32_t i = 0; i < scene->touched_count; ++i) {
        uint32_t id = scene->touched[i], occluder = scene->committed_objects[id].occluder;
        if (occluder != UMB_NONE && !owns_occluder(scene, &scene->objects[id])) {
            umb_occluders_remove(scene, occluder);
        }
    }
    for (const umb_weld_group *g = scene->retired; g != NULL; g = g->next) {
        for (uint32_t k = 0; g->committed && k < g->mesh_count; ++k) {
            umb_occluders_remove(scene, g->numbers[k]);
        }
    }
    for (uint32_t i = 0; i < scene->touched_occluder_count; ++i) {
        umb_occluder_slot *slot = &scene->occluders[scene->touched_occluders[i]];
        if (slot->number != UMB_NONE) { /* it may come back below */
            umb_occluders_remove(scene, slot->number);
        }
        slot->state = slot->state == UMB_SLOT_USED ? UMB_SLOT_USED : UMB_SLOT_FREE;
    }
}

static void add_stand_alone(umb_scene *scene)
{
    for (uint32_t i = 0; scene->groups_changed && i < scene->group_count; ++i) {
        umb_weld_group *g = scene->groups[i];
        for (uint32_t k = 0; g != NULL && !g->committed && k < g->mesh_count; ++k) {
            umb_occluder welded = make_welded(g->meshes[k]);
            umb_occluders_add_free(scene, &welded, g, k);
        }
        if (g != NULL) {
            g->committed = true;
        }
    }
    for (uint32_t i = 0; i < scene->touched_occluder_count; ++i) {
        uint32_t id = scene->touched_occluders[i];
        umb_occluder_slot *slot = &scene->occluders[id];
        if (slot->state == UMB_SLOT_USED && !slot->open) {
            umb_occluder made = make_occluder(scene, &slot->placement, UMB_NONE);
            umb_occluders_add_free(scene, &made, NULL, id);
        }
        slot->touched = false;
    }
    scene->touched_occluder_count = 0;
    scene->groups_changed = false;
}

/* Write a touched object anew, and the occluder that it owns; note whether it came, went or stayed. */
static void commit_object(umb_scene *scene, uint32_t id)
{
    umb_committed *c = &scene->committed;
    umb_object_slot *slot = &scene->objects[id];
    bool was_live = scene->committed_objects[id].live;
    uint32_t was_in = scene->committed_objects[id].mask;
    uint32_t occluder = scene->committed_objects[id].occluder;
    scene->committed_objects[id] = make_object(scene, slot, occluder);
    if (owns_occluder(scene, slot)) {
        umb_occluder owned = make_occluder(scene, &slot->placement, id);
        if (occluder == UMB_NONE) {
            umb_occluders_add_owned(scene, &owned);
        } else {
            umb_occluders_change(scene, occluder, &owned);
        }
    }
    bool live = scene->committed_objects[id].live;
    c->masked = c->masked || slot->mask != 0;
    if (live && was_live) {
        scene->committed_moved[c->moved_count++] = id;
        scene->committed_objects[id].remasked = was_in != slot->mask;
        c->remasked_count += was_in != slot->mask;
    } else if (live) {
        scene->committed_came[c->came_count++] = id;
    } else if (was_live) {
        scene->committed_went[c->went_count++] = id;
    }
    slot->touched = false;
    slot->state = slot->state == UMB_SLOT_REMOVED ? UMB_SLOT_FREE : slot->state;
}

/* What has been touched is written anew, nothing else is looked at. Memory is made sure of first: after that nothing
 * can fail, so readers never see half a commit. */
static umb_result commit_structure(umb_scene *scene)
{
    uint64_t occluders = scene->committed.occluder_count + count_new_occluders(scene);
    bool ready = occluders <= MOST_OCCLUDERS && reserve(scene, (size_t)occluders);
    show(scene); /* reserving may have moved an array: readers keep a valid one */
    if (occluders > MOST_OCCLUDERS) {
        return umb_scene_fail(scene, UMB_ERROR_LIMIT, "more than 2^30 occluders");
    }
    if (!ready) {
        return umb_scene_fail(scene, UMB_ERROR_MEMORY, "out of memory for a commit");
    }
    forget_replaced(scene);
    extend_objects(scene);
    remove_occluders(scene);
    scene->committed.moved_count = scene->committed.remasked_count = 0;
    for (uint32_t i = 0; i < scene->touched_count; ++i) {
        commit_object(scene, scene->touched[i]);
    }
    add_stand_alone(scene);
    umb_ids_commit(&scene->object_ids);
    umb_ids_commit(&scene->occluder_ids);
    scene->committed.structure += 1;
    return UMB_OK;
}

/* How many moves ahead memory is asked for; of so few objects all is in the caches. */
#define AHEAD 8
#define IN_CACHES 8192u

/* Inline: GCC finds that the function has no effect, and drops calls to it. */
static inline __attribute__((always_inline)) void fetch(const umb_scene *scene, uint32_t i)
{
    if (i + 2 * AHEAD < scene->touched_count) {
        uint32_t id = scene->touched[i + 2 * AHEAD];
        const char *slot = (const char *)&scene->objects[id];
        const umb_object *object = &scene->committed_objects[id];
        __builtin_prefetch(slot, 1);
        __builtin_prefetch(slot + 64, 1);
        __builtin_prefetch(slot + sizeof(umb_object_slot) - 1, 1);
        __builtin_prefetch(object, 1);
        __builtin_prefetch((const char *)(object + 1) - 1, 1);
    }
    if (i + AHEAD < scene->touched_count) {
        uint32_t occluder = scene->committed_objects[scene->touched[i + AHEAD]].occluder;
        if (occluder != UMB_NONE) {
            const umb_occluder *o = &scene->committed_occluders[occluder];
            __builtin_prefetch(o, 1);
            __builtin_prefetch((const char *)(o + 1) - 1, 1);
        }
    }
}

/* Only what a move changes. */
static void commit_moved(umb_scene *scene)
{
    uint32_t count = 0;
    scene->committed.remasked_count = 0;
    bool large = scene->object_ids.used > IN_CACHES;
    for (uint32_t i = 0; i < scene->touched_count; ++i) {
        if (large) {
            fetch(scene, i);
        }
        umb_object_slot *slot = &scene->objects[scene->touched[i]];
        const umb_placement *p = &slot->placement;
        umb_object *object = &scene->committed_objects[scene->touched[i]];
        object->bounds = slot->bounds;
        object->transform = p->transform;
        object->identity = p->identity;
        object->mover = slot->mover;
        object->exact = umb_motion_is_exact(scene, slot);
        object->box = is_box(object, p);
        bool masked = object->mask != slot->mask;
        object->mask = slot->mask;
        object->remasked = masked && object->live;
        if (masked) {
            scene->committed.remasked_count += object->remasked;
            scene->committed.masked = true;
        }
        if (object->occluder != UMB_NONE) {
            umb_occluder *occluder = &scene->committed_occluders[object->occluder];
            occluder->transform = p->transform;
            occluder->bounds = p->block_bounds;
            occluder->identity = p->identity;
            occluder->mirrored = p->mirrored;
            occluder->moves = moves(scene, slot);
            if (masked) { /* most moves change none, and each mask is a cache line of its own */
                scene->committed_masks[object->occluder] = slot->mask;
            }
        }
        scene->committed_moved[count] = scene->touched[i];
        count += object->live ? 1u : 0u;
        slot->touched = false;
    }
    scene->committed.moved_count = count;
}

umb_result umb_scene_commit(umb_scene *scene)
{
    umb_motion_commit(scene);
    bool changed = scene->structure_changed || scene->touched_count > 0;
    if (scene->structure_changed) {
        umb_result result = commit_structure(scene);
        if (result != UMB_OK) {
            return result;
        }
    } else if (changed) {
        commit_moved(scene);
    }
    umb_motion_committed(scene);
    scene->touched_count = 0;
    scene->structure_changed = false;
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

void umb_scene_get_stats(const umb_scene *scene, umb_scene_stats *out)
{
    const umb_committed *c = &scene->committed;
    *out = (umb_scene_stats){.occluders = c->occluder_count,
                             .stand_alone = c->occluder_count - c->first_free_occluder,
                             .shapes = scene->shape_count,
                             .movers = c->motion.count,
                             .bytes = umb_scene_memory(scene)};
    for (uint32_t i = 0; i < c->object_count; ++i) {
        out->objects += c->objects[i].used ? 1u : 0u;
        out->ignored += c->objects[i].used && !c->objects[i].live ? 1u : 0u;
    }
    for (uint32_t i = 0; i < scene->shape_count; ++i) {
        out->triangles += scene->shapes[i]->seen_count;
    }
    for (uint32_t i = 0; i < scene->group_count; ++i) {
        out->welds += scene->groups[i] != NULL ? 1u : 0u;
    }
}

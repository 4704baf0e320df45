#include "scene.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "geometry/transform.h"
#include "scene_state.h"

#define MAX_ITEMS (1u << 30) /* an index keeps two bits of an item's number for itself */
#define OBJECT_FLAGS                                                                               \
    (UMB_OBJECT_STATIC | UMB_OBJECT_NEVER_HIDES | UMB_OBJECT_IGNORED | UMB_OBJECT_IS_SHAPE)

umb_result umb_scene_fail(const umb_scene *scene, umb_result code, const char *format, ...)
{
    if (scene->error != NULL) {
        va_list arguments;
        va_start(arguments, format);
        char text[sizeof scene->error->text];
        text[0] = '\0';
        (void)vsnprintf(text, sizeof text, format, arguments);
        va_end(arguments);
        return umb_error_set(scene->error, code, "%s", text);
    }
    return code;
}

static umb_result fail_memory(const umb_scene *scene, const char *what)
{
    return umb_scene_fail(scene, UMB_ERROR_MEMORY, "out of memory for %s", what);
}

const umb_mesh *umb_scene_mesh(const umb_scene *scene, umb_shape shape)
{
    return shape == 0 ? NULL : scene->shapes[shape - 1];
}

bool umb_scene_object_hides(const umb_scene *scene, const umb_object_slot *slot)
{
    const umb_mesh *mesh = umb_scene_mesh(scene, slot->placement.shape);
    return slot->state == UMB_SLOT_USED &&
           (slot->flags & (UMB_OBJECT_NEVER_HIDES | UMB_OBJECT_IGNORED)) == 0 && mesh != NULL &&
           mesh->triangle_count > 0;
}

umb_result umb_scene_create(const umb_scene_def *def, umb_scene **out)
{
    static const umb_scene_def defaults = {0};
    if (out == NULL) {
        return UMB_ERROR_ARGUMENT;
    }
    *out = NULL;
    def = def != NULL ? def : &defaults;
    for (int i = 0; i < 3; ++i) {
        if (!isfinite(def->origin[i])) {
            return umb_error_set(def->error, UMB_ERROR_ARGUMENT, "the scene's origin is not finite");
        }
    }
    umb_allocator allocator = umb_memory_allocator(&def->allocator);
    umb_scene *scene = umb_memory_allocate_zero(&allocator, 1, sizeof *scene);
    if (scene == NULL) {
        return umb_error_set(def->error, UMB_ERROR_MEMORY, "out of memory for a scene");
    }
    scene->allocator = allocator;
    scene->error = def->error;
    atomic_flag_clear(&scene->moving.witness_lock);
    memcpy(scene->origin, def->origin, sizeof scene->origin);
    *out = scene;
    return UMB_OK;
}

void umb_scene_destroy(umb_scene *scene)
{
    if (scene == NULL) {
        return;
    }
    umb_allocator a = scene->allocator;
    for (uint32_t i = 0; i < scene->shape_count; ++i) {
        umb_mesh_destroy(&a, scene->shapes[i]);
    }
    for (uint32_t i = 0; i < scene->group_count; ++i) {
        umb_weld_group_free(&a, scene->groups[i]);
    }
    umb_weld_free_retired(scene);
    umb_motion_free(scene);
    umb_ids_free(&scene->object_ids, &a);
    umb_ids_free(&scene->occluder_ids, &a);
    umb_memory_free(&a, scene->shapes, scene->shape_capacity * sizeof *scene->shapes);
    umb_memory_free(&a, scene->objects, scene->object_capacity * sizeof *scene->objects);
    umb_memory_free(&a, scene->occluders, scene->occluder_capacity * sizeof *scene->occluders);
    umb_memory_free(&a, scene->groups, scene->group_capacity * sizeof *scene->groups);
    umb_memory_free(&a, scene->touched, scene->touched_capacity * sizeof *scene->touched);
    umb_memory_free(&a, scene->touched_occluders,
                    scene->touched_occluder_capacity * sizeof *scene->touched_occluders);
    umb_memory_free(&a, scene->sources, scene->source_capacity * sizeof *scene->sources);
    umb_memory_free(&a, scene->committed_objects,
                    scene->committed_object_capacity * sizeof *scene->committed_objects);
    umb_memory_free(&a, scene->committed_occluders,
                    scene->committed_occluder_capacity * sizeof *scene->committed_occluders);
    umb_memory_free(&a, scene->committed_masks, scene->committed_mask_capacity * sizeof *scene->committed_masks);
    umb_memory_free(&a, scene->committed_moved,
                    scene->committed_moved_capacity * sizeof *scene->committed_moved);
    umb_memory_free(&a, scene->committed_came, scene->committed_came_capacity * sizeof *scene->committed_came);
    umb_memory_free(&a, scene->committed_went, scene->committed_went_capacity * sizeof *scene->committed_went);
    umb_memory_free(&a, scene->committed_replaced,
                    scene->committed_replaced_capacity * sizeof *scene->committed_replaced);
    umb_memory_free(&a, scene, sizeof *scene);
}

umb_result umb_scene_add_shape(umb_scene *scene, const umb_shape_def *def, umb_shape *out)
{
    if (out == NULL) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "nowhere to put the shape's number");
    }
    *out = 0;
    if (scene->shape_count >= MAX_ITEMS) {
        return umb_scene_fail(scene, UMB_ERROR_LIMIT, "more than 2^30 shapes");
    }
    if (!umb_memory_reserve(&scene->allocator, (void **)&scene->shapes, &scene->shape_capacity,
                            (size_t)scene->shape_count + 1, sizeof *scene->shapes)) {
        return fail_memory(scene, "a shape");
    }
    umb_mesh *mesh = NULL;
    umb_result result = umb_mesh_create(&scene->allocator, def, &mesh);
    switch (result) {
    case UMB_OK:
        scene->shapes[scene->shape_count++] = mesh;
        *out = scene->shape_count;
        return UMB_OK;
    case UMB_ERROR_MEMORY:
        return fail_memory(scene, "a shape");
    case UMB_ERROR_LIMIT:
        return umb_scene_fail(scene, result, "a shape has more than 2^30 vertices or triangles");
    default:
        return umb_scene_fail(
            scene, result,
            "a shape needs finite positions and triples of indices below their count");
    }
}

/* See where a transform puts a shape, if the place is possible. Changes nothing else: a refused call
 * leaves the scene as it was. */
static umb_result look(const umb_scene *scene, umb_shape shape, const umb_transform *transform,
                       umb_outcome *out)
{
    if (shape > scene->shape_count) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "no shape has number %u", shape);
    }
    const char *wrong = umb_outcome_find(umb_scene_mesh(scene, shape), transform, out);
    return wrong == NULL ? UMB_OK : umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "%s", wrong);
}

/* Put it there. */
void umb_scene_place(umb_placement *p, const umb_transform *transform, const umb_outcome *seen)
{
    p->transform = *umb_outcome_transform(seen, transform);
    for (int i = 0; i < 3; ++i) {
        p->at[i] = p->transform.m[i][3];
    }
    p->block_bounds = *seen->block_bounds;
    p->identity = seen->identity;
    p->mirrored = seen->mirrored;
}

/* The bounds of an object: those given, or the shape's own. */
static umb_result choose_bounds(const umb_scene *scene, const umb_outcome *seen, const umb_aabb *given,
                                const umb_aabb **out)
{
    const char *wrong = umb_outcome_bounds(seen, given, out);
    return wrong == NULL ? UMB_OK : umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "%s", wrong);
}

umb_result umb_scene_add_object(umb_scene *scene, const umb_object_def *def, uint32_t *out)
{
    if (def == NULL || out == NULL || (def->flags & ~OBJECT_FLAGS) != 0) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "an object's definition breaks the rules");
    }
    *out = UMB_NONE;
    umb_object_slot slot = {.flags = def->flags,
                            .mask = def->mask,
                            .tag = def->tag,
                            .weld = UMB_NONE,
                            .mover = UMB_NONE,
                            .state = UMB_SLOT_USED};
    umb_outcome seen;
    const umb_aabb *bounds = NULL;
    umb_result result = look(scene, def->shape, &def->transform, &seen);
    if (result == UMB_OK) {
        result = choose_bounds(scene, &seen, &def->bounds, &bounds);
    }
    if (result != UMB_OK) {
        return result;
    }
    slot.placement.shape = def->shape;
    slot.bounds = *bounds;
    umb_scene_place(&slot.placement, &def->transform, &seen);
    uint32_t id = umb_ids_peek(&scene->object_ids);
    if (id >= MAX_ITEMS) {
        return umb_scene_fail(scene, UMB_ERROR_LIMIT, "more than 2^30 objects");
    }
    size_t need = (size_t)scene->object_ids.used + 1;
    if (!umb_ids_reserve(&scene->object_ids, &scene->allocator) ||
        !umb_memory_reserve(&scene->allocator, (void **)&scene->objects, &scene->object_capacity,
                            need, sizeof *scene->objects) ||
        !umb_memory_reserve(&scene->allocator, (void **)&scene->touched, &scene->touched_capacity, need,
                            sizeof *scene->touched)) {
        return fail_memory(scene, "an object");
    }
    (void)umb_ids_take(&scene->object_ids);
    scene->objects[id] = slot;
    umb_scene_touch_object(scene, id);
    scene->structure_changed = true;
    *out = id;
    return UMB_OK;
}

void umb_scene_touch_object(umb_scene *scene, uint32_t object)
{
    if (!scene->objects[object].touched) {
        scene->objects[object].touched = true;
        scene->touched[scene->touched_count++] = object;
    }
}

void umb_scene_renew_occluder(umb_scene *scene, uint32_t occluder)
{
    if (!scene->occluders[occluder].touched) {
        scene->occluders[occluder].touched = true;
        scene->touched_occluders[scene->touched_occluder_count++] = occluder;
    }
    scene->structure_changed = true;
}

static umb_object_slot *find_object(umb_scene *scene, uint32_t object)
{
    if (object >= scene->object_ids.used || scene->objects[object].state != UMB_SLOT_USED) {
        return NULL;
    }
    return &scene->objects[object];
}

static umb_result fail_object(const umb_scene *scene, uint32_t object)
{
    return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "no object has number %u", object);
}

umb_result umb_scene_move_object(umb_scene *scene, uint32_t object, const umb_transform *transform,
                                 const umb_aabb *bounds)
{
    umb_object_slot *slot = find_object(scene, object);
    if (slot == NULL) {
        return fail_object(scene, object);
    }
    if (slot->mover != UMB_NONE) {
        return umb_scene_fail(scene, UMB_ERROR_STATE, "object %u moves by itself: end its motion first", object);
    }
    umb_outcome seen;
    const umb_aabb *box = NULL;
    umb_result result = look(scene, slot->placement.shape, transform, &seen);
    if (result == UMB_OK) {
        result = choose_bounds(scene, &seen, bounds, &box);
    }
    if (result != UMB_OK) {
        return result;
    }
    umb_weld_dissolve(scene, slot->weld);
    umb_scene_place(&slot->placement, transform, &seen);
    slot->bounds = *box;
    umb_scene_touch_object(scene, object);
    return UMB_OK;
}

umb_result umb_scene_place_object(umb_scene *scene, uint32_t object, const umb_transform *transform,
                                  const double position[3], const umb_aabb *bounds)
{
    static const umb_transform identity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    umb_transform t = transform != NULL && !umb_transform_is_identity(transform) ? *transform : identity;
    for (int i = 0; i < 3; ++i) {
        t.m[i][3] = (float)position[i];
    }
    umb_result result = umb_scene_move_object(scene, object, &t, bounds);
    if (result == UMB_OK) {
        memcpy(scene->objects[object].placement.at, position, 3 * sizeof position[0]);
    }
    return result;
}

umb_result umb_scene_shape_object(umb_scene *scene, uint32_t object, umb_shape shape, const umb_aabb *bounds)
{
    umb_object_slot *slot = find_object(scene, object);
    if (slot == NULL) {
        return fail_object(scene, object);
    }
    umb_outcome seen;
    const umb_aabb *box = NULL;
    umb_transform transform = slot->placement.transform;
    umb_result result = look(scene, shape, &transform, &seen);
    if (result == UMB_OK && slot->mover == UMB_NONE) {
        result = choose_bounds(scene, &seen, bounds, &box);
    }
    if (result != UMB_OK) {
        return result;
    }
    umb_weld_dissolve(scene, slot->weld);
    double at[3];
    memcpy(at, slot->placement.at, sizeof at);
    slot->placement.shape = shape;
    umb_scene_place(&slot->placement, &transform, &seen);
    memcpy(slot->placement.at, at, sizeof at);
    slot->bounds = box != NULL ? *box : slot->bounds;
    umb_motion_reshape(scene, slot, seen.bounds);
    umb_scene_touch_object(scene, object);
    scene->structure_changed = true;
    return UMB_OK;
}

umb_result umb_scene_flag_object(umb_scene *scene, uint32_t object, uint32_t flags)
{
    umb_object_slot *slot = find_object(scene, object);
    if (slot == NULL) {
        return fail_object(scene, object);
    }
    if ((flags & ~OBJECT_FLAGS) != 0) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "unknown object flags %#x", flags);
    }
    umb_weld_dissolve(scene, slot->weld);
    slot->flags = flags;
    umb_scene_touch_object(scene, object);
    scene->structure_changed = true;
    return UMB_OK;
}

umb_result umb_scene_mask_object(umb_scene *scene, uint32_t object, uint32_t mask)
{
    umb_object_slot *slot = find_object(scene, object);
    if (slot == NULL) {
        return fail_object(scene, object);
    }
    if (slot->mask != mask) {
        umb_weld_dissolve(scene, slot->weld);
        slot->mask = mask;
        umb_scene_touch_object(scene, object);
    }
    return UMB_OK;
}

umb_result umb_scene_tag_object(umb_scene *scene, uint32_t object, uint32_t tag)
{
    umb_object_slot *slot = find_object(scene, object);
    if (slot == NULL) {
        return fail_object(scene, object);
    }
    slot->tag = tag;
    return UMB_OK;
}

uint32_t umb_scene_object_tag(const umb_scene *scene, uint32_t object)
{
    bool used = object < scene->object_ids.used && scene->objects[object].state == UMB_SLOT_USED;
    return used ? scene->objects[object].tag : 0;
}

umb_result umb_scene_remove_object(umb_scene *scene, uint32_t object)
{
    umb_object_slot *slot = find_object(scene, object);
    if (slot == NULL) {
        return fail_object(scene, object);
    }
    umb_weld_dissolve(scene, slot->weld);
    umb_motion_remove(scene, slot);
    slot->state = UMB_SLOT_REMOVED;
    umb_ids_release(&scene->object_ids, object);
    umb_scene_touch_object(scene, object);
    scene->structure_changed = true;
    return UMB_OK;
}

umb_result umb_scene_add_occluder(umb_scene *scene, umb_shape shape, const umb_transform *transform,
                                  uint32_t *out)
{
    if (out == NULL) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "nowhere to put the occluder's number");
    }
    *out = UMB_NONE;
    umb_occluder_slot slot = {.placement.shape = shape, .number = UMB_NONE, .state = UMB_SLOT_USED};
    umb_outcome seen;
    umb_result result = look(scene, shape, transform, &seen);
    if (result != UMB_OK) {
        return result;
    }
    umb_scene_place(&slot.placement, transform, &seen);
    const umb_mesh *mesh = umb_scene_mesh(scene, shape);
    if (mesh == NULL || mesh->triangle_count == 0) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT,
                              "an occluder's shape has nothing that blocks");
    }
    uint32_t id = umb_ids_peek(&scene->occluder_ids);
    if (id >= MAX_ITEMS) {
        return umb_scene_fail(scene, UMB_ERROR_LIMIT, "more than 2^30 occluders");
    }
    if (!umb_ids_reserve(&scene->occluder_ids, &scene->allocator) ||
        !umb_memory_reserve(&scene->allocator, (void **)&scene->occluders, &scene->occluder_capacity,
                            (size_t)scene->occluder_ids.used + 1, sizeof *scene->occluders) ||
        !umb_memory_reserve(&scene->allocator, (void **)&scene->touched_occluders,
                            &scene->touched_occluder_capacity, (size_t)scene->occluder_ids.used + 1,
                            sizeof *scene->touched_occluders)) {
        return fail_memory(scene, "an occluder");
    }
    (void)umb_ids_take(&scene->occluder_ids);
    scene->occluders[id] = slot;
    umb_scene_renew_occluder(scene, id);
    *out = id;
    return UMB_OK;
}

umb_result umb_scene_remove_occluder(umb_scene *scene, uint32_t occluder)
{
    if (occluder >= scene->occluder_ids.used || scene->occluders[occluder].state != UMB_SLOT_USED) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "no occluder has number %u", occluder);
    }
    scene->occluders[occluder].state = UMB_SLOT_REMOVED;
    umb_ids_release(&scene->occluder_ids, occluder);
    umb_scene_renew_occluder(scene, occluder);
    return UMB_OK;
}

umb_result umb_scene_open_occluder(umb_scene *scene, uint32_t occluder, bool open)
{
    if (occluder >= scene->occluder_ids.used || scene->occluders[occluder].state != UMB_SLOT_USED) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "no occluder has number %u", occluder);
    }
    if (scene->occluders[occluder].open != open) {
        scene->occluders[occluder].open = open;
        umb_scene_renew_occluder(scene, occluder);
    }
    return UMB_OK;
}

umb_result umb_scene_mask_occluder(umb_scene *scene, uint32_t occluder, uint32_t mask)
{
    if (occluder >= scene->occluder_ids.used || scene->occluders[occluder].state != UMB_SLOT_USED) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "no occluder has number %u", occluder);
    }
    if (scene->occluders[occluder].mask != mask) {
        scene->occluders[occluder].mask = mask;
        umb_scene_renew_occluder(scene, occluder);
    }
    return UMB_OK;
}

uint32_t umb_scene_object_count(const umb_scene *scene)
{
    return scene->object_ids.used;
}

const double *umb_scene_origin(const umb_scene *scene)
{
    return scene->origin;
}

const umb_allocator *umb_scene_allocator(const umb_scene *scene)
{
    return &scene->allocator;
}

size_t umb_scene_memory(const umb_scene *scene)
{
    size_t bytes = sizeof *scene + umb_ids_memory(&scene->object_ids) +
                   umb_ids_memory(&scene->occluder_ids);
    bytes += umb_motion_memory(scene);
    bytes += scene->shape_capacity * sizeof *scene->shapes;
    bytes += scene->object_capacity * sizeof *scene->objects;
    bytes += scene->occluder_capacity * sizeof *scene->occluders;
    bytes += scene->group_capacity * sizeof *scene->groups;
    bytes += (scene->touched_capacity + scene->touched_occluder_capacity + scene->committed_moved_capacity +
              scene->committed_came_capacity + scene->committed_went_capacity +
              scene->committed_replaced_capacity) *
             sizeof *scene->touched;
    bytes += scene->source_capacity * sizeof *scene->sources;
    bytes += scene->committed_object_capacity * sizeof *scene->committed_objects;
    bytes += scene->committed_occluder_capacity * sizeof *scene->committed_occluders;
    bytes += scene->committed_mask_capacity * sizeof *scene->committed_masks;
    for (uint32_t i = 0; i < scene->shape_count; ++i) {
        bytes += scene->shapes[i]->bytes;
    }
    for (uint32_t i = 0; i < scene->group_count; ++i) {
        const umb_weld_group *g = scene->groups[i];
        for (uint32_t k = 0; g != NULL && k < g->mesh_count; ++k) {
            bytes += g->meshes[k]->bytes;
        }
        bytes += g != NULL ? g->bytes : 0;
    }
    return bytes;
}

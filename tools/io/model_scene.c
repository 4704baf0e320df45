/* A model fed to the library: object ids are object numbers. */
#include <stdio.h>
#include <stdlib.h>

#include "model.h"

/* The scene keeps no pointer to the caller's error, which need not live as long. */
static umb_result fail(umb_error *error, umb_result code, const char *what, uint32_t number)
{
    if (error != NULL) {
        error->code = code;
        (void)snprintf(error->text, sizeof error->text, "%s %u: %s", what, number,
                       umb_result_name(code));
    }
    return code;
}

static umb_result add_shapes(umb_scene *scene, const model *m, umb_shape *shapes, umb_error *error)
{
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        const model_mesh *mesh = &m->meshes[i];
        if (mesh->position_count == 0 || mesh->triangle_count == 0) {
            continue; /* nothing to see: its objects have their bounds alone */
        }
        umb_shape_def def = {.positions = mesh->positions,
                             .position_count = mesh->position_count,
                             .indices = mesh->indices,
                             .index_count = mesh->triangle_count * 3,
                             .triangle_flags = mesh->flags};
        umb_result result = umb_scene_add_shape(scene, &def, &shapes[i]);
        if (result != UMB_OK) {
            return fail(error, result, "mesh", i);
        }
    }
    return UMB_OK;
}

static umb_result add_objects(umb_scene *scene, const model *m, const umb_shape *shapes,
                              umb_error *error)
{
    for (uint32_t i = 0; i < m->object_count; ++i) {
        const model_object *o = &m->objects[i];
        umb_object_def def = {.bounds = o->bounds,
                              .transform = o->transform,
                              .flags = UMB_OBJECT_STATIC | UMB_OBJECT_IS_SHAPE};
        if (o->mesh != MODEL_NONE) {
            def.shape = shapes[o->mesh];
        }
        if (def.shape == 0) {
            def.flags |= UMB_OBJECT_IGNORED;
        }
        uint32_t id = UMB_NONE;
        umb_result result = umb_scene_add_object(scene, &def, &id);
        if (result != UMB_OK) {
            return fail(error, result, "object", i);
        }
    }
    return UMB_OK;
}

umb_scene *model_scene(const model *m, bool weld, umb_tasks tasks, umb_weld_stats *stats,
                       umb_error *error)
{
    umb_scene *scene = NULL;
    umb_scene_def def = {.origin = {m->origin[0], m->origin[1], m->origin[2]}};
    umb_result result = umb_scene_create(&def, &scene);
    if (result != UMB_OK) {
        (void)fail(error, result, "scene", 0);
        return NULL;
    }
    umb_shape *shapes = calloc((size_t)m->mesh_count + 1, sizeof *shapes);
    if (shapes == NULL) {
        result = fail(error, UMB_ERROR_MEMORY, "scene", 0);
    } else {
        result = add_shapes(scene, m, shapes, error);
    }
    if (result == UMB_OK) {
        result = add_objects(scene, m, shapes, error);
    }
    if (result == UMB_OK) {
        umb_weld_stats unused;
        umb_weld_def weld_def = {.tasks = tasks};
        if (stats != NULL) {
            *stats = (umb_weld_stats){0};
        }
        if (weld) {
            result = umb_scene_weld(scene, &weld_def, stats != NULL ? stats : &unused);
        }
        if (result == UMB_OK) {
            result = umb_scene_commit(scene);
        }
        if (result != UMB_OK) {
            (void)fail(error, result, "scene of objects", m->object_count);
        }
    }
    free(shapes);
    if (result != UMB_OK) {
        umb_scene_destroy(scene);
        return NULL;
    }
    return scene;
}

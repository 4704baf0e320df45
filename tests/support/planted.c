#include "planted.h"

#include <stdlib.h>

const char *plant_name(plant what)
{
    static const char *const names[PLANT_COUNT] = {"no mistake", "objects shrunk by 1%",
                                                   "occluders inflated by 1%"};
    return names[what];
}

/* The transform followed by a scaling about the middle of the bounds. */
static umb_transform scaled(const model_object *o, double factor)
{
    umb_transform t = o->transform;
    for (int i = 0; factor != 1.0 && i < 3; ++i) {
        double centre = 0.5 * ((double)o->bounds.min[i] + o->bounds.max[i]);
        for (int j = 0; j < 4; ++j) {
            t.m[i][j] = (float)(factor * t.m[i][j] + (j == 3 ? (1.0 - factor) * centre : 0.0));
        }
    }
    return t;
}

static bool add_shapes(umb_scene *scene, const model *m, umb_shape *shapes)
{
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        const model_mesh *mesh = &m->meshes[i];
        umb_shape_def def = {.positions = mesh->positions,
                             .position_count = mesh->position_count,
                             .indices = mesh->indices,
                             .index_count = mesh->triangle_count * 3,
                             .triangle_flags = mesh->flags};
        if (mesh->triangle_count != 0 && umb_scene_add_shape(scene, &def, &shapes[i]) != UMB_OK) {
            return false;
        }
    }
    return true;
}

static bool add(umb_scene *scene, umb_shape shape, const model_object *o, double factor,
                uint32_t flags, uint32_t expected)
{
    umb_object_def def = {.shape = shape,
                          .transform = scaled(o, factor),
                          .flags = flags | (shape == 0 ? UMB_OBJECT_IGNORED : UMB_OBJECT_IS_SHAPE)};
    uint32_t id = UMB_NONE;
    return umb_scene_add_object(scene, &def, &id) == UMB_OK && id == expected;
}

umb_scene *planted_scene(const model *m, plant what, bool weld)
{
    umb_scene *scene = NULL;
    umb_shape *shapes = calloc((size_t)m->mesh_count + 1, sizeof *shapes);
    bool ok = shapes != NULL && umb_scene_create(NULL, &scene) == UMB_OK &&
              add_shapes(scene, m, shapes);
    for (uint32_t i = 0; ok && i < 2 * m->object_count; ++i) {
        bool hides = i >= m->object_count;
        const model_object *o = &m->objects[hides ? i - m->object_count : i];
        double factor = !hides && what == PLANT_SMALL_OBJECTS    ? 0.99
                        : hides && what == PLANT_LARGE_OCCLUDERS ? 1.01
                                                                 : 1.0;
        ok = add(scene, o->mesh != MODEL_NONE ? shapes[o->mesh] : 0, o, factor,
                 hides ? UMB_OBJECT_STATIC : UMB_OBJECT_NEVER_HIDES, i);
    }
    free(shapes);
    ok = ok && (!weld || umb_scene_weld(scene, NULL, NULL) == UMB_OK) &&
         umb_scene_commit(scene) == UMB_OK;
    if (!ok) {
        umb_scene_destroy(scene);
        return NULL;
    }
    return scene;
}

uint32_t planted_answer(const umb_visible_set *seen, uint32_t objects, uint32_t *out)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < seen->count; ++k) {
        if (seen->objects[k] < objects) {
            out[count++] = seen->objects[k];
        }
    }
    return count;
}

/* The foundation behind the interface of bench/compare/foundation.h: scripts/foundation compiles this with the
 * foundation's headers and library, never with today's. */
#include <stdio.h>
#include <stdlib.h>

#include "compare/foundation.h"
#include "io/model.h"

typedef struct shim {
    model *model;
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
} shim;

static void destroy(void *self)
{
    shim *s = self;
    umb_culler_destroy(s->culler);
    umb_index_destroy(s->index);
    umb_scene_destroy(s->scene);
    model_free(s->model);
    free(s);
}

static bool make(shim *s, const char *spec, umb_error *error)
{
    s->model = model_load(spec, NULL, error);
    if (s->model == NULL) {
        return false;
    }
    s->scene = model_scene(s->model, true, (umb_tasks){0}, NULL, error);
    umb_index_def index = {.kind = UMB_INDEX_BVH};
    umb_culler_def culler = {.method = UMB_METHOD_RASTER};
    return s->scene != NULL && umb_index_create(s->scene, &index, &s->index) == UMB_OK &&
           umb_culler_create(s->index, &culler, &s->culler) == UMB_OK;
}

static void *create(const char *spec, char *text, uint32_t size)
{
    umb_error error = {0};
    shim *s = calloc(1, sizeof *s);
    if (s == NULL || !make(s, spec, &error)) {
        (void)snprintf(text, size, "%s", error.text[0] != 0 ? error.text : "no memory");
        if (s != NULL) {
            destroy(s);
        }
        return NULL;
    }
    return s;
}

static uint32_t object_count(const void *self)
{
    return ((const shim *)self)->model->object_count;
}

static void bounds(const void *self, uint32_t object, float box[6])
{
    const umb_aabb *b = &((const shim *)self)->model->objects[object].bounds;
    for (int i = 0; i < 3; ++i) {
        box[i] = b->min[i];
        box[3 + i] = b->max[i];
    }
}

static uint32_t frame(void *self, const foundation_view *view, const uint32_t **objects)
{
    umb_view v = {.projection = view->orthographic ? UMB_ORTHOGRAPHIC : UMB_PERSPECTIVE,
                  .x_min = view->x_min,
                  .x_max = view->x_max,
                  .y_min = view->y_min,
                  .y_max = view->y_max,
                  .near_depth = view->near_depth,
                  .far_depth = view->far_depth};
    for (int i = 0; i < 3; ++i) {
        v.eye[i] = view->eye[i];
        v.right[i] = view->right[i];
        v.up[i] = view->up[i];
        v.forward[i] = view->forward[i];
    }
    umb_visible_set seen;
    if (umb_cull(((shim *)self)->culler, &v, &seen) != UMB_OK) {
        return UINT32_MAX;
    }
    *objects = seen.objects;
    return seen.count;
}

__attribute__((visibility("default"))) const foundation_interface foundation = {create, destroy, object_count, bounds,
                                                                                 frame};

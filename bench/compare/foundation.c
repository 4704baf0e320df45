#include "foundation.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "foundation_entry.h"

const foundation_interface *foundation_open(const char *file, umb_error *error)
{
    void *object = dlopen(file, RTLD_NOW | RTLD_LOCAL);
    const foundation_interface *f = object != NULL ? dlsym(object, "foundation") : NULL;
    if (f == NULL) {
        const char *why = dlerror();
        (void)snprintf(error->text, sizeof error->text, "%.200s", why != NULL ? why : "no foundation in it");
    }
    return f;
}

typedef struct foundation_self {
    const foundation_interface *interface;
    void *scene;
} foundation_self;

static uint32_t foundation_frame(void *self, const umb_view *view, const uint32_t **objects)
{
    foundation_self *s = self;
    foundation_view v = {.x_min = view->x_min,
                         .x_max = view->x_max,
                         .y_min = view->y_min,
                         .y_max = view->y_max,
                         .near_depth = view->near_depth,
                         .far_depth = view->far_depth,
                         .orthographic = view->projection == UMB_ORTHOGRAPHIC};
    memcpy(v.eye, view->eye, sizeof v.eye);
    memcpy(v.right, view->right, sizeof v.right);
    memcpy(v.up, view->up, sizeof v.up);
    memcpy(v.forward, view->forward, sizeof v.forward);
    return s->interface->frame(s->scene, &v, objects);
}

static void foundation_destroy(void *self)
{
    foundation_self *s = self;
    if (s->scene != NULL) {
        s->interface->destroy(s->scene);
    }
    free(s);
}

/* True if it read the same objects: answers are compared by number. */
static bool same_objects(const foundation_self *s, const model *m)
{
    bool same = s->interface->object_count(s->scene) == m->object_count;
    for (uint32_t i = 0; same && i < m->object_count; ++i) {
        float box[6];
        s->interface->bounds(s->scene, i, box);
        for (int k = 0; k < 3; ++k) {
            same = same && box[k] == m->objects[i].bounds.min[k] && box[3 + k] == m->objects[i].bounds.max[k];
        }
    }
    return same;
}

bool foundation_entry(const world *w, entry *out)
{
    char text[256] = "no memory";
    foundation_self *s = calloc(1, sizeof *s);
    *out = (entry){.name = "foundation",
                   .about = "strict",
                   .ours = true,
                   .self = s,
                   .frame = foundation_frame,
                   .destroy = foundation_destroy};
    if (s != NULL) {
        s->interface = w->foundation;
        s->scene = s->interface->create(w->spec, text, sizeof text);
    }
    bool ok = s != NULL && s->scene != NULL;
    if (ok && !same_objects(s, w->model)) {
        (void)snprintf(text, sizeof text, "it reads other objects than today");
        ok = false;
    }
    if (!ok) {
        (void)fprintf(stderr, "compare: foundation, %s: %s\n", w->spec, text);
        if (s != NULL) {
            foundation_destroy(s);
        }
    }
    return ok;
}

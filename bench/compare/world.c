/* Scenes as lists of boxes and of occluder triangles. */
#include "world.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <xxhash.h>

double world_clock(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static void *room(size_t count, size_t size)
{
    size_t bytes = (count * size + 127) / 64 * 64;
    void *p = aligned_alloc(64, bytes);
    if (p != NULL) {
        memset(p, 0, bytes);
    }
    return p;
}

static bool drawn(const model *m, uint32_t object)
{
    uint32_t mesh = m->objects[object].mesh;
    return mesh != MODEL_NONE && m->meshes[mesh].triangle_count != 0;
}

static bool list_boxes(world *w)
{
    const model *m = w->model;
    w->box_object = room(m->object_count, sizeof(uint32_t));
    bool ok = w->box_object != NULL;
    for (int k = 0; k < 6; ++k) {
        w->box[k] = room((size_t)m->object_count + 16, sizeof(float));
        ok = ok && w->box[k] != NULL;
    }
    for (uint32_t i = 0; ok && i < m->object_count; ++i) {
        if (!drawn(m, i)) {
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            w->box[k][w->box_count] = m->objects[i].bounds.min[k];
            w->box[k + 3][w->box_count] = m->objects[i].bounds.max[k];
        }
        w->box_object[w->box_count++] = i;
    }
    return ok;
}

/* Triangles met so far, by their corners: levels give a face to every part of the level that it
 * reaches into, and it need be drawn once only. */
typedef struct seen_triangles {
    uint32_t *slots; /* triangle + 1; 0: free */
    size_t mask;
} seen_triangles;

static void corners_of(const world *w, const uint32_t index[3], float out[9])
{
    const float *p[3];
    uint32_t first = 0;
    for (uint32_t i = 0; i < 3; ++i) {
        p[i] = w->vertices + 3 * (size_t)index[i];
        first = memcmp(p[i], p[first], 12) < 0 ? i : first;
    }
    for (uint32_t i = 0; i < 3; ++i) {
        memcpy(out + (size_t)3 * i, p[(first + i) % 3], 12);
    }
}

/* Is the triangle that would come next there already? If not, it is noted. */
static bool seen_before(const world *w, seen_triangles *seen, const uint32_t index[3])
{
    float own[9];
    float other[9];
    corners_of(w, index, own);
    size_t slot = XXH64(own, sizeof own, 0) & seen->mask;
    for (; seen->slots[slot] != 0; slot = (slot + 1) & seen->mask) {
        corners_of(w, w->indices + 3 * (size_t)(seen->slots[slot] - 1), other);
        if (memcmp(own, other, sizeof own) == 0) {
            return true;
        }
    }
    seen->slots[slot] = w->triangle_count + 1;
    return false;
}

static void add_occluder(world *w, uint32_t box, seen_triangles *seen)
{
    const model_object *o = &w->model->objects[w->box_object[box]];
    const model_mesh *mesh = &w->model->meshes[o->mesh];
    bool mirrored = model_mirrored(o);
    world_occluder *out = &w->occluders[w->occluder_count];
    *out = (world_occluder){box, w->vertex_count, mesh->position_count, w->triangle_count, 0};
    for (uint32_t v = 0; v < mesh->position_count; ++v) {
        model_world_vertex(w->model, o, v, w->vertices + 3 * (size_t)w->vertex_count++);
    }
    for (uint32_t k = 0; k < mesh->triangle_count; ++k) {
        const uint32_t *from = mesh->indices + 3 * (size_t)k;
        uint32_t *to = w->indices + 3 * (size_t)w->triangle_count;
        to[0] = out->first_vertex + from[0];
        to[1] = out->first_vertex + from[mirrored ? 2 : 1];
        to[2] = out->first_vertex + from[mirrored ? 1 : 2];
        if ((mesh->flags[k] & UMB_TRIANGLE_OPEN) == 0 && !seen_before(w, seen, to)) {
            w->two_sided[w->triangle_count++] = (mesh->flags[k] & UMB_TRIANGLE_TWO_SIDED) != 0;
        }
    }
    out->triangle_count = w->triangle_count - out->first_triangle;
    w->occluder_count += out->triangle_count != 0;
}

static bool list_occluders(world *w, uint32_t occluder_objects)
{
    const model *m = w->model;
    size_t vertices = 0;
    size_t triangles = 0;
    for (uint32_t b = 0; b < w->box_count && w->box_object[b] < occluder_objects; ++b) {
        const model_mesh *mesh = &m->meshes[m->objects[w->box_object[b]].mesh];
        vertices += mesh->position_count;
        triangles += mesh->triangle_count;
    }
    seen_triangles seen = {NULL, 1023};
    while (seen.mask < 2 * triangles) {
        seen.mask = 2 * seen.mask + 1;
    }
    seen.slots = calloc(seen.mask + 1, sizeof(uint32_t));
    w->occluders = room((size_t)w->box_count + 1, sizeof *w->occluders);
    w->vertices = room(3 * vertices + 4, sizeof(float));
    w->indices = room(3 * triangles + 3, sizeof(uint32_t));
    w->two_sided = room(triangles, 1);
    bool ok = seen.slots != NULL && w->occluders != NULL && w->vertices != NULL &&
              w->indices != NULL && w->two_sided != NULL;
    for (uint32_t b = 0; ok && b < w->box_count && w->box_object[b] < occluder_objects; ++b) {
        add_occluder(w, b, &seen);
    }
    free(seen.slots);
    return ok;
}

static bool make_indices(world *w)
{
    for (int kind = 0; kind < 2; ++kind) {
        double start = world_clock();
        if (umb_index_create(w->scene, &(umb_index_def){.kind = (umb_index_kind)kind},
                             &w->index[kind]) != UMB_OK) {
            return false;
        }
        w->index_ms[kind] = world_clock() - start;
    }
    return true;
}

bool world_load(world *w, const char *name, const char *spec, uint32_t occluder_objects,
                umb_error *error)
{
    memset(w, 0, sizeof *w);
    (void)snprintf(w->name, sizeof w->name, "%s", name);
    (void)snprintf(w->spec, sizeof w->spec, "%s", spec);
    w->model = model_load(spec, NULL, error);
    if (w->model == NULL) {
        return false;
    }
    w->scene = model_scene(w->model, true, (umb_tasks){0}, NULL, error);
    bool ok = w->scene != NULL;
    if (ok && !(list_boxes(w) && list_occluders(w, occluder_objects) && make_indices(w))) {
        (void)snprintf(error->text, sizeof error->text, "%.200s: not enough memory to compare",
                       spec);
        ok = false;
    }
    if (!ok) {
        world_free(w);
    }
    return ok;
}

void world_free(world *w)
{
    for (int kind = 0; kind < 2; ++kind) {
        umb_index_destroy(w->index[kind]);
    }
    umb_scene_destroy(w->scene);
    if (w->model != NULL) {
        model_free(w->model);
    }
    for (int k = 0; k < 6; ++k) {
        free(w->box[k]);
    }
    free(w->box_object);
    free(w->occluders);
    free(w->vertices);
    free(w->indices);
    free(w->two_sided);
    memset(w, 0, sizeof *w);
}

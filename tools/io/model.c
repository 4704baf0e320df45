#include "model_parts.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Meshes and objects are numbered in 32 bits, and UMB_NONE is none. */
#define MODEL_LIMIT (1u << 30)

bool model_fail(umb_error *error, umb_result code, const char *format, ...)
{
    if (error != NULL) {
        va_list arguments;
        va_start(arguments, format);
        error->code = code;
        vsnprintf(error->text, sizeof error->text, format, arguments);
        va_end(arguments);
        /* Names come from the user; the text is one line whatever they hold. */
        for (char *c = error->text; *c != '\0'; ++c) {
            if ((unsigned char)*c < 0x20) {
                *c = '?';
            }
        }
    }
    return false;
}

bool model_fail_memory(umb_error *error, const char *scene)
{
    return model_fail(error, UMB_ERROR_MEMORY, "%s: out of memory; close other programs", scene);
}

model *model_create(void)
{
    model *m = calloc(1, sizeof *m);
    if (m != NULL) {
        m->up[1] = 1.0;
    }
    return m;
}

void model_free(model *m)
{
    if (m == NULL) {
        return;
    }
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        free(m->meshes[i].positions);
        free(m->meshes[i].indices);
        free(m->meshes[i].flags);
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        free(m->objects[i].name);
    }
    free(m->meshes);
    free(m->objects);
    free(m);
}

/* Room for one more element. Arrays hold 16, then powers of two, so the count tells the
 * capacity. */
static bool make_room(void **array, uint32_t count, size_t size)
{
    if (count >= MODEL_LIMIT) {
        return false;
    }
    if (count != 0 && (count < 16 || (count & (count - 1)) != 0)) {
        return true;
    }
    void *grown = realloc(*array, (count < 16 ? 16 : 2 * (size_t)count) * size);
    if (grown == NULL) {
        return false;
    }
    *array = grown;
    return true;
}

/* A copy; NULL when there is no memory. One byte at least, so that NULL has no second meaning. */
static void *copy_bytes(const void *source, size_t count, size_t size)
{
    if (count > (SIZE_MAX - 1) / size) {
        return NULL;
    }
    char *copy = malloc(count * size + 1);
    if (copy != NULL && count != 0) {
        memcpy(copy, source, count * size);
    }
    return copy;
}

uint32_t model_add_mesh(model *m, const model_mesh *mesh)
{
    if (mesh->position_count > MODEL_LIMIT || mesh->triangle_count > MODEL_LIMIT ||
        !make_room((void **)&m->meshes, m->mesh_count, sizeof *m->meshes)) {
        return MODEL_NONE;
    }
    model_mesh copy = {
        .positions = copy_bytes(mesh->positions, mesh->position_count, 3 * sizeof(float)),
        .indices = copy_bytes(mesh->indices, mesh->triangle_count, 3 * sizeof(uint32_t)),
        .flags = mesh->flags != NULL ? copy_bytes(mesh->flags, mesh->triangle_count, 1)
                                     : calloc((size_t)mesh->triangle_count + 1, 1),
        .position_count = mesh->position_count,
        .triangle_count = mesh->triangle_count,
    };
    if (copy.positions == NULL || copy.indices == NULL || copy.flags == NULL) {
        free(copy.positions);
        free(copy.indices);
        free(copy.flags);
        return MODEL_NONE;
    }
    m->meshes[m->mesh_count] = copy;
    return m->mesh_count++;
}

uint32_t model_add_object(model *m, const char *name, uint32_t mesh, const umb_transform *transform)
{
    if (!make_room((void **)&m->objects, m->object_count, sizeof *m->objects)) {
        return MODEL_NONE;
    }
    model_object object = {.name = copy_bytes(name, strlen(name) + 1, 1), .mesh = mesh};
    if (object.name == NULL) {
        return MODEL_NONE;
    }
    static const umb_transform zero;
    if (transform != NULL && memcmp(transform, &zero, sizeof zero) != 0) {
        object.transform = *transform;
    } else {
        for (int i = 0; i < 3; ++i) {
            object.transform.m[i][i] = 1.0f;
        }
    }
    m->objects[m->object_count] = object;
    return m->object_count++;
}

void model_world_vertex(const model *m, const model_object *o, uint32_t v, float out[3])
{
    const float *p = m->meshes[o->mesh].positions + 3 * (size_t)v;
    for (int i = 0; i < 3; ++i) {
        const float *row = o->transform.m[i];
        out[i] = (float)((double)row[0] * p[0] + (double)row[1] * p[1] + (double)row[2] * p[2] +
                         (double)row[3]);
    }
}

bool model_mirrored(const model_object *o)
{
    const float(*m)[4] = o->transform.m;
    double minor[3];
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3;
        int k = (i + 2) % 3;
        minor[i] = (double)m[1][j] * m[2][k] - (double)m[1][k] * m[2][j];
    }
    return m[0][0] * minor[0] + m[0][1] * minor[1] + m[0][2] * minor[2] < 0.0;
}

/* Box of the world vertices; false if one of them is no finite float. */
static bool object_bounds(const model *m, const model_object *o, umb_aabb *out)
{
    const model_mesh *mesh = &m->meshes[o->mesh];
    umb_aabb box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (uint32_t v = 0; v < mesh->position_count; ++v) {
        float p[3];
        model_world_vertex(m, o, v, p);
        for (int i = 0; i < 3; ++i) {
            if (!isfinite(p[i])) {
                return false;
            }
            box.min[i] = fminf(box.min[i], p[i]);
            box.max[i] = fmaxf(box.max[i], p[i]);
        }
    }
    *out = box;
    return true;
}

/* Boxes of all objects and of the scene. An object whose transform throws a vertex out of the
 * floats cannot be placed: it keeps its number and loses its mesh. */
static void compute_bounds(model *m)
{
    bool any = false;
    memset(&m->bounds, 0, sizeof m->bounds);
    for (uint32_t i = 0; i < m->object_count; ++i) {
        model_object *o = &m->objects[i];
        memset(&o->bounds, 0, sizeof o->bounds);
        if (o->mesh == MODEL_NONE) {
            continue;
        }
        if (!object_bounds(m, o, &o->bounds)) {
            m->faults.non_finite += m->meshes[o->mesh].position_count;
            o->mesh = MODEL_NONE;
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            m->bounds.min[k] = any ? fminf(m->bounds.min[k], o->bounds.min[k]) : o->bounds.min[k];
            m->bounds.max[k] = any ? fmaxf(m->bounds.max[k], o->bounds.max[k]) : o->bounds.max[k];
        }
        any = true;
    }
}

static void trust_both_sides(model *m)
{
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        for (uint32_t t = 0; t < m->meshes[i].triangle_count; ++t) {
            if ((m->meshes[i].flags[t] & UMB_TRIANGLE_OPEN) == 0) {
                m->meshes[i].flags[t] |= UMB_TRIANGLE_TWO_SIDED;
            }
        }
    }
}

bool model_finish(model *m, const model_options *options, umb_error *error)
{
    /* A reader whose objects share faces has counted them already. */
    if (m->triangles == 0) {
        for (uint32_t i = 0; i < m->object_count; ++i) {
            uint32_t mesh = m->objects[i].mesh;
            m->triangles += mesh != MODEL_NONE ? m->meshes[mesh].triangle_count : 0;
        }
    }
    if (!model_clean(m)) {
        return model_fail_memory(error, "scene");
    }
    compute_bounds(m);
    if (m->origin[0] == 0.0 && m->origin[1] == 0.0 && m->origin[2] == 0.0) {
        if (!model_rebase(m)) {
            return model_fail_memory(error, "scene");
        }
    }
    if (options != NULL && options->two_sided) {
        trust_both_sides(m);
    }
    if (!model_count_faults(m)) {
        return model_fail_memory(error, "scene");
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        m->faults.empty_objects += m->objects[i].mesh == MODEL_NONE;
    }
    if (options != NULL && options->split != 0 && !model_split(m, options->split)) {
        return model_fail_memory(error, "scene");
    }
    compute_bounds(m);
    return true;
}

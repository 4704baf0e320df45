/* Cutting large meshes into spatial clusters, so that a landscape or a hall is not one object.
 *
 * Triangles are halved along the longest axis of the box around their centres until no more than
 * the limit is left; the halves hold whole clusters' worth, so the count is the least possible.
 * Instances of a mesh share its clusters. Nothing depends on anything but the mesh and the
 * limit. */
#include "model_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct centre {
    float at[3];
    uint32_t triangle;
} centre;

static int compare_axis(const centre *a, const centre *b, int axis)
{
    if (a->at[axis] != b->at[axis]) {
        return a->at[axis] < b->at[axis] ? -1 : 1;
    }
    return a->triangle < b->triangle ? -1 : a->triangle > b->triangle;
}

static int compare_x(const void *a, const void *b)
{
    return compare_axis(a, b, 0);
}

static int compare_y(const void *a, const void *b)
{
    return compare_axis(a, b, 1);
}

static int compare_z(const void *a, const void *b)
{
    return compare_axis(a, b, 2);
}

static int longest_axis(const centre *c, size_t n)
{
    int longest = 0;
    float size = -1.0f;
    for (int k = 0; k < 3; ++k) {
        float low = c[0].at[k];
        float high = low;
        for (size_t i = 1; i < n; ++i) {
            low = fminf(low, c[i].at[k]);
            high = fmaxf(high, c[i].at[k]);
        }
        if (high - low > size) {
            size = high - low;
            longest = k;
        }
    }
    return longest;
}

/* Order c so that clusters of at most limit triangles follow one another; starts gets the first
 * triangle of each. The depth is the logarithm of the number of clusters. */
static void cut(centre *c, size_t first, size_t n, uint32_t limit, size_t *starts,
                size_t *start_count)
{
    size_t clusters = (n + limit - 1) / limit;
    if (clusters <= 1) {
        starts[(*start_count)++] = first;
        return;
    }
    static int (*const compare[3])(const void *, const void *) = {compare_x, compare_y, compare_z};
    qsort(c + first, n, sizeof *c, compare[longest_axis(c + first, n)]);
    size_t half = (size_t)((double)n * (double)(clusters / 2) / (double)clusters);
    size_t most = clusters / 2 * (size_t)limit;
    size_t least = n - (clusters - clusters / 2) * (size_t)limit;
    half = half > most ? most : half;
    half = n > (clusters - clusters / 2) * (size_t)limit && half < least ? least : half;
    cut(c, first, half, limit, starts, start_count);
    cut(c, first + half, n - half, limit, starts, start_count);
}

/* A mesh of the listed triangles, with the vertices that they use, in order of first use. */
static uint32_t add_cluster(model *m, const model_mesh *from, const centre *list, size_t n,
                            uint32_t *renumbered)
{
    model_mesh part = {
        .positions = malloc((9 * n + 1) * sizeof(float)),
        .indices = malloc((3 * n + 1) * sizeof(uint32_t)),
        .flags = malloc(n + 1),
        .triangle_count = (uint32_t)n,
    };
    uint32_t added = MODEL_NONE;
    if (part.positions != NULL && part.indices != NULL && part.flags != NULL) {
        for (size_t i = 0; i < 3 * n; ++i) {
            uint32_t v = from->indices[3 * (size_t)list[i / 3].triangle + i % 3];
            if (renumbered[v] == MODEL_NONE) {
                memcpy(part.positions + 3 * (size_t)part.position_count,
                       from->positions + 3 * (size_t)v, 3 * sizeof(float));
                renumbered[v] = part.position_count++;
            }
            part.indices[i] = renumbered[v];
            part.flags[i / 3] = from->flags[list[i / 3].triangle];
        }
        for (size_t i = 0; i < 3 * n; ++i) {
            renumbered[from->indices[3 * (size_t)list[i / 3].triangle + i % 3]] = MODEL_NONE;
        }
        added = model_add_mesh(m, &part);
    }
    free(part.positions);
    free(part.indices);
    free(part.flags);
    return added;
}

/* The clusters of one mesh become meshes of to, one after another; *count says how many. */
static uint32_t split_mesh(model *to, const model_mesh *mesh, uint32_t limit, uint32_t *count)
{
    size_t n = mesh->triangle_count;
    centre *centres = malloc((n + 1) * sizeof *centres);
    size_t *starts = malloc((n / limit + 2) * sizeof *starts);
    uint32_t *renumbered = malloc(((size_t)mesh->position_count + 1) * sizeof *renumbered);
    uint32_t first = MODEL_NONE;
    *count = 0;
    if (centres != NULL && starts != NULL && renumbered != NULL) {
        memset(renumbered, 0xFF, mesh->position_count * sizeof *renumbered);
        for (size_t t = 0; t < n; ++t) {
            const uint32_t *corner = mesh->indices + 3 * t;
            centres[t].triangle = (uint32_t)t;
            for (int k = 0; k < 3; ++k) {
                centres[t].at[k] = mesh->positions[3 * (size_t)corner[0] + k] / 3.0f +
                                   mesh->positions[3 * (size_t)corner[1] + k] / 3.0f +
                                   mesh->positions[3 * (size_t)corner[2] + k] / 3.0f;
            }
        }
        size_t clusters = 0;
        cut(centres, 0, n, limit, starts, &clusters);
        starts[clusters] = n;
        for (size_t i = 0; i < clusters; ++i) {
            uint32_t added = add_cluster(to, mesh, centres + starts[i], starts[i + 1] - starts[i],
                                         renumbered);
            if (added == MODEL_NONE) {
                first = MODEL_NONE;
                break;
            }
            first = i == 0 ? added : first;
            ++*count;
        }
    }
    free(centres);
    free(starts);
    free(renumbered);
    return first;
}

/* The clusters of an object, named after it: hall#0, hall#1, ... */
static bool split_object(model *to, const model_object *o, uint32_t first, uint32_t count)
{
    if (count <= 1) {
        return model_add_object(to, o->name, first, &o->transform) != MODEL_NONE;
    }
    size_t size = strlen(o->name) + 16;
    char *name = malloc(size);
    bool added = name != NULL;
    for (uint32_t i = 0; i < count && added; ++i) {
        snprintf(name, size, "%s#%u", o->name, i);
        added = model_add_object(to, name, first + i, &o->transform) != MODEL_NONE;
    }
    free(name);
    return added;
}

bool model_split(model *m, uint32_t limit)
{
    model *to = model_create();
    uint32_t(*range)[2] = malloc(((size_t)m->mesh_count + 1) * sizeof *range);
    bool split = to != NULL && range != NULL;
    for (uint32_t i = 0; i < m->mesh_count && split; ++i) {
        range[i][1] = 1;
        range[i][0] = m->meshes[i].triangle_count <= limit
                          ? model_add_mesh(to, &m->meshes[i])
                          : split_mesh(to, &m->meshes[i], limit, &range[i][1]);
        split = range[i][0] != MODEL_NONE;
    }
    for (uint32_t i = 0; i < m->object_count && split; ++i) {
        const model_object *o = &m->objects[i];
        split = o->mesh == MODEL_NONE ? split_object(to, o, MODEL_NONE, 1)
                                      : split_object(to, o, range[o->mesh][0], range[o->mesh][1]);
    }
    if (split) {
        model kept = *m;
        m->meshes = to->meshes;
        m->objects = to->objects;
        m->mesh_count = to->mesh_count;
        m->object_count = to->object_count;
        to->meshes = kept.meshes;
        to->objects = kept.objects;
        to->mesh_count = kept.mesh_count;
        to->object_count = kept.object_count;
    }
    model_free(to);
    free(range);
    return split;
}

/* The traced scene: one soup of exact world triangles where that fits, else instances.
 *
 * A soup is traced on the very floats that the definition speaks of. Instances are traced by
 * moving the ray, so their hits are candidates only; everything told about them is computed
 * again from world corners. The soup is chosen up to FLAT_TRIANGLES: about 250 bytes a triangle.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "oracle.h"

#define FLAT_TRIANGLES 20000000u

static int part_of(uint8_t flags)
{
    if (flags & UMB_TRIANGLE_OPEN) {
        return PART_OPEN;
    }
    return flags & UMB_TRIANGLE_TWO_SIDED ? PART_BOTH_SIDES : PART_ONE_SIDE;
}

uint8_t oracle_flags(const truth *t, uint32_t object, uint32_t triangle)
{
    return t->model->meshes[t->model->objects[object].mesh].flags[triangle];
}

void oracle_triangle(const truth *t, uint32_t object, uint32_t triangle, float v[3][3])
{
    const model_object *o = &t->model->objects[object];
    const uint32_t *corner = t->model->meshes[o->mesh].indices + 3 * (size_t)triangle;
    for (int i = 0; i < 3; ++i) {
        /* A mirroring transform turns counter-clockwise corners clockwise: swap them back. */
        uint32_t k = t->mirrored[object] && i > 0 ? corner[3 - i] : corner[i];
        if (t->flat) {
            memcpy(v[i], t->vertices + 3 * (t->first_vertex[object] + k), 3 * sizeof(float));
        } else {
            model_world_vertex(t->model, o, k, v[i]);
        }
    }
}

static bool degenerate(float v[3][3])
{
    double e[3], f[3], length = 0.0, area = 0.0;
    for (int i = 0; i < 3; ++i) {
        e[i] = (double)v[1][i] - v[0][i];
        f[i] = (double)v[2][i] - v[0][i];
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        double n = e[j] * f[k] - e[k] * f[j];
        area += n * n;
        length += (e[j] * e[j] + e[k] * e[k]) * (f[j] * f[j] + f[k] * f[k]);
    }
    /* Thinner than 1e-12 of its size: no ray of floats decides anything about it. Such triangles
     * are left to exact confirmation. */
    return !(area > 1e-24 * length);
}

/* How many triangles of an object each part gets; with indices, write them. */
static void scatter_object(truth *t, uint32_t object, uint32_t count[PART_KINDS], bool write)
{
    const model_object *o = &t->model->objects[object];
    const model_mesh *mesh = &t->model->meshes[o->mesh];
    for (uint32_t k = 0; k < mesh->triangle_count; ++k) {
        float v[3][3];
        oracle_triangle(t, object, k, v);
        if (degenerate(v)) {
            continue;
        }
        int part = part_of(mesh->flags[k]);
        uint32_t slot = count[part]++;
        if (!write) {
            continue;
        }
        const uint32_t *corner = mesh->indices + 3 * (size_t)k;
        for (uint32_t i = 0; i < 3; ++i) {
            uint32_t j = t->mirrored[object] ? (3 - i) % 3 : i;
            t->indices[part][3 * (size_t)slot + i] = (uint32_t)(t->first_vertex[object] + corner[j]);
        }
        t->has_open |= part == PART_OPEN;
        t->parts[part].objects[slot] = object;
        t->parts[part].triangles[slot] = k;
    }
}

/* Ask rtcAttachGeometry for a number and commit. */
static bool attach(truth *t, RTCScene scene, RTCGeometry geometry, uint32_t number)
{
    if (!geometry) {
        return false;
    }
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_MEDIUM);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, number);
    rtcReleaseGeometry(geometry);
    return rtcGetDeviceError(t->device) == RTC_ERROR_NONE;
}

static bool commit(truth *t, RTCScene scene)
{
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
    rtcCommitScene(scene);
    return rtcGetDeviceError(t->device) == RTC_ERROR_NONE;
}

static bool attach_part(truth *t, RTCScene scene, int part, float *vertices, size_t vertex_count,
                        uint32_t *indices, size_t count)
{
    if (count == 0) {
        return true;
    }
    RTCGeometry g = rtcNewGeometry(t->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    if (!g) {
        return false;
    }
    rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices, 0, 12,
                               vertex_count);
    rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, indices, 0, 12, count);
    return attach(t, scene, g, (uint32_t)part);
}

/* Room for one element more than count: a tracer may read 16 bytes where a vertex has 12. */
static void *room(size_t count, size_t size)
{
    return calloc(count + 1, size);
}

static bool flat_vertices(truth *t)
{
    const model *m = t->model;
    uint64_t vertices = 0;
    t->first_vertex = room(m->object_count, sizeof(uint64_t));
    if (!t->first_vertex) {
        return false;
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        t->first_vertex[i] = vertices;
        if (m->objects[i].mesh != MODEL_NONE) {
            vertices += m->meshes[m->objects[i].mesh].position_count;
        }
    }
    t->first_vertex[m->object_count] = vertices;
    t->vertices = room(vertices + 1, 3 * sizeof(float));
    if (!t->vertices) {
        return false;
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        const model_object *o = &m->objects[i];
        uint32_t count = o->mesh != MODEL_NONE ? m->meshes[o->mesh].position_count : 0;
        for (uint32_t k = 0; k < count; ++k) {
            model_world_vertex(m, o, k, t->vertices + 3 * (t->first_vertex[i] + k));
        }
    }
    return true;
}

static bool build_flat(truth *t)
{
    const model *m = t->model;
    uint32_t count[PART_KINDS] = {0}, filled[PART_KINDS] = {0};
    if (!flat_vertices(t)) {
        return false;
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        if (m->objects[i].mesh != MODEL_NONE) {
            scatter_object(t, i, count, false);
        }
    }
    for (int p = 0; p < PART_KINDS; ++p) {
        t->parts[p].count = count[p];
        t->indices[p] = room(count[p], 3 * sizeof(uint32_t));
        t->parts[p].objects = room(count[p], sizeof(uint32_t));
        t->parts[p].triangles = room(count[p], sizeof(uint32_t));
        if (!t->indices[p] || !t->parts[p].objects || !t->parts[p].triangles) {
            return false;
        }
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        if (m->objects[i].mesh != MODEL_NONE) {
            scatter_object(t, i, filled, true);
        }
    }
    size_t vertices = (size_t)t->first_vertex[m->object_count];
    for (int p = 0; p < PART_KINDS; ++p) {
        if (!attach_part(t, t->scene, p, t->vertices, vertices, t->indices[p], count[p])) {
            return false;
        }
    }
    return commit(t, t->scene);
}

/* One mesh's own scene. Its buffers are the tracer's copies, so nothing has to be kept here. */
static bool build_mesh(truth *t, uint32_t number)
{
    const model_mesh *mesh = &t->model->meshes[number];
    t->mesh_scenes[number] = rtcNewScene(t->device);
    if (!t->mesh_scenes[number]) {
        return false;
    }
    for (int p = 0; p < PART_KINDS; ++p) {
        oracle_part *part = &t->mesh_parts[number][p];
        for (uint32_t k = 0; k < mesh->triangle_count; ++k) {
            part->count += part_of(mesh->flags[k]) == p;
        }
        part->triangles = room(part->count, sizeof(uint32_t));
        if (!part->triangles) {
            return false;
        }
        if (part->count == 0) {
            continue;
        }
        RTCGeometry g = rtcNewGeometry(t->device, RTC_GEOMETRY_TYPE_TRIANGLE);
        float *v = g ? rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12,
                                               mesh->position_count)
                     : NULL;
        uint32_t *index = g ? rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                      12, part->count)
                            : NULL;
        if (!v || !index) {
            return false;
        }
        memcpy(v, mesh->positions, 12 * (size_t)mesh->position_count);
        uint32_t n = 0;
        for (uint32_t k = 0; k < mesh->triangle_count; ++k) {
            if (part_of(mesh->flags[k]) == p) {
                t->has_open |= p == PART_OPEN;
                memcpy(index + 3 * (size_t)n, mesh->indices + 3 * (size_t)k, 12);
                part->triangles[n++] = k;
            }
        }
        if (!attach(t, t->mesh_scenes[number], g, (uint32_t)p)) {
            return false;
        }
    }
    return commit(t, t->mesh_scenes[number]);
}

static bool build_instances(truth *t)
{
    const model *m = t->model;
    t->mesh_scenes = room(m->mesh_count, sizeof(*t->mesh_scenes));
    t->mesh_parts = room(m->mesh_count, sizeof(*t->mesh_parts));
    if (!t->mesh_scenes || !t->mesh_parts) {
        return false;
    }
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        if (!build_mesh(t, i)) {
            return false;
        }
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        if (m->objects[i].mesh == MODEL_NONE) {
            continue;
        }
        RTCGeometry g = rtcNewGeometry(t->device, RTC_GEOMETRY_TYPE_INSTANCE);
        if (!g) {
            return false;
        }
        rtcSetGeometryInstancedScene(g, t->mesh_scenes[m->objects[i].mesh]);
        rtcSetGeometryTransform(g, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, m->objects[i].transform.m);
        if (!attach(t, t->scene, g, i)) {
            return false;
        }
    }
    return commit(t, t->scene);
}

static bool prepare(truth *t, oracle_form form)
{
    const model *m = t->model;
    t->mirrored = room(m->object_count, sizeof(bool));
    t->first_triangle = room(m->object_count, sizeof(uint64_t));
    t->neighbours = room(m->mesh_count, sizeof(*t->neighbours));
    if (!t->mirrored || !t->first_triangle || !t->neighbours) {
        return false;
    }
    uint64_t triangles = 0, vertices = 0;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        const model_object *o = &m->objects[i];
        t->first_triangle[i] = triangles;
        if (o->mesh != MODEL_NONE) {
            t->mirrored[i] = model_mirrored(o);
            triangles += m->meshes[o->mesh].triangle_count;
            vertices += m->meshes[o->mesh].position_count;
        }
    }
    t->first_triangle[m->object_count] = triangles;
    t->flat = form == ORACLE_FLAT || (form == ORACLE_EITHER && triangles <= FLAT_TRIANGLES &&
                                      vertices <= 3u * FLAT_TRIANGLES);
    /* One thread builds: a tree that depends on timing would make ties between equal depths do
     * so. */
    t->device = rtcNewDevice("threads=1");
    t->scene = t->device ? rtcNewScene(t->device) : NULL;
    return t->scene != NULL;
}

truth *truth_create(const model *m, umb_error *error)
{
    return oracle_create(m, ORACLE_EITHER, error);
}

truth *oracle_create(const model *m, oracle_form form, umb_error *error)
{
    truth *t = calloc(1, sizeof(*t));
    if (t) {
        t->model = m;
        pthread_mutex_init(&t->making_neighbours, NULL);
    }
    if (t && prepare(t, form) && (t->flat ? build_flat(t) : build_instances(t)) &&
        oracle_boxes_build(t)) {
        return t;
    }
    if (error) {
        error->code = UMB_ERROR_MEMORY;
        snprintf(error->text, sizeof(error->text),
                 "truth: not enough memory to trace %llu triangles; try a smaller scene",
                 (unsigned long long)m->triangles);
    }
    truth_destroy(t);
    return NULL;
}

void truth_destroy(truth *t)
{
    if (!t) {
        return;
    }
    if (t->scene) {
        rtcReleaseScene(t->scene);
    }
    for (uint32_t i = 0; i < t->model->mesh_count; ++i) {
        if (t->mesh_scenes && t->mesh_scenes[i]) {
            rtcReleaseScene(t->mesh_scenes[i]);
        }
        for (int p = 0; t->mesh_parts && p < PART_KINDS; ++p) {
            free(t->mesh_parts[i][p].triangles);
        }
        if (t->neighbours) {
            free(t->neighbours[i]);
        }
    }
    if (t->device) {
        rtcReleaseDevice(t->device);
    }
    for (int p = 0; p < PART_KINDS; ++p) {
        free(t->indices[p]);
        free(t->parts[p].objects);
        free(t->parts[p].triangles);
    }
    free(t->mesh_scenes);
    free(t->mesh_parts);
    free(t->neighbours);
    free(t->chunks);
    free(t->box_nodes);
    free(t->vertices);
    free(t->first_vertex);
    free(t->first_triangle);
    free(t->mirrored);
    pthread_mutex_destroy(&t->making_neighbours);
    free(t);
}

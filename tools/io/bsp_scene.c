#include "bsp_scene.h"

#include <stdlib.h>

#include "model_parts.h"

/* Far beyond any map; a hostile file could otherwise name one surface a million times. */
#define BSP_TRIANGLE_LIMIT (1u << 24)

bool bsp_read_lump(bsp_scene *s, const uint8_t *data, size_t size, size_t directory,
                   uint32_t number, const char *what, uint32_t record, bsp_lump *out)
{
    size_t entry = directory + 8 * (size_t)number;
    if (size < 8 || entry > size - 8) {
        return model_fail(s->error, UMB_ERROR_FORMAT,
                          "%s: ends within its table of lumps; copy the map again", s->name);
    }
    uint32_t offset = le32(data + entry);
    uint32_t length = le32(data + entry + 4);
    if (offset > size || length > size - offset) {
        return model_fail(s->error, UMB_ERROR_FORMAT,
                          "%s: at byte %zu: lump %u (%s) lies outside the file; copy the map again",
                          s->name, entry, number, what);
    }
    if (length % record != 0) {
        return model_fail(
            s->error, UMB_ERROR_FORMAT,
            "%s: at byte %zu: lump %u (%s) is no multiple of %u bytes; use another map", s->name,
            entry, number, what, record);
    }
    out->data = data + offset;
    out->count = length / record;
    out->record = record;
    return true;
}

bool bsp_scene_start(bsp_scene *s, uint32_t surfaces)
{
    s->into = model_create();
    s->surfaces = calloc((size_t)surfaces + 1, sizeof *s->surfaces);
    if (s->into == NULL || s->surfaces == NULL) {
        return model_fail_memory(s->error, s->name);
    }
    s->into->up[1] = 0.0;
    s->into->up[2] = 1.0;
    return true;
}

void bsp_scene_end(bsp_scene *s)
{
    free(s->positions);
    free(s->triangles);
    free(s->surfaces);
    free(s->surface_mark);
    free(s->vertex_mark);
    free(s->vertex_number);
}

static bool make_room(bsp_scene *s, void **array, uint32_t count, uint32_t *room, size_t size)
{
    if (count < *room) {
        return true;
    }
    if (count >= BSP_TRIANGLE_LIMIT) {
        return model_fail(s->error, UMB_ERROR_LIMIT, "%s: more than %u triangles; use another map",
                          s->name, BSP_TRIANGLE_LIMIT);
    }
    uint32_t larger = *room != 0 ? 2 * *room : 4096;
    void *grown = realloc(*array, larger * size);
    if (grown == NULL) {
        return model_fail_memory(s->error, s->name);
    }
    *array = grown;
    *room = larger;
    return true;
}

bool bsp_add_vertex(bsp_scene *s, const float p[3])
{
    if (!make_room(s, (void **)&s->positions, s->position_count, &s->position_room,
                   sizeof *s->positions)) {
        return false;
    }
    memcpy(s->positions[s->position_count++], p, 3 * sizeof *p);
    return true;
}

bool bsp_add_triangle(bsp_scene *s, uint32_t a, uint32_t b, uint32_t c)
{
    if (!make_room(s, (void **)&s->triangles, s->triangle_count, &s->triangle_room,
                   sizeof *s->triangles)) {
        return false;
    }
    uint32_t *triangle = s->triangles[s->triangle_count++];
    triangle[0] = a;
    triangle[1] = b;
    triangle[2] = c;
    return true;
}

bool bsp_surfaces_done(bsp_scene *s)
{
    s->surface_mark = calloc((size_t)s->surface_count + 1, sizeof *s->surface_mark);
    s->vertex_mark = calloc((size_t)s->position_count + 1, sizeof *s->vertex_mark);
    s->vertex_number = calloc((size_t)s->position_count + 1, sizeof *s->vertex_number);
    if (s->surface_mark == NULL || s->vertex_mark == NULL || s->vertex_number == NULL) {
        return model_fail_memory(s->error, s->name);
    }
    for (uint32_t i = 0; i < s->surface_count; ++i) {
        s->into->triangles += s->surfaces[i].count;
    }
    return true;
}

/* Append a surface's triangles and those of its vertices that the object has not met yet. */
static void append_surface(bsp_scene *s, const bsp_surface *surface, uint32_t mark,
                           uint8_t extra_flags, model_mesh *mesh)
{
    for (uint32_t t = surface->first; t < surface->first + surface->count; ++t) {
        for (int i = 0; i < 3; ++i) {
            uint32_t v = s->triangles[t][i];
            if (s->vertex_mark[v] != mark) {
                s->vertex_mark[v] = mark;
                s->vertex_number[v] = mesh->position_count;
                memcpy(mesh->positions + 3 * (size_t)mesh->position_count++, s->positions[v],
                       sizeof s->positions[v]);
            }
            mesh->indices[3 * (size_t)mesh->triangle_count + i] = s->vertex_number[v];
        }
        mesh->flags[mesh->triangle_count++] = surface->flags | extra_flags;
    }
}

bool bsp_add_object(bsp_scene *s, const char *name, const uint32_t *list, uint32_t count,
                    uint8_t extra_flags)
{
    uint32_t mark = s->into->object_count + 1;
    size_t triangles = 0;
    for (uint32_t i = 0; i < count; ++i) {
        if (!s->surfaces[list[i]].left_out && s->surface_mark[list[i]] != mark) {
            s->surface_mark[list[i]] = mark;
            triangles += s->surfaces[list[i]].count;
        }
    }
    s->placed += triangles + count;
    if (s->placed > BSP_TRIANGLE_LIMIT) {
        return model_fail(s->error, UMB_ERROR_LIMIT,
                          "%s: its leaves name more than %u triangles; use another map", s->name,
                          BSP_TRIANGLE_LIMIT);
    }
    if (triangles == 0) {
        return model_add_object(s->into, name, MODEL_NONE, NULL) != MODEL_NONE ||
               model_fail_memory(s->error, s->name);
    }
    model_mesh mesh = {
        .positions = malloc(9 * triangles * sizeof(float)),
        .indices = malloc(3 * triangles * sizeof(uint32_t)),
        .flags = malloc(triangles),
    };
    bool added = mesh.positions != NULL && mesh.indices != NULL && mesh.flags != NULL;
    if (added) {
        for (uint32_t i = 0; i < count; ++i) {
            if (s->surface_mark[list[i]] == mark) {
                s->surface_mark[list[i]] = 0;
                append_surface(s, &s->surfaces[list[i]], mark, extra_flags, &mesh);
            }
        }
        uint32_t number = model_add_mesh(s->into, &mesh);
        added = number != MODEL_NONE && model_add_object(s->into, name, number, NULL) != MODEL_NONE;
    }
    free(mesh.positions);
    free(mesh.indices);
    free(mesh.flags);
    return added || model_fail_memory(s->error, s->name);
}

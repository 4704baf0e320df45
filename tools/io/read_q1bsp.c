/* Quake maps (BSP29).
 *
 * Leaf 0 is the solid outside; object i is leaf i + 1 of the world, which is also bit i of the
 * map's own visibility. Then come the sub-models 1, 2, ...: doors, lifts, triggers. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "bsp_scene.h"
#include "model_parts.h"
#include "polygon.h"
#include "readers.h"

/* The game's own compilers write at most 64 sides; larger faces of hostile files are not worth
 * care. */
#define SMALL_FACE 64

typedef struct q1_map {
    bsp_lump textures, vertices, texinfo, faces, leaves, mark_surfaces, edges, surf_edges, models;
} q1_map;

static bool read_lumps(bsp_scene *s, const uint8_t *data, size_t size, q1_map *map)
{
    const struct {
        uint32_t number, record;
        const char *what;
        bsp_lump *lump;
    } wanted[] = {
        {2, 1, "textures", &map->textures},
        {3, 12, "vertices", &map->vertices},
        {6, 40, "texture places", &map->texinfo},
        {7, 20, "faces", &map->faces},
        {10, 28, "leaves", &map->leaves},
        {11, 2, "leaf faces", &map->mark_surfaces},
        {12, 4, "edges", &map->edges},
        {13, 4, "face edges", &map->surf_edges},
        {14, 64, "models", &map->models},
    };
    for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; ++i) {
        if (!bsp_read_lump(s, data, size, 4, wanted[i].number, wanted[i].what, wanted[i].record,
                           wanted[i].lump)) {
            return false;
        }
    }
    if (map->models.count == 0) {
        return model_fail(s->error, UMB_ERROR_FORMAT,
                          "%s: lump 14 (models) is empty; use another map", s->name);
    }
    return true;
}

/* A texture's name, at most 15 letters and a zero; empty when it has none. */
static void texture_name(const q1_map *map, uint32_t number, char name[16])
{
    memset(name, 0, 16);
    const bsp_lump *lump = &map->textures;
    if (lump->count < 4 || number >= le32(lump->data) || number >= (lump->count - 4) / 4) {
        return;
    }
    uint32_t offset = le32(lump->data + 4 + 4 * (size_t)number);
    if (bsp_range(offset, 16, lump->count)) {
        memcpy(name, lump->data + offset, 15);
    }
}

/* Liquids start with a star; triggers are invisible to players, fences ({) are cut out by the
 * texture. */
static bool see_through(const char *texture)
{
    return texture[0] == '*' || texture[0] == '{' || strcasecmp(texture, "trigger") == 0;
}

/* Corner number i of a face. */
static bool face_corner(bsp_scene *s, const q1_map *map, uint32_t face, uint32_t i, uint32_t *vertex)
{
    uint32_t first = le32(map->faces.data + 20 * (size_t)face + 4);
    uint32_t signed_edge = le32(map->surf_edges.data + 4 * (size_t)(first + i));
    bool backwards = signed_edge >> 31 != 0;
    uint32_t edge = backwards ? 0u - signed_edge : signed_edge;
    if (edge >= map->edges.count) {
        return model_fail(s->error, UMB_ERROR_FORMAT,
                          "%s: face %u names edge %u of %u; use another map", s->name, face, edge,
                          map->edges.count);
    }
    *vertex = le16(map->edges.data + 4 * (size_t)edge + (backwards ? 2 : 0));
    return *vertex < s->position_count ||
           model_fail(s->error, UMB_ERROR_FORMAT,
                      "%s: edge %u names vertex %u of %u; use another map", s->name, edge, *vertex,
                      s->position_count);
}

/* The map compiler puts corners into the middle of straight sides, where neighbours meet them. A
 * plain fan would make slivers of no area there, and leave the sides' halves without a triangle. */
static bool add_small_face(bsp_scene *s, const uint32_t *ring, uint32_t sides)
{
    double corners[SMALL_FACE][3];
    uint32_t cut[SMALL_FACE + 2][3];
    for (uint32_t i = 0; i < sides; ++i) {
        for (int k = 0; k < 3; ++k) {
            /* Fronts are clockwise in the file. */
            corners[i][k] = s->positions[ring[sides - 1 - i]][k];
        }
    }
    const uint32_t starts[2] = {0, sides};
    polygon p = {.corners = (const double(*)[3])corners, .starts = starts, .rings = 1};
    bool sound;
    uint32_t count = polygon_triangulate(&p, cut, &sound);
    if (count == UINT32_MAX) {
        return model_fail_memory(s->error, s->name);
    }
    for (uint32_t t = 0; t < count; ++t) {
        if (!bsp_add_triangle(s, ring[sides - 1 - cut[t][0]], ring[sides - 1 - cut[t][1]],
                              ring[sides - 1 - cut[t][2]])) {
            return false;
        }
    }
    return true;
}

static bool add_large_face(bsp_scene *s, const uint32_t *ring, uint32_t sides)
{
    for (uint32_t i = 2; i < sides; ++i) {
        if (!bsp_add_triangle(s, ring[0], ring[i], ring[i - 1])) {
            return false;
        }
    }
    return true;
}

static bool read_face(bsp_scene *s, const q1_map *map, uint32_t number, bool sky, uint32_t *ring)
{
    const uint8_t *face = map->faces.data + 20 * (size_t)number;
    uint32_t sides = le16(face + 8);
    uint32_t texinfo = le16(face + 10);
    if (!bsp_range(le32(face + 4), sides, map->surf_edges.count) || texinfo >= map->texinfo.count) {
        return model_fail(
            s->error, UMB_ERROR_FORMAT,
            "%s: face %u names edges or a texture that are not there; use another map", s->name,
            number);
    }
    char texture[16];
    texture_name(map, le32(map->texinfo.data + 40 * (size_t)texinfo + 32), texture);
    bsp_surface *surface = &s->surfaces[s->surface_count++];
    surface->first = s->triangle_count;
    surface->left_out = strncasecmp(texture, "sky", 3) == 0 && !sky;
    surface->flags = see_through(texture) ? UMB_TRIANGLE_OPEN : 0;
    for (uint32_t i = 0; i < sides; ++i) {
        if (!face_corner(s, map, number, i, &ring[i])) {
            return false;
        }
    }
    bool added = sides <= SMALL_FACE ? add_small_face(s, ring, sides)
                                     : add_large_face(s, ring, sides);
    surface->count = s->triangle_count - surface->first;
    return added;
}

static bool read_surfaces(bsp_scene *s, const q1_map *map, bool sky)
{
    for (uint32_t i = 0; i < map->vertices.count; ++i) {
        float p[3];
        for (int k = 0; k < 3; ++k) {
            p[k] = le_float(map->vertices.data + 12 * (size_t)i + 4 * k);
        }
        if (!bsp_add_vertex(s, p)) {
            return false;
        }
    }
    uint32_t ring[UINT16_MAX];
    for (uint32_t i = 0; i < map->faces.count; ++i) {
        if (!read_face(s, map, i, sky, ring)) {
            return false;
        }
    }
    return bsp_surfaces_done(s);
}

/* The faces of leaf number into list, which has room for all mark surfaces. False: out of range. */
static bool leaf_faces(bsp_scene *s, const q1_map *map, uint32_t number, uint32_t *list,
                       uint32_t *count)
{
    const uint8_t *leaf = map->leaves.data + 28 * (size_t)number;
    uint32_t first = le16(leaf + 20);
    *count = le16(leaf + 22);
    bool inside = bsp_range(first, *count, map->mark_surfaces.count);
    for (uint32_t i = 0; i < *count && inside; ++i) {
        list[i] = le16(map->mark_surfaces.data + 2 * (size_t)(first + i));
        inside = list[i] < s->surface_count;
    }
    return inside || model_fail(s->error, UMB_ERROR_FORMAT,
                                "%s: leaf %u names faces that are not there; use another map",
                                s->name, number);
}

static bool add_objects(bsp_scene *s, const q1_map *map, uint32_t *list)
{
    uint32_t leaves = le32(map->models.data + 52);
    if (leaves >= map->leaves.count && leaves != 0) {
        return model_fail(s->error, UMB_ERROR_FORMAT,
                          "%s: the world claims %u leaves of %u; use another map", s->name, leaves,
                          map->leaves.count);
    }
    char name[32];
    for (uint32_t i = 1; i <= leaves; ++i) {
        uint32_t count;
        snprintf(name, sizeof name, "leaf %u", i);
        if (!leaf_faces(s, map, i, list, &count) || !bsp_add_object(s, name, list, count, 0)) {
            return false;
        }
    }
    for (uint32_t i = 1; i < map->models.count; ++i) {
        uint32_t first = le32(map->models.data + 64 * (size_t)i + 56);
        uint32_t count = le32(map->models.data + 64 * (size_t)i + 60);
        if (!bsp_range(first, count, s->surface_count)) {
            return model_fail(s->error, UMB_ERROR_FORMAT,
                              "%s: model %u names faces that are not there; use another map",
                              s->name, i);
        }
        for (uint32_t k = 0; k < count; ++k) {
            list[k] = first + k;
        }
        snprintf(name, sizeof name, "model %u", i);
        if (!bsp_add_object(s, name, list, count, UMB_TRIANGLE_OPEN)) {
            return false;
        }
    }
    return true;
}

model *read_q1bsp(const uint8_t *data, size_t size, const char *name, const model_options *options,
                  umb_error *error)
{
    bsp_scene s = {.name = name, .error = error};
    q1_map map;
    if (size < 4 || le32(data) != 29) {
        model_fail(error, UMB_ERROR_FORMAT,
                   "%s: at byte 0: not a Quake map of version 29; use another map", name);
        return NULL;
    }
    uint32_t *list = NULL;
    bool read = read_lumps(&s, data, size, &map) && bsp_scene_start(&s, map.faces.count) &&
                read_surfaces(&s, &map, options->sky);
    if (read) {
        uint32_t room = map.faces.count > 65536 ? map.faces.count : 65536;
        list = malloc(((size_t)room + 1) * sizeof *list);
        read = list != NULL || model_fail_memory(error, name);
    }
    read = read && add_objects(&s, &map, list) && model_finish(s.into, options, error);
    free(list);
    bsp_scene_end(&s);
    if (!read) {
        model_free(s.into);
        return NULL;
    }
    return s.into;
}

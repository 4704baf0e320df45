/* Quake 3 maps (IBSP 46), OpenArena's among them.
 *
 * Object i is leaf cluster i; then come the sub-models 1, 2, ...: doors, platforms, triggers. A
 * face lies in every cluster that one of its leaves belongs to. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bsp_scene.h"
#include "model_parts.h"
#include "readers.h"

/* Bits of a texture's surface and contents flags, as the game's map compiler sets them. */
enum {
    SURFACE_SKY = 0x4,
    SURFACE_NO_DRAW = 0x80,
    SURFACE_HINT = 0x100,
    SURFACE_SKIP = 0x200,
    SURFACE_ALPHA_SHADOW = 0x10000, /* light passes where the texture is cut out */
    CONTENTS_LAVA = 0x8,
    CONTENTS_SLIME = 0x10,
    CONTENTS_WATER = 0x20,
    CONTENTS_FOG = 0x40,
    CONTENTS_TRANSLUCENT = 0x20000000,
    CONTENTS_TRIGGER = 0x40000000
};

enum { FACE_POLYGON = 1, FACE_PATCH = 2, FACE_MESH = 3, FACE_BILLBOARD = 4 };

/* Quads along one side of a 3 x 3 control block. */
#define PATCH_STEPS 4

typedef struct q3_map {
    bsp_lump textures, leaves, leaf_faces, models, vertices, indices, faces;
} q3_map;

static bool read_lumps(bsp_scene *s, const uint8_t *data, size_t size, q3_map *map)
{
    const struct {
        uint32_t number, record;
        const char *what;
        bsp_lump *lump;
    } wanted[] = {
        {1, 72, "textures", &map->textures},    {4, 48, "leaves", &map->leaves},
        {5, 4, "leaf faces", &map->leaf_faces}, {7, 40, "models", &map->models},
        {10, 44, "vertices", &map->vertices},   {11, 4, "mesh vertices", &map->indices},
        {13, 104, "faces", &map->faces},
    };
    for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; ++i) {
        if (!bsp_read_lump(s, data, size, 8, wanted[i].number, wanted[i].what, wanted[i].record,
                           wanted[i].lump)) {
            return false;
        }
    }
    if (map->models.count == 0) {
        return model_fail(s->error, UMB_ERROR_FORMAT,
                          "%s: lump 7 (models) is empty; use another map", s->name);
    }
    return true;
}

static bool bad_face(bsp_scene *s, uint32_t number, const char *what)
{
    return model_fail(s->error, UMB_ERROR_FORMAT, "%s: face %u %s; use another map", s->name,
                      number, what);
}

/* Point (i, j) of the tessellated patch. A quadratic Bezier curve at quarter steps has weights
 * that are sixteenths, so the products are exact in double, and so are nearly always the sums: a
 * border that two patches share gives the same floats from either side. */
static void patch_point(const bsp_scene *s, uint32_t first, uint32_t width, uint32_t i, uint32_t j,
                        float out[3])
{
    static const double weight[PATCH_STEPS + 1][3] = {{1.0, 0.0, 0.0},
                                                      {0.5625, 0.375, 0.0625},
                                                      {0.25, 0.5, 0.25},
                                                      {0.0625, 0.375, 0.5625},
                                                      {0.0, 0.0, 1.0}};
    /* The last point of a block is the first of the next: same control point, same weights
     * reversed. */
    uint32_t column = i / PATCH_STEPS;
    uint32_t row = j / PATCH_STEPS;
    const double *across = weight[i % PATCH_STEPS];
    const double *along = weight[j % PATCH_STEPS];
    double sum[3] = {0};
    for (uint32_t r = 0; r < 3; ++r) {
        for (uint32_t c = 0; c < 3; ++c) {
            double w = along[r] * across[c];
            if (w != 0.0) {
                const float *p = s->positions[first + (2 * row + r) * width + 2 * column + c];
                for (int k = 0; k < 3; ++k) {
                    sum[k] += w * p[k];
                }
            }
        }
    }
    for (int k = 0; k < 3; ++k) {
        out[k] = (float)sum[k];
    }
}

static bool read_patch(bsp_scene *s, const uint8_t *face, uint32_t number)
{
    uint32_t first = le32(face + 12);
    uint32_t vertices = le32(face + 16);
    uint32_t width = le32(face + 96);
    uint32_t height = le32(face + 100);
    if (width < 3 || height < 3 || width % 2 == 0 || height % 2 == 0 || width > vertices / height) {
        return bad_face(s, number, "is a patch of an impossible size");
    }
    uint32_t across = PATCH_STEPS * ((width - 1) / 2);
    uint32_t along = PATCH_STEPS * ((height - 1) / 2);
    uint32_t base = s->position_count;
    for (uint32_t j = 0; j <= along; ++j) {
        for (uint32_t i = 0; i <= across; ++i) {
            float p[3];
            patch_point(s, first, width, i, j, p);
            if (!bsp_add_vertex(s, p)) {
                return false;
            }
        }
    }
    for (uint32_t j = 0; j < along; ++j) {
        for (uint32_t i = 0; i < across; ++i) {
            uint32_t v = base + j * (across + 1) + i;
            uint32_t below = v + across + 1;
            if (!bsp_add_triangle(s, v, v + 1, below) ||
                !bsp_add_triangle(s, v + 1, below + 1, below)) {
                return false;
            }
        }
    }
    return true;
}

static bool read_triangles(bsp_scene *s, const q3_map *map, const uint8_t *face, uint32_t number)
{
    uint32_t first = le32(face + 12);
    uint32_t vertices = le32(face + 16);
    uint32_t first_index = le32(face + 20);
    uint32_t indices = le32(face + 24);
    if (!bsp_range(first_index, indices, map->indices.count)) {
        return bad_face(s, number, "names mesh vertices that are not there");
    }
    for (uint32_t i = 0; i + 2 < indices; i += 3) {
        uint32_t corner[3];
        for (uint32_t k = 0; k < 3; ++k) {
            corner[k] = le32(map->indices.data + 4 * (size_t)(first_index + i + k));
            if (corner[k] >= vertices) {
                return bad_face(s, number, "has a corner that is none of its vertices");
            }
        }
        /* Fronts are clockwise in the file. */
        if (!bsp_add_triangle(s, first + corner[0], first + corner[2], first + corner[1])) {
            return false;
        }
    }
    return true;
}

static void read_texture(const q3_map *map, uint32_t number, bool sky, bsp_surface *surface)
{
    uint32_t flags = le32(map->textures.data + 72 * (size_t)number + 64);
    uint32_t contents = le32(map->textures.data + 72 * (size_t)number + 68);
    surface->left_out = (flags & (SURFACE_NO_DRAW | SURFACE_HINT | SURFACE_SKIP)) != 0 ||
                        ((flags & SURFACE_SKY) != 0 && !sky);
    bool open = (flags & SURFACE_ALPHA_SHADOW) != 0 ||
                (contents & (CONTENTS_LAVA | CONTENTS_SLIME | CONTENTS_WATER | CONTENTS_FOG |
                             CONTENTS_TRANSLUCENT | CONTENTS_TRIGGER)) != 0;
    /* Sky shaders carry odd contents; asked for, sky blocks. */
    surface->flags = open && (flags & SURFACE_SKY) == 0 ? UMB_TRIANGLE_OPEN : 0;
}

static bool read_face(bsp_scene *s, const q3_map *map, uint32_t number, bool sky)
{
    const uint8_t *face = map->faces.data + 104 * (size_t)number;
    uint32_t type = le32(face + 8);
    bsp_surface *surface = &s->surfaces[s->surface_count++];
    surface->first = s->triangle_count;
    if (type == FACE_BILLBOARD) {
        return true; /* a glow that turns to the eye: no surface */
    }
    if (le32(face) >= map->textures.count ||
        !bsp_range(le32(face + 12), le32(face + 16), map->vertices.count)) {
        return bad_face(s, number, "names vertices or a texture that are not there");
    }
    read_texture(map, le32(face), sky, surface);
    bool read;
    if (type == FACE_PATCH) {
        read = read_patch(s, face, number);
    } else if (type == FACE_POLYGON || type == FACE_MESH) {
        read = read_triangles(s, map, face, number);
    } else {
        read = bad_face(s, number, "is of an unknown kind");
    }
    surface->count = s->triangle_count - surface->first;
    return read;
}

static bool read_surfaces(bsp_scene *s, const q3_map *map, bool sky)
{
    for (uint32_t i = 0; i < map->vertices.count; ++i) {
        float p[3];
        for (int k = 0; k < 3; ++k) {
            p[k] = le_float(map->vertices.data + 44 * (size_t)i + 4 * k);
        }
        if (!bsp_add_vertex(s, p)) {
            return false;
        }
    }
    for (uint32_t i = 0; i < map->faces.count; ++i) {
        if (!read_face(s, map, i, sky)) {
            return false;
        }
    }
    return bsp_surfaces_done(s);
}

/* World faces by cluster: those of cluster c are list[start[c]] to list[start[c + 1]]. */
typedef struct cluster_faces {
    uint32_t *start, *list;
    uint32_t count;
} cluster_faces;

/* Visit the leaves; each face of the world that lies in cluster c is put at start[c]++ of list.
 * Without a list, only count them: start[c + 1]++. Leaves of sub-models stand among the others,
 * with clusters that mean nothing; their faces are not the world's. */
static uint64_t visit_leaves(const q3_map *map, uint32_t world_first, uint32_t world_count,
                             cluster_faces *by)
{
    uint64_t total = 0;
    for (uint32_t i = 0; i < map->leaves.count; ++i) {
        const uint8_t *leaf = map->leaves.data + 48 * (size_t)i;
        uint32_t cluster = le32(leaf);
        uint32_t first = le32(leaf + 32);
        uint32_t count = le32(leaf + 36);
        if (cluster >= by->count) {
            continue;
        }
        for (uint32_t k = first; k < first + count; ++k) {
            uint32_t face = le32(map->leaf_faces.data + 4 * (size_t)k);
            if (face - world_first >= world_count) {
                continue;
            }
            ++total;
            if (by->list != NULL) {
                by->list[by->start[cluster]++] = face;
            } else {
                ++by->start[cluster + 1];
            }
        }
    }
    return total;
}

/* A hostile file could name one long list from every leaf. */
#define LEAF_FACE_LIMIT ((uint64_t)1 << 26)

/* Check all leaves and find how many clusters there are. */
static bool check_leaves(bsp_scene *s, const q3_map *map, cluster_faces *by)
{
    uint64_t named = 0;
    for (uint32_t i = 0; i < map->leaves.count; ++i) {
        const uint8_t *leaf = map->leaves.data + 48 * (size_t)i;
        uint32_t cluster = le32(leaf);
        uint32_t count = le32(leaf + 36);
        bool none = cluster >> 31 != 0;
        if (!bsp_range(le32(leaf + 32), count, map->leaf_faces.count) ||
            (!none && cluster >= map->leaves.count)) {
            return model_fail(
                s->error, UMB_ERROR_FORMAT,
                "%s: leaf %u names faces or a cluster that are not there; use another map", s->name,
                i);
        }
        named += count;
        if (!none && cluster >= by->count) {
            by->count = cluster + 1;
        }
    }
    for (uint32_t i = 0; i < map->leaf_faces.count; ++i) {
        if (le32(map->leaf_faces.data + 4 * (size_t)i) >= s->surface_count) {
            return model_fail(s->error, UMB_ERROR_FORMAT,
                              "%s: leaf face %u names a face that is not there; use another map",
                              s->name, i);
        }
    }
    return named <= LEAF_FACE_LIMIT ||
           model_fail(s->error, UMB_ERROR_LIMIT,
                      "%s: its leaves name too many faces; use another map", s->name);
}

static bool sort_faces(bsp_scene *s, const q3_map *map, uint32_t world_first, uint32_t world_count,
                       cluster_faces *by)
{
    by->start = calloc((size_t)by->count + 2, sizeof *by->start);
    if (by->start == NULL) {
        return model_fail_memory(s->error, s->name);
    }
    uint64_t total = visit_leaves(map, world_first, world_count, by);
    by->list = malloc((total + 1) * sizeof *by->list);
    if (by->list == NULL) {
        return model_fail_memory(s->error, s->name);
    }
    for (uint32_t c = 0; c < by->count; ++c) {
        by->start[c + 1] += by->start[c];
    }
    visit_leaves(map, world_first, world_count, by);
    /* Filling moved every start to the next one's place. */
    memmove(by->start + 1, by->start, by->count * sizeof *by->start);
    by->start[0] = 0;
    return true;
}

static bool add_objects(bsp_scene *s, const q3_map *map, const cluster_faces *by, uint32_t *list)
{
    char name[32];
    for (uint32_t c = 0; c < by->count; ++c) {
        snprintf(name, sizeof name, "cluster %u", c);
        if (!bsp_add_object(s, name, by->list + by->start[c], by->start[c + 1] - by->start[c], 0)) {
            return false;
        }
    }
    for (uint32_t i = 1; i < map->models.count; ++i) {
        uint32_t first = le32(map->models.data + 40 * (size_t)i + 24);
        uint32_t count = le32(map->models.data + 40 * (size_t)i + 28);
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

static bool read_objects(bsp_scene *s, const q3_map *map)
{
    cluster_faces by = {0};
    uint32_t world_first = le32(map->models.data + 24);
    uint32_t world_count = le32(map->models.data + 28);
    uint32_t *list = malloc(((size_t)s->surface_count + 1) * sizeof *list);
    bool read = (list != NULL || model_fail_memory(s->error, s->name)) &&
                check_leaves(s, map, &by) && sort_faces(s, map, world_first, world_count, &by) &&
                add_objects(s, map, &by, list);
    free(by.start);
    free(by.list);
    free(list);
    return read;
}

model *read_q3bsp(const uint8_t *data, size_t size, const char *name, const model_options *options,
                  umb_error *error)
{
    if (size < 8 || memcmp(data, "IBSP", 4) != 0 || le32(data + 4) != 46) {
        model_fail(error, UMB_ERROR_FORMAT,
                   "%s: at byte 0: not a Quake 3 map (IBSP 46); use another map", name);
        return NULL;
    }
    bsp_scene s = {.name = name, .error = error};
    q3_map map;
    bool read = read_lumps(&s, data, size, &map) && bsp_scene_start(&s, map.faces.count) &&
                read_surfaces(&s, &map, options->sky) && read_objects(&s, &map) &&
                model_finish(s.into, options, error);
    bsp_scene_end(&s);
    if (!read) {
        model_free(s.into);
        return NULL;
    }
    return s.into;
}

/* What Quake and Quake 3 maps have in common: surfaces of triangles, gathered into one object a
 * leaf cluster and one a sub-model. */
#ifndef BSP_SCENE_H
#define BSP_SCENE_H

#include <string.h>

#include "model.h"

/* A lump: count records of record bytes each, checked to lie inside the file. */
typedef struct bsp_lump {
    const uint8_t *data;
    uint32_t count, record;
} bsp_lump;

typedef struct bsp_surface {
    uint32_t first, count; /* triangles in bsp_scene */
    uint8_t flags;         /* UMB_TRIANGLE_* */
    bool left_out;         /* not drawn, or sky that nobody asked for: counted, in no object */
} bsp_surface;

typedef struct bsp_scene {
    const char *name; /* of the file, for error texts */
    umb_error *error;
    model *into;
    float (*positions)[3];
    uint32_t (*triangles)[3];
    bsp_surface *surfaces;
    uint32_t position_count, triangle_count, surface_count;
    uint32_t position_room, triangle_room;
    /* Which object last took a surface and a vertex, and the vertex's number there. */
    uint32_t *surface_mark, *vertex_mark, *vertex_number;
    uint64_t placed; /* triangles in all objects, and surfaces named by them */
} bsp_scene;

static inline uint32_t le32(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static inline uint32_t le16(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8;
}

static inline float le_float(const uint8_t *p)
{
    uint32_t bits = le32(p);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* True if [first, first + count) lies in [0, limit). Files store signed numbers: negative ones are
 * huge here. */
static inline bool bsp_range(uint32_t first, uint32_t count, uint32_t limit)
{
    return first <= limit && count <= limit - first;
}

/* Lump number of a file: its offset and size stand at directory + 8 * number. */
bool bsp_read_lump(bsp_scene *s, const uint8_t *data, size_t size, size_t directory,
                   uint32_t number, const char *what, uint32_t record, bsp_lump *out);

/* Start with a model and room for surfaces; false: no memory, with text. */
bool bsp_scene_start(bsp_scene *s, uint32_t surfaces);
/* Frees all but the model. */
void bsp_scene_end(bsp_scene *s);

/* Append a vertex, a triangle (to the surface that is being built, the last one). */
bool bsp_add_vertex(bsp_scene *s, const float p[3]);
bool bsp_add_triangle(bsp_scene *s, uint32_t a, uint32_t b, uint32_t c);

/* After the last surface: marks for the objects to come. */
bool bsp_surfaces_done(bsp_scene *s);

/* An object of the listed surfaces (all below surface_count), each taken once. extra_flags are
 * set on all of its triangles. */
bool bsp_add_object(bsp_scene *s, const char *name, const uint32_t *list, uint32_t count,
                    uint8_t extra_flags);

#endif

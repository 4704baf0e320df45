#include "support/small_maps.h"

#include <string.h>

static void put16(small_map *m, uint32_t value)
{
    m->bytes[m->size++] = (uint8_t)value;
    m->bytes[m->size++] = (uint8_t)(value >> 8);
}

static void put32(small_map *m, uint32_t value)
{
    put16(m, value & 0xFFFFu);
    put16(m, value >> 16);
}

static void put_float(small_map *m, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put32(m, bits);
}

static void put_zeros(small_map *m, size_t count)
{
    memset(m->bytes + m->size, 0, count);
    m->size += count;
}

static void put_name(small_map *m, const char *name, size_t room)
{
    memset(m->bytes + m->size, 0, room);
    memcpy(m->bytes + m->size, name, strlen(name));
    m->size += room;
}

void small_map_poke(small_map *map, size_t offset, uint32_t value)
{
    size_t size = map->size;
    map->size = offset;
    put32(map, value);
    map->size = size;
}

uint32_t small_map_peek(const small_map *map, size_t offset)
{
    const uint8_t *p = map->bytes + offset;
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* The lump that began at start is complete: note it in the table. */
static void end_lump(small_map *m, size_t table, size_t number, size_t start)
{
    small_map_poke(m, table + 8 * number, (uint32_t)start);
    small_map_poke(m, table + 8 * number + 4, (uint32_t)(m->size - start));
}

static void put_q1_textures(small_map *m)
{
    static const char *const names[] = {"brick", "sky1", "*water0", "door"};
    size_t start = m->size;
    put32(m, 4);
    for (uint32_t i = 0; i < 4; ++i) {
        put32(m, 20 + 40 * i);
    }
    for (int i = 0; i < 4; ++i) {
        put_name(m, names[i], 16);
        put_zeros(m, 24);
    }
    end_lump(m, 4, 2, start);
    start = m->size;
    for (uint32_t i = 0; i < 4; ++i) {
        put_zeros(m, 32);
        put32(m, i);
        put32(m, 0);
    }
    end_lump(m, 4, 6, start);
}

/* Corners of the eight faces, clockwise seen from inside the room. 255 ends a face. */
static const uint8_t q1_rings[8][7] = {
    {3, 9, 2, 1, 8, 0, 255}, /* the floor, with corners 8 and 9 in two of its sides */
    {4, 7, 3, 0, 255},       {5, 4, 0, 1, 255}, {6, 5, 1, 2, 255},
    {7, 6, 2, 3, 255},       {5, 6, 7, 4, 255}, /* the sky */
    {10, 11, 12, 13, 255},                      /* the pool */
    {14, 15, 16, 17, 255},                      /* the door */
};
static const uint8_t q1_textures[8] = {0, 0, 0, 0, 0, 1, 2, 3};

static void put_q1_vertices(small_map *m)
{
    static const float vertices[18][3] = {
        {0, 0, 0},    {64, 0, 0},  {64, 64, 0}, {0, 64, 0},  {0, 0, 64},   {64, 0, 64},
        {64, 64, 64}, {0, 64, 64}, {32, 0, 0},  {32, 64, 0}, {8, 8, 8},    {8, 24, 8},
        {24, 24, 8},  {24, 8, 8},  {0, 30, 0},  {0, 30, 30}, {16, 30, 30}, {16, 30, 0}};
    size_t start = m->size;
    for (int i = 0; i < 18; ++i) {
        for (int k = 0; k < 3; ++k) {
            put_float(m, vertices[i][k]);
        }
    }
    end_lump(m, 4, 3, start);
}

/* One edge a corner, every other one stored backwards; edge 0 is not used, as in real maps. */
static void put_q1_faces(small_map *m)
{
    uint32_t edge = 1;
    uint32_t first[9];
    size_t start = m->size;
    put32(m, 0);
    for (int f = 0; f < 8; ++f) {
        first[f] = edge - 1;
        for (int i = 0; q1_rings[f][i] != 255; ++i, ++edge) {
            uint32_t from = q1_rings[f][i];
            uint32_t to = q1_rings[f][q1_rings[f][i + 1] != 255 ? i + 1 : 0];
            put16(m, edge % 2 != 0 ? from : to);
            put16(m, edge % 2 != 0 ? to : from);
        }
    }
    first[8] = edge - 1;
    end_lump(m, 4, 12, start);
    start = m->size;
    for (uint32_t i = 1; i < edge; ++i) {
        put32(m, i % 2 != 0 ? i : 0u - i);
    }
    end_lump(m, 4, 13, start);
    start = m->size;
    for (int f = 0; f < 8; ++f) {
        put16(m, 0);
        put16(m, 0);
        put32(m, first[f]);
        put16(m, first[f + 1] - first[f]);
        put16(m, q1_textures[f]);
        put_zeros(m, 8);
    }
    end_lump(m, 4, 7, start);
}

void small_q1_map(small_map *out)
{
    static const uint16_t leaf_ranges[5][2] = {{0, 0}, {0, 6}, {6, 2}, {8, 0}, {8, 1}};
    static const uint16_t leaf_faces[9] = {0, 1, 2, 3, 4, 5, 1, 6, 7};
    memset(out, 0, sizeof *out);
    put32(out, 29);
    put_zeros(out, 120);
    put_q1_textures(out);
    put_q1_vertices(out);
    put_q1_faces(out);
    size_t start = out->size;
    for (int i = 0; i < 5; ++i) {
        put_zeros(out, 20);
        put16(out, leaf_ranges[i][0]);
        put16(out, leaf_ranges[i][1]);
        put_zeros(out, 4);
    }
    end_lump(out, 4, 10, start);
    start = out->size;
    for (int i = 0; i < 9; ++i) {
        put16(out, leaf_faces[i]);
    }
    end_lump(out, 4, 11, start);
    start = out->size;
    for (uint32_t i = 0; i < 2; ++i) {
        put_zeros(out, 52);
        put32(out, i == 0 ? 3 : 1);
        put32(out, i == 0 ? 0 : 7);
        put32(out, i == 0 ? 7 : 1);
    }
    end_lump(out, 4, 14, start);
}

static void put_q3_textures(small_map *m)
{
    static const struct {
        const char *name;
        uint32_t flags, contents;
    } textures[] = {{"textures/wall", 0, 1},
                    {"textures/fog", 0x4c00, 0x20000040},
                    {"textures/sky", 0xc34, 1},
                    {"textures/common/caulk", 0x80, 1}};
    size_t start = m->size;
    for (int i = 0; i < 4; ++i) {
        put_name(m, textures[i].name, 64);
        put32(m, textures[i].flags);
        put32(m, textures[i].contents);
    }
    end_lump(m, 8, 1, start);
}

/* Vertices: five quads of four, then a patch of 3 x 3, then a triangle. Each quad stands at y = its
 * number, and is clockwise seen from -y. */
static void put_q3_vertices(small_map *m)
{
    static const float quad[4][2] = {{0, 0}, {0, 16}, {16, 16}, {16, 0}};
    static const float row[3] = {0, 8, 16};
    size_t start = m->size;
    for (int v = 0; v < 32; ++v) {
        float p[3] = {0};
        if (v < 20) {
            p[0] = quad[v % 4][0];
            p[1] = (float)(v / 4);
            p[2] = quad[v % 4][1];
        } else if (v < 29) {
            p[0] = row[(v - 20) % 3];
            p[1] = (v - 20) % 3 == 1 ? 100.0f : 50.0f;
            p[2] = row[(v - 20) / 3];
        } else {
            p[0] = v == 30 ? 5.0f : 0.0f;
            p[1] = -20.0f;
            p[2] = v == 31 ? 5.0f : 0.0f;
        }
        for (int k = 0; k < 3; ++k) {
            put_float(m, p[k]);
        }
        put_zeros(m, 32);
    }
    end_lump(m, 8, 10, start);
    start = m->size;
    static const uint32_t indices[9] = {0, 1, 2, 0, 2, 3, 0, 2, 1};
    for (int i = 0; i < 9; ++i) {
        put32(m, indices[i]);
    }
    end_lump(m, 8, 11, start);
}

static void put_q3_face(small_map *m, uint32_t texture, uint32_t type, uint32_t first,
                        uint32_t count)
{
    put32(m, texture);
    put32(m, 0);
    put32(m, type);
    put32(m, first);
    put32(m, count);
    put32(m, type == 3 ? 6 : 0);
    put32(m, type == 1 ? 6 : type == 3 ? 3 : 0);
    put_zeros(m, 68);
    put32(m, type == 2 ? 3 : 0);
    put32(m, type == 2 ? 3 : 0);
}

static void put_q3_faces(small_map *m)
{
    size_t start = m->size;
    put_q3_face(m, 0, 1, 0, 4);  /* 0: a wall */
    put_q3_face(m, 0, 2, 20, 9); /* 1: a patch */
    put_q3_face(m, 0, 3, 29, 3); /* 2: a mesh of one triangle */
    put_q3_face(m, 1, 1, 4, 4);  /* 3: fog */
    put_q3_face(m, 2, 1, 8, 4);  /* 4: sky */
    put_q3_face(m, 3, 1, 12, 4); /* 5: not drawn */
    put_q3_face(m, 0, 4, 0, 0);  /* 6: a billboard */
    put_q3_face(m, 0, 1, 16, 4); /* 7: the door */
    end_lump(m, 8, 13, start);
}

void small_q3_map(small_map *out)
{
    /* The world's leaves are 0 to 3; leaf 4 is the door's, and its cluster means nothing. */
    static const uint32_t leaves[5][3] = {
        {0xFFFFFFFFu, 0, 0}, {0, 0, 3}, {2, 3, 5}, {1, 8, 0}, {0, 8, 1}};
    static const uint32_t leaf_faces[9] = {0, 1, 2, 0, 3, 4, 5, 6, 7};
    memset(out, 0, sizeof *out);
    memcpy(out->bytes, "IBSP", 4);
    out->size = 4;
    put32(out, 46);
    put_zeros(out, 136);
    put_q3_textures(out);
    put_q3_vertices(out);
    put_q3_faces(out);
    size_t start = out->size;
    for (int i = 0; i < 5; ++i) {
        put32(out, leaves[i][0]);
        put_zeros(out, 28);
        put32(out, leaves[i][1]);
        put32(out, leaves[i][2]);
        put_zeros(out, 8);
    }
    end_lump(out, 8, 4, start);
    start = out->size;
    for (int i = 0; i < 9; ++i) {
        put32(out, leaf_faces[i]);
    }
    end_lump(out, 8, 5, start);
    start = out->size;
    for (uint32_t i = 0; i < 2; ++i) {
        put_zeros(out, 24);
        put32(out, i == 0 ? 0 : 7);
        put32(out, i == 0 ? 7 : 1);
        put_zeros(out, 8);
    }
    end_lump(out, 8, 7, start);
}

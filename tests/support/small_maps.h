/* Quake maps of a few faces, written byte by byte, for the tests of their readers. */
#ifndef SMALL_MAPS_H
#define SMALL_MAPS_H

#include <stddef.h>
#include <stdint.h>

/* A file being written. */
typedef struct small_map {
    uint8_t bytes[8192];
    size_t size;
} small_map;

/* A Quake room, a cube from 0 to 64: leaf 1 has floor, four walls and a sky for a ceiling; leaf
 * 2 has a wall of leaf 1's and a pool; leaf 3 has nothing; model 1 is a door. Six corners on the
 * floor: two of its sides have one in their middle. In all 6 + 1 + 1 faces and
 * SMALL_Q1_TRIANGLES triangles. */
void small_q1_map(small_map *out);
#define SMALL_Q1_TRIANGLES 18

/* A Quake 3 map of as many clusters (0 and 2 with faces, 1 without): a quad in both clusters, a
 * patch and a mesh in cluster 0, a fog quad and a sky quad in cluster 2, one that is not drawn,
 * a billboard, and a door as model 1. */
void small_q3_map(small_map *out);
#define SMALL_Q3_TRIANGLES (2 + 32 + 1 + 2 + 2 + 2 + 2)

/* Overwrite the 32 bits at offset. */
void small_map_poke(small_map *map, size_t offset, uint32_t value);
uint32_t small_map_peek(const small_map *map, size_t offset);

#endif

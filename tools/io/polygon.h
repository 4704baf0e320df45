/* A flat polygon with holes, cut into triangles between its own corners. */
#ifndef POLYGON_H
#define POLYGON_H

#include <stdbool.h>
#include <stdint.h>

/* Corners of all rings, one ring after another; ring r is [starts[r], starts[r + 1]). Ring 0 is the
 * outer one, whose turn is the surface's front; the others are holes, of either turn. */
typedef struct polygon {
    const double (*corners)[3];
    const uint32_t *starts;
    uint32_t rings;
} polygon;

/* Writes three corner numbers a triangle to out, which has room for corners + 2 * rings
 * triangles. Returns how many: corners + 2 * holes - 2, fewer where the polygon is none;
 * UINT32_MAX without memory.
 *
 * *sound is set when every triangle turns as the polygon does or has no area. Cutting off an ear
 * takes its boundary from the polygon's, so the triangles' boundaries always add up to the
 * polygon's: when none of them turns the wrong way they cover its inside and nothing else. Rings
 * that cross themselves or one another end unsound; what such triangles cover is anyone's guess. */
uint32_t polygon_triangulate(const polygon *p, uint32_t (*out)[3], bool *sound);

#endif

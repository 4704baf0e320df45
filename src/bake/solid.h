/* Convex bodies that block, and the test by corners (docs/conservative.md, T5): when every segment from a corner of
 * one box to a corner of another meets a body, every segment between the boxes does. */
#ifndef UMB_SOLID_H
#define UMB_SOLID_H

#include "base/memory.h"
#include "geometry/vec.h"
#include "scene/scene.h"

/* A convex part of what an occluder encloses. Its planes are moved inwards by what rounding may do, for points whose
 * coordinates are at most the reach that it was made for. */
typedef struct umb_solid {
    umb_aabb bounds; /* only to pass it over quickly */
    uint32_t occluder;
    uint32_t first_plane, plane_count;
    double inner[3]; /* a point well inside */
} umb_solid;

/* Bodies and their planes. */
typedef struct umb_solids {
    const umb_allocator *allocator;
    umb_solid *items;
    double (*planes)[4]; /* inside where n.x + d <= 0 */
    size_t count, capacity, plane_count, plane_capacity;
    double reach; /* no coordinate of a point asked about is larger */
} umb_solids;

void umb_solids_free(umb_solids *s);

/* The most vertices that the blocking triangles of a body may have. */
#define UMB_SOLID_VERTICES 66

/* World positions of an occluder's blocking vertices; at most UMB_SOLID_VERTICES of them. */
void umb_solid_vertices(const umb_occluder *o, double out[][3]);

/* Add the body of an occluder whose mesh is convex. UMB_OK with *added false: it has none that serves: the box (corners
 * of the cell) is not beside it, or it is too flat. */
umb_result umb_solids_add(umb_solids *s, const umb_occluder *o, uint32_t number, const double box[8][3],
                          bool *added);

/* Which of the 64 segments from the eight points of a to those of b surely meet the body: bit 8 i + j for a[i], b[j]. */
uint64_t umb_solid_blocks(const umb_solids *s, const umb_solid *body, const double a[8][3], const double b[8][3]);

/* The same of one segment. */
bool umb_solid_meets(const umb_solids *s, const umb_solid *body, const double a[3], const double b[3]);

/* The eight corners of a box. */
void umb_box_corners(const double min[3], const double max[3], double out[8][3]);

#endif

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

/* A plane of a body. Where n.x + d is above `beyond`, nothing of the occluder is; INFINITY: nobody knows where. */
typedef struct umb_solid_plane {
    double plane[4]; /* inside where n.x + d <= 0 */
    double beyond;
} umb_solid_plane;

/* Bodies of occluders, each found when it is first asked for. */
typedef struct umb_solids {
    const umb_allocator *allocator;
    umb_solid *items;
    umb_solid_plane *planes;
    size_t count, capacity, plane_count, plane_capacity;
    double reach; /* no coordinate of a point asked about is larger */
    struct umb_solid_run {
        uint32_t first, count; /* items of an occluder; first UMB_NONE: not looked for yet */
    } *runs;
    size_t run_capacity;
} umb_solids;

/* Forget all bodies; room for those of so many occluders. False: no memory. */
bool umb_solids_begin(umb_solids *s, uint32_t occluder_count, double reach);
void umb_solids_free(umb_solids *s);

/* Make sure that the bodies of an occluder are there: runs[number] says which. */
umb_result umb_solids_find(umb_solids *s, const umb_occluder *o, uint32_t number);

/* True if the box (corners) surely does not reach into what an occluder encloses, whose bodies are there. */
bool umb_solids_apart(const umb_solids *s, const umb_occluder *o, uint32_t number, const double box[8][3]);

/* The most vertices that the blocking triangles of a body may have. */
#define UMB_SOLID_VERTICES 66

/* World positions of an occluder's blocking vertices; at most UMB_SOLID_VERTICES of them. */
void umb_solid_vertices(const umb_occluder *o, double out[][3]);

/* Add the body of an occluder whose mesh is convex. UMB_OK with *added false: it has none, or is too flat. */
umb_result umb_solids_add(umb_solids *s, const umb_occluder *o, uint32_t number, bool *added);

/* Which of the 64 segments from the eight points of a to those of b surely meet the body: bit 8 i + j for a[i], b[j]. */
uint64_t umb_solid_blocks(const umb_solids *s, const umb_solid *body, const double a[8][3], const double b[8][3]);

/* True if all of them do. */
bool umb_solid_blocks_all(const umb_solids *s, const umb_solid *body, const double (*a)[3], const double (*b)[3]);

/* The same of one segment. */
bool umb_solid_meets(const umb_solids *s, const umb_solid *body, const double a[3], const double b[3]);

/* The eight corners of a box. */
void umb_box_corners(const double min[3], const double max[3], double out[8][3]);

#endif

/* The convex polygons that a mesh is made of, and which of them share an edge: what methods choose their occluders
 * from. Coorg and Teller join polygons into strips and patches; here the triangles of flat, convex places are joined
 * into one polygon when the mesh is read, and polygons that share a whole edge know each other.
 *
 * That a polygon is flat and convex is meant, not promised: triangles are joined where they are so as far as
 * rounding lets one see. Nothing that hides relies on it (docs/conservative.md). */
#ifndef UMB_FACETS_H
#define UMB_FACETS_H

#include "base/memory.h"
#include "scene/mesh.h"

/* Corners of one polygon, at most. */
#define UMB_FACET_CORNERS 12

typedef struct umb_facet {
    uint32_t first, count;                   /* corners[first ...], counter-clockwise from the front */
    uint32_t first_triangle, triangle_count; /* members[first_triangle ...] */
    float area[3];   /* the area vector, along the front normal */
    float centre[3]; /* the mean of its corners */
    uint32_t tag;    /* the least of its triangles' */
    bool two_sided;
} umb_facet;

typedef struct umb_facets {
    umb_facet *facets; /* by tag, then the largest first */
    uint32_t *corners; /* vertex numbers */
    uint32_t *beyond;  /* beside each corner: the facet across the edge to the next one, or UMB_NONE */
    uint32_t *members; /* triangle numbers */
    float *sizes;      /* beside each facet: its area */
    float (*positions)[3];    /* the source's own: not owned */
    uint32_t (*triangles)[3];
    uint32_t facet_count, triangle_count, corner_count;
} umb_facets;

/* Triangles to make facets of; they must outlive them. */
typedef struct umb_facet_source {
    float (*positions)[3];
    uint32_t (*triangles)[3];
    const uint8_t *two_sided; /* a flag a triangle */
    const uint32_t *tags;     /* NULL: all zero. Facets may join triangles of several tags */
    uint32_t triangle_count;
} umb_facet_source;

/* False without memory; *out is then empty. */
bool umb_facets_build(umb_facets *out, const umb_allocator *a, const umb_facet_source *source);
void umb_facets_free(umb_facets *f, const umb_allocator *a);
size_t umb_facets_bytes(const umb_facets *f);

#endif

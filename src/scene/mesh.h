/* A mesh: the triangles of a shape or of a welded occluder, with what the silhouette needs. Immutable. */
#ifndef UMB_MESH_H
#define UMB_MESH_H

#include "umbrage/scene.h"

/* An edge between blocking triangles. f0 runs v0 -> v1. f1 runs v1 -> v0, unless UMB_EDGE_SAME is set
 * in it, then v0 -> v1 too; UMB_NONE: no second triangle. A non-manifold edge is several of these: with
 * s(f) = +1 for a triangle seen from its front, -1 for a two-sided one seen from behind, 0 for one that
 * does not block now, the net multiplicity of v0 -> v1 in the boundary of the front set is
 * s(f0) - s(f1), or s(f0) + s(f1) when SAME, summed over the entries. */
typedef struct umb_edge {
    uint32_t v0, v1;
    uint32_t f0, f1;
} umb_edge;

#define UMB_EDGE_SAME 0x80000000u

typedef struct umb_mesh {
    float (*positions)[3];
    uint32_t (*triangles)[3]; /* blocking triangles only: not OPEN, not of zero area in exact arithmetic */
    uint8_t *two_sided;       /* per blocking triangle: 1 or 0 */
    umb_edge *edges;
    umb_aabb *parts;          /* boxes that together hold every triangle, OPEN and degenerate ones too */
    uint32_t position_count, triangle_count, edge_count, part_count;
    uint32_t any_two_sided;
    umb_aabb bounds;          /* of all positions that a triangle uses */
    umb_aabb block_bounds;    /* of the blocking triangles; meaningless when there is none */
    size_t bytes;
} umb_mesh;

#endif

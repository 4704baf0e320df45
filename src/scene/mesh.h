/* A mesh: the triangles of a shape or of a welded occluder, with what the silhouette needs.
 * Immutable. */
#ifndef UMB_MESH_H
#define UMB_MESH_H

#include "umbrage/scene.h"

/* An edge between blocking triangles. f0 runs v0 -> v1. f1 runs v1 -> v0, unless UMB_EDGE_SAME is
 * set in it, then v0 -> v1 too; UMB_NONE: no second triangle. A non-manifold edge is several of
 * these: with s(f) = +1 for a triangle seen from its front, -1 for a two-sided one seen from
 * behind, 0 for one that does not block now, the net multiplicity of v0 -> v1 in the boundary of
 * the front set is s(f0) - s(f1), or s(f0) + s(f1) when SAME, summed over the entries, which follow
 * one another. */
typedef struct umb_edge {
    uint32_t v0, v1;
    uint32_t f0, f1;
} umb_edge;

#define UMB_EDGE_SAME 0x80000000u

/* A tree of boxes in the order of a walk: the part at 0 holds all triangles; the part after part i
 * is the first that i was cut into, unless that is skip, where the walk goes on when i is passed
 * over. */
typedef struct umb_part {
    umb_aabb box;
    uint32_t skip; /* own number + 1: a leaf */
    uint32_t begin, end; /* its triangles: those that part_order[begin .. end) names */
} umb_part;

typedef struct umb_mesh {
    /* What a move looks at comes first: one cache line. */
    umb_aabb bounds;          /* of all positions that a triangle uses */
    umb_aabb block_bounds;    /* of the blocking triangles; meaningless when there is none */
    uint32_t position_count;
    uint32_t block_position_count; /* blocking triangles use positions below this; the rest is only seen */
    uint32_t triangle_count;  /* blocking triangles */
    bool convex;              /* the blocking triangles are the boundary of a convex body that is not flat,
                                 each point of it once, fronts outwards: at most 128 triangles, none
                                 two-sided, every edge between two of them. Exact for the positions as
                                 they are; a transform rounds world vertices, so there it is a hint */
    bool box;                 /* convex, and its eight vertices are the corners of block_bounds */
    uint32_t seen_count;      /* all triangles */
    uint32_t edge_count, part_count;
    uint32_t any_two_sided;
    float (*positions)[3];
    uint32_t (*triangles)[3]; /* the blocking ones first: not OPEN, not of zero area in exact arithmetic */
    uint8_t *two_sided;       /* per blocking triangle: 1 or 0 */
    umb_edge *edges;
    umb_part *parts; /* hold every triangle, OPEN and degenerate ones too */
    uint32_t *part_order;     /* every triangle once, by parts */
    size_t bytes;             /* of the one block that holds the mesh and its arrays */
} umb_mesh;

/* Build a mesh. Vertices are the same where their positions are exactly equal (-0 is 0): files
 * split vertices for normals and colours, and a split is no crack. Positions no triangle uses are
 * left out (unless there is no triangle at all). Errors: the rules of umb_shape_def, no memory. */
umb_result umb_mesh_create(const umb_allocator *allocator, const umb_shape_def *def, umb_mesh **out);
/* The same with a single part: for occluders that stand alone, which have no object's bounds to
 * refine. */
umb_result umb_mesh_create_occluder(const umb_allocator *allocator, const umb_shape_def *def, umb_mesh **out);
void umb_mesh_destroy(const umb_allocator *allocator, umb_mesh *mesh);

/* Lay out the arrays of an empty mesh in one block, for those who fill it in themselves: the counts
 * of sizes say how long each is. NULL when there is no memory. */
umb_mesh *umb_mesh_allocate(const umb_allocator *allocator, const umb_mesh *sizes);

/* Boxes of the world vertices under a transform: of all, and of those of blocking triangles (zero
 * when there is none), which is returned: one of the two in *out. They are those of what
 * umb_transform_point() gives, to the bit but for the signs of zeros. Entries are not finite where a
 * vertex leaves the range of floats. */
typedef struct umb_mesh_place {
    umb_aabb bounds;
    umb_aabb block_bounds; /* left alone when they are the same vertices */
} umb_mesh_place;

const umb_aabb *umb_mesh_world_bounds(const umb_mesh *mesh, const umb_transform *transform,
                                      umb_mesh_place *out);

#endif

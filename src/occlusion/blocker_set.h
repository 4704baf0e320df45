/* The occluders that were chosen for a frame, made ready to be asked about boxes: half-spaces.
 *
 *                      edges: on their inner side        A box is hidden by a blocker when all of it lies within
 *          \  ____  /                                    every half-space: past each edge on the occluder's side,
 *           \/____\/  <- surface                         beyond its surface, and where the surface is cut by the
 *           /      \                                     near plane, on sight-lines that meet it beyond that.
 *       ---/--------\---- beyond the surface
 *         /          \        A blocker is some facets of one occluder, all seen from one side: a facet of its own,
 *        /   hidden   \       or all that is seen of a convex body (a polygon that no file has: its outline).
 *
 * Blockers that share an edge hide together: sight-lines that pass the edge on one side meet the one, on the other
 * side the other. docs/conservative.md, 14, has the proof, for points, directions and cells. */
#ifndef UMB_BLOCKERS_H
#define UMB_BLOCKERS_H

#include "facets.h"
#include "index/tree.h"
#include "method.h"

#define UMB_BLOCKER_EDGES 16
#define UMB_BLOCKER_PLANES 8

/* Holds x where n . (x - origin) - at is greater than 0. Found in floats the value is off by less than
 * slack times the sum of |x - origin|, plus room. Scaled so that the greatest component of n is 1. */
typedef struct umb_half_space {
    float n[3], at;
    float slack, room;
} umb_half_space;

typedef struct umb_blocker_edge {
    float a[3], b[3];
    uint32_t beyond; /* the blocker across it, or UMB_NONE */
    uint32_t facet;  /* the facet across it, or UMB_NONE */
    uint64_t id;     /* the same in every frame, and no other edge's, as long as the scene's structure lasts */
} umb_blocker_edge;

/* Beyond the surface: n . (x - origin) < low, in doubles. */
typedef struct umb_blocker_plane {
    float n[3];
    double low, error; /* of n . (x - origin), relative to the sum of |x - origin| */
} umb_blocker_plane;

typedef struct umb_blocker {
    uint32_t occluder, facet; /* facet UMB_NONE: all of a body */
    uint32_t set;             /* blockers of one set have facets of one umb_facets, in one place */
    uint32_t first_space;     /* edges first, for each as many as the viewer has points; then planes, then near */
    uint32_t first_edge, first_plane;
    uint8_t edge_count, plane_count, near_count;
    bool joined;  /* some edge has a blocker beyond */
    bool flipped; /* two-sided, and seen from behind */
} umb_blocker;

typedef struct umb_blockers {
    umb_viewer viewer;
    double origin[3];
    float origin_high[3], origin_low[3]; /* their sum is the origin, to 48 bits */
    umb_blocker *list;
    umb_half_space *spaces;
    umb_blocker_edge *edges;
    umb_blocker_plane *planes;
    uint32_t count, space_count, edge_count, plane_count;
    uint32_t *table; /* of blockers by set and facet, while they are joined */
    size_t list_capacity, space_capacity, edge_capacity, plane_capacity, table_capacity;
} umb_blockers;

/* Begin a frame with room for count blockers. viewer->points must last as long. False without memory. */
bool umb_blockers_begin(umb_blockers *b, const umb_allocator *a, const umb_viewer *viewer, uint32_t count);
void umb_blockers_free(umb_blockers *b, const umb_allocator *a);

/* Add one facet of an occluder, or with UMB_NONE all of a body that faces the viewer. False if it hides nothing: it
 * faces away or nearly so, is nearer than the near plane, or has too many edges. */
typedef struct umb_blocker_def {
    const umb_occluder *place; /* of the facets */
    const umb_facets *facets;
    uint32_t occluder, set, facet; /* as in umb_blocker */
} umb_blocker_def;

bool umb_blockers_add(umb_blockers *b, const umb_blocker_def *def);
/* All have been added: find those that share edges. */
void umb_blockers_join(umb_blockers *b);

/* A box decided in doubles; what these cannot tell counts as neither. An edge: 1, all of the box is on the inner side
 * of its planes, from each of the viewer's points; -1, all of it is on the outer side, from each; else 0. */
int umb_blockers_edge_side(const umb_blockers *b, const umb_blocker_edge *edge, const umb_aabb *box);
bool umb_blockers_behind(const umb_blockers *b, const umb_blocker_plane *plane, const umb_aabb *box);

#endif

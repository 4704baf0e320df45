/* The paper's own way to ask: tangent planes of each edge and each box, by table, kept at the nodes (Coorg and Teller
 * 1997, 3.1 and 3.3).
 *
 * They depend on edge and box alone, so an eye that moves may use them again: to know a box then takes two inner
 * products for each edge. An entry has the planes of one edge and of the boxes of one node, and lives as long as it is
 * asked for: those of nodes that are no longer reached (an ancestor is hidden or clear) make room for others, the
 * oldest first. A commit that changes the scene drops all. Entries never change an answer, but for what lies within the
 * bounds of docs/conservative.md, 14. */
#ifndef UMB_PLANES_CACHE_H
#define UMB_PLANES_CACHE_H

#include "base/memory.h"
#include "planes_kernels.h"
#include "tangent.h"

enum { UMB_PLANES_WAYS = 8 };

/* Which entries are where. */
typedef struct umb_planes_set {
    uint64_t edges[UMB_PLANES_WAYS];
    uint32_t nodes[UMB_PLANES_WAYS];
    uint32_t frames[UMB_PLANES_WAYS]; /* last asked for; 0: empty */
} umb_planes_set;

typedef struct umb_planes_cache {
    umb_planes_set *sets;
    umb_edge_planes *entries; /* UMB_PLANES_WAYS for each set */
    uint32_t set_count;       /* 0: nothing is kept */
    uint32_t frame;
    uint64_t version;         /* of the scene */
    umb_tangent_table table;
    umb_edge_planes spare;    /* used where nothing is kept */
    size_t set_capacity, entry_capacity;
    uint64_t kept, made;      /* boxes whose planes were there, and whose were not */
} umb_planes_cache;

/* Begin a frame over a scene. keep: else every question is answered anew. False without memory. */
bool umb_planes_cache_begin(umb_planes_cache *c, const umb_allocator *a, const umb_committed *scene, bool keep);
void umb_planes_cache_free(umb_planes_cache *c, const umb_allocator *a);

/* The planes of an edge for the boxes of a node that mask names; others may be missing. Valid until the next call. */
const umb_edge_planes *umb_planes_cache_get(umb_planes_cache *c, uint32_t node, const umb_node *boxes,
                                            const umb_blocker_edge *edge, uint32_t mask);

/* Tangent corners without a table: all planes through the edge and a corner, each held against all corners. What the
 * table is measured beside. */
bool umb_tangents_search(const float a[3], const float b[3], const umb_aabb *box, umb_tangents *out);

#endif

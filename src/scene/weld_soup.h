/* The triangles of all static objects in world coordinates, and the steps that a weld takes on
 * them.
 *
 * What blocks only ever shrinks: every step keeps the set of blocked sight-lines or takes some
 * away. */
#ifndef UMB_WELD_SOUP_H
#define UMB_WELD_SOUP_H

#include "base/scratch.h"
#include "scene_state.h"

typedef struct umb_weld_triangle {
    uint32_t v[3]; /* counter-clockwise from the front; v[0] is UMB_NONE when dropped */
    uint32_t object;
    uint32_t two_sided;
} umb_weld_triangle;

typedef struct umb_weld_soup {
    const umb_allocator *allocator;
    const umb_tasks *tasks;
    float (*positions)[3]; /* all different, -0 folded into 0 */
    umb_weld_triangle *triangles;
    size_t position_capacity, triangle_capacity;
    uint32_t position_count, triangle_count;
    uint32_t *parents; /* union-find over objects: which touch */
    uint32_t *merged;  /* per object that stands for those it touches: triangles saved by merging */
    uint32_t object_count;
    uint32_t mask; /* only objects of this one */
    umb_weld_stats stats;
} umb_weld_soup;

/* Half-edges sorted by their ends, so that those of one edge follow one another. */
typedef struct umb_weld_edges {
    uint64_t *keys;   /* lower vertex, higher vertex */
    uint32_t *halves; /* 3 * triangle + corner where it starts */
    uint32_t count;
} umb_weld_edges;

/* True for static objects that hide. */
static inline bool umb_weld_is_member(const umb_scene *scene, const umb_object_slot *slot)
{
    return (slot->flags & UMB_OBJECT_STATIC) != 0 && slot->mover == UMB_NONE && umb_scene_object_hides(scene, slot);
}

/* Collect the triangles of all static objects of the scene that hide, if they are of the soup's mask. */
umb_result umb_weld_soup_collect(umb_weld_soup *soup, umb_scene *scene);
void umb_weld_soup_free(umb_weld_soup *soup);

uint32_t umb_weld_soup_root(umb_weld_soup *soup, uint32_t object);
/* The two objects touch. */
void umb_weld_soup_unite(umb_weld_soup *soup, uint32_t a, uint32_t b);
/* Forget dropped triangles; the rest keeps its order. */
void umb_weld_soup_compact(umb_weld_soup *soup);

bool umb_weld_edges_build(umb_weld_edges *edges, umb_scratch *scratch, const umb_weld_soup *soup);
void umb_weld_edges_drop(umb_weld_edges *edges, umb_scratch *scratch);
/* End of the run of half-edges that share the edge of the one at begin. */
static inline uint32_t umb_weld_edges_end(const umb_weld_edges *edges, uint32_t begin)
{
    uint32_t end = begin + 1;
    while (end < edges->count && edges->keys[end] == edges->keys[begin]) {
        ++end;
    }
    return end;
}

/* Equal triangles are kept once, those face to face dropped where they lie between solids. False
 * when there is no memory, as for all below. */
bool umb_weld_seal(umb_weld_soup *soup);

/* Vertices that lie exactly on an edge that has no partner split it. */
bool umb_weld_split(umb_weld_soup *soup);

/* Objects with triangles at one edge touch. */
bool umb_weld_unite(umb_weld_soup *soup);

/* Vertices that a flat surface can do without are taken out. After umb_weld_unite(). */
bool umb_weld_merge(umb_weld_soup *soup);

/* Groups of objects that touch, cut into clusters with their meshes. On success *groups is an array
 * of the scratch memory; the caller owns the groups themselves. */
bool umb_weld_cluster(umb_weld_soup *soup, umb_scratch *scratch, uint32_t cluster_triangles, uint32_t ring,
                      umb_weld_group ***groups, uint32_t *group_count);

#endif

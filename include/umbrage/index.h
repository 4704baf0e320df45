/* A spatial index over the bounds of a scene's objects and occluders. Its own thing: cullers share
 * it. (Gummerus 3.1 to 3.2: hierarchies let hidden and outside things be skipped as a whole.) */
#ifndef UMBRAGE_INDEX_H
#define UMBRAGE_INDEX_H

#include "scene.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct umb_index umb_index;

typedef enum umb_index_kind {
    UMB_INDEX_BVH = 0,  /* bounding volume hierarchy, eight children a node, surface-area splits */
    UMB_INDEX_FLAT = 1, /* no hierarchy by place: rows of eight boxes in the order of their ids; the
                            raster method looks at every one, UMB_METHOD_NONE first at boxes around
                            runs of rows, which help as far as neighbours in the list are near */
    /* Space is cut by planes across an axis; what a plane cuts is in both halves, each with the box of its part. An
       object then is in several cells, is answered once, and is visible if any part of it may be seen (Gummerus 3.5) */
    UMB_INDEX_KDTREE = 2,
    /* A cube is cut in eight, each of these in eight, ...; a quadtree is cut across the two axes along which the scene
       spreads most (Gummerus 3.4) */
    UMB_INDEX_OCTREE = 3,
    UMB_INDEX_QUADTREE = 4,
    /* Cells of one size, an object in each that it reaches into, found through blocks of them (Gummerus 3.3) */
    UMB_INDEX_GRID = 5,
    /* Cut by the planes of triangles, of objects that are their shape (UMB_OBJECT_IS_SHAPE) and of occluders, else of the
       faces of boxes; an object is in each cell that its triangles reach into (Gummerus 3.6) */
    UMB_INDEX_BSP = 6
} umb_index_kind;

/* How a kind decides where to split. */
typedef enum umb_index_rule {
    /* BVH, KDTREE: by surface area. OCTREE, QUADTREE: in the middle; what planes cut is in several cells */
    UMB_RULE_DEFAULT = 0,
    /* KDTREE: axes in turn (Bentley); of the faces of boxes that leave at least three eighths on each side, the plane
       that cuts the fewest */
    UMB_RULE_MEDIAN = 1,
    /* OCTREE, QUADTREE: planes through the mean of what is in a cell, weighted by the inverse of its size; those that
       cut too much are left out; what the others cut stays with the cell, whole (Shagam and Pfeiffer 2003) */
    UMB_RULE_IRREGULAR = 2,
    /* OCTREE, QUADTREE: each object in one cell, that of its middle, of its own size or larger */
    UMB_RULE_LOOSE = 3,
    /* GRID: crowded cells have a grid of their own */
    UMB_RULE_NESTED = 4,
    /* BSP: of the largest triangles the plane that makes the halves small for what they hold (Naylor 1993). The default:
       of a few at random the one that cuts the fewest and divides most evenly (Abrash 1997) */
    UMB_RULE_NAYLOR = 5,
    /* KDTREE: across the longest side of what is in the cell, the face near its middle that cuts the fewest (Bittner 1998) */
    UMB_RULE_BITTNER = 6,
    /* KDTREE: the same, but what is about as large as its cell stays there (Aila and Miettinen) */
    UMB_RULE_AILA = 7,
    /* BVH: near objects are grouped, then near groups (Gummerus 3.1); Meister and Bittner 2018 */
    UMB_RULE_BOTTOM_UP = 8
} umb_index_rule;

/* As bits. */
enum {
    UMB_INDEX_SPLIT = 1u << 0, /* BSP: cut triangles in two; else one that is cut is in both halves as a whole */
    UMB_INDEX_NODES = 1u << 1, /* BSP: what lies in a plane stays with the node, between its halves; else it is below */
    /* BVH, one of the two at most: around each node, besides its box, a sphere, or a box turned as what is in it lies; looked
       at after the box where it is tighter (Gummerus 3.1). It follows what moves, comes and goes, whatever the update */
    UMB_INDEX_SPHERES = 1u << 2,
    UMB_INDEX_ORIENTED = 1u << 3
};

/* How the index follows what moves, comes and goes (Gummerus 3.8). What the frustum holds is found with every one of
 * them, exactly; they differ in what a commit costs and how good the index stays. FLAT has one way: lists are refitted,
 * and written anew when anything comes or goes. In all other indices what comes is inserted and what goes is taken out
 * at the cost of a way through the tree; subtrees that have seen many of both are built anew. */
typedef enum umb_index_update {
    UMB_UPDATE_DEFAULT = 0,       /* BVH: INCREMENTAL; others: REFIT */
    UMB_UPDATE_REFIT = 1,         /* boxes follow what moves, nothing else changes: cheapest, good for motion in place */
    UMB_UPDATE_DELETE_INSERT = 2, /* what moves is taken out and inserted from the top */
    UMB_UPDATE_LCA = 3, /* the same below the least common ancestor of the old and new place only (Sudarsky 1998) */
    /* What moves goes up to the first node that holds it, and down again when a culler has opened that node: at the
       commit after, so that cullers may share the index (Aila and Miettinen 2001) */
    UMB_UPDATE_LAZY = 4,
    /* Inserted at the deepest node that holds it, from the top; full nodes are split by planes through the weighted
       mean of what they hold (Shagam and Pfeiffer 2003) */
    UMB_UPDATE_DEEPEST = 5,
    /* Refitted; and when boxes have grown by a seventh the tree is built anew beside the one in use, half a millisecond
       or so each commit, and takes its place. Where few move, at most one in sixteen, what has made its node twice as large
       is put elsewhere instead. Other kinds than BVH: built anew at once when boxes have doubled, which allocates */
    UMB_UPDATE_INCREMENTAL = 6,
    /* GRID only, which is then one of overlapping voxels, scaled to unit cubes: an object belongs to the voxel of its box's
       minimum corner alone, and one that moves within it changes nothing else (Tai and Hsu 3.1) */
    UMB_UPDATE_OVERLAPPING = 7
} umb_index_update;

typedef struct umb_index_def {
    umb_index_kind kind;
    umb_index_rule rule;
    uint32_t options; /* UMB_INDEX_... bits */
    umb_index_update update;
    umb_tasks tasks; /* for building; the result does not depend on it */
} umb_index_def;

typedef struct umb_index_stats {
    uint32_t items;  /* objects and stand-alone occluders in it */
    uint32_t slots;  /* that name them: more than items where some are in several cells */
    uint32_t nodes;
    uint32_t depth;  /* nodes on the longest way from the root; 0 when empty */
    double cost;     /* expected boxes tested by a random ray, by surface area */
    size_t bytes;
} umb_index_stats;

/* Build an index over the scene as last committed. The scene must outlive it; later commits update
 * it, as def->update says; a commit that finds no memory for it leaves it behind (UMB_ERROR_MEMORY from the commit,
 * UMB_ERROR_STATE from its cullers), and the next one catches up. */
UMB_API umb_result umb_index_create(umb_scene *scene, const umb_index_def *def, umb_index **out);
/* NULL is allowed. Its cullers must be destroyed first. */
UMB_API void umb_index_destroy(umb_index *index);
UMB_API void umb_index_get_stats(const umb_index *index, umb_index_stats *out);
/* "bvh", "flat", "kdtree". */
UMB_API const char *umb_index_kind_name(umb_index_kind kind);

/* Indices by name: a kind, then words with commas between them that choose how it is built, such as "kdtree,median".
 * Sets all of *out but tasks; false if the text names none, and *out is left alone. */
UMB_API bool umb_index_parse(const char *text, umb_index_def *out);
/* The name that umb_index_parse() reads, with as few words as it takes; "unknown" if there is no such index. */
UMB_API const char *umb_index_name(const umb_index_def *def);
/* "default", "refit", "delete-insert", "lca", "lazy", "deepest", "incremental", "overlapping"; NULL if there is no such way. */
UMB_API const char *umb_index_update_name(umb_index_update update);
/* The way of that name; false if there is none, and *out is left alone. */
UMB_API bool umb_index_update_parse(const char *text, umb_index_update *out);
/* True if an index of this kind can follow its scene this way. */
UMB_API bool umb_index_can_update(const umb_index_def *def);
/* All the ways to build an index: the k-th name, NULL beyond the last. */
UMB_API const char *umb_index_variant(uint32_t k);

#ifdef __cplusplus
}
#endif
#endif

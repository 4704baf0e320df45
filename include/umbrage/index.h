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

/* BSP, as bits. */
enum {
    UMB_INDEX_SPLIT = 1u << 0, /* cut triangles in two; else one that is cut is in both halves as a whole */
    UMB_INDEX_NODES = 1u << 1  /* what lies in a plane stays with the node, between its halves; else it is below */
};

typedef struct umb_index_def {
    umb_index_kind kind;
    umb_index_rule rule;
    uint32_t options; /* UMB_INDEX_... bits */
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
 * it: moved boxes are refitted, additions and removals rebuild it. */
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
/* All the ways to build an index: the k-th name, NULL beyond the last. */
UMB_API const char *umb_index_variant(uint32_t k);

#ifdef __cplusplus
}
#endif
#endif

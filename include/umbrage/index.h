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
    UMB_INDEX_FLAT = 1  /* no hierarchy by place: rows of eight boxes in the order of their ids; the
                            raster method looks at every one, UMB_METHOD_NONE first at boxes around
                            runs of rows, which help as far as neighbours in the list are near */
} umb_index_kind;

typedef struct umb_index_def {
    umb_index_kind kind;
    umb_tasks tasks; /* for building; the result does not depend on it */
} umb_index_def;

typedef struct umb_index_stats {
    uint32_t items;  /* objects and stand-alone occluders in it */
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
/* "bvh", "flat". */
UMB_API const char *umb_index_kind_name(umb_index_kind kind);

#ifdef __cplusplus
}
#endif
#endif

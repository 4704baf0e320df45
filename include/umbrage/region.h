/* From-region visibility: which objects can be seen from anywhere in a view cell. (Library umbrage-bake.)
 *
 * A view cell is a box where the eye may be. The answer is a potentially visible set: every object of which some
 * point can be seen from some point of the cell is in it. The method is Leyvand's ray-space factorization
 * (thesis, 2003, chapter 2), made strict; docs/conservative.md has the proofs.
 *
 * What hides, from a region: closed meshes, taken as solids, that the cell does not reach into, and triangles that
 * the whole cell lies in front of (two-sided ones: beside). Everything else only can be seen.
 */
#ifndef UMBRAGE_REGION_H
#define UMBRAGE_REGION_H

#include "index.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct umb_region umb_region;

typedef struct umb_region_def {
    umb_isa isa;      /* AUTO by default; answers do not depend on it */
    umb_tasks tasks;  /* for looks at bodies and the refinement; answers do not depend on it */
    umb_error *error; /* text of failures; may be NULL; must outlive the engine */
} umb_region_def;

/* Which axis is the vertical: the method treats it apart from the other two, which suits what stands on a ground.
 * UMB_UP_NONE: there is none; rays are sorted by the axis that they run along most, into six maps instead of four. For
 * scenes that extend up and down as much as sideways; then an occlusion map holds no slopes above 1. */
typedef enum umb_region_up { UMB_UP_Y = 0, UMB_UP_Z = 1, UMB_UP_X = 2, UMB_UP_NONE = 3 } umb_region_up;

/* What is asked. Zeroed but for the box it means the default. */
typedef struct umb_region_query {
    double min[3], max[3]; /* the cell, closed, in the scene's coordinates (its origin subtracted). min <= max; flat
                              cells and single points are cells too */
    umb_region_up up;
    /* Pixels along each side of an occlusion map: 64 to 2048, rounded up to a multiple of 64; 0: 512. Maps by offset and slope
       have a fifth of the pixels of such a square at most (without a vertical, where there are six maps, a sixteenth). With one
       or two intervals: 11/8 N along the slope, more if the whole scene is far away, and along the offset what makes steps of
       about an eighth of an object's width at 512. Else N along the slope, or up to sixteen times as many (8192 at most) and
       fewer along the offset, where things are seen from far away for the cell's size. */
    uint32_t resolution;
    /* Intervals that are kept for each horizontal direction: 1 to 8; 0: 1 with half_umbra, 8 without a vertical, else 2. */
    uint32_t umbrae;
    /* Width of the outer square over the inner one, above 1 and at most 1e6; 0: rays by offset and slope, the
       limit of large squares, with half the maps. The thesis has 2. Without a vertical: 0. */
    double outer;
    /* Only occluders that reach down to the lowest point of scene and cell, of which only the top is kept (the
       thesis's half-umbra). Faster; hides less where things float, stand on pillars or hang. Needs a vertical. */
    bool half_umbra;
    /* Answer from the occlusion maps alone, as the thesis does: no look at single bodies after them. Larger sets, in less time. */
    bool maps_only;
    /* Sight-lines may start this far ahead of the eye: occluders within four times that distance of the cell are
       ignored. Then the set is right for views from within the cell whose near depth is at most near_depth and
       whose picture's corners are at most 75 degrees off the axis. 0: sight-lines start at the eye. */
    double near_depth;
} umb_region_query;

typedef struct umb_region_stats {
    uint32_t objects;           /* live objects of the scene */
    uint64_t triangles;         /* theirs, of all kinds */
    uint32_t mapped;            /* objects that the occlusion maps left; pvs is what bodies left of them */
    uint64_t mapped_triangles;  /* theirs */
    uint64_t pvs_triangles;     /* of the objects in pvs */
    uint64_t refined_triangles; /* of the objects in refined */
    uint32_t nodes;             /* nodes of the index opened */
    uint32_t queries;           /* boxes and objects asked about */
    uint32_t occluders;         /* occluders used */
    uint32_t patches;           /* pieces of theirs put into the occlusion maps */
    uint32_t undecided;         /* by the refinement: neither proved hidden nor met by a trial ray */
} umb_region_stats;

/* The answer. Borrowed: valid until the engine's next umb_region_solve. Ids ascend. */
typedef struct umb_region_answer {
    const uint32_t *pvs; /* from the occlusion maps, and what single bodies hide */
    uint32_t pvs_count;
    const uint32_t *refined; /* a subset of pvs, NULL before umb_region_refine */
    uint32_t refined_count;
    umb_region_stats stats;
} umb_region_answer;

/* Make an engine over an index, which must outlive it. One call at a time for each engine; several may read one
 * index at once. Memory comes from the scene's allocator. Errors: an instruction set that is not there, no
 * memory. */
UMB_API umb_result umb_region_create(umb_index *index, const umb_region_def *def, umb_region **out);
/* NULL is allowed. */
UMB_API void umb_region_destroy(umb_region *region);

/* The potentially visible set of one cell: from the occlusion maps, then each object that they leave is held against single
 * bodies, which are exact however far away they are (docs/conservative.md, T5). Bodies of occluders are found when a cell first uses
 * them and kept for the next cell of the same version of the scene. Safe direction: may report hidden objects;
 * never leaves out one of which a point can be seen from a point of the cell, provided every object's bounds
 * contain what is drawn for it. Objects that touch the cell are always in. Cost: proportional to what is in the
 * answer. Errors: UMB_ERROR_ARGUMENT for cells that are inverted, not finite or farther out than 1e15 and for numbers out
 * of range, UMB_ERROR_STATE after a commit that the index could not follow, no memory. *out is then empty. */
UMB_API umb_result umb_region_solve(umb_region *region, const umb_region_query *query, umb_region_answer *out);

/* Look again at what the last umb_region_solve left, object by object, in all directions alike: objects that are
 * proved hidden go, by solids that each block a part of the cell from a part of the object (thesis 3.1 names the
 * loss that this takes back). A cell wider than objects are is cut into parts, sixteen at most, which are solved one by one for what
 * is undecided then: what is hidden from all parts is hidden from the cell. effort: how many parts a single object, and again
 * its triangles if it is not a box, may be cut into before it stays in; 0: 512.
 * Safe direction: as above. *out is the whole answer again. Errors: UMB_ERROR_STATE without a solve before it,
 * no memory. */
UMB_API umb_result umb_region_refine(umb_region *region, uint32_t effort, umb_region_answer *out);

/* What an occlusion map holds for the rays of one pixel: beyond what blocks them, everything is hidden whose slopes
 * (height over horizontal distance, as all points of the cell see it) lie between bottom and top. */
typedef struct umb_region_pixel {
    float bottom, top; /* of the interval that reaches highest; INFINITY and -INFINITY: nothing is hidden.
                          -INFINITY, top: nothing passes below */
    bool live;         /* some ray of the method goes through the pixel */
} umb_region_pixel;

/* Copy an occlusion map after the last umb_region_solve, to look at, sampled to a square of the resolution: *side rows by where rays cross the inner square (or
 * their offset from the cell's middle), each of *side pixels by where they cross the outer one (or their slope). Maps are numbered from 0:
 * of the rays towards + and - of the axis after up (x, y, z, x), then of the one after that; with squares four more, of
 * the rays that leave the cell sideways; without a vertical of +x, -x, +y, -y, +z, -z, heights being along the axis two
 * after. Returns false, with the size only, when pixels is NULL or capacity is too
 * small; with side 0 when there is no such map. */
UMB_API bool umb_region_read_map(const umb_region *region, uint32_t map, umb_region_pixel *pixels, size_t capacity,
                                 uint32_t *side);

#ifdef __cplusplus
}
#endif
#endif

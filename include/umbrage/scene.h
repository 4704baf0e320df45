/* The scene: shapes, objects and occluders. It knows nothing of any eye.
 *
 * Changes are gathered and take effect at umb_scene_commit(), which also brings every index of the
 * scene up to date. Between commits any number of cullers may read the scene from any threads;
 * changing and committing need exclusive access.
 *
 * What hides: a triangle blocks from its front, the side from which its corners run
 * counter-clockwise (transforms that mirror are compensated), or from both sides when it is marked
 * two-sided. What can be seen: every triangle, from both sides, and everything inside an object's
 * bounds.
 */
#ifndef UMBRAGE_SCENE_H
#define UMBRAGE_SCENE_H

#include "geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct umb_scene umb_scene;

typedef struct umb_scene_def {
    umb_allocator allocator; /* zeroed: malloc and free */
    umb_error *error;        /* text of failures; may be NULL; must outlive the scene */
    double origin[3];        /* what was subtracted from the file's coordinates; kept, never used */
} umb_scene_def;

/* Per-triangle marks. */
enum {
    UMB_TRIANGLE_TWO_SIDED = 1u << 0, /* blocks from both sides */
    UMB_TRIANGLE_OPEN = 1u << 1       /* never blocks: glass, alpha-tested, liquids; can be seen */
};

/* Immutable geometry, shared by any number of objects. Everything is copied.
 * Degenerate triangles (zero area) are allowed: they never block. Non-finite positions and indices
 * out of range are UMB_ERROR_ARGUMENT. */
typedef struct umb_shape_def {
    const float *positions;  /* x, y, z of each vertex */
    uint32_t position_count; /* 1 to 2^30 */
    uint32_t position_stride; /* bytes from one vertex to the next; 0 means 12 */
    const uint32_t *indices; /* three per triangle */
    uint32_t index_count;    /* a multiple of 3 */
    const uint8_t *triangle_flags; /* UMB_TRIANGLE_*, one per triangle; NULL: all zero */
} umb_shape_def;

/* A shape's handle; 0 is none. */
typedef uint32_t umb_shape;

enum {
    UMB_OBJECT_STATIC = 1u << 0,  /* will not move: umb_scene_weld() may join it with its neighbours */
    UMB_OBJECT_NEVER_HIDES = 1u << 1, /* its shape is no occluder (an animated mesh, a detail) */
    UMB_OBJECT_IGNORED = 1u << 2, /* neither answered nor an occluder, until the flag is cleared */
    UMB_OBJECT_IS_SHAPE = 1u << 3 /* nothing is drawn for it but its shape: the boxes of the shape's parts
                                     may be tested in place of its bounds, which hides more */
};

/* One thing that is culled or kept as a whole. */
typedef struct umb_object_def {
    umb_aabb bounds;    /* world space; must contain the shape. All zero with a shape: the shape's own.
                           Non-finite or inverted bounds are UMB_ERROR_ARGUMENT */
    umb_shape shape;    /* 0: has bounds only and never hides anything */
    umb_transform transform; /* of the shape; all zero: the identity */
    uint32_t flags;     /* UMB_OBJECT_* */
} umb_object_def;

UMB_API umb_result umb_scene_create(const umb_scene_def *def, umb_scene **out);
/* Free the scene. Its indices and their cullers must be destroyed first. NULL is allowed. */
UMB_API void umb_scene_destroy(umb_scene *scene);

/* Copy a shape into the scene; builds its adjacency (which edges bound which triangles). */
UMB_API umb_result umb_scene_add_shape(umb_scene *scene, const umb_shape_def *def, umb_shape *out);

/* Add an object. Ids are dense from 0; an id freed by remove is given out again, lowest first,
 * after the next commit. */
UMB_API umb_result umb_scene_add_object(umb_scene *scene, const umb_object_def *def, uint32_t *out);
/* Give an object a new place. transform NULL: the identity; bounds NULL: the shape's own. Moving a
 * welded object dissolves the welds it is part of: their members hide by their own shapes. UMB_ERROR_STATE for objects
 * that move by themselves (motion.h). */
UMB_API umb_result umb_scene_move_object(umb_scene *scene, uint32_t object,
                                         const umb_transform *transform, const umb_aabb *bounds);
/* Replace the UMB_OBJECT_* flags of an object. Dissolves welds as moving does. */
UMB_API umb_result umb_scene_flag_object(umb_scene *scene, uint32_t object, uint32_t flags);
/* Take an object out. Dissolves welds as moving does. */
UMB_API umb_result umb_scene_remove_object(umb_scene *scene, uint32_t object);

/* Add a hand-made occluder that belongs to no object: it hides and is never answered.
 * Safe direction: it must lie inside what is drawn; the library cannot check that. */
UMB_API umb_result umb_scene_add_occluder(umb_scene *scene, umb_shape shape,
                                          const umb_transform *transform, uint32_t *out);
UMB_API umb_result umb_scene_remove_occluder(umb_scene *scene, uint32_t occluder);

/* How static neighbours are joined. */
typedef struct umb_weld_def {
    uint32_t cluster_triangles; /* triangles of one piece of a welded surface, at most; solids of up to
                                   sixteen times as many may stay whole; rings are not counted; 0: 16 */
    uint32_t ring;              /* how many rings of neighbouring triangles a cluster carries beyond its own,
                                   so that cuts between clusters are no cracks; 0: 1 */
    umb_tasks tasks;            /* for the search of T-junctions and the clustering */
} umb_weld_def;

typedef struct umb_weld_stats {
    uint32_t objects;      /* static objects whose shapes were looked at */
    uint32_t groups;       /* sets of objects that touch and were joined */
    uint32_t occluders;    /* welded occluders made */
    uint32_t triangles_in, triangles_out; /* blocking triangles before and after (rings not counted) */
    uint32_t duplicates;   /* triangles dropped because an equal one stays */
    uint32_t sealed;       /* triangles dropped in pairs that lie face to face */
    uint32_t t_junctions;  /* vertices found exactly on another triangle's edge and inserted there */
    uint32_t merged;       /* vertices taken out of flat surfaces and straight edges, which cover the same
                              points with fewer triangles */
} umb_weld_stats;

/* Join static objects that touch, by exactly equal vertex positions, into occluders of their own,
 * so that the seams between level faces or wall pieces are no cracks. Equal triangles are kept
 * once, triangles face to face are dropped, vertices that lie exactly on an edge split it. Then
 * surfaces that are exactly flat are made of fewer triangles, which cover the very same points.
 * What a welded occluder covers is a subset of what its objects' blocking triangles cover, plus
 * nothing. Objects that touch no other keep hiding by their own shape. Call it after the static
 * objects are in; calling it again redoes the work. Takes effect at the next commit. stats may be
 * NULL. */
UMB_API umb_result umb_scene_weld(umb_scene *scene, const umb_weld_def *def, umb_weld_stats *stats);

/* Make all changes visible to indices and cullers. */
UMB_API umb_result umb_scene_commit(umb_scene *scene);

/* Number of object ids in use or free: every id is below it. */
UMB_API uint32_t umb_scene_object_count(const umb_scene *scene);
/* Bounds of an object as committed; false if the id is free. Of one that moves by itself (motion.h): its volume. */
UMB_API bool umb_scene_object_bounds(const umb_scene *scene, uint32_t object, umb_aabb *out);
/* Number of occluders as committed: shapes of objects that hide by themselves, welded ones,
 * hand-made. */
UMB_API uint32_t umb_scene_occluder_count(const umb_scene *scene);
/* Box around all objects as committed; false if there is none. */
UMB_API bool umb_scene_bounds(const umb_scene *scene, umb_aabb *out);
/* Bytes held by the scene. */
UMB_API size_t umb_scene_memory(const umb_scene *scene);

#ifdef __cplusplus
}
#endif
#endif

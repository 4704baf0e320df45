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
    double origin[3];        /* what was subtracted from the file's coordinates; kept (umb_scene_get_origin) */
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
    uint32_t mask;      /* the layers that it is in, one a bit, for umb_view.mask; 0: in all of them */
    uint32_t tag;       /* the caller's own word about it: umb_scene_object_tag() */
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
/* The same with the place in doubles, relative to the scene's origin: transform's translation is not looked at, and its floats
 * become position rounded once, now and after every umb_scene_shift_origin(). */
UMB_API umb_result umb_scene_place_object(umb_scene *scene, uint32_t object, const umb_transform *transform,
                                          const double position[3], const umb_aabb *bounds);
/* Give an object another shape where it stands: another level of detail, a wall with a hole where it was shot. bounds NULL: the
 * shape's own; shape 0: it hides nothing, and bounds must be given. What the object hides is what the new shape hides, from the
 * next commit on, whose work is that of one change. Objects that move by themselves (motion.h) go on moving, with a volume made
 * anew for the shape; where that is given by hand it must hold the new shape too, and bounds are not looked at. Dissolves
 * welds as moving does. The old shape stays the scene's, for other objects. Errors: UMB_ERROR_ARGUMENT for numbers that are not in
 * use and bounds as in umb_scene_add_object(); nothing has changed then. */
UMB_API umb_result umb_scene_shape_object(umb_scene *scene, uint32_t object, umb_shape shape, const umb_aabb *bounds);
/* Replace the UMB_OBJECT_* flags of an object: hide it for a time (IGNORED), or let it hide nothing while it is open
 * (NEVER_HIDES). Dissolves welds as moving does. */
UMB_API umb_result umb_scene_flag_object(umb_scene *scene, uint32_t object, uint32_t flags);
/* Put an object into other layers (umb_object_def.mask), together with what it hides, from the next commit on, whose work
 * is that of a move. Dissolves welds as moving does, if the mask is another. */
UMB_API umb_result umb_scene_mask_object(umb_scene *scene, uint32_t object, uint32_t mask);
/* Give an object another tag, at once. The library never looks at tags. */
UMB_API umb_result umb_scene_tag_object(umb_scene *scene, uint32_t object, uint32_t tag);
/* The tag of an object; 0 for ids that are not in use. */
UMB_API uint32_t umb_scene_object_tag(const umb_scene *scene, uint32_t object);
/* Take an object out. Dissolves welds as moving does. */
UMB_API umb_result umb_scene_remove_object(umb_scene *scene, uint32_t object);

/* Add a hand-made occluder that belongs to no object: it hides and is never answered.
 * Safe direction: it must lie inside what is drawn; the library cannot check that. */
UMB_API umb_result umb_scene_add_occluder(umb_scene *scene, umb_shape shape,
                                          const umb_transform *transform, uint32_t *out);
UMB_API umb_result umb_scene_remove_occluder(umb_scene *scene, uint32_t occluder);
/* Let a hand-made occluder hide nothing while it is open, as a door does; it keeps its number. From the next commit on, whose
 * work is that of one change. */
UMB_API umb_result umb_scene_open_occluder(umb_scene *scene, uint32_t occluder, bool open);

/* Put a hand-made occluder into layers (umb_view.mask), from the next commit on; without, it is in all of them. Safe direction:
 * it must lie inside what is drawn for every view that it is in. */
UMB_API umb_result umb_scene_mask_occluder(umb_scene *scene, uint32_t occluder, uint32_t mask);

/* Move the origin by shift: what was at x is at x - shift, and umb_scene_get_origin() grows by shift. For worlds so large that
 * floats far from the origin are too coarse: keep it near the viewer. At once for calls, at the next commit for readers;
 * views, matrices and what the pose callback (motion.h) tells are in the new coordinates from then on.
 *   Every transform keeps its translation in doubles (those of umb_scene_place_object(), or what the floats were), of which
 * the floats are rounded: a vertex is off by at most half a step of floats at its new place, and errors of several
 * shifts do not add up. Where all translations and shifts are multiples of one step, at most 2^53 of it, and the floats hold
 * their differences (they do for multiples of the coarsest float step that gets nearer to the origin), nothing is rounded.
 * Bounds of shapes are found again; bounds given by hand, and volumes, are rounded outwards and grow by one float step.
 *   Welds are dissolved: weld again. Errors: UMB_ERROR_ARGUMENT if the shift is not finite or moves anything beyond the range
 * of floats; nothing has changed then. Cost: every object is moved. */
UMB_API umb_result umb_scene_shift_origin(umb_scene *scene, const double shift[3]);
/* The origin: umb_scene_def.origin and all shifts. Add it to a scene's coordinates to get the world's. */
UMB_API void umb_scene_get_origin(const umb_scene *scene, double out[3]);

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
 * nothing. Objects that touch no other keep hiding by their own shape; objects of different masks are not joined. Call it after the static
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
/* What there is, as committed. */
typedef struct umb_scene_stats {
    uint32_t objects;     /* ids in use */
    uint32_t ignored;     /* of them, those with UMB_OBJECT_IGNORED */
    uint32_t movers;      /* of them, those that move by themselves (motion.h) */
    uint32_t occluders;   /* shapes of objects that hide by themselves, and */
    uint32_t stand_alone; /* of these, welded and hand-made ones */
    uint32_t welds;       /* groups of objects that are joined */
    uint32_t shapes;
    uint64_t triangles;   /* of all shapes, each once */
    size_t bytes;         /* umb_scene_memory() */
} umb_scene_stats;

/* Looks at every object. */
UMB_API void umb_scene_get_stats(const umb_scene *scene, umb_scene_stats *out);
/* Bytes held by the scene. */
UMB_API size_t umb_scene_memory(const umb_scene *scene);

#ifdef __cplusplus
}
#endif
#endif

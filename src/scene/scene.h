/* What lower-level readers (index, occlusion, cull, capture) see of a scene, as last committed. */
#ifndef UMB_SCENE_H
#define UMB_SCENE_H

#include "motion.h"

/* Something that hides. World vertices are umb_transform_point(transform, position), or the
 * positions themselves when identity is set. */
typedef struct umb_occluder {
    const umb_mesh *mesh; /* at least one blocking triangle */
    umb_transform transform;
    umb_aabb bounds;      /* of its world vertices */
    uint32_t owner;       /* the object it belongs to; UMB_NONE for welded and hand-made ones */
    bool identity;
    bool mirrored;        /* the transform turns fronts into backs: compensate */
    bool moves;           /* its owner moves by itself: where it is comes out while the walk runs, so nobody
                             else may look at it */
} umb_occluder;

/* An object as committed. What a walk looks at comes first. */
typedef struct umb_object {
    umb_aabb bounds;
    const umb_mesh *mesh; /* NULL without a shape. Its parts refine the bounds */
    uint32_t occluder;    /* index of the occluder it owns, or UMB_NONE */
    uint32_t mover;       /* its number among those that move by themselves, or UMB_NONE. If it has one, bounds
                             are a volume that holds it for a time, and transform is out of date */
    bool used : 1;        /* the id is in use */
    bool live : 1;        /* in use and not UMB_OBJECT_IGNORED */
    bool identity : 1;
    bool exact : 1;       /* of a mover: at the scene's time it is like any other, bounds and transform say where it is */
    bool refine : 1;      /* UMB_OBJECT_IS_SHAPE: the mesh's parts say where it is */
    bool body : 1;        /* refine, and its shape is a convex body, all of which blocks: what its occluder is, if it
                             has one */
    bool boxed : 1;       /* body, and it is a box */
    bool box : 1;         /* boxed, and it stands along the axes: it is its bounds, to the bit */
    bool remasked : 1;    /* the version that last touched it gave it another mask, and no more than that or a move */
    umb_transform transform;
    uint32_t mask;        /* its layers (mask.h) */
} umb_object;

typedef struct umb_committed {
    const umb_object *objects;
    const umb_occluder *occluders; /* owned ones first, then stand-alone ones; numbers may change with structure */
    const uint32_t *occluder_masks; /* the layers of each occluder (mask.h) */
    uint32_t object_count, occluder_count;
    uint32_t first_free_occluder;  /* occluders from here on have no owner */
    uint64_t version;              /* grows by one with every commit that changed something */
    uint64_t structure;            /* grows by one when items came or went or changed flags, not when boxes moved */
    /* The change lists, each entry once. A reader that knows the version before this one needs no more to follow. */
    const uint32_t *moved;         /* live objects that this version gave another place or flags */
    uint32_t moved_count;
    uint32_t remasked_count;       /* of these, that are remasked */
    bool masked;                   /* some object or occluder has, or had, a mask */
    /* What the last growth of structure changed; a reader that knows the structure before follows by these. */
    const uint32_t *came, *went;   /* objects that are live now and were not; that were and are no more */
    const uint32_t *replaced;      /* occluder numbers, used before or now, that hold another occluder or none */
    uint32_t came_count, went_count, replaced_count;
    umb_motion motion;
} umb_committed;

/* What a culler has to say at a commit. */
typedef struct umb_testimony {
    const umb_posed *posed;  /* movers that it asked for */
    const uint32_t *shown;   /* numbers of exact ones that it reported */
    const uint32_t *tested;  /* numbers of those whose volumes it tested, and they were hidden: a part of these, each time */
    uint32_t posed_count, shown_count, tested_count;
    uint32_t frames;         /* that it answered */
} umb_testimony;

/* Cullers register to be asked at each commit what they saw of moving objects. It is theirs, and forgotten when forget is
 * set. Registering is safe from several threads at once, but not during a commit. */
typedef struct umb_scene_witness {
    umb_testimony (*tell)(void *user, bool forget);
    void *user;
    struct umb_scene_witness *next;
} umb_scene_witness;

void umb_scene_add_witness(umb_scene *scene, umb_scene_witness *witness);
void umb_scene_remove_witness(umb_scene *scene, umb_scene_witness *witness);

/* True if the promise of a mover is not certain. */
bool umb_scene_is_fuzzy(const umb_scene *scene, uint32_t mover);

const umb_committed *umb_scene_committed(const umb_scene *scene);

/* Indices register to be brought up to date by commits: update is called at the end of each. */
typedef struct umb_scene_listener {
    umb_result (*update)(void *user);
    void *user;
    struct umb_scene_listener *next;
} umb_scene_listener;

void umb_scene_listen(umb_scene *scene, umb_scene_listener *listener);
void umb_scene_unlisten(umb_scene *scene, umb_scene_listener *listener);

/* The origin that the scene was made with, three doubles. */
const double *umb_scene_origin(const umb_scene *scene);
const umb_allocator *umb_scene_allocator(const umb_scene *scene);
/* Fill in the scene's umb_error (if there is one) and return code. */
umb_result umb_scene_fail(const umb_scene *scene, umb_result code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif

/* The one interface of occlusion methods. A culler drives a method through a frame, in one of two ways.
 *
 * Methods that take occluders as the walk reaches them (the raster; cull/best_first.c):
 *
 *   prepare      the view and the committed scene; forget last frame's occluders
 *   hides        ask about a node's boxes; const, so that batches may be asked from several threads
 *   hidden       ask about one box, or one triangle in it
 *   occlude      add one occluder that the walk has reached
 *   look_ahead, help, finish: what other threads can do meanwhile
 *
 * Their questions carry the box's image on the raster, which that walk computes for its order anyway.
 *
 * Methods that choose their occluders first (depth-first, cull/chosen.c):
 *
 *   choose         the viewer, the committed scene and the index: choose the occluders of the frame, none that moves by
 *                  itself (umb_occluder.moves): nobody knows yet where those are
 *   ask            about a node's boxes, with the token that the answer about the node gave; answers hand
 *                  a token to each child: what is left to ask below it
 *   hides_object   about one object in more detail than its box
 *   make_ahead     what is made once for many frames
 *
 * That something is hidden is a promise; anything else is none.
 */
#ifndef UMB_METHOD_H
#define UMB_METHOD_H

#include "convex.h"
#include "coverage.h"
#include "frustum/box_kernels.h"
#include "raster_map.h"
#include "scene/mask.h"
#include "scene/scene.h"
#include "umbrage/cull.h"

/* The outer image of a box that lies beyond the near depth everywhere. */
typedef struct umb_image {
    umb_pixel_rect rect; /* x0 > x1: no pixel, the box is beside the raster */
    float nearness;      /* of its nearest point, rounded towards the eye */
} umb_image;

/* Who looks: from one point, along one direction, or from anywhere in a convex cell. */
typedef struct umb_viewer {
    const double (*points)[3]; /* the corners of the cell; one: the eye. Parallel: one, the direction that all
                                  sight-lines run in */
    uint32_t point_count;
    bool parallel;
    bool cut;                  /* what is nearer than the near plane hides nothing */
    double from[3], forward[3], near_depth; /* then, what is not nearer: forward . (p - from) >= near_depth */
} umb_viewer;

/* A frame for a method that chooses its occluders first. All of it lasts until the walk has ended. */
typedef struct umb_choice {
    umb_viewer viewer;
    const umb_view *view;
    const umb_frustum *frustum; /* of the view */
    const umb_committed *scene;
    const umb_tree *tree;
    uint32_t budget;    /* how many occluders to choose; 0: the method's default */
    uint32_t coherence; /* UMB_COHERENCE_... */
    umb_cull_stats *stats;
    umb_mask mask;      /* occluders of other layers are not there (scene.h, occluder_masks); 0: all are */
} umb_choice;

/* What an answer says about what is below: nothing of it is or will be hidden, it need not be asked about. */
#define UMB_TOKEN_CLEAR UMB_NONE
/* What the boxes of the root are asked with. */
#define UMB_TOKEN_ALL 0u

/* A question about the boxes of one node, and its answer. Questions come depth first: once a token is asked with,
 * those that were given out after it, for boxes of other nodes, are not used any more. */
typedef struct umb_query {
    const umb_node *boxes;
    uint32_t node;  /* the number of the node */
    uint32_t mask;  /* which boxes are asked about */
    uint32_t token; /* of the node; never UMB_TOKEN_CLEAR, then nothing is asked */
    uint32_t hidden; /* answer: a bit for each box that is hidden */
    uint32_t tokens[UMB_NODE_WIDTH]; /* answer: for each box asked about that is not hidden */
} umb_query;

/* Members that only one kind of method has are NULL for the other; what is marked optional may be NULL. */
typedef struct umb_method_ops {
    const char *name;
    umb_class class_;
    /* isa is one that is available. */
    umb_result (*create)(const umb_allocator *allocator, umb_isa isa, void **state);
    void (*destroy)(void *state);

    /* ---- methods that choose first ---- */
    umb_result (*choose)(void *state, const umb_choice *choice);
    void (*ask)(void *state, umb_query *query);
    /* True if the object, whose box is not hidden, is. token: that of its box. Optional. */
    bool (*hides_object)(void *state, uint32_t object, uint32_t token);
    /* Make ahead what choose() would make for frames to come; of the choice the view and what belongs to it is not
       looked at. */
    umb_result (*make_ahead)(void *state, const umb_choice *choice);

    /* ---- methods that take occluders as they come ---- */
    umb_result (*prepare)(void *state, const umb_raster_map *map, const umb_committed *scene);
    /* A bit for each box of mask that is hidden; all of them are testable and not beside the raster. */
    uint32_t (*hides)(const void *state, const umb_projected *boxes, uint32_t mask);
    /* outline: the box holds one triangle, this one; NULL: use all of the image. */
    bool (*hidden)(const void *state, const umb_image *image, const umb_outline *outline);
    /* True if the convex body whose surface an occluder is is hidden; the image is its bounds'. False says
       nothing. */
    bool (*hides_body)(void *state, const umb_object *object, const umb_image *image);
    /* True if something of this nearness at a raster point would surely not be found hidden: a cheap first
       question, whose answer false says nothing. */
    bool (*open_at)(const void *state, double x, double y, double nearness);
    /* box: NULL, or the box along the axes that the occluder is, to the bit. How many tiles of the buffer it
       changed; 0: no later answer differs for it. */
    uint32_t (*occlude)(void *state, uint32_t occluder, const umb_aabb *box, umb_cull_stats *stats);
    const umb_coverage *(*buffer)(const void *state);
    /* After prepare, for a walk beside which workers - 1 other threads are free: how many helpers this frame is
       worth. help may then be called once for each, at any time until finish or after it, while the thread of
       the walk calls what it likes of the above. Answers do not depend on any of it. */
    uint32_t (*look_ahead)(void *state, uint32_t workers);
    void (*help)(void *state, uint32_t helper);
    void (*finish)(void *state); /* the walk has ended: helpers return soon */
} umb_method_ops;

/* NULL for UMB_METHOD_NONE, which hides nothing. */
const umb_method_ops *umb_method_get(umb_method method);

extern const umb_method_ops umb_raster_method;
extern const umb_method_ops umb_shadow_frusta_method;
extern const umb_method_ops umb_occlusion_tree_method;

#endif

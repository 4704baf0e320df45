/* The one interface of occlusion methods. A culler drives a method through a frame:
 *
 *   prepare      the view and the committed scene; forget last frame's occluders
 *   hides        ask about a node's boxes; const, so that batches may be asked from several threads
 *   hidden       ask about one box, or one triangle in it
 *   occlude      add one occluder that the walk has reached
 *   look_ahead, help, finish: what other threads can do meanwhile
 *
 * Questions carry the box's image on the raster, which the walk computes for its order anyway. That
 * something is hidden is a promise; anything else is none.
 */
#ifndef UMB_METHOD_H
#define UMB_METHOD_H

#include "convex.h"
#include "coverage.h"
#include "frustum/box_kernels.h"
#include "raster_map.h"
#include "scene/scene.h"
#include "umbrage/cull.h"

/* The outer image of a box that lies beyond the near depth everywhere. */
typedef struct umb_image {
    umb_pixel_rect rect; /* x0 > x1: no pixel, the box is beside the raster */
    float nearness;      /* of its nearest point, rounded towards the eye */
} umb_image;

typedef struct umb_method_ops {
    const char *name;
    umb_class class_;
    /* isa is one that is available. */
    umb_result (*create)(const umb_allocator *allocator, umb_isa isa, void **state);
    void (*destroy)(void *state);
    umb_result (*prepare)(void *state, const umb_raster_map *map, const umb_committed *scene);
    /* A bit for each box of mask that is hidden; all of them are testable and not beside the raster. */
    uint32_t (*hides)(const void *state, const umb_projected *boxes, uint32_t mask);
    /* outline: the box holds one triangle, this one; NULL: use all of the image. */
    bool (*hidden)(const void *state, const umb_image *image, const umb_outline *outline);
    /* True if the convex body whose surface an occluder is is hidden; the image is its bounds'. False says
       nothing. */
    bool (*hides_body)(void *state, uint32_t occluder, const umb_image *image);
    /* True if something of this nearness at a raster point would surely not be found hidden: a cheap first
       question, whose answer false says nothing. */
    bool (*open_at)(const void *state, double x, double y, double nearness);
    /* How many tiles of the buffer it changed; 0: no later answer differs for it. */
    uint32_t (*occlude)(void *state, uint32_t occluder, umb_cull_stats *stats);
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

#endif

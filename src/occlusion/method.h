/* The one interface of occlusion methods. A culler drives a method through a frame:
 *
 *   prepare      the view and the committed scene; forget last frame's occluders
 *   submit       ask about boxes; const, so that batches may be asked from several threads
 *   occlude      add one occluder that the walk has reached
 *
 * Queries carry the box's image on the raster, which the walk computes for its order anyway, and
 * the box's reference in the tree. A verdict HIDDEN is a promise; anything else is none.
 */
#ifndef UMB_METHOD_H
#define UMB_METHOD_H

#include "coverage.h"
#include "raster_map.h"
#include "scene/scene.h"
#include "umbrage/cull.h"

/* The outer image of a box that lies beyond the near depth everywhere. */
typedef struct umb_image {
    umb_pixel_rect rect; /* x0 > x1: no pixel, the box is beside the raster */
    float nearness;      /* of its nearest point, rounded towards the eye */
} umb_image;

typedef struct umb_query {
    umb_image image;
    const umb_outline *outline; /* the box holds one triangle, this one; NULL: use all of the image */
    uint32_t ref; /* as in index/tree.h */
} umb_query;

typedef enum umb_verdict {
    UMB_VERDICT_HIDDEN,
    UMB_VERDICT_VISIBLE
} umb_verdict;

typedef struct umb_method_ops {
    const char *name;
    umb_class class_;
    umb_result (*create)(const umb_allocator *allocator, void **state);
    void (*destroy)(void *state);
    umb_result (*prepare)(void *state, const umb_raster_map *map, const umb_committed *scene);
    void (*submit)(const void *state, const umb_query *queries, uint32_t count, umb_verdict *verdicts);
    /* True if something of this nearness at a raster point would surely not be found hidden: a cheap first
       question, whose answer false says nothing. */
    bool (*open_at)(const void *state, double x, double y, double nearness);
    /* True if the answers to later queries may differ for it. */
    bool (*occlude)(void *state, uint32_t occluder, umb_cull_stats *stats);
    const umb_coverage *(*buffer)(const void *state);
} umb_method_ops;

/* NULL for UMB_METHOD_NONE, which hides nothing. */
const umb_method_ops *umb_method_get(umb_method method);

extern const umb_method_ops umb_raster_method;

#endif

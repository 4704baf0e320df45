/* A culler, and one frame of it. */
#ifndef UMB_CULLER_STATE_H
#define UMB_CULLER_STATE_H

#include "chosen.h"
#include "culler.h"
#include "filter.h"
#include "frustum/box_kernels.h"
#include "frustum/frustum.h"
#include "heap.h"
#include "in_view.h"
#include "index/tree.h"
#include "movers.h"
#include "occlusion/method.h"
#include "once.h"
#include "past.h"

struct umb_culler {
    umb_allocator allocator;
    const umb_index *index;
    umb_culler_def def;
    const umb_box_kernels *kernels;
    const umb_method_ops *ops; /* NULL: no occlusion */
    void *method;
    umb_heap heap;
    umb_in_view_room room; /* without occlusion, instead of the heap */
    umb_chosen_room chosen_room; /* with a method that chooses first, likewise */
    uint64_t *found;       /* entries of found.h as they are reported */
    uint64_t *scratch;     /* to sort them */
    uint32_t *objects;
    uint8_t *inside;
    double *rows;    /* the raster's table of rows */
    uint8_t *planes; /* per node: the plane that all its boxes failed last time (plane coherency) */
    size_t found_capacity, scratch_capacity, object_capacity, inside_capacity, plane_capacity, row_capacity;
    umb_past past;
    umb_once once;
    umb_movers movers;
    umb_filter filter;
    uint32_t count;
    bool answered;
    umb_view view;    /* of the last answer */
    uint64_t version; /* of the scene that it was given for */
    uint64_t commit;  /* after which it was given: the next one takes what was told of moving objects */
};

/* One frame's state. */
typedef struct umb_walk {
    umb_culler *culler;
    const umb_committed *scene;
    const umb_tree *tree;
    umb_frustum frustum;
    umb_raster_map map;
    umb_projector projector;
    const umb_view *view;
    umb_once *once; /* NULL: each item has one slot */
    const umb_filter *present; /* NULL: nothing is left out of the walk */
    float most_w;
    bool plain; /* each item has one slot, and none is too small: what is hidden is only counted */
    uint32_t drawn;
    uint32_t turns; /* since those were looked at that wait to be settled */
    uint32_t unlikely; /* occluders wanted though they hardly change anything */
    umb_cull_stats stats;
} umb_walk;

/* True if the method chooses its occluders before the walk. */
static inline bool umb_culler_chooses(const umb_culler *c)
{
    return c->ops != NULL && c->ops->choose != NULL;
}

#endif

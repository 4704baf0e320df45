/* What a frame leaves out: objects and occluders of other layers than the view's (umb_view.mask), and objects that are no
 * candidates. What is of other layers is left out where the walk meets it, so that it neither costs nor hides anything; the
 * rest is walked past as ever, and taken out of what was found. */
#ifndef UMB_FILTER_H
#define UMB_FILTER_H

#include "base/memory.h"
#include "frustum/box_kernels.h"
#include "scene/mask.h"
#include "scene/scene.h"
#include "umbrage/cull.h"

typedef struct umb_filter {
    const umb_committed *scene; /* of the frame */
    const umb_tree *tree;
    umb_mask mask;
    bool hides;                 /* what the mask leaves out hides nonetheless */
    bool restricted;            /* to candidates */
    uint32_t *candidates;       /* a bit for each object below candidate_count */
    uint32_t candidate_count;
    size_t capacity;
} umb_filter;

/* Copy a set of candidates; bits NULL: all objects are. False without memory: nothing has changed. */
bool umb_filter_restrict(umb_filter *f, const umb_allocator *a, const uint32_t *bits, uint32_t object_count);
void umb_filter_free(umb_filter *f, const umb_allocator *a);

/* Begin a frame. Returns what is to be left out of its walk, or NULL: nothing. */
const umb_filter *umb_filter_begin(umb_filter *f, const umb_view *view, const umb_committed *scene, const umb_tree *tree);

/* True if something may have to be taken out of what is found. */
static inline bool umb_filter_on(const umb_filter *f)
{
    return f->mask.bits != 0 || f->restricted;
}

/* True if an object is in the view's layers. */
static inline bool umb_filter_has(const umb_filter *f, uint32_t object)
{
    return umb_mask_takes(f->mask, f->scene->objects[object].mask);
}

/* The slots of slots that are in the view's layers, or nodes that may hold something in them: subtrees that are left out are so as
 * a whole. Objects that are left out one by one are counted. */
uint32_t umb_filter_present(const umb_filter *f, const umb_node *node, uint32_t slots, umb_cull_stats *stats);

/* Take out of what was found what is not to be reported; the rest keeps its order. Return how many are left. */
uint32_t umb_filter_entries(const umb_filter *f, uint64_t *entries, uint32_t count);
uint32_t umb_filter_ids(const umb_filter *f, uint32_t *objects, uint8_t *inside, uint32_t count);

#endif

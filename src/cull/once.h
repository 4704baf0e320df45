/* Frames over trees that hold items in parts (umb_tree.several): an object is answered once, an occluder drawn once, and
 * what is said of an object, its depth, its size, whether it lies inside the frustum, is said of its whole box. */
#ifndef UMB_ONCE_H
#define UMB_ONCE_H

#include "base/memory.h"
#include "frustum/box_kernels.h"
#include "index/tree.h"
#include "movers.h"
#include "umbrage/cull.h"

/* What has become of an item in this frame, as bits. */
enum {
    UMB_ONCE_MET = 1u << 0,     /* objects: a part of it was in the frustum and above no hidden node */
    UMB_ONCE_SETTLED = 1u << 1, /* objects: reported, or hidden as a whole */
    UMB_ONCE_DRAWN = 1u << 2,   /* occluders */
    UMB_ONCE_BITS = 3
};

/* Per item: the frame that it was last met in, and the bits of that frame. */
typedef struct umb_once {
    uint32_t *objects, *occluders;
    size_t object_capacity, occluder_capacity;
    uint32_t frame; /* 0: nothing is known */
} umb_once;

/* Begin a frame. False without memory. */
bool umb_once_begin(umb_once *o, const umb_allocator *a, const umb_committed *scene);
void umb_once_free(umb_once *o, const umb_allocator *a);

/* Set bits of an entry; true if they were set before. */
static inline bool umb_once_set(const umb_once *o, uint32_t *entry, uint32_t bits)
{
    bool known = *entry >> UMB_ONCE_BITS == o->frame, before = known && (*entry & bits) == bits;
    *entry = (known ? *entry : o->frame << UMB_ONCE_BITS) | bits;
    return before;
}

static inline bool umb_once_has(const umb_once *o, uint32_t entry, uint32_t bits)
{
    return entry >> UMB_ONCE_BITS == o->frame && (entry & bits) == bits;
}

/* What umb_once_finish() looks at. */
typedef struct umb_once_view {
    const umb_committed *scene;
    const umb_frustum *frustum;
    const umb_box_kernels *kernels;
    const umb_projector *projector;
    const umb_movers *movers; /* NULL: nothing moves. Else what is known of movers counts in place of their volumes */
} umb_once_view;

/* Look at count found objects again, by their whole boxes: those that are outside the frustum are dropped (they were met
 * in a list, or by what rounding adds to a part). Writes entries (found.h), or where entries is NULL ids and flags, over
 * what they were; returns how many are left. */
uint32_t umb_once_finish(const umb_once_view *v, const uint32_t *ids, uint32_t count, uint64_t *entries,
                         uint32_t *objects, uint8_t *inside);

#endif

/* The walk's queue: what is waiting, nearest first. Order is total, so that the walk is the same
 * everywhere: by key, then nodes before occluders before objects, then by number. */
#ifndef UMB_HEAP_H
#define UMB_HEAP_H

#include <string.h>

#include "base/memory.h"
#include "index/tree.h"
#include "occlusion/method.h"

typedef struct umb_waiting {
    float nearest;   /* least W of its box (raster_map.h): the key at first */
    float settled;   /* objects: the W beyond which nothing drawn can hide what keeps it visible */
    uint32_t ref;    /* index/tree.h */
    uint32_t node;   /* that it is in; UMB_NONE: it came by itself */
    uint32_t stamp;  /* how many occluders had been drawn when it was last tested */
    umb_image image; /* meaningful if testable */
    uint32_t part;   /* objects: parts before this one are hidden */
    uint16_t planes; /* frustum planes that its box may cross */
    bool testable;   /* in front of the eye everywhere */
    bool waited : 1; /* objects: its turn has come before, or it needs none; now it waits until it is settled */
    bool asked : 1;  /* objects: its shape has been asked about */
} umb_waiting;

/* What the heap moves about: its order, and where the rest is. The order holds, from the top bits down, the W
 * at which its turn comes, its rank (nodes, then occluders, then objects), and its number. */
typedef struct umb_heap_entry {
    uint64_t order;
    uint32_t slot;
} umb_heap_entry;

/* Put by, in no order: its turn has been, and it waits until a W is passed. */
typedef struct umb_put_by {
    float until;
    uint32_t slot;
} umb_put_by;

typedef struct umb_heap {
    umb_heap_entry *entries;
    umb_put_by *by;
    umb_waiting *slots;
    uint32_t *free; /* slots to use again */
    size_t count, by_count, free_count, used; /* used: slots ever handed out in this frame */
    size_t entry_capacity, by_capacity, slot_capacity, free_capacity;
} umb_heap;

/* Orders like the float does; -0 before 0. */
static inline uint32_t umb_heap_bits(float key)
{
    uint32_t bits;
    memcpy(&bits, &key, sizeof bits);
    return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
}

static inline float umb_heap_key(const umb_heap_entry *e)
{
    uint32_t bits = (uint32_t)(e->order >> 32);
    bits = (bits & 0x80000000u) != 0 ? bits & 0x7FFFFFFFu : ~bits;
    float key;
    memcpy(&key, &bits, sizeof key);
    return key;
}

static inline uint64_t umb_heap_order(float key, uint32_t ref)
{
    /* Kinds: node 0, object 1, occluder 2. Rank: node 0, occluder 1, object 2. */
    uint32_t rank = (0x18u >> (ref >> 29 & 6u)) & 3u;
    return (uint64_t)umb_heap_bits(key) << 32 | rank << 30 | (ref & UMB_REF_NUMBER);
}

bool umb_heap_reserve(umb_heap *h, const umb_allocator *a, size_t count);
void umb_heap_free(umb_heap *h, const umb_allocator *a);

/* Forget everything. */
static inline void umb_heap_clear(umb_heap *h)
{
    h->count = h->by_count = h->free_count = h->used = 0;
}

/* A slot to fill in and push. Room must have been reserved, here and below. */
static inline uint32_t umb_heap_take(umb_heap *h)
{
    return h->free_count > 0 ? h->free[--h->free_count] : (uint32_t)h->used++;
}

/* Give a slot back. */
static inline void umb_heap_give(umb_heap *h, uint32_t slot)
{
    h->free[h->free_count++] = slot;
}

static inline void umb_heap_put_by(umb_heap *h, float until, uint32_t slot)
{
    h->by[h->by_count++] = (umb_put_by){until, slot};
}

/* Of those put by, take out from first on, up to before end; the last ones move there. */
static inline void umb_heap_close_gap(umb_heap *h, size_t first, size_t end)
{
    size_t gone = end - first, after = h->by_count - end, moved = after < gone ? after : gone;
    for (size_t i = 0; i < moved; ++i) {
        h->by[first + i] = h->by[h->by_count - moved + i];
    }
    h->by_count -= gone;
}

void umb_heap_push(umb_heap *h, float key, uint32_t slot);
/* Take the first entry out; its slot stays the caller's, to push again or give back. */
umb_heap_entry umb_heap_pop(umb_heap *h);

#endif

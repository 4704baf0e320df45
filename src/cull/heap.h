/* The walk's queue: what is waiting, nearest first. Order is total, so that the walk is the same
 * everywhere: by key, then nodes before occluders before objects, then by number. */
#ifndef UMB_HEAP_H
#define UMB_HEAP_H

#include "base/memory.h"
#include "occlusion/method.h"

typedef struct umb_waiting {
    double key;      /* the view depth at which its turn comes */
    double nearest;  /* least view depth of its box: the key at first */
    double settled;  /* objects: the view depth beyond which nothing drawn can hide what keeps it visible */
    uint32_t ref;    /* index/tree.h */
    uint32_t stamp;  /* how many occluders had been drawn when it was last tested */
    umb_image image; /* meaningful if testable */
    uint32_t part;   /* objects: parts before this one are hidden */
    uint16_t planes; /* frustum planes that its box may cross */
    bool testable;   /* beyond the near depth everywhere */
    bool drawn;      /* objects: seen once, its occluder is in the buffer; waits until it is settled */
} umb_waiting;

typedef struct umb_heap {
    umb_waiting *items;
    size_t count, capacity;
} umb_heap;

static inline uint32_t umb_waiting_rank(uint32_t ref)
{
    /* Kinds: node 0, object 1, occluder 2. Rank: node 0, occluder 1, object 2. */
    return (0x18u >> (ref >> 29 & 6u)) & 3u;
}

static inline bool umb_waiting_before(const umb_waiting *a, const umb_waiting *b)
{
    if (a->key != b->key) {
        return a->key < b->key;
    }
    uint32_t ra = umb_waiting_rank(a->ref), rb = umb_waiting_rank(b->ref);
    return ra != rb ? ra < rb : a->ref < b->ref;
}

/* Room must have been reserved. */
static inline void umb_heap_push(umb_heap *h, const umb_waiting *item)
{
    size_t i = h->count++;
    while (i > 0 && umb_waiting_before(item, &h->items[(i - 1) / 2])) {
        h->items[i] = h->items[(i - 1) / 2];
        i = (i - 1) / 2;
    }
    h->items[i] = *item;
}

static inline umb_waiting umb_heap_pop(umb_heap *h)
{
    umb_waiting top = h->items[0];
    umb_waiting last = h->items[--h->count];
    size_t i = 0;
    for (size_t child = 1; child < h->count; child = 2 * i + 1) {
        child += child + 1 < h->count && umb_waiting_before(&h->items[child + 1], &h->items[child]);
        if (!umb_waiting_before(&h->items[child], &last)) {
            break;
        }
        h->items[i] = h->items[child];
        i = child;
    }
    h->items[i] = last;
    return top;
}

#endif

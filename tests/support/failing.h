/* An allocator that fails after a number of requests, and counts what is held. */
#ifndef FAILING_H
#define FAILING_H

#include <stdatomic.h>
#include <stdint.h>

#include "base/memory.h"

typedef struct failing {
    atomic_llong left; /* requests that still succeed */
    atomic_llong held; /* bytes */
} failing;

static inline void *failing_reallocate(void *user, void *old, size_t old_size, size_t new_size)
{
    failing *f = user;
    if (new_size > 0 && atomic_fetch_sub(&f->left, 1) <= 0) {
        return NULL;
    }
    umb_allocator a = umb_memory_allocator(NULL);
    void *p = a.reallocate(a.user, old, old_size, new_size);
    if (p != NULL || new_size == 0) {
        atomic_fetch_add(&f->held, (long long)new_size - (long long)(old != NULL ? old_size : 0));
    }
    return p;
}

static inline umb_allocator failing_allocator(failing *f, long long limit)
{
    atomic_store(&f->left, limit);
    atomic_store(&f->held, 0);
    umb_allocator a = {failing_reallocate, f};
    return a;
}

/* A small generator of numbers for tests: the same everywhere. */
typedef struct dice {
    uint64_t state;
} dice;

static inline uint32_t dice_roll(dice *d, uint32_t sides)
{
    d->state = d->state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)((d->state >> 33) % sides);
}

#endif

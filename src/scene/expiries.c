#include "expiries.h"

#include <math.h>

bool umb_expiries_reserve(umb_expiries *e, const umb_allocator *a, uint32_t count)
{
    return umb_memory_reserve(a, (void **)&e->heap, &e->heap_capacity, count, sizeof *e->heap) &&
           umb_memory_reserve_none(a, &e->places, &e->place_capacity, count);
}

void umb_expiries_free(umb_expiries *e, const umb_allocator *a)
{
    umb_memory_free(a, e->heap, e->heap_capacity * sizeof *e->heap);
    umb_memory_free(a, e->places, e->place_capacity * sizeof *e->places);
    *e = (umb_expiries){0};
}

size_t umb_expiries_memory(const umb_expiries *e)
{
    return e->heap_capacity * sizeof *e->heap + e->place_capacity * sizeof *e->places;
}

static void put(umb_expiries *e, uint32_t at, umb_expiry entry)
{
    e->heap[at] = entry;
    e->places[entry.mover] = at;
}

/* Let an entry sink or rise from a hole to where it belongs. */
static void settle(umb_expiries *e, uint32_t hole, umb_expiry entry)
{
    for (; hole > 0 && e->heap[(hole - 1) / 2].until > entry.until; hole = (hole - 1) / 2) {
        put(e, hole, e->heap[(hole - 1) / 2]);
    }
    for (;;) {
        uint32_t child = 2 * hole + 1;
        if (child + 1 < e->count && e->heap[child + 1].until < e->heap[child].until) {
            child += 1;
        }
        if (child >= e->count || e->heap[child].until >= entry.until) {
            break;
        }
        put(e, hole, e->heap[child]);
        hole = child;
    }
    put(e, hole, entry);
}

void umb_expiries_set(umb_expiries *e, uint32_t mover, double until)
{
    uint32_t at = e->places[mover];
    if (until < INFINITY) {
        settle(e, at == UMB_NONE ? e->count++ : at, (umb_expiry){until, mover});
    } else if (at != UMB_NONE) {
        umb_expiry last = e->heap[--e->count];
        e->places[mover] = UMB_NONE;
        if (last.mover != mover) {
            settle(e, at, last);
        }
    }
}

/* Below an entry that has not expired none has. The stack holds at most one entry a level beside the path. */
void umb_motion_expired(const umb_motion *motion, double time, void (*meet)(void *user, uint32_t mover), void *user)
{
    uint32_t stack[64], depth = 0;
    stack[depth++] = 0;
    while (depth > 0) {
        uint32_t at = stack[--depth];
        if (at < motion->expiry_count && motion->expiries[at].until < time) {
            meet(user, motion->expiries[at].mover);
            stack[depth++] = 2 * at + 2;
            stack[depth++] = 2 * at + 1;
        }
    }
}

#include "heap.h"

#include <string.h>

bool umb_heap_reserve(umb_heap *h, const umb_allocator *a, size_t count)
{
    return umb_memory_reserve(a, (void **)&h->entries, &h->entry_capacity, count,
                              sizeof *h->entries) &&
           umb_memory_reserve(a, (void **)&h->by, &h->by_capacity, count, sizeof *h->by) &&
           umb_memory_reserve(a, (void **)&h->slots, &h->slot_capacity, count, sizeof *h->slots) &&
           umb_memory_reserve(a, (void **)&h->free, &h->free_capacity, count, sizeof *h->free);
}

void umb_heap_free(umb_heap *h, const umb_allocator *a)
{
    umb_memory_free(a, h->entries, h->entry_capacity * sizeof *h->entries);
    umb_memory_free(a, h->by, h->by_capacity * sizeof *h->by);
    umb_memory_free(a, h->slots, h->slot_capacity * sizeof *h->slots);
    umb_memory_free(a, h->free, h->free_capacity * sizeof *h->free);
    memset(h, 0, sizeof *h);
}

/* Four children a place: half as deep, and the four lie in one cache line or two. */
#define WAYS 4

void umb_heap_push(umb_heap *h, float key, uint32_t slot)
{
    umb_heap_entry item = {umb_heap_order(key, h->slots[slot].ref), slot};
    size_t i = h->count++;
    while (i > 0 && item.order < h->entries[(i - 1) / WAYS].order) {
        h->entries[i] = h->entries[(i - 1) / WAYS];
        i = (i - 1) / WAYS;
    }
    h->entries[i] = item;
}

/* Of four, the first of the least; choices, not branches, which would be guessed wrong every other time. */
static inline size_t least_of_four(const umb_heap_entry *e, size_t first)
{
    size_t a = first + (e[first + 1].order < e[first].order);
    size_t b = first + 2 + (e[first + 3].order < e[first + 2].order);
    return e[b].order < e[a].order ? b : a;
}

/* The way down is that of the least children, to the end, and what was last is put in from there upwards: it nearly
 * always belongs close to the end. */
umb_heap_entry umb_heap_pop(umb_heap *h)
{
    umb_heap_entry *e = h->entries, top = e[0], last = e[--h->count];
    size_t i = 0, first = 1;
    for (; first + WAYS <= h->count; first = WAYS * i + 1) {
        size_t least = least_of_four(e, first);
        e[i] = e[least];
        i = least;
    }
    if (first < h->count) {
        size_t least = first;
        for (size_t k = first + 1; k < h->count; ++k) {
            least = e[k].order < e[least].order ? k : least;
        }
        e[i] = e[least];
        i = least;
    }
    while (i > 0 && last.order < e[(i - 1) / WAYS].order) {
        e[i] = e[(i - 1) / WAYS];
        i = (i - 1) / WAYS;
    }
    e[i] = last;
    return top;
}

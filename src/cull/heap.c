#include "heap.h"

#include <string.h>

bool umb_heap_reserve(umb_heap *h, const umb_allocator *a, size_t count)
{
    return umb_memory_reserve(a, (void **)&h->entries, &h->entry_capacity, count,
                              sizeof *h->entries) &&
           umb_memory_reserve(a, (void **)&h->slots, &h->slot_capacity, count, sizeof *h->slots) &&
           umb_memory_reserve(a, (void **)&h->free, &h->free_capacity, count, sizeof *h->free);
}

void umb_heap_free(umb_heap *h, const umb_allocator *a)
{
    umb_memory_free(a, h->entries, h->entry_capacity * sizeof *h->entries);
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

umb_heap_entry umb_heap_pop(umb_heap *h)
{
    umb_heap_entry top = h->entries[0];
    umb_heap_entry last = h->entries[--h->count];
    size_t i = 0;
    for (size_t first = 1; first < h->count; first = WAYS * i + 1) {
        size_t end = first + WAYS < h->count ? first + WAYS : h->count;
        size_t least = first;
        for (size_t k = first + 1; k < end; ++k) {
            least = h->entries[k].order < h->entries[least].order ? k : least;
        }
        if (h->entries[least].order >= last.order) {
            break;
        }
        h->entries[i] = h->entries[least];
        i = least;
    }
    h->entries[i] = last;
    return top;
}

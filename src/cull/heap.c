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

void umb_heap_push(umb_heap *h, float key, uint32_t slot)
{
    umb_heap_entry item = {key, h->slots[slot].ref, slot};
    size_t i = h->count++;
    while (i > 0 && umb_heap_before(&item, &h->entries[(i - 1) / 2])) {
        h->entries[i] = h->entries[(i - 1) / 2];
        i = (i - 1) / 2;
    }
    h->entries[i] = item;
}

umb_heap_entry umb_heap_pop(umb_heap *h)
{
    umb_heap_entry top = h->entries[0];
    umb_heap_entry last = h->entries[--h->count];
    size_t i = 0;
    for (size_t child = 1; child < h->count; child = 2 * i + 1) {
        child += child + 1 < h->count && umb_heap_before(&h->entries[child + 1], &h->entries[child]);
        if (!umb_heap_before(&h->entries[child], &last)) {
            break;
        }
        h->entries[i] = h->entries[child];
        i = child;
    }
    h->entries[i] = last;
    return top;
}

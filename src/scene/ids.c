#include "ids.h"

bool umb_ids_reserve(umb_ids *ids, const umb_allocator *allocator)
{
    size_t need = (size_t)ids->used + 1;
    return umb_memory_reserve(allocator, (void **)&ids->heap, &ids->heap_capacity, need,
                              sizeof *ids->heap) &&
           umb_memory_reserve(allocator, (void **)&ids->released, &ids->released_capacity, need,
                              sizeof *ids->released);
}

uint32_t umb_ids_peek(const umb_ids *ids)
{
    return ids->heap_count > 0 ? ids->heap[0] : ids->used;
}

uint32_t umb_ids_take(umb_ids *ids)
{
    if (ids->heap_count == 0) {
        return ids->used++;
    }
    uint32_t lowest = ids->heap[0], last = ids->heap[--ids->heap_count];
    uint32_t hole = 0, n = ids->heap_count;
    for (;;) {
        uint32_t child = 2 * hole + 1;
        if (child + 1 < n && ids->heap[child + 1] < ids->heap[child]) {
            child += 1;
        }
        if (child >= n || ids->heap[child] >= last) {
            break;
        }
        ids->heap[hole] = ids->heap[child];
        hole = child;
    }
    if (n > 0) {
        ids->heap[hole] = last;
    }
    return lowest;
}

void umb_ids_release(umb_ids *ids, uint32_t id)
{
    ids->released[ids->released_count++] = id;
}

void umb_ids_commit(umb_ids *ids)
{
    for (uint32_t i = 0; i < ids->released_count; ++i) {
        uint32_t hole = ids->heap_count++;
        while (hole > 0 && ids->heap[(hole - 1) / 2] > ids->released[i]) {
            ids->heap[hole] = ids->heap[(hole - 1) / 2];
            hole = (hole - 1) / 2;
        }
        ids->heap[hole] = ids->released[i];
    }
    ids->released_count = 0;
}

void umb_ids_free(umb_ids *ids, const umb_allocator *allocator)
{
    umb_memory_free(allocator, ids->heap, ids->heap_capacity * sizeof *ids->heap);
    umb_memory_free(allocator, ids->released, ids->released_capacity * sizeof *ids->released);
    *ids = (umb_ids){0};
}

size_t umb_ids_memory(const umb_ids *ids)
{
    return ids->heap_capacity * sizeof *ids->heap + ids->released_capacity * sizeof *ids->released;
}

#include "near_blockers.h"

#include <string.h>

static uint64_t key_of(uint32_t occluder, uint32_t facet)
{
    return ((uint64_t)occluder << 32 | facet) + 1; /* facet + 1: no key is 0 */
}

/* Where a key is, or would be. */
static uint32_t find(const umb_near_blockers *n, uint64_t key)
{
    uint32_t at = (uint32_t)(key * 0x9E3779B97F4A7C15u >> 32) & (n->size - 1);
    while (n->keys[at] != 0 && n->keys[at] != key) {
        at = (at + 1) & (n->size - 1);
    }
    return at;
}

bool umb_near_blockers_begin(umb_near_blockers *n, const umb_allocator *a, const umb_blockers *b)
{
    uint32_t size = 64;
    while (size < 4 * (b->count + UMB_NEAR_BLOCKERS_MOST)) {
        size *= 2;
    }
    if (!umb_memory_reserve(a, (void **)&n->keys, &n->key_capacity, size, sizeof *n->keys) ||
        !umb_memory_reserve(a, (void **)&n->numbers, &n->number_capacity, size, sizeof *n->numbers)) {
        return false;
    }
    memset(n->keys, 0, size * sizeof *n->keys);
    n->size = size;
    n->used = n->chosen = b->count;
    for (uint32_t i = 0; i < b->count; ++i) {
        uint64_t key = key_of(b->list[i].occluder, b->list[i].facet);
        uint32_t at = find(n, key);
        n->keys[at] = key;
        n->numbers[at] = i;
    }
    return true;
}

void umb_near_blockers_free(umb_near_blockers *n, const umb_allocator *a)
{
    umb_memory_free(a, n->keys, n->key_capacity * sizeof *n->keys);
    umb_memory_free(a, n->numbers, n->number_capacity * sizeof *n->numbers);
    *n = (umb_near_blockers){0};
}

uint32_t umb_near_blockers_get(umb_near_blockers *n, umb_blockers *b, const umb_chooser *c, const umb_leaf_entry *e)
{
    uint64_t key = key_of(e->occluder, e->facet);
    uint32_t at = find(n, key);
    if (n->keys[at] == 0) {
        if (n->used >= n->size / 2 || b->count >= n->chosen + UMB_NEAR_BLOCKERS_MOST) {
            return UMB_NONE;
        }
        umb_pick pick = umb_chooser_pick(c, e);
        umb_blocker_def def = {pick.place, pick.facets, pick.occluder, pick.set, pick.facet};
        n->keys[at] = key;
        n->numbers[at] = umb_blockers_add(b, &def) ? b->count - 1 : UMB_NONE;
        n->used += 1;
    }
    uint32_t number = n->numbers[at];
    return number != UMB_NONE && number >= n->chosen ? number : UMB_NONE;
}

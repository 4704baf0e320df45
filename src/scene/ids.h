/* Dense ids from 0. One that is released is given out again, lowest first, once the release has
 * been committed: until then readers of the committed state may still mean the old owner by it. */
#ifndef UMB_IDS_H
#define UMB_IDS_H

#include "base/memory.h"

typedef struct umb_ids {
    uint32_t *heap;     /* free ids, a binary heap with the lowest at the root */
    uint32_t *released; /* since the last commit */
    size_t heap_capacity, released_capacity;
    uint32_t heap_count, released_count;
    uint32_t used; /* ids ever given out: all are below */
} umb_ids;

/* Make room for one more id, so that the calls below cannot fail. */
bool umb_ids_reserve(umb_ids *ids, const umb_allocator *allocator);
/* The id that the next take will return. */
uint32_t umb_ids_peek(const umb_ids *ids);
uint32_t umb_ids_take(umb_ids *ids);
void umb_ids_release(umb_ids *ids, uint32_t id);
void umb_ids_commit(umb_ids *ids);
void umb_ids_free(umb_ids *ids, const umb_allocator *allocator);
size_t umb_ids_memory(const umb_ids *ids);

#endif

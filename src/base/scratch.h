/* Working memory of one long call: blocks are taken as needed and given back together, so that
 * every way out of the call frees everything. */
#ifndef UMB_SCRATCH_H
#define UMB_SCRATCH_H

#include "memory.h"

#define UMB_SCRATCH_BLOCKS 48

typedef struct umb_scratch {
    const umb_allocator *allocator;
    void *blocks[UMB_SCRATCH_BLOCKS];
    size_t sizes[UMB_SCRATCH_BLOCKS];
    uint32_t count;
    bool failed; /* some request was refused: look once, after the last of them */
} umb_scratch;

/* count elements of size bytes, uninitialised; NULL and failed set when there is no memory. */
void *umb_scratch_get(umb_scratch *s, size_t count, size_t size);
/* The same, zeroed. */
void *umb_scratch_get_zero(umb_scratch *s, size_t count, size_t size);
/* Give back a block before the others. NULL is allowed. */
void umb_scratch_drop(umb_scratch *s, void *block);
/* Give back everything. */
void umb_scratch_free(umb_scratch *s);

#endif

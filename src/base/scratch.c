#include "scratch.h"

#include <string.h>

void *umb_scratch_get(umb_scratch *s, size_t count, size_t size)
{
    if (s->failed || s->count == UMB_SCRATCH_BLOCKS || (size != 0 && count > SIZE_MAX / size)) {
        s->failed = true;
        return NULL;
    }
    void *p = umb_memory_allocate(s->allocator, count * size);
    if (p == NULL) {
        s->failed = true;
        return NULL;
    }
    s->blocks[s->count] = p;
    s->sizes[s->count] = count * size;
    s->count += 1;
    return p;
}

void *umb_scratch_get_zero(umb_scratch *s, size_t count, size_t size)
{
    void *p = umb_scratch_get(s, count, size);
    if (p != NULL) {
        memset(p, 0, count * size);
    }
    return p;
}

void umb_scratch_drop(umb_scratch *s, void *block)
{
    for (uint32_t i = 0; block != NULL && i < s->count; ++i) {
        if (s->blocks[i] == block) {
            umb_memory_free(s->allocator, block, s->sizes[i]);
            s->count -= 1;
            s->blocks[i] = s->blocks[s->count];
            s->sizes[i] = s->sizes[s->count];
            return;
        }
    }
}

void umb_scratch_free(umb_scratch *s)
{
    for (uint32_t i = 0; i < s->count; ++i) {
        umb_memory_free(s->allocator, s->blocks[i], s->sizes[i]);
    }
    s->count = 0;
}

/* The objects that a walk reports, and their order. */
#ifndef UMB_FOUND_H
#define UMB_FOUND_H

#include <stdbool.h>

#include "base/sort.h"

/* One word an object, in whose order objects are reported: by key, ties by id (which has 30 bits at most), and whether
 * its box is wholly inside the frustum. */
static inline uint64_t umb_found_entry(float key, uint32_t id, bool inside)
{
    return (uint64_t)umb_sort_float(key) << 32 | (uint64_t)id << 1 | (inside ? 1 : 0);
}

static inline uint32_t umb_found_id(uint64_t entry)
{
    return (uint32_t)entry >> 1;
}

static inline bool umb_found_inside(uint64_t entry)
{
    return (entry & 1) != 0;
}

#endif

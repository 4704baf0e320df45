/* The queue of expiries: which volume is the next that no longer holds. */
#ifndef UMB_EXPIRIES_H
#define UMB_EXPIRIES_H

#include "base/memory.h"
#include "motion.h"

typedef struct umb_expiries {
    umb_expiry *heap; /* the first to expire at the root */
    uint32_t *places; /* per mover: where in the heap it is, or UMB_NONE */
    size_t heap_capacity, place_capacity;
    uint32_t count;
} umb_expiries;

/* Make room for movers numbered below count, so that the calls below cannot fail. A new number is in no queue. */
bool umb_expiries_reserve(umb_expiries *e, const umb_allocator *a, uint32_t count);
void umb_expiries_free(umb_expiries *e, const umb_allocator *a);
size_t umb_expiries_memory(const umb_expiries *e);

/* Put a mover in, or change when it expires. INFINITY takes it out. */
void umb_expiries_set(umb_expiries *e, uint32_t mover, double until);

#endif

/* Memory through the caller's allocator, and arrays that grow. */
#ifndef UMB_MEMORY_H
#define UMB_MEMORY_H

#include "umbrage/base.h"

/* The allocator that a zeroed descriptor stands for: aligned malloc and free. */
umb_allocator umb_memory_allocator(const umb_allocator *given);

void *umb_memory_allocate(const umb_allocator *a, size_t bytes);
/* Zeroed; NULL on overflow of count * size too. */
void *umb_memory_allocate_zero(const umb_allocator *a, size_t count, size_t size);
void umb_memory_free(const umb_allocator *a, void *p, size_t bytes);

/* Make room for at least need elements of size bytes; *capacity counts elements. Keeps the
 * contents. Grows by half as much again. False when there is no memory: array and capacity stay as
 * they were. */
bool umb_memory_reserve(const umb_allocator *a, void **array, size_t *capacity, size_t need, size_t size);

/* The same for arrays whose new elements are to be zero; and for numbers, new ones UMB_NONE. */
bool umb_memory_reserve_zero(const umb_allocator *a, void **array, size_t *capacity, size_t need, size_t size);
bool umb_memory_reserve_none(const umb_allocator *a, uint32_t **array, size_t *capacity, size_t need);

/* Fill in an error, if there is one, and return code. */
umb_result umb_error_set(umb_error *error, umb_result code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Run through tasks, or in a plain loop when tasks is zeroed. */
void umb_tasks_run(const umb_tasks *tasks, void (*task)(void *data, uint32_t i), void *data,
                   uint32_t count);

#endif

#if defined(__linux__)
#define _DEFAULT_SOURCE /* madvise */
#include <sys/mman.h>
#endif

#include "memory.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ALIGNMENT 64u
/* Blocks of at least LARGE bytes are asked for in pages of this size: a walk looks here and there into trees and lists
 * of a million objects, and would look up a page each time. */
#define LARGE_PAGE ((size_t)1 << 21)
#define LARGE (2 * LARGE_PAGE)

/* NULL without memory. */
static void *allocate(size_t size)
{
    size_t alignment = size >= LARGE ? LARGE_PAGE : ALIGNMENT;
    if (size > SIZE_MAX - alignment) {
        return NULL;
    }
    /* aligned_alloc wants a multiple of the alignment. */
    size_t whole = (size + alignment - 1) & ~(alignment - 1);
    void *p = aligned_alloc(alignment, whole);
#if defined(MADV_HUGEPAGE)
    if (p != NULL && size >= LARGE) {
        (void)madvise(p, whole, MADV_HUGEPAGE); /* a wish */
    }
#endif
    return p;
}

static void *default_reallocate(void *user, void *old, size_t old_size, size_t new_size)
{
    (void)user;
    if (new_size == 0) {
        free(old);
        return NULL;
    }
    void *p = allocate(new_size); /* realloc would lose the alignment */
    if (p != NULL && old != NULL) {
        memcpy(p, old, old_size < new_size ? old_size : new_size);
        free(old);
    }
    return p;
}

umb_allocator umb_memory_allocator(const umb_allocator *given)
{
    if (given != NULL && given->reallocate != NULL) {
        return *given;
    }
    umb_allocator a = {default_reallocate, NULL};
    return a;
}

void *umb_memory_allocate(const umb_allocator *a, size_t bytes)
{
    /* Nothing to hold is still a success: callers tell failure by NULL. */
    return a->reallocate(a->user, NULL, 0, bytes == 0 ? 1 : bytes);
}

void *umb_memory_allocate_zero(const umb_allocator *a, size_t count, size_t size)
{
    if (size != 0 && count > SIZE_MAX / size) {
        return NULL;
    }
    size_t bytes = count * size;
    void *p = umb_memory_allocate(a, bytes);
    if (p != NULL) {
        memset(p, 0, bytes);
    }
    return p;
}

void umb_memory_free(const umb_allocator *a, void *p, size_t bytes)
{
    if (p != NULL) {
        a->reallocate(a->user, p, bytes == 0 ? 1 : bytes, 0);
    }
}

bool umb_memory_reserve(const umb_allocator *a, void **array, size_t *capacity, size_t need,
                        size_t size)
{
    if (need <= *capacity) {
        return true;
    }
    size_t grown = *capacity + *capacity / 2;
    size_t wanted = grown > need ? grown : need;
    if (size != 0 && wanted > SIZE_MAX / size) {
        return false;
    }
    void *p = a->reallocate(a->user, *array, *capacity * size, wanted * size);
    if (p == NULL) {
        return false;
    }
    *array = p;
    *capacity = wanted;
    return true;
}

/* New elements filled with a byte. */
static bool fill_new(void *array, size_t known, size_t capacity, size_t size, int byte)
{
    if (capacity > known) {
        memset((char *)array + known * size, byte, (capacity - known) * size);
    }
    return true;
}

bool umb_memory_reserve_zero(const umb_allocator *a, void **array, size_t *capacity, size_t need, size_t size)
{
    size_t known = *capacity;
    return umb_memory_reserve(a, array, capacity, need, size) && fill_new(*array, known, *capacity, size, 0);
}

bool umb_memory_reserve_none(const umb_allocator *a, uint32_t **array, size_t *capacity, size_t need)
{
    size_t known = *capacity;
    return umb_memory_reserve(a, (void **)array, capacity, need, sizeof **array) &&
           fill_new(*array, known, *capacity, sizeof **array, 0xFF);
}

umb_result umb_error_set(umb_error *error, umb_result code, const char *format, ...)
{
    if (error != NULL) {
        va_list arguments;
        va_start(arguments, format);
        error->code = code;
        error->text[0] = '\0';
        (void)vsnprintf(error->text, sizeof error->text, format, arguments);
        va_end(arguments);
    }
    return code;
}

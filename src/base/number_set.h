/* A set of numbers that finds its members in order: a bit each, and a bit for each word that is not zero. */
#ifndef UMB_NUMBER_SET_H
#define UMB_NUMBER_SET_H

#include "memory.h"

typedef struct umb_number_set {
    uint64_t *bits, *words;
    size_t bit_capacity, word_capacity; /* in words of 64 */
    uint32_t count;
} umb_number_set;

/* Make room for numbers below limit. Keeps the members. */
bool umb_number_set_reserve(umb_number_set *s, const umb_allocator *a, uint32_t limit);
void umb_number_set_free(umb_number_set *s, const umb_allocator *a);
size_t umb_number_set_memory(const umb_number_set *s);
void umb_number_set_clear(umb_number_set *s);
/* The lowest member that is at least from; UMB_NONE if there is none. */
uint32_t umb_number_set_next(const umb_number_set *s, uint32_t from);

static inline bool umb_number_set_has(const umb_number_set *s, uint32_t number)
{
    return (number >> 6) < s->bit_capacity && (s->bits[number >> 6] >> (number & 63) & 1u) != 0;
}

static inline void umb_number_set_add(umb_number_set *s, uint32_t number)
{
    s->count += umb_number_set_has(s, number) ? 0u : 1u;
    s->bits[number >> 6] |= (uint64_t)1 << (number & 63);
    s->words[number >> 12] |= (uint64_t)1 << (number >> 6 & 63);
}

static inline void umb_number_set_remove(umb_number_set *s, uint32_t number)
{
    if (!umb_number_set_has(s, number)) {
        return;
    }
    s->count -= 1;
    s->bits[number >> 6] &= ~((uint64_t)1 << (number & 63));
    if (s->bits[number >> 6] == 0) {
        s->words[number >> 12] &= ~((uint64_t)1 << (number >> 6 & 63));
    }
}

#endif

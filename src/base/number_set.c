#include "number_set.h"

#include <string.h>

bool umb_number_set_reserve(umb_number_set *s, const umb_allocator *a, uint32_t limit)
{
    size_t bits = ((size_t)limit + 63) / 64;
    /* Words for all the bits that there is room for. */
    return umb_memory_reserve_zero(a, (void **)&s->bits, &s->bit_capacity, bits, sizeof *s->bits) &&
           umb_memory_reserve_zero(a, (void **)&s->words, &s->word_capacity, s->bit_capacity / 64 + 1, sizeof *s->words);
}

void umb_number_set_free(umb_number_set *s, const umb_allocator *a)
{
    umb_memory_free(a, s->bits, s->bit_capacity * sizeof *s->bits);
    umb_memory_free(a, s->words, s->word_capacity * sizeof *s->words);
    *s = (umb_number_set){0};
}

size_t umb_number_set_memory(const umb_number_set *s)
{
    return (s->bit_capacity + s->word_capacity) * sizeof *s->bits;
}

void umb_number_set_clear(umb_number_set *s)
{
    if (s->count > 0) {
        memset(s->bits, 0, s->bit_capacity * sizeof *s->bits);
        memset(s->words, 0, s->word_capacity * sizeof *s->words);
        s->count = 0;
    }
}

uint32_t umb_number_set_next(const umb_number_set *s, uint32_t from)
{
    size_t word = from >> 6;
    if (word >= s->bit_capacity) {
        return UMB_NONE;
    }
    uint64_t left = s->bits[word] >> (from & 63);
    if (left != 0) {
        return from + (uint32_t)__builtin_ctzll(left);
    }
    size_t next = word + 1; /* of the words, the first that may hold more */
    uint64_t mask = (next & 63) != 0 ? ~(uint64_t)0 << (next & 63) : ~(uint64_t)0;
    for (size_t w = next >> 6; w < s->word_capacity; ++w, mask = ~(uint64_t)0) {
        uint64_t words = s->words[w] & mask;
        if (words != 0) {
            size_t k = w << 6 | (size_t)__builtin_ctzll(words);
            return (uint32_t)(k << 6) | (uint32_t)__builtin_ctzll(s->bits[k]);
        }
    }
    return UMB_NONE;
}

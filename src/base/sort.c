#include "sort.h"

#define DIGIT_BITS 8
#define DIGITS 8
#define DIGIT_VALUES (1u << DIGIT_BITS)
#define INSERTION_LIMIT 48u

static void insertion_sort(uint64_t *keys, uint32_t *values, size_t count)
{
    for (size_t i = 1; i < count; ++i) {
        uint64_t key = keys[i];
        uint32_t value = values[i];
        size_t j = i;
        while (j > 0 && keys[j - 1] > key) {
            keys[j] = keys[j - 1];
            values[j] = values[j - 1];
            --j;
        }
        keys[j] = key;
        values[j] = value;
    }
}

/* One pass of the least-significant-digit-first radix sort. */
static void scatter(const uint64_t *keys, const uint32_t *values, uint64_t *to_keys,
                    uint32_t *to_values, size_t count, uint32_t shift, size_t *starts)
{
    for (size_t i = 0; i < count; ++i) {
        size_t to = starts[(keys[i] >> shift) & (DIGIT_VALUES - 1)]++;
        to_keys[to] = keys[i];
        to_values[to] = values[i];
    }
}

void umb_sort_keys(uint64_t *keys, uint32_t *values, uint64_t *key_scratch, uint32_t *value_scratch,
                   size_t count)
{
    if (count <= INSERTION_LIMIT) {
        insertion_sort(keys, values, count);
        return;
    }
    uint64_t differ = 0;
    for (size_t i = 1; i < count; ++i) {
        differ |= keys[i] ^ keys[0];
    }
    uint64_t *from_keys = keys, *to_keys = key_scratch;
    uint32_t *from_values = values, *to_values = value_scratch;
    for (uint32_t digit = 0; digit < DIGITS; ++digit) {
        uint32_t shift = digit * DIGIT_BITS;
        if (((differ >> shift) & (DIGIT_VALUES - 1)) == 0) {
            continue; /* all keys agree here: the pass would change nothing */
        }
        size_t starts[DIGIT_VALUES] = {0};
        for (size_t i = 0; i < count; ++i) {
            starts[(from_keys[i] >> shift) & (DIGIT_VALUES - 1)] += 1;
        }
        size_t sum = 0;
        for (uint32_t v = 0; v < DIGIT_VALUES; ++v) {
            size_t n = starts[v];
            starts[v] = sum;
            sum += n;
        }
        scatter(from_keys, from_values, to_keys, to_values, count, shift, starts);
        uint64_t *k = from_keys;
        from_keys = to_keys;
        to_keys = k;
        uint32_t *v = from_values;
        from_values = to_values;
        to_values = v;
    }
    if (from_keys != keys) {
        memcpy(keys, from_keys, count * sizeof *keys);
        memcpy(values, from_values, count * sizeof *values);
    }
}

/* ---- words ---------------------------------------------------------------------------------- */

#define FEW 64u      /* words that are sorted by insertion */
#define MANY 8192u   /* words for which three passes over long tables beat four over short ones */
#define MOST_BITS 11

static void insert_words(uint64_t *words, size_t count)
{
    for (size_t i = 1; i < count; ++i) {
        uint64_t word = words[i];
        size_t j = i;
        while (j > 0 && words[j - 1] > word) {
            words[j] = words[j - 1];
            --j;
        }
        words[j] = word;
    }
}

/* Sort by the 32 bits from shift on. */
static uint64_t *sort_half(uint64_t *words, uint64_t *scratch, size_t count, uint32_t shift)
{
    uint32_t bits = count < MANY ? 8 : MOST_BITS;
    uint32_t values = 1u << bits;
    for (uint32_t done = 0; done < 32; done += bits) {
        uint32_t at = shift + done, mask = 32 - done < bits ? (1u << (32 - done)) - 1 : values - 1;
        uint32_t starts[1u << MOST_BITS];
        memset(starts, 0, values * sizeof starts[0]);
        for (size_t i = 0; i < count; ++i) {
            starts[(words[i] >> at) & mask] += 1;
        }
        if (starts[(words[0] >> at) & mask] == count) {
            continue; /* all agree here */
        }
        uint32_t sum = 0;
        for (uint32_t v = 0; v < values; ++v) {
            uint32_t n = starts[v];
            starts[v] = sum;
            sum += n;
        }
        for (size_t i = 0; i < count; ++i) {
            scratch[starts[(words[i] >> at) & mask]++] = words[i];
        }
        uint64_t *swap = words;
        words = scratch;
        scratch = swap;
    }
    return words;
}

uint64_t *umb_sort_words(uint64_t *words, uint64_t *scratch, size_t count)
{
    size_t ordered = 1;
    while (ordered < count && words[ordered - 1] <= words[ordered]) {
        ++ordered;
    }
    if (ordered >= count) {
        return words;
    }
    if (count <= FEW) {
        insert_words(words, count);
        return words;
    }
    uint64_t *sorted = sort_half(words, scratch, count, 32);
    uint64_t *other = sorted == words ? scratch : words;
    for (size_t first = 0, end; first < count; first = end) {
        end = first + 1;
        while (end < count && sorted[end] >> 32 == sorted[first] >> 32) {
            ++end;
        }
        if (end - first <= FEW) {
            insert_words(sorted + first, end - first);
        } else if (sort_half(sorted + first, other + first, end - first, 0) != sorted + first) {
            memcpy(sorted + first, other + first, (end - first) * sizeof *sorted);
        }
    }
    return sorted;
}

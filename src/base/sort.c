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

/* Sorting by 64-bit keys, stable, in time proportional to the number of elements. */
#ifndef UMB_SORT_H
#define UMB_SORT_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Sort keys ascending and carry values along. The scratch arrays hold count elements each. */
void umb_sort_keys(uint64_t *keys, uint32_t *values, uint64_t *key_scratch, uint32_t *value_scratch,
                   size_t count);

/* Sort words ascending. scratch holds count elements, too; returns the one of the two that holds the result. In time
 * proportional to count where the upper halves differ, and never much more. */
uint64_t *umb_sort_words(uint64_t *words, uint64_t *scratch, size_t count);

/* An unsigned number in the order of the float; -0 and 0 are equal. f is no NaN. */
static inline uint32_t umb_sort_float(float f)
{
    uint32_t bits;
    f += 0.0f;
    memcpy(&bits, &f, sizeof bits);
    return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
}

#endif

/* Whole numbers of up to 2,048 bits, for signs that nothing shorter can tell. */
#ifndef UMB_BIGINT_H
#define UMB_BIGINT_H

#include <stdbool.h>
#include <stdint.h>

#define UMB_BIGINT_LIMBS 64

/* sign times the sum of limb[i] 2^(32 i); count is without leading zeros, 0 for 0. */
typedef struct umb_bigint {
    int32_t sign;
    uint32_t count;
    uint32_t limb[UMB_BIGINT_LIMBS];
} umb_bigint;

/* v 2^shift, if that is a whole number below 2^127; false if not. */
bool umb_bigint_from_double(double v, int shift, umb_bigint *out);
/* The product must have room: count of a and of b add up to at most UMB_BIGINT_LIMBS. out is neither. */
void umb_bigint_multiply(const umb_bigint *a, const umb_bigint *b, umb_bigint *out);
/* a + sign b; sign is 1 or -1. The result must have room; out may be a or b. */
void umb_bigint_add(const umb_bigint *a, const umb_bigint *b, int sign, umb_bigint *out);

#endif

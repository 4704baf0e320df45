#include "bigint.h"

#include <math.h>
#include <string.h>

static void trim(umb_bigint *n)
{
    while (n->count > 0 && n->limb[n->count - 1] == 0) {
        n->count -= 1;
    }
    n->sign = n->count == 0 ? 0 : n->sign;
}

bool umb_bigint_from_double(double v, int shift, umb_bigint *out)
{
    out->count = 0;
    out->sign = 0;
    if (v == 0.0) {
        return true;
    }
    if (!isfinite(v)) {
        return false;
    }
    int exponent;
    double half = frexp(v, &exponent);
    uint64_t digits = (uint64_t)ldexp(fabs(half), 53);
    int up = exponent - 53 + shift;
    if (up < 0) {
        if (up <= -53 || (digits & ((1ull << -up) - 1)) != 0) {
            return false;
        }
        digits >>= -up;
        up = 0;
    }
    if (up > 127 - 53) {
        return false;
    }
    uint32_t whole = (uint32_t)up / 32, rest = (uint32_t)up % 32;
    memset(out->limb, 0, sizeof out->limb[0] * (whole + 3));
    out->limb[whole] = (uint32_t)(digits << rest);
    out->limb[whole + 1] = (uint32_t)(digits >> (32 - rest));
    out->limb[whole + 2] = rest != 0 ? (uint32_t)(digits >> (64 - rest)) : 0;
    out->count = whole + 3;
    out->sign = v < 0.0 ? -1 : 1;
    trim(out);
    return true;
}

void umb_bigint_multiply(const umb_bigint *a, const umb_bigint *b, umb_bigint *out)
{
    out->sign = a->sign * b->sign;
    out->count = 0;
    if (out->sign == 0) {
        return;
    }
    out->count = a->count + b->count;
    memset(out->limb, 0, sizeof out->limb[0] * out->count);
    for (uint32_t i = 0; i < a->count; ++i) {
        uint64_t carry = 0;
        for (uint32_t j = 0; j < b->count; ++j) {
            carry += (uint64_t)a->limb[i] * b->limb[j] + out->limb[i + j];
            out->limb[i + j] = (uint32_t)carry;
            carry >>= 32;
        }
        out->limb[i + b->count] = (uint32_t)carry;
    }
    trim(out);
}

static int compare_sizes(const umb_bigint *a, const umb_bigint *b)
{
    if (a->count != b->count) {
        return a->count > b->count ? 1 : -1;
    }
    for (uint32_t i = a->count; i-- > 0;) {
        if (a->limb[i] != b->limb[i]) {
            return a->limb[i] > b->limb[i] ? 1 : -1;
        }
    }
    return 0;
}

static void add_sizes(const umb_bigint *a, const umb_bigint *b, umb_bigint *out)
{
    uint32_t n = a->count > b->count ? a->count : b->count;
    uint64_t carry = 0;
    for (uint32_t i = 0; i < n; ++i) {
        carry += (uint64_t)(i < a->count ? a->limb[i] : 0) + (i < b->count ? b->limb[i] : 0);
        out->limb[i] = (uint32_t)carry;
        carry >>= 32;
    }
    out->count = n;
    if (carry != 0) {
        out->limb[out->count++] = (uint32_t)carry;
    }
}

/* large is not the smaller one. */
static void subtract_sizes(const umb_bigint *large, const umb_bigint *small, umb_bigint *out)
{
    int64_t borrow = 0;
    uint32_t n = large->count;
    for (uint32_t i = 0; i < n; ++i) {
        int64_t d = (int64_t)large->limb[i] - (i < small->count ? small->limb[i] : 0) - borrow;
        borrow = d < 0;
        out->limb[i] = (uint32_t)d;
    }
    out->count = n;
}

void umb_bigint_add(const umb_bigint *a, const umb_bigint *b, int sign, umb_bigint *out)
{
    int sa = a->sign, sb = b->sign * sign;
    if (sa * sb >= 0) {
        add_sizes(a, b, out);
        out->sign = sa != 0 ? sa : sb;
    } else if (compare_sizes(a, b) >= 0) {
        subtract_sizes(a, b, out);
        out->sign = sa;
    } else {
        subtract_sizes(b, a, out);
        out->sign = sb;
    }
    trim(out);
}

/* Eight floats at once, for rivals whose inner loops compilers do not see through. */
#ifndef LANES_H
#define LANES_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

typedef float lanes __attribute__((vector_size(32)));
typedef int32_t lanes_mask __attribute__((vector_size(32))); /* all bits of a lane, or none */

static inline lanes lanes_load(const float *p)
{
    lanes v;
    memcpy(&v, p, sizeof v);
    return v;
}

static inline void lanes_store(float *p, lanes v)
{
    memcpy(p, &v, sizeof v);
}

static inline lanes lanes_keep(lanes v, lanes_mask m)
{
    return (lanes)((lanes_mask)v & m);
}

static inline lanes lanes_least(lanes a, lanes b)
{
#if defined(__AVX2__)
    return __builtin_ia32_minps256(a, b);
#else
    lanes_mask m = a < b;
    return (lanes)(((lanes_mask)a & m) | ((lanes_mask)b & ~m));
#endif
}

static inline lanes lanes_most(lanes a, lanes b)
{
#if defined(__AVX2__)
    return __builtin_ia32_maxps256(a, b);
#else
    lanes_mask m = a > b;
    return (lanes)(((lanes_mask)a & m) | ((lanes_mask)b & ~m));
#endif
}

static inline bool lanes_any(lanes_mask m)
{
#if defined(__AVX2__)
    return __builtin_ia32_movmskps256((lanes)m) != 0;
#else
    int32_t any = 0;
    for (int i = 0; i < 8; ++i) {
        any |= m[i];
    }
    return any != 0;
#endif
}

static const lanes lanes_count = {0, 1, 2, 3, 4, 5, 6, 7};
static const lanes_mask lanes_number = {0, 1, 2, 3, 4, 5, 6, 7};

#endif

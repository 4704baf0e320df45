/* Vectors for kernel files, which are compiled once for each instruction set. A group of eight (boxes of a
 * node, rows or sub-tiles of a tile) is UMB_PARTS vectors of UMB_LANES lanes: one of eight where the set has
 * them, else two of four. Arithmetic, comparisons and bit operations are the compiler's own on vector types;
 * what these lack is below. Lanes never mix but where a name says so; a minimum is (a < b ? a : b), a maximum
 * (a > b ? a : b): every build gives the same bits. */
#ifndef UMB_SIMD_H
#define UMB_SIMD_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#if defined(__AVX2__)
#include <immintrin.h>
#define UMB_LANES 8
#elif defined(__SSE4_1__)
#include <smmintrin.h>
#define UMB_LANES 4
#else
#if defined(__aarch64__)
#include <arm_neon.h>
#endif
#define UMB_LANES 4
#endif
#define UMB_PARTS (8 / UMB_LANES)
#define UMB_WIDE (UMB_LANES / 2) /* lanes of doubles */

typedef float umb_fv __attribute__((vector_size(4 * UMB_LANES)));
typedef int32_t umb_iv __attribute__((vector_size(4 * UMB_LANES)));
typedef double umb_dv __attribute__((vector_size(4 * UMB_LANES)));
typedef int64_t umb_lv __attribute__((vector_size(4 * UMB_LANES))); /* what comparing doubles gives */

#define UMB_INLINE static inline __attribute__((always_inline, unused))

UMB_INLINE umb_fv umb_fv_set(float v)
{
    return (umb_fv){0} + v;
}

UMB_INLINE umb_iv umb_iv_set(int32_t v)
{
    return (umb_iv){0} + v;
}

UMB_INLINE umb_dv umb_dv_set(double v)
{
    return (umb_dv){0} + v;
}

UMB_INLINE umb_fv umb_fv_load(const float *p)
{
    umb_fv v;
    memcpy(&v, p, sizeof v);
    return v;
}

UMB_INLINE void umb_fv_store(float *p, umb_fv v)
{
    memcpy(p, &v, sizeof v);
}

UMB_INLINE umb_iv umb_iv_load(const void *p)
{
    umb_iv v;
    memcpy(&v, p, sizeof v);
    return v;
}

UMB_INLINE void umb_iv_store(void *p, umb_iv v)
{
    memcpy(p, &v, sizeof v);
}

UMB_INLINE umb_dv umb_dv_load(const double *p)
{
    umb_dv v;
    memcpy(&v, p, sizeof v);
    return v;
}

UMB_INLINE void umb_dv_store(double *p, umb_dv v)
{
    memcpy(p, &v, sizeof v);
}

/* Lanes of mask are all ones or all zeros. */
UMB_INLINE umb_iv umb_iv_select(umb_iv mask, umb_iv a, umb_iv b)
{
    return (a & mask) | (b & ~mask);
}

UMB_INLINE umb_dv umb_dv_select(umb_lv mask, umb_dv a, umb_dv b)
{
    return (umb_dv)(((umb_lv)a & mask) | ((umb_lv)b & ~mask));
}

/* Masks of doubles as one of whole numbers. */
UMB_INLINE umb_iv umb_lv_narrow(umb_lv low, umb_lv high)
{
#if UMB_LANES == 8
    return __builtin_shufflevector((umb_iv)low, (umb_iv)high, 0, 2, 4, 6, 8, 10, 12, 14);
#else
    return __builtin_shufflevector((umb_iv)low, (umb_iv)high, 0, 2, 4, 6);
#endif
}

/* ---- minima, maxima, choices, conversions towards zero (values must fit), narrowing ------------- */

#if defined(__AVX2__)

UMB_INLINE umb_fv umb_fv_min(umb_fv a, umb_fv b)
{
    return (umb_fv)_mm256_min_ps((__m256)a, (__m256)b);
}

UMB_INLINE umb_dv umb_dv_min(umb_dv a, umb_dv b)
{
    return (umb_dv)_mm256_min_pd((__m256d)a, (__m256d)b);
}

UMB_INLINE umb_iv umb_iv_min(umb_iv a, umb_iv b)
{
    return (umb_iv)_mm256_min_epi32((__m256i)a, (__m256i)b);
}

UMB_INLINE umb_fv umb_fv_max(umb_fv a, umb_fv b)
{
    return (umb_fv)_mm256_max_ps((__m256)a, (__m256)b);
}

UMB_INLINE umb_dv umb_dv_max(umb_dv a, umb_dv b)
{
    return (umb_dv)_mm256_max_pd((__m256d)a, (__m256d)b);
}

UMB_INLINE umb_iv umb_iv_max(umb_iv a, umb_iv b)
{
    return (umb_iv)_mm256_max_epi32((__m256i)a, (__m256i)b);
}

UMB_INLINE umb_fv umb_fv_select(umb_iv mask, umb_fv a, umb_fv b)
{
    return (umb_fv)_mm256_blendv_ps((__m256)b, (__m256)a, (__m256)mask);
}

UMB_INLINE umb_iv umb_fv_trunc(umb_fv v)
{
    return (umb_iv)_mm256_cvttps_epi32((__m256)v);
}

UMB_INLINE umb_iv umb_dv_trunc(umb_dv low, umb_dv high)
{
    return (umb_iv)_mm256_set_m128i(_mm256_cvttpd_epi32((__m256d)high), _mm256_cvttpd_epi32((__m256d)low));
}

/* One bit a lane: its sign. */
UMB_INLINE uint32_t umb_iv_bits(umb_iv v)
{
    return (uint32_t)_mm256_movemask_ps((__m256)v);
}

UMB_INLINE bool umb_iv_any(umb_iv v)
{
    return !_mm256_testz_si256((__m256i)v, (__m256i)v);
}

#elif defined(__SSE4_1__)

UMB_INLINE umb_fv umb_fv_min(umb_fv a, umb_fv b)
{
    return (umb_fv)_mm_min_ps((__m128)a, (__m128)b);
}

UMB_INLINE umb_dv umb_dv_min(umb_dv a, umb_dv b)
{
    return (umb_dv)_mm_min_pd((__m128d)a, (__m128d)b);
}

UMB_INLINE umb_iv umb_iv_min(umb_iv a, umb_iv b)
{
    return (umb_iv)_mm_min_epi32((__m128i)a, (__m128i)b);
}

UMB_INLINE umb_fv umb_fv_max(umb_fv a, umb_fv b)
{
    return (umb_fv)_mm_max_ps((__m128)a, (__m128)b);
}

UMB_INLINE umb_dv umb_dv_max(umb_dv a, umb_dv b)
{
    return (umb_dv)_mm_max_pd((__m128d)a, (__m128d)b);
}

UMB_INLINE umb_iv umb_iv_max(umb_iv a, umb_iv b)
{
    return (umb_iv)_mm_max_epi32((__m128i)a, (__m128i)b);
}

UMB_INLINE umb_fv umb_fv_select(umb_iv mask, umb_fv a, umb_fv b)
{
    return (umb_fv)_mm_blendv_ps((__m128)b, (__m128)a, (__m128)mask);
}

UMB_INLINE umb_iv umb_fv_trunc(umb_fv v)
{
    return (umb_iv)_mm_cvttps_epi32((__m128)v);
}

UMB_INLINE umb_iv umb_dv_trunc(umb_dv low, umb_dv high)
{
    return (umb_iv)_mm_unpacklo_epi64(_mm_cvttpd_epi32((__m128d)low), _mm_cvttpd_epi32((__m128d)high));
}

UMB_INLINE uint32_t umb_iv_bits(umb_iv v)
{
    return (uint32_t)_mm_movemask_ps((__m128)v);
}

UMB_INLINE bool umb_iv_any(umb_iv v)
{
    return !_mm_testz_si128((__m128i)v, (__m128i)v);
}

#else

#define UMB_EACH(type, lanes, expression)                                                          \
    type r = {0};                                                                                  \
    for (int i = 0; i < (lanes); ++i) {                                                            \
        r[i] = (expression);                                                                       \
    }                                                                                              \
    return r

UMB_INLINE umb_fv umb_fv_min(umb_fv a, umb_fv b)
{
    UMB_EACH(umb_fv, UMB_LANES, a[i] < b[i] ? a[i] : b[i]);
}

UMB_INLINE umb_fv umb_fv_max(umb_fv a, umb_fv b)
{
    UMB_EACH(umb_fv, UMB_LANES, a[i] > b[i] ? a[i] : b[i]);
}

UMB_INLINE umb_dv umb_dv_min(umb_dv a, umb_dv b)
{
    UMB_EACH(umb_dv, UMB_WIDE, a[i] < b[i] ? a[i] : b[i]);
}

UMB_INLINE umb_dv umb_dv_max(umb_dv a, umb_dv b)
{
    UMB_EACH(umb_dv, UMB_WIDE, a[i] > b[i] ? a[i] : b[i]);
}

UMB_INLINE umb_iv umb_iv_min(umb_iv a, umb_iv b)
{
    UMB_EACH(umb_iv, UMB_LANES, a[i] < b[i] ? a[i] : b[i]);
}

UMB_INLINE umb_iv umb_iv_max(umb_iv a, umb_iv b)
{
    UMB_EACH(umb_iv, UMB_LANES, a[i] > b[i] ? a[i] : b[i]);
}

UMB_INLINE umb_fv umb_fv_select(umb_iv mask, umb_fv a, umb_fv b)
{
    return (umb_fv)umb_iv_select(mask, (umb_iv)a, (umb_iv)b);
}

UMB_INLINE umb_iv umb_fv_trunc(umb_fv v)
{
    UMB_EACH(umb_iv, UMB_LANES, (int32_t)v[i]);
}

UMB_INLINE umb_iv umb_dv_trunc(umb_dv low, umb_dv high)
{
    UMB_EACH(umb_iv, UMB_LANES, (int32_t)(i < UMB_WIDE ? low[i % UMB_WIDE] : high[i % UMB_WIDE]));
}

UMB_INLINE uint32_t umb_iv_bits(umb_iv v)
{
    uint32_t bits = 0;
    for (int i = 0; i < UMB_LANES; ++i) {
        bits |= ((uint32_t)v[i] >> 31) << i;
    }
    return bits;
}

UMB_INLINE bool umb_iv_any(umb_iv v)
{
    int32_t any = 0;
    for (int i = 0; i < UMB_LANES; ++i) {
        any |= v[i];
    }
    return any != 0;
}

#endif

UMB_INLINE umb_fv umb_fv_abs(umb_fv v)
{
    return (umb_fv)((umb_iv)v & umb_iv_set(0x7FFFFFFF));
}

UMB_INLINE umb_fv umb_fv_clamp(umb_fv v, umb_fv low, umb_fv high)
{
    return umb_fv_min(umb_fv_max(v, low), high);
}

UMB_INLINE umb_dv umb_dv_abs(umb_dv v)
{
    return umb_dv_max(v, -v);
}

/* Every lane becomes the OR of its four (lanes 0..3, and 4..7 where there are eight). */
UMB_INLINE umb_iv umb_iv_or_fours(umb_iv v)
{
#if UMB_LANES == 8
    v |= __builtin_shufflevector(v, v, 2, 3, 0, 1, 6, 7, 4, 5);
    return v | __builtin_shufflevector(v, v, 1, 0, 3, 2, 5, 4, 7, 6);
#else
    v |= __builtin_shufflevector(v, v, 2, 3, 0, 1);
    return v | __builtin_shufflevector(v, v, 1, 0, 3, 2);
#endif
}

/* From lanes that are sub-tiles (all ones or zeros) to lanes that are rows: byte b of every lane is that of the
 * sub-tile b of its four. */
UMB_INLINE umb_iv umb_iv_spread(umb_iv v)
{
    static const uint32_t byte[8] = {0xFF, 0xFF00, 0xFF0000, 0xFF000000, 0xFF, 0xFF00, 0xFF0000, 0xFF000000};
    return umb_iv_or_fours(v & umb_iv_load(byte));
}

/* Part i of eight lanes of which the first four are a and the last four b. */
UMB_INLINE umb_fv umb_fv_fours(float a, float b, int i)
{
#if UMB_LANES == 8
    (void)i;
    return __builtin_shufflevector(umb_fv_set(a), umb_fv_set(b), 0, 1, 2, 3, 8, 9, 10, 11);
#else
    return umb_fv_set(i == 0 ? a : b);
#endif
}

/* Across lanes. */
UMB_INLINE float umb_fv_least(umb_fv v)
{
#if UMB_LANES == 8
    v = umb_fv_min(v, __builtin_shufflevector(v, v, 4, 5, 6, 7, 0, 1, 2, 3));
    v = umb_fv_min(v, __builtin_shufflevector(v, v, 2, 3, 0, 1, 6, 7, 4, 5));
    v = umb_fv_min(v, __builtin_shufflevector(v, v, 1, 0, 3, 2, 5, 4, 7, 6));
#else
    v = umb_fv_min(v, __builtin_shufflevector(v, v, 2, 3, 0, 1));
    v = umb_fv_min(v, __builtin_shufflevector(v, v, 1, 0, 3, 2));
#endif
    return v[0];
}

/* The least lane of each of four. */
UMB_INLINE void umb_iv_least_each(umb_iv a, umb_iv b, umb_iv c, umb_iv d, int32_t out[4])
{
    typedef int32_t four __attribute__((vector_size(16)));
#if UMB_LANES == 8
    umb_iv p = umb_iv_min(__builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13),
                          __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15));
    umb_iv q = umb_iv_min(__builtin_shufflevector(c, d, 0, 8, 1, 9, 4, 12, 5, 13),
                          __builtin_shufflevector(c, d, 2, 10, 3, 11, 6, 14, 7, 15));
    p = umb_iv_min(__builtin_shufflevector(p, q, 0, 1, 8, 9, 4, 5, 12, 13),
                   __builtin_shufflevector(p, q, 2, 3, 10, 11, 6, 7, 14, 15));
    p = umb_iv_min(p, __builtin_shufflevector(p, p, 4, 5, 6, 7, 0, 1, 2, 3));
    four least = __builtin_shufflevector(p, p, 0, 1, 2, 3);
#else
    umb_iv p = umb_iv_min(__builtin_shufflevector(a, b, 0, 4, 1, 5), __builtin_shufflevector(a, b, 2, 6, 3, 7));
    umb_iv q = umb_iv_min(__builtin_shufflevector(c, d, 0, 4, 1, 5), __builtin_shufflevector(c, d, 2, 6, 3, 7));
    four least = umb_iv_min(__builtin_shufflevector(p, q, 0, 1, 4, 5), __builtin_shufflevector(p, q, 2, 3, 6, 7));
#endif
    memcpy(out, &least, sizeof least);
}

UMB_INLINE double umb_dv_least(umb_dv v)
{
    double least = v[0];
    for (int i = 1; i < UMB_WIDE; ++i) {
        least = v[i] < least ? v[i] : least;
    }
    return least;
}

#endif

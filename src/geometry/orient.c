/* Three ways to the sign, each tried where the one before it cannot tell: doubles with a bound of
 * their error; integers, where the differences of the points are short enough; a sum of exact
 * terms. Points of one plane never pass the first, and are what is asked about most: the second is
 * for them. */
#include "orient.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "expansion.h"

/* Add det(p, q, r), or its negative, to the terms. A product of two floats has 48 bits: an exact
 * double, which Veltkamp's split cuts in halves of 24, so that each times a third float is exact
 * again. Exponents stay in [-447, 384]. */
static void add_determinant(double *terms, int *count, const float *p, const float *q,
                            const float *r, double sign)
{
    for (int k = 0; k < 6; ++k) {
        int i = k % 3, j = (i + (k < 3 ? 1 : 2)) % 3, l = 3 - i - j;
        double product = (double)q[j] * r[l];
        double scaled = product * (0x1p29 + 1.0);
        double high = scaled - (scaled - product), low = product - high;
        double factor = k < 3 ? sign * p[i] : -sign * p[i];
        terms[(*count)++] = high * factor;
        terms[(*count)++] = low * factor;
    }
}

int umb_orient_by_sum(const float a[3], const float b[3], const float c[3], const float d[3])
{
    /* The determinant is linear in each row; what has a in two rows vanishes. */
    double terms[UMB_EXPANSION_TERMS];
    int count = 0;
    add_determinant(terms, &count, b, c, d, 1.0);
    add_determinant(terms, &count, a, c, d, -1.0);
    add_determinant(terms, &count, a, b, d, 1.0);
    add_determinant(terms, &count, a, b, c, -1.0);
    return umb_sign_of_sum(terms, count);
}

#ifdef __SIZEOF_INT128__
__extension__ typedef __int128 wide;

/* Integers below 2^41 in the same ratio as the three differences along one axis. */
static bool to_integers(const double differences[3], int64_t out[3])
{
    double largest = fmax(fabs(differences[0]), fmax(fabs(differences[1]), fabs(differences[2])));
    if (!(largest < 0x1p200)) {
        return false;
    }
    uint64_t bits;
    memcpy(&bits, &largest, sizeof bits);
    /* 2^40 over the power of two at or below the largest; differences of floats are no
     * subnormals. */
    bits = largest > 0.0 ? (2 * 1023 + 40 - (bits >> 52)) << 52 : 0;
    double scale;
    memcpy(&scale, &bits, sizeof scale);
    for (int k = 0; k < 3; ++k) {
        double x = differences[k] * scale;
        out[k] = (int64_t)x;
        if ((double)out[k] != x) {
            return false;
        }
    }
    return true;
}

/* False if the differences are too long. m[axis][row]; the axes may be scaled each by itself. */
static bool by_integers(double m[3][3], int *sign)
{
    int64_t n[3][3];
    for (int i = 0; i < 3; ++i) {
        if (!to_integers(m[i], n[i])) {
            return false;
        }
    }
    /* Three terms below 2^124. */
    wide sum = 0;
    for (int i = 0; i < 3; ++i) {
        const int64_t *p = n[(i + 1) % 3], *q = n[(i + 2) % 3];
        sum += ((wide)p[1] * q[2] - (wide)p[2] * q[1]) * n[i][0];
    }
    *sign = sum > 0 ? 1 : sum < 0 ? -1 : 0;
    return true;
}
#endif

int umb_orient(const float a[3], const float b[3], const float c[3], const float d[3])
{
    double m[3][3];
    bool exact = true;
    for (int i = 0; i < 3; ++i) {
        const double ends[3] = {b[i], c[i], d[i]};
        for (int k = 0; k < 3; ++k) {
            double lost;
            umb_two_sum(ends[k], -(double)a[i], &m[i][k], &lost);
            exact = exact && lost == 0.0;
        }
    }
    double sum = 0.0, size = 0.0;
    for (int i = 0; i < 3; ++i) {
        const double *p = m[(i + 1) % 3], *q = m[(i + 2) % 3];
        double x = p[1] * q[2], y = p[2] * q[1];
        sum += (x - y) * m[i][0];
        size += (fabs(x) + fabs(y)) * fabs(m[i][0]);
    }
    /* Each product has passed eight roundings at most (three differences, two products, a difference,
       two sums), and so has its share of the size: 16 * 2^-53 covers both. */
    if (fabs(sum) > size * 0x1p-49) {
        return sum > 0.0 ? 1 : -1;
    }
    if (size == 0.0) {
        return 0;
    }
#ifdef __SIZEOF_INT128__
    int sign;
    if (exact && by_integers(m, &sign)) {
        return sign;
    }
#endif
    return umb_orient_by_sum(a, b, c, d);
}

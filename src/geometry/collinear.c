#include "collinear.h"

#include <math.h>

#include "expansion.h"

int umb_collinear_turn(const float a[3], const float b[3], const float c[3], int i, int j)
{
    /* (b_i - a_i)(c_j - a_j) - (b_j - a_j)(c_i - a_i) multiplied out; a_i a_j cancels. Each product of
       two floats has 48 bits and an exponent in [-298, 256], so it is an exact double. */
    double ai = a[i], aj = a[j], bi = b[i], bj = b[j], ci = c[i], cj = c[j];
    double terms[6] = {bi * cj, -(bi * aj), -(ai * cj), -(bj * ci), bj * ai, aj * ci};
    double sum = 0.0, size = 0.0;
    for (int k = 0; k < 6; ++k) {
        sum += terms[k];
        size += fabs(terms[k]);
    }
    /* Five roundings, each at most 2^-53 of a partial sum, and partial sums are at most the size, which
       itself is right to within 5 * 2^-53 of it: 8 * 2^-53 = 2^-50 covers both. */
    if (fabs(sum) > size * 0x1p-50) {
        return sum > 0.0 ? 1 : -1;
    }
    return size == 0.0 ? 0 : umb_sign_of_sum(terms, 6);
}

bool umb_collinear(const float a[3], const float b[3], const float c[3])
{
    return umb_collinear_turn(a, b, c, 0, 1) == 0 && umb_collinear_turn(a, b, c, 1, 2) == 0 &&
           umb_collinear_turn(a, b, c, 2, 0) == 0;
}

bool umb_collinear_inside(const float a[3], const float b[3], const float p[3])
{
    /* On a line, between the ends in every coordinate and strictly so in one means inside. */
    bool strict = false;
    for (int i = 0; i < 3; ++i) {
        float low = a[i] < b[i] ? a[i] : b[i];
        float high = a[i] < b[i] ? b[i] : a[i];
        if (p[i] < low || p[i] > high) {
            return false;
        }
        strict = strict || (p[i] > low && p[i] < high);
    }
    return strict && umb_collinear(a, b, p);
}

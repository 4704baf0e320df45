#include "collinear.h"

#include <math.h>

/* A sum of a and b without loss: *high is the rounded sum, *low what rounding took (Knuth's two-sum,
 * right for all doubles that do not overflow; ours stay below 2^260). */
static void two_sum(double a, double b, double *high, double *low)
{
    double s = a + b;
    double bb = s - a;
    *low = (a - (s - bb)) + (b - bb);
    *high = s;
}

/* The sign of an exact sum of six doubles: terms are added one by one to an expansion whose parts do
 * not overlap and grow in size (Shewchuk's grow-expansion); the last non-zero part has the sign of the
 * whole. */
static int sign_of_sum(const double terms[6])
{
    double parts[6];
    for (int n = 0; n < 6; ++n) {
        double carry = terms[n];
        for (int k = 0; k < n; ++k) {
            two_sum(carry, parts[k], &carry, &parts[k]);
        }
        parts[n] = carry;
    }
    for (int k = 5; k >= 0; --k) {
        if (parts[k] != 0.0) {
            return parts[k] > 0.0 ? 1 : -1;
        }
    }
    return 0;
}

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
    return size == 0.0 ? 0 : sign_of_sum(terms);
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

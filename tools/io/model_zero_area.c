/* Whether three float points lie on one line, without rounding.
 *
 * They do when all three projections have zero area. A projection's doubled area is
 *   ax*by - ax*cy - ay*bx + ay*cx + bx*cy - by*cx,
 * six products of 24-bit floats, each exact in double. Doubles first: the products are exact, so
 * five additions of at most six terms err by less than 6 u S, u = 2^-53, S the sum of absolute
 * values. When that does not decide, the six are summed into an expansion without error (Shewchuk,
 * Adaptive Precision Floating-Point Arithmetic, 1997, grow-expansion).
 */
#include "model_parts.h"

#include <math.h>

static void two_sum(double a, double b, double *sum, double *error)
{
    double s = a + b;
    double rest = s - a;
    *error = (a - (s - rest)) + (b - rest);
    *sum = s;
}

static bool sum_is_zero(const double term[6])
{
    double part[6];
    int count = 0;
    for (int i = 0; i < 6; ++i) {
        double carry = term[i];
        for (int k = 0; k < count; ++k) {
            two_sum(carry, part[k], &carry, &part[k]);
        }
        part[count++] = carry;
    }
    for (int k = 0; k < count; ++k) {
        if (part[k] != 0.0) {
            return false;
        }
    }
    return true;
}

static bool projection_is_zero(const float a[3], const float b[3], const float c[3], int x, int y)
{
    const double term[6] = {
        (double)a[x] * b[y], -(double)a[x] * c[y], -(double)a[y] * b[x],
        (double)a[y] * c[x], (double)b[x] * c[y],  -(double)b[y] * c[x],
    };
    double sum = 0.0;
    double size = 0.0;
    for (int i = 0; i < 6; ++i) {
        sum += term[i];
        size += fabs(term[i]);
    }
    if (fabs(sum) > 0x1p-50 * size) {
        return false;
    }
    return sum_is_zero(term);
}

bool model_zero_area(const float a[3], const float b[3], const float c[3])
{
    return projection_is_zero(a, b, c, 0, 1) && projection_is_zero(a, b, c, 1, 2) &&
           projection_is_zero(a, b, c, 2, 0);
}

#include "side.h"

#include "expansion.h"
#include "vec.h"

/* det(p, q, e), or its negative, as a sum: a product of two floats has 48 bits, an exact double; fma gives what
 * rounding takes from its product with a third factor. */
static void add_determinant(double *terms, int *count, const float *p, const float *q, const double e[3], double sign)
{
    for (int k = 0; k < 6; ++k) {
        int i = k % 3, j = (i + (k < 3 ? 1 : 2)) % 3, l = 3 - i - j;
        double product = sign * (k < 3 ? 1.0 : -1.0) * ((double)p[j] * q[l]);
        double high = product * e[i];
        terms[(*count)++] = high;
        terms[(*count)++] = fma(product, e[i], -high);
    }
}

static int sign_of(const float plane[3][3], const double e[3], int point)
{
    double terms[UMB_EXPANSION_TERMS], a[3] = {plane[0][0], plane[0][1], plane[0][2]};
    int count = 0;
    add_determinant(terms, &count, plane[1], plane[2], e, 1.0);
    add_determinant(terms, &count, plane[0], plane[2], e, -1.0);
    add_determinant(terms, &count, plane[0], plane[1], e, 1.0);
    if (point) {
        add_determinant(terms, &count, plane[1], plane[2], a, -1.0);
    }
    return umb_sign_of_sum(terms, count);
}

/* The differences have relative error 2^-53, the triple product fewer than 9 roundings more: less than 16 units of
 * the product of the three lengths, and what underflows is far below 2^-900. */
static int quick_sign(const float plane[3][3], umb_vec3 to)
{
    umb_vec3 a = umb_vec3_from_float(plane[0]);
    umb_vec3 u = umb_vec3_sub(umb_vec3_from_float(plane[1]), a), v = umb_vec3_sub(umb_vec3_from_float(plane[2]), a);
    double h = umb_vec3_dot(umb_vec3_cross(u, v), to);
    double bound = 0x1p-49 * umb_vec3_sum_abs(u) * umb_vec3_sum_abs(v) * umb_vec3_sum_abs(to) + 0x1p-900;
    return h > bound ? 1 : h < -bound ? -1 : 0;
}

int umb_side_of_point(const float plane[3][3], const double p[3])
{
    int quick = quick_sign(plane, umb_vec3_sub(umb_vec3_from_double(p), umb_vec3_from_float(plane[0])));
    return quick != 0 ? quick : sign_of(plane, p, 1);
}

int umb_side_of_direction(const float plane[3][3], const double d[3])
{
    int quick = quick_sign(plane, umb_vec3_from_double(d));
    return quick != 0 ? quick : sign_of(plane, d, 0);
}

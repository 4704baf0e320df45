/* Sums of doubles without loss, for exact signs. */
#ifndef UMB_EXPANSION_H
#define UMB_EXPANSION_H

#define UMB_EXPANSION_TERMS 48

/* A sum of a and b without loss: *high is the rounded sum, *low what rounding took (Knuth's
 * two-sum, right for all doubles that do not overflow). */
static inline void umb_two_sum(double a, double b, double *high, double *low)
{
    double s = a + b;
    double bb = s - a;
    *low = (a - (s - bb)) + (b - bb);
    *high = s;
}

/* The sign of an exact sum of at most UMB_EXPANSION_TERMS doubles: terms are added one by one to an
 * expansion whose parts do not overlap and grow in size (Shewchuk's grow-expansion); the last
 * non-zero part has the sign of the whole. */
static inline int umb_sign_of_sum(const double *terms, int count)
{
    double parts[UMB_EXPANSION_TERMS];
    for (int n = 0; n < count; ++n) {
        double carry = terms[n];
        for (int k = 0; k < n; ++k) {
            umb_two_sum(carry, parts[k], &carry, &parts[k]);
        }
        parts[n] = carry;
    }
    for (int k = count - 1; k >= 0; --k) {
        if (parts[k] != 0.0) {
            return parts[k] > 0.0 ? 1 : -1;
        }
    }
    return 0;
}

#endif

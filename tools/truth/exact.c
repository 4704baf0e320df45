/* Expansions after Shewchuk (Adaptive Precision Floating-Point Arithmetic, 1997), kept simple:
 * every operation grows a sum term by term and compresses it, so lengths stay near bits / 53. */
#include "exact.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define WORK_TERMS 512

typedef struct work {
    int count;
    double term[WORK_TERMS];
} work;

static inline void two_sum(double a, double b, double *sum, double *error)
{
    double s = a + b;
    double bb = s - a;
    *error = (a - (s - bb)) + (b - bb);
    *sum = s;
}

static inline void split(double a, double *high, double *low)
{
    double c = 134217729.0 * a;
    *high = c - (c - a);
    *low = a - *high;
}

static inline void two_product(double a, double b, double *product, double *error)
{
    double ah, al, bh, bl;
    double p = a * b;
    split(a, &ah, &al);
    split(b, &bh, &bl);
    *error = al * bl - (((p - ah * bh) - al * bh) - ah * bl);
    *product = p;
}

/* Grow-expansion with zero elimination: w += b. */
static void grow(work *w, double b)
{
    double q = b;
    int n = 0;
    for (int i = 0; i < w->count; ++i) {
        double h;
        two_sum(q, w->term[i], &q, &h);
        if (h != 0.0) {
            w->term[n++] = h;
        }
    }
    if (q != 0.0) {
        w->term[n++] = q;
    }
    w->count = n;
}

/* Compress in place: afterwards each term is below half a unit of the next one's last place. */
static void compress(work *w)
{
    double kept[WORK_TERMS];
    int n = w->count;
    if (n < 2) {
        return;
    }
    int bottom = n - 1;
    double q = w->term[n - 1];
    for (int i = n - 2; i >= 0; --i) {
        double sum, error;
        two_sum(q, w->term[i], &sum, &error);
        q = sum;
        if (error != 0.0) {
            kept[bottom--] = q;
            q = error;
        }
    }
    kept[bottom] = q;
    int top = 0;
    for (int i = bottom + 1; i < n; ++i) {
        double sum, error;
        two_sum(kept[i], q, &sum, &error);
        q = sum;
        if (error != 0.0) {
            w->term[top++] = error;
        }
    }
    if (q != 0.0 || top == 0) {
        w->term[top++] = q;
    }
    w->count = top;
}

static void finish(work *w, exact *x)
{
    compress(w);
    if (w->count == 1 && w->term[0] == 0.0) {
        w->count = 0;
    }
    if (w->count > EXACT_TERMS) {
        x->count = -1;
        return;
    }
    memcpy(x->term, w->term, sizeof(double) * (size_t)w->count);
    x->count = w->count;
}

void exact_set(exact *x, double value)
{
    x->count = value != 0.0 ? 1 : 0;
    x->term[0] = value;
}

void exact_difference(exact *x, double a, double b)
{
    double sum, error;
    two_sum(a, -b, &sum, &error);
    x->count = 0;
    if (error != 0.0) {
        x->term[x->count++] = error;
    }
    if (sum != 0.0) {
        x->term[x->count++] = sum;
    }
}

static void combine(exact *x, const exact *a, const exact *b, double sign)
{
    if (a->count < 0 || b->count < 0) {
        x->count = -1;
        return;
    }
    work w;
    w.count = a->count;
    memcpy(w.term, a->term, sizeof(double) * (size_t)a->count);
    for (int i = 0; i < b->count; ++i) {
        grow(&w, sign * b->term[i]);
    }
    finish(&w, x);
}

void exact_add(exact *x, const exact *a, const exact *b)
{
    combine(x, a, b, 1.0);
}

void exact_subtract(exact *x, const exact *a, const exact *b)
{
    combine(x, a, b, -1.0);
}

void exact_multiply(exact *x, const exact *a, const exact *b)
{
    if (a->count < 0 || b->count < 0) {
        x->count = -1;
        return;
    }
    work w;
    w.count = 0;
    for (int i = 0; i < a->count; ++i) {
        for (int j = 0; j < b->count; ++j) {
            double product, error;
            two_product(a->term[i], b->term[j], &product, &error);
            if (w.count > WORK_TERMS - 4) {
                compress(&w);
            }
            if (w.count > WORK_TERMS - 4) {
                x->count = -1;
                return;
            }
            grow(&w, error);
            grow(&w, product);
        }
    }
    finish(&w, x);
}

int exact_sign(const exact *x, bool *lost)
{
    if (x->count < 0) {
        *lost = true;
        return 0;
    }
    if (x->count == 0) {
        return 0;
    }
    return x->term[x->count - 1] > 0.0 ? 1 : -1;
}

double exact_estimate(const exact *x)
{
    double sum = 0.0;
    for (int i = 0; i < x->count; ++i) {
        sum += x->term[i];
    }
    return sum;
}

bool exact_in_range(double x)
{
    /* Six factors of at least 2^-152 (the last bit of 2^-100) stay above 2^-1022, six below 2^64
     * stay below 2^996, where splitting would overflow. Floats' last bit is never below 2^-149. */
    double a = fabs(x);
    return a == 0.0 || (a >= 0x1p-100 && a <= 0x1p64);
}

void exact_line_through(exact_line *line, const double origin[3], const double point[3])
{
    for (int i = 0; i < 3; ++i) {
        line->origin[i] = origin[i];
        exact_difference(&line->direction[i], point[i], origin[i]);
        line->approximate[i] = point[i] - origin[i];
    }
}

void exact_line_along(exact_line *line, const double origin[3], const double direction[3])
{
    for (int i = 0; i < 3; ++i) {
        line->origin[i] = origin[i];
        exact_set(&line->direction[i], direction[i]);
        line->approximate[i] = direction[i];
    }
}

void exact_direction_dot(const exact_line *line, const double k[3], exact *out)
{
    exact sum;
    exact_set(&sum, 0.0);
    for (int i = 0; i < 3; ++i) {
        exact factor, product, next;
        exact_set(&factor, k[i]);
        exact_multiply(&product, &line->direction[i], &factor);
        exact_add(&next, &sum, &product);
        sum = next;
    }
    *out = sum;
}

void exact_dot(const double point[3], const double from[3], const double k[3], exact *out)
{
    exact sum;
    exact_set(&sum, 0.0);
    for (int i = 0; i < 3; ++i) {
        exact d, factor, product, next;
        exact_difference(&d, point[i], from ? from[i] : 0.0);
        exact_set(&factor, k[i]);
        exact_multiply(&product, &d, &factor);
        exact_add(&next, &sum, &product);
        sum = next;
    }
    *out = sum;
}

static void cross(exact out[3], const exact a[3], const exact b[3])
{
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        exact p, q;
        exact_multiply(&p, &a[j], &b[k]);
        exact_multiply(&q, &a[k], &b[j]);
        exact_subtract(&out[i], &p, &q);
    }
}

static void dot(exact *out, const exact a[3], const exact b[3])
{
    exact p, q, sum;
    exact_multiply(&p, &a[0], &b[0]);
    exact_multiply(&q, &a[1], &b[1]);
    exact_add(&sum, &p, &q);
    exact_multiply(&p, &a[2], &b[2]);
    exact_add(out, &sum, &p);
}

static void relative(exact out[3], const float a[3], const double from[3])
{
    for (int i = 0; i < 3; ++i) {
        exact_difference(&out[i], a[i], from[i]);
    }
}

static void edge_of(exact out[3], const float a[3], const float b[3])
{
    for (int i = 0; i < 3; ++i) {
        exact_difference(&out[i], b[i], a[i]);
    }
}

/* Sign of direction . ((a - o) x (b - o)): which way the line passes the edge a -> b. The double
 * value is trusted outside Shewchuk's error bound of orient3d, (7 + 56e) e times the sum of
 * magnitudes; ours has the same shape and 16 e covers it. */
static int passing_sign(const exact_line *line, const float a[3], const float b[3], bool *lost)
{
    const double *d = line->approximate, *o = line->origin;
    double p[3], q[3], sum = 0.0, size = 0.0;
    for (int i = 0; i < 3; ++i) {
        p[i] = a[i] - o[i];
        q[i] = b[i] - o[i];
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        sum += d[i] * (p[j] * q[k] - p[k] * q[j]);
        size += fabs(d[i]) * (fabs(p[j] * q[k]) + fabs(p[k] * q[j]));
    }
    if (fabs(sum) > 16.0 * DBL_EPSILON * size) {
        return sum > 0.0 ? 1 : -1;
    }
    exact ea[3], eb[3], n[3], volume;
    relative(ea, a, o);
    relative(eb, b, o);
    cross(n, ea, eb);
    dot(&volume, line->direction, n);
    return exact_sign(&volume, lost);
}

exact_meeting exact_line_triangle(const exact_line *line, float v[3][3], exact_crossing *out,
                                  bool *lost)
{
    int s0 = passing_sign(line, v[0], v[1], lost);
    int s1 = passing_sign(line, v[1], v[2], lost);
    if (s0 * s1 < 0) {
        return EXACT_MISS;
    }
    int s2 = passing_sign(line, v[2], v[0], lost);
    if (s0 * s2 < 0 || s1 * s2 < 0) {
        return EXACT_MISS;
    }
    exact ab[3], ac[3], n[3], to[3];
    edge_of(ab, v[0], v[1]);
    edge_of(ac, v[0], v[2]);
    cross(n, ab, ac);
    relative(to, v[0], line->origin);
    dot(&out->denominator, n, line->direction);
    dot(&out->numerator, n, to);
    out->facing = exact_sign(&out->denominator, lost);
    if (out->facing != 0) {
        return EXACT_CROSS;
    }
    return exact_sign(&out->numerator, lost) == 0 ? EXACT_IN_PLANE : EXACT_MISS;
}

int exact_compare(const exact_crossing *a, const exact_crossing *b, bool *lost)
{
    /* Estimates are good to four units, quotients to eight: decide in double when far apart. */
    double sa = exact_estimate(&a->numerator) / exact_estimate(&a->denominator);
    double sb = exact_estimate(&b->numerator) / exact_estimate(&b->denominator);
    if (a->numerator.count >= 0 && b->numerator.count >= 0 && a->denominator.count > 0 &&
        b->denominator.count > 0 && fabs(sa - sb) > 64.0 * DBL_EPSILON * (fabs(sa) + fabs(sb))) {
        return sa > sb ? 1 : -1;
    }
    exact p, q, difference;
    exact_multiply(&p, &a->numerator, &b->denominator);
    exact_multiply(&q, &b->numerator, &a->denominator);
    exact_subtract(&difference, &p, &q);
    return exact_sign(&difference, lost) * exact_sign(&a->denominator, lost) *
           exact_sign(&b->denominator, lost);
}

int exact_along_sign(const exact_crossing *at, const exact *base, const exact *slope, bool *lost)
{
    exact p, q, sum;
    exact_multiply(&p, base, &at->denominator);
    exact_multiply(&q, slope, &at->numerator);
    exact_add(&sum, &p, &q);
    return exact_sign(&sum, lost) * exact_sign(&at->denominator, lost);
}

/* Sign of direction x (v - origin) in the plane with axis `drop` left out. */
static int side_sign(const exact_line *line, const float v[3], int drop, bool *lost)
{
    int j = (drop + 1) % 3, k = (drop + 2) % 3;
    exact to[3], p, q, area;
    relative(to, v, line->origin);
    exact_multiply(&p, &line->direction[j], &to[k]);
    exact_multiply(&q, &line->direction[k], &to[j]);
    exact_subtract(&area, &p, &q);
    return exact_sign(&area, lost);
}

bool exact_in_plane_free(const exact_line *line, float v[3][3], const exact_crossing *end,
                         bool *lost)
{
    /* All corners strictly on one side in some projection: the line misses it. */
    for (int drop = 0; drop < 3; ++drop) {
        int a = side_sign(line, v[0], drop, lost);
        if (a != 0 && a == side_sign(line, v[1], drop, lost) &&
            a == side_sign(line, v[2], drop, lost)) {
            return true;
        }
    }
    /* All corners at the end or beyond it, measured along the direction. */
    exact length, negative, zero;
    dot(&length, line->direction, line->direction);
    exact_set(&zero, 0.0);
    exact_subtract(&negative, &zero, &length);
    for (int i = 0; i < 3; ++i) {
        exact to[3], reach;
        relative(to, v[i], line->origin);
        dot(&reach, to, line->direction);
        if (exact_along_sign(end, &reach, &negative, lost) < 0) {
            return false;
        }
    }
    return true;
}

bool exact_degenerate(float v[3][3], bool *lost)
{
    exact ab[3], ac[3], n[3];
    edge_of(ab, v[0], v[1]);
    edge_of(ac, v[0], v[2]);
    cross(n, ab, ac);
    return exact_sign(&n[0], lost) == 0 && exact_sign(&n[1], lost) == 0 &&
           exact_sign(&n[2], lost) == 0;
}

bool exact_on_segment(const double p[3], const double a[3], const double b[3], bool *lost)
{
    exact ab[3], ap[3], n[3];
    for (int i = 0; i < 3; ++i) {
        if (p[i] < (a[i] < b[i] ? a[i] : b[i]) || p[i] > (a[i] > b[i] ? a[i] : b[i])) {
            return false;
        }
        exact_difference(&ab[i], b[i], a[i]);
        exact_difference(&ap[i], p[i], a[i]);
    }
    cross(n, ab, ap);
    return exact_sign(&n[0], lost) == 0 && exact_sign(&n[1], lost) == 0 &&
           exact_sign(&n[2], lost) == 0;
}

/* The oracle's exact arithmetic against integers. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "truth/exact.h"

__extension__ typedef __int128 wide;

static uint64_t random_state = 1;

static int random_below(int limit)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (int)((random_state >> 33) % (uint64_t)limit);
}

static int sign_of(wide x)
{
    return x > 0 ? 1 : x < 0 ? -1 : 0;
}

static wide to_wide(const exact *x)
{
    wide sum = 0;
    for (int i = 0; i < x->count; ++i) {
        sum += (wide)x->term[i];
    }
    return sum;
}

static void test_sums_and_products(void **state)
{
    (void)state;
    for (int round = 0; round < 20000; ++round) {
        exact a, b, c, sum, product, difference;
        /* Parts of far apart sizes, so that values take several terms. */
        wide va = ((wide)random_below(2000000) - 1000000) * ((wide)1 << random_below(33));
        wide vb = (wide)random_below(2000000) - 1000000;
        exact_set(&a, (double)va);
        exact_set(&b, (double)vb);
        exact_add(&sum, &a, &b);
        assert_true(to_wide(&sum) == va + vb);
        exact_subtract(&difference, &sum, &a);
        assert_true(to_wide(&difference) == vb);
        exact_multiply(&product, &sum, &sum);
        assert_true(to_wide(&product) == (va + vb) * (va + vb));
        exact_multiply(&c, &product, &a);
        exact_subtract(&c, &c, &c);
        bool lost = false;
        assert_int_equal(exact_sign(&c, &lost), 0);
        assert_false(lost);
        for (int i = 1; i < product.count; ++i) {
            double big = product.term[i] < 0 ? -product.term[i] : product.term[i];
            double small = product.term[i - 1] < 0 ? -product.term[i - 1] : product.term[i - 1];
            assert_true(small < big);
        }
    }
}

static void test_tiny_beside_huge(void **state)
{
    (void)state;
    exact a, b, c;
    bool lost = false;
    exact_set(&a, 0x1p100);
    exact_set(&b, 0x1p-140);
    exact_add(&c, &a, &b);
    exact_subtract(&c, &c, &a);
    assert_int_equal(exact_sign(&c, &lost), 1);
    assert_true(exact_estimate(&c) == 0x1p-140);
    exact_multiply(&c, &b, &b);
    exact_multiply(&c, &c, &c);
    assert_int_equal(exact_sign(&c, &lost), 1);
    assert_false(lost);
    assert_true(exact_in_range(0.0) && exact_in_range(-1e-20) && exact_in_range(1e19));
    assert_false(exact_in_range(1e-40) || exact_in_range(1e300));
}

typedef struct integer_meeting {
    int meets; /* 0 no, 1 crosses, 2 in the plane */
    wide numerator, denominator;
} integer_meeting;

static void cross_integer(const int a[3], const int b[3], wide out[3])
{
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        out[i] = (wide)a[j] * b[k] - (wide)a[k] * b[j];
    }
}

static wide dot_integer(const wide a[3], const int b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void minus(const int a[3], const int b[3], int out[3])
{
    for (int i = 0; i < 3; ++i) {
        out[i] = a[i] - b[i];
    }
}

static integer_meeting meet_integer(const int o[3], const int d[3], int v[3][3])
{
    integer_meeting m = {0, 0, 0};
    int e[3], f[3], to[3], p[3], q[3], low = 0, high = 0;
    wide n[3];
    minus(v[1], v[0], e);
    minus(v[2], v[0], f);
    minus(v[0], o, to);
    cross_integer(e, f, n);
    m.numerator = dot_integer(n, to);
    m.denominator = dot_integer(n, d);
    if (m.denominator == 0) {
        m.meets = m.numerator == 0 ? 2 : 0;
        return m;
    }
    for (int i = 0; i < 3; ++i) {
        wide c[3];
        minus(v[i], o, p);
        minus(v[(i + 1) % 3], o, q);
        cross_integer(p, q, c);
        int s = sign_of(dot_integer(c, d));
        low |= s < 0;
        high |= s > 0;
    }
    m.meets = !(low && high);
    return m;
}

static void random_point(int p[3], int size)
{
    for (int i = 0; i < 3; ++i) {
        p[i] = random_below(2 * size + 1) - size;
    }
}

/* Small numbers make touching, edge-on and degenerate cases common. Scaling by a power of two
 * and moving by a large offset changes no answer, but makes plain double arithmetic fail. */
static void test_lines_and_triangles(void **state)
{
    (void)state;
    int seen[3] = {0, 0, 0}, ties = 0;
    for (int round = 0; round < 60000; ++round) {
        int size = 1 + random_below(round % 2 ? 3 : 400);
        int o[3], p[3], d[3], v[2][3][3];
        exact_line line;
        exact_crossing at[2];
        integer_meeting m[2];
        double scale = round % 3 ? 1.0 : 0x1p-40, shift = round % 5 ? 0.0 : 4096.0;
        double from[3], through[3];
        random_point(o, size);
        random_point(p, size);
        minus(p, o, d);
        for (int i = 0; i < 3; ++i) {
            from[i] = scale * (o[i] + shift);
            through[i] = scale * (p[i] + shift);
        }
        exact_line_through(&line, from, through);
        for (int t = 0; t < 2; ++t) {
            float corner[3][3];
            bool lost = false;
            for (int k = 0; k < 3; ++k) {
                random_point(v[t][k], size);
                for (int i = 0; i < 3; ++i) {
                    corner[k][i] = (float)(scale * (v[t][k][i] + shift));
                }
            }
            m[t] = meet_integer(o, d, v[t]);
            exact_meeting got = exact_line_triangle(&line, corner, &at[t], &lost);
            assert_false(lost);
            ++seen[got];
            if (m[t].meets != 2) {
                assert_int_equal(got, m[t].meets ? EXACT_CROSS : EXACT_MISS);
            } else {
                assert_true(got == EXACT_IN_PLANE || got == EXACT_MISS);
            }
            if (got == EXACT_CROSS) {
                assert_int_equal(at[t].facing, sign_of(m[t].denominator));
            }
        }
        if (m[0].meets == 1 && m[1].meets == 1) {
            bool lost = false;
            int expected = sign_of(m[0].numerator * m[1].denominator -
                                   m[1].numerator * m[0].denominator) *
                           sign_of(m[0].denominator) * sign_of(m[1].denominator);
            assert_int_equal(exact_compare(&at[0], &at[1], &lost), expected);
            assert_false(lost);
            ties += expected == 0;
        }
    }
    assert_true(seen[EXACT_MISS] > 1000 && seen[EXACT_CROSS] > 1000 && seen[EXACT_IN_PLANE] > 100);
    assert_true(ties > 50);
}

/* A line in the plane of a triangle: never called free when it touches before the end. */
static void test_lines_in_a_plane(void **state)
{
    (void)state;
    int free_count = 0, touching = 0;
    for (int round = 0; round < 4000; ++round) {
        float v[3][3] = {{0}};
        double from[3] = {0}, through[3] = {0};
        exact_line line;
        exact_crossing end;
        bool lost = false, touches = false;
        for (int i = 0; i < 2; ++i) {
            from[i] = random_below(9) - 4;
            through[i] = random_below(9) - 4;
            for (int k = 0; k < 3; ++k) {
                v[k][i] = (float)(random_below(9) - 4);
            }
        }
        if (from[0] == through[0] && from[1] == through[1]) {
            continue;
        }
        exact_line_through(&line, from, through);
        exact_set(&end.numerator, 1.0);
        exact_set(&end.denominator, 1.0);
        /* Edges crossed strictly before the end, in integers. */
        for (int k = 0; k < 3; ++k) {
            double ax = v[k][0] - from[0], ay = v[k][1] - from[1];
            double bx = v[(k + 1) % 3][0] - from[0], by = v[(k + 1) % 3][1] - from[1];
            double dx = through[0] - from[0], dy = through[1] - from[1];
            double sa = dx * ay - dy * ax, sb = dx * by - dy * bx, length = dx * dx + dy * dy;
            if (sa == 0.0) {
                touches |= ax * dx + ay * dy < length;
            }
            if (sa * sb < 0.0) {
                /* Where a + u (b - a) meets the line, u = sa / (sa - sb). */
                double at = (ax * (sa - sb) + sa * (bx - ax)) * dx +
                            (ay * (sa - sb) + sa * (by - ay)) * dy;
                touches |= sa - sb > 0.0 ? at < length * (sa - sb) : at > length * (sa - sb);
            }
        }
        bool is_free = exact_in_plane_free(&line, v, &end, &lost);
        assert_false(lost);
        assert_false(is_free && touches);
        free_count += is_free;
        touching += touches;
    }
    assert_true(free_count > 300 && touching > 300);
}

static void test_degenerate(void **state)
{
    (void)state;
    bool lost = false;
    float point[3][3] = {{1, 2, 3}, {1, 2, 3}, {1, 2, 3}};
    float needle[3][3] = {{0, 0, 0}, {0.1f, 0.2f, 0.3f}, {0.2f, 0.4f, 0.6f}};
    float thin[3][3] = {{0, 0, 0}, {1, 0, 0}, {2, 1e-30f, 0}};
    assert_true(exact_degenerate(point, &lost));
    assert_true(exact_degenerate(needle, &lost));
    assert_false(exact_degenerate(thin, &lost));
    assert_false(lost);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sums_and_products),   cmocka_unit_test(test_tiny_beside_huge),
        cmocka_unit_test(test_lines_and_triangles), cmocka_unit_test(test_lines_in_a_plane),
        cmocka_unit_test(test_degenerate),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* The side of a plane, against integers and under what must not change it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/orient.h"
#include "geometry/side.h"

__extension__ typedef __int128 wide;

static uint64_t random_state = 1;

static int32_t random_below(uint32_t limit)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (int32_t)((random_state >> 33) % limit);
}

static int reference(const int64_t p[4][3])
{
    wide m[3][3], sum = 0;
    for (int k = 0; k < 3; ++k) {
        for (int i = 0; i < 3; ++i) {
            m[k][i] = p[k + 1][i] - p[0][i];
        }
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, l = (i + 2) % 3;
        sum += m[0][i] * (m[1][j] * m[2][l] - m[1][l] * m[2][j]);
    }
    return sum > 0 ? 1 : sum < 0 ? -1 : 0;
}

/* The same sign both ways, the other one with two points swapped, and in whatever power of two. */
static void assert_sign(const float p[4][3], int wanted)
{
    assert_int_equal(umb_orient(p[0], p[1], p[2], p[3]), wanted);
    assert_int_equal(umb_orient_by_sum(p[0], p[1], p[2], p[3]), wanted);
    assert_int_equal(umb_orient(p[3], p[1], p[2], p[0]), -wanted);
    assert_int_equal(umb_orient(p[1], p[0], p[3], p[2]), wanted);
    assert_int_equal(umb_orient_by_sum(p[2], p[3], p[1], p[0]), -wanted);
}

/* Points of a plane through a lattice, some moved off it by the least there is. */
static void test_lattice_planes(void **state)
{
    (void)state;
    int zeros = 0, others = 0;
    for (int round = 0; round < 200000; ++round) {
        int64_t n[4][3];
        float p[4][3];
        uint32_t size = 4u << random_below(17);
        int32_t i = random_below(5) - 2, j = random_below(5) - 2;
        for (int c = 0; c < 3; ++c) {
            for (int k = 0; k < 3; ++k) {
                n[k][c] = random_below(2 * size) - (int32_t)size;
            }
            n[3][c] = n[0][c] + i * (n[1][c] - n[0][c]) + j * (n[2][c] - n[0][c]);
        }
        n[random_below(4)][random_below(3)] += random_below(3) - 1;
        int exponents[3] = {random_below(60) - 30, random_below(60) - 30, random_below(60) - 30};
        for (int k = 0; k < 4; ++k) {
            for (int c = 0; c < 3; ++c) {
                p[k][c] = ldexpf((float)n[k][c], exponents[c]);
                assert_true(ldexpf(p[k][c], -exponents[c]) == (float)n[k][c] &&
                            llabs(n[k][c]) < 1 << 24);
            }
        }
        int wanted = reference((const int64_t(*)[3])n);
        zeros += wanted == 0 ? 1 : 0;
        others += wanted != 0 ? 1 : 0;
        assert_sign((const float(*)[3])p, wanted);
    }
    assert_true(zeros > 20000 && others > 20000);
}

static float random_float(int reach)
{
    float f = (float)(random_below(1 << 24) - (1 << 23));
    return random_below(8) == 0 ? 0.0f : ldexpf(f, random_below((uint32_t)reach) - reach / 2 - 23);
}

/* Coordinates of very unlike sizes: the shortcuts agree with the sum. */
static void test_unlike_sizes(void **state)
{
    (void)state;
    static const int reaches[4] = {2, 30, 80, 250};
    for (int round = 0; round < 100000; ++round) {
        float p[4][3];
        for (int k = 0; k < 4; ++k) {
            for (int c = 0; c < 3; ++c) {
                p[k][c] = random_float(reaches[round % 4]);
            }
        }
        if (random_below(2)) { /* nearly on one line with the others */
            for (int c = 0; c < 3; ++c) {
                p[3][c] = p[0][c] + (p[1][c] - p[0][c]) * 0.5f;
            }
        }
        assert_sign((const float(*)[3])p, umb_orient_by_sum(p[0], p[1], p[2], p[3]));
    }
}

/* Far from the origin the differences are short though the points are not; next to it a point may
 * be less than any rounding. */
static void test_least_steps(void **state)
{
    (void)state;
    const float big = 0x1p127f, small = 0x1p-149f;
    const float flat[4][3] = {{0, 0, big}, {big, 0, big}, {0, big, big}, {-big, big, big}};
    assert_sign(flat, 0);
    const float off[4][3] = {{0, 0, 0}, {big, 0, 0}, {0, big, 0}, {-big, big, small}};
    assert_sign(off, 1);
    const float under[4][3] = {{0, 0, 0}, {small, 0, 0}, {0, small, 0}, {small, small, -small}};
    assert_sign(under, -1);
    const float slanted[4][3] = {{1, 1, 3}, {2, 1, 4}, {1, 2, 5}, {0x1p20f, small, 0x1p20f + 1.0f}};
    /* The plane is z = x + 2 y; the last point lies above it by 1 - 2 * small. */
    assert_sign(slanted, 1);
    const float huge[4][3] = {{0, 0, 0}, {big, 0, 0}, {0, big, 0}, {0, 0, INFINITY}};
    assert_int_not_equal(umb_orient(huge[0], huge[1], huge[2], huge[3]), 0);
    assert_int_not_equal(umb_orient(huge[3], huge[1], huge[3], huge[0]), 0);
}

/* Points of doubles: multiples of 2^-40 near planes through small whole numbers, where 128-bit sums are exact. */
static void test_sides_of_doubles(void **state)
{
    (void)state;
    uint32_t zeros = 0;
    for (int trial = 0; trial < 200000; ++trial) {
        float plane[3][3];
        double p[3];
        int64_t c[3][3], q[3];
        for (int k = 0; k < 9; ++k) {
            c[k / 3][k % 3] = random_below(41) - 20;
            plane[k / 3][k % 3] = (float)c[k / 3][k % 3];
        }
        int64_t s = random_below(9) - 4, t = random_below(9) - 4;
        for (int i = 0; i < 3; ++i) { /* a + s u + t v, and perhaps a least step beside it */
            q[i] = (c[0][i] + s * (c[1][i] - c[0][i]) + t * (c[2][i] - c[0][i])) * ((int64_t)1 << 40) +
                   (trial % 3 == 0 ? 0 : random_below(3) - 1);
            p[i] = ldexp((double)q[i], -40);
        }
        wide point = 0, along = 0;
        for (int i = 0; i < 3; ++i) {
            int j = (i + 1) % 3, k = (i + 2) % 3;
            wide n = (wide)(c[1][j] - c[0][j]) * (c[2][k] - c[0][k]) - (wide)(c[1][k] - c[0][k]) * (c[2][j] - c[0][j]);
            point += n * (q[i] - c[0][i] * ((int64_t)1 << 40));
            along += n * q[i];
        }
        zeros += point == 0;
        assert_int_equal(umb_side_of_point((const float(*)[3])plane, p), (point > 0) - (point < 0));
        assert_int_equal(umb_side_of_direction((const float(*)[3])plane, p), (along > 0) - (along < 0));
    }
    assert_true(zeros > 50000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lattice_planes),
        cmocka_unit_test(test_unlike_sizes),
        cmocka_unit_test(test_least_steps),
        cmocka_unit_test(test_sides_of_doubles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

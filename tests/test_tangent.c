/* Tangent corners by table against a search over all planes, and the planes that they make. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "occlusion/planes_cache.h"
#include "support/random_boxes.h"

static umb_tangent_table table;

static int rounds(int normal)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && size[0] == 's' ? normal / 10 : size != NULL && size[0] == 'f' ? normal * 20 : normal;
}

static umb_vec3 corner(const umb_aabb *b, uint32_t k, const float a[3])
{
    return umb_vec3_make((k & 1 ? b->max[0] : b->min[0]) - (double)a[0], (k & 2 ? b->max[1] : b->min[1]) - (double)a[1],
                         (k & 4 ? b->max[2] : b->min[2]) - (double)a[2]);
}

/* How far beyond the plane through the edge and corner k the box reaches, as a part of the distances; sign: on which
 * side it should lie. */
static double reach_beyond(const float a[3], const float b[3], const umb_aabb *box, uint32_t k, double sign)
{
    umb_vec3 d = umb_vec3_sub(umb_vec3_from_float(b), umb_vec3_from_float(a));
    umb_vec3 n = umb_vec3_scale(umb_vec3_cross(d, corner(box, k, a)), sign);
    double worst = 0.0;
    for (uint32_t i = 0; i < 8; ++i) {
        umb_vec3 c = corner(box, i, a);
        double size = umb_vec3_length(d) * umb_vec3_length(corner(box, k, a)) * umb_vec3_length(c);
        worst = fmax(worst, size > 0.0 ? -umb_vec3_dot(n, c) / size : 0.0);
    }
    return worst;
}

/* True if the line of the edge passes the box by a good part of its distance, in which case the table must tell. */
static bool passes(const float a[3], const float b[3], const umb_aabb *box)
{
    bool any = false, clear = true;
    for (int k = 0; k < 3; ++k) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        long double di = (long double)b[i] - a[i], dj = (long double)b[j] - a[j];
        long double wi = a[i] - 0.5L * ((long double)box->min[i] + box->max[i]);
        long double wj = a[j] - 0.5L * ((long double)box->min[j] + box->max[j]);
        long double r = 0.5L * (fabsl(dj) * ((long double)box->max[i] - box->min[i]) +
                                fabsl(di) * ((long double)box->max[j] - box->min[j]));
        long double g = dj * wi - di * wj, size = fabsl(dj * wi) + fabsl(di * wj) + r;
        size += fabsl(dj) * (fabsl((long double)box->min[i]) + fabsl((long double)box->max[i])) +
                fabsl(di) * (fabsl((long double)box->min[j]) + fabsl((long double)box->max[j]));
        any = any || fabsl(g) > r;
        clear = clear && (size == 0 || fabsl(fabsl(g) - r) > 1e-12L * size);
    }
    return any && clear;
}

static void test_table(void **state)
{
    (void)state;
    static const double origin[3] = {0, 0, 0};
    uint64_t seed = 17, told = 0, silent = 0;
    umb_tangent_table_make(&table);
    for (int round = 0; round < rounds(300000); ++round) {
        umb_aabb box = random_box(&seed, origin, 10.0);
        float a[3], b[3];
        for (int i = 0; i < 3; ++i) {
            a[i] = (float)random_in(&seed, -20.0, 20.0);
            b[i] = random_below(&seed, 4) == 0 ? a[i] : (float)random_in(&seed, -20.0, 20.0);
            if (random_below(&seed, 8) == 0) { /* in line with a face */
                a[i] = random_below(&seed, 2) == 0 ? box.min[i] : box.max[i];
            }
        }
        umb_tangents t, searched;
        bool ok = umb_tangents_find(&table, a, b, &box, &t);
        if (a[0] == b[0] && a[1] == b[1] && a[2] == b[2]) {
            continue; /* no edge */
        }
        assert_true(ok || !passes(a, b, &box));
        told += ok;
        silent += !ok;
        if (!ok) {
            continue;
        }
        assert_true(t.supporting < 8 && t.separating < 8);
        assert_true(reach_beyond(a, b, &box, t.supporting, 1.0) < 1e-12);
        assert_true(reach_beyond(a, b, &box, t.separating, -1.0) < 1e-12);
        if (umb_tangents_search(a, b, &box, &searched)) { /* another corner may lie in the same plane */
            assert_true(reach_beyond(a, b, &box, searched.supporting, 1.0) < 1e-12);
            assert_true(reach_beyond(a, b, &box, searched.separating, -1.0) < 1e-12);
        }
    }
    printf("# told %llu, silent %llu\n", (unsigned long long)told, (unsigned long long)silent);
    assert_true(told > 4 * silent);
}

/* Of the 27 codes those that an octant knows. */
static void test_codes(void **state)
{
    (void)state;
    umb_tangent_table_make(&table);
    for (int octant = 0; octant < 8; ++octant) {
        int known = 0;
        for (int code = 0; code < 27; ++code) {
            const umb_tangents *t = &table.at[octant][code];
            known += t->supporting != UMB_TANGENT_NONE;
            assert_true(t->supporting == UMB_TANGENT_NONE || t->supporting != t->separating);
        }
        assert_int_equal(table.at[octant][13].supporting, UMB_TANGENT_NONE); /* the line goes through the box */
        assert_true(known >= 18 && known < 27);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_table), cmocka_unit_test(test_codes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

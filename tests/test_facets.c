/* Facets of meshes, and the measures that occluders are chosen by. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "occlusion/facets.h"
#include "occlusion/measure.h"
#include "support/failing.h"
#include "support/random_boxes.h"

enum { MOST = 4096 };

static float positions[MOST][3];
static uint32_t triangles[2 * MOST][3];
static uint8_t sides[2 * MOST];

static const umb_allocator *allocator(void)
{
    static umb_allocator a;
    a = umb_memory_allocator(NULL);
    return &a;
}

static umb_facets make(uint32_t count)
{
    umb_facet_source source = {
        .positions = positions, .triangles = triangles, .two_sided = sides, .triangle_count = count};
    umb_facets f;
    assert_true(umb_facets_build(&f, allocator(), &source));
    return f;
}

/* Every triangle once; loops whose neighbours look back along the same edge; areas that add up. */
static void check_whole(const umb_facets *f, uint32_t count)
{
    static uint8_t met[2 * MOST];
    memset(met, 0, sizeof met);
    for (uint32_t i = 0; i < f->facet_count; ++i) {
        const umb_facet *a = &f->facets[i];
        assert_in_range(a->count, 3, UMB_FACET_CORNERS);
        for (uint32_t k = 0; k < a->triangle_count; ++k) {
            met[f->members[a->first_triangle + k]] += 1;
        }
        for (uint32_t k = 0; k < a->count; ++k) {
            uint32_t from = f->corners[a->first + k], to = f->corners[a->first + (k + 1) % a->count];
            uint32_t other = f->beyond[a->first + k], found = 0;
            assert_true(from != to && other != i);
            for (uint32_t j = 0; other != UMB_NONE && j < f->facets[other].count; ++j) {
                const umb_facet *b = &f->facets[other];
                found += f->corners[b->first + j] == to && f->corners[b->first + (j + 1) % b->count] == from &&
                         f->beyond[b->first + j] == i;
            }
            assert_true(other == UMB_NONE || found == 1);
        }
        assert_true(i == 0 || a->tag > f->facets[i - 1].tag || f->sizes[i] <= f->sizes[i - 1]);
    }
    for (uint32_t t = 0; t < count; ++t) {
        assert_int_equal(met[t], 1);
    }
}

/* A grid of n by n squares, bent along some lines, its triangles cut either way and in any order. */
static uint32_t make_grid(uint64_t *seed, uint32_t n, bool bent)
{
    for (uint32_t k = 0; k < (n + 1) * (n + 1); ++k) {
        uint32_t x = k % (n + 1), y = k / (n + 1);
        positions[k][0] = (float)x;
        positions[k][1] = (float)y;
        positions[k][2] = bent ? (float)(x * x) * 0.25f : 0.0f;
    }
    uint32_t count = 0;
    for (uint32_t k = 0; k < n * n; ++k) {
        uint32_t a = k % n + k / n * (n + 1), b = a + 1, c = a + n + 2, d = a + n + 1;
        const uint32_t cut[2][2][3] = {{{a, b, c}, {a, c, d}}, {{b, c, d}, {b, d, a}}};
        uint32_t way = random_below(seed, 2);
        for (int i = 0; i < 2; ++i) {
            uint32_t turn = random_below(seed, 3);
            for (uint32_t j = 0; j < 3; ++j) {
                triangles[count][j] = cut[way][i][(j + turn) % 3];
            }
            sides[count++] = 0;
        }
    }
    for (uint32_t i = count; i > 1; --i) {
        uint32_t j = random_below(seed, i);
        for (int k = 0; k < 3; ++k) {
            uint32_t t = triangles[i - 1][k];
            triangles[i - 1][k] = triangles[j][k];
            triangles[j][k] = t;
        }
    }
    return count;
}

static void test_grids(void **state)
{
    (void)state;
    uint64_t seed = 5;
    for (uint32_t n = 1; n <= 12; ++n) {
        for (int bent = 0; bent < 2; ++bent) {
            uint32_t count = make_grid(&seed, n, bent == 1);
            umb_facets f = make(count);
            check_whole(&f, count);
            double area = 0.0;
            for (uint32_t i = 0; i < f.facet_count; ++i) {
                area += f.sizes[i];
            }
            assert_true(bent == 1 || fabs(area - n * n) < 1e-4);
            assert_true(f.facet_count <= n * n); /* never left as triangles */
            assert_true(n > 2 || bent == 1 || f.facet_count == 1);
            umb_facets_free(&f, allocator());
        }
    }
}

/* Triangles at random among few vertices: many to an edge, in any direction, without area. */
static void test_disorder(void **state)
{
    (void)state;
    uint64_t seed = 9;
    for (int round = 0; round < 300; ++round) {
        uint32_t vertices = 3 + random_below(&seed, 12), count = random_below(&seed, 60);
        for (uint32_t k = 0; k < vertices; ++k) {
            for (int i = 0; i < 3; ++i) {
                positions[k][i] = (float)random_below(&seed, 3) * (i == 2 ? (float)random_below(&seed, 2) : 1.0f);
            }
        }
        for (uint32_t t = 0; t < count; ++t) {
            triangles[t][0] = random_below(&seed, vertices);
            triangles[t][1] = (triangles[t][0] + 1 + random_below(&seed, vertices - 2)) % vertices;
            do {
                triangles[t][2] = random_below(&seed, vertices);
            } while (triangles[t][2] == triangles[t][0] || triangles[t][2] == triangles[t][1]);
            sides[t] = (uint8_t)random_below(&seed, 2);
        }
        umb_facets f = make(count);
        check_whole(&f, count);
        umb_facets_free(&f, allocator());
    }
}

static void test_memory(void **state)
{
    (void)state;
    uint64_t seed = 3;
    uint32_t count = make_grid(&seed, 8, true);
    umb_facet_source source = {
        .positions = positions, .triangles = triangles, .two_sided = sides, .triangle_count = count};
    bool done = false;
    for (long long limit = 0; !done; ++limit) {
        failing f;
        umb_allocator a = failing_allocator(&f, limit);
        umb_facets facets;
        done = umb_facets_build(&facets, &a, &source);
        umb_facets_free(&facets, &a);
        assert_true(atomic_load(&f.held) == 0);
    }
}

static umb_vec3 around(uint64_t *seed, double size)
{
    return umb_vec3_make(random_in(seed, -size, size), random_in(seed, -size, size), random_in(seed, -size, size));
}

/* A closed surface around the eye fills the sphere, one beside it nothing; a small far polygon looks as large as its
 * area-angle says; a shadow grows with the square of the distance. */
static void test_measures(void **state)
{
    (void)state;
    static const uint8_t faces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    const double pi = 3.14159265358979323846;
    uint64_t seed = 21;
    for (int round = 0; round < 2000; ++round) {
        bool within = round % 2 == 0;
        umb_vec3 eye = within ? around(&seed, 0.99) : umb_vec3_add(around(&seed, 1.0), umb_vec3_make(2.5, 0, 0));
        double sum = 0.0;
        for (int k = 0; k < 6; ++k) {
            umb_vec3 corners[4];
            for (int i = 0; i < 4; ++i) {
                uint8_t c = faces[k][i];
                corners[i] = umb_vec3_sub(umb_vec3_make(c & 1 ? 1 : -1, c & 2 ? 1 : -1, c & 4 ? 1 : -1), eye);
            }
            sum += umb_measure_solid_angle(corners, 4);
        }
        assert_true(fabs(fabs(sum) - (within ? 4.0 * pi : 0.0)) < 1e-9);
        umb_vec3 centre = umb_vec3_scale(around(&seed, 1.0), 1000.0), corners[3], mean = {0, 0, 0};
        for (int i = 0; i < 3; ++i) {
            corners[i] = umb_vec3_add(centre, around(&seed, 1.0));
            mean = umb_vec3_add(mean, umb_vec3_scale(corners[i], 1.0 / 3.0));
        }
        umb_vec3 area = umb_vec3_scale(
            umb_vec3_cross(umb_vec3_sub(corners[1], corners[0]), umb_vec3_sub(corners[2], corners[0])), 0.5);
        double exact = umb_measure_solid_angle(corners, 3), quick = umb_measure_area_angle(area, mean);
        double distance = umb_vec3_length(mean);
        assert_true(distance < 50.0 || fabs(exact - quick) < 0.1 * fabs(exact) + 20.0 / (distance * distance * distance));
        umb_vec3 n = umb_vec3_scale(mean, 1.0 / distance);
        double depth = 0.0, delta = random_in(&seed, 0.1, 10.0);
        for (int i = 0; i < 3; ++i) {
            depth = fmax(depth, umb_vec3_dot(n, corners[i]));
        }
        double growth = umb_measure_umbra_growth(corners, 3, n, delta), wanted = (depth + delta) / depth;
        assert_true(distance < 50.0 || fabs(growth - wanted * wanted) < 1e-6);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_grids), cmocka_unit_test(test_disorder),
                                       cmocka_unit_test(test_memory), cmocka_unit_test(test_measures)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

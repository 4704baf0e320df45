/* The oracle for regions: scenes whose answer can be said, its witnesses against a slow tracer, and
 * the oracle for views at many eyes of a cell. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/micro_scenes.h"
#include "truth/oracle.h"
#include "truth/region_truth.h"

static uint32_t add_mesh(model *m, const float *positions, uint32_t vertices,
                         const uint32_t *indices, uint32_t triangles, uint8_t flags)
{
    uint8_t f[16];
    memset(f, flags, sizeof f);
    model_mesh mesh = {.positions = (float *)(uintptr_t)positions,
                       .indices = (uint32_t *)(uintptr_t)indices,
                       .flags = f,
                       .position_count = vertices,
                       .triangle_count = triangles};
    uint32_t number = model_add_mesh(m, &mesh);
    assert_int_not_equal(number, MODEL_NONE);
    return number;
}

/* x0 .. x1, y0 .. y1 at height z, its front towards +z. */
static uint32_t add_wall(model *m, const double at[5], uint8_t flags)
{
    float x0 = (float)at[0], x1 = (float)at[1], y0 = (float)at[2], y1 = (float)at[3];
    float z = (float)at[4];
    const float p[12] = {x0, y0, z, x1, y0, z, x1, y1, z, x0, y1, z};
    const uint32_t i[6] = {0, 1, 2, 0, 2, 3};
    return model_add_object(m, "wall", add_mesh(m, p, 4, i, 2, flags), NULL);
}

static uint32_t add_box(model *m, const double at[3], double half)
{
    float p[24];
    static const uint32_t i[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                   2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    for (uint32_t k = 0; k < 8; ++k) {
        for (uint32_t c = 0; c < 3; ++c) {
            p[3 * k + c] = (float)(at[c] + (k >> c & 1 ? half : -half));
        }
    }
    return model_add_object(m, "box", add_mesh(m, p, 8, i, 12, 0), NULL);
}

static region_cell make_cell(double x0, double y0, double z0, double x1, double y1, double z1)
{
    return (region_cell){.min = {x0, y0, z0}, .max = {x1, y1, z1}};
}

/* Search, with both forms of the traced scene; the answer of the last one is returned. */
static region_result search(const model *m, const region_cell *cell, const region_options *options,
                            oracle_form form)
{
    umb_error error = {0};
    region_result r;
    truth *t = oracle_create(m, form, &error);
    assert_non_null(t);
    if (!region_search(t, cell, options, &r, &error)) {
        fail_msg("%s", error.text);
    }
    truth_destroy(t);
    return r;
}

static bool is_seen(const region_result *r, uint32_t object)
{
    return r->witness_of[object] != MODEL_NONE && r->witnesses[r->witness_of[object]].confirmed;
}

static void expect(model *m, const region_cell *cell, const int *seen)
{
    umb_error error = {0};
    assert_true(model_finish(m, NULL, &error));
    for (int form = ORACLE_FLAT; form <= ORACLE_INSTANCED; ++form) {
        region_options options = {.rays = 200000, .seed = 3};
        region_result r = search(m, cell, &options, (oracle_form)form);
        for (uint32_t i = 0; i < m->object_count; ++i) {
            if (is_seen(&r, i) != (seen[i] != 0)) {
                fail_msg("object %u: seen %d, expected %d (form %d)", i, is_seen(&r, i), seen[i],
                         form);
            }
        }
        region_result_free(&r);
    }
    model_free(m);
}

/* A wall with a slit of width w at x in [0, w], a cell [-1, 1] x [-1, 1] x [1, 2] in front of it. What
 * lies at depth d behind is seen through it for x from -d (1 + ...) on: lines from the cell's near
 * corners to the slit's opposite edges bound it. */
static void test_slit(void **state)
{
    (void)state;
    const double widths[] = {0.3, 1e-2, 1e-4};
    for (int k = 0; k < 3; ++k) {
        double w = widths[k], d = 6.0;
        model *m = model_create();
        region_cell cell = make_cell(-1, -1, 1, 1, 1, 2);
        add_wall(m, (double[]){-50, 0, -50, 50, 0}, 0);
        add_wall(m, (double[]){w, 50, -50, 50, 0}, 0);
        /* From (1, ., 1) through (0, ., 0) down to depth d: x = -d; the other way w + d (1 + w). */
        add_box(m, (double[]){-d + 0.3, 0, -d}, 0.2);
        add_box(m, (double[]){0, 0.5, -d}, 0.2);
        add_box(m, (double[]){d - 0.3, 0, -d}, 0.2);
        add_box(m, (double[]){-d - 0.6, 0, -d}, 0.2);
        add_box(m, (double[]){d * (1 + w) + w + 0.6, 0, -d}, 0.2);
        expect(m, &cell, (int[]){1, 1, 1, 1, 1, 0, 0});
    }
}

static void test_kinds_of_triangles(void **state)
{
    (void)state;
    region_cell cell = make_cell(-1, -1, 1, 1, 1, 2);
    model *m = model_create();
    add_wall(m, (double[]){-90, 90, -90, 90, 0}, UMB_TRIANGLE_OPEN);
    add_box(m, (double[]){0, 0, -5}, 0.5);
    add_wall(m, (double[]){-90, 90, -90, 90, -8}, 0);
    add_box(m, (double[]){0, 0, -12}, 0.5);
    expect(m, &cell, (int[]){1, 1, 1, 0});
    /* A wall seen from its back: one renderer sees it and nothing else, the other sees through it. */
    m = model_create();
    cell = make_cell(-1, -1, -3, 1, 1, -2);
    add_wall(m, (double[]){-90, 90, -90, 90, 0}, 0);
    add_box(m, (double[]){0, 0, 5}, 0.5);
    add_wall(m, (double[]){-90, 90, -90, 90, 8}, UMB_TRIANGLE_TWO_SIDED);
    add_box(m, (double[]){0, 0, 12}, 0.5);
    expect(m, &cell, (int[]){1, 1, 1, 0});
}

/* Cells that are flat, lines, points; that hold things; that touch them. */
static void test_cells(void **state)
{
    (void)state;
    const region_cell cells[] = {
        make_cell(-1, -1, 2, 1, 1, 2), make_cell(0, -1, 2, 0, 1, 3),
        make_cell(0, 0, 2, 0, 0, 3),   make_cell(0, 0, 2, 0, 0, 2),
        make_cell(-1, -1, 0, 1, 1, 2), make_cell(-80, -80, 0.5, 80, 80, 3),
    };
    for (size_t k = 0; k < sizeof cells / sizeof cells[0]; ++k) {
        model *m = model_create();
        add_wall(m, (double[]){-90, 90, -90, 90, 0}, 0);
        add_box(m, (double[]){0, 0, -5}, 0.5);
        add_box(m, (double[]){0.3, 0, 5}, 0.5);
        add_box(m, (double[]){0.3, 0, 1}, 0.25);
        expect(m, &cells[k], (int[]){1, 0, 1, 1});
    }
}

/* A cell across a wall sees both sides; near cuts away what stands too close. */
static void test_across_and_near(void **state)
{
    (void)state;
    region_cell cell = make_cell(-1, -1, -1, 1, 1, 1);
    model *m = model_create();
    add_wall(m, (double[]){-90, 90, -90, 90, 0}, UMB_TRIANGLE_TWO_SIDED);
    add_box(m, (double[]){0, 0, -5}, 0.5);
    add_box(m, (double[]){0, 0, 5}, 0.5);
    expect(m, &cell, (int[]){1, 1, 1});
    for (int near_cut = 0; near_cut < 2; ++near_cut) {
        m = model_create();
        cell = make_cell(-1, -1, 1, 1, 1, 2);
        cell.near_distance = near_cut ? 1.5 : 0.5;
        add_wall(m, (double[]){-90, 90, -90, 90, 0}, UMB_TRIANGLE_TWO_SIDED);
        add_box(m, (double[]){0, 0, -5}, 0.5);
        expect(m, &cell, (int[]){1, near_cut});
    }
}

/* Does the open segment meet the triangle, by more than rounding? */
static bool crosses(const double from[3], const double to[3], float v[3][3])
{
    long double d[3], e[3], f[3], s[3], p[3], q[3];
    for (int i = 0; i < 3; ++i) {
        d[i] = (long double)to[i] - from[i];
        e[i] = (long double)v[1][i] - v[0][i];
        f[i] = (long double)v[2][i] - v[0][i];
        s[i] = (long double)from[i] - v[0][i];
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        p[i] = d[j] * f[k] - d[k] * f[j];
        q[i] = s[j] * e[k] - s[k] * e[j];
    }
    long double det = e[0] * p[0] + e[1] * p[1] + e[2] * p[2];
    if (fabsl(det) < 1e-15L) {
        return false;
    }
    long double u = (s[0] * p[0] + s[1] * p[1] + s[2] * p[2]) / det;
    long double w = (d[0] * q[0] + d[1] * q[1] + d[2] * q[2]) / det;
    long double at = (f[0] * q[0] + f[1] * q[1] + f[2] * q[2]) / det;
    const long double slack = 1e-9L;
    return u > slack && w > slack && u + w < 1 - slack && at > slack && at < 1 - slack;
}

static bool from_front(const double from[3], const double to[3], float v[3][3])
{
    double sum = 0;
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        double n = ((double)v[1][j] - v[0][j]) * ((double)v[2][k] - v[0][k]) -
                   ((double)v[1][k] - v[0][k]) * ((double)v[2][j] - v[0][j]);
        sum += n * (to[i] - from[i]);
    }
    return sum <= 0;
}

static void check_witness(const truth *t, const region_cell *cell, const region_witness *w)
{
    double start = 0.0, size = 1e-9;
    for (int i = 0; i < 3; ++i) {
        size = fmax(size, fabs(w->eye[i]));
        assert_true(w->eye[i] >= cell->min[i] && w->eye[i] <= cell->max[i]);
        start += (w->from[i] - w->eye[i]) * (w->from[i] - w->eye[i]);
    }
    assert_true(sqrt(start) <= cell->near_distance * (1 + 1e-9) + 1e-12 * size);
    for (uint32_t o = 0; o < t->model->object_count; ++o) {
        uint64_t count = t->first_triangle[o + 1] - t->first_triangle[o];
        for (uint32_t k = 0; k < count; ++k) {
            uint8_t flags = oracle_flags(t, o, k);
            float v[3][3];
            oracle_triangle(t, o, k, v);
            bool itself = o == w->object && k == w->triangle;
            bool blocks = !itself && (flags & UMB_TRIANGLE_OPEN) == 0 &&
                          (w->renderer == TRUTH_TWO_SIDED || flags & UMB_TRIANGLE_TWO_SIDED ||
                           from_front(w->from, w->to, v));
            if (blocks && crosses(w->from, w->to, v)) {
                fail_msg("object %u triangle %u is in the way to object %u triangle %u", o, k,
                         w->object, w->triangle);
            }
        }
    }
}

static bool is_small(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && size[0] == 's';
}

static region_cell cell_at(const double eye[3], const model *m, uint64_t number)
{
    static const double sizes[4] = {0.0, 0.01, 0.1, 0.5};
    region_cell cell = {.near_distance = number % 5 == 0 ? 0.05 : 0.0};
    for (int i = 0; i < 3; ++i) {
        double extent = (double)m->bounds.max[i] - m->bounds.min[i];
        double half = 0.5 * extent * sizes[(number >> i) % 4];
        cell.min[i] = eye[i] - half;
        cell.max[i] = eye[i] + half;
    }
    return cell;
}

/* Every line holds, whatever the scene; any number of workers finds the same; a mistake is told. */
static void test_witnesses(void **state)
{
    (void)state;
    umb_pool *pool;
    assert_int_equal(umb_pool_create(3, &pool), UMB_OK);
    uint64_t scenes = is_small() ? 10 : 40, checked = 0;
    for (uint64_t i = 0; i < scenes; ++i) {
        micro_scene micro;
        umb_error error = {0};
        assert_true(micro_scene_make(i, &micro));
        truth *t = truth_create(micro.model, &error);
        assert_non_null(t);
        uint32_t objects = micro.model->object_count;
        region_cell cell = cell_at(micro.view.eye, micro.model, i);
        region_options one = {.rays = 60000, .seed = i};
        region_options three = {.rays = 60000, .seed = i, .tasks = umb_pool_tasks(pool)};
        region_result a, b;
        assert_true(region_search(t, &cell, &one, &a, &error));
        assert_true(region_search(t, &cell, &three, &b, &error));
        assert_int_equal(a.witness_count, b.witness_count);
        assert_int_equal(a.rays, b.rays);
        for (uint32_t k = 0; k < a.witness_count; ++k) {
            assert_memory_equal(a.witnesses[k].to, b.witnesses[k].to, sizeof a.witnesses[k].to);
            if (k % 7 == i % 7) {
                check_witness(t, &cell, &a.witnesses[k]);
                ++checked;
            }
        }
        uint8_t *accused = calloc(objects + 1, 1);
        assert_non_null(accused);
        for (uint32_t k = 0; k < objects; ++k) {
            accused[k] = (uint8_t)(k % 3 == 0);
        }
        three.accused = accused;
        region_result_free(&b);
        assert_true(region_search(t, &cell, &three, &b, &error));
        uint32_t wrong = 0;
        for (uint32_t k = 0; k < objects; ++k) {
            wrong += accused[k] && is_seen(&b, k);
        }
        assert_int_equal(wrong, b.wrong);
        free(accused);
        region_result_free(&a);
        region_result_free(&b);
        truth_destroy(t);
        micro_scene_free(&micro);
    }
    umb_pool_destroy(pool);
    print_message("%llu lines checked\n", (unsigned long long)checked);
}

/* What eyes anywhere in the cell see, the cell sees. */
static void test_against_views(void **state)
{
    (void)state;
    uint64_t scenes = is_small() ? 5 : 24, from_views = 0, missed = 0;
    for (uint64_t i = 0; i < scenes; ++i) {
        micro_scene micro;
        umb_error error = {0};
        assert_true(micro_scene_make(i * 3 + 1, &micro));
        const model *m = micro.model;
        truth *t = truth_create(m, &error);
        assert_non_null(t);
        region_cell cell = cell_at(micro.view.eye, m, i * 5 + 1);
        /* The near plane of these views is farther from the eye at the picture's corners. */
        double x = fmax(fabs(micro.view.x_min), fabs(micro.view.x_max));
        double y = fmax(fabs(micro.view.y_min), fabs(micro.view.y_max));
        cell.near_distance = micro.view.near_depth * sqrt(1.0 + x * x + y * y);
        region_options options = {.rays = 600000, .seed = i};
        region_result r;
        assert_true(region_search(t, &cell, &options, &r, &error));
        for (uint64_t k = 0; k < 12; ++k) {
            umb_view view = micro.view;
            for (int c = 0; c < 3; ++c) {
                double share = k < 8 ? (double)(k >> c & 1)
                                     : oracle_unit(oracle_mix(i, k, (uint64_t)c));
                view.eye[c] = cell.min[c] + share * (cell.max[c] - cell.min[c]);
            }
            view.min_pixels = 0.0;
            truth_options few = {.grid_width = 48, .grid_height = 48, .guided_rays = 30000};
            truth_result seen;
            assert_true(truth_view(t, &view, &few, &seen, &error));
            for (uint32_t o = 0; o < m->object_count; ++o) {
                bool visible = seen.culling[o].confirmed || seen.two_sided[o].confirmed;
                from_views += visible;
                missed += visible && !is_seen(&r, o);
            }
            truth_result_free(&seen);
        }
        region_result_free(&r);
        truth_destroy(t);
        micro_scene_free(&micro);
    }
    print_message("%llu seen from single eyes, %llu not found from the cell\n",
                  (unsigned long long)from_views, (unsigned long long)missed);
    assert_true(missed * 500 <= from_views);
}

static void test_bad_cells(void **state)
{
    (void)state;
    umb_error error = {0};
    model *m = model_create();
    add_wall(m, (double[]){-1, 1, -1, 1, 0}, 0);
    assert_true(model_finish(m, NULL, &error));
    truth *t = truth_create(m, &error);
    region_cell cells[] = {make_cell(0, 0, 1, -1, 1, 2), make_cell(0, 0, NAN, 1, 1, 2),
                           make_cell(0, 0, 1, INFINITY, 1, 2), make_cell(0, 0, 1, 1, 1, 2)};
    cells[3].near_distance = -1.0;
    for (int k = 0; k < 4; ++k) {
        region_result r;
        error.code = UMB_OK;
        assert_false(region_search(t, &cells[k], NULL, &r, &error));
        assert_int_equal(error.code, UMB_ERROR_ARGUMENT);
    }
    truth_destroy(t);
    model_free(m);
    /* Nothing to see is no error. */
    m = model_create();
    assert_true(model_finish(m, NULL, &error));
    t = truth_create(m, &error);
    region_cell cell = make_cell(0, 0, 0, 1, 1, 1);
    region_options options = {.rays = 10000};
    region_result r;
    assert_true(region_search(t, &cell, &options, &r, &error));
    assert_int_equal(r.seen_triangles, 0);
    region_result_free(&r);
    truth_destroy(t);
    model_free(m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_slit),      cmocka_unit_test(test_kinds_of_triangles),
        cmocka_unit_test(test_cells),     cmocka_unit_test(test_across_and_near),
        cmocka_unit_test(test_witnesses), cmocka_unit_test(test_against_views),
        cmocka_unit_test(test_bad_cells),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Views: recovered from matrices of every convention, planes against projected points, refused
 * input. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "support/random_boxes.h"

/* ---- matrices from views ---------------------------------------------------------------------- */

static void set_row(umb_matrix_def *m, int row, const double n[3], double c)
{
    for (int j = 0; j < 4; ++j) {
        double v = j < 3 ? n[j] : c;
        m->m[m->column_major ? 4 * j + row : 4 * row + j] = v;
    }
}

static double along(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* The row a (d.axis) + b (d.forward) + c, as a function of the point. */
static void set_combination(umb_matrix_def *m, int row, const umb_view *v, const double axis[3],
                            double a, double b, double c)
{
    double n[3];
    for (int i = 0; i < 3; ++i) {
        n[i] = a * axis[i] + b * v->forward[i];
    }
    set_row(m, row, n, c - along(n, v->eye));
}

static void depth_ends(umb_depth_range range, double *near_z, double *far_z)
{
    *near_z = range == UMB_DEPTH_MINUS_ONE_TO_ONE ? -1.0
              : range == UMB_DEPTH_ZERO_TO_ONE    ? 0.0
                                                  : 1.0;
    *far_z = range == UMB_DEPTH_ONE_TO_ZERO ? 0.0 : 1.0;
}

static umb_matrix_def matrix_of(const umb_view *v, umb_depth_range range, bool column_major,
                                bool y_down, double scale)
{
    umb_matrix_def m = {.depth_range = range, .column_major = column_major, .y_down = y_down};
    double z0, z1;
    depth_ends(range, &z0, &z1);
    double n = v->near_depth, f = v->far_depth;
    double kx = scale / (v->x_max - v->x_min), sx = (v->x_max + v->x_min) * kx;
    double ky = scale / (v->y_max - v->y_min), sy = (v->y_max + v->y_min) * ky;
    if (y_down) {
        ky = -ky;
        sy = -sy;
    }
    const double zero[3] = {0, 0, 0};
    if (v->projection == UMB_PERSPECTIVE) {
        double a = isinf(f) ? z1 : (z1 * f - z0 * n) / (f - n);
        set_combination(&m, 0, v, v->right, 2.0 * kx, -sx, 0.0);
        set_combination(&m, 1, v, v->up, 2.0 * ky, -sy, 0.0);
        set_combination(&m, 2, v, zero, 0.0, scale * a, scale * (z0 - a) * n);
        set_combination(&m, 3, v, zero, 0.0, scale, 0.0);
    } else {
        double a = (z1 - z0) / (f - n);
        set_combination(&m, 0, v, v->right, 2.0 * kx, 0.0, -sx);
        set_combination(&m, 1, v, v->up, 2.0 * ky, 0.0, -sy);
        set_combination(&m, 2, v, zero, 0.0, scale * a, scale * (z0 - a * n));
        set_row(&m, 3, zero, scale);
    }
    return m;
}

/* A random view; left-handed for every other one. */
static umb_view any_handed_view(uint64_t *seed, double scale)
{
    umb_view v = random_view(seed, scale);
    v.plane_count = 0;
    if (random_below(seed, 2) == 0) {
        for (int i = 0; i < 3; ++i) {
            v.right[i] = -v.right[i];
        }
    }
    return v;
}

static void assert_close(double a, double b, double tolerance)
{
    if (!(fabs(a - b) <= tolerance) && !(isinf(a) && a == b)) {
        fail_msg("%.17g is not %.17g to within %g", a, b, tolerance);
    }
}

static void test_matrix(void **state)
{
    (void)state;
    uint64_t seed = 21;
    for (int i = 0; i < 20000; ++i) {
        umb_view v = any_handed_view(&seed, pow(10.0, random_in(&seed, -3, 5)));
        umb_matrix_def m = matrix_of(&v, (umb_depth_range)(i % 3), random_below(&seed, 2) == 0,
                                     random_below(&seed, 2) == 0,
                                     pow(10.0, random_in(&seed, -3, 3)));
        umb_view r;
        memset(&r, 0x55, sizeof(r));
        assert_int_equal(umb_view_from_matrix(&r, &m), UMB_OK);
        assert_int_equal(r.projection, v.projection);
        double size = fabs(v.eye[0]) + fabs(v.eye[1]) + fabs(v.eye[2]);
        for (int a = 0; a < 3; ++a) {
            assert_close(r.right[a], v.right[a], 1e-9);
            assert_close(r.up[a], v.up[a], 1e-9);
            assert_close(r.forward[a], v.forward[a], 1e-9);
        }
        /* A parallel view's eye may lie elsewhere: compare ranges as seen from the origin. */
        double x = along(r.right, r.eye) - along(v.right, v.eye);
        double y = along(r.up, r.eye) - along(v.up, v.eye);
        double z = along(r.forward, r.eye) - along(v.forward, v.eye);
        double tolerance = 1e-9 *
                           (size + fabs(v.x_max) + fabs(v.x_min) + fabs(v.y_max) + fabs(v.y_min));
        if (v.projection == UMB_PERSPECTIVE) {
            assert_close(x, 0.0, tolerance);
            assert_close(y, 0.0, tolerance);
            assert_close(z, 0.0, tolerance);
            x = y = z = 0.0;
            tolerance = 1e-8 * (fabs(v.x_max) + fabs(v.x_min) + fabs(v.y_max) + fabs(v.y_min));
        }
        assert_close(r.x_min + x, v.x_min, tolerance);
        assert_close(r.x_max + x, v.x_max, tolerance);
        assert_close(r.y_min + y, v.y_min, tolerance);
        assert_close(r.y_max + y, v.y_max, tolerance);
        double reach = isinf(v.far_depth) ? v.near_depth : v.far_depth;
        assert_close(r.near_depth + z, v.near_depth, 1e-9 * (size + reach));
        assert_close(r.far_depth + z, v.far_depth, 1e-6 * (size + reach));
        assert_int_equal(r.plane_count + r.width + r.height + r.buffer_width + r.buffer_height, 0);
        assert_true(r.min_pixels == 0.0 && r.time == 0.0);
    }
}

/* A matrix that went through floats, as engines have it, is still taken. */
static void test_float_matrix(void **state)
{
    (void)state;
    uint64_t seed = 22;
    for (int i = 0; i < 20000; ++i) {
        umb_view v = any_handed_view(&seed, 10.0);
        umb_matrix_def m = matrix_of(&v, (umb_depth_range)(i % 3), false, false, 1.0);
        for (int k = 0; k < 16; ++k) {
            m.m[k] = (float)m.m[k];
        }
        umb_view r;
        assert_int_equal(umb_view_from_matrix(&r, &m), UMB_OK);
        assert_close(r.near_depth - v.near_depth, along(v.forward, v.eye) - along(r.forward, r.eye),
                     1e-2);
    }
}

/* ---- planes ------------------------------------------------------------------------------------- */

static void test_planes(void **state)
{
    (void)state;
    uint64_t seed = 23;
    uint64_t inside = 0;
    for (int i = 0; i < 5000; ++i) {
        umb_view v = any_handed_view(&seed, 10.0);
        umb_matrix_def m = matrix_of(&v, UMB_DEPTH_MINUS_ONE_TO_ONE, false, false, 1.0);
        double planes[16][4];
        uint32_t count = umb_view_planes(&v, planes);
        assert_int_equal(count, isinf(v.far_depth) ? 5 : 6);
        for (uint32_t k = 0; k < count; ++k) {
            assert_close(along(planes[k], planes[k]), 1.0, 1e-12);
        }
        for (int j = 0; j < 20; ++j) {
            double p[3], clip[4];
            double depth = random_in(&seed, -5.0, 20.0);
            for (int a = 0; a < 3; ++a) {
                p[a] = v.eye[a] + v.forward[a] * depth + random_in(&seed, -4.0, 4.0);
            }
            for (int k = 0; k < 4; ++k) {
                clip[k] = along(&m.m[4 * k], p) + m.m[4 * k + 3];
            }
            /* The brute-force test of a clip volume, in the order of the planes. */
            double clip_planes[6] = {clip[3] + clip[0], clip[3] - clip[0], clip[3] + clip[1],
                                     clip[3] - clip[1], clip[3] + clip[2], clip[3] - clip[2]};
            bool all = true;
            for (uint32_t k = 0; k < count; ++k) {
                double g = along(planes[k], p) + planes[k][3];
                if (fabs(g) > 1e-9) {
                    assert_true((g > 0.0) == (clip_planes[k] > 0.0));
                }
                all = all && g > 0.0;
            }
            inside += all;
        }
    }
    assert_true(inside > 1000);
}

static void test_extra_planes(void **state)
{
    (void)state;
    umb_view v;
    double eye[3] = {0, 0, 0}, target[3] = {0, 0, -1}, up[3] = {0, 1, 0};
    assert_int_equal(umb_view_look_at(&v, eye, target, up, 1.0, 2.0, 0.1, INFINITY), UMB_OK);
    v.plane_count = 2;
    double extra[2][4] = {{0, 3, 4, 10}, {1e-20, 0, 0, -2e-20}};
    memcpy(v.planes, extra, sizeof(extra));
    assert_int_equal(umb_view_check(&v, NULL), UMB_OK);
    double planes[16][4];
    assert_int_equal(umb_view_planes(&v, planes), 7);
    assert_close(planes[5][1], 0.6, 1e-15);
    assert_close(planes[5][2], 0.8, 1e-15);
    assert_close(planes[5][3], 2.0, 1e-15);
    assert_close(planes[6][0], 1.0, 1e-15);
    assert_close(planes[6][3], -2.0, 1e-15);
}

/* ---- look at ------------------------------------------------------------------------------------ */

static void test_look_at(void **state)
{
    (void)state;
    umb_view v;
    double eye[3] = {1, 2, 3}, target[3] = {1, 2, -7}, up[3] = {0, 5, 1};
    memset(&v, 0x55, sizeof(v));
    assert_int_equal(umb_view_look_at(&v, eye, target, up, 1.2, 1.5, 0.25, 60.0), UMB_OK);
    double right[3] = {1, 0, 0}, upright[3] = {0, 1, 0}, forward[3] = {0, 0, -1};
    for (int i = 0; i < 3; ++i) {
        assert_close(v.eye[i], eye[i], 0.0);
        assert_close(v.right[i], right[i], 1e-15);
        assert_close(v.up[i], upright[i], 1e-15);
        assert_close(v.forward[i], forward[i], 1e-15);
    }
    assert_close(v.y_max, tan(0.6), 1e-15);
    assert_close(v.y_min, -tan(0.6), 1e-15);
    assert_close(v.x_max, 1.5 * tan(0.6), 1e-15);
    assert_close(v.x_min, -1.5 * tan(0.6), 1e-15);
    assert_int_equal(v.plane_count + v.width + v.buffer_height, 0);
    assert_int_equal(umb_view_look_at_ortho(&v, eye, target, up, 8.0, 0.5, -3.0, 0.0), UMB_OK);
    assert_int_equal(v.projection, UMB_ORTHOGRAPHIC);
    assert_close(v.y_max, 4.0, 0.0);
    assert_close(v.x_min, -2.0, 0.0);
    assert_close(v.near_depth, -3.0, 0.0);
}

/* Along up: the axis after up's largest component takes its place: x, y, z, x. */
static void test_along_up(void **state)
{
    (void)state;
    for (int axis = 0; axis < 3; ++axis) {
        for (int sign = -1; sign <= 1; sign += 2) {
            for (int off = 0; off < 2; ++off) {
                double eye[3] = {0.5, 0.5, 0.5}, target[3] = {0.5, 0.5, 0.5}, up[3] = {0, 0, 0};
                int next = (axis + 1) % 3, last = (axis + 2) % 3;
                up[axis] = 2.0;
                target[axis] += sign * 8.0;
                /* sine 9e-7: still along; 1.1e-6: no longer */
                target[last] += 8.0 * (off == 0 ? 9e-7 : 1.1e-6);
                umb_view v;
                assert_int_equal(umb_view_look_at(&v, eye, target, up, 1.0, 1.0, 0.1, 10.0), UMB_OK);
                if (off == 0) {
                    assert_true(v.up[next] > 0.999999);
                } else {
                    assert_true(fabs(v.up[last]) > 0.999999);
                }
            }
        }
    }
}

/* ---- what is refused ------------------------------------------------------------------------------ */

static umb_view good_view(void)
{
    umb_view v;
    double eye[3] = {0, 1, 2}, target[3] = {3, 4, 5}, up[3] = {0, 1, 0};
    assert_int_equal(umb_view_look_at(&v, eye, target, up, 1.0, 1.0, 0.1, 100.0), UMB_OK);
    v.plane_count = 1;
    v.planes[0][0] = 1.0;
    return v;
}

static void refuse(const umb_view *v)
{
    umb_error error = {0};
    assert_int_equal(umb_view_check(v, &error), UMB_ERROR_ARGUMENT);
    assert_int_equal(error.code, UMB_ERROR_ARGUMENT);
    assert_true(strlen(error.text) > 10);
    assert_int_equal(umb_view_check(v, NULL), UMB_ERROR_ARGUMENT);
}

static void test_check_numbers(void **state)
{
    (void)state;
    const double bad[] = {NAN, INFINITY, -INFINITY, 1e31};
    umb_view v = good_view();
    assert_int_equal(umb_view_check(&v, NULL), UMB_OK);
    double *numbers[] = {&v.eye[0],     &v.eye[2],       &v.right[0],    &v.up[1],
                         &v.forward[2], &v.x_min,        &v.x_max,       &v.y_min,
                         &v.y_max,      &v.near_depth,   &v.far_depth,   &v.min_pixels,
                         &v.time,       &v.planes[0][0], &v.planes[0][3]};
    for (size_t i = 0; i < sizeof(numbers) / sizeof(numbers[0]); ++i) {
        for (int b = 0; b < 4; ++b) {
            double keep = *numbers[i];
            bool allowed = (numbers[i] == &v.far_depth && bad[b] == INFINITY) ||
                           (numbers[i] == &v.time && bad[b] == 1e31);
            *numbers[i] = bad[b];
            if (allowed) {
                assert_int_equal(umb_view_check(&v, NULL), UMB_OK);
            } else {
                refuse(&v);
            }
            *numbers[i] = keep;
        }
    }
    assert_int_equal(umb_view_check(&v, NULL), UMB_OK);
}

#define REFUSE(change)                                                                             \
    {                                                                                              \
        umb_view v = good_view();                                                                  \
        change;                                                                                    \
        refuse(&v);                                                                                \
    }

static void test_check_rules(void **state)
{
    (void)state;
    REFUSE(memset(&v, 0, sizeof(v)))
    REFUSE(v.projection = (umb_projection)7)
    REFUSE(v.right[0] *= 1.00001; v.right[1] *= 1.00001; v.right[2] *= 1.00001)
    REFUSE(memcpy(v.up, v.right, sizeof(v.up)))
    REFUSE(memset(v.forward, 0, sizeof(v.forward)))
    REFUSE(v.x_min = v.x_max)
    REFUSE(v.x_min = v.x_max + 1.0)
    REFUSE(v.y_min = v.y_max)
    REFUSE(v.y_max = -v.y_max)
    REFUSE(v.near_depth = 0.0)
    REFUSE(v.near_depth = -1.0)
    REFUSE(v.far_depth = v.near_depth)
    REFUSE(v.far_depth = 0.5 * v.near_depth)
    REFUSE(v.projection = UMB_ORTHOGRAPHIC; v.far_depth = INFINITY)
    REFUSE(v.projection = UMB_ORTHOGRAPHIC; v.near_depth = 101.0)
    REFUSE(v.width = 640)
    REFUSE(v.buffer_height = 64)
    REFUSE(v.buffer_width = 8193; v.buffer_height = 64)
    REFUSE(v.min_pixels = -1.0)
    REFUSE(v.plane_count = UMB_MAX_CLIP_PLANES + 1)
    REFUSE(v.planes[0][0] = 0.0)
    umb_view v = good_view();
    v.projection = UMB_ORTHOGRAPHIC;
    v.near_depth = -5.0;
    v.buffer_width = v.buffer_height = 8192;
    v.width = v.height = 1;
    assert_int_equal(umb_view_check(&v, NULL), UMB_OK);
}

static void test_refused_look_at(void **state)
{
    (void)state;
    double a[3] = {0, 1, 2}, b[3] = {3, 4, 5}, up[3] = {0, 1, 0}, zero[3] = {0, 0, 0};
    double nan[3] = {0, NAN, 0}, inf[3] = {INFINITY, 0, 0};
    umb_view v;
    assert_int_equal(umb_view_look_at(&v, a, a, up, 1, 1, 1, 2), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_view_look_at(&v, nan, b, up, 1, 1, 1, 2), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_view_look_at(&v, a, inf, up, 1, 1, 1, 2), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_view_look_at(&v, a, b, zero, 1, 1, 1, 2), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_view_look_at(&v, a, b, nan, 1, 1, 1, 2), UMB_ERROR_ARGUMENT);
    const double angles[] = {0.0, -1.0, 3.1415926535897932, 4.0, NAN, INFINITY};
    for (int i = 0; i < 6; ++i) {
        assert_int_equal(umb_view_look_at(&v, a, b, up, angles[i], 1, 1, 2), UMB_ERROR_ARGUMENT);
    }
    const double aspects[] = {0.0, -1.0, NAN, INFINITY};
    for (int i = 0; i < 4; ++i) {
        assert_int_equal(umb_view_look_at(&v, a, b, up, 1, aspects[i], 1, 2), UMB_ERROR_ARGUMENT);
        assert_int_equal(umb_view_look_at_ortho(&v, a, b, up, 1, aspects[i], 1, 2),
                         UMB_ERROR_ARGUMENT);
        assert_int_equal(umb_view_look_at_ortho(&v, a, b, up, aspects[i], 1, 1, 2),
                         UMB_ERROR_ARGUMENT);
    }
    assert_int_equal(umb_view_look_at(&v, a, b, up, 1, 1, 0, 2), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_view_look_at(&v, a, b, up, 1, 1, 2, 2), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_view_look_at(&v, a, b, up, 1, 1, NAN, 2), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_view_look_at(&v, a, b, up, 1, 1, 1, NAN), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_view_look_at_ortho(&v, a, b, up, 1, 1, 1, INFINITY), UMB_ERROR_ARGUMENT);
}

static void test_refused_matrix(void **state)
{
    (void)state;
    uint64_t seed = 24;
    umb_view r;
    for (int i = 0; i < 3000; ++i) {
        umb_view v = any_handed_view(&seed, 10.0);
        umb_matrix_def good = matrix_of(&v, (umb_depth_range)(i % 3), false, false, 1.0);
        umb_matrix_def m = good;
        m.m[random_below(&seed, 16)] = random_below(&seed, 2) == 0 ? NAN : INFINITY;
        assert_int_equal(umb_view_from_matrix(&r, &m), UMB_ERROR_ARGUMENT);
        m = good; /* no inverse: two rows alike */
        memcpy(&m.m[0], &m.m[4], 4 * sizeof(double));
        assert_int_equal(umb_view_from_matrix(&r, &m), UMB_ERROR_ARGUMENT);
        m = good; /* an oblique near plane */
        for (int k = 0; k < 4; ++k) {
            m.m[8 + k] += 0.01 * m.m[k];
        }
        assert_int_equal(umb_view_from_matrix(&r, &m), UMB_ERROR_ARGUMENT);
        m = good; /* looking backwards: w shrinks away from the eye */
        for (int k = 0; k < 16; ++k) {
            m.m[k] = -m.m[k];
        }
        assert_int_equal(umb_view_from_matrix(&r, &m), UMB_ERROR_ARGUMENT);
        m = good;
        m.depth_range = (umb_depth_range)9;
        assert_int_equal(umb_view_from_matrix(&r, &m), UMB_ERROR_ARGUMENT);
        m = good; /* reversed taken for not reversed: the far plane would lie before the near one */
        m.depth_range = m.depth_range == UMB_DEPTH_ONE_TO_ZERO ? UMB_DEPTH_ZERO_TO_ONE
                                                               : UMB_DEPTH_ONE_TO_ZERO;
        if (v.projection == UMB_PERSPECTIVE && good.depth_range != UMB_DEPTH_MINUS_ONE_TO_ONE) {
            assert_int_equal(umb_view_from_matrix(&r, &m), UMB_ERROR_ARGUMENT);
        }
    }
    umb_matrix_def zero;
    memset(&zero, 0, sizeof(zero));
    assert_int_equal(umb_view_from_matrix(&r, &zero), UMB_ERROR_ARGUMENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_matrix),          cmocka_unit_test(test_float_matrix),
        cmocka_unit_test(test_planes),          cmocka_unit_test(test_extra_planes),
        cmocka_unit_test(test_look_at),         cmocka_unit_test(test_along_up),
        cmocka_unit_test(test_check_numbers),   cmocka_unit_test(test_check_rules),
        cmocka_unit_test(test_refused_look_at), cmocka_unit_test(test_refused_matrix),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* The oracle on scenes whose answer is known, and against a slow tracer of its own kind. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "truth/oracle.h"

enum { NEITHER = 0, CULLING = TRUTH_CULLING, BOTH_SIDES = TRUTH_TWO_SIDED, EVERY = 3 };

static uint32_t add_mesh(model *m, const float *positions, uint32_t vertices,
                         const uint32_t *indices, uint32_t triangles, uint8_t flags)
{
    uint8_t *f = malloc(triangles);
    assert_non_null(f);
    memset(f, flags, triangles);
    model_mesh mesh = {.positions = (float *)(uintptr_t)positions,
                       .indices = (uint32_t *)(uintptr_t)indices,
                       .flags = f,
                       .position_count = vertices,
                       .triangle_count = triangles};
    uint32_t number = model_add_mesh(m, &mesh);
    assert_int_not_equal(number, MODEL_NONE);
    free(f);
    return number;
}

/* An upright rectangle at depth z (the eye looks along -z from the origin), its front towards
 * +z. */
static uint32_t add_wall(model *m, float x0, float x1, float y0, float y1, float z, uint8_t flags)
{
    const float p[12] = {x0, y0, z, x1, y0, z, x1, y1, z, x0, y1, z};
    const uint32_t i[6] = {0, 1, 2, 0, 2, 3};
    uint32_t object = model_add_object(m, "wall", add_mesh(m, p, 4, i, 2, flags), NULL);
    assert_int_not_equal(object, MODEL_NONE);
    return object;
}

static uint32_t add_box(model *m, float x, float y, float z, float half)
{
    float p[24];
    static const uint32_t i[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                   2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    for (uint32_t k = 0; k < 8; ++k) {
        p[3 * k] = x + (k & 1 ? half : -half);
        p[3 * k + 1] = y + (k & 2 ? half : -half);
        p[3 * k + 2] = z + (k & 4 ? half : -half);
    }
    return model_add_object(m, "box", add_mesh(m, p, 8, i, 12, 0), NULL);
}

static void finish(model *m)
{
    umb_error error = {0};
    assert_true(model_finish(m, NULL, &error));
}

static umb_view make_view(double near_depth, double far_depth)
{
    umb_view v;
    const double eye[3] = {0, 0, 0}, target[3] = {0, 0, -1}, up[3] = {0, 1, 0};
    assert_int_equal(umb_view_look_at(&v, eye, target, up, 1.2, 1.0, near_depth, far_depth), UMB_OK);
    return v;
}

static truth_result look(const model *m, const umb_view *view, oracle_form form, uint32_t threads)
{
    umb_error error = {0};
    uint8_t *accused = malloc(m->object_count + 1);
    assert_non_null(accused);
    memset(accused, 1, m->object_count + 1);
    truth *t = oracle_create(m, form, &error);
    assert_non_null(t);
    truth_options options = {
        .grid_width = 64, .grid_height = 64, .accused = accused, .threads = threads};
    truth_result r;
    assert_true(truth_view(t, view, &options, &r, &error));
    truth_destroy(t);
    free(accused);
    return r;
}

/* Expect these renderers for each object, with flattened and with instanced scenes. */
static void expect(model *m, const umb_view *view, const int *renderers)
{
    for (int form = ORACLE_FLAT; form <= ORACLE_INSTANCED; ++form) {
        truth_result r = look(m, view, (oracle_form)form, 1);
        uint32_t visible = 0, unproven = 0;
        for (uint32_t i = 0; i < m->object_count; ++i) {
            int seen = 0;
            seen |= r.culling[i].renderers && r.culling[i].confirmed ? CULLING : 0;
            seen |= r.two_sided[i].renderers && r.two_sided[i].confirmed ? BOTH_SIDES : 0;
            if (seen != renderers[i]) {
                fail_msg("object %u: seen %d, expected %d (form %d)", i, seen, renderers[i], form);
            }
            visible += seen != 0;
            unproven += seen == 0 && (r.culling[i].renderers || r.two_sided[i].renderers);
        }
        assert_int_equal(r.visible, visible);
        assert_int_equal(r.unconfirmed, unproven);
        assert_false(r.budget_spent);
        truth_result_free(&r);
    }
}

static void expect_and_free(model *m, const umb_view *view, const int *renderers)
{
    expect(m, view, renderers);
    model_free(m);
}

static void test_wall_hides_box(void **state)
{
    (void)state;
    model *m = model_create();
    umb_view v = make_view(0.1, 100.0);
    add_wall(m, -20, 20, -20, 20, -5, 0);
    add_box(m, 0, 0, -10, 1);
    add_box(m, 0, 0, 10, 1); /* behind the eye */
    finish(m);
    expect_and_free(m, &v, (int[]){EVERY, NEITHER, NEITHER});
}

static void test_slit_shows_box(void **state)
{
    (void)state;
    const float gaps[] = {0.5f, 1e-2f, 1e-4f};
    for (int k = 0; k < 3; ++k) {
        model *m = model_create();
        umb_view v = make_view(0.1, 100.0);
        add_wall(m, -20, 0.37f, -20, 20, -5, 0);
        add_wall(m, 0.37f + gaps[k], 20, -20, 20, -5, 0);
        add_box(m, 1, 0.3f, -10, 1);
        add_box(m, 8, 0.3f, -10, 1);
        finish(m);
        expect_and_free(m, &v, (int[]){EVERY, EVERY, EVERY, NEITHER});
    }
}

static void test_back_of_wall(void **state)
{
    (void)state;
    const float p[12] = {-20, -20, -5, 20, -20, -5, 20, 20, -5, -20, 20, -5};
    const uint32_t away[6] = {0, 2, 1, 0, 3, 2};
    for (int two_sided = 0; two_sided < 2; ++two_sided) {
        model *m = model_create();
        umb_view v = make_view(0.1, 100.0);
        uint8_t flags = two_sided ? UMB_TRIANGLE_TWO_SIDED : 0;
        model_add_object(m, "wall", add_mesh(m, p, 4, away, 2, flags), NULL);
        add_box(m, 0, 0, -10, 1);
        finish(m);
        int wall = two_sided ? EVERY : BOTH_SIDES, box = two_sided ? NEITHER : CULLING;
        expect_and_free(m, &v, (int[]){wall, box});
    }
}

/* One wall mesh, placed as it is, mirrored (still facing the eye), turned away, and both. */
static void test_mirrored_instances(void **state)
{
    (void)state;
    const float p[12] = {-20, -20, 0, 20, -20, 0, 20, 20, 0, -20, 20, 0};
    const uint32_t i[6] = {0, 1, 2, 0, 2, 3};
    const umb_transform places[4] = {
        {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, -5}}},
        {{{-1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, -5}}},
        {{{-1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, -1, -5}}},
        {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, -1, -5}}},
    };
    for (int k = 0; k < 4; ++k) {
        model *m = model_create();
        umb_view v = make_view(0.1, 100.0);
        model_add_object(m, "wall", add_mesh(m, p, 4, i, 2, 0), &places[k]);
        add_box(m, 0, 0, -10, 1);
        finish(m);
        bool front = k < 2;
        expect_and_free(m, &v, (int[]){front ? EVERY : BOTH_SIDES, front ? NEITHER : CULLING});
    }
}

static void test_near_and_far(void **state)
{
    (void)state;
    model *m = model_create();
    add_wall(m, -20, 20, -20, 20, -0.5, 0);
    add_box(m, 0, 0, -10, 1);
    add_box(m, 30, 0, -60, 1);
    finish(m);
    umb_view cut = make_view(1.0, 50.0), whole = make_view(0.1, INFINITY), at = make_view(0.5, 50.0);
    expect(m, &cut, (int[]){NEITHER, EVERY, NEITHER});
    expect(m, &whole, (int[]){EVERY, NEITHER, NEITHER});
    expect(m, &at, (int[]){EVERY, NEITHER, NEITHER}); /* a wall in the near plane counts */
    umb_view deep = make_view(1.0, INFINITY), touching = make_view(1.0, 9.0),
             short_of = make_view(1.0, 8.999);
    expect(m, &deep, (int[]){NEITHER, EVERY, EVERY});
    expect(m, &touching, (int[]){NEITHER, EVERY, NEITHER}); /* the frustum is closed */
    expect_and_free(m, &short_of, (int[]){NEITHER, NEITHER, NEITHER});
}

static void test_open_surfaces(void **state)
{
    (void)state;
    enum { LAYERS = 150 };
    int expected[LAYERS + 3];
    model *m = model_create();
    umb_view v = make_view(0.1, 1000.0);
    for (int k = 0; k < LAYERS; ++k) {
        add_wall(m, -20, 20, -20, 20, -5.0f - 0.1f * (float)k, UMB_TRIANGLE_OPEN);
        expected[k] = EVERY;
    }
    add_wall(m, -200, 200, -200, 200, -40, 0);
    add_wall(m, -20, 20, -20, 20, -41, UMB_TRIANGLE_OPEN);
    add_box(m, 0, 0, -50, 1);
    expected[LAYERS] = EVERY;
    expected[LAYERS + 1] = expected[LAYERS + 2] = NEITHER;
    finish(m);
    expect_and_free(m, &v, expected);
}

static void test_orthographic(void **state)
{
    (void)state;
    model *m = model_create();
    umb_view v;
    const double eye[3] = {0, 0, 0}, target[3] = {0, 0, -1}, up[3] = {0, 1, 0};
    assert_int_equal(umb_view_look_at_ortho(&v, eye, target, up, 20.0, 1.0, -5.0, 50.0), UMB_OK);
    add_wall(m, -2, 2, -2, 2, -5, 0);
    add_box(m, 0, 0, -10, 1.9f); /* hidden though a pinhole eye further back would see round */
    add_box(m, 5, 0, -10, 1);
    add_box(m, 0, 0, 4, 0.5f);   /* behind the eye, but beyond the near plane */
    add_box(m, 0, 0, -10, 2.0f); /* flush with the wall's outline */
    add_box(m, 0, 30, -10, 1);   /* beside the picture */
    finish(m);
    int *expected = (int[]){EVERY, NEITHER, EVERY, EVERY, NEITHER, NEITHER};
    expect_and_free(m, &v, expected);
}

static void test_shared_edges_do_not_leak(void **state)
{
    (void)state;
    /* A fan of triangles about a point on no nice coordinate, and a wall cut by a T-junction:
     * exact, since the middle of the edge is a float. */
    model *m = model_create();
    umb_view v = make_view(0.1, 100.0);
    const float c[3] = {0.1234567f, -0.7654321f, -5.0f};
    float p[3 * 17];
    uint32_t i[3 * 16];
    memcpy(p, c, sizeof(c));
    for (uint32_t k = 0; k < 16; ++k) {
        p[3 * (k + 1)] = 40.0f * cosf((float)k * 0.392699f);
        p[3 * (k + 1) + 1] = 40.0f * sinf((float)k * 0.392699f);
        p[3 * (k + 1) + 2] = -5.0f - 0.1f * (float)(k % 3);
        i[3 * k] = 0;
        i[3 * k + 1] = k + 1;
        i[3 * k + 2] = (k + 1) % 16 + 1;
    }
    model_add_object(m, "fan", add_mesh(m, p, 17, i, 16, 0), NULL);
    add_box(m, 0, 0, -15, 3);
    const float q[15] = {-90, -60, -30, 0.75f, -60,  -31, 2.25f, 60,
                         -27, -90, 60,  -30,   1.5f, 0,   -29};
    const float far_side[12] = {1.5f, 0, -29, 0.75f, -60, -31, 90, -60, -30, 2.25f, 60, -27};
    const uint32_t left[6] = {0, 1, 2, 0, 2, 3}, right[9] = {0, 1, 2, 0, 2, 4, 0, 4, 3};
    float r[15];
    memcpy(r, far_side, sizeof(far_side));
    r[12] = 90;
    r[13] = 60;
    r[14] = -30;
    model_add_object(m, "left", add_mesh(m, q, 5, left, 2, 0), NULL);
    model_add_object(m, "right", add_mesh(m, r, 5, right, 3, 0), NULL);
    add_wall(m, -80, 80, -80, 80, -50, 0);
    finish(m);
    expect(m, &v, (int[]){EVERY, NEITHER, NEITHER, NEITHER, NEITHER});
    /* From behind the fan only the wall with the T-junction is in the way. */
    umb_view beyond = make_view(20.0, 100.0);
    expect_and_free(m, &beyond, (int[]){NEITHER, NEITHER, EVERY, EVERY, NEITHER});
}

static void test_real_crack_is_seen(void **state)
{
    (void)state;
    model *m = model_create();
    umb_view v = make_view(0.1, 100.0);
    /* The wall on the right starts one float step further right. */
    add_wall(m, -20, 0.37f, -20, 20, -5, 0);
    add_wall(m, nextafterf(0.37f, 1.0f), 20, -20, 20, -5, 0);
    add_wall(m, -20, 20, -20, 20, -10, 0);
    finish(m);
    umb_error error = {0};
    truth *t = truth_create(m, &error);
    oracle_view ov;
    truth_witness w;
    assert_non_null(t);
    oracle_view_make(t, &v, NULL, &ov);
    const double step = (double)nextafterf(0.37f, 1.0f) - 0.37f;
    const double inside[3] = {2.0 * (0.37f + 0.5 * step), 0.1, -10.0};
    const double on_edge[3] = {2.0 * 0.37f, 0.1, -10.0};
    assert_true(oracle_confirm(t, &ov, inside, 2, TRUTH_CULLING, &w));
    assert_true(w.to[2] == -10.0 && w.confirmed == 1);
    assert_false(oracle_confirm(t, &ov, on_edge, 2, TRUTH_CULLING, &w)); /* touching blocks */
    truth_destroy(t);
    model_free(m);
}

static void test_touching_at_equal_depth(void **state)
{
    (void)state;
    for (int behind = 0; behind < 2; ++behind) {
        model *m = model_create();
        umb_view v = make_view(0.1, 100.0);
        float z = behind ? nextafterf(-5.0f, -6.0f) : -5.0f;
        add_wall(m, -20, 20, -20, 20, -5, 0);
        add_wall(m, -1, 1, -1, 1, z, 0);
        add_box(m, 4, 0, z - 1.0f, 1); /* its front face lies in the wall, or a step behind */
        finish(m);
        int seen = behind ? NEITHER : EVERY;
        /* The box: z - 1 + 1 rounds back onto the wall's plane, never in front of it. */
        bool flush = z - 1.0f + 1.0f == -5.0f;
        expect_and_free(m, &v, (int[]){EVERY, seen, flush ? EVERY : NEITHER});
    }
}

static void test_extra_planes(void **state)
{
    (void)state;
    model *m = model_create();
    umb_view v = make_view(0.1, 100.0);
    add_wall(m, -3, -1, -2, 2, -5, 0); /* outside the extra plane, and still in the way */
    add_box(m, -4, 0, -10, 1);
    add_box(m, 4, 0, -10, 1);
    add_box(m, 0, 0, -50, 1); /* outside the second one */
    finish(m);
    v.plane_count = 2;
    memcpy(v.planes[0], (double[4]){1, 0, -0.5, -1}, sizeof(v.planes[0])); /* x >= 1 + z / 2 */
    memcpy(v.planes[1], (double[4]){0, 0, 1, 40}, sizeof(v.planes[1]));    /* z >= -40 */
    expect(m, &v, (int[]){EVERY, NEITHER, EVERY, NEITHER});
    memcpy(v.planes[0], (double[4]){1, 0, 0, 3.5}, sizeof(v.planes[0])); /* x >= -3.5 */
    expect(m, &v, (int[]){EVERY, NEITHER, EVERY, NEITHER});
    memcpy(v.planes[0], (double[4]){1, 0, 0, 0.5}, sizeof(v.planes[0])); /* x >= -0.5 */
    expect_and_free(m, &v, (int[]){NEITHER, NEITHER, EVERY, NEITHER});
}

static void test_inside_a_box(void **state)
{
    (void)state;
    model *m = model_create();
    umb_view v = make_view(0.1, 100.0);
    add_box(m, 0, 0, 0, 2);
    add_box(m, 0, 0, -10, 1);
    finish(m);
    expect_and_free(m, &v, (int[]){BOTH_SIDES, CULLING});
}

static void test_without_area(void **state)
{
    (void)state;
    const float points[9] = {0.5f, 0.25f, -4, 0.5f, 0.25f, -4, 0.5f, 0.25f, -4};
    const float hidden[9] = {0.5f, 0.25f, -6, 0.5f, 0.25f, -6, 0.5f, 0.25f, -6};
    const float needle[9] = {-1, -1, -4, 0, 0, -4, 1, 1, -4};
    const uint32_t i[3] = {0, 1, 2};
    model *m = model_create();
    umb_view v = make_view(0.1, 100.0);
    model_add_object(m, "point", add_mesh(m, points, 3, i, 1, 0), NULL);
    model_add_object(m, "hidden", add_mesh(m, hidden, 3, i, 1, 0), NULL);
    model_add_object(m, "needle", add_mesh(m, needle, 3, i, 1, 0), NULL);
    add_wall(m, -20, 20, -20, 20, -5, 0);
    model_add_object(m, "empty", MODEL_NONE, NULL);
    finish(m);
    expect_and_free(m, &v, (int[]){EVERY, NEITHER, EVERY, EVERY, NEITHER});
}

static void test_blockers_and_pixel(void **state)
{
    (void)state;
    model *m = model_create();
    umb_view v = make_view(0.1, 100.0);
    umb_error error = {0};
    uint32_t objects[4], hits[4];
    double depth, normal[3];
    add_wall(m, -20, 0.5f, -20, 20, -5, 0);
    add_wall(m, 0.5f, 20, -20, 20, -5, 0);
    add_box(m, 0, 0, -10, 2);
    add_wall(m, -1, 1, -1, 1, -3, UMB_TRIANGLE_OPEN);
    finish(m);
    truth *t = truth_create(m, &error);
    assert_non_null(t);
    assert_int_equal(truth_blockers(t, &v, 2, objects, hits, 4), 2);
    assert_int_equal(objects[0], 0);
    assert_int_equal(objects[1], 1);
    assert_true(hits[0] > hits[1] && hits[1] > 0);
    assert_int_equal(truth_blockers(t, &v, 2, objects, hits, 1), 1);
    assert_int_equal(truth_blockers(t, &v, 0, objects, hits, 4), 0);
    assert_int_equal(truth_blockers(t, &v, 99, objects, hits, 4), 0);
    assert_int_equal(truth_pixel(t, &v, 0.5, 0.5, &depth, normal), 3);
    assert_true(fabs(depth - 3.0) < 1e-9 && fabs(normal[2] - 1.0) < 1e-12);
    assert_int_equal(truth_pixel(t, &v, 0.1, 0.3, &depth, normal), 0);
    assert_true(fabs(depth - 5.0) < 1e-9);
    assert_int_equal(truth_pixel(t, &v, 0.9, 0.3, &depth, normal), 1);
    truth_destroy(t);
    model_free(m);
}

static uint64_t random_state = 7;

static int random_below(int limit)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (int)((random_state >> 33) % (uint64_t)limit);
}

static model *random_scene(uint32_t objects)
{
    model *m = model_create();
    for (uint32_t k = 0; k < objects; ++k) {
        float p[18];
        uint32_t i[9];
        uint32_t triangles = 1 + (uint32_t)random_below(3);
        int size = 1 + random_below(6), depth = 2 + random_below(20);
        int x = random_below(17) - 8, y = random_below(17) - 8;
        for (int c = 0; c < 6; ++c) {
            p[3 * c] = (float)(x * depth) / 10.0f +
                       0.25f * (float)(random_below(8 * size) - 4 * size);
            p[3 * c + 1] = (float)(y * depth) / 10.0f +
                           0.25f * (float)(random_below(8 * size) - 4 * size);
            p[3 * c + 2] = -0.5f * (float)(depth + random_below(4));
        }
        for (uint32_t c = 0; c < 3 * triangles; ++c) {
            i[c] = (uint32_t)random_below(6);
        }
        uint8_t flags = (uint8_t)random_below(8);
        flags = flags == 1 ? UMB_TRIANGLE_TWO_SIDED : flags == 2 ? UMB_TRIANGLE_OPEN : 0;
        model_add_object(m, "shard", add_mesh(m, p, 6, i, triangles, flags), NULL);
    }
    finish(m);
    return m;
}

static void test_threads_do_not_matter(void **state)
{
    (void)state;
    model *m = random_scene(400);
    umb_view v = make_view(0.5, 40.0);
    truth_result one = look(m, &v, ORACLE_EITHER, 1);
    for (uint32_t threads = 2; threads <= 5; threads += 3) {
        truth_result more = look(m, &v, ORACLE_EITHER, threads);
        assert_int_equal(one.rays, more.rays);
        assert_int_equal(one.rounds, more.rounds);
        assert_int_equal(one.visible, more.visible);
        size_t size = m->object_count * sizeof(truth_witness);
        assert_memory_equal(one.culling, more.culling, size);
        assert_memory_equal(one.two_sided, more.two_sided, size);
        truth_result_free(&more);
    }
    truth_result_free(&one);
    model_free(m);
}

/* The slow tracer: every triangle, in long double. How it meets the segment from + s (to -
 * from). */
typedef struct slow_hit {
    bool touches; /* within the rounding, perhaps */
    bool surely;  /* well inside the triangle */
    long double s, facing;
} slow_hit;

static slow_hit meet_slowly(const truth *t, uint32_t object, uint32_t triangle,
                            const double from[3], const double to[3])
{
    float v[3][3];
    long double e[3], f[3], n[3], d[3], o[3], numerator = 0, denominator = 0, lowest = INFINITY;
    slow_hit hit = {false, false, 0, 0};
    oracle_triangle(t, object, triangle, v);
    for (int i = 0; i < 3; ++i) {
        e[i] = (long double)v[1][i] - v[0][i];
        f[i] = (long double)v[2][i] - v[0][i];
        d[i] = (long double)to[i] - from[i];
        o[i] = v[0][i] - (long double)from[i];
    }
    for (int i = 0; i < 3; ++i) {
        n[i] = e[(i + 1) % 3] * f[(i + 2) % 3] - e[(i + 2) % 3] * f[(i + 1) % 3];
        numerator += n[i] * o[i];
        denominator += n[i] * d[i];
    }
    if (fabsl(denominator) < 1e-9L) {
        return hit;
    }
    hit.s = numerator / denominator;
    hit.facing = denominator;
    for (int k = 0; k < 3; ++k) {
        /* Distance inside edge k, as a fraction of the triangle. */
        long double inside = 0;
        for (int i = 0; i < 3; ++i) {
            int a = (i + 1) % 3, b = (i + 2) % 3;
            long double side_a = (long double)v[(k + 1) % 3][a] - v[k][a];
            long double side_b = (long double)v[(k + 1) % 3][b] - v[k][b];
            long double to_a = from[a] + hit.s * d[a] - v[k][a],
                        to_b = from[b] + hit.s * d[b] - v[k][b];
            inside += n[i] * (side_a * to_b - side_b * to_a);
        }
        lowest = fminl(lowest, inside / (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]));
    }
    hit.touches = lowest > -1e-7L;
    hit.surely = lowest > 1e-7L;
    return hit;
}

static bool stops(uint8_t flags, long double facing, int renderer)
{
    return !(flags & UMB_TRIANGLE_OPEN) &&
           (renderer == BOTH_SIDES || facing < 0 || (flags & UMB_TRIANGLE_TWO_SIDED));
}

/* Nothing surely stands in the way of a witness, and it ends on its object. */
static void check_witness(const truth *t, uint32_t object, const truth_witness *w, int renderer)
{
    const model *m = t->model;
    bool arrives = false;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        const model_mesh *mesh = &m->meshes[m->objects[i].mesh];
        for (uint32_t k = 0; k < mesh->triangle_count; ++k) {
            slow_hit hit = meet_slowly(t, i, k, w->from, w->to);
            if (hit.surely && hit.s > 1e-9L && hit.s < 1.0L - 1e-9L) {
                assert_false(stops(mesh->flags[k], hit.facing, renderer));
            }
            arrives |= i == object &&
                       ((hit.touches && fabsl(hit.s - 1.0L) < 1e-7L) || hit.facing == 0);
        }
    }
    assert_true(arrives);
}

/* What the tracer surely sees through one point of the picture must be in the answer. */
static uint32_t check_ray(const truth *t, const truth_result *r, const double from[3],
                          const double to[3], int renderer)
{
    const model *m = t->model;
    long double nearest = INFINITY, sure = INFINITY;
    uint32_t object = MODEL_NONE;
    bool shown = false;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        const model_mesh *mesh = &m->meshes[m->objects[i].mesh];
        for (uint32_t k = 0; k < mesh->triangle_count; ++k) {
            slow_hit hit = meet_slowly(t, i, k, from, to);
            if (!hit.touches || hit.s < 0.0L || hit.s > 1.0L ||
                !stops(mesh->flags[k], hit.facing, renderer)) {
                continue;
            }
            nearest = fminl(nearest, hit.s);
            if (hit.surely && hit.s < sure) {
                sure = hit.s;
                object = i;
                shown = true;
            }
        }
    }
    if (!shown || nearest < sure - 1e-9L) {
        return 0;
    }
    if (!(renderer == CULLING ? r->culling : r->two_sided)[object].confirmed) {
        fail_msg("renderer %d: object %u is seen at (%g, %g, %g)", renderer, object,
                 (double)(from[0] + sure * (to[0] - from[0])),
                 (double)(from[1] + sure * (to[1] - from[1])),
                 (double)(from[2] + sure * (to[2] - from[2])));
    }
    return 1;
}

static void test_against_slow_tracer(void **state)
{
    (void)state;
    uint32_t rays = 0, hidden = 0, witnesses = 0, unproven = 0;
    for (int scene = 0; scene < 40; ++scene) {
        model *m = random_scene(30 + (uint32_t)random_below(40));
        umb_view v = make_view(0.5, 40.0);
        umb_error error = {0};
        truth *t = truth_create(m, &error);
        assert_non_null(t);
        truth_result r = look(m, &v, ORACLE_EITHER, 1);
        for (uint32_t i = 0; i < m->object_count; ++i) {
            if (r.culling[i].confirmed) {
                check_witness(t, i, &r.culling[i], CULLING);
            }
            if (r.two_sided[i].confirmed) {
                check_witness(t, i, &r.two_sided[i], BOTH_SIDES);
            }
            witnesses += r.culling[i].confirmed;
            hidden += !r.culling[i].renderers && !r.two_sided[i].renderers;
        }
        for (int k = 0; k < 1200; ++k) {
            double from[3] = {0, 0, -0.5}, to[3] = {0, 0, -40.0};
            for (int i = 0; i < 2; ++i) {
                double slope = tan(0.6) * (random_below(20001) - 10000) / 10001.0;
                from[i] = slope * 0.5;
                to[i] = slope * 40.0;
            }
            rays += check_ray(t, &r, from, to, CULLING);
            rays += check_ray(t, &r, from, to, BOTH_SIDES);
        }
        unproven += r.unconfirmed;
        truth_result_free(&r);
        truth_destroy(t);
        model_free(m);
    }
    assert_true(rays > 20000 && hidden > 50 && witnesses > 500);
    assert_true(unproven < 5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_wall_hides_box),
        cmocka_unit_test(test_slit_shows_box),
        cmocka_unit_test(test_back_of_wall),
        cmocka_unit_test(test_mirrored_instances),
        cmocka_unit_test(test_near_and_far),
        cmocka_unit_test(test_open_surfaces),
        cmocka_unit_test(test_orthographic),
        cmocka_unit_test(test_shared_edges_do_not_leak),
        cmocka_unit_test(test_real_crack_is_seen),
        cmocka_unit_test(test_touching_at_equal_depth),
        cmocka_unit_test(test_extra_planes),
        cmocka_unit_test(test_inside_a_box),
        cmocka_unit_test(test_without_area),
        cmocka_unit_test(test_blockers_and_pixel),
        cmocka_unit_test(test_threads_do_not_matter),
        cmocka_unit_test(test_against_slow_tracer),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

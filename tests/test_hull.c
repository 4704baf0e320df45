/* Hulls that methods are asked about: their polygons hold every point of the body as seen, those of boxes along the axes
 * and of triangles nothing more; a turned box holds what its transform makes of points, rounded as vertices are; and
 * what is said to be beyond a plane is. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/orient.h"
#include "geometry/transform.h"
#include "occlusion/hull.h"

static uint64_t rng = 1;

static double unit(void)
{
    rng = rng * 6364136223846793005u + 1442695040888963407u;
    return (double)(rng >> 11) * 0x1p-53;
}

static double between(double low, double high)
{
    return low + (high - low) * unit();
}

static uint32_t rounds(uint32_t normal)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && size[0] == 's' ? normal / 10 : size != NULL && size[0] == 'f' ? normal * 10 : normal;
}

static void make_viewer(umb_shadow_viewer *v, bool parallel)
{
    umb_view view;
    const double eye[3] = {between(-5, 5), between(-5, 5), between(-5, 5)}, up[3] = {0, 1, 0};
    const double target[3] = {between(-5, 5), between(-5, 5), between(-25, -20)};
    if (parallel) {
        assert_int_equal(umb_view_look_at_ortho(&view, eye, target, up, 20.0, 1.0, 0.1, 1e4), UMB_OK);
    } else {
        assert_int_equal(umb_view_look_at(&view, eye, target, up, 1.2, 1.0, 0.1, 1e4), UMB_OK);
    }
    umb_shadow_viewer_prepare(v, &view, 1000.0);
}

static int side_of(const umb_shadow_viewer *v, const umb_hull *h, uint32_t edge, const float p[3])
{
    umb_seen_line line;
    umb_seen_corner c;
    umb_seen_line_through(&v->sight, h->lines[edge].a, h->lines[edge].b, &line);
    umb_seen_corner_at(&v->sight, p, &c);
    return umb_seen_side(&v->sight, &line, &c);
}

static void expect_inside(const umb_shadow_viewer *v, const umb_hull *h, const float p[3])
{
    for (uint32_t e = 0; e < h->count; ++e) {
        assert_in_range(side_of(v, h, e, p), 0, 1);
    }
}

/* Each edge ends in points of the body, and the polygon turns one way. */
static void expect_tight(const umb_shadow_viewer *v, const umb_hull *h)
{
    for (uint32_t e = 0; e < h->count; ++e) {
        bool touches = false;
        for (uint32_t i = 0; i < h->point_count; ++i) {
            touches = touches || memcmp(h->points[i], h->lines[e].a, sizeof h->lines[e].a) == 0;
            expect_inside(v, h, h->points[i]);
        }
        assert_true(touches);
        assert_int_equal(memcmp(h->lines[e].b, h->lines[(e + 1) % h->count].a, sizeof h->lines[e].b), 0);
    }
}

/* The faces' planes have the viewer in front and all of the body behind. */
static void expect_faces(const umb_shadow_viewer *v, umb_hull *h)
{
    for (uint32_t f = 0; f < h->face_count; ++f) {
        const umb_shadow_plane *p = umb_hull_face_plane(h, v, f);
        for (uint32_t i = 0; i < h->point_count; ++i) {
            assert_true(umb_orient(p->a, p->b, p->c, h->points[i]) <= 0);
        }
        assert_true(v->sight.parallel || p->h > -p->h_off);
    }
}

static void test_boxes(void **state)
{
    (void)state;
    umb_shadow_viewer v;
    umb_hull h;
    uint32_t found = 0;
    for (uint32_t i = 0; i < rounds(5000); ++i) {
        make_viewer(&v, i % 2 == 0);
        umb_aabb box;
        for (int k = 0; k < 3; ++k) {
            box.min[k] = (float)between(-30, 20);
            box.max[k] = box.min[k] + (i % 5 == 0 && k == (int)(i % 3) ? 0.0f : (float)between(0, 20));
        }
        if (i % 7 == 0 && !v.sight.parallel) { /* a face in a plane with the eye, as near as a float can be */
            box.min[i % 3] = (float)v.sight.eye[i % 3];
            box.max[i % 3] = box.min[i % 3] + 3.0f;
        }
        if (!umb_hull_of_box(&h, &v, &box)) {
            continue;
        }
        found += 1;
        assert_true(h.count == 4 || h.count == 6);
        expect_tight(&v, &h);
        expect_faces(&v, &h);
    }
    assert_true(found > rounds(5000) / 4);
}

static void random_transform(umb_transform *t)
{
    double size = exp(between(-3, 3));
    for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k) {
            t->m[i][k] = (float)between(-size, size);
        }
        t->m[i][3] = (float)between(-20, 20);
    }
    t->m[2][3] -= 40.0f;
}

static void random_point_in(const umb_aabb *box, uint32_t number, float p[3])
{
    for (int k = 0; k < 3; ++k) {
        p[k] = (number >> k & 1u) != 0 ? box->max[k] : box->min[k];
        if (number >= 8) {
            p[k] = (float)between(box->min[k], box->max[k]);
            p[k] = fminf(fmaxf(p[k], box->min[k]), box->max[k]);
        }
    }
}

/* By separating planes: a point in the hull of eight points is not beyond all of them in any direction tried. */
static void expect_in_hull(const umb_hull *h, const float p[3])
{
    for (int n = 0; n < 6; ++n) {
        double d[3] = {between(-1, 1), between(-1, 1), between(-1, 1)}, most = -INFINITY, at = 0.0;
        if (n < 3) {
            memset(d, 0, sizeof d);
            d[n] = unit() < 0.5 ? 1.0 : -1.0;
        }
        for (int k = 0; k < 3; ++k) {
            at += d[k] * p[k];
        }
        for (uint32_t i = 0; i < h->point_count; ++i) {
            most = fmax(most, d[0] * h->points[i][0] + d[1] * h->points[i][1] + d[2] * h->points[i][2]);
        }
        assert_true(at <= most + 1e-12 * fabs(most));
    }
}

static void test_turned_boxes(void **state)
{
    (void)state;
    umb_shadow_viewer v;
    umb_hull h, points;
    uint32_t found = 0, turned = 0;
    for (uint32_t i = 0; i < rounds(3000); ++i) {
        make_viewer(&v, i % 2 == 0);
        umb_aabb box;
        umb_transform t;
        random_transform(&t);
        for (int k = 0; k < 3; ++k) {
            box.min[k] = (float)between(-2, 1);
            box.max[k] = box.min[k] + (i % 5 == 0 && k == (int)(i % 3) ? 0.0f : (float)exp(between(i % 4 == 0 ? -12 : -4, 1)));
        }
        assert_true(umb_hull_points_of_turned_box(&points, &v, &box, &t));
        bool seen = umb_hull_of_turned_box(&h, &v, &box, &t);
        for (uint32_t n = 0; n < 24; ++n) {
            float p[3], world[3];
            random_point_in(&box, n, p);
            umb_transform_point(&t, p, world);
            expect_in_hull(&points, world);
            if (seen) {
                expect_in_hull(&h, world);
                expect_inside(&v, &h, world);
            }
        }
        found += seen;
        turned += seen && !h.box;
    }
    assert_true(found > rounds(3000) / 4);
    print_message("# turned %u of %u\n", turned, found);
    assert_true(turned > found / 2);
}

static void test_triangles(void **state)
{
    (void)state;
    umb_shadow_viewer v;
    umb_hull h;
    for (uint32_t i = 0; i < rounds(5000); ++i) {
        make_viewer(&v, i % 2 == 0);
        float corners[3][3];
        for (int k = 0; k < 9; ++k) {
            corners[k / 3][k % 3] = (float)(between(-10, 10) - (k % 3 == 2 ? 25 : 0));
        }
        if (i % 3 == 0) { /* without area */
            memcpy(corners[2], corners[i % 2], sizeof corners[2]);
        }
        if (umb_hull_of_triangle(&h, &v, (const float(*)[3])corners)) {
            expect_tight(&v, &h);
            expect_faces(&v, &h);
            assert_int_equal(h.face_count, i % 3 != 0);
        }
    }
}

/* Beyond a plane: against exact signs of all points, close to it and far. */
static void test_beyond(void **state)
{
    (void)state;
    umb_shadow_viewer v;
    umb_hull h;
    make_viewer(&v, false);
    uint32_t beyond = 0;
    for (uint32_t i = 0; i < rounds(20000); ++i) {
        float corners[3][3];
        umb_aabb box;
        for (int k = 0; k < 9; ++k) {
            corners[k / 3][k % 3] = (float)floor(between(-4, 5));
        }
        for (int k = 0; k < 3; ++k) {
            box.min[k] = (float)floor(between(-5, 5)) + (i % 4 == 0 ? 0x1p-20f : 0.0f);
            box.max[k] = box.min[k] + (float)floor(between(0, 4));
        }
        umb_shadow_plane p;
        umb_shadow_plane_of(&v.sight, corners[0], corners[1], corners[2], &p);
        assert_true(umb_hull_points_of_box(&h, &v, &box));
        bool all = true;
        for (uint32_t k = 0; k < 8; ++k) {
            all = all && umb_orient(corners[0], corners[1], corners[2], h.points[k]) == -1;
        }
        assert_int_equal(umb_hull_beyond(&h, &p), all);
        beyond += all;
    }
    assert_true(beyond > rounds(20000) / 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_boxes), cmocka_unit_test(test_turned_boxes),
                                       cmocka_unit_test(test_triangles), cmocka_unit_test(test_beyond)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

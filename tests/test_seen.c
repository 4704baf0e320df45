/* Sides of lines and corners of the picture against whole numbers of the compiler's, in scenes where most corners lie on
 * lines; numbers without end against the compiler's. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "occlusion/hull.h"

__extension__ typedef __int128 whole;

static uint64_t rng = 1;

static uint32_t below(uint32_t n)
{
    rng = rng * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(rng >> 33) % n;
}

static int between(int low, int high)
{
    return low + (int)below((uint32_t)(high - low + 1));
}

static uint32_t rounds(uint32_t normal)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && size[0] == 's' ? normal / 10 : size != NULL && size[0] == 'f' ? normal * 10 : normal;
}

/* ---- bigint ---- */

static whole value_of(const umb_bigint *n)
{
    whole v = 0;
    for (uint32_t i = n->count; i-- > 0;) {
        v = (v << 32) + n->limb[i];
    }
    return v * n->sign;
}

static void test_bigint(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < rounds(100000); ++i) {
        double x = (double)between(-100000000, 100000000) * (double)(1 + below(30000));
        double y = (double)between(-100000000, 100000000) * (below(2) != 0 ? 0x1p-3 : 1.0);
        umb_bigint a, b, product, sum;
        assert_true(umb_bigint_from_double(x, 0, &a));
        assert_true(umb_bigint_from_double(y, 3, &b));
        umb_bigint_multiply(&a, &b, &product);
        assert_true(value_of(&product) == (whole)x * (whole)(y * 8.0));
        umb_bigint_add(&product, &a, below(2) != 0 ? 1 : -1, &sum);
        whole difference = value_of(&sum) - value_of(&product);
        assert_true(difference == (whole)x || difference == -(whole)x);
        umb_bigint_add(&sum, &sum, -1, &sum);
        assert_int_equal(sum.sign, 0);
        assert_int_equal(sum.count, 0);
    }
    umb_bigint n;
    assert_true(umb_bigint_from_double(0x1.8p-60, 61, &n));
    assert_true(value_of(&n) == 3);
    assert_false(umb_bigint_from_double(0x1.8p-60, 60, &n));
    assert_false(umb_bigint_from_double(0x1p100, 30, &n));
    assert_false(umb_bigint_from_double(INFINITY, 0, &n));
    assert_true(umb_bigint_from_double(-0x1.fffffffffffffp126, 0, &n));
}

/* ---- sides ---- */

typedef struct vec {
    whole c[3];
} vec;

static vec cross(vec a, vec b)
{
    vec out;
    for (int k = 0; k < 3; ++k) {
        out.c[k] = a.c[(k + 1) % 3] * b.c[(k + 2) % 3] - a.c[(k + 2) % 3] * b.c[(k + 1) % 3];
    }
    return out;
}

static int sign_of_dot(vec a, vec b)
{
    whole s = a.c[0] * b.c[0] + a.c[1] * b.c[1] + a.c[2] * b.c[2];
    return s > 0 ? 1 : s < 0 ? -1 : 0;
}

/* Eye in eighths, points in whole numbers times scale; directions are whole numbers of 64ths. */
typedef struct stand {
    int eye[3], forward[3];
    bool parallel;
    double scale;
    umb_seen_from from;
} stand;

static stand make_stand(void)
{
    stand s = {.parallel = below(2) != 0, .scale = below(3) == 0 ? 0x1p-20 : 1.0};
    double eye[3], forward[3];
    do {
        for (int k = 0; k < 3; ++k) {
            s.eye[k] = between(-40, 40);
            s.forward[k] = below(3) == 0 ? 0 : between(-64, 64);
            eye[k] = s.eye[k] * 0.125 * s.scale;
            forward[k] = s.forward[k] / 64.0;
        }
    } while (s.forward[0] == 0 && s.forward[1] == 0 && s.forward[2] == 0);
    umb_seen_prepare(&s.from, eye, forward, s.parallel, 1000.0 * s.scale);
    return s;
}

static vec image(const stand *s, const int p[3])
{
    vec d = {{8 * p[0] - s->eye[0], 8 * p[1] - s->eye[1], 8 * p[2] - s->eye[2]}}, q;
    int k = s->from.axis, i = (k + 1) % 3, j = (k + 2) % 3;
    if (!s->parallel) {
        return d;
    }
    q.c[0] = d.c[i] * s->forward[k] - d.c[k] * s->forward[i];
    q.c[1] = d.c[j] * s->forward[k] - d.c[k] * s->forward[j];
    q.c[2] = s->forward[k];
    return q;
}

static void random_point(const stand *s, int p[3], float out[3])
{
    for (int k = 0; k < 3; ++k) {
        p[k] = between(-9, 9);
        out[k] = (float)(p[k] * s->scale);
    }
}

typedef struct lines {
    vec n[6];
    umb_seen_line line[6];
} lines;

/* Lines that share points, and some that lie in one plane with the eye. */
static void make_lines(const stand *s, lines *l)
{
    int p[4][3];
    float at[4][3];
    for (int i = 0; i < 4; ++i) {
        random_point(s, p[i], at[i]);
    }
    if (below(2) != 0) { /* the middle between two others */
        for (int k = 0; k < 3; ++k) {
            p[2][k] = 2 * p[1][k] - p[0][k];
            at[2][k] = (float)(p[2][k] * s->scale);
        }
    }
    for (int i = 0; i < 6; ++i) {
        static const uint8_t ends[6][2] = {{0, 1}, {1, 2}, {0, 2}, {2, 3}, {3, 0}, {3, 1}};
        l->n[i] = cross(image(s, p[ends[i][0]]), image(s, p[ends[i][1]]));
        umb_seen_line_through(&s->from, at[ends[i][0]], at[ends[i][1]], &l->line[i]);
    }
}

static void check_sides(const stand *s, const lines *l)
{
    for (int i = 0; i < 6; ++i) {
        int p[3];
        float at[3];
        umb_seen_corner c;
        random_point(s, p, at);
        umb_seen_corner_at(&s->from, at, &c);
        int expected = sign_of_dot(l->n[i], image(s, p));
        assert_int_equal(umb_seen_side(&s->from, &l->line[i], &c), expected);
        assert_int_equal(umb_seen_side_exact(&s->from, &l->line[i], &c), expected);
        for (int k = 0; k < 6; ++k) {
            int m = (int)below(6), sign = below(2) != 0 ? 1 : -1;
            umb_seen_corner_of(&l->line[k], &l->line[m], sign, &c);
            expected = sign * sign_of_dot(l->n[i], cross(l->n[k], l->n[m]));
            assert_int_equal(umb_seen_side(&s->from, &l->line[i], &c), expected);
            assert_int_equal(umb_seen_side_exact(&s->from, &l->line[i], &c), expected);
        }
    }
}

static void test_sides(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < rounds(5000); ++i) {
        stand s = make_stand();
        lines l;
        assert_true(s.from.exact);
        make_lines(&s, &l);
        check_sides(&s, &l);
    }
}

/* ---- depth ---- */

/* A plane that faces the viewer, by points whose coordinates are whole numbers of eighths from the eye. */
typedef struct plane {
    float at[3][3];
    vec n;
    whole h, along;
} plane;

static bool make_plane(const stand *s, plane *p)
{
    vec d[3], u, v;
    for (int i = 0; i < 3; ++i) {
        int at[3];
        random_point(s, at, p->at[i]);
        for (int k = 0; k < 3; ++k) {
            d[i].c[k] = 8 * at[k] - s->eye[k];
        }
    }
    for (int k = 0; k < 3; ++k) {
        u.c[k] = d[2].c[k] - d[0].c[k];
        v.c[k] = d[1].c[k] - d[0].c[k];
    }
    p->n = cross(u, v);
    p->h = p->along = 0;
    for (int k = 0; k < 3; ++k) {
        p->h += p->n.c[k] * d[0].c[k];
        p->along += p->n.c[k] * s->forward[k];
    }
    return s->parallel ? p->along > 0 : p->h > 0;
}

/* Both planes' depths along the line through the eye and the image, multiplied crosswise. */
static vec depth_of(const stand *s, const plane *front, const plane *back)
{
    vec out;
    for (int m = 0; m < 3; ++m) {
        int i = (s->from.axis + 1 + m) % 3;
        out.c[m] = !s->parallel ? front->h * back->n.c[m] - back->h * front->n.c[m]
                   : m < 2      ? back->n.c[i] * front->along - front->n.c[i] * back->along
                                : front->h * back->along - back->h * front->along;
    }
    for (int m = 0; m < 3 && s->parallel && s->forward[s->from.axis] < 0; ++m) {
        out.c[m] = -out.c[m];
    }
    return out;
}

static void make_depth(const stand *s, const plane *front, const plane *back, umb_seen_depth *depth, umb_seen_line *line)
{
    umb_shadow_plane f, b;
    umb_seen_vector n;
    umb_shadow_plane_of(&s->from, front->at[0], front->at[1], front->at[2], &f);
    umb_shadow_plane_of(&s->from, back->at[0], back->at[1], back->at[2], &b);
    umb_hull_depth(&s->from, &f, &b, &n);
    for (int i = 0; i < 3; ++i) {
        depth->front[i] = front->at[i];
        depth->back[i] = back->at[i];
    }
    umb_seen_line_depth(&n, depth, line);
}

static void check_depth(const stand *s, const lines *l, const plane p[3])
{
    umb_seen_depth depth[2];
    umb_seen_line line[2];
    vec n[2];
    for (int i = 0; i < 2; ++i) {
        n[i] = depth_of(s, &p[i], &p[i + 1]);
        make_depth(s, &p[i], &p[i + 1], &depth[i], &line[i]);
    }
    for (int i = 0; i < 6; ++i) {
        umb_seen_corner c;
        umb_seen_corner_of(&l->line[i], &l->line[(i + 1) % 6], 1, &c);
        int expected = sign_of_dot(n[0], cross(l->n[i], l->n[(i + 1) % 6]));
        assert_int_equal(umb_seen_side(&s->from, &line[0], &c), expected);
        assert_int_equal(umb_seen_side_exact(&s->from, &line[0], &c), expected);
        umb_seen_corner_of(&line[0], &l->line[i], -1, &c);
        expected = -sign_of_dot(l->n[0], cross(n[0], l->n[i]));
        assert_int_equal(umb_seen_side(&s->from, &l->line[0], &c), expected);
        assert_int_equal(umb_seen_side_exact(&s->from, &l->line[0], &c), expected);
        assert_int_equal(umb_seen_side(&s->from, &line[0], &c), 0);
        assert_int_equal(umb_seen_side_exact(&s->from, &line[0], &c), 0);
        umb_seen_corner_of(&line[0], &line[1], 1, &c);
        expected = sign_of_dot(l->n[i], cross(n[0], n[1]));
        assert_int_equal(umb_seen_side(&s->from, &l->line[i], &c), expected);
        assert_int_equal(umb_seen_side_exact(&s->from, &l->line[i], &c), expected);
        assert_int_equal(umb_seen_side_exact(&s->from, &line[1], &c), 0);
    }
}

/* Lines where planes are equally deep. */
static void test_depth(void **state)
{
    (void)state;
    uint32_t checked = 0;
    for (uint32_t i = 0; i < rounds(20000); ++i) {
        stand s = make_stand();
        lines l;
        plane p[3];
        make_lines(&s, &l);
        if (make_plane(&s, &p[0]) && make_plane(&s, &p[1]) && make_plane(&s, &p[2])) {
            check_depth(&s, &l, p);
            checked += 1;
        }
    }
    assert_true(checked > rounds(20000) / 20);
}

static float far_or_near(void)
{
    return (float)ldexp(between(-8388607, 8388607), below(2) != 0 ? -13 : -94);
}

/* As far and as fine as numbers may be: the longest whole numbers have room, and what is turned round has the other sign. */
static void test_longest(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < rounds(2000); ++i) {
        umb_seen_from from;
        double eye[3], forward[3];
        for (int k = 0; k < 3; ++k) {
            eye[k] = far_or_near() + ldexp(between(-8388607, 8388607), -94);
            forward[k] = ldexp(between(-8388607, 8388607), -23) + ldexp(between(1, 8388607), -75);
        }
        umb_seen_prepare(&from, eye, forward, i % 2 != 0, 1023.0);
        assert_true(from.exact);
        plane p[6];
        umb_seen_line line[3], turned;
        umb_seen_depth depth[3], back;
        const stand s = {.from = from};
        for (int m = 0; m < 54; ++m) {
            p[m / 9].at[m % 9 / 3][m % 3] = far_or_near();
        }
        for (int m = 0; m < 3; ++m) {
            make_depth(&s, &p[2 * m], &p[2 * m + 1], &depth[m], &line[m]);
        }
        make_depth(&s, &p[1], &p[0], &back, &turned);
        umb_seen_corner c;
        umb_seen_corner_of(&line[1], &line[2], 1, &c);
        int side = umb_seen_side_exact(&from, &line[0], &c);
        assert_true(side != 0 && side != UMB_SEEN_UNKNOWN);
        assert_int_equal(umb_seen_side(&from, &line[0], &c), side);
        assert_int_equal(umb_seen_side_exact(&from, &turned, &c), -side);
    }
}

/* Where coordinates are finer than the small unit a side may be unknown, and is never wrong. */
static void test_too_fine(void **state)
{
    (void)state;
    const double eye[3] = {0x1p-140, 0, 0}, forward[3] = {0, 0, 1};
    umb_seen_from from;
    umb_seen_prepare(&from, eye, forward, false, 100.0);
    assert_false(from.exact);
    const float a[3] = {-1, 0, 1}, b[3] = {1, 0, 1}, on[3] = {0, 0, 2}, off[3] = {0, 1, 2};
    umb_seen_line line;
    umb_seen_corner c;
    umb_seen_line_through(&from, a, b, &line);
    umb_seen_corner_at(&from, on, &c);
    int side = umb_seen_side(&from, &line, &c);
    assert_true(side == 0 || side == UMB_SEEN_UNKNOWN);
    umb_seen_corner_at(&from, off, &c);
    assert_int_equal(abs(umb_seen_side(&from, &line, &c)), 1);
    umb_seen_corner_at(&from, a, &c);
    assert_int_equal(umb_seen_side(&from, &line, &c), 0); /* by what it is made of */
}

/* A square cut by lines through its corners, middles and beside it keeps its orientation and its corners' places. */
static void test_cuts(void **state)
{
    (void)state;
    for (uint32_t round = 0; round < rounds(5000); ++round) {
        stand s = make_stand();
        if (s.parallel) {
            continue;
        }
        memset(s.eye, 0, sizeof s.eye);
        const double eye[3] = {0, 0, 0}, forward[3] = {0, 0, 1};
        umb_seen_prepare(&s.from, eye, forward, false, 1000.0);
        static const float square[4][3] = {{-4, -4, 8}, {4, -4, 8}, {4, 4, 8}, {-4, 4, 8}};
        umb_seen_line edges[4], cutter;
        umb_seen_corner in[4], parts[2][8];
        int8_t sides[4];
        bool both[2] = {false, false};
        const float a[3] = {(float)between(-6, 6), (float)between(-6, 6), 8};
        const float b[3] = {(float)between(-6, 6), (float)between(-6, 6), 8};
        umb_seen_line_through(&s.from, a, b, &cutter);
        for (int i = 0; i < 4; ++i) {
            umb_seen_line_later(square[i], square[(i + 1) % 4], &edges[i]);
            umb_seen_corner_at(&s.from, square[i], &in[i]);
            in[i].edge = &edges[i];
            in[i].flip = in[i].closed = false;
            sides[i] = (int8_t)umb_seen_side(&s.from, &cutter, &in[i]);
            both[0] = both[0] || sides[i] < 0;
            both[1] = both[1] || sides[i] > 0;
        }
        if (!both[0] || !both[1]) {
            continue;
        }
        umb_seen_cut cut = {&s.from, &cutter, in, sides, 4};
        for (int part = 0; part < 2; ++part) {
            uint32_t n = umb_seen_clip(&cut, part == 0 ? -1 : 1, parts[part]);
            assert_in_range(n, 3, 5);
            uint32_t closed = 0;
            for (uint32_t i = 0; i < n; ++i) {
                const umb_seen_corner *c = &parts[part][i];
                closed += c->closed;
                for (uint32_t k = 0; k < n; ++k) { /* inside of its own edges */
                    umb_seen_line edge = *c->edge;
                    if (!edge.ready) {
                        umb_seen_line_through(&s.from, edge.a, edge.b, &edge);
                    }
                    int side = umb_seen_side(&s.from, &edge, &parts[part][k]);
                    assert_true((c->flip ? -side : side) >= 0);
                }
                assert_true(c->v.at[2] > 0.0);
                assert_true(fabs(c->v.at[0]) <= 0.5001 * c->v.at[2] && fabs(c->v.at[1]) <= 0.5001 * c->v.at[2]);
            }
            assert_int_equal(closed, 1);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_bigint), cmocka_unit_test(test_sides), cmocka_unit_test(test_depth),
                                       cmocka_unit_test(test_longest),
                                       cmocka_unit_test(test_too_fine), cmocka_unit_test(test_cuts)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Which meshes are convex, against bodies known to be so and against those with one thing wrong. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/orient.h"
#include "scene/mesh.h"
#include "support/failing.h"

enum { MOST_POSITIONS = 200, MOST_TRIANGLES = 700 };

typedef struct body {
    float positions[MOST_POSITIONS][3];
    uint32_t triangles[MOST_TRIANGLES][3];
    uint8_t flags[MOST_TRIANGLES];
    uint32_t position_count, triangle_count;
} body;

enum { PLAIN = 0, CONVEX = 1, BOX = 3 };

static int verdict(const body *b)
{
    umb_allocator a = umb_memory_allocator(NULL);
    umb_shape_def def = {.positions = b->positions[0],
                         .position_count = b->position_count,
                         .indices = b->triangles[0],
                         .index_count = 3 * b->triangle_count,
                         .triangle_flags = b->flags};
    umb_mesh *m[2] = {NULL, NULL};
    assert_int_equal(umb_mesh_create(&a, &def, &m[0]), UMB_OK);
    assert_int_equal(umb_mesh_create_occluder(&a, &def, &m[1]), UMB_OK);
    int found = (m[0]->convex ? 1 : 0) | (m[0]->box ? 2 : 0);
    assert_int_equal(found, (m[1]->convex ? 1 : 0) | (m[1]->box ? 2 : 0));
    umb_mesh_destroy(&a, m[0]);
    umb_mesh_destroy(&a, m[1]);
    return found;
}

static void add_triangle(body *b, uint32_t i, uint32_t j, uint32_t k)
{
    assert_true(b->triangle_count < MOST_TRIANGLES);
    b->triangles[b->triangle_count][0] = i;
    b->triangles[b->triangle_count][1] = j;
    b->triangles[b->triangle_count][2] = k;
    b->flags[b->triangle_count++] = 0;
}

static uint32_t add_position(body *b, float x, float y, float z)
{
    assert_true(b->position_count < MOST_POSITIONS);
    b->positions[b->position_count][0] = x;
    b->positions[b->position_count][1] = y;
    b->positions[b->position_count][2] = z;
    return b->position_count++;
}

/* Corner i of a box has bit k of i as its side on axis k. */
static void add_box(body *b, const float low[3], const float high[3], bool other_diagonals)
{
    static const uint32_t faces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                         {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    uint32_t first = b->position_count;
    for (uint32_t i = 0; i < 8; ++i) {
        add_position(b, i & 1 ? high[0] : low[0], i & 2 ? high[1] : low[1],
                     i & 4 ? high[2] : low[2]);
    }
    for (int f = 0; f < 6; ++f) {
        uint32_t q[4];
        for (int k = 0; k < 4; ++k) {
            q[k] = first + faces[f][(k + (other_diagonals ? 1 : 0)) % 4];
        }
        add_triangle(b, q[0], q[1], q[2]);
        add_triangle(b, q[0], q[2], q[3]);
    }
}

static void make_box(body *b)
{
    memset(b, 0, sizeof *b);
    add_box(b, (const float[3]){-1, 0.1f, 3}, (const float[3]){2, 0.7f, 1e6f}, false);
}

/* The hull of points of which no four lie in one plane, by trying all triples. */
static void make_hull(body *b, dice *d, uint32_t count, bool outside_only)
{
    memset(b, 0, sizeof *b);
    for (uint32_t i = 0; i < count; ++i) {
        double p[3], length = 0.0;
        for (int k = 0; k < 3; ++k) {
            p[k] = (double)dice_roll(d, 2000001) - 1e6;
            length += p[k] * p[k];
        }
        length = outside_only ? sqrt(length) : 1.0;
        add_position(b, (float)(p[0] / length), (float)(p[1] / length), (float)(p[2] / length));
    }
    for (uint32_t i = 0; i < count; ++i) {
        for (uint32_t j = i + 1; j < count; ++j) {
            for (uint32_t k = j + 1; k < count; ++k) {
                bool front = false, behind = false;
                for (uint32_t n = 0; n < count && !(front && behind); ++n) {
                    int side = umb_orient(b->positions[i], b->positions[j], b->positions[k],
                                          b->positions[n]);
                    assert_true(side != 0 || n == i || n == j || n == k);
                    front = front || side > 0;
                    behind = behind || side < 0;
                }
                if (!front) {
                    add_triangle(b, i, j, k);
                } else if (!behind) {
                    add_triangle(b, i, k, j);
                }
            }
        }
    }
}

/* A prism over a regular polygon: many vertices in one plane. Its sides are exactly flat, because
 * their upright edges are parallel. */
static void make_prism(body *b, uint32_t sides)
{
    memset(b, 0, sizeof *b);
    for (uint32_t i = 0; i < sides; ++i) {
        double angle = 6.283185307179586 * i / sides;
        add_position(b, (float)cos(angle), (float)sin(angle), 0.0f);
        add_position(b, (float)cos(angle), (float)sin(angle), 2.0f);
    }
    for (uint32_t i = 0; i < sides; ++i) {
        uint32_t j = (i + 1) % sides;
        add_triangle(b, 2 * i, 2 * j, 2 * j + 1);
        add_triangle(b, 2 * i, 2 * j + 1, 2 * i + 1);
        if (i >= 1 && i + 1 < sides) {
            add_triangle(b, 0, 2 * j, 2 * i);
            add_triangle(b, 1, 2 * i + 1, 2 * j + 1);
        }
    }
}

static void test_boxes(void **state)
{
    (void)state;
    static body b;
    make_box(&b);
    assert_int_equal(verdict(&b), BOX);
    memset(&b, 0, sizeof b);
    add_box(&b, (const float[3]){0, 0, 0}, (const float[3]){1, 1, 1}, true);
    assert_int_equal(verdict(&b), BOX);
    /* Turned by 45 degrees: a hexahedron, but not that of its bounds. */
    for (uint32_t i = 0; i < 8; ++i) {
        float x = b.positions[i][0], y = b.positions[i][1];
        b.positions[i][0] = x - y;
        b.positions[i][1] = x + y;
    }
    assert_int_equal(verdict(&b), CONVEX);
    /* A corner drawn in or out by the smallest step bends three faces: of the two ways to cut a
       square, one bends inwards. */
    make_box(&b);
    b.positions[7][0] = nextafterf(b.positions[7][0], 3.0f);
    assert_int_not_equal(verdict(&b), BOX);
}

static void test_box_as_files_have_it(void **state)
{
    (void)state;
    static body b;
    make_box(&b);
    /* Every triangle with corners of its own, degenerate triangles, triangles that do not block. */
    body split;
    memset(&split, 0, sizeof split);
    for (uint32_t t = 0; t < b.triangle_count; ++t) {
        uint32_t v[3];
        for (int k = 0; k < 3; ++k) {
            const float *p = b.positions[b.triangles[t][k]];
            v[k] = add_position(&split, p[0], p[1], p[2]);
        }
        add_triangle(&split, v[0], v[1], v[2]);
        add_triangle(&split, v[0], v[1], v[0]);
    }
    assert_int_equal(verdict(&split), BOX);
    uint32_t far = add_position(&split, 1e9f, 0, 0);
    add_triangle(&split, 0, 1, far);
    assert_int_equal(verdict(&split), PLAIN);
    split.flags[split.triangle_count - 1] = UMB_TRIANGLE_OPEN;
    assert_int_equal(verdict(&split), BOX);
}

static void test_solids(void **state)
{
    (void)state;
    static body b;
    dice d = {17};
    for (uint32_t n = 4; n <= 66; n += n < 12 ? 1 : 9) {
        make_hull(&b, &d, n, true);
        assert_int_equal(b.triangle_count, 2 * n - 4);
        assert_int_equal(verdict(&b), CONVEX);
    }
    make_hull(&b, &d, 67, true);
    assert_int_equal(b.triangle_count, 130);
    assert_int_equal(verdict(&b), PLAIN); /* too many triangles */
    for (int round = 0; round < 40; ++round) {
        make_hull(&b, &d, 4 + dice_roll(&d, 30), false);
        assert_int_equal(verdict(&b), CONVEX);
    }
    for (uint32_t sides = 3; sides <= 32; ++sides) {
        make_prism(&b, sides);
        assert_int_equal(verdict(&b), CONVEX);
    }
}

static void flip(body *b, uint32_t t)
{
    uint32_t v = b->triangles[t][1];
    b->triangles[t][1] = b->triangles[t][2];
    b->triangles[t][2] = v;
}

/* Every single fault, at every triangle. */
static void check_faults(const body *good)
{
    static body b;
    for (uint32_t t = 0; t < good->triangle_count; ++t) {
        b = *good;
        flip(&b, t);
        assert_int_equal(verdict(&b), PLAIN);
        b = *good;
        b.flags[t] = UMB_TRIANGLE_TWO_SIDED;
        assert_int_equal(verdict(&b), PLAIN);
        b.flags[t] = UMB_TRIANGLE_OPEN;
        assert_int_equal(verdict(&b), PLAIN);
        b = *good;
        memcpy(b.triangles[t], b.triangles[--b.triangle_count], sizeof b.triangles[t]);
        assert_int_equal(verdict(&b), PLAIN);
        b = *good;
        add_triangle(&b, b.triangles[t][0], b.triangles[t][1], b.triangles[t][2]);
        assert_int_equal(verdict(&b), PLAIN);
        add_triangle(&b, b.triangles[t][0], b.triangles[t][2], b.triangles[t][1]);
        assert_int_equal(verdict(&b), PLAIN);
    }
    b = *good;
    for (uint32_t t = 0; t < b.triangle_count; ++t) {
        flip(&b, t);
    }
    assert_int_equal(verdict(&b), PLAIN); /* a room, seen from inside */
}

static void test_faults(void **state)
{
    (void)state;
    static body b;
    dice d = {23};
    make_box(&b);
    check_faults(&b);
    make_prism(&b, 6);
    check_faults(&b);
    make_hull(&b, &d, 4, true);
    check_faults(&b);
    make_hull(&b, &d, 20, true);
    check_faults(&b);
    /* One vertex pushed through the body, or just under the plane of its neighbours. */
    for (uint32_t i = 0; i < 20; ++i) {
        body dented = b;
        for (int k = 0; k < 3; ++k) {
            dented.positions[i][k] *= -0.5f;
        }
        assert_int_equal(verdict(&dented), PLAIN);
    }
}

static void test_two_bodies(void **state)
{
    (void)state;
    static body b;
    make_box(&b);
    add_box(&b, (const float[3]){10, 0, 0}, (const float[3]){11, 1, 1}, false);
    assert_int_equal(verdict(&b), PLAIN);
    memset(&b, 0, sizeof b); /* one inside the other */
    add_box(&b, (const float[3]){0, 0, 0}, (const float[3]){3, 3, 3}, false);
    add_box(&b, (const float[3]){1, 1, 1}, (const float[3]){2, 2, 2}, false);
    assert_int_equal(verdict(&b), PLAIN);
    memset(&b, 0, sizeof b); /* two coats of one box, cut along different diagonals: all planes are
                                right and every edge has its partners */
    add_box(&b, (const float[3]){0, 0, 0}, (const float[3]){3, 3, 3}, false);
    add_box(&b, (const float[3]){0, 0, 0}, (const float[3]){3, 3, 3}, true);
    assert_int_equal(verdict(&b), PLAIN);
}

/* The letter L as a prism: six sides, one corner bent inwards. */
static void test_letter(void **state)
{
    (void)state;
    static body b;
    static const float outline[6][2] = {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
    static const uint32_t lid[4][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}};
    memset(&b, 0, sizeof b);
    for (uint32_t i = 0; i < 6; ++i) {
        add_position(&b, outline[i][0], outline[i][1], 0);
        add_position(&b, outline[i][0], outline[i][1], 1);
    }
    for (uint32_t i = 0; i < 6; ++i) {
        uint32_t j = (i + 1) % 6;
        add_triangle(&b, 2 * i, 2 * j, 2 * j + 1);
        add_triangle(&b, 2 * i, 2 * j + 1, 2 * i + 1);
    }
    for (int t = 0; t < 4; ++t) {
        add_triangle(&b, 2 * lid[t][0], 2 * lid[t][2], 2 * lid[t][1]);
        add_triangle(&b, 2 * lid[t][0] + 1, 2 * lid[t][1] + 1, 2 * lid[t][2] + 1);
    }
    assert_int_equal(verdict(&b), PLAIN);
    /* With its bent corner drawn out the same triangles bound a box with vertices on its edges. */
    for (uint32_t i = 6; i < 8; ++i) {
        b.positions[i][0] = 2;
        b.positions[i][1] = 2;
    }
    assert_int_equal(verdict(&b), CONVEX);
}

static void test_torus(void **state)
{
    (void)state;
    static body b;
    memset(&b, 0, sizeof b);
    enum { AROUND = 8, ACROSS = 5 };
    for (uint32_t i = 0; i < AROUND * ACROSS; ++i) {
        double u = 6.283185307179586 * (i / ACROSS) / AROUND;
        double v = 6.283185307179586 * (i % ACROSS) / ACROSS;
        double r = 2.0 + cos(v);
        add_position(&b, (float)(r * cos(u)), (float)(r * sin(u)), (float)sin(v));
    }
    for (uint32_t i = 0; i < AROUND * ACROSS; ++i) {
        uint32_t u = i / ACROSS, v = i % ACROSS;
        uint32_t right = (u + 1) % AROUND * ACROSS, up = (v + 1) % ACROSS;
        add_triangle(&b, i, right + v, right + up);
        add_triangle(&b, i, right + up, u * ACROSS + up);
    }
    assert_int_equal(verdict(&b), PLAIN);
}

static void test_flat(void **state)
{
    (void)state;
    static body b;
    memset(&b, 0, sizeof b);
    add_position(&b, 0, 0, 0);
    add_position(&b, 1, 0, 0);
    add_position(&b, 1, 1, 0);
    add_position(&b, 0, 1, 0);
    add_triangle(&b, 0, 1, 2);
    add_triangle(&b, 0, 2, 3);
    assert_int_equal(verdict(&b), PLAIN);
    /* Its back, cut the other way: closed, of the right counts, and without an inside. */
    add_triangle(&b, 1, 0, 3);
    add_triangle(&b, 1, 3, 2);
    assert_int_equal(verdict(&b), PLAIN);
    b.flags[0] = UMB_TRIANGLE_TWO_SIDED;
    assert_int_equal(verdict(&b), PLAIN);
    b.flags[0] = 0;
    b.positions[2][2] = 0x1p-149f; /* the thinnest tetrahedron there is, one way or the other */
    int one = verdict(&b);
    for (uint32_t t = 0; t < 4; ++t) {
        flip(&b, t);
    }
    assert_int_equal(one + verdict(&b), CONVEX);
    memset(&b, 0, sizeof b); /* a line, a point */
    add_position(&b, 0, 0, 0);
    add_position(&b, 1, 1, 1);
    add_position(&b, 2, 2, 2);
    add_triangle(&b, 0, 1, 2);
    add_triangle(&b, 0, 0, 0);
    assert_int_equal(verdict(&b), PLAIN);
    b.triangle_count = 0;
    assert_int_equal(verdict(&b), PLAIN);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_boxes),      cmocka_unit_test(test_box_as_files_have_it),
        cmocka_unit_test(test_solids),     cmocka_unit_test(test_faults),
        cmocka_unit_test(test_two_bodies), cmocka_unit_test(test_letter),
        cmocka_unit_test(test_torus),      cmocka_unit_test(test_flat),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

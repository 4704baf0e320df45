/* Meshes against slow references: adjacency, parts, merged vertices, what blocks. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/collinear.h"
#include "geometry/transform.h"
#include "scene/mesh.h"
#include "support/failing.h"

enum { MOST_TRIANGLES = 600, MOST_POSITIONS = 300 };

typedef struct soup {
    float positions[MOST_POSITIONS][3];
    uint32_t indices[MOST_TRIANGLES][3];
    uint8_t flags[MOST_TRIANGLES];
    umb_shape_def def;
} soup;

/* Triangles on few lattice points: many equal vertices, duplicates, flat ones, edges with many. */
static void make_soup(soup *s, dice *d, uint32_t positions, uint32_t triangles, uint32_t lattice)
{
    for (uint32_t i = 0; i < positions; ++i) {
        for (int k = 0; k < 3; ++k) {
            float x = (float)dice_roll(d, lattice);
            s->positions[i][k] = x == 0.0f && dice_roll(d, 2) ? -0.0f : x;
        }
    }
    for (uint32_t t = 0; t < triangles; ++t) {
        for (int k = 0; k < 3; ++k) {
            s->indices[t][k] = dice_roll(d, positions);
        }
        s->flags[t] = dice_roll(d, 6) == 0 ? UMB_TRIANGLE_OPEN : 0;
        s->flags[t] |= dice_roll(d, 3) == 0 ? UMB_TRIANGLE_TWO_SIDED : 0;
    }
    umb_shape_def def = {.positions = s->positions[0],
                         .position_count = positions,
                         .indices = s->indices[0],
                         .index_count = 3 * triangles,
                         .triangle_flags = s->flags};
    s->def = def;
}

static bool blocks(const soup *s, uint32_t t)
{
    const uint32_t *i = s->indices[t];
    return (s->flags[t] & UMB_TRIANGLE_OPEN) == 0 &&
           !umb_collinear(s->positions[i[0]], s->positions[i[1]], s->positions[i[2]]);
}

static bool same_position(const float *a, const float *b)
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

static void check_triangles(const soup *s, const umb_mesh *m)
{
    uint32_t n = 0;
    for (uint32_t t = 0; t < s->def.index_count / 3; ++t) {
        if (!blocks(s, t)) {
            continue;
        }
        assert_true(n < m->triangle_count);
        for (int k = 0; k < 3; ++k) {
            assert_true(m->triangles[n][k] < m->block_position_count);
            assert_true(
                same_position(m->positions[m->triangles[n][k]], s->positions[s->indices[t][k]]));
        }
        assert_int_equal(m->two_sided[n], (s->flags[t] & UMB_TRIANGLE_TWO_SIDED) != 0);
        n += 1;
    }
    assert_int_equal(n, m->triangle_count);
    for (uint32_t i = 0; i < m->position_count; ++i) {
        for (uint32_t j = 0; j < i; ++j) {
            assert_false(same_position(m->positions[i], m->positions[j]));
        }
        assert_false(signbit(m->positions[i][0]) && m->positions[i][0] == 0.0f);
    }
}

/* For random triangle states the net multiplicity of every vertex pair is that of the triangles. */
static void check_edges(const umb_mesh *m, dice *d)
{
    static int sum[MOST_POSITIONS][MOST_POSITIONS];
    static int state[MOST_TRIANGLES];
    for (int round = 0; round < 5; ++round) {
        memset(sum, 0, sizeof sum);
        for (uint32_t t = 0; t < m->triangle_count; ++t) {
            state[t] = (int)dice_roll(d, m->two_sided[t] ? 3 : 2) - (m->two_sided[t] ? 1 : 0);
            for (int k = 0; k < 3; ++k) {
                uint32_t a = m->triangles[t][k], b = m->triangles[t][(k + 1) % 3];
                sum[a][b] += state[t];
                sum[b][a] -= state[t];
            }
        }
        for (uint32_t i = 0; i < m->edge_count; ++i) {
            umb_edge e = m->edges[i];
            int net = state[e.f0];
            if (e.f1 != UMB_NONE) {
                int other = state[e.f1 & ~UMB_EDGE_SAME];
                net += (e.f1 & UMB_EDGE_SAME) != 0 ? other : -other;
            }
            sum[e.v0][e.v1] -= net;
            sum[e.v1][e.v0] += net;
        }
        for (uint32_t a = 0; a < m->position_count; ++a) {
            for (uint32_t b = 0; b < m->position_count; ++b) {
                assert_int_equal(sum[a][b], 0);
            }
        }
    }
}

/* Every half-edge is in one entry, f0 and f1 run as documented, entries of an edge are in a row,
 * and no two single entries of one edge could have been a pair. */
static void check_pairs(const umb_mesh *m)
{
    static uint8_t seen[MOST_POSITIONS][MOST_POSITIONS];
    memset(seen, 0, sizeof seen);
    uint32_t halves = 0;
    for (uint32_t i = 0; i < m->edge_count; ++i) {
        umb_edge e = m->edges[i];
        halves += e.f1 == UMB_NONE ? 1 : 2;
        bool forward = false;
        for (int k = 0; k < 3; ++k) {
            forward = forward ||
                      (m->triangles[e.f0][k] == e.v0 && m->triangles[e.f0][(k + 1) % 3] == e.v1);
        }
        assert_true(forward);
        uint32_t low = e.v0 < e.v1 ? e.v0 : e.v1, high = e.v0 < e.v1 ? e.v1 : e.v0;
        const umb_edge *p = i > 0 ? &m->edges[i - 1] : NULL;
        bool follows = p != NULL &&
                       ((p->v0 == low && p->v1 == high) || (p->v0 == high && p->v1 == low));
        assert_true(follows || !seen[low][high]);
        seen[low][high] = 1;
        if (follows && e.f1 == UMB_NONE && p->f1 == UMB_NONE) {
            assert_true(p->v0 == e.v0);
        }
    }
    assert_int_equal(halves, 3 * m->triangle_count);
}

static bool box_holds(const umb_aabb *b, const float *p)
{
    for (int k = 0; k < 3; ++k) {
        if (p[k] < b->min[k] || p[k] > b->max[k]) {
            return false;
        }
    }
    return true;
}

/* The walk reaches every part, children lie inside their parents, and leaves hold every
 * triangle. */
static void check_parts(const soup *s, const umb_mesh *m)
{
    uint32_t n = s->def.index_count / 3;
    assert_true(m->part_count >= 1 && m->part_count < 2 * n);
    assert_int_equal(m->parts[0].skip, m->part_count);
    for (uint32_t i = 0; i < m->part_count; ++i) {
        const umb_part *p = &m->parts[i];
        assert_true(p->skip > i && p->skip <= m->part_count);
        for (uint32_t k = i + 1; k < p->skip; ++k) {
            assert_true(m->parts[k].skip <= p->skip);
            assert_true(box_holds(&p->box, m->parts[k].box.min) &&
                        box_holds(&p->box, m->parts[k].box.max));
        }
    }
    for (uint32_t t = 0; t < n; ++t) {
        bool held = false;
        for (uint32_t i = 0; i < m->part_count && !held; ++i) {
            held = m->parts[i].skip == i + 1;
            for (int k = 0; k < 3; ++k) {
                held = held && box_holds(&m->parts[i].box, s->positions[s->indices[t][k]]);
            }
        }
        assert_true(held);
    }
}

static void test_random(void **state)
{
    (void)state;
    static soup s;
    dice d = {7};
    umb_allocator a = umb_memory_allocator(NULL);
    for (int round = 0; round < 400; ++round) {
        uint32_t triangles = round < 40 ? (uint32_t)round : 1 + dice_roll(&d, MOST_TRIANGLES - 1);
        make_soup(&s, &d, 1 + dice_roll(&d, MOST_POSITIONS - 1), triangles, 2 + dice_roll(&d, 4));
        umb_mesh *m = NULL;
        assert_int_equal(umb_mesh_create(&a, &s.def, &m), UMB_OK);
        check_triangles(&s, m);
        check_edges(m, &d);
        check_pairs(m);
        if (triangles > 0) {
            check_parts(&s, m);
        }
        umb_mesh_destroy(&a, m);
    }
}

/* Two solids meet at an edge, where the lid of each lies turned over on the lid of the other: the
 * lids are not each other's partners. */
static void test_pairs_keep_solids_together(void **state)
{
    (void)state;
    static const float p[5][3] = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {-1, 0, 0}, {0, 1, 0}};
    static const uint32_t triangles[4][3] = {{0, 1, 4}, {1, 0, 2}, {1, 0, 4}, {0, 1, 3}};
    static const uint32_t third[4] = {4, 2, 4, 3};
    umb_shape_def def = {
        .positions = p[0], .position_count = 5, .indices = triangles[0], .index_count = 12};
    umb_allocator a = umb_memory_allocator(NULL);
    umb_mesh *m = NULL;
    assert_int_equal(umb_mesh_create(&a, &def, &m), UMB_OK);
    uint32_t at_the_edge = 0;
    for (uint32_t i = 0; i < m->edge_count; ++i) {
        umb_edge e = m->edges[i];
        if (m->positions[e.v0][0] == 0.0f && m->positions[e.v1][0] == 0.0f &&
            m->positions[e.v0][1] == 0.0f && m->positions[e.v1][1] == 0.0f) {
            at_the_edge += 1;
            assert_true(e.f1 != UMB_NONE && third[e.f0] != third[e.f1]);
        }
    }
    assert_int_equal(at_the_edge, 2);
    umb_mesh_destroy(&a, m);
}

/* A fan of many triangles around one edge takes the quick way and is still right. */
static void test_fan(void **state)
{
    (void)state;
    static soup s;
    dice d = {11};
    make_soup(&s, &d, 250, 500, 9);
    for (uint32_t i = 0; i < 250; ++i) {
        s.positions[i][0] = (float)i * (float)i;
        s.positions[i][1] = (float)i;
    }
    for (uint32_t t = 0; t < 500; ++t) {
        s.indices[t][0] = t % 3 == 0 ? 0 : 1;
        s.indices[t][1] = 1 - s.indices[t][0];
        s.indices[t][2] = 2 + t % 248;
    }
    umb_allocator a = umb_memory_allocator(NULL);
    umb_mesh *m = NULL;
    assert_int_equal(umb_mesh_create(&a, &s.def, &m), UMB_OK);
    check_edges(m, &d);
    check_pairs(m);
    umb_mesh_destroy(&a, m);
}

static void test_bad_definitions(void **state)
{
    (void)state;
    float p[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    umb_shape_def good = {
        .positions = p[0], .position_count = 4, .indices = indices, .index_count = 6};
    umb_allocator a = umb_memory_allocator(NULL);
    umb_mesh *m = NULL;
    assert_int_equal(umb_mesh_create(&a, NULL, &m), UMB_ERROR_ARGUMENT);
    umb_shape_def def = good;
    def.positions = NULL;
    assert_int_equal(umb_mesh_create(&a, &def, &m), UMB_ERROR_ARGUMENT);
    def = good;
    def.position_count = 3;
    assert_int_equal(umb_mesh_create(&a, &def, &m), UMB_ERROR_ARGUMENT);
    def = good;
    def.index_count = 5;
    assert_int_equal(umb_mesh_create(&a, &def, &m), UMB_ERROR_ARGUMENT);
    def = good;
    def.position_stride = 8;
    assert_int_equal(umb_mesh_create(&a, &def, &m), UMB_ERROR_ARGUMENT);
    def = good;
    def.position_count = (1u << 30) + 1;
    assert_int_equal(umb_mesh_create(&a, &def, &m), UMB_ERROR_LIMIT);
    p[1][2] = NAN;
    assert_int_equal(umb_mesh_create(&a, &good, &m), UMB_ERROR_ARGUMENT);
    p[1][2] = INFINITY;
    assert_int_equal(umb_mesh_create(&a, &good, &m), UMB_ERROR_ARGUMENT);
    assert_null(m);
    p[1][2] = 0.0f;
    def = good;
    def.index_count = 0;
    def.indices = NULL;
    assert_int_equal(umb_mesh_create(&a, &def, &m),
                     UMB_OK); /* points alone: bounds and nothing else */
    assert_int_equal(m->triangle_count, 0);
    assert_int_equal(m->part_count, 1);
    assert_true(m->bounds.max[2] == 1.0f && m->bounds.min[0] == 0.0f);
    umb_mesh_destroy(&a, m);
}

static void test_stride(void **state)
{
    (void)state;
    float p[3][5] = {{0, 0, 0, 9, 9}, {1, 0, 0, 9, 9}, {0, 1, 0, 9, 9}};
    uint32_t indices[3] = {0, 1, 2};
    umb_shape_def def = {.positions = p[0],
                         .position_count = 3,
                         .position_stride = 20,
                         .indices = indices,
                         .index_count = 3};
    umb_allocator a = umb_memory_allocator(NULL);
    umb_mesh *m = NULL;
    assert_int_equal(umb_mesh_create(&a, &def, &m), UMB_OK);
    assert_int_equal(m->triangle_count, 1);
    assert_true(m->bounds.max[0] == 1.0f && m->bounds.max[1] == 1.0f && m->bounds.max[2] == 0.0f);
    umb_mesh_destroy(&a, m);
}

/* The box under a transform is that of the world vertices, to the bit, on the quick way too. */
static void test_world_bounds(void **state)
{
    (void)state;
    static soup s;
    dice d = {3};
    umb_allocator a = umb_memory_allocator(NULL);
    for (int round = 0; round < 200; ++round) {
        make_soup(&s, &d, 40, 20, 7);
        umb_mesh *m = NULL;
        assert_int_equal(umb_mesh_create(&a, &s.def, &m), UMB_OK);
        umb_transform t = {{{0}}};
        int turned = (int)dice_roll(&d, 3);
        for (int k = 0; k < 12; ++k) {
            if (round % 2 == 0 || k % 4 == 3 || k % 4 == (k / 4 + turned) % 3) {
                t.m[k / 4][k % 4] = ((float)dice_roll(&d, 2001) - 1000.0f) / 37.0f;
            }
        }
        umb_mesh_place place;
        const umb_aabb *block_bounds = umb_mesh_world_bounds(m, &t, &place);
        for (int blocking = 0; blocking < 2; ++blocking) {
            uint32_t count = blocking ? m->block_position_count : m->position_count;
            umb_aabb box = blocking ? *block_bounds : place.bounds;
            bool touched[6] = {false};
            for (uint32_t i = 0; i < count; ++i) {
                float p[3];
                umb_transform_point(&t, m->positions[i], p);
                assert_true(box_holds(&box, p));
                for (int k = 0; k < 3; ++k) {
                    touched[k] = touched[k] || p[k] == box.min[k];
                    touched[k + 3] = touched[k + 3] || p[k] == box.max[k];
                }
            }
            for (int k = 0; k < 6 && count > 0; ++k) {
                assert_true(touched[k]);
            }
        }
        umb_mesh_destroy(&a, m);
    }
}

static void test_failing_memory(void **state)
{
    (void)state;
    static soup s;
    dice d = {5};
    make_soup(&s, &d, 100, 300, 4);
    failing f;
    umb_result result = UMB_ERROR_MEMORY;
    for (long long limit = 0; result != UMB_OK; ++limit) {
        umb_allocator a = failing_allocator(&f, limit);
        umb_mesh *m = NULL;
        result = umb_mesh_create(&a, &s.def, &m);
        assert_true(result == UMB_OK || (result == UMB_ERROR_MEMORY && m == NULL));
        umb_mesh_destroy(&a, m);
        assert_int_equal(atomic_load(&f.held), 0);
        assert_true(limit < 100);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_random),
        cmocka_unit_test(test_pairs_keep_solids_together),
        cmocka_unit_test(test_fan),
        cmocka_unit_test(test_bad_definitions),
        cmocka_unit_test(test_stride),
        cmocka_unit_test(test_world_bounds),
        cmocka_unit_test(test_failing_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Occlusion trees against exact polygon clipping: nothing that is not fully covered is hidden, and what is fully covered
 * is, in scenes where polygons touch, share edges and corners, stand edge to middle and lie in planes with the eye. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "occlusion/occlusion_tree.h"
#include "support/exact_shadows.h"

enum { MOST = 48 };

static uint64_t rng;

static uint32_t below(uint32_t n)
{
    rng = rng * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(rng >> 33) % n;
}

static int between(int low, int high)
{
    return low + (int)below((uint32_t)(high - low + 1));
}

/* The eye looks along +z from near 0; occluders are at z of 1 to 12. */
typedef struct small_scene {
    exact_polygon polygons[MOST];
    int count;
    int eye[3];
} small_scene;

static void add(small_scene *s, const exact_polygon *p)
{
    for (int i = 0; i < p->count; ++i) {
        if (p->corners[i][2] < s->eye[2] + 1) {
            return; /* the near plane would cut it */
        }
    }
    if (s->count < MOST && exact_shadows_facing(p, s->eye) != 0) {
        s->polygons[s->count++] = *p;
    }
}

static void add_parallelogram(small_scene *s, const int at[3], const int u[3], const int v[3], bool half)
{
    exact_polygon p = {.count = half ? 3 : 4};
    for (int k = 0; k < 3; ++k) {
        p.corners[0][k] = at[k];
        p.corners[1][k] = at[k] + u[k];
        p.corners[2][k] = at[k] + u[k] + v[k];
        p.corners[3][k] = at[k] + v[k];
    }
    add(s, &p);
}

/* Tiles of one plane: some missing, some cut in two at their middle in one direction or by a diagonal. */
static void add_wall(small_scene *s)
{
    int at[3] = {between(-8, 2), between(-8, 2), between(1, 10)};
    int u[3] = {2 * between(1, 3), 0, between(-1, 1)}, v[3] = {0, 2 * between(1, 3), between(-1, 1)};
    int columns = between(1, 3), rows = between(1, 3);
    for (int i = 0; i < columns; ++i) {
        for (int j = 0; j < rows; ++j) {
            int p[3], half[3], q[3], minus_u[3], minus_v[3];
            for (int k = 0; k < 3; ++k) {
                p[k] = at[k] + i * u[k] + j * v[k];
                half[k] = u[k] / 2;
                q[k] = p[k] + half[k];
            }
            switch (below(5)) {
            case 0:
                if (u[2] == 0) {
                    add_parallelogram(s, p, half, v, false);
                    add_parallelogram(s, q, half, v, false);
                }
                break;
            case 1:
                for (int k = 0; k < 3; ++k) {
                    q[k] = p[k] + u[k] + v[k];
                    minus_u[k] = -u[k];
                    minus_v[k] = -v[k];
                }
                add_parallelogram(s, p, u, v, true);
                add_parallelogram(s, q, minus_u, minus_v, true);
                break;
            default:
                if (below(8) != 0) {
                    add_parallelogram(s, p, u, v, false);
                }
            }
        }
    }
}

static void add_loose(small_scene *s)
{
    int at[3] = {between(-8, 8), between(-8, 8), between(2, 12)};
    int u[3] = {between(-6, 6), between(-6, 6), between(-1, 1)}, v[3] = {between(-6, 6), between(-6, 6), between(-1, 1)};
    add_parallelogram(s, at, u, v, below(3) == 0);
}

/* The faces of a box; those that look away are two-sided here, and hide too. */
static void add_block(small_scene *s)
{
    int at[3] = {between(-8, 6), between(-8, 6), between(2, 12)}, size[3] = {between(1, 6), between(1, 6), between(1, 4)};
    for (int axis = 0; axis < 3; ++axis) {
        for (int far = 0; far < 2; ++far) {
            int p[3], u[3] = {0, 0, 0}, v[3] = {0, 0, 0};
            memcpy(p, at, sizeof p);
            p[axis] += far * size[axis];
            u[(axis + 1) % 3] = size[(axis + 1) % 3];
            v[(axis + 2) % 3] = size[(axis + 2) % 3];
            add_parallelogram(s, p, u, v, false);
        }
    }
}

static void make_scene(small_scene *s, uint32_t kind)
{
    s->count = 0;
    s->eye[0] = between(-3, 3);
    s->eye[1] = between(-3, 3);
    s->eye[2] = -1;
    int n = between(1, 4);
    for (int i = 0; i < n; ++i) {
        switch (kind) {
        case 0:
            add_wall(s);
            break;
        case 1:
            add_block(s);
            break;
        case 2:
            add_loose(s);
            add_loose(s);
            add_loose(s);
            break;
        default:
            add_wall(s);
            add_block(s);
            add_loose(s);
        }
    }
}

static void add_shadow(umb_shadows *shadows, const small_scene *s, int number, uint32_t taken[MOST])
{
    const exact_polygon *p = &s->polygons[number];
    float points[EXACT_CORNERS][3];
    uint32_t triangles[EXACT_CORNERS][3], edges[EXACT_CORNERS][2], n = (uint32_t)p->count;
    bool turn = exact_shadows_facing(p, s->eye) < 0;
    for (uint32_t i = 0; i < n; ++i) {
        const int *c = p->corners[turn ? n - 1 - i : i];
        for (int k = 0; k < 3; ++k) {
            points[i][k] = (float)c[k];
        }
        edges[i][0] = i;
        edges[i][1] = i + 1 < n ? i + 1 : 0;
    }
    for (uint32_t i = 0; i + 2 < n; ++i) {
        triangles[i][0] = 0;
        triangles[i][1] = i + 1;
        triangles[i][2] = i + 2;
    }
    umb_shadow_front front = {.points = (const float(*)[3])points,
                              .triangles = (const uint32_t(*)[3])triangles,
                              .edges = (const uint32_t(*)[2])edges,
                              .triangle_count = n - 2,
                              .edge_count = n,
                              .source = (uint32_t)number};
    if (umb_shadows_add(shadows, &front, false) == UMB_SHADOW_ADDED) {
        taken[shadows->count - 1] = (uint32_t)number;
    }
}

typedef struct tally {
    uint64_t asked, covered, hidden, wrong, missed, nodes, given_up;
} tally;

/* Lines that are left in the tree. */
static uint32_t live_nodes(const umb_occlusion_tree *t, uint32_t ref)
{
    return (ref & UMB_OCCLUSION_COVERED) != 0
               ? 0
               : 1 + live_nodes(t, t->nodes[ref].child[0]) + live_nodes(t, t->nodes[ref].child[1]);
}

static void ask_boxes(umb_occlusion_tree *t, const small_scene *s, uint32_t boxes, tally *sum)
{
    for (uint32_t b = 0; b < boxes; ++b) {
        int low[3] = {between(-12, 10), between(-12, 10), between(2, 20)}, high[3]; /* in view */
        umb_aabb box;
        for (int k = 0; k < 3; ++k) {
            high[k] = low[k] + between(0, 6);
            box.min[k] = (float)low[k];
            box.max[k] = (float)high[k];
        }
        umb_hull hull;
        assert_true(umb_hull_of_box(&hull, &t->shadows->viewer, &box));
        uint32_t start = t->root;
        bool hidden = umb_occlusion_tree_ask(t, &hull, &start) == UMB_OCCLUSION_HIDDEN;
        bool covered = exact_shadows_hide(s->polygons, s->count, s->eye, low, high);
        sum->asked += 1;
        sum->covered += covered;
        sum->hidden += hidden;
        sum->wrong += hidden && !covered;
        sum->missed += covered && !hidden;
    }
}

static void check_scene(uint64_t seed, uint32_t kind, bool modified, tally *sum)
{
    static umb_shadows shadows; /* corners point into it */
    static umb_occlusion_tree tree;
    umb_allocator a = umb_memory_allocator(NULL);
    small_scene s;
    uint32_t taken[MOST];
    rng = seed;
    make_scene(&s, kind);
    const double eye[3] = {s.eye[0], s.eye[1], s.eye[2]}, target[3] = {s.eye[0] + 0.125, s.eye[1] - 0.25, 10},
                 up[3] = {0, 1, 0};
    umb_view view;
    assert_int_equal(umb_view_look_at(&view, eye, target, up, 2.9, 1.0, 0.25, 1000.0), UMB_OK);
    umb_shadow_viewer_prepare(&shadows.viewer, &view, 64.0);
    assert_true(umb_shadows_reserve(&shadows, &a, MOST, MOST * EXACT_CORNERS, MOST * EXACT_CORNERS));
    assert_true(umb_occlusion_tree_reserve(&tree, &a, 40000, 40000));
    umb_shadows_clear(&shadows);
    for (int i = 0; i < s.count; ++i) {
        add_shadow(&shadows, &s, i, taken);
    }
    umb_occlusion_tree_begin(&tree, &shadows, modified);
    for (uint32_t i = 0; i < shadows.count; ++i) {
        umb_occlusion_tree_insert(&tree, i);
    }
    sum->nodes += live_nodes(&tree, tree.root);
    sum->given_up += tree.given_up;
    ask_boxes(&tree, &s, 16, sum);
    umb_occlusion_tree_free(&tree, &a);
    umb_shadows_free(&shadows, &a);
}

static void test_against_clipping(void **state)
{
    (void)state;
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    uint64_t scenes = size != NULL && size[0] == 's' ? 200 : size != NULL && size[0] == 'f' ? 10000 : 2000;
    for (uint32_t kind = 0; kind < 4; ++kind) {
        for (int modified = 0; modified < 2; ++modified) {
            tally sum = {0};
            for (uint64_t i = 0; i < scenes; ++i) {
                check_scene(i * 977 + kind, kind, modified != 0, &sum);
            }
            printf("# kind %u %s: boxes %llu covered %llu hidden %llu missed %llu wrong %llu nodes %llu given up %llu\n",
                   kind, modified != 0 ? "modified" : "plain", (unsigned long long)sum.asked,
                   (unsigned long long)sum.covered, (unsigned long long)sum.hidden, (unsigned long long)sum.missed,
                   (unsigned long long)sum.wrong, (unsigned long long)sum.nodes, (unsigned long long)sum.given_up);
            assert_int_equal(sum.wrong, 0);
            assert_int_equal(sum.missed, 0);
            assert_int_equal(sum.given_up, 0);
            assert_true(sum.covered > scenes / 4);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_against_clipping)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Boxes against frusta: never outside when a plane's half-space is touched, in a reference of wider
 * arithmetic; masking and coherency change nothing; every instruction set gives the same bits. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "frustum/box_kernels.h"
#include "support/frustum_reference.h"
#include "support/random_boxes.h"

#define MAX_KERNELS 4

static uint32_t all_kernels(const umb_box_kernels *out[MAX_KERNELS])
{
    static const umb_isa isas[] = {UMB_ISA_SCALAR, UMB_ISA_SSE4, UMB_ISA_AVX2, UMB_ISA_NEON};
    uint32_t n = 0;
    for (int i = 0; i < 4; ++i) {
        const umb_box_kernels *k = umb_box_kernels_get(isas[i]);
        if (k != NULL) {
            assert_int_equal(k->isa, isas[i]);
            out[n++] = k;
        }
    }
    return n;
}

typedef struct tally {
    uint64_t outside, inside, unsure;
} tally;

/* Check one node's answer against the reference. */
static void check_node(const umb_view *v, const umb_frustum *f, const umb_aabb boxes[8],
                       const umb_node *node, const umb_box_kernels *k, tally *t)
{
    uint16_t left[8];
    uint32_t outside = umb_frustum_test_node(f, k, node, f->all_planes, NULL, left);
    for (uint32_t s = 0; s < node->count; ++s) {
        reference r[UMB_FRUSTUM_PLANES];
        uint32_t count = references(v, &boxes[s], r);
        assert_int_equal(count, f->plane_count);
        bool out = false;
        bool surely_out = false;
        bool unsure = false;
        for (uint32_t p = 0; p < count; ++p) {
            long double blur = 0x1p-58L * r[p].size;
            /* What the kernel's bound may cost, from the formulas of frustum.c, generously. */
            long double loss = 0x1p-18L * r[p].size + 0x1p-110L;
            out |= r[p].most < blur;
            surely_out |= r[p].most < -loss;
            unsure |= fabsl(r[p].most) <= loss || fabsl(r[p].least) <= loss;
            if ((outside >> s & 1u) == 0) {
                bool dropped = (left[s] >> p & 1u) == 0;
                if (dropped && r[p].least < -blur) {
                    fail_msg("plane %u dropped, but a corner is %Lg beyond it", p, -r[p].least);
                }
                if (!dropped && r[p].least > loss) {
                    fail_msg("plane %u kept, the box is %Lg inside", p, r[p].least);
                }
            }
        }
        if ((outside >> s & 1u) != 0 && !out) {
            fail_msg("a box that touches the frustum was called outside");
        }
        if ((outside >> s & 1u) == 0 && surely_out) {
            fail_msg("a box that is clearly outside was kept");
        }
        t->outside += outside >> s & 1u;
        t->inside += (outside >> s & 1u) == 0 && left[s] == 0;
        t->unsure += unsure;
    }
}

static void test_random(void **state)
{
    (void)state;
    uint64_t seed = 1;
    const umb_box_kernels *k = umb_box_kernels_get(UMB_ISA_AUTO);
    tally t = {0, 0, 0};
    uint64_t boxes_tested = 0;
    for (int i = 0; i < 5000; ++i) {
        double scale = pow(10.0, random_in(&seed, -4, 6));
        umb_view v = random_view(&seed, scale);
        umb_frustum f;
        umb_frustum_prepare(&f, &v);
        for (int j = 0; j < 50; ++j) {
            umb_aabb boxes[8];
            uint32_t count = 1 + random_below(&seed, 8);
            for (uint32_t s = 0; s < 8; ++s) {
                boxes[s] = random_box(&seed, v.eye, scale * pow(10.0, random_in(&seed, -3, 0)));
            }
            umb_node node = node_of(boxes, count);
            check_node(&v, &f, boxes, &node, k, &t);
            boxes_tested += count;
        }
    }
    /* The test has teeth: all answers occur often. */
    assert_true(t.outside > boxes_tested / 10);
    assert_true(t.inside > boxes_tested / 100);
}

/* A point of a plane, as exactly as floats allow, becomes the corner nearest to the frustum; then
 * the box is moved by a few units in the last place. */
static void touch(uint64_t *seed, const umb_view *v, umb_aabb *b)
{
    double depth = v->near_depth + fabs(v->near_depth) * random_in(seed, 0.0, 3.0);
    double x = random_below(seed, 2) == 0 ? v->x_min : v->x_max;
    double y = v->y_min + (v->y_max - v->y_min) * random_in(seed, 0.0, 1.0);
    double k = v->projection == UMB_PERSPECTIVE ? depth : 1.0;
    uint32_t ulps = random_below(seed, 5);
    for (int i = 0; i < 3; ++i) {
        float p = (float)(v->eye[i] + k * (x * v->right[i] + y * v->up[i]) + depth * v->forward[i]);
        for (uint32_t u = 0; u < ulps; ++u) {
            p = nextafterf(p, random_next(seed) & 1 ? INFINITY : -INFINITY);
        }
        double side = (x == v->x_min ? -1.0 : 1.0) * v->right[i];
        double size = random_in(seed, 0.0, 2.0);
        b->min[i] = side > 0 ? p : (float)(p - size);
        b->max[i] = side > 0 ? (float)(p + size) : p;
    }
}

static void test_touching(void **state)
{
    (void)state;
    uint64_t seed = 2;
    tally t = {0, 0, 0};
    for (int i = 0; i < 4000; ++i) {
        umb_view v = random_view(&seed, 10.0);
        v.plane_count = 0;
        umb_frustum f;
        umb_frustum_prepare(&f, &v);
        for (int j = 0; j < 4; ++j) {
            umb_aabb boxes[8];
            for (uint32_t s = 0; s < 8; ++s) {
                touch(&seed, &v, &boxes[s]);
            }
            umb_node node = node_of(boxes, 8);
            check_node(&v, &f, boxes, &node, umb_box_kernels_get(UMB_ISA_AUTO), &t);
        }
    }
    assert_true(t.unsure > 10000);
}

/* Each plane by itself, where single terms of the bound matter most: boxes a few floats from an eye
 * that is far from the origin and between floats; and planes of any offset, touched. */
static void test_each_plane(void **state)
{
    (void)state;
    uint64_t seed = 7;
    const umb_box_kernels *k = umb_box_kernels_get(UMB_ISA_AUTO);
    uint64_t outside = 0, dropped = 0;
    for (int i = 0; i < 40000; ++i) {
        umb_view v = random_view(&seed, 10.0);
        v.plane_count = 0;
        umb_aabb boxes[8];
        double size = pow(10.0, random_in(&seed, -3, 7));
        if (i % 2 == 0) {
            for (int a = 0; a < 3; ++a) {
                v.eye[a] = random_in(&seed, -size, size);
            }
        }
        double step = size * 0x1p-24;
        double depth = i % 4 == 0 ? step : v.near_depth;
        v.far_depth = depth + v.far_depth - v.near_depth;
        v.near_depth = depth;
        for (uint32_t s = 0; s < 8; ++s) {
            if (i % 2 == 0) {
                for (int a = 0; a < 3; ++a) {
                    boxes[s].min[a] = (float)(v.eye[a] + step * random_in(&seed, -8, 8));
                    boxes[s].max[a] = boxes[s].min[a];
                }
            } else {
                touch(&seed, &v, &boxes[s]);
            }
        }
        umb_frustum f;
        umb_frustum_prepare(&f, &v);
        umb_node node = node_of(boxes, 8);
        for (uint32_t p = 0; p < f.plane_count; ++p) {
            uint16_t left[8];
            uint32_t out = umb_frustum_test_node(&f, k, &node, (uint16_t)(1u << p), NULL, left);
            for (uint32_t s = 0; s < 8; ++s) {
                reference r[UMB_FRUSTUM_PLANES];
                references(&v, &boxes[s], r);
                long double blur = 0x1p-58L * r[p].size;
                bool is_out = (out >> s & 1u) != 0;
                assert_true(!is_out || r[p].most < blur);
                assert_true(is_out || left[s] != 0 || r[p].least > -blur);
                outside += is_out;
                dropped += !is_out && left[s] == 0;
            }
        }
    }
    assert_true(outside > 100000 && dropped > 100000);
}

/* Exactly representable: an eye at whole numbers looking along an axis, slopes 1. Touching faces,
 * edges and corners are inside, one unit in the last place further is outside or unsure, never
 * wrong. */
static void test_exact_touch(void **state)
{
    (void)state;
    umb_view v;
    double eye[3] = {1, 2, 3}, target[3] = {1, 2, -7}, up[3] = {0, 1, 0};
    assert_int_equal(umb_view_look_at(&v, eye, target, up, 1.0, 1.0, 1.0, 16.0), UMB_OK);
    v.x_min = v.y_min = -1.0;
    v.x_max = v.y_max = 1.0;
    umb_frustum f;
    umb_frustum_prepare(&f, &v);
    umb_aabb boxes[8] = {
        {{-9, 2, -5}, {-7, 2, -5}},     /* touches left at depth 8 */
        {{9, 2, -5}, {20, 2, -5}},      /* right */
        {{1, 10, -5}, {1, 11, -5}},     /* top */
        {{1, -9, -5}, {1, -6, -5}},     /* bottom */
        {{1, 2, 2}, {1, 2, 2.5f}},      /* near */
        {{1, 2, -40}, {1, 2, -13}},     /* far */
        {{17, 18, -13}, {17, 18, -13}}, /* a corner of the frustum, a point */
        {{1, 2, 3}, {1, 2, 3}},         /* the eye: outside near */
    };
    umb_node node = node_of(boxes, 8);
    const umb_box_kernels *kernels[MAX_KERNELS];
    uint32_t count = all_kernels(kernels);
    for (uint32_t k = 0; k < count; ++k) {
        uint16_t left[8];
        assert_int_equal(umb_frustum_test_node(&f, kernels[k], &node, f.all_planes, NULL, left),
                         0x80);
        assert_int_equal(left[7], 0);
        assert_int_equal(left[0], 1); /* in touch with one plane, clear of the others */
        assert_int_equal(left[4], 1u << 4);
    }
}

/* Whatever the order and the mask, each plane's verdict is the same. */
static void test_masking_and_coherency(void **state)
{
    (void)state;
    uint64_t seed = 3;
    const umb_box_kernels *k = umb_box_kernels_get(UMB_ISA_AUTO);
    uint64_t tests = 0, tests_remembered = 0;
    for (int i = 0; i < 4000; ++i) {
        umb_view v = random_view(&seed, 10.0);
        umb_frustum f;
        umb_frustum_prepare(&f, &v);
        umb_aabb boxes[8];
        for (uint32_t s = 0; s < 8; ++s) {
            boxes[s] = random_box(&seed, v.eye, i % 2 == 0 ? 10.0 : 2.0);
        }
        umb_node node = node_of(boxes, 1 + random_below(&seed, 8));
        uint16_t mask = (uint16_t)(random_next(&seed) & f.all_planes);
        uint32_t outside = 0xFFu << node.count & 0xFFu;
        uint16_t kept[8] = {0};
        for (uint32_t p = 0; p < f.plane_count; ++p) {
            uint16_t left[8];
            if ((mask >> p & 1u) != 0) {
                outside |= umb_frustum_test_node(&f, k, &node, (uint16_t)(1u << p), NULL, left);
                for (uint32_t s = 0; s < 8; ++s) {
                    kept[s] = (uint16_t)(kept[s] | left[s]);
                }
            }
        }
        uint8_t remember = (uint8_t)random_below(&seed, 20);
        for (int frame = 0; frame < 2; ++frame) {
            uint16_t left[8], plain_left[8];
            uint32_t plain, remembered;
            assert_int_equal(k->cull(&f, &node, mask, NULL, plain_left, &plain), outside);
            assert_int_equal(k->cull(&f, &node, mask, &remember, left, &remembered), outside);
            for (uint32_t s = 0; s < node.count; ++s) {
                assert_int_equal(left[s], (outside >> s & 1u) != 0 ? 0 : kept[s]);
                assert_int_equal(left[s], plain_left[s]);
            }
            tests += frame == 1 ? plain : 0;
            tests_remembered += frame == 1 ? remembered : 0;
        }
    }
    assert_true(tests_remembered < tests);
}

/* A mask from the parent's box loses nothing of its children. */
static void test_masks_down_a_tree(void **state)
{
    (void)state;
    uint64_t seed = 4;
    const umb_box_kernels *k = umb_box_kernels_get(UMB_ISA_AUTO);
    for (int i = 0; i < 20000; ++i) {
        umb_view v = random_view(&seed, 10.0);
        umb_frustum f;
        umb_frustum_prepare(&f, &v);
        umb_aabb parent = random_box(&seed, v.eye, 10.0);
        umb_aabb children[8];
        for (uint32_t s = 0; s < 8; ++s) {
            for (int a = 0; a < 3; ++a) {
                children[s].min[a] = (float)random_in(&seed, parent.min[a], parent.max[a]);
                children[s].max[a] = (float)random_in(&seed, parent.min[a], parent.max[a]);
            }
            box_order(&children[s]);
        }
        umb_node above = node_of(&parent, 1);
        umb_node below = node_of(children, 8);
        uint16_t left[8], with[8], without[8];
        uint32_t gone = umb_frustum_test_node(&f, k, &above, f.all_planes, NULL, left);
        uint32_t full = umb_frustum_test_node(&f, k, &below, f.all_planes, NULL, without);
        if ((gone & 1u) == 0) {
            assert_int_equal(umb_frustum_test_node(&f, k, &below, left[0], NULL, with), full);
        }
    }
}

static umb_view absurd_view(uint64_t *seed)
{
    umb_view v = random_view(seed, pow(10.0, random_in(seed, -6, 25)));
    for (int i = 0; i < 3; ++i) {
        if (random_below(seed, 4) == 0) {
            v.eye[i] = random_power(seed, -30, 30);
        }
    }
    for (uint32_t k = 0; k < v.plane_count; ++k) {
        for (int i = 0; i < 4; ++i) {
            v.planes[k][i] = random_power(seed, -29, 30);
        }
    }
    return v;
}

static void test_absurd_sizes(void **state)
{
    (void)state;
    uint64_t seed = 5;
    for (int i = 0; i < 20000; ++i) {
        umb_view v = absurd_view(&seed);
        assert_int_equal(umb_view_check(&v, NULL), UMB_OK);
        umb_frustum f;
        umb_frustum_prepare(&f, &v);
        umb_aabb boxes[8];
        for (uint32_t s = 0; s < 8; ++s) {
            boxes[s] = absurd_box(&seed);
        }
        umb_node node = node_of(boxes, 8);
        uint16_t left[8];
        uint32_t outside = umb_frustum_test_node(&f, umb_box_kernels_get(UMB_ISA_AUTO), &node,
                                                 f.all_planes, NULL, left);
        for (uint32_t s = 0; s < 8; ++s) {
            reference r[UMB_FRUSTUM_PLANES];
            uint32_t count = references(&v, &boxes[s], r);
            bool out = false;
            for (uint32_t p = 0; p < count; ++p) {
                out |= r[p].most < 0x1p-58L * r[p].size;
                if ((outside >> s & 1u) == 0 && (left[s] >> p & 1u) == 0) {
                    assert_true(r[p].least > -0x1p-58L * r[p].size);
                }
            }
            assert_true(out || (outside >> s & 1u) == 0);
        }
    }
}

static void test_same_bits(void **state)
{
    (void)state;
    uint64_t seed = 6;
    const umb_box_kernels *kernels[MAX_KERNELS];
    uint32_t count = all_kernels(kernels);
    for (int i = 0; i < 60000; ++i) {
        umb_view v = i % 2 == 0 ? absurd_view(&seed) : random_view(&seed, 10.0);
        umb_frustum f;
        umb_frustum_prepare(&f, &v);
        umb_aabb boxes[8];
        for (uint32_t s = 0; s < 8; ++s) {
            boxes[s] = random_below(&seed, 2) == 0 ? absurd_box(&seed)
                                                   : random_box(&seed, v.eye, 10.0);
        }
        umb_node node = node_of(boxes, 1 + random_below(&seed, 8));
        uint16_t mask = (uint16_t)(random_next(&seed) & f.all_planes);
        uint8_t start = (uint8_t)random_below(&seed, 20);
        uint8_t first_remember = start;
        uint16_t first_left[8];
        uint32_t first_tests;
        uint32_t first = kernels[0]->cull(&f, &node, mask, &first_remember, first_left,
                                          &first_tests);
        for (uint32_t k = 1; k < count; ++k) {
            uint8_t remember = start;
            uint16_t left[8];
            uint32_t tests;
            assert_int_equal(kernels[k]->cull(&f, &node, mask, &remember, left, &tests), first);
            assert_int_equal(remember, first_remember);
            assert_int_equal(tests, first_tests);
            assert_memory_equal(left, first_left, sizeof(left));
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_random),
        cmocka_unit_test(test_touching),
        cmocka_unit_test(test_each_plane),
        cmocka_unit_test(test_exact_touch),
        cmocka_unit_test(test_masking_and_coherency),
        cmocka_unit_test(test_masks_down_a_tree),
        cmocka_unit_test(test_absurd_sizes),
        cmocka_unit_test(test_same_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

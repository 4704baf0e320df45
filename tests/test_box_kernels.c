/* Boxes onto the raster: every point of a box, in wider arithmetic, lies in the bounds given for
 * it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "frustum/box_kernels.h"
#include "support/random_boxes.h"

static const umb_isa isas[] = {UMB_ISA_SCALAR, UMB_ISA_SSE4, UMB_ISA_AVX2, UMB_ISA_NEON};

/* A raster over a view, as a culler would lay it; or, for every third, any invertible rows at
 * all. */
static umb_projector random_projector(uint64_t *seed, const umb_view *v)
{
    umb_projector p;
    memset(&p, 0, sizeof(p));
    double width = 1024.0;
    double height = 288.0;
    double x_scale = width / (v->x_max - v->x_min);
    double y_scale = height / (v->y_max - v->y_min);
    bool any = random_below(seed, 3) == 0;
    p.orthographic = v->projection == UMB_ORTHOGRAPHIC;
    p.cx = -v->x_min * x_scale;
    p.cy = v->y_max * y_scale;
    for (int i = 0; i < 3; ++i) {
        p.eye[i] = v->eye[i];
        p.x[i] = v->right[i] * x_scale;
        p.y[i] = -v->up[i] * y_scale;
        p.w[i] = v->forward[i];
        if (any) {
            p.x[i] = random_power(seed, -3, 3);
            p.y[i] = random_power(seed, -3, 3);
            p.w[i] = random_in(seed, -1, 1);
        }
    }
    return p;
}

typedef struct image {
    long double x, y, w;
} image;

static image image_of(const umb_projector *p, const double at[3])
{
    image m = {0, 0, 0};
    for (int i = 0; i < 3; ++i) {
        long double d = (long double)at[i] - p->eye[i];
        m.x += p->x[i] * d;
        m.y += p->y[i] * d;
        m.w += p->w[i] * d;
    }
    if (!p->orthographic) {
        m.x /= m.w;
        m.y /= m.w;
    }
    m.x += p->cx;
    m.y += p->cy;
    return m;
}

static void check_inside(const umb_projector *p, const umb_projected *r, uint32_t s,
                         const double at[3])
{
    image m = image_of(p, at);
    if (!(r->w_min[s] <= m.w && m.w <= r->w_max[s])) {
        fail_msg("W %.20Lg is not in %.17g .. %.17g", m.w, r->w_min[s], r->w_max[s]);
    }
    if (r->x_max[s] == UMB_PROJECTED_ALL) {
        return;
    }
    if (!(r->x_min[s] <= m.x && m.x <= r->x_max[s])) {
        fail_msg("x %.20Lg is not in %.17g .. %.17g", m.x, r->x_min[s], r->x_max[s]);
    }
    if (!(r->y_min[s] <= m.y && m.y <= r->y_max[s])) {
        fail_msg("y %.20Lg is not in %.17g .. %.17g", m.y, r->y_min[s], r->y_max[s]);
    }
}

/* The bounds hold all corners and points between, and are no wider than the corners need by
 * much. */
static bool check_box(uint64_t *seed, const umb_projector *p, const umb_aabb *b,
                      const umb_projected *r, uint32_t s, long double *excess)
{
    image low = {INFINITY, INFINITY, INFINITY};
    image high = {-INFINITY, -INFINITY, -INFINITY};
    for (int k = 0; k < 8; ++k) {
        double at[3];
        for (int i = 0; i < 3; ++i) {
            at[i] = k >> i & 1 ? b->max[i] : b->min[i];
        }
        check_inside(p, r, s, at);
        image m = image_of(p, at);
        low.x = fminl(low.x, m.x);
        low.y = fminl(low.y, m.y);
        low.w = fminl(low.w, m.w);
        high.x = fmaxl(high.x, m.x);
        high.y = fmaxl(high.y, m.y);
    }
    for (int k = 0; k < 4; ++k) {
        double at[3];
        for (int i = 0; i < 3; ++i) {
            at[i] = random_in(seed, b->min[i], b->max[i]);
            at[i] = fmin(fmax(at[i], b->min[i]), b->max[i]);
        }
        check_inside(p, r, s, at);
    }
    bool bounded = r->x_max[s] != UMB_PROJECTED_ALL;
    if (bounded) {
        assert_true(p->orthographic || low.w > 0);
        *excess = fmaxl(fmaxl(low.x - r->x_min[s], r->x_max[s] - high.x),
                        fmaxl(low.y - r->y_min[s], r->y_max[s] - high.y));
    }
    return bounded;
}

static void test_contains(void **state)
{
    (void)state;
    uint64_t seed = 11;
    const umb_box_kernels *k = umb_box_kernels_get(UMB_ISA_AUTO);
    uint64_t bounded = 0, all = 0, wide = 0;
    for (int i = 0; i < 2000; ++i) {
        double scale = pow(10.0, random_in(&seed, -4, 6));
        umb_view v = random_view(&seed, scale);
        umb_projector p = random_projector(&seed, &v);
        for (int j = 0; j < 10; ++j) {
            umb_aabb boxes[8];
            for (uint32_t s = 0; s < 8; ++s) {
                double ahead[3];
                double depth = scale * random_in(&seed, -0.5, 4.0);
                for (int a = 0; a < 3; ++a) {
                    ahead[a] = v.eye[a] + v.forward[a] * depth;
                }
                boxes[s] = random_box(&seed, ahead, scale * pow(10.0, random_in(&seed, -5, 0)));
            }
            umb_node node = node_of(boxes, 8);
            umb_projected r;
            k->project(&node, &p, &r);
            for (uint32_t s = 0; s < 8; ++s) {
                long double excess = 0;
                bounded += check_box(&seed, &p, &boxes[s], &r, s, &excess);
                wide += excess > 1e-6L * (1 + fabs(r.x_min[s]) + fabs(r.x_max[s]) +
                                          fabs(r.y_min[s]) + fabs(r.y_max[s]));
                ++all;
            }
        }
    }
    assert_true(bounded > all / 2);
    assert_true(wide < all / 1000);
}

/* Boxes on the eye's plane, touching it, just before and just behind it, and around the eye. */
static void test_near_the_eye(void **state)
{
    (void)state;
    uint64_t seed = 12;
    const umb_box_kernels *k = umb_box_kernels_get(UMB_ISA_AUTO);
    uint64_t bounded = 0;
    for (int i = 0; i < 20000; ++i) {
        umb_view v = random_view(&seed, 10.0);
        umb_projector p = random_projector(&seed, &v);
        umb_aabb boxes[8];
        for (uint32_t s = 0; s < 8; ++s) {
            double gap = random_power(&seed, -12, 1);
            double x = random_power(&seed, -8, 2), y = random_power(&seed, -8, 2);
            for (int a = 0; a < 3; ++a) {
                double at = p.eye[a] + gap * v.forward[a] + x * v.right[a] + y * v.up[a];
                double size = random_below(&seed, 2) * fabs(random_power(&seed, -9, 0));
                boxes[s].min[a] = (float)(at - size);
                boxes[s].max[a] = (float)(at + size);
            }
        }
        umb_node node = node_of(boxes, 8);
        umb_projected r;
        k->project(&node, &p, &r);
        for (uint32_t s = 0; s < 8; ++s) {
            long double excess;
            bounded += check_box(&seed, &p, &boxes[s], &r, s, &excess);
        }
    }
    assert_true(bounded > 10000);
}

static void test_absurd_sizes(void **state)
{
    (void)state;
    uint64_t seed = 13;
    const umb_box_kernels *k = umb_box_kernels_get(UMB_ISA_AUTO);
    for (int i = 0; i < 20000; ++i) {
        umb_view v = random_view(&seed, pow(10.0, random_in(&seed, -6, 25)));
        umb_projector p = random_projector(&seed, &v);
        umb_aabb boxes[8];
        for (uint32_t s = 0; s < 8; ++s) {
            boxes[s] = absurd_box(&seed);
        }
        umb_node node = node_of(boxes, 8);
        umb_projected r;
        k->project(&node, &p, &r);
        for (uint32_t s = 0; s < 8; ++s) {
            long double excess;
            check_box(&seed, &p, &boxes[s], &r, s, &excess);
            assert_true(isfinite(r.x_min[s]) && isfinite(r.x_max[s]) && isfinite(r.w_min[s]));
            assert_true(isfinite(r.y_min[s]) && isfinite(r.y_max[s]) && isfinite(r.w_max[s]));
        }
    }
}

static void test_same_bits(void **state)
{
    (void)state;
    uint64_t seed = 14;
    for (int i = 0; i < 60000; ++i) {
        umb_view v = random_view(&seed, pow(10.0, random_in(&seed, -6, 12)));
        umb_projector p = random_projector(&seed, &v);
        umb_aabb boxes[8];
        for (uint32_t s = 0; s < 8; ++s) {
            boxes[s] = random_below(&seed, 3) == 0 ? absurd_box(&seed)
                                                   : random_box(&seed, v.eye, fabs(v.eye[0]));
        }
        umb_node node = node_of(boxes, 1 + random_below(&seed, 8));
        umb_projected first;
        umb_box_kernels_get(UMB_ISA_SCALAR)->project(&node, &p, &first);
        for (int k = 1; k < 4; ++k) {
            const umb_box_kernels *kernels = umb_box_kernels_get(isas[k]);
            if (kernels != NULL) {
                umb_projected r;
                kernels->project(&node, &p, &r);
                assert_memory_equal(&r, &first, sizeof(r));
            }
        }
    }
}

static void test_choice(void **state)
{
    (void)state;
    assert_non_null(umb_box_kernels_get(UMB_ISA_AUTO));
    for (int k = 0; k < 4; ++k) {
        const umb_box_kernels *kernels = umb_box_kernels_get(isas[k]);
        assert_int_equal(kernels != NULL, umb_isa_available(isas[k]));
        if (kernels != NULL) {
            assert_int_equal(kernels->isa, isas[k]);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_contains),     cmocka_unit_test(test_near_the_eye),
        cmocka_unit_test(test_absurd_sizes), cmocka_unit_test(test_same_bits),
        cmocka_unit_test(test_choice),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

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

/* The map of a raster, in the doubles that define it. */
typedef struct map {
    double eye[3], x[3], y[3], w[3];
    double cx, cy;
    umb_projector_def def;
    umb_projector projector;
} map;

/* A raster over a view, as a culler would lay it; for every third an upright one; or any invertible rows at
 * all. */
static void random_map(uint64_t *seed, const umb_view *v, map *p)
{
    memset(p, 0, sizeof(*p));
    uint32_t width = 1024;
    uint32_t height = 288;
    double x_scale = width / (v->x_max - v->x_min);
    double y_scale = height / (v->y_max - v->y_min);
    uint64_t form = random_below(seed, 3);
    int vertical = form == 1 ? (int)random_below(seed, 3) : -1;
    p->cx = -v->x_min * x_scale;
    p->cy = v->y_max * y_scale;
    for (int i = 0; i < 3; ++i) {
        p->eye[i] = v->eye[i];
        p->x[i] = v->right[i] * x_scale;
        p->y[i] = -v->up[i] * y_scale;
        p->w[i] = v->forward[i];
        if (form == 0) {
            p->x[i] = random_power(seed, -3, 3);
            p->y[i] = random_power(seed, -3, 3);
            p->w[i] = random_in(seed, -1, 1);
        }
        if (vertical >= 0) {
            p->x[i] = i == vertical ? 0.0 : p->x[i];
            p->w[i] = i == vertical ? 0.0 : p->w[i];
            p->y[i] = i == vertical ? (p->y[i] != 0.0 ? p->y[i] : y_scale) : 0.0;
        }
    }
    bool parallel = v->projection == UMB_ORTHOGRAPHIC && form != 1;
    p->def = (umb_projector_def){.eye = p->eye,
                                 .x = p->x,
                                 .y = p->y,
                                 .w = p->w,
                                 .cx = p->cx,
                                 .cy = p->cy,
                                 .slope = 1.0f,
                                 .slack = 0x1p-21f * 288.0f,
                                 .width = width,
                                 .height = height,
                                 .vertical = vertical,
                                 .orthographic = parallel};
    if (random_below(seed, 2) == 0) {
        p->def.from = (float)random_in(seed, 0, 200);
        p->def.span = (float)random_in(seed, 4, 60);
        p->def.slope = 0.5f;
        p->def.extra = (float)(0.5 * height / p->def.span);
    }
    umb_projector_prepare(&p->projector, &p->def);
}

typedef struct image {
    long double x, y, w;
} image;

static image image_of(const map *p, const double at[3])
{
    image m = {0, 0, 0};
    for (int i = 0; i < 3; ++i) {
        long double d = (long double)at[i] - p->eye[i];
        m.x += p->x[i] * d;
        m.y += p->y[i] * d;
        m.w += p->w[i] * d;
    }
    if (!p->def.orthographic) {
        m.x /= m.w;
        m.y /= m.w;
    }
    m.x += p->cx;
    m.y += p->cy;
    return m;
}

static long double row_of(const map *p, long double y)
{
    long double into = y - p->def.from;
    into = into < 0 ? 0 : into > p->def.span ? p->def.span : into;
    return p->def.slope * y + p->def.extra * into;
}

static void check_inside(const map *p, const umb_projected *r, uint32_t s, const double at[3])
{
    image m = image_of(p, at);
    if (!(r->w_min[s] <= m.w && m.w <= r->w_max[s])) {
        fail_msg("W %.20Lg is not in %.17g .. %.17g", m.w, r->w_min[s], r->w_max[s]);
    }
    if ((r->testable >> s & 1) == 0) {
        return;
    }
    long double nearness = p->def.orthographic ? -m.w : 1 / m.w;
    if (!(r->nearness[s] >= nearness)) {
        fail_msg("nearness %.20Lg is above %.17g", nearness, r->nearness[s]);
    }
    if (m.x < 0 || m.x > p->def.width || m.y < 0 || m.y > p->def.height) {
        return;
    }
    if ((r->beside >> s & 1) != 0 || !(r->x0[s] <= m.x && m.x <= r->x1[s] + 1)) {
        fail_msg("x %.20Lg is not in %d .. %d + 1", m.x, r->x0[s], r->x1[s]);
    }
    long double row = row_of(p, m.y);
    if (!(r->y0[s] <= row && row <= r->y1[s] + 1)) {
        fail_msg("row %.20Lg is not in %d .. %d + 1", row, r->y0[s], r->y1[s]);
    }
}

/* The image holds all corners and points between, and is no wider than the corners need by more than two
 * pixels: one for rounding, and one for pixels that a corner touches. True if it was testable. */
static bool check_box(uint64_t *seed, const map *p, const umb_aabb *b, const umb_projected *r, uint32_t s,
                      bool *wide)
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
    bool testable = (r->testable >> s & 1) != 0;
    *wide = false;
    if (testable && (r->beside >> s & 1) == 0) {
        assert_true(p->def.orthographic || low.w > 0);
        /* Floats resolve what the reach of the box is over its depth; rows are denser than heights. */
        long double reach = 0;
        for (int i = 0; i < 3; ++i) {
            reach += fmax(fabs(b->min[i] - p->eye[i]), fabs(b->max[i] - p->eye[i]));
        }
        long double size = (long double)p->projector.size_x + p->projector.size_y +
                           p->projector.size_w * (fabsl(low.x) + fabsl(high.x) + fabsl(low.y) + fabsl(high.y));
        long double off = p->def.orthographic ? 1e-5L * reach * size : 1e-5L * reach / low.w * size;
        off = 2 + (1 + p->def.extra) * off;
        *wide = (r->x0[s] > 0 && r->x0[s] < low.x - off) || r->x1[s] > fmaxl(high.x, 0) + off ||
                (r->y0[s] > 0 && r->y0[s] < row_of(p, low.y) - off) ||
                r->y1[s] > row_of(p, fmaxl(high.y, 0)) + off;
    }
    return testable;
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
        map p;
        random_map(&seed, &v, &p);
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
            k->project(&node, &p.projector, &r);
            for (uint32_t s = 0; s < 8; ++s) {
                bool far_out;
                bounded += check_box(&seed, &p, &boxes[s], &r, s, &far_out);
                wide += far_out;
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
        map p;
        random_map(&seed, &v, &p);
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
        k->project(&node, &p.projector, &r);
        for (uint32_t s = 0; s < 8; ++s) {
            bool wide;
            bounded += check_box(&seed, &p, &boxes[s], &r, s, &wide);
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
        map p;
        random_map(&seed, &v, &p);
        umb_aabb boxes[8];
        for (uint32_t s = 0; s < 8; ++s) {
            boxes[s] = absurd_box(&seed);
        }
        umb_node node = node_of(boxes, 8);
        umb_projected r;
        k->project(&node, &p.projector, &r);
        for (uint32_t s = 0; s < 8; ++s) {
            bool wide;
            check_box(&seed, &p, &boxes[s], &r, s, &wide);
            assert_true(isfinite(r.nearness[s]));
            assert_in_range(r.x0[s], 0, r.x1[s]);
            assert_in_range(r.x1[s], r.x0[s], 1023);
            assert_in_range(r.y0[s], 0, r.y1[s]);
            assert_in_range(r.y1[s], r.y0[s], 287);
        }
    }
}

static void test_same_bits(void **state)
{
    (void)state;
    uint64_t seed = 14;
    for (int i = 0; i < 60000; ++i) {
        umb_view v = random_view(&seed, pow(10.0, random_in(&seed, -6, 12)));
        map p;
        random_map(&seed, &v, &p);
        umb_aabb boxes[8];
        for (uint32_t s = 0; s < 8; ++s) {
            boxes[s] = random_below(&seed, 3) == 0 ? absurd_box(&seed)
                                                   : random_box(&seed, v.eye, fabs(v.eye[0]));
        }
        umb_node node = node_of(boxes, 1 + random_below(&seed, 8));
        umb_projected first;
        umb_box_kernels_get(UMB_ISA_SCALAR)->project(&node, &p.projector, &first);
        for (int k = 1; k < 4; ++k) {
            const umb_box_kernels *kernels = umb_box_kernels_get(isas[k]);
            if (kernels != NULL) {
                umb_projected r;
                kernels->project(&node, &p.projector, &r);
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

/* Slopes to tilted bodies, pixel by pixel (src/bake/ray_tilt.c), against points of the bodies. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "bake/ray_tilt.h"
#include "support/failing.h"
#include "support/ray_bodies.h"

enum { CORNERS = 8 };

static bool is_small(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && strcmp(size, "small") == 0;
}

/* Eight corners anywhere: any convex body will do. One in four is as thin as a needle or a leaf. */
static void draw_body(dice *d, const umb_ray_frame *f, umb_ray_point *p)
{
    double far = dice_between(d, 0, 1), size[3], middle[3] = {f->hu + 1.0 + 400.0 * far * far * far, 0, dice_between(d, -30, 30)};
    for (int k = 0; k < 3; ++k) {
        size[k] = dice_between(d, 0.1, 12) * (dice_roll(d, 4) == 0 ? 1e-4 : 1.0);
    }
    middle[0] += size[0];
    middle[1] = dice_between(d, -0.9, 0.9) * middle[0];
    for (int i = 0; i < CORNERS; ++i) {
        p[i] = (umb_ray_point){middle[0] + size[0] * dice_between(d, -1, 1), middle[1] + size[1] * dice_between(d, -1, 1),
                               middle[2] + size[2] * dice_between(d, -1, 1)};
    }
}

/* A corner, a point of an edge, or any point of the body. */
static umb_ray_point draw_point(dice *d, const umb_ray_point *p)
{
    umb_ray_point x = p[dice_roll(d, CORNERS)];
    for (uint32_t n = dice_roll(d, 4); n > 0; --n) {
        const umb_ray_point *to = &p[dice_roll(d, CORNERS)];
        double part = dice_between(d, 0, 1);
        x = (umb_ray_point){x.u + part * (to->u - x.u), x.v + part * (to->v - x.v), x.z + part * (to->z - x.z)};
    }
    return x;
}

/* The tile that lines of offset s through the body's first corner go through; false if it lies outside. */
static bool tile_at(const umb_ray_map *m, const umb_ray_point *p, double s, uint32_t *i, uint32_t *j)
{
    double t = (p->v - (m->alpha0 + m->alpha1 * p->u) * s) / (m->beta0 + m->beta1 * p->u);
    double row = floor((s - m->s0) / (UMB_TILE * m->ds)), column = floor((t - m->t0) / (UMB_TILE * m->dt));
    if (!(row >= 0 && column >= 0 && row < m->rows && column < m->columns)) {
        return false;
    }
    *i = (uint32_t)row;
    *j = (uint32_t)column;
    return true;
}

typedef struct tally {
    uint32_t points, sharper, bodies;
    double room, first; /* sums of what bounds of m are above the steepest point met, of each pixel and of the body */
} tally;

/* What an upright body as high as this one would have. */
static double upright_top(const umb_ray_tilt *a)
{
    double up = a->shape->z1 - a->map->frame->z1;
    return up / (up >= 0 ? a->shape->u_min - a->ua : a->shape->u_max - a->ub);
}

static double upright_bottom(const umb_ray_tilt *a)
{
    double rise = a->shape->z0 - a->map->frame->z0;
    return rise / (rise >= 0 ? a->shape->u_max - a->ub : a->shape->u_min - a->ua);
}

/* No point of the body on a line of a pixel is steeper than its bounds say. */
static void check_points(const umb_ray_tilt *a, const umb_umbra_query *q, dice *d, tally *sum)
{
    const umb_ray_map *m = a->map;
    const umb_ray_frame *f = m->frame;
    float steepest[64];
    for (int i = 0; i < 64; ++i) {
        steepest[i] = -INFINITY;
    }
    for (int n = 0; n < 400; ++n) {
        umb_ray_point p = draw_point(d, a->shape->points);
        double s = a->s + UMB_TILE * m->ds * dice_between(d, 0, 1);
        double t = (p.v - (m->alpha0 + m->alpha1 * p.u) * s) / (m->beta0 + m->beta1 * p.u);
        double column = floor((t - a->t) / m->dt);
        uint32_t r = (uint32_t)fmin(UMB_TILE - 1, (s - a->s) / m->ds);
        if (!(column >= 0 && column < UMB_TILE)) {
            continue;
        }
        uint32_t pixel = r * UMB_TILE + (uint32_t)column;
        double least = fmin((p.z - f->z1) / (p.u - a->ua), (p.z - f->z1) / (p.u - a->ub));
        double most = fmax((p.z - f->z0) / (p.u - a->ua), (p.z - f->z0) / (p.u - a->ub));
        assert_true(least <= q->tops[pixel] && most >= q->bottoms[pixel]);
        assert_true(q->tops[pixel] <= q->top && q->bottoms[pixel] >= q->bottom);
        steepest[pixel] = fmaxf(steepest[pixel], (float)least);
        sum->points += 1;
    }
    double most = upright_top(a);
    for (int i = 0; i < 64; ++i) {
        if (steepest[i] > -INFINITY) {
            sum->room += q->tops[i] - steepest[i];
            sum->first += most - steepest[i];
            sum->sharper += q->tops[i] < most ? 1 : 0;
        }
    }
}

static void check_body(const umb_ray_map *m, dice *d, tally *sum)
{
    umb_ray_point p[CORNERS];
    umb_ray_shape shape;
    umb_umbra_query q = {0}, scalar;
    uint32_t i, j;
    draw_body(d, m->frame, p);
    if (!umb_ray_shape_measure(m->frame, p, CORNERS, &shape) || !umb_ray_shape_outline(m->frame, p, CORNERS, false, &shape) ||
        !tile_at(m, p, m->s0 + dice_between(d, 0, 1) * m->rows * UMB_TILE * m->ds, &i, &j)) {
        return;
    }
    for (int r = 0; r < UMB_TILE; ++r) {
        q.to[r] = UMB_TILE - 1;
    }
    umb_ray_tilt a = {m, &shape, m->s0 + i * UMB_TILE * m->ds, m->t0 + j * UMB_TILE * m->dt, shape.u_min, shape.u_max,
                      -m->frame->hu, m->frame->hu};
    q.top = nextafterf((float)upright_top(&a), INFINITY);
    q.bottom = nextafterf((float)upright_bottom(&a), -INFINITY);
    scalar = q;
    assert_true(umb_ray_tilt_bound(&a, umb_umbra_kernels_get(UMB_ISA_AUTO), &q));
    assert_true(umb_ray_tilt_bound(&a, umb_umbra_kernels_get(UMB_ISA_SCALAR), &scalar));
    assert_memory_equal(&q, &scalar, sizeof q);
    check_points(&a, &q, d, sum);
    sum->bodies += 1;
}

static void check_map(umb_ray_kind kind, double outer, uint64_t seed, tally *sum)
{
    umb_allocator a = umb_memory_allocator(NULL);
    umb_ray_frame frame = {2, 1.5, -1, 1, {0, 0, 0}, 0, 1, 2, 1, 1e-12, INFINITY};
    umb_ray_map map = {0};
    dice d = {seed};
    assert_int_equal(umb_ray_map_begin(&map, &a, &frame, &(umb_ray_layout){kind, outer, 64, 256, 1}), UMB_OK);
    for (int i = 0; i < (is_small() ? 400 : 8000); ++i) {
        check_body(&map, &d, sum);
    }
    umb_ray_map_free(&map, &a);
}

static void test_points(void **state)
{
    (void)state;
    tally sum = {0};
    check_map(UMB_RAY_SLAB, 0.0, 51, &sum);
    check_map(UMB_RAY_NEAR, 8.0, 52, &sum);
    assert_true(sum.bodies > 300 && sum.points > 50 * sum.bodies);
    assert_true(sum.sharper > 0 && sum.room < 0.5 * sum.first); /* it is worth its while */
}

/* Nothing is said of what stands upright, or may be beside the cell. */
static void test_no_gain(void **state)
{
    (void)state;
    umb_allocator a = umb_memory_allocator(NULL);
    umb_ray_frame frame = {2, 1.5, -1, 1, {0, 0, 0}, 0, 1, 2, 1, 1e-12, INFINITY};
    umb_ray_map map = {0};
    assert_int_equal(umb_ray_map_begin(&map, &a, &frame, &(umb_ray_layout){UMB_RAY_SLAB, 0.0, 64, 64, 1}), UMB_OK);
    for (int tilted = 0; tilted < 2; ++tilted) {
        for (int near = 0; near < 2; ++near) {
            umb_ray_point p[4];
            for (int i = 0; i < 4; ++i) {
                p[i] = (umb_ray_point){(near ? 1.5 : 20) + (i & 1), 3.0 * (i & 1), 5.0 * (i >> 1) + tilted * 0.5 * (i & 1)};
            }
            umb_ray_shape shape;
            assert_true(umb_ray_shape_measure(&frame, p, 4, &shape) && umb_ray_shape_outline(&frame, p, 4, false, &shape));
            umb_umbra_query q = {.top = 9.0f, .bottom = -9.0f, .tilted = false};
            umb_ray_tilt tilt = {&map, &shape, 0, 0, shape.u_min, shape.u_max, -2, 2};
            assert_int_equal(umb_ray_tilt_bound(&tilt, umb_umbra_kernels_get(UMB_ISA_AUTO), &q), tilted && !near);
            assert_int_equal(q.tilted, tilted && !near);
        }
    }
    umb_ray_map_free(&map, &a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_points), cmocka_unit_test(test_no_gain)};
    return cmocka_run_group_tests_name("ray tilt", tests, NULL, NULL);
}

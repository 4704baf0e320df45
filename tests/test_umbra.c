/* What from-region visibility stands on (docs/conservative.md, "From a region"): T1 and T3 in random slices, T5 with random
 * bodies, rays and the maps that have to hold them, kernels equal to the bit. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "bake/ray_far.h"
#include "bake/ray_map.h"
#include "bake/beam.h"
#include "bake/region_state.h"
#include "support/failing.h"

static bool is_small(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && strcmp(size, "small") == 0;
}

static double between(dice *d, double low, double high)
{
    return low + (high - low) * (dice_roll(d, 1u << 30) / (double)(1u << 30));
}

/* ---- slices ----------------------------------------------------------------------------------- */

typedef struct point {
    double u, z;
} point;

typedef struct slice {
    double ua, ub, z0, z1; /* the cell */
} slice;

static double least_slope(const slice *k, point p)
{
    return fmin((p.z - k->z1) / (p.u - k->ua), (p.z - k->z1) / (p.u - k->ub));
}

static double greatest_slope(const slice *k, point p)
{
    return fmax((p.z - k->z0) / (p.u - k->ua), (p.z - k->z0) / (p.u - k->ub));
}

static slice draw_slice(dice *d)
{
    slice k = {between(d, -3, 0), 0, between(d, -2, 0), 0};
    k.ub = k.ua + between(d, 0.01, 4);
    k.z1 = k.z0 + (dice_roll(d, 5) == 0 ? 0.0 : between(d, 0, 3));
    return k;
}

static point draw_point(dice *d, const slice *k, double far)
{
    return (point){k->ub + between(d, 0.05, far), between(d, -6, 8)};
}

/* The segment from a point of the cell to q crosses the segment pb pt. */
static bool crosses(point from, point q, point pb, point pt)
{
    double a = (q.u - from.u) * (pb.z - from.z) - (q.z - from.z) * (pb.u - from.u);
    double b = (q.u - from.u) * (pt.z - from.z) - (q.z - from.z) * (pt.u - from.u);
    return a <= 1e-9 && b >= -1e-9; /* both ends lie before q */
}

static point draw_from(dice *d, const slice *k)
{
    bool corner = dice_roll(d, 2) == 0;
    return (point){corner ? (dice_roll(d, 2) ? k->ua : k->ub) : between(d, k->ua, k->ub),
                   corner ? (dice_roll(d, 2) ? k->z0 : k->z1) : between(d, k->z0, k->z1)};
}

/* T1: both ways. */
static void test_slices(void **state)
{
    (void)state;
    dice d = {11};
    uint32_t hidden = 0, slices = is_small() ? 20000 : 400000;
    for (uint32_t i = 0; i < slices; ++i) {
        slice k = draw_slice(&d);
        point pt = draw_point(&d, &k, 8), pb = draw_point(&d, &k, 8), q = draw_point(&d, &k, 14);
        q.u = fmax(q.u, fmax(pt.u, pb.u) + 1e-3);
        double m_gap = least_slope(&k, pt) - least_slope(&k, q), M_gap = greatest_slope(&k, q) - greatest_slope(&k, pb);
        bool free = false;
        for (int c = 0; c < 4; ++c) {
            point from = {(c & 1) != 0 ? k.ua : k.ub, (c & 2) != 0 ? k.z0 : k.z1};
            free = free || !crosses(from, q, pb, pt);
        }
        for (int n = 0; n < 20 && m_gap >= 0.0 && M_gap >= 0.0; ++n) {
            assert_true(crosses(draw_from(&d, &k), q, pb, pt));
        }
        hidden += m_gap >= 0.0 && M_gap >= 0.0 ? 1 : 0;
        assert_true(free || (m_gap > -1e-6 && M_gap > -1e-6)); /* nothing is missed */
    }
    assert_true(hidden > slices / 50);
}

/* T3: what is joined of an upper and a lower segment blocks what the joined interval says. */
static void test_joins(void **state)
{
    (void)state;
    dice d = {12};
    uint32_t joined = 0, slices = is_small() ? 20000 : 400000;
    for (uint32_t i = 0; i < slices; ++i) {
        slice k = draw_slice(&d);
        point ct = draw_point(&d, &k, 8), cb = draw_point(&d, &k, 8), ot = draw_point(&d, &k, 8), ob = draw_point(&d, &k, 8);
        bool meet = least_slope(&k, ot) >= least_slope(&k, cb) && greatest_slope(&k, ot) >= greatest_slope(&k, cb);
        point q = draw_point(&d, &k, 14);
        q.u = fmax(fmax(q.u, fmax(ct.u, cb.u) + 1e-3), fmax(ot.u, ob.u) + 1e-3);
        if (!meet || least_slope(&k, q) > least_slope(&k, ct) || greatest_slope(&k, q) < greatest_slope(&k, ob)) {
            continue;
        }
        joined += 1;
        for (int n = 0; n < 40; ++n) {
            point from = draw_from(&d, &k);
            assert_true(crosses(from, q, cb, ct) || crosses(from, q, ob, ot));
        }
    }
    assert_true(joined > 100);
}

/* ---- bodies ----------------------------------------------------------------------------------- */

/* T5: when all 64 segments between corners meet a body, so do segments between points inside. */
static void test_corners(void **state)
{
    (void)state;
    umb_allocator a = umb_memory_allocator(NULL);
    dice d = {13};
    uint32_t all = 0, rounds = is_small() ? 3000 : 60000;
    umb_solid_plane planes[6];
    umb_solid body = {.plane_count = 6};
    umb_solids solids = {.allocator = &a, .items = &body, .planes = planes, .count = 1};
    for (uint32_t i = 0; i < rounds; ++i) {
        double low[3], high[3], min[2][3], max[2][3], corners[2][8][3];
        for (int k = 0; k < 3; ++k) {
            low[k] = k == 0 ? between(&d, 3, 5) : between(&d, -4, 0);
            high[k] = k == 0 ? low[k] + between(&d, 0.1, 3) : between(&d, 0, 4);
            for (int s = 0; s < 2; ++s) {
                min[s][k] = k == 0 ? (s == 0 ? between(&d, -2, 2) : between(&d, 9, 20)) : between(&d, -2, 2);
                max[s][k] = min[s][k] + between(&d, 0, 1.5);
            }
            for (int s = 0; s < 2; ++s) {
                memset(&planes[2 * k + s], 0, sizeof planes[0]);
                planes[2 * k + s].plane[k] = s == 0 ? 1.0 : -1.0;
                planes[2 * k + s].plane[3] = s == 0 ? -high[k] : low[k];
            }
        }
        umb_box_corners(min[0], max[0], corners[0]);
        umb_box_corners(min[1], max[1], corners[1]);
        uint64_t blocked = umb_solid_blocks(&solids, &body, (const double(*)[3])corners[0], (const double(*)[3])corners[1]);
        for (int c = 0; c < 64; ++c) {
            assert_int_equal(blocked >> c & 1, umb_solid_meets(&solids, &body, corners[0][c / 8], corners[1][c % 8]));
        }
        if (blocked != UINT64_MAX) {
            continue;
        }
        all += 1;
        for (int n = 0; n < 20; ++n) {
            double p[2][8][3];
            for (int s = 0; s < 2; ++s) {
                for (int k = 0; k < 3; ++k) {
                    double x = between(&d, min[s][k], max[s][k]);
                    for (int c = 0; c < 8; ++c) {
                        p[s][c][k] = x;
                    }
                }
            }
            assert_true(umb_solid_blocks(&solids, &body, (const double(*)[3])p[0], (const double(*)[3])p[1]) == UINT64_MAX);
        }
    }
    assert_true(all > rounds / 100);
}

static void draw_box(dice *d, double reach, double size, float min[3], float max[3])
{
    for (int k = 0; k < 3; ++k) {
        min[k] = (float)between(d, -reach, reach);
        max[k] = min[k] + (float)between(d, 0, size);
    }
}

static umb_shaft draw_shaft(dice *d, double min[2][3], double max[2][3])
{
    umb_shaft shaft;
    for (int e = 0; e < 2; ++e) {
        float low[3], high[3];
        draw_box(d, 20, dice_roll(d, 4) == 0 ? 0.0 : 5.0, low, high);
        for (int k = 0; k < 3; ++k) {
            min[e][k] = low[k];
            max[e][k] = high[k];
        }
    }
    umb_shaft_make(&shaft, (const double(*)[3])min, (const double(*)[3])max);
    return shaft;
}

/* What a segment between two boxes meets is not beside their shaft, and the tree finds it. */
static void test_shafts(void **state)
{
    (void)state;
    enum { BODIES = 300 };
    umb_allocator a = umb_memory_allocator(NULL);
    dice d = {14};
    static umb_solid bodies[BODIES];
    umb_solids solids = {.allocator = &a, .items = bodies, .count = BODIES};
    umb_solid_tree tree = {0};
    uint32_t met = 0, found[BODIES], some[40];
    for (uint32_t i = 0; i < BODIES; ++i) {
        draw_box(&d, 20, 12, bodies[i].bounds.min, bodies[i].bounds.max);
    }
    assert_true(umb_solid_tree_build(&tree, &a, &solids));
    for (uint32_t n = 0; n < (is_small() ? 200u : 2000u); ++n) {
        double min[2][3], max[2][3], at[3], t = between(&d, 0, 1);
        umb_shaft shaft = draw_shaft(&d, min, max);
        uint32_t count = umb_solid_tree_find(&tree, &solids, &shaft, BODIES, found), next = 0;
        for (int k = 0; k < 3; ++k) {
            at[k] = (1 - t) * between(&d, min[0][k], max[0][k]) + t * between(&d, min[1][k], max[1][k]);
        }
        for (uint32_t i = 0; i < BODIES; ++i) {
            const umb_aabb *b = &bodies[i].bounds;
            bool beside = umb_shaft_beside(&shaft, b), inside = true;
            for (int k = 0; k < 3; ++k) {
                inside = inside && at[k] > b->min[k] + 1e-4 && at[k] < b->max[k] - 1e-4;
            }
            met += inside;
            assert_false(inside && beside);
            assert_int_equal(next < count && found[next] == i, !beside);
            next += beside ? 0 : 1;
        }
        uint32_t few = umb_solid_tree_find(&tree, &solids, &shaft, 40, some);
        assert_int_equal(few, count < 40 ? count : 40);
        assert_memory_equal(some, found, few * sizeof *some);
    }
    assert_true(met > 10);
    umb_solid_tree_free(&tree, &a);
}

/* The box, made smaller by this much, has a point of the segment: exact but for rounding. */
static bool goes_through(const umb_aabb *b, const double ends[2][3], double less)
{
    double from = 0.0, to = 1.0;
    for (int k = 0; k < 3; ++k) {
        double way = ends[1][k] - ends[0][k], low = b->min[k] + less - ends[0][k], high = b->max[k] - less - ends[0][k];
        if (way == 0.0) {
            from = low > 0.0 || high < 0.0 ? 2.0 : from;
            continue;
        }
        from = fmax(from, fmin(low / way, high / way));
        to = fmin(to, fmax(low / way, high / way));
    }
    return from <= to;
}

static bool is_listed(const uint32_t *list, uint32_t from, uint32_t to, uint32_t body)
{
    uint32_t times = 0;
    for (uint32_t i = from; i < to; ++i) {
        times += list[i] == body ? 1 : 0;
    }
    assert_true(times <= 1);
    return times == 1;
}

/* Corner to corner, along an axis, a point, or any. */
static void draw_segment(dice *d, const umb_solid *bodies, uint32_t count, double out[2][3])
{
    uint32_t kind = dice_roll(d, 4), axis = dice_roll(d, 3);
    for (int e = 0; e < 2; ++e) {
        const umb_aabb *b = &bodies[dice_roll(d, count)].bounds;
        for (int k = 0; k < 3; ++k) {
            out[e][k] = kind == 0 ? (dice_roll(d, 2) == 0 ? b->min[k] : b->max[k]) : between(d, -40, 40);
            out[e][k] = e == 1 && (kind == 2 || (kind == 1 && (uint32_t)k != axis)) ? out[0][k] : out[e][k];
        }
    }
}

/* Of lists with room for all and with room for few: whatever the first segment meets is there, whether the second one meets it is
 * known, and what is far from both is not. */
static uint32_t check_along(dice *d, const umb_solid_tree *tree, const umb_solid *bodies, uint32_t count)
{
    double s[2][2][3];
    uint32_t *list = malloc((count + 8) * sizeof *list), met = 0;
    assert_non_null(list);
    draw_segment(d, bodies, count, s[0]);
    draw_segment(d, bodies, count, s[1]);
    umb_solids_along n = umb_solid_tree_along(tree, (const double(*)[3])s[0], (const double(*)[3])s[1], count + 8, list);
    assert_true(n.both_end <= n.first_begin && n.first_begin <= count + 8);
    for (uint32_t i = 0; i < count; ++i) {
        const umb_aabb *b = &bodies[i].bounds;
        bool both = is_listed(list, 0, n.both_end, i), first = is_listed(list, n.first_begin, count + 8, i);
        bool meets[2] = {goes_through(b, (const double(*)[3])s[0], 1e-4), goes_through(b, (const double(*)[3])s[1], 1e-4)};
        assert_false(both && first);
        met += meets[0] ? 1 : 0;
        assert_true(both || first || !meets[0]);
        assert_true(both || !(meets[0] && meets[1]));
        assert_true(!(both || first) || goes_through(b, (const double(*)[3])s[0], -1e-3));
        assert_true(!both || goes_through(b, (const double(*)[3])s[1], -1e-3));
    }
    uint32_t all = n.both_end + (count + 8 - n.first_begin), most = 1 + dice_roll(d, 12), few[12];
    umb_solids_along m = umb_solid_tree_along(tree, (const double(*)[3])s[0], (const double(*)[3])s[1], most, few);
    assert_int_equal(m.both_end == m.first_begin, all >= most);
    assert_int_equal(m.both_end + (most - m.first_begin), all < most ? all : most);
    for (uint32_t i = 0; i < m.both_end; ++i) {
        assert_true(is_listed(list, 0, n.both_end, few[i]));
    }
    for (uint32_t i = m.first_begin; i < most; ++i) {
        assert_true(is_listed(list, n.first_begin, count + 8, few[i]));
    }
    free(list);
    return met;
}

/* Bodies of all sizes, some in one place, far from the middle too, where boxes of the tree are rounded. */
static void test_along(void **state)
{
    (void)state;
    static const uint32_t counts[] = {1, 2, 3, 4, 5, 17, 300};
    umb_allocator a = umb_memory_allocator(NULL);
    dice d = {15};
    uint32_t met = 0;
    for (uint32_t n = 0; n < (is_small() ? 70u : 700u); ++n) {
        umb_solid bodies[300];
        uint32_t count = counts[n % 7];
        umb_solids solids = {.allocator = &a, .items = bodies, .count = count};
        umb_solid_tree tree = {0};
        memset(bodies, 0, sizeof bodies);
        for (uint32_t i = 0; i < count; ++i) {
            umb_aabb *b = &bodies[i].bounds;
            draw_box(&d, 20, n % 3 == 0 ? 30.0 : 4.0, b->min, b->max);
            if (n % 5 == 0 && i > 0 && i % 3 == 0) {
                *b = bodies[0].bounds;
            } else if (n % 5 == 1) {
                b->max[dice_roll(&d, 3)] = b->min[dice_roll(&d, 3)];
                for (int k = 0; k < 3; ++k) {
                    b->max[k] = fmaxf(b->min[k], b->max[k]);
                }
            }
        }
        assert_true(umb_solid_tree_build(&tree, &a, &solids));
        for (int i = 0; i < 60; ++i) {
            met += check_along(&d, &tree, bodies, count);
        }
        umb_solid_tree_free(&tree, &a);
    }
    assert_true(met > 1000);
    umb_solid_tree none = {0};
    static const double segment[2][3] = {{0, 0, 0}, {1, 1, 1}};
    umb_solids_along n = umb_solid_tree_along(&none, segment, segment, 4, (uint32_t[4]){0});
    assert_true(n.both_end == 0 && n.first_begin == 4);
}

/* ---- floats --------------------------------------------------------------------------------------- */

static void check_float(uint32_t bits)
{
    float x, above, below, next;
    memcpy(&x, &bits, sizeof x);
    above = umb_float_above(x);
    below = umb_float_below(x);
    if (isnan(x)) {
        assert_true(isnan(above) && isnan(below));
        return;
    }
    next = nextafterf(x, INFINITY);
    assert_true(above == next);
    assert_true(nextafterf(x, -INFINITY) == below);
}

/* As nextafterf() has it: around powers of two, zeros, the least and the greatest floats, infinities, and any. */
static void test_next_floats(void **state)
{
    (void)state;
    dice d = {16};
    for (uint32_t e = 0; e < 512; ++e) {
        for (uint32_t i = 0; i < 64; ++i) {
            check_float((e << 23) + i - 32u);
        }
    }
    for (uint32_t i = 0; i < (is_small() ? 100000u : 4000000u); ++i) {
        check_float(dice_roll(&d, 1u << 16) << 16 | dice_roll(&d, 1u << 16));
    }
}

/* ---- rays --------------------------------------------------------------------------------------- */

/* Every horizontal ray that leaves the cell goes through a live pixel of one of the maps of the frames that look its
 * way. */
static void check_rays(double hu, double hv, double outer, uint64_t seed)
{
    umb_allocator a = umb_memory_allocator(NULL);
    dice d = {seed};
    umb_ray_frame frames[4] = {{hu, hv, -1, 1, {0, 0, 0}, 0, 1, 2, 1, 0, INFINITY},
                               {hu, hv, -1, 1, {0, 0, 0}, 0, 1, 2, -1, 0, INFINITY},
                               {hv, hu, -1, 1, {0, 0, 0}, 1, 0, 2, 1, 0, INFINITY},
                               {hv, hu, -1, 1, {0, 0, 0}, 1, 0, 2, -1, 0, INFINITY}};
    umb_ray_map maps[8] = {0};
    uint32_t count = outer == 0.0 ? 4 : 8;
    for (uint32_t k = 0; k < count; ++k) {
        umb_ray_kind kind = outer == 0.0 ? UMB_RAY_SLAB : k < 4 ? UMB_RAY_NEAR : UMB_RAY_FAR;
        umb_ray_layout layout = {kind, outer, kind == UMB_RAY_SLAB ? 24 : 64, 64, 1};
        assert_int_equal(umb_ray_map_begin(&maps[k], &a, &frames[k % 4], &layout), UMB_OK);
    }
    for (uint32_t i = 0; i < (is_small() ? 2000u : 20000u); ++i) {
        double from[3] = {between(&d, -hu, hu), between(&d, -hv, hv), 0}, angle = between(&d, 0, 6.283185307179586);
        double to[3] = {from[0] + 50 * (hu + hv) * cos(angle), from[1] + 50 * (hu + hv) * sin(angle), 0};
        bool found = false;
        for (uint32_t k = 0; k < count && !found; ++k) {
            const umb_ray_map *m = &maps[k];
            umb_ray_point p = umb_ray_frame_point(m->frame, from), q = umb_ray_frame_point(m->frame, to);
            if (q.u <= p.u) {
                continue;
            }
            double slope = (q.v - p.v) / (q.u - p.u), at0 = p.v - slope * p.u;
            double ui = -m->beta0 / m->beta1, uo = ui + 1.0 / m->beta1;
            double s = m->alpha1 == 0.0 ? at0 : at0 + slope * ui, t = m->alpha1 == 0.0 ? slope : at0 + slope * uo;
            double i_s = floor((s - m->s0) / m->ds), i_t = floor((t - m->t0) / m->dt);
            if (i_s < 0 || i_t < 0 || i_s >= m->rows * UMB_TILE || i_t >= m->columns * UMB_TILE) {
                continue;
            }
            uint32_t r = (uint32_t)i_s, c = (uint32_t)i_t;
            found = (m->live[r / UMB_TILE * m->columns + c / UMB_TILE] >> (r % UMB_TILE * UMB_TILE + c % UMB_TILE) & 1) != 0;
        }
        assert_true(found);
    }
    for (uint32_t k = 0; k < count; ++k) {
        umb_ray_map_free(&maps[k], &a);
    }
}

static void test_rays(void **state)
{
    (void)state;
    static const double outers[] = {0.0, 1.2, 2.0, 8.0, 100.0};
    for (size_t i = 0; i < sizeof outers / sizeof outers[0]; ++i) {
        check_rays(1, 1, outers[i], 21);
        check_rays(5, 0.5, outers[i], 22);
        check_rays(0.2, 3, outers[i], 23);
    }
}

/* ---- kernels ------------------------------------------------------------------------------------ */

/* A convex body drawn at random before the cell, into a map of its own, with one set of kernels. */
static void draw_bodies(const umb_umbra_kernels *kernels, umb_ray_map *m, bool half)
{
    dice d = {31};
    for (int i = 0; i < 40; ++i) {
        umb_ray_blocker b = {.convex = i % 3 != 0, .floor = true};
        double u = between(&d, 4, 40), v = between(&d, -30, 30), z = between(&d, -2, 8);
        b.count = b.convex ? 8 : 4;
        b.ring = b.convex ? 0 : 4;
        for (uint32_t c = 0; c < b.count; ++c) {
            double side = b.convex ? (c & 1) : (c == 1 || c == 2), up = b.convex ? (c >> 1 & 1) : c > 1;
            double along = u + 3 * (double)(c >> 2) + between(&d, 0, 1);
            b.vertices[c] = (umb_ray_point){along, v + 6 * side, half ? 9 * up - 1 : z + 3 * up};
            b.on_floor[c] = half && up == 0.0;
        }
        umb_ray_map_block(m, kernels, &b, half);
    }
}

static void test_kernels(void **state)
{
    (void)state;
    static const umb_isa isas[] = {UMB_ISA_SSE4, UMB_ISA_AVX2, UMB_ISA_NEON};
    umb_allocator a = umb_memory_allocator(NULL);
    for (uint32_t umbrae = 1; umbrae <= 4; ++umbrae) {
        umb_ray_map scalar = {0}, other = {0};
        bool half = umbrae == 1;
        umb_ray_frame frame = {2, 2, -1, 1, {0, 0, 0}, 0, 1, 2, 1, 1e-12, umbrae == 3 ? 1.0f : INFINITY};
        assert_int_equal(umb_ray_map_begin(&scalar, &a, &frame, &(umb_ray_layout){UMB_RAY_SLAB, 0.0, 16, 128, umbrae}), UMB_OK);
        draw_bodies(umb_umbra_kernels_get(UMB_ISA_SCALAR), &scalar, half);
        for (size_t k = 0; k < sizeof isas / sizeof isas[0]; ++k) {
            if (!umb_isa_available(isas[k])) {
                continue;
            }
            assert_int_equal(umb_ray_map_begin(&other, &a, &frame, &(umb_ray_layout){UMB_RAY_SLAB, 0.0, 16, 128, umbrae}), UMB_OK);
            draw_bodies(umb_umbra_kernels_get(isas[k]), &other, half);
            for (uint32_t t = 0; t < scalar.rows * scalar.columns; ++t) {
                assert_int_equal(scalar.drawn[t], other.drawn[t]);
                assert_memory_equal(&scalar.summaries[t], &other.summaries[t], sizeof *scalar.summaries);
                if (scalar.drawn[t]) {
                    assert_memory_equal(&scalar.intervals[(size_t)t * umbrae], &other.intervals[(size_t)t * umbrae],
                                        umbrae * sizeof *scalar.intervals);
                }
            }
        }
        umb_ray_map_free(&scalar, &a);
        umb_ray_map_free(&other, &a);
    }
}

/* ---- far occluders -------------------------------------------------------------------------------- */

/* Every line of a pixel that a wall was drawn into meets the wall, below its top and not beyond the depth that is told. */
static uint32_t check_wall(const umb_ray_map *m, const umb_ray_blocker *b, dice *d)
{
    const umb_ray_frame *f = m->frame;
    slice k = {-f->hu, f->hu, f->z0, f->z1};
    uint32_t drawn = 0;
    for (uint32_t i = 0; i < m->rows * m->columns * 64; ++i) {
        uint32_t tile = i / 64, pixel = i % 64;
        const umb_umbra_tile *t = &m->intervals[tile];
        if (!m->drawn[tile] || !(m->live[tile] >> pixel & 1) || !(t->top[pixel] > -INFINITY)) {
            continue;
        }
        drawn += 1;
        double row = tile / m->columns * UMB_TILE + pixel / UMB_TILE, column = tile % m->columns * UMB_TILE + pixel % UMB_TILE;
        for (int n = 0; n < 8; ++n) {
            double s = m->s0 + (row + (n < 4 ? n & 1 : between(d, 0, 1))) * m->ds;
            double x = m->t0 + (column + (n < 4 ? n >> 1 : between(d, 0, 1))) * m->dt;
            const umb_ray_point *p = b->vertices;
            double f0 = p[0].v - s - p[0].u * x, f1 = p[1].v - s - p[1].u * x, part = f0 / (f0 - f1);
            assert_true(f0 * f1 <= 0.0);
            point top = {p[0].u + part * (p[1].u - p[0].u), p[3].z + part * (p[2].z - p[3].z)};
            point bottom = {top.u, p[0].z + part * (p[1].z - p[0].z)};
            double least = least_slope(&k, top), most = greatest_slope(&k, bottom); /* endless where no ray is steeper */
            assert_true((least >= t->top[pixel] && greatest_slope(&k, top) >= t->top_far[pixel]) || least >= f->steep);
            assert_true((most <= t->bottom[pixel] && least_slope(&k, bottom) <= t->bottom_far[pixel]) || most <= -f->steep);
            assert_true(top.u <= t->depth[pixel]);
        }
    }
    return drawn;
}

static void test_far(void **state)
{
    (void)state;
    umb_allocator a = umb_memory_allocator(NULL);
    umb_ray_frame frame = {2, 1.5, -1, 1, {0, 0, 0}, 0, 1, 2, 1, 1e-12, INFINITY};
    umb_ray_map map = {0};
    dice d = {41};
    uint32_t drawn = 0;
    for (int i = 0; i < (is_small() ? 40 : 400); ++i) {
        umb_ray_blocker b = {.count = 4, .ring = 4};
        frame.steep = i % 2 == 0 ? INFINITY : 1.0f;
        double u = between(&d, 20, 300), v = between(&d, -200, 200), width = between(&d, 1, 40), z = between(&d, -20, 60);
        double turn = between(&d, -0.1, 0.1) * width, up = between(&d, 1, 30);
        b.vertices[0] = b.vertices[3] = (umb_ray_point){u, v, z};
        b.vertices[1] = b.vertices[2] = (umb_ray_point){u + turn, v + width, z + between(&d, -0.1, 0.1)};
        b.vertices[3].z += up;
        b.vertices[2].z += up;
        assert_int_equal(umb_ray_map_begin(&map, &a, &frame, &(umb_ray_layout){UMB_RAY_SLAB, 0.0, 32, 256, 1}), UMB_OK);
        if (umb_ray_map_block_far(&map, umb_umbra_kernels_get(UMB_ISA_AUTO), &b, false)) {
            drawn += check_wall(&map, &b, &d);
        }
    }
    umb_ray_map_free(&map, &a);
    assert_true(drawn > 5000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_slices),  cmocka_unit_test(test_joins), cmocka_unit_test(test_corners),
        cmocka_unit_test(test_shafts),  cmocka_unit_test(test_along), cmocka_unit_test(test_next_floats),
        cmocka_unit_test(test_rays),
        cmocka_unit_test(test_far),    cmocka_unit_test(test_kernels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Bounding volumes against frusta: an answer is a proof, held against points of the volumes in wider arithmetic; volumes
 * clearly beyond a plane are found; the exact test agrees with clipping; switches, sweeps and movement prove too. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "support/random_boxes.h"
#include "umbrage/bounds.h"

enum { KINDS = UMB_VOLUME_HULL + 1, POINTS = 24 };

static uint32_t rounds(uint32_t normal)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && strcmp(size, "small") == 0 ? normal / 10 : normal;
}

/* ---- volumes and their points --------------------------------------------------------------- */

typedef struct sample {
    umb_volume v;
    float points[POINTS][3];
} sample;

/* Points refer to *out: it must stay where it is. */
static void random_volume(uint64_t *state, umb_volume_kind kind, const double near_to[3], double scale, sample *out)
{
    umb_volume *v = &out->v;
    memset(out, 0, sizeof *out);
    v->kind = kind;
    v->box = random_box(state, near_to, scale);
    v->radius = random_below(state, 5) == 0 ? 0.0 : scale * pow(10.0, random_in(state, -5, 0.2));
    bool thin = random_below(state, 4) == 0;
    for (int i = 0; i < 3; ++i) {
        v->center[i] = near_to[i] + scale * random_in(state, -2.0, 2.0);
        double size = scale * pow(10.0, random_in(state, -4, 0.2));
        for (int j = 0; j < 3; ++j) {
            v->axis[i][j] = thin && i == 2 ? 0.0 : size * random_in(state, -1.0, 1.0);
        }
    }
    v->points = &out->points[0][0];
    v->point_count = 1 + random_below(state, POINTS);
    for (int k = 0; k < POINTS; ++k) {
        for (int i = 0; i < 3; ++i) {
            out->points[k][i] = (float)(v->center[i] + v->radius * random_in(state, -1.0, 1.0));
        }
    }
}

typedef struct wide {
    long double p[3];
} wide;

static long double dot(const long double a[3], const long double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* The point of the volume that is farthest along a direction. */
static wide farthest_along(const umb_volume *v, const long double n[3])
{
    wide w = {{v->center[0], v->center[1], v->center[2]}};
    int axes = v->kind == UMB_VOLUME_SPHERE ? 0 : v->kind == UMB_VOLUME_LOZENGE ? 2 : 3;
    axes = v->kind == UMB_VOLUME_CAPSULE || v->kind == UMB_VOLUME_CYLINDER ? 1 : axes;
    long double along[3], round[3] = {n[0], n[1], n[2]}, squares = 0;
    for (int i = 0; i < 3; ++i) {
        long double a[3] = {v->axis[i][0], v->axis[i][1], v->axis[i][2]};
        along[i] = dot(n, a);
        squares += along[i] * along[i];
    }
    if (v->kind == UMB_VOLUME_BOX) {
        for (int i = 0; i < 3; ++i) {
            w.p[i] = n[i] > 0 ? v->box.max[i] : v->box.min[i];
        }
        return w;
    }
    if (v->kind == UMB_VOLUME_HULL) {
        uint32_t best = 0;
        for (uint32_t k = 0; k < v->point_count; ++k) {
            const float *p = v->points + (size_t)3 * k, *q = v->points + (size_t)3 * best;
            long double a[3] = {p[0], p[1], p[2]}, b[3] = {q[0], q[1], q[2]};
            best = dot(n, a) > dot(n, b) ? k : best;
        }
        for (int i = 0; i < 3; ++i) {
            w.p[i] = v->points[3 * best + (uint32_t)i];
        }
        return w;
    }
    if (v->kind == UMB_VOLUME_ELLIPSOID) {
        for (int i = 0; i < 3 && squares > 0; ++i) {
            for (int j = 0; j < 3; ++j) {
                w.p[j] += v->axis[i][j] * (along[i] / sqrtl(squares));
            }
        }
        return w;
    }
    for (int i = 0; i < axes; ++i) {
        for (int j = 0; j < 3; ++j) {
            w.p[j] += along[i] > 0 ? v->axis[i][j] : -v->axis[i][j];
        }
    }
    if (v->kind == UMB_VOLUME_CYLINDER) {
        long double a[3] = {v->axis[0][0], v->axis[0][1], v->axis[0][2]}, length = dot(a, a);
        for (int j = 0; j < 3 && length > 0; ++j) {
            round[j] -= a[j] * (along[0] / length);
        }
    }
    long double size = sqrtl(dot(round, round));
    for (int j = 0; j < 3 && v->kind != UMB_VOLUME_ORIENTED_BOX && size > 0; ++j) {
        w.p[j] += v->radius * (round[j] / size);
    }
    return w;
}

/* ---- planes --------------------------------------------------------------------------------- */

typedef struct half_space {
    long double n[3], c;
} half_space;

/* As view.h defines them. */
static uint32_t half_spaces(const umb_view *v, half_space out[6 + UMB_MAX_CLIP_PLANES])
{
    const double *axes[4] = {v->right, v->right, v->up, v->up};
    const double bounds[4] = {v->x_min, v->x_max, v->y_min, v->y_max};
    bool deep = v->projection == UMB_PERSPECTIVE;
    uint32_t count = 0;
    for (int k = 0; k < 6; ++k) {
        half_space *h = &out[count];
        long double sign = k % 2 == 0 ? 1 : -1;
        if (k == 5 && isinf(v->far_depth)) {
            continue;
        }
        h->c = k < 4 ? (deep ? 0 : -sign * bounds[k]) : k == 4 ? -(long double)v->near_depth : v->far_depth;
        for (int i = 0; i < 3; ++i) {
            h->n[i] = k < 4 ? sign * (axes[k][i] - (deep ? (long double)bounds[k] * v->forward[i] : 0))
                            : sign * v->forward[i];
            h->c -= h->n[i] * v->eye[i];
        }
        ++count;
    }
    for (uint32_t k = 0; k < v->plane_count; ++k) {
        out[count++] = (half_space){{v->planes[k][0], v->planes[k][1], v->planes[k][2]}, v->planes[k][3]};
    }
    return count;
}

static long double height(const half_space *h, const wide *w)
{
    return dot(h->n, w->p) + h->c;
}

/* Of a point at such a height, what long double and the library's bounds may lose. */
static long double blur(const half_space *h, const wide *w, long double part)
{
    long double sum = fabsl(h->c);
    for (int i = 0; i < 3; ++i) {
        sum += fabsl(h->n[i] * w->p[i]);
    }
    return part * sum;
}

/* What an answer must be true to. loss: what may be left undecided, of the size of the terms. */
static void hold(const umb_view *view, const umb_volume *v, umb_place place, bool sharp)
{
    half_space h[6 + UMB_MAX_CLIP_PLANES];
    uint32_t count = half_spaces(view, h);
    bool beyond = false, surely = false;
    for (uint32_t k = 0; k < count; ++k) {
        long double back[3] = {-h[k].n[0], -h[k].n[1], -h[k].n[2]};
        wide most = farthest_along(v, h[k].n), least = farthest_along(v, back);
        beyond |= height(&h[k], &most) < blur(&h[k], &most, 0x1p-56L);
        surely |= height(&h[k], &most) < -blur(&h[k], &most, 0x1p-40L) - blur(&h[k], &least, 0x1p-40L);
        if (place == UMB_PLACE_INSIDE && height(&h[k], &least) < -blur(&h[k], &least, 0x1p-56L)) {
            fail_msg("kind %d called inside is %Lg beyond plane %u", (int)v->kind, -height(&h[k], &least), k);
        }
    }
    if (place == UMB_PLACE_OUTSIDE && !beyond) {
        fail_msg("kind %d called outside is beyond no plane", (int)v->kind);
    }
    if (sharp && surely && place != UMB_PLACE_OUTSIDE) {
        fail_msg("kind %d clearly beyond a plane was kept", (int)v->kind);
    }
}

static void test_planes(void **unused)
{
    (void)unused;
    uint64_t state = 11;
    uint32_t tally[KINDS][3] = {{0}};
    for (uint32_t round = 0; round < rounds(4000); ++round) {
        double scale = fabs(random_power(&state, -3, 5));
        umb_view view = random_view(&state, scale);
        umb_bounds_frustum f;
        assert_int_equal(umb_bounds_prepare(&f, &view, NULL), UMB_OK);
        for (int k = 0; k < KINDS; ++k) {
            sample s;
            random_volume(&state, (umb_volume_kind)k, view.eye, scale, &s);
            umb_place place = umb_bounds_test(&f, &s.v);
            hold(&view, &s.v, place, true);
            tally[k][place] += 1;
        }
    }
    for (int k = 0; k < KINDS; ++k) {
        for (int p = 0; p < 3; ++p) {
            assert_true(tally[k][p] > rounds(40)); /* every kind has met every answer */
        }
    }
}

/* Touching a plane from outside, exactly: never outside. */
static void test_touching(void **unused)
{
    (void)unused;
    const double eye[3] = {0, 0, 0}, target[3] = {0, 0, -1}, up[3] = {0, 1, 0};
    umb_view view;
    umb_bounds_frustum f;
    assert_int_equal(umb_view_look_at_ortho(&view, eye, target, up, 2.0, 1.0, 1.0, 3.0), UMB_OK);
    assert_int_equal(umb_bounds_prepare(&f, &view, NULL), UMB_OK);
    umb_volume sphere = {.kind = UMB_VOLUME_SPHERE, .center = {1.25, 0, -2}, .radius = 0.25};
    assert_int_equal(umb_bounds_test(&f, &sphere), UMB_PLACE_CROSSING);
    sphere.center[0] = 1.2500001;
    assert_int_equal(umb_bounds_test(&f, &sphere), UMB_PLACE_OUTSIDE);
    umb_volume box = {.kind = UMB_VOLUME_BOX, .box = {{1, 1, -2}, {2, 2, -1}}};
    assert_int_equal(umb_bounds_test(&f, &box), UMB_PLACE_CROSSING);
    assert_int_equal(umb_bounds_test_exact(&f, &box), UMB_PLACE_CROSSING);
}

static void test_absurd(void **unused)
{
    (void)unused;
    uint64_t state = 5;
    umb_view view = random_view(&state, 1.0);
    umb_bounds_frustum f;
    umb_bounds_swept swept;
    assert_int_equal(umb_bounds_prepare(&f, &view, NULL), UMB_OK);
    const double bad[] = {NAN, INFINITY, -INFINITY};
    for (int k = 0; k < KINDS; ++k) {
        for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
            sample s;
            random_volume(&state, (umb_volume_kind)k, view.eye, 1.0, &s);
            s.v.center[i % 3] = s.v.axis[0][1] = s.v.radius = bad[i];
            s.v.box.max[1] = s.points[0][2] = (float)bad[i];
            uint16_t planes = 0xFFFF;
            umb_bounds_past past = {0};
            assert_int_equal(umb_bounds_test(&f, &s.v), UMB_PLACE_CROSSING);
            assert_int_equal(umb_bounds_test_exact(&f, &s.v), UMB_PLACE_CROSSING);
            assert_int_equal(umb_bounds_test_again(&f, &s.v, ~0u, &past, &planes), UMB_PLACE_CROSSING);
            assert_int_equal(umb_bounds_test_again(&f, &s.v, ~0u, &past, NULL), UMB_PLACE_CROSSING);
            umb_bounds_sweep(&swept, &f, &s.v);
            if (isnan(bad[i])) {
                assert_int_equal(umb_bounds_test_point(&swept, (double[3]){bad[i], 0, 0}), UMB_PLACE_CROSSING);
            }
        }
    }
    umb_volume nothing = {.kind = UMB_VOLUME_HULL};
    assert_int_equal(umb_bounds_test(&f, &nothing), UMB_PLACE_OUTSIDE);
    assert_int_equal(umb_bounds_test_again(&f, &nothing, 0, NULL, NULL), UMB_PLACE_OUTSIDE);
    umb_bounds_sweep(&swept, &f, &nothing);
    assert_int_equal(umb_bounds_test_point(&swept, view.eye), UMB_PLACE_OUTSIDE);
    view.near_depth = NAN;
    assert_int_equal(umb_bounds_prepare(&f, &view, NULL), UMB_ERROR_ARGUMENT);
}

/* ---- exact ---------------------------------------------------------------------------------- */

enum { MOST_CORNERS = 32 };

typedef struct polygon {
    wide corner[MOST_CORNERS];
    uint32_t count;
} polygon;

static void cut(polygon *p, const half_space *h, long double slack)
{
    polygon out = {.count = 0};
    for (uint32_t k = 0; k < p->count; ++k) {
        const wide *a = &p->corner[k], *b = &p->corner[(k + 1) % p->count];
        long double ga = height(h, a) + slack, gb = height(h, b) + slack;
        if (ga >= 0) {
            out.corner[out.count++] = *a;
        }
        if ((ga >= 0) != (gb >= 0)) {
            wide *w = &out.corner[out.count++];
            for (int i = 0; i < 3; ++i) {
                w->p[i] = a->p[i] + (b->p[i] - a->p[i]) * (ga / (ga - gb));
            }
        }
    }
    *p = out;
}

/* Does a point of the box's surface lie in the frustum grown by slack? A frustum within the box has none. */
static bool surface_meets(const umb_volume *v, const half_space *h, uint32_t count, long double slack)
{
    for (int axis = 0; axis < 3; ++axis) {
        for (int side = -1; side <= 1; side += 2) {
            static const int ring[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
            polygon p = {.count = 4};
            for (int k = 0; k < 4; ++k) {
                for (int i = 0; i < 3; ++i) {
                    long double at = v->center[i] + (long double)side * v->axis[axis][i];
                    at += (long double)ring[k][0] * v->axis[(axis + 1) % 3][i];
                    p.corner[k].p[i] = at + (long double)ring[k][1] * v->axis[(axis + 2) % 3][i];
                }
            }
            for (uint32_t k = 0; k < count && p.count > 0; ++k) {
                long double length = sqrtl(dot(h[k].n, h[k].n));
                cut(&p, &h[k], slack * length);
            }
            if (p.count > 0) {
                return true;
            }
        }
    }
    return false;
}

/* A box of the kind from the doubles of an oriented one. */
static umb_volume upright(const umb_volume *v)
{
    umb_volume u = *v;
    u.kind = UMB_VOLUME_BOX;
    for (int i = 0; i < 3; ++i) {
        u.center[i] = 0.5 * ((double)v->box.min[i] + v->box.max[i]);
        for (int j = 0; j < 3; ++j) {
            u.axis[i][j] = i == j ? 0.5 * ((double)v->box.max[i] - v->box.min[i]) : 0.0;
        }
    }
    return u;
}

static void test_exact(void **unused)
{
    (void)unused;
    uint64_t state = 17;
    uint32_t apart = 0, met = 0;
    for (uint32_t round = 0; round < rounds(60000); ++round) {
        umb_view view = random_view(&state, 1.0);
        view.plane_count = 0;
        umb_bounds_frustum f;
        assert_int_equal(umb_bounds_prepare(&f, &view, NULL), UMB_OK);
        half_space h[6 + UMB_MAX_CLIP_PLANES];
        uint32_t count = half_spaces(&view, h);
        sample s;
        random_volume(&state, UMB_VOLUME_ORIENTED_BOX, view.eye, 1.0, &s);
        umb_volume v = round % 2 == 0 ? s.v : upright(&s.v);
        umb_place place = umb_bounds_test_exact(&f, &v), loose = umb_bounds_test(&f, &v);
        assert_true(place == UMB_PLACE_OUTSIDE || place == loose);
        if (place == UMB_PLACE_OUTSIDE && surface_meets(&v, h, count, -1e-12L)) {
            fail_msg("round %u: a box that meets the frustum was called outside", round);
        }
        /* Neither does it hold the frustum: a corner of it is outside the box, or there would be a surface point. */
        bool near_by = surface_meets(&v, h, count, 1e-9L);
        if (loose == UMB_PLACE_CROSSING && place == UMB_PLACE_CROSSING && !near_by) {
            bool holds = true; /* the near corner, in the box's own coordinates */
            const double *d = f.corner[0];
            long double m[3][4];
            for (int i = 0; i < 3; ++i) {
                for (int j = 0; j < 3; ++j) {
                    m[i][j] = v.axis[j][i];
                }
                m[i][3] = view.eye[i] + d[i] - v.center[i];
            }
            long double det = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                              m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                              m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
            for (int j = 0; j < 3 && det != 0; ++j) {
                long double c[3][3];
                for (int r = 0; r < 3; ++r) {
                    for (int k = 0; k < 3; ++k) {
                        c[r][k] = k == j ? m[r][3] : m[r][k];
                    }
                }
                long double t = c[0][0] * (c[1][1] * c[2][2] - c[1][2] * c[2][1]) -
                                c[0][1] * (c[1][0] * c[2][2] - c[1][2] * c[2][0]) +
                                c[0][2] * (c[1][0] * c[2][1] - c[1][1] * c[2][0]);
                holds &= fabsl(t / det) <= 1.0L + 1e-9L;
            }
            if (!holds && det != 0) {
                fail_msg("round %u: a box apart from the frustum was kept", round);
            }
        }
        apart += place == UMB_PLACE_OUTSIDE && loose == UMB_PLACE_CROSSING;
        met += place == UMB_PLACE_CROSSING;
    }
    assert_true(apart > rounds(300)); /* the planes alone would have kept them */
    assert_true(met > rounds(1500));
}

/* ---- coherence and sweeps ------------------------------------------------------------------- */

enum { MANY = 64 };

static void move_view(uint64_t *state, umb_view *v, int how)
{
    double turn = random_below(state, 8) == 0 ? random_in(state, -1.5, 1.5) : random_in(state, -0.02, 0.02);
    if (how != 1) { /* about up */
        for (int i = 0; i < 3; ++i) {
            double r = v->right[i], f = v->forward[i];
            v->right[i] = r * cos(turn) - f * sin(turn);
            v->forward[i] = r * sin(turn) + f * cos(turn);
        }
    }
    for (int i = 0; i < 3 && how != 0; ++i) {
        v->eye[i] += random_in(state, -0.02, 0.02);
    }
}

/* Every combination of switches, over frames that turn, go, or both: answers prove, and where nothing is remembered of
 * motion they are those of the plain test. */
static void test_again(void **unused)
{
    (void)unused;
    uint64_t state = 23;
    uint32_t kept = 0;
    for (uint32_t round = 0; round < rounds(120); ++round) {
        umb_view view = random_view(&state, 1.0);
        umb_bounds_frustum f, *before = NULL;
        uint32_t switches = round % 8;
        static sample volumes[MANY];
        umb_bounds_past past[MANY];
        memset(past, 0, sizeof past);
        for (uint32_t k = 0; k < MANY; ++k) {
            random_volume(&state, (umb_volume_kind)(k % KINDS), view.eye, 1.0, &volumes[k]);
        }
        for (int frame = 0; frame < 20; ++frame) {
            move_view(&state, &view, (int)(round / 8 % 3));
            assert_int_equal(umb_bounds_prepare(&f, &view, before), UMB_OK);
            before = &f;
            for (uint32_t k = 0; k < MANY; ++k) {
                uint16_t planes = 0xFFFF;
                uint64_t known = past[k].frame;
                umb_place place = umb_bounds_test_again(&f, &volumes[k].v, switches, &past[k],
                                                        k % 2 == 0 ? &planes : NULL);
                kept += known != 0 && known + 1 == f.frame && past[k].frame == f.frame;
                hold(&view, &volumes[k].v, place, (switches & UMB_BOUNDS_MOTION) == 0);
                if (k % 2 == 0) {
                    assert_int_equal(place == UMB_PLACE_CROSSING, planes != 0);
                }
                if (volumes[k].v.kind == UMB_VOLUME_BOX && switches == 0) {
                    assert_int_equal(place, umb_bounds_test(&f, &volumes[k].v));
                }
            }
        }
    }
    assert_true(kept > rounds(10000));
}

/* Planes that a parent is inside of need no test for what it holds. */
static void test_masks(void **unused)
{
    (void)unused;
    uint64_t state = 29;
    uint32_t spared = 0;
    for (uint32_t round = 0; round < rounds(20000); ++round) {
        umb_view view = random_view(&state, 1.0);
        umb_bounds_frustum f;
        assert_int_equal(umb_bounds_prepare(&f, &view, NULL), UMB_OK);
        umb_volume parent = {.kind = UMB_VOLUME_BOX, .box = random_box(&state, view.eye, 1.0)}, child = parent;
        uint16_t planes = 0xFFFF;
        umb_place place = umb_bounds_test_again(&f, &parent, UMB_BOUNDS_OCTANT, NULL, &planes);
        for (int i = 0; i < 3; ++i) {
            float half = 0.5f * parent.box.min[i] + 0.5f * parent.box.max[i];
            if (half >= parent.box.min[i] && half <= parent.box.max[i]) {
                child.box.max[i] = half;
            }
        }
        if (place == UMB_PLACE_CROSSING) {
            umb_place below = umb_bounds_test_again(&f, &child, round % 8, NULL, &planes);
            hold(&view, &child, below, true);
            spared += below != UMB_PLACE_OUTSIDE;
        }
    }
    assert_true(spared > rounds(200));
}

static void test_sweep(void **unused)
{
    (void)unused;
    uint64_t state = 31;
    for (uint32_t round = 0; round < rounds(4000); ++round) {
        umb_view view = random_view(&state, 1.0);
        umb_bounds_frustum f;
        umb_bounds_swept swept;
        sample s;
        assert_int_equal(umb_bounds_prepare(&f, &view, NULL), UMB_OK);
        random_volume(&state, (umb_volume_kind)(UMB_VOLUME_ORIENTED_BOX + round % 6), view.eye, 1.0, &s);
        umb_bounds_sweep(&swept, &f, &s.v);
        umb_place place = umb_bounds_test_point(&swept, s.v.center);
        hold(&view, &s.v, place, true);
    }
    /* Boxes and hulls are moved by their origin. */
    umb_view view = random_view(&state, 1.0);
    umb_bounds_frustum f;
    umb_bounds_swept swept;
    assert_int_equal(umb_bounds_prepare(&f, &view, NULL), UMB_OK);
    umb_volume box = {.kind = UMB_VOLUME_BOX, .box = {{-0.25f, -0.5f, 0.0f}, {0.125f, 0.0f, 0.25f}}};
    umb_bounds_sweep(&swept, &f, &box);
    for (uint32_t round = 0; round < rounds(2000); ++round) {
        double at[3];
        umb_volume moved = box;
        for (int i = 0; i < 3; ++i) {
            at[i] = (double)(float)(random_below(&state, 256) * 0x1p-6 - 2.0);
            moved.box.min[i] += (float)at[i];
            moved.box.max[i] += (float)at[i];
        }
        hold(&view, &moved, umb_bounds_test_point(&swept, at), true);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_planes), cmocka_unit_test(test_touching), cmocka_unit_test(test_absurd),
        cmocka_unit_test(test_exact),  cmocka_unit_test(test_again),    cmocka_unit_test(test_masks),
        cmocka_unit_test(test_sweep),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

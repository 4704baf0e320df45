/* Temporal bounding volumes hold what they promise to hold: objects moved by random promises and by what such promises
 * allow, at many times, with the floats that a user would make of the exact motion; and the queue of expiries. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "scene/expiries.h"
#include "scene/tbv.h"
#include "support/failing.h"

typedef long double wide;

static uint32_t round_count(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && strcmp(size, "small") == 0 ? 400 : 6000;
}

/* -1 to 1 */
static double unit(dice *d)
{
    return ((double)dice_roll(d, 2000001) - 1000000.0) * 1e-6;
}

/* ---- an exact motion ------------------------------------------------------------------------ */

/* A rigid body that turns and goes at once, faster or slower than it says, but within what it allows. */
typedef struct body {
    umb_aabb local;
    wide linear[3][3], at[3];      /* at time 0 */
    double velocity[3], spin[3];
    double push[3], speed, acceleration; /* unit direction: deviation speed s + acceleration s^2 / 2 along it */
    double stray_axis[3], stray;   /* unit axis and rate of a turn besides */
    double pivot[3];
} body;

static void turn(const double axis[3], wide angle, const wide in[3], wide out[3])
{
    wide c = cosl(angle), s = sinl(angle), along = 0;
    for (int i = 0; i < 3; ++i) {
        along += axis[i] * in[i];
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        out[i] = in[i] * c + (axis[j] * in[k] - axis[k] * in[j]) * s + axis[i] * along * (1 - c);
    }
}

static void unit_vector(dice *d, double out[3])
{
    double length;
    do {
        length = 0.0;
        for (int i = 0; i < 3; ++i) {
            out[i] = unit(d);
            length += out[i] * out[i];
        }
    } while (length < 0.01);
    for (int i = 0; i < 3; ++i) {
        out[i] /= sqrt(length);
    }
}

/* The float transform at a time: each number rounded once. */
static umb_transform pose_at(const body *b, double seconds)
{
    umb_transform t;
    double rate = sqrt(b->spin[0] * b->spin[0] + b->spin[1] * b->spin[1] + b->spin[2] * b->spin[2]);
    double axis[3] = {1, 0, 0};
    wide columns[3][3], pivot[3];
    for (int i = 0; rate > 0.0 && i < 3; ++i) {
        axis[i] = b->spin[i] / rate;
    }
    for (int k = 0; k < 3; ++k) {
        wide column[3] = {b->linear[0][k], b->linear[1][k], b->linear[2][k]}, once[3];
        turn(axis, (wide)rate * seconds, column, once);
        turn(b->stray_axis, (wide)b->stray * seconds, once, columns[k]);
    }
    wide away = (wide)b->speed * seconds + 0.5L * b->acceleration * seconds * seconds;
    for (int i = 0; i < 3; ++i) {
        pivot[i] = b->at[i] + (wide)b->velocity[i] * seconds + b->push[i] * away;
        wide translation = pivot[i];
        for (int k = 0; k < 3; ++k) {
            t.m[i][k] = (float)columns[k][i];
            translation -= columns[k][i] * b->pivot[k];
        }
        t.m[i][3] = (float)translation;
    }
    return t;
}

static body random_body(dice *d)
{
    body b;
    memset(&b, 0, sizeof b);
    double offset = dice_roll(d, 3) == 0 ? 1000.0 : 1.0, far_away = dice_roll(d, 4) == 0 ? 1e6 : 30.0;
    double axis[3];
    unit_vector(d, axis);
    wide angle = 3.0 * unit(d);
    for (int i = 0; i < 3; ++i) {
        double middle = offset * unit(d), half = fabs(unit(d)) * (dice_roll(d, 5) == 0 ? 0.0 : 2.0);
        b.local.min[i] = (float)(middle - half);
        b.local.max[i] = (float)(middle + half);
        b.at[i] = far_away * unit(d);
        b.velocity[i] = dice_roll(d, 2) == 0 ? 0.0 : 10.0 * unit(d);
        b.spin[i] = 0.0;
        b.pivot[i] = dice_roll(d, 2) == 0 ? 0.0 : (float)(middle + unit(d));
        wide one[3] = {i == 0, i == 1, i == 2}, column[3];
        turn(axis, angle, one, column);
        for (int k = 0; k < 3; ++k) {
            b.linear[k][i] = column[k] * (1.0 + 0.5 * unit(d));
        }
    }
    if (dice_roll(d, 2) == 0) {
        double spin_axis[3], rate = 4.0 * unit(d);
        unit_vector(d, spin_axis);
        for (int i = 0; i < 3; ++i) {
            b.spin[i] = rate * spin_axis[i];
        }
    }
    unit_vector(d, b.push);
    unit_vector(d, b.stray_axis);
    b.speed = dice_roll(d, 2) == 0 ? 0.0 : 5.0 * fabs(unit(d));
    b.acceleration = dice_roll(d, 2) == 0 ? 0.0 : 5.0 * fabs(unit(d));
    b.stray = dice_roll(d, 2) == 0 ? 0.0 : 3.0 * fabs(unit(d));
    return b;
}

/* World vertices as the library makes them. */
static umb_aabb bounds_at(const body *b, const umb_transform *t)
{
    umb_aabb box;
    for (int k = 0; k < 8; ++k) {
        const float p[3] = {k & 1 ? b->local.max[0] : b->local.min[0], k & 2 ? b->local.max[1] : b->local.min[1],
                            k & 4 ? b->local.max[2] : b->local.min[2]};
        for (int i = 0; i < 3; ++i) {
            double sum = (double)t->m[i][0] * p[0] + (double)t->m[i][1] * p[1] + (double)t->m[i][2] * p[2] +
                         (double)t->m[i][3];
            float x = (float)sum;
            box.min[i] = k == 0 || x < box.min[i] ? x : box.min[i];
            box.max[i] = k == 0 || x > box.max[i] ? x : box.max[i];
        }
    }
    return box;
}

static bool holds(const umb_aabb *outer, const umb_aabb *inner)
{
    bool in = true;
    for (int i = 0; i < 3; ++i) {
        in = in && outer->min[i] <= inner->min[i] && outer->max[i] >= inner->max[i];
    }
    return in;
}

static void test_swept(void **state)
{
    (void)state;
    dice d = {11};
    double ratio = 0.0;
    for (uint32_t round = 0; round < round_count(); ++round) {
        body b = random_body(&d);
        umb_motion_def def = {.max_speed = b.speed, .max_acceleration = b.acceleration, .max_spin = b.stray};
        memcpy(def.pivot, b.pivot, sizeof def.pivot);
        umb_pose pose = {.transform = pose_at(&b, 0.0)};
        memcpy(pose.velocity, b.velocity, sizeof pose.velocity);
        memcpy(pose.spin, b.spin, sizeof pose.spin);
        umb_aabb first = bounds_at(&b, &pose.transform), all = first;
        umb_tbv_start start = {.local = &b.local, .pose = &pose, .bounds = &first};
        double seconds = pow(10.0, 1.5 * unit(&d) - 0.5);
        umb_aabb box = umb_tbv_swept(&def, &start, seconds);
        for (uint32_t k = 0; k <= 64; ++k) {
            double s = k < 64 ? seconds * k / 64.0 : seconds;
            umb_transform t = pose_at(&b, s);
            umb_aabb now = bounds_at(&b, &t);
            assert_true(holds(&box, &now));
            for (int i = 0; i < 3; ++i) {
                all.min[i] = fminf(all.min[i], now.min[i]);
                all.max[i] = fmaxf(all.max[i], now.max[i]);
            }
        }
        double size = 0.0, needed = 0.0;
        for (int i = 0; i < 3; ++i) {
            size += (double)box.max[i] - box.min[i];
            needed += (double)all.max[i] - all.min[i];
        }
        ratio += size / (needed + 1e-3) / round_count();
    }
    printf("# volumes are %.3f times as large as what their objects needed, along each axis\n", ratio);
}

/* Nothing but a speed: the box grows by it on each side. Unknown turning: a sphere. */
static void test_simple(void **state)
{
    (void)state;
    umb_aabb local = {{-1, -2, -3}, {1, 2, 3}};
    umb_pose pose = {.velocity = {0}};
    umb_tbv_start start = {.local = &local, .pose = &pose, .bounds = &local};
    umb_motion_def def = {.max_speed = 2.0};
    umb_aabb box = umb_tbv_swept(&def, &start, 3.0);
    for (int i = 0; i < 3; ++i) {
        assert_true(box.max[i] >= local.max[i] + 6.0f && box.max[i] < local.max[i] + 6.00002f);
        assert_true(box.min[i] <= local.min[i] - 6.0f && box.min[i] > local.min[i] - 6.00002f);
    }
    def.max_spin = INFINITY;
    box = umb_tbv_swept(&def, &start, 3.0);
    for (int i = 0; i < 3; ++i) {
        assert_true(fabs(box.max[i] - (6.0 + sqrt(14.0))) < 2e-5 && fabs(box.min[i] + 6.0 + sqrt(14.0)) < 2e-5);
    }
    def.max_spin = 0.0;
    def.volume = (umb_aabb){{-2, -2, -2}, {4, 4, 4}}; /* it cannot be right about the third axis */
    box = umb_tbv_swept(&def, &start, 3.0);
    for (int i = 0; i < 3; ++i) {
        assert_true(box.min[i] == -2.0f && box.max[i] == 4.0f);
    }
    def = (umb_motion_def){.max_speed = INFINITY};
    box = umb_tbv_swept(&def, &start, 1.0);
    assert_true(box.min[0] == -3.402823466e38f && box.max[2] == 3.402823466e38f);
}

/* ---- expiries ------------------------------------------------------------------------------- */

static void note(void *user, uint32_t mover)
{
    ((uint8_t *)user)[mover] += 1;
}

static void test_expiries(void **state)
{
    (void)state;
    enum { COUNT = 300 };
    umb_allocator a = umb_memory_allocator(NULL);
    umb_expiries e = {0};
    double until[COUNT];
    dice d = {5};
    assert_true(umb_expiries_reserve(&e, &a, COUNT));
    for (int i = 0; i < COUNT; ++i) {
        until[i] = INFINITY;
    }
    for (uint32_t round = 0; round < 20000; ++round) {
        uint32_t mover = dice_roll(&d, COUNT);
        uint32_t kind = dice_roll(&d, 10);
        until[mover] = kind == 0 ? INFINITY : kind == 1 ? -INFINITY : (double)dice_roll(&d, 1000);
        umb_expiries_set(&e, mover, until[mover]);
        if (round % 50 == 0) {
            uint8_t met[COUNT] = {0};
            double time = dice_roll(&d, 1200);
            umb_motion queue = {.expiries = e.heap, .expiry_count = e.count};
            umb_motion_expired(&queue, time, note, met);
            for (int i = 0; i < COUNT; ++i) {
                assert_int_equal(met[i], until[i] < time);
            }
        }
    }
    umb_expiries_free(&e, &a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_swept),
        cmocka_unit_test(test_simple),
        cmocka_unit_test(test_expiries),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

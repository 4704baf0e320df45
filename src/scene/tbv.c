/* The box around all places that an object can be at within a time.
 *
 * With c the pivot, r a corner's offset from it, w the spin and dt the time, at s in [0, dt] a point of the object is
 *
 *     c + v s + turn(w s) r + deviation,   |deviation of the pivot| <= max_speed s + max_acceleration s^2 / 2
 *
 * and it may be turned about the pivot by max_spin s more. A box along the axes needs bounds of each coordinate; those
 * of a sum are sums of bounds. A coordinate of turn(w s) r is
 *
 *     f(a) = k + p cos a + q sin a,   a = |w| s,   k + p = r,   f'(0) = q,   |f''| <= A = sqrt(p^2 + q^2)
 *
 * so it lies within q a -+ A a^2 / 2 of r, and within A of k: no sine has to be known, and answers do not depend on whose
 * sine it is. No point of the object is ever farther from its pivot than now, which bounds every turning, known or not.
 * The object is inside the hull of its corners, however it is turned, so corners are enough. */
#include "tbv.h"

#include <float.h>
#include <math.h>

#include "geometry/vec.h"
#include "placement.h"

typedef struct sweep {
    umb_vec3 pivot, axis;
    umb_vec3 corners[8]; /* from the pivot */
    double angle;  /* that the spin turns by */
    double astray; /* radians that it may be turned by besides; more than 2 is no more than 2 */
    double away;   /* of the pivot from where its velocity takes it */
    double radius;
    double size;   /* S of the proof: what roundings are relative to, without radius, velocity and deviation */
} sweep;

static umb_vec3 turned(const umb_transform *t, umb_vec3 p)
{
    const float (*m)[4] = t->m;
    return (umb_vec3){m[0][0] * p.x + m[0][1] * p.y + m[0][2] * p.z, m[1][0] * p.x + m[1][1] * p.y + m[1][2] * p.z,
                      m[2][0] * p.x + m[2][1] * p.y + m[2][2] * p.z};
}

static umb_vec3 corner_of(const umb_aabb *b, int k)
{
    return (umb_vec3){k & 1 ? b->max[0] : b->min[0], k & 2 ? b->max[1] : b->min[1], k & 4 ? b->max[2] : b->min[2]};
}

static double along(umb_vec3 v, int axis)
{
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

/* Square root of the sum of the squares of a transform's linear part: the same however it is turned. */
static double norm_of(const umb_transform *t)
{
    double sum = 0.0;
    for (int i = 0; i < 9; ++i) {
        sum += (double)t->m[i / 3][i % 3] * t->m[i / 3][i % 3];
    }
    return sqrt(sum);
}

static double largest(umb_vec3 v)
{
    return fmax(fabs(v.x), fmax(fabs(v.y), fabs(v.z)));
}

static void find_corners(sweep *s, const umb_motion_def *def, const umb_tbv_start *start)
{
    static const umb_transform one = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    umb_vec3 pivot = umb_vec3_from_double(def->pivot);
    double norm = norm_of(&start->pose->transform), local = 0.0;
    const umb_transform *t = norm > 0.0 ? &start->pose->transform : &one; /* all zero is the identity */
    norm = norm > 0.0 ? norm : sqrt(3.0);
    s->pivot = umb_vec3_add(turned(t, pivot), (umb_vec3){t->m[0][3], t->m[1][3], t->m[2][3]});
    s->radius = 0.0;
    for (int k = 0; k < 8; ++k) {
        if (start->local != NULL) {
            umb_vec3 p = corner_of(start->local, k);
            s->corners[k] = turned(t, umb_vec3_sub(p, pivot));
            local = fmax(local, umb_vec3_length(p));
        } else {
            s->corners[k] = umb_vec3_sub(corner_of(start->bounds, k), s->pivot);
        }
        s->radius = fmax(s->radius, umb_vec3_length(s->corners[k]));
    }
    s->size = norm * (local + umb_vec3_length(pivot)) + largest(s->pivot);
}

static sweep sweep_of(const umb_motion_def *def, const umb_tbv_start *start, double seconds)
{
    sweep s;
    find_corners(&s, def, start);
    umb_vec3 spin = umb_vec3_from_double(start->pose->spin);
    double rate = umb_vec3_length(spin);
    s.axis = rate > 0.0 ? umb_vec3_scale(spin, 1.0 / rate) : (umb_vec3){0, 0, 0};
    s.angle = rate * seconds;
    double astray = def->max_spin * seconds;
    s.astray = astray < 2.0 ? astray : 2.0; /* 0 * INFINITY too */
    double away = def->max_speed * seconds + 0.5 * def->max_acceleration * seconds * seconds;
    s.away = away >= 0.0 ? away : INFINITY;
    return s;
}

/* Bounds of the corners' offsets from the pivot along an axis. */
static void turn_bounds(const sweep *s, int axis, double *low, double *high)
{
    *low = INFINITY;
    *high = -INFINITY;
    for (int k = 0; k < 8; ++k) {
        umb_vec3 r = s->corners[k];
        umb_vec3 kept = umb_vec3_scale(s->axis, umb_vec3_dot(s->axis, r));
        umb_vec3 across = s->angle > 0.0 ? umb_vec3_sub(r, kept) : (umb_vec3){0, 0, 0};
        umb_vec3 rise = umb_vec3_cross(s->axis, r);
        double at = along(r, axis), q = along(rise, axis), p = along(across, axis), a = s->angle;
        double swing = sqrt(p * p + q * q), bend = 0.5 * swing * a * a;
        double middle = at - p;
        *high = fmax(*high, fmin(at + fmax(0.0, q * a + bend), fmax(at, middle + swing)));
        *low = fmin(*low, fmax(at + fmin(0.0, q * a - bend), fmin(at, middle - swing)));
    }
    double stray = s->astray * s->radius;
    *high = fmin(*high + stray, s->radius);
    *low = fmax(*low - stray, -s->radius);
}

static float below(double x)
{
    float f = (float)fmax(x, -FLT_MAX);
    return (double)f <= x || f == -FLT_MAX ? f : nextafterf(f, -FLT_MAX);
}

static float above(double x)
{
    return -below(-x);
}

umb_aabb umb_tbv_swept(const umb_motion_def *def, const umb_tbv_start *start, double seconds)
{
    umb_aabb box;
    sweep s = sweep_of(def, start, seconds);
    bool bounded = !umb_box_is_zero(&def->volume);
    for (int i = 0; i < 3; ++i) {
        double low, high, way = start->pose->velocity[i] * seconds;
        turn_bounds(&s, i, &low, &high);
        /* Two poses, each of them rounded once by whoever told it and once as world vertices: 4 U S. The fifth is for
           what doubles lose here and for the products of such errors. */
        double slack = 5.0 * 0x1p-24 * (s.size + s.radius + s.away + fabs(way));
        box.min[i] = below(along(s.pivot, i) + fmin(0.0, way) + low - s.away - slack);
        box.max[i] = above(along(s.pivot, i) + fmax(0.0, way) + high + s.away + slack);
        box.min[i] = fminf(box.min[i], start->bounds->min[i]);
        box.max[i] = fmaxf(box.max[i], start->bounds->max[i]);
        if (bounded) { /* a promise that contradicts itself gives no inverted box */
            box.min[i] = fminf(fmaxf(box.min[i], def->volume.min[i]), def->volume.max[i]);
            box.max[i] = fmaxf(fminf(box.max[i], def->volume.max[i]), def->volume.min[i]);
        }
    }
    return box;
}

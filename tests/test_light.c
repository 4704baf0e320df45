/* Views for lights and volumes: they hold every point of what was asked for, in wider
 * arithmetic, and no more than they must; what is impossible is refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "frustum/box_kernels.h"
#include "support/random_boxes.h"
#include "umbrage/light.h"

#define PI 3.14159265358979323846

typedef long double wide;

/* ---- references ------------------------------------------------------------------------------ */

static wide wide_dot(const wide a[3], const wide b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void widen3(const double a[3], wide out[3])
{
    for (int i = 0; i < 3; ++i) {
        out[i] = a[i];
    }
}

/* The value of each plane of a view, as view.h defines it, at eye + d; at least 0 inside. size:
 * what its rounding is relative to. */
static uint32_t plane_values(const umb_view *v, const wide d[3], wide out[16], wide size[16])
{
    wide r[3], u[3], f[3], n = 0;
    widen3(v->right, r);
    widen3(v->up, u);
    widen3(v->forward, f);
    wide x = wide_dot(r, d), y = wide_dot(u, d), z = wide_dot(f, d);
    wide k = v->projection == UMB_PERSPECTIVE ? z : 1;
    wide values[6] = {x - v->x_min * k, v->x_max * k - x,  y - v->y_min * k,
                      v->y_max * k - y, z - v->near_depth, v->far_depth - z};
    uint32_t count = 0;
    for (int i = 0; i < 3; ++i) {
        n += fabsl(d[i]);
    }
    for (int i = 0; i < 6; ++i) {
        if (!isinf(values[i])) {
            size[count] = n * (1 + fmaxl(fabsl(v->x_min), fabsl(v->x_max)) +
                               fmaxl(fabsl(v->y_min), fabsl(v->y_max)));
            out[count++] = values[i];
        }
    }
    for (uint32_t i = 0; i < v->plane_count; ++i) {
        out[count] = v->planes[i][3];
        size[count] = fabsl(out[count]);
        for (int c = 0; c < 3; ++c) {
            out[count] += v->planes[i][c] * ((wide)v->eye[c] + d[c]);
            size[count] += fabsl(v->planes[i][c]) * (fabsl(v->eye[c]) + fabsl(d[c]));
        }
        count++;
    }
    return count;
}

/* The least value of any plane over its size, 0 if none is negative beyond this arithmetic. */
static wide outside_by(const umb_view *v, const wide d[3])
{
    wide values[16], size[16], worst = 0;
    uint32_t count = plane_values(v, d, values, size);
    for (uint32_t i = 0; i < count; ++i) {
        wide blur = 0x1p-61L * size[i];
        worst = values[i] < -blur ? fmaxl(worst, -values[i] / size[i]) : worst;
    }
    return worst;
}

/* The culler's own test never calls a box around the point outside. */
static bool box_is_kept(const umb_frustum *f, const umb_view *v, const wide d[3])
{
    umb_aabb box;
    uint16_t left[8];
    for (int i = 0; i < 3; ++i) {
        wide p = (wide)v->eye[i] + d[i];
        float at = (float)p;
        box.min[i] = (wide)at > p ? nextafterf(at, -INFINITY) : at;
        box.max[i] = (wide)at < p ? nextafterf(at, INFINITY) : at;
    }
    umb_node node = node_of(&box, 1);
    return (umb_frustum_test_node(f, umb_box_kernels_get(UMB_ISA_AUTO), &node, f->all_planes, NULL,
                                  left) &
            1u) == 0;
}

static void assert_holds(const umb_view *v, const umb_frustum *f, const wide d[3], const char *what)
{
    wide by = outside_by(v, d);
    if (by > 0) {
        fail_msg("%s: a point lies outside by %Lg of its size", what, by);
    }
    if (!box_is_kept(f, v, d)) {
        fail_msg("%s: a box around a point was called outside", what);
    }
}

static void random_direction(uint64_t *seed, double out[3])
{
    do {
        for (int i = 0; i < 3; ++i) {
            out[i] = random_in(seed, -1.0, 1.0);
        }
    } while (out[0] * out[0] + out[1] * out[1] + out[2] * out[2] < 0.01);
    if (random_below(seed, 4) == 0) { /* along an axis, or in a coordinate plane */
        out[random_below(seed, 3)] = 0.0;
        out[random_below(seed, 3)] = 0.0;
        out[random_below(seed, 3)] = 1.0;
    }
}

static void unit_wide(const double a[3], wide out[3])
{
    widen3(a, out);
    wide length = sqrtl(wide_dot(out, out));
    for (int i = 0; i < 3; ++i) {
        out[i] /= length;
    }
}

/* ---- spot ------------------------------------------------------------------------------------ */

/* A unit vector at a right angle to the unit vector a. */
static void random_across(uint64_t *seed, const wide a[3], wide out[3])
{
    double other[3];
    wide length;
    do {
        random_direction(seed, other);
        wide o[3], along;
        widen3(other, o);
        along = wide_dot(o, a);
        for (int i = 0; i < 3; ++i) {
            out[i] = o[i] - along * a[i];
        }
        length = sqrtl(wide_dot(out, out));
    } while (length < 0.01L);
    for (int i = 0; i < 3; ++i) {
        out[i] /= length;
    }
}

static void test_spot(void **state)
{
    (void)state;
    uint64_t seed = 21;
    static const double zero[3] = {0, 0, 0};
    for (int n = 0; n < 2000; ++n) {
        umb_spot_def def = {.near_depth = 0.0};
        double scale = pow(10.0, random_in(&seed, -3, 7));
        for (int i = 0; i < 3; ++i) {
            def.eye[i] = random_in(&seed, -scale, scale);
            def.up[i] = zero[i];
        }
        random_direction(&seed, def.direction);
        if (random_below(&seed, 2) == 0) {
            random_direction(&seed, def.up);
        }
        def.angle = random_below(&seed, 4) == 0 ? PI - pow(10.0, random_in(&seed, -4.9, -1))
                                                : pow(10.0, random_in(&seed, -4, 0.49));
        def.range = pow(10.0, random_in(&seed, -2, 5));
        def.near_depth = def.range * pow(10.0, random_in(&seed, -4, -0.5));
        umb_view v;
        umb_error error;
        assert_int_equal(umb_view_spot(&v, &def, &error), UMB_OK);
        double t = tan(0.5 * def.angle);
        assert_true(v.x_max <= t * (1 + 1e-9) + 1e-9 * (1 + t * t * 1e-4));
        assert_int_equal(v.plane_count, 4);
        umb_frustum f;
        umb_frustum_prepare(&f, &v);
        wide axis[3], across[3], d[3];
        unit_wide(def.direction, axis);
        for (int k = 0; k < 40; ++k) {
            random_across(&seed, axis, across);
            wide half = 0.5L * def.angle;
            wide a = random_below(&seed, 3) == 0 ? half * random_in(&seed, 0, 1) : half;
            wide reach = random_below(&seed, 3) == 0 ? (wide)def.range
                                                     : def.range * (wide)random_in(&seed, 0, 1);
            for (int i = 0; i < 3; ++i) {
                d[i] = reach * (cosl(a) * axis[i] + sinl(a) * across[i]);
            }
            wide fwd[3];
            widen3(v.forward, fwd);
            if (wide_dot(fwd, d) >= def.near_depth) {
                assert_holds(&v, &f, d, "spot");
            }
        }
    }
}

/* An octagon's area in place of a square's: the corners of the pyramid are cut off. */
static void test_spot_is_octagon(void **state)
{
    (void)state;
    umb_spot_def def = {
        .direction = {0, 0, -1}, .up = {0, 1, 0}, .angle = PI / 2, .near_depth = 1, .range = 10};
    umb_view v;
    assert_int_equal(umb_view_spot(&v, &def, NULL), UMB_OK);
    uint64_t seed = 5;
    uint32_t inside = 0;
    for (int k = 0; k < 100000; ++k) {
        wide d[3] = {random_in(&seed, -5, 5), random_in(&seed, -5, 5), -5};
        inside += outside_by(&v, d) == 0;
    }
    assert_true(fabs(inside / 100000.0 - 2 * (sqrt(2.0) - 1)) < 0.006); /* 8 tan(pi/8) / 4 */
}

/* ---- cube map -------------------------------------------------------------------------------- */

static void test_cube(void **state)
{
    (void)state;
    uint64_t seed = 22;
    for (int n = 0; n < 300; ++n) {
        double scale = pow(10.0, random_in(&seed, -3, 7)), eye[3];
        double near_depth = pow(10.0, random_in(&seed, -3, 0));
        double far_depth = random_below(&seed, 3) == 0 ? INFINITY : near_depth * 100.0;
        for (int i = 0; i < 3; ++i) {
            eye[i] = random_in(&seed, -scale, scale);
        }
        umb_view v[6];
        umb_frustum f[6];
        for (int k = 0; k < 6; ++k) {
            assert_int_equal(
                umb_view_cube_face(&v[k], eye, (umb_cube_face)k, near_depth, far_depth, NULL),
                UMB_OK);
            umb_frustum_prepare(&f[k], &v[k]);
        }
        for (int m = 0; m < 100; ++m) {
            wide d[3];
            wide size = near_depth * powl(100.0L, random_in(&seed, 0, 1));
            size = random_below(&seed, 8) == 0 ? (wide)near_depth : size;
            for (int i = 0; i < 3; ++i) {
                d[i] = size * random_in(&seed, -1, 1);
            }
            d[random_below(&seed, 3)] = size;
            d[random_below(&seed, 3)] = random_below(&seed, 2) == 0 ? -size : size;
            int holders = 0;
            bool kept = false;
            for (int k = 0; k < 6; ++k) {
                wide values[16], sizes[16];
                bool in = true;
                uint32_t count = plane_values(&v[k], d, values, sizes);
                for (uint32_t i = 0; i < count; ++i) {
                    in = in && values[i] >= 0; /* exact: no tolerance */
                }
                holders += in;
                kept = kept || box_is_kept(&f[k], &v[k], d);
            }
            assert_true(holders >= 1 && holders <= 3);
            assert_true(kept);
        }
    }
}

/* The axes are those of the tables: a step along s is to the right, a step along t is down. */
static void test_cube_axes(void **state)
{
    (void)state;
    static const double zero[3] = {0, 0, 0};
    static const int s_axis[6] = {-3, 3, 1, 1, 1, -1}, t_axis[6] = {-2, -2, 3, -3, -2, -2};
    for (int k = 0; k < 6; ++k) {
        umb_view v;
        assert_int_equal(umb_view_cube_face(&v, zero, (umb_cube_face)k, 0.1, 10, NULL), UMB_OK);
        for (int i = 0; i < 3; ++i) {
            double s = s_axis[k] == i + 1 ? 1.0 : s_axis[k] == -(i + 1) ? -1.0 : 0.0;
            double t = t_axis[k] == i + 1 ? 1.0 : t_axis[k] == -(i + 1) ? -1.0 : 0.0;
            double forward = k / 2 == i ? (k % 2 == 0 ? 1.0 : -1.0) : 0.0;
            assert_true(v.right[i] == s && v.up[i] == -t && v.forward[i] == forward);
        }
    }
}

/* ---- sun ------------------------------------------------------------------------------------- */

/* The point at which the camera's coordinates are x, y, z (x, y relative to depth in
 * perspective), by Cramer's rule on its axes as they are. */
static void camera_point(const umb_view *c, wide x, wide y, wide z, wide d[3])
{
    wide r[3], u[3], f[3];
    widen3(c->right, r);
    widen3(c->up, u);
    widen3(c->forward, f);
    wide k = c->projection == UMB_PERSPECTIVE ? z : 1, det = 0;
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, m = (i + 2) % 3;
        det += r[i] * (u[j] * f[m] - u[m] * f[j]);
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, m = (i + 2) % 3;
        d[i] = (x * k * (u[j] * f[m] - u[m] * f[j]) + y * k * (f[j] * r[m] - f[m] * r[j]) +
                z * (r[j] * u[m] - r[m] * u[j])) /
               det;
    }
}

typedef struct sun_case {
    umb_view camera, view;
    umb_sun_def def;
    double z_min, z_max, scale;
} sun_case;

/* Cameras of all kinds; lights from anywhere, along the camera's axes, along its sides and
 * edges. */
static void make_sun(uint64_t *seed, sun_case *s)
{
    s->scale = pow(10.0, random_in(seed, -2, 5));
    s->camera = random_view(seed, s->scale);
    s->camera.plane_count = random_below(seed, 3) == 0 ? s->camera.plane_count : 0;
    if (random_below(seed, 3) == 0) { /* axes as far from right angles as is allowed */
        for (int i = 0; i < 3; ++i) {
            s->camera.right[i] += 2e-7 * s->camera.up[i] + 1e-7 * s->camera.forward[i];
        }
    }
    umb_view *c = &s->camera;
    double depth = c->far_depth < 1e30 ? c->far_depth - c->near_depth : s->scale;
    s->def = (umb_sun_def){.camera = c};
    s->z_min = c->near_depth + depth * random_in(seed, 0, 0.5);
    s->z_max = s->z_min + depth * random_in(seed, 0.01, 0.5);
    s->def.slice_near = s->z_min;
    s->def.slice_far = s->z_max;
    if (c->far_depth < 1e30 && random_below(seed, 3) == 0) {
        s->def.slice_near = s->def.slice_far = 0.0;
        s->z_min = c->near_depth;
        s->z_max = c->far_depth;
    }
    s->def.reach = random_below(seed, 4) == 0 ? 0.0 : s->scale * pow(10.0, random_in(seed, -2, 2));
    uint32_t special = random_below(seed, 8);
    wide d[3];
    random_direction(seed, s->def.direction);
    if (special == 0) {
        memcpy(s->def.direction, c->forward, sizeof c->forward);
    } else if (special == 1) {
        memcpy(s->def.direction, c->up, sizeof c->up);
    } else if (special == 2) { /* along a corner's ray */
        camera_point(c, c->x_min, c->y_max, s->z_max, d);
        for (int i = 0; i < 3; ++i) {
            s->def.direction[i] = (double)d[i];
        }
    } else if (special == 3) { /* in a side */
        camera_point(c, c->x_max, random_in(seed, c->y_min, c->y_max), s->z_max, d);
        for (int i = 0; i < 3; ++i) {
            s->def.direction[i] = -(double)d[i];
        }
    }
    if (random_below(seed, 2) == 0) {
        random_direction(seed, s->def.up);
    }
}

/* A point of the slice: first its corners, then on an edge, on a side or inside, as it falls. */
static void slice_point(uint64_t *seed, const sun_case *s, int number, wide d[3])
{
    double at[3];
    for (int i = 0; i < 3; ++i) {
        uint32_t where = number < 8 ? (uint32_t)number >> i & 1u : random_below(seed, 3);
        at[i] = where == 0 ? 0.0 : where == 1 ? 1.0 : random_in(seed, 0, 1);
    }
    const umb_view *c = &s->camera;
    wide x = at[0] == 1.0 ? (wide)c->x_max : c->x_min + at[0] * ((wide)c->x_max - c->x_min);
    wide y = at[1] == 1.0 ? (wide)c->y_max : c->y_min + at[1] * ((wide)c->y_max - c->y_min);
    wide z = at[2] == 1.0 ? (wide)s->z_max : s->z_min + at[2] * ((wide)s->z_max - s->z_min);
    camera_point(c, x, y, z, d);
}

static bool in_camera_planes(const umb_view *c, const wide d[3])
{
    for (uint32_t k = 0; k < c->plane_count; ++k) {
        wide g = c->planes[k][3];
        for (int i = 0; i < 3; ++i) {
            g += c->planes[k][i] * ((wide)c->eye[i] + d[i]);
        }
        if (g < 0) {
            return false;
        }
    }
    return true;
}

static void test_sun(void **state)
{
    (void)state;
    uint64_t seed = 23;
    uint32_t planes = 0, tested = 0;
    for (int n = 0; n < 3000; ++n) {
        sun_case s;
        umb_error error;
        make_sun(&seed, &s);
        if (umb_view_sun(&s.view, &s.def, &error) != UMB_OK) {
            fail_msg("%s", error.text);
        }
        planes += s.view.plane_count;
        umb_frustum f;
        umb_frustum_prepare(&f, &s.view);
        wide light[3], d[3], values[16], size[16], least[16];
        unit_wide(s.def.direction, light);
        for (int i = 0; i < 16; ++i) {
            least[i] = INFINITY;
        }
        uint32_t count = 0;
        for (int k = 0; k < 120; ++k) {
            slice_point(&seed, &s, k / 2, d);
            if (!in_camera_planes(&s.camera, d)) {
                continue;
            }
            wide back = k < 16                        ? (k % 2 == 0 ? 0 : (wide)s.def.reach)
                        : random_below(&seed, 3) == 0 ? s.def.reach * (wide)random_in(&seed, 0, 1)
                        : random_below(&seed, 2) == 0 ? (wide)s.def.reach
                                                      : 0;
            for (int i = 0; i < 3; ++i) {
                d[i] -= back * light[i];
            }
            assert_holds(&s.view, &f, d, "sun");
            ++tested;
            count = plane_values(&s.view, d, values, size);
            for (uint32_t i = 0; i < count; ++i) {
                least[i] = fminl(least[i], values[i] / size[i]);
            }
        }
        /* Every side and plane touches what it holds. */
        for (uint32_t i = 0; i < count && s.camera.plane_count == 0; ++i) {
            if (!(least[i] < 1e-7L)) {
                fail_msg("case %d: plane %u stays %Lg away", n, i, least[i]);
            }
        }
    }
    printf("# %u points, %.2f extra planes a view\n", tested, planes / 3000.0);
    assert_true(tested > 100000);
}

/* Does the line from d along the light meet the slice, its sides moved outwards by room? */
static bool casts(const sun_case *s, const wide d[3], const wide light[3], wide room)
{
    umb_view c = s->camera;
    c.near_depth = s->z_min;
    c.far_depth = s->z_max;
    c.plane_count = 0;
    wide at[16], next[16], size[16], to[3], low = 0, high = INFINITY;
    for (int i = 0; i < 3; ++i) {
        to[i] = d[i] + light[i];
    }
    plane_values(&c, d, at, size);
    plane_values(&c, to, next, size);
    for (int i = 0; i < 6; ++i) {
        wide slope = next[i] - at[i], value = at[i] + room;
        if (slope > 0) {
            low = fmaxl(low, -value / slope);
        } else if (slope < 0) {
            high = fminl(high, value / -slope);
        } else if (value < 0) {
            return false;
        }
    }
    return low <= high;
}

/* The view is the sweep itself, cut by its near plane only: what it holds casts into the slice. */
static void test_sun_is_tight(void **state)
{
    (void)state;
    uint64_t seed = 24;
    uint32_t inside = 0, full = 0;
    for (int n = 0; n < 500; ++n) {
        sun_case s;
        make_sun(&seed, &s);
        s.camera.plane_count = 0;
        assert_int_equal(umb_view_sun(&s.view, &s.def, NULL), UMB_OK);
        full += s.view.plane_count == UMB_MAX_CLIP_PLANES;
        wide light[3], d[3];
        unit_wide(s.def.direction, light);
        double size = fabs(s.z_max) + fabs(s.view.near_depth) + s.scale;
        for (int k = 0; k < 200; ++k) {
            camera_point(&s.view, random_in(&seed, s.view.x_min, s.view.x_max),
                         random_in(&seed, s.view.y_min, s.view.y_max),
                         random_in(&seed, s.view.near_depth, s.view.far_depth), d);
            if (outside_by(&s.view, d) == 0) {
                ++inside;
                assert_true(casts(&s, d, light, 1e-5L * size));
            }
        }
    }
    printf("# %u points inside, %u views with all extra planes in use\n", inside, full);
    assert_true(inside > 20000);
}

/* ---- volumes --------------------------------------------------------------------------------- */

typedef struct volume_case {
    double planes[UMB_MAX_VOLUME_PLANES][4];
    umb_volume_def def;
    double middle[3], size;
} volume_case;

/* Planes around a middle, at very different distances, of any length; some doubled, some nearly
 * so. */
static void make_volume(uint64_t *seed, volume_case *c)
{
    double scale = pow(10.0, random_in(seed, -2, 6));
    c->size = scale * pow(10.0, random_in(seed, -4, 0));
    for (int i = 0; i < 3; ++i) {
        c->middle[i] = random_in(seed, -scale, scale);
    }
    uint32_t count = 4 + random_below(seed, UMB_MAX_VOLUME_PLANES - 3);
    for (uint32_t k = 0; k < count; ++k) {
        double n[3], length = random_power(seed, -3, 3);
        random_direction(seed, n);
        if (k > 0 && random_below(seed, 6) == 0) {
            double tilt = random_below(seed, 2) == 0 ? 0.0 : pow(10.0, random_in(seed, -16, -4));
            for (int i = 0; i < 3; ++i) {
                n[i] = c->planes[k - 1][i] + tilt * n[i];
            }
            length = 1.0;
        }
        double away = 0.0, at = 0.0;
        for (int i = 0; i < 3; ++i) {
            c->planes[k][i] = n[i] * fabs(length);
            away += c->planes[k][i] * c->planes[k][i];
            at += c->planes[k][i] * c->middle[i];
        }
        c->planes[k][3] = c->size * sqrt(away) * random_in(seed, 0.1, 1.0) - at;
    }
    c->def = (umb_volume_def){.planes = c->planes, .plane_count = count};
    double direction[3];
    random_direction(seed, direction);
    if (random_below(seed, 2) == 0) {
        c->def.projection = UMB_ORTHOGRAPHIC;
        memcpy(c->def.forward, direction, sizeof direction);
    } else {
        double away = c->size * pow(10.0, random_in(seed, 0.3, 3));
        for (int i = 0; i < 3; ++i) {
            c->def.eye[i] = c->middle[i] - away * direction[i];
        }
        if (random_below(seed, 2) == 0) {
            memcpy(c->def.forward, direction, sizeof direction);
        }
    }
    if (random_below(seed, 2) == 0) {
        random_direction(seed, c->def.up);
    }
}

static wide plane_at(const double p[4], const wide x[3])
{
    return p[0] * x[0] + p[1] * x[1] + p[2] * x[2] + p[3];
}

/* From the middle in some direction to where the polyhedron ends. */
static bool border_point(uint64_t *seed, const volume_case *c, wide out[3])
{
    double direction[3];
    wide d[3], from[3], least = INFINITY;
    random_direction(seed, direction);
    widen3(direction, d);
    widen3(c->middle, from);
    for (uint32_t k = 0; k < c->def.plane_count; ++k) {
        const double *p = c->planes[k];
        wide fall = -(p[0] * d[0] + p[1] * d[1] + p[2] * d[2]);
        if (fall > 0) {
            least = fminl(least, plane_at(p, from) / fall);
        }
    }
    for (int i = 0; i < 3; ++i) {
        out[i] = from[i] + least * d[i];
    }
    return !isinf(least);
}

static void test_volume(void **state)
{
    (void)state;
    uint64_t seed = 25;
    uint32_t made = 0, refused = 0, extra = 0;
    for (int n = 0; n < 1500; ++n) {
        volume_case c;
        umb_view v;
        umb_error error;
        make_volume(&seed, &c);
        if (umb_view_from_volume(&v, &c.def, &error) != UMB_OK) {
            ++refused; /* open to infinity, or around the eye: as it falls; never empty */
            assert_null(strstr(error.text, "no point"));
            continue;
        }
        ++made;
        extra += v.plane_count;
        umb_frustum f;
        umb_frustum_prepare(&f, &v);
        for (int k = 0; k < 60; ++k) {
            wide p[3], d[3];
            assert_true(border_point(&seed, &c, p));
            for (int i = 0; i < 3; ++i) {
                d[i] = p[i] - v.eye[i];
            }
            assert_holds(&v, &f, d, "volume");
        }
    }
    printf("# %u volumes, %u refused, %.2f extra planes each\n", made, refused,
           (double)extra / made);
    assert_true(made > 700);
}

/* Corners of the polyhedron, each by three planes, in wide arithmetic. */
static uint32_t wide_corners(const volume_case *c, wide out[64][3])
{
    uint32_t count = 0, n = c->def.plane_count;
    for (uint32_t a = 0; a < n; ++a) {
        for (uint32_t b = a + 1; b < n; ++b) {
            for (uint32_t e = b + 1; e < n && count < 64; ++e) {
                const double *p[3] = {c->planes[a], c->planes[b], c->planes[e]};
                wide det = 0, x[3] = {0, 0, 0};
                for (int i = 0; i < 3; ++i) {
                    int j = (i + 1) % 3, k = (i + 2) % 3;
                    const double *q = p[(i + 1) % 3], *r = p[(i + 2) % 3];
                    det += p[0][i] * ((wide)p[1][j] * p[2][k] - (wide)p[1][k] * p[2][j]);
                    for (int m = 0; m < 3; ++m) {
                        int s = (m + 1) % 3, t = (m + 2) % 3;
                        x[m] -= p[i][3] * ((wide)q[s] * r[t] - (wide)q[t] * r[s]);
                    }
                }
                bool inside = det != 0;
                for (uint32_t m = 0; inside && m < n; ++m) {
                    wide at[3] = {x[0] / det, x[1] / det, x[2] / det};
                    const double *q = c->planes[m];
                    wide length = sqrtl((wide)q[0] * q[0] + (wide)q[1] * q[1] + (wide)q[2] * q[2]);
                    inside = plane_at(q, at) >= -1e-9L * c->size * length;
                }
                for (int m = 0; inside && m < 3; ++m) {
                    out[count][m] = x[m] / det;
                }
                count += inside;
            }
        }
    }
    return count;
}

/* All six sides touch the polyhedron, and whatever the view holds is in it unless planes were
 * left out. */
static void test_volume_is_tight(void **state)
{
    (void)state;
    uint64_t seed = 26;
    uint32_t made = 0, inside = 0;
    for (int n = 0; n < 2500; ++n) {
        volume_case c;
        umb_view v;
        make_volume(&seed, &c);
        bool plain = true; /* corners of nearly parallel planes are known too badly */
        for (uint32_t k = 1; k < c.def.plane_count; ++k) {
            wide cross = 0, length = 0;
            for (int i = 0; i < 3; ++i) {
                int j = (i + 1) % 3, m = (i + 2) % 3;
                const double *p = c.planes[k], *q = c.planes[k - 1];
                cross += powl((wide)p[j] * q[m] - (wide)p[m] * q[j], 2);
                length += (wide)p[i] * p[i] * q[i] * q[i];
            }
            plain = plain && cross > 1e-6L * length;
        }
        if (!plain || umb_view_from_volume(&v, &c.def, NULL) != UMB_OK) {
            continue;
        }
        ++made;
        wide corners[64][3], least[16], values[16], size[16];
        uint32_t corner_count = wide_corners(&c, corners);
        for (int i = 0; i < 6; ++i) {
            least[i] = INFINITY;
        }
        for (uint32_t k = 0; k < corner_count; ++k) {
            wide d[3];
            for (int i = 0; i < 3; ++i) {
                d[i] = corners[k][i] - v.eye[i];
            }
            plane_values(&v, d, values, size);
            for (int i = 0; i < 6; ++i) {
                least[i] = fminl(least[i], values[i] / (size[i] + c.size));
            }
        }
        for (int i = 0; i < 6; ++i) {
            if (!(least[i] < 1e-7L)) {
                fail_msg("case %d: side %d stays %Lg away", n, i, least[i]);
            }
        }
        for (int k = 0; k < 50 && v.plane_count < UMB_MAX_CLIP_PLANES; ++k) {
            wide d[3], p[3];
            camera_point(&v, random_in(&seed, v.x_min, v.x_max), random_in(&seed, v.y_min, v.y_max),
                         random_in(&seed, v.near_depth, v.far_depth), d);
            if (outside_by(&v, d) > 0) {
                continue;
            }
            ++inside;
            for (int i = 0; i < 3; ++i) {
                p[i] = v.eye[i] + d[i];
            }
            for (uint32_t m = 0; m < c.def.plane_count; ++m) {
                const double *q = c.planes[m];
                wide length = sqrtl((wide)q[0] * q[0] + (wide)q[1] * q[1] + (wide)q[2] * q[2]);
                assert_true(plane_at(q, p) >= -1e-6L * (c.size + fabsl(v.far_depth)) * length);
            }
        }
    }
    printf("# %u volumes, %u points inside\n", made, inside);
    assert_true(made > 300 && inside > 2000);
}

static void assert_near(double a, double b, double size)
{
    if (!(fabs(a - b) <= 1e-11 * size)) {
        fail_msg("%.17g is not %.17g", a, b);
    }
}

/* A view's own planes give the view back, with its axes or without them, and no extra plane. */
static void test_volume_of_view(void **state)
{
    (void)state;
    uint64_t seed = 27;
    for (int n = 0; n < 500; ++n) {
        umb_view v = random_view(&seed, 10.0), out;
        v.far_depth = v.far_depth < 1e30 ? v.far_depth : v.near_depth + 10.0;
        v.plane_count = 0;
        double planes[16][4];
        umb_volume_def def = {.planes = planes,
                              .plane_count = umb_view_planes(&v, planes),
                              .projection = v.projection};
        memcpy(def.eye, v.eye, sizeof v.eye);
        memcpy(def.forward, v.forward, sizeof v.forward);
        memcpy(def.up, v.up, sizeof v.up);
        assert_int_equal(umb_view_from_volume(&out, &def, NULL), UMB_OK);
        assert_int_equal(out.plane_count, 0);
        double size = 1e3 * (1.0 + fabs(v.x_min) + fabs(v.x_max) + fabs(v.y_min) + fabs(v.y_max));
        assert_near(out.x_max - out.x_min, v.x_max - v.x_min, size);
        assert_near(out.y_max - out.y_min, v.y_max - v.y_min, size);
        assert_near(out.far_depth - out.near_depth, v.far_depth - v.near_depth, size);
        memset(def.up, 0, sizeof def.up);
        if (v.projection == UMB_PERSPECTIVE) {
            memset(def.forward, 0, sizeof def.forward);
        }
        assert_int_equal(umb_view_from_volume(&out, &def, NULL), UMB_OK);
        double k = v.projection == UMB_PERSPECTIVE ? 1.0 : 0.0;
        double was = (v.x_max - v.x_min) * (v.y_max - v.y_min) *
                     (k * (pow(v.far_depth, 3) - pow(v.near_depth, 3)) + 1.0 - k);
        double is = (out.x_max - out.x_min) * (out.y_max - out.y_min) *
                    (k * (pow(out.far_depth, 3) - pow(out.near_depth, 3)) + 1.0 - k);
        assert_true(is <= was * (1.0 + 1e-9));
    }
}

/* ---- refusals -------------------------------------------------------------------------------- */

static void refuse_volume(double (*planes)[4], uint32_t count, const char *word)
{
    umb_view v, before;
    umb_error error = {0};
    memset(&v, 0x55, sizeof v);
    before = v;
    umb_volume_def def = {.planes = (const double(*)[4])planes, .plane_count = count};
    assert_int_equal(umb_view_from_volume(&v, &def, &error), UMB_ERROR_ARGUMENT);
    if (strstr(error.text, word) == NULL) {
        fail_msg("'%s' does not say '%s'", error.text, word);
    }
    assert_memory_equal(&v, &before, sizeof v);
}

/* A box in front of the eye, along +z. */
static const double CRATE[6][4] = {{1, 0, 0, 1},  {-1, 0, 0, 1}, {0, 1, 0, 1},
                                   {0, -1, 0, 1}, {0, 0, 1, -2}, {0, 0, -1, 4}};

static void test_impossible_volumes(void **state)
{
    (void)state;
    double p[16][4];
    memcpy(p, CRATE, sizeof CRATE);
    refuse_volume(p, 5, "infinity"); /* no far plane */
    refuse_volume(p, 3, "4 to 16");
    refuse_volume(p, 17, "4 to 16");
    p[5][3] = 1.99; /* far before near */
    refuse_volume(p, 6, "no point in common");
    memcpy(p, CRATE, sizeof CRATE);
    memcpy(p[6], (double[4]){1, 1, 0, -2.01}, sizeof p[6]); /* beyond an edge */
    refuse_volume(p, 7, "no point in common");
    memcpy(p[6], (double[4]){1, 1, 1, -6.01}, sizeof p[6]); /* beyond a corner */
    refuse_volume(p, 7, "no point in common");
    memcpy(p[6], (double[4]){0, 0, 0, 1}, sizeof p[6]);
    refuse_volume(p, 7, "normal");
    memcpy(p[6], (double[4]){NAN, 0, 1, 1}, sizeof p[6]);
    refuse_volume(p, 7, "finite");
    p[4][3] = 0.5; /* the eye is inside */
    refuse_volume(p, 6, "in front of the eye");
    memcpy(p, (double[4][4]){{1, 0, 0, -1}, {0, 1, 0, -1}, {0, 0, 1, -1}, {-1, -1, -1, 2.9}},
           sizeof(double[4][4])); /* a tetrahedron inside out */
    refuse_volume(p, 4, "no point in common");
    p[3][3] = 3.0; /* a single point */
    umb_view v;
    umb_volume_def def = {.planes = (const double(*)[4])p, .plane_count = 4};
    assert_int_equal(umb_view_from_volume(&v, &def, NULL), UMB_OK);
    def.projection = UMB_ORTHOGRAPHIC;
    assert_int_equal(umb_view_from_volume(&v, &def, NULL), UMB_ERROR_ARGUMENT); /* no forward */
    def.forward[1] = 1.0;
    assert_int_equal(umb_view_from_volume(&v, &def, NULL), UMB_OK);
    def.forward[1] = NAN;
    assert_int_equal(umb_view_from_volume(&v, &def, NULL), UMB_ERROR_ARGUMENT);
}

#define REFUSE(call, change)                                                                       \
    {                                                                                              \
        change;                                                                                    \
        memset(&v, 0x55, sizeof v);                                                                \
        before = v;                                                                                \
        assert_int_equal(call, UMB_ERROR_ARGUMENT);                                                \
        assert_true(error.text[0] != '\0');                                                        \
        assert_memory_equal(&v, &before, sizeof v);                                                \
    }

/* The vertical is what was said of it, never an axis that was only chosen. */
static void test_vertical(void **state)
{
    (void)state;
    static const double eye[3] = {0, 0, 0}, target[3] = {0, -1, 1}, up[3] = {0, 3, 0};
    umb_view camera, v;
    assert_int_equal(umb_view_look_at(&camera, eye, target, up, 1, 1, 0.1, 10), UMB_OK);
    umb_spot_def spot = {.direction = {0, -1, 1}, .angle = 1, .near_depth = 0.1, .range = 10};
    umb_sun_def sun = {.camera = &camera, .direction = {1, -1, 0}, .reach = 5};
    umb_volume_def volume = {.planes = CRATE, .plane_count = 6};
    for (int given = 0; given < 2; ++given) {
        assert_int_equal(umb_view_spot(&v, &spot, NULL), UMB_OK);
        assert_true(v.vertical[0] == 0.0 && v.vertical[1] == given && v.vertical[2] == 0.0);
        assert_int_equal(umb_view_from_volume(&v, &volume, NULL), UMB_OK);
        assert_true(v.vertical[0] == 0.0 && v.vertical[1] == given && v.vertical[2] == 0.0);
        assert_int_equal(umb_view_sun(&v, &sun, NULL), UMB_OK);
        assert_memory_equal(v.vertical, camera.vertical, sizeof v.vertical);
        memcpy(spot.up, up, sizeof up);
        memcpy(volume.up, up, sizeof up);
        sun.up[2] = 1.0;
    }
}

static void test_impossible_lights(void **state)
{
    (void)state;
    umb_view v, before, camera;
    umb_error error;
    const umb_spot_def good = {.direction = {0, 0, 1}, .angle = 1, .near_depth = 0.1, .range = 10};
    umb_spot_def spot;
    REFUSE(umb_view_spot(&v, &spot, &error), (spot = good, spot.direction[2] = 0))
    REFUSE(umb_view_spot(&v, &spot, &error), (spot = good, spot.direction[0] = NAN))
    REFUSE(umb_view_spot(&v, &spot, &error), (spot = good, spot.angle = 0))
    REFUSE(umb_view_spot(&v, &spot, &error), (spot = good, spot.angle = PI))
    REFUSE(umb_view_spot(&v, &spot, &error), (spot = good, spot.range = 0.1))
    REFUSE(umb_view_spot(&v, &spot, &error), (spot = good, spot.range = INFINITY))
    REFUSE(umb_view_spot(&v, &spot, &error), (spot = good, spot.near_depth = 0))
    REFUSE(umb_view_spot(&v, &spot, &error), (spot = good, spot.eye[1] = NAN))
    static const double eye[3] = {0, 0, 0}, target[3] = {0, 0, 1}, up[3] = {0, 1, 0};
    REFUSE(umb_view_cube_face(&v, eye, (umb_cube_face)6, 1, 2, &error), (void)0)
    REFUSE(umb_view_cube_face(&v, eye, UMB_CUBE_POSITIVE_X, 0, 2, &error), (void)0)
    REFUSE(umb_view_cube_face(&v, eye, UMB_CUBE_POSITIVE_X, 2, 2, &error), (void)0)
    umb_sun_def sun;
    const umb_sun_def plain = {.camera = &camera, .direction = {0, -1, 0}, .reach = 5};
    assert_int_equal(umb_view_look_at(&camera, eye, target, up, 1, 1, 0.1, INFINITY), UMB_OK);
    REFUSE(umb_view_sun(&v, &sun, &error), sun = plain) /* endless */
    REFUSE(umb_view_sun(&v, &sun, &error), (sun.slice_near = 5, sun.slice_far = 4))
    REFUSE(umb_view_sun(&v, &sun, &error), sun.slice_far = NAN)
    REFUSE(umb_view_sun(&v, &sun, &error), (sun.slice_far = 6, sun.reach = -1))
    REFUSE(umb_view_sun(&v, &sun, &error), (sun.reach = 1, sun.direction[1] = 0))
    REFUSE(umb_view_sun(&v, &sun, &error), (sun = plain, sun.slice_far = 6, camera.x_max = NAN))
}

/* Any number at all: bit patterns, powers of ten, plain ones. */
static double any_number(uint64_t *seed)
{
    static const double special[] = {0.0, -0.0, 1.0, -1.0, 1e30, -1e30, 1e-30, 1e300, 5e-324};
    union {
        uint64_t bits;
        double value;
    } u = {random_next(seed)};
    switch (random_below(seed, 5)) {
    case 0:
        return u.value;
    case 1:
        return special[random_below(seed, sizeof special / sizeof special[0])];
    case 2:
        return random_power(seed, -40, 40);
    default:
        return random_in(seed, -2.0, 2.0);
    }
}

static void any_numbers(uint64_t *seed, double *out, int count)
{
    for (int i = 0; i < count; ++i) {
        out[i] = any_number(seed);
    }
}

/* Whatever goes in, what comes out is a view, or nothing at all. */
static void test_absurd_numbers(void **state)
{
    (void)state;
    uint64_t seed = 28;
    uint32_t made[4] = {0, 0, 0, 0};
    for (int n = 0; n < 40000; ++n) {
        umb_view camera = random_view(&seed, 10.0), out = camera;
        double p[UMB_MAX_VOLUME_PLANES][4], numbers[8];
        any_numbers(&seed, numbers, 8);
        umb_spot_def spot = {.angle = numbers[0], .near_depth = numbers[1], .range = numbers[2]};
        any_numbers(&seed, spot.eye, 3);
        any_numbers(&seed, spot.direction, 3);
        any_numbers(&seed, spot.up, 3);
        made[0] += umb_view_spot(&out, &spot, NULL) == UMB_OK;
        assert_int_equal(umb_view_check(&out, NULL), UMB_OK);
        made[1] += umb_view_cube_face(&out, spot.eye, (umb_cube_face)random_below(&seed, 7),
                                      numbers[1], numbers[2], NULL) == UMB_OK;
        assert_int_equal(umb_view_check(&out, NULL), UMB_OK);
        umb_sun_def sun = {.camera = &camera,
                           .slice_near = numbers[3],
                           .slice_far = numbers[4],
                           .reach = numbers[5]};
        any_numbers(&seed, sun.direction, 3);
        any_numbers(&seed, sun.up, 3);
        double *changed[3] = {&camera.x_min, &camera.far_depth, &camera.eye[1]};
        *changed[random_below(&seed, 3)] = numbers[6];
        made[2] += umb_view_sun(&out, &sun, NULL) == UMB_OK;
        assert_int_equal(umb_view_check(&out, NULL), UMB_OK);
        umb_volume_def volume = {.planes = (const double(*)[4])p,
                                 .plane_count = random_below(&seed, 9),
                                 .projection = (umb_projection)random_below(&seed, 3)};
        any_numbers(&seed, p[0], 9 * 4);
        any_numbers(&seed, volume.eye, 3);
        any_numbers(&seed, volume.forward, random_below(&seed, 2) == 0 ? 3 : 0);
        any_numbers(&seed, volume.up, random_below(&seed, 2) == 0 ? 3 : 0);
        made[3] += umb_view_from_volume(&out, &volume, NULL) == UMB_OK;
        assert_int_equal(umb_view_check(&out, NULL), UMB_OK);
    }
    printf("# views made of absurd numbers: %u spots, %u faces, %u suns, %u volumes\n", made[0],
           made[1], made[2], made[3]);
    assert_true(made[0] > 100 && made[1] > 100 && made[2] > 100 && made[3] > 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_spot),
        cmocka_unit_test(test_spot_is_octagon),
        cmocka_unit_test(test_cube),
        cmocka_unit_test(test_cube_axes),
        cmocka_unit_test(test_sun),
        cmocka_unit_test(test_sun_is_tight),
        cmocka_unit_test(test_volume),
        cmocka_unit_test(test_volume_is_tight),
        cmocka_unit_test(test_volume_of_view),
        cmocka_unit_test(test_impossible_volumes),
        cmocka_unit_test(test_impossible_lights),
        cmocka_unit_test(test_absurd_numbers),
        cmocka_unit_test(test_vertical),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Views for lights: a spot's cone, a cube map's faces, the sun's part of a camera's frustum.
 *
 * u is 2^-53. Axes come from umb_view_aim(): unit vectors to within 8 u, forward f within 8 u
 * of the true direction D. How far right r and up v are off right angles is not assumed but
 * taken as computed.
 *
 * Spot. Let t be the tangent of half the angle, d a unit vector at an angle a from D with tan a
 * <= t. Then f.d >= cos a - 8u, and r.d <= |r.D| cos a + |r| sin a, so with e = |r.f| + 8u
 *
 *     r.d / f.d  <=  (e + (1 + 8u) t) / (1 - 8u / cos a)  <=  t + e + 16u (1 + t)^2 (1 + e) + 8u t
 *
 * as 1 / cos a <= 1 + t. The tangent itself is good to 8 units. For the diagonals (r + v) /
 * sqrt 2 the same holds with e for both axes and |r.v| t more, because their length is at most
 * 1 + 8u + |r.v|; the rounding of such a plane's normal, 4u (t + 2), shows as a slope of at
 * most 8u (1 + t)^2 more. spot_slope() takes 256 u (1 + t)^2. Range: f.d <= |f| |d|.
 *
 * Sun. A volume V is held by a half-space n.d + c >= 0 if c is at least the greatest value of
 * -n.d over V. V is the slice swept against D by up to `reach`, so that is the greatest over
 * the slice's eight corners, plus reach * max(0, n.D). So every normal gives a valid plane, and
 * how it was rounded does not matter: all care goes into c. The corners are those of the camera
 * as it is: with its axes as rows of a matrix, the columns R, U, F of the inverse, and x, y the
 * picture's bounds, d = z (x R + y U + F), or x R + y U + z F. The inverse's entries are off by
 * at most 8u (axes within 1e-6 of orthonormal), so a component of a corner by at most 16u (|X|
 * + |Y| + |z|), where X, Y, z are the factors; a product with n adds 4u of the same. slice.blur
 * is 64u of the largest such sum, so |n| blur covers it, |n| being the sum of absolute
 * components. */
#include "umbrage/light.h"

#include "base/memory.h"
#include "view_parts.h"

#define U 0x1p-53
#define LARGEST 1e30
#define PI 3.14159265358979323846

static double dot(const double a[3], const double b[3])
{
    return umb_vec3_dot(umb_vec3_from_double(a), umb_vec3_from_double(b));
}

static umb_result refuse(umb_error *error, const char *what, const char *why)
{
    return umb_error_set(error, UMB_ERROR_ARGUMENT, "impossible %s: %s", what, why);
}

static umb_result finish(umb_view *out, const umb_view *view, umb_error *error)
{
    umb_result result = umb_view_check(view, error);
    if (result == UMB_OK) {
        *out = *view;
    }
    return result;
}

/* ---- spot ------------------------------------------------------------------------------------ */

static double spot_slope(const umb_view *v, double angle)
{
    double t = tan(0.5 * angle);
    double square = fabs(dot(v->right, v->forward)) + fabs(dot(v->up, v->forward)) +
                    fabs(dot(v->right, v->up)) * (1.0 + t);
    return t + square + 256.0 * U * (1.0 + t) * (1.0 + t);
}

/* The four sides of the octagon that the pyramid does not have. */
static void cut_diagonals(umb_view *v, double slope)
{
    static const double half_root = 0.70710678118654752440;
    double planes[4][4];
    for (int k = 0; k < 4; ++k) {
        double n[3];
        for (int i = 0; i < 3; ++i) {
            double x = (k & 1) != 0 ? v->right[i] : -v->right[i];
            double y = (k & 2) != 0 ? v->up[i] : -v->up[i];
            n[i] = slope * v->forward[i] - half_root * (x + y);
        }
        umb_plane_from_eye(planes[k], umb_vec3_from_double(n), 0.0, v->eye);
    }
    umb_view_trim(v, planes, 4);
}

umb_result umb_view_spot(umb_view *out, const umb_spot_def *def, umb_error *error)
{
    umb_view view;
    if (umb_view_aim(&view, def->direction, def->up) != UMB_OK) {
        return refuse(error, "spot", "the direction must be finite and not zero, up finite");
    }
    if (!(def->angle > 0.0 && def->angle <= PI - 1e-5)) {
        return refuse(error, "spot", "the angle must be above 0 and below pi by at least 1e-5");
    }
    if (!(def->range > def->near_depth) || !(def->range <= LARGEST)) {
        return refuse(error, "spot", "the range must be above the near depth, at most 1e30");
    }
    for (int i = 0; i < 3; ++i) {
        view.eye[i] = def->eye[i];
    }
    view.projection = UMB_PERSPECTIVE;
    double slope = spot_slope(&view, def->angle);
    view.x_max = view.y_max = slope;
    view.x_min = view.y_min = -slope;
    view.near_depth = def->near_depth;
    view.far_depth = def->range * (1.0 + 16.0 * U);
    umb_result result = umb_view_check(&view, error);
    if (result == UMB_OK) {
        cut_diagonals(&view, slope);
        result = finish(out, &view, error);
    }
    return result;
}

/* ---- cube map -------------------------------------------------------------------------------- */

umb_result umb_view_cube_face(umb_view *out, const double eye[3], umb_cube_face face,
                              double near_depth, double far_depth, umb_error *error)
{
    static const double axes[6][3][3] = {
        {{0, 0, -1}, {0, 1, 0}, {1, 0, 0}}, {{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}},
        {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}, {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}},
        {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},  {{-1, 0, 0}, {0, 1, 0}, {0, 0, -1}},
    };
    if ((int)face < 0 || (int)face > 5) {
        return refuse(error, "cube face", "faces are 0 to 5");
    }
    umb_view view = {.projection = UMB_PERSPECTIVE,
                     .x_min = -1.0,
                     .x_max = 1.0,
                     .y_min = -1.0,
                     .y_max = 1.0,
                     .near_depth = near_depth,
                     .far_depth = far_depth};
    for (int i = 0; i < 3; ++i) {
        view.eye[i] = eye[i];
        view.right[i] = axes[face][0][i];
        view.up[i] = axes[face][1][i];
        view.forward[i] = axes[face][2][i];
    }
    return finish(out, &view, error);
}

/* ---- sun ------------------------------------------------------------------------------------- */

/* A slice of a camera's frustum, relative to its eye. Corner k has the greater x, y, z where
 * bits 0, 1, 2 are set. The sides' normals point inwards: the lesser and the greater x, y, z. */
typedef struct slice {
    umb_vec3 corners[8];
    umb_vec3 sides[6];
    double blur; /* per unit of a normal's absolute components: what a corner's value may be off */
} slice;

static void make_corners(const umb_view *camera, double z_min, double z_max, slice *s)
{
    umb_vec3 r = umb_vec3_from_double(camera->right), u = umb_vec3_from_double(camera->up);
    umb_vec3 f = umb_vec3_from_double(camera->forward);
    double det = umb_vec3_dot(r, umb_vec3_cross(u, f));
    umb_vec3 column[3] = {umb_vec3_scale(umb_vec3_cross(u, f), 1.0 / det),
                          umb_vec3_scale(umb_vec3_cross(f, r), 1.0 / det),
                          umb_vec3_scale(umb_vec3_cross(r, u), 1.0 / det)};
    double size = 0.0;
    for (int k = 0; k < 8; ++k) {
        double z = (k & 4) != 0 ? z_max : z_min;
        double scale = camera->projection == UMB_PERSPECTIVE ? z : 1.0;
        double x = scale * ((k & 1) != 0 ? camera->x_max : camera->x_min);
        double y = scale * ((k & 2) != 0 ? camera->y_max : camera->y_min);
        umb_vec3 d = umb_vec3_add(umb_vec3_scale(column[0], x), umb_vec3_scale(column[1], y));
        s->corners[k] = umb_vec3_add(d, umb_vec3_scale(column[2], z));
        size = fmax(size, fabs(x) + fabs(y) + fabs(z));
    }
    s->blur = 64.0 * U * size;
}

static umb_vec3 side_normal(const umb_view *camera, const double axis[3], double sign, double bound)
{
    umb_vec3 n = umb_vec3_scale(umb_vec3_from_double(axis), sign);
    if (camera->projection == UMB_PERSPECTIVE) {
        umb_vec3 f = umb_vec3_from_double(camera->forward);
        n = umb_vec3_sub(n, umb_vec3_scale(f, sign * bound));
    }
    return n;
}

static void make_slice(const umb_view *camera, double z_min, double z_max, slice *s)
{
    make_corners(camera, z_min, z_max, s);
    s->sides[0] = side_normal(camera, camera->right, 1.0, camera->x_min);
    s->sides[1] = side_normal(camera, camera->right, -1.0, camera->x_max);
    s->sides[2] = side_normal(camera, camera->up, 1.0, camera->y_min);
    s->sides[3] = side_normal(camera, camera->up, -1.0, camera->y_max);
    s->sides[4] = umb_vec3_from_double(camera->forward);
    s->sides[5] = umb_vec3_scale(s->sides[4], -1.0);
}

/* The least value of n.d over the slice, rounded down. */
static double least_along(const slice *s, umb_vec3 n)
{
    double least = INFINITY;
    for (int k = 0; k < 8; ++k) {
        least = fmin(least, umb_vec3_dot(n, s->corners[k]));
    }
    return least - umb_vec3_sum_abs(n) * s->blur;
}

/* The most that n.d falls along the way towards the light. forward is within 8u of the light's
 * direction; its product with n loses 4u more. */
static double fall(const umb_view *view, umb_vec3 n, double reach)
{
    double slope = umb_vec3_dot(n, umb_vec3_from_double(view->forward)) +
                   16.0 * U * umb_vec3_sum_abs(n);
    return slope > 0.0 ? slope * reach * (1.0 + 4.0 * U) : 0.0;
}

/* c such that n.d + c >= 0 holds the whole volume; the sum's own rounding included. */
static double hold(const umb_view *view, const slice *s, umb_vec3 n, double reach)
{
    double least = least_along(s, n), fallen = fall(view, n, reach);
    return fallen - least + 4.0 * U * (fabs(least) + fallen);
}

/* The rectangle and the depths. Along -forward nothing is gained towards the light, along
 * forward `reach` is. */
static void frame_slice(umb_view *view, const slice *s, double reach)
{
    umb_vec3 r = umb_vec3_from_double(view->right), u = umb_vec3_from_double(view->up);
    umb_vec3 f = umb_vec3_from_double(view->forward);
    view->x_min = -hold(view, s, r, reach);
    view->x_max = hold(view, s, umb_vec3_scale(r, -1.0), reach);
    view->y_min = -hold(view, s, u, reach);
    view->y_max = hold(view, s, umb_vec3_scale(u, -1.0), reach);
    view->near_depth = -hold(view, s, f, reach);
    view->far_depth = hold(view, s, umb_vec3_scale(f, -1.0), reach);
}

/* An edge of the slice: from the corner `from` along axis k, between a side of axis a and one
 * of axis b. */
typedef struct edge {
    int from, to, side[2];
} edge;

static edge slice_edge(int number)
{
    int k = number / 4, a = (k + 1) % 3, b = (k + 2) % 3;
    int i = number & 1, j = number >> 1 & 1;
    edge e = {i << a | j << b, i << a | j << b | 1 << k, {2 * a + i, 2 * b + j}};
    return e;
}

/* Edges of the outline as the light sees it: it enters through one of their sides and leaves
 * through the other. */
static bool is_outline(const slice *s, edge e, umb_vec3 forward)
{
    return (umb_vec3_dot(s->sides[e.side[0]], forward) > 0.0) !=
           (umb_vec3_dot(s->sides[e.side[1]], forward) > 0.0);
}

/* The normal of the plane along the light through an edge, turned to the slice's side. False
 * where the edge runs along the light. */
static bool outline_normal(const slice *s, edge e, umb_vec3 forward, umb_vec3 *out)
{
    umb_vec3 along = umb_vec3_sub(s->corners[e.to], s->corners[e.from]);
    double length = umb_vec3_length(along);
    umb_vec3 n = umb_vec3_cross(umb_vec3_scale(along, 1.0 / length), forward);
    if (!(umb_vec3_length(n) > 1e-9)) {
        return false;
    }
    umb_vec3 middle = umb_vec3_make(0.0, 0.0, 0.0);
    for (int k = 0; k < 8; ++k) {
        middle = umb_vec3_add(middle, umb_vec3_scale(s->corners[k], 0.125));
    }
    double side = umb_vec3_dot(n, umb_vec3_sub(middle, s->corners[e.from]));
    *out = umb_vec3_scale(n, side < 0.0 ? -1.0 : 1.0);
    return true;
}

enum { SIDES = 6, EDGES = 12, PLANES = SIDES + EDGES + UMB_MAX_CLIP_PLANES };

static void trim_to_sweep(umb_view *view, const umb_view *camera, const slice *s, double reach)
{
    umb_vec3 forward = umb_vec3_from_double(view->forward);
    double planes[PLANES][4];
    uint32_t count = 0;
    for (int k = 0; k < SIDES; ++k) {
        if (umb_vec3_dot(s->sides[k], forward) <= 0.0) {
            umb_plane_from_eye(planes[count++], s->sides[k], hold(view, s, s->sides[k], reach),
                               view->eye);
        }
    }
    for (int k = 0; k < EDGES; ++k) {
        edge e = slice_edge(k);
        umb_vec3 n;
        if (is_outline(s, e, forward) && outline_normal(s, e, forward, &n)) {
            umb_plane_from_eye(planes[count++], n, hold(view, s, n, reach), view->eye);
        }
    }
    for (uint32_t k = 0; k < camera->plane_count; ++k) {
        const double *p = camera->planes[k];
        umb_vec3 n = umb_vec3_from_double(p);
        if (umb_vec3_dot(n, forward) <= 0.0) {
            double more = fall(view, n, reach);
            for (int i = 0; i < 3; ++i) {
                planes[count][i] = p[i];
            }
            planes[count++][3] = p[3] + more + 4.0 * U * (fabs(p[3]) + more);
        }
    }
    umb_view_trim(view, planes, count);
}

/* With up left open: of the views turned along the outline's edges, the one with the least area. */
static void turn_for_area(umb_view *view, const umb_sun_def *def, const slice *s)
{
    umb_view best = *view;
    umb_vec3 forward = umb_vec3_from_double(view->forward);
    for (int k = 0; k < EDGES; ++k) {
        edge e = slice_edge(k);
        umb_vec3 n;
        umb_view trial;
        if (!is_outline(s, e, forward) || !outline_normal(s, e, forward, &n)) {
            continue;
        }
        const double up[3] = {n.x, n.y, n.z};
        if (umb_view_aim(&trial, def->direction, up) == UMB_OK) {
            frame_slice(&trial, s, def->reach);
            if ((trial.x_max - trial.x_min) * (trial.y_max - trial.y_min) <
                (best.x_max - best.x_min) * (best.y_max - best.y_min)) {
                best = trial;
            }
        }
    }
    *view = best;
}

static const char *slice_depths(const umb_sun_def *def, double *low, double *high)
{
    bool whole = def->slice_near == 0.0 && def->slice_far == 0.0;
    *low = whole ? def->camera->near_depth : fmax(def->slice_near, def->camera->near_depth);
    *high = whole ? def->camera->far_depth : fmin(def->slice_far, def->camera->far_depth);
    if (isnan(def->slice_near) || isnan(def->slice_far) || !(*low < *high)) {
        return "the slice must have a part of the camera's depths";
    }
    return *high <= LARGEST ? NULL : "the slice must end; give slice_far or a finite far";
}

umb_result umb_view_sun(umb_view *out, const umb_sun_def *def, umb_error *error)
{
    umb_view view;
    double low, high;
    umb_result result = umb_view_check(def->camera, error);
    if (result != UMB_OK) {
        return result;
    }
    if (umb_view_aim(&view, def->direction, def->up) != UMB_OK) {
        return refuse(error, "sun", "the direction must be finite and not zero, up finite");
    }
    if (!(def->reach >= 0.0 && def->reach <= LARGEST)) {
        return refuse(error, "sun", "the reach must be from 0 to 1e30");
    }
    const char *broken = slice_depths(def, &low, &high);
    if (broken != NULL) {
        return refuse(error, "sun", broken);
    }
    slice s;
    make_slice(def->camera, low, high, &s);
    frame_slice(&view, &s, def->reach);
    if (def->up[0] == 0.0 && def->up[1] == 0.0 && def->up[2] == 0.0) {
        turn_for_area(&view, def, &s);
    }
    for (int i = 0; i < 3; ++i) {
        view.eye[i] = def->camera->eye[i];
        view.vertical[i] = def->camera->vertical[i];
    }
    trim_to_sweep(&view, def->camera, &s, def->reach);
    return finish(out, &view, error);
}

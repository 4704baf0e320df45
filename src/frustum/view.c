/* Views: from an eye and a target, from a matrix, their rules and their planes. */
#include <math.h>
#include <string.h>

#include "base/memory.h"
#include "geometry/vec.h"
#include "umbrage/view.h"

/* Axes may be off unit length and right angles by this much (view.h). */
#define AXIS_TOLERANCE 1e-6
/* Nothing in a view is larger than this, and no extent is smaller than its inverse: reciprocals
 * stay inside the range of a float, squares and products inside that of a double. */
#define LARGEST 1e30

static bool all_finite(const double *v, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        if (!isfinite(v[i]) || fabs(v[i]) > LARGEST) {
            return false;
        }
    }
    return true;
}

static void store(double out[3], umb_vec3 v)
{
    out[0] = v.x;
    out[1] = v.y;
    out[2] = v.z;
}

/* Scale to unit length, first by the largest component so that no square over- or underflows. */
static bool normalize(umb_vec3 *v)
{
    double largest = fmax(fabs(v->x), fmax(fabs(v->y), fabs(v->z)));
    if (!(largest > 0.0) || !isfinite(largest)) {
        return false;
    }
    umb_vec3 s = umb_vec3_make(v->x / largest, v->y / largest, v->z / largest);
    double length = umb_vec3_length(s);
    *v = umb_vec3_make(s.x / length, s.y / length, s.z / length);
    return true;
}

/* ---- rules ---------------------------------------------------------------------------------- */

static const char *check_axes(const umb_view *view)
{
    const double *axis[3] = {view->right, view->up, view->forward};
    for (int i = 0; i < 3; ++i) {
        umb_vec3 a = umb_vec3_from_double(axis[i]);
        if (!all_finite(axis[i], 3) || !(fabs(umb_vec3_length(a) - 1.0) <= AXIS_TOLERANCE)) {
            return "right, up and forward must have unit length";
        }
        umb_vec3 b = umb_vec3_from_double(axis[(i + 1) % 3]);
        if (!(fabs(umb_vec3_dot(a, b)) <= AXIS_TOLERANCE)) {
            return "right, up and forward must be at right angles";
        }
    }
    return NULL;
}

static bool check_range(double low, double high)
{
    return fabs(low) <= LARGEST && fabs(high) <= LARGEST && high - low >= 1.0 / LARGEST &&
           high - low >= 1e-12 * (fabs(low) + fabs(high));
}

static const char *check_depths(const umb_view *view)
{
    double n = view->near_depth;
    double f = view->far_depth;
    if (view->projection == UMB_ORTHOGRAPHIC) {
        return check_range(n, f) ? NULL : "near must be less than far, both finite";
    }
    if (!(n >= 1.0 / LARGEST)) {
        return "near must be greater than zero";
    }
    if (!(n <= LARGEST) || !(f > n)) {
        return "far must be greater than near";
    }
    return f <= LARGEST || isinf(f) ? NULL : "far must be at most 1e30, or infinite";
}

static const char *check_extras(const umb_view *view)
{
    const double *v = view->vertical;
    double size = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    if (!all_finite(v, 3) || (size > 0.0 && size < 1.0 / LARGEST)) {
        return "vertical must be finite, and zero or not next to zero";
    }
    if ((view->width == 0) != (view->height == 0) ||
        (view->buffer_width == 0) != (view->buffer_height == 0)) {
        return "a picture's width and height are both given or both zero";
    }
    if (view->buffer_width > 8192 || view->buffer_height > 8192) {
        return "buffer_width and buffer_height must be at most 8192";
    }
    if (!(view->min_pixels >= 0.0 && view->min_pixels <= LARGEST)) {
        return "min_pixels must be zero or more";
    }
    if (view->plane_count > UMB_MAX_CLIP_PLANES) {
        return "at most 10 extra planes";
    }
    for (uint32_t i = 0; i < view->plane_count; ++i) {
        const double *p = view->planes[i];
        double largest = fmax(fabs(p[0]), fmax(fabs(p[1]), fabs(p[2])));
        if (!all_finite(p, 4) || largest < 1.0 / LARGEST) {
            return "an extra plane must be finite with a normal that is not zero";
        }
    }
    return isfinite(view->time) ? NULL : "time must be finite";
}

static const char *check(const umb_view *view)
{
    if (view->projection != UMB_PERSPECTIVE && view->projection != UMB_ORTHOGRAPHIC) {
        return "projection must be UMB_PERSPECTIVE or UMB_ORTHOGRAPHIC";
    }
    if (!all_finite(view->eye, 3)) {
        return "the eye must be finite, at most 1e30";
    }
    const char *broken = check_axes(view);
    if (broken == NULL && !check_range(view->x_min, view->x_max)) {
        broken = "x_min must be less than x_max, both finite";
    }
    if (broken == NULL && !check_range(view->y_min, view->y_max)) {
        broken = "y_min must be less than y_max, both finite";
    }
    if (broken == NULL) {
        broken = check_depths(view);
    }
    return broken != NULL ? broken : check_extras(view);
}

umb_result umb_view_check(const umb_view *view, umb_error *error)
{
    const char *broken = check(view);
    if (broken != NULL) {
        return umb_error_set(error, UMB_ERROR_ARGUMENT, "impossible view: %s", broken);
    }
    return UMB_OK;
}

/* ---- from an eye and a target --------------------------------------------------------------- */

/* The axis that stands in for up where the view runs along it: the one after up's largest
 * component. */
static umb_vec3 axis_after(umb_vec3 up)
{
    double x = fabs(up.x);
    double y = fabs(up.y);
    double z = fabs(up.z);
    if (x >= y && x >= z) {
        return umb_vec3_make(0.0, 1.0, 0.0);
    }
    return y >= z ? umb_vec3_make(0.0, 0.0, 1.0) : umb_vec3_make(1.0, 0.0, 0.0);
}

static bool aim(umb_view *v, const double eye[3], const double target[3], const double up[3])
{
    if (!all_finite(eye, 3) || !all_finite(target, 3) || !all_finite(up, 3)) {
        return false;
    }
    umb_vec3 f = umb_vec3_sub(umb_vec3_from_double(target), umb_vec3_from_double(eye));
    umb_vec3 u = umb_vec3_from_double(up);
    if (!normalize(&f) || !normalize(&u)) {
        return false;
    }
    umb_vec3 r = umb_vec3_cross(f, u);
    if (umb_vec3_dot(r, r) <= 1e-12) {
        r = umb_vec3_cross(f, axis_after(u));
    }
    if (!normalize(&r)) {
        return false;
    }
    umb_vec3 upright = umb_vec3_cross(r, f);
    normalize(&upright);
    memcpy(v->eye, eye, sizeof(v->eye));
    store(v->forward, f);
    store(v->right, r);
    store(v->up, upright);
    store(v->vertical, u);
    return true;
}

static umb_result finish(umb_view *out, umb_view *v, double half_height, double aspect,
                         double near_depth, double far_depth)
{
    if (!(half_height > 0.0) || !(aspect > 0.0)) {
        return UMB_ERROR_ARGUMENT;
    }
    v->x_max = half_height * aspect;
    v->x_min = -v->x_max;
    v->y_max = half_height;
    v->y_min = -half_height;
    v->near_depth = near_depth;
    v->far_depth = far_depth;
    umb_result result = umb_view_check(v, NULL);
    if (result == UMB_OK) {
        *out = *v;
    }
    return result;
}

umb_result umb_view_look_at(umb_view *out, const double eye[3], const double target[3],
                            const double up[3], double fov_y, double aspect, double near_depth,
                            double far_depth)
{
    umb_view v = {.projection = UMB_PERSPECTIVE};
    if (!(fov_y > 0.0 && fov_y < 3.14159265358979323846) || !aim(&v, eye, target, up)) {
        return UMB_ERROR_ARGUMENT;
    }
    return finish(out, &v, tan(0.5 * fov_y), aspect, near_depth, far_depth);
}

umb_result umb_view_look_at_ortho(umb_view *out, const double eye[3], const double target[3],
                                  const double up[3], double height, double aspect,
                                  double near_depth, double far_depth)
{
    umb_view v = {.projection = UMB_ORTHOGRAPHIC};
    if (!aim(&v, eye, target, up)) {
        return UMB_ERROR_ARGUMENT;
    }
    return finish(out, &v, 0.5 * height, aspect, near_depth, far_depth);
}

/* ---- from a matrix -------------------------------------------------------------------------- */

/* One row of a matrix as a function of a point: n.p + c. */
typedef struct row {
    umb_vec3 n;
    double c;
} row;

static double row_at(row r, umb_vec3 p)
{
    return umb_vec3_dot(r.n, p) + r.c;
}

static row row_sub(row a, row b)
{
    row r = {umb_vec3_sub(a.n, b.n), a.c - b.c};
    return r;
}

static bool read_rows(const umb_matrix_def *def, row rows[4])
{
    double largest = 0.0;
    for (int i = 0; i < 16; ++i) {
        if (!isfinite(def->m[i])) {
            return false;
        }
        largest = fmax(largest, fabs(def->m[i]));
    }
    if (!(largest > 0.0) || largest > LARGEST) {
        return false;
    }
    for (int i = 0; i < 4; ++i) {
        double v[4];
        for (int j = 0; j < 4; ++j) {
            v[j] = def->m[def->column_major ? 4 * j + i : 4 * i + j];
        }
        rows[i].n = umb_vec3_make(v[0], v[1], v[2]);
        rows[i].c = v[3];
    }
    return true;
}

/* The two half-spaces of the depth row, both >= 0 inside: beyond the near plane, before the far
 * one. This is Gribb and Hartmann's extraction (Gummerus 4.1) for each depth range. */
static bool depth_rows(const umb_matrix_def *def, const row rows[4], row *beyond_near,
                       row *before_far)
{
    row zero = {umb_vec3_make(0.0, 0.0, 0.0), 0.0};
    row z = rows[2];
    row w = rows[3];
    switch (def->depth_range) {
    case UMB_DEPTH_MINUS_ONE_TO_ONE:
        *beyond_near = row_sub(z, row_sub(zero, w));
        *before_far = row_sub(w, z);
        return true;
    case UMB_DEPTH_ZERO_TO_ONE:
        *beyond_near = z;
        *before_far = row_sub(w, z);
        return true;
    case UMB_DEPTH_ONE_TO_ZERO:
        *beyond_near = row_sub(w, z);
        *before_far = z;
        return true;
    }
    return false;
}

/* True if v is along the unit vector axis, or next to nothing beside scale. */
static bool is_along(umb_vec3 v, umb_vec3 axis, double scale)
{
    umb_vec3 off = umb_vec3_cross(v, axis);
    double length = umb_vec3_length(v);
    return umb_vec3_length(off) <= AXIS_TOLERANCE * length || length <= 1e-14 * scale;
}

static double determinant(umb_vec3 a, umb_vec3 b, umb_vec3 c)
{
    return umb_vec3_dot(a, umb_vec3_cross(b, c));
}

/* The point where three rows are zero, by Cramer's rule; false when their normals lie in one
 * plane. */
static bool meet(row a, row b, row c, umb_vec3 *out)
{
    double scale = umb_vec3_length(a.n) * umb_vec3_length(b.n) * umb_vec3_length(c.n);
    double det = determinant(a.n, b.n, c.n);
    if (!(fabs(det) > 1e-12 * scale)) {
        return false;
    }
    umb_vec3 p = umb_vec3_scale(umb_vec3_cross(b.n, c.n), -a.c);
    p = umb_vec3_add(p, umb_vec3_scale(umb_vec3_cross(c.n, a.n), -b.c));
    p = umb_vec3_add(p, umb_vec3_scale(umb_vec3_cross(a.n, b.n), -c.c));
    *out = umb_vec3_scale(p, 1.0 / det);
    return isfinite(out->x) && isfinite(out->y) && isfinite(out->z);
}

/* Split a picture row into its axis and the range that -1..1 stands for: the row is across (d.axis)
 * + along (d.forward), and s (d.forward) is clip w. sign -1 turns the axis round. */
static bool split_row(row r, umb_vec3 forward, double s, double sign, double axis[3], double *low,
                      double *high)
{
    double along = umb_vec3_dot(r.n, forward);
    umb_vec3 a = umb_vec3_sub(r.n, umb_vec3_scale(forward, along));
    a = umb_vec3_scale(a, sign);
    double across = umb_vec3_length(a);
    if (!(across > 1e-12 * umb_vec3_length(r.n)) || !normalize(&a)) {
        return false;
    }
    store(axis, a);
    *low = (-s - sign * along) / across;
    *high = (s - sign * along) / across;
    return true;
}

static bool recover_perspective(umb_view *v, const umb_matrix_def *def, const row rows[4])
{
    umb_vec3 forward = rows[3].n;
    double s = umb_vec3_length(forward);
    umb_vec3 eye;
    row near_row, far_row;
    if (!normalize(&forward) || !meet(rows[0], rows[1], rows[3], &eye) ||
        !depth_rows(def, rows, &near_row, &far_row) || !is_along(rows[2].n, forward, s)) {
        return false;
    }
    store(v->eye, eye);
    store(v->forward, forward);
    if (!split_row(rows[0], forward, s, 1.0, v->right, &v->x_min, &v->x_max) ||
        !split_row(rows[1], forward, s, def->y_down ? -1.0 : 1.0, v->up, &v->y_min, &v->y_max)) {
        return false;
    }
    /* Along depth D both rows are p D + q >= 0: near from below, far from above or not at all. A far
       plane beyond 1e12 times the scale of rounding counts as infinite: that only adds to the view. */
    double near_p = umb_vec3_dot(near_row.n, forward);
    double far_p = umb_vec3_dot(far_row.n, forward);
    double near_q = row_at(near_row, eye);
    double far_q = row_at(far_row, eye);
    if (!(near_p > 0.0)) {
        return false;
    }
    v->near_depth = -near_q / near_p;
    if (far_p < -1e-12 * s) {
        v->far_depth = -far_q / far_p;
    } else if (far_q >= 0.0) {
        v->far_depth = INFINITY;
    } else {
        return false;
    }
    return true;
}

/* Parallel: clip w is one constant. The eye is put in the middle of the near rectangle. */
static bool recover_orthographic(umb_view *v, const umb_matrix_def *def, const row rows[4])
{
    double w = rows[3].c;
    row near_row, far_row;
    if (!(w > 0.0) || !depth_rows(def, rows, &near_row, &far_row)) {
        return false;
    }
    umb_vec3 forward = near_row.n;
    umb_vec3 right = rows[0].n;
    umb_vec3 up = umb_vec3_scale(rows[1].n, def->y_down ? -1.0 : 1.0);
    double depth_scale = umb_vec3_length(forward);
    double x_scale = umb_vec3_length(right);
    double y_scale = umb_vec3_length(up);
    umb_vec3 eye;
    if (!meet(rows[0], rows[1], near_row, &eye) || !normalize(&forward) || !normalize(&right) ||
        !normalize(&up)) {
        return false;
    }
    store(v->eye, eye);
    store(v->forward, forward);
    store(v->right, right);
    store(v->up, up);
    v->x_max = w / x_scale;
    v->x_min = -v->x_max;
    v->y_max = w / y_scale;
    v->y_min = -v->y_max;
    v->near_depth = 0.0;
    v->far_depth = row_at(far_row, eye) / depth_scale;
    return true;
}

umb_result umb_view_from_matrix(umb_view *out, const umb_matrix_def *def)
{
    row rows[4];
    umb_view v = {.projection = UMB_PERSPECTIVE};
    if (!read_rows(def, rows)) {
        return UMB_ERROR_ARGUMENT;
    }
    bool parallel = rows[3].n.x == 0.0 && rows[3].n.y == 0.0 && rows[3].n.z == 0.0;
    v.projection = parallel ? UMB_ORTHOGRAPHIC : UMB_PERSPECTIVE;
    if (!(parallel ? recover_orthographic(&v, def, rows) : recover_perspective(&v, def, rows))) {
        return UMB_ERROR_ARGUMENT;
    }
    umb_result result = umb_view_check(&v, NULL);
    if (result == UMB_OK) {
        *out = v;
    }
    return result;
}

/* ---- planes --------------------------------------------------------------------------------- */

/* Store n.(p - eye) >= offset as a plane with a unit normal. */
static void store_plane(double out[4], umb_vec3 n, umb_vec3 eye, double offset)
{
    double scale = 1.0 / umb_vec3_length(n);
    out[0] = n.x * scale;
    out[1] = n.y * scale;
    out[2] = n.z * scale;
    out[3] = -(umb_vec3_dot(n, eye) + offset) * scale;
}

/* The side plane sign * (d.axis - bound * depth) >= 0, or without the depth when parallel. */
static void store_side(const umb_view *view, double out[4], const double axis[3], double sign,
                       double bound)
{
    umb_vec3 n = umb_vec3_scale(umb_vec3_from_double(axis), sign);
    double offset = sign * bound;
    if (view->projection == UMB_PERSPECTIVE) {
        n = umb_vec3_sub(n, umb_vec3_scale(umb_vec3_from_double(view->forward), offset));
        offset = 0.0;
    }
    store_plane(out, n, umb_vec3_from_double(view->eye), offset);
}

uint32_t umb_view_planes(const umb_view *view, double planes[16][4])
{
    umb_vec3 eye = umb_vec3_from_double(view->eye);
    umb_vec3 forward = umb_vec3_from_double(view->forward);
    uint32_t count = 0;
    store_side(view, planes[count++], view->right, 1.0, view->x_min);
    store_side(view, planes[count++], view->right, -1.0, view->x_max);
    store_side(view, planes[count++], view->up, 1.0, view->y_min);
    store_side(view, planes[count++], view->up, -1.0, view->y_max);
    store_plane(planes[count++], forward, eye, view->near_depth);
    if (!isinf(view->far_depth)) {
        store_plane(planes[count++], umb_vec3_scale(forward, -1.0), eye, -view->far_depth);
    }
    for (uint32_t i = 0; i < view->plane_count && i < UMB_MAX_CLIP_PLANES; ++i) {
        const double *p = view->planes[i];
        double largest = fmax(fabs(p[0]), fmax(fabs(p[1]), fabs(p[2])));
        umb_vec3 n = umb_vec3_make(p[0] / largest, p[1] / largest, p[2] / largest);
        double length = umb_vec3_length(n);
        for (int j = 0; j < 4; ++j) {
            planes[count][j] = p[j] / largest / length;
        }
        ++count;
    }
    return count;
}

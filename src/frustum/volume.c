/* A view around a polyhedron that is given by its planes.
 *
 * What the view's members have to be are maxima of linear functions a.d over the polyhedron P
 * of all d with n_i.d + c_i >= 0. Corners of P, computed in double, would say them only to
 * within errors that nearly parallel planes make as large as one likes. So bounds come from the
 * dual side: for any numbers l_i >= 0 and every d in P
 *
 *     a.d  <=  a.d + sum l_i (n_i.d + c_i)  =  (a + sum l_i n_i).d + sum l_i c_i
 *          <=  |r| R + sum l_i c_i
 *
 * where r = a + sum l_i n_i, |r| is the sum of its absolute components, and R is at least every
 * |d_k| in P. That holds whatever the l_i are (Neumaier and Shcherbina's safe bounds of linear
 * programs), so they may be computed carelessly: those with r = 0 for three planes at a time,
 * and the least bound counts. At the true maximum they make it tight to a few units of
 * rounding.
 *
 * R itself comes from the same inequality. Take a = +-e_k: R <= max (sum l c) + max |r| R,
 * hence R <= max (sum l c) / (1 - max |r|). And P is bounded: along an endless direction v of P
 * all n_i.v >= 0, so a.v <= r.v <= |r| max|v_k|, which fails for the a = +-e_k that picks v's
 * largest component, as |r| < 1.
 *
 * In perspective x_max has to be at least right.d / forward.d. With a = right - b forward and a
 * bound M of its maximum, right.d <= b forward.d + M <= (b + M / near) forward.d, because
 * forward.d >= near > 0 in P (if M is negative, M / far). So any b yields a bound; the slope of
 * the corner found gives the next b. */
#include "base/memory.h"
#include "umbrage/light.h"
#include "view_parts.h"

#define U 0x1p-53
#define LARGEST 1e30
#define MAX_CORNERS 64
/* Above all that underflow can lose. */
#define TINY 0x1p-1000

/* Planes n.d + c >= 0 relative to a point, each scaled by a power of two to a normal between
 * 1/2 and 1, c rounded upwards. */
typedef struct volume {
    uint32_t count;
    umb_vec3 n[UMB_MAX_VOLUME_PLANES];
    double c[UMB_MAX_VOLUME_PLANES];
    double reach; /* at least every |d_k| */
    uint32_t corner_count;
    umb_vec3 corners[MAX_CORNERS]; /* about: they decide choices, never bounds */
} volume;

/* ---- bounds ---------------------------------------------------------------------------------- */

/* Three planes, and where they meet: the cross products of their normals and their determinant. */
typedef struct triple {
    uint32_t plane[3];
    umb_vec3 across[3];
    double det;
} triple;

static bool make_triple(const volume *v, uint32_t i, uint32_t j, uint32_t k, triple *t)
{
    t->plane[0] = i;
    t->plane[1] = j;
    t->plane[2] = k;
    t->across[0] = umb_vec3_cross(v->n[j], v->n[k]);
    t->across[1] = umb_vec3_cross(v->n[k], v->n[i]);
    t->across[2] = umb_vec3_cross(v->n[i], v->n[j]);
    t->det = umb_vec3_dot(v->n[i], t->across[0]);
    return t->det != 0.0;
}

static umb_vec3 meeting_point(const volume *v, const triple *t)
{
    umb_vec3 p = umb_vec3_make(0.0, 0.0, 0.0);
    for (int i = 0; i < 3; ++i) {
        p = umb_vec3_add(p, umb_vec3_scale(t->across[i], -v->c[t->plane[i]] / t->det));
    }
    return p;
}

/* A bound in its two parts: a.d <= sum + residual R. off: what a's components may be off. Four
 * roundings of each term's size go into a component of r, three into the sum; the doubles of that
 * are added. False where numbers overflow. */
static bool dual_bound(const volume *v, const triple *t, umb_vec3 a, umb_vec3 off, double *sum,
                       double *residual)
{
    umb_vec3 r = a, size = umb_vec3_make(fabs(a.x), fabs(a.y), fabs(a.z));
    double total = 0.0, total_size = 0.0;
    for (int i = 0; i < 3; ++i) {
        double l = fmax(0.0, -umb_vec3_dot(a, t->across[i]) / t->det);
        umb_vec3 n = v->n[t->plane[i]];
        r = umb_vec3_add(r, umb_vec3_scale(n, l));
        size = umb_vec3_add(size, umb_vec3_make(l * fabs(n.x), l * fabs(n.y), l * fabs(n.z)));
        total += l * v->c[t->plane[i]];
        total_size += l * fabs(v->c[t->plane[i]]);
    }
    *sum = total + 16.0 * U * total_size + TINY;
    *residual = umb_vec3_sum_abs(r) + 16.0 * U * umb_vec3_sum_abs(size) + umb_vec3_sum_abs(off);
    *residual *= 1.0 + 16.0 * U;
    return isfinite(*sum) && isfinite(*residual);
}

/* The least bound of a.d over P, and the corner that it belongs to. */
static double bound_along(const volume *v, umb_vec3 a, umb_vec3 off, umb_vec3 *where)
{
    double best = INFINITY;
    for (uint32_t i = 0; i < v->count; ++i) {
        for (uint32_t j = i + 1; j < v->count; ++j) {
            for (uint32_t k = j + 1; k < v->count; ++k) {
                triple t;
                double sum, residual;
                if (!make_triple(v, i, j, k, &t) || !dual_bound(v, &t, a, off, &sum, &residual)) {
                    continue;
                }
                double bound = sum + residual * v->reach;
                bound += 4.0 * U * (fabs(sum) + residual * v->reach);
                if (bound < best) {
                    best = bound;
                    *where = meeting_point(v, &t);
                }
            }
        }
    }
    return best;
}

static double bound_along_axis(const volume *v, umb_vec3 a)
{
    umb_vec3 where;
    return bound_along(v, a, umb_vec3_make(0.0, 0.0, 0.0), &where);
}

/* The part of R that a direction asks for; INFINITY where no triple has a small residual. */
static double reach_along(const volume *v, umb_vec3 a)
{
    double best = INFINITY;
    for (uint32_t i = 0; i < v->count; ++i) {
        for (uint32_t j = i + 1; j < v->count; ++j) {
            for (uint32_t k = j + 1; k < v->count; ++k) {
                triple t;
                double sum, residual;
                if (make_triple(v, i, j, k, &t) &&
                    dual_bound(v, &t, a, umb_vec3_make(0.0, 0.0, 0.0), &sum, &residual) &&
                    residual <= 0x1p-10) {
                    best = fmin(best, sum);
                }
            }
        }
    }
    return best;
}

static bool find_reach(volume *v)
{
    double reach = 0.0;
    for (int k = 0; k < 6; ++k) {
        double s = k % 2 == 0 ? 1.0 : -1.0;
        int axis = k / 2;
        umb_vec3 a = umb_vec3_make(axis == 0 ? s : 0.0, axis == 1 ? s : 0.0, axis == 2 ? s : 0.0);
        reach = fmax(reach, reach_along(v, a));
    }
    v->reach = reach * (1.0 + 0x1p-9); /* at least 1 / (1 - 2^-10) */
    return v->reach <= LARGEST;
}

/* By Helly's theorem at most four of the planes have nothing in common if all have. Along one
 * of their normals the bounds from both sides then cross. */
static bool is_empty(const volume *v)
{
    for (uint32_t i = 0; i < v->count; ++i) {
        if (bound_along_axis(v, v->n[i]) < -bound_along_axis(v, umb_vec3_scale(v->n[i], -1.0))) {
            return true;
        }
    }
    return false;
}

/* ---- planes ---------------------------------------------------------------------------------- */

static bool read_plane(volume *v, const double p[4], const double from[3])
{
    double largest = fmax(fabs(p[0]), fmax(fabs(p[1]), fabs(p[2])));
    if (!isfinite(p[0] + p[1] + p[2] + p[3]) || !(largest >= 1.0 / LARGEST && largest <= LARGEST) ||
        fabs(p[3]) > LARGEST) {
        return false;
    }
    int exponent;
    frexp(largest, &exponent);
    umb_vec3 n = umb_vec3_make(ldexp(p[0], -exponent), ldexp(p[1], -exponent),
                               ldexp(p[2], -exponent));
    umb_vec3 e = umb_vec3_from_double(from);
    double c = ldexp(p[3], -exponent);
    double size = fabs(n.x * e.x) + fabs(n.y * e.y) + fabs(n.z * e.z) + fabs(c);
    v->n[v->count] = n;
    v->c[v->count++] = umb_vec3_dot(n, e) + c + 8.0 * U * size;
    return true;
}

static void find_corners(volume *v)
{
    for (uint32_t i = 0; i < v->count; ++i) {
        for (uint32_t j = i + 1; j < v->count; ++j) {
            for (uint32_t k = j + 1; k < v->count; ++k) {
                triple t;
                bool inside = make_triple(v, i, j, k, &t) && v->corner_count < MAX_CORNERS;
                umb_vec3 p = inside ? meeting_point(v, &t) : umb_vec3_make(0.0, 0.0, 0.0);
                for (uint32_t m = 0; inside && m < v->count; ++m) {
                    inside = umb_vec3_dot(v->n[m], p) + v->c[m] >= -1e-9 * v->reach;
                }
                if (inside) {
                    v->corners[v->corner_count++] = p;
                }
            }
        }
    }
}

/* Everything of the polyhedron relative to a point; NULL or what is wrong with it. */
static const char *read_volume(const umb_volume_def *def, const double from[3], volume *v)
{
    *v = (volume){.count = 0};
    for (uint32_t i = 0; i < def->plane_count; ++i) {
        if (!read_plane(v, def->planes[i], from)) {
            return "a plane must be finite, at most 1e30, with a normal that is not zero";
        }
    }
    if (!find_reach(v)) {
        return "the planes leave a way to infinity open, or reach beyond 1e30";
    }
    find_corners(v);
    return NULL;
}

/* ---- axes ------------------------------------------------------------------------------------ */

/* How much room the smallest view along these axes takes: volume in perspective, area when
 * parallel. */
static double room(const umb_view *view, const volume *v)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = 0; i < v->corner_count; ++i) {
        double z = umb_vec3_dot(umb_vec3_from_double(view->forward), v->corners[i]);
        double scale = view->projection == UMB_PERSPECTIVE ? z : 1.0;
        double at[3] = {umb_vec3_dot(umb_vec3_from_double(view->right), v->corners[i]) / scale,
                        umb_vec3_dot(umb_vec3_from_double(view->up), v->corners[i]) / scale, z};
        if (!(scale > 0.0)) {
            return INFINITY;
        }
        for (int k = 0; k < 3; ++k) {
            low[k] = fmin(low[k], at[k]);
            high[k] = fmax(high[k], at[k]);
        }
    }
    double area = (high[0] - low[0]) * (high[1] - low[1]);
    return view->projection == UMB_PERSPECTIVE
               ? area * (high[2] * high[2] * high[2] - low[2] * low[2] * low[2])
               : area;
}

/* Take these axes into the view if they need less room than the best so far. */
static void try_axes(umb_view *view, const volume *v, umb_vec3 forward, umb_vec3 up, double *least)
{
    double f[3] = {forward.x, forward.y, forward.z}, u[3] = {up.x, up.y, up.z};
    umb_view trial;
    if (umb_view_aim(&trial, f, u) != UMB_OK) {
        return;
    }
    trial.projection = view->projection;
    double size = room(&trial, v);
    if (!(*least <= size)) {
        *least = size;
        *view = trial;
    }
}

static umb_vec3 middle_direction(const volume *v)
{
    umb_vec3 sum = umb_vec3_make(0.0, 0.0, 0.0);
    for (uint32_t i = 0; i < v->corner_count; ++i) {
        double length = umb_vec3_length(v->corners[i]);
        if (length > 0.0) {
            sum = umb_vec3_add(sum, umb_vec3_scale(v->corners[i], 1.0 / length));
        }
    }
    return sum;
}

/* The rectangle of least area around a convex outline has a side along one of its edges. An
 * edge of the outline is a plane through the eye, or an edge of P, along the cross product of
 * two normals. */
static void try_ups(umb_view *view, const umb_volume_def *def, const volume *v, umb_vec3 forward,
                    bool edges, double *least)
{
    umb_vec3 up = umb_vec3_from_double(def->up);
    try_axes(view, v, forward, up, least);
    for (uint32_t i = 0; i < v->count && umb_vec3_sum_abs(up) == 0.0; ++i) {
        try_axes(view, v, forward, v->n[i], least);
        for (uint32_t j = i + 1; j < v->count && edges; ++j) {
            umb_vec3 edge = umb_vec3_cross(v->n[i], v->n[j]);
            if (umb_vec3_sum_abs(edge) > 1e-9) {
                try_axes(view, v, forward, edge, least);
            }
        }
    }
}

static bool choose_axes(umb_view *view, const umb_volume_def *def, const volume *v)
{
    umb_vec3 forward = umb_vec3_from_double(def->forward);
    double least = NAN;
    if (umb_vec3_sum_abs(forward) == 0.0) {
        try_ups(view, def, v, middle_direction(v), false, &least);
        for (uint32_t i = 0; i < v->count; ++i) {
            try_ups(view, def, v, v->n[i], false, &least);
            try_ups(view, def, v, umb_vec3_scale(v->n[i], -1.0), false, &least);
        }
        forward = umb_vec3_from_double(view->forward);
    }
    try_ups(view, def, v, forward, true, &least);
    return !isnan(least);
}

/* ---- the view -------------------------------------------------------------------------------- */

/* At least sign * axis.d, or that over the depth, for all of P (see the top). */
static double side_bound(const volume *v, const umb_view *view, const double axis[3], double sign)
{
    umb_vec3 across = umb_vec3_scale(umb_vec3_from_double(axis), sign);
    umb_vec3 forward = umb_vec3_from_double(view->forward);
    if (view->projection == UMB_ORTHOGRAPHIC) {
        return bound_along_axis(v, across);
    }
    double b = 0.0, best = INFINITY;
    for (int round = 0; round < 6; ++round) {
        umb_vec3 step = umb_vec3_scale(forward, b), where = forward;
        umb_vec3 a = umb_vec3_sub(across, step);
        umb_vec3 off = umb_vec3_make(2.0 * U * (fabs(step.x) + fabs(a.x)),
                                     2.0 * U * (fabs(step.y) + fabs(a.y)),
                                     2.0 * U * (fabs(step.z) + fabs(a.z)));
        double most = bound_along(v, a, off, &where);
        double more = most / (most > 0.0 ? view->near_depth : view->far_depth);
        best = fmin(best, b + more + 4.0 * U * (fabs(b) + fabs(more)));
        double next = umb_vec3_dot(across, where) / umb_vec3_dot(forward, where);
        if (!(fabs(next - b) > 4.0 * U * fabs(b)) || !(fabs(next) <= LARGEST)) {
            break;
        }
        b = next;
    }
    return best;
}

/* Flat polyhedra: a view must not be. */
static void widen(double *low, double *high)
{
    double size = fabs(*low) + fabs(*high);
    if (!(*high - *low >= 4e-12 * size) || !(*high - *low >= 4.0 / LARGEST)) {
        double more = 4e-12 * size + 4.0 / LARGEST;
        *low -= *low > 0.0 ? fmin(more, 0.5 * *low) : more;
        *high += more;
    }
}

static const char *fit(umb_view *view, const volume *v)
{
    umb_vec3 forward = umb_vec3_from_double(view->forward);
    view->near_depth = -bound_along_axis(v, umb_vec3_scale(forward, -1.0));
    view->far_depth = bound_along_axis(v, forward);
    if (is_empty(v)) {
        return "the planes have no point in common";
    }
    if (view->projection == UMB_PERSPECTIVE && !(view->near_depth >= 1.0 / LARGEST)) {
        return "not all of it is in front of the eye; add a near plane";
    }
    view->x_min = -side_bound(v, view, view->right, -1.0);
    view->x_max = side_bound(v, view, view->right, 1.0);
    view->y_min = -side_bound(v, view, view->up, -1.0);
    view->y_max = side_bound(v, view, view->up, 1.0);
    widen(&view->near_depth, &view->far_depth);
    widen(&view->x_min, &view->x_max);
    widen(&view->y_min, &view->y_max);
    return NULL;
}

static void move_eye(double eye[3], umb_vec3 by)
{
    eye[0] += by.x;
    eye[1] += by.y;
    eye[2] += by.z;
}

/* A parallel view's eye: first about the middle of P, then back to its nearest depth. */
static const char *place_eye(const umb_volume_def *def, umb_view *view, volume *v, double eye[3])
{
    umb_vec3 sum = umb_vec3_make(0.0, 0.0, 0.0);
    for (uint32_t i = 0; i < v->corner_count; ++i) {
        sum = umb_vec3_add(sum, umb_vec3_scale(v->corners[i], 1.0 / v->corner_count));
    }
    move_eye(eye, sum);
    const char *broken = read_volume(def, eye, v);
    if (broken == NULL && choose_axes(view, def, v)) {
        umb_vec3 forward = umb_vec3_from_double(view->forward);
        double depth = -bound_along_axis(v, umb_vec3_scale(forward, -1.0));
        move_eye(eye, umb_vec3_scale(forward, depth));
        broken = read_volume(def, eye, v);
    }
    return broken;
}

static const char *make(umb_view *view, const umb_volume_def *def, volume *v)
{
    bool parallel = def->projection == UMB_ORTHOGRAPHIC;
    double eye[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < 3 && !parallel; ++i) {
        eye[i] = def->eye[i];
        if (!(fabs(eye[i]) <= LARGEST)) {
            return "the eye must be finite, at most 1e30";
        }
    }
    if (parallel && umb_vec3_sum_abs(umb_vec3_from_double(def->forward)) == 0.0) {
        return "a parallel view needs a forward";
    }
    const char *broken = read_volume(def, eye, v);
    if (broken == NULL && parallel) {
        broken = place_eye(def, view, v, eye);
    }
    if (broken != NULL) {
        return broken;
    }
    if (!choose_axes(view, def, v)) {
        return "forward and up must be finite, at most 1e30";
    }
    /* An up that was only tried says nothing of the scene's vertical. */
    bool known = umb_vec3_sum_abs(umb_vec3_from_double(def->up)) > 0.0;
    for (int i = 0; i < 3; ++i) {
        view->eye[i] = eye[i];
        view->vertical[i] = known ? view->vertical[i] : 0.0;
    }
    return fit(view, v);
}

umb_result umb_view_from_volume(umb_view *out, const umb_volume_def *def, umb_error *error)
{
    umb_view view = {.projection = def->projection};
    volume v;
    const char *broken = NULL;
    if (def->projection != UMB_PERSPECTIVE && def->projection != UMB_ORTHOGRAPHIC) {
        broken = "projection must be UMB_PERSPECTIVE or UMB_ORTHOGRAPHIC";
    } else if (def->plane_count < 4 || def->plane_count > UMB_MAX_VOLUME_PLANES) {
        broken = "4 to 16 planes";
    } else {
        broken = make(&view, def, &v);
    }
    if (broken != NULL) {
        return umb_error_set(error, UMB_ERROR_ARGUMENT, "impossible volume: %s", broken);
    }
    umb_view_trim(&view, def->planes, def->plane_count);
    umb_result result = umb_view_check(&view, error);
    if (result == UMB_OK) {
        *out = view;
    }
    return result;
}

/* Single volumes against the planes of a frustum, in doubles.
 *
 * A volume V is outside a plane if max g < 0 over it, and inside if min g >= 0, for g(p) = n.(p - eye) + c. All kinds but
 * boxes and hulls are symmetric about their center, so the extremes are g(center) +- r with r the half width along n:
 *
 *     oriented box, sphere, capsule, lozenge    r = sum |n.a_i| + R |n|     with as many a_i as the kind has
 *     cylinder                                  r = |n.a_0| + R |n x a_0| / |a_0|
 *     ellipsoid                                 r = sqrt(sum (n.a_i)^2)
 *
 * Rounding. v = 2^-53; m the plane's size, at least every |n_i| with the terms that cancelled in it; D the sum of
 * |p_i - eye_i|, A that of all |a_ij|.
 *
 *   n             one product, one difference        2 v m in each n_i
 *   p - eye       v |d_i|
 *   n.d + c       products v, three sums 3 v         in all under 8 v m D + 2 v |c| + error of c
 *   n.a_i         the same without the difference    under 6 v m A, and 3 v m A for the sum of absolute values
 *   R |n|         n's own 2 sqrt(3) v m R, root and products 4 v sqrt(3) m R        under 12 v m R
 *   cylinder      cross product under 8 v m A with A <= sqrt(3) |a|, quotient 4 v    under 24 v m R
 *   ellipsoid     each n.a_i 5 v m A_i; the root does not enlarge them; 4 v r        under 10 v m A
 *   g +- r        v (|g| + r)                        under 4 v m (D + A + R) + v |c|
 *
 * Together below 32 v (m (D + A + R) + |c|) + error, which is the bound taken; its spare parts pay for its own rounding.
 * A number that is not finite makes a NaN or an infinite bound, and no comparison below holds for either.
 */
#include "umbrage/bounds.h"

#include <math.h>
#include <string.h>

#include "bounds_parts.h"
#include "geometry/vec.h"

#define V 0x1p-53
/* Fewer planes are tested faster than a ball is found. */
#define LEAST_FOR_OCTANT 3
#define TOO_SMALL 1e-290 /* more than what underflow can lose: a few of the least normal doubles times 1e15 */

/* ---- the frustum ---------------------------------------------------------------------------- */

static void add_plane(umb_bounds_frustum *f, umb_vec3 n, double c, double size, double c_error)
{
    umb_bounds_plane *p = &f->planes[f->plane_count++];
    *p = (umb_bounds_plane){.n = {n.x, n.y, n.z}, .c = c, .size = size, .error = c_error + TOO_SMALL};
    p->length = umb_vec3_length(n);
}

static void add_side(umb_bounds_frustum *f, const umb_view *view, const double axis[3], double sign, double bound)
{
    umb_vec3 a = umb_vec3_scale(umb_vec3_from_double(axis), sign);
    if (view->projection == UMB_PERSPECTIVE) {
        umb_vec3 n = umb_vec3_sub(a, umb_vec3_scale(umb_vec3_from_double(view->forward), sign * bound));
        /* Axes are at most 1 + 1e-6 long. */
        add_plane(f, n, 0.0, 1.001 * (1.0 + fabs(bound)), 0.0);
    } else {
        add_plane(f, a, -sign * bound, 1.001, 0.0);
    }
}

/* n.p + d with p = eye + (p - eye). */
static void add_extra(umb_bounds_frustum *f, const umb_view *view, const double plane[4])
{
    umb_vec3 n = umb_vec3_from_double(plane), e = umb_vec3_from_double(view->eye);
    double terms = fabs(n.x * e.x) + fabs(n.y * e.y) + fabs(n.z * e.z) + fabs(plane[3]);
    double size = fmax(fabs(n.x), fmax(fabs(n.y), fabs(n.z)));
    add_plane(f, n, umb_vec3_dot(n, e) + plane[3], size, 8.0 * V * terms);
}

/* How far each plane has turned and moved since the frame before: for every point p, with e the old eye,
 *     g'(p) - g(p) = (n' - n).(p - e) + n'.(e - e') + c' - c
 * turn is at least the length of n' - n; shift is the rest, to within blur. */
static void follow(umb_bounds_frustum *f, const umb_bounds_frustum *before)
{
    umb_vec3 back = umb_vec3_sub(umb_vec3_from_double(before->eye), umb_vec3_from_double(f->eye));
    f->step = umb_vec3_length(back) * (1.0 + 8.0 * V) + TOO_SMALL;
    for (uint32_t k = 0; k < f->plane_count; ++k) {
        umb_bounds_plane *p = &f->planes[k];
        const umb_bounds_plane *q = &before->planes[k];
        umb_vec3 n = umb_vec3_from_double(p->n);
        double size = p->size + q->size;
        p->turn = umb_vec3_length(umb_vec3_sub(n, umb_vec3_from_double(q->n))) + 16.0 * V * size;
        p->shift = umb_vec3_dot(n, back) + (p->c - q->c);
        p->blur = 16.0 * V * (size * umb_vec3_sum_abs(back)) + 4.0 * V * (fabs(p->c) + fabs(q->c)) + p->error + q->error;
    }
    f->follows = true;
}

umb_result umb_bounds_prepare(umb_bounds_frustum *out, const umb_view *view, const umb_bounds_frustum *before)
{
    umb_result result = umb_view_check(view, NULL);
    if (result != UMB_OK) {
        return result;
    }
    umb_bounds_frustum f;
    memset(&f, 0, sizeof f);
    memcpy(f.eye, view->eye, sizeof f.eye);
    memcpy(f.axis[0], view->right, sizeof f.axis[0]);
    memcpy(f.axis[1], view->up, sizeof f.axis[1]);
    memcpy(f.axis[2], view->forward, sizeof f.axis[2]);
    f.perspective = view->projection == UMB_PERSPECTIVE;
    const double bound[6] = {view->x_min, view->x_max, view->y_min, view->y_max, view->near_depth, view->far_depth};
    memcpy(f.bound, bound, sizeof f.bound);
    add_side(&f, view, view->right, 1.0, view->x_min);
    add_side(&f, view, view->right, -1.0, view->x_max);
    add_side(&f, view, view->up, 1.0, view->y_min);
    add_side(&f, view, view->up, -1.0, view->y_max);
    umb_vec3 forward = umb_vec3_from_double(view->forward);
    add_plane(&f, forward, -view->near_depth, 1.001, 0.0);
    f.endless = isinf(view->far_depth);
    if (!f.endless) {
        add_plane(&f, umb_vec3_scale(forward, -1.0), view->far_depth, 1.001, 0.0);
    }
    for (uint32_t k = 0; k < view->plane_count; ++k) {
        add_extra(&f, view, view->planes[k]);
    }
    umb_bounds_find_edges(&f);
    f.frame = before != NULL ? before->frame + 1 : 1;
    if (before != NULL && before->plane_count == f.plane_count && before->endless == f.endless) {
        follow(&f, before);
    }
    *out = f;
    return UMB_OK;
}

/* ---- extremes along a plane's normal -------------------------------------------------------- */

typedef struct extremes {
    double most, least; /* of g over the volume, widened by the bound */
} extremes;

static extremes widen(const umb_bounds_plane *p, double low, double high, double size)
{
    double e = 32.0 * V * (p->size * size + fabs(p->c)) + p->error;
    return (extremes){high + e, low - e};
}

/* Hoff's two corners: the farthest along n, and the opposite one. */
static extremes along_box(const umb_bounds_frustum *f, const umb_bounds_plane *p, const umb_aabb *box)
{
    double low = 0.0, high = 0.0, size = 0.0;
    for (int i = 0; i < 3; ++i) {
        double d = (double)box->min[i] - f->eye[i], e = (double)box->max[i] - f->eye[i];
        low += p->n[i] * (p->n[i] > 0.0 ? d : e);
        high += p->n[i] * (p->n[i] > 0.0 ? e : d);
        size += fabs(d) + fabs(e); /* no maximum: it would lose a NaN */
    }
    return widen(p, low + p->c, high + p->c, size);
}

static extremes along_hull(const umb_bounds_frustum *f, const umb_bounds_plane *p, const umb_volume *v)
{
    double low = INFINITY, high = -INFINITY, size = 0.0;
    size_t stride = v->point_stride != 0 ? v->point_stride : 3 * sizeof(float);
    for (uint32_t k = 0; k < v->point_count; ++k) {
        const float *at = (const float *)((const char *)v->points + k * stride);
        double x = at[0] - f->eye[0], y = at[1] - f->eye[1], z = at[2] - f->eye[2];
        double g = (p->n[0] * x + p->n[1] * y + p->n[2] * z) + p->c;
        double reach = fabs(x) + fabs(y) + fabs(z);
        if (!(reach < INFINITY)) {
            return (extremes){INFINITY, -INFINITY};
        }
        low = g < low ? g : low;
        high = g > high ? g : high;
        size = reach > size ? reach : size;
    }
    return widen(p, low, high, size);
}

/* How many axes a kind has. */
static int axes_of(umb_volume_kind kind)
{
    switch (kind) {
    case UMB_VOLUME_ORIENTED_BOX:
    case UMB_VOLUME_ELLIPSOID:
        return 3;
    case UMB_VOLUME_LOZENGE:
        return 2;
    case UMB_VOLUME_CAPSULE:
    case UMB_VOLUME_CYLINDER:
        return 1;
    case UMB_VOLUME_BOX:
    case UMB_VOLUME_SPHERE:
    case UMB_VOLUME_HULL:
        break;
    }
    return 0;
}

static double radius_of(const umb_volume *v)
{
    bool round = v->kind == UMB_VOLUME_SPHERE || v->kind == UMB_VOLUME_CAPSULE || v->kind == UMB_VOLUME_LOZENGE ||
                 v->kind == UMB_VOLUME_CYLINDER;
    return round ? v->radius : 0.0;
}

static double half_width(const umb_bounds_plane *p, const umb_volume *v)
{
    umb_vec3 n = umb_vec3_from_double(p->n);
    double sum = 0.0, squares = 0.0, radius = radius_of(v);
    for (int i = 0; i < axes_of(v->kind); ++i) {
        double along = umb_vec3_dot(n, umb_vec3_from_double(v->axis[i]));
        sum += fabs(along);
        squares += along * along;
    }
    if (v->kind == UMB_VOLUME_ELLIPSOID) {
        return sqrt(squares);
    }
    if (v->kind == UMB_VOLUME_CYLINDER) {
        umb_vec3 a = umb_vec3_from_double(v->axis[0]);
        double length = umb_vec3_length(a);
        /* A disc without a direction, or one whose direction is lost, may stand any way. */
        return sum + (length > 1e-140 ? radius * (umb_vec3_length(umb_vec3_cross(n, a)) / length) : radius * p->length);
    }
    return sum + (radius != 0.0 ? radius * p->length : 0.0);
}

/* A + R of the bound. */
static double reach_of(const umb_volume *v)
{
    double sum = radius_of(v);
    for (int i = 0; i < axes_of(v->kind); ++i) {
        sum += umb_vec3_sum_abs(umb_vec3_from_double(v->axis[i]));
    }
    return sum;
}

static extremes along(const umb_bounds_frustum *f, const umb_bounds_plane *p, const umb_volume *v)
{
    if (v->kind == UMB_VOLUME_BOX) {
        return along_box(f, p, &v->box);
    }
    if (v->kind == UMB_VOLUME_HULL) {
        return along_hull(f, p, v);
    }
    umb_vec3 d = umb_vec3_sub(umb_vec3_from_double(v->center), umb_vec3_from_double(f->eye));
    double g = umb_vec3_dot(umb_vec3_from_double(p->n), d) + p->c, r = half_width(p, v);
    return widen(p, g - r, g + r, umb_vec3_sum_abs(d) + reach_of(v));
}

/* ---- testing -------------------------------------------------------------------------------- */

umb_place umb_bounds_test(const umb_bounds_frustum *f, const umb_volume *v)
{
    umb_place place = UMB_PLACE_INSIDE;
    if (v->kind == UMB_VOLUME_HULL && v->point_count == 0) {
        return UMB_PLACE_OUTSIDE;
    }
    for (uint32_t k = 0; k < f->plane_count; ++k) {
        extremes x = along(f, &f->planes[k], v);
        if (x.most < 0.0) {
            return UMB_PLACE_OUTSIDE;
        }
        place = x.least >= 0.0 ? place : UMB_PLACE_CROSSING;
    }
    return place;
}

/* A sphere around the volume: squares are of rounded sums, so a few units more. */
typedef struct ball {
    double center[3], radius;
} ball;

static ball ball_of(const umb_volume *v)
{
    ball b = {{v->center[0], v->center[1], v->center[2]}, radius_of(v)};
    if (v->kind == UMB_VOLUME_BOX) {
        double squares = 0.0;
        for (int i = 0; i < 3; ++i) {
            b.center[i] = 0.5 * ((double)v->box.min[i] + v->box.max[i]);
            double far_side = fmax(v->box.max[i] - b.center[i], b.center[i] - v->box.min[i]);
            squares += far_side * far_side;
        }
        b.radius = sqrt(squares);
    } else if (v->kind == UMB_VOLUME_CYLINDER) {
        umb_vec3 a = umb_vec3_from_double(v->axis[0]);
        b.radius = sqrt(v->radius * v->radius + umb_vec3_dot(a, a));
    } else {
        for (int i = 0; i < axes_of(v->kind); ++i) {
            double length = umb_vec3_length(umb_vec3_from_double(v->axis[i]));
            b.radius += v->kind == UMB_VOLUME_ELLIPSOID ? 0.0 : length;
        }
        if (v->kind == UMB_VOLUME_ELLIPSOID) { /* as a box's diagonal: the sum of squares holds for any axes */
            double squares = 0.0;
            for (int i = 0; i < 3; ++i) {
                umb_vec3 a = umb_vec3_from_double(v->axis[i]);
                squares += umb_vec3_dot(a, a);
            }
            b.radius = sqrt(squares);
        }
    }
    b.radius = b.radius * (1.0 + 32.0 * V) + TOO_SMALL;
    return b;
}

/* The planes of the mask that the ball is not surely inside of. In the view's own axes the center's distance from a side
 * takes one product more, and those of two sides that face each other share all else: what the octant test has a
 * symmetric frustum for. */
static uint32_t octant_planes(const umb_bounds_frustum *f, const umb_volume *v, uint32_t planes)
{
    uint32_t ends = f->endless ? 5 : 6, sides = planes & ((1u << ends) - 1u);
    if (v->kind == UMB_VOLUME_HULL || __builtin_popcount(sides) < LEAST_FOR_OCTANT) {
        return planes;
    }
    ball b = ball_of(v);
    umb_vec3 d = umb_vec3_sub(umb_vec3_from_double(b.center), umb_vec3_from_double(f->eye));
    double at[3], size = umb_vec3_sum_abs(d) + b.radius;
    for (int i = 0; i < 3; ++i) {
        at[i] = umb_vec3_dot(umb_vec3_from_double(f->axis[i]), d);
    }
    uint32_t left = planes;
    for (; sides != 0; sides &= sides - 1) {
        uint32_t k = (uint32_t)__builtin_ctz(sides);
        const umb_bounds_plane *p = &f->planes[k];
        double way = f->bound[k] * (f->perspective && k < 4 ? at[2] : 1.0);
        double g = (k & 1u) != 0 ? way - at[k / 2] : at[k / 2] - way;
        extremes x = widen(p, g - b.radius * p->length, g, size);
        left &= x.least >= 0.0 ? ~(1u << k) : ~0u;
    }
    return left;
}

/* Moves on what is remembered of one plane, by what g can have become at most (sign 1) or at least (sign -1). */
static double moved_on(const umb_bounds_plane *p, const umb_bounds_past *past, double sign, double g)
{
    double change = p->turn * past->reach + p->blur + 8.0 * V * (p->turn * past->reach + fabs(p->shift) + fabs(g));
    return (g + p->shift) + sign * change;
}

/* Is the answer of the frame before still sure, for all that the planes have turned and moved? Then what is remembered
 * moves on with it. */
static bool is_still(const umb_bounds_frustum *f, umb_bounds_past *past, umb_place *place)
{
    if (past->frame == 0 || past->frame + 1 != f->frame || !f->follows) {
        return false;
    }
    if (past->plane > 0 && past->plane <= f->plane_count) {
        past->extreme = moved_on(&f->planes[past->plane - 1], past, 1.0, past->extreme);
        if (!(past->extreme < 0.0)) {
            return false;
        }
        *place = UMB_PLACE_OUTSIDE;
    } else {
        double least = INFINITY;
        for (uint32_t k = 0; k < f->plane_count; ++k) {
            double g = moved_on(&f->planes[k], past, -1.0, past->extreme);
            least = g <= least ? g : least;
        }
        if (past->plane != 0 || !(least >= 0.0)) {
            return false;
        }
        past->extreme = least;
        *place = UMB_PLACE_INSIDE;
    }
    past->reach = (past->reach + f->step) * (1.0 + 4.0 * V);
    past->frame = f->frame;
    return true;
}

/* What the planes of a mask say. */
typedef struct verdict {
    umb_place place;
    uint32_t crossed;
    uint32_t plane; /* that it is outside of */
    double extreme; /* of g there, else the least over the planes tested */
} verdict;

/* A plane that it is outside of ends the test; the plane `first`, if it is one, comes first. */
static verdict test_planes(const umb_bounds_frustum *f, const umb_volume *v, uint32_t planes, uint32_t first)
{
    verdict r = {UMB_PLACE_INSIDE, 0, 0, INFINITY};
    for (uint32_t todo = planes; todo != 0;) {
        uint32_t k = first < 32 && (todo >> first & 1u) != 0 ? first : (uint32_t)__builtin_ctz(todo);
        todo &= ~(1u << k);
        extremes x = along(f, &f->planes[k], v);
        if (x.most < 0.0) {
            return (verdict){UMB_PLACE_OUTSIDE, 0, k, x.most};
        }
        r.extreme = x.least < r.extreme ? x.least : r.extreme;
        if (!(x.least >= 0.0)) {
            r.place = UMB_PLACE_CROSSING;
            r.crossed |= 1u << k;
        }
    }
    return r;
}

/* At least the distance of every point of the volume from the eye. */
static double farthest(const umb_bounds_frustum *f, const umb_volume *v)
{
    if (v->kind == UMB_VOLUME_HULL) {
        double most = 0.0;
        size_t stride = v->point_stride != 0 ? v->point_stride : 3 * sizeof(float);
        for (uint32_t k = 0; k < v->point_count; ++k) {
            const float *at = (const float *)((const char *)v->points + k * stride);
            umb_vec3 d = umb_vec3_sub(umb_vec3_from_float(at), umb_vec3_from_double(f->eye));
            double way = umb_vec3_length(d);
            most = way <= most ? most : way;
        }
        return most * (1.0 + 16.0 * V) + TOO_SMALL;
    }
    ball b = ball_of(v);
    umb_vec3 d = umb_vec3_sub(umb_vec3_from_double(b.center), umb_vec3_from_double(f->eye));
    return (umb_vec3_length(d) + b.radius) * (1.0 + 16.0 * V);
}

/* Inside can be remembered only where all planes have been looked at, or the ball was inside of the rest: then nothing
 * is known of how far, so it is not. */
static void remember(const umb_bounds_frustum *f, const umb_volume *v, const verdict *r, bool all, bool motion,
                     umb_bounds_past *past)
{
    past->plane = r->place == UMB_PLACE_OUTSIDE ? (uint8_t)(r->plane + 1) : 0;
    past->frame = 0;
    if (motion && (r->place == UMB_PLACE_OUTSIDE || (r->place == UMB_PLACE_INSIDE && all))) {
        past->frame = f->frame;
        past->extreme = r->extreme;
        past->reach = farthest(f, v);
    }
}

umb_place umb_bounds_test_again(const umb_bounds_frustum *f, const umb_volume *v, uint32_t switches,
                                umb_bounds_past *past, uint16_t *planes)
{
    uint32_t every = (1u << f->plane_count) - 1u, asked = planes != NULL ? *planes & every : every;
    bool motion = past != NULL && (switches & UMB_BOUNDS_MOTION) != 0;
    umb_place place;
    if (motion && is_still(f, past, &place)) {
        if (planes != NULL) {
            *planes = 0;
        }
        return place;
    }
    if (v->kind == UMB_VOLUME_HULL && v->point_count == 0) {
        return UMB_PLACE_OUTSIDE;
    }
    uint32_t left = (switches & UMB_BOUNDS_OCTANT) != 0 ? octant_planes(f, v, asked) : asked;
    bool coherent = past != NULL && (switches & UMB_BOUNDS_PLANE) != 0 && past->plane != 0;
    verdict r = test_planes(f, v, left, coherent ? past->plane - 1u : 32u);
    if (past != NULL) {
        remember(f, v, &r, left == every, motion, past);
    }
    if (planes != NULL) {
        *planes = (uint16_t)r.crossed;
    }
    return r.place;
}

/* ---- many of one shape ---------------------------------------------------------------------- */

void umb_bounds_sweep(umb_bounds_swept *out, const umb_bounds_frustum *f, const umb_volume *v)
{
    umb_volume moved = *v;
    umb_bounds_frustum origin = *f; /* the eye at the reference point: g is then c and what the shape adds */
    memset(out, 0, sizeof *out);
    memcpy(out->eye, f->eye, sizeof out->eye);
    memset(origin.eye, 0, sizeof origin.eye);
    memset(moved.center, 0, sizeof moved.center);
    out->plane_count = f->plane_count;
    for (uint32_t k = 0; k < f->plane_count; ++k) {
        extremes x = along(&origin, &f->planes[k], &moved);
        out->planes[k] = f->planes[k];
        out->outer[k] = x.most;
        out->inner[k] = x.least;
    }
    out->empty = v->kind == UMB_VOLUME_HULL && v->point_count == 0;
}

umb_place umb_bounds_test_point(const umb_bounds_swept *s, const double at[3])
{
    umb_place place = UMB_PLACE_INSIDE;
    umb_vec3 d = umb_vec3_sub(umb_vec3_from_double(at), umb_vec3_from_double(s->eye));
    double size = umb_vec3_sum_abs(d);
    for (uint32_t k = 0; k < s->plane_count; ++k) {
        const umb_bounds_plane *p = &s->planes[k];
        double way = umb_vec3_dot(umb_vec3_from_double(p->n), d);
        double e = 32.0 * V * (p->size * size + fabs(s->outer[k]) + fabs(s->inner[k])) + p->error;
        if (way + s->outer[k] < -e) {
            return UMB_PLACE_OUTSIDE;
        }
        place = way + s->inner[k] >= e ? place : UMB_PLACE_CROSSING;
    }
    return s->empty ? UMB_PLACE_OUTSIDE : place;
}

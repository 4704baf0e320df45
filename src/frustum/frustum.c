/* Planes in the form that the box kernels want, and the bound of their rounding.
 *
 * The closed frustum is the set of points with g(p) = n.d + c >= 0 for every plane, where d = p -
 * eye and n, c are what view.h defines, in real numbers. A box is outside when g < 0 at its corner
 * farthest along n, for one plane; it is wholly inside a plane when g >= 0 at the opposite corner.
 * The kernels compute, in float,
 *
 *     d_i = (p_i - high_i) - low_i        G = ((n_0 d_0 + n_1 d_1) + n_2 d_2) + c
 *
 * Let u = 2^-24, v = 2^-53, m the largest |n_i| (m <= 1/4), D the sum over the axes of the larger |d_i|
 * of the box's two faces, e the eye. Against the exact g at the same corner these errors arise:
 *
 *   e to two floats    |e - high - low| <= u |low| <= u^2 |e|           u^2 |e_i| in d_i
 *   p - high           u |p - high| <= u |d| + u^2 |e|                  u |d_i| + u^2 |e_i| in d_i
 *   - low              u of the result                                  u |d_i| in d_i
 *   n in double        side planes, axis - x forward: v (|x f_i| + |n_i|), one product, one difference;
 *                      before scaling m >= sqrt(1 + x^2) / sqrt(3), less 1e-6, so under 8 v m <= u^2 m
 *                                                                       u^2 m |d_i|
 *   n to float         half a unit                                      u |n_i d_i|
 *   three products     u each                                           u |n_i d_i|
 *   three sums         u of partial sums                                3 u sum |n_i d_i| + u |c|
 *   c to float         half a unit                                      u |c|
 *
 * The sum is 7 u m D + 3 u^2 m D + 2 u |c| + 2 u^2 m sum |e_i|, and terms of second order that are
 * below 2^-20 of these. The kernels take E = 2^-23 D >= 8 u m D; its eighth unit pays for the u^2 term,
 * second order, and the six roundings of D and that of E + slack. slack has what does not depend on the
 * box: 3 u |c| + 4 u^2 m sum |e_i|, the error of c itself, and 2^-118 for underflow: fewer than 40
 * operations lose up to 2^-126 each, even where denormals are flushed to zero (a flushed n_i loses less
 * than the u^2 term has).
 *
 * So G < -(E + slack) proves the corner outside, and G > E + slack proves it inside.
 *
 * Range: |d_i| <= FLT_MAX, because the eye is at most 1e30, under half a unit in the last place there.
 * So |n.d| <= 0.75 FLT_MAX < 2.6e38 and E is finite. c is cut to +-3e38, where n.d cannot change its
 * sign any more. G may become an infinity of the right sign; a NaN cannot arise. A slack beyond 1e38
 * becomes infinite: that plane then decides nothing.
 */
#include "frustum.h"

#include <math.h>

#include "box_kernels.h"
#include "geometry/vec.h"

#define U 0x1p-24
#define V 0x1p-53
#define C_LARGEST 3e38

/* A plane before it is scaled: normal, constant relative to the eye, bound of that constant's
 * error. */
typedef struct wide_plane {
    umb_vec3 n;
    double c, c_error;
} wide_plane;

static void add_plane(umb_frustum *f, const umb_view *view, wide_plane p)
{
    umb_frustum_plane *out = &f->planes[f->plane_count];
    double n[3] = {p.n.x, p.n.y, p.n.z};
    int exponent;
    frexp(fmax(fabs(n[0]), fmax(fabs(n[1]), fabs(n[2]))), &exponent);
    int shift = -2 - exponent;
    double c = ldexp(p.c, shift);
    double eye = umb_vec3_sum_abs(umb_vec3_from_double(view->eye));
    double slack = 3.0 * U * fabs(c) + U * U * eye + ldexp(p.c_error, shift) + 0x1p-118;
    for (int i = 0; i < 3; ++i) {
        out->n[i] = (float)ldexp(n[i], shift);
        out->farther[i] = umb_box_face(i, !(out->n[i] < 0.0f));
        out->nearer[i] = umb_box_face(i, out->n[i] < 0.0f);
    }
    out->c = (float)fmax(-C_LARGEST, fmin(C_LARGEST, c));
    /* The factor covers the rounding of slack itself. */
    out->slack = slack < 1e38 ? (float)(slack * (1.0 + 0x1p-20)) : INFINITY;
    f->all_planes = (uint16_t)(f->all_planes | 1u << f->plane_count);
    f->plane_count++;
}

/* sign (d.axis - bound depth) >= 0, or without the depth when parallel. */
static void add_side(umb_frustum *f, const umb_view *view, const double axis[3], double sign,
                     double bound)
{
    wide_plane p = {umb_vec3_scale(umb_vec3_from_double(axis), sign), 0.0, 0.0};
    if (view->projection == UMB_PERSPECTIVE) {
        p.n = umb_vec3_sub(p.n, umb_vec3_scale(umb_vec3_from_double(view->forward), sign * bound));
    } else {
        p.c = -sign * bound;
    }
    add_plane(f, view, p);
}

/* n.p + c with p = eye + d: four products and sums of at most v each, and their second order. */
static void add_extra(umb_frustum *f, const umb_view *view, const double plane[4])
{
    umb_vec3 n = umb_vec3_from_double(plane);
    umb_vec3 e = umb_vec3_from_double(view->eye);
    double size = fabs(n.x * e.x) + fabs(n.y * e.y) + fabs(n.z * e.z) + fabs(plane[3]);
    wide_plane p = {n, umb_vec3_dot(n, e) + plane[3], 5.0 * V * size};
    add_plane(f, view, p);
}

void umb_frustum_prepare(umb_frustum *f, const umb_view *view)
{
    f->plane_count = 0;
    f->all_planes = 0;
    for (int i = 0; i < 3; ++i) {
        f->eye_high[i] = (float)view->eye[i];
        f->eye_low[i] = (float)(view->eye[i] - f->eye_high[i]);
    }
    umb_vec3 forward = umb_vec3_from_double(view->forward);
    add_side(f, view, view->right, 1.0, view->x_min);
    add_side(f, view, view->right, -1.0, view->x_max);
    add_side(f, view, view->up, 1.0, view->y_min);
    add_side(f, view, view->up, -1.0, view->y_max);
    wide_plane near_plane = {forward, -view->near_depth, 0.0};
    add_plane(f, view, near_plane);
    if (!isinf(view->far_depth)) {
        wide_plane far_plane = {umb_vec3_scale(forward, -1.0), view->far_depth, 0.0};
        add_plane(f, view, far_plane);
    }
    for (uint32_t i = 0; i < view->plane_count; ++i) {
        add_extra(f, view, view->planes[i]);
    }
}

uint32_t umb_frustum_test_node(const umb_frustum *f, const struct umb_box_kernels *kernels,
                               const umb_node *node, uint16_t planes, uint8_t *remember,
                               uint16_t left[UMB_NODE_WIDTH])
{
    uint32_t tests;
    return kernels->cull(f, node, planes, remember, left, &tests);
}

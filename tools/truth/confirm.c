/* Exact confirmation of a sight-line.
 *
 * The line is the one through the eye and a given double point (orthographic: through the point,
 * along forward), and nothing about it is rounded: which of the object's triangles it crosses,
 * whether that is inside the view, and which triangles it touches before, are signs of exact sums.
 * Boxes of triangles are passed over in double, with room for its rounding; that can only add
 * triangles to look at.
 *
 * Wherever a case is left open (a line in a blocker's plane, a number too long) the answer is
 * "not confirmed": a confirmed line is free under every reading of the definition.
 */
#include <math.h>
#include <string.h>

#include "exact.h"
#include "oracle.h"

#define NEARBY_LINES 28

/* value(s) = base + s * slope along the line. */
typedef struct linear {
    exact base, slope;
} linear;

typedef struct confirmation {
    const truth *t;
    const oracle_view *v;
    const double *through;
    exact_line line;
    oracle_sight sight;
    linear beyond_near;
    exact_crossing target;
    uint32_t object;
    uint32_t only; /* the one triangle of the object that will do; MODEL_NONE: any */
    uint8_t renderer;
    bool found, lost;
} confirmation;

static bool in_range3(const double p[3])
{
    return exact_in_range(p[0]) && exact_in_range(p[1]) && exact_in_range(p[2]);
}

static bool view_in_range(const umb_view *view)
{
    bool ok = in_range3(view->eye) && in_range3(view->right) && in_range3(view->up) &&
              in_range3(view->forward) && exact_in_range(view->x_min) &&
              exact_in_range(view->x_max) && exact_in_range(view->y_min) &&
              exact_in_range(view->y_max) && exact_in_range(view->near_depth) &&
              (isinf(view->far_depth) || exact_in_range(view->far_depth));
    for (uint32_t i = 0; i < view->plane_count; ++i) {
        ok = ok && in_range3(view->planes[i]) && exact_in_range(view->planes[i][3]);
    }
    return ok;
}

/* (X(s) - from).k - limit; from NULL: zero. */
static void make_linear(const exact_line *line, const double from[3], const double k[3],
                        double limit, linear *out)
{
    exact at_origin, l;
    exact_dot(line->origin, from, k, &at_origin);
    exact_set(&l, limit);
    exact_subtract(&out->base, &at_origin, &l);
    exact_direction_dot(line, k, &out->slope);
}

static int linear_sign(confirmation *c, const linear *f, const exact_crossing *at)
{
    return exact_along_sign(at, &f->base, &f->slope, &c->lost);
}

/* Sign of (X - eye).axis - limit * (perspective: (X - eye).forward) at a crossing in front of
 * the eye. */
static int side_sign(confirmation *c, const double axis[3], double limit, const exact_crossing *at)
{
    const umb_view *view = c->v->view;
    linear f;
    if (view->projection == UMB_ORTHOGRAPHIC) {
        make_linear(&c->line, view->eye, axis, limit, &f);
        return linear_sign(c, &f, at);
    }
    exact across, along, l, scaled, difference;
    exact_direction_dot(&c->line, axis, &across);
    exact_direction_dot(&c->line, view->forward, &along);
    exact_set(&l, limit);
    exact_multiply(&scaled, &along, &l);
    exact_subtract(&difference, &across, &scaled);
    return exact_sign(&difference, &c->lost);
}

static bool in_view(confirmation *c, const exact_crossing *at)
{
    const umb_view *view = c->v->view;
    linear f;
    if (linear_sign(c, &c->beyond_near, at) < 0) {
        return false;
    }
    if (!isinf(view->far_depth)) {
        make_linear(&c->line, view->eye, view->forward, view->far_depth, &f);
        if (linear_sign(c, &f, at) > 0) {
            return false;
        }
    }
    for (uint32_t i = 0; i < view->plane_count; ++i) {
        make_linear(&c->line, NULL, view->planes[i], -view->planes[i][3], &f);
        if (linear_sign(c, &f, at) < 0) {
            return false;
        }
    }
    return side_sign(c, view->right, view->x_min, at) >= 0 &&
           side_sign(c, view->right, view->x_max, at) <= 0 &&
           side_sign(c, view->up, view->y_min, at) >= 0 &&
           side_sign(c, view->up, view->y_max, at) <= 0;
}

/* Does the point that the line was drawn through lie on an edge, exactly? */
static bool is_on_border(confirmation *c, float v[3][3])
{
    for (int i = 0; i < 3; ++i) {
        const float *a = v[i], *b = v[(i + 1) % 3];
        double from[3] = {a[0], a[1], a[2]}, to[3] = {b[0], b[1], b[2]};
        if (exact_on_segment(c->through, from, to, &c->lost)) {
            return true;
        }
    }
    return false;
}

/* Where the line meets a triangle of the object: a crossing, or, edge-on and without area, the
 * point of its border that the line was drawn through. */
static bool reach(confirmation *c, float v[3][3], exact_crossing *at)
{
    exact_meeting meeting = exact_line_triangle(&c->line, v, at, &c->lost);
    if (meeting == EXACT_IN_PLANE && is_on_border(c, v)) {
        bool perspective = c->v->view->projection == UMB_PERSPECTIVE;
        exact_set(&at->numerator, perspective ? 1.0 : 0.0);
        exact_set(&at->denominator, 1.0);
        at->facing = 0;
        return true;
    }
    return meeting == EXACT_CROSS;
}

/* Take the triangle for a target if the renderer shows it, the view holds it and none is nearer. */
static void aim_at_triangle(confirmation *c, uint32_t triangle)
{
    float v[3][3];
    exact_crossing at;
    oracle_triangle(c->t, c->object, triangle, v);
    if (!reach(c, v, &at)) {
        return;
    }
    if (c->renderer == TRUTH_CULLING &&
        !oracle_shown(oracle_flags(c->t, c->object, triangle), at.facing)) {
        return;
    }
    if ((!c->found || exact_compare(&at, &c->target, &c->lost) < 0) && in_view(c, &at)) {
        c->target = at;
        c->found = true;
    }
}

static bool aim_at_chunk(void *user, const oracle_chunk *chunk)
{
    confirmation *c = user;
    for (uint32_t i = chunk->first; chunk->object == c->object && i < chunk->last; ++i) {
        aim_at_triangle(c, i);
    }
    return true;
}

/* The nearest point of what is claimed on the line that the renderer shows and the view holds. */
static bool find_target(confirmation *c)
{
    if (c->only != MODEL_NONE) {
        aim_at_triangle(c, c->only);
        return c->found && !c->lost;
    }
    double end[3];
    double length = c->v->far_depth - c->v->view->near_depth;
    oracle_sight_at(&c->sight, length + 1e-6 * fabs(length), end);
    oracle_boxes_walk(c->t, c->sight.from, end, aim_at_chunk, c);
    return c->found && !c->lost;
}

static bool all_nearer_than_near(confirmation *c, float v[3][3])
{
    const umb_view *view = c->v->view;
    for (int i = 0; i < 3; ++i) {
        double p[3] = {v[i][0], v[i][1], v[i][2]};
        exact depth, near_depth, beyond;
        exact_dot(p, view->eye, view->forward, &depth);
        exact_set(&near_depth, view->near_depth);
        exact_subtract(&beyond, &depth, &near_depth);
        if (exact_sign(&beyond, &c->lost) >= 0) {
            return false;
        }
    }
    return true;
}

static bool blocks(confirmation *c, uint32_t object, uint32_t triangle)
{
    float v[3][3];
    exact_crossing at;
    uint8_t flags = oracle_flags(c->t, object, triangle);
    if (flags & UMB_TRIANGLE_OPEN) {
        return false;
    }
    oracle_triangle(c->t, object, triangle, v);
    switch (exact_line_triangle(&c->line, v, &at, &c->lost)) {
    case EXACT_MISS:
        return false;
    case EXACT_IN_PLANE:
        return !exact_degenerate(v, &c->lost) &&
               !exact_in_plane_free(&c->line, v, &c->target, &c->lost) &&
               !all_nearer_than_near(c, v);
    case EXACT_CROSS:
        break;
    }
    if (c->renderer == TRUTH_CULLING && !oracle_shown(flags, at.facing)) {
        return false;
    }
    return linear_sign(c, &c->beyond_near, &at) >= 0 && exact_compare(&at, &c->target, &c->lost) < 0;
}

static bool passes_chunk(void *user, const oracle_chunk *chunk)
{
    confirmation *c = user;
    for (uint32_t k = chunk->first; k < chunk->last; ++k) {
        if (blocks(c, chunk->object, k) || c->lost) {
            return false;
        }
    }
    return true;
}

/* What is said to be seen, and where rays met it. */
typedef struct claim {
    uint32_t object, triangle;
    bool only; /* nothing but that triangle will do */
    uint8_t renderer;
} claim;

static bool confirm_line(const truth *t, const oracle_view *v, const double through[3],
                         const claim *what, truth_witness *out)
{
    const umb_view *view = v->view;
    uint8_t renderer = what->renderer;
    confirmation c = {.t = t,
                      .v = v,
                      .through = through,
                      .object = what->object,
                      .only = what->only ? what->triangle : MODEL_NONE,
                      .renderer = renderer};
    if (!view_in_range(view) || !in_range3(through) || !oracle_sight_make(v, through, &c.sight)) {
        return false;
    }
    if (view->projection == UMB_PERSPECTIVE) {
        exact_line_through(&c.line, view->eye, through);
    } else {
        exact_line_along(&c.line, through, view->forward);
    }
    make_linear(&c.line, view->eye, view->forward, view->near_depth, &c.beyond_near);
    if (exact_sign(&c.beyond_near.slope, &c.lost) <= 0 || !find_target(&c)) {
        return false;
    }
    double s = exact_estimate(&c.target.numerator) / exact_estimate(&c.target.denominator);
    truth_witness w = {.renderers = renderer, .confirmed = 1};
    for (int i = 0; i < 3; ++i) {
        w.from[i] = c.sight.from[i];
        w.to[i] = c.line.origin[i] + s * c.line.approximate[i];
    }
    if (!oracle_boxes_walk(t, w.from, w.to, passes_chunk, &c) || c.lost) {
        return false;
    }
    *out = w;
    return true;
}

bool oracle_confirm(const truth *t, const oracle_view *v, const double through[3], uint32_t object,
                    uint8_t renderer, truth_witness *out)
{
    claim what = {.object = object, .triangle = MODEL_NONE, .renderer = renderer};
    return confirm_line(t, v, through, &what, out);
}

/* What has no area, or none seen from here, is met only by lines drawn through points of its
 * border that doubles can say: corners, and 1024ths of an edge near the point where rays met it. */
static bool confirm_on_border(const truth *t, const oracle_view *v, const double through[3],
                              const claim *what, float corner[3][3], truth_witness *out)
{
    for (int k = 0; k < 3; ++k) {
        const float *a = corner[k], *b = corner[(k + 1) % 3];
        double along = 0.0, square = 0.0;
        for (int i = 0; i < 3; ++i) {
            along += (through[i] - a[i]) * ((double)b[i] - a[i]);
            square += ((double)b[i] - a[i]) * ((double)b[i] - a[i]);
        }
        double nearest = square > 0.0 ? floor(fmin(fmax(along / square, 0.0), 1.0) * 1024.0) : 0.0;
        for (int j = -1; j < 4; ++j) {
            double point[3], share = j < 0 ? 0.0 : (nearest - 1.0 + j) / 1024.0;
            for (int i = 0; i < 3; ++i) {
                point[i] = a[i] + share * ((double)b[i] - a[i]);
            }
            if (share >= 0.0 && share <= 1.0 && confirm_line(t, v, point, what, out)) {
                return true;
            }
        }
    }
    return false;
}

static bool confirm_near(const truth *t, const oracle_view *v, const double through[3],
                         const claim *what, truth_witness *out)
{
    if (confirm_line(t, v, through, what, out)) {
        return true;
    }
    float corner[3][3];
    oracle_polygon polygon;
    oracle_triangle(t, what->object, what->triangle, corner);
    oracle_clip(v, corner, &polygon);
    for (uint32_t k = 0; k < NEARBY_LINES && polygon.count; ++k) {
        double towards[3], point[3];
        uint64_t random = oracle_mix(what->object, what->triangle, k);
        oracle_polygon_point(&polygon, UINT32_MAX, 0.0, random, towards);
        /* From a ten-millionth of the way to other points of the triangle up to all of it. */
        double step = pow(10.0, -7.0 + 0.25 * (double)(k + 1));
        for (int i = 0; i < 3; ++i) {
            point[i] = through[i] + step * (towards[i] - through[i]);
        }
        if (confirm_line(t, v, point, what, out)) {
            return true;
        }
    }
    return confirm_on_border(t, v, through, what, corner, out);
}

bool oracle_confirm_near(const truth *t, const oracle_view *v, const double through[3],
                         uint32_t object, uint32_t triangle, uint8_t renderer, truth_witness *out)
{
    claim what = {.object = object, .triangle = triangle, .renderer = renderer};
    return confirm_near(t, v, through, &what, out);
}

bool oracle_confirm_triangle(const truth *t, const oracle_view *v, const double through[3],
                             uint32_t object, uint32_t triangle, uint8_t renderer,
                             truth_witness *out)
{
    claim what = {.object = object, .triangle = triangle, .only = true, .renderer = renderer};
    return confirm_near(t, v, through, &what, out);
}

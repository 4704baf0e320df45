/* Boxes against a frustum, all of Hoff's cases (Gummerus 4.2): two convex polyhedra have no point in common if and only if
 * one of these directions tells them apart: a face's normal of one or the other, or a cross product of an edge of each.
 *
 *        frustum's faces    6   by umb_bounds_test()
 *        box's faces        3
 *        edge x edge    3 x 6   (a parallel view's frustum has 3 directions of edges)
 *
 * A direction is taken as the doubles that it was computed to be, so only what both sides measure along it can be off:
 * an answer that they are apart needs no exact direction.
 *
 * Corners solve  right.d = X, up.d = Y, forward.d = Z  by the adjugate. Axes are within 1e-6 of orthonormal: each
 * cofactor is off by at most 4 v, the determinant, near 1 or -1, by 12 v, so each entry of the inverse by under 20 v, and a
 * component of d by under 32 v (|X| + |Y| + |Z|) with the products, sums and the rounding of X and Y themselves.
 */
#include <math.h>
#include <string.h>

#include "bounds_parts.h"
#include "geometry/vec.h"

#define V 0x1p-53
#define TOO_SMALL 1e-290

static umb_vec3 solve(const umb_bounds_frustum *f, double x, double y, double z)
{
    umb_vec3 r = umb_vec3_from_double(f->axis[0]), u = umb_vec3_from_double(f->axis[1]);
    umb_vec3 w = umb_vec3_from_double(f->axis[2]);
    umb_vec3 uw = umb_vec3_cross(u, w), wr = umb_vec3_cross(w, r), ru = umb_vec3_cross(r, u);
    umb_vec3 sum = umb_vec3_add(umb_vec3_add(umb_vec3_scale(uw, x), umb_vec3_scale(wr, y)), umb_vec3_scale(ru, z));
    return umb_vec3_scale(sum, 1.0 / umb_vec3_dot(r, uw));
}

static void store(double out[3], umb_vec3 v)
{
    out[0] = v.x;
    out[1] = v.y;
    out[2] = v.z;
}

void umb_bounds_find_edges(umb_bounds_frustum *f)
{
    for (uint32_t k = 0; k < 8; ++k) {
        bool way = f->endless && k >= 4;
        double depth = way ? 1.0 : f->bound[k < 4 ? 4 : 5], scale = f->perspective ? depth : way ? 0.0 : 1.0;
        double x = f->bound[k & 1u] * scale, y = f->bound[2 + (k >> 1 & 1u)] * scale;
        store(f->corner[k], solve(f, x, y, depth));
        f->corner_error[k] = 64.0 * V * (fabs(x) + fabs(y) + fabs(depth)) + TOO_SMALL;
    }
    store(f->edge[0], solve(f, 1.0, 0.0, 0.0));
    store(f->edge[1], solve(f, 0.0, 1.0, 0.0));
    f->edge_count = f->perspective ? 6 : 3;
    for (uint32_t k = 2; k < f->edge_count; ++k) {
        double scale = f->perspective ? 1.0 : 0.0;
        store(f->edge[k], solve(f, scale * f->bound[k & 1u], scale * f->bound[2 + (k >> 1 & 1u)], 1.0));
    }
}

/* A box of either kind: halves are exact or, for a box with sides, within v of what it is around a middle that is
 * within v, too. */
typedef struct block {
    umb_vec3 center, half[3]; /* relative to the eye */
    double size;              /* of the terms that these came from */
} block;

static block block_of(const umb_bounds_frustum *f, const umb_volume *v)
{
    block b;
    umb_vec3 eye = umb_vec3_from_double(f->eye);
    if (v->kind == UMB_VOLUME_BOX) {
        umb_vec3 low = umb_vec3_from_float(v->box.min), high = umb_vec3_from_float(v->box.max);
        umb_vec3 half = umb_vec3_scale(umb_vec3_sub(high, low), 0.5);
        umb_vec3 middle = umb_vec3_scale(umb_vec3_add(high, low), 0.5);
        b.center = umb_vec3_sub(middle, eye);
        b.half[0] = umb_vec3_make(half.x, 0.0, 0.0);
        b.half[1] = umb_vec3_make(0.0, half.y, 0.0);
        b.half[2] = umb_vec3_make(0.0, 0.0, half.z);
        b.size = umb_vec3_sum_abs(middle) + umb_vec3_sum_abs(half);
    } else {
        b.center = umb_vec3_sub(umb_vec3_from_double(v->center), eye);
        b.size = 0.0;
        for (int i = 0; i < 3; ++i) {
            b.half[i] = umb_vec3_from_double(v->axis[i]);
            b.size += umb_vec3_sum_abs(b.half[i]);
        }
    }
    b.size += umb_vec3_sum_abs(b.center);
    return b;
}

/* True if the box lies surely farther along a direction than all of the frustum. blur: what the height of a corner or a
 * way may be off, in parts of the direction's size.
 *
 * Where the frustum has no end, its ways must surely not lead along the direction. Those that run at right angles to it
 * would not be sure, and they are what separates beside an edge: so the direction is tilted back by four times what they
 * can be off. All of them lead forward by 1. */
static bool beyond(const umb_bounds_frustum *f, const block *b, umb_vec3 way, double blur)
{
    if (f->endless) {
        double tilt = 4.0 * blur * umb_vec3_sum_abs(way) + TOO_SMALL;
        way = umb_vec3_sub(way, umb_vec3_scale(umb_vec3_from_double(f->axis[2]), tilt));
    }
    double high = -INFINITY, way_high = -INFINITY, length = umb_vec3_sum_abs(way), half = 0.0;
    for (uint32_t k = 0; k < 4; ++k) {
        high = fmax(high, umb_vec3_dot(way, umb_vec3_from_double(f->corner[k])));
        way_high = fmax(way_high, umb_vec3_dot(way, umb_vec3_from_double(f->corner[4 + k])));
    }
    if (f->endless && !(way_high + blur * length < 0.0)) {
        return false;
    }
    high = (f->endless ? high : fmax(high, way_high)) + blur * length;
    for (int i = 0; i < 3; ++i) {
        half += fabs(umb_vec3_dot(way, b->half[i]));
    }
    /* 4 v for what the block's own numbers are off, 8 v for products and sums. */
    half += 16.0 * V * length * b->size + TOO_SMALL;
    return umb_vec3_dot(way, b->center) - half > high;
}

static bool apart(const umb_bounds_frustum *f, const block *b, umb_vec3 way, double blur)
{
    return beyond(f, b, way, blur) || beyond(f, b, umb_vec3_scale(way, -1.0), blur);
}

/* What the height of any corner or way may be off, in parts of the direction's size: the corner's own error, and 8 v for
 * products and sums. */
static double blur_of(const umb_bounds_frustum *f)
{
    double most = TOO_SMALL;
    for (uint32_t k = 0; k < 8; ++k) {
        most = fmax(most, f->corner_error[k] + 8.0 * V * umb_vec3_sum_abs(umb_vec3_from_double(f->corner[k])));
    }
    return most;
}

/* True if the box's middle is in the frustum, as most are that are no special case. */
static bool holds_middle(const umb_bounds_frustum *f, const block *b)
{
    for (uint32_t k = 0; k < f->plane_count; ++k) {
        if (umb_vec3_dot(umb_vec3_from_double(f->planes[k].n), b->center) + f->planes[k].c < 0.0) {
            return false;
        }
    }
    return true;
}

umb_place umb_bounds_test_exact(const umb_bounds_frustum *f, const umb_volume *v)
{
    umb_place place = umb_bounds_test(f, v);
    if (place != UMB_PLACE_CROSSING || (v->kind != UMB_VOLUME_BOX && v->kind != UMB_VOLUME_ORIENTED_BOX)) {
        return place;
    }
    block b = block_of(f, v);
    if (holds_middle(f, &b)) {
        return place;
    }
    double blur = blur_of(f);
    for (int i = 0; i < 3; ++i) {
        /* A side's own length says nothing of a direction: flat boxes have faces too. */
        umb_vec3 face = v->kind == UMB_VOLUME_BOX ? umb_vec3_make(i == 0, i == 1, i == 2)
                                                  : umb_vec3_cross(b.half[(i + 1) % 3], b.half[(i + 2) % 3]);
        if (apart(f, &b, face, blur)) {
            return UMB_PLACE_OUTSIDE;
        }
        for (uint32_t k = 0; k < f->edge_count; ++k) {
            umb_vec3 edge = v->kind == UMB_VOLUME_BOX ? umb_vec3_make(i == 0, i == 1, i == 2) : b.half[i];
            if (apart(f, &b, umb_vec3_cross(edge, umb_vec3_from_double(f->edge[k])), blur)) {
                return UMB_PLACE_OUTSIDE;
            }
        }
    }
    return UMB_PLACE_CROSSING;
}

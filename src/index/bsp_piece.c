#include "bsp_piece.h"

#include <math.h>
#include <string.h>

#include "geometry/orient.h"
#include "geometry/vec.h"

#define U 0x1p-53

void umb_bsp_pool_free(umb_bsp_pool *pool)
{
    umb_memory_free(pool->allocator, pool->triangles, pool->triangle_capacity * sizeof(pool->triangles[0]));
    umb_memory_free(pool->allocator, pool->outlines, pool->outline_capacity * sizeof(pool->outlines[0]));
    *pool = (umb_bsp_pool){0};
}

umb_bsp_plane umb_bsp_piece_plane(const umb_bsp_pool *pool, uint32_t triangle)
{
    const float(*c)[3] = pool->triangles[triangle].corners;
    for (int axis = 0; axis < 3; ++axis) {
        if (c[0][axis] == c[1][axis] && c[0][axis] == c[2][axis]) {
            return (umb_bsp_plane){.axis = axis, .at = c[0][axis], .triangle = triangle};
        }
    }
    umb_bsp_plane p = {.axis = (int)UMB_ORDER_TILTED, .triangle = triangle};
    umb_vec3 a = umb_vec3_from_float(c[0]);
    umb_vec3 u = umb_vec3_sub(umb_vec3_from_float(c[1]), a), v = umb_vec3_sub(umb_vec3_from_float(c[2]), a);
    umb_vec3 n = umb_vec3_cross(u, v);
    memcpy(p.from, &a, sizeof p.from);
    memcpy(p.normal, &n, sizeof p.normal);
    p.span = umb_vec3_sum_abs(u) * umb_vec3_sum_abs(v);
    return p;
}

/* ---- sides ---------------------------------------------------------------------------------- */

static uint32_t side_of_sign(int sign)
{
    return sign > 0 ? UMB_BSP_ABOVE : sign < 0 ? UMB_BSP_BELOW : 0;
}

/* By the height over a tilted plane, in units of its normal. Differences, products and sums make it off by no more than 16 units
 * of span and distance, as in geometry/side.c: beyond that the sign is certain. */
static uint32_t side_of_corner(const umb_bsp_pool *pool, const umb_bsp_plane *p, const float corner[3], bool exactly)
{
    if (p->axis != (int)UMB_ORDER_TILTED) {
        return side_of_sign((corner[p->axis] > p->at) - (corner[p->axis] < p->at));
    }
    double height = 0.0, reach = 0.0;
    for (int i = 0; i < 3; ++i) {
        double d = corner[i] - p->from[i];
        height += p->normal[i] * d;
        reach += fabs(d);
    }
    if (fabs(height) > 16.0 * U * p->span * reach) {
        return height > 0.0 ? UMB_BSP_ABOVE : UMB_BSP_BELOW;
    }
    const float(*t)[3] = pool->triangles[p->triangle].corners;
    return exactly ? side_of_sign(umb_orient(t[0], t[1], t[2], corner)) : 0;
}

/* Where a box surely lies that is on one side of a tilted plane; both if that is not certain. The highest and the lowest corner
 * are those that the normal as computed says: a component of it that has the wrong sign is smaller than its error, 4 units of
 * span, and the bound has room for that times the distance of the farthest corner. */
static uint32_t side_of_whole_box(const umb_bsp_plane *p, const umb_aabb *box)
{
    double low = 0.0, high = 0.0, reach = 0.0;
    for (int i = 0; i < 3; ++i) {
        double from = box->min[i] - p->from[i], to = box->max[i] - p->from[i], a = p->normal[i] * from, b = p->normal[i] * to;
        low += a < b ? a : b;
        high += a < b ? b : a;
        reach += fabs(from) > fabs(to) ? fabs(from) : fabs(to);
    }
    double off = 16.0 * U * p->span * reach;
    return low > off ? UMB_BSP_ABOVE : high < -off ? UMB_BSP_BELOW : UMB_BSP_BELOW | UMB_BSP_ABOVE;
}

static uint32_t sides_of_box(const umb_bsp_pool *pool, const umb_bsp_plane *p, const umb_aabb *box, bool exactly)
{
    if (p->axis != (int)UMB_ORDER_TILTED) {
        return side_of_corner(pool, p, box->min, exactly) | side_of_corner(pool, p, box->max, exactly);
    }
    uint32_t sides = 0;
    for (int k = 0; k < 8 && sides != (UMB_BSP_BELOW | UMB_BSP_ABOVE); ++k) {
        const float corner[3] = {k & 1 ? box->max[0] : box->min[0], k & 2 ? box->max[1] : box->min[1],
                                 k & 4 ? box->max[2] : box->min[2]};
        sides |= side_of_corner(pool, p, corner, exactly);
    }
    return sides;
}

/* Heights of an outline's corners over a plane, and a bound of what they may be off; the size is the sum of the
 * absolute components of the normal. */
typedef struct heights {
    double at[UMB_BSP_CORNERS];
    double off, size;
} heights;

/* n.(p - a): differences, products and sums as in geometry/side.c, 16 units of the lengths; across an axis one
 * rounding. */
static void find_heights(const umb_bsp_pool *pool, const umb_bsp_plane *p, const umb_bsp_outline *o, heights *h)
{
    umb_vec3 a = {0, 0, 0}, n = {p->axis == 0, p->axis == 1, p->axis == 2};
    double span = 1.0;
    if (p->axis == (int)UMB_ORDER_TILTED) {
        const float(*t)[3] = pool->triangles[p->triangle].corners;
        a = umb_vec3_from_float(t[0]);
        umb_vec3 u = umb_vec3_sub(umb_vec3_from_float(t[1]), a), v = umb_vec3_sub(umb_vec3_from_float(t[2]), a);
        n = umb_vec3_cross(u, v);
        span = umb_vec3_sum_abs(u) * umb_vec3_sum_abs(v);
    }
    h->size = span; /* at least every component of the normal, and their sum's worth */
    h->off = 0.0;
    for (uint32_t k = 0; k < o->count; ++k) {
        umb_vec3 d = umb_vec3_sub(umb_vec3_from_double(o->corners[k]), a);
        double reach = umb_vec3_sum_abs(d) + (p->axis == (int)UMB_ORDER_TILTED ? 0.0 : fabs((double)p->at));
        h->at[k] = p->axis == (int)UMB_ORDER_TILTED ? umb_vec3_dot(n, d) : umb_vec3_dot(n, d) - p->at;
        h->off = fmax(h->off, 16.0 * U * span * reach);
    }
    /* A point of the piece is within off of the hull along each axis; |n|_1 <= 3 max |n_i| <= 3 span. */
    h->off += 3.0 * span * o->off;
}

static uint32_t sides_of_outline(const umb_bsp_pool *pool, const umb_bsp_plane *plane, const umb_bsp_outline *o)
{
    heights h;
    find_heights(pool, plane, o, &h);
    bool below = false, above = false;
    for (uint32_t k = 0; k < o->count; ++k) {
        below = below || h.at[k] < h.off;
        above = above || h.at[k] > -h.off;
    }
    return (below ? UMB_BSP_BELOW : 0u) | (above ? UMB_BSP_ABOVE : 0u);
}

static uint32_t find_sides(const umb_bsp_pool *pool, const umb_bsp_piece *piece, const umb_bsp_plane *plane, bool exactly)
{
    uint32_t sides = 0;
    if (plane->axis == (int)UMB_ORDER_TILTED) {
        sides = side_of_whole_box(plane, &piece->box);
        if (sides != (UMB_BSP_BELOW | UMB_BSP_ABOVE)) {
            return sides;
        }
    }
    if (piece->triangle == UMB_NONE) {
        return sides_of_box(pool, plane, &piece->box, exactly);
    }
    sides = 0;
    for (int k = 0; k < 3; ++k) {
        sides |= side_of_corner(pool, plane, pool->triangles[piece->triangle].corners[k], exactly);
    }
    if (sides == (UMB_BSP_BELOW | UMB_BSP_ABOVE)) { /* the box may have been cut by planes across axes */
        sides &= sides_of_box(pool, plane, &piece->box, exactly);
    }
    if (piece->outline == UMB_NONE || sides != (UMB_BSP_BELOW | UMB_BSP_ABOVE)) {
        return sides;
    }
    return sides_of_outline(pool, plane, &pool->outlines[piece->outline]);
}

uint32_t umb_bsp_piece_sides(const umb_bsp_pool *pool, const umb_bsp_piece *piece, const umb_bsp_plane *plane)
{
    return find_sides(pool, piece, plane, true);
}

uint32_t umb_bsp_piece_sides_about(const umb_bsp_pool *pool, const umb_bsp_piece *piece, const umb_bsp_plane *plane)
{
    return find_sides(pool, piece, plane, false);
}

/* ---- cutting -------------------------------------------------------------------------------- */

/* Keep the corners on the upper side (sign 1) of the plane and of a strip of off below it, and the points where edges
 * cross its border: a convex hull that holds all points of the old one whose true height is at least 0. */
static bool clip(const umb_bsp_outline *o, const heights *h, double sign, umb_bsp_outline *out)
{
    double largest = 0.0;
    out->count = 0;
    for (uint32_t k = 0; k < o->count; ++k) {
        uint32_t next = k + 1 < o->count ? k + 1 : 0;
        double here = sign * h->at[k] + h->off, there = sign * h->at[next] + h->off;
        if (here >= 0.0) {
            if (out->count == UMB_BSP_CORNERS) {
                return false;
            }
            memcpy(out->corners[out->count++], o->corners[k], sizeof(out->corners[0]));
        }
        if ((here < 0.0) != (there < 0.0)) {
            if (out->count == UMB_BSP_CORNERS) {
                return false;
            }
            double t = here / (here - there);
            for (int i = 0; i < 3; ++i) {
                double from = o->corners[k][i], to = o->corners[next][i];
                out->corners[out->count][i] = from + t * (to - from);
                largest = fmax(largest, fmax(fabs(from), fabs(to)));
            }
            ++out->count;
        }
    }
    /* t has three roundings, the point three more, of at most twice the largest coordinate. */
    out->off = o->off + 16.0 * U * largest;
    return out->count > 0;
}

static float down(double x)
{
    float f = (float)fmax(x, -3.4e38);
    return (double)f > x ? nextafterf(f, -INFINITY) : f;
}

static float up(double x)
{
    float f = (float)fmin(x, 3.4e38);
    return (double)f < x ? nextafterf(f, INFINITY) : f;
}

/* Narrow a box to an outline. */
static void narrow(umb_aabb *box, const umb_bsp_outline *o)
{
    for (int i = 0; i < 3; ++i) {
        double low = o->corners[0][i], high = low;
        for (uint32_t k = 1; k < o->count; ++k) {
            low = fmin(low, o->corners[k][i]);
            high = fmax(high, o->corners[k][i]);
        }
        float min = down(low - 2.0 * o->off), max = up(high + 2.0 * o->off);
        box->min[i] = min > box->min[i] && min <= box->max[i] ? min : box->min[i];
        box->max[i] = max < box->max[i] && max >= box->min[i] ? max : box->max[i];
    }
}

static umb_bsp_outline outline_of(const umb_bsp_pool *pool, const umb_bsp_piece *piece)
{
    if (piece->outline != UMB_NONE) {
        return pool->outlines[piece->outline];
    }
    umb_bsp_outline o = {.count = 3};
    for (int k = 0; k < 9; ++k) {
        o.corners[k / 3][k % 3] = pool->triangles[piece->triangle].corners[k / 3][k % 3];
    }
    return o;
}

bool umb_bsp_piece_cut(umb_bsp_pool *pool, const umb_bsp_piece *piece, const umb_bsp_plane *plane, uint32_t side,
                       bool cut, umb_bsp_piece *out)
{
    umb_bsp_outline next;
    heights h;
    *out = *piece;
    if (plane->axis != (int)UMB_ORDER_TILTED && side == UMB_BSP_BELOW && out->box.max[plane->axis] > plane->at) {
        out->box.max[plane->axis] = plane->at;
    }
    if (plane->axis != (int)UMB_ORDER_TILTED && side == UMB_BSP_ABOVE && out->box.min[plane->axis] < plane->at) {
        out->box.min[plane->axis] = plane->at;
    }
    if (!cut || piece->triangle == UMB_NONE) {
        return true;
    }
    umb_bsp_outline whole = outline_of(pool, piece);
    find_heights(pool, plane, &whole, &h);
    if (!clip(&whole, &h, side == UMB_BSP_ABOVE ? 1.0 : -1.0, &next)) {
        return true; /* too many corners: it keeps the outline that it has */
    }
    if (!umb_memory_reserve(pool->allocator, (void **)&pool->outlines, &pool->outline_capacity,
                            (size_t)pool->outline_count + 1, sizeof(pool->outlines[0]))) {
        return false;
    }
    out->outline = pool->outline_count;
    pool->outlines[pool->outline_count++] = next;
    narrow(&out->box, &next);
    return true;
}

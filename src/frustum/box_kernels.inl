/* The kernels, over eight lanes without a branch: box_kernels_ISA.c includes this with KERNELS defined
 * and is compiled with that instruction set's flags. No lane depends on another, sums run x, y, z: so every
 * build gives the same bits.
 *
 * Bounds: frustum.c for cull, below for project.
 */
#include <math.h>

#include "base/simd.h"
#include "box_kernels.h"

#define LANES UMB_NODE_WIDTH

/* ---- frustum -------------------------------------------------------------------------------- */

/* Faces relative to the eye, in the places of umb_box_face(), and E of frustum.c. */
typedef struct near_boxes {
    float face[6 * LANES];
    umb_fv error[UMB_PARTS];
} near_boxes;

UMB_INLINE void approach(const umb_frustum *f, const umb_node *node, near_boxes *b)
{
    for (int part = 0; part < UMB_PARTS; ++part) {
        int at = part * UMB_LANES;
        umb_fv sum = umb_fv_set(0.0f);
        for (int axis = 0; axis < 3; ++axis) {
            umb_fv low = (umb_fv_load(node->min[axis] + at) - f->eye_high[axis]) - f->eye_low[axis];
            umb_fv high = (umb_fv_load(node->max[axis] + at) - f->eye_high[axis]) - f->eye_low[axis];
            umb_fv_store(b->face + axis * LANES + at, low);
            umb_fv_store(b->face + (3 + axis) * LANES + at, high);
            sum += 0x1p-23f * umb_fv_max(umb_fv_abs(low), umb_fv_abs(high));
        }
        b->error[part] = sum;
    }
}

/* G of frustum.c at the corner made of these faces. */
UMB_INLINE umb_fv plane_at(const near_boxes *b, const umb_frustum_plane *p, const uint8_t faces[3], int part)
{
    const float *face = b->face + part * UMB_LANES;
    umb_fv x = umb_fv_load(face + faces[0]);
    umb_fv y = umb_fv_load(face + faces[1]);
    umb_fv z = umb_fv_load(face + faces[2]);
    return ((p->n[0] * x + p->n[1] * y) + p->n[2] * z) + p->c;
}

/* A bit for each slot that is outside plane k; outside gathers them. */
UMB_INLINE uint32_t outside_plane(const umb_frustum *f, const near_boxes *b, uint32_t k, umb_iv outside[UMB_PARTS])
{
    const umb_frustum_plane *p = &f->planes[k];
    uint32_t answer = 0;
    for (int part = 0; part < UMB_PARTS; ++part) {
        umb_iv alone = plane_at(b, p, p->farther, part) < -b->error[part] - p->slack;
        outside[part] |= alone;
        answer |= umb_iv_bits(alone) << (part * UMB_LANES);
    }
    return answer;
}

typedef uint16_t half_lanes __attribute__((vector_size(2 * UMB_LANES)));

/* The planes that the contents of each slot are still to be tested against. */
UMB_INLINE void planes_left(const umb_frustum *f, const near_boxes *b, uint32_t planes,
                            const umb_iv outside[UMB_PARTS], uint16_t left[LANES])
{
    for (int part = 0; part < UMB_PARTS; ++part) {
        umb_iv crossed = umb_iv_set((int32_t)planes);
        for (uint32_t todo = planes; todo != 0; todo &= todo - 1) {
            uint32_t k = (uint32_t)__builtin_ctz(todo);
            const umb_frustum_plane *p = &f->planes[k];
            umb_iv inside = plane_at(b, p, p->nearer, part) > b->error[part] + p->slack;
            crossed &= ~(inside & umb_iv_set((int32_t)(1u << k)));
        }
        half_lanes narrow = __builtin_convertvector(crossed & ~outside[part], half_lanes);
        memcpy(left + part * UMB_LANES, &narrow, sizeof(narrow));
    }
}

/* Stops early only where all boxes lie outside of one plane, which happens to many nodes in a row or hardly to any.
 * Boxes that are outside of this plane and that are looked for after the last: a branch after each plane would be
 * guessed wrong more often than it saved work. */
static uint32_t cull(const umb_frustum *f, const umb_node *node, uint16_t planes, uint8_t *remember,
                     uint16_t left[LANES], uint32_t *tests)
{
    near_boxes b;
    umb_iv outside[UMB_PARTS] = {{0}};
    uint32_t answer = 0;
    uint32_t todo = planes;
    if (remember != NULL && *remember < UMB_FRUSTUM_PLANES && (todo >> *remember & 1u) != 0) {
        todo = 1u << *remember;
    }
    *tests = 0;
    if (planes == 0) { /* as most that lie deep in the frustum */
        memset(left, 0, LANES * sizeof(left[0]));
        return 0xFFu << node->count & 0xFFu;
    }
    approach(f, node, &b);
    for (uint32_t done = 0; todo != 0; todo = planes & ~done) {
        uint32_t k = (uint32_t)__builtin_ctz(todo);
        uint32_t alone = outside_plane(f, &b, k, outside);
        answer |= alone;
        done |= 1u << k;
        *tests += 1;
        if (alone == 0xFFu) {
            if (remember != NULL) {
                *remember = (uint8_t)k;
            }
            break;
        }
    }
    if (answer == 0xFFu) {
        memset(left, 0, LANES * sizeof(left[0]));
    } else {
        planes_left(f, &b, planes, outside, left);
    }
    return answer | (0xFFu << node->count & 0xFFu);
}

/* ---- projection ----------------------------------------------------------------------------- */

/* In floats, u = 2^-24. Let kx, ky, kw be the largest absolute components of x, y, w, D the sum over the
 * axes of the larger |d_i| of the box's faces, and R = D + 2^-22 sum |e_i|.
 *
 *   d       e to two floats u^2 |e|, two differences u each              2 u |d_i| + u^2 |e_i|
 *   X, Y, W coefficient u, product u, two sums u each, d's own           6 u k R each, 8 u with R's rounding
 *
 * The extremes of X and W over the box are at corners, and rounding is monotone: [w_min, w_max] is the
 * computed one widened by 16 u kw R.
 *
 * Perspective. Let W' be the smallest computed W; the box is testable only if W' > 2^-12 kw R, so that W is
 * within 2^-9 of itself at each corner, positive on the box, and the image of the box is the hull of the
 * images of its corners. With q = X / W and Q the larger absolute value of q's computed extremes:
 *   q                |dX| / W + |q| |dW| / W                     8 u (1 + 2^-8) (R / W') (kx + kw Q)
 *   1 / W, times X   u each                                      2 u Q
 *   cx, sum, margin  u each                                      u (Q + 2 |cx|) + u margin
 * The margin is 16 u (R / W') (kx + kw Q) + 8 u (Q + |cx|) + 2^-20, and 1 / W' stands in for R / W' with the
 * largest computed reciprocal: nearly twice the sum, which pays for the rounding of the margin itself.
 * nearness is the largest reciprocal, up by 16 u kw R / W' + 4 u of itself, twice the bound again.
 *
 * Range. A testable box has R max(kx, ky, kw) < 1e37, so nothing overflows, and W' > 1e-27: an operation
 * that underflows loses at most 2^-126, which is below 2^-36 of a pixel after the division.
 *
 * Orthographic: X as above; then the sum with cx and the margin: 16 u kx R + 8 u (|X| + |cx|) + 2^-20.
 *
 * Rows. A height within the raster has its row by a formula whose rounding is part of slack. */
#define MARGIN_REACH 0x1p-20f
#define MARGIN_IMAGE 0x1p-21f
#define MARGIN_LEAST 0x1p-20f
#define SAFE_W 0x1p-12f
#define LEAST_W 1e-27f
#define MOST_REACH 1e37f

typedef struct extent {
    umb_fv low, high;
} extent;

static inline extent extent_of(umb_fv a, umb_fv b)
{
    extent e = {umb_fv_min(a, b), umb_fv_max(a, b)};
    return e;
}

static inline extent extend(extent e, umb_fv v)
{
    extent r = {umb_fv_min(v, e.low), umb_fv_max(v, e.high)};
    return r;
}

/* Faces relative to the eye. */
typedef struct faces {
    umb_fv low[3], high[3], reach;
} faces;

static inline faces faces_of(const umb_node *node, const umb_projector *p, int at)
{
    faces f;
    f.reach = umb_fv_set(p->eye_size);
    for (int axis = 0; axis < 3; ++axis) {
        f.low[axis] = (umb_fv_load(node->min[axis] + at) - p->eye_high[axis]) - p->eye_low[axis];
        f.high[axis] = (umb_fv_load(node->max[axis] + at) - p->eye_high[axis]) - p->eye_low[axis];
        f.reach += umb_fv_max(umb_fv_abs(f.low[axis]), umb_fv_abs(f.high[axis]));
    }
    return f;
}

/* What all projections end with: pixels and depths. x, y, w: computed extremes; margins in pixels. */
typedef struct bounds {
    extent x, y, w;
    umb_fv margin_x, margin_y, off_w, nearness;
    umb_iv sane; /* nothing has overflowed */
    umb_iv testable;
} bounds;

static inline umb_fv row_of(const umb_projector *p, umb_fv y)
{
    umb_fv zero = umb_fv_set(0.0f);
    y = umb_fv_clamp(y, zero, umb_fv_set(p->height));
    return p->slope * y + p->extra * umb_fv_clamp(y - p->from, zero, umb_fv_set(p->span));
}

static inline void finish(const umb_projector *p, const bounds *b, int at, umb_projected *out)
{
    umb_fv zero = umb_fv_set(0.0f);
    umb_fv last_x = umb_fv_set(p->width - 1.0f);
    umb_fv last_y = umb_fv_set(p->height - 1.0f);
    umb_fv left = (b->x.low + p->cx) - b->margin_x;
    umb_fv right = (b->x.high + p->cx) + b->margin_x;
    umb_fv top = (b->y.low + p->cy) - b->margin_y;
    umb_fv bottom = (b->y.high + p->cy) + b->margin_y;
    umb_iv beside = (right < zero) | (left > p->width) | (bottom < zero) | (top > p->height);
    /* Slots that are not testable may hold anything, NaN too. */
    umb_iv ok = b->testable;
    left = umb_fv_select(ok, umb_fv_clamp(left, zero, last_x), zero);
    right = umb_fv_select(ok, umb_fv_clamp(right, zero, last_x), zero);
    top = umb_fv_select(ok, umb_fv_clamp(row_of(p, top) - p->slack, zero, last_y), zero);
    bottom = umb_fv_select(ok, umb_fv_clamp(row_of(p, bottom) + p->slack, zero, last_y), zero);
    umb_iv_store(out->x0 + at, umb_fv_trunc(left));
    umb_iv_store(out->x1 + at, umb_fv_trunc(right));
    umb_iv_store(out->y0 + at, umb_fv_trunc(top));
    umb_iv_store(out->y1 + at, umb_fv_trunc(bottom));
    umb_fv_store(out->nearness + at, umb_fv_select(ok, b->nearness, zero));
    umb_fv huge = umb_fv_set(INFINITY);
    umb_fv_store(out->w_min + at, umb_fv_select(b->sane, b->w.low - b->off_w, -huge));
    umb_fv_store(out->w_max + at, umb_fv_select(b->sane, b->w.high + b->off_w, huge));
    out->testable |= umb_iv_bits(ok) << at;
    out->beside |= umb_iv_bits(ok & beside) << at;
}

/* The smaller and larger of r.d over the box: the sum of each axis' smaller and larger product. */
static inline extent extremes_of(const float r[3], const faces *d)
{
    extent x = extent_of(r[0] * d->low[0], r[0] * d->high[0]);
    extent y = extent_of(r[1] * d->low[1], r[1] * d->high[1]);
    extent z = extent_of(r[2] * d->low[2], r[2] * d->high[2]);
    extent e = {(x.low + y.low) + z.low, (x.high + y.high) + z.high};
    return e;
}

static inline void project_parallel(const umb_node *node, const umb_projector *p, int at, umb_projected *out)
{
    faces d = faces_of(node, p, at);
    bounds b;
    b.x = extremes_of(p->x, &d);
    b.y = extremes_of(p->y, &d);
    b.w = extremes_of(p->w, &d);
    float size = p->size_x > p->size_y ? p->size_x : p->size_y;
    size = size > p->size_w ? size : p->size_w;
    umb_fv size_x = umb_fv_max(umb_fv_abs(b.x.low), umb_fv_abs(b.x.high));
    umb_fv size_y = umb_fv_max(umb_fv_abs(b.y.low), umb_fv_abs(b.y.high));
    b.margin_x = (MARGIN_REACH * p->size_x) * d.reach +
                 (MARGIN_IMAGE * (size_x + (p->cx < 0.0f ? -p->cx : p->cx)) + MARGIN_LEAST);
    b.margin_y = (MARGIN_REACH * p->size_y) * d.reach +
                 (MARGIN_IMAGE * (size_y + (p->cy < 0.0f ? -p->cy : p->cy)) + MARGIN_LEAST);
    b.off_w = (MARGIN_REACH * p->size_w) * d.reach;
    b.sane = b.testable = d.reach * size < MOST_REACH;
    umb_fv z = b.off_w - b.w.low;
    b.nearness = z + 0x1p-22f * umb_fv_abs(z);
    finish(p, &b, at, out);
}

/* Bounds from the extremes of X / W, Y / W, W and the largest reciprocal. */
static inline void finish_perspective(const umb_projector *p, const faces *d, bounds *b, umb_fv most,
                                      int at, umb_projected *out)
{
    umb_fv size_x = umb_fv_max(umb_fv_abs(b->x.low), umb_fv_abs(b->x.high));
    umb_fv size_y = umb_fv_max(umb_fv_abs(b->y.low), umb_fv_abs(b->y.high));
    umb_fv wide = MARGIN_REACH * (d->reach * most);
    b->margin_x = wide * (p->size_x + p->size_w * size_x) +
                  (MARGIN_IMAGE * (size_x + (p->cx < 0.0f ? -p->cx : p->cx)) + MARGIN_LEAST);
    b->margin_y = wide * (p->size_y + p->size_w * size_y) +
                  (MARGIN_IMAGE * (size_y + (p->cy < 0.0f ? -p->cy : p->cy)) + MARGIN_LEAST);
    b->off_w = (MARGIN_REACH * p->size_w) * d->reach;
    float size = p->size_x > p->size_y ? p->size_x : p->size_y;
    size = size > p->size_w ? size : p->size_w;
    b->sane = d->reach * size < MOST_REACH;
    b->testable = b->sane & (b->w.low > (SAFE_W * p->size_w) * d->reach) & (b->w.low > LEAST_W);
    b->nearness = most + most * (wide * p->size_w + 0x1p-22f);
    finish(p, b, at, out);
}

/* X and W do not depend on the vertical v: a box has four upright edges, and each is a column. s and t are the
 * other axes. */
UMB_INLINE void project_upright(const umb_node *node, const umb_projector *p, int v, int s, int t, int at,
                                umb_projected *out)
{
    faces d = faces_of(node, p, at);
    umb_fv x0 = p->x[s] * d.low[s], x1 = p->x[s] * d.high[s];
    umb_fv x2 = p->x[t] * d.low[t], x3 = p->x[t] * d.high[t];
    umb_fv w0 = p->w[s] * d.low[s], w1 = p->w[s] * d.high[s];
    umb_fv w2 = p->w[t] * d.low[t], w3 = p->w[t] * d.high[t];
    bounds b;
    b.w.low = umb_fv_min(w0, w1) + umb_fv_min(w2, w3);
    b.w.high = umb_fv_max(w0, w1) + umb_fv_max(w2, w3);
    umb_fv one = umb_fv_set(1.0f);
    umb_fv r0 = one / (w0 + w2), r1 = one / (w1 + w2), r2 = one / (w0 + w3), r3 = one / (w1 + w3);
    b.x = extent_of((x0 + x2) * r0, (x1 + x2) * r1);
    b.x = extend(extend(b.x, (x0 + x3) * r2), (x1 + x3) * r3);
    extent r = extend(extend(extent_of(r0, r1), r2), r3);
    extent y = extent_of(p->y[v] * d.low[v], p->y[v] * d.high[v]);
    umb_fv zero = umb_fv_set(0.0f);
    b.y.low = y.low * umb_fv_select(y.low < zero, r.high, r.low);
    b.y.high = y.high * umb_fv_select(y.high > zero, r.high, r.low);
    finish_perspective(p, &d, &b, r.high, at, out);
}

static inline void project_perspective(const umb_node *node, const umb_projector *p, int at,
                                       umb_projected *out)
{
    faces d = faces_of(node, p, at);
    umb_fv x[3][2], y[3][2], w[3][2];
    for (int axis = 0; axis < 3; ++axis) {
        x[axis][0] = p->x[axis] * d.low[axis];
        x[axis][1] = p->x[axis] * d.high[axis];
        y[axis][0] = p->y[axis] * d.low[axis];
        y[axis][1] = p->y[axis] * d.high[axis];
        w[axis][0] = p->w[axis] * d.low[axis];
        w[axis][1] = p->w[axis] * d.high[axis];
    }
    bounds b;
    b.w.low = (umb_fv_min(w[0][0], w[0][1]) + umb_fv_min(w[1][0], w[1][1])) + umb_fv_min(w[2][0], w[2][1]);
    b.w.high = (umb_fv_max(w[0][0], w[0][1]) + umb_fv_max(w[1][0], w[1][1])) + umb_fv_max(w[2][0], w[2][1]);
    umb_fv huge = umb_fv_set(INFINITY);
    extent none = {huge, -huge};
    b.x = b.y = none;
    umb_fv one = umb_fv_set(1.0f);
    umb_fv most = umb_fv_set(0.0f);
    for (int k = 0; k < 8; ++k) {
        int i = k & 1;
        int j = k >> 1 & 1;
        int l = k >> 2;
        umb_fv r = one / ((w[0][i] + w[1][j]) + w[2][l]);
        b.x = extend(b.x, ((x[0][i] + x[1][j]) + x[2][l]) * r);
        b.y = extend(b.y, ((y[0][i] + y[1][j]) + y[2][l]) * r);
        most = umb_fv_max(r, most);
    }
    finish_perspective(p, &d, &b, most, at, out);
}

static void project(const umb_node *node, const umb_projector *p, umb_projected *out)
{
    out->testable = out->beside = out->nodes = out->objects = 0;
    for (int at = 0; at < 8; at += UMB_LANES) {
        umb_iv kind = umb_iv_load(node->ref + at) & (int32_t)UMB_REF_KIND;
        out->nodes |= umb_iv_bits(kind == (int32_t)UMB_REF_NODE) << at;
        out->objects |= umb_iv_bits(kind == (int32_t)UMB_REF_OBJECT) << at;
        if (p->orthographic != 0) {
            project_parallel(node, p, at, out);
        } else if (p->vertical == 0) {
            project_upright(node, p, 0, 1, 2, at, out);
        } else if (p->vertical == 1) {
            project_upright(node, p, 1, 0, 2, at, out);
        } else if (p->vertical == 2) {
            project_upright(node, p, 2, 0, 1, at, out);
        } else {
            project_perspective(node, p, at, out);
        }
    }
}

const umb_box_kernels KERNELS = {ISA, cull, project};

/* The kernels, as loops over eight lanes without a branch: box_kernels_ISA.c includes this with
 * KERNELS defined and is compiled with that instruction set's flags. No lane depends on another,
 * sums run x, y, z, minima and maxima are (a < b ? a : b): so every build gives the same bits.
 *
 * Bounds: frustum.c for cull, below for project.
 */
#include <math.h>

#include "box_kernels.h"

#define LANES UMB_NODE_WIDTH

/* Clang would unroll these loops before it looks at them as vectors (twice the time of project). */
#if defined(__clang__)
#define LANE_LOOP _Pragma("clang loop unroll(disable)")
#else
#define LANE_LOOP
#endif

/* ---- frustum -------------------------------------------------------------------------------- */

/* Faces relative to the eye, and E of frustum.c. */
typedef struct near_boxes {
    float low[3][LANES], high[3][LANES];
    float error[LANES];
} near_boxes;

static inline void approach(const umb_frustum *f, const umb_node *node, near_boxes *b)
{
    for (int i = 0; i < LANES; ++i) {
        float sum = 0.0f;
        for (int axis = 0; axis < 3; ++axis) {
            float low = (node->min[axis][i] - f->eye_high[axis]) - f->eye_low[axis];
            float high = (node->max[axis][i] - f->eye_high[axis]) - f->eye_low[axis];
            float a = fabsf(low);
            float c = fabsf(high);
            b->low[axis][i] = low;
            b->high[axis][i] = high;
            sum += 0x1p-23f * (a > c ? a : c);
        }
        b->error[i] = sum;
    }
}

/* Which plane next: the remembered one first, then the lowest. */
static inline uint32_t first_plane(uint32_t planes, const uint8_t *remember)
{
    uint32_t plane = remember != NULL ? *remember : 0;
    if (plane >= UMB_FRUSTUM_PLANES || (planes >> plane & 1u) == 0) {
        plane = (uint32_t)__builtin_ctz(planes);
    }
    return plane;
}

static uint32_t cull(const umb_frustum *f, const umb_node *node, uint16_t planes, uint8_t *remember,
                     uint16_t left[LANES], uint32_t *tests)
{
    near_boxes b;
    uint32_t inside[LANES] = {0};
    uint32_t outside[LANES] = {0};
    uint32_t count = 0;
    uint32_t missing = LANES;
    approach(f, node, &b);
    for (uint32_t todo = planes; todo != 0;) {
        uint32_t k = first_plane(todo, count == 0 ? remember : NULL);
        const umb_frustum_plane *p = &f->planes[k];
        const float *far_x = p->n[0] < 0.0f ? b.low[0] : b.high[0];
        const float *far_y = p->n[1] < 0.0f ? b.low[1] : b.high[1];
        const float *far_z = p->n[2] < 0.0f ? b.low[2] : b.high[2];
        const float *near_x = p->n[0] < 0.0f ? b.high[0] : b.low[0];
        const float *near_y = p->n[1] < 0.0f ? b.high[1] : b.low[1];
        const float *near_z = p->n[2] < 0.0f ? b.high[2] : b.low[2];
        missing = 0;
        for (int i = 0; i < LANES; ++i) {
            float far_g = ((p->n[0] * far_x[i] + p->n[1] * far_y[i]) + p->n[2] * far_z[i]) + p->c;
            float near_g =
                ((p->n[0] * near_x[i] + p->n[1] * near_y[i]) + p->n[2] * near_z[i]) + p->c;
            float bound = b.error[i] + p->slack;
            outside[i] |= (uint32_t)(far_g < -bound);
            inside[i] |= (uint32_t)(near_g > bound) << k;
            missing += 1u - outside[i];
        }
        todo &= ~(1u << k);
        ++count;
        if (missing == 0) {
            if (remember != NULL) {
                *remember = (uint8_t)k;
            }
            break;
        }
    }
    *tests = count;
    uint32_t answer = 0xFFu << node->count & 0xFFu;
    for (int i = 0; i < LANES; ++i) {
        left[i] = (uint16_t)(outside[i] != 0 ? 0u : planes & ~inside[i]);
        answer |= outside[i] << i;
    }
    return answer;
}

/* ---- projection ----------------------------------------------------------------------------- */

/* Let v = 2^-53, kx, ky, kw the largest absolute components of x, y, w, and D the sum over the axes of
 * the larger |d_i| of the box's faces.
 *
 *   d                one difference of doubles (faces and eye are exact)      v |d_i|
 *   X, Y, W          products v, sums 2 v                                     4 v k D each, with d's
 *
 * The extremes of X and W over the box are at corners, and rounding is monotone, so the computed
 * ones are the sums of each axis' smaller or larger product. [w_min, w_max] is widened by 8 v kw D:
 * four for W, one for the widening's own rounding.
 *
 * Perspective. Let W' be the smallest computed W of the box; it is taken only if W' > 2^12 v kw D,
 * so that W is within 2^-10 of itself at each corner, positive on the box, and the image of the box
 * is the hull of the images of its corners. With q = X / W and Q the larger absolute value of the
 * computed extremes of q:
 *   q                |dX| / W + |q| |dW| / W                     4.1 v (D / W') (kx + kw Q)
 *   1 / W, times X   v each                                      2 v Q
 *   + cx, - margin   v each                                      2 v (Q + |cx|) and v margin
 * The margin is 8 v ((D / W') (kx + kw Q) + Q + |cx|) + 1e-200: nearly twice the sum, which pays for
 * the rounding of the margin (nine operations) and second order. The last term is for underflow: W'
 * is at least 1e-60, and an operation loses less than 1e-307 even where denormals are flushed.
 *
 * Orthographic: X has 4 v kx D, the sum with cx and the margin v (kx D + |cx|) each; the margin is
 * 8 v (kx D + |cx|) + 1e-200.
 */
#define MARGIN 0x1p-50 /* 8 v */
#define SAFE_W 0x1p-41 /* 2^12 v */
#define LEAST_W 1e-60

static inline double smaller(double a, double b)
{
    return a < b ? a : b;
}

static inline double larger(double a, double b)
{
    return a > b ? a : b;
}

static inline double largest_of(const double v[3])
{
    return larger(fabs(v[0]), larger(fabs(v[1]), fabs(v[2])));
}

/* d of a box's six faces: 0 the lower face of an axis, 1 the upper. Plain members, no arrays: what
 * the compilers see through when they turn the lane loops into vectors. */
typedef struct faces {
    double x0, x1, y0, y1, z0, z1;
} faces;

static inline faces faces_of(const umb_node *node, const umb_projector *p, int i)
{
    faces d = {node->min[0][i] - p->eye[0], node->max[0][i] - p->eye[0],
               node->min[1][i] - p->eye[1], node->max[1][i] - p->eye[1],
               node->min[2][i] - p->eye[2], node->max[2][i] - p->eye[2]};
    return d;
}

static inline double reach_of(faces d)
{
    return (larger(fabs(d.x0), fabs(d.x1)) + larger(fabs(d.y0), fabs(d.y1))) +
           larger(fabs(d.z0), fabs(d.z1));
}

/* The products of r.d at each face. */
static inline faces multiply(const double r[3], faces d)
{
    faces p = {r[0] * d.x0, r[0] * d.x1, r[1] * d.y0, r[1] * d.y1, r[2] * d.z0, r[2] * d.z1};
    return p;
}

static inline double least(faces p)
{
    return (smaller(p.x0, p.x1) + smaller(p.y0, p.y1)) + smaller(p.z0, p.z1);
}

static inline double greatest(faces p)
{
    return (larger(p.x0, p.x1) + larger(p.y0, p.y1)) + larger(p.z0, p.z1);
}

static void project_parallel(const umb_node *restrict node, const umb_projector *restrict p,
                             umb_projected *restrict out)
{
    double kx = MARGIN * largest_of(p->x);
    double ky = MARGIN * largest_of(p->y);
    double kw = MARGIN * largest_of(p->w);
    double bx = MARGIN * fabs(p->cx) + 1e-200;
    double by = MARGIN * fabs(p->cy) + 1e-200;
    LANE_LOOP
    for (int i = 0; i < LANES; ++i) {
        faces d = faces_of(node, p, i);
        faces x = multiply(p->x, d);
        faces y = multiply(p->y, d);
        faces w = multiply(p->w, d);
        double reach = reach_of(d);
        double mx = kx * reach + bx;
        double my = ky * reach + by;
        out->x_min[i] = (least(x) + p->cx) - mx;
        out->x_max[i] = (greatest(x) + p->cx) + mx;
        out->y_min[i] = (least(y) + p->cy) - my;
        out->y_max[i] = (greatest(y) + p->cy) + my;
        out->w_min[i] = least(w) - kw * reach;
        out->w_max[i] = greatest(w) + kw * reach;
    }
}

typedef struct extent {
    double least, most;
} extent;

static inline extent extend(extent e, double v)
{
    extent r = {smaller(v, e.least), larger(v, e.most)};
    return r;
}

/* Written out, not a loop: a loop over corners inside the loop over lanes is not made into
 * vectors. */
#define EACH_CORNER(f) f(0, 0, 0) f(1, 0, 0) f(0, 1, 0) f(1, 1, 0) f(0, 0, 1) f(1, 0, 1) f(0, 1, 1) f(1, 1, 1)
#define CORNER(p, a, b, c) (((p).x##a + (p).y##b) + (p).z##c)
#define PROJECT_CORNER(a, b, c)                                                                    \
    {                                                                                              \
        double r = 1.0 / CORNER(w, a, b, c);                                                       \
        ex = extend(ex, CORNER(x, a, b, c) * r);                                                   \
        ey = extend(ey, CORNER(y, a, b, c) * r);                                                   \
    }

static void project_perspective(const umb_node *restrict node, const umb_projector *restrict p,
                                umb_projected *restrict out)
{
    double kx = largest_of(p->x);
    double ky = largest_of(p->y);
    double kw = largest_of(p->w);
    double bx = MARGIN * fabs(p->cx) + 1e-200;
    double by = MARGIN * fabs(p->cy) + 1e-200;
    LANE_LOOP
    for (int i = 0; i < LANES; ++i) {
        faces d = faces_of(node, p, i);
        faces x = multiply(p->x, d);
        faces y = multiply(p->y, d);
        faces w = multiply(p->w, d);
        double reach = reach_of(d);
        double least_w = least(w);
        double safe = larger(SAFE_W * (kw * reach), LEAST_W);
        extent ex = {INFINITY, -INFINITY};
        extent ey = {INFINITY, -INFINITY};
        EACH_CORNER(PROJECT_CORNER)
        double wide = MARGIN * (reach * (1.0 / least_w));
        double size_x = larger(fabs(ex.least), fabs(ex.most));
        double size_y = larger(fabs(ey.least), fabs(ey.most));
        double mx = (wide * (kx + kw * size_x) + MARGIN * size_x) + bx;
        double my = (wide * (ky + kw * size_y) + MARGIN * size_y) + by;
        bool all = !(least_w > safe);
        out->x_min[i] = all ? -UMB_PROJECTED_ALL : (ex.least + p->cx) - mx;
        out->x_max[i] = all ? UMB_PROJECTED_ALL : (ex.most + p->cx) + mx;
        out->y_min[i] = all ? -UMB_PROJECTED_ALL : (ey.least + p->cy) - my;
        out->y_max[i] = all ? UMB_PROJECTED_ALL : (ey.most + p->cy) + my;
        out->w_min[i] = least_w - MARGIN * (kw * reach);
        out->w_max[i] = greatest(w) + MARGIN * (kw * reach);
    }
}

static void project(const umb_node *node, const umb_projector *p, umb_projected *out)
{
    if (p->orthographic) {
        project_parallel(node, p, out);
    } else {
        project_perspective(node, p, out);
    }
}

const umb_box_kernels KERNELS = {ISA, cull, project};

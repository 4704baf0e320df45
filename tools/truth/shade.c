#include "shade.h"

#include <float.h>
#include <math.h>

/* The exponent of the lowest bit that is set. */
static int lowest_bit(double x)
{
    int exponent;
    double m = frexp(fabs(x), &exponent);
    if (m == 0.0) {
        return 0;
    }
    uint64_t bits = (uint64_t)ldexp(m, 53);
    int zeros = 0;
    while ((bits & 1) == 0) {
        bits >>= 1;
        ++zeros;
    }
    return exponent - 53 + zeros;
}

void shade_about(covector *c)
{
    for (int i = 0; i < 3; ++i) {
        c->about[i] = exact_estimate(&c->n[i]);
    }
}

void shade_cross(exact out[3], const exact a[3], const exact b[3])
{
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        exact p, q;
        exact_multiply(&p, &a[j], &b[k]);
        exact_multiply(&q, &a[k], &b[j]);
        exact_subtract(&out[i], &p, &q);
    }
}

void shade_dot(exact *out, const exact a[3], const exact b[3])
{
    exact p, q, sum;
    exact_multiply(&p, &a[0], &b[0]);
    exact_multiply(&q, &a[1], &b[1]);
    exact_add(&sum, &p, &q);
    exact_multiply(&p, &a[2], &b[2]);
    exact_add(out, &sum, &p);
}

void shade_negate(exact *x)
{
    for (int i = 0; i < x->count; ++i) {
        x->term[i] = -x->term[i];
    }
}

void shade_value(const sight_space *c, const double axis[3], const double p[3], double limit,
                 exact *out)
{
    exact_set(out, -ldexp(limit, c->up) * SHADE_AXIS_SCALE);
    for (int i = 0; i < 3; ++i) {
        exact d, a, product, sum;
        exact_difference(&d, p[i], c->eye[i]);
        exact_set(&a, axis[i] * SHADE_AXIS_SCALE);
        exact_multiply(&product, &a, &d);
        exact_add(&sum, out, &product);
        *out = sum;
    }
}

void shade_sight(const sight_space *c, const double p[3], exact out[3])
{
    if (!c->parallel) {
        for (int i = 0; i < 3; ++i) {
            exact_difference(&out[i], p[i], c->eye[i]);
        }
        return;
    }
    /* f_k x_i - f_i x_k is the same all along the line. */
    const double *f = c->v->view->forward;
    exact along, factor, p1, p2;
    exact_difference(&along, p[c->drop], c->eye[c->drop]);
    for (int i = 0; i < 2; ++i) {
        exact d;
        exact_difference(&d, p[c->other[i]], c->eye[c->other[i]]);
        exact_set(&factor, f[c->drop] * SHADE_AXIS_SCALE);
        exact_multiply(&p1, &factor, &d);
        exact_set(&factor, f[c->other[i]] * SHADE_AXIS_SCALE);
        exact_multiply(&p2, &factor, &along);
        exact_subtract(&out[i], &p1, &p2);
    }
    exact_set(&out[2], 1.0);
}

/* The longest products have, with the signs at corners of the lines where planes meet (five
 * coordinates each), fifteen coordinates, or nine and three components of axes times limits; in
 * parallel views, which have no such lines, eleven coordinates, each with a component of forward.
 * They must not lose a bit below 2^-1074, nor reach 2^990:
 *   perspective: coordinates have bits from 2^-66 to 2^41, axes times limits from 2^-101 to 2^124;
 *   parallel: coordinates from 2^-44 to 2^25, axes from 2^-50 to 2^60. */
bool shade_holds(const sight_space *c, const double p[3])
{
    bool ok = true;
    for (int i = 0; i < 3; ++i) {
        ok = ok && (p[i] == 0.0 || (lowest_bit(p[i]) >= (c->parallel ? -44 : -66) &&
                                    fabs(p[i]) <= (c->parallel ? 0x1p25 : 0x1p41)));
    }
    return ok;
}

/* ---- signs ---- */

/* |det of approximations - det| is at most this times the sum of the products' sizes: three
 * components good to 2 units each, six more roundings, and the sum of sizes itself. */
#define FILTER (32.0 * DBL_EPSILON)

static double det_about(const double a[3], const double b[3], const double c[3], double *error)
{
    double sum = 0.0, size = 0.0;
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        sum += a[i] * (b[j] * c[k] - b[k] * c[j]);
        size += fabs(a[i]) * (fabs(b[j] * c[k]) + fabs(b[k] * c[j]));
    }
    *error = FILTER * size;
    return sum;
}

static bool may_be_exact(sight_space *c)
{
    if (++c->exacts > SHADE_MOST_EXACT) {
        c->lost = true;
    }
    return !c->lost;
}

int shade_sign(sight_space *c, const covector *f, const covector *l, const covector *m)
{
    double error, value = det_about(f->about, l->about, m->about, &error);
    if (fabs(value) > error && isfinite(error)) {
        return value > 0.0 ? 1 : -1;
    }
    if (!may_be_exact(c)) {
        return 0;
    }
    exact corner[3], sum;
    shade_cross(corner, l->n, m->n);
    shade_dot(&sum, f->n, corner);
    return exact_sign(&sum, &c->lost);
}

bool shade_nearer(sight_space *c, const shade *a, const shade *b, const covector *l,
                  const covector *m)
{
    double ea, eb;
    double va = det_about(a->nearness.about, l->about, m->about, &ea);
    double vb = det_about(b->nearness.about, l->about, m->about, &eb);
    double p = va * b->det_about, q = vb * a->det_about;
    double error = ea * b->det_about + eb * a->det_about + FILTER * (fabs(p) + fabs(q));
    if (fabs(p - q) > 2.0 * error && isfinite(error)) {
        return p > q;
    }
    if (!may_be_exact(c)) {
        return false;
    }
    exact corner[3], na, nb, x, y, difference;
    shade_cross(corner, l->n, m->n);
    shade_dot(&na, a->nearness.n, corner);
    shade_dot(&nb, b->nearness.n, corner);
    exact_multiply(&x, &na, &b->det);
    exact_multiply(&y, &nb, &a->det);
    exact_subtract(&difference, &x, &y);
    return exact_sign(&difference, &c->lost) > 0;
}

/* ---- triangles ---- */

void shade_spread(const shade *s, const exact value[3], covector *out)
{
    for (int i = 0; i < 3; ++i) {
        exact p, q, sum;
        exact_multiply(&p, &value[0], &s->side[0].n[i]);
        exact_multiply(&q, &value[1], &s->side[1].n[i]);
        exact_add(&sum, &p, &q);
        exact_multiply(&p, &value[2], &s->side[2].n[i]);
        exact_add(&out->n[i], &sum, &p);
    }
    shade_about(out);
}

void shade_behind(const shade *a, const shade *b, covector *out)
{
    for (int i = 0; i < 3; ++i) {
        exact p, q;
        exact_multiply(&p, &b->nearness.n[i], &a->det);
        exact_multiply(&q, &a->nearness.n[i], &b->det);
        exact_subtract(&out->n[i], &p, &q);
    }
    shade_about(out);
}

void shade_scale(const sight_space *c, float v[3][3], double p[3][3])
{
    for (int k = 0; k < 3; ++k) {
        for (int i = 0; i < 3; ++i) {
            p[k][i] = ldexp(v[k][i], c->up);
        }
    }
}

bool shade_make(sight_space *c, double p[3][3], shade *out, bool *turned)
{
    exact corner[3][3], depth[3];
    int nearer = 0;
    for (int k = 0; k < 3; ++k) {
        if (!shade_holds(c, p[k])) {
            return false;
        }
        shade_sight(c, p[k], corner[k]);
        shade_value(c, c->v->view->forward, p[k], c->v->view->near_depth, &depth[k]);
        nearer += exact_sign(&depth[k], &c->lost) < 0;
    }
    for (int k = 0; k < 3; ++k) {
        shade_cross(out->side[k].n, corner[(k + 1) % 3], corner[(k + 2) % 3]);
    }
    shade_dot(&out->det, corner[0], out->side[0].n);
    int sign = exact_sign(&out->det, &c->lost);
    *turned = sign < 0;
    out->facing = c->parallel && c->v->view->forward[c->drop] < 0.0 ? -sign : sign;
    for (int k = 0; k < 3; ++k) {
        for (int i = 0; i < 3 && sign < 0; ++i) {
            shade_negate(&out->side[k].n[i]);
        }
        shade_about(&out->side[k]);
    }
    if (sign < 0) {
        shade_negate(&out->det);
    }
    out->det_about = exact_estimate(&out->det);
    out->crosses_near = nearer != 0;
    if (sign == 0 || nearer == 3) {
        return false;
    }
    exact value[3];
    for (int k = 0; k < 3; ++k) {
        exact_set(&value[k], 1.0);
        if (c->parallel) {
            value[k] = depth[k];
            shade_negate(&value[k]);
        }
    }
    shade_spread(out, value, &out->nearness);
    if (out->crosses_near) {
        shade_spread(out, depth, &out->beyond);
    }
    return true;
}

uint32_t shade_view_values(const sight_space *c, double p[3][3], exact (*values)[3])
{
    const umb_view *view = c->v->view;
    const double *axes[2] = {view->right, view->up};
    double ends[2][2] = {{view->x_min, view->x_max}, {view->y_min, view->y_max}};
    uint32_t n = 0;
    for (int k = 0; k < 3; ++k) {
        uint32_t at = 0;
        exact depth, far_depth;
        shade_value(c, view->forward, p[k], view->near_depth, &values[at++][k]);
        if (!isinf(view->far_depth)) {
            shade_value(c, view->forward, p[k], view->far_depth, &far_depth);
            shade_negate(&far_depth);
            values[at++][k] = far_depth;
        }
        shade_value(c, view->forward, p[k], 0.0, &depth);
        for (int i = 0; i < 4; ++i) {
            exact across, limit, product;
            double end = ends[i / 2][i % 2];
            shade_value(c, axes[i / 2], p[k], c->parallel ? end : 0.0, &across);
            exact_set(&limit, c->parallel ? 0.0 : end);
            exact_multiply(&product, &depth, &limit);
            exact_subtract(&values[at][k], &across, &product);
            if (i % 2 == 1) {
                shade_negate(&values[at][k]);
            }
            ++at;
        }
        n = at;
    }
    return n;
}

/* Bits of the view's numbers, as shade_holds() says. */
static bool view_fits(const sight_space *c)
{
    const umb_view *view = c->v->view;
    const double *axes[3] = {view->forward, view->right, view->up};
    const double slope[4] = {view->x_min, view->x_max, view->y_min, view->y_max};
    const double length[2] = {view->near_depth, isinf(view->far_depth) ? 0.0 : view->far_depth};
    int axis = 0, limit = 0;
    bool ok = true;
    for (int k = 0; k < 9; ++k) {
        double a = axes[k / 3][k % 3];
        axis = a != 0.0 && lowest_bit(a) + 60 < axis ? lowest_bit(a) + 60 : axis;
    }
    for (int k = 0; k < 6; ++k) {
        bool along = k >= 4 || c->parallel; /* a length: multiplied as coordinates and axes are */
        double x = k < 4 ? slope[k] : length[k - 4];
        if (x != 0.0 && along) {
            ok = ok && lowest_bit(x) + c->up + 60 >= -96 && fabs(ldexp(x, c->up)) <= 0x1p64;
        } else if (x != 0.0) {
            limit = lowest_bit(x) < limit ? lowest_bit(x) : limit;
            ok = ok && fabs(x) <= 0x1p60;
        }
    }
    return ok && axis + limit >= (c->parallel ? -50 : -101);
}

bool shade_start(sight_space *c, const truth *t, const oracle_view *v)
{
    const umb_view *view = v->view;
    const umb_aabb *box = &t->model->bounds;
    double size = 0.0;
    int exponent;
    *c = (sight_space){.v = v};
    c->parallel = view->projection == UMB_ORTHOGRAPHIC;
    for (int i = 0; i < 3; ++i) {
        size = fmax(fmax(size, fabs(view->eye[i])),
                    fmax(fabs((double)box->min[i]), fabs((double)box->max[i])));
        c->drop = fabs(view->forward[i]) > fabs(view->forward[c->drop]) ? i : c->drop;
    }
    (void)frexp(size, &exponent);
    c->up = (c->parallel ? 24 : 40) - exponent;
    for (int i = 0; i < 3; ++i) {
        c->eye[i] = ldexp(view->eye[i], c->up);
    }
    c->other[0] = (c->drop + 1) % 3;
    c->other[1] = (c->drop + 2) % 3;
    return view->plane_count == 0 && shade_holds(c, c->eye) && view_fits(c);
}

/* Bounds of errors are sums over what each term of a product may be off, with 3 units 2^-53 for two products and their
 * sum (4 for three); PAD covers the roundings of the bound itself, fewer than 64, and LEAST what the smallest
 * products lose altogether. */
#include "seen.h"

#include <math.h>
#include <string.h>

#include "geometry/expansion.h"
#include "geometry/orient.h"

#define U 0x1p-53
#define PAD (1.0 + 0x1p-40)
#define LEAST 0x1p-1000

static bool same_point(const float a[3], const float b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

void umb_seen_prepare(umb_seen_from *s, const double eye[3], const double forward[3], bool parallel, double reach)
{
    int exponent = 0;
    s->parallel = parallel;
    s->axis = 2;
    s->exact = true;
    for (int i = 0; i < 3; ++i) {
        s->eye[i] = eye[i];
        s->forward[i] = forward[i];
        s->axis = fabs(forward[i]) > fabs(forward[s->axis]) ? i : s->axis;
        reach = fabs(eye[i]) > reach ? fabs(eye[i]) : reach;
    }
    (void)frexp(reach, &exponent);
    s->shift = 104 - exponent;
    for (int i = 0; i < 3; ++i) {
        bool whole = umb_bigint_from_double(eye[i], s->shift, &s->eye_whole[i]);
        bool along = umb_bigint_from_double(forward[i], 104, &s->forward_whole[i]);
        s->exact = s->exact && whole && (along || !parallel);
    }
}

/* a_i b_j - a_j b_i, and its error. */
static void cross_component(const umb_seen_vector *a, const umb_seen_vector *b, int k, umb_seen_vector *out)
{
    int i = (k + 1) % 3, j = (k + 2) % 3;
    double x = a->at[i] * b->at[j], y = a->at[j] * b->at[i];
    double off = fabs(a->at[i]) * b->off[j] + a->off[i] * (fabs(b->at[j]) + b->off[j]) +
                 fabs(a->at[j]) * b->off[i] + a->off[j] * (fabs(b->at[i]) + b->off[i]);
    out->at[k] = x - y;
    out->off[k] = (off + 3.0 * U * (fabs(x) + fabs(y))) * PAD + LEAST;
}

static void cross(const umb_seen_vector *a, const umb_seen_vector *b, umb_seen_vector *out)
{
    for (int k = 0; k < 3; ++k) {
        cross_component(a, b, k, out);
    }
}

static umb_seen_size size_of(const umb_seen_vector *v)
{
    umb_seen_size s = {fabs(v->at[0]), v->off[0]};
    for (int k = 1; k < 3; ++k) {
        double at = fabs(v->at[k]);
        s.most = at > s.most ? at : s.most;
        s.off = v->off[k] > s.off ? v->off[k] : s.off;
    }
    return s;
}

/* The image of a difference whose components have relative errors of one unit; without the last component of parallel
 * images. */
static void image_of_difference(const umb_seen_from *s, const double d[3], umb_seen_vector *out)
{
    int k = s->axis, i = (k + 1) % 3, j = (k + 2) % 3;
    const int axes[2] = {i, j};
    if (!s->parallel) {
        for (int n = 0; n < 3; ++n) {
            out->at[n] = d[n];
            out->off[n] = U * fabs(d[n]);
        }
        return;
    }
    for (int n = 0; n < 2; ++n) {
        double x = d[axes[n]] * s->forward[k], y = d[k] * s->forward[axes[n]];
        out->at[n] = x - y;
        out->off[n] = 4.0 * U * (fabs(x) + fabs(y)) + LEAST;
    }
    out->at[2] = out->off[2] = 0.0;
}

void umb_seen_image(const umb_seen_from *s, const float p[3], umb_seen_vector *out)
{
    const double d[3] = {p[0] - s->eye[0], p[1] - s->eye[1], p[2] - s->eye[2]};
    image_of_difference(s, d, out);
    if (s->parallel) {
        out->at[2] = s->forward[s->axis];
    }
}

/* image(a) x image(b) = image(a) x (image(b) - image(a)): the difference has far smaller errors. */
static void make_ready(const umb_seen_from *s, umb_seen_line *line)
{
    umb_seen_vector q, step;
    const float *a = line->a, *b = line->b;
    const double d[3] = {(double)b[0] - a[0], (double)b[1] - a[1], (double)b[2] - a[2]};
    umb_seen_image(s, a, &q);
    image_of_difference(s, d, &step);
    cross(&q, &step, &line->n);
    line->size = size_of(&line->n);
    line->ready = true;
}

void umb_seen_line_later(const float a[3], const float b[3], umb_seen_line *out)
{
    memcpy(out->a, a, sizeof out->a);
    memcpy(out->b, b, sizeof out->b);
    out->free = out->ready = false;
    out->depth = NULL;
}

void umb_seen_line_through(const umb_seen_from *s, const float a[3], const float b[3], umb_seen_line *out)
{
    umb_seen_line_later(a, b, out);
    make_ready(s, out);
}

void umb_seen_line_free(const double n[3], umb_seen_line *out)
{
    int exponent;
    double most = fmax(fabs(n[0]), fmax(fabs(n[1]), fabs(n[2])));
    (void)frexp(most, &exponent);
    for (int k = 0; k < 3; ++k) {
        out->n.at[k] = most > 0.0 ? ldexp(rint(ldexp(n[k], 53 - exponent)), exponent - 53) : 0.0;
        out->n.off[k] = 0.0;
        out->a[k] = out->b[k] = 0.0f;
    }
    out->size = size_of(&out->n);
    out->free = out->ready = true;
    out->depth = NULL;
}

void umb_seen_line_depth(const umb_seen_vector *n, const umb_seen_depth *depth, umb_seen_line *out)
{
    memset(out->a, 0, sizeof out->a);
    memset(out->b, 0, sizeof out->b);
    out->n = *n;
    out->size = size_of(n);
    out->free = out->ready = true;
    out->depth = depth;
}

void umb_seen_corner_at(const umb_seen_from *s, const float p[3], umb_seen_corner *out)
{
    umb_seen_image(s, p, &out->v);
    out->size = size_of(&out->v);
    memcpy(out->point, p, sizeof out->point);
    out->first = out->second = NULL;
    out->sign = 1;
}

void umb_seen_corner_of(const umb_seen_line *first, const umb_seen_line *second, int sign,
                         umb_seen_corner *out)
{
    cross(&first->n, &second->n, &out->v);
    if (sign < 0) {
        for (int k = 0; k < 3; ++k) {
            out->v.at[k] = -out->v.at[k];
        }
    }
    out->size = size_of(&out->v);
    out->first = first;
    out->second = second;
    out->sign = (int8_t)sign;
}

/* ---- exact sides --------------------------------------------------------------------------------- */

static bool whole_difference(const umb_seen_from *s, const float p[3], umb_bigint out[3])
{
    for (int k = 0; k < 3; ++k) {
        if (!umb_bigint_from_double(p[k], s->shift, &out[k])) {
            return false;
        }
        umb_bigint_add(&out[k], &s->eye_whole[k], -1, &out[k]);
    }
    return true;
}

/* a x - b y */
static void whole_determinant(const umb_bigint *a, const umb_bigint *x, const umb_bigint *b, const umb_bigint *y,
                              umb_bigint *out)
{
    umb_bigint p, q;
    umb_bigint_multiply(a, x, &p);
    umb_bigint_multiply(b, y, &q);
    umb_bigint_add(&p, &q, -1, out);
}

static void whole_cross(const umb_bigint a[3], const umb_bigint b[3], umb_bigint out[3])
{
    for (int k = 0; k < 3; ++k) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        whole_determinant(&a[i], &b[j], &a[j], &b[i], &out[k]);
    }
}

static void whole_dot(const umb_bigint a[3], const umb_bigint b[3], umb_bigint *out)
{
    umb_bigint product;
    umb_bigint_multiply(&a[0], &b[0], out);
    for (int k = 1; k < 3; ++k) {
        umb_bigint_multiply(&a[k], &b[k], &product);
        umb_bigint_add(out, &product, 1, out);
    }
}

/* Whole numbers of 2^-104 as such of 2^-(shift + 104). */
static bool find_unit(const umb_seen_from *s, umb_bigint *out)
{
    return s->shift >= 0 && umb_bigint_from_double(1.0, s->shift, out);
}

static bool whole_image(const umb_seen_from *s, const float p[3], umb_bigint out[3])
{
    umb_bigint d[3];
    if (!s->exact || !whole_difference(s, p, d)) {
        return false;
    }
    if (!s->parallel) {
        memcpy(out, d, sizeof d);
        return true;
    }
    int k = s->axis;
    for (int n = 0; n < 2; ++n) {
        int i = (k + 1 + n) % 3;
        whole_determinant(&d[i], &s->forward_whole[k], &d[k], &s->forward_whole[i], &out[n]);
    }
    /* The first two are whole numbers of 2^-(shift + 104), and so must this be. */
    umb_bigint unit;
    if (!find_unit(s, &unit)) {
        return false;
    }
    umb_bigint_multiply(&s->forward_whole[k], &unit, &out[2]);
    return true;
}

/* n = (c - a) x (b - a) and h = n.(a - eye). */
static bool whole_plane(const umb_seen_from *s, const float *const p[3], umb_bigint n[3], umb_bigint *h)
{
    umb_bigint at[3][3];
    for (int i = 0; i < 3; ++i) {
        if (!whole_difference(s, p[i], at[i])) {
            return false;
        }
    }
    for (int k = 0; k < 3; ++k) {
        umb_bigint_add(&at[1][k], &at[0][k], -1, &at[1][k]);
        umb_bigint_add(&at[2][k], &at[0][k], -1, &at[2][k]);
    }
    whole_cross(at[2], at[1], n);
    whole_dot(n, at[0], h);
    return true;
}

/* What umb_hull_depth() finds: with n, h of the front plane and N, H of the back one, h N - H n; parallel, with the sign of
 * f_k, (N_i n.f - n_i N.f, N_j n.f - n_j N.f, h N.f - H n.f), whose first two lack one factor of the unit. */
static bool whole_depth(const umb_seen_from *s, const umb_seen_depth *depth, umb_bigint out[3])
{
    umb_bigint front[3], back[3], h, far, along, far_along, unit, x;
    if (!s->exact || !whole_plane(s, depth->front, front, &h) || !whole_plane(s, depth->back, back, &far)) {
        return false;
    }
    if (!s->parallel) {
        for (int k = 0; k < 3; ++k) {
            whole_determinant(&h, &back[k], &far, &front[k], &out[k]);
        }
        return true;
    }
    if (!find_unit(s, &unit)) {
        return false;
    }
    whole_dot(front, s->forward_whole, &along);
    whole_dot(back, s->forward_whole, &far_along);
    for (int m = 0; m < 2; ++m) {
        int i = (s->axis + 1 + m) % 3;
        whole_determinant(&back[i], &along, &front[i], &far_along, &x);
        umb_bigint_multiply(&x, &unit, &out[m]);
    }
    whole_determinant(&h, &far_along, &far, &along, &out[2]);
    for (int k = 0; k < 3 && s->forward[s->axis] < 0.0; ++k) {
        out[k].sign = -out[k].sign;
    }
    return true;
}

static bool whole_line(const umb_seen_from *s, const umb_seen_line *line, umb_bigint out[3])
{
    if (line->depth != NULL) {
        return whole_depth(s, line->depth, out);
    }
    if (line->free) {
        const double *n = line->n.at;
        int exponent;
        (void)frexp(fmax(fabs(n[0]), fmax(fabs(n[1]), fabs(n[2]))), &exponent);
        bool whole = true;
        for (int k = 0; k < 3; ++k) {
            whole = umb_bigint_from_double(n[k], 53 - exponent, &out[k]) && whole;
        }
        return whole;
    }
    umb_bigint a[3], b[3];
    if (!whole_image(s, line->a, a) || !whole_image(s, line->b, b)) {
        return false;
    }
    whole_cross(a, b, out);
    return true;
}

static bool whole_corner(const umb_seen_from *s, const umb_seen_corner *c, umb_bigint out[3])
{
    if (c->first == NULL) {
        return whole_image(s, c->point, out);
    }
    umb_bigint n[3], m[3];
    if (!whole_line(s, c->first, n) || !whole_line(s, c->second, m)) {
        return false;
    }
    whole_cross(n, m, out);
    return true;
}

int umb_seen_side_exact(const umb_seen_from *s, const umb_seen_line *line, const umb_seen_corner *corner)
{
    umb_bigint n[3], v[3], sum;
    if (!whole_line(s, line, n) || !whole_corner(s, corner, v)) {
        return UMB_SEEN_UNKNOWN;
    }
    whole_dot(n, v, &sum);
    return sum.sign * corner->sign;
}

/* ---- sides --------------------------------------------------------------------------------------- */

static bool ends_at(const umb_seen_line *line, const float p[3])
{
    return same_point(line->a, p) || same_point(line->b, p);
}

/* to - from by component, if each is a float. */
static bool float_step(const float from[3], const float to[3], double out[3])
{
    bool all = true;
    for (int k = 0; k < 3; ++k) {
        double lost;
        umb_two_sum(to[k], -(double)from[k], &out[k], &lost);
        all = all && lost == 0.0 && (double)(float)out[k] == out[k];
    }
    return all;
}

/* The point lies on the line in space, for sure: products of floats are exact in doubles. */
static bool holds(const umb_seen_line *line, const float p[3])
{
    double d[3], e[3];
    if (ends_at(line, p)) {
        return true;
    }
    return float_step(line->a, line->b, d) && float_step(line->a, p, e) && d[0] * e[1] == d[1] * e[0] &&
           d[1] * e[2] == d[2] * e[1] && d[2] * e[0] == d[0] * e[2] && !same_point(line->a, line->b);
}

static bool same_line(const umb_seen_line *a, const umb_seen_line *b)
{
    return a == b || (!a->free && !b->free && holds(a, b->a) && holds(a, b->b) && !same_point(b->a, b->b));
}

static bool all_hold(const umb_seen_line *const lines[3], const float p[3])
{
    return holds(lines[0], p) && holds(lines[1], p) && holds(lines[2], p);
}

/* A point of both planes. */
static bool meets(const umb_seen_depth *d, const float p[3])
{
    return umb_orient(d->back[0], d->back[1], d->back[2], p) == 0 && umb_orient(d->front[0], d->front[1], d->front[2], p) == 0;
}

static bool meets_all_of(const umb_seen_depth *d, const umb_seen_line *line)
{
    return !line->free && meets(d, line->a) && meets(d, line->b);
}

/* Lines and corners that meet in space. */
static bool surely_on(const umb_seen_line *line, const umb_seen_corner *c)
{
    if (line->depth != NULL && c->first == NULL) {
        return meets(line->depth, c->point);
    }
    if (line->depth != NULL && (meets_all_of(line->depth, c->first) || meets_all_of(line->depth, c->second))) {
        return true;
    }
    if (c->first == NULL) {
        return !line->free && holds(line, c->point);
    }
    if (same_line(line, c->first) || same_line(line, c->second)) {
        return true;
    }
    if (line->free || c->first->free || c->second->free) {
        return false;
    }
    const umb_seen_line *const lines[3] = {line, c->first, c->second};
    for (int i = 0; i < 3; ++i) {
        if (all_hold(lines, lines[i]->a) || all_hold(lines, lines[i]->b)) {
            return true;
        }
    }
    return false;
}

/* By a bound that knows each component, then by what is exact. */
static __attribute__((noinline)) int close_side(const umb_seen_from *s, const umb_seen_line *line,
                                                const umb_seen_corner *corner)
{
    const umb_seen_vector *n = &line->n, *v = &corner->v;
    double sum = 0.0, size = 0.0, off = 0.0;
    for (int k = 0; k < 3; ++k) {
        double x = n->at[k] * v->at[k];
        sum += x;
        size += fabs(x);
        off += fabs(n->at[k]) * v->off[k] + n->off[k] * (fabs(v->at[k]) + v->off[k]);
    }
    if (fabs(sum) > (off + 4.0 * U * size) * PAD + LEAST) {
        return sum > 0.0 ? 1 : -1;
    }
    return surely_on(line, corner) ? 0 : umb_seen_side_exact(s, line, corner);
}

int umb_seen_side(const umb_seen_from *s, const umb_seen_line *line, const umb_seen_corner *corner)
{
    const double *n = line->n.at, *v = corner->v.at;
    const umb_seen_size *a = &line->size, *b = &corner->size;
    double sum = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
    double bound = 3.0 * (a->most * (b->off + 4.0 * U * b->most) + a->off * (b->most + b->off));
    if (fabs(sum) > bound * PAD + LEAST) {
        return sum > 0.0 ? 1 : -1;
    }
    return close_side(s, line, corner);
}

/* ---- cutting -------------------------------------------------------------------------------------- */

/* Where the edge that leaves corner i crosses the line. With q the corner and r the next, on different sides, and e = q
 * x r the edge: e x n = q.n r - r.n q, up to the order of signs, which is a positive sum of both times q's side. */
static void crossing(const umb_seen_cut *cut, uint32_t i, umb_seen_corner *out)
{
    const umb_seen_corner *c = &cut->in[i];
    if (!c->edge->ready) {
        make_ready(cut->from, c->edge);
    }
    umb_seen_corner_of(c->edge, cut->line, (c->flip ? -1 : 1) * cut->sides[i], out);
}

uint32_t umb_seen_clip(const umb_seen_cut *cut, int keep, umb_seen_corner *out)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < cut->count; ++i) {
        uint32_t j = i + 1 < cut->count ? i + 1 : 0;
        int here = keep * cut->sides[i], next = keep * cut->sides[j];
        if (here >= 0) {
            out[count++] = cut->in[i];
        }
        if (here * next < 0) {
            crossing(cut, i, &out[count++]);
        }
        umb_seen_corner *last = count > 0 ? &out[count - 1] : NULL;
        if (here >= 0 && next < 0) {
            last->edge = cut->line;
            last->flip = keep < 0;
            last->closed = true;
        } else if (here < 0 && next > 0) {
            last->edge = cut->in[i].edge;
            last->flip = cut->in[i].flip;
            last->closed = cut->in[i].closed;
        } else if (here == 0 && next == 0) {
            last->closed = true;
        }
    }
    return count;
}

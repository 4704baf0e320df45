#include "hull.h"

#include <math.h>
#include <string.h>

#include "geometry/orient.h"
#include "geometry/transform.h"

#define U 0x1p-53
#define PAD (1.0 + 0x1p-40)

/* ---- boxes ---------------------------------------------------------------------------------------- */

typedef struct loop {
    uint8_t count, corners[6];
} loop;

/* Outlines of a box. Each axis has a state: 0, the viewer is beyond the minimum and sees that face; 2, beyond the maximum;
 * 1, it sees neither. Row: the sum of state times 3^axis. */
static const loop OUTLINES[27] = {
    {6, {1, 3, 2, 6, 4, 5}}, {6, {0, 4, 5, 1, 3, 2}}, {6, {0, 4, 5, 7, 3, 2}},
    {6, {0, 1, 3, 2, 6, 4}}, {4, {0, 1, 3, 2, 0, 0}}, {6, {0, 1, 5, 7, 3, 2}},
    {6, {0, 1, 3, 7, 6, 4}}, {6, {0, 1, 3, 7, 6, 2}}, {6, {0, 1, 5, 7, 6, 2}},
    {6, {0, 2, 6, 4, 5, 1}}, {4, {0, 4, 5, 1, 0, 0}}, {6, {0, 4, 5, 7, 3, 1}},
    {4, {0, 2, 6, 4, 0, 0}}, {0, {0, 0, 0, 0, 0, 0}}, {4, {1, 5, 7, 3, 0, 0}},
    {6, {0, 2, 3, 7, 6, 4}}, {4, {2, 3, 7, 6, 0, 0}}, {6, {1, 5, 7, 6, 2, 3}},
    {6, {0, 2, 6, 7, 5, 1}}, {6, {0, 4, 6, 7, 5, 1}}, {6, {0, 4, 6, 7, 3, 1}},
    {6, {0, 2, 6, 7, 5, 4}}, {4, {4, 6, 7, 5, 0, 0}}, {6, {1, 5, 4, 6, 7, 3}},
    {6, {0, 2, 3, 7, 5, 4}}, {6, {2, 3, 7, 5, 4, 6}}, {6, {1, 5, 4, 6, 2, 3}},
};

/* Faces of a box: axis, then 0 for the minimum. */
static const uint8_t FACES[3][2][4] = {
    {{0, 2, 6, 4}, {5, 7, 3, 1}}, {{0, 4, 5, 1}, {3, 7, 6, 2}}, {{0, 1, 3, 2}, {6, 7, 5, 4}}};

static void find_bounds(umb_hull *h, const umb_shadow_viewer *v)
{
    h->flat = false;
    h->nearest = INFINITY;
    for (int k = 0; k < 3; ++k) {
        h->bounds.min[k] = h->bounds.max[k] = h->points[0][k];
    }
    for (uint32_t i = 0; i < h->point_count; ++i) {
        double off, w = umb_shadow_depth(v, h->points[i], &off);
        h->nearest = fmin(h->nearest, w - off);
        for (int k = 0; k < 3; ++k) {
            h->bounds.min[k] = fminf(h->bounds.min[k], h->points[i][k]);
            h->bounds.max[k] = fmaxf(h->bounds.max[k], h->points[i][k]);
        }
    }
}

static bool in_front(const umb_hull *h, const umb_shadow_viewer *v)
{
    return v->sight.parallel || h->nearest > 0.0;
}

/* The polygon through some of the points. */
static void make_polygon(const umb_hull *h, const umb_shadow_viewer *v, const loop *l, umb_seen_line *lines,
                         umb_seen_corner *corners)
{
    for (uint32_t i = 0; i < l->count; ++i) {
        const float *a = h->points[l->corners[i]], *b = h->points[l->corners[i + 1 < l->count ? i + 1 : 0]];
        umb_seen_line_later(a, b, &lines[i]);
        umb_seen_corner_at(&v->sight, a, &corners[i]);
        corners[i].edge = &lines[i];
        corners[i].flip = corners[i].closed = false;
    }
}

static void add_face(umb_hull *h, const uint8_t *corners, uint8_t count)
{
    umb_hull_face *f = &h->faces[h->face_count++];
    memcpy(f->loop, corners, count);
    f->count = count;
    f->ready = false;
}

/* Which faces of an axis-aligned box the viewer sees is decided without error. */
static int see_axis(const umb_shadow_viewer *v, const umb_aabb *box, int axis)
{
    const umb_seen_from *s = &v->sight;
    if (s->parallel) {
        return s->forward[axis] > 0.0 ? 0 : s->forward[axis] < 0.0 ? 2 : 1;
    }
    return s->eye[axis] < box->min[axis] ? 0 : s->eye[axis] > box->max[axis] ? 2 : 1;
}

/* The faces of a box without width, as seen: segments and points. Their planes are of points that lie apart. */
static void add_flat_faces(umb_hull *h, const umb_shadow_viewer *v, const int states[3])
{
    float apart = ldexpf(1.0f, 103 - v->sight.shift); /* about half the reach */
    h->flat = apart > 0.0f;
    for (int k = 0; k < 3 && h->flat; ++k) {
        if (states[k] != 1) {
            float a[3] = {0.0f, 0.0f, 0.0f}, b[3], c[3];
            a[k] = states[k] == 0 ? h->bounds.min[k] : h->bounds.max[k];
            memcpy(b, a, sizeof b);
            memcpy(c, a, sizeof c);
            b[(k + (states[k] == 0 ? 2 : 1)) % 3] = apart;
            c[(k + (states[k] == 0 ? 1 : 2)) % 3] = apart;
            add_face(h, FACES[k][states[k] / 2], 4);
            umb_shadow_plane_of(&v->sight, a, b, c, &h->faces[h->face_count - 1].plane);
            h->faces[h->face_count - 1].ready = true;
        }
    }
}

bool umb_hull_points_of_box(umb_hull *h, const umb_shadow_viewer *v, const umb_aabb *box)
{
    for (uint32_t i = 0; i < 8; ++i) {
        for (int k = 0; k < 3; ++k) {
            h->points[i][k] = (i >> k & 1u) != 0 ? box->max[k] : box->min[k];
        }
    }
    h->point_count = 8;
    h->box = true;
    h->count = h->face_count = 0;
    find_bounds(h, v);
    return true;
}

bool umb_hull_of_box(umb_hull *h, const umb_shadow_viewer *v, const umb_aabb *box)
{
    int row = 0, scale = 1, states[3];
    for (int k = 0; k < 3; ++k) {
        states[k] = see_axis(v, box, k);
        row += scale * states[k];
        scale *= 3;
    }
    (void)umb_hull_points_of_box(h, v, box);
    h->count = OUTLINES[row].count;
    if (h->count == 0 || !in_front(h, v)) {
        return false;
    }
    make_polygon(h, v, &OUTLINES[row], h->lines, h->corners);
    for (int k = 0; k < 3; ++k) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        bool wide = box->min[i] < box->max[i] && box->min[j] < box->max[j];
        if (states[k] != 1 && wide) { /* one without area is the edge of another */
            add_face(h, FACES[k][states[k] / 2], 4);
        }
    }
    if (h->face_count == 0) {
        add_flat_faces(h, v, states);
    }
    return true;
}

/* ---- turned boxes --------------------------------------------------------------------------------- */

/* True if every point lies inside of every edge: then the polygon holds the image of their hull. */
static bool holds_points(const umb_hull *h, const umb_shadow_viewer *v)
{
    umb_seen_corner corners[UMB_HULL_POINTS];
    for (uint32_t k = 0; k < h->point_count; ++k) {
        umb_seen_corner_at(&v->sight, h->points[k], &corners[k]);
    }
    for (uint32_t i = 0; i < h->count; ++i) {
        umb_seen_line line;
        umb_seen_line_through(&v->sight, h->lines[i].a, h->lines[i].b, &line);
        for (uint32_t k = 0; k < h->point_count; ++k) {
            int side = umb_seen_side(&v->sight, &line, &corners[k]);
            if (side != 0 && side != 1) {
                return false;
            }
        }
    }
    return true;
}

/* The box's half edges in the world, its middle, and what each component of a vertex in it may be off: vertices are
 * rounded to float once, these corners too, and both sums are off by a few units of their terms. */
typedef struct turned {
    double middle[3], half[3][3]; /* half[axis of the box] */
    double off[3];
} turned;

static void turn(const umb_aabb *box, const umb_transform *t, turned *out)
{
    for (int i = 0; i < 3; ++i) {
        double size = fabs((double)t->m[i][3]);
        out->middle[i] = t->m[i][3];
        for (int k = 0; k < 3; ++k) {
            double middle = 0.5 * ((double)box->min[k] + box->max[k]);
            double half = 0.5 * ((double)box->max[k] - box->min[k]);
            out->middle[i] += t->m[i][k] * middle;
            out->half[k][i] = t->m[i][k] * half;
            size += fabs((double)t->m[i][k]) * fmax(fabs((double)box->min[k]), fabs((double)box->max[k]));
        }
        /* 2^-24 of the sum for each of the two roundings to float, doubled. */
        out->off[i] = 0x1p-22 * size + 0x1p-140;
    }
}

/* Make it longer along each half edge so that it holds, besides, off in each direction of the world: a displacement x is
 * the sum over k of (row k of the inverse of the half edges).x half[k]. False if it is too flat for that. */
static bool grow(turned *b)
{
    double inverse[3][3], det = 0.0, size = 0.0;
    for (int k = 0; k < 3; ++k) {
        const double *p = b->half[(k + 1) % 3], *q = b->half[(k + 2) % 3];
        for (int i = 0; i < 3; ++i) {
            int j = (i + 1) % 3, l = (i + 2) % 3;
            inverse[k][i] = p[j] * q[l] - p[l] * q[j];
        }
    }
    for (int i = 0; i < 3; ++i) {
        det += b->half[0][i] * inverse[0][i];
        size += fabs(b->half[0][i] * inverse[0][i]);
    }
    if (!(fabs(det) > 1e-6 * size) || !(fabs(det) > 0x1p-900)) {
        return false;
    }
    for (int k = 0; k < 3; ++k) {
        double more = 0.0;
        for (int i = 0; i < 3; ++i) {
            more += fabs(inverse[k][i] / det) * b->off[i];
        }
        if (!(more < 0.25)) {
            return false; /* it is as flat as floats are coarse */
        }
        for (int i = 0; i < 3; ++i) {
            b->half[k][i] *= 1.0 + 1.01 * more;
        }
    }
    return true;
}

/* The world's box around it; false if that has no finite corners. */
static bool around(const turned *b, umb_aabb *out)
{
    for (int i = 0; i < 3; ++i) {
        double half = fabs(b->half[0][i]) + fabs(b->half[1][i]) + fabs(b->half[2][i]) + b->off[i];
        out->min[i] = (float)(b->middle[i] - half);
        out->max[i] = (float)(b->middle[i] + half);
        if (!(isfinite(out->min[i]) && isfinite(out->max[i]))) {
            return false;
        }
    }
    return true;
}

static bool turned_points(umb_hull *h, const umb_shadow_viewer *v, const turned *b)
{
    for (uint32_t i = 0; i < 8; ++i) {
        for (int k = 0; k < 3; ++k) {
            double x = b->middle[k];
            for (int e = 0; e < 3; ++e) {
                x += (i >> e & 1u) != 0 ? b->half[e][k] : -b->half[e][k];
            }
            h->points[i][k] = (float)x;
            if (!isfinite(h->points[i][k])) {
                return false;
            }
        }
    }
    h->point_count = 8;
    h->box = false;
    h->count = h->face_count = 0;
    find_bounds(h, v);
    return true;
}

/* As for boxes along the axes, but seen with the accuracy of doubles: what is made of it is tested. */
static bool find_turned(umb_hull *h, const umb_shadow_viewer *v, const turned *b)
{
    if (!turned_points(h, v, b)) {
        return false;
    }
    double det = 0.0;
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, l = (i + 2) % 3;
        det += b->half[0][i] * (b->half[1][j] * b->half[2][l] - b->half[1][l] * b->half[2][j]);
    }
    int row = 0, scale = 1;
    for (int k = 0; k < 3; ++k) {
        int state = 1;
        for (int max = 0; max < 2; ++max) {
            const uint8_t *f = FACES[k][max];
            umb_shadow_plane p;
            umb_shadow_plane_of(&v->sight, h->points[f[det > 0.0 ? 2 : 0]], h->points[f[1]],
                                h->points[f[det > 0.0 ? 0 : 2]], &p);
            double along = 0.0;
            for (int i = 0; i < 3; ++i) {
                along += p.n.at[i] * v->sight.forward[i];
            }
            state = (v->sight.parallel ? along : p.h) > 0.0 ? 2 * max : state;
        }
        row += scale * state;
        scale *= 3;
    }
    loop l = OUTLINES[row];
    for (uint32_t i = 0; det < 0.0 && i < l.count / 2u; ++i) {
        uint8_t swap = l.corners[i];
        l.corners[i] = l.corners[l.count - 1u - i];
        l.corners[l.count - 1u - i] = swap;
    }
    h->count = l.count;
    if (l.count == 0 || !in_front(h, v)) {
        return false;
    }
    make_polygon(h, v, &l, h->lines, h->corners);
    return holds_points(h, v);
}

bool umb_hull_of_turned_box(umb_hull *h, const umb_shadow_viewer *v, const umb_aabb *box, const umb_transform *t)
{
    turned b, grown;
    umb_aabb bounds;
    turn(box, t, &b);
    grown = b;
    if (grow(&grown) && find_turned(h, v, &grown)) {
        return true;
    }
    return around(&b, &bounds) && umb_hull_of_box(h, v, &bounds);
}

bool umb_hull_points_of_turned_box(umb_hull *h, const umb_shadow_viewer *v, const umb_aabb *box, const umb_transform *t)
{
    turned b, grown;
    umb_aabb bounds;
    turn(box, t, &b);
    grown = b;
    return (grow(&grown) && turned_points(h, v, &grown)) ||
           (around(&b, &bounds) && umb_hull_points_of_box(h, v, &bounds));
}

/* ---- triangles ------------------------------------------------------------------------------------ */

bool umb_hull_points_of_triangle(umb_hull *h, const umb_shadow_viewer *v, const float corners[3][3])
{
    memcpy(h->points, corners, 3 * sizeof h->points[0]);
    h->point_count = 3;
    h->box = false;
    h->count = h->face_count = 0;
    find_bounds(h, v);
    return true;
}

bool umb_hull_of_triangle(umb_hull *h, const umb_shadow_viewer *v, const float corners[3][3])
{
    static const loop ALONG = {3, {0, 1, 2}}, AGAINST = {3, {2, 1, 0}};
    (void)umb_hull_points_of_triangle(h, v, corners);
    h->count = 3;
    if (!in_front(h, v)) {
        return false;
    }
    make_polygon(h, v, &ALONG, h->lines, h->corners);
    umb_seen_line line;
    umb_seen_line_through(&v->sight, h->points[0], h->points[1], &line);
    int side = umb_seen_side(&v->sight, &line, &h->corners[2]);
    if (side == UMB_SEEN_UNKNOWN) {
        return false;
    }
    if (side < 0) {
        make_polygon(h, v, &AGAINST, h->lines, h->corners);
    }
    if (side != 0) {
        add_face(h, (side < 0 ? &AGAINST : &ALONG)->corners, 3);
    }
    return true;
}

/* ---- questions ------------------------------------------------------------------------------------ */

const umb_shadow_plane *umb_hull_face_plane(umb_hull *h, const umb_shadow_viewer *v, uint32_t face)
{
    umb_hull_face *f = &h->faces[face];
    if (!f->ready) {
        umb_shadow_plane_of(&v->sight, h->points[f->loop[2]], h->points[f->loop[1]], h->points[f->loop[0]], &f->plane);
        f->ready = true;
    }
    return &f->plane;
}

uint32_t umb_hull_face_polygon(const umb_hull *h, const umb_shadow_viewer *v, uint32_t face, umb_seen_line lines[4],
                               umb_seen_corner corners[4])
{
    loop l = {h->faces[face].count, {0}};
    memcpy(l.corners, h->faces[face].loop, sizeof h->faces[face].loop);
    make_polygon(h, v, &l, lines, corners);
    return l.count;
}

/* n . (p - a), least over the box: a difference, a product and two sums, with n's own error. */
static int bounds_beyond(const umb_hull *h, const umb_shadow_plane *p)
{
    double least = 0.0, most = 0.0, off = 0.0;
    for (int k = 0; k < 3; ++k) {
        double low = (double)h->bounds.min[k] - p->a[k], high = (double)h->bounds.max[k] - p->a[k];
        double x = p->n.at[k] * low, y = p->n.at[k] * high;
        least += fmin(x, y);
        most += fmax(x, y);
        off += (p->n.off[k] + 5.0 * U * fabs(p->n.at[k])) * fmax(fabs(low), fabs(high));
    }
    off = off * PAD + 0x1p-1000;
    return least > off ? 1 : most < -off || (h->box && least < -off) ? -1 : 0;
}

bool umb_hull_beyond(const umb_hull *h, const umb_shadow_plane *plane)
{
    int known = bounds_beyond(h, plane);
    for (uint32_t i = 0; known == 0 && i < h->point_count; ++i) {
        if (umb_orient(plane->a, plane->b, plane->c, h->points[i]) != -1) {
            return false;
        }
    }
    return known >= 0;
}

/* Along q the plane N, H lies at H / N.q and the face n, h at h / n.q, with n.q > 0: the face is beyond where
 * h N.q - H n.q > 0. Parallel: with d of the image, d_k = 0, they lie at (H - N.d) / N.f, and d is linear in q / q_2. */
void umb_hull_depth(const umb_seen_from *s, const umb_shadow_plane *face, const umb_shadow_plane *plane,
                    umb_seen_vector *out)
{
    double front[4], back[4], front_off[4], back_off[4]; /* of what is multiplied crosswise */
    const umb_shadow_plane *both[2] = {face, plane};
    double *at[2] = {front, back}, *off[2] = {front_off, back_off};
    for (int m = 0; m < 2; ++m) {
        const umb_shadow_plane *p = both[m];
        for (int k = 0; k < 3; ++k) {
            at[m][k] = p->n.at[k];
            off[m][k] = p->n.off[k];
        }
        at[m][3] = p->h;
        off[m][3] = p->h_off;
        if (s->parallel) { /* what it crosses depth with, instead of h: N.f; and H for the last component */
            int a = s->axis, i = (a + 1) % 3, j = (a + 2) % 3;
            double sign = s->forward[a] < 0.0 ? -1.0 : 1.0, along = 0.0, along_off = 0.0;
            for (int k = 0; k < 3; ++k) {
                double x = p->n.at[k] * s->forward[k];
                along += x;
                along_off += p->n.off[k] * fabs(s->forward[k]) + 4.0 * U * fabs(x);
            }
            at[m][0] = -sign * p->n.at[i];
            off[m][0] = p->n.off[i];
            at[m][1] = -sign * p->n.at[j];
            off[m][1] = p->n.off[j];
            at[m][2] = sign * p->h;
            off[m][2] = p->h_off;
            at[m][3] = along;
            off[m][3] = along_off * PAD;
        }
    }
    for (int k = 0; k < 3; ++k) {
        /* perspective: h N - H n; parallel: (h - n.d) N.f - (H - N.d) n.f */
        double x = s->parallel ? front[k] * back[3] : front[3] * back[k];
        double y = s->parallel ? back[k] * front[3] : back[3] * front[k];
        double ox = s->parallel ? fabs(front[k]) * back_off[3] + front_off[k] * (fabs(back[3]) + back_off[3])
                                : fabs(front[3]) * back_off[k] + front_off[3] * (fabs(back[k]) + back_off[k]);
        double oy = s->parallel ? fabs(back[k]) * front_off[3] + back_off[k] * (fabs(front[3]) + front_off[3])
                                : fabs(back[3]) * front_off[k] + back_off[3] * (fabs(front[k]) + front_off[k]);
        out->at[k] = x - y;
        out->off[k] = (ox + oy + 3.0 * U * (fabs(x) + fabs(y))) * PAD + 0x1p-1000;
    }
}

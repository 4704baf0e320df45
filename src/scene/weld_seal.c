/* Equal triangles, and triangles face to face.
 *
 * Two opposite one-sided triangles at one place block from both sides: they are exactly one
 * two-sided triangle. Where they seal two solids that stand against each other they are better
 * dropped:
 *
 *        ______ ______               ______________
 *       |      |      |             |              |      The two lids become neighbours: their common
 *       |  A  >|<  B  |     -->     |    A and B   |      edge is no longer a silhouette of A nor of B,
 *       |______|______|             |______________|      and the seam no crack.
 *
 * Dropping a triangle is always safe: fewer things hide. It costs nothing as long as whoever looks
 * along a line through the pair has crossed a front of A or B before, that is, from everywhere but
 * the inside of the solids. It would cost a wall when the pair is the wall: a partition without
 * thickness in a room. So a sheet of pairs (pairs joined at edges that only pairs share) is dropped
 * when all around its rim there are other triangles, these run as often one way as the other, and
 * turning around the rim from the sheet one meets the back of a triangle first, both ways: the
 * sheet lies inside solid matter. A sheet that ends freely, or that stands in the open, stays as
 * two-sided triangles. The choice is made in plain doubles, because neither outcome is ever
 * wrong. */
#include <math.h>
#include <string.h>

#include "geometry/collinear.h"
#include "geometry/vec.h"
#include "weld_soup.h"

#define RIM_LIMIT 4096u /* pairs times others at one edge that are looked at */
#define SAME_ANGLE 1e-9

static void drop(umb_weld_triangle *t)
{
    t->v[0] = t->v[1] = t->v[2] = UMB_NONE;
}

static void swap(uint32_t *a, uint32_t *b)
{
    uint32_t c = *a;
    *a = *b;
    *b = c;
}

/* Corners in ascending order; returns whether that took an odd number of swaps. */
static bool sort_corners(const uint32_t v[3], uint32_t out[3])
{
    bool odd = false;
    memcpy(out, v, 3 * sizeof *out);
    static const int network[3][2] = {{0, 1}, {1, 2}, {0, 1}};
    for (int k = 0; k < 3; ++k) {
        if (out[network[k][0]] > out[network[k][1]]) {
            swap(&out[network[k][0]], &out[network[k][1]]);
            odd = !odd;
        }
    }
    return odd;
}

static uint64_t hash_ids(const uint32_t *ids, int count)
{
    uint64_t h = 0;
    for (int i = 0; i < count; ++i) {
        h = (h ^ ids[i]) * 0x9E3779B97F4A7C15u;
        h ^= h >> 29;
    }
    return h;
}

static size_t table_size(uint32_t count)
{
    size_t size = 16;
    while (size < 2 * (size_t)count) {
        size *= 2;
    }
    return size;
}

/* Triangle t has the corners of triangle first (and of the one opposite to that, if any). */
static void join_equal(umb_weld_soup *soup, uint32_t first, bool first_odd, uint32_t t, bool odd,
                       uint32_t *opposite)
{
    uint32_t same = first_odd == odd ? first : opposite[first];
    umb_weld_soup_unite(soup, soup->triangles[first].object, soup->triangles[t].object);
    if (same != UMB_NONE) {
        soup->triangles[same].two_sided |= soup->triangles[t].two_sided;
        drop(&soup->triangles[t]);
        soup->stats.duplicates += 1;
    } else {
        opposite[first] = t;
        opposite[t] = first;
    }
}

/* Drop triangles equal to one before them; find for each its opposite, or UMB_NONE. */
static bool match_equal(umb_weld_soup *soup, umb_scratch *scratch, uint32_t *opposite)
{
    size_t size = table_size(soup->triangle_count);
    uint32_t *table = umb_scratch_get(scratch, size, sizeof *table);
    if (table == NULL) {
        return false;
    }
    memset(table, 0xFF, size * sizeof *table);
    for (uint32_t t = 0; t < soup->triangle_count; ++t) {
        uint32_t corners[3], other[3];
        bool odd = sort_corners(soup->triangles[t].v, corners), other_odd = false;
        opposite[t] = UMB_NONE;
        size_t slot = hash_ids(corners, 3) & (size - 1);
        while (table[slot] != UMB_NONE) {
            other_odd = sort_corners(soup->triangles[table[slot]].v, other);
            if (memcmp(corners, other, sizeof corners) == 0) {
                break;
            }
            slot = (slot + 1) & (size - 1);
        }
        if (table[slot] == UMB_NONE) {
            table[slot] = t;
        } else {
            join_equal(soup, table[slot], other_odd, t, odd, opposite);
        }
    }
    umb_scratch_drop(scratch, table);
    return true;
}

/* Two triangles that make up a convex quadrilateral in an axis-aligned plane: corners a, y, c, x in
 * turn, cut along a-c into (a, c, x) and (c, a, y). */
typedef struct quad {
    uint32_t corners[4]; /* ascending: the key */
    uint32_t a, c, x, y;
    uint32_t t, u;
    int turn; /* which way it faces in its plane */
} quad;

static bool make_quad(const umb_weld_soup *soup, uint32_t h, uint32_t g, quad *out)
{
    const umb_weld_triangle *t = &soup->triangles[h / 3], *u = &soup->triangles[g / 3];
    quad q = {.a = t->v[h % 3], .c = t->v[(h % 3 + 1) % 3], .t = h / 3, .u = g / 3};
    q.x = t->v[(h % 3 + 2) % 3];
    q.y = u->v[(g % 3 + 2) % 3];
    if (u->v[g % 3] != q.c || q.x == q.y || t->two_sided != u->two_sided) {
        return false;
    }
    const float *a = soup->positions[q.a], *c = soup->positions[q.c];
    const float *x = soup->positions[q.x], *y = soup->positions[q.y];
    int k = 0;
    while (k < 3 && !(a[k] == c[k] && a[k] == x[k] && a[k] == y[k])) {
        ++k;
    }
    if (k == 3) {
        return false;
    }
    int i = (k + 1) % 3, j = (k + 2) % 3;
    q.turn = umb_collinear_turn(a, c, x, i, j);
    if (q.turn == 0 || umb_collinear_turn(c, a, y, i, j) != q.turn ||
        umb_collinear_turn(y, c, x, i, j) != q.turn || umb_collinear_turn(x, a, y, i, j) != q.turn) {
        return false;
    }
    uint32_t s[4] = {q.a, q.c, q.x, q.y};
    for (int m = 1; m < 4; ++m) {
        for (int n = m; n > 0 && s[n - 1] > s[n]; --n) {
            swap(&s[n - 1], &s[n]);
        }
    }
    memcpy(q.corners, s, sizeof s);
    *out = q;
    return true;
}

/* The same quadrilateral cut along its other diagonal is the same set of points: cut q as model
 * is. */
static void recut(umb_weld_soup *soup, const quad *q, const quad *model)
{
    uint32_t *t = soup->triangles[q->t].v, *u = soup->triangles[q->u].v;
    memcpy(t, soup->triangles[model->t].v, 3 * sizeof *t);
    memcpy(u, soup->triangles[model->u].v, 3 * sizeof *u);
    if (q->turn != model->turn) {
        swap(&t[1], &t[2]);
        swap(&u[1], &u[2]);
    }
}

/* Walls that stand against each other are often cut along different diagonals: make these agree, so
 * that their triangles are equal or opposite. */
static bool match_diagonals(umb_weld_soup *soup, umb_scratch *scratch)
{
    umb_weld_edges edges;
    if (!umb_weld_edges_build(&edges, scratch, soup)) {
        return false;
    }
    size_t size = table_size(soup->triangle_count);
    uint32_t *table = umb_scratch_get(scratch, size, sizeof *table);
    quad *quads = umb_scratch_get(scratch, (size_t)soup->triangle_count * 3 / 2 + 1, sizeof *quads);
    uint8_t *used = umb_scratch_get_zero(scratch, soup->triangle_count, sizeof *used);
    if (scratch->failed) {
        return false;
    }
    memset(table, 0xFF, size * sizeof *table);
    uint32_t quad_count = 0;
    for (uint32_t begin = 0, end; begin < edges.count; begin = end) {
        end = umb_weld_edges_end(&edges, begin);
        quad q;
        if (end - begin != 2 || used[edges.halves[begin] / 3] || used[edges.halves[begin + 1] / 3] ||
            !make_quad(soup, edges.halves[begin], edges.halves[begin + 1], &q)) {
            continue;
        }
        size_t slot = hash_ids(q.corners, 4) & (size - 1);
        while (table[slot] != UMB_NONE &&
               memcmp(quads[table[slot]].corners, q.corners, sizeof q.corners) != 0) {
            slot = (slot + 1) & (size - 1);
        }
        if (table[slot] == UMB_NONE) {
            table[slot] = quad_count;
            quads[quad_count++] = q;
            continue;
        }
        const quad *model = &quads[table[slot]];
        if (model->a != q.a && model->a != q.c && !used[model->t] && !used[model->u]) {
            recut(soup, &q, model);
            used[q.t] = used[q.u] = used[model->t] = used[model->u] = 1;
        }
    }
    umb_weld_edges_drop(&edges, scratch);
    umb_scratch_drop(scratch, table);
    umb_scratch_drop(scratch, quads);
    umb_scratch_drop(scratch, used);
    return true;
}

/* Pairs are known by their first triangle; sheets by the first triangle of one of their pairs. */
typedef struct sealer {
    umb_weld_soup *soup;
    umb_weld_edges edges;
    uint32_t *opposite;
    uint32_t *parents; /* union-find over pairs: the sheets */
    uint8_t *stays;    /* some edge of it speaks against dropping */
    uint8_t *rimmed;   /* some edge of it has other triangles */
} sealer;

static uint32_t pair_of(const sealer *s, uint32_t half)
{
    uint32_t t = half / 3, o = s->opposite[t];
    return t < o ? t : o;
}

static uint32_t sheet_of(sealer *s, uint32_t t)
{
    while (s->parents[t] != t) {
        s->parents[t] = s->parents[s->parents[t]];
        t = s->parents[t];
    }
    return t;
}

/* Grows with the angle of (x, y) from (1, 0), counter-clockwise, in [0, 4); needs no library
 * function whose last bit could differ between machines. */
static double turn_of(double x, double y)
{
    double size = fabs(x) + fabs(y);
    if (size == 0.0) {
        return 0.0;
    }
    double t = y / size;
    return x < 0.0 ? 2.0 - t : t < 0.0 ? 4.0 + t : t;
}

/* True if, around the edge, the pair's triangles look at nothing but backs (see the top). others:
 * the half-edges of this edge that are in no pair. */
static bool lies_in_matter(const sealer *s, uint32_t pair_half, const uint32_t *others,
                           uint32_t count)
{
    const umb_weld_soup *soup = s->soup;
    const uint32_t *v = soup->triangles[pair_half / 3].v;
    uint32_t c = pair_half % 3;
    umb_vec3 from = umb_vec3_from_float(soup->positions[v[c]]);
    umb_vec3 axis = umb_vec3_sub(umb_vec3_from_float(soup->positions[v[(c + 1) % 3]]), from);
    umb_vec3 own = umb_vec3_sub(umb_vec3_from_float(soup->positions[v[(c + 2) % 3]]), from);
    umb_vec3 across = umb_vec3_cross(axis, own);
    umb_vec3 outward = umb_vec3_scale(umb_vec3_cross(across, axis), 1.0 / umb_vec3_length(axis));
    double first = 4.0, last = 0.0;
    bool first_back = true, last_back = true;
    for (uint32_t i = 0; i < count; ++i) {
        const umb_weld_triangle *o = &soup->triangles[others[i] / 3];
        uint32_t k = others[i] % 3;
        umb_vec3 d = umb_vec3_sub(umb_vec3_from_float(soup->positions[o->v[(k + 2) % 3]]), from);
        double turn = turn_of(umb_vec3_dot(d, outward), umb_vec3_dot(d, across));
        bool forward = o->v[k] == v[c];
        if (o->two_sided || turn < SAME_ANGLE || turn > 4.0 - SAME_ANGLE) {
            return false;
        }
        if (turn < first + SAME_ANGLE) {
            first_back = forward && (first_back || turn < first - SAME_ANGLE);
            first = turn < first ? turn : first;
        }
        if (turn > last - SAME_ANGLE) {
            last_back = !forward && (last_back || turn > last + SAME_ANGLE);
            last = turn > last ? turn : last;
        }
    }
    return first_back && last_back;
}

static void look_at_rim(sealer *s, const uint32_t *pairs, uint32_t pair_count,
                        const uint32_t *others, uint32_t other_count)
{
    int64_t balance = 0;
    for (uint32_t i = 0; i < other_count; ++i) {
        const uint32_t *v = s->soup->triangles[others[i] / 3].v;
        balance += v[others[i] % 3] < v[(others[i] % 3 + 1) % 3] ? 1 : -1;
    }
    bool too_many = (uint64_t)pair_count * other_count > RIM_LIMIT;
    for (uint32_t i = 0; i < pair_count; ++i) {
        uint32_t pair = pair_of(s, pairs[i]);
        s->rimmed[pair] = 1;
        if (balance != 0 || too_many || !lies_in_matter(s, pairs[i], others, other_count)) {
            s->stays[pair] = 1;
        }
    }
}

/* Put the half-edges of pairs (one of the two for each) first, then the others; counts of both. */
static void sort_out(const sealer *s, uint32_t begin, uint32_t end, uint32_t *work,
                     uint32_t *pair_count, uint32_t *other_count)
{
    *pair_count = *other_count = 0;
    for (uint32_t i = begin; i < end; ++i) {
        uint32_t half = s->edges.halves[i], t = half / 3;
        if (s->opposite[t] == UMB_NONE) {
            *other_count += 1;
            work[end - begin - *other_count] = half;
        } else if (t < s->opposite[t]) {
            work[*pair_count] = half;
            *pair_count += 1;
        }
    }
}

static void look_at_edges(sealer *s, uint32_t *work)
{
    for (uint32_t begin = 0, end; begin < s->edges.count; begin = end) {
        end = umb_weld_edges_end(&s->edges, begin);
        if ((uint32_t)s->edges.keys[begin] == UMB_NONE) {
            continue; /* dropped triangles */
        }
        uint32_t pair_count, other_count;
        sort_out(s, begin, end, work, &pair_count, &other_count);
        if (pair_count == 0) {
            continue;
        }
        if (other_count > 0) {
            look_at_rim(s, work, pair_count, work + (end - begin - other_count), other_count);
            continue;
        }
        if (pair_count == 1) {
            s->stays[pair_of(s, work[0])] = 1; /* the sheet ends freely */
        }
        for (uint32_t i = 1; i < pair_count; ++i) {
            uint32_t a = sheet_of(s, pair_of(s, work[0])), b = sheet_of(s, pair_of(s, work[i]));
            s->parents[a < b ? b : a] = a < b ? a : b;
        }
    }
}

/* Where one of the two is two-sided already, it blocks all that the other does. */
static void join_two_sided(umb_weld_soup *soup, uint32_t *opposite)
{
    for (uint32_t t = 0; t < soup->triangle_count; ++t) {
        uint32_t o = opposite[t];
        if (o != UMB_NONE && t < o &&
            (soup->triangles[t].two_sided | soup->triangles[o].two_sided) != 0) {
            soup->triangles[t].two_sided = 1;
            drop(&soup->triangles[o]);
            soup->stats.duplicates += 1;
            opposite[t] = opposite[o] = UMB_NONE;
        }
    }
}

static void settle_pairs(sealer *s)
{
    umb_weld_soup *soup = s->soup;
    for (uint32_t t = 0; t < soup->triangle_count; ++t) {
        if (s->opposite[t] != UMB_NONE && t < s->opposite[t]) {
            uint32_t sheet = sheet_of(s, t);
            s->stays[sheet] |= s->stays[t];
            s->rimmed[sheet] |= s->rimmed[t];
        }
    }
    for (uint32_t t = 0; t < soup->triangle_count; ++t) {
        uint32_t o = s->opposite[t];
        if (o == UMB_NONE || t > o) {
            continue;
        }
        uint32_t sheet = sheet_of(s, t);
        drop(&soup->triangles[o]);
        if (s->rimmed[sheet] && !s->stays[sheet]) {
            drop(&soup->triangles[t]);
            soup->stats.sealed += 2;
        } else {
            soup->triangles[t].two_sided = 1;
            soup->stats.duplicates += 1;
        }
    }
}

static bool seal_pairs(umb_weld_soup *soup, umb_scratch *scratch, uint32_t *opposite)
{
    sealer s = {.soup = soup, .opposite = opposite};
    if (!umb_weld_edges_build(&s.edges, scratch, soup)) {
        return false;
    }
    uint32_t *work = umb_scratch_get(scratch, (size_t)soup->triangle_count * 3, sizeof *work);
    s.parents = umb_scratch_get(scratch, soup->triangle_count, sizeof *s.parents);
    s.stays = umb_scratch_get_zero(scratch, soup->triangle_count, sizeof *s.stays);
    s.rimmed = umb_scratch_get_zero(scratch, soup->triangle_count, sizeof *s.rimmed);
    if (scratch->failed) {
        return false;
    }
    for (uint32_t t = 0; t < soup->triangle_count; ++t) {
        s.parents[t] = t;
    }
    look_at_edges(&s, work);
    settle_pairs(&s);
    return true;
}

bool umb_weld_seal(umb_weld_soup *soup)
{
    umb_scratch scratch = {.allocator = soup->allocator};
    uint32_t *opposite = umb_scratch_get(&scratch, soup->triangle_count, sizeof *opposite);
    bool ok = opposite != NULL && match_equal(soup, &scratch, opposite);
    if (ok) {
        umb_weld_soup_compact(soup);
        ok = match_diagonals(soup, &scratch) && match_equal(soup, &scratch, opposite);
    }
    bool any = false;
    for (uint32_t t = 0; ok && t < soup->triangle_count; ++t) {
        any = any || opposite[t] != UMB_NONE;
    }
    if (ok && any) {
        join_two_sided(soup, opposite);
        ok = seal_pairs(soup, &scratch, opposite);
    }
    umb_weld_soup_compact(soup);
    umb_scratch_free(&scratch);
    return ok;
}

/* Flat surfaces of fewer triangles, without changing one point of them.
 *
 *      b ______________            b ______________
 *       |\     |     /|             |'.            |     A vertex v is taken out where the triangles
 *       |  \   |   /  |             |   '.         |     around it are flat: all in one plane around it,
 *       |    \ | /    |      -->    |      '.      |     or, with v between a and b on a straight line,
 *      v|______|______|             |         '.   |     every wedge of triangles from a to b (the wall
 *       |    / | \    |             |            '.|     here, and the next one around the corner a-b).
 *      a|__/___|___\__|            a|______________|     The hole is filled again without v.
 *
 * Why the surface stays the same set of points: the triangles of a wedge lie in one plane and all
 * turn the same way, so the boundary of their sum says how often each point of the plane is
 * covered. The boundary of those that fill the hole is the same (a-v-b and a-b are the same
 * segment), and they turn that way too: so they cover each point as often. Turns and planes are
 * decided exactly, and no further condition on the shape of the hole is needed for this; a hole
 * that cannot be filled with such triangles is left as it was.
 *
 * Every triangle at v takes part, of whatever object, so no edge loses its partner. A new edge that
 * some other triangle has already would be one of four triangles, so it is not made. */
#include <math.h>
#include <string.h>

#include "geometry/collinear.h"
#include "geometry/orient.h"
#include "geometry/vec.h"
#include "weld_soup.h"

#define STAR_LIMIT 64u /* triangles at a vertex that is tried */
#define GROUP_LIMIT                                                                                \
    1024u /* groups of more triangles are left: a plain or a level's floor in one piece is drawn
                             when its nearest point is reached, and its far end spoils the depth of what
                             it covers there */

/* The triangles (v, from, to) around a vertex. */
typedef struct star {
    uint32_t v, count;
    uint32_t triangles[STAR_LIMIT];
    uint32_t from[STAR_LIMIT], to[STAR_LIMIT];
    uint64_t visited; /* bit per triangle */
} star;

/* The border of a hole, in a plane of which the coordinates i and j tell; its inside is to that
 * side which turn says. */
typedef struct hole {
    uint32_t corners[STAR_LIMIT + 1];
    uint32_t count;
    int i, j, turn;
} hole;

typedef struct merger {
    umb_weld_soup *soup;
    /* Lists of the corners (3 * triangle + place) at each vertex. */
    uint32_t *heads, *next, *previous;
    /* Vertices to be tried: a ring with room for each once. */
    uint32_t *queue;
    uint8_t *queued;
    uint32_t *sizes; /* triangles of each group, by its root */
    uint32_t first, waiting;
    star star;
    umb_weld_triangle made[STAR_LIMIT];
    uint32_t made_count;
} merger;

static uint32_t after(uint32_t corner)
{
    return corner % 3 == 2 ? corner - 2 : corner + 1;
}

static uint32_t vertex_at(const merger *m, uint32_t corner)
{
    return m->soup->triangles[corner / 3].v[corner % 3];
}

static void link_corner(merger *m, uint32_t corner)
{
    uint32_t *head = &m->heads[vertex_at(m, corner)];
    m->next[corner] = *head;
    m->previous[corner] = UMB_NONE;
    if (*head != UMB_NONE) {
        m->previous[*head] = corner;
    }
    *head = corner;
}

static void unlink_corner(merger *m, uint32_t corner)
{
    uint32_t next = m->next[corner], previous = m->previous[corner];
    if (previous != UMB_NONE) {
        m->next[previous] = next;
    } else {
        m->heads[vertex_at(m, corner)] = next;
    }
    if (next != UMB_NONE) {
        m->previous[next] = previous;
    }
}

static void enqueue(merger *m, uint32_t v)
{
    if (!m->queued[v]) {
        uint32_t end = m->first + m->waiting;
        m->queue[end < m->soup->position_count ? end : end - m->soup->position_count] = v;
        m->queued[v] = 1;
        m->waiting += 1;
    }
}

static uint32_t dequeue(merger *m)
{
    uint32_t v = m->queue[m->first];
    m->first = m->first + 1 < m->soup->position_count ? m->first + 1 : 0;
    m->waiting -= 1;
    m->queued[v] = 0;
    return v;
}

/* The triangles around v; false if they are none, too many or not of one group of the right
 * size. */
static bool gather(merger *m, uint32_t v)
{
    star *s = &m->star;
    s->v = v;
    s->count = 0;
    uint32_t root = UMB_NONE;
    for (uint32_t c = m->heads[v]; c != UMB_NONE; c = m->next[c]) {
        uint32_t r = umb_weld_soup_root(m->soup, m->soup->triangles[c / 3].object);
        if (s->count == STAR_LIMIT || (root != UMB_NONE && r != root) || m->sizes[r] > GROUP_LIMIT) {
            return false;
        }
        root = r;
        s->triangles[s->count] = c / 3;
        s->from[s->count] = vertex_at(m, after(c));
        s->to[s->count++] = vertex_at(m, after(after(c)));
    }
    return s->count > 0;
}

/* The one triangle of the star that goes on from x, or UMB_NONE if there is none or several. */
static uint32_t onward(const star *s, uint32_t x)
{
    uint32_t found = UMB_NONE;
    for (uint32_t t = 0; t < s->count; ++t) {
        if (s->from[t] == x) {
            if (found != UMB_NONE) {
                return UMB_NONE;
            }
            found = t;
        }
    }
    return found;
}

static bool has_edge(const merger *m, uint32_t p, uint32_t q, uint32_t but_at)
{
    /* Along both lists at once: the shorter one decides. */
    uint32_t c = m->heads[p], d = m->heads[q];
    for (; c != UMB_NONE && d != UMB_NONE; c = m->next[c], d = m->next[d]) {
        uint32_t x = vertex_at(m, after(c)), y = vertex_at(m, after(after(c)));
        uint32_t z = vertex_at(m, after(d)), w = vertex_at(m, after(after(d)));
        if (((x == q || y == q) && x != but_at && y != but_at) ||
            ((z == p || w == p) && z != but_at && w != but_at)) {
            return true;
        }
    }
    return false;
}

static int turn(const merger *m, const hole *h, uint32_t a, uint32_t b, uint32_t c)
{
    const float(*p)[3] = (const float(*)[3])m->soup->positions;
    return umb_collinear_turn(p[a], p[b], p[c], h->i, h->j);
}

/* The triangles of v with each two corners that follow one another lie in one plane and turn one
 * way. */
static bool is_flat(const merger *m, hole *h, bool closed)
{
    const float(*p)[3] = (const float(*)[3])m->soup->positions;
    const float *v = p[m->star.v];
    const uint32_t *c = h->corners;
    for (uint32_t k = 2; k < h->count; ++k) {
        if (umb_orient(v, p[c[0]], p[c[1]], p[c[k]]) != 0) {
            return false;
        }
    }
    umb_vec3 from = umb_vec3_from_float(v);
    umb_vec3 n = umb_vec3_cross(umb_vec3_sub(umb_vec3_from_float(p[c[0]]), from),
                                umb_vec3_sub(umb_vec3_from_float(p[c[1]]), from));
    double size[3] = {fabs(n.x), fabs(n.y), fabs(n.z)};
    int axis = size[0] >= size[1] && size[0] >= size[2] ? 0 : size[1] >= size[2] ? 1 : 2;
    h->i = (axis + 1) % 3;
    h->j = (axis + 2) % 3;
    h->turn = turn(m, h, m->star.v, c[0], c[1]);
    if (h->turn == 0) {
        return false;
    }
    for (uint32_t k = 1; k < h->count; ++k) {
        if ((closed || k + 1 < h->count) &&
            turn(m, h, m->star.v, c[k], c[(k + 1) % h->count]) != h->turn) {
            return false;
        }
    }
    return true;
}

/* Corner k can be cut off: a triangle with no other corner in it. */
static bool is_ear(const merger *m, const hole *h, uint32_t k)
{
    const uint32_t *c = h->corners;
    uint32_t a = c[(k + h->count - 1) % h->count], b = c[k], d = c[(k + 1) % h->count];
    if (turn(m, h, a, b, d) != h->turn) {
        return false;
    }
    for (uint32_t n = 2; n + 1 < h->count; ++n) {
        uint32_t x = c[(k + n) % h->count];
        if (turn(m, h, a, b, x) != -h->turn && turn(m, h, b, d, x) != -h->turn &&
            turn(m, h, d, a, x) != -h->turn) {
            return false;
        }
    }
    return !has_edge(m, a, d, m->star.v);
}

static void make(merger *m, const hole *h, uint32_t k, const umb_weld_triangle *model)
{
    umb_weld_triangle *t = &m->made[m->made_count++];
    *t = *model;
    t->v[0] = h->corners[(k + h->count - 1) % h->count];
    t->v[1] = h->corners[k];
    t->v[2] = h->corners[(k + 1) % h->count];
}

/* Cut corners off until nothing is left; the shortest cut first, which keeps triangles compact. */
static bool fill(merger *m, hole *h, const umb_weld_triangle *model)
{
    for (; h->count > 3; --h->count) {
        uint32_t best = UMB_NONE;
        double shortest = INFINITY;
        for (uint32_t k = 0; k < h->count; ++k) {
            umb_vec3 a = umb_vec3_from_float(
                m->soup->positions[h->corners[(k + h->count - 1) % h->count]]);
            umb_vec3 b = umb_vec3_from_float(m->soup->positions[h->corners[(k + 1) % h->count]]);
            umb_vec3 d = umb_vec3_sub(b, a);
            double length = umb_vec3_dot(d, d);
            if (length < shortest && is_ear(m, h, k)) {
                shortest = length;
                best = k;
            }
        }
        if (best == UMB_NONE) {
            return false;
        }
        make(m, h, best, model);
        memmove(&h->corners[best], &h->corners[best + 1],
                (h->count - best - 1) * sizeof *h->corners);
    }
    make(m, h, 1, model);
    return turn(m, h, h->corners[0], h->corners[1], h->corners[2]) == h->turn;
}

/* Follow the star from triangle t to one that ends at a or b, which is returned; UMB_NONE if there
 * is no such way or the triangles differ. The corners before the end become those of the hole. */
static uint32_t follow(merger *m, uint32_t t, uint32_t a, uint32_t b, hole *h)
{
    star *s = &m->star;
    uint32_t two_sided = m->soup->triangles[s->triangles[t]].two_sided;
    h->count = 0;
    while (t != UMB_NONE && (s->visited >> t & 1) == 0 &&
           m->soup->triangles[s->triangles[t]].two_sided == two_sided) {
        s->visited |= (uint64_t)1 << t;
        h->corners[h->count++] = s->from[t];
        if (s->to[t] == a || s->to[t] == b) {
            return s->to[t];
        }
        t = onward(s, s->to[t]);
    }
    return UMB_NONE;
}

static bool all_visited(const star *s)
{
    return s->visited == UINT64_MAX >> (64 - s->count);
}

/* v lies inside of one flat surface. */
static bool fill_ring(merger *m)
{
    star *s = &m->star;
    hole h;
    s->visited = 0;
    m->made_count = 0;
    return follow(m, 0, s->from[0], s->from[0], &h) != UMB_NONE && all_visited(s) &&
           is_flat(m, &h, true) && fill(m, &h, &m->soup->triangles[s->triangles[0]]);
}

/* v lies between a and b: every way around v from one leads to the other, through a flat wedge. */
static bool fill_wedges(merger *m, uint32_t a, uint32_t b)
{
    star *s = &m->star;
    s->visited = 0;
    m->made_count = 0;
    for (uint32_t t = 0; t < s->count; ++t) {
        if (s->from[t] == a || s->from[t] == b) {
            hole h;
            uint32_t end = follow(m, t, a, b, &h);
            if (end == UMB_NONE || end == s->from[t]) {
                return false;
            }
            h.corners[h.count++] = end;
            if (!is_flat(m, &h, false) || !fill(m, &h, &m->soup->triangles[s->triangles[t]])) {
                return false;
            }
        }
    }
    return all_visited(s) && !has_edge(m, a, b, s->v);
}

static bool fill_between(merger *m)
{
    const star *s = &m->star;
    const float(*p)[3] = (const float(*)[3])m->soup->positions;
    uint32_t around[2 * STAR_LIMIT], count = 0;
    for (uint32_t t = 0; t < 2 * s->count; ++t) {
        uint32_t x = t < s->count ? s->from[t] : s->to[t - s->count], k = 0;
        while (k < count && around[k] != x) {
            ++k;
        }
        if (k == count) {
            around[count++] = x;
        }
    }
    for (uint32_t k = 1; k < count; ++k) {
        for (uint32_t n = 0; n < k; ++n) {
            if (umb_collinear_inside(p[around[n]], p[around[k]], p[s->v]) &&
                fill_wedges(m, around[n], around[k])) {
                return true;
            }
        }
    }
    return false;
}

/* Put the triangles made in the place of the star. */
static void replace(merger *m)
{
    const star *s = &m->star;
    umb_weld_soup *soup = m->soup;
    uint32_t root = umb_weld_soup_root(soup, soup->triangles[s->triangles[0]].object);
    soup->merged[root] += s->count - m->made_count;
    soup->stats.merged += 1;
    for (uint32_t t = 0; t < s->count; ++t) {
        uint32_t corner = 3 * s->triangles[t];
        for (uint32_t k = 0; k < 3; ++k) {
            unlink_corner(m, corner + k);
        }
        enqueue(m, s->from[t]);
        enqueue(m, s->to[t]);
        if (t < m->made_count) {
            soup->triangles[s->triangles[t]] = m->made[t];
            for (uint32_t k = 0; k < 3; ++k) {
                link_corner(m, corner + k);
            }
        } else {
            soup->triangles[s->triangles[t]].v[0] = UMB_NONE;
        }
    }
}

static bool prepare(merger *m, umb_scratch *scratch)
{
    size_t vertices = m->soup->position_count, corners = 3 * (size_t)m->soup->triangle_count;
    m->heads = umb_scratch_get(scratch, vertices, sizeof *m->heads);
    m->next = umb_scratch_get(scratch, corners, sizeof *m->next);
    m->previous = umb_scratch_get(scratch, corners, sizeof *m->previous);
    m->queue = umb_scratch_get(scratch, vertices, sizeof *m->queue);
    m->queued = umb_scratch_get_zero(scratch, vertices, sizeof *m->queued);
    m->sizes = umb_scratch_get_zero(scratch, m->soup->object_count, sizeof *m->sizes);
    if (scratch->failed) {
        return false;
    }
    memset(m->heads, 0xFF, vertices * sizeof *m->heads);
    for (uint32_t t = 0; t < m->soup->triangle_count; ++t) {
        m->sizes[umb_weld_soup_root(m->soup, m->soup->triangles[t].object)] += 1;
    }
    for (uint32_t c = 0; c < corners; ++c) {
        link_corner(m, c);
    }
    for (uint32_t v = 0; v < vertices; ++v) {
        enqueue(m, v);
    }
    return true;
}

bool umb_weld_merge(umb_weld_soup *soup)
{
    umb_scratch scratch = {.allocator = soup->allocator};
    merger m = {.soup = soup};
    bool ok = prepare(&m, &scratch);
    while (ok && m.waiting > 0) {
        if (gather(&m, dequeue(&m)) && (fill_ring(&m) || fill_between(&m))) {
            replace(&m);
        }
    }
    umb_weld_soup_compact(soup);
    umb_scratch_free(&scratch);
    return ok;
}

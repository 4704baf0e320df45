/* T-junctions: a vertex of one triangle exactly on an edge of another.
 *
 *      u ______________ v          u ______ m ______ v
 *       |              |            |    . ' | ' .    |     Below the line the edge is (u, v), above
 *       |______________|    -->     | .'     |    '.  |     it (u, m) and (m, v): no partners, so both
 *       |      |m      |            |______ m|________|     would be drawn as silhouettes and leave a
 *       |______|_______|            |        |        |     crack. Splitting the triangle below at m
 *                                                           covers the same points and pairs them.
 *
 * Only edges without a partner are looked at, and only ends of such edges split: a vertex that
 * merely touches pairs nothing. Edges along an axis are gathered by the line they lie on, which
 * finds every overlap; any other edge is followed from its ends over the edges that run the same
 * way exactly, which finds those that share a chain of vertices with it. Being on an edge is
 * decided exactly, so the parts of a triangle are together the very same set of points. */
#include "base/sort.h"
#include "geometry/collinear.h"
#include "weld_soup.h"

#define FAN_LIMIT 256u  /* edges at one vertex that are tried */
#define STACK_SIZE 128u /* each cut halves one side's points: three times 32 levels at most */

/* An edge without a partner, from the lower to the higher vertex. */
typedef struct open_edge {
    uint32_t u, v;
    uint32_t begin, end; /* its half-edges */
    uint32_t first_point, point_count;
} open_edge;

typedef struct splitter {
    umb_weld_soup *soup;
    umb_scratch *scratch;
    umb_weld_edges edges;
    open_edge *open;
    uint32_t open_count;
    uint64_t *found_keys; /* open edge, place along it; beside the vertex found there */
    uint32_t *found_vertices;
    size_t found_key_capacity, found_vertex_capacity;
    uint32_t found_count, found_limit;
    bool failed;
} splitter;

static bool find_open_edges(splitter *s)
{
    s->open = umb_scratch_get(s->scratch, s->edges.count, sizeof *s->open);
    if (s->open == NULL) {
        return false;
    }
    for (uint32_t begin = 0, end; begin < s->edges.count; begin = end) {
        end = umb_weld_edges_end(&s->edges, begin);
        open_edge e = {(uint32_t)(s->edges.keys[begin] >> 32),
                       (uint32_t)s->edges.keys[begin],
                       begin,
                       end,
                       0,
                       0};
        int64_t balance = 0;
        bool two_sided = false;
        for (uint32_t i = begin; i < end; ++i) {
            const umb_weld_triangle *t = &s->soup->triangles[s->edges.halves[i] / 3];
            balance += t->v[s->edges.halves[i] % 3] == e.u ? 1 : -1;
            two_sided = two_sided || t->two_sided != 0;
        }
        /* A two-sided triangle pairs with anything. */
        if (end - begin == 1 || (balance != 0 && !two_sided)) {
            s->open[s->open_count++] = e;
        }
    }
    return true;
}

/* The axis that an edge is longest along; parallel tells whether it runs along no other. */
static int main_axis(const splitter *s, const open_edge *e, bool *parallel)
{
    const float *u = s->soup->positions[e->u], *v = s->soup->positions[e->v];
    int axis = 0, differ = 0;
    double longest = -1.0;
    for (int k = 0; k < 3; ++k) {
        double d = (double)v[k] - u[k];
        d = d < 0.0 ? -d : d;
        differ += d > 0.0 ? 1 : 0;
        if (d > longest) {
            longest = d;
            axis = k;
        }
    }
    *parallel = differ == 1;
    return axis;
}

/* Vertex m lies on open edge i. */
static void found(splitter *s, uint32_t i, uint32_t m)
{
    const open_edge *e = &s->open[i];
    if (s->failed || s->found_count >= s->found_limit) {
        return; /* not splitting is safe */
    }
    if (!umb_memory_reserve(s->soup->allocator, (void **)&s->found_keys, &s->found_key_capacity,
                            (size_t)s->found_count + 1, sizeof *s->found_keys) ||
        !umb_memory_reserve(s->soup->allocator, (void **)&s->found_vertices,
                            &s->found_vertex_capacity, (size_t)s->found_count + 1,
                            sizeof *s->found_vertices)) {
        s->failed = true;
        return;
    }
    bool parallel;
    int axis = main_axis(s, e, &parallel);
    uint32_t place = umb_sort_float(s->soup->positions[m][axis]);
    if (s->soup->positions[e->u][axis] > s->soup->positions[e->v][axis]) {
        place = ~place;
    }
    s->found_keys[s->found_count] = (uint64_t)i << 32 | place;
    s->found_vertices[s->found_count] = m;
    s->found_count += 1;
}

static uint64_t line_hash(const float *p, int axis)
{
    uint64_t h = (uint64_t)axis + 1;
    for (int k = 1; k < 3; ++k) {
        h = (h ^ umb_sort_float(p[(axis + k) % 3])) * 0x9E3779B97F4A7C15u;
        h ^= h >> 31;
    }
    return h;
}

/* All open edges of one axis-parallel line (or of several with one hash: the exact test tells). */
static void split_on_line(splitter *s, const uint32_t *members, uint32_t count, int axis,
                          uint64_t *ends, uint32_t *vertices, uint64_t *key_scratch,
                          uint32_t *value_scratch)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const open_edge *e = &s->open[members[i]];
        uint32_t pair[2] = {e->u, e->v};
        for (int k = 0; k < 2; ++k) {
            ends[n] = (uint64_t)umb_sort_float(s->soup->positions[pair[k]][axis]) << 32 | pair[k];
            vertices[n++] = pair[k];
        }
    }
    umb_sort_keys(ends, vertices, key_scratch, value_scratch, n);
    for (uint32_t i = 0; i < count; ++i) {
        const open_edge *e = &s->open[members[i]];
        const float *u = s->soup->positions[e->u], *v = s->soup->positions[e->v];
        uint64_t low = (uint64_t)umb_sort_float(u[axis] < v[axis] ? u[axis] : v[axis]);
        uint64_t high = (uint64_t)umb_sort_float(u[axis] < v[axis] ? v[axis] : u[axis]);
        uint32_t a = 0, b = n;
        while (a < b) {
            uint32_t middle = a + (b - a) / 2;
            if (ends[middle] >> 32 <= low) {
                a = middle + 1;
            } else {
                b = middle;
            }
        }
        uint32_t last = UMB_NONE;
        for (; a < n && ends[a] >> 32 < high && s->found_count < s->found_limit; ++a) {
            if (vertices[a] != last && umb_collinear_inside(u, v, s->soup->positions[vertices[a]])) {
                found(s, members[i], vertices[a]);
            }
            last = vertices[a];
        }
    }
}

static bool split_along_axes(splitter *s)
{
    size_t n = s->open_count;
    uint64_t *keys = umb_scratch_get(s->scratch, n, sizeof *keys);
    uint32_t *members = umb_scratch_get(s->scratch, n, sizeof *members);
    uint64_t *ends = umb_scratch_get(s->scratch, 2 * n, sizeof *ends);
    uint32_t *vertices = umb_scratch_get(s->scratch, 2 * n, sizeof *vertices);
    uint64_t *key_scratch = umb_scratch_get(s->scratch, 2 * n, sizeof *key_scratch);
    uint32_t *value_scratch = umb_scratch_get(s->scratch, 2 * n, sizeof *value_scratch);
    if (s->scratch->failed) {
        return false;
    }
    uint32_t count = 0;
    bool parallel;
    for (uint32_t i = 0; i < n; ++i) {
        int axis = main_axis(s, &s->open[i], &parallel);
        if (parallel) {
            keys[count] = line_hash(s->soup->positions[s->open[i].u], axis);
            members[count++] = i;
        }
    }
    umb_sort_keys(keys, members, key_scratch, value_scratch, count);
    for (uint32_t begin = 0, end; begin < count; begin = end) {
        end = begin + 1;
        while (end < count && keys[end] == keys[begin]) {
            ++end;
        }
        if (end - begin > 1) {
            int axis = main_axis(s, &s->open[members[begin]], &parallel);
            split_on_line(s, members + begin, end - begin, axis, ends, vertices, key_scratch,
                          value_scratch);
        }
    }
    umb_scratch_drop(s->scratch, keys);
    umb_scratch_drop(s->scratch, members);
    umb_scratch_drop(s->scratch, ends);
    umb_scratch_drop(s->scratch, vertices);
    umb_scratch_drop(s->scratch, key_scratch);
    umb_scratch_drop(s->scratch, value_scratch);
    return !s->failed;
}

/* Open edges that run along no axis, from both of their ends, sorted. */
typedef struct fan {
    uint64_t *keys; /* vertex, other end */
    uint32_t *unused;
    uint32_t count;
} fan;

/* The nearest vertex to from that an open edge at from leads to and that lies between from and
 * to. */
static uint32_t next_between(const splitter *s, const fan *f, uint32_t from, uint32_t to, int axis)
{
    uint32_t a = 0, b = f->count;
    while (a < b) {
        uint32_t middle = a + (b - a) / 2;
        if (f->keys[middle] >> 32 < from) {
            a = middle + 1;
        } else {
            b = middle;
        }
    }
    uint32_t best = UMB_NONE, tried = 0;
    for (; a < f->count && f->keys[a] >> 32 == from && tried < FAN_LIMIT; ++a, ++tried) {
        uint32_t w = (uint32_t)f->keys[a];
        const float(*p)[3] = (const float(*)[3])s->soup->positions;
        if (umb_collinear_inside(p[from], p[to], p[w]) &&
            (best == UMB_NONE || (p[w][axis] < p[best][axis]) == (p[from][axis] < p[to][axis]))) {
            best = w;
        }
    }
    return best;
}

static bool split_along_chains(splitter *s)
{
    size_t n = 2 * (size_t)s->open_count;
    fan f = {umb_scratch_get(s->scratch, n, sizeof *f.keys),
             umb_scratch_get(s->scratch, n, sizeof *f.unused), 0};
    uint64_t *key_scratch = umb_scratch_get(s->scratch, n, sizeof *key_scratch);
    uint32_t *value_scratch = umb_scratch_get(s->scratch, n, sizeof *value_scratch);
    if (s->scratch->failed) {
        return false;
    }
    for (uint32_t i = 0; i < s->open_count; ++i) {
        const open_edge *e = &s->open[i];
        bool parallel;
        (void)main_axis(s, e, &parallel);
        if (!parallel) {
            f.keys[f.count] = (uint64_t)e->u << 32 | e->v;
            f.unused[f.count++] = i;
            f.keys[f.count] = (uint64_t)e->v << 32 | e->u;
            f.unused[f.count++] = i;
        }
    }
    umb_sort_keys(f.keys, f.unused, key_scratch, value_scratch, f.count);
    for (uint32_t i = 0; i < s->open_count && !s->failed; ++i) {
        const open_edge e = s->open[i];
        bool parallel;
        int axis = main_axis(s, &e, &parallel);
        for (int way = 0; way < 2 && !parallel; ++way) {
            uint32_t from = way == 0 ? e.u : e.v, to = way == 0 ? e.v : e.u;
            while ((from = next_between(s, &f, from, to, axis)) != UMB_NONE &&
                   s->found_count < s->found_limit && !s->failed) {
                found(s, i, from);
            }
        }
    }
    umb_scratch_drop(s->scratch, f.keys);
    umb_scratch_drop(s->scratch, f.unused);
    umb_scratch_drop(s->scratch, key_scratch);
    umb_scratch_drop(s->scratch, value_scratch);
    return !s->failed;
}

/* The points on one side of a triangle, in the order of the side when step is 1. */
typedef struct side {
    uint32_t begin, end;
    bool reversed;
} side;

typedef struct piece {
    uint32_t v[3];
    side sides[3]; /* side k runs from v[k] to v[k + 1] */
} piece;

/* Cut off the side with the most points at its middle one. */
static void cut_piece(const uint32_t *points, const piece *p, piece *first, piece *second)
{
    static const side none = {0, 0, false};
    int k = 0;
    for (int i = 1; i < 3; ++i) {
        if (p->sides[i].end - p->sides[i].begin > p->sides[k].end - p->sides[k].begin) {
            k = i;
        }
    }
    side s = p->sides[k];
    uint32_t middle = s.begin + (s.end - s.begin) / 2, m = points[middle];
    side low = {s.begin, middle, s.reversed}, high = {middle + 1, s.end, s.reversed};
    uint32_t a = p->v[k], b = p->v[(k + 1) % 3], c = p->v[(k + 2) % 3];
    piece x = {{a, m, c}, {s.reversed ? high : low, none, p->sides[(k + 2) % 3]}};
    piece y = {{m, b, c}, {s.reversed ? low : high, p->sides[(k + 1) % 3], none}};
    *first = x;
    *second = y;
}

/* Replace triangle t by its parts: the first in its place, the others at the end. */
static void split_triangle(splitter *s, uint32_t t, const uint32_t *half_edges)
{
    umb_weld_soup *soup = s->soup;
    piece stack[STACK_SIZE];
    uint32_t depth = 1, parts = 0;
    umb_weld_triangle part = soup->triangles[t];
    for (int k = 0; k < 3; ++k) {
        stack[0].v[k] = part.v[k];
        uint32_t i = half_edges[3 * (size_t)t + (uint32_t)k];
        side empty = {0, 0, false};
        stack[0].sides[k] = empty;
        if (i != UMB_NONE) {
            stack[0].sides[k].begin = s->open[i].first_point;
            stack[0].sides[k].end = s->open[i].first_point + s->open[i].point_count;
            stack[0].sides[k].reversed = part.v[k] != s->open[i].u;
        }
    }
    while (depth > 0) {
        piece p = stack[--depth];
        bool whole = true;
        for (int k = 0; k < 3; ++k) {
            whole = whole && p.sides[k].begin == p.sides[k].end;
        }
        if (!whole) {
            cut_piece(s->found_vertices, &p, &stack[depth + 1], &stack[depth]);
            depth += 2;
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            part.v[k] = p.v[k];
        }
        if (parts == 0) {
            soup->triangles[t] = part;
        } else {
            soup->triangles[soup->triangle_count++] = part;
        }
        parts += 1;
    }
}

/* Sort what was found, drop what was found twice, and note for each open edge which points are
 * its. */
static bool sort_points(splitter *s)
{
    uint64_t *key_scratch = umb_scratch_get(s->scratch, s->found_count, sizeof *key_scratch);
    uint32_t *value_scratch = umb_scratch_get(s->scratch, s->found_count, sizeof *value_scratch);
    if (s->scratch->failed) {
        return false;
    }
    umb_sort_keys(s->found_keys, s->found_vertices, key_scratch, value_scratch, s->found_count);
    uint32_t count = 0;
    for (uint32_t i = 0; i < s->found_count; ++i) {
        if (i > 0 && s->found_keys[i] == s->found_keys[i - 1]) {
            continue; /* one place on a line is one vertex */
        }
        open_edge *e = &s->open[s->found_keys[i] >> 32];
        if (e->point_count == 0) {
            e->first_point = count;
        }
        e->point_count += 1;
        s->found_vertices[count++] = s->found_vertices[i];
    }
    s->found_count = count;
    s->soup->stats.t_junctions += count;
    return true;
}

static bool split_triangles(splitter *s)
{
    umb_weld_soup *soup = s->soup;
    uint32_t before = soup->triangle_count;
    uint32_t *half_edges = umb_scratch_get(s->scratch, (size_t)before * 3, sizeof *half_edges);
    if (half_edges == NULL || !sort_points(s)) {
        return false;
    }
    size_t more = 0;
    for (size_t h = 0; h < (size_t)before * 3; ++h) {
        half_edges[h] = UMB_NONE;
    }
    for (uint32_t i = 0; i < s->open_count; ++i) {
        const open_edge *e = &s->open[i];
        for (uint32_t k = e->begin; k < e->end && e->point_count > 0; ++k) {
            half_edges[s->edges.halves[k]] = i;
            more += e->point_count;
        }
    }
    if (before + more > (1u << 30)) {
        return true; /* too many to number: left as they are */
    }
    if (!umb_memory_reserve(soup->allocator, (void **)&soup->triangles, &soup->triangle_capacity,
                            before + more, sizeof *soup->triangles)) {
        return false;
    }
    for (uint32_t t = 0; t < before; ++t) {
        const uint32_t *h = half_edges + 3 * (size_t)t;
        if (h[0] != UMB_NONE || h[1] != UMB_NONE || h[2] != UMB_NONE) {
            split_triangle(s, t, half_edges);
        }
    }
    return true;
}

bool umb_weld_split(umb_weld_soup *soup)
{
    umb_scratch scratch = {.allocator = soup->allocator};
    splitter s = {.soup = soup, .scratch = &scratch};
    /* Edges nested on one line could find a quadratic number of points: more than this is no
     * scene. */
    s.found_limit = soup->triangle_count < (1u << 28) ? 4 * soup->triangle_count + 64 : 1u << 30;
    bool ok = umb_weld_edges_build(&s.edges, &scratch, soup) && find_open_edges(&s) &&
              split_along_axes(&s) && split_along_chains(&s);
    if (ok && s.found_count > 0) {
        ok = split_triangles(&s);
    }
    umb_memory_free(soup->allocator, s.found_keys, s.found_key_capacity * sizeof *s.found_keys);
    umb_memory_free(soup->allocator, s.found_vertices,
                    s.found_vertex_capacity * sizeof *s.found_vertices);
    umb_scratch_free(&scratch);
    return ok;
}

#include "blocker_set.h"

#include <string.h>

#include "geometry/transform.h"
#include "sight.h"

/* Every bound here is derived in docs/conservative.md, 14. */
#define FLOAT_SLACK 0x1p-20
#define DOUBLE_SLACK 0x1p-46

/* A blocker as it is put together. */
typedef struct maker {
    umb_blockers *b;
    const umb_blocker_def *def;
    umb_blocker blocker;
    umb_vec3 near_n[UMB_BLOCKER_PLANES];
    double near_at[UMB_BLOCKER_PLANES], near_size[UMB_BLOCKER_PLANES];
    uint32_t near_count;
} maker;

static uint32_t table_size(uint32_t count)
{
    uint32_t size = 16;
    while (size < 2 * count) {
        size *= 2;
    }
    return size;
}

bool umb_blockers_begin(umb_blockers *b, const umb_allocator *a, const umb_viewer *viewer, uint32_t count)
{
    size_t n = count, edges = n * UMB_BLOCKER_EDGES, planes = n * UMB_BLOCKER_PLANES;
    size_t spaces = edges * viewer->point_count + 2 * planes;
    b->viewer = *viewer;
    for (int i = 0; i < 3; ++i) {
        b->origin[i] = viewer->parallel ? viewer->from[i] : viewer->points[0][i];
        b->origin_high[i] = (float)b->origin[i];
        b->origin_low[i] = (float)(b->origin[i] - b->origin_high[i]);
    }
    b->count = b->space_count = b->edge_count = b->plane_count = 0;
    return umb_memory_reserve(a, (void **)&b->list, &b->list_capacity, n, sizeof *b->list) &&
           umb_memory_reserve(a, (void **)&b->spaces, &b->space_capacity, spaces, sizeof *b->spaces) &&
           umb_memory_reserve(a, (void **)&b->edges, &b->edge_capacity, edges, sizeof *b->edges) &&
           umb_memory_reserve(a, (void **)&b->planes, &b->plane_capacity, planes, sizeof *b->planes) &&
           umb_memory_reserve(a, (void **)&b->table, &b->table_capacity, table_size(count), sizeof *b->table);
}

void umb_blockers_free(umb_blockers *b, const umb_allocator *a)
{
    umb_memory_free(a, b->list, b->list_capacity * sizeof *b->list);
    umb_memory_free(a, b->spaces, b->space_capacity * sizeof *b->spaces);
    umb_memory_free(a, b->edges, b->edge_capacity * sizeof *b->edges);
    umb_memory_free(a, b->planes, b->plane_capacity * sizeof *b->planes);
    umb_memory_free(a, b->table, b->table_capacity * sizeof *b->table);
    memset(b, 0, sizeof *b);
}

/* n . (x - origin) > at, where n is off by less than n_error in each component and at by at_error. False if
 * nothing is known of n. */
static bool add_space(umb_blockers *b, umb_vec3 n, double at, double n_error, double at_error)
{
    double size = fmax(fabs(n.x), fmax(fabs(n.y), fabs(n.z)));
    if (!(size > 4.0 * n_error) || !(size < 1e300) || !(fabs(at) < 1e300) || size < 1e-300) {
        return false;
    }
    umb_half_space *s = &b->spaces[b->space_count++];
    double scale = 1.0 / size, origin = fabs(b->origin[0]) + fabs(b->origin[1]) + fabs(b->origin[2]);
    double place = at * scale;
    s->n[0] = (float)(n.x * scale);
    s->n[1] = (float)(n.y * scale);
    s->n[2] = (float)(n.z * scale);
    s->at = (float)place;
    s->slack = (float)(FLOAT_SLACK + 4.0 * n_error * scale);
    double room = FLOAT_SLACK * fabs(place) + 4.0 * at_error * scale + 0x1p-44 * origin;
    s->room = (float)(room * (1.0 + 0x1p-20)) + 0x1p-140f;
    return true;
}

static void vertex(const maker *m, uint32_t number, float out[3])
{
    const umb_occluder *o = m->def->place;
    const float *p = m->def->facets->positions[number];
    if (o->identity) {
        memcpy(out, p, 3 * sizeof *out);
    } else {
        umb_transform_point(&o->transform, p, out);
    }
}

/* 1 if the viewer sees a triangle from where its corners run counter-clockwise, from each of its points; -1 if from
 * behind; 0 if neither is sure. */
static int triangle_faces(const maker *m, uint32_t triangle)
{
    const uint32_t *corners = m->def->facets->triangles[triangle];
    float p[3][3];
    int all = 2;
    for (int k = 0; k < 3; ++k) {
        vertex(m, corners[k], p[k]);
    }
    for (uint32_t i = 0; i < m->b->viewer.point_count; ++i) {
        umb_sight s = umb_sight_past(&m->b->viewer, i, p[0], p[1]);
        int side = umb_sight_side(&s, umb_vec3_from_float(p[2]));
        all = all == 2 || all == side ? side : 0;
    }
    return all;
}

/* The same of a facet, turned with a transform that mirrors: 1 if it is seen from its front. */
static int facet_faces(const maker *m, const umb_facet *f)
{
    const uint32_t *members = m->def->facets->members + f->first_triangle;
    int all = triangle_faces(m, members[0]);
    for (uint32_t i = 1; i < f->triangle_count && all != 0; ++i) {
        all = triangle_faces(m, members[i]) == all ? all : 0;
    }
    return m->def->place->mirrored ? -all : all;
}

/* From corner to corner the way they run counter-clockwise as seen: a transform that mirrors turns them about, and so
 * does looking from behind. */
static bool runs_back(const maker *m)
{
    return m->def->place->mirrored != m->blocker.flipped;
}

static bool add_edge(maker *m, const umb_facet *f, uint32_t corner)
{
    umb_blockers *b = m->b;
    const umb_facets *facets = m->def->facets;
    if (m->blocker.edge_count == UMB_BLOCKER_EDGES) {
        return false;
    }
    umb_blocker_edge *e = &b->edges[b->edge_count++];
    uint32_t from = facets->corners[f->first + corner], to = facets->corners[f->first + (corner + 1) % f->count];
    vertex(m, from, runs_back(m) ? e->b : e->a);
    vertex(m, to, runs_back(m) ? e->a : e->b);
    e->beyond = UMB_NONE;
    e->facet = facets->beyond[f->first + corner];
    e->id = (uint64_t)m->def->occluder << 32 | (f->first + corner) << 1 | (m->blocker.flipped ? 1u : 0u);
    m->blocker.edge_count += 1;
    for (uint32_t i = 0; i < b->viewer.point_count; ++i) {
        umb_sight s = umb_sight_past(&b->viewer, i, e->a, e->b);
        umb_vec3 off = umb_vec3_sub(s.from, umb_vec3_from_double(b->origin));
        double at = umb_vec3_dot(s.n, off), size = umb_vec3_sum_abs(s.n) * umb_vec3_sum_abs(off);
        if (!add_space(b, s.n, at, s.error, s.error * umb_vec3_sum_abs(off) + 0x1p-50 * size)) {
            return false;
        }
    }
    return true;
}

/* The area vector of the corners as they are, towards the viewer; of greatest component 1. */
static bool facet_normal(const maker *m, const umb_facet *f, float out[3])
{
    const uint32_t *corners = m->def->facets->corners + f->first;
    float first[3], last[3], next[3];
    umb_vec3 sum = {0, 0, 0};
    vertex(m, corners[0], first);
    vertex(m, corners[1], last);
    umb_vec3 a = umb_vec3_from_float(first);
    for (uint32_t i = 2; i < f->count; ++i) {
        vertex(m, corners[i], next);
        sum = umb_vec3_add(sum, umb_vec3_cross(umb_vec3_sub(umb_vec3_from_float(last), a),
                                               umb_vec3_sub(umb_vec3_from_float(next), a)));
        memcpy(last, next, sizeof last);
    }
    double size = fmax(fabs(sum.x), fmax(fabs(sum.y), fabs(sum.z)));
    if (!(size > 1e-300 && size < 1e300)) {
        return false;
    }
    sum = umb_vec3_scale(sum, (runs_back(m) ? -1.0 : 1.0) / size);
    out[0] = (float)sum.x;
    out[1] = (float)sum.y;
    out[2] = (float)sum.z;
    return true;
}

/* Least and greatest n . (v - origin) over a facet's corners, and the greatest sum of |v - origin|. */
typedef struct span {
    double low, high, reach;
} span;

static span span_of(const maker *m, const umb_facet *f, umb_vec3 n)
{
    span s = {INFINITY, -INFINITY, 0.0};
    umb_vec3 origin = umb_vec3_from_double(m->b->origin);
    for (uint32_t i = 0; i < f->count; ++i) {
        float v[3];
        vertex(m, m->def->facets->corners[f->first + i], v);
        umb_vec3 d = umb_vec3_sub(umb_vec3_from_float(v), origin);
        double at = umb_vec3_dot(n, d), reach = umb_vec3_sum_abs(d);
        s.low = at < s.low ? at : s.low;
        s.high = at > s.high ? at : s.high;
        s.reach = reach > s.reach ? reach : s.reach;
    }
    return s;
}

/* True if every point of the viewer is beyond the surface on the other side: n . (p - origin) > high. */
static bool looks_along(const umb_blockers *b, umb_vec3 n, span s)
{
    umb_vec3 origin = umb_vec3_from_double(b->origin);
    for (uint32_t i = 0; i < b->viewer.point_count; ++i) {
        umb_vec3 p = umb_vec3_from_double(b->viewer.points[i]);
        umb_vec3 d = b->viewer.parallel ? p : umb_vec3_sub(p, origin);
        double at = umb_vec3_dot(n, d), bound = 0x1p-48 * (umb_vec3_sum_abs(d) + s.reach);
        if (b->viewer.parallel ? !(at < -0x1p-40 * umb_vec3_sum_abs(d)) : !(at > s.high + bound)) {
            return false;
        }
    }
    return true;
}

/* Depths of a facet beyond the near plane, and what they may be off. */
static span near_span(const maker *m, const umb_facet *f, double *bound)
{
    const umb_viewer *v = &m->b->viewer;
    umb_vec3 forward = umb_vec3_from_double(v->forward);
    umb_vec3 to_origin = umb_vec3_sub(umb_vec3_from_double(m->b->origin), umb_vec3_from_double(v->from));
    span s = span_of(m, f, forward);
    double off = umb_vec3_dot(forward, to_origin) - v->near_depth;
    *bound = 0x1p-46 * (2.0 * s.reach + 2.0 * umb_vec3_sum_abs(to_origin) + fabs(v->near_depth));
    return (span){s.low + off, s.high + off, s.reach};
}

/* The half-space of points whose sight-line meets the facet no nearer than the near plane. Where all of the facet is
 * beyond near, none is needed. */
static void add_near(maker *m, const umb_facet *f, umb_vec3 n, span s)
{
    const umb_viewer *v = &m->b->viewer;
    double bound;
    if (!v->cut || near_span(m, f, &bound).low > bound) {
        return;
    }
    umb_vec3 forward = umb_vec3_from_double(v->forward);
    uint32_t k = m->near_count++;
    double rate = v->parallel ? -umb_vec3_dot(n, forward) : -s.high;
    umb_vec3 a = umb_vec3_scale(forward, rate), c = umb_vec3_scale(n, v->parallel ? 1.0 : v->near_depth);
    m->near_n[k] = umb_vec3_add(a, c);
    m->near_at[k] = v->parallel ? s.high + v->near_depth * rate : 0.0;
    m->near_size[k] = umb_vec3_sum_abs(a) + umb_vec3_sum_abs(c) + 2.0 * s.reach;
}

/* True if a facet may hide: the viewer sees it from the side asked for, its corners lie on the far side of n, and
 * some of it beyond near. */
static bool is_usable(const maker *m, const umb_facet *f, float n[3], span *s)
{
    double bound;
    if (!facet_normal(m, f, n)) {
        return false;
    }
    umb_vec3 normal = umb_vec3_from_float(n);
    *s = span_of(m, f, normal);
    return s->reach < 1e30 && looks_along(m->b, normal, *s) &&
           (!m->b->viewer.cut || near_span(m, f, &bound).high > bound);
}

static bool add_plane(maker *m, const umb_facet *f)
{
    umb_blockers *b = m->b;
    float n[3];
    span s;
    if (m->blocker.plane_count == UMB_BLOCKER_PLANES || !is_usable(m, f, n, &s)) {
        return false;
    }
    add_near(m, f, umb_vec3_from_float(n), s);
    umb_blocker_plane *p = &b->planes[b->plane_count++];
    memcpy(p->n, n, sizeof n);
    p->low = s.low - 0x1p-48 * s.reach;
    p->error = 0x1p-48;
    m->blocker.plane_count += 1;
    return true;
}

/* Planes' half-spaces come after all edges'. */
static bool add_plane_spaces(maker *m)
{
    umb_blockers *b = m->b;
    for (uint32_t i = 0; i < m->blocker.plane_count; ++i) {
        const umb_blocker_plane *p = &b->planes[m->blocker.first_plane + i];
        umb_vec3 away = umb_vec3_scale(umb_vec3_from_float(p->n), -1.0);
        if (!add_space(b, away, -p->low, p->error, 0x1p-48 * fabs(p->low))) {
            return false;
        }
    }
    for (uint32_t i = 0; i < m->near_count; ++i) {
        double size = m->near_size[i];
        if (!add_space(b, m->near_n[i], m->near_at[i], DOUBLE_SLACK * size,
                       DOUBLE_SLACK * (fabs(m->near_at[i]) + size * (1.0 + fabs(b->viewer.near_depth))))) {
            return false;
        }
    }
    m->blocker.near_count = (uint8_t)m->near_count;
    return true;
}

static bool add_facet(maker *m)
{
    const umb_facet *f = &m->def->facets->facets[m->def->facet];
    int faces = facet_faces(m, f);
    m->blocker.flipped = faces < 0;
    if (faces == 0 || (faces < 0 && !f->two_sided)) {
        return false;
    }
    for (uint32_t i = 0; i < f->count; ++i) {
        if (!add_edge(m, f, i)) {
            return false;
        }
    }
    return add_plane(m, f);
}

/* The facets of a body that are seen, without the edges between two of them. */
static bool add_body(maker *m)
{
    const umb_facets *facets = m->def->facets;
    uint64_t seen[2] = {0, 0};
    float n[3];
    span s;
    for (uint32_t i = 0; i < facets->facet_count; ++i) {
        const umb_facet *f = &facets->facets[i];
        if (facet_faces(m, f) > 0 && is_usable(m, f, n, &s)) {
            seen[i / 64] |= 1ull << (i % 64);
        }
    }
    for (uint32_t i = 0; i < facets->facet_count; ++i) {
        const umb_facet *f = &facets->facets[i];
        if ((seen[i / 64] >> (i % 64) & 1) == 0) {
            continue;
        }
        for (uint32_t k = 0; k < f->count; ++k) {
            uint32_t other = facets->beyond[f->first + k];
            bool inside = other != UMB_NONE && (seen[other / 64] >> (other % 64) & 1) != 0;
            if (!inside && !add_edge(m, f, k)) {
                return false;
            }
        }
        if (!add_plane(m, f)) {
            return false;
        }
    }
    return m->blocker.plane_count > 0;
}

bool umb_blockers_add(umb_blockers *b, const umb_blocker_def *def)
{
    umb_blockers before = *b;
    maker m = {.b = b, .def = def};
    m.blocker = (umb_blocker){.occluder = def->occluder,
                              .facet = def->facet,
                              .set = def->set,
                              .first_space = b->space_count,
                              .first_edge = b->edge_count,
                              .first_plane = b->plane_count};
    bool body = def->facet == UMB_NONE;
    bool ok = body ? def->facets->facet_count <= 128 && add_body(&m) : add_facet(&m);
    if (!ok || !add_plane_spaces(&m)) {
        b->space_count = before.space_count;
        b->edge_count = before.edge_count;
        b->plane_count = before.plane_count;
        return false;
    }
    b->list[b->count++] = m.blocker;
    return true;
}

static uint32_t place_of(uint32_t set, uint32_t facet, uint32_t size)
{
    uint64_t h = ((uint64_t)set << 32 | facet) * 0x9E3779B97F4A7C15u;
    return (uint32_t)(h >> 40) & (size - 1);
}

static uint32_t find(const umb_blockers *b, uint32_t size, uint32_t set, uint32_t facet)
{
    for (uint32_t at = place_of(set, facet, size);; at = (at + 1) & (size - 1)) {
        uint32_t i = b->table[at];
        if (i == UMB_NONE || (b->list[i].set == set && b->list[i].facet == facet)) {
            return i;
        }
    }
}

void umb_blockers_join(umb_blockers *b)
{
    uint32_t size = table_size(b->count);
    memset(b->table, 0xFF, size * sizeof *b->table);
    for (uint32_t i = 0; i < b->count; ++i) {
        uint32_t at = place_of(b->list[i].set, b->list[i].facet, size);
        while (b->table[at] != UMB_NONE) {
            at = (at + 1) & (size - 1);
        }
        b->table[at] = i;
    }
    for (uint32_t i = 0; i < b->count; ++i) {
        umb_blocker *k = &b->list[i];
        for (uint32_t e = 0; e < k->edge_count && k->facet != UMB_NONE; ++e) {
            umb_blocker_edge *edge = &b->edges[k->first_edge + e];
            uint32_t other = edge->facet != UMB_NONE ? find(b, size, k->set, edge->facet) : UMB_NONE;
            if (other != UMB_NONE && b->list[other].flipped == k->flipped) {
                edge->beyond = other;
                k->joined = true;
            }
        }
    }
}

static umb_vec3 corner_of(const umb_aabb *box, uint32_t k)
{
    return umb_vec3_make(k & 1 ? box->max[0] : box->min[0], k & 2 ? box->max[1] : box->min[1],
                         k & 4 ? box->max[2] : box->min[2]);
}

int umb_blockers_edge_side(const umb_blockers *b, const umb_blocker_edge *edge, const umb_aabb *box)
{
    int all = 2;
    for (uint32_t i = 0; i < b->viewer.point_count; ++i) {
        umb_sight s = umb_sight_past(&b->viewer, i, edge->a, edge->b);
        for (uint32_t k = 0; k < 8; ++k) {
            int side = umb_sight_side(&s, corner_of(box, k));
            if (side == 0 || (all != 2 && all != side)) {
                return 0;
            }
            all = side;
        }
    }
    return all;
}

bool umb_blockers_behind(const umb_blockers *b, const umb_blocker_plane *plane, const umb_aabb *box)
{
    umb_vec3 n = umb_vec3_from_float(plane->n), origin = umb_vec3_from_double(b->origin);
    for (uint32_t k = 0; k < 8; ++k) {
        umb_vec3 d = umb_vec3_sub(corner_of(box, k), origin);
        if (!(umb_vec3_dot(n, d) + plane->error * umb_vec3_sum_abs(d) < plane->low)) {
            return false;
        }
    }
    return true;
}

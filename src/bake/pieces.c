#include "pieces.h"

#include <math.h>
#include <string.h>

#include "closed_solid.h"
#include "geometry/orient.h"
#include "geometry/transform.h"
#include "geometry/vec.h"

#define MOST_POINTS 60
#define MOST_RING 40

enum { USABLE = 1, TAKEN = 2, INSIDE = 4 };

void umb_pieces_free(umb_pieces *p)
{
    if (p->allocator != NULL) {
        umb_memory_free(p->allocator, p->neighbours, p->neighbour_capacity * sizeof *p->neighbours);
        umb_memory_free(p->allocator, p->states, p->state_capacity * sizeof *p->states);
    }
    p->neighbours = NULL;
    p->states = NULL;
    p->neighbour_capacity = p->state_capacity = 0;
}

static void world_vertex(const umb_occluder *o, uint32_t v, float out[3])
{
    umb_transform_vertex(&o->transform, o->identity, o->mesh->positions[v], out);
}

static void point_of(const umb_occluder *o, uint32_t v, double out[3])
{
    float p[3];
    world_vertex(o, v, p);
    for (int k = 0; k < 3; ++k) {
        out[k] = p[k];
    }
}

/* ---- sides ------------------------------------------------------------------------------------ */

enum { FRONT = 1, BACK = 2 };

/* On which sides of a triangle's plane the cell's corners lie; both where rounding cannot tell. The bound is that of
 * solid.c: of the cell's middle, and as much again for how far corners are from it. */
static int cell_sides(const umb_pieces *s, const umb_occluder *o, uint32_t triangle)
{
    const uint32_t *t = o->mesh->triangles[triangle];
    double p[3][3], x = 0.0, away = 0.0;
    for (int c = 0; c < 3; ++c) {
        point_of(o, t[c], p[c]);
    }
    umb_vec3 a = umb_vec3_from_double(p[0]);
    umb_vec3 u = umb_vec3_sub(umb_vec3_from_double(p[o->mirrored ? 2 : 1]), a);
    umb_vec3 v = umb_vec3_sub(umb_vec3_from_double(p[o->mirrored ? 1 : 2]), a);
    umb_vec3 cross = umb_vec3_cross(u, v);
    double n[3] = {cross.x, cross.y, cross.z}, error = 0x1p-44 * umb_vec3_sum_abs(u) * umb_vec3_sum_abs(v) * s->reach;
    for (int k = 0; k < 3; ++k) {
        x += n[k] * (0.5 * (s->corners[0][k] + s->corners[7][k]) - p[0][k]);
        away += fabs(n[k]) * 0.5 * (s->corners[7][k] - s->corners[0][k]);
    }
    return x - away > error ? FRONT : x + away < -error ? BACK : FRONT | BACK;
}

/* ---- convex bodies -------------------------------------------------------------------------------- */

/* True if the world positions, rounded as they are, still are convex. */
static bool exactly_convex(const umb_occluder *o, const float (*p)[3])
{
    const umb_mesh *m = o->mesh;
    if (o->identity) {
        return true;
    }
    for (uint32_t t = 0; t < m->triangle_count; ++t) {
        const uint32_t *c = m->triangles[t];
        for (uint32_t i = 0; i < m->block_position_count; ++i) {
            if (i == c[0] || i == c[1] || i == c[2]) {
                continue;
            }
            if (umb_orient(p[c[0]], p[c[o->mirrored ? 2 : 1]], p[c[o->mirrored ? 1 : 2]], p[i]) > 0) {
                return false;
            }
        }
    }
    return true;
}

/* The point lies behind all planes, by more than rounding can do. What lies behind all planes of a closed mesh has a
 * positive winding number: every triangle adds to it. */
static bool behind_all(const umb_pieces *s, const umb_occluder *o, const float (*p)[3], const double x[3])
{
    const umb_mesh *m = o->mesh;
    for (uint32_t t = 0; t < m->triangle_count; ++t) {
        const uint32_t *c = m->triangles[t];
        umb_vec3 a = umb_vec3_from_float(p[c[0]]);
        umb_vec3 u = umb_vec3_sub(umb_vec3_from_float(p[c[o->mirrored ? 2 : 1]]), a);
        umb_vec3 v = umb_vec3_sub(umb_vec3_from_float(p[c[o->mirrored ? 1 : 2]]), a);
        double error = 0x1p-45 * umb_vec3_sum_abs(u) * umb_vec3_sum_abs(v) * s->reach;
        if (!(umb_vec3_dot(umb_vec3_cross(u, v), umb_vec3_sub(umb_vec3_from_double(x), a)) < -error)) {
            return false;
        }
    }
    return true;
}

/* Draw the vertices towards the middle until all lie in the body. */
static bool shrink(const umb_pieces *s, const umb_occluder *o, const float (*p)[3], umb_piece *piece)
{
    double middle[3] = {0.0, 0.0, 0.0};
    uint32_t n = piece->count;
    for (uint32_t i = 0; i < n; ++i) {
        for (int k = 0; k < 3; ++k) {
            middle[k] += p[i][k] / (double)n;
        }
    }
    for (double part = 0x1p-24; part < 0x1p-8; part *= 4.0) {
        uint32_t good = 0;
        for (uint32_t i = 0; i < n; ++i) {
            for (int k = 0; k < 3; ++k) {
                piece->points[i][k] = p[i][k] + part * (middle[k] - p[i][k]);
            }
            good += behind_all(s, o, p, piece->points[i]) ? 1 : 0;
        }
        if (good == n) {
            return true;
        }
    }
    return false;
}

static bool separated_by_box(const umb_pieces *s, const umb_occluder *o)
{
    for (int k = 0; k < 3; ++k) {
        if (s->corners[0][k] > o->bounds.max[k] || s->corners[7][k] < o->bounds.min[k]) {
            return true;
        }
    }
    return false;
}

/* The cell lies in front of a face, and no vertex does. */
static bool separated_by_face(const umb_pieces *s, const umb_occluder *o, const float (*p)[3])
{
    const umb_mesh *m = o->mesh;
    for (uint32_t t = 0; t < m->triangle_count; ++t) {
        if (cell_sides(s, o, t) != FRONT) {
            continue;
        }
        const uint32_t *c = m->triangles[t];
        bool apart = true;
        for (uint32_t i = 0; i < m->block_position_count && apart; ++i) {
            apart = umb_orient(p[c[0]], p[c[o->mirrored ? 2 : 1]], p[c[o->mirrored ? 1 : 2]], p[i]) <= 0;
        }
        if (apart) {
            return true;
        }
    }
    return false;
}

static bool make_convex(const umb_pieces *s, const umb_occluder *o, const float (*p)[3], umb_piece *piece)
{
    const umb_mesh *m = o->mesh;
    if (!m->convex || m->block_position_count > MOST_POINTS || m->edge_count > UMB_UMBRA_EDGES ||
        !(separated_by_box(s, o) || separated_by_face(s, o, p))) {
        return false;
    }
    piece->convex = true;
    piece->count = m->block_position_count;
    piece->ring = 0;
    piece->edge_count = m->edge_count;
    for (uint32_t i = 0; i < m->edge_count; ++i) {
        piece->edges[i][0] = (uint8_t)m->edges[i].v0;
        piece->edges[i][1] = (uint8_t)m->edges[i].v1;
    }
    if (!exactly_convex(o, p)) {
        return shrink(s, o, p, piece);
    }
    for (uint32_t i = 0; i < piece->count; ++i) {
        for (int k = 0; k < 3; ++k) {
            piece->points[i][k] = p[i][k];
        }
    }
    return true;
}

/* ---- disks ------------------------------------------------------------------------------------ */

/* A disk that grows by triangles: its ring is a closed way without repeated vertices. */
typedef struct disk {
    uint32_t ring[MOST_RING + 1], ring_count;
    uint32_t inner[UMB_UMBRA_VERTICES], inner_count;
    uint32_t triangles[UMB_PIECE_TRIANGLES], triangle_count;
} disk;

static void find_neighbours(const umb_mesh *m, uint32_t (*out)[3])
{
    memset(out, 0xFF, m->triangle_count * sizeof *out);
    for (uint32_t i = 0; i < m->edge_count; ++i) {
        const umb_edge *e = &m->edges[i];
        if (e->f1 == UMB_NONE || (e->f1 & UMB_EDGE_SAME) != 0) {
            continue;
        }
        for (int c = 0; c < 3; ++c) {
            if (m->triangles[e->f0][c] == e->v0 && m->triangles[e->f0][(c + 1) % 3] == e->v1) {
                out[e->f0][c] = e->f1;
            }
            if (m->triangles[e->f1][c] == e->v1 && m->triangles[e->f1][(c + 1) % 3] == e->v0) {
                out[e->f1][c] = e->f0;
            }
        }
    }
}

static uint32_t find_in_ring(const disk *d, uint32_t v)
{
    for (uint32_t i = 0; i < d->ring_count; ++i) {
        if (d->ring[i] == v) {
            return i;
        }
    }
    return UMB_NONE;
}

static bool is_inner(const disk *d, uint32_t v)
{
    for (uint32_t i = 0; i < d->inner_count; ++i) {
        if (d->inner[i] == v) {
            return true;
        }
    }
    return false;
}

static bool has_triangle(const disk *d, uint32_t t)
{
    for (uint32_t i = 0; i < d->triangle_count; ++i) {
        if (d->triangles[i] == t) {
            return true;
        }
    }
    return false;
}

/* Add a triangle if what results is a disk: it shares one edge of the ring and its other corner is new, or two edges that
 * follow one another. */
static bool add_triangle(disk *d, const umb_mesh *m, uint32_t t)
{
    const uint32_t *c = m->triangles[t];
    if (d->triangle_count == UMB_PIECE_TRIANGLES || d->ring_count + d->inner_count >= MOST_POINTS) {
        return false;
    }
    if (d->triangle_count == 0) {
        memcpy(d->ring, c, 3 * sizeof *c);
        d->ring_count = 3;
        d->triangles[d->triangle_count++] = t;
        return true;
    }
    uint32_t shared = 0, at = 0;
    for (uint32_t k = 0; k < 3; ++k) {
        uint32_t i = find_in_ring(d, c[(k + 1) % 3]);
        if (i != UMB_NONE && d->ring[(i + 1) % d->ring_count] == c[k]) {
            shared |= 1u << k; /* the ring runs against the triangle's edge k: c[k+1] to c[k] */
            at = shared == 1u << k ? i : at;
        }
    }
    uint32_t n = d->ring_count;
    if (shared == 1 || shared == 2 || shared == 4) {
        uint32_t k = shared == 1 ? 0 : shared == 2 ? 1 : 2, apex = c[(k + 2) % 3];
        if (n == MOST_RING || find_in_ring(d, apex) != UMB_NONE || is_inner(d, apex)) {
            return false;
        }
        memmove(&d->ring[at + 2], &d->ring[at + 1], (n - at - 1) * sizeof *d->ring);
        d->ring[at + 1] = apex;
        d->ring_count = n + 1;
    } else if ((shared == 3 || shared == 5 || shared == 6) && n > 3) {
        uint32_t between = shared == 3 ? c[1] : shared == 5 ? c[0] : c[2], i = find_in_ring(d, between);
        memmove(&d->ring[i], &d->ring[i + 1], (n - i - 1) * sizeof *d->ring);
        d->ring_count = n - 1;
        d->inner[d->inner_count++] = between;
    } else {
        return false;
    }
    d->triangles[d->triangle_count++] = t;
    return true;
}

/* From a seed outwards over triangles that no piece has yet. */
static void grow(umb_pieces *s, const umb_mesh *m, uint32_t seed, disk *d)
{
    d->ring_count = d->inner_count = d->triangle_count = 0;
    (void)add_triangle(d, m, seed);
    s->states[seed] |= TAKEN;
    for (uint32_t pass = 0; pass < 2; ++pass) {
        for (uint32_t i = 0; i < d->triangle_count; ++i) {
            for (int k = 0; k < 3; ++k) {
                uint32_t t = s->neighbours[d->triangles[i]][k];
                if (t != UMB_NONE && s->states[t] == USABLE && add_triangle(d, m, t)) {
                    s->states[t] |= TAKEN;
                }
            }
        }
    }
}

/* One more ring of neighbours, whosever they are, so that the border to the next piece is no crack. */
static void overlap(umb_pieces *s, const umb_mesh *m, disk *d)
{
    uint32_t own = d->triangle_count;
    for (uint32_t i = 0; i < own; ++i) {
        for (int k = 0; k < 3; ++k) {
            uint32_t t = s->neighbours[d->triangles[i]][k];
            if (t != UMB_NONE && (s->states[t] & USABLE) != 0 && !has_triangle(d, t)) {
                (void)add_triangle(d, m, t);
            }
        }
    }
}

static uint32_t local_of(const disk *d, uint32_t v)
{
    uint32_t i = find_in_ring(d, v);
    for (uint32_t k = 0; i == UMB_NONE && k < d->inner_count; ++k) {
        i = d->inner[k] == v ? d->ring_count + k : UMB_NONE;
    }
    return i;
}

static void emit_disk(umb_pieces *s, const umb_occluder *o, const disk *d)
{
    umb_piece *piece = &s->piece;
    piece->convex = false;
    piece->ring = d->ring_count;
    piece->count = d->ring_count + d->inner_count;
    piece->edge_count = 0;
    for (uint32_t i = 0; i < piece->count; ++i) {
        point_of(o, i < d->ring_count ? d->ring[i] : d->inner[i - d->ring_count], piece->points[i]);
    }
    for (uint32_t i = 0; i < d->triangle_count; ++i) {
        for (int k = 0; k < 3; ++k) {
            uint32_t a = local_of(d, o->mesh->triangles[d->triangles[i]][k]);
            uint32_t b = local_of(d, o->mesh->triangles[d->triangles[i]][(k + 1) % 3]);
            bool border = a < piece->ring && b < piece->ring && (a + 1) % piece->ring == b;
            if (a < b && !border) {
                piece->edges[piece->edge_count][0] = (uint8_t)a;
                piece->edges[piece->edge_count++][1] = (uint8_t)b;
            }
        }
    }
    s->emit(s->user, piece);
}

static umb_result cut_disks(umb_pieces *s, const umb_occluder *o, bool solid)
{
    const umb_mesh *m = o->mesh;
    if (!umb_memory_reserve(s->allocator, (void **)&s->neighbours, &s->neighbour_capacity, m->triangle_count,
                            sizeof *s->neighbours) ||
        !umb_memory_reserve(s->allocator, (void **)&s->states, &s->state_capacity, m->triangle_count,
                            sizeof *s->states)) {
        return UMB_ERROR_MEMORY;
    }
    find_neighbours(m, s->neighbours);
    for (uint32_t t = 0; t < m->triangle_count; ++t) {
        int sides = cell_sides(s, o, t);
        bool usable = solid ? sides != BACK : sides == FRONT || (m->two_sided[t] != 0 && sides == BACK);
        s->states[t] = usable ? USABLE : 0;
    }
    for (uint32_t t = 0; t < m->triangle_count; ++t) {
        if (s->states[t] == USABLE) {
            disk d;
            grow(s, m, t, &d);
            overlap(s, m, &d);
            emit_disk(s, o, &d);
        }
    }
    return UMB_OK;
}

umb_result umb_pieces_cut(umb_pieces *s, const umb_occluder *o, uint32_t number)
{
    const umb_mesh *m = o->mesh;
    bool solid = false;
    if (m->block_position_count <= UMB_CLOSED_SOLID_MOST) {
        float p[UMB_CLOSED_SOLID_MOST][3];
        for (uint32_t i = 0; i < m->block_position_count; ++i) {
            world_vertex(o, i, p[i]);
        }
        if (make_convex(s, o, (const float(*)[3])p, &s->piece)) {
            s->emit(s->user, &s->piece);
            return UMB_OK;
        }
        if (s->known[number] == 0) {
            s->known[number] = umb_closed_solid(o, (const float(*)[3])p) ? UMB_SOLID_YES : UMB_SOLID_NO;
        }
        solid = s->known[number] == UMB_SOLID_YES && separated_by_box(s, o);
    }
    return cut_disks(s, o, solid);
}

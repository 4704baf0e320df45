#include "closed_solid.h"

#include <math.h>

#include "geometry/orient.h"
#include "geometry/vec.h"

/* Every edge has two triangles that run against one another, and no more: entries of one edge are neighbours. */
static bool all_edges_paired(const umb_mesh *m)
{
    for (uint32_t i = 0; i < m->edge_count; ++i) {
        const umb_edge *e = &m->edges[i], *next = &m->edges[i + 1 < m->edge_count ? i + 1 : i];
        bool again = next != e && ((e->v0 == next->v0 && e->v1 == next->v1) || (e->v0 == next->v1 && e->v1 == next->v0));
        if (again || m->edges[i].f1 == UMB_NONE || (m->edges[i].f1 & UMB_EDGE_SAME) != 0) {
            return false;
        }
    }
    return m->any_two_sided == 0;
}

/* Every corner of t lies on one closed side of the plane of s. */
static bool beside(const float (*p)[3], const uint32_t s[3], const uint32_t t[3])
{
    bool front = false, back = false;
    for (int k = 0; k < 3; ++k) {
        if (t[k] == s[0] || t[k] == s[1] || t[k] == s[2]) {
            continue;
        }
        int side = umb_orient(p[s[0]], p[s[1]], p[s[2]], p[t[k]]);
        front = front || side > 0;
        back = back || side < 0;
    }
    return !(front && back);
}

static bool has_corner(const uint32_t s[3], uint32_t v)
{
    return v == s[0] || v == s[1] || v == s[2];
}

/* The segment from a to b surely meets triangle s nowhere but in corners of its own that they are. */
static bool edge_misses(const float (*p)[3], const uint32_t s[3], uint32_t a, uint32_t b)
{
    bool own_a = has_corner(s, a), own_b = has_corner(s, b), left = false, right = false;
    int side_a = own_a ? 0 : umb_orient(p[s[0]], p[s[1]], p[s[2]], p[a]);
    int side_b = own_b ? 0 : umb_orient(p[s[0]], p[s[1]], p[s[2]], p[b]);
    if (side_a == 0 && side_b == 0) {
        return own_a && own_b;
    }
    if (side_a * side_b > 0 || own_a || own_b) {
        return true;
    }
    for (int k = 0; k < 3; ++k) {
        int turn = umb_orient(p[a], p[b], p[s[k]], p[s[(k + 1) % 3]]);
        left = left || turn > 0;
        right = right || turn < 0;
    }
    return left && right;
}

/* If triangles cross, an edge of one meets the other. */
static bool edges_miss(const float (*p)[3], const uint32_t s[3], const uint32_t t[3])
{
    for (int k = 0; k < 3; ++k) {
        if (!edge_misses(p, s, t[k], t[(k + 1) % 3])) {
            return false;
        }
    }
    return true;
}

typedef struct box {
    float min[3], max[3];
} box;

static box box_of(const float (*p)[3], const uint32_t t[3])
{
    box b;
    for (int k = 0; k < 3; ++k) {
        float x = p[t[0]][k], y = p[t[1]][k], z = p[t[2]][k], low = x < y ? x : y, high = x < y ? y : x;
        b.min[k] = low < z ? low : z;
        b.max[k] = high > z ? high : z;
    }
    return b;
}

static bool boxes_apart(const box *a, const box *b)
{
    return a->max[0] < b->min[0] || b->max[0] < a->min[0] || a->max[1] < b->min[1] || b->max[1] < a->min[1] ||
           a->max[2] < b->min[2] || b->max[2] < a->min[2];
}

static bool none_cross(const umb_mesh *m, const float (*p)[3])
{
    box boxes[UMB_CLOSED_SOLID_MOST];
    for (uint32_t i = 0; i < m->triangle_count; ++i) {
        boxes[i] = box_of(p, m->triangles[i]);
        for (uint32_t k = 0; k < i; ++k) {
            const uint32_t *s = m->triangles[i], *t = m->triangles[k];
            if (!boxes_apart(&boxes[i], &boxes[k]) && !beside(p, s, t) && !beside(p, t, s) &&
                !(edges_miss(p, s, t) && edges_miss(p, t, s))) {
                return false;
            }
        }
    }
    return true;
}

static uint32_t root_of(uint16_t *parent, uint32_t i)
{
    while (parent[i] != i) {
        i = parent[i];
    }
    return i;
}

/* Six times the volume under a triangle, and a bound of all the roundings of it: terms are products of three
 * coordinates that are at most size. */
static double volume_under(const float (*p)[3], const uint32_t t[3])
{
    umb_vec3 a = umb_vec3_sub(umb_vec3_from_float(p[t[0]]), umb_vec3_from_float(p[0]));
    umb_vec3 b = umb_vec3_sub(umb_vec3_from_float(p[t[1]]), umb_vec3_from_float(p[0]));
    umb_vec3 c = umb_vec3_sub(umb_vec3_from_float(p[t[2]]), umb_vec3_from_float(p[0]));
    return umb_vec3_dot(a, umb_vec3_cross(b, c));
}

static bool volumes_positive(const umb_occluder *o, const float (*p)[3])
{
    const umb_mesh *m = o->mesh;
    uint16_t parent[UMB_CLOSED_SOLID_MOST];
    double volume[UMB_CLOSED_SOLID_MOST] = {0.0}, size = 0.0;
    for (uint32_t i = 0; i < m->triangle_count; ++i) {
        parent[i] = (uint16_t)i;
    }
    for (uint32_t i = 0; i < m->edge_count; ++i) {
        parent[root_of(parent, m->edges[i].f0)] = (uint16_t)root_of(parent, m->edges[i].f1);
    }
    for (int k = 0; k < 3; ++k) {
        size = fmax(size, (double)o->bounds.max[k] - o->bounds.min[k]);
    }
    for (uint32_t i = 0; i < m->triangle_count; ++i) {
        volume[root_of(parent, i)] += (o->mirrored ? -1.0 : 1.0) * volume_under(p, m->triangles[i]);
    }
    double lost = 0x1p-40 * size * size * size;
    for (uint32_t i = 0; i < m->triangle_count; ++i) {
        if (!(volume[root_of(parent, i)] > lost)) {
            return false;
        }
    }
    return true;
}

bool umb_closed_solid(const umb_occluder *o, const float (*positions)[3])
{
    const umb_mesh *m = o->mesh;
    return m->triangle_count >= 4 && m->triangle_count <= UMB_CLOSED_SOLID_MOST && all_edges_paired(m) &&
           volumes_positive(o, positions) && none_cross(m, positions);
}

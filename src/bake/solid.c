#include "solid.h"

#include <string.h>

#include "geometry/orient.h"
#include "geometry/transform.h"
#include "solid_inner.h"

void umb_solids_free(umb_solids *s)
{
    if (s->allocator != NULL) {
        umb_memory_free(s->allocator, s->items, s->capacity * sizeof *s->items);
        umb_memory_free(s->allocator, s->planes, s->plane_capacity * sizeof *s->planes);
        umb_memory_free(s->allocator, s->runs, s->run_capacity * sizeof *s->runs);
    }
    memset(s, 0, sizeof *s);
}

bool umb_solids_begin(umb_solids *s, uint32_t occluder_count, double reach)
{
    if (!umb_memory_reserve(s->allocator, (void **)&s->runs, &s->run_capacity, (size_t)occluder_count + 1, sizeof *s->runs)) {
        return false;
    }
    memset(s->runs, 0xFF, s->run_capacity * sizeof *s->runs);
    s->count = s->plane_count = 0;
    s->reach = reach;
    return true;
}

umb_result umb_solids_find(umb_solids *s, const umb_occluder *o, uint32_t number)
{
    uint32_t first = (uint32_t)s->count;
    bool added;
    if (s->runs[number].first != UMB_NONE) {
        return UMB_OK;
    }
    umb_result result = umb_solids_add(s, o, number, &added);
    if (result == UMB_OK && !added) {
        result = umb_solids_add_inner(s, o, number);
    }
    if (result == UMB_OK) {
        s->runs[number] = (struct umb_solid_run){first, (uint32_t)s->count - first};
    } else {
        s->count = first;
    }
    return result;
}

void umb_box_corners(const double min[3], const double max[3], double out[8][3])
{
    for (int c = 0; c < 8; ++c) {
        for (int k = 0; k < 3; ++k) {
            out[c][k] = (c >> k & 1) != 0 ? max[k] : min[k];
        }
    }
}

void umb_solid_vertices(const umb_occluder *o, double out[][3])
{
    for (uint32_t i = 0; i < o->mesh->block_position_count; ++i) {
        float p[3];
        umb_transform_vertex(&o->transform, o->identity, o->mesh->positions[i], p);
        for (int k = 0; k < 3; ++k) {
            out[i][k] = p[k];
        }
    }
}

#define PLANES 32 /* of a body whose values are kept at hand */

static double value(const double plane[4], const double p[3])
{
    return plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] + plane[3];
}

/* The plane of a triangle, normal outwards, moved inwards. With |u| and |v| the sums of absolute components of
 * two sides and R the reach: each component of u x v is off by at most 2^-51 |u| |v|, a value of the plane at a point by
 * three of these times 2 R, and by 5 roundings of terms that are at most |u| |v| R: together less than
 * 2^-47 |u| |v| R. Four times that is taken. *error is it. */
static void make_plane(const double p[][3], const uint32_t t[3], bool mirrored, double reach,
                       double plane[4], double *error)
{
    umb_vec3 a = umb_vec3_from_double(p[t[0]]);
    umb_vec3 b = umb_vec3_from_double(p[t[mirrored ? 2 : 1]]);
    umb_vec3 c = umb_vec3_from_double(p[t[mirrored ? 1 : 2]]);
    umb_vec3 u = umb_vec3_sub(b, a), v = umb_vec3_sub(c, a);
    umb_vec3 n = umb_vec3_cross(u, v);
    *error = 0x1p-45 * umb_vec3_sum_abs(u) * umb_vec3_sum_abs(v) * reach;
    plane[0] = n.x;
    plane[1] = n.y;
    plane[2] = n.z;
    plane[3] = -umb_vec3_dot(n, a) + *error;
}

/* What is larger than the value of any vertex, whatever rounding does. */
static double beyond_all(const double plane[4], double error, const double p[][3], uint32_t count)
{
    double most = value(plane, p[0]);
    for (uint32_t i = 1; i < count; ++i) {
        double x = value(plane, p[i]);
        most = x > most ? x : most;
    }
    return most + 2.0 * error;
}

static bool boxes_apart(const umb_aabb *a, const double box[8][3])
{
    for (int k = 0; k < 3; ++k) {
        if (box[0][k] > a->max[k] || box[7][k] < a->min[k]) {
            return true;
        }
    }
    return false;
}

static bool all_beyond(const umb_solid_plane *p, const double box[8][3])
{
    for (int i = 0; i < 8; ++i) {
        if (!(value(p->plane, box[i]) > p->beyond)) {
            return false;
        }
    }
    return true;
}

bool umb_solids_apart(const umb_solids *s, const umb_occluder *o, uint32_t number, const double box[8][3])
{
    struct umb_solid_run run = s->runs[number];
    bool apart = boxes_apart(&o->bounds, box);
    for (uint32_t i = run.first; i < run.first + run.count && !apart; ++i) {
        const umb_solid *body = &s->items[i];
        for (uint32_t k = 0; k < body->plane_count && !apart; ++k) {
            apart = all_beyond(&s->planes[body->first_plane + k], box);
        }
    }
    return apart;
}

/* A triangle in exactly the plane of one before it adds nothing. */
static bool plane_before(const umb_mesh *m, const double p[][3], uint32_t triangle)
{
    float v[3][3], w[3];
    for (uint32_t t = 0; t < triangle; ++t) {
        bool same = true;
        for (int c = 0; c < 3; ++c) {
            for (int k = 0; k < 3; ++k) {
                v[c][k] = (float)p[m->triangles[t][c]][k];
            }
        }
        for (int c = 0; c < 3 && same; ++c) {
            for (int k = 0; k < 3; ++k) {
                w[k] = (float)p[m->triangles[triangle][c]][k];
            }
            same = umb_orient(v[0], v[1], v[2], w) == 0;
        }
        if (same) {
            return true;
        }
    }
    return false;
}

umb_result umb_solids_add(umb_solids *s, const umb_occluder *o, uint32_t number, bool *added)
{
    const umb_mesh *m = o->mesh;
    *added = false;
    if (!m->convex || m->block_position_count > UMB_SOLID_VERTICES) {
        return UMB_OK;
    }
    size_t first = s->plane_count;
    if (!umb_memory_reserve(s->allocator, (void **)&s->items, &s->capacity, s->count + 1, sizeof *s->items) ||
        !umb_memory_reserve(s->allocator, (void **)&s->planes, &s->plane_capacity, first + m->triangle_count,
                            sizeof *s->planes)) {
        return UMB_ERROR_MEMORY;
    }
    double p[UMB_SOLID_VERTICES][3], inner[3] = {0.0, 0.0, 0.0};
    umb_solid_vertices(o, p);
    for (uint32_t i = 0; i < m->block_position_count; ++i) {
        for (int k = 0; k < 3; ++k) {
            inner[k] += p[i][k] / m->block_position_count;
        }
    }
    bool solid = true;
    uint32_t planes = 0;
    for (uint32_t t = 0; t < m->triangle_count; ++t) {
        if (plane_before(m, (const double(*)[3])p, t)) {
            continue;
        }
        umb_solid_plane *plane = &s->planes[first + planes++];
        double error;
        make_plane((const double(*)[3])p, m->triangles[t], o->mirrored, s->reach, plane->plane, &error);
        solid = solid && value(plane->plane, inner) < 0.0;
        plane->beyond = beyond_all(plane->plane, error, (const double(*)[3])p, m->block_position_count);
    }
    if (!solid) {
        return UMB_OK;
    }
    umb_solid *body = &s->items[s->count++];
    *body = (umb_solid){o->bounds, number, (uint32_t)first, planes, {inner[0], inner[1], inner[2]}};
    s->plane_count = first + planes;
    *added = true;
    return UMB_OK;
}

/* Eight segments from one point: where they are inside all planes so far. */
typedef struct stretch {
    double from[8], to[8];
} stretch;

/* Cut eight segments by a plane. Ends are quotients of numbers of opposite signs, right to 2^-51. */
static void cut(stretch *s, double va, const double vb[8])
{
    for (int j = 0; j < 8; ++j) {
        double at = va / (va - vb[j]);
        bool enters = va > 0.0 && vb[j] <= 0.0, leaves = va <= 0.0 && vb[j] > 0.0, never = va > 0.0 && vb[j] > 0.0;
        double from = enters ? at : never ? 2.0 : 0.0, to = leaves ? at : 1.0;
        s->from[j] = from > s->from[j] ? from : s->from[j];
        s->to[j] = to < s->to[j] ? to : s->to[j];
    }
}

/* The same where all of a lies on one side and all of b on the other, as it mostly is. */
static void cut_all(double *bound, bool enters, double va, const double vb[8])
{
    for (int j = 0; j < 8; ++j) {
        double at = va / (va - vb[j]);
        bool better = enters ? at > bound[j] : at < bound[j];
        bound[j] = better ? at : bound[j];
    }
}

uint64_t umb_solid_blocks(const umb_solids *s, const umb_solid *body, const double a[8][3], const double b[8][3])
{
    const umb_solid_plane *planes = s->planes + body->first_plane;
    stretch stretches[8];
    for (int i = 0; i < 8; ++i) {
        for (int j = 0; j < 8; ++j) {
            stretches[i].from[j] = 0.0;
            stretches[i].to[j] = 1.0;
        }
    }
    for (uint32_t k = 0; k < body->plane_count; ++k) {
        double va[8], vb[8];
        uint32_t a_out = 0, b_out = 0;
        for (int i = 0; i < 8; ++i) {
            va[i] = value(planes[k].plane, a[i]);
            vb[i] = value(planes[k].plane, b[i]);
            a_out += va[i] > 0.0 ? 1 : 0;
            b_out += vb[i] > 0.0 ? 1 : 0;
        }
        if (a_out == 8 && b_out == 8) {
            return 0;
        }
        bool enters = a_out == 8 && b_out == 0, leaves = a_out == 0 && b_out == 8;
        for (int i = 0; i < 8 && a_out + b_out > 0; ++i) {
            if (enters || leaves) {
                cut_all(enters ? stretches[i].from : stretches[i].to, enters, va[i], vb);
            } else {
                cut(&stretches[i], va[i], vb);
            }
        }
    }
    uint64_t blocked = 0;
    for (int i = 0; i < 8; ++i) {
        for (int j = 0; j < 8; ++j) {
            bool meets = stretches[i].from[j] + 0x1p-48 <= stretches[i].to[j];
            blocked |= (uint64_t)meets << (8 * i + j);
        }
    }
    return blocked;
}

/* Those from one point; vb: values of the planes at the eight others. */
static bool all_meet(const umb_solid_plane *planes, uint32_t count, const double a[3], const double (*vb)[8])
{
    stretch s;
    for (int j = 0; j < 8; ++j) {
        s.from[j] = 0.0;
        s.to[j] = 1.0;
    }
    for (uint32_t k = 0; k < count; ++k) {
        double va = value(planes[k].plane, a);
        cut(&s, va, vb[k]);
    }
    bool all = true;
    for (int j = 0; j < 8; ++j) {
        all = all && s.from[j] + 0x1p-48 <= s.to[j];
    }
    return all;
}

bool umb_solid_blocks_all(const umb_solids *s, const umb_solid *body, const double (*a)[3], const double (*b)[3])
{
    const umb_solid_plane *planes = s->planes + body->first_plane;
    double vb[PLANES][8];
    uint32_t count = body->plane_count;
    if (count > PLANES) {
        return umb_solid_blocks(s, body, a, b) == UINT64_MAX;
    }
    for (uint32_t k = 0; k < count; ++k) {
        for (int j = 0; j < 8; ++j) {
            vb[k][j] = value(planes[k].plane, b[j]);
        }
    }
    for (int i = 0; i < 8; ++i) {
        if (!all_meet(planes, count, a[i * 3 & 7], (const double(*)[8])vb)) { /* corners far apart first */
            return false;
        }
    }
    return true;
}

bool umb_solid_meets(const umb_solids *s, const umb_solid *body, const double a[3], const double b[3])
{
    const umb_solid_plane *planes = s->planes + body->first_plane;
    double from = 0.0, to = 1.0;
    for (uint32_t k = 0; k < body->plane_count; ++k) {
        double va = value(planes[k].plane, a), vb = value(planes[k].plane, b);
        if (va <= 0.0 && vb <= 0.0) {
            continue;
        }
        if (va > 0.0 && vb > 0.0) {
            return false;
        }
        double at = va / (va - vb);
        from = va > 0.0 && at > from ? at : from;
        to = va <= 0.0 && at < to ? at : to;
        if (from > to) {
            return false;
        }
    }
    return from + 0x1p-48 <= to;
}

#include "solid_inner.h"

#include <math.h>
#include <string.h>

#include "closed_solid.h"
#include "geometry/orient.h"
#include "geometry/transform.h"

#define MOST_PLANES 12

/* A face: triangles side by side in one plane. */
typedef struct face {
    uint16_t triangles[UMB_CLOSED_SOLID_MOST];
    uint32_t count;
    double planes[MOST_PLANES][4]; /* its own, then one through each edge of its border: of length 1, outwards */
    uint32_t plane_count;
} face;

typedef struct inner {
    const umb_occluder *occluder;
    const umb_mesh *mesh;
    float p[UMB_CLOSED_SOLID_MOST][3];
    uint32_t neighbours[UMB_CLOSED_SOLID_MOST][3]; /* across the edge from each corner to the next */
    bool done[UMB_CLOSED_SOLID_MOST];    /* in a face that was looked at */
    bool in_face[UMB_CLOSED_SOLID_MOST]; /* in the present one */
    double size, step; /* of the solid; planes are moved inwards by the step */
} inner;

static double value(const double plane[4], const float p[3])
{
    return plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] + plane[3];
}

static bool set_plane(umb_vec3 n, const float p[3], double plane[4])
{
    double length = umb_vec3_length(n);
    if (!(length > 0.0)) {
        return false;
    }
    plane[0] = n.x / length;
    plane[1] = n.y / length;
    plane[2] = n.z / length;
    plane[3] = -(plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2]);
    return true;
}

static umb_vec3 normal_of(const inner *in, uint32_t triangle)
{
    const uint32_t *t = in->mesh->triangles[triangle];
    bool turn = in->occluder->mirrored;
    umb_vec3 a = umb_vec3_from_float(in->p[t[0]]);
    return umb_vec3_cross(umb_vec3_sub(umb_vec3_from_float(in->p[t[turn ? 2 : 1]]), a),
                          umb_vec3_sub(umb_vec3_from_float(in->p[t[turn ? 1 : 2]]), a));
}

static bool has_corner(const uint32_t t[3], uint32_t v)
{
    return t[0] == v || t[1] == v || t[2] == v;
}

/* Triangle t, beside one that is in the plane of s, is in it too, and not turned over. */
static bool coplanar(const inner *in, uint32_t s, uint32_t t, uint32_t beside)
{
    const uint32_t *a = in->mesh->triangles[s], *b = in->mesh->triangles[t];
    for (int k = 0; k < 3; ++k) {
        if (!has_corner(in->mesh->triangles[beside], b[k]) &&
            umb_orient(in->p[a[0]], in->p[a[1]], in->p[a[2]], in->p[b[k]]) != 0) {
            return false;
        }
    }
    return umb_vec3_dot(normal_of(in, s), normal_of(in, t)) > 0.0;
}

static void add_triangle(inner *in, face *f, uint32_t triangle)
{
    in->in_face[triangle] = true;
    f->triangles[f->count++] = (uint16_t)triangle;
}

static void begin_face(inner *in, face *f, uint32_t seed)
{
    memset(in->in_face, 0, sizeof in->in_face);
    f->count = 0;
    add_triangle(in, f, seed);
}

/* All of a flat part of the surface. */
static void collect(inner *in, uint32_t seed, face *f)
{
    begin_face(in, f, seed);
    for (uint32_t i = 0; i < f->count; ++i) {
        for (uint32_t k = 0; k < 3; ++k) {
            uint32_t other = in->neighbours[f->triangles[i]][k];
            if (!in->in_face[other] && coplanar(in, seed, other, f->triangles[i])) {
                add_triangle(in, f, other);
            }
        }
    }
}

/* The plane through an edge of the border is there already: edges of storeys above one another have one. */
static bool has_plane(const inner *in, const face *f, const float a[3], const float b[3], const double plane[4])
{
    for (uint32_t k = 1; k < f->plane_count; ++k) {
        const double *p = f->planes[k];
        if (p[0] * plane[0] + p[1] * plane[1] + p[2] * plane[2] > 0.999 && fabs(value(p, a)) <= 0.125 * in->step &&
            fabs(value(p, b)) <= 0.125 * in->step) {
            return true;
        }
    }
    return false;
}

static bool all_behind(const inner *in, const face *f, const double plane[4])
{
    for (uint32_t i = 0; i < f->count; ++i) {
        for (int k = 0; k < 3; ++k) {
            if (value(plane, in->p[in->mesh->triangles[f->triangles[i]][k]]) > 0.25 * in->step) {
                return false;
            }
        }
    }
    return true;
}

/* The planes of a face that is convex, as far as a step can tell. */
static bool find_planes(const inner *in, face *f)
{
    const umb_mesh *m = in->mesh;
    umb_vec3 n = normal_of(in, f->triangles[0]);
    f->plane_count = 0;
    if (!set_plane(n, in->p[m->triangles[f->triangles[0]][0]], f->planes[f->plane_count++])) {
        return false;
    }
    for (uint32_t i = 0; i < 3 * f->count; ++i) {
        const uint32_t *t = m->triangles[f->triangles[i / 3]];
        if (in->in_face[in->neighbours[f->triangles[i / 3]][i % 3]]) {
            continue;
        }
        const float *a = in->p[t[i % 3]], *b = in->p[t[(i + 1) % 3]];
        umb_vec3 along = umb_vec3_sub(umb_vec3_from_float(b), umb_vec3_from_float(a));
        umb_vec3 out = umb_vec3_scale(umb_vec3_cross(along, n), in->occluder->mirrored ? -1.0 : 1.0);
        double plane[4];
        if (!set_plane(out, a, plane)) {
            return false;
        }
        if (has_plane(in, f, a, b, plane)) {
            continue;
        }
        if (f->plane_count == MOST_PLANES || !all_behind(in, f, plane)) {
            return false;
        }
        memcpy(f->planes[f->plane_count++], plane, sizeof plane);
    }
    return true;
}

/* Of a flat part that is not convex: what of it is, around the seed. */
static bool grow(inner *in, uint32_t seed, face *f)
{
    begin_face(in, f, seed);
    if (!find_planes(in, f)) {
        return false;
    }
    for (uint32_t i = 0; i < f->count; ++i) {
        for (uint32_t k = 0; k < 3; ++k) {
            uint32_t other = in->neighbours[f->triangles[i]][k];
            if (in->in_face[other] || !coplanar(in, seed, other, f->triangles[i])) {
                continue;
            }
            add_triangle(in, f, other);
            if (!find_planes(in, f)) {
                in->in_face[other] = false;
                f->count -= 1;
            }
        }
    }
    return find_planes(in, f);
}

/* How deep vertices lie behind a face, and what they are beyond: bit k for its plane k. */
typedef struct behind {
    double depth[UMB_CLOSED_SOLID_MOST];
    uint16_t beyond[UMB_CLOSED_SOLID_MOST];
    bool passed[UMB_CLOSED_SOLID_MOST]; /* triangles of sheets that the body goes through */
} behind;

static void look_behind(const inner *in, const face *f, behind *b)
{
    for (uint32_t i = 0; i < in->mesh->block_position_count; ++i) {
        b->depth[i] = -value(f->planes[0], in->p[i]);
        b->beyond[i] = b->depth[i] < 0.5 * in->step;
        for (uint32_t k = 1; k < f->plane_count; ++k) {
            b->beyond[i] |= (uint16_t)((value(f->planes[k], in->p[i]) > -0.5 * in->step) << k);
        }
    }
    memset(b->passed, 0, sizeof b->passed);
}

/* What lies beyond one of the face's planes, moved inwards by a step, does not come in behind it. */
static bool comes_in(const inner *in, const behind *b, uint32_t triangle)
{
    const uint32_t *v = in->mesh->triangles[triangle];
    return !b->passed[triangle] && (b->beyond[v[0]] & b->beyond[v[1]] & b->beyond[v[2]]) == 0;
}

/* How deep nothing else of the surface comes in; *first is what does. */
static double next_depth(const inner *in, const behind *b, uint32_t *first)
{
    double depth = 2.0 * in->size;
    *first = UMB_NONE;
    for (uint32_t t = 0; t < in->mesh->triangle_count; ++t) {
        for (int k = 0; k < 3 && comes_in(in, b, t); ++k) {
            double at = b->depth[in->mesh->triangles[t][k]];
            *first = at < depth ? t : *first;
            depth = at < depth ? at : depth;
        }
    }
    return depth;
}

static bool in_plane(const inner *in, uint32_t s, uint32_t t)
{
    const uint32_t *a = in->mesh->triangles[s], *b = in->mesh->triangles[t];
    for (int k = 0; k < 3; ++k) {
        if (!has_corner(a, b[k]) && umb_orient(in->p[a[0]], in->p[a[1]], in->p[a[2]], in->p[b[k]]) != 0) {
            return false;
        }
    }
    return true;
}

/* Floors and ceilings that touch: all that comes in at this depth lies in the plane of the first, and across. */
static bool pass_sheet(const inner *in, behind *b, uint32_t first, double depth)
{
    for (uint32_t t = 0; t < in->mesh->triangle_count; ++t) {
        if (!comes_in(in, b, t) || !in_plane(in, first, t)) {
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            if (fabs(b->depth[in->mesh->triangles[t][k]] - depth) > 0.25 * in->step) {
                return false;
            }
        }
        b->passed[t] = true;
    }
    return true;
}

/* The winding number around a point, by solid angles: whole but for rounding. */
static double winding(const inner *in, const double x[3])
{
    double sum = 0.0;
    for (uint32_t t = 0; t < in->mesh->triangle_count; ++t) {
        umb_vec3 v[3];
        double l[3];
        for (int k = 0; k < 3; ++k) {
            v[k] = umb_vec3_sub(umb_vec3_from_float(in->p[in->mesh->triangles[t][k]]), umb_vec3_from_double(x));
            l[k] = umb_vec3_length(v[k]);
        }
        double top = umb_vec3_dot(v[0], umb_vec3_cross(v[1], v[2]));
        double bottom = l[0] * l[1] * l[2] + umb_vec3_dot(v[0], v[1]) * l[2] + umb_vec3_dot(v[1], v[2]) * l[0] +
                        umb_vec3_dot(v[2], v[0]) * l[1];
        sum += 2.0 * atan2(top, bottom);
    }
    return (in->occluder->mirrored ? -sum : sum) / (4.0 * 3.14159265358979323846);
}

/* A point behind the middle of the face, half as deep. */
static void middle_of(const inner *in, const face *f, double depth, double out[3])
{
    memset(out, 0, 3 * sizeof *out);
    for (uint32_t i = 0; i < f->count; ++i) {
        for (int c = 0; c < 3; ++c) {
            for (int k = 0; k < 3; ++k) {
                out[k] += in->p[in->mesh->triangles[f->triangles[i]][c]][k] / (3.0 * f->count);
            }
        }
    }
    for (int k = 0; k < 3; ++k) {
        out[k] -= 0.5 * depth * f->planes[0][k];
    }
}

/* Of the face, and of it moved in so far; within those of the occluder. */
static umb_aabb bounds_of(const inner *in, const face *f, double depth)
{
    umb_aabb box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (uint32_t i = 0; i < 3 * f->count; ++i) {
        const float *p = in->p[in->mesh->triangles[f->triangles[i / 3]][i % 3]];
        for (int k = 0; k < 3; ++k) {
            float back = (float)(p[k] - depth * f->planes[0][k]);
            box.min[k] = fminf(box.min[k], fminf(p[k], back));
            box.max[k] = fmaxf(box.max[k], fmaxf(p[k], back));
        }
    }
    for (int k = 0; k < 3; ++k) {
        box.min[k] = fmaxf(box.min[k], in->occluder->bounds.min[k]);
        box.max[k] = fminf(box.max[k], in->occluder->bounds.max[k]);
    }
    return box;
}

static bool within(const umb_solids *s, const umb_solid *body, const double p[3], double more)
{
    for (uint32_t k = 0; k < body->plane_count; ++k) {
        const double *n = s->planes[body->first_plane + k].plane;
        if (!(n[0] * p[0] + n[1] * p[1] + n[2] * p[2] + n[3] <= more)) {
            return false;
        }
    }
    return true;
}

/* A body has all that the one behind the face would have, as far as a step can tell: the walls of a block have one body. */
static bool has_all(const umb_solids *s, const umb_solid *body, const inner *in, const face *f, double depth)
{
    for (uint32_t i = 0; i < 6 * f->count; ++i) {
        const float *p = in->p[in->mesh->triangles[f->triangles[i / 6]][i / 2 % 3]];
        double back = (i & 1) != 0 ? depth : 0.0, at[3];
        for (int k = 0; k < 3; ++k) {
            at[k] = p[k] - back * f->planes[0][k];
        }
        if (!within(s, body, at, 1.5 * in->step)) {
            return false;
        }
    }
    return true;
}

/* No surface is in a body but the sheets that it goes through, and this point is on none. */
static bool is_solid(const umb_solids *s, const inner *in, const double point[3], uint32_t number)
{
    for (size_t i = s->count; i > 0 && s->items[i - 1].occluder == number; --i) {
        if (within(s, &s->items[i - 1], point, 0.0)) {
            return true;
        }
    }
    return winding(in, point) > 0.9;
}

/* How deep all is solid behind the face: through sheets in its way, which have as much of the solid on either side.
 *
 *      face   ________      A point between two sheets tells for all that lies between them; what is on one is surface
 *            |   .    |     itself. Nothing else may come in, so what is beside a sheet is as solid as what is before
 *       -----|--------|     or behind it.
 *      |     |   .    |
 *      '--------------'
 */
static double solid_depth(const umb_solids *s, const inner *in, const face *f, uint32_t number)
{
    behind b;
    uint32_t first;
    double depth = 0.0;
    look_behind(in, f, &b);
    for (;;) {
        double next = next_depth(in, &b, &first), point[3];
        middle_of(in, f, depth + next, point);
        if (!(next > depth + 0x1p-6 * in->size) || !is_solid(s, in, point, number)) {
            return depth;
        }
        depth = next;
        if (first == UMB_NONE || !pass_sheet(in, &b, first, depth)) {
            return depth;
        }
    }
}

static umb_result add_body(umb_solids *s, const inner *in, const face *f, double depth, uint32_t number)
{
    size_t first = s->plane_count, count = f->plane_count + 1u;
    if (!umb_memory_reserve(s->allocator, (void **)&s->items, &s->capacity, s->count + 1, sizeof *s->items) ||
        !umb_memory_reserve(s->allocator, (void **)&s->planes, &s->plane_capacity, first + count, sizeof *s->planes)) {
        return UMB_ERROR_MEMORY;
    }
    for (size_t i = s->count; i > 0 && s->items[i - 1].occluder == number; --i) {
        if (has_all(s, &s->items[i - 1], in, f, depth)) {
            return UMB_OK;
        }
    }
    umb_solid *body = &s->items[s->count++];
    *body = (umb_solid){.bounds = bounds_of(in, f, depth), .occluder = number};
    body->first_plane = (uint32_t)first;
    body->plane_count = (uint32_t)count;
    s->plane_count = first + count;
    middle_of(in, f, depth, body->inner);
    for (uint32_t k = 0; k < f->plane_count; ++k) {
        memcpy(s->planes[first + k].plane, f->planes[k], sizeof f->planes[k]);
        s->planes[first + k].plane[3] += in->step;
        s->planes[first + k].beyond = INFINITY;
    }
    double *back = s->planes[first + f->plane_count].plane;
    s->planes[first + f->plane_count].beyond = INFINITY;
    for (int k = 0; k < 3; ++k) {
        back[k] = -f->planes[0][k];
    }
    back[3] = -f->planes[0][3] - depth + in->step;
    return UMB_OK;
}

/* Along every edge as many triangles run one way as the other: then the winding number around a point is the same in all of
 * each part of space that the surface leaves free, and nought outside. False: there is an edge where it is not so. */
static bool find_neighbours(const umb_mesh *m, uint32_t (*out)[3])
{
    memset(out, 0xFF, m->triangle_count * sizeof *out);
    uint32_t found = 0;
    for (uint32_t i = 0; i < m->edge_count; ++i) {
        const umb_edge *e = &m->edges[i];
        if (e->f1 == UMB_NONE || (e->f1 & UMB_EDGE_SAME) != 0) {
            return false;
        }
        for (int c = 0; c < 3; ++c) {
            const uint32_t *s = m->triangles[e->f0], *t = m->triangles[e->f1];
            if (s[c] == e->v0 && s[(c + 1) % 3] == e->v1) {
                out[e->f0][c] = e->f1;
                ++found;
            }
            if (t[c] == e->v1 && t[(c + 1) % 3] == e->v0) {
                out[e->f1][c] = e->f0;
                ++found;
            }
        }
    }
    return m->triangle_count >= 4 && found == 3 * m->triangle_count;
}

static bool begin(inner *in, const umb_solids *s, const umb_occluder *o)
{
    *in = (inner){.occluder = o, .mesh = o->mesh};
    for (int k = 0; k < 3; ++k) {
        in->size = fmax(in->size, (double)o->bounds.max[k] - o->bounds.min[k]);
    }
    /* Values of planes are right to 2^-48 of the reach; half a step is far more. */
    in->step = 0x1p-18 * in->size;
    if (in->mesh->block_position_count > UMB_CLOSED_SOLID_MOST ||
        in->mesh->triangle_count > UMB_CLOSED_SOLID_MOST || !find_neighbours(in->mesh, in->neighbours) || !(in->step > 0x1p-40 * s->reach)) {
        return false;
    }
    for (uint32_t i = 0; i < in->mesh->block_position_count; ++i) {
        umb_transform_vertex(&o->transform, o->identity, in->mesh->positions[i], in->p[i]);
    }
    return true;
}

umb_result umb_solids_add_inner(umb_solids *s, const umb_occluder *o, uint32_t number)
{
    inner in;
    face f;
    umb_result result = UMB_OK;
    if (!begin(&in, s, o)) {
        return UMB_OK;
    }
    for (uint32_t t = 0; t < in.mesh->triangle_count && result == UMB_OK; ++t) {
        if (in.done[t]) {
            continue;
        }
        collect(&in, t, &f);
        bool convex = find_planes(&in, &f) || grow(&in, t, &f);
        for (uint32_t i = 0; i < f.count; ++i) {
            in.done[f.triangles[i]] = true;
        }
        double depth = convex ? solid_depth(s, &in, &f, number) : 0.0;
        if (depth > 0.0) {
            result = add_body(s, &in, &f, depth, number);
        }
    }
    return result;
}

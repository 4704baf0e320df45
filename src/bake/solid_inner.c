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

static bool coplanar(const inner *in, uint32_t s, uint32_t t)
{
    const uint32_t *a = in->mesh->triangles[s], *b = in->mesh->triangles[t];
    for (int k = 0; k < 3; ++k) {
        if (umb_orient(in->p[a[0]], in->p[a[1]], in->p[a[2]], in->p[b[k]]) != 0) {
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

/* A triangle in the seed's plane on the other side of an edge of the face: UMB_NONE if there is none. */
static uint32_t across(const inner *in, const face *f, const umb_edge *e)
{
    bool own0 = in->in_face[e->f0], own1 = in->in_face[e->f1];
    uint32_t other = own0 ? e->f1 : e->f0;
    return own0 != own1 && coplanar(in, f->triangles[0], other) ? other : UMB_NONE;
}

/* All of a flat part of the surface. */
static void collect(inner *in, uint32_t seed, face *f)
{
    begin_face(in, f, seed);
    for (uint32_t before = 0; before != f->count;) {
        before = f->count;
        for (uint32_t e = 0; e < in->mesh->edge_count; ++e) {
            uint32_t other = across(in, f, &in->mesh->edges[e]);
            if (other != UMB_NONE) {
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
    for (uint32_t e = 0; e < m->edge_count; ++e) {
        bool own0 = in->in_face[m->edges[e].f0], own1 = in->in_face[m->edges[e].f1];
        if (own0 == own1) {
            continue;
        }
        const float *a = in->p[m->edges[e].v0], *b = in->p[m->edges[e].v1];
        umb_vec3 along = umb_vec3_sub(umb_vec3_from_float(b), umb_vec3_from_float(a));
        umb_vec3 out = umb_vec3_scale(umb_vec3_cross(along, n), own1 != in->occluder->mirrored ? -1.0 : 1.0);
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
    for (uint32_t before = 0; before != f->count;) {
        before = f->count;
        for (uint32_t e = 0; e < in->mesh->edge_count; ++e) {
            uint32_t other = across(in, f, &in->mesh->edges[e]);
            if (other == UMB_NONE) {
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

/* All corners of a triangle lie beyond a plane that is moved inwards by a step. */
static bool beyond(const inner *in, const double plane[4], uint32_t triangle)
{
    const uint32_t *t = in->mesh->triangles[triangle];
    double least = fmin(value(plane, in->p[t[0]]), fmin(value(plane, in->p[t[1]]), value(plane, in->p[t[2]])));
    return least > -0.5 * in->step;
}

/* How deep nothing else of the surface comes in behind the face. */
static double depth_behind(const inner *in, const face *f)
{
    double depth = 2.0 * in->size;
    for (uint32_t t = 0; t < in->mesh->triangle_count; ++t) {
        bool outside = false;
        for (uint32_t k = 0; k < f->plane_count && !outside; ++k) {
            outside = beyond(in, f->planes[k], t);
        }
        for (int k = 0; k < 3 && !outside; ++k) {
            depth = fmin(depth, -value(f->planes[0], in->p[in->mesh->triangles[t][k]]));
        }
    }
    return depth;
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

/* A point behind the middle of the face. */
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

static umb_result add_body(umb_solids *s, const inner *in, const face *f, double depth, uint32_t number)
{
    size_t first = s->plane_count, count = f->plane_count + 1u;
    if (!umb_memory_reserve(s->allocator, (void **)&s->items, &s->capacity, s->count + 1, sizeof *s->items) ||
        !umb_memory_reserve(s->allocator, (void **)&s->planes, &s->plane_capacity, first + count, sizeof *s->planes)) {
        return UMB_ERROR_MEMORY;
    }
    double middle[3];
    middle_of(in, f, depth, middle);
    for (uint32_t k = 0; k < f->plane_count; ++k) {
        memcpy(s->planes[first + k], f->planes[k], sizeof f->planes[k]);
        s->planes[first + k][3] += in->step;
    }
    double *back = s->planes[first + f->plane_count];
    for (int k = 0; k < 3; ++k) {
        back[k] = -f->planes[0][k];
    }
    back[3] = -f->planes[0][3] - depth + in->step;
    if (!(winding(in, middle) > 0.9)) {
        return UMB_OK;
    }
    s->items[s->count++] = (umb_solid){bounds_of(in, f, depth), number, (uint32_t)first, (uint32_t)count,
                                       {middle[0], middle[1], middle[2]}};
    s->plane_count = first + count;
    return UMB_OK;
}

/* Along every edge as many triangles run one way as the other: then the winding number around a point is the same in all of
 * each part of space that the surface leaves free, and nought outside. */
static bool is_closed(const umb_mesh *m)
{
    for (uint32_t i = 0; i < m->edge_count; ++i) {
        if (m->edges[i].f1 == UMB_NONE || (m->edges[i].f1 & UMB_EDGE_SAME) != 0) {
            return false;
        }
    }
    return m->triangle_count >= 4;
}

static bool begin(inner *in, const umb_solids *s, const umb_occluder *o, const double box[8][3])
{
    *in = (inner){.occluder = o, .mesh = o->mesh};
    bool apart = false;
    for (int k = 0; k < 3; ++k) {
        in->size = fmax(in->size, (double)o->bounds.max[k] - o->bounds.min[k]);
        apart = apart || box[0][k] > o->bounds.max[k] || box[7][k] < o->bounds.min[k];
    }
    /* Values of planes are right to 2^-48 of the reach; half a step is far more. */
    in->step = 0x1p-18 * in->size;
    if (!apart || in->mesh->block_position_count > UMB_CLOSED_SOLID_MOST ||
        in->mesh->triangle_count > UMB_CLOSED_SOLID_MOST || !is_closed(in->mesh) || !(in->step > 0x1p-40 * s->reach)) {
        return false;
    }
    for (uint32_t i = 0; i < in->mesh->block_position_count; ++i) {
        if (o->identity) {
            memcpy(in->p[i], in->mesh->positions[i], sizeof in->p[i]);
        } else {
            umb_transform_point(&o->transform, in->mesh->positions[i], in->p[i]);
        }
    }
    return true;
}

umb_result umb_solids_add_inner(umb_solids *s, const umb_occluder *o, uint32_t number, const double box[8][3])
{
    inner in;
    face f;
    umb_result result = UMB_OK;
    if (!begin(&in, s, o, box)) {
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
        double depth = convex ? depth_behind(&in, &f) : 0.0;
        if (depth > 0x1p-6 * in.size) {
            result = add_body(s, &in, &f, depth, number);
        }
    }
    return result;
}

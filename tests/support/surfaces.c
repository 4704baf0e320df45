#include "surfaces.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/transform.h"

/* ---- meshes -------------------------------------------------------------------------------------- */

void add_face(surface *s, uint32_t a, uint32_t b, uint32_t c)
{
    assert_true(s->face_count < SURFACE_MOST);
    memcpy(s->faces[s->face_count++], (uint32_t[3]){a, b, c}, sizeof s->faces[0]);
}

void add_quad(surface *s, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
    add_face(s, a, b, c);
    add_face(s, a, c, d);
}

/* An upright prism over an outline that goes round to the left; tops are cut into triangles as said. */
static void add_prism(surface *s, const int8_t (*ring)[2], uint32_t count, const uint8_t (*tops)[3], uint32_t top_count,
                      const int shift[3], int height)
{
    uint32_t first = s->point_count;
    for (uint32_t i = 0; i < 2 * count; ++i) {
        float *p = s->points[s->point_count++];
        p[0] = (float)(ring[i % count][0] + shift[0]);
        p[1] = (float)(ring[i % count][1] + shift[1]);
        p[2] = (float)((i < count ? 0 : height) + shift[2]);
    }
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t k = (i + 1) % count;
        add_quad(s, first + i, first + k, first + count + k, first + count + i);
    }
    for (uint32_t i = 0; i < top_count; ++i) {
        const uint8_t *t = tops[i];
        add_face(s, first + count + t[0], first + count + t[1], first + count + t[2]);
        add_face(s, first + t[0], first + t[2], first + t[1]);
    }
}

const outline SQUARE = {{{0, 0}, {8, 0}, {8, 8}, {0, 8}}, 4, {{0, 1, 2}, {0, 2, 3}}, 2};
const outline CORNER = {{{0, 0}, {12, 0}, {12, 4}, {4, 4}, {4, 12}, {0, 12}}, 6, {{0, 1, 3}, {1, 2, 3}, {0, 3, 5}, {3, 4, 5}}, 4};
const outline YARD = {{{0, 0}, {14, 0}, {14, 10}, {10, 10}, {10, 4}, {4, 4}, {4, 10}, {0, 10}}, 8,
                             {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {0, 4, 5}, {0, 5, 6}, {0, 6, 7}}, 6};
const outline ARROW = {{{0, 0}, {9, 3}, {0, 12}, {4, 4}}, 4, {{0, 1, 3}, {1, 2, 3}}, 2};
const outline BOW = {{{0, 0}, {9, 9}, {9, 0}, {0, 5}}, 4, {{0, 1, 2}, {0, 2, 3}}, 2}; /* crosses itself */

void add_outline(surface *s, const outline *o, const int shift[3], int height)
{
    add_prism(s, o->points, o->count, o->tops, o->top_count, shift, height);
}

void turn_face(surface *s, uint32_t face)
{
    uint32_t other = s->faces[face][1];
    s->faces[face][1] = s->faces[face][2];
    s->faces[face][2] = other;
}

/* ---- occluders ------------------------------------------------------------------------------------ */

void open_case(const surface *s, const umb_transform *t, bool mirrored, solid_case *out)
{
    umb_shape_def def = {.positions = &s->points[0][0], .position_count = s->point_count, .indices = &s->faces[0][0],
                         .index_count = 3 * s->face_count, .triangle_flags = s->flags};
    *out = (solid_case){.allocator = umb_memory_allocator(NULL)};
    assert_int_equal(umb_mesh_create_occluder(&out->allocator, &def, &out->mesh), UMB_OK);
    umb_occluder *o = &out->occluder;
    *o = (umb_occluder){.mesh = out->mesh, .owner = UMB_NONE, .identity = t == NULL, .mirrored = mirrored};
    o->bounds = (umb_aabb){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    o->transform = t != NULL ? *t : o->transform;
    for (uint32_t i = 0; i < out->mesh->position_count; ++i) {
        float *p = out->points[i];
        memcpy(p, out->mesh->positions[i], sizeof out->points[i]);
        if (t != NULL) {
            umb_transform_point(t, out->mesh->positions[i], p);
        }
        for (int k = 0; k < 3; ++k) {
            o->bounds.min[k] = fminf(o->bounds.min[k], p[k]);
            o->bounds.max[k] = fmaxf(o->bounds.max[k], p[k]);
        }
    }
}

void close_case(solid_case *c)
{
    umb_mesh_destroy(&c->allocator, c->mesh);
}

umb_transform draw_transform(dice *d, bool mirrored)
{
    double angle = dice_between(d, 0, 6.28), c = cos(angle), s = sin(angle), size = dice_between(d, 0.3, 3), lean = dice_between(d, -0.5, 0.5);
    umb_transform t = {{{(float)(size * c), (float)(-size * s), 0, (float)dice_between(d, -50, 50)},
                        {(float)(size * s), (float)(size * c), (float)lean, (float)dice_between(d, -50, 50)},
                        {(float)lean, 0, (float)(mirrored ? -size : size), (float)dice_between(d, -50, 50)}}};
    return t;
}

double winding(const solid_case *c, const double x[3])
{
    double sum = 0.0;
    for (uint32_t t = 0; t < c->mesh->triangle_count; ++t) {
        double v[3][3], l[3], dots[3];
        for (int i = 0; i < 3; ++i) {
            for (int k = 0; k < 3; ++k) {
                v[i][k] = c->points[c->mesh->triangles[t][i]][k] - x[k];
            }
            l[i] = sqrt(v[i][0] * v[i][0] + v[i][1] * v[i][1] + v[i][2] * v[i][2]);
        }
        for (int i = 0; i < 3; ++i) {
            const double *a = v[i], *b = v[(i + 1) % 3];
            dots[i] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        }
        double det = v[0][0] * (v[1][1] * v[2][2] - v[1][2] * v[2][1]) - v[0][1] * (v[1][0] * v[2][2] - v[1][2] * v[2][0]) +
                     v[0][2] * (v[1][0] * v[2][1] - v[1][1] * v[2][0]);
        sum += 2.0 * atan2(det, l[0] * l[1] * l[2] + dots[0] * l[2] + dots[1] * l[0] + dots[2] * l[1]);
    }
    return (c->occluder.mirrored ? -sum : sum) / (4.0 * 3.14159265358979323846);
}

void point_in(dice *d, const umb_aabb *b, double out[3])
{
    for (int k = 0; k < 3; ++k) {
        double size = (double)b->max[k] - b->min[k];
        out[k] = b->min[k] + size * dice_between(d, -0.05, 1.05);
    }
}

/* ---- bodies inside ---------------------------------------------------------------------------------- */

double depth_in(const umb_solids *s, const umb_solid *b, const double x[3])
{
    double most = -INFINITY;
    for (uint32_t k = 0; k < b->plane_count; ++k) {
        const double *p = s->planes[b->first_plane + k].plane;
        most = fmax(most, p[0] * x[0] + p[1] * x[1] + p[2] * x[2] + p[3]);
    }
    return -most;
}

/* Where three planes of a body meet, drawn in by a little: false if that is not a corner of it. */
static bool corner_of(dice *d, const umb_solids *s, const umb_solid *b, double out[3])
{
    double m[3][4];
    for (int i = 0; i < 3; ++i) {
        memcpy(m[i], s->planes[b->first_plane + dice_roll(d, b->plane_count)].plane, sizeof m[i]);
    }
    double minors[3][3], det = 0.0;
    for (int i = 0; i < 3; ++i) {
        const double *p = m[(i + 1) % 3], *q = m[(i + 2) % 3];
        for (int k = 0; k < 3; ++k) {
            minors[i][k] = p[(k + 1) % 3] * q[(k + 2) % 3] - p[(k + 2) % 3] * q[(k + 1) % 3];
        }
    }
    det = m[0][0] * minors[0][0] + m[0][1] * minors[0][1] + m[0][2] * minors[0][2];
    for (int k = 0; k < 3; ++k) {
        double x = -(m[0][3] * minors[0][k] + m[1][3] * minors[1][k] + m[2][3] * minors[2][k]) / det;
        out[k] = x + 1e-6 * (b->inner[k] - x);
    }
    return fabs(det) > 1e-9 && depth_in(s, b, out) >= 0.0;
}

uint32_t check_bodies(dice *d, const solid_case *c, const umb_solids *s)
{
    uint32_t inside = 0;
    for (size_t i = 0; i < s->count; ++i) {
        for (int n = 0; n < 60; ++n) {
            double x[3];
            if (n % 2 == 0) {
                point_in(d, &c->occluder.bounds, x);
            }
            if (n % 2 == 0 ? depth_in(s, &s->items[i], x) >= 0.0 : corner_of(d, s, &s->items[i], x)) {
                inside += 1;
                assert_true(winding(c, x) > 0.5);
            }
        }
    }
    return inside;
}

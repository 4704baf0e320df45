/* What the eye sees: plain light, quiet colours, haze for depth, a fine line where things end. */
#include <math.h>
#include <stdlib.h>

#include "picture.h"
#include "picture_rays.h"

static const bitmap_color horizon = 0xE4ECF0, zenith = 0x86A9C8, below = 0xCBD0CF,
                          line_color = 0x20242B;

/* Quiet stone, sand, slate and leaf. */
static const bitmap_color object_colors[] = {0xE2D8C3, 0xD6C2A2, 0xC8B79A, 0xB9C6BA,
                                             0xA9BDC8, 0xC6CEDA, 0xD9BCA8, 0xBFAA9F,
                                             0xC8CCB2, 0xE3D6B6, 0xBAB4C6, 0xA8BAA9};

typedef struct shader {
    const model *m;
    truth *t;
    const umb_view *view;
    double up[3], sun[3];
    double haze;      /* depth at which haze takes hold */
    double low, high; /* of the scene along up */
    bool shared;      /* faces belong to several objects: which of them a ray hits says nothing */
} shader;

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static bitmap_color sky(const shader *s, const double direction[3])
{
    double rise = dot(direction, s->up);
    return rise < 0 ? bitmap_mix(horizon, below, fmin(1, -4 * rise))
                    : bitmap_mix(horizon, zenith, fmin(1, pow(1.4 * rise, 0.7)));
}

/* A quiet tint of its own for each object; where objects share faces, by the way that a face
 * looks. */
static bitmap_color surface_color(const shader *s, const picture_hit *hit)
{
    static const bitmap_color neutral = 0xE4DED2, stone = 0xD9CDB8, slate = 0xC3CCD2;
    if (s->shared) {
        double turn = 0;
        for (int i = 0; i < 3; ++i) {
            turn += hit->normal[i] * (s->sun[i] - s->up[i] * dot(s->sun, s->up));
        }
        return bitmap_mix(neutral, turn > 0 ? stone : slate, fmin(1, 1.6 * fabs(turn)));
    }
    uint32_t h = (hit->object ^ hit->object >> 7) * 2654435761u >> 16;
    return bitmap_mix(object_colors[h % (sizeof object_colors / sizeof object_colors[0])], neutral,
                      0.35);
}

/* Light from the viewer's side, from above and from a sun, so that no two walls of a corner look
 * alike. */
static bitmap_color shade(const shader *s, const picture_hit *hit, double x, double y)
{
    double direction[3], normal[3] = {hit->normal[0], hit->normal[1], hit->normal[2]}, height = 0;
    picture_rays_direction(s->view, x, y, direction);
    if (hit->object == MODEL_NONE) {
        return sky(s, direction);
    }
    double cosine = dot(direction, s->view->forward);
    for (int i = 0; i < 3; ++i) {
        height += s->up[i] * (s->view->eye[i] + direction[i] * hit->depth / cosine);
    }
    double light = 0.46 + 0.20 * -dot(normal, direction) + 0.12 * (0.5 + 0.5 * dot(normal, s->up)) +
                   0.34 * fmax(0, dot(normal, s->sun));
    double level = fmin(1, fmax(0, (height - s->low) / (s->high - s->low + 1e-30)));
    bitmap_color c = surface_color(s, hit);
    c = bitmap_mix(c, level < 0.5 ? 0xB9A78C : 0xF4F1EA, 0.22 * fabs(2 * level - 1));
    c = bitmap_mix(0x262C3A, c, fmin(1, light));
    return bitmap_mix(c, horizon, 0.8 * (1 - exp(-hit->depth / s->haze)));
}

/* How differently two neighbouring pixels look: 0 alike, 1 a fold of a surface, 2 another
 * object, 3 an edge with depth behind it. */
static int difference(const picture_hit *a, const picture_hit *b, bool shared)
{
    if (a->object == MODEL_NONE && b->object == MODEL_NONE) {
        return 0;
    }
    if (a->object == MODEL_NONE || b->object == MODEL_NONE) {
        return 3;
    }
    double cosine = a->normal[0] * b->normal[0] + a->normal[1] * b->normal[1] +
                    a->normal[2] * b->normal[2];
    bool jump = fabs(a->depth - b->depth) > 0.08 * fmin(a->depth, b->depth);
    if (cosine > 0.999) {
        /* One plane seen at a grazing angle changes depth quickly too. */
        return a->object == b->object ? 0 : jump && !shared ? 2 : !shared;
    }
    return jump ? 3 : cosine < 0.9 ? (a->object != b->object ? 2 : 1) : 0;
}

static int edge_at(const picture_rays *r, uint32_t x, uint32_t y, bool shared, bool all_sides)
{
    const picture_hit *at = r->hits + (size_t)y * r->width + x;
    int most = 0;
    for (int k = 0; k < (all_sides ? 4 : 2); ++k) {
        static const int8_t step[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
        uint32_t u = x + (uint32_t)step[k][0], v = y + (uint32_t)step[k][1];
        if (u < r->width && v < r->height) {
            int d = difference(at, r->hits + (size_t)v * r->width + u, shared);
            most = d > most ? d : most;
        }
    }
    return most;
}

/* The mean of a fine grid of rays over a pixel. */
static bitmap_color refine(const shader *s, uint32_t x, uint32_t y, const bitmap *im)
{
    enum { GRID = 3 };
    uint32_t sum[3] = {GRID * GRID / 2, GRID * GRID / 2, GRID * GRID / 2};
    for (int k = 0; k < GRID * GRID; ++k) {
        double u = (x + (k % GRID + 0.5) / GRID) / im->width,
               v = (y + (k / GRID + 0.5) / GRID) / im->height;
        picture_hit hit = picture_rays_one(s->t, s->view, u, v);
        bitmap_color c = shade(s, &hit, u, v);
        for (int i = 0; i < 3; ++i) {
            sum[i] += c >> (16 - 8 * i) & 255;
        }
    }
    return sum[0] / (GRID * GRID) << 16 | sum[1] / (GRID * GRID) << 8 | sum[2] / (GRID * GRID);
}

static shader make_shader(const model *m, truth *t, const umb_view *view)
{
    shader s = {.m = m, .t = t, .view = view};
    double length = sqrt(dot(m->up, m->up)), size = 0, side[3], across[3];
    for (int i = 0; i < 3; ++i) {
        s.up[i] = m->up[i] / length;
        double extent = m->bounds.max[i] - m->bounds.min[i];
        size += extent * extent;
        s.low += s.up[i] * (s.up[i] > 0 ? m->bounds.min[i] : m->bounds.max[i]);
        s.high += s.up[i] * (s.up[i] > 0 ? m->bounds.max[i] : m->bounds.min[i]);
    }
    /* The sun stands high, off every axis. */
    for (int i = 0; i < 3; ++i) {
        side[i] = s.up[(i + 2) % 3];
        across[i] = s.up[(i + 1) % 3];
    }
    double square = 0;
    for (int i = 0; i < 3; ++i) {
        s.sun[i] = 0.75 * s.up[i] + 0.55 * side[i] - 0.3 * across[i];
        square += s.sun[i] * s.sun[i];
    }
    for (int i = 0; i < 3; ++i) {
        s.sun[i] /= sqrt(square);
    }
    uint64_t triangles = 0;
    for (uint32_t o = 0; o < m->object_count; ++o) {
        triangles += m->objects[o].mesh != MODEL_NONE ? m->meshes[m->objects[o].mesh].triangle_count
                                                      : 0;
    }
    s.shared = triangles > m->triangles;
    s.haze = fmax(0.5 * sqrt(size), 1e-6);
    return s;
}

bool picture_eye(bitmap *im, const model *m, truth *t, const umb_view *view)
{
    static const double line_strength[4] = {0, 0.10, 0.22, 0.42};
    shader s = make_shader(m, t, view);
    picture_rays rays;
    if (!picture_rays_trace(&rays, t, view, im->width, im->height)) {
        return false;
    }
    for (uint32_t y = 0; y < im->height; ++y) {
        for (uint32_t x = 0; x < im->width; ++x) {
            const picture_hit *hit = rays.hits + (size_t)y * rays.width + x;
            double u = (x + 0.5) / im->width, v = (y + 0.5) / im->height;
            bitmap_color c = edge_at(&rays, x, y, s.shared, true) ? refine(&s, x, y, im)
                                                                  : shade(&s, hit, u, v);
            int edge = edge_at(&rays, x, y, s.shared, false);
            double fade = exp(-2 * (hit->object == MODEL_NONE ? 0 : hit->depth) / s.haze);
            bitmap_set(im, (int)x, (int)y,
                       bitmap_mix(c, line_color, line_strength[edge] * (0.35 + 0.65 * fade)));
        }
    }
    picture_rays_free(&rays);
    return true;
}

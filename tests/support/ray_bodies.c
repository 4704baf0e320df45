#include "ray_bodies.h"

#include <math.h>
#include <string.h>

#define SLACK 1e-10 /* of a triangle: more than doubles lose here, less than maps leave */

typedef struct vector {
    double x[3];
} vector;

static vector vector_of(const umb_ray_point *a, const umb_ray_point *b)
{
    return (vector){{b->u - a->u, b->v - a->v, b->z - a->z}};
}

static vector cross(vector a, vector b)
{
    return (vector){{a.x[1] * b.x[2] - a.x[2] * b.x[1], a.x[2] * b.x[0] - a.x[0] * b.x[2], a.x[0] * b.x[1] - a.x[1] * b.x[0]}};
}

static double dot(vector a, vector b)
{
    return a.x[0] * b.x[0] + a.x[1] * b.x[1] + a.x[2] * b.x[2];
}

static void add_face(ray_body *b, int i, int j, int k)
{
    uint8_t *face = b->faces[b->face_count++];
    face[0] = (uint8_t)i;
    face[1] = (uint8_t)j;
    face[2] = (uint8_t)k;
}

static void draw_box(dice *d, const umb_ray_point *middle, double size, ray_body *out)
{
    static const uint8_t sides[6][4] = {{0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}};
    bool upright = dice_roll(d, 2) == 0;
    umb_ray_point axes[3];
    for (int a = 0; a < 3; ++a) {
        double most = dice_roll(d, 4) == 0 ? 0.05 * size : size;
        axes[a] = (umb_ray_point){dice_between(d, -most, most), dice_between(d, -most, most), dice_between(d, -size, size)};
        axes[a].u = upright && a == 2 ? 0.0 : axes[a].u;
        axes[a].v = upright && a == 2 ? 0.0 : axes[a].v;
        axes[a].z = upright && a < 2 ? 0.0 : axes[a].z;
    }
    out->blocker.convex = true;
    out->blocker.count = 8;
    for (int c = 0; c < 8; ++c) {
        umb_ray_point p = *middle;
        for (int a = 0; a < 3; ++a) {
            p.u += (c >> a & 1) != 0 ? axes[a].u : 0.0;
            p.v += (c >> a & 1) != 0 ? axes[a].v : 0.0;
            p.z += (c >> a & 1) != 0 ? axes[a].z : 0.0;
        }
        out->blocker.vertices[c] = p;
    }
    for (int s = 0; s < 6; ++s) {
        add_face(out, sides[s][0], sides[s][1], sides[s][2]);
        add_face(out, sides[s][0], sides[s][2], sides[s][3]);
    }
}

static umb_ray_point point_near(dice *d, const umb_ray_point *middle, double size)
{
    return (umb_ray_point){middle->u + dice_between(d, -size, size), middle->v + dice_between(d, -size, size),
                           middle->z + dice_between(d, -size, size)};
}

static void draw_tetrahedron(dice *d, const umb_ray_point *middle, double size, ray_body *out)
{
    bool edge = dice_roll(d, 4) == 0; /* one in the middle of the map: chains end at either of its ends */
    out->blocker.convex = true;
    out->blocker.count = 4;
    for (int c = 0; c < 4; ++c) {
        umb_ray_point *p = &out->blocker.vertices[c];
        *p = point_near(d, middle, size);
        p->v = edge ? (c < 2 ? 0.0 : fabs(p->v)) : p->v;
        add_face(out, c, (c + 1) % 4, (c + 2) % 4);
    }
}

/* Ring: the base from one end to the other, the roof back. */
static void draw_wall(dice *d, const umb_ray_point *middle, double size, ray_body *out)
{
    umb_ray_blocker *b = &out->blocker;
    uint32_t pieces = 1 + dice_roll(d, 4), count = 2 * pieces + 2;
    double slope = dice_roll(d, 2) == 0 ? 0.0 : dice_between(d, -1, 1), ragged = dice_roll(d, 3) == 0 ? 0.0 : 0.3 * size;
    b->count = b->ring = count;
    for (uint32_t i = 0; i <= pieces; ++i) {
        double along = size * (2.0 * i / pieces - 1.0), u = middle->u + slope * along + dice_between(d, -ragged, ragged);
        double v = middle->v + along, base = middle->z + dice_between(d, -ragged, ragged);
        b->vertices[i] = (umb_ray_point){u, v, base};
        b->vertices[count - 1 - i] = (umb_ray_point){u, v, base + size * dice_between(d, 0.2, 1) + ragged};
    }
    for (uint32_t i = 0; i < pieces; ++i) {
        add_face(out, (int)i, (int)i + 1, (int)(count - 2 - i));
        add_face(out, (int)i, (int)(count - 2 - i), (int)(count - 1 - i));
    }
}

static void draw_star(dice *d, const umb_ray_point *middle, double size, ray_body *out)
{
    umb_ray_blocker *b = &out->blocker;
    uint32_t ring = 3 + dice_roll(d, 6);
    b->ring = ring;
    b->count = ring + 1;
    for (uint32_t i = 0; i < ring; ++i) {
        double angle = 6.283185307179586 * (i + dice_between(d, 0, 0.9)) / ring, far = size * dice_between(d, 0.3, 1);
        b->vertices[i] = (umb_ray_point){middle->u + dice_between(d, -size, size), middle->v + far * cos(angle),
                                         middle->z + far * sin(angle)};
        add_face(out, (int)i, (int)((i + 1) % ring), (int)ring);
    }
    b->vertices[ring] = point_near(d, middle, 0.3 * size);
}

void ray_body_draw(dice *d, const ray_place *place, ray_body *out)
{
    static void (*const draws[4])(dice *, const umb_ray_point *, double, ray_body *) = {draw_box, draw_tetrahedron, draw_wall,
                                                                                         draw_star};
    memset(out, 0, sizeof *out);
    double u = exp(dice_between(d, log(place->near), log(place->far))), size = u * place->share * dice_between(d, 0.05, 1);
    umb_ray_point middle = {u, u * dice_between(d, -1.1, 1.1), u * dice_between(d, -0.6, 1) * dice_between(d, 0, 1)};
    draws[dice_roll(d, 4)](d, &middle, size, out);
    double least = INFINITY;
    for (uint32_t i = 0; i < out->blocker.count; ++i) {
        least = fmin(least, out->blocker.vertices[i].u);
    }
    for (uint32_t i = 0; i < out->blocker.count && out->blocker.convex; ++i) {
        out->blocker.vertices[i].u += fmax(0.0, place->front - least);
    }
}

void ray_body_stand(ray_body *body, double ground)
{
    umb_ray_blocker *b = &body->blocker;
    double low = INFINITY;
    for (uint32_t i = 0; i < b->count; ++i) {
        low = fmin(low, b->vertices[i].z);
    }
    for (uint32_t i = 0; i < b->count; ++i) {
        bool base = !b->convex && b->count == b->ring && i < b->count / 2;
        b->vertices[i].z = base ? ground : ground + (b->vertices[i].z - low);
        b->on_floor[i] = b->vertices[i].z <= ground;
    }
    b->floor = true;
}

bool ray_body_meets(const ray_body *b, const umb_ray_point *from, const umb_ray_point *to)
{
    vector way = vector_of(from, to);
    for (uint32_t i = 0; i < b->face_count; ++i) {
        const umb_ray_point *p = &b->blocker.vertices[b->faces[i][0]];
        vector e = vector_of(p, &b->blocker.vertices[b->faces[i][1]]), g = vector_of(p, &b->blocker.vertices[b->faces[i][2]]);
        vector n = cross(way, g), s = vector_of(p, from);
        double det = dot(e, n), x = dot(s, n) / det;
        vector q = cross(s, e);
        double y = dot(way, q) / det, at = dot(g, q) / det;
        if (x >= -SLACK && y >= -SLACK && x + y <= 1.0 + SLACK && at >= -SLACK && at <= 1.0 + SLACK) {
            return true;
        }
    }
    return false;
}

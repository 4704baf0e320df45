/* The views of the long run. Each comes from the scene and a number alone. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "soak.h"

#define PI 3.14159265358979323846
#define TRIES 64

/* A view being thought out. */
typedef struct draft {
    soak_dice dice;
    const model *m;
    double up[3], across[2][3];        /* the scene's up, and two axes at right angles to it */
    double size;                       /* of the scene: the diagonal of its box */
    double eye[3], target[3], roof[3]; /* roof: the up that is asked for */
    double fov, aspect, near_depth, far_depth, height; /* height > 0: parallel */
    double shift[2]; /* of the picture, in its own widths and heights */
    uint32_t planes; /* so many extra ones, through planes_at */
    double planes_at[3];
} draft;

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross3(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        out[i] = a[j] * b[k] - a[k] * b[j];
    }
}

static bool unit3(double v[3])
{
    double length = sqrt(dot3(v, v));
    for (int i = 0; i < 3 && length > 0.0; ++i) {
        v[i] /= length;
    }
    return length > 0.0;
}

static void add3(double to[3], double factor, const double v[3])
{
    for (int i = 0; i < 3; ++i) {
        to[i] += factor * v[i];
    }
}

static double between(draft *d, double low, double high)
{
    return soak_between(&d->dice, low, high);
}

static uint32_t below(draft *d, uint32_t n)
{
    return soak_below(&d->dice, n);
}

/* Spread evenly over the magnitudes from low to high. */
static double magnitude(draft *d, double low, double high)
{
    return exp(between(d, log(low), log(high)));
}

static void random_unit(draft *d, double out[3])
{
    do {
        for (int i = 0; i < 3; ++i) {
            out[i] = between(d, -1.0, 1.0);
        }
    } while (dot3(out, out) > 1.0 || dot3(out, out) < 1e-3);
    (void)unit3(out);
}

static void draft_start(draft *d, const model *m, uint64_t number, uint64_t salt)
{
    memset(d, 0, sizeof *d);
    d->dice.state = number * 0xD1342543DE82EF95u + salt;
    (void)soak_next(&d->dice);
    d->m = m;
    memcpy(d->up, m->up, sizeof d->up);
    if (!unit3(d->up)) {
        d->up[1] = 1.0;
    }
    int axis = fabs(d->up[0]) < 0.5 ? 0 : 1;
    double e[3] = {axis == 0, axis == 1, 0.0};
    cross3(d->up, e, d->across[0]);
    (void)unit3(d->across[0]);
    cross3(d->up, d->across[0], d->across[1]);
    for (int i = 0; i < 3; ++i) {
        double side = (double)m->bounds.max[i] - m->bounds.min[i];
        d->size += side * side;
    }
    d->size = sqrt(d->size) + 1e-6;
    memcpy(d->roof, d->up, sizeof d->roof);
    d->fov = PI / 3.0;
    d->aspect = 2.0;
    d->near_depth = 0.1;
    d->far_depth = INFINITY;
}

/* Look the way that yaw and pitch say. */
static void look(draft *d, double yaw, double pitch)
{
    memcpy(d->target, d->eye, sizeof d->eye);
    double reach = 0.01 * d->size;
    add3(d->target, reach * cos(pitch) * cos(yaw), d->across[0]);
    add3(d->target, reach * cos(pitch) * sin(yaw), d->across[1]);
    add3(d->target, reach * sin(pitch), d->up);
}

static void look_along(draft *d, const double direction[3])
{
    memcpy(d->target, d->eye, sizeof d->eye);
    add3(d->target, 0.01 * d->size / sqrt(dot3(direction, direction)), direction);
}

static bool draft_finish(draft *d, umb_view *out)
{
    umb_result result;
    if (d->height > 0.0) {
        double end = isinf(d->far_depth) ? 4.0 * d->size : d->far_depth;
        result = umb_view_look_at_ortho(out, d->eye, d->target, d->roof, d->height, d->aspect,
                                        d->near_depth, d->near_depth + end);
    } else {
        result = umb_view_look_at(out, d->eye, d->target, d->roof, d->fov, d->aspect, d->near_depth,
                                  d->far_depth);
    }
    if (result != UMB_OK) {
        return false;
    }
    double dx = d->shift[0] * (out->x_max - out->x_min),
           dy = d->shift[1] * (out->y_max - out->y_min);
    out->x_min += dx;
    out->x_max += dx;
    out->y_min += dy;
    out->y_max += dy;
    out->plane_count = d->planes;
    for (uint32_t k = 0; k < d->planes; ++k) {
        random_unit(d, out->planes[k]);
        out->planes[k][3] = -dot3(out->planes[k], d->planes_at);
    }
    return umb_view_check(out, NULL) == UMB_OK;
}

/* ---- ordinary views ---- */

/* A place in the scene's box, drawn in by a tenth, at a height above its floor: share of the whole,
 * plus so many units. */
static void stand(draft *d, double share, double units)
{
    double low = 0.0, high = 0.0;
    for (int i = 0; i < 3; ++i) {
        double a = d->m->bounds.min[i], b = d->m->bounds.max[i];
        d->eye[i] = a + (b - a) * between(d, 0.1, 0.9);
        low += d->up[i] * (d->up[i] > 0.0 ? a : b);
        high += d->up[i] * (d->up[i] > 0.0 ? b : a);
    }
    add3(d->eye, low + share * (high - low) + units - dot3(d->eye, d->up), d->up);
}

static void turn_at_random(draft *d)
{
    double any[3];
    random_unit(d, any);
    look_along(d, any);
    random_unit(d, d->roof);
}

static void parallel(draft *d)
{
    double any[3];
    if (below(d, 3) == 0) {
        look_along(d, d->across[below(d, 2)]);
    } else if (below(d, 2) == 0) {
        look(d, between(d, 0.0, 2.0 * PI), -PI / 2.0 + (below(d, 2) ? between(d, 0.0, 1.2) : 0.0));
    } else {
        random_unit(d, any);
        look_along(d, any);
    }
    d->height = d->size * magnitude(d, 0.01, 0.3);
    d->near_depth = between(d, -0.5, 0.1) * d->size;
}

static void ordinary(draft *d, const soak_scene *s)
{
    uint32_t style = below(d, 100);
    double yaw = between(d, 0.0, 2.0 * PI);
    bool flat = s->path.count == 0 || strncmp(s->scene, "gen:b", 5) == 0;
    if (s->path.count != 0 && (style < 20 || (style < 55 && !flat))) {
        const double *row = s->path.rows[below(d, s->path.count)];
        memcpy(d->eye, row, sizeof d->eye);
        memcpy(d->target, row + 3, sizeof d->target);
        if (below(d, 2) != 0) {
            look(d, yaw, between(d, -0.2, 0.2));
        }
    } else if (style < 60) {
        stand(d, 0.0, 1.7);
        look(d, yaw, between(d, -0.1, 0.1));
    } else if (style < 74) {
        stand(d, between(d, 0.0, 1.1), 0.0);
        look(d, yaw, between(d, -0.7, 0.4));
    } else if (style < 77) {
        stand(d, between(d, 1.0, 3.0), 5.0);
        look(d, yaw, between(d, -1.5, -0.2));
    } else if (style < 84) {
        stand(d, between(d, 0.0, 1.0), 1.0);
        turn_at_random(d);
    } else if (style < 90) {
        stand(d, between(d, 0.0, 1.0), 0.0);
        parallel(d);
    } else if (style < 95) {
        stand(d, 0.0, 1.7);
        look(d, yaw, between(d, -0.3, 0.3));
        d->fov = between(d, 100.0, 150.0) * PI / 180.0;
    } else {
        stand(d, between(d, 0.0, 1.0), 1.7);
        look(d, yaw, between(d, -0.1, 0.1));
        d->fov = between(d, 2.0, 20.0) * PI / 180.0;
    }
    static const double aspects[4] = {2.0, 16.0 / 9.0, 4.0 / 3.0, 0.6};
    d->aspect = aspects[below(d, 8) % 4];
    if (below(d, 6) == 0) {
        d->far_depth = d->near_depth + d->size * magnitude(d, 0.05, 1.0);
    }
}

bool soak_view_ordinary(const soak_scene *s, uint64_t number, umb_view *out)
{
    /* Every third batch is a walk: its views take one view's eye on in small steps and turns. */
    bool walk = number / SOAK_BATCH % 3 == 0;
    double step = walk ? (double)(number % SOAK_BATCH) : 0.0;
    uint64_t base = walk ? number - number % SOAK_BATCH : number;
    for (uint64_t k = 0; k < TRIES; ++k) {
        draft d;
        draft_start(&d, s->model, base + (k << 40), 0x5eed);
        ordinary(&d, s);
        double ahead[3];
        for (int i = 0; i < 3; ++i) {
            ahead[i] = d.target[i] - d.eye[i];
        }
        if (step > 0.0 && unit3(ahead)) {
            double stride = 0.25 * step;
            double aside[3];
            cross3(ahead, d.up, aside);
            add3(d.eye, stride, ahead);
            add3(d.target, stride + 0.01 * d.size, ahead);
            add3(d.target, 0.01 * d.size * tan(0.02 * step), aside);
        }
        if (draft_finish(&d, out)) {
            return true;
        }
    }
    return false;
}

/* ---- adversarial views ---- */

/* A triangle of the scene. */
typedef struct place {
    double v[3][3], normal[3], middle[3];
    double size;  /* longest edge */
    umb_aabb box; /* of its object */
} place;

static bool pick(draft *d, place *out)
{
    for (int tries = 0; tries < 200; ++tries) {
        const model_object *o = &d->m->objects[below(d, d->m->object_count)];
        if (o->mesh == MODEL_NONE || d->m->meshes[o->mesh].triangle_count == 0) {
            continue;
        }
        const model_mesh *mesh = &d->m->meshes[o->mesh];
        const uint32_t *corner = mesh->indices + 3 * (size_t)below(d, mesh->triangle_count);
        double e[2][3];
        out->size = 0.0;
        out->box = o->bounds;
        memset(out->middle, 0, sizeof out->middle);
        for (int k = 0; k < 3; ++k) {
            float v[3];
            model_world_vertex(d->m, o, corner[k], v);
            for (int i = 0; i < 3; ++i) {
                out->v[k][i] = v[i];
                out->middle[i] += v[i] / 3.0;
            }
        }
        for (int k = 0; k < 2; ++k) {
            for (int i = 0; i < 3; ++i) {
                e[k][i] = out->v[k + 1][i] - out->v[0][i];
            }
            out->size = fmax(out->size, sqrt(dot3(e[k], e[k])));
        }
        cross3(e[0], e[1], out->normal);
        if (unit3(out->normal)) {
            return true;
        }
    }
    return false;
}

static void edge_of(const place *p, int k, double out[3])
{
    for (int i = 0; i < 3; ++i) {
        out[i] = p->v[(k + 1) % 3][i] - p->v[k][i];
    }
}

static void set_eye(draft *d, const double at[3])
{
    memcpy(d->eye, at, sizeof d->eye);
}

static void on_vertex(draft *d, const place *p)
{
    set_eye(d, p->v[0]);
    look(d, between(d, 0.0, 2.0 * PI), between(d, -1.0, 1.0));
}

static void on_edge(draft *d, const place *p)
{
    double e[3], share = below(d, 2) ? 0.5 : between(d, 0.0, 1.0);
    edge_of(p, 0, e);
    set_eye(d, p->v[0]);
    add3(d->eye, share, e);
    look(d, between(d, 0.0, 2.0 * PI), between(d, -1.0, 1.0));
}

static void on_face(draft *d, const place *p)
{
    double any[3];
    set_eye(d, p->middle);
    random_unit(d, any);
    look_along(d, any);
}

/* A hair in front of a face or behind it, looking away from it, at it or past it. */
static void before_face(draft *d, const place *p)
{
    double any[3];
    set_eye(d, p->middle);
    add3(d->eye, (below(d, 4) ? 1.0 : -1.0) * p->size * magnitude(d, 1e-12, 1e-1), p->normal);
    random_unit(d, any);
    look_along(d, any);
    d->near_depth = p->size * magnitude(d, 1e-9, 1e-2);
}

static void at_box_corner(draft *d, const place *p)
{
    for (int i = 0; i < 3; ++i) {
        d->eye[i] = below(d, 2) ? p->box.min[i] : p->box.max[i];
    }
    look(d, between(d, 0.0, 2.0 * PI), between(d, -1.0, 1.0));
}

static void inside_box(draft *d, const place *p)
{
    for (int i = 0; i < 3; ++i) {
        d->eye[i] = between(d, p->box.min[i], p->box.max[i]);
    }
    look(d, between(d, 0.0, 2.0 * PI), between(d, -0.5, 0.5));
}

/* The eye in the plane of a face, looking along it. */
static void along_face(draft *d, const place *p)
{
    double e[3];
    edge_of(p, (int)below(d, 3), e);
    set_eye(d, p->middle);
    add3(d->eye, -magnitude(d, 0.1, 30.0), e);
    add3(d->eye, below(d, 2) ? 0.0 : p->size * between(d, -1e-7, 1e-7), p->normal);
    memcpy(d->target, p->middle, sizeof d->target);
}

/* The eye on the line through an edge: its ends fall together in the picture. */
static void along_edge(draft *d, const place *p)
{
    double e[3];
    edge_of(p, 0, e);
    set_eye(d, p->v[0]);
    add3(d->eye, -exp2(floor(between(d, -2.0, 5.0))), e);
    memcpy(d->target, p->v[1], sizeof d->target);
    d->fov = below(d, 2) ? d->fov : magnitude(d, 1e-3, 0.3);
}

/* Stand somewhere around a place and look at a point of it. */
static void look_at_place(draft *d, const place *p, const double point[3], double low, double high)
{
    double any[3];
    random_unit(d, any);
    set_eye(d, p->middle);
    add3(d->eye, fmax(p->size, 1e-6 * d->size) * magnitude(d, low, high), any);
    memcpy(d->target, point, sizeof d->target);
}

static void near_at_vertex(draft *d, const place *p)
{
    double depth = 0.0, length = 0.0;
    look_at_place(d, p, p->v[0], 0.2, 20.0);
    for (int i = 0; i < 3; ++i) {
        double f = d->target[i] - d->eye[i];
        depth += f * (p->v[below(d, 3)][i] - d->eye[i]);
        length += f * f;
    }
    d->near_depth = fmax(depth / sqrt(length), 1e-6);
}

static void near_cuts(draft *d, const place *p)
{
    look_at_place(d, p, p->middle, 0.01, 3.0);
    double e[3];
    for (int i = 0; i < 3; ++i) {
        e[i] = d->target[i] - d->eye[i];
    }
    d->near_depth = sqrt(dot3(e, e)) * between(d, 0.3, 1.2) + 1e-9;
}

static void widest(draft *d, const place *p)
{
    look_at_place(d, p, p->middle, 0.3, 20.0);
    d->fov = between(d, 150.0, 170.0) * PI / 180.0;
    d->aspect = magnitude(d, 0.2, 5.0);
}

static void narrowest(draft *d, const place *p)
{
    look_at_place(d, p, p->v[0], 2.0, 1000.0);
    d->fov = magnitude(d, 1e-5, 1e-2);
}

static void long_picture(draft *d, const place *p)
{
    look_at_place(d, p, p->v[0], 0.5, 30.0);
    d->aspect = below(d, 2) ? 60.0 : 1.0 / 60.0;
    d->fov = below(d, 2) ? 0.05 : 1.0;
}

/* Parallel lines along an axis, the picture's edges and pixel corners on vertices. */
static void parallel_on_vertex(draft *d, const place *p)
{
    set_eye(d, p->v[0]);
    look_along(d, below(d, 3) == 0 ? d->up : d->across[below(d, 2)]);
    d->height = p->size * exp2(floor(between(d, -2.0, 6.0)));
    d->near_depth = below(d, 2) ? 0.0 : -d->size;
    d->aspect = 1.0;
}

static void parallel_along_face(draft *d, const place *p)
{
    double e[3];
    edge_of(p, (int)below(d, 3), e);
    set_eye(d, p->middle);
    look_along(d, e);
    memcpy(d->roof, p->normal, sizeof d->roof);
    d->height = p->size * magnitude(d, 0.1, 50.0);
    d->near_depth = -magnitude(d, 0.01, 1.0) * d->size;
}

static void rolled(draft *d, const place *p)
{
    double ahead[3], aside[3];
    look_at_place(d, p, p->middle, 0.5, 50.0);
    look(d, between(d, 0.0, 2.0 * PI), between(d, -0.3, 0.3));
    for (int i = 0; i < 3; ++i) {
        ahead[i] = d->target[i] - d->eye[i];
    }
    cross3(ahead, d->up, aside);
    (void)unit3(aside);
    double eighths = 1.0 + below(d, 7), angle = eighths * PI / 4.0;
    for (int i = 0; i < 3; ++i) {
        d->roof[i] = cos(angle) * d->up[i] + sin(angle) * aside[i];
    }
}

static void straight(draft *d, const place *p)
{
    look_at_place(d, p, p->middle, 0.2, 50.0);
    look_along(d, d->up);
    for (int i = 0; i < 3 && below(d, 2) != 0; ++i) {
        d->target[i] = 2.0 * d->eye[i] - d->target[i];
    }
}

/* From thousands of times the scene's size away; half of the near planes right before the scene. */
static void far_away(draft *d, const place *p)
{
    double any[3], away = d->size * magnitude(d, 10.0, 1e6);
    random_unit(d, any);
    set_eye(d, p->middle);
    add3(d->eye, away, any);
    memcpy(d->target, p->middle, sizeof d->target);
    d->fov = magnitude(d, 1e-3, 1.0) * d->size / away;
    d->near_depth = below(d, 4) ? away - d->size : 0.5 * away;
}

static void off_centre(draft *d, const place *p)
{
    look_at_place(d, p, p->v[1], 0.5, 30.0);
    d->shift[0] = between(d, -3.0, 3.0);
    d->shift[1] = between(d, -1.0, 1.0);
}

static void more_planes(draft *d, const place *p)
{
    look_at_place(d, p, p->middle, 0.5, 50.0);
    d->planes = 1 + below(d, UMB_MAX_CLIP_PLANES);
    memcpy(d->planes_at, p->v[0], sizeof d->planes_at);
}

/* The eye on the line through two vertices of two objects, so that one is exactly behind the other. */
static void two_in_line(draft *d, const place *p)
{
    place q;
    if (!pick(d, &q)) {
        q = *p;
    }
    set_eye(d, p->v[0]);
    for (int i = 0; i < 3; ++i) {
        d->eye[i] += exp2(floor(between(d, -6.0, 1.0))) * (p->v[0][i] - q.v[0][i]);
    }
    memcpy(d->target, p->v[0], sizeof d->target);
    d->fov = magnitude(d, 1e-3, 1.0);
}

/* Through the touching faces of a box and what lies beside it. */
static void through_seam(draft *d, const place *p)
{
    double point[3];
    for (int i = 0; i < 3; ++i) {
        point[i] = below(d, 2) ? p->box.min[i] : p->box.max[i];
    }
    look_at_place(d, p, point, 0.5, 100.0);
    d->fov = magnitude(d, 1e-4, 1.0);
}

/* Axes to the bit, the eye on whole coordinates of vertices. */
static void along_axes(draft *d, const place *p)
{
    uint32_t axis = below(d, 3);
    for (int i = 0; i < 3; ++i) {
        d->eye[i] = p->v[below(d, 3)][i];
    }
    memcpy(d->target, d->eye, sizeof d->eye);
    double reach = below(d, 2) ? 4.0 : -4.0;
    d->eye[axis] -= reach * fmax(1.0, floor(p->size));
    d->target[axis] = d->eye[axis] + reach;
    memset(d->roof, 0, sizeof d->roof);
    d->roof[(axis + 1 + below(d, 2)) % 3] = below(d, 2) ? 1.0 : -1.0;
    d->fov = 2.0 * atan(below(d, 2) ? 1.0 : 0.5);
    d->aspect = below(d, 2) ? 1.0 : 2.0;
}

typedef struct adversary {
    const char *name;
    void (*make)(draft *d, const place *p);
} adversary;

static const adversary ADVERSARIES[] = {
    {"eye on a vertex", on_vertex},
    {"eye on an edge", on_edge},
    {"eye on a face", on_face},
    {"a hair before a face", before_face},
    {"eye on a box's corner", at_box_corner},
    {"eye inside a box", inside_box},
    {"along a face", along_face},
    {"along an edge", along_edge},
    {"near plane at a vertex", near_at_vertex},
    {"near plane through things", near_cuts},
    {"170 degrees wide", widest},
    {"very narrow", narrowest},
    {"picture 60 times as long", long_picture},
    {"parallel, on a vertex", parallel_on_vertex},
    {"parallel, along a face", parallel_along_face},
    {"rolled by eighths", rolled},
    {"straight up or down", straight},
    {"from far away", far_away},
    {"off-centre", off_centre},
    {"extra planes", more_planes},
    {"two vertices in line", two_in_line},
    {"through a seam", through_seam},
    {"along the axes", along_axes},
};
enum { ADVERSARY_COUNT = sizeof ADVERSARIES / sizeof ADVERSARIES[0] };

const char *soak_view_kind(uint64_t number)
{
    return ADVERSARIES[number % ADVERSARY_COUNT].name;
}

bool soak_view_adversarial(const model *m, uint64_t number, umb_view *out)
{
    for (uint64_t k = 0; k < TRIES && m->object_count != 0; ++k) {
        draft d;
        place p;
        draft_start(&d, m, number + (k << 40), 0xbad5eed);
        if (!pick(&d, &p)) {
            return false;
        }
        d.near_depth = fmax(p.size * magnitude(&d, 1e-5, 0.1), 1e-9);
        d.far_depth = below(&d, 4) ? INFINITY : d.near_depth + d.size * magnitude(&d, 0.01, 1.0);
        ADVERSARIES[number % ADVERSARY_COUNT].make(&d, &p);
        if (draft_finish(&d, out)) {
            return true;
        }
    }
    return false;
}

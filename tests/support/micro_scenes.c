#include "micro_scenes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

typedef struct rng {
    uint64_t state;
} rng;

static uint64_t next(rng *r)
{
    uint64_t z = r->state += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

static double unit(rng *r)
{
    return (double)(next(r) >> 11) * 0x1p-53;
}

static double between(rng *r, double low, double high)
{
    return low + (high - low) * unit(r);
}

/* Spread evenly over the magnitudes between low and high. */
static double scale_between(rng *r, double low, double high)
{
    return exp(between(r, log(low), log(high)));
}

static uint32_t below(rng *r, uint32_t n)
{
    return (uint32_t)(next(r) % n);
}

typedef struct builder {
    rng random;
    model *model;
    bool ok;
} builder;

static const uint32_t BOX_INDICES[36] = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                                         2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};

static uint32_t add_mesh(builder *b, float *positions, uint32_t vertices, uint32_t *indices,
                         uint32_t triangles, uint8_t flag)
{
    uint8_t *flags = malloc(triangles + 1);
    if (flags == NULL) {
        b->ok = false;
        return MODEL_NONE;
    }
    memset(flags, flag, triangles);
    model_mesh mesh = {positions, indices, flags, vertices, triangles};
    uint32_t id = model_add_mesh(b->model, &mesh);
    free(flags);
    b->ok = b->ok && id != MODEL_NONE;
    return id;
}

static void place(builder *b, uint32_t mesh, const double m[3][4])
{
    umb_transform t;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 4; ++j) {
            t.m[i][j] = (float)m[i][j];
        }
    }
    b->ok = b->ok && model_add_object(b->model, "micro", mesh, &t) != MODEL_NONE;
}

/* A rotation, any angle about any axis, times sizes, with a translation. */
static void random_frame(rng *r, const double size[3], const double at[3], bool turned,
                         double m[3][4])
{
    double q[4], n = 0;
    for (int i = 0; i < 4; ++i) {
        q[i] = between(r, -1, 1);
        n += q[i] * q[i];
    }
    for (int i = 0; i < 4; ++i) {
        q[i] = turned && n > 1e-6 ? q[i] / sqrt(n) : i == 3;
    }
    double x = q[0], y = q[1], z = q[2], w = q[3];
    double rot[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                        {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                        {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            m[i][j] = rot[i][j] * size[j];
        }
        m[i][3] = at[i];
    }
}

static uint32_t unit_box(builder *b, uint8_t flag)
{
    float p[24];
    uint32_t indices[36];
    for (int k = 0; k < 8; ++k) {
        for (int i = 0; i < 3; ++i) {
            p[3 * k + i] = (k >> i & 1) != 0 ? 0.5f : -0.5f;
        }
    }
    memcpy(indices, BOX_INDICES, sizeof indices);
    return add_mesh(b, p, 8, indices, 12, flag);
}

/* A wall in the plane z = 0, -0.5 .. 0.5, facing +z, of n x n quads. */
static uint32_t unit_wall(builder *b, uint32_t n, uint8_t flag)
{
    float *p = malloc(sizeof(float) * 3 * (n + 1) * (n + 1));
    uint32_t *indices = malloc(sizeof(uint32_t) * 6 * n * n);
    uint32_t id = MODEL_NONE, at = 0;
    if (p != NULL && indices != NULL) {
        for (uint32_t j = 0; j <= n; ++j) {
            for (uint32_t i = 0; i <= n; ++i) {
                float *v = p + 3 * (j * (n + 1) + i);
                v[0] = (float)i / (float)n - 0.5f;
                v[1] = (float)j / (float)n - 0.5f;
                v[2] = 0.0f;
            }
        }
        for (uint32_t j = 0; j < n; ++j) {
            for (uint32_t i = 0; i < n; ++i) {
                uint32_t a = j * (n + 1) + i, c = a + n + 1;
                uint32_t quad[6] = {a, a + 1, c + 1, a, c + 1, c};
                memcpy(indices + at, quad, sizeof quad);
                at += 6;
            }
        }
        id = add_mesh(b, p, (n + 1) * (n + 1), indices, at / 3, flag);
    }
    b->ok = b->ok && id != MODEL_NONE;
    free(p);
    free(indices);
    return id;
}

/* A torus or a torn height field: not convex, with holes and folds. */
static uint32_t bent_sheet(builder *b, bool torus, uint8_t flag)
{
    enum { N = 14 };
    float p[N * N * 3];
    uint32_t indices[N * N * 6], count = 0;
    for (uint32_t j = 0; j < N; ++j) {
        for (uint32_t i = 0; i < N; ++i) {
            float *v = p + 3 * (j * N + i);
            double s = 2 * PI * i / N, t = 2 * PI * j / N;
            v[0] = (float)(torus ? cos(s) * (0.35 + 0.14 * cos(t)) : (double)i / (N - 1) - 0.5);
            v[1] = (float)(torus ? sin(s) * (0.35 + 0.14 * cos(t)) : (double)j / (N - 1) - 0.5);
            v[2] = (float)(torus ? 0.14 * sin(t) : between(&b->random, -0.1, 0.1));
        }
    }
    uint32_t last = torus ? N : N - 1;
    for (uint32_t j = 0; j < last; ++j) {
        for (uint32_t i = 0; i < last; ++i) {
            uint32_t a = j * N + i, right = j * N + (i + 1) % N;
            uint32_t up = (j + 1) % N * N + i, both = (j + 1) % N * N + (i + 1) % N;
            if (!torus && below(&b->random, 20) == 0) {
                continue;
            }
            uint32_t quad[6] = {a, right, both, a, both, up};
            memcpy(indices + count, quad, sizeof quad);
            count += 6;
        }
    }
    return add_mesh(b, p, N * N, indices, count / 3, flag);
}

static void add_box(builder *b, uint32_t mesh, const double at[3], const double size[3], bool turned)
{
    double m[3][4];
    random_frame(&b->random, size, at, turned, m);
    place(b, mesh, m);
}

/* Things behind, to be hidden or not. The eye looks along -z from about the origin. */
static void add_targets(builder *b, uint32_t box, uint32_t count, double near_z, double far_z,
                        double spread)
{
    for (uint32_t i = 0; i < count; ++i) {
        double z = scale_between(&b->random, near_z, far_z);
        double at[3] = {between(&b->random, -spread, spread) * z,
                        between(&b->random, -spread, spread) * z, -z};
        double s = scale_between(&b->random, 0.003, 0.2) * z;
        double size[3] = {s * between(&b->random, 0.2, 1), s * between(&b->random, 0.2, 1),
                          s * between(&b->random, 0.2, 1)};
        add_box(b, box, at, size, below(&b->random, 2) != 0);
    }
}

static void make_boxes(builder *b)
{
    uint32_t box = unit_box(b, 0);
    uint32_t walls = 1 + below(&b->random, 6);
    for (uint32_t i = 0; i < walls; ++i) {
        double z = scale_between(&b->random, 0.3, 8);
        double at[3] = {between(&b->random, -0.5, 0.5) * z, between(&b->random, -0.5, 0.5) * z, -z};
        double size[3] = {z * scale_between(&b->random, 0.01, 1.5),
                          z * scale_between(&b->random, 0.01, 1.5),
                          z * scale_between(&b->random, 0.001, 0.5)};
        add_box(b, box, at, size, below(&b->random, 3) != 0);
    }
    add_targets(b, box, 24, 2, 30, 0.6);
}

/* Two walls with a slit between them, any roll, and a box right behind the slit. */
static void make_slit(builder *b)
{
    uint32_t box = unit_box(b, 0);
    double angle = between(&b->random, 0, 2 * PI), c = cos(angle), s = sin(angle);
    double slit = scale_between(&b->random, 1e-4, 3e-2), off = between(&b->random, -2, 2);
    for (int side = -1; side <= 1; side += 2) {
        double x = off + side * (6 + slit / 2);
        double m[3][4] = {{12 * c, -12 * s, 0, x * c}, {12 * s, 12 * c, 0, x * s}, {0, 0, 0.01, -10}};
        place(b, box, m);
    }
    double t = between(&b->random, -1, 1);
    double m[3][4] = {{2 * c, -2 * s, 0, 2 * (off * c - t * s)},
                      {2 * s, 2 * c, 0, 2 * (off * s + t * c)},
                      {0, 0, 0.5, -20}};
    place(b, box, m);
    add_targets(b, box, 6, 15, 40, 0.5);
}

static void make_needles(builder *b)
{
    uint32_t box = unit_box(b, 0);
    for (uint32_t i = 0; i < 20; ++i) {
        double z = scale_between(&b->random, 0.5, 10);
        double at[3] = {between(&b->random, -0.6, 0.6) * z, between(&b->random, -0.6, 0.6) * z, -z};
        double thin = scale_between(&b->random, 1e-6, 1e-2);
        double size[3] = {z * (below(&b->random, 2) != 0 ? 3 : thin), z * thin, z * thin};
        if (below(&b->random, 2) != 0) {
            size[1] = 2 * z; /* a sliver plate */
        }
        add_box(b, box, at, size, true);
    }
    add_targets(b, box, 16, 2, 30, 0.6);
}

static void make_meshes(builder *b)
{
    uint32_t box = unit_box(b, 0);
    for (uint32_t i = 0; i < 3; ++i) {
        uint8_t flag = below(&b->random, 3) == 0 ? UMB_TRIANGLE_TWO_SIDED : 0;
        uint32_t mesh = bent_sheet(b, below(&b->random, 2) != 0, flag);
        double z = scale_between(&b->random, 0.4, 5);
        double at[3] = {between(&b->random, -0.3, 0.3) * z, between(&b->random, -0.3, 0.3) * z, -z};
        double s = z * scale_between(&b->random, 0.5, 4);
        double mirror = below(&b->random, 2) != 0 ? -s : s;
        double size[3] = {mirror, s, s};
        add_box(b, mesh, at, size, true);
    }
    add_targets(b, box, 24, 2, 30, 0.5);
}

/* Static walls that meet exactly, from pieces; some pieces missing; T-junctions on a dyadic
 * grid. */
static void make_seams(builder *b)
{
    uint32_t box = unit_box(b, 0);
    uint32_t wall = unit_wall(b, 1 + below(&b->random, 3), below(&b->random, 4) == 0);
    for (uint32_t j = 0; j < 6; ++j) {
        bool shifted = below(&b->random, 2) != 0;
        for (uint32_t i = 0; i < 6; ++i) {
            if (below(&b->random, 12) == 0) {
                continue;
            }
            double x = (i - 2.5) * 0.5 + (shifted ? 0.25 : 0), y = (j - 2.5) * 0.5;
            double m[3][4] = {{0.5, 0, 0, x}, {0, 0.5, 0, y}, {0, 0, 1, -1.5}};
            place(b, wall, m);
        }
    }
    for (uint32_t i = 0; i < 8; ++i) { /* a floor of boxes that touch */
        double m[3][4] = {{0.5, 0, 0, (i - 3.5) * 0.5}, {0, 0.25, 0, -1}, {0, 0, 0.5, -1.75}};
        place(b, box, m);
    }
    add_targets(b, box, 24, 1.8, 20, 0.6);
}

/* Huge and tiny together, far from even scales. */
static void make_scales(builder *b)
{
    uint32_t box = unit_box(b, 0);
    for (uint32_t i = 0; i < 8; ++i) {
        double z = scale_between(&b->random, 0.2, 1e4);
        double at[3] = {between(&b->random, -1, 1) * z, between(&b->random, -1, 1) * z, -z};
        double s = scale_between(&b->random, 1e-4, 1e5);
        double size[3] = {s, s * scale_between(&b->random, 1e-3, 1),
                          s * scale_between(&b->random, 1e-3, 1)};
        add_box(b, box, at, size, below(&b->random, 2) != 0);
    }
    add_targets(b, box, 24, 1, 2e4, 0.6);
}

/* Faces in one plane, boxes that share faces, equal boxes, flat boxes, zero-size objects. */
static void make_coplanar(builder *b)
{
    uint32_t box = unit_box(b, 0), wall = unit_wall(b, 2, 0);
    for (uint32_t i = 0; i < 12; ++i) {
        double s = 0.25 * (1 + below(&b->random, 4));
        double x = 0.25 * below(&b->random, 8) - 1, y = 0.25 * below(&b->random, 8) - 1;
        double z = -1 - 0.25 * below(&b->random, 6);
        double m[3][4] = {{s, 0, 0, x}, {0, s, 0, y}, {0, 0, 0.25 * below(&b->random, 3), z}};
        place(b, below(&b->random, 3) == 0 ? wall : box, m);
    }
    add_targets(b, box, 16, 2, 20, 0.5);
    double point[3][4] = {{0, 0, 0, 0.1}, {0, 0, 0, 0.1}, {0, 0, 0, -4}};
    place(b, box, point);
}

/* Triangles without rule: degenerate ones, inverted ones, all flags. */
static void make_soup(builder *b)
{
    uint32_t box = unit_box(b, 0);
    for (uint32_t k = 0; k < 4; ++k) {
        float p[30 * 3];
        uint32_t indices[60];
        for (uint32_t i = 0; i < 90; ++i) {
            p[i] = (float)between(&b->random, -1, 1);
        }
        for (uint32_t i = 0; i < 60; ++i) {
            indices[i] = below(&b->random, 30);
        }
        uint32_t mesh = add_mesh(b, p, 30, indices, 20, (uint8_t)below(&b->random, 4));
        double z = scale_between(&b->random, 0.5, 6);
        double at[3] = {between(&b->random, -0.4, 0.4) * z, between(&b->random, -0.4, 0.4) * z, -z};
        double size[3] = {z, z, z * scale_between(&b->random, 1e-3, 1)};
        add_box(b, mesh, at, size, true);
    }
    add_targets(b, box, 20, 1, 20, 0.6);
}

/* Around the eye: walls that the near depth cuts, boxes that hold the eye. */
static void make_near(builder *b)
{
    uint32_t box = unit_box(b, 0),
             wall = unit_wall(b, 3, below(&b->random, 2) != 0 ? UMB_TRIANGLE_TWO_SIDED : 0);
    for (uint32_t i = 0; i < 5; ++i) {
        double at[3] = {between(&b->random, -0.3, 0.3), between(&b->random, -0.3, 0.3),
                        between(&b->random, -0.6, 0.2)};
        double s = scale_between(&b->random, 0.05, 5);
        double size[3] = {s, s * scale_between(&b->random, 0.05, 1),
                          s * scale_between(&b->random, 0.01, 1)};
        add_box(b, below(&b->random, 2) != 0 ? wall : box, at, size, true);
    }
    add_targets(b, box, 24, 0.5, 20, 0.6);
}

typedef struct kind {
    const char *name;
    void (*make)(builder *b);
    bool weld;
} kind;

static const kind KINDS[] = {
    {"boxes", make_boxes, false},      {"slit", make_slit, false},
    {"needles", make_needles, false},  {"meshes", make_meshes, false},
    {"seams", make_seams, true},       {"scales", make_scales, false},
    {"coplanar", make_coplanar, true}, {"soup", make_soup, true},
    {"near", make_near, false},        {"coplanar-loose", make_coplanar, false},
};

uint32_t micro_scene_kinds(void)
{
    return sizeof KINDS / sizeof KINDS[0];
}

/* An eye near the origin looking about -z; sometimes exactly on a vertex, a face or a box
 * corner. */
static void make_view(rng *r, const model *m, umb_view *view)
{
    double eye[3] = {between(r, -0.05, 0.05), between(r, -0.05, 0.05), between(r, -0.05, 0.05)};
    double target[3] = {between(r, -0.3, 0.3), between(r, -0.3, 0.3), -1};
    uint32_t special = below(r, 10);
    if (special == 0) {
        const model_object *o = &m->objects[below(r, m->object_count)];
        float v[3];
        model_world_vertex(m, o, below(r, m->meshes[o->mesh].position_count), v);
        for (int i = 0; i < 3; ++i) {
            eye[i] = v[i];
        }
    } else if (special == 1) {
        const model_object *o = &m->objects[below(r, m->object_count)];
        for (int i = 0; i < 3; ++i) {
            eye[i] = below(r, 2) != 0 ? o->bounds.min[i] : o->bounds.max[i];
        }
    } else if (special == 2) {
        memset(eye, 0, sizeof eye);
        target[0] = target[1] = 0;
    }
    if (special < 2) {
        for (int i = 0; i < 3; ++i) {
            target[i] += eye[i];
        }
    }
    double roll = below(r, 3) == 0 ? between(r, 0, 2 * PI) : 0.0;
    double up[3] = {sin(roll), cos(roll), 0};
    double near_depth = scale_between(r, 0.01, 0.4), far_depth = below(r, 4) == 0 ? INFINITY : 1e5;
    if (below(r, 4) == 0) {
        (void)umb_view_look_at_ortho(view, eye, target, up, scale_between(r, 0.5, 10),
                                     between(r, 0.5, 2), near_depth, 1e5);
    } else {
        (void)umb_view_look_at(view, eye, target, up, between(r, 0.2, 2.4), between(r, 0.5, 2),
                               near_depth, far_depth);
    }
    view->width = 96;
    view->height = 96;
}

/* The view's own up to begin with, rolled or not; then one that is not the view's, none, any at all. */
static void choose_vertical(uint64_t i, umb_view *view)
{
    rng r = {i * 0x9E3779B97F4A7C15u + 11};
    const double upright[3] = {0, 1, 0}, none[3] = {0}, any[3] = {between(&r, -1, 1), between(&r, -1, 1),
                                                                  between(&r, -1, 1)};
    const double *choice[4] = {view->vertical, upright, none, any};
    memmove(view->vertical, choice[i % 4], sizeof none);
}

bool micro_scene_make(uint64_t i, micro_scene *out)
{
    const kind *k = &KINDS[i % micro_scene_kinds()];
    builder b = {.random = {i * 0xD1342543DE82EF95u + 7}, .model = model_create(), .ok = true};
    *out = (micro_scene){.kind = k->name, .weld = k->weld};
    if (b.model == NULL) {
        return false;
    }
    k->make(&b);
    if (!b.ok || !model_finish(b.model, NULL, NULL)) {
        model_free(b.model);
        return false;
    }
    out->model = b.model;
    make_view(&b.random, b.model, &out->view);
    choose_vertical(i / micro_scene_kinds(), &out->view);
    return true;
}

void micro_scene_free(micro_scene *s)
{
    model_free(s->model);
    s->model = NULL;
}

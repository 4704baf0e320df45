#include "patch_scenes.h"

#include <math.h>
#include <string.h>

#include "random_boxes.h"

enum { SIDE = 5, CORNERS = (SIDE + 1) * (SIDE + 1), TARGETS = 16 };

typedef struct builder {
    uint64_t seed;
    model *model;
    bool ok;
} builder;

static uint32_t below(builder *b, uint32_t n)
{
    return random_below(&b->seed, n);
}

static int between(builder *b, int low, int high)
{
    return low + (int)below(b, (uint32_t)(high - low + 1));
}

static uint8_t some_flag(builder *b)
{
    return below(b, 4) == 0 ? UMB_TRIANGLE_TWO_SIDED : 0;
}

static void add_mesh(builder *b, float (*corners)[3], uint32_t corner_count, uint32_t *indices, uint32_t triangles,
                     uint8_t flag)
{
    static const umb_transform identity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    uint8_t flags[2 * SIDE * SIDE];
    memset(flags, flag, sizeof flags);
    model_mesh mesh = {corners[0], indices, flags, corner_count, triangles};
    uint32_t id = b->ok && triangles > 0 ? model_add_mesh(b->model, &mesh) : MODEL_NONE;
    b->ok = b->ok && (triangles == 0 || (id != MODEL_NONE &&
                                         model_add_object(b->model, "patch", id, &identity) != MODEL_NONE));
}

static void add_box(builder *b, const int low[3], const int size[3])
{
    static const uint32_t quads[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    float corners[8][3];
    uint32_t indices[36], n = 0;
    for (int k = 0; k < 8; ++k) {
        for (int i = 0; i < 3; ++i) {
            corners[k][i] = (float)(low[i] + (k >> i & 1 ? size[i] : 0));
        }
    }
    for (int q = 0; q < 6; ++q) {
        const uint32_t cut[6] = {quads[q][0], quads[q][1], quads[q][2], quads[q][0], quads[q][2], quads[q][3]};
        memcpy(indices + n, cut, sizeof cut);
        n += 6;
    }
    add_mesh(b, corners, 8, indices, 12, 0);
}

/* A convex polygon: a lattice one, in a plane that two lattice vectors span. */
static void add_polygon(builder *b)
{
    static const int shapes[5][6][2] = {{{0, 0}, {2, 0}, {0, 2}},
                                        {{0, 0}, {2, 0}, {2, 2}, {0, 2}},
                                        {{0, 0}, {2, 0}, {3, 1}, {2, 2}, {0, 2}},
                                        {{1, 0}, {2, 0}, {3, 1}, {2, 2}, {1, 2}, {0, 1}},
                                        {{0, 0}, {3, 0}, {2, 1}, {1, 1}}};
    static const uint32_t counts[5] = {3, 4, 5, 6, 4};
    uint32_t k = below(b, 5), indices[12], n = 0;
    float corners[6][3];
    int at[3] = {between(b, -6, 3), between(b, -6, 3), between(b, -9, -2)};
    int u[3] = {between(b, -2, 3), between(b, -1, 1), between(b, -1, 1)};
    int v[3] = {between(b, -1, 1), between(b, -2, 3), between(b, -1, 1)};
    for (uint32_t c = 0; c < counts[k]; ++c) {
        for (int i = 0; i < 3; ++i) {
            corners[c][i] = (float)(at[i] + shapes[k][c][0] * u[i] + shapes[k][c][1] * v[i]);
        }
        if (c >= 2) {
            const uint32_t cut[3] = {0, c - 1, c};
            memcpy(indices + n, cut, sizeof cut);
            n += 3;
        }
    }
    add_mesh(b, corners, counts[k], indices, n / 3, some_flag(b));
}

static void add_polygons(builder *b)
{
    for (int n = between(b, 2, 10); n > 0; --n) {
        add_polygon(b);
    }
}

/* Quads that share edges: flat, bent like a book along one axis, or with any height at each corner; some are missing, so
 * that the outline has dents and holes. One mesh, or a mesh for each row. */
static void add_patches(builder *b)
{
    float corners[CORNERS][3];
    uint32_t indices[6 * SIDE * SIDE], n = 0;
    int at[3] = {between(b, -7, 0), between(b, -7, 0), between(b, -8, -3)};
    int width = between(b, 1, 2), height = between(b, 1, 2), gaps = between(b, 0, 2), folds[SIDE + 1];
    uint32_t bend = below(b, 3);
    uint8_t flag = some_flag(b);
    bool apart = below(b, 3) == 0;
    for (int i = 0; i <= SIDE; ++i) {
        folds[i] = between(b, -1, 1);
    }
    for (int k = 0; k < CORNERS; ++k) {
        int column = k % (SIDE + 1), row = k / (SIDE + 1);
        corners[k][0] = (float)(at[0] + width * column);
        corners[k][1] = (float)(at[1] + height * row);
        corners[k][2] = (float)(at[2] + (bend == 0 ? 0 : bend == 1 ? folds[column] : between(b, -1, 1)));
    }
    for (uint32_t k = 0; k < SIDE * SIDE; ++k) {
        uint32_t a = k % SIDE + k / SIDE * (SIDE + 1), up = a + SIDE + 1;
        const uint32_t cut[6] = {a, a + 1, up + 1, a, up + 1, up};
        if (gaps == 0 || below(b, gaps == 1 ? 12 : 4) != 0) {
            memcpy(indices + n, cut, sizeof cut);
            n += 6;
        }
        if (apart && k % SIDE == SIDE - 1) {
            add_mesh(b, corners, CORNERS, indices, n / 3, flag);
            n = 0;
        }
    }
    add_mesh(b, corners, CORNERS, indices, n / 3, flag);
}

/* Triangles around a corner: a pyramid without its base, a fan, or a part of one; the corner towards the eye or away. */
static void add_fan(builder *b)
{
    static const int rim[8][2] = {{2, 0}, {2, 2}, {0, 2}, {-2, 2}, {-2, 0}, {-2, -2}, {0, -2}, {2, -2}};
    float corners[9][3];
    uint32_t indices[24], n = 0;
    int at[3] = {between(b, -4, 4), between(b, -4, 4), between(b, -8, -3)}, tip = between(b, -2, 2), scale = between(b, 1, 2);
    for (int k = 0; k < 8; ++k) {
        corners[k][0] = (float)(at[0] + scale * rim[k][0]);
        corners[k][1] = (float)(at[1] + scale * rim[k][1]);
        corners[k][2] = (float)at[2];
    }
    for (int i = 0; i < 3; ++i) {
        corners[8][i] = (float)(at[i] + (i == 2 ? tip : 0));
    }
    for (uint32_t k = 0; k < 8; ++k) {
        const uint32_t cut[3] = {8, k, (k + 1) % 8};
        if (below(b, 6) != 0) {
            memcpy(indices + n, cut, sizeof cut);
            n += 3;
        }
    }
    add_mesh(b, corners, 9, indices, n / 3, some_flag(b));
}

static void add_sheets(builder *b)
{
    for (int n = between(b, 1, 2); n > 0; --n) {
        add_patches(b);
    }
}

static void add_fans(builder *b)
{
    for (int n = between(b, 1, 4); n > 0; --n) {
        add_fan(b);
    }
}

/* Boxes one after the other: each begins at a face, an edge or a corner of the last. */
static void add_blocks(builder *b)
{
    int low[3] = {between(b, -6, 0), between(b, -6, 0), between(b, -8, -4)};
    for (int n = between(b, 2, 8); n > 0; --n) {
        int size[3] = {between(b, 1, 5), between(b, 1, 5), between(b, 1, 3)};
        add_box(b, low, size);
        uint32_t axis = below(b, 3), other = below(b, 4);
        low[axis] += size[axis];
        low[axis] = low[axis] > 5 ? -6 : low[axis];
        low[2] = low[2] > -2 ? -8 : low[2];
        if (other < 3 && other != axis) {
            low[other] = below(b, 2) != 0 ? low[other] + size[other] : low[other] - 1;
        }
    }
}

static void add_all(builder *b)
{
    add_polygons(b);
    add_patches(b);
    add_blocks(b);
}

/* What may be hidden: boxes, some flat, some in the planes of what is there. */
static void add_targets(builder *b)
{
    for (int n = 0; n < TARGETS; ++n) {
        int low[3] = {between(b, -12, 10), between(b, -12, 10), between(b, -20, -3)};
        int size[3] = {between(b, 0, 3), between(b, 0, 3), between(b, 0, 3)};
        size[below(b, 3)] += 1;
        size[0] += size[0] + size[1] == 0; /* two of them at least, or it has no area */
        size[2] += size[1] + size[2] == 0;
        size[2] += size[0] + size[2] == 0;
        add_box(b, low, size);
    }
}

typedef struct kind {
    const char *name;
    void (*make)(builder *b);
} kind;

static const kind KINDS[] = {{"polygons", add_polygons}, {"sheets", add_sheets}, {"fans", add_fans},
                             {"touching blocks", add_blocks}, {"all of it", add_all}};

uint32_t patch_scene_kinds(void)
{
    return sizeof KINDS / sizeof KINDS[0];
}

/* Anywhere on the lattice before the scene; every other eye lies in the plane of a triangle, exactly. */
static void place_eye(builder *b, double eye[3])
{
    const model_mesh *mesh = &b->model->meshes[b->model->objects[below(b, b->model->object_count)].mesh];
    for (int i = 0; i < 3; ++i) {
        eye[i] = between(b, i < 2 ? -4 : -1, 4);
    }
    if (below(b, 2) == 0) {
        const uint32_t *t = &mesh->indices[3 * below(b, mesh->triangle_count)];
        const float *p = &mesh->positions[3 * t[0]], *q = &mesh->positions[3 * t[1]], *r = &mesh->positions[3 * t[2]];
        int f = between(b, -4, 4), g = between(b, -4, 4);
        for (int i = 0; i < 3; ++i) {
            eye[i] = p[i] + f * (q[i] - p[i]) + g * (r[i] - p[i]);
        }
    }
}

static void make_view(builder *b, umb_view *view)
{
    static const double up[3] = {0, 1, 0};
    double eye[3], target[3];
    place_eye(b, eye);
    for (int i = 0; i < 3; ++i) {
        target[i] = i < 2 ? between(b, -3, 3) : -8;
    }
    target[2] -= target[2] == eye[2];
    if (below(b, 5) == 0) {
        target[0] = eye[0]; /* along an axis */
        target[1] = eye[1];
        (void)umb_view_look_at_ortho(view, eye, target, up, 24.0, 1.0, -32.0, 64.0);
    } else {
        (void)umb_view_look_at(view, eye, target, up, below(b, 2) == 0 ? 2.4 : 1.2, 1.0, 0x1p-6, 256.0);
    }
    view->width = view->height = 96;
    view->buffer_width = 256;
    view->buffer_height = 144;
}

bool patch_scene_make(uint64_t i, micro_scene *out)
{
    const kind *k = &KINDS[i % patch_scene_kinds()];
    builder b = {.seed = (i + 1) * 0x9E3779B97F4A7C15u | 1, .model = model_create(), .ok = true};
    *out = (micro_scene){.kind = k->name, .weld = below(&b, 2) == 0};
    if (b.model == NULL) {
        return false;
    }
    k->make(&b);
    add_targets(&b);
    if (!b.ok || !model_finish(b.model, NULL, NULL)) {
        model_free(b.model);
        return false;
    }
    out->model = b.model;
    make_view(&b, &out->view);
    return true;
}

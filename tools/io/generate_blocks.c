/* `blocks`: a published benchmark workload. G x G turned buildings on a square grid, each with
 * ten small boxes around it. Random numbers are drawn in one stream, so the order of the draws
 * is the recipe. Objects: buildings first (row by row), then props: id = G*G + 10 * building +
 * prop. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "generate_parts.h"

#define PITCH 18.0
#define PROPS 10
#define VIEWS 64
#define EYE_HEIGHT 1.7

static const double pi = 3.14159265358979323846;

typedef struct block_prop {
    float min[3], max[3];
} block_prop;

/* Meshes of props, shared: a unit cube that reaches up or down from 0 along x (bit 0) and z (bit
 * 1). */
typedef struct block_cubes {
    uint32_t mesh[4];
} block_cubes;

static void draw_building(generate_random *r, double cx, double cz, generate_mesh *g,
                          block_prop props[PROPS])
{
    double sx = 9.0 + 3.0 * generate_unit(r);
    double sz = 9.0 + 3.0 * generate_unit(r);
    double h = 5.0 + 35.0 * generate_unit(r);
    double yaw = (2.0 * generate_unit(r) - 1.0) * 30.0 * pi / 180.0;
    double c = cos(yaw), s = sin(yaw);
    uint32_t corners[8];
    for (int k = 0; k < 8; ++k) {
        double lx = k & 1 ? sx / 2 : -sx / 2;
        double ly = k & 2 ? h : 0.0;
        double lz = k & 4 ? sz / 2 : -sz / 2;
        corners[k] = generate_vertex(g, cx + c * lx + s * lz, ly, cz - s * lx + c * lz);
    }
    generate_box_faces(g, corners);

    for (int k = 0; k < PROPS; ++k) {
        double wx = 0.3 + 1.2 * generate_unit(r);
        double wy = 0.3 + 1.2 * generate_unit(r);
        double wz = 0.3 + 1.2 * generate_unit(r);
        double margin = 0.5 * sqrt(wx * wx + wz * wz);
        double px, pz, qx, qz;
        do {
            px = (2.0 * generate_unit(r) - 1.0) * 9.0;
            pz = (2.0 * generate_unit(r) - 1.0) * 9.0;
            qx = c * px - s * pz;
            qz = s * px + c * pz;
        } while (!(fabs(qx) > sx / 2 + margin || fabs(qz) > sz / 2 + margin));
        const double centre[3] = {cx + px, wy / 2, cz + pz}, size[3] = {wx, wy, wz};
        for (int i = 0; i < 3; ++i) {
            props[k].min[i] = (float)(centre[i] - size[i] / 2);
            props[k].max[i] = (float)(centre[i] + size[i] / 2);
        }
        props[k].min[1] = 0.0f;
        props[k].max[1] = (float)wy;
    }
}

static bool add_cubes(block_cubes *cubes, generate_mesh *g, model *m)
{
    for (int k = 0; k < 4; ++k) {
        const double min[3] = {k & 1 ? -1 : 0, 0, k & 2 ? -1 : 0};
        const double max[3] = {k & 1 ? 0 : 1, 1, k & 2 ? 0 : 1};
        generate_box(g, min, max);
        cubes->mesh[k] = generate_mesh_add(g, m);
        if (cubes->mesh[k] == MODEL_NONE) {
            return false;
        }
    }
    return true;
}

/* The recipe's floats must come out of the transform to the bit. Placing the cube's corner at
 * the end that is nearer to zero makes the sum at the other end round back in nearly every case;
 * where it does not, the prop gets a mesh of its own. */
static bool add_prop(model *m, generate_mesh *g, const block_cubes *cubes, const block_prop *p,
                     const char *name)
{
    umb_transform t = {{{0}}};
    uint32_t kind = 0;
    bool exact = true;
    for (int i = 0; i < 3; ++i) {
        bool high = fabsf(p->max[i]) < fabsf(p->min[i]);
        float anchor = high ? p->max[i] : p->min[i];
        float far_end = high ? p->min[i] : p->max[i];
        float size = (float)((double)p->max[i] - p->min[i]);
        double end = high ? (double)anchor - size : (double)anchor + size;
        exact = exact && (float)end == far_end;
        t.m[i][i] = size;
        t.m[i][3] = anchor;
        kind |= high ? (i == 0 ? 1u : 2u) : 0u;
    }
    if (exact) {
        return model_add_object(m, name, cubes->mesh[kind], &t) != MODEL_NONE;
    }
    const double min[3] = {p->min[0], p->min[1], p->min[2]};
    const double max[3] = {p->max[0], p->max[1], p->max[2]};
    generate_box(g, min, max);
    uint32_t mesh = generate_mesh_add(g, m);
    t = generate_translation(0, 0, 0);
    return mesh != MODEL_NONE && model_add_object(m, name, mesh, &t) != MODEL_NONE;
}

static bool add_all(uint32_t grid, model *m, generate_mesh *g, block_prop *props)
{
    generate_random r = {20240607};
    umb_transform identity = generate_translation(0, 0, 0);
    char name[48];
    for (uint32_t b = 0; b < grid * grid; ++b) {
        double cx = (b % grid + 0.5 - grid / 2.0) * PITCH;
        double cz = (b / grid + 0.5 - grid / 2.0) * PITCH;
        draw_building(&r, cx, cz, g, props + (size_t)b * PROPS);
        uint32_t mesh = generate_mesh_add(g, m);
        snprintf(name, sizeof name, "building %u", b);
        if (mesh == MODEL_NONE || model_add_object(m, name, mesh, &identity) == MODEL_NONE) {
            return false;
        }
    }
    block_cubes cubes;
    if (!add_cubes(&cubes, g, m)) {
        return false;
    }
    for (uint32_t p = 0; p < grid * grid * PROPS; ++p) {
        snprintf(name, sizeof name, "prop %u.%u", p / PROPS, p % PROPS);
        if (!add_prop(m, g, &cubes, props + p, name)) {
            return false;
        }
    }
    return true;
}

static bool blocks_model(const uint64_t *values, model *m)
{
    uint32_t grid = (uint32_t)values[0];
    generate_mesh g = {0};
    block_prop *props = malloc(sizeof *props * PROPS * grid * grid);
    bool ok = props && add_all(grid, m, &g, props);
    free(props);
    generate_mesh_free(&g);
    return ok;
}

static bool blocks_path(const uint64_t *values, camera_path *out)
{
    double q = (double)values[0] * PITCH / 4.0;
    for (uint32_t k = 0; k < VIEWS; ++k) {
        double eye[3] = {0.0, EYE_HEIGHT, 0.0};
        if (k < 32) {
            eye[2] = -q * (1.0 - k / 32.0);
        } else {
            eye[0] = q * (k - 32) / 32.0;
        }
        double turns = k * 0.6180339887498949;
        double yaw = 2.0 * pi * (turns - floor(turns));
        /* A far target keeps the direction to well under a rounding step of the eye. */
        const double target[3] = {eye[0] + 1000.0 * sin(yaw), eye[1], eye[2] - 1000.0 * cos(yaw)};
        if (!generate_look(out, eye, target)) {
            return false;
        }
    }
    return true;
}

const generate_kind generate_blocks = {"blocks", {{"g", 32, 1, 1000}}, blocks_model, blocks_path};

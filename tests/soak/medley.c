/* A medley: objects of all kinds in no order - turned boxes, walls of either sort, glass, bowls,
 * needles, loose triangles - in a wide slab, large ones among many small ones. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "soak.h"

#define PI 3.14159265358979323846
/* Floor area for each object, and the height of the slab: a line of sight ends after a few
 * hundred units. */
#define AREA 150.0
#define HEIGHT 60.0
#define BOWL 10

enum { BOX, WALL, SHEET, GLASS, BOWL_MESH, SOUP, MESHES };

static uint32_t add_mesh(model *m, float *p, uint32_t vertices, uint32_t *indices,
                         uint32_t triangles, uint8_t flag)
{
    uint8_t flags[256];
    memset(flags, flag, sizeof flags);
    model_mesh mesh = {p, indices, flags, vertices, triangles};
    return model_add_mesh(m, &mesh);
}

static uint32_t box_mesh(model *m)
{
    uint32_t indices[36] = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                            2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};
    float p[24];
    for (int k = 0; k < 24; ++k) {
        p[k] = (k / 3 >> k % 3 & 1) != 0 ? 0.5f : -0.5f;
    }
    return add_mesh(m, p, 8, indices, 12, 0);
}

static uint32_t wall_mesh(model *m, uint8_t flag)
{
    float p[12] = {-0.5f, -0.5f, 0.0f, 0.5f, -0.5f, 0.0f, 0.5f, 0.5f, 0.0f, -0.5f, 0.5f, 0.0f};
    uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    return add_mesh(m, p, 4, indices, 2, flag);
}

/* Half a sphere, open below, seen and blocking from outside. */
static uint32_t bowl_mesh(model *m)
{
    float p[(BOWL + 1) * BOWL * 3];
    uint32_t indices[BOWL * BOWL * 6], count = 0;
    for (uint32_t j = 0; j <= BOWL; ++j) {
        for (uint32_t i = 0; i < BOWL; ++i) {
            double a = 2.0 * PI * i / BOWL, b = 0.5 * PI * j / BOWL;
            float *v = p + 3 * (j * BOWL + i);
            v[0] = (float)(0.5 * cos(a) * cos(b));
            v[1] = (float)(0.5 * sin(a) * cos(b));
            v[2] = (float)(0.5 * sin(b));
        }
    }
    for (uint32_t j = 0; j < BOWL; ++j) {
        for (uint32_t i = 0; i < BOWL; ++i) {
            uint32_t a = j * BOWL + i, right = j * BOWL + (i + 1) % BOWL;
            uint32_t quad[6] = {a, right, right + BOWL, a, right + BOWL, a + BOWL};
            memcpy(indices + count, quad, sizeof quad);
            count += 6;
        }
    }
    return add_mesh(m, p, (BOWL + 1) * BOWL, indices, count / 3, 0);
}

static uint32_t soup_mesh(model *m, soak_dice *dice)
{
    float p[90];
    uint32_t indices[60];
    for (int i = 0; i < 90; ++i) {
        p[i] = (float)soak_between(dice, -0.5, 0.5);
    }
    for (int i = 0; i < 60; ++i) {
        indices[i] = soak_below(dice, 30);
    }
    return add_mesh(m, p, 30, indices, 20, UMB_TRIANGLE_TWO_SIDED);
}

/* Any turn about any axis (a quaternion), or none. */
static void turn(soak_dice *dice, double r[3][3])
{
    double q[4], n = 0.0;
    bool none = soak_below(dice, 3) == 0;
    for (int i = 0; i < 4; ++i) {
        q[i] = soak_between(dice, -1.0, 1.0);
        n += q[i] * q[i];
    }
    for (int i = 0; i < 4; ++i) {
        q[i] = none || n < 1e-3 ? i == 3 : q[i] / sqrt(n);
    }
    double x = q[0], y = q[1], z = q[2], w = q[3];
    double all[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                        {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                        {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
    memcpy(r, all, sizeof all);
}

static void place(soak_dice *dice, double side, bool needle, umb_transform *out)
{
    bool large = soak_below(dice, 5) == 0;
    double size[3], r[3][3];
    double at[3] = {soak_between(dice, -0.5, 0.5) * side, soak_between(dice, 0.0, HEIGHT),
                    soak_between(dice, -0.5, 0.5) * side};
    for (int i = 0; i < 3; ++i) {
        size[i] = large ? soak_between(dice, 10.0, 60.0) : soak_between(dice, 0.5, 5.0);
    }
    if (needle) {
        size[0] = size[1] = exp(soak_between(dice, log(1e-4), log(0.1)));
    }
    if (soak_below(dice, 8) == 0) {
        size[0] = -size[0];
    }
    turn(dice, r);
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            out->m[i][j] = (float)(r[i][j] * size[j]);
        }
        out->m[i][3] = (float)at[i];
    }
}

model *soak_medley(uint32_t count, uint64_t seed)
{
    model *m = model_create();
    if (m == NULL) {
        return NULL;
    }
    soak_dice dice = {seed};
    uint32_t mesh[MESHES];
    mesh[BOX] = box_mesh(m);
    mesh[WALL] = wall_mesh(m, 0);
    mesh[SHEET] = wall_mesh(m, UMB_TRIANGLE_TWO_SIDED);
    mesh[GLASS] = wall_mesh(m, UMB_TRIANGLE_OPEN);
    mesh[BOWL_MESH] = bowl_mesh(m);
    mesh[SOUP] = soup_mesh(m, &dice);
    bool ok = true;
    for (int k = 0; k < MESHES; ++k) {
        ok = ok && mesh[k] != MODEL_NONE;
    }
    double side = sqrt(count * AREA);
    /* Of twenty: boxes, walls, sheets, glass, bowls, soups; the last box is a needle. */
    static const uint8_t shares[20] = {BOX,   BOX,   BOX,   BOX,   BOX,       BOX,   BOX,
                                       BOX,   BOX,   BOX,   WALL,  WALL,      SHEET, SHEET,
                                       SHEET, SHEET, GLASS, GLASS, BOWL_MESH, SOUP};
    for (uint32_t i = 0; ok && i < count; ++i) {
        umb_transform t;
        uint32_t share = soak_below(&dice, 20);
        place(&dice, side, share == 9, &t);
        ok = model_add_object(m, "medley", mesh[shares[share]], &t) != MODEL_NONE;
    }
    if (!ok || !model_finish(m, NULL, NULL)) {
        model_free(m);
        return NULL;
    }
    return m;
}

/* `boxfield`: Leyvand's field of boxes of any size up to 100 units and any orientation, with a clearing in its
 * middle: a cube, or a square of a given height, whose size follows their number. A box counts as twelve polygons. */
#include <math.h>
#include <stdio.h>

#include "generate_parts.h"

#define SIDE_MIN 2.0
#define SIDE_MAX 100.0
/* Space for each box where none is asked for: about a tenth of the field is filled, and a line of sight ends after
 * some 230 units in the mean. */
#define VOLUME_PER_BOX 420000u
#define CLEARING 100.0 /* radius */
#define SMALLEST 500u  /* so that the clearing has something around it */

enum { CLEARING_VIEWS = 44, OUTSIDE_VIEWS = 20 };

/* How far centres of boxes are spread: along z and x, and along y. */
typedef struct extent {
    uint32_t size, height;
} extent;

/* Whole, so that no library's roots decide. */
static extent field_extent(const uint64_t *values)
{
    uint64_t volume = (values[0] + 11) / 12 * values[2], height = values[3], size = SMALLEST;
    while (size * size * (height != 0 ? height : size) < volume) {
        ++size;
    }
    return (extent){(uint32_t)size, (uint32_t)(height != 0 ? height : size)};
}

static double draw_signed(generate_random *r)
{
    return 2.0 * generate_unit(r) - 1.0;
}

/* A unit vector of n components, evenly over the sphere. */
static void draw_unit_vector(generate_random *r, int n, double *v)
{
    double square;
    do {
        square = 0.0;
        for (int i = 0; i < n; ++i) {
            v[i] = draw_signed(r);
            square += v[i] * v[i];
        }
    } while (square > 1.0 || square < 0.01);
    double length = sqrt(square);
    for (int i = 0; i < n; ++i) {
        v[i] /= length;
    }
}

/* Box k of the field, as a transform of the unit cube around zero. */
static umb_transform draw_box(uint64_t seed, uint32_t k, extent field)
{
    generate_random r = generate_stream(seed, k, 0);
    double q[4], side[3], centre[3], diagonal = 0.0, distance;
    draw_unit_vector(&r, 4, q);
    for (int i = 0; i < 3; ++i) {
        double u = generate_unit(&r);
        side[i] = SIDE_MIN + (SIDE_MAX - SIDE_MIN) * u * u;
        diagonal += side[i] * side[i];
    }
    double keep = CLEARING + 0.5 * sqrt(diagonal);
    do {
        distance = 0.0;
        for (int i = 0; i < 3; ++i) {
            centre[i] = 0.5 * (i == 1 ? field.height : field.size) * draw_signed(&r);
            distance += centre[i] * centre[i];
        }
    } while (distance < keep * keep);

    double w = q[0], x = q[1], y = q[2], z = q[3];
    const double turn[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                               {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                               {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
    umb_transform t;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            t.m[i][j] = (float)(turn[i][j] * side[j]);
        }
        t.m[i][3] = (float)centre[i];
    }
    return t;
}

static bool boxfield_model(const uint64_t *values, model *m)
{
    uint32_t boxes = (uint32_t)((values[0] + 11) / 12);
    extent field = field_extent(values);
    const double min[3] = {-0.5, -0.5, -0.5}, max[3] = {0.5, 0.5, 0.5};
    generate_mesh g = {0};
    generate_box(&g, min, max);
    uint32_t mesh = generate_mesh_add(&g, m);
    generate_mesh_free(&g);
    for (uint32_t k = 0; k < boxes && mesh != MODEL_NONE; ++k) {
        char name[24];
        umb_transform t = draw_box(values[1], k, field);
        snprintf(name, sizeof name, "box %u", k);
        if (model_add_object(m, name, mesh, &t) == MODEL_NONE) {
            return false;
        }
    }
    return mesh != MODEL_NONE;
}

/* From within the clearing in all directions, then from outside towards the middle. */
static bool boxfield_path(const uint64_t *values, camera_path *out)
{
    extent field = field_extent(values);
    generate_random r = generate_stream(values[1], -1, 0);
    for (int v = 0; v < CLEARING_VIEWS + OUTSIDE_VIEWS; ++v) {
        double place[3], look[3], eye[3], target[3];
        double reach = v < CLEARING_VIEWS ? 0.8 * CLEARING * generate_unit(&r) : 1.2 * field.size;
        draw_unit_vector(&r, 3, place);
        draw_unit_vector(&r, 3, look);
        for (int i = 0; i < 3; ++i) {
            eye[i] = reach * place[i];
            target[i] = v < CLEARING_VIEWS ? eye[i] + 100.0 * look[i] : 0.3 * (i == 1 ? field.height : field.size) * look[i];
        }
        if (!generate_look(out, eye, target)) {
            return false;
        }
    }
    return true;
}

const generate_kind generate_boxfield = {
    "boxfield",
    {{"polygons", 200000, 12, 100000000}, {"seed", 1, 0, UINT32_MAX}, {"space", VOLUME_PER_BOX, 1, 10000000},
     {"height", 0, 0, 1000000}},
    boxfield_model,
    boxfield_path};

/* `city`: Leyvand's urban model. Square rings of blocks around the middle, each of 5 x 4 lots
 * between a street to its east, one to its south and their junction:
 *
 *      85           14
 *   +--------------+--+
 *   | lots of 17   |  |        A lot holds a building 9 to 12 units wide and long, turned by at
 *   | 5 x 4        |  | 68     most 30 degrees (a side of at most 16.4: it never leaves its lot).
 *   +--------------+--+        A building is a stack of floors, each an object: a box or a solid
 *   | street       |j.| 14     in the shape of an L or a T, the lowest ones perhaps decks on
 *   +--------------+--+        pillars.
 *
 * Floors of one building share the turn's floats and their plan's corners, and storeys are
 * multiples of a half: so the top of one floor equals the bottom of the next to the bit. The ground
 * is objects too, one a block, street and junction, so that it can be culled. A building depends on
 * the seed and its lot only: a larger city contains the smaller ones. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "generate_parts.h"

enum { LOTS_X = 5, LOTS_Z = 4, LOTS = LOTS_X * LOTS_Z };
#define LOT 17.0
#define STREET 14.0
#define BLOCK_X (LOTS_X * LOT)
#define BLOCK_Z (LOTS_Z * LOT)
#define PITCH_X (BLOCK_X + STREET)
#define PITCH_Z (BLOCK_Z + STREET)
#define EYE_HEIGHT 1.7

enum { PLAN_BOX, PLAN_L, PLAN_T, PLANS };
enum { SIZES = 7, STOREYS = 3 };
enum { GROUND_BLOCK, GROUND_EAST, GROUND_SOUTH, GROUND_JUNCTION, GROUNDS };

typedef struct city_building {
    double x, z;           /* its middle, always under a roof */
    double c, s;           /* cosine and sine of its turn, quarter turns included */
    uint32_t width, depth; /* 0..6: 9 + half of that */
    uint32_t storey;       /* 0..2: 3 + half of that high */
    uint32_t lower, upper; /* plans */
    uint32_t floors, decks,
        change; /* floors below decks are decks; from change on the plan is upper */
} city_building;

/* Outlines run counter-clockwise seen from above, in (x, -z). */
typedef struct city_plan {
    double outline[8][2];
    uint8_t triangles[6][3];
    uint32_t corners;
    uint8_t inner; /* bit k: corner k is a reflex one, no pillar there */
} city_plan;

static const city_plan plans[PLANS] = {
    {{{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}, {{0, 1, 2}, {0, 2, 3}}, 4, 0},
    {{{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.125}, {0.125, 0.125}, {0.125, 0.5}, {-0.5, 0.5}},
     {{3, 4, 5}, {3, 5, 0}, {3, 0, 1}, {3, 1, 2}},
     6,
     1u << 3},
    {{{-0.5, -0.125},
      {-0.25, -0.125},
      {-0.25, -0.5},
      {0.25, -0.5},
      {0.25, -0.125},
      {0.5, -0.125},
      {0.5, 0.5},
      {-0.5, 0.5}},
     {{1, 2, 3}, {1, 3, 4}, {1, 4, 6}, {4, 5, 6}, {1, 6, 7}, {1, 7, 0}},
     8,
     1u << 1 | 1u << 4},
};

typedef struct city_shapes {
    uint32_t floor[PLANS][2][SIZES][SIZES][STOREYS]; /* [1]: a deck on pillars */
    uint32_t ground[GROUNDS];
    generate_mesh mesh;
} city_shapes;

/* Every plan covers the middle of its building, so that a roof view stands on something. */
static bool draw_building(uint64_t seed, int bx, int bz, int lot, city_building *out)
{
    generate_random r = generate_stream(seed, (int64_t)bx * LOTS + lot, bz);
    static const uint8_t mix[20] = {PLAN_BOX, PLAN_BOX, PLAN_BOX, PLAN_BOX, PLAN_BOX,
                                    PLAN_BOX, PLAN_BOX, PLAN_BOX, PLAN_BOX, PLAN_BOX,
                                    PLAN_BOX, PLAN_L,   PLAN_L,   PLAN_L,   PLAN_L,
                                    PLAN_L,   PLAN_T,   PLAN_T,   PLAN_T,   PLAN_T};
    bool built = generate_below(&r, 16) != 0; /* else a gap in the row */
    out->x = bx * PITCH_X + (lot % LOTS_X - (LOTS_X - 1) / 2.0) * LOT;
    out->z = bz * PITCH_Z + (lot / LOTS_X - (LOTS_Z - 1) / 2.0) * LOT;
    /* Half-angle form: t = tan(turn / 2), at most tan 15 degrees. */
    double t = (2.0 * generate_unit(&r) - 1.0) * 0.2679491924311227;
    double c = (1.0 - t * t) / (1.0 + t * t), s = 2.0 * t / (1.0 + t * t);
    static const int8_t quarter[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    const int8_t *q = quarter[generate_below(&r, 4)];
    out->c = q[0] * c - q[1] * s;
    out->s = q[0] * s + q[1] * c;
    out->width = generate_below(&r, SIZES);
    out->depth = generate_below(&r, SIZES);
    out->storey = generate_below(&r, STOREYS);
    /* Many low houses, few towers: 3 to 32 floors, 10 in the mean. */
    double u = generate_unit(&r);
    out->floors = 3 + (uint32_t)(30.0 * u * u * u);
    out->decks = generate_below(&r, 5) == 0 ? 1 + generate_below(&r, 2) : 0;
    out->upper = mix[generate_below(&r, 20)];
    out->lower = generate_below(&r, 4) == 0 ? PLAN_BOX : out->upper;
    out->change = out->decks + generate_below(&r, out->floors);
    return built;
}

static uint32_t floor_plan(const city_building *b, uint32_t floor)
{
    return floor < b->change ? b->lower : b->upper;
}

static uint32_t solid_triangles(uint32_t plan)
{
    return 4 * plans[plan].corners - 4;
}

static uint32_t floor_triangles(uint32_t plan, bool deck)
{
    static const uint8_t pillars[PLANS] = {5, 6, 7};
    return solid_triangles(plan) + (deck ? 12u * pillars[plan] : 0);
}

static uint32_t building_triangles(const city_building *b)
{
    uint32_t sum = 0;
    for (uint32_t f = 0; f < b->floors; ++f) {
        sum += floor_triangles(floor_plan(b, f), f < b->decks);
    }
    return sum;
}

static void add_solid(generate_mesh *g, const city_plan *p, double w, double d, double y0, double y1)
{
    uint32_t low[8], high[8];
    for (uint32_t k = 0; k < p->corners; ++k) {
        low[k] = generate_vertex(g, p->outline[k][0] * w, y0, -p->outline[k][1] * d);
        high[k] = generate_vertex(g, p->outline[k][0] * w, y1, -p->outline[k][1] * d);
    }
    for (uint32_t k = 0; k < p->corners - 2; ++k) {
        const uint8_t *t = p->triangles[k];
        generate_triangle(g, high[t[0]], high[t[1]], high[t[2]]);
        generate_triangle(g, low[t[0]], low[t[2]], low[t[1]]);
    }
    for (uint32_t k = 0; k < p->corners; ++k) {
        uint32_t n = (k + 1) % p->corners;
        generate_quad(g, low[k], low[n], high[n], high[k]);
    }
}

static void add_pillar(generate_mesh *g, double x, double z, double y1)
{
    const double min[3] = {x - 0.25, 0, z - 0.25}, max[3] = {x + 0.25, y1, z + 0.25};
    generate_box(g, min, max);
}

/* Pillars stand half a unit in from each outer corner, and one in the middle. */
static void add_pillars(generate_mesh *g, const city_plan *p, double w, double d, double y1)
{
    for (uint32_t k = 0; k < p->corners; ++k) {
        if (p->inner >> k & 1) {
            continue;
        }
        const double *a = p->outline[(k + p->corners - 1) % p->corners];
        const double *b = p->outline[k], *c = p->outline[(k + 1) % p->corners];
        double x = b[0] * w + (a[0] + c[0] > 2 * b[0] ? 0.5 : -0.5);
        double v = b[1] * d + (a[1] + c[1] > 2 * b[1] ? 0.5 : -0.5);
        add_pillar(g, x, -v, y1);
    }
    add_pillar(g, 0, 0, y1);
}

static uint32_t floor_mesh(city_shapes *shapes, model *m, const city_building *b, uint32_t floor)
{
    uint32_t plan = floor_plan(b, floor);
    bool deck = floor < b->decks;
    uint32_t *id = &shapes->floor[plan][deck][b->width][b->depth][b->storey];
    if (*id == MODEL_NONE) {
        double w = 9 + b->width / 2.0, d = 9 + b->depth / 2.0, h = 3 + b->storey / 2.0;
        if (deck) {
            add_solid(&shapes->mesh, &plans[plan], w, d, h - 0.5, h);
            add_pillars(&shapes->mesh, &plans[plan], w, d, h - 0.5);
        } else {
            add_solid(&shapes->mesh, &plans[plan], w, d, 0, h);
        }
        *id = generate_mesh_add(&shapes->mesh, m);
    }
    return *id;
}

static bool add_building(city_shapes *shapes, model *m, const city_building *b, const char *block,
                         int lot)
{
    char name[80];
    float c = (float)b->c, s = (float)b->s;
    umb_transform t = {{{c, 0, s, (float)b->x}, {0, 1, 0, 0}, {-s, 0, c, (float)b->z}}};
    double h = 3 + b->storey / 2.0;
    for (uint32_t f = 0; f < b->floors; ++f) {
        uint32_t mesh = floor_mesh(shapes, m, b, f);
        t.m[1][3] = (float)(f * h);
        snprintf(name, sizeof name, "%s building %d floor %u", block, lot, f);
        if (mesh == MODEL_NONE || model_add_object(m, name, mesh, &t) == MODEL_NONE) {
            return false;
        }
    }
    return true;
}

static bool add_ground(city_shapes *shapes, model *m, int bx, int bz, const char *block)
{
    static const char *const names[GROUNDS] = {"ground", "street east", "street south", "junction"};
    char name[80];
    for (int k = 0; k < GROUNDS; ++k) {
        double x = bx * PITCH_X + (k & 1 ? PITCH_X / 2 : 0);
        double z = bz * PITCH_Z + (k & 2 ? PITCH_Z / 2 : 0);
        umb_transform t = generate_translation(x, 0, z);
        snprintf(name, sizeof name, "%s %s", block, names[k]);
        if (model_add_object(m, name, shapes->ground[k], &t) == MODEL_NONE) {
            return false;
        }
    }
    return true;
}

static bool add_ground_meshes(city_shapes *shapes, model *m)
{
    generate_mesh *g = &shapes->mesh;
    for (int k = 0; k < GROUNDS; ++k) {
        double x = (k & 1 ? STREET : BLOCK_X) / 2, z = (k & 2 ? STREET : BLOCK_Z) / 2;
        uint32_t a = generate_vertex(g, -x, 0, -z), b = generate_vertex(g, -x, 0, z);
        uint32_t c = generate_vertex(g, x, 0, z), d = generate_vertex(g, x, 0, -z);
        generate_quad(g, a, b, c, d);
        shapes->ground[k] = generate_mesh_add(g, m);
        if (shapes->ground[k] == MODEL_NONE) {
            return false;
        }
    }
    return true;
}

/* Block n of the square spiral around (0, 0): ring k holds the blocks from (2k-1)^2 on. */
static void spiral(uint32_t n, int *bx, int *bz)
{
    int k = 0;
    while ((uint32_t)((2 * k + 1) * (2 * k + 1)) <= n) {
        ++k;
    }
    *bx = 0;
    *bz = 0;
    if (k == 0) {
        return;
    }
    int at = (int)n - (2 * k - 1) * (2 * k - 1), step = at % (2 * k);
    switch (at / (2 * k)) {
    case 0:
        *bx = k, *bz = -k + 1 + step;
        break;
    case 1:
        *bx = k - 1 - step, *bz = k;
        break;
    case 2:
        *bx = -k, *bz = k - 1 - step;
        break;
    default:
        *bx = -k + 1 + step, *bz = -k;
        break;
    }
}

/* Build the city up to the first building that reaches the number of triangles asked for; with m
 * NULL only count. Returns the number of blocks begun, 0 when memory is short. */
static uint32_t build(uint64_t triangles, uint64_t seed, city_shapes *shapes, model *m)
{
    uint64_t sum = 0;
    uint32_t block = 0;
    char name[40];
    while (sum < triangles) {
        int bx, bz;
        spiral(block++, &bx, &bz);
        snprintf(name, sizeof name, "block %d,%d", bx, bz);
        sum += 2 * GROUNDS;
        if (m && !add_ground(shapes, m, bx, bz, name)) {
            return 0;
        }
        for (int lot = 0; lot < LOTS && sum < triangles; ++lot) {
            city_building b;
            if (!draw_building(seed, bx, bz, lot, &b)) {
                continue;
            }
            sum += building_triangles(&b);
            if (m && !add_building(shapes, m, &b, name, lot)) {
                return 0;
            }
        }
    }
    return block;
}

static bool city_model(const uint64_t *values, model *m)
{
    city_shapes *shapes = malloc(sizeof *shapes);
    if (!shapes) {
        return false;
    }
    uint32_t *ids = &shapes->floor[0][0][0][0][0];
    for (size_t k = 0; k < sizeof shapes->floor / sizeof *ids; ++k) {
        ids[k] = MODEL_NONE;
    }
    shapes->mesh = (generate_mesh){0};
    bool ok = add_ground_meshes(shapes, m) && build(values[0], values[1], shapes, m) > 0;
    generate_mesh_free(&shapes->mesh);
    free(shapes);
    return ok;
}

enum { LEGS = 18, LEG_VIEWS = 4, ROOF_VIEWS = 12, AIR_VIEWS = 12 };

/* A walk from junction to junction that never turns back and stays within reach of the middle.
 * Each leg gives four views: in the junction, looking across the corner, and along the street. */
static bool look_streets(uint64_t seed, int reach, camera_path *out)
{
    static const int8_t directions[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    static const double sway[LEG_VIEWS] = {0.9, 0.2, -0.35, 0.0};
    generate_random r = generate_stream(seed, -1, -1);
    int i = 0, j = 0;
    uint32_t heading = 0;
    for (int leg = 0; leg < LEGS; ++leg) {
        uint32_t turn = generate_below(&r, 3) + 3; /* left, straight on or right */
        for (uint32_t k = 0; k < 4; ++k) {
            uint32_t h = (heading + turn + k) % 4;
            int ni = i + directions[h][0], nj = j + directions[h][1];
            bool near = ni >= -reach && ni < reach && nj >= -reach && nj < reach;
            if (near && h != (heading + 2) % 4) {
                heading = h;
                break;
            }
        }
        double fx = directions[heading][0], fz = directions[heading][1];
        double side = generate_below(&r, 2) ? 1.0 : -1.0;
        for (int v = 0; v < LEG_VIEWS; ++v) {
            double t = v / (double)LEG_VIEWS, off = 2.0 * (2.0 * generate_unit(&r) - 1.0);
            double k = side * sway[v];
            const double eye[3] = {(i + 0.5 + fx * t) * PITCH_X + off * fz, EYE_HEIGHT,
                                   (j + 0.5 + fz * t) * PITCH_Z + off * fx};
            const double target[3] = {eye[0] + 50 * (fx - k * fz), EYE_HEIGHT,
                                      eye[2] + 50 * (fz + k * fx)};
            if (!generate_look(out, eye, target)) {
                return false;
            }
        }
        i += directions[heading][0];
        j += directions[heading][1];
    }
    return true;
}

/* From roofs: standing in the middle of a roof, looking out and a little down. */
static bool look_roofs(uint64_t seed, int reach, camera_path *out)
{
    generate_random r = generate_stream(seed, -2, -2);
    for (int v = 0; v < ROOF_VIEWS;) {
        int bx = (int)generate_below(&r, 2 * (uint32_t)reach + 1) - reach;
        int bz = (int)generate_below(&r, 2 * (uint32_t)reach + 1) - reach;
        city_building b;
        if (!draw_building(seed, bx, bz, (int)generate_below(&r, LOTS), &b)) {
            continue;
        }
        const double eye[3] = {b.x, b.floors * (3 + b.storey / 2.0) + EYE_HEIGHT, b.z};
        const double target[3] = {b.x + 50 * (2 * generate_unit(&r) - 1), eye[1] - 10,
                                  b.z + 50 * (v & 1 ? 1 : -1)};
        if (!generate_look(out, eye, target)) {
            return false;
        }
        ++v;
    }
    return true;
}

/* From the air: above all roofs (32 floors of 4), looking at places in the city. */
static bool look_down(uint64_t seed, int reach, camera_path *out)
{
    generate_random r = generate_stream(seed, -3, -3);
    double size = (reach + 0.5) * PITCH_X;
    for (int v = 0; v < AIR_VIEWS; ++v) {
        const double eye[3] = {size * (2 * generate_unit(&r) - 1), 160 + 20.0 * v,
                               size * (2 * generate_unit(&r) - 1)};
        const double target[3] = {size * (generate_unit(&r) - 0.5), 0,
                                  size * (generate_unit(&r) - 0.5)};
        if (!generate_look(out, eye, target)) {
            return false;
        }
    }
    return true;
}

static bool city_path(const uint64_t *values, camera_path *out)
{
    uint32_t blocks = build(values[0], values[1], NULL, NULL);
    int reach = 0; /* whole rings */
    while ((uint32_t)((2 * reach + 3) * (2 * reach + 3)) <= blocks) {
        ++reach;
    }
    return look_streets(values[1], reach > 0 ? reach : 1, out) &&
           look_roofs(values[1], reach, out) && look_down(values[1], reach, out);
}

const generate_kind generate_city = {
    "city", {{"triangles", 1000000, 1, 100000000}, {"seed", 7, 0, UINT32_MAX}}, city_model, city_path};

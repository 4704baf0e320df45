/* `building`: an office building in the manner of Soda Hall. Every floor is strips of two rows of
 * rooms with a corridor between them, joined by a corridor across their western ends:
 *
 *   +---+-------+------+-----+        columns: 0 is the cross corridor, the others rooms
 *   |   | room  | room |     |        rows: room, corridor, room; room, corridor, room; ...
 *   |   +--  ---+-- ---+-- --+
 *   |     corridor           |        A wall is posts at the nodes of the grid and panels between
 *   |   +-- ----+--- --+-  --+        them, each an object. Panels and posts are cut at the same
 *   |   |       |      |     |        three heights, and all lengths are multiples of 1/16:
 *   +---+-------+------+-----+        neighbours share their end faces to the bit.
 *
 * Rooms have one door to their corridor (some closed), some a door to the next room, few a
 * window.
 *
 * `sodacity`: blocks by blocks of such buildings, each with a plan of its own, and streets between. */
#include <stdio.h>
#include <stdlib.h>

#include "generate_parts.h"

#define WALL 0.25
#define SLAB 0.25
#define STOREY 3.25 /* slab and walls */
#define CORRIDOR 2.25
#define CROSS 2.5
#define EYE_HEIGHT 1.7
#define DOOR_TOP 2.25
#define DOOR_WIDTH 1.0
#define STREET 12.0

enum { ROOMS_IN_ROW = 12, MAX_COLUMNS = ROOMS_IN_ROW + 1, MAX_ROWS = 256, VIEWS = 72 };
enum { PANEL_NONE, PANEL_SOLID, PANEL_DOOR, PANEL_CLOSED, PANEL_WINDOW };
enum { DESK, CHAIR, CABINET, SHELF, TABLE, FURNITURE };

typedef struct building_plan {
    uint64_t seed;
    uint32_t floors, columns, rows;
    double x[MAX_COLUMNS + 1], z[MAX_ROWS + 1]; /* where wall lines begin */
} building_plan;

/* A panel: what it is, its opening from left to left + width. */
typedef struct building_panel {
    int kind;
    double length, left, width;
} building_panel;

typedef struct building_shape {
    building_panel panel;
    uint32_t mesh;
} building_shape;

typedef struct building_maker {
    const building_plan *plan;
    model *m;
    generate_mesh mesh;
    building_shape *shapes; /* panels made so far, to be shared */
    uint32_t shape_count;
    uint32_t cube, post, furniture[FURNITURE];
    char place[64];
    double x, z; /* where the building's corner is */
    bool failed;
} building_maker;

/* Floor area of each piece of furniture. None is as high as an eye. */
static const double furniture_size[FURNITURE][2] = {
    {1.5, 0.75}, {0.5, 0.5}, {0.75, 0.5}, {1.25, 0.375}, {1.25, 1.25}};
static const char *const furniture_name[FURNITURE] = {"desk", "chair", "cabinet", "shelf", "table"};

static bool is_corridor(uint32_t column, uint32_t row)
{
    return column == 0 || row % 3 == 1;
}

static double draw_step(generate_random *r, double from, uint32_t quarters)
{
    return from + 0.25 * generate_below(r, quarters + 1);
}

static void lay_out(const uint64_t *values, building_plan *p)
{
    uint32_t rooms = (uint32_t)values[1];
    uint32_t strips = (rooms + 2 * ROOMS_IN_ROW - 1) / (2 * ROOMS_IN_ROW);
    generate_random r = generate_stream(values[2], -1, 0);
    p->seed = values[2];
    p->floors = (uint32_t)values[0];
    p->columns = 1 + (rooms + 2 * strips - 1) / (2 * strips);
    p->rows = 3 * strips;
    p->x[0] = p->z[0] = 0.0;
    for (uint32_t c = 0; c < p->columns; ++c) {
        p->x[c + 1] = p->x[c] + WALL + (c == 0 ? CROSS : draw_step(&r, 3.5, 10));
    }
    for (uint32_t row = 0; row < p->rows; ++row) {
        p->z[row + 1] = p->z[row] + WALL + (row % 3 == 1 ? CORRIDOR : draw_step(&r, 4.0, 8));
    }
}

/* The panel on the low side of a cell: across x (the cell's west) or z (its north). A pure
 * function of the seed and the place, so that the path knows the doors too. */
static building_panel draw_panel(const building_plan *p, uint32_t floor, uint32_t column,
                                 uint32_t row, bool across_x)
{
    uint32_t line = across_x ? column : row, last = across_x ? p->columns : p->rows;
    bool outside = line == 0 || line == last;
    bool here = line < last && is_corridor(column, row);
    bool before = line > 0 && is_corridor(across_x ? column - 1 : column, across_x ? row : row - 1);
    generate_random r = generate_stream(p->seed, (int64_t)floor * 2 + across_x,
                                        (int64_t)row * 64 + column);
    building_panel out = {PANEL_SOLID, 0, 0, 0};
    out.length = across_x ? p->z[row + 1] - p->z[row] - WALL
                          : p->x[column + 1] - p->x[column] - WALL;
    uint32_t die = generate_below(&r, 100);
    if (outside) {
        out.kind = !here && !before && die < 25 ? PANEL_WINDOW : PANEL_SOLID;
    } else if (here && before) {
        out.kind = PANEL_NONE;
    } else if (here != before) {
        out.kind = across_x ? PANEL_SOLID : die < 30 ? PANEL_CLOSED : PANEL_DOOR;
    } else if (across_x) {
        out.kind = die < 8 ? PANEL_NONE : die < 20 ? PANEL_DOOR : PANEL_SOLID;
    }
    if (out.kind > PANEL_SOLID) {
        out.width = out.kind == PANEL_WINDOW ? 1.5 : DOOR_WIDTH;
        out.left = draw_step(&r, 0.5, (uint32_t)((out.length - out.width - 1.0) * 4.0));
    }
    return out;
}

/* A slab of the given thickness over a grid of cells in x and y, some of them left out: one
 * closed surface whose corners are the grid's. Quads that face another slab's quad are cut along
 * the same diagonal, also after a quarter turn about y. */
static void add_cells(generate_mesh *g, const double *x, uint32_t nx, const double *y, uint32_t ny,
                      uint32_t holes)
{
    uint32_t v[2][4][4];
    for (uint32_t k = 0; k < 2 * (nx + 1) * (ny + 1); ++k) {
        uint32_t i = k / 2 % (nx + 1), j = k / 2 / (nx + 1);
        v[k & 1][i][j] = generate_vertex(g, x[i], y[j], k & 1 ? WALL : 0.0);
    }
#define SOLID(i, j) ((i) < nx && (j) < ny && !(holes >> (4 * (j) + (i)) & 1))
    for (uint32_t k = 0; k < nx * ny; ++k) {
        uint32_t i = k % nx, j = k / nx;
        if (!SOLID(i, j)) {
            continue;
        }
        generate_quad(g, v[1][i + 1][j], v[1][i + 1][j + 1], v[1][i][j + 1], v[1][i][j]);
        generate_quad(g, v[0][i + 1][j], v[0][i][j], v[0][i][j + 1], v[0][i + 1][j + 1]);
        if (!SOLID(i - 1, j)) {
            generate_quad(g, v[0][i][j], v[1][i][j], v[1][i][j + 1], v[0][i][j + 1]);
        }
        if (!SOLID(i + 1, j)) {
            generate_quad(g, v[0][i + 1][j], v[0][i + 1][j + 1], v[1][i + 1][j + 1], v[1][i + 1][j]);
        }
        if (!SOLID(i, j - 1)) {
            generate_quad(g, v[0][i][j], v[0][i + 1][j], v[1][i + 1][j], v[1][i][j]);
        }
        if (!SOLID(i, j + 1)) {
            generate_quad(g, v[1][i][j + 1], v[1][i + 1][j + 1], v[0][i + 1][j + 1], v[0][i][j + 1]);
        }
    }
#undef SOLID
}

/* Sill, door head, ceiling: the heights at which every wall is cut. */
static const double heights[4] = {0.0, 1.0, DOOR_TOP, STOREY - SLAB};

static uint32_t panel_mesh(building_maker *b, const building_panel *p)
{
    bool window = p->kind == PANEL_WINDOW, solid = p->kind == PANEL_SOLID;
    for (uint32_t k = 0; k < b->shape_count; ++k) {
        const building_panel *q = &b->shapes[k].panel;
        if ((q->kind == PANEL_WINDOW) == window && q->length == p->length && q->left == p->left &&
            q->width == p->width) {
            return b->shapes[k].mesh;
        }
    }
    building_shape *grown = realloc(b->shapes, (b->shape_count + 1) * sizeof *grown);
    if (!grown) {
        return MODEL_NONE;
    }
    b->shapes = grown;
    const double x[4] = {0.0, solid ? p->length : p->left, p->left + p->width, p->length};
    uint32_t holes = solid ? 0 : window ? 1u << 5 : 1u << 1 | 1u << 5;
    add_cells(&b->mesh, x, solid ? 1 : 3, heights, 3, holes);
    building_shape made = {*p, generate_mesh_add(&b->mesh, b->m)};
    b->shapes[b->shape_count++] = made;
    return made.mesh;
}

static void put(building_maker *b, const char *what, uint32_t mesh, const umb_transform *t)
{
    char name[96];
    umb_transform at = *t;
    at.m[0][3] += (float)b->x;
    at.m[2][3] += (float)b->z;
    snprintf(name, sizeof name, "%s %s", b->place, what);
    if (mesh == MODEL_NONE || model_add_object(b->m, name, mesh, &at) == MODEL_NONE) {
        b->failed = true;
    }
}

/* An axis-aligned box. Its dimensions are dyadic, so scaling the unit cube is exact. */
static void put_box(building_maker *b, const char *what, double x0, double x1, double y0, double y1,
                    double z0, double z1)
{
    umb_transform t = generate_translation(x0, y0, z0);
    t.m[0][0] = (float)(x1 - x0);
    t.m[1][1] = (float)(y1 - y0);
    t.m[2][2] = (float)(z1 - z0);
    put(b, what, b->cube, &t);
}

/* Quarter turns about y, of what stands with its low corner at zero and its size in x and z
 * given. */
static umb_transform turned(uint32_t quarter, double sx, double sz, double x, double y, double z)
{
    static const int8_t c[4] = {1, 0, -1, 0}, s[4] = {0, -1, 0, 1};
    double low_x = (c[quarter] < 0 ? -sx : 0) + (s[quarter] < 0 ? -sz : 0);
    double low_z = (c[quarter] < 0 ? -sz : 0) + (s[quarter] > 0 ? -sx : 0);
    umb_transform t = generate_translation(x - low_x, y, z - low_z);
    t.m[0][0] = t.m[2][2] = c[quarter];
    t.m[0][2] = s[quarter];
    t.m[2][0] = (float)-s[quarter];
    return t;
}

static void put_panel(building_maker *b, uint32_t floor, uint32_t column, uint32_t row,
                      bool across_x)
{
    const building_plan *p = b->plan;
    building_panel panel = draw_panel(p, floor, column, row, across_x);
    if (panel.kind == PANEL_NONE) {
        return;
    }
    double x = p->x[column] + (across_x ? 0 : WALL), y = floor * STOREY + SLAB;
    double z = p->z[row] + (across_x ? WALL : 0);
    umb_transform t = turned(across_x ? 1 : 0, panel.length, WALL, x, y, z);
    put(b, across_x ? "wall west" : "wall north", panel_mesh(b, &panel), &t);
    if (panel.kind == PANEL_CLOSED) {
        x += panel.left;
        put_box(b, "door", x, x + panel.width, y, y + DOOR_TOP, z, z + WALL);
    }
}

/* The slab under a cell reaches to the middle of the walls around it. */
static void put_slab(building_maker *b, uint32_t floor, uint32_t column, uint32_t row)
{
    const building_plan *p = b->plan;
    double x0 = p->x[column] + (column ? WALL / 2 : 0), z0 = p->z[row] + (row ? WALL / 2 : 0);
    double x1 = p->x[column + 1] + (column + 1 < p->columns ? WALL / 2 : WALL);
    double z1 = p->z[row + 1] + (row + 1 < p->rows ? WALL / 2 : WALL);
    put_box(b, floor < p->floors ? "slab" : "roof", x0, x1, floor * STOREY, floor * STOREY + SLAB,
            z0, z1);
}

static void put_furniture(building_maker *b, uint32_t floor, uint32_t column, uint32_t row)
{
    const building_plan *p = b->plan;
    generate_random r = generate_stream(p->seed, -2 - (int64_t)floor, (int64_t)row * 64 + column);
    double taken[10][4];
    uint32_t count = 0, wanted = 4 + generate_below(&r, 6);
    double x0 = p->x[column] + WALL, x1 = p->x[column + 1], z0 = p->z[row] + WALL,
           z1 = p->z[row + 1];
    for (uint32_t attempt = 0; attempt < 40 && count < wanted; ++attempt) {
        uint32_t kind = generate_below(&r, FURNITURE), quarter = generate_below(&r, 4);
        double sx = furniture_size[kind][quarter & 1], sz = furniture_size[kind][!(quarter & 1)];
        double x = x0 + 0.0625 * generate_below(&r, (uint32_t)((x1 - x0 - sx) * 16) + 1);
        double z = z0 + 0.0625 * generate_below(&r, (uint32_t)((z1 - z0 - sz) * 16) + 1);
        bool clear = true;
        for (uint32_t k = 0; k < count; ++k) {
            clear = clear && (x > taken[k][1] || x + sx < taken[k][0] || z > taken[k][3] ||
                              z + sz < taken[k][2]);
        }
        if (!clear) {
            continue;
        }
        const double area[4] = {x, x + sx, z, z + sz};
        for (int k = 0; k < 4; ++k) {
            taken[count][k] = area[k];
        }
        ++count;
        umb_transform t = turned(quarter, furniture_size[kind][0], furniture_size[kind][1], x,
                                 floor * STOREY + SLAB, z);
        put(b, furniture_name[kind], b->furniture[kind], &t);
    }
}

/* Boxes of each piece, in sixteenths: x0, x1, y0, y1, z0, z1. No two boxes share a whole edge:
 * the pieces are manifold. */
static const struct {
    uint8_t kind, box[6];
} furniture_boxes[] = {
    {DESK, {0, 24, 11, 12, 0, 12}},   {DESK, {1, 2, 0, 11, 1, 11}},
    {DESK, {16, 24, 1, 11, 1, 11}},   {DESK, {1, 16, 4, 11, 0, 1}},
    {CHAIR, {0, 8, 7, 8, 0, 8}},      {CHAIR, {1, 7, 8, 16, 0, 1}},
    {CHAIR, {0, 1, 0, 7, 0, 1}},      {CHAIR, {7, 8, 0, 7, 0, 1}},
    {CHAIR, {0, 1, 0, 7, 7, 8}},      {CHAIR, {7, 8, 0, 7, 7, 8}},
    {CABINET, {0, 12, 0, 22, 0, 8}},  {SHELF, {0, 20, 1, 23, 0, 1}},
    {SHELF, {0, 1, 0, 24, 1, 6}},     {SHELF, {19, 20, 0, 24, 1, 6}},
    {SHELF, {1, 19, 0, 1, 1, 5}},     {SHELF, {1, 19, 8, 9, 1, 5}},
    {SHELF, {1, 19, 16, 17, 1, 5}},   {SHELF, {1, 19, 23, 24, 1, 5}},
    {TABLE, {0, 20, 11, 12, 0, 20}},  {TABLE, {1, 3, 0, 11, 1, 3}},
    {TABLE, {17, 19, 0, 11, 1, 3}},   {TABLE, {1, 3, 0, 11, 17, 19}},
    {TABLE, {17, 19, 0, 11, 17, 19}},
};

static bool make_shapes(building_maker *b)
{
    const double zero[3] = {0, 0, 0}, one[3] = {1, 1, 1}, post[2] = {0, WALL};
    generate_box(&b->mesh, zero, one);
    b->cube = generate_mesh_add(&b->mesh, b->m);
    add_cells(&b->mesh, post, 1, heights, 3, 0);
    b->post = generate_mesh_add(&b->mesh, b->m);
    bool ok = b->cube != MODEL_NONE && b->post != MODEL_NONE;
    for (uint32_t kind = 0; kind < FURNITURE; ++kind) {
        for (size_t k = 0; k < sizeof furniture_boxes / sizeof furniture_boxes[0]; ++k) {
            const uint8_t *s = furniture_boxes[k].box;
            if (furniture_boxes[k].kind == kind) {
                const double min[3] = {s[0] / 16.0, s[2] / 16.0, s[4] / 16.0};
                const double max[3] = {s[1] / 16.0, s[3] / 16.0, s[5] / 16.0};
                generate_box(&b->mesh, min, max);
            }
        }
        b->furniture[kind] = generate_mesh_add(&b->mesh, b->m);
        ok = ok && b->furniture[kind] != MODEL_NONE;
    }
    return ok;
}

/* One cell of a floor with what belongs to its low sides; cells one past the last column or row
 * have the outer walls. */
static void put_cell(building_maker *b, uint32_t floor, uint32_t column, uint32_t row)
{
    const building_plan *p = b->plan;
    bool column_in = column < p->columns, row_in = row < p->rows;
    if (b->x != 0.0 || b->z != 0.0) {
        snprintf(b->place, sizeof b->place, "at %g,%g floor %u cell %u,%u", b->x, b->z, floor, column, row);
    } else {
        snprintf(b->place, sizeof b->place, "floor %u cell %u,%u", floor, column, row);
    }
    if (column_in && row_in) {
        put_slab(b, floor, column, row);
    }
    if (floor == p->floors) {
        return;
    }
    umb_transform t = generate_translation(p->x[column], floor * STOREY + SLAB, p->z[row]);
    put(b, "post", b->post, &t);
    if (row_in) {
        put_panel(b, floor, column, row, true);
    }
    if (column_in) {
        put_panel(b, floor, column, row, false);
    }
    if (column_in && row_in && !is_corridor(column, row)) {
        put_furniture(b, floor, column, row);
    }
}

static void put_building(building_maker *b)
{
    for (uint32_t floor = 0; floor <= b->plan->floors && !b->failed; ++floor) {
        for (uint32_t row = 0; row <= b->plan->rows; ++row) {
            for (uint32_t column = 0; column <= b->plan->columns && !b->failed; ++column) {
                put_cell(b, floor, column, row);
            }
        }
    }
}

static bool building_model(const uint64_t *values, model *m)
{
    building_plan plan;
    building_maker b = {.plan = &plan, .m = m};
    lay_out(values, &plan);
    b.failed = !make_shapes(&b);
    put_building(&b);
    free(b.shapes);
    generate_mesh_free(&b.mesh);
    return !b.failed;
}

/* Views in threes: along a corridor, from the corridor through a door, and inside that room. */
static bool building_path(const uint64_t *values, camera_path *out)
{
    building_plan p;
    lay_out(values, &p);
    generate_random r = generate_stream(p.seed, -1, -1);
    for (uint32_t v = 0; v < VIEWS / 3; ++v) {
        uint32_t floor = v % p.floors, strip = generate_below(&r, p.rows / 3);
        uint32_t column = 1 + generate_below(&r, p.columns - 1), south = generate_below(&r, 2);
        uint32_t row = 3 * strip + 2 * south, corridor = 3 * strip + 1;
        double y = floor * STOREY + SLAB + EYE_HEIGHT;
        double z = p.z[corridor] + WALL + CORRIDOR / 2, side = south ? 1.0 : -1.0;
        double length = p.x[p.columns] - WALL;
        building_panel door = draw_panel(&p, floor, column, corridor + south, false);
        double door_x = p.x[column] + WALL + door.left + DOOR_WIDTH / 2;
        double room_x = (p.x[column] + WALL + p.x[column + 1]) / 2;
        double room_z = (p.z[row] + WALL + p.z[row + 1]) / 2;
        double along = WALL + length * (0.1 + 0.8 * generate_unit(&r));
        double ahead = along < length / 2 ? 20.0 : -20.0;
        const double rows[3][6] = {
            {along, y, z, along + ahead, y, z + 2.0 * generate_unit(&r) - 1.0},
            {door_x + 0.5, y, z - 0.5 * side, door_x, y - 0.2, z + 2.0 * side},
            {room_x, y, room_z, door_x + generate_unit(&r), y - 0.3, z}};
        for (int k = 0; k < 3; ++k) {
            if (!generate_look(out, rows[k], rows[k] + 3)) {
                return false;
            }
        }
    }
    return true;
}

const generate_kind generate_building = {
    "building",
    {{"floors", 4, 1, 200}, {"rooms", 24, 2, 2000}, {"seed", 1, 0, UINT32_MAX}},
    building_model,
    building_path};

/* The plan of a building of the city, and where its corner is: all stand on one square grid. */
static void lay_out_block(const uint64_t *values, uint32_t block, building_plan *p, double at[2])
{
    const uint64_t one[3] = {values[1], values[2], values[3] + 7919u * (uint64_t)block};
    lay_out(one, p);
    double x = WALL + CROSS + (p->columns - 1) * (WALL + 6.0) + WALL, z = p->rows * (WALL + 6.0) + WALL;
    double pitch = (x > z ? x : z) + STREET;
    at[0] = pitch * (double)(block % values[0]);
    at[1] = pitch * (double)(block / values[0]);
}

static bool city_model(const uint64_t *values, model *m)
{
    building_plan plan;
    building_maker b = {.plan = &plan, .m = m};
    b.failed = !make_shapes(&b);
    for (uint32_t block = 0; block < values[0] * values[0] && !b.failed; ++block) {
        double at[2];
        lay_out_block(values, block, &plan, at);
        b.x = at[0];
        b.z = at[1];
        put_building(&b);
    }
    free(b.shapes);
    generate_mesh_free(&b.mesh);
    return !b.failed;
}

/* By turns from inside of a building and along a street. */
static bool city_path(const uint64_t *values, camera_path *out)
{
    generate_random r = generate_stream(values[3], -1, -2);
    for (uint32_t v = 0; v < VIEWS / 3; ++v) {
        building_plan p;
        double at[2], eye[3], target[3];
        lay_out_block(values, generate_below(&r, (uint32_t)(values[0] * values[0])), &p, at);
        uint32_t floor = generate_below(&r, p.floors), corridor = 3 * generate_below(&r, p.rows / 3) + 1;
        eye[0] = at[0] + WALL + (p.x[p.columns] - WALL) * (0.1 + 0.8 * generate_unit(&r));
        eye[1] = floor * STOREY + SLAB + EYE_HEIGHT;
        eye[2] = at[1] + p.z[corridor] + WALL + CORRIDOR / 2;
        target[0] = eye[0] + (v % 2 == 0 ? 20.0 : -20.0);
        target[1] = eye[1];
        target[2] = eye[2] + 2.0 * generate_unit(&r) - 1.0;
        double street[3] = {at[0] - STREET / 2, SLAB + EYE_HEIGHT, at[1] + 40.0 * generate_unit(&r)};
        double down[3] = {street[0] + 6.0 * generate_unit(&r), street[1], street[2] + 30.0};
        double across[3] = {street[0] + 30.0, street[1] + 2.0, street[2] + 20.0 * generate_unit(&r)};
        if (!generate_look(out, eye, target) || !generate_look(out, street, down) ||
            !generate_look(out, street, across)) {
            return false;
        }
    }
    return true;
}

const generate_kind generate_sodacity = {
    "sodacity",
    {{"blocks", 3, 1, 40}, {"floors", 4, 1, 200}, {"rooms", 24, 2, 2000}, {"seed", 1, 0, UINT32_MAX}},
    city_model,
    city_path};

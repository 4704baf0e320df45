/* Keyholes: a wall with a small hole on a known sight-line, or a border that it just clears, and at its end a point of an object.
 * The object is in every set, before and after refinement; with the hole filled it is often hidden, so the scenes ask for
 * something. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "bake/region_state.h"
#include "support/ray_bodies.h"
#include "support/segments.h"

static uint32_t times(uint32_t small)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size == NULL ? 3 * small : size[0] == 's' ? small : 60 * small;
}

/* ---- shapes -------------------------------------------------------------------------------------- */

static const uint8_t NO_FLAGS[64];

/* From -1/2 to 1/2. */
static uint32_t add_cube(model *m)
{
    static const uint32_t faces[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                                          {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    float corners[8][3];
    for (int c = 0; c < 8; ++c) {
        for (int k = 0; k < 3; ++k) {
            corners[c][k] = (c >> k & 1) != 0 ? 0.5f : -0.5f;
        }
    }
    model_mesh mesh = {&corners[0][0], (uint32_t *)faces, (uint8_t *)NO_FLAGS, 8, 12};
    return model_add_mesh(m, &mesh);
}

static void add_quad(uint32_t (*faces)[3], uint32_t *count, uint32_t a, uint32_t b, uint32_t c, uint32_t e)
{
    memcpy(faces[(*count)++], (uint32_t[3]){a, b, c}, 3 * sizeof a);
    memcpy(faces[(*count)++], (uint32_t[3]){a, c, e}, 3 * sizeof a);
}

/* x from -1/2 to 1/2, y and z from -1 to 1, with a square hole of half that size times `hole`: a solid that is not convex. */
static uint32_t add_frame(model *m, double hole)
{
    static const double corners[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    float p[16][3];
    uint32_t faces[32][3], count = 0;
    for (int i = 0; i < 16; ++i) { /* outer back and front, inner back and front */
        double size = i < 8 ? 1.0 : hole;
        p[i][0] = (i / 4) % 2 == 0 ? -0.5f : 0.5f;
        p[i][1] = (float)(corners[i % 4][0] * size);
        p[i][2] = (float)(corners[i % 4][1] * size);
    }
    for (uint32_t i = 0; i < 4; ++i) {
        uint32_t k = (i + 1) % 4;
        add_quad(faces, &count, 4 + i, 4 + k, 12 + k, 12 + i);
        add_quad(faces, &count, i, 8 + i, 8 + k, k);
        add_quad(faces, &count, i, k, 4 + k, 4 + i);
        add_quad(faces, &count, 8 + i, 12 + i, 12 + k, 8 + k);
    }
    model_mesh mesh = {&p[0][0], &faces[0][0], (uint8_t *)NO_FLAGS, 16, 32};
    return model_add_mesh(m, &mesh);
}

/* One triangle, blunt or sharp. */
static uint32_t add_triangle(model *m, dice *d)
{
    float p[3][3];
    uint32_t face[3] = {0, 1, 2};
    for (int c = 0; c < 3; ++c) {
        for (int k = 0; k < 3; ++k) {
            p[c][k] = (float)dice_between(d, -0.5, 0.5);
        }
    }
    model_mesh mesh = {&p[0][0], face, (uint8_t *)NO_FLAGS, 3, 1};
    return model_add_mesh(m, &mesh);
}

/* ---- sight-lines ---------------------------------------------------------------------------------- */

typedef struct sight {
    umb_region_query query;
    double from[3], to[3], way[3], length;
    double axes[3][3]; /* of the wall: its first one is across it */
} sight;

static void normalize(double v[3])
{
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int k = 0; k < 3; ++k) {
        v[k] /= length;
    }
}

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; ++k) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        out[k] = a[i] * b[j] - a[j] * b[i];
    }
}

/* Any direction; along an axis; level; between two or three axes. */
static void draw_way(dice *d, double out[3])
{
    uint32_t kind = dice_roll(d, 5), axis = dice_roll(d, 3);
    for (uint32_t k = 0; k < 3; ++k) {
        double x = dice_between(d, -1, 1);
        out[k] = kind == 0   ? x
                 : kind == 1 ? (k == axis ? (x < 0 ? -1 : 1) : 0.02 * x)
                 : kind == 2 ? (k == 1 ? 0.1 * x : x)
                 : kind == 3 ? (k == axis ? 0.01 * x : x < 0 ? -1 : 1)
                             : (x < 0 ? -1 : 1);
    }
    normalize(out);
}

/* A wall straight across the way, turned anyhow, or one that goes along two axes. */
static void draw_axes(dice *d, const double way[3], double axes[3][3])
{
    double other[3] = {dice_between(d, -1, 1), dice_between(d, -1, 1), dice_between(d, -1, 1)};
    memcpy(axes[0], way, sizeof axes[0]);
    if (dice_roll(d, 2) == 0) {
        int axis = fabs(way[0]) > fabs(way[1]) ? 0 : 1;
        axis = fabs(way[2]) > fabs(way[axis]) ? 2 : axis;
        for (int k = 0; k < 3; ++k) {
            axes[0][k] = k == axis ? 1.0 : 0.0;
            other[k] = k == (axis + 1) % 3 ? 1.0 : 0.0;
        }
    }
    cross(axes[0], other, axes[1]);
    normalize(axes[1]);
    cross(axes[0], axes[1], axes[2]);
}

static void draw_settings(dice *d, umb_region_query *q)
{
    static const uint32_t resolutions[] = {64, 64, 128};
    static const double outers[] = {0.0, 0.0, 2.0, 8.0, 1.5};
    q->resolution = resolutions[dice_roll(d, 3)];
    q->outer = outers[dice_roll(d, 5)];
    q->umbrae = 1 + dice_roll(d, 4);
    q->half_umbra = dice_roll(d, 6) == 0;
    q->up = (umb_region_up)(dice_roll(d, 3) > 0 ? 0 : dice_roll(d, 3));
    q->up = q->outer == 0.0 && !q->half_umbra && dice_roll(d, 2) == 0 ? UMB_UP_NONE : q->up;
}

static void draw_sight(dice *d, sight *s)
{
    memset(s, 0, sizeof *s);
    bool corner = dice_roll(d, 2) == 0;
    double size = exp(dice_between(d, log(0.02), log(4.0)));
    for (int k = 0; k < 3; ++k) {
        double half = dice_roll(d, 8) == 0 ? 0.0 : size * dice_between(d, 0.1, 1), middle = dice_between(d, -30, 30);
        s->query.min[k] = middle - half;
        s->query.max[k] = middle + half;
        s->from[k] = middle + half * (corner ? (dice_roll(d, 2) == 0 ? -1.0 : 1.0) : dice_between(d, -1, 1));
    }
    draw_way(d, s->way);
    s->length = exp(dice_between(d, log(10.0), log(150.0)));
    for (int k = 0; k < 3; ++k) {
        s->to[k] = s->from[k] + s->length * s->way[k];
    }
    draw_axes(d, s->way, s->axes);
    draw_settings(d, &s->query);
}

/* ---- scenes --------------------------------------------------------------------------------------- */

/* A box in coordinates of the wall, or the frame: middle and size along its axes. */
static void add_part(model *m, uint32_t mesh, const sight *s, const double at[3], const double middle[3], const double size[3])
{
    umb_transform t;
    for (int k = 0; k < 3; ++k) {
        double x = at[k];
        for (int a = 0; a < 3; ++a) {
            t.m[k][a] = (float)(s->axes[a][k] * size[a]);
            x += s->axes[a][k] * middle[a];
        }
        t.m[k][3] = (float)x;
    }
    (void)model_add_object(m, "wall", mesh, &t);
}

typedef struct hole {
    double at[3];       /* where the sight-line goes through, moved to the middle of the hole */
    double wide, outer; /* half sizes of the hole and of the wall */
    double thick;
    uint32_t kind; /* a frame, four plates about a hole, two beside a slit, one that ends beside the line */
} hole;

static hole draw_hole(dice *d, const sight *s)
{
    hole h = {.kind = dice_roll(d, 4)};
    double cell = 0.0, along = s->length * dice_between(d, 0.15, 0.85);
    for (int k = 0; k < 3; ++k) {
        cell = fmax(cell, s->query.max[k] - s->query.min[k]);
    }
    h.outer = 2.0 * cell + s->length * dice_between(d, 0.1, 0.6);
    h.wide = h.outer * exp(dice_between(d, log(1e-4), log(0.2)));
    h.thick = dice_roll(d, 2) == 0 ? 0.1 * h.wide : h.outer * dice_between(d, 0.01, 0.3);
    for (int k = 0; k < 3; ++k) {
        h.at[k] = s->from[k] + along * s->way[k];
    }
    for (int a = 1; a < 3; ++a) {
        double x = h.wide * dice_between(d, -0.99, 0.99);
        for (int k = 0; k < 3; ++k) {
            h.at[k] += x * s->axes[a][k];
        }
    }
    return h;
}

static void add_wall(model *m, dice *d, uint32_t cube, const sight *s, const hole *h, bool filled)
{
    double middle = 0.5 * (h->outer + h->wide), rest = h->outer - h->wide;
    if (h->kind == 0) {
        add_part(m, add_frame(m, h->wide / h->outer), s, h->at, (double[3]){0}, (double[3]){h->thick, h->outer, h->outer});
    }
    for (int i = 0; i < 4 && h->kind > 0; ++i) {
        if ((h->kind == 2 && i > 1) || (h->kind == 3 && i > 0)) {
            continue;
        }
        int across = i < 2 ? 1 : 2;
        double at[3] = {h->kind == 2 ? dice_between(d, -0.1, 0.1) * s->length : 0.0, 0, 0}, size[3] = {h->thick, 2 * h->outer, 2 * h->outer};
        at[across] = i % 2 == 0 ? middle : -middle;
        size[across] = rest;
        add_part(m, cube, s, h->at, at, size);
    }
    if (filled) {
        double size = h->kind >= 2 ? 2.0 * h->outer : 3.0 * h->wide;
        double across = h->kind == 3 ? 2.0 * h->outer : 3.0 * h->wide;
        add_part(m, cube, s, h->at, (double[3]){0}, (double[3]){fmax(h->thick, 0.5 * h->wide), across, size});
    }
}

/* What is seen from behind hides nothing: a sheet over the hole that faces away, a body or a frame that the cell is in. */
static void add_backs(model *m, dice *d, uint32_t cube, const sight *s, const hole *h)
{
    uint32_t faces[2][3] = {{0, 1, 2}, {0, 2, 3}}, kind = dice_roll(d, 8);
    float corners[4][3] = {{0, -1, -1}, {0, 1, -1}, {0, 1, 1}, {0, -1, 1}};
    model_mesh sheet = {&corners[0][0], &faces[0][0], (uint8_t *)NO_FLAGS, 4, 2};
    double cell = 0.0, middle[3];
    for (int k = 0; k < 3; ++k) {
        cell = fmax(cell, s->query.max[k] - s->query.min[k]);
        middle[k] = 0.5 * (s->query.min[k] + s->query.max[k]);
    }
    double size = 3.0 * cell + 0.02 * s->length, wide = 2.0 * size;
    if (kind < 2) {
        bool faces_here = s->axes[0][0] * s->way[0] + s->axes[0][1] * s->way[1] + s->axes[0][2] * s->way[2] < 0.0;
        double turn = faces_here ? -1.0 : 1.0;
        add_part(m, model_add_mesh(m, &sheet), s, h->at, (double[3]){0}, (double[3]){1.0, turn * h->outer, h->outer});
    } else if (kind == 2) {
        add_part(m, cube, s, middle, (double[3]){0}, (double[3]){size, size, size});
    } else if (kind == 3) { /* in the middle of its lower side */
        add_part(m, add_frame(m, 0.5), s, middle, (double[3]){0, 0, 0.75 * wide}, (double[3]){size, wide, wide});
    }
}

/* At the end of the sight-line: a corner of it, or a point of a triangle. Its number is 0. */
static void add_target(model *m, dice *d, uint32_t mesh, const sight *s)
{
    const model_mesh *shape = &m->meshes[mesh];
    const uint32_t *t = &shape->indices[3 * dice_roll(d, shape->triangle_count)];
    double x = dice_between(d, 0, 1), y = dice_between(d, 0, 1 - x), share[3] = {1 - x - y, x, y}, p[3] = {0, 0, 0};
    double size = s->length * exp(dice_between(d, log(0.003), log(0.15)));
    bool corner = dice_roll(d, 3) > 0, upright = dice_roll(d, 2) == 0;
    for (int c = 0; c < 3; ++c) {
        for (int k = 0; k < 3; ++k) {
            p[k] += (corner ? (c == 0 ? 1.0 : 0.0) : share[c]) * shape->positions[3 * t[c] + (uint32_t)k];
        }
    }
    umb_transform turn = {{{0}}};
    double a[3] = {dice_between(d, -1, 1), dice_between(d, -1, 1), dice_between(d, -1, 1)}, b[3] = {a[1], -a[2], a[0]}, axes[3][3];
    normalize(a);
    cross(a, b, axes[1]);
    normalize(axes[1]);
    cross(a, axes[1], axes[2]);
    memcpy(axes[0], a, sizeof axes[0]);
    for (int k = 0; k < 3; ++k) {
        double at = s->to[k];
        for (int i = 0; i < 3; ++i) {
            turn.m[k][i] = (float)(size * (upright ? (i == k ? 1.0 : 0.0) : axes[i][k]));
            at -= turn.m[k][i] * p[i];
        }
        turn.m[k][3] = (float)at;
    }
    (void)model_add_object(m, "target", mesh, &turn);
}

/* Things about, that may stand in the way: then the scene is of no use. */
static void add_clutter(model *m, dice *d, uint32_t cube, const sight *s)
{
    for (uint32_t i = 0; i < 6; ++i) {
        umb_transform t = {{{0}}};
        double along = s->length * dice_between(d, 0.1, 0.95), away = s->length * dice_between(d, 0.01, 0.3);
        for (int k = 0; k < 3; ++k) {
            t.m[k][k] = (float)(away * dice_between(d, 0.1, 1.5));
            t.m[k][3] = (float)(s->from[k] + along * s->way[k] + away * dice_between(d, -1, 1));
        }
        (void)model_add_object(m, "box", cube, &t);
    }
}

/* Small things behind the cell: beside them it is large. */
static void add_dust(model *m, dice *d, uint32_t cube, const sight *s, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        umb_transform t = {{{0}}};
        double away = 40.0 + 40.0 * dice_between(d, 0, 1);
        for (int k = 0; k < 3; ++k) {
            t.m[k][k] = (float)dice_between(d, 0.1, 0.3);
            t.m[k][3] = (float)(s->from[k] - away * s->way[k] + dice_between(d, -10, 10));
        }
        (void)model_add_object(m, "dust", cube, &t);
    }
}

/* Everything is the same with the hole filled. */
static model *make_scene(uint64_t seed, const sight *s, bool filled, uint32_t dust)
{
    dice d = {seed};
    umb_error error;
    model *m = model_create();
    assert_non_null(m);
    uint32_t cube = add_cube(m), target = dice_roll(&d, 2) == 0 ? cube : add_triangle(m, &d);
    hole h = draw_hole(&d, s);
    add_target(m, &d, target, s);
    add_wall(m, &d, cube, s, &h, filled);
    add_backs(m, &d, cube, s, &h);
    if (dice_roll(&d, 2) == 0) {
        add_clutter(m, &d, cube, s);
    }
    add_dust(m, &d, cube, s, dust);
    assert_true(model_finish(m, NULL, &error));
    return m;
}

/* The target of a sight-line as the scene has it: its vertices are rounded. */
static bool find_way(const model *m, const sight *s)
{
    segments *all = segments_create(m, false);
    double nearest = INFINITY, to[3], corners[3][3];
    for (uint32_t t = 0; t < m->meshes[m->objects[0].mesh].triangle_count; ++t) {
        segments_triangle(all, 0, t, corners);
        for (int c = 0; c < 3; ++c) {
            double apart = fabs(corners[c][0] - s->to[0]) + fabs(corners[c][1] - s->to[1]) + fabs(corners[c][2] - s->to[2]);
            if (apart < nearest) {
                nearest = apart;
                memcpy(to, corners[c], sizeof to);
            }
        }
    }
    bool at_corner = nearest < 1e-3 * s->length;
    bool free_way = segments_free_way(all, s->from, at_corner ? to : s->to);
    free_way = free_way && (at_corner || segments_first(all, s->from, (double[3]){s->from[0] + 2 * (s->to[0] - s->from[0]),
                                                                                s->from[1] + 2 * (s->to[1] - s->from[1]),
                                                                                s->from[2] + 2 * (s->to[2] - s->from[2])}) == 0);
    segments_free(all);
    return free_way;
}

enum { IN_PVS = 1, IN_REFINED = 2, BY_PARTS = 4 };

/* In which sets object 0 is, and whether parts of the cell were asked about. */
static int solve(const model *m, const sight *s, uint32_t effort)
{
    umb_error error;
    umb_index *index;
    umb_region *region;
    umb_region_answer a;
    umb_scene *scene = model_scene(m, false, (umb_tasks){0}, NULL, &error);
    assert_non_null(scene);
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    assert_int_equal(umb_region_create(index, NULL, &region), UMB_OK);
    assert_int_equal(umb_region_solve(region, &s->query, &a), UMB_OK);
    int in = a.pvs_count > 0 && a.pvs[0] == 0 ? IN_PVS : 0;
    assert_int_equal(umb_region_refine(region, effort, &a), UMB_OK);
    in |= a.refined_count > 0 && a.refined[0] == 0 ? IN_REFINED : 0;
    in |= region->part != NULL ? BY_PARTS : 0;
    umb_region_destroy(region);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    return in;
}

static void test_keyholes(void **state)
{
    (void)state;
    dice d = {61};
    uint32_t open = 0, hidden = 0, refined = 0, tries = times(1500);
    for (uint32_t i = 0; i < tries; ++i) {
        sight s;
        draw_sight(&d, &s);
        uint64_t seed = 1000u + i;
        uint32_t effort = i % 3 == 0 ? 0 : i % 3 == 1 ? 64 : 20000;
        model *m = make_scene(seed, &s, false, 0);
        if (find_way(m, &s)) {
            open += 1;
            int in = solve(m, &s, effort) & ~BY_PARTS;
            if (in != (IN_PVS | IN_REFINED)) {
                printf("scene %u: hidden in set %d\n", i, in);
            }
            assert_int_equal(in, IN_PVS | IN_REFINED);
            model *closed = make_scene(seed, &s, true, 0);
            in = i % 4 == 0 ? solve(closed, &s, effort) & ~BY_PARTS : IN_PVS | IN_REFINED;
            hidden += (in & IN_PVS) == 0 ? 1 : 0;
            refined += in == IN_PVS ? 1 : 0;
            model_free(closed);
        }
        model_free(m);
    }
    printf("%u keyholes; of %u without a hole %u hidden, and %u after refinement\n", open, open / 4, hidden, refined);
    assert_true(open > tries / 4 && hidden > open / 40 && refined > open / 400);
}

/* The cell goes on around where the line starts, mostly farther on one side: a part of it sees through the hole. */
static void enlarge_cell(dice *d, sight *s)
{
    bool corner = dice_roll(d, 4) == 0;
    for (int k = 0; k < 3; ++k) {
        bool up = s->from[k] == s->query.max[k] ? false : s->from[k] == s->query.min[k] || dice_roll(d, 2) == 0;
        double more = dice_roll(d, 4) == 0 ? 0.0 : dice_between(d, 2, 12), less = corner ? 0.0 : dice_between(d, 0.1, 2);
        s->query.max[k] += up ? more : less;
        s->query.min[k] -= up ? less : more;
    }
}

/* Large cells, which are cut into parts. */
static void test_parts(void **state)
{
    (void)state;
    dice d = {62};
    uint32_t open = 0, parted = 0, refined = 0, by_parts = 0, tries = times(250);
    for (uint32_t i = 0; i < tries; ++i) {
        sight s;
        do {
            draw_sight(&d, &s);
        } while (s.length < 50.0);
        enlarge_cell(&d, &s);
        uint64_t seed = 5000u + i;
        uint32_t effort = i % 3 == 0 ? 0 : i % 3 == 1 ? 64 : 4000;
        model *m = make_scene(seed, &s, false, 400);
        if (find_way(m, &s)) {
            open += 1;
            int in = solve(m, &s, effort);
            if ((in & ~BY_PARTS) != (IN_PVS | IN_REFINED)) {
                printf("large cell %u: hidden in set %d\n", i, in);
            }
            assert_int_equal(in & ~BY_PARTS, IN_PVS | IN_REFINED);
            parted += (in & BY_PARTS) != 0 ? 1 : 0;
            model *closed = make_scene(seed, &s, true, 400);
            in = i % 2 == 0 ? solve(closed, &s, effort) : IN_REFINED;
            refined += (in & IN_REFINED) == 0 ? 1 : 0;
            by_parts += in == (IN_PVS | BY_PARTS) ? 1 : 0;
            model_free(closed);
        }
        model_free(m);
    }
    printf("%u keyholes of large cells, %u cut; without a hole %u hidden, %u where cells were cut\n", open, parted, refined, by_parts);
    assert_true(open > tries / 4 && parted > open / 20 && by_parts > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_keyholes), cmocka_unit_test(test_parts)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

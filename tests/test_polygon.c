/* Polygons with holes: as many triangles as the corners say, none turned over, and every point
 * of the plane covered as often as the rings wind around it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "io/polygon.h"
#include "support/random_boxes.h"

#define MAX_CORNERS 256
#define MAX_RINGS 8

typedef struct rings {
    double corners[MAX_CORNERS][3];
    uint32_t starts[MAX_RINGS + 1];
    uint32_t count;
} rings;

static void add_ring(rings *r, uint32_t corners)
{
    r->starts[r->count + 1] = r->starts[r->count] + corners;
    ++r->count;
}

static double turn(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* Crossings of the rings with a ray to the right of p: odd inside, holes counting against. */
static bool inside_rings(const rings *r, const double p[2])
{
    bool inside = false;
    for (uint32_t ring = 0; ring < r->count; ++ring) {
        uint32_t end = r->starts[ring + 1];
        for (uint32_t i = r->starts[ring]; i < end; ++i) {
            const double *a = r->corners[i];
            const double *b = r->corners[i + 1 < end ? i + 1 : r->starts[ring]];
            if ((a[1] > p[1]) != (b[1] > p[1])) {
                double x = a[0] + (p[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
                inside = inside != (x > p[0]);
            }
        }
    }
    return inside;
}

static void check(const rings *r, uint64_t *random, double reach)
{
    uint32_t cut[MAX_CORNERS + 2 * MAX_RINGS][3];
    bool sound;
    polygon p = {.corners = (const double(*)[3])r->corners, .starts = r->starts, .rings = r->count};
    uint32_t count = polygon_triangulate(&p, cut, &sound);
    assert_true(sound);
    assert_int_equal(count, r->starts[r->count] + 2 * (r->count - 1) - 2);
    for (uint32_t t = 0; t < count; ++t) {
        assert_true(turn(r->corners[cut[t][0]], r->corners[cut[t][1]], r->corners[cut[t][2]]) >= 0.0);
    }
    for (int i = 0; i < 200; ++i) {
        double at[2] = {random_in(random, -reach, reach), random_in(random, -reach, reach)};
        uint32_t covers = 0;
        for (uint32_t t = 0; t < count; ++t) {
            bool in = true;
            for (int k = 0; k < 3; ++k) {
                in = in && turn(r->corners[cut[t][k]], r->corners[cut[t][(k + 1) % 3]], at) > 0.0;
            }
            covers += in;
        }
        assert_int_equal(covers, inside_rings(r, at));
    }
}

/* A star around a centre: corners at growing angles, so that it never crosses itself. */
static void star(rings *r, uint64_t *random, const double centre[2], double small, double large,
                 uint32_t corners, bool clockwise, double grid)
{
    uint32_t first = r->starts[r->count];
    for (uint32_t i = 0; i < corners; ++i) {
        double angle = 6.283185307179586 * (i + random_in(random, 0.05, 0.95)) / corners;
        double radius = random_in(random, small, large);
        double *p = r->corners[first + (clockwise ? corners - 1 - i : i)];
        p[0] = rint((centre[0] + radius * cos(angle)) / grid) * grid;
        p[1] = rint((centre[1] + radius * sin(angle)) / grid) * grid;
        p[2] = 0.0;
    }
    add_ring(r, corners);
}

static void random_stars(void **state)
{
    (void)state;
    uint64_t random = 21;
    for (int round = 0; round < 1500; ++round) {
        rings r = {.count = 0};
        const double origin[2] = {0.0, 0.0};
        uint32_t corners = 5 + random_below(&random, 60);
        star(&r, &random, origin, 60.0, 100.0, corners, false, 0x1p-16);
        /* The star's inner disc is 60 wide where its corners stand at less than half a turn:
         * holes keep to a disc that every chord stays out of. */
        double room = 60.0 * cos(6.283185307179586 / corners) - 1.0;
        uint32_t holes = room > 12.0 ? random_below(&random, 5) : 0;
        for (uint32_t h = 0; h < holes; ++h) {
            double angle = 6.283185307179586 * h / holes;
            double distance = holes == 1 ? 0.0 : 0.5 * room;
            double size = holes == 1 ? room : holes == 2 ? 0.45 * room : 0.33 * room;
            const double centre[2] = {distance * cos(angle), distance * sin(angle)};
            star(&r, &random, centre, 0.3 * size, size, 3 + random_below(&random, 20),
                 random_below(&random, 2) == 0, 0x1p-16);
        }
        check(&r, &random, 110.0);
    }
}

/* Corners on a coarse grid: many in line with others, bridges that touch corners. */
static void combs_and_grids(void **state)
{
    (void)state;
    uint64_t random = 9;
    for (int round = 0; round < 500; ++round) {
        rings r = {.count = 0};
        uint32_t size = 4 + 2 * random_below(&random, 6);
        uint32_t n = 0;
        /* A square with a corner at every whole number of its sides. */
        for (uint32_t side = 0; side < 4; ++side) {
            for (uint32_t i = 0; i < size; ++i, ++n) {
                static const int way[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
                static const int from[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
                r.corners[n][0] = from[side][0] * (double)size + way[side][0] * (double)i;
                r.corners[n][1] = from[side][1] * (double)size + way[side][1] * (double)i;
            }
        }
        add_ring(&r, n);
        /* Square holes on a diagonal or in a row. */
        bool diagonal = random_below(&random, 2) == 0;
        for (uint32_t h = 0; h + 1 < size / 2 && h < MAX_RINGS - 1; ++h) {
            double x = 2.0 * h + 1.0;
            double y = diagonal ? x : 1.0;
            const double hole[4][2] = {{x, y}, {x, y + 1}, {x + 1, y + 1}, {x + 1, y}};
            bool backwards = random_below(&random, 2) == 0;
            for (uint32_t i = 0; i < 4; ++i) {
                memcpy(r.corners[n + i], hole[backwards ? 3 - i : i], sizeof hole[0]);
            }
            n += 4;
            add_ring(&r, 4);
        }
        check(&r, &random, (double)size + 1.0);
    }
}

/* The plane may lie anyhow: the turn is kept in space. */
static void any_plane(void **state)
{
    (void)state;
    uint64_t random = 2;
    for (int round = 0; round < 200; ++round) {
        rings r = {.count = 0};
        const double origin[2] = {0.0, 0.0};
        star(&r, &random, origin, 5.0, 10.0, 12, round % 2 != 0, 0x1p-8);
        double u[3];
        double v[3];
        for (int k = 0; k < 3; ++k) {
            u[k] = rint(random_in(&random, -8.0, 8.0));
            v[k] = rint(random_in(&random, -8.0, 8.0));
        }
        const double normal[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                                  u[0] * v[1] - u[1] * v[0]};
        if (normal[0] == 0.0 && normal[1] == 0.0 && normal[2] == 0.0) {
            continue;
        }
        double sign = round % 2 != 0 ? -1.0 : 1.0;
        for (uint32_t i = 0; i < 12; ++i) {
            double x = r.corners[i][0];
            double y = r.corners[i][1];
            for (int k = 0; k < 3; ++k) {
                r.corners[i][k] = x * u[k] + y * v[k];
            }
        }
        uint32_t cut[MAX_CORNERS][3];
        bool sound;
        polygon p = {.corners = (const double(*)[3])r.corners, .starts = r.starts, .rings = 1};
        assert_int_equal(polygon_triangulate(&p, cut, &sound), 10);
        assert_true(sound);
        for (int t = 0; t < 10; ++t) {
            const double *a = r.corners[cut[t][0]];
            const double *b = r.corners[cut[t][1]];
            const double *c = r.corners[cut[t][2]];
            double along = 0.0;
            for (int k = 0; k < 3; ++k) {
                int i = (k + 1) % 3;
                int j = (k + 2) % 3;
                along += normal[k] * ((b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i]));
            }
            assert_true(sign * along >= 0.0);
        }
    }
}

/* Rings that are no polygon: an answer, never a hang, and no claim to be sound where it is not. */
static void no_polygons(void **state)
{
    (void)state;
    uint64_t random = 77;
    uint32_t unsound = 0;
    for (int round = 0; round < 3000; ++round) {
        rings r = {.count = 0};
        uint32_t count = 1 + random_below(&random, 3);
        for (uint32_t ring = 0; ring < count; ++ring) {
            uint32_t corners = random_below(&random, 20);
            for (uint32_t i = 0; i < corners; ++i) {
                for (int k = 0; k < 3; ++k) {
                    r.corners[r.starts[ring] + i][k] = random_below(&random,
                                                                    round % 2 != 0 ? 4 : 1000);
                }
            }
            add_ring(&r, corners);
        }
        uint32_t cut[MAX_CORNERS + 2 * MAX_RINGS][3];
        bool sound;
        polygon p = {.corners = (const double(*)[3])r.corners, .starts = r.starts, .rings = r.count};
        uint32_t triangles = polygon_triangulate(&p, cut, &sound);
        assert_true(triangles <= r.starts[r.count] + 2 * r.count);
        for (uint32_t t = 0; t < triangles; ++t) {
            for (int k = 0; k < 3; ++k) {
                assert_true(cut[t][k] < r.starts[r.count]);
            }
        }
        unsound += !sound;
    }
    assert_true(unsound > 1000);
    bool sound;
    polygon none = {.corners = NULL, .starts = NULL, .rings = 0};
    assert_int_equal(polygon_triangulate(&none, NULL, &sound), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_stars),
        cmocka_unit_test(combs_and_grids),
        cmocka_unit_test(any_plane),
        cmocka_unit_test(no_polygons),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

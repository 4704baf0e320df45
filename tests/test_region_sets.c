/* Sets of view cells beside one another: with and without the look at bodies, refined once and again, whole and by parts, from engines
 * that are new and from used ones, before and after a commit. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/region_worlds.h"

static bool has(const uint32_t *ids, uint32_t count, uint32_t id)
{
    for (uint32_t i = 0; i < count; ++i) {
        if (ids[i] == id) {
            return true;
        }
    }
    return false;
}

static umb_transform box_at(double x, double y, double z, double sx, double sy, double sz)
{
    return (umb_transform){{{(float)sx, 0, 0, (float)x}, {0, (float)sy, 0, (float)y}, {0, 0, (float)sz, (float)z}}};
}

/* Ascending lists. */
static bool is_within(const uint32_t *a, uint32_t a_count, const uint32_t *b, uint32_t b_count)
{
    uint32_t k = 0;
    for (uint32_t i = 0; i < a_count; ++i) {
        while (k < b_count && b[k] < a[i]) {
            ++k;
        }
        if (k == b_count || b[k] != a[i] || (i > 0 && a[i] <= a[i - 1])) {
            return false;
        }
    }
    return true;
}

/* Several objects wide along two axes or three. */
static void draw_large_cell(dice *d, const world *w, double width, umb_region_query *q)
{
    const umb_aabb *b = &w->model->bounds;
    for (int k = 0; k < 3; ++k) {
        double size = width * (dice_roll(d, 4) == 0 ? 0.3 : 1.0 + 5.0 * unit(d));
        double middle = b->min[k] + (0.1 + 0.8 * unit(d)) * ((double)b->max[k] - b->min[k]);
        q->min[k] = middle - 0.5 * size;
        q->max[k] = middle + 0.5 * size;
    }
}

/* ---- with and without bodies ------------------------------------------------------------------------- */

static void compare_ways(world *w, umb_region_query q, tally *t, uint32_t *less, dice *d)
{
    umb_region_answer a;
    q.maps_only = true;
    assert_int_equal(umb_region_solve(w->region, &q, &a), UMB_OK);
    id_set maps = id_set_copy(a.pvs, a.pvs_count);
    assert_int_equal(a.stats.mapped, a.pvs_count);
    assert_true(a.stats.mapped_triangles == a.stats.pvs_triangles);
    assert_int_equal(umb_region_refine(w->region, 64, &a), UMB_OK);
    assert_true(is_within(a.refined, a.refined_count, maps.ids, maps.count));
    check_hidden(w, &q, a.refined, a.refined_count, 6, d, t);
    q.maps_only = false;
    assert_int_equal(umb_region_solve(w->region, &q, &a), UMB_OK);
    assert_int_equal(a.stats.mapped, maps.count);
    assert_true(is_within(a.pvs, a.pvs_count, maps.ids, maps.count));
    check_hidden(w, &q, a.pvs, a.pvs_count, 12, d, t);
    *less += maps.count - a.pvs_count;
    free(maps.ids);
}

static void test_maps_only(void **state)
{
    (void)state;
    static const char *const names[] = {"gen:city,triangles=5k,seed=4", "gen:boxfield,polygons=3000,seed=2", "gen:blocks,g=6"};
    uint32_t less = 0;
    tally t = {0};
    dice d = {101};
    for (int n = 0; n < 3; ++n) {
        world w;
        open_world(&w, names[n], n != 0);
        for (uint32_t i = 0; i < cells(6, 16); ++i) {
            umb_region_query q = {0};
            draw_cell(&d, &w.model->bounds, &q);
            draw_way(&d, &q);
            compare_ways(&w, q, &t, &less, &d);
        }
        close_world(&w);
    }
    printf("%u hidden, %u less for bodies, %u wrong\n", t.hidden, less, t.wrong);
    assert_int_equal(t.wrong, 0);
    assert_true(less > 20);
}

/* ---- refined again, by parts ---------------------------------------------------------------------------- */

/* With little effort first, then with more: sets only shrink, and nothing that is gone can be seen. Returns if parts were cut. */
static bool refine_again(world *w, const umb_region_query *q, tally *t, dice *d)
{
    static const uint32_t efforts[] = {4, 64, 700};
    umb_region_answer a;
    assert_int_equal(umb_region_solve(w->region, q, &a), UMB_OK);
    id_set last = id_set_copy(a.pvs, a.pvs_count);
    uint32_t pvs = a.pvs_count;
    check_hidden(w, q, a.pvs, a.pvs_count, 6, d, t);
    for (int i = 0; i < 3; ++i) {
        assert_int_equal(umb_region_refine(w->region, efforts[i], &a), UMB_OK);
        assert_int_equal(a.pvs_count, pvs);
        assert_true(is_within(a.refined, a.refined_count, last.ids, last.count));
        assert_true(a.stats.undecided <= a.refined_count);
        free(last.ids);
        last = id_set_copy(a.refined, a.refined_count);
    }
    check_hidden(w, q, a.refined, a.refined_count, 12, d, t);
    free(last.ids);
    return w->region->part != NULL;
}

static void test_large_cells(void **state)
{
    (void)state;
    static const char *const names[] = {"gen:city,triangles=5k,seed=6", "gen:boxfield,polygons=3000,seed=8", "gen:building"};
    tally t = {0};
    dice d = {102};
    uint32_t parted = 0;
    for (int n = 0; n < 3; ++n) {
        world w;
        open_world(&w, names[n], n != 1);
        double width = 0.0;
        for (uint32_t i = 0; i < (n == 2 ? cells(1, 3) : cells(3, 9)); ++i) {
            umb_region_query q = {.resolution = i % 3 == 0 ? 64 : 128};
            draw_large_cell(&d, &w, i == 0 ? 4.0 : width, &q);
            parted += refine_again(&w, &q, &t, &d) ? 1 : 0;
            width = umb_region_width(w.region);
        }
        close_world(&w);
    }
    printf("%u hidden, %u cells cut, %u wrong\n", t.hidden, parted, t.wrong);
    assert_int_equal(t.wrong, 0);
    assert_true(parted > 3);
}

/* ---- a hole that parts of a cell see through ------------------------------------------------------------------- */

enum { TARGETS = 13 };

/* A fence of planks before a long cell, with a hole so small that no sample finds it, and things in a row behind it: each is seen
 * from a short piece of the cell alone. From above:
 *
 *      o  o  o  o  o  o  o  o  o  o  o  o  o
 *
 *             ----------- . -----------
 *               [.....................]
 */
typedef struct fence {
    double hole[3], wide, at[TARGETS][3], seen_from[TARGETS][3], seen_at[TARGETS][3];
    uint32_t planks;
    umb_region_query query;
} fence;

static void draw_fence(dice *d, fence *f)
{
    double near = 8.0 + 4.0 * unit(d), far = near * (3.0 + unit(d)), half = 0.4;
    *f = (fence){.hole = {8.0, 0.2 + 0.4 * unit(d), near}, .wide = 0.002 + 0.004 * unit(d), .planks = 20 + dice_roll(d, 28)};
    f->query = (umb_region_query){{0, 0, -0.25}, {16, 1, 0.25}, .up = UMB_UP_Y, .resolution = 128};
    for (int i = 0; i < TARGETS; ++i) {
        double x = 0.5 + 15.0 * i / (TARGETS - 1), from[3] = {x, f->hole[1] + 0.1 * unit(d) - 0.05, 0.0};
        double along = far / near, front = (far - half - 1e-4) / near; /* just before it */
        for (int k = 0; k < 3; ++k) {
            f->seen_from[i][k] = from[k];
            f->at[i][k] = from[k] + along * (f->hole[k] - from[k]);
            f->seen_at[i][k] = from[k] + front * (f->hole[k] - from[k]);
        }
    }
}

static void add_cube_at(model *m, uint32_t cube, const char *name, const double min[3], const double max[3])
{
    umb_transform t = box_at(0.5 * (min[0] + max[0]), 0.5 * (min[1] + max[1]), 0.5 * (min[2] + max[2]), max[0] - min[0], max[1] - min[1],
                             max[2] - min[2]);
    (void)model_add_object(m, name, cube, &t);
}

/* Targets are numbers 0 to 12. */
static model *make_fence(const fence *f, bool filled)
{
    umb_error error;
    uint32_t cube;
    model *m = model_with_cube(&cube);
    for (int i = 0; i < TARGETS; ++i) {
        const double *c = f->at[i];
        add_cube_at(m, cube, "target", (double[3]){c[0] - 0.4, c[1] - 0.4, c[2] - 0.4}, (double[3]){c[0] + 0.4, c[1] + 0.4, c[2] + 0.4});
    }
    double step = 60.0 / f->planks, z[2] = {f->hole[2] - 0.001, f->hole[2] + 0.001};
    for (uint32_t i = 0; i < f->planks; ++i) {
        double x[2] = {-22.0 + step * i, -22.0 + step * (i + 1.2)};
        bool hole = f->hole[0] > x[0] - 0.1 && f->hole[0] < x[1] + 0.1;
        if (!hole || filled) {
            add_cube_at(m, cube, "plank", (double[3]){x[0], -12, z[0]}, (double[3]){x[1], 12, z[1]});
        } else {
            add_cube_at(m, cube, "plank", (double[3]){x[0], -12, z[0]}, (double[3]){x[1], f->hole[1] - f->wide, z[1]});
            add_cube_at(m, cube, "plank", (double[3]){x[0], f->hole[1] + f->wide, z[0]}, (double[3]){x[1], 12, z[1]});
        }
    }
    for (int side = 0; side < 2 && !filled; ++side) { /* what is left of the slit */
        double x[2] = {side == 0 ? f->hole[0] - 5.0 : f->hole[0] + 0.01, side == 0 ? f->hole[0] - 0.01 : f->hole[0] + 5.0};
        add_cube_at(m, cube, "plank", (double[3]){x[0], f->hole[1] - 0.1, z[0]}, (double[3]){x[1], f->hole[1] + 0.1, z[1]});
    }
    assert_true(model_finish(m, NULL, &error));
    return m;
}

static void test_fences(void **state)
{
    (void)state;
    dice d = {104};
    uint32_t seen = 0, parted = 0, hidden = 0, tries = cells(12, 40);
    for (uint32_t n = 0; n < tries; ++n) {
        fence f;
        draw_fence(&d, &f);
        for (int filled = 0; filled < 2; ++filled) {
            world w;
            umb_region_answer a;
            open_model(&w, make_fence(&f, filled == 1), n % 2 == 0, false);
            assert_int_equal(umb_region_solve(w.region, &f.query, &a), UMB_OK);
            assert_int_equal(umb_region_refine(w.region, n % 3 == 0 ? 0 : n % 3 == 1 ? 64 : 3000, &a), UMB_OK);
            parted += w.region->part != NULL ? 1 : 0;
            for (uint32_t i = 0; i < TARGETS; ++i) {
                bool in = has(a.refined, a.refined_count, i);
                if (filled == 0 && segments_free_way(w.segments, f.seen_from[i], f.seen_at[i])) {
                    seen += 1;
                    assert_true(in);
                }
                hidden += filled == 1 && !in ? 1 : 0;
            }
            close_world(&w);
        }
    }
    printf("%u seen through holes, %u cells cut of %u, %u hidden without a hole\n", seen, parted, 2 * tries, hidden);
    assert_true(seen > 10 * tries && parted > tries / 2 && hidden > tries);
}

/* ---- new engines and used ones ---------------------------------------------------------------------------- */

enum { CELLS = 7 };

typedef struct both_sets {
    id_set pvs, refined;
} both_sets;

static both_sets solve_with(umb_region *region, const umb_region_query *q)
{
    umb_region_answer a;
    assert_int_equal(umb_region_solve(region, q, &a), UMB_OK);
    id_set pvs = id_set_copy(a.pvs, a.pvs_count);
    assert_int_equal(umb_region_refine(region, 100, &a), UMB_OK);
    return (both_sets){pvs, id_set_copy(a.refined, a.refined_count)};
}

static void expect_same(const both_sets *a, both_sets b)
{
    assert_int_equal(a->pvs.count, b.pvs.count);
    assert_memory_equal(a->pvs.ids, b.pvs.ids, b.pvs.count * sizeof *b.pvs.ids);
    assert_int_equal(a->refined.count, b.refined.count);
    assert_memory_equal(a->refined.ids, b.refined.ids, b.refined.count * sizeof *b.refined.ids);
    free(b.pvs.ids);
    free(b.refined.ids);
}

static umb_region *new_engine(const world *w, umb_tasks tasks)
{
    umb_region *region;
    assert_int_equal(umb_region_create(w->index, &(umb_region_def){.tasks = tasks}, &region), UMB_OK);
    return region;
}

/* Small cells, large ones, from the maps alone, and one so far away that bodies are found anew for it. */
static void draw_cells(dice *d, const world *w, umb_region_query *q)
{
    for (int i = 0; i < CELLS; ++i) {
        q[i] = (umb_region_query){.resolution = 64, .maps_only = i == 2};
        if (i % 2 == 0) {
            draw_cell(d, &w->model->bounds, &q[i]);
        } else {
            draw_large_cell(d, w, 6.0, &q[i]);
        }
    }
    for (int k = 0; k < 3; ++k) {
        q[3].min[k] += k == 0 ? 5000.0 : 0.0;
        q[3].max[k] += k == 0 ? 5000.0 : 0.0;
    }
}

static void test_used_engines(void **state)
{
    (void)state;
    static const char *const names[] = {"gen:city,triangles=5k,seed=7", "gen:boxfield,polygons=3000,seed=5"};
    umb_pool *pool;
    assert_int_equal(umb_pool_create(3, &pool), UMB_OK);
    dice d = {103};
    for (uint32_t n = 0; n < 2 * cells(1, 3); ++n) {
        world w;
        both_sets first[CELLS];
        umb_region_query q[CELLS];
        open_world(&w, names[n % 2], n % 4 < 2);
        draw_cells(&d, &w, q);
        umb_region *threads = new_engine(&w, umb_pool_tasks(pool));
        for (int i = 0; i < CELLS; ++i) {
            umb_region *fresh = new_engine(&w, (umb_tasks){0});
            first[i] = solve_with(fresh, &q[i]);
            umb_region_destroy(fresh);
        }
        for (int i = 0; i < CELLS; ++i) {
            expect_same(&first[i], solve_with(w.region, &q[i]));
        }
        for (int i = CELLS - 1; i >= 0; --i) {
            expect_same(&first[i], solve_with(w.region, &q[i]));
            expect_same(&first[i], solve_with(threads, &q[i]));
        }
        for (int i = 0; i < CELLS; ++i) {
            free(first[i].pvs.ids);
            free(first[i].refined.ids);
        }
        umb_region_destroy(threads);
        close_world(&w);
    }
    umb_pool_destroy(pool);
}

/* ---- after a commit ------------------------------------------------------------------------------------------ */

/* A wall, number 0, twenty boxes behind it, and things around that keep the scene as large as it is. */
static model *make_yard(void)
{
    umb_error error;
    uint32_t cube;
    model *m = model_with_cube(&cube);
    umb_transform t = box_at(20, 0, 0, 1, 60, 60);
    (void)model_add_object(m, "wall", cube, &t);
    for (int i = 0; i < 20; ++i) {
        t = box_at(30 + 1.5 * i, 0.5 * (i % 5) - 1, i % 7 - 3, 0.5, 0.5, 0.5);
        (void)model_add_object(m, "box", cube, &t);
    }
    for (int i = 0; i < 8; ++i) {
        t = box_at((i & 1) != 0 ? 500 : -500, (i & 2) != 0 ? 500 : -500, (i & 4) != 0 ? 500 : -500, 1, 1, 1);
        (void)model_add_object(m, "corner", cube, &t);
    }
    assert_true(model_finish(m, NULL, &error));
    return m;
}

static void move_wall(world *w, double z)
{
    umb_transform t = box_at(20, 0, z, 1, 60, 60);
    assert_int_equal(umb_scene_move_object(w->scene, 0, &t, NULL), UMB_OK);
    assert_int_equal(umb_scene_commit(w->scene), UMB_OK);
}

/* How many of the boxes are in the sets. */
static void count_boxes(world *w, const umb_region_query *q, uint32_t *pvs, uint32_t *refined)
{
    umb_region_answer a;
    assert_int_equal(umb_region_solve(w->region, q, &a), UMB_OK);
    *pvs = *refined = 0;
    for (uint32_t i = 1; i <= 20; ++i) {
        *pvs += has(a.pvs, a.pvs_count, i) ? 1 : 0;
    }
    assert_int_equal(umb_region_refine(w->region, 4096, &a), UMB_OK);
    for (uint32_t i = 1; i <= 20; ++i) {
        *refined += has(a.refined, a.refined_count, i) ? 1 : 0;
    }
}

/* A wall that has gone hides nothing where it was, whatever an engine knows of it; it hides again when it is back. */
static void test_moved_wall(void **state)
{
    (void)state;
    for (int kind = 0; kind < 4; ++kind) {
        world w;
        double half = kind % 2 == 0 ? 0.5 : 14.0;
        umb_region_query q = {{-half, -half, -half}, {half, half, half}, .up = UMB_UP_Y, .maps_only = kind >= 2};
        uint32_t pvs, refined;
        open_model(&w, make_yard(), false, false);
        for (int round = 0; round < 3; ++round) {
            count_boxes(&w, &q, &pvs, &refined);
            assert_int_equal(refined, 0);
            move_wall(&w, 300.0);
            count_boxes(&w, &q, &pvs, &refined);
            assert_int_equal(pvs, 20);
            assert_int_equal(refined, 20);
            move_wall(&w, 0.0);
        }
        assert_int_equal(umb_scene_remove_object(w.scene, 0), UMB_OK);
        assert_int_equal(umb_scene_commit(w.scene), UMB_OK);
        count_boxes(&w, &q, &pvs, &refined);
        assert_int_equal(refined, 20);
        close_world(&w);
    }
}

int main(int count, char **words)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_maps_only),
        cmocka_unit_test(test_large_cells),
        cmocka_unit_test(test_fences),
        cmocka_unit_test(test_used_engines),
        cmocka_unit_test(test_moved_wall),
    };
    if (count > 1) {
        cmocka_set_test_filter(words[1]);
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}

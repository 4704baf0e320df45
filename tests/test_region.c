/* From-region visibility: no object that is reported hidden is reached by a segment from the cell; on generated
 * scenes, solids, walls and soups, for cells of every kind, in every way of asking. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/mutants.h"
#include "support/region_worlds.h"
#include "support/surfaces.h"

static void run_scene(const char *name, bool weld, uint32_t cells, uint32_t rays, uint64_t seed)
{
    world w;
    open_world(&w, name, weld);
    dice d = {seed};
    tally t = {0};
    for (uint32_t i = 0; i < cells; ++i) {
        umb_region_query q = {0};
        draw_cell(&d, &w.model->bounds, &q);
        draw_way(&d, &q);
        ask(&w, &q, rays, &d, &t);
    }
    printf("%-40s %u cells, %u of %u hidden, %u rays, %u wrong\n", name, t.cells, t.hidden, t.objects, t.rays, t.wrong);
    close_world(&w);
    assert_int_equal(t.wrong, 0);
}

static void test_city(void **state)
{
    (void)state;
    uint32_t n = cells(2, 7);
    run_scene("gen:city,triangles=8k", true, n, 20, 1);
    run_scene("gen:city,triangles=8k,seed=5", false, n, 20, 2);
}

static void test_boxfield(void **state)
{
    (void)state;
    uint32_t n = cells(2, 7);
    run_scene("gen:boxfield,polygons=3000", true, n, 20, 3);
    run_scene("gen:boxfield,polygons=6000,seed=9", false, n, 20, 4);
}

static void test_building(void **state)
{
    (void)state;
    uint32_t n = cells(1, 5);
    run_scene("gen:building", true, n, 10, 5);
    run_scene("gen:building", false, n, 10, 6);
}

static void test_blocks(void **state)
{
    (void)state;
    run_scene("gen:blocks,g=8", true, cells(2, 7), 20, 7);
}

/* ---- planted mistakes ------------------------------------------------------------------------- */

typedef struct hunt {
    const char *scene; /* NULL: the walls */
    uint32_t cells;
} hunt;

/* Four long walls around the middle, leaning a little, and small boxes beyond them at all heights. */
static model *make_walls(void)
{
    umb_error error;
    uint32_t cube;
    model *m = model_with_cube(&cube);
    dice d = {5};
    for (int i = 0; i < 4; ++i) {
        float c = i % 2 == 0 ? 1.0f : 0.0f, sign = i < 2 ? 1.0f : -1.0f, lean = 0.3f * (float)i;
        umb_transform t = {{{80 * c + 2 * (1 - c), 0, lean, 30 * sign * (1 - c)},
                            {0, 24, 0, 6},
                            {lean, 0, 80 * (1 - c) + 2 * c, 30 * sign * c}}};
        (void)model_add_object(m, "wall", cube, &t);
    }
    for (int i = 0; i < 600; ++i) {
        double angle = 6.283 * unit(&d), far = 60 + 100 * unit(&d), size = 0.5 + 3 * unit(&d);
        umb_transform t = {{{(float)size, 0, 0, (float)(far * cos(angle))},
                            {0, (float)size, 0, (float)(120 * unit(&d) - 30)},
                            {0, 0, (float)size, (float)(far * sin(angle))}}};
        (void)model_add_object(m, "box", cube, &t);
    }
    assert_true(model_finish(m, NULL, &error));
    return m;
}

/* How many objects are hidden wrongly with these kernels. Cells lie among the boxes, resolutions are low. */
static uint32_t hunt_with(const umb_umbra_kernels *kernels, uint32_t *hidden)
{
    static const hunt hunts[] = {{NULL, 60}, {"gen:boxfield,polygons=6000,seed=3", 20}, {"gen:blocks,g=6", 20}};
    tally t = {0};
    for (size_t k = 0; k < sizeof hunts / sizeof hunts[0]; ++k) {
        world w;
        if (hunts[k].scene != NULL) {
            open_world(&w, hunts[k].scene, true);
        } else {
            open_model(&w, make_walls(), true, false);
        }
        w.region->kernels = kernels;
        dice d = {77};
        for (uint32_t i = 0; i < hunts[k].cells; ++i) {
            umb_region_query q = {.resolution = 64, .umbrae = 1 + i % 4, .up = i % 8 < 4 ? UMB_UP_Y : UMB_UP_NONE};
            umb_region_answer a;
            static const umb_aabb inside = {{-24, 0, -24}, {24, 10, 24}};
            draw_cell(&d, hunts[k].scene != NULL ? &w.model->bounds : &inside, &q);
            assert_int_equal(umb_region_solve(w.region, &q, &a), UMB_OK);
            check_hidden(&w, &q, a.pvs, a.pvs_count, 100, &d, &t);
        }
        close_world(&w);
    }
    *hidden = t.hidden;
    return t.wrong;
}

static void test_mutants(void **state)
{
    (void)state;
    if (is_small()) {
        skip(); /* rare mistakes take many cells to be found */
    }
    static const umb_umbra_kernels *const mutants[MUTANT_COUNT] = {&mutant_1, &mutant_2, &mutant_3, &mutant_4};
    uint32_t hidden, bad = 0;
    assert_int_equal(hunt_with(umb_umbra_kernels_get(UMB_ISA_AUTO), &hidden), 0);
    for (int i = 0; i < MUTANT_COUNT; ++i) {
        uint32_t wrong = hunt_with(mutants[i], &hidden);
        printf("mistake %d: %u of %u hidden wrongly\n", i + 1, wrong, hidden);
        bad += wrong == 0 ? 1 : 0;
    }
    assert_int_equal(bad, 0);
}

/* ---- the walk's end ------------------------------------------------------------------------------ */

/* Eight walls in two rings around a cell shut everything out that lies beyond. A beam that reaches from inside far out through
 * one of them is seen all the same, though the walk ends long before its far side. */
static void test_beam(void **state)
{
    (void)state;
    umb_error error;
    uint32_t cube, beam;
    model *m = model_with_cube(&cube);
    for (int i = 0; i < 8; ++i) {
        double angle = i * 0.785398163397448, c = cos(angle), s = sin(angle), far = i % 2 == 0 ? 22 : 34;
        umb_transform wall = {{{(float)(2 * c), 0, (float)(-56 * s), (float)(far * c)},
                               {0, 80, 0, 0},
                               {(float)(2 * s), 0, (float)(56 * c), (float)(far * s)}}};
        (void)model_add_object(m, "wall", cube, &wall);
    }
    beam = m->object_count;
    (void)model_add_object(m, "beam", cube, &(umb_transform){{{400, 0, 0, 210}, {0, 1, 0, 0}, {0, 0, 1, 0}}});
    for (int i = 0; i < 100; ++i) {
        (void)model_add_object(m, "box", cube, &(umb_transform){{{4, 0, 0, (float)(100 + 5 * i)}, {0, 4, 0, 10}, {0, 0, 4, 30}}});
    }
    assert_true(model_finish(m, NULL, &error));
    world w;
    open_model(&w, m, true, false);
    umb_region_query q = {.min = {-2, -1, -2}, .max = {2, 1, 2}, .up = UMB_UP_Y};
    umb_region_answer a;
    assert_int_equal(umb_region_solve(w.region, &q, &a), UMB_OK);
    assert_true(w.region->queue_count > 0); /* it ended early */
    bool found = false;
    for (uint32_t i = 0; i < a.pvs_count; ++i) {
        found = found || a.pvs[i] == beam;
        assert_true(a.pvs[i] <= beam);
    }
    assert_true(found);
    close_world(&w);
}

/* ---- cells of every kind ------------------------------------------------------------------------ */

/* Cells that share corners, edges and faces with objects, reach into them, are flat or single points, hold everything or
 * lie far away. */
static void test_adversarial_cells(void **state)
{
    (void)state;
    static const char *const names[] = {"gen:city,triangles=5k,seed=3", "gen:building", "gen:boxfield,polygons=2400"};
    dice d = {91};
    for (int n = 0; n < 3; ++n) {
        world w;
        tally t = {0};
        open_world(&w, names[n], true);
        for (uint32_t i = 0; i < cells(1, 7); ++i) {
            umb_region_query q = {0};
            const umb_aabb *b = &w.model->objects[dice_roll(&d, w.model->object_count)].bounds;
            for (int k = 0; k < 3; ++k) {
                double size = (double)b->max[k] - b->min[k];
                uint32_t kind = (i + (uint32_t)k * (i % 3)) % 6;
                q.min[k] = kind < 2 ? b->max[k] : kind == 2 ? b->min[k] - size : kind == 3 ? b->min[k] + 0.5 * size : b->min[k];
                q.max[k] = q.min[k] + (kind == 1 || kind == 3 ? 0.0 : kind == 5 ? 40.0 * size : size);
            }
            draw_way(&d, &q);
            ask(&w, &q, 10, &d, &t);
        }
        umb_region_query whole = {{-1e4, -1e4, -1e4}, {1e4, 1e4, 1e4}, .resolution = 64}, far = {{1e6, 10, 1e6}, {1e6, 20, 1e6}, .up = UMB_UP_Y};
        ask(&w, &whole, 2, &d, &t);
        ask(&w, &far, 2, &d, &t);
        printf("%-40s %u cells, %u of %u hidden, %u wrong\n", names[n], t.cells, t.hidden, t.objects, t.wrong);
        close_world(&w);
        assert_int_equal(t.wrong, 0);
    }
}

static void test_two_sided(void **state)
{
    (void)state;
    world w;
    tally t = {0};
    umb_error error;
    dice d = {17};
    open_model(&w, model_load("gen:city,triangles=5k", &(model_options){.two_sided = true}, &error), true, true);
    for (uint32_t i = 0; i < cells(16, 30); ++i) {
        umb_region_query q = {0};
        draw_cell(&d, &w.model->bounds, &q);
        draw_way(&d, &q);
        ask(&w, &q, 10, &d, &t);
    }
    close_world(&w);
    assert_true(t.hidden > 0);
    assert_int_equal(t.wrong, 0);
}

/* What a near plane could cut away hides nothing: sight-lines start ahead of the eye. */
static void test_near(void **state)
{
    (void)state;
    world w;
    open_world(&w, "gen:city,triangles=8k", true);
    umb_region_query q = {{48, 1, 40}, {50, 3, 42}, .resolution = 128};
    umb_region_answer a;
    assert_int_equal(umb_region_solve(w.region, &q, &a), UMB_OK);
    uint32_t without = a.pvs_count;
    q.near_depth = 5.0;
    assert_int_equal(umb_region_solve(w.region, &q, &a), UMB_OK);
    assert_true(a.pvs_count > without);
    q.near_depth = 1e4;
    assert_int_equal(umb_region_solve(w.region, &q, &a), UMB_OK);
    assert_int_equal(a.pvs_count, a.stats.objects);
    assert_int_equal(a.stats.occluders, 0);
    close_world(&w);
}

/* ---- the call ------------------------------------------------------------------------------------- */

static void test_errors(void **state)
{
    (void)state;
    world w;
    open_world(&w, "gen:blocks,g=3", true);
    umb_region_answer a;
    assert_int_equal(umb_region_refine(w.region, 0, &a), UMB_ERROR_STATE);
    static const umb_region_query bad[] = {
        {{1, 2, 3}, {0, 4, 5}, .up = UMB_UP_Y},      {{NAN, 0, 0}, {1, 1, 1}, .up = UMB_UP_Y},
        {{0, 0, 0}, {1, INFINITY, 1}, .up = UMB_UP_Y}, {{0, 0, 0}, {1, 1, 1}, .up = (umb_region_up)7},
        {{0, 0, 0}, {1, 1, 1}, .up = UMB_UP_NONE, .outer = 2.0}, {{0, 0, 0}, {1, 1, 1}, .up = UMB_UP_NONE, .half_umbra = true},
        {{0, 0, 0}, {1, 1, 1}, .resolution = 63},    {{0, 0, 0}, {1, 1, 1}, .resolution = 2049},
        {{0, 0, 0}, {1, 1, 1}, .umbrae = 9},         {{0, 0, 0}, {1, 1, 1}, .outer = 1.0},
        {{0, 0, 0}, {1, 1, 1}, .outer = -2.0},       {{0, 0, 0}, {1, 1, 1}, .outer = NAN},
        {{0, 0, 0}, {1, 1, 1}, .near_depth = -1.0},  {{0, 0, 0}, {1, 1, 1}, .near_depth = NAN}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
        w.error.text[0] = 0;
        assert_int_equal(umb_region_solve(w.region, &bad[i], &a), UMB_ERROR_ARGUMENT);
        assert_true(w.error.text[0] != 0);
        assert_int_equal(a.pvs_count, 0);
    }
    assert_int_equal(umb_region_solve(w.region, &(umb_region_query){{0}, {0}, .up = UMB_UP_Y}, &a), UMB_OK);
    close_world(&w);
}

static void test_empty(void **state)
{
    (void)state;
    umb_scene *scene;
    umb_index *index;
    umb_region *region;
    umb_region_answer a;
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    assert_int_equal(umb_region_create(index, NULL, &region), UMB_OK);
    assert_int_equal(umb_region_solve(region, &(umb_region_query){{0}, {1, 1, 1}, .up = UMB_UP_Z}, &a), UMB_OK);
    assert_int_equal(a.pvs_count, 0);
    assert_int_equal(umb_region_refine(region, 0, &a), UMB_OK);
    assert_int_equal(a.refined_count, 0);
    umb_region_destroy(region);
    umb_region_destroy(NULL);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

static uint64_t hash_of(const uint32_t *ids, uint32_t count)
{
    uint64_t h = 1469598103934665603u;
    for (uint32_t i = 0; i < count; ++i) {
        h = (h ^ ids[i]) * 1099511628211u;
    }
    return h;
}

/* The same set whatever the instruction set and the threads. */
static void test_same_everywhere(void **state)
{
    (void)state;
    static const char *const names[] = {"gen:city,triangles=8k", "gen:boxfield,polygons=3000"};
    umb_pool *pool;
    assert_int_equal(umb_pool_create(3, &pool), UMB_OK);
    for (int n = 0; n < 2; ++n) {
        world w;
        open_world(&w, names[n], true);
        umb_region_query q = {{40, 1, 35}, {44, 3, 42}, .resolution = 128, .umbrae = 3};
        umb_region_answer a;
        uint64_t first[2] = {0, 0};
        for (int isa = UMB_ISA_AUTO; isa <= UMB_ISA_NEON; ++isa) {
            umb_region *region;
            umb_region_def def = {.isa = (umb_isa)isa, .tasks = isa % 2 == 0 ? umb_pool_tasks(pool) : (umb_tasks){0}};
            if (!umb_isa_available((umb_isa)isa)) {
                assert_int_equal(umb_region_create(w.index, &def, &region), UMB_ERROR_ARGUMENT);
                continue;
            }
            assert_int_equal(umb_region_create(w.index, &def, &region), UMB_OK);
            assert_int_equal(umb_region_solve(region, &q, &a), UMB_OK);
            assert_int_equal(umb_region_refine(region, 0, &a), UMB_OK);
            uint64_t now[2] = {hash_of(a.pvs, a.pvs_count), hash_of(a.refined, a.refined_count)};
            memcpy(first, isa == UMB_ISA_AUTO ? now : first, sizeof first);
            assert_memory_equal(first, now, sizeof now);
            umb_region_destroy(region);
        }
        printf("golden region_%d %016llx_%016llx\n", n, (unsigned long long)first[0], (unsigned long long)first[1]);
        close_world(&w);
    }
    umb_pool_destroy(pool);
}

/* Boxes, some of which lack a triangle, and a house of two wings and two storeys. */
static void fill_scene(umb_scene *scene)
{
    umb_shape shape;
    static const float corners[8][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
    static const uint32_t faces[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    static const int none[3] = {0, 0, 0}, upper[3] = {0, 0, 4};
    umb_shape_def def = {.positions = &corners[0][0], .position_count = 8, .indices = faces, .index_count = 33};
    uint32_t id;
    for (uint32_t i = 0; i < 60; ++i) {
        def.index_count = i % 2 == 0 ? 36 : 33; /* convex, and open */
        assert_int_equal(umb_scene_add_shape(scene, &def, &shape), UMB_OK);
        umb_object_def object = {.shape = shape, .flags = UMB_OBJECT_IS_SHAPE,
                                 .transform = {{{3, 0, 0, 4.0f * (float)(i % 8)}, {0, 3, 0, 0}, {0, 0, 3, 5.0f * (float)(i / 8)}}}};
        assert_int_equal(umb_scene_add_object(scene, &object, &id), UMB_OK);
    }
    surface house = {.point_count = 0};
    add_outline(&house, &CORNER, none, 4);
    add_outline(&house, &CORNER, upper, 3);
    umb_object_def object = {.flags = UMB_OBJECT_IS_SHAPE, .transform = {{{0.25f, 0, 0, -4}, {0, 0, 0.25f, 0}, {0, -0.25f, 0, 16}}}};
    def = (umb_shape_def){.positions = &house.points[0][0], .position_count = house.point_count, .indices = &house.faces[0][0],
                          .index_count = 3 * house.face_count};
    assert_int_equal(umb_scene_add_shape(scene, &def, &object.shape), UMB_OK);
    assert_int_equal(umb_scene_add_object(scene, &object, &id), UMB_OK);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
}

/* What a query answers when nothing fails, and whether bodies and parts were there. */
static id_set first_answer(umb_index *index, const umb_region_query *q, bool parts)
{
    umb_region *region;
    umb_region_answer a;
    assert_int_equal(umb_region_create(index, NULL, &region), UMB_OK);
    assert_int_equal(umb_region_solve(region, q, &a), UMB_OK);
    assert_int_equal(umb_region_refine(region, 0, &a), UMB_OK);
    assert_true(region->found.count > 20 && region->solids.count > 20);
    assert_int_equal(region->part != NULL, parts);
    id_set first = id_set_copy(a.refined, a.refined_count);
    umb_region_destroy(region);
    return first;
}

static void expect_answer(const id_set *first, const umb_region_answer *a)
{
    assert_int_equal(first->count, a->refined_count);
    assert_memory_equal(first->ids, a->refined, first->count * sizeof *first->ids);
}

/* Every request of memory fails once: an error comes back, nothing leaks, and the next try answers the same. */
static void fail_each(failing *f, umb_index *index, const umb_region_query *q, bool parts)
{
    id_set first = first_answer(index, q, parts);
    long long held = atomic_load(&f->held);
    bool done = false;
    for (long long limit = 0; !done; ++limit) {
        umb_region *region = NULL;
        umb_region_answer a;
        atomic_store(&f->left, limit);
        umb_result result = umb_region_create(index, NULL, &region);
        result = result == UMB_OK ? umb_region_solve(region, q, &a) : result;
        bool solved = result == UMB_OK;
        result = solved ? umb_region_refine(region, 0, &a) : result;
        assert_true(result == UMB_OK || result == UMB_ERROR_MEMORY);
        done = result == UMB_OK;
        atomic_store(&f->left, 1 << 30);
        if (solved && !done) {
            assert_int_equal(umb_region_refine(region, 0, &a), UMB_OK);
            expect_answer(&first, &a);
        }
        if (region != NULL && !done) {
            assert_int_equal(umb_region_solve(region, q, &a), UMB_OK);
            assert_int_equal(umb_region_refine(region, 0, &a), UMB_OK);
            expect_answer(&first, &a);
        }
        umb_region_destroy(region);
        assert_int_equal(atomic_load(&f->held), held);
    }
    free(first.ids);
}

static void test_memory(void **state)
{
    (void)state;
    failing f;
    umb_allocator allocator = failing_allocator(&f, 1 << 30);
    umb_scene *scene;
    umb_index *index;
    assert_int_equal(umb_scene_create(&(umb_scene_def){.allocator = allocator}, &scene), UMB_OK);
    fill_scene(scene);
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    fail_each(&f, index, &(umb_region_query){{-8, 1, 10}, {-7, 2, 12}, .resolution = 64}, false);
    fail_each(&f, index, &(umb_region_query){{-9, 1, 10}, {-6, 2, 12}, .resolution = 64}, true);
    fail_each(&f, index, &(umb_region_query){{-9, 1, 10}, {-6, 2, 12}, .resolution = 64, .maps_only = true}, true);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    assert_int_equal(atomic_load(&f.held), 0);
}

int main(int count, char **words)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_city),
        cmocka_unit_test(test_beam),
        cmocka_unit_test(test_boxfield),
        cmocka_unit_test(test_building),
        cmocka_unit_test(test_blocks),
        cmocka_unit_test(test_adversarial_cells),
        cmocka_unit_test(test_two_sided),
        cmocka_unit_test(test_near),
        cmocka_unit_test(test_errors),
        cmocka_unit_test(test_empty),
        cmocka_unit_test(test_same_everywhere),
        cmocka_unit_test(test_memory),
        cmocka_unit_test(test_mutants),
    };
    if (count > 1) {
        cmocka_set_test_filter(words[1]);
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}

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

#include "support/failing.h"
#include "support/segments.h"

typedef struct world {
    model *model;
    umb_scene *scene;
    umb_index *index;
    umb_region *region;
    segments *segments;
    umb_error error;
} world;

static bool is_small(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && strcmp(size, "small") == 0;
}

static double unit(dice *d)
{
    return dice_roll(d, 1u << 30) / (double)(1u << 30);
}

static void open_model(world *w, model *m, bool weld, bool two_sided)
{
    memset(w, 0, sizeof *w);
    assert_non_null(m);
    w->model = m;
    w->scene = model_scene(m, weld, (umb_tasks){0}, NULL, &w->error);
    assert_non_null(w->scene);
    assert_int_equal(umb_index_create(w->scene, NULL, &w->index), UMB_OK);
    assert_int_equal(umb_region_create(w->index, &(umb_region_def){.error = &w->error}, &w->region), UMB_OK);
    w->segments = segments_create(m, two_sided);
}

static void open_world(world *w, const char *name, bool weld)
{
    umb_error error;
    open_model(w, model_load(name, NULL, &error), weld, false);
}

static void close_world(world *w)
{
    segments_free(w->segments);
    umb_region_destroy(w->region);
    umb_index_destroy(w->index);
    umb_scene_destroy(w->scene);
    model_free(w->model);
}


/* A point of the cell: anywhere, on its surface or its corners. */
static void draw_origin(dice *d, const umb_region_query *q, double out[3])
{
    uint32_t kind = dice_roll(d, 3);
    for (int k = 0; k < 3; ++k) {
        double x = kind == 0 ? unit(d) : dice_roll(d, 2);
        out[k] = q->min[k] + x * (q->max[k] - q->min[k]);
    }
    if (kind == 1) {
        int k = (int)dice_roll(d, 3);
        out[k] = q->min[k] + unit(d) * (q->max[k] - q->min[k]);
    }
}

static void draw_target(dice *d, const world *w, uint32_t object, double out[3])
{
    double p[3][3], a = unit(d), b = unit(d);
    uint32_t n = w->model->meshes[w->model->objects[object].mesh].triangle_count;
    segments_triangle(w->segments, object, dice_roll(d, n), p);
    if (a + b > 1.0) {
        a = 1.0 - a;
        b = 1.0 - b;
    }
    for (int k = 0; k < 3; ++k) {
        out[k] = p[0][k] + a * (p[1][k] - p[0][k]) + b * (p[2][k] - p[0][k]);
    }
}

typedef struct tally {
    uint32_t cells, hidden, rays, objects, wrong;
} tally;

static void check_hidden(const world *w, const umb_region_query *q, const uint32_t *ids, uint32_t count,
                         uint32_t rays, dice *d, tally *t)
{
    uint8_t *seen = calloc(w->model->object_count + 1, 1);
    for (uint32_t i = 0; i < count; ++i) {
        seen[ids[i]] = 1;
    }
    for (uint32_t i = 0; i < w->model->object_count; ++i) {
        if (seen[i] || w->model->objects[i].mesh == MODEL_NONE) {
            continue;
        }
        t->hidden += 1;
        for (uint32_t k = 0; k < rays; ++k) {
            double a[3], b[3];
            draw_origin(d, q, a);
            draw_target(d, w, i, b);
            t->rays += 1;
            if (segments_free_way(w->segments, a, b)) {
                t->wrong += 1;
                printf("object %u hidden, seen from %.9g %.9g %.9g at %.9g %.9g %.9g\n", i, a[0], a[1], a[2], b[0],
                       b[1], b[2]);
                printf("  cell %.9g,%.9g,%.9g,%.9g,%.9g,%.9g up %d res %u K %u R %g half %d\n", q->min[0], q->min[1],
                       q->min[2], q->max[0], q->max[1], q->max[2], (int)q->up, q->resolution, q->umbrae, q->outer,
                       q->half_umbra);
                break;
            }
        }
    }
    free(seen);
    t->cells += 1;
    t->objects += w->model->object_count;
}

static void ask(world *w, const umb_region_query *q, uint32_t rays, dice *d, tally *t)
{
    umb_region_answer a;
    assert_int_equal(umb_region_solve(w->region, q, &a), UMB_OK);
    check_hidden(w, q, a.pvs, a.pvs_count, rays, d, t);
    uint32_t pvs = a.pvs_count;
    assert_int_equal(umb_region_refine(w->region, 64, &a), UMB_OK);
    assert_true(a.refined_count <= pvs);
    if (a.refined_count < pvs) {
        check_hidden(w, q, a.refined, a.refined_count, rays, d, t);
    }
}

/* A cell somewhere in or around the scene, sometimes flat, sometimes large. */
static void draw_cell(dice *d, const umb_aabb *b, umb_region_query *q)
{
    double part = pow(10.0, -3.0 * unit(d));
    for (int k = 0; k < 3; ++k) {
        double size = (double)b->max[k] - b->min[k], half = 0.25 * size * part * unit(d);
        double middle = b->min[k] + size * (1.4 * unit(d) - 0.2);
        half = dice_roll(d, 12) == 0 ? 0.0 : half;
        q->min[k] = middle - half;
        q->max[k] = middle + half;
    }
}

static void draw_way(dice *d, umb_region_query *q)
{
    static const uint32_t resolutions[] = {64, 64, 128, 256};
    static const double outers[] = {0.0, 0.0, 2.0, 8.0, 1.5, 100.0};
    static const uint32_t umbrae[] = {1, 2, 2, 4, 8};
    q->resolution = resolutions[dice_roll(d, 4)];
    q->outer = outers[dice_roll(d, 6)];
    q->umbrae = umbrae[dice_roll(d, 5)];
    q->half_umbra = dice_roll(d, 5) == 0;
    q->up = (umb_region_up)(dice_roll(d, 3) > 0 ? 0 : dice_roll(d, 3));
}

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
    uint32_t n = is_small() ? 6 : 40;
    run_scene("gen:city,triangles=8k", true, n, 20, 1);
    run_scene("gen:city,triangles=8k,seed=5", false, n, 20, 2);
}

static void test_boxfield(void **state)
{
    (void)state;
    uint32_t n = is_small() ? 6 : 40;
    run_scene("gen:boxfield,polygons=3000", true, n, 20, 3);
    run_scene("gen:boxfield,polygons=6000,seed=9", false, n, 20, 4);
}

static void test_building(void **state)
{
    (void)state;
    uint32_t n = is_small() ? 4 : 30;
    run_scene("gen:building", true, n, 10, 5);
    run_scene("gen:building", false, n, 10, 6);
}

static void test_blocks(void **state)
{
    (void)state;
    run_scene("gen:blocks,g=8", true, is_small() ? 6 : 40, 20, 7);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_city),
        cmocka_unit_test(test_boxfield),
        cmocka_unit_test(test_building),
        cmocka_unit_test(test_blocks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

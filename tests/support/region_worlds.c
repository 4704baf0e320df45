#include "region_worlds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

bool is_small(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && strcmp(size, "small") == 0;
}

uint32_t cells(uint32_t small, uint32_t normal)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    bool full = size != NULL && strcmp(size, "full") == 0;
    return is_small() ? small : full ? 6 * normal : normal;
}

double unit(dice *d)
{
    return dice_roll(d, 1u << 30) / (double)(1u << 30);
}

void open_model(world *w, model *m, bool weld, bool two_sided)
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

void open_world(world *w, const char *name, bool weld)
{
    umb_error error;
    open_model(w, model_load(name, NULL, &error), weld, false);
}

void close_world(world *w)
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

void check_hidden(const world *w, const umb_region_query *q, const uint32_t *ids, uint32_t count, uint32_t rays, dice *d, tally *t)
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
                if (w->region->kernels != umb_umbra_kernels_get(UMB_ISA_AUTO)) {
                    break;
                }
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

void ask(world *w, const umb_region_query *q, uint32_t rays, dice *d, tally *t)
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

void draw_cell(dice *d, const umb_aabb *b, umb_region_query *q)
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

void draw_way(dice *d, umb_region_query *q)
{
    static const uint32_t resolutions[] = {64, 64, 128, 256};
    static const double outers[] = {0.0, 0.0, 2.0, 8.0, 1.5, 100.0};
    static const uint32_t umbrae[] = {1, 2, 2, 4, 8};
    q->resolution = resolutions[dice_roll(d, 4)];
    q->outer = outers[dice_roll(d, 6)];
    q->umbrae = umbrae[dice_roll(d, 5)];
    q->half_umbra = dice_roll(d, 5) == 0;
    q->up = (umb_region_up)(dice_roll(d, 3) > 0 ? 0 : dice_roll(d, 3));
    q->up = q->outer == 0.0 && !q->half_umbra && dice_roll(d, 2) == 0 ? UMB_UP_NONE : q->up;
}

model *model_with_cube(uint32_t *out)
{
    static const uint32_t faces[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                                          {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    float corners[8][3];
    uint8_t flags[12] = {0};
    for (int c = 0; c < 8; ++c) {
        for (int k = 0; k < 3; ++k) {
            corners[c][k] = (c >> k & 1) != 0 ? 0.5f : -0.5f;
        }
    }
    model_mesh mesh = {&corners[0][0], (uint32_t *)faces, flags, 8, 12};
    model *m = model_create();
    *out = model_add_mesh(m, &mesh);
    return m;
}

id_set id_set_copy(const uint32_t *ids, uint32_t count)
{
    id_set s = {malloc((count + 1) * sizeof *ids), count};
    assert_non_null(s.ids);
    memcpy(s.ids, ids, count * sizeof *ids);
    return s;
}

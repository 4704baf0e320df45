/* The rivals and the oracle of the comparison, as far as published figures come from them: a z-buffer made
 * the slow way, the same answers with and without a tree, rays that exact arithmetic agrees with, and a
 * small contest whose outcome is known. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "compare/contest.h"
#include "compare/zbuffer_tree.h"
#include "truth/truth.h"

enum { WIDTH = 160, HEIGHT = 90 };

typedef struct fixture {
    world w;
    cameras c;
} fixture;

static int set_up(void **state)
{
    static fixture f;
    umb_error error = {0};
    if (!world_load(&f.w, "small", "gen:blocks,g=12", 144, &error) ||
        !cameras_path(&f.c, &f.w, "some", "gen:blocks,g=12", NULL, 4, 63,
                      (camera_turn){.pitch = -3.0, .roll = 5.0}, &error)) {
        return -1;
    }
    *state = &f;
    return 0;
}

static int tear_down(void **state)
{
    fixture *f = *state;
    cameras_free(&f->c);
    world_free(&f->w);
    return 0;
}

static double along(const umb_view *v, const double axis[3], const float p[3])
{
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) {
        sum += axis[k] * ((double)p[k] - v->eye[k]);
    }
    return sum;
}

/* 1 / depth where the line through a pixel's centre meets a front face, in doubles; 0: it does not. */
static double meet(const umb_view *v, const float *const p[3], double sx, double sy)
{
    double q[3][3];
    for (int i = 0; i < 3; ++i) {
        double x = along(v, v->right, p[i]);
        double y = along(v, v->up, p[i]);
        double w = along(v, v->forward, p[i]);
        q[i][0] = x - sx * w;
        q[i][1] = y - sy * w;
        q[i][2] = w;
    }
    double side[3];
    double sum = 0.0;
    double depth = 0.0;
    for (int i = 0; i < 3; ++i) {
        const double *a = q[(i + 1) % 3];
        const double *b = q[(i + 2) % 3];
        side[i] = a[0] * b[1] - a[1] * b[0];
        sum += side[i];
        depth += side[i] * q[i][2];
    }
    /* Counter-clockwise around the line, from in front: all areas are positive. */
    if (!(side[0] >= 0.0 && side[1] >= 0.0 && side[2] >= 0.0 && sum > 0.0)) {
        return 0.0;
    }
    depth /= sum;
    return depth >= v->near_depth ? 1.0 / depth : 0.0;
}

static void slow_depths(const world *w, const umb_view *v, double depth[HEIGHT][WIDTH])
{
    for (int y = 0; y < HEIGHT; ++y) {
        for (int x = 0; x < WIDTH; ++x) {
            double sx = v->x_min + (v->x_max - v->x_min) * (x + 0.5) / WIDTH;
            double sy = v->y_max - (v->y_max - v->y_min) * (y + 0.5) / HEIGHT;
            depth[y][x] = 0.0;
            for (uint32_t t = 0; t < w->triangle_count; ++t) {
                const float *p[3];
                for (int i = 0; i < 3; ++i) {
                    p[i] = w->vertices + 3 * (size_t)w->indices[3 * (size_t)t + i];
                }
                double at = meet(v, p, sx, sy);
                depth[y][x] = at > depth[y][x] ? at : depth[y][x];
            }
        }
    }
}

/* 1: hidden, 0: visible, -1: too close to call in floats. */
static int slow_answer(const world *w, const umb_view *v, double depth[HEIGHT][WIDTH], uint32_t box)
{
    double rect[4] = {1e30, -1e30, 1e30, -1e30};
    double nearest = 1e30;
    for (int k = 0; k < 8; ++k) {
        const float p[3] = {w->box[k & 1 ? 3 : 0][box], w->box[k & 2 ? 4 : 1][box],
                            w->box[k & 4 ? 5 : 2][box]};
        double z = along(v, v->forward, p);
        double x = (along(v, v->right, p) / z - v->x_min) / (v->x_max - v->x_min) * WIDTH;
        double y = (v->y_max - along(v, v->up, p) / z) / (v->y_max - v->y_min) * HEIGHT;
        nearest = fmin(nearest, z);
        rect[0] = fmin(rect[0], x);
        rect[1] = fmax(rect[1], x);
        rect[2] = fmin(rect[2], y);
        rect[3] = fmax(rect[3], y);
    }
    if (nearest < 1.001 * v->near_depth) {
        return nearest < v->near_depth ? 0 : -1;
    }
    for (int k = 0; k < 4; ++k) {
        if (fabs(rect[k] - round(rect[k])) < 1e-3) {
            return -1;
        }
    }
    bool close = false;
    for (int y = (int)fmax(0.0, floor(rect[2])); y <= (int)fmin(HEIGHT - 1.0, floor(rect[3])); ++y) {
        for (int x = (int)fmax(0.0, floor(rect[0])); x <= (int)fmin(WIDTH - 1.0, floor(rect[1]));
             ++x) {
            close = close || fabs(depth[y][x] * nearest - 1.0) < 1e-4;
            if (depth[y][x] * nearest <= 1.0 - 1e-4) {
                return 0;
            }
        }
    }
    return close ? -1 : 1;
}

static void zbuffer_is_what_the_slow_way_says(void **state)
{
    const fixture *f = *state;
    static double depth[HEIGHT][WIDTH];
    zbuffer *z = zbuffer_create(&f->w, WIDTH, HEIGHT);
    uint8_t *seen = malloc(f->w.model->object_count);
    uint32_t asked = 0;
    uint32_t differ = 0;
    uint32_t hidden = 0;
    assert_non_null(z);
    assert_non_null(seen);
    for (uint32_t v = 0; v < f->c.count; v += 6) {
        const uint32_t *objects;
        const umb_view *view = &f->c.views[v];
        screen_lens lens;
        uint32_t count = zbuffer_frame(z, view, &objects);
        memset(seen, 0, f->w.model->object_count);
        for (uint32_t i = 0; i < count; ++i) {
            seen[objects[i]] = 1;
        }
        slow_depths(&f->w, view, depth);
        screen_lens_make(&lens, view, WIDTH, HEIGHT);
        for (uint32_t b = 0; b < f->w.box_count; ++b) {
            float box[6][SCREEN_LANES];
            for (int k = 0; k < 6; ++k) {
                for (int j = 0; j < SCREEN_LANES; ++j) {
                    box[k][j] = f->w.box[k][b];
                }
            }
            int answer = slow_answer(&f->w, view, depth, b);
            if (answer >= 0 && screen_boxes_inside(&lens, (const float(*)[SCREEN_LANES])box) != 0) {
                ++asked;
                hidden += answer == 1;
                differ += (answer == 1) == (seen[f->w.box_object[b]] != 0);
            }
        }
    }
    free(seen);
    zbuffer_destroy(z);
    assert_true(asked > 300 && hidden > 100 && hidden < asked);
    /* An edge through a pixel's centre may fall to either side in floats. */
    assert_true(differ * 200 <= asked);
}

static int by_number(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a;
    uint32_t y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

static void tree_answers_as_the_flat_pass(void **state)
{
    const fixture *f = *state;
    zbuffer *z = zbuffer_create(&f->w, 512, 256);
    zbuffer_tree *t = zbuffer_tree_create(&f->w, 512, 256);
    uint32_t *a = malloc(f->w.box_count * sizeof *a);
    uint32_t *b = malloc(f->w.box_count * sizeof *b);
    assert_true(z != NULL && t != NULL && a != NULL && b != NULL);
    for (uint32_t v = 0; v < f->c.count; ++v) {
        const uint32_t *objects;
        uint32_t m = zbuffer_frame(z, &f->c.views[v], &objects);
        memcpy(a, objects, m * sizeof *a);
        uint32_t n = zbuffer_tree_frame(t, &f->c.views[v], &objects);
        memcpy(b, objects, n * sizeof *b);
        qsort(a, m, sizeof *a, by_number);
        qsort(b, n, sizeof *b, by_number);
        assert_int_equal(m, n);
        assert_memory_equal(a, b, n * sizeof *a);
    }
    free(a);
    free(b);
    zbuffer_tree_destroy(t);
    zbuffer_destroy(z);
}

static void items_are_truly_visible(void **state)
{
    const fixture *f = *state;
    umb_error error = {0};
    item_buffer items;
    truth *t = truth_create(f->w.model, &error);
    truth_options options = {.grid_width = 480, .grid_height = 270};
    assert_non_null(t);
    /* No folder to keep them in: they are traced each time. */
    assert_true(item_buffer_make(&items, &f->w, &f->c, 480, 270, "/nowhere", &error));
    assert_true(items.traced);
    for (uint32_t v = 0; v < f->c.count; v += 5) {
        truth_result result;
        uint32_t missed = 0;
        uint64_t pixels = 0;
        assert_true(truth_view(t, &f->c.views[v], &options, &result, &error));
        for (uint32_t i = 0; i < items.views[v].count; ++i) {
            uint32_t object = items.views[v].items[i].object;
            missed += result.culling[object].renderers == 0 &&
                      result.two_sided[object].renderers == 0;
            pixels += items.views[v].items[i].pixels;
        }
        assert_true(items.views[v].count > 0 && items.views[v].count <= result.visible);
        assert_true(pixels <= 480 * 270);
        assert_int_equal(missed, 0);
        truth_result_free(&result);
    }
    item_buffer_free(&items);
    truth_destroy(t);
}

/* An object of view 0 that a z-buffer hides and no ray finds. */
static uint32_t hidden_object(const fixture *f, const item_buffer *items)
{
    const uint32_t *objects;
    zbuffer *z = zbuffer_create(&f->w, 512, 256);
    assert_non_null(z);
    uint32_t count = zbuffer_frame(z, &f->c.views[0], &objects);
    for (uint32_t i = 0; i < f->w.model->object_count; ++i) {
        bool known = false;
        for (uint32_t k = 0; k < count; ++k) {
            known = known || objects[k] == i;
        }
        for (uint32_t k = 0; k < items->views[0].count; ++k) {
            known = known || items->views[0].items[k].object == i;
        }
        if (!known) {
            zbuffer_destroy(z);
            return i;
        }
    }
    fail();
    return 0;
}

static void contest_counts_what_is_hidden_wrongly(void **state)
{
    const fixture *f = *state;
    umb_error error = {0};
    static contest result;
    item_buffer items;
    uint32_t blamed = 0;
    assert_true(item_buffer_make(&items, &f->w, &f->c, 960, 540, "/nowhere", &error));
    /* A false witness: whoever hides this object is blamed, unless exact arithmetic is asked. */
    uint32_t object = hidden_object(f, &items);
    items.views[0].items[items.views[0].count++] = (item){object, 7777};
    memset(&result, 0, sizeof result);
    assert_true(contest_run(&result, &f->w, &f->c, &items, ENTRY_SCENE, 1, &error));
    assert_true(contest_moved(&result, &f->w, &f->c, &items, 2, &error));
    assert_true(result.row_count >= 6 && !result.failed && result.unit_ms > 0.0);
    for (uint32_t i = 0; i < result.row_count; ++i) {
        const contest_row *row = &result.rows[i];
        assert_true(row->median_ms > 0.0 && row->worst_ms >= row->median_ms);
        assert_true(row->reported + (double)row->wrong / f->c.count >= result.exact);
        assert_true(!row->ours || (row->wrong == 0 && row->worst_pixels == 0));
        assert_true(!row->standard || row->to_ours == 1.0);
        blamed += row->worst_pixels == 7777 && row->worst_object == object && row->worst_view == 0;
    }
    assert_true(blamed >= 2);
    item_buffer_free(&items);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(zbuffer_is_what_the_slow_way_says),
        cmocka_unit_test(tree_answers_as_the_flat_pass),
        cmocka_unit_test(items_are_truly_visible),
        cmocka_unit_test(contest_counts_what_is_hidden_wrongly),
    };
#if defined(__x86_64__)
    if (!__builtin_cpu_supports("avx2")) {
        print_message("skipped: the rivals need AVX2\n");
        return 0;
    }
#endif
    return cmocka_run_group_tests(tests, set_up, tear_down);
}

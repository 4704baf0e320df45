/* The pictures of `umbrage render`: what they show agrees with rays and states. The program's
 * sources are in no library, so they are taken in whole. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "umbrage/picture.c"
#include "umbrage/picture_eye.c"
#include "umbrage/picture_map.c"
#include "umbrage/picture_rays.c"

enum { WIDTH = 160, HEIGHT = 96 };

typedef struct stage {
    model *m;
    truth *t;
    umb_view view;
    bitmap im;
} stage;

static void add_box(model *m, float x0, float y0, float z0, float x1, float y1, float z1)
{
    static uint32_t indices[36] = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                                   2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};
    float positions[24];
    for (int k = 0; k < 8; ++k) {
        positions[3 * k] = k & 1 ? x1 : x0;
        positions[3 * k + 1] = k & 2 ? y1 : y0;
        positions[3 * k + 2] = k & 4 ? z1 : z0;
    }
    model_mesh mesh = {positions, indices, NULL, 8, 12};
    assert_int_not_equal(model_add_object(m, "box", model_add_mesh(m, &mesh), NULL), MODEL_NONE);
}

/* Looking along -z from (0, 1.5, 0): a wall on the right from 5 to 6 ahead, a box behind it, a
 * box on the left, a box behind the eye. */
static stage *set_up(bool roof)
{
    stage *s = calloc(1, sizeof *s);
    umb_error error = {0};
    const double eye[3] = {0, 1.5, 0}, target[3] = {0, 1.5, -1}, up[3] = {0, 1, 0};
    s->m = model_create();
    add_box(s->m, 0, -5, -6, 20, 30, -5);
    add_box(s->m, 4, 0, -14, 8, 4, -10);
    add_box(s->m, -8, 0, -14, -4, 4, -10);
    add_box(s->m, -2, 0, 6, 2, 4, 10);
    if (roof) {
        add_box(s->m, -30, 4, -30, 30, 5, 30);
    }
    assert_true(model_finish(s->m, NULL, &error));
    assert_int_equal(
        umb_view_look_at(&s->view, eye, target, up, 1.0, WIDTH / (double)HEIGHT, 0.1, 100), UMB_OK);
    s->t = truth_create(s->m, &error);
    assert_non_null(s->t);
    assert_true(bitmap_create(&s->im, WIDTH, HEIGHT));
    return s;
}

static void tear_down(stage *s)
{
    truth_destroy(s->t);
    model_free(s->m);
    bitmap_free(&s->im);
    free(s);
}

static void test_states(void **state)
{
    (void)state;
    stage *s = set_up(false);
    uint8_t states[4];
    const uint32_t visible[2] = {0, 2};
    picture_states(s->m, &s->view, visible, 2, states);
    assert_int_equal(states[0], PICTURE_VISIBLE);
    assert_int_equal(states[1], PICTURE_HIDDEN);
    assert_int_equal(states[2], PICTURE_VISIBLE);
    assert_int_equal(states[3], PICTURE_OUTSIDE);
    tear_down(s);
}

static void test_ids(void **state)
{
    (void)state;
    stage *s = set_up(false);
    uint8_t states[4] = {PICTURE_VISIBLE, PICTURE_HIDDEN, PICTURE_HIDDEN, PICTURE_OUTSIDE};
    bool seen[4] = {false};
    assert_true(picture_ids(&s->im, s->t, &s->view, states));
    for (int k = 0; k < WIDTH * HEIGHT; ++k) {
        int x = k % WIDTH, y = k / WIDTH;
        double depth, normal[3];
        uint32_t object = truth_pixel(s->t, &s->view, (x + 0.5) / WIDTH, (y + 0.5) / HEIGHT, &depth,
                                      normal);
        bitmap_color c = bitmap_get(&s->im, x, y);
        assert_int_equal(c == night, object == MODEL_NONE);
        assert_int_equal(c == alarm, object != MODEL_NONE && states[object] != PICTURE_VISIBLE);
        if (object != MODEL_NONE) {
            seen[object] = true;
        }
    }
    assert_true(seen[0] && seen[2] && !seen[1] && !seen[3]);
    tear_down(s);
}

static void test_eye(void **state)
{
    (void)state;
    stage *s = set_up(false);
    assert_true(picture_eye(&s->im, s->m, s->t, &s->view));
    bitmap_color sky_color = bitmap_get(&s->im, 10, 3), wall = bitmap_get(&s->im, 130, 40);
    assert_true((sky_color & 255) > (sky_color >> 16)); /* the sky is blue, */
    assert_true((wall & 255) < (wall >> 16) + 40);      /* the wall is not so blue, */
    assert_int_not_equal(wall, sky_color);
    int lines = 0; /* and there is a line where it ends */
    for (int x = 70; x < 90; ++x) {
        bitmap_color a = bitmap_get(&s->im, x, 40), b = bitmap_get(&s->im, x + 1, 40);
        lines += abs((int)(a & 255) - (int)(b & 255)) > 20;
    }
    assert_in_range(lines, 1, 4);
    tear_down(s);
}

static int nearest_state(bitmap_color c)
{
    int best = 0, least = 1 << 30;
    for (int k = 0; k < 3; ++k) {
        int distance = 0;
        for (int shift = 0; shift < 24; shift += 8) {
            int d = (int)(c >> shift & 255) - (int)(state_colors[k] >> shift & 255);
            distance += d * d;
        }
        if (distance < least) {
            least = distance;
            best = k;
        }
    }
    return best;
}

/* The colours at the middle of each object, found through the map's own placing of world points. */
static void check_map(bool roof)
{
    stage *s = set_up(roof);
    uint8_t states[5] = {PICTURE_VISIBLE, PICTURE_HIDDEN, PICTURE_VISIBLE, PICTURE_OUTSIDE,
                         PICTURE_HIDDEN};
    bitmap large;
    map p = {.m = s->m, .view = &s->view, .states = states};
    memcpy(p.eye, s->view.eye, sizeof p.eye);
    assert_true(bitmap_create(&large, 800, 600));
    choose_axes(&p);
    assert_true(choose_window(&p, 800, 600));
    assert_true(picture_map(&large, s->m, &s->view, states));
    for (uint32_t o = 1; o < 4; ++o) {
        const umb_aabb *b = &s->m->objects[o].bounds;
        double middle[3], page[3];
        for (int i = 0; i < 3; ++i) {
            /* Off the middle, where the lines of the view may pass. */
            middle[i] = 0.35 * b->min[i] + 0.65 * b->max[i];
        }
        place(&p, middle, page);
        assert_true(page[0] > 0 && page[0] < p.width && page[1] > 0 && page[1] < p.height);
        bitmap_color c = bitmap_get(&large, (int)page[0] / FINE, (int)page[1] / FINE);
        assert_true(roof || nearest_state(c) == (int)states[o]);
    }
    /* On neither box nor view: paper, or the roof, which is cut away and so is faint. */
    const double corner[3] = {-7, 0, 9};
    double page[3];
    place(&p, corner, page);
    bitmap_color c = bitmap_get(&large, (int)page[0] / FINE, (int)page[1] / FINE);
    assert_int_equal(c == paper, !roof);
    assert_true((c & 255) > 0xC0);
    p.cut = 0;
    assert_int_equal(isinf(choose_cut(&p)), !roof);
    bitmap_free(&large);
    tear_down(s);
}

static void test_map(void **state)
{
    (void)state;
    check_map(false);
    check_map(true);
}

/* The map of a cell holds what may be seen from there, and shows the cell. */
static void test_cell_map(void **state)
{
    (void)state;
    stage *s = set_up(false);
    uint8_t states[4] = {PICTURE_OUTSIDE, PICTURE_HIDDEN, PICTURE_VISIBLE, PICTURE_OUTSIDE};
    const double cell[2][3] = {{-1, 1, -1}, {1, 2, 1}};
    bitmap large;
    map p = {.m = s->m, .cell = cell, .states = states};
    assert_true(bitmap_create(&large, 800, 600));
    assert_true(picture_cell_map(&large, s->m, cell, states));
    choose_axes(&p);
    assert_true(choose_window(&p, 800, 600));
    for (uint32_t o = 1; o < 3; ++o) {
        const umb_aabb *b = &s->m->objects[o].bounds;
        double middle[3], page[3];
        for (int i = 0; i < 3; ++i) {
            /* Below the legend. */
            middle[i] = 0.1 * b->min[i] + 0.9 * b->max[i];
        }
        place(&p, middle, page);
        assert_true(page[0] > 0 && page[0] < p.width && page[1] > 0 && page[1] < p.height);
        bitmap_color c = bitmap_get(&large, (int)page[0] / FINE, (int)page[1] / FINE);
        assert_int_equal(nearest_state(c), states[o]);
    }
    double page[3];
    place(&p, p.eye, page);
    bitmap_color c = bitmap_get(&large, (int)page[0] / FINE, (int)page[1] / FINE);
    assert_true((c >> 16) > 0xC0 && (c & 255) < 0x80);
    bitmap_free(&large);
    tear_down(s);
}

static void test_occlusion(void **state)
{
    (void)state;
    stage *s = set_up(false);
    umb_error error = {0};
    umb_scene *scene = model_scene(s->m, true, (umb_tasks){0}, NULL, &error);
    umb_index *index;
    assert_non_null(scene);
    assert_int_equal(umb_index_create(scene, &(umb_index_def){0}, &index), UMB_OK);
    for (int k = 0; k < 2; ++k) {
        umb_culler_def def = {.method = k ? UMB_METHOD_NONE : UMB_METHOD_RASTER};
        umb_culler *culler;
        umb_visible_set seen;
        const uint32_t box = 2;
        assert_int_equal(umb_culler_create(index, &def, &culler), UMB_OK);
        assert_int_equal(umb_cull(culler, &s->view, &seen), UMB_OK);
        assert_true(picture_occlusion(&s->im, s->m, culler, &s->view, &box, 1));
        assert_int_equal(bitmap_get(&s->im, 120, 40) == night, k);
        assert_int_equal(bitmap_get(&s->im, 10, HEIGHT / 4), night);
        uint32_t frame = 0;
        for (int p = 0; p < WIDTH * HEIGHT; ++p) {
            frame += bitmap_get(&s->im, p % WIDTH, p / WIDTH) == 0x5CE1E6;
        }
        assert_int_equal(frame > 0, !k);
        umb_culler_destroy(culler);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    tear_down(s);
}

/* Depths come back out of the buffer: the wall's front is 5 ahead, and bounds lie at or behind
 * it. */
static void test_depths(void **state)
{
    (void)state;
    stage *s = set_up(false);
    umb_error error = {0};
    umb_scene *scene = model_scene(s->m, true, (umb_tasks){0}, NULL, &error);
    umb_index *index;
    umb_culler *culler;
    const double eye[3] = {0, 1.5, 0}, target[3] = {0, 1.5, -1}, up[3] = {0, 1, 0};
    assert_int_equal(umb_index_create(scene, &(umb_index_def){0}, &index), UMB_OK);
    assert_int_equal(umb_culler_create(index, &(umb_culler_def){0}, &culler), UMB_OK);
    for (int parallel = 0; parallel < 2; ++parallel) {
        umb_view view = s->view;
        umb_visible_set seen;
        uint32_t width, height;
        double nearest, farthest;
        if (parallel) {
            assert_int_equal(umb_view_look_at_ortho(&view, eye, target, up, 20, 2, -3, 100), UMB_OK);
        }
        assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
        umb_culler_read_buffer(culler, NULL, 0, &width, &height);
        float *values = malloc(sizeof *values * width * height);
        assert_true(umb_culler_read_buffer(culler, values, (size_t)width * height, &width, &height));
        assert_true(depth_range(&view, values, (size_t)width * height, &nearest, &farthest));
        assert_true(nearest > 4.999 && nearest < 6.001);
        assert_true(farthest < 14.001);
        free(values);
    }
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    tear_down(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_states),   cmocka_unit_test(test_ids),
        cmocka_unit_test(test_eye),      cmocka_unit_test(test_map),
        cmocka_unit_test(test_cell_map), cmocka_unit_test(test_occlusion),
        cmocka_unit_test(test_depths)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

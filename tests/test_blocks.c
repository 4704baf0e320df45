/* The generated scene `blocks` with its 64 views, and the slit test: figures that other programs
 * can be compared with, through the public headers alone. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/strict.h"

#define PI 3.14159265358979323846
#define VIEWS 64

static bool small_size(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && size[0] == 's';
}

static bool blocks_view(const double row[6], umb_view *view)
{
    static const double up[3] = {0, 1, 0};
    bool ok = umb_view_look_at(view, row, row + 3, up, PI / 3, 16.0 / 9.0, 0.1, 2000.0) == UMB_OK;
    view->width = view->buffer_width = 1024;
    view->height = view->buffer_height = 576;
    return ok;
}

typedef struct blocks_limit {
    const char *spec;
    double reported, in_frustum; /* means over the views: at most; what the frustum holds, rounded */
    uint32_t truth_step;         /* the oracle looks at every so manyth view; 0: none */
} blocks_limit;

static void check_blocks(const blocks_limit *limit)
{
    umb_error error = {0};
    model *m = model_load(limit->spec, NULL, &error);
    assert_non_null(m);
    camera_path path;
    assert_true(camera_path_load(limit->spec, &path, &error));
    assert_int_equal(path.count, VIEWS);
    umb_scene *scene = model_scene(m, true, (umb_tasks){0}, NULL, &error);
    assert_non_null(scene);
    umb_index *index = NULL;
    umb_culler *culler = NULL, *frustum = NULL;
    umb_culler_def none = {.method = UMB_METHOD_NONE};
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    assert_int_equal(umb_culler_create(index, NULL, &culler), UMB_OK);
    assert_int_equal(umb_culler_create(index, &none, &frustum), UMB_OK);
    truth *oracle = limit->truth_step != 0 ? truth_create(m, &error) : NULL;
    strict_count sum = {0};
    double reported = 0, in_frustum = 0;
    for (uint32_t k = 0; k < VIEWS; ++k) {
        umb_view view;
        umb_visible_set seen;
        assert_true(blocks_view(path.rows[k], &view));
        assert_int_equal(umb_cull(frustum, &view, &seen), UMB_OK);
        in_frustum += seen.count;
        assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
        reported += seen.count;
        if (oracle != NULL && k % (limit->truth_step * (small_size() ? 8 : 1)) == 0) {
            char label[96];
            (void)snprintf(label, sizeof label, "%s view %u", limit->spec, k);
            truth_options options = {.grid_width = 1024, .grid_height = 576, .guided_rays = 1000000};
            assert_true(
                strict_check(oracle, m, &view, seen.objects, seen.count, &options, label, &sum));
        }
    }
    reported /= VIEWS;
    in_frustum /= VIEWS;
    printf("# %s: in frustum %.1f, reported %.2f", limit->spec, in_frustum, reported);
    if (sum.views != 0) {
        printf("; %llu views with truth: reported %.1f, visible %.1f, wrong %llu, unconfirmed %llu",
               (unsigned long long)sum.views, (double)sum.reported / (double)sum.views,
               (double)sum.truth_visible / (double)sum.views,
               (unsigned long long)sum.wrongly_hidden, (unsigned long long)sum.unconfirmed);
    }
    printf("\n");
    truth_destroy(oracle);
    umb_culler_destroy(culler);
    umb_culler_destroy(frustum);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    camera_path_free(&path);
    model_free(m);
    assert_int_equal(sum.wrongly_hidden, 0);
    assert_true(reported <= limit->reported);
    /* The recipe's figure is rounded to a whole object. */
    assert_true(fabs(in_frustum - limit->in_frustum) <= 0.5 + 1e-9);
}

static void test_blocks_32(void **state)
{
    (void)state;
    check_blocks(&(blocks_limit){"gen:blocks,g=32", 86, 2873, 4});
}

static void test_blocks_100(void **state)
{
    (void)state;
    check_blocks(&(blocks_limit){"gen:blocks,g=100", 255, 27888, 0});
}

/* ---- slits ---------------------------------------------------------------------------------------- */

/* splitmix64 */
static double unit(uint64_t *state)
{
    uint64_t z = *state += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

/* Two walls of 12 x 12 x 0.01 at depth 10 with a slit between them, a box of 2 x 2 x 0.5 at depth
 * 20:
 *
 *      #########  #########    depth 10; seen from above, before the roll about the view's axis
 *                [box]         depth 20: centred behind the slit, or off to the side behind a wall
 */
typedef struct slit {
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler, *frustum;
    uint32_t walls[2], box;
} slit;

static void slit_set_up(slit *s)
{
    float p[24];
    static const uint32_t indices[36] = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                                         2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};
    for (int k = 0; k < 8; ++k) {
        for (int i = 0; i < 3; ++i) {
            p[3 * k + i] = (k >> i & 1) != 0 ? 0.5f : -0.5f;
        }
    }
    umb_shape_def shape = {
        .positions = p, .position_count = 8, .indices = indices, .index_count = 36};
    umb_object_def def = {.flags = UMB_OBJECT_IS_SHAPE};
    assert_int_equal(umb_scene_create(NULL, &s->scene), UMB_OK);
    assert_int_equal(umb_scene_add_shape(s->scene, &shape, &def.shape), UMB_OK);
    assert_int_equal(umb_scene_add_object(s->scene, &def, &s->walls[0]), UMB_OK);
    assert_int_equal(umb_scene_add_object(s->scene, &def, &s->walls[1]), UMB_OK);
    assert_int_equal(umb_scene_add_object(s->scene, &def, &s->box), UMB_OK);
    assert_int_equal(umb_scene_commit(s->scene), UMB_OK);
    assert_int_equal(umb_index_create(s->scene, NULL, &s->index), UMB_OK);
    assert_int_equal(umb_culler_create(s->index, NULL, &s->culler), UMB_OK);
    umb_culler_def none = {.method = UMB_METHOD_NONE};
    assert_int_equal(umb_culler_create(s->index, &none, &s->frustum), UMB_OK);
}

static void slit_tear_down(slit *s)
{
    umb_culler_destroy(s->culler);
    umb_culler_destroy(s->frustum);
    umb_index_destroy(s->index);
    umb_scene_destroy(s->scene);
}

/* A box of that size around (x, y, -depth), all turned about the view's axis. */
static void slit_place(slit *s, uint32_t object, double roll, double x, double y, double depth,
                       const double size[3])
{
    double c = cos(roll), d = sin(roll);
    umb_transform t = {{{(float)(c * size[0]), (float)(-d * size[1]), 0, (float)(c * x - d * y)},
                        {(float)(d * size[0]), (float)(c * size[1]), 0, (float)(d * x + c * y)},
                        {0, 0, (float)size[2], (float)-depth}}};
    assert_int_equal(umb_scene_move_object(s->scene, object, &t, NULL), UMB_OK);
}

static bool slit_sees(umb_culler *culler, const umb_view *view, uint32_t object)
{
    umb_visible_set seen;
    assert_int_equal(umb_cull(culler, view, &seen), UMB_OK);
    bool found = false;
    for (uint32_t k = 0; k < seen.count; ++k) {
        found = found || seen.objects[k] == object;
    }
    return found;
}

static void check_slits(slit *s, const uint32_t raster[2], uint32_t trials)
{
    static const double wall[3] = {12, 12, 0.01}, box[3] = {2, 2, 0.5};
    static const double eye[3] = {0, 0, 0}, target[3] = {0, 0, -1}, up[3] = {0, 1, 0};
    umb_view view;
    assert_int_equal(umb_view_look_at(&view, eye, target, up, PI / 3, 16.0 / 9.0, 0.1, 2000.0),
                     UMB_OK);
    view.buffer_width = raster[0];
    view.buffer_height = raster[1];
    double pixel = 10.0 * (view.y_max - view.y_min) / raster[1];
    uint64_t random = raster[0];
    uint32_t wrong = 0, missed = 0;
    for (uint32_t k = 0; k < trials; ++k) {
        double roll = 2 * PI * unit(&random), width = pixel * (0.1 + 1.9 * unit(&random));
        double off = 2 * unit(&random) - 1, along = 2 * unit(&random) - 1;
        slit_place(s, s->walls[0], roll, off - 6 - width / 2, along, 10, wall);
        slit_place(s, s->walls[1], roll, off + 6 + width / 2, along, 10, wall);
        slit_place(s, s->box, roll, 2 * off, 2 * along, 20, box);
        assert_int_equal(umb_scene_commit(s->scene), UMB_OK);
        wrong += !slit_sees(s->culler, &view, s->box);
        /* The control: five units aside at depth 20, its image at the walls' depth ends two before
         * the slit, less half the slit. */
        slit_place(s, s->box, roll, 2 * off + (k % 2 != 0 ? 5 : -5), 2 * along, 20, box);
        assert_int_equal(umb_scene_commit(s->scene), UMB_OK);
        assert_true(slit_sees(s->frustum, &view, s->box));
        missed += slit_sees(s->culler, &view, s->box);
    }
    printf("# slits at %ux%u: %u trials, wrongly hidden %u; controls not hidden %u\n", raster[0],
           raster[1], trials, wrong, missed);
    assert_int_equal(wrong, 0);
    assert_int_equal(missed, 0);
}

static void test_slits(void **state)
{
    static const uint32_t rasters[][2] = {{64, 36}, {256, 144}, {512, 288}};
    (void)state;
    slit s;
    slit_set_up(&s);
    for (size_t r = 0; r < sizeof rasters / sizeof rasters[0]; ++r) {
        check_slits(&s, rasters[r], small_size() ? 500 : 20000);
    }
    slit_tear_down(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_blocks_32),
                                       cmocka_unit_test(test_blocks_100),
                                       cmocka_unit_test(test_slits)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

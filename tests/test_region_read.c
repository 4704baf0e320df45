/* Copies of the occlusion maps: sizes, and that they show what hides. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "umbrage/umbrage.h"

/* A box 20 wide and 10 high, 5 in front of the cell along +z. */
static umb_scene *make_scene(void)
{
    static const uint32_t indices[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                         2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    float p[24];
    for (uint32_t k = 0; k < 8; ++k) {
        p[3 * k] = k & 1 ? 10.0f : -10.0f;
        p[3 * k + 1] = k & 2 ? 10.0f : 0.0f;
        p[3 * k + 2] = k & 4 ? 8.0f : 6.0f;
    }
    umb_shape_def def = {.positions = p, .position_count = 8, .indices = indices, .index_count = 36};
    umb_scene *scene;
    umb_shape shape;
    uint32_t id;
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    assert_int_equal(umb_scene_add_shape(scene, &def, &shape), UMB_OK);
    umb_object_def object = {.shape = shape, .transform = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}};
    assert_int_equal(umb_scene_add_object(scene, &object, &id), UMB_OK);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    return scene;
}

/* Pixels of a map that rays go through, and those where something is hidden. */
static void count_pixels(const umb_region *region, uint32_t map, uint32_t *live, uint32_t *hidden)
{
    uint32_t side;
    assert_false(umb_region_read_map(region, map, NULL, 0, &side));
    assert_int_equal(side, 64);
    umb_region_pixel *pixels = calloc(64 * 64, sizeof *pixels);
    assert_non_null(pixels);
    assert_false(umb_region_read_map(region, map, pixels, 64 * 64 - 1, &side));
    assert_true(umb_region_read_map(region, map, pixels, 64 * 64, &side));
    *live = *hidden = 0;
    for (uint32_t i = 0; i < 64 * 64; ++i) {
        *live += pixels[i].live;
        *hidden += pixels[i].live && pixels[i].top > -INFINITY;
        assert_true(pixels[i].live || pixels[i].top == -INFINITY);
        /* The box's far top edge, or its near one from below the cell's top: never as steep as this. */
        assert_true(pixels[i].top < 10.0f / 5.0f);
    }
    free(pixels);
}

static void test_maps(void **state)
{
    (void)state;
    umb_scene *scene = make_scene();
    umb_index *index;
    umb_region *region;
    umb_region_answer a;
    uint32_t side = 1, live, hidden;
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    assert_int_equal(umb_region_create(index, NULL, &region), UMB_OK);
    assert_false(umb_region_read_map(region, 0, NULL, 0, &side));
    assert_int_equal(side, 0);
    for (int squares = 0; squares < 2; ++squares) {
        umb_region_query q = {.min = {-1, 1, -1}, .max = {1, 2, 1}, .resolution = 64};
        q.outer = squares ? 4.0 : 0.0;
        assert_int_equal(umb_region_solve(region, &q, &a), UMB_OK);
        for (uint32_t map = 0; map < (squares ? 8u : 4u); ++map) {
            count_pixels(region, map, &live, &hidden);
            assert_true(live > 0);
            /* Up is y: map 0 looks along +z, where the box stands; 1 looks away from it. */
            assert_true(map != 0 || hidden > live / 3);
            assert_true(map != 1 || hidden == 0);
        }
        assert_false(umb_region_read_map(region, squares ? 8 : 4, NULL, 0, &side));
        assert_int_equal(side, 0);
    }
    umb_region_destroy(region);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_maps)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Choosing occluders: a selector that follows a scene from commit to commit chooses what a new one does, over any index,
 * after any edits; and commits that it did not see are no harm. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "occlusion/select.h"
#include "support/failing.h"
#include "support/random_boxes.h"

enum { SHAPES = 3, OBJECTS = 120, SIDE = 3 };

static int rounds(int normal)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && size[0] == 's' ? normal / 10 : size != NULL && size[0] == 'f' ? normal * 10 : normal;
}

static void add_shapes(umb_scene *scene, umb_shape shapes[SHAPES])
{
    static const float solid[4][3] = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}};
    static const uint32_t faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    float wall[(SIDE + 1) * (SIDE + 1)][3];
    uint32_t quads[6 * SIDE * SIDE], n = 0;
    for (int bend = 0; bend < 2; ++bend) {
        n = 0;
        for (uint32_t k = 0; k < (SIDE + 1) * (SIDE + 1); ++k) {
            wall[k][0] = (float)(k % (SIDE + 1));
            wall[k][1] = (float)(k / (SIDE + 1));
            wall[k][2] = bend ? (float)(k % 3) * 0.25f : 0.0f;
        }
        for (uint32_t k = 0; k < SIDE * SIDE; ++k) {
            uint32_t a = k % SIDE + k / SIDE * (SIDE + 1), up = a + SIDE + 1;
            const uint32_t cut[6] = {a, a + 1, up + 1, a, up + 1, up};
            memcpy(quads + n, cut, sizeof cut);
            n += 6;
        }
        umb_shape_def def = {.positions = wall[0], .position_count = (SIDE + 1) * (SIDE + 1), .indices = quads, .index_count = n};
        assert_int_equal(umb_scene_add_shape(scene, &def, &shapes[bend]), UMB_OK);
    }
    umb_shape_def def = {.positions = solid[0], .position_count = 4, .indices = faces[0], .index_count = 12};
    assert_int_equal(umb_scene_add_shape(scene, &def, &shapes[2]), UMB_OK);
}

static umb_transform place(dice *d)
{
    float size = dice_roll(d, 4) == 0 ? 0.5f * (float)(1 + dice_roll(d, 6)) : 1.0f;
    float mirror = dice_roll(d, 5) == 0 ? -size : size;
    return (umb_transform){{{mirror, 0, 0, (float)dice_roll(d, 40) - 20.0f},
                            {0, size, 0, (float)dice_roll(d, 20) - 10.0f},
                            {0, 0, size, (float)dice_roll(d, 40) - 30.0f}}};
}

static void edit(umb_scene *scene, dice *d, const umb_shape shapes[SHAPES])
{
    uint32_t id = dice_roll(d, OBJECTS), unused, what = dice_roll(d, 20);
    umb_transform t = place(d), whole = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    umb_object_def def = {.shape = shapes[dice_roll(d, SHAPES)], .transform = t,
                          .flags = dice_roll(d, 3) == 0 ? UMB_OBJECT_STATIC : 0};
    if (what < 9) {
        (void)umb_scene_move_object(scene, id, &t, NULL);
    } else if (what < 14) {
        (void)umb_scene_add_object(scene, &def, &unused);
    } else if (what < 16) {
        (void)umb_scene_remove_object(scene, id);
    } else if (what == 16) {
        (void)umb_scene_add_occluder(scene, def.shape, dice_roll(d, 2) == 0 ? &whole : &t, &unused);
    } else if (what == 17) {
        (void)umb_scene_remove_occluder(scene, dice_roll(d, 8));
    } else if (what == 18) {
        (void)umb_scene_flag_object(scene, id, dice_roll(d, 2) == 0 ? UMB_OBJECT_IGNORED : 0);
    } else if (dice_roll(d, 4) == 0) {
        assert_int_equal(umb_scene_weld(scene, NULL, NULL), UMB_OK);
    }
}

static umb_choice choice_of(const umb_scene *scene, const umb_index *index, const umb_view *view, umb_frustum *frustum,
                            umb_cull_stats *stats)
{
    umb_frustum_prepare(frustum, view);
    return (umb_choice){.viewer = {.points = &view->eye, .point_count = 1},
                        .view = view,
                        .frustum = frustum,
                        .scene = umb_scene_committed(scene),
                        .tree = umb_index_tree(index),
                        .stats = stats};
}

/* Returns how many both chose. */
static uint32_t compare(umb_selector *old, const umb_choice *choice)
{
    const umb_box_kernels *kernels = umb_box_kernels_get(UMB_ISA_SCALAR);
    umb_allocator a = umb_memory_allocator(NULL);
    umb_selector fresh;
    umb_pick p, q;
    uint32_t count = 0;
    umb_selector_create(&fresh, &a);
    assert_int_equal(umb_select_begin(old, choice, kernels), UMB_OK);
    assert_int_equal(umb_select_begin(&fresh, choice, kernels), UMB_OK);
    for (uint32_t i = 0; i < choice->scene->occluder_count; ++i) {
        assert_true(old->known.areas[i] == fresh.known.areas[i]);
    }
    for (uint32_t i = 0; i < choice->tree->node_count; ++i) {
        assert_true(choice->tree->nodes[i].count == 0 || old->known.node_areas[i] == fresh.known.node_areas[i]);
    }
    while (umb_select_next(&fresh, &q)) {
        assert_true(umb_select_next(old, &p));
        assert_int_equal(p.occluder, q.occluder);
        assert_int_equal(p.facet, q.facet);
        assert_int_equal(p.set, q.set);
        assert_true(p.score == q.score && p.place == q.place);
        count += 1;
    }
    assert_false(umb_select_next(old, &p));
    umb_selector_free(&fresh);
    return count;
}

static void follow(uint64_t seed, const char *kind, umb_index_update update, uint64_t *chosen)
{
    dice d = {seed};
    uint64_t random = seed * 2 + 1;
    umb_scene *scene;
    umb_index *index;
    umb_shape shapes[SHAPES];
    umb_index_def def = {0};
    umb_allocator a = umb_memory_allocator(NULL);
    umb_selector s;
    umb_selector_create(&s, &a);
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    add_shapes(scene, shapes);
    assert_true(umb_index_parse(kind, &def));
    def.update = update;
    if (umb_index_create(scene, &def, &index) != UMB_OK) {
        umb_scene_destroy(scene); /* it has no such way */
        return;
    }
    for (int frame = 0; frame < 30; ++frame) {
        for (uint32_t n = frame == 0 ? 100 : dice_roll(&d, 4) == 0 ? dice_roll(&d, 60) : dice_roll(&d, 6); n > 0; --n) {
            edit(scene, &d, shapes);
        }
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        if (dice_roll(&d, 5) == 0) {
            continue; /* it does not see this one */
        }
        umb_view view = random_view(&random, 20.0);
        umb_frustum frustum;
        umb_cull_stats stats = {0};
        if (view.projection == UMB_PERSPECTIVE) {
            umb_choice choice = choice_of(scene, index, &view, &frustum, &stats);
            *chosen += compare(&s, &choice);
        }
    }
    umb_selector_free(&s);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

static void test_follows(void **state)
{
    (void)state;
    uint64_t chosen = 0, seed = 1;
    for (int round = 0; round < rounds(40); ++round) {
        for (uint32_t k = 0; umb_index_variant(k) != NULL; ++k, ++seed) {
            umb_index_update update = (umb_index_update)(seed % 8);
            follow(seed, umb_index_variant(k), k < 2 ? update : UMB_UPDATE_DEFAULT, &chosen);
        }
    }
    printf("# chosen by both: %llu\n", (unsigned long long)chosen);
    assert_true(chosen > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_follows)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

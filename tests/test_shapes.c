/* Objects that are given another shape: a scene that has seen many such edits answers as one built anew, whatever cullers
 * remember; what moves by itself goes on moving; captures hold it; and whatever allocation fails, nothing is half done. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/failing.h"
#include "umbrage/umbrage.h"

enum { COUNT = 150, SHAPES = 4, METHODS = 5 };

static const umb_method METHOD[METHODS] = {UMB_METHOD_RASTER, UMB_METHOD_NONE, UMB_METHOD_PLANES, UMB_METHOD_SHADOW_FRUSTA,
                                           UMB_METHOD_OCCLUSION_TREE};

static const uint32_t BOX[36] = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                                 2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};

/* A cube, a wall, a post, and the wall again as glass, which hides nothing. */
static void add_shapes(umb_scene *scene, umb_shape shapes[SHAPES])
{
    static const float sizes[SHAPES][3] = {{1, 1, 1}, {6, 4, 0.2f}, {0.3f, 8, 0.3f}, {6, 4, 0.2f}};
    uint8_t open[12];
    memset(open, UMB_TRIANGLE_OPEN, sizeof open);
    for (int s = 0; s < SHAPES; ++s) {
        float corners[24];
        for (int k = 0; k < 24; ++k) {
            corners[k] = (k / 3 >> (2 - k % 3) & 1) != 0 ? sizes[s][k % 3] : -sizes[s][k % 3];
        }
        umb_shape_def def = {.positions = corners,
                             .position_count = 8,
                             .indices = BOX,
                             .index_count = 36,
                             .triangle_flags = s == 3 ? open : NULL};
        assert_int_equal(umb_scene_add_shape(scene, &def, &shapes[s]), UMB_OK);
    }
}

/* What is known of the objects beside the scene. */
typedef struct thing {
    umb_transform at;
    umb_aabb bounds; /* zero: the shape's own */
    uint32_t shape;  /* SHAPES: none */
} thing;

typedef struct hall {
    umb_scene *scene;
    umb_shape shapes[SHAPES];
    umb_index *index[2];
    umb_culler *cullers[2][METHODS];
} hall;

static const char *const KINDS[2] = {"flat", "bvh"};

static void hall_open(hall *h, const umb_allocator *allocator, const thing *things)
{
    umb_scene_def def = {.allocator = *allocator};
    assert_int_equal(umb_scene_create(&def, &h->scene), UMB_OK);
    add_shapes(h->scene, h->shapes);
    for (uint32_t i = 0; i < COUNT; ++i) {
        const thing *t = &things[i];
        umb_object_def object = {.shape = t->shape < SHAPES ? h->shapes[t->shape] : 0,
                                 .transform = t->at,
                                 .bounds = t->bounds,
                                 .flags = i % 3 == 0 ? 0 : UMB_OBJECT_IS_SHAPE};
        uint32_t id;
        assert_int_equal(umb_scene_add_object(h->scene, &object, &id), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(h->scene), UMB_OK);
    for (int k = 0; k < 2; ++k) {
        umb_index_def index = {0};
        assert_true(umb_index_parse(KINDS[k], &index));
        assert_int_equal(umb_index_create(h->scene, &index, &h->index[k]), UMB_OK);
        for (int m = 0; m < METHODS; ++m) {
            umb_culler_def culler = {.method = METHOD[m]};
            assert_int_equal(umb_culler_create(h->index[k], &culler, &h->cullers[k][m]), UMB_OK);
        }
    }
}

static void hall_close(hall *h)
{
    for (int k = 0; k < 2; ++k) {
        for (int m = 0; m < METHODS; ++m) {
            umb_culler_destroy(h->cullers[k][m]);
        }
        umb_index_destroy(h->index[k]);
    }
    umb_scene_destroy(h->scene);
}

static float pick(dice *d, float low, float high)
{
    return low + (high - low) * (float)dice_roll(d, 1000) / 1000.0f;
}

static thing some_thing(dice *d)
{
    thing t = {.shape = dice_roll(d, SHAPES + 1)};
    t.at = (umb_transform){{{1, 0, 0, pick(d, -20, 20)}, {0, 1, 0, pick(d, -3, 3)}, {0, 0, 1, pick(d, -60, -5)}}};
    return t;
}

/* Bounds by hand are large enough for every shape. */
static void give_bounds(thing *t, bool by_hand)
{
    t->bounds = (umb_aabb){{0, 0, 0}, {0, 0, 0}};
    for (int i = 0; i < 3 && (by_hand || t->shape == SHAPES); ++i) {
        t->bounds.min[i] = t->at.m[i][3] - 9.0f;
        t->bounds.max[i] = t->at.m[i][3] + 9.0f;
    }
}

static umb_view some_view(dice *d)
{
    umb_view v;
    double eye[3] = {pick(d, -15, 15), pick(d, -2, 4), pick(d, -10, 5)}, target[3] = {pick(d, -8, 8), 0, -40}, up[3] = {0, 1, 0};
    assert_int_equal(umb_view_look_at(&v, eye, target, up, 1.2, 1.5, 0.1, 200), UMB_OK);
    v.buffer_width = 192;
    v.buffer_height = 128;
    return v;
}

static void check_same(const hall *a, const hall *b, int kind, const umb_view *view)
{
    for (int m = 0; m < METHODS; ++m) {
        umb_visible_set seen, anew;
        assert_int_equal(umb_cull(a->cullers[kind][m], view, &seen), UMB_OK);
        assert_int_equal(umb_cull(b->cullers[kind][m], view, &anew), UMB_OK);
        assert_int_equal(seen.count, anew.count);
        assert_memory_equal(seen.objects, anew.objects, seen.count * sizeof seen.objects[0]);
        assert_memory_equal(seen.inside, anew.inside, seen.count);
    }
}

static void edit(hall *h, thing *things, dice *d)
{
    uint32_t id = dice_roll(d, COUNT), what = dice_roll(d, 4);
    thing *t = &things[id];
    if (what == 0) {
        uint32_t shape = t->shape;
        *t = some_thing(d);
        t->shape = shape;
        give_bounds(t, dice_roll(d, 4) == 0);
        assert_int_equal(umb_scene_move_object(h->scene, id, &t->at, &t->bounds), UMB_OK);
    } else {
        t->shape = dice_roll(d, SHAPES + 1);
        give_bounds(t, dice_roll(d, 4) == 0);
        umb_shape shape = t->shape < SHAPES ? h->shapes[t->shape] : 0;
        assert_int_equal(umb_scene_shape_object(h->scene, id, shape, &t->bounds), UMB_OK);
    }
}

static void make_things(thing things[COUNT], dice *d)
{
    for (uint32_t i = 0; i < COUNT; ++i) {
        things[i] = some_thing(d);
        give_bounds(&things[i], false);
    }
}

/* A plain list is the same list however it came to be: answers are equal to the bit. */
static void test_as_anew(void **state)
{
    (void)state;
    static thing things[COUNT];
    umb_allocator usual = umb_memory_allocator(NULL);
    dice d = {5};
    hall h, anew;
    make_things(things, &d);
    hall_open(&h, &usual, things);
    for (int round = 0; round < 120; ++round) {
        for (uint32_t i = dice_roll(&d, 6); i > 0; --i) {
            edit(&h, things, &d);
        }
        assert_int_equal(umb_scene_commit(h.scene), UMB_OK);
        umb_view view = some_view(&d);
        umb_visible_set seen;
        for (int m = 0; m < METHODS; ++m) { /* what they remember is to be of today */
            assert_int_equal(umb_cull(h.cullers[1][m], &view, &seen), UMB_OK);
        }
        if (round % 4 == 0) {
            hall_open(&anew, &usual, things);
            check_same(&h, &anew, 0, &view);
            hall_close(&anew);
        }
    }
    hall_close(&h);
}

static void test_refusals(void **state)
{
    (void)state;
    static thing things[COUNT];
    static const umb_aabb wrong = {{1, 0, 0}, {0, 1, 1}};
    umb_allocator usual = umb_memory_allocator(NULL);
    dice d = {6};
    hall h;
    umb_aabb before, after;
    make_things(things, &d);
    hall_open(&h, &usual, things);
    assert_true(umb_scene_object_bounds(h.scene, 3, &before));
    assert_int_equal(umb_scene_shape_object(h.scene, COUNT, h.shapes[0], NULL), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_shape_object(h.scene, 3, SHAPES + 1, NULL), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_shape_object(h.scene, 3, 0, NULL), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_shape_object(h.scene, 3, h.shapes[1], &wrong), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_commit(h.scene), UMB_OK);
    assert_true(umb_scene_object_bounds(h.scene, 3, &after));
    assert_memory_equal(&before, &after, sizeof before);
    hall_close(&h);
}

/* A frame after edits is answered again by what its capture holds. */
static void test_captures(void **state)
{
    (void)state;
    static thing things[COUNT];
    umb_allocator usual = umb_memory_allocator(NULL);
    dice d = {8};
    hall h;
    make_things(things, &d);
    hall_open(&h, &usual, things);
    for (int round = 0; round < 10; ++round) {
        for (int i = 0; i < 20; ++i) {
            edit(&h, things, &d);
        }
        assert_int_equal(umb_scene_commit(h.scene), UMB_OK);
        umb_view view = some_view(&d);
        umb_culler *culler = h.cullers[round % 2][round % METHODS];
        umb_visible_set seen, again;
        umb_capture c;
        umb_error error = {0};
        size_t size;
        assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
        assert_int_equal(umb_capture_save(culler, NULL, 0, &size), UMB_OK);
        uint8_t *bytes = malloc(size);
        assert_non_null(bytes);
        assert_int_equal(umb_capture_save(culler, bytes, size, &size), UMB_OK);
        assert_int_equal(umb_capture_load(bytes, size, UMB_ISA_AUTO, (umb_tasks){0}, &c, &error), UMB_OK);
        assert_int_equal(umb_cull(c.culler, &c.view, &again), UMB_OK);
        assert_int_equal(again.count, seen.count);
        assert_memory_equal(again.objects, seen.objects, seen.count * sizeof seen.objects[0]);
        umb_capture_free(&c);
        free(bytes);
    }
    hall_close(&h);
}

/* Commits that find no memory are made up for by the next. */
static void test_failing_allocations(void **state)
{
    (void)state;
    static thing things[COUNT];
    umb_allocator usual = umb_memory_allocator(NULL);
    failing memory;
    umb_allocator a = failing_allocator(&memory, 1LL << 60);
    dice d = {9};
    hall h, anew;
    uint32_t failed = 0;
    make_things(things, &d);
    for (uint32_t i = 0; i < COUNT; ++i) { /* first nothing hides, then all does: room is wanted */
        things[i].shape = 3;
        give_bounds(&things[i], false);
    }
    hall_open(&h, &a, things);
    for (uint32_t round = 0; round < 40; ++round) {
        for (uint32_t i = 0; i < COUNT && round == 0; ++i) {
            things[i].shape = i % 3;
            assert_int_equal(umb_scene_shape_object(h.scene, i, h.shapes[i % 3], NULL), UMB_OK);
        }
        for (int i = 0; i < 30 && round > 0; ++i) {
            edit(&h, things, &d);
        }
        umb_view view = some_view(&d);
        umb_visible_set seen;
        for (long long left = 0; left < 12; ++left) {
            atomic_store(&memory.left, left);
            umb_result result = umb_scene_commit(h.scene);
            assert_true(result == UMB_OK || result == UMB_ERROR_MEMORY);
            failed += result != UMB_OK;
            for (int m = 0; m < METHODS; ++m) {
                result = umb_cull(h.cullers[0][m], &view, &seen);
                assert_true(result == UMB_OK || result == UMB_ERROR_MEMORY || result == UMB_ERROR_STATE);
            }
        }
        atomic_store(&memory.left, 1LL << 60);
        assert_int_equal(umb_scene_commit(h.scene), UMB_OK);
        hall_open(&anew, &usual, things);
        check_same(&h, &anew, 0, &view);
        hall_close(&anew);
    }
    assert_true(failed > 0);
    hall_close(&h);
    assert_true(atomic_load(&memory.held) == 0);
}

/* ---- what moves by itself ------------------------------------------------------------------- */

static bool walk(void *user, uint32_t object, double time, umb_pose *out)
{
    (void)user;
    out->transform = (umb_transform){{{1, 0, 0, (float)(2.0 * time) - 10.0f + (float)object}, {0, 1, 0, 0}, {0, 0, 1, -30}}};
    return true;
}

static bool holds(const umb_aabb *a, const float at[3], const float half[3])
{
    bool in = true;
    for (int i = 0; i < 3; ++i) {
        in = in && a->min[i] <= at[i] - half[i] && a->max[i] >= at[i] + half[i];
    }
    return in;
}

/* Behind a wall of its own height; grown, it looks over it, and is seen at once; small again, it is hidden. Its volume holds
 * the shape that it has. */
static void test_movers(void **state)
{
    (void)state;
    static const float posts[2][3] = {{1, 1, 1}, {0.3f, 8, 0.3f}};
    umb_scene *scene;
    umb_shape shapes[SHAPES];
    umb_index *index;
    umb_culler *culler;
    umb_pose_source source = {.pose = walk};
    umb_motion_def motion = {.max_speed = 2.5};
    umb_object_def wall = {.transform = {{{8, 0, 0, 0}, {0, 0.5f, 0, 0}, {0, 0, 1, -12}}}}, mover = {0};
    uint32_t id;
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    add_shapes(scene, shapes);
    wall.shape = shapes[1];
    mover.shape = shapes[0];
    assert_int_equal(umb_scene_set_poses(scene, &source), UMB_OK);
    assert_int_equal(umb_scene_add_object(scene, &wall, &id), UMB_OK);
    assert_int_equal(umb_scene_add_object(scene, &mover, &id), UMB_OK);
    assert_int_equal(umb_scene_set_motion(scene, id, &motion), UMB_OK);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    assert_int_equal(umb_culler_create(index, NULL, &culler), UMB_OK);
    for (uint32_t frame = 0; frame < 600; ++frame) {
        double time = frame / 60.0, eye[3] = {0, 0, 0}, target[3] = {0, 0, -10}, up[3] = {0, 1, 0};
        bool tall = frame / 45 % 2 != 0;
        umb_pose pose = {.holds = 0.0};
        umb_visible_set seen;
        umb_view view;
        umb_aabb volume;
        if (frame % 45 == 0) {
            assert_int_equal(umb_scene_shape_object(scene, id, shapes[tall ? 2 : 0], NULL), UMB_OK);
        }
        assert_int_equal(umb_scene_set_time(scene, time), UMB_OK);
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        assert_true(umb_scene_object_bounds(scene, id, &volume));
        (void)walk(NULL, id, time, &pose);
        float at[3] = {pose.transform.m[0][3], pose.transform.m[1][3], pose.transform.m[2][3]};
        assert_true(holds(&volume, at, posts[tall]));
        assert_int_equal(umb_view_look_at(&view, eye, target, up, 1.5, 2, 0.1, 200), UMB_OK);
        view.time = time;
        assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
        bool sees = false;
        for (uint32_t i = 0; i < seen.count; ++i) {
            sees = sees || seen.objects[i] == id;
        }
        assert_true(sees == tall);
    }
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_as_anew),  cmocka_unit_test(test_refusals), cmocka_unit_test(test_captures),
        cmocka_unit_test(test_failing_allocations), cmocka_unit_test(test_movers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

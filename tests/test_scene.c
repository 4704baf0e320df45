/* The scene: ids, commits, what readers see when, bad input, failing memory. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "scene/ids.h"
#include "scene/scene.h"
#include "support/failing.h"

static const float corners[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
static const uint32_t faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
static const umb_shape_def solid = {
    .positions = corners[0], .position_count = 4, .indices = faces[0], .index_count = 12};

static umb_transform shifted(float x, float y, float z)
{
    umb_transform t = {{{1, 0, 0, x}, {0, 1, 0, y}, {0, 0, 1, z}}};
    return t;
}

static umb_aabb unit_box(float x)
{
    umb_aabb b = {{x, 0, 0}, {x + 1, 1, 1}};
    return b;
}

static bool same_box(const umb_aabb *a, const umb_aabb *b)
{
    return memcmp(a, b, sizeof *a) == 0;
}

/* Ids against a plain list of which are free. */
static void test_ids(void **state)
{
    (void)state;
    enum { MOST = 300 };
    umb_allocator a = umb_memory_allocator(NULL);
    umb_ids ids = {0};
    uint8_t used[MOST] = {0}, released[MOST] = {0};
    dice d = {31};
    for (int round = 0; round < 20000; ++round) {
        uint32_t what = dice_roll(&d, 20), id = dice_roll(&d, MOST);
        if (what == 0) {
            umb_ids_commit(&ids);
            memset(released, 0, sizeof released);
        } else if (what < 10 && used[id]) {
            umb_ids_release(&ids, id);
            used[id] = 0;
            released[id] = 1;
        } else if (what >= 10) {
            uint32_t wanted = 0;
            while (wanted < MOST && (used[wanted] || released[wanted])) {
                ++wanted;
            }
            if (wanted < MOST) {
                assert_true(umb_ids_reserve(&ids, &a));
                assert_int_equal(umb_ids_peek(&ids), wanted);
                assert_int_equal(umb_ids_take(&ids), wanted);
                used[wanted] = 1;
            }
        }
    }
    umb_ids_free(&ids, &a);
}

static void test_commit_shows_changes(void **state)
{
    (void)state;
    umb_scene *scene = NULL;
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    const umb_committed *c = umb_scene_committed(scene);
    umb_shape shape = 0;
    assert_int_equal(umb_scene_add_shape(scene, &solid, &shape), UMB_OK);
    assert_int_equal(shape, 1);
    uint32_t a, b, o;
    umb_object_def with_shape = {.shape = shape, .transform = shifted(5, 0, 0)};
    umb_object_def plain = {.bounds = unit_box(-3)};
    assert_int_equal(umb_scene_add_object(scene, &with_shape, &a), UMB_OK);
    assert_int_equal(umb_scene_add_object(scene, &plain, &b), UMB_OK);
    umb_transform at = shifted(0, 7, 0);
    assert_int_equal(umb_scene_add_occluder(scene, shape, &at, &o), UMB_OK);
    umb_aabb box;
    assert_false(umb_scene_object_bounds(scene, a, &box));
    assert_false(umb_scene_bounds(scene, &box));
    assert_int_equal(umb_scene_object_count(scene), 2);
    assert_int_equal(umb_scene_occluder_count(scene), 0);
    uint64_t version = c->version, structure = c->structure;
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_true(c->version > version && c->structure > structure);
    assert_true(umb_scene_object_bounds(scene, a, &box));
    umb_aabb wanted = unit_box(5);
    assert_true(same_box(&box, &wanted));
    assert_true(umb_scene_bounds(scene, &box));
    assert_true(box.min[0] == -3.0f && box.max[0] == 6.0f);
    assert_int_equal(umb_scene_occluder_count(scene), 2);
    assert_int_equal(c->first_free_occluder, 1);
    assert_int_equal(c->objects[a].occluder, 0);
    assert_int_equal(c->objects[b].occluder, UMB_NONE);
    assert_int_equal(c->occluders[1].owner, UMB_NONE);
    assert_true(c->occluders[1].bounds.min[1] == 7.0f && !c->occluders[1].mirrored);
    version = c->version;
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_true(c->version == version); /* nothing changed */

    umb_transform mirror = {{{-2, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    assert_int_equal(umb_scene_move_object(scene, a, &mirror, NULL), UMB_OK);
    assert_int_equal(umb_scene_move_object(scene, a, &mirror, NULL), UMB_OK);
    assert_true(c->objects[a].bounds.min[0] == 5.0f);
    structure = c->structure;
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_true(c->version == version + 1 && c->structure == structure);
    assert_int_equal(c->moved_count, 1);
    assert_int_equal(c->moved[0], a);
    assert_true(c->objects[a].bounds.min[0] == -2.0f && c->occluders[0].bounds.min[0] == -2.0f);
    assert_true(c->occluders[0].mirrored && !c->occluders[0].identity);

    assert_int_equal(umb_scene_flag_object(scene, a, UMB_OBJECT_NEVER_HIDES), UMB_OK);
    assert_int_equal(umb_scene_flag_object(scene, b, UMB_OBJECT_IGNORED), UMB_OK);
    assert_int_equal(umb_scene_remove_occluder(scene, o), UMB_OK);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_int_equal(umb_scene_occluder_count(scene), 0);
    assert_true(c->structure == structure + 1 && c->came_count == 0);
    assert_true(c->moved_count == 1 && c->moved[0] == a); /* other flags */
    assert_true(c->went_count == 1 && c->went[0] == b);
    assert_int_equal(c->replaced_count, 2);
    assert_true(c->objects[a].live && !c->objects[b].live && c->objects[b].used);
    assert_true(umb_scene_object_bounds(scene, b, &box));
    assert_true(umb_scene_bounds(scene, &box) && box.max[0] == 0.0f);
    assert_true(umb_scene_memory(scene) > sizeof(umb_mesh));
    umb_scene_destroy(scene);
    umb_scene_destroy(NULL);
}

static void test_removed_ids(void **state)
{
    (void)state;
    umb_scene *scene = NULL;
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    uint32_t id;
    umb_object_def def = {.bounds = unit_box(0)};
    for (uint32_t i = 0; i < 10; ++i) {
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
        assert_int_equal(id, i);
    }
    assert_int_equal(umb_scene_remove_object(scene, 7), UMB_OK);
    assert_int_equal(umb_scene_remove_object(scene, 3), UMB_OK);
    assert_int_equal(umb_scene_remove_object(scene, 3), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_move_object(scene, 3, NULL, &def.bounds), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_flag_object(scene, 3, 0), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
    assert_int_equal(id, 10); /* not before the commit */
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    umb_aabb box;
    assert_false(umb_scene_object_bounds(scene, 3, &box));
    assert_true(umb_scene_object_bounds(scene, 4, &box));
    static const uint32_t wanted[3] = {3, 7, 11};
    for (int i = 0; i < 3; ++i) {
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
        assert_int_equal(id, wanted[i]);
    }
    assert_int_equal(umb_scene_object_count(scene), 12);
    assert_int_equal(umb_scene_remove_object(scene, 500), UMB_ERROR_ARGUMENT);
    umb_scene_destroy(scene);
}

static void test_bad_input(void **state)
{
    (void)state;
    umb_error error = {0};
    umb_scene *scene = NULL;
    assert_int_equal(umb_scene_create(NULL, NULL), UMB_ERROR_ARGUMENT);
    umb_scene_def bad = {.error = &error, .origin = {0, NAN, 0}};
    assert_int_equal(umb_scene_create(&bad, &scene), UMB_ERROR_ARGUMENT);
    assert_int_equal(error.code, UMB_ERROR_ARGUMENT);
    umb_scene_def good = {.error = &error};
    assert_int_equal(umb_scene_create(&good, &scene), UMB_OK);
    umb_shape shape = 9;
    umb_shape_def broken = solid;
    broken.index_count = 11;
    error.text[0] = '\0';
    assert_int_equal(umb_scene_add_shape(scene, &broken, &shape), UMB_ERROR_ARGUMENT);
    assert_int_equal(shape, 0);
    assert_true(strlen(error.text) > 0);
    assert_int_equal(umb_scene_add_shape(scene, NULL, &shape), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_add_shape(scene, &solid, &shape), UMB_OK);
    uint32_t id = 5;
    static const float values[] = {NAN, INFINITY, -INFINITY, -NAN};
    for (int i = 0; i < 4; ++i) {
        umb_object_def def = {.bounds = unit_box(0)};
        def.bounds.max[1] = values[i];
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_ERROR_ARGUMENT);
        assert_int_equal(id, UMB_NONE);
        def = (umb_object_def){.shape = shape, .transform = shifted(0, 0, values[i])};
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_ERROR_ARGUMENT);
    }
    umb_object_def def = {.bounds = {{0, 2, 0}, {1, 1, 1}}};
    assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_ERROR_ARGUMENT);
    def = (umb_object_def){.shape = shape, .transform = {{{3e38f, 3e38f, 3e38f, 3e38f}}}};
    assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_ERROR_ARGUMENT);
    def = (umb_object_def){.shape = 2};
    assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_ERROR_ARGUMENT);
    def = (umb_object_def){.shape = shape, .flags = 1u << 20};
    assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_add_object(scene, NULL, &id), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_add_occluder(scene, 0, NULL, &id), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_remove_occluder(scene, 0), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_object_count(scene), 0);
    def = (umb_object_def){.bounds = unit_box(0)};
    assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
    assert_int_equal(umb_scene_move_object(scene, id, NULL, NULL), UMB_ERROR_ARGUMENT);
    umb_aabb inverted = {{1, 0, 0}, {0, 1, 1}};
    assert_int_equal(umb_scene_move_object(scene, id, NULL, &inverted), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_flag_object(scene, id, 0xF0), UMB_ERROR_ARGUMENT);
    umb_scene_destroy(scene);
}

typedef struct counter {
    umb_scene_listener listener;
    int calls;
    umb_result answer;
} counter;

static umb_result count_update(void *user)
{
    counter *c = user;
    c->calls += 1;
    return c->answer;
}

static void test_listeners(void **state)
{
    (void)state;
    umb_scene *scene = NULL;
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    counter a = {{count_update, NULL, NULL}, 0, UMB_OK}, b = a;
    a.listener.user = &a;
    b.listener.user = &b;
    umb_scene_listen(scene, &a.listener);
    umb_scene_listen(scene, &b.listener);
    uint32_t id;
    umb_object_def def = {.bounds = unit_box(0)};
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_int_equal(a.calls, 0);
    assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
    a.answer = UMB_ERROR_MEMORY;
    assert_int_equal(umb_scene_commit(scene), UMB_ERROR_MEMORY);
    assert_int_equal(a.calls, 1);
    assert_int_equal(b.calls, 1);
    a.answer = UMB_OK;
    assert_int_equal(umb_scene_commit(scene), UMB_OK); /* the one that failed is asked again */
    assert_int_equal(a.calls, 2);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_int_equal(a.calls, 2);
    umb_scene_unlisten(scene, &b.listener);
    assert_int_equal(umb_scene_remove_object(scene, id), UMB_OK);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_int_equal(a.calls, 3);
    assert_int_equal(b.calls, 2);
    umb_scene_unlisten(scene, &a.listener);
    umb_scene_destroy(scene);
}

/* Random changes; what is committed is compared with a plain list of what should be. */
static void test_random_changes(void **state)
{
    (void)state;
    enum { MOST = 60 };
    struct {
        bool used, hides, ignored;
        float x;
    } model[MOST] = {{0}};
    umb_scene *scene = NULL;
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    umb_shape shape;
    assert_int_equal(umb_scene_add_shape(scene, &solid, &shape), UMB_OK);
    dice d = {32};
    for (int round = 0; round < 3000; ++round) {
        int changes = (int)dice_roll(&d, 4);
        bool moves_only = dice_roll(&d, 2) != 0;
        for (int i = 0; i < changes; ++i) {
            uint32_t id = dice_roll(&d, MOST), what = moves_only ? 3 : dice_roll(&d, 4);
            float x = (float)dice_roll(&d, 1000);
            umb_transform t = shifted(x, 0, 0);
            if (what == 0 && umb_scene_object_count(scene) < MOST) {
                bool hides = dice_roll(&d, 3) != 0;
                umb_object_def def = {
                    .shape = shape, .transform = t, .flags = hides ? 0 : UMB_OBJECT_NEVER_HIDES};
                assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
                assert_true(id < MOST && !model[id].used);
                model[id].used = true;
                model[id].hides = hides;
                model[id].ignored = false;
                model[id].x = x;
            } else if (what == 1 && model[id].used) {
                assert_int_equal(umb_scene_remove_object(scene, id), UMB_OK);
                model[id].used = false;
            } else if (what == 2 && model[id].used) {
                model[id].ignored = !model[id].ignored;
                uint32_t flags = (model[id].ignored ? UMB_OBJECT_IGNORED : 0u) |
                                 (model[id].hides ? 0u : UMB_OBJECT_NEVER_HIDES);
                assert_int_equal(umb_scene_flag_object(scene, id, flags), UMB_OK);
            } else if (what == 3 && model[id].used) {
                assert_int_equal(umb_scene_move_object(scene, id, &t, NULL), UMB_OK);
                model[id].x = x;
            }
        }
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        const umb_committed *c = umb_scene_committed(scene);
        uint32_t owned = 0;
        for (uint32_t id = 0; id < c->object_count; ++id) {
            const umb_object *o = &c->objects[id];
            assert_int_equal(o->used, model[id].used);
            assert_int_equal(o->live, model[id].used && !model[id].ignored);
            if (!o->used) {
                continue;
            }
            assert_true(o->bounds.min[0] == model[id].x && o->transform.m[0][3] == model[id].x);
            if (o->live && model[id].hides) {
                assert_true(o->occluder < c->first_free_occluder);
                assert_int_equal(c->occluders[o->occluder].owner, id);
                assert_true(c->occluders[o->occluder].bounds.min[0] == model[id].x);
                owned += 1;
            } else {
                assert_int_equal(o->occluder, UMB_NONE);
            }
        }
        assert_int_equal(owned, c->occluder_count);
    }
    umb_scene_destroy(scene);
}

/* One small life of a scene; stops at the first failure. */
static umb_result live(umb_scene *scene)
{
    umb_shape shape;
    umb_result result = umb_scene_add_shape(scene, &solid, &shape);
    for (int i = 0; i < 8 && result == UMB_OK; ++i) {
        uint32_t id;
        umb_object_def def = {.shape = shape, .transform = shifted((float)i, 0, 0)};
        result = umb_scene_add_object(scene, &def, &id);
        if (result == UMB_OK && i % 3 == 0) {
            result = umb_scene_add_occluder(scene, shape, NULL, &id);
        }
        if (result == UMB_OK && i % 2 == 0) {
            result = umb_scene_commit(scene);
        }
    }
    umb_transform t = shifted(100, 0, 0);
    return result == UMB_OK ? umb_scene_move_object(scene, 0, &t, NULL) : result;
}

static void test_failing_memory(void **state)
{
    (void)state;
    failing f;
    umb_result result = UMB_ERROR_MEMORY;
    for (long long limit = 0; result != UMB_OK; ++limit) {
        assert_true(limit < 500);
        umb_scene_def def = {.allocator = failing_allocator(&f, limit)};
        umb_scene *scene = NULL;
        result = umb_scene_create(&def, &scene);
        if (result == UMB_OK) {
            result = live(scene);
            /* After a failure the scene can go on: with memory back, all of it succeeds. */
            atomic_store(&f.left, INT64_MAX);
            assert_int_equal(live(scene), UMB_OK);
            assert_int_equal(umb_scene_commit(scene), UMB_OK);
            assert_true(umb_scene_memory(scene) <= (size_t)atomic_load(&f.held) + 64);
        }
        umb_scene_destroy(scene);
        assert_int_equal(atomic_load(&f.held), 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ids),
        cmocka_unit_test(test_commit_shows_changes),
        cmocka_unit_test(test_removed_ids),
        cmocka_unit_test(test_bad_input),
        cmocka_unit_test(test_listeners),
        cmocka_unit_test(test_random_changes),
        cmocka_unit_test(test_failing_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

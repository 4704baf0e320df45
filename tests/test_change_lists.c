/* Commits tell what they changed: a reader that looks only at the lists knows the whole scene, after any edits, with
 * welds that come and go; and a commit costs by its changes, not by the scene. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "scene/scene.h"
#include "support/failing.h"

enum { MOST = 400, MOST_OCCLUDERS = 2000 };

static const float corners[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
static const uint32_t faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
static const umb_shape_def small =
    {.positions = corners[0], .position_count = 4, .indices = faces[0], .index_count = 9};
static const umb_shape_def solid = {
    .positions = corners[0], .position_count = 4, .indices = faces[0], .index_count = 12};

/* What a reader knows by the lists alone. */
typedef struct reader {
    umb_object objects[MOST];
    umb_occluder occluders[MOST_OCCLUDERS];
    uint32_t object_count, occluder_count;
    uint64_t version, structure;
} reader;

static umb_transform random_place(dice *d)
{
    umb_transform t = {{{1, 0, 0, (float)dice_roll(d, 8)}, {0, 1, 0, (float)dice_roll(d, 4)}, {0, 0, 1, 0}}};
    return t;
}

static void take_object(reader *r, const umb_committed *c, uint32_t id, bool was_live)
{
    assert_true(id < c->object_count);
    assert_int_equal(r->objects[id].live, was_live);
    r->objects[id] = c->objects[id];
    if (c->objects[id].occluder != UMB_NONE) {
        r->occluders[c->objects[id].occluder] = c->occluders[c->objects[id].occluder];
    }
}

static void follow(reader *r, const umb_committed *c)
{
    assert_true(c->version <= r->version + 1 && c->structure <= r->structure + 1);
    bool grew = c->structure != r->structure;
    if (c->version == r->version) {
        return;
    }
    for (uint32_t i = 0; grew && i < c->replaced_count; ++i) {
        uint32_t number = c->replaced[i];
        assert_true(number < c->occluder_count || number < r->occluder_count);
        for (uint32_t k = 0; k < i; ++k) {
            assert_true(c->replaced[k] != number);
        }
        if (number < c->occluder_count) {
            r->occluders[number] = c->occluders[number];
            uint32_t owner = c->occluders[number].owner;
            if (owner != UMB_NONE) {
                r->objects[owner].occluder = number;
            }
        }
    }
    for (uint32_t i = 0; grew && i < c->went_count; ++i) {
        assert_false(c->objects[c->went[i]].live);
        take_object(r, c, c->went[i], true);
    }
    for (uint32_t i = 0; grew && i < c->came_count; ++i) {
        assert_true(c->objects[c->came[i]].live);
        take_object(r, c, c->came[i], false);
    }
    for (uint32_t i = 0; i < c->moved_count; ++i) {
        assert_true(c->objects[c->moved[i]].live);
        take_object(r, c, c->moved[i], true);
    }
    r->occluder_count = c->occluder_count;
    r->version = c->version;
    r->structure = c->structure;
}

/* Only live objects are followed: what is not live, nobody looks at. */
static void compare(const reader *r, const umb_committed *c)
{
    uint32_t owned = 0;
    assert_int_equal(r->occluder_count, c->occluder_count);
    for (uint32_t i = 0; i < c->object_count; ++i) {
        const umb_object *a = &r->objects[i], *b = &c->objects[i];
        assert_int_equal(a->live, b->live);
        if (b->live) {
            assert_memory_equal(&a->bounds, &b->bounds, sizeof a->bounds);
            assert_ptr_equal(a->mesh, b->mesh);
            assert_int_equal(a->occluder, b->occluder);
            assert_int_equal(a->refine, b->refine);
        }
        if (b->occluder != UMB_NONE) {
            assert_true(b->live && b->occluder < c->first_free_occluder);
            assert_int_equal(c->occluders[b->occluder].owner, i);
            owned += 1;
        }
    }
    assert_int_equal(owned, c->first_free_occluder);
    for (uint32_t i = 0; i < c->occluder_count; ++i) {
        const umb_occluder *a = &r->occluders[i], *b = &c->occluders[i];
        assert_ptr_equal(a->mesh, b->mesh);
        assert_int_equal(a->owner, b->owner);
        assert_memory_equal(&a->transform, &b->transform, sizeof a->transform);
        assert_int_equal(b->owner == UMB_NONE, i >= c->first_free_occluder);
    }
}

static void edit(umb_scene *scene, dice *d, umb_shape shape)
{
    static const umb_aabb box = {{0, 0, 0}, {1, 1, 1}};
    uint32_t id = dice_roll(d, MOST), unused, what = dice_roll(d, 18);
    umb_transform t = random_place(d);
    umb_object_def def = {.shape = shape, .transform = t, .flags = dice_roll(d, 16)};
    if (what < 5) {
        (void)umb_scene_move_object(scene, id, &t, NULL);
    } else if (what < 8 && umb_scene_object_count(scene) < MOST) {
        assert_int_equal(umb_scene_add_object(scene, &def, &unused), UMB_OK);
    } else if (what < 10) {
        (void)umb_scene_remove_object(scene, id);
    } else if (what < 12) {
        (void)umb_scene_flag_object(scene, id, def.flags);
    } else if (what >= 16) { /* another shape, or none: the shape's number is 1, the small one's 2 */
        (void)umb_scene_shape_object(scene, id, dice_roll(d, 3), &box);
    } else if (what == 12) {
        assert_int_equal(umb_scene_add_occluder(scene, shape, &t, &unused), UMB_OK);
    } else if (what < 15) {
        (void)umb_scene_remove_occluder(scene, dice_roll(d, 40));
    } else if (dice_roll(d, 8) == 0) {
        assert_int_equal(umb_scene_weld(scene, NULL, NULL), UMB_OK);
    }
}

static void test_lists_tell_all(void **state)
{
    (void)state;
    static reader r;
    memset(&r, 0, sizeof r);
    dice d = {7};
    umb_scene *scene;
    umb_shape shape;
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    assert_int_equal(umb_scene_add_shape(scene, &solid, &shape), UMB_OK);
    umb_shape other;
    assert_int_equal(umb_scene_add_shape(scene, &small, &other), UMB_OK);
    assert_true(shape == 1 && other == 2);
    const umb_committed *c = umb_scene_committed(scene);
    for (int round = 0; round < 4000; ++round) {
        for (uint32_t i = dice_roll(&d, 12); i > 0; --i) {
            edit(scene, &d, shape);
        }
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        assert_true(c->occluder_count < MOST_OCCLUDERS);
        follow(&r, c);
        compare(&r, c);
    }
    umb_scene_destroy(scene);
}

/* Things that come and go in a steady number: memory is steady, too. */
static void test_steady_memory(void **state)
{
    (void)state;
    dice d = {8};
    failing memory;
    umb_scene_def def = {.allocator = failing_allocator(&memory, 1LL << 60)};
    umb_scene *scene;
    umb_shape shape;
    uint32_t id;
    long long left = 0;
    assert_int_equal(umb_scene_create(&def, &scene), UMB_OK);
    assert_int_equal(umb_scene_add_shape(scene, &solid, &shape), UMB_OK);
    for (int round = 0; round < 5000; ++round) {
        umb_object_def object = {.shape = shape, .transform = random_place(&d)};
        assert_int_equal(umb_scene_add_object(scene, &object, &id), UMB_OK);
        if (round >= 300) {
            while (umb_scene_remove_object(scene, dice_roll(&d, MOST)) != UMB_OK) {
            }
        }
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        left = round == 1000 ? atomic_load(&memory.left) : left;
    }
    assert_true(atomic_load(&memory.left) == left);
    umb_scene_destroy(scene);
    assert_true(atomic_load(&memory.held) == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lists_tell_all),
        cmocka_unit_test(test_steady_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Frustum culling through the culler: the set is that of each box tested alone, nothing that touches the frustum in
 * long double is missing, order and flags are what they were by the queue, steady frames allocate nothing. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "cull/contribution.h"
#include "frustum/box_kernels.h"
#include "support/failing.h"
#include "support/frustum_reference.h"
#include "support/random_boxes.h"
#include "umbrage/cull.h"

enum { MOST = 3000, REACH = 100 };

static const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
static const uint32_t order[3] = {0, 1, 2};

static umb_transform random_place(uint64_t *seed)
{
    umb_transform t = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    for (int a = 0; a < 3; ++a) {
        t.m[a][3] = (float)random_in(seed, -REACH, REACH);
    }
    return t;
}

/* Boxes of all kinds; objects of a shape, which can move; stand-alone occluders, which are no objects; and gaps
 * among the ids. */
static umb_scene *make_scene(uint64_t *seed, uint32_t count, bool occluders, const umb_allocator *allocator)
{
    static const double origin[3] = {0, 0, 0};
    umb_scene *scene;
    umb_scene_def scene_def = {0};
    if (allocator != NULL) {
        scene_def.allocator = *allocator;
    }
    umb_shape_def shape_def = {.positions = corners, .position_count = 3, .indices = order, .index_count = 3};
    umb_shape shape;
    assert_int_equal(umb_scene_create(&scene_def, &scene), UMB_OK);
    assert_int_equal(umb_scene_add_shape(scene, &shape_def, &shape), UMB_OK);
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t id;
        umb_object_def def = {.bounds = i % 16 == 0 ? absurd_box(seed) : random_box(seed, origin, REACH / 2.0)};
        if (i % 4 == 0) {
            def = (umb_object_def){.shape = shape, .transform = random_place(seed)};
        }
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
        if (occluders && i % 5 == 0) {
            umb_transform t = random_place(seed);
            assert_int_equal(umb_scene_add_occluder(scene, shape, &t, &id), UMB_OK);
        }
    }
    for (uint32_t i = 3; i < count; i += 17) {
        assert_int_equal(umb_scene_remove_object(scene, i), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    return scene;
}

static void move_some(uint64_t *seed, umb_scene *scene, uint32_t count)
{
    for (uint32_t i = 0; i < count; i += 4) {
        if (i % 17 != 3 && random_below(seed, 3) == 0) {
            umb_transform t = random_place(seed);
            assert_int_equal(umb_scene_move_object(scene, i, &t, NULL), UMB_OK);
        }
    }
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
}

/* For each id: 0 not found, 1 crossing, 2 inside; every box in a node of its own. Checks against long double. */
static void by_box(const umb_scene *scene, const umb_view *v, uint8_t found[MOST])
{
    umb_frustum f;
    umb_frustum_prepare(&f, v);
    memset(found, 0, MOST);
    for (uint32_t i = 0; i < umb_scene_object_count(scene); ++i) {
        umb_aabb box;
        if (!umb_scene_object_bounds(scene, i, &box)) {
            continue;
        }
        bool small = v->min_pixels > 0.0 && umb_contribution_small(v, &box), sound;
        uint8_t place = place_of_box(v, &f, &box, &sound);
        found[i] = small ? 0 : place;
        assert_true(sound);
    }
}

static void check_set(const umb_visible_set *seen, const uint8_t found[MOST])
{
    static uint8_t met[MOST];
    uint32_t count = 0;
    memset(met, 0, sizeof(met));
    for (uint32_t i = 0; i < seen->count; ++i) {
        uint32_t id = seen->objects[i];
        assert_true(id < MOST && met[id] == 0 && found[id] != 0);
        assert_int_equal(seen->inside[i], found[id] == 2);
        met[id] = 1;
    }
    for (uint32_t i = 0; i < MOST; ++i) {
        count += found[i] != 0;
    }
    assert_int_equal(seen->count, count);
    assert_int_equal(seen->stats.visible, count);
    assert_int_equal(seen->stats.in_frustum, seen->count + seen->stats.small);
}

static umb_culler *make_culler(const umb_index *index, umb_method method, umb_isa isa, bool unordered)
{
    umb_culler_def def = {.method = method, .isa = isa, .unordered = unordered};
    umb_culler *c;
    assert_int_equal(umb_culler_create(index, &def, &c), UMB_OK);
    return c;
}

static umb_view make_view(uint64_t *seed, int i)
{
    umb_view v = random_view(seed, i % 5 == 4 ? 10.0 * REACH : REACH);
    v.min_pixels = i % 4 == 3 ? random_in(seed, 1.0, 60.0) : 0.0;
    v.width = 1280;
    v.height = 720;
    return v;
}

/* Trees and rows, with and without order, by every instruction set, after builds and after moves. */
static void test_sets(void **state)
{
    (void)state;
    static const umb_isa isas[] = {UMB_ISA_SCALAR, UMB_ISA_SSE4, UMB_ISA_AVX2, UMB_ISA_NEON};
    uint64_t seed = 51, total = 0, inside = 0;
    for (int round = 0; round < 12; ++round) {
        uint32_t count = round < 4 ? (uint32_t)round * 7 : MOST;
        umb_scene *scene = make_scene(&seed, count, round % 2 == 0, NULL);
        umb_index *index[2];
        umb_culler *cullers[4];
        umb_isa isa = isas[round % 4];
        isa = umb_isa_available(isa) ? isa : UMB_ISA_AUTO;
        for (int k = 0; k < 4; ++k) {
            umb_index_def def = {.kind = k < 2 ? UMB_INDEX_BVH : UMB_INDEX_FLAT};
            if (k % 2 == 0) {
                assert_int_equal(umb_index_create(scene, &def, &index[k / 2]), UMB_OK);
            }
            cullers[k] = make_culler(index[k / 2], UMB_METHOD_NONE, isa, k % 2 == 1);
        }
        for (int i = 0; i < 24; ++i) {
            static uint8_t found[MOST];
            umb_view v = make_view(&seed, i);
            umb_visible_set seen[4];
            by_box(scene, &v, found);
            for (int k = 0; k < 4; ++k) {
                assert_int_equal(umb_cull(cullers[k], &v, &seen[k]), UMB_OK);
                check_set(&seen[k], found);
            }
            assert_memory_equal(seen[0].objects, seen[2].objects, seen[0].count * sizeof(uint32_t));
            for (uint32_t j = 0; j < seen[0].count; ++j) {
                inside += seen[0].inside[j];
            }
            total += seen[0].count;
            move_some(&seed, scene, i % 6 == 5 ? count : 0);
        }
        for (int k = 0; k < 4; ++k) {
            umb_culler_destroy(cullers[k]);
        }
        umb_index_destroy(index[0]);
        umb_index_destroy(index[1]);
        umb_scene_destroy(scene);
    }
    assert_true(inside > 20000 && total > inside + 10000);
}

/* Where nothing hides, the raster method reports by its queue, nearest first: the same objects in the same order, but
 * for boxes that only its projection finds to miss the picture. */
static void test_order(void **state)
{
    (void)state;
    uint64_t seed = 52, same = 0, more = 0;
    umb_scene *scene = make_scene(&seed, MOST, false, NULL);
    umb_index *index;
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    umb_culler *plain = make_culler(index, UMB_METHOD_NONE, UMB_ISA_AUTO, false);
    umb_culler *queue = make_culler(index, UMB_METHOD_RASTER, UMB_ISA_AUTO, false);
    for (int i = 0; i < 200; ++i) {
        umb_view v = make_view(&seed, i);
        umb_visible_set a, b;
        assert_int_equal(umb_cull(plain, &v, &a), UMB_OK);
        assert_int_equal(umb_cull(queue, &v, &b), UMB_OK);
        uint32_t j = 0;
        for (uint32_t k = 0; k < a.count; ++k) {
            if (j < b.count && a.objects[k] == b.objects[j]) {
                assert_int_equal(a.inside[k], b.inside[j]);
                ++j;
            }
        }
        assert_int_equal(j, b.count);
        same += j;
        more += a.count - j;
    }
    assert_true(same > 10000 && more < same / 100);
    umb_culler_destroy(plain);
    umb_culler_destroy(queue);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

static void test_steady_frames(void **state)
{
    (void)state;
    for (int k = 0; k < 4; ++k) {
        uint64_t seed = 53;
        failing memory;
        umb_allocator allocator = failing_allocator(&memory, 1LL << 60);
        umb_scene *scene = make_scene(&seed, MOST, true, &allocator);
        umb_index_def def = {.kind = k < 2 ? UMB_INDEX_BVH : UMB_INDEX_FLAT};
        umb_index *index;
        umb_visible_set seen;
        assert_int_equal(umb_index_create(scene, &def, &index), UMB_OK);
        umb_culler *c = make_culler(index, UMB_METHOD_NONE, UMB_ISA_AUTO, k % 2 == 1);
        umb_view v = make_view(&seed, 0);
        assert_int_equal(umb_cull(c, &v, &seen), UMB_OK);
        long long left = atomic_load(&memory.left);
        for (int i = 0; i < 1000; ++i) {
            v = make_view(&seed, i);
            assert_int_equal(umb_cull(c, &v, &seen), UMB_OK);
        }
        assert_true(atomic_load(&memory.left) == left);
        umb_culler_destroy(c);
        umb_index_destroy(index);
        umb_scene_destroy(scene);
        assert_true(atomic_load(&memory.held) == 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sets),
        cmocka_unit_test(test_order),
        cmocka_unit_test(test_steady_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Shadow frusta and occlusion trees as methods: answers that depend on nothing but scene and view, memory, what each
 * is by its definition. That they hide nothing that is seen is tested by test_strict and test_scenes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/failing.h"
#include "support/micro_scenes.h"

static const umb_method METHODS[] = {UMB_METHOD_SHADOW_FRUSTA, UMB_METHOD_OCCLUSION_TREE};
enum { METHOD_COUNT = 2 };

static uint32_t rounds(uint32_t normal)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && size[0] == 's' ? normal / 10 : size != NULL && size[0] == 'f' ? normal * 10 : normal;
}

static umb_scene *build(const micro_scene *micro)
{
    umb_error error = {0};
    umb_tasks none = {0};
    umb_scene *scene = model_scene(micro->model, micro->weld, none, NULL, &error);
    assert_non_null(scene);
    return scene;
}

/* The same, with memory of its own. */
static umb_scene *build_with(const micro_scene *micro, const umb_allocator *allocator)
{
    const model *m = micro->model;
    umb_scene *scene;
    umb_scene_def def = {.allocator = *allocator};
    umb_shape *shapes = calloc(m->mesh_count, sizeof *shapes);
    assert_non_null(shapes);
    assert_int_equal(umb_scene_create(&def, &scene), UMB_OK);
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        umb_shape_def shape = {.positions = m->meshes[i].positions,
                               .position_count = m->meshes[i].position_count,
                               .indices = m->meshes[i].indices,
                               .index_count = m->meshes[i].triangle_count * 3,
                               .triangle_flags = m->meshes[i].flags};
        assert_int_equal(umb_scene_add_shape(scene, &shape, &shapes[i]), UMB_OK);
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        uint32_t id;
        umb_object_def object = {.bounds = m->objects[i].bounds,
                                 .transform = m->objects[i].transform,
                                 .shape = shapes[m->objects[i].mesh],
                                 .flags = UMB_OBJECT_STATIC | UMB_OBJECT_IS_SHAPE};
        assert_int_equal(umb_scene_add_object(scene, &object, &id), UMB_OK);
    }
    if (micro->weld) {
        assert_int_equal(umb_scene_weld(scene, NULL, NULL), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    free(shapes);
    return scene;
}

/* Ids in order are the same set exactly when hashes are. */
static uint64_t hash_of(const umb_visible_set *seen, bool with_stats)
{
    uint64_t h = 14695981039346656037u;
    for (uint32_t i = 0; i < seen->count; ++i) {
        h = (h ^ seen->objects[i]) * 1099511628211u;
    }
    return with_stats ? (h ^ seen->stats.queries) * 31 + seen->stats.occluders : h;
}

static uint64_t answer(umb_scene *scene, const char *kind, const umb_culler_def *def, const umb_view *view, bool stats)
{
    umb_index_def index_def = {0};
    umb_index *index = NULL;
    umb_culler *culler = NULL;
    umb_visible_set seen;
    assert_true(umb_index_parse(kind, &index_def));
    assert_int_equal(umb_index_create(scene, &index_def, &index), UMB_OK);
    assert_int_equal(umb_culler_create(index, def, &culler), UMB_OK);
    assert_int_equal(umb_cull(culler, view, &seen), UMB_OK);
    assert_int_equal(seen.class_, UMB_CLASS_STRICT);
    uint64_t hash = hash_of(&seen, stats);
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    return hash;
}

static void test_same_answers(void **state)
{
    (void)state;
    static const umb_isa sets[] = {UMB_ISA_SCALAR, UMB_ISA_SSE4, UMB_ISA_AVX2, UMB_ISA_NEON};
    for (uint32_t i = 0; i < rounds(200); ++i) {
        micro_scene micro;
        assert_true(micro_scene_make(i, &micro));
        umb_scene *scene = build(&micro);
        for (int m = 0; m < METHOD_COUNT; ++m) {
            umb_culler_def def = {.method = METHODS[m], .isa = UMB_ISA_SCALAR, .occluder_budget = i % 9 * 4};
            uint64_t first = answer(scene, "bvh", &def, &micro.view, true);
            for (int k = 1; k < 4; ++k) {
                def.isa = sets[k];
                if (umb_isa_available(sets[k])) {
                    assert_int_equal(answer(scene, "bvh", &def, &micro.view, true), first);
                }
            }
        }
        umb_scene_destroy(scene);
        micro_scene_free(&micro);
    }
}

/* A generated town along its path. */
static void test_golden(void **state)
{
    (void)state;
    umb_error error = {0};
    camera_path path;
    model *m = model_load("gen:blocks,g=12", NULL, &error);
    assert_non_null(m);
    assert_true(camera_path_load("gen:blocks,g=12", &path, &error));
    umb_scene *scene = model_scene(m, true, (umb_tasks){0}, NULL, &error);
    umb_index *index = NULL;
    assert_non_null(scene);
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    for (int k = 0; k < METHOD_COUNT; ++k) {
        umb_culler *culler = NULL;
        umb_culler_def def = {.method = METHODS[k], .occluder_budget = 24};
        uint64_t golden = 0;
        assert_int_equal(umb_culler_create(index, &def, &culler), UMB_OK);
        for (uint32_t i = 0; i < path.count; ++i) {
            const double *row = path.rows[i];
            umb_view view;
            umb_visible_set seen;
            assert_int_equal(umb_view_look_at(&view, row, row + 3, m->up, 1.0, 2.0, 0.1, 1000.0), UMB_OK);
            assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
            golden = golden * 31 + hash_of(&seen, true);
        }
        printf("golden object-space-%s %016llx\n", umb_method_name(METHODS[k]), (unsigned long long)golden);
        umb_culler_destroy(culler);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    camera_path_free(&path);
    model_free(m);
}

/* One culler that walks: a frame again is the same, whatever came between; budgets hold. */
static void test_no_past(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < rounds(200); ++i) {
        micro_scene micro;
        assert_true(micro_scene_make(i, &micro));
        umb_scene *scene = build(&micro);
        umb_index *index = NULL;
        assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
        for (int m = 0; m < METHOD_COUNT; ++m) {
            umb_culler *culler = NULL;
            umb_visible_set seen;
            umb_view other = micro.view;
            umb_culler_def def = {.method = METHODS[m], .occluder_budget = 3};
            other.eye[0] += 0.25;
            assert_int_equal(umb_culler_create(index, &def, &culler), UMB_OK);
            assert_int_equal(umb_cull(culler, &micro.view, &seen), UMB_OK);
            uint64_t first = hash_of(&seen, true);
            assert_true(seen.stats.occluders <= 3);
            assert_int_equal(umb_cull(culler, &other, &seen), UMB_OK);
            assert_int_equal(umb_cull(culler, &micro.view, &seen), UMB_OK);
            assert_int_equal(hash_of(&seen, true), first);
            umb_culler_destroy(culler);
        }
        umb_index_destroy(index);
        umb_scene_destroy(scene);
        micro_scene_free(&micro);
    }
}

/* What is hidden does not depend on the tree: a node's box is hidden only if each box in it is. Trees that cut objects ask
 * about their pieces, which says a little more. */
static void test_indices(void **state)
{
    (void)state;
    uint32_t same = 0, all = 0;
    for (uint32_t i = 0; i < rounds(100); ++i) {
        micro_scene micro;
        assert_true(micro_scene_make(i, &micro));
        umb_scene *scene = build(&micro);
        for (int m = 0; m < METHOD_COUNT; ++m) {
            umb_culler_def def = {.method = METHODS[m]};
            uint64_t first = answer(scene, "flat", &def, &micro.view, false);
            for (uint32_t k = 0; umb_index_variant(k) != NULL; ++k, ++all) {
                const char *kind = umb_index_variant(k);
                bool equal = answer(scene, kind, &def, &micro.view, false) == first;
                assert_true(equal || strncmp(kind, "bvh", 3) != 0);
                same += equal;
            }
        }
        umb_scene_destroy(scene);
        micro_scene_free(&micro);
    }
    printf("# %u of %u answers over other indices are those over a flat one\n", same, all);
    assert_true(same * 10 >= all * 9);
}

static void check_memory(umb_method method, uint64_t number)
{
    micro_scene micro;
    failing f;
    umb_allocator a = failing_allocator(&f, 1 << 30);
    assert_true(micro_scene_make(number, &micro));
    umb_scene *scene = build_with(&micro, &a);
    umb_index *index = NULL;
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    long long held = atomic_load(&f.held);
    uint32_t expected = UMB_NONE;
    bool done = false;
    for (long long limit = 0; !done; ++limit) {
        umb_culler_def def = {.method = method};
        umb_culler *culler = NULL;
        umb_visible_set seen;
        atomic_store(&f.left, limit);
        if (umb_culler_create(index, &def, &culler) == UMB_OK) {
            umb_result result = umb_cull(culler, &micro.view, &seen);
            assert_true(result == UMB_OK || result == UMB_ERROR_MEMORY);
            done = result == UMB_OK;
            atomic_store(&f.left, 1 << 30);
            assert_int_equal(umb_cull(culler, &micro.view, &seen), UMB_OK);
            expected = expected == UMB_NONE ? seen.count : expected;
            assert_int_equal(seen.count, expected);
            atomic_store(&f.left, 0); /* a steady frame takes none */
            assert_int_equal(umb_cull(culler, &micro.view, &seen), UMB_OK);
            assert_int_equal(seen.count, expected);
        }
        umb_culler_destroy(culler);
        assert_true(atomic_load(&f.held) == held);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    micro_scene_free(&micro);
}

static void test_memory(void **state)
{
    (void)state;
    for (uint64_t i = 0; i < micro_scene_kinds(); ++i) {
        for (int m = 0; m < METHOD_COUNT; ++m) {
            check_memory(METHODS[m], i);
        }
    }
}

/* With what hid most chosen first, and with rests, frames of a viewer that moves are still strict in what they may
 * report: never fewer than with all occluders. */
static void test_coherence(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < rounds(100); ++i) {
        micro_scene micro;
        assert_true(micro_scene_make(i, &micro));
        umb_scene *scene = build(&micro);
        umb_index *index = NULL;
        umb_culler *all = NULL, *few = NULL;
        umb_culler_def with_all = {.method = UMB_METHOD_SHADOW_FRUSTA, .occluder_budget = 4000};
        umb_culler_def with_few = {.method = UMB_METHOD_SHADOW_FRUSTA,
                                   .occluder_budget = 2,
                                   .coherence = UMB_COHERENCE_LIST | UMB_COHERENCE_REST};
        assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
        assert_int_equal(umb_culler_create(index, &with_all, &all), UMB_OK);
        assert_int_equal(umb_culler_create(index, &with_few, &few), UMB_OK);
        umb_view view = micro.view;
        for (int step = 0; step < 6; ++step) {
            umb_visible_set more, less;
            assert_int_equal(umb_cull(all, &view, &less), UMB_OK);
            assert_int_equal(umb_cull(few, &view, &more), UMB_OK);
            for (uint32_t k = 0, n = 0; k < less.count; ++k, ++n) { /* both are in the same order */
                while (n < more.count && more.objects[n] != less.objects[k]) {
                    n += 1;
                }
                assert_true(n < more.count);
            }
            view.eye[1] += 0.015625;
        }
        umb_culler_destroy(all);
        umb_culler_destroy(few);
        umb_index_destroy(index);
        umb_scene_destroy(scene);
        micro_scene_free(&micro);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_same_answers), cmocka_unit_test(test_golden),
                                       cmocka_unit_test(test_no_past), cmocka_unit_test(test_indices),
                                       cmocka_unit_test(test_memory), cmocka_unit_test(test_coherence)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Every way to build an index: parts that hold their items, frustum answers that lie between the exact one and the flat one,
 * motion, captures, failing allocations. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/box_meets.h"
#include "support/failing.h"
#include "support/index_check.h"
#include "support/index_sets.h"

static void test_all_sets(void **state)
{
    (void)state;
    static const uint32_t counts[] = {0, 1, 2, 7, 9, 33, 300, 3000};
    for (int set = 0; set < INDEX_SETS; ++set) {
        for (size_t i = 0; i < sizeof(counts) / sizeof(counts[0]) - for_size(1, 0, 0); ++i) {
            umb_scene *scene = index_scene(71, set, counts[i], NULL);
            const char *name;
            for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
                umb_index *index = index_make(scene, name);
                index_check(index);
                umb_index_destroy(index);
            }
            umb_scene_destroy(scene);
        }
    }
}

static void test_names(void **state)
{
    (void)state;
    const char *name;
    umb_index_def def = {0};
    for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
        assert_true(umb_index_parse(name, &def));
        assert_string_equal(umb_index_name(&def), name);
    }
    assert_true(umb_index_parse("kdtree", &def) && def.kind == UMB_INDEX_KDTREE && def.rule == UMB_RULE_DEFAULT);
    static const char *const bad[] = {"", ",", "bvh,", "kd", "kdtree,", "kdtree,mad", "kdtree,median,median",
                                      "median", "flat,median", "kdtree;median", "kdtree,media,n", "bvhh"};
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); ++i) {
        assert_false(umb_index_parse(bad[i], &def));
    }
    assert_true(def.kind == UMB_INDEX_KDTREE);
}

/* ---- frusta --------------------------------------------------------------------------------- */

typedef struct crew {
    umb_index *index;
    umb_culler *sorted, *unordered;
    umb_error error;
} crew;

static void make_crew(umb_scene *scene, const char *name, crew *out)
{
    out->index = index_make(scene, name);
    umb_culler_def def = {.method = UMB_METHOD_NONE, .error = &out->error};
    assert_int_equal(umb_culler_create(out->index, &def, &out->sorted), UMB_OK);
    def.unordered = true;
    assert_int_equal(umb_culler_create(out->index, &def, &out->unordered), UMB_OK);
}

static void free_crew(crew *c)
{
    umb_culler_destroy(c->sorted);
    umb_culler_destroy(c->unordered);
    umb_index_destroy(c->index);
}

/* By what the index knows of the object: its box, or in BSP trees its triangles, of which some points are tried. */
static bool surely_meets(const umb_scene *scene, const crew *c, const umb_view *v, uint32_t id)
{
    umb_aabb box;
    half_space h[UMB_FRUSTUM_PLANES + 6];
    long double at[3];
    uint64_t seed = 80 + id;
    const umb_committed *now = umb_scene_committed(scene);
    assert_true(umb_scene_object_bounds(scene, id, &box));
    if (umb_index_settings(c->index).kind != UMB_INDEX_BSP || !index_point_of_item(now, id, &seed, at)) {
        return box_surely_meets(v, &box, 1e-7L * INDEX_REACH);
    }
    uint32_t n = half_spaces_of(v, &box, h);
    for (int trial = 0; trial < 100; ++trial) {
        bool in = index_point_of_item(now, id, &seed, at);
        for (uint32_t k = 0; k < n - 6 && in; ++k) {
            in = half_space_at(&h[k], at) > 1e-7L * INDEX_REACH;
        }
        if (in) {
            return true;
        }
    }
    return false;
}

/* An index' answer is the flat one's, in its order and with its flags, but for objects that surely do not meet the
 * frustum. The unordered one may leave out others of these. */
static void check_answer(const umb_scene *scene, crew *c, const umb_view *v, const umb_visible_set *flat,
                         uint64_t *left_out)
{
    umb_visible_set seen;
    assert_int_equal(umb_cull(c->sorted, v, &seen), UMB_OK);
    uint32_t at = 0;
    uint8_t *found = calloc((size_t)umb_scene_object_count(scene) + 1, 1);
    assert_non_null(found);
    for (uint32_t i = 0; i < flat->count; ++i) {
        found[flat->objects[i]] = 1;
        if (at < seen.count && seen.objects[at] == flat->objects[i]) {
            assert_int_equal(seen.inside[at], flat->inside[i]);
            ++at;
        } else {
            assert_false(surely_meets(scene, c, v, flat->objects[i]));
            found[flat->objects[i]] = 2;
            *left_out += 1;
        }
    }
    assert_int_equal(at, seen.count);
    assert_int_equal(seen.stats.visible, seen.count);
    assert_int_equal(seen.stats.in_frustum, seen.count + seen.stats.small);
    assert_int_equal(umb_cull(c->unordered, v, &seen), UMB_OK);
    for (uint32_t i = 0; i < seen.count; ++i) {
        assert_true(found[seen.objects[i]] == 1 || found[seen.objects[i]] == 2);
        found[seen.objects[i]] = 3;
    }
    for (uint32_t i = 0; i < umb_scene_object_count(scene); ++i) {
        assert_true(found[i] != 1 || !surely_meets(scene, c, v, i));
    }
    free(found);
}

static void check_frusta(index_set set, uint32_t rounds, bool moves)
{
    enum { MOST = 64 };
    uint64_t seed = 74 + (uint64_t)set, left_out = 0;
    umb_scene *scene = index_scene(75, set, 700, NULL);
    crew flat, crews[MOST];
    uint32_t n = 0;
    make_crew(scene, "flat", &flat);
    for (; umb_index_variant(n) != NULL; ++n) {
        assert_true(n < MOST);
        make_crew(scene, umb_index_variant(n), &crews[n]);
    }
    for (uint32_t round = 0; round < rounds; ++round) {
        if (moves) {
            index_move_some(scene, &seed, 1 + random_below(&seed, round % 5 == 4 ? 600 : 20), random_below(&seed, 2) == 0);
            assert_int_equal(umb_scene_commit(scene), UMB_OK);
        }
        umb_view v = random_view(&seed, INDEX_REACH);
        v.min_pixels = round % 4 == 3 ? random_in(&seed, 1, 200) : 0;
        umb_visible_set seen;
        assert_int_equal(umb_cull(flat.sorted, &v, &seen), UMB_OK);
        for (uint32_t k = 0; k < n; ++k) {
            check_answer(scene, &crews[k], &v, &seen, &left_out);
        }
    }
    for (uint32_t k = 0; k < n; ++k) {
        index_check(crews[k].index);
        free_crew(&crews[k]);
    }
    free_crew(&flat);
    umb_scene_destroy(scene);
    assert_true(left_out > 0 || set != INDEX_SPREAD);
}

static void test_frusta(void **state)
{
    (void)state;
    static const index_set sets[] = {INDEX_SPREAD, INDEX_CROWDED, INDEX_SHEETS};
    for (size_t i = 0; i < sizeof(sets) / sizeof(sets[0]); ++i) {
        check_frusta(sets[i], for_size(30, 60, 600), false);
    }
}

static void test_motion(void **state)
{
    (void)state;
    check_frusta(INDEX_SPREAD, for_size(60, 120, 1200), true);
    check_frusta(INDEX_CROWDED, for_size(30, 60, 600), true);
}

/* ---- captures ------------------------------------------------------------------------------- */

/* What is loaded answers to the bit as what was saved, after moves too. */
static void test_captures(void **state)
{
    (void)state;
    const char *name;
    uint64_t seed = 76;
    for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
        umb_scene *scene = index_scene(77, INDEX_SPREAD, 400, NULL);
        umb_index *index = index_make(scene, name);
        umb_culler *culler;
        umb_culler_def def = {.method = k % 2 == 0 ? UMB_METHOD_RASTER : UMB_METHOD_NONE};
        assert_int_equal(umb_culler_create(index, &def, &culler), UMB_OK);
        for (int round = 0; round < 6; ++round) {
            umb_view v = random_view(&seed, INDEX_REACH);
            umb_visible_set seen, again;
            assert_int_equal(umb_cull(culler, &v, &seen), UMB_OK);
            size_t size;
            assert_int_equal(umb_capture_save(culler, NULL, 0, &size), UMB_OK);
            void *bytes = malloc(size);
            assert_non_null(bytes);
            assert_int_equal(umb_capture_save(culler, bytes, size, &size), UMB_OK);
            umb_capture capture;
            umb_error error;
            assert_int_equal(umb_capture_load(bytes, size, UMB_ISA_AUTO, (umb_tasks){0}, &capture, &error), UMB_OK);
            assert_string_equal(umb_index_name(&capture.index_def), name);
            index_check(capture.index);
            assert_int_equal(umb_cull(capture.culler, &capture.view, &again), UMB_OK);
            assert_int_equal(seen.count, again.count);
            assert_memory_equal(seen.objects, again.objects, seen.count * sizeof(seen.objects[0]));
            if (def.method == UMB_METHOD_NONE) { /* fewer: lists below nodes are new in a tree that has been loaded */
                assert_true(again.stats.nodes <= seen.stats.nodes);
                again.stats.nodes = seen.stats.nodes;
            }
            assert_memory_equal(&seen.stats, &again.stats, sizeof(seen.stats));
            umb_capture_free(&capture);
            free(bytes);
            index_move_some(scene, &seed, 1 + random_below(&seed, 200), round % 2 == 0);
            assert_int_equal(umb_scene_commit(scene), UMB_OK);
        }
        umb_culler_destroy(culler);
        umb_index_destroy(index);
        umb_scene_destroy(scene);
    }
}

/* ---- memory --------------------------------------------------------------------------------- */

static void test_failing_allocations(void **state)
{
    (void)state;
    const char *name;
    for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
        failing f;
        umb_allocator a = failing_allocator(&f, INT64_MAX);
        umb_scene *scene = index_scene(78, INDEX_SPREAD, 1500, &a);
        umb_index_def def = {0};
        umb_index *index = NULL;
        umb_culler *culler = NULL;
        umb_result result = UMB_ERROR_MEMORY;
        long long held = atomic_load(&f.held), limit = 0;
        assert_true(umb_index_parse(name, &def));
        for (; result != UMB_OK; ++limit) {
            atomic_store(&f.left, limit);
            result = umb_index_create(scene, &def, &index);
            assert_true(result == UMB_OK || (result == UMB_ERROR_MEMORY && index == NULL));
            assert_true(result == UMB_OK || atomic_load(&f.held) == held);
        }
        assert_true(limit > 2);
        index_check(index);
        atomic_store(&f.left, INT64_MAX);
        umb_culler_def culler_def = {.method = k % 2 == 0 ? UMB_METHOD_RASTER : UMB_METHOD_NONE};
        assert_int_equal(umb_culler_create(index, &culler_def, &culler), UMB_OK);
        uint64_t seed = 79;
        umb_view v = random_view(&seed, INDEX_REACH);
        umb_visible_set seen;
        for (limit = 0, result = UMB_ERROR_MEMORY; result != UMB_OK; ++limit) {
            atomic_store(&f.left, limit);
            result = umb_cull(culler, &v, &seen);
            assert_true(result == UMB_OK || (result == UMB_ERROR_MEMORY && seen.count == 0));
        }
        /* A steady frame allocates nothing, whatever the view. */
        v.min_pixels = 3;
        atomic_store(&f.left, 0);
        assert_int_equal(umb_cull(culler, &v, &seen), UMB_OK);
        atomic_store(&f.left, INT64_MAX);
        umb_culler_destroy(culler);
        umb_index_destroy(index);
        assert_true(atomic_load(&f.held) == held);
        umb_scene_destroy(scene);
        assert_true(atomic_load(&f.held) == 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_names),  cmocka_unit_test(test_all_sets), cmocka_unit_test(test_frusta),
        cmocka_unit_test(test_motion), cmocka_unit_test(test_captures),
        cmocka_unit_test(test_failing_allocations),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

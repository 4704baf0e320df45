/* The index: every item exactly once, boxes that contain, the same tree for any number of workers,
 * refits, degenerate sets, failing allocations, and frustum queries against brute force. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "frustum/box_kernels.h"
#include "index/bvh.h"
#include "support/index_check.h"
#include "support/index_sets.h"

/* ---- scenes ------------------------------------------------------------------------------------- */

enum { COUNT_LARGE = 60000 };
static umb_scene *make_scene(uint64_t seed, int set, uint32_t count)
{
    umb_scene *scene;
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    for (uint32_t i = 0; i < count; ++i) {
        umb_object_def def = {.bounds = index_set_box(&seed, (index_set)set, i)};
        uint32_t id;
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
        assert_int_equal(id, i);
    }
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    return scene;
}

static void add_occluders(umb_scene *scene, uint64_t *seed, uint32_t count)
{
    static const float positions[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    static const uint32_t indices[3] = {0, 1, 2};
    umb_shape_def shape_def = {
        .positions = positions, .position_count = 3, .indices = indices, .index_count = 3};
    umb_shape shape;
    assert_int_equal(umb_scene_add_shape(scene, &shape_def, &shape), UMB_OK);
    for (uint32_t i = 0; i < count; ++i) {
        umb_transform t = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
        for (int a = 0; a < 3; ++a) {
            t.m[a][3] = (float)random_in(seed, -100, 100);
        }
        umb_object_def def = {.shape = shape, .transform = t};
        uint32_t id;
        assert_int_equal(umb_scene_add_occluder(scene, shape, &t, &id), UMB_OK);
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
    }
}

/* As a capture would: the same nodes from their references alone. */
static void check_restored(umb_scene *scene, const umb_index_def *def, const umb_index *index)
{
    const umb_tree *t = umb_index_tree(index);
    uint32_t(*refs)[UMB_NODE_WIDTH] = calloc((size_t)t->node_count + 1, sizeof(*refs));
    umb_index *again;
    assert_non_null(refs);
    for (uint32_t k = 0; k < t->node_count; ++k) {
        memcpy(refs[k], t->nodes[k].ref, sizeof(refs[k]));
    }
    umb_stored_tree stored = {.refs = (const uint32_t(*)[UMB_NODE_WIDTH])refs, .node_count = t->node_count};
    assert_int_equal(umb_index_restore(scene, def, &stored, &again), UMB_OK);
    index_check(again);
    assert_memory_equal(umb_index_tree(again)->objects, t->objects, t->object_count * sizeof(t->objects[0]));
    umb_index_destroy(again);
    free(refs);
}

static const uint32_t counts[] = {0, 1, 2, 7, 8, 9, 10, 17, 64, 65, 1000, 9000};

static void test_all_sets(void **state)
{
    (void)state;
    for (int set = 0; set < INDEX_SETS; ++set) {
        for (size_t i = 0; i < sizeof(counts) / sizeof(counts[0]); ++i) {
            umb_scene *scene = make_scene(31, set, counts[i]);
            for (int kind = 0; kind < 2; ++kind) {
                umb_index_def def = {.kind = (umb_index_kind)kind};
                umb_index *index;
                assert_int_equal(umb_index_create(scene, &def, &index), UMB_OK);
                index_check(index);
                check_restored(scene, &def, index);
                assert_int_equal(umb_index_settings(index).kind, kind);
                umb_index_destroy(index);
            }
            umb_scene_destroy(scene);
        }
    }
}

static void test_flat_order(void **state)
{
    (void)state;
    umb_scene *scene = make_scene(32, INDEX_SPREAD, 20);
    assert_int_equal(umb_scene_remove_object(scene, 3), UMB_OK);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    umb_index_def def = {.kind = UMB_INDEX_FLAT};
    umb_index *index;
    assert_int_equal(umb_index_create(scene, &def, &index), UMB_OK);
    const umb_tree *t = umb_index_tree(index);
    assert_true(t->flat);
    assert_int_equal(t->node_count, 3);
    for (uint32_t k = 0; k < 19; ++k) {
        uint32_t id = k < 3 ? k : k + 1;
        assert_int_equal(t->nodes[k / 8].ref[k % 8], UMB_REF_OBJECT | id);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

/* ---- following the scene ------------------------------------------------------------------------ */

static void change(umb_scene *scene, uint64_t *seed, int what, uint32_t count)
{
    static const double origin[3] = {0, 0, 0};
    for (uint32_t i = 0; i < 50; ++i) {
        uint32_t id = random_below(seed, count);
        umb_aabb box = random_box(seed, origin, 100.0);
        umb_object_def def = {.bounds = box};
        uint32_t unused;
        switch (what) {
        case 0:
            umb_scene_move_object(scene, id, NULL, &box);
            break;
        case 1:
            umb_scene_remove_object(scene, id);
            break;
        case 2:
            umb_scene_add_object(scene, &def, &unused);
            break;
        default:
            umb_scene_flag_object(scene, id, random_below(seed, 2) != 0 ? UMB_OBJECT_IGNORED : 0);
            break;
        }
    }
}

static void test_commits(void **state)
{
    (void)state;
    uint64_t seed = 33;
    umb_scene *scene = make_scene(34, INDEX_SPREAD, 3000);
    umb_index *indices[2];
    for (int kind = 0; kind < 2; ++kind) {
        umb_index_def def = {.kind = (umb_index_kind)kind, .update = UMB_UPDATE_REFIT};
        assert_int_equal(umb_index_create(scene, &def, &indices[kind]), UMB_OK);
    }
    for (int round = 0; round < 200; ++round) {
        bool moves_only = round % 3 != 0;
        const umb_node *before = umb_index_tree(indices[0])->nodes;
        if (!moves_only) {
            change(scene, &seed, (int)random_below(&seed, 4), 3000);
        }
        change(scene, &seed, 0, 3000);
        if (round % 40 == 39) {
            add_occluders(scene, &seed, 10);
        }
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        if (moves_only && round % 40 != 39) {
            assert_ptr_equal(umb_index_tree(indices[0])->nodes, before);
            /* Following a few moves gives what a full refit gives. */
            uint32_t count = umb_index_tree(indices[0])->node_count;
            umb_node *copy = malloc(count * sizeof(copy[0]));
            assert_non_null(copy);
            memcpy(copy, before, count * sizeof(copy[0]));
            umb_bvh_refit(copy, count, umb_scene_committed(scene));
            assert_memory_equal(copy, before, count * sizeof(copy[0]));
            free(copy);
        }
        index_check(indices[0]);
        index_check(indices[1]);
    }
    assert_true(umb_scene_committed(scene)->first_free_occluder <
                umb_scene_committed(scene)->occluder_count);
    umb_index_destroy(indices[0]);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    umb_index_destroy(indices[1]);
    umb_index_destroy(NULL);
    umb_scene_destroy(scene);
}

/* Any number of moves, in a tree of many thousand nodes, gives what a full refit gives. */
static void test_moves_in_a_large_tree(void **state)
{
    (void)state;
    static const uint32_t moves[] = {1, 2, 30, 500, 9000, COUNT_LARGE};
    static const double origin[3] = {0, 0, 0};
    uint64_t seed = 36;
    umb_scene *scene = make_scene(37, INDEX_SPREAD, COUNT_LARGE);
    umb_index *index;
    umb_index_def def = {.update = UMB_UPDATE_REFIT};
    assert_int_equal(umb_index_create(scene, &def, &index), UMB_OK);
    const umb_tree *tree = umb_index_tree(index);
    assert_true(tree->node_count > 8192);
    umb_node *copy = malloc(tree->node_count * sizeof(copy[0]));
    assert_non_null(copy);
    memcpy(copy, tree->nodes, tree->node_count * sizeof(copy[0]));
    for (size_t i = 0; i < sizeof(moves) / sizeof(moves[0]); ++i) {
        for (uint32_t k = 0; k < moves[i]; ++k) {
            uint32_t id = moves[i] == COUNT_LARGE ? k : random_below(&seed, COUNT_LARGE);
            umb_aabb box = random_box(&seed, origin, 100.0);
            assert_int_equal(umb_scene_move_object(scene, id, NULL, &box), UMB_OK);
        }
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        umb_bvh_refit(copy, tree->node_count, umb_scene_committed(scene));
        assert_memory_equal(copy, tree->nodes, tree->node_count * sizeof(copy[0]));
    }
    index_check(index);
    free(copy);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

/* ---- building ----------------------------------------------------------------------------------- */

static umb_bvh_item *make_items(int set, uint32_t count)
{
    uint64_t seed = 35;
    umb_bvh_item *items = malloc(count * sizeof(items[0]));
    assert_non_null(items);
    for (uint32_t i = 0; i < count; ++i) {
        umb_aabb b = index_set_box(&seed, (index_set)set, i);
        memset(&items[i], 0, sizeof(items[i]));
        memcpy(items[i].min, b.min, sizeof(b.min));
        memcpy(items[i].max, b.max, sizeof(b.max));
        items[i].ref = UMB_REF_OBJECT | i;
    }
    return items;
}

static void test_same_for_any_workers(void **state)
{
    (void)state;
    static const uint32_t workers[] = {0, 1, 2, 3, 8};
    umb_allocator a = umb_memory_allocator(NULL);
    for (int set = 0; set < INDEX_SETS; ++set) {
        umb_node *first = NULL;
        uint32_t first_count = 0;
        for (int w = 0; w < 5; ++w) {
            umb_pool *pool = NULL;
            umb_tasks tasks = {0};
            if (workers[w] > 0) {
                assert_int_equal(umb_pool_create(workers[w], &pool), UMB_OK);
                tasks = umb_pool_tasks(pool);
            }
            uint32_t count = 40000;
            umb_bvh_item *items = make_items(set, count);
            umb_built built;
            assert_int_equal(umb_bvh_build(&a, &tasks, items, count, &built), UMB_OK);
            assert_int_equal(built.slot_count, count);
            if (first == NULL) {
                first = built.nodes;
                first_count = built.node_count;
            } else {
                assert_int_equal(built.node_count, first_count);
                assert_memory_equal(built.nodes, first, first_count * sizeof(first[0]));
                umb_built_free(&built, &a);
            }
            free(items);
            umb_pool_destroy(pool);
        }
        umb_memory_free(&a, first, first_count * sizeof(first[0]));
    }
}

/* The surface-area build must beat a median build by far on uneven sets; this pins the quality. */
static void test_quality(void **state)
{
    (void)state;
    umb_scene *scene = make_scene(36, INDEX_SPREAD, 20000);
    umb_index *index;
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    umb_index_stats stats;
    umb_index_get_stats(index, &stats);
    assert_true(stats.nodes < 20000 / 4);
    assert_true(stats.cost < 20000 / 10);
    assert_true(stats.bytes >= stats.nodes * sizeof(umb_node));
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

typedef struct meter {
    umb_allocator inner;
    int64_t left;  /* allocations until one fails; negative: never */
    int64_t bytes; /* held now */
} meter;

static void *metered(void *user, void *old, size_t old_size, size_t new_size)
{
    meter *m = user;
    if (new_size > 0 && m->left >= 0 && m->left-- == 0) {
        m->left = 0;
        return NULL;
    }
    void *p = m->inner.reallocate(m->inner.user, old, old_size, new_size);
    if (p != NULL || new_size == 0) {
        m->bytes += (int64_t)new_size - (int64_t)old_size;
    }
    return p;
}

static void test_failing_allocations(void **state)
{
    (void)state;
    uint64_t seed = 37;
    meter m = {umb_memory_allocator(NULL), -1, 0};
    umb_scene_def scene_def = {.allocator = {metered, &m}};
    umb_scene *scene;
    assert_int_equal(umb_scene_create(&scene_def, &scene), UMB_OK);
    for (uint32_t i = 0; i < 5000; ++i) {
        umb_object_def def = {.bounds = index_set_box(&seed, INDEX_SPREAD, i)};
        uint32_t id;
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    for (int kind = 0; kind < 2; ++kind) {
        umb_index_def def = {.kind = (umb_index_kind)kind};
        umb_index *index = NULL;
        umb_result result = UMB_ERROR_MEMORY;
        int64_t held = m.bytes;
        int64_t limit = 0;
        for (; result != UMB_OK; ++limit) {
            m.left = limit;
            result = umb_index_create(scene, &def, &index);
            assert_true(result == UMB_OK || (result == UMB_ERROR_MEMORY && index == NULL));
            assert_true(result == UMB_OK || m.bytes == held);
        }
        m.left = -1;
        assert_true(limit > 2);
        index_check(index);
        umb_index_destroy(index);
        assert_true(m.bytes == held);
    }
    umb_scene_destroy(scene);
    assert_true(m.bytes == 0);
}

/* A commit that finds no memory leaves the index behind, and says so; the next one catches up. */
static void test_failing_commit(void **state)
{
    (void)state;
    uint64_t seed = 41;
    meter m = {umb_memory_allocator(NULL), -1, 0};
    umb_scene_def scene_def = {.allocator = {metered, &m}};
    umb_scene *scene;
    umb_index *index;
    uint32_t behind = 0;
    assert_int_equal(umb_scene_create(&scene_def, &scene), UMB_OK);
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    index_check(index);
    for (int64_t limit = 0; limit < 60; ++limit) {
        for (uint32_t i = 0; i < 100; ++i) {
            umb_object_def def = {.bounds = index_set_box(&seed, INDEX_SPREAD, i)};
            uint32_t id;
            assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
        }
        m.left = limit;
        umb_result result = umb_scene_commit(scene);
        m.left = -1;
        bool stale = umb_index_tree(index)->version != umb_scene_committed(scene)->version;
        assert_true(result == UMB_OK || result == UMB_ERROR_MEMORY);
        assert_true(!stale || result == UMB_ERROR_MEMORY);
        behind += stale;
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        index_check(index);
    }
    assert_true(behind > 0);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    assert_true(m.bytes == 0);
}

static void test_bad_kind(void **state)
{
    (void)state;
    umb_scene *scene = make_scene(38, INDEX_SPREAD, 1);
    umb_index_def def = {.kind = (umb_index_kind)17};
    umb_index *index = (umb_index *)scene;
    assert_int_equal(umb_index_create(scene, &def, &index), UMB_ERROR_ARGUMENT);
    assert_null(index);
    assert_string_equal(umb_index_kind_name(UMB_INDEX_BVH), "bvh");
    assert_string_equal(umb_index_kind_name(UMB_INDEX_FLAT), "flat");
    umb_scene_destroy(scene);
}

/* ---- queries ------------------------------------------------------------------------------------ */

static void query(const umb_tree *t, const umb_frustum *f, uint32_t node, uint16_t planes,
                  uint8_t *remember, uint8_t *found)
{
    uint16_t left[8];
    const umb_node *n = &t->nodes[node];
    uint32_t outside = umb_frustum_test_node(f, umb_box_kernels_get(UMB_ISA_AUTO), n, planes,
                                             &remember[node], left);
    for (uint32_t s = 0; s < n->count; ++s) {
        uint32_t number = n->ref[s] & UMB_REF_NUMBER;
        if ((outside >> s & 1u) != 0) {
            continue;
        }
        if ((n->ref[s] & UMB_REF_KIND) == UMB_REF_NODE) {
            query(t, f, number, left[s], remember, found);
        } else {
            ++found[number];
        }
    }
}

static void test_queries(void **state)
{
    (void)state;
    uint64_t seed = 39;
    enum { COUNT = 5000 };
    umb_scene *scene = make_scene(40, INDEX_SPREAD, COUNT);
    umb_index *tree, *flat;
    umb_index_def def = {.kind = UMB_INDEX_FLAT};
    assert_int_equal(umb_index_create(scene, NULL, &tree), UMB_OK);
    assert_int_equal(umb_index_create(scene, &def, &flat), UMB_OK);
    static uint8_t remember[COUNT], remember_flat[COUNT];
    uint64_t total = 0;
    for (int i = 0; i < 300; ++i) {
        umb_view v = random_view(&seed, 100.0);
        umb_frustum f;
        umb_frustum_prepare(&f, &v);
        static uint8_t with[COUNT], without[COUNT];
        memset(with, 0, sizeof(with));
        memset(without, 0, sizeof(without));
        query(umb_index_tree(tree), &f, 0, f.all_planes, remember, with);
        for (uint32_t k = 0; k < umb_index_tree(flat)->node_count; ++k) {
            query(umb_index_tree(flat), &f, k, f.all_planes, remember_flat, without);
        }
        for (uint32_t k = 0; k < COUNT; ++k) {
            assert_true(without[k] <= 1 && with[k] == without[k]);
            total += with[k];
        }
    }
    assert_true(total > 300 * COUNT / 100);
    umb_index_destroy(tree);
    umb_index_destroy(flat);
    umb_scene_destroy(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_sets),       cmocka_unit_test(test_flat_order),
        cmocka_unit_test(test_commits),
        cmocka_unit_test(test_moves_in_a_large_tree),        cmocka_unit_test(test_same_for_any_workers),
        cmocka_unit_test(test_quality),        cmocka_unit_test(test_failing_allocations),
        cmocka_unit_test(test_failing_commit), cmocka_unit_test(test_bad_kind),
        cmocka_unit_test(test_queries),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

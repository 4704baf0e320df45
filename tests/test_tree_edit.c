/* Trees that are changed where they stand: after any edits by any strategy the nodes are one tree that holds every item
 * once, in boxes that are exact, with parents before children; and it stays as good as it should. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "index/rebuild_job.h"
#include "index/update.h"
#include "support/failing.h"
#include "support/random_boxes.h"

enum { MOST = 4000, LARGE = 90000 };

static const umb_index_update strategies[] = {UMB_UPDATE_REFIT, UMB_UPDATE_DELETE_INSERT, UMB_UPDATE_LCA,
                                              UMB_UPDATE_LAZY,  UMB_UPDATE_DEEPEST,       UMB_UPDATE_INCREMENTAL};
enum { STRATEGIES = sizeof strategies / sizeof strategies[0] };

static const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
static const uint32_t order[3] = {0, 1, 2};

/* A scene and a tree that follows it. */
typedef struct grove {
    umb_scene *scene;
    umb_allocator allocator;
    umb_tree_edit edit;
    umb_updater updater;
    umb_rebuild_job job;
    umb_shape shape;
    uint64_t seed, structure;
    uint32_t rebuilt; /* by the job */
} grove;

/* ---- checking ----------------------------------------------------------------------------------- */

typedef struct walked {
    uint32_t nodes, items, depth;
} walked;

static bool same_box(const umb_node *node, uint32_t slot, const umb_aabb *box)
{
    for (int i = 0; i < 3; ++i) {
        if (node->min[i][slot] != box->min[i] || node->max[i][slot] != box->max[i]) {
            return false;
        }
    }
    return true;
}

static walked check_node(const grove *g, const umb_committed *c, uint32_t number, uint32_t least)
{
    const umb_tree_edit *e = &g->edit;
    const umb_node *node = &e->tree.nodes[number];
    walked sum = {1, 0, 1};
    assert_in_range(node->count, least, UMB_NODE_WIDTH);
    assert_false(umb_number_set_has(&e->free, number));
    for (uint32_t slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
        uint32_t ref = node->ref[slot], of = ref & UMB_REF_NUMBER;
        if (slot >= node->count) {
            assert_int_equal(ref, UMB_NONE);
            assert_true(node->min[0][slot] == node->min[0][0]);
        } else if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
            assert_true(of > number && of < e->tree.node_count);
            assert_int_equal(e->tree.nodes[of].parent, number);
            assert_int_equal(e->tree.nodes[of].slot, slot);
            umb_aabb below = umb_node_bounds(&e->tree.nodes[of]);
            assert_true(same_box(node, slot, &below));
            walked w = check_node(g, c, of, 2);
            assert_true((e->tree.nodes[of].layers & ~node->layers) == 0);
            sum.nodes += w.nodes;
            sum.items += w.items;
            sum.depth = w.depth + 1 > sum.depth ? w.depth + 1 : sum.depth;
        } else {
            bool object = (ref & UMB_REF_KIND) == UMB_REF_OBJECT;
            assert_true(object ? c->objects[of].live : of >= c->first_free_occluder && of < c->occluder_count);
            assert_true(same_box(node, slot, object ? &c->objects[of].bounds : &c->occluders[of].bounds));
            assert_int_equal(umb_tree_edit_place(e, ref), number * UMB_NODE_WIDTH + slot);
            assert_true((umb_layers_of(object ? c->objects[of].mask : c->occluder_masks[of]) & ~node->layers) == 0);
            sum.items += 1;
        }
    }
    assert_int_equal(node->items, sum.items);
    return sum;
}

static walked check(const grove *g)
{
    const umb_committed *c = umb_scene_committed(g->scene);
    const umb_tree_edit *e = &g->edit;
    uint32_t items = c->occluder_count - c->first_free_occluder;
    walked w = {0, 0, 0};
    for (uint32_t i = 0; i < c->object_count; ++i) {
        items += c->objects[i].live;
        assert_true(c->objects[i].live == (i < e->tree.place_capacity && e->tree.places[i] != UMB_NONE));
    }
    for (uint32_t i = 0; i < e->tree.occluder_capacity; ++i) {
        bool there = i >= c->first_free_occluder && i < c->occluder_count;
        assert_true(there == (e->tree.occluder_places[i] != UMB_NONE));
    }
    if (e->tree.node_count > 0) {
        w = check_node(g, c, 0, 1);
    }
    assert_int_equal(w.items, items);
    assert_int_equal(e->tree.slot_count, items);
    assert_int_equal(w.nodes + e->free.count, e->tree.node_count);
    for (uint32_t k = umb_number_set_next(&e->free, 0); k != UMB_NONE; k = umb_number_set_next(&e->free, k + 1)) {
        assert_int_equal(e->tree.nodes[k].count, 0);
    }
    return w;
}

static double cost_of(const umb_node *nodes, uint32_t count)
{
    double cost = 0.0;
    for (uint32_t k = 0; k < count; ++k) {
        cost += (double)umb_tree_edit_area(&nodes[k]) * nodes[k].count;
    }
    return count > 0 ? cost / umb_tree_edit_area(&nodes[0]) : 0.0;
}

/* ---- following ---------------------------------------------------------------------------------- */

static void gather(const umb_committed *c, umb_bvh_item *items, uint32_t *count)
{
    *count = 0;
    for (uint32_t k = 0; k < c->object_count + c->occluder_count; ++k) {
        uint32_t n = k < c->object_count ? k : k - c->object_count;
        const umb_aabb *b = k < c->object_count ? &c->objects[n].bounds : &c->occluders[n].bounds;
        if (k < c->object_count ? !c->objects[n].live : n < c->first_free_occluder) {
            continue;
        }
        umb_bvh_item *item = &items[(*count)++];
        *item = (umb_bvh_item){{b->min[0], b->min[1], b->min[2], 0}, {b->max[0], b->max[1], b->max[2], 0}, 0};
        item->ref = (k < c->object_count ? UMB_REF_OBJECT : UMB_REF_OCCLUDER) | n;
    }
}

/* What a tree built anew costs; NULL: only that. */
static double build(grove *g, umb_tree_edit *e)
{
    const umb_committed *c = umb_scene_committed(g->scene);
    umb_bvh_item *items = malloc(((size_t)c->object_count + c->occluder_count + 1) * sizeof *items);
    uint32_t count;
    umb_built built = {0};
    assert_non_null(items);
    gather(c, items, &count);
    if (count > 0) {
        assert_int_equal(umb_bvh_build(&g->allocator, &(umb_tasks){0}, items, count, &built), UMB_OK);
    }
    double cost = cost_of(built.nodes, built.node_count);
    if (e != NULL) {
        umb_memory_free(&g->allocator, e->tree.nodes, e->tree.node_capacity * sizeof *e->tree.nodes);
        assert_true(umb_tree_edit_adopt(e, built.nodes, built.node_count, built.node_count, false, c));
        assert_true(umb_update_reserve(&g->updater, e));
    } else {
        umb_built_free(&built, &g->allocator);
    }
    free(items);
    return cost;
}

static void grove_set_up(grove *g, umb_index_update strategy, uint64_t seed, const umb_allocator *allocator)
{
    *g = (grove){.updater.strategy = strategy, .seed = seed};
    umb_shape_def shape = {.positions = corners, .position_count = 3, .indices = order, .index_count = 3};
    g->allocator = allocator != NULL ? *allocator : umb_memory_allocator(NULL);
    umb_scene_def def = {.allocator = g->allocator};
    assert_int_equal(umb_scene_create(&def, &g->scene), UMB_OK);
    assert_int_equal(umb_scene_add_shape(g->scene, &shape, &g->shape), UMB_OK);
    g->edit.allocator = &g->allocator;
}

static void start(grove *g)
{
    assert_int_equal(umb_scene_commit(g->scene), UMB_OK);
    build(g, &g->edit);
    umb_rebuild_job_drop(&g->job);
    g->structure = umb_scene_committed(g->scene)->structure;
}

static void grove_tear_down(grove *g)
{
    umb_rebuild_job_free(&g->job, &g->allocator);
    umb_update_free(&g->updater, &g->allocator);
    umb_tree_edit_free(&g->edit);
    umb_scene_destroy(g->scene);
}

static void follow(grove *g)
{
    assert_int_equal(umb_scene_commit(g->scene), UMB_OK);
    const umb_committed *c = umb_scene_committed(g->scene);
    bool structure = c->structure != g->structure;
    assert_true(umb_update_follow(&g->updater, &g->edit, c, structure));
    if (g->updater.strategy == UMB_UPDATE_INCREMENTAL) {
        g->rebuilt += umb_rebuild_job_step(&g->job, &g->edit, c, structure);
    }
    g->structure = c->structure;
}

/* ---- edits -------------------------------------------------------------------------------------- */

static umb_aabb some_box(grove *g)
{
    static const double origin[3] = {0, 0, 0};
    return random_below(&g->seed, 20) == 0 ? absurd_box(&g->seed) : random_box(&g->seed, origin, 20.0);
}

static void add(grove *g)
{
    uint32_t id;
    umb_object_def def = {.bounds = some_box(g)};
    assert_int_equal(umb_scene_add_object(g->scene, &def, &id), UMB_OK);
}

static void edit(grove *g)
{
    uint32_t id = random_below(&g->seed, umb_scene_object_count(g->scene) + 1), what = random_below(&g->seed, 14);
    umb_aabb box = some_box(g);
    umb_transform t = {{{1, 0, 0, box.min[0]}, {0, 1, 0, 1}, {0, 0, 1, 2}}};
    uint32_t unused;
    if (what < 5) {
        (void)umb_scene_move_object(g->scene, id, NULL, &box);
    } else if (what < 7 && umb_scene_object_count(g->scene) < MOST) {
        add(g);
    } else if (what < 9) {
        (void)umb_scene_remove_object(g->scene, id);
    } else if (what == 9) {
        (void)umb_scene_flag_object(g->scene, id, random_below(&g->seed, 2) != 0 ? UMB_OBJECT_IGNORED : 0);
    } else if (what > 11) {
        (void)umb_scene_mask_object(g->scene, id, random_below(&g->seed, 4));
    } else if (what == 10) {
        (void)umb_scene_add_occluder(g->scene, g->shape, &t, &unused);
    } else {
        (void)umb_scene_remove_occluder(g->scene, random_below(&g->seed, 50));
    }
}

/* As a culler would: some way down. */
static void open_some(grove *g)
{
    for (uint32_t k = 0; k < g->edit.tree.node_count && g->updater.opened != NULL; ++k) {
        if (random_below(&g->seed, 3) == 0) {
            g->updater.opened[k >> 6] |= (uint64_t)1 << (k & 63);
        }
    }
}

static void test_random_edits(void **state)
{
    (void)state;
    for (int s = 0; s < STRATEGIES; ++s) {
        for (uint64_t set = 0; set < 4; ++set) {
            grove g;
            grove_set_up(&g, strategies[s], 11 + set, NULL);
            uint32_t first = set == 0 ? 0 : set == 1 ? 9 : 600;
            for (uint32_t i = 0; i < first; ++i) {
                add(&g);
            }
            start(&g);
            check(&g);
            for (int round = 0; round < 700; ++round) {
                for (uint32_t k = random_below(&g.seed, set == 3 ? 200 : 8); k > 0; --k) {
                    edit(&g);
                }
                open_some(&g);
                follow(&g);
                walked w = check(&g);
                assert_true(w.depth < 80);
            }
            grove_tear_down(&g);
        }
    }
}

/* What is listed below nodes is what is there. */
static void check_lists(const grove *g)
{
    const umb_tree_edit *e = &g->edit;
    const uint32_t *objects = g->job.ready.objects;
    for (uint32_t k = 0; k < e->tree.node_count; ++k) {
        uint32_t at = e->tree.below[k].first;
        for (uint32_t slot = 0; slot < e->tree.nodes[k].count && e->tree.below[k].count != UMB_RANGE_STALE; ++slot) {
            uint32_t ref = e->tree.nodes[k].ref[slot];
            if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
                assert_true(e->tree.below[ref].first == at);
                at += e->tree.below[ref].count;
            } else if ((ref & UMB_REF_KIND) == UMB_REF_OBJECT) {
                assert_true(objects[at++] == (ref & UMB_REF_NUMBER));
            }
        }
        assert_true(e->tree.below[k].count == UMB_RANGE_STALE || at == e->tree.below[k].first + e->tree.below[k].count);
    }
}

/* A tree so large that each stage of making it anew takes several commits, in each of which things move, come and go. */
static void test_made_beside(void **state)
{
    (void)state;
    grove g;
    uint32_t between[UMB_JOB_READY + 1] = {0};
    grove_set_up(&g, UMB_UPDATE_INCREMENTAL, 71, NULL);
    for (uint32_t i = 0; i < LARGE; ++i) {
        add(&g);
    }
    for (uint32_t i = 0; i < 3000; ++i) {
        umb_transform t = {{{1, 0, 0, (float)i}, {0, 1, 0, 1}, {0, 0, 1, 2}}};
        uint32_t unused;
        assert_int_equal(umb_scene_add_occluder(g.scene, g.shape, &t, &unused), UMB_OK);
    }
    start(&g);
    for (uint32_t round = 0; round < 600 && g.rebuilt < 1; ++round) {
        uint32_t before = g.rebuilt;
        for (uint32_t i = 0; i < 1000; ++i) {
            umb_aabb box = some_box(&g);
            (void)umb_scene_move_object(g.scene, random_below(&g.seed, LARGE), NULL, &box);
        }
        for (uint32_t i = 0; i < round % 20; ++i) {
            edit(&g);
        }
        follow(&g);
        between[g.job.stage] += 1;
        if (g.rebuilt > before) {
            check_lists(&g);
        }
        check(&g);
    }
    assert_true(g.rebuilt == 1);
    for (int stage = UMB_JOB_GATHER; stage <= UMB_JOB_FIT; ++stage) {
        printf("# %u commits ended in stage %d\n", between[stage], stage);
        assert_true(between[stage] > 0);
    }
    grove_tear_down(&g);
}

/* Everything goes, and comes again. */
static void test_to_nothing(void **state)
{
    (void)state;
    for (int s = 0; s < STRATEGIES; ++s) {
        grove g;
        grove_set_up(&g, strategies[s], 5, NULL);
        start(&g);
        for (int round = 0; round < 3; ++round) {
            for (uint32_t i = 0; i < 300; ++i) {
                add(&g);
                if (i % 7 == 0) {
                    follow(&g);
                    check(&g);
                }
            }
            for (uint32_t i = 0; i < 300; ++i) {
                (void)umb_scene_remove_object(g.scene, (i * 7919u) % 300);
                if (i % 11 == 0) {
                    follow(&g);
                    check(&g);
                }
            }
            follow(&g);
            check(&g);
            assert_int_equal(g.edit.tree.slot_count, 0);
        }
        grove_tear_down(&g);
    }
}

/* ---- quality ------------------------------------------------------------------------------------ */

static umb_aabb unit_box(const double at[3])
{
    umb_aabb b;
    for (int i = 0; i < 3; ++i) {
        b.min[i] = (float)at[i];
        b.max[i] = (float)(at[i] + 1.0);
    }
    return b;
}

/* Boxes that come in the order of a line, the worst for a tree that only grows downwards: it stays shallow. And a set
 * that is exchanged, box for box, costs little more than a tree built anew. */
static void test_insertion(void **state)
{
    (void)state;
    for (int set = 0; set < 2; ++set) {
        grove g;
        grove_set_up(&g, UMB_UPDATE_REFIT, 21, NULL);
        start(&g);
        uint32_t id;
        double cost = 0.0, least = 0.0;
        for (uint32_t i = 0; i < MOST; ++i) {
            double at[3] = {set == 0 ? 2.0 * i : random_in(&g.seed, 0, 60), 0, 0};
            at[1] = set == 0 ? 0 : random_in(&g.seed, 0, 60);
            at[2] = set == 0 ? 0 : random_in(&g.seed, 0, 60);
            umb_object_def def = {.bounds = unit_box(at)};
            assert_int_equal(umb_scene_add_object(g.scene, &def, &id), UMB_OK);
            if (i % 3 == 0) {
                follow(&g);
            }
        }
        follow(&g);
        walked w = check(&g);
        cost = cost_of(g.edit.tree.nodes, g.edit.tree.node_count);
        least = build(&g, NULL);
        printf("# inserted %s: depth %u, nodes %u, cost %.2f of a new tree's\n", set == 0 ? "in a line" : "anywhere",
               w.depth, w.nodes, cost / least);
        assert_true(w.depth < 24 && cost < 1.5 * least);
        for (uint32_t i = 0; i < 2 * MOST; ++i) {
            double at[3] = {random_in(&g.seed, 0, 60), random_in(&g.seed, 0, 60), random_in(&g.seed, 0, 60)};
            umb_object_def def = {.bounds = unit_box(at)};
            (void)umb_scene_remove_object(g.scene, random_below(&g.seed, MOST));
            assert_int_equal(umb_scene_add_object(g.scene, &def, &id), UMB_OK);
            if (i % 5 == 0) {
                follow(&g);
            }
        }
        follow(&g);
        w = check(&g);
        cost = cost_of(g.edit.tree.nodes, g.edit.tree.node_count);
        least = build(&g, NULL);
        printf("# exchanged: depth %u, nodes %u, cost %.2f of a new tree's\n", w.depth, w.nodes, cost / least);
        assert_true(w.depth < 24 && cost < 1.5 * least);
        grove_tear_down(&g);
    }
}

/* One of so many flies about. Returns what the tree costs then, over a new one. */
static double fly(umb_index_update strategy, uint32_t every, int frames, uint32_t *rebuilt)
{
    static double at[MOST][3], by[MOST][3];
    grove g;
    grove_set_up(&g, strategy, 31, NULL);
    for (uint32_t i = 0; i < MOST; ++i) {
        uint32_t id;
        for (int k = 0; k < 3; ++k) {
            at[i][k] = random_in(&g.seed, 0, 60);
            by[i][k] = random_in(&g.seed, -0.3, 0.3);
        }
        umb_object_def def = {.bounds = unit_box(at[i])};
        assert_int_equal(umb_scene_add_object(g.scene, &def, &id), UMB_OK);
    }
    start(&g);
    for (int frame = 0; frame < frames; ++frame) {
        for (uint32_t i = 0; i < MOST; i += every) {
            for (int k = 0; k < 3; ++k) {
                at[i][k] += by[i][k];
                by[i][k] = at[i][k] < 0 || at[i][k] > 60 ? -by[i][k] : by[i][k];
            }
            umb_aabb box = unit_box(at[i]);
            assert_int_equal(umb_scene_move_object(g.scene, i, NULL, &box), UMB_OK);
        }
        open_some(&g);
        follow(&g);
    }
    walked w = check(&g);
    double cost = cost_of(g.edit.tree.nodes, g.edit.tree.node_count), least = build(&g, NULL);
    printf("# strategy %d, one of %u moves: depth %u, nodes %u, cost %.2f of a new tree's, rebuilt %u times\n", (int)strategy,
           every, w.depth, w.nodes, cost / least, g.rebuilt);
    *rebuilt = g.rebuilt;
    grove_tear_down(&g);
    return cost / least;
}

static void test_motion(void **state)
{
    (void)state;
    uint32_t rebuilt;
    for (int s = 0; s < STRATEGIES; ++s) {
        double cost = fly(strategies[s], 1, 200, &rebuilt);
        assert_true(strategies[s] == UMB_UPDATE_REFIT || cost < 3.0);
    }
}

/* Few that move are put elsewhere as they go, and no tree is made anew for them. */
static void test_few_move(void **state)
{
    (void)state;
    uint32_t rebuilt;
    double refitted = fly(UMB_UPDATE_REFIT, 50, 600, &rebuilt), cost = fly(UMB_UPDATE_INCREMENTAL, 50, 600, &rebuilt);
    assert_true(cost < 1.1 && refitted > 1.5 && rebuilt == 0);
}

/* ---- memory ------------------------------------------------------------------------------------- */

/* Whatever allocation fails, the tree is either whole or known not to be, and can be built anew. */
static void test_failing_allocations(void **state)
{
    (void)state;
    for (int s = 0; s < STRATEGIES; ++s) {
        failing memory;
        umb_allocator a = failing_allocator(&memory, 1LL << 60);
        grove g;
        uint32_t failures = 0;
        grove_set_up(&g, strategies[s], 41, &a);
        start(&g);
        for (int round = 0; round < 150; ++round) {
            for (uint32_t k = 0; k < 40; ++k) {
                add(&g);
                edit(&g);
            }
            assert_int_equal(umb_scene_commit(g.scene), UMB_OK);
            const umb_committed *c = umb_scene_committed(g.scene);
            atomic_store(&memory.left, round % 5);
            bool whole = umb_update_follow(&g.updater, &g.edit, c, c->structure != g.structure);
            if (whole && strategies[s] == UMB_UPDATE_INCREMENTAL) {
                umb_rebuild_job_step(&g.job, &g.edit, c, c->structure != g.structure);
                whole = !g.edit.failed;
            }
            atomic_store(&memory.left, 1LL << 60);
            g.structure = c->structure;
            if (!whole) {
                failures += 1;
                umb_rebuild_job_drop(&g.job);
                build(&g, &g.edit);
            }
            check(&g);
        }
        assert_true(failures > 0);
        grove_tear_down(&g);
        assert_true(atomic_load(&memory.held) == 0);
    }
}

/* A number of things in steady change: nothing is allocated after a while. */
static void test_steady_memory(void **state)
{
    (void)state;
    for (int s = 0; s < STRATEGIES; ++s) {
        failing memory;
        umb_allocator a = failing_allocator(&memory, 1LL << 60);
        grove g;
        long long left = 0;
        grove_set_up(&g, strategies[s], 51, &a);
        for (uint32_t i = 0; i < 500; ++i) {
            add(&g);
        }
        start(&g);
        for (int round = 0; round < 4000; ++round) {
            uint32_t id = random_below(&g.seed, 500);
            for (uint32_t i = 0; i < 20; ++i) {
                umb_aabb box = some_box(&g);
                (void)umb_scene_move_object(g.scene, random_below(&g.seed, 500), NULL, &box);
            }
            if (umb_scene_remove_object(g.scene, id) != UMB_OK) {
                add(&g);
            }
            open_some(&g);
            follow(&g);
            left = round == 2000 ? atomic_load(&memory.left) : left;
        }
        printf("# strategy %d: nodes %u, numbers %u, %lld allocations in 2,000 commits, rebuilt %u times\n",
               (int)strategies[s], g.edit.tree.node_count - g.edit.free.count, g.edit.tree.node_count,
               left - atomic_load(&memory.left), g.rebuilt);
        assert_true(left - atomic_load(&memory.left) == 0);
        grove_tear_down(&g);
        assert_true(atomic_load(&memory.held) == 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_random_edits),  cmocka_unit_test(test_made_beside), cmocka_unit_test(test_to_nothing),
        cmocka_unit_test(test_insertion),     cmocka_unit_test(test_motion),
        cmocka_unit_test(test_few_move),
        cmocka_unit_test(test_failing_allocations), cmocka_unit_test(test_steady_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

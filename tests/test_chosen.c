/* The walk for methods that choose their occluders first, with a method that hides what lies beyond a plane: the
 * objects left are those of each box tested alone, tokens come back to the boxes they were given for, depth first,
 * and nothing below a hidden or a clear box is asked about. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "cull/chosen.h"
#include "cull/found.h"
#include "support/random_boxes.h"

enum { MOST = 2000, TOKENS = 4096 };

/* Token t stands for the box it was given for. */
typedef struct half_space {
    const umb_tree *tree;
    float clear_to, hidden_from; /* along x */
    uint32_t top;                /* tokens below it are in use */
    umb_aabb boxes[TOKENS];
    uint32_t asked;
    bool hides_objects;
} half_space;

static umb_aabb box_of(const umb_node *n, uint32_t slot)
{
    umb_aabb b;
    for (int i = 0; i < 3; ++i) {
        b.min[i] = n->min[i][slot];
        b.max[i] = n->max[i][slot];
    }
    return b;
}

static void ask(void *state, umb_query *q)
{
    half_space *h = state;
    assert_true(q->token < h->top && q->mask != 0);
    h->top = q->token + 1;
    q->hidden = 0;
    for (uint32_t left = q->mask; left != 0; left &= left - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(left);
        umb_aabb box = box_of(q->boxes, slot);
        for (int i = 0; i < 3; ++i) { /* it lies in the box that the token was given for */
            assert_true(box.min[i] >= h->boxes[q->token].min[i] && box.max[i] <= h->boxes[q->token].max[i]);
        }
        h->asked += 1;
        if (box.min[0] > h->hidden_from) {
            q->hidden |= 1u << slot;
        } else if (box.max[0] <= h->clear_to) {
            q->tokens[slot] = UMB_TOKEN_CLEAR;
        } else {
            assert_true(h->top < TOKENS);
            q->tokens[slot] = h->top;
            h->boxes[h->top++] = box;
        }
    }
}

static bool hides_object(void *state, uint32_t object, uint32_t token)
{
    half_space *h = state;
    assert_true(token < TOKENS && token != UMB_TOKEN_ALL);
    return h->hides_objects && object % 3 == 0;
}

static const umb_method_ops ops = {.name = "half-space", .ask = ask, .hides_object = hides_object};

static umb_scene *make_scene(uint64_t *seed, uint32_t count)
{
    static const double origin[3] = {0, 0, 0};
    umb_scene *scene;
    assert_int_equal(umb_scene_create(&(umb_scene_def){.error = NULL}, &scene), UMB_OK);
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t id;
        umb_object_def def = {.bounds = random_box(seed, origin, 50.0)};
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    return scene;
}

/* 1 for each object that the walk must leave. */
static uint32_t expect(const umb_scene *scene, const umb_view *v, const half_space *h, uint8_t out[MOST])
{
    umb_frustum f;
    umb_frustum_prepare(&f, v);
    uint32_t count = 0;
    for (uint32_t i = 0; i < umb_scene_object_count(scene); ++i) {
        umb_aabb box;
        assert_true(umb_scene_object_bounds(scene, i, &box));
        uint16_t left[8];
        umb_node node = node_of(&box, 1);
        bool outside = (umb_frustum_test_node(&f, umb_box_kernels_get(UMB_ISA_SCALAR), &node, f.all_planes, NULL,
                                              left) & 1u) != 0;
        bool crossing = box.max[0] > h->clear_to;
        bool hidden = box.min[0] > h->hidden_from || (crossing && h->hides_objects && i % 3 == 0);
        out[i] = !outside && !hidden;
        count += out[i];
    }
    return count;
}

static void check_walk(const umb_scene *scene, const umb_tree *tree, const umb_view *v, half_space *h)
{
    static uint8_t wanted[MOST], remember[MOST];
    static uint64_t entries[MOST];
    umb_frustum frustum;
    umb_cull_stats stats = {0};
    umb_frustum_prepare(&frustum, v);
    umb_choice choice = {
        .view = v, .frustum = &frustum, .scene = umb_scene_committed(scene), .tree = tree, .stats = &stats};
    umb_allocator allocator = umb_memory_allocator(NULL);
    umb_chosen_room room = {0};
    assert_true(umb_chosen_reserve(&room, &allocator, tree));
    umb_chosen walk = {.choice = &choice, .ops = &ops, .method = h, .kernels = umb_box_kernels_get(UMB_ISA_AUTO),
                       .room = &room, .remember = remember, .entries = entries};
    h->tree = tree;
    h->top = 1;
    h->asked = 0;
    h->boxes[0] = tree->bounds;
    memset(remember, 0, sizeof remember);
    umb_chosen_find(&walk);
    uint32_t count = expect(scene, v, h, wanted);
    assert_int_equal(walk.count, count);
    for (uint32_t i = 0; i < walk.count; ++i) {
        uint32_t id = umb_found_id(entries[i]);
        assert_int_equal(wanted[id], 1);
        wanted[id] = 0;
    }
    assert_int_equal(stats.queries, h->asked);
    umb_chosen_free(&room, &allocator);
}

static void test_walk(void **state)
{
    (void)state;
    uint64_t seed = 11;
    half_space *h = calloc(1, sizeof *h);
    uint32_t asked = 0, whole = 0;
    for (int round = 0; round < 8; ++round) {
        uint32_t count = round == 0 ? 0 : round < 3 ? 5 : MOST;
        umb_scene *scene = make_scene(&seed, count);
        umb_index *index;
        umb_index_def def = {.kind = round % 3 == 1 ? UMB_INDEX_FLAT : UMB_INDEX_BVH};
        assert_int_equal(umb_index_create(scene, &def, &index), UMB_OK);
        for (int i = 0; i < 30; ++i) {
            umb_view v = random_view(&seed, 100.0);
            h->clear_to = (float)random_in(&seed, -100.0, 50.0);
            h->hidden_from = h->clear_to + (i % 3 == 0 ? 0.0f : (float)random_in(&seed, 0.0, 40.0));
            h->hides_objects = i % 2 == 0;
            check_walk(scene, umb_index_tree(index), &v, h);
            asked += h->asked;
            whole += count;
        }
        umb_index_destroy(index);
        umb_scene_destroy(scene);
    }
    assert_true(asked < whole / 2);
    free(h);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_walk)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

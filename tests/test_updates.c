/* Every kind of index with every way to follow its scene, all over one scene that is edited at random: after each commit
 * the frustum's answer is that of each box tested alone, and misses nothing that meets the frustum in long double; with
 * occlusion nothing is hidden that the oracle sees.
 *
 * test_updates [PART PARTS]: takes every PARTS-th pair of an index and a way from PART on, so that parts run side by side.
 * In the full size each edit has a commit of its own, but for one in fifty of up to sixty, and the oracle is asked after each.
 * UMBRAGE_EDITS sets how many commits or edits (full 10,000 commits, normal 10,000 edits, small 1,200). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "frustum/box_kernels.h"
#include "support/box_meets.h"
#include "support/failing.h"
#include "support/random_boxes.h"
#include "support/strict.h"
#include "umbrage/cull.h"

enum { MOST = 240, LEAST = 60, MOST_INDICES = 400, REACH = 40 };

static uint32_t part, parts = 1;

/* A number set in the environment, or one for each size. */
static uint32_t number_wanted(const char *variable, uint32_t small, uint32_t normal, uint32_t full)
{
    const char *text = getenv(variable);
    return text != NULL ? (uint32_t)strtoul(text, NULL, 10) : for_size(small, normal, full);
}

/* One index, and two cullers over it. */
typedef struct follower {
    char name[64];
    umb_index *index;
    umb_culler *plain, *raster;
} follower;

/* A mirror of the scene: what should be in it. */
typedef struct thing {
    umb_transform at;
    uint32_t mesh; /* MODEL_NONE: bounds alone */
    uint32_t flags, mask;
    bool used;
} thing;

typedef struct world {
    umb_scene *scene;
    umb_shape shapes[3];
    thing things[MOST];
    follower all[MOST_INDICES];
    uint32_t count, used, occluders;
    uint64_t seed;
    bool layered;
} world;

static const uint32_t BOX[36] = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                                 2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};
static const float SIZES[3][3] = {{1, 1, 1}, {14, 9, 0.5f}, {0.5f, 10, 14}};
static float corners[3][24];

static void make_shapes(world *w)
{
    for (int s = 0; s < 3; ++s) {
        for (int k = 0; k < 24; ++k) {
            corners[s][k] = (k / 3 >> (2 - k % 3) & 1) != 0 ? SIZES[s][k % 3] : -SIZES[s][k % 3];
        }
        umb_shape_def def = {.positions = corners[s], .position_count = 8, .indices = BOX, .index_count = 36};
        assert_int_equal(umb_scene_add_shape(w->scene, &def, &w->shapes[s]), UMB_OK);
    }
}

static void add_follower(world *w, const char *kind, umb_index_update update, const char *how)
{
    follower *f = &w->all[w->count++];
    umb_index_def def = {0};
    umb_culler_def none = {.method = UMB_METHOD_NONE, .unordered = w->count % 2 == 0};
    umb_culler_def raster = {.coherence = w->count % 3 == 0 ? UMB_COHERENCE_ALL : 0};
    assert_true(w->count < MOST_INDICES && umb_index_parse(kind, &def));
    def.update = update;
    (void)snprintf(f->name, sizeof f->name, "%s, %s", kind, how);
    assert_int_equal(umb_index_create(w->scene, &def, &f->index), UMB_OK);
    assert_int_equal(umb_culler_create(f->index, &none, &f->plain), UMB_OK);
    assert_int_equal(umb_culler_create(f->index, &raster, &f->raster), UMB_OK);
}

/* steady: only those that allocate nothing once things have begun to move. */
static void world_set_up(world *w, uint64_t seed, bool steady, const umb_allocator *allocator)
{
    uint32_t pairs = 0;
    memset(w, 0, sizeof *w);
    w->seed = seed;
    umb_scene_def def = {.allocator = *allocator};
    assert_int_equal(umb_scene_create(&def, &w->scene), UMB_OK);
    make_shapes(w);
    for (uint32_t k = 0; umb_index_variant(k) != NULL; ++k) {
        for (uint32_t u = 0; umb_index_update_name((umb_index_update)u) != NULL; ++u) {
            umb_index_def index = {0};
            assert_true(umb_index_parse(umb_index_variant(k), &index));
            index.update = (umb_index_update)u;
            bool refits = index.update == UMB_UPDATE_DEFAULT || index.update == UMB_UPDATE_REFIT;
            if (umb_index_can_update(&index) && (refits || !steady) && pairs++ % parts == part) {
                add_follower(w, umb_index_variant(k), index.update, umb_index_update_name(index.update));
            }
        }
    }
}

static void world_tear_down(world *w)
{
    for (uint32_t i = 0; i < w->count; ++i) {
        umb_culler_destroy(w->all[i].plain);
        umb_culler_destroy(w->all[i].raster);
        umb_index_destroy(w->all[i].index);
    }
    umb_scene_destroy(w->scene);
}

/* ---- edits -------------------------------------------------------------------------------------- */

static umb_transform some_place(world *w)
{
    float size = (float)random_in(&w->seed, 0.5, 2.0);
    umb_transform t = {{{size, 0, 0, 0}, {0, size, 0, 0}, {0, 0, size, 0}}};
    for (int i = 0; i < 3; ++i) {
        t.m[i][3] = (float)random_in(&w->seed, -REACH, REACH);
    }
    return t;
}

static umb_aabb some_box(world *w)
{
    static const double origin[3] = {0, 0, 0};
    return random_below(&w->seed, 30) == 0 ? absurd_box(&w->seed) : random_box(&w->seed, origin, REACH / 2.0);
}

/* Layers of three; things are in none for a while, then some are in all. */
static uint32_t some_mask(world *w)
{
    return w->layered ? random_below(&w->seed, 8) : 0;
}

static void add(world *w)
{
    static const uint32_t all_flags[4] = {0, UMB_OBJECT_IS_SHAPE, UMB_OBJECT_NEVER_HIDES, 0};
    uint32_t mesh = random_below(&w->seed, 5), id;
    thing t = {some_place(w), mesh < 3 ? mesh : MODEL_NONE, all_flags[random_below(&w->seed, 4)], some_mask(w), true};
    umb_object_def def = {.transform = t.at, .flags = t.flags, .mask = t.mask};
    if (t.mesh == MODEL_NONE) {
        def.bounds = some_box(w);
        def.flags = t.flags = 0;
    } else {
        def.shape = w->shapes[t.mesh];
    }
    assert_int_equal(umb_scene_add_object(w->scene, &def, &id), UMB_OK);
    assert_true(id < MOST && !w->things[id].used);
    w->things[id] = t;
    w->used += 1;
}

/* To anywhere, a step away, or to another size. */
static void move(world *w, uint32_t id)
{
    thing *t = &w->things[id];
    umb_aabb box = some_box(w);
    uint32_t how = random_below(&w->seed, 3);
    umb_transform to = some_place(w);
    if (how == 1) {
        to = t->at;
        to.m[random_below(&w->seed, 3)][3] += (float)random_in(&w->seed, -1, 1);
    } else if (how == 2) {
        for (int i = 0; i < 3; ++i) {
            to.m[i][3] = t->at.m[i][3];
        }
    }
    t->at = to;
    assert_int_equal(umb_scene_move_object(w->scene, id, &to, t->mesh == MODEL_NONE ? &box : NULL), UMB_OK);
}

/* Another shape, or none, where it is. */
static void reshape(world *w, uint32_t id)
{
    thing *t = &w->things[id];
    uint32_t mesh = random_below(&w->seed, 4);
    umb_aabb box = some_box(w);
    t->mesh = mesh < 3 ? mesh : MODEL_NONE;
    umb_shape shape = mesh < 3 ? w->shapes[mesh] : 0;
    assert_int_equal(umb_scene_shape_object(w->scene, id, shape, mesh < 3 ? NULL : &box), UMB_OK);
}

static void edit(world *w)
{
    uint32_t id = random_below(&w->seed, MOST), what = random_below(&w->seed, 24), number;
    thing *t = &w->things[id];
    if (w->used < LEAST || (what < 3 && w->used < MOST - 20)) {
        add(w);
    } else if (what < 5 && t->used) {
        assert_int_equal(umb_scene_remove_object(w->scene, id), UMB_OK);
        t->used = false;
        w->used -= 1;
    } else if (what < 8 && t->used) {
        t->flags ^= what == 5 ? UMB_OBJECT_NEVER_HIDES : UMB_OBJECT_IGNORED;
        assert_int_equal(umb_scene_flag_object(w->scene, id, t->flags), UMB_OK);
    } else if (what < 18 && t->used) {
        move(w, id);
    } else if (what >= 20 && what < 22 && t->used) {
        reshape(w, id);
    } else if (what >= 22 && t->used) {
        t->mask = some_mask(w);
        assert_int_equal(umb_scene_mask_object(w->scene, id, t->mask), UMB_OK);
    } else if (what == 18) { /* hand-made occluders are nothing that the oracle sees: inside of what is there, or not at all */
        (void)umb_scene_remove_occluder(w->scene, random_below(&w->seed, 30));
    } else if (what == 19 && w->occluders < 4000) {
        umb_transform speck = some_place(w);
        for (int i = 0; i < 3; ++i) {
            speck.m[i][i] = 1e-6f;
        }
        assert_int_equal(umb_scene_add_occluder(w->scene, w->shapes[0], &speck, &number), UMB_OK);
    }
}

/* ---- frusta ------------------------------------------------------------------------------------- */

/* For each id: 0 not found, 1 crossing, 2 inside; every box in a node of its own. Checks against long double. */
static void by_box(const umb_scene *scene, const umb_view *v, uint8_t found[MOST])
{
    const umb_committed *c = umb_scene_committed(scene);
    umb_frustum f;
    umb_frustum_prepare(&f, v);
    memset(found, 0, MOST);
    for (uint32_t i = 0; i < c->object_count; ++i) {
        if (!c->objects[i].live) {
            continue;
        }
        bool sound;
        found[i] = place_of_box(v, &f, &c->objects[i].bounds, &sound);
        assert_true(sound);
    }
}

static void check_frustum(const follower *f, const umb_view *v, const uint8_t found[MOST])
{
    static uint8_t met[MOST];
    umb_visible_set seen;
    memset(met, 0, sizeof met);
    assert_int_equal(umb_cull(f->plain, v, &seen), UMB_OK);
    for (uint32_t i = 0; i < seen.count; ++i) {
        uint32_t id = seen.objects[i];
        assert_true(id < MOST && met[id] == 0 && found[id] != 0);
        assert_int_equal(seen.inside[i], found[id] == 2);
        met[id] = 1;
    }
    /* An object in parts may be left out though its whole box is rejected by no plane: none of its parts is inside. */
    const umb_tree *tree = umb_index_tree(f->index);
    const umb_committed *c = umb_scene_committed(umb_index_scene(f->index));
    for (uint32_t i = 0; i < c->object_count; ++i) {
        if (found[i] != 0 && met[i] == 0 && (!tree->several || box_surely_meets(v, &c->objects[i].bounds, 1e-4L * REACH))) {
            fail_msg("%s: object %u is in the frustum, and was not found", f->name, i);
        }
    }
}

/* ---- occlusion ---------------------------------------------------------------------------------- */

/* Leave out what is in none of a view's layers. */
static bool takes(const umb_view *v, uint32_t mask)
{
    uint32_t common = mask & v->mask;
    return v->mask == 0 || mask == 0 || (v->mask_all ? common == v->mask : common != 0);
}

/* The same things for the oracle. What has bounds alone hides nothing and is nothing that it sees. */
static model *model_of(const world *w, const umb_view *v)
{
    model *m = model_create();
    uint8_t flags[12] = {0};
    umb_error error = {0};
    assert_non_null(m);
    for (int s = 0; s < 3; ++s) {
        uint32_t indices[36];
        float positions[24];
        memcpy(indices, BOX, sizeof indices);
        memcpy(positions, corners[s], sizeof positions);
        model_mesh mesh = {positions, indices, flags, 8, 12};
        assert_int_equal(model_add_mesh(m, &mesh), s);
    }
    for (uint32_t i = 0; i < MOST; ++i) {
        const thing *t = &w->things[i];
        bool there = t->used && (t->flags & UMB_OBJECT_IGNORED) == 0 && takes(v, t->mask);
        assert_int_equal(model_add_object(m, "thing", there ? t->mesh : MODEL_NONE, &t->at), i);
    }
    assert_true(model_finish(m, NULL, &error));
    assert_true(m->origin[0] == 0.0 && m->origin[1] == 0.0 && m->origin[2] == 0.0);
    return m;
}

static umb_view look(world *w)
{
    double eye[3], target[3], up[3] = {0.1, 0.2, 1};
    umb_view v;
    for (int i = 0; i < 3; ++i) {
        eye[i] = random_in(&w->seed, -REACH, REACH);
        target[i] = random_in(&w->seed, -REACH / 2.0, REACH / 2.0);
    }
    assert_int_equal(umb_view_look_at(&v, eye, target, up, 1.2, 2.0, 0.1, 4.0 * REACH), UMB_OK);
    v.width = 96;
    v.height = 48;
    v.buffer_width = 256;
    v.buffer_height = 96;
    return v;
}

/* Returns how many objects the first index hides. */
static uint32_t check_occlusion(world *w, uint32_t rays, uint32_t mask)
{
    static strict_answer answers[MOST_INDICES];
    static strict_count sums[MOST_INDICES];
    static uint32_t ids[MOST_INDICES][MOST];
    umb_view v = look(w);
    umb_visible_set seen;
    umb_error error = {0};
    v.mask = mask;
    model *m = model_of(w, &v);
    truth *t = truth_create(m, &error);
    assert_non_null(t);
    memset(sums, 0, sizeof sums);
    uint32_t hidden = 0;
    for (uint32_t i = 0; i < w->count; ++i) {
        assert_int_equal(umb_cull(w->all[i].raster, &v, &seen), UMB_OK);
        memcpy(ids[i], seen.objects, seen.count * sizeof ids[i][0]);
        answers[i] = (strict_answer){ids[i], seen.count, w->all[i].name, &sums[i]};
        hidden += i == 0 ? seen.stats.hidden_objects + seen.stats.hidden_nodes : 0;
    }
    assert_true(strict_check_all(t, m, &v, answers, w->count, &(truth_options){.guided_rays = rays, .threads = 1}));
    for (uint32_t i = 0; i < w->count; ++i) {
        if (sums[i].wrongly_hidden > 0) {
            fail_msg("%s: %llu objects wrongly hidden", w->all[i].name, (unsigned long long)sums[i].wrongly_hidden);
        }
    }
    truth_destroy(t);
    model_free(m);
    return hidden;
}

/* ---- memory ------------------------------------------------------------------------------------- */

/* One frame of a scene in steady motion: most things take a step, one in a while leaves and another comes. */
static void live_on(world *w, uint32_t frame, bool exchange)
{
    for (uint32_t id = 0; id < MOST; ++id) {
        thing *t = &w->things[id];
        if (t->used && t->mesh != MODEL_NONE && (id + frame) % 4 != 0) {
            for (int i = 0; i < 3; ++i) {
                float to = t->at.m[i][3] + (float)random_in(&w->seed, -1.0, 1.0);
                t->at.m[i][3] = to < -REACH || to > REACH ? 0.0f : to;
            }
            assert_int_equal(umb_scene_move_object(w->scene, id, &t->at, NULL), UMB_OK);
        }
    }
    if (exchange && frame % 5 == 0) {
        uint32_t id = random_below(&w->seed, MOST - 20);
        if (w->things[id].used) {
            assert_int_equal(umb_scene_remove_object(w->scene, id), UMB_OK);
            w->things[id].used = false;
            w->used -= 1;
        } else {
            add(w);
        }
    }
    assert_int_equal(umb_scene_commit(w->scene), UMB_OK);
}

/* What all answer in the middle of motion. */
static void check_all(world *w, uint32_t rays)
{
    static uint8_t found[MOST];
    umb_view v = random_view(&w->seed, REACH);
    by_box(w->scene, &v, found);
    for (uint32_t i = 0; i < w->count; ++i) {
        check_frustum(&w->all[i], &v, found);
    }
    (void)check_occlusion(w, rays, 0);
}

/* Thousands of frames. Where things only move and boxes are refitted, or trees built anew beside, nothing is allocated after
 * the first ones. Where things come and go, by all ways, room is made for the largest tree that was ever needed. */
static void test_steady_memory(void **state)
{
    (void)state;
    static world w;
    for (int exchange = 0; exchange < 2; ++exchange) {
        failing memory;
        umb_allocator allocator = failing_allocator(&memory, 1LL << 60);
        /* 216,000 are an hour of sixty a second. */
        uint32_t frames = number_wanted("UMBRAGE_MOTION_FRAMES", 900, 4000, 216000);
        long long left = 0, held = 0;
        world_set_up(&w, 73, exchange == 0, &allocator);
        while (w.used < MOST - 40) {
            add(&w);
        }
        for (uint32_t frame = 0; frame < frames; ++frame) {
            live_on(&w, frame, exchange != 0);
            umb_view v = look(&w);
            umb_visible_set seen;
            for (uint32_t i = frame % 3; i < w.count; i += 3) {
                assert_int_equal(umb_cull(frame % 2 == 0 ? w.all[i].plain : w.all[i].raster, &v, &seen), UMB_OK);
            }
            if (frame == frames / 3) {
                left = atomic_load(&memory.left);
                held = atomic_load(&memory.held);
            }
            if (frame % 300 == 299) {
                check_all(&w, frame % 3000 == 2999 ? 20000 : 200);
            }
        }
        printf("# %u frames, %s: %lld allocations in the last two thirds, %lld bytes held, %lld at the end\n", frames,
               exchange != 0 ? "things come and go" : "things move", left - atomic_load(&memory.left), held,
               (long long)atomic_load(&memory.held));
        assert_true(exchange != 0 || left == atomic_load(&memory.left));
        /* A thousand frames make nearly all the room that there will ever be. */
        long long more = exchange == 0 ? 0 : frames >= 4000 ? held / 20 : held / 2;
        assert_true(atomic_load(&memory.held) <= held + more);
        world_tear_down(&w);
        assert_true(atomic_load(&memory.held) == 0);
    }
}

/* ---- all together ------------------------------------------------------------------------------- */

static void test_edits(void **state)
{
    (void)state;
    static world w;
    static uint8_t found[MOST];
    failing memory;
    umb_allocator allocator = failing_allocator(&memory, 1LL << 60);
    uint32_t wanted = number_wanted("UMBRAGE_EDITS", 1200, 10000, 10000), edits = 0, commits = 0, oracles = 0;
    bool full = for_size(0, 0, 1) != 0;
    uint64_t inside = 0, hidden = 0;
    world_set_up(&w, 71, false, &allocator);
    for (; (full ? commits : edits) < wanted; ++commits) {
        uint32_t most = commits % (full ? 50 : 16) == 0 ? 60 : full ? 1 : 3;
        for (uint32_t k = 1 + random_below(&w.seed, most); k > 0; --k, ++edits) {
            edit(&w);
        }
        assert_int_equal(umb_scene_commit(w.scene), UMB_OK);
        w.layered = commits > 100;
        umb_view v = random_view(&w.seed, REACH);
        v.mask = commits % 2 != 0 ? random_below(&w.seed, 8) : 0;
        v.mask_all = commits % 4 == 3;
        by_box(w.scene, &v, found);
        for (uint32_t i = 0; i < MOST; ++i) {
            found[i] = takes(&v, w.things[i].mask) ? found[i] : 0;
        }
        for (uint32_t i = 0; i < w.count; ++i) {
            check_frustum(&w.all[i], &v, found);
        }
        for (uint32_t i = 0; i < MOST; ++i) {
            inside += found[i] != 0;
        }
        if (full || commits % 100 == 50) {
            hidden += check_occlusion(&w, full ? 4000 : 20000, oracles % 2 != 0 ? random_below(&w.seed, 8) : 0);
            oracles += 1;
        }
    }
    printf("# %u pairs of an index and a way to follow, %u edits in %u commits, %.1f objects in a frustum, %u views by the oracle, %.1f hidden\n",
           w.count, edits, commits, (double)inside / commits, oracles, (double)hidden / oracles);
    assert_true(inside > 5 * commits && hidden > 2 * oracles);
    world_tear_down(&w);
    assert_true(atomic_load(&memory.held) == 0);
}

int main(int argc, char **argv)
{
    if (argc > 2) {
        part = (uint32_t)atoi(argv[1]);
        parts = atoi(argv[2]) > 0 ? (uint32_t)atoi(argv[2]) : 1;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_edits), cmocka_unit_test(test_steady_memory)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

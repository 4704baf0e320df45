/* What is remembered of earlier frames never hides anything: every switch, alone and together, with budgets, over
 * views that creep and jump, over things that move, come and go, against the oracle. And the rest of the contract:
 * the same answers from every instruction set and every time, budgets kept, no memory taken in steady frames.
 * UMBRAGE_TEST_SIZE: small, full. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/failing.h"
#include "support/micro_scenes.h"
#include "support/strict.h"

#define PI 3.14159265358979323846
#define UNLIMITED (1LL << 60)

typedef struct config {
    const char *name;
    uint32_t coherence, budget;
} config;

static const config CONFIG[] = {
    {"list", UMB_COHERENCE_LIST, 0},
    {"hierarchy", UMB_COHERENCE_HIERARCHY, 0},
    {"propagation", UMB_COHERENCE_PROPAGATION, 0},
    {"conservative", UMB_COHERENCE_CONSERVATIVE, 0},
    {"rest", UMB_COHERENCE_REST, 0},
    {"all", UMB_COHERENCE_ALL, 0},
    {"list, propagation", UMB_COHERENCE_LIST | UMB_COHERENCE_PROPAGATION, 0},
    {"hierarchy, rest", UMB_COHERENCE_HIERARCHY | UMB_COHERENCE_REST, 0},
    {"budget 3", 0, 3},
    {"all, budget 2", UMB_COHERENCE_ALL, 2},
};

enum { CONFIGS = sizeof CONFIG / sizeof CONFIG[0] };

static uint64_t sized(uint64_t small, uint64_t normal, uint64_t full)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size == NULL ? normal : size[0] == 's' ? small : size[0] == 'f' ? full : normal;
}

static umb_culler *culler_of(const umb_index *index, const config *c, umb_isa isa)
{
    umb_culler *culler = NULL;
    umb_culler_def def = {.isa = isa, .coherence = c->coherence, .occluder_budget = c->budget};
    assert_int_equal(umb_culler_create(index, &def, &culler), UMB_OK);
    return culler;
}

/* Look the other way. */
static void turn_round(umb_view *v)
{
    for (int i = 0; i < 3; ++i) {
        v->forward[i] = -v->forward[i];
        v->right[i] = -v->right[i];
    }
}

static void creep(umb_view *v, dice *d, double step)
{
    for (int i = 0; i < 3; ++i) {
        v->eye[i] += step * ((double)dice_roll(d, 2001) - 1000.0) / 1000.0;
    }
}

/* Ask all cullers, and the oracle once about what they leave out. */
static void check(truth *oracle, const model *m, const umb_view *view, umb_culler **cullers, const char *what,
                  strict_count *sums)
{
    strict_answer answers[CONFIGS];
    char labels[CONFIGS][96];
    for (int c = 0; c < CONFIGS; ++c) {
        umb_visible_set seen;
        assert_int_equal(umb_cull(cullers[c], view, &seen), UMB_OK);
        (void)snprintf(labels[c], sizeof labels[c], "%s, %s", what, CONFIG[c].name);
        answers[c] = (strict_answer){seen.objects, seen.count, labels[c], &sums[c]};
        assert_true(CONFIG[c].budget == 0 || seen.stats.occluders <= CONFIG[c].budget);
    }
    truth_options options = {.grid_width = 64, .grid_height = 64, .guided_rays = 60000, .threads = 1};
    assert_true(strict_check_all(oracle, m, view, answers, CONFIGS, &options));
}

static void judge(const strict_count *sums)
{
    for (int c = 0; c < CONFIGS; ++c) {
        printf("# %s: views %llu objects %llu reported %llu seen %llu wrongly hidden %llu\n", CONFIG[c].name,
               (unsigned long long)sums[c].views, (unsigned long long)sums[c].objects,
               (unsigned long long)sums[c].reported, (unsigned long long)sums[c].truth_visible,
               (unsigned long long)sums[c].wrongly_hidden);
        assert_int_equal(sums[c].wrongly_hidden, 0);
        assert_true(sums[c].reported < sums[c].objects);
    }
}

/* ---- nothing is hidden ------------------------------------------------------------------------------ */

static void check_micro_scene(uint64_t number, strict_count *sums)
{
    micro_scene micro;
    dice d = {number};
    umb_error error = {0};
    assert_true(micro_scene_make(number, &micro));
    umb_scene *scene = model_scene(micro.model, micro.weld, (umb_tasks){0}, NULL, &error);
    truth *oracle = truth_create(micro.model, &error);
    umb_index *index = NULL;
    assert_non_null(scene);
    assert_non_null(oracle);
    umb_index_def index_def = {.kind = number % 7 == 0 ? UMB_INDEX_FLAT : UMB_INDEX_BVH};
    assert_int_equal(umb_index_create(scene, &index_def, &index), UMB_OK);
    umb_culler *cullers[CONFIGS];
    for (int c = 0; c < CONFIGS; ++c) {
        cullers[c] = culler_of(index, &CONFIG[c], UMB_ISA_AUTO);
    }
    double size = 0.0;
    for (int i = 0; i < 3; ++i) {
        size += (double)micro.model->bounds.max[i] - micro.model->bounds.min[i];
    }
    micro.view.buffer_width = 256;
    micro.view.buffer_height = 144;
    /* Creeping, asked about or not, with a look back that is long enough for memories to fade or mislead. */
    for (uint32_t frame = 0; frame < 10; ++frame) {
        umb_view view = micro.view;
        creep(&view, &d, (frame % 4 == 3 ? 0.02 : 0.0005) * size);
        if (frame >= 5 && frame < 7) {
            turn_round(&view);
        }
        if (frame == 1 || frame == 4 || frame == 7 || frame == 9) {
            char what[64];
            (void)snprintf(what, sizeof what, "micro scene %llu (%s) frame %u", (unsigned long long)number, micro.kind,
                           frame);
            check(oracle, micro.model, &view, cullers, what, sums);
        } else {
            umb_visible_set seen;
            for (int c = 0; c < CONFIGS; ++c) {
                assert_int_equal(umb_cull(cullers[c], &view, &seen), UMB_OK);
            }
        }
    }
    for (int c = 0; c < CONFIGS; ++c) {
        umb_culler_destroy(cullers[c]);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    truth_destroy(oracle);
    micro_scene_free(&micro);
}

static void test_micro_scenes(void **state)
{
    (void)state;
    strict_count sums[CONFIGS] = {{0}};
    uint64_t count = sized(20, 80, 2000);
    for (uint64_t i = 0; i < count; ++i) {
        check_micro_scene(i, sums);
    }
    judge(sums);
}

/* ---- a town in which things move, come and go ------------------------------------------------------- */

typedef struct town {
    model *model;
    umb_scene *scene;
    umb_index *index;
    umb_shape *shapes;
    camera_path path;
    dice dice;
} town;

static void add_object(town *t, uint32_t object)
{
    uint32_t id = UMB_NONE;
    umb_object_def def = {.shape = t->shapes[t->model->objects[object].mesh],
                          .transform = t->model->objects[object].transform,
                          .flags = UMB_OBJECT_IS_SHAPE};
    assert_int_equal(umb_scene_add_object(t->scene, &def, &id), UMB_OK);
    assert_int_equal(id, object);
}

static void town_set_up(town *t, const char *spec, const umb_allocator *allocator)
{
    umb_error error = {0};
    memset(t, 0, sizeof *t);
    t->model = model_load(spec, NULL, &error);
    assert_non_null(t->model);
    assert_true(camera_path_load(spec, &t->path, &error));
    umb_scene_def def = {0};
    if (allocator != NULL) {
        def.allocator = *allocator;
    }
    assert_int_equal(umb_scene_create(&def, &t->scene), UMB_OK);
    t->shapes = calloc((size_t)t->model->mesh_count + 1, sizeof *t->shapes);
    assert_non_null(t->shapes);
    for (uint32_t i = 0; i < t->model->mesh_count; ++i) {
        const model_mesh *mesh = &t->model->meshes[i];
        umb_shape_def shape = {.positions = mesh->positions,
                               .position_count = mesh->position_count,
                               .indices = mesh->indices,
                               .index_count = mesh->triangle_count * 3,
                               .triangle_flags = mesh->flags};
        assert_int_equal(umb_scene_add_shape(t->scene, &shape, &t->shapes[i]), UMB_OK);
    }
    for (uint32_t i = 0; i < t->model->object_count; ++i) {
        add_object(t, i);
    }
    assert_int_equal(umb_scene_commit(t->scene), UMB_OK);
    assert_int_equal(umb_index_create(t->scene, NULL, &t->index), UMB_OK);
}

static void town_tear_down(town *t)
{
    umb_index_destroy(t->index);
    umb_scene_destroy(t->scene);
    camera_path_free(&t->path);
    model_free(t->model);
    free(t->shapes);
}

/* Shift a model's object, which then is where the oracle looks for it. */
static void shift_model(town *t, uint32_t object, const float by[3])
{
    model_object *o = &t->model->objects[object];
    for (int i = 0; i < 3; ++i) {
        o->transform.m[i][3] += by[i];
    }
    for (uint32_t v = 0; v < t->model->meshes[o->mesh].position_count; ++v) {
        float p[3];
        model_world_vertex(t->model, o, v, p);
        for (int i = 0; i < 3; ++i) {
            o->bounds.min[i] = v == 0 || p[i] < o->bounds.min[i] ? p[i] : o->bounds.min[i];
            o->bounds.max[i] = v == 0 || p[i] > o->bounds.max[i] ? p[i] : o->bounds.max[i];
        }
    }
    for (int i = 0; i < 3; ++i) {
        umb_aabb *all = &t->model->bounds;
        all->min[i] = o->bounds.min[i] < all->min[i] ? o->bounds.min[i] : all->min[i];
        all->max[i] = o->bounds.max[i] > all->max[i] ? o->bounds.max[i] : all->max[i];
    }
}

static void move_some(town *t, uint32_t gone)
{
    for (uint32_t i = 0; i < t->model->object_count; i += 1 + dice_roll(&t->dice, 4)) {
        const float by[3] = {0.5f * (float)dice_roll(&t->dice, 9) - 2.0f, 0.0f,
                             0.5f * (float)dice_roll(&t->dice, 9) - 2.0f};
        if (i == gone) {
            continue;
        }
        shift_model(t, i, by);
        assert_int_equal(umb_scene_move_object(t->scene, i, &t->model->objects[i].transform, NULL), UMB_OK);
    }
}

static umb_view town_view(const town *t, uint32_t frame, double step)
{
    static const double up[3] = {0, 1, 0};
    const double *row = t->path.rows[frame / 40 * 7 % t->path.count];
    double way = step * (frame % 40), angle = 0.9 * (frame / 40) + 0.01 * (frame % 40);
    double eye[3] = {row[0] + way * sin(angle), row[1], row[2] + way * cos(angle)};
    double target[3] = {eye[0] + 10.0 * sin(angle), eye[1], eye[2] + 10.0 * cos(angle)};
    umb_view view;
    assert_int_equal(umb_view_look_at(&view, eye, target, up, PI / 3, 16.0 / 9.0, 0.1, 1000), UMB_OK);
    return view;
}

/* Whatever is taken out stands far away for the oracle. */
static void test_moving_town(void **state)
{
    (void)state;
    static const float away[3] = {50000, 0, 0}, back[3] = {-50000, 0, 0};
    strict_count sums[CONFIGS] = {{0}};
    town t;
    town_set_up(&t, "gen:blocks,g=4", NULL);
    umb_culler *cullers[CONFIGS];
    for (int c = 0; c < CONFIGS; ++c) {
        cullers[c] = culler_of(t.index, &CONFIG[c], UMB_ISA_AUTO);
    }
    uint32_t frames = (uint32_t)sized(60, 160, 2000), gone = UMB_NONE;
    for (uint32_t frame = 0; frame < frames; ++frame) {
        if (frame % 10 == 4) {
            move_some(&t, gone);
        }
        if (frame % 20 == 9) {
            gone = dice_roll(&t.dice, t.model->object_count);
            assert_int_equal(umb_scene_remove_object(t.scene, gone), UMB_OK);
            shift_model(&t, gone, away);
        } else if (frame % 20 == 16) {
            shift_model(&t, gone, back);
            add_object(&t, gone);
            gone = UMB_NONE;
        }
        assert_int_equal(umb_scene_commit(t.scene), UMB_OK);
        umb_view view = town_view(&t, frame, 0.3);
        if (frame % 5 != 0) {
            umb_visible_set seen;
            for (int c = 0; c < CONFIGS; ++c) {
                assert_int_equal(umb_cull(cullers[c], &view, &seen), UMB_OK);
            }
            continue;
        }
        umb_error error = {0};
        truth *oracle = truth_create(t.model, &error);
        assert_non_null(oracle);
        check(oracle, t.model, &view, cullers, "moving town", sums);
        truth_destroy(oracle);
    }
    judge(sums);
    for (int c = 0; c < CONFIGS; ++c) {
        umb_culler_destroy(cullers[c]);
    }
    town_tear_down(&t);
}

/* ---- the contract ----------------------------------------------------------------------------------- */

static bool same(const umb_visible_set *a, const umb_visible_set *b)
{
    return a->count == b->count && memcmp(a->objects, b->objects, a->count * sizeof a->objects[0]) == 0 &&
           memcmp(&a->stats, &b->stats, sizeof a->stats) == 0;
}

static void test_all_sets_agree(void **state)
{
    (void)state;
    static const umb_isa SETS[] = {UMB_ISA_SCALAR, UMB_ISA_SSE4, UMB_ISA_AVX2, UMB_ISA_NEON};
    town t;
    town_set_up(&t, "gen:city,triangles=20k", NULL);
    for (int c = 0; c < CONFIGS; ++c) {
        umb_culler *cullers[4];
        uint32_t count = 0;
        for (uint32_t i = 0; i < 4; ++i) {
            umb_culler_def def = {.isa = SETS[i],
                                  .coherence = CONFIG[c].coherence,
                                  .occluder_budget = CONFIG[c].budget};
            count += umb_culler_create(t.index, &def, &cullers[count]) == UMB_OK;
        }
        for (uint32_t frame = 0; frame < 120; ++frame) {
            umb_view view = town_view(&t, frame, 0.1);
            umb_visible_set first, other;
            assert_int_equal(umb_cull(cullers[0], &view, &first), UMB_OK);
            for (uint32_t i = 1; i < count; ++i) {
                assert_int_equal(umb_cull(cullers[i], &view, &other), UMB_OK);
                assert_true(same(&first, &other));
            }
        }
        for (uint32_t i = 0; i < count; ++i) {
            umb_culler_destroy(cullers[i]);
        }
    }
    town_tear_down(&t);
}

/* Without switches nothing of the past shows, and propagation saves tests without changing an answer for the worse. */
static void test_defaults_forget(void **state)
{
    (void)state;
    static const config none = {"none", 0, 0};
    town t;
    town_set_up(&t, "gen:city,triangles=20k", NULL);
    umb_culler *old = culler_of(t.index, &none, UMB_ISA_AUTO);
    for (uint32_t frame = 0; frame < 120; frame += 7) {
        umb_culler *fresh = culler_of(t.index, &none, UMB_ISA_AUTO);
        umb_view view = town_view(&t, frame, 0.1);
        umb_visible_set a, b;
        assert_int_equal(umb_cull(old, &view, &a), UMB_OK);
        assert_int_equal(umb_cull(fresh, &view, &b), UMB_OK);
        assert_true(same(&a, &b));
        assert_int_equal(a.stats.early + a.stats.saved + a.stats.resting + a.stats.over_budget, 0);
        umb_culler_destroy(fresh);
    }
    umb_culler_destroy(old);
    town_tear_down(&t);
}

/* Each switch does what it says, in the counts. */
static void test_switches_act(void **state)
{
    (void)state;
    town t;
    town_set_up(&t, "gen:city,triangles=20k", NULL);
    for (int c = 0; c < CONFIGS; ++c) {
        umb_culler *culler = culler_of(t.index, &CONFIG[c], UMB_ISA_AUTO);
        umb_cull_stats sum = {0};
        for (uint32_t frame = 0; frame < 120; ++frame) {
            umb_view view = town_view(&t, frame, 0.02);
            umb_visible_set seen;
            assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
            assert_true(seen.stats.early <= seen.stats.occluders);
            sum.early += seen.stats.early;
            sum.saved += seen.stats.saved;
            sum.over_budget += seen.stats.over_budget;
        }
        uint32_t on = CONFIG[c].coherence;
        uint32_t saves = UMB_COHERENCE_HIERARCHY | UMB_COHERENCE_PROPAGATION | UMB_COHERENCE_CONSERVATIVE;
        assert_int_equal(sum.early > 0, (on & UMB_COHERENCE_LIST) != 0);
        assert_int_equal(sum.saved > 0, (on & saves) != 0);
        assert_int_equal(sum.over_budget > 0, CONFIG[c].budget != 0);
        umb_culler_destroy(culler);
    }
    town_tear_down(&t);
}

static void test_steady_frames(void **state)
{
    (void)state;
    failing memory;
    umb_allocator allocator = failing_allocator(&memory, UNLIMITED);
    town t;
    town_set_up(&t, "gen:blocks,g=8", &allocator);
    for (int c = 0; c < CONFIGS; ++c) {
        umb_culler *culler = culler_of(t.index, &CONFIG[c], UMB_ISA_AUTO);
        for (uint32_t frame = 0; frame < 200; ++frame) {
            umb_view view = town_view(&t, frame, 0.1);
            umb_visible_set seen;
            assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
            atomic_store(&memory.left, 0); /* from the second frame on there is none to be had */
        }
        atomic_store(&memory.left, UNLIMITED);
        umb_culler_destroy(culler);
    }
    town_tear_down(&t);
    assert_int_equal(atomic_load(&memory.held), 0);
}

/* Every allocation of a first frame fails in turn; a frame that could not be answered leaves nothing wrong. */
static void test_failing_memory(void **state)
{
    (void)state;
    failing memory;
    umb_allocator allocator = failing_allocator(&memory, UNLIMITED);
    town t;
    town_set_up(&t, "gen:blocks,g=2", &allocator);
    umb_view view = town_view(&t, 3, 0.1);
    umb_visible_set seen, again;
    umb_culler *sound = culler_of(t.index, &CONFIG[5], UMB_ISA_AUTO);
    for (long long limit = 0;; ++limit) {
        umb_culler *culler = culler_of(t.index, &CONFIG[5], UMB_ISA_AUTO);
        atomic_store(&memory.left, limit);
        umb_result result = umb_cull(culler, &view, &seen);
        atomic_store(&memory.left, UNLIMITED);
        assert_true(result == UMB_OK || (result == UMB_ERROR_MEMORY && seen.count == 0));
        if (result != UMB_OK) {
            assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
        }
        if (limit == 0) {
            assert_int_equal(umb_cull(sound, &view, &again), UMB_OK);
        }
        assert_true(same(&seen, &again));
        umb_culler_destroy(culler);
        if (result == UMB_OK) {
            assert_true(limit > 10);
            break;
        }
    }
    umb_culler_destroy(sound);
    town_tear_down(&t);
    assert_int_equal(atomic_load(&memory.held), 0);
}

static void test_unknown_switches(void **state)
{
    (void)state;
    town t;
    town_set_up(&t, "gen:blocks,g=2", NULL);
    umb_error error = {0};
    umb_culler *culler = NULL;
    umb_culler_def def = {.coherence = UMB_COHERENCE_ALL + 1, .error = &error};
    assert_int_equal(umb_culler_create(t.index, &def, &culler), UMB_ERROR_ARGUMENT);
    assert_null(culler);
    assert_non_null(strstr(error.text, "coherence"));
    town_tear_down(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_micro_scenes),    cmocka_unit_test(test_moving_town),
        cmocka_unit_test(test_all_sets_agree),  cmocka_unit_test(test_defaults_forget),
        cmocka_unit_test(test_switches_act),    cmocka_unit_test(test_steady_frames),
        cmocka_unit_test(test_failing_memory),  cmocka_unit_test(test_unknown_switches),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* What an engine expects of scenes: doors that open and close, an origin that moves with the viewer, several scenes at
 * once. */
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/failing.h"
#include "support/moving_town.h"
#include "support/strict.h"

static bool is_small(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && strcmp(size, "small") == 0;
}

static bool sees(const umb_visible_set *seen, uint32_t object)
{
    for (uint32_t i = 0; i < seen->count; ++i) {
        if (seen->objects[i] == object) {
            return true;
        }
    }
    return false;
}

/* ---- doors ---------------------------------------------------------------------------------- */

typedef struct room {
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
    uint32_t door, behind, curtain;
} room;

static void room_set_up(room *r, const umb_allocator *allocator)
{
    static const float p[8][3] = {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {1, 1, -1},
                                  {-1, -1, 1},  {1, -1, 1},  {-1, 1, 1},  {1, 1, 1}};
    static const uint32_t t[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                   2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    umb_scene_def def = {.allocator = *allocator};
    umb_shape_def shape = {.positions = p[0], .position_count = 8, .indices = t, .index_count = 36};
    umb_shape box;
    memset(r, 0, sizeof *r);
    assert_int_equal(umb_scene_create(&def, &r->scene), UMB_OK);
    assert_int_equal(umb_scene_add_shape(r->scene, &shape, &box), UMB_OK);
    umb_object_def door = {.shape = box, .transform = {{{6, 0, 0, 0}, {0, 4, 0, 0}, {0, 0, 0.1f, -10}}}};
    umb_object_def behind = {.shape = box, .transform = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, -20}}}};
    assert_int_equal(umb_scene_add_object(r->scene, &door, &r->door), UMB_OK);
    assert_int_equal(umb_scene_add_object(r->scene, &behind, &r->behind), UMB_OK);
    assert_int_equal(umb_scene_add_occluder(r->scene, box, &door.transform, &r->curtain), UMB_OK);
    assert_int_equal(umb_scene_commit(r->scene), UMB_OK);
    assert_int_equal(umb_index_create(r->scene, NULL, &r->index), UMB_OK);
    assert_int_equal(umb_culler_create(r->index, NULL, &r->culler), UMB_OK);
}

static umb_visible_set room_see(room *r)
{
    static const double eye[3] = {0, 0, 0}, target[3] = {0, 0, -1}, up[3] = {0, 1, 0};
    umb_view view;
    umb_visible_set seen;
    assert_int_equal(umb_view_look_at(&view, eye, target, up, 1.0, 2, 0.1, 100), UMB_OK);
    assert_int_equal(umb_scene_commit(r->scene), UMB_OK);
    assert_int_equal(umb_cull(r->culler, &view, &seen), UMB_OK);
    return seen;
}

/* A door that lets see through while it is open, one that is taken away, and a curtain that belongs to nothing: any of them
 * that is shut hides what is behind. Thousands of times, without any growth. */
static void test_doors(void **state)
{
    (void)state;
    failing memory;
    umb_allocator allocator = failing_allocator(&memory, 1LL << 60);
    room r;
    room_set_up(&r, &allocator);
    dice d = {7};
    long long held = 0;
    assert_int_equal(umb_scene_open_occluder(r.scene, 5, true), UMB_ERROR_ARGUMENT);
    for (uint32_t i = 0; i < (is_small() ? 500u : 5000u); ++i) {
        uint32_t open = dice_roll(&d, 2), door = dice_roll(&d, 3);
        static const uint32_t flags[3] = {0, UMB_OBJECT_NEVER_HIDES, UMB_OBJECT_IGNORED};
        assert_int_equal(umb_scene_open_occluder(r.scene, r.curtain, open != 0), UMB_OK);
        assert_int_equal(umb_scene_flag_object(r.scene, r.door, flags[door]), UMB_OK);
        umb_visible_set seen = room_see(&r);
        assert_int_equal(sees(&seen, r.behind), open != 0 && door != 0);
        assert_true(door != 2 || !sees(&seen, r.door));
        umb_scene_stats stats;
        umb_scene_get_stats(r.scene, &stats);
        assert_int_equal(stats.objects, 2);
        assert_int_equal(stats.ignored, door == 2);
        assert_int_equal(stats.stand_alone, open == 0);
        assert_int_equal(stats.occluders, 1 + (door == 0) + (open == 0));
        assert_true(stats.shapes == 1 && stats.triangles == 12 && stats.bytes == umb_scene_memory(r.scene));
        if (i == 100) {
            held = atomic_load(&memory.held);
        }
        assert_true(i < 100 || atomic_load(&memory.held) <= held);
    }
    umb_culler_destroy(r.culler);
    umb_index_destroy(r.index);
    umb_scene_destroy(r.scene);
    assert_true(atomic_load(&memory.held) == 0);
}

/* ---- large worlds --------------------------------------------------------------------------- */

/* The town ten thousand kilometres from the origin, its objects placed in doubles; half of them move by themselves. */
typedef struct far_town {
    moving_town town;
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
    double place[3];  /* of the town's own origin in the world */
    double origin[3]; /* of the scene */
} far_town;

static void position_of(const far_town *f, uint32_t object, double time, umb_transform *linear, double position[3])
{
    umb_pose pose;
    memset(&pose, 0, sizeof pose);
    (void)moving_town_pose((void *)&f->town, object, f->town.moves[object] ? time : 0.0, &pose);
    *linear = pose.transform;
    for (int i = 0; i < 3; ++i) {
        position[i] = pose.transform.m[i][3] + f->place[i] - f->origin[i];
    }
}

static umb_transform transform_of(const far_town *f, uint32_t object, double time)
{
    umb_transform t;
    double position[3];
    position_of(f, object, time, &t, position);
    for (int i = 0; i < 3; ++i) {
        t.m[i][3] = (float)position[i];
    }
    return t;
}

static bool far_pose(void *user, uint32_t object, double time, umb_pose *out)
{
    out->transform = transform_of(user, object, time);
    return true;
}

static void far_set_up(far_town *f, bool moving)
{
    memset(f, 0, sizeof *f);
    moving_town_make(&f->town, "gen:blocks,g=6");
    for (uint32_t i = 0; i < f->town.model->object_count && !moving; ++i) {
        f->town.moves[i] = false;
    }
    f->place[0] = 1e7 + 0.375;
    f->place[1] = -3.25;
    f->place[2] = -4e6;
    f->scene = moving_town_scene(&f->town, NULL, false);
    for (uint32_t i = 0; i < f->town.model->object_count; ++i) {
        umb_transform linear;
        double position[3];
        position_of(f, i, 0.0, &linear, position);
        assert_int_equal(umb_scene_place_object(f->scene, i, &linear, position, NULL), UMB_OK);
    }
    umb_pose_source source = {far_pose, f};
    assert_int_equal(umb_scene_set_poses(f->scene, &source), UMB_OK);
    for (uint32_t i = 0; i < f->town.model->object_count; ++i) {
        /* Far away, poses are rounded to whole units: the promise has to allow for that at first. */
        umb_motion_def def = {.max_speed = 100.0};
        if (f->town.moves[i]) {
            assert_int_equal(umb_scene_set_motion(f->scene, i, &def), UMB_OK);
        }
    }
    assert_int_equal(umb_scene_commit(f->scene), UMB_OK);
    assert_int_equal(umb_index_create(f->scene, NULL, &f->index), UMB_OK);
    assert_int_equal(umb_culler_create(f->index, NULL, &f->culler), UMB_OK);
}

static void far_tear_down(far_town *f)
{
    umb_culler_destroy(f->culler);
    umb_index_destroy(f->index);
    umb_scene_destroy(f->scene);
    moving_town_free(&f->town);
}

static void far_shift(far_town *f, const double shift[3])
{
    double origin[3];
    assert_int_equal(umb_scene_shift_origin(f->scene, shift), UMB_OK);
    umb_scene_get_origin(f->scene, origin);
    for (int i = 0; i < 3; ++i) {
        f->origin[i] += shift[i];
        assert_true(origin[i] == f->origin[i]);
    }
}

/* The scene is what its objects' doubles say, rounded once, and the answer hides nothing of it. */
static void far_check(far_town *f, double time, uint32_t frame, strict_count *sum)
{
    umb_error error = {0};
    umb_visible_set seen;
    assert_int_equal(umb_scene_set_time(f->scene, time), UMB_OK);
    assert_int_equal(umb_scene_commit(f->scene), UMB_OK);
    for (uint32_t i = 0; i < f->town.model->object_count; ++i) {
        model_object *o = &f->town.posed->objects[i];
        umb_aabb bounds;
        o->transform = transform_of(f, i, time);
        for (uint32_t v = 0; v < f->town.posed->meshes[o->mesh].position_count; ++v) {
            float p[3];
            model_world_vertex(f->town.posed, o, v, p);
            for (int k = 0; k < 3; ++k) {
                o->bounds.min[k] = v == 0 ? p[k] : fminf(o->bounds.min[k], p[k]);
                o->bounds.max[k] = v == 0 ? p[k] : fmaxf(o->bounds.max[k], p[k]);
            }
        }
        assert_true(umb_scene_object_bounds(f->scene, i, &bounds));
        for (int k = 0; k < 3; ++k) {
            bool right = f->town.moves[i]
                             ? bounds.min[k] <= o->bounds.min[k] && bounds.max[k] >= o->bounds.max[k]
                             : bounds.min[k] == o->bounds.min[k] && bounds.max[k] == o->bounds.max[k];
            assert_true(right);
        }
    }
    umb_view view = moving_town_view(&f->town, frame, time);
    for (int i = 0; i < 3; ++i) {
        view.eye[i] += f->place[i] - f->origin[i];
    }
    assert_int_equal(umb_cull(f->culler, &view, &seen), UMB_OK);
    truth *oracle = truth_create(f->town.posed, &error);
    assert_non_null(oracle);
    truth_options options = {.grid_width = 160, .grid_height = 80, .guided_rays = 100000, .threads = 1};
    assert_true(strict_check(oracle, f->town.posed, &view, seen.objects, seen.count, &options, "far away", sum));
    truth_destroy(oracle);
}

static void far_walk(bool moving)
{
    far_town f;
    strict_count sum = {0};
    dice d = {9};
    far_set_up(&f, moving);
    for (uint32_t frame = 0; frame < (is_small() ? 6u : 30u); ++frame) {
        far_check(&f, frame * 0.2, 7 * frame, &sum); /* the first of them where floats are whole units */
        double shift[3];
        for (int i = 0; i < 3; ++i) {
            double there = frame % 3 == 2 ? 1e5 : 0.0; /* to the viewer, and away again */
            shift[i] = f.place[i] + there - f.origin[i] + 0.125 * dice_roll(&d, 100);
        }
        far_shift(&f, shift);
    }
    printf("# %llu views, %llu reported, %llu seen, wrongly hidden %llu\n", (unsigned long long)sum.views,
           (unsigned long long)sum.reported, (unsigned long long)sum.truth_visible, (unsigned long long)sum.wrongly_hidden);
    assert_int_equal(sum.wrongly_hidden, 0);
    assert_true(sum.reported < sum.objects / 3);
    far_tear_down(&f);
}

static void test_far_town(void **state)
{
    (void)state;
    far_walk(false);
}

static void test_far_movers(void **state)
{
    (void)state;
    far_walk(true);
}

/* A hundred shifts and back are none; bounds by hand only grow; welds go, and come back; what cannot be is refused. */
static void test_shift(void **state)
{
    (void)state;
    moving_town town;
    moving_town_make(&town, "gen:blocks,g=3");
    umb_scene *scene = moving_town_scene(&town, NULL, false);
    umb_object_def by_hand = {.bounds = {{1.5f, 2.5f, 3.5f}, {4.5f, 5.5f, 1000.1f}}};
    uint32_t hand, count = town.model->object_count;
    umb_aabb *before = malloc(count * sizeof *before), now;
    assert_non_null(before);
    assert_int_equal(umb_scene_add_object(scene, &by_hand, &hand), UMB_OK);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    for (uint32_t i = 0; i < count; ++i) {
        assert_true(umb_scene_object_bounds(scene, i, &before[i]));
    }
    dice d = {1};
    double sum[3] = {0, 0, 0};
    for (uint32_t k = 0; k <= 100; ++k) {
        double shift[3];
        for (int i = 0; i < 3; ++i) {
            shift[i] = k < 100 ? 0.0625 * dice_roll(&d, 1u << 26) - (1 << 20) : -sum[i];
            sum[i] += shift[i];
        }
        assert_int_equal(umb_scene_shift_origin(scene, shift), UMB_OK);
        if (k % 10 == 3) {
            assert_int_equal(umb_scene_commit(scene), UMB_OK);
        }
    }
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    for (uint32_t i = 0; i < count; ++i) {
        assert_true(umb_scene_object_bounds(scene, i, &now));
        assert_memory_equal(&now, &before[i], sizeof now);
    }
    assert_true(umb_scene_object_bounds(scene, hand, &now));
    for (int i = 0; i < 3; ++i) {
        assert_true(now.min[i] <= by_hand.bounds.min[i] && now.max[i] >= by_hand.bounds.max[i]);
    }
    const double huge[3] = {1e39, 0, 0}, nowhere[3] = {0, (double)NAN, 0};
    assert_int_equal(umb_scene_shift_origin(scene, huge), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_shift_origin(scene, nowhere), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_true(umb_scene_object_bounds(scene, 0, &now));
    assert_memory_equal(&now, &before[0], sizeof now);
    free(before);
    umb_scene_destroy(scene);
    moving_town_free(&town);
}

/* ---- several scenes ------------------------------------------------------------------------- */

typedef struct player {
    const char *spec;
    pthread_t thread;
    uint64_t hash;
} player;

/* A whole program: scene, index, culler, and frames in which everything moves. */
static void *play(void *data)
{
    player *p = data;
    moving_town town;
    umb_index *index = NULL;
    umb_culler *culler = NULL;
    moving_town_make(&town, p->spec);
    umb_scene *scene = moving_town_scene(&town, NULL, true);
    p->hash = 1;
    bool ok = umb_index_create(scene, NULL, &index) == UMB_OK && umb_culler_create(index, NULL, &culler) == UMB_OK;
    for (uint32_t frame = 0; ok && frame < (is_small() ? 10u : 60u); ++frame) {
        umb_visible_set seen;
        umb_view view = moving_town_view(&town, frame, frame / 30.0);
        ok = umb_scene_set_time(scene, view.time) == UMB_OK && umb_scene_commit(scene) == UMB_OK &&
             umb_cull(culler, &view, &seen) == UMB_OK;
        for (uint32_t i = 0; ok && i < seen.count; ++i) {
            p->hash = (p->hash ^ seen.objects[i]) * 0x100000001b3u;
        }
    }
    p->hash = ok ? p->hash : 0;
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    moving_town_free(&town);
    return NULL;
}

/* Each scene with its cullers in a thread of its own answers as it does alone. */
static void test_several_scenes(void **state)
{
    (void)state;
    enum { PLAYERS = 6 };
    static const char *const specs[3] = {"gen:blocks,g=6", "gen:city,triangles=5k", "gen:blocks,g=5"};
    player at_once[PLAYERS], alone[PLAYERS];
    for (int i = 0; i < PLAYERS; ++i) {
        at_once[i].spec = alone[i].spec = specs[i % 3];
        assert_int_equal(pthread_create(&at_once[i].thread, NULL, play, &at_once[i]), 0);
    }
    for (int i = 0; i < PLAYERS; ++i) {
        assert_int_equal(pthread_join(at_once[i].thread, NULL), 0);
    }
    for (int i = 0; i < PLAYERS; ++i) {
        (void)play(&alone[i]);
        assert_true(alone[i].hash != 0 && alone[i].hash == at_once[i].hash);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_doors), cmocka_unit_test(test_far_town),       cmocka_unit_test(test_far_movers),
        cmocka_unit_test(test_shift), cmocka_unit_test(test_several_scenes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

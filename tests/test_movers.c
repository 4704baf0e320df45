/* Objects that move by themselves, against brute force: a second scene, in which everybody is moved to where they truly
 * are in each frame, and the oracle, which looks at a model of that. */
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

#define UNLIMITED (1LL << 60)

static bool is_small(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && strcmp(size, "small") == 0;
}

/* ---- two worlds ----------------------------------------------------------------------------- */

/* The town with volumes, and the one without, over several indices. */
enum { INDICES = 3, METHODS = 3 };

typedef struct worlds {
    moving_town town;
    umb_scene *scene, *plain;
    umb_index *index[INDICES], *plain_index;
    umb_culler *raster[INDICES], *all[INDICES], *chosen[METHODS], *loose, *plain_raster, *plain_all;
} worlds;

static void set_up(worlds *w, const char *spec, const umb_allocator *allocator)
{
    umb_culler_def none = {.method = UMB_METHOD_NONE};
    memset(w, 0, sizeof *w);
    moving_town_make(&w->town, spec);
    w->scene = moving_town_scene(&w->town, allocator, true);
    w->plain = moving_town_scene(&w->town, allocator, false);
    for (int i = 0; i < INDICES; ++i) {
        static const umb_index_kind kinds[INDICES] = {UMB_INDEX_BVH, UMB_INDEX_FLAT, UMB_INDEX_KDTREE};
        umb_index_def def = {.kind = kinds[i]};
        assert_int_equal(umb_index_create(w->scene, &def, &w->index[i]), UMB_OK);
        assert_int_equal(umb_culler_create(w->index[i], NULL, &w->raster[i]), UMB_OK);
        assert_int_equal(umb_culler_create(w->index[i], &none, &w->all[i]), UMB_OK);
    }
    assert_int_equal(umb_index_create(w->plain, NULL, &w->plain_index), UMB_OK);
    assert_int_equal(umb_culler_create(w->plain_index, NULL, &w->plain_raster), UMB_OK);
    assert_int_equal(umb_culler_create(w->plain_index, &none, &w->plain_all), UMB_OK);
    for (int i = 0; i < METHODS; ++i) { /* those that choose their occluders first */
        static const umb_method methods[METHODS] = {UMB_METHOD_PLANES, UMB_METHOD_SHADOW_FRUSTA,
                                                    UMB_METHOD_OCCLUSION_TREE};
        umb_culler_def def = {.method = methods[i]};
        assert_int_equal(umb_culler_create(w->index[i], &def, &w->chosen[i]), UMB_OK);
    }
    none.unordered = true;
    assert_int_equal(umb_culler_create(w->index[0], &none, &w->loose), UMB_OK);
}

static void tear_down(worlds *w)
{
    umb_culler_destroy(w->loose);
    for (int i = 0; i < METHODS; ++i) {
        umb_culler_destroy(w->chosen[i]);
    }
    for (int i = 0; i < INDICES; ++i) {
        umb_culler_destroy(w->raster[i]);
        umb_culler_destroy(w->all[i]);
        umb_index_destroy(w->index[i]);
    }
    umb_culler_destroy(w->plain_raster);
    umb_culler_destroy(w->plain_all);
    umb_index_destroy(w->plain_index);
    umb_scene_destroy(w->scene);
    umb_scene_destroy(w->plain);
    moving_town_free(&w->town);
}

static void advance(worlds *w, double time)
{
    assert_int_equal(umb_scene_set_time(w->scene, time), UMB_OK);
    assert_int_equal(umb_scene_commit(w->scene), UMB_OK);
    moving_town_move_all(&w->town, w->plain, time);
}

static int by_id(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Without occlusion the answer is the one of brute force, to the bit; unordered it is the same set. */
static void check_in_view(worlds *w, const umb_view *view)
{
    umb_visible_set want, have;
    assert_int_equal(umb_cull(w->plain_all, view, &want), UMB_OK);
    for (int i = 0; i < INDICES; ++i) {
        assert_int_equal(umb_cull(w->all[i], view, &have), UMB_OK);
        assert_int_equal(have.count, want.count);
        assert_memory_equal(have.objects, want.objects, want.count * sizeof want.objects[0]);
        assert_memory_equal(have.inside, want.inside, want.count);
        assert_int_equal(have.stats.strays, 0);
    }
    assert_int_equal(umb_cull(w->loose, view, &have), UMB_OK);
    assert_int_equal(have.count, want.count);
    uint32_t *a = malloc((want.count + 1) * sizeof *a), *b = malloc((want.count + 1) * sizeof *b);
    assert_true(a != NULL && b != NULL);
    memcpy(a, want.objects, want.count * sizeof *a);
    memcpy(b, have.objects, want.count * sizeof *b);
    qsort(a, want.count, sizeof *a, by_id);
    qsort(b, want.count, sizeof *b, by_id);
    assert_memory_equal(a, b, want.count * sizeof *a);
    free(a);
    free(b);
}

/* Every volume holds its object, at the scene's time and at that of its expiry at the latest. */
static void check_volumes(const worlds *w, double time)
{
    for (uint32_t i = 0; i < w->town.model->object_count; ++i) {
        umb_aabb volume, truly = moving_town_bounds(&w->town, i, time);
        assert_true(umb_scene_object_bounds(w->scene, i, &volume));
        for (int k = 0; k < 3; ++k) {
            assert_true(volume.min[k] <= truly.min[k] && volume.max[k] >= truly.max[k]);
        }
    }
}

typedef struct sums {
    uint64_t frames, poses, expired, hidden_movers, reported, plain_reported, renewed;
    strict_count strict;
} sums;

/* One view: frustum culling to the bit; occlusion by the oracle. */
static void check_view(worlds *w, const umb_view *view, bool with_oracle, sums *s)
{
    static const char *const names[INDICES + METHODS] = {"bvh",    "flat",          "kdtree",
                                                          "planes", "shadow frusta", "occlusion tree"};
    umb_visible_set seen[INDICES + METHODS], plain;
    strict_answer answers[INDICES + METHODS];
    check_in_view(w, view);
    for (int i = 0; i < INDICES + METHODS; ++i) {
        umb_culler *culler = i < INDICES ? w->raster[i] : w->chosen[i - INDICES];
        assert_int_equal(umb_cull(culler, view, &seen[i]), UMB_OK);
        assert_int_equal(seen[i].class_, UMB_CLASS_STRICT);
        assert_int_equal(seen[i].stats.strays, 0);
        answers[i] = (strict_answer){seen[i].objects, seen[i].count, names[i], &s->strict};
    }
    assert_int_equal(umb_cull(w->plain_raster, view, &plain), UMB_OK);
    s->frames += 1;
    s->poses += seen[0].stats.poses;
    s->expired += seen[0].stats.expired;
    s->hidden_movers += seen[0].stats.hidden_movers;
    s->reported += seen[0].count;
    s->plain_reported += plain.count;
    if (with_oracle) {
        umb_error error = {0};
        moving_town_pose_model(&w->town, view->time);
        truth *oracle = truth_create(w->town.posed, &error);
        assert_non_null(oracle);
        truth_options options = {.grid_width = 160, .grid_height = 80, .guided_rays = 200000, .threads = 1};
        assert_true(strict_check_all(oracle, w->town.posed, view, answers, INDICES + METHODS, &options));
        truth_destroy(oracle);
    }
}

static void print_sums(const char *what, const sums *s)
{
    printf("# %s: %llu frames; a frame asks for %.1f poses, %.1f of them expired, and for none of %.1f hidden movers; "
           "%.3f times as many reported as with all moved; volumes renewed %.1f; oracle: %llu views, %llu seen, wrongly "
           "hidden %llu, unconfirmed %llu\n",
           what, (unsigned long long)s->frames, (double)s->poses / (double)s->frames,
           (double)s->expired / (double)s->frames, (double)s->hidden_movers / (double)s->frames,
           (double)s->reported / (double)s->plain_reported, (double)s->renewed / (double)s->frames,
           (unsigned long long)s->strict.views, (unsigned long long)s->strict.truth_visible,
           (unsigned long long)s->strict.wrongly_hidden, (unsigned long long)s->strict.unconfirmed);
}

/* ---- walks ---------------------------------------------------------------------------------- */

/* Time goes on in steps of all sizes, the viewer too; every motion's kind is among the objects. */
static void test_walk(void **state)
{
    (void)state;
    worlds w;
    sums s = {0};
    double time = 0.0;
    uint32_t frames = is_small() ? 40 : 400;
    set_up(&w, "gen:blocks,g=8", NULL);
    for (uint32_t frame = 0; frame < frames; ++frame) {
        umb_motion_stats stats;
        time += frame % 37 == 36 ? 5.0 : 1.0 / 30;
        advance(&w, time);
        umb_scene_get_motion_stats(w.scene, &stats);
        s.renewed += stats.renewed;
        umb_view view = moving_town_view(&w.town, frame, time);
        check_view(&w, &view, frame % 10 == 5, &s);
        if (frame % 8 == 0) {
            check_volumes(&w, time);
        }
    }
    print_sums("walk", &s);
    assert_int_equal(s.strict.wrongly_hidden, 0);
    assert_true(s.hidden_movers > s.poses); /* most are left alone */
    assert_true(s.expired * 20 < s.poses);  /* commits renew what expires */
    tear_down(&w);
}

/* Views of times that the scene was never told of: later, earlier, and back again. */
static void test_other_times(void **state)
{
    (void)state;
    worlds w;
    sums s = {0};
    dice d = {3};
    set_up(&w, "gen:blocks,g=6", NULL);
    for (uint32_t frame = 0; frame < (is_small() ? 20 : 120); ++frame) {
        double scene_time = dice_roll(&d, 40) * 0.25, time = scene_time + (dice_roll(&d, 5) - 2.0) * 0.5;
        if (frame % 3 == 0) {
            advance(&w, scene_time);
        }
        moving_town_move_all(&w.town, w.plain, time);
        umb_view view = moving_town_view(&w.town, frame, time);
        check_view(&w, &view, frame % 10 == 5, &s);
    }
    print_sums("other times", &s);
    assert_int_equal(s.strict.wrongly_hidden, 0);
    assert_true(s.expired > 0);
    tear_down(&w);
}

/* ---- what may happen to a motion ------------------------------------------------------------ */

typedef struct lone {
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler, *all;
    umb_shape box;
    uint32_t wall, mover;
    bool silent; /* nobody knows where it is */
    double speed;
    atomic_int asked;
} lone;

/* It walks to and fro behind a wall, and for some time beside it. */
static double lone_place(const lone *l, double time)
{
    double way = fmod(l->speed * time, 80.0);
    return way < 40.0 ? way - 20.0 : 60.0 - way;
}

static bool lone_pose(void *user, uint32_t object, double time, umb_pose *out)
{
    lone *l = user;
    (void)object;
    atomic_fetch_add(&l->asked, 1);
    umb_transform at = {{{1, 0, 0, (float)lone_place(l, time)}, {0, 1, 0, 0}, {0, 0, 1, -20}}};
    out->transform = at;
    return !l->silent;
}

static void lone_set_up(lone *l)
{
    static const float p[8][3] = {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {1, 1, -1},
                                  {-1, -1, 1},  {1, -1, 1},  {-1, 1, 1},  {1, 1, 1}};
    static const uint32_t t[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                   2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    umb_shape_def shape = {.positions = p[0], .position_count = 8, .indices = t, .index_count = 36};
    umb_culler_def none = {.method = UMB_METHOD_NONE};
    memset(l, 0, sizeof *l);
    l->speed = 1.0;
    assert_int_equal(umb_scene_create(NULL, &l->scene), UMB_OK);
    assert_int_equal(umb_scene_add_shape(l->scene, &shape, &l->box), UMB_OK);
    umb_object_def wall = {.shape = l->box,
                           .transform = {{{12, 0, 0, 0}, {0, 6, 0, 0}, {0, 0, 0.25f, -10}}},
                           .flags = UMB_OBJECT_IS_SHAPE};
    umb_object_def mover = {.shape = l->box, .transform = {{{1, 0, 0, -20}, {0, 1, 0, 0}, {0, 0, 1, -20}}}};
    assert_int_equal(umb_scene_add_object(l->scene, &wall, &l->wall), UMB_OK);
    assert_int_equal(umb_scene_add_object(l->scene, &mover, &l->mover), UMB_OK);
    assert_int_equal(umb_index_create(l->scene, NULL, &l->index), UMB_OK);
    assert_int_equal(umb_culler_create(l->index, NULL, &l->culler), UMB_OK);
    assert_int_equal(umb_culler_create(l->index, &none, &l->all), UMB_OK);
}

static void lone_tear_down(lone *l)
{
    umb_culler_destroy(l->culler);
    umb_culler_destroy(l->all);
    umb_index_destroy(l->index);
    umb_scene_destroy(l->scene);
}

static umb_visible_set lone_see(lone *l, umb_culler *culler, double time)
{
    static const double eye[3] = {0, 0, 0}, target[3] = {0, 0, -1}, up[3] = {0, 1, 0};
    umb_view view;
    umb_visible_set seen;
    assert_int_equal(umb_view_look_at(&view, eye, target, up, 1.5, 2, 0.1, 100), UMB_OK);
    view.time = time;
    assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
    (void)l;
    return seen;
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

static void lone_advance(lone *l, double time)
{
    assert_int_equal(umb_scene_set_time(l->scene, time), UMB_OK);
    assert_int_equal(umb_scene_commit(l->scene), UMB_OK);
}

/* It stays behind the wall: asked for less and less often. Then it comes out, and is seen at once. */
static void test_adaptive(void **state)
{
    (void)state;
    lone l;
    lone_set_up(&l);
    l.speed = 0.01;
    assert_int_equal(umb_scene_set_poses(l.scene, &(umb_pose_source){lone_pose, &l}), UMB_OK);
    umb_motion_def def = {.max_speed = 0.0101, .most_period = 1000};
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &def), UMB_OK);
    double first = 1000.0, last = 2000.0; /* 10 to the left of the middle, then in the middle */
    for (double time = first; time < last; time += 0.5) {
        lone_advance(&l, time);
        umb_visible_set seen = lone_see(&l, l.culler, time);
        assert_false(sees(&seen, l.mover));
    }
    printf("# asked %d times in 2,000 frames behind a wall\n", atomic_load(&l.asked));
    assert_true(atomic_load(&l.asked) < 40);
    bool out = false;
    umb_motion_stats stats;
    for (double time = last; time < 4000.0; time += 5.0) {
        lone_advance(&l, time);
        umb_visible_set seen = lone_see(&l, l.culler, time);
        double x = lone_place(&l, time);
        if (fabs(x) + 1.0 > 12.0 * 21.0 / 10.25) { /* beyond the wall's shadow, as far as its far corner */
            assert_true(sees(&seen, l.mover));
            out = true;
        }
        out = out || sees(&seen, l.mover);
    }
    assert_false(out && lone_place(&l, 4000.0) < 10.0);
    umb_scene_get_motion_stats(l.scene, &stats);
    assert_int_equal(stats.movers, 1);
    lone_tear_down(&l);
}

/* A volume that is seen while the object is not gives way to shorter ones, and these to one pose a frame at most. */
static void test_revealed(void **state)
{
    (void)state;
    lone l;
    lone_set_up(&l);
    l.speed = 0.0;
    assert_int_equal(umb_scene_set_poses(l.scene, &(umb_pose_source){lone_pose, &l}), UMB_OK);
    umb_motion_def def = {.max_speed = 10.0, .first_period = 8.0, .least_period = 0.25};
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &def), UMB_OK);
    uint32_t hidden = 0, revealed = 0;
    l.speed = 20.0 / 3000.0; /* in the middle at 3,000 */
    for (uint32_t frame = 0; frame < 600; ++frame) {
        double time = 3000.0 + frame / 60.0;
        umb_motion_stats stats;
        lone_advance(&l, time);
        umb_scene_get_motion_stats(l.scene, &stats);
        revealed += stats.revealed;
        umb_visible_set seen = lone_see(&l, l.culler, time);
        assert_false(sees(&seen, l.mover));
        hidden += seen.stats.hidden_movers;
        assert_true(seen.stats.poses + seen.stats.hidden_movers == 1);
    }
    printf("# of 600 frames, %u asked for nothing; %u volumes were seen\n", hidden, revealed);
    assert_true(revealed > 2 && hidden > 400);
    lone_tear_down(&l);
}

/* Set, changed, ended, removed, ignored; moved by hand; refused. */
static void test_life(void **state)
{
    (void)state;
    lone l;
    lone_set_up(&l);
    umb_motion_def def = {.max_speed = 1.1}, wrong = {.max_speed = -1.0}, door = {.kind = UMB_MOTION_VOLUME};
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &def), UMB_ERROR_STATE);
    assert_int_equal(umb_scene_set_poses(l.scene, NULL), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_set_poses(l.scene, &(umb_pose_source){lone_pose, &l}), UMB_OK);
    assert_int_equal(umb_scene_set_motion(l.scene, 7, &def), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &wrong), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &door), UMB_ERROR_ARGUMENT);
    wrong.max_speed = (double)NAN;
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &wrong), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_set_time(l.scene, INFINITY), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, NULL), UMB_OK);
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &def), UMB_OK);
    assert_int_equal(umb_scene_move_object(l.scene, l.mover, NULL, NULL), UMB_ERROR_STATE);

    /* In the middle of the wall's shadow, at the left of it, and in the middle again. */
    const double times[5] = {20, 0, 21, 40, 60};
    const bool shows[5] = {false, false, false, false, false};
    for (int i = 0; i < 5; ++i) {
        lone_advance(&l, times[i]);
        umb_visible_set seen = lone_see(&l, l.culler, times[i]);
        assert_int_equal(sees(&seen, l.mover), shows[i] || fabs(lone_place(&l, times[i])) > 25.0);
        seen = lone_see(&l, l.all, times[i]);
        assert_true(sees(&seen, l.mover));
    }

    /* A volume of its own: it is asked for when that is seen, and never expires. */
    door.volume = (umb_aabb){{-22, -1, -21}, {22, 1, -19}};
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &door), UMB_OK);
    lone_advance(&l, 61);
    int before = atomic_load(&l.asked);
    umb_aabb bounds;
    assert_true(umb_scene_object_bounds(l.scene, l.mover, &bounds));
    assert_memory_equal(&bounds, &door.volume, sizeof bounds);
    lone_advance(&l, 1e6);
    assert_int_equal(atomic_load(&l.asked), before);

    /* Nobody knows where it is: it is seen, and hides nothing. */
    l.silent = true;
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &def), UMB_OK);
    lone_advance(&l, 1e6 + 20);
    umb_visible_set seen = lone_see(&l, l.culler, 1e6 + 20);
    assert_true(sees(&seen, l.mover));
    seen = lone_see(&l, l.all, 1e6 + 20);
    assert_true(sees(&seen, l.mover));
    l.silent = false;
    lone_advance(&l, 1e6 + 20);
    seen = lone_see(&l, l.culler, 1e6 + 20);
    assert_false(sees(&seen, l.mover));

    /* Ignored, it is neither seen nor missed. */
    assert_int_equal(umb_scene_flag_object(l.scene, l.mover, UMB_OBJECT_IGNORED), UMB_OK);
    lone_advance(&l, 1e6 + 500);
    seen = lone_see(&l, l.all, 1e6 + 700);
    assert_false(sees(&seen, l.mover));
    assert_int_equal(umb_scene_flag_object(l.scene, l.mover, 0), UMB_OK);

    /* It stands where it was when its motion ended. */
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, NULL), UMB_OK);
    lone_advance(&l, 1e6 + 5);
    assert_true(umb_scene_object_bounds(l.scene, l.mover, &bounds));
    assert_true(fabs(0.5 * ((double)bounds.min[0] + bounds.max[0]) - lone_place(&l, 1e6 + 5)) < 1e-4);
    assert_true(bounds.max[0] - bounds.min[0] < 2.001f);
    seen = lone_see(&l, l.all, 5);
    assert_int_equal(seen.stats.poses + seen.stats.hidden_movers, 0);
    assert_int_equal(umb_scene_move_object(l.scene, l.mover, NULL, NULL), UMB_OK);

    /* Removed while it moves; its number serves another. */
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &def), UMB_OK);
    lone_advance(&l, 1e6 + 6);
    assert_int_equal(umb_scene_remove_object(l.scene, l.mover), UMB_OK);
    lone_advance(&l, 1e6 + 1000);
    seen = lone_see(&l, l.all, 1e6 + 5000);
    assert_false(sees(&seen, l.mover));
    umb_motion_stats stats;
    umb_scene_get_motion_stats(l.scene, &stats);
    assert_int_equal(stats.movers, 0);
    umb_object_def other = {.shape = l.box, .transform = {{{1, 0, 0, -20}, {0, 1, 0, 0}, {0, 0, 1, -20}}}};
    uint32_t id;
    assert_int_equal(umb_scene_add_object(l.scene, &other, &id), UMB_OK);
    assert_int_equal(id, l.mover);
    assert_int_equal(umb_scene_set_motion(l.scene, id, &def), UMB_OK);
    lone_advance(&l, 1e6 + 1020);
    seen = lone_see(&l, l.culler, 1e6 + 1020);
    assert_false(sees(&seen, l.mover));
    lone_tear_down(&l);
}

/* Several commits between two frames: what is in sight is known all the while. When nobody looks any more, it is let go. */
static void test_commits(void **state)
{
    (void)state;
    lone l;
    lone_set_up(&l);
    assert_int_equal(umb_scene_set_poses(l.scene, &(umb_pose_source){lone_pose, &l}), UMB_OK);
    umb_motion_def def = {.max_speed = 2.0};
    umb_motion_stats stats;
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &def), UMB_OK);
    assert_int_equal(umb_scene_flag_object(l.scene, l.wall, UMB_OBJECT_IGNORED), UMB_OK);
    for (uint32_t frame = 0; frame < 40; ++frame) {
        for (uint32_t k = 0; k < 3; ++k) {
            lone_advance(&l, 20.0 + 0.02 * frame + 0.005 * k);
        }
        umb_visible_set seen = lone_see(&l, l.culler, 20.0 + 0.02 * frame + 0.01);
        assert_true(sees(&seen, l.mover));
        assert_true(seen.stats.poses == 0 || frame == 0);
    }
    for (uint32_t k = 0; k < 20; ++k) {
        lone_advance(&l, 21.0 + k);
        umb_scene_get_motion_stats(l.scene, &stats);
        assert_int_equal(stats.exact, k < 5);
    }
    lone_tear_down(&l);
}

/* A promise that is not kept is counted; one that is not certain makes the answer approximate. */
static void test_fuzzy(void **state)
{
    (void)state;
    lone l;
    lone_set_up(&l);
    assert_int_equal(umb_scene_set_poses(l.scene, &(umb_pose_source){lone_pose, &l}), UMB_OK);
    umb_motion_def def = {.max_speed = 0.001, .fuzzy = true, .first_period = 64};
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &def), UMB_OK);
    lone_advance(&l, 0);
    umb_visible_set seen = lone_see(&l, l.all, 10);
    assert_int_equal(seen.class_, UMB_CLASS_APPROXIMATE);
    assert_int_equal(seen.stats.poses, 1);
    assert_int_equal(seen.stats.strays, 1);
    def.fuzzy = false;
    assert_int_equal(umb_scene_set_motion(l.scene, l.mover, &def), UMB_OK);
    lone_advance(&l, 0);
    seen = lone_see(&l, l.all, 0);
    assert_int_equal(seen.class_, UMB_CLASS_STRICT);
    assert_int_equal(seen.stats.strays, 0);
    lone_tear_down(&l);
}

/* ---- memory --------------------------------------------------------------------------------- */

/* Thousands of frames of motion allocate nothing and hold no more than the first. */
static void test_steady(void **state)
{
    (void)state;
    failing memory;
    umb_allocator allocator = failing_allocator(&memory, UNLIMITED);
    worlds w;
    umb_visible_set seen;
    set_up(&w, "gen:blocks,g=8", &allocator);
    for (int i = 0; i < INDICES; ++i) {
        umb_view view = moving_town_view(&w.town, 0, 0.0);
        assert_int_equal(umb_cull(w.raster[i], &view, &seen), UMB_OK);
        assert_int_equal(umb_cull(w.all[i], &view, &seen), UMB_OK);
        advance(&w, 0.1);
    }
    long long left = atomic_load(&memory.left), held = atomic_load(&memory.held);
    size_t scene = umb_scene_memory(w.scene);
    for (uint32_t frame = 0; frame < (is_small() ? 300u : 5000u); ++frame) {
        if (frame == 60) { /* volumes have been made anew: indices that follow motion have made room for it */
            left = atomic_load(&memory.left);
            held = atomic_load(&memory.held);
        }
        double time = 0.1 + frame / 30.0;
        umb_view view = moving_town_view(&w.town, frame, time);
        assert_int_equal(umb_scene_set_time(w.scene, time), UMB_OK);
        assert_int_equal(umb_scene_commit(w.scene), UMB_OK);
        assert_int_equal(umb_cull(w.raster[frame % INDICES], &view, &seen), UMB_OK);
        assert_int_equal(umb_cull(w.all[frame % INDICES], &view, &seen), UMB_OK);
    }
    assert_true(atomic_load(&memory.left) == left && atomic_load(&memory.held) == held);
    assert_true(umb_scene_memory(w.scene) == scene);
    tear_down(&w);
    assert_true(atomic_load(&memory.held) == 0);
}

/* Whatever finds no memory, and whenever: the frames after it are right. */
static void test_failing(void **state)
{
    (void)state;
    failing memory;
    umb_allocator allocator = failing_allocator(&memory, UNLIMITED);
    moving_town town;
    moving_town_make(&town, "gen:blocks,g=3");
    bool done = false;
    uint32_t failures = 0;
    for (long long limit = 0; !done; limit += 1 + limit / 16) {
        umb_scene *scene = NULL;
        umb_index *index = NULL;
        umb_culler *culler = NULL;
        umb_visible_set seen, again;
        atomic_store(&memory.left, UNLIMITED);
        scene = moving_town_scene(&town, &allocator, false);
        assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
        assert_int_equal(umb_culler_create(index, NULL, &culler), UMB_OK);
        atomic_store(&memory.left, limit);
        umb_view view = moving_town_view(&town, 5, 3.0);
        umb_result result = moving_town_start(&town, scene);
        result = result == UMB_OK ? umb_scene_set_time(scene, 3.0) : result;
        result = result == UMB_OK ? umb_scene_commit(scene) : result;
        result = result == UMB_OK ? umb_cull(culler, &view, &seen) : result;
        done = result == UMB_OK;
        failures += !done;
        atomic_store(&memory.left, UNLIMITED);
        /* Even without another commit, if the index has followed. */
        if (!done && umb_cull(culler, &view, &again) == UMB_OK) {
            assert_int_equal(again.stats.strays, 0);
        }
        assert_int_equal(moving_town_start(&town, scene), UMB_OK);
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        assert_int_equal(umb_cull(culler, &view, &again), UMB_OK);
        assert_int_equal(again.stats.strays, 0);
        assert_true(again.stats.poses > 0);
        umb_culler_destroy(culler);
        umb_index_destroy(index);
        umb_scene_destroy(scene);
        assert_true(atomic_load(&memory.held) == 0);
    }
    assert_true(failures > 5);
    moving_town_free(&town);
}

/* ---- threads -------------------------------------------------------------------------------- */

typedef struct viewer {
    const moving_town *town;
    umb_culler *culler;
    pthread_t thread;
    uint32_t number, frame;
    double time;
    uint64_t hash;
} viewer;

static void *look(void *data)
{
    viewer *v = data;
    umb_visible_set seen;
    umb_view view = moving_town_view(v->town, v->frame + 3 * v->number, v->time + 0.01 * (v->number % 3));
    if (umb_cull(v->culler, &view, &seen) != UMB_OK) {
        v->hash = 0;
        return NULL;
    }
    for (uint32_t i = 0; i < seen.count; ++i) {
        v->hash = (v->hash ^ seen.objects[i]) * 0x100000001b3u;
    }
    v->hash = (v->hash ^ seen.stats.poses) * 0x100000001b3u;
    return NULL;
}

/* Several cullers at once, of which some have helpers of their own, tell the scene the same as one after the other. */
static void compare_threads(const char *spec)
{
    enum { VIEWERS = 4 };
    worlds w[2];
    viewer v[2][VIEWERS];
    umb_pool *pool;
    assert_int_equal(umb_pool_create(3, &pool), UMB_OK);
    for (int k = 0; k < 2; ++k) {
        set_up(&w[k], spec, NULL);
        for (uint32_t i = 0; i < VIEWERS; ++i) {
            umb_culler_def def = {.coherence = i == 3 ? UMB_COHERENCE_ALL : 0, .occluder_budget = i == 3 ? 40 : 0};
            if (k == 0 && i < 2) {
                def.tasks = umb_pool_tasks(pool);
            }
            v[k][i] = (viewer){.town = &w[k].town, .number = i, .hash = 1};
            assert_int_equal(umb_culler_create(w[k].index[0], &def, &v[k][i].culler), UMB_OK);
        }
    }
    for (uint32_t frame = 0; frame < (is_small() ? 30u : 200u); ++frame) {
        for (int k = 0; k < 2; ++k) {
            advance(&w[k], frame / 20.0);
            for (uint32_t i = 0; i < VIEWERS; ++i) {
                v[k][i].frame = frame;
                v[k][i].time = frame / 20.0;
            }
            for (uint32_t i = 0; i < VIEWERS && k == 0; ++i) {
                assert_int_equal(pthread_create(&v[k][i].thread, NULL, look, &v[k][i]), 0);
            }
            for (uint32_t i = 0; i < VIEWERS && k == 0; ++i) {
                assert_int_equal(pthread_join(v[k][i].thread, NULL), 0);
            }
            for (uint32_t i = VIEWERS; i-- > 0 && k == 1;) {
                (void)look(&v[k][i]);
            }
        }
        for (uint32_t i = 0; i < VIEWERS; ++i) {
            assert_true(v[0][i].hash == v[1][i].hash && v[0][i].hash != 0);
        }
    }
    for (int k = 0; k < 2; ++k) {
        for (uint32_t i = 0; i < VIEWERS; ++i) {
            umb_culler_destroy(v[k][i].culler);
        }
        tear_down(&w[k]);
    }
    umb_pool_destroy(pool);
}

/* Boxes; and houses, whose images other threads find ahead. */
static void test_threads(void **state)
{
    (void)state;
    compare_threads("gen:blocks,g=8");
    compare_threads("gen:city,triangles=20k");
}

/* What is carried over from frame to frame hides nothing either. */
static void test_coherence(void **state)
{
    (void)state;
    worlds w;
    strict_count sum = {0};
    set_up(&w, "gen:blocks,g=8", NULL);
    umb_culler *culler;
    umb_culler_def def = {.coherence = UMB_COHERENCE_ALL, .occluder_budget = 60};
    assert_int_equal(umb_culler_create(w.index[0], &def, &culler), UMB_OK);
    for (uint32_t frame = 0; frame < (is_small() ? 30u : 200u); ++frame) {
        double time = frame / 25.0;
        umb_visible_set seen;
        umb_error error = {0};
        advance(&w, time);
        umb_view view = moving_town_view(&w.town, frame / 4, time);
        assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
        assert_int_equal(seen.stats.strays, 0);
        if (frame % 10 == 9) {
            moving_town_pose_model(&w.town, time);
            truth *oracle = truth_create(w.town.posed, &error);
            truth_options options = {.grid_width = 160, .grid_height = 80, .guided_rays = 200000, .threads = 1};
            assert_true(strict_check(oracle, w.town.posed, &view, seen.objects, seen.count, &options, "coherent", &sum));
            truth_destroy(oracle);
        }
    }
    assert_int_equal(sum.wrongly_hidden, 0);
    umb_culler_destroy(culler);
    tear_down(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_walk),     cmocka_unit_test(test_other_times), cmocka_unit_test(test_adaptive),
        cmocka_unit_test(test_revealed), cmocka_unit_test(test_life),        cmocka_unit_test(test_fuzzy),
        cmocka_unit_test(test_commits),
        cmocka_unit_test(test_steady),   cmocka_unit_test(test_failing),     cmocka_unit_test(test_threads),
        cmocka_unit_test(test_coherence),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* What a view leaves out: layers, under the oracle over a model without what is left out; layers that hide nonetheless and
 * candidates, which are the answer without them, less what they leave out. UMBRAGE_MICRO_SCENES sets how many scenes (150;
 * small 40). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/failing.h"
#include "support/micro_scenes.h"
#include "support/moving_town.h"
#include "support/strict.h"

enum { METHODS = 5, MOST_OBJECTS = 4096 };

static const umb_method ALL[METHODS] = {UMB_METHOD_RASTER, UMB_METHOD_NONE, UMB_METHOD_PLANES, UMB_METHOD_SHADOW_FRUSTA,
                                        UMB_METHOD_OCCLUSION_TREE};

static uint32_t wanted(void)
{
    const char *text = getenv("UMBRAGE_MICRO_SCENES"), *size = getenv("UMBRAGE_TEST_SIZE");
    if (text != NULL) {
        return (uint32_t)strtoul(text, NULL, 10);
    }
    return size != NULL && size[0] == 's' ? 40 : 150;
}

/* ---- layers --------------------------------------------------------------------------------- */

/* Masks of three bits; a fifth of all objects is in all layers. */
static uint32_t mask_of(dice *d)
{
    return dice_roll(d, 5) == 0 ? 0 : 1 + dice_roll(d, 7);
}

static bool takes(const umb_view *v, uint32_t mask)
{
    return v->mask == 0 || mask == 0 || (v->mask_all ? (mask & v->mask) == v->mask : (mask & v->mask) != 0);
}

typedef struct layered {
    uint32_t masks[MOST_OBJECTS];
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
    const umb_view *view;
} layered;

/* The scene of a model, its objects in layers. */
static void layered_make(layered *l, const micro_scene *micro, uint64_t number)
{
    umb_error error = {0};
    umb_tasks tasks = {0};
    dice d = {number};
    assert_true(micro->model->object_count <= MOST_OBJECTS);
    l->view = &micro->view;
    l->scene = model_scene(micro->model, micro->weld, tasks, NULL, &error);
    assert_non_null(l->scene);
    for (uint32_t i = 0; i < micro->model->object_count; ++i) {
        l->masks[i] = mask_of(&d);
        assert_int_equal(umb_scene_mask_object(l->scene, i, l->masks[i]), UMB_OK);
    }
    if (micro->weld) { /* again, layer by layer */
        umb_weld_stats stats;
        assert_int_equal(umb_scene_weld(l->scene, NULL, &stats), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(l->scene), UMB_OK);
}

static void layered_open(layered *l, umb_method method, const char *kind, bool unordered)
{
    umb_index_def def = {0};
    umb_culler_def culler_def = {.method = method, .unordered = unordered};
    assert_true(umb_index_parse(kind, &def));
    assert_int_equal(umb_index_create(l->scene, &def, &l->index), UMB_OK);
    assert_int_equal(umb_culler_create(l->index, &culler_def, &l->culler), UMB_OK);
}

static void layered_close(layered *l)
{
    umb_culler_destroy(l->culler);
    umb_index_destroy(l->index);
}

static umb_visible_set ask(layered *l, const umb_view *view)
{
    umb_visible_set seen;
    assert_int_equal(umb_cull(l->culler, view, &seen), UMB_OK);
    return seen;
}

/* Keeps objects by bits[i / 32]; returns how many are left of a copy that the caller frees. */
static uint32_t *keep(const umb_visible_set *seen, const uint32_t *bits, uint32_t *count)
{
    uint32_t *kept = malloc((seen->count + 1) * sizeof *kept);
    assert_non_null(kept);
    *count = 0;
    for (uint32_t i = 0; i < seen->count; ++i) {
        uint32_t id = seen->objects[i];
        kept[*count] = id;
        *count += bits[id / 32] >> id % 32 & 1u;
    }
    return kept;
}

static void assert_answer(const umb_visible_set *seen, const uint32_t *ids, uint32_t count)
{
    assert_int_equal(seen->count, count);
    assert_memory_equal(seen->objects, ids, count * sizeof *ids);
}

/* With what is left out taken away: as the view's layers say, nothing else. */
static void strip(model *m, const layered *l, const umb_view *view)
{
    for (uint32_t i = 0; i < m->object_count; ++i) {
        if (!takes(view, l->masks[i])) {
            m->objects[i].mesh = MODEL_NONE;
            m->objects[i].bounds = (umb_aabb){{0, 0, 0}, {0, 0, 0}};
        }
    }
}

static umb_view masked_view(const micro_scene *micro, uint64_t number)
{
    umb_view view = micro->view;
    view.buffer_width = 256;
    view.buffer_height = 144;
    view.mask = 1 + (uint32_t)(number % 7);
    view.mask_all = number % 3 == 0;
    return view;
}

static void check_layers(uint64_t number, strict_count sums[METHODS])
{
    static layered l;
    micro_scene micro;
    umb_error error = {0};
    assert_true(micro_scene_make(number, &micro));
    layered_make(&l, &micro, number);
    umb_view view = masked_view(&micro, number);
    uint32_t *ids[METHODS];
    strict_answer answers[METHODS];
    for (uint32_t m = 0; m < METHODS; ++m) {
        const char *kind = umb_index_variant((uint32_t)(number + 5 * m) % 20);
        layered_open(&l, ALL[m], kind, number % 2 == 0);
        umb_visible_set seen = ask(&l, &view);
        for (uint32_t i = 0; i < seen.count; ++i) {
            assert_true(takes(&view, l.masks[seen.objects[i]]));
        }
        ids[m] = malloc((seen.count + 1) * sizeof *ids[m]);
        assert_non_null(ids[m]);
        memcpy(ids[m], seen.objects, seen.count * sizeof *ids[m]);
        answers[m] = (strict_answer){ids[m], seen.count, umb_method_name(ALL[m]), &sums[m]};
        layered_close(&l);
    }
    strip(micro.model, &l, &view);
    truth *oracle = truth_create(micro.model, &error);
    assert_non_null(oracle);
    truth_options options = {.grid_width = 96, .grid_height = 96, .guided_rays = 100000, .threads = 1};
    assert_true(strict_check_all(oracle, micro.model, &view, answers, METHODS, &options));
    truth_destroy(oracle);
    for (uint32_t m = 0; m < METHODS; ++m) {
        free(ids[m]);
    }
    umb_scene_destroy(l.scene);
    micro_scene_free(&micro);
}

/* Nothing is hidden that can be seen where only the view's layers are there; and what is left in is still hidden. */
static void test_layers_strict(void **state)
{
    (void)state;
    strict_count sums[METHODS] = {{0}};
    for (uint32_t i = 0; i < wanted(); ++i) {
        check_layers(i, sums);
    }
    for (uint32_t m = 0; m < METHODS; ++m) {
        printf("# %s: reported %llu, seen %llu, wrongly hidden %llu\n", umb_method_name(ALL[m]),
               (unsigned long long)sums[m].reported, (unsigned long long)sums[m].truth_visible,
               (unsigned long long)sums[m].wrongly_hidden);
        assert_int_equal(sums[m].wrongly_hidden, 0);
        assert_true(ALL[m] == UMB_METHOD_NONE || sums[m].reported < sums[1].reported);
    }
}

/* ---- less what is left out ------------------------------------------------------------------ */

static void check_less(layered *l, const micro_scene *micro, uint64_t number, umb_method method)
{
    uint32_t bits[MOST_OBJECTS / 32 + 1] = {0}, layers[MOST_OBJECTS / 32 + 1] = {0}, n = micro->model->object_count, count;
    dice d = {number + 77};
    umb_view view = masked_view(micro, number), plain = view;
    plain.mask = 0;
    for (uint32_t i = 0; i < n; ++i) {
        bits[i / 32] |= dice_roll(&d, 2) << i % 32;
        layers[i / 32] |= (takes(&view, l->masks[i]) ? 1u : 0u) << i % 32;
    }
    umb_visible_set seen = ask(l, &plain);
    uint32_t all_count = seen.count, *by_bits = keep(&seen, bits, &count);
    uint32_t bit_count = count, *by_layers = keep(&seen, layers, &count), layer_count = count;
    view.masked_hide = true;
    seen = ask(l, &view);
    assert_answer(&seen, by_layers, layer_count);
    assert_int_equal(seen.stats.left_out, all_count - layer_count);
    assert_int_equal(umb_culler_set_candidates(l->culler, bits, n), UMB_OK);
    seen = ask(l, &plain);
    assert_answer(&seen, by_bits, bit_count);
    assert_int_equal(umb_culler_set_candidates(l->culler, bits, n / 2), UMB_OK);
    for (uint32_t i = n / 2; i < n; ++i) { /* the second half are none */
        bits[i / 32] &= ~(1u << i % 32);
    }
    umb_visible_set half = ask(l, &plain);
    assert_true(half.count <= bit_count);
    for (uint32_t i = 0, at = 0; i < bit_count; ++i) {
        if (by_bits[i] < n / 2) {
            assert_int_equal(half.objects[at++], by_bits[i]);
        }
    }
    if (method == UMB_METHOD_NONE) { /* nothing hides anyway */
        assert_int_equal(umb_culler_set_candidates(l->culler, NULL, 0), UMB_OK);
        view.masked_hide = false;
        seen = ask(l, &view);
        assert_answer(&seen, by_layers, layer_count);
        assert_int_equal(seen.stats.in_frustum, seen.count + seen.stats.small);
    }
    free(by_bits);
    free(by_layers);
}

/* Whatever hides: candidates, and layers that hide nonetheless, are taken out of the answer and change nothing else. */
static void test_less_what_is_left_out(void **state)
{
    static layered l;
    (void)state;
    for (uint32_t i = 0; i < wanted(); ++i) {
        micro_scene micro;
        assert_true(micro_scene_make(i, &micro));
        layered_make(&l, &micro, i);
        for (uint32_t m = 0; m < METHODS; ++m) {
            layered_open(&l, ALL[m], umb_index_variant((i + 3 * m) % 20), (i + m) % 4 == 0);
            check_less(&l, &micro, i, ALL[m]);
            layered_close(&l);
        }
        umb_scene_destroy(l.scene);
        micro_scene_free(&micro);
    }
}

/* ---- what hides what ------------------------------------------------------------------------ */

enum { WALL = 0, BEHIND = 1, OTHER_WALL = 2 };

typedef struct stage {
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler[METHODS];
    uint32_t curtain;
} stage;

static void stage_make(stage *s)
{
    static const float p[8][3] = {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {1, 1, -1},
                                  {-1, -1, 1},  {1, -1, 1},  {-1, 1, 1},  {1, 1, 1}};
    static const uint32_t t[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                   2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    umb_shape_def shape = {.positions = p[0], .position_count = 8, .indices = t, .index_count = 36};
    umb_shape box;
    assert_int_equal(umb_scene_create(NULL, &s->scene), UMB_OK);
    assert_int_equal(umb_scene_add_shape(s->scene, &shape, &box), UMB_OK);
    umb_object_def wall = {.shape = box,
                           .transform = {{{6, 0, 0, -6}, {0, 4, 0, 0}, {0, 0, 1, -10}}},
                           .flags = UMB_OBJECT_STATIC,
                           .mask = 2,
                           .tag = 0xFFFFFFFFu};
    umb_object_def other = wall, behind = {.shape = box, .transform = {{{1, 0, 0, -4}, {0, 1, 0, 0}, {0, 0, 1, -20}}}, .mask = 1};
    umb_object_def away = {.bounds = {{-200, 0, 0}, {-199, 1, 1}}};
    other.transform.m[0][3] = 6;
    uint32_t id;
    assert_int_equal(umb_scene_add_object(s->scene, &wall, &id), UMB_OK);
    assert_int_equal(umb_scene_add_object(s->scene, &behind, &id), UMB_OK);
    assert_int_equal(umb_scene_add_object(s->scene, &other, &id), UMB_OK);
    assert_int_equal(umb_scene_add_object(s->scene, &away, &id), UMB_OK);
    umb_transform curtain = {{{9, 0, 0, 0}, {0, 4, 0, 0}, {0, 0, 0.5f, -12}}};
    assert_int_equal(umb_scene_add_occluder(s->scene, box, &curtain, &s->curtain), UMB_OK);
    assert_int_equal(umb_scene_open_occluder(s->scene, s->curtain, true), UMB_OK);
    assert_int_equal(umb_scene_commit(s->scene), UMB_OK);
    assert_int_equal(umb_index_create(s->scene, NULL, &s->index), UMB_OK);
    for (uint32_t m = 0; m < METHODS; ++m) {
        umb_culler_def def = {.method = ALL[m]};
        assert_int_equal(umb_culler_create(s->index, &def, &s->culler[m]), UMB_OK);
    }
}

static void stage_free(stage *s)
{
    for (uint32_t m = 0; m < METHODS; ++m) {
        umb_culler_destroy(s->culler[m]);
    }
    umb_index_destroy(s->index);
    umb_scene_destroy(s->scene);
}

/* The walls and what is behind them, as bits, for all methods that hide; they agree. */
static uint32_t look(stage *s, uint32_t mask, bool hide)
{
    static const double eye[3] = {0, 0, 0}, target[3] = {0, 0, -1}, up[3] = {0, 1, 0};
    umb_view view;
    uint32_t found[METHODS] = {0};
    assert_int_equal(umb_scene_commit(s->scene), UMB_OK);
    assert_int_equal(umb_view_look_at(&view, eye, target, up, 1.0, 2, 0.1, 100), UMB_OK);
    view.mask = mask;
    view.masked_hide = hide;
    for (uint32_t m = 0; m < METHODS; ++m) {
        umb_visible_set seen;
        assert_int_equal(umb_cull(s->culler[m], &view, &seen), UMB_OK);
        for (uint32_t i = 0; i < seen.count; ++i) {
            found[m] |= 1u << seen.objects[i];
        }
        assert_true(ALL[m] == UMB_METHOD_NONE || found[m] == found[0]);
    }
    return found[0];
}

static void test_what_hides(void **state)
{
    (void)state;
    const uint32_t walls = 1u << WALL | 1u << OTHER_WALL, behind = 1u << BEHIND;
    stage s;
    stage_make(&s);
    for (int welded = 0; welded < 2; ++welded) {
        umb_weld_stats stats;
        if (welded) { /* the two walls touch: one surface */
            assert_int_equal(umb_scene_weld(s.scene, NULL, &stats), UMB_OK);
            assert_int_equal(stats.groups, 1);
        }
        assert_int_equal(look(&s, 0, false), walls);
        assert_int_equal(look(&s, 1, false), behind);
        assert_int_equal(look(&s, 1, true), 0);
        assert_int_equal(look(&s, 2, false), walls);
        assert_int_equal(look(&s, 3, false), walls);
        assert_int_equal(look(&s, 4, false), 0);
    }
    /* Masks that change dissolve the weld; what is in all layers hides in all. */
    umb_scene_stats scene_stats;
    assert_int_equal(umb_scene_mask_object(s.scene, WALL, 2), UMB_OK);
    umb_scene_get_stats(s.scene, &scene_stats);
    assert_int_equal(scene_stats.welds, 1); /* it was 2 before */
    assert_int_equal(umb_scene_mask_object(s.scene, WALL, 0), UMB_OK);
    assert_int_equal(umb_scene_mask_object(s.scene, OTHER_WALL, 0), UMB_OK);
    umb_scene_get_stats(s.scene, &scene_stats);
    assert_int_equal(scene_stats.welds, 0);
    assert_int_equal(look(&s, 1, false), walls);
    assert_int_equal(umb_scene_mask_object(s.scene, OTHER_WALL, 2), UMB_OK);
    umb_weld_stats stats;
    assert_int_equal(umb_scene_weld(s.scene, NULL, &stats), UMB_OK); /* different layers are not joined */
    assert_true(stats.groups == 0 && stats.objects == 2);
    assert_int_equal(umb_scene_mask_object(s.scene, WALL, 2), UMB_OK);
    assert_int_equal(look(&s, 1, false), behind);
    /* A curtain is in all layers until it is put into some. */
    assert_int_equal(umb_scene_open_occluder(s.scene, s.curtain, false), UMB_OK);
    assert_int_equal(look(&s, 1, false), 0);
    assert_int_equal(umb_scene_mask_occluder(s.scene, s.curtain, 2), UMB_OK);
    assert_int_equal(look(&s, 1, false), behind);
    assert_int_equal(umb_scene_mask_occluder(s.scene, s.curtain, 3), UMB_OK);
    assert_int_equal(look(&s, 1, false), 0);
    assert_int_equal(umb_scene_mask_occluder(s.scene, s.curtain + 1, 3), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_mask_object(s.scene, 99, 1), UMB_ERROR_ARGUMENT);
    stage_free(&s);
}

static void test_tags(void **state)
{
    (void)state;
    stage s;
    stage_make(&s);
    assert_int_equal(umb_scene_object_tag(s.scene, WALL), 0xFFFFFFFFu);
    assert_int_equal(umb_scene_object_tag(s.scene, BEHIND), 0);
    assert_int_equal(umb_scene_tag_object(s.scene, BEHIND, 17), UMB_OK);
    assert_int_equal(umb_scene_object_tag(s.scene, BEHIND), 17);
    assert_int_equal(umb_scene_remove_object(s.scene, BEHIND), UMB_OK);
    assert_int_equal(umb_scene_object_tag(s.scene, BEHIND), 0);
    assert_int_equal(umb_scene_tag_object(s.scene, BEHIND, 1), UMB_ERROR_ARGUMENT);
    assert_int_equal(umb_scene_object_tag(s.scene, 1000), 0);
    stage_free(&s);
}

/* ---- things that move ----------------------------------------------------------------------- */

typedef struct watcher {
    moving_town town;
    uint32_t watched; /* objects whose number is odd are in layer 2; it is told of those */
    bool culling;
} watcher;

static bool watch(void *user, uint32_t object, double time, umb_pose *out)
{
    watcher *w = user;
    w->watched += w->culling && object % 2 == 1;
    return moving_town_pose(&w->town, object, time, out);
}

/* Of movers that are left out nobody is asked, and the rest is right: at the scene's time, before and after. */
static void test_movers(void **state)
{
    (void)state;
    watcher w = {.watched = 0};
    umb_error error = {0};
    strict_count sums[METHODS] = {{0}};
    moving_town_make(&w.town, "gen:blocks,g=6");
    umb_scene *scene = moving_town_scene(&w.town, NULL, true);
    umb_pose_source source = {watch, &w};
    assert_int_equal(umb_scene_set_poses(scene, &source), UMB_OK);
    uint32_t n = w.town.model->object_count;
    for (uint32_t i = 0; i < n; ++i) {
        assert_int_equal(umb_scene_mask_object(scene, i, 1 + i % 2), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    umb_index *index;
    umb_culler *cullers[METHODS];
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    for (uint32_t m = 0; m < METHODS; ++m) {
        umb_culler_def def = {.method = ALL[m]};
        assert_int_equal(umb_culler_create(index, &def, &cullers[m]), UMB_OK);
    }
    for (uint32_t frame = 0; frame < (wanted() < 100 ? 6 : 24); ++frame) {
        double time = 0.1 * frame;
        assert_int_equal(umb_scene_set_time(scene, time), UMB_OK);
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        umb_view view = moving_town_view(&w.town, 3 * frame, time + (frame % 3 == 1 ? 2.0 : frame % 3 == 2 ? -0.05 : 0.0));
        moving_town_pose_model(&w.town, view.time);
        for (uint32_t i = 1; i < n; i += 2) { /* what is left out is not there */
            w.town.posed->objects[i].mesh = MODEL_NONE;
        }
        view.mask = 1;
        strict_answer answers[METHODS];
        for (uint32_t m = 0; m < METHODS; ++m) {
            umb_visible_set seen;
            w.culling = ALL[m] == UMB_METHOD_RASTER;
            assert_int_equal(umb_cull(cullers[m], &view, &seen), UMB_OK);
            for (uint32_t i = 0; i < seen.count; ++i) {
                assert_int_equal(seen.objects[i] % 2, 0);
            }
            answers[m] = (strict_answer){seen.objects, seen.count, umb_method_name(ALL[m]), &sums[m]};
        }
        w.culling = false;
        truth *oracle = truth_create(w.town.posed, &error);
        assert_non_null(oracle);
        truth_options options = {.grid_width = 160, .grid_height = 80, .guided_rays = 100000, .threads = 1};
        assert_true(strict_check_all(oracle, w.town.posed, &view, answers, METHODS, &options));
        truth_destroy(oracle);
        for (uint32_t i = 1; i < n; i += 2) {
            w.town.posed->objects[i].mesh = w.town.model->objects[i].mesh;
        }
    }
    assert_int_equal(w.watched, 0);
    for (uint32_t m = 0; m < METHODS; ++m) {
        assert_int_equal(sums[m].wrongly_hidden, 0);
        umb_culler_destroy(cullers[m]);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    moving_town_free(&w.town);
}

/* ---- memory --------------------------------------------------------------------------------- */

/* Candidates that find no memory change nothing; a steady frame with them allocates nothing, and all is given back. */
static void test_memory(void **state)
{
    (void)state;
    failing memory;
    umb_allocator allocator = failing_allocator(&memory, 1LL << 60);
    moving_town town;
    moving_town_make(&town, "gen:blocks,g=4");
    umb_scene *scene = moving_town_scene(&town, &allocator, false);
    umb_index *index;
    umb_culler *culler;
    umb_visible_set seen;
    umb_view view = moving_town_view(&town, 0, 0.0);
    uint32_t n = town.model->object_count, few[1] = {0xFFu}, *all = calloc(n / 32 + 1, sizeof *all);
    assert_non_null(all);
    memset(all, 0xFF, (n / 32 + 1) * sizeof *all);
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    assert_int_equal(umb_culler_create(index, NULL, &culler), UMB_OK);
    assert_int_equal(umb_culler_set_candidates(culler, few, 8), UMB_OK);
    assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
    uint32_t before = seen.count;
    atomic_store(&memory.left, 0);
    assert_int_equal(umb_culler_set_candidates(culler, all, n), UMB_ERROR_MEMORY);
    assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
    assert_int_equal(seen.count, before);
    atomic_store(&memory.left, 1LL << 60);
    assert_int_equal(umb_culler_set_candidates(culler, all, n), UMB_OK);
    atomic_store(&memory.left, 0);
    assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
    assert_true(seen.count > before);
    assert_int_equal(umb_culler_set_candidates(culler, few, 8), UMB_OK);
    assert_int_equal(umb_culler_set_candidates(culler, few, 0), UMB_OK);
    assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
    assert_int_equal(seen.count, 0);
    free(all);
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    moving_town_free(&town);
    assert_true(atomic_load(&memory.held) == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_layers_strict), cmocka_unit_test(test_less_what_is_left_out),
        cmocka_unit_test(test_what_hides),    cmocka_unit_test(test_tags),
        cmocka_unit_test(test_movers),        cmocka_unit_test(test_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

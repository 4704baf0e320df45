/* The culler's contract: steady frames allocate nothing, failing allocations do no harm, the order
 * of the visible set, indices and instruction sets agree, impossible views are refused, cullers
 * share a scene. */
#include <math.h>
#include <pthread.h>
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
#define VIEWS 48

/* ---- a scene to look at ------------------------------------------------------------------------------ */

/* The library's scene of a model, welded, with an allocator. Object ids are object numbers. */
static umb_scene *scene_of(const model *m, const umb_allocator *allocator)
{
    umb_scene *scene = NULL;
    umb_scene_def scene_def = {0};
    if (allocator != NULL) {
        scene_def.allocator = *allocator;
    }
    umb_shape *shapes = calloc((size_t)m->mesh_count + 1, sizeof *shapes);
    assert_non_null(shapes);
    assert_int_equal(umb_scene_create(&scene_def, &scene), UMB_OK);
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        const model_mesh *mesh = &m->meshes[i];
        umb_shape_def def = {.positions = mesh->positions,
                             .position_count = mesh->position_count,
                             .indices = mesh->indices,
                             .index_count = mesh->triangle_count * 3,
                             .triangle_flags = mesh->flags};
        assert_int_equal(umb_scene_add_shape(scene, &def, &shapes[i]), UMB_OK);
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        uint32_t id = UMB_NONE;
        umb_object_def def = {.shape = shapes[m->objects[i].mesh],
                              .transform = m->objects[i].transform,
                              .flags = UMB_OBJECT_STATIC | UMB_OBJECT_IS_SHAPE};
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
        assert_int_equal(id, i);
    }
    free(shapes);
    assert_int_equal(umb_scene_weld(scene, NULL, NULL), UMB_OK);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    return scene;
}

typedef struct town {
    model *model;
    umb_scene *scene;
    umb_index *index;
    umb_view views[VIEWS]; /* along the path, every third one in parallel projection */
} town;

static void town_set_up(town *t, const umb_allocator *allocator)
{
    static const char *const spec = "gen:city,triangles=20k";
    static const double up[3] = {0, 1, 0};
    umb_error error = {0};
    camera_path path;
    memset(t, 0, sizeof *t);
    t->model = model_load(spec, NULL, &error);
    assert_non_null(t->model);
    assert_true(camera_path_load(spec, &path, &error));
    for (uint32_t k = 0; k < VIEWS; ++k) {
        const double *row = path.rows[k * path.count / VIEWS];
        umb_view *view = &t->views[k];
        umb_result result = k % 3 == 2
                                ? umb_view_look_at_ortho(view, row, row + 3, up, 60, 2, 0.1, 3000)
                                : umb_view_look_at(view, row, row + 3, up, PI / 3, 2, 0.1, 3000);
        assert_int_equal(result, UMB_OK);
    }
    camera_path_free(&path);
    t->scene = scene_of(t->model, allocator);
    assert_int_equal(umb_index_create(t->scene, NULL, &t->index), UMB_OK);
}

static void town_tear_down(town *t)
{
    umb_index_destroy(t->index);
    umb_scene_destroy(t->scene);
    model_free(t->model);
}

/* FNV-1a over the ids and their inside marks, in order, byte by byte. */
static uint64_t hash_answer(uint64_t hash, const umb_visible_set *seen)
{
    for (uint32_t k = 0; k < seen->count; ++k) {
        for (int byte = 0; byte < 5; ++byte) {
            uint32_t value = byte < 4 ? seen->objects[k] >> (8 * byte) & 255u : seen->inside[k];
            hash = (hash ^ value) * 0x100000001b3u;
        }
    }
    return (hash ^ seen->count) * 0x100000001b3u;
}

static uint64_t hash_views(umb_culler *culler, const umb_view *views, uint32_t count)
{
    uint64_t hash = 0xcbf29ce484222325u;
    for (uint32_t k = 0; k < count; ++k) {
        umb_visible_set seen;
        if (umb_cull(culler, &views[k], &seen) != UMB_OK) {
            return 0;
        }
        hash = hash_answer(hash, &seen);
    }
    return hash;
}

/* ---- memory ------------------------------------------------------------------------------------------- */

static void test_steady_frames(void **state)
{
    (void)state;
    failing memory;
    umb_allocator allocator = failing_allocator(&memory, UNLIMITED);
    town t;
    umb_culler *culler = NULL;
    umb_visible_set seen;
    town_set_up(&t, &allocator);
    assert_int_equal(umb_culler_create(t.index, NULL, &culler), UMB_OK);
    /* One frame is enough: buffers have the size of the scene and the raster, whatever is seen. */
    assert_int_equal(umb_cull(culler, &t.views[0], &seen), UMB_OK);
    long long left = atomic_load(&memory.left), held = atomic_load(&memory.held);
    uint64_t hidden = 0;
    for (uint32_t frame = 0; frame < 1000; ++frame) {
        assert_int_equal(umb_cull(culler, &t.views[frame % VIEWS], &seen), UMB_OK);
        hidden += seen.stats.hidden_nodes + seen.stats.hidden_objects;
    }
    assert_true(hidden > 0);
    assert_true(atomic_load(&memory.left) == left);
    assert_true(atomic_load(&memory.held) == held);
    umb_culler_destroy(culler);
    town_tear_down(&t);
    assert_true(atomic_load(&memory.held) == 0);
}

static void test_failing_allocations(void **state)
{
    (void)state;
    failing memory;
    umb_allocator allocator = failing_allocator(&memory, UNLIMITED);
    town t;
    town_set_up(&t, &allocator);
    umb_culler *culler = NULL;
    assert_int_equal(umb_culler_create(t.index, NULL, &culler), UMB_OK);
    uint64_t wanted = hash_views(culler, t.views, 1);
    umb_culler_destroy(culler);
    long long held = atomic_load(&memory.held), limit = 0;
    uint32_t cull_failures = 0;
    for (bool done = false; !done; ++limit) {
        umb_visible_set seen;
        atomic_store(&memory.left, limit);
        umb_result result = umb_culler_create(t.index, NULL, &culler);
        assert_true(result == UMB_OK ? culler != NULL : culler == NULL);
        if (result == UMB_OK) {
            result = umb_cull(culler, &t.views[0], &seen);
            done = result == UMB_OK;
            if (!done) {
                ++cull_failures;
                assert_int_equal(seen.count, 0);
            }
            /* Whatever failed before, the next frame that finds memory is right. */
            atomic_store(&memory.left, UNLIMITED);
            assert_true(hash_views(culler, t.views, 1) == wanted);
        }
        assert_true(result == UMB_OK || result == UMB_ERROR_MEMORY);
        umb_culler_destroy(culler);
        assert_true(atomic_load(&memory.held) == held);
        assert_true(limit < 1000);
    }
    assert_true(cull_failures > 2);
    atomic_store(&memory.left, UNLIMITED);
    town_tear_down(&t);
    assert_true(atomic_load(&memory.held) == 0);
}

/* ---- what is answered --------------------------------------------------------------------------------- */

/* Least depth of the box along a direction, and what its rounding may come to. */
static double nearest_depth(const umb_view *v, const double ahead[3], const umb_aabb *box, double *slack)
{
    double depth = 0.0, size = 0.0;
    for (int i = 0; i < 3; ++i) {
        double at = ahead[i] > 0 ? box->min[i] : box->max[i];
        depth += ahead[i] * (at - v->eye[i]);
        size += fabs(at) + fabs(v->eye[i]);
    }
    *slack = 1e-5 * size;
    return depth;
}

static bool in_order(const umb_scene *scene, const umb_view *view, const double ahead[3],
                     const umb_visible_set *seen)
{
    for (uint32_t k = 1; k < seen->count; ++k) {
        umb_aabb a, b;
        double slack[2];
        assert_true(umb_scene_object_bounds(scene, seen->objects[k - 1], &a));
        assert_true(umb_scene_object_bounds(scene, seen->objects[k], &b));
        double before = nearest_depth(view, ahead, &a, &slack[0]),
               after = nearest_depth(view, ahead, &b, &slack[1]);
        if (before > after + slack[0] + slack[1]) {
            return false;
        }
        assert_true(memcmp(&a, &b, sizeof a) != 0 || seen->objects[k - 1] < seen->objects[k]);
    }
    return true;
}

/* By depth along forward, or along the level direction below it where the raster stands upright. */
static void check_order(const umb_scene *scene, umb_view view, const umb_visible_set *seen)
{
    double level[3], along = 0.0, length = 0.0;
    for (int i = 0; i < 3; ++i) {
        along += view.forward[i] * view.vertical[i];
    }
    for (int i = 0; i < 3; ++i) {
        level[i] = view.forward[i] - along * view.vertical[i];
        length += level[i] * level[i];
    }
    for (int i = 0; i < 3; ++i) {
        level[i] /= sqrt(length);
    }
    assert_true(in_order(scene, &view, view.forward, seen) || in_order(scene, &view, level, seen));
}

static void test_order(void **state)
{
    (void)state;
    town t;
    umb_culler *culler = NULL;
    town_set_up(&t, NULL);
    /* Every tenth object once more, so that there are ties. */
    uint32_t count = umb_scene_object_count(t.scene), id;
    for (uint32_t i = 0; i < count; i += 10) {
        umb_object_def def = {0};
        assert_true(umb_scene_object_bounds(t.scene, i, &def.bounds));
        assert_int_equal(umb_scene_add_object(t.scene, &def, &id), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(t.scene), UMB_OK);
    for (int method = 0; method < 2; ++method) {
        umb_culler_def def = {.method = (umb_method)method};
        assert_int_equal(umb_culler_create(t.index, &def, &culler), UMB_OK);
        for (uint32_t k = 0; k < VIEWS; ++k) {
            umb_visible_set seen;
            assert_int_equal(umb_cull(culler, &t.views[k], &seen), UMB_OK);
            assert_int_equal(seen.class_, UMB_CLASS_STRICT);
            assert_int_equal(seen.stats.visible, seen.count);
            check_order(t.scene, t.views[k], &seen);
            umb_view flat = t.views[k]; /* without a vertical: along forward */
            memset(flat.vertical, 0, sizeof flat.vertical);
            assert_int_equal(umb_cull(culler, &flat, &seen), UMB_OK);
            assert_true(in_order(t.scene, &flat, flat.forward, &seen));
        }
        umb_culler_destroy(culler);
    }
    town_tear_down(&t);
}

static int by_id(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

/* A copy of the ids, ascending. */
static uint32_t *sorted_ids(const umb_visible_set *seen)
{
    uint32_t *ids = malloc(((size_t)seen->count + 1) * sizeof *ids);
    assert_non_null(ids);
    memcpy(ids, seen->objects, seen->count * sizeof *ids);
    qsort(ids, seen->count, sizeof *ids, by_id);
    for (uint32_t k = 1; k < seen->count; ++k) {
        assert_true(ids[k - 1] < ids[k]); /* nothing is answered twice */
    }
    return ids;
}

/* One view by both indices and both methods: the frustum's answers are equal and hold the raster's,
 * and the oracle agrees with all of them. */
static void check_indices(const micro_scene *micro, umb_scene *scene, truth *oracle,
                          const umb_view *view, strict_count *sum)
{
    umb_index *indices[2];
    umb_culler *cullers[4];
    uint32_t *ids[4];
    strict_answer answers[4];
    for (int i = 0; i < 4; ++i) {
        umb_index_def index_def = {.kind = i < 2 ? UMB_INDEX_BVH : UMB_INDEX_FLAT};
        umb_culler_def def = {.method = i % 2 == 0 ? UMB_METHOD_NONE : UMB_METHOD_RASTER};
        if (i % 2 == 0) {
            assert_int_equal(umb_index_create(scene, &index_def, &indices[i / 2]), UMB_OK);
        }
        assert_int_equal(umb_culler_create(indices[i / 2], &def, &cullers[i]), UMB_OK);
        umb_visible_set seen;
        assert_int_equal(umb_cull(cullers[i], view, &seen), UMB_OK);
        ids[i] = sorted_ids(&seen);
        answers[i] = (strict_answer){ids[i], seen.count, micro->kind, sum};
    }
    assert_int_equal(answers[0].count, answers[2].count);
    assert_memory_equal(ids[0], ids[2], answers[0].count * sizeof **ids);
    for (int i = 1; i < 4; i += 2) {
        for (uint32_t k = 0; k < answers[i].count; ++k) {
            assert_non_null(bsearch(&ids[i][k], ids[0], answers[0].count, sizeof **ids, by_id));
        }
    }
    truth_options options = {.grid_width = 96, .grid_height = 96, .guided_rays = 60000};
    assert_true(strict_check_all(oracle, micro->model, view, answers, 4, &options));
    for (int i = 0; i < 4; ++i) {
        free(ids[i]);
        umb_culler_destroy(cullers[i]);
    }
    umb_index_destroy(indices[0]);
    umb_index_destroy(indices[1]);
}

/* Half-spaces that go through the picture, at all angles. */
static void cut_by_planes(umb_view *view, dice *d)
{
    view->plane_count = 1 + dice_roll(d, UMB_MAX_CLIP_PLANES);
    for (uint32_t k = 0; k < view->plane_count; ++k) {
        double at = 0.0, depth = 0.5 + dice_roll(d, 20);
        for (int i = 0; i < 3; ++i) {
            view->planes[k][i] = (double)dice_roll(d, 2001) / 1000.0 - 1.0;
        }
        for (int i = 0; i < 3; ++i) {
            at += view->planes[k][i] * (view->eye[i] + depth * view->forward[i]);
        }
        for (int i = 0; i < 4; ++i) { /* keep the eye's side or the other one, as it falls */
            view->planes[k][i] = i < 3 ? view->planes[k][i] : 0.3 * depth - at;
        }
    }
}

static void test_indices_and_planes(void **state)
{
    (void)state;
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    uint64_t count = size != NULL && size[0] == 's' ? 10 : 60;
    dice d = {11};
    strict_count plain = {0}, cut = {0};
    for (uint64_t i = 0; i < count; ++i) {
        micro_scene micro;
        umb_error error = {0};
        assert_true(micro_scene_make(20000 + i, &micro));
        umb_scene *scene = scene_of(micro.model, NULL);
        truth *oracle = truth_create(micro.model, &error);
        assert_non_null(oracle);
        check_indices(&micro, scene, oracle, &micro.view, &plain);
        cut_by_planes(&micro.view, &d);
        check_indices(&micro, scene, oracle, &micro.view, &cut);
        truth_destroy(oracle);
        umb_scene_destroy(scene);
        micro_scene_free(&micro);
    }
    printf("# seen %llu without extra planes, %llu with; wrongly hidden %llu and %llu\n",
           (unsigned long long)plain.truth_visible, (unsigned long long)cut.truth_visible,
           (unsigned long long)plain.wrongly_hidden, (unsigned long long)cut.wrongly_hidden);
    assert_int_equal(plain.wrongly_hidden + cut.wrongly_hidden, 0);
    assert_true(cut.truth_visible > 0 && cut.truth_visible < plain.truth_visible);
}

/* ---- what is refused ---------------------------------------------------------------------------------- */

static void spoil(umb_view *v, int how)
{
    switch (how) {
    case 0:
        *v = (umb_view){0};
        break;
    case 1:
        v->eye[1] = NAN;
        break;
    case 2:
        v->eye[2] = INFINITY;
        break;
    case 3:
        v->forward[0] += 0.5;
        break;
    case 4:
        v->right[2] = NAN;
        break;
    case 5:
        memcpy(v->up, v->right, sizeof v->up);
        break;
    case 6:
        v->x_max = v->x_min;
        break;
    case 7:
        v->y_min = NAN;
        break;
    case 8:
        v->near_depth = 0.0;
        break;
    case 9:
        v->near_depth = -1.0;
        break;
    case 10:
        v->far_depth = v->near_depth;
        break;
    case 11:
        v->far_depth = NAN;
        break;
    case 12:
        v->buffer_width = 8193;
        v->buffer_height = 288;
        break;
    case 13:
        v->buffer_width = 0;
        v->buffer_height = 288;
        break;
    case 14:
        v->width = 1024;
        v->height = 0;
        break;
    case 15:
        v->min_pixels = -1.0;
        break;
    case 16:
        v->min_pixels = NAN;
        break;
    case 17:
        v->plane_count = UMB_MAX_CLIP_PLANES + 1;
        break;
    case 18:
        v->plane_count = 1;
        v->planes[0][2] = NAN;
        break;
    case 19:
        v->projection = (umb_projection)7;
        break;
    default:
        v->eye[0] = 1e31;
        break;
    }
}

static void test_impossible_views(void **state)
{
    (void)state;
    town t;
    umb_error error = {0};
    umb_culler *culler = NULL;
    umb_culler_def def = {.error = &error};
    umb_visible_set seen;
    town_set_up(&t, NULL);
    assert_int_equal(umb_culler_create(t.index, &def, &culler), UMB_OK);
    for (int how = 0; how <= 20; ++how) {
        umb_view view = t.views[0];
        spoil(&view, how);
        error = (umb_error){0};
        memset(&seen, 0xff, sizeof seen);
        if (umb_cull(culler, &view, &seen) != UMB_ERROR_ARGUMENT) {
            fail_msg("impossible view %d was answered", how);
        }
        assert_int_equal(seen.count, 0);
        assert_int_equal(error.code, UMB_ERROR_ARGUMENT);
        assert_true(error.text[0] != '\0');
    }
    /* What was refused leaves nothing behind. */
    umb_culler *fresh = NULL;
    assert_int_equal(umb_culler_create(t.index, NULL, &fresh), UMB_OK);
    assert_true(hash_views(culler, t.views, VIEWS) == hash_views(fresh, t.views, VIEWS));
    umb_culler_destroy(fresh);
    umb_culler_destroy(culler);
    def.method = (umb_method)99;
    assert_int_equal(umb_culler_create(t.index, &def, &culler), UMB_ERROR_ARGUMENT);
    assert_null(culler);
    def = (umb_culler_def){.isa = (umb_isa)99, .error = &error};
    assert_int_equal(umb_culler_create(t.index, &def, &culler), UMB_ERROR_ARGUMENT);
    assert_null(culler);
    town_tear_down(&t);
}

/* ---- sameness ----------------------------------------------------------------------------------------- */

static void test_instruction_sets(void **state)
{
    (void)state;
    town t;
    uint64_t wanted = 0;
    town_set_up(&t, NULL);
    for (int isa = UMB_ISA_AUTO; isa <= UMB_ISA_NEON; ++isa) {
        if (!umb_isa_available((umb_isa)isa)) {
            continue;
        }
        umb_culler_def def = {.isa = (umb_isa)isa};
        umb_culler *culler = NULL;
        assert_int_equal(umb_culler_create(t.index, &def, &culler), UMB_OK);
        uint64_t hash = hash_views(culler, t.views, VIEWS);
        assert_true(hash != 0);
        assert_true(wanted == 0 || hash == wanted);
        wanted = hash;
        umb_culler_destroy(culler);
    }
    printf("golden culler %016llx\n", (unsigned long long)wanted);
    town_tear_down(&t);
}

typedef struct spectator {
    const town *town;
    pthread_t thread;
    uint64_t hash;
} spectator;

static void *watch(void *data)
{
    spectator *s = data;
    umb_culler *culler = NULL;
    if (umb_culler_create(s->town->index, NULL, &culler) == UMB_OK) {
        s->hash = hash_views(culler, s->town->views, VIEWS);
    }
    umb_culler_destroy(culler);
    return NULL;
}

static void test_threads(void **state)
{
    (void)state;
    enum { COUNT = 4 };
    town t;
    spectator all[COUNT + 1];
    town_set_up(&t, NULL);
    for (int i = 0; i <= COUNT; ++i) {
        all[i] = (spectator){.town = &t};
    }
    for (int i = 0; i < COUNT; ++i) {
        assert_int_equal(pthread_create(&all[i].thread, NULL, watch, &all[i]), 0);
    }
    for (int i = 0; i < COUNT; ++i) {
        assert_int_equal(pthread_join(all[i].thread, NULL), 0);
    }
    watch(&all[COUNT]);
    for (int i = 0; i < COUNT; ++i) {
        assert_true(all[i].hash != 0 && all[i].hash == all[COUNT].hash);
    }
    town_tear_down(&t);
}

static void test_contribution(void **state)
{
    (void)state;
    town t;
    umb_culler *culler = NULL;
    umb_visible_set seen;
    uint64_t all = 0, large = 0, small = 0;
    town_set_up(&t, NULL);
    assert_int_equal(umb_culler_create(t.index, NULL, &culler), UMB_OK);
    for (uint32_t k = 0; k < VIEWS; ++k) {
        umb_view view = t.views[k];
        assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
        assert_int_equal(seen.class_, UMB_CLASS_STRICT);
        assert_int_equal(seen.stats.small, 0);
        all += seen.count;
        view.min_pixels = 30;
        assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
        assert_int_equal(seen.class_, UMB_CLASS_APPROXIMATE);
        large += seen.count;
        small += seen.stats.small;
    }
    assert_true(large < all);
    assert_true(small > 0);
    umb_culler_destroy(culler);
    town_tear_down(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_steady_frames),
        cmocka_unit_test(test_failing_allocations),
        cmocka_unit_test(test_order),
        cmocka_unit_test(test_indices_and_planes),
        cmocka_unit_test(test_impossible_views),
        cmocka_unit_test(test_instruction_sets),
        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_contribution),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

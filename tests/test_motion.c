/* Scenes that move: steady frames allocate nothing, ten cullers in ten threads answer as one after
 * the other does, and a tree that was refitted ten thousand times still finds everything. */
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "io/model.h"
#include "support/failing.h"

#define PI 3.14159265358979323846
#define UNLIMITED (1LL << 60)

enum { GRID = 8, BUILDINGS = GRID * GRID, PER_BUILDING = 11, CULLERS = 10 };

/* ---- a town whose buildings move ---------------------------------------------------------------- */

typedef struct town {
    umb_scene *scene;
    umb_index *index;
    camera_path path;
    uint32_t object_count;
    dice dice;
} town;

static umb_scene *scene_of(const model *m, const umb_allocator *allocator)
{
    umb_scene *scene = NULL;
    umb_scene_def def = {.allocator = *allocator};
    umb_shape *shapes = calloc(m->mesh_count, sizeof *shapes);
    assert_non_null(shapes);
    assert_int_equal(umb_scene_create(&def, &scene), UMB_OK);
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        umb_shape_def shape = {.positions = m->meshes[i].positions,
                               .position_count = m->meshes[i].position_count,
                               .indices = m->meshes[i].indices,
                               .index_count = m->meshes[i].triangle_count * 3,
                               .triangle_flags = m->meshes[i].flags};
        assert_int_equal(umb_scene_add_shape(scene, &shape, &shapes[i]), UMB_OK);
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        uint32_t id;
        umb_object_def object = {.shape = shapes[m->objects[i].mesh],
                                 .transform = m->objects[i].transform,
                                 .flags = i % 3 == 0 ? UMB_OBJECT_IS_SHAPE : 0};
        assert_int_equal(umb_scene_add_object(scene, &object, &id), UMB_OK);
        assert_int_equal(id, i);
    }
    free(shapes);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    return scene;
}

static void town_set_up(town *t, const umb_allocator *allocator)
{
    umb_error error = {0};
    memset(t, 0, sizeof *t);
    model *m = model_load("gen:blocks,g=8", NULL, &error);
    assert_non_null(m);
    assert_true(camera_path_load("gen:blocks,g=8", &t->path, &error));
    t->scene = scene_of(m, allocator);
    t->object_count = m->object_count;
    assert_int_equal(t->object_count, BUILDINGS * PER_BUILDING);
    model_free(m);
    assert_int_equal(umb_index_create(t->scene, NULL, &t->index), UMB_OK);
}

static void town_tear_down(town *t)
{
    umb_index_destroy(t->index);
    umb_scene_destroy(t->scene);
    camera_path_free(&t->path);
}

static float sway(dice *d)
{
    return ((float)dice_roll(d, 2001) - 1000.0f) * 0.0005f;
}

/* Buildings, whose vertices are where they stand: shift and turn them a little about the origin;
 * every tenth time mirror them too. */
static void move_buildings(town *t)
{
    for (uint32_t i = 0; i < BUILDINGS; ++i) {
        float angle = 0.02f * sway(&t->dice), side = dice_roll(&t->dice, 10) == 0 ? -1.0f : 1.0f;
        umb_transform at = {{{1, 0, angle, sway(&t->dice)},
                             {0, 1, 0, 0.1f * sway(&t->dice)},
                             {-angle * side, 0, side, sway(&t->dice)}}};
        assert_int_equal(umb_scene_move_object(t->scene, i, &at, NULL), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(t->scene), UMB_OK);
}

/* Views along the path, of several projections, pictures and rasters; frame by frame nearer. */
static umb_view view_of(const town *t, uint32_t frame, uint32_t viewer)
{
    static const double up[3] = {0, 1, 0};
    static const uint32_t rasters[3][2] = {{0, 0}, {256, 144}, {640, 360}};
    const double *row = t->path.rows[(frame + 7 * viewer) % t->path.count];
    double eye[3] = {row[0] + 0.001 * (frame % 100), row[1] + 0.4 * viewer, row[2]};
    double target[3] = {row[3], row[4] - 100.0 * (viewer % 3), row[5]};
    umb_view view;
    umb_result result = viewer % 4 == 3
                            ? umb_view_look_at_ortho(&view, eye, target, up, 40, 2, 0.1, 500)
                            : umb_view_look_at(&view, eye, target, up, PI / 3, 2, 0.1, 500);
    assert_int_equal(result, UMB_OK);
    view.buffer_width = rasters[viewer % 3][0];
    view.buffer_height = rasters[viewer % 3][1];
    return view;
}

/* ---- memory ------------------------------------------------------------------------------------- */

static uint32_t frame_count(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && strcmp(size, "small") == 0 ? 500 : 10000;
}

static int by_id(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* The refitted tree finds in the frustum what a list without a tree does. */
static void check_frustum(umb_culler *tree, umb_culler *flat, const umb_view *view)
{
    static uint32_t ids[2][BUILDINGS * PER_BUILDING];
    umb_culler *cullers[2] = {tree, flat};
    uint32_t count[2];
    for (int i = 0; i < 2; ++i) {
        umb_visible_set seen;
        assert_int_equal(umb_cull(cullers[i], view, &seen), UMB_OK);
        count[i] = seen.count;
        memcpy(ids[i], seen.objects, seen.count * sizeof ids[0][0]);
        qsort(ids[i], seen.count, sizeof ids[0][0], by_id);
    }
    assert_int_equal(count[0], count[1]);
    assert_memory_equal(ids[0], ids[1], count[0] * sizeof ids[0][0]);
}

static void steady_frames(bool moving)
{
    failing memory;
    umb_allocator allocator = failing_allocator(&memory, UNLIMITED);
    town t;
    umb_index *flat = NULL;
    umb_culler *culler = NULL, *plain = NULL, *list = NULL;
    umb_visible_set seen;
    town_set_up(&t, &allocator);
    umb_index_def flat_def = {.kind = UMB_INDEX_FLAT};
    umb_culler_def none = {.method = UMB_METHOD_NONE};
    assert_int_equal(umb_index_create(t.scene, &flat_def, &flat), UMB_OK);
    assert_int_equal(umb_culler_create(t.index, NULL, &culler), UMB_OK);
    assert_int_equal(umb_culler_create(t.index, &none, &plain), UMB_OK);
    assert_int_equal(umb_culler_create(flat, &none, &list), UMB_OK);
    umb_view first = view_of(&t, 0, 1);
    assert_int_equal(umb_cull(culler, &first, &seen), UMB_OK);
    check_frustum(plain, list, &first);
    if (moving) { /* the first motion makes room for all that follows */
        move_buildings(&t);
        assert_int_equal(umb_cull(culler, &first, &seen), UMB_OK);
        check_frustum(plain, list, &first);
    }
    long long left = atomic_load(&memory.left), held = atomic_load(&memory.held);
    uint64_t hidden = 0;
    for (uint32_t frame = 0; frame < frame_count(); ++frame) {
        umb_view view = view_of(&t, frame, 1);
        if (moving) {
            move_buildings(&t);
        }
        assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
        hidden += seen.stats.hidden_nodes + seen.stats.hidden_objects;
        if (frame % 16 == 0) {
            check_frustum(plain, list, &view);
        }
    }
    assert_true(hidden > 0);
    assert_true(atomic_load(&memory.left) == left);
    assert_true(atomic_load(&memory.held) == held);
    umb_culler_destroy(culler);
    umb_culler_destroy(plain);
    umb_culler_destroy(list);
    umb_index_destroy(flat);
    town_tear_down(&t);
    assert_true(atomic_load(&memory.held) == 0);
}

static void test_steady_camera(void **state)
{
    (void)state;
    steady_frames(false);
}

static void test_steady_motion(void **state)
{
    (void)state;
    steady_frames(true);
}

/* ---- threads ------------------------------------------------------------------------------------ */

typedef struct viewer {
    const town *town;
    umb_culler *culler;
    pthread_t thread;
    float *pixels;
    size_t capacity;
    uint32_t number, round;
    uint64_t hash;
    bool failed;
} viewer;

static uint64_t hash_bytes(uint64_t hash, const void *data, size_t bytes)
{
    const unsigned char *p = data;
    for (size_t i = 0; i < bytes; ++i) {
        hash = (hash ^ p[i]) * 0x100000001b3u;
    }
    return hash;
}

/* A walk of a few views: a hash of what was seen, in order, and of the last buffer. */
static void *watch(void *data)
{
    viewer *v = data;
    for (uint32_t frame = 0; frame < 8; ++frame) {
        umb_view view = view_of(v->town, 11 * v->round + frame, v->number);
        umb_visible_set seen;
        if (umb_cull(v->culler, &view, &seen) != UMB_OK) {
            v->failed = true;
            return NULL;
        }
        v->hash = hash_bytes(v->hash, seen.objects, seen.count * sizeof seen.objects[0]);
        v->hash = hash_bytes(v->hash, seen.inside, seen.count);
    }
    uint32_t size[2];
    if (umb_culler_read_buffer(v->culler, v->pixels, v->capacity, &size[0], &size[1])) {
        v->hash = hash_bytes(v->hash, v->pixels, (size_t)size[0] * size[1] * sizeof(float));
    }
    return NULL;
}

static void make_viewers(const town *t, viewer all[CULLERS])
{
    for (uint32_t i = 0; i < CULLERS; ++i) {
        umb_culler_def def = {.method = i == 9 ? UMB_METHOD_NONE : UMB_METHOD_RASTER,
                              .isa = i % 2 ? UMB_ISA_SCALAR : UMB_ISA_AUTO};
        all[i] = (viewer){.town = t, .number = i, .capacity = (size_t)1024 * 360};
        all[i].pixels = malloc(all[i].capacity * sizeof(float));
        assert_non_null(all[i].pixels);
        assert_int_equal(umb_culler_create(t->index, &def, &all[i].culler), UMB_OK);
    }
}

static void free_viewers(viewer all[CULLERS])
{
    for (uint32_t i = 0; i < CULLERS; ++i) {
        umb_culler_destroy(all[i].culler);
        free(all[i].pixels);
    }
}

/* Everything moves, then ten threads look at once; then ten cullers of the same past look in
 * turn. */
static void test_ten_cullers(void **state)
{
    (void)state;
    umb_allocator allocator = umb_memory_allocator(NULL);
    town t;
    viewer at_once[CULLERS], in_turn[CULLERS];
    town_set_up(&t, &allocator);
    make_viewers(&t, at_once);
    make_viewers(&t, in_turn);
    for (uint32_t round = 0; round < 6; ++round) {
        if (round > 0) {
            move_buildings(&t);
        }
        for (uint32_t i = 0; i < CULLERS; ++i) {
            at_once[i].round = in_turn[i].round = round;
            assert_int_equal(pthread_create(&at_once[i].thread, NULL, watch, &at_once[i]), 0);
        }
        for (uint32_t i = 0; i < CULLERS; ++i) {
            assert_int_equal(pthread_join(at_once[i].thread, NULL), 0);
        }
        for (uint32_t i = 0; i < CULLERS; ++i) {
            uint64_t before = in_turn[i].hash;
            watch(&in_turn[i]);
            assert_false(at_once[i].failed || in_turn[i].failed);
            assert_true(at_once[i].hash == in_turn[i].hash && in_turn[i].hash != before);
        }
    }
    free_viewers(at_once);
    free_viewers(in_turn);
    town_tear_down(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_steady_camera),
        cmocka_unit_test(test_steady_motion),
        cmocka_unit_test(test_ten_cullers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* One culler over many tasks: answers, statistics and the raster itself, to the bit, are those without tasks,
 * whatever the number of workers, the order of the tasks, the instruction set, what has moved since the last frame
 * and what was numbered anew. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "cull/culler.h"
#include "io/model.h"
#include "occlusion/mesh_image.h"
#include "support/failing.h"
#include "support/micro_scenes.h"
#include "support/real_scenes.h"

#define PI 3.14159265358979323846
#define UNLIMITED (1LL << 60)

static const umb_isa isas[] = {UMB_ISA_SCALAR, UMB_ISA_SSE4, UMB_ISA_AVX2, UMB_ISA_NEON};

/* ---- what runs tasks ---------------------------------------------------------------------------- */

/* Job systems of one thread: the last task first, so that all that is guessed is ready before the walk; and the
 * first task first, so that nothing is. */
static uint32_t sequential_runs;

static void run_backwards(void *user, void (*task)(void *data, uint32_t i), void *data, uint32_t count)
{
    (void)user;
    sequential_runs += 1;
    while (count > 0) {
        task(data, --count);
    }
}

static void run_forwards(void *user, void (*task)(void *data, uint32_t i), void *data, uint32_t count)
{
    (void)user;
    sequential_runs += 1;
    for (uint32_t i = 0; i < count; ++i) {
        task(data, i);
    }
}

enum { POOLS = 4, WAYS = POOLS + 3 };

typedef struct ways {
    umb_pool *pools[POOLS];
    umb_tasks tasks[WAYS]; /* the first is none */
} ways;

static void ways_set_up(ways *w)
{
    static const uint32_t workers[POOLS] = {1, 2, 3, 8};
    memset(w, 0, sizeof *w);
    w->tasks[1] = (umb_tasks){run_backwards, NULL, 3};
    w->tasks[2] = (umb_tasks){run_forwards, NULL, 2};
    for (int i = 0; i < POOLS; ++i) {
        assert_int_equal(umb_pool_create(workers[i], &w->pools[i]), UMB_OK);
        w->tasks[3 + i] = umb_pool_tasks(w->pools[i]);
    }
}

static void ways_tear_down(ways *w)
{
    for (int i = 0; i < POOLS; ++i) {
        umb_pool_destroy(w->pools[i]);
    }
}

/* ---- what is compared --------------------------------------------------------------------------- */

static uint64_t hash_bytes(uint64_t hash, const void *data, size_t bytes)
{
    const unsigned char *p = data;
    for (size_t i = 0; i < bytes; ++i) {
        hash = (hash ^ p[i]) * 0x100000001b3u;
    }
    return hash;
}

static uint64_t hash_coverage(uint64_t hash, const umb_coverage *c)
{
    size_t tiles = (size_t)c->columns * c->rows;
    hash = hash_bytes(hash, c->tiles, tiles * sizeof *c->tiles);
    return hash_bytes(hash, c->coarse, tiles * sizeof *c->coarse);
}

static uint64_t answer(umb_culler *culler, const umb_view *view)
{
    umb_visible_set seen;
    assert_int_equal(umb_cull(culler, view, &seen), UMB_OK);
    uint64_t hash = hash_bytes(0xcbf29ce484222325u, seen.objects, seen.count * sizeof seen.objects[0]);
    hash = hash_bytes(hash, seen.inside, seen.count);
    hash = hash_bytes(hash, &seen.stats, sizeof seen.stats);
    return hash_coverage(hash, umb_culler_coverage(culler));
}

/* ---- a field of bumpy balls --------------------------------------------------------------------- */

enum { ROUND = 24, HIGH = 14, CORNERS = ROUND * HIGH, TRIANGLES = 2 * ROUND * (HIGH - 1), BALLS = 90 };

typedef struct field {
    umb_scene *scene;
    umb_index *index[2]; /* a tree and a list */
    umb_shape ball, box;
    uint32_t ids[BALLS];
    dice dice;
} field;

/* A point of the unit circle, turns around it from (1, 0): near enough evenly, and the same from every compiler
 * and library. */
static void point_at(double turns, double *c, double *s)
{
    double t = 4.0 * (turns - floor(turns)), quarter = floor(t), u = t - quarter, v = 1.0 + u * u;
    double a = (1.0 - u * u) / v, b = 2.0 * u / v;
    *c = quarter == 0.0 ? a : quarter == 1.0 ? -b : quarter == 2.0 ? -a : b;
    *s = quarter == 0.0 ? b : quarter == 1.0 ? a : quarter == 2.0 ? -b : -a;
}

static umb_shape make_ball(umb_scene *scene)
{
    static float p[CORNERS][3];
    static uint32_t t[TRIANGLES][3];
    umb_shape shape;
    for (uint32_t j = 0; j < HIGH; ++j) {
        for (uint32_t i = 0; i < ROUND; ++i) {
            double east, south, up, out, r = 1.0 + 0.2 * ((i * 7 + j * 5) % 3);
            point_at((double)i / ROUND, &east, &south);
            point_at((j + 0.5) / (2 * HIGH), &up, &out);
            p[j * ROUND + i][0] = (float)(r * out * east);
            p[j * ROUND + i][1] = (float)(r * up);
            p[j * ROUND + i][2] = (float)(-r * out * south);
        }
    }
    uint32_t n = 0;
    for (uint32_t j = 0; j + 1 < HIGH; ++j) {
        for (uint32_t i = 0; i < ROUND; ++i) {
            uint32_t k = (i + 1) % ROUND, a = j * ROUND + i, b = j * ROUND + k;
            uint32_t two[2][3] = {{a, a + ROUND, b}, {b, a + ROUND, b + ROUND}};
            memcpy(t[n], two, sizeof two);
            n += 2;
        }
    }
    umb_shape_def def = {.positions = p[0], .position_count = CORNERS, .indices = t[0], .index_count = 3 * n};
    assert_int_equal(umb_scene_add_shape(scene, &def, &shape), UMB_OK);
    return shape;
}

static umb_shape make_box(umb_scene *scene)
{
    static const float p[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    static const uint32_t t[12][3] = {{0, 2, 1}, {0, 3, 2}, {4, 5, 6}, {4, 6, 7}, {0, 1, 5}, {0, 5, 4},
                                      {3, 6, 2}, {3, 7, 6}, {0, 4, 7}, {0, 7, 3}, {1, 2, 6}, {1, 6, 5}};
    umb_shape shape;
    umb_shape_def def = {.positions = p[0], .position_count = 8, .indices = t[0], .index_count = 36};
    assert_int_equal(umb_scene_add_shape(scene, &def, &shape), UMB_OK);
    return shape;
}

static umb_transform anywhere(dice *d)
{
    double cosine, sine;
    point_at(dice_roll(d, 100) * 0.01, &cosine, &sine);
    float s = 0.5f + 0.01f * (float)dice_roll(d, 200), c = (float)cosine, n = (float)sine;
    umb_transform t = {{{s * c, 0, s * n, 0.1f * (float)dice_roll(d, 400)},
                        {0, s, 0, 0.1f * (float)dice_roll(d, 60)},
                        {-s * n, 0, s * c, 0.1f * (float)dice_roll(d, 400)}}};
    return t;
}

static void add_object(field *f, uint32_t i)
{
    umb_object_def def = {.shape = i % 5 == 0 ? f->box : f->ball,
                          .transform = anywhere(&f->dice),
                          .flags = i % 3 == 0 ? UMB_OBJECT_IS_SHAPE : 0};
    assert_int_equal(umb_scene_add_object(f->scene, &def, &f->ids[i]), UMB_OK);
}

static void field_set_up(field *f, const umb_allocator *allocator)
{
    umb_scene_def def = {0};
    if (allocator != NULL) {
        def.allocator = *allocator;
    }
    memset(f, 0, sizeof *f);
    assert_int_equal(umb_scene_create(&def, &f->scene), UMB_OK);
    f->ball = make_ball(f->scene);
    f->box = make_box(f->scene);
    for (uint32_t i = 0; i < BALLS; ++i) {
        add_object(f, i);
    }
    assert_int_equal(umb_scene_commit(f->scene), UMB_OK);
    for (int k = 0; k < 2; ++k) {
        umb_index_def index = {.kind = k == 0 ? UMB_INDEX_BVH : UMB_INDEX_FLAT};
        assert_int_equal(umb_index_create(f->scene, &index, &f->index[k]), UMB_OK);
    }
}

static void field_tear_down(field *f)
{
    umb_index_destroy(f->index[0]);
    umb_index_destroy(f->index[1]);
    umb_scene_destroy(f->scene);
}

/* Some frames move some objects; some replace one, so that occluders are numbered anew. */
static void field_change(field *f, uint32_t frame, bool replace)
{
    for (uint32_t i = frame % 4; i < BALLS && frame % 4 != 3; i += 4) {
        umb_transform t = anywhere(&f->dice);
        assert_int_equal(umb_scene_move_object(f->scene, f->ids[i], &t, NULL), UMB_OK);
    }
    if (replace && frame % 6 == 5) {
        uint32_t i = dice_roll(&f->dice, BALLS);
        assert_int_equal(umb_scene_remove_object(f->scene, f->ids[i]), UMB_OK);
        assert_int_equal(umb_scene_commit(f->scene), UMB_OK);
        add_object(f, i + (i % 5 == 0 ? 1 : 0) < BALLS ? i : 1);
    }
    assert_int_equal(umb_scene_commit(f->scene), UMB_OK);
}

static umb_view field_view(uint32_t frame)
{
    static const uint32_t rasters[4][2] = {{0, 0}, {256, 144}, {640, 360}, {1030, 77}};
    static const double up[3] = {0, 1, 0};
    double c, s;
    point_at(0.005 * frame, &c, &s);
    double eye[3] = {20 + 14 * c, 3, 20 + 14 * s}, target[3] = {20 + 5 * c * s, 2.5, 20};
    umb_view view;
    umb_result result = frame % 10 == 9 ? umb_view_look_at_ortho(&view, eye, target, up, 20, 2, 0.1, 200)
                                        : umb_view_look_at(&view, eye, target, up, PI / 3, 2, 0.1, 200);
    assert_int_equal(result, UMB_OK);
    view.buffer_width = rasters[frame / 5 % 4][0];
    view.buffer_height = rasters[frame / 5 % 4][1];
    return view;
}

static uint32_t few_or(uint32_t few, uint32_t many)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && strcmp(size, "small") == 0 ? few : many;
}

static void test_any_tasks(void **state)
{
    (void)state;
    field f;
    ways w;
    umb_culler *cullers[2][4][WAYS] = {{{0}}};
    uint64_t golden = 0;
    field_set_up(&f, NULL);
    ways_set_up(&w);
    for (int k = 0; k < 2; ++k) {
        for (int i = 0; i < 4 * WAYS; ++i) {
            umb_culler_def def = {.isa = isas[i / WAYS], .tasks = w.tasks[i % WAYS]};
            if (umb_isa_available(def.isa)) {
                assert_int_equal(umb_culler_create(f.index[k], &def, &cullers[k][i / WAYS][i % WAYS]), UMB_OK);
            }
        }
    }
    sequential_runs = 0;
    for (uint32_t frame = 0; frame < few_or(30, 60); ++frame) {
        umb_view view = field_view(frame);
        if (frame % 3 == 2) {
            field_change(&f, frame, true);
        }
        for (int k = 0; k < 2; ++k) {
            uint64_t wanted = answer(cullers[k][0][0], &view);
            golden = hash_bytes(golden, &wanted, frame < 30 ? sizeof wanted : 0);
            for (int i = 1; i < 4 * WAYS; ++i) {
                umb_culler *culler = cullers[k][i / WAYS][i % WAYS];
                if (culler != NULL && answer(culler, &view) != wanted) {
                    fail_msg("frame %u: %s index, %s, way %d differs", frame, k == 0 ? "tree" : "flat",
                             umb_isa_name(isas[i / WAYS]), i % WAYS);
                }
            }
        }
    }
    assert_true(sequential_runs > 40);
    printf("golden tasks %016llx\n", (unsigned long long)golden);
    for (int i = 0; i < 2 * 4 * WAYS; ++i) {
        umb_culler_destroy((&cullers[0][0][0])[i]);
    }
    ways_tear_down(&w);
    field_tear_down(&f);
}

/* ---- memory ------------------------------------------------------------------------------------- */

static void test_steady_frames(void **state)
{
    (void)state;
    for (int way = 1; way < WAYS; way += WAYS - 2) {
        failing memory;
        umb_allocator allocator = failing_allocator(&memory, UNLIMITED);
        field f;
        ways w;
        umb_culler *culler = NULL;
        ways_set_up(&w);
        field_set_up(&f, &allocator);
        umb_culler_def def = {.tasks = w.tasks[way]};
        assert_int_equal(umb_culler_create(f.index[0], &def, &culler), UMB_OK);
        sequential_runs = 0;
        long long left = 0, held = 0;
        for (uint32_t frame = 0; frame < few_or(60, 300); ++frame) {
            umb_view view = field_view(frame);
            if (frame == 20) { /* it has seen each size of raster */
                left = atomic_load(&memory.left);
                held = atomic_load(&memory.held);
            }
            field_change(&f, frame, false);
            (void)answer(culler, &view);
        }
        assert_true(way != 1 || sequential_runs > 30);
        assert_true(atomic_load(&memory.left) == left);
        assert_true(atomic_load(&memory.held) == held);
        umb_culler_destroy(culler);
        field_tear_down(&f);
        ways_tear_down(&w);
        assert_true(atomic_load(&memory.held) == 0);
    }
}

/* Helpers without memory do not come; nothing else changes. */
static void test_no_memory(void **state)
{
    (void)state;
    failing memory;
    umb_allocator allocator = failing_allocator(&memory, UNLIMITED);
    field f;
    umb_culler *plain = NULL, *helped = NULL;
    uint32_t refused = 0, answered = 0;
    umb_view view = field_view(0);
    field_set_up(&f, &allocator);
    assert_int_equal(umb_culler_create(f.index[0], NULL, &plain), UMB_OK);
    uint64_t wanted = answer(plain, &view);
    for (long long limit = 0; limit < 200; ++limit) {
        umb_culler_def def = {.tasks = {run_backwards, NULL, 4}};
        umb_visible_set seen;
        assert_int_equal(umb_culler_create(f.index[0], &def, &helped), UMB_OK);
        atomic_store(&memory.left, limit);
        umb_result result = umb_cull(helped, &view, &seen);
        refused += result == UMB_ERROR_MEMORY;
        answered += result == UMB_OK;
        if (result == UMB_OK) {
            assert_true(answer(helped, &view) == wanted);
        }
        atomic_store(&memory.left, UNLIMITED);
        assert_true(answer(helped, &view) == wanted);
        assert_true(answer(helped, &view) == wanted);
        umb_culler_destroy(helped);
    }
    assert_true(refused > 10 && answered > 10);
    umb_culler_destroy(plain);
    field_tear_down(&f);
    assert_true(atomic_load(&memory.held) == 0);
}

/* ---- noting and merging is drawing -------------------------------------------------------------- */

typedef struct drawing {
    umb_allocator allocator;
    umb_mesh_scratch scratch;
    umb_coverage drawn, merged;
    umb_tile_list list;
} drawing;

/* Every occluder of a small scene, one after the other, into two buffers. Returns how many tiles were noted. */
static uint64_t draw_both(drawing *d, const umb_raster_kernels *kernels, const umb_raster_map *map,
                          const umb_committed *scene)
{
    uint64_t tiles = 0;
    umb_coverage_clear(&d->drawn);
    umb_coverage_clear(&d->merged);
    for (uint32_t i = 0; i < 2 * scene->occluder_count; ++i) {
        const umb_occluder *o = &scene->occluders[i * 7u % scene->occluder_count];
        bool found[2], changed[2] = {false, false};
        for (int way = 0; way < 2; ++way) {
            kernels->approach(&d->scratch.silhouette, map, o);
            kernels->place(&d->scratch.silhouette, map);
            found[way] = umb_mesh_image_find(&d->scratch, map, o);
            if (!found[way]) {
                continue;
            }
            umb_mesh_image_list(&d->scratch, map, o);
            if (way == 0) {
                changed[0] = kernels->fill_mesh(&d->drawn, map, &d->scratch.silhouette, &d->scratch.fill);
                continue;
            }
            assert_true(kernels->list_mesh(&d->list, map, &d->scratch.silhouette, &d->scratch.fill));
            changed[1] = kernels->merge_list(&d->merged, &d->list);
            tiles += d->list.count;
        }
        assert_true(found[0] == found[1] && changed[0] == changed[1]);
        assert_true(hash_coverage(0, &d->drawn) == hash_coverage(0, &d->merged));
    }
    return tiles;
}

static void test_merging(void **state)
{
    (void)state;
    drawing d = {.allocator = umb_memory_allocator(NULL)};
    uint32_t numbers[64];
    uint64_t tiles = 0;
    for (uint32_t i = 0; i < few_or(200, 600); ++i) {
        micro_scene micro;
        umb_error error;
        double rows[256];
        umb_raster_map map;
        assert_true(micro_scene_make(i + 5000, &micro));
        umb_scene *scene = model_scene(micro.model, micro.weld, (umb_tasks){0}, NULL, &error);
        assert_non_null(scene);
        const umb_committed *committed = umb_scene_committed(scene);
        micro.view.buffer_width = 70;
        micro.view.buffer_height = 45;
        umb_raster_map_prepare(&map, &micro.view, i % 2 != 0 ? &micro.model->bounds : NULL, rows);
        assert_true(umb_mesh_scratch_reserve(&d.scratch, &d.allocator, &map, committed));
        d.scratch.structure = 0; /* the next scene is another */
        assert_true(umb_coverage_resize(&d.drawn, &d.allocator, map.width, map.height));
        assert_true(umb_coverage_resize(&d.merged, &d.allocator, map.width, map.height));
        d.list.capacity = 64;
        d.list.numbers = numbers;
        if (d.list.tiles == NULL) {
            d.list.tiles = umb_memory_allocate(&d.allocator, 64 * sizeof *d.list.tiles);
            assert_non_null(d.list.tiles);
        }
        umb_isa isa = umb_isa_available(isas[i % 4]) ? isas[i % 4] : UMB_ISA_SCALAR;
        tiles += draw_both(&d, umb_raster_kernels_get(isa), &map, committed);
        umb_scene_destroy(scene);
        micro_scene_free(&micro);
    }
    print_message("# %llu tiles merged\n", (unsigned long long)tiles);
    assert_true(tiles > 1000);
    umb_memory_free(&d.allocator, d.list.tiles, 64 * sizeof *d.list.tiles);
    umb_mesh_scratch_free(&d.scratch, &d.allocator);
    umb_coverage_free(&d.drawn, &d.allocator);
    umb_coverage_free(&d.merged, &d.allocator);
}

/* ---- generated scenes --------------------------------------------------------------------------- */

/* With frames before each, and an index of either kind, over a path. */
static void check_generated(const char *name, const char *label, const ways *w)
{
    static const double up[3] = {0, 1, 0};
    umb_error error = {0};
    umb_index *index = NULL;
    umb_culler *cullers[WAYS] = {0};
    camera_path path;
    uint64_t golden = 0;
    model *m = model_load(name, NULL, &error);
    assert_non_null(m);
    assert_true(camera_path_load(name, &path, &error));
    umb_scene *scene = model_scene(m, true, w->tasks[5], NULL, &error);
    assert_non_null(scene);
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    for (int i = 0; i < WAYS; ++i) {
        umb_culler_def def = {.tasks = w->tasks[i]};
        assert_int_equal(umb_culler_create(index, &def, &cullers[i]), UMB_OK);
    }
    for (uint32_t k = 0; k < 24; ++k) {
        const double *row = path.rows[k / 3 % path.count];
        double eye[3] = {row[0], row[1] + 0.02 * (k % 3), row[2]};
        umb_view view;
        assert_int_equal(umb_view_look_at(&view, eye, row + 3, up, PI / 3, 16.0 / 9, 0.1, 1000), UMB_OK);
        uint64_t wanted = answer(cullers[0], &view);
        golden = hash_bytes(golden, &wanted, sizeof wanted);
        for (int i = 1; i < WAYS; ++i) {
            if (answer(cullers[i], &view) != wanted) {
                fail_msg("%s frame %u: way %d differs", name, k, i);
            }
        }
    }
    printf("golden tasks_%s %016llx\n", label, (unsigned long long)golden);
    for (int i = 0; i < WAYS; ++i) {
        umb_culler_destroy(cullers[i]);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    camera_path_free(&path);
    model_free(m);
}

static void test_generated(void **state)
{
    (void)state;
    ways w;
    ways_set_up(&w);
    sequential_runs = 0;
    check_generated("gen:blocks,g=8", "blocks", &w);
    check_generated("gen:city,triangles=20k", "city", &w);
    check_generated("gen:building", "building", &w);
    ways_tear_down(&w);
}

/* ---- real levels -------------------------------------------------------------------------------- */

static void check_level(const real_scene *level, const ways *w)
{
    umb_error error = {0};
    umb_index *index = NULL;
    umb_culler *cullers[WAYS] = {0};
    camera_path path;
    model *m = model_load(level->file, NULL, &error);
    assert_non_null(m);
    assert_true(camera_path_load(level->path, &path, &error));
    umb_scene *scene = model_scene(m, true, w->tasks[4], NULL, &error);
    assert_non_null(scene);
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    for (int i = 0; i < WAYS; ++i) {
        umb_culler_def def = {.tasks = w->tasks[i]};
        assert_int_equal(umb_culler_create(index, &def, &cullers[i]), UMB_OK);
    }
    sequential_runs = 0;
    for (uint32_t k = 0; k < few_or(10, 30) && k < path.count; ++k) {
        umb_view view;
        assert_true(real_scene_view(level, m, path.rows[k], false, &view));
        uint64_t wanted = answer(cullers[0], &view);
        for (int i = 1; i < WAYS; ++i) {
            if (answer(cullers[i], &view) != wanted) {
                fail_msg("%s row %u: way %d differs", level->name, k, i);
            }
        }
    }
    assert_true(sequential_runs > 0);
    for (int i = 0; i < WAYS; ++i) {
        umb_culler_destroy(cullers[i]);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    camera_path_free(&path);
    model_free(m);
}

static void test_levels(void **state)
{
    (void)state;
    const char *folder = getenv("UMBRAGE_SCENES");
    if (folder == NULL) {
        print_message("skipped: UMBRAGE_SCENES names no folder of real scenes\n");
        skip();
    }
    real_scenes all;
    umb_error error = {0};
    ways w;
    uint32_t levels = 0;
    ways_set_up(&w);
    assert_true(real_scenes_find(folder, &all, &error));
    for (uint32_t i = 0; i < all.count && levels < 2; ++i) {
        if (all.scenes[i].level) {
            check_level(&all.scenes[i], &w);
            levels += 1;
            i += 2; /* another kind of level, if there is one */
        }
    }
    real_scenes_free(&all);
    ways_tear_down(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_any_tasks), cmocka_unit_test(test_steady_frames), cmocka_unit_test(test_no_memory),
        cmocka_unit_test(test_merging),   cmocka_unit_test(test_generated),     cmocka_unit_test(test_levels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

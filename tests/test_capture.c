/* Captured frames: what is loaded answers as what was saved, and damage is refused. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/checksum.h"
#include "cull/capture_format.h"
#include "support/failing.h"
#include "support/moving_town.h"
#include "umbrage/umbrage.h"

typedef struct frame {
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
} frame;

static umb_shape add_box_shape(umb_scene *scene, dice *d)
{
    float p[9][3];
    uint32_t t[12][3], n = 0;
    uint8_t flags[12] = {0};
    static const uint32_t faces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                         {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    for (int i = 0; i < 8; ++i) {
        for (int k = 0; k < 3; ++k) {
            p[i][k] = (float)(i >> k & 1);
        }
    }
    for (int f = 0; f < 6; ++f) {
        uint32_t x[6] = {faces[f][0], faces[f][1], faces[f][2],
                         faces[f][0], faces[f][2], faces[f][3]};
        memcpy(t[n], x, sizeof x);
        n += 2;
    }
    for (int i = 0; i < 12; ++i) { /* a few windows, a sheet or two, a flat triangle */
        flags[i] = dice_roll(d, 12) == 0  ? UMB_TRIANGLE_OPEN
                   : dice_roll(d, 8) == 0 ? UMB_TRIANGLE_TWO_SIDED
                                          : 0;
    }
    if (dice_roll(d, 3) == 0) {
        t[11][2] = t[11][1];
    }
    umb_shape_def def = {.positions = p[0],
                         .position_count = 8,
                         .indices = t[0],
                         .index_count = 36,
                         .triangle_flags = flags};
    umb_shape shape = 0;
    assert_int_equal(umb_scene_add_shape(scene, &def, &shape), UMB_OK);
    return shape;
}

static umb_transform random_place(dice *d, float reach, bool whole)
{
    umb_transform t = {{{0}}};
    for (int k = 0; k < 3; ++k) {
        t.m[k][k] = 1.0f + (float)dice_roll(d, 3);
        t.m[k][3] = whole ? (float)dice_roll(d, (uint32_t)reach)
                          : (float)dice_roll(d, 1000) * reach / 1000.0f;
        t.m[k][(k + 1) % 3] = whole ? 0.0f : (float)dice_roll(d, 100) / 100.0f;
    }
    return t;
}

/* A scene with a past: welds, holes in the ids, moved and ignored objects, occluders of its own. */
static frame make_frame(dice *d, int boxes, umb_method method, umb_index_kind kind,
                        const umb_allocator *allocator)
{
    frame f = {0};
    umb_scene_def scene_def = {.origin = {1000.0, -5.0, 0.25}};
    if (allocator != NULL) {
        scene_def.allocator = *allocator;
    }
    assert_int_equal(umb_scene_create(&scene_def, &f.scene), UMB_OK);
    umb_shape shapes[4] = {0};
    for (int i = 1; i < 4; ++i) {
        shapes[i] = add_box_shape(f.scene, d);
    }
    uint32_t id;
    for (int i = 0; i < boxes; ++i) {
        bool fixed = dice_roll(d, 3) != 0;
        umb_object_def def = {.shape = shapes[dice_roll(d, 4)],
                              .transform = random_place(d, 30.0f, fixed),
                              .flags = fixed ? UMB_OBJECT_STATIC : 0};
        def.flags |= dice_roll(d, 2) != 0 ? UMB_OBJECT_IS_SHAPE : 0;
        def.mask = dice_roll(d, 4) == 0 ? 1 + dice_roll(d, 3) : 0;
        if (def.shape == 0) {
            def.flags = 0;
            for (int k = 0; k < 3; ++k) {
                def.bounds.min[k] = (float)dice_roll(d, 30);
                def.bounds.max[k] = def.bounds.min[k] + 1.0f;
            }
        }
        assert_int_equal(umb_scene_add_object(f.scene, &def, &id), UMB_OK);
    }
    for (int i = 0; i < 3; ++i) {
        umb_transform t = random_place(d, 30.0f, false);
        assert_int_equal(umb_scene_add_occluder(f.scene, shapes[1 + dice_roll(d, 3)], &t, &id),
                         UMB_OK);
        assert_int_equal(umb_scene_mask_occluder(f.scene, id, dice_roll(d, 4)), UMB_OK);
    }
    umb_weld_def weld = {.cluster_triangles = 40};
    assert_int_equal(umb_scene_weld(f.scene, &weld, NULL), UMB_OK);
    assert_int_equal(umb_scene_remove_object(f.scene, (uint32_t)boxes / 2), UMB_OK);
    assert_int_equal(umb_scene_flag_object(f.scene, (uint32_t)boxes / 3, UMB_OBJECT_IGNORED),
                     UMB_OK);
    assert_int_equal(umb_scene_commit(f.scene), UMB_OK);
    umb_index_def index_def = {.kind = kind};
    assert_int_equal(umb_index_create(f.scene, &index_def, &f.index), UMB_OK);
    for (int i = 0; i < boxes / 4; ++i) {
        umb_aabb box;
        uint32_t object = dice_roll(d, (uint32_t)boxes);
        umb_transform t = random_place(d, 30.0f, false);
        if (umb_scene_object_bounds(f.scene, object, &box)) {
            (void)umb_scene_move_object(f.scene, object, &t, NULL); /* some have no shape: refused */
        }
    }
    assert_int_equal(umb_scene_commit(f.scene), UMB_OK);
    umb_culler_def culler_def = {.method = method};
    assert_int_equal(umb_culler_create(f.index, &culler_def, &f.culler), UMB_OK);
    return f;
}

static void free_frame(frame *f)
{
    umb_culler_destroy(f->culler);
    umb_index_destroy(f->index);
    umb_scene_destroy(f->scene);
}

static umb_view random_view(dice *d)
{
    umb_view v;
    double eye[3], target[3];
    static const double up[3] = {0, 0, 1};
    for (int k = 0; k < 3; ++k) {
        eye[k] = (double)dice_roll(d, 3400) / 100.0 - 2.0;
        target[k] = (double)dice_roll(d, 3000) / 100.0;
    }
    if (dice_roll(d, 4) == 0) {
        assert_int_equal(umb_view_look_at_ortho(&v, eye, target, up, 20.0, 1.5, 0.0, 100.0), UMB_OK);
    } else {
        assert_int_equal(umb_view_look_at(&v, eye, target, up, 1.2, 1.5, 0.1, INFINITY), UMB_OK);
    }
    v.buffer_width = 256;
    v.buffer_height = 96;
    if (dice_roll(d, 4) == 0) {
        v.plane_count = 1;
        v.planes[0][0] = 1.0;
        v.planes[0][3] = -10.0;
    }
    v.min_pixels = dice_roll(d, 4) == 0 ? 3.0 : 0.0;
    v.time = 12.5;
    v.mask = dice_roll(d, 4);
    v.mask_all = dice_roll(d, 2) == 0;
    v.masked_hide = dice_roll(d, 2) == 0;
    return v;
}

static uint8_t *save(const umb_culler *culler, size_t *size)
{
    assert_int_equal(umb_capture_save(culler, NULL, 0, size), UMB_OK);
    uint8_t *bytes = malloc(*size);
    assert_non_null(bytes);
    size_t again = 0;
    assert_int_equal(umb_capture_save(culler, bytes, *size - 1, &again), UMB_ERROR_ARGUMENT);
    assert_int_equal(again, *size);
    assert_int_equal(umb_capture_save(culler, bytes, *size, &again), UMB_OK);
    assert_int_equal(again, *size);
    return bytes;
}

static void test_round_trip(void **state)
{
    (void)state;
    dice d = {41};
    umb_tasks none = {0};
    uint32_t answered = 0, hidden = 0;
    for (int round = 0; round < 24; ++round) {
        umb_index_kind kind = round % 3 == 2 ? UMB_INDEX_FLAT : UMB_INDEX_BVH;
        umb_method method = round % 4 == 3 ? UMB_METHOD_NONE : UMB_METHOD_RASTER;
        frame f = make_frame(&d, 20 + (int)dice_roll(&d, 150), method, kind, NULL);
        for (int k = 0; k < 3; ++k) {
            umb_view view = random_view(&d);
            uint32_t few[3] = {0xFFFF00FFu, 0x0FFF7FFFu, 0xFFFFFFFFu};
            assert_int_equal(umb_culler_set_candidates(f.culler, k == 1 ? few : NULL, k == 1 ? 70 : 0), UMB_OK);
            umb_visible_set seen, again;
            assert_int_equal(umb_cull(f.culler, &view, &seen), UMB_OK);
            size_t size, size_again;
            uint8_t *bytes = save(f.culler, &size);
            umb_capture c;
            umb_error error = {0};
            assert_int_equal(umb_capture_load(bytes, size, UMB_ISA_AUTO, none, &c, &error), UMB_OK);
            assert_int_equal(c.method, method);
            assert_int_equal(c.index_def.kind, kind);
            assert_int_equal(c.answer_count, seen.count);
            assert_memory_equal(c.answer, seen.objects, seen.count * sizeof *c.answer);
            assert_int_equal(umb_cull(c.culler, &c.view, &again), UMB_OK);
            assert_int_equal(again.count, seen.count);
            assert_memory_equal(again.objects, seen.objects, seen.count * sizeof *c.answer);
            assert_int_equal(again.stats.occluders, seen.stats.occluders);
            assert_int_equal(again.stats.hidden_objects, seen.stats.hidden_objects);
            answered += seen.count;
            hidden += seen.stats.hidden_objects + seen.stats.hidden_nodes;
            /* A capture of the capture is the same, byte for byte. */
            uint8_t *bytes_again = save(c.culler, &size_again);
            assert_int_equal(size_again, size);
            assert_memory_equal(bytes_again, bytes, size);
            free(bytes);
            free(bytes_again);
            umb_capture_free(&c);
            assert_null(c.scene);
        }
        free_frame(&f);
    }
    assert_true(answered > 500 && hidden > 40);
}

/* ---- things that move by themselves -------------------------------------------------------------- */

static const umb_method METHODS[5] = {UMB_METHOD_RASTER, UMB_METHOD_NONE, UMB_METHOD_PLANES, UMB_METHOD_SHADOW_FRUSTA,
                                      UMB_METHOD_OCCLUSION_TREE};

/* Some answers of it are not known. */
static bool pose_or_nothing(void *user, uint32_t object, double time, umb_pose *out)
{
    return object % 29 != 4 && moving_town_pose(user, object, time, out);
}

typedef struct motion_frame {
    moving_town town;
    umb_scene *scene;
    umb_index *index;
    umb_culler *cullers[5];
} motion_frame;

static void motion_make(motion_frame *m, const char *spec, const char *kind)
{
    umb_index_def def = {0};
    moving_town_make(&m->town, spec);
    for (uint32_t i = 0; i < m->town.model->object_count; ++i) {
        m->town.motions[i].fuzzy = i % 17 == 3;
    }
    m->scene = moving_town_scene(&m->town, NULL, true);
    umb_pose_source source = {pose_or_nothing, &m->town};
    assert_int_equal(umb_scene_set_poses(m->scene, &source), UMB_OK);
    assert_true(umb_index_parse(kind, &def));
    assert_int_equal(umb_index_create(m->scene, &def, &m->index), UMB_OK);
    for (int k = 0; k < 5; ++k) {
        umb_culler_def culler_def = {.method = METHODS[k]};
        assert_int_equal(umb_culler_create(m->index, &culler_def, &m->cullers[k]), UMB_OK);
    }
}

static void motion_free(motion_frame *m)
{
    for (int k = 0; k < 5; ++k) {
        umb_culler_destroy(m->cullers[k]);
    }
    umb_index_destroy(m->index);
    umb_scene_destroy(m->scene);
    moving_town_free(&m->town);
}

/* Objects stop, go, begin to move again: movers' numbers have holes. */
static void motion_edit(motion_frame *m, uint32_t round)
{
    uint32_t object = 7 * round % m->town.model->object_count;
    if (m->town.moves[object] && round % 3 == 1) {
        assert_int_equal(umb_scene_set_motion(m->scene, object, round % 2 ? NULL : &m->town.motions[object]), UMB_OK);
    }
    assert_int_equal(umb_scene_set_time(m->scene, 0.1 * round), UMB_OK);
    assert_int_equal(umb_scene_commit(m->scene), UMB_OK);
}

static void check_again(const umb_culler *culler, const umb_visible_set *seen)
{
    umb_tasks none = {0};
    umb_capture c;
    umb_visible_set again;
    umb_error error = {0};
    size_t size, size_again;
    uint8_t *bytes = save(culler, &size);
    assert_int_equal(umb_capture_load(bytes, size, UMB_ISA_AUTO, none, &c, &error), UMB_OK);
    assert_int_equal(c.answer_count, seen->count);
    assert_int_equal(umb_cull(c.culler, &c.view, &again), UMB_OK);
    assert_int_equal(again.count, seen->count);
    assert_memory_equal(again.objects, seen->objects, seen->count * sizeof *c.answer);
    assert_memory_equal(again.inside, seen->inside, seen->count);
    assert_int_equal(again.class_, seen->class_);
    assert_int_equal(again.stats.occluders, seen->stats.occluders);
    assert_int_equal(again.stats.hidden_movers, seen->stats.hidden_movers);
    uint8_t *bytes_again = save(c.culler, &size_again);
    if (c.index_def.kind != UMB_INDEX_KDTREE) { /* when all parts are wholes again, the loaded one needs no boxes */
        assert_int_equal(size_again, size);
        assert_memory_equal(bytes_again, bytes, size);
    }
    free(bytes);
    free(bytes_again);
    umb_view later = c.view; /* nothing is known of another time: all that moves is reported, or out of sight */
    later.time += 100.0;
    assert_int_equal(umb_cull(c.culler, &later, &again), UMB_OK);
    assert_int_equal(umb_scene_set_time(c.scene, later.time), UMB_OK);
    assert_int_equal(umb_scene_commit(c.scene), UMB_OK);
    assert_int_equal(umb_cull(c.culler, &later, &again), UMB_OK);
    umb_capture_free(&c);
}

/* Frames in the middle of a motion are answered again: at the scene's time, before it and after, when volumes have
 * expired. */
static void test_motion(void **state)
{
    (void)state;
    static const char *const kinds[4] = {"bvh", "flat", "kdtree,median", "kdtree,median"};
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    uint32_t poses = 0, expired = 0;
    for (int i = 0; i < 4; ++i) {
        motion_frame m;
        motion_make(&m, i < 3 ? "gen:blocks,g=5" : "gen:blocks,g=1", kinds[i]);
        for (uint32_t round = 0; round < (size != NULL && size[0] == 's' ? 15u : 60u); ++round) {
            motion_edit(&m, round);
            double shift = round % 3 == 0 ? 0.0 : round % 3 == 1 ? 1.5 : -0.3;
            umb_view view = moving_town_view(&m.town, round, 0.1 * round + shift);
            view.min_pixels = round % 5 == 4 ? 2.0 : 0.0;
            for (int k = 0; k < 5; ++k) {
                umb_visible_set seen;
                assert_int_equal(umb_cull(m.cullers[k], &view, &seen), UMB_OK);
                poses += seen.stats.poses;
                expired += seen.stats.expired;
                if (round % 5 == (uint32_t)k || round % 7 == 3) {
                    check_again(m.cullers[k], &seen);
                }
            }
        }
        size_t bytes; /* a commit takes what was told */
        assert_int_equal(umb_scene_commit(m.scene), UMB_OK);
        assert_int_equal(umb_capture_save(m.cullers[0], NULL, 0, &bytes), UMB_ERROR_STATE);
        motion_free(&m);
    }
    assert_true(poses > 1000 && expired > 100);
}

static void test_nothing_to_save(void **state)
{
    (void)state;
    dice d = {42};
    frame f = make_frame(&d, 20, UMB_METHOD_RASTER, UMB_INDEX_BVH, NULL);
    size_t size = 7;
    assert_int_equal(umb_capture_save(f.culler, NULL, 0, &size), UMB_ERROR_STATE);
    assert_int_equal(size, 0);
    umb_view first = random_view(&d);
    umb_visible_set answer;
    assert_int_equal(umb_cull(f.culler, &first, &answer), UMB_OK);
    assert_int_equal(umb_capture_save(f.culler, NULL, 0, &size), UMB_OK);
    assert_int_equal(umb_scene_remove_object(f.scene, 1), UMB_OK);
    assert_int_equal(umb_capture_save(f.culler, NULL, 0, &size), UMB_OK); /* not committed yet */
    assert_int_equal(umb_scene_commit(f.scene), UMB_OK);
    assert_int_equal(umb_capture_save(f.culler, NULL, 0, &size), UMB_ERROR_STATE);
    free_frame(&f);
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
    umb_visible_set seen;
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    assert_int_equal(umb_culler_create(index, NULL, &culler), UMB_OK);
    umb_view view = random_view(&d);
    assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
    uint8_t *bytes = save(culler, &size); /* nothing in the scene */
    umb_capture c;
    umb_tasks none = {0};
    assert_int_equal(umb_capture_load(bytes, size, UMB_ISA_SCALAR, none, &c, NULL), UMB_OK);
    assert_int_equal(c.answer_count, 0);
    umb_capture_free(&c);
    umb_capture_free(NULL);
    free(bytes);
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

static void set_checksum(uint8_t *bytes, size_t size)
{
    uint64_t sum = umb_checksum(bytes + UMB_CAPTURE_TABLE, size - UMB_CAPTURE_TABLE);
    for (int i = 0; i < 8; ++i) {
        bytes[24 + i] = (uint8_t)(sum >> (8 * i));
    }
}

/* Every bit of damage is noticed, and damage that is signed with a right checksum does no harm. */
static void check_damage(const umb_culler *culler, size_t step)
{
    dice d = {43};
    umb_tasks none = {0};
    umb_visible_set seen;
    size_t size;
    uint8_t *bytes = save(culler, &size);
    umb_capture c;
    umb_error error = {0};
    for (size_t i = 0; i < size; i += step) {
        uint8_t right = bytes[i];
        bytes[i] ^= (uint8_t)(1u << dice_roll(&d, 8));
        umb_result result = umb_capture_load(bytes, size, UMB_ISA_AUTO, none, &c, &error);
        assert_true(result == UMB_ERROR_FORMAT || (result == UMB_ERROR_VERSION && i >= 8 && i < 12));
        assert_null(c.scene);
        assert_true(strlen(error.text) > 0);
        bytes[i] = right;
    }
    for (size_t cut = 0; cut < size; cut += step) {
        uint8_t *part = malloc(cut + 1);
        assert_non_null(part);
        memcpy(part, bytes, cut);
        assert_int_equal(umb_capture_load(part, cut, UMB_ISA_AUTO, none, &c, &error),
                         UMB_ERROR_FORMAT);
        free(part);
    }
    assert_int_equal(umb_capture_load(NULL, 0, UMB_ISA_AUTO, none, &c, &error), UMB_ERROR_FORMAT);
    uint8_t *copy = malloc(size);
    assert_non_null(copy);
    for (size_t i = UMB_CAPTURE_TABLE; i < size; i += step) {
        memcpy(copy, bytes, size);
        copy[i] = (uint8_t)(dice_roll(&d, 2) != 0 ? copy[i] + 1u : dice_roll(&d, 256));
        set_checksum(copy, size);
        if (umb_capture_load(copy, size, UMB_ISA_AUTO, none, &c, &error) == UMB_OK) {
            if (c.view.buffer_width <= 512 && c.view.buffer_height <= 512) {
                (void)umb_cull(c.culler, &c.view, &seen);
            }
            umb_capture_free(&c);
        }
    }
    free(copy);
    free(bytes);
}

static void test_damage(void **state)
{
    (void)state;
    dice d = {43};
    frame f = make_frame(&d, 12, UMB_METHOD_RASTER, UMB_INDEX_BVH, NULL);
    umb_view view = random_view(&d);
    umb_visible_set seen;
    assert_int_equal(umb_cull(f.culler, &view, &seen), UMB_OK);
    check_damage(f.culler, 1);
    free_frame(&f);
    motion_frame m;
    motion_make(&m, "gen:blocks,g=5", "bvh");
    for (uint32_t round = 0; round < 5; ++round) {
        motion_edit(&m, round);
        view = moving_town_view(&m.town, round, 0.1 * round);
        assert_int_equal(umb_cull(m.cullers[0], &view, &seen), UMB_OK);
    }
    check_damage(m.cullers[0], 61);
    motion_free(&m);
}

static void test_isa(void **state)
{
    (void)state;
    dice d = {44};
    umb_tasks none = {0};
    frame f = make_frame(&d, 12, UMB_METHOD_RASTER, UMB_INDEX_BVH, NULL);
    umb_view view = random_view(&d);
    umb_visible_set seen;
    assert_int_equal(umb_cull(f.culler, &view, &seen), UMB_OK);
    size_t size;
    uint8_t *bytes = save(f.culler, &size);
    umb_capture c;
    for (int isa = UMB_ISA_AUTO; isa <= UMB_ISA_NEON; ++isa) {
        umb_error error = {0};
        umb_result result = umb_capture_load(bytes, size, (umb_isa)isa, none, &c, &error);
        assert_int_equal(result, umb_isa_available((umb_isa)isa) ? UMB_OK : UMB_ERROR_ARGUMENT);
        umb_capture_free(&c);
    }
    free(bytes);
    free_frame(&f);
}

static void test_failing_memory(void **state)
{
    (void)state;
    dice d = {45};
    failing memory;
    umb_allocator a = failing_allocator(&memory, INT64_MAX);
    frame f = make_frame(&d, 20, UMB_METHOD_RASTER, UMB_INDEX_BVH, &a);
    umb_view view = random_view(&d);
    umb_visible_set seen;
    assert_int_equal(umb_cull(f.culler, &view, &seen), UMB_OK);
    umb_result result = UMB_ERROR_MEMORY;
    for (long long limit = 0; result != UMB_OK; ++limit) {
        assert_true(limit < 10);
        long long held = atomic_load(&memory.held);
        atomic_store(&memory.left, limit);
        size_t size;
        result = umb_capture_save(f.culler, NULL, 0, &size);
        assert_true(result == UMB_OK || result == UMB_ERROR_MEMORY);
        assert_int_equal(atomic_load(&memory.held), held);
    }
    atomic_store(&memory.left, INT64_MAX);
    free_frame(&f);
    assert_int_equal(atomic_load(&memory.held), 0);
}

static void test_checksum(void **state)
{
    (void)state;
    assert_true(umb_checksum("", 0) == 0xEF46DB3751D8E999u);
    assert_true(umb_checksum("a", 1) == 0xD24EC4F1A98C6E5Bu);
    assert_true(umb_checksum("abc", 3) == 0x44BC2CF5AD770999u);
    assert_true(umb_checksum("Nobody inspects the spammish repetition", 39) == 0xFBCEA83C8A378BF1u);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_checksum),
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_motion),
        cmocka_unit_test(test_nothing_to_save),
        cmocka_unit_test(test_damage),
        cmocka_unit_test(test_isa),
        cmocka_unit_test(test_failing_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* The buffer's invariant, by brute force: every point of a covered pixel is blocked by a triangle
 * of an occluder, beyond the near depth, nearer than the bound of its sub-tile. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/isa.h"
#include "occlusion/method.h"
#include "occlusion/raster_map.h"
#include "scene/scene.h"
#include "support/micro_scenes.h"

static const umb_isa isas[] = {UMB_ISA_SCALAR, UMB_ISA_SSE4, UMB_ISA_AVX2, UMB_ISA_NEON};

typedef struct point {
    long double x, y, z;
} point;

static point minus(point a, point b)
{
    point r = {a.x - b.x, a.y - b.y, a.z - b.z};
    return r;
}

static long double dot(point a, point b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static point cross(point a, point b)
{
    point r = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    return r;
}

static point from_vec(umb_vec3 v)
{
    point p = {v.x, v.y, v.z};
    return p;
}

/* View depth at which the line from, along, meets the front of a triangle; false if it does not.
 * along gains 1 of view depth per unit. */
static bool meets(point from, point along, const point t[3], bool two_sided, long double *depth)
{
    point n = cross(minus(t[1], t[0]), minus(t[2], t[0]));
    long double facing = dot(n, along);
    if (facing == 0 || (facing > 0 && !two_sided)) {
        return false;
    }
    long double s = dot(n, minus(t[0], from)) / facing;
    point hit = {from.x + s * along.x, from.y + s * along.y, from.z + s * along.z};
    for (int i = 0; i < 3; ++i) {
        point side = cross(minus(t[(i + 1) % 3], t[i]), minus(hit, t[i]));
        if (dot(side, n) < 0) {
            return false;
        }
    }
    *depth = s;
    return true;
}

/* Nearest blocking depth beyond near along the line through a raster point; INFINITY if none. */
static long double blocked_at(const umb_raster_map *map, const model *m, long double px,
                              long double py)
{
    point along, from = from_vec(map->eye), ray_x = from_vec(map->ray_x),
                 ray_y = from_vec(map->ray_y);
    point ray = from_vec(map->ray_0);
    ray.x += px * ray_x.x + py * ray_y.x;
    ray.y += px * ray_x.y + py * ray_y.y;
    ray.z += px * ray_x.z + py * ray_y.z;
    along = ray;
    if (map->orthographic) {
        from.x += ray.x;
        from.y += ray.y;
        from.z += ray.z;
        along = from_vec(map->ray_w);
    }
    long double nearest = INFINITY;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        const model_object *o = &m->objects[i];
        const model_mesh *mesh = &m->meshes[o->mesh];
        for (uint32_t k = 0; k < mesh->triangle_count; ++k) {
            point t[3];
            for (int c = 0; c < 3; ++c) {
                float v[3];
                model_world_vertex(m, o, mesh->indices[3 * k + (uint32_t)c], v);
                int at = model_mirrored(o) ? 2 - c : c;
                t[at] = (point){v[0], v[1], v[2]};
            }
            long double depth;
            if ((mesh->flags[k] & UMB_TRIANGLE_OPEN) == 0 &&
                meets(from, along, t, (mesh->flags[k] & UMB_TRIANGLE_TWO_SIDED) != 0, &depth) &&
                depth >= map->near_cut && depth < nearest) {
                nearest = depth;
            }
        }
    }
    return nearest;
}

static double unit(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) * 0x1p-53;
}

static uint64_t check_buffer(const umb_raster_map *map, const umb_coverage *b, const model *m,
                             uint64_t seed)
{
    uint64_t covered = 0;
    for (uint32_t y = 0; y < map->height; ++y) {
        for (uint32_t x = 0; x < map->width; ++x) {
            const umb_tile *t = &b->tiles[y / 8 * b->columns + x / 32];
            if ((t->mask[y % 8] >> (x % 32) & 1u) == 0) {
                continue;
            }
            covered += 1;
            double corner_x = unit(&seed), corner_y = unit(&seed);
            double fx = corner_x < 0.3 ? 1e-6 : corner_x > 0.7 ? 1 - 1e-6 : corner_x;
            double fy = corner_y < 0.3 ? 1e-6 : corner_y > 0.7 ? 1 - 1e-6 : corner_y;
            double top = map->rows.edge[y], high = map->rows.edge[y + 1] - top;
            long double depth = blocked_at(map, m, x + fx, top + fy * high);
            long double z = t->z[4 * (y % 8 / 4) + x % 32 / 8];
            bool ok = map->orthographic ? -depth > z : 1.0L / depth > z;
            if (depth == INFINITY || !ok) {
                fail_msg("seed %llu pixel %u,%u: depth %Lg, bound %Lg", (unsigned long long)seed, x,
                         y, depth, z);
            }
        }
    }
    return covered;
}

/* The box that an occluder is, as a walk has it; NULL for others. */
static const umb_aabb *box_of(const umb_committed *c, uint32_t occluder)
{
    uint32_t owner = c->occluders[occluder].owner;
    return owner != UMB_NONE && c->objects[owner].box ? &c->objects[owner].bounds : NULL;
}

static void test_invariant(void **state)
{
    (void)state;
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    uint32_t scenes = size != NULL && size[0] == 's' ? 30 : 120;
    uint64_t covered = 0;
    for (uint32_t i = 0; i < scenes; ++i) {
        micro_scene micro;
        assert_true(micro_scene_make(i + 1000, &micro));
        umb_error error;
        umb_tasks tasks = {0};
        umb_scene *scene = model_scene(micro.model, micro.weld, tasks, NULL, &error);
        assert_non_null(scene);
        micro.view.buffer_width = 70;
        micro.view.buffer_height = 45;
        umb_raster_map map;
        double rows[53];
        umb_raster_map_prepare(&map, &micro.view, i % 2 != 0 ? &micro.model->bounds : NULL, rows);
        const umb_committed *committed = umb_scene_committed(scene);
        void *raster;
        umb_cull_stats stats = {0};
        assert_int_equal(umb_raster_method.create(umb_scene_allocator(scene), umb_isa_available(isas[i % 4]) ? isas[i % 4] : UMB_ISA_SCALAR,
                                                   &raster), UMB_OK);
        assert_int_equal(umb_raster_method.prepare(raster, &map, committed), UMB_OK);
        for (uint32_t k = 0; k < committed->occluder_count; ++k) {
            (void)umb_raster_method.occlude(raster, k, box_of(committed, k), &stats);
        }
        covered += check_buffer(&map, umb_raster_method.buffer(raster), micro.model, i);
        umb_raster_method.destroy(raster);
        umb_scene_destroy(scene);
        micro_scene_free(&micro);
    }
    printf("# %llu covered pixels checked\n", (unsigned long long)covered);
    assert_true(covered > scenes * 100u);
}

static double between(uint64_t *state, double low, double high)
{
    return low + (high - low) * unit(state);
}

/* Boxes along the axes: some mirrored, some flat, some around the eye. */
static model *random_boxes(uint64_t *seed)
{
    float p[24];
    uint32_t indices[36] = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                            2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};
    uint8_t flags[12] = {0};
    for (int k = 0; k < 24; ++k) {
        p[k] = (float)(k / 3 >> k % 3 & 1);
    }
    model *m = model_create();
    uint32_t mesh = model_add_mesh(m, &(model_mesh){p, indices, flags, 8, 12});
    uint32_t count = 1 + (uint32_t)(unit(seed) * 4);
    for (uint32_t i = 0; i < count; ++i) {
        umb_transform t = {{{0}}};
        for (int axis = 0; axis < 3; ++axis) {
            double size = between(seed, 0.05, 3.0), kind = unit(seed);
            size = kind < 0.05 ? 0.0 : kind < 0.15 ? 1e-4 : kind < 0.25 ? 20.0 : size;
            t.m[axis][axis] = (float)(unit(seed) < 0.2 ? -size : size);
            t.m[axis][3] = (float)between(seed, -4.0, 4.0);
        }
        assert_true(model_add_object(m, "box", mesh, &t) != MODEL_NONE);
    }
    assert_true(model_finish(m, NULL, NULL));
    return m;
}

/* The eye: anywhere, on the plane of a face, in a corner. */
static umb_view random_view(const model *m, uint64_t *seed)
{
    const umb_aabb *b = &m->objects[0].bounds;
    double eye[3], target[3], up[3] = {0, 0, 0}, kind = unit(seed);
    umb_view view;
    for (int axis = 0; axis < 3; ++axis) {
        eye[axis] = between(seed, -9.0, 9.0);
        target[axis] = 0.5 * ((double)b->min[axis] + b->max[axis]) + between(seed, -1.0, 1.0);
        if (kind < 0.2 && unit(seed) < 0.6) {
            eye[axis] = unit(seed) < 0.5 ? b->min[axis] : b->max[axis];
        }
    }
    up[(int)(unit(seed) * 3)] = unit(seed) < 0.5 ? 1.0 : -1.0;
    double near_depth = unit(seed) < 0.3 ? 1.0 : 1e-3;
    assert_int_equal(umb_view_look_at(&view, eye, target, up, between(seed, 0.3, 2.0), 1.5, near_depth, 100.0), UMB_OK);
    if (unit(seed) < 0.4) {
        view.vertical[0] = view.vertical[1] = view.vertical[2] = 0.0; /* the screen's own raster */
    }
    if (unit(seed) < 0.3) {
        for (int axis = 0; axis < 3; ++axis) {
            view.right[axis] = -view.right[axis]; /* left-handed */
        }
    }
    view.buffer_width = 70;
    view.buffer_height = 45;
    return view;
}

static uint64_t draw_all(void *raster, const umb_committed *c, bool boxes)
{
    umb_cull_stats stats = {0};
    uint64_t as_boxes = 0;
    for (uint32_t k = 0; k < c->occluder_count; ++k) {
        as_boxes += box_of(c, k) != NULL;
        (void)umb_raster_method.occlude(raster, k, boxes ? box_of(c, k) : NULL, &stats);
    }
    return as_boxes;
}

/* Boxes by themselves cover what they cover as meshes, within what errors move, and nothing that is open. */
static void test_boxes(void **state)
{
    (void)state;
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    uint32_t scenes = size != NULL && size[0] == 's' ? 400 : 4000;
    uint64_t covered = 0, as_meshes = 0, boxes = 0;
    for (uint32_t i = 0; i < scenes; ++i) {
        uint64_t seed = i * 77u + 5u;
        umb_error error;
        model *m = random_boxes(&seed);
        umb_view view = random_view(m, &seed);
        umb_scene *scene = model_scene(m, false, (umb_tasks){0}, NULL, &error);
        assert_non_null(scene);
        const umb_committed *committed = umb_scene_committed(scene);
        umb_raster_map map;
        double rows[53];
        umb_raster_map_prepare(&map, &view, i % 2 != 0 ? &m->bounds : NULL, rows);
        umb_isa isa = umb_isa_available(isas[i % 4]) ? isas[i % 4] : UMB_ISA_SCALAR;
        for (int by_box = 0; by_box < 2; ++by_box) {
            void *raster;
            assert_int_equal(umb_raster_method.create(umb_scene_allocator(scene), isa, &raster), UMB_OK);
            assert_int_equal(umb_raster_method.prepare(raster, &map, committed), UMB_OK);
            boxes += draw_all(raster, committed, by_box != 0);
            *(by_box != 0 ? &covered : &as_meshes) += check_buffer(&map, umb_raster_method.buffer(raster), m, i);
            umb_raster_method.destroy(raster);
        }
        umb_scene_destroy(scene);
        model_free(m);
    }
    printf("# %llu boxes, %llu covered pixels checked, %llu as meshes\n", (unsigned long long)boxes,
           (unsigned long long)covered, (unsigned long long)as_meshes);
    assert_true(boxes > scenes && covered > scenes * 50u);
    assert_true(covered > as_meshes - as_meshes / 100 && covered < as_meshes + as_meshes / 100);
}

/* A wall before the eye and, in the same shape, a triangle that the near depth cuts and whose image lies
 * 10^11 pixels beside the raster: it must neither spoil the wall nor reach outside the buffer. */
static void test_far_beside(void **state)
{
    (void)state;
    for (int side = -1; side <= 1; side += 2) {
        float far = 1e8f * (float)side;
        float p[7][3] = {{-50, -50, -5},  {50, -50, -5},   {50, 50, -5},    {-50, 50, -5},
                         {far, 0, -0.2f}, {far, 1, -0.2f}, {far, 0, -0.05f}};
        uint32_t t[9] = {0, 1, 2, 0, 2, 3, 4, 5, 6};
        uint8_t flags[3] = {UMB_TRIANGLE_TWO_SIDED, UMB_TRIANGLE_TWO_SIDED, UMB_TRIANGLE_TWO_SIDED};
        umb_scene *scene = NULL;
        umb_index *index = NULL;
        umb_culler *culler = NULL;
        umb_shape shape;
        uint32_t id;
        assert_int_equal(umb_scene_create(&(umb_scene_def){0}, &scene), UMB_OK);
        umb_shape_def def = {.positions = p[0],
                             .position_count = 7,
                             .indices = t,
                             .index_count = 9,
                             .triangle_flags = flags};
        assert_int_equal(umb_scene_add_shape(scene, &def, &shape), UMB_OK);
        umb_object_def wall = {.shape = shape, .flags = UMB_OBJECT_IS_SHAPE};
        umb_object_def behind = {.bounds = {{-1, -1, -9}, {1, 1, -8}}};
        assert_int_equal(umb_scene_add_object(scene, &wall, &id), UMB_OK);
        assert_int_equal(umb_scene_add_object(scene, &behind, &id), UMB_OK);
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        assert_int_equal(umb_index_create(scene, &(umb_index_def){0}, &index), UMB_OK);
        assert_int_equal(umb_culler_create(index, NULL, &culler), UMB_OK);
        const double eye[3] = {0, 0, 0}, target[3] = {0, 0, -1}, up[3] = {0, 1, 0};
        umb_view view;
        umb_visible_set seen;
        assert_int_equal(umb_view_look_at(&view, eye, target, up, 1.0, 2.0, 0.1, 100.0), UMB_OK);
        assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
        assert_int_equal(seen.stats.occluders, 1);
        assert_int_equal(seen.count, 1); /* the wall; what is behind it is hidden */
        umb_culler_destroy(culler);
        umb_index_destroy(index);
        umb_scene_destroy(scene);
    }
}

/* A scene so small that nearness is about 10^25: a wall, and in the same shape a plate seen almost edge-on, whose
 * plane on the raster is steeper than floats can hold. A box before the wall must not be hidden by either. */
static void test_plane_beyond_floats(void **state)
{
    (void)state;
    const float k = 1e-25f, d = 1e-32f;
    float p[8][3] = {{-30 * k, -30 * k, -20 * k}, {30 * k, -30 * k, -20 * k}, {30 * k, 30 * k, -20 * k},
                     {-30 * k, 30 * k, -20 * k},  {d, -k, -4 * k},            {d, k, -4 * k},
                     {d, k, -4.03f * k},          {d, -k, -4.03f * k}};
    uint32_t t[12] = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7};
    uint8_t flags[4] = {UMB_TRIANGLE_TWO_SIDED, UMB_TRIANGLE_TWO_SIDED, UMB_TRIANGLE_TWO_SIDED,
                        UMB_TRIANGLE_TWO_SIDED};
    umb_scene *scene = NULL;
    umb_index *index = NULL;
    umb_culler *culler = NULL;
    umb_shape shape;
    uint32_t id;
    assert_int_equal(umb_scene_create(&(umb_scene_def){0}, &scene), UMB_OK);
    umb_shape_def def = {
        .positions = p[0], .position_count = 8, .indices = t, .index_count = 12, .triangle_flags = flags};
    assert_int_equal(umb_scene_add_shape(scene, &def, &shape), UMB_OK);
    umb_object_def wall = {.shape = shape, .flags = UMB_OBJECT_IS_SHAPE};
    umb_object_def before = {.bounds = {{k, -k, -10 * k}, {2 * k, k, -9 * k}}};
    umb_object_def behind = {.bounds = {{k, -k, -30 * k}, {2 * k, k, -29 * k}}};
    assert_int_equal(umb_scene_add_object(scene, &wall, &id), UMB_OK);
    assert_int_equal(umb_scene_add_object(scene, &before, &id), UMB_OK);
    assert_int_equal(umb_scene_add_object(scene, &behind, &id), UMB_OK);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_int_equal(umb_index_create(scene, &(umb_index_def){0}, &index), UMB_OK);
    assert_int_equal(umb_culler_create(index, NULL, &culler), UMB_OK);
    const double eye[3] = {0, 0, 0}, target[3] = {0, 0, -1}, up[3] = {0, 1, 0};
    umb_view view;
    umb_visible_set seen;
    assert_int_equal(umb_view_look_at(&view, eye, target, up, 1.0, 2.0, 0.1 * k, 100.0 * k), UMB_OK);
    assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
    assert_int_equal(seen.stats.occluders, 1);
    assert_int_equal(seen.count, 2); /* the wall and the box before it; not the one behind */
    assert_int_equal(seen.objects[1], 1);
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_invariant),
                                       cmocka_unit_test(test_boxes),
                                       cmocka_unit_test(test_far_beside),
                                       cmocka_unit_test(test_plane_beyond_floats)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

#include "index_sets.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

umb_aabb index_set_box(uint64_t *seed, index_set set, uint32_t i)
{
    static const double origin[3] = {0, 0, 0};
    umb_aabb b = {{1, 2, 3}, {1, 2, 3}};
    switch (set) {
    case INDEX_SPREAD:
        return random_box(seed, origin, INDEX_REACH / 2.0);
    case INDEX_CROWDED: /* small boxes in clusters */
        for (int a = 0; a < 3; ++a) {
            double at = 10.0 * (double)(random_below(seed, 4) * random_below(seed, 5)) + random_in(seed, 0, 3);
            b.min[a] = (float)at;
            b.max[a] = (float)(at + random_in(seed, 0, 1));
        }
        return b;
    case INDEX_EQUAL:
        b.max[0] = 4;
        b.max[1] = 5;
        return b;
    case INDEX_POINTS:
        return b;
    case INDEX_COLLINEAR:
        b.min[0] = b.max[0] = (float)i;
        return b;
    case INDEX_NESTED:
        for (int a = 0; a < 3; ++a) {
            b.min[a] = -(float)ldexp(1.0, (int)(i % 100) - 50);
            b.max[a] = -b.min[a];
        }
        return b;
    case INDEX_GEOMETRIC:
        b.min[i % 3] = b.max[i % 3] = (float)ldexp(1.0, (int)(i / 3 % 250) - 125);
        return b;
    case INDEX_SHEETS: /* walls of a lattice: faces that coincide */
        for (int a = 0; a < 3; ++a) {
            b.min[a] = (float)random_below(seed, 8);
            b.max[a] = b.min[a] + ((int)(i % 3) == a ? 0.0f : (float)(1 + random_below(seed, 3)));
        }
        return b;
    default:
        return absurd_box(seed);
    }
}

static void add_shape(umb_scene *scene, umb_shape *shape)
{
    static const float corners[12] = {0, 0, 0, 5, 0, 0, 0, 5, 0, 0, 0, 5};
    static const uint32_t sides[12] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};
    umb_shape_def def = {.positions = corners, .position_count = 4, .indices = sides, .index_count = 12};
    assert_int_equal(umb_scene_add_shape(scene, &def, shape), UMB_OK);
}

umb_transform index_place(uint64_t *seed)
{
    umb_transform t = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    for (int a = 0; a < 3; ++a) {
        t.m[a][3] = (float)random_in(seed, -INDEX_REACH, INDEX_REACH);
    }
    return t;
}

umb_scene *index_scene(uint64_t seed, index_set set, uint32_t count, const umb_allocator *allocator)
{
    umb_scene *scene;
    umb_scene_def scene_def = {.allocator = allocator != NULL ? *allocator : (umb_allocator){0}};
    umb_shape shape;
    assert_int_equal(umb_scene_create(&scene_def, &scene), UMB_OK);
    add_shape(scene, &shape);
    for (uint32_t i = 0; i < count; ++i) {
        umb_object_def def = {.bounds = index_set_box(&seed, set, i)};
        uint32_t id;
        if (set == INDEX_SPREAD && i % 5 == 0) {
            def = (umb_object_def){.shape = shape, .transform = index_place(&seed), .flags = UMB_OBJECT_IS_SHAPE};
        }
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
        if (set == INDEX_SPREAD && i % 11 == 3) {
            umb_transform t = index_place(&seed);
            assert_int_equal(umb_scene_add_occluder(scene, shape, &t, &id), UMB_OK);
        }
    }
    for (uint32_t i = 4; i < count && count > 20; i += 9) {
        assert_int_equal(umb_scene_remove_object(scene, i), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    return scene;
}

umb_index *index_make(umb_scene *scene, const char *name)
{
    umb_index_def def = {0};
    umb_index *index;
    assert_true(umb_index_parse(name, &def));
    assert_int_equal(umb_index_create(scene, &def, &index), UMB_OK);
    return index;
}

void index_move_some(umb_scene *scene, uint64_t *seed, uint32_t count, bool far)
{
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t id = random_below(seed, umb_scene_object_count(scene));
        umb_aabb box;
        if (!umb_scene_object_bounds(scene, id, &box)) {
            continue;
        }
        umb_transform t = index_place(seed);
        if (!far) {
            for (int a = 0; a < 3; ++a) {
                float step = (float)random_in(seed, -1, 1);
                box.min[a] += step;
                box.max[a] += step;
                t.m[a][3] = box.min[a];
            }
        } else {
            box = index_set_box(seed, INDEX_SPREAD, 0);
        }
        if (id % 5 == 0) {
            (void)umb_scene_move_object(scene, id, &t, NULL);
        } else {
            (void)umb_scene_move_object(scene, id, NULL, &box);
        }
    }
}


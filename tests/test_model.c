/* The model: what is dropped and counted, bounds, rebasing without a rounding, splitting without
 * a loss. References are the definitions, written down as slowly as they read. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "io/model.h"
#include "io/model_parts.h"
#include "support/random_boxes.h"

static const umb_transform identity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};

static uint32_t add(model *m, const float *positions, uint32_t position_count,
                    const uint32_t *indices, uint32_t triangle_count)
{
    model_mesh mesh = {.positions = (float *)(uintptr_t)positions,
                       .indices = (uint32_t *)(uintptr_t)indices,
                       .position_count = position_count,
                       .triangle_count = triangle_count};
    uint32_t number = model_add_mesh(m, &mesh);
    assert_int_not_equal(number, MODEL_NONE);
    return number;
}

static model *finished(model *m, const model_options *options)
{
    umb_error error = {0};
    assert_true(model_finish(m, options, &error));
    return m;
}

static const float cube_positions[24] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0,
                                         0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1};
static const uint32_t cube_indices[36] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                          1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7};

static model *one_object(const float *positions, uint32_t position_count, const uint32_t *indices,
                         uint32_t triangle_count)
{
    model *m = model_create();
    assert_non_null(m);
    add(m, positions, position_count, indices, triangle_count);
    assert_int_equal(model_add_object(m, "it", 0, &identity), 0);
    return finished(m, NULL);
}

static void sound_cube(void **state)
{
    (void)state;
    model *m = one_object(cube_positions, 8, cube_indices, 12);
    static const model_faults none;
    assert_memory_equal(&m->faults, &none, sizeof none);
    assert_int_equal(m->triangles, 12);
    assert_true(m->bounds.min[0] == 0.0f && m->bounds.max[2] == 1.0f);
    model_free(m);
}

/* Split vertices are seams, not borders; turned inside out, the cube is inverted. */
static void split_and_inverted_cube(void **state)
{
    (void)state;
    float positions[36][3];
    uint32_t indices[36];
    for (uint32_t i = 0; i < 36; ++i) {
        uint32_t v = cube_indices[i - i % 3 + (3 - i % 3) % 3];
        memcpy(positions[i], cube_positions + 3 * (size_t)v, sizeof positions[i]);
        for (int k = 0; k < 3; ++k) {
            positions[i][k] = positions[i][k] == 0.0f && i % 2 != 0 ? -0.0f : positions[i][k];
        }
        indices[i] = i;
    }
    model *m = one_object(positions[0], 36, indices, 12);
    assert_int_equal(m->faults.border_edges, 0);
    assert_int_equal(m->faults.non_manifold_edges, 0);
    assert_int_equal(m->faults.inverted, 1);
    model_free(m);
}

static void drops(void **state)
{
    (void)state;
    float positions[6][3] = {{0, 0, 0},   {1, 0, 0},        {0, 1, 0},
                             {NAN, 0, 0}, {0, INFINITY, 0}, {9, 9, 9}};
    static const uint32_t indices[15] = {0, 1, 2, 0, 1, 3, 0, 4, 2, 0, 1, 6, 0, 1, UINT32_MAX};
    model *m = model_create();
    add(m, positions[0], 6, indices, 5);
    add(m, positions[0], 6, indices + 3, 1);
    assert_int_equal(model_add_object(m, "none", MODEL_NONE, &identity), 0);
    assert_int_equal(model_add_object(m, "bad", 1, &identity), 1);
    assert_int_equal(model_add_object(m, "good", 0, &identity), 2);
    umb_transform huge = identity;
    huge.m[1][3] = INFINITY;
    assert_int_equal(model_add_object(m, "thrown", 0, &huge), 3);
    finished(m, NULL);
    assert_int_equal(m->triangles, 5 + 1 + 5);
    assert_int_equal(m->faults.bad_indices, 2);
    assert_int_equal(m->faults.non_finite, 2 + 2 + 3);
    assert_int_equal(m->faults.empty_objects, 3);
    assert_int_equal(m->objects[0].mesh, MODEL_NONE);
    assert_int_equal(m->objects[1].mesh, MODEL_NONE);
    assert_int_equal(m->objects[3].mesh, MODEL_NONE);
    assert_int_equal(m->mesh_count, 1);
    assert_int_equal(m->meshes[0].triangle_count, 1);
    assert_int_equal(m->meshes[0].position_count, 3);
    assert_true(m->bounds.max[0] == 1.0f);
    assert_true(m->objects[1].bounds.max[0] == 0.0f);
    model_free(m);
}

__extension__ typedef __int128 wide;

/* Whether all doubled areas are zero. Coordinates below 2^61: the products stay below 2^125. */
static bool zero_area_of_integers(int64_t p[3][3])
{
    for (int u = 0; u < 3; ++u) {
        int v = (u + 1) % 3;
        if ((wide)(p[1][u] - p[0][u]) * (p[2][v] - p[0][v]) !=
            (wide)(p[1][v] - p[0][v]) * (p[2][u] - p[0][u])) {
            return false;
        }
    }
    return true;
}

/* Points on and next to a line, with coordinates of up to 24 bits at very different scales. */
static void zero_area_is_exact(void **state)
{
    (void)state;
    uint64_t random = 11;
    int zero = 0;
    for (int round = 0; round < 200000; ++round) {
        int64_t p[3][3];
        float f[3][3];
        for (int k = 0; k < 3; ++k) {
            int shift = (int)random_below(&random, 36);
            int64_t base = (int64_t)random_below(&random, 1u << 10) *
                           ((int64_t)1 << random_below(&random, 36));
            int64_t step = ((int64_t)random_below(&random, 64) - 32) * ((int64_t)1 << shift);
            p[0][k] = base;
            p[1][k] = base + step;
            p[2][k] = base + step * (round % 7 - 3);
        }
        if (round % 2 == 0) {
            /* A line through the origin, points near and far on it: here doubles round. */
            int64_t direction[3];
            for (int k = 0; k < 3; ++k) {
                direction[k] = (int64_t)random_below(&random, 1024) - 512;
            }
            for (int i = 0; i < 3; ++i) {
                int64_t scale = (int64_t)(1 + random_below(&random, 1023))
                                << random_below(&random, 40);
                for (int k = 0; k < 3; ++k) {
                    p[i][k] = direction[k] * scale;
                }
            }
        }
        if (round % 3 == 0) {
            p[2][random_below(&random, 3)] += (int64_t)random_below(&random, 3) - 1;
        }
        bool fits = true;
        for (int i = 0; i < 9; ++i) {
            f[i / 3][i % 3] = (float)p[i / 3][i % 3];
            fits = fits && (int64_t)f[i / 3][i % 3] == p[i / 3][i % 3];
        }
        if (fits) {
            bool expected = zero_area_of_integers(p);
            assert_int_equal(model_zero_area(f[0], f[1], f[2]), expected);
            zero += expected;
        }
    }
    assert_true(zero > 10000);
}

/* The counts by their definitions: every pair of triangles, every pair of their edges. */
static model_faults slow_faults(int64_t (*points)[3], const uint32_t *indices, uint32_t triangles)
{
    model_faults f = {0};
    uint32_t good[64][3];
    uint32_t count = 0;
    for (uint32_t t = 0; t < triangles; ++t) {
        int64_t p[3][3];
        for (int i = 0; i < 3; ++i) {
            memcpy(p[i], points[indices[3 * t + (uint32_t)i]], sizeof p[i]);
        }
        if (zero_area_of_integers(p)) {
            ++f.degenerate;
            continue;
        }
        /* A vertex's number is that of the first vertex in its place. */
        for (int i = 0; i < 3; ++i) {
            uint32_t v = 0;
            while (memcmp(points[v], p[i], sizeof p[i]) != 0) {
                ++v;
            }
            good[count][i] = v;
        }
        ++count;
    }
    for (uint32_t t = 0; t < count; ++t) {
        bool same = false;
        bool opposite = false;
        for (uint32_t o = 0; o < t; ++o) {
            for (uint32_t r = 0; r < 3; ++r) {
                same = same || (good[o][0] == good[t][r] && good[o][1] == good[t][(r + 1) % 3] &&
                                good[o][2] == good[t][(r + 2) % 3]);
                opposite = opposite ||
                           (good[o][0] == good[t][r] && good[o][2] == good[t][(r + 1) % 3] &&
                            good[o][1] == good[t][(r + 2) % 3]);
            }
        }
        f.duplicate += same;
        f.opposite += opposite && !same;
    }
    for (uint32_t e = 0; e < 3 * count; ++e) {
        uint32_t a = good[e / 3][e % 3];
        uint32_t b = good[e / 3][(e + 1) % 3];
        uint32_t along = 0;
        uint32_t against = 0;
        bool first = true;
        for (uint32_t o = 0; o < 3 * count; ++o) {
            uint32_t c = good[o / 3][o % 3];
            uint32_t d = good[o / 3][(o + 1) % 3];
            bool here = (a == c && b == d) || (a == d && b == c);
            along += a == c && b == d;
            against += a == d && b == c;
            first = first && !(here && o < e);
        }
        if (first) {
            f.border_edges += along + against == 1;
            f.non_manifold_edges += along + against > 2 || along == 2;
        }
    }
    return f;
}

static void faults_against_reference(void **state)
{
    (void)state;
    uint64_t random = 5;
    for (int round = 0; round < 3000; ++round) {
        int64_t points[24][3];
        float positions[24][3];
        uint32_t indices[90];
        uint32_t vertices = 4 + random_below(&random, 20);
        uint32_t triangles = 1 + random_below(&random, 30);
        for (uint32_t v = 0; v < vertices; ++v) {
            for (int k = 0; k < 3; ++k) {
                points[v][k] = random_below(&random, round % 2 != 0 ? 2 : 3);
                positions[v][k] = (float)points[v][k];
            }
        }
        for (uint32_t i = 0; i < 3 * triangles; ++i) {
            indices[i] = random_below(&random, vertices);
        }
        model *m = one_object(positions[0], vertices, indices, triangles);
        model_faults expected = slow_faults(points, indices, triangles);
        assert_int_equal(m->faults.degenerate, expected.degenerate);
        assert_int_equal(m->faults.duplicate, expected.duplicate);
        assert_int_equal(m->faults.opposite, expected.opposite);
        assert_int_equal(m->faults.border_edges, expected.border_edges);
        assert_int_equal(m->faults.non_manifold_edges, expected.non_manifold_edges);
        assert_int_equal(m->triangles, triangles);
        model_free(m);
    }
}

static void outliers(void **state)
{
    (void)state;
    for (int far = 0; far < 2; ++far) {
        model *m = model_create();
        add(m, cube_positions, 8, cube_indices, 12);
        for (uint32_t i = 0; i < 1000; ++i) {
            umb_transform t = identity;
            t.m[0][3] = (float)(i % 10);
            t.m[1][3] = (float)(i / 10 % 10);
            t.m[2][3] = (float)(i / 100);
            assert_int_equal(model_add_object(m, "it", 0, &t), i);
        }
        /* The crowd is ten wide: its box ends at ten, and one may stick out by ten. */
        umb_transform t = identity;
        t.m[0][3] = far != 0 ? 19.5f : 18.5f;
        assert_int_equal(model_add_object(m, "it", 0, &t), 1000);
        finished(m, NULL);
        assert_int_equal(m->faults.outlier_objects, far);
        model_free(m);
    }
}

static void world_vertices_and_bounds(void **state)
{
    (void)state;
    uint64_t random = 3;
    for (int round = 0; round < 500; ++round) {
        umb_transform t;
        for (int i = 0; i < 12; ++i) {
            t.m[i / 4][i % 4] = (float)random_in(&random, -3.0, 3.0);
        }
        model *m = model_create();
        add(m, cube_positions, 8, cube_indices, 12);
        assert_int_equal(model_add_object(m, "it", 0, &t), 0);
        umb_transform zero = {{{0}}};
        assert_int_equal(model_add_object(m, "identity", 0, &zero), 1);
        finished(m, NULL);
        const model_object *o = &m->objects[0];
        bool touched[6] = {false};
        for (uint32_t v = 0; v < 8; ++v) {
            float p[3];
            model_world_vertex(m, o, v, p);
            for (int k = 0; k < 3; ++k) {
                const float *x = m->meshes[0].positions + 3 * (size_t)v;
                double sum = (double)o->transform.m[k][0] * x[0];
                sum += (double)o->transform.m[k][1] * x[1];
                sum += (double)o->transform.m[k][2] * x[2];
                sum += (double)o->transform.m[k][3];
                assert_true(p[k] == (float)sum);
                assert_true(p[k] >= o->bounds.min[k] && p[k] <= o->bounds.max[k]);
                touched[k] = touched[k] || p[k] == o->bounds.min[k];
                touched[3 + k] = touched[3 + k] || p[k] == o->bounds.max[k];
            }
        }
        for (int i = 0; i < 6; ++i) {
            assert_true(touched[i]);
        }
        double determinant = 0.0;
        for (int i = 0; i < 3; ++i) {
            int j = (i + 1) % 3;
            int k = (i + 2) % 3;
            determinant += t.m[0][i] *
                           ((double)t.m[1][j] * t.m[2][k] - (double)t.m[1][k] * t.m[2][j]);
        }
        if (fabs(determinant) > 1e-6) {
            assert_int_equal(model_mirrored(o), determinant < 0.0);
        }
        assert_false(model_mirrored(&m->objects[1]));
        assert_true(m->objects[1].bounds.max[0] == 1.0f);
        model_free(m);
    }
}

/* World vertices plus the origin are the same real numbers as before, whatever was moved. */
static void rebasing_moves_nothing(void **state)
{
    (void)state;
    uint64_t random = 17;
    int moved = 0;
    int moved_vertices = 0;
    int left = 0;
    for (int round = 0; round < 2000; ++round) {
        double centre[3];
        float positions[30][3];
        uint32_t indices[30];
        double extent = fabs(random_power(&random, -1.0, 3.0));
        /* 0: vertices far off, identity. 1: a translation far off. 2: both halves. 3: near. 4: a
         * translation that keeps no bits for what the vertices need. */
        int kind = (int)random_below(&random, 5);
        umb_transform t = identity;
        for (int k = 0; k < 3; ++k) {
            centre[k] = extent * (kind == 3 ? random_in(&random, -3.0, 3.0)
                                            : random_power(&random, 1.2, 3.0));
            float share = kind == 0 ? 0.0f : kind == 1 ? 1.0f : kind == 2 ? 0.5f : 0.0f;
            t.m[k][3] = (float)(share * centre[k]) + (kind == 4 ? 0.1f : 0.0f);
            if (kind == 1) {
                t.m[k][k] = 0.5f;
            }
        }
        for (uint32_t v = 0; v < 30; ++v) {
            for (int k = 0; k < 3; ++k) {
                positions[v][k] = (float)(centre[k] + random_in(&random, -0.5, 0.5) * extent) -
                                  t.m[k][3];
            }
            indices[v] = v;
        }
        model *m = model_create();
        add(m, positions[0], 30, indices, 10);
        assert_int_equal(model_add_object(m, "it", 0, &t), 0);
        finished(m, NULL);
        bool rebased = m->origin[0] != 0.0 || m->origin[1] != 0.0 || m->origin[2] != 0.0;
        moved += rebased;
        moved_vertices += rebased && memcmp(&m->objects[0].transform, &t, sizeof t) == 0;
        left += !rebased;
        for (uint32_t v = 0; v < 30; ++v) {
            float p[3];
            model_world_vertex(m, &m->objects[0], v, p);
            const model_object *o = &m->objects[0];
            for (int k = 0; k < 3; ++k) {
                const float *now = m->meshes[0].positions + 3 * (size_t)v;
                double before = (double)t.m[k][k] * positions[v][k] + (double)t.m[k][3];
                double after = (double)o->transform.m[k][k] * now[k] + (double)o->transform.m[k][3];
                assert_true(after + m->origin[k] == before);
                if (kind == 0) {
                    assert_true((double)p[k] + m->origin[k] == before);
                }
            }
        }
        if (kind == 3) {
            assert_false(rebased);
        }
        model_free(m);
    }
    assert_true(moved > 500 && moved_vertices > 200 && left > 200);
}

static int compare_triangles(const void *a, const void *b)
{
    return memcmp(a, b, 9 * sizeof(float));
}

/* Corner positions of an object's triangles, sorted: the same however they are listed. */
static float (*triangle_soup(const model *m, uint32_t first, uint32_t end, uint32_t *count))[9]
{
    *count = 0;
    for (uint32_t o = first; o < end; ++o) {
        *count += m->meshes[m->objects[o].mesh].triangle_count;
    }
    float(*soup)[9] = calloc(*count + 1, sizeof *soup);
    assert_non_null(soup);
    uint32_t at = 0;
    for (uint32_t o = first; o < end; ++o) {
        const model_mesh *mesh = &m->meshes[m->objects[o].mesh];
        for (uint32_t i = 0; i < 3 * mesh->triangle_count; ++i) {
            model_world_vertex(m, &m->objects[o], mesh->indices[i],
                               soup[at + i / 3] + 3 * (size_t)(i % 3));
        }
        at += mesh->triangle_count;
    }
    qsort(soup, *count, sizeof *soup, compare_triangles);
    return soup;
}

static model *two_instances(uint64_t seed, uint32_t triangles, const model_options *options)
{
    uint64_t random = seed;
    float(*positions)[3] = calloc(3 * (size_t)triangles, sizeof *positions);
    uint32_t *indices = calloc(3 * (size_t)triangles, sizeof *indices);
    assert_non_null(positions);
    assert_non_null(indices);
    for (uint32_t i = 0; i < 3 * triangles; ++i) {
        for (int k = 0; k < 3; ++k) {
            positions[i][k] = (float)random_in(&random, 0.0, k == 1 ? 30.0 : 10.0);
        }
        indices[i] = i;
    }
    model *m = model_create();
    add(m, positions[0], 3 * triangles, indices, triangles);
    add(m, cube_positions, 8, cube_indices, 12);
    umb_transform t = identity;
    t.m[0][0] = -2.0f;
    assert_int_equal(model_add_object(m, "a", 0, &identity), 0);
    assert_int_equal(model_add_object(m, "none", MODEL_NONE, &identity), 1);
    assert_int_equal(model_add_object(m, "b", 0, &t), 2);
    assert_int_equal(model_add_object(m, "cube", 1, &t), 3);
    free(positions);
    free(indices);
    return finished(m, options);
}

static void splitting_loses_nothing(void **state)
{
    (void)state;
    for (uint32_t round = 0; round < 60; ++round) {
        uint32_t triangles = 1 + round * 13;
        model_options options = {.split = 12 + round % 7 * 20};
        if (round == 0) {
            options.split = 1;
        }
        model *whole = two_instances(round + 1, triangles, NULL);
        model *cut = two_instances(round + 1, triangles, &options);
        uint32_t clusters = (triangles + options.split - 1) / options.split;
        uint32_t cubes = (12 + options.split - 1) / options.split;
        assert_int_equal(cut->object_count, 2 * clusters + 1 + cubes);
        assert_int_equal(cut->mesh_count, clusters + cubes);
        assert_int_equal(cut->triangles, whole->triangles);
        assert_int_equal(cut->objects[clusters].mesh, MODEL_NONE);
        assert_memory_equal(&cut->faults, &whole->faults, sizeof cut->faults);
        assert_memory_equal(&cut->bounds, &whole->bounds, sizeof cut->bounds);
        for (uint32_t i = 0; i < clusters; ++i) {
            assert_int_equal(cut->objects[i].mesh, cut->objects[clusters + 1 + i].mesh);
            assert_true(cut->meshes[cut->objects[i].mesh].triangle_count <= options.split);
            assert_true(cut->meshes[cut->objects[i].mesh].triangle_count > 0);
        }
        uint32_t count[2];
        float(*before)[9] = triangle_soup(whole, 2, 3, &count[0]);
        float(*after)[9] = triangle_soup(cut, clusters + 1, 2 * clusters + 1, &count[1]);
        assert_int_equal(count[0], count[1]);
        assert_memory_equal(before, after, count[0] * sizeof *before);
        free(before);
        free(after);
        model_free(whole);
        model_free(cut);
    }
}

/* Clusters are compact: together their boxes are much smaller than as many copies of the whole. */
static void splitting_is_spatial(void **state)
{
    (void)state;
    float positions[4096][3];
    uint32_t indices[6 * 63 * 63];
    uint32_t count = 0;
    for (uint32_t i = 0; i < 4096; ++i) {
        positions[i][0] = (float)(i % 64);
        positions[i][1] = (float)(i / 64);
        positions[i][2] = 0.0f;
        if (i % 64 != 63 && i / 64 != 63) {
            const uint32_t quad[6] = {i, i + 1, i + 64, i + 1, i + 65, i + 64};
            memcpy(indices + count, quad, sizeof quad);
            count += 6;
        }
    }
    model *m = model_create();
    add(m, positions[0], 4096, indices, count / 3);
    assert_int_equal(model_add_object(m, "floor", 0, &identity), 0);
    const model_options options = {.split = 128};
    finished(m, &options);
    double area = 0.0;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        const umb_aabb *b = &m->objects[i].bounds;
        area += (double)(b->max[0] - b->min[0]) * (b->max[1] - b->min[1]);
    }
    assert_int_equal(m->object_count, (count / 3 + 127) / 128);
    assert_true(area < 2.0 * 63.0 * 63.0);
    assert_string_equal(m->objects[1].name, "floor#1");
    model_free(m);
}

static void two_sided_option(void **state)
{
    (void)state;
    uint8_t flags[12] = {UMB_TRIANGLE_OPEN};
    model *m = model_create();
    model_mesh mesh = {.positions = (float *)(uintptr_t)cube_positions,
                       .indices = (uint32_t *)(uintptr_t)cube_indices,
                       .flags = flags,
                       .position_count = 8,
                       .triangle_count = 12};
    assert_int_equal(model_add_mesh(m, &mesh), 0);
    assert_int_equal(model_add_object(m, "it", 0, NULL), 0);
    const model_options options = {.two_sided = true};
    finished(m, &options);
    assert_int_equal(m->meshes[0].flags[0], UMB_TRIANGLE_OPEN);
    assert_int_equal(m->meshes[0].flags[11], UMB_TRIANGLE_TWO_SIDED);
    model_free(m);
    model_free(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sound_cube),
        cmocka_unit_test(split_and_inverted_cube),
        cmocka_unit_test(drops),
        cmocka_unit_test(zero_area_is_exact),
        cmocka_unit_test(faults_against_reference),
        cmocka_unit_test(outliers),
        cmocka_unit_test(world_vertices_and_bounds),
        cmocka_unit_test(rebasing_moves_nothing),
        cmocka_unit_test(splitting_loses_nothing),
        cmocka_unit_test(splitting_is_spatial),
        cmocka_unit_test(two_sided_option),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

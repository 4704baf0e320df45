/* Generated scenes: counts, numbering, determinism, exact joints, and `blocks` against its
 * recipe. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "io/generate.h"

static model *make(const char *spec)
{
    umb_error error = {0};
    model *m = generate_model(spec, NULL, &error);
    if (!m) {
        fail_msg("%s: %s", spec, error.text);
    }
    return m;
}

/* FNV-1a over every world vertex, object by object, corner by corner. */
static uint64_t hash_model(const model *m)
{
    uint64_t h = 14695981039346656037u;
    for (uint32_t o = 0; o < m->object_count; ++o) {
        const model_mesh *mesh = &m->meshes[m->objects[o].mesh];
        for (uint32_t i = 0; i < 3 * mesh->triangle_count; ++i) {
            float p[3];
            uint8_t bytes[sizeof p];
            model_world_vertex(m, &m->objects[o], mesh->indices[i], p);
            memcpy(bytes, p, sizeof p);
            for (size_t k = 0; k < sizeof bytes; ++k) {
                h = (h ^ bytes[k]) * 1099511628211u;
            }
        }
    }
    return h;
}

static uint64_t hash_spec(const char *spec)
{
    model *m = make(spec);
    uint64_t h = hash_model(m);
    model_free(m);
    return h;
}

static uint64_t count_triangles(const model *m)
{
    uint64_t sum = 0;
    for (uint32_t o = 0; o < m->object_count; ++o) {
        sum += m->meshes[m->objects[o].mesh].triangle_count;
    }
    return sum;
}

/* Every edge is met as often in one direction as in the other. Compares positions, so parts that
 * share a corner by value count as joined. */
static void assert_closed(const model_mesh *mesh)
{
    uint32_t n = 3 * mesh->triangle_count;
    for (uint32_t e = 0; e < n; ++e) {
        const float *a = mesh->positions + 3 * mesh->indices[e];
        const float *b = mesh->positions + 3 * mesh->indices[e / 3 * 3 + (e + 1) % 3];
        int balance = 0;
        for (uint32_t f = 0; f < n; ++f) {
            const float *c = mesh->positions + 3 * mesh->indices[f];
            const float *d = mesh->positions + 3 * mesh->indices[f / 3 * 3 + (f + 1) % 3];
            balance += !memcmp(a, c, 12) && !memcmp(b, d, 12);
            balance -= !memcmp(a, d, 12) && !memcmp(b, c, 12);
        }
        assert_int_equal(balance, 0);
    }
}

static double volume(const model_mesh *mesh)
{
    double sum = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; ++t) {
        const float *p[3];
        for (int k = 0; k < 3; ++k) {
            p[k] = mesh->positions + 3 * mesh->indices[3 * t + (uint32_t)k];
        }
        for (int i = 0; i < 3; ++i) {
            int j = (i + 1) % 3, k = (i + 2) % 3;
            sum += (double)p[0][i] * ((double)p[1][j] * p[2][k] - (double)p[1][k] * p[2][j]);
        }
    }
    return sum / 6;
}

static void assert_solids(const model *m, uint32_t first_mesh)
{
    for (uint32_t k = first_mesh; k < m->mesh_count; ++k) {
        assert_true(volume(&m->meshes[k]) > 0);
        assert_closed(&m->meshes[k]);
    }
}

/* The recipe once more, written apart from the generator: draws a whole workload, keeps the
 * boxes. */
typedef struct recipe {
    float building[8][3];
    float prop[10][2][3];
} recipe;

static uint64_t recipe_state;

static double recipe_unit(void)
{
    uint64_t z = recipe_state += 0x9E3779B97F4A7C15u;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    z ^= z >> 31;
    return ldexp((double)(z >> 40), -24);
}

static void recipe_draw(recipe *out, int i, int j, int grid)
{
    double cx = (i + 0.5 - grid / 2.0) * 18, cz = (j + 0.5 - grid / 2.0) * 18;
    double sx = 9 + 3 * recipe_unit(), sz = 9 + 3 * recipe_unit(), h = 5 + 35 * recipe_unit();
    double yaw = (2 * recipe_unit() - 1) * 30.0 * 3.14159265358979323846 / 180.0;
    double c = cos(yaw), s = sin(yaw);
    for (int k = 0; k < 8; ++k) {
        double lx = (k & 1) ? sx / 2 : -sx / 2, lz = (k & 4) ? sz / 2 : -sz / 2;
        out->building[k][0] = (float)(cx + c * lx + s * lz);
        out->building[k][1] = (float)((k & 2) ? h : 0);
        out->building[k][2] = (float)(cz - s * lx + c * lz);
    }
    for (int k = 0; k < 10; ++k) {
        double w[3];
        for (int a = 0; a < 3; ++a) {
            w[a] = 0.3 + 1.2 * recipe_unit();
        }
        double m = 0.5 * sqrt(w[0] * w[0] + w[2] * w[2]), px, pz;
        for (;;) {
            px = (2 * recipe_unit() - 1) * 9;
            pz = (2 * recipe_unit() - 1) * 9;
            if (fabs(c * px - s * pz) > sx / 2 + m || fabs(s * px + c * pz) > sz / 2 + m) {
                break;
            }
        }
        out->prop[k][0][0] = (float)(cx + px - w[0] / 2);
        out->prop[k][1][0] = (float)(cx + px + w[0] / 2);
        out->prop[k][0][1] = 0;
        out->prop[k][1][1] = (float)w[1];
        out->prop[k][0][2] = (float)(cz + pz - w[2] / 2);
        out->prop[k][1][2] = (float)(cz + pz + w[2] / 2);
    }
}

/* Every corner of expected is a corner of the object and the other way round. */
static void assert_corners(const model *m, uint32_t object, float expected[8][3])
{
    const model_object *o = &m->objects[object];
    const model_mesh *mesh = &m->meshes[o->mesh];
    uint32_t seen = 0;
    assert_int_equal(mesh->triangle_count, 12);
    for (uint32_t i = 0; i < 36; ++i) {
        float p[3];
        int at = -1;
        model_world_vertex(m, o, mesh->indices[i], p);
        for (int k = 0; k < 8; ++k) {
            if (p[0] == expected[k][0] && p[1] == expected[k][1] && p[2] == expected[k][2]) {
                at = k;
            }
        }
        assert_true(at >= 0);
        seen |= 1u << at;
    }
    assert_int_equal(seen, 255);
}

static void test_blocks_recipe(void **state)
{
    (void)state;
    const int grids[2] = {32, 7};
    for (int g = 0; g < 2; ++g) {
        int grid = grids[g];
        uint32_t buildings = (uint32_t)(grid * grid);
        model *m = make(grid == 32 ? "gen:blocks" : "gen:blocks,g=7");
        assert_int_equal(m->object_count, buildings * 11);
        assert_int_equal(m->triangles, buildings * 11 * 12);
        recipe_state = 20240607;
        for (uint32_t b = 0; b < buildings; ++b) {
            recipe r;
            recipe_draw(&r, (int)b % grid, (int)b / grid, grid);
            assert_corners(m, b, r.building);
            for (uint32_t p = 0; p < 10; ++p) {
                float corners[8][3];
                for (int k = 0; k < 24; ++k) {
                    corners[k / 3][k % 3] = r.prop[p][k / 3 >> k % 3 & 1][k % 3];
                }
                assert_corners(m, buildings + b * 10 + p, corners);
            }
        }
        assert_solids(m, 0);
        model_free(m);
    }
}

static void test_blocks_path(void **state)
{
    (void)state;
    camera_path p;
    umb_error error;
    assert_true(generate_path("gen:blocks,g=32", &p, &error));
    assert_int_equal(p.count, 64);
    assert_true(p.rows[0][0] == 0 && p.rows[0][1] == 1.7 && p.rows[0][2] == -144);
    assert_true(p.rows[0][3] == 0 && p.rows[0][5] == -1144);
    assert_true(p.rows[48][0] == 72 && p.rows[48][2] == 0);
    double yaw = 2 * 3.14159265358979323846 * (48 * 0.6180339887498949 - 29);
    assert_true(fabs((p.rows[48][3] - 72) / 1000 - sin(yaw)) < 1e-12);
    assert_true(fabs(p.rows[48][5] / 1000 + cos(yaw)) < 1e-12);
    camera_path_free(&p);
}

/* Floors of a building follow one another. Where neither is a deck and the plans are equal, the
 * corners at the joint are equal to the bit; decks meet from above. */
static void test_city_floors_meet(void **state)
{
    (void)state;
    model *m = make("gen:city,triangles=60k,seed=3");
    uint32_t joints = 0, decks = 0;
    for (uint32_t o = 1; o < m->object_count; ++o) {
        const model_object *low = &m->objects[o - 1], *high = &m->objects[o];
        const char *a = strstr(low->name, " floor "), *b = strstr(high->name, " floor ");
        if (!a || !b || atoi(b + 7) != atoi(a + 7) + 1) {
            continue;
        }
        const model_mesh *low_mesh = &m->meshes[low->mesh], *high_mesh = &m->meshes[high->mesh];
        assert_true(low->bounds.max[1] == high->bounds.min[1]);
        bool deck = low_mesh->triangle_count > 28, same = low->mesh == high->mesh;
        if (!same || deck) {
            decks += deck;
            continue;
        }
        for (uint32_t v = 0; v < low_mesh->position_count; ++v) {
            float p[3], q[3];
            bool met = false;
            model_world_vertex(m, low, v, p);
            if (p[1] != low->bounds.max[1]) {
                continue;
            }
            for (uint32_t w = 0; w < high_mesh->position_count && !met; ++w) {
                model_world_vertex(m, high, w, q);
                met = memcmp(p, q, sizeof p) == 0;
            }
            assert_true(met);
            ++joints;
        }
    }
    assert_true(joints > 2000);
    assert_true(decks > 20);
    model_free(m);
}

static void test_city_counts(void **state)
{
    (void)state;
    model *small = make("gen:city,triangles=10k,seed=7");
    model *large = make("gen:city,triangles=100k");
    assert_int_equal(small->triangles, count_triangles(small));
    assert_int_equal(large->triangles, count_triangles(large));
    assert_true(small->triangles >= 10000 && small->triangles < 12000);
    assert_true(large->triangles >= 100000 && large->triangles < 102000);
    /* The first ground meshes are open sheets; all others are solids that face outwards. */
    assert_solids(large, 4);
    assert_int_equal(large->faults.degenerate, 0);
    assert_int_equal(large->faults.non_manifold_edges, 0);
    /* The larger city contains the smaller one. */
    for (uint32_t o = 0; o < small->object_count; ++o) {
        assert_string_equal(small->objects[o].name, large->objects[o].name);
        assert_memory_equal(&small->objects[o].bounds, &large->objects[o].bounds, sizeof(umb_aabb));
    }
    model_free(small);
    model_free(large);
}

/* Buildings stay in their lots, so streets are clear at the eyes of the path. */
static void test_city_path(void **state)
{
    (void)state;
    camera_path p;
    umb_error error;
    model *m = make("gen:city,triangles=100k,seed=2");
    assert_true(generate_path("gen:city,triangles=100k,seed=2", &p, &error));
    uint32_t street = 0;
    for (uint32_t k = 0; k < p.count; ++k) {
        const double *e = p.rows[k];
        if (e[1] != 1.7) {
            continue;
        }
        ++street;
        bool on_ground = false;
        for (uint32_t o = 0; o < m->object_count; ++o) {
            const umb_aabb *b = &m->objects[o].bounds;
            bool over = e[0] >= b->min[0] && e[0] <= b->max[0] && e[2] >= b->min[2] &&
                        e[2] <= b->max[2];
            assert_false(over && e[1] >= b->min[1] && e[1] <= b->max[1]);
            on_ground = on_ground || (over && b->max[1] == 0);
        }
        assert_true(on_ground);
    }
    assert_true(street >= 64);
    assert_true(4 * (p.count - street) <= p.count);
    camera_path_free(&p);
    model_free(m);
}

/* Boxes are rigid to within rounding, of the stated sizes, and keep out of the clearing. */
static void test_boxfield(void **state)
{
    (void)state;
    model *m = make("gen:boxfield,polygons=60k,seed=5");
    assert_int_equal(m->object_count, 5000);
    assert_int_equal(m->triangles, 60000);
    double largest = 0;
    for (uint32_t o = 0; o < m->object_count; ++o) {
        const float(*t)[4] = m->objects[o].transform.m;
        double centre = 0, diagonal = 0, side[3];
        for (int j = 0; j < 3; ++j) {
            int k = (j + 1) % 3;
            side[j] = sqrt((double)t[0][j] * t[0][j] + (double)t[1][j] * t[1][j] +
                           (double)t[2][j] * t[2][j]);
            double dot = (double)t[0][j] * t[0][k] + (double)t[1][j] * t[1][k] +
                         (double)t[2][j] * t[2][k];
            assert_true(side[j] > 1.9999 && side[j] < 100.0001);
            assert_true(fabs(dot) < 1e-2);
            largest = fmax(largest, side[j]);
            centre += (double)t[j][3] * t[j][3];
            diagonal += side[j] * side[j];
        }
        assert_false(model_mirrored(&m->objects[o]));
        assert_true(sqrt(centre) - sqrt(diagonal) / 2 > 99.99);
    }
    assert_true(largest > 99);
    assert_solids(m, 0);
    model_free(m);
    camera_path p;
    umb_error error;
    assert_true(generate_path("gen:boxfield,polygons=60k,seed=5", &p, &error));
    assert_int_equal(p.count, 64);
    camera_path_free(&p);
}

/* A field of a given height is a square as large as its boxes need. */
static void test_flat_boxfield(void **state)
{
    (void)state;
    model *m = make("gen:boxfield,polygons=60k,space=40k,height=100");
    double most[3] = {0.0};
    for (uint32_t o = 0; o < m->object_count; ++o) {
        for (int k = 0; k < 3; ++k) {
            most[k] = fmax(most[k], fabs((double)m->objects[o].transform.m[k][3]));
        }
    }
    double side = sqrt(5000 * 40000.0 / 100.0); /* 1,414.2 */
    assert_true(most[1] < 50.01 && most[1] > 49.5);
    for (int k = 0; k < 3; k += 2) {
        assert_true(most[k] < 0.5 * side + 1.0 && most[k] > 0.5 * side - 20.0);
    }
    model_free(m);
    camera_path p;
    umb_error error;
    assert_true(generate_path("gen:boxfield,polygons=60k,space=40k,height=100", &p, &error));
    assert_int_equal(p.count, 64);
    camera_path_free(&p);
}

/* The end of one wall piece is met by the pieces beside it: each corner of a panel's ends is a
 * corner of another wall piece too. */
static void test_building_walls_meet(void **state)
{
    (void)state;
    model *m = make("gen:building,floors=2,rooms=12,seed=4");
    uint32_t corners = 0;
    assert_int_equal(m->triangles, count_triangles(m));
    for (uint32_t o = 0; o < m->object_count; ++o) {
        const model_object *wall = &m->objects[o];
        if (!strstr(wall->name, " wall ")) {
            continue;
        }
        int along = strstr(wall->name, "west") ? 2 : 0;
        for (uint32_t v = 0; v < m->meshes[wall->mesh].position_count; ++v) {
            float p[3], q[3];
            bool met = false;
            model_world_vertex(m, wall, v, p);
            if (p[along] != wall->bounds.min[along] && p[along] != wall->bounds.max[along]) {
                continue;
            }
            for (uint32_t k = 0; k < m->object_count && !met; ++k) {
                const model_object *post = &m->objects[k];
                for (uint32_t w = 0; strstr(post->name, " post") && w < 16 && !met; ++w) {
                    model_world_vertex(m, post, w, q);
                    met = memcmp(p, q, sizeof p) == 0;
                }
            }
            assert_true(met);
            ++corners;
        }
    }
    assert_true(corners > 1000);
    assert_solids(m, 0);
    assert_int_equal(m->faults.non_manifold_edges, 0);
    model_free(m);
}

/* No eye of the path is inside a solid. */
static void test_building_path(void **state)
{
    (void)state;
    camera_path p;
    umb_error error;
    model *m = make("gen:building,floors=3,rooms=60,seed=2");
    assert_true(generate_path("gen:building,floors=3,rooms=60,seed=2", &p, &error));
    assert_int_equal(p.count, 72);
    for (uint32_t k = 0; k < p.count; ++k) {
        bool indoors = true;
        for (int i = 0; i < 3; ++i) {
            indoors = indoors && p.rows[k][i] > m->bounds.min[i] && p.rows[k][i] < m->bounds.max[i];
        }
        assert_true(indoors);
        for (uint32_t o = 0; o < m->object_count; ++o) {
            const umb_aabb *b = &m->objects[o].bounds;
            bool inside = true;
            for (int i = 0; i < 3; ++i) {
                inside = inside && p.rows[k][i] >= b->min[i] && p.rows[k][i] <= b->max[i];
            }
            assert_false(inside);
        }
    }
    camera_path_free(&p);
    model_free(m);
}

static void test_determinism(void **state)
{
    (void)state;
    assert_true(hash_spec("gen:city,triangles=50k,seed=7") == UINT64_C(0x25f6284dd9b67099));
    assert_true(hash_spec("gen:boxfield,polygons=20k") == UINT64_C(0x9eddb427f6546bed));
    assert_true(hash_spec("gen:building") == UINT64_C(0x308e5f275936a6d));
    assert_true(hash_spec("gen:sodacity,blocks=2,floors=2,rooms=6") == UINT64_C(0xe68911493392737d));
    assert_true(hash_spec("gen:city,triangles=50k,seed=8") !=
                hash_spec("gen:city,triangles=50k,seed=7"));
}

static void test_bad_specs(void **state)
{
    (void)state;
    static const char *const bad[][2] = {
        {"gen:", "blocks"},
        {"gen:castle", "city"},
        {"gen:city,size=3", "triangles"},
        {"gen:blocks,g", "from 1"},
        {"gen:blocks,g=0", "from 1"},
        {"gen:blocks,g=-1", "from 1"},
        {"gen:blocks,g=1.5", "g"},
        {"gen:blocks,g=1e3", "g"},
        {"gen:blocks,", "keys"},
        {"gen:blocks,g=99999999999999999999", "from 1"},
        {"gen:city,triangles=k", "triangles"},
        {"gen:blocks,g=2,,g=3", "keys"},
        {"blocks", "gen:NAME"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
        umb_error error = {0};
        camera_path p;
        assert_null(generate_model(bad[k][0], NULL, &error));
        assert_int_equal(error.code, UMB_ERROR_ARGUMENT);
        assert_non_null(strstr(error.text, bad[k][1]));
        assert_null(strchr(error.text, '\n'));
        assert_false(generate_path(bad[k][0], &p, &error));
    }
    model *a = make("gen:city,triangles=1.5k"), *b = make("gen:city,triangles=1500");
    assert_true(hash_model(a) == hash_model(b));
    model_free(a);
    model_free(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_blocks_recipe),       cmocka_unit_test(test_blocks_path),
        cmocka_unit_test(test_city_floors_meet),    cmocka_unit_test(test_city_counts),
        cmocka_unit_test(test_city_path),           cmocka_unit_test(test_boxfield),
        cmocka_unit_test(test_flat_boxfield),
        cmocka_unit_test(test_building_walls_meet), cmocka_unit_test(test_building_path),
        cmocka_unit_test(test_determinism),         cmocka_unit_test(test_bad_specs),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

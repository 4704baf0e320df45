/* Every reader on small files made here, on damaged copies of them, and on real scenes whose
 * counts are known from other tools. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <minizip/zip.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "io/model.h"
#include "io/readers.h"
#include "support/small_maps.h"

static const model_options defaults;

static const model_mesh *mesh_of(const model *m, uint32_t object)
{
    assert_true(object < m->object_count);
    assert_true(m->objects[object].mesh < m->mesh_count);
    return &m->meshes[m->objects[object].mesh];
}

static uint32_t triangles_of(const model *m, uint32_t object)
{
    return m->objects[object].mesh == MODEL_NONE ? 0 : mesh_of(m, object)->triangle_count;
}

static uint32_t open_triangles_of(const model *m, uint32_t object)
{
    uint32_t open = 0;
    for (uint32_t t = 0; t < triangles_of(m, object); ++t) {
        open += (mesh_of(m, object)->flags[t] & UMB_TRIANGLE_OPEN) != 0;
    }
    return open;
}

/* Twice the area vector of a triangle, and its first corner. */
static void normal_of(const model *m, uint32_t object, uint32_t t, double normal[3], float first[3])
{
    const uint32_t *index = mesh_of(m, object)->indices + 3 * (size_t)t;
    float p[3][3];
    for (int i = 0; i < 3; ++i) {
        model_world_vertex(m, &m->objects[object], index[i], p[i]);
    }
    for (int k = 0; k < 3; ++k) {
        int u = (k + 1) % 3;
        int v = (k + 2) % 3;
        normal[k] = ((double)p[1][u] - p[0][u]) * ((double)p[2][v] - p[0][v]) -
                    ((double)p[1][v] - p[0][v]) * ((double)p[2][u] - p[0][u]);
        first[k] = p[0][k];
    }
}

/* A failing read says one line that names the file. */
static void assert_refused(const model *m, const umb_error *error)
{
    assert_null(m);
    assert_int_not_equal(error->code, UMB_OK);
    assert_non_null(strstr(error->text, "it:"));
    assert_null(strchr(error->text, '\n'));
}

static void quake_room(void **state)
{
    (void)state;
    small_map map;
    small_q1_map(&map);
    umb_error error;
    model *m = read_q1bsp(map.bytes, map.size, "it", &defaults, &error);
    assert_non_null(m);
    assert_int_equal(m->triangles, SMALL_Q1_TRIANGLES);
    assert_int_equal(m->object_count, 3 + 1);
    assert_int_equal(triangles_of(m, 0), 12);
    assert_int_equal(open_triangles_of(m, 0), 0);
    assert_int_equal(triangles_of(m, 1), 2 + 2);
    assert_int_equal(open_triangles_of(m, 1), 2);
    assert_int_equal(triangles_of(m, 2), 0);
    assert_int_equal(open_triangles_of(m, 3), 2);
    assert_int_equal(m->faults.empty_objects, 1);
    assert_int_equal(m->faults.degenerate, 0);
    assert_true(m->up[2] == 1.0 && m->up[1] == 0.0);
    assert_true(m->objects[2].bounds.max[0] == 0.0f);
    for (uint32_t t = 0; t < 12; ++t) {
        double n[3];
        float p[3];
        normal_of(m, 0, t, n, p);
        assert_true(n[0] * (32.0 - p[0]) + n[1] * (32.0 - p[1]) + n[2] * (32.0 - p[2]) > 0.0);
    }
    model_free(m);

    const model_options sky = {.sky = true, .two_sided = true};
    m = read_q1bsp(map.bytes, map.size, "it", &sky, &error);
    assert_int_equal(m->triangles, SMALL_Q1_TRIANGLES);
    assert_int_equal(triangles_of(m, 0), 14);
    for (uint32_t t = 0; t < 14; ++t) {
        assert_int_equal(mesh_of(m, 0)->flags[t], UMB_TRIANGLE_TWO_SIDED);
    }
    model_free(m);
}

static void quake3_clusters(void **state)
{
    (void)state;
    small_map map;
    small_q3_map(&map);
    umb_error error;
    model *m = read_q3bsp(map.bytes, map.size, "it", &defaults, &error);
    assert_non_null(m);
    assert_int_equal(m->triangles, SMALL_Q3_TRIANGLES);
    assert_int_equal(m->object_count, 3 + 1);
    assert_int_equal(triangles_of(m, 0), 2 + 32 + 1);
    assert_int_equal(triangles_of(m, 1), 0);
    assert_int_equal(triangles_of(m, 2), 2 + 2);
    assert_int_equal(open_triangles_of(m, 2), 2);
    assert_int_equal(open_triangles_of(m, 3), 2);
    for (uint32_t t = 0; t < triangles_of(m, 0); ++t) {
        double n[3];
        float p[3];
        normal_of(m, 0, t, n, p);
        assert_true(n[1] < 0.0);
    }
    /* The patch bulges to the middle of its control points. */
    assert_true(m->objects[0].bounds.max[1] == 75.0f);
    model_free(m);

    const model_options sky = {.sky = true};
    m = read_q3bsp(map.bytes, map.size, "it", &sky, &error);
    assert_int_equal(triangles_of(m, 2), 2 + 2 + 2);
    assert_int_equal(open_triangles_of(m, 2), 2);
    model_free(m);
}

/* Two patches that share a border, listed in opposite directions and from different sides: the
 * floats on the border are the same. */
static void patch_borders_agree(void **state)
{
    (void)state;
    small_map map;
    small_q3_map(&map);
    umb_error error;
    size_t vertices = small_map_peek(&map, 8 + 8 * 10);
    float border[3][3] = {{0.1f, 50.3f, 16.7f}, {7.9f, 101.1f, 19.3f}, {16.2f, 49.7f, 15.1f}};
    float seen[2][5][3];
    for (int turn = 0; turn < 2; ++turn) {
        for (int i = 0; i < 3; ++i) {
            /* Its last row forwards, then its first column backwards. */
            size_t v = turn == 0 ? (size_t)(20 + 6 + i) : (size_t)(20 + 3 * (2 - i));
            memcpy(map.bytes + vertices + 44 * v, border[i], sizeof border[i]);
        }
        model *m = read_q3bsp(map.bytes, map.size, "it", &defaults, &error);
        assert_non_null(m);
        /* Vertices of the patch's grid in the order of their first use: find those that lie on
         * the curve. */
        const model_mesh *mesh = mesh_of(m, 0);
        for (int i = 0; i < 5; ++i) {
            float t = 0.25f * (float)i;
            int found = 0;
            for (uint32_t v = 0; v < mesh->position_count; ++v) {
                const float *p = mesh->positions + 3 * (size_t)v;
                double distance = 0.0;
                for (int k = 0; k < 3; ++k) {
                    double at = (1.0 - t) * (1.0 - t) * border[0][k] +
                                2.0 * t * (1.0 - t) * border[1][k] + (double)t * t * border[2][k];
                    distance += fabs(at - p[k]);
                }
                if (distance < 1e-4) {
                    memcpy(seen[turn][i], p, 3 * sizeof *p);
                    ++found;
                }
            }
            assert_int_equal(found, 1);
        }
        model_free(m);
        small_q3_map(&map);
    }
    assert_memory_equal(seen[0], seen[1], sizeof seen[0]);
}

typedef model *memory_reader(const uint8_t *data, size_t size, const char *name,
                             const model_options *options, umb_error *error);

/* Cut at every length, and every 32 bits of it set to what readers trip over. Exact blocks, so that
 * sanitizers see a byte too far. */
static void damage_everywhere(const uint8_t *bytes, size_t size, memory_reader *read)
{
    static const uint32_t edges[] = {0, 1, 0x7FFFFFFFu, 0x80000000u, 0xFFFFFFFFu, 0x7F800000u};
    umb_error error;
    for (size_t cut = 0; cut < size; cut += 1 + cut / 64) {
        uint8_t *copy = malloc(cut + 1);
        assert_non_null(copy);
        memcpy(copy, bytes, cut);
        model *m = read(copy, cut, "it", &defaults, &error);
        if (m == NULL) {
            assert_refused(m, &error);
        }
        model_free(m);
        free(copy);
    }
    uint8_t *copy = malloc(size);
    assert_non_null(copy);
    for (size_t at = 0; at + 4 <= size; at += 4) {
        for (size_t e = 0; e < sizeof edges / sizeof edges[0]; ++e) {
            memcpy(copy, bytes, size);
            memcpy(copy + at, &edges[e], 4);
            model *m = read(copy, size, "it", &defaults, &error);
            if (m == NULL) {
                assert_refused(m, &error);
            }
            model_free(m);
        }
    }
    free(copy);
}

static void damaged_maps(void **state)
{
    (void)state;
    small_map map;
    small_q1_map(&map);
    damage_everywhere(map.bytes, map.size, read_q1bsp);
    small_q3_map(&map);
    damage_everywhere(map.bytes, map.size, read_q3bsp);
}

static const char city[] =
    "{\"type\":\"CityJSON\",\"version\":\"1.1\",\"transform\":{\"scale\":[0.001,0.001,0.001],"
    "\"translate\":[85000.125,447000.0,0.5]},\"CityObjects\":{"
    "\"house\":{\"type\":\"Building\",\"geometry\":[],\"children\":[\"part\"]},"
    "\"part\":{\"type\":\"BuildingPart\",\"parents\":[\"house\"],\"geometry\":["
    "{\"type\":\"MultiSurface\",\"lod\":\"0\",\"boundaries\":[[[0,1,2]]]},"
    "{\"type\":\"Solid\",\"lod\":\"2.2\",\"boundaries\":[[[[0,1,2,3],[4,5,6,7]],[[0,0,1,1,2]]]],"
    "\"semantics\":{\"surfaces\":[{\"type\":\"RoofSurface\"},{\"type\":\"Window\"}],\"values\":[[0,"
    "1]]}}]},"
    "\"sign\":{\"type\":\"CityFurniture\",\"geometry\":[{\"type\":\"MultiSurface\",\"lod\":1,"
    "\"boundaries\":[[[0,1,2]],[[1,2,3]],[[2,3,0]]],\"material\":{\"day\":{\"values\":[0,1,null]}}}"
    "]},"
    "\"line\":{\"type\":\"Road\",\"geometry\":[{\"type\":\"MultiLineString\",\"lod\":1,"
    "\"boundaries\":[[0,1]]}]}},"
    "\"appearance\":{\"materials\":[{\"name\":\"a\",\"transparency\":0.0},{\"name\":\"b\","
    "\"transparency\":0.5}]},"
    "\"vertices\":[[0,0,0],[10000,0,0],[10000,10000,0],[0,10000,0],[2000,2000,0],[2000,4000,0],["
    "4000,4000,0],"
    "[4000,2000,0]]}";

static void city_parts(void **state)
{
    (void)state;
    umb_error error;
    model *m = read_cityjson((const uint8_t *)city, strlen(city), "it", &defaults, &error);
    assert_non_null(m);
    assert_int_equal(m->object_count, 3);
    assert_string_equal(m->objects[0].name, "part");
    assert_string_equal(m->objects[1].name, "sign");
    assert_int_equal(triangles_of(m, 0), 8 + 1);
    assert_int_equal(open_triangles_of(m, 0), 1);
    assert_int_equal(triangles_of(m, 1), 3);
    assert_int_equal(open_triangles_of(m, 1), 1);
    assert_int_equal(triangles_of(m, 2), 0);
    assert_true(m->up[2] == 1.0);
    /* The square with its square hole: front up, its area to the bit. */
    double area = 0.0;
    for (uint32_t t = 0; t < 8; ++t) {
        double n[3];
        float p[3];
        normal_of(m, 0, t, n, p);
        assert_true(n[2] >= 0.0);
        area += n[2];
    }
    assert_true(area == 2.0 * (100.0 - 4.0));
    /* Narrowed after the offset: a float at 447000 steps 1/32 m, so 0.125 would survive but
     * 0.001 not. */
    assert_true(m->origin[0] != 0.0 && m->origin[1] != 0.0 && m->origin[2] == 0.0);
    assert_true(m->bounds.min[0] + m->origin[0] == 85000.125);
    assert_true(m->bounds.max[1] + m->origin[1] == 447010.0);
    assert_true(m->bounds.max[2] == 0.5f);
    model_free(m);
}

static void damaged_cities(void **state)
{
    (void)state;
    static const char *const wrong[] = {
        "",
        "{",
        "[]",
        "null",
        "{}",
        "{\"type\":\"CityJSON\"}",
        "{\"type\":7,\"vertices\":[]}",
        "{\"type\":\"CityJSON\",\"vertices\":[[1,2]],\"CityObjects\":{}}",
        "{\"type\":\"CityJSON\",\"vertices\":[],\"transform\":{\"scale\":[1,1]},\"CityObjects\":{}"
        "}",
        "{\"type\":\"CityJSON\",\"vertices\":[],\"CityObjects\":{\"a\":{\"geometry\":[{\"type\":"
        "\"Solid\","
        "\"boundaries\":7}]}}}",
        "{\"type\":\"CityJSON\",\"vertices\":[],\"CityObjects\":{\"a\":{\"geometry\":[{\"type\":"
        "\"MultiSurface\","
        "\"boundaries\":[[[0,1,2]]]}]}}}",
        "{\"type\":\"CityJSON\",\"vertices\":[[0,0,0]],\"CityObjects\":{\"a\":{\"geometry\":[{"
        "\"type\":"
        "\"MultiSurface\",\"boundaries\":[[[-1,0,1.5]]]}]}}}"};
    umb_error error;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
        model *m = read_cityjson((const uint8_t *)wrong[i], strlen(wrong[i]), "it", &defaults,
                                 &error);
        assert_refused(m, &error);
    }
    for (size_t cut = 0; cut < strlen(city); cut += 7) {
        assert_refused(read_cityjson((const uint8_t *)city, cut, "it", &defaults, &error), &error);
    }
    /* A city without objects is one. */
    static const char empty[] = "{\"type\":\"CityJSON\",\"vertices\":[],\"CityObjects\":{}}";
    model *m = read_cityjson((const uint8_t *)empty, strlen(empty), "it", &defaults, &error);
    assert_non_null(m);
    assert_int_equal(m->object_count, 0);
    model_free(m);
}

/* A folder of the test's own. */
static char folder[] = "/tmp/umbrage-readers-XXXXXX";

static int make_folder(void **state)
{
    (void)state;
    return mkdtemp(folder) != NULL ? 0 : -1;
}

static const char *in_folder(const char *name)
{
    static char path[256];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static int remove_folder(void **state)
{
    (void)state;
    static const char *const names[] = {
        "it.obj", "it.mtl",    "it.ply",   "it.stl",    "it.ac",    "it.gltf",
        "it.bin", "it.bsp",    "it.pk3",   "it.glb",    "far.obj",  "it.city.json",
        "it.xyz", "holes.png", "full.png", "plain.png", "four.rgb", "three.rgb"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
        (void)unlink(in_folder(names[i]));
    }
    return rmdir(folder);
}

static const char *write_file(const char *name, const void *bytes, size_t size)
{
    const char *path = in_folder(name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
    return path;
}

static const char *write_text(const char *name, const char *text)
{
    return write_file(name, text, strlen(text));
}

static model *load(const char *path)
{
    umb_error error = {0};
    model *m = model_load(path, NULL, &error);
    if (m == NULL) {
        print_error("%s\n", error.text);
    }
    assert_non_null(m);
    return m;
}

static void obj_groups_and_materials(void **state)
{
    (void)state;
    write_text("it.mtl", "newmtl wall\nd 1\nnewmtl glass\nd 0.4\n");
    model *m = load(write_text("it.obj",
                               "mtllib it.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\n"
                               "o first\nusemtl wall\nf 1 2 3 4\nusemtl glass\nf 1 2 5\n"
                               "o second\nusemtl wall\nf 2 3 5\n"));
    assert_int_equal(m->object_count, 3);
    assert_int_equal(m->triangles, 4);
    assert_string_equal(m->objects[0].name, "first");
    assert_int_equal(triangles_of(m, 0), 2);
    assert_int_equal(open_triangles_of(m, 0), 0);
    assert_int_equal(open_triangles_of(m, 1), 1);
    assert_int_equal(triangles_of(m, 2), 1);
    model_free(m);
}

static void write_png(const char *name, bool alpha, uint8_t value)
{
    uint8_t pixels[16] = {9, 9, 9, 255, 9, 9, 9, value, 9, 9, 9, 255, 9, 9, 9, 255};
    uint8_t opaque[12] = {0};
    png_image image = {.version = PNG_IMAGE_VERSION, .width = 2, .height = 2};
    image.format = alpha ? PNG_FORMAT_RGBA : PNG_FORMAT_RGB;
    assert_true(
        png_image_write_to_file(&image, in_folder(name), 0, alpha ? pixels : opaque, 0, NULL));
}

/* A picture with holes makes its surface open; a full one does not, nor does one that is not
 * there. */
static void cut_out_textures(void **state)
{
    (void)state;
    write_png("holes.png", true, 0);
    write_png("full.png", true, 255);
    write_png("plain.png", false, 0);
    static const uint8_t sgi[2][12] = {{1, 0xDA, 0, 1, 0, 3, 0, 1, 0, 1, 0, 4},
                                       {1, 0xDA, 0, 1, 0, 3, 0, 1, 0, 1, 0, 3}};
    write_file("four.rgb", sgi[0], 12);
    write_file("three.rgb", sgi[1], 12);
    static const char *const pictures[] = {"holes.png", "full.png",  "plain.png",
                                           "four.rgb",  "three.rgb", "gone.png"};
    char text[512] = "";
    for (size_t i = 0; i < 6; ++i) {
        sprintf(text + strlen(text), "newmtl m%zu\nmap_Kd %s\n", i, pictures[i]);
    }
    write_text("it.mtl", text);
    strcpy(text, "mtllib it.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\n");
    for (size_t i = 0; i < 6; ++i) {
        sprintf(text + strlen(text), "o o%zu\nusemtl m%zu\nf 1 2 3\n", i, i);
    }
    model *m = load(write_text("it.obj", text));
    assert_int_equal(m->object_count, 6);
    for (uint32_t i = 0; i < 6; ++i) {
        assert_int_equal(open_triangles_of(m, i), i == 0 || i == 3);
    }
    model_free(m);
}

/* Decimals far from the origin: neighbouring corners a millimetre apart stay apart. */
static void far_obj(void **state)
{
    (void)state;
    model *m = load(
        write_text("far.obj", "v 85000.001 447000.002 1.5 0.5 0.5 0.5\nv 85000.002 447000.002 1.5\n"
                              "v 85010.000 447000.000 1.5\nv 85000.000 447010.000 2.5\n"
                              "o a\nf 1 2 4\nf 2 3 4\n"));
    static const double expected[4][3] = {{85000.001, 447000.002, 1.5},
                                          {85000.002, 447000.002, 1.5},
                                          {85010.0, 447000.0, 1.5},
                                          {85000.0, 447010.0, 2.5}};
    assert_int_equal(m->object_count, 1);
    for (int e = 0; e < 4; ++e) {
        bool found = false;
        for (uint32_t v = 0; v < mesh_of(m, 0)->position_count; ++v) {
            float p[3];
            model_world_vertex(m, &m->objects[0], v, p);
            double distance = 0.0;
            for (int k = 0; k < 3; ++k) {
                distance = fmax(distance, fabs(p[k] + m->origin[k] - expected[e][k]));
            }
            found = found || distance < 4e-6;
        }
        assert_true(found);
    }
    model_free(m);
}

/* Two nodes share a mesh of two primitives, one of them lines; materials say what blocks. */
static void gltf_instances(void **state)
{
    (void)state;
    float positions[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    uint16_t indices[6] = {0, 1, 2, 0, 1, 0};
    uint8_t bytes[48];
    memcpy(bytes, positions, 36);
    memcpy(bytes + 36, indices, 12);
    write_file("it.bin", bytes, sizeof bytes);
    model *m = load(write_text(
        "it.gltf",
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":["
        "{\"name\":\"root\",\"children\":[1,2],\"translation\":[10,0,0]},"
        "{\"name\":\"a\",\"mesh\":0},"
        "{\"name\":\"b\",\"mesh\":0,\"scale\":[-1,1,1],\"translation\":[5,0,0],\"children\":[3]},"
        "{\"name\":\"c\",\"mesh\":1}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1,\"material\":"
        "0},"
        "{\"attributes\":{\"POSITION\":0},\"indices\":2,\"mode\":1}]},"
        "{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1,\"material\":1}]}],"
        "\"materials\":[{\"doubleSided\":true},{\"alphaMode\":\"MASK\"}],"
        "\"buffers\":[{\"uri\":\"it.bin\",\"byteLength\":48}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":36},"
        "{\"buffer\":0,\"byteOffset\":36,\"byteLength\":12}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\","
        "\"min\":[0,0,0],\"max\":[1,1,0]},"
        "{\"bufferView\":1,\"componentType\":5123,\"count\":3,\"type\":\"SCALAR\"},"
        "{\"bufferView\":1,\"byteOffset\":6,\"componentType\":5123,\"count\":2,\"type\":\"SCALAR\"}"
        "]}"));
    assert_int_equal(m->object_count, 5);
    assert_int_equal(m->mesh_count, 2);
    assert_int_equal(m->triangles, 3);
    assert_int_equal(m->objects[0].mesh, m->objects[2].mesh);
    assert_int_equal(m->objects[1].mesh, MODEL_NONE);
    assert_int_equal(m->objects[3].mesh, MODEL_NONE);
    assert_int_equal(mesh_of(m, 0)->flags[0], UMB_TRIANGLE_TWO_SIDED);
    assert_int_equal(mesh_of(m, 4)->flags[0], UMB_TRIANGLE_OPEN);
    assert_false(model_mirrored(&m->objects[0]));
    assert_true(model_mirrored(&m->objects[2]));
    assert_true(m->objects[0].bounds.max[0] == 11.0f);
    assert_true(m->objects[2].bounds.min[0] == 14.0f);
    assert_true(m->objects[4].bounds.min[0] == 14.0f);
    model_free(m);
}

static void other_formats(void **state)
{
    (void)state;
    model *m = load(write_text("it.ply",
                               "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n"
                               "property float y\nproperty float z\nelement face 1\n"
                               "property list uchar int vertex_indices\nend_header\n"
                               "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"));
    assert_int_equal(m->triangles, 2);
    model_free(m);
    m = load(write_text("it.stl",
                        "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                        "vertex 0 1 0\nendloop\nendfacet\nendsolid a\n"));
    assert_int_equal(m->triangles, 1);
    model_free(m);
    m = load(write_text(
        "it.ac", "AC3Db\nMATERIAL \"a\" rgb 1 1 1 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans 0\n"
                 "MATERIAL \"b\" rgb 1 1 1 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans 0.5\n"
                 "OBJECT world\nkids 3\n"
                 "OBJECT poly\nname \"WALL\"\nnumvert 3\n0 0 0\n1 0 0\n0 1 0\nnumsurf 1\nSURF "
                 "0x0\nmat 0\nrefs 3\n"
                 "0 0 0\n1 0 0\n2 0 0\nkids 0\n"
                 "OBJECT poly\nname \"PANE\"\nnumvert 3\n0 0 0\n1 0 0\n0 1 0\nnumsurf 1\nSURF "
                 "0x0\nmat 1\nrefs 3\n"
                 "0 0 0\n1 0 0\n2 0 0\nkids 0\n"
                 "OBJECT poly\nname \"TREEP1\"\nnumvert 3\n0 0 0\n1 0 0\n0 1 0\nnumsurf 1\nSURF "
                 "0x0\nmat 0\nrefs 3\n"
                 "0 0 0\n1 0 0\n2 0 0\nkids 0\n"));
    assert_int_equal(m->object_count, 3);
    assert_int_equal(open_triangles_of(m, 0), 0);
    assert_int_equal(open_triangles_of(m, 1), 1);
    assert_int_equal(open_triangles_of(m, 2), 1);
    model_free(m);
}

static void write_archive(const char *path, const small_map *map, int maps)
{
    static const char *const names[] = {"maps/one.bsp", "maps/two.bsp", "scripts/one.shader"};
    zipFile zip = zipOpen(path, APPEND_STATUS_CREATE);
    assert_non_null(zip);
    for (int i = 2; i >= 0; --i) {
        if (i < maps || i == 2) {
            assert_int_equal(
                zipOpenNewFileInZip(zip, names[i], NULL, NULL, 0, NULL, 0, NULL, Z_DEFLATED, 6), 0);
            assert_int_equal(zipWriteInFileInZip(zip, map->bytes, (unsigned)map->size), 0);
            assert_int_equal(zipCloseFileInZip(zip), 0);
        }
    }
    assert_int_equal(zipClose(zip, NULL), 0);
}

static void maps_by_name_and_in_archives(void **state)
{
    (void)state;
    small_map map;
    umb_error error;
    char name[300];
    small_q1_map(&map);
    model *m = load(write_file("it.bsp", map.bytes, map.size));
    assert_int_equal(m->object_count, 4);
    model_free(m);
    small_q3_map(&map);
    write_archive(in_folder("it.pk3"), &map, 1);
    m = load(in_folder("it.pk3"));
    assert_int_equal(m->triangles, SMALL_Q3_TRIANGLES);
    model_free(m);
    (void)unlink(in_folder("it.pk3"));
    write_archive(in_folder("it.pk3"), &map, 2);
    assert_null(model_load(in_folder("it.pk3"), NULL, &error));
    assert_non_null(strstr(error.text, "maps/two.bsp"));
    snprintf(name, sizeof name, "%s:maps/two.bsp", in_folder("it.pk3"));
    m = load(name);
    assert_int_equal(m->object_count, 4);
    model_free(m);
    snprintf(name, sizeof name, "%s:maps/three.bsp", in_folder("it.pk3"));
    assert_null(model_load(name, NULL, &error));
    assert_non_null(strstr(error.text, "maps/one.bsp"));
    snprintf(name, sizeof name, "%s:scripts/one.shader", in_folder("it.pk3"));
    m = load(name); /* the bytes tell what it is */
    model_free(m);
    write_text("it.pk3", "no archive at all");
    assert_null(model_load(in_folder("it.pk3"), NULL, &error));
}

static void bad_files(void **state)
{
    (void)state;
    umb_error error;
    static const char *const names[] = {"it.obj", "it.ply", "it.stl", "it.ac",        "it.gltf",
                                        "it.glb", "it.bsp", "it.pk3", "it.city.json", "it.xyz"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
        assert_null(model_load(write_text(names[i], ""), NULL, &error));
        assert_non_null(strstr(error.text, names[i]));
        assert_null(model_load(write_text(names[i], "\x01\x02 nothing of the kind\n"), NULL, &error));
        assert_non_null(strstr(error.text, names[i]));
        assert_null(strchr(error.text, '\n'));
        assert_int_equal(unlink(in_folder(names[i])), 0);
        assert_null(model_load(in_folder(names[i]), NULL, &error));
        assert_int_not_equal(error.code, UMB_OK);
    }
    assert_null(model_load(folder, NULL, &error));
    assert_null(model_load("", NULL, NULL));
}

/* Counts that other tools found. triangles of CityJSON depend on who triangulates: a range. */
static void real_scenes(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        uint32_t objects;
        uint64_t least, most, opaque;
    } scenes[] = {
        {"delft/delft_3dfier_lod1_terrain.obj", 777, 28619, 28619, 28619},
        {"delft/delft_3dbag_5910_lod22.city.json", 430, 77730, 77750, 0},
        {"openarena/oa_dm1.bsp", 422 + 8, 7532, 7532, 0},
        {"openarena/oa_dm2.bsp", 1041 + 29, 12033, 12033, 0},
        {"openarena/oa_dm3.bsp", 911 + 9, 22520, 22520, 0},
        {"openarena/czest3ctf.bsp", 1441 + 5, 34639, 34639, 0},
        {"openarena/ctf_inyard.bsp", 2006 + 17, 29348, 29348, 0},
        {"quake/e1m1.bsp", 1206 + 57, 16104, 16104, 0},
        {"quake/e1m3.bsp", 996 + 105, 14412, 14412, 0},
        {"quake/e1m4.bsp", 1321 + 91, 18052, 18052, 0},
        {"quake/start.bsp", 1172 + 54, 16706, 16706, 0},
        {"castle/castle.glb", 2114, 1070891, 1070891, 1070891},
        {"castle/castle_occluders.glb", 114, 41660, 41660, 41660},
        {"carrier/truman.ac", 285, 99144, 99144, 99144 - 44},
        {"schependomlaan/V_L_Constructief.ifc", 532, 11230, 11230, 11230},
        {"schependomlaan/WILLEMSEN-Laagbouw.ifc", 978, 12524, 12524, 12524},
        {"street1/street-1.acc", 1436, 25508, 25508, 0},
    };
    const char *root = getenv("UMBRAGE_SCENES");
    if (root == NULL || root[0] == 0) {
        print_message("UMBRAGE_SCENES is not set: real scenes are not read\n");
        skip();
    }
    for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; ++i) {
        char path[4096];
        snprintf(path, sizeof path, "%s/%s", root, scenes[i].name);
        model *m = load(path);
        uint64_t opaque = 0;
        for (uint32_t o = 0; o < m->object_count; ++o) {
            opaque += triangles_of(m, o) - open_triangles_of(m, o);
        }
        assert_int_equal(m->object_count, scenes[i].objects);
        assert_in_range(m->triangles, scenes[i].least, scenes[i].most);
        if (scenes[i].opaque != 0) {
            assert_int_equal(opaque, scenes[i].opaque);
        }
        model_free(m);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quake_room),
        cmocka_unit_test(quake3_clusters),
        cmocka_unit_test(patch_borders_agree),
        cmocka_unit_test(damaged_maps),
        cmocka_unit_test(city_parts),
        cmocka_unit_test(damaged_cities),
        cmocka_unit_test(obj_groups_and_materials),
        cmocka_unit_test(cut_out_textures),
        cmocka_unit_test(far_obj),
        cmocka_unit_test(gltf_instances),
        cmocka_unit_test(other_formats),
        cmocka_unit_test(maps_by_name_and_in_archives),
        cmocka_unit_test(bad_files),
        cmocka_unit_test(real_scenes),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}

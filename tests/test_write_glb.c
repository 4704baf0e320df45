/* What write_glb writes, the importer reads back: objects, numbers, floats, flags, names. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "io/write_glb.h"

static char path[64];

static model *round_trip(const model *m)
{
    umb_error error = {0};
    snprintf(path, sizeof path, "test_write_glb_%ld.glb", (long)getpid());
    if (!write_glb(m, path, &error)) {
        fail_msg("%s", error.text);
    }
    model *back = model_load(path, NULL, &error);
    remove(path);
    if (!back) {
        fail_msg("%s", error.text);
    }
    return back;
}

static void assert_same(const model *a, const model *b)
{
    assert_int_equal(a->object_count, b->object_count);
    assert_int_equal(a->mesh_count, b->mesh_count);
    assert_int_equal(a->triangles, b->triangles);
    for (uint32_t o = 0; o < a->object_count; ++o) {
        const model_object *p = &a->objects[o], *q = &b->objects[o];
        assert_string_equal(p->name, q->name);
        assert_int_equal(p->mesh == MODEL_NONE, q->mesh == MODEL_NONE);
        if (p->mesh == MODEL_NONE) {
            continue;
        }
        const model_mesh *s = &a->meshes[p->mesh], *t = &b->meshes[q->mesh];
        assert_int_equal(s->triangle_count, t->triangle_count);
        assert_memory_equal(s->flags, t->flags, s->triangle_count);
        for (uint32_t i = 0; i < 3 * s->triangle_count; ++i) {
            float v[3], w[3];
            model_world_vertex(a, p, s->indices[i], v);
            model_world_vertex(b, q, t->indices[i], w);
            assert_true(v[0] == w[0] && v[1] == w[1] && v[2] == w[2]);
        }
    }
}

static void test_generated(void **state)
{
    (void)state;
    static const char *const specs[] = {"gen:blocks,g=5", "gen:city,triangles=20k",
                                        "gen:boxfield,polygons=6k", "gen:building,floors=2,rooms=6"};
    for (size_t k = 0; k < sizeof specs / sizeof specs[0]; ++k) {
        umb_error error = {0};
        model *m = model_load(specs[k], NULL, &error);
        assert_non_null(m);
        model *back = round_trip(m);
        assert_same(m, back);
        model_free(m);
        model_free(back);
    }
}

static uint32_t add_pair(model *m, uint8_t first, uint8_t second)
{
    float positions[12] = {0, 0, 0, 1.1f, 0, 0, 0, 1.3e-7f, 0, 0, 0, 3.4e30f};
    uint32_t indices[6] = {0, 1, 2, 1, 0, 3};
    uint8_t flags[2] = {first, second};
    model_mesh mesh = {positions, indices, flags, 4, 2};
    return model_add_mesh(m, &mesh);
}

/* Flags of whole meshes survive; mixed ones become what hides least. An object without triangles
 * keeps its number. Names are escaped. */
static void test_flags_and_gaps(void **state)
{
    (void)state;
    enum { TWO = UMB_TRIANGLE_TWO_SIDED, OPEN = UMB_TRIANGLE_OPEN };
    static const uint8_t cases[][3] = {{0, 0, 0},          {TWO, TWO, TWO},
                                       {OPEN, OPEN, OPEN}, {TWO, 0, 0},
                                       {0, OPEN, OPEN},    {TWO | OPEN, TWO, TWO | OPEN},
                                       {TWO, OPEN, OPEN}};
    enum { COUNT = sizeof cases / sizeof cases[0] };
    umb_error error = {0};
    model *m = model_create();
    umb_transform t = {{{0.1f, 0, 0.3f, 1e-30f}, {0, -1.7f, 0, 5e8f}, {1.0f / 3.0f, 0, 1, -0.7f}}};
    for (uint32_t k = 0; k < COUNT; ++k) {
        assert_int_equal(model_add_object(m, "a \"quoted\" \\ name\n \xC3\xA9",
                                          add_pair(m, cases[k][0], cases[k][1]), k % 2 ? &t : NULL),
                         2 * k);
        assert_int_equal(model_add_object(m, "empty \xFF", MODEL_NONE, NULL), 2 * k + 1);
    }
    assert_true(model_finish(m, NULL, &error));
    model *back = round_trip(m);
    assert_int_equal(back->object_count, 2 * COUNT);
    for (uint32_t k = 0; k < COUNT; ++k) {
        const model_object *a = &m->objects[2 * k], *b = &back->objects[2 * k];
        assert_string_equal(b->name, a->name);
        assert_memory_equal(&a->bounds, &b->bounds, sizeof a->bounds);
        for (int f = 0; f < 2; ++f) {
            assert_int_equal(back->meshes[b->mesh].flags[f], cases[k][2]);
        }
        assert_int_equal(back->objects[2 * k + 1].mesh, MODEL_NONE);
        assert_string_equal(back->objects[2 * k + 1].name, "empty ?");
    }
    model_free(m);
    model_free(back);
}

static void test_failures(void **state)
{
    (void)state;
    umb_error error = {0};
    model *m = model_create();
    assert_false(write_glb(m, "nothing.glb", &error));
    assert_int_equal(error.code, UMB_ERROR_ARGUMENT);
    assert_int_equal(access("nothing.glb", F_OK), -1);
    model_add_object(m, "o", add_pair(m, 0, 0), NULL);
    assert_true(model_finish(m, NULL, &error));
    assert_false(write_glb(m, "no/such/folder/a.glb", &error));
    assert_non_null(strstr(error.text, "no/such/folder/a.glb"));
    if (access("/dev/full", W_OK) == 0) {
        assert_false(write_glb(m, "/dev/full", &error));
        assert_int_equal(access("/dev/full", F_OK), 0);
    }
    model_free(m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_generated),
                                       cmocka_unit_test(test_flags_and_gaps),
                                       cmocka_unit_test(test_failures)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Exact decisions about whole objects: what has a confirmed sight-line is never called hidden, what is
 * called hidden is met by no ray, and most objects of small scenes are decided. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/micro_scenes.h"
#include "support/real_scenes.h"
#include "truth/cover.h"

typedef struct tally {
    uint64_t seen, hidden, open, found, wrong;
} tally;

/* Every object in view, for both renderers, against what rays prove; large scenes: only those that
 * rays see. */
static void compare(const model *m, truth *oracle, const umb_view *view, const char *label,
                    bool large, tally *sum)
{
    truth_options options = {.grid_width = 96, .grid_height = 96, .guided_rays = 60000};
    truth_result r;
    umb_error error = {0};
    assert_true(truth_view(oracle, view, &options, &r, &error));
    oracle_view v;
    oracle_view_make(oracle, view, &options, &v);
    for (uint32_t i = 0; i < 2 * m->object_count; ++i) {
        const model_object *o = &m->objects[i / 2];
        const truth_witness *proof = i % 2 == 0 ? &r.culling[i / 2] : &r.two_sided[i / 2];
        if (o->mesh == MODEL_NONE || !oracle_view_meets_box(&v, &o->bounds)) {
            continue;
        }
        if (large && proof->confirmed == 0) {
            continue;
        }
        truth_witness w;
        cover_verdict verdict = oracle_cover(oracle, &v, i / 2, (uint8_t)(1u << i % 2),
                                             large ? 3000 : COVER_ACCUSED, &w);
        bool seen = proof->confirmed != 0;
        if (seen && verdict == COVER_HIDDEN) {
            printf(
                "# %s: object %u, renderer %u: seen from %.17g,%.17g,%.17g at %.17g,%.17g,%.17g\n",
                label, i / 2, 1u << i % 2, proof->from[0], proof->from[1], proof->from[2],
                proof->to[0], proof->to[1], proof->to[2]);
            ++sum->wrong;
        }
        sum->seen += seen;
        sum->hidden += verdict == COVER_HIDDEN;
        sum->open += verdict == COVER_OPEN;
        sum->found += verdict == COVER_SEEN && !seen;
    }
    truth_result_free(&r);
}

static void test_micro_scenes(void **state)
{
    (void)state;
    const char *size = getenv("UMBRAGE_TEST_SIZE"), *many = getenv("UMBRAGE_MICRO_SCENES");
    uint64_t count = many != NULL                     ? strtoull(many, NULL, 10)
                     : size != NULL && size[0] == 's' ? 30
                                                      : 120;
    tally sums[16] = {{0}};
    uint64_t wrong = 0, decided = 0;
    for (uint64_t i = 0; i < count; ++i) {
        micro_scene s;
        umb_error error = {0};
        char label[64];
        assert_true(micro_scene_make(i, &s));
        truth *oracle = truth_create(s.model, &error);
        assert_non_null(oracle);
        (void)snprintf(label, sizeof label, "micro scene %llu (%s)", (unsigned long long)i, s.kind);
        compare(s.model, oracle, &s.view, label, false, &sums[i % micro_scene_kinds()]);
        truth_destroy(oracle);
        micro_scene_free(&s);
    }
    for (uint32_t k = 0; k < micro_scene_kinds(); ++k) {
        const tally *c = &sums[k];
        printf("# kind %u: seen %llu hidden %llu open %llu seen by exact arithmetic alone %llu\n",
               k, (unsigned long long)c->seen, (unsigned long long)c->hidden,
               (unsigned long long)c->open, (unsigned long long)c->found);
        wrong += c->wrong;
        decided += c->hidden;
    }
    assert_int_equal(wrong, 0);
    assert_true(decided > 0);
}

/* Seen objects of a scene, from rows of its path. */
static void look(const model *m, const real_scene *scene, const camera_path *path, const char *name)
{
    umb_error error = {0};
    tally sum = {0};
    truth *oracle = truth_create(m, &error);
    assert_non_null(oracle);
    for (uint32_t k = 0; k < 4; ++k) {
        umb_view view;
        assert_true(real_scene_view(scene, m, path->rows[k * (path->count / 4)], k == 3, &view));
        compare(m, oracle, &view, name, true, &sum);
    }
    printf("# %s: seen %llu called hidden %llu\n", name, (unsigned long long)sum.seen,
           (unsigned long long)sum.wrong);
    assert_true(sum.seen > 0);
    assert_int_equal(sum.wrong, 0);
    truth_destroy(oracle);
}

static void test_generated_scenes(void **state)
{
    (void)state;
    static const char *const names[] = {"gen:building,floors=1", "gen:city,triangles=50k",
                                        "gen:blocks,g=8", "gen:boxfield,polygons=20k"};
    for (int k = 0; k < 4; ++k) {
        umb_error error = {0};
        camera_path path;
        real_scene scene = {.up = {0, 1, 0}, .fov_y = 1.0, .near_depth = 0.1, .ortho_height = 20.0};
        model *m = model_load(names[k], NULL, &error);
        assert_non_null(m);
        assert_true(camera_path_load(names[k], &path, &error));
        look(m, &scene, &path, names[k]);
        camera_path_free(&path);
        model_free(m);
    }
}

static void test_real_scenes(void **state)
{
    (void)state;
    const char *folder = getenv("UMBRAGE_SCENES"), *size = getenv("UMBRAGE_TEST_SIZE");
    bool small = size != NULL && size[0] == 's', full = size != NULL && size[0] == 'f';
    if (folder == NULL || folder[0] == '\0') {
        print_message("skipped: UMBRAGE_SCENES names no folder of real scenes\n");
        skip();
    }
    real_scenes all;
    umb_error error = {0};
    assert_true(real_scenes_find(folder, &all, &error));
    for (uint32_t k = 0; k < all.count; k += full ? 1 : small ? 16 : 6) {
        camera_path path;
        model *m = model_load(all.scenes[k].file, NULL, &error);
        assert_non_null(m);
        assert_true(camera_path_load(all.scenes[k].path, &path, &error));
        look(m, &all.scenes[k], &path, all.scenes[k].name);
        camera_path_free(&path);
        model_free(m);
    }
    real_scenes_free(&all);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_micro_scenes),
                                       cmocka_unit_test(test_generated_scenes),
                                       cmocka_unit_test(test_real_scenes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* The oracle catches a culler that lies. The library is handed a scene with a planted mistake -
 * objects smaller by one hundredth than what is drawn, or occluders larger by as much - while the
 * oracle keeps the true model: it must prove, by confirmed sight-lines, that something visible was
 * hidden. The same scene without the mistake must pass. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/micro_scenes.h"
#include "support/planted.h"
#include "support/real_scenes.h"
#include "support/strict.h"

typedef struct planted {
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
    uint32_t *ids;
} planted;

static void answer_view(planted *p, const umb_view *view, uint32_t objects, strict_answer *out)
{
    umb_visible_set seen;
    assert_int_equal(umb_cull(p->culler, view, &seen), UMB_OK);
    free(p->ids);
    out->ids = p->ids = malloc(((size_t)seen.count + 1) * sizeof *p->ids);
    assert_non_null(p->ids);
    out->count = planted_answer(&seen, objects, p->ids);
}

/* Look at the views with each mistake; sums has one count for each. */
static void look(const model *m, truth *oracle, const umb_view *views, uint32_t view_count,
                 bool weld, const truth_options *options, strict_count *sums)
{
    planted all[PLANT_COUNT] = {{0}};
    for (int p = 0; p < PLANT_COUNT; ++p) {
        all[p].scene = planted_scene(m, (plant)p, weld);
        assert_non_null(all[p].scene);
        assert_int_equal(umb_index_create(all[p].scene, NULL, &all[p].index), UMB_OK);
        assert_int_equal(umb_culler_create(all[p].index, NULL, &all[p].culler), UMB_OK);
    }
    for (uint32_t k = 0; k < view_count; ++k) {
        strict_answer answers[PLANT_COUNT];
        for (int p = 0; p < PLANT_COUNT; ++p) {
            /* Without a label: what a planted mistake hides is as it should be. */
            answers[p].label = p == PLANT_NONE ? "without a mistake" : NULL;
            answers[p].sum = &sums[p];
            answer_view(&all[p], &views[k], m->object_count, &answers[p]);
        }
        assert_true(strict_check_all(oracle, m, &views[k], answers, PLANT_COUNT, options));
    }
    for (int p = 0; p < PLANT_COUNT; ++p) {
        umb_culler_destroy(all[p].culler);
        umb_index_destroy(all[p].index);
        umb_scene_destroy(all[p].scene);
        free(all[p].ids);
    }
}

static void judge(const char *name, const strict_count *sums)
{
    for (int p = 0; p < PLANT_COUNT; ++p) {
        printf("# %s, %s: views %llu reported %llu wrongly hidden %llu unconfirmed %llu\n", name,
               plant_name((plant)p), (unsigned long long)sums[p].views,
               (unsigned long long)sums[p].reported, (unsigned long long)sums[p].wrongly_hidden,
               (unsigned long long)sums[p].unconfirmed);
    }
    assert_int_equal(sums[PLANT_NONE].wrongly_hidden, 0);
    assert_true(sums[PLANT_SMALL_OBJECTS].wrongly_hidden > 0);
    assert_true(sums[PLANT_LARGE_OCCLUDERS].wrongly_hidden > 0);
}

static bool small_size(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && size[0] == 's';
}

static void test_micro_scenes(void **state)
{
    (void)state;
    strict_count sums[PLANT_COUNT] = {{0}};
    uint64_t count = small_size() ? 40 : 120;
    for (uint64_t i = 0; i < count; ++i) {
        micro_scene s;
        umb_error error = {0};
        assert_true(micro_scene_make(i, &s));
        truth *oracle = truth_create(s.model, &error);
        assert_non_null(oracle);
        truth_options options = {.grid_width = 96, .grid_height = 96, .guided_rays = 60000};
        look(s.model, oracle, &s.view, 1, s.weld, &options, sums);
        truth_destroy(oracle);
        micro_scene_free(&s);
    }
    judge("micro scenes", sums);
}

static void look_at_scene(const real_scene *scene, strict_count *sums)
{
    enum { MAX_VIEWS = 16 };
    umb_error error = {0};
    camera_path path;
    umb_view views[MAX_VIEWS];
    model *m = model_load(scene->file, NULL, &error);
    assert_non_null(m);
    assert_true(camera_path_load(scene->path, &path, &error));
    truth *oracle = truth_create(m, &error);
    assert_non_null(oracle);
    uint32_t count = MAX_VIEWS;
    for (uint32_t k = 0; k < count; ++k) {
        const double *row = path.rows[k * (scene->nasty_from / count)];
        assert_true(real_scene_view(scene, m, row, false, &views[k]));
    }
    truth_options options = {.grid_width = 384, .grid_height = 192, .guided_rays = 250000};
    look(m, oracle, views, count, true, &options, sums);
    camera_path_free(&path);
    truth_destroy(oracle);
    model_free(m);
}

static void test_real_scenes(void **state)
{
    (void)state;
    const char *folder = getenv("UMBRAGE_SCENES");
    if (folder == NULL || folder[0] == '\0') {
        print_message("skipped: UMBRAGE_SCENES names no folder of real scenes\n");
        skip();
    }
    real_scenes all;
    umb_error error = {0};
    if (!real_scenes_find(folder, &all, &error)) {
        fail_msg("%s", error.text);
    }
    uint32_t looked = 0;
    strict_count sums[PLANT_COUNT] = {{0}};
    for (uint32_t i = 0; i < all.count; ++i) {
        const char *name = all.scenes[i].name;
        if (strcmp(name, "oa_dm2") == 0 || (strcmp(name, "czest3ctf") == 0 && !small_size())) {
            look_at_scene(&all.scenes[i], sums);
            ++looked;
        }
    }
    real_scenes_free(&all);
    if (looked == 0) {
        print_message("skipped: neither oa_dm2 nor czest3ctf is there\n");
        skip();
    }
    judge("levels", sums);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_micro_scenes),
                                       cmocka_unit_test(test_real_scenes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

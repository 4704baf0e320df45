/* Nothing that can be seen is hidden, on the real scenes of UMBRAGE_SCENES; and levels are really
 * culled.
 *
 * test_scenes [PART PARTS [NAME]]: as scene_tests_arguments() takes them. UMBRAGE_TEST_SIZE chooses the views. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/scene_tests.h"
#include "support/strict.h"

#define MAX_RASTERS 3

/* Methods without a raster, which answer beside those of each raster size. */
static const umb_method OBJECT_SPACE[] = {UMB_METHOD_PLANES, UMB_METHOD_SHADOW_FRUSTA, UMB_METHOD_OCCLUSION_TREE};
enum { OBJECT_SPACE_COUNT = sizeof OBJECT_SPACE / sizeof OBJECT_SPACE[0], MAX_ANSWERS = MAX_RASTERS + OBJECT_SPACE_COUNT };

/* How much is looked at. */
typedef struct effort {
    uint32_t walk_step, nasty_step, ortho_step; /* every so manyth row; nasty: of the nasty ones */
    uint32_t rasters[MAX_RASTERS][2];
    uint32_t raster_count;
    truth_options oracle;
} effort;

static const effort SMALL = {
    160, 5, 480, {{1024, 288}}, 1, {.grid_width = 192, .grid_height = 96, .guided_rays = 60000}};
static const effort NORMAL = {
    20, 1, 60, {{1024, 288}}, 1, {.grid_width = 384, .grid_height = 192, .guided_rays = 250000}};
static const effort FULL = {1,  1,
                            10, {{256, 144}, {1024, 288}, {2048, 576}},
                            3,  {.grid_width = 384, .grid_height = 192, .guided_rays = 1000000}};

/* One scene with everything that looks at it. */
typedef struct stand {
    const real_scene *scene;
    const effort *effort;
    model *model;
    umb_scene *built;
    umb_index *index;
    umb_culler *cullers[MAX_ANSWERS], *frustum;
    truth *oracle;
    camera_path path;
    strict_count walk[MAX_ANSWERS], nasty[MAX_ANSWERS], ortho[MAX_ANSWERS];
} stand;

/* The rasters first, then the others. */
static uint32_t answer_count(const stand *s)
{
    return s->effort->raster_count + OBJECT_SPACE_COUNT;
}

static umb_method method_of(const stand *s, uint32_t answer)
{
    return answer < s->effort->raster_count ? UMB_METHOD_RASTER : OBJECT_SPACE[answer - s->effort->raster_count];
}

/* What an answer was found with, for people. */
static const char *title_of(const stand *s, uint32_t answer, char text[32])
{
    if (answer < s->effort->raster_count) {
        const uint32_t *size = s->effort->rasters[answer];
        (void)snprintf(text, 32, "%ux%u", size[0], size[1]);
    } else {
        (void)snprintf(text, 32, "%s", umb_method_name(method_of(s, answer)));
    }
    return text;
}

static const effort *effort_wanted(effort *changed)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE"), *step = getenv("UMBRAGE_SCENES_STEP");
    *changed = size == NULL || size[0] == 'n' ? NORMAL : size[0] == 'f' ? FULL : SMALL;
    if (step != NULL && atoi(step) > 0) {
        changed->walk_step = (uint32_t)atoi(step);
    }
    return changed;
}

static void set_up(stand *s)
{
    umb_error error = {0};
    s->model = model_load(s->scene->file, NULL, &error);
    if (s->model == NULL || !camera_path_load(s->scene->path, &s->path, &error)) {
        fail_msg("%s: %s", s->scene->file, error.text);
    }
    umb_tasks tasks = {0};
    s->built = model_scene(s->model, true, tasks, NULL, &error);
    assert_non_null(s->built);
    s->oracle = truth_create(s->model, &error);
    assert_non_null(s->oracle);
    assert_int_equal(umb_index_create(s->built, NULL, &s->index), UMB_OK);
    for (uint32_t r = 0; r < answer_count(s); ++r) {
        umb_culler_def def = {.method = method_of(s, r)};
        assert_int_equal(umb_culler_create(s->index, &def, &s->cullers[r]), UMB_OK);
    }
    umb_culler_def none = {.method = UMB_METHOD_NONE};
    assert_int_equal(umb_culler_create(s->index, &none, &s->frustum), UMB_OK);
}

static void tear_down(stand *s)
{
    camera_path_free(&s->path);
    for (uint32_t r = 0; r < answer_count(s); ++r) {
        umb_culler_destroy(s->cullers[r]);
    }
    umb_culler_destroy(s->frustum);
    umb_index_destroy(s->index);
    umb_scene_destroy(s->built);
    truth_destroy(s->oracle);
    model_free(s->model);
}

static void check_row(stand *s, uint32_t row, bool ortho, strict_count *sums)
{
    umb_view view;
    umb_visible_set seen;
    assert_true(real_scene_view(s->scene, s->model, s->path.rows[row], ortho, &view));
    assert_int_equal(umb_cull(s->frustum, &view, &seen), UMB_OK);
    uint32_t in_frustum = seen.count;
    strict_answer answers[MAX_ANSWERS];
    char labels[MAX_ANSWERS][128], title[32];
    for (uint32_t r = 0; r < answer_count(s); ++r) {
        if (r < s->effort->raster_count) {
            view.buffer_width = s->effort->rasters[r][0];
            view.buffer_height = s->effort->rasters[r][1];
        }
        assert_int_equal(umb_cull(s->cullers[r], &view, &seen), UMB_OK);
        (void)snprintf(labels[r], sizeof labels[r], "%s row %u%s, %s", s->scene->name, row, ortho ? " parallel" : "",
                       title_of(s, r, title));
        answers[r] = (strict_answer){seen.objects, seen.count, labels[r], &sums[r]};
        sums[r].in_frustum += in_frustum;
    }
    assert_true(strict_check_all(s->oracle, s->model, &view, answers, answer_count(s), &s->effort->oracle));
}

static void say(const stand *s, uint32_t answer, const char *views, const strict_count *c)
{
    char title[32];
    printf("# %-26s %-14s %-8s views %3llu in frustum %7.1f reported %6.1f truly visible %6.1f "
           "wrong %llu "
           "unconfirmed %llu conservativity %.3f\n",
           s->scene->name, title_of(s, answer, title), views, (unsigned long long)c->views,
           scene_tests_mean(c->in_frustum, c->views), scene_tests_mean(c->reported, c->views),
           scene_tests_mean(c->truth_visible, c->views), (unsigned long long)c->wrongly_hidden,
           (unsigned long long)c->unconfirmed, scene_tests_mean(c->reported, c->truth_visible));
    (void)fflush(stdout);
}

/* Returns how many objects were wrongly hidden, plus one for each level that is not really
 * culled. */
static uint64_t check_scene(const real_scene *scene)
{
    effort wanted;
    const effort *e = effort_wanted(&wanted);
    stand s = {.scene = scene, .effort = e};
    set_up(&s);
    for (uint32_t row = 0; row < s.path.count; ++row) {
        if (row < scene->nasty_from && row % e->walk_step == 0) {
            check_row(&s, row, false, s.walk);
        }
        if (row >= scene->nasty_from && (row - scene->nasty_from) % e->nasty_step == 0) {
            check_row(&s, row, false, s.nasty);
        }
        if (row % e->ortho_step == 0) {
            check_row(&s, row, true, s.ortho);
        }
    }
    uint64_t bad = 0;
    for (uint32_t r = 0; r < answer_count(&s); ++r) {
        const strict_count *w = &s.walk[r];
        say(&s, r, "walked", w);
        say(&s, r, "nasty", &s.nasty[r]);
        say(&s, r, "parallel", &s.ortho[r]);
        bad += w->wrongly_hidden + s.nasty[r].wrongly_hidden + s.ortho[r].wrongly_hidden;
        bool counted = scene->level && r < e->raster_count && e->rasters[r][0] >= 1024 && w->views >= 20;
        if (counted && (w->reported > 3 * w->truth_visible || 2 * w->reported > w->in_frustum)) {
            printf(
                "# %s: reported more than three times what is seen, or than half of the frustum\n",
                scene->name);
            ++bad;
        }
    }
    tear_down(&s);
    return bad;
}

static void test_real_scenes(void **state)
{
    (void)state;
    scene_tests_run(check_scene);
}

int main(int argc, char **argv)
{
    scene_tests_arguments(argc, argv);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_real_scenes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

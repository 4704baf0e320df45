/* Every index over the real scenes of UMBRAGE_SCENES: the frustum holds what it holds without any hierarchy, in the same order and
 * with the same flags, but for what surely is beside it where indices know parts of objects; and the raster, over every
 * one of them, hides nothing that the oracle sees.
 *
 * test_scenes_by_index [PART PARTS [NAME]]: as scene_tests_arguments() takes them.
 * UMBRAGE_TEST_SIZE chooses the views, UMBRAGE_SCENES_STEP of the walked ones every so manyth. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "frustum/box_kernels.h"
#include "support/box_meets.h"
#include "support/scene_tests.h"
#include "support/strict.h"

enum { MOST = 64 };

typedef struct effort {
    uint32_t walk_step, nasty_step;
    /* Of scenes for all BSP trees, and for one, which hold each triangle: a million take ten seconds to build. */
    uint32_t most_triangles, most_for_one;
    uint32_t share; /* a view is asked of one index in so many, each time others */
    truth_options oracle;
} effort;

static const effort SMALL = {479, 19, 30000, 30000, 1, {.grid_width = 96, .grid_height = 48, .guided_rays = 10000}};
static const effort NORMAL = {160, 10, 100000, 2000000, 2, {.grid_width = 192, .grid_height = 96, .guided_rays = 40000}};
static const effort FULL = {8, 1, 2000000, 2000000, 1, {.grid_width = 384, .grid_height = 192, .guided_rays = 250000}};

typedef struct crew {
    const char *name;
    umb_index *index;
    umb_culler *frustum, *raster;
    strict_count seen_in_frustum, seen;
    uint64_t left_out;
} crew;

typedef struct stand {
    const real_scene *scene;
    const effort *effort;
    model *model;
    umb_scene *built;
    truth *oracle;
    camera_path path;
    uint32_t rows; /* looked at */
    crew flat, crews[MOST];
    uint32_t count;
} stand;

static void make_crew(stand *s, const char *name, crew *out)
{
    umb_index_def def = {0};
    umb_culler_def none = {.method = UMB_METHOD_NONE}, raster = {0};
    *out = (crew){.name = name};
    assert_true(umb_index_parse(name, &def));
    assert_int_equal(umb_index_create(s->built, &def, &out->index), UMB_OK);
    assert_int_equal(umb_culler_create(out->index, &none, &out->frustum), UMB_OK);
    assert_int_equal(umb_culler_create(out->index, &raster, &out->raster), UMB_OK);
}

static void free_crew(crew *c)
{
    umb_culler_destroy(c->frustum);
    umb_culler_destroy(c->raster);
    umb_index_destroy(c->index);
}

static void set_up(stand *s)
{
    umb_error error = {0};
    s->model = model_load(s->scene->file, NULL, &error);
    if (s->model == NULL || !camera_path_load(s->scene->path, &s->path, &error)) {
        fail_msg("%s: %s", s->scene->file, error.text);
    }
    s->built = model_scene(s->model, true, (umb_tasks){0}, NULL, &error);
    s->oracle = truth_create(s->model, &error);
    assert_true(s->built != NULL && s->oracle != NULL);
    make_crew(s, "flat", &s->flat);
    const char *name;
    for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
        uint32_t most = strcmp(name, "bsp") == 0 ? s->effort->most_for_one : s->effort->most_triangles;
        if (strncmp(name, "bsp", 3) != 0 || s->model->triangles <= most) {
            assert_true(s->count < MOST);
            make_crew(s, name, &s->crews[s->count++]);
        }
    }
}

static void tear_down(stand *s)
{
    for (uint32_t k = 0; k < s->count; ++k) {
        free_crew(&s->crews[k]);
    }
    free_crew(&s->flat);
    camera_path_free(&s->path);
    umb_scene_destroy(s->built);
    truth_destroy(s->oracle);
    model_free(s->model);
}

/* The flat answer, without objects whose parts are beside the frustum. Returns how many these are. */
static uint64_t check_frustum(const stand *s, const crew *c, const umb_view *view, const umb_visible_set *flat,
                              const umb_visible_set *seen)
{
    bool parts_known = umb_index_tree(c->index)->several;
    bool triangles = umb_index_settings(c->index).kind == UMB_INDEX_BSP;
    uint32_t at = 0;
    for (uint32_t i = 0; i < flat->count; ++i) {
        if (at < seen->count && seen->objects[at] == flat->objects[i]) {
            assert_int_equal(seen->inside[at], flat->inside[i]);
            ++at;
            continue;
        }
        umb_aabb box;
        assert_true(umb_scene_object_bounds(s->built, flat->objects[i], &box));
        double reach = fabs(box.min[0]) + fabs(box.min[1]) + fabs(box.min[2]) + view->far_depth;
        if (!parts_known || (!triangles && box_surely_meets(view, &box, 1e-6L * reach))) {
            fail_msg("%s, %s: object %u is in the frustum and was not found", s->scene->name, c->name, flat->objects[i]);
        }
    }
    assert_int_equal(at, seen->count);
    return flat->count - seen->count;
}

static uint32_t *copy_ids(const umb_visible_set *seen)
{
    uint32_t *ids = malloc(((size_t)seen->count + 1) * sizeof *ids);
    assert_non_null(ids);
    memcpy(ids, seen->objects, seen->count * sizeof *ids);
    return ids;
}

static void check_row(stand *s, uint32_t row)
{
    umb_view view;
    umb_visible_set flat, seen;
    strict_answer answers[2 * MOST];
    char labels[MOST][160];
    uint32_t *ids[2 * MOST], n = 0;
    assert_true(real_scene_view(s->scene, s->model, s->path.rows[row], row % 3 == 2, &view));
    assert_int_equal(umb_cull(s->flat.frustum, &view, &flat), UMB_OK);
    for (uint32_t k = s->rows++ % s->effort->share; k < s->count; k += s->effort->share) {
        crew *c = &s->crews[k];
        (void)snprintf(labels[k], sizeof labels[k], "%s row %u, %s", s->scene->name, row, c->name);
        assert_int_equal(umb_cull(c->frustum, &view, &seen), UMB_OK);
        c->left_out += check_frustum(s, c, &view, &flat, &seen);
        ids[n] = copy_ids(&seen);
        answers[n] = (strict_answer){ids[n], seen.count, labels[k], &c->seen_in_frustum};
        ++n;
        assert_int_equal(umb_cull(c->raster, &view, &seen), UMB_OK);
        ids[n] = copy_ids(&seen);
        answers[n] = (strict_answer){ids[n], seen.count, labels[k], &c->seen};
        ++n;
    }
    assert_true(strict_check_all(s->oracle, s->model, &view, answers, n, &s->effort->oracle));
    while (n > 0) {
        free(ids[--n]);
    }
}

/* Returns how many objects were wrongly hidden. */
static uint64_t check_scene(const real_scene *scene)
{
    static stand s;
    const char *size = getenv("UMBRAGE_TEST_SIZE"), *step = getenv("UMBRAGE_SCENES_STEP");
    effort wanted = size == NULL || size[0] == 'n' ? NORMAL : size[0] == 'f' ? FULL : SMALL, *e = &wanted;
    e->walk_step = step != NULL && atoi(step) > 0 ? (uint32_t)atoi(step) : e->walk_step;
    s = (stand){.scene = scene, .effort = e};
    set_up(&s);
    for (uint32_t row = 0; row < s.path.count; ++row) {
        bool nasty = row >= scene->nasty_from;
        if ((nasty ? row - scene->nasty_from : row) % (nasty ? e->nasty_step : e->walk_step) == 0) {
            check_row(&s, row);
        }
    }
    uint64_t bad = 0;
    for (uint32_t k = 0; k < s.count; ++k) {
        const crew *c = &s.crews[k];
        const strict_count *f = &c->seen_in_frustum, *o = &c->seen;
        printf("# %-24s %-24s views %3llu in frustum %7.1f left out by parts %5.1f reported %6.1f truly visible %6.1f wrong %llu "
               "unconfirmed %llu\n",
               scene->name, c->name, (unsigned long long)o->views, scene_tests_mean(f->reported, f->views), scene_tests_mean(c->left_out, o->views),
               scene_tests_mean(o->reported, o->views), scene_tests_mean(o->truth_visible, o->views),
               (unsigned long long)(f->wrongly_hidden + o->wrongly_hidden),
               (unsigned long long)(f->unconfirmed + o->unconfirmed));
        bad += f->wrongly_hidden + o->wrongly_hidden;
    }
    (void)fflush(stdout);
    tear_down(&s);
    return bad;
}

static void test_all_indices(void **state)
{
    (void)state;
    scene_tests_run(check_scene);
}

int main(int argc, char **argv)
{
    scene_tests_arguments(argc, argv);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_all_indices)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

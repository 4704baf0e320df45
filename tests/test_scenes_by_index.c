/* Every index over the real scenes of UMBRAGE_SCENES: the frustum holds what it holds without any hierarchy, in the same order and
 * with the same flags, but for what surely is beside it where indices know parts of objects; and the raster, over every
 * one of them, hides nothing that the oracle sees.
 *
 * test_scenes_by_index [PART PARTS [NAME]]: takes every PARTS-th scene from PART on, of those whose name contains NAME.
 * UMBRAGE_TEST_SIZE chooses the views, UMBRAGE_SCENES_STEP of the walked ones every so manyth. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "frustum/box_kernels.h"
#include "support/box_meets.h"
#include "support/real_scenes.h"
#include "support/strict.h"

enum { MOST = 64 };

typedef struct effort {
    uint32_t walk_step, nasty_step;
    uint32_t most_triangles; /* of scenes for BSP trees, which hold each triangle: a million take minutes to build */
    truth_options oracle;
} effort;

static const effort SMALL = {479, 19, 30000, {.grid_width = 96, .grid_height = 48, .guided_rays = 10000}};
static const effort NORMAL = {160, 10, 100000, {.grid_width = 192, .grid_height = 96, .guided_rays = 40000}};
static const effort FULL = {8, 1, 200000, {.grid_width = 384, .grid_height = 192, .guided_rays = 250000}};

static uint32_t part, parts = 1;
static const char *only = "";

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
        if (strncmp(name, "bsp", 3) != 0 || s->model->triangles <= s->effort->most_triangles) {
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
    for (uint32_t k = 0; k < s->count; ++k) {
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

static double mean(uint64_t sum, uint64_t count)
{
    return count != 0 ? (double)sum / (double)count : 0.0;
}

/* Returns how many objects were wrongly hidden. */
static uint64_t check_scene(const real_scene *scene, const effort *e)
{
    static stand s;
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
               scene->name, c->name, (unsigned long long)o->views, mean(f->reported, f->views), mean(c->left_out, o->views),
               mean(o->reported, o->views), mean(o->truth_visible, o->views),
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
    const char *folder = getenv("UMBRAGE_SCENES"), *size = getenv("UMBRAGE_TEST_SIZE");
    if (folder == NULL || folder[0] == '\0') {
        print_message("skipped: UMBRAGE_SCENES names no folder of real scenes\n");
        skip();
    }
    const char *walk_step = getenv("UMBRAGE_SCENES_STEP");
    effort e = size == NULL || size[0] == 'n' ? NORMAL : size[0] == 'f' ? FULL : SMALL;
    e.walk_step = walk_step != NULL && atoi(walk_step) > 0 ? (uint32_t)atoi(walk_step) : e.walk_step;
    real_scenes all;
    umb_error error = {0};
    if (!real_scenes_find(folder, &all, &error)) {
        fail_msg("%s", error.text);
    }
    uint64_t bad = 0;
    for (uint32_t i = 0; i < all.count; ++i) {
        if (i % parts == part && strstr(all.scenes[i].name, only) != NULL) {
            bad += check_scene(&all.scenes[i], &e);
        }
    }
    real_scenes_free(&all);
    assert_int_equal(bad, 0);
}

int main(int argc, char **argv)
{
    if (argc > 2) {
        part = (uint32_t)atoi(argv[1]);
        parts = atoi(argv[2]) > 0 ? (uint32_t)atoi(argv[2]) : 1;
    }
    if (argc > 3) {
        only = argv[3];
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_all_indices)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

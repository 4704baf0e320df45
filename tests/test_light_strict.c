/* Nothing that can be seen is hidden in views that lights have: micro scenes under views of
 * eight kinds, three raster sizes, against the oracle. UMBRAGE_LIGHT_SCENES sets how many views
 * (800; small 48; full 20,000), UMBRAGE_LIGHT_FIRST the number of the first one. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "support/light_views.h"
#include "support/strict.h"

#define MAX_KINDS 16

static const uint32_t SIZES[3][2] = {{64, 40}, {256, 144}, {1024, 288}};

static uint64_t number(const char *name, uint64_t otherwise)
{
    const char *text = getenv(name);
    return text != NULL ? strtoull(text, NULL, 10) : otherwise;
}

static uint64_t wanted(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && size[0] == 'f' ? 20000 : size != NULL && size[0] == 's' ? 48 : 800;
}

static umb_culler *answer(const umb_index *index, umb_method method, const umb_view *view,
                          umb_visible_set *seen)
{
    umb_culler *culler = NULL;
    umb_culler_def def = {.method = method};
    assert_int_equal(umb_culler_create(index, &def, &culler), UMB_OK);
    assert_int_equal(umb_cull(culler, view, seen), UMB_OK);
    return culler;
}

/* One view of one scene. The last answer is that of the frustum alone. */
static void check_view(uint64_t i, strict_count *sums)
{
    micro_scene micro;
    umb_error error = {0};
    umb_view view;
    uint32_t kind = (uint32_t)(i % light_view_kinds());
    /* Every kind of view meets every kind of scene. */
    assert_true(micro_scene_make(50000 + i / light_view_kinds(), &micro));
    assert_true(light_view_make(kind, i, &micro, &view));
    umb_scene *scene = model_scene(micro.model, micro.weld, (umb_tasks){0}, NULL, &error);
    truth *oracle = truth_create(micro.model, &error);
    assert_true(scene != NULL && oracle != NULL);
    umb_index *index = NULL;
    assert_int_equal(umb_index_create(scene, &(umb_index_def){0}, &index), UMB_OK);
    umb_culler *cullers[4];
    umb_visible_set seen[4];
    strict_answer answers[4];
    char labels[4][96];
    for (int s = 0; s < 4; ++s) {
        view.buffer_width = s < 3 ? SIZES[s][0] : 0;
        view.buffer_height = s < 3 ? SIZES[s][1] : 0;
        cullers[s] = answer(index, s < 3 ? UMB_METHOD_RASTER : UMB_METHOD_NONE, &view, &seen[s]);
        (void)snprintf(labels[s], sizeof labels[s], "view %llu (%s of %s), answer %d",
                       (unsigned long long)i, light_view_name(kind), micro.kind, s);
        answers[s] = (strict_answer){seen[s].objects, seen[s].count, labels[s],
                                     &sums[s < 3 ? kind : MAX_KINDS + kind]};
    }
    truth_options options = {
        .grid_width = 64, .grid_height = 64, .guided_rays = 80000, .threads = 1};
    assert_true(strict_check_all(oracle, micro.model, &view, answers, 4, &options));
    sums[kind].in_frustum += 3 * (uint64_t)seen[3].count;
    for (int s = 0; s < 4; ++s) {
        umb_culler_destroy(cullers[s]);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    truth_destroy(oracle);
    micro_scene_free(&micro);
}

static void test_light_views(void **state)
{
    (void)state;
    strict_count sums[2 * MAX_KINDS] = {{0}};
    assert_true(light_view_kinds() <= MAX_KINDS);
    uint64_t first = number("UMBRAGE_LIGHT_FIRST", 0);
    uint64_t count = number("UMBRAGE_LIGHT_SCENES", wanted()), wrong = 0;
    for (uint64_t i = first; i < first + count; ++i) {
        check_view(i, sums);
    }
    for (uint32_t k = 0; k < light_view_kinds(); ++k) {
        const strict_count *c = &sums[k];
        wrong += c->wrongly_hidden + sums[MAX_KINDS + k].wrongly_hidden;
        printf("# %-9s views %llu objects %llu in frustum %llu reported %llu seen %llu wrongly "
               "hidden %llu, by the frustum %llu, unconfirmed %llu\n",
               light_view_name(k), (unsigned long long)c->views, (unsigned long long)c->objects,
               (unsigned long long)c->in_frustum, (unsigned long long)c->reported,
               (unsigned long long)c->truth_visible, (unsigned long long)c->wrongly_hidden,
               (unsigned long long)sums[MAX_KINDS + k].wrongly_hidden,
               (unsigned long long)c->unconfirmed);
        /* It would pass if nothing were ever hidden, or nothing ever seen. */
        assert_true(c->reported < c->in_frustum && c->in_frustum < c->objects);
        assert_true(c->truth_visible > 0);
    }
    assert_int_equal(wrong, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_light_views)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

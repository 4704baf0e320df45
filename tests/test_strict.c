/* Nothing that can be seen is hidden: adversarial micro-scenes under three raster sizes, both indices,
 * against the oracle. UMBRAGE_MICRO_SCENES sets how many (default 500; soak 10,000). */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "support/micro_scenes.h"
#include "support/strict.h"

static const uint32_t SIZES[3][2] = {{64, 40}, {256, 144}, {1024, 288}};

static uint64_t wanted(void)
{
    const char *text = getenv("UMBRAGE_MICRO_SCENES");
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    if (text != NULL) {
        return strtoull(text, NULL, 10);
    }
    return size != NULL && size[0] == 's' ? 60 : 500;
}

static void check_scene(uint64_t number, strict_count *sums)
{
    micro_scene micro;
    assert_true(micro_scene_make(number, &micro));
    umb_error error = {0};
    umb_tasks tasks = {0};
    umb_scene *scene = model_scene(micro.model, micro.weld, tasks, NULL, &error);
    assert_non_null(scene);
    truth *oracle = truth_create(micro.model, &error);
    assert_non_null(oracle);
    umb_index *index = NULL;
    umb_index_def index_def = {.kind = number % 7 == 0 ? UMB_INDEX_FLAT : UMB_INDEX_BVH};
    assert_int_equal(umb_index_create(scene, &index_def, &index), UMB_OK);
    umb_culler *culler = NULL;
    assert_int_equal(umb_culler_create(index, NULL, &culler), UMB_OK);
    for (int s = 0; s < 3; ++s) {
        micro.view.buffer_width = SIZES[s][0];
        micro.view.buffer_height = SIZES[s][1];
        umb_visible_set seen;
        assert_int_equal(umb_cull(culler, &micro.view, &seen), UMB_OK);
        char label[96];
        (void)snprintf(label, sizeof label, "micro scene %llu (%s) at %ux%u", (unsigned long long)number,
                       micro.kind, SIZES[s][0], SIZES[s][1]);
        truth_options options = {.grid_width = 96, .grid_height = 96, .guided_rays = 60000, .threads = 1};
        sums[number % micro_scene_kinds()].in_frustum += seen.stats.in_frustum;
        assert_true(strict_check(oracle, micro.model, &micro.view, seen.objects, seen.count, &options, label,
                                 &sums[number % micro_scene_kinds()]));
    }
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    truth_destroy(oracle);
    micro_scene_free(&micro);
}

static void test_micro_scenes(void **state)
{
    (void)state;
    strict_count sums[32] = {{0}};
    uint64_t n = wanted(), wrong = 0, culled = 0;
    for (uint64_t i = 0; i < n; ++i) {
        check_scene(i, sums);
    }
    for (uint32_t k = 0; k < micro_scene_kinds(); ++k) {
        const strict_count *c = &sums[k];
        printf("# kind %u: views %llu objects %llu reported %llu seen %llu wrongly hidden %llu unconfirmed %llu\n",
               k, (unsigned long long)c->views, (unsigned long long)c->objects,
               (unsigned long long)c->reported, (unsigned long long)c->truth_visible,
               (unsigned long long)c->wrongly_hidden, (unsigned long long)c->unconfirmed);
        wrong += c->wrongly_hidden;
        culled += c->objects - c->reported;
    }
    assert_int_equal(wrong, 0);
    assert_true(culled > n); /* the test would pass if nothing were ever hidden */
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_micro_scenes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

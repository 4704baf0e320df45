/* Nothing that can be seen is hidden: adversarial micro-scenes under three raster sizes, with every kind of index,
 * and by every other method, against the oracle. UMBRAGE_MICRO_SCENES sets how many (500; small 60; full 10,000);
 * UMBRAGE_MICRO_OTHERS=1 leaves the raster out, whose answers on all indices take most of the time. */
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
    if (size != NULL && size[0] == 'f') {
        return 10000;
    }
    return size != NULL && size[0] == 's' ? 60 : 500;
}

/* UMBRAGE_MICRO_FIRST: the number of the first one, so that a long run can be shared out. */
static uint64_t first_wanted(void)
{
    const char *text = getenv("UMBRAGE_MICRO_FIRST");
    return text != NULL ? strtoull(text, NULL, 10) : 0;
}

/* Methods without a raster; kinds of indices take turns with them. */
static const umb_method OTHERS[] = {UMB_METHOD_PLANES, UMB_METHOD_SHADOW_FRUSTA, UMB_METHOD_OCCLUSION_TREE};

/* Kinds of indices beside the first two, which take turns with all sizes. */
enum { SIZED = 3, MOST = 64, OTHER_COUNT = sizeof OTHERS / sizeof OTHERS[0], KINDS = 32 };

typedef struct asked {
    umb_index *index;
    umb_culler *culler;
    char label[128];
} asked;

static void ask(umb_scene *scene, const char *kind, umb_method method, const micro_scene *micro, uint64_t number,
                asked *out, strict_answer *answer)
{
    umb_index_def def = {0};
    umb_culler_def culler_def = {.method = method};
    umb_visible_set seen;
    assert_true(umb_index_parse(kind, &def));
    assert_int_equal(umb_index_create(scene, &def, &out->index), UMB_OK);
    assert_int_equal(umb_culler_create(out->index, &culler_def, &out->culler), UMB_OK);
    assert_int_equal(umb_cull(out->culler, &micro->view, &seen), UMB_OK);
    (void)snprintf(out->label, sizeof out->label, "micro scene %llu (%s), %s at %ux%u, %s",
                   (unsigned long long)number, micro->kind, umb_method_name(method), micro->view.buffer_width, micro->view.buffer_height, kind);
    *answer = (strict_answer){seen.objects, seen.count, out->label, NULL};
}

/* By the raster, in all sizes and over all indices; returns how many answers. */
static uint32_t ask_rasters(umb_scene *scene, micro_scene *micro, uint64_t number, asked *all, strict_answer *answers)
{
    uint32_t n = 0;
    for (; n < SIZED; ++n) {
        micro->view.buffer_width = SIZES[n][0];
        micro->view.buffer_height = SIZES[n][1];
        ask(scene, number % 7 == 0 ? "flat" : "bvh", UMB_METHOD_RASTER, micro, number, &all[n], &answers[n]);
    }
    micro->view.buffer_width = SIZES[1][0];
    micro->view.buffer_height = SIZES[1][1];
    for (uint32_t k = 2; umb_index_variant(k) != NULL; ++k, ++n) {
        assert_true(n < SIZED + MOST);
        ask(scene, umb_index_variant(k), UMB_METHOD_RASTER, micro, number, &all[n], &answers[n]);
    }
    return n;
}

static uint32_t variants(void)
{
    uint32_t n = 0;
    while (umb_index_variant(n) != NULL) {
        n += 1;
    }
    return n;
}

static bool others_only(void)
{
    const char *text = getenv("UMBRAGE_MICRO_OTHERS");
    return text != NULL && text[0] == '1';
}

static void check_scene(uint64_t number, strict_count sums[1 + OTHER_COUNT][KINDS])
{
    micro_scene micro;
    assert_true(micro_scene_make(number, &micro));
    umb_error error = {0};
    umb_tasks tasks = {0};
    umb_scene *scene = model_scene(micro.model, micro.weld, tasks, NULL, &error);
    assert_non_null(scene);
    truth *oracle = truth_create(micro.model, &error);
    assert_non_null(oracle);
    asked all[SIZED + MOST + OTHER_COUNT];
    strict_answer answers[SIZED + MOST + OTHER_COUNT];
    uint32_t rasters = others_only() ? 0 : ask_rasters(scene, &micro, number, all, answers), n = rasters;
    for (uint32_t k = 0; k < OTHER_COUNT; ++k, ++n) {
        const char *kind = umb_index_variant((uint32_t)number % variants());
        ask(scene, kind, OTHERS[k], &micro, number, &all[n], &answers[n]);
    }
    for (uint32_t k = 0; k < n; ++k) {
        answers[k].sum = &sums[k < rasters ? 0 : 1 + k - rasters][number % micro_scene_kinds()];
    }
    truth_options options = {
        .grid_width = 96, .grid_height = 96, .guided_rays = 120000, .threads = 1};
    assert_true(strict_check_all(oracle, micro.model, &micro.view, answers, n, &options));
    for (uint32_t k = 0; k < n; ++k) {
        umb_culler_destroy(all[k].culler);
        umb_index_destroy(all[k].index);
    }
    umb_scene_destroy(scene);
    truth_destroy(oracle);
    micro_scene_free(&micro);
}

static void test_micro_scenes(void **state)
{
    (void)state;
    strict_count sums[1 + OTHER_COUNT][KINDS] = {{{0}}};
    uint64_t first = first_wanted(), n = wanted(), wrong = 0;
    for (uint64_t i = first; i < first + n; ++i) {
        check_scene(i, sums);
    }
    for (uint32_t m = others_only() ? 1 : 0; m <= OTHER_COUNT; ++m) {
        uint64_t culled = 0;
        for (uint32_t k = 0; k < micro_scene_kinds(); ++k) {
            const strict_count *c = &sums[m][k];
            printf("# %s, kind %u: views %llu objects %llu reported %llu seen %llu wrongly hidden %llu "
                   "unconfirmed %llu\n",
                   umb_method_name(m == 0 ? UMB_METHOD_RASTER : OTHERS[m - 1]), k, (unsigned long long)c->views,
                   (unsigned long long)c->objects, (unsigned long long)c->reported,
                   (unsigned long long)c->truth_visible, (unsigned long long)c->wrongly_hidden,
                   (unsigned long long)c->unconfirmed);
            wrong += c->wrongly_hidden;
            culled += c->objects - c->reported;
        }
        assert_true(culled > n); /* the test would pass if nothing were ever hidden */
    }
    assert_int_equal(wrong, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_micro_scenes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

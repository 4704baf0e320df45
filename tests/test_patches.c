/* Methods in object space, and the raster beside them, on small scenes of convex polygons and boxes that touch, share edges
 * and lie in planes with the eye: nothing that can be seen is hidden, says the oracle; and of boxes wholly in view, what is
 * hidden is covered, by polygon clipping in whole numbers, and by occlusion trees all that is covered is hidden. test_patches [FIRST COUNT]: scenes from FIRST on;
 * UMBRAGE_TEST_SIZE: small 200, normal 1,500, full 10,000. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/exact_shadows.h"
#include "support/patch_scenes.h"
#include "support/strict.h"

/* Each over a hierarchy and over one of the other indices by turns. */
static const struct way {
    const char *name;
    umb_method method;
    uint32_t coherence;
} WAYS[] = {{"raster", UMB_METHOD_RASTER, 0},
            {"planes", UMB_METHOD_PLANES, 0},
            {"planes, kept", UMB_METHOD_PLANES, UMB_COHERENCE_PLANES},
            {"planes, leaves", UMB_METHOD_PLANES, UMB_COHERENCE_LEAVES},
            {"shadow frusta", UMB_METHOD_SHADOW_FRUSTA, 0},
            {"occlusion tree", UMB_METHOD_OCCLUSION_TREE, 0}};

enum { WAY_COUNT = sizeof WAYS / sizeof WAYS[0], KINDS = 8, ANSWERS = 2 * WAY_COUNT, MOST_TRIANGLES = 1024, MOST_OBJECTS = 64 };

static uint64_t first, count;

static uint32_t variants(void)
{
    uint32_t n = 0;
    while (umb_index_variant(n) != NULL) {
        n += 1;
    }
    return n;
}

typedef struct asked {
    umb_culler *culler;
    char label[128];
} asked;

static void ask(const umb_index *index, const struct way *way, const micro_scene *micro, uint64_t number,
                asked *out, strict_answer *answer)
{
    umb_culler_def def = {.method = way->method, .coherence = way->coherence};
    umb_visible_set seen;
    umb_view near_by = micro->view;
    near_by.eye[0] += 0.25;
    assert_int_equal(umb_culler_create(index, &def, &out->culler), UMB_OK);
    assert_int_equal(umb_culler_prepare(out->culler), UMB_OK);
    if (way->coherence != 0) { /* a frame to remember */
        assert_int_equal(umb_cull(out->culler, &near_by, &seen), UMB_OK);
    }
    assert_int_equal(umb_cull(out->culler, &micro->view, &seen), UMB_OK);
    (void)snprintf(out->label, sizeof out->label, "scene %llu (%s), %s", (unsigned long long)number, micro->kind, way->name);
    *answer = (strict_answer){seen.objects, seen.count, out->label, NULL};
}

/* ---- by clipping ------------------------------------------------------------------------------- */

typedef struct clipped {
    uint64_t asked, covered, hidden[WAY_COUNT], wrong[WAY_COUNT]; /* boxes; of those that are covered, hidden */
} clipped;

static bool facing(const exact_polygon *p, const int eye[3], uint8_t flags)
{
    int side = exact_shadows_facing(p, eye);
    return side > 0 || (side < 0 && (flags & UMB_TRIANGLE_TWO_SIDED) != 0);
}

/* The triangles that block, of all objects but one. */
static int find_blocking(const model *m, uint32_t except, const int eye[3], exact_polygon *out)
{
    int n = 0;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        const model_mesh *mesh = &m->meshes[m->objects[i].mesh];
        for (uint32_t t = 0; t < mesh->triangle_count && i != except; ++t) {
            assert_true(n < MOST_TRIANGLES);
            exact_polygon *p = &out[n];
            p->count = 3;
            for (int k = 0; k < 9; ++k) {
                p->corners[k / 3][k % 3] = (int)mesh->positions[3 * mesh->indices[3 * t + (uint32_t)k / 3] + (uint32_t)k % 3];
            }
            n += facing(p, eye, mesh->flags[t]);
        }
    }
    return n;
}

static bool in_view(const umb_view *v, const umb_aabb *box)
{
    bool all = true;
    for (int k = 0; k < 8; ++k) {
        double x = 0.0, y = 0.0, depth = 0.0;
        for (int i = 0; i < 3; ++i) {
            double d = (k >> i & 1 ? box->max[i] : box->min[i]) - v->eye[i];
            x += v->right[i] * d;
            y += v->up[i] * d;
            depth += v->forward[i] * d;
        }
        all = all && depth > 1.0 && fabs(x) < 0.99 * v->x_max * depth && fabs(y) < 0.99 * v->y_max * depth;
    }
    return all;
}

static void check_by_clipping(const micro_scene *micro, const strict_answer answers[ANSWERS], clipped *sum)
{
    static exact_polygon polygons[MOST_TRIANGLES];
    static uint8_t shown[ANSWERS][MOST_OBJECTS];
    const model *m = micro->model;
    int eye[3], low[3], high[3];
    for (int i = 0; i < 3; ++i) {
        eye[i] = (int)micro->view.eye[i];
    }
    memset(shown, 0, sizeof shown);
    for (uint32_t k = 0; k < ANSWERS; ++k) {
        for (uint32_t i = 0; i < answers[k].count; ++i) {
            shown[k][answers[k].ids[i]] = 1;
        }
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        bool box = m->meshes[m->objects[i].mesh].position_count == 8 && m->meshes[m->objects[i].mesh].triangle_count == 12;
        if (!box || !in_view(&micro->view, &m->objects[i].bounds)) {
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            low[k] = (int)m->objects[i].bounds.min[k];
            high[k] = (int)m->objects[i].bounds.max[k];
        }
        bool covered = exact_shadows_hide(polygons, find_blocking(m, i, eye, polygons), eye, low, high);
        sum->asked += 1;
        sum->covered += covered;
        for (uint32_t k = 0; k < ANSWERS; ++k) {
            sum->hidden[k % WAY_COUNT] += k < WAY_COUNT && covered && shown[k][i] == 0;
            sum->wrong[k % WAY_COUNT] += !covered && shown[k][i] == 0;
        }
    }
}

/* ---- by the oracle ------------------------------------------------------------------------------ */

static void check_scene(uint64_t number, strict_count sums[WAY_COUNT][KINDS], clipped *exact)
{
    micro_scene micro;
    umb_error error = {0};
    assert_true(patch_scene_make(number, &micro));
    umb_scene *scene = model_scene(micro.model, micro.weld, (umb_tasks){0}, NULL, &error);
    truth *oracle = truth_create(micro.model, &error);
    assert_non_null(scene);
    assert_non_null(oracle);
    const char *kinds[2] = {"bvh", umb_index_variant((uint32_t)number % variants())};
    umb_index *indices[2];
    asked all[ANSWERS];
    strict_answer answers[ANSWERS];
    for (uint32_t k = 0; k < ANSWERS; ++k) {
        umb_index_def def = {0};
        if (k % WAY_COUNT == 0) {
            assert_true(umb_index_parse(kinds[k / WAY_COUNT], &def));
            assert_int_equal(umb_index_create(scene, &def, &indices[k / WAY_COUNT]), UMB_OK);
        }
        ask(indices[k / WAY_COUNT], &WAYS[k % WAY_COUNT], &micro, number, &all[k], &answers[k]);
        answers[k].sum = &sums[k % WAY_COUNT][number % patch_scene_kinds()];
    }
    truth_options options = {
        .grid_width = 96, .grid_height = 96, .guided_rays = 40000, .most_decided = 8, .threads = 1};
    assert_true(strict_check_all(oracle, micro.model, &micro.view, answers, ANSWERS, &options));
    if (micro.view.projection == UMB_PERSPECTIVE) {
        check_by_clipping(&micro, answers, exact);
    }
    for (uint32_t k = 0; k < ANSWERS; ++k) {
        umb_culler_destroy(all[k].culler);
    }
    umb_index_destroy(indices[0]);
    umb_index_destroy(indices[1]);
    umb_scene_destroy(scene);
    truth_destroy(oracle);
    micro_scene_free(&micro);
}

static void test_patches(void **state)
{
    (void)state;
    strict_count sums[WAY_COUNT][KINDS] = {{{0}}};
    clipped exact = {0};
    uint64_t wrong = 0;
    for (uint64_t i = first; i < first + count; ++i) {
        check_scene(i, sums, &exact);
    }
    printf("# patches, by clipping: boxes %llu covered %llu\n", (unsigned long long)exact.asked,
           (unsigned long long)exact.covered);
    for (uint32_t w = 0; w < WAY_COUNT; ++w) {
        uint64_t culled = 0;
        for (uint32_t k = 0; k < patch_scene_kinds(); ++k) {
            const strict_count *c = &sums[w][k];
            printf("# patches, %s, kind %u: answers %llu objects %llu reported %llu seen %llu wrongly hidden %llu "
                   "unconfirmed %llu\n",
                   WAYS[w].name, k, (unsigned long long)c->views, (unsigned long long)c->objects,
                   (unsigned long long)c->reported, (unsigned long long)c->truth_visible,
                   (unsigned long long)c->wrongly_hidden, (unsigned long long)c->unconfirmed);
            wrong += c->wrongly_hidden;
            culled += c->objects - c->reported;
        }
        printf("# patches, by clipping, %s: hidden and covered %llu hidden and not covered %llu\n", WAYS[w].name,
               (unsigned long long)exact.hidden[w], (unsigned long long)exact.wrong[w]);
        wrong += exact.wrong[w];
        if (WAYS[w].method == UMB_METHOD_OCCLUSION_TREE) {
            assert_int_equal(exact.hidden[w], exact.covered); /* all fuse */
        }
        assert_true(culled > count); /* the test would pass if nothing were ever hidden */
    }
    assert_int_equal(wrong, 0);
}

int main(int argc, char **argv)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    count = size != NULL && size[0] == 's' ? 200 : size != NULL && size[0] == 'f' ? 10000 : 1500;
    if (argc > 2) {
        first = strtoull(argv[1], NULL, 10);
        count = strtoull(argv[2], NULL, 10);
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_patches)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

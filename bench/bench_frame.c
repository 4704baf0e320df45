/* What a frame costs: bench_frame [SCENE [PATH [LIMIT]]]
 *
 * Along a path, on one thread:
 *   yardstick       one plain float pass over all boxes against six planes, bit mask out, without any
 *                   bound of rounding: the unit that times of other programs can be given in
 *   flat pass       the library's own frustum test of all boxes, strict, nothing kept
 *   frustum, flat   the culler over the flat index, and
 *   frustum, bvh    over the default index, both without occlusion, in front-to-back order
 *   raster, bvh     the default method
 * Medians over the views of the least of five rounds; the cullers' first round is not counted (buffers
 * grow there). The measure is the last in flat passes of the same run: it says the same on a slow machine
 * and a fast one. Exit code 1 when it is above LIMIT (30). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "frustum/box_kernels.h"
#include "frustum/frustum.h"
#include "index/tree.h"
#include "io/model.h"
#include "yardstick.h"

enum { ROUNDS = 5 };

typedef struct configuration {
    const char *name;
    umb_index_kind kind;
    umb_method method;
    double median, worst, visible;
} configuration;

static double now(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a;
    double y = *(const double *)b;
    return (x > y) - (x < y);
}

static bool view_of(const model *m, const double row[6], umb_view *out)
{
    double eye[3];
    double target[3];
    double extent = 0.0;
    for (int i = 0; i < 3; ++i) {
        eye[i] = row[i] - m->origin[i];
        target[i] = row[3 + i] - m->origin[i];
        extent = hypot(extent, (double)m->bounds.max[i] - m->bounds.min[i]);
    }
    return umb_view_look_at(out, eye, target, m->up, 3.14159265358979 / 3.0, 2.0, 0.1,
                            extent + 1.0) == UMB_OK;
}

/* Least time of each view over the rounds: what is left is the work, not the machine's other
 * business. */
static bool walk(umb_culler *culler, const umb_view *views, uint32_t count, configuration *c,
                 double *times)
{
    uint64_t visible = 0;
    for (uint32_t v = 0; v < count; ++v) {
        times[v] = HUGE_VAL;
    }
    for (int round = -1; round < ROUNDS; ++round) {
        for (uint32_t v = 0; v < count; ++v) {
            umb_visible_set seen;
            double start = now();
            if (umb_cull(culler, &views[v], &seen) != UMB_OK) {
                return false;
            }
            double spent = now() - start;
            if (round >= 0 && spent < times[v]) {
                times[v] = spent;
            }
            visible += round == 0 ? seen.count : 0;
        }
    }
    qsort(times, count, sizeof *times, by_value);
    c->median = times[count / 2];
    c->worst = times[count - 1];
    c->visible = (double)visible / count;
    return true;
}

static bool measure(umb_scene *scene, const umb_view *views, uint32_t count, configuration *c,
                    double *times)
{
    umb_index *index = NULL;
    umb_culler *culler = NULL;
    bool done = umb_index_create(scene, &(umb_index_def){.kind = c->kind}, &index) == UMB_OK &&
                umb_culler_create(index, &(umb_culler_def){.method = c->method}, &culler) == UMB_OK &&
                walk(culler, views, count, c, times);
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    return done;
}

/* The yardstick over every object's box, per view. */
static bool measure_yardstick(const umb_scene *scene, const umb_view *views, uint32_t count,
                              configuration *c, double *times)
{
    uint32_t n = umb_scene_object_count(scene);
    float *boxes[6];
    const float *soa[6];
    uint8_t *mask = calloc(n / 8 + 64, 1);
    bool ok = mask != NULL;
    for (int k = 0; k < 6; ++k) {
        boxes[k] = aligned_alloc(64, ((size_t)n * sizeof(float) + 127) / 64 * 64);
        soa[k] = boxes[k];
        ok = ok && boxes[k] != NULL;
    }
    for (uint32_t i = 0; i < n && ok; ++i) {
        umb_aabb b = {{0, 0, 0}, {0, 0, 0}};
        (void)umb_scene_object_bounds(scene, i, &b);
        for (int k = 0; k < 3; ++k) {
            boxes[k][i] = b.min[k];
            boxes[k + 3][i] = b.max[k];
        }
    }
    uint64_t inside = 0;
    for (uint32_t v = 0; v < count && ok; ++v) {
        double wide[16][4];
        float planes[6][4] = {{0}};
        uint32_t plane_count = umb_view_planes(&views[v], wide);
        for (uint32_t p = 0; p < 6 && p < plane_count; ++p) {
            for (int k = 0; k < 4; ++k) {
                planes[p][k] = (float)wide[p][k];
            }
        }
        times[v] = HUGE_VAL;
        for (int round = 0; round < ROUNDS; ++round) {
            double start = now();
            yardstick_frustum_pass(soa, n, (const float(*)[4])planes, mask);
            double spent = now() - start;
            times[v] = spent < times[v] ? spent : times[v];
        }
        for (uint32_t i = 0; i < n; ++i) {
            inside += mask[i / 8] >> (i % 8) & 1;
        }
    }
    for (int k = 0; k < 6; ++k) {
        free(boxes[k]);
    }
    free(mask);
    if (ok) {
        qsort(times, count, sizeof *times, by_value);
        c->median = times[count / 2];
        c->worst = times[count - 1];
        c->visible = (double)inside / count;
    }
    return ok;
}

/* The strict frustum test of every box, eight at a time. */
static bool measure_flat_pass(umb_scene *scene, const umb_view *views, uint32_t count,
                              configuration *c, double *times)
{
    umb_index *index = NULL;
    if (umb_index_create(scene, &(umb_index_def){.kind = UMB_INDEX_FLAT}, &index) != UMB_OK) {
        return false;
    }
    const umb_tree *tree = umb_index_tree(index);
    const umb_box_kernels *kernels = umb_box_kernels_get(UMB_ISA_AUTO);
    uint64_t inside = 0;
    for (uint32_t v = 0; v < count; ++v) {
        times[v] = HUGE_VAL;
        for (int round = 0; round < ROUNDS; ++round) {
            uint64_t seen = 0;
            double start = now();
            umb_frustum frustum;
            umb_frustum_prepare(&frustum, &views[v]);
            for (uint32_t i = 0; i < tree->node_count; ++i) {
                uint8_t remember = 0;
                uint16_t left[UMB_NODE_WIDTH];
                uint32_t outside = umb_frustum_test_node(&frustum, kernels, &tree->nodes[i],
                                                         frustum.all_planes, &remember, left);
                for (uint32_t k = 0; k < tree->nodes[i].count; ++k) {
                    uint32_t kind = tree->nodes[i].ref[k] & UMB_REF_KIND;
                    seen += kind == UMB_REF_OBJECT && (outside >> k & 1) == 0;
                }
            }
            double spent = now() - start;
            times[v] = spent < times[v] ? spent : times[v];
            inside += round == 0 ? seen : 0;
        }
    }
    umb_index_destroy(index);
    qsort(times, count, sizeof *times, by_value);
    c->median = times[count / 2];
    c->worst = times[count - 1];
    c->visible = (double)inside / count;
    return true;
}

static int fail(const char *what, const char *text)
{
    (void)fprintf(stderr, "bench_frame: %s%s\n", what, text);
    return 3;
}

int main(int argc, char **argv)
{
    const char *name = argc > 1 ? argv[1] : "gen:city,triangles=1M";
    const char *path_name = argc > 2 ? argv[2] : name;
    double limit = argc > 3 ? strtod(argv[3], NULL) : 30.0;
    umb_error error = {0};
    umb_weld_stats weld;
    camera_path path;
    model *m = model_load(name, NULL, &error);
    umb_scene *scene = m != NULL ? model_scene(m, true, (umb_tasks){0}, &weld, &error) : NULL;
    if (scene == NULL || !camera_path_load(path_name, &path, &error)) {
        return fail("", error.text);
    }
    umb_view *views = calloc(path.count, sizeof *views);
    double *times = calloc(path.count, sizeof *times);
    uint32_t count = 0;
    for (uint32_t i = 0; i < path.count && views != NULL; ++i) {
        count += view_of(m, path.rows[i], &views[count]) ? 1 : 0;
    }
    if (count == 0 || times == NULL) {
        return fail(path_name, ": no view in it");
    }

    configuration all[] = {
        {.name = "yardstick", .method = UMB_METHOD_NONE},
        {.name = "flat pass", .method = UMB_METHOD_NONE},
        {.name = "frustum, flat", .kind = UMB_INDEX_FLAT, .method = UMB_METHOD_NONE},
        {.name = "frustum, bvh", .kind = UMB_INDEX_BVH, .method = UMB_METHOD_NONE},
        {.name = "raster, bvh", .kind = UMB_INDEX_BVH, .method = UMB_METHOD_RASTER}};
    printf("%s: %u objects, %u views, one thread, %s\n", name, (unsigned)m->object_count,
           (unsigned)count, umb_isa_name(UMB_ISA_AUTO));
    printf("%-14s %10s %10s %10s %8s\n", "", "reported", "median ms", "worst ms", "passes");
    for (size_t i = 0; i < sizeof all / sizeof all[0]; ++i) {
        bool done = i == 0   ? measure_yardstick(scene, views, count, &all[i], times)
                    : i == 1 ? measure_flat_pass(scene, views, count, &all[i], times)
                             : measure(scene, views, count, &all[i], times);
        if (!done) {
            return fail(all[i].name, ": a view failed");
        }
    }
    for (size_t i = 0; i < sizeof all / sizeof all[0]; ++i) {
        printf("%-14s %10.1f %10.4f %10.4f %8.1f\n", all[i].name, all[i].visible, all[i].median,
               all[i].worst, all[i].median / all[1].median);
    }
    double ratio = all[4].median / all[1].median;
    printf("a frame costs %.1f flat frustum passes, at most %.0f are allowed; %.1f yardsticks\n",
           ratio, limit, all[4].median / all[0].median);

    free(times);
    free(views);
    camera_path_free(&path);
    umb_scene_destroy(scene);
    model_free(m);
    return ratio > limit ? 1 : 0;
}

/* Frames of the `blocks` workload in units: one plain pass of the frustum test over all boxes (yardstick.h), in the same
 * run. What compare.c prints beside rivals and exact answers, in seconds instead of many minutes.
 *
 *     bench_units [--rounds N] [G...]      G: blocks a side; all of 32, 100 and 316 if none is given
 *
 * A round is the yardstick over all 64 views of the recipe, then the frames of the same views; for 100 blocks a side also
 * with the camera rolled, and above all roofs. What counts of a view is
 * its least time; printed are medians over views. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "compare/cameras.h"
#include "compare/contest.h"
#include "compare/screen_boxes.h"
#include "yardstick.h"

enum { VIEWS_MOST = 512 };

typedef struct bench {
    world w;
    cameras c;
    umb_culler *culler;
    uint8_t *mask;
    double unit[VIEWS_MOST], frame[VIEWS_MOST];
    umb_cull_stats sum;
} bench;

static void keep_least(double *least, double start)
{
    double spent = world_clock() - start;
    *least = spent < *least ? spent : *least;
}

static bool run_round(bench *b)
{
    b->sum = (umb_cull_stats){0};
    for (uint32_t v = 0; v < b->c.count; ++v) {
        screen_lens lens;
        screen_lens_make(&lens, &b->c.views[v], 1, 1);
        double start = world_clock();
        yardstick_frustum_pass((const float **)(void *)b->w.box, b->w.box_count, (const float(*)[4])lens.planes, b->mask);
        keep_least(&b->unit[v], start);
    }
    for (uint32_t v = 0; v < b->c.count; ++v) {
        umb_visible_set seen;
        double start = world_clock();
        if (umb_cull(b->culler, &b->c.views[v], &seen) != UMB_OK) {
            return false;
        }
        keep_least(&b->frame[v], start);
        b->sum.nodes += seen.stats.nodes;
        b->sum.boxes += seen.stats.boxes;
        b->sum.queries += seen.stats.queries;
        b->sum.occluders += seen.stats.occluders;
        b->sum.idle += seen.stats.idle;
        b->sum.visible += seen.stats.visible;
        b->sum.in_frustum += seen.stats.in_frustum;
    }
    return true;
}

static void print(const bench *b, const char *label, double unit, double frame)
{
    double n = b->c.count;
    (void)printf("%-14s %9.4f %9.4f %7.3f   %7.0f %7.0f %8.0f %7.0f %7.0f %8.1f\n", label, unit, frame, frame / unit,
                 (double)b->sum.nodes / n, (double)b->sum.boxes / n, (double)b->sum.queries / n,
                 (double)b->sum.occluders / n, (double)b->sum.idle / n, (double)b->sum.visible / n);
}

typedef struct row {
    const char *blocks, *name;
    camera_turn turn;
} row;

static const row usual[] = {
    {"32", "recipe", {0.0, 0.0, 0.0}},
    {"100", "recipe", {0.0, 0.0, 0.0}},
    {"100", "rolled", {-12.0, 17.0, 0.0}},
    {"100", "above", {-20.0, 0.0, 60.0}},
    {"316", "recipe", {0.0, 0.0, 0.0}},
};
enum { USUAL = sizeof usual / sizeof usual[0] };

static bool measure(const row *r, uint32_t rounds, umb_error *error)
{
    static bench b;
    char spec[64], label[64];
    memset(&b, 0, sizeof b);
    (void)snprintf(spec, sizeof spec, "gen:blocks,g=%.20s", r->blocks);
    (void)snprintf(label, sizeof label, "g=%.20s %.20s", r->blocks, r->name);
    bool ok = world_load(&b.w, spec, spec, UINT32_MAX, error) &&
              cameras_path(&b.c, &b.w, r->name, spec, NULL, 1, VIEWS_MOST - 1, r->turn, error) &&
              umb_culler_create(b.w.index[UMB_INDEX_BVH], &(umb_culler_def){.method = UMB_METHOD_RASTER, .error = error},
                                &b.culler) == UMB_OK;
    b.mask = calloc((size_t)b.w.box_count / 8 + 64, 1);
    for (uint32_t v = 0; v < VIEWS_MOST; ++v) {
        b.unit[v] = b.frame[v] = 1e9;
    }
    for (uint32_t round = 0; ok && b.mask != NULL && round < rounds; ++round) {
        ok = run_round(&b);
    }
    if (ok) {
        print(&b, label, contest_median(b.unit, b.c.count), contest_median(b.frame, b.c.count));
    }
    free(b.mask);
    umb_culler_destroy(b.culler);
    cameras_free(&b.c);
    world_free(&b.w);
    return ok;
}

int main(int argc, char **argv)
{
    umb_error error = {0};
    uint32_t rounds = 30;
    int at = 1;
    if (at + 1 < argc && strcmp(argv[at], "--rounds") == 0) {
        rounds = (uint32_t)strtoul(argv[at + 1], NULL, 10);
        at += 2;
    }
    if (rounds == 0 || (at < argc && argv[at][0] == '-')) {
        (void)fputs("bench_units: [--rounds N] [G...]\n", stderr);
        return 2;
    }
    (void)printf("umbrage %s; medians over 64 views, %u rounds, one thread; counts a frame\n", umb_version(), rounds);
    (void)puts("scene            unit ms  frame ms   units     nodes   boxes  queries   drawn    idle  visible");
    bool ok = true;
    for (uint32_t i = 0; ok && at == argc && i < USUAL; ++i) {
        ok = measure(&usual[i], rounds, &error);
    }
    for (; ok && at < argc; ++at) {
        ok = measure(&(row){argv[at], "recipe", {0.0, 0.0, 0.0}}, rounds, &error);
    }
    if (!ok) {
        (void)fprintf(stderr, "bench_units: %s\n", error.text);
        return 3;
    }
    return 0;
}

/* What it costs to follow motion: for each size, spread and share of movers, and each way to update, milliseconds for
 * the commit (scene and index) and for the cull after it, beside an index that is built anew each frame; objects that
 * come and go; how long single commits take; and what a frame costs in ever larger scenes of which the same number of objects is visible.
 *
 *     bench_updates [most objects] [seconds for each figure] [index] [motion|changes|commits|layers|scaling]
 *
 * Lines of comma-separated values; scripts/updates-report makes docs/results/updates.md of them. Ratios are within one
 * run, times the processor's, of this thread.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "umbrage/umbrage.h"

static uint64_t random_state = 88172645463325252u;

static double random_in(double low, double high)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return low + (high - low) * ((double)(random_state >> 11) * 0x1p-53);
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void *room(size_t bytes)
{
    void *p = malloc(bytes);
    if (p == NULL) {
        fprintf(stderr, "bench_updates: no memory\n");
        exit(1);
    }
    return p;
}

static void must(umb_result result)
{
    if (result != UMB_OK) {
        fprintf(stderr, "bench_updates: %s\n", umb_result_name(result));
        exit(1);
    }
}

/* ---- things that fly about ---------------------------------------------------------------------- */

typedef struct swarm {
    umb_scene *scene;
    double (*at)[3], (*by)[3];
    uint32_t count;
    double side;
    uint32_t step;
} swarm;

static umb_aabb box_of(const double at[3])
{
    umb_aabb b;
    for (int i = 0; i < 3; ++i) {
        b.min[i] = (float)at[i];
        b.max[i] = (float)(at[i] + 1.0);
    }
    return b;
}

/* Boxes of one metre, four metres apart on average; clustered: about one centre for each thousand, most of them near. */
static void swarm_make(swarm *s, uint32_t count, bool clustered)
{
    s->count = count;
    s->side = 4.0 * cbrt(count);
    s->at = room(count * sizeof s->at[0]);
    s->by = room(count * sizeof s->by[0]);
    must(umb_scene_create(NULL, &s->scene));
    double centre[3] = {0, 0, 0};
    for (uint32_t i = 0; i < count; ++i) {
        for (int k = 0; k < 3; ++k) {
            centre[k] = i % 1000 == 0 ? random_in(0, s->side) : centre[k];
            double off = random_in(-1, 1) * random_in(0, 1) * random_in(0, 1) * 20.0;
            s->at[i][k] = clustered ? centre[k] + off : random_in(0, s->side);
            s->by[i][k] = random_in(-0.2, 0.2);
        }
        umb_object_def def = {.bounds = box_of(s->at[i])};
        uint32_t id;
        must(umb_scene_add_object(s->scene, &def, &id));
    }
    must(umb_scene_commit(s->scene));
}

static void swarm_free(swarm *s)
{
    umb_scene_destroy(s->scene);
    free(s->at);
    free(s->by);
}

/* Each in its own direction, turned about at the ends of the world; the first ones of each hundred. */
static void swarm_step(swarm *s, uint32_t percent)
{
    for (uint32_t i = 0; i < s->count; ++i) {
        if (i % 100 >= percent) {
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            s->at[i][k] += s->by[i][k];
            s->by[i][k] = (s->at[i][k] < 0.0 && s->by[i][k] < 0.0) || (s->at[i][k] > s->side && s->by[i][k] > 0.0)
                              ? -s->by[i][k]
                              : s->by[i][k];
        }
        umb_aabb box = box_of(s->at[i]);
        must(umb_scene_move_object(s->scene, i, NULL, &box));
    }
    s->step += 1;
}

/* From the middle outwards, turning: a few hundredths of the world. */
static umb_view view_of(const swarm *s)
{
    double eye[3], target[3], up[3] = {0, 0, 1};
    umb_view v;
    for (int k = 0; k < 3; ++k) {
        eye[k] = s->side / 2;
    }
    target[0] = eye[0] + cos(0.05 * s->step);
    target[1] = eye[1] + sin(0.05 * s->step);
    target[2] = eye[2];
    must(umb_view_look_at(&v, eye, target, up, 1.0, 1.5, 0.1, s->side / 3));
    return v;
}

/* ---- motion ------------------------------------------------------------------------------------- */

typedef struct figure {
    double update, cull; /* milliseconds a frame, the mean over the second half of the frames */
    double worst;        /* commit */
    double found;        /* objects in the frustum */
    double megabytes;
    uint32_t frames;
} figure;

enum { MOST_FRAMES = 120, LEAST_FRAMES = 4 };

/* anew: an index built for each frame. */
static figure follow(swarm *s, const umb_index_def *def, bool anew, uint32_t percent, double seconds)
{
    umb_index *index = NULL;
    umb_culler *culler = NULL;
    umb_culler_def none = {.method = UMB_METHOD_NONE};
    double updates[MOST_FRAMES], culls[MOST_FRAMES], begun = now();
    uint32_t found[MOST_FRAMES];
    figure f = {0};
    if (!anew) {
        must(umb_index_create(s->scene, def, &index));
        must(umb_culler_create(index, &none, &culler));
    }
    while (f.frames < MOST_FRAMES && (f.frames < LEAST_FRAMES || now() - begun < seconds)) {
        swarm_step(s, percent);
        double start = now();
        must(umb_scene_commit(s->scene));
        if (anew) {
            umb_culler_destroy(culler);
            umb_index_destroy(index);
            must(umb_index_create(s->scene, def, &index));
            must(umb_culler_create(index, &none, &culler));
        }
        double middle = now();
        umb_view v = view_of(s);
        umb_visible_set seen;
        must(umb_cull(culler, &v, &seen));
        culls[f.frames] = now() - middle;
        updates[f.frames] = middle - start;
        found[f.frames++] = seen.count;
    }
    uint32_t from = f.frames / 2;
    for (uint32_t i = from; i < f.frames; ++i) {
        f.update += 1e3 * updates[i] / (f.frames - from);
        f.cull += 1e3 * culls[i] / (f.frames - from);
        f.found += (double)found[i] / (f.frames - from);
        f.worst = 1e3 * updates[i] > f.worst ? 1e3 * updates[i] : f.worst;
    }
    umb_index_stats stats;
    umb_index_get_stats(index, &stats);
    f.megabytes = stats.bytes / 1048576.0;
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    return f;
}

static void print_figure(const char *spread, uint32_t count, uint32_t percent, const char *way, const figure *f,
                         const figure *anew)
{
    printf("motion,%s,%u,%u,%s,%.4f,%.4f,%.4f,%.1f,%.1f,%u,%.2f\n", spread, count, percent, way, f->update, f->cull, f->worst,
           f->found, f->megabytes, f->frames, (anew->update + anew->cull) / (f->update + f->cull));
    fflush(stdout);
}

static void bench_motion(uint32_t count, bool clustered, const umb_index_def *kind, double seconds)
{
    static const uint32_t percents[4] = {0, 10, 50, 100};
    const char *spread = clustered ? "clustered" : "uniform";
    for (int p = 0; p < 4; ++p) {
        figure anew = {0};
        for (uint32_t u = 0; umb_index_update_name((umb_index_update)u) != NULL; ++u) {
            umb_index_def def = *kind;
            bool rebuilt = u == 0;
            def.update = rebuilt ? UMB_UPDATE_REFIT : (umb_index_update)u;
            if (!umb_index_can_update(&def)) {
                continue;
            }
            swarm s = {0};
            random_state = 88172645463325252u; /* the same things fly the same ways */
            swarm_make(&s, count, clustered);
            figure f = follow(&s, &def, rebuilt, percents[p], seconds);
            anew = rebuilt ? f : anew;
            print_figure(spread, count, percents[p], rebuilt ? "rebuild" : umb_index_update_name(def.update), &f, &anew);
            swarm_free(&s);
        }
    }
}

/* ---- coming and going --------------------------------------------------------------------------- */

/* So many leave, as many others come, anywhere. */
static void exchange(swarm *s, uint32_t changes)
{
    for (uint32_t i = 0; i < changes; ++i) {
        uint32_t id = (uint32_t)random_in(0, s->count);
        (void)umb_scene_remove_object(s->scene, id);
    }
    for (uint32_t i = 0; i < changes; ++i) {
        double at[3] = {random_in(0, s->side), random_in(0, s->side), random_in(0, s->side)};
        umb_object_def def = {.bounds = box_of(at)};
        uint32_t id;
        if (umb_scene_object_count(s->scene) < s->count + s->count / 2) {
            must(umb_scene_add_object(s->scene, &def, &id));
        }
    }
}

static void bench_changes(uint32_t count, const umb_index_def *kind, double seconds)
{
    for (uint32_t changes = 1; changes <= count / 20; changes *= 10) {
        swarm s = {0};
        umb_index *index;
        swarm_make(&s, count, false);
        must(umb_index_create(s.scene, kind, &index));
        double sum = 0.0, worst = 0.0, begun = now();
        uint32_t frames = 0;
        for (int f = 0; f < 4; ++f) { /* the first ones make room */
            exchange(&s, changes);
            must(umb_scene_commit(s.scene));
        }
        for (; frames < 200 && (frames < 8 || now() - begun < seconds); ++frames) {
            exchange(&s, changes);
            double start = now();
            must(umb_scene_commit(s.scene));
            double took = now() - start;
            sum += took;
            worst = took > worst ? took : worst;
        }
        double start = now();
        umb_index *again;
        must(umb_index_create(s.scene, kind, &again));
        double anew = now() - start;
        umb_index_stats stats, fresh;
        umb_index_get_stats(index, &stats);
        umb_index_get_stats(again, &fresh);
        printf("changes,%u,%u,%.4f,%.4f,%.3f,%.4f,%.3f\n", count, changes, 1e3 * sum / frames, 1e3 * worst,
               1e6 * sum / frames / (2 * changes), 1e3 * anew, stats.cost / fresh.cost);
        fflush(stdout);
        umb_index_destroy(index);
        umb_index_destroy(again);
        swarm_free(&s);
    }
}

/* ---- single commits ----------------------------------------------------------------------------- */

enum { COMMITS = 800, UNTIMED = 100 };

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* A world of its own for each way. Refitting alone shows what the moves cost; what the usual way takes above that are pieces of
 * a tree made anew. */
static void bench_commits(uint32_t count, uint32_t percent, umb_index_update way, double seconds)
{
    static double times[COMMITS];
    umb_index_def def = {.update = way};
    umb_index *index;
    umb_index_stats stats, fresh;
    swarm s = {0};
    random_state = 88172645463325252u;
    swarm_make(&s, count, false);
    must(umb_index_create(s.scene, &def, &index));
    uint32_t n = 0;
    double begun = now();
    for (uint32_t f = 0; f < UNTIMED + COMMITS && (n < 100 || now() - begun < seconds); ++f) {
        swarm_step(&s, percent);
        double start = now();
        must(umb_scene_commit(s.scene));
        times[n] = 1e3 * (now() - start);
        n += f >= UNTIMED;
    }
    umb_index_get_stats(index, &stats);
    umb_index_destroy(index);
    must(umb_index_create(s.scene, NULL, &index));
    umb_index_get_stats(index, &fresh);
    qsort(times, n, sizeof times[0], compare);
    printf("commits,%u,%u,%s,%.4f,%.4f,%.4f,%u,%.3f\n", count, percent, umb_index_update_name(way), times[n / 2],
           times[(uint32_t)(0.99 * (n - 1))], times[n - 1], n, stats.cost / fresh.cost);
    fflush(stdout);
    umb_index_destroy(index);
    swarm_free(&s);
}

static void bench_all_commits(uint32_t most, double seconds)
{
    static const uint32_t percents[] = {1, 10, 100};
    printf("commits,objects,moving_percent,way,median_ms,p99_ms,worst_ms,commits,cost_over_new\n");
    for (uint32_t count = 10000; count <= most; count *= 10) {
        for (int p = 0; p < 3; ++p) {
            bench_commits(count, percents[p], UMB_UPDATE_REFIT, seconds);
            bench_commits(count, percents[p], UMB_UPDATE_INCREMENTAL, seconds);
        }
    }
}

/* ---- layers ------------------------------------------------------------------------------------- */

/* The least time of some frames that look all about. */
static double cull_time(const swarm *s, umb_index *index, umb_method method, uint32_t mask, uint32_t *count)
{
    umb_culler_def def = {.method = method};
    umb_culler *culler;
    double best = 1e30;
    must(umb_culler_create(index, &def, &culler));
    for (int round = 0; round < 20; ++round) {
        swarm at = *s;
        double start = now();
        *count = 0;
        for (at.step = 0; at.step < 32; ++at.step) {
            umb_view v = view_of(&at);
            umb_visible_set seen;
            v.mask = mask;
            must(umb_cull(culler, &v, &seen));
            *count += seen.count;
        }
        best = now() - start < best ? now() - start : best;
    }
    umb_culler_destroy(culler);
    return 1e3 * best / 32;
}

/* One of four layers asked for; nearby is what lies on one side of the world in x and y, or every fourth object. */
static void bench_layers(uint32_t count, bool nearby)
{
    swarm s = {0};
    umb_index *index;
    random_state = 88172645463325252u;
    swarm_make(&s, count, false);
    must(umb_index_create(s.scene, NULL, &index));
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t cell = nearby ? (s.at[i][0] < s.side / 2 ? 0u : 1u) + (s.at[i][1] < s.side / 2 ? 0u : 2u) : i % 4;
        must(umb_scene_mask_object(s.scene, i, 1u << cell));
    }
    double start = now();
    must(umb_scene_commit(s.scene));
    double commit = 1e3 * (now() - start);
    static const umb_method methods[2] = {UMB_METHOD_NONE, UMB_METHOD_RASTER};
    for (int m = 0; m < 2; ++m) {
        uint32_t all, some;
        double whole = cull_time(&s, index, methods[m], 0, &all), layer = cull_time(&s, index, methods[m], 2, &some);
        printf("layers,%u,%s,%s,%.4f,%.4f,%.1f,%.1f,%.3f\n", count, nearby ? "apart" : "mixed", umb_method_name(methods[m]), whole,
               layer, all / 32.0, some / 32.0, commit);
        fflush(stdout);
    }
    umb_index_destroy(index);
    swarm_free(&s);
}

static void bench_all_layers(uint32_t most)
{
    printf("layers,objects,layers_lie,method,all_ms,one_ms,all_reported,one_reported,commit_ms\n");
    for (uint32_t count = 1000; count <= most && count <= 100000; count *= 10) {
        bench_layers(count, true);
        bench_layers(count, false);
    }
}

/* ---- output sensitivity ------------------------------------------------------------------------- */

/* A wall, two hundred things in front of it, and ever more behind it, in a hall that grows with them; one in ten of
 * what is behind it moves. */
typedef struct hall {
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
    umb_shape cube;
    uint32_t behind, first;
    double side;
    uint64_t seen;
} hall;

static uint32_t put(hall *h, const double at[3], const double size[3])
{
    umb_transform t = {{{(float)size[0], 0, 0, (float)at[0]},
                        {0, (float)size[1], 0, (float)at[1]},
                        {0, 0, (float)size[2], (float)at[2]}}};
    umb_object_def def = {.shape = h->cube, .transform = t, .flags = UMB_OBJECT_IS_SHAPE};
    uint32_t id;
    must(umb_scene_add_object(h->scene, &def, &id));
    return id;
}

static void hall_make(hall *h, uint32_t behind)
{
    static const float corners[24] = {-1, -1, -1, -1, -1, 1, -1, 1, -1, -1, 1, 1, 1, -1, -1, 1, -1, 1, 1, 1, -1, 1, 1, 1};
    static const uint32_t faces[36] = {0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1,
                                       2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3};
    umb_shape_def shape = {.positions = corners, .position_count = 8, .indices = faces, .index_count = 36};
    *h = (hall){.behind = behind, .side = 4.0 * cbrt(behind)};
    must(umb_scene_create(NULL, &h->scene));
    must(umb_scene_add_shape(h->scene, &shape, &h->cube));
    const double wall[3] = {0, 60, 0}, large[3] = {1e5, 0.5, 1e5}, one[3] = {0.5, 0.5, 0.5};
    put(h, wall, large);
    for (uint32_t i = 0; i < 200; ++i) {
        double at[3] = {random_in(-15, 15), random_in(30, 55), random_in(-8, 8)};
        put(h, at, one);
    }
    h->first = 201;
    for (uint32_t i = 0; i < behind; ++i) {
        double at[3] = {random_in(-h->side, h->side) / 2, random_in(62, 62 + h->side), random_in(-h->side, h->side) / 2};
        put(h, at, one);
    }
    must(umb_scene_commit(h->scene));
    must(umb_index_create(h->scene, NULL, &h->index));
    must(umb_culler_create(h->index, NULL, &h->culler));
}

/* The best of many frames; moving: so many of those behind the wall take a step before each, which is not timed. */
static double hall_frame(hall *h, uint32_t moving, double seconds, double *commit)
{
    double best = 1e30, begun = now();
    *commit = 1e30;
    for (uint32_t f = 0; f < 400 && (f < 12 || now() - begun < seconds); ++f) {
        for (uint32_t i = 0; i < moving; ++i) {
            uint32_t id = h->first + (uint32_t)random_in(0, h->behind);
            umb_aabb b;
            (void)umb_scene_object_bounds(h->scene, id, &b);
            umb_transform t = {{{0.5f, 0, 0, 0}, {0, 0.5f, 0, 0}, {0, 0, 0.5f, 0}}};
            for (int k = 0; k < 3; ++k) {
                t.m[k][3] = 0.5f * (b.min[k] + b.max[k]) + (k == 1 ? 0.0f : (float)random_in(-0.2, 0.2));
            }
            must(umb_scene_move_object(h->scene, id, &t, NULL));
        }
        double start = now();
        must(umb_scene_commit(h->scene));
        double middle = now();
        double eye[3] = {0.01 * (f % 16), 0, 0}, target[3] = {0, 60, 0}, up[3] = {0, 0, 1};
        umb_view v;
        umb_visible_set seen;
        must(umb_view_look_at(&v, eye, target, up, 0.6, 2.0, 0.1, INFINITY));
        must(umb_cull(h->culler, &v, &seen));
        double took = now() - middle;
        h->seen = seen.count;
        best = took < best ? took : best;
        *commit = middle - start < *commit ? middle - start : *commit;
    }
    return best;
}

/* The slope of a line through points in logarithms. */
static double exponent_of(const double *x, const double *y, int n)
{
    double sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (int i = 0; i < n; ++i) {
        sx += log(x[i]);
        sy += log(y[i]);
        sxx += log(x[i]) * log(x[i]);
        sxy += log(x[i]) * log(y[i]);
    }
    return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

static void bench_scaling(uint32_t most, double seconds)
{
    static const uint32_t sizes[] = {10000, 20000, 50000, 100000, 200000, 500000, 1000000};
    double x[7], still[7], moving[7];
    int n = 0;
    for (; n < 7 && sizes[n] <= most; ++n) {
        hall h;
        double none, commit;
        hall_make(&h, sizes[n]);
        x[n] = sizes[n];
        still[n] = hall_frame(&h, 0, seconds, &none);
        double cull = hall_frame(&h, 1000, seconds, &commit);
        moving[n] = cull + commit;
        printf("scaling,%u,%llu,%.4f,%.4f,%.4f\n", sizes[n], (unsigned long long)h.seen, 1e3 * still[n], 1e3 * cull,
               1e3 * commit);
        fflush(stdout);
        umb_culler_destroy(h.culler);
        umb_index_destroy(h.index);
        umb_scene_destroy(h.scene);
    }
    if (n > 1) {
        printf("exponent,still,%.3f\nexponent,moving,%.3f\n", exponent_of(x, still, n), exponent_of(x, moving, n));
    }
}

static void bench_all_motion(uint32_t most, const umb_index_def *def, double seconds)
{
    printf("motion,spread,objects,moving_percent,way,update_ms,cull_ms,worst_update_ms,found,megabytes,frames,"
           "times_faster\n");
    for (uint32_t count = 1000; count <= most; count *= 10) {
        bench_motion(count, false, def, seconds);
        bench_motion(count, true, def, seconds);
    }
}

static void bench_all_changes(uint32_t most, const umb_index_def *def, double seconds)
{
    printf("changes,objects,each_way,commit_ms,worst_ms,microseconds_each,rebuild_ms,cost_over_new\n");
    for (uint32_t count = 1000; count <= most; count *= 10) {
        bench_changes(count, def, seconds);
    }
}

int main(int argc, char **argv)
{
    uint32_t most = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 1000000;
    double seconds = argc > 2 ? strtod(argv[2], NULL) : 4.0;
    const char *part = argc > 4 ? argv[4] : "";
    umb_index_def def = {0};
    bool all = part[0] == '\0', motion = all || strcmp(part, "motion") == 0, changes = all || strcmp(part, "changes") == 0;
    bool commits = all || strcmp(part, "commits") == 0, scaling = all || strcmp(part, "scaling") == 0;
    bool layers = all || strcmp(part, "layers") == 0;
    if (most < 1000 || !(seconds > 0.0) || (argc > 3 && !umb_index_parse(argv[3], &def)) ||
        !(motion || changes || commits || layers || scaling)) {
        fprintf(stderr, "usage: bench_updates [most objects, from 1000] [seconds for each figure] [index] "
                        "[motion|changes|commits|layers|scaling]\n");
        return 2;
    }
    if (motion) {
        bench_all_motion(most, &def, seconds);
    }
    if (changes) {
        bench_all_changes(most, &def, seconds);
    }
    if (commits) {
        bench_all_commits(most, seconds);
    }
    if (layers) {
        bench_all_layers(most);
    }
    if (scaling) {
        printf("scaling,behind,visible,still_cull_ms,moving_cull_ms,moving_commit_ms\n");
        bench_scaling(most, seconds);
    }
    return 0;
}

/* The planes method beside the experiments of its paper, as one page in Markdown: docs/results/planes.md.
 *
 *     bench_planes [ROUNDS [table]]     table: the last part alone
 *
 * 1. the experiments of Coorg and Teller (1997): what is left to draw, nodes and tests, and the time to ask with
 *    planes kept at nodes and without, at multiples of walking speed
 * 2. tangent corners by table and by search
 *
 * Times are processor time: the least of the rounds for each frame, then the mean over the frames.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "cull/culler.h"
#include "io/model.h"
#include "occlusion/planes.h"
#include "occlusion/planes_cache.h"

enum { FRAMES = 240, PAIRS = 20000, MOST_ROUNDS = 64 };

typedef struct place {
    const char *name, *spec;
    model *m;
    umb_scene *scene;
    umb_index *index;
    camera_path path;
} place;

static double now_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static bool open_place(place *p)
{
    umb_error error = {0};
    p->m = model_load(p->spec, NULL, &error);
    bool ok = p->m != NULL && camera_path_load(p->spec, &p->path, &error);
    if (ok) {
        p->scene = model_scene(p->m, true, (umb_tasks){0}, NULL, &error);
        ok = p->scene != NULL && umb_index_create(p->scene, NULL, &p->index) == UMB_OK;
    }
    if (!ok) {
        (void)fprintf(stderr, "%s: %s\n", p->spec, error.text);
    }
    return ok;
}

static void close_place(place *p)
{
    umb_index_destroy(p->index);
    umb_scene_destroy(p->scene);
    camera_path_free(&p->path);
    model_free(p->m);
}

static umb_view view_at(const place *p, const double eye[3], const double target[3])
{
    umb_view v;
    double far_depth = 1.0, from[3], to[3];
    for (int k = 0; k < 3; ++k) {
        from[k] = eye[k] - p->m->origin[k];
        to[k] = target[k] - p->m->origin[k];
        far_depth += 2.0 * (p->m->bounds.max[k] - p->m->bounds.min[k]);
    }
    if (umb_view_look_at(&v, from, to, p->m->up, 1.0471975511965976, 2.0, 0.1, far_depth) != UMB_OK) {
        abort();
    }
    return v;
}

static const char INTRO[] =
    "# The planes method and its paper\n\n"
    "What `build/bench/bench/bench_planes 3` prints (`UMB_BENCH=ON`); `bench/bench_planes.c` is the whole experiment. "
    "Processor time of one thread in milliseconds, for each frame the least of the rounds, then the mean; the machine "
    "was shared, so compare within a table. All other figures are the same in every run. Scenes: `gen:building`, and "
    "`gen:sodacity`, three by three of such buildings; 60 degrees. A walk is 240 frames from eye to eye of the scene's "
    "path, through walls too, looking ahead.\n\n"
    "- *What is left*: triangles of what is in the frustum, and of what the method reports with 64 occluders, of all "
    "there are; nodes opened; of the 64 occluders those that a node is held against. The walk is at 16 times walking "
    "speed.\n"
    "- *Speeds*: multiples of 1.4 m/s, 60 frames a second. Planes through the eye are what the method does; the "
    "paper's tangent planes are found by its table in each frame, or kept at the nodes (`UMB_COHERENCE_PLANES`; in "
    "brackets the part that was there). Answers are the same by all three. The paper's own way pays beside its own "
    "table, where nodes are few; it does not beside eight boxes at a time, which need no memory.\n"
    "- *Table and search*: tangent corners of random edges and boxes.\n\n";

/* ---- 1: Coorg and Teller's experiments --------------------------------------------------------- */

/* Frame f of a walk through the first views of the path, which lie in one building or street: from one eye straight to
 * the next, looking where one goes. */
static umb_view walk_view(const place *p, double way)
{
    const uint32_t step = p->path.count / 12;
    uint32_t row = 0;
    for (;; row += step) {
        const double *a = p->path.rows[row % p->path.count], *b = p->path.rows[(row + step) % p->path.count];
        double length = hypot(hypot(b[0] - a[0], b[1] - a[1]), b[2] - a[2]);
        if (length > 1.0 && way < length) {
            double eye[3], target[3];
            for (int k = 0; k < 3; ++k) {
                eye[k] = a[k] + (b[k] - a[k]) * way / length;
                target[k] = eye[k] + (k == 1 ? 0.0 : b[k] - a[k]) + (k == 0 ? 0.01 : 0.0);
            }
            return view_at(p, eye, target);
        }
        way -= length > 1.0 ? length : 0.0;
    }
}

static uint64_t triangles_of(const place *p, const umb_visible_set *seen)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < seen->count; ++i) {
        const model_object *o = &p->m->objects[seen->objects[i]];
        sum += o->mesh != MODEL_NONE ? p->m->meshes[o->mesh].triangle_count : 0;
    }
    return sum;
}

static void print_left(const place *p)
{
    umb_culler *cullers[2];
    uint64_t left[2] = {0, 0}, nodes = 0, tests = 0;
    for (int k = 0; k < 2; ++k) {
        umb_culler_def def = {.method = k == 0 ? UMB_METHOD_NONE : UMB_METHOD_PLANES};
        if (umb_culler_create(p->index, &def, &cullers[k]) != UMB_OK) {
            abort();
        }
        for (uint32_t f = 0; f < FRAMES; ++f) {
            umb_view v = walk_view(p, f * 16 * 1.4 / 60.0);
            umb_visible_set seen;
            if (umb_cull(cullers[k], &v, &seen) != UMB_OK) {
                abort();
            }
            left[k] += triangles_of(p, &seen);
            nodes += k == 1 ? seen.stats.nodes : 0;
            tests += seen.stats.tests;
        }
        umb_culler_destroy(cullers[k]);
    }
    double all = (double)p->m->triangles * FRAMES;
    printf("| %s | %llu | %.1f %% | %.1f %% | %.0f | %.1f | %.1f %% |\n", p->name, (unsigned long long)p->m->triangles,
           100.0 * (double)left[0] / all, 100.0 * (double)left[1] / all, (double)nodes / FRAMES,
           (double)tests / (double)nodes, 100.0 * (double)tests / (double)nodes / 64.0);
    (void)fflush(stdout);
}

/* The time to ask at one speed; *kept becomes the part of the planes that was there. */
static double time_walk(const place *p, umb_planes_way way, uint32_t speed, uint32_t rounds, double *kept)
{
    static double least[FRAMES];
    double sum = 0.0;
    for (uint32_t r = 0; r < rounds; ++r) {
        umb_culler_def def = {.method = UMB_METHOD_PLANES};
        umb_culler *culler;
        if (umb_culler_create(p->index, &def, &culler) != UMB_OK) {
            abort();
        }
        void *state = umb_culler_method_state(culler);
        umb_planes_go(state, way);
        for (uint32_t f = 0; f < FRAMES; ++f) {
            umb_view v = walk_view(p, f * speed * 1.4 / 60.0);
            umb_visible_set seen;
            double start = now_ms();
            if (umb_cull(culler, &v, &seen) != UMB_OK) {
                abort();
            }
            double ms = now_ms() - start;
            least[f] = r == 0 || ms < least[f] ? ms : least[f];
        }
        uint64_t there, made;
        umb_planes_count(state, &there, &made);
        *kept = there + made > 0 ? (double)there / (double)(there + made) : 0.0;
        umb_culler_destroy(culler);
    }
    for (uint32_t f = 8; f < FRAMES; ++f) {
        sum += least[f] / (FRAMES - 8);
    }
    return sum;
}

static void print_speeds(const place *p, uint32_t rounds)
{
    static const struct {
        const char *name;
        umb_planes_way way;
    } ways[3] = {{"planes through the eye, by eights", UMB_PLANES_DIRECT},
                 {"tangent planes by table", UMB_PLANES_TABLE},
                 {"tangent planes by table, kept", UMB_PLANES_CACHED}};
    for (int w = 0; w < 3; ++w) {
        printf("| %s | %s |", p->name, ways[w].name);
        for (uint32_t speed = 1; speed <= 16; speed *= 2) {
            double kept, ms = time_walk(p, ways[w].way, speed, rounds, &kept);
            if (ways[w].way == UMB_PLANES_CACHED) {
                printf(" %.3f (%.0f %%) |", ms, 100.0 * kept);
            } else {
                printf(" %.3f |", ms);
            }
        }
        printf("\n");
        (void)fflush(stdout);
    }
}

/* ---- 2: table and search ----------------------------------------------------------------------- */

static double random_in(uint64_t *state, double low, double high)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return low + (high - low) * ((double)(*state >> 11) * 0x1p-53);
}

static void print_table(uint32_t rounds)
{
    static float edges[PAIRS][2][3];
    static umb_aabb boxes[PAIRS];
    static umb_tangent_table table;
    uint64_t seed = 1;
    umb_tangent_table_make(&table);
    for (uint32_t i = 0; i < PAIRS; ++i) {
        for (int k = 0; k < 3; ++k) {
            double at = random_in(&seed, -10.0, 10.0), half = random_in(&seed, 0.1, 3.0);
            boxes[i].min[k] = (float)(at - half);
            boxes[i].max[k] = (float)(at + half);
            edges[i][0][k] = (float)random_in(&seed, -20.0, 20.0);
            edges[i][1][k] = (float)random_in(&seed, -20.0, 20.0);
        }
    }
    double best[2] = {INFINITY, INFINITY};
    uint64_t found[2] = {0, 0};
    for (uint32_t r = 0; r < 4 * rounds; ++r) {
        for (int way = 0; way < 2; ++way) {
            double start = now_ms();
            found[way] = 0;
            for (uint32_t i = 0; i < PAIRS; ++i) {
                umb_tangents t = {0, 0};
                bool ok = way == 0 ? umb_tangents_search(edges[i][0], edges[i][1], &boxes[i], &t)
                                   : umb_tangents_find(&table, edges[i][0], edges[i][1], &boxes[i], &t);
                found[way] += ok ? 1u + 8u * t.supporting + t.separating : 0;
            }
            double ms = now_ms() - start;
            best[way] = ms < best[way] ? ms : best[way];
        }
    }
    printf("Both find the same corners: %s. A pair of an edge and a box takes %.1f ns by search, %.1f ns by table: the "
           "table is %.1f times as fast.\n", found[0] == found[1] ? "yes" : "NO", best[0] * 1e6 / PAIRS,
           best[1] * 1e6 / PAIRS, best[0] / best[1]);
}

int main(int argc, char **argv)
{
    uint32_t rounds = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 5;
    place places[2] = {{.name = "building", .spec = "gen:building"},
                       {.name = "soda city", .spec = "gen:sodacity"}};
    if (rounds == 0 || rounds > MOST_ROUNDS) {
        (void)fprintf(stderr, "usage: bench_planes [ROUNDS [table]], from 1 to %d\n", MOST_ROUNDS);
        return 2;
    }
    if (argc > 2) {
        print_table(rounds);
        return 0;
    }
    for (int i = 0; i < 2; ++i) {
        if (!open_place(&places[i])) {
            return 1;
        }
    }
    printf("%s## What is left, and what is asked\n\n| scene | triangles | after the frustum | after occlusion | nodes a "
           "frame | occluders a node | of 64 |\n|---|---|---|---|---|---|---|\n", INTRO);
    print_left(&places[0]);
    print_left(&places[1]);
    printf("\n## Speeds\n\n| scene | planes | 1x | 2x | 4x | 8x | 16x |\n|---|---|---|---|---|---|---|\n");
    print_speeds(&places[0], rounds);
    print_speeds(&places[1], rounds);
    printf("\n## Table and search\n\n");
    print_table(rounds);
    for (int i = 0; i < 2; ++i) {
        close_place(&places[i]);
    }
    return 0;
}

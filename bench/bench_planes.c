/* The planes method beside the experiments of its paper, as tables in Markdown; scripts/planes-report makes
 * docs/results/planes.md of them.
 *
 *     bench_planes ROUNDS PART [SCENE]
 *
 *     left      what is left to draw, nodes and tests (Coorg and Teller 1997)
 *     speeds    the time to ask at multiples of walking speed, with planes kept at nodes and without, with occluders searched for
 *               and from lists
 *     table     tangent corners by table and by search
 *     commits   frames of a large scene in which things move
 *
 * SCENE: building or sodacity. Times are processor time: the least of the rounds for each frame, then the mean over the
 * frames.
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

/* A culler with what it makes ahead. */
static umb_culler *make_culler(const place *p, umb_method method, uint32_t coherence)
{
    umb_culler_def def = {.method = method, .coherence = coherence};
    umb_culler *culler;
    if (umb_culler_create(p->index, &def, &culler) != UMB_OK || umb_culler_prepare(culler) != UMB_OK) {
        abort();
    }
    return culler;
}

static void print_left(const place *p, const char *name, uint32_t coherence)
{
    umb_culler *cullers[2];
    uint64_t left[2] = {0, 0}, nodes = 0, tests = 0;
    for (int k = 0; k < 2; ++k) {
        cullers[k] = make_culler(p, k == 0 ? UMB_METHOD_NONE : UMB_METHOD_PLANES, k == 0 ? 0 : coherence);
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
    printf("| %s | %s | %llu | %.1f %% | %.1f %% | %.0f | %.1f | %.1f %% |\n", p->name, name, (unsigned long long)p->m->triangles,
           100.0 * (double)left[0] / all, 100.0 * (double)left[1] / all, (double)nodes / FRAMES,
           (double)tests / (double)nodes, 100.0 * (double)tests / (double)nodes / 64.0);
    (void)fflush(stdout);
}

/* The time to ask at one speed; *kept becomes the part of the planes that was there. */
static double time_walk(const place *p, umb_planes_way way, uint32_t coherence, uint32_t speed, uint32_t rounds, double *kept)
{
    static double least[FRAMES];
    double sum = 0.0;
    for (uint32_t r = 0; r < rounds; ++r) {
        umb_culler *culler = make_culler(p, UMB_METHOD_PLANES, coherence);
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
        uint32_t coherence;
    } ways[4] = {{"planes through the eye, by eights", UMB_PLANES_DIRECT, 0},
                 {"the same, occluders of leaves", UMB_PLANES_DIRECT, UMB_COHERENCE_LEAVES},
                 {"tangent planes by table", UMB_PLANES_TABLE, 0},
                 {"tangent planes by table, kept", UMB_PLANES_CACHED, 0}};
    for (int w = 0; w < 4; ++w) {
        printf("| %s | %s |", p->name, ways[w].name);
        for (uint32_t speed = 1; speed <= 16; speed *= 2) {
            double kept = 0.0, ms = time_walk(p, ways[w].way, ways[w].coherence, speed, rounds, &kept);
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

/* ---- 3: commits --------------------------------------------------------------------------------- */

enum { MOVED = 1000, COMMIT_FRAMES = 60 };

static void move_some(const place *p, uint32_t frame, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t object = (uint32_t)((uint64_t)(i * 977 + frame) * 2654435761u % p->m->object_count);
        umb_transform t = p->m->objects[object].transform;
        t.m[0][3] += frame % 2 == 0 ? 0.25f : 0.0f;
        if (umb_scene_move_object(p->scene, object, &t, NULL) != UMB_OK) {
            abort();
        }
    }
    if (umb_scene_commit(p->scene) != UMB_OK) {
        abort();
    }
}

/* Frames after so many commits each; the milliseconds of the frame alone. */
static double time_commits(const place *p, uint32_t commits, uint32_t rounds)
{
    static double least[COMMIT_FRAMES];
    double sum = 0.0;
    umb_culler *culler = make_culler(p, UMB_METHOD_PLANES, 0);
    for (uint32_t r = 0; r < rounds; ++r) {
        for (uint32_t f = 0; f < COMMIT_FRAMES; ++f) {
            umb_view v = view_at(p, p->path.rows[f % p->path.count], p->path.rows[f % p->path.count] + 3);
            umb_visible_set seen;
            for (uint32_t k = 0; k < commits; ++k) {
                move_some(p, f + k, k == 0 ? MOVED : 1);
            }
            double start = now_ms();
            if (umb_cull(culler, &v, &seen) != UMB_OK) {
                abort();
            }
            double ms = now_ms() - start;
            least[f] = r == 0 || ms < least[f] ? ms : least[f];
        }
    }
    for (uint32_t f = 1; f < COMMIT_FRAMES; ++f) {
        sum += least[f] / (COMMIT_FRAMES - 1);
    }
    umb_culler_destroy(culler);
    return sum;
}

static void print_commits(uint32_t rounds)
{
    static const char *const names[3] = {"nothing moves", "a commit that moves 1,000 objects", "the same and another commit"};
    place p = {.name = "blocks-100", .spec = "gen:blocks,g=100"};
    if (!open_place(&p)) {
        exit(1);
    }
    printf("| %s, %u objects: before each frame | ms a frame |\n|---|---|\n", p.name, p.m->object_count);
    for (uint32_t commits = 0; commits < 3; ++commits) {
        printf("| %s | %.3f |\n", names[commits], time_commits(&p, commits, rounds));
    }
    close_place(&p);
}

static void print_scenes(const char *part, const char *only, uint32_t rounds)
{
    place places[2] = {{.name = "building", .spec = "gen:building"}, {.name = "sodacity", .spec = "gen:sodacity"}};
    for (int i = 0; i < 2; ++i) {
        if (only != NULL && strcmp(only, places[i].name) != 0) {
            continue;
        }
        if (!open_place(&places[i])) {
            exit(1);
        }
        if (strcmp(part, "left") == 0) {
            print_left(&places[i], "searched for", 0);
            print_left(&places[i], "of leaves", UMB_COHERENCE_LEAVES);
        } else {
            print_speeds(&places[i], rounds);
        }
        close_place(&places[i]);
    }
}

int main(int argc, char **argv)
{
    uint32_t rounds = argc > 2 ? (uint32_t)strtoul(argv[1], NULL, 10) : 0;
    const char *part = argc > 2 ? argv[2] : "", *only = argc > 3 ? argv[3] : NULL;
    if (rounds == 0 || rounds > MOST_ROUNDS) {
        (void)fprintf(stderr, "usage: bench_planes ROUNDS left|speeds|table|commits [SCENE], from 1 to %d rounds\n", MOST_ROUNDS);
        return 2;
    }
    if (strcmp(part, "table") == 0) {
        print_table(rounds);
    } else if (strcmp(part, "commits") == 0) {
        print_commits(rounds);
    } else {
        print_scenes(part, only, rounds);
    }
    return 0;
}

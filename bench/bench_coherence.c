/* What it is worth to remember earlier frames: each switch of umb_coherence alone, some together, and budgets of
 * occluders, along walks, runs and jumps through each scene, as a table in Markdown.
 *
 *     bench_coherence [ROUNDS [SCENE]]
 *
 * SCENE: one of the names below; without it, all. Real scenes are found below $UMBRAGE_SCENES. Times are processor
 * time: the least of the rounds for each frame, then the mean over the frames.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "io/model.h"

typedef struct bench_scene {
    const char *name, *spec, *path; /* below $UMBRAGE_SCENES unless generated */
    double unit; /* metres */
    double near_depth;
} bench_scene;

static const bench_scene SCENES[] = {
    {"blocks-32", "gen:blocks,g=32", "gen:blocks,g=32", 1.0, 0.1},
    {"blocks-100", "gen:blocks,g=100", "gen:blocks,g=100", 1.0, 0.1},
    {"blocks-316", "gen:blocks,g=316", "gen:blocks,g=316", 1.0, 0.1},
    {"city-1M", "gen:city,triangles=1M", "gen:city,triangles=1M", 1.0, 0.1},
    {"castle", "castle/castle.glb", "castle/castle.path.csv", 1.0, 0.05},
    {"oa_dm1", "openarena/oa_dm1.bsp", "openarena/oa_dm1.path.csv", 0.0254, 4.0},
    {"e1m1", "quake/e1m1.bsp", "quake/e1m1.path.csv", 0.0254, 4.0},
    {"czest3ctf", "openarena/czest3ctf.bsp", "openarena/czest3ctf.path.csv", 0.0254, 4.0},
};

typedef struct motion {
    const char *name;
    double speed; /* metres a second; 0: each frame elsewhere */
} motion;

static const motion MOTIONS[] = {{"walk", 1.4}, {"run", 7.0}, {"jump", 0.0}};

enum { STARTS = 8, FRAMES = 24, UNTIMED = 4, MOST_FRAMES = STARTS * FRAMES, CONFIGS = 14 };

typedef struct config {
    const char *name;
    uint32_t coherence, budget;
} config;

static const config CONFIG[CONFIGS] = {
    {"none", 0, 0},
    {"list", UMB_COHERENCE_LIST, 0},
    {"hierarchy", UMB_COHERENCE_HIERARCHY, 0},
    {"propagation", UMB_COHERENCE_PROPAGATION, 0},
    {"conservative", UMB_COHERENCE_CONSERVATIVE, 0},
    {"rest", UMB_COHERENCE_REST, 0},
    {"list, hierarchy", UMB_COHERENCE_LIST | UMB_COHERENCE_HIERARCHY, 0},
    {"hierarchy, conservative", UMB_COHERENCE_HIERARCHY | UMB_COHERENCE_CONSERVATIVE, 0},
    {"conservative, rest", UMB_COHERENCE_CONSERVATIVE | UMB_COHERENCE_REST, 0},
    {"all", UMB_COHERENCE_ALL, 0},
    {"budget 32", 0, 32},
    {"budget 128", 0, 128},
    {"budget 512", 0, 512},
    {"budget 128, rest", UMB_COHERENCE_REST, 128},
};

typedef struct views {
    umb_view view[MOST_FRAMES];
    uint32_t count;
} views;

static double now_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* ---- views ---------------------------------------------------------------------------------- */

/* A point and a look along the line through a path's eyes, from row on. */
static void along(const camera_path *p, uint32_t row, double way, bool ahead, double eye[3], double look[3])
{
    for (; row + 2 < p->count; ++row) {
        const double *a = p->rows[row], *b = p->rows[row + 1];
        double step = hypot(hypot(b[0] - a[0], b[1] - a[1]), b[2] - a[2]);
        if (way < step || row + 3 == p->count) {
            double s = step > 0.0 ? way / step : 0.0;
            for (int k = 0; k < 3; ++k) {
                eye[k] = a[k] + s * (b[k] - a[k]);
                double from = a[k + 3] - a[k], to = b[k + 3] - b[k];
                look[k] = ahead ? b[k] - a[k] : from + s * (to - from);
            }
            return;
        }
        way -= step;
    }
}

static bool add_view(views *v, const model *m, const bench_scene *s, const double eye[3], const double look[3],
                     double turn)
{
    double from[3], to[3], side[3];
    const double *up = m->up;
    for (int k = 0; k < 3; ++k) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        side[k] = look[i] * up[j] - look[j] * up[i];
    }
    double far_depth = 1.0;
    for (int k = 0; k < 3; ++k) {
        from[k] = eye[k] - m->origin[k];
        to[k] = from[k] + cos(turn) * look[k] + sin(turn) * side[k];
        far_depth += 2.0 * (m->bounds.max[k] - m->bounds.min[k]);
    }
    return umb_view_look_at(&v->view[v->count++], from, to, up, 1.0471975511965976, 16.0 / 9.0, s->near_depth,
                            far_depth) == UMB_OK;
}

static bool make_views(views *v, const model *m, const bench_scene *s, const camera_path *p, const motion *how)
{
    uint32_t rows = p->count < 480 ? p->count : 480; /* nasty eyes follow */
    bool ahead = strncmp(s->path, "gen:", 4) == 0, ok = true;
    v->count = 0;
    for (uint32_t f = 0; f < MOST_FRAMES; ++f) {
        double eye[3], look[3], turn = 0.0;
        if (how->speed > 0.0) {
            uint32_t start = 2 + (f / FRAMES) * (rows / STARTS);
            along(p, start, (f % FRAMES) * how->speed / (60.0 * s->unit), ahead, eye, look);
            turn = 0.7 * sin(6.283185307179586 * f / 360.0);
        } else {
            along(p, f * 37 % (rows - 4), 0.0, ahead, eye, look);
            turn = ahead ? 2.4 * f : 0.0;
        }
        ok = ok && add_view(v, m, s, eye, look, turn);
    }
    return ok;
}

/* ---- running -------------------------------------------------------------------------------- */

typedef struct figures {
    double ms[MOST_FRAMES]; /* least so far */
    umb_cull_stats sum;     /* of the timed frames; the same in each round */
} figures;

static void add_stats(umb_cull_stats *sum, const umb_cull_stats *s)
{
    sum->visible += s->visible;
    sum->nodes += s->nodes;
    sum->queries += s->queries;
    sum->occluders += s->occluders;
    sum->saved += s->saved;
    sum->early += s->early;
    sum->resting += s->resting;
    sum->over_budget += s->over_budget;
}

static bool timed(const motion *m, uint32_t frame)
{
    return m->speed > 0.0 ? frame % FRAMES >= UNTIMED : frame > 0;
}

static bool run_round(const umb_index *index, const config *c, const motion *m, const views *v, figures *out)
{
    umb_culler *culler = NULL;
    umb_culler_def def = {.coherence = c->coherence, .occluder_budget = c->budget};
    if (umb_culler_create(index, &def, &culler) != UMB_OK) {
        return false;
    }
    bool ok = true;
    memset(&out->sum, 0, sizeof out->sum);
    for (uint32_t f = 0; ok && f < v->count; ++f) {
        umb_visible_set seen;
        double start = now_ms();
        ok = umb_cull(culler, &v->view[f], &seen) == UMB_OK;
        double ms = now_ms() - start;
        out->ms[f] = ms < out->ms[f] ? ms : out->ms[f];
        if (timed(m, f)) {
            add_stats(&out->sum, &seen.stats);
        }
    }
    umb_culler_destroy(culler);
    return ok;
}

static void print_row(const bench_scene *s, const motion *m, const config *c, const figures *f, double *first)
{
    double ms = 0.0;
    uint32_t frames = 0;
    for (uint32_t i = 0; i < MOST_FRAMES; ++i) {
        ms += timed(m, i) ? f->ms[i] : 0.0;
        frames += timed(m, i);
    }
    *first = c == CONFIG ? ms : *first;
    double n = frames;
    printf("| %s, %s | %s | %.1f | %.4f | %.2f | %.1f | %.1f | %.0f | %.0f | %.1f | %.1f | %.1f |\n", s->name, m->name,
           c->name, f->sum.visible / n, ms / n, ms / *first, f->sum.nodes / n, f->sum.occluders / n,
           f->sum.queries / n, f->sum.saved / n, f->sum.early / n, f->sum.resting / n, f->sum.over_budget / n);
    (void)fflush(stdout);
}

static bool run_motion(const umb_index *index, const model *m, const bench_scene *s, const camera_path *p,
                       const motion *how, uint32_t rounds)
{
    static figures all[CONFIGS];
    static views v;
    if (!make_views(&v, m, s, p, how)) {
        return false;
    }
    for (uint32_t c = 0; c < CONFIGS; ++c) {
        for (uint32_t f = 0; f < MOST_FRAMES; ++f) {
            all[c].ms[f] = INFINITY;
        }
    }
    bool ok = true;
    for (uint32_t round = 0; ok && round < rounds; ++round) {
        for (uint32_t c = 0; ok && c < CONFIGS; ++c) {
            ok = run_round(index, &CONFIG[c], how, &v, &all[c]);
        }
    }
    double first = 0.0;
    for (uint32_t c = 0; ok && c < CONFIGS; ++c) {
        print_row(s, how, &CONFIG[c], &all[c], &first);
    }
    return ok;
}

static bool run_scene(const bench_scene *s, const char *folder, uint32_t rounds)
{
    bool generated = strncmp(s->spec, "gen:", 4) == 0;
    if (!generated && folder == NULL) {
        (void)fprintf(stderr, "%s: left out, UMBRAGE_SCENES is not set\n", s->name);
        return true;
    }
    char spec[1024], path[1024];
    (void)snprintf(spec, sizeof spec, "%s%s%s", generated ? "" : folder, generated ? "" : "/", s->spec);
    (void)snprintf(path, sizeof path, "%s%s%s", generated ? "" : folder, generated ? "" : "/", s->path);
    umb_error error = {0};
    camera_path p = {0};
    umb_scene *scene = NULL;
    umb_index *index = NULL;
    model *m = model_load(spec, NULL, &error);
    bool ok = m != NULL && camera_path_load(path, &p, &error);
    if (ok) {
        scene = model_scene(m, true, (umb_tasks){0}, NULL, &error);
        ok = scene != NULL && umb_index_create(scene, NULL, &index) == UMB_OK;
    }
    for (size_t k = 0; ok && k < sizeof MOTIONS / sizeof MOTIONS[0]; ++k) {
        ok = run_motion(index, m, s, &p, &MOTIONS[k], rounds);
    }
    if (!ok) {
        (void)fprintf(stderr, "%s: %s\n", s->name, error.text);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    camera_path_free(&p);
    model_free(m);
    return ok;
}

int main(int argc, char **argv)
{
    uint32_t rounds = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 5;
    const char *only = argc > 2 ? argv[2] : NULL, *folder = getenv("UMBRAGE_SCENES");
    if (rounds == 0) {
        (void)fprintf(stderr, "usage: bench_coherence [ROUNDS [SCENE]]\n");
        return 2;
    }
    printf("| scene, motion | remembers | reported | ms | of none | nodes | occluders | queries | saved | early | "
           "resting | over budget |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    bool ok = true;
    for (size_t i = 0; i < sizeof SCENES / sizeof SCENES[0]; ++i) {
        if (only == NULL || strcmp(only, SCENES[i].name) == 0) {
            ok = run_scene(&SCENES[i], folder, rounds) && ok;
        }
    }
    return ok ? 0 : 1;
}

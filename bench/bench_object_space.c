/* The methods that choose their occluders first, beside the raster: how tight and how long, against the number of
 * occluders, as a table in Markdown.
 *
 *     bench_object_space [ROUNDS [SCENE]]
 *
 * SCENE: one of the names below; without it, all. Real scenes are found below $UMBRAGE_SCENES. Exact visibility is
 * traced once for each view; the exit code is 1 when a method hid what can be seen. Times are processor time: the least
 * of the rounds for each view, then the mean over the views.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "io/model.h"
#include "truth/truth.h"

typedef struct bench_scene {
    const char *name, *spec, *path; /* below $UMBRAGE_SCENES unless generated */
    double near_depth;
} bench_scene;

static const bench_scene SCENES[] = {
    {"blocks-32", "gen:blocks,g=32", "gen:blocks,g=32", 0.1},
    {"city-100k", "gen:city,triangles=100k", "gen:city,triangles=100k", 0.1},
    {"building", "gen:building", "gen:building", 0.1},
    {"castle", "castle/castle.glb", "castle/castle.path.csv", 0.05},
    {"oa_dm1", "openarena/oa_dm1.bsp", "openarena/oa_dm1.path.csv", 4.0},
    {"e1m1", "quake/e1m1.bsp", "quake/e1m1.path.csv", 4.0},
};

static const struct way {
    const char *name;
    umb_method method;
    uint32_t coherence;
} WAYS[] = {{"planes", UMB_METHOD_PLANES, 0},
            {"planes, leaves", UMB_METHOD_PLANES, UMB_COHERENCE_LEAVES},
            {"shadow-frusta", UMB_METHOD_SHADOW_FRUSTA, 0},
            {"occlusion-tree", UMB_METHOD_OCCLUSION_TREE, 0}};
static const uint32_t BUDGETS[] = {8, 16, 32, 64, 128, 256};

enum {
    VIEWS = 24,
    WAY_COUNT = sizeof WAYS / sizeof WAYS[0],
    BUDGET_COUNT = sizeof BUDGETS / sizeof BUDGETS[0],
    ROWS = 1 + WAY_COUNT * BUDGET_COUNT /* the raster first */
};

typedef struct row {
    const char *name;
    uint32_t budget;
    umb_culler *culler;
    double ms[VIEWS]; /* least so far */
    umb_cull_stats sum;
    uint64_t reported, wrong;
} row;

typedef struct stand {
    const bench_scene *scene;
    model *model;
    umb_scene *built;
    umb_index *index;
    truth *oracle;
    umb_view views[VIEWS];
    uint32_t view_count;
    uint8_t *seen; /* per view and object: a confirmed witness */
    uint64_t truly_visible;
    row rows[ROWS];
} stand;

static double now_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* Evenly along the path; the last rows of real ones are nasty eyes. */
static bool make_views(stand *s, const camera_path *p)
{
    const model *m = s->model;
    uint32_t rows = p->count > 480 ? 480 : p->count;
    double far_depth = 1.0;
    for (int k = 0; k < 3; ++k) {
        far_depth += 2.0 * (m->bounds.max[k] - m->bounds.min[k]);
    }
    s->view_count = rows < VIEWS ? rows : VIEWS;
    for (uint32_t i = 0; i < s->view_count; ++i) {
        const double *r = p->rows[i * rows / s->view_count];
        double eye[3], target[3];
        for (int k = 0; k < 3; ++k) {
            eye[k] = r[k] - m->origin[k];
            target[k] = r[3 + k] - m->origin[k];
        }
        if (umb_view_look_at(&s->views[i], eye, target, m->up, 1.0471975511965976, 2.0, s->scene->near_depth,
                             far_depth) != UMB_OK) {
            return false;
        }
    }
    return rows > 0;
}

static bool trace(stand *s, umb_error *error)
{
    uint32_t n = s->model->object_count;
    s->seen = calloc((size_t)VIEWS * n + 1, 1);
    for (uint32_t v = 0; s->seen != NULL && v < s->view_count; ++v) {
        truth_options options = {.grid_width = 512, .grid_height = 256, .guided_rays = 1000000, .threads = 1};
        truth_result result;
        if (!truth_view(s->oracle, &s->views[v], &options, &result, error)) {
            return false;
        }
        for (uint32_t i = 0; i < n; ++i) {
            s->seen[(size_t)v * n + i] = result.culling[i].confirmed != 0 || result.two_sided[i].confirmed != 0;
        }
        s->truly_visible += result.visible;
        truth_result_free(&result);
    }
    return s->seen != NULL;
}

static void judge(const stand *s, uint32_t view, const umb_visible_set *answer, row *r)
{
    uint32_t n = s->model->object_count, found = 0, all = 0;
    const uint8_t *seen = s->seen + (size_t)view * n;
    for (uint32_t i = 0; i < n; ++i) {
        all += seen[i];
    }
    for (uint32_t i = 0; i < answer->count; ++i) {
        found += seen[answer->objects[i]];
    }
    r->wrong += all - found;
    r->reported += answer->count;
    r->sum.occluders += answer->stats.occluders;
    r->sum.queries += answer->stats.queries;
}

static bool run(stand *s, uint32_t rounds)
{
    for (uint32_t round = 0; round < rounds; ++round) {
        for (uint32_t v = 0; v < s->view_count; ++v) {
            for (uint32_t k = 0; k < ROWS; ++k) {
                row *r = &s->rows[k];
                umb_visible_set answer;
                double start = now_ms();
                if (umb_cull(r->culler, &s->views[v], &answer) != UMB_OK) {
                    return false;
                }
                double ms = now_ms() - start;
                r->ms[v] = round == 0 || ms < r->ms[v] ? ms : r->ms[v];
                if (round == 0) {
                    judge(s, v, &answer, r);
                }
            }
        }
    }
    return true;
}

static bool make_rows(stand *s)
{
    static const struct way raster = {"raster", UMB_METHOD_RASTER, 0};
    bool ok = true;
    for (uint32_t k = 0; k < ROWS && ok; ++k) {
        row *r = &s->rows[k];
        const struct way *way = k == 0 ? &raster : &WAYS[(k - 1) / BUDGET_COUNT];
        r->name = way->name;
        r->budget = k == 0 ? 0 : BUDGETS[(k - 1) % BUDGET_COUNT];
        umb_culler_def def = {.method = way->method, .coherence = way->coherence, .occluder_budget = r->budget};
        ok = umb_culler_create(s->index, &def, &r->culler) == UMB_OK && umb_culler_prepare(r->culler) == UMB_OK;
    }
    return ok;
}

static double mean_ms(const stand *s, const row *r)
{
    double sum = 0.0;
    for (uint32_t v = 0; v < s->view_count; ++v) {
        sum += r->ms[v];
    }
    return sum / s->view_count;
}

static bool print_rows(const stand *s)
{
    uint64_t wrong = 0;
    double n = s->view_count, raster = mean_ms(s, &s->rows[0]);
    for (uint32_t k = 0; k < ROWS; ++k) {
        const row *r = &s->rows[k];
        char budget[16] = "-";
        if (r->budget != 0) {
            (void)snprintf(budget, sizeof budget, "%u", r->budget);
        }
        printf("| %s | %s | %s | %.1f | %.1f | %.3f | %.3f | %.1f | %.1f | %.0f |\n", s->scene->name,
               r->name, budget, (double)r->reported / n, (double)s->truly_visible / n,
               (double)r->reported / (double)s->truly_visible, mean_ms(s, r), mean_ms(s, r) / raster,
               r->sum.occluders / n, r->sum.queries / n);
        wrong += r->wrong;
    }
    (void)fflush(stdout);
    if (wrong > 0) {
        (void)fprintf(stderr, "%s: %llu objects were hidden that can be seen\n", s->scene->name,
                      (unsigned long long)wrong);
    }
    return wrong == 0;
}

static bool run_scene(const bench_scene *scene, const char *folder, uint32_t rounds)
{
    bool generated = strncmp(scene->spec, "gen:", 4) == 0;
    if (!generated && folder == NULL) {
        (void)fprintf(stderr, "%s: left out, UMBRAGE_SCENES is not set\n", scene->name);
        return true;
    }
    char spec[1024], path[1024];
    (void)snprintf(spec, sizeof spec, "%s%s%s", generated ? "" : folder, generated ? "" : "/", scene->spec);
    (void)snprintf(path, sizeof path, "%s%s%s", generated ? "" : folder, generated ? "" : "/", scene->path);
    static stand s;
    umb_error error = {0};
    camera_path p = {0};
    memset(&s, 0, sizeof s);
    s.scene = scene;
    s.model = model_load(spec, NULL, &error);
    bool ok = s.model != NULL && camera_path_load(path, &p, &error) && make_views(&s, &p);
    if (ok) {
        s.built = model_scene(s.model, true, (umb_tasks){0}, NULL, &error);
        s.oracle = truth_create(s.model, &error);
        ok = s.built != NULL && s.oracle != NULL && umb_index_create(s.built, NULL, &s.index) == UMB_OK;
    }
    ok = ok && trace(&s, &error) && make_rows(&s) && run(&s, rounds);
    if (!ok) {
        (void)fprintf(stderr, "%s: %s\n", scene->name, error.text);
    }
    ok = ok && print_rows(&s);
    for (uint32_t k = 0; k < ROWS; ++k) {
        umb_culler_destroy(s.rows[k].culler);
    }
    free(s.seen);
    umb_index_destroy(s.index);
    umb_scene_destroy(s.built);
    truth_destroy(s.oracle);
    camera_path_free(&p);
    model_free(s.model);
    return ok;
}

int main(int argc, char **argv)
{
    uint32_t rounds = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 5;
    const char *only = argc > 2 ? argv[2] : NULL, *folder = getenv("UMBRAGE_SCENES");
    if (rounds == 0) {
        (void)fprintf(stderr, "usage: bench_object_space [ROUNDS [SCENE]]\n");
        return 2;
    }
    printf("| scene | method | occluders asked for | reported | truly visible | conservativity | ms | of the raster | "
           "occluders | queries |\n|---|---|---|---|---|---|---|---|---|---|\n");
    bool ok = true;
    for (size_t i = 0; i < sizeof SCENES / sizeof SCENES[0]; ++i) {
        if (only == NULL || strcmp(only, SCENES[i].name) == 0) {
            ok = run_scene(&SCENES[i], folder, rounds) && ok;
        }
    }
    return ok ? 0 : 1;
}

/* The views of a part, answered and judged: threads take batches, each batch has its own culler. */
#include <inttypes.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "soak.h"
#include "support/micro_scenes.h"

enum { GRID_WIDTH = 256, GRID_HEIGHT = 128, MICRO_GRID = 96, PROGRESS_SECONDS = 20 };

static const uint32_t RASTERS[][2] = {{1024, 288}, {256, 144}, {512, 288}, {2048, 576}, {640, 480}};
enum { RASTER_COUNT = sizeof RASTERS / sizeof RASTERS[0] };

/* What the threads of one part share. */
typedef struct crew {
    const soak_run *run;
    pthread_mutex_t lock; /* of all below, of the log and of what is printed */
    uint32_t next, fresh;
    struct timespec told;
    umb_error error;
    bool failed;
} crew;

/* One thread's own. */
typedef struct bench {
    crew *crew;
    uint8_t *shown, *accused;
    uint32_t *ids;
    uint32_t capacity;
    bool print; /* tell everything */
} bench;

static double seconds_between(const struct timespec *a, const struct timespec *b)
{
    return (double)(b->tv_sec - a->tv_sec) + 1e-9 * (double)(b->tv_nsec - a->tv_nsec);
}

static bool make_room(bench *b, uint32_t objects)
{
    if (objects < b->capacity) {
        return true;
    }
    free(b->shown);
    free(b->accused);
    free(b->ids);
    b->capacity = objects + 1;
    b->shown = malloc(b->capacity);
    b->accused = malloc(b->capacity);
    b->ids = malloc(2 * (size_t)b->capacity * sizeof *b->ids);
    return b->shown != NULL && b->accused != NULL && b->ids != NULL;
}

static bool fail(crew *c, const char *what, const umb_error *why)
{
    pthread_mutex_lock(&c->lock);
    if (!c->failed) {
        c->failed = true;
        c->error.code = UMB_ERROR_STATE;
        (void)snprintf(c->error.text, sizeof c->error.text, "%s: %s: %.150s", c->run->part->name,
                       what, why->text);
    }
    pthread_mutex_unlock(&c->lock);
    return false;
}

/* A line about a hidden object: to a file of its own, and to a stream if there is one. */
static void tell(bench *b, const char *what, FILE *stream, const model *m, const umb_view *view,
                 uint64_t number, uint32_t object, const truth_witness *w)
{
    const soak_run *run = b->crew->run;
    char name[1300];
    (void)snprintf(name, sizeof name, "%.1000s/%s.txt", run->folder, what);
    pthread_mutex_lock(&b->crew->lock);
    FILE *files[2] = {stream, fopen(name, "a")};
    for (int k = 0; k < 2; ++k) {
        if (files[k] != NULL) {
            (void)fprintf(files[k],
                          "%s: part %s view %" PRIu64 " raster %ux%u object %u (%s), from "
                          "%.17g,%.17g,%.17g at %.17g,%.17g,%.17g\n",
                          what, run->part->name, number, view->buffer_width, view->buffer_height,
                          object, m->objects[object].name, w->from[0], w->from[1], w->from[2],
                          w->to[0], w->to[1], w->to[2]);
        }
    }
    if (files[1] != NULL) {
        (void)fclose(files[1]);
    }
    pthread_mutex_unlock(&b->crew->lock);
}

static void judge(bench *b, const model *m, const umb_view *view, uint64_t number,
                  const truth_result *r, soak_count *sum)
{
    for (uint32_t i = 0; i < m->object_count; ++i) {
        if (b->accused[i] == 0) {
            continue;
        }
        const truth_witness *both[2] = {&r->culling[i], &r->two_sided[i]}, *proof = NULL;
        bool seen = false;
        for (int k = 0; k < 2; ++k) {
            seen = seen || both[k]->renderers != 0;
            proof = both[k]->renderers != 0 && both[k]->confirmed != 0 ? both[k] : proof;
        }
        if (proof != NULL) {
            tell(b, "wrongly-hidden", stderr, m, view, number, i, proof);
        } else if (seen) {
            tell(b, "unconfirmed", b->print ? stdout : NULL, m, view, number, i,
                 both[0]->renderers != 0 ? both[0] : both[1]);
        }
        sum->wrong += proof != NULL;
        sum->unconfirmed += seen && proof == NULL;
    }
}

/* Hold one answer against the oracle. */
static bool check(bench *b, const model *m, truth *oracle, const umb_view *view, uint64_t number,
                  const umb_visible_set *set, soak_count *sum)
{
    const soak_part *part = b->crew->run->part;
    bool micro = part->style == SOAK_MICRO;
    if (!make_room(b, m->object_count)) {
        return fail(b->crew, "an answer", &(umb_error){.text = "not enough memory"});
    }
    uint32_t reported = planted_answer(set, m->object_count, b->ids);
    memset(b->accused, 1, m->object_count);
    for (uint32_t k = 0; k < reported; ++k) {
        b->accused[b->ids[k]] = 0;
    }
    truth_options options = {.grid_width = micro ? MICRO_GRID : GRID_WIDTH,
                             .grid_height = micro ? MICRO_GRID : GRID_HEIGHT,
                             .guided_rays = part->rays,
                             .accused = b->accused,
                             .most_targets = part->most_targets,
                             .most_decided = part->most_decided,
                             .threads = 1};
    truth_result r;
    umb_error error = {0};
    if (!truth_view(oracle, view, &options, &r, &error)) {
        return fail(b->crew, "the oracle", &error);
    }
    uint64_t wrong = sum->wrong, unconfirmed = sum->unconfirmed;
    judge(b, m, view, number, &r, sum);
    sum->views += 1;
    sum->pairs += r.in_view;
    sum->seen += r.visible;
    sum->reported += reported;
    sum->rays += r.rays;
    sum->proven += r.decided_hidden;
    sum->open += r.undecided;
    if (b->print) {
        printf("view %" PRIu64 " (%s): in view %u, seen %u, reported %u, wrong %" PRIu64
               ", unconfirmed %" PRIu64 ", withdrawn %u, proven hidden %u, open %u, rays %" PRIu64
               ", rounds %u\n",
               number, part->style == SOAK_ORDINARY ? "ordinary" : soak_view_kind(number),
               r.in_view, r.visible, reported, sum->wrong - wrong, sum->unconfirmed - unconfirmed,
               r.withdrawn, r.decided_hidden, r.undecided, r.rays, r.rounds);
    }
    truth_result_free(&r);
    return true;
}

static bool cull_and_check(bench *b, umb_culler *culler, const model *m, truth *oracle,
                           umb_view *view, uint64_t number, soak_count *sum)
{
    const uint32_t *raster = RASTERS[number % RASTER_COUNT];
    view->buffer_width = raster[0];
    view->buffer_height = raster[1];
    umb_visible_set set;
    if (umb_cull(culler, view, &set) != UMB_OK) {
        return fail(b->crew, "a view", &(umb_error){.text = "the culler refused it"});
    }
    return check(b, m, oracle, view, number, &set, sum);
}

/* Answers do not depend on the instruction set: each gets its share of the batches. */
static umb_isa isa_of(uint64_t batch)
{
    static const umb_isa others[8] = {UMB_ISA_AUTO, UMB_ISA_AUTO, UMB_ISA_AUTO, UMB_ISA_AUTO,
                                      UMB_ISA_AUTO, UMB_ISA_AUTO, UMB_ISA_SSE4, UMB_ISA_SCALAR};
    umb_isa isa = others[batch % 8];
    return umb_isa_available(isa) ? isa : UMB_ISA_AUTO;
}

static bool scene_batch(bench *b, uint64_t first, uint64_t last, soak_count *sum)
{
    const soak_scene *s = b->crew->run->scene;
    uint64_t batch = first / SOAK_BATCH;
    umb_culler *culler = NULL;
    umb_culler_def def = {.isa = isa_of(batch)};
    umb_index *index = s->flat != NULL && batch % 5 == 4 ? s->flat : s->index;
    if (umb_culler_create(index, &def, &culler) != UMB_OK) {
        return fail(b->crew, "a culler", &(umb_error){.text = "not enough memory"});
    }
    bool ok = true;
    for (uint64_t k = first; ok && k < last; ++k) {
        umb_view view;
        bool made = b->crew->run->part->style == SOAK_ORDINARY
                        ? soak_view_ordinary(s, k, &view)
                        : soak_view_adversarial(s->model, k, &view);
        ok = made ? cull_and_check(b, culler, s->model, s->oracle, &view, k, sum)
                  : fail(b->crew, "a view", &(umb_error){.text = "none can be made"});
    }
    umb_culler_destroy(culler);
    return ok;
}

/* Every second view is the micro scene's own; the others are made from its geometry. */
static bool micro_view(bench *b, uint64_t number, soak_count *sum)
{
    micro_scene micro = {0};
    umb_error error = {0};
    umb_tasks tasks = {0};
    if (!micro_scene_make(number / 2, &micro)) {
        return fail(b->crew, "a micro scene", &(umb_error){.text = "not enough memory"});
    }
    plant planted = b->crew->run->scene->planted;
    umb_scene *scene = planted == PLANT_NONE
                           ? model_scene(micro.model, micro.weld, tasks, NULL, &error)
                           : planted_scene(micro.model, planted, micro.weld);
    truth *oracle = truth_create(micro.model, &error);
    umb_index *index = NULL;
    umb_culler *culler = NULL;
    umb_index_def flat = {.kind = number % 7 == 0 ? UMB_INDEX_FLAT : UMB_INDEX_BVH};
    bool ok = scene != NULL && oracle != NULL && umb_index_create(scene, &flat, &index) == UMB_OK &&
              umb_culler_create(index, NULL, &culler) == UMB_OK;
    if (!ok) {
        (void)fail(b->crew, "a micro scene", &error);
    } else if (number % 2 == 0 || soak_view_adversarial(micro.model, number, &micro.view)) {
        ok = cull_and_check(b, culler, micro.model, oracle, &micro.view, number, sum);
    }
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    if (oracle != NULL) {
        truth_destroy(oracle);
    }
    micro_scene_free(&micro);
    return ok;
}

/* One engine answers most cells, one after the other; every fifth cell has a flat index, every fifth a kd-tree, and a quarter
 * other instruction sets. */
static bool cell_batch(bench *b, uint64_t first, uint64_t last, soak_count *sum)
{
    const soak_scene *s = b->crew->run->scene;
    umb_error error = {0};
    umb_region *common = NULL, *own = NULL;
    soak_judge judge = {b->crew->run->part, s->model, s->oracle, b->crew->run->folder, b->print};
    bool ok = umb_region_create(s->index, &(umb_region_def){.error = &error}, &common) == UMB_OK;
    for (uint64_t k = first; ok && k < last; ++k) {
        umb_index *index = s->flat != NULL && k % 5 == 4 ? s->flat : s->kd != NULL && k % 5 == 3 ? s->kd : s->index;
        umb_region_def def = {.isa = isa_of(k), .error = &error};
        bool usual = index == s->index && def.isa == UMB_ISA_AUTO;
        ok = (usual || umb_region_create(index, &def, &own) == UMB_OK) &&
             soak_judge_cell(&judge, usual ? common : own, &s->path, k, sum, &error);
        umb_region_destroy(own);
        own = NULL;
    }
    umb_region_destroy(common);
    return ok || fail(b->crew, "a cell", &error);
}

static bool micro_cell(bench *b, uint64_t number, soak_count *sum)
{
    micro_scene micro = {0};
    umb_error error = {0};
    umb_tasks tasks = {0};
    if (!micro_scene_make(number, &micro)) {
        return fail(b->crew, "a micro scene", &(umb_error){.text = "not enough memory"});
    }
    plant planted = b->crew->run->scene->planted;
    umb_scene *scene = planted == PLANT_NONE
                           ? model_scene(micro.model, micro.weld, tasks, NULL, &error)
                           : planted_scene(micro.model, planted, micro.weld);
    truth *oracle = truth_create(micro.model, &error);
    umb_index *index = NULL;
    umb_region *region = NULL;
    umb_index_def flat = {.kind = number % 7 == 0 ? UMB_INDEX_FLAT : UMB_INDEX_BVH};
    umb_region_def def = {.isa = isa_of(number / 8), .error = &error};
    double row[6] = {micro.view.eye[0], micro.view.eye[1], micro.view.eye[2]};
    camera_path path = {.rows = &row, .count = 1};
    soak_judge judge = {b->crew->run->part, micro.model, oracle, b->crew->run->folder, b->print};
    bool ok = scene != NULL && oracle != NULL && umb_index_create(scene, &flat, &index) == UMB_OK &&
              umb_region_create(index, &def, &region) == UMB_OK &&
              soak_judge_cell(&judge, region, &path, number, sum, &error);
    umb_region_destroy(region);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    if (oracle != NULL) {
        truth_destroy(oracle);
    }
    micro_scene_free(&micro);
    return ok || fail(b->crew, "a micro scene", &error);
}

static bool run_views(bench *b, uint64_t first, uint64_t last, soak_count *sum)
{
    soak_style style = b->crew->run->part->style;
    if (style == SOAK_CELLS) {
        return cell_batch(b, first, last, sum);
    }
    if (style != SOAK_MICRO && style != SOAK_MICRO_CELLS) {
        return scene_batch(b, first, last, sum);
    }
    bool ok = true;
    for (uint64_t k = first; ok && k < last; ++k) {
        ok = style == SOAK_MICRO ? micro_view(b, k, sum) : micro_cell(b, k, sum);
    }
    return ok;
}

/* The next batch to do; UINT32_MAX: none, or time to stop. */
static uint32_t take_batch(crew *c)
{
    const soak_run *run = c->run;
    uint32_t batch = UINT32_MAX;
    pthread_mutex_lock(&c->lock);
    while (c->next < run->log->batches && run->log->done[c->next] != 0) {
        ++c->next;
    }
    if (c->next < run->log->batches && *run->stop == 0 && !c->failed &&
        c->fresh < run->most_batches) {
        batch = c->next++;
        ++c->fresh;
    }
    pthread_mutex_unlock(&c->lock);
    return batch;
}

static void put_away(crew *c, uint32_t batch, const soak_count *count)
{
    const soak_run *run = c->run;
    struct timespec now;
    pthread_mutex_lock(&c->lock);
    if (!soak_log_add(run->log, batch, count) && !c->failed) {
        c->failed = true;
        (void)snprintf(c->error.text, sizeof c->error.text,
                       "%.180s: cannot be written; choose another folder with --out",
                       run->log->file);
    }
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    if (!run->quiet && seconds_between(&c->told, &now) > PROGRESS_SECONDS) {
        const soak_count *sum = &run->log->sum;
        c->told = now;
        (void)fprintf(stderr, "%s: %" PRIu64 " of %u views, %.3g pairs, wrong %" PRIu64 "\n",
                      run->part->name, sum->views, run->part->views, (double)sum->pairs, sum->wrong);
    }
    pthread_mutex_unlock(&c->lock);
}

static void bench_free(bench *b)
{
    free(b->shown);
    free(b->accused);
    free(b->ids);
}

static void *work(void *data)
{
    bench b = {.crew = data};
    for (uint32_t batch; (batch = take_batch(b.crew)) != UINT32_MAX;) {
        uint64_t first = (uint64_t)batch * SOAK_BATCH, last = first + SOAK_BATCH;
        uint64_t views = b.crew->run->part->views;
        soak_count count = {0};
        struct timespec begin, end;
        (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &begin);
        if (!run_views(&b, first, last < views ? last : views, &count)) {
            break;
        }
        (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &end);
        count.seconds = seconds_between(&begin, &end);
        put_away(b.crew, batch, &count);
    }
    bench_free(&b);
    return NULL;
}

bool soak_run_part(const soak_run *run, umb_error *error)
{
    crew c = {.run = run};
    pthread_t threads[256];
    uint32_t started = 0, wanted = run->threads < 256 ? run->threads : 256;
    pthread_mutex_init(&c.lock, NULL);
    (void)clock_gettime(CLOCK_MONOTONIC, &c.told);
    while (started + 1 < wanted && pthread_create(&threads[started], NULL, work, &c) == 0) {
        ++started;
    }
    (void)work(&c);
    for (uint32_t k = 0; k < started; ++k) {
        pthread_join(threads[k], NULL);
    }
    pthread_mutex_destroy(&c.lock);
    if (c.failed) {
        *error = c.error;
    }
    return !c.failed;
}

bool soak_run_view(const soak_run *run, uint64_t number, umb_error *error)
{
    crew c = {.run = run};
    bench b = {.crew = &c, .print = true};
    soak_count count = {0};
    pthread_mutex_init(&c.lock, NULL);
    bool ok = run_views(&b, number, number + 1, &count);
    bench_free(&b);
    pthread_mutex_destroy(&c.lock);
    if (!ok) {
        *error = c.error;
    }
    return ok;
}

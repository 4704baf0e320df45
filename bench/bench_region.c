/* Leyvand's tables again, and how cost and set size depend on the method's settings: one view cell at a time.
 *
 *   bench_region DATA [--only TEXT] [--rays N] [--effort N|none] [--repeat N] [--most TRIANGLES] [--plots FOLDER]
 *                     [--log FILE [--seconds N]]
 *
 * DATA is bench/papers/leyvand.csv, which says what is measured. Prints Markdown tables: times are processor time, the least of
 * --repeat (3) answers (of the refinement: of one; cold: of a new engine's first) on one core, sets in triangles of their objects and in objects. "Seen" is what --rays (2M)
 * rays from the cell prove; what an answer lacks of it is a miss; with --rays 0 nobody looks and the time to load is short. --effort: of the
 * refinement (0, the default: the library's own; none: no refinement). --only: rows whose table or label contains TEXT, or one of several
 * with commas between;
 * --most: leave out larger generated scenes. --plots writes region-TABLE-time.svg and -size.svg for the sweeps.
 * --log keeps what is measured, row by row, and takes what is in FILE for measured (of a row the last): a study in pieces, each of which
 * begins no new row after --seconds; 0: print what is there. Exit code 1 on a miss, 4 if rows are left. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "compare/svg_dots.h"
#include "io/model.h"
#include "truth/region_truth.h"
#include "umbrage/region.h"

enum { MOST_ROWS = 256, MOST_PLACES = 32, COLUMNS = 14 };

typedef struct place {
    char scene[128], name[32];
    double at[3];
} place;

/* What one answer of the engine costs and holds. */
typedef struct answer {
    double solve_ms, cold_ms, refine_ms;
    uint64_t pvs_triangles, refined_triangles;
    uint32_t mapped, pvs, refined, misses;
} answer;

typedef struct row {
    char table[32], label[32], scene[128], place[32];
    double size, height, outer;
    uint32_t resolution, umbrae;
    int way; /* 1: half-umbra, 2: no vertical */
    char theirs[3][16]; /* seconds, PVS, VS */
    bool done, is_thesis;
    answer ours, thesis; /* thesis: two squares, one interval */
    uint32_t seen;
    uint64_t seen_triangles, met, rays;
} row;

typedef struct study {
    place places[MOST_PLACES];
    row rows[MOST_ROWS];
    uint32_t place_count, row_count;
    const char *only, *plots, *log;
    double started_ms, most_ms; /* when the program began, and how long it may begin new rows */
    uint64_t rays, most;
    uint32_t repeat, effort;
    bool refine;
    umb_error error;
} study;

/* A scene with everything that looks at it. */
typedef struct world {
    model *model;
    umb_scene *scene;
    umb_index *index;
    umb_region *region;
    truth *oracle;
    region_result seen; /* from the last cell */
    umb_region_query cell;
    double load_s;
} world;

static double now_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/* Of this program's threads: other work on the machine does not count. */
static double processor_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/* ---- data ------------------------------------------------------------------------------------ */

static uint32_t split(char *line, char *fields[COLUMNS])
{
    uint32_t count = 0;
    for (char *at = strtok(line, ";\n"); at != NULL && count < COLUMNS; at = strtok(NULL, ";\n")) {
        fields[count++] = at;
    }
    return count;
}

static void copy(char *to, size_t size, const char *from)
{
    (void)snprintf(to, size, "%s", from);
}

static void read_row(char *fields[COLUMNS], row *r)
{
    copy(r->table, sizeof r->table, fields[1]);
    copy(r->label, sizeof r->label, fields[2]);
    copy(r->scene, sizeof r->scene, fields[3]);
    copy(r->place, sizeof r->place, fields[4]);
    r->size = strtod(fields[5], NULL);
    r->height = strtod(fields[6], NULL);
    r->resolution = (uint32_t)strtoul(fields[7], NULL, 10);
    r->umbrae = (uint32_t)strtoul(fields[8], NULL, 10);
    r->outer = strtod(fields[9], NULL);
    r->way = fields[10][0] - '0';
    r->is_thesis = r->table[0] == '3';
    for (int k = 0; k < 3; ++k) {
        copy(r->theirs[k], sizeof r->theirs[k], fields[11 + k]);
    }
}

static bool wanted(const study *s, const row *r)
{
    char text[128];
    const char *at = s->only;
    while (at != NULL) {
        const char *comma = strchr(at, ',');
        (void)snprintf(text, sizeof text, "%.*s", comma != NULL ? (int)(comma - at) : 100, at);
        if (strstr(r->table, text) != NULL || strstr(r->label, text) != NULL) {
            return true;
        }
        at = comma != NULL ? comma + 1 : NULL;
    }
    return s->only == NULL;
}

static bool read_line(study *s, char *line)
{
    char *fields[COLUMNS];
    if (line[0] == '#' || line[0] == '\n') {
        return true;
    }
    uint32_t count = split(line, fields);
    if (count == 6 && strcmp(fields[0], "place") == 0 && s->place_count < MOST_PLACES) {
        place *p = &s->places[s->place_count++];
        copy(p->scene, sizeof p->scene, fields[1]);
        copy(p->name, sizeof p->name, fields[2]);
        for (int k = 0; k < 3; ++k) {
            p->at[k] = strtod(fields[3 + k], NULL);
        }
        return true;
    }
    if (count == COLUMNS && strcmp(fields[0], "row") == 0 && s->row_count < MOST_ROWS) {
        row *r = &s->rows[s->row_count];
        memset(r, 0, sizeof *r);
        read_row(fields, r);
        s->row_count += wanted(s, r);
        return true;
    }
    return false;
}

static bool read_data(study *s, const char *name)
{
    char line[512];
    unsigned number = 0;
    FILE *f = fopen(name, "r");
    bool ok = f != NULL;
    while (ok && fgets(line, sizeof line, f) != NULL) {
        ++number;
        ok = read_line(s, line);
    }
    if (f != NULL) {
        (void)fclose(f);
    }
    if (!ok) {
        (void)snprintf(s->error.text, sizeof s->error.text,
                       "%.180s:%u: cannot be read: its head says what lines hold", name, number);
    }
    return ok;
}

/* ---- measuring ------------------------------------------------------------------------------- */

static void world_free(world *w)
{
    region_result_free(&w->seen);
    umb_region_destroy(w->region);
    umb_index_destroy(w->index);
    umb_scene_destroy(w->scene);
    if (w->oracle != NULL) {
        truth_destroy(w->oracle);
    }
    if (w->model != NULL) {
        model_free(w->model);
    }
    memset(w, 0, sizeof *w);
}

/* False with no error: a real scene that is not there, or a scene that is too large. */
static bool world_load(world *w, study *s, const char *scene)
{
    char name[512];
    const char *folder = getenv("UMBRAGE_SCENES");
    double start = now_ms();
    if (strncmp(scene, "gen:", 4) == 0) {
        copy(name, sizeof name, scene);
    } else if (folder == NULL || folder[0] == '\0') {
        return false;
    } else {
        (void)snprintf(name, sizeof name, "%s/%s", folder, scene);
    }
    w->model = model_load(name, NULL, &s->error);
    if (w->model == NULL || (s->most != 0 && w->model->triangles > s->most)) {
        return false;
    }
    umb_region_def def = {.error = &s->error};
    w->scene = model_scene(w->model, true, (umb_tasks){0}, NULL, &s->error);
    w->oracle = w->scene != NULL && s->rays > 0 ? truth_create(w->model, &s->error) : NULL;
    if (w->scene == NULL || (w->oracle == NULL && s->rays > 0) || umb_index_create(w->scene, NULL, &w->index) != UMB_OK ||
        umb_region_create(w->index, &def, &w->region) != UMB_OK) {
        if (s->error.text[0] == '\0') {
            copy(s->error.text, sizeof s->error.text, "not enough memory");
        }
        return false;
    }
    w->load_s = (now_ms() - start) / 1e3;
    return true;
}

static int up_of(const model *m)
{
    return fabs(m->up[2]) > 0.5 ? 2 : fabs(m->up[1]) > 0.5 ? 1 : 0;
}

static bool make_query(const study *s, const world *w, const row *r, umb_region_query *q)
{
    static const umb_region_up ups[3] = {UMB_UP_X, UMB_UP_Y, UMB_UP_Z};
    int up = up_of(w->model);
    *q = (umb_region_query){.up = r->way == 2 ? UMB_UP_NONE : ups[up],
                            .resolution = r->resolution,
                            .umbrae = r->umbrae,
                            .outer = r->outer,
                            .half_umbra = r->way == 1};
    for (uint32_t k = 0; k < s->place_count; ++k) {
        const place *p = &s->places[k];
        if (strcmp(p->scene, r->scene) != 0 || strcmp(p->name, r->place) != 0) {
            continue;
        }
        for (int i = 0; i < 3; ++i) {
            double at = p->at[i] - w->model->origin[i];
            q->min[i] = i == up ? at : at - 0.5 * r->size;
            q->max[i] = i == up ? at + r->height : at + 0.5 * r->size;
        }
        return true;
    }
    return false;
}

static bool ask(study *s, world *w, const umb_region_query *q, bool refine, answer *out,
                umb_region_answer *a)
{
    umb_region_def def = {.error = &s->error};
    *out = (answer){.solve_ms = INFINITY};
    umb_region_destroy(w->region);
    w->region = NULL;
    umb_result result = umb_region_create(w->index, &def, &w->region);
    for (uint32_t k = 0; result == UMB_OK && k <= s->repeat; ++k) {
        double start = processor_ms();
        result = umb_region_solve(w->region, q, a);
        double ms = processor_ms() - start;
        out->cold_ms = k == 0 ? ms : out->cold_ms; /* grows buffers, finds bodies */
        out->solve_ms = k > 0 ? fmin(out->solve_ms, ms) : out->solve_ms;
    }
    if (result != UMB_OK) {
        return false;
    }
    out->mapped = a->stats.mapped;
    double start = processor_ms();
    if (refine) {
        result = umb_region_refine(w->region, s->effort, a);
    }
    out->refine_ms = processor_ms() - start;
    out->pvs = a->pvs_count;
    out->refined = a->refined_count;
    out->pvs_triangles = a->stats.pvs_triangles;
    out->refined_triangles = a->stats.refined_triangles;
    return result == UMB_OK;
}

static bool same_cell(const umb_region_query *a, const umb_region_query *b)
{
    return memcmp(a->min, b->min, sizeof a->min) == 0 && memcmp(a->max, b->max, sizeof a->max) == 0;
}

/* Rays from the cell; those of the last one if it is the same. */
static bool look(study *s, world *w, const umb_region_query *q, const umb_region_answer *a)
{
    uint32_t objects = w->model->object_count;
    if (w->seen.witness_of != NULL && same_cell(q, &w->cell)) {
        return true;
    }
    region_result_free(&w->seen);
    uint8_t *hidden = malloc((size_t)objects + 1), *shown = calloc((size_t)objects + 1, 1);
    bool ok = hidden != NULL && shown != NULL;
    if (ok) {
        memset(hidden, 1, objects);
        const uint32_t *ids = s->refine ? a->refined : a->pvs;
        for (uint32_t k = 0; k < (s->refine ? a->refined_count : a->pvs_count); ++k) {
            hidden[ids[k]] = 0;
            shown[ids[k]] = 1;
        }
        region_cell cell = {.near_distance = 0.0};
        memcpy(cell.min, q->min, sizeof cell.min);
        memcpy(cell.max, q->max, sizeof cell.max);
        region_options options = {
            .rays = s->rays, .exhaust = true, .accused = hidden, .doubtful = shown};
        ok = region_search(w->oracle, &cell, &options, &w->seen, &s->error);
        w->cell = *q;
    }
    free(hidden);
    free(shown);
    return ok;
}

static bool was_seen(const world *w, uint32_t object)
{
    uint32_t first = w->seen.witness_of != NULL ? w->seen.witness_of[object] : MODEL_NONE;
    return first != MODEL_NONE && w->seen.witnesses[first].confirmed;
}

/* Seen objects that an ascending set lacks. */
static uint32_t misses(const world *w, const uint32_t *ids, uint32_t count)
{
    uint32_t at = 0, lacking = 0;
    for (uint32_t i = 0; i < w->model->object_count; ++i) {
        while (at < count && ids[at] < i) {
            ++at;
        }
        lacking += was_seen(w, i) && (at == count || ids[at] != i);
    }
    return lacking;
}

static bool measure(study *s, world *w, row *r)
{
    umb_region_query q;
    umb_region_answer a;
    if (!make_query(s, w, r, &q)) {
        (void)snprintf(s->error.text, sizeof s->error.text, "%s has no place %s", r->scene,
                       r->place);
        return false;
    }
    if (!ask(s, w, &q, s->refine, &r->ours, &a) || (s->rays > 0 && !look(s, w, &q, &a))) {
        return false;
    }
    r->ours.misses = misses(w, a.pvs, a.pvs_count) + (s->refine ? misses(w, a.refined, a.refined_count) : 0);
    if (r->is_thesis) {
        row thesis = *r;
        thesis.way = r->way == 2 ? 0 : r->way;
        (void)make_query(s, w, &thesis, &q);
        q.outer = 2.0;
        q.umbrae = 1;
        q.maps_only = true;
        if (!ask(s, w, &q, false, &r->thesis, &a)) {
            return false;
        }
        r->thesis.misses = misses(w, a.pvs, a.pvs_count);
    }
    r->seen = w->seen.seen_objects;
    r->met = w->seen.seen_triangles;
    r->rays = w->seen.rays;
    for (uint32_t i = 0; i < w->model->object_count; ++i) {
        const model_object *o = &w->model->objects[i];
        r->seen_triangles += was_seen(w, i) ? w->model->meshes[o->mesh].triangle_count : 0;
    }
    r->done = true;
    (void)fprintf(stderr, "%s %s: %.1f + %.1f ms, pvs %u, refined %u, seen %u, misses %u\n",
                  r->table, r->label, r->ours.solve_ms, r->ours.refine_ms, r->ours.pvs,
                  r->ours.refined, r->seen, r->ours.misses + r->thesis.misses);
    return true;
}

/* ---- a study in pieces ---------------------------------------------------------------------------- */

static void name_row(const row *r, char *out, size_t size)
{
    (void)snprintf(out, size, "%s;%s;%s;%s;%g;%g;%u;%u;%g;%d", r->table, r->label, r->scene, r->place, r->size,
                   r->height, r->resolution, r->umbrae, r->outer, r->way);
}

#define ANSWER_OUT "%.17g %.17g %.17g %" PRIu64 " %" PRIu64 " %u %u %u %u"
#define ANSWER_IN "%lg %lg %lg %" SCNu64 " %" SCNu64 " %u %u %u %u"

static bool keep(study *s, const row *r)
{
    char name[512];
    if (s->log == NULL) {
        return true;
    }
    FILE *f = fopen(s->log, "a");
    if (f == NULL) {
        (void)snprintf(s->error.text, sizeof s->error.text, "%.200s cannot be written", s->log);
        return false;
    }
    name_row(r, name, sizeof name);
    (void)fprintf(f, "%s|%u %" PRIu64 " %" PRIu64 " %" PRIu64, name, r->seen, r->seen_triangles, r->met, r->rays);
    for (int k = 0; k < 2; ++k) {
        const answer *a = k == 0 ? &r->ours : &r->thesis;
        (void)fprintf(f, " " ANSWER_OUT, a->solve_ms, a->cold_ms, a->refine_ms, a->pvs_triangles, a->refined_triangles,
                      a->mapped, a->pvs, a->refined, a->misses);
    }
    (void)fprintf(f, "\n");
    return fclose(f) == 0;
}

static void take_up(study *s, const char *line)
{
    char name[512];
    for (uint32_t i = 0; i < s->row_count; ++i) {
        row *r = &s->rows[i];
        name_row(r, name, sizeof name);
        size_t length = strlen(name);
        if (strncmp(line, name, length) != 0 || line[length] != '|') {
            continue;
        }
        answer *a = &r->ours, *b = &r->thesis;
        r->done = sscanf(line + length + 1, "%u %" SCNu64 " %" SCNu64 " %" SCNu64 " " ANSWER_IN " " ANSWER_IN, &r->seen,
                         &r->seen_triangles, &r->met, &r->rays, &a->solve_ms, &a->cold_ms, &a->refine_ms,
                         &a->pvs_triangles, &a->refined_triangles, &a->mapped, &a->pvs, &a->refined, &a->misses, &b->solve_ms,
                         &b->cold_ms, &b->refine_ms, &b->pvs_triangles, &b->refined_triangles, &b->mapped, &b->pvs, &b->refined,
                         &b->misses) == 22;
    }
}

static void read_log(study *s)
{
    char line[2048];
    FILE *f = s->log != NULL ? fopen(s->log, "r") : NULL;
    while (f != NULL && fgets(line, sizeof line, f) != NULL) {
        take_up(s, line);
    }
    if (f != NULL) {
        (void)fclose(f);
    }
}

static bool is_late(const study *s)
{
    return now_ms() - s->started_ms >= s->most_ms;
}

/* All rows of a scene, one load each. */
static bool measure_all(study *s)
{
    for (uint32_t i = 0; i < s->row_count; ++i) {
        world w = {0};
        bool first = true;
        for (uint32_t k = 0; k < i; ++k) {
            first = first && strcmp(s->rows[k].scene, s->rows[i].scene) != 0;
        }
        bool left = false;
        for (uint32_t k = i; k < s->row_count; ++k) {
            left = left || (strcmp(s->rows[k].scene, s->rows[i].scene) == 0 && !s->rows[k].done);
        }
        if (!first || !left || is_late(s)) {
            continue;
        }
        bool some = false; /* one row at least, or a large scene would be loaded again and again */
        bool ok = world_load(&w, s, s->rows[i].scene), bad = s->error.text[0] != '\0';
        if (ok) {
            (void)fprintf(stderr, "%s: loaded in %.1f s\n", s->rows[i].scene, w.load_s);
        }
        for (uint32_t k = i; ok && k < s->row_count; ++k) {
            row *r = &s->rows[k];
            if (strcmp(r->scene, s->rows[i].scene) != 0 || r->done || (some && is_late(s))) {
                continue;
            }
            some = true;
            ok = measure(s, &w, r) && keep(s, r);
            bad = !ok;
        }
        world_free(&w);
        if (bad) {
            return false;
        }
    }
    return true;
}

/* ---- printing -------------------------------------------------------------------------------- */

static double over(double a, double b)
{
    return b > 0.0 ? a / b : NAN;
}

/* What rays say, where there were any. */
typedef struct said {
    char seen[24], met[24], ratio[24];
} said;

static said said_of(const row *r, uint64_t refined, uint64_t seen)
{
    said t = {"-", "-", "-"};
    if (r->rays != 0) {
        (void)snprintf(t.seen, sizeof t.seen, "%" PRIu64, seen);
        (void)snprintf(t.met, sizeof t.met, "%" PRIu64, r->met);
        (void)snprintf(t.ratio, sizeof t.ratio, "%.2f", over((double)refined, (double)seen));
    }
    return t;
}

static void print_thesis_row(const row *r)
{
    double pvs = strtod(r->theirs[1], NULL), vs = strtod(r->theirs[2], NULL);
    said t = said_of(r, r->ours.refined_triangles, r->seen_triangles);
    printf("| %s | %s | %s | %s | %.2f | %.0f | %" PRIu64 " | %.1f | %.0f | %" PRIu64 " | %" PRIu64
           " | %s | %s | %.2f | %s | %u |\n",
           r->label, r->theirs[0], r->theirs[1], r->theirs[2], over(pvs, vs), r->thesis.solve_ms,
           r->thesis.pvs_triangles, r->ours.solve_ms, r->ours.refine_ms, r->ours.pvs_triangles,
           r->ours.refined_triangles, t.seen, t.met,
           over((double)r->ours.pvs_triangles, (double)r->ours.refined_triangles), t.ratio,
           r->ours.misses + r->thesis.misses);
}

static void print_row(const row *r)
{
    said objects = said_of(r, r->ours.refined, r->seen);
    said triangles = said_of(r, r->ours.refined_triangles, r->seen_triangles);
    printf("| %s | %.1f | %.0f | %.0f | %u | %u | %u | %s | %" PRIu64 " | %" PRIu64 " | %s | %.2f | %s | %.0f | %u |\n",
           r->label, r->ours.solve_ms, r->ours.cold_ms, r->ours.refine_ms, r->ours.mapped, r->ours.pvs, r->ours.refined, objects.seen,
           r->ours.pvs_triangles, r->ours.refined_triangles, triangles.seen,
           over(r->ours.pvs, r->ours.refined), objects.ratio, 1e-6 * (double)r->rays, r->ours.misses + r->thesis.misses);
}

/* Without refinement and rays. */
static void print_maps(const study *s, const char *table)
{
    puts("| | thesis: s | PVS triangles | its mode here: ms | PVS triangles | here: ms | PVS objects | triangles |");
    puts("|---|---|---|---|---|---|---|---|");
    for (uint32_t i = 0; i < s->row_count; ++i) {
        const row *r = &s->rows[i];
        if (!r->done || strcmp(r->table, table) != 0) {
            continue;
        }
        printf("| %s | %s | %s | ", r->label, r->theirs[0], r->theirs[1]);
        if (r->is_thesis) {
            printf("%.0f | %" PRIu64, r->thesis.solve_ms, r->thesis.pvs_triangles);
        } else {
            printf("- | -");
        }
        printf(" | %.1f | %u | %" PRIu64 " |\n", r->ours.solve_ms, r->ours.pvs, r->ours.pvs_triangles);
    }
}

static void print_table(const study *s, const char *table)
{
    printf("\n### %s%s\n\n", table[0] == '3' ? "Table " : "By ", table);
    if (!s->refine && s->rays == 0) {
        print_maps(s, table);
        return;
    }
    if (table[0] == '3') {
        puts("| cell | thesis: s | PVS | VS | PVS/VS | its mode here: ms | PVS | here: ms | refine "
             "ms | PVS | "
             "refined | seen | met | PVS/refined | refined/seen | misses |");
        puts("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
        for (uint32_t i = 0; i < s->row_count; ++i) {
            if (s->rows[i].done && strcmp(s->rows[i].table, table) == 0) {
                print_thesis_row(&s->rows[i]);
            }
        }
        puts("");
    }
    puts("| | ms | cold ms | refine ms | maps' objects | PVS | refined | seen | PVS triangles | refined | seen | "
         "PVS/refined, objects | refined/seen | rays, millions | misses |");
    puts("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for (uint32_t i = 0; i < s->row_count; ++i) {
        if (s->rows[i].done && strcmp(s->rows[i].table, table) == 0) {
            print_row(&s->rows[i]);
        }
    }
}

/* Two plots of a sweep: times, and sizes of sets in objects. */
static bool plot_table(study *s, const char *table)
{
    static const svg_dots_series times[] = {{"PVS", "#1f6feb", false},
                                            {"refinement", "#d9822b", false}};
    static const svg_dots_series sizes[] = {{"seen by a ray", "#1f8a85", false},
                                            {"refined", "#d9822b", false},
                                            {"PVS", "#1f6feb", false}};
    const char *labels[MOST_ROWS];
    svg_dots_dot time_dots[2 * MOST_ROWS], size_dots[3 * MOST_ROWS];
    uint32_t lines = 0;
    for (uint32_t i = 0; i < s->row_count; ++i) {
        const row *r = &s->rows[i];
        if (!r->done || strcmp(r->table, table) != 0) {
            continue;
        }
        labels[lines] = r->label;
        time_dots[2 * lines] = (svg_dots_dot){lines, 0, fmax(r->ours.solve_ms, 1e-3), false};
        time_dots[2 * lines + 1] = (svg_dots_dot){lines, 1, fmax(r->ours.refine_ms, 1e-3), false};
        size_dots[3 * lines] = (svg_dots_dot){lines, 0, fmax(r->seen, 0.5), false};
        size_dots[3 * lines + 1] = (svg_dots_dot){lines, 1, fmax(r->ours.refined, 0.5), false};
        size_dots[3 * lines + 2] = (svg_dots_dot){lines, 2, fmax(r->ours.pvs, 0.5), false};
        ++lines;
    }
    char title[96], name[300];
    svg_dots plot = {title, "ms", labels, lines, times, 2, time_dots, 2 * lines};
    (void)snprintf(title, sizeof title, "One view cell, by %s: milliseconds on one core", table);
    (void)snprintf(name, sizeof name, "%.200s/region-%s-time.svg", s->plots, table);
    if (lines == 0 || !svg_dots_write(&plot, name, &s->error)) {
        return lines == 0;
    }
    plot = (svg_dots){title, "objects", labels, lines, sizes, 3, size_dots, 3 * lines};
    (void)snprintf(title, sizeof title, "One view cell, by %s: objects in the sets", table);
    (void)snprintf(name, sizeof name, "%.200s/region-%s-size.svg", s->plots, table);
    return svg_dots_write(&plot, name, &s->error);
}

static bool print_all(study *s)
{
    for (uint32_t i = 0; i < s->row_count; ++i) {
        bool first = s->rows[i].done;
        for (uint32_t k = 0; k < i; ++k) {
            first = first && !(s->rows[k].done && strcmp(s->rows[k].table, s->rows[i].table) == 0);
        }
        if (!first) {
            continue;
        }
        print_table(s, s->rows[i].table);
        bool sweep = !s->rows[i].is_thesis && strchr(s->rows[i].table, ' ') == NULL;
        if (s->plots != NULL && sweep && !plot_table(s, s->rows[i].table)) {
            return false;
        }
    }
    return true;
}

static uint64_t number_of(const char *text)
{
    char *end;
    double value = strtod(text, &end);
    return (uint64_t)(value * (*end == 'M' ? 1e6 : *end == 'k' ? 1e3 : 1.0));
}

static bool read_settings(int count, char **words, study *s)
{
    s->rays = 2000000;
    s->repeat = 3;
    s->most_ms = INFINITY;
    s->refine = true;
    for (int i = 2; i + 1 < count; i += 2) {
        if (strcmp(words[i], "--only") == 0) {
            s->only = words[i + 1];
        } else if (strcmp(words[i], "--log") == 0) {
            s->log = words[i + 1];
        } else if (strcmp(words[i], "--seconds") == 0) {
            s->most_ms = 1e3 * strtod(words[i + 1], NULL);
        } else if (strcmp(words[i], "--plots") == 0) {
            s->plots = words[i + 1];
        } else if (strcmp(words[i], "--rays") == 0) {
            s->rays = number_of(words[i + 1]);
        } else if (strcmp(words[i], "--effort") == 0) {
            s->refine = strcmp(words[i + 1], "none") != 0;
            s->effort = s->refine ? (uint32_t)number_of(words[i + 1]) : 0;
        } else if (strcmp(words[i], "--most") == 0) {
            s->most = number_of(words[i + 1]);
        } else if (strcmp(words[i], "--repeat") == 0) {
            s->repeat = (uint32_t)number_of(words[i + 1]);
        } else {
            return false;
        }
    }
    return count % 2 == 0 && s->repeat != 0;
}

int main(int count, char **words)
{
    static study s;
    double start = now_ms();
    if (!read_settings(count, words, &s)) {
        (void)fprintf(stderr,
                      "bench_region: the head of bench/bench_region.c says how it is used\n");
        return 2;
    }
    s.started_ms = start;
    bool ok = read_data(&s, words[1]);
    read_log(&s);
    if (!ok || !measure_all(&s) || !print_all(&s)) {
        (void)fprintf(stderr, "bench_region: %s\n", s.error.text);
        return 3;
    }
    uint32_t missed = 0, left = 0;
    uint64_t rays = 0;
    for (uint32_t i = 0; i < s.row_count; ++i) {
        left += !s.rows[i].done;
        rays += s.rows[i].rays;
        missed += s.rows[i].ours.misses + s.rows[i].thesis.misses;
    }
    printf("\n%u misses in %" PRIu64 " rays; this run took %.0f seconds, rows left: %u.\n", missed, rays, (now_ms() - start) / 1e3, left);
    return missed != 0 ? 1 : s.log != NULL && left != 0 ? 4 : 0;
}

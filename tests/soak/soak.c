/* soak: zero wrongly hidden, over many views.
 *
 *   soak [--short] [--out FOLDER] [--threads N] [--scale X] [--only TEXT] [--without TEXT] [--views N]
 *        [--rays N] [--plant 1|2] [--part NAME --view K]
 *
 * Prints the tables of docs/results/soak.md: views, then view cells. What is done is kept in FOLDER (out/soak), a file for
 * each part of the plan, and taken up by the next run of the same program over the same scenes.
 * --only: parts whose name or family contains TEXT. --without: but not those whose name contains it. --views: of each part
 * no more than N new ones. --rays: of each view cell but those of micro scenes.
 * --plant: cull a scene with a planted mistake (1: objects too small, 2: occluders too large),
 * which must be found. --part --view: one view alone, told in full. FOLDER/wrongly-hidden.txt and
 * unconfirmed.txt name objects with their lines.
 *
 * Exit codes: 0 nothing wrongly hidden; 1 something was; 2 wrong usage; 3 something cannot be read or
 * written; 4 interrupted or stopped by --views, what is done is saved. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <xxhash.h>

#include "io/input.h"
#include "soak.h"

enum { DONE = 0, WRONG = 1, USAGE = 2, INPUT = 3, STOPPED = 4 };

typedef struct settings {
    bool full;
    const char *out, *only, *without, *part;
    uint32_t threads, most_batches;
    double scale;
    plant planted;
    uint64_t view, rays;
} settings;

static volatile sig_atomic_t stop;

static void on_signal(int number)
{
    (void)number;
    stop = 1;
}

static bool read_settings(int count, char **words, settings *s)
{
    *s = (settings){.full = true,
                    .out = "out/soak",
                    .only = "",
                    .threads = 2,
                    .most_batches = UINT32_MAX,
                    .scale = 1.0};
    for (int i = 1; i < count; ++i) {
        const char *word = words[i], *value = i + 1 < count ? words[i + 1] : NULL;
        if (strcmp(word, "--short") == 0) {
            s->full = false;
            continue;
        }
        if (value == NULL) {
            return false;
        }
        ++i;
        if (strcmp(word, "--out") == 0) {
            s->out = value;
        } else if (strcmp(word, "--only") == 0) {
            s->only = value;
        } else if (strcmp(word, "--without") == 0) {
            s->without = value;
        } else if (strcmp(word, "--part") == 0) {
            s->part = value;
        } else if (strcmp(word, "--view") == 0) {
            s->view = strtoull(value, NULL, 10);
        } else if (strcmp(word, "--rays") == 0) {
            s->rays = strtoull(value, NULL, 10);
        } else if (strcmp(word, "--threads") == 0) {
            s->threads = (uint32_t)strtoul(value, NULL, 10);
        } else if (strcmp(word, "--views") == 0) {
            s->most_batches = ((uint32_t)strtoul(value, NULL, 10) + SOAK_BATCH - 1) / SOAK_BATCH;
        } else if (strcmp(word, "--scale") == 0) {
            s->scale = strtod(value, NULL);
        } else if (strcmp(word, "--plant") == 0) {
            s->planted = (plant)strtoul(value, NULL, 10);
        } else {
            return false;
        }
    }
    return s->threads > 0 && s->scale > 0.0 && s->planted < PLANT_COUNT;
}

/* What an answer depends on: this very program, the scene's bytes, the part's settings. */
static bool key_of(const soak_part *part, plant planted, uint64_t program, uint64_t *out,
                   umb_error *error)
{
    char text[1024];
    XXH3_state_t *state = XXH3_createState();
    if (state == NULL) {
        return false;
    }
    (void)XXH3_64bits_reset(state);
    (void)snprintf(text, sizeof text, "%016" PRIx64 " %s %d %u %u %" PRIu64 " %.17g %d %d", program,
                   part->scene, (int)part->style, part->most_targets, part->most_decided,
                   part->rays, part->shift, part->weld, (int)planted);
    (void)XXH3_64bits_update(state, text, strlen(text));
    bool ok = true;
    if (part->scene[0] == '/' || part->scene[0] == '.') {
        input bytes;
        ok = input_read(part->scene, &bytes, error);
        if (ok) {
            (void)XXH3_64bits_update(state, bytes.data, bytes.size);
            input_free(&bytes);
        }
    }
    *out = XXH3_64bits_digest(state);
    (void)XXH3_freeState(state);
    return ok;
}

static bool program_hash(const char *name, uint64_t *out, umb_error *error)
{
    input bytes;
    if (!input_read("/proc/self/exe", &bytes, error) && !input_read(name, &bytes, error)) {
        return false;
    }
    *out = XXH3_64bits(bytes.data, bytes.size);
    input_free(&bytes);
    return true;
}

static void print_row(const char *scene, const char *views, const soak_count *c)
{
    double ratio = c->seen != 0 ? (double)c->reported / (double)c->seen : 0.0;
    printf("| %s | %s | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %.3f | %" PRIu64
           " | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %.0f | %.3g |\n",
           scene, views, c->views, c->pairs, c->seen, c->reported, ratio, c->wrong, c->unconfirmed,
           c->proven, c->open, c->seconds, c->seconds > 0.0 ? (double)c->pairs / c->seconds : 0.0);
}

static const char *style_name(soak_style style)
{
    static const char *const names[] = {"ordinary", "adversarial", "adversarial", "cells", "cells"};
    return names[style];
}

static bool of_cells(const soak_part *part)
{
    return part->style == SOAK_CELLS || part->style == SOAK_MICRO_CELLS;
}

static void print_cell_row(const char *name, const soak_count *c)
{
    double seen = c->seen != 0 ? (double)c->seen : 1.0;
    printf("| %s | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %" PRIu64
           " | %.3f | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %.0f |\n",
           name, c->views, c->rays, c->pairs, c->seen, c->reported, c->proven,
           (double)c->reported / seen, c->open, c->wrong, c->unconfirmed, c->seconds);
}

/* Over all cells. */
static void print_kinds(const soak_count *all)
{
    puts("\n| kind of cell | cells | rays | pairs of a cell and a hidden object | wrongly hidden |");
    puts("|---|---|---|---|---|");
    for (uint32_t k = 0; k < SOAK_KINDS; ++k) {
        const soak_kind *kind = &all->kinds[k];
        printf("| %s | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " | %" PRIu64 " |\n", soak_cell_kind(k), kind->cells, kind->rays,
               kind->hidden, kind->wrong);
    }
}

static void print_cells(const soak_plan *plan, const soak_count *counts)
{
    soak_count all = {0};
    puts("\n| scene | cells | rays | cell-object pairs | seen | refined | before refinement | "
         "refined "
         "over seen | undecided | wrongly hidden | unconfirmed | processor seconds |");
    puts("|---|---|---|---|---|---|---|---|---|---|---|---|");
    for (uint32_t k = 0; k < plan->count; ++k) {
        if (of_cells(&plan->parts[k]) && counts[k].views != 0) {
            print_cell_row(plan->parts[k].name, &counts[k]);
            soak_count_add(&all, &counts[k]);
        }
    }
    print_cell_row("**all cells**", &all);
    print_kinds(&all);
}

static void print_table(const soak_plan *plan, const soak_count *counts)
{
    soak_count all = {0}, outside = {0}, adversarial = {0};
    puts("| scene | views | | object-view pairs | seen | reported | conservativity | wrongly "
         "hidden | "
         "unconfirmed | proven hidden | undecided | processor seconds | pairs a second |");
    puts("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for (uint32_t k = 0; k < plan->count; ++k) {
        const soak_part *part = &plan->parts[k];
        if (of_cells(part)) {
            continue;
        }
        soak_count_add(&all, &counts[k]);
        if (strcmp(part->family, "blocks") != 0) {
            soak_count_add(&outside, &counts[k]);
        }
        if (part->style != SOAK_ORDINARY) {
            soak_count_add(&adversarial, &counts[k]);
        }
        if (counts[k].views != 0) {
            print_row(part->name, style_name(part->style), &counts[k]);
        }
    }
    print_row("**all**", "", &all);
    print_row("all but blocks", "", &outside);
    print_row("all adversarial", "", &adversarial);
    print_cells(plan, counts);
}

typedef struct soak_state {
    const settings *s;
    soak_scene scene;
    uint64_t program;
    bool unfinished;
} soak_state;

static bool same_scene(const soak_scene *s, const soak_part *part)
{
    return strcmp(s->scene, part->scene) == 0 && s->shift == part->shift && s->weld == part->weld;
}

static bool all_done(const soak_log *log)
{
    for (uint32_t k = 0; k < log->batches; ++k) {
        if (log->done[k] == 0) {
            return false;
        }
    }
    return true;
}

static bool run_part(soak_state *st, const soak_part *part, soak_count *count, umb_error *error)
{
    uint64_t key;
    soak_log log;
    if (!key_of(part, st->s->planted, st->program, &key, error) ||
        !soak_log_open(&log, st->s->out, part, key, error)) {
        return false;
    }
    bool ok = true;
    if (!all_done(&log) && !stop && st->s->most_batches > 0) {
        if (!same_scene(&st->scene, part)) {
            (void)fprintf(stderr, "%s: loading %s\n", part->name, part->scene);
            soak_scene_free(&st->scene);
            ok = soak_scene_load(part, st->s->planted, &st->scene, error);
        }
        soak_run run = {.part = part,
                        .scene = &st->scene,
                        .log = &log,
                        .folder = st->s->out,
                        .threads = st->s->threads,
                        .most_batches = st->s->most_batches,
                        .stop = &stop};
        ok = ok && (st->s->part != NULL ? soak_run_view(&run, st->s->view, error)
                                        : soak_run_part(&run, error));
    }
    st->unfinished = st->unfinished || !all_done(&log);
    *count = log.sum;
    soak_log_close(&log);
    return ok;
}

static bool wanted(const settings *s, const soak_part *part)
{
    if (s->part != NULL) {
        return strcmp(s->part, part->name) == 0;
    }
    if (s->without != NULL && strstr(part->name, s->without) != NULL) {
        return false;
    }
    return strstr(part->name, s->only) != NULL || strstr(part->family, s->only) != NULL;
}

static int run_plan(const settings *s, const soak_plan *plan, const char *program)
{
    umb_error error = {0};
    soak_state st = {.s = s};
    soak_count *counts = calloc((size_t)plan->count + 1, sizeof *counts);
    bool ok = counts != NULL && program_hash(program, &st.program, &error);
    for (uint32_t k = 0; ok && k < plan->count; ++k) {
        if (wanted(s, &plan->parts[k])) {
            ok = run_part(&st, &plan->parts[k], &counts[k], &error);
        }
    }
    soak_scene_free(&st.scene);
    uint64_t wrong = 0;
    for (uint32_t k = 0; ok && k < plan->count; ++k) {
        wrong += counts[k].wrong;
    }
    if (ok && s->part == NULL) {
        print_table(plan, counts);
    }
    free(counts);
    if (!ok) {
        (void)fprintf(stderr, "soak: %s\n", error.text);
        return INPUT;
    }
    return wrong != 0 ? WRONG : st.unfinished && s->part == NULL ? STOPPED : DONE;
}

int main(int count, char **words)
{
    settings s;
    soak_plan plan;
    umb_error error = {0};
    if (!read_settings(count, words, &s)) {
        (void)fprintf(stderr, "soak: what is asked for is no option, or lacks a value: "
                              "see the head of tests/soak/soak.c\n");
        return USAGE;
    }
    (void)mkdir(s.out, 0777);
    (void)signal(SIGINT, on_signal);
    (void)signal(SIGTERM, on_signal);
    if (!soak_plan_make(s.full, s.scale, &plan, &error)) {
        (void)fprintf(stderr, "soak: %s\n", error.text);
        return INPUT;
    }
    for (uint32_t k = 0; s.rays != 0 && k < plan.count; ++k) {
        plan.parts[k].rays = plan.parts[k].style == SOAK_CELLS ? s.rays : plan.parts[k].rays;
    }
    int code = run_plan(&s, &plan, words[0]);
    soak_plan_free(&plan);
    return code;
}

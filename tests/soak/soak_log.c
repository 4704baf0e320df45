#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "soak.h"

void soak_count_add(soak_count *sum, const soak_count *c)
{
    sum->views += c->views;
    sum->pairs += c->pairs;
    sum->seen += c->seen;
    sum->reported += c->reported;
    sum->wrong += c->wrong;
    sum->unconfirmed += c->unconfirmed;
    sum->rays += c->rays;
    sum->proven += c->proven;
    sum->open += c->open;
    sum->seconds += c->seconds;
    for (uint32_t k = 0; k < SOAK_KINDS; ++k) {
        sum->kinds[k].cells += c->kinds[k].cells;
        sum->kinds[k].rays += c->kinds[k].rays;
        sum->kinds[k].hidden += c->kinds[k].hidden;
        sum->kinds[k].wrong += c->kinds[k].wrong;
    }
}

/* Of every kind four numbers, then a full stop. */
static bool read_kinds(const char *text, soak_count *c)
{
    int end = 0;
    for (uint32_t k = 0; k < SOAK_KINDS; ++k) {
        soak_kind *kind = &c->kinds[k];
        if (sscanf(text, " %" SCNu64 ",%" SCNu64 ",%" SCNu64 ",%" SCNu64 "%n", &kind->cells, &kind->rays, &kind->hidden, &kind->wrong,
                   &end) != 4) {
            return false;
        }
        text += end;
    }
    return strcmp(text, " .\n") == 0;
}

static bool write_kinds(FILE *f, const soak_count *c)
{
    bool ok = true;
    for (uint32_t k = 0; k < SOAK_KINDS; ++k) {
        const soak_kind *kind = &c->kinds[k];
        ok = ok && fprintf(f, " %" PRIu64 ",%" PRIu64 ",%" PRIu64 ",%" PRIu64, kind->cells, kind->rays, kind->hidden, kind->wrong) > 0;
    }
    return fprintf(f, " .\n") > 0 && ok;
}

/* Lines that were cut off by an interruption count for nothing. */
static void take_up(soak_log *log, FILE *f)
{
    char line[1024];
    while (fgets(line, sizeof line, f) != NULL) {
        uint32_t batch;
        int end = 0;
        soak_count c;
        int fields = sscanf(line,
                            "batch %" SCNu32 " views %" SCNu64 " pairs %" SCNu64 " seen %" SCNu64
                            " reported %" SCNu64 " wrong %" SCNu64 " unconfirmed %" SCNu64
                            " rays %" SCNu64 " proven %" SCNu64 " open %" SCNu64 " seconds %lf kinds%n",
                            &batch, &c.views, &c.pairs, &c.seen, &c.reported, &c.wrong,
                            &c.unconfirmed, &c.rays, &c.proven, &c.open, &c.seconds, &end);
        if (fields == 11 && end > 0 && read_kinds(line + end, &c) && batch < log->batches && log->done[batch] == 0) {
            log->done[batch] = 1;
            soak_count_add(&log->sum, &c);
        }
    }
}

bool soak_log_open(soak_log *log, const char *folder, const soak_part *part, uint64_t key,
                   umb_error *error)
{
    memset(log, 0, sizeof *log);
    log->batches = (part->views + SOAK_BATCH - 1) / SOAK_BATCH;
    log->done = calloc((size_t)log->batches + 1, 1);
    (void)snprintf(log->file, sizeof log->file, "%.1000s/%s-%016" PRIx64 ".log", folder, part->name,
                   key);
    FILE *f = fopen(log->file, "a+");
    if (f == NULL || log->done == NULL) {
        error->code = UMB_ERROR_ARGUMENT;
        (void)snprintf(error->text, sizeof error->text,
                       "%.180s: cannot be written; choose another folder with --out", log->file);
        if (f != NULL) {
            (void)fclose(f);
        }
        soak_log_close(log);
        return false;
    }
    rewind(f);
    take_up(log, f);
    (void)fclose(f);
    return true;
}

bool soak_log_add(soak_log *log, uint32_t batch, const soak_count *c)
{
    FILE *f = fopen(log->file, "a");
    bool ok = f != NULL;
    ok = ok && fprintf(f,
                       "\nbatch %" PRIu32 " views %" PRIu64 " pairs %" PRIu64 " seen %" PRIu64
                       " reported %" PRIu64 " wrong %" PRIu64 " unconfirmed %" PRIu64
                       " rays %" PRIu64 " proven %" PRIu64 " open %" PRIu64 " seconds %.3f kinds",
                       batch, c->views, c->pairs, c->seen, c->reported, c->wrong, c->unconfirmed,
                       c->rays, c->proven, c->open, c->seconds) > 0 &&
         write_kinds(f, c);
    ok = (f == NULL || fclose(f) == 0) && ok;
    log->done[batch] = 1;
    soak_count_add(&log->sum, c);
    return ok;
}

void soak_log_close(soak_log *log)
{
    free(log->done);
    log->done = NULL;
}

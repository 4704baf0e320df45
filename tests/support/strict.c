#include "strict.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Wrongly hidden objects that one answer prints in full. */
#define MAX_PRINTED 20

static void report(const char *label, const char *what, uint32_t id, const truth_witness *w)
{
    printf("# %s: %s object %u, seen from %.17g,%.17g,%.17g at %.17g,%.17g,%.17g\n", what, label,
           id, w->from[0], w->from[1], w->from[2], w->to[0], w->to[1], w->to[2]);
}

static void judge(const truth_result *r, const uint8_t *shown, uint32_t objects,
                  const strict_answer *a)
{
    uint32_t printed = 0;
    for (uint32_t i = 0; i < objects; ++i) {
        if (shown[i] != 0) {
            continue;
        }
        const truth_witness *both[2] = {&r->culling[i], &r->two_sided[i]};
        const truth_witness *seen = NULL, *confirmed = NULL;
        for (int k = 0; k < 2; ++k) {
            if (both[k]->renderers != 0) {
                seen = both[k];
                confirmed = both[k]->confirmed != 0 ? both[k] : confirmed;
            }
        }
        if (confirmed != NULL && a->label != NULL && printed++ < MAX_PRINTED) {
            report(a->label, "wrongly hidden", i, confirmed);
        }
        if (seen != NULL && confirmed == NULL && a->label != NULL &&
            getenv("UMBRAGE_PRINT_UNCONFIRMED") != NULL) {
            report(a->label, "unconfirmed", i, seen);
        }
        a->sum->wrongly_hidden += confirmed != NULL;
        a->sum->unconfirmed += seen != NULL && confirmed == NULL;
    }
}

static void mark(const strict_answer *a, uint32_t objects, uint8_t *shown)
{
    memset(shown, 0, objects);
    for (uint32_t i = 0; i < a->count; ++i) {
        shown[a->ids[i]] = 1;
    }
}

bool strict_check_all(truth *t, const model *m, const umb_view *view, const strict_answer *answers,
                      uint32_t answer_count, const truth_options *options)
{
    uint32_t objects = m->object_count;
    uint8_t *shown = malloc(objects + 1), *accused = calloc(objects + 1, 1);
    bool ok = shown != NULL && accused != NULL;
    for (uint32_t k = 0; ok && k < answer_count; ++k) {
        mark(&answers[k], objects, shown);
        for (uint32_t i = 0; i < objects; ++i) {
            accused[i] |= shown[i] == 0;
        }
    }
    truth_options with = *options;
    with.accused = accused;
    truth_result result;
    umb_error error = {0};
    ok = ok && truth_view(t, view, &with, &result, &error);
    if (!ok) {
        printf("# oracle: %s: %s\n", answers[0].label != NULL ? answers[0].label : "-", error.text);
    }
    for (uint32_t k = 0; ok && k < answer_count; ++k) {
        strict_count *sum = answers[k].sum;
        mark(&answers[k], objects, shown);
        judge(&result, shown, objects, &answers[k]);
        sum->views += 1;
        sum->objects += objects;
        sum->reported += answers[k].count;
        sum->truth_visible += result.visible;
        sum->rays += result.rays;
    }
    if (ok) {
        truth_result_free(&result);
    }
    free(shown);
    free(accused);
    return ok;
}

bool strict_check(truth *t, const model *m, const umb_view *view, const uint32_t *ids,
                  uint32_t count, const truth_options *options, const char *label, strict_count *sum)
{
    strict_answer answer = {ids, count, label, sum};
    return strict_check_all(t, m, view, &answer, 1, options);
}

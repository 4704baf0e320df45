#include "strict.h"

#include <stdio.h>
#include <stdlib.h>

static void report(const char *label, uint32_t id, const truth_witness *w)
{
    printf("# wrongly hidden: %s object %u, seen from %.17g,%.17g,%.17g at %.17g,%.17g,%.17g\n", label, id,
           w->from[0], w->from[1], w->from[2], w->to[0], w->to[1], w->to[2]);
}

static void judge(const truth_result *r, const uint8_t *hidden, uint32_t objects, const char *label,
                  strict_count *sum)
{
    for (uint32_t i = 0; i < objects; ++i) {
        if (hidden[i] == 0) {
            continue;
        }
        const truth_witness *both[2] = {&r->culling[i], &r->two_sided[i]};
        bool seen = false, confirmed = false;
        for (int k = 0; k < 2; ++k) {
            seen |= both[k]->renderers != 0;
            if (both[k]->renderers != 0 && both[k]->confirmed != 0 && !confirmed) {
                confirmed = true;
                report(label, i, both[k]);
            }
        }
        sum->wrongly_hidden += confirmed;
        sum->unconfirmed += seen && !confirmed;
    }
}

bool strict_check(truth *t, const model *m, const umb_view *view, const uint32_t *ids, uint32_t count,
                  const truth_options *options, const char *label, strict_count *sum)
{
    uint8_t *hidden = malloc(m->object_count + 1);
    if (hidden == NULL) {
        return false;
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        hidden[i] = 1;
    }
    for (uint32_t i = 0; i < count; ++i) {
        hidden[ids[i]] = 0;
    }
    truth_options with = *options;
    with.accused = hidden;
    truth_result result;
    umb_error error;
    bool ok = truth_view(t, view, &with, &result, &error);
    if (ok) {
        judge(&result, hidden, m->object_count, label, sum);
        sum->views += 1;
        sum->objects += m->object_count;
        sum->reported += count;
        sum->truth_visible += result.visible;
        sum->rays += result.rays;
        truth_result_free(&result);
    } else {
        printf("# oracle: %s: %s\n", label, error.text);
    }
    free(hidden);
    return ok;
}

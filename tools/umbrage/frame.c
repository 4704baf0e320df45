#include "frame.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

#include "moving.h"
#include "progress.h"

static int compare_ids(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

bool frame_hash(const uint32_t *ids, uint32_t count, uint64_t *out)
{
    uint32_t *sorted = malloc(((size_t)count + 1) * sizeof *sorted);
    if (!sorted) {
        return false;
    }
    for (uint32_t i = 0; i < count; ++i) {
        sorted[i] = ids[i];
    }
    qsort(sorted, count, sizeof *sorted, compare_ids);
    unsigned char *bytes = (unsigned char *)sorted;
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t id = sorted[i];
        for (int b = 0; b < 4; ++b) {
            bytes[(size_t)i * 4 + (size_t)b] = (unsigned char)(id >> (8 * b));
        }
    }
    *out = XXH3_64bits(bytes, (size_t)count * 4);
    free(sorted);
    return true;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return x < y ? -1 : x > y;
}

double frame_median(double *values, uint32_t count)
{
    if (count == 0) {
        return 0.0;
    }
    qsort(values, count, sizeof *values, compare_doubles);
    return (values[(count - 1) / 2] + values[count / 2]) * 0.5;
}

static int answer_failure(const setup *s, const options *o, umb_result result)
{
    return fail(o, result == UMB_ERROR_ARGUMENT ? EXIT_USAGE : EXIT_INPUT, "%s",
                s->error.text[0] ? s->error.text : umb_result_name(result));
}

int frame_answer(const setup *s, const options *o, const umb_view *view, bool with_ids, frame *out,
                 umb_visible_set *set)
{
    umb_visible_set seen;
    memset(out, 0, sizeof *out);
    double start = progress_clock();
    umb_result result = s->moving ? moving_advance(s, view) : UMB_OK;
    result = result == UMB_OK ? umb_cull(s->culler, view, &seen) : result;
    out->time_ms = nearbyint((progress_clock() - start) * 1e6) / 1e6; /* the clock's nanoseconds */
    if (result != UMB_OK) {
        return answer_failure(s, o, result);
    }
    out->method = o->method;
    out->class_ = seen.class_;
    out->index = o->index;
    out->objects = s->model->object_count;
    out->stats = seen.stats;
    out->stats.visible = seen.count;
    if (with_ids) {
        out->ids = malloc(((size_t)seen.count + 1) * sizeof *out->ids);
        if (!out->ids) {
            return fail(o, EXIT_INPUT, "not enough memory");
        }
        for (uint32_t i = 0; i < seen.count; ++i) {
            out->ids[i] = seen.objects[i];
        }
    }
    if (set) {
        *set = seen;
    }
    return frame_hash(seen.objects, seen.count, &out->hash)
               ? EXIT_DONE
               : fail(o, EXIT_INPUT, "not enough memory");
}

int frame_count_in_frustum(const setup *s, const options *o, const umb_view *view, uint32_t *out)
{
    umb_visible_set seen;
    umb_view whole = *view;
    whole.min_pixels = 0.0;
    umb_result result = umb_cull(s->frustum, &whole, &seen);
    *out = seen.count;
    return result == UMB_OK ? EXIT_DONE : answer_failure(s, o, result);
}

void frame_free(frame *f)
{
    free(f->ids);
    f->ids = NULL;
}

void frame_json(const frame *f, json_text *j)
{
    char hash[20];
    snprintf(hash, sizeof hash, "%016llx", (unsigned long long)f->hash);
    json_text_string(j, "method", umb_method_name(f->method));
    json_text_string(j, "class", umb_class_name(f->class_));
    json_text_string(j, "index", umb_index_name(&f->index));
    json_text_string(j, "update", umb_index_update_name(f->index.update));
    json_text_count(j, "objects", f->objects);
    json_text_count(j, "in_frustum", f->in_frustum);
    json_text_count(j, "visible", f->stats.visible);
    json_text_count(j, "occluders", f->stats.occluders);
    json_text_number(j, "time_ms", f->time_ms);
    json_text_string(j, "hash", hash);
    json_text_open(j, "stats", '{');
    json_text_count(j, "nodes", f->stats.nodes);
    json_text_count(j, "boxes", f->stats.boxes);
    json_text_count(j, "queries", f->stats.queries);
    json_text_count(j, "hidden_nodes", f->stats.hidden_nodes);
    json_text_count(j, "hidden_objects", f->stats.hidden_objects);
    json_text_count(j, "edges", f->stats.edges);
    json_text_count(j, "small", f->stats.small);
    json_text_count(j, "idle", f->stats.idle);
    json_text_count(j, "early", f->stats.early);
    json_text_count(j, "saved", f->stats.saved);
    json_text_count(j, "resting", f->stats.resting);
    json_text_count(j, "over_budget", f->stats.over_budget);
    json_text_count(j, "poses", f->stats.poses);
    json_text_count(j, "expired", f->stats.expired);
    json_text_count(j, "strays", f->stats.strays);
    json_text_count(j, "hidden_movers", f->stats.hidden_movers);
    json_text_close(j, '}');
    if (f->ids) {
        json_text_ids(j, "ids", f->ids, f->stats.visible);
    }
}

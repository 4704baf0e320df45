/* umbrage walk: the visible set along a path. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "frame.h"
#include "progress.h"
#include "part_file.h"

typedef struct walk {
    frame *frames;
    uint32_t count;
    double median_ms, p99_ms, visible_mean, in_frustum_mean;
} walk;

/* Two passes, so that what is counted outside the timing does not cool the caches of what is
 * timed. */
static int answer_all(const setup *s, const options *o, const views *v, walk *w)
{
    int code = EXIT_DONE;
    progress p = progress_begin(o, "frames", 2 * v->count);
    for (uint32_t k = 0; code == EXIT_DONE && k < v->count; ++k) {
        umb_view view = setup_view(s, o, v, k);
        code = frame_answer(s, o, &view, options_given(o, "list"), &w->frames[k], NULL);
        w->frames[k].row = setup_row(v, k);
        progress_step(&p, k + 1);
    }
    for (uint32_t k = 0; code == EXIT_DONE && k < v->count; ++k) {
        umb_view view = setup_view(s, o, v, k);
        code = frame_count_in_frustum(s, o, &view, &w->frames[k].in_frustum);
        progress_step(&p, v->count + k + 1);
    }
    progress_end(&p);
    return code;
}

/* p99: the smallest time that at least 99 % of the frames do not exceed. */
static int summarize(const options *o, walk *w)
{
    double *times = malloc(w->count * sizeof *times);
    if (!times) {
        return fail(o, EXIT_INPUT, "not enough memory");
    }
    double visible = 0.0, in_frustum = 0.0;
    for (uint32_t k = 0; k < w->count; ++k) {
        times[k] = w->frames[k].time_ms;
        visible += w->frames[k].stats.visible;
        in_frustum += w->frames[k].in_frustum;
    }
    w->median_ms = frame_median(times, w->count); /* sorts */
    w->p99_ms = times[(uint32_t)ceil(w->count * 0.99) - 1];
    w->visible_mean = visible / w->count;
    w->in_frustum_mean = in_frustum / w->count;
    free(times);
    return EXIT_DONE;
}

static int print_json(const walk *w, const options *o)
{
    json_text j = {0};
    json_text_open(&j, NULL, '{');
    json_text_open(&j, "summary", '{');
    json_text_count(&j, "frames", w->count);
    json_text_number(&j, "median_ms", w->median_ms);
    json_text_number(&j, "p99_ms", w->p99_ms);
    json_text_number(&j, "visible_mean", w->visible_mean);
    json_text_number(&j, "in_frustum_mean", w->in_frustum_mean);
    json_text_close(&j, '}');
    json_text_open(&j, "frames", '[');
    for (uint32_t k = 0; k < w->count; ++k) {
        json_text_open(&j, NULL, '{');
        json_text_count(&j, "row", w->frames[k].row);
        frame_json(&w->frames[k], &j);
        json_text_close(&j, '}');
    }
    json_text_close(&j, ']');
    json_text_close(&j, '}');
    return part_file_print(o, &j);
}

/* About twenty rows, the first and the last among them. */
static int print_text(const walk *w, const options *o)
{
    const frame *f = w->frames;
    uint32_t step = options_given(o, "list") ? 1 : (w->count + 19) / 20;
    printf("%s (%s), index %s, %u objects\n\n", umb_method_name(f->method),
           umb_class_name(f->class_), umb_index_name(&f->index), f->objects);
    printf("%6s %10s %10s %10s %10s  %s\n", "row", "in frustum", "visible", "occluders", "ms",
           "hash");
    for (uint32_t k = 0; k < w->count; ++k) {
        if (k % step != 0 && k + 1 != w->count) {
            continue;
        }
        f = &w->frames[k];
        printf("%6u %10u %10u %10u %10.3f  %016llx\n", f->row, f->in_frustum, f->stats.visible,
               f->stats.occluders, f->time_ms, (unsigned long long)f->hash);
        for (uint32_t i = 0; f->ids && i < f->stats.visible; ++i) {
            printf("%s%u%s", i == 0 ? "       " : " ", f->ids[i],
                   i + 1 == f->stats.visible ? "\n" : "");
        }
    }
    printf("\n%u frames: median %.3f ms, p99 %.3f ms, mean visible %.1f of %.1f in the frustum\n",
           w->count, w->median_ms, w->p99_ms, w->visible_mean, w->in_frustum_mean);
    return EXIT_DONE;
}

int cmd_walk(const options *o)
{
    setup s = {0};
    views v = {0};
    walk w = {0};
    if (!o->path) {
        return fail(o, EXIT_USAGE, "needs a path: --path FILE or --path gen:NAME,key=value");
    }
    int code = setup_views(&s, o, false, &v);
    if (code == EXIT_DONE) {
        w.count = v.count;
        w.frames = calloc(v.count, sizeof *w.frames);
        code = w.frames ? answer_all(&s, o, &v, &w) : fail(o, EXIT_INPUT, "not enough memory");
    }
    if (code == EXIT_DONE) {
        code = summarize(o, &w);
    }
    if (code == EXIT_DONE) {
        code = options_given(o, "json") ? print_json(&w, o) : print_text(&w, o);
    }
    for (uint32_t k = 0; w.frames && k < w.count; ++k) {
        frame_free(&w.frames[k]);
    }
    free(w.frames);
    camera_path_free(&v.path);
    setup_free(&s);
    return code;
}

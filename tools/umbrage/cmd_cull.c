/* umbrage cull: the visible set of one view. */
#include <stdio.h>
#include <stdlib.h>

#include "frame.h"
#include "part_file.h"
#include "progress.h"

/* The time is the median of --repeat answers after one that warms caches and grows buffers. */
static int time_answers(const setup *s, const options *o, const umb_view *view, frame *f)
{
    double *times = malloc(o->repeat * sizeof *times);
    if (!times) {
        return fail(o, EXIT_INPUT, "not enough memory");
    }
    progress p = progress_begin(o, "answers", o->repeat);
    int code = frame_answer(s, o, view, options_given(o, "list"), f, NULL);
    for (uint32_t i = 0; code == EXIT_DONE && i < o->repeat; ++i) {
        frame again;
        code = frame_answer(s, o, view, false, &again, NULL);
        times[i] = again.time_ms;
        progress_step(&p, i + 1);
    }
    progress_end(&p);
    f->time_ms = code == EXIT_DONE ? frame_median(times, o->repeat) : 0.0;
    free(times);
    return code;
}

static int save_capture(const setup *s, const options *o)
{
    size_t size = 0;
    umb_result result = umb_capture_save(s->culler, NULL, 0, &size);
    void *bytes = result == UMB_OK ? malloc(size) : NULL;
    if (bytes) {
        result = umb_capture_save(s->culler, bytes, size, &size);
    }
    int code = bytes && result == UMB_OK
                   ? part_file_write(o, o->capture, bytes, size)
                   : fail(o, EXIT_INPUT, "%s: the frame cannot be captured: %s", o->capture,
                          umb_result_name(result == UMB_OK ? UMB_ERROR_MEMORY : result));
    free(bytes);
    return code;
}

static int print_json(const frame *f, const options *o)
{
    json_text j = {0};
    json_text_open(&j, NULL, '{');
    frame_json(f, &j);
    json_text_close(&j, '}');
    return part_file_print(o, &j);
}

static int print_text(const frame *f)
{
    printf("%-12s %s (%s), index %s\n", "method", umb_method_name(f->method),
           umb_class_name(f->class_), umb_index_name(&f->index));
    printf("%-12s %u\n", "objects", f->objects);
    printf("%-12s %u\n", "in frustum", f->in_frustum);
    printf("%-12s %u\n", "visible", f->stats.visible);
    printf("%-12s %u\n", "occluders", f->stats.occluders);
    printf("%-12s %.3f ms\n", "time", f->time_ms);
    printf("%-12s %016llx\n", "hash", (unsigned long long)f->hash);
    for (uint32_t i = 0; f->ids && i < f->stats.visible; ++i) {
        printf("%u\n", f->ids[i]);
    }
    return EXIT_DONE;
}

int cmd_cull(const options *o)
{
    setup s;
    views v;
    frame f = {0};
    int code = setup_views(&s, o, true, &v);
    if (code == EXIT_DONE) {
        umb_view view = setup_view(&s, o, &v, 0);
        code = time_answers(&s, o, &view, &f);
        if (code == EXIT_DONE) {
            code = frame_count_in_frustum(&s, o, &view, &f.in_frustum);
        }
        if (code == EXIT_DONE && o->capture) {
            code = save_capture(&s, o);
        }
    }
    if (code == EXIT_DONE) {
        code = options_given(o, "json") ? print_json(&f, o) : print_text(&f);
    }
    frame_free(&f);
    camera_path_free(&v.path);
    setup_free(&s);
    return code;
}

/* umbrage replay: answer a captured frame again and compare. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "frame.h"
#include "json_text.h"
#include "part_file.h"
#include "progress.h"

typedef struct difference {
    bool order;  /* same objects, another one at this place; else: an object of one answer only */
    uint32_t at; /* the place, or the object */
    uint32_t was, is; /* order: the objects; else 1 visible, 0 hidden */
} difference;

typedef struct replay {
    umb_capture capture;
    umb_visible_set set;
    uint64_t hash, captured_hash;
    difference *differences;
    uint32_t count;
} replay;

static int read_all(const options *o, unsigned char **bytes, size_t *size)
{
    FILE *file = fopen(o->input, "rb");
    *bytes = NULL;
    *size = 0;
    if (!file) {
        return fail(o, EXIT_INPUT, "%s: %s", o->input, strerror(errno));
    }
    size_t capacity = 0, got = 1;
    while (got > 0) {
        if (*size == capacity) {
            unsigned char *more = realloc(*bytes, capacity = capacity * 2 + 65536);
            if (!more) {
                fclose(file);
                return fail(o, EXIT_INPUT, "%s: not enough memory", o->input);
            }
            *bytes = more;
        }
        got = fread(*bytes + *size, 1, capacity - *size, file);
        *size += got;
    }
    bool bad = ferror(file) != 0;
    fclose(file);
    return bad ? fail(o, EXIT_INPUT, "%s: cannot be read", o->input) : EXIT_DONE;
}

/* One list after the other: objects of one answer only, by id; when there are none, the places
 * where the orders differ. marks: 1 was there, 2 is there. */
static bool find_differences(replay *r)
{
    const umb_capture *c = &r->capture;
    uint32_t objects = umb_scene_object_count(c->scene);
    uint8_t *marks = calloc((size_t)objects + 1, 1);
    uint64_t most = (uint64_t)c->answer_count + r->set.count + 1;
    r->differences = malloc(most * sizeof *r->differences);
    if (!marks || !r->differences) {
        free(marks);
        return false;
    }
    for (uint32_t i = 0; i < c->answer_count; ++i) {
        if (c->answer[i] < objects) {
            marks[c->answer[i]] |= 1;
        }
    }
    for (uint32_t i = 0; i < r->set.count; ++i) {
        marks[r->set.objects[i]] |= 2;
    }
    for (uint32_t i = 0; i < objects; ++i) {
        if (marks[i] == 1 || marks[i] == 2) {
            r->differences[r->count++] = (difference){
                .at = i, .was = marks[i] & 1, .is = marks[i] >> 1};
        }
    }
    for (uint32_t i = 0; r->count == 0 && i < r->set.count && i < c->answer_count; ++i) {
        if (r->set.objects[i] != c->answer[i]) {
            r->differences[r->count++] = (difference){
                .order = true, .at = i, .was = c->answer[i], .is = r->set.objects[i]};
        }
    }
    free(marks);
    return true;
}

static int print_json(const replay *r, const options *o)
{
    char hash[20];
    json_text j = {0};
    json_text_open(&j, NULL, '{');
    json_text_bool(&j, "same", r->count == 0);
    json_text_open(&j, "differences", '[');
    for (uint32_t i = 0; i < r->count; ++i) {
        const difference *d = &r->differences[i];
        json_text_open(&j, NULL, '{');
        json_text_count(&j, d->order ? "place" : "object", d->at);
        if (d->order) {
            json_text_count(&j, "was", d->was);
            json_text_count(&j, "is", d->is);
        } else {
            json_text_string(&j, "was", d->was ? "visible" : "hidden");
            json_text_string(&j, "is", d->is ? "visible" : "hidden");
        }
        json_text_close(&j, '}');
    }
    json_text_close(&j, ']');
    json_text_string(&j, "method", umb_method_name(r->capture.method));
    json_text_string(&j, "class", umb_class_name(r->set.class_));
    json_text_string(&j, "index", umb_index_name(&r->capture.index_def));
    json_text_count(&j, "objects", umb_scene_object_count(r->capture.scene));
    json_text_count(&j, "visible", r->set.count);
    json_text_count(&j, "captured_visible", r->capture.answer_count);
    snprintf(hash, sizeof hash, "%016llx", (unsigned long long)r->hash);
    json_text_string(&j, "hash", hash);
    snprintf(hash, sizeof hash, "%016llx", (unsigned long long)r->captured_hash);
    json_text_string(&j, "captured_hash", hash);
    json_text_close(&j, '}');
    return part_file_print(o, &j);
}

static int print_text(const replay *r)
{
    printf("%-12s %s (%s), index %s\n", "method", umb_method_name(r->capture.method),
           umb_class_name(r->set.class_), umb_index_name(&r->capture.index_def));
    printf("%-12s %u\n", "objects", umb_scene_object_count(r->capture.scene));
    printf("%-12s %u, hash %016llx\n", "captured", r->capture.answer_count,
           (unsigned long long)r->captured_hash);
    printf("%-12s %u, hash %016llx\n", "replayed", r->set.count, (unsigned long long)r->hash);
    printf("%-12s %s\n", "same", r->count == 0 ? "yes" : "no");
    for (uint32_t i = 0; i < r->count; ++i) {
        const difference *d = &r->differences[i];
        if (d->order) {
            printf("place %u: was object %u, is object %u\n", d->at, d->was, d->is);
        } else {
            printf("object %u: was %s, is %s\n", d->at, d->was ? "visible" : "hidden",
                   d->is ? "visible" : "hidden");
        }
    }
    return EXIT_DONE;
}

static int answer_again(replay *r, const options *o)
{
    umb_result result = umb_cull(r->capture.culler, &r->capture.view, &r->set);
    if (result != UMB_OK) {
        return fail(o, EXIT_INPUT, "%s: the captured view: %s", o->input, umb_result_name(result));
    }
    bool good = frame_hash(r->set.objects, r->set.count, &r->hash) &&
                frame_hash(r->capture.answer, r->capture.answer_count, &r->captured_hash) &&
                find_differences(r);
    return good ? EXIT_DONE : fail(o, EXIT_INPUT, "not enough memory");
}

int cmd_replay(const options *o)
{
    replay r = {0};
    unsigned char *bytes;
    size_t size;
    umb_error error = {0};
    umb_pool *pool = NULL;
    umb_tasks tasks = {0};
    progress_note(o, "reading the frame");
    int code = read_all(o, &bytes, &size);
    if (code == EXIT_DONE && o->threads > 1) {
        if (umb_pool_create(o->threads, &pool) != UMB_OK) {
            code = fail(o, EXIT_INPUT, "%u threads cannot be started; ask for fewer", o->threads);
        } else {
            tasks = umb_pool_tasks(pool);
        }
    }
    if (code == EXIT_DONE &&
        umb_capture_load(bytes, size, o->isa, tasks, &r.capture, &error) != UMB_OK) {
        code = fail(o, EXIT_INPUT, "%s: %s", o->input, error.text);
    }
    if (code == EXIT_DONE) {
        progress_note(o, "answering it again");
        code = answer_again(&r, o);
        progress_note(o, NULL);
    }
    if (code == EXIT_DONE) {
        code = options_given(o, "json") ? print_json(&r, o) : print_text(&r);
    }
    if (code == EXIT_DONE && r.count > 0) {
        code = EXIT_CHECK;
    }
    free(r.differences);
    umb_capture_free(&r.capture);
    umb_pool_destroy(pool);
    free(bytes);
    return code;
}

#include "selection.h"

#include <stdlib.h>


/* The layers that objects are put into: those that are left out, and the rest, which the views are of. */
enum { LEFT_OUT = 1u << 0, REST = 1u << 1 };

/* Digits up to something else. */
static bool read_number(const char **text, uint32_t *out)
{
    uint64_t value = 0;
    const char *start = *text;
    for (; **text >= '0' && **text <= '9' && value < UINT32_MAX; ++*text) {
        value = 10 * value + (uint64_t)(**text - '0');
    }
    *out = (uint32_t)value;
    return *text != start && value < UINT32_MAX;
}

/* The bits of a list of numbers and ranges; they are the caller's. */
static int read_list(const setup *s, const options *o, const char *name, const char *text, uint32_t **out)
{
    uint32_t objects = s->model->object_count, *bits = calloc((size_t)objects / 32 + 1, sizeof *bits);
    *out = bits;
    if (bits == NULL) {
        return fail(o, EXIT_INPUT, "not enough memory");
    }
    for (const char *at = text;; ++at) {
        uint32_t first, last;
        bool good = read_number(&at, &first);
        last = first;
        if (good && *at == '-') {
            ++at;
            good = read_number(&at, &last);
        }
        if (!good || last < first || (*at != ',' && *at != '\0')) {
            return fail(o, EXIT_USAGE, "--%s '%.60s': takes numbers of objects and ranges of them: 3,17,40-60", name, text);
        }
        if (last >= objects) {
            return fail(o, EXIT_USAGE, "--%s: no object %u, %s has %u", name, last, o->input, objects);
        }
        for (uint32_t i = first; i <= last; ++i) {
            bits[i / 32] |= 1u << i % 32;
        }
        if (*at == '\0') {
            return EXIT_DONE;
        }
    }
}

static bool has(const uint32_t *bits, uint32_t object)
{
    return (bits[object / 32] >> object % 32 & 1u) != 0;
}

int selection_start(setup *s, const options *o)
{
    int code = EXIT_DONE;
    if (o->only == NULL && o->without == NULL) {
        return code;
    }
    s->selection = calloc(1, sizeof *s->selection);
    if (s->selection == NULL) {
        return fail(o, EXIT_INPUT, "not enough memory");
    }
    if (o->only != NULL) {
        code = read_list(s, o, "only", o->only, &s->selection->only);
    }
    if (code == EXIT_DONE && o->without != NULL) {
        code = read_list(s, o, "without", o->without, &s->selection->without);
    }
    umb_result result = UMB_OK;
    for (uint32_t i = 0; code == EXIT_DONE && o->without != NULL && i < s->model->object_count && result == UMB_OK; ++i) {
        result = umb_scene_mask_object(s->scene, i, has(s->selection->without, i) ? LEFT_OUT : REST);
    }
    return result == UMB_OK ? code : fail(o, EXIT_INPUT, "what is left out: %s", umb_result_name(result));
}

umb_result selection_restrict(const setup *s, umb_culler *culler)
{
    bool any = s->selection != NULL && s->selection->only != NULL;
    return any ? umb_culler_set_candidates(culler, s->selection->only, s->model->object_count) : UMB_OK;
}

void selection_free(selection *x)
{
    if (x != NULL) {
        free(x->only);
        free(x->without);
        free(x);
    }
}

void selection_mask_view(const setup *s, umb_view *view)
{
    view->mask = s->selection != NULL && s->selection->without != NULL ? REST : 0;
}

bool selection_asks(const setup *s, uint32_t object)
{
    return s->selection == NULL || s->selection->only == NULL || has(s->selection->only, object);
}

void selection_strip_model(setup *s)
{
    for (uint32_t i = 0; s->selection != NULL && s->selection->without != NULL && i < s->model->object_count; ++i) {
        if (has(s->selection->without, i)) {
            s->model->objects[i].mesh = MODEL_NONE;
            s->model->objects[i].bounds = (umb_aabb){{0, 0, 0}, {0, 0, 0}};
        }
    }
}

/* umbrage explain: why an object is visible or hidden. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "frame.h"
#include "part_file.h"
#include "progress.h"
#include "truth/truth.h"

enum { MOST_BLOCKERS = 16 };

typedef struct explanation {
    bool reported;   /* by the method */
    bool in_frustum; /* its bounds meet the frustum */
    bool seen;       /* the oracle has a witness */
    truth_witness witness;
    const char *renderer;
    uint32_t blockers[MOST_BLOCKERS], hits[MOST_BLOCKERS], blocker_count;
} explanation;

static bool contains(const umb_visible_set *set, uint32_t object)
{
    for (uint32_t i = 0; i < set->count; ++i) {
        if (set->objects[i] == object) {
            return true;
        }
    }
    return false;
}

/* A confirmed witness is worth more, then one for renderers that cull back faces. */
static void choose_witness(const truth_result *r, uint32_t object, explanation *out)
{
    const truth_witness *both[2] = {&r->culling[object], &r->two_sided[object]};
    static const char *const names[2] = {"culling", "two_sided"};
    for (int k = 0; k < 2; ++k) {
        if (both[k]->renderers && (!out->seen || (both[k]->confirmed && !out->witness.confirmed))) {
            out->seen = true;
            out->witness = *both[k];
            out->renderer = names[k];
        }
    }
}

static int ask_oracle(const setup *s, const options *o, const umb_view *view, explanation *out)
{
    umb_error error = {0};
    truth_result result;
    uint32_t objects = s->model->object_count;
    uint8_t *accused = calloc((size_t)objects, 1);
    truth *oracle = truth_create(s->model, &error);
    truth_options want = {.grid_width = o->grid_width,
                          .grid_height = o->grid_height,
                          .guided_rays = o->rays,
                          .accused = accused,
                          .threads = o->threads};
    int code = EXIT_DONE;
    progress_note(o, "tracing rays");
    if (!accused) {
        code = fail(o, EXIT_INPUT, "not enough memory");
    } else {
        accused[o->object] = 1;
    }
    if (code == EXIT_DONE && (!oracle || !truth_view(oracle, view, &want, &result, &error))) {
        code = fail(o, EXIT_INPUT, "the oracle: %s", error.text);
    } else if (code == EXIT_DONE) {
        choose_witness(&result, o->object, out);
        truth_result_free(&result);
    }
    if (code == EXIT_DONE && !out->seen) {
        out->blocker_count = truth_blockers(oracle, view, o->object, out->blockers, out->hits,
                                            MOST_BLOCKERS);
    }
    progress_note(o, NULL);
    truth_destroy(oracle);
    free(accused);
    return code;
}

static int ask_method(const setup *s, const options *o, const umb_view *view, explanation *out)
{
    umb_visible_set set;
    frame f;
    int code = frame_answer(s, o, view, false, &f, &set);
    if (code == EXIT_DONE) {
        out->reported = contains(&set, o->object);
        umb_view whole = *view;
        whole.min_pixels = 0.0;
        if (umb_cull(s->frustum, &whole, &set) != UMB_OK) {
            return fail(o, EXIT_INPUT, "%s", s->error.text);
        }
        out->in_frustum = contains(&set, o->object);
    }
    return code;
}

static const char *reason(const explanation *e, const options *o)
{
    if (e->reported) {
        return e->seen ? "a free sight-line reaches it" : "not proven hidden";
    }
    if (!e->in_frustum) {
        return "outside the view";
    }
    return o->min_pixels > 0.0 ? "occluded, or under --min-pixels" : "occluded";
}

static int print_json(const explanation *e, const setup *s, const options *o)
{
    json_text j = {0};
    const model *m = s->model;
    json_text_open(&j, NULL, '{');
    json_text_count(&j, "object", o->object);
    json_text_string(&j, "name", m->objects[o->object].name);
    json_text_string(&j, "method", umb_method_name(o->method));
    json_text_string(&j, "verdict", e->reported ? "visible" : "hidden");
    json_text_string(&j, "reason", reason(e, o));
    json_text_string(&j, "truth", e->seen ? "visible" : "hidden");
    if (e->seen) {
        double from[3], to[3];
        setup_to_file(m, e->witness.from, from);
        setup_to_file(m, e->witness.to, to);
        json_text_open(&j, "witness", '{');
        json_text_point(&j, "from", from);
        json_text_point(&j, "to", to);
        json_text_string(&j, "renderer", e->renderer);
        json_text_bool(&j, "confirmed", e->witness.confirmed != 0);
        json_text_close(&j, '}');
    } else {
        json_text_open(&j, "blockers", '[');
        for (uint32_t i = 0; i < e->blocker_count; ++i) {
            json_text_open(&j, NULL, '{');
            json_text_count(&j, "object", e->blockers[i]);
            json_text_string(&j, "name", m->objects[e->blockers[i]].name);
            json_text_count(&j, "hits", e->hits[i]);
            json_text_close(&j, '}');
        }
        json_text_close(&j, ']');
    }
    json_text_close(&j, '}');
    return part_file_print(o, &j);
}

static int print_text(const explanation *e, const setup *s, const options *o)
{
    const model *m = s->model;
    printf("%-12s %u (%s)\n", "object", o->object, m->objects[o->object].name);
    printf("%-12s %s: %s (%s)\n", "verdict", e->reported ? "visible" : "hidden", reason(e, o),
           umb_method_name(o->method));
    printf("%-12s %s\n", "truth", e->seen ? "visible" : "no sight-line was found");
    if (e->seen) {
        double from[3], to[3];
        setup_to_file(m, e->witness.from, from);
        setup_to_file(m, e->witness.to, to);
        printf("%-12s from %.9g,%.9g,%.9g to %.9g,%.9g,%.9g (%s%s)\n", "witness", from[0], from[1],
               from[2], to[0], to[1], to[2], e->renderer, e->witness.confirmed ? ", exact" : "");
    }
    for (uint32_t i = 0; i < e->blocker_count; ++i) {
        printf("%-12s %u (%s), %u rays\n", i == 0 ? "blockers" : "", e->blockers[i],
               m->objects[e->blockers[i]].name, e->hits[i]);
    }
    return EXIT_DONE;
}

/* The object's number is looked at once the scene is there; one that was not given, before. */
int cmd_explain(const options *o)
{
    setup s;
    views v;
    explanation e = {0};
    if (!options_given(o, "object")) {
        return fail(o, EXIT_USAGE, "needs an object: --object ID");
    }
    int code = setup_views(&s, o, true, &v);
    if (code == EXIT_DONE && o->object >= s.model->object_count) {
        code = fail(o, EXIT_USAGE, "no object %u: %s has %u, numbered from 0", o->object, o->input,
                    s.model->object_count);
    }
    if (code == EXIT_DONE) {
        umb_view view = setup_view(&s, o, &v, 0);
        code = ask_method(&s, o, &view, &e);
        if (code == EXIT_DONE) {
            code = ask_oracle(&s, o, &view, &e);
        }
    }
    if (code == EXIT_DONE) {
        code = options_given(o, "json") ? print_json(&e, &s, o) : print_text(&e, &s, o);
    }
    if (code == EXIT_DONE && e.seen && e.witness.confirmed && !e.reported) {
        code = EXIT_CHECK;
    }
    camera_path_free(&v.path);
    setup_free(&s);
    return code;
}

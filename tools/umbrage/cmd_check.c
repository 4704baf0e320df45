/* umbrage check: the visible set against the oracle. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "frame.h"
#include "moving.h"
#include "part_file.h"
#include "progress.h"
#include "selection.h"
#include "truth/truth.h"

/* Counts for one kind of renderer, or for the union of both. */
typedef struct tally {
    uint64_t visible;     /* objects with a witness */
    uint64_t wrong;       /* of them hidden by the method, with an exactly confirmed witness */
    uint64_t unconfirmed; /* of them hidden by the method, without one */
} tally;

enum { EITHER, CULLING, TWO_SIDED, KINDS };
static const char *const kind_names[KINDS] = {"either", "culling", "two_sided"};

typedef struct checked {
    uint32_t row;
    frame frame;
    tally tallies[KINDS];
    uint64_t rays;
    bool budget_spent;
} checked;

typedef struct wrong {
    uint32_t row, object;
    truth_witness witness;
    const char *renderer;
} wrong;

typedef struct check {
    checked *views;
    uint32_t count;
    wrong *wrongs;
    size_t wrong_count, wrong_capacity;
    checked total;
    uint64_t reported;
    uint32_t budget_spent; /* views */
} check;

static bool note_wrong(check *c, uint32_t row, uint32_t object, const truth_result *r)
{
    if (c->wrong_count == c->wrong_capacity) {
        size_t capacity = c->wrong_capacity * 2 + 64;
        wrong *more = realloc(c->wrongs, capacity * sizeof *more);
        if (!more) {
            return false;
        }
        c->wrongs = more;
        c->wrong_capacity = capacity;
    }
    const truth_witness *culling = &r->culling[object];
    bool use = culling->renderers && culling->confirmed;
    c->wrongs[c->wrong_count++] = (wrong){.row = row,
                                          .object = object,
                                          .witness = use ? *culling : r->two_sided[object],
                                          .renderer = kind_names[use ? CULLING : TWO_SIDED]};
    return true;
}

static void count(tally *t, bool witness, bool confirmed, bool hidden)
{
    t->visible += witness && (confirmed || !hidden);
    t->wrong += witness && hidden && confirmed;
    t->unconfirmed += witness && hidden && !confirmed;
}

/* Compare one answer with the truth; hidden has a byte for each object. */
static bool compare(const setup *s, check *c, checked *v, const truth_result *r, const uint8_t *hidden)
{
    for (uint32_t i = 0; i < s->model->object_count; ++i) {
        if (!selection_asks(s, i)) {
            continue;
        }
        const truth_witness *culling = &r->culling[i], *two_sided = &r->two_sided[i];
        bool seen[2] = {culling->renderers != 0, two_sided->renderers != 0};
        bool sure[2] = {seen[0] && culling->confirmed, seen[1] && two_sided->confirmed};
        count(&v->tallies[EITHER], seen[0] || seen[1], sure[0] || sure[1], hidden[i]);
        count(&v->tallies[CULLING], seen[0], sure[0], hidden[i]);
        count(&v->tallies[TWO_SIDED], seen[1], sure[1], hidden[i]);
        if (hidden[i] && (sure[0] || sure[1]) && !note_wrong(c, v->row, i, r)) {
            return false;
        }
    }
    return true;
}

/* The oracle sees the objects where they are in this view. */
static truth *oracle_of(setup *s, truth *oracle, const umb_view *view, umb_error *error)
{
    if (!s->moving) {
        return oracle;
    }
    truth_destroy(oracle);
    moving_pose_model(s, view->time);
    return truth_create(s->model, error);
}

static int check_view(setup *s, const options *o, truth *oracle, const umb_view *view,
                      uint8_t *hidden, check *c, checked *out)
{
    umb_visible_set set;
    umb_error error = {0};
    truth_result result;
    uint32_t objects = s->model->object_count;
    int code = frame_answer(s, o, view, false, &out->frame, &set);
    if (code != EXIT_DONE) {
        return code;
    }
    for (uint32_t i = 0; i < objects; ++i) {
        hidden[i] = selection_asks(s, i);
    }
    for (uint32_t i = 0; i < set.count; ++i) {
        hidden[set.objects[i]] = 0;
    }
    code = frame_count_in_frustum(s, o, view, &out->frame.in_frustum);
    if (code != EXIT_DONE) {
        return code;
    }
    truth_options want = {.grid_width = o->grid_width,
                          .grid_height = o->grid_height,
                          .guided_rays = o->rays,
                          .accused = hidden,
                          .threads = o->threads};
    if (!truth_view(oracle, view, &want, &result, &error)) {
        return fail(o, EXIT_INPUT, "the oracle: %s", error.text);
    }
    out->rays = result.rays;
    out->budget_spent = result.budget_spent;
    bool good = compare(s, c, out, &result, hidden);
    truth_result_free(&result);
    return good ? EXIT_DONE : fail(o, EXIT_INPUT, "not enough memory");
}

static void add_total(check *c, const checked *v)
{
    for (int k = 0; k < KINDS; ++k) {
        c->total.tallies[k].visible += v->tallies[k].visible;
        c->total.tallies[k].wrong += v->tallies[k].wrong;
        c->total.tallies[k].unconfirmed += v->tallies[k].unconfirmed;
    }
    c->total.rays += v->rays;
    c->reported += v->frame.stats.visible;
    c->budget_spent += v->budget_spent;
}

static int check_all(setup *s, const options *o, const views *v, check *c)
{
    umb_error error = {0};
    selection_strip_model(s);
    truth *oracle = truth_create(s->model, &error);
    uint8_t *hidden = malloc((size_t)s->model->object_count + 1);
    c->count = v->count;
    c->views = calloc(v->count, sizeof *c->views);
    int code = EXIT_DONE;
    if (!oracle) {
        code = fail(o, EXIT_INPUT, "the oracle: %s", error.text);
    } else if (!hidden || !c->views) {
        code = fail(o, EXIT_INPUT, "not enough memory");
    }
    progress p = progress_begin(o, "views", v->count);
    for (uint32_t k = 0; code == EXIT_DONE && k < v->count; ++k) {
        umb_view view = setup_view(s, o, v, k);
        c->views[k].row = setup_row(v, k);
        oracle = oracle_of(s, oracle, &view, &error);
        code = oracle ? check_view(s, o, oracle, &view, hidden, c, &c->views[k])
                      : fail(o, EXIT_INPUT, "the oracle: %s", error.text);
        add_total(c, &c->views[k]);
        progress_step(&p, k + 1);
    }
    progress_end(&p);
    free(hidden);
    truth_destroy(oracle);
    return code;
}

/* Reported over truly visible; nothing over nothing is perfect, something over nothing has no
 * number. */
static double conservativity(uint64_t reported, uint64_t visible)
{
    return visible > 0 ? (double)reported / (double)visible : reported > 0 ? NAN : 1.0;
}

static void put_tally(json_text *j, const tally *t, uint64_t reported, uint64_t rays)
{
    json_text_count(j, "truth_visible", t->visible);
    json_text_count(j, "reported_visible", reported);
    json_text_count(j, "wrongly_hidden", t->wrong);
    json_text_count(j, "unconfirmed", t->unconfirmed);
    json_text_number(j, "conservativity", conservativity(reported, t->visible));
    json_text_count(j, "rays", rays);
}

static void put_tallies(json_text *j, const checked *v, uint64_t reported)
{
    put_tally(j, &v->tallies[EITHER], reported, v->rays);
    for (int k = CULLING; k < KINDS; ++k) {
        json_text_open(j, kind_names[k], '{');
        put_tally(j, &v->tallies[k], reported, v->rays);
        json_text_close(j, '}');
    }
}

static void put_wrongs(json_text *j, const check *c, const model *m)
{
    json_text_open(j, "wrong", '[');
    for (size_t i = 0; i < c->wrong_count; ++i) {
        const wrong *w = &c->wrongs[i];
        double from[3], to[3];
        setup_to_file(m, w->witness.from, from);
        setup_to_file(m, w->witness.to, to);
        json_text_open(j, NULL, '{');
        json_text_count(j, "row", w->row);
        json_text_count(j, "object", w->object);
        json_text_string(j, "name", m->objects[w->object].name);
        json_text_point(j, "from", from);
        json_text_point(j, "to", to);
        json_text_string(j, "renderer", w->renderer);
        json_text_close(j, '}');
    }
    json_text_close(j, ']');
}

/* Mean and largest conservativity of the views that have one. */
static void spread(const check *c, double *mean, double *largest)
{
    uint32_t finite = 0;
    double sum = 0.0;
    *largest = 0.0;
    for (uint32_t k = 0; k < c->count; ++k) {
        double ratio = conservativity(c->views[k].frame.stats.visible,
                                      c->views[k].tallies[EITHER].visible);
        if (isfinite(ratio)) {
            sum += ratio;
            *largest = fmax(*largest, ratio);
            ++finite;
        }
    }
    *mean = finite > 0 ? sum / finite : NAN;
    *largest = finite > 0 ? *largest : NAN;
}

static int print_json(const check *c, const setup *s, const options *o, bool is_path)
{
    json_text j = {0};
    double mean, largest;
    uint64_t in_frustum = 0;
    spread(c, &mean, &largest);
    for (uint32_t k = 0; k < c->count; ++k) {
        in_frustum += c->views[k].frame.in_frustum;
    }
    json_text_open(&j, NULL, '{');
    json_text_string(&j, "method", umb_method_name(o->method));
    json_text_string(&j, "class", umb_class_name(c->views[0].frame.class_));
    json_text_string(&j, "index", umb_index_name(&o->index));
    json_text_string(&j, "update", umb_index_update_name(o->index.update));
    json_text_count(&j, "objects", s->model->object_count);
    json_text_count(&j, "views", c->count);
    json_text_count(&j, "in_frustum", in_frustum);
    put_tallies(&j, &c->total, c->reported);
    json_text_number(&j, "conservativity_mean", mean);
    json_text_number(&j, "conservativity_max", largest);
    json_text_count(&j, "budget_spent", c->budget_spent);
    put_wrongs(&j, c, s->model);
    if (is_path) {
        json_text_open(&j, "frames", '[');
        for (uint32_t k = 0; k < c->count; ++k) {
            const checked *v = &c->views[k];
            json_text_open(&j, NULL, '{');
            json_text_count(&j, "row", v->row);
            frame_json(&v->frame, &j);
            put_tallies(&j, v, v->frame.stats.visible);
            json_text_bool(&j, "budget_spent", v->budget_spent);
            json_text_close(&j, '}');
        }
        json_text_close(&j, ']');
    }
    json_text_close(&j, '}');
    return part_file_print(o, &j);
}

static void print_row(const checked *v)
{
    const tally *t = &v->tallies[EITHER];
    printf("%6u %10u %10u %10llu %6llu %11llu %8.3f %9.3f\n", v->row, v->frame.in_frustum,
           v->frame.stats.visible, (unsigned long long)t->visible, (unsigned long long)t->wrong,
           (unsigned long long)t->unconfirmed, conservativity(v->frame.stats.visible, t->visible),
           v->frame.time_ms);
}

static int print_text(const check *c, const setup *s, const options *o)
{
    uint32_t step = (c->count + 19) / 20;
    double mean, largest;
    const model *m = s->model;
    spread(c, &mean, &largest);
    printf("%s (%s), index %s, %u objects\n\n", umb_method_name(o->method),
           umb_class_name(c->views[0].frame.class_), umb_index_name(&o->index), m->object_count);
    printf("%6s %10s %10s %10s %6s %11s %8s %9s\n", "row", "in frustum", "reported", "truth",
           "wrong", "unconfirmed", "ratio", "ms");
    for (uint32_t k = 0; k < c->count; ++k) {
        if (k % step == 0 || k + 1 == c->count || c->views[k].tallies[EITHER].wrong > 0) {
            print_row(&c->views[k]);
        }
    }
    for (int k = EITHER; k < KINDS; ++k) {
        const tally *t = &c->total.tallies[k];
        printf("%s%-9s reported %llu, truly visible %llu, wrongly hidden %llu, unconfirmed %llu, "
               "conservativity %.3f\n",
               k == EITHER ? "\n" : "", kind_names[k], (unsigned long long)c->reported,
               (unsigned long long)t->visible, (unsigned long long)t->wrong,
               (unsigned long long)t->unconfirmed, conservativity(c->reported, t->visible));
    }
    printf("%u views, conservativity mean %.3f, worst %.3f; %llu rays", c->count, mean, largest,
           (unsigned long long)c->total.rays);
    printf(c->budget_spent > 0 ? ", budget spent in %u views\n" : "\n", c->budget_spent);
    for (size_t i = 0; i < c->wrong_count; ++i) {
        const wrong *w = &c->wrongs[i];
        double from[3], to[3];
        setup_to_file(m, w->witness.from, from);
        setup_to_file(m, w->witness.to, to);
        printf("WRONG row %u hides object %u (%s): free from %.17g,%.17g,%.17g to "
               "%.17g,%.17g,%.17g (%s)\n",
               w->row, w->object, m->objects[w->object].name, from[0], from[1], from[2], to[0],
               to[1], to[2], w->renderer);
    }
    return EXIT_DONE;
}

int cmd_check(const options *o)
{
    setup s;
    views v;
    check c = {0};
    int code = setup_views(&s, o, false, &v);
    if (code == EXIT_DONE) {
        code = check_all(&s, o, &v, &c);
    }
    if (code == EXIT_DONE) {
        code = options_given(o, "json") ? print_json(&c, &s, o, v.is_path) : print_text(&c, &s, o);
    }
    if (code == EXIT_DONE && c.total.tallies[EITHER].wrong > 0) {
        code = EXIT_CHECK;
    }
    free(c.views);
    free(c.wrongs);
    camera_path_free(&v.path);
    setup_free(&s);
    return code;
}

#include "region_check.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { QUICK_RAYS = 500000, CHECK_RAYS = 4000000 };

/* Where sight-lines may start with a near depth: the method allows for picture corners so far off the axis
 * (umbrage/region.h). */
#define CORNER_COSINE 0.2588190451025207 /* of 75 degrees */

static void mark(const umb_region_answer *a, uint32_t objects, uint8_t *hidden, uint8_t *shown)
{
    memset(hidden, 1, objects);
    memset(shown, 0, objects);
    for (uint32_t i = 0; i < a->refined_count; ++i) {
        hidden[a->refined[i]] = 0;
        shown[a->refined[i]] = 1;
    }
}

static int search(const setup *s, const options *o, const umb_region_query *query,
                  const uint8_t *hidden, const uint8_t *shown, region_check *out)
{
    umb_error error = {0};
    region_cell cell = {.near_distance = query->near_depth / CORNER_COSINE * (1.0 - 1e-9)};
    memcpy(cell.min, query->min, sizeof cell.min);
    memcpy(cell.max, query->max, sizeof cell.max);
    bool check = options_given(o, "check"), given = options_given(o, "rays");
    region_options want = {.rays = given   ? o->rays
                                   : check ? CHECK_RAYS
                                           : QUICK_RAYS,
                           .seed = o->seed != NULL ? strtoull(o->seed, NULL, 10) : 0,
                           .exhaust = given,
                           .accused = hidden,
                           .doubtful = shown,
                           .tasks = s->tasks};
    truth *oracle = truth_create(s->model, &error);
    bool ok = oracle != NULL && region_search(oracle, &cell, &want, &out->result, &error);
    if (oracle != NULL) {
        truth_destroy(oracle);
    }
    return ok ? EXIT_DONE : fail(o, EXIT_INPUT, "the oracle: %s", error.text);
}

int region_check_run(const setup *s, const options *o, const umb_region_query *query,
                     const umb_region_answer *answer, region_check *out)
{
    const model *m = s->model;
    *out = (region_check){0};
    if (options_given(o, "rays") && o->rays == 0) {
        return EXIT_DONE;
    }
    uint8_t *hidden = malloc((size_t)m->object_count + 1);
    uint8_t *shown = malloc((size_t)m->object_count + 1);
    int code = EXIT_DONE;
    if (hidden == NULL || shown == NULL) {
        code = fail(o, EXIT_INPUT, "not enough memory");
    } else {
        mark(answer, m->object_count, hidden, shown);
        code = search(s, o, query, hidden, shown, out);
    }
    free(hidden);
    free(shown);
    out->done = code == EXIT_DONE;
    const region_result *r = &out->result;
    for (uint32_t i = 0; out->done && i < m->object_count; ++i) {
        if (r->witness_of[i] != MODEL_NONE && r->witnesses[r->witness_of[i]].confirmed) {
            out->seen_triangles += m->meshes[m->objects[i].mesh].triangle_count;
        }
    }
    return code;
}

void region_check_states(const region_check *c, const umb_region_answer *answer, const model *m,
                         uint8_t *states)
{
    memset(states, PICTURE_OUTSIDE, m->object_count);
    for (uint32_t i = 0; i < answer->refined_count; ++i) {
        states[answer->refined[i]] = PICTURE_HIDDEN;
    }
    for (uint32_t i = 0; c->done && i < m->object_count; ++i) {
        if (c->result.witness_of[i] != MODEL_NONE) {
            states[i] = PICTURE_VISIBLE;
        }
    }
}

void region_check_free(region_check *c)
{
    region_result_free(&c->result);
}

int region_check_code(const region_check *c)
{
    return c->result.wrong > 0 ? EXIT_CHECK : EXIT_DONE;
}

static const char *renderer_name(uint8_t renderer)
{
    return renderer == TRUTH_CULLING ? "culling" : "two_sided";
}

typedef void (*visit_wrong)(void *user, const model *m, const region_witness *w);

/* Every object that was left out and is seen, once. */
static void each_wrong(const region_check *c, const model *m, visit_wrong visit, void *user)
{
    const region_result *r = &c->result;
    for (uint32_t k = 0; k < r->wrong; ++k) {
        visit(user, m, &r->witnesses[r->witness_of[r->wrong_objects[k]]]);
    }
}

static void put_wrong(void *user, const model *m, const region_witness *w)
{
    json_text *j = user;
    double eye[3], from[3], to[3];
    setup_to_file(m, w->eye, eye);
    setup_to_file(m, w->from, from);
    setup_to_file(m, w->to, to);
    json_text_open(j, NULL, '{');
    json_text_count(j, "object", w->object);
    json_text_string(j, "name", m->objects[w->object].name);
    json_text_count(j, "triangle", w->triangle);
    json_text_point(j, "eye", eye);
    json_text_point(j, "from", from);
    json_text_point(j, "to", to);
    json_text_string(j, "renderer", renderer_name(w->renderer));
    json_text_close(j, '}');
}

static void put_progress(json_text *j, const region_result *r)
{
    json_text_open(j, "progress", '[');
    for (uint32_t k = 0; k < r->rounds; ++k) {
        const region_progress *p = &r->progress[k];
        json_text_open(j, NULL, '{');
        json_text_count(j, "rays", p->rays);
        json_text_count(j, "seen", p->objects);
        json_text_count(j, "triangles_met", p->triangles);
        json_text_close(j, '}');
    }
    json_text_close(j, ']');
}

void region_check_json(const region_check *c, const setup *s, json_text *j)
{
    const region_result *r = &c->result;
    if (!c->done) {
        return;
    }
    json_text_count(j, "seen", r->seen_objects);
    json_text_count(j, "seen_triangles", c->seen_triangles);
    json_text_count(j, "triangles_met", r->seen_triangles);
    json_text_count(j, "rays", r->rays);
    json_text_bool(j, "budget_spent", r->budget_spent);
    json_text_number(j, "unseen_share", region_unseen_share(r));
    json_text_number(j, "unseen_triangles", region_unseen_triangles(r));
    put_progress(j, r);
    json_text_count(j, "wrongly_hidden", r->wrong);
    json_text_count(j, "unconfirmed", r->unconfirmed);
    json_text_open(j, "wrong", '[');
    each_wrong(c, s->model, put_wrong, j);
    json_text_close(j, ']');
}

void region_check_row(const region_check *c)
{
    if (c->done) {
        printf("%-12s %12u %12llu   %llu rays\n", "seen", c->result.seen_objects,
               (unsigned long long)c->seen_triangles, (unsigned long long)c->result.rays);
    }
}

static void print_wrong(void *user, const model *m, const region_witness *w)
{
    double from[3], to[3];
    (void)user;
    setup_to_file(m, w->from, from);
    setup_to_file(m, w->to, to);
    printf("WRONG hides object %u (%s): free from %.17g,%.17g,%.17g to %.17g,%.17g,%.17g (%s)\n",
           w->object, m->objects[w->object].name, from[0], from[1], from[2], to[0], to[1], to[2],
           renderer_name(w->renderer));
}

static void print_progress(const region_result *r)
{
    printf("\n%12s %12s %14s %26s\n", "rays", "objects", "triangles met", "new a million rays");
    for (uint32_t k = 0; k < r->rounds; ++k) {
        const region_progress *p = &r->progress[k], none = {0};
        const region_progress *last = k > 0 ? p - 1 : &none;
        double millions = 1e-6 * (double)(p->rays - last->rays);
        printf("%12llu %12u %14llu %12.1f %13.1f\n", (unsigned long long)p->rays, p->objects,
               (unsigned long long)p->triangles, (p->objects - last->objects) / millions,
               (double)(p->triangles - last->triangles) / millions);
    }
    printf("%.2g of all lines end on triangles not met; at least about %.0f of those\n",
           region_unseen_share(r), region_unseen_triangles(r));
}

void region_check_text(const region_check *c, const setup *s, const options *o)
{
    const region_result *r = &c->result;
    if (!c->done) {
        return;
    }
    if (options_given(o, "check")) {
        print_progress(r);
        printf("wrongly hidden %u, unconfirmed %u\n", r->wrong, r->unconfirmed);
    }
    each_wrong(c, s->model, print_wrong, NULL);
}

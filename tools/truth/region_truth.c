/* The search for what a cell sees: even rays, borders, targets, in rounds that double, until two
 * of them add next to nothing or the budget is spent. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "region_hunt.h"

#define DEFAULT_BUDGET 4000000u
#define FIRST_ROUND 65536u /* rays of the first round's even phase */
#define LARGEST_ROUND 4194304u
#define QUIET_SHARE 0.005 /* of the triangles: two rounds that add less end the search */
#define EVERY_OBJECT                                                                               \
    200000u /* scenes of more objects: only those that something speaks for are aimed at */

static bool box_meets(const void *where, const umb_aabb *box)
{
    const region_cell *cell = where;
    for (int i = 0; i < 3; ++i) {
        if (box->max[i] < cell->min[i] || box->min[i] > cell->max[i]) {
            return false;
        }
    }
    return true;
}

static bool stop_there(void *user, const oracle_chunk *chunk)
{
    (void)user;
    (void)chunk;
    return false;
}

/* How far anything can be. Rays need no more of a view. */
static void reach_of(const truth *t, const region_cell *cell, umb_view *view, oracle_view *out)
{
    double square = 0.0;
    for (int i = 0; i < 3; ++i) {
        double low = fmin(cell->min[i], t->model->bounds.min[i]);
        double high = fmax(cell->max[i], t->model->bounds.max[i]);
        square += (high - low) * (high - low);
    }
    memset(view, 0, sizeof *view);
    memset(out, 0, sizeof *out);
    out->view = view;
    out->far_depth = 1.001 * sqrt(square) + 1e-3;
}

static bool has_triangles(const truth *t, uint32_t object)
{
    return t->first_triangle[object + 1] > t->first_triangle[object];
}

static bool make(region_hunt *h, umb_view *view)
{
    const region_cell *cell = h->cell;
    size_t objects = h->t->model->object_count;
    const uint8_t *accused = h->options->accused, *doubtful = h->options->doubtful;
    h->states = calloc((size_t)h->t->first_triangle[objects] + 1, 1);
    h->witness_of = malloc((objects + 1) * sizeof *h->witness_of);
    h->leak_of = malloc((objects + 1) * sizeof *h->leak_of);
    h->candidate = calloc(objects + 1, 1);
    h->targets = malloc((objects + 1) * sizeof *h->targets);
    h->hands = calloc(REGION_HANDS, sizeof *h->hands);
    if (h->states == NULL || h->witness_of == NULL || h->leak_of == NULL || h->candidate == NULL ||
        h->targets == NULL || h->hands == NULL) {
        return false;
    }
    bool all = accused == NULL && doubtful == NULL;
    for (size_t i = 0; i < objects; ++i) {
        bool named = all || (accused != NULL && accused[i]) || (doubtful != NULL && doubtful[i]);
        h->witness_of[i] = h->leak_of[i] = MODEL_NONE;
        h->candidate[i] = named && objects <= EVERY_OBJECT ? REGION_POSSIBLE : 0;
        h->candidate[i] |= doubtful != NULL && doubtful[i] ? REGION_LIKELY : 0;
    }
    for (uint32_t i = 0; i < REGION_HANDS; ++i) {
        h->hands[i].hunt = h;
    }
    double size[3];
    for (int i = 0; i < 3; ++i) {
        size[i] = cell->max[i] - cell->min[i];
    }
    double least = 1e-9 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0]) + 1e-30;
    for (int i = 0; i < 3; ++i) {
        h->area[i] = size[(i + 1) % 3] * size[(i + 2) % 3] + least;
    }
    h->occupied = !oracle_boxes_visit(h->t, box_meets, cell, stop_there, NULL);
    reach_of(h->t, cell, view, &h->reach);
    return true;
}

static void destroy(region_hunt *h)
{
    for (uint32_t i = 0; h->hands != NULL && i < REGION_HANDS; ++i) {
        free(h->hands[i].trace.open);
        free(h->hands[i].finds);
        free(h->hands[i].behind);
    }
    free(h->hands);
    free(h->states);
    free(h->witness_of);
    free(h->witnesses);
    free(h->leaks);
    free(h->leak_of);
    free(h->candidate);
    free(h->targets);
    free(h->hidden);
    free(h->pending);
}

/* What something speaks for comes first in the list. */
static void choose_targets(region_hunt *h)
{
    uint32_t objects = h->t->model->object_count;
    h->target_count = 0;
    for (uint32_t i = 0; i < objects; ++i) {
        if (h->witness_of[i] != MODEL_NONE || !has_triangles(h->t, i)) {
            h->candidate[i] = 0;
        }
        if (h->candidate[i] & REGION_LIKELY) {
            h->targets[h->target_count++] = i;
        }
    }
    h->likely_count = h->target_count;
    for (uint32_t i = 0; i < objects; ++i) {
        if (h->candidate[i] == REGION_POSSIBLE) {
            h->targets[h->target_count++] = i;
        }
    }
}

static uint32_t seen_objects(const region_hunt *h)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < h->t->model->object_count; ++i) {
        count += h->witness_of[i] != MODEL_NONE;
    }
    return count;
}

static void measure(region_hunt *h, region_result *out)
{
    region_progress *p = &out->progress[out->rounds++];
    *p = (region_progress){
        .rays = h->cast, .triangles = h->witness_count, .objects = seen_objects(h)};
    for (uint32_t i = 0; i < REGION_HANDS; ++i) {
        p->even += h->hands[i].even;
    }
    uint64_t triangles = h->t->first_triangle[h->t->model->object_count];
    for (uint64_t i = 0; i < triangles; ++i) {
        uint8_t met = h->states[i] / REGION_EVEN % 4;
        p->once += met == 1;
        p->twice += met == 2;
    }
}

static void do_round(region_hunt *h, uint64_t size)
{
    h->next_even += region_phase(h, region_even_item, h->next_even, size / REGION_EVEN_RUN,
                                 REGION_EVEN_RUN, size);
    if (h->t->model->object_count != 0) {
        h->next_spread += region_phase(h, region_spread_item, h->next_spread,
                                       size / REGION_EVEN_RUN / 2, REGION_EVEN_RUN, size);
    }
    if (h->witness_count != 0) {
        /* New ones first; when none are left, all of them again, with other numbers drawn. */
        h->next_border += region_phase(h, region_border_item, h->next_border, size / 12, 24,
                                       2 * size);
    }
    choose_targets(h);
    h->next_target += region_phase(h, region_target_item, h->next_target, size / 6, 6, size);
}

static bool quiet(const region_result *r)
{
    if (r->rounds < 3) {
        return false;
    }
    const region_progress *now = &r->progress[r->rounds - 1], *before = now - 2;
    return now->objects == before->objects &&
           (double)(now->triangles - before->triangles) <= QUIET_SHARE * (double)now->triangles;
}

static void rounds(region_hunt *h, region_result *out)
{
    uint64_t size = FIRST_ROUND;
    while (size > 1024 && 8 * size > h->budget) {
        size /= 2;
    }
    while (!h->failed && h->cast < h->budget) {
        h->round += 1;
        do_round(h, size);
        out->rounds -= out->rounds == REGION_ROUNDS;
        measure(h, out);
        if (!h->options->exhaust && quiet(out)) {
            return;
        }
        size = size < LARGEST_ROUND ? 2 * size : size;
    }
    out->budget_spent = true;
}

/* In pieces: what is found is not aimed at again. */
static void volleys(region_hunt *h)
{
    uint64_t end = h->cast + h->options->volleys, next = 0;
    for (int piece = 8; piece > 0 && !h->failed && h->cast < end; --piece) {
        if (!region_volley_prepare(h)) {
            h->failed = true;
        }
        if (h->failed || h->hidden_count == 0) {
            return;
        }
        h->budget = end;
        uint64_t rays = (end - h->cast + (uint64_t)piece - 1) / (uint64_t)piece;
        next += region_phase(h, region_volley_item, next, rays / REGION_VOLLEY + 1, REGION_VOLLEY, rays);
    }
}

/* Accused objects that only rays of floats saw: decide them exactly. */
static bool decide(region_hunt *h, region_result *out)
{
    for (uint32_t k = 0; k < h->leak_count; ++k) {
        region_find *f = &h->leaks[k];
        if (h->witness_of[f->object] != MODEL_NONE) {
            continue;
        }
        int verdict = region_refute(h, f);
        out->withdrawn += verdict > 0;
        out->unconfirmed += verdict == 0;
        if (verdict > 0) {
            continue;
        }
        if (h->witness_count == h->witness_capacity) {
            size_t capacity = 2 * (size_t)h->witness_capacity + 64;
            region_witness *more = realloc(h->witnesses, capacity * sizeof *more);
            if (more == NULL) {
                return false;
            }
            h->witnesses = more;
            h->witness_capacity = (uint32_t)capacity;
        }
        if (verdict == 0) {
            f->witness = (region_witness){
                .object = f->object, .triangle = f->triangle, .renderer = f->renderer};
            memcpy(f->witness.eye, f->eye, sizeof f->eye);
            memcpy(f->witness.from, f->eye, sizeof f->eye);
            memcpy(f->witness.to, f->through, sizeof f->through);
        }
        h->witness_of[f->object] = h->witness_count;
        h->witnesses[h->witness_count++] = f->witness;
    }
    return true;
}

static bool fill(region_hunt *h, region_result *out)
{
    uint64_t triangles = h->t->first_triangle[h->t->model->object_count];
    out->triangles = calloc((size_t)(triangles / 64 + 1), sizeof *out->triangles);
    if (out->triangles == NULL || !decide(h, out)) {
        return false;
    }
    for (uint64_t i = 0; i < triangles; ++i) {
        if (h->states[i] & REGION_SEEN) {
            out->triangles[i / 64] |= (uint64_t)1 << (i % 64);
            ++out->seen_triangles;
        }
    }
    for (uint32_t i = 0; i < h->t->model->object_count; ++i) {
        uint32_t first = h->witness_of[i];
        bool seen = first != MODEL_NONE && h->witnesses[first].confirmed;
        out->seen_objects += seen;
        if (seen && h->options->accused != NULL && h->options->accused[i]) {
            h->targets[out->wrong++] = i;
        }
    }
    out->witnesses = h->witnesses;
    out->witness_of = h->witness_of;
    out->wrong_objects = h->targets;
    out->witness_count = h->witness_count;
    out->rays = h->cast;
    h->witnesses = NULL;
    h->witness_of = NULL;
    h->targets = NULL;
    return true;
}

static bool is_box(const region_cell *cell)
{
    bool ok = cell->near_distance >= 0.0 && isfinite(cell->near_distance);
    for (int i = 0; i < 3; ++i) {
        ok = ok && cell->min[i] <= cell->max[i] && isfinite(cell->min[i]) && isfinite(cell->max[i]);
    }
    return ok;
}

bool region_search(truth *t, const region_cell *cell, const region_options *options,
                   region_result *out, umb_error *error)
{
    region_options none = {0};
    umb_view view;
    region_hunt h = {.t = t, .cell = cell, .options = options != NULL ? options : &none};
    memset(out, 0, sizeof *out);
    const char *what = "not enough memory for a search; try a smaller scene";
    bool ok = is_box(cell);
    if (!ok) {
        what = "the cell is no box: its least corner comes first, all numbers finite";
    }
    h.budget = h.options->rays != 0 ? h.options->rays : DEFAULT_BUDGET;
    ok = ok && make(&h, &view);
    if (ok) {
        rounds(&h, out);
        volleys(&h);
        ok = !h.failed && fill(&h, out);
    }
    destroy(&h);
    if (!ok) {
        region_result_free(out);
        if (error != NULL) {
            error->code = is_box(cell) ? UMB_ERROR_MEMORY : UMB_ERROR_ARGUMENT;
            (void)snprintf(error->text, sizeof error->text, "truth: %s", what);
        }
    }
    return ok;
}

void region_result_free(region_result *r)
{
    free(r->witnesses);
    free(r->witness_of);
    free(r->triangles);
    free(r->wrong_objects);
    memset(r, 0, sizeof *r);
}

double region_unseen_share(const region_result *r)
{
    const region_progress *p = r->rounds != 0 ? &r->progress[r->rounds - 1] : NULL;
    return p != NULL && p->even != 0 ? (double)p->once / (double)p->even : 1.0;
}

double region_unseen_triangles(const region_result *r)
{
    const region_progress *p = r->rounds != 0 ? &r->progress[r->rounds - 1] : NULL;
    if (p == NULL || p->once == 0) {
        return 0.0;
    }
    double once = (double)p->once, twice = (double)p->twice;
    return twice > 0.0 ? once * once / (2.0 * twice) : once * (once - 1.0) / 2.0;
}

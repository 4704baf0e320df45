/* Rays from a cell: where they start, what they show, and whether a line is free indeed. */
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "cover.h"
#include "region_hunt.h"

/* An even sequence in five dimensions: multiples of the powers of 1/x with x^6 = x + 1, modulo 1. */
static const uint64_t even_steps[5] = {0xe19b01aa9d42c633u, 0xc6d1d6c8ed0c9631u, 0xaf36d01ef7518dbbu,
                                       0x9a69443f36f710e7u, 0x881403b9339bd42du};

static double even_number(const region_hunt *h, uint64_t index, int dimension)
{
    uint64_t shift = oracle_mix(h->options->seed, (uint64_t)dimension, 21);
    return oracle_unit(even_steps[dimension] * index + shift);
}

static double random_number(uint64_t random, uint64_t which)
{
    return oracle_unit(oracle_mix(random, which, 22));
}

static void lerp_cell(const region_cell *cell, const double share[3], double out[3])
{
    for (int i = 0; i < 3; ++i) {
        out[i] = cell->min[i] + share[i] * (cell->max[i] - cell->min[i]);
        out[i] = fmin(fmax(out[i], cell->min[i]), cell->max[i]);
    }
}

/* An axis, each as often as its faces are large. */
static int choose_axis(const region_hunt *h, double *number)
{
    double at = *number * (h->area[0] + h->area[1] + h->area[2]);
    int axis = at < h->area[0] ? 0 : at < h->area[0] + h->area[1] ? 1 : 2;
    double below = axis == 0 ? 0.0 : axis == 1 ? h->area[0] : h->area[0] + h->area[1];
    *number = fmin(fmax((at - below) / h->area[axis], 0.0), 1.0);
    return axis;
}

void region_eye(const region_hunt *h, uint64_t random, double out[3])
{
    double share[3], number = random_number(random, 3);
    for (uint64_t i = 0; i < 3; ++i) {
        share[i] = random_number(random, i);
    }
    if (!h->occupied || (random & 1) == 0) {
        /* Corners and edges see farthest round what is near. */
        unsigned kind = random >> 1 & 7;
        int axis = choose_axis(h, &number);
        for (int i = 0; i < 3; ++i) {
            bool end = kind < 2 || (kind < 4 ? i != axis : i == axis);
            share[i] = end ? (double)(random >> (4 + i) & 1) : share[i];
        }
    }
    lerp_cell(h->cell, share, out);
}

bool region_line_eye(const region_cell *cell, const double from[3], const double by[3],
                     double eye[3])
{
    double low = 1.0, high = INFINITY, size = 0.0;
    for (int i = 0; i < 3; ++i) {
        double d = by[i] - from[i];
        if (d == 0.0) {
            if (from[i] < cell->min[i] || from[i] > cell->max[i]) {
                return false;
            }
            continue;
        }
        double a = (cell->min[i] - from[i]) / d, b = (cell->max[i] - from[i]) / d;
        low = fmax(low, fmin(a, b));
        high = fmin(high, fmax(a, b));
        size = fmax(size, fabs(d));
    }
    if (!(low <= high) || size == 0.0) {
        return false;
    }
    for (int i = 0; i < 3; ++i) {
        double p = from[i] + low * (by[i] - from[i]);
        eye[i] = fmin(fmax(p, cell->min[i]), cell->max[i]);
    }
    return true;
}

static bool recently(region_hand *hand, uint64_t number)
{
    uint64_t *slot = &hand->recent[number * 0x9E3779B97F4A7C15u >> 54];
    if (*slot == number + 1) {
        return true;
    }
    *slot = number + 1;
    return false;
}

static void note_behind(region_hand *hand, uint32_t object)
{
    if (hand->behind_count == hand->behind_capacity) {
        uint32_t capacity = 2 * hand->behind_capacity + 256;
        uint32_t *more = realloc(hand->behind, capacity * sizeof *more);
        if (more == NULL) {
            hand->failed = true;
            return;
        }
        hand->behind = more;
        hand->behind_capacity = capacity;
    }
    hand->behind[hand->behind_count++] = object;
}

/* A line as it is cast: where it starts, and how near to the eye things count. */
typedef struct shot {
    const double *eye;
    oracle_sight sight;
    double near_depth;
    bool even;
} shot;

uint8_t region_state(const region_hunt *h, uint64_t number)
{
    return atomic_load_explicit((_Atomic uint8_t *)&h->states[number], memory_order_relaxed);
}

static void count_even(region_hunt *h, uint64_t number)
{
    _Atomic uint8_t *state = (_Atomic uint8_t *)&h->states[number];
    uint8_t was = atomic_load_explicit(state, memory_order_relaxed);
    while (was / REGION_EVEN % 4 < 3 &&
           !atomic_compare_exchange_weak_explicit(state, &was, (uint8_t)(was + REGION_EVEN),
                                                  memory_order_relaxed, memory_order_relaxed)) {
    }
}

static void note(region_hand *hand, const shot *s, const oracle_hit *hit, uint8_t renderer)
{
    region_hunt *h = hand->hunt;
    if (hit->object == MODEL_NONE || hit->depth < 0.0) {
        return;
    }
    uint64_t number = h->t->first_triangle[hit->object] + hit->triangle;
    uint8_t state = region_state(h, number);
    if (s->even) {
        count_even(h, number);
    }
    if (state & REGION_SEEN || (state & REGION_LEAKS) == REGION_LEAKS || recently(hand, number)) {
        return;
    }
    if (hand->find_count == hand->find_capacity) {
        uint32_t capacity = 2 * hand->find_capacity + 64;
        region_find *more = realloc(hand->finds, capacity * sizeof *more);
        if (more == NULL) {
            hand->failed = true;
            return;
        }
        hand->finds = more;
        hand->find_capacity = capacity;
    }
    region_find *f = &hand->finds[hand->find_count++];
    memset(f, 0, sizeof *f);
    memcpy(f->eye, s->eye, sizeof f->eye);
    oracle_sight_at(&s->sight, hit->depth, f->through);
    f->near_depth = s->near_depth;
    f->object = hit->object;
    f->triangle = hit->triangle;
    f->renderer = renderer;
}

/* For which renderer a surface is shown, when the line is free up to these depths. 0: none. */
static uint8_t shown_to(const region_hand *hand, const oracle_hit *hit)
{
    const oracle_trace *trace = &hand->trace;
    uint8_t flags = oracle_flags(hand->hunt->t, hit->object, hit->triangle);
    if (hit->depth <= trace->culling.depth && oracle_shown(flags, hit->facing)) {
        return TRUTH_CULLING;
    }
    return hit->depth <= trace->two_sided.depth ? TRUTH_TWO_SIDED : 0;
}

static bool shoot(region_hand *hand, const double eye[3], const double through[3], bool even,
                  shot *out)
{
    const region_hunt *h = hand->hunt;
    double d[3], length = 0.0;
    for (int i = 0; i < 3; ++i) {
        d[i] = through[i] - eye[i];
        length += d[i] * d[i];
    }
    length = sqrt(length);
    if (!(length > 0.0)) {
        return false;
    }
    *out = (shot){.eye = eye, .even = even};
    if (h->cell->near_distance > 0.0) {
        /* Mostly the whole distance is cut away. What is seen nearer than that shows with less. */
        uint64_t random = oracle_mix(hand->rays, h->phase, h->options->seed);
        out->near_depth = h->cell->near_distance * ((random & 3) != 0 ? 1.0 : oracle_unit(random));
    }
    for (int i = 0; i < 3; ++i) {
        out->sight.along[i] = d[i] / length;
        out->sight.from[i] = eye[i] + out->near_depth * out->sight.along[i];
    }
    memcpy(out->sight.through, through, sizeof out->sight.through);
    ++hand->rays;
    oracle_trace *trace = &hand->trace;
    oracle_trace_ray(h->t, &h->reach, &out->sight, trace);
    hand->failed |= trace->out_of_memory;
    if (trace->two_sided.object != MODEL_NONE) {
        note(hand, out, &trace->two_sided, shown_to(hand, &trace->two_sided));
    }
    if (trace->culling.object != MODEL_NONE && trace->culling.depth > trace->two_sided.depth) {
        note(hand, out, &trace->culling, TRUTH_CULLING);
    }
    for (uint32_t i = 0; i < trace->open_count; ++i) {
        uint8_t renderer = shown_to(hand, &trace->open[i]);
        if (renderer != 0) {
            note(hand, out, &trace->open[i], renderer);
        }
    }
    return true;
}

void region_cast(region_hand *hand, const double eye[3], const double through[3])
{
    shot s;
    shoot(hand, eye, through, false, &s);
}

/* Is the first hit at that depth or behind it? */
static bool reaches(const oracle_sight *sight, const oracle_hit *hit, double depth)
{
    double slack = 1e-12 * fabs(depth);
    for (int i = 0; i < 3; ++i) {
        slack += 1e-14 * fabs(sight->from[i]);
    }
    return hit->object == MODEL_NONE || hit->depth >= depth - slack;
}

bool region_aim(region_hand *hand, const double eye[3], const double point[3], uint32_t object,
                uint32_t triangle)
{
    shot s;
    if (!shoot(hand, eye, point, false, &s)) {
        return false;
    }
    const oracle_trace *trace = &hand->trace;
    oracle_hit end = {.object = object, .triangle = triangle};
    float corners[3][3];
    for (int i = 0; i < 3; ++i) {
        end.depth += (point[i] - s.sight.from[i]) * s.sight.along[i];
    }
    oracle_triangle(hand->hunt->t, object, triangle, corners);
    oracle_plane_depth(corners, &s.sight, end.depth, &end.facing);
    bool culling = reaches(&s.sight, &trace->culling, end.depth);
    bool both = reaches(&s.sight, &trace->two_sided, end.depth);
    uint8_t flags = oracle_flags(hand->hunt->t, object, triangle);
    if (culling && oracle_shown(flags, end.facing)) {
        note(hand, &s, &end, TRUTH_CULLING);
    } else if (both) {
        note(hand, &s, &end, TRUTH_TWO_SIDED);
    }
    return culling;
}

/* What lies behind the first thing that blocks for every renderer. */
static void look_behind(region_hand *hand, const shot *s)
{
    region_hunt *h = hand->hunt;
    oracle_hit first = hand->trace.culling;
    oracle_sight on = s->sight;
    if (first.object == MODEL_NONE) {
        return;
    }
    oracle_sight_at(&s->sight, first.depth + 1e-5 * (fabs(first.depth) + 1e-3), on.from);
    ++hand->rays;
    oracle_trace_ray(h->t, &h->reach, &on, &hand->trace);
    uint32_t object = hand->trace.two_sided.object;
    if (object != MODEL_NONE && h->witness_of[object] == MODEL_NONE && h->candidate[object] == 0) {
        note_behind(hand, object);
    }
}

static void even_ray(region_hand *hand, uint64_t index)
{
    const region_hunt *h = hand->hunt;
    double number[5], share[3], eye[3], through[3];
    for (int i = 0; i < 5; ++i) {
        number[i] = even_number(h, index, i);
    }
    int axis = choose_axis(h, &number[0]);
    bool upper = number[0] >= 0.5;
    share[axis] = upper;
    share[(axis + 1) % 3] = number[1];
    share[(axis + 2) % 3] = number[2];
    lerp_cell(h->cell, share, eye);
    /* As often as a surface sends light that way. */
    double turn = 6.283185307179586 * number[3], r = sqrt(number[4]);
    double scale = 1.0;
    for (int i = 0; i < 3; ++i) {
        scale = fmax(scale, fabs(eye[i]));
    }
    through[axis] = eye[axis] + (upper ? scale : -scale) * sqrt(1.0 - number[4]);
    through[(axis + 1) % 3] = eye[(axis + 1) % 3] + scale * r * cos(turn);
    through[(axis + 2) % 3] = eye[(axis + 2) % 3] + scale * r * sin(turn);
    shot s;
    if (shoot(hand, eye, through, true, &s)) {
        ++hand->even;
        if (index % 8 == 0) {
            look_behind(hand, &s);
        }
    }
}

void region_even_item(region_hand *hand, uint64_t item)
{
    for (uint64_t i = 0; i < REGION_EVEN_RUN; ++i) {
        even_ray(hand, item * REGION_EVEN_RUN + i);
    }
}

void region_spread_item(region_hand *hand, uint64_t item)
{
    region_hunt *h = hand->hunt;
    const model *m = h->t->model;
    for (uint64_t i = 0; i < REGION_EVEN_RUN; ++i) {
        uint64_t random = oracle_mix(item * REGION_EVEN_RUN + i, h->options->seed, 23);
        const model_object *o = &m->objects[oracle_mix(random, 1, 24) % m->object_count];
        double eye[3], point[3];
        if (o->mesh == MODEL_NONE) {
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            double share = random_number(random, (uint64_t)k + 5);
            point[k] = o->bounds.min[k] + share * ((double)o->bounds.max[k] - o->bounds.min[k]);
        }
        region_eye(h, random, eye);
        shot s;
        if (shoot(hand, eye, point, false, &s) && i % 8 == 0) {
            look_behind(hand, &s);
        }
    }
}

/* The view that looks along a find's line: exact arithmetic is asked about that. */
static void view_of(const region_find *f, umb_view *v)
{
    double *d = v->forward, length = 0.0;
    memset(v, 0, sizeof *v);
    memcpy(v->eye, f->eye, sizeof v->eye);
    for (int i = 0; i < 3; ++i) {
        d[i] = f->through[i] - f->eye[i];
        length += d[i] * d[i];
    }
    length = sqrt(length);
    int least = 0;
    for (int i = 0; i < 3; ++i) {
        d[i] = fabs(d[i] / length) < 1e-20 ? 0.0 : d[i] / length;
        least = fabs(d[i]) < fabs(d[least]) ? i : least;
    }
    double other[3] = {0.0, 0.0, 0.0}, size = 0.0;
    other[least] = 1.0;
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        v->right[i] = d[j] * other[k] - d[k] * other[j];
        size += v->right[i] * v->right[i];
    }
    for (int i = 0; i < 3; ++i) {
        v->right[i] /= sqrt(size);
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        v->up[i] = v->right[j] * d[k] - v->right[k] * d[j];
        v->up[i] = fabs(v->up[i]) < 1e-20 ? 0.0 : v->up[i];
    }
    v->projection = UMB_PERSPECTIVE;
    v->x_min = v->y_min = -1.0;
    v->x_max = v->y_max = 1.0;
    /* A little less than meant: for lines near this one, a near plane across it is farther away. */
    v->near_depth = f->near_depth * (1.0 - 1e-6);
    v->far_depth = INFINITY;
    v->width = v->height = 1;
}

static void fill_witness(region_find *f, const truth_witness *w, uint32_t triangle)
{
    memcpy(f->witness.eye, f->eye, sizeof f->witness.eye);
    memcpy(f->witness.from, w->from, sizeof f->witness.from);
    memcpy(f->witness.to, w->to, sizeof f->witness.to);
    f->witness.object = f->object;
    f->witness.triangle = triangle;
    f->witness.renderer = w->renderers;
    f->witness.confirmed = w->confirmed;
}

/* Lines tried beside the find's may start too far from the eye. */
static bool starts_in_time(const region_find *f, const truth_witness *w)
{
    double square = 0.0;
    for (int i = 0; i < 3; ++i) {
        square += (w->from[i] - f->eye[i]) * (w->from[i] - f->eye[i]);
    }
    return f->near_depth == 0.0 || square <= f->near_depth * f->near_depth;
}

bool region_confirm(const region_hunt *h, region_find *f)
{
    umb_view view;
    oracle_view v;
    truth_witness w = {0};
    view_of(f, &view);
    oracle_view_make(h->t, &view, NULL, &v);
    if (!oracle_confirm_triangle(h->t, &v, f->through, f->object, f->triangle, f->renderer, &w) ||
        !starts_in_time(f, &w)) {
        return false;
    }
    fill_witness(f, &w, f->triangle);
    return true;
}

int region_refute(const region_hunt *h, region_find *f)
{
    umb_view view;
    oracle_view v;
    truth_witness w = {0};
    view_of(f, &view);
    oracle_view_make(h->t, &view, NULL, &v);
    if (oracle_confirm_near(h->t, &v, f->through, f->object, f->triangle, f->renderer, &w) &&
        starts_in_time(f, &w)) {
        fill_witness(f, &w, f->triangle);
        return -1;
    }
    int verdict = 1;
    for (uint8_t renderer = TRUTH_CULLING; renderer <= TRUTH_TWO_SIDED; ++renderer) {
        cover_verdict c = oracle_cover(h->t, &v, f->object, renderer, COVER_ACCUSED, &w);
        if (c == COVER_SEEN && starts_in_time(f, &w)) {
            fill_witness(f, &w, f->triangle);
            return -1;
        }
        verdict = c == COVER_HIDDEN ? verdict : 0;
    }
    return verdict;
}

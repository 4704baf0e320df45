/* The machinery of a search: threads, casting, noting finds and merging them. */
#include "search.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#define BLOCK_ITEMS 16384u
/* Refuted finds of one object after which no more are looked into. */
#define MAX_EDGE_LEAKS 4
#define MAX_LEAKS 32

static bool reserve(void **array, size_t *capacity, size_t need, size_t size)
{
    if (need <= *capacity) {
        return true;
    }
    size_t more = *capacity ? *capacity * 2 : 1024;
    while (more < need) {
        more *= 2;
    }
    void *p = realloc(*array, more * size);
    if (!p) {
        return false;
    }
    *array = p;
    *capacity = more;
    return true;
}

static void note_triangle(worker *w, uint32_t object, uint32_t triangle)
{
    search *s = w->s;
    uint64_t number = s->t->first_triangle[object] + triangle;
    if (s->known[number / 64] >> (number % 64) & 1) {
        return;
    }
    uint64_t *slot = &w->recent[number * 0x9E3779B97F4A7C15u >> 56];
    if (*slot == number + 1) {
        return;
    }
    *slot = number + 1;
    if (!reserve((void **)&w->triangles, &w->triangle_capacity, w->triangle_count + 1,
                 sizeof(*w->triangles))) {
        w->failed = true;
        return;
    }
    w->triangles[w->triangle_count++] = number;
}

uint8_t search_known(const search *s, uint32_t object)
{
    uint8_t seen = 0;
    for (int r = 0; r < 2; ++r) {
        seen |= (s->flags[r][object] & FLAG_SEEN) != 0 ? (uint8_t)(1u << r) : 0;
    }
    return seen;
}

/* A point of an object is free for these renderers. */
static void note(worker *w, const oracle_sight *sight, const oracle_hit *hit, uint8_t renderers)
{
    double p[3];
    const oracle_view *v = &w->s->view;
    if (hit->object == MODEL_NONE || renderers == 0 || hit->depth < 0.0 ||
        !w->s->in_view[hit->object]) {
        return;
    }
    oracle_sight_at(sight, hit->depth, p);
    for (uint32_t i = 5; i < v->plane_count; ++i) {
        const double *k = v->planes[i];
        if (k[0] * p[0] + k[1] * p[1] + k[2] * p[2] + k[3] < 0.0) {
            return; /* beyond the far plane or outside an extra one: hides, but is not in view */
        }
    }
    if (!w->along_edge) {
        note_triangle(w, hit->object, hit->triangle);
    }
    uint8_t reported = w->reported[hit->object];
    uint8_t fresh = renderers & (uint8_t) ~(search_known(w->s, hit->object) | reported);
    if (w->along_edge) {
        fresh &= (uint8_t) ~(reported >> 2);
    }
    if (fresh == 0 || w->s->finds[0][hit->object].refuted + w->s->finds[1][hit->object].refuted >=
                          (w->along_edge ? MAX_EDGE_LEAKS : MAX_LEAKS)) {
        return;
    }
    if (!reserve((void **)&w->events, &w->event_capacity, w->event_count + 1, sizeof(*w->events))) {
        w->failed = true;
        return;
    }
    find_event *e = &w->events[w->event_count++];
    w->reported[hit->object] |= w->along_edge ? (uint8_t)(renderers << 2) : renderers;
    e->object = hit->object;
    memset(&e->what, 0, sizeof(e->what));
    e->what.ray = w->along_edge ? w->ray | RAY_ALONG_EDGE : w->ray;
    e->what.triangle = hit->triangle;
    e->what.renderers = renderers;
    memcpy(e->what.through, p, sizeof(p));
    memcpy(e->what.from, sight->from, sizeof(p));
    memcpy(e->what.to, p, sizeof(p));
}

/* Which renderers show this hit, given how far the line is free for each. */
static uint8_t shown_to(const worker *w, const oracle_hit *hit, double free_culling,
                        double free_both)
{
    uint8_t flags = oracle_flags(w->s->t, hit->object, hit->triangle);
    uint8_t renderers = 0;
    if (hit->depth <= free_culling && oracle_shown(flags, hit->facing)) {
        renderers |= TRUTH_CULLING;
    }
    if (hit->depth <= free_both) {
        renderers |= TRUTH_TWO_SIDED;
    }
    return renderers;
}

static bool cast(worker *w, const double through[3], oracle_sight *sight)
{
    oracle_trace *trace = &w->trace;
    if (!oracle_sight_make(&w->s->view, through, sight)) {
        return false;
    }
    ++w->ray;
    oracle_trace_ray(w->s->t, &w->s->view, sight, trace);
    double free_culling = trace->culling.depth, free_both = trace->two_sided.depth;
    if (trace->two_sided.object != MODEL_NONE) {
        note(w, sight, &trace->two_sided, shown_to(w, &trace->two_sided, free_culling, free_both));
    }
    if (trace->culling.object != MODEL_NONE && free_culling > free_both) {
        note(w, sight, &trace->culling, shown_to(w, &trace->culling, free_culling, free_both));
    }
    for (uint32_t i = 0; i < trace->open_count; ++i) {
        note(w, sight, &trace->open[i], shown_to(w, &trace->open[i], free_culling, free_both));
    }
    w->failed |= trace->out_of_memory;
    return true;
}

bool search_cast(worker *w, const double through[3])
{
    oracle_sight sight;
    return cast(w, through, &sight);
}

/* Is the first hit at the target's depth or behind it, measured in double on the hit's own
 * plane? */
static bool reaches(const worker *w, const oracle_sight *sight, const oracle_hit *hit, double depth)
{
    double slack = 1e-12 * (fabs(depth) + w->s->view.view->near_depth);
    for (int i = 0; i < 3; ++i) {
        slack += 1e-14 * fabs(sight->from[i]);
    }
    return hit->object == MODEL_NONE || hit->depth >= depth - slack;
}

uint8_t search_aim(worker *w, const double through[3], uint32_t object, uint32_t triangle)
{
    oracle_sight sight;
    float corners[3][3];
    if (!cast(w, through, &sight)) {
        return 0;
    }
    const oracle_trace *trace = &w->trace;
    oracle_hit end = {.object = object, .triangle = triangle};
    double along = 0.0, square = 0.0;
    for (int i = 0; i < 3; ++i) {
        along += (through[i] - sight.from[i]) * sight.along[i];
        square += sight.along[i] * sight.along[i];
    }
    end.depth = along / square;
    oracle_triangle(w->s->t, object, triangle, corners);
    oracle_plane_depth(corners, &sight, end.depth, &end.facing);
    uint8_t renderers = 0;
    if (trace->culling.object == object ||
        (reaches(w, &sight, &trace->culling, end.depth) &&
         oracle_shown(oracle_flags(w->s->t, object, triangle), end.facing))) {
        renderers |= TRUTH_CULLING;
    }
    if (trace->two_sided.object == object || reaches(w, &sight, &trace->two_sided, end.depth)) {
        renderers |= TRUTH_TWO_SIDED;
    }
    uint8_t by_depth = 0;
    if (trace->culling.object != object) {
        by_depth |= renderers & TRUTH_CULLING;
    }
    if (trace->two_sided.object != object) {
        by_depth |= renderers & TRUTH_TWO_SIDED;
    }
    note(w, &sight, &end, by_depth);
    return renderers;
}

typedef struct crew {
    search *s;
    search_item item;
    uint64_t end, chunk; /* items that a worker takes at a time */
    atomic_uint_fast64_t next;
} crew;

typedef struct crew_member {
    crew *c;
    worker *w;
    pthread_t thread;
    bool started;
} crew_member;

static void *work(void *data)
{
    crew_member *m = data;
    crew *c = m->c;
    for (;;) {
        uint64_t first = atomic_fetch_add(&c->next, c->chunk);
        if (first >= c->end) {
            return NULL;
        }
        uint64_t last = first + c->chunk < c->end ? first + c->chunk : c->end;
        for (uint64_t i = first; i < last; ++i) {
            m->w->ray = c->s->phase << 52 | i << 20;
            c->item(m->w, i);
        }
    }
}

static int by_number(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

static void merge_triangles(search *s, worker *w)
{
    if (!reserve((void **)&s->fresh, &s->fresh_capacity, s->fresh_count + w->triangle_count,
                 sizeof(*s->fresh))) {
        s->failed = true;
        return;
    }
    for (size_t i = 0; i < w->triangle_count; ++i) {
        uint64_t number = w->triangles[i];
        uint64_t bit = (uint64_t)1 << (number % 64);
        if (!(s->known[number / 64] & bit)) {
            s->known[number / 64] |= bit;
            s->fresh[s->fresh_count++] = number;
        }
    }
    w->triangle_count = 0;
}

static void merge(search *s)
{
    for (uint32_t i = 0; i < s->worker_count; ++i) {
        worker *w = &s->workers[i];
        for (size_t k = 0; k < w->event_count; ++k) {
            const find_event *e = &w->events[k];
            w->reported[e->object] = 0;
            for (int r = 0; r < 2; ++r) {
                find *f = &s->finds[r][e->object];
                if ((e->what.renderers & 1u << r) == 0 ||
                    (f->ray != NO_RAY && f->ray <= e->what.ray)) {
                    continue;
                }
                uint8_t refuted = f->refuted;
                *f = e->what;
                f->refuted = refuted;
                s->flags[r][e->object] |= FLAG_SEEN;
                s->flags[r][e->object] &= (uint8_t)~FLAG_VERIFIED;
            }
        }
        w->event_count = 0;
        merge_triangles(s, w);
        s->failed |= w->failed;
    }
    if (s->fresh_count) {
        qsort(s->fresh, s->fresh_count, sizeof(*s->fresh), by_number);
    }
}

static uint64_t rays_cast(const search *s)
{
    uint64_t rays = 0;
    for (uint32_t i = 0; i < s->worker_count; ++i) {
        rays += s->workers[i].trace.rays;
    }
    return rays;
}

static void run_block(search *s, search_item item, uint64_t begin, uint64_t end)
{
    crew c = {.s = s, .item = item, .end = end, .chunk = 1 + (end - begin) / 256};
    crew_member members[256];
    atomic_init(&c.next, begin);
    for (uint32_t i = 0; i < s->worker_count; ++i) {
        members[i] = (crew_member){.c = &c, .w = &s->workers[i]};
    }
    /* The caller is the first worker; threads that cannot be had leave it more to do. */
    for (uint32_t i = 1; i < s->worker_count; ++i) {
        members[i].started = pthread_create(&members[i].thread, NULL, work, &members[i]) == 0;
    }
    work(&members[0]);
    for (uint32_t i = 1; i < s->worker_count; ++i) {
        if (members[i].started) {
            pthread_join(members[i].thread, NULL);
        }
    }
}

void search_phase(search *s, search_item item, uint64_t count, bool guided)
{
    ++s->phase;
    for (uint64_t begin = 0; begin < count && !s->failed; begin += BLOCK_ITEMS) {
        if (guided && s->guided >= s->budget) {
            s->spent = true;
            return;
        }
        uint64_t end = begin + BLOCK_ITEMS < count ? begin + BLOCK_ITEMS : count;
        uint64_t before = rays_cast(s);
        run_block(s, item, begin, end);
        merge(s);
        if (guided) {
            s->guided += rays_cast(s) - before;
        }
    }
}

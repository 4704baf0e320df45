/* Timing and scoring. Scoring comes first, outside all clocks, and lets buffers grow. Then rounds: every
 * contestant walks all views once a round, so that whatever else the machine does in a while meets all of
 * them. What counts of a view is its least time. */
#include "contest.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "screen_boxes.h"
#include "yardstick.h"

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a;
    double y = *(const double *)b;
    return (x > y) - (x < y);
}

double contest_median(double *values, uint32_t count)
{
    qsort(values, count, sizeof *values, by_value);
    return count % 2 != 0 ? values[count / 2] : (values[count / 2 - 1] + values[count / 2]) / 2.0;
}

static bool fail(umb_error *error, const char *what, const char *why)
{
    (void)snprintf(error->text, sizeof error->text, "%.150s: %.90s", what, why);
    return false;
}

/* The unit's own state. */
typedef struct yardstick_self {
    const world *world;
    uint8_t *mask;
} yardstick_self;

static uint32_t measure_yardstick(void *self, const umb_view *view, const uint32_t **objects)
{
    yardstick_self *y = self;
    screen_lens lens;
    screen_lens_make(&lens, view, 1, 1);
    yardstick_frustum_pass((const float **)(void *)y->world->box, y->world->box_count,
                           (const float(*)[4])lens.planes, y->mask);
    *objects = NULL;
    return 0;
}

static double count_inside(yardstick_self *y, const cameras *c)
{
    uint64_t inside = 0;
    for (uint32_t v = 0; v < c->count; ++v) {
        const uint32_t *none;
        (void)measure_yardstick(y, &c->views[v], &none);
        for (uint32_t i = 0; i < y->world->box_count; ++i) {
            inside += y->mask[i / 8] >> (i % 8) & 1;
        }
    }
    return (double)inside / c->count;
}

/* Objects that rays saw and a contestant of ours did not: exact arithmetic has the last word, for rays of
 * floats may slip through where surfaces meet. */
static uint64_t confirmed(const world *w, const umb_view *view, const uint32_t *stamp,
                          uint32_t mark, const item_view *truth)
{
    uint64_t wrong = 0;
    uint8_t *hidden = calloc((size_t)w->model->object_count + 1, 1);
    for (uint32_t i = 0; i < truth->count; ++i) {
        bool missed = stamp[truth->items[i].object] != mark;
        wrong += missed;
        if (hidden != NULL) {
            hidden[truth->items[i].object] = missed;
        }
    }
    if (hidden != NULL) {
        uint32_t exact = item_buffer_confirm(w, view, hidden);
        wrong = exact != UINT32_MAX ? exact : wrong;
    }
    free(hidden);
    return wrong;
}

static void score_view(contest_row *row, const world *w, const umb_view *view, uint32_t number,
                       const item_view *truth, const uint32_t *stamp, uint32_t mark)
{
    uint64_t wrong = 0;
    uint32_t worst = row->worst_pixels;
    uint32_t worst_object = row->worst_object;
    for (uint32_t i = 0; i < truth->count; ++i) {
        if (stamp[truth->items[i].object] != mark) {
            ++wrong;
            if (truth->items[i].pixels > worst) {
                worst = truth->items[i].pixels;
                worst_object = truth->items[i].object;
            }
        }
    }
    if (wrong != 0 && row->ours) {
        wrong = confirmed(w, view, stamp, mark, truth);
    }
    row->wrong += wrong;
    if (wrong != 0 && worst > row->worst_pixels) {
        row->worst_pixels = worst;
        row->worst_object = worst_object;
        row->worst_view = number;
    }
}

static bool score(contest_row *row, const entry *e, const world *w, const cameras *c,
                  const item_buffer *truth, uint32_t *stamp, uint32_t *mark)
{
    uint64_t reported = 0;
    for (uint32_t v = 0; v < c->count; ++v) {
        const uint32_t *objects = NULL;
        uint32_t count = e->frame(e->self, &c->views[v], &objects);
        if (count == UINT32_MAX) {
            return false;
        }
        ++*mark;
        for (uint32_t i = 0; i < count; ++i) {
            stamp[objects[i]] = *mark;
        }
        reported += count;
        score_view(row, w, &c->views[v], v, &truth->views[v], stamp, *mark);
    }
    row->reported = (double)reported / c->count;
    return true;
}

static void walk(const entry *e, const cameras *c, double *least)
{
    for (uint32_t v = 0; v < c->count; ++v) {
        const uint32_t *objects;
        double start = world_clock();
        (void)e->frame(e->self, &c->views[v], &objects);
        double spent = world_clock() - start;
        least[v] = spent < least[v] ? spent : least[v];
    }
}

static void finish_row(contest_row *row, const contest *c, double *least, uint32_t count)
{
    row->median_ms = contest_median(least, count);
    row->worst_ms = least[count - 1];
    row->units = row->median_ms / c->unit_ms;
    row->hidden_share = c->in_frustum > 0.0 ? 1.0 - row->reported / c->in_frustum : 0.0;
    row->hidden_share = row->hidden_share < 0.0 ? 0.0 : row->hidden_share;
}

static void relate(contest *out)
{
    double standard = 0.0;
    for (uint32_t i = 0; i < out->row_count; ++i) {
        const contest_row *row = &out->rows[i];
        if (row->standard) {
            standard = row->median_ms;
            out->failed = out->failed || (out->limit > 0.0 && row->units > out->limit);
        }
        out->failed = out->failed || (row->ours && row->wrong != 0);
    }
    for (uint32_t i = 0; i < out->row_count; ++i) {
        out->rows[i].to_ours = standard > 0.0 ? out->rows[i].median_ms / standard : 0.0;
    }
}

static void describe(contest *out, const world *w, const cameras *c, const item_buffer *truth,
                     uint32_t rounds)
{
    double limit = out->limit;
    memset(out, 0, sizeof *out);
    out->limit = limit;
    (void)snprintf(out->world, sizeof out->world, "%s", w->name);
    (void)snprintf(out->spec, sizeof out->spec, "%s", w->spec);
    (void)snprintf(out->cameras, sizeof out->cameras, "%s", c->name);
    (void)snprintf(out->about, sizeof out->about, "%s", c->about);
    out->objects = w->box_count;
    out->occluder_triangles = w->triangle_count;
    out->view_count = c->count;
    out->rounds = rounds;
    out->width = truth->width;
    out->height = truth->height;
    out->exact = truth->mean;
}

static bool measure_all(contest *out, const world *w, const cameras *c, const item_buffer *truth,
                        entry *entries, uint32_t count, uint32_t *stamp, double *least)
{
    yardstick_self self = {w, calloc((size_t)w->box_count / 8 + 64, 1)};
    entry yardstick = {.name = "yardstick", .self = &self, .frame = measure_yardstick};
    uint32_t mark = 0;
    bool ok = self.mask != NULL;
    out->in_frustum = ok ? count_inside(&self, c) : 0.0;
    for (uint32_t i = 0; ok && i < count; ++i) {
        contest_row *row = &out->rows[i];
        (void)snprintf(row->name, sizeof row->name, "%s", entries[i].name);
        row->about = entries[i].about;
        row->ours = entries[i].ours;
        row->standard = entries[i].standard;
        row->charted = row->standard || !row->ours;
        row->apart_ms = entries[i].apart_ms;
        row->apart = entries[i].apart;
        ok = score(row, &entries[i], w, c, truth, stamp, &mark);
    }
    out->row_count = count;
    for (size_t i = 0; i < (size_t)(count + 1) * c->count; ++i) {
        least[i] = HUGE_VAL;
    }
    for (uint32_t round = 0; ok && round < out->rounds; ++round) {
        walk(&yardstick, c, least + (size_t)count * c->count);
        for (uint32_t i = 0; i < count; ++i) {
            walk(&entries[i], c, least + (size_t)i * c->count);
        }
    }
    free(self.mask);
    if (ok) {
        out->unit_ms = contest_median(least + (size_t)count * c->count, c->count);
    }
    for (uint32_t i = 0; ok && i < count; ++i) {
        finish_row(&out->rows[i], out, least + (size_t)i * c->count, c->count);
    }
    return ok;
}

bool contest_run(contest *out, const world *w, const cameras *c, const item_buffer *truth,
                 uint32_t why, uint32_t rounds, umb_error *error)
{
    entry entries[ENTRIES_MOST];
    describe(out, w, c, truth, rounds);
    out->why = why;
    uint32_t count = entries_make(w, why, entries);
    if (count == 0) {
        return fail(error, w->spec, "not enough memory for all contestants");
    }
    uint32_t *stamp = calloc((size_t)w->model->object_count + 1, sizeof *stamp);
    double *least = calloc((size_t)(count + 1) * c->count, sizeof *least);
    bool ok = stamp != NULL && least != NULL &&
              measure_all(out, w, c, truth, entries, count, stamp, least);
    free(stamp);
    free(least);
    entries_free(entries, count);
    if (!ok) {
        return fail(error, w->spec, "a view failed");
    }
    relate(out);
    return true;
}

/* A world of its own whose objects may move. */
typedef struct moving {
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
} moving;

static bool moving_make(moving *m, const world *w, umb_error *error)
{
    m->scene = model_scene(w->model, false, (umb_tasks){0}, NULL, error);
    return m->scene != NULL &&
           umb_index_create(m->scene, &(umb_index_def){.kind = UMB_INDEX_BVH}, &m->index) == UMB_OK &&
           umb_culler_create(m->index, &(umb_culler_def){.method = UMB_METHOD_RASTER},
                             &m->culler) == UMB_OK;
}

/* A place is a decimetre along x from home, or home. */
static bool move_all(const moving *m, const world *w, bool away)
{
    for (uint32_t i = 0; i < w->occluder_count; ++i) {
        uint32_t object = w->box_object[w->occluders[i].box];
        umb_transform t = w->model->objects[object].transform;
        t.m[0][3] += away ? 0.125f : 0.0f;
        if (umb_scene_move_object(m->scene, object, &t, NULL) != UMB_OK) {
            return false;
        }
    }
    return true;
}

static bool moved_frame(contest_row *row, const moving *m, const world *w, const cameras *c,
                        uint32_t v, bool away, const item_buffer *truth, uint32_t *stamp,
                        uint32_t mark, double *commit, double *cull)
{
    umb_visible_set seen;
    double start = world_clock();
    if (!move_all(m, w, away) || umb_scene_commit(m->scene) != UMB_OK) {
        return false;
    }
    double middle = world_clock();
    if (umb_cull(m->culler, &c->views[v], &seen) != UMB_OK) {
        return false;
    }
    double end = world_clock();
    *commit = middle - start < *commit ? middle - start : *commit;
    *cull = end - middle < *cull ? end - middle : *cull;
    if (!away) { /* the truth is of everything at home */
        for (uint32_t i = 0; i < seen.count; ++i) {
            stamp[seen.objects[i]] = mark;
        }
        score_view(row, w, &c->views[v], v, &truth->views[v], stamp, mark);
        row->reported += (double)seen.count;
    }
    return true;
}

bool contest_moved(contest *out, const world *w, const cameras *c, const item_buffer *truth,
                   uint32_t rounds, umb_error *error)
{
    moving m = {0};
    contest_row *row = &out->rows[out->row_count];
    uint32_t *stamp = calloc((size_t)w->model->object_count + 1, sizeof *stamp);
    double *commit = calloc(c->count, sizeof *commit);
    double *cull = calloc(c->count, sizeof *cull);
    bool ok = stamp != NULL && commit != NULL && cull != NULL && out->row_count < ENTRIES_MOST &&
              moving_make(&m, w, error);
    memset(row, 0, sizeof *row);
    (void)snprintf(row->name, sizeof row->name, "umbrage, every occluder moved");
    row->about = "strict";
    row->ours = true;
    row->apart = "moving and commit";
    uint32_t frame = 0;
    uint32_t home = 0;
    for (uint32_t v = 0; ok && v < c->count; ++v) {
        commit[v] = cull[v] = HUGE_VAL;
    }
    for (uint32_t round = 0; ok && round < rounds; ++round) {
        /* Views change places from round to round, and no frame finds everything where it shall be. */
        ok = move_all(&m, w, round % 2 == 0) && umb_scene_commit(m.scene) == UMB_OK;
        for (uint32_t v = 0; ok && v < c->count; ++v) {
            bool away = (v + round) % 2 != 0;
            home += !away;
            ok = moved_frame(row, &m, w, c, v, away, truth, stamp, ++frame, &commit[v], &cull[v]);
        }
    }
    if (ok) {
        row->reported /= home > 0 ? home : 1;
        row->apart_ms = contest_median(commit, c->count);
        finish_row(row, out, cull, c->count);
        ++out->row_count;
        relate(out);
    }
    umb_culler_destroy(m.culler);
    umb_index_destroy(m.index);
    umb_scene_destroy(m.scene);
    free(stamp);
    free(commit);
    free(cull);
    return ok || fail(error, w->spec, "a view of the moved scene failed");
}

/* The search for visible objects: a dense grid, then rays aimed where something may have been
 * missed, in rounds, until a round finds nothing new or the budget is spent. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cover.h"
#include "search.h"

#define DEFAULT_BUDGET 4000000u
#define QUIET_ROUNDS 2u /* rounds without news that end the search */
#define MAX_ROUNDS 64u
#define EXTREMES 9
#define SCANNED_TRIANGLES 4096u
#define ROUND_SHARE                                                                                \
    300000u /* about as many rays aimed in a round, shared by the objects not seen */
#define MAX_VISITS 48u

static uint32_t cast_picture(worker *w, double x, double y)
{
    double p[3];
    oracle_picture_point(&w->s->view, x / w->s->grid_width, y / w->s->grid_height, p);
    return search_cast(w, p) ? w->trace.two_sided.object : MODEL_NONE;
}

static void grid_item(worker *w, uint64_t row)
{
    search *s = w->s;
    for (uint32_t x = 0; x < s->grid_width; ++x) {
        size_t cell = row * s->grid_width + x;
        s->grid[cell] = cast_picture(w, x + 0.5, (double)row + 0.5);
        s->grid_depth[cell] = (float)w->trace.culling.depth;
    }
}

/* The grid again, each ray anywhere in its cell. */
static void jitter_item(worker *w, uint64_t row)
{
    search *s = w->s;
    for (uint32_t x = 0; x < s->grid_width; ++x) {
        uint64_t random = oracle_mix(s->round, row, x);
        cast_picture(w, x + oracle_unit(random),
                     (double)row + oracle_unit(oracle_mix(random, 0, 1)));
    }
}

/* Between two grid rays that met different objects: follow the change down to 1/32 of a cell. */
static void halve_cells(worker *w, const double a[2], const double b[2], uint32_t seen_a,
                        uint32_t seen_b)
{
    double low = 0.0, high = 1.0;
    for (int i = 0; i < 5 && seen_a != seen_b; ++i) {
        double middle = 0.5 * (low + high);
        uint32_t seen = cast_picture(w, a[0] + middle * (b[0] - a[0]),
                                     a[1] + middle * (b[1] - a[1]));
        if (seen == seen_b) {
            high = middle;
        } else {
            low = middle;
            seen_a = seen;
        }
    }
}

static void between_item(worker *w, uint64_t row)
{
    const search *s = w->s;
    for (uint32_t x = 0; x < s->grid_width; ++x) {
        const uint32_t *cell = s->grid + row * s->grid_width + x;
        double here[2] = {x + 0.5, (double)row + 0.5};
        double right[2] = {x + 1.5, (double)row + 0.5}, below[2] = {x + 0.5, (double)row + 1.5};
        if (x + 1 < s->grid_width && cell[0] != cell[1]) {
            halve_cells(w, here, right, cell[0], cell[1]);
        }
        if (row + 1 < s->grid_height && cell[0] != cell[s->grid_width]) {
            halve_cells(w, here, below, cell[0], cell[s->grid_width]);
        }
    }
}

/* A corner of the object that reaches farthest one way in the picture. */
typedef struct extreme {
    double reach;
    uint32_t triangle;
    int corner;
} extreme;

static void find_extremes(const search *s, uint32_t object, extreme best[EXTREMES])
{
    static const double turn[8][2] = {{1, 0}, {-1, 0}, {0, 1},  {0, -1},
                                      {1, 1}, {1, -1}, {-1, 1}, {-1, -1}};
    const truth *t = s->t;
    const umb_view *view = s->view.view;
    uint32_t count = t->model->meshes[t->model->objects[object].mesh].triangle_count;
    uint32_t step = 1 + count / SCANNED_TRIANGLES;
    for (int k = 0; k < EXTREMES; ++k) {
        best[k] = (extreme){-INFINITY, MODEL_NONE, 0};
    }
    for (uint32_t i = 0; i < count; i += step) {
        float v[3][3];
        oracle_triangle(t, object, i, v);
        for (int c = 0; c < 3; ++c) {
            double p[3] = {v[c][0], v[c][1], v[c][2]}, x = 0.0, y = 0.0, depth = 0.0;
            if (!oracle_view_holds(&s->view, p)) {
                continue;
            }
            for (int k = 0; k < 3; ++k) {
                double d = p[k] - view->eye[k];
                x += d * view->right[k];
                y += d * view->up[k];
                depth += d * view->forward[k];
            }
            if (view->projection == UMB_PERSPECTIVE) {
                x /= depth;
                y /= depth;
            }
            for (int k = 0; k < EXTREMES; ++k) {
                double reach = k < 8 ? turn[k][0] * x + turn[k][1] * y : -depth;
                if (reach > best[k].reach) {
                    best[k] = (extreme){reach, i, c};
                }
            }
        }
    }
}

/* Aim at a point of a triangle; true when nothing is left to prove. */
static bool aim(worker *w, uint32_t object, uint32_t triangle, const double p[3], uint8_t *missing)
{
    *missing &= (uint8_t)~search_aim(w, p, object, triangle);
    return *missing == 0;
}

static void aim_at_extremes(worker *w, uint32_t object, uint8_t missing)
{
    extreme best[EXTREMES];
    find_extremes(w->s, object, best);
    for (int k = 0; k < EXTREMES; ++k) {
        float v[3][3];
        double p[3];
        bool again = best[k].triangle == MODEL_NONE;
        for (int j = 0; j < k; ++j) {
            again |= best[j].triangle == best[k].triangle && best[j].corner == best[k].corner;
        }
        if (again) {
            continue;
        }
        oracle_triangle(w->s->t, object, best[k].triangle, v);
        const float *a = v[best[k].corner];
        const float *b = v[(best[k].corner + 1) % 3], *c = v[(best[k].corner + 2) % 3];
        /* The corner itself, then a point a little inside the triangle. */
        for (int inside = 0; inside < 2; ++inside) {
            for (int i = 0; i < 3; ++i) {
                p[i] = a[i] + inside * 1e-3 * (((double)b[i] - a[i]) + ((double)c[i] - a[i]));
            }
            if (aim(w, object, best[k].triangle, p, &missing)) {
                return;
            }
        }
    }
}

static void aim_at_triangles(worker *w, uint32_t object, uint8_t missing)
{
    search *s = w->s;
    uint32_t count = s->t->model->meshes[s->t->model->objects[object].mesh].triangle_count;
    uint32_t visits = ROUND_SHARE / (2 * (s->target_count + 1));
    visits = visits < 4 ? 4 : visits > MAX_VISITS ? MAX_VISITS : visits;
    for (uint32_t k = 0; k < visits; ++k) {
        uint64_t random = oracle_mix(object, s->round, k);
        uint64_t turn = (s->round - 1) * visits + k;
        /* A few triangles: all of them in turn. Many: anywhere. */
        uint32_t triangle = (uint32_t)(count <= 64 ? turn % count : random % count);
        float v[3][3];
        oracle_polygon polygon;
        oracle_triangle(s->t, object, triangle, v);
        oracle_clip(&s->view, v, &polygon);
        if (polygon.count == 0) {
            continue;
        }
        for (uint32_t i = 0; i < 2; ++i) {
            double p[3];
            uint64_t bits = oracle_mix(random, i, 3);
            uint32_t which = i == 0 ? 1 + (uint32_t)(bits % (2 * polygon.count)) : UINT32_MAX;
            if (s->round == 1 && i == 1) {
                which = 0;
            }
            double pull = bits >> 60 & 1 ? 1e-5 : 2e-2;
            oracle_polygon_point(&polygon, which, pull, bits, p);
            if (aim(w, object, triangle, p, &missing)) {
                return;
            }
        }
    }
}

static void target_item(worker *w, uint64_t item)
{
    search *s = w->s;
    uint32_t object = s->targets[item];
    uint8_t known = search_known(s, object);
    uint8_t missing = (uint8_t)~known & (TRUTH_CULLING | TRUTH_TWO_SIDED);
    if (missing == 0) {
        return;
    }
    if (s->round == 1 || s->options->most_targets) {
        aim_at_extremes(w, object, missing);
    }
    aim_at_triangles(w, object, missing);
}

/* Objects worth aiming at: in view and not seen; seen for one renderer only, in the first
 * rounds. */
static void choose_targets(search *s)
{
    const model *m = s->t->model;
    s->target_count = 0;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        if (!s->in_view[i] || (s->options->most_targets && !s->options->accused[i])) {
            continue;
        }
        uint8_t known = search_known(s, i);
        if ((known == 0 || (known != 3 && s->round <= 2))) {
            s->targets[s->target_count++] = i;
        }
    }
    if (s->options->most_targets) {
        search_choose_nearest(s, s->options->most_targets);
    }
}

/* Hand the newly seen triangles to the border phase and make their meshes' neighbours. */
static bool choose_borders(search *s, size_t *count)
{
    uint64_t *list = s->border;
    size_t capacity = s->border_capacity;
    s->border = s->fresh;
    s->border_capacity = s->fresh_capacity;
    *count = s->fresh_count;
    s->fresh = list;
    s->fresh_capacity = capacity;
    s->fresh_count = 0;
    uint32_t object = 0;
    for (size_t i = 0; i < *count; ++i) {
        while (s->t->first_triangle[object + 1] <= s->border[i]) {
            ++object;
        }
        if (!oracle_neighbours(s->t, s->t->model->objects[object].mesh)) {
            return false;
        }
    }
    return true;
}

/* A find that is still a ray's word. */
static bool is_pending(const search *s, int r, uint32_t object)
{
    return (s->flags[r][object] & (FLAG_SEEN | FLAG_VERIFIED)) == FLAG_SEEN;
}

static bool has_leak(const search *s, int r, uint32_t object)
{
    return (s->flags[r][object] & FLAG_LEAK) != 0;
}

/* Items: target * 2 + renderer. Each writes its own object's proof only. */
static void verify_item(worker *w, uint64_t item)
{
    search *s = w->s;
    uint32_t object = s->targets[item / 2];
    int r = (int)(item % 2);
    const find *f = &s->finds[r][object];
    if (is_pending(s, r, object)) {
        oracle_confirm_near(s->t, &s->view, f->through, object, f->triangle, (uint8_t)(1u << r),
                            &s->proven[r][object]);
    }
}

static void settle(search *s, int r, uint32_t object)
{
    find *f = &s->finds[r][object];
    uint8_t *flags = &s->flags[r][object];
    if (!is_pending(s, r, object)) {
        return;
    }
    if (s->proven[r][object].renderers) {
        *flags |= FLAG_VERIFIED;
        ++s->news;
        return;
    }
    if (!has_leak(s, r, object)) {
        s->leaks[r][object] = *f;
        *flags |= FLAG_LEAK;
    }
    ++f->refuted;
    f->ray = NO_RAY;
    *flags &= (uint8_t)~FLAG_SEEN;
}

/* Look into all finds that are not proven yet: prove them, or forget them. */
static void verify(search *s)
{
    s->target_count = 0;
    for (uint32_t i = 0; i < s->t->model->object_count; ++i) {
        if (is_pending(s, 0, i) || is_pending(s, 1, i)) {
            s->targets[s->target_count++] = i;
        }
    }
    search_phase(s, verify_item, 2 * (uint64_t)s->target_count, false);
    for (uint32_t k = 0; k < s->target_count; ++k) {
        settle(s, 0, s->targets[k]);
        settle(s, 1, s->targets[k]);
    }
}

static bool is_accused(const search *s, uint32_t object)
{
    return s->in_view[object] && s->options->accused && s->options->accused[object] &&
           search_known(s, object) == 0;
}

/* Items: target * 2 + renderer. */
static void cover_item(worker *w, uint64_t item)
{
    search *s = w->s;
    uint32_t object = s->targets[item / 2];
    int r = (int)(item % 2);
    find *f = &s->finds[r][object];
    bool asked = item / 2 < s->asked;
    cover_verdict verdict = oracle_cover(s->t, &s->view, object, (uint8_t)(1u << r),
                                         asked ? COVER_ASKED : COVER_ACCUSED, &s->proven[r][object]);
    s->verdicts[item] = (uint8_t)verdict;
    if (verdict == COVER_HIDDEN) {
        if (has_leak(s, r, object)) {
            s->flags[r][object] |= FLAG_WITHDRAWN;
        }
        s->flags[r][object] &= (uint8_t)~FLAG_LEAK;
    } else if (verdict == COVER_SEEN) {
        f->ray = s->phase << 52 | item;
        s->flags[r][object] |= FLAG_SEEN | FLAG_VERIFIED;
    }
}

static void add_accused(search *s, bool suspected)
{
    for (uint32_t i = 0; i < s->t->model->object_count; ++i) {
        bool leaked = has_leak(s, 0, i) || has_leak(s, 1, i);
        if (leaked == suspected && is_accused(s, i)) {
            s->targets[s->target_count++] = i;
        }
    }
}

/* Decide exactly what rays of floats only suspect and, where asked for, those of the other hidden
 * objects that are nearest to being seen. */
static void decide(search *s, truth_result *out)
{
    s->target_count = 0;
    if (s->options->most_decided) {
        add_accused(s, false);
        search_choose_nearest(s, s->options->most_decided);
    }
    s->asked = s->target_count;
    add_accused(s, true);
    s->verdicts = calloc(2 * (size_t)s->target_count + 1, 1);
    if (!s->verdicts) {
        s->failed = true;
        return;
    }
    search_phase(s, cover_item, 2 * (uint64_t)s->target_count, false);
    for (uint32_t k = 0; k < s->target_count; ++k) {
        cover_verdict a = s->verdicts[2 * k], b = s->verdicts[2 * k + 1];
        out->decided_hidden += a == COVER_HIDDEN && b == COVER_HIDDEN;
        out->undecided += a != COVER_SEEN && b != COVER_SEEN && (a == COVER_OPEN || b == COVER_OPEN);
    }
}

static void rounds(search *s)
{
    uint32_t quiet = 0;
    for (s->round = 1; s->round <= MAX_ROUNDS && !s->failed && !s->spent; ++s->round) {
        size_t borders;
        s->news = 0;
        if (!choose_borders(s, &borders)) {
            s->failed = true;
            return;
        }
        search_phase(s, border_item, borders, true);
        verify(s);
        choose_targets(s);
        search_phase(s, target_item, s->target_count, true);
        search_phase(s, jitter_item, s->grid_height, true);
        verify(s);
        quiet = s->news == 0 ? quiet + 1 : 0;
        if (quiet == QUIET_ROUNDS) {
            return;
        }
    }
    --s->round;
}

static bool search_make(search *s)
{
    const truth *t = s->t;
    size_t objects = t->model->object_count;
    uint64_t triangles = t->first_triangle[objects];
    s->in_view = calloc(objects + 1, 1);
    s->near = calloc(objects + 1, 1);
    s->targets = calloc(objects + 1, sizeof(*s->targets));
    s->known = calloc((size_t)(triangles / 64 + 1), sizeof(*s->known));
    s->grid = calloc((size_t)s->grid_width * s->grid_height, sizeof(*s->grid));
    s->workers = calloc(s->worker_count, sizeof(*s->workers));
    s->grid_depth = calloc((size_t)s->grid_width * s->grid_height, sizeof(*s->grid_depth));
    bool ok = s->in_view && s->near && s->targets && s->known && s->grid && s->grid_depth && s->workers;
    for (int r = 0; r < 2; ++r) {
        s->finds[r] = calloc(objects + 1, sizeof(*s->finds[r]));
        s->proven[r] = calloc(objects + 1, sizeof(*s->proven[r]));
        s->leaks[r] = calloc(objects + 1, sizeof(*s->leaks[r]));
        s->flags[r] = calloc(objects + 1, 1);
        ok = ok && s->finds[r] && s->proven[r] && s->leaks[r] && s->flags[r];
    }
    for (uint32_t i = 0; ok && i < s->worker_count; ++i) {
        s->workers[i].s = s;
        s->workers[i].reported = calloc(objects + 1, 1);
        ok = s->workers[i].reported != NULL;
    }
    for (size_t i = 0; ok && i < objects; ++i) {
        const model_object *o = &t->model->objects[i];
        s->in_view[i] = o->mesh != MODEL_NONE && t->model->meshes[o->mesh].triangle_count > 0 &&
                        oracle_view_meets_box(&s->view, &o->bounds);
    }
    return ok;
}

static void search_free(search *s)
{
    for (uint32_t i = 0; s->workers && i < s->worker_count; ++i) {
        free(s->workers[i].reported);
        free(s->workers[i].events);
        free(s->workers[i].triangles);
        free(s->workers[i].trace.open);
    }
    for (int r = 0; r < 2; ++r) {
        free(s->finds[r]);
        free(s->proven[r]);
        free(s->leaks[r]);
        free(s->flags[r]);
    }
    free(s->workers);
    free(s->in_view);
    free(s->near);
    free(s->targets);
    free(s->known);
    free(s->fresh);
    free(s->border);
    free(s->grid);
    free(s->grid_depth);
    free(s->verdicts);
}

/* Proven witnesses; for accused objects that have none for either renderer, the unproven ones. */
static void fill_witnesses(const search *s, truth_result *out)
{
    truth_witness *lists[2] = {out->culling, out->two_sided};
    uint32_t *counts[2] = {&out->visible_culling, &out->visible_two_sided};
    for (uint32_t i = 0; i < s->t->model->object_count; ++i) {
        if (!s->in_view[i]) {
            continue;
        }
        ++out->in_view;
        bool seen = search_known(s, i) != 0, leaked = false, refuted = false;
        out->visible += seen;
        for (int r = 0; r < 2; ++r) {
            const find *leak = &s->leaks[r][i];
            truth_witness *w = &lists[r][i];
            if ((s->flags[r][i] & FLAG_SEEN) != 0) {
                *w = s->proven[r][i];
                ++*counts[r];
            } else if (is_accused(s, i) && has_leak(s, r, i)) {
                memcpy(w->from, leak->from, sizeof(w->from));
                memcpy(w->to, leak->to, sizeof(w->to));
                w->renderers = (uint8_t)(1u << r);
                leaked = true;
            }
            refuted = refuted || (s->flags[r][i] & FLAG_WITHDRAWN) != 0;
        }
        out->unconfirmed += leaked;
        out->withdrawn += refuted && !leaked && !seen;
    }
}

static bool fill_result(const search *s, truth_result *out)
{
    uint32_t objects = s->t->model->object_count;
    out->culling = calloc((size_t)objects + 1, sizeof(*out->culling));
    out->two_sided = calloc((size_t)objects + 1, sizeof(*out->two_sided));
    if (!out->culling || !out->two_sided) {
        return false;
    }
    fill_witnesses(s, out);
    for (uint32_t i = 0; i < s->worker_count; ++i) {
        out->rays += s->workers[i].trace.rays;
    }
    out->rounds = (uint32_t)s->round;
    out->budget_spent = s->spent;
    return true;
}

bool truth_view(truth *t, const umb_view *view, const truth_options *options, truth_result *out,
                umb_error *error)
{
    truth_options none = {0};
    options = options ? options : &none;
    search s = {.t = t, .options = options};
    memset(out, 0, sizeof(*out));
    oracle_view_make(t, view, options, &s.view);
    bool given = options->grid_width && options->grid_height;
    s.grid_width = given ? options->grid_width : view->width ? view->width : 1024;
    s.grid_height = given ? options->grid_height : view->height ? view->height : 512;
    s.budget = options->guided_rays ? options->guided_rays : DEFAULT_BUDGET;
    s.worker_count = options->threads ? options->threads : 1;
    s.worker_count = s.worker_count < 256 ? s.worker_count : 256;
    bool ok = search_make(&s);
    if (ok) {
        search_phase(&s, grid_item, s.grid_height, false);
        search_phase(&s, between_item, s.grid_height, true);
        verify(&s);
        rounds(&s);
        decide(&s, out);
        ok = !s.failed && fill_result(&s, out);
    }
    search_free(&s);
    if (!ok) {
        truth_result_free(out);
        if (error) {
            error->code = UMB_ERROR_MEMORY;
            snprintf(error->text, sizeof(error->text),
                     "truth: not enough memory for a search of %u objects; try a smaller scene",
                     t->model->object_count);
        }
    }
    return ok;
}

void truth_result_free(truth_result *r)
{
    free(r->culling);
    free(r->two_sided);
    memset(r, 0, sizeof(*r));
}

/* Occlusion maps, each of their promises by itself against lines sampled densely: what a pixel's interval says is
 * blocked is blocked by what was drawn; what a pixel does not hold is not called hidden; every line is somewhere. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/ray_bodies.h"

static uint32_t times(uint32_t small)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size == NULL ? 4 * small : size[0] == 's' ? small : 40 * small;
}

/* ---- maps and their lines ----------------------------------------------------------------------- */

typedef struct world {
    umb_allocator allocator;
    umb_ray_frame frame;
    umb_ray_map map;
    const umb_umbra_kernels *kernels;
    ray_body bodies[8];
    uint32_t count;
    bool half;
    double ground; /* -INFINITY: none */
} world;

/* An empty map of one of the kinds, over a cell of any size. */
static void open_world(dice *d, world *w)
{
    static const double outers[] = {1.2, 2.0, 8.0};
    *w = (world){.allocator = umb_memory_allocator(NULL), .kernels = umb_umbra_kernels_get(UMB_ISA_AUTO), .ground = -INFINITY};
    umb_ray_kind kind = (umb_ray_kind)(dice_roll(d, 2) == 0 ? 0 : dice_roll(d, 3));
    double size = dice_roll(d, 8) == 0 ? 1e-3 : 1.0;
    w->frame = (umb_ray_frame){.hu = size * dice_between(d, 0.1, 3), .hv = size * dice_between(d, 0.1, 3), .axis_v = 1, .axis_z = 2,
                               .sign = 1.0, .error = 1e-13, .steep = INFINITY};
    w->frame.z0 = -dice_between(d, 0, 2);
    w->frame.z1 = w->frame.z0 + (dice_roll(d, 5) == 0 ? 0.0 : dice_between(d, 0, 3));
    w->frame.steep = kind == UMB_RAY_SLAB && dice_roll(d, 2) == 0 ? 1.0f : INFINITY;
    w->half = w->frame.steep != 1.0f && dice_roll(d, 6) == 0;
    umb_ray_layout layout = {kind, outers[dice_roll(d, 3)], 8, 64 * (1 + dice_roll(d, 3)), w->half ? 1 : 1 + dice_roll(d, 4)};
    layout.rows = 8 * (1 + dice_roll(d, 4));
    assert_int_equal(umb_ray_map_begin(&w->map, &w->allocator, &w->frame, &layout), UMB_OK);
}

static void close_world(world *w)
{
    umb_ray_map_free(&w->map, &w->allocator);
}

typedef struct line {
    double s, t;
    uint32_t tile, pixel;
    float ua, ub; /* the cell, for all that is compared there */
} line;

static line line_at(const umb_ray_map *m, double s, double t, uint32_t row, uint32_t column)
{
    uint32_t i = row / UMB_TILE, j = column / UMB_TILE;
    const float *span = m->spans[i * (m->columns / UMB_TILE) + j / UMB_TILE];
    return (line){s, t, i * m->columns + j, row % UMB_TILE * UMB_TILE + column % UMB_TILE, span[0], span[1]};
}

/* Somewhere in a pixel, every other time at a corner. */
static line draw_line(dice *d, const umb_ray_map *m, uint32_t row, uint32_t column)
{
    static const double ends[2] = {1e-9, 1.0 - 1e-9};
    bool corner = dice_roll(d, 2) == 0;
    double x = corner ? ends[dice_roll(d, 2)] : dice_between(d, 0, 1), y = corner ? ends[dice_roll(d, 2)] : dice_between(d, 0, 1);
    return line_at(m, m->s0 + (row + x) * m->ds, m->t0 + (column + y) * m->dt, row, column);
}

static double v_at(const umb_ray_map *m, const line *l, double u)
{
    return (m->alpha0 + m->alpha1 * u) * l->s + (m->beta0 + m->beta1 * u) * l->t;
}

/* The map's line through two points; false if it is not one of its live ones. */
static bool line_through(const umb_ray_map *m, const umb_ray_point *a, const umb_ray_point *b, line *out)
{
    if (!(b->u > a->u)) {
        return false;
    }
    double slope = (b->v - a->v) / (b->u - a->u), at0 = a->v - slope * a->u;
    double ui = -m->beta0 / m->beta1, uo = ui + 1.0 / m->beta1;
    double s = m->alpha1 == 0.0 ? at0 : at0 + slope * ui, t = m->alpha1 == 0.0 ? slope : at0 + slope * uo;
    double row = floor((s - m->s0) / m->ds), column = floor((t - m->t0) / m->dt);
    if (!(row >= 0.0 && column >= 0.0 && row < m->rows * UMB_TILE && column < m->columns * UMB_TILE)) {
        return false;
    }
    *out = line_at(m, s, t, (uint32_t)row, (uint32_t)column);
    return (m->live[out->tile] >> out->pixel & 1) != 0;
}

/* What all lines of a neighbourhood take the cell for holds it in the slice of each. */
static void check_span(const umb_ray_map *m, const line *l)
{
    const umb_ray_frame *f = m->frame;
    double at0 = v_at(m, l, 0.0), slope = m->alpha1 * l->s + m->beta1 * l->t, low = -f->hu, high = f->hu;
    if (slope != 0.0) {
        double a = (-f->hv - at0) / slope, b = (f->hv - at0) / slope;
        low = fmax(low, fmin(a, b));
        high = fmin(high, fmax(a, b));
    }
    if (low <= high) {
        assert_true(l->ua <= low && l->ub >= high);
    }
}

/* Least and greatest slope to a point in front of the cell. */
static double least_slope(const world *w, const line *l, const umb_ray_point *p)
{
    double up = p->z - w->frame.z1;
    return fmin(up / (p->u - l->ua), up / (p->u - l->ub));
}

static double greatest_slope(const world *w, const line *l, const umb_ray_point *p)
{
    double rise = p->z - w->frame.z0;
    return fmax(rise / (p->u - l->ua), rise / (p->u - l->ub));
}

/* Surely below. */
static float below(double x)
{
    float y = (float)x;
    return nextafterf(y < x ? y : nextafterf(y, -INFINITY), -INFINITY);
}

/* ---- what was drawn blocks ------------------------------------------------------------------------ */

static void draw_bodies(dice *d, world *w)
{
    const umb_ray_frame *f = &w->frame;
    double size = f->hu + f->hv;
    ray_place place = {f->hu * 1.001 + 1e-6, size * 0.3, size * (dice_roll(d, 2) == 0 ? 10.0 : 200.0), dice_roll(d, 3) == 0 ? 0.1 : 0.7};
    bool stand = w->half || dice_roll(d, 3) == 0;
    w->count = 1 + dice_roll(d, dice_roll(d, 2) == 0 ? 1 : 7);
    w->ground = stand ? f->z0 - dice_between(d, 0, 1) : -INFINITY;
    for (uint32_t i = 0; i < w->count; ++i) {
        ray_body_draw(d, &place, &w->bodies[i]);
        if (stand && (w->half || dice_roll(d, 2) == 0)) {
            ray_body_stand(&w->bodies[i], w->ground);
        }
        for (uint32_t k = 0; k < w->bodies[i].blocker.count && stand; ++k) {
            umb_ray_point *p = &w->bodies[i].blocker.vertices[k];
            w->bodies[i].blocker.on_floor[k] = p->z <= w->ground;
        }
        w->bodies[i].blocker.floor = stand;
        umb_ray_map_block(&w->map, w->kernels, &w->bodies[i].blocker, w->half);
    }
}

static bool is_blocked(const world *w, const umb_ray_point *from, const umb_ray_point *to)
{
    for (uint32_t i = 0; i < w->count; ++i) {
        if (ray_body_meets(&w->bodies[i], from, to)) {
            return true;
        }
    }
    return false;
}

/* A sight-line on a line of the map to what an interval just holds: false if it holds nothing there. */
static bool draw_held(dice *d, const world *w, const line *l, const umb_umbra_tile *t, umb_ray_point *from, umb_ray_point *to)
{
    const umb_ray_frame *f = &w->frame;
    static const double further[4] = {0.0, 1e-6, 0.5, 20.0};
    uint32_t corner = dice_roll(d, 8), end = dice_roll(d, 3), pixel = l->pixel;
    from->u = corner < 4 ? ((corner & 1) != 0 ? l->ua : l->ub) : dice_between(d, l->ua, l->ub);
    from->z = corner < 4 ? ((corner & 2) != 0 ? f->z0 : f->z1) : dice_between(d, f->z0, f->z1);
    to->u = t->depth[pixel] + further[dice_roll(d, 4)] * fabs((double)t->depth[pixel]);
    double a = to->u - l->ua, b = to->u - l->ub, far = to->u - from->u;
    double high = f->z1 + (t->top[pixel] >= 0.0f ? t->top[pixel] * a : t->top[pixel] * b);
    double low = f->z0 + (t->bottom[pixel] >= 0.0f ? t->bottom[pixel] * b : t->bottom[pixel] * a);
    high = fmin(high, from->z + f->steep * far);
    low = fmax(fmax(low, w->ground), from->z - f->steep * far);
    if (!(b > 0.0) || !(low <= high)) {
        return false;
    }
    to->z = end == 0 ? low : end == 1 ? high : dice_between(d, low, high);
    from->v = v_at(&w->map, l, from->u);
    to->v = v_at(&w->map, l, to->u);
    return true;
}

/* Every line that the intervals of a pixel hold is blocked. */
static uint32_t check_pixel(dice *d, const world *w, uint32_t row, uint32_t column)
{
    const umb_ray_map *m = &w->map;
    uint32_t held = 0;
    line l = draw_line(d, m, row, column);
    check_span(m, &l);
    if (!m->drawn[l.tile] || (m->live[l.tile] >> l.pixel & 1) == 0) {
        return 0;
    }
    const umb_umbra_tile *tiles = &m->intervals[(size_t)l.tile * m->umbrae];
    const umb_umbra_summary *s = &m->summaries[l.tile];
    assert_true(s->top <= tiles->top[l.pixel] && s->bottom >= tiles->bottom[l.pixel] && s->depth >= tiles->depth[l.pixel]);
    for (uint32_t k = 0; k < m->umbrae; ++k) {
        umb_ray_point from, to;
        if (tiles[k].top[l.pixel] > -INFINITY && draw_held(d, w, &l, &tiles[k], &from, &to)) {
            held += 1;
            assert_true(is_blocked(w, &from, &to));
        }
    }
    return held;
}

static void test_drawing(void **state)
{
    (void)state;
    dice d = {51};
    uint32_t held = 0, worlds = times(1500);
    for (uint32_t i = 0; i < worlds; ++i) {
        world w;
        open_world(&d, &w);
        draw_bodies(&d, &w);
        uint32_t rows = w.map.rows * UMB_TILE, columns = w.map.columns * UMB_TILE;
        for (uint32_t n = 0; n < 2 * rows * columns; ++n) {
            held += check_pixel(&d, &w, n / columns % rows, n % columns);
        }
        close_world(&w);
    }
    assert_true(held > 100 * worlds);
}

/* ---- joining --------------------------------------------------------------------------------------- */

/* An upright piece of a slice, and its interval. */
typedef struct piece {
    umb_ray_point bottom, top;
} piece;

static piece draw_piece(dice *d, const world *w, double reach)
{
    umb_ray_point p = {w->frame.hu + dice_between(d, 0.02, 1) * reach, 0, dice_between(d, -0.7, 0.5) * reach};
    piece x = {p, p};
    x.top.u += dice_between(d, -0.01, 0.2) * reach;
    x.top.z += dice_between(d, -0.05, 0.7) * reach;
    return x;
}

static void fill_piece(const world *w, const line *l, const piece *p, umb_umbra_tile *tiles, uint32_t umbrae)
{
    umb_umbra_strip s = {.top = below(least_slope(w, l, &p->top)), .top_far = below(greatest_slope(w, l, &p->top)),
                         .bottom = -below(-greatest_slope(w, l, &p->bottom)), .bottom_far = -below(-least_slope(w, l, &p->bottom)),
                         .depth = -below(-fmax(p->top.u, p->bottom.u)), .steep = w->frame.steep};
    for (int r = 0; r < UMB_TILE; ++r) {
        s.to[r] = UMB_TILE;
    }
    (void)w->kernels->fill(tiles, umbrae, &s, false);
}

/* From one side of the way to the other. */
static bool is_passed(const piece *p, uint32_t count, const umb_ray_point *from, const umb_ray_point *to)
{
    for (uint32_t i = 0; i < count; ++i) {
        double a = (to->u - from->u) * (p[i].bottom.z - from->z) - (to->z - from->z) * (p[i].bottom.u - from->u);
        double b = (to->u - from->u) * (p[i].top.z - from->z) - (to->z - from->z) * (p[i].top.u - from->u);
        if (a <= 0.0 && b >= 0.0) {
            return false;
        }
    }
    return true;
}

/* T3, in one slice: whatever intervals are made of others, what they hold is blocked by some piece. */
static void test_joining(void **state)
{
    (void)state;
    dice d = {54};
    uint32_t held = 0, slices = times(40000);
    for (uint32_t i = 0; i < slices; ++i) {
        world w = {.kernels = umb_umbra_kernels_get(UMB_ISA_AUTO), .ground = -INFINITY};
        w.frame = (umb_ray_frame){.hu = dice_between(&d, 0.1, 1), .z0 = -dice_between(&d, 0, 1), .z1 = dice_between(&d, 0, 1), .steep = INFINITY};
        w.map = (umb_ray_map){.frame = &w.frame};
        w.frame.steep = dice_roll(&d, 2) == 0 ? 1.0f : INFINITY;
        line l = {.ua = -(float)w.frame.hu, .ub = (float)w.frame.hu};
        umb_umbra_tile tiles[3];
        piece pieces[8];
        uint32_t umbrae = 1 + dice_roll(&d, 3), count = 2 + dice_roll(&d, 4);
        double reach = dice_between(&d, 0.5, 6);
        umb_umbra_clear(tiles, umbrae, UINT64_MAX);
        for (uint32_t k = 0; k < count; ++k) {
            pieces[k] = draw_piece(&d, &w, reach);
            fill_piece(&w, &l, &pieces[k], tiles, umbrae);
        }
        for (uint32_t n = 0; n < 12 * umbrae; ++n) {
            umb_ray_point from, to;
            if (tiles[n % umbrae].top[0] > -INFINITY && draw_held(&d, &w, &l, &tiles[n % umbrae], &from, &to)) {
                held += 1;
                assert_false(is_passed(pieces, count, &from, &to));
            }
        }
    }
    assert_true(held > slices);
}

/* ---- what is not held is not hidden --------------------------------------------------------------- */

/* All pixels hold everything, at any depth. */
static void hold_all(world *w)
{
    umb_ray_map *m = &w->map;
    for (uint32_t i = 0; i < m->rows * m->columns * m->umbrae; ++i) {
        umb_umbra_tile *t = &m->intervals[i];
        for (uint32_t k = 0; k < 64; ++k) {
            bool first = i % m->umbrae == 0;
            t->top[k] = t->top_far[k] = first ? UMB_UMBRA_ENDLESS : -INFINITY;
            t->bottom[k] = t->bottom_far[k] = first ? -UMB_UMBRA_ENDLESS : INFINITY;
            t->depth[k] = first ? -UMB_UMBRA_ENDLESS : INFINITY;
        }
    }
    for (uint32_t i = 0; i < m->rows * m->columns; ++i) {
        m->drawn[i] = true;
        m->summaries[i] = (umb_umbra_summary){UMB_UMBRA_ENDLESS, -UMB_UMBRA_ENDLESS, -UMB_UMBRA_ENDLESS};
    }
    memset(m->stale, 1, m->rows / m->group_rows * (m->columns / UMB_TILE) * sizeof *m->stale);
}

/* One interval that holds everything but a point, which lies just above it, just below it or just before it: which 0, 1, 2; or that
 * holds nothing, 3. */
static void set_short(const world *w, const line *l, const umb_ray_point *p, uint32_t which, umb_umbra_tile *t)
{
    uint32_t k = l->pixel;
    t->top[k] = UMB_UMBRA_ENDLESS;
    t->bottom[k] = t->depth[k] = -UMB_UMBRA_ENDLESS;
    if (p->u > l->ub && which == 0) {
        t->top[k] = below(least_slope(w, l, p));
    } else if (p->u > l->ub && which == 1) {
        t->bottom[k] = -below(-greatest_slope(w, l, p));
    } else if (p->u > l->ub && which == 2) {
        t->depth[k] = -below(-p->u);
    } else if (p->u > l->ub) {
        t->top[k] = -INFINITY;
        t->bottom[k] = t->depth[k] = INFINITY;
    }
}

/* The pixel of a line lacks a point on it, in a way of its own in each interval. What lies beside the cell needs none: it is
 * never hidden. */
static void lack(dice *d, world *w, const line *l, const umb_ray_point *p)
{
    umb_ray_map *m = &w->map;
    umb_umbra_tile *t = &m->intervals[(size_t)l->tile * m->umbrae];
    umb_umbra_summary *s = &m->summaries[l->tile];
    for (uint32_t k = 0; k < m->umbrae; ++k) {
        set_short(w, l, p, dice_roll(d, 4), &t[k]);
    }
    *s = (umb_umbra_summary){t->top[l->pixel], t->bottom[l->pixel], t->depth[l->pixel]};
    memset(m->stale, 1, m->rows / m->group_rows * (m->columns / UMB_TILE) * sizeof *m->stale);
}

/* What is asked about: a box with any three edges, some of them without a length; in order: four corners that have all
 * coordinates of an upright one. */
typedef struct thing {
    umb_ray_point points[8];
    uint32_t count;
    bool in_order;
} thing;

static void draw_upright(dice *d, const umb_ray_point *at, const double size[3], thing *out)
{
    out->count = 4;
    out->in_order = true;
    for (uint32_t i = 0; i < 4; ++i) {
        out->points[i] = (umb_ray_point){at->u + (i == 0 || i == 3 ? 0.0 : size[0]), at->v + (i < 2 ? 0.0 : size[1]),
                                         at->z + ((i & 1) != 0 ? 0.0 : size[2])};
    }
    (void)d;
}

static void draw_slanted(dice *d, const umb_ray_point *at, const double size[3], thing *out)
{
    umb_ray_point axes[3];
    out->count = 8;
    out->in_order = false;
    for (int a = 0; a < 3; ++a) {
        axes[a] = (umb_ray_point){size[a] * dice_between(d, -1, 1), size[a] * dice_between(d, -1, 1), size[a] * dice_between(d, -1, 1)};
    }
    for (int c = 0; c < 8; ++c) {
        out->points[c] = *at;
        for (int a = 0; a < 3; ++a) {
            double x = (c >> a & 1) != 0 ? 1.0 : 0.0;
            out->points[c].u += x * axes[a].u;
            out->points[c].v += x * axes[a].v;
            out->points[c].z += x * axes[a].z;
        }
    }
}

static void draw_thing(dice *d, const world *w, thing *out)
{
    const umb_ray_frame *f = &w->frame;
    double unit = f->hu + f->hv, far = unit * exp(dice_between(d, log(0.1), log(300.0))), size[3];
    for (int k = 0; k < 3; ++k) {
        size[k] = dice_roll(d, 4) == 0 ? 0.0 : far * exp(dice_between(d, log(1e-3), 0.0));
    }
    umb_ray_point at = {far - dice_between(d, 0, 0.5) * size[0], far * dice_between(d, -1.2, 1.2), far * dice_between(d, -1.2, 1.2)};
    if (dice_roll(d, 2) == 0) {
        draw_upright(d, &at, size, out);
    } else {
        draw_slanted(d, &at, size, out);
    }
}

/* A point of it: a corner, or between corners. Of an upright one any heights go with any place. */
static umb_ray_point point_of(dice *d, const thing *t)
{
    umb_ray_point p = t->points[dice_roll(d, t->count)];
    uint32_t steps = dice_roll(d, 3);
    for (uint32_t n = 0; n < steps; ++n) {
        const umb_ray_point *q = &t->points[dice_roll(d, t->count)];
        double x = dice_between(d, 0, 1);
        p = (umb_ray_point){p.u + x * (q->u - p.u), p.v + x * (q->v - p.v), p.z + x * (q->z - p.z)};
    }
    p.z = t->in_order ? t->points[dice_roll(d, 2)].z : p.z;
    return p;
}

static umb_ray_point point_of_cell(dice *d, const umb_ray_frame *f)
{
    uint32_t corner = dice_roll(d, 2);
    double x[3];
    for (int k = 0; k < 3; ++k) {
        x[k] = corner != 0 || dice_roll(d, 3) == 0 ? (double)dice_roll(d, 2) : dice_between(d, 0, 1);
    }
    return (umb_ray_point){f->hu * (2.0 * x[0] - 1.0), f->hv * (2.0 * x[1] - 1.0), f->z0 + x[2] * (f->z1 - f->z0)};
}

/* No farther than rays as steep as they get reach it from the point of the cell: of a box that lies above or below. */
static void pull_in(const umb_ray_frame *f, const thing *t, const umb_ray_point *from, umb_ray_point *p)
{
    double u = from->u + fabs(p->z - from->z) * (1.0 + 1e-12), low = fmin(t->points[0].u, t->points[1].u);
    double high = fmax(t->points[0].u, t->points[1].u);
    p->u = t->in_order && f->steep == 1.0f ? fmin(fmax(u, low), high) : p->u;
}

static uint32_t ask(dice *d, world *w, const thing *t, const umb_ray_shape *shape)
{
    umb_ray_map *m = &w->map;
    umb_ray_point from = point_of_cell(d, &w->frame), to = point_of(d, t);
    line l;
    uint32_t tile;
    if (dice_roll(d, 2) == 0) {
        pull_in(&w->frame, t, &from, &to);
    }
    if (!line_through(m, &from, &to, &l) || fabs(to.z - from.z) > w->frame.steep * (to.u - from.u)) {
        return 0;
    }
    assert_true(umb_ray_map_meets(m, shape));
    hold_all(w);
    lack(d, w, &l, &to);
    assert_false(umb_ray_map_hides(m, w->kernels, shape, &tile));
    assert_false(umb_ray_map_tile_hides(m, w->kernels, shape, l.tile));
    return 1;
}

static void test_asking(void **state)
{
    (void)state;
    dice d = {52};
    uint32_t asked = 0, hidden = 0, worlds = times(300);
    for (uint32_t i = 0; i < worlds; ++i) {
        world w;
        open_world(&d, &w);
        for (uint32_t n = 0; n < 20; ++n) {
            thing t;
            umb_ray_shape shape;
            uint32_t tile;
            draw_thing(&d, &w, &t);
            bool front = umb_ray_shape_measure(&w.frame, t.points, t.count, &shape);
            front = front && umb_ray_shape_outline(&w.frame, t.points, t.count, t.in_order, &shape);
            hold_all(&w);
            hidden += front && umb_ray_map_hides(&w.map, w.kernels, &shape, &tile) ? 1 : 0;
            for (uint32_t k = 0; k < 12 && front; ++k) {
                asked += ask(&d, &w, &t, &shape);
            }
        }
        close_world(&w);
    }
    assert_true(asked > 20 * worlds && hidden > 5 * worlds);
}

/* Nothing is closed while a pixel lacks a point that is as far away as is asked. */
static void test_closed(void **state)
{
    (void)state;
    dice d = {53};
    uint32_t asked = 0, closed = 0, worlds = times(300);
    for (uint32_t i = 0; i < worlds; ++i) {
        world w;
        open_world(&d, &w);
        const umb_ray_frame *f = &w.frame;
        for (uint32_t n = 0; n < 40; ++n) {
            double gap = (f->hu + f->hv) * exp(dice_between(&d, log(0.1), log(100.0))), low = f->z0 - dice_between(&d, 0, 2) * gap;
            double high = f->z1 + dice_between(&d, 0, 2) * gap;
            bool front = dice_roll(&d, 2) == 0;
            umb_ray_point from = point_of_cell(&d, f), to = {f->hu + gap, f->hv + gap, dice_roll(&d, 2) == 0 ? low : high};
            to.v = front ? to.v * dice_between(&d, -2, 2) : dice_roll(&d, 2) == 0 ? to.v : -to.v;
            to.u = front ? to.u : from.u + fabs(to.v - from.v) * exp(dice_between(&d, -2, 2));
            line l;
            if (!line_through(&w.map, &from, &to, &l) || fabs(to.z - from.z) > f->steep * (to.u - from.u)) {
                continue;
            }
            hold_all(&w);
            closed += umb_ray_map_closed(&w.map, low, high, gap) ? 1 : 0;
            lack(&d, &w, &l, &to);
            assert_false(umb_ray_map_closed(&w.map, low, high, gap));
            asked += 1;
        }
        close_world(&w);
    }
    assert_true(asked > 5 * worlds && closed > worlds);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_drawing), cmocka_unit_test(test_joining),
                                       cmocka_unit_test(test_asking), cmocka_unit_test(test_closed)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

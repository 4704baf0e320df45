#include "ray_far.h"

#include <math.h>
#include <string.h>

#include "ray_chains.h"

/* What is nearer than so many times the cell's size changes its place in the map from row to row. */
#define FAR 4.0
/* Of a pixel: what doubles lose in a place of the map is far less. */
#define PIXEL_SLACK 0x1p-16

/* Where along t a vertex is, by s: at + s slope. */
typedef struct place {
    double at, slope;
} place;

typedef struct drawing {
    umb_ray_map *map;
    const umb_umbra_kernels *kernels;
    bool half;
    place low[2], high[2]; /* lines with t above low and below high go through the occluder */
    umb_umbra_strip strip;
    uint32_t from[UMB_TILE], to[UMB_TILE]; /* pixels of each row of a row of tiles; from > to: none */
} drawing;

static void bounds_over(const umb_ray_map *m, const umb_ray_blocker *b, const umb_ray_chains *c, bool floor,
                        umb_umbra_strip *s, double *loss)
{
    const umb_ray_frame *f = m->frame;
    float ua = umb_float_below((float)-f->hu), ub = umb_float_above((float)f->hu);
    float top_most = -INFINITY, bottom_least = INFINITY;
    *s = (umb_umbra_strip){.top = INFINITY, .top_far = INFINITY, .bottom_far = -INFINITY, .bottom = -INFINITY};
    umb_umbra_vertex x;
    for (uint32_t i = 0; i < c->top_count; ++i) {
        umb_ray_bound_vertex(m, &b->vertices[c->top[i]], ua, ub, 0.0f, &x);
        s->top = fminf(s->top, x.top);
        s->top_far = fminf(s->top_far, x.top_far);
        top_most = fmaxf(top_most, x.top);
    }
    for (uint32_t i = 0; i < c->bottom_count && !floor; ++i) {
        umb_ray_bound_vertex(m, &b->vertices[c->bottom[i]], ua, ub, 0.0f, &x);
        s->bottom = fmaxf(s->bottom, x.bottom);
        s->bottom_far = fmaxf(s->bottom_far, x.bottom_far);
        bottom_least = fminf(bottom_least, x.bottom);
    }
    double deepest = 0.0;
    for (uint32_t i = 0; i < b->count; ++i) {
        deepest = umb_most(deepest, b->vertices[i].u);
    }
    s->depth = umb_float_above((float)(deepest + f->error));
    s->steep = f->steep;
    *loss = umb_most((double)top_most - s->top, floor ? 0.0 : (double)s->bottom - bottom_least);
}

static place place_of(const umb_ray_map *m, const umb_ray_point *p)
{
    double r = 1.0 / (m->beta0 + m->beta1 * p->u);
    return (place){p->v * r, -(m->alpha0 + m->alpha1 * p->u) * r};
}

/* The pixels of a row of tiles that the occluder covers: false if there are none. */
static bool cover_row(drawing *d, uint32_t row, uint32_t *first, uint32_t *last)
{
    const umb_ray_map *m = d->map;
    double n = m->columns * UMB_TILE, scale = 1.0 / m->dt;
    *first = UINT32_MAX;
    *last = 0;
    for (uint32_t r = 0; r < UMB_TILE; ++r) {
        double s0 = m->s0 + (row * UMB_TILE + r) * m->ds, s1 = s0 + m->ds, low = -INFINITY, high = INFINITY;
        for (int k = 0; k < 2; ++k) {
            low = umb_most(low, d->low[k].at + umb_most(s0 * d->low[k].slope, s1 * d->low[k].slope));
            high = umb_least(high, d->high[k].at + umb_least(s0 * d->high[k].slope, s1 * d->high[k].slope));
        }
        double from = umb_most(0.0, ceil((low - m->t0) * scale + PIXEL_SLACK));
        double to = umb_least(n, floor((high - m->t0) * scale - PIXEL_SLACK)) - 1.0;
        bool some = from <= to;
        d->from[r] = some ? (uint32_t)from : 1;
        d->to[r] = some ? (uint32_t)to : 0;
        *first = some && d->from[r] < *first ? d->from[r] : *first;
        *last = some && d->to[r] > *last ? d->to[r] : *last;
    }
    return *first <= *last;
}

/* Most of what is very far away covers no pixel at all. */
static bool covers_any(drawing *d)
{
    const umb_ray_map *m = d->map;
    double s0 = m->s0, s1 = m->s0 + m->rows * UMB_TILE * m->ds, width = 0.0;
    for (int k = 0; k < 4; ++k) {
        double s = (k & 1) != 0 ? s1 : s0, wide = d->high[k >> 1].at - d->low[k >> 1].at;
        width = umb_most(width, wide + s * (d->high[k >> 1].slope - d->low[k >> 1].slope));
    }
    return width >= m->dt;
}

static void draw_tile(drawing *d, uint32_t row, uint32_t column)
{
    umb_ray_map *m = d->map;
    uint32_t tile = row * m->columns + column, left = column * UMB_TILE;
    const umb_umbra_summary *s = &m->summaries[tile];
    if (s->top >= d->strip.top && s->bottom <= d->strip.bottom) {
        return;
    }
    for (uint32_t r = 0; r < UMB_TILE; ++r) {
        d->strip.from[r] = (float)d->from[r] - (float)left;
        d->strip.to[r] = (float)d->to[r] - (float)left;
    }
    umb_umbra_tile *t = &m->intervals[(size_t)tile * m->umbrae];
    if (!m->drawn[tile]) {
        umb_umbra_clear(t, m->umbrae, m->live[tile]);
        m->drawn[tile] = true;
    }
    m->summaries[tile] = d->kernels->fill(t, m->umbrae, &d->strip, d->half);
    m->stale[(row / m->group_rows) * (m->columns / UMB_TILE) + column / UMB_TILE] = true;
}

/* Chains as most lines see them; false if the occluder is near. */
static bool find_chains(const umb_ray_map *m, const umb_ray_blocker *b, umb_ray_chains *c)
{
    double least = INFINITY, t0 = INFINITY, t1 = -INFINITY, s = m->s0 + 0.5 * m->rows * UMB_TILE * m->ds;
    for (uint32_t i = 0; i < b->count; ++i) {
        least = umb_least(least, b->vertices[i].u);
    }
    if (!(least > FAR * (m->frame->hu + m->frame->hv))) {
        return false;
    }
    if (b->convex) {
        umb_ray_chains_convex(m, b, s, c);
        return true;
    }
    for (uint32_t i = 0; i < b->ring; ++i) {
        place p = place_of(m, &b->vertices[i]);
        t0 = umb_least(t0, p.at + s * p.slope);
        t1 = umb_most(t1, p.at + s * p.slope);
    }
    umb_ray_chains_ring(m, b, s, t0, t1, c);
    return true;
}

bool umb_ray_map_block_far(umb_ray_map *map, const umb_umbra_kernels *kernels, const umb_ray_blocker *b, bool half)
{
    umb_ray_chains c;
    drawing d = {.map = map, .kernels = kernels, .half = half};
    if (!find_chains(map, b, &c)) {
        return false;
    }
    bool floor = b->floor;
    for (uint32_t i = 0; floor && i < c.bottom_count; ++i) {
        floor = b->on_floor[c.bottom[i]];
    }
    if (c.top_count < 2 || c.bottom_count < 2 || (half && !floor)) {
        return true; /* no use */
    }
    const umb_ray_point *p = b->vertices;
    d.low[0] = place_of(map, &p[c.top[0]]);
    d.low[1] = place_of(map, &p[c.bottom[0]]);
    d.high[0] = place_of(map, &p[c.top[c.top_count - 1]]);
    d.high[1] = place_of(map, &p[c.bottom[c.bottom_count - 1]]);
    if (!covers_any(&d)) {
        return true;
    }
    double loss;
    bounds_over(map, b, &c, floor, &d.strip, &loss);
    if (!(loss <= 1.5 * map->dt * map->beta1)) {
        return false;
    }
    uint32_t first, last;
    for (uint32_t row = 0; row < map->rows; ++row) {
        if (cover_row(&d, row, &first, &last)) {
            for (uint32_t j = first / UMB_TILE; j <= last / UMB_TILE; ++j) {
                draw_tile(&d, row, j);
            }
        }
    }
    return true;
}

/* Occluders into occlusion maps: which chains, which tiles. */
#include <math.h>
#include <string.h>

#include "ray_chains.h"
#include "ray_far.h"

/* Everything about one blocker in one tile row. */
typedef struct band {
    umb_ray_map *map;
    const umb_umbra_kernels *kernels;
    const umb_ray_blocker *blocker;
    bool half;
    uint32_t row; /* of tiles */
    double s;     /* its first corner */
    umb_ray_chains chains;
    uint8_t outline[UMB_RAY_OUTLINE]; /* of a disk */
    uint32_t outline_count;
    umb_umbra umbra;
    int16_t place[UMB_UMBRA_VERTICES]; /* of a vertex in umbra.vertices, -1: not there */
    uint32_t used;
} band;

/* ---- an umbra for the kernels -------------------------------------------------------------------- */

/* Bounds at a vertex: numerators and denominators are sums of doubles, right to far less than a float's step. */
void umb_ray_bound_vertex(const umb_ray_map *m, const umb_ray_point *p, float ua, float ub, float error_u,
                          umb_umbra_vertex *v)
{
    double e = m->frame->error, up = p->z - m->frame->z1, rise = p->z - m->frame->z0;
    double a = p->u - ua, b = p->u - ub;
    v->depth = umb_float_above((float)(p->u + e));
    v->margin = (float)(b - 16.0 * error_u);
    if (!(v->margin > 0.0f)) {
        v->top = v->top_far = -INFINITY;
        v->bottom = v->bottom_far = INFINITY;
        return;
    }
    double qa1 = up > e ? (up - e) / (a + e) : (up - e) / (a - e), qb1 = up > e ? (up - e) / (b + e) : (up - e) / (b - e);
    double qa0 = rise > e ? (rise - e) / (a + e) : (rise - e) / (a - e);
    double qb0 = rise > e ? (rise - e) / (b + e) : (rise - e) / (b - e);
    v->top = umb_float_below((float)umb_least(qa1, qb1));
    v->top_far = umb_float_below((float)umb_least(qa0, qb0));
    qa1 = up < -e ? (up + e) / (a + e) : (up + e) / (a - e);
    qb1 = up < -e ? (up + e) / (b + e) : (up + e) / (b - e);
    qa0 = rise < -e ? (rise + e) / (a + e) : (rise + e) / (a - e);
    qb0 = rise < -e ? (rise + e) / (b + e) : (rise + e) / (b - e);
    v->bottom = umb_float_above((float)umb_most(qa0, qb0));
    v->bottom_far = umb_float_above((float)umb_most(qa1, qb1));
}

static uint8_t use_vertex(band *d, uint32_t i, uint32_t column, uint32_t columns)
{
    if (d->place[i] >= 0) {
        return (uint8_t)d->place[i];
    }
    const umb_ray_map *m = d->map;
    const umb_ray_point *p = &d->blocker->vertices[i];
    umb_umbra_vertex *v = &d->umbra.vertices[d->used];
    double alpha = m->alpha0 + m->alpha1 * p->u, beta = m->beta0 + m->beta1 * p->u;
    double t = m->t0 + column * m->dt, f = p->v - alpha * d->s - beta * t;
    double ds = alpha * m->ds, dt = beta * m->dt;
    /* f, ds and dt are rounded to floats once, products and sums of the kernel four times, of numbers not above
       size: 2^-22 of it. What doubles lose before is within the second term. The kernel wants four times that. */
    double size = fabs(f) + (UMB_TILE + 1) * fabs(ds) + (columns + 1) * fabs(dt);
    double lost = 0x1p-44 * (fabs(p->v) + fabs(alpha * d->s) + fabs(beta * t));
    double shift = m->frame->error * (1.0 + fabs(m->alpha1 * d->s) + fabs(m->beta1 * t) + 1.0);
    v->f = (float)f;
    v->ds = (float)ds;
    v->dt = (float)dt;
    v->error = (float)(4.0 * (0x1p-22 * size + lost + shift));
    v->u = (float)p->u;
    v->z = (float)p->z;
    d->place[i] = (int16_t)d->used;
    return (uint8_t)d->used++;
}

/* What pixels that straddle a vertex, which is used, see of it. */
static void bound_vertex(band *d, uint32_t i)
{
    const umb_umbra *o = &d->umbra;
    umb_ray_bound_vertex(d->map, &d->blocker->vertices[i], o->ua, o->ub, o->error_u, &d->umbra.vertices[d->place[i]]);
}

/* On which sides of a vertex lines of the run may pass: bit 0: below, bit 1: above. */
static uint32_t sides(const umb_umbra_vertex *v, uint32_t columns)
{
    float f = v->f, ds = UMB_TILE * v->ds, dt = (float)columns * v->dt;
    float low = f - (ds > 0.0f ? ds : 0.0f) - (dt > 0.0f ? dt : 0.0f) - v->error;
    float high = f - (ds < 0.0f ? ds : 0.0f) - (dt < 0.0f ? dt : 0.0f) + v->error;
    return (low <= 0.0f ? 1u : 0u) | (high >= 0.0f ? 2u : 0u);
}

static bool may_cross(const umb_umbra *o, umb_umbra_edge e, uint32_t columns)
{
    return (sides(&o->vertices[e.a], columns) | sides(&o->vertices[e.b], columns)) == 3u;
}

/* Lines of a tile of the run may have the vertex below them (side 1) or above (2). */
static bool has_side(const umb_umbra_vertex *v, uint32_t tile, uint32_t side)
{
    umb_umbra_vertex there = *v;
    there.f -= (float)(tile * UMB_TILE) * v->dt;
    return (sides(&there, UMB_TILE) & side) != 0;
}

/* False if surely no pixel of a tile of the run is covered: both chains have to be crossed there. */
static bool may_cover(const band *d, bool floor, uint32_t tile)
{
    const umb_umbra *o = &d->umbra;
    if (o->top_count == 0 || (o->bottom_count == 0 && (!floor || d->blocker->convex))) {
        return false;
    }
    for (int i = 0; i < 2; ++i) {
        if (!has_side(&o->vertices[o->low[i]], tile, 1) || !has_side(&o->vertices[o->high[i]], tile, 2)) {
            return false;
        }
    }
    return true;
}

/* A chain's edges that may be crossed in the run, and the inner vertices that may be straddled. reference: the height
 * that its far bound is measured from; over it the near quotient is the larger one, under it the farther. */
static uint32_t use_chain(band *d, const uint8_t *chain, uint32_t count, uint32_t column, uint32_t columns,
                          bool top, umb_umbra_edge *edges, uint64_t *inner)
{
    const umb_ray_blocker *b = d->blocker;
    double z = top ? d->map->frame->z0 : d->map->frame->z1;
    uint32_t n = 0;
    *inner = 0;
    for (uint32_t i = 0; i + 1 < count; ++i) {
        double za = b->vertices[chain[i]].z - z, zb = b->vertices[chain[i + 1]].z - z;
        umb_umbra_edge e = {use_vertex(d, chain[i], column, columns), use_vertex(d, chain[i + 1], column, columns), 0};
        e.near_quotient = top ? !(za < 0.0 && zb < 0.0) : !(za > 0.0 && zb > 0.0);
        if (i > 0 && sides(&d->umbra.vertices[e.a], columns) == 3u) {
            *inner |= UINT64_C(1) << e.a;
            bound_vertex(d, chain[i]);
        }
        if (may_cross(&d->umbra, e, columns)) {
            edges[n++] = e;
        }
    }
    return n;
}

/* What blocks of a disk is no farther and no nearer than its hull, as seen from above. */
static void use_outline(band *d, uint32_t column, uint32_t columns)
{
    umb_umbra *o = &d->umbra;
    for (uint32_t i = 0; i < d->outline_count; ++i) {
        uint32_t from = d->outline[i], to = d->outline[i + 1 < d->outline_count ? i + 1 : 0];
        umb_umbra_edge e = {use_vertex(d, from, column, columns), use_vertex(d, to, column, columns), 0};
        if (sides(&o->vertices[e.a], columns) == 3u) {
            o->depth_inner |= UINT64_C(1) << e.a;
            bound_vertex(d, from);
        }
        if (may_cross(o, e, columns)) {
            o->depth[o->depth_count++] = e;
        }
    }
}

static void make_umbra(band *d, uint32_t column, uint32_t columns, bool floor, const float span[2])
{
    const umb_ray_blocker *b = d->blocker;
    const umb_ray_frame *f = d->map->frame;
    umb_umbra *o = &d->umbra;
    double u = 0.0, z = umb_most(fabs(f->z0), fabs(f->z1));
    for (uint32_t i = 0; i < b->count; ++i) {
        u = umb_most(u, fabs(b->vertices[i].u));
        z = umb_most(z, fabs(b->vertices[i].z));
        d->place[i] = -1;
    }
    d->used = 0;
    o->depth_count = 0;
    o->depth_inner = 0;
    o->z0 = (float)f->z0;
    o->z1 = (float)f->z1;
    o->ua = span[0];
    o->ub = span[1];
    o->error_u = (float)(0x1p-20 * umb_most(u, f->hu) + 2.0 * f->error);
    o->error_z = (float)(0x1p-20 * z + 2.0 * f->error);
    o->floor = floor;
    o->top_count = use_chain(d, d->chains.top, d->chains.top_count, column, columns, true, o->top, &o->top_inner);
    o->low[0] = (uint32_t)d->place[d->chains.top[0]];
    o->high[0] = (uint32_t)d->place[d->chains.top[d->chains.top_count - 1]];
    o->low[1] = o->low[0];
    o->high[1] = o->high[0];
    o->bottom_count = 0;
    o->bottom_inner = 0;
    o->outlined = !b->convex;
    if (!floor || b->convex) {
        o->bottom_count = use_chain(d, d->chains.bottom, d->chains.bottom_count, column, columns, false, o->bottom, &o->bottom_inner);
        o->low[1] = (uint32_t)d->place[d->chains.bottom[0]];
        o->high[1] = (uint32_t)d->place[d->chains.bottom[d->chains.bottom_count - 1]];
    }
    if (o->outlined) {
        use_outline(d, column, columns);
    }
}

/* ---- tiles -------------------------------------------------------------------------------------- */

/* Bounds that no pixel's interval of the run exceeds: m and M of points of a chain are largest and least at its
 * vertices. */
static umb_umbra_summary reach_of(const band *d, bool floor, const float span[2])
{
    const umb_ray_frame *f = d->map->frame;
    umb_umbra_summary r = {-INFINITY, floor ? -INFINITY : INFINITY, 0.0f};
    for (uint32_t i = 0; i < d->chains.top_count; ++i) {
        const umb_ray_point *p = &d->blocker->vertices[d->chains.top[i]];
        double up = p->z - f->z1, from = up >= 0.0 ? p->u - span[0] : p->u - span[1];
        r.top = from > 0.0 ? fmaxf(r.top, (float)(up / from)) : INFINITY;
    }
    for (uint32_t i = 0; i < d->chains.bottom_count && !floor; ++i) {
        const umb_ray_point *p = &d->blocker->vertices[d->chains.bottom[i]];
        double rise = p->z - f->z0, from = rise >= 0.0 ? p->u - span[1] : p->u - span[0];
        r.bottom = from > 0.0 ? fminf(r.bottom, (float)(rise / from)) : -INFINITY;
    }
    return r;
}

static void draw_run(band *d, uint32_t group, uint32_t from, uint32_t to)
{
    umb_ray_map *m = d->map;
    uint32_t groups = m->columns / UMB_TILE;
    const float *span = m->spans[d->row * groups + group];
    double t0 = m->t0 + from * UMB_TILE * m->dt, t1 = m->t0 + (to + 1) * UMB_TILE * m->dt;
    if (!d->blocker->convex) {
        umb_ray_chains_ring(m, d->blocker, d->s + 0.5 * UMB_TILE * m->ds, t0, t1, &d->chains);
    }
    bool floor = d->blocker->floor;
    for (uint32_t i = 0; floor && i < d->chains.bottom_count; ++i) {
        floor = d->blocker->on_floor[d->chains.bottom[i]];
    }
    if (d->chains.top_count < 2 || d->chains.bottom_count < 2 || (d->half && !floor)) {
        return;
    }
    umb_umbra_summary reach = reach_of(d, floor, span);
    bool wanted[UMB_TILE];
    uint32_t first = UMB_NONE, last = 0;
    for (uint32_t j = from; j <= to; ++j) {
        const umb_umbra_summary *s = &m->summaries[d->row * m->columns + j];
        wanted[j - group * UMB_TILE] = !(s->top >= reach.top && s->bottom <= reach.bottom);
        if (wanted[j - group * UMB_TILE]) {
            first = first == UMB_NONE ? j : first;
            last = j;
        }
    }
    if (first == UMB_NONE) {
        return;
    }
    umb_umbra_draw draw = {.umbra = &d->umbra, .umbrae = m->umbrae, .half = d->half, .steep = m->frame->steep};
    make_umbra(d, first * UMB_TILE, (last - first + 1) * UMB_TILE, floor, span);
    for (uint32_t j = first; j <= last; ++j) {
        uint32_t tile = d->row * m->columns + j;
        if (!wanted[j - group * UMB_TILE] || !may_cover(d, floor, j - first)) {
            continue;
        }
        draw.tile_count = j - first + 1;
        draw.tiles[j - first] = &m->intervals[(size_t)tile * m->umbrae];
        if (!m->drawn[tile]) {
            umb_umbra_clear(draw.tiles[j - first], m->umbrae, m->live[tile]);
            m->drawn[tile] = true;
        }
    }
    if (draw.tile_count == 0) {
        return;
    }
    d->kernels->draw(&draw);
    for (uint32_t j = 0; j < draw.tile_count; ++j) {
        if (draw.tiles[j] != NULL) {
            m->summaries[d->row * m->columns + first + j] = draw.summaries[j];
        }
    }
    m->stale[(d->row / m->group_rows) * groups + group] = true;
}

/* Tiles of the row that lines through the blocker may go through. */
static bool range_of_tiles(const band *d, uint32_t *from, uint32_t *to)
{
    const umb_ray_map *m = d->map;
    double least = INFINITY, most = -INFINITY, width = UMB_TILE * m->dt;
    for (uint32_t i = 0; i < d->blocker->count; ++i) {
        const umb_ray_point *p = &d->blocker->vertices[i];
        double alpha = m->alpha0 + m->alpha1 * p->u, beta = m->beta0 + m->beta1 * p->u;
        if (!(beta > 1e-9 * (fabs(m->beta0) + fabs(m->beta1 * p->u)))) {
            *from = 0;
            *to = m->columns - 1;
            return true;
        }
        double a = (p->v - alpha * d->s) / beta, b = (p->v - alpha * (d->s + UMB_TILE * m->ds)) / beta;
        least = umb_least(least, umb_least(a, b));
        most = umb_most(most, umb_most(a, b));
    }
    double first = umb_most(0.0, floor((least - m->t0) / width)), last = umb_least(m->columns - 1.0, floor((most - m->t0) / width));
    if (!(first <= last)) {
        return false;
    }
    *from = (uint32_t)first;
    *to = (uint32_t)last;
    return true;
}

void umb_ray_map_block(umb_ray_map *map, const umb_umbra_kernels *kernels, const umb_ray_blocker *b, bool half)
{
    if (umb_ray_map_block_far(map, kernels, b, half)) {
        return;
    }
    band d = {.map = map, .kernels = kernels, .blocker = b, .half = half};
    bool near = true;
    d.outline_count = b->convex ? 0 : umb_ray_hull(b->vertices, b->count, d.outline);
    for (uint32_t i = 0; i < b->count; ++i) {
        near = (i > 0 && near) || b->vertices[i].u < 16.0 * (map->frame->hu + map->frame->hv);
    }
    for (d.row = 0; d.row < map->rows; ++d.row) {
        uint32_t from, to;
        d.s = map->s0 + d.row * UMB_TILE * map->ds;
        if (!range_of_tiles(&d, &from, &to)) {
            continue;
        }
        /* Far away the chains are the same from row to row; any would be right. */
        if (b->convex && (near || d.row % UMB_TILE == 0 || d.chains.top_count == 0)) {
            umb_ray_chains_convex(map, b, d.s + 0.5 * UMB_TILE * map->ds, &d.chains);
        }
        for (uint32_t g = from / UMB_TILE; g <= to / UMB_TILE; ++g) {
            uint32_t first = g * UMB_TILE, last = first + UMB_TILE - 1;
            draw_run(&d, g, from > first ? from : first, to < last ? to : last);
        }
    }
}

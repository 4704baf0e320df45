#include "ray_map.h"

#include <math.h>
#include <string.h>

/* Relative slack of sums of doubles in this file: each is a handful of products of numbers of which the largest is
 * named, so 2^-44 of that is hundreds of times what rounding can do. */
#define SLACK 0x1p-44

umb_ray_point umb_ray_frame_point(const umb_ray_frame *f, const double p[3])
{
    return (umb_ray_point){f->sign * (p[f->axis_u] - f->centre[f->axis_u]), p[f->axis_v] - f->centre[f->axis_v],
                           p[f->axis_z] - f->centre[f->axis_z]};
}

/* ---- setting up ----------------------------------------------------------------------------- */

static void choose_rays(umb_ray_map *m, umb_ray_kind kind, double outer)
{
    const umb_ray_frame *f = m->frame;
    uint32_t rows = m->rows * UMB_TILE, columns = m->columns * UMB_TILE;
    if (kind == UMB_RAY_SLAB) {
        double reach = f->hv + f->hu;
        m->alpha0 = m->beta1 = 1.0;
        m->alpha1 = m->beta0 = 0.0;
        m->s0 = -reach;
        m->t0 = -1.0;
        m->ds = 2.0 * reach / rows;
        m->dt = 2.0 / columns;
        return;
    }
    double ui = kind == UMB_RAY_NEAR ? f->hu : -f->hu, uo = outer * f->hu;
    m->beta1 = 1.0 / (uo - ui);
    m->beta0 = -ui * m->beta1;
    m->alpha1 = -m->beta1;
    m->alpha0 = uo * m->beta1;
    m->s0 = -f->hv;
    m->t0 = -outer * f->hv;
    m->ds = 2.0 * f->hv / rows;
    m->dt = 2.0 * outer * f->hv / columns;
}

/* True if no ray of the rectangle has to be looked at here: it misses the cell, or it is in the other map. */
static bool is_dead(const umb_ray_map *m, umb_ray_kind kind, double outer, double s, double t, double ds, double dt)
{
    const umb_ray_frame *f = m->frame;
    if (kind == UMB_RAY_SLAB) {
        double offset = s > 0.0 ? s : s + ds < 0.0 ? -s - ds : 0.0;
        double slope = fmax(fabs(t), fabs(t + dt));
        return offset > (f->hv + slope * f->hu) * (1.0 + 0x1p-40);
    }
    if (kind == UMB_RAY_NEAR) {
        return false;
    }
    double low = (outer - 1.0) * s + 2.0 * t, high = (outer - 1.0) * (s + ds) + 2.0 * (t + dt);
    return fmax(-low, high) < (outer + 1.0) * f->hv * (1.0 - 0x1p-40);
}

static uint64_t live_pixels(const umb_ray_map *m, umb_ray_kind kind, double outer, uint32_t i, uint32_t j)
{
    uint64_t live = 0;
    double s = m->s0 + i * UMB_TILE * m->ds, t = m->t0 + j * UMB_TILE * m->dt;
    if (is_dead(m, kind, outer, s, t, UMB_TILE * m->ds, UMB_TILE * m->dt)) {
        return 0;
    }
    for (uint32_t k = 0; k < 64; ++k) {
        bool dead = is_dead(m, kind, outer, s + (k / UMB_TILE) * m->ds, t + (k % UMB_TILE) * m->dt, m->ds, m->dt);
        live |= (uint64_t)!dead << k;
    }
    return live;
}

/* Where the lines of a rectangle of the map enter and leave the cell's square, at most: constant over it, so that all
 * that is compared there sees the same cell. A ratio of affine functions has its extremes at corners; where the slope
 * changes its sign it is the whole square. */
static void find_span(const umb_ray_map *m, uint32_t row, uint32_t group, float span[2])
{
    const umb_ray_frame *f = m->frame;
    double ua = f->hu, ub = -f->hu;
    bool rises = false, falls = false;
    for (int c = 0; c < 4; ++c) {
        double s = m->s0 + (row + (c & 1)) * UMB_TILE * m->ds;
        double t = m->t0 + (group + (c >> 1)) * UMB_TILE * UMB_TILE * m->dt;
        double at0 = m->alpha0 * s + m->beta0 * t, slope = m->alpha1 * s + m->beta1 * t;
        double v = slope < 0.0 ? -at0 : at0, steep = fabs(slope);
        rises = rises || slope > 0.0;
        falls = falls || slope < 0.0;
        if (steep < 0x1p-30 * (fabs(m->alpha1 * s) + fabs(m->beta1 * t))) {
            rises = falls = true;
        } else {
            ub = fmax(ub, (f->hv - v) / steep);
            ua = fmin(ua, (-f->hv - v) / steep);
        }
    }
    bool whole = (rises && falls) || !(ua < ub);
    ua = whole ? -f->hu : fmax(-f->hu, ua - 0x1p-20 * f->hu);
    ub = whole ? f->hu : fmin(f->hu, ub + 0x1p-20 * f->hu);
    span[0] = nextafterf((float)ua, -INFINITY);
    span[1] = nextafterf((float)ub, INFINITY);
}

typedef struct map_layout {
    size_t intervals, summaries, groups, live, drawn, stale, spans, bytes;
} map_layout;

static size_t place(size_t *bytes, size_t count, size_t size)
{
    size_t at = *bytes;
    *bytes = (at + count * size + 63) & ~(size_t)63;
    return at;
}

static map_layout lay_out(uint32_t rows, uint32_t columns, uint32_t umbrae)
{
    size_t tiles = (size_t)rows * columns, groups = tiles / (UMB_TILE * UMB_TILE);
    map_layout l = {0};
    l.intervals = place(&l.bytes, tiles * umbrae, sizeof(umb_umbra_tile));
    l.summaries = place(&l.bytes, tiles, sizeof(umb_umbra_summary));
    l.groups = place(&l.bytes, groups, sizeof(umb_umbra_summary));
    l.live = place(&l.bytes, tiles, sizeof(uint64_t));
    l.drawn = place(&l.bytes, tiles, sizeof(bool));
    l.stale = place(&l.bytes, groups, sizeof(bool));
    l.spans = place(&l.bytes, tiles / UMB_TILE, 2 * sizeof(float));
    return l;
}

umb_result umb_ray_map_begin(umb_ray_map *map, const umb_allocator *a, const umb_ray_frame *frame,
                             umb_ray_kind kind, double outer, uint32_t resolution, uint32_t umbrae)
{
    uint32_t columns = resolution / UMB_TILE, least = UMB_TILE;
    uint32_t rows = kind != UMB_RAY_SLAB ? columns : (columns / 8 + least - 1) / least * least;
    map_layout l = lay_out(rows, columns, umbrae);
    char *block = (char *)map->intervals;
    if (map->bytes != l.bytes) {
        umb_ray_map_free(map, a);
        block = umb_memory_allocate(a, l.bytes);
        if (block == NULL) {
            return UMB_ERROR_MEMORY;
        }
    }
    *map = (umb_ray_map){.frame = frame, .rows = rows, .columns = columns, .umbrae = umbrae, .bytes = l.bytes};
    map->intervals = (umb_umbra_tile *)(void *)(block + l.intervals);
    map->summaries = (umb_umbra_summary *)(void *)(block + l.summaries);
    map->groups = (umb_umbra_summary *)(void *)(block + l.groups);
    map->live = (uint64_t *)(void *)(block + l.live);
    map->drawn = (bool *)(block + l.drawn);
    map->stale = (bool *)(block + l.stale);
    map->spans = (float(*)[2])(void *)(block + l.spans);
    choose_rays(map, kind, outer);
    for (uint32_t i = 0; i < rows; ++i) {
        for (uint32_t j = 0; j < columns; ++j) {
            map->live[i * columns + j] = live_pixels(map, kind, outer, i, j);
            map->summaries[i * columns + j] = map->live[i * columns + j] != 0
                                               ? (umb_umbra_summary){-INFINITY, INFINITY, INFINITY}
                                               : (umb_umbra_summary){INFINITY, -INFINITY, -INFINITY};
        }
        for (uint32_t g = 0; g < columns / UMB_TILE; ++g) {
            find_span(map, i, g, map->spans[i * (columns / UMB_TILE) + g]);
        }
    }
    memset(map->drawn, 0, (size_t)rows * columns * sizeof *map->drawn);
    memset(map->stale, 1, (size_t)rows * columns / (UMB_TILE * UMB_TILE) * sizeof *map->stale);
    return UMB_OK;
}

void umb_ray_map_free(umb_ray_map *map, const umb_allocator *a)
{
    if (map->bytes > 0) {
        umb_memory_free(a, map->intervals, map->bytes);
    }
    memset(map, 0, sizeof *map);
}

/* ---- what is asked about ---------------------------------------------------------------------- */

static double turn(umb_ray_point a, umb_ray_point b, umb_ray_point c)
{
    return (b.u - a.u) * (c.v - a.v) - (b.v - a.v) * (c.u - a.u);
}

/* The hull of points in (u, v): monotone chains. Points that rounding leaves out lie within rounding of it, which
 * errors of f allow for. */
static uint32_t hull(umb_ray_point *p, uint32_t count, umb_ray_point *out)
{
    for (uint32_t i = 1; i < count; ++i) {
        umb_ray_point x = p[i];
        uint32_t k = i;
        for (; k > 0 && (p[k - 1].u > x.u || (p[k - 1].u == x.u && p[k - 1].v > x.v)); --k) {
            p[k] = p[k - 1];
        }
        p[k] = x;
    }
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; ++i) {
        while (n >= 2 && turn(out[n - 2], out[n - 1], p[i]) <= 0.0) {
            --n;
        }
        out[n++] = p[i];
    }
    uint32_t lower = n + 1;
    for (uint32_t i = count - 1; i-- > 0;) {
        while (n >= lower && turn(out[n - 2], out[n - 1], p[i]) <= 0.0) {
            --n;
        }
        out[n++] = p[i];
    }
    return n > 1 ? n - 1 : n;
}

/* Cut an outline to u >= least. */
static uint32_t cut(const umb_ray_point *p, uint32_t count, double least, umb_ray_point *out)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; ++i) {
        umb_ray_point a = p[i], b = p[(i + 1) % count];
        if (a.u >= least) {
            out[n++] = a;
        }
        if (count > 1 && (a.u >= least) != (b.u >= least)) {
            double part = (least - a.u) / (b.u - a.u);
            out[n++] = (umb_ray_point){least, a.v + part * (b.v - a.v), a.z};
        }
    }
    return n;
}

bool umb_ray_shape_make(const umb_ray_frame *f, const umb_ray_point *points, uint32_t count, umb_ray_shape *out)
{
    umb_ray_point sorted[UMB_RAY_OUTLINE], outline[2 * UMB_RAY_OUTLINE];
    out->z0 = out->u_min = INFINITY;
    out->z1 = out->u_max = -INFINITY;
    for (uint32_t i = 0; i < count; ++i) {
        sorted[i] = points[i];
        out->z0 = fmin(out->z0, points[i].z);
        out->z1 = fmax(out->z1, points[i].z);
        out->u_min = fmin(out->u_min, points[i].u);
        out->u_max = fmax(out->u_max, points[i].u);
    }
    out->z0 -= f->error;
    out->z1 += f->error;
    if (!(out->u_max >= -f->hu - f->error)) {
        return false;
    }
    uint32_t n = hull(sorted, count, outline);
    if (out->u_min < -f->hu) {
        out->count = cut(outline, n, -f->hu - f->error, out->outline);
        out->u_min = -f->hu - f->error;
    } else {
        out->count = n;
        memcpy(out->outline, outline, n * sizeof *outline);
    }
    return out->count > 0;
}

/* Bounds of a shape over a rectangle of the map. */
typedef struct beam {
    double s[2], t[2];
} beam;

static double f_error(const umb_ray_map *m, const umb_ray_point *p, const beam *b)
{
    double s = fmax(fabs(b->s[0]), fabs(b->s[1])), t = fmax(fabs(b->t[0]), fabs(b->t[1]));
    double alpha = fabs(m->alpha0) + fabs(m->alpha1 * p->u), beta = fabs(m->beta0) + fabs(m->beta1 * p->u);
    double shift = m->frame->error * (1.0 + fabs(m->alpha1) * s + fabs(m->beta1) * t);
    return SLACK * (fabs(p->v) + alpha * s + beta * t) + shift;
}

/* Where the outline is crossed, in u: false when no line of the beam meets it. */
static bool range_of_u(const umb_ray_map *m, const umb_ray_shape *shape, const beam *b, double *u_min, double *u_max)
{
    double f[UMB_RAY_OUTLINE][4], error[UMB_RAY_OUTLINE];
    double least = INFINITY, most = -INFINITY;
    *u_min = INFINITY;
    *u_max = -INFINITY;
    for (uint32_t i = 0; i < shape->count; ++i) {
        const umb_ray_point *p = &shape->outline[i];
        double alpha = m->alpha0 + m->alpha1 * p->u, beta = m->beta0 + m->beta1 * p->u;
        double low = INFINITY, high = -INFINITY;
        error[i] = f_error(m, p, b);
        for (int c = 0; c < 4; ++c) {
            f[i][c] = p->v - alpha * b->s[c & 1] - beta * b->t[c >> 1];
            low = f[i][c] < low ? f[i][c] : low;
            high = f[i][c] > high ? f[i][c] : high;
        }
        low -= error[i];
        high += error[i];
        least = low < least ? low : least;
        most = high > most ? high : most;
        if (low <= 0.0 && high >= 0.0) {
            *u_min = p->u < *u_min ? p->u : *u_min;
            *u_max = p->u > *u_max ? p->u : *u_max;
        }
    }
    if (least > 0.0 || most < 0.0) {
        return false;
    }
    for (uint32_t i = 0; i < shape->count; ++i) {
        uint32_t k = i + 1 < shape->count ? i + 1 : 0;
        double u = shape->outline[i].u, du = shape->outline[k].u - u, e = error[i] + error[k];
        for (int c = 0; c < 4; ++c) {
            double a = f[i][c], z = f[k][c];
            if ((a > error[i] && z > error[k]) || (a < -error[i] && z < -error[k]) || a == z) {
                continue; /* beside, or both ends have been counted */
            }
            double r = 1.0 / (z - a), part = -a * r, off = 4.0 * e * fabs(r);
            part = part < 0.0 ? 0.0 : part > 1.0 ? 1.0 : part;
            off = (off < 1.0 ? off : 1.0) * fabs(du);
            double at = u + part * du;
            *u_min = at - off < *u_min ? at - off : *u_min;
            *u_max = at + off > *u_max ? at + off : *u_max;
        }
    }
    *u_min = fmax(*u_min, shape->u_min) - m->frame->error;
    *u_max = fmin(*u_max, shape->u_max) + m->frame->error;
    return true;
}

/* Upper bound of m, lower bound of M and of u for what is at these heights and distances, seen from a cell whose back
 * and front lie between the given abscissae. ub_max: nothing is hidden that may lie before it. */
static bool bounds_of(const umb_ray_frame *f, const umb_ray_shape *shape, double u_min, double u_max,
                      double ua_max, double ub_min, double ub_max, umb_umbra_query *q)
{
    if (!(u_min > ub_max)) {
        return false;
    }
    double up = shape->z1 - f->z1, rise = shape->z0 - f->z0;
    double top = up >= 0.0 ? up / (u_min - ua_max) : up / (u_max - ub_min);
    double bottom = rise >= 0.0 ? rise / (u_max - ub_min) : rise / (u_min - ua_max);
    q->top = nextafterf((float)(top + SLACK * fabs(top)), INFINITY);
    q->bottom = nextafterf((float)(bottom - SLACK * fabs(bottom)), -INFINITY);
    q->depth = nextafterf((float)u_min, -INFINITY);
    return true;
}

static bool holds(const umb_umbra_summary *s, const umb_umbra_query *q)
{
    return s->top >= q->top && s->bottom <= q->bottom && s->depth <= q->depth;
}

/* Lines of rows from s0 to s1 that meet the shape have t in this range, as far as t is bounded. */
static void range_of_t(const umb_ray_map *m, const umb_ray_point *p, uint32_t count, double s0, double s1,
                       double *t_min, double *t_max)
{
    *t_min = INFINITY;
    *t_max = -INFINITY;
    for (uint32_t i = 0; i < count; ++i) {
        double alpha = m->alpha0 + m->alpha1 * p[i].u, beta = m->beta0 + m->beta1 * p[i].u;
        if (!(beta > 0x1p-20 * (fabs(m->beta0) + fabs(m->beta1 * p[i].u)))) {
            *t_min = -INFINITY;
            *t_max = INFINITY;
            return;
        }
        double r = 1.0 / beta, a = (p[i].v - alpha * s0) * r, b = (p[i].v - alpha * s1) * r;
        double low = a < b ? a : b, high = a < b ? b : a;
        *t_min = low < *t_min ? low : *t_min;
        *t_max = high > *t_max ? high : *t_max;
    }
}

/* The same in pixels, safely outside; from > to: none. */
typedef struct lanes {
    double from, to;
} lanes;

static lanes range_of_lanes(const umb_ray_map *m, const umb_ray_shape *shape, double s0, double s1)
{
    double t_min, t_max, n = m->columns * UMB_TILE;
    range_of_t(m, shape->outline, shape->count, s0, s1, &t_min, &t_max);
    lanes l = {(t_min - m->t0) / m->dt - 0x1p-16, (t_max - m->t0) / m->dt + 0x1p-16};
    l.from = fmax(0.0, floor(l.from));
    l.to = fmin(n - 1.0, floor(l.to));
    return l;
}

/* ---- asking ------------------------------------------------------------------------------------- */

static void sum_up_group(umb_ray_map *m, uint32_t gi, uint32_t gj)
{
    uint32_t groups = m->columns / UMB_TILE;
    umb_umbra_summary s = {INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = gi * UMB_TILE; i < (gi + 1) * UMB_TILE; ++i) {
        const umb_umbra_summary *row = &m->summaries[i * m->columns + gj * UMB_TILE];
        for (uint32_t j = 0; j < UMB_TILE; ++j) {
            s.top = row[j].top < s.top ? row[j].top : s.top;
            s.bottom = row[j].bottom > s.bottom ? row[j].bottom : s.bottom;
            s.depth = row[j].depth > s.depth ? row[j].depth : s.depth;
        }
    }
    m->groups[gi * groups + gj] = s;
    m->stale[gi * groups + gj] = false;
}

static beam rectangle(const umb_ray_map *m, uint32_t i, uint32_t j, uint32_t size)
{
    return (beam){{m->s0 + i * m->ds, m->s0 + (i + size) * m->ds}, {m->t0 + j * m->dt, m->t0 + (j + size) * m->dt}};
}

/* The pixels of a tile that lines to the shape may go through. */
static uint64_t touched_pixels(const umb_ray_map *m, const umb_ray_shape *shape, uint32_t i, uint32_t j,
                               umb_umbra_query *q)
{
    uint64_t touched = 0;
    for (uint32_t r = 0; r < UMB_TILE; ++r) {
        double s = m->s0 + (i * UMB_TILE + r) * m->ds;
        lanes l = range_of_lanes(m, shape, s, s + m->ds);
        double from = fmax(0.0, l.from - j * UMB_TILE), to = fmin(UMB_TILE - 1.0, l.to - j * UMB_TILE);
        q->from[r] = (float)from;
        q->to[r] = (float)to;
        if (from <= to) {
            touched |= ((UINT64_C(2) << (uint32_t)to) - (UINT64_C(1) << (uint32_t)from)) << (r * UMB_TILE);
        }
    }
    return touched;
}

static bool tile_hides(const umb_ray_map *m, const umb_umbra_kernels *kernels, const umb_ray_shape *shape,
                       uint32_t i, uint32_t j)
{
    uint32_t tile = i * m->columns + j;
    if (m->live[tile] == 0) {
        return true;
    }
    umb_umbra_query q;
    double u_min, u_max;
    beam b = rectangle(m, i * UMB_TILE, j * UMB_TILE, UMB_TILE);
    const float *span = m->spans[i * (m->columns / UMB_TILE) + j / UMB_TILE];
    if (!range_of_u(m, shape, &b, &u_min, &u_max)) {
        return true;
    }
    bool bounded = m->drawn[tile] && bounds_of(m->frame, shape, u_min, u_max, span[0], span[1], span[1], &q);
    if (bounded && holds(&m->summaries[tile], &q)) {
        return true;
    }
    uint64_t touched = touched_pixels(m, shape, i, j, &q) & m->live[tile];
    if (touched == 0) {
        return true;
    }
    return bounded && kernels->open(&m->intervals[(size_t)tile * m->umbrae], m->umbrae, &q) == 0;
}

static bool group_holds(umb_ray_map *m, const umb_ray_shape *shape, uint32_t gi, uint32_t gj, bool *touched)
{
    uint32_t groups = m->columns / UMB_TILE, side = UMB_TILE * UMB_TILE;
    beam b = rectangle(m, gi * side, gj * side, side);
    double u_min, u_max, ua = -INFINITY, ub_min = INFINITY, ub_max = -INFINITY;
    *touched = range_of_u(m, shape, &b, &u_min, &u_max);
    if (!*touched) {
        return true;
    }
    for (uint32_t i = gi * UMB_TILE; i < (gi + 1) * UMB_TILE; ++i) {
        const float *span = m->spans[i * groups + gj];
        ua = fmax(ua, span[0]);
        ub_min = fmin(ub_min, span[1]);
        ub_max = fmax(ub_max, span[1]);
    }
    if (m->stale[gi * groups + gj]) {
        sum_up_group(m, gi, gj);
    }
    umb_umbra_query q;
    return bounds_of(m->frame, shape, u_min, u_max, ua, ub_min, ub_max, &q) && holds(&m->groups[gi * groups + gj], &q);
}

static bool group_hides(umb_ray_map *m, const umb_umbra_kernels *kernels, const umb_ray_shape *shape,
                        uint32_t gi, uint32_t gj)
{
    bool touched;
    if (group_holds(m, shape, gi, gj, &touched)) {
        return true;
    }
    for (uint32_t i = gi * UMB_TILE; i < (gi + 1) * UMB_TILE; ++i) {
        double s = m->s0 + i * UMB_TILE * m->ds;
        lanes l = range_of_lanes(m, shape, s, s + UMB_TILE * m->ds);
        double from = fmax(l.from / UMB_TILE, gj * UMB_TILE), to = fmin(l.to / UMB_TILE, (gj + 1) * UMB_TILE - 1.0);
        if (!(l.from <= l.to)) {
            continue;
        }
        for (uint32_t j = (uint32_t)from; j <= to; ++j) {
            if (!tile_hides(m, kernels, shape, i, j)) {
                return false;
            }
        }
    }
    return true;
}

bool umb_ray_map_hides(umb_ray_map *m, const umb_umbra_kernels *kernels, const umb_ray_shape *shape)
{
    uint32_t side = UMB_TILE * UMB_TILE;
    for (uint32_t gi = 0; gi < m->rows / UMB_TILE; ++gi) {
        double s = m->s0 + gi * side * m->ds;
        lanes l = range_of_lanes(m, shape, s, s + side * m->ds);
        if (!(l.from <= l.to)) {
            continue;
        }
        for (uint32_t gj = (uint32_t)l.from / side; gj <= (uint32_t)l.to / side; ++gj) {
            if (!group_hides(m, kernels, shape, gi, gj)) {
                return false;
            }
        }
    }
    return true;
}

bool umb_ray_map_closed(umb_ray_map *m, double z_min, double z_max, double gap)
{
    const umb_ray_frame *f = m->frame;
    double slope = fmax(fabs(m->alpha1 * m->s0) + fabs(m->beta1 * m->t0), 1e-300);
    double u = fmin(f->hu + gap, gap / slope - f->hu) * (1.0 - SLACK) - f->error;
    umb_ray_shape shape = {.z0 = z_min - f->centre[f->axis_z] - f->error, .z1 = z_max - f->centre[f->axis_z] + f->error};
    umb_umbra_query q;
    if (!bounds_of(f, &shape, u, INFINITY, f->hu, -f->hu, f->hu, &q)) {
        return false;
    }
    uint32_t groups = m->columns / UMB_TILE;
    for (uint32_t g = 0; g < groups * (m->rows / UMB_TILE); ++g) {
        if (m->stale[g]) {
            sum_up_group(m, g / groups, g % groups);
        }
        if (!holds(&m->groups[g], &q)) {
            return false;
        }
    }
    return true;
}

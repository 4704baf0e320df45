/* What occlusion maps are asked. */
#include "ray_map.h"

#include <math.h>
#include <string.h>

#include "ray_tilt.h"

/* Relative slack of sums of doubles in this file: each is a handful of products of numbers of which the largest is
 * named, so 2^-44 of that is hundreds of times what rounding can do. */
#define SLACK 0x1p-44
/* What is so thin for its distance has one range of u for all lines. */
#define THIN 0x1p-5

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

bool umb_ray_shape_measure(const umb_ray_frame *f, const umb_ray_point *points, uint32_t count, umb_ray_shape *out)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = 0; i < count; ++i) {
        const umb_ray_point *p = &points[i];
        low[0] = umb_least(low[0], p->u);
        low[1] = umb_least(low[1], p->v);
        low[2] = umb_least(low[2], p->z);
        high[0] = umb_most(high[0], p->u);
        high[1] = umb_most(high[1], p->v);
        high[2] = umb_most(high[2], p->z);
    }
    out->u_min = low[0];
    out->u_max = high[0];
    out->v_min = low[1];
    out->v_max = high[1];
    out->z0 = low[2] - f->error;
    out->z1 = high[2] + f->error;
    return out->u_max >= -f->hu - f->error;
}

/* Every corner is as high or as low as the body gets: a wall, a house. */
static bool is_upright(const umb_ray_point *points, uint32_t count, const umb_ray_shape *shape)
{
    double low = INFINITY, high = -INFINITY, more = 0x1p-10 * (shape->z1 - shape->z0);
    for (uint32_t i = 0; i < count; ++i) {
        low = points[i].z > shape->z0 + more ? umb_least(low, points[i].z) : low;
        high = points[i].z < shape->z1 - more ? umb_most(high, points[i].z) : high;
    }
    return low > shape->z1 - more && high < shape->z0 + more;
}

bool umb_ray_shape_outline(const umb_ray_frame *f, const umb_ray_point *points, uint32_t count, bool in_order,
                           umb_ray_shape *out)
{
    umb_ray_point sorted[UMB_RAY_OUTLINE];
    const umb_ray_point *corners = points;
    uint32_t n = count;
    out->points = points;
    out->point_count = in_order || is_upright(points, count, out) ? 0 : count;
    if (!in_order) {
        uint8_t order[UMB_RAY_OUTLINE];
        n = umb_ray_hull(points, count, order);
        for (uint32_t i = 0; i < n; ++i) {
            sorted[i] = points[order[i]];
        }
        corners = sorted;
    }
    if (out->u_min < -f->hu) {
        out->count = cut(corners, n, -f->hu - f->error, out->outline);
        out->u_min = -f->hu - f->error;
    } else {
        out->count = n;
        memcpy(out->outline, corners, n * sizeof *corners);
    }
    return out->count > 0;
}

bool umb_ray_map_meets(const umb_ray_map *m, const umb_ray_shape *shape)
{
    double u = umb_most(shape->u_max, m->frame->hu), error = m->frame->error;
    double far = m->offset_most + m->slope_most * (u + error) + 2.0 * error;
    double high = m->frame->steep * (u + m->frame->hu + 4.0 * error);
    return shape->v_min <= far && shape->v_max >= -far && shape->z0 - m->frame->z1 <= high &&
           m->frame->z0 - shape->z1 <= high;
}

/* Bounds of a shape over a rectangle of the map. */
typedef struct beam {
    double s[2], t[2];
} beam;

static double f_error(const umb_ray_map *m, const umb_ray_point *p, const beam *b)
{
    double s = umb_most(fabs(b->s[0]), fabs(b->s[1])), t = umb_most(fabs(b->t[0]), fabs(b->t[1]));
    double alpha = fabs(m->alpha0) + fabs(m->alpha1 * p->u), beta = fabs(m->beta0) + fabs(m->beta1 * p->u);
    double shift = m->frame->error * (1.0 + fabs(m->alpha1) * s + fabs(m->beta1) * t);
    return SLACK * (fabs(p->v) + alpha * s + beta * t) + shift;
}

/* Where the outline is crossed, in u: false when no line of the beam meets it. */
static bool range_of_u(const umb_ray_map *m, const umb_ray_shape *shape, const beam *b, double *u_min, double *u_max)
{
    double f[UMB_RAY_OUTLINE][4], error[UMB_RAY_OUTLINE];
    double f_least = INFINITY, f_most = -INFINITY;
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
        f_least = umb_least(f_least, low);
        f_most = umb_most(f_most, high);
        if (low <= 0.0 && high >= 0.0) {
            *u_min = p->u < *u_min ? p->u : *u_min;
            *u_max = p->u > *u_max ? p->u : *u_max;
        }
    }
    if (f_least > 0.0 || f_most < 0.0) {
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
    *u_min = umb_most(*u_min, shape->u_min) - m->frame->error;
    *u_max = umb_least(*u_max, shape->u_max) + m->frame->error;
    return true;
}

/* Of rays with |dz| <= |du| none meets what is above or below the cell before it is as far away. */
static double least_u(const umb_ray_frame *f, const umb_ray_shape *shape)
{
    double away = umb_most(shape->z0 - f->z1, f->z0 - shape->z1);
    return away - SLACK * fabs(away) - f->hu - 4.0 * f->error;
}

/* Upper bound of m, lower bound of M and of u for what is at these heights and distances, seen from a cell whose back
 * and front lie between the given abscissae. ub_max: nothing is hidden that may lie before it. */
static bool bounds_of(const umb_ray_frame *f, const umb_ray_shape *shape, double u_min, double u_max,
                      double ua_max, double ub_min, double ub_max, umb_umbra_query *q)
{
    u_min = f->steep == 1.0f ? umb_most(u_min, least_u(f, shape)) : u_min;
    if (!(u_min > ub_max)) {
        return false;
    }
    double up = shape->z1 - f->z1, rise = shape->z0 - f->z0;
    double top = up >= 0.0 ? up / (u_min - ua_max) : up / (u_max - ub_min);
    double bottom = rise >= 0.0 ? rise / (u_max - ub_min) : rise / (u_min - ua_max);
    q->top = umb_float_above((float)(top + SLACK * fabs(top)));
    q->bottom = umb_float_below((float)(bottom - SLACK * fabs(bottom)));
    q->top = q->top < f->steep ? q->top : f->steep; /* no ray is steeper */
    q->bottom = q->bottom > -f->steep ? q->bottom : -f->steep;
    q->depth = umb_float_below((float)u_min);
    q->tilted = false;
    return true;
}

static bool holds(const umb_umbra_summary *s, const umb_umbra_query *q)
{
    return s->top >= q->top && s->bottom <= q->bottom && s->depth <= q->depth;
}

/* Where along t a point of the outline is, by s: at + s slope. */
typedef struct place {
    double at, slope;
} place;

typedef struct asked {
    umb_ray_map *map;
    const umb_umbra_kernels *kernels;
    const umb_ray_shape *shape;
    place places[UMB_RAY_OUTLINE];
    bool bounded; /* else lines of every t may meet it */
    bool thin;    /* all of it is about as far away */
} asked;

static void begin(asked *q, umb_ray_map *m, const umb_umbra_kernels *kernels, const umb_ray_shape *shape)
{
    q->map = m;
    q->kernels = kernels;
    q->shape = shape;
    q->bounded = true;
    q->thin = shape->u_max - shape->u_min <= THIN * (shape->u_min - m->frame->hu);
    for (uint32_t i = 0; i < shape->count && q->bounded; ++i) {
        const umb_ray_point *p = &shape->outline[i];
        double beta = m->beta0 + m->beta1 * p->u, r = 1.0 / beta;
        q->bounded = beta > 0x1p-20 * (fabs(m->beta0) + fabs(m->beta1 * p->u));
        q->places[i] = (place){p->v * r, -(m->alpha0 + m->alpha1 * p->u) * r};
    }
}

/* Pixels along t, safely outside; from > to: none. */
typedef struct lanes {
    double from, to;
} lanes;

/* Of lines of rows from s0 to s1 that meet the shape. */
static lanes range_of_lanes(const asked *q, double s0, double s1)
{
    const umb_ray_map *m = q->map;
    double n = m->columns * UMB_TILE, t_min = INFINITY, t_max = -INFINITY, scale = 1.0 / m->dt;
    if (!q->bounded) {
        return (lanes){0.0, n - 1.0};
    }
    for (uint32_t i = 0; i < q->shape->count; ++i) {
        double a = q->places[i].at + s0 * q->places[i].slope, b = q->places[i].at + s1 * q->places[i].slope;
        t_min = umb_least(t_min, umb_least(a, b));
        t_max = umb_most(t_max, umb_most(a, b));
    }
    double from = (t_min - m->t0) * scale - 0x1p-16, to = (t_max - m->t0) * scale + 0x1p-16;
    if (!(from < n && to >= 0.0)) {
        return (lanes){1.0, 0.0};
    }
    return (lanes){from > 0.0 ? (double)(uint32_t)from : 0.0, to < n ? (double)(uint32_t)to : n - 1.0};
}

/* ---- asking ------------------------------------------------------------------------------------- */

static void sum_up_group(umb_ray_map *m, uint32_t gi, uint32_t gj)
{
    uint32_t groups = m->columns / UMB_TILE;
    umb_umbra_summary s = {INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = gi * m->group_rows; i < (gi + 1) * m->group_rows; ++i) {
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

/* Of tiles. */
static beam rectangle(const umb_ray_map *m, uint32_t i, uint32_t j, uint32_t rows, uint32_t columns)
{
    double s = UMB_TILE * m->ds, t = UMB_TILE * m->dt;
    return (beam){{m->s0 + i * s, m->s0 + (i + rows) * s}, {m->t0 + j * t, m->t0 + (j + columns) * t}};
}

/* The range of u over a rectangle of the map: false if no line meets the shape there. */
static bool range_over(const asked *q, const beam *b, double *u_min, double *u_max)
{
    if (q->thin) {
        *u_min = q->shape->u_min - q->map->frame->error;
        *u_max = q->shape->u_max + q->map->frame->error;
        return true;
    }
    return range_of_u(q->map, q->shape, b, u_min, u_max);
}

/* The summary holds all that lines may meet of the shape anywhere: what most of what is hidden needs no more than. */
static bool holds_anywhere(const asked *a, const umb_umbra_summary *s, const float span[3])
{
    const umb_ray_frame *f = a->map->frame;
    umb_umbra_query q;
    return bounds_of(f, a->shape, a->shape->u_min - f->error, a->shape->u_max + f->error, span[0], span[1], span[2], &q) && holds(s, &q);
}

/* The pixels of a tile that lines to the shape may go through. */
static uint64_t touched_pixels(const asked *a, uint32_t i, uint32_t j, umb_umbra_query *q)
{
    const umb_ray_map *m = a->map;
    uint64_t touched = 0;
    for (uint32_t r = 0; r < UMB_TILE; ++r) {
        double s = m->s0 + (i * UMB_TILE + r) * m->ds;
        lanes l = range_of_lanes(a, s, s + m->ds);
        double from = umb_most(0.0, l.from - j * UMB_TILE), to = umb_least(UMB_TILE - 1.0, l.to - j * UMB_TILE);
        q->from[r] = (float)from;
        q->to[r] = (float)to;
        if (from <= to) {
            touched |= ((UINT64_C(2) << (uint32_t)to) - (UINT64_C(1) << (uint32_t)from)) << (r * UMB_TILE);
        }
    }
    return touched;
}

static bool tile_hides(const asked *a, uint32_t i, uint32_t j)
{
    const umb_ray_map *m = a->map;
    uint32_t tile = i * m->columns + j;
    if (m->live[tile] == 0) {
        return true;
    }
    umb_umbra_query q;
    double u_min, u_max;
    const float *span = m->spans[i * (m->columns / UMB_TILE) + j / UMB_TILE];
    if (m->drawn[tile] && !a->thin && holds_anywhere(a, &m->summaries[tile], (const float[3]){span[0], span[1], span[1]})) {
        return true;
    }
    beam b = rectangle(m, i, j, 1, 1);
    if (!range_over(a, &b, &u_min, &u_max)) {
        return true;
    }
    bool bounded = m->drawn[tile] && bounds_of(m->frame, a->shape, u_min, u_max, span[0], span[1], span[1], &q);
    if (bounded && holds(&m->summaries[tile], &q)) {
        return true;
    }
    uint64_t touched = touched_pixels(a, i, j, &q) & m->live[tile];
    if (touched == 0) {
        return true;
    }
    if (!bounded) {
        return false;
    }
    const umb_umbra_tile *intervals = &m->intervals[(size_t)tile * m->umbrae];
    if (a->kernels->open(intervals, m->umbrae, &q) == 0) {
        return true;
    }
    umb_ray_tilt tilt = {m, a->shape, b.s[0], b.t[0], u_min, u_max, span[0], span[1]};
    return umb_ray_tilt_bound(&tilt, a->kernels, &q) && a->kernels->open(intervals, m->umbrae, &q) == 0;
}

static bool group_holds(const asked *a, uint32_t gi, uint32_t gj)
{
    umb_ray_map *m = a->map;
    uint32_t group = gi * (m->columns / UMB_TILE) + gj;
    double u_min, u_max;
    beam b = rectangle(m, gi * m->group_rows, gj * UMB_TILE, m->group_rows, UMB_TILE);
    const float *span = m->group_spans[group];
    if (m->stale[group]) {
        sum_up_group(m, gi, gj);
    }
    if (!a->thin && holds_anywhere(a, &m->groups[group], span)) {
        return true;
    }
    if (!range_over(a, &b, &u_min, &u_max)) {
        return true;
    }
    umb_umbra_query q;
    return bounds_of(m->frame, a->shape, u_min, u_max, span[0], span[1], span[2], &q) && holds(&m->groups[group], &q);
}

static bool group_hides(const asked *a, uint32_t gi, uint32_t gj, uint32_t *tile)
{
    const umb_ray_map *m = a->map;
    if (group_holds(a, gi, gj)) {
        return true;
    }
    for (uint32_t i = gi * m->group_rows; i < (gi + 1) * m->group_rows; ++i) {
        double s = m->s0 + i * UMB_TILE * m->ds;
        lanes l = range_of_lanes(a, s, s + UMB_TILE * m->ds);
        double from = umb_most(l.from / UMB_TILE, gj * UMB_TILE), to = umb_least(l.to / UMB_TILE, (gj + 1) * UMB_TILE - 1.0);
        if (!(l.from <= l.to)) {
            continue;
        }
        for (uint32_t j = (uint32_t)from; j <= to; ++j) {
            if (!tile_hides(a, i, j)) {
                *tile = i * m->columns + j;
                return false;
            }
        }
    }
    return true;
}

bool umb_ray_map_hides(umb_ray_map *m, const umb_umbra_kernels *kernels, const umb_ray_shape *shape, uint32_t *tile)
{
    uint32_t high = UMB_TILE * m->group_rows, wide = UMB_TILE * UMB_TILE;
    asked a;
    begin(&a, m, kernels, shape);
    for (uint32_t gi = 0; gi < m->rows / m->group_rows; ++gi) {
        double s = m->s0 + gi * high * m->ds;
        lanes l = range_of_lanes(&a, s, s + high * m->ds);
        if (!(l.from <= l.to)) {
            continue;
        }
        for (uint32_t gj = (uint32_t)l.from / wide; gj <= (uint32_t)l.to / wide; ++gj) {
            if (!group_hides(&a, gi, gj, tile)) {
                return false;
            }
        }
    }
    return true;
}

bool umb_ray_map_tile_hides(umb_ray_map *m, const umb_umbra_kernels *kernels, const umb_ray_shape *shape,
                            uint32_t tile)
{
    asked a;
    begin(&a, m, kernels, shape);
    return tile_hides(&a, tile / m->columns, tile % m->columns);
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
    for (uint32_t g = 0; g < groups * (m->rows / m->group_rows); ++g) {
        if (m->stale[g]) {
            sum_up_group(m, g / groups, g % groups);
        }
        if (!holds(&m->groups[g], &q)) {
            return false;
        }
    }
    return true;
}

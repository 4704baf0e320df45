#include "ray_map.h"

#include <math.h>
#include <string.h>

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
    span[0] = umb_float_below((float)ua);
    span[1] = umb_float_above((float)ub);
}

/* Over the rows of a group: the largest ua, the least and the largest ub. */
static void sum_up_spans(umb_ray_map *m)
{
    uint32_t groups = m->columns / UMB_TILE;
    for (uint32_t g = 0; g < groups * (m->rows / m->group_rows); ++g) {
        float *sum = m->group_spans[g];
        sum[0] = sum[2] = -INFINITY;
        sum[1] = INFINITY;
        for (uint32_t i = 0; i < m->group_rows; ++i) {
            const float *span = m->spans[(g / groups * m->group_rows + i) * groups + g % groups];
            sum[0] = fmaxf(sum[0], span[0]);
            sum[1] = fminf(sum[1], span[1]);
            sum[2] = fmaxf(sum[2], span[1]);
        }
    }
}

/* How far lines are from the middle at u = 0, and how steep, at most. */
static void find_reach(umb_ray_map *m)
{
    double s = fmax(fabs(m->s0), fabs(m->s0 + m->rows * UMB_TILE * m->ds));
    double t = fmax(fabs(m->t0), fabs(m->t0 + m->columns * UMB_TILE * m->dt));
    m->offset_most = (fabs(m->alpha0) * s + fabs(m->beta0) * t) * (1.0 + 0x1p-40);
    m->slope_most = (fabs(m->alpha1) * s + fabs(m->beta1) * t) * (1.0 + 0x1p-40);
}

typedef struct map_layout {
    size_t intervals, summaries, groups, live, drawn, stale, spans, group_spans, bytes;
} map_layout;

static size_t place(size_t *bytes, size_t count, size_t size)
{
    size_t at = *bytes;
    *bytes = (at + count * size + 63) & ~(size_t)63;
    return at;
}

static map_layout lay_out(uint32_t rows, uint32_t columns, uint32_t umbrae)
{
    size_t tiles = (size_t)rows * columns, high = rows < UMB_TILE ? rows : UMB_TILE, groups = tiles / (high * UMB_TILE);
    map_layout l = {0};
    l.intervals = place(&l.bytes, tiles * umbrae, sizeof(umb_umbra_tile));
    l.summaries = place(&l.bytes, tiles, sizeof(umb_umbra_summary));
    l.groups = place(&l.bytes, groups, sizeof(umb_umbra_summary));
    l.live = place(&l.bytes, tiles, sizeof(uint64_t));
    l.drawn = place(&l.bytes, tiles, sizeof(bool));
    l.stale = place(&l.bytes, groups, sizeof(bool));
    l.spans = place(&l.bytes, tiles / UMB_TILE, 2 * sizeof(float));
    l.group_spans = place(&l.bytes, groups, 3 * sizeof(float));
    return l;
}

umb_result umb_ray_map_begin(umb_ray_map *map, const umb_allocator *a, const umb_ray_frame *frame,
                             const umb_ray_layout *layout)
{
    uint32_t rows = layout->rows / UMB_TILE, columns = layout->columns / UMB_TILE;
    map_layout l = lay_out(rows, columns, layout->umbrae);
    char *block = (char *)map->intervals;
    if (map->bytes != l.bytes) {
        umb_ray_map_free(map, a);
        block = umb_memory_allocate(a, l.bytes);
        if (block == NULL) {
            return UMB_ERROR_MEMORY;
        }
    }
    *map = (umb_ray_map){.frame = frame, .rows = rows, .columns = columns, .umbrae = layout->umbrae, .bytes = l.bytes};
    map->group_rows = rows < UMB_TILE ? rows : UMB_TILE;
    map->intervals = (umb_umbra_tile *)(void *)(block + l.intervals);
    map->summaries = (umb_umbra_summary *)(void *)(block + l.summaries);
    map->groups = (umb_umbra_summary *)(void *)(block + l.groups);
    map->live = (uint64_t *)(void *)(block + l.live);
    map->drawn = (bool *)(block + l.drawn);
    map->stale = (bool *)(block + l.stale);
    map->spans = (float(*)[2])(void *)(block + l.spans);
    map->group_spans = (float(*)[3])(void *)(block + l.group_spans);
    choose_rays(map, layout->kind, layout->outer);
    for (uint32_t i = 0; i < rows; ++i) {
        for (uint32_t j = 0; j < columns; ++j) {
            map->live[i * columns + j] = live_pixels(map, layout->kind, layout->outer, i, j);
            map->summaries[i * columns + j] = map->live[i * columns + j] != 0
                                               ? (umb_umbra_summary){-INFINITY, INFINITY, INFINITY}
                                               : (umb_umbra_summary){INFINITY, -INFINITY, -INFINITY};
        }
        for (uint32_t g = 0; g < columns / UMB_TILE; ++g) {
            find_span(map, i, g, map->spans[i * (columns / UMB_TILE) + g]);
        }
    }
    sum_up_spans(map);
    find_reach(map);
    memset(map->drawn, 0, (size_t)rows * columns * sizeof *map->drawn);
    memset(map->stale, 1, (size_t)rows / map->group_rows * (columns / UMB_TILE) * sizeof *map->stale);
    return UMB_OK;
}

void umb_ray_map_free(umb_ray_map *map, const umb_allocator *a)
{
    if (map->bytes > 0) {
        umb_memory_free(a, map->intervals, map->bytes);
    }
    memset(map, 0, sizeof *map);
}

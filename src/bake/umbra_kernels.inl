/* The kernels of umbra_kernels.h. Included by one file for each instruction set, with KERNELS and ISA defined. */
#include <math.h>

#include "base/simd.h"
#include "umbra_kernels.h"

/* Tests plant mistakes, to see that they are found: 1 to 4. */
#ifndef UMB_MUTANT
#define UMB_MUTANT 0
#endif

#define COLUMNS ((UMB_TILE + 1) * UMB_TILE) /* corners along t of the widest run, and some to spare */
#define ROUNDING 0x1p-21f                   /* of a quotient, and of what is added to it */
#define LEAST 1e-30f

/* What is known at each corner of a run's pixels. */
typedef struct corner_values {
    float top[COLUMNS], top_far[COLUMNS], bottom_far[COLUMNS], bottom[COLUMNS];
    float depth[COLUMNS], margin[COLUMNS];
} corner_values;

/* Where chains cross the slices of the corners of one vector. */
typedef struct crossing {
    umb_fv u, z, error_u, error_z;
    umb_iv here; /* the edge is crossed, as far as rounding can tell */
} crossing;

UMB_INLINE umb_fv at_corner(const umb_umbra_vertex *v, umb_fv row, umb_fv column)
{
    return (umb_fv_set(v->f) - row * v->ds) - column * v->dt;
}

UMB_INLINE umb_fv lanes_from(float first)
{
    static const float steps[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    return umb_fv_load(steps) + first;
}

/* T2: the crossing is a ratio of values at the ends. Its error is that of f over the difference of f along the
 * edge, and at most the edge. */
UMB_INLINE crossing cross(const umb_umbra *o, umb_umbra_edge edge, umb_fv row, umb_fv column)
{
    const umb_umbra_vertex *a = &o->vertices[edge.a], *b = &o->vertices[edge.b];
    umb_fv fa = at_corner(a, row, column), fb = at_corner(b, row, column);
    umb_fv zero = umb_fv_set(0.0f), one = umb_fv_set(1.0f);
    crossing c;
    c.here = (umb_iv)(((fa <= a->error) & (fb >= -b->error)) | ((fa >= -a->error) & (fb <= b->error)));
    if (!umb_iv_any(c.here)) {
        return c;
    }
    umb_fv r = one / (fb - fa);
    umb_fv part = umb_fv_clamp(zero - fa * r, zero, one);
    umb_fv off = umb_fv_min(umb_fv_abs(r) * (a->error + b->error), one);
    float du = b->u - a->u, dz = b->z - a->z;
    c.u = part * du + a->u;
    c.z = part * dz + a->z;
    c.error_u = off * (du < 0.0f ? -du : du) + o->error_u;
    c.error_z = off * (dz < 0.0f ? -dz : dz) + o->error_z;
    return c;
}

UMB_INLINE umb_fv lower(umb_fv q)
{
    return q - (umb_fv_abs(q) * ROUNDING + LEAST);
}

UMB_INLINE umb_fv upper(umb_fv q)
{
    return q + (umb_fv_abs(q) * ROUNDING + LEAST);
}

/* Lower bounds of m and M where a top chain is crossed. */
UMB_INLINE void cross_top(const umb_umbra *o, const crossing *c, bool near_quotient, bool half, umb_fv *m, umb_fv *far)
{
    umb_fv up = c->z - o->z1 - c->error_z, a = c->u - o->ua, b = c->u - o->ub;
    umb_iv above = (umb_iv)(up >= 0.0f);
#if UMB_MUTANT == 2 /* the front of the cell for every top */
    above = umb_iv_set(0);
#endif
    *m = lower(up / umb_fv_select(above, a + c->error_u, b - c->error_u));
    if (!half) {
        umb_fv rise = c->z - o->z0 - c->error_z, from = near_quotient ? b : a;
        *far = lower(rise / umb_fv_select((umb_iv)(rise >= 0.0f), from + c->error_u, from - c->error_u));
    }
}

/* Upper bounds of M and m where a bottom chain is crossed. */
UMB_INLINE void cross_bottom(const umb_umbra *o, const crossing *c, bool near_quotient, umb_fv *M, umb_fv *far)
{
    umb_fv rise = c->z - o->z0 + c->error_z, a = c->u - o->ua, b = c->u - o->ub;
    umb_iv above = (umb_iv)(rise >= 0.0f);
    *M = upper(rise / umb_fv_select(above, b - c->error_u, a + c->error_u));
    umb_fv up = c->z - o->z1 + c->error_z, from = near_quotient ? b : a;
    *far = upper(up / umb_fv_select((umb_iv)(up >= 0.0f), from - c->error_u, from + c->error_u));
}

typedef struct sums {
    umb_fv top, top_far, bottom_far, bottom, depth, margin;
} sums;

UMB_INLINE void add_depth(const umb_umbra *o, const crossing *c, sums *s)
{
    umb_fv none = umb_fv_set(INFINITY);
    s->depth = umb_fv_max(s->depth, umb_fv_select(c->here, upper(c->u + c->error_u), -none));
    s->margin = umb_fv_min(s->margin, umb_fv_select(c->here, (c->u - o->ub) - c->error_u * 16.0f, none));
}

UMB_INLINE void corners_of_vector(const umb_umbra *o, bool half, umb_fv row, umb_fv column, sums *s)
{
    umb_fv none = umb_fv_set(INFINITY);
    *s = (sums){none, none, -none, -none, -none, none};
    for (uint32_t e = 0; e < o->top_count; ++e) {
        crossing c = cross(o, o->top[e], row, column);
        if (!umb_iv_any(c.here)) {
            continue;
        }
        umb_fv m, far = none;
        cross_top(o, &c, o->top[e].near_quotient != 0, half, &m, &far);
        s->top = umb_fv_min(s->top, umb_fv_select(c.here, m, none));
        s->top_far = umb_fv_min(s->top_far, umb_fv_select(c.here, far, none));
        if (!o->outlined) {
            add_depth(o, &c, s);
        }
    }
    for (uint32_t e = 0; e < o->bottom_count; ++e) {
        crossing c = cross(o, o->bottom[e], row, column);
        if (!umb_iv_any(c.here)) {
            continue;
        }
        if (!o->floor) {
            umb_fv M, far;
            cross_bottom(o, &c, o->bottom[e].near_quotient != 0, &M, &far);
            s->bottom = umb_fv_max(s->bottom, umb_fv_select(c.here, M, -none));
            s->bottom_far = umb_fv_max(s->bottom_far, umb_fv_select(c.here, far, -none));
        }
        if (!o->outlined) {
            add_depth(o, &c, s);
        }
    }
    for (uint32_t e = 0; e < o->depth_count; ++e) {
        crossing c = cross(o, o->depth[e], row, column);
        if (umb_iv_any(c.here)) {
            add_depth(o, &c, s);
        }
    }
}

static void corners_of_row(const umb_umbra *o, bool half, uint32_t from, uint32_t to, float row, corner_values *out)
{
    umb_fv r = umb_fv_set(row);
    for (uint32_t j = from; j < to; j += UMB_LANES) {
        sums s;
#if UMB_MUTANT == 1 /* middles of pixels instead of their corners */
        corners_of_vector(o, half, r + 0.5f, lanes_from((float)j + 0.5f), &s);
#else
        corners_of_vector(o, half, r, lanes_from((float)j), &s);
#endif
        umb_fv_store(out->top + j, s.top);
        umb_fv_store(out->depth + j, s.depth);
        umb_fv_store(out->margin + j, s.margin);
        if (!half) {
            umb_fv_store(out->top_far + j, s.top_far);
            umb_fv_store(out->bottom_far + j, s.bottom_far);
            umb_fv_store(out->bottom + j, s.bottom);
        }
    }
}

UMB_INLINE umb_fv least_of_four(const float *a, const float *b)
{
#if UMB_MUTANT == 1
    (void)b;
    return umb_fv_load(a);
#endif
    return umb_fv_min(umb_fv_min(umb_fv_load(a), umb_fv_load(a + 1)),
                      umb_fv_min(umb_fv_load(b), umb_fv_load(b + 1)));
}

UMB_INLINE umb_fv most_of_four(const float *a, const float *b)
{
#if UMB_MUTANT == 1
    (void)b;
    return umb_fv_load(a);
#endif
    return umb_fv_max(umb_fv_max(umb_fv_load(a), umb_fv_load(a + 1)),
                      umb_fv_max(umb_fv_load(b), umb_fv_load(b + 1)));
}

/* Least and greatest f of a vertex over each pixel. */
UMB_INLINE void over_pixel(const umb_umbra_vertex *v, umb_fv row, umb_fv column, umb_fv *least, umb_fv *most)
{
    umb_fv f = at_corner(v, row, column);
    float high = (v->ds < 0.0f ? -v->ds : 0.0f) + (v->dt < 0.0f ? -v->dt : 0.0f);
    float low = (v->ds > 0.0f ? v->ds : 0.0f) + (v->dt > 0.0f ? v->dt : 0.0f);
    *least = f - low - v->error;
    *most = f + high + v->error;
#if UMB_MUTANT == 4 /* covered where its middle is */
    *least = *most = f - 0.5f * (v->ds + v->dt);
#endif
}

/* Pixels that straddle a vertex of a chain see it. */
UMB_INLINE void add_vertices(const umb_umbra *o, umb_fv row, umb_fv column, sums *s)
{
    uint64_t all = o->top_inner | o->bottom_inner | o->depth_inner;
    for (; all != 0; all &= all - 1) {
        uint32_t i = (uint32_t)__builtin_ctzll(all);
        const umb_umbra_vertex *v = &o->vertices[i];
        umb_fv least, most;
        over_pixel(v, row, column, &least, &most);
        umb_iv here = (umb_iv)((least <= 0.0f) & (most >= 0.0f));
        if (!umb_iv_any(here)) {
            continue;
        }
        if ((o->top_inner >> i & 1) != 0) {
            s->top = umb_fv_select(here, umb_fv_min(s->top, umb_fv_set(v->top)), s->top);
            s->top_far = umb_fv_select(here, umb_fv_min(s->top_far, umb_fv_set(v->top_far)), s->top_far);
        }
        if ((o->bottom_inner >> i & 1) != 0) {
            s->bottom = umb_fv_select(here, umb_fv_max(s->bottom, umb_fv_set(v->bottom)), s->bottom);
            s->bottom_far = umb_fv_select(here, umb_fv_max(s->bottom_far, umb_fv_set(v->bottom_far)), s->bottom_far);
        }
        s->depth = umb_fv_select(here, umb_fv_max(s->depth, umb_fv_set(v->depth)), s->depth);
        s->margin = umb_fv_select(here, umb_fv_min(s->margin, umb_fv_set(v->margin)), s->margin);
    }
}

/* The umbra of eight pixels (as far as a vector goes), and where it covers them. */
UMB_INLINE umb_iv pixels_of_row(const umb_umbra *o, bool half, const corner_values *above, const corner_values *below,
                                float row, uint32_t j, sums *s)
{
    umb_fv r = umb_fv_set(row), column = lanes_from((float)j), least, most;
    s->top = least_of_four(above->top + j, below->top + j);
    s->depth = most_of_four(above->depth + j, below->depth + j);
    s->margin = least_of_four(above->margin + j, below->margin + j);
    s->top_far = s->bottom_far = s->bottom = umb_fv_set(-INFINITY);
    if (!half) {
        s->top_far = least_of_four(above->top_far + j, below->top_far + j);
        if (!o->floor) {
            s->bottom_far = most_of_four(above->bottom_far + j, below->bottom_far + j);
            s->bottom = most_of_four(above->bottom + j, below->bottom + j);
        }
    }
    umb_iv covered = umb_iv_set(-1);
    for (int i = 0; i < 2 && (i == 0 || o->low[1] != o->low[0] || o->high[1] != o->high[0]); ++i) {
        over_pixel(&o->vertices[o->low[i]], r, column, &least, &most);
        covered &= (umb_iv)(most <= 0.0f);
        over_pixel(&o->vertices[o->high[i]], r, column, &least, &most);
        covered &= (umb_iv)(least >= 0.0f);
    }
    if (!umb_iv_any(covered)) {
        return covered;
    }
    add_vertices(o, r, column, s);
    if (o->floor) {
        s->bottom = s->bottom_far = umb_fv_set(-INFINITY);
    }
    return covered & (umb_iv)(s->margin > 0.0f) & (umb_iv)(s->top > -INFINITY) & (umb_iv)(s->bottom < INFINITY);
}

/* ---- merging ------------------------------------------------------------------------------- */

UMB_INLINE void load_interval(const umb_umbra_tile *t, uint32_t at, sums *s)
{
    s->top = umb_fv_load(t->top + at);
    s->top_far = umb_fv_load(t->top_far + at);
    s->bottom_far = umb_fv_load(t->bottom_far + at);
    s->bottom = umb_fv_load(t->bottom + at);
    s->depth = umb_fv_load(t->depth + at);
}

UMB_INLINE void store_interval(umb_umbra_tile *t, uint32_t at, const sums *s)
{
    umb_fv_store(t->top + at, s->top);
    umb_fv_store(t->top_far + at, s->top_far);
    umb_fv_store(t->bottom_far + at, s->bottom_far);
    umb_fv_store(t->bottom + at, s->bottom);
    umb_fv_store(t->depth + at, s->depth);
}

UMB_INLINE void choose(umb_iv mask, const sums *a, const sums *b, sums *out)
{
    out->top = umb_fv_select(mask, a->top, b->top);
    out->top_far = umb_fv_select(mask, a->top_far, b->top_far);
    out->bottom_far = umb_fv_select(mask, a->bottom_far, b->bottom_far);
    out->bottom = umb_fv_select(mask, a->bottom, b->bottom);
    out->depth = umb_fv_select(mask, a->depth, b->depth);
}

/* T3, with every interval of the pixel: what holds the new one drops it; what it holds goes; what overlaps it in
 * the order that all of the cell agrees on is joined to it. */
UMB_INLINE umb_iv join(umb_umbra_tile *tiles, uint32_t umbrae, uint32_t at, sums *c, umb_iv here, bool *joined)
{
    const sums empty = {umb_fv_set(-INFINITY), umb_fv_set(-INFINITY), umb_fv_set(INFINITY),
                        umb_fv_set(INFINITY), umb_fv_set(INFINITY), umb_fv_set(0.0f)};
    *joined = false;
    for (uint32_t k = 0; k < umbrae && umb_iv_any(here); ++k) {
        sums old, top, bottom;
        load_interval(&tiles[k], at, &old);
        here &= ~(umb_iv)((old.top >= c->top) & (old.bottom <= c->bottom));
        umb_iv inside = here & (umb_iv)((c->top >= old.top) & (c->bottom <= old.bottom) & (old.top > -INFINITY));
        umb_iv meet = here & ~inside & (umb_iv)((old.top >= c->bottom_far) & (old.top_far >= c->bottom) &
                                                (c->top >= old.bottom_far) & (c->top_far >= old.bottom));
#if UMB_MUTANT == 3 /* joined without a look at whether they overlap */
        meet = here & ~inside & (umb_iv)(old.top > -INFINITY);
#endif
        if (!umb_iv_any(inside | meet)) {
            continue;
        }
        *joined = *joined || umb_iv_any(meet);
        choose((umb_iv)(c->top >= old.top), c, &old, &top);
        choose((umb_iv)(c->bottom <= old.bottom), c, &old, &bottom);
        top.bottom = bottom.bottom;
        top.bottom_far = bottom.bottom_far;
        top.depth = umb_fv_max(c->depth, old.depth);
        choose(meet, &top, c, c);
        choose(inside | meet, &empty, &old, &old);
        store_interval(&tiles[k], at, &old);
    }
    return here;
}

/* Widest first; the narrowest goes. */
UMB_INLINE void keep(umb_umbra_tile *tiles, uint32_t umbrae, uint32_t at, sums *c, umb_iv here)
{
    for (uint32_t k = 0; k < umbrae && umb_iv_any(here); ++k) {
        sums old, kept;
        load_interval(&tiles[k], at, &old);
        umb_iv wider = here & (umb_iv)(c->top - c->bottom > old.top - old.bottom);
        if (!umb_iv_any(wider)) {
            continue;
        }
        choose(wider, c, &old, &kept);
        choose(wider, &old, c, c);
        store_interval(&tiles[k], at, &kept);
        here &= (umb_iv)(c->top > -INFINITY); /* nothing is left to keep */
    }
}

/* No ray passes above a top that all of the cell sees as steep as rays get: it may as well be endless. Nor below such a
 * bottom.  */
UMB_INLINE void open_ends(sums *c, float steep)
{
    umb_iv over = (umb_iv)(c->top >= steep), under = (umb_iv)(c->bottom <= -steep);
    c->top = umb_fv_select(over, umb_fv_set(UMB_UMBRA_ENDLESS), c->top);
    c->top_far = umb_fv_select(over, umb_fv_set(UMB_UMBRA_ENDLESS), c->top_far);
    c->bottom = umb_fv_select(under, umb_fv_set(-UMB_UMBRA_ENDLESS), c->bottom);
    c->bottom_far = umb_fv_select(under, umb_fv_set(-UMB_UMBRA_ENDLESS), c->bottom_far);
}

static void merge_full(umb_umbra_tile *tiles, uint32_t umbrae, uint32_t at, float steep, sums *c, umb_iv here)
{
    open_ends(c, steep);
    bool joined;
    here = join(tiles, umbrae, at, c, here, &joined);
    if (umbrae > 1 && joined) { /* what has grown may meet others */
        here = join(tiles, umbrae, at, c, here, &joined);
    }
    keep(tiles, umbrae, at, c, here);
}

/* Tops alone: the higher one stays, as deep as the deeper (T3 with bottoms below everything). */
static void merge_half(umb_umbra_tile *t, uint32_t at, const sums *c, umb_iv here)
{
    umb_fv top = umb_fv_load(t->top + at), depth = umb_fv_load(t->depth + at);
    umb_iv higher = here & (umb_iv)(c->top > top);
    umb_iv first = higher & (umb_iv)(top == -INFINITY);
    umb_fv deeper = umb_fv_select(first, c->depth, umb_fv_max(depth, c->depth));
    umb_fv_store(t->top + at, umb_fv_select(higher, c->top, top));
    umb_fv_store(t->depth + at, umb_fv_select(higher, deeper, depth));
    umb_fv_store(t->bottom + at, umb_fv_select(higher, umb_fv_set(-INFINITY), umb_fv_load(t->bottom + at)));
}

static umb_umbra_summary sum_up(const umb_umbra_tile *t)
{
    umb_fv top = umb_fv_load(t->top), bottom = umb_fv_load(t->bottom), depth = umb_fv_load(t->depth);
    for (uint32_t i = UMB_LANES; i < 64; i += UMB_LANES) {
        top = umb_fv_min(top, umb_fv_load(t->top + i));
        bottom = umb_fv_max(bottom, umb_fv_load(t->bottom + i));
        depth = umb_fv_max(depth, umb_fv_load(t->depth + i));
    }
    return (umb_umbra_summary){umb_fv_least(top), -umb_fv_least(-bottom), -umb_fv_least(-depth)};
}

static void draw(umb_umbra_draw *d)
{
    const umb_umbra *o = d->umbra;
    corner_values values[2];
    uint32_t first = 0, columns = d->tile_count * UMB_TILE + 1;
    while (d->tiles[first] == NULL) {
        ++first;
    }
    first *= UMB_TILE;
    corners_of_row(o, d->half, first, columns, 0.0f, &values[0]);
    for (uint32_t r = 0; r < UMB_TILE; ++r) {
        const corner_values *above = &values[r & 1], *below = &values[(r + 1) & 1];
        corners_of_row(o, d->half, first, columns, (float)(r + 1), &values[(r + 1) & 1]);
        for (uint32_t j = first; j < d->tile_count * UMB_TILE; j += UMB_LANES) {
            umb_umbra_tile *tile = d->tiles[j / UMB_TILE];
            if (tile == NULL) {
                continue;
            }
            sums s;
            umb_iv here = pixels_of_row(o, d->half, above, below, (float)r, j, &s);
            if (umb_iv_any(here) && d->half) {
                merge_half(tile, r * UMB_TILE + j % UMB_TILE, &s, here);
            } else if (umb_iv_any(here)) {
                merge_full(tile, d->umbrae, r * UMB_TILE + j % UMB_TILE, d->steep, &s, here);
            }
        }
    }
    for (uint32_t i = 0; i < d->tile_count; ++i) {
        if (d->tiles[i] != NULL) {
            d->summaries[i] = sum_up(d->tiles[i]);
        }
    }
}

static umb_umbra_summary fill(umb_umbra_tile *tiles, uint32_t umbrae, const umb_umbra_strip *strip, bool half)
{
    const sums all = {umb_fv_set(strip->top), umb_fv_set(strip->top_far), umb_fv_set(strip->bottom_far),
                      umb_fv_set(strip->bottom), umb_fv_set(strip->depth), umb_fv_set(0.0f)};
    for (uint32_t r = 0; r < UMB_TILE; ++r) {
        for (uint32_t j = 0; j < UMB_TILE; j += UMB_LANES) {
            umb_fv lane = lanes_from((float)j);
            umb_iv here = (umb_iv)((lane >= strip->from[r]) & (lane <= strip->to[r]));
            sums s = all;
            if (umb_iv_any(here) && half) {
                merge_half(tiles, r * UMB_TILE + j, &s, here);
            } else if (umb_iv_any(here)) {
                merge_full(tiles, umbrae, r * UMB_TILE + j, strip->steep, &s, here);
            }
        }
    }
    return sum_up(tiles);
}

static uint64_t open_pixels(const umb_umbra_tile *tiles, uint32_t umbrae, const umb_umbra_query *q)
{
    uint64_t open = 0;
    umb_fv depth = umb_fv_set(q->depth);
    for (uint32_t r = 0; r < UMB_TILE; ++r) {
        for (uint32_t j = 0; j < UMB_TILE; j += UMB_LANES) {
            uint32_t at = r * UMB_TILE + j;
            umb_fv lane = lanes_from((float)j), top = umb_fv_set(q->top), bottom = umb_fv_set(q->bottom);
            umb_iv asked = (umb_iv)((lane >= q->from[r]) & (lane <= q->to[r]));
            if (q->tilted && umb_iv_any(asked)) {
                top = umb_fv_load(q->tops + at);
                bottom = umb_fv_load(q->bottoms + at);
            }
            for (uint32_t k = 0; k < umbrae && umb_iv_any(asked); ++k) {
                const umb_umbra_tile *t = &tiles[k];
                asked &= ~(umb_iv)((umb_fv_load(t->top + at) >= top) & (umb_fv_load(t->bottom + at) <= bottom) &
                                   (umb_fv_load(t->depth + at) <= depth));
            }
            open |= (uint64_t)umb_iv_bits(asked) << at;
        }
    }
    return open;
}

static float bound(const umb_umbra_picture *p, const umb_umbra_query *q, float sign, float out[64])
{
    umb_fv greatest = umb_fv_set(-INFINITY);
    for (uint32_t r = 0; r < UMB_TILE; ++r) {
        if (q->from[r] > q->to[r]) {
            continue;
        }
        for (uint32_t j = 0; j < UMB_TILE; j += UMB_LANES) {
            umb_fv lane = lanes_from((float)j), y = umb_fv_set(p->limit);
            for (uint32_t k = 0; k < p->slope_count; ++k) {
                umb_fv line = umb_fv_set(-INFINITY);
                for (uint32_t i = 0; i < p->corner_count; ++i) {
                    line = umb_fv_max(line, lane * p->dt[k][i] + ((float)r * p->ds[k][i] + p->at[k][i]));
                }
                y = umb_fv_min(y, line + p->more[k]);
            }
            greatest = umb_fv_max(greatest, y);
            umb_fv_store(out + r * UMB_TILE + j, y * sign);
        }
    }
    return -umb_fv_least(-greatest);
}

const umb_umbra_kernels KERNELS = {ISA, draw, fill, open_pixels, bound};

#include "fill.h"

#include <string.h>

#include "base/memory.h"
#include "pixel.h"

bool umb_fill_resize(umb_fill *f, const umb_allocator *a, uint32_t width, uint32_t height)
{
    uint32_t words = (width + 31) / 32;
    size_t need = (size_t)words * height;
    if (need > f->capacity) {
        umb_fill g = {0};
        g.touched = umb_memory_allocate_zero(a, need, sizeof *g.touched);
        g.crossings = umb_memory_allocate_zero(a, need * 32, sizeof *g.crossings);
        g.crossed = umb_memory_allocate_zero(a, need, sizeof *g.crossed);
        g.capacity = need;
        if (g.touched == NULL || g.crossings == NULL || g.crossed == NULL) {
            umb_fill_free(&g, a);
            return false;
        }
        umb_fill_free(f, a);
        *f = g;
    }
    f->words = words;
    return true;
}

void umb_fill_free(umb_fill *f, const umb_allocator *a)
{
    umb_memory_free(a, f->touched, f->capacity * sizeof *f->touched);
    umb_memory_free(a, f->crossings, f->capacity * 32 * sizeof *f->crossings);
    umb_memory_free(a, f->crossed, f->capacity * sizeof *f->crossed);
    memset(f, 0, sizeof *f);
}

void umb_fill_begin(umb_fill *f, const umb_raster_map *map, uint32_t x0, uint32_t y0, uint32_t x1,
                    uint32_t y1)
{
    f->map = map;
    f->row0 = y0;
    f->row1 = y1;
    f->word0 = x0 / 32;
    f->word1 = x1 / 32;
}

static int32_t clamp_int(int32_t v, int32_t low, int32_t high)
{
    return v < low ? low : v > high ? high : v;
}

static double clamp(double v, double low, double high)
{
    return v < low ? low : v > high ? high : v;
}

/* Mark the pixels of a row whose closed squares meet [low, high]. */
static void touch(umb_fill *f, uint32_t row, double low, double high)
{
    int32_t first = 32 * (int32_t)f->word0, last = 32 * (int32_t)f->word1 + 31;
    int32_t c0 = umb_pixel_floor(low - UMB_PIXEL_SLACK),
            c1 = umb_pixel_floor(high + UMB_PIXEL_SLACK);
    if (c0 > last || c1 < first) {
        return;
    }
    uint32_t from = (uint32_t)clamp_int(c0, first, last), to = (uint32_t)clamp_int(c1, first, last);
    uint32_t *words = f->touched + (size_t)row * f->words;
    uint32_t w0 = from / 32, w1 = to / 32;
    uint32_t left = ~0u << (from % 32), right = ~0u >> (31 - to % 32);
    if (w0 == w1) {
        words[w0] |= left & right;
        return;
    }
    words[w0] |= left;
    for (uint32_t w = w0 + 1; w < w1; ++w) {
        words[w] = ~0u;
    }
    words[w1] |= right;
}

static void cross(umb_fill *f, uint32_t row, double x, int32_t count)
{
    int32_t first = 32 * (int32_t)f->word0, end = 32 * (int32_t)(f->word1 + 1);
    int32_t column = umb_pixel_floor(x) + 1;
    if (column >= end) {
        return;
    }
    uint32_t pixel = (uint32_t)(column < first ? first : column);
    f->crossings[(size_t)row * f->words * 32 + pixel] += count;
    f->crossed[(size_t)row * f->words + pixel / 32] |= 1u << (pixel % 32);
}

/* An edge from top to bottom. */
typedef struct steep_edge {
    double x_top, x_low, y_min, y_max;
    double x_min, x_max;
    double slope, error;
    int32_t count; /* crossing it from left to right changes the winding number by this */
    bool flat;     /* its slope means nothing: a row takes all of it */
} steep_edge;

static steep_edge order_edge(const umb_outline_edge *e)
{
    bool down = e->y1 > e->y0;
    steep_edge s;
    s.y_min = down ? e->y0 : e->y1;
    s.y_max = down ? e->y1 : e->y0;
    s.x_top = down ? e->x0 : e->x1;
    s.x_low = down ? e->x1 : e->x0;
    s.x_min = s.x_top < s.x_low ? s.x_top : s.x_low;
    s.x_max = s.x_top < s.x_low ? s.x_low : s.x_top;
    s.count = down ? e->multiplicity : -e->multiplicity;
    /* Interpolating x is off by less than 16 units of the two ends. */
    s.error = e->error + 16.0 * UMB_U * (fabs(s.x_top) + fabs(s.x_low));
    double dy = s.y_max - s.y_min;
    s.flat = dy <= 1e-12 * (s.x_max - s.x_min) || dy < 1e-200;
    s.slope = s.flat ? 0.0 : (s.x_low - s.x_top) / dy;
    return s;
}

/* A row that an end of the edge may lie in. */
static void end_row(umb_fill *f, const steep_edge *s, uint32_t r)
{
    double top = f->map->rows.edge[r], bottom = f->map->rows.edge[r + 1];
    double low = s->x_min, high = s->x_max;
    if (!s->flat) {
        double ya = clamp(top - s->error, s->y_min, s->y_max),
               yb = clamp(bottom + s->error, s->y_min, s->y_max);
        double xa = s->x_top + (ya - s->y_min) * s->slope,
               xb = s->x_top + (yb - s->y_min) * s->slope;
        low = clamp(xa < xb ? xa : xb, s->x_min, s->x_max);
        high = clamp(xa < xb ? xb : xa, s->x_min, s->x_max);
    }
    touch(f, r, low - s->error, high + s->error);
    double middle = 0.5 * (top + bottom);
    if (s->y_min <= middle && middle < s->y_max) {
        cross(f, r, clamp(s->x_top + (middle - s->y_min) * s->slope, s->x_min, s->x_max), s->count);
    }
}

void umb_fill_edge(umb_fill *f, const umb_outline_edge *e)
{
    steep_edge s = order_edge(e);
    const umb_raster_rows *rows = &f->map->rows;
    const double *edge = rows->edge;
    if (s.y_max + s.error < edge[f->row0] || s.y_min - s.error > edge[f->row1 + 1]) {
        return;
    }
    uint32_t r0 = (uint32_t)umb_raster_map_row_at(f->map, s.y_min - s.error, -rows->slack);
    uint32_t r1 = (uint32_t)umb_raster_map_row_at(f->map, s.y_max + s.error, rows->slack);
    uint32_t first = r0 < f->row0 ? f->row0 : r0, last = r1 > f->row1 ? f->row1 : r1;
    /* Rows that lie wholly between the ends, grown by the error, need no cutting at the ends: x over
     * [top - error, bottom + error] runs from x(top) - |slope| error to x(bottom) + |slope| error, or the other
     * way round. */
    double grown = fabs(s.slope) * s.error + s.error;
    for (uint32_t r = first; r <= last; ++r) {
        double top = edge[r], bottom = edge[r + 1];
        if (s.flat || top - s.error < s.y_min || bottom + s.error > s.y_max) {
            end_row(f, &s, r);
            continue;
        }
        double x = s.x_top + (top - s.y_min) * s.slope, along = (bottom - top) * s.slope;
        touch(f, r, x + (along < 0.0 ? along : 0.0) - grown, x + (along > 0.0 ? along : 0.0) + grown);
        cross(f, r, x + 0.5 * along, s.count);
    }
}

/* Index of the lowest set bit. */
static uint32_t lowest(uint32_t bits)
{
    return (uint32_t)__builtin_ctz(bits);
}

void umb_fill_row(umb_fill *f, uint32_t row, uint32_t *covered)
{
    size_t base = (size_t)row * f->words;
    int32_t winding = 0;
    for (uint32_t w = f->word0; w <= f->word1; ++w) {
        uint32_t inside = winding > 0 ? ~0u : 0u;
        uint32_t crossed = f->crossed[base + w];
        while (crossed != 0) {
            uint32_t bit = lowest(crossed);
            int32_t *change = &f->crossings[(base + w) * 32 + bit];
            winding += *change;
            *change = 0;
            uint32_t from_here = ~0u << bit;
            inside = winding > 0 ? inside | from_here : inside & ~from_here;
            crossed &= crossed - 1;
        }
        f->crossed[base + w] = 0;
        covered[w] = inside & ~f->touched[base + w];
        f->touched[base + w] = 0;
    }
}

#include "fill.h"

#include <string.h>

#include "base/memory.h"

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

void umb_fill_begin(umb_fill *f, uint32_t x0, uint32_t y0, uint32_t x1, uint32_t y1)
{
    f->row0 = y0;
    f->row1 = y1;
    f->word0 = x0 / 32;
    f->word1 = x1 / 32;
}

static double clamp(double v, double low, double high)
{
    return v < low ? low : v > high ? high : v;
}

/* Mark pixels first..last (window columns) of a row. */
static void touch(umb_fill *f, uint32_t row, uint32_t first, uint32_t last)
{
    uint32_t *words = f->touched + (size_t)row * f->words;
    uint32_t w0 = first / 32, w1 = last / 32;
    uint32_t low = ~0u << (first % 32), high = ~0u >> (31 - last % 32);
    if (w0 == w1) {
        words[w0] |= low & high;
        return;
    }
    words[w0] |= low;
    for (uint32_t w = w0 + 1; w < w1; ++w) {
        words[w] = ~0u;
    }
    words[w1] |= high;
}

static void cross(umb_fill *f, uint32_t row, double x, int32_t count)
{
    double first = 32.0 * f->word0, end = 32.0 * (f->word1 + 1);
    double column = floor(clamp(x, first - 1.0, end)) + 1.0;
    if (column >= end) {
        return;
    }
    uint32_t pixel = (uint32_t)column;
    f->crossings[(size_t)row * f->words * 32 + pixel] += count;
    f->crossed[(size_t)row * f->words + pixel / 32] |= 1u << (pixel % 32);
}

void umb_fill_edge(umb_fill *f, const umb_outline_edge *e)
{
    bool down = e->y1 > e->y0;
    double y_min = down ? e->y0 : e->y1, y_max = down ? e->y1 : e->y0;
    double x_top = down ? e->x0 : e->x1, x_low = down ? e->x1 : e->x0;
    double x_min = x_top < x_low ? x_top : x_low, x_max = x_top < x_low ? x_low : x_top;
    int32_t count = down ? e->multiplicity : -e->multiplicity;

    /* Interpolating x is off by less than 8 units of the two ends. Where the edge is so flat that its
       slope means nothing, a row takes all of it. */
    double error = e->error + 16.0 * UMB_U * (fabs(x_top) + fabs(x_low));
    double dy = y_max - y_min;
    bool flat = dy <= 1e-12 * (x_max - x_min) || dy < 1e-200;
    double slope = flat ? 0.0 : (x_low - x_top) / dy;

    double row_low = ceil(y_min - error) - 1.0, row_high = floor(y_max + error);
    if (!(row_low <= f->row1 && row_high >= f->row0)) {
        return;
    }
    uint32_t r0 = (uint32_t)clamp(row_low, f->row0, f->row1);
    uint32_t r1 = (uint32_t)clamp(row_high, f->row0, f->row1);
    double first = 32.0 * f->word0, last = 32.0 * f->word1 + 31.0;
    for (uint32_t r = r0; r <= r1; ++r) {
        double ya = clamp(r - error, y_min, y_max), yb = clamp(r + 1 + error, y_min, y_max);
        double xa = x_top + (ya - y_min) * slope, xb = x_top + (yb - y_min) * slope;
        double low = clamp(flat ? x_min : xa < xb ? xa : xb, x_min, x_max) - error;
        double high = clamp(flat ? x_max : xa < xb ? xb : xa, x_min, x_max) + error;
        double c0 = ceil(low) - 1.0, c1 = floor(high);
        if (c0 <= last && c1 >= first) {
            touch(f, r, (uint32_t)clamp(c0, first, last), (uint32_t)clamp(c1, first, last));
        }
        double centre = r + 0.5;
        if (y_min <= centre && centre < y_max) {
            cross(f, r, clamp(x_top + (centre - y_min) * slope, x_min, x_max), count);
        }
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

#include "bitmap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

bool bitmap_create(bitmap *im, uint32_t width, uint32_t height)
{
    enum { LARGEST = 32768 };
    memset(im, 0, sizeof *im);
    if (width == 0 || height == 0 || width > LARGEST || height > LARGEST) {
        return false;
    }
    im->pixels = calloc((size_t)width * height, 3);
    if (!im->pixels) {
        return false;
    }
    im->width = width;
    im->height = height;
    return true;
}

void bitmap_free(bitmap *im)
{
    free(im->pixels);
    memset(im, 0, sizeof *im);
}

bitmap_color bitmap_mix(bitmap_color a, bitmap_color b, double t)
{
    bitmap_color out = 0;
    t = t < 0.0 ? 0.0 : t > 1.0 ? 1.0 : t;
    for (int shift = 0; shift < 24; shift += 8) {
        double x = a >> shift & 255, y = b >> shift & 255;
        out |= (bitmap_color)(x + (y - x) * t + 0.5) << shift;
    }
    return out;
}

static uint8_t *pixel(const bitmap *im, int x, int y)
{
    if (x < 0 || y < 0 || (uint32_t)x >= im->width || (uint32_t)y >= im->height) {
        return NULL;
    }
    return im->pixels + 3 * ((size_t)y * im->width + (size_t)x);
}

void bitmap_set(bitmap *im, int x, int y, bitmap_color color)
{
    uint8_t *p = pixel(im, x, y);
    if (p) {
        p[0] = (uint8_t)(color >> 16);
        p[1] = (uint8_t)(color >> 8);
        p[2] = (uint8_t)color;
    }
}

bitmap_color bitmap_get(const bitmap *im, int x, int y)
{
    const uint8_t *p = pixel(im, x, y);
    return p ? (bitmap_color)p[0] << 16 | (bitmap_color)p[1] << 8 | p[2] : 0;
}

void bitmap_blend(bitmap *im, int x, int y, bitmap_color color, double opacity)
{
    if (opacity > 0.0) {
        bitmap_set(im, x, y, bitmap_mix(bitmap_get(im, x, y), color, opacity));
    }
}

void bitmap_fill(bitmap *im, bitmap_color color)
{
    bitmap_rectangle(im, 0, 0, (int)im->width, (int)im->height, color, 1.0);
}

void bitmap_rectangle(bitmap *im, int x, int y, int width, int height, bitmap_color color,
                      double opacity)
{
    int x1 = x + width < (int)im->width ? x + width : (int)im->width;
    int y1 = y + height < (int)im->height ? y + height : (int)im->height;
    for (int v = y > 0 ? y : 0; v < y1; ++v) {
        for (int u = x > 0 ? x : 0; u < x1; ++u) {
            bitmap_blend(im, u, v, color, opacity);
        }
    }
}

void bitmap_frame(bitmap *im, int x, int y, int width, int height, int thickness, bitmap_color color)
{
    bitmap_rectangle(im, x, y, width, thickness, color, 1.0);
    bitmap_rectangle(im, x, y + height - thickness, width, thickness, color, 1.0);
    bitmap_rectangle(im, x, y + thickness, thickness, height - 2 * thickness, color, 1.0);
    bitmap_rectangle(im, x + width - thickness, y + thickness, thickness, height - 2 * thickness,
                     color, 1.0);
}

/* The pixels from first to last that an interval touches, within [0, size). */
static void pixel_range(double low, double high, uint32_t size, int *first, int *last)
{
    *first = low > 0.0 ? (low < size ? (int)low : (int)size) : 0;
    *last = high < size ? (high >= 0.0 ? (int)high : -1) : (int)size - 1;
}

/* Cut a segment to the picture and a margin around it (Liang and Barsky); false: nothing is
 * left. */
static bool clip_segment(const bitmap *im, double margin, double p[4])
{
    const double size[2] = {im->width, im->height};
    double from = 0.0, to = 1.0;
    const double x0[2] = {p[0], p[1]}, d[2] = {p[2] - p[0], p[3] - p[1]};
    for (int i = 0; i < 2; ++i) {
        double a = (-margin - x0[i]) / d[i], b = (size[i] + margin - x0[i]) / d[i];
        if (d[i] == 0.0) {
            if (x0[i] < -margin || x0[i] > size[i] + margin) {
                return false;
            }
            continue;
        }
        from = fmax(from, fmin(a, b));
        to = fmin(to, fmax(a, b));
    }
    for (int i = 0; i < 2; ++i) {
        p[i] = x0[i] + from * d[i];
        p[i + 2] = x0[i] + to * d[i];
    }
    return from <= to;
}

void bitmap_line(bitmap *im, double x0, double y0, double x1, double y1, double width,
                 bitmap_color color, double opacity)
{
    double p[4] = {x0, y0, x1, y1}, radius = width / 2;
    int top, bottom;
    if (!clip_segment(im, width + 2, p)) {
        return;
    }
    double dx = p[2] - p[0], dy = p[3] - p[1], square = dx * dx + dy * dy;
    pixel_range(fmin(p[1], p[3]) - radius - 1, fmax(p[1], p[3]) + radius + 1, im->height, &top,
                &bottom);
    for (int y = top; y <= bottom; ++y) {
        /* The part of the line near this row bounds the pixels that can be touched. */
        double a = 0.0, b = 1.0;
        if (fabs(dy) > 1e-9) {
            double u = (y - radius - 1.5 - p[1]) / dy, v = (y + radius + 2.5 - p[1]) / dy;
            a = fmax(0.0, fmin(u, v));
            b = fmin(1.0, fmax(u, v));
        }
        double xa = p[0] + a * dx, xb = p[0] + b * dx;
        int left, right;
        pixel_range(fmin(xa, xb) - radius - 1, fmax(xa, xb) + radius + 1, im->width, &left, &right);
        for (int x = left; x <= right; ++x) {
            double ux = x + 0.5 - p[0], uy = y + 0.5 - p[1];
            double t = square > 0.0 ? (ux * dx + uy * dy) / square : 0.0;
            t = t < 0.0 ? 0.0 : t > 1.0 ? 1.0 : t;
            double distance = hypot(ux - t * dx, uy - t * dy);
            bitmap_blend(im, x, y, color, opacity * fmin(1.0, radius + 0.5 - distance));
        }
    }
}

void bitmap_disc(bitmap *im, double x, double y, double radius, bitmap_color color, double opacity)
{
    bitmap_line(im, x, y, x, y, 2 * radius, color, opacity);
}

/* How much of the pixel row's span [x, x+1] lies between low and high. */
static double overlap(double x, double low, double high)
{
    double a = fmax(x, low), b = fmin(x + 1, high);
    return b > a ? b - a : 0.0;
}

/* Where a horizontal line cuts a convex polygon; false: nowhere. */
static bool cut_row(const double (*c)[2], uint32_t count, double y, double *low, double *high)
{
    *low = INFINITY;
    *high = -INFINITY;
    for (uint32_t k = 0; k < count; ++k) {
        const double *a = c[k], *b = c[(k + 1) % count];
        if ((a[1] <= y) != (b[1] <= y)) {
            double x = a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]);
            *low = fmin(*low, x);
            *high = fmax(*high, x);
        }
    }
    return *low < *high;
}

void bitmap_polygon(bitmap *im, const double (*corners)[2], uint32_t count, bitmap_color color,
                    double opacity)
{
    enum { ROWS = 4 }; /* samples of a pixel row; across, the cover is exact */
    double low_y = INFINITY, high_y = -INFINITY;
    for (uint32_t k = 0; k < count; ++k) {
        low_y = fmin(low_y, corners[k][1]);
        high_y = fmax(high_y, corners[k][1]);
    }
    int top, bottom;
    pixel_range(low_y, high_y, im->height, &top, &bottom);
    for (int y = top; y <= bottom; ++y) {
        double low[ROWS], high[ROWS], least = INFINITY, most = -INFINITY;
        uint32_t cuts = 0;
        for (int s = 0; s < ROWS; ++s) {
            if (cut_row(corners, count, y + (s + 0.5) / ROWS, &low[cuts], &high[cuts])) {
                least = fmin(least, low[cuts]);
                most = fmax(most, high[cuts]);
                ++cuts;
            }
        }
        int left, right;
        pixel_range(least, most, im->width, &left, &right);
        for (int x = left; cuts > 0 && x <= right; ++x) {
            double cover = 0.0;
            for (uint32_t s = 0; s < cuts; ++s) {
                cover += overlap(x, low[s], high[s]) / ROWS;
            }
            bitmap_blend(im, x, y, color, opacity * cover);
        }
    }
}

void bitmap_stretch(bitmap *im, const bitmap *from)
{
    for (uint32_t y = 0; y < im->height; ++y) {
        for (uint32_t x = 0; x < im->width; ++x) {
            bitmap_set(im, (int)x, (int)y,
                       bitmap_get(from, (int)((uint64_t)x * from->width / im->width),
                                  (int)((uint64_t)y * from->height / im->height)));
        }
    }
}

void bitmap_shrink(bitmap *im, const bitmap *from, uint32_t factor)
{
    uint32_t area = factor * factor;
    for (uint32_t y = 0; y < im->height; ++y) {
        for (uint32_t x = 0; x < im->width; ++x) {
            uint32_t sum[3] = {area / 2, area / 2, area / 2};
            for (uint32_t k = 0; k < area; ++k) {
                const uint8_t *p = pixel(from, (int)(x * factor + k % factor),
                                         (int)(y * factor + k / factor));
                for (int i = 0; p && i < 3; ++i) {
                    sum[i] += p[i];
                }
            }
            uint8_t *q = pixel(im, (int)x, (int)y);
            for (int i = 0; i < 3; ++i) {
                q[i] = (uint8_t)(sum[i] / area);
            }
        }
    }
}

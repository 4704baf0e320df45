/* Pictures of eight-bit red, green and blue, simple drawing on them, and PNG files. */
#ifndef BITMAP_H
#define BITMAP_H

#include "umbrage/base.h"

/* 0xRRGGBB. */
typedef uint32_t bitmap_color;

typedef struct bitmap {
    uint8_t *pixels; /* red, green, blue; row by row from the top */
    uint32_t width, height;
} bitmap;

/* Black. False when memory is short or a side is 0 or above 32768. */
bool bitmap_create(bitmap *im, uint32_t width, uint32_t height);
void bitmap_free(bitmap *im);

/* a + (b - a) * t, t in [0, 1]. */
bitmap_color bitmap_mix(bitmap_color a, bitmap_color b, double t);

/* All drawing is clipped to the picture. */
void bitmap_fill(bitmap *im, bitmap_color color);
void bitmap_set(bitmap *im, int x, int y, bitmap_color color);
bitmap_color bitmap_get(const bitmap *im, int x, int y);
/* Lay color over a pixel: opacity in [0, 1]. */
void bitmap_blend(bitmap *im, int x, int y, bitmap_color color, double opacity);
void bitmap_rectangle(bitmap *im, int x, int y, int width, int height, bitmap_color color,
                      double opacity);
/* The outline of a rectangle, thickness pixels wide, inside it. */
void bitmap_frame(bitmap *im, int x, int y, int width, int height, int thickness,
                  bitmap_color color);
/* A smooth line of the given width with round ends; coordinates are those of pixel corners. */
void bitmap_line(bitmap *im, double x0, double y0, double x1, double y1, double width,
                 bitmap_color color, double opacity);
/* A smooth disc. */
void bitmap_disc(bitmap *im, double x, double y, double radius, bitmap_color color, double opacity);
/* A convex polygon of count corners, either way round; smooth edges. */
void bitmap_polygon(bitmap *im, const double (*corners)[2], uint32_t count, bitmap_color color,
                    double opacity);

/* ASCII text, its top left corner at (x, y), scale pixels to a unit of its font (letters are 7
 * high, lines 12 apart). Sizes in pixels. */
void bitmap_text(bitmap *im, int x, int y, int scale, const char *text, bitmap_color color);
int bitmap_text_width(const char *text, int scale);
int bitmap_text_height(int scale);

/* Copy from into im, stretched to im's size; each pixel of im takes the nearest of from. */
void bitmap_stretch(bitmap *im, const bitmap *from);
/* Average blocks of factor x factor pixels; from's sides are factor times im's. */
void bitmap_shrink(bitmap *im, const bitmap *from, uint32_t factor);

bool bitmap_write_png(const bitmap *im, const char *file, umb_error *error);

#endif

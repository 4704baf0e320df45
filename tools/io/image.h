/* Pictures of eight-bit red, green and blue, simple drawing on them, and PNG files. */
#ifndef IMAGE_H
#define IMAGE_H

#include "umbrage/base.h"

/* 0xRRGGBB. */
typedef uint32_t image_color;

typedef struct image {
    uint8_t *pixels; /* red, green, blue; row by row from the top */
    uint32_t width, height;
} image;

/* Black. False when memory is short or a side is 0 or above 32768. */
bool image_create(image *im, uint32_t width, uint32_t height);
void image_free(image *im);

/* a + (b - a) * t, t in [0, 1]. */
image_color image_mix(image_color a, image_color b, double t);

/* All drawing is clipped to the picture. */
void image_fill(image *im, image_color color);
void image_set(image *im, int x, int y, image_color color);
image_color image_get(const image *im, int x, int y);
/* Lay color over a pixel: opacity in [0, 1]. */
void image_blend(image *im, int x, int y, image_color color, double opacity);
void image_rectangle(image *im, int x, int y, int width, int height, image_color color, double opacity);
/* The outline of a rectangle, thickness pixels wide, inside it. */
void image_frame(image *im, int x, int y, int width, int height, int thickness, image_color color);
/* A smooth line of the given width with round ends; coordinates are those of pixel corners. */
void image_line(image *im, double x0, double y0, double x1, double y1, double width, image_color color,
                double opacity);
/* A smooth disc. */
void image_disc(image *im, double x, double y, double radius, image_color color, double opacity);
/* A convex polygon of count corners, either way round; smooth edges. */
void image_polygon(image *im, const double (*corners)[2], uint32_t count, image_color color,
                   double opacity);

/* ASCII text, its top left corner at (x, y), scale pixels to a unit of its font (letters are 7 high, lines
 * 12 apart). Sizes in pixels. */
void image_text(image *im, int x, int y, int scale, const char *text, image_color color);
int image_text_width(const char *text, int scale);
int image_text_height(int scale);

/* Copy from into im, stretched to im's size; each pixel of im takes the nearest of from. */
void image_stretch(image *im, const image *from);
/* Average blocks of factor x factor pixels; from's sides are factor times im's. */
void image_shrink(image *im, const image *from, uint32_t factor);

bool image_write_png(const image *im, const char *file, umb_error *error);

#endif

#include <png.h>
#include <setjmp.h>

#include "bitmap.h"
#include "model_parts.h"
#include "output.h"

/* libpng reports through longjmp, so nothing that changes lives in this frame. */
static bool write_rows(FILE *f, const bitmap *im)
{
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    if (!info) {
        png_destroy_write_struct(&png, NULL);
        return false;
    }
    if (setjmp(png_jmpbuf(png))) {
        png_destroy_write_struct(&png, &info);
        return false;
    }
    png_init_io(png, f);
    png_set_IHDR(png, info, im->width, im->height, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    for (uint32_t y = 0; y < im->height; ++y) {
        png_write_row(png, im->pixels + 3 * (size_t)y * im->width);
    }
    png_write_end(png, NULL);
    png_destroy_write_struct(&png, &info);
    return true;
}

bool bitmap_write_png(const bitmap *im, const char *file, umb_error *error)
{
    FILE *f = output_open(file, error);
    if (!f) {
        return false;
    }
    bool good = write_rows(f, im);
    if (!good) {
        model_fail(error, UMB_ERROR_MEMORY,
                   "%.150s: the picture could not be written; look for space", file);
    }
    return output_close(f, file, good, error);
}

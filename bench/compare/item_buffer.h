/* The oracle's columns: which objects own pixels of a large picture, by one ray through every pixel's
 * centre. Answers are kept in a file, for they take minutes. */
#ifndef ITEM_BUFFER_H
#define ITEM_BUFFER_H

#include "cameras.h"

typedef struct item {
    uint32_t object, pixels; /* pixels: at least 1 */
} item;

typedef struct item_view {
    item *items;
    uint32_t count;
} item_view;

typedef struct item_buffer {
    item_view *views;
    uint32_t view_count;
    uint32_t width, height;
    double mean; /* objects a view */
    bool traced; /* false: it came from the file */
} item_buffer;

/* Every first hit counts, from either side of a face; open surfaces are seen and seen through. cache: a
 * folder. False with error filled in. */
bool item_buffer_make(item_buffer *b, const world *w, const cameras *c, uint32_t width,
                      uint32_t height, const char *cache, umb_error *error);
void item_buffer_free(item_buffer *b);

/* Of the objects that a contestant hid although they own pixels, how many does exact arithmetic confirm?
 * Rays of floats may slip through where surfaces meet. hidden: per object. UINT32_MAX: it could not be
 * found out. */
uint32_t item_buffer_confirm(const world *w, const umb_view *view, const uint8_t *hidden);

#endif

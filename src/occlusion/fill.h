/* Filling an outline: which pixels of a window are wholly covered.
 *
 * A pixel is covered when no edge, grown by its error, meets its closed square and the winding
 * number there is at least one. The winding number is constant on a square that no edge meets, so
 * it may be taken anywhere in it; per row it is the running sum of the edges that cross the row's
 * middle line:
 *
 *     row middle  . . .|+1 . . . . . . . .|-1 . . .      counts from the pixel after each crossing on
 *     touched          #                  #
 *
 * An edge crosses when the middle line lies in [y0, y1), half-open: outlines are closed chains of
 * points that are equal to the bit, so the sums are exact whatever the error of x, which can move a
 * crossing only inside the pixels that its edge touches.
 */
#ifndef UMB_FILL_H
#define UMB_FILL_H

#include "silhouette.h"

typedef struct umb_fill {
    uint32_t *touched; /* [row][word]: 32 pixels a word; all zero between fills */
    int32_t *crossings; /* [row][pixel]: change of the winding number from this pixel on; all zero likewise */
    uint32_t *crossed; /* [row][word]: which pixels of the word have crossings */
    size_t capacity;   /* words */
    uint32_t words;    /* a row */
    uint32_t row0, row1, word0, word1; /* the window, ends included */
    const umb_raster_map *map;
} umb_fill;

bool umb_fill_resize(umb_fill *f, const umb_allocator *a, uint32_t width, uint32_t height);
void umb_fill_free(umb_fill *f, const umb_allocator *a);

/* Set the window: pixels [x0, x1] x [y0, y1], ends included, inside the raster. */
void umb_fill_begin(umb_fill *f, const umb_raster_map *map, uint32_t x0, uint32_t y0, uint32_t x1, uint32_t y1);
/* Add an edge of a closed outline whose image lies within the window, as far as it is on the
 * raster. */
void umb_fill_edge(umb_fill *f, const umb_outline_edge *e);
/* The covered pixels of one row of the window, in covered[word0 .. word1]; clears the row for the
 * next fill. */
void umb_fill_row(umb_fill *f, uint32_t row, uint32_t *covered);

#endif

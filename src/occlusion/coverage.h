/* The occlusion buffer: which pixels are wholly covered, and how far what covers them can be.
 *
 *   tile: 32 x 8 pixels, 64 bytes            sub-tile: 8 x 4 pixels, one depth bound
 *            x: 0-7    8-15   16-23  24-31
 *   rows 0-3 [ z[0] ] [ z[1] ] [ z[2] ] [ z[3] ]     mask[r] bit c: pixel (c, r)
 *   rows 4-7 [ z[4] ] [ z[5] ] [ z[6] ] [ z[7] ]
 *
 * Depth is kept as nearness: 1 / w in perspective, -w in parallel views (w: depth along forward),
 * both affine over the raster for a plane, and greater is nearer.
 *
 * Invariant: a set bit means that every point of that closed pixel is blocked by some occluder
 * whose nearness there is greater than the z of its sub-tile. z is +infinity while no bit is set.
 * Pixels beyond the raster's right and bottom borders are set from the start: nobody asks for them.
 */
#ifndef UMB_COVERAGE_H
#define UMB_COVERAGE_H

#include "base/memory.h"
#include "pixel.h"

#define UMB_TILE_WIDTH 32
#define UMB_TILE_HEIGHT 8

typedef struct umb_tile {
    uint32_t mask[UMB_TILE_HEIGHT];
    float z[8];
} umb_tile;

/* So many entries behind the last of coarse may be read. */
#define UMB_COARSE_SPARE 32

typedef struct umb_coverage {
    umb_tile *tiles;
    float *coarse; /* per tile: the least z if every pixel is covered, else -infinity */
    size_t tile_capacity;
    uint32_t width, height; /* pixels */
    uint32_t columns, rows; /* tiles */
} umb_coverage;

/* Pixels touched by something: columns x0..x1, rows y0..y1, both ends included, inside the
 * raster. */
typedef struct umb_pixel_rect {
    int16_t x0, y0, x1, y1;
} umb_pixel_rect;

/* Make room for a raster; reuses what is there. */
bool umb_coverage_resize(umb_coverage *c, const umb_allocator *a, uint32_t width, uint32_t height);
void umb_coverage_free(umb_coverage *c, const umb_allocator *a);
void umb_coverage_clear(umb_coverage *c);

#endif

/* Umbrae in tiles of 8 x 8 pixels of an occlusion map: what is done per pixel, compiled for each instruction set.
 *
 * Rows of a tile run along s, lanes along t. docs/conservative.md has the mathematics (T1 to T3) and the bounds of
 * rounding; names here are its names. */
#ifndef UMB_UMBRA_KERNELS_H
#define UMB_UMBRA_KERNELS_H

#include "umbrage/base.h"

#define UMB_TILE 8 /* pixels along a side of a tile, and tiles along a side of a group */
#define UMB_UMBRA_VERTICES 64
#define UMB_UMBRA_EDGES 160
#define UMB_UMBRA_ENDLESS 1e30f /* more than any slope that is compared with it; not infinite: that is empty intervals */

/* One interval a pixel: what lies between its top and its bottom, as every point of the cell sees it, and beyond
 * depth, is hidden. Empty: top -INFINITY, bottom INFINITY. */
typedef struct umb_umbra_tile {
    float top[64];        /* lower bounds of m of the top */
    float top_far[64];    /* lower bounds of M of the top */
    float bottom_far[64]; /* upper bounds of m of the bottom */
    float bottom[64];     /* upper bounds of M of the bottom */
    float depth[64];      /* upper bounds of u of what blocks */
} umb_umbra_tile;

/* A corner of an occluder. At corner (r, j) of the run's pixels f is f - r ds - j dt, to `error`. */
typedef struct umb_umbra_vertex {
    float f, ds, dt, error;
    float u, z;
    /* Bounds at the vertex itself, for pixels that it straddles: as top lower bounds of m and of both quotients of M; as
       bottom upper bounds of M and of both quotients of m. margin: u - ub, less its error; not above 0: of no use. */
    float top, top_far, bottom_far, bottom, depth, margin;
} umb_umbra_vertex;

typedef struct umb_umbra_edge {
    uint8_t a, b;
    uint8_t near_quotient; /* 1: its far bound is by the cell's near face (ub), 0: by its back face (ua) */
} umb_umbra_edge;

/* What is drawn into up to eight tiles side by side: an occluder's two chains. The top one goes from vertex low[0] to
 * high[0], the bottom one from low[1] to high[1]: a pixel is covered when f is surely below 0 at the low ones and above 0
 * at the high ones. */
typedef struct umb_umbra {
    umb_umbra_vertex vertices[UMB_UMBRA_VERTICES];
    umb_umbra_edge top[UMB_UMBRA_EDGES], bottom[UMB_UMBRA_EDGES], depth[UMB_UMBRA_EDGES];
    uint32_t top_count, bottom_count, depth_count;
    uint64_t top_inner, bottom_inner, depth_inner; /* vertices that count where pixels straddle them */
    uint32_t low[2], high[2];
    float z0, z1, ua, ub; /* the cell in every slice of these tiles */
    float error_u, error_z; /* of vertices, and of sums made with them */
    bool floor;           /* nothing passes below its bottom */
    bool outlined;        /* depth and margin come from the edges and vertices of depth alone, which go around it */
} umb_umbra;

/* What all pixels of a tile, or of a group of tiles, have in common; in front: a pixel that no ray goes through
 * counts for all intervals. */
typedef struct umb_umbra_summary {
    float top, bottom, depth;
} umb_umbra_summary;

typedef struct umb_umbra_draw {
    const umb_umbra *umbra;
    umb_umbra_tile *tiles[UMB_TILE]; /* NULL: leave it out. Each is the first of `umbrae` in a row */
    umb_umbra_summary summaries[UMB_TILE]; /* written for those drawn into */
    uint64_t live[UMB_TILE]; /* pixels that rays go through */
    uint32_t tile_count, umbrae;
    bool half; /* keep tops and depths alone */
    float steep; /* rays are not steeper than this: INFINITY or 1 */
} umb_umbra_draw;

/* Something asked about in one tile: in row r it touches lanes from[r] to to[r] (none: from > to). */
typedef struct umb_umbra_query {
    float from[UMB_TILE], to[UMB_TILE];
    float top, bottom, depth; /* upper bound of m, lower bound of M, lower bound of u */
    bool tilted; /* then bounds like the first two are here, for each pixel of the rows */
    float tops[64], bottoms[64];
} umb_umbra_query;

/* One interval, for lanes from[r] to to[r] of row r of a tile (none: from > to). Names as in umb_umbra_tile. */
typedef struct umb_umbra_strip {
    float from[UMB_TILE], to[UMB_TILE];
    float top, top_far, bottom_far, bottom, depth;
    float steep; /* as in umb_umbra_draw */
} umb_umbra_strip;

/* A body's picture from above or from below: y is bounded by lines of a few slopes that touch it. Line l of slope k goes
 * through corner l; at the middle of pixel (r, j) of the tile it is at[k][l] + r ds[k][l] + j dt[k][l]. */
#define UMB_UMBRA_CORNERS 16
typedef struct umb_umbra_picture {
    uint32_t slope_count, corner_count;
    float at[UMB_UMBRA_CORNERS][UMB_UMBRA_CORNERS], ds[UMB_UMBRA_CORNERS][UMB_UMBRA_CORNERS], dt[UMB_UMBRA_CORNERS][UMB_UMBRA_CORNERS];
    float more[UMB_UMBRA_CORNERS]; /* per slope: what y may be above its highest line */
    float limit;                   /* no y is above it */
} umb_umbra_picture;

typedef struct umb_umbra_kernels {
    umb_isa isa;
    void (*draw)(umb_umbra_draw *d);
    umb_umbra_summary (*fill)(umb_umbra_tile *tiles, uint32_t umbrae, const umb_umbra_strip *s, bool half);
    /* Pixels of a tile that what is asked about touches and no interval holds. */
    uint64_t (*open)(const umb_umbra_tile *tiles, uint32_t umbrae, const umb_umbra_query *q);
    /* Bounds of y in pixels of q's rows, times sign, which is 1 or -1. The largest is the answer. */
    float (*bound)(const umb_umbra_picture *p, const umb_umbra_query *q, float sign, float out[64]);
} umb_umbra_kernels;

/* Those of isa, which must be available; NULL for one that is not. */
const umb_umbra_kernels *umb_umbra_kernels_get(umb_isa isa);

extern const umb_umbra_kernels umb_umbra_kernels_scalar;
extern const umb_umbra_kernels umb_umbra_kernels_sse4;
extern const umb_umbra_kernels umb_umbra_kernels_avx2;
extern const umb_umbra_kernels umb_umbra_kernels_neon;

/* Make all intervals of a tile empty; pixels that no ray goes through hold everything. */
void umb_umbra_clear(umb_umbra_tile *tiles, uint32_t umbrae, uint64_t live);

#endif

/* The raster's inner loops, built for each instruction set from one source. All builds give the same
 * bits. */
#ifndef UMB_RASTER_KERNELS_H
#define UMB_RASTER_KERNELS_H

#include "coverage.h"
#include "frustum/box_kernels.h"
#include "raster_map.h"
#include "scene/scene.h"

enum {
    UMB_CONVEX_TRIANGLES = 32, /* a convex shape of more is drawn as any other */
    UMB_CONVEX_VERTICES = 20,  /* at least UMB_CONVEX_TRIANGLES / 2 + 2, a multiple of four */
    UMB_CONVEX_EDGES = 64
};

/* The image of a convex occluder, made ready for filling: pixels wholly left of, right of, and between some
 * lines are covered, and no farther than the farthest of its planes there. */
typedef struct umb_convex {
    /* Covered from x = slope y + at on (left), or up to there (right), error included. */
    double left_slope[UMB_CONVEX_EDGES], left_at[UMB_CONVEX_EDGES];
    double right_slope[UMB_CONVEX_EDGES], right_at[UMB_CONVEX_EDGES];
    uint32_t left_count, right_count;
    double x_min, x_max;  /* and between these */
    uint32_t row0, row1;  /* and in these rows, ends included */
    uint32_t edge_count;  /* of the silhouette */
    /* Nearness is at least the least over the planes of max(gx x + gy y + g0, least), rounding included. */
    float gx[UMB_CONVEX_TRIANGLES], gy[UMB_CONVEX_TRIANGLES], g0[UMB_CONVEX_TRIANGLES];
    float least[UMB_CONVEX_TRIANGLES];
    uint32_t plane_count;
    float most; /* and nowhere more than this */
} umb_convex;

typedef enum umb_convex_result {
    UMB_CONVEX_NOTHING, /* covers no pixel */
    UMB_CONVEX_READY,
    UMB_CONVEX_OTHER /* near the eye or degenerate: draw it as any other mesh */
} umb_convex_result;

typedef struct umb_raster_kernels {
    umb_isa isa;
    /* For the boxes of a mask, which must be testable and not beside the raster: a bit for each whose
       pixels are all covered by something nearer. */
    uint32_t (*hides)(const umb_coverage *c, const umb_projected *boxes, uint32_t mask);
    /* The same for one rectangle. */
    bool (*hides_rect)(const umb_coverage *c, umb_pixel_rect rect, float nearness);
    /* Add one occluder's pixels of one tile: mask as in the tile, z a lower bound of its nearness for each
       sub-tile with a bit. Keeps the invariant whatever the order of calls. True if the tile changed. */
    bool (*merge)(umb_coverage *c, uint32_t tile, const uint32_t mask[UMB_TILE_HEIGHT], const float z[8]);
    /* mesh->convex, and at most UMB_CONVEX_TRIANGLES. */
    umb_convex_result (*find_convex)(const umb_raster_map *map, const umb_occluder *occluder,
                                     umb_convex *out);
    /* True if the buffer changed. */
    bool (*fill_convex)(umb_coverage *c, const umb_raster_map *map, const umb_convex *convex);
} umb_raster_kernels;

/* The kernels of an instruction set, AUTO for the best; NULL when it is not available. */
const umb_raster_kernels *umb_raster_kernels_get(umb_isa isa);

extern const umb_raster_kernels umb_raster_kernels_scalar;
extern const umb_raster_kernels umb_raster_kernels_sse4;
extern const umb_raster_kernels umb_raster_kernels_avx2;
extern const umb_raster_kernels umb_raster_kernels_neon;

#endif

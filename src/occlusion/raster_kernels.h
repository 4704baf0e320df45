/* The raster's inner loops, built for each instruction set from one source. All builds give the same
 * bits. */
#ifndef UMB_RASTER_KERNELS_H
#define UMB_RASTER_KERNELS_H

#include "convex.h"
#include "coverage.h"
#include "frustum/box_kernels.h"
#include "raster_map.h"
#include "scene/scene.h"

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
    /* Add what a convex occluder covers. True if the buffer changed. */
    bool (*fill_convex)(umb_coverage *c, const umb_raster_map *map, const umb_convex *convex);
    /* True if all of the body is hidden, as far as it lies in rect; find_convex made it. */
    bool (*hides_convex)(const umb_coverage *c, const umb_raster_map *map, const umb_convex *convex,
                         umb_pixel_rect rect);
} umb_raster_kernels;

/* The kernels of an instruction set, AUTO for the best; NULL when it is not available. */
const umb_raster_kernels *umb_raster_kernels_get(umb_isa isa);

extern const umb_raster_kernels umb_raster_kernels_scalar;
extern const umb_raster_kernels umb_raster_kernels_sse4;
extern const umb_raster_kernels umb_raster_kernels_avx2;
extern const umb_raster_kernels umb_raster_kernels_neon;

#endif

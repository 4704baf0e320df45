/* The raster's inner loops, built for each instruction set from one source. All builds give the same
 * bits. */
#ifndef UMB_RASTER_KERNELS_H
#define UMB_RASTER_KERNELS_H

#include "convex.h"
#include "coverage.h"
#include "frustum/box_kernels.h"
#include "raster_map.h"
#include "scene/scene.h"

enum { UMB_FILL_PLANES = 8 };

/* An affine function of the raster under the front: gx x + gy y + low is no more than the nearness of some of its
 * triangles, and neither is least; with every in place of low it is no more than the nearness of any. */
typedef struct umb_fill_plane {
    float gx, gy, low, least, every;
} umb_fill_plane;

/* What filling a mesh works on: the tiles of its window, and for each row of tiles the lists of edges and of
 * triangles that begin there. Where there are planes, each triangle has one of them, and the triangles are not
 * looked at one by one. */
typedef struct umb_mesh_fill {
    struct umb_row_tile *tiles; /* UMB_ROW_TILE_BYTES for each column of tiles of the raster */
    uint8_t *state;             /* per column of tiles, all 0 */
    uint16_t *list;             /* room for a row of tiles */
    uint32_t *edges, *triangles; /* per row of tiles: the first of a list, or UMB_NONE */
    uint32_t tx0, tx1, ty0, ty1;
    umb_fill_plane planes[UMB_FILL_PLANES];
    uint32_t plane_count;
} umb_mesh_fill;

#define UMB_ROW_TILE_BYTES 256

/* An occluder's image by itself, which is a function of the view and the occluder alone: what it covers of each
 * tile, and how near. */
typedef struct umb_tile_list {
    umb_tile *tiles;   /* masks, and depths where a mask has bits of the sub-tile */
    uint32_t *numbers; /* of the tiles, row by row */
    uint32_t count, capacity;
    bool full;  /* there were more tiles than there is room for */
    float most; /* nearness of the occluder is nowhere more */
} umb_tile_list;

typedef struct umb_raster_kernels {
    umb_isa isa;
    /* For the boxes of a mask, which must be testable and not beside the raster: a bit for each whose
       pixels are all covered by something nearer. */
    uint32_t (*hides)(const umb_coverage *c, const umb_projected *boxes, uint32_t mask);
    /* The same for one rectangle. */
    bool (*hides_rect)(const umb_coverage *c, umb_pixel_rect rect, float nearness);
    /* Place an occluder's vertices in two steps: relative to the eye, and what of it is cut away; then the other vertex
       arrays of the silhouette, and its numbers up to most. */
    void (*approach)(umb_silhouette *s, const umb_raster_map *map, const umb_occluder *occluder);
    /* Between the two, of a body: true if a vertex is open, or cut away. */
    bool (*shows_corner)(const umb_coverage *c, umb_silhouette *s, const umb_raster_map *map);
    void (*place)(umb_silhouette *s, const umb_raster_map *map);
    /* mesh->convex, at most UMB_CONVEX_TRIANGLES, placed, and no vertex is cut away. */
    umb_convex_result (*find_convex)(const umb_raster_map *map, const umb_occluder *occluder,
                                     const umb_silhouette *s, umb_convex *out);
    /* The same for a box along the axes, whose corners are its vertices; fills in no outer lines, no upper planes. */
    umb_convex_result (*find_box)(const umb_raster_map *map, const umb_aabb *box, umb_convex *out);
    /* Add what a convex occluder covers. How many tiles changed. */
    uint32_t (*fill_convex)(umb_coverage *c, const umb_raster_map *map, const umb_convex *convex);
    /* True if all of the body is hidden, as far as it lies in rect; find_convex made it. */
    bool (*hides_convex)(const umb_coverage *c, const umb_raster_map *map, const umb_convex *convex,
                         umb_pixel_rect rect);
    /* Add what any occluder covers: its outline and, unless there are planes, its depth triangles are found. How
       many tiles changed. */
    uint32_t (*fill_mesh)(umb_coverage *c, const umb_raster_map *map, umb_silhouette *s, umb_mesh_fill *fill);
    /* The same in two steps, the buffer's bits being the same too: note what is covered, false if there is no room
       for all of it; and add what was noted. */
    bool (*list_mesh)(umb_tile_list *list, const umb_raster_map *map, umb_silhouette *s, umb_mesh_fill *fill);
    uint32_t (*merge_list)(umb_coverage *c, const umb_tile_list *list);
} umb_raster_kernels;

/* The kernels of an instruction set, AUTO for the best; NULL when it is not available. */
const umb_raster_kernels *umb_raster_kernels_get(umb_isa isa);

extern const umb_raster_kernels umb_raster_kernels_scalar;
extern const umb_raster_kernels umb_raster_kernels_sse4;
extern const umb_raster_kernels umb_raster_kernels_avx2;
extern const umb_raster_kernels umb_raster_kernels_neon;

#endif

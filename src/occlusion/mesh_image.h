/* Any mesh made ready for the kernels that fill it: its outline, and its depth, listed by rows of tiles. Each
 * thread that draws has scratch of its own. */
#ifndef UMB_MESH_IMAGE_H
#define UMB_MESH_IMAGE_H

#include "raster_kernels.h"

typedef struct umb_mesh_scratch {
    umb_silhouette silhouette;
    umb_mesh_fill fill;
    size_t tile_capacity, state_capacity, list_capacity, edge_capacity, triangle_capacity;
    uint64_t structure; /* of the scene that it was sized for, plus 1; 0: none */
} umb_mesh_scratch;

/* Make room for every occluder of the scene on a raster; reuses what is there. */
bool umb_mesh_scratch_reserve(umb_mesh_scratch *s, const umb_allocator *a, const umb_raster_map *map,
                              const umb_committed *scene);
void umb_mesh_scratch_free(umb_mesh_scratch *s, const umb_allocator *a);

/* The outline of an occluder whose vertices are placed (raster_kernels.h); false if it covers nothing worth
 * having. */
bool umb_mesh_image_find(umb_mesh_scratch *s, const umb_raster_map *map, const umb_occluder *o);
/* After that: ready to be filled. */
void umb_mesh_image_list(umb_mesh_scratch *s, const umb_raster_map *map, const umb_occluder *o);

#endif

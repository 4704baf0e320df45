/* Small boxes that together hold every triangle of a shape: they refine an object's bounds. */
#ifndef UMB_MESH_PARTS_H
#define UMB_MESH_PARTS_H

#include "base/scratch.h"
#include "mesh.h"

/* Parts of at most this many triangles are not cut. */
#define UMB_PART_TRIANGLES 2u

/* Cut triangles (corner indices into positions) into parts, top down. Returns an array of the scratch
 * memory, and another as *part_order; NULL when that has failed. There is at least one triangle. */
umb_part *umb_mesh_parts_build(umb_scratch *scratch, const float (*positions)[3],
                               const uint32_t (*triangles)[3], uint32_t triangle_count, uint32_t *part_count,
                               const uint32_t **part_order);

#endif

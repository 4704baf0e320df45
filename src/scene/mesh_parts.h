/* Small boxes that together hold every triangle of a shape: they refine an object's bounds. */
#ifndef UMB_MESH_PARTS_H
#define UMB_MESH_PARTS_H

#include "base/scratch.h"
#include "mesh.h"

/* Parts of at most least triangles are not cut; those of at most solid are left whole when cutting
 * them gains nothing. */
typedef struct umb_parts_rule {
    uint32_t least, solid;
} umb_parts_rule;

/* Cut triangles (corner indices into positions) into parts, top down. Returns an array of the
 * scratch memory, and another as *part_order; NULL when that has failed. There is at least one
 * triangle. */
umb_part *umb_mesh_parts_build(umb_scratch *scratch, const float (*positions)[3],
                               const uint32_t (*triangles)[3], uint32_t triangle_count, umb_parts_rule rule,
                               uint32_t *part_count, uint32_t **part_order);

#endif

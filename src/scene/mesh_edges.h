/* Adjacency: which edges bound which triangles. */
#ifndef UMB_MESH_EDGES_H
#define UMB_MESH_EDGES_H

#include "base/scratch.h"
#include "mesh.h"

/* The edges of triangles whose corners are three different vertices, paired as umb_edge says.
 * Returns an array of the scratch memory, entries of one edge in a row; NULL when that has
 * failed. */
umb_edge *umb_mesh_edges_build(umb_scratch *scratch, const uint32_t (*triangles)[3], const uint8_t *two_sided,
                               uint32_t triangle_count, uint32_t *edge_count);

#endif

/* Is a mesh the boundary of a convex body, seen from outside? */
#ifndef UMB_MESH_CONVEX_H
#define UMB_MESH_CONVEX_H

#include "mesh.h"

/* What umb_mesh.convex and umb_mesh.box promise, decided exactly. */
bool umb_mesh_convex_test(const umb_mesh *mesh);
/* Of a mesh that passed the test above. */
bool umb_mesh_convex_is_box(const umb_mesh *mesh);

#endif

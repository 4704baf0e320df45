/* The volumes of nodes (umb_tree.volumes), looked at after their boxes. */
#ifndef UMB_VOLUMES_H
#define UMB_VOLUMES_H

#include "detail.h"
#include "frustum/frustum.h"

/* False if a node's volume is so far beyond one of the planes of the mask that the box of every item below the node fails
 * umb_frustum_test_node() by that plane, too: what the frustum holds is the same with and without volumes. */
bool umb_volumes_in_view(const umb_frustum *f, const umb_tree *tree, uint32_t node, uint16_t planes);

/* True if a node's oriented box is hidden. Spheres are not asked about: their images hold more pixels than those of their
 * boxes. */
bool umb_volumes_hidden(const umb_asker *a, const umb_tree *tree, uint32_t node);

#endif

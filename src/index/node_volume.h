/* Volumes around nodes beside their boxes: spheres, or oriented boxes (Gummerus 3.1). What a volume is follows from the
 * boxes in its node and the volumes below it alone: a tree has the same ones however it came to be. */
#ifndef UMB_NODE_VOLUME_H
#define UMB_NODE_VOLUME_H

#include "bvh.h"

/* One for each node that there is room for. */
typedef struct umb_node_volumes {
    umb_node_volume *list;
    size_t capacity;
    bool spheres;
} umb_node_volumes;

/* Room for so many nodes. False without memory. */
bool umb_node_volumes_reserve(umb_node_volumes *volumes, const umb_allocator *a, size_t nodes);
void umb_node_volumes_free(umb_node_volumes *volumes, const umb_allocator *a);
size_t umb_node_volumes_memory(const umb_node_volumes *volumes);

/* Fit a node's volume, after those below it. True if that changed it. Nodes without slots have none. */
bool umb_node_volumes_fit(umb_node_volumes *volumes, const umb_node *nodes, uint32_t number);
void umb_node_volumes_fit_all(umb_node_volumes *volumes, const umb_node *nodes, uint32_t node_count);

#endif

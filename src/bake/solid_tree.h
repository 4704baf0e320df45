/* Which bodies may meet a shaft: a tree of boxes over them, two children a node. */
#ifndef UMB_SOLID_TREE_H
#define UMB_SOLID_TREE_H

#include "shaft.h"
#include "solid.h"

/* Children of a node follow one another; leaves hold a run of items. */
typedef struct umb_solid_node {
    umb_aabb box;
    uint32_t first; /* child, or item */
    uint32_t count; /* of items; 0: a node of two children */
} umb_solid_node;

typedef struct umb_solid_tree {
    umb_solid_node *nodes;
    uint32_t *items; /* numbers of bodies */
    size_t node_capacity, item_capacity;
    uint32_t node_count;
} umb_solid_tree;

void umb_solid_tree_free(umb_solid_tree *t, const umb_allocator *a);

/* Over all bodies. False: no memory; the tree is empty then. */
bool umb_solid_tree_build(umb_solid_tree *t, const umb_allocator *a, const umb_solids *s);

/* Numbers of bodies not beside the shaft, ascending: of more than `most`, the least. Returns how many. */
uint32_t umb_solid_tree_find(const umb_solid_tree *t, const umb_solids *s, const umb_shaft *shaft, uint32_t most,
                             uint32_t *out);

#endif

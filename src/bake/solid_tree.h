/* Which bodies a shaft or a segment may meet: a tree of boxes over them, four children a node. */
#ifndef UMB_SOLID_TREE_H
#define UMB_SOLID_TREE_H

#include "shaft.h"
#include "solid.h"

/* Boxes of four children side by side. */
typedef struct umb_solid_node {
    float middle[3][4], half[3][4]; /* half -INFINITY: there is no such child */
    uint32_t child[4]; /* a node, or a body with this bit: */
} umb_solid_node;

#define UMB_SOLID_LEAF 0x80000000u

typedef struct umb_solid_tree {
    umb_solid_node *nodes;
    uint32_t *items; /* numbers of bodies: working memory */
    size_t node_capacity, item_capacity;
    uint32_t node_count;
} umb_solid_tree;

void umb_solid_tree_free(umb_solid_tree *t, const umb_allocator *a);

/* Over all bodies. False: no memory; the tree is empty then. */
bool umb_solid_tree_build(umb_solid_tree *t, const umb_allocator *a, const umb_solids *s);

/* Numbers of bodies not beside the shaft, ascending: of more than `most`, the least. Returns how many. */
uint32_t umb_solid_tree_find(const umb_solid_tree *t, const umb_solids *s, const umb_shaft *shaft, uint32_t most,
                             uint32_t *out);

/* Numbers of bodies whose bounds the first segment (two ends) meets, as far as rounding can tell, and a few more: in
 * out[0 .. both_end) those that the second one meets too, in out[first_begin .. most) the others. Of more than `most`, some; then
 * the two ends meet. */
typedef struct umb_solids_along {
    uint32_t both_end, first_begin;
} umb_solids_along;

umb_solids_along umb_solid_tree_along(const umb_solid_tree *t, const double (*first)[3], const double (*second)[3],
                                      uint32_t most, uint32_t *out);

#endif

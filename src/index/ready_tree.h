/* A tree that is made ready beside the one in use: its nodes are laid out; boxes, counts, places and lists come in slices,
 * while what moves goes on moving. Then it takes the other's place at once. */
#ifndef UMB_READY_TREE_H
#define UMB_READY_TREE_H

#include "tree_edit.h"

typedef struct umb_ready_tree {
    umb_tree_stock stock;
    uint32_t *objects; /* umb_tree.objects */
    size_t object_capacity;
    uint32_t object_count; /* listed */
    uint32_t cursor;       /* nodes from here on are fitted; then: nodes up to here are listed */
    uint32_t occluder_limit; /* the numbers of its occluders are below it */
} umb_ready_tree;

/* Room for so many nodes and slots. False without memory. */
bool umb_ready_tree_reserve(umb_ready_tree *t, const umb_allocator *a, size_t nodes, size_t slots, const umb_committed *scene);
void umb_ready_tree_free(umb_ready_tree *t, const umb_allocator *a);
size_t umb_ready_tree_memory(const umb_ready_tree *t);

/* The stock's nodes are laid out, and their number is known: what follows is about these. False without memory. */
bool umb_ready_tree_begin(umb_ready_tree *t, const umb_allocator *a, const umb_committed *scene);
/* Give nodes the boxes of the day, children first. True when all have them. Takes what that costs from the budget. */
bool umb_ready_tree_fit(umb_ready_tree *t, const umb_committed *scene, int64_t *budget);
/* From then on: what a commit moved, in nodes that have been fitted before. */
void umb_ready_tree_follow(umb_ready_tree *t, const umb_committed *scene);
/* List the objects below each node, after all are fitted. True when that is done. */
bool umb_ready_tree_list(umb_ready_tree *t, int64_t *budget);

/* Change places with the tree in use. The list of objects stays here. False without memory: the edit has failed. */
bool umb_ready_tree_exchange(umb_ready_tree *t, umb_tree_edit *e, const umb_committed *scene);

#endif

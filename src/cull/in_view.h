/* The objects whose boxes are in a frustum, when nothing hides them: a walk without a queue by distance. */
#ifndef UMB_IN_VIEW_H
#define UMB_IN_VIEW_H

#include "once.h"

/* A node and the planes that its contents may cross. */
typedef struct umb_in_view_node {
    uint32_t number;
    uint16_t planes;
} umb_in_view_node;

/* A culler's room for it. */
typedef struct umb_in_view_room {
    umb_in_view_node *nodes;
    size_t node_capacity;
} umb_in_view_room;

/* The walk goes level by level. It writes whole groups of eight: out arrays have room for the tree's object_count and
 * UMB_TREE_SPARE more. */
typedef struct umb_in_view {
    const umb_tree *tree;
    const umb_view *view;
    const umb_box_kernels *kernels;
    umb_frustum frustum;
    umb_in_view_room *room;
    uint8_t *remember; /* umb_in_view_remembers() bytes, of umb_frustum_test_node() */
    /* Where entries is NULL, ids and flags are written; else entries with keys (found.h), by projector. */
    uint32_t *objects;
    uint8_t *inside;
    uint64_t *entries;
    const umb_projector *projector;
    /* Where once is not NULL ids alone are written, to objects, each once: umb_once_finish() does the rest. */
    const umb_committed *scene;
    umb_once *once;
    uint32_t count;
    umb_cull_stats *stats;
} umb_in_view;

bool umb_in_view_reserve(umb_in_view_room *room, const umb_allocator *a, const umb_tree *tree);
void umb_in_view_free(umb_in_view_room *room, const umb_allocator *a);
size_t umb_in_view_remembers(const umb_tree *tree);

/* Fills in count. A box that touches the closed frustum is found (umb_frustum_test_node); flags are 1 for boxes wholly
 * inside. What lies below a node wholly inside is copied as one range, if neither keys nor sizes are asked for. */
void umb_in_view_find(umb_in_view *v);

#endif

/* The walk for methods that choose their occluders first: depth first, each node's boxes asked about with what the
 * answer about the node left to ask. */
#ifndef UMB_CHOSEN_H
#define UMB_CHOSEN_H

#include "occlusion/method.h"
#include "once.h"

/* A node that waits: its planes that boxes may cross, and the token of its box. */
typedef struct umb_chosen_node {
    uint32_t number, token;
    uint16_t planes;
} umb_chosen_node;

/* A culler's room for it. */
typedef struct umb_chosen_room {
    umb_chosen_node *nodes;
    size_t capacity;
} umb_chosen_room;

typedef struct umb_chosen {
    const umb_choice *choice; /* the method has been given it */
    const umb_method_ops *ops;
    void *method;
    const umb_box_kernels *kernels;
    const umb_projector *projector; /* NULL: entries come without a key */
    umb_chosen_room *room;
    uint8_t *remember; /* of umb_frustum_test_node(), a byte for each node and block */
    uint64_t *entries; /* found.h; room for all objects */
    umb_once *once;    /* NULL: each item has one slot. Else umb_once_finish() is to follow */
    uint32_t count;    /* filled in */
} umb_chosen;

bool umb_chosen_reserve(umb_chosen_room *room, const umb_allocator *a, const umb_tree *tree);
void umb_chosen_free(umb_chosen_room *room, const umb_allocator *a);

/* Objects in view that the method does not find hidden. */
void umb_chosen_find(umb_chosen *v);

#endif

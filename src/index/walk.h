/* Trees front to back. */
#ifndef UMB_WALK_H
#define UMB_WALK_H

#include "tree.h"

/* Where order is seen from: an eye, or for parallel views the direction from which the viewer looks (the opposite of
 * the view's forward). */
typedef struct umb_walk_eye {
    double at[3];
    bool parallel;
} umb_walk_eye;

/* The slots of a node in front-to-back order, and for each the number of its batch, from 0 on: nothing below a slot of
 * a later batch hides anything below one of an earlier batch, whatever moves on a line from the eye (Gummerus 3.4 to 3.6;
 * batches of an octree are its units of equal eye-siding number, Tai and Hsu 3.3, whose slots cannot hide each other
 * either; those of planes are single cells, of whose contents nothing is known). Exact: the signs that decide are those
 * of real numbers. What lies in a plane of the tree, seen from an eye in that plane, is left out of this promise.
 * Trees without orders: by the distance of the boxes, each a batch; nothing is promised. Returns the number of
 * batches. */
uint32_t umb_walk_slots(const umb_tree *tree, uint32_t node, const umb_walk_eye *eye,
                        uint8_t slots[UMB_NODE_WIDTH], uint8_t batches[UMB_NODE_WIDTH]);

/* A walk from the root, depth first, in the order of umb_walk_slots(). visit is called for each slot met; for a slot
 * that refers to a node it says whether to go below. before: the number of batches that are done with, so that
 * slots for which it is equal are in any order. An item in parts is visited for each of them. Returns true if the order
 * is strict. Depth of recursion: that of the tree. Flat indices: rows in their order. */
typedef struct umb_walk_visitor {
    bool (*visit)(void *user, uint32_t node, uint32_t slot, uint32_t before);
    void *user;
} umb_walk_visitor;

bool umb_walk_front_to_back(const umb_tree *tree, const umb_walk_eye *eye, const umb_walk_visitor *visitor);

/* The same in units, for methods that ask about many boxes at once (Tai and Hsu 3.3, parallel units). A unit is one batch
 * of each of several nodes that cannot hide each other's contents. visit gets its slots, nearer units first, and
 * clears open[k] of slots that refer to nodes to stay above these. room and open have umb_walk_unit_slots() entries. Not
 * for flat indices. Returns true if the order is strict: nothing below a later unit hides anything below an earlier
 * one, but for what is in the same cell, whose contents come level by level. */
typedef struct umb_walk_slot {
    uint32_t node, slot;
} umb_walk_slot;

typedef struct umb_walk_unit_visitor {
    void (*visit)(void *user, const umb_walk_slot *slots, uint32_t count, bool *open);
    void *user;
    umb_walk_slot *room;
    bool *open;
} umb_walk_unit_visitor;

size_t umb_walk_unit_slots(const umb_tree *tree);
bool umb_walk_units(const umb_tree *tree, const umb_walk_eye *eye, const umb_walk_unit_visitor *visitor);

#endif

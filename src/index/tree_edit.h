/* Changing a tree where it stands: items come, go and move, nodes are made and given back, and no more is looked at
 * than the way from an item to the root. The strategies of update.h are made of these.
 *
 * Parents keep lower numbers than their children: a new node takes the lowest free number above its parent's, so refits
 * still run from the highest number down. Boxes of nodes only grow during edits; umb_bvh_lift_marked() makes them
 * exact again, once for all. */
#ifndef UMB_TREE_EDIT_H
#define UMB_TREE_EDIT_H

#include "base/number_set.h"
#include "scene/mask.h"
#include "node_volume.h"
#include "tree_stock.h"

/* In umb_node.edits: the node is in the list of worn ones. */
#define UMB_EDITS_WORN 0x80000000u

/* A tree's arrays, with room to grow. */
typedef struct umb_tree_edit {
    const umb_allocator *allocator;
    const umb_committed *scene; /* whose items these are */
    umb_tree_stock tree;
    umb_number_set free;       /* node numbers */
    umb_node_volumes *volumes; /* NULL: none are wanted */
    uint32_t *next;            /* places of items that have several (umb_bvh_find_places); NULL: none has */
    /* For a subtree that is made anew, and to find which. */
    umb_bvh_item *items;
    umb_bvh_split *splits;
    uint32_t *numbers;
    uint32_t *worn; /* roots of subtrees that have seen many edits */
    uint32_t worn_count;
    /* Nodes whose slots name something else than before the last commit, some of them more than once; the count is
     * UMB_TOUCHED_ALL if it may be any. */
    uint32_t *touched;
    uint32_t touched_count;
    size_t touched_capacity;
    size_t next_capacity, item_capacity, split_capacity, number_capacity, worn_capacity;
    size_t room;    /* nodes that all arrays have room for */
    uint64_t stale; /* edits since the lists of objects were made */
    bool wears;     /* edits count: subtrees are to be made anew after many */
    bool failed; /* no memory: the tree is not whole, and has to be built anew */
} umb_tree_edit;

/* Take over a tree just built, with capacity for as many nodes as it has. The arrays above, but the nodes, are kept from
 * tree to tree. Items are found by themselves. False without memory; the nodes are then still the caller's. */
bool umb_tree_edit_adopt(umb_tree_edit *e, umb_node *nodes, uint32_t node_count, size_t node_capacity, bool several,
                         const umb_committed *scene);
/* Change places with what makes another tree, in which no item has several places and no number is free. Marks and lists come
 * with it; volumes do not. False without memory: the tree has failed. */
bool umb_tree_edit_exchange(umb_tree_edit *e, umb_tree_stock *stock, const umb_committed *scene);
/* Counts, places and what boxes were built with, of a tree that has just been made node by node. */
void umb_tree_edit_learn(umb_tree_edit *e);
void umb_tree_edit_free(umb_tree_edit *e);
size_t umb_tree_edit_memory(const umb_tree_edit *e);

/* Room for the places of all objects and occluders of a scene. New ones are in no place. */
bool umb_tree_edit_reserve_places(umb_tree_edit *e, const umb_committed *scene);

/* Where an item is, the first of its places if there are several; UMB_NONE: nowhere. */
static inline uint32_t umb_tree_edit_place(const umb_tree_edit *e, uint32_t ref)
{
    return *umb_tree_stock_place(&e->tree, ref);
}

/* Room for so many nodes in all. False without memory. */
bool umb_tree_edit_reserve(umb_tree_edit *e, size_t nodes);

/* Leave an item that is in several places only one. */
void umb_tree_edit_gather(umb_tree_edit *e, uint32_t ref);

/* Take an item out of all its places. Nodes that become empty go, and those that hold one thing give way to it, up to
 * and without the node `under`, which stays and is taken to know of the change; UMB_NONE: up to the root. */
void umb_tree_edit_remove(umb_tree_edit *e, uint32_t ref, uint32_t under);

/* How a new item finds its place. */
typedef enum umb_tree_way {
    UMB_WAY_CHEAPEST, /* down where boxes grow least, into a free slot or beside the item that is nearest */
    UMB_WAY_DEEPEST   /* down into boxes that hold it, and no further (Shagam-Pfeiffer): full nodes are split */
} umb_tree_way;

/* Put an item, which is nowhere, below a node. The counts of the nodes up to and without `under` follow. */
void umb_tree_edit_insert(umb_tree_edit *e, umb_tree_way way, uint32_t node, uint32_t under, const umb_aabb *box,
                          uint32_t ref);

/* Put an item that is below a node, or was until now, into a slot of this very node. False if it is full. (Joining two
 * of its children to make room was tried: the tree became four times as costly.) */
bool umb_tree_edit_hold(umb_tree_edit *e, uint32_t node, const umb_aabb *box, uint32_t ref);

/* The first node, from this one up, whose box holds the box; the root if none does. */
uint32_t umb_tree_edit_holder(const umb_tree_edit *e, uint32_t node, const umb_aabb *box);

/* The layers of what a slot names; the item's or node's own are known. */
static inline uint32_t umb_ref_layers(const umb_committed *scene, const umb_node *nodes, uint32_t ref)
{
    uint32_t number = ref & UMB_REF_NUMBER;
    switch (ref & UMB_REF_KIND) {
    case UMB_REF_NODE:
        return nodes[number].layers;
    case UMB_REF_OBJECT:
        return scene->masked ? umb_layers_of(scene->objects[number].mask) : UINT32_MAX;
    default:
        return scene->masked ? umb_layers_of(scene->occluder_masks[number]) : UINT32_MAX;
    }
}

/* The layers of the nodes around objects that the commit put into others: exactly those that are there. Elsewhere, layers only
 * grow until a node is made anew. */
void umb_tree_edit_relayer(umb_tree_edit *e);

/* Give an item that is in one place another box. */
void umb_tree_edit_set_box(umb_tree_edit *e, uint32_t ref, const umb_aabb *box);

/* Close the gaps in the numbers once more than half of them are free: edits take numbers above those of parents, so they
 * drift upwards. The order stays. Returns true if it was done: nodes have other numbers then, those of the set too, and all
 * lists are stale. No node may be marked. */
bool umb_tree_edit_close_gaps(umb_tree_edit *e, umb_number_set *set);

/* Subtrees of up to `most` items that have seen more edits than they have items are made anew, in the node numbers that
 * they have. subtree.c */
void umb_tree_edit_renew_worn(umb_tree_edit *e, uint32_t most);
/* One subtree. False without memory; the tree is as it was then. */
bool umb_tree_edit_renew(umb_tree_edit *e, uint32_t node);

/* A node that holds nothing or one thing only goes, and those above it if they do, up to and without `under`. */
void umb_tree_edit_tidy(umb_tree_edit *e, uint32_t node, uint32_t under);

/* Half the surface of a node's box. */
float umb_tree_edit_area(const umb_node *node);

/* For the files of tree editing alone. */
uint32_t umb_tree_edit_new_node(umb_tree_edit *e, uint32_t parent);
void umb_tree_edit_give_node(umb_tree_edit *e, uint32_t node);
void umb_tree_edit_put(umb_tree_edit *e, uint32_t node, const umb_aabb *box, uint32_t ref);
void umb_tree_edit_link(umb_tree_edit *e, uint32_t ref, uint32_t place);
void umb_tree_edit_unlink(umb_tree_edit *e, uint32_t ref, uint32_t place);

#endif

/* What makes a tree, without what changing it needs: two of them change places as they are. */
#ifndef UMB_TREE_STOCK_H
#define UMB_TREE_STOCK_H

#include "bvh.h"

typedef struct umb_tree_stock {
    umb_node *nodes;
    umb_range *below;          /* of each node, then of each block: its part of the list of objects */
    umb_bvh_marks marks;       /* nodes whose boxes may be larger than what they hold */
    uint32_t *places;          /* of each object: 8 * node + slot, the first of them; UMB_NONE: nowhere */
    uint32_t *occluder_places; /* of each stand-alone occluder, by number */
    size_t node_capacity, below_capacity, place_capacity, occluder_capacity;
    uint32_t node_count; /* numbers up to here are in use or free */
    uint32_t slot_count; /* that name items */
} umb_tree_stock;

void umb_tree_stock_free(umb_tree_stock *stock, const umb_allocator *a);
size_t umb_tree_stock_memory(const umb_tree_stock *stock);
/* Nothing is anywhere; */
void umb_tree_stock_forget_places(umb_tree_stock *stock);
/* nor is any node marked. */
void umb_tree_stock_forget(umb_tree_stock *stock);

/* Where it is noted where an item is. */
static inline uint32_t *umb_tree_stock_place(const umb_tree_stock *stock, uint32_t ref)
{
    uint32_t number = ref & UMB_REF_NUMBER;
    return (ref & UMB_REF_KIND) == UMB_REF_OBJECT ? &stock->places[number] : &stock->occluder_places[number];
}

#endif

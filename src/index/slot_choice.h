/* The slots of one node: their boxes, and which of them suits a box. */
#ifndef UMB_SLOT_CHOICE_H
#define UMB_SLOT_CHOICE_H

#include "tree.h"

static inline void umb_slot_set_box(umb_node *node, uint32_t slot, const umb_aabb *box)
{
    for (int i = 0; i < 3; ++i) {
        node->min[i][slot] = box->min[i];
        node->max[i][slot] = box->max[i];
    }
}

static inline umb_aabb umb_slot_box(const umb_node *node, uint32_t slot)
{
    return (umb_aabb){{node->min[0][slot], node->min[1][slot], node->min[2][slot]},
                      {node->max[0][slot], node->max[1][slot], node->max[2][slot]}};
}

static inline void umb_aabb_grow(umb_aabb *a, const umb_aabb *b)
{
    for (int i = 0; i < 3; ++i) {
        a->min[i] = b->min[i] < a->min[i] ? b->min[i] : a->min[i];
        a->max[i] = b->max[i] > a->max[i] ? b->max[i] : a->max[i];
    }
}

static inline void umb_slot_grow(umb_node *node, uint32_t slot, const umb_aabb *box)
{
    umb_aabb b = umb_slot_box(node, slot);
    umb_aabb_grow(&b, box);
    umb_slot_set_box(node, slot, &b);
}

static inline bool umb_slot_holds(const umb_node *node, uint32_t slot, const umb_aabb *box)
{
    bool holds = true;
    for (int i = 0; i < 3; ++i) {
        holds &= (node->min[i][slot] <= box->min[i]) & (node->max[i][slot] >= box->max[i]);
    }
    return holds;
}

static inline bool umb_slot_is_node(const umb_node *node, uint32_t slot)
{
    return (node->ref[slot] & UMB_REF_KIND) == UMB_REF_NODE;
}

/* The slot, of a node that has one, that a box should go into or beside, by the surface that this adds: that of a child's
 * growth, or that of a node for an item and the box. enter: it is a child, and growing it is worth more than a free
 * slot. */
typedef struct umb_slot_choice {
    uint32_t slot;
    bool enter;
} umb_slot_choice;

umb_slot_choice umb_slot_choose(const umb_node *node, const umb_aabb *box);

/* The smallest child node whose box holds a box; UMB_NONE: none does. */
uint32_t umb_slot_holding(const umb_node *node, const umb_aabb *box);

#define UMB_SLOT_NO_GROUP 8u

/* Which items of a node lie together, by the rule of Shagam and Pfeiffer (Gummerus 3.8): planes across the axes through
 * the mean of all centres, each weighted by the inverse of its radius; a plane that cuts more than a quarter of the
 * items is dropped, but the one that cuts fewest stays. What a plane cuts is in no group. */
typedef struct umb_slot_groups {
    uint8_t of[UMB_NODE_WIDTH]; /* group of each slot; children are in none */
    uint8_t count[8];
} umb_slot_groups;

/* box: of an item that is to come, which has a say in the mean. */
void umb_slot_group(const umb_node *node, const umb_aabb *box, umb_slot_groups *out);

#endif

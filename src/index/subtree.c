/* A subtree made anew from its items, where it stands. */
#include "tree_edit.h"

/* The items and nodes below a node, itself first. False without memory. */
static bool gather(umb_tree_edit *e, uint32_t root, uint32_t *item_count, uint32_t *node_count)
{
    const umb_allocator *a = e->allocator;
    uint32_t items = 0, nodes = 1;
    if (!umb_memory_reserve(a, (void **)&e->items, &e->item_capacity, e->tree.nodes[root].items, sizeof *e->items) ||
        !umb_memory_reserve(a, (void **)&e->splits, &e->split_capacity, e->tree.nodes[root].items, sizeof *e->splits) ||
        !umb_memory_reserve(a, (void **)&e->numbers, &e->number_capacity, 1, sizeof *e->numbers)) {
        return false;
    }
    e->numbers[0] = root;
    for (uint32_t i = 0; i < nodes; ++i) {
        const umb_node *node = &e->tree.nodes[e->numbers[i]];
        if (!umb_memory_reserve(a, (void **)&e->numbers, &e->number_capacity, (size_t)nodes + UMB_NODE_WIDTH,
                                sizeof *e->numbers)) {
            return false;
        }
        for (uint32_t slot = 0; slot < node->count; ++slot) {
            uint32_t ref = node->ref[slot];
            if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
                e->numbers[nodes++] = ref;
                continue;
            }
            umb_bvh_item *item = &e->items[items++];
            for (int k = 0; k < 3; ++k) {
                item->min[k] = node->min[k][slot];
                item->max[k] = node->max[k][slot];
            }
            item->min[3] = item->max[3] = 0.0f;
            item->ref = ref;
        }
    }
    *item_count = items;
    *node_count = nodes;
    return true;
}

static void take_apart(umb_tree_edit *e, uint32_t node_count)
{
    for (uint32_t i = 0; i < node_count; ++i) {
        umb_node *node = &e->tree.nodes[e->numbers[i]];
        for (uint32_t slot = 0; slot < node->count; ++slot) {
            if ((node->ref[slot] & UMB_REF_KIND) != UMB_REF_NODE) {
                umb_tree_edit_unlink(e, node->ref[slot], e->numbers[i] * UMB_NODE_WIDTH + slot);
            }
        }
        if (i > 0) {
            umb_tree_edit_give_node(e, e->numbers[i]);
        }
    }
}

static uint32_t count_nodes(const umb_bvh_split *splits, uint32_t split)
{
    uint32_t slots[UMB_NODE_WIDTH], total = 1, count = umb_bvh_open(splits, split, slots);
    for (uint32_t i = 0; i < count; ++i) {
        total += (slots[i] & UMB_BVH_ITEM) == 0 ? count_nodes(splits, slots[i]) : 0;
    }
    return total;
}

static umb_aabb emit(umb_tree_edit *e, uint32_t split, uint32_t number)
{
    uint32_t slots[UMB_NODE_WIDTH], made[UMB_NODE_WIDTH], count = umb_bvh_open(e->splits, split, slots);
    umb_node *node = &e->tree.nodes[number];
    node->count = node->items = node->edits = node->layers = 0;
    for (uint32_t i = 0; i < count; ++i) { /* siblings side by side */
        made[i] = (slots[i] & UMB_BVH_ITEM) == 0 ? umb_tree_edit_new_node(e, number) : UMB_NONE;
    }
    for (uint32_t i = 0; i < count; ++i) {
        umb_aabb box;
        uint32_t ref = made[i], items = 1;
        if (ref != UMB_NONE) {
            box = emit(e, slots[i], ref);
            items = e->tree.nodes[ref].items;
        } else {
            const umb_bvh_item *item = &e->items[slots[i] & ~UMB_BVH_ITEM];
            box = (umb_aabb){{item->min[0], item->min[1], item->min[2]}, {item->max[0], item->max[1], item->max[2]}};
            ref = item->ref;
        }
        umb_tree_edit_put(e, number, &box, ref);
        e->tree.nodes[number].items += items;
    }
    umb_node_pad(&e->tree.nodes[number]);
    e->tree.nodes[number].built = umb_tree_edit_area(&e->tree.nodes[number]);
    return umb_node_bounds(&e->tree.nodes[number]);
}

bool umb_tree_edit_renew(umb_tree_edit *e, uint32_t root)
{
    uint32_t items, nodes;
    if (!gather(e, root, &items, &nodes)) {
        return false;
    }
    uint32_t split = umb_bvh_split_at_once(e->items, items, e->splits);
    /* Whatever numbers are free: enough at the end. */
    if (!umb_tree_edit_reserve(e, e->tree.node_count + count_nodes(e->splits, split))) {
        return false;
    }
    take_apart(e, nodes);
    emit(e, split, root);
    return true;
}

/* Cells of a grid stay what they are. */
static bool holds_cells(const umb_tree_edit *e, const umb_node *node)
{
    bool any = false;
    for (uint32_t slot = 0; slot < node->count; ++slot) {
        uint32_t ref = node->ref[slot];
        any = any || ((ref & UMB_REF_KIND) == UMB_REF_NODE && e->tree.nodes[ref].cell != 0);
    }
    return any;
}

void umb_tree_edit_renew_worn(umb_tree_edit *e, uint32_t most)
{
    /* The last ones noted are nearest to the root. */
    while (e->worn_count > 0) {
        uint32_t node = e->worn[--e->worn_count];
        umb_node *n = &e->tree.nodes[node];
        if (node >= e->tree.node_count || n->count == 0 || (n->edits & UMB_EDITS_WORN) == 0) {
            continue;
        }
        if (n->items > most || holds_cells(e, n) || !umb_tree_edit_renew(e, node)) {
            n->edits &= ~UMB_EDITS_WORN; /* later */
        }
    }
}

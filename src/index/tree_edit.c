#include "tree_edit.h"

#include <float.h>

#include "cut.h"
#include "slot_choice.h"

/* ---- places --------------------------------------------------------------------------------- */

void umb_tree_edit_link(umb_tree_edit *e, uint32_t ref, uint32_t place)
{
    uint32_t *head = umb_tree_stock_place(&e->tree, ref);
    if (e->next != NULL) {
        e->next[place] = *head;
    }
    *head = place;
}

void umb_tree_edit_unlink(umb_tree_edit *e, uint32_t ref, uint32_t place)
{
    uint32_t *link = umb_tree_stock_place(&e->tree, ref);
    while (e->next != NULL && *link != place) {
        link = &e->next[*link];
    }
    *link = e->next != NULL ? e->next[place] : UMB_NONE;
}

bool umb_tree_edit_reserve_places(umb_tree_edit *e, const umb_committed *scene)
{
    return umb_memory_reserve_none(e->allocator, &e->tree.places, &e->tree.place_capacity, scene->object_count) &&
           umb_memory_reserve_none(e->allocator, &e->tree.occluder_places, &e->tree.occluder_capacity, scene->occluder_count);
}

/* ---- nodes ---------------------------------------------------------------------------------- */

/* Room beside the nodes for what goes with them. */
static bool reserve_beside(umb_tree_edit *e)
{
    const umb_allocator *a = e->allocator;
    size_t nodes = e->tree.node_capacity, next = e->next != NULL ? nodes * UMB_NODE_WIDTH : 0;
    return umb_memory_reserve(a, (void **)&e->tree.below, &e->tree.below_capacity, nodes, sizeof *e->tree.below) &&
           umb_memory_reserve(a, (void **)&e->next, &e->next_capacity, next, sizeof *e->next) &&
           umb_bvh_marks_reserve(&e->tree.marks, a, (uint32_t)nodes) &&
           (e->volumes == NULL || umb_node_volumes_reserve(e->volumes, a, nodes)) &&
           umb_number_set_reserve(&e->free, a, (uint32_t)nodes);
}

bool umb_tree_edit_reserve(umb_tree_edit *e, size_t nodes)
{
    if (nodes <= e->room) {
        return true;
    }
    if (nodes > UMB_REF_NUMBER / UMB_NODE_WIDTH ||
        !umb_memory_reserve(e->allocator, (void **)&e->tree.nodes, &e->tree.node_capacity, nodes, sizeof *e->tree.nodes) ||
        !reserve_beside(e)) {
        return false;
    }
    e->room = e->tree.node_capacity;
    return true;
}

/* An empty node below a parent, which does not know it yet; UMB_NONE without memory. */
uint32_t umb_tree_edit_new_node(umb_tree_edit *e, uint32_t parent)
{
    uint32_t number = umb_number_set_next(&e->free, parent == UMB_NONE ? 0 : parent + 1);
    if (number != UMB_NONE) {
        umb_number_set_remove(&e->free, number);
    } else if (!umb_tree_edit_reserve(e, (size_t)e->tree.node_count + 1)) {
        e->failed = true;
        return UMB_NONE;
    } else {
        number = e->tree.node_count++;
    }
    e->tree.nodes[number] = (umb_node){.parent = parent};
    e->tree.below[number].count = UMB_RANGE_STALE;
    return number;
}

/* A node that nothing names any more. Without slots it is nothing to any pass over all nodes. */
void umb_tree_edit_give_node(umb_tree_edit *e, uint32_t number)
{
    umb_node *node = &e->tree.nodes[number];
    *node = (umb_node){.parent = UMB_NONE};
    for (uint32_t slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
        node->ref[slot] = UMB_NONE;
    }
    e->tree.below[number] = (umb_range){0, 0};
    umb_number_set_add(&e->free, number);
}

/* The items below change by so many, from a node up to and without another; what comes is in some layers. */
static void count(umb_tree_edit *e, uint32_t node, uint32_t under, uint32_t by, uint32_t layers)
{
    for (; node != under && node != UMB_NONE; node = e->tree.nodes[node].parent) {
        umb_node *n = &e->tree.nodes[node];
        n->items += by;
        n->layers |= layers;
        n->edits += e->wears;
        e->tree.below[node].count = UMB_RANGE_STALE;
        if (e->wears && n->edits < UMB_EDITS_WORN && n->edits > n->items / 2 + UMB_NODE_WIDTH &&
            e->worn_count < e->worn_capacity) {
            e->worn[e->worn_count++] = node;
            n->edits |= UMB_EDITS_WORN;
        }
    }
}

/* ---- slots ---------------------------------------------------------------------------------- */

static void touch(umb_tree_edit *e, uint32_t number)
{
    if (e->touched_count < e->touched_capacity) {
        e->touched[e->touched_count++] = number;
    } else {
        e->touched_count = UMB_TOUCHED_ALL;
    }
}

static void write_slot(umb_tree_edit *e, uint32_t number, uint32_t slot, const umb_aabb *box, uint32_t ref)
{
    umb_node *node = &e->tree.nodes[number];
    umb_slot_set_box(node, slot, box);
    node->ref[slot] = ref;
    node->layers |= umb_ref_layers(e->scene, e->tree.nodes, ref);
    if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
        e->tree.nodes[ref].parent = number;
        e->tree.nodes[ref].slot = slot;
    } else {
        umb_tree_edit_link(e, ref, number * UMB_NODE_WIDTH + slot);
    }
    umb_bvh_mark(&e->tree.marks, number);
    touch(e, number);
}

/* Into a free slot. */
void umb_tree_edit_put(umb_tree_edit *e, uint32_t node, const umb_aabb *box, uint32_t ref)
{
    write_slot(e, node, e->tree.nodes[node].count++, box, ref);
}

/* Make a slot free; what it names is linked to it no more. The last slot fills the gap. */
static void cut_slot(umb_tree_edit *e, uint32_t number, uint32_t slot)
{
    umb_node *node = &e->tree.nodes[number];
    uint32_t ref = node->ref[slot], last = --node->count, moved = node->ref[last];
    if ((ref & UMB_REF_KIND) != UMB_REF_NODE) {
        umb_tree_edit_unlink(e, ref, number * UMB_NODE_WIDTH + slot);
    }
    if (last != slot) {
        umb_aabb box = umb_slot_box(node, last);
        if ((moved & UMB_REF_KIND) != UMB_REF_NODE) {
            umb_tree_edit_unlink(e, moved, number * UMB_NODE_WIDTH + last);
        }
        write_slot(e, number, slot, &box, moved);
    }
    node->ref[last] = UMB_NONE;
    umb_bvh_mark(&e->tree.marks, number);
    touch(e, number);
}

/* What the only slot of a node names takes the node's place in its parent. */
static void hoist(umb_tree_edit *e, uint32_t number)
{
    umb_node *node = &e->tree.nodes[number];
    uint32_t parent = node->parent, slot = node->slot, ref = node->ref[0];
    umb_aabb box = umb_slot_box(node, 0);
    if ((ref & UMB_REF_KIND) != UMB_REF_NODE) {
        umb_tree_edit_unlink(e, ref, number * UMB_NODE_WIDTH);
    }
    write_slot(e, parent, slot, &box, ref);
    umb_tree_edit_give_node(e, number);
}

/* The root's only child becomes the root. */
static void lower_root(umb_tree_edit *e)
{
    umb_node *root = &e->tree.nodes[0];
    uint32_t child = root->ref[0];
    umb_node old = e->tree.nodes[child];
    root->count = 0;
    for (uint32_t slot = 0; slot < old.count; ++slot) {
        umb_aabb box = umb_slot_box(&old, slot);
        if ((old.ref[slot] & UMB_REF_KIND) != UMB_REF_NODE) {
            umb_tree_edit_unlink(e, old.ref[slot], child * UMB_NODE_WIDTH + slot);
        }
        umb_tree_edit_put(e, 0, &box, old.ref[slot]);
    }
    umb_tree_edit_give_node(e, child);
}

/* Nodes that hold nothing, or one thing only, are none. */
void umb_tree_edit_tidy(umb_tree_edit *e, uint32_t number, uint32_t under)
{
    while (number != under && number != UMB_NONE && e->tree.nodes[number].count < 2) {
        uint32_t parent = e->tree.nodes[number].parent;
        if (parent == UMB_NONE) {
            const umb_node *root = &e->tree.nodes[number];
            if (root->cell == 0 && root->count == 1 && (root->ref[0] & UMB_REF_KIND) == UMB_REF_NODE) {
                lower_root(e);
            }
            return;
        }
        if (e->tree.nodes[number].count == 1 && e->tree.nodes[number].cell != 0) {
            return; /* a cell is one for one thing, too */
        }
        if (e->tree.nodes[number].count == 1) {
            hoist(e, number);
            return;
        }
        cut_slot(e, parent, e->tree.nodes[number].slot);
        umb_tree_edit_give_node(e, number);
        number = parent;
    }
}

static void remove_place(umb_tree_edit *e, uint32_t place, uint32_t under)
{
    uint32_t node = place / UMB_NODE_WIDTH;
    count(e, node, under, (uint32_t)-1, 0);
    cut_slot(e, node, place % UMB_NODE_WIDTH);
    e->tree.slot_count -= 1;
    e->stale += 1;
    umb_tree_edit_tidy(e, node, under);
}

void umb_tree_edit_gather(umb_tree_edit *e, uint32_t ref)
{
    uint32_t place = umb_tree_edit_place(e, ref);
    while (e->next != NULL && place != UMB_NONE && e->next[place] != UMB_NONE) {
        remove_place(e, e->next[place], UMB_NONE);
        place = umb_tree_edit_place(e, ref);
    }
}

void umb_tree_edit_remove(umb_tree_edit *e, uint32_t ref, uint32_t under)
{
    for (uint32_t place = umb_tree_edit_place(e, ref); place != UMB_NONE; place = umb_tree_edit_place(e, ref)) {
        remove_place(e, place, under);
    }
    if (e->tree.slot_count == 0) {
        e->tree.node_count = 0;
        umb_number_set_clear(&e->free);
    }
}

/* ---- insertion ------------------------------------------------------------------------------ */

/* An item and a new one become a node of their own. */
static uint32_t pair(umb_tree_edit *e, uint32_t number, uint32_t slot, const umb_aabb *box, uint32_t ref)
{
    uint32_t made = umb_tree_edit_new_node(e, number);
    if (made == UMB_NONE) {
        return UMB_NONE;
    }
    umb_node *node = &e->tree.nodes[number];
    uint32_t other = node->ref[slot];
    umb_aabb both = umb_slot_box(node, slot);
    umb_tree_edit_unlink(e, other, number * UMB_NODE_WIDTH + slot);
    umb_tree_edit_put(e, made, &both, other);
    umb_tree_edit_put(e, made, box, ref);
    umb_aabb_grow(&both, box);
    write_slot(e, number, slot, &both, made);
    e->tree.nodes[made].items = 1; /* the new one is counted with the rest of the way */
    return made;
}

static uint32_t insert_cheapest(umb_tree_edit *e, uint32_t number, const umb_aabb *box, uint32_t ref)
{
    for (;;) {
        umb_node *node = &e->tree.nodes[number];
        if (node->count == 0) {
            umb_tree_edit_put(e, number, box, ref);
            return number;
        }
        umb_slot_choice c = umb_slot_choose(node, box);
        if (node->count < UMB_NODE_WIDTH && !c.enter) {
            umb_tree_edit_put(e, number, box, ref);
            return number;
        }
        if ((node->ref[c.slot] & UMB_REF_KIND) != UMB_REF_NODE) {
            return pair(e, number, c.slot, box, ref);
        }
        umb_slot_grow(node, c.slot, box);
        umb_bvh_mark(&e->tree.marks, number);
        number = node->ref[c.slot];
    }
}

/* Among the items of a full node and a new one, those that lie together on the same sides of the planes through their
 * weighted mean, as far as few of them are cut, become nodes (Shagam-Pfeiffer). True if a slot is free then. */
static bool split_full(umb_tree_edit *e, uint32_t number, const umb_aabb *box)
{
    umb_slot_groups groups;
    umb_slot_group(&e->tree.nodes[number], box, &groups);
    bool freed = false;
    for (uint32_t g = 0; g < 8; ++g) {
        if (groups.count[g] < 2 || groups.count[g] == UMB_NODE_WIDTH) {
            continue; /* one group of all would be the same node again */
        }
        uint32_t made = umb_tree_edit_new_node(e, number);
        if (made == UMB_NONE) {
            return false;
        }
        umb_aabb all = {{0, 0, 0}, {0, 0, 0}};
        for (uint32_t slot = UMB_NODE_WIDTH; slot-- > 0;) {
            umb_node *node = &e->tree.nodes[number];
            if (groups.of[slot] != g) {
                continue;
            }
            umb_aabb b = umb_slot_box(node, slot);
            uint32_t ref = node->ref[slot];
            cut_slot(e, number, slot);
            groups.of[slot] = groups.of[node->count]; /* the last one fills the gap */
            groups.of[node->count] = UMB_SLOT_NO_GROUP;
            umb_tree_edit_put(e, made, &b, ref);
            if (e->tree.nodes[made].count == 1) {
                all = b;
            }
            umb_aabb_grow(&all, &b);
        }
        e->tree.nodes[made].items = e->tree.nodes[made].count;
        umb_tree_edit_put(e, number, &all, made);
        freed = true;
    }
    return freed;
}

static uint32_t insert_deepest(umb_tree_edit *e, uint32_t number, const umb_aabb *box, uint32_t ref)
{
    bool split = false;
    for (;;) {
        umb_node *node = &e->tree.nodes[number];
        uint32_t slot = umb_slot_holding(node, box);
        if (slot != UMB_NONE) {
            number = node->ref[slot];
        } else if (node->count < UMB_NODE_WIDTH) {
            umb_tree_edit_put(e, number, box, ref);
            return number;
        } else if (split || !split_full(e, number, box)) {
            return e->failed ? UMB_NONE : insert_cheapest(e, number, box, ref);
        } else {
            split = true; /* one that the new item fits in may have been made */
        }
    }
}

void umb_tree_edit_insert(umb_tree_edit *e, umb_tree_way way, uint32_t node, uint32_t under, const umb_aabb *box,
                          uint32_t ref)
{
    if (e->tree.node_count == 0) {
        node = umb_tree_edit_new_node(e, UMB_NONE);
        under = UMB_NONE;
        if (node == UMB_NONE) {
            return;
        }
    }
    uint32_t in = way == UMB_WAY_DEEPEST ? insert_deepest(e, node, box, ref) : insert_cheapest(e, node, box, ref);
    if (in == UMB_NONE) {
        e->failed = true;
        return;
    }
    e->tree.slot_count += 1;
    e->stale += 1;
    count(e, in, under, 1, umb_ref_layers(e->scene, e->tree.nodes, ref));
}

bool umb_tree_edit_hold(umb_tree_edit *e, uint32_t number, const umb_aabb *box, uint32_t ref)
{
    if (e->tree.nodes[number].count == UMB_NODE_WIDTH) {
        return false;
    }
    umb_tree_edit_put(e, number, box, ref);
    e->tree.slot_count += 1;
    e->stale += 1;
    return true;
}

uint32_t umb_tree_edit_holder(const umb_tree_edit *e, uint32_t node, const umb_aabb *box)
{
    while (e->tree.nodes[node].parent != UMB_NONE &&
           !umb_slot_holds(&e->tree.nodes[e->tree.nodes[node].parent], e->tree.nodes[node].slot, box)) {
        node = e->tree.nodes[node].parent;
    }
    return node;
}

void umb_tree_edit_set_box(umb_tree_edit *e, uint32_t ref, const umb_aabb *box)
{
    uint32_t place = umb_tree_edit_place(e, ref);
    umb_slot_set_box(&e->tree.nodes[place / UMB_NODE_WIDTH], place % UMB_NODE_WIDTH, box);
    umb_bvh_mark(&e->tree.marks, place / UMB_NODE_WIDTH);
}

/* ---- layers --------------------------------------------------------------------------------- */

/* From a node up, as far as that changes anything. */
static void relayer(umb_tree_edit *e, uint32_t number)
{
    for (; number != UMB_NONE; number = e->tree.nodes[number].parent) {
        umb_node *node = &e->tree.nodes[number];
        uint32_t layers = 0;
        for (uint32_t slot = 0; slot < node->count; ++slot) {
            layers |= umb_ref_layers(e->scene, e->tree.nodes, node->ref[slot]);
        }
        if (layers == node->layers) {
            return;
        }
        node->layers = layers;
    }
}

void umb_tree_edit_relayer(umb_tree_edit *e)
{
    const umb_committed *scene = e->scene;
    for (uint32_t i = 0; i < scene->moved_count && scene->remasked_count > 0; ++i) {
        uint32_t id = scene->moved[i];
        for (uint32_t place = scene->objects[id].remasked ? e->tree.places[id] : UMB_NONE; place != UMB_NONE;
             place = e->next != NULL ? e->next[place] : UMB_NONE) {
            relayer(e, place / UMB_NODE_WIDTH);
        }
    }
}

/* ---- numbers -------------------------------------------------------------------------------- */

/* Fewer free numbers than this are left alone. */
#define LEAST_GAPS 64u

static void link_all(umb_tree_edit *e)
{
    umb_tree_stock_forget_places(&e->tree);
    for (uint32_t k = e->tree.node_count; k-- > 0;) {
        for (uint32_t slot = 0; slot < e->tree.nodes[k].count; ++slot) {
            if ((e->tree.nodes[k].ref[slot] & UMB_REF_KIND) != UMB_REF_NODE) {
                umb_tree_edit_link(e, e->tree.nodes[k].ref[slot], k * UMB_NODE_WIDTH + slot);
            }
        }
    }
}

/* Members that nobody uses any more are forgotten. to: of each old number the new one. */
static void renumber_set(umb_number_set *set, const umb_tree_edit *e, const umb_range *to)
{
    for (uint32_t k = umb_number_set_next(set, 0); k != UMB_NONE; k = umb_number_set_next(set, k + 1)) {
        umb_number_set_remove(set, k);
        if (k < e->tree.node_count && !umb_number_set_has(&e->free, k)) {
            umb_number_set_add(set, to[k].first); /* no higher than k: it is not met again */
        }
    }
}

bool umb_tree_edit_close_gaps(umb_tree_edit *e, umb_number_set *set)
{
    if (e->free.count <= e->tree.node_count / 2 + LEAST_GAPS) {
        return false;
    }
    umb_range *to = e->tree.below; /* lists are stale afterwards: there is room for the new numbers */
    uint32_t next = 0;
    for (uint32_t k = 0; k < e->tree.node_count; ++k) { /* parents before children */
        if (umb_number_set_has(&e->free, k)) {
            continue;
        }
        umb_node node = e->tree.nodes[k];
        if (node.parent != UMB_NONE) {
            node.parent = to[node.parent].first;
            e->tree.nodes[node.parent].ref[node.slot] = next;
        }
        to[k].first = next;
        if (e->volumes != NULL) {
            e->volumes->list[next] = e->volumes->list[k];
        }
        e->tree.nodes[next++] = node;
    }
    renumber_set(set, e, to);
    e->tree.node_count = next;
    umb_number_set_clear(&e->free);
    for (uint32_t k = 0; k < next; ++k) {
        e->tree.below[k].count = UMB_RANGE_STALE;
    }
    e->stale += e->tree.slot_count;
    e->touched_count = UMB_TOUCHED_ALL;
    link_all(e);
    return true;
}

/* ---- as a whole ----------------------------------------------------------------------------- */

float umb_tree_edit_area(const umb_node *node)
{
    umb_aabb box = umb_node_bounds(node);
    double area = umb_half_area(box.min, box.max);
    return area < FLT_MAX ? (float)area : FLT_MAX;
}

/* Counts, places and marks of a tree just built. Children come after their parents. */
void umb_tree_edit_learn(umb_tree_edit *e)
{
    e->tree.slot_count = 0;
    for (uint32_t k = e->tree.node_count; k-- > 0;) {
        umb_node *node = &e->tree.nodes[k];
        node->items = node->edits = node->layers = 0;
        for (uint32_t slot = 0; slot < node->count; ++slot) {
            uint32_t ref = node->ref[slot];
            node->layers |= umb_ref_layers(e->scene, e->tree.nodes, ref);
            if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
                node->items += e->tree.nodes[ref].items;
            } else {
                node->items += 1;
                e->tree.slot_count += 1;
                umb_tree_edit_link(e, ref, k * UMB_NODE_WIDTH + slot);
            }
        }
        node->built = umb_tree_edit_area(node);
        if (node->count == 0) {
            umb_number_set_add(&e->free, k);
        }
    }
}

#define MOST_WORN 256
#define MOST_TOUCHED 16384

bool umb_tree_edit_adopt(umb_tree_edit *e, umb_node *nodes, uint32_t node_count, size_t node_capacity, bool several,
                         const umb_committed *scene)
{
    const umb_allocator *a = e->allocator;
    size_t old_capacity = e->tree.node_capacity;
    e->tree.node_capacity = node_capacity;
    size_t next = several ? node_capacity * UMB_NODE_WIDTH : 0;
    if (!umb_memory_reserve(a, (void **)&e->next, &e->next_capacity, next, sizeof *e->next) || !reserve_beside(e) ||
        !umb_tree_edit_reserve_places(e, scene) ||
        !umb_memory_reserve(a, (void **)&e->worn, &e->worn_capacity, MOST_WORN, sizeof *e->worn) ||
        !umb_memory_reserve(a, (void **)&e->touched, &e->touched_capacity, MOST_TOUCHED, sizeof *e->touched)) {
        e->tree.node_capacity = old_capacity;
        return false;
    }
    if (!several && e->next != NULL) {
        umb_memory_free(a, e->next, e->next_capacity * sizeof *e->next);
        e->next = NULL;
        e->next_capacity = 0;
    }
    e->scene = scene;
    e->tree.nodes = nodes;
    e->tree.node_count = node_count;
    e->room = node_capacity;
    umb_number_set_clear(&e->free);
    umb_tree_stock_forget(&e->tree);
    e->worn_count = 0;
    e->touched_count = UMB_TOUCHED_ALL;
    e->stale = 0;
    e->failed = false;
    umb_tree_edit_learn(e);
    if (e->volumes != NULL) {
        umb_node_volumes_fit_all(e->volumes, nodes, node_count);
    }
    return true;
}

/* ---- exchange ------------------------------------------------------------------------------- */

bool umb_tree_edit_exchange(umb_tree_edit *e, umb_tree_stock *stock, const umb_committed *scene)
{
    umb_tree_stock old = e->tree;
    e->tree = *stock;
    *stock = old;
    umb_number_set_clear(&e->free);
    e->worn_count = 0;
    e->touched_count = UMB_TOUCHED_ALL;
    e->stale = 0;
    e->failed = !reserve_beside(e) || !umb_tree_edit_reserve_places(e, scene);
    e->room = e->tree.node_capacity;
    return !e->failed;
}

void umb_tree_edit_free(umb_tree_edit *e)
{
    const umb_allocator *a = e->allocator;
    umb_tree_stock_free(&e->tree, a);
    umb_memory_free(a, e->next, e->next_capacity * sizeof *e->next);
    umb_memory_free(a, e->items, e->item_capacity * sizeof *e->items);
    umb_memory_free(a, e->splits, e->split_capacity * sizeof *e->splits);
    umb_memory_free(a, e->numbers, e->number_capacity * sizeof *e->numbers);
    umb_memory_free(a, e->worn, e->worn_capacity * sizeof *e->worn);
    umb_memory_free(a, e->touched, e->touched_capacity * sizeof *e->touched);
    umb_number_set_free(&e->free, a);
    *e = (umb_tree_edit){.allocator = a};
}

size_t umb_tree_edit_memory(const umb_tree_edit *e)
{
    return umb_tree_stock_memory(&e->tree) +
           (e->next_capacity + e->number_capacity + e->worn_capacity + e->touched_capacity) * sizeof(uint32_t) +
           e->item_capacity * sizeof *e->items + e->split_capacity * sizeof *e->splits + umb_number_set_memory(&e->free);
}

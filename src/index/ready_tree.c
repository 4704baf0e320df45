#include "ready_tree.h"

#include <string.h>

#include "slot_choice.h"

/* What is done to one node costs, in about nanoseconds: measured at 100,000 and a million boxes. */
#define FIT_COST 300
#define LIST_COST 40
/* How many nodes ahead the boxes of items are asked for. */
#define AHEAD 4u

bool umb_ready_tree_reserve(umb_ready_tree *t, const umb_allocator *a, size_t nodes, size_t slots, const umb_committed *scene)
{
    umb_tree_stock *s = &t->stock;
    uint32_t occluders = scene->occluder_count > t->occluder_limit ? scene->occluder_count : t->occluder_limit;
    return umb_memory_reserve(a, (void **)&s->nodes, &s->node_capacity, nodes, sizeof *s->nodes) &&
           umb_memory_reserve(a, (void **)&s->below, &s->below_capacity, s->node_capacity, sizeof *s->below) &&
           umb_bvh_marks_reserve(&s->marks, a, (uint32_t)s->node_capacity) &&
           umb_memory_reserve_none(a, &s->places, &s->place_capacity, scene->object_count) &&
           umb_memory_reserve_none(a, &s->occluder_places, &s->occluder_capacity, occluders) &&
           umb_memory_reserve(a, (void **)&t->objects, &t->object_capacity, slots + UMB_TREE_SPARE, sizeof *t->objects);
}

void umb_ready_tree_free(umb_ready_tree *t, const umb_allocator *a)
{
    umb_tree_stock_free(&t->stock, a);
    umb_memory_free(a, t->objects, t->object_capacity * sizeof *t->objects);
    *t = (umb_ready_tree){0};
}

size_t umb_ready_tree_memory(const umb_ready_tree *t)
{
    return umb_tree_stock_memory(&t->stock) + t->object_capacity * sizeof *t->objects;
}

bool umb_ready_tree_begin(umb_ready_tree *t, const umb_allocator *a, const umb_committed *scene)
{
    umb_tree_stock *s = &t->stock;
    if (!umb_ready_tree_reserve(t, a, s->node_count, s->slot_count, scene)) {
        return false;
    }
    umb_tree_stock_forget(s);
    t->cursor = s->node_count;
    return true;
}

/* ---- boxes ---------------------------------------------------------------------------------- */

static const umb_aabb *box_of(const umb_committed *scene, uint32_t ref)
{
    uint32_t number = ref & UMB_REF_NUMBER;
    return (ref & UMB_REF_KIND) == UMB_REF_OBJECT ? &scene->objects[number].bounds : &scene->occluders[number].bounds;
}

static void fetch_items(umb_tree_stock *s, uint32_t number, const umb_committed *scene)
{
    const umb_node *node = &s->nodes[number];
    for (uint32_t slot = 0; slot < node->count; ++slot) {
        if (!umb_slot_is_node(node, slot)) {
            __builtin_prefetch(box_of(scene, node->ref[slot]));
            __builtin_prefetch(umb_tree_stock_place(s, node->ref[slot]), 1);
        }
    }
}

static void fit_node(umb_tree_stock *s, uint32_t number, const umb_committed *scene)
{
    umb_node *node = &s->nodes[number];
    node->items = node->edits = node->layers = 0;
    for (uint32_t slot = 0; slot < node->count; ++slot) {
        uint32_t ref = node->ref[slot];
        node->layers |= umb_ref_layers(scene, s->nodes, ref);
        if (umb_slot_is_node(node, slot)) {
            umb_aabb box = umb_node_bounds(&s->nodes[ref]);
            umb_slot_set_box(node, slot, &box);
            node->items += s->nodes[ref].items;
        } else {
            umb_slot_set_box(node, slot, box_of(scene, ref));
            *umb_tree_stock_place(s, ref) = number * UMB_NODE_WIDTH + slot;
            node->items += 1;
        }
    }
    umb_node_pad(node);
    node->built = umb_tree_edit_area(node);
    umb_bvh_count_below(s->nodes, number, s->below);
}

bool umb_ready_tree_fit(umb_ready_tree *t, const umb_committed *scene, int64_t *budget)
{
    for (; t->cursor > 0 && *budget > 0; *budget -= FIT_COST) {
        if (t->cursor > AHEAD) {
            fetch_items(&t->stock, t->cursor - 1 - AHEAD, scene);
        }
        fit_node(&t->stock, --t->cursor, scene);
    }
    t->object_count = 0;
    return t->cursor == 0;
}

/* Those of a node that has not been fitted are found later. */
static void add_layers(umb_node *nodes, uint32_t number, uint32_t layers)
{
    for (; number != UMB_NONE; number = nodes[number].parent) {
        nodes[number].layers |= layers;
    }
}

void umb_ready_tree_follow(umb_ready_tree *t, const umb_committed *scene)
{
    umb_tree_stock *s = &t->stock;
    for (uint32_t i = 0; i < scene->moved_count; ++i) {
        uint32_t object = scene->moved[i];
        uint32_t place = object < s->place_capacity ? s->places[object] : UMB_NONE;
        if (place != UMB_NONE) {
            umb_slot_set_box(&s->nodes[place / UMB_NODE_WIDTH], place % UMB_NODE_WIDTH, &scene->objects[object].bounds);
            umb_bvh_mark(&s->marks, place / UMB_NODE_WIDTH);
            if (scene->remasked_count > 0 && scene->objects[object].remasked) {
                add_layers(s->nodes, place / UMB_NODE_WIDTH, umb_layers_of(scene->objects[object].mask));
            }
        }
    }
}

/* ---- lists ---------------------------------------------------------------------------------- */

bool umb_ready_tree_list(umb_ready_tree *t, int64_t *budget)
{
    umb_tree_stock *s = &t->stock;
    for (; t->cursor < s->node_count && *budget > 0; ++t->cursor, *budget -= LIST_COST) {
        t->object_count += umb_bvh_list_below(s->nodes, t->cursor, t->object_count, t->objects, s->below);
    }
    if (t->cursor < s->node_count) {
        return false;
    }
    memset(t->objects + t->object_count, 0, UMB_TREE_SPARE * sizeof t->objects[0]);
    return true;
}

/* ---- the exchange --------------------------------------------------------------------------- */

bool umb_ready_tree_exchange(umb_ready_tree *t, umb_tree_edit *e, const umb_committed *scene)
{
    bool done = umb_tree_edit_exchange(e, &t->stock, scene);
    if (done) {
        umb_bvh_lift_marked(e->tree.nodes, &e->tree.marks, NULL);
        if (e->volumes != NULL) {
            umb_node_volumes_fit_all(e->volumes, e->tree.nodes, e->tree.node_count);
        }
    }
    return done;
}

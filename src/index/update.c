#include "update.h"

#include <string.h>

#include "cut.h"
#include "slot_choice.h"

/* What one change costs, in items built: measured on trees of a thousand to a million boxes. */
#define CHANGE_COST 6
/* Subtrees of more items are not made anew within one commit. */
#define MOST_RENEWED 4096
/* A node that a new volume makes larger than so many times its size is not where it belongs. */
#define MOST_GROWTH 2.0
/* Moves are few if there is one for so many items at most. */
#define FEW 16
/* A node is not where it belongs once one of few that move has made it so many times as large as it was made. One
 * in so many is looked at each commit, in turn. */
#define MOST_STRAYED 2.0
#define TURNS 4
/* How many moves ahead nodes are asked for: all that is looked at before is in the caches. */
#define AHEAD 8

bool umb_update_is_small(const umb_tree_edit *e, const umb_committed *scene, bool structure)
{
    uint64_t changes = structure ? (uint64_t)scene->came_count + scene->went_count + scene->replaced_count : 0;
    return changes * CHANGE_COST <= e->tree.slot_count;
}

/* ---- what goes and comes -------------------------------------------------------------------- */

static void take_away(umb_tree_edit *e, const umb_committed *scene)
{
    for (uint32_t i = 0; i < scene->went_count; ++i) {
        umb_tree_edit_remove(e, UMB_REF_OBJECT | scene->went[i], UMB_NONE);
    }
    for (uint32_t i = 0; i < scene->replaced_count; ++i) {
        if (scene->replaced[i] < e->tree.occluder_capacity) {
            umb_tree_edit_remove(e, UMB_REF_OCCLUDER | scene->replaced[i], UMB_NONE);
        }
    }
}

static void insert(const umb_updater *u, umb_tree_edit *e, const umb_aabb *box, uint32_t ref)
{
    if (u->strategy == UMB_UPDATE_OVERLAPPING) {
        umb_voxels_insert(&u->voxels, e, box, ref);
    } else {
        umb_tree_way way = u->strategy == UMB_UPDATE_DEEPEST ? UMB_WAY_DEEPEST : UMB_WAY_CHEAPEST;
        umb_tree_edit_insert(e, way, 0, UMB_NONE, box, ref);
    }
}

static void bring(const umb_updater *u, umb_tree_edit *e, const umb_committed *scene)
{
    for (uint32_t i = 0; i < scene->came_count && !e->failed; ++i) {
        uint32_t id = scene->came[i];
        insert(u, e, &scene->objects[id].bounds, UMB_REF_OBJECT | id);
    }
    for (uint32_t i = 0; i < scene->replaced_count && !e->failed; ++i) {
        uint32_t number = scene->replaced[i];
        if (number >= scene->first_free_occluder && number < scene->occluder_count) {
            insert(u, e, &scene->occluders[number].bounds, UMB_REF_OCCLUDER | number);
        }
    }
}

/* ---- what moves ----------------------------------------------------------------------------- */

/* Taken out, and put in from the top again. */
static void move_by_insertion(const umb_updater *u, umb_tree_edit *e, uint32_t ref, const umb_aabb *box)
{
    umb_tree_edit_remove(e, ref, UMB_NONE);
    insert(u, e, box, ref);
}

/* Only the subtree of the least common ancestor of the old and the new place changes (Sudarsky). Returns its root; if
 * that is the node that the item is in, the box alone has changed. */
static uint32_t leave(umb_tree_edit *e, uint32_t ref, const umb_aabb *box)
{
    umb_tree_edit_gather(e, ref);
    uint32_t node = umb_tree_edit_place(e, ref) / UMB_NODE_WIDTH;
    uint32_t ancestor = umb_tree_edit_holder(e, node, box);
    if (ancestor == node) {
        umb_tree_edit_set_box(e, ref, box);
        return UMB_NONE;
    }
    umb_tree_edit_remove(e, ref, ancestor);
    return ancestor;
}

static void move_below_ancestor(umb_tree_edit *e, uint32_t ref, const umb_aabb *box)
{
    uint32_t ancestor = leave(e, ref, box);
    if (ancestor != UMB_NONE) {
        umb_tree_edit_insert(e, UMB_WAY_CHEAPEST, ancestor, ancestor, box, ref);
        umb_tree_edit_tidy(e, ancestor, UMB_NONE);
    }
}

/* Up to the first node that holds it, and no more now (Aila-Miettinen). */
static void push_up(umb_updater *u, umb_tree_edit *e, uint32_t ref, const umb_aabb *box)
{
    uint32_t ancestor = leave(e, ref, box);
    if (ancestor == UMB_NONE) {
        return;
    }
    if (e->tree.node_count > 0 && umb_number_set_reserve(&u->raised, e->allocator, (uint32_t)e->tree.node_capacity) &&
        umb_tree_edit_hold(e, ancestor, box, ref)) {
        umb_number_set_add(&u->raised, ancestor);
    } else {
        umb_tree_edit_insert(e, UMB_WAY_CHEAPEST, ancestor, ancestor, box, ref);
    }
    umb_tree_edit_tidy(e, ancestor, UMB_NONE);
}

static void move_object(umb_updater *u, umb_tree_edit *e, uint32_t ref, const umb_aabb *box)
{
    switch (u->strategy) {
    case UMB_UPDATE_DELETE_INSERT:
    case UMB_UPDATE_DEEPEST:
        move_by_insertion(u, e, ref, box);
        break;
    case UMB_UPDATE_OVERLAPPING:
        umb_voxels_move(&u->voxels, e, box, ref);
        break;
    case UMB_UPDATE_LCA:
        move_below_ancestor(e, ref, box);
        break;
    case UMB_UPDATE_LAZY:
        push_up(u, e, ref, box);
        break;
    default:
        umb_tree_edit_gather(e, ref);
        umb_tree_edit_set_box(e, ref, box);
        break;
    }
}

static inline __attribute__((always_inline)) void fetch(const umb_tree_edit *e, uint32_t object)
{
    uint32_t place = e->tree.places[object];
    const umb_node *node = &e->tree.nodes[place != UMB_NONE ? place / UMB_NODE_WIDTH : 0];
    __builtin_prefetch(node->min, 1);
    __builtin_prefetch(node->min[2], 1);
    __builtin_prefetch(node->max[1], 1);
    __builtin_prefetch(node->ref, 1);
}

/* True if a node grows little when one of its items has another box. */
static bool fits(const umb_tree_edit *e, uint32_t place, const umb_aabb *box)
{
    const umb_node *node = &e->tree.nodes[place / UMB_NODE_WIDTH];
    umb_aabb whole = umb_node_bounds(node), with = whole;
    for (int i = 0; i < 3; ++i) {
        with.min[i] = box->min[i] < with.min[i] ? box->min[i] : with.min[i];
        with.max[i] = box->max[i] > with.max[i] ? box->max[i] : with.max[i];
    }
    return umb_half_area(with.min, with.max) <= MOST_GROWTH * umb_half_area(whole.min, whole.max);
}

/* A volume made anew (motion.h) is where its object is going now, as far from the last one as both are long; it then stays
 * for many frames. Where it is put decides how soon the tree is bad. */
static void place_volumes(umb_tree_edit *e, const umb_committed *scene)
{
    for (uint32_t i = 0; i < scene->moved_count && !e->failed; ++i) {
        uint32_t id = scene->moved[i];
        const umb_object *o = &scene->objects[id];
        if (o->mover != UMB_NONE && !o->exact && e->tree.places[id] != UMB_NONE && !fits(e, e->tree.places[id], &o->bounds)) {
            move_below_ancestor(e, UMB_REF_OBJECT | id, &o->bounds);
        }
    }
}

/* True if a node with an item's new box is much larger than when it was made. */
static bool has_strayed(umb_tree_edit *e, uint32_t number, const umb_aabb *box)
{
    umb_node *node = &e->tree.nodes[number];
    umb_node_pad(node);
    umb_aabb whole = umb_node_bounds(node);
    umb_aabb_grow(&whole, box);
    return umb_half_area(whole.min, whole.max) > MOST_STRAYED * (double)node->built;
}

/* The boxes from a node up to and without another, exactly. */
static void shrink(umb_tree_edit *e, uint32_t number, uint32_t under)
{
    for (uint32_t parent; number != under; number = parent) {
        umb_node_pad(&e->tree.nodes[number]);
        umb_aabb box = umb_node_bounds(&e->tree.nodes[number]);
        parent = e->tree.nodes[number].parent;
        umb_slot_set_box(&e->tree.nodes[parent], e->tree.nodes[number].slot, &box);
        umb_bvh_mark(&e->tree.marks, parent);
    }
}

/* Out of its node, and below the first one above that holds it. The boxes that it has made large shrink first, or what it leaves
 * would be found to be the cheapest place for it. */
static void place_stray(umb_tree_edit *e, uint32_t ref, const umb_aabb *box)
{
    uint32_t place = umb_tree_edit_place(e, ref), node = place / UMB_NODE_WIDTH, slot = place % UMB_NODE_WIDTH;
    if (e->tree.nodes[node].parent == UMB_NONE) {
        return; /* the root is where everything belongs */
    }
    uint32_t ancestor = umb_tree_edit_holder(e, e->tree.nodes[node].parent, box);
    umb_aabb other = umb_slot_box(&e->tree.nodes[node], slot == 0 ? 1 : 0);
    umb_slot_set_box(&e->tree.nodes[node], slot, &other);
    shrink(e, node, ancestor);
    umb_tree_edit_remove(e, ref, ancestor);
    umb_tree_edit_insert(e, UMB_WAY_CHEAPEST, ancestor, ancestor, box, ref);
    umb_tree_edit_tidy(e, ancestor, UMB_NONE);
    if (!e->failed) {
        umb_node *in = &e->tree.nodes[umb_tree_edit_place(e, ref) / UMB_NODE_WIDTH];
        umb_node_pad(in);
        in->built = in->built > 0.0f ? in->built : umb_tree_edit_area(in); /* 0: it was made for this one */
    }
}

/* Where few move, they go far from those that they were put beside before there are changes enough for a new tree, and make boxes
 * as long as their ways. Each is put elsewhere once its node has grown: one such commit in twenty or so, for each of them. What
 * moves by itself is left out: beside large volumes that opened more nodes than it saved. */
static void place_strays(umb_tree_edit *e, const umb_committed *scene)
{
    for (uint32_t i = (uint32_t)(scene->version % TURNS); i < scene->moved_count && !e->failed; i += TURNS) {
        uint32_t id = scene->moved[i];
        if (i + AHEAD * TURNS < scene->moved_count) {
            fetch(e, scene->moved[i + AHEAD * TURNS]);
        }
        const umb_object *o = &scene->objects[id];
        if (o->mover == UMB_NONE && e->tree.places[id] != UMB_NONE &&
            has_strayed(e, e->tree.places[id] / UMB_NODE_WIDTH, &o->bounds)) {
            place_stray(e, UMB_REF_OBJECT | id, &o->bounds);
        }
    }
}

static void move_all(umb_updater *u, umb_tree_edit *e, const umb_committed *scene)
{
    bool incremental = u->strategy == UMB_UPDATE_INCREMENTAL, refits = u->strategy == UMB_UPDATE_REFIT || incremental;
    if (incremental && scene->motion.count > 0) {
        place_volumes(e, scene);
    }
    if (incremental && e->next == NULL && (uint64_t)scene->moved_count * FEW <= e->tree.slot_count) {
        place_strays(e, scene);
    }
    if (refits && e->next == NULL) {
        umb_bvh_refit_moved(e->tree.nodes, &e->tree.marks, e->tree.places, scene, e->volumes);
        return;
    }
    for (uint32_t i = 0; i < scene->moved_count && !e->failed; ++i) {
        uint32_t id = scene->moved[i];
        if (i + AHEAD < scene->moved_count) {
            fetch(e, scene->moved[i + AHEAD]);
        }
        if (e->tree.places[id] != UMB_NONE) {
            move_object(u, e, UMB_REF_OBJECT | id, &scene->objects[id].bounds);
        }
    }
}

/* ---- lazy pushes ---------------------------------------------------------------------------- */

static bool has_children(const umb_node *node)
{
    bool any = false;
    for (uint32_t slot = 0; slot < node->count; ++slot) {
        any = any || umb_slot_is_node(node, slot);
    }
    return any;
}

static bool is_whole(const umb_tree_edit *e, uint32_t ref)
{
    return e->next == NULL || e->next[umb_tree_edit_place(e, ref)] == UMB_NONE;
}

/* What a node holds goes down into its children, as far as it belongs there. What is in parts, which are many places,
 * stays. */
static void push_down(umb_tree_edit *e, uint32_t number)
{
    for (uint32_t slot = e->tree.nodes[number].count; slot-- > 0 && has_children(&e->tree.nodes[number]) && !e->failed;) {
        const umb_node *node = &e->tree.nodes[number];
        if (!umb_slot_is_node(node, slot) && is_whole(e, node->ref[slot])) {
            umb_aabb box = umb_slot_box(node, slot);
            uint32_t ref = node->ref[slot];
            umb_tree_edit_remove(e, ref, number);
            umb_tree_edit_insert(e, UMB_WAY_CHEAPEST, number, number, &box, ref);
        }
    }
    umb_tree_edit_tidy(e, number, UMB_NONE);
}

/* Nodes that a walk opened since the last commit are put in order; what nobody looks at waits. */
static void push_down_opened(umb_updater *u, umb_tree_edit *e)
{
    if (u->raised.count == 0) {
        return;
    }
    for (uint32_t k = umb_number_set_next(&u->raised, 0); k < e->tree.node_count && !e->failed;
         k = umb_number_set_next(&u->raised, k + 1)) {
        if ((u->opened[k >> 6] >> (k & 63) & 1u) != 0) {
            umb_number_set_remove(&u->raised, k);
            if (e->tree.nodes[k].count > 0) {
                push_down(e, k);
            }
        }
    }
    memset(u->opened, 0, u->opened_capacity * sizeof *u->opened);
}

bool umb_update_reserve(umb_updater *u, const umb_tree_edit *e)
{
    if (u->strategy != UMB_UPDATE_LAZY) {
        return true;
    }
    return umb_memory_reserve_zero(e->allocator, (void **)&u->opened, &u->opened_capacity, e->tree.node_capacity / 64 + 1,
                                   sizeof *u->opened) &&
           umb_number_set_reserve(&u->raised, e->allocator, (uint32_t)e->tree.node_capacity);
}

size_t umb_update_memory(const umb_updater *u)
{
    return umb_number_set_memory(&u->raised) + u->opened_capacity * sizeof *u->opened;
}

void umb_update_free(umb_updater *u, const umb_allocator *a)
{
    umb_memory_free(a, u->opened, u->opened_capacity * sizeof *u->opened);
    umb_number_set_free(&u->raised, a);
    *u = (umb_updater){.strategy = u->strategy};
}

/* ---- one commit ----------------------------------------------------------------------------- */

bool umb_update_follow(umb_updater *u, umb_tree_edit *e, const umb_committed *scene, bool structure)
{
    if (!umb_tree_edit_reserve_places(e, scene)) {
        return false;
    }
    e->wears = false;
    push_down_opened(u, e);
    e->wears = true;
    if (structure) {
        take_away(e, scene);
    }
    e->wears = false;
    move_all(u, e, scene);
    e->wears = true;
    if (structure) {
        bring(u, e, scene);
    }
    umb_tree_edit_relayer(e);
    umb_tree_edit_renew_worn(e, MOST_RENEWED);
    if (e->failed || !umb_update_reserve(u, e)) {
        return false;
    }
    umb_bvh_lift_marked(e->tree.nodes, &e->tree.marks, e->volumes);
    if (umb_tree_edit_close_gaps(e, &u->raised) && u->opened_capacity > 0) {
        memset(u->opened, 0, u->opened_capacity * sizeof *u->opened);
    }
    return true;
}

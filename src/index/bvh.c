/* The wide half of the build, and refitting. */
#include "cells.h"
#include "node_volume.h"

#include <string.h>

/* ---- nodes ---------------------------------------------------------------------------------- */

static inline void set_slot(umb_node *node, uint32_t slot, const float min[3], const float max[3],
                     uint32_t ref)
{
    for (int i = 0; i < 3; ++i) {
        node->min[i][slot] = min[i];
        node->max[i][slot] = max[i];
    }
    node->ref[slot] = ref;
}

void umb_node_pad(umb_node *node)
{
    for (uint32_t slot = node->count; slot < UMB_NODE_WIDTH; ++slot) {
        for (int i = 0; i < 3; ++i) {
            node->min[i][slot] = node->min[i][0];
            node->max[i][slot] = node->max[i][0];
        }
        node->ref[slot] = UMB_NONE;
    }
}

static inline float lower(float a, float b)
{
    return a < b ? a : b;
}

static inline float higher(float a, float b)
{
    return a > b ? a : b;
}

/* In halves: three steps deep instead of seven. */
static inline float lowest_of(const float x[UMB_NODE_WIDTH])
{
    return lower(lower(lower(x[0], x[4]), lower(x[2], x[6])),
                 lower(lower(x[1], x[5]), lower(x[3], x[7])));
}

static inline float highest_of(const float x[UMB_NODE_WIDTH])
{
    return higher(higher(higher(x[0], x[4]), higher(x[2], x[6])),
                  higher(higher(x[1], x[5]), higher(x[3], x[7])));
}

static inline umb_aabb bounds_of(const umb_node *node)
{
    umb_aabb b;
    for (int i = 0; i < 3; ++i) {
        b.min[i] = lowest_of(node->min[i]);
        b.max[i] = highest_of(node->max[i]);
    }
    return b;
}

umb_aabb umb_node_bounds(const umb_node *node)
{
    return bounds_of(node);
}

/* ---- wide nodes ----------------------------------------------------------------------------- */

typedef struct emitter {
    const umb_bvh_item *items;
    const umb_bvh_split *splits;
    const umb_cell_cut *cuts; /* NULL: no orders */
    const umb_cell_point *points;
    umb_node *nodes;
    umb_order *orders;
    uint32_t next;
} emitter;

/* The slots of one wide node while they are gathered. */
typedef struct opened {
    uint32_t slots[UMB_NODE_WIDTH];
    uint32_t count, split_count;
    uint8_t octant; /* that is being gathered */
    const umb_cell_cut *cuts;
    umb_order *order; /* NULL: not wanted */
} opened;

/* Halves of an octree node: where an octant begins, it is noted down. */
static void enter_octant(opened *o, uint32_t half)
{
    bool item = (half & UMB_BVH_ITEM) != 0;
    const umb_cell_cut *cut = &o->cuts[half & ~UMB_BVH_ITEM];
    if (item || cut->group != UMB_CELL_INNER) {
        o->octant = cut->octant[item];
    }
}

static uint8_t gather(opened *o, const umb_bvh_split *splits, uint32_t node, int j);

/* The two halves of a split, left in so many slots and right in so many, and how they are in order. Splits without a
 * plane are within one cell, and so is all below them. */
static uint8_t gather_halves(opened *o, const umb_bvh_split *splits, uint32_t node, int left, int right)
{
    const umb_bvh_split *s = &splits[node];
    umb_order *order = o->order;
    if (order == NULL || o->cuts[node].axis == UMB_CELL_NO_PLANE) {
        gather(o, splits, s->left, left);
        gather(o, splits, s->right, right);
        return UMB_ORDER_END;
    }
    if (o->cuts[node].group != UMB_CELL_ALONE) {
        enter_octant(o, s->left);
        gather(o, splits, s->left, left);
        enter_octant(o, s->right);
        gather(o, splits, s->right, right);
        return UMB_ORDER_END;
    }
    uint32_t k = o->split_count++;
    const umb_cell_cut *cut = &o->cuts[node];
    order->kind = UMB_ORDER_PLANES;
    order->axis[k] = cut->axis;
    if (cut->axis == UMB_ORDER_TILTED) {
        order->number[k] = cut->number;
    } else {
        order->at[k] = cut->at;
    }
    order->next[k][0] = gather(o, splits, s->left, left);
    order->middle[k] = (uint8_t)o->count;
    order->next[k][1] = gather(o, splits, s->right, right);
    return (uint8_t)k;
}

/* Append to the slots what stands for a subtree in at most j of them. Returns the split that orders them. */
static uint8_t gather(opened *o, const umb_bvh_split *splits, uint32_t node, int j)
{
    if ((node & UMB_BVH_ITEM) == 0) {
        const umb_bvh_split *s = &splits[node];
        while (j > 1 && s->pick[j - 1] == 0) {
            --j;
        }
        if (j > 1) {
            return gather_halves(o, splits, node, s->pick[j - 1], j - s->pick[j - 1]);
        }
    }
    if (o->order != NULL && o->order->kind == UMB_ORDER_OCTANTS) {
        o->order->octant[o->count] = o->octant;
    }
    o->slots[o->count++] = node;
    return UMB_ORDER_END;
}

/* The slots of the wide node at a subtree's root. */
static void open_node(opened *o, const umb_bvh_split *splits, uint32_t node)
{
    if (node & UMB_BVH_ITEM) {
        o->slots[o->count++] = node;
        return;
    }
    int left = splits[node].pick[UMB_NODE_WIDTH - 1];
    gather_halves(o, splits, node, left, UMB_NODE_WIDTH - left);
}

uint32_t umb_bvh_open(const umb_bvh_split *splits, uint32_t node, uint32_t slots[UMB_NODE_WIDTH])
{
    opened o = {.count = 0};
    open_node(&o, splits, node);
    memcpy(slots, o.slots, o.count * sizeof(slots[0]));
    return o.count;
}

static uint32_t count_nodes(const umb_bvh_split *splits, uint32_t node, uint32_t *slots)
{
    opened o = {.count = 0};
    open_node(&o, splits, node);
    uint32_t total = 1;
    for (uint32_t i = 0; i < o.count; ++i) {
        if ((o.slots[i] & UMB_BVH_ITEM) == 0) {
            total += count_nodes(splits, o.slots[i], slots);
        } else {
            *slots += 1;
        }
    }
    return total;
}

static void emit(emitter *e, uint32_t split, uint32_t number, uint32_t parent)
{
    opened o = {.cuts = e->cuts, .order = e->orders != NULL ? &e->orders[number] : NULL};
    umb_node *node = &e->nodes[number];
    memset(node, 0, sizeof(*node));
    node->parent = parent;
    if (o.order != NULL && (split & UMB_BVH_ITEM) == 0 && o.cuts[split].group == UMB_CELL_TOP) {
        o.order->kind = UMB_ORDER_OCTANTS;
        o.order->axes = (uint8_t)e->points[split].axes;
        memcpy(o.order->at, e->points[split].at, sizeof(e->points[split].at));
    }
    open_node(&o, e->splits, split);
    node->count = o.count;
    for (uint32_t i = 0; i < node->count; ++i) {
        if (o.slots[i] & UMB_BVH_ITEM) {
            const umb_bvh_item *item = &e->items[o.slots[i] & ~UMB_BVH_ITEM];
            set_slot(node, i, item->min, item->max, item->ref);
        } else {
            node->ref[i] = UMB_REF_NODE | e->next++;
        }
    }
    for (uint32_t i = 0; i < node->count; ++i) {
        if ((o.slots[i] & UMB_BVH_ITEM) == 0) {
            uint32_t child = node->ref[i];
            emit(e, o.slots[i], child, number);
            e->nodes[child].slot = i;
            umb_aabb box = umb_node_bounds(&e->nodes[child]);
            set_slot(node, i, box.min, box.max, child);
        }
    }
    umb_node_pad(node);
}

static size_t order_bytes(const umb_built *built)
{
    return built->orders != NULL ? built->node_count * sizeof(umb_order) : 0;
}

void umb_built_free(umb_built *built, const umb_allocator *a)
{
    umb_memory_free(a, built->nodes, built->node_count * sizeof(umb_node));
    umb_memory_free(a, built->orders, order_bytes(built));
    umb_memory_free(a, built->planes, built->plane_count * sizeof(umb_tilted_plane));
    *built = (umb_built){0};
}

size_t umb_built_memory(const umb_built *built)
{
    return built->node_count * sizeof(umb_node) + order_bytes(built) + built->plane_count * sizeof(umb_tilted_plane);
}

umb_result umb_bvh_lay_out(const umb_allocator *a, const umb_bvh_item *items, const umb_bvh_split *splits,
                           uint32_t root, const umb_cell_cut *cuts, const umb_cell_point *points, umb_built *out)
{
    *out = (umb_built){0};
    out->node_count = count_nodes(splits, root, &out->slot_count);
    out->nodes = umb_memory_allocate(a, out->node_count * sizeof(umb_node));
    if (cuts != NULL) {
        out->orders = umb_memory_allocate_zero(a, out->node_count, sizeof(umb_order));
    }
    if (out->nodes == NULL || (cuts != NULL && out->orders == NULL)) {
        umb_built_free(out, a);
        return UMB_ERROR_MEMORY;
    }
    emitter e = {items, splits, cuts, points, out->nodes, out->orders, 1};
    emit(&e, root, 0, UMB_NONE);
    return UMB_OK;
}

umb_result umb_bvh_build(const umb_allocator *a, const umb_tasks *tasks, umb_bvh_item *items,
                         uint32_t count, umb_built *out)
{
    *out = (umb_built){0};
    size_t bytes = (size_t)count * sizeof(umb_bvh_split);
    umb_bvh_split *splits = umb_memory_allocate(a, bytes);
    if (splits == NULL) {
        return UMB_ERROR_MEMORY;
    }
    uint32_t root;
    umb_result result = umb_bvh_split_items(a, tasks, items, count, splits, &root);
    if (result == UMB_OK) {
        result = umb_bvh_lay_out(a, items, splits, root, NULL, NULL, out);
    }
    umb_memory_free(a, splits, bytes);
    return result;
}

/* ---- refitting ------------------------------------------------------------------------------ */

void umb_bvh_refit(umb_node *nodes, uint32_t node_count, const umb_committed *scene)
{
    for (uint32_t k = node_count; k-- > 0;) {
        umb_node *node = &nodes[k];
        for (uint32_t slot = 0; slot < node->count; ++slot) {
            uint32_t ref = node->ref[slot];
            uint32_t number = ref & UMB_REF_NUMBER;
            umb_aabb box;
            switch (ref & UMB_REF_KIND) {
            case UMB_REF_NODE:
                box = umb_node_bounds(&nodes[number]);
                break;
            case UMB_REF_OBJECT:
                box = scene->objects[number].bounds;
                break;
            default:
                box = scene->occluders[number].bounds;
                break;
            }
            set_slot(node, slot, box.min, box.max, ref);
        }
        umb_node_pad(node);
    }
}

void umb_bvh_find_places(const umb_node *nodes, uint32_t node_count, uint32_t *places,
                         uint32_t object_count, uint32_t *next)
{
    for (uint32_t i = 0; i < object_count; ++i) {
        places[i] = UMB_NONE;
    }
    for (uint32_t k = 0; k < node_count; ++k) {
        for (uint32_t slot = 0; slot < nodes[k].count; ++slot) {
            uint32_t ref = nodes[k].ref[slot];
            if ((ref & UMB_REF_KIND) == UMB_REF_OBJECT) {
                if (next != NULL) {
                    next[k * UMB_NODE_WIDTH + slot] = places[ref & UMB_REF_NUMBER];
                }
                places[ref & UMB_REF_NUMBER] = k * UMB_NODE_WIDTH + slot;
            }
        }
    }
}

/* ---- lists of objects ------------------------------------------------------------------------ */

void umb_bvh_count_below(const umb_node *nodes, uint32_t number, umb_range *below)
{
    uint32_t count = 0;
    for (uint32_t slot = 0; slot < nodes[number].count; ++slot) {
        uint32_t ref = nodes[number].ref[slot], kind = ref & UMB_REF_KIND;
        count += kind == UMB_REF_NODE ? below[ref & UMB_REF_NUMBER].count : kind == UMB_REF_OBJECT;
    }
    below[number].count = count;
}

uint32_t umb_bvh_list_below(const umb_node *nodes, uint32_t number, uint32_t first, uint32_t *objects, umb_range *below)
{
    const umb_node *node = &nodes[number];
    bool top = node->parent == UMB_NONE;
    if (top) {
        below[number].first = first;
    }
    uint32_t at = below[number].first;
    for (uint32_t slot = 0; slot < node->count; ++slot) {
        uint32_t ref = node->ref[slot], to = ref & UMB_REF_NUMBER;
        switch (ref & UMB_REF_KIND) {
        case UMB_REF_NODE:
            below[to].first = at;
            at += below[to].count;
            break;
        case UMB_REF_OBJECT:
            objects[at++] = to;
            break;
        default:
            break;
        }
    }
    return top ? below[number].count : 0;
}

uint32_t umb_bvh_list_objects(const umb_node *nodes, uint32_t node_count, uint32_t *objects, umb_range *below)
{
    uint32_t total = 0;
    for (uint32_t k = node_count; k-- > 0;) {
        umb_bvh_count_below(nodes, k, below);
    }
    for (uint32_t k = 0; k < node_count; ++k) {
        total += umb_bvh_list_below(nodes, k, total, objects, below);
    }
    memset(objects + total, 0, UMB_TREE_SPARE * sizeof objects[0]);
    return total;
}

/* ---- refitting what moved ------------------------------------------------------------------- */

umb_result umb_bvh_marks_create(umb_bvh_marks *marks, const umb_allocator *a, uint32_t node_count)
{
    *marks = (umb_bvh_marks){0};
    size_t node_words = (size_t)node_count / 64 + 1;
    size_t word_words = node_words / 64 + 1;
    marks->nodes = umb_memory_allocate_zero(a, node_words + word_words, sizeof(marks->nodes[0]));
    if (marks->nodes == NULL) {
        return UMB_ERROR_MEMORY;
    }
    marks->words = marks->nodes + node_words;
    marks->node_words = node_words;
    marks->word_words = word_words;
    return UMB_OK;
}

bool umb_bvh_marks_reserve(umb_bvh_marks *marks, const umb_allocator *a, uint32_t node_count)
{
    if (marks->nodes != NULL && (size_t)node_count / 64 + 1 <= marks->node_words) {
        return true;
    }
    umb_bvh_marks more;
    if (umb_bvh_marks_create(&more, a, node_count) != UMB_OK) {
        return false;
    }
    if (marks->nodes != NULL) {
        memcpy(more.nodes, marks->nodes, marks->node_words * sizeof(more.nodes[0]));
        memcpy(more.words, marks->words, marks->word_words * sizeof(more.words[0]));
    }
    umb_bvh_marks_free(marks, a);
    *marks = more;
    return true;
}

void umb_bvh_marks_clear(umb_bvh_marks *marks)
{
    if (marks->nodes != NULL) {
        memset(marks->nodes, 0, umb_bvh_marks_memory(marks));
    }
}

size_t umb_bvh_marks_memory(const umb_bvh_marks *marks)
{
    return (marks->node_words + marks->word_words) * sizeof(marks->nodes[0]);
}

void umb_bvh_marks_free(umb_bvh_marks *marks, const umb_allocator *a)
{
    umb_memory_free(a, marks->nodes, umb_bvh_marks_memory(marks));
    *marks = (umb_bvh_marks){0};
}

static inline uint32_t highest(uint64_t word)
{
    return 63 - (uint32_t)__builtin_clzll(word);
}

static inline uint32_t differ(float a, float b)
{
    uint32_t x, y;
    memcpy(&x, &a, sizeof x);
    memcpy(&y, &b, sizeof y);
    return x ^ y;
}

/* Inline: GCC finds that the function has no effect, and drops calls to it. */
static inline __attribute__((always_inline)) void fetch(const umb_node *nodes, uint32_t number)
{
    const char *p = (const char *)&nodes[number != UMB_NONE ? number : 0];
    for (size_t i = 0; i < sizeof(umb_node); i += 64) {
        __builtin_prefetch(p + i, 1);
    }
}

/* Trees of so many nodes or less are in the caches, where asking ahead costs more than it saves. */
#define IN_CACHES 4096u

static inline bool is_large(const umb_bvh_marks *marks)
{
    return marks->node_words > IN_CACHES / 64 + 1;
}

/* Write a node's box into its slot of the parent; true if that changes it. By bits, so that the result is that of a full refit
 * to the sign of a zero. What stays as it is is not written: in a large tree each line written is one more to bring back. */
static inline bool tell_parent(umb_node *parent, uint32_t slot, const umb_aabb *box, bool always)
{
    uint32_t changed = 0;
    for (int i = 0; i < 3; ++i) {
        changed |= differ(box->min[i], parent->min[i][slot]) | differ(box->max[i], parent->max[i][slot]);
    }
    for (int i = 0; i < 3 && (always || changed != 0); ++i) {
        parent->min[i][slot] = box->min[i];
        parent->max[i][slot] = box->max[i];
    }
    return changed != 0;
}

/* Bring a marked node's box up to its parent, which is marked when that changes it. */
static inline void lift(umb_node *nodes, const umb_bvh_marks *marks, umb_node_volumes *volumes, uint32_t number)
{
    umb_node *node = &nodes[number];
    if (node->count < UMB_NODE_WIDTH) {
        umb_node_pad(node);
    }
    bool refitted = volumes != NULL && umb_node_volumes_fit(volumes, nodes, number);
    if (node->parent == UMB_NONE) {
        return;
    }
    umb_node *parent = &nodes[node->parent];
    umb_aabb box = bounds_of(node);
    if (tell_parent(parent, node->slot, &box, true) || refitted) {
        umb_bvh_mark(marks, node->parent);
        if (is_large(marks)) {
            fetch(nodes, parent->parent); /* its turn is later */
        }
    }
}

/* A node marks none but its parent, whose number is lower: a word that is left is done with. */
void umb_bvh_lift_marked(umb_node *nodes, const umb_bvh_marks *marks, umb_node_volumes *volumes)
{
    for (size_t w = marks->word_words; w-- > 0;) {
        while (marks->words[w] != 0) {
            size_t n = w << 6 | highest(marks->words[w]);
            while (marks->nodes[n] != 0) {
                uint32_t bit = highest(marks->nodes[n]);
                marks->nodes[n] &= ~((uint64_t)1 << bit);
                lift(nodes, marks, volumes, (uint32_t)(n << 6 | bit));
            }
            marks->words[w] &= ~((uint64_t)1 << (n & 63));
        }
    }
}

/* How many moves ahead nodes are asked for: all that is looked at before is in the caches. A power of two. */
#define AHEAD 8u
/* Of more moves than one for so many nodes, many are in the same ones. */
#define SPREAD 4

static inline __attribute__((always_inline)) void fetch_item(const uint32_t *places, const umb_committed *scene, uint32_t i)
{
    if (i < scene->moved_count) {
        __builtin_prefetch(&places[scene->moved[i]]);
        __builtin_prefetch(&scene->objects[scene->moved[i]].bounds);
    }
}

static inline __attribute__((always_inline)) void fetch_place(const umb_node *nodes, const uint32_t *places,
                                                              const umb_committed *scene, uint32_t i)
{
    if (i < scene->moved_count) {
        uint32_t place = places[scene->moved[i]];
        fetch(nodes, place != UMB_NONE ? place / UMB_NODE_WIDTH : 0);
    }
}

/* Give a moved item its box. Returns its node, UMB_NONE: it has none. */
static inline uint32_t set_moved(umb_node *nodes, const uint32_t *places, const umb_committed *scene, uint32_t i)
{
    uint32_t place = places[scene->moved[i]], node = place / UMB_NODE_WIDTH;
    if (place == UMB_NONE) {
        return UMB_NONE;
    }
    const umb_aabb *box = &scene->objects[scene->moved[i]].bounds;
    for (int k = 0; k < 3; ++k) {
        nodes[node].min[k][place % UMB_NODE_WIDTH] = box->min[k];
        nodes[node].max[k][place % UMB_NODE_WIDTH] = box->max[k];
    }
    return node;
}

/* What a parent is to be told of a node. */
typedef struct message {
    umb_aabb box;
    uint32_t parent, slot; /* UMB_NONE: nothing */
} message;

static inline message message_of(umb_node *nodes, uint32_t number)
{
    if (number == UMB_NONE) {
        return (message){.parent = UMB_NONE};
    }
    umb_node *node = &nodes[number];
    if (node->count < UMB_NODE_WIDTH) {
        umb_node_pad(node);
    }
    fetch(nodes, node->parent);
    return (message){.box = bounds_of(node), .parent = node->parent, .slot = node->slot};
}

static inline void deliver(umb_node *nodes, const umb_bvh_marks *marks, const message *m)
{
    if (m->parent != UMB_NONE && tell_parent(&nodes[m->parent], m->slot, &m->box, false)) {
        umb_bvh_mark(marks, m->parent);
        fetch(nodes, nodes[m->parent].parent);
    }
}

/* In a large tree few nodes hold two that moved, and a node looked at again later is one to wait for again: so parents are told
 * at once. A move goes through four stages, each of which asks for what the next one looks at, AHEAD moves later: the item,
 * its node, its box there, the parent. Of two messages from one node the later one, which is right, comes later. */
static void refit_spread(umb_node *nodes, const umb_bvh_marks *marks, const uint32_t *places, const umb_committed *scene)
{
    message told[AHEAD];
    uint32_t count = scene->moved_count;
    for (uint32_t i = 0; i < AHEAD; ++i) {
        told[i].parent = UMB_NONE;
        fetch_item(places, scene, i);
        fetch_item(places, scene, i + AHEAD);
    }
    for (uint32_t i = 0; i < AHEAD; ++i) {
        fetch_place(nodes, places, scene, i);
    }
    for (uint32_t i = 0; i < count; ++i) {
        fetch_item(places, scene, i + 2 * AHEAD);
        fetch_place(nodes, places, scene, i + AHEAD);
        deliver(nodes, marks, &told[i % AHEAD]);
        told[i % AHEAD] = message_of(nodes, set_moved(nodes, places, scene, i));
    }
    for (uint32_t i = count; i < count + AHEAD; ++i) {
        deliver(nodes, marks, &told[i % AHEAD]);
    }
}

static void refit_dense(umb_node *nodes, const umb_bvh_marks *marks, const uint32_t *places, const umb_committed *scene)
{
    bool large = is_large(marks);
    for (uint32_t i = 0; i < scene->moved_count; ++i) {
        if (large) {
            fetch_item(places, scene, i + 2 * AHEAD);
            fetch_place(nodes, places, scene, i + AHEAD);
        }
        uint32_t node = set_moved(nodes, places, scene, i);
        if (node != UMB_NONE) {
            umb_bvh_mark(marks, node);
        }
    }
}

void umb_bvh_refit_moved(umb_node *nodes, umb_bvh_marks *marks, const uint32_t *places,
                         const umb_committed *scene, umb_node_volumes *volumes)
{
    if (is_large(marks) && volumes == NULL && scene->moved_count < marks->node_words * (64 / SPREAD)) {
        refit_spread(nodes, marks, places, scene);
    } else {
        refit_dense(nodes, marks, places, scene);
    }
    umb_bvh_lift_marked(nodes, marks, volumes);
}

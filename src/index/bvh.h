/* Building and refitting a bounding volume hierarchy in the shared tree layout. */
#ifndef UMB_BVH_H
#define UMB_BVH_H

#include "base/memory.h"
#include "tree.h"

/* A box and what it stands for. The fourth lane of min and max is never looked at: it lets four
 * lanes be worked on at once. */
typedef struct umb_bvh_item {
    float min[4];
    float max[4];
    uint32_t ref; /* UMB_REF_OBJECT or UMB_REF_OCCLUDER */
} umb_bvh_item;

/* What a builder makes: nodes, laid out parents first, siblings side by side. The arrays are their new owner's. */
typedef struct umb_built {
    umb_node *nodes;
    umb_order *orders; /* one a node, or NULL */
    umb_tilted_plane *planes;
    uint32_t node_count, slot_count, plane_count; /* slot_count: slots that name items */
} umb_built;

void umb_built_free(umb_built *built, const umb_allocator *a);
size_t umb_built_memory(const umb_built *built);

/* Build over count >= 1 items, whose order it changes. The tree depends on items and their order alone, never on
 * tasks. UMB_ERROR_MEMORY leaves nothing behind. */
umb_result umb_bvh_build(const umb_allocator *a, const umb_tasks *tasks, umb_bvh_item *items,
                         uint32_t count, umb_built *out);

/* Put the committed boxes into the slots again, leaves to root; the structure stays. */
void umb_bvh_refit(umb_node *nodes, uint32_t node_count, const umb_committed *scene);

/* Where each object is: 8 * node + slot; UMB_NONE for those in no node. places has object_count entries. Where objects
 * may be in several slots, next has eight entries a node, and from the first place of an object on leads through the
 * others to UMB_NONE; else it is NULL. */
void umb_bvh_find_places(const umb_node *nodes, uint32_t node_count, uint32_t *places,
                         uint32_t object_count, uint32_t *next);

/* Lay out the objects in the order of a walk, so that those below each node are side by side. objects has room for
 * all of them and UMB_TREE_SPARE more, below node_count entries. Nodes without a parent come one after the other.
 * Returns the number of objects. */
uint32_t umb_bvh_list_objects(const umb_node *nodes, uint32_t node_count, uint32_t *objects, umb_range *below);
/* The same node by node. Count all, children before their parents; then list all, parents before their children: first is
 * where a node without a parent begins. Returns how many objects are below such a node; 0 for others. */
void umb_bvh_count_below(const umb_node *nodes, uint32_t number, umb_range *below);
uint32_t umb_bvh_list_below(const umb_node *nodes, uint32_t number, uint32_t first, uint32_t *objects, umb_range *below);

/* A set of node numbers that gives back its highest first: children before their parents. Empty
 * between refits. */
typedef struct umb_bvh_marks {
    uint64_t *nodes; /* a bit each */
    uint64_t *words; /* a bit for each word of nodes that is not zero */
    size_t node_words, word_words;
} umb_bvh_marks;

umb_result umb_bvh_marks_create(umb_bvh_marks *marks, const umb_allocator *a, uint32_t node_count);
void umb_bvh_marks_free(umb_bvh_marks *marks, const umb_allocator *a);
size_t umb_bvh_marks_memory(const umb_bvh_marks *marks);
/* Room for more nodes; marks are kept. False without memory. */
bool umb_bvh_marks_reserve(umb_bvh_marks *marks, const umb_allocator *a, uint32_t node_count);
void umb_bvh_marks_clear(umb_bvh_marks *marks);
struct umb_node_volumes;

/* Bring the boxes of marked nodes up to their parents, and fit their volumes (NULL: none), as far as they change. */
void umb_bvh_lift_marked(umb_node *nodes, const umb_bvh_marks *marks, struct umb_node_volumes *volumes);

static inline void umb_bvh_mark(const umb_bvh_marks *marks, uint32_t node)
{
    marks->nodes[node >> 6] |= (uint64_t)1 << (node & 63);
    marks->words[node >> 12] |= (uint64_t)1 << (node >> 6 & 63);
}

/* The same as umb_bvh_refit() when only the committed `moved` objects moved: from these up, as far
 * as boxes change, each node once. Costs nothing for nodes that stay as they are. */
void umb_bvh_refit_moved(umb_node *nodes, umb_bvh_marks *marks, const uint32_t *places,
                         const umb_committed *scene, struct umb_node_volumes *volumes);

/* Make the slots from count on as the layout wants them: slot 0's box, no reference. */
void umb_node_pad(umb_node *node);
/* Box around the slots of a padded node. */
umb_aabb umb_node_bounds(const umb_node *node);

/* Split items into a binary tree; bvh_split.c. Node k of the tree splits its items between k - 1
 * and k: every position is used once, so threads need no counter to number their nodes. */
typedef struct umb_bvh_split {
    uint32_t left, right;         /* a split, or an item with UMB_BVH_ITEM set */
    uint8_t pick[UMB_NODE_WIDTH]; /* [j - 1]: how many of j slots go left; 0: as for j - 1 slots, and
                                     for one slot a node of its own, whose slots [7] deals out */
} umb_bvh_split;

#define UMB_BVH_ITEM 0x80000000u

/* splits has count entries ([0] is unused). Returns the root: a split, or item 0 when count is
 * 1. */
umb_result umb_bvh_split_items(const umb_allocator *a, const umb_tasks *tasks, umb_bvh_item *items,
                               uint32_t count, umb_bvh_split *splits, uint32_t *root);
/* The same for a run of items, but without picks. Returns the root. */
uint32_t umb_bvh_split_run(umb_bvh_item *items, uint32_t first, uint32_t end, umb_bvh_split *splits);

struct umb_cell_cut;
struct umb_cell_point;

/* Lay out a binary tree in the wide nodes that its picks say. cuts, points: of each split (cells.h); then orders are made,
 * too. Both may be NULL. */
umb_result umb_bvh_lay_out(const umb_allocator *a, const umb_bvh_item *items, const umb_bvh_split *splits,
                           uint32_t root, const struct umb_cell_cut *cuts, const struct umb_cell_point *points,
                           umb_built *out);

/* The slots of the wide node at the root of a binary subtree that has its picks. Returns how many. */
uint32_t umb_bvh_open(const umb_bvh_split *splits, uint32_t node, uint32_t slots[UMB_NODE_WIDTH]);

/* Split items as umb_bvh_split_items() does, without memory and tasks. Returns the root. */
uint32_t umb_bvh_split_at_once(umb_bvh_item *items, uint32_t count, umb_bvh_split *splits);

/* The same in steps, which may be far apart. */
typedef struct umb_bvh_steps umb_bvh_steps;

umb_bvh_steps *umb_bvh_steps_create(const umb_allocator *a);
void umb_bvh_steps_destroy(umb_bvh_steps *steps, const umb_allocator *a);
size_t umb_bvh_steps_memory(const umb_bvh_steps *steps);
/* Room for what is likely to be wanted for so many items. False without memory. */
bool umb_bvh_steps_reserve(umb_bvh_steps *steps, const umb_allocator *a, uint32_t count);
/* Items, at least one, and splits stay the caller's and where they are. */
void umb_bvh_steps_start(umb_bvh_steps *steps, umb_bvh_item *items, uint32_t count, umb_bvh_split *splits);
/* One step, of at most some thousand items unless their centres are all in one place. Returns what it cost, in about
 * nanoseconds. 0: nothing is left to do; UMB_NONE: there is no memory. */
uint32_t umb_bvh_steps_run(umb_bvh_steps *steps, const umb_allocator *a);
/* When nothing is left to do: the root. */
uint32_t umb_bvh_steps_finish(umb_bvh_steps *steps);

#endif

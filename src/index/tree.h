/* The one tree layout that every hierarchical index shares (DESIGN: one tree, many builders). */
#ifndef UMB_TREE_H
#define UMB_TREE_H

#include "scene/scene.h"
#include "umbrage/index.h"

/* A child reference: the kind in the top two bits, the number below. */
#define UMB_REF_KIND 0xC0000000u
#define UMB_REF_NODE 0x00000000u
#define UMB_REF_OBJECT 0x40000000u
#define UMB_REF_OCCLUDER 0x80000000u /* a stand-alone occluder */
#define UMB_REF_NUMBER 0x3FFFFFFFu

#define UMB_NODE_WIDTH 8

/* Eight children whose boxes are arrays of components: one pass of SIMD covers them all. Objects
 * are children like nodes. Slots from count on are empty: their boxes are those of slot 0, so that
 * kernels may compute with them, and their refs are UMB_NONE. */
typedef struct umb_node {
    float min[3][UMB_NODE_WIDTH];
    float max[3][UMB_NODE_WIDTH];
    uint32_t ref[UMB_NODE_WIDTH];
    uint32_t count;
    uint32_t parent; /* node number, UMB_NONE for the root */
    uint32_t slot;   /* of this node in its parent; 0 for the root */
    uint32_t pad[5];
} umb_node;

/* What lies side by side in the list of a tree's objects. */
typedef struct umb_range {
    uint32_t first, count;
} umb_range;

/* So many entries behind the list of objects may be read, too. */
#define UMB_TREE_SPARE 8

typedef struct umb_tree {
    const umb_node *nodes; /* parents before children; the root is node 0 */
    uint32_t node_count;   /* 0: the index is empty */
    uint32_t item_count;
    bool flat;             /* the nodes are a plain list of rows of eight items, no hierarchy: walk them all */
    /* The objects, so that those below a node lie side by side; and for each node where. Moves change neither. */
    const uint32_t *objects;
    const umb_range *below; /* nodes, then blocks */
    uint32_t object_count; /* in the list: the live ones */
    /* Flat: boxes around each eight rows, in blocks like nodes; boxes around each eight of these, and so on to one.
     * They follow the order of the list, whatever that is. Block k has the number node_count + k, in refs and below. */
    const umb_node *blocks;
    uint32_t block_count; /* the last one holds all */
    umb_aabb bounds;       /* of all items; zero when empty */
    uint64_t version;      /* of the commit it shows. Behind the scene's only after an update that found no
                              memory: answers would then be wrong, so readers refuse (UMB_ERROR_STATE) */
} umb_tree;

/* A node or a block. */
static inline const umb_node *umb_tree_node(const umb_tree *tree, uint32_t number)
{
    return number < tree->node_count ? &tree->nodes[number] : &tree->blocks[number - tree->node_count];
}

const umb_tree *umb_index_tree(const umb_index *index);
umb_scene *umb_index_scene(const umb_index *index);
umb_index_kind umb_index_get_kind(const umb_index *index);

/* Make an index whose nodes hold what an earlier one's did (captures; a refitted tree is not the
 * one that building would give). refs: the slots of each node, UMB_NONE behind the last. Boxes come
 * from the scene. UMB_ERROR_FORMAT unless the nodes are one tree, or rows if flat, that holds each
 * item once. */
umb_result umb_index_restore(umb_scene *scene, const umb_index_def *def,
                             const uint32_t (*refs)[UMB_NODE_WIDTH], uint32_t node_count, umb_index **out);

#endif

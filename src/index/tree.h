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
    uint32_t items;  /* slots that name items, here and below; this and what follows are tree_edit.h's */
    uint32_t edits;  /* items that came or went since it was built */
    float built;     /* half the surface of its box then */
    uint32_t cell;   /* of a grid, that this node is (voxels.h); 0: none */
    uint32_t layers; /* at least those of all items here and below (umb_layers_of()) */
} umb_node;

/* How the slots of a node come front to back from an eye, exactly (walk.h). Only trees whose cells are disjoint have
 * it: what is in a cell lies on one side of each plane, so nothing on the eye's far side of one hides anything on the
 * near side. Slots of one cell come in any order. */
typedef enum umb_order_kind {
    UMB_ORDER_ANY = 0,    /* one cell */
    UMB_ORDER_PLANES = 1, /* up to seven planes, which split the slots' row again and again */
    UMB_ORDER_OCTANTS = 2 /* up to three planes through one point, each through the whole node */
} umb_order_kind;

#define UMB_ORDER_END 0xFFu
#define UMB_ORDER_TILTED 3u /* an axis: the plane is one of umb_tree.planes */

/* PLANES: split s divides a run of slots, split 0 all of them: those before middle[s] are on the plane's lower side, the
 * others on its upper one. next[s] are the splits of these two runs, END: a single cell. The plane is axis[s] = at[s],
 * or plane number number[s].
 * OCTANTS: bit i of axes says that the plane axis i = at[i] splits, bit i of octant[slot] on which side of it a slot is
 * (1: the upper one; 0 where the plane does not split). */
typedef struct umb_order {
    uint8_t kind;
    uint8_t axes;
    union {
        uint8_t octant[UMB_NODE_WIDTH];
        struct {
            uint8_t middle[UMB_NODE_WIDTH - 1];
            uint8_t next[UMB_NODE_WIDTH - 1][2];
            uint8_t axis[UMB_NODE_WIDTH - 1];
        };
    };
    uint8_t pad[2];
    union {
        float at[UMB_NODE_WIDTH - 1];
        uint32_t number[UMB_NODE_WIDTH - 1];
    };
    uint32_t pad_end;
} umb_order;

/* The plane through three points. From its upper side they are seen counter-clockwise. */
typedef struct umb_tilted_plane {
    float points[3][3];
} umb_tilted_plane;

/* A volume around what is below a node: a sphere of radius half[0] around place's origin, or the box from -half to half in
 * place's axes. */
typedef struct umb_node_volume {
    umb_transform place;
    float half[3];
    uint32_t pays; /* it is tighter than the node's box: worth a look */
} umb_node_volume;

/* What lies side by side in the list of a tree's objects. */
typedef struct umb_range {
    uint32_t first, count;
} umb_range;

/* The count of a range that is none: objects below the node have to be looked for. */
#define UMB_RANGE_STALE UINT32_MAX

#define UMB_TOUCHED_ALL UINT32_MAX

/* So many entries behind the list of objects may be read, too. */
#define UMB_TREE_SPARE 8

typedef struct umb_tree {
    /* Parents have lower numbers than their children; the root is node 0. Numbers that are free have nodes without
     * slots, which no other names. */
    const umb_node *nodes;
    uint32_t node_count;   /* of numbers in use or free; 0: the index is empty */
    uint32_t node_room;    /* at least as many, and the same for as long as the index finds room in its memory */
    uint32_t item_count;   /* slots that name items; as many as there are items unless several is set */
    /* An item may be in several slots, each with the box of a part of it; the parts together hold all of it. Walks
     * then answer an object once, and only a whole object has a depth, a size, or lies inside something. An object of
     * such a tree that has moved may be in one slot with its whole box, and still in the lists below other nodes. */
    bool several;
    bool flat;             /* the nodes are a plain list of rows of eight items, no hierarchy: walk them all */
    /* The objects, so that those below a node lie side by side; and for each node where. Moves change neither. */
    const uint32_t *objects;
    const umb_range *below; /* nodes, then blocks */
    uint32_t object_count; /* in the list: the live ones, each as often as it has a slot */
    /* One a node; NULL: the tree knows no strict order (and after moves that could break it). */
    const umb_order *orders;
    const umb_tilted_plane *planes;
    const umb_node_volume *volumes; /* one a node; NULL: boxes are all there is */
    bool spheres;                   /* they are spheres */
    /* Flat: boxes around each eight rows, in blocks like nodes; boxes around each eight of these, and so on to one.
     * They follow the order of the list, whatever that is. Block k has the number node_count + k, in refs and below. */
    const umb_node *blocks;
    uint32_t block_count; /* the last one holds all */
    /* Where walks note the nodes that they open, a bit each; NULL: nobody wants to know (UMB_UPDATE_LAZY). */
    uint64_t *opened;
    /* Nodes whose slots name something else than at the version before, some of them more than once, in no order. Boxes may
     * have changed anywhere. */
    const uint32_t *touched;
    uint32_t touched_count; /* UMB_TOUCHED_ALL: it may be any */
    /* Where items are, the first of their places if there are several, as 8 * node + slot: objects, stand-alone occluders by
     * number. */
    const uint32_t *places, *occluder_places;
    umb_aabb bounds;       /* of all items; zero when empty */
    uint64_t version;      /* of the commit it shows. Behind the scene's only after an update that found no
                              memory: answers would then be wrong, so readers refuse (UMB_ERROR_STATE) */
} umb_tree;

/* A node or a block. */
static inline const umb_node *umb_tree_node(const umb_tree *tree, uint32_t number)
{
    return number < tree->node_count ? &tree->nodes[number] : &tree->blocks[number - tree->node_count];
}

/* A walk opens a node. Any number of walks at once; what they note is the same in any order. */
static inline void umb_tree_note_open(const umb_tree *tree, uint32_t node)
{
    if (tree->opened != NULL) {
        uint64_t bit = (uint64_t)1 << (node & 63), *word = &tree->opened[node >> 6];
        if ((__atomic_load_n(word, __ATOMIC_RELAXED) & bit) == 0) {
            (void)__atomic_fetch_or(word, bit, __ATOMIC_RELAXED);
        }
    }
}

const umb_tree *umb_index_tree(const umb_index *index);
umb_scene *umb_index_scene(const umb_index *index);
/* What it was made with. */
umb_index_def umb_index_settings(const umb_index *index);

/* What a capture holds of a tree: the slots of each node, UMB_NONE behind the last; if items are in several slots the
 * boxes of the parts, as in umb_node (those of nodes are not looked at), else NULL. */
typedef struct umb_stored_tree {
    const uint32_t (*refs)[UMB_NODE_WIDTH];
    const float (*boxes)[6][UMB_NODE_WIDTH];
    uint32_t node_count;
} umb_stored_tree;

/* Make an index whose nodes hold what an earlier one's did (a refitted tree is not the one that building would
 * give). Boxes come from the scene where none are stored. UMB_ERROR_FORMAT unless the nodes are one tree, or rows if
 * flat, that holds each item once, or with boxes at least once. It knows no strict order. */
umb_result umb_index_restore(umb_scene *scene, const umb_index_def *def, const umb_stored_tree *stored,
                             umb_index **out);

#endif

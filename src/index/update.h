/* How a tree follows the scene's change lists: the strategies of Gummerus 3.8, over tree_edit.h. */
#ifndef UMB_UPDATE_H
#define UMB_UPDATE_H

#include "tree_edit.h"
#include "voxels.h"

/* What a strategy remembers from commit to commit. */
typedef struct umb_updater {
    umb_index_update strategy; /* never the default */
    /* Lazy: nodes that hold what was pushed up, and the nodes that walks opened since (bits, umb_tree.opened). */
    umb_number_set raised;
    uint64_t *opened;
    size_t opened_capacity;
    umb_voxels voxels; /* overlapping ones */
} umb_updater;

/* True if the lists of this commit are worth following one by one; else the tree is built anew for less. */
bool umb_update_is_small(const umb_tree_edit *e, const umb_committed *scene, bool structure);

/* Follow the change lists of the commit after the one that the tree shows: moves, and if structure has grown what came
 * and went. Boxes of nodes are exact at the end. False without memory: the tree is not whole then, and must be built
 * anew. */
bool umb_update_follow(umb_updater *u, umb_tree_edit *e, const umb_committed *scene, bool structure);

/* Room to note opened nodes. False without memory. */
bool umb_update_reserve(umb_updater *u, const umb_tree_edit *e);
size_t umb_update_memory(const umb_updater *u);
void umb_update_free(umb_updater *u, const umb_allocator *a);

#endif

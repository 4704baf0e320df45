/* Building a tree anew beside the one in use, a bounded amount of work each commit (incremental rebuild): the items are
 * copied and split, the nodes laid out, fitted and listed in steps; then the new tree takes the old one's place, and what
 * came and went in the meantime is put right. */
#ifndef UMB_REBUILD_JOB_H
#define UMB_REBUILD_JOB_H

#include "ready_tree.h"

typedef enum umb_job_stage {
    UMB_JOB_IDLE,
    UMB_JOB_GATHER,
    UMB_JOB_SPLIT,
    UMB_JOB_LAY_OUT, /* nodes without boxes */
    UMB_JOB_FIT,
    UMB_JOB_LIST,
    UMB_JOB_READY
} umb_job_stage;

/* A node to lay out: its split, number, and place in its parent. */
typedef struct umb_job_node {
    uint32_t split, number, parent, slot;
} umb_job_node;

typedef struct umb_rebuild_job {
    umb_job_stage stage;
    uint32_t cursor, occluder_cursor; /* of what is gathered */
    uint32_t count, stack_count, log_count, root;
    umb_bvh_item *items;
    umb_bvh_split *splits;
    struct umb_bvh_steps *steps;
    umb_ready_tree ready;
    umb_job_node *stack;
    uint32_t *log; /* references of what changed since it was gathered */
    size_t item_capacity, split_capacity, stack_capacity, log_capacity;
    double growth; /* of the tree in use since it was built: a running mean of samples; 1: none */
    uint32_t phase;
} umb_rebuild_job;

void umb_rebuild_job_free(umb_rebuild_job *job, const umb_allocator *a);
size_t umb_rebuild_job_memory(const umb_rebuild_job *job);
/* Forget what has been done; memory is kept. */
void umb_rebuild_job_drop(umb_rebuild_job *job);

/* How much the boxes of the tree in use have grown since it was built: 1 is not at all. After each commit. */
double umb_rebuild_job_watch(umb_rebuild_job *job, const umb_tree_edit *e, const umb_committed *scene, bool structure);

/* After the tree has followed a commit: look whether it has grown worse, begin if it has, and go on with the work.
 * True if a new tree has taken its place: its list of objects is in ready.objects. Without memory, or when too much changes
 * meanwhile, the work is dropped and the tree in use stays. */
bool umb_rebuild_job_step(umb_rebuild_job *job, umb_tree_edit *e, const umb_committed *scene, bool structure);

#endif

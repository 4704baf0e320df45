#include "rebuild_job.h"

#include <math.h>

/* A new tree is begun when boxes have grown by so much, and no earlier. */
#define BEGIN_GROWTH 1.15
/* One node in so many is looked at each commit, others each time; no more than one for so many changes, so that a commit
 * costs what it changes: in a large tree each node looked at is one to wait for. */
#define SAMPLE 16
#define LEAST_SAMPLE 64
#define CHANGES_A_SAMPLE 8
#define SAMPLE_AHEAD 4 /* how many looks ahead a node is asked for */
/* The work is done in about so many commits, but for small trees. */
#define COMMITS 24
#define LEAST_WORK 8192
/* What an item costs in each stage, in items gathered: measured at 100,000 boxes. */
#define GATHER_COST 1
#define LAY_OUT_COST 2
#define TOTAL_COST 24

void umb_rebuild_job_free(umb_rebuild_job *job, const umb_allocator *a)
{
    umb_memory_free(a, job->items, job->item_capacity * sizeof *job->items);
    umb_memory_free(a, job->splits, job->split_capacity * sizeof *job->splits);
    umb_memory_free(a, job->nodes, job->node_capacity * sizeof *job->nodes);
    umb_memory_free(a, job->stack, job->stack_capacity * sizeof *job->stack);
    umb_memory_free(a, job->log, job->log_capacity * sizeof *job->log);
    umb_bvh_steps_destroy(job->steps, a);
    *job = (umb_rebuild_job){0};
}

size_t umb_rebuild_job_memory(const umb_rebuild_job *job)
{
    return job->item_capacity * sizeof *job->items + job->split_capacity * sizeof *job->splits +
           job->node_capacity * sizeof *job->nodes + job->stack_capacity * sizeof *job->stack +
           job->log_capacity * sizeof *job->log;
}

void umb_rebuild_job_drop(umb_rebuild_job *job)
{
    job->stage = UMB_JOB_IDLE;
    job->growth = 1.0;
}

/* ---- how good the tree is ------------------------------------------------------------------- */

/* What a random ray pays for one node in so many, over what it paid when they were built. */
static double sample_growth(const umb_tree_edit *e, uint32_t phase, uint32_t step)
{
    double now = 0.0, then = 0.0;
    for (uint32_t k = phase % step; k < e->node_count; k += step) {
        const umb_node *node = &e->nodes[k];
        uint64_t later = k + (uint64_t)SAMPLE_AHEAD * step;
        for (size_t i = 0; i < sizeof *node && step > SAMPLE && later < e->node_count; i += 64) {
            __builtin_prefetch((const char *)&e->nodes[later] + i);
        }
        if (node->count > 0) {
            now += (double)umb_tree_edit_area(node) * node->count;
            then += (double)node->built * node->count;
        }
    }
    return then > 0.0 ? now / then : 1.0;
}

double umb_rebuild_job_watch(umb_rebuild_job *job, const umb_tree_edit *e, const umb_committed *scene, bool structure)
{
    if (scene->moved_count > 0 || structure) {
        uint64_t changes = (uint64_t)scene->moved_count + (structure ? scene->came_count + scene->went_count : 0);
        uint32_t step = (uint32_t)(e->node_count / (LEAST_SAMPLE + changes / CHANGES_A_SAMPLE)) + 1;
        step = step > SAMPLE ? step : SAMPLE;
        job->phase += 7919; /* a prime: all nodes have their turn */
        double growth = sample_growth(e, job->phase, step);
        /* A smaller sample says as much less. */
        job->growth += isfinite(growth) ? (growth - job->growth) * SAMPLE / (2.0 * step) : 0.0;
    }
    return job->growth;
}

/* ---- stages --------------------------------------------------------------------------------- */

/* All that is likely to be wanted, as soon as anything moves: frames of steady motion are to allocate nothing. */
static bool reserve(umb_rebuild_job *job, umb_tree_edit *e)
{
    const umb_allocator *a = e->allocator;
    size_t count = e->slot_count, nodes = e->node_count - e->free.count;
    /* Trees of the same items differ a little in nodes: room is made for more than is asked for. */
    bool little = job->node_capacity < nodes + nodes / 16 + 32 || e->room < nodes + nodes / 16 + 32;
    nodes += little ? nodes / 8 + 64 : 0;
    job->steps = job->steps != NULL ? job->steps : umb_bvh_steps_create(a);
    return job->steps != NULL && umb_bvh_steps_reserve(job->steps, a, e->slot_count) &&
           umb_tree_edit_reserve(e, nodes) &&
           umb_memory_reserve(a, (void **)&job->items, &job->item_capacity, count, sizeof *job->items) &&
           umb_memory_reserve(a, (void **)&job->splits, &job->split_capacity, count, sizeof *job->splits) &&
           umb_memory_reserve(a, (void **)&job->log, &job->log_capacity, count / 4 + 64, sizeof *job->log) &&
           umb_memory_reserve(a, (void **)&job->nodes, &job->node_capacity, nodes, sizeof *job->nodes) &&
           umb_memory_reserve(a, (void **)&job->stack, &job->stack_capacity, 1024, sizeof *job->stack);
}

static void begin(umb_rebuild_job *job)
{
    job->cursor = job->count = job->log_count = 0;
    job->stage = UMB_JOB_GATHER;
}

static bool add_item(umb_rebuild_job *job, const umb_aabb *box, uint32_t ref)
{
    if (job->count == job->item_capacity) {
        return false;
    }
    umb_bvh_item *item = &job->items[job->count++];
    for (int i = 0; i < 3; ++i) {
        item->min[i] = box->min[i];
        item->max[i] = box->max[i];
    }
    item->min[3] = item->max[3] = 0.0f;
    item->ref = ref;
    return true;
}

/* What is known of a reference: true if the copy has been made of it already. */
static bool is_copied(const umb_rebuild_job *job, uint32_t ref)
{
    return job->stage != UMB_JOB_GATHER ||
           ((ref & UMB_REF_KIND) == UMB_REF_OBJECT && (ref & UMB_REF_NUMBER) < job->cursor);
}

static bool note(umb_rebuild_job *job, uint32_t ref)
{
    if (!is_copied(job, ref)) {
        return true;
    }
    if (job->log_count == job->log_capacity) {
        return false;
    }
    job->log[job->log_count++] = ref;
    return true;
}

static bool note_all(umb_rebuild_job *job, const umb_committed *scene)
{
    bool noted = true;
    for (uint32_t i = 0; i < scene->went_count; ++i) {
        noted = noted && note(job, UMB_REF_OBJECT | scene->went[i]);
    }
    for (uint32_t i = 0; i < scene->came_count; ++i) {
        noted = noted && note(job, UMB_REF_OBJECT | scene->came[i]);
    }
    for (uint32_t i = 0; i < scene->replaced_count; ++i) {
        noted = noted && note(job, UMB_REF_OCCLUDER | scene->replaced[i]);
    }
    return noted;
}

static bool gather(umb_rebuild_job *job, const umb_tree_edit *e, const umb_committed *scene, int64_t *budget)
{
    for (; job->cursor < scene->object_count && *budget > 0; ++job->cursor, *budget -= GATHER_COST) {
        const umb_object *o = &scene->objects[job->cursor];
        if (o->live && !add_item(job, &o->bounds, UMB_REF_OBJECT | job->cursor)) {
            return false;
        }
    }
    if (job->cursor < scene->object_count) {
        return true;
    }
    for (uint32_t i = scene->first_free_occluder; i < scene->occluder_count; ++i) {
        if (!add_item(job, &scene->occluders[i].bounds, UMB_REF_OCCLUDER | i)) {
            return false;
        }
    }
    *budget -= scene->occluder_count - scene->first_free_occluder;
    job->stage = UMB_JOB_SPLIT;
    return job->count > 0 && job->count <= job->split_capacity &&
           umb_bvh_steps_start(job->steps, e->allocator, job->items, job->count, job->splits);
}

static bool split(umb_rebuild_job *job, const umb_tree_edit *e, int64_t *budget)
{
    while (*budget > 0) {
        uint32_t cost = umb_bvh_steps_run(job->steps, e->allocator);
        if (cost == UMB_NONE) {
            return false;
        }
        if (cost == 0) {
            job->root = umb_bvh_steps_finish(job->steps);
            job->node_count = 1;
            job->stack_count = 0;
            job->stage = UMB_JOB_LAY_OUT;
            job->stack[job->stack_count++] = (umb_job_node){job->root, 0, UMB_NONE, 0};
            return true;
        }
        *budget -= cost;
    }
    return true;
}

/* Structure alone: boxes are put in when it is ready. */
static bool lay_out(umb_rebuild_job *job, const umb_tree_edit *e, int64_t *budget)
{
    const umb_allocator *a = e->allocator;
    for (; job->stack_count > 0 && *budget > 0; *budget -= LAY_OUT_COST * UMB_NODE_WIDTH) {
        umb_job_node n = job->stack[--job->stack_count];
        uint32_t slots[UMB_NODE_WIDTH], count = umb_bvh_open(job->splits, n.split, slots);
        if (!umb_memory_reserve(a, (void **)&job->nodes, &job->node_capacity, (size_t)n.number + 1,
                                sizeof *job->nodes) ||
            !umb_memory_reserve(a, (void **)&job->stack, &job->stack_capacity,
                                (size_t)job->stack_count + UMB_NODE_WIDTH, sizeof *job->stack)) {
            return false;
        }
        umb_node *node = &job->nodes[n.number];
        *node = (umb_node){.count = count, .parent = n.parent, .slot = n.slot};
        for (uint32_t i = 0; i < count; ++i) {
            node->ref[i] = (slots[i] & UMB_BVH_ITEM) != 0 ? job->items[slots[i] & ~UMB_BVH_ITEM].ref
                                                          : job->node_count++;
        }
        for (uint32_t i = count; i-- > 0;) {
            if ((slots[i] & UMB_BVH_ITEM) == 0) {
                job->stack[job->stack_count++] = (umb_job_node){slots[i], node->ref[i], n.number, i};
            }
        }
    }
    job->stage = job->stack_count == 0 ? UMB_JOB_READY : job->stage;
    return true;
}

/* ---- the exchange --------------------------------------------------------------------------- */

/* An item whose number changed its meaning since it was copied is taken out, and put in as what it is now. */
static void put_right(umb_tree_edit *e, const umb_committed *scene, uint32_t ref)
{
    uint32_t number = ref & UMB_REF_NUMBER;
    bool object = (ref & UMB_REF_KIND) == UMB_REF_OBJECT, there;
    there = object ? scene->objects[number].live : number >= scene->first_free_occluder && number < scene->occluder_count;
    umb_tree_edit_remove(e, ref, UMB_NONE);
    if (there) {
        const umb_aabb *box = object ? &scene->objects[number].bounds : &scene->occluders[number].bounds;
        umb_tree_edit_insert(e, UMB_WAY_CHEAPEST, 0, UMB_NONE, box, ref);
    }
}

static bool exchange(umb_rebuild_job *job, umb_tree_edit *e, const umb_committed *scene)
{
    umb_node *old = e->nodes;
    size_t old_capacity = e->node_capacity;
    umb_bvh_refit(job->nodes, job->node_count, scene);
    if (!umb_tree_edit_adopt(e, job->nodes, job->node_count, job->node_capacity, false, scene)) {
        return false;
    }
    job->nodes = old;
    job->node_capacity = old_capacity;
    for (uint32_t i = 0; i < job->log_count && !e->failed; ++i) {
        put_right(e, scene, job->log[i]);
    }
    umb_bvh_lift_marked(e->nodes, &e->marks, e->volumes);
    return true;
}

bool umb_rebuild_job_step(umb_rebuild_job *job, umb_tree_edit *e, const umb_committed *scene, bool structure)
{
    bool going = true, exchanged = false;
    if (job->stage == UMB_JOB_IDLE) {
        double growth = umb_rebuild_job_watch(job, e, scene, structure);
        if ((scene->moved_count == 0 && !structure) || e->slot_count <= UMB_NODE_WIDTH || !reserve(job, e) ||
            growth <= BEGIN_GROWTH) {
            return false;
        }
        begin(job);
        structure = false; /* what is copied from now on knows of it */
    }
    int64_t budget = (int64_t)e->slot_count * TOTAL_COST / COMMITS;
    budget = budget > LEAST_WORK ? budget : LEAST_WORK;
    going = !structure || note_all(job, scene);
    if (going && job->stage == UMB_JOB_GATHER) {
        going = gather(job, e, scene, &budget);
    }
    if (going && job->stage == UMB_JOB_SPLIT && budget > 0) {
        going = split(job, e, &budget);
    }
    if (going && job->stage == UMB_JOB_LAY_OUT && budget > 0) {
        going = lay_out(job, e, &budget);
    }
    if (going && job->stage == UMB_JOB_READY && budget > 0) {
        exchanged = exchange(job, e, scene);
        going = false;
    }
    if (!going) {
        umb_rebuild_job_drop(job);
    }
    return exchanged;
}

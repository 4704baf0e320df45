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
/* What is done costs, in about nanoseconds, measured at 100,000 boxes: an item copied, a node laid out, and all of it, for each
 * item. */
#define GATHER_COST 6
#define LAY_OUT_COST 110
#define TOTAL_COST 700
/* So much is done in a commit: a part of all of it for a small tree, a part of a millisecond for a large one, and more where
 * commits bring more changes, which take long anyway and make the tree worse the faster. */
#define COMMITS 24
#define LEAST_WORK 200000
#define MOST_WORK 500000
#define WORK_A_CHANGE 12

void umb_rebuild_job_free(umb_rebuild_job *job, const umb_allocator *a)
{
    umb_memory_free(a, job->items, job->item_capacity * sizeof *job->items);
    umb_memory_free(a, job->splits, job->split_capacity * sizeof *job->splits);
    umb_ready_tree_free(&job->ready, a);
    umb_memory_free(a, job->stack, job->stack_capacity * sizeof *job->stack);
    umb_memory_free(a, job->log, job->log_capacity * sizeof *job->log);
    umb_bvh_steps_destroy(job->steps, a);
    *job = (umb_rebuild_job){0};
}

size_t umb_rebuild_job_memory(const umb_rebuild_job *job)
{
    return job->item_capacity * sizeof *job->items + job->split_capacity * sizeof *job->splits +
           umb_ready_tree_memory(&job->ready) + job->stack_capacity * sizeof *job->stack +
           job->log_capacity * sizeof *job->log + (job->steps != NULL ? umb_bvh_steps_memory(job->steps) : 0);
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
    for (uint32_t k = phase % step; k < e->tree.node_count; k += step) {
        const umb_node *node = &e->tree.nodes[k];
        uint64_t later = k + (uint64_t)SAMPLE_AHEAD * step;
        for (size_t i = 0; i < sizeof *node && step > SAMPLE && later < e->tree.node_count; i += 64) {
            __builtin_prefetch((const char *)&e->tree.nodes[later] + i);
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
        uint32_t step = (uint32_t)(e->tree.node_count / (LEAST_SAMPLE + changes / CHANGES_A_SAMPLE)) + 1;
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
static bool reserve(umb_rebuild_job *job, umb_tree_edit *e, const umb_committed *scene)
{
    const umb_allocator *a = e->allocator;
    size_t count = e->tree.slot_count, nodes = e->tree.node_count - e->free.count;
    /* Trees of the same items differ a little in nodes: room is made for more than is asked for. */
    bool little = job->ready.stock.node_capacity < nodes + nodes / 16 + 32 || e->room < nodes + nodes / 16 + 32;
    nodes += little ? nodes / 8 + 64 : 0;
    job->steps = job->steps != NULL ? job->steps : umb_bvh_steps_create(a);
    return job->steps != NULL && umb_bvh_steps_reserve(job->steps, a, e->tree.slot_count) &&
           umb_tree_edit_reserve(e, nodes) &&
           umb_memory_reserve(a, (void **)&job->items, &job->item_capacity, count, sizeof *job->items) &&
           umb_memory_reserve(a, (void **)&job->splits, &job->split_capacity, count, sizeof *job->splits) &&
           umb_memory_reserve(a, (void **)&job->log, &job->log_capacity, count / 4 + 64, sizeof *job->log) &&
           umb_ready_tree_reserve(&job->ready, a, nodes, count, scene) &&
           umb_memory_reserve(a, (void **)&job->stack, &job->stack_capacity, 1024, sizeof *job->stack);
}

static void begin(umb_rebuild_job *job)
{
    job->cursor = job->occluder_cursor = job->count = job->log_count = job->ready.occluder_limit = 0;
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
    uint32_t cursor = (ref & UMB_REF_KIND) == UMB_REF_OBJECT ? job->cursor : job->occluder_cursor;
    return job->stage != UMB_JOB_GATHER || (ref & UMB_REF_NUMBER) < cursor;
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

static bool gather(umb_rebuild_job *job, const umb_committed *scene, int64_t *budget)
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
    uint32_t *at = &job->occluder_cursor;
    for (*at = *at > scene->first_free_occluder ? *at : scene->first_free_occluder; *at < scene->occluder_count && *budget > 0;
         ++*at, *budget -= GATHER_COST) {
        if (!add_item(job, &scene->occluders[*at].bounds, UMB_REF_OCCLUDER | *at)) {
            return false;
        }
    }
    job->ready.occluder_limit = job->ready.occluder_limit > *at ? job->ready.occluder_limit : *at;
    if (*at < scene->occluder_count) {
        return true;
    }
    job->stage = UMB_JOB_SPLIT;
    bool usable = job->count > 0 && job->count <= job->split_capacity;
    if (usable) {
        umb_bvh_steps_start(job->steps, job->items, job->count, job->splits);
    }
    return usable;
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
            job->ready.stock.node_count = 1;
            job->ready.stock.slot_count = 0;
            job->stack_count = 0;
            job->stage = UMB_JOB_LAY_OUT;
            job->stack[job->stack_count++] = (umb_job_node){job->root, 0, UMB_NONE, 0};
            return true;
        }
        *budget -= cost;
    }
    return true;
}

/* Structure alone: boxes are put in later. */
static bool lay_out(umb_rebuild_job *job, const umb_tree_edit *e, const umb_committed *scene, int64_t *budget)
{
    const umb_allocator *a = e->allocator;
    umb_tree_stock *made = &job->ready.stock;
    for (; job->stack_count > 0 && *budget > 0; *budget -= LAY_OUT_COST) {
        umb_job_node n = job->stack[--job->stack_count];
        uint32_t slots[UMB_NODE_WIDTH], count = umb_bvh_open(job->splits, n.split, slots);
        if (!umb_memory_reserve(a, (void **)&made->nodes, &made->node_capacity, (size_t)n.number + 1, sizeof *made->nodes) ||
            !umb_memory_reserve(a, (void **)&job->stack, &job->stack_capacity,
                                (size_t)job->stack_count + UMB_NODE_WIDTH, sizeof *job->stack)) {
            return false;
        }
        umb_node *node = &made->nodes[n.number];
        *node = (umb_node){.count = count, .parent = n.parent, .slot = n.slot};
        for (uint32_t i = 0; i < count; ++i) {
            bool item = (slots[i] & UMB_BVH_ITEM) != 0;
            node->ref[i] = item ? job->items[slots[i] & ~UMB_BVH_ITEM].ref : made->node_count++;
            made->slot_count += item;
        }
        for (uint32_t i = count; i-- > 0;) {
            if ((slots[i] & UMB_BVH_ITEM) == 0) {
                job->stack[job->stack_count++] = (umb_job_node){slots[i], node->ref[i], n.number, i};
            }
        }
    }
    if (job->stack_count > 0) {
        return true;
    }
    job->stage = UMB_JOB_FIT;
    return umb_ready_tree_begin(&job->ready, a, scene);
}

/* ---- the exchange --------------------------------------------------------------------------- */

/* An item whose number changed its meaning since it was copied is taken out, and put in as what it is now. */
static void put_right(umb_tree_edit *e, const umb_committed *scene, uint32_t ref)
{
    uint32_t number = ref & UMB_REF_NUMBER;
    bool object = (ref & UMB_REF_KIND) == UMB_REF_OBJECT, there;
    there = object ? scene->objects[number].live : number >= scene->first_free_occluder && number < scene->occluder_count;
    if (number < (object ? e->tree.place_capacity : e->tree.occluder_capacity)) {
        umb_tree_edit_remove(e, ref, UMB_NONE);
    }
    if (there) {
        const umb_aabb *box = object ? &scene->objects[number].bounds : &scene->occluders[number].bounds;
        umb_tree_edit_insert(e, UMB_WAY_CHEAPEST, 0, UMB_NONE, box, ref);
    }
}

static bool exchange(umb_rebuild_job *job, umb_tree_edit *e, const umb_committed *scene)
{
    bool done = umb_ready_tree_exchange(&job->ready, e, scene);
    for (uint32_t i = 0; i < job->log_count && !e->failed; ++i) {
        put_right(e, scene, job->log[i]);
    }
    umb_bvh_lift_marked(e->tree.nodes, &e->tree.marks, e->volumes);
    return done;
}

/* ---- slices --------------------------------------------------------------------------------- */

static int64_t budget_of(const umb_tree_edit *e, const umb_committed *scene, bool structure)
{
    int64_t changes = (int64_t)scene->moved_count + (structure ? scene->came_count + scene->went_count : 0);
    int64_t part = (int64_t)e->tree.slot_count * TOTAL_COST / COMMITS, most = MOST_WORK + WORK_A_CHANGE * changes;
    part = part < most ? part : most;
    return part > LEAST_WORK ? part : LEAST_WORK;
}

/* Go on with the work, through as many stages as there is time for. False if it has to be given up. */
static bool work(umb_rebuild_job *job, const umb_tree_edit *e, const umb_committed *scene, int64_t budget)
{
    bool going = true;
    if (job->stage >= UMB_JOB_FIT) {
        umb_ready_tree_follow(&job->ready, scene);
    }
    if (job->stage == UMB_JOB_GATHER) {
        going = gather(job, scene, &budget);
    }
    if (going && job->stage == UMB_JOB_SPLIT) {
        going = split(job, e, &budget);
    }
    if (going && job->stage == UMB_JOB_LAY_OUT) {
        going = lay_out(job, e, scene, &budget);
    }
    if (going && job->stage == UMB_JOB_FIT && umb_ready_tree_fit(&job->ready, scene, &budget)) {
        job->stage = UMB_JOB_LIST;
    }
    if (going && job->stage == UMB_JOB_LIST && umb_ready_tree_list(&job->ready, &budget)) {
        job->stage = UMB_JOB_READY;
    }
    return going;
}

bool umb_rebuild_job_step(umb_rebuild_job *job, umb_tree_edit *e, const umb_committed *scene, bool structure)
{
    bool exchanged = false;
    if (job->stage == UMB_JOB_IDLE) {
        double growth = umb_rebuild_job_watch(job, e, scene, structure);
        if ((scene->moved_count == 0 && !structure) || e->tree.slot_count <= UMB_NODE_WIDTH || !reserve(job, e, scene) ||
            growth <= BEGIN_GROWTH) {
            return false;
        }
        begin(job);
        structure = false; /* what is copied from now on knows of it */
    }
    bool going = (!structure || note_all(job, scene)) && work(job, e, scene, budget_of(e, scene, structure));
    if (going && job->stage == UMB_JOB_READY) {
        exchanged = exchange(job, e, scene);
        going = false;
    }
    if (!going) {
        umb_rebuild_job_drop(job);
    }
    return exchanged;
}

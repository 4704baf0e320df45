/* Indices: creation by kind, and following the scene from commit to commit. */
#include <math.h>
#include <string.h>

#include "bottom_up.h"
#include "bsp.h"
#include "cut.h"
#include "grid.h"
#include "index_name.h"
#include "kdtree.h"
#include "octree.h"
#include "rebuild_job.h"
#include "update.h"

struct umb_index {
    umb_tree tree;
    umb_tree_edit edit;    /* what tree.nodes and below point at */
    umb_node_volumes volumes; /* and tree.volumes, which edit keeps if they are wanted */
    umb_updater updater;
    umb_rebuild_job job;
    umb_order *orders;     /* of the tree as built */
    umb_tilted_plane *planes;
    uint32_t order_count, plane_count;
    uint32_t *objects;     /* what tree.objects and blocks point at */
    umb_node *blocks;
    size_t object_capacity, block_capacity;
    umb_scene *scene;
    umb_scene_listener listener;
    umb_allocator allocator;
    umb_index_def def;
    uint64_t structure;    /* of the scene that it shows */
    uint32_t live_count;   /* objects in it, each once */
    uint32_t item_count;   /* and occluders */
    bool builds_beside;    /* incremental rebuilds are done by the job; else at once */
};

/* ---- items ---------------------------------------------------------------------------------- */

static uint32_t count_items(const umb_committed *c)
{
    uint32_t count = c->occluder_count - c->first_free_occluder;
    for (uint32_t i = 0; i < c->object_count; ++i) {
        count += c->objects[i].live ? 1u : 0u;
    }
    return count;
}

static void set_item(umb_bvh_item *item, const umb_aabb *box, uint32_t ref)
{
    for (int i = 0; i < 3; ++i) {
        item->min[i] = box->min[i];
        item->max[i] = box->max[i];
    }
    item->min[3] = 0.0f;
    item->max[3] = 0.0f;
    item->ref = ref;
}

/* Live objects by id, then stand-alone occluders. */
static void gather_items(const umb_committed *c, umb_bvh_item *items)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < c->object_count; ++i) {
        if (c->objects[i].live) {
            set_item(&items[n++], &c->objects[i].bounds, UMB_REF_OBJECT | i);
        }
    }
    for (uint32_t i = c->first_free_occluder; i < c->occluder_count; ++i) {
        set_item(&items[n++], &c->occluders[i].bounds, UMB_REF_OCCLUDER | i);
    }
}

/* Rows of eight items in the order given; no hierarchy. */
static umb_result build_flat(const umb_allocator *a, const umb_bvh_item *items, uint32_t count, umb_built *out)
{
    uint32_t rows = count / UMB_NODE_WIDTH + (count % UMB_NODE_WIDTH != 0);
    umb_node *list = umb_memory_allocate_zero(a, rows, sizeof(umb_node));
    if (list == NULL) {
        return UMB_ERROR_MEMORY;
    }
    for (uint32_t k = 0; k < count; ++k) {
        umb_node *node = &list[k / UMB_NODE_WIDTH];
        uint32_t slot = node->count++;
        for (int i = 0; i < 3; ++i) {
            node->min[i][slot] = items[k].min[i];
            node->max[i][slot] = items[k].max[i];
        }
        node->ref[slot] = items[k].ref;
    }
    for (uint32_t k = 0; k < rows; ++k) {
        list[k].parent = UMB_NONE;
        umb_node_pad(&list[k]);
    }
    *out = (umb_built){.nodes = list, .node_count = rows, .slot_count = count};
    return UMB_OK;
}

static umb_result build(const umb_index *index, const umb_committed *scene, umb_bvh_item *items, uint32_t count, umb_built *out)
{
    const umb_allocator *a = &index->allocator;
    switch (index->def.kind) {
    case UMB_INDEX_FLAT:
        return build_flat(a, items, count, out);
    case UMB_INDEX_KDTREE:
        return umb_kdtree_build(a, index->def.rule, items, count, out);
    case UMB_INDEX_OCTREE:
        return umb_octree_build(a, index->def.rule, 7, items, count, out);
    case UMB_INDEX_QUADTREE:
        return umb_octree_build(a, index->def.rule, umb_octree_flat_axes(items, count), items, count, out);
    case UMB_INDEX_BSP:
        return umb_bsp_build(a, &index->def, scene, items, count, out);
    case UMB_INDEX_GRID:
        return umb_grid_build(a, index->def.rule, items, count, out);
    default:
        if (index->def.rule == UMB_RULE_BOTTOM_UP) {
            return umb_bottom_up_build(a, index->tree.spheres, items, count, out);
        }
        return umb_bvh_build(a, &index->def.tasks, items, count, out);
    }
}

/* ---- following the scene -------------------------------------------------------------------- */

static uint32_t eighth(uint32_t count)
{
    return count / UMB_NODE_WIDTH + (count % UMB_NODE_WIDTH != 0);
}

/* Rows in blocks of eight, these in blocks of eight, up to one. */
static uint32_t count_blocks(uint32_t rows)
{
    uint32_t total = 0;
    for (uint32_t level = rows; level > 1 || (level == 1 && total == 0);) {
        level = eighth(level);
        total += level;
    }
    return total;
}

/* What the blocks of a flat index refer to, and the objects below them. Levels follow each other, so what is below
 * the next block comes next, but for the end of a level. */
static void lay_blocks(umb_node *blocks, umb_range *below, uint32_t rows)
{
    uint32_t from = 0, level = rows, number = rows; /* a level's first number and count; the next block's number */
    while (level > 1 || (level == 1 && from == 0)) {
        uint32_t end = from + level;
        for (uint32_t at = from; at < end; ++number) {
            umb_node *block = &blocks[number - rows];
            block->parent = UMB_NONE;
            below[number] = (umb_range){below[at].first, 0};
            for (; block->count < UMB_NODE_WIDTH && at < end; ++at) {
                below[number].count += below[at].count;
                block->ref[block->count++] = UMB_REF_NODE | at;
            }
        }
        from = end;
        level = eighth(level);
    }
}

/* The boxes of the blocks, from those of the rows. */
static void fill_blocks(umb_index *index)
{
    for (uint32_t k = 0; k < index->tree.block_count; ++k) {
        umb_node *block = &index->blocks[k];
        block->layers = 0;
        for (uint32_t slot = 0; slot < block->count; ++slot) {
            const umb_node *child = umb_tree_node(&index->tree, block->ref[slot] & UMB_REF_NUMBER);
            umb_aabb b = umb_node_bounds(child);
            block->layers |= child->layers;
            for (int i = 0; i < 3; ++i) {
                block->min[i][slot] = b.min[i];
                block->max[i][slot] = b.max[i];
            }
        }
        umb_node_pad(block);
    }
}

/* The box of all items is that of the root, or of a flat index's last block. */
static umb_aabb bounds_of(const umb_tree *tree)
{
    if (tree->node_count == 0) {
        return (umb_aabb){{0, 0, 0}, {0, 0, 0}};
    }
    return umb_node_bounds(tree->flat ? &tree->blocks[tree->block_count - 1] : &tree->nodes[0]);
}

/* Where readers find the arrays, which may have moved. */
static void show(umb_index *index)
{
    umb_tree *tree = &index->tree;
    tree->nodes = index->edit.tree.nodes;
    tree->node_count = index->edit.tree.node_count;
    tree->node_room = (uint32_t)index->edit.room;
    tree->item_count = index->edit.tree.slot_count;
    tree->below = index->edit.tree.below;
    tree->objects = index->objects;
    tree->blocks = index->blocks;
    tree->volumes = index->volumes.list;
    tree->opened = index->updater.opened;
    tree->touched = index->edit.touched;
    tree->touched_count = index->edit.touched_count;
    tree->places = index->edit.tree.places;
    tree->occluder_places = index->edit.tree.occluder_places;
}

/* What readers see, from the nodes. */
static void settle(umb_index *index)
{
    const umb_committed *c = umb_scene_committed(index->scene);
    umb_tree *tree = &index->tree;
    show(index);
    index->structure = c->structure;
    index->item_count = index->live_count + (c->occluder_count - c->first_free_occluder);
    fill_blocks(index);
    tree->bounds = bounds_of(tree);
    tree->version = c->version;
}

static void drop(umb_index *index)
{
    const umb_allocator *a = &index->allocator;
    umb_rebuild_job_free(&index->job, a);
    umb_update_free(&index->updater, a);
    umb_tree_edit_free(&index->edit);
    umb_node_volumes_free(&index->volumes, a);
    umb_memory_free(a, index->orders, index->order_count * sizeof(umb_order));
    umb_memory_free(a, index->planes, index->plane_count * sizeof(umb_tilted_plane));
    umb_memory_free(a, index->objects, index->object_capacity * sizeof(uint32_t));
    umb_memory_free(a, index->blocks, index->block_capacity * sizeof(umb_node));
}

/* The lists of what is below each node. There is room: there are never fewer slots for it than there were. */
static void list_objects(umb_index *index)
{
    umb_tree_edit *e = &index->edit;
    index->tree.object_count = umb_bvh_list_objects(e->tree.nodes, e->tree.node_count, index->objects, e->tree.below);
    e->stale = 0;
}

/* A tree made beside the one in use brings its list. */
static void take_list(umb_index *index)
{
    umb_ready_tree *t = &index->job.ready;
    uint32_t *objects = index->objects;
    size_t capacity = index->object_capacity;
    index->objects = t->objects;
    index->object_capacity = t->object_capacity;
    index->tree.object_count = t->object_count;
    t->objects = objects;
    t->object_capacity = capacity;
}

/* Room beside the nodes for a tree with so many slots and blocks. */
static bool furnish(umb_index *index, uint32_t node_count, uint32_t slot_count, uint32_t block_count)
{
    const umb_allocator *a = &index->allocator;
    umb_tree_edit *e = &index->edit;
    return umb_memory_reserve(a, (void **)&index->objects, &index->object_capacity,
                              (size_t)slot_count + UMB_TREE_SPARE, sizeof(uint32_t)) &&
           umb_memory_reserve(a, (void **)&index->blocks, &index->block_capacity, block_count, sizeof(umb_node)) &&
           umb_memory_reserve(a, (void **)&e->tree.below, &e->tree.below_capacity, (size_t)node_count + block_count,
                              sizeof(umb_range));
}

/* Take over what was built over the scene's items, or free it when there is no memory to follow them. */
static umb_result adopt(umb_index *index, const umb_committed *c, umb_built *built, uint32_t item_count)
{
    const umb_allocator *a = &index->allocator;
    umb_tree *tree = &index->tree;
    umb_tree_edit *e = &index->edit;
    umb_node *old = e->tree.nodes;
    size_t old_bytes = e->tree.node_capacity * sizeof(umb_node);
    bool several = built->slot_count > item_count;
    uint32_t blocks = tree->flat ? count_blocks(built->node_count) : 0;
    if (!furnish(index, built->node_count, built->slot_count, blocks) ||
        !umb_tree_edit_adopt(e, built->nodes, built->node_count, built->node_count, several, c)) {
        umb_built_free(built, a);
        return UMB_ERROR_MEMORY;
    }
    umb_memory_free(a, old, old_bytes);
    umb_memory_free(a, index->orders, index->order_count * sizeof(umb_order));
    umb_memory_free(a, index->planes, index->plane_count * sizeof(umb_tilted_plane));
    tree->orders = index->orders = built->orders;
    tree->planes = index->planes = built->planes;
    index->order_count = built->orders != NULL ? built->node_count : 0;
    index->plane_count = built->plane_count;
    index->live_count = item_count - (c->occluder_count - c->first_free_occluder);
    tree->several = several;
    tree->block_count = blocks;
    list_objects(index);
    if (blocks > 0) {
        memset(index->blocks, 0, blocks * sizeof(umb_node));
        lay_blocks(index->blocks, e->tree.below, built->node_count);
    }
    umb_rebuild_job_drop(&index->job);
    if (!umb_update_reserve(&index->updater, e)) {
        e->failed = true;
        return UMB_ERROR_MEMORY;
    }
    return UMB_OK;
}

/* The grid of overlapping voxels is filled item by item. */
static umb_result fill_voxels(umb_index *index, const umb_committed *c, uint32_t count)
{
    const umb_allocator *a = &index->allocator;
    umb_built nothing = {.slot_count = 0};
    umb_tree_edit *e = &index->edit;
    umb_bvh_item *items = umb_memory_allocate(a, count * sizeof(items[0]));
    umb_result result = items != NULL || count == 0 ? adopt(index, c, &nothing, 0) : UMB_ERROR_MEMORY;
    if (result == UMB_OK && count > 0) {
        gather_items(c, items);
        index->updater.voxels = umb_voxels_choose(items, count);
        umb_voxels_build(&index->updater.voxels, e, items, count);
        umb_bvh_lift_marked(e->tree.nodes, &e->tree.marks, e->volumes);
        umb_tree_edit_learn(e);
        index->live_count = count - (c->occluder_count - c->first_free_occluder);
        if (e->failed || !furnish(index, e->tree.node_count, e->tree.slot_count, 0)) {
            e->failed = true;
            result = UMB_ERROR_MEMORY;
        } else {
            list_objects(index);
        }
    }
    umb_memory_free(a, items, count * sizeof(items[0]));
    return result;
}

static umb_result rebuild(umb_index *index, const umb_committed *c)
{
    if (c->object_count > UMB_REF_NUMBER || c->occluder_count > UMB_REF_NUMBER ||
        (uint64_t)c->object_count + c->occluder_count > UMB_REF_NUMBER) {
        return umb_scene_fail(index->scene, UMB_ERROR_LIMIT, "more than 2^30 objects and occluders");
    }
    uint32_t count = count_items(c);
    umb_built built = {0};
    umb_result result = UMB_OK;
    if (index->updater.strategy == UMB_UPDATE_OVERLAPPING) {
        result = fill_voxels(index, c, count);
        return result == UMB_OK ? result
                                : umb_scene_fail(index->scene, result, "no memory to index %u items", count);
    }
    if (count > 0) {
        const umb_allocator *a = &index->allocator;
        umb_bvh_item *items = umb_memory_allocate(a, count * sizeof(items[0]));
        result = UMB_ERROR_MEMORY;
        if (items != NULL) {
            gather_items(c, items);
            result = build(index, c, items, count, &built);
        }
        umb_memory_free(a, items, count * sizeof(items[0]));
    }
    if (result == UMB_OK) {
        result = adopt(index, c, &built, count);
    }
    if (result != UMB_OK) {
        return umb_scene_fail(index->scene, result, "no memory to index %u items", count);
    }
    return UMB_OK;
}

/* True if the change lists tell all that happened since what the tree shows, and following them costs less than
 * building. */
static bool can_follow(const umb_index *index, const umb_committed *c)
{
    bool grew = index->structure != c->structure;
    return !index->edit.failed && index->tree.version + 1 == c->version &&
           (!grew || (index->structure + 1 == c->structure && !index->tree.flat)) &&
           umb_update_is_small(&index->edit, c, grew);
}

/* A tree that has grown much worse than it was as built, and that nothing makes better meanwhile. */
static bool is_worn_out(umb_index *index, const umb_committed *c, bool grew)
{
    return index->updater.strategy == UMB_UPDATE_INCREMENTAL && !index->tree.flat && !index->builds_beside &&
           umb_rebuild_job_watch(&index->job, &index->edit, c, grew) > 2.0;
}

/* True if the tree has followed the scene. */
static bool follow(umb_index *index, const umb_committed *c)
{
    umb_tree_edit *e = &index->edit;
    bool grew = index->structure != c->structure;
    if (c->moved_count > 0 || grew) {
        index->tree.orders = NULL; /* what moved may be in other cells now */
    }
    e->touched_count = 0;
    if (!umb_update_follow(&index->updater, e, c, grew)) {
        e->failed = true;
        return false;
    }
    if (grew) {
        index->live_count += c->came_count - c->went_count;
    }
    bool exchanged = index->builds_beside && umb_rebuild_job_step(&index->job, e, c, grew);
    if (e->failed || is_worn_out(index, c, grew)) {
        return false;
    }
    if (exchanged) {
        take_list(index);
    }
    /* Lists made anew for every so many edits cost each of them the same. */
    if (e->stale > e->tree.slot_count / 4 + 64 && furnish(index, e->tree.node_count, e->tree.slot_count, 0)) {
        list_objects(index);
    } else if (e->stale > 0) {
        index->tree.object_count = e->tree.slot_count;
    }
    return true;
}

static umb_result update(void *user)
{
    umb_index *index = user;
    const umb_committed *c = umb_scene_committed(index->scene);
    if (index->tree.version == c->version) {
        return UMB_OK;
    }
    if (!can_follow(index, c) || !follow(index, c)) {
        umb_result result = rebuild(index, c);
        if (result != UMB_OK) {
            index->edit.failed = true; /* half of the changes may be in it */
            show(index);
            return result;
        }
    }
    settle(index);
    return UMB_OK;
}

/* ---- restoring ------------------------------------------------------------------------------ */

/* What is known of stored nodes while they are read. */
typedef struct restorer {
    const umb_committed *scene;
    const umb_stored_tree *stored;
    umb_node *nodes;
    uint8_t *seen; /* nodes, then objects, then occluders: named by some slot before */
    uint32_t item_count, slot_count;
    bool flat;
} restorer;

/* The place of a slot's item or node in the list of what has been seen; UMB_NONE when it cannot be.
 * A node comes after the one that names it, so that no walk can run in circles. */
static uint32_t place_of(const restorer *r, uint32_t node, uint32_t ref)
{
    uint32_t number = ref & UMB_REF_NUMBER, node_count = r->stored->node_count;
    switch (ref & UMB_REF_KIND) {
    case UMB_REF_NODE:
        return !r->flat && number > node && number < node_count ? number : UMB_NONE;
    case UMB_REF_OBJECT:
        return number < r->scene->object_count && r->scene->objects[number].live ? node_count + number : UMB_NONE;
    case UMB_REF_OCCLUDER:
        return number >= r->scene->first_free_occluder && number < r->scene->occluder_count
                   ? node_count + r->scene->object_count + number
                   : UMB_NONE;
    default:
        return UMB_NONE;
    }
}

/* The stored box of a part, if it is one. */
static bool restore_box(const restorer *r, uint32_t k, uint32_t slot)
{
    umb_node *node = &r->nodes[k];
    for (int i = 0; i < 3; ++i) {
        float low = r->stored->boxes[k][i][slot], high = r->stored->boxes[k][3 + i][slot];
        if (!isfinite(low) || !isfinite(high) || low > high) {
            return false;
        }
        node->min[i][slot] = low;
        node->max[i][slot] = high;
    }
    return true;
}

static bool restore_node(restorer *r, uint32_t k, const uint32_t refs[UMB_NODE_WIDTH])
{
    umb_node *node = &r->nodes[k];
    bool parts = r->stored->boxes != NULL;
    while (node->count < UMB_NODE_WIDTH && refs[node->count] != UMB_NONE) {
        uint32_t ref = refs[node->count], place = place_of(r, k, ref);
        bool is_node = (ref & UMB_REF_KIND) == UMB_REF_NODE;
        if (place == UMB_NONE || (r->seen[place] && (is_node || !parts))) {
            return false;
        }
        if (is_node) {
            r->nodes[ref].parent = k;
            r->nodes[ref].slot = node->count;
        } else {
            r->item_count += !r->seen[place];
            r->slot_count += 1;
            if (parts && !restore_box(r, k, node->count)) {
                return false;
            }
        }
        r->seen[place] = 1;
        node->ref[node->count++] = ref;
    }
    for (uint32_t i = node->count; i < UMB_NODE_WIDTH; ++i) {
        if (refs[i] != UMB_NONE) {
            return false;
        }
    }
    bool named = r->flat || k == 0 || r->seen[k];
    return node->count > 0 ? named : !named || (r->flat && k == 0); /* without slots: a number that is free */
}

/* Boxes of nodes from those of parts. */
static void fit_nodes(const restorer *r)
{
    for (uint32_t k = r->stored->node_count; k-- > 0;) {
        umb_node *node = &r->nodes[k];
        umb_node_pad(node);
        if (node->parent != UMB_NONE) {
            umb_aabb box = umb_node_bounds(node);
            umb_node *parent = &r->nodes[node->parent];
            for (int i = 0; i < 3; ++i) {
                parent->min[i][node->slot] = box.min[i];
                parent->max[i][node->slot] = box.max[i];
            }
        }
    }
}

static umb_result restore_nodes(umb_index *index, const umb_stored_tree *stored)
{
    const umb_allocator *a = &index->allocator;
    const umb_committed *c = umb_scene_committed(index->scene);
    restorer r = {.scene = c, .stored = stored, .flat = index->tree.flat};
    size_t places = (size_t)stored->node_count + c->object_count + c->occluder_count;
    r.nodes = umb_memory_allocate_zero(a, stored->node_count, sizeof(umb_node));
    r.seen = umb_memory_allocate_zero(a, places, 1);
    umb_result result = r.nodes != NULL && r.seen != NULL ? UMB_OK : UMB_ERROR_MEMORY;
    for (uint32_t k = 0; k < stored->node_count && result == UMB_OK; ++k) {
        r.nodes[k].parent = UMB_NONE;
    }
    for (uint32_t k = 0; k < stored->node_count && result == UMB_OK; ++k) {
        result = restore_node(&r, k, stored->refs[k]) ? UMB_OK : UMB_ERROR_FORMAT;
    }
    if (result == UMB_OK && r.item_count != count_items(c)) {
        result = UMB_ERROR_FORMAT;
    }
    umb_memory_free(a, r.seen, places);
    umb_built built = {.nodes = r.nodes, .node_count = stored->node_count, .slot_count = r.slot_count};
    if (result != UMB_OK) {
        umb_built_free(&built, a);
        return umb_scene_fail(index->scene, result, "stored nodes make no index");
    }
    if (stored->boxes != NULL) {
        fit_nodes(&r);
    } else {
        umb_bvh_refit(r.nodes, stored->node_count, c);
    }
    result = adopt(index, c, &built, r.item_count);
    if (result != UMB_OK) {
        return umb_scene_fail(index->scene, result, "no memory to index %u items", r.item_count);
    }
    return UMB_OK;
}

/* ---- public --------------------------------------------------------------------------------- */

/* An index that holds nothing yet and follows nothing. */
static umb_result make_empty(umb_scene *scene, const umb_index_def *def, umb_index **out)
{
    *out = NULL;
    if (!umb_index_name_known(def)) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT,
                              "no index of kind %s has rule %d with options %u; umb_index_parse() makes those that there are",
                              umb_index_kind_name(def->kind), (int)def->rule, def->options);
    }
    if (!umb_index_can_update(def)) {
        const char *way = umb_index_update_name(def->update);
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "an index %s has no way %d (%s) to follow its scene", umb_index_name(def),
                              (int)def->update, way != NULL ? way : "unknown");
    }
    const umb_allocator *a = umb_scene_allocator(scene);
    umb_index *index = umb_memory_allocate_zero(a, 1, sizeof(*index));
    if (index == NULL) {
        return umb_scene_fail(scene, UMB_ERROR_MEMORY, "no memory for an index");
    }
    index->scene = scene;
    index->allocator = *a;
    index->def = *def;
    index->tree.flat = def->kind == UMB_INDEX_FLAT;
    index->tree.spheres = index->volumes.spheres = (def->options & UMB_INDEX_SPHERES) != 0;
    index->edit.allocator = &index->allocator;
    index->edit.volumes = index->tree.spheres || (def->options & UMB_INDEX_ORIENTED) != 0 ? &index->volumes : NULL;
    bool boxes = def->kind == UMB_INDEX_BVH && def->rule == UMB_RULE_DEFAULT;
    umb_index_update usual = boxes ? UMB_UPDATE_INCREMENTAL : UMB_UPDATE_REFIT;
    index->updater.strategy = def->update != UMB_UPDATE_DEFAULT ? def->update : usual;
    index->builds_beside = index->updater.strategy == UMB_UPDATE_INCREMENTAL && boxes;
    *out = index;
    return UMB_OK;
}

/* Its nodes are there: follow the scene from now on. Takes the index, and frees it after a
 * failure. */
static umb_result start_following(umb_index *index, umb_result result, umb_index **out)
{
    if (result != UMB_OK) {
        umb_allocator a = index->allocator;
        drop(index);
        umb_memory_free(&a, index, sizeof(*index));
        return result;
    }
    settle(index);
    index->listener.update = update;
    index->listener.user = index;
    umb_scene_listen(index->scene, &index->listener);
    *out = index;
    return UMB_OK;
}

umb_result umb_index_create(umb_scene *scene, const umb_index_def *def, umb_index **out)
{
    static const umb_index_def defaults = {0};
    *out = NULL;
    umb_index *index = NULL;
    umb_result result = make_empty(scene, def != NULL ? def : &defaults, &index);
    if (result != UMB_OK) {
        return result;
    }
    return start_following(index, rebuild(index, umb_scene_committed(scene)), out);
}

umb_result umb_index_restore(umb_scene *scene, const umb_index_def *def, const umb_stored_tree *stored,
                             umb_index **out)
{
    *out = NULL;
    umb_index *index = NULL;
    umb_result result = make_empty(scene, def, &index);
    if (result != UMB_OK) {
        return result;
    }
    return start_following(index, restore_nodes(index, stored), out);
}

void umb_index_destroy(umb_index *index)
{
    if (index != NULL) {
        umb_allocator a = index->allocator;
        umb_scene_unlisten(index->scene, &index->listener);
        drop(index);
        umb_memory_free(&a, index, sizeof(*index));
    }
}

/* A ray that meets the root meets a node in it with the ratio of their areas as probability, and
 * then tests its boxes (Gummerus 3.2 on surface areas; Goldsmith and Salmon 1987). */
static double tree_cost(const umb_tree *tree)
{
    if (tree->flat || tree->node_count == 0) {
        return tree->item_count;
    }
    double root = umb_half_area(tree->bounds.min, tree->bounds.max);
    double cost = 0.0;
    for (uint32_t k = 0; k < tree->node_count; ++k) {
        umb_aabb b = umb_node_bounds(&tree->nodes[k]);
        cost += (root > 0.0 ? umb_half_area(b.min, b.max) / root : 1.0) * tree->nodes[k].count;
    }
    return cost;
}

static uint32_t tree_depth(const umb_tree *tree)
{
    uint32_t deepest = tree->node_count > 0 ? 1 : 0;
    for (uint32_t k = 1; k < tree->node_count && !tree->flat; ++k) {
        uint32_t depth = 1;
        for (uint32_t n = k; tree->nodes[n].parent != UMB_NONE; n = tree->nodes[n].parent) {
            ++depth;
        }
        deepest = depth > deepest ? depth : deepest;
    }
    return deepest;
}

void umb_index_get_stats(const umb_index *index, umb_index_stats *out)
{
    const umb_tree *tree = &index->tree;
    out->items = index->item_count;
    out->slots = tree->item_count;
    out->nodes = tree->node_count - index->edit.free.count;
    out->depth = tree_depth(tree);
    out->cost = tree_cost(tree);
    out->bytes = sizeof(*index) + umb_tree_edit_memory(&index->edit) + umb_rebuild_job_memory(&index->job) +
                 umb_update_memory(&index->updater) + umb_node_volumes_memory(&index->volumes) +
                 index->order_count * sizeof(umb_order) +
                 index->plane_count * sizeof(umb_tilted_plane) + index->object_capacity * sizeof(uint32_t) +
                 index->block_capacity * sizeof(umb_node);
}

const umb_tree *umb_index_tree(const umb_index *index)
{
    return &index->tree;
}

umb_scene *umb_index_scene(const umb_index *index)
{
    return index->scene;
}

umb_index_def umb_index_settings(const umb_index *index)
{
    return index->def;
}

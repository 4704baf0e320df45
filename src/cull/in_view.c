#include "in_view.h"

#include <string.h>

#include "base/memory.h"
#include "contribution.h"
#include "found.h"
#include "scene/mask.h"
#include "volumes.h"

/* How many nodes ahead of the walk memory is asked for: enough to wait for several at once, few enough for the first
 * cache. */
#define AHEAD 6

bool umb_in_view_reserve(umb_in_view_room *room, const umb_allocator *a, const umb_tree *tree)
{
    size_t most = (size_t)tree->node_room + tree->block_count;
    return umb_memory_reserve(a, (void **)&room->nodes, &room->node_capacity, most, sizeof *room->nodes);
}

void umb_in_view_free(umb_in_view_room *room, const umb_allocator *a)
{
    umb_memory_free(a, room->nodes, room->node_capacity * sizeof *room->nodes);
    *room = (umb_in_view_room){0};
}

size_t umb_in_view_remembers(const umb_tree *tree)
{
    return (size_t)tree->node_room + tree->block_count;
}

/* Inline: GCC finds that the function has no effect, and drops calls to it. */
static inline __attribute__((always_inline)) void fetch(const umb_tree *tree, uint32_t number)
{
    const char *p = (const char *)umb_tree_node(tree, number);
    for (size_t i = 0; i < sizeof(umb_node); i += 64) {
        __builtin_prefetch(p + i);
    }
}

/* A part of an object. */
static void find_part(umb_in_view *v, uint32_t object)
{
    if (!umb_once_set(v->once, &v->once->objects[object], UMB_ONCE_SETTLED)) {
        v->objects[v->count++] = object;
    }
}

/* Everything below a node. */
static void copy_range(umb_in_view *v, uint32_t node)
{
    umb_range range = v->tree->below[node];
    for (uint32_t i = 0; i < range.count && v->once != NULL; ++i) {
        find_part(v, v->tree->objects[range.first + i]);
    }
    if (v->once != NULL) {
        return;
    }
    const uint32_t *from = v->tree->objects + range.first;
    uint32_t *to = v->objects + v->count;
    uint8_t *inside = v->inside + v->count;
    for (uint32_t i = 0; i < range.count; i += 8) {
        memcpy(to + i, from + i, 8 * sizeof *to);
        memset(inside + i, 1, 8);
    }
    v->count += range.count;
    v->stats->in_frustum += range.count;
}

/* A part says nothing of the size of its object, nor does a node of parts. */
static void find_part_of_size(umb_in_view *v, uint32_t object)
{
    if (!umb_contribution_small(v->view, &v->scene->objects[object].bounds)) {
        find_part(v, object);
    } else if (!umb_once_set(v->once, &v->once->objects[object], UMB_ONCE_SETTLED)) {
        v->stats->small += 1;
    }
}

/* Nothing below a node is in the view's layers. */
static bool is_left_out(const umb_in_view *v, uint32_t node)
{
    umb_mask mask = {v->view->mask, v->view->mask_all};
    return mask.bits != 0 && !v->view->masked_hide && !umb_mask_takes(mask, umb_tree_node(v->tree, node)->layers);
}

/* One node or block: what is found is written, nodes below it wait behind the *waiting that do. */
static void open_node(umb_in_view *v, const umb_node *node, uint16_t planes, uint8_t *remember, uint32_t *waiting)
{
    bool sizes = v->view->min_pixels > 0.0, parts = v->once != NULL, whole = (v->entries == NULL || parts) && !sizes;
    uint16_t left[UMB_NODE_WIDTH] = {0};
    uint32_t in = (1u << node->count) - 1u;
    v->stats->nodes += 1;
    if (planes != 0) {
        v->stats->boxes += node->count;
        in &= ~umb_frustum_test_node(&v->frustum, v->kernels, node, planes, remember, left);
    }
    umb_projected projected;
    if (v->entries != NULL && in != 0 && !parts) {
        v->kernels->project(node, v->projector, &projected);
    }
    for (; in != 0; in &= in - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(in), ref = node->ref[slot], number = ref & UMB_REF_NUMBER;
        uint32_t kind = ref & UMB_REF_KIND;
        if (kind == UMB_REF_NODE && is_left_out(v, number)) {
            continue;
        }
        if (kind == UMB_REF_NODE && whole && left[slot] == 0 && v->tree->below[number].count != UMB_RANGE_STALE) {
            copy_range(v, number);
        } else if (parts && kind == UMB_REF_OBJECT) {
            sizes ? find_part_of_size(v, number) : find_part(v, number);
        } else if (sizes && !parts && kind != UMB_REF_OCCLUDER && umb_contribution_small_slot(v->view, node, slot)) {
            v->stats->in_frustum += kind == UMB_REF_OBJECT;
            v->stats->small += kind == UMB_REF_OBJECT;
        } else if (kind == UMB_REF_NODE) {
            v->room->nodes[(*waiting)++] = (umb_in_view_node){number, left[slot]};
        } else if (kind == UMB_REF_OBJECT) {
            v->stats->in_frustum += 1;
            if (v->entries != NULL) {
                v->entries[v->count++] = umb_found_entry(projected.w_min[slot], number, left[slot] == 0);
            } else {
                v->inside[v->count] = left[slot] == 0;
                v->objects[v->count++] = number;
            }
        }
    }
}

/* From the top, first come, first served: nodes are asked for well before their turn. */
void umb_in_view_find(umb_in_view *v)
{
    const umb_tree *tree = v->tree;
    umb_in_view_node *nodes = v->room->nodes;
    uint32_t waiting = 0;
    v->count = 0;
    if (tree->node_count > 0) {
        uint32_t top = tree->flat ? tree->node_count + tree->block_count - 1 : 0;
        nodes[waiting++] = (umb_in_view_node){top, v->frustum.all_planes};
    }
    for (uint32_t i = 0; i < waiting; ++i) {
        if (i + AHEAD < waiting) {
            fetch(tree, nodes[i + AHEAD].number);
        }
        uint32_t number = nodes[i].number;
        if (tree->volumes != NULL && !umb_volumes_in_view(&v->frustum, tree, number, nodes[i].planes)) {
            continue;
        }
        umb_tree_note_open(tree, number);
        open_node(v, umb_tree_node(tree, number), nodes[i].planes, &v->remember[number], &waiting);
    }
}

#include "chosen.h"

#include "base/memory.h"
#include "contribution.h"
#include "found.h"
#include "volumes.h"

bool umb_chosen_reserve(umb_chosen_room *room, const umb_allocator *a, const umb_tree *tree)
{
    size_t most = (size_t)tree->node_room + tree->block_count;
    return umb_memory_reserve(a, (void **)&room->nodes, &room->capacity, most, sizeof *room->nodes);
}

void umb_chosen_free(umb_chosen_room *room, const umb_allocator *a)
{
    umb_memory_free(a, room->nodes, room->capacity * sizeof *room->nodes);
    *room = (umb_chosen_room){0};
}

/* Of an object that moves by itself only its volume is known here. */
static bool object_hidden(umb_chosen *v, uint32_t object, uint32_t token)
{
    return v->choice->scene->objects[object].mover == UMB_NONE && v->ops->hides_object != NULL && token != UMB_TOKEN_CLEAR &&
           v->ops->hides_object(v->method, object, token);
}

/* Ask about the boxes of a node that are in view; answers are in the query. */
static void ask(umb_chosen *v, umb_query *q)
{
    umb_cull_stats *stats = v->choice->stats;
    for (uint32_t slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
        q->tokens[slot] = UMB_TOKEN_CLEAR;
    }
    if (q->mask == 0 || q->token == UMB_TOKEN_CLEAR) {
        return;
    }
    stats->queries += (uint32_t)__builtin_popcount(q->mask);
    v->ops->ask(v->method, q);
    for (uint32_t left = q->hidden & q->mask; left != 0; left &= left - 1) {
        uint32_t kind = q->boxes->ref[__builtin_ctz(left)] & UMB_REF_KIND;
        stats->hidden_nodes += kind == UMB_REF_NODE;
        stats->hidden_objects += kind == UMB_REF_OBJECT;
    }
}

static bool settle(umb_chosen *v, uint32_t object)
{
    return v->once != NULL && umb_once_set(v->once, &v->once->objects[object], UMB_ONCE_SETTLED);
}

/* Parts, for in_view(): true if there is something to ask about. */
static bool wants_part(umb_chosen *v, uint32_t ref)
{
    const umb_choice *c = v->choice;
    if ((ref & UMB_REF_KIND) != UMB_REF_OBJECT) {
        return true;
    }
    uint32_t object = ref & UMB_REF_NUMBER, *entry = &v->once->objects[object];
    c->stats->in_frustum += !umb_once_set(v->once, entry, UMB_ONCE_MET);
    if (c->view->min_pixels > 0.0 && umb_contribution_small(c->view, &c->scene->objects[object].bounds)) {
        c->stats->small += !umb_once_set(v->once, entry, UMB_ONCE_SETTLED);
    }
    return !umb_once_has(v->once, *entry, UMB_ONCE_SETTLED);
}

/* Boxes of a node that hold objects and are in view, and large enough. */
static uint32_t in_view(umb_chosen *v, const umb_node *node, const umb_chosen_node *at, uint16_t *planes)
{
    const umb_choice *c = v->choice;
    uint32_t in = (1u << node->count) - 1u, found = 0;
    c->stats->nodes += 1;
    if (at->planes != 0) {
        c->stats->boxes += node->count;
        in &= ~umb_frustum_test_node(c->frustum, v->kernels, node, at->planes, &v->remember[at->number], planes);
    }
    for (; in != 0; in &= in - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(in), kind = node->ref[slot] & UMB_REF_KIND;
        bool node_left_out = kind == UMB_REF_NODE && c->mask.bits != 0 &&
                             !umb_mask_takes(c->mask, umb_tree_node(c->tree, node->ref[slot] & UMB_REF_NUMBER)->layers);
        if (kind == UMB_REF_OCCLUDER || node_left_out) {
            continue;
        }
        if (v->once != NULL) {
            found |= wants_part(v, node->ref[slot]) ? 1u << slot : 0;
            continue;
        }
        c->stats->in_frustum += kind == UMB_REF_OBJECT;
        bool small = c->view->min_pixels > 0.0 && umb_contribution_small_slot(c->view, node, slot);
        c->stats->small += small && kind == UMB_REF_OBJECT;
        found |= small ? 0 : 1u << slot;
    }
    return found;
}

/* One node or block; those below it that are not hidden wait on top of the *waiting that do. */
static void open_node(umb_chosen *v, const umb_chosen_node *at, uint32_t *waiting)
{
    const umb_node *node = umb_tree_node(v->choice->tree, at->number);
    uint16_t planes[UMB_NODE_WIDTH] = {0};
    umb_query q = {.boxes = node, .node = at->number, .token = at->token};
    q.mask = in_view(v, node, at, planes);
    ask(v, &q);
    umb_projected projected;
    uint32_t left = q.mask & ~q.hidden;
    if (v->projector != NULL && left != 0) {
        v->kernels->project(node, v->projector, &projected);
    }
    for (; left != 0; left &= left - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(left), number = node->ref[slot] & UMB_REF_NUMBER;
        if ((node->ref[slot] & UMB_REF_KIND) == UMB_REF_NODE) {
            v->room->nodes[(*waiting)++] = (umb_chosen_node){number, q.tokens[slot], planes[slot]};
        } else if (object_hidden(v, number, q.tokens[slot])) {
            v->choice->stats->hidden_objects += 1;
        } else if (!settle(v, number)) {
            float key = v->projector != NULL ? projected.w_min[slot] : 0.0f;
            v->entries[v->count++] = umb_found_entry(key, number, planes[slot] == 0);
        }
    }
}

/* Last come, first served: what waits longest has the oldest token. */
void umb_chosen_find(umb_chosen *v)
{
    const umb_tree *tree = v->choice->tree;
    uint32_t waiting = 0;
    v->count = 0;
    if (tree->node_count > 0) {
        uint32_t top = tree->flat ? tree->node_count + tree->block_count - 1 : 0;
        v->room->nodes[waiting++] = (umb_chosen_node){top, UMB_TOKEN_ALL, v->choice->frustum->all_planes};
    }
    while (waiting > 0) {
        umb_chosen_node at = v->room->nodes[--waiting];
        if (tree->volumes == NULL || umb_volumes_in_view(v->choice->frustum, tree, at.number, at.planes)) {
            open_node(v, &at, &waiting);
        }
    }
}

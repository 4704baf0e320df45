#include "solid_tree.h"

#include <math.h>
#include <string.h>

#define LEAF 4u
#define DEPTH 64

void umb_solid_tree_free(umb_solid_tree *t, const umb_allocator *a)
{
    umb_memory_free(a, t->nodes, t->node_capacity * sizeof *t->nodes);
    umb_memory_free(a, t->items, t->item_capacity * sizeof *t->items);
    memset(t, 0, sizeof *t);
}

static umb_aabb box_of(const umb_solids *s, const uint32_t *items, uint32_t count)
{
    umb_aabb box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (uint32_t i = 0; i < count; ++i) {
        const umb_aabb *b = &s->items[items[i]].bounds;
        for (int k = 0; k < 3; ++k) {
            box.min[k] = fminf(box.min[k], b->min[k]);
            box.max[k] = fmaxf(box.max[k], b->max[k]);
        }
    }
    return box;
}

static float middle(const umb_solids *s, uint32_t item, int axis)
{
    return s->items[item].bounds.min[axis] + s->items[item].bounds.max[axis];
}

/* Those with the lower middles first; in halves where middles tell nothing. */
static uint32_t divide(const umb_solids *s, uint32_t *items, uint32_t count, const umb_aabb *box)
{
    int axis = 0;
    for (int k = 1; k < 3; ++k) {
        axis = box->max[k] - box->min[k] > box->max[axis] - box->min[axis] ? k : axis;
    }
    float at = box->min[axis] + box->max[axis];
    uint32_t low = 0;
    for (uint32_t i = 0; i < count; ++i) {
        if (middle(s, items[i], axis) < at) {
            uint32_t other = items[low];
            items[low++] = items[i];
            items[i] = other;
        }
    }
    return low < count / 8 || low > count - count / 8 || low == 0 || low == count ? count / 2 : low;
}

bool umb_solid_tree_build(umb_solid_tree *t, const umb_allocator *a, const umb_solids *s)
{
    t->node_count = 0;
    if (s->count == 0) {
        return true;
    }
    if (!umb_memory_reserve(a, (void **)&t->nodes, &t->node_capacity, 2 * s->count, sizeof *t->nodes) ||
        !umb_memory_reserve(a, (void **)&t->items, &t->item_capacity, s->count, sizeof *t->items)) {
        return false;
    }
    for (uint32_t i = 0; i < s->count; ++i) {
        t->items[i] = i;
    }
    t->nodes[t->node_count++] = (umb_solid_node){.first = 0, .count = (uint32_t)s->count};
    for (uint32_t n = 0; n < t->node_count; ++n) {
        umb_solid_node *node = &t->nodes[n];
        node->box = box_of(s, t->items + node->first, node->count);
        if (node->count > LEAF) {
            uint32_t low = divide(s, t->items + node->first, node->count, &node->box), first = t->node_count;
            t->nodes[t->node_count++] = (umb_solid_node){.first = node->first, .count = low};
            t->nodes[t->node_count++] = (umb_solid_node){.first = node->first + low, .count = node->count - low};
            node->first = first;
            node->count = 0;
        }
    }
    return true;
}

/* A heap with the largest number on top: it goes when there are too many. */
static void sift_down(uint32_t *heap, uint32_t count, uint32_t at)
{
    uint32_t x = heap[at];
    for (uint32_t k = 2 * at + 1; k < count; k = 2 * at + 1) {
        k += k + 1 < count && heap[k + 1] > heap[k] ? 1 : 0;
        if (heap[k] <= x) {
            break;
        }
        heap[at] = heap[k];
        at = k;
    }
    heap[at] = x;
}

static void put(uint32_t *heap, uint32_t *count, uint32_t most, uint32_t x)
{
    if (*count < most) {
        uint32_t at = (*count)++;
        for (; at > 0 && heap[(at - 1) / 2] < x; at = (at - 1) / 2) {
            heap[at] = heap[(at - 1) / 2];
        }
        heap[at] = x;
    } else if (x < heap[0]) {
        heap[0] = x;
        sift_down(heap, most, 0);
    }
}

uint32_t umb_solid_tree_find(const umb_solid_tree *t, const umb_solids *s, const umb_shaft *shaft, uint32_t most,
                             uint32_t *out)
{
    uint32_t stack[DEPTH * 2], waiting = 0, count = 0;
    if (t->node_count > 0) {
        stack[waiting++] = 0;
    }
    while (waiting > 0) {
        const umb_solid_node *n = &t->nodes[stack[--waiting]];
        if (umb_shaft_beside(shaft, &n->box)) {
            continue;
        }
        if (n->count == 0) {
            stack[waiting++] = n->first;
            stack[waiting++] = n->first + 1;
            continue;
        }
        for (uint32_t i = n->first; i < n->first + n->count; ++i) {
            if (!umb_shaft_beside(shaft, &s->items[t->items[i]].bounds)) {
                put(out, &count, most, t->items[i]);
            }
        }
    }
    for (uint32_t left = count; left > 1; --left) {
        uint32_t x = out[0];
        out[0] = out[left - 1];
        out[left - 1] = x;
        sift_down(out, left - 1, 0);
    }
    return count;
}

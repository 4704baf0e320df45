#include "solid_tree.h"

#include <math.h>
#include <string.h>

/* Each half of a run that is divided has an eighth of it at least, so ways down have at most 166 halvings; a node that is taken
 * from the stack puts three more there than it takes. */
#define STACK 512

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

/* A run of items. */
typedef struct run {
    uint32_t first, count;
} run;

/* Into four at most: the longest is divided as long as there is one of several. Returns how many. */
static uint32_t quarter(const umb_solids *s, uint32_t *items, run whole, run parts[4], umb_aabb boxes[4])
{
    uint32_t count = 1;
    parts[0] = whole;
    boxes[0] = box_of(s, items + whole.first, whole.count);
    while (count < 4) {
        uint32_t longest = 0;
        for (uint32_t i = 1; i < count; ++i) {
            longest = parts[i].count > parts[longest].count ? i : longest;
        }
        run r = parts[longest];
        if (r.count < 2) {
            break;
        }
        uint32_t low = divide(s, items + r.first, r.count, &boxes[longest]);
        parts[longest].count = low;
        boxes[longest] = box_of(s, items + r.first, low);
        parts[count] = (run){r.first + low, r.count - low};
        boxes[count] = box_of(s, items + r.first + low, r.count - low);
        count += 1;
    }
    return count;
}

/* Larger than the box by more than rounding of either can be. */
static void set_child(umb_solid_node *n, uint32_t i, const umb_aabb *box, uint32_t child)
{
    for (int k = 0; k < 3; ++k) {
        float size = fmaxf(fabsf(box->min[k]), fabsf(box->max[k]));
        n->middle[k][i] = 0.5f * (box->min[k] + box->max[k]);
        n->half[k][i] = 0.5f * (box->max[k] - box->min[k]) + 0x1p-21f * size;
    }
    n->child[i] = child;
}

static void clear_node(umb_solid_node *n)
{
    for (int i = 0; i < 4; ++i) {
        n->middle[0][i] = n->middle[1][i] = n->middle[2][i] = 0.0f;
        n->half[0][i] = n->half[1][i] = n->half[2][i] = -INFINITY;
        n->child[i] = UMB_SOLID_LEAF;
    }
}

/* Until a node's children are made, its first two hold its run. */
bool umb_solid_tree_build(umb_solid_tree *t, const umb_allocator *a, const umb_solids *s)
{
    t->node_count = 0;
    if (s->count == 0) {
        return true;
    }
    if (!umb_memory_reserve(a, (void **)&t->nodes, &t->node_capacity, s->count, sizeof *t->nodes) ||
        !umb_memory_reserve(a, (void **)&t->items, &t->item_capacity, s->count, sizeof *t->items)) {
        return false;
    }
    for (uint32_t i = 0; i < s->count; ++i) {
        t->items[i] = i;
    }
    t->nodes[t->node_count++] = (umb_solid_node){.child = {0, (uint32_t)s->count}};
    for (uint32_t n = 0; n < t->node_count; ++n) {
        umb_solid_node *node = &t->nodes[n];
        run parts[4];
        umb_aabb boxes[4];
        uint32_t count = quarter(s, t->items, (run){node->child[0], node->child[1]}, parts, boxes);
        clear_node(node);
        for (uint32_t i = 0; i < count; ++i) {
            bool leaf = parts[i].count == 1;
            set_child(node, i, &boxes[i], leaf ? t->items[parts[i].first] | UMB_SOLID_LEAF : t->node_count);
            if (!leaf) {
                t->nodes[t->node_count++] = (umb_solid_node){.child = {parts[i].first, parts[i].count}};
            }
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

static umb_aabb child_box(const umb_solid_node *n, uint32_t i)
{
    umb_aabb box;
    for (int k = 0; k < 3; ++k) {
        box.min[k] = n->middle[k][i] - n->half[k][i];
        box.max[k] = n->middle[k][i] + n->half[k][i];
    }
    return box;
}

uint32_t umb_solid_tree_find(const umb_solid_tree *t, const umb_solids *s, const umb_shaft *shaft, uint32_t most,
                             uint32_t *out)
{
    uint32_t stack[STACK], waiting = 0, count = 0;
    if (t->node_count > 0) {
        stack[waiting++] = 0;
    }
    while (waiting > 0) {
        const umb_solid_node *n = &t->nodes[stack[--waiting]];
        for (uint32_t i = 0; i < 4; ++i) {
            uint32_t child = n->child[i], body = child & ~UMB_SOLID_LEAF;
            bool leaf = (child & UMB_SOLID_LEAF) != 0;
            umb_aabb box = child_box(n, i);
            if (n->half[0][i] < 0.0f || umb_shaft_beside(shaft, leaf ? &s->items[body].bounds : &box)) {
                continue;
            }
            if (leaf) {
                put(out, &count, most, body);
            } else {
                stack[waiting++] = child;
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

/* ---- along a segment ------------------------------------------------------------------------------ */

typedef float four __attribute__((vector_size(16)));
typedef int32_t four_masks __attribute__((vector_size(16)));

static inline four absolute(four x)
{
    return (four)((four_masks)x & 0x7FFFFFFF);
}

/* A segment: its middle, half of it, and how long that is along each axis. */
typedef struct segment {
    float middle[3], half[3], length[3];
} segment;

static segment make_segment(const double ends[2][3])
{
    segment s;
    for (int k = 0; k < 3; ++k) {
        s.middle[k] = (float)(0.5 * (ends[0][k] + ends[1][k]));
        s.half[k] = (float)(0.5 * (ends[1][k] - ends[0][k]));
        s.length[k] = fabsf(s.half[k]);
    }
    return s;
}

/* Which of the children the segment lies beside, along an axis or along one at right angles to an axis and to the segment. */
static inline four_masks misses(const segment *s, const umb_solid_node *n)
{
    four at[3], half[3];
    four_masks beside = {0};
    for (int k = 0; k < 3; ++k) {
        memcpy(&at[k], n->middle[k], sizeof at[k]);
        memcpy(&half[k], n->half[k], sizeof half[k]);
        at[k] = s->middle[k] - at[k];
        beside |= absolute(at[k]) > half[k] + s->length[k];
    }
    for (int i = 0, j = 1; i < 3; ++i, j = j == 2 ? 0 : j + 1) {
        beside |= absolute(s->half[i] * at[j] - s->half[j] * at[i]) > half[i] * s->length[j] + half[j] * s->length[i];
    }
    return beside;
}

umb_solids_along umb_solid_tree_along(const umb_solid_tree *t, const double (*first)[3], const double (*second)[3],
                                      uint32_t most, uint32_t *out)
{
    uint32_t stack[STACK], waiting = 0;
    segment s = make_segment(first), other = make_segment(second);
    umb_solids_along found = {0, most};
    if (t->node_count > 0) {
        stack[waiting++] = 0;
    }
    while (waiting > 0) {
        const umb_solid_node *n = &t->nodes[stack[--waiting]];
        four_masks beside = misses(&s, n), beside_other = {0};
        bool known = false;
        for (uint32_t i = 0; i < 4; ++i) {
            uint32_t child = n->child[i];
            if (beside[i] != 0) {
                continue;
            }
            if ((child & UMB_SOLID_LEAF) == 0) {
                stack[waiting++] = child;
            } else if (found.both_end < found.first_begin) {
                beside_other = known ? beside_other : misses(&other, n);
                known = true;
                out[beside_other[i] == 0 ? found.both_end++ : --found.first_begin] = child & ~UMB_SOLID_LEAF;
            }
        }
    }
    return found;
}

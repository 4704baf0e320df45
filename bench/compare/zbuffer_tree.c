/* A tree of median splits, eight children a node, and its walk. */
#include "zbuffer_tree.h"

#include <stdlib.h>
#include <string.h>

enum { WIDE = SCREEN_LANES };

#define OBJECT_BIT 0x80000000u

typedef struct tree_node {
    float box[6][WIDE];   /* empty slots repeat slot 0 */
    uint32_t child[WIDE]; /* a node, or a box with OBJECT_BIT */
    uint32_t count;
} tree_node;

typedef struct pending {
    zbuffer_box box;
    uint32_t child;
    uint32_t drawn; /* occluders drawn when it was tested last */
} pending;

struct zbuffer_tree {
    const world *world;
    zbuffer *buffer;
    tree_node *nodes;
    uint32_t node_count;
    uint32_t *order;    /* boxes, while building */
    uint32_t *occluder; /* by box: occluder + 1; 0: it does not hide */
    pending *heap;
    uint32_t pending_count;
    uint32_t *visible;
    uint32_t drawn;
};

static float middle(const world *w, uint32_t box, int axis)
{
    return w->box[axis][box] + w->box[axis + 3][box];
}

static int longest_axis(const world *w, const uint32_t *order, uint32_t count)
{
    float low[3] = {1e30f, 1e30f, 1e30f};
    float high[3] = {-1e30f, -1e30f, -1e30f};
    for (uint32_t i = 0; i < count; ++i) {
        for (int k = 0; k < 3; ++k) {
            float at = middle(w, order[i], k);
            low[k] = at < low[k] ? at : low[k];
            high[k] = at > high[k] ? at : high[k];
        }
    }
    int axis = high[1] - low[1] > high[0] - low[0] ? 1 : 0;
    return high[2] - low[2] > high[axis] - low[axis] ? 2 : axis;
}

/* Put the lower ones of order before place nth (Hoare's selection). */
static void select_median(const world *w, uint32_t *order, uint32_t count, uint32_t nth, int axis)
{
    uint32_t first = 0;
    uint32_t last = count - 1;
    while (first < last) {
        float pivot = middle(w, order[first + (last - first) / 2], axis);
        uint32_t i = first;
        uint32_t j = last;
        for (;;) {
            while (middle(w, order[i], axis) < pivot) {
                ++i;
            }
            while (middle(w, order[j], axis) > pivot) {
                --j;
            }
            if (i >= j) {
                break;
            }
            uint32_t held = order[i];
            order[i++] = order[j];
            order[j--] = held;
        }
        if (nth <= j) {
            last = j;
        } else {
            first = j + 1;
        }
    }
}

static uint32_t build(zbuffer_tree *t, uint32_t first, uint32_t count);

static void fill_slot(zbuffer_tree *t, uint32_t node, uint32_t first, uint32_t count)
{
    const world *w = t->world;
    uint32_t slot = t->nodes[node].count++;
    for (int k = 0; k < 3; ++k) {
        float low = 1e30f;
        float high = -1e30f;
        for (uint32_t i = first; i < first + count; ++i) {
            float a = w->box[k][t->order[i]];
            float b = w->box[k + 3][t->order[i]];
            low = a < low ? a : low;
            high = b > high ? b : high;
        }
        t->nodes[node].box[k][slot] = low;
        t->nodes[node].box[k + 3][slot] = high;
    }
    t->nodes[node].child[slot] = count == 1 ? t->order[first] | OBJECT_BIT : build(t, first, count);
}

/* Halve three times: up to eight slots. */
static void split(zbuffer_tree *t, uint32_t node, uint32_t first, uint32_t count, int times)
{
    if (count == 1 || times == 0) {
        fill_slot(t, node, first, count);
        return;
    }
    uint32_t half = count / 2;
    select_median(t->world, t->order + first, count, half,
                  longest_axis(t->world, t->order + first, count));
    split(t, node, first, half, times - 1);
    split(t, node, first + half, count - half, times - 1);
}

static uint32_t build(zbuffer_tree *t, uint32_t first, uint32_t count)
{
    uint32_t node = t->node_count++;
    split(t, node, first, count, 3);
    tree_node *n = &t->nodes[node];
    for (uint32_t slot = n->count; slot < WIDE; ++slot) {
        for (int k = 0; k < 6; ++k) {
            n->box[k][slot] = n->box[k][0];
        }
    }
    return node;
}

zbuffer_tree *zbuffer_tree_create(const world *w, uint32_t width, uint32_t height)
{
    zbuffer_tree *t = calloc(1, sizeof *t);
    if (t == NULL) {
        return NULL;
    }
    size_t n = (size_t)w->box_count + 1;
    t->world = w;
    t->buffer = zbuffer_create(w, width, height);
    t->nodes = aligned_alloc(64, (n * sizeof(tree_node) + 63) / 64 * 64);
    t->order = calloc(n, sizeof(uint32_t));
    t->occluder = calloc(n, sizeof(uint32_t));
    t->visible = calloc(n, sizeof(uint32_t));
    /* A walk holds every node's slots at the most. */
    t->heap = malloc(2 * n * sizeof(pending));
    if (t->buffer == NULL || t->nodes == NULL || t->order == NULL || t->occluder == NULL ||
        t->visible == NULL || t->heap == NULL) {
        zbuffer_tree_destroy(t);
        return NULL;
    }
    memset(t->nodes, 0, n * sizeof(tree_node));
    for (uint32_t i = 0; i < w->box_count; ++i) {
        t->order[i] = i;
    }
    for (uint32_t i = 0; i < w->occluder_count; ++i) {
        t->occluder[w->occluders[i].box] = i + 1;
    }
    if (w->box_count != 0) {
        (void)build(t, 0, w->box_count);
    }
    return t;
}

void zbuffer_tree_destroy(zbuffer_tree *t)
{
    if (t == NULL) {
        return;
    }
    zbuffer_destroy(t->buffer);
    free(t->nodes);
    free(t->order);
    free(t->occluder);
    free(t->visible);
    free(t->heap);
    free(t);
}

static void push(zbuffer_tree *t, const pending *p)
{
    uint32_t at = t->pending_count++;
    while (at != 0 && t->heap[(at - 1) / 2].box.nearest > p->box.nearest) {
        t->heap[at] = t->heap[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    t->heap[at] = *p;
}

static pending pop(zbuffer_tree *t)
{
    pending top = t->heap[0];
    pending last = t->heap[--t->pending_count];
    uint32_t at = 0;
    for (uint32_t child = 1; child < t->pending_count; child = 2 * at + 1) {
        child += child + 1 < t->pending_count &&
                 t->heap[child + 1].box.nearest < t->heap[child].box.nearest;
        if (!(t->heap[child].box.nearest < last.box.nearest)) {
            break;
        }
        t->heap[at] = t->heap[child];
        at = child;
    }
    t->heap[at] = last;
    return top;
}

static void open_node(zbuffer_tree *t, const screen_lens *lens, uint32_t node)
{
    const tree_node *n = &t->nodes[node];
    const float(*box)[WIDE] = (const float(*)[WIDE])n->box;
    screen_rects r;
    uint32_t inside = screen_boxes_inside(lens, box) & ((1u << n->count) - 1u);
    if (inside == 0) {
        return;
    }
    screen_boxes_project(lens, box, &r);
    for (; inside != 0; inside &= inside - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(inside);
        const pending p = {
            {r.x_min[slot], r.x_max[slot], r.y_min[slot], r.y_max[slot], r.nearest[slot]},
            n->child[slot],
            t->drawn};
        if (!zbuffer_hides(t->buffer, &p.box)) {
            push(t, &p);
        }
    }
}

uint32_t zbuffer_tree_frame(zbuffer_tree *t, const umb_view *view, const uint32_t **objects)
{
    const screen_lens *lens = zbuffer_begin(t->buffer, view);
    uint32_t count = 0;
    t->drawn = 0;
    t->pending_count = 0;
    if (t->node_count != 0) {
        open_node(t, lens, 0);
    }
    while (t->pending_count != 0) {
        pending p = pop(t);
        if (p.drawn != t->drawn && zbuffer_hides(t->buffer, &p.box)) {
            continue;
        }
        if ((p.child & OBJECT_BIT) == 0) {
            open_node(t, lens, p.child);
            continue;
        }
        uint32_t box = p.child & ~OBJECT_BIT;
        t->visible[count++] = t->world->box_object[box];
        if (t->occluder[box] != 0) {
            zbuffer_draw(t->buffer, t->occluder[box] - 1);
            ++t->drawn;
        }
    }
    *objects = t->visible;
    return count;
}

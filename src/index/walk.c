#include "walk.h"

#include "geometry/side.h"

/* ---- sides ---------------------------------------------------------------------------------- */

/* True if the eye is on the upper side. */
static bool above(const umb_walk_eye *eye, int axis, float at)
{
    return eye->at[axis] > (eye->parallel ? 0.0 : (double)at);
}

static bool split_above(const umb_tree *tree, const umb_order *o, uint32_t split, const umb_walk_eye *eye)
{
    if (o->axis[split] != UMB_ORDER_TILTED) {
        return above(eye, o->axis[split], o->at[split]);
    }
    const float(*points)[3] = tree->planes[o->number[split]].points;
    return (eye->parallel ? umb_side_of_direction(points, eye->at) : umb_side_of_point(points, eye->at)) > 0;
}

/* ---- one node ------------------------------------------------------------------------------- */

typedef struct row {
    const umb_tree *tree;
    const umb_order *order;
    const umb_walk_eye *eye;
    uint8_t *slots, *batches;
    uint32_t count, batch_count;
} row;

static void add_run(row *r, uint32_t split, uint32_t from, uint32_t end)
{
    if (split != UMB_ORDER_END) {
        uint32_t middle = r->order->middle[split];
        uint32_t upper = split_above(r->tree, r->order, split, r->eye);
        const uint32_t bounds[3] = {from, middle, end};
        for (uint32_t k = 0; k < 2; ++k) {
            uint32_t side = k == 0 ? upper : 1 - upper;
            add_run(r, r->order->next[split][side], bounds[side], bounds[side + 1]);
        }
        return;
    }
    for (uint32_t slot = from; slot < end; ++slot) {
        r->slots[r->count] = (uint8_t)slot;
        r->batches[r->count++] = (uint8_t)r->batch_count;
    }
    r->batch_count += from < end;
}

/* For how many of the planes the slot lies on the eye's side. */
static uint32_t eye_siding(const umb_order *o, uint32_t slot, uint32_t eye_octant)
{
    return (uint32_t)__builtin_popcount(o->axes & ~(o->octant[slot] ^ eye_octant));
}

static void add_octants(row *r, uint32_t count)
{
    uint32_t octant = 0;
    for (int i = 0; i < 3; ++i) {
        octant |= above(r->eye, i, r->order->at[i]) ? 1u << i : 0;
    }
    for (int number = 3; number >= 0; --number) {
        uint32_t before = r->count;
        for (uint32_t slot = 0; slot < count; ++slot) {
            if (eye_siding(r->order, slot, octant) == (uint32_t)number) {
                r->slots[r->count] = (uint8_t)slot;
                r->batches[r->count++] = (uint8_t)r->batch_count;
            }
        }
        r->batch_count += r->count > before;
    }
}

/* The square of the distance to a box; in parallel views the depth of its nearest corner. */
static double distance(const umb_node *node, uint32_t slot, const umb_walk_eye *eye)
{
    double sum = 0.0;
    for (int i = 0; i < 3; ++i) {
        double low = node->min[i][slot], high = node->max[i][slot], e = eye->at[i];
        if (eye->parallel) {
            sum -= e * (e > 0.0 ? high : low);
        } else {
            double off = e < low ? low - e : e > high ? e - high : 0.0;
            sum += off * off;
        }
    }
    return sum;
}

static uint32_t add_by_distance(const umb_node *node, const umb_walk_eye *eye, uint8_t slots[UMB_NODE_WIDTH],
                                uint8_t batches[UMB_NODE_WIDTH])
{
    double key[UMB_NODE_WIDTH];
    for (uint32_t i = 0; i < node->count; ++i) {
        double own = distance(node, i, eye);
        uint32_t at = i;
        for (; at > 0 && key[at - 1] > own; --at) {
            key[at] = key[at - 1];
            slots[at] = slots[at - 1];
        }
        key[at] = own;
        slots[at] = (uint8_t)i;
        batches[i] = (uint8_t)i;
    }
    return node->count;
}

uint32_t umb_walk_slots(const umb_tree *tree, uint32_t node, const umb_walk_eye *eye,
                        uint8_t slots[UMB_NODE_WIDTH], uint8_t batches[UMB_NODE_WIDTH])
{
    const umb_node *n = &tree->nodes[node];
    if (tree->orders == NULL) {
        return add_by_distance(n, eye, slots, batches);
    }
    row r = {tree, &tree->orders[node], eye, slots, batches, 0, 0};
    switch (r.order->kind) {
    case UMB_ORDER_OCTANTS:
        add_octants(&r, n->count);
        break;
    case UMB_ORDER_PLANES:
        add_run(&r, 0, 0, n->count);
        break;
    default:
        add_run(&r, UMB_ORDER_END, 0, n->count);
        break;
    }
    return r.batch_count;
}

/* ---- all of it ------------------------------------------------------------------------------ */

/* Batches are counted where cells are left behind: what is below a slot of a cell is of the same cell. */
static uint32_t walk(const umb_tree *tree, uint32_t node, const umb_walk_eye *eye, const umb_walk_visitor *v,
                     uint32_t before)
{
    const umb_node *n = &tree->nodes[node];
    uint8_t slots[UMB_NODE_WIDTH], batches[UMB_NODE_WIDTH];
    uint32_t last = 0, furthest = before;
    umb_walk_slots(tree, node, eye, slots, batches);
    for (uint32_t k = 0; k < n->count; ++k) {
        uint32_t ref = n->ref[slots[k]];
        if (batches[k] != last) {
            last = batches[k];
            before = furthest + 1;
            furthest = before;
        }
        bool below = v->visit(v->user, node, slots[k], before);
        if (below && (ref & UMB_REF_KIND) == UMB_REF_NODE) {
            uint32_t reached = walk(tree, ref, eye, v, before);
            furthest = reached > furthest ? reached : furthest;
        }
    }
    return furthest;
}

bool umb_walk_front_to_back(const umb_tree *tree, const umb_walk_eye *eye, const umb_walk_visitor *visitor)
{
    for (uint32_t k = 0; k < tree->node_count && tree->flat; ++k) {
        walk(tree, k, eye, visitor, k);
    }
    if (tree->node_count > 0 && !tree->flat) {
        walk(tree, 0, eye, visitor, 0);
    }
    return tree->orders != NULL;
}

/* ---- units ---------------------------------------------------------------------------------- */

size_t umb_walk_unit_slots(const umb_tree *tree)
{
    return (size_t)tree->node_count * UMB_NODE_WIDTH + 1;
}

static const umb_node *node_of(const umb_tree *tree, const umb_walk_slot *s)
{
    return &tree->nodes[tree->nodes[s->node].ref[s->slot]];
}

/* Append one batch of a node. */
static size_t add_batch(const umb_tree *tree, const umb_walk_eye *eye, uint32_t node, uint32_t batch,
                        umb_walk_slot *out)
{
    uint8_t slots[UMB_NODE_WIDTH], batches[UMB_NODE_WIDTH];
    size_t n = 0;
    umb_walk_slots(tree, node, eye, slots, batches);
    for (uint32_t k = 0; k < tree->nodes[node].count; ++k) {
        if (batches[k] == batch) {
            out[n++] = (umb_walk_slot){node, slots[k]};
        }
    }
    return n;
}

/* Show a unit, and keep of it, at its front, the slots whose nodes are to be opened. */
static size_t show(const umb_tree *tree, const umb_walk_unit_visitor *v, umb_walk_slot *unit, size_t count)
{
    size_t kept = 0;
    for (size_t k = 0; k < count; ++k) {
        v->open[k] = true;
    }
    v->visit(v->user, unit, (uint32_t)count, v->open);
    for (size_t k = 0; k < count; ++k) {
        uint32_t ref = tree->nodes[unit[k].node].ref[unit[k].slot];
        if (v->open[k] && (ref & UMB_REF_KIND) == UMB_REF_NODE) {
            unit[kept++] = unit[k];
        }
    }
    return kept;
}

/* Below the slots from `from` to `end` of the room: their nodes' first batches together, then the second ones, ... The
 * lists of a way down are of different slots, so the room holds them all. */
static void walk_below(const umb_tree *tree, const umb_walk_eye *eye, const umb_walk_unit_visitor *v, size_t from,
                       size_t end)
{
    for (uint32_t batch = 0; batch < UMB_NODE_WIDTH && from < end; ++batch) {
        size_t top = end;
        for (size_t k = from; k < end; ++k) {
            uint32_t node = (uint32_t)(node_of(tree, &v->room[k]) - tree->nodes);
            top += add_batch(tree, eye, node, batch, v->room + top);
        }
        if (top > end) {
            walk_below(tree, eye, v, end, end + show(tree, v, v->room + end, top - end));
        }
    }
}

bool umb_walk_units(const umb_tree *tree, const umb_walk_eye *eye, const umb_walk_unit_visitor *visitor)
{
    for (uint32_t batch = 0; batch < UMB_NODE_WIDTH && tree->node_count > 0; ++batch) {
        size_t count = add_batch(tree, eye, 0, batch, visitor->room);
        if (count > 0) {
            walk_below(tree, eye, visitor, 0, show(tree, visitor, visitor->room, count));
        }
    }
    return tree->orders != NULL;
}

/* A plain binary tree over the objects' boxes, for walks of exact segments. */
#include <math.h>
#include <stdlib.h>

#include "oracle.h"

#define LEAF_OBJECTS 4u

static double centre(const truth *t, uint32_t object, int axis)
{
    const umb_aabb *box = &t->model->objects[object].bounds;
    return (double)box->min[axis] + box->max[axis];
}

/* Order [first, last) so that what lies before `middle` is not above what lies behind (quickselect). */
static void part_at(const truth *t, uint32_t *order, uint32_t first, uint32_t last, uint32_t middle,
                    int axis)
{
    while (last - first > 1) {
        double pivot = centre(t, order[first + (last - first) / 2], axis);
        uint32_t i = first, j = last - 1;
        for (;;) {
            while (centre(t, order[i], axis) < pivot) {
                ++i;
            }
            while (centre(t, order[j], axis) > pivot) {
                --j;
            }
            if (i >= j) {
                break;
            }
            uint32_t swap = order[i];
            order[i++] = order[j];
            order[j--] = swap;
        }
        /* [first, j] is at most the pivot, [j + 1, last) at least. */
        if (j == last - 1) {
            --j;
        }
        if (middle <= j) {
            last = j + 1;
        } else {
            first = j + 1;
        }
    }
}

static umb_aabb box_around(const truth *t, uint32_t first, uint32_t last)
{
    umb_aabb box = t->model->objects[t->order[first]].bounds;
    for (uint32_t i = first + 1; i < last; ++i) {
        const umb_aabb *b = &t->model->objects[t->order[i]].bounds;
        for (int k = 0; k < 3; ++k) {
            box.min[k] = fminf(box.min[k], b->min[k]);
            box.max[k] = fmaxf(box.max[k], b->max[k]);
        }
    }
    return box;
}

/* The tree is implicit: a node is a range, halved at its middle; boxes lie in the order of a walk. */
static void build(truth *t, uint32_t first, uint32_t last, uint32_t *used)
{
    oracle_box_node *node = &t->box_nodes[(*used)++];
    node->box = box_around(t, first, last);
    if (last - first > LEAF_OBJECTS) {
        int axis = 0;
        for (int k = 1; k < 3; ++k) {
            if (node->box.max[k] - node->box.min[k] > node->box.max[axis] - node->box.min[axis]) {
                axis = k;
            }
        }
        uint32_t middle = first + (last - first) / 2;
        part_at(t, t->order, first, last, middle, axis);
        build(t, first, middle, used);
        build(t, middle, last, used);
    }
    node->after = *used;
}

bool oracle_boxes_build(truth *t)
{
    const model *m = t->model;
    uint32_t used = 0;
    t->order = malloc(((size_t)m->object_count + 1) * sizeof(*t->order));
    t->box_nodes = malloc(2 * ((size_t)m->object_count + 1) * sizeof(*t->box_nodes));
    if (!t->order || !t->box_nodes) {
        return false;
    }
    t->order_count = 0;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        if (m->objects[i].mesh != MODEL_NONE) {
            t->order[t->order_count++] = i;
        }
    }
    if (t->order_count) {
        build(t, 0, t->order_count, &used);
    }
    return true;
}

/* Does the segment meet the box? Grown by 1e-9 of the largest coordinate: a million times what the
 * rounding of these few operations can be, so a box that is touched is never passed over. */
static bool segment_meets_box(const double from[3], const double to[3], const umb_aabb *box)
{
    double low = 0.0, high = 1.0;
    for (int i = 0; i < 3; ++i) {
        double d = to[i] - from[i];
        double size = fmax(fmax(fabs(from[i]), fabs(to[i])),
                           fmax(fabs((double)box->min[i]), fabs((double)box->max[i])));
        double a = box->min[i] - from[i] - 1e-9 * size, b = box->max[i] - from[i] + 1e-9 * size;
        if (fabs(d) <= 1e-9 * size) {
            if (a > fabs(d) || b < -fabs(d)) {
                return false;
            }
            continue;
        }
        double s0 = a / d, s1 = b / d;
        low = fmax(low, fmin(s0, s1));
        high = fmin(high, fmax(s0, s1));
    }
    return low <= high + 1e-9;
}

static bool walk(const truth *t, const double from[3], const double to[3], uint32_t *node,
                 uint32_t first, uint32_t last, bool (*visit)(void *user, uint32_t object),
                 void *user)
{
    const oracle_box_node *n = &t->box_nodes[*node];
    if (!segment_meets_box(from, to, &n->box)) {
        *node = n->after;
        return true;
    }
    ++*node;
    if (last - first > LEAF_OBJECTS) {
        uint32_t middle = first + (last - first) / 2;
        return walk(t, from, to, node, first, middle, visit, user) &&
               walk(t, from, to, node, middle, last, visit, user);
    }
    for (uint32_t i = first; i < last; ++i) {
        uint32_t object = t->order[i];
        if (segment_meets_box(from, to, &t->model->objects[object].bounds) && !visit(user, object)) {
            return false;
        }
    }
    return true;
}

bool oracle_boxes_walk(const truth *t, const double from[3], const double to[3],
                       bool (*visit)(void *user, uint32_t object), void *user)
{
    uint32_t node = 0;
    return t->order_count == 0 || walk(t, from, to, &node, 0, t->order_count, visit, user);
}

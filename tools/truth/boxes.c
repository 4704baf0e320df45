/* A plain binary tree over boxes of a few triangles each, for walks of exact segments. */
#include <math.h>
#include <stdlib.h>

#include "oracle.h"

#define LEAF_CHUNKS 2u
#define CHUNK_TRIANGLES 16u
#define MOST_CHUNKS 2000000u /* scenes of more triangles get longer chunks */

static double centre(const oracle_chunk *chunk, int axis)
{
    return (double)chunk->box.min[axis] + chunk->box.max[axis];
}

/* Order [first, last) so that what lies before `middle` is not above what lies behind
 * (quickselect). */
static void part_at(oracle_chunk *order, uint32_t first, uint32_t last, uint32_t middle, int axis)
{
    while (last - first > 1) {
        double pivot = centre(&order[first + (last - first) / 2], axis);
        uint32_t i = first, j = last - 1;
        for (;;) {
            while (centre(&order[i], axis) < pivot) {
                ++i;
            }
            while (centre(&order[j], axis) > pivot) {
                --j;
            }
            if (i >= j) {
                break;
            }
            oracle_chunk swap = order[i];
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

static void grow_box(umb_aabb *box, const float min[3], const float max[3])
{
    for (int k = 0; k < 3; ++k) {
        box->min[k] = fminf(box->min[k], min[k]);
        box->max[k] = fmaxf(box->max[k], max[k]);
    }
}

static const umb_aabb empty_box = {{INFINITY, INFINITY, INFINITY},
                                   {-INFINITY, -INFINITY, -INFINITY}};

/* The tree is implicit: a node is a range, halved at its middle; boxes lie in the order of a
 * walk. */
static void build(truth *t, uint32_t first, uint32_t last, uint32_t *used)
{
    oracle_box_node *node = &t->box_nodes[(*used)++];
    node->box = empty_box;
    for (uint32_t i = first; i < last; ++i) {
        grow_box(&node->box, t->chunks[i].box.min, t->chunks[i].box.max);
    }
    if (last - first > LEAF_CHUNKS) {
        int axis = 0;
        for (int k = 1; k < 3; ++k) {
            if (node->box.max[k] - node->box.min[k] > node->box.max[axis] - node->box.min[axis]) {
                axis = k;
            }
        }
        uint32_t middle = first + (last - first) / 2;
        part_at(t->chunks, first, last, middle, axis);
        build(t, first, middle, used);
        build(t, middle, last, used);
    }
    node->after = *used;
}

static void chunk_object(truth *t, uint32_t object, uint32_t length)
{
    uint32_t count = t->model->meshes[t->model->objects[object].mesh].triangle_count;
    for (uint32_t first = 0; first < count; first += length) {
        oracle_chunk *chunk = &t->chunks[t->chunk_count++];
        *chunk = (oracle_chunk){empty_box, object, first,
                                first + length < count ? first + length : count};
        for (uint32_t k = first; k < chunk->last; ++k) {
            float v[3][3];
            oracle_triangle(t, object, k, v);
            for (int i = 0; i < 3; ++i) {
                grow_box(&chunk->box, v[i], v[i]);
            }
        }
    }
}

bool oracle_boxes_build(truth *t)
{
    const model *m = t->model;
    uint32_t used = 0;
    uint64_t triangles = t->first_triangle[m->object_count], chunks = 0;
    uint64_t length = CHUNK_TRIANGLES + triangles / MOST_CHUNKS;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        chunks += (t->first_triangle[i + 1] - t->first_triangle[i] + length - 1) / length;
    }
    t->chunks = malloc((size_t)(chunks + 1) * sizeof(*t->chunks));
    t->box_nodes = malloc(2 * (size_t)(chunks + 1) * sizeof(*t->box_nodes));
    if (!t->chunks || !t->box_nodes || chunks > UINT32_MAX / 2) {
        return false;
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        if (m->objects[i].mesh != MODEL_NONE) {
            chunk_object(t, i, (uint32_t)length);
        }
    }
    if (t->chunk_count) {
        build(t, 0, t->chunk_count, &used);
    }
    return true;
}

/* A segment made ready for many boxes. pad: 1e-9 of the largest coordinate about, a million times what
 * the rounding of these few operations can be, so a box that is touched is never passed over. */
typedef struct segment {
    double from[3], length[3], inverse[3], pad;
} segment;

static void segment_make(const truth *t, const double from[3], const double to[3], segment *out)
{
    const umb_aabb *all = &t->box_nodes[0].box;
    double size = 0.0;
    for (int i = 0; i < 3; ++i) {
        size = fmax(size, fmax(fabs(from[i]), fabs(to[i])));
        size = fmax(size, fmax(fabs((double)all->min[i]), fabs((double)all->max[i])));
    }
    out->pad = 1e-9 * size;
    for (int i = 0; i < 3; ++i) {
        double d = to[i] - from[i];
        out->from[i] = from[i];
        out->length[i] = fabs(d);
        out->inverse[i] = fabs(d) > out->pad ? 1.0 / d : 0.0; /* 0: it runs across this axis */
    }
}

static bool on_segment(const void *where, const umb_aabb *box)
{
    const segment *s = where;
    double low = 0.0, high = 1.0 + 1e-9;
    for (int i = 0; i < 3; ++i) {
        double a = box->min[i] - s->from[i] - s->pad, b = box->max[i] - s->from[i] + s->pad;
        if (s->inverse[i] == 0.0) {
            if (a > s->length[i] || b < -s->length[i]) {
                return false;
            }
            continue;
        }
        double s0 = a * s->inverse[i], s1 = b * s->inverse[i];
        double first = s0 < s1 ? s0 : s1, last = s0 < s1 ? s1 : s0;
        low = first > low ? first : low;
        high = last < high ? last : high;
    }
    return low <= high + 1e-9;
}

typedef struct box_walk {
    const truth *t;
    oracle_meets *meets;
    const void *where;
    oracle_visit *visit;
    void *user;
    uint32_t node;
} box_walk;

static bool walk(box_walk *w, uint32_t first, uint32_t last)
{
    const oracle_box_node *n = &w->t->box_nodes[w->node];
    if (!w->meets(w->where, &n->box)) {
        w->node = n->after;
        return true;
    }
    ++w->node;
    if (last - first > LEAF_CHUNKS) {
        uint32_t middle = first + (last - first) / 2;
        return walk(w, first, middle) && walk(w, middle, last);
    }
    for (uint32_t i = first; i < last; ++i) {
        const oracle_chunk *chunk = &w->t->chunks[i];
        if (w->meets(w->where, &chunk->box) && !w->visit(w->user, chunk)) {
            return false;
        }
    }
    return true;
}

bool oracle_boxes_walk(const truth *t, const double from[3], const double to[3],
                       oracle_visit *visit, void *user)
{
    segment s;
    if (t->chunk_count == 0) {
        return true;
    }
    segment_make(t, from, to, &s);
    return oracle_boxes_visit(t, on_segment, &s, visit, user);
}

bool oracle_boxes_visit(const truth *t, oracle_meets *meets, const void *where, oracle_visit *visit,
                        void *user)
{
    box_walk w = {.t = t, .meets = meets, .where = where, .visit = visit, .user = user};
    return t->chunk_count == 0 || walk(&w, 0, t->chunk_count);
}

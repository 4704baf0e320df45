#include "mesh_parts.h"

#include <math.h>

#include "base/sort.h"

#define BINS 16u
#define KEEP_BELOW 0.8  /* parts must be this much smaller than what they refine */
#define STACK_SIZE 256u /* each cut leaves at most 7/8: 8/7^256 is far beyond 2^32 */

typedef struct parts_builder {
    const umb_aabb *boxes; /* per triangle */
    uint32_t *order;
    uint64_t *keys, *key_scratch;
    uint32_t *value_scratch;
    umb_part *parts; /* in the order of a walk: a part, then the parts that it was cut into */
    uint32_t *begins, *ends; /* per part: its range of order */
    uint32_t part_count;
} parts_builder;

static umb_aabb box_of_none(void)
{
    umb_aabb b = {{HUGE_VALF, HUGE_VALF, HUGE_VALF}, {-HUGE_VALF, -HUGE_VALF, -HUGE_VALF}};
    return b;
}

static void box_join(umb_aabb *b, const umb_aabb *other)
{
    for (int i = 0; i < 3; ++i) {
        b->min[i] = other->min[i] < b->min[i] ? other->min[i] : b->min[i];
        b->max[i] = other->max[i] > b->max[i] ? other->max[i] : b->max[i];
    }
}

static double half_area(const umb_aabb *b)
{
    double x = (double)b->max[0] - b->min[0], y = (double)b->max[1] - b->min[1];
    double z = (double)b->max[2] - b->min[2];
    return x * y + y * z + z * x;
}

static float middle(const umb_aabb *b, int axis)
{
    return 0.5f * b->min[axis] + 0.5f * b->max[axis];
}

/* Where the binned surface-area cost is least: number of bins on the left, 0 if no cut leaves
 * enough on both sides. */
static uint32_t best_cut(const parts_builder *p, uint32_t begin, uint32_t end, int axis, float low,
                         double scale)
{
    umb_aabb boxes[BINS], right[BINS];
    uint32_t counts[BINS] = {0};
    for (uint32_t k = 0; k < BINS; ++k) {
        boxes[k] = box_of_none();
    }
    for (uint32_t i = begin; i < end; ++i) {
        const umb_aabb *b = &p->boxes[p->order[i]];
        double at = ((double)middle(b, axis) - low) * scale;
        uint32_t bin = at < BINS - 1 ? (uint32_t)at : BINS - 1;
        counts[bin] += 1;
        box_join(&boxes[bin], b);
    }
    right[BINS - 1] = boxes[BINS - 1];
    for (uint32_t k = BINS - 1; k > 0; --k) {
        right[k - 1] = right[k];
        box_join(&right[k - 1], &boxes[k - 1]);
    }
    uint32_t n = end - begin, least = n / 8 > 1 ? n / 8 : 1;
    uint32_t best = 0, on_left = 0;
    double best_cost = 0.0;
    umb_aabb left = box_of_none();
    for (uint32_t k = 1; k < BINS; ++k) {
        box_join(&left, &boxes[k - 1]);
        on_left += counts[k - 1];
        if (on_left < least || n - on_left < least) {
            continue;
        }
        double cost = half_area(&left) * on_left + half_area(&right[k]) * (n - on_left);
        if (best == 0 || cost < best_cost) {
            best = k;
            best_cost = cost;
        }
    }
    return best;
}

/* Order [begin, end) for a cut and return where it is. */
static uint32_t cut(parts_builder *p, uint32_t begin, uint32_t end)
{
    umb_aabb centres = box_of_none();
    for (uint32_t i = begin; i < end; ++i) {
        const umb_aabb *b = &p->boxes[p->order[i]];
        umb_aabb point;
        for (int k = 0; k < 3; ++k) {
            point.min[k] = point.max[k] = middle(b, k);
        }
        box_join(&centres, &point);
    }
    int axis = 0;
    double widest = -1.0;
    for (int k = 0; k < 3; ++k) {
        double width = (double)centres.max[k] - centres.min[k];
        if (width > widest) {
            widest = width;
            axis = k;
        }
    }
    float low = centres.min[axis];
    double scale = widest > 0.0 ? BINS / widest : 0.0;
    uint32_t bins = best_cut(p, begin, end, axis, low, scale), on_left = 0;
    for (uint32_t i = begin; i < end; ++i) {
        float m = middle(&p->boxes[p->order[i]], axis);
        double at = ((double)m - low) * scale;
        uint32_t bin = at < BINS - 1 ? (uint32_t)at : BINS - 1;
        on_left += bin < bins ? 1 : 0;
        /* With a cut by bins two keys are enough; without one the middle of the order is taken. */
        p->keys[i] = bins > 0 ? (bin < bins ? 0u : 1u) : umb_sort_float(m);
    }
    umb_sort_keys(p->keys + begin, p->order + begin, p->key_scratch, p->value_scratch, end - begin);
    return bins > 0 ? begin + on_left : begin + (end - begin) / 2;
}

static void emit(parts_builder *p, uint32_t begin, uint32_t end)
{
    umb_aabb box = p->boxes[p->order[begin]];
    for (uint32_t i = begin + 1; i < end; ++i) {
        box_join(&box, &p->boxes[p->order[i]]);
    }
    p->ends[p->part_count] = end;
    p->begins[p->part_count] = begin;
    p->parts[p->part_count++].box = box;
}

/* Where the walk goes on when a part is passed over: the next one that does not lie inside its
 * range. */
static void link_parts(parts_builder *p)
{
    uint32_t open[STACK_SIZE], depth = 0;
    for (uint32_t i = 0; i < p->part_count; ++i) {
        while (depth > 0 && p->ends[open[depth - 1]] <= p->begins[i]) {
            p->parts[open[--depth]].skip = i;
        }
        open[depth++] = i;
    }
    while (depth > 0) {
        p->parts[open[--depth]].skip = p->part_count;
    }
}

/* Drop what is below a small part unless its own parts together are smaller: the boxes of a solid's
 * faces say no more than the solid's box, those of a room's walls say much more than the room's.
 * Going backwards, children come before their parents; a negative area marks a part that becomes a
 * leaf. */
static void prune_parts(parts_builder *p, double *area, uint32_t most)
{
    for (uint32_t i = p->part_count; i-- > 0;) {
        const umb_part *part = &p->parts[i];
        double own = half_area(&part->box);
        area[i] = own;
        if (part->skip != i + 1) {
            uint32_t second = p->parts[i + 1].skip;
            double below = fabs(area[i + 1]) + fabs(area[second]);
            bool solid = p->ends[i] - p->begins[i] <= most && !(below < KEEP_BELOW * own);
            area[i] = solid ? -own : below;
        }
    }
    uint32_t kept = 0;
    for (uint32_t i = 0; i < p->part_count;) {
        p->begins[kept] = p->begins[i];
        p->ends[kept] = p->ends[i];
        p->parts[kept].box = p->parts[i].box;
        kept += 1;
        i = signbit(area[i]) ? p->parts[i].skip : i + 1;
    }
    p->part_count = kept;
    link_parts(p);
}

static umb_aabb *triangle_boxes(umb_scratch *scratch, const float (*positions)[3],
                                const uint32_t (*triangles)[3], uint32_t count)
{
    umb_aabb *boxes = umb_scratch_get(scratch, count, sizeof *boxes);
    for (uint32_t t = 0; boxes != NULL && t < count; ++t) {
        umb_aabb b = box_of_none();
        for (int c = 0; c < 3; ++c) {
            umb_aabb point;
            for (int k = 0; k < 3; ++k) {
                point.min[k] = point.max[k] = positions[triangles[t][c]][k];
            }
            box_join(&b, &point);
        }
        boxes[t] = b;
    }
    return boxes;
}

umb_part *umb_mesh_parts_build(umb_scratch *scratch, const float (*positions)[3],
                               const uint32_t (*triangles)[3], uint32_t triangle_count,
                               umb_parts_rule rule, uint32_t *part_count, uint32_t **part_order)
{
    umb_aabb *boxes = triangle_boxes(scratch, positions, triangles, triangle_count);
    size_t n = triangle_count;
    parts_builder p = {boxes,
                       umb_scratch_get(scratch, n, sizeof(uint32_t)),
                       umb_scratch_get(scratch, n, sizeof(uint64_t)),
                       umb_scratch_get(scratch, n, sizeof(uint64_t)),
                       umb_scratch_get(scratch, n, sizeof(uint32_t)),
                       umb_scratch_get(scratch, 2 * n, sizeof(umb_part)),
                       umb_scratch_get(scratch, 2 * n, sizeof(uint32_t)),
                       umb_scratch_get(scratch, 2 * n, sizeof(uint32_t)),
                       0};
    double *areas = umb_scratch_get(scratch, 2 * n, sizeof *areas);
    if (scratch->failed) {
        return NULL;
    }
    for (uint32_t i = 0; i < triangle_count; ++i) {
        p.order[i] = i;
    }
    uint32_t stack[STACK_SIZE][2], depth = 1;
    stack[0][0] = 0;
    stack[0][1] = triangle_count;
    while (depth > 0) {
        depth -= 1;
        uint32_t begin = stack[depth][0], end = stack[depth][1];
        emit(&p, begin, end);
        if (end - begin <= rule.least) {
            continue;
        }
        uint32_t at = cut(&p, begin, end);
        stack[depth][0] = at;
        stack[depth][1] = end;
        stack[depth + 1][0] = begin;
        stack[depth + 1][1] = at;
        depth += 2;
    }
    link_parts(&p);
    prune_parts(&p, areas, rule.solid);
    *part_count = p.part_count;
    for (uint32_t i = 0; i < p.part_count; ++i) {
        p.parts[i].begin = p.begins[i];
        p.parts[i].end = p.ends[i];
    }
    *part_order = p.order;
    umb_scratch_drop(scratch, p.begins);
    umb_scratch_drop(scratch, p.ends);
    umb_scratch_drop(scratch, areas);
    umb_scratch_drop(scratch, p.keys);
    umb_scratch_drop(scratch, p.key_scratch);
    umb_scratch_drop(scratch, p.value_scratch);
    umb_scratch_drop(scratch, boxes);
    return p.parts;
}

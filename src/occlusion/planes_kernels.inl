/* The kernels, over eight lanes: planes_kernels_ISA.c includes this with KERNELS and ISA defined and is compiled with
 * that instruction set's flags. No lane depends on another, sums run x, y, z. Bounds: docs/conservative.md, 14. */
#include "base/simd.h"
#include "planes_kernels.h"

#define LANES UMB_NODE_WIDTH

static void place(const umb_node *node, const float high[3], const float low[3], umb_near_boxes *out)
{
    for (int at = 0; at < LANES; at += UMB_LANES) {
        umb_fv reach = umb_fv_set(0.0f);
        for (int axis = 0; axis < 3; ++axis) {
            umb_fv lower = (umb_fv_load(node->min[axis] + at) - high[axis]) - low[axis];
            umb_fv upper = (umb_fv_load(node->max[axis] + at) - high[axis]) - low[axis];
            umb_fv_store(out->face[axis] + at, lower);
            umb_fv_store(out->face[3 + axis] + at, upper);
            reach += umb_fv_max(umb_fv_abs(lower), umb_fv_abs(upper));
        }
        umb_fv_store(out->reach + at, reach);
    }
}

/* The corner farthest against the normal decides whether all of a box is in, the one farthest along it whether any
 * of it is. */
UMB_INLINE umb_sides side_of(const umb_near_boxes *b, const umb_half_space *s)
{
    umb_sides sides = {0, 0, 0, 0};
    const float *least[3], *most[3];
    for (int axis = 0; axis < 3; ++axis) {
        bool up = s->n[axis] >= 0.0f;
        least[axis] = b->face[up ? axis : 3 + axis];
        most[axis] = b->face[up ? 3 + axis : axis];
    }
    for (int at = 0; at < LANES; at += UMB_LANES) {
        umb_fv low = s->n[0] * umb_fv_load(least[0] + at) + s->n[1] * umb_fv_load(least[1] + at);
        umb_fv high = s->n[0] * umb_fv_load(most[0] + at) + s->n[1] * umb_fv_load(most[1] + at);
        low = (low + s->n[2] * umb_fv_load(least[2] + at)) - s->at;
        high = (high + s->n[2] * umb_fv_load(most[2] + at)) - s->at;
        umb_fv bound = s->slack * umb_fv_load(b->reach + at) + s->room;
        sides.in |= (uint8_t)(umb_iv_bits(low > bound) << at);
        sides.open |= (uint8_t)(umb_iv_bits(low < -bound) << at);
        sides.out |= (uint8_t)(umb_iv_bits(high < -bound) << at);
        sides.part |= (uint8_t)(umb_iv_bits(high > bound) << at);
    }
    return sides;
}

static uint32_t sides(const umb_near_boxes *boxes, const umb_half_space *spaces, uint32_t count, uint32_t may_stop,
                      uint32_t mask, umb_sides *out)
{
    uint32_t gone = 0;
    for (uint32_t i = 0; i < count; ++i) {
        out[i] = side_of(boxes, &spaces[i]);
        gone |= i < may_stop ? out[i].out : 0;
        if ((mask & ~gone) == 0) {
            return i + 1;
        }
    }
    return count;
}

UMB_INLINE umb_fv plane_value(const float planes[4][LANES], const float p[4], int at)
{
    umb_fv value = umb_fv_load(planes[0] + at) * p[0] + umb_fv_load(planes[1] + at) * p[1];
    return (value + umb_fv_load(planes[2] + at) * p[2]) - umb_fv_load(planes[3] + at) * p[3];
}

static umb_sides tangent_sides(const umb_edge_planes *planes, const float p[4])
{
    umb_sides sides = {0, 0, 0, 0};
    umb_fv near = umb_fv_abs(umb_fv_set(p[0])) + umb_fv_abs(umb_fv_set(p[1])) + umb_fv_abs(umb_fv_set(p[2]));
    umb_fv bound = 0x1p-20f * (near + p[3] * planes->size);
    for (int at = 0; at < LANES; at += UMB_LANES) {
        umb_fv all = plane_value(planes->supporting, p, at), some = plane_value(planes->separating, p, at);
        sides.in |= (uint8_t)(umb_iv_bits(all > bound) << at);
        sides.open |= (uint8_t)(umb_iv_bits(all < -bound) << at);
        sides.out |= (uint8_t)(umb_iv_bits(some < -bound) << at);
        sides.part |= (uint8_t)(umb_iv_bits(some > bound) << at);
    }
    sides.in &= (uint8_t)~planes->unsure;
    sides.open &= (uint8_t)~planes->unsure;
    sides.out &= (uint8_t)~planes->unsure;
    sides.part &= (uint8_t)~planes->unsure;
    return sides;
}

const umb_planes_kernels KERNELS = {ISA, place, sides, tangent_sides};

#include "slot_choice.h"

#include <float.h>

#include "cut.h"

/* A child is entered rather than a free slot taken when it grows by no more than this part of itself and the box. */
#define WORTH_GROWING 0.5

static double area_of(const umb_aabb *b)
{
    return umb_half_area(b->min, b->max);
}

static double area_with(const umb_node *node, uint32_t slot, const umb_aabb *box)
{
    umb_aabb b = umb_slot_box(node, slot);
    umb_aabb_grow(&b, box);
    return area_of(&b);
}

static double area_of_slot(const umb_node *node, uint32_t slot)
{
    umb_aabb b = umb_slot_box(node, slot);
    return area_of(&b);
}

umb_slot_choice umb_slot_choose(const umb_node *node, const umb_aabb *box)
{
    umb_slot_choice best = {0, false};
    double least = DBL_MAX, own_area = 0.0;
    for (uint32_t slot = 0; slot < node->count; ++slot) {
        bool child = umb_slot_is_node(node, slot);
        double own = area_of_slot(node, slot);
        double added = area_with(node, slot, box) - (child ? own : 0.0);
        if (added < least || (added == least && own < own_area)) {
            best = (umb_slot_choice){slot, child};
            least = added;
            own_area = own;
        }
    }
    best.enter = best.enter && least <= WORTH_GROWING * (own_area + area_of(box));
    return best;
}

uint32_t umb_slot_holding(const umb_node *node, const umb_aabb *box)
{
    uint32_t best = UMB_NONE;
    double least = 0.0;
    for (uint32_t slot = 0; slot < node->count; ++slot) {
        if (!umb_slot_is_node(node, slot) || !umb_slot_holds(node, slot, box)) {
            continue;
        }
        double area = area_of_slot(node, slot);
        if (best == UMB_NONE || area < least) {
            best = slot;
            least = area;
        }
    }
    return best;
}

/* ---- groups --------------------------------------------------------------------------------- */

/* Half the centre, so that it is finite. */
static double middle(const umb_aabb *b, int axis)
{
    return 0.25 * b->min[axis] + 0.25 * b->max[axis];
}

typedef struct mean {
    double sum[3], weight;
} mean;

static void add_to_mean(mean *m, const umb_aabb *b)
{
    double longest = 0.0;
    for (int i = 0; i < 3; ++i) {
        double side = (double)b->max[i] - b->min[i];
        longest = side > longest ? side : longest;
    }
    double weight = 1.0 / (longest > FLT_MIN ? longest : FLT_MIN); /* of points, all the same */
    for (int i = 0; i < 3; ++i) {
        m->sum[i] += weight * middle(b, i);
    }
    m->weight += weight;
}

/* Which axes have a plane: those that cut no more than a quarter of the items, or the one that cuts fewest. */
static uint32_t choose_planes(const uint32_t cut[3], uint32_t items)
{
    uint32_t planes = 0, fewest = 0;
    for (uint32_t i = 0; i < 3; ++i) {
        planes |= cut[i] * 4 <= items ? 1u << i : 0;
        fewest = cut[i] < cut[fewest] ? i : fewest;
    }
    return planes != 0 ? planes : 1u << fewest;
}

void umb_slot_group(const umb_node *node, const umb_aabb *box, umb_slot_groups *out)
{
    mean m = {{0, 0, 0}, 0};
    uint32_t cut[3] = {0, 0, 0}, items = 0;
    add_to_mean(&m, box);
    for (uint32_t slot = 0; slot < node->count; ++slot) {
        umb_aabb b = umb_slot_box(node, slot);
        if (!umb_slot_is_node(node, slot)) {
            add_to_mean(&m, &b);
            items += 1;
        }
    }
    double at[3];
    for (int i = 0; i < 3; ++i) {
        at[i] = 2.0 * (m.sum[i] / m.weight);
    }
    for (uint32_t slot = 0; slot < node->count; ++slot) {
        for (int i = 0; i < 3 && !umb_slot_is_node(node, slot); ++i) {
            cut[i] += node->min[i][slot] < at[i] && node->max[i][slot] > at[i];
        }
    }
    uint32_t planes = choose_planes(cut, items);
    *out = (umb_slot_groups){.of = {0}};
    for (uint32_t slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
        uint32_t group = slot < node->count && !umb_slot_is_node(node, slot) ? 0 : UMB_SLOT_NO_GROUP;
        for (uint32_t i = 0; i < 3 && group != UMB_SLOT_NO_GROUP; ++i) {
            bool below = node->max[i][slot] <= at[i], above = node->min[i][slot] >= at[i];
            if ((planes >> i & 1u) != 0) {
                group = below || above ? group | (below ? 0u : 1u << i) : UMB_SLOT_NO_GROUP;
            }
        }
        out->of[slot] = (uint8_t)group;
        if (group != UMB_SLOT_NO_GROUP) {
            out->count[group] += 1;
        }
    }
}

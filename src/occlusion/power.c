#include "power.h"

#include <string.h>

/* Objects looked at for each sample wanted. */
#define LOOKS 8

/* Eight boxes side by side; those from count on are copies of the first. */
static void fill_node(umb_node *node, const umb_aabb *boxes, uint32_t count)
{
    node->count = count;
    for (uint32_t slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
        const umb_aabb *b = &boxes[slot < count ? slot : 0];
        for (int axis = 0; axis < 3; ++axis) {
            node->min[axis][slot] = b->min[axis];
            node->max[axis][slot] = b->max[axis];
        }
    }
}

static uint32_t find_in_view(const umb_choice *c, const umb_box_kernels *kernels, umb_aabb samples[UMB_POWER_SAMPLES])
{
    uint32_t looks = LOOKS * UMB_POWER_SAMPLES, all = c->scene->object_count, count = 0;
    uint64_t step = all > looks ? ((uint64_t)all << 16) / looks : 1u << 16;
    for (uint64_t at = 0; at >> 16 < all && count < UMB_POWER_SAMPLES;) {
        umb_aabb boxes[UMB_NODE_WIDTH];
        umb_node node;
        uint16_t left[UMB_NODE_WIDTH];
        uint32_t n = 0;
        for (; n < UMB_NODE_WIDTH && at >> 16 < all; at += step) {
            const umb_object *o = &c->scene->objects[at >> 16];
            boxes[n] = o->bounds;
            n += o->live;
        }
        fill_node(&node, boxes, n);
        uint32_t out = umb_frustum_test_node(c->frustum, kernels, &node, c->frustum->all_planes, NULL, left);
        for (uint32_t i = 0; i < n && count < UMB_POWER_SAMPLES; ++i) {
            if ((out >> i & 1u) == 0) {
                samples[count++] = boxes[i];
            }
        }
    }
    return count;
}

void umb_power_sample(umb_power *p, const umb_choice *choice, const umb_box_kernels *boxes,
                      const umb_planes_kernels *planes, const umb_blockers *blockers)
{
    umb_aabb samples[UMB_POWER_SAMPLES];
    p->sample_count = find_in_view(choice, boxes, samples);
    p->group_count = (p->sample_count + UMB_NODE_WIDTH - 1) / UMB_NODE_WIDTH;
    for (uint32_t g = 0; g < p->group_count; ++g) {
        umb_node node;
        uint32_t left = p->sample_count - g * UMB_NODE_WIDTH;
        fill_node(&node, samples + g * UMB_NODE_WIDTH, left < UMB_NODE_WIDTH ? left : UMB_NODE_WIDTH);
        planes->place(&node, blockers->origin_high, blockers->origin_low, &p->groups[g]);
    }
}

/* Which samples a blocker holds. */
static void find_held(const umb_power *p, const umb_planes_kernels *kernels, const umb_blockers *b,
                      const umb_blocker *blocker, uint64_t out[2])
{
    uint32_t count = blocker->edge_count * b->viewer.point_count + blocker->plane_count + blocker->near_count;
    umb_sides sides[UMB_BLOCKER_EDGES + 2 * UMB_BLOCKER_PLANES];
    out[0] = out[1] = 0;
    for (uint32_t g = 0; g < p->group_count; ++g) {
        uint32_t left = p->sample_count - g * UMB_NODE_WIDTH, mask = left < UMB_NODE_WIDTH ? (1u << left) - 1u : 0xFFu;
        uint32_t seen = kernels->sides(&p->groups[g], b->spaces + blocker->first_space, count, count, mask, sides);
        for (uint32_t i = 0; i < seen; ++i) {
            mask &= sides[i].in;
        }
        mask = seen == count ? mask : 0;
        out[g / 8] |= (uint64_t)mask << (g % 8 * UMB_NODE_WIDTH);
    }
}

static uint32_t gain(const uint64_t holds[2], const uint64_t held[2])
{
    return (uint32_t)(__builtin_popcountll(holds[0] & ~held[0]) + __builtin_popcountll(holds[1] & ~held[1]));
}

/* One that is taken adds nothing any more: all that it holds is held. */
void umb_power_choose(const umb_power *p, const umb_planes_kernels *kernels, const umb_blockers *blockers,
                      uint64_t (*holds)[2], uint16_t *order, uint32_t count)
{
    uint64_t held[2] = {0, 0};
    uint32_t taken = 0;
    for (uint32_t i = 0; i < blockers->count; ++i) {
        find_held(p, kernels, blockers, &blockers->list[i], holds[i]);
    }
    for (uint32_t best_gain = 1; best_gain > 0 && taken < count;) {
        uint32_t best = 0;
        best_gain = 0;
        for (uint32_t i = 0; i < blockers->count; ++i) {
            uint32_t g = gain(holds[i], held);
            best = g > best_gain ? i : best;
            best_gain = g > best_gain ? g : best_gain;
        }
        if (best_gain > 0) {
            held[0] |= holds[best][0];
            held[1] |= holds[best][1];
            order[taken++] = (uint16_t)best;
        }
    }
    uint32_t first = taken;
    for (uint32_t i = 0; i < blockers->count && taken < count; ++i) {
        bool in = false;
        for (uint32_t k = 0; k < first && !in; ++k) {
            in = order[k] == i;
        }
        if (!in) {
            order[taken++] = (uint16_t)i;
        }
    }
}

_Static_assert(UMB_POWER_SAMPLES == 128, "two words of samples");

#include "cut.h"

#include <math.h>

/* What a wide node costs beside its area over the root's, times the count of items. Area alone is
 * the chance of a ray; a region in view opens every node in it, and pays for nodes that are not
 * full. Measured on 30,000 to 300,000 boxes: with 20 the cost of rays is 2 % more than with 6; a frustum opens 4 %
 * fewer nodes, and with occlusion, where few nodes are opened, 1 % more. */
#define NODE_COST 6.0

umb_cut_costs umb_cut_costs_of(double root_area, uint32_t item_count)
{
    return (umb_cut_costs){root_area > 0.0 ? 1.0 / root_area : 0.0, NODE_COST / item_count};
}

umb_cut umb_cut_split(const umb_cut_costs *costs, umb_bvh_split *s, double area, const umb_cut *left,
                      const umb_cut *right)
{
    umb_cut c = {{0}};
    for (int j = 2; j <= UMB_NODE_WIDTH; ++j) {
        float best = INFINITY;
        for (int k = 1; k < j; ++k) {
            float cost = left->cost[k] + right->cost[j - k];
            if (cost < best) {
                best = cost;
                s->pick[j - 1] = (uint8_t)k;
            }
        }
        if (j < UMB_NODE_WIDTH) {
            c.cost[j] = best;
        } else {
            double own = area * costs->inverse_root_area + costs->node_cost;
            c.cost[1] = best + (float)own;
        }
    }
    s->pick[0] = 0;
    for (int j = 2; j < UMB_NODE_WIDTH; ++j) {
        if (c.cost[j - 1] <= c.cost[j]) {
            c.cost[j] = c.cost[j - 1];
            s->pick[j - 1] = 0;
        }
    }
    return c;
}

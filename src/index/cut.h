/* Cutting a binary tree into wide nodes, the cheapest way. */
#ifndef UMB_CUT_H
#define UMB_CUT_H

#include "bvh.h"

/* Half the surface of a box, in double: the extents of finite floats cannot overflow it. 0 for an empty box. */
static inline double umb_half_area(const float min[], const float max[])
{
    double x = (double)max[0] - min[0];
    double y = (double)max[1] - min[1];
    double z = (double)max[2] - min[2];
    return x >= 0.0 ? x * y + y * z + z * x : 0.0;
}

/* The least cost of a subtree in at most j slots of a wide node; [0] is unused. All zero for an item. */
typedef struct umb_cut {
    float cost[UMB_NODE_WIDTH];
} umb_cut;

typedef struct umb_cut_costs {
    double inverse_root_area, node_cost;
} umb_cut_costs;

umb_cut_costs umb_cut_costs_of(double root_area, uint32_t item_count);

/* The cheapest cut of a subtree into j slots or fewer, from its halves' (Ylitie, Karras, Laine 2017, section 3.2):
 * either some slots go left and the others right, or the subtree is a node of its own. Fills in s->pick. */
umb_cut umb_cut_split(const umb_cut_costs *costs, umb_bvh_split *s, double area, const umb_cut *left,
                      const umb_cut *right);

#endif

/* Which of many candidates to take as occluders, by what they would hide (Hudson's depth complexity; Gummerus 5.4): boxes
 * of objects in view are sampled, and that candidate is taken which holds the most of those that none taken before
 * holds. So several that hide the same are not taken together. The paper samples points before the run; here the
 * samples are this frame's own, which costs little with eight boxes at a time. */
#ifndef UMB_POWER_H
#define UMB_POWER_H

#include "planes_kernels.h"

enum { UMB_POWER_GROUPS = 16, UMB_POWER_SAMPLES = UMB_POWER_GROUPS * UMB_NODE_WIDTH };

typedef struct umb_power {
    umb_near_boxes groups[UMB_POWER_GROUPS];
    uint32_t group_count; /* all but the last are full */
    uint32_t sample_count;
} umb_power;

/* Sample up to UMB_POWER_SAMPLES objects in view, evenly over their ids: whatever the index. */
void umb_power_sample(umb_power *p, const umb_choice *choice, const umb_box_kernels *boxes,
                      const umb_planes_kernels *planes, const umb_blockers *blockers);

/* Order the blockers by what they add: order[] gets `count` numbers below blockers->count, the best first; those that
 * add nothing follow as they came. holds: two words for each blocker, to work in. */
void umb_power_choose(const umb_power *p, const umb_planes_kernels *kernels, const umb_blockers *blockers,
                      uint64_t (*holds)[2], uint16_t *order, uint32_t count);

#endif

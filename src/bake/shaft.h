/* The hull of two boxes, and what lies beside it. */
#ifndef UMB_SHAFT_H
#define UMB_SHAFT_H

#include "umbrage/geometry.h"

/* The hull is inside all of these: a box around both, and half-planes across each pair of axes, through the edges of that pair's
 * outline that go from box to box. */
typedef struct umb_shaft {
    double min[3], max[3];
    struct umb_shaft_side {
        double x, y, most; /* the hull has x p[i] + y p[j] <= most */
        uint32_t i, j;
    } sides[12];
    uint32_t side_count;
} umb_shaft;

void umb_shaft_make(umb_shaft *s, const double min[2][3], const double max[2][3]);

/* True if the box is surely beside the hull, as seen along one of the axes. To be told false costs time, no more: and so does a
 * shaft that rounding made too small or too large. */
static inline bool umb_shaft_beside(const umb_shaft *s, const umb_aabb *b)
{
    for (int k = 0; k < 3; ++k) {
        if (b->max[k] < s->min[k] || b->min[k] > s->max[k]) {
            return true;
        }
    }
    for (uint32_t n = 0; n < s->side_count; ++n) {
        const struct umb_shaft_side *e = &s->sides[n];
        double x = e->x > 0.0 ? b->min[e->i] : b->max[e->i], y = e->y > 0.0 ? b->min[e->j] : b->max[e->j];
        if (e->x * x + e->y * y > e->most) {
            return true;
        }
    }
    return false;
}

#endif

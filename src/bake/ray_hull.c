#include "ray_map.h"

static double turn(const umb_ray_point *a, const umb_ray_point *b, const umb_ray_point *c)
{
    return (b->u - a->u) * (c->v - a->v) - (b->v - a->v) * (c->u - a->u);
}

static bool before(const umb_ray_point *a, const umb_ray_point *b)
{
    return a->u < b->u || (a->u == b->u && a->v < b->v);
}

/* Monotone chains. */
uint32_t umb_ray_hull(const umb_ray_point *p, uint32_t count, uint8_t *out)
{
    uint8_t order[UMB_RAY_OUTLINE], hull[2 * UMB_RAY_OUTLINE];
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t k = i;
        for (; k > 0 && before(&p[i], &p[order[k - 1]]); --k) {
            order[k] = order[k - 1];
        }
        order[k] = (uint8_t)i;
    }
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; ++i) {
        while (n >= 2 && turn(&p[hull[n - 2]], &p[hull[n - 1]], &p[order[i]]) <= 0.0) {
            --n;
        }
        hull[n++] = order[i];
    }
    uint32_t lower = n + 1;
    for (uint32_t i = count - 1; i-- > 0;) {
        while (n >= lower && turn(&p[hull[n - 2]], &p[hull[n - 1]], &p[order[i]]) <= 0.0) {
            --n;
        }
        hull[n++] = order[i];
    }
    n = n > 1 ? n - 1 : n;
    for (uint32_t i = 0; i < n; ++i) {
        out[i] = hull[i];
    }
    return n;
}

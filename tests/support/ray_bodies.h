/* What blocks in occlusion maps, with the triangles it is made of, and segments against these one by one: slow and
 * obvious. Points are in a frame: u forwards, v sideways, z up. */
#ifndef RAY_BODIES_H
#define RAY_BODIES_H

#include "bake/ray_map.h"
#include "support/failing.h"

static inline double dice_between(dice *d, double low, double high)
{
    return low + (high - low) * (dice_roll(d, 1u << 30) / (double)(1u << 30));
}

#define RAY_BODY_FACES 24

typedef struct ray_body {
    umb_ray_blocker blocker;
    uint8_t faces[RAY_BODY_FACES][3];
    uint32_t face_count;
} ray_body;

/* Where a body is to be: near to far away, its size at most a share of that; what is convex of it begins at `front`. */
typedef struct ray_place {
    double front, near, far, share;
} ray_place;

/* A box with any three edges, upright or not, a tetrahedron, a wall of several pieces with a ragged roof and base, or a star of
 * triangles around a vertex. The first two are convex. */
void ray_body_draw(dice *d, const ray_place *place, ray_body *out);

/* Move it down to the ground, below which nothing passes: walls and upright boxes stand on it. */
void ray_body_stand(ray_body *b, double ground);

/* The segment meets a triangle of the body. */
bool ray_body_meets(const ray_body *b, const umb_ray_point *from, const umb_ray_point *to);

#endif

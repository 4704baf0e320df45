/* The two chains of an occluder between which its umbra lies (docs/conservative.md, "Patches"). */
#ifndef UMB_RAY_CHAINS_H
#define UMB_RAY_CHAINS_H

#include "ray_map.h"

/* Vertices of a blocker, each chain from the vertex that lines have on their one side to the one that they have on
 * the other. The chains may end at different vertices: at one place, seen from above, or of a convex body. */
typedef struct umb_ray_chains {
    uint8_t top[UMB_UMBRA_VERTICES + 1], bottom[UMB_UMBRA_VERTICES + 1];
    uint32_t top_count, bottom_count;
} umb_ray_chains;

/* Of a convex body: what is highest and what is lowest of it, as seen along lines of offset s. Any chains would be
 * right. */
void umb_ray_chains_convex(const umb_ray_map *m, const umb_ray_blocker *b, double s, umb_ray_chains *out);

/* Of the ring of a disk: from the vertex that lines from t0 on have to one side to the one that lines up to t1 have to the
 * other. */
void umb_ray_chains_ring(const umb_ray_map *m, const umb_ray_blocker *b, double s, double t0, double t1,
                         umb_ray_chains *out);

/* Bounds at a point seen from a cell from ua to ub, that fill in what umb_umbra_vertex says of them, margin and depth. */
void umb_ray_bound_vertex(const umb_ray_map *m, const umb_ray_point *p, float ua, float ub, float error_u,
                          umb_umbra_vertex *v);

#endif

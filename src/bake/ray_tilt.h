/* Slopes to a body that does not stand upright. */
#ifndef UMB_RAY_TILT_H
#define UMB_RAY_TILT_H

#include "ray_map.h"

/* A body and a tile of the map whose lines may meet it. */
typedef struct umb_ray_tilt {
    const umb_ray_map *map;
    const umb_ray_shape *shape;
    double s, t;         /* of the tile's first corner */
    double u_min, u_max; /* where lines of the tile meet the body */
    double ua, ub;       /* the cell in all slices of the tile */
} umb_ray_tilt;

/* Sharpen what is asked about the tile, whose rows are filled in: for each pixel an upper bound of m and a lower bound of M of
 * the body's points on its lines. False: nothing is gained, for it stands upright, has too many corners or may be beside the
 * cell. */
bool umb_ray_tilt_bound(const umb_ray_tilt *tilt, const umb_umbra_kernels *kernels, umb_umbra_query *q);

#endif

/* A triangle's plane as the view sees it: which side, and its nearness over the raster. */
#ifndef UMB_PLANE_H
#define UMB_PLANE_H

#include "raster_map.h"

typedef struct umb_face {
    umb_vec3 normal; /* by the order of the corners */
    double size;     /* what the normal's rounding is relative to */
    double distance; /* of the eye from the plane, times the normal's length; parallel: along the sight-lines */
    double error;    /* bound of its rounding */
} umb_face;

umb_face umb_face_of(const umb_raster_map *map, const float a[3], const float b[3], const float c[3]);

/* Nearness over the raster: gx x + gy y + g0, off by at most error and a relative 2^-22. */
typedef struct umb_plane_nearness {
    double gx, gy, g0, error;
} umb_plane_nearness;

/* False when the plane is too close to edge-on to say anything; a is a corner. */
bool umb_face_nearness(const umb_raster_map *map, const umb_face *face, const float a[3],
                       umb_plane_nearness *out);

#endif

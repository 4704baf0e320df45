/* Outer images of boxes: the pixels that a box may touch and the nearness of its nearest point. */
#ifndef UMB_IMAGE_H
#define UMB_IMAGE_H

#include "method.h"
#include "plane.h"

/* Bounds of an image in raster coordinates and of its depth; outer, errors included. */
typedef struct umb_image_bounds {
    double x_min, y_min, x_max, y_max;
    double w_min, w_max;
} umb_image_bounds;

/* Pixels whose closed squares cover those bounds as far as they are on the raster. */
umb_image umb_image_of_bounds(const umb_raster_map *map, const umb_image_bounds *b);

typedef enum umb_depth_place {
    UMB_DEPTH_OUTSIDE, /* wholly nearer than near or beyond far: not in view */
    UMB_DEPTH_CROSSING, /* some of it may be nearer than near; no image */
    UMB_DEPTH_BEYOND   /* beyond near everywhere; the image is valid */
} umb_depth_place;

/* Image of a shape's box under a transform, as the box it is, turned. The transform moves each
 * vertex by one rounding to float; identity: by none. */
umb_depth_place umb_image_of_part(const umb_raster_map *map, const umb_aabb *part,
                                  const umb_transform *transform, bool identity, umb_image_bounds *out);

/* The outer image of what the view can see of a triangle of world vertices, as the polygon it is:
 * face is the triangle's. It is cut at the near and far depths and at the raster's borders first.
 * CROSSING only where rounding leaves no image; the bounds are valid for BEYOND. */
umb_depth_place umb_outline_of_triangle(const umb_raster_map *map, const float corner[3][3],
                                        const umb_face *face, umb_outline *outline, umb_image_bounds *bounds);

#endif

/* What of an occluder is drawn: the boundary of its front, and its front triangles for depth.
 *
 * The front set F holds the triangles that certainly block as seen from the eye (facing it, or
 * two-sided), cut at the near depth. All are turned to project with one orientation, so the winding
 * number of the boundary of F about a raster point is the number of triangles of F over it, and
 * edges between two triangles of F cancel: no cracks, holes and folds included (Gummerus 5.5 fills
 * silhouettes of convex shapes; this is the same for any mesh). Leaving a triangle out of F is
 * always safe.
 */
#ifndef UMB_SILHOUETTE_H
#define UMB_SILHOUETTE_H

#include "plane.h"
#include "raster_map.h"
#include "scene/scene.h"

/* A directed boundary edge on the raster; multiplicity times, negative: the other way round. */
typedef struct umb_outline_edge {
    double x0, y0, x1, y1;
    double error; /* every point of it is within this of the true edge, in each coordinate */
    int32_t multiplicity;
} umb_outline_edge;

/* A front triangle, as the depth of what it covers needs it. */
typedef struct umb_front_triangle {
    uint32_t corner[3];
    umb_face face;
    double least;                     /* nearness of its farthest vertex, rounded away from the eye */
    float x_min, y_min, x_max, y_max; /* box of its image in pixels, outer */
} umb_front_triangle;

/* A front triangle made ready for depth. */
typedef struct umb_depth_triangle {
    /* Sides: ex x + ey y + e0 is below -margin only where the image of the triangle is not, for each side;
       above margin for all three only where it is. side_count 0: no use can be made of them. */
    double ex[3], ey[3], e0[3], margin[3];
    uint32_t side_count;
    /* Over the raster, nearness > max(gx x + gy y + g0, least) wherever the triangle (cut at the near
       depth) projects, but for a relative 2^-22 that the user of the plane takes off. */
    double gx, gy, g0;
    double least;
} umb_depth_triangle;

typedef struct umb_silhouette {
    umb_outline_edge *edges;
    umb_front_triangle *triangles;
    uint32_t edge_count, triangle_count;
    double x_min, y_min, x_max, y_max; /* box of the image, not clamped */
    double most; /* nearness of the nearest point that is kept, about */
    /* scratch, one per vertex or triangle of the largest mesh */
    umb_view_point *views;
    umb_raster_point *points;
    float (*world)[3];
    int8_t *sides;
    size_t capacity[6]; /* of edges, triangles, views, points, world, sides */
    double cut_depth;   /* W before which all is cut away: near_cut, plus rounding */
} umb_silhouette;

/* Make room for every mesh up to these sizes. */
bool umb_silhouette_reserve(umb_silhouette *s, const umb_allocator *a, uint32_t vertices,
                            uint32_t triangles, uint32_t edges);
void umb_silhouette_free(umb_silhouette *s, const umb_allocator *a);

/* Find the silhouette of an occluder; false if nothing of it can cover a pixel. */
bool umb_silhouette_find(umb_silhouette *s, const umb_raster_map *map, const umb_occluder *occluder);

/* Make a front triangle of the silhouette found last ready for depth. */
void umb_silhouette_depth(const umb_silhouette *s, const umb_raster_map *map, const umb_front_triangle *front,
                          umb_depth_triangle *out);

#endif

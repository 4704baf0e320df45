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

/* A directed boundary edge on the raster, from its upper end to its lower one. */
typedef struct umb_outline_edge {
    double x_top, y_min, x_low, y_max;
    double slope; /* x per height; 0 if it is flat, and a row takes all of it */
    double error; /* every point of it is within this of the true edge, in each coordinate, interpolation
                     included */
    int32_t count; /* crossing it from left to right changes the winding number by this */
    bool flat;
    uint16_t row1; /* last row of tiles that it may touch */
    uint32_t next; /* in the list of its first row of tiles */
} umb_outline_edge;

/* A front triangle, in floats, rounding included. */
typedef struct umb_front_triangle {
    /* Sides: ex x + ey y + most is below 0 only where the image of the triangle is not, for each side;
       with least in place of most it is above 0 for all three only where the triangle is. */
    float ex[3], ey[3], most[3], least[3];
    float gx, gy, low; /* nearness is at least gx x + gy y + low where the triangle projects, */
    float far_corner;  /* and at least this */
    uint16_t tx0, tx1, ty1; /* tiles that its image meets */
    bool sided;    /* the sides are known */
    uint32_t next; /* in the list of its first row of tiles */
} umb_front_triangle;

enum { UMB_SILHOUETTE_ARRAYS = 13 };

typedef struct umb_silhouette {
    /* Vertices, one array a coordinate, padded to whole vectors with copies of the last: relative to the
       eye; on the raster, and the error of each of both; W; nearness rounded away from the eye by more than its
       error, and towards it. Those with W below cut_depth are not on the raster. */
    double *d[3], *x, *y, *off, *w, *near_least, *near_most;
    uint32_t vertex_count, padded_count;
    double error;       /* the greatest of off, and of cuts */
    double near_size;   /* largest absolute nearness */
    double cut_depth;   /* W before which all is cut away: near_cut, plus rounding */
    double reach;       /* largest sum of absolute components of d */
    bool cut, any;      /* some vertex is cut away; some is not */
    double x_min, y_min, x_max, y_max; /* of what is on the raster's plane, computed coordinates */
    double most;        /* nearness of the nearest point that is kept, rounded towards the eye */
    double far_corner;  /* and of the farthest vertex, rounded away from it */

    int8_t *sides; /* per triangle: +1 blocks, corners counter-clockwise as seen; -1 blocks, clockwise; 0 not */
    uint32_t *front; /* the triangles that block and are not cut away */
    umb_outline_edge *edges;
    umb_front_triangle *triangles;
    uint32_t front_count, edge_count, triangle_count;
    size_t capacity[UMB_SILHOUETTE_ARRAYS];
} umb_silhouette;

/* Make room for every mesh up to these sizes. */
bool umb_silhouette_reserve(umb_silhouette *s, const umb_allocator *a, uint32_t vertices,
                            uint32_t triangles, uint32_t edges);
void umb_silhouette_free(umb_silhouette *s, const umb_allocator *a);

/* Find the outline of an occluder whose vertices are placed (raster_kernels.h); false if nothing of it can cover
 * a pixel. */
bool umb_silhouette_find(umb_silhouette *s, const umb_raster_map *map, const umb_occluder *occluder);

/* Images of fewer pixels than this take one depth, their farthest corner's. */
#define UMB_PLANE_PIXELS 128.0

/* An affine function of the raster. */
typedef struct umb_silhouette_plane {
    double gx, gy, low; /* nearness is at least gx x + gy y + low over a triangle */
    double far_corner;  /* and at least this */
} umb_silhouette_plane;

/* The least and the greatest of near_least - (gx x + gy y) at a triangle's corners, none of them cut away. */
void umb_silhouette_offsets(const umb_silhouette *s, const umb_silhouette_plane *p, const uint32_t corner[3],
                            double *least, double *most);
/* How much gx x + gy y may be off at vertices that are off by error. */
double umb_silhouette_plane_error(const umb_silhouette *s, const umb_silhouette_plane *p, double error);
/* The plane of a triangle as the raster has it: the affine function through its computed corners, whatever
 * their errors, lowered until it is nowhere above the nearness of the true ones; both are affine over the
 * triangle's image, so that holds between corners too. Cut triangles: from the world. */
void umb_silhouette_plane_of(const umb_silhouette *s, const umb_raster_map *map, const umb_occluder *o,
                             uint32_t triangle, umb_silhouette_plane *out);
/* True if a triangle is not cut and lies in a plane as good as exactly: the plane is then lowered by what the
 * triangle needs. */
bool umb_silhouette_shares_plane(const umb_silhouette *s, umb_silhouette_plane *p, const uint32_t corner[3]);

/* A plane in floats: five roundings of terms whose sizes over the raster add up to size, 8 units taken off. */
void umb_silhouette_set_plane(umb_front_triangle *t, const umb_raster_map *map, const umb_silhouette_plane *p);
/* Make the triangles of the front ready for depth: triangles[], next: the first row of tiles. */
void umb_silhouette_depths(umb_silhouette *s, const umb_raster_map *map, const umb_occluder *o);

#endif

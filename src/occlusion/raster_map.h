/* The map from the world to the raster, and how far its evaluation may be off.
 *
 * With d = p - eye:  X = x.d, Y = y.d, W = w.d
 *   perspective   pixel = (X / W + cx, Y / W + cy)      nearness = 1 / W
 *   parallel      pixel = (X + cx, Y + cy)              nearness = -W
 *
 * x and y are in pixels (y grows downwards), w is the view's forward. The coefficients are taken as
 * they are: any invertible rows make a valid raster, because planes through the eye are lines on it
 * and W orders the points of a sight-line. So only the evaluation has an error
 * (docs/conservative.md, 3).
 */
#ifndef UMB_RASTER_MAP_H
#define UMB_RASTER_MAP_H

#include "geometry/vec.h"
#include "umbrage/view.h"

/* 2^-53: half a unit in the last place of 1.0. */
#define UMB_U 0x1p-53

typedef struct umb_raster_map {
    umb_vec3 eye, x, y, w;
    double cx, cy;
    double scale;      /* greatest absolute component of x and y */
    double near_depth, far_depth;
    umb_vec3 ray_x, ray_y, ray_0; /* the direction with W = 1 (parallel: the offset with W = 0)
                                     through pixel (i, j): ray_0 + i ray_x + j ray_y */
    umb_vec3 ray_w; /* parallel views: the step along a sight-line that adds 1 to W */
    double ray_size;   /* bound of that direction's sum of absolute components over the raster */
    int turn;          /* +1 if (x, y, w) is right-handed: the sign that makes windings positive */
    bool orthographic;
    uint32_t width, height;
} umb_raster_map;

/* Lay a raster over a view. The raster reaches a little beyond the frustum (2^-31 of its largest
 * slope), so that rounding never leaves a part of the frustum without a pixel. */
void umb_raster_map_prepare(umb_raster_map *map, const umb_view *view);

/* A point on the raster. error bounds the distance to the true image in each coordinate; reach is
 * the sum of absolute components of d. */
typedef struct umb_raster_point {
    double x, y, w;
    double error, reach;
} umb_raster_point;

/* d, X, Y, W of a world point; nothing is divided yet. */
typedef struct umb_view_point {
    double x, y, w, reach;
} umb_view_point;

static inline umb_view_point umb_raster_map_point(const umb_raster_map *m, const float p[3])
{
    umb_vec3 d = {p[0] - m->eye.x, p[1] - m->eye.y, p[2] - m->eye.z};
    umb_view_point v;
    v.x = umb_vec3_dot(m->x, d);
    v.y = umb_vec3_dot(m->y, d);
    v.w = umb_vec3_dot(m->w, d);
    v.reach = umb_vec3_sum_abs(d);
    return v;
}

/* Divide. v.w is at least the near depth in perspective. slack is the number of units 2^-53 that
 * each of x, y, w may be off, relative to scale * reach (w: reach); 5 for a vertex, more for cut
 * points.
 *
 * Perspective, with a = |X/W|: |fl - true| <= slack u (reach/W)(scale + a) + 3u (a + |cx|) and the same for
 * y; the factor 2 below also covers 1/(1 - slack u reach/W), as long as that quotient is below 1/2, which
 * the caller ensures by near_depth > 2^-20 reach or else rejects through a large error. */
static inline umb_raster_point umb_raster_map_project(const umb_raster_map *m, umb_view_point v,
                                                      double slack)
{
    umb_raster_point p;
    p.w = v.w;
    p.reach = v.reach;
    if (m->orthographic) {
        p.x = v.x + m->cx;
        p.y = v.y + m->cy;
        p.error = 2.0 * UMB_U * (slack * m->scale * v.reach + fabs(p.x) + fabs(p.y));
        return p;
    }
    double r = 1.0 / v.w;
    double ax = v.x * r, ay = v.y * r;
    p.x = ax + m->cx;
    p.y = ay + m->cy;
    double a = fabs(ax) + fabs(ay);
    p.error = 2.0 * UMB_U * (slack * (v.reach * r) * (m->scale + a) +
                             4.0 * (a + fabs(m->cx) + fabs(m->cy)));
    return p;
}

#endif

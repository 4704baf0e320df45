/* The map from the world to the raster, and how far its evaluation may be off.
 *
 * With d = p - eye:  X = x.d, Y = y.d, W = w.d
 *   perspective   (X / W + cx, Y / W + cy)      nearness = 1 / W
 *   parallel      (X + cx, Y + cy)              nearness = -W
 *
 * x counts pixels to the right, y heights downwards; the pixel row of a height comes from the table below.
 * The coefficients are taken as they are: any invertible rows make a valid raster, because planes through
 * the eye are lines on it and W orders the points of a sight-line. So only the evaluation has an error
 * (docs/conservative.md, 3).
 *
 * The raster is not the screen's. Where a perspective view knows the scene's vertical, the raster is
 * turned so that vertical lines stand upright in it, and its rows are dense at the horizon, where most
 * of what a view along the ground cannot tell apart lies:
 *
 *      view (rolled, pitched)          raster                    rows
 *          .-----.                  +-----------+            ------------
 *         /     /                   |  .----.   |            ------------
 *        /_ _ _/   horizon          |_/_ _ / _ _|            ============  half of them
 *       .-----.                     | '----'    |            ------------
 *
 * Then W is not the depth along the view's forward: near_cut, least_w and most_w say what the view's near and
 * far depths mean for W.
 */
#ifndef UMB_RASTER_MAP_H
#define UMB_RASTER_MAP_H

#include "geometry/vec.h"
#include "umbrage/view.h"

/* 2^-53: half a unit in the last place of 1.0. */
#define UMB_U 0x1p-53

/* The row of a height: row(y) = slope y + extra clamp(y - from, 0, span). The boundaries between rows are
 * a table of doubles, and what the table says is what a row is: row r holds heights edge[r] .. edge[r + 1].
 * The formula, in float or double, is off by less than slack rows from the table's. */
typedef struct umb_raster_rows {
    float slope, extra, from, span, slack;
    const double *edge; /* height + 1, then seven more of the last */
} umb_raster_rows;

typedef struct umb_raster_map {
    umb_vec3 eye, x, y, w;
    double cx, cy;
    double scale; /* greatest absolute component of x and y */
    double near_cut; /* an occluder's points with W from here on are not nearer than the view's near depth, on
                        sight-lines of the view */
    double least_w, most_w; /* what is in view has W between these */
    umb_vec3 ray_x, ray_y, ray_0; /* the direction with W = 1 (parallel: the offset with W = 0)
                                     through (i, j): ray_0 + i ray_x + j ray_y */
    umb_vec3 ray_w; /* parallel views: the step along a sight-line that adds 1 to W */
    double ray_size; /* bound of that direction's sum of absolute components over the raster */
    int turn;        /* +1 if (x, y, w) is right-handed: the sign that makes windings positive */
    int vertical_axis; /* 0..2: x and w have no component along it and y no other one; -1: no such axis */
    bool orthographic;
    uint32_t width, height;
    umb_raster_rows rows;
} umb_raster_map;

/* Doubles that the row table of a raster of this height takes. */
static inline size_t umb_raster_map_table(uint32_t height)
{
    return (size_t)height + 8;
}

/* The raster's size for a view. */
void umb_raster_map_size(const umb_view *view, uint32_t *width, uint32_t *height);

/* Lay a raster over a view. It reaches a little beyond the frustum (2^-31 of its largest slope), so that
 * rounding never leaves a part of the frustum without a pixel. scene: bounds of all there is, or NULL; they say where the
 * rows are best dense. table: room for umb_raster_map_table(height) doubles,
 * which the map points to from then on. */
void umb_raster_map_prepare(umb_raster_map *map, const umb_view *view, const umb_aabb *scene, double *table);

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

/* Divide. v.w is at least near_cut or least_w in perspective. slack is the number of units 2^-53 that
 * each of x, y, w may be off, relative to scale * reach (w: reach); 5 for a vertex, more for cut
 * points.
 *
 * Perspective, with a = |X/W|: |fl - true| <= slack u (reach/W)(scale + a) + 3u (a + |cx|) and the same for
 * y; the factor 2 below also covers 1/(1 - slack u reach/W), as long as that quotient is below 1/2, which
 * the caller ensures by W > 2^-20 reach or else rejects through a large error. */
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

/* The row of a height as the formula has it, within rows.slack of the table's; not cut to the raster. */
static inline double umb_raster_map_row(const umb_raster_map *m, double y)
{
    const umb_raster_rows *r = &m->rows;
    double into = y - r->from;
    into = into < 0.0 ? 0.0 : into > r->span ? r->span : into;
    return r->slope * y + r->extra * into;
}

/* The row that a height lies in, or the next one when it is within `widen` of a boundary on that side
 * (negative: above). Cut to the raster; any height. */
static inline int32_t umb_raster_map_row_at(const umb_raster_map *m, double y, double widen)
{
    y = y < 0.0 ? 0.0 : y > m->height ? (double)m->height : y;
    double row = umb_raster_map_row(m, y) + widen;
    int32_t last = (int32_t)m->height - 1;
    return row < 0.0 ? 0 : row >= last ? last : (int32_t)row;
}

#endif

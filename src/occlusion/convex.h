/* The image of a convex body on the raster: lines and planes.
 *
 *        \ left      / right      A pixel is covered when it lies wholly on the inner side of every line of
 *         \  ____  /            the silhouette. Seen from such a point all edges of the silhouette turn the
 *          \/    \/             same way round, so they wind around it, whatever the shape is: safe for any
 *          /      \             closed outline, and exact for convex ones.
 *         /        \
 *                                The same lines, moved out until no corner is beyond them, hold the image.
 *
 * In (x, y, nearness) a body in front of the eye is the convex hull of its corners, as it is in the world: so an
 * affine function that is no less than nearness at every corner is so on all of the body, and one that is no more at
 * the corners of a triangle is so on that triangle. */
#ifndef UMB_CONVEX_H
#define UMB_CONVEX_H

#include "silhouette.h"

enum {
    UMB_CONVEX_TRIANGLES = 32, /* a convex shape of more is drawn as any other */
    UMB_CONVEX_EDGES = 64
};

/* Lines x = slope y + at. in: covered from there on (left), or up to there (right). out: nothing of the body is
 * beyond. Errors included; in_at holds 2^-20 more, for rounding to whole pixels. */
typedef struct umb_convex_lines {
    double slope[UMB_CONVEX_EDGES], in_at[UMB_CONVEX_EDGES], out_at[UMB_CONVEX_EDGES];
    uint32_t count;
} umb_convex_lines;

typedef struct umb_convex {
    umb_convex_lines left, right;
    double x_min, x_max;  /* covered between these */
    uint32_t row0, row1;  /* and in these rows, ends included; row0 > row1: no pixel is covered */
    uint32_t edge_count;  /* of the silhouette */
    /* gx x + gy y + low: where a point of plane i covers, nearness is at least that, and at least least[i]. high:
       nearness of the body is nowhere more. Rounding of the evaluation in floats is included. */
    float gx[UMB_CONVEX_TRIANGLES], gy[UMB_CONVEX_TRIANGLES];
    float low[UMB_CONVEX_TRIANGLES], high[UMB_CONVEX_TRIANGLES];
    float least[UMB_CONVEX_TRIANGLES];
    uint32_t plane_count;
    float most; /* and nowhere more than this */
} umb_convex;

typedef enum umb_convex_result {
    UMB_CONVEX_NOTHING, /* covers no pixel; says nothing of where the body is */
    UMB_CONVEX_READY,
    UMB_CONVEX_OTHER /* near the eye or degenerate: draw it as any other mesh */
} umb_convex_result;

/* What the lines of a silhouette are told. */
typedef struct umb_convex_frame {
    double error;  /* of every corner, in each coordinate */
    double extent; /* greatest x less least x of all corners */
    double height; /* of the raster */
    double y_min, y_max; /* covered heights: narrowed by flat lines */
} umb_convex_frame;

/* Flatter lines than this are heights: between the least and the greatest x they rise by next to nothing. */
#define UMB_CONVEX_FLAT 0x1p-30

/* Add the line from one corner to the next, which has the body on its right hand (y grows downwards: going
 * down is a left border). It is moved inwards by the error of its ends and by what evaluating it at a height of
 * the raster may lose. False if it has no length. */
static inline bool umb_convex_add_line(umb_convex *c, umb_convex_frame *f, double x0, double y0, double x1,
                                       double y1)
{
    double dx = x1 - x0, dy = y1 - y0;
    if (dx == 0.0 && dy == 0.0) {
        return false;
    }
    c->edge_count += 1;
    if (fabs(dy) <= UMB_CONVEX_FLAT * fabs(dx)) {
        double low = y0 < y1 ? y0 : y1, high = y0 < y1 ? y1 : y0;
        double off = f->error + 2.0 * UMB_CONVEX_FLAT * f->extent + 0x1p-50 * (fabs(low) + fabs(high));
        if (dx < 0.0) {
            f->y_min = high + off > f->y_min ? high + off : f->y_min;
        } else {
            f->y_max = low - off < f->y_max ? low - off : f->y_max;
        }
        return true;
    }
    umb_convex_lines *lines = dy > 0.0 ? &c->left : &c->right;
    uint32_t i = lines->count++;
    double slope = dx / dy, at = x0 - slope * y0;
    double off = f->error * (1.0 + fabs(slope)) +
                 16.0 * UMB_U * (fabs(slope) * (f->height + fabs(y0)) + fabs(x0)) + 0x1p-20;
    lines->slope[i] = slope;
    lines->in_at[i] = dy > 0.0 ? at + off : at - off;
    lines->out_at[i] = dy > 0.0 ? at - off : at + off; /* a guess: umb_convex_hold() makes it right */
    return true;
}

/* Set the covered rows and columns once all lines are there. Columns within the raster; false if none or no
 * row is left. */
bool umb_convex_place(umb_convex *c, const umb_raster_map *map, const umb_convex_frame *f, double x_min,
                      double x_max);

/* An affine function of the raster as floats: low lowered and high raised by what rounding it, and evaluating
 * it, may lose. */
static inline void umb_convex_add_plane(umb_convex *c, const umb_raster_map *map, double gx, double gy,
                                        double low, double high, double least)
{
    uint32_t i = c->plane_count++;
    double size = fabs(gx) * (map->width + 32.0) + fabs(gy) * (map->height + 8.0);
    size += fabs(low) > fabs(high) ? fabs(low) : fabs(high);
    bool fits = size < 1e30;
    c->gx[i] = fits ? (float)gx : 0.0f;
    c->gy[i] = fits ? (float)gy : 0.0f;
    c->least[i] = (float)(least - 0x1p-22 * fabs(least));
    c->low[i] = fits ? (float)(low - 0x1p-21 * size) : c->least[i];
    c->high[i] = fits ? (float)(high + 0x1p-21 * size) : INFINITY;
}

/* A convex polygon on the raster, each true corner within error of the given one in each
 * coordinate, and its nearness: nowhere more than gx x + gy y + g0, nor than most. */
typedef struct umb_outline {
    double x[9], y[9];
    uint32_t count;
    double error;
    double gx, gy, g0, most;
} umb_outline;

/* The lines and the plane that hold a polygon: what umb_raster_kernels.hides_convex needs. */
void umb_convex_of_outline(const umb_outline *o, const umb_raster_map *map, umb_convex *out);

/* The covered part of a convex occluder that the near cut goes through, from its general silhouette. Of the
 * result only what umb_raster_kernels.fill_convex needs is there. */
umb_convex_result umb_convex_of_silhouette(const umb_silhouette *s, const umb_raster_map *map,
                                           const umb_occluder *o, umb_convex *out);

#endif

/* Shadows of occluders, as seen from one eye or along one direction: what every method that chooses its occluders first
 * knows of them (Hudson's shadow frusta, Bittner's occlusion tree; Gummerus 5.4).
 *
 * A front is a set of triangles that face the viewer, with its boundary, directed edges that have the triangles on one
 * side. In the picture, a place that is strictly inside of every edge of the boundary is covered by some triangle of the
 * front: every edge is seen from there turning the same way, so they turn about it once at least
 * (docs/conservative.md, 15). So the cross-section of the shadow is a convex polygon, whatever the front's shape:
 *
 *     \         /         inside of every edge, beyond every plane of the front's triangles:
 *      \#######/          hidden. Where an outline is not convex, the inside of all its edges is
 *       \_____/  front    only a part of it, or nothing: less is hidden, never more.
 *        \   /
 *         \ /
 *          * eye
 *
 * What the near plane cuts off hides nothing: a front that reaches nearer gets one more line for each of its planes,
 * beyond which that plane is not nearer.
 */
#ifndef UMB_SHADOWS_H
#define UMB_SHADOWS_H

#include <stddef.h>

#include "seen.h"
#include "umbrage/base.h"
#include "umbrage/view.h"

/* Fronts with more of either are not taken. */
#define UMB_SHADOW_LINES 64
#define UMB_SHADOW_PLANES 64

/* Who looks. */
typedef struct umb_shadow_viewer {
    umb_seen_from sight;
    double near_depth;   /* what hides has forward . (p - eye) at least this */
    bool cut;            /* false: it need not */
    bool framed;         /* nothing beyond the frame is in view */
    double ray;          /* framed: at least |d|_1 / forward . d for each direction d in the frame */
    umb_seen_line frame[4];        /* a frame around the view; parallel: around the whole scene */
    umb_seen_corner corners[4];
} umb_shadow_viewer;

/* The plane of a triangle that faces the viewer. */
typedef struct umb_shadow_plane {
    float a[3], b[3], c[3]; /* counter-clockwise as seen */
    umb_seen_vector n;     /* (c - a) x (b - a): away from the viewer */
    double h, h_off;        /* n . (a - eye) */
} umb_shadow_plane;

typedef struct umb_shadow {
    uint32_t source;                  /* of its front */
    uint32_t first_line, line_count;  /* inside of all of them it covers what is beyond its planes */
    uint32_t first_corner, corner_count; /* the polygon that these lines, and the frame where it is needed, bound */
    uint32_t first_plane, plane_count;
    double farthest; /* nothing of the front has forward . (p - eye) greater than this */
} umb_shadow;

typedef struct umb_shadows {
    umb_shadow_viewer viewer;
    umb_shadow *items;
    umb_seen_line *lines;
    umb_seen_corner *corners;
    umb_shadow_plane *planes;
    uint32_t count, line_count, corner_count, plane_count;
    size_t item_capacity, line_capacity, corner_capacity, plane_capacity;
} umb_shadows;

/* Triangles that block, all counter-clockwise as seen (two-sided ones that are seen from behind turned), and their
 * boundary: loops of vertices, one after the other, with the triangles on the left as seen. */
typedef struct umb_shadow_front {
    const float (*points)[3]; /* world */
    const uint32_t (*triangles)[3];
    const uint32_t (*edges)[2];
    uint32_t triangle_count, edge_count;
    uint32_t source;
} umb_shadow_front;

/* view: as given to the culler. reach: at least every coordinate of the scene. */
void umb_shadow_viewer_prepare(umb_shadow_viewer *v, const umb_view *view, double reach);

/* Room for fronts with so many edges and triangles in all. */
bool umb_shadows_reserve(umb_shadows *s, const umb_allocator *a, uint32_t fronts, uint32_t edges, uint32_t triangles);
void umb_shadows_free(umb_shadows *s, const umb_allocator *a);
void umb_shadows_clear(umb_shadows *s);

/* What became of a front. */
typedef enum umb_shadow_result {
    UMB_SHADOW_ADDED,
    UMB_SHADOW_NOTHING, /* it hides nothing that is in view, or what it hides cannot be told */
    UMB_SHADOW_CUT      /* whole only: it reaches nearer than the near depth */
} umb_shadow_result;

/* Add the shadow of a front, if there is room. The edges of a front that is a convex polygon of the picture come in the
 * order of its boundary; that is noticed, and kept exact. whole: not if the near plane cuts it (a body is then better
 * taken apart into its faces). */
umb_shadow_result umb_shadows_add(umb_shadows *s, const umb_shadow_front *front, bool whole);

/* n and h of the triangle, away from the viewer if a, b, c is counter-clockwise as seen. */
void umb_shadow_plane_of(const umb_seen_from *s, const float a[3], const float b[3], const float c[3],
                         umb_shadow_plane *out);
/* forward . (p - eye), and the bound of its error. */
double umb_shadow_depth(const umb_shadow_viewer *v, const float p[3], double *off);

#endif

/* What is asked about, as the viewer sees it: a convex polygon of the picture that holds it, and the planes of its near
 * side. */
#ifndef UMB_HULL_H
#define UMB_HULL_H

#include "shadows.h"
#include "umbrage/geometry.h"

enum { UMB_HULL_CORNERS = 6, UMB_HULL_POINTS = 8, UMB_HULL_FACES = 3 };

/* A face that looks at the viewer. */
typedef struct umb_hull_face {
    umb_shadow_plane plane;
    bool ready;      /* plane is known: umb_hull_face_plane() */
    uint8_t loop[4]; /* points around it, the way polygons run */
    uint8_t count;
} umb_hull_face;

/* Corners point to its own lines: a hull is not copied. */
typedef struct umb_hull {
    float points[UMB_HULL_POINTS][3];
    uint32_t point_count;
    umb_aabb bounds;   /* of the points */
    bool box;          /* the points are the corners of the bounds, in the order of umb_hull_of_box() */
    double nearest;    /* no point of it has forward . (p - eye) less than this */
    umb_seen_line lines[UMB_HULL_CORNERS];
    umb_seen_corner corners[UMB_HULL_CORNERS];
    uint32_t count; /* of corners */
    bool flat; /* the polygon has no width: faces are edges of it */
    umb_hull_face faces[UMB_HULL_FACES];
    uint32_t face_count;
} umb_hull;

/* False if the box is not wholly in front of the viewer, or holds it. Corner i is at the maximum along axis k if bit k of
 * i is set. */
bool umb_hull_of_box(umb_hull *h, const umb_shadow_viewer *v, const umb_aabb *box);
/* A box under a transform whose images are rounded to float: that body, and a little more. If its polygon cannot be
 * told: the box around it. */
bool umb_hull_of_turned_box(umb_hull *h, const umb_shadow_viewer *v, const umb_aabb *box, const umb_transform *t);
bool umb_hull_of_triangle(umb_hull *h, const umb_shadow_viewer *v, const float corners[3][3]);

/* The same bodies, their points and bounds alone. False if they have no finite corners. */
bool umb_hull_points_of_box(umb_hull *h, const umb_shadow_viewer *v, const umb_aabb *box);
bool umb_hull_points_of_turned_box(umb_hull *h, const umb_shadow_viewer *v, const umb_aabb *box, const umb_transform *t);
bool umb_hull_points_of_triangle(umb_hull *h, const umb_shadow_viewer *v, const float corners[3][3]);

const umb_shadow_plane *umb_hull_face_plane(umb_hull *h, const umb_shadow_viewer *v, uint32_t face);
/* The polygon of one of its faces; lines: room for four. */
uint32_t umb_hull_face_polygon(const umb_hull *h, const umb_shadow_viewer *v, uint32_t face, umb_seen_line lines[4],
                               umb_seen_corner corners[4]);

/* True if all of it is strictly beyond a plane. Exact. */
bool umb_hull_beyond(const umb_hull *h, const umb_shadow_plane *plane);

/* The linear function of q that is positive exactly where the plane of a face is strictly beyond another plane, at places
 * of the picture where the face is. */
void umb_hull_depth(const umb_seen_from *s, const umb_shadow_plane *face, const umb_shadow_plane *plane,
                    umb_seen_vector *out);

#endif

/* Bounding volumes against a view's frustum, one at a time: for programs that keep a hierarchy of their own, or volumes
 * that are no boxes. The culler needs none of this. (Gummerus 4.2 to 4.4; Assarsson and Möller 1999; Eberly 2000;
 * Hoff 1996.)
 *
 *     volume        the set of points
 *     box           box.min <= p <= box.max
 *     oriented box  center + t0 axis[0] + t1 axis[1] + t2 axis[2],   |ti| <= 1
 *     sphere        within radius of center
 *     capsule       within radius of the segment center + t0 axis[0],   |t0| <= 1
 *     lozenge       within radius of the parallelogram center + t0 axis[0] + t1 axis[1],   |ti| <= 1
 *     cylinder      center + t0 axis[0] + what lies at right angles to axis[0] within radius,   |t0| <= 1
 *     ellipsoid     center + t0 axis[0] + t1 axis[1] + t2 axis[2],   t0^2 + t1^2 + t2^2 <= 1
 *     hull          the convex hull of the points
 *
 * Axes carry half lengths and need not be at right angles. All numbers are taken as they are, in scene units.
 *
 * Safe direction, of every call here: OUTSIDE is a proof that no point of the volume is in the closed frustum, and
 * INSIDE one that all are, in real numbers and whatever rounding does; CROSSING says nothing. Volumes with numbers
 * that are not finite are CROSSING. Nothing allocates; everything may be called from any threads at once, as long
 * as no two write to the same memory. */
#ifndef UMBRAGE_BOUNDS_H
#define UMBRAGE_BOUNDS_H

#include "view.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum umb_place {
    UMB_PLACE_OUTSIDE = 0,
    UMB_PLACE_CROSSING = 1,
    UMB_PLACE_INSIDE = 2
} umb_place;

typedef enum umb_volume_kind {
    UMB_VOLUME_BOX = 0,
    UMB_VOLUME_ORIENTED_BOX = 1,
    UMB_VOLUME_SPHERE = 2,
    UMB_VOLUME_CAPSULE = 3,
    UMB_VOLUME_LOZENGE = 4,
    UMB_VOLUME_CYLINDER = 5,
    UMB_VOLUME_ELLIPSOID = 6,
    UMB_VOLUME_HULL = 7
} umb_volume_kind;

/* What a kind does not name above is not looked at. */
typedef struct umb_volume {
    umb_volume_kind kind;
    umb_aabb box;
    double center[3];
    double axis[3][3];
    double radius;         /* >= 0 */
    const float *points;   /* x, y, z of each; borrowed */
    uint32_t point_count;  /* 0: no point at all, which is OUTSIDE */
    uint32_t point_stride; /* bytes from one to the next; 0 means 12 */
} umb_volume;

/* A half-space of a frustum: g(p) = n.(p - eye) + c >= 0. */
typedef struct umb_bounds_plane {
    double n[3], c;
    double size;  /* at least |n[i]|, with what cancelled in it */
    double error; /* of c, and of anything too small for a double */
    double length; /* of n */
    double turn, shift, blur; /* since the frame before: the length of n's change at most; what g grew by at the
                                 old eye, and the bound of its error */
} umb_bounds_plane;

/* A view's frustum made ready. Members are the library's. */
typedef struct umb_bounds_frustum {
    double eye[3];
    double axis[3][3]; /* right, up, forward */
    double bound[6];   /* of the view: x, y, depth, lower and upper */
    uint32_t plane_count; /* left, right, bottom, top, near, far unless it is infinite, then the view's extra planes */
    umb_bounds_plane planes[6 + UMB_MAX_CLIP_PLANES];
    double corner[8][3];    /* relative to the eye: near ones, then far ones, or the ways to them if there is no far */
    double corner_error[8]; /* of each component */
    double edge[6][3];      /* directions of its edges */
    uint32_t edge_count;
    bool perspective, endless;
    bool follows;   /* the frame before is known */
    uint64_t frame; /* from 1 */
    double step;    /* how far the eye went since the frame before */
} umb_bounds_frustum;

/* Make *out for a view. before: the frustum of the last frame, for UMB_BOUNDS_MOTION; NULL: there was none. It may be
 * out itself. UMB_ERROR_ARGUMENT if the view breaks its rules (umb_view_check); *out is then as it was. */
UMB_API umb_result umb_bounds_prepare(umb_bounds_frustum *out, const umb_view *view,
                                      const umb_bounds_frustum *before);

/* The planes one by one: OUTSIDE if the volume is wholly beyond one of them. What is beside a corner or an edge of the
 * frustum, beyond none of its planes, is CROSSING. (Hoff's corner farthest along a plane's normal for boxes; Eberly's
 * projected radius for all others; Gummerus 4.2.) */
UMB_API umb_place umb_bounds_test(const umb_bounds_frustum *f, const umb_volume *v);

/* The same, and for boxes of both kinds all of Hoff's special cases too: OUTSIDE whenever the box has no point in
 * common with the frustum of the view's own six planes, up to rounding; extra planes are tested one by one. He
 * looks for an edge of the frustum that pierces the box, an edge of the box that pierces the frustum, and one
 * within the other; here the same question is answered by the direction that separates them, which is a proof. */
UMB_API umb_place umb_bounds_test_exact(const umb_bounds_frustum *f, const umb_volume *v);

/* Ways to save work (Assarsson and Möller; Gummerus 4.4), as bits. Masking needs none: hand planes down. */
typedef enum umb_bounds_switch {
    UMB_BOUNDS_PLANE = 1u << 0,  /* plane coherency: begin with the plane that the volume was outside of last */
    UMB_BOUNDS_OCTANT = 1u << 1, /* first the sphere around it: planes that it is inside of, three of the six for
                                    most, need no test of the volume (the octant test, for any frustum) */
    UMB_BOUNDS_MOTION = 1u << 2  /* TR coherency, for any motion: where the frustum's planes have turned and moved
                                    too little since the last frame to change the answer, the volume is not looked at */
} umb_bounds_switch;

/* What is remembered of one volume from frame to frame. Zero it at first, and when the volume changes. */
typedef struct umb_bounds_past {
    uint64_t frame; /* that the next two are of; 0: none */
    double extreme; /* of g: the most where it was outside, else the least of all planes where it was inside */
    double reach;   /* its farthest point's distance from the eye, at most */
    uint8_t plane;  /* that it was outside of, plus one; 0: none */
} umb_bounds_past;

/* umb_bounds_test() with switches.
 *   past    this volume's; NULL: nothing is remembered
 *   planes  in: a bit for each plane to test (masking: what the parent's test left); out: those that the volume crosses,
 *           for its children; NULL: all planes
 * Which planes are named and what is remembered change the work alone, as long as planes left out are planes that
 * the volume is inside of. Within the bound of rounding an answer may be CROSSING where umb_bounds_test() is sure, and the
 * other way round; each is a proof. */
UMB_API umb_place umb_bounds_test_again(const umb_bounds_frustum *f, const umb_volume *v, uint32_t switches,
                                        umb_bounds_past *past, uint16_t *planes);

/* The frusta for many volumes of one shape and orientation (Assarsson and Möller's outer and inner frusta): the
 * volume's reference point, its center, or the origin of a hull or box, is outside of the outer one, or inside of the
 * inner one, when the volume is. */
typedef struct umb_bounds_swept {
    double eye[3];
    uint32_t plane_count;
    umb_bounds_plane planes[6 + UMB_MAX_CLIP_PLANES];
    double outer[6 + UMB_MAX_CLIP_PLANES], inner[6 + UMB_MAX_CLIP_PLANES]; /* in place of c */
    bool empty;
} umb_bounds_swept;

/* Sweep a volume along the planes of a frustum. */
UMB_API void umb_bounds_sweep(umb_bounds_swept *out, const umb_bounds_frustum *f, const umb_volume *v);
/* The place of the volume moved so that its reference point is `at`. Costs the same for every kind. */
UMB_API umb_place umb_bounds_test_point(const umb_bounds_swept *s, const double at[3]);

#ifdef __cplusplus
}
#endif
#endif

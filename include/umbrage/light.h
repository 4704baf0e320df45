/* Views for lights and other convex frusta: from planes, a spot light, a face of a cube map,
 * the sun's part of a camera's frustum.
 *
 * Each call makes an umb_view that may be changed further and given to umb_cull() like any
 * other. Safe direction: the view's closed frustum holds every point of the volume that is
 * asked for, in real numbers, whatever rounding does to its members; it may be larger. Nothing
 * is allocated. The picture's sizes, thresholds and time of *out are zeroed; on an error *out
 * is left as it was, and error, unless NULL, says why. The view's vertical is an `up` that is
 * given (sun: the camera's vertical), else unknown: set it afterwards where it is known.
 *
 * For shadows: an object that is hidden from the light casts no shadow of its own. What hides
 * it may lie outside the extra planes of a view; with the views of spot, cube and sun it does
 * not, but for rounding, because these volumes hold with a point the way from there to the
 * light, up to the near plane. */
#ifndef UMBRAGE_LIGHT_H
#define UMBRAGE_LIGHT_H

#include "view.h"

#ifdef __cplusplus
extern "C" {
#endif

#define UMB_MAX_VOLUME_PLANES 16

typedef struct umb_volume_def {
    /* Half-spaces, inside where p[0]x + p[1]y + p[2]z + p[3] >= 0, of any length. What they have in
       common must be bounded. */
    const double (*planes)[4];
    uint32_t plane_count; /* 4 to UMB_MAX_VOLUME_PLANES */
    umb_projection projection;
    double eye[3];     /* perspective: where the lines meet. Parallel: not used */
    double forward[3]; /* parallel: where lines run. Perspective: the view's axis; zero: chosen */
    double up[3];      /* zero: chosen */
} umb_volume_def;

/* The smallest view along its axes that holds a polyhedron. Axes that are left open become
 * those, among a few that planes suggest, with the smallest frustum. Planes that cut something
 * off the view's own six sides become its extra planes, bit for bit; if more than
 * UMB_MAX_CLIP_PLANES do, those that cut deepest. A parallel view's eye is put near the middle
 * of its near rectangle. Errors: UMB_ERROR_ARGUMENT for what is not finite, for polyhedra that
 * are empty or not bounded, and in perspective for those that are not wholly in front of the
 * eye: give a near plane. Cost: grows with the cube of plane_count; some microseconds for 6
 * planes, the better part of a millisecond for 16. */
UMB_API umb_result umb_view_from_volume(umb_view *out, const umb_volume_def *def, umb_error *error);

typedef struct umb_spot_def {
    double eye[3];
    double direction[3]; /* of the cone's axis, any length */
    double up[3];        /* zero: chosen */
    double angle;        /* the whole cone's, radians, above 0, below pi by at least 1e-5 */
    double near_depth;   /* along the axis, above 0 */
    double range;        /* how far from the eye the light reaches, above near_depth */
} umb_spot_def;

/* A spot light's cone: all points within angle / 2 of the axis, at depth near_depth or more, at
 * most range from the eye. The view is the pyramid around it, with four extra planes that make
 * its section an octagon. Errors: UMB_ERROR_ARGUMENT for what the comments above exclude. */
UMB_API umb_result umb_view_spot(umb_view *out, const umb_spot_def *def, umb_error *error);

/* In the order of OpenGL, Vulkan and Direct3D. */
typedef enum umb_cube_face {
    UMB_CUBE_POSITIVE_X = 0,
    UMB_CUBE_NEGATIVE_X = 1,
    UMB_CUBE_POSITIVE_Y = 2,
    UMB_CUBE_NEGATIVE_Y = 3,
    UMB_CUBE_POSITIVE_Z = 4,
    UMB_CUBE_NEGATIVE_Z = 5
} umb_cube_face;

/* One face of a cube map around a point light. Axes and slopes are whole numbers, so the six
 * closed frusta hold every p with near_depth <= max |p[i] - eye[i]| <= far_depth, without any
 * gap, and share no more than their borders. Seen from inside, right is the face's s axis and
 * up is against its t axis. far_depth may be INFINITY. Errors: UMB_ERROR_ARGUMENT. */
UMB_API umb_result umb_view_cube_face(umb_view *out, const double eye[3], umb_cube_face face,
                                      double near_depth, double far_depth, umb_error *error);

typedef struct umb_sun_def {
    const umb_view *camera; /* whose picture the shadows fall in; either projection */
    /* The slice of the camera's frustum between these depths, cut to its own. Both 0: all of
     * it; the camera's far must then be finite. */
    double slice_near, slice_far;
    double direction[3]; /* in which the light travels, any length */
    double up[3];        /* zero: chosen for the smallest rectangle */
    double reach;        /* how far towards the light things cast into the slice from; 0 or more */
} umb_sun_def;

/* A parallel view along the light that holds the slice and all that casts into it: every point
 * from which a step of at most `reach` along the light leads into the slice. Extra planes trim
 * it to the slice swept towards the light: the sides of the slice that the light leaves
 * through, and planes along the light through the edges of its outline. The camera's own extra
 * planes that the light leaves through are kept too while there is room. The eye is the
 * camera's; near_depth may be negative. Errors: UMB_ERROR_ARGUMENT for a camera that
 * umb_view_check() refuses, an empty or endless slice. */
UMB_API umb_result umb_view_sun(umb_view *out, const umb_sun_def *def, umb_error *error);

#ifdef __cplusplus
}
#endif
#endif

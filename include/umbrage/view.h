/* A view: one frame's question. Eye, directions, projection, sizes, thresholds.
 *
 *            forward
 *               ^        perspective: a point p with d = p - eye is in view when
 *   left  \     |     /  right        near_depth <= d.forward <= far_depth
 *          \    |    /                x_min <= d.right / d.forward <= x_max
 *           \   |   /                 y_min <= d.up    / d.forward <= y_max
 *            \  |  /     orthographic: the same without the division by d.forward.
 *              eye
 *
 * The frustum is closed. All members are doubles: the library works with them as they are, so that
 * a view has no rounding of its own. Besides the rules at the members: no number is larger than
 * 1e30 (but for an infinite far), ranges are at least 1e-30 wide and 1e-12 of their ends' size.
 */
#ifndef UMBRAGE_VIEW_H
#define UMBRAGE_VIEW_H

#include "geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum umb_projection {
    UMB_PERSPECTIVE = 0,
    UMB_ORTHOGRAPHIC = 1
} umb_projection;

#define UMB_MAX_CLIP_PLANES 10

typedef struct umb_view {
    double eye[3];
    /* Unit vectors at right angles, to within 1e-6. right x up points at the viewer or away: both
       handednesses are fine. */
    double right[3], up[3], forward[3];
    /* The scene's vertical, where gravity points or away from it, of any length; zero: unknown. It changes
       how tight an answer is, never whether it is right: with it, the raster of a perspective view stands
       upright whatever the roll and pitch, and most of its rows are at the horizon. */
    double vertical[3];
    umb_projection projection;
    /* Perspective: slopes at depth 1. Orthographic: distances. x_min < x_max, y_min < y_max. */
    double x_min, x_max, y_min, y_max;
    double near_depth, far_depth; /* along forward. Perspective: 0 < near < far; far may be INFINITY */
    uint32_t width, height;  /* the picture in pixels; both 0: 1024 x 512. Used by min_pixels only */
    uint32_t buffer_width, buffer_height; /* the method's own raster; both 0: 1024 x 288. At most 8192 */
    /* Contribution culling (Gummerus 2: step five of the pipeline). An object whose bounds cover fewer
       than this many picture pixels both ways is not reported. 0: off. More than 0 makes the answer
       approximate. */
    double min_pixels;
    /* Extra half-spaces that cut the frustum: inside where p[0]x + p[1]y + p[2]z + p[3] >= 0. With them
       any convex frustum can be said. What lies outside is not in view; it may still hide. */
    uint32_t plane_count;
    double planes[UMB_MAX_CLIP_PLANES][4];
    double time; /* seconds, finite: objects that move by themselves are seen where they are then (motion.h) */
    /* Layers: the view is of objects and occluders whose mask (umb_object_def.mask) shares a bit with this one, or with
       mask_all has all of its bits; 0: of all. What is left out is never reported, and hides nothing: nothing is hidden that
       could be seen if it were not there. With masked_hide it hides as ever, for those who ask about one layer of what
       is all drawn: answers are then those of the view without a mask, less what is left out. */
    uint32_t mask;
    bool mask_all, masked_hide;
} umb_view;

/* Conventions of a matrix that umb_view_from_matrix() is given. */
typedef enum umb_depth_range {
    UMB_DEPTH_MINUS_ONE_TO_ONE = 0, /* OpenGL */
    UMB_DEPTH_ZERO_TO_ONE = 1,      /* Direct3D, Vulkan */
    UMB_DEPTH_ONE_TO_ZERO = 2       /* reversed */
} umb_depth_range;

typedef struct umb_matrix_def {
    double m[16];        /* clip = M * (x, y, z, 1), stored row by row */
    umb_depth_range depth_range;
    bool column_major;   /* m is stored column by column */
    bool y_down;         /* clip y grows downwards (Vulkan) */
} umb_matrix_def;

/* Look from eye at target. fov_y: full vertical angle in radians, in (0, pi). aspect: width /
 * height. Where the direction runs along up (squared sine of the angle at most 1e-12) the axis
 * after up's largest component takes up's place (x, y, z, x). up becomes the view's vertical. Errors: UMB_ERROR_ARGUMENT for
 * non-finite input, eye equal to target, impossible angles or depths. The sizes, thresholds and
 * planes of *out are zeroed. */
UMB_API umb_result umb_view_look_at(umb_view *out, const double eye[3], const double target[3],
                                    const double up[3], double fov_y, double aspect, double near_depth,
                                    double far_depth);
/* The same with parallel lines; height is the full height of the view in scene units. near may be
 * zero or negative. */
UMB_API umb_result umb_view_look_at_ortho(umb_view *out, const double eye[3], const double target[3],
                                          const double up[3], double height, double aspect, double near_depth,
                                          double far_depth);
/* Recover a view from a projection * view matrix after Gribb and Hartmann (Gummerus 4.1): either
 * handedness, any depth range, reversed or infinite, off-centre, perspective or parallel. Matrices
 * with shear between depth and the picture (oblique near planes), NaN or no inverse are
 * UMB_ERROR_ARGUMENT. Clip w must grow away from the eye. A parallel view's eye is put in the
 * middle of its near rectangle, and its near_depth is 0. */
UMB_API umb_result umb_view_from_matrix(umb_view *out, const umb_matrix_def *def);
/* UMB_OK when the view obeys every rule written above; else UMB_ERROR_ARGUMENT, with text when
 * error is not NULL. Every call that takes a view checks it so. */
UMB_API umb_result umb_view_check(const umb_view *view, umb_error *error);

/* Six frustum planes and the extra ones, unit normals pointing inwards, in the order left, right,
 * bottom, top, near, far (left out when infinite), extra. Returns how many (at most 16). */
UMB_API uint32_t umb_view_planes(const umb_view *view, double planes[16][4]);

#ifdef __cplusplus
}
#endif
#endif

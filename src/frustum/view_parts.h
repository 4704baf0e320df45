/* What the makers of views for lights and volumes share. */
#ifndef UMB_VIEW_PARTS_H
#define UMB_VIEW_PARTS_H

#include "geometry/vec.h"
#include "umbrage/view.h"

/* Zero *out and set its axes: forward along direction (any length), up as near to `up` as can
 * be; a zero `up` stands for the coordinate axis farthest from direction, and leaves the
 * vertical unknown, which else is up. Axes have unit length, and forward is within 8 units 2^-53 of the true direction. UMB_ERROR_ARGUMENT for
 * what has no direction. */
umb_result umb_view_aim(umb_view *out, const double direction[3], const double up[3]);

/* Half-spaces of the form p.n + c >= 0 become the extra planes of a view whose six sides are
 * finite and complete: those that cut something off it, deepest first where there are too many.
 * All are taken bit for bit or left out: the view is never smaller than what both say. */
void umb_view_trim(umb_view *view, const double (*planes)[4], uint32_t count);

/* The half-space n.(p - eye) + c >= 0 as n.p + out[3] >= 0, moved outwards by what rounding may
 * be off. */
void umb_plane_from_eye(double out[4], umb_vec3 n, double c, const double eye[3]);

#endif

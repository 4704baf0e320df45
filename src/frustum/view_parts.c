#include "view_parts.h"

#define U 0x1p-53
/* A plane that takes less than this part of the view's size off it is one of its sides. */
#define SHALLOW 1e-9

umb_result umb_view_aim(umb_view *out, const double direction[3], const double up[3])
{
    static const double origin[3] = {0.0, 0.0, 0.0};
    double d[3], stand_in[3] = {0.0, 0.0, 0.0};
    double largest = fmax(fabs(direction[0]), fmax(fabs(direction[1]), fabs(direction[2])));
    if (!(largest > 0.0) || !isfinite(largest)) {
        return UMB_ERROR_ARGUMENT;
    }
    int least = 0;
    for (int i = 0; i < 3; ++i) {
        d[i] = direction[i] / largest;
        least = fabs(d[i]) < fabs(d[least]) ? i : least;
    }
    stand_in[least] = 1.0;
    bool chosen = up[0] == 0.0 && up[1] == 0.0 && up[2] == 0.0;
    umb_result result = umb_view_look_at_ortho(out, origin, d, chosen ? stand_in : up, 2.0, 1.0,
                                               0.0, 1.0);
    if (result == UMB_OK) {
        for (int i = 0; i < 3 && chosen; ++i) {
            out->vertical[i] = 0.0;
        }
    }
    return result;
}

/* The corner of the six sides with bits x, y, z of k set where the greater bound is meant,
 * relative to the eye. The axes are at right angles to within 1e-6, which is enough for a
 * choice. */
static umb_vec3 view_corner(const umb_view *v, int k)
{
    double z = (k & 4) != 0 ? v->far_depth : v->near_depth;
    double scale = v->projection == UMB_PERSPECTIVE ? z : 1.0;
    double x = scale * ((k & 1) != 0 ? v->x_max : v->x_min);
    double y = scale * ((k & 2) != 0 ? v->y_max : v->y_min);
    umb_vec3 d = umb_vec3_scale(umb_vec3_from_double(v->right), x);
    d = umb_vec3_add(d, umb_vec3_scale(umb_vec3_from_double(v->up), y));
    return umb_vec3_add(d, umb_vec3_scale(umb_vec3_from_double(v->forward), z));
}

/* How far beyond the plane the farthest corner of the six sides lies, over the size of the view. */
static double cut_depth(const umb_view *v, const double plane[4])
{
    umb_vec3 n = umb_vec3_from_double(plane);
    double at_eye = umb_vec3_dot(n, umb_vec3_from_double(v->eye)) + plane[3];
    double deepest = 0.0, size = 0.0;
    for (int k = 0; k < 8; ++k) {
        umb_vec3 d = view_corner(v, k);
        deepest = fmax(deepest, -(umb_vec3_dot(n, d) + at_eye));
        size = fmax(size, umb_vec3_length(d));
    }
    return deepest / (umb_vec3_length(n) * size);
}

void umb_view_trim(umb_view *view, const double (*planes)[4], uint32_t count)
{
    double depths[UMB_MAX_CLIP_PLANES];
    view->plane_count = 0;
    for (uint32_t i = 0; i < count; ++i) {
        double depth = cut_depth(view, planes[i]);
        if (!(depth > SHALLOW)) {
            continue;
        }
        uint32_t at = view->plane_count;
        if (at == UMB_MAX_CLIP_PLANES) {
            at = 0;
            for (uint32_t k = 1; k < UMB_MAX_CLIP_PLANES; ++k) {
                at = depths[k] < depths[at] ? k : at;
            }
            if (!(depth > depths[at])) {
                continue;
            }
        } else {
            view->plane_count++;
        }
        depths[at] = depth;
        for (int k = 0; k < 4; ++k) {
            view->planes[at][k] = planes[i][k];
        }
    }
}

/* Three products and three sums lose at most 4 units of the terms' sizes. */
void umb_plane_from_eye(double out[4], umb_vec3 n, double c, const double eye[3])
{
    umb_vec3 e = umb_vec3_from_double(eye);
    double size = fabs(n.x * e.x) + fabs(n.y * e.y) + fabs(n.z * e.z) + fabs(c);
    out[0] = n.x;
    out[1] = n.y;
    out[2] = n.z;
    out[3] = c - umb_vec3_dot(n, e) + 8.0 * U * size;
}

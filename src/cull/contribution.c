#include "contribution.h"

#include "geometry/vec.h"

bool umb_contribution_small(const umb_view *v, const umb_aabb *box)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int k = 0; k < 8; ++k) {
        umb_vec3 d = {(k & 1 ? box->max[0] : box->min[0]) - v->eye[0],
                      (k & 2 ? box->max[1] : box->min[1]) - v->eye[1],
                      (k & 4 ? box->max[2] : box->min[2]) - v->eye[2]};
        double depth = umb_vec3_dot(umb_vec3_from_double(v->forward), d);
        if (v->projection == UMB_PERSPECTIVE && !(depth > 0.0)) {
            return false;
        }
        double scale = v->projection == UMB_PERSPECTIVE ? 1.0 / depth : 1.0;
        const double at[2] = {umb_vec3_dot(umb_vec3_from_double(v->right), d) * scale,
                              umb_vec3_dot(umb_vec3_from_double(v->up), d) * scale};
        for (int i = 0; i < 2; ++i) {
            low[i] = at[i] < low[i] ? at[i] : low[i];
            high[i] = at[i] > high[i] ? at[i] : high[i];
        }
    }
    double width = v->width != 0 ? v->width : 1024.0, height = v->height != 0 ? v->height : 512.0;
    return (high[0] - low[0]) * width < v->min_pixels * (v->x_max - v->x_min) &&
           (high[1] - low[1]) * height < v->min_pixels * (v->y_max - v->y_min);
}

bool umb_contribution_small_slot(const umb_view *view, const umb_node *node, uint32_t slot)
{
    umb_aabb box;
    for (int i = 0; i < 3; ++i) {
        box.min[i] = node->min[i][slot];
        box.max[i] = node->max[i][slot];
    }
    return umb_contribution_small(view, &box);
}

#include "raster_map.h"

#define DEFAULT_WIDTH 1024
#define DEFAULT_HEIGHT 288

static umb_vec3 combine(umb_vec3 a, double s, umb_vec3 b, double t, umb_vec3 c)
{
    return umb_vec3_add(c, umb_vec3_add(umb_vec3_scale(a, s), umb_vec3_scale(b, t)));
}

void umb_raster_map_prepare(umb_raster_map *map, const umb_view *view)
{
    map->width = view->buffer_width != 0 ? view->buffer_width : DEFAULT_WIDTH;
    map->height = view->buffer_height != 0 ? view->buffer_height : DEFAULT_HEIGHT;
    map->orthographic = view->projection == UMB_ORTHOGRAPHIC;
    map->near_depth = view->near_depth;
    map->far_depth = view->far_depth;
    map->eye = umb_vec3_from_double(view->eye);
    map->w = umb_vec3_from_double(view->forward);

    double x_pad = 0x1p-31 * (fabs(view->x_min) + fabs(view->x_max));
    double y_pad = 0x1p-31 * (fabs(view->y_min) + fabs(view->y_max));
    double x_min = view->x_min - x_pad, y_max = view->y_max + y_pad;
    double x_scale = map->width / (view->x_max + x_pad - x_min);
    double y_scale = map->height / (y_max - (view->y_min - y_pad));
    map->x = umb_vec3_scale(umb_vec3_from_double(view->right), x_scale);
    map->y = umb_vec3_scale(umb_vec3_from_double(view->up), -y_scale);
    map->cx = -x_min * x_scale;
    map->cy = y_max * y_scale;
    map->scale = x_scale > y_scale ? x_scale : y_scale;
    map->scale *= 1.0 + 0x1p-18; /* axes are of unit length to within 1e-6 */

    /* Inverse of the rows: the columns of adj / det. For unit axes it is the axes themselves,
     * scaled. */
    umb_vec3 yw = umb_vec3_cross(map->y, map->w), wx = umb_vec3_cross(map->w, map->x);
    umb_vec3 xy = umb_vec3_cross(map->x, map->y);
    double det = umb_vec3_dot(map->x, yw);
    map->turn = det > 0 ? 1 : -1;
    map->ray_x = umb_vec3_scale(yw, 1.0 / det);
    map->ray_y = umb_vec3_scale(wx, 1.0 / det);
    map->ray_w = umb_vec3_scale(xy, 1.0 / det);
    umb_vec3 base = map->orthographic ? umb_vec3_make(0.0, 0.0, 0.0) : map->ray_w;
    map->ray_0 = combine(map->ray_x, -map->cx, map->ray_y, -map->cy, base);
    map->ray_size = umb_vec3_sum_abs(map->ray_0) + map->width * umb_vec3_sum_abs(map->ray_x) +
                    map->height * umb_vec3_sum_abs(map->ray_y);
}

#include "raster_map.h"

#define DEFAULT_WIDTH 1024
#define DEFAULT_HEIGHT 288

/* Rows: half of them within this part of the height to both sides of where far things lie. */
#define BAND 0.02
/* The band reaches lower where the eye is high above the scene, at most by this slope. */
#define MOST_DROP 0.1
/* A scene lies flat when its height is at most this part of its diagonal. */
#define MOST_TALL 0.1
/* The raster is levelled while every direction of the view is this far ahead of it (a cosine): beyond,
 * a levelled raster would be mostly sky. */
#define LEAST_AHEAD 0.3

static umb_vec3 combine(umb_vec3 a, double s, umb_vec3 b, double t, umb_vec3 c)
{
    return umb_vec3_add(c, umb_vec3_add(umb_vec3_scale(a, s), umb_vec3_scale(b, t)));
}

void umb_raster_map_size(const umb_view *view, uint32_t *width, uint32_t *height)
{
    *width = view->buffer_width != 0 ? view->buffer_width : DEFAULT_WIDTH;
    *height = view->buffer_height != 0 ? view->buffer_height : DEFAULT_HEIGHT;
}

/* A raster before it is scaled: its axes, the window of slopes (parallel: of distances) that holds the
 * frustum, the slope of the horizon, NAN if it is not known, and how far below it far things lie. */
typedef struct frame {
    umb_vec3 right, up, forward;
    double x_min, x_max, y_min, y_max;
    double horizon, drop;
    int vertical_axis;
} frame;

/* A corner of the view's frustum at a depth along its forward, relative to the eye. The axes may be a little
 * off right angles, so it is where d.right, d.up and d.forward are what they must be. */
static umb_vec3 frustum_corner(const umb_view *v, int corner, double depth)
{
    umb_vec3 right = umb_vec3_from_double(v->right), up = umb_vec3_from_double(v->up);
    umb_vec3 forward = umb_vec3_from_double(v->forward), up_forward = umb_vec3_cross(up, forward);
    double spread = v->projection == UMB_ORTHOGRAPHIC ? 1.0 : depth;
    double scale = 1.0 / umb_vec3_dot(right, up_forward);
    double x = scale * spread * ((corner & 1) != 0 ? v->x_max : v->x_min);
    double y = scale * spread * ((corner & 2) != 0 ? v->y_max : v->y_min);
    return combine(up_forward, x, umb_vec3_cross(forward, right), y,
                   umb_vec3_scale(umb_vec3_cross(right, up), scale * depth));
}

static frame screen_frame(const umb_view *v)
{
    frame f = {umb_vec3_from_double(v->right),
               umb_vec3_from_double(v->up),
               umb_vec3_from_double(v->forward),
               v->x_min,
               v->x_max,
               v->y_min,
               v->y_max,
               NAN,
               0.0,
               -1};
    return f;
}

/* The window of an upright frame: the frustum is a cone, so its image is the hull of its corners'. */
static bool find_window(frame *f, const umb_view *v)
{
    f->x_min = f->y_min = INFINITY;
    f->x_max = f->y_max = -INFINITY;
    for (int i = 0; i < 4; ++i) {
        umb_vec3 d = frustum_corner(v, i, 1.0);
        double w = umb_vec3_dot(f->forward, d);
        if (!(w > LEAST_AHEAD * umb_vec3_length(d))) {
            return false;
        }
        double x = umb_vec3_dot(f->right, d) / w, y = umb_vec3_dot(f->up, d) / w;
        f->x_min = x < f->x_min ? x : f->x_min;
        f->x_max = x > f->x_max ? x : f->x_max;
        f->y_min = y < f->y_min ? y : f->y_min;
        f->y_max = y > f->y_max ? y : f->y_max;
    }
    return true;
}

static int axis_of(const double v[3])
{
    for (int i = 0; i < 3; ++i) {
        if (v[i] != 0.0 && v[(i + 1) % 3] == 0.0 && v[(i + 2) % 3] == 0.0) {
            return i;
        }
    }
    return -1;
}

static void clear_axis(umb_vec3 *v, int axis, bool others)
{
    double c[3] = {v->x, v->y, v->z};
    for (int i = 0; i < 3 && axis >= 0; ++i) {
        c[i] = (i == axis) != others ? 0.0 : c[i];
    }
    *v = umb_vec3_from_double(c);
}

/* Level: forward is turned to the horizontal. The handedness stays the view's. */
static bool level_frame(frame *f, const umb_view *v, umb_vec3 vertical)
{
    umb_vec3 ahead = umb_vec3_from_double(v->forward);
    ahead = umb_vec3_sub(ahead, umb_vec3_scale(vertical, umb_vec3_dot(ahead, vertical)));
    double length = umb_vec3_length(ahead);
    if (!(length > LEAST_AHEAD)) {
        return false;
    }
    f->vertical_axis = axis_of(v->vertical);
    f->forward = umb_vec3_scale(ahead, 1.0 / length);
    f->up = vertical;
    clear_axis(&f->forward, f->vertical_axis, false);
    clear_axis(&f->up, f->vertical_axis, true);
    f->right = umb_vec3_cross(f->forward, f->up);
    clear_axis(&f->right, f->vertical_axis, false);
    f->horizon = 0.0;
    return find_window(f, v);
}

/* Upright only: the view's forward stays, the roll goes. */
static bool unroll_frame(frame *f, const umb_view *v, umb_vec3 vertical)
{
    umb_vec3 ahead = umb_vec3_from_double(v->forward);
    umb_vec3 up = umb_vec3_sub(vertical, umb_vec3_scale(ahead, umb_vec3_dot(ahead, vertical)));
    double length = umb_vec3_length(up);
    if (!(length > 1e-3)) {
        return false;
    }
    f->vertical_axis = -1;
    f->forward = ahead;
    f->up = umb_vec3_scale(up, 1.0 / length);
    f->right = umb_vec3_cross(f->forward, f->up);
    f->horizon = -umb_vec3_dot(ahead, vertical) / umb_vec3_dot(f->up, vertical);
    return find_window(f, v);
}

/* How far below the horizon the scene's far end lies, as a slope: the eye's height above the lowest point over
 * the way to the farthest. That is where most of what is far away is seen. */
static double find_drop(const umb_view *v, umb_vec3 vertical, const umb_aabb *scene)
{
    double height = 0.0, reach = 0.0;
    for (int k = 0; k < 8; ++k) {
        umb_vec3 d = {(k & 1 ? scene->max[0] : scene->min[0]) - v->eye[0],
                      (k & 2 ? scene->max[1] : scene->min[1]) - v->eye[1],
                      (k & 4 ? scene->max[2] : scene->min[2]) - v->eye[2]};
        double up = umb_vec3_dot(d, vertical);
        double across = umb_vec3_length(umb_vec3_sub(d, umb_vec3_scale(vertical, up)));
        height = -up > height ? -up : height;
        reach = across > reach ? across : reach;
    }
    double drop = reach > 0.0 ? height / reach : 0.0;
    return drop < MOST_DROP ? drop : MOST_DROP;
}

/* True if the scene lies on the ground: wide, and of little height along the vertical. Only then are far things seen
 * close to the horizon, and most edges oblique in a tilted picture upright ones of boxes. */
static bool lies_flat(umb_vec3 vertical, const umb_aabb *scene)
{
    umb_vec3 size = {(double)scene->max[0] - scene->min[0], (double)scene->max[1] - scene->min[1],
                     (double)scene->max[2] - scene->min[2]};
    double height = fabs(size.x * vertical.x) + fabs(size.y * vertical.y) + fabs(size.z * vertical.z);
    return height <= MOST_TALL * umb_vec3_length(size);
}

static frame choose_frame(const umb_view *v, const umb_aabb *scene)
{
    const double *c = v->vertical;
    double size = fmax(fabs(c[0]), fmax(fabs(c[1]), fabs(c[2])));
    frame f;
    if (v->projection == UMB_PERSPECTIVE && size > 0.0) {
        umb_vec3 vertical = {c[0] / size, c[1] / size, c[2] / size};
        vertical = umb_vec3_scale(vertical, 1.0 / umb_vec3_length(vertical));
        bool flat = scene == NULL || lies_flat(vertical, scene);
        if ((flat && level_frame(&f, v, vertical)) || unroll_frame(&f, v, vertical)) {
            f.horizon = flat ? f.horizon : NAN;
            f.drop = scene != NULL ? find_drop(v, vertical, scene) : 0.0;
            return f;
        }
    }
    return screen_frame(v);
}

/* Where row r begins: the inverse of the formula in raster_map.h, which is steeper within the band. */
static double row_edge(const umb_raster_rows *r, double row)
{
    double band = (double)r->slope * r->from, steep = (double)r->slope + r->extra;
    if (row <= band) {
        return row / r->slope;
    }
    if (row <= band + steep * r->span) {
        return r->from + (row - band) / steep;
    }
    return (row - (double)r->extra * r->span) / r->slope;
}

/* The formula in float has a rounding in each of its seven operations, relative to terms whose sum is the
 * height: below 2^-21 of it. */
static void lay_rows(umb_raster_map *map, double horizon, double drop, double *table)
{
    umb_raster_rows *r = &map->rows;
    double height = map->height;
    double low = horizon - BAND * height, high = horizon + drop + BAND * height;
    low = low > 0.0 ? low : 0.0;
    high = high < height ? high : height;
    *r = (umb_raster_rows){.slope = 1.0f, .slack = (float)(0x1p-21 * height), .edge = table};
    if (high - low > 0.01 * height) { /* false for NAN */
        r->from = (float)low;
        r->span = (float)(high - low);
        /* Half of the rows in a band of this width, if all of it is on the raster: the density outside is half. */
        double whole = drop + 2.0 * BAND * height, density = (height - whole) / whole;
        density = density > 1.0 ? density : 1.0;
        r->slope = (float)(height / (height + (density - 1.0) * r->span));
        r->extra = (float)((height - (double)r->slope * height) / r->span);
    }
    table[0] = 0.0;
    for (uint32_t i = 1; i < map->height; ++i) {
        table[i] = row_edge(r, i);
    }
    for (size_t i = map->height; i < umb_raster_map_table(map->height); ++i) {
        table[i] = height;
    }
}

/* W at the corners of the frustum's near and far ends: it is affine there, so those are its extremes. */
static void find_depths(umb_raster_map *map, const umb_view *v)
{
    map->near_cut = -INFINITY;
    map->least_w = INFINITY;
    map->most_w = -INFINITY;
    for (int i = 0; i < 4; ++i) {
        umb_vec3 d = frustum_corner(v, i, v->near_depth);
        double w = umb_vec3_dot(map->w, d), off = 16.0 * UMB_U * umb_vec3_sum_abs(d);
        map->near_cut = w + off > map->near_cut ? w + off : map->near_cut;
        map->least_w = w - off < map->least_w ? w - off : map->least_w;
        if (isinf(v->far_depth)) {
            map->most_w = INFINITY;
            continue;
        }
        d = frustum_corner(v, i, v->far_depth);
        w = umb_vec3_dot(map->w, d) + 16.0 * UMB_U * umb_vec3_sum_abs(d);
        map->most_w = w > map->most_w ? w : map->most_w;
    }
}

/* Inverse of the rows: the columns of adj / det. For unit axes it is the axes themselves, scaled. */
static void find_rays(umb_raster_map *map)
{
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

void umb_raster_map_prepare(umb_raster_map *map, const umb_view *view, const umb_aabb *scene, double *table)
{
    frame f = choose_frame(view, scene);
    umb_raster_map_size(view, &map->width, &map->height);
    map->orthographic = view->projection == UMB_ORTHOGRAPHIC;
    map->eye = umb_vec3_from_double(view->eye);
    map->w = f.forward;
    map->vertical_axis = f.vertical_axis;

    double x_pad = 0x1p-31 * (fabs(f.x_min) + fabs(f.x_max));
    double y_pad = 0x1p-31 * (fabs(f.y_min) + fabs(f.y_max));
    double x_min = f.x_min - x_pad, y_max = f.y_max + y_pad;
    double x_scale = map->width / (f.x_max + x_pad - x_min);
    double y_scale = map->height / (y_max - (f.y_min - y_pad));
    map->x = umb_vec3_scale(f.right, x_scale);
    map->y = umb_vec3_scale(f.up, -y_scale);
    map->cx = -x_min * x_scale;
    map->cy = y_max * y_scale;
    map->scale = x_scale > y_scale ? x_scale : y_scale;
    map->scale *= 1.0 + 0x1p-18; /* axes are of unit length to within 1e-6 */
    find_rays(map);
    find_depths(map, view);
    lay_rows(map, map->cy - f.horizon * y_scale, f.drop * y_scale, table);
}

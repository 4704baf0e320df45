/* What the options make of an eye and a target: a camera's view, or a light's. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "setup.h"

/* Nothing of the scene lies deeper than the distance to the farthest corner of its box. Three exact
 * or once-rounded differences, squares, two sums, a root, and the rounding of forward to unit
 * length: under 12 roundings of DBL_EPSILON / 2 each, so 16 epsilons keep the corner itself in
 * view. */
static double farthest_corner(const model *m, const double eye[3], double near_depth)
{
    double square = 0.0;
    for (int i = 0; i < 3; ++i) {
        double reach = fmax(fabs((double)m->bounds.min[i] - eye[i]),
                            fabs((double)m->bounds.max[i] - eye[i]));
        square += reach * reach;
    }
    double distance = sqrt(square) * (1.0 + 16.0 * DBL_EPSILON);
    return distance > near_depth ? distance : near_depth + 1.0;
}

/* Eye and target in the model's coordinates, the way up, the depths. */
typedef struct aim {
    double eye[3], target[3];
    const double *up;
    double near_depth, far_depth;
} aim;

static umb_result make_camera(const options *o, const aim *a, umb_view *out)
{
    double aspect = (double)o->width / o->height;
    return options_given(o, "ortho")
               ? umb_view_look_at_ortho(out, a->eye, a->target, a->up, o->ortho_height, aspect,
                                        a->near_depth, a->far_depth)
               : umb_view_look_at(out, a->eye, a->target, a->up,
                                  o->fov * (3.14159265358979323846 / 180.0), aspect, a->near_depth,
                                  a->far_depth);
}

static umb_result make_spot(const options *o, const aim *a, umb_view *out, umb_error *error)
{
    umb_spot_def def = {.angle = o->spot * (3.14159265358979323846 / 180.0),
                        .near_depth = a->near_depth,
                        .range = a->far_depth};
    for (int i = 0; i < 3; ++i) {
        def.eye[i] = a->eye[i];
        def.direction[i] = a->target[i] - a->eye[i];
        def.up[i] = a->up[i];
    }
    return umb_view_spot(out, &def, error);
}

/* How far before the slice the scene reaches towards the light: from the near depth of a view
 * without reach to the nearest corner of the scene's box, and a millionth of the sizes at hand
 * more. */
static double scene_reach(const model *m, const umb_view *sun)
{
    double nearest = INFINITY, size = fabs(sun->near_depth);
    for (int k = 0; k < 8; ++k) {
        double depth = 0.0;
        for (int i = 0; i < 3; ++i) {
            double d = (double)((k >> i & 1) != 0 ? m->bounds.max[i] : m->bounds.min[i]) -
                       sun->eye[i];
            depth += d * sun->forward[i];
            size += fabs(d) / 8;
        }
        nearest = fmin(nearest, depth);
    }
    return fmax(0.0, sun->near_depth - nearest) + 1e-6 * size;
}

static umb_result make_sun(const model *m, const options *o, const aim *a, umb_view *out,
                           umb_error *error)
{
    umb_view camera;
    umb_result result = make_camera(o, a, &camera);
    if (result != UMB_OK) {
        return result;
    }
    umb_sun_def def = {.camera = &camera, .reach = o->reach};
    memcpy(def.direction, o->sun, sizeof def.direction);
    if (options_given(o, "slice")) {
        def.slice_near = o->slice[0];
        def.slice_far = o->slice[1];
    }
    result = umb_view_sun(out, &def, error);
    if (result == UMB_OK && !options_given(o, "reach")) {
        def.reach = scene_reach(m, out);
        result = umb_view_sun(out, &def, error);
    }
    return result;
}

static umb_result make_shape(const model *m, const options *o, const aim *a, umb_view *out,
                             umb_error *error)
{
    if (options_given(o, "spot")) {
        return make_spot(o, a, out, error);
    }
    if (options_given(o, "cube")) {
        umb_result result = umb_view_cube_face(out, a->eye, o->cube, a->near_depth, a->far_depth,
                                               error);
        if (result == UMB_OK) {
            memcpy(out->vertical, a->up, sizeof out->vertical);
        }
        return result;
    }
    return options_given(o, "sun") ? make_sun(m, o, a, out, error) : make_camera(o, a, out);
}

/* What --plane says, moved to the model's coordinates. False when there are too many. */
static bool add_planes(const model *m, const options *o, umb_view *out)
{
    for (uint32_t k = 0; k < o->plane_count; ++k) {
        if (out->plane_count == UMB_MAX_CLIP_PLANES) {
            return false;
        }
        double *p = out->planes[out->plane_count++];
        memcpy(p, o->planes[k], sizeof o->planes[k]);
        p[3] += p[0] * m->origin[0] + p[1] * m->origin[1] + p[2] * m->origin[2];
    }
    return true;
}

static bool is_parallel(const options *o)
{
    return options_given(o, "ortho");
}

/* In the order in which people get them wrong. */
static const char *why_impossible(const options *o, const aim *a, const double row[6],
                                  const umb_error *error)
{
    bool finite = true, same = !options_given(o, "cube");
    for (int i = 0; i < 3; ++i) {
        finite = finite && fabs(row[i]) <= 1e30 && fabs(row[i + 3]) <= 1e30;
        same = same && a->eye[i] == a->target[i];
    }
    if (!finite) {
        return "coordinates must be finite, at most 1e30";
    }
    if (same) {
        return "eye and target are the same point";
    }
    if (!is_parallel(o) && !(o->near_depth > 0.0)) {
        return "--near must be above 0 (below only with --ortho)";
    }
    if (isinf(o->far_depth) && (is_parallel(o) || options_given(o, "spot"))) {
        return is_parallel(o) ? "--far inf needs perspective"
                              : "--far inf: a spot light ends somewhere";
    }
    if (options_given(o, "far") && !(o->far_depth > o->near_depth)) {
        return "--far must be above --near";
    }
    /* What the library says of a light begins with "impossible". */
    const char *colon = strchr(error->text, ':');
    return colon ? colon + 2
                 : "numbers too large, too small or too far apart (fov, height, size, near, far)";
}

const char *setup_make_view(const model *m, const options *o, const double row[6], umb_view *out,
                            umb_error *error)
{
    aim a = {.up = options_given(o, "up") ? o->up : m->up, .near_depth = o->near_depth};
    memset(error, 0, sizeof *error);
    for (int i = 0; i < 3; ++i) {
        a.eye[i] = row[i] - m->origin[i];
        a.target[i] = row[i + 3] - m->origin[i];
    }
    a.far_depth = options_given(o, "far") ? o->far_depth : farthest_corner(m, a.eye, o->near_depth);
    umb_result result = make_shape(m, o, &a, out, error);
    if (result == UMB_OK) {
        out->width = o->width;
        out->height = o->height;
        out->buffer_width = o->buffer_width;
        out->buffer_height = o->buffer_height;
        out->min_pixels = o->min_pixels;
        if (!add_planes(m, o, out)) {
            return "more than ten planes with those of the light";
        }
        result = umb_view_check(out, NULL);
    }
    return result == UMB_OK ? NULL : why_impossible(o, &a, row, error);
}

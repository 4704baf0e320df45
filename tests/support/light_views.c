#include "light_views.h"

#include <math.h>
#include <string.h>

#include "random_boxes.h"
#include "umbrage/light.h"

/* Micro scenes lie before an eye near the origin that looks along -z, from a tenth to some tens
 * away. */
static const double UP[3] = {0, 1, 0};

static void near_origin(uint64_t *seed, double spread, double out[3])
{
    for (int i = 0; i < 3; ++i) {
        out[i] = random_in(seed, -spread, spread);
    }
}

/* Mostly into the scene. */
static void some_direction(uint64_t *seed, double out[3])
{
    near_origin(seed, 1.0, out);
    if (random_below(seed, 3) != 0) {
        out[2] = -1.0 - fabs(out[2]);
    }
    if (random_below(seed, 4) == 0) { /* along an axis */
        out[0] = out[1] = 0.0;
        out[2] = -1.0;
    }
}

static void move_rectangle(uint64_t *seed, umb_view *v)
{
    double x = random_in(seed, -1.5, 1.5) * (v->x_max - v->x_min);
    double y = random_in(seed, -1.5, 1.5) * (v->y_max - v->y_min);
    v->x_min += x;
    v->x_max += x * random_in(seed, 0.8, 1.2);
    v->y_min += y;
    v->y_max += y;
}

static bool parallel(uint64_t *seed, const micro_scene *micro, umb_view *out)
{
    (void)micro;
    double eye[3], target[3];
    near_origin(seed, 3.0, eye);
    some_direction(seed, target);
    for (int i = 0; i < 3; ++i) {
        target[i] += eye[i];
    }
    double height = random_in(seed, 0.5, 12.0), aspect = random_in(seed, 0.5, 2.0);
    double near_depth = -random_in(seed, 0.0, 30.0);
    bool ok = umb_view_look_at_ortho(out, eye, target, UP, height, aspect, near_depth,
                                     random_in(seed, 1.0, 40.0)) == UMB_OK;
    if (ok && random_below(seed, 2) == 0) {
        move_rectangle(seed, out);
    }
    return ok && umb_view_check(out, NULL) == UMB_OK;
}

static bool perspective(uint64_t *seed, umb_view *out)
{
    double eye[3], target[3];
    near_origin(seed, 0.1, eye);
    some_direction(seed, target);
    for (int i = 0; i < 3; ++i) {
        target[i] += eye[i];
    }
    double fov = random_in(seed, 0.3, 2.2), near_depth = random_in(seed, 0.01, 0.4);
    return umb_view_look_at(out, eye, target, UP, fov, random_in(seed, 0.5, 2.0), near_depth,
                            random_below(seed, 3) == 0 ? INFINITY : 60.0) == UMB_OK;
}

static bool sheared(uint64_t *seed, const micro_scene *micro, umb_view *out)
{
    (void)micro;
    bool ok = perspective(seed, out);
    move_rectangle(seed, out);
    return ok && umb_view_check(out, NULL) == UMB_OK;
}

/* Any plane through a point in front of the eye. */
static void random_plane(uint64_t *seed, const umb_view *v, double plane[4])
{
    double depth = random_in(seed, 0.2, 12.0), at = 0.0;
    near_origin(seed, 1.0, plane);
    for (int i = 0; i < 3; ++i) {
        at += plane[i] * (v->eye[i] + depth * v->forward[i]);
    }
    plane[3] = 0.4 * depth - at;
}

static bool any_view(uint64_t *seed, const micro_scene *micro, umb_view *out)
{
    return random_below(seed, 3) == 0 ? parallel(seed, micro, out) : perspective(seed, out);
}

static bool planes(uint64_t *seed, const micro_scene *micro, umb_view *out)
{
    bool ok = any_view(seed, micro, out);
    out->plane_count = 1 + random_below(seed, UMB_MAX_CLIP_PLANES);
    for (uint32_t k = 0; ok && k < out->plane_count; ++k) {
        random_plane(seed, out, out->planes[k]);
    }
    return ok;
}

/* Through a triangle, as well as doubles can say it, or exactly through a face of an object's
 * box. */
static void touching_plane(uint64_t *seed, const model *m, double plane[4])
{
    const model_object *o = &m->objects[random_below(seed, m->object_count)];
    const model_mesh *mesh = &m->meshes[o->mesh];
    double sign = random_below(seed, 2) == 0 ? -1.0 : 1.0;
    uint32_t axis = random_below(seed, 3);
    memset(plane, 0, 4 * sizeof plane[0]);
    if (random_below(seed, 2) == 0) {
        plane[axis] = sign;
        plane[3] = -sign * (random_below(seed, 2) == 0 ? o->bounds.min[axis] : o->bounds.max[axis]);
        return;
    }
    const uint32_t *corner = mesh->indices + 3 * (size_t)random_below(seed, mesh->triangle_count);
    float v[3][3];
    for (int i = 0; i < 3; ++i) {
        model_world_vertex(m, o, corner[i], v[i]);
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        plane[i] = sign * (((double)v[1][j] - v[0][j]) * ((double)v[2][k] - v[0][k]) -
                           ((double)v[1][k] - v[0][k]) * ((double)v[2][j] - v[0][j]));
        plane[3] -= plane[i] * v[0][i];
    }
}

/* Sides, depths and planes that run through corners of the scene. */
static bool touching(uint64_t *seed, const micro_scene *micro, umb_view *out)
{
    const model *m = micro->model;
    bool ok = any_view(seed, micro, out);
    for (uint32_t k = 0; ok && k < 3; ++k) {
        touching_plane(seed, m, out->planes[out->plane_count]);
        out->plane_count++;
    }
    const model_object *o = &m->objects[random_below(seed, m->object_count)];
    float p[3];
    model_world_vertex(m, o, random_below(seed, m->meshes[o->mesh].position_count), p);
    double depth = 0.0, across = 0.0;
    for (int i = 0; ok && i < 3; ++i) {
        depth += (p[i] - out->eye[i]) * out->forward[i];
        across += (p[i] - out->eye[i]) * out->right[i];
    }
    umb_view trial = *out;
    switch (random_below(seed, 3)) {
    case 0:
        trial.near_depth = depth;
        break;
    case 1:
        trial.far_depth = depth;
        break;
    default:
        trial.x_min = out->projection == UMB_PERSPECTIVE ? across / depth : across;
        break;
    }
    if (ok && umb_view_check(&trial, NULL) == UMB_OK) {
        *out = trial;
    }
    /* A triangle without area has no plane. */
    while (ok && out->plane_count > 0 && umb_view_check(out, NULL) != UMB_OK) {
        out->plane_count--;
    }
    return ok;
}

static bool spot(uint64_t *seed, const micro_scene *micro, umb_view *out)
{
    (void)micro;
    umb_spot_def def = {.angle = random_in(seed, 0.1, 3.0),
                        .near_depth = random_in(seed, 0.01, 0.4),
                        .range = random_in(seed, 2.0, 40.0)};
    near_origin(seed, 0.1, def.eye);
    some_direction(seed, def.direction);
    return umb_view_spot(out, &def, NULL) == UMB_OK;
}

static bool cube(uint64_t *seed, const micro_scene *micro, umb_view *out)
{
    (void)micro;
    double eye[3];
    near_origin(seed, 0.1, eye);
    if (random_below(seed, 2) == 0) { /* among the things */
        eye[2] -= random_in(seed, 0.5, 6.0);
    }
    umb_cube_face face = random_below(seed, 2) == 0 ? UMB_CUBE_NEGATIVE_Z
                                                    : (umb_cube_face)random_below(seed, 6);
    return umb_view_cube_face(out, eye, face, random_in(seed, 0.01, 0.4),
                              random_below(seed, 2) == 0 ? INFINITY : 30.0, NULL) == UMB_OK;
}

static bool sun(uint64_t *seed, const micro_scene *micro, umb_view *out)
{
    umb_view camera;
    if (!any_view(seed, micro, &camera)) {
        return false;
    }
    umb_sun_def def = {.camera = &camera, .reach = random_in(seed, 0.0, 40.0)};
    def.slice_near = camera.near_depth + random_in(seed, 0.0, 4.0);
    def.slice_far = def.slice_near + random_in(seed, 0.5, 20.0);
    near_origin(seed, 1.0, def.direction);
    if (random_below(seed, 3) == 0) { /* along the camera's view or exactly down */
        memcpy(def.direction, camera.forward, sizeof def.direction);
    } else if (random_below(seed, 3) == 0) {
        def.direction[0] = def.direction[2] = 0.0;
    }
    if (random_below(seed, 2) == 0) {
        memcpy(def.up, UP, sizeof def.up);
    }
    return umb_view_sun(out, &def, NULL) == UMB_OK;
}

static bool volume(uint64_t *seed, const micro_scene *micro, umb_view *out)
{
    (void)micro;
    double middle[3] = {random_in(seed, -1.0, 1.0), random_in(seed, -1.0, 1.0),
                        -random_in(seed, 2.0, 12.0)};
    double p[UMB_MAX_VOLUME_PLANES][4], size = random_in(seed, 0.5, 6.0);
    umb_volume_def def = {.planes = (const double(*)[4])p};
    def.plane_count = 6 + random_below(seed, UMB_MAX_VOLUME_PLANES - 5);
    for (uint32_t k = 0; k < def.plane_count; ++k) {
        double length = 0.0, at = 0.0;
        near_origin(seed, 1.0, p[k]);
        for (int i = 0; i < 3; ++i) {
            length += p[k][i] * p[k][i];
            at += p[k][i] * middle[i];
        }
        p[k][3] = sqrt(length) * size * random_in(seed, 0.2, 1.0) - at;
    }
    if (random_below(seed, 2) == 0) {
        def.projection = UMB_ORTHOGRAPHIC;
        some_direction(seed, def.forward);
    } else { /* cut off what is beside the eye or behind it */
        near_origin(seed, 0.2, def.eye);
        memcpy(p[0], (double[4]){0, 0, -1, -random_in(seed, 0.4, 2.0)}, sizeof p[0]);
    }
    return umb_view_from_volume(out, &def, NULL) == UMB_OK;
}

static const struct {
    const char *name;
    bool (*make)(uint64_t *seed, const micro_scene *micro, umb_view *out);
} KINDS[] = {{"parallel", parallel}, {"sheared", sheared}, {"planes", planes},
             {"touching", touching}, {"spot", spot},       {"cube", cube},
             {"sun", sun},           {"volume", volume}};

uint32_t light_view_kinds(void)
{
    return sizeof KINDS / sizeof KINDS[0];
}

const char *light_view_name(uint32_t kind)
{
    return KINDS[kind].name;
}

bool light_view_make(uint32_t kind, uint64_t seed, const micro_scene *micro, umb_view *out)
{
    uint64_t state = seed * 0x9E3779B97F4A7C15u + kind + 1;
    for (int i = 0; i < 4; ++i) {
        random_next(&state);
    }
    for (int i = 0; i < 20; ++i) {
        if (KINDS[kind].make(&state, micro, out)) {
            out->width = 96;
            out->height = 96;
            return true;
        }
    }
    return false;
}

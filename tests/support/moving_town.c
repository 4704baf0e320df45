#include "moving_town.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "support/failing.h"

#define PI 3.14159265358979323846

/* The kinds of promise that objects are given by turns. */
enum { KIND_POINTS, KIND_TURNING, KIND_KNOWN, KIND_VOLUME, KIND_SPHERE, KIND_BOUNDS, KINDS };

static void check(bool ok)
{
    if (!ok) {
        abort();
    }
}

/* How an object moves: round a circle, turning about its pivot. */
typedef struct course {
    double radius, rate, phase; /* of the circle */
    double turn;                /* radians a second */
} course;

static course course_of(uint32_t object)
{
    dice d = {object * 977u + 5u};
    for (int i = 0; i < 4; ++i) {
        (void)dice_roll(&d, 2);
    }
    course c = {.radius = 0.1 + 0.002 * dice_roll(&d, 1000),
                .rate = 0.1 + 0.002 * dice_roll(&d, 500),
                .phase = 0.001 * dice_roll(&d, 6283),
                .turn = dice_roll(&d, 3) == 0 ? 0.0 : 0.002 * dice_roll(&d, 1000) - 1.0};
    return c;
}

static const model_mesh *mesh_of(const moving_town *t, uint32_t object)
{
    return &t->model->meshes[t->model->objects[object].mesh];
}

/* The middle of a mesh's box, and how far its vertices are from there when its object turns. */
static double middle_of(const moving_town *t, uint32_t object, double pivot[3])
{
    const model_mesh *mesh = mesh_of(t, object);
    const umb_transform *m = &t->model->objects[object].transform;
    double low[3], high[3], radius = 0.0;
    for (uint32_t v = 0; v < mesh->position_count; ++v) {
        for (int i = 0; i < 3; ++i) {
            double x = mesh->positions[3 * v + (uint32_t)i];
            low[i] = v == 0 ? x : fmin(low[i], x);
            high[i] = v == 0 ? x : fmax(high[i], x);
        }
    }
    for (int i = 0; i < 3; ++i) {
        pivot[i] = (float)(0.5 * (low[i] + high[i]));
    }
    for (uint32_t v = 0; v < mesh->position_count; ++v) {
        double square = 0.0;
        for (int i = 0; i < 3; ++i) {
            double x = 0.0;
            for (int k = 0; k < 3; ++k) {
                x += (double)m->m[i][k] * (mesh->positions[3 * v + (uint32_t)k] - pivot[k]);
            }
            square += x * x;
        }
        radius = fmax(radius, sqrt(square));
    }
    return radius;
}

static umb_motion_def motion_of(const moving_town *t, uint32_t object)
{
    course c = course_of(object);
    double radius = middle_of(t, object, t->pivots[object]);
    double speed = c.radius * c.rate * (1.0 + 1e-9), turn = fabs(c.turn) * (1.0 + 1e-9);
    umb_motion_def def = {.first_period = 0.5 + 0.1 * (object % 7)};
    memcpy(def.pivot, t->pivots[object], sizeof def.pivot);
    switch (object / 3 % KINDS) {
    case KIND_POINTS:
    case KIND_BOUNDS: /* a box around what turns in it grows faster than its corners go, but not twice as fast */
        def.max_speed = speed + 2.0 * radius * turn;
        break;
    case KIND_TURNING:
        def.max_speed = speed;
        def.max_spin = turn;
        break;
    case KIND_KNOWN:
        def.max_acceleration = speed * c.rate;
        break;
    case KIND_SPHERE:
        def.max_speed = speed;
        def.max_spin = INFINITY;
        break;
    case KIND_VOLUME:
        def.kind = UMB_MOTION_VOLUME;
        def.max_speed = object % 2 == 0 ? 0.0 : speed + 2.0 * radius * turn;
        for (int i = 0; i < 3; ++i) {
            const umb_transform *m = &t->model->objects[object].transform;
            double x = m->m[i][3], reach = radius + 2.0 * c.radius + 0.01;
            for (int k = 0; k < 3; ++k) {
                x += (double)m->m[i][k] * def.pivot[k];
            }
            def.volume.min[i] = (float)(x - reach);
            def.volume.max[i] = (float)(x + reach);
        }
        break;
    default:
        break;
    }
    return def;
}

/* Where an object is at a time: the exact place, rounded to float. */
static umb_transform transform_at(const moving_town *t, uint32_t object, double time)
{
    const umb_transform *m = &t->model->objects[object].transform;
    const double *pivot = t->pivots[object];
    course c = course_of(object);
    double cosine = cos(c.turn * time), sine = sin(c.turn * time), angle = c.rate * time + c.phase;
    double away[3] = {c.radius * (cos(angle) - cos(c.phase)), 0.0, c.radius * (sin(angle) - sin(c.phase))};
    umb_transform out;
    for (int i = 0; i < 3; ++i) {
        double at = (double)m->m[i][0] * pivot[0] + (double)m->m[i][1] * pivot[1] + (double)m->m[i][2] * pivot[2] +
                    m->m[i][3] + away[i];
        for (int k = 0; k < 3; ++k) { /* about the vertical: z into x */
            double entry = i == 1   ? m->m[1][k]
                           : i == 0 ? cosine * m->m[0][k] + sine * m->m[2][k]
                                    : cosine * m->m[2][k] - sine * m->m[0][k];
            at -= entry * pivot[k];
            out.m[i][k] = (float)entry;
        }
        out.m[i][3] = (float)at;
    }
    return t->moves[object] ? out : *m;
}

static umb_aabb bounds_under(const moving_town *t, uint32_t object, const umb_transform *at)
{
    const model_mesh *mesh = mesh_of(t, object);
    umb_aabb box = {{0, 0, 0}, {0, 0, 0}};
    for (uint32_t v = 0; v < mesh->position_count; ++v) {
        const float *p = mesh->positions + 3 * (size_t)v;
        for (int i = 0; i < 3; ++i) {
            double sum = (double)at->m[i][0] * p[0] + (double)at->m[i][1] * p[1] + (double)at->m[i][2] * p[2] +
                         (double)at->m[i][3];
            float x = (float)sum;
            box.min[i] = v == 0 || x < box.min[i] ? x : box.min[i];
            box.max[i] = v == 0 || x > box.max[i] ? x : box.max[i];
        }
    }
    return box;
}

umb_aabb moving_town_bounds(const moving_town *t, uint32_t object, double time)
{
    umb_transform at = transform_at(t, object, time);
    return bounds_under(t, object, &at);
}

bool moving_town_pose(void *user, uint32_t object, double time, umb_pose *out)
{
    const moving_town *t = user;
    course c = course_of(object);
    double angle = c.rate * time + c.phase;
    out->transform = transform_at(t, object, time);
    if (object / 3 % KINDS == KIND_KNOWN) {
        out->velocity[0] = -c.radius * c.rate * sin(angle);
        out->velocity[2] = c.radius * c.rate * cos(angle);
        out->spin[1] = c.turn;
        out->holds = 3.0;
    }
    if (object / 3 % KINDS == KIND_BOUNDS) {
        out->bounds = bounds_under(t, object, &out->transform);
    }
    return true;
}

void moving_town_make(moving_town *t, const char *spec)
{
    umb_error error = {0};
    memset(t, 0, sizeof *t);
    t->model = model_load(spec, NULL, &error);
    t->posed = model_load(spec, NULL, &error);
    check(t->model != NULL && t->posed != NULL && camera_path_load(spec, &t->path, &error));
    uint32_t n = t->model->object_count;
    t->motions = calloc(n, sizeof *t->motions);
    t->moves = calloc(n, sizeof *t->moves);
    t->pivots = calloc(n, sizeof *t->pivots);
    check(t->motions != NULL && t->moves != NULL && t->pivots != NULL);
    for (uint32_t i = 0; i < n; ++i) {
        t->moves[i] = i % 3 != 2;
        t->motions[i] = motion_of(t, i);
    }
}

void moving_town_free(moving_town *t)
{
    model_free(t->model);
    model_free(t->posed);
    camera_path_free(&t->path);
    free(t->motions);
    free(t->moves);
    free(t->pivots);
}

void moving_town_pose_model(moving_town *t, double time)
{
    for (uint32_t i = 0; i < t->model->object_count; ++i) {
        t->posed->objects[i].transform = transform_at(t, i, time);
        t->posed->objects[i].bounds = moving_town_bounds(t, i, time);
    }
}

umb_scene *moving_town_scene(const moving_town *t, const umb_allocator *allocator, bool moving)
{
    const model *m = t->model;
    umb_scene *scene = NULL;
    umb_scene_def def = {0};
    if (allocator != NULL) {
        def.allocator = *allocator;
    }
    umb_shape *shapes = calloc(m->mesh_count, sizeof *shapes);
    check(shapes != NULL && umb_scene_create(&def, &scene) == UMB_OK);
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        umb_shape_def shape = {.positions = m->meshes[i].positions,
                               .position_count = m->meshes[i].position_count,
                               .indices = m->meshes[i].indices,
                               .index_count = m->meshes[i].triangle_count * 3,
                               .triangle_flags = m->meshes[i].flags};
        check(umb_scene_add_shape(scene, &shape, &shapes[i]) == UMB_OK);
    }
    for (uint32_t i = 0; i < m->object_count; ++i) {
        uint32_t id;
        umb_object_def object = {.shape = shapes[m->objects[i].mesh],
                                 .transform = m->objects[i].transform,
                                 .flags = i % 5 != 0 ? UMB_OBJECT_IS_SHAPE : 0};
        check(umb_scene_add_object(scene, &object, &id) == UMB_OK && id == i);
    }
    free(shapes);
    if (moving) {
        check(moving_town_start(t, scene) == UMB_OK);
    }
    check(umb_scene_commit(scene) == UMB_OK);
    return scene;
}

umb_result moving_town_start(const moving_town *t, umb_scene *scene)
{
    umb_pose_source source = {moving_town_pose, (void *)t};
    umb_result result = umb_scene_set_poses(scene, &source);
    for (uint32_t i = 0; i < t->model->object_count && result == UMB_OK; ++i) {
        if (t->moves[i]) {
            result = umb_scene_set_motion(scene, i, &t->motions[i]);
        }
    }
    return result;
}

void moving_town_move_all(const moving_town *t, umb_scene *scene, double time)
{
    for (uint32_t i = 0; i < t->model->object_count; ++i) {
        umb_transform at = transform_at(t, i, time);
        check(umb_scene_move_object(scene, i, &at, NULL) == UMB_OK);
    }
    check(umb_scene_commit(scene) == UMB_OK);
}

umb_view moving_town_view(const moving_town *t, uint32_t frame, double time)
{
    static const double up[3] = {0, 1, 0};
    const double *row = t->path.rows[frame / 4 % t->path.count];
    double eye[3] = {row[0] + 0.05 * (frame % 4), row[1] + (frame % 16 == 15 ? 25.0 : 0.0), row[2]};
    double target[3] = {row[3], row[4] - (frame % 16 == 15 ? 400.0 : 0.0), row[5]};
    umb_view view;
    umb_result result = frame % 7 == 6 ? umb_view_look_at_ortho(&view, eye, target, up, 60, 2, 0.1, 500)
                                       : umb_view_look_at(&view, eye, target, up, PI / 3, 2, 0.1, 500);
    check(result == UMB_OK);
    view.time = time;
    return view;
}

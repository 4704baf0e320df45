#include "moving.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Seconds that a round takes, along the four sides of a square. */
#define ROUND 16.0

static uint64_t mixed(uint32_t object)
{
    uint64_t x = (object + 1) * 0x9E3779B97F4A7C15u;
    x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9u;
    return x ^ x >> 27;
}

/* How far along its way an object is, on either axis. */
static void find_way(const moving *m, uint32_t object, double time, double way[2])
{
    double side = m->speed * ROUND / 4.0, at = fmod(time + (double)(mixed(object) % 1024) * (ROUND / 1024.0), ROUND);
    double on = (at < 0.0 ? at + ROUND : at) * m->speed, rest = fmod(on, side);
    int edge = (int)(on / side) & 3;
    way[0] = edge == 0 ? rest : edge == 1 ? side : edge == 2 ? side - rest : 0.0;
    way[1] = edge == 0 ? 0.0 : edge == 1 ? rest : edge == 2 ? side : side - rest;
}

static umb_transform transform_at(const moving *m, uint32_t object, double time)
{
    umb_transform t = m->rest[object];
    double now[2], first[2];
    find_way(m, object, time, now);
    find_way(m, object, 0.0, first);
    for (int k = 0; k < 2; ++k) {
        float *entry = &t.m[m->axes[k]][3];
        *entry = (float)((double)*entry + now[k] - first[k]);
    }
    return t;
}

static bool where_is(void *user, uint32_t object, double time, umb_pose *out)
{
    out->transform = transform_at(user, object, time);
    return true;
}

/* The identity is written out: a transform of zeros has no translation to change. */
static void keep_rest(moving *m)
{
    static const umb_transform identity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}, zero = {{{0}}};
    for (uint32_t i = 0; i < m->model->object_count; ++i) {
        const model_object *o = &m->model->objects[i];
        m->rest[i] = memcmp(&o->transform, &zero, sizeof zero) == 0 ? identity : o->transform;
        m->moves[i] = o->mesh != MODEL_NONE && (double)(mixed(i) >> 11) * 0x1p-53 < m->share;
    }
}

static umb_result set_motions(setup *s, bool weld)
{
    moving *m = s->moving;
    umb_pose_source source = {where_is, m};
    /* A hair faster than they go, for what the sums of their ways round off. */
    umb_motion_def def = {.max_speed = m->speed * (1.0 + 1e-9)};
    umb_result result = umb_scene_set_poses(s->scene, &source);
    for (uint32_t i = 0; i < m->model->object_count && result == UMB_OK; ++i) {
        if (m->moves[i]) {
            result = umb_scene_set_motion(s->scene, i, &def);
        }
    }
    umb_weld_def weld_def = {.tasks = s->tasks};
    if (weld && result == UMB_OK) {
        result = umb_scene_weld(s->scene, &weld_def, &s->weld);
    }
    return result == UMB_OK ? umb_scene_commit(s->scene) : result;
}

int moving_start(setup *s, const options *o, bool weld)
{
    uint32_t count = s->model->object_count;
    moving *m = calloc(1, sizeof *m);
    s->moving = m;
    if (m != NULL) {
        m->model = s->model;
        m->share = o->moving[0];
        m->speed = o->moving[1];
        m->rest = malloc(((size_t)count + 1) * sizeof *m->rest);
        m->moves = calloc((size_t)count + 1, sizeof *m->moves);
    }
    if (m == NULL || m->rest == NULL || m->moves == NULL) {
        return fail(o, EXIT_INPUT, "not enough memory");
    }
    const double *up = s->model->up;
    int vertical = fabs(up[2]) > fabs(up[1]) ? 2 : fabs(up[0]) > fabs(up[1]) ? 0 : 1;
    m->axes[0] = (vertical + 1) % 3;
    m->axes[1] = (vertical + 2) % 3;
    keep_rest(m);
    umb_result result = set_motions(s, weld);
    return result == UMB_OK ? EXIT_DONE : fail(o, EXIT_INPUT, "what moves: %s", umb_result_name(result));
}

void moving_free(moving *m)
{
    if (m != NULL) {
        free(m->rest);
        free(m->moves);
        free(m);
    }
}

umb_result moving_advance(const setup *s, const umb_view *view)
{
    umb_result result = umb_scene_set_time(s->scene, view->time);
    return result == UMB_OK ? umb_scene_commit(s->scene) : result;
}

void moving_pose_model(setup *s, double time)
{
    const moving *m = s->moving;
    for (uint32_t i = 0; i < m->model->object_count; ++i) {
        model_object *o = &s->model->objects[i];
        if (!m->moves[i] || o->mesh == MODEL_NONE) {
            continue;
        }
        o->transform = transform_at(m, i, time);
        for (uint32_t v = 0; v < s->model->meshes[o->mesh].position_count; ++v) {
            float p[3];
            model_world_vertex(s->model, o, v, p);
            for (int k = 0; k < 3; ++k) {
                o->bounds.min[k] = v == 0 ? p[k] : fminf(o->bounds.min[k], p[k]);
                o->bounds.max[k] = v == 0 ? p[k] : fmaxf(o->bounds.max[k], p[k]);
            }
        }
    }
}

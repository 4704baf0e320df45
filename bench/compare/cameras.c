/* Views from camera paths. */
#include "cameras.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;
static const double golden = 0.6180339887498949;

typedef struct lens_data {
    double fov_y, near_depth, far_depth;
} lens_data;

static lens_data read_lens(const char *file)
{
    lens_data lens = {60.0, 0.1, 2000.0};
    json_t *root = file != NULL ? json_load_file(file, 0, NULL) : NULL;
    double fov = 0.0;
    double near_depth = 0.0;
    double far_depth = 0.0;
    if (root != NULL && json_unpack(root, "{s:F, s:F, s:F}", "fov_y_deg", &fov, "near", &near_depth,
                                    "far", &far_depth) == 0) {
        lens = (lens_data){fov, near_depth, far_depth};
    }
    json_decref(root);
    return lens;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3;
        int k = (i + 2) % 3;
        out[i] = a[j] * b[k] - a[k] * b[j];
    }
}

/* Turn two unit vectors at right angles within their plane, a towards b. */
static void rotate(double a[3], double b[3], double degrees)
{
    double c = cos(degrees * pi / 180.0);
    double s = sin(degrees * pi / 180.0);
    for (int i = 0; i < 3; ++i) {
        double x = a[i];
        double y = b[i];
        a[i] = c * x + s * y;
        b[i] = c * y - s * x;
    }
}

static bool add_view(cameras *c, const world *w, const lens_data *lens, const double eye[3],
                     const double target[3], camera_turn turn)
{
    umb_view *v = &c->views[c->count];
    double from[3];
    double to[3];
    for (int i = 0; i < 3; ++i) {
        from[i] = eye[i] - w->model->origin[i];
        to[i] = target[i] - w->model->origin[i];
    }
    if (turn.height > 0.0) {
        double lift = turn.height - dot(from, w->model->up);
        for (int i = 0; i < 3; ++i) {
            from[i] += lift * w->model->up[i];
            to[i] += lift * w->model->up[i];
        }
    }
    if (umb_view_look_at(v, from, to, w->model->up, lens->fov_y * pi / 180.0, 16.0 / 9.0,
                         lens->near_depth, lens->far_depth) != UMB_OK) {
        return false;
    }
    rotate(v->forward, v->up, turn.pitch);
    rotate(v->right, v->up, turn.roll);
    ++c->count;
    return true;
}

static bool start(cameras *c, const char *name, uint32_t room, umb_error *error)
{
    memset(c, 0, sizeof *c);
    (void)snprintf(c->name, sizeof c->name, "%s", name);
    c->views = calloc(room, sizeof *c->views);
    if (c->views == NULL) {
        (void)snprintf(error->text, sizeof error->text, "%s: not enough memory for views", name);
    }
    return c->views != NULL;
}

static bool finish(cameras *c, const char *path, umb_error *error)
{
    if (c->count == 0) {
        (void)snprintf(error->text, sizeof error->text, "%s: no view in it", path);
        cameras_free(c);
    }
    return c->views != NULL;
}

bool cameras_path(cameras *c, const world *w, const char *name, const char *path, const char *lens,
                  uint32_t every, uint32_t last, camera_turn turn, umb_error *error)
{
    camera_path p;
    lens_data optics = read_lens(lens);
    if (!camera_path_load(path, &p, error)) {
        return false;
    }
    if (start(c, name, p.count, error)) {
        for (uint32_t i = 0; i < p.count && i <= last; i += every) {
            (void)add_view(c, w, &optics, p.rows[i], p.rows[i] + 3, turn);
        }
    }
    camera_path_free(&p);
    (void)snprintf(c->about, sizeof c->about,
                   "%u views, 16:9, %g degrees high, near %g, far %g, pitch %g, roll %g", c->count,
                   optics.fov_y, optics.near_depth, optics.far_depth, turn.pitch, turn.roll);
    return c->views != NULL && finish(c, path, error);
}

/* The eyes of a path as a line; corners of it are cut by looking ahead. */
typedef struct trail {
    const camera_path *path;
    double *length; /* of the line up to each row */
    double total;
} trail;

static double distance(const double a[3], const double b[3])
{
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

static bool trail_make(trail *t, const camera_path *p)
{
    t->path = p;
    t->total = 0.0;
    t->length = calloc((size_t)p->count + 1, sizeof *t->length);
    for (uint32_t i = 1; t->length != NULL && i < p->count; ++i) {
        t->length[i] = t->length[i - 1] + distance(p->rows[i - 1], p->rows[i]);
    }
    t->total = t->length != NULL ? t->length[p->count - 1] : 0.0;
    return t->total > 0.0;
}

static void trail_at(const trail *t, double at, double out[3])
{
    uint32_t i = 1;
    while (i + 1 < t->path->count && t->length[i] < at) {
        ++i;
    }
    double step = t->length[i] - t->length[i - 1];
    double s = step > 0.0 ? (at - t->length[i - 1]) / step : 0.0;
    for (int k = 0; k < 3; ++k) {
        const double *a = t->path->rows[i - 1];
        const double *b = t->path->rows[i];
        out[k] = a[k] + s * (b[k] - a[k]);
    }
}

static bool add_frame(cameras *c, const world *w, const trail *t, double at, double about)
{
    double eye[3];
    double ahead[3];
    double forward[3];
    double side[3];
    lens_data lens = read_lens(NULL);
    trail_at(t, at, eye);
    trail_at(t, at + 10.0, ahead);
    for (int k = 0; k < 3; ++k) {
        forward[k] = ahead[k] - eye[k];
    }
    cross(forward, w->model->up, side);
    double target[3];
    for (int k = 0; k < 3; ++k) {
        target[k] = eye[k] + cos(about) * forward[k] + sin(about) * side[k];
    }
    return add_view(c, w, &lens, eye, target, (camera_turn){0});
}

bool cameras_motion(cameras *c, const world *w, const char *name, const char *path, double speed,
                    uint32_t count, umb_error *error)
{
    camera_path p;
    trail t = {0};
    if (!camera_path_load(path, &p, error)) {
        return false;
    }
    bool made = start(c, name, count, error);
    if (made && trail_make(&t, &p)) {
        double usable = t.total - 12.0;
        for (uint32_t i = 0; i < count; ++i) {
            double jump = i * golden - floor(i * golden);
            double at = speed > 0.0 ? 0.25 * usable + i * speed / 60.0 : jump * usable;
            /* A glance of 40 degrees to either side every six seconds; after a jump, anywhere. */
            double about = speed > 0.0 ? 0.7 * sin(2.0 * pi * i / 360.0) : 2.0 * pi * 7.0 * jump;
            (void)add_frame(c, w, &t, fmod(at, usable), about);
        }
    }
    if (speed > 0.0) {
        (void)snprintf(c->about, sizeof c->about,
                       "%u frames in sequence at %g m/s, 60 a second, looking about", c->count,
                       speed);
    } else {
        (void)snprintf(c->about, sizeof c->about, "%u frames in sequence, each elsewhere", c->count);
    }
    free(t.length);
    camera_path_free(&p);
    return made && finish(c, path, error);
}

void cameras_free(cameras *c)
{
    free(c->views);
    c->views = NULL;
    c->count = 0;
}

/* Views, sight-lines and where to aim: plain double geometry. Nothing here is trusted by an
 * accusation: confirm.c decides again, exactly. */
#include <math.h>
#include <string.h>

#include "oracle.h"

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* a.(p - eye) * sign - limit >= 0 as a plane. */
static void add_plane(oracle_view *v, const double a[3], double sign, double limit)
{
    double *plane = v->planes[v->plane_count++];
    for (int i = 0; i < 3; ++i) {
        plane[i] = sign * a[i];
    }
    plane[3] = -sign * dot3(a, v->view->eye) - limit;
}

static void side_planes(oracle_view *v, const double axis[3], double low, double high)
{
    if (v->view->projection == UMB_ORTHOGRAPHIC) {
        add_plane(v, axis, 1.0, low);
        add_plane(v, axis, -1.0, -high);
        return;
    }
    double a[3], b[3];
    for (int i = 0; i < 3; ++i) {
        a[i] = axis[i] - low * v->view->forward[i];
        b[i] = high * v->view->forward[i] - axis[i];
    }
    add_plane(v, a, 1.0, 0.0);
    add_plane(v, b, 1.0, 0.0);
}

void oracle_view_make(const truth *t, const umb_view *view, const truth_options *options,
                      oracle_view *out)
{
    memset(out, 0, sizeof(*out));
    out->view = view;
    uint32_t width = view->width ? view->width : 1024, height = view->height ? view->height : 512;
    if (options && options->grid_width && options->grid_height) {
        width = options->grid_width;
        height = options->grid_height;
    }
    out->pixel[0] = (view->x_max - view->x_min) / width;
    out->pixel[1] = (view->y_max - view->y_min) / height;
    /* The deepest corner of the scene, and a little more, so that a far plane at infinity needs no
     * case of its own. */
    const umb_aabb *box = &t->model->bounds;
    double deepest = -INFINITY;
    for (int corner = 0; corner < 8; ++corner) {
        double d[3];
        for (int i = 0; i < 3; ++i) {
            d[i] = (corner >> i & 1 ? box->max[i] : box->min[i]) - view->eye[i];
        }
        deepest = fmax(deepest, dot3(d, view->forward));
    }
    out->far_depth = fmin(view->far_depth, deepest + 1e-3 * (1.0 + fabs(deepest)));
    side_planes(out, view->right, view->x_min, view->x_max);
    side_planes(out, view->up, view->y_min, view->y_max);
    add_plane(out, view->forward, 1.0, view->near_depth);
    add_plane(out, view->forward, -1.0, -out->far_depth);
    for (uint32_t i = 0; i < view->plane_count && i < UMB_MAX_CLIP_PLANES; ++i) {
        memcpy(out->planes[out->plane_count++], view->planes[i], sizeof(out->planes[0]));
    }
}

static double plane_at(const double plane[4], const double p[3])
{
    return dot3(plane, p) + plane[3];
}

bool oracle_view_holds(const oracle_view *v, const double p[3])
{
    for (uint32_t i = 0; i < v->plane_count; ++i) {
        if (plane_at(v->planes[i], p) < 0.0) {
            return false;
        }
    }
    return true;
}

bool oracle_view_meets_box(const oracle_view *v, const umb_aabb *box)
{
    for (uint32_t i = 0; i < v->plane_count; ++i) {
        const double *plane = v->planes[i];
        double far_corner[3], size = fabs(plane[3]);
        for (int k = 0; k < 3; ++k) {
            far_corner[k] = plane[k] > 0.0 ? box->max[k] : box->min[k];
            size += fabs(plane[k] * far_corner[k]);
        }
        if (plane_at(plane, far_corner) < -1e-12 * size) {
            return false;
        }
    }
    return true;
}

bool oracle_sight_make(const oracle_view *v, const double through[3], oracle_sight *out)
{
    const umb_view *view = v->view;
    double d[3], depth, scale = 1.0;
    memcpy(out->through, through, sizeof(out->through));
    for (int i = 0; i < 3; ++i) {
        d[i] = through[i] - view->eye[i];
    }
    depth = dot3(d, view->forward);
    if (view->projection == UMB_PERSPECTIVE) {
        if (!(depth > 0.0)) {
            return false;
        }
        scale = depth;
        for (int i = 0; i < 3; ++i) {
            out->along[i] = d[i] / depth;
            out->from[i] = view->eye[i] + view->near_depth * out->along[i];
        }
    } else {
        double length = dot3(view->forward, view->forward);
        for (int i = 0; i < 3; ++i) {
            out->along[i] = view->forward[i] / length;
            out->from[i] = through[i] - (depth - view->near_depth) * out->along[i];
        }
    }
    double x = dot3(d, view->right) / scale, y = dot3(d, view->up) / scale;
    return x >= view->x_min && x <= view->x_max && y >= view->y_min && y <= view->y_max;
}

void oracle_picture_point(const oracle_view *v, double x, double y, double out[3])
{
    const umb_view *view = v->view;
    double depth = view->projection == UMB_PERSPECTIVE ? fmax(1.0, view->near_depth) : 0.0;
    double scale = view->projection == UMB_PERSPECTIVE ? depth : 1.0;
    double a = scale * (view->x_min + x * (view->x_max - view->x_min));
    double b = scale * (view->y_max - y * (view->y_max - view->y_min));
    for (int i = 0; i < 3; ++i) {
        out[i] = view->eye[i] + depth * view->forward[i] + a * view->right[i] + b * view->up[i];
    }
}

void oracle_sight_at(const oracle_sight *s, double depth_beyond_near, double out[3])
{
    for (int i = 0; i < 3; ++i) {
        out[i] = s->from[i] + depth_beyond_near * s->along[i];
    }
}

/* Sutherland-Hodgman against one plane. */
static uint32_t clip_plane(const double plane[4], double (*in)[3], uint32_t count, double (*out)[3])
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < count && n + 2 <= ORACLE_POLYGON; ++i) {
        const double *a = in[i], *b = in[(i + 1) % count];
        double da = plane_at(plane, a), db = plane_at(plane, b);
        if (da >= 0.0) {
            memcpy(out[n++], a, sizeof(out[0]));
        }
        if ((da >= 0.0) != (db >= 0.0)) {
            double s = da / (da - db);
            for (int k = 0; k < 3; ++k) {
                out[n][k] = a[k] + s * (b[k] - a[k]);
            }
            ++n;
        }
    }
    return n;
}

void oracle_clip(const oracle_view *v, float triangle[3][3], oracle_polygon *out)
{
    double other[ORACLE_POLYGON][3];
    out->count = 3;
    for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k) {
            out->corner[i][k] = triangle[i][k];
        }
    }
    for (uint32_t i = 0; i < v->plane_count && out->count; ++i) {
        bool inside = true;
        for (uint32_t k = 0; k < out->count; ++k) {
            inside = inside && plane_at(v->planes[i], out->corner[k]) >= 0.0;
        }
        if (!inside) {
            out->count = clip_plane(v->planes[i], out->corner, out->count, other);
            memcpy(out->corner, other, out->count * sizeof(other[0]));
        }
    }
    memset(out->centre, 0, sizeof(out->centre));
    for (uint32_t i = 0; i < out->count; ++i) {
        for (int k = 0; k < 3; ++k) {
            out->centre[k] += out->corner[i][k] / out->count;
        }
    }
}

void oracle_polygon_point(const oracle_polygon *p, uint32_t which, double pull, uint64_t random,
                          double out[3])
{
    const double *a = p->centre, *b, *c;
    double u, w;
    if (which == 0) {
        memcpy(out, p->centre, sizeof(p->centre));
        return;
    }
    if (which <= 2 * p->count) {
        uint32_t k = (which - 1) % p->count;
        b = p->corner[k];
        c = which <= p->count ? b : p->corner[(k + 1) % p->count];
        u = w = 0.5 * (1.0 - pull);
    } else {
        uint32_t k = (uint32_t)(random % p->count);
        b = p->corner[k];
        c = p->corner[(k + 1) % p->count];
        double r = sqrt(oracle_unit(oracle_mix(random, 1, 0)));
        double s = oracle_unit(oracle_mix(random, 2, 0));
        u = r * (1.0 - s);
        w = r * s;
    }
    for (int i = 0; i < 3; ++i) {
        out[i] = a[i] + u * (b[i] - a[i]) + w * (c[i] - a[i]);
    }
}

uint64_t oracle_mix(uint64_t a, uint64_t b, uint64_t c)
{
    uint64_t x = a * 0x9E3779B97F4A7C15u + b * 0xC2B2AE3D27D4EB4Fu + c * 0x165667B19E3779F9u;
    x ^= x >> 31;
    x *= 0xBF58476D1CE4E5B9u;
    x ^= x >> 29;
    x *= 0x94D049BB133111EBu;
    return x ^ (x >> 32);
}

double oracle_unit(uint64_t bits)
{
    return (double)(bits >> 11) * 0x1p-53;
}

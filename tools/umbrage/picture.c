#include "picture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "picture_rays.h"

static const bitmap_color alarm = 0xFF00C8, night = 0x0B0D12;

void picture_states(const model *m, const umb_view *view, const uint32_t *visible, uint32_t count,
                    uint8_t *states)
{
    double planes[16][4];
    uint32_t plane_count = umb_view_planes(view, planes);
    for (uint32_t o = 0; o < m->object_count; ++o) {
        const umb_aabb *b = &m->objects[o].bounds;
        bool outside = m->objects[o].mesh == MODEL_NONE;
        for (uint32_t k = 0; k < plane_count && !outside; ++k) {
            double best = planes[k][3];
            for (int i = 0; i < 3; ++i) {
                best += planes[k][i] * (planes[k][i] > 0 ? b->max[i] : b->min[i]);
            }
            outside = best < 0;
        }
        states[o] = outside ? PICTURE_OUTSIDE : PICTURE_HIDDEN;
    }
    for (uint32_t k = 0; k < count; ++k) {
        if (visible[k] < m->object_count) {
            states[visible[k]] = PICTURE_VISIBLE;
        }
    }
}

/* A well-mixed number for each object. */
static uint32_t hash_object(uint32_t object)
{
    uint32_t h = object * 2654435761u;
    h = (h ^ h >> 15) * 2246822519u;
    return h ^ h >> 13;
}

/* Hue in turns, saturation and value in [0, 1]. */
static bitmap_color from_hue(double hue, double saturation, double value)
{
    bitmap_color out = 0;
    for (int i = 0; i < 3; ++i) {
        double x = fmod(hue + (3 - i) / 3.0, 1.0) * 6.0;
        double k = fmin(1, fmax(0, fabs(x - 3) - 1));
        out = out << 8 | (bitmap_color)(255 * value * (1 - saturation * (1 - k)) + 0.5);
    }
    return out;
}

bool picture_ids(bitmap *im, truth *t, const umb_view *view, const uint8_t *states)
{
    picture_rays rays;
    if (!picture_rays_trace(&rays, t, view, im->width, im->height)) {
        return false;
    }
    for (size_t k = 0; k < (size_t)im->width * im->height; ++k) {
        uint32_t object = rays.hits[k].object, h = hash_object(object);
        bitmap_color c = night;
        if (object != MODEL_NONE) {
            c = from_hue((h & 0xFFFF) / 65536.0, 0.35 + 0.35 * (h >> 16 & 255) / 255.0,
                         0.62 + 0.36 * (h >> 24) / 255.0);
            c = states && states[object] != PICTURE_VISIBLE ? alarm : c;
        }
        bitmap_set(im, (int)(k % im->width), (int)(k / im->width), c);
    }
    picture_rays_free(&rays);
    return true;
}

/* Depth ramp: t 0 near, 1 far. */
static bitmap_color ramp(double t)
{
    static const bitmap_color stops[] = {0xFFF4C2, 0xF7C873, 0xE98B57, 0xC2526A,
                                         0x7C3B7D, 0x40377A, 0x22305C};
    enum { LAST = sizeof stops / sizeof stops[0] - 1 };
    double at = fmin(1, fmax(0, t)) * LAST;
    int k = at < LAST ? (int)at : LAST - 1;
    return bitmap_mix(stops[k], stops[k + 1], at - k);
}

/* The buffer's values as depths, and the range that they span. False: nothing is covered. */
static bool depth_range(const umb_view *view, float *values, size_t count, double *near_depth,
                        double *far_depth)
{
    *near_depth = INFINITY;
    *far_depth = -INFINITY;
    bool parallel = view->projection == UMB_ORTHOGRAPHIC;
    for (size_t k = 0; k < count; ++k) {
        if (values[k] == 0) {
            values[k] = INFINITY;
            continue;
        }
        values[k] = (float)(1.0 / values[k] + (parallel ? view->near_depth - 1.0 : 0.0));
        *near_depth = fmin(*near_depth, values[k]);
        *far_depth = fmax(*far_depth, values[k]);
    }
    return *near_depth <= *far_depth;
}

static double ramp_place(const umb_view *view, double depth, double near_depth, double far_depth)
{
    if (far_depth <= near_depth) {
        return 0;
    }
    return view->projection == UMB_ORTHOGRAPHIC
               ? (depth - near_depth) / (far_depth - near_depth)
               : log(depth / near_depth) / log(far_depth / near_depth);
}

static void draw_ramp_legend(bitmap *im, double near_depth, double far_depth)
{
    int s = im->width >= 800 ? 2 : 1, pad = 6 * s, length = (int)im->width / 5, high = 7 * s;
    char low[32], high_text[32];
    snprintf(low, sizeof low, "%.3g", near_depth);
    snprintf(high_text, sizeof high_text, "%.3g", far_depth);
    int low_width = bitmap_text_width(low, s), text_width = bitmap_text_width(high_text, s);
    int x = pad, y = (int)im->height - high - 3 * pad;
    bitmap_rectangle(im, x, y, low_width + text_width + length + 3 * pad, high + 2 * pad, night,
                     0.75);
    x += pad;
    y += pad;
    bitmap_text(im, x, y, s, low, 0xFFFFFF);
    x += low_width + pad / 2;
    for (int k = 0; k < length; ++k) {
        bitmap_rectangle(im, x + k, y, 1, high, ramp(k / (length - 1.0)), 1);
    }
    bitmap_text(im, x + length + pad / 2, y, s, high_text, 0xFFFFFF);
}

/* The screen rectangle of a box; false if it reaches behind the near plane. */
static bool screen_box(const umb_view *view, const umb_aabb *b, double out[4])
{
    bool parallel = view->projection == UMB_ORTHOGRAPHIC;
    out[0] = out[1] = INFINITY;
    out[2] = out[3] = -INFINITY;
    for (int k = 0; k < 8; ++k) {
        double x = 0, y = 0, w = 0;
        for (int i = 0; i < 3; ++i) {
            double d = (k >> i & 1 ? b->max[i] : b->min[i]) - view->eye[i];
            x += d * view->right[i];
            y += d * view->up[i];
            w += d * view->forward[i];
        }
        if (w < view->near_depth) {
            return false;
        }
        x = ((parallel ? x : x / w) - view->x_min) / (view->x_max - view->x_min);
        y = (view->y_max - (parallel ? y : y / w)) / (view->y_max - view->y_min);
        out[0] = fmin(out[0], x);
        out[1] = fmin(out[1], y);
        out[2] = fmax(out[2], x);
        out[3] = fmax(out[3], y);
    }
    return true;
}

static void draw_boxes(bitmap *im, const model *m, const umb_view *view, const uint32_t *boxes,
                       uint32_t count)
{
    for (uint32_t k = 0; k < count; ++k) {
        double r[4];
        if (boxes[k] < m->object_count && screen_box(view, &m->objects[boxes[k]].bounds, r)) {
            for (int i = 0; i < 4; ++i) {
                r[i] = fmin(2, fmax(-1, r[i])) * (i & 1 ? im->height : im->width);
            }
            int x = (int)floor(r[0]), y = (int)floor(r[1]);
            bitmap_frame(im, x, y, (int)ceil(r[2]) - x, (int)ceil(r[3]) - y, 1, 0x5CE1E6);
        }
    }
}

bool picture_occlusion(bitmap *im, const model *m, const umb_culler *culler, const umb_view *view,
                       const uint32_t *boxes, uint32_t box_count)
{
    uint32_t width = 0, height = 0;
    double near_depth, far_depth;
    umb_culler_read_buffer(culler, NULL, 0, &width, &height);
    size_t count = (size_t)width * height;
    float *values = malloc((count + 1) * sizeof *values);
    bitmap buffer = {0};
    bitmap_fill(im, night);
    if (count == 0 || !values) {
        bitmap_text(im, 12, 12, 2, "this method has no occlusion buffer", 0x9AA3AE);
        free(values);
        return count == 0;
    }
    bool ok = bitmap_create(&buffer, width, height) &&
              umb_culler_read_buffer(culler, values, count, &width, &height);
    if (ok) {
        bool covered = depth_range(view, values, count, &near_depth, &far_depth);
        for (size_t k = 0; k < count; ++k) {
            double at = isinf(values[k]) ? 0 : ramp_place(view, values[k], near_depth, far_depth);
            bitmap_set(&buffer, (int)(k % width), (int)(k / width),
                       isinf(values[k]) ? night : ramp(at));
        }
        bitmap_stretch(im, &buffer);
        if (boxes) {
            draw_boxes(im, m, view, boxes, box_count);
        }
        if (covered) {
            draw_ramp_legend(im, near_depth, far_depth);
        }
    }
    free(values);
    bitmap_free(&buffer);
    return ok;
}

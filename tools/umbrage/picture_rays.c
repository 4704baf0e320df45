#include "picture_rays.h"

#include <math.h>
#include <stdlib.h>

picture_hit picture_rays_one(truth *t, const umb_view *view, double x, double y)
{
    picture_hit hit = {MODEL_NONE, {0, 0, 0}, 0};
    double normal[3] = {0, 0, 0}, direction[3];
    hit.object = truth_pixel(t, view, x, y, &hit.depth, normal);
    picture_rays_direction(view, x, y, direction);
    bool away = normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2] > 0;
    for (int i = 0; i < 3; ++i) {
        hit.normal[i] = (float)(away ? -normal[i] : normal[i]);
    }
    return hit;
}

bool picture_rays_trace(picture_rays *r, truth *t, const umb_view *view, uint32_t width,
                        uint32_t height)
{
    r->hits = malloc((size_t)width * height * sizeof *r->hits);
    r->width = width;
    r->height = height;
    for (uint32_t y = 0; r->hits && y < height; ++y) {
        for (uint32_t x = 0; x < width; ++x) {
            r->hits[(size_t)y * width + x] = picture_rays_one(t, view, (x + 0.5) / width,
                                                              (y + 0.5) / height);
        }
    }
    return r->hits != NULL;
}

void picture_rays_free(picture_rays *r)
{
    free(r->hits);
    r->hits = NULL;
}

void picture_rays_direction(const umb_view *view, double x, double y, double out[3])
{
    double sx = view->x_min + (view->x_max - view->x_min) * x;
    double sy = view->y_max - (view->y_max - view->y_min) * y;
    if (view->projection == UMB_ORTHOGRAPHIC) {
        sx = sy = 0;
    }
    for (int i = 0; i < 3; ++i) {
        out[i] = view->forward[i] + sx * view->right[i] + sy * view->up[i];
    }
    double length = sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]);
    for (int i = 0; i < 3; ++i) {
        out[i] /= length;
    }
}

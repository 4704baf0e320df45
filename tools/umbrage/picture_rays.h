/* What the rays through a picture's pixel centres hit. */
#ifndef PICTURE_RAYS_H
#define PICTURE_RAYS_H

#include "truth/truth.h"

typedef struct picture_hit {
    uint32_t object; /* MODEL_NONE: the sky */
    float normal[3]; /* turned to the eye */
    double depth;
} picture_hit;

typedef struct picture_rays {
    picture_hit *hits; /* row by row from the top */
    uint32_t width, height;
} picture_rays;

bool picture_rays_trace(picture_rays *r, truth *t, const umb_view *view, uint32_t width,
                        uint32_t height);
void picture_rays_free(picture_rays *r);
/* One ray, x and y in [0, 1]. */
picture_hit picture_rays_one(truth *t, const umb_view *view, double x, double y);
/* The unit direction of the sight-line through (x, y). */
void picture_rays_direction(const umb_view *view, double x, double y, double out[3]);

#endif

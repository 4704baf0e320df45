/* A rival: the plain z-buffer. Occluders front to back, one triangle at a time, sampled at pixel centres;
 * then each box by its rectangle and nearest depth. No bound of rounding, no care for what lies between
 * samples. */
#ifndef ZBUFFER_H
#define ZBUFFER_H

#include "screen_boxes.h"

typedef struct zbuffer zbuffer;

zbuffer *zbuffer_create(const world *w, uint32_t width, uint32_t height);
void zbuffer_destroy(zbuffer *z);

/* A whole frame: clear, frustum, sort, draw what is not hidden yet, test every box. Objects' ids, valid
 * until the next frame. */
uint32_t zbuffer_frame(zbuffer *z, const umb_view *view, const uint32_t **objects);

/* The parts of a frame, for other orders of the same work. */
typedef struct zbuffer_box {
    float x_min, x_max, y_min, y_max; /* pixels, not clamped */
    float nearest;                    /* view depth */
} zbuffer_box;

const screen_lens *zbuffer_begin(zbuffer *z, const umb_view *view);
bool zbuffer_hides(zbuffer *z, const zbuffer_box *box);
void zbuffer_draw(zbuffer *z, uint32_t occluder);

#endif

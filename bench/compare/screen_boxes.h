/* What rivals share: the frustum pass over all boxes, and the rectangles and nearest depths of those
 * inside. */
#ifndef SCREEN_BOXES_H
#define SCREEN_BOXES_H

#include "world.h"

/* A view as a rival's floats: pixel x = (x.d) / (w.d) + centre[0], d = p - eye. */
typedef struct screen_lens {
    float eye[3];
    float x[3], y[3], w[3];
    float centre[2];
    float near_depth, far_depth;
    float planes[6][4];
    uint32_t width, height;
} screen_lens;

void screen_lens_make(screen_lens *lens, const umb_view *view, uint32_t width, uint32_t height);

enum { SCREEN_LANES = 8 };

/* Where eight boxes lie in the picture, in pixels, not clamped, and the view depth of the nearest corner. A box
 * that reaches behind the near plane has no rectangle, only a nearest depth below the near plane's. */
typedef struct screen_rects {
    float x_min[SCREEN_LANES], x_max[SCREEN_LANES], y_min[SCREEN_LANES], y_max[SCREEN_LANES];
    float nearest[SCREEN_LANES];
} screen_rects;

void screen_boxes_project(const screen_lens *lens, const float box[6][SCREEN_LANES],
                          screen_rects *out);
/* A bit for each box that is not outside one of the planes. */
uint32_t screen_boxes_inside(const screen_lens *lens, const float box[6][SCREEN_LANES]);

/* One array a component, room to the next multiple of eight. */
typedef struct screen_boxes {
    uint8_t *mask;                        /* a bit for each box of the world */
    uint32_t *box;                        /* those in the frustum, in order */
    float *x_min, *x_max, *y_min, *y_max; /* pixels, not clamped */
    float *nearest;                       /* view depth of the nearest corner */
    uint32_t count;
    uint32_t *place; /* by box: where it stands in the list above; only where the mask says so */
} screen_boxes;

bool screen_boxes_make(screen_boxes *s, const world *w);
void screen_boxes_free(screen_boxes *s);

/* The frustum pass (the yardstick's), then projection, eight boxes at a time. */
void screen_boxes_frame(screen_boxes *s, const world *w, const screen_lens *lens);

/* Sort places by depth, nearest first: count floats, none negative. scratch: as much again. */
void screen_boxes_sort(const float *depth, uint32_t *order, uint32_t *scratch, uint32_t count);

#endif

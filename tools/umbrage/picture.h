/* The pictures that `umbrage render` paints: what the eye sees, object ids, the occlusion
 * buffer, a map. They fill the bitmap that they are given, at its size. Views are in the model's
 * coordinates (the origin subtracted). All return false only when memory is short. */
#ifndef PICTURE_H
#define PICTURE_H

#include "io/bitmap.h"
#include "truth/truth.h"

/* What became of an object in one frame. */
typedef enum picture_state {
    PICTURE_OUTSIDE = 0, /* not in the view: culled by the frustum */
    PICTURE_HIDDEN = 1,  /* in the view, culled as hidden */
    PICTURE_VISIBLE = 2  /* reported */
} picture_state;

/* Fill in states, one picture_state per object, from the reported ids. An object that is not
 * reported is in the view when no single plane of the frustum has its box wholly outside. */
void picture_states(const model *m, const umb_view *view, const uint32_t *visible, uint32_t count,
                    uint8_t *states);

/* What the eye sees: one ray through each pixel's centre, more where the picture changes. */
bool picture_eye(bitmap *im, const model *m, truth *t, const umb_view *view);

/* A colour for each object. With states, what is seen but was not reported is painted magenta:
 * there must be none. states may be NULL. */
bool picture_ids(bitmap *im, truth *t, const umb_view *view, const uint8_t *states);

/* The occlusion buffer after the culler's last frame, by depth: near is pale, far dark,
 * uncovered black. With boxes not NULL, the screen rectangles of these objects are drawn over
 * it. A culler without a buffer gives a black picture that says so. */
bool picture_occlusion(bitmap *im, const model *m, const umb_culler *culler, const umb_view *view,
                       const uint32_t *boxes, uint32_t box_count);

/* The map, seen along the model's up axis (m->up: set it first where the user names another),
 * coloured by state. Only surfaces that face up are drawn, so rooms are seen through their
 * ceilings; where something is above the eye, what lies above it is cut away, or faint where
 * nothing else is. A visible storey shows through hidden ones above it. */
bool picture_map(bitmap *im, const model *m, const umb_view *view, const uint8_t *states);

/* The map around a view cell, as much of it as holds what may be seen from there. States: PICTURE_VISIBLE
 * for what a ray saw, PICTURE_HIDDEN for what the method reported and no ray saw, PICTURE_OUTSIDE for what is
 * proved hidden. */
bool picture_cell_map(bitmap *im, const model *m, const double cell[2][3], const uint8_t *states);

#endif

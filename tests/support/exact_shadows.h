/* Exact polygon clipping in whole numbers: what a set of convex polygons hides of a box, piece by piece. A slow
 * reference that shares nothing with the library. Coordinates are whole numbers of at most 64. */
#ifndef EXACT_SHADOWS_H
#define EXACT_SHADOWS_H

#include <stdbool.h>
#include <stdint.h>

enum { EXACT_CORNERS = 8 };

typedef struct exact_polygon {
    int corners[EXACT_CORNERS][3];
    int count;
} exact_polygon;

/* Which side of the polygon the eye is on: 1 where its corners run counter-clockwise, 0 in its plane. */
int exact_shadows_facing(const exact_polygon *p, const int eye[3]);
/* True if every sight-line from the eye to the box is blocked before it: by polygons of any winding, none edge-on.
 * The box does not hold the eye. */
bool exact_shadows_hide(const exact_polygon *polygons, int count, const int eye[3], const int box_min[3],
                        const int box_max[3]);

#endif

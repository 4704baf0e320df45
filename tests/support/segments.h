/* Segments against the triangles of a model, one by one through a grid of boxes: slow and obvious. */
#ifndef SEGMENTS_H
#define SEGMENTS_H

#include "io/model.h"

typedef struct segments segments;

segments *segments_create(const model *m, bool two_sided);
void segments_free(segments *s);

/* True if nothing blocks the way from a to the point b of a triangle of the object: no front of another triangle, nor a
 * front of the object's own, is met before b, by more than what rounding may hide. */
bool segments_free_way(const segments *s, const double a[3], const double b[3]);

/* The first object met from a to b, from either side; MODEL_NONE: none. */
uint32_t segments_first(const segments *s, const double a[3], const double b[3]);

/* World corners of a triangle of an object. */
void segments_triangle(const segments *s, uint32_t object, uint32_t triangle, double out[3][3]);

#endif

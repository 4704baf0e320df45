/* How much an occluder may hide, as seen from a point: what selection goes by (Gummerus 5.2). Estimates: nothing that
 * hides relies on them. Points are taken relative to the eye. */
#ifndef UMB_MEASURE_H
#define UMB_MEASURE_H

#include "geometry/vec.h"

/* The solid angle of a polygon in steradians, exact but for rounding: up to 2 pi, positive when its corners run
 * counter-clockwise as seen from the eye, negative when clockwise. Corners may lie anywhere but on the eye. */
double umb_measure_solid_angle(const umb_vec3 *corners, uint32_t count);

/* Coorg and Teller's area-angle: area (N . D) / |D|^2 with D the direction to the centre. area: the area vector along
 * the front normal; positive when the eye sees the front. */
double umb_measure_area_angle(umb_vec3 area, umb_vec3 centre);

/* Koltun's growth of the umbra: the polygon is thrown onto two planes across n (of length 1) that lie behind it,
 * delta apart, the first through its farthest corner; the ratio of the areas, greater where the umbra widens faster.
 * 0 unless all corners lie beyond the eye along n. */
double umb_measure_umbra_growth(const umb_vec3 *corners, uint32_t count, umb_vec3 n, double delta);

#endif

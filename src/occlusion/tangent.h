/* Tangent planes of an occluder's edge and a box, by a table (Coorg and Teller 1997, 3.1).
 *
 *        x-----x          Looking along the edge's line (d, at E) a box is a hexagon. A bit or two for each axis says
 *       /       \         on which side of the two sides of the hexagon that run along it E lies: 27 codes. For each
 *      x         x <- t   octant of d and each code a table holds the two corners where the lines through E touch:
 *       \       /
 *        x-----x          t   supporting: seen along d, all of the box lies counter-clockwise of the plane
 *      s     .            s   separating: all of it lies clockwise
 *          E
 *
 * With n = d x (v - a) for one of them and p a viewpoint, g of sight.h is n . (p - a): the supporting plane says whether
 * all of the box is on the occluder's side of the sight-lines past the edge, the separating one whether any is. */
#ifndef UMB_TANGENT_H
#define UMB_TANGENT_H

#include "umbrage/geometry.h"

#include "geometry/vec.h"

/* Corners of a box by number: bit i is set for the upper face along axis i. */
typedef struct umb_tangents {
    uint8_t supporting, separating;
} umb_tangents;

#define UMB_TANGENT_NONE 0xFFu

typedef struct umb_tangent_table {
    umb_tangents at[8][27]; /* NONE: the line goes through the box, or there is no such place */
} umb_tangent_table;

/* Make the table, from what it stands for. */
void umb_tangent_table_make(umb_tangent_table *table);

/* The tangent corners of the edge from a to b and a box. False if the line of the edge goes through the box, or so
 * close to a place where the answer changes that doubles cannot tell. */
bool umb_tangents_find(const umb_tangent_table *table, const float a[3], const float b[3], const umb_aabb *box,
                       umb_tangents *out);

#endif

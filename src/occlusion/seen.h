/* Lines and corners in the picture that a point of view has of the world, with exact sides.
 *
 * A world point p has the image q, a vector whose positive multiples are the same place in the picture:
 *     perspective    q = p - eye
 *     parallel       q = (d_i f_k - d_k f_i, d_j f_k - d_k f_j, f_k), d = p - eye, f = forward, k the axis
 *                    along which f is longest, i and j the two after it
 * A line of the picture is a plane through the eye (parallel: one that holds forward), a linear function n of q; a
 * corner is a point's image, or where two lines cross: n x m. Points and the eye are taken as they are, so that every
 * corner has an exact side of every line, decided
 *     - in doubles, where the value is beyond the bound of its error that is computed with it;
 *     - by what the lines are made of: corners of a line through the same point lie on it;
 *     - in whole numbers, for coordinates that are whole multiples of one small unit;
 *     - and where they are not, the side is unknown: whoever asks must then err on the safe side.
 */
#ifndef UMB_SEEN_H
#define UMB_SEEN_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/bigint.h"

#define UMB_SEEN_UNKNOWN 2

typedef struct umb_seen_from {
    double eye[3], forward[3];
    bool parallel;
    bool exact; /* eye and forward are whole numbers of 2^-shift */
    int axis, shift;
    umb_bigint eye_whole[3], forward_whole[3];
} umb_seen_from;

/* A value and the bound of its error, by component. */
typedef struct umb_seen_vector {
    double at[3], off[3];
} umb_seen_vector;

/* The greatest of both over the components: a bound that is quick to find. */
typedef struct umb_seen_size {
    double most, off;
} umb_seen_size;

/* Two planes that face the viewer, by three points each, in the order in which (c - a) x (b - a) points away from it. */
typedef struct umb_seen_depth {
    const float *front[3], *back[3];
} umb_seen_depth;

typedef struct umb_seen_line {
    umb_seen_vector n;
    umb_seen_size size; /* of n */
    float a[3], b[3]; /* n is image(a) x image(b) */
    const umb_seen_depth *depth; /* if not NULL, n is made of this: positive where front is the farther one */
    bool free;        /* it is not made of a and b: without depth, n is exact */
    bool ready;       /* n is known; cutting finds it when it wants it */
} umb_seen_line;

/* A corner of a convex polygon of the picture, and the edge that leaves it. Polygons run so that their inside is on the
 * positive side of every edge: counter-clockwise with forward pointing at the reader. */
typedef struct umb_seen_corner {
    umb_seen_vector v;
    umb_seen_size size; /* of v */
    const umb_seen_line *first, *second; /* v = sign first x second; NULL: the image of a point */
    umb_seen_line *edge;
    float point[3];
    int8_t sign;
    bool flip;   /* the edge's positive side is its line's negative one */
    bool closed; /* what is beyond the edge is known already */
} umb_seen_corner;

/* reach: at least every coordinate that will be asked about. The finer the points, the fewer sides are exact:
 * coordinates must be multiples of 2^-104 of the reach. */
void umb_seen_prepare(umb_seen_from *s, const double eye[3], const double forward[3], bool parallel, double reach);

void umb_seen_image(const umb_seen_from *s, const float p[3], umb_seen_vector *out);
void umb_seen_line_through(const umb_seen_from *s, const float a[3], const float b[3], umb_seen_line *out);
/* The same, without n. */
void umb_seen_line_later(const float a[3], const float b[3], umb_seen_line *out);
/* The line of a linear function of q, which loses up to 2^-53 of its largest component. */
void umb_seen_line_free(const double n[3], umb_seen_line *out);
/* Where two planes are equally deep, n and its error given; depth stays with the caller. */
void umb_seen_line_depth(const umb_seen_vector *n, const umb_seen_depth *depth, umb_seen_line *out);
/* A corner at a point, without its edge. */
void umb_seen_corner_at(const umb_seen_from *s, const float p[3], umb_seen_corner *out);
/* A corner at sign first x second, without its edge. */
void umb_seen_corner_of(const umb_seen_line *first, const umb_seen_line *second, int sign,
                         umb_seen_corner *out);

/* Side of a line that a corner is on: -1, 0, 1, or UMB_SEEN_UNKNOWN. */
int umb_seen_side(const umb_seen_from *s, const umb_seen_line *line, const umb_seen_corner *corner);
/* The same without doubles, for tests. */
int umb_seen_side_exact(const umb_seen_from *s, const umb_seen_line *line, const umb_seen_corner *corner);

/* A cut of a polygon by a line, on whose sides (never unknown) its corners are. */
typedef struct umb_seen_cut {
    const umb_seen_from *from;
    umb_seen_line *line;
    const umb_seen_corner *in;
    const int8_t *sides;
    uint32_t count;
} umb_seen_cut;

/* Write the part of the polygon on one side of the line (keep: 1 or -1), which it must reach; returns the count, at
 * most one more than before. The new edge is closed. */
uint32_t umb_seen_clip(const umb_seen_cut *cut, int keep, umb_seen_corner *out);

#endif

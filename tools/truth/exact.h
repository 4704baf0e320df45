/* Exact arithmetic for the oracle's confirmations: sums of doubles that do not overlap (Shewchuk's
 * expansions), and what a line does to a triangle, decided without rounding.
 *
 * Exact while no product underflows: exact_in_range() says which inputs are allowed. A value
 * that grows past its room is lost: it says so, and whoever asks must then answer "not
 * confirmed".
 */
#ifndef EXACT_H
#define EXACT_H

#include <stdbool.h>

#define EXACT_TERMS 64

/* The sum of term[0..count), by growing magnitude, no two sharing a bit; count 0 is zero, -1 is
 * lost. */
typedef struct exact {
    int count;
    double term[EXACT_TERMS];
} exact;

void exact_set(exact *x, double value);
void exact_difference(exact *x, double a, double b);
void exact_add(exact *x, const exact *a, const exact *b);
void exact_subtract(exact *x, const exact *a, const exact *b);
void exact_multiply(exact *x, const exact *a, const exact *b);
/* -1, 0, 1; for a lost value 0, and *lost is set. */
int exact_sign(const exact *x, bool *lost);
/* Nearest double, to within two units in the last place. */
double exact_estimate(const exact *x);
/* Zero, or of a size with which degree-six polynomials neither overflow nor underflow. */
bool exact_in_range(double x);

/* The points origin + s * direction. The direction is exact: a difference of doubles, or a
 * vector. */
typedef struct exact_line {
    double origin[3];
    exact direction[3];
    double approximate[3]; /* the direction, rounded */
} exact_line;

void exact_line_through(exact_line *line, const double origin[3], const double point[3]);
void exact_line_along(exact_line *line, const double origin[3], const double direction[3]);

typedef enum exact_meeting {
    EXACT_MISS,    /* no common point */
    EXACT_CROSS,   /* one common point of line and closed triangle */
    EXACT_IN_PLANE /* the line lies in the triangle's plane, or the triangle has no area */
} exact_meeting;

/* Where the line crosses a triangle's plane: s = numerator / denominator. */
typedef struct exact_crossing {
    exact numerator, denominator;
    int facing; /* sign of normal . direction: -1 met from the front (corners counter-clockwise) */
} exact_crossing;

/* out is filled in for EXACT_CROSS only. */
exact_meeting exact_line_triangle(const exact_line *line, float v[3][3], exact_crossing *out,
                                  bool *lost);
/* Sign of a.s - b.s. */
int exact_compare(const exact_crossing *a, const exact_crossing *b, bool *lost);
/* Sign of base + s * slope. */
int exact_along_sign(const exact_crossing *at, const exact *base, const exact *slope, bool *lost);
/* True if a triangle in the line's plane surely has no point on the line before `end`. */
bool exact_in_plane_free(const exact_line *line, float v[3][3], const exact_crossing *end,
                         bool *lost);
/* True if the triangle has no area. */
bool exact_degenerate(float v[3][3], bool *lost);

/* True if p lies on the closed segment from a to b. */
bool exact_on_segment(const double p[3], const double a[3], const double b[3], bool *lost);

/* sum over i of direction[i] * k[i]. */
void exact_direction_dot(const exact_line *line, const double k[3], exact *out);
/* sum over i of (point[i] - from[i]) * k[i]; from NULL: zero. */
void exact_dot(const double point[3], const double from[3], const double k[3], exact *out);

#endif

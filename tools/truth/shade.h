/* The space of sight-lines, and triangles in it, exactly.
 *
 * A sight-line is a vector d of three numbers up to a positive factor: in perspective its
 * direction; in parallel views (x, y, 1), its place across the lines. A triangle's corners are
 * such vectors A0, A1, A2, and its image is the cone that they span: three half-spaces
 * side_k . d >= 0 with side_k = A_{k+1} x A_{k+2}, all turned so that they hold inside. What is
 * linear over the triangle (nearness: one over the distance along d, or minus the depth in
 * parallel views; distances from planes of the view) is, as a function of d, a covector too: the
 * sum of its corner values times side_k, over the determinant of the corners. So all questions are
 * signs of determinants of three covectors: exact, behind a filter in double.
 */
#ifndef SHADE_H
#define SHADE_H

#include "exact.h"
#include "oracle.h"

#define SHADE_MOST_EXACT 20000u /* signs that the filter leaves open before it is given up */
#define SHADE_VIEW_PLANES 6

typedef struct sight_space {
    const oracle_view *v;
    bool parallel;
    int drop, other[2]; /* parallel: coordinates across the lines come from other, along drop */
    int up;             /* coordinates are multiplied by 2^up, so that exact products fit */
    double eye[3];      /* multiplied */
    uint32_t exacts;
    bool lost; /* a number grew too large, or there were too many: nothing is known */
} sight_space;

/* Components of the view's axes are multiplied by this, for the same reason. */
#define SHADE_AXIS_SCALE 0x1p60

/* False when the view's numbers do not fit, or it has extra planes. */
bool shade_start(sight_space *c, const truth *t, const oracle_view *v);

typedef struct covector {
    exact n[3];
    double about[3]; /* each to within two units in the last place */
} covector;

/* A triangle, or the plane at its nearest depth, as lines of sight meet it. */
typedef struct shade {
    covector side[3];
    covector nearness; /* over det */
    covector beyond;   /* at least zero where not nearer than the near plane */
    exact det;         /* positive */
    double det_about;
    int facing; /* -1: met from the front */
    bool crosses_near;
} shade;

/* A triangle's corners, multiplied. */
void shade_scale(const sight_space *c, float v[3][3], double p[3][3]);
/* May a multiplied point be used? */
bool shade_holds(const sight_space *c, const double p[3]);
/* A multiplied point as a sight. */
void shade_sight(const sight_space *c, const double p[3], exact out[3]);
/* axis . (p - eye) - limit, multiplied by 2^60 and 2^up; p is multiplied already, limit is not. */
void shade_value(const sight_space *c, const double axis[3], const double p[3], double limit,
                 exact *out);
/* False when it is seen edge-on, has no area, lies before the near plane, or does not fit. turned:
 * the sides run the other way round. */
bool shade_make(sight_space *c, double p[3][3], shade *out, bool *turned);
/* The planes of the view as functions that are at least zero inside, at the triangle's corners;
 * returns how many. */
uint32_t shade_view_values(const sight_space *c, double p[3][3], exact (*values)[3]);
/* sum of value[k] * side_k: what is linear over the triangle with these corner values. */
void shade_spread(const shade *s, const exact value[3], covector *out);

/* Sign of f at the corner between two lines, the sight l x m. */
int shade_sign(sight_space *c, const covector *f, const covector *l, const covector *m);
/* Is a strictly nearer than b there? */
bool shade_nearer(sight_space *c, const shade *a, const shade *b, const covector *l,
                  const covector *m);
/* At least zero where a is no nearer than b: the line where the two planes meet. */
void shade_behind(const shade *a, const shade *b, covector *out);

void shade_about(covector *c); /* fill in about from n */
void shade_dot(exact *out, const exact a[3], const exact b[3]);
void shade_cross(exact out[3], const exact a[3], const exact b[3]);
void shade_negate(exact *x);

#endif

/* The oracle for regions: what can be seen from anywhere in a box, proven by rays.
 *
 * An object is seen from a cell if some view whose eye is in the closed cell, and whose near plane is
 * at most near_distance away along the line of sight, sees it; a view is what docs/conservative.md
 * says, and so are the two renderers. Each "seen" carries such a line, checked in exact arithmetic
 * against every triangle near it. Rays prove that something is seen, never that it is not: the counts
 * are lower bounds, and the curve tells how near to the truth they may be. Cells and answers are in the
 * model's coordinates (origin subtracted).
 */
#ifndef REGION_TRUTH_H
#define REGION_TRUTH_H

#include "truth.h"

typedef struct region_cell {
    double min[3], max[3]; /* min <= max; a side may be 0 */
    double near_distance; /* what is nearer to the eye than this neither hides nor has to; 0: all does */
} region_cell;

/* A free sight-line: what is seen, from where. */
typedef struct region_witness {
    double eye[3];  /* in the cell */
    double from[3]; /* where the line starts: eye, or at most near_distance along the line */
    double to[3];   /* a point of the triangle */
    uint32_t object, triangle;
    uint8_t renderer;  /* TRUTH_CULLING or TRUTH_TWO_SIDED: for which the line is free */
    uint8_t confirmed; /* 0: an accused object that only rays of floats see */
} region_witness;

typedef struct region_options {
    uint64_t rays; /* budget; 0: 4 million */
    uint64_t volleys; /* so many more, of a cheap kind, at what is accused alone */
    uint64_t seed;
    bool exhaust; /* spend all of it, even where nothing new appears */
    /* Per object, each may be NULL: 1 if a method hid it; 1 if it reported it without being sure.
     * Either kind is aimed at. Without both, everything that is not seen is. */
    const uint8_t *accused, *doubtful;
    umb_tasks tasks; /* the answer is the same for any number of workers */
} region_options;

/* How far the search was after a round. */
typedef struct region_progress {
    uint64_t rays, triangles;
    uint32_t objects;
    /* Of the rays that are spread evenly over the lines that leave the cell: how many, and how
     * many triangles they met exactly once and exactly twice. */
    uint64_t even, once, twice;
} region_progress;

#define REGION_ROUNDS 48 /* later rounds take the last one's place */

typedef struct region_result {
    region_witness *witnesses; /* one a seen triangle, in the order found; then the unconfirmed ones */
    uint32_t *witness_of;      /* per object: its first one; MODEL_NONE: not seen */
    uint32_t witness_count;
    uint64_t *triangles; /* bits, numbered as the objects' triangles follow one another */
    uint64_t seen_triangles;
    uint32_t seen_objects;
    uint32_t *wrong_objects; /* accused objects with a confirmed witness, ascending */
    uint32_t wrong;
    uint32_t unconfirmed; /* accused objects with an unconfirmed one only */
    uint32_t withdrawn;   /* accused objects whose lines exact arithmetic proved not to be free */
    uint64_t rays; /* volleys too */
    uint32_t rounds;
    region_progress progress[REGION_ROUNDS];
    bool budget_spent; /* stopped by the budget, not because nothing new appeared */
} region_result;

/* Search. *out is allocated; free with region_result_free. Any number of calls at once. False with
 * one line in error when memory is short or the cell is no box. */
bool region_search(truth *t, const region_cell *cell, const region_options *options,
                   region_result *out, umb_error *error);
void region_result_free(region_result *r);

/* From the last round: the share of lines whose triangle no even ray met (Good and Turing), and a
 * lower estimate of how many triangles those are (Chao). */
double region_unseen_share(const region_result *r);
double region_unseen_triangles(const region_result *r);

#endif

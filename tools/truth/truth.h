/* The oracle: which objects can be seen, proven by rays. Slow, and shares no code with any method.
 *
 * Definitions are those of docs/conservative.md. Every "visible" carries a witness: one free
 * sight-line, checked in exact arithmetic (docs/oracle.md). Rays prove visibility, never its
 * absence. Views and answers are in the model's coordinates (origin subtracted).
 */
#ifndef TRUTH_H
#define TRUTH_H

#include "io/model.h"

typedef struct truth truth;

/* Which renderer the answer is for: truth is the union of what either would show. */
enum {
    TRUTH_CULLING = 1,  /* back faces neither seen nor blocking */
    TRUTH_TWO_SIDED = 2 /* every face seen and blocking from both sides */
};

/* A sight-line in model coordinates (origin subtracted). */
typedef struct truth_witness {
    double from[3], to[3]; /* a point of the near plane; a point of the object */
    uint8_t renderers;     /* TRUTH_*: the renderer for which this line is free; 0: no witness */
    /* 1: the line was checked in exact arithmetic against every triangle near it. 0 with a
     * renderer: an accused object that only rays of floats see. */
    uint8_t confirmed;
} truth_witness;

typedef struct truth_options {
    uint32_t grid_width, grid_height; /* rays of the dense grid; 0: the view's picture size */
    uint64_t guided_rays; /* budget of rays aimed at objects not yet seen; 0: 4 million */
    /* Per object: 1 if a method hid it. Lines to it that exact arithmetic refutes are told too,
     * unconfirmed. What is searched does not depend on it. NULL: none. */
    const uint8_t *accused;
    /* For long runs over large scenes, whose only question is whether a method was wrong. 0: every
     * object in view that is not seen is aimed at. Else at most so many in a round: accused ones,
     * first those that the grid's depths leave room for in the picture, then those with room one
     * cell beside them, and an eighth anywhere. */
    uint32_t most_targets;
    /* So many accused objects that no ray saw, nearest to being seen first, are decided exactly, as
     * suspected ones always are: proven hidden, or seen after all. */
    uint32_t most_decided;
    uint32_t threads; /* 0: 1 */
} truth_options;

typedef struct truth_result {
    truth_witness *culling;   /* per object */
    truth_witness *two_sided; /* per object */
    uint64_t rays;
    uint32_t in_view;     /* objects with triangles whose box no plane of the view keeps out */
    uint32_t visible;     /* objects with a confirmed witness for either renderer */
    uint32_t unconfirmed; /* accused objects with an unconfirmed one only */
    uint32_t withdrawn;   /* accused objects that rays of floats saw and that are hidden, exactly */
    uint32_t decided_hidden, undecided; /* of the accused objects that were to be decided exactly */
    uint32_t visible_culling, visible_two_sided;
    uint32_t rounds;   /* guided rounds until no new object appeared */
    bool budget_spent; /* stopped by the budget, not because nothing new appeared */
} truth_result;

/* Build over a model (kept by reference; must outlive the oracle). NULL with error filled in. */
truth *truth_create(const model *m, umb_error *error);
void truth_destroy(truth *t);

/* Answer a view. *out is allocated; free with truth_result_free. Any number of calls at once. */
bool truth_view(truth *t, const umb_view *view, const truth_options *options, truth_result *out,
                umb_error *error);
void truth_result_free(truth_result *r);

/* What blocks the way to an object: first hits of rays to points spread over it, most frequent
 * first. Returns how many distinct objects were written (at most capacity). */
uint32_t truth_blockers(truth *t, const umb_view *view, uint32_t object, uint32_t *objects,
                        uint32_t *hits, uint32_t capacity);

/* One ray, for pictures: from the near plane through picture point (x, y) in [0,1]^2, y from the
 * top. Returns the object hit first (MODEL_NONE: nothing) for a renderer that shows both sides;
 * distance is view depth, normal is the face's, unit length. */
uint32_t truth_pixel(truth *t, const umb_view *view, double x, double y, double *depth,
                     double normal[3]);

#endif

/* The promise, checked: one view answered by cullers and by the oracle. */
#ifndef STRICT_H
#define STRICT_H

#include "truth/truth.h"

typedef struct strict_count {
    uint64_t views, objects, in_frustum, reported, truth_visible, wrongly_hidden, unconfirmed, rays;
} strict_count;

/* One culler's answer to a view. */
typedef struct strict_answer {
    const uint32_t *ids;
    uint32_t count;
    const char *label; /* names the view where a wrongly hidden object is printed; NULL: none is */
    strict_count *sum; /* what is found is added here */
} strict_answer;

/* Ask the oracle once about everything that any of the answers leaves out, judge each of them, and
 * print each wrongly hidden object with its witness. False when the oracle itself fails. */
bool strict_check_all(truth *t, const model *m, const umb_view *view, const strict_answer *answers,
                      uint32_t answer_count, const truth_options *options);

/* The same for a single answer. */
bool strict_check(truth *t, const model *m, const umb_view *view, const uint32_t *ids,
                  uint32_t count, const truth_options *options, const char *label,
                  strict_count *sum);

#endif

/* The promise, checked: one view answered by a culler and by the oracle. */
#ifndef STRICT_H
#define STRICT_H

#include "truth/truth.h"

typedef struct strict_count {
    uint64_t views, objects, in_frustum, reported, truth_visible, wrongly_hidden, unconfirmed, rays;
} strict_count;

/* Ask the oracle about everything that ids leaves out, add to count, and print each wrongly hidden object
 * with its witness, after label. False when the oracle itself fails. */
bool strict_check(truth *t, const model *m, const umb_view *view, const uint32_t *ids, uint32_t count,
                  const truth_options *options, const char *label, strict_count *sum);

#endif

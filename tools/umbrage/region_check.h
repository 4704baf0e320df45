/* A cell's answer beside what rays see from it: the lower bound of the sandwich, and the check. */
#ifndef REGION_CHECK_H
#define REGION_CHECK_H

#include "json_text.h"
#include "picture.h"
#include "setup.h"
#include "truth/region_truth.h"
#include "umbrage/region.h"

typedef struct region_check {
    bool done; /* rays were cast */
    region_result result;
    uint64_t seen_triangles; /* of the seen objects, as the method counts them */
} region_check;

/* Cast rays from the query's cell, as the options say, and hold the answer against them. The answer is read
 * only. EXIT_DONE, or another code with the message printed. */
int region_check_run(const setup *s, const options *o, const umb_region_query *query,
                     const umb_region_answer *answer, region_check *out);
/* Per object what became of it, as picture_cell_map() wants it. */
void region_check_states(const region_check *c, const umb_region_answer *answer, const model *m,
                         uint8_t *states);
void region_check_free(region_check *c);

/* Into an open JSON object. */
void region_check_json(const region_check *c, const setup *s, json_text *j);
/* The lines of text below the table, and its row. */
void region_check_row(const region_check *c);
void region_check_text(const region_check *c, const setup *s, const options *o);

/* EXIT_CHECK if something that is seen was left out. */
int region_check_code(const region_check *c);

#endif

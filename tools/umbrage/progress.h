/* How far long work has come, on standard error. */
#ifndef PROGRESS_H
#define PROGRESS_H

#include "options.h"

typedef struct progress {
    const char *what; /* "views" */
    uint32_t total;
    double started, shown; /* ms */
    bool on, terminal, printed;
} progress;

/* Silent unless standard error is a terminal or --progress was given. */
progress progress_begin(const options *o, const char *what, uint32_t total);
/* done of total are finished: percent, rate and the time left, five times a second at most, in a
 * log once. */
void progress_step(progress *p, uint32_t done);
/* Clear the line. */
void progress_end(progress *p);

/* Say what is being done, for work without steps; NULL: it is done. Silent as above. */
void progress_note(const options *o, const char *what);

/* Milliseconds of a clock that only goes forward. */
double progress_clock(void);

#endif

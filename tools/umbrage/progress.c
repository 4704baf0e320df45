#include "progress.h"

#include <stdio.h>
#include <time.h>
#include <unistd.h>

double progress_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

progress progress_begin(const options *o, const char *what, uint32_t total)
{
    progress p = {.what = what, .total = total, .started = progress_clock()};
    p.terminal = isatty(STDERR_FILENO) != 0;
    p.on = p.terminal || options_given(o, "progress");
    p.shown = p.started;
    return p;
}

void progress_step(progress *p, uint32_t done)
{
    if (!p->on || done == 0 || p->total == 0) {
        return;
    }
    double now = progress_clock();
    if (now - p->shown < (p->terminal ? 200.0 : 1000.0) && done < p->total) {
        return;
    }
    double rate = done / (now - p->started + 1e-3) * 1e3;
    /* A terminal's line is written over, a log gets lines. */
    fprintf(stderr, "%s%3.0f %%  %u of %u %s  %.3g a second  %.0f s left%s",
            p->terminal ? "\r\033[K" : "", 100.0 * done / p->total, done, p->total, p->what, rate,
            (p->total - done) / rate, p->terminal ? "" : "\n");
    fflush(stderr);
    p->shown = now;
    p->printed = true;
}

void progress_end(progress *p)
{
    if (p->printed && p->terminal) {
        fputs("\r\033[K", stderr);
    }
}

void progress_note(const options *o, const char *what)
{
    bool terminal = isatty(STDERR_FILENO) != 0;
    if (terminal) {
        fprintf(stderr, "\r\033[K%s", what ? what : "");
        fflush(stderr);
    } else if (what && options_given(o, "progress")) {
        fprintf(stderr, "%s\n", what);
    }
}

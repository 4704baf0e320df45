/* One contest: all contestants over the same views of the same world, in one run. */
#ifndef CONTEST_H
#define CONTEST_H

#include "entries.h"
#include "item_buffer.h"

typedef struct contest_row {
    char name[64];
    const char *about;
    bool ours, standard;
    bool charted;          /* in plots: the standard configuration and the rivals */
    double reported;       /* objects a view */
    uint64_t wrong;        /* objects hidden that own pixels, over all views */
    uint32_t worst_pixels; /* owned by the largest of them */
    uint32_t worst_object, worst_view;
    double hidden_share; /* of the objects in the frustum */
    double median_ms, worst_ms;
    double units;   /* median in medians of the yardstick */
    double to_ours; /* median in medians of the standard configuration; 0: it took no part */
    double apart_ms;
    const char *apart;
} contest_row;

typedef struct contest {
    char world[48], cameras[48], spec[256], about[160];
    uint32_t why; /* ENTRY_* */
    uint32_t objects, occluder_triangles, view_count, rounds;
    uint32_t width, height;   /* the oracle's picture */
    double exact, in_frustum; /* objects a view */
    double unit_ms;           /* median of the yardstick */
    double limit;             /* the standard configuration may cost so many units; 0: any */
    contest_row rows[ENTRIES_MOST];
    uint32_t row_count;
    bool failed; /* one of ours hid what can be seen, or the limit was passed */
} contest;

/* Measure. False with error filled in when a frame fails or memory is short. */
bool contest_run(contest *out, const world *w, const cameras *c, const item_buffer *truth,
                 uint32_t why, uint32_t rounds, umb_error *error);

/* Every occluder of the world is moved a little before each frame, by turns away and back; the standard
 * configuration answers. Adds a row to a contest of the same world and views: its commit stands apart. */
bool contest_moved(contest *out, const world *w, const cameras *c, const item_buffer *truth,
                   uint32_t rounds, umb_error *error);

/* Median of count values, which are sorted. */
double contest_median(double *values, uint32_t count);

#endif

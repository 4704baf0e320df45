/* The long run: many views of many scenes, each answered by a culler and held against the oracle.
 * soak.c says how it is used. */
#ifndef SOAK_H
#define SOAK_H

#include <signal.h>

#include "support/planted.h"
#include "support/strict.h"
#include "umbrage/region.h"

#define SOAK_BATCH                                                                                 \
    16u /* views that one culler answers one after the other, and that are saved at once */

typedef enum soak_style {
    SOAK_ORDINARY = 0,    /* standing, flying, walking, turned, parallel, wide, narrow */
    SOAK_ADVERSARIAL = 1, /* from, along and through the scene's own vertices, edges and faces */
    SOAK_MICRO = 2,       /* a scene of tests/support/micro_scenes.h for every second view */
    SOAK_CELLS = 3,       /* view cells instead of views: ordinary and adversarial by turns */
    SOAK_MICRO_CELLS = 4  /* a micro scene for every cell */
} soak_style;

/* One row of the table. */
typedef struct soak_part {
    char name[64];
    char scene[512];    /* gen:..., medley:COUNT, or a file */
    const char *family; /* rows of one family are summed */
    soak_style style;
    uint32_t views;
    uint32_t most_targets, most_decided;
    uint64_t rays; /* guided ones a view; all of a cell */
    double shift;  /* how many of its own extents the scene is moved away from the origin */
    bool weld;
} soak_part;

typedef struct soak_plan {
    soak_part *parts; /* those of one scene stand side by side */
    uint32_t count;
} soak_plan;

/* The parts of a run: of the short one (seconds) or the full one, with counts of views multiplied
 * by scale. Adds the real scenes of UMBRAGE_SCENES when that is set. */
bool soak_plan_make(bool full, double scale, soak_plan *out, umb_error *error);
void soak_plan_free(soak_plan *p);

/* A scene with everything that looks at it. Micro parts have none. */
typedef struct soak_scene {
    char scene[512];
    double shift;
    bool weld;
    plant planted;
    model *model;
    umb_scene *built;
    umb_index *index, *flat, *kd; /* the last two: small scenes only */
    truth *oracle;
    camera_path path; /* its own, in the model's coordinates; count 0: none */
} soak_scene;

bool soak_scene_load(const soak_part *part, plant planted, soak_scene *out, umb_error *error);
void soak_scene_free(soak_scene *s);

/* A model of count objects of all kinds in no order (medley.c). NULL when memory is short. */
model *soak_medley(uint32_t count, uint64_t seed);

/* View number `number` of a style; equal arguments give equal views. False where the scene has
 * nothing to look at. */
bool soak_view_ordinary(const soak_scene *s, uint64_t number, umb_view *out);
bool soak_view_adversarial(const model *m, uint64_t number, umb_view *out);
/* What kind of view that is, for people. */
const char *soak_view_kind(uint64_t number);

/* View cell number `number`, the method's settings with it. Its kind is the number modulo SOAK_KINDS. */
#define SOAK_KINDS 9u
bool soak_cell(const model *m, const camera_path *path, uint64_t number, umb_region_query *out);
const char *soak_cell_kind(uint64_t number);

/* Of cells of one kind. */
typedef struct soak_kind {
    uint64_t cells, rays, hidden, wrong; /* hidden: pairs of a cell and an object that its set lacks */
} soak_kind;

/* What was counted, over views. seen: objects in view with an exactly confirmed sight-line. */
typedef struct soak_count {
    uint64_t views, pairs, seen, reported, wrong, unconfirmed, rays;
    uint64_t proven, open; /* hidden objects looked at exactly: proven hidden, not decided. Of cells:
                              objects in the sets before refinement, undecided ones after it */
    double seconds;        /* of one thread each */
    soak_kind kinds[SOAK_KINDS];
} soak_count;

void soak_count_add(soak_count *sum, const soak_count *c);

/* Who holds a cell's answer against rays. */
typedef struct soak_judge {
    const soak_part *part;
    const model *model;
    truth *oracle;
    const char *folder; /* where wrongly hidden objects are told */
    bool print;
} soak_judge;

bool soak_judge_cell(const soak_judge *j, umb_region *region, const camera_path *path,
                     uint64_t number, soak_count *sum, umb_error *error);

/* Saved progress of one part: a text file, a line a batch. */
typedef struct soak_log {
    char file[1200];
    uint8_t *done; /* per batch */
    uint32_t batches;
    soak_count sum; /* of the batches that are done */
} soak_log;

/* Take up what the file of an equal run says; key tells whether it is one. */
bool soak_log_open(soak_log *log, const char *folder, const soak_part *part, uint64_t key,
                   umb_error *error);
/* Append a batch. One call at a time. */
bool soak_log_add(soak_log *log, uint32_t batch, const soak_count *c);
void soak_log_close(soak_log *log);

/* How a part is run. */
typedef struct soak_run {
    const soak_part *part;
    const soak_scene *scene;
    soak_log *log;
    const char *folder; /* wrongly-hidden.txt and unconfirmed.txt there name objects with their lines */
    uint32_t threads;
    uint32_t most_batches;             /* stop after so many new ones */
    bool quiet;                        /* no progress */
    const volatile sig_atomic_t *stop; /* set by a signal */
} soak_run;

/* Do the batches of a part that are not done. False with one line in error when something fails
 * that is no answer. */
bool soak_run_part(const soak_run *run, umb_error *error);
/* One view alone, everything about it printed. */
bool soak_run_view(const soak_run *run, uint64_t number, umb_error *error);

/* Pseudo-random numbers: the same everywhere (splitmix64). */
typedef struct soak_dice {
    uint64_t state;
} soak_dice;

static inline uint64_t soak_next(soak_dice *d)
{
    uint64_t z = d->state += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

static inline double soak_between(soak_dice *d, double low, double high)
{
    return low + (high - low) * ((double)(soak_next(d) >> 11) * 0x1p-53);
}

static inline uint32_t soak_below(soak_dice *d, uint32_t n)
{
    return (uint32_t)(soak_next(d) % n);
}

#endif

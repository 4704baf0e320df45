/* One search of a view: workers that cast rays, and how what they find is merged so that the answer
 * does not depend on their number.
 *
 * Work comes as phases of numbered items. An item's rays depend on its number and on what was
 * known when its block of items began, never on what other workers find meanwhile; a find is
 * named by its ray number (phase, item, ray of the item) and the smallest number wins.
 */
#ifndef SEARCH_H
#define SEARCH_H

#include "oracle.h"

#define NO_RAY 0 /* phases count from 1 */
/* Set in the numbers of rays along edges: any other find of the block is preferred. */
#define RAY_ALONG_EDGE ((uint64_t)1 << 63)

/* What is known of one object for one renderer. A find is a ray's word until it is verified; one
 * that exact arithmetic refutes is forgotten, and remembered as a leak. */
typedef struct find {
    uint64_t ray; /* NO_RAY: not seen */
    double through[3], from[3], to[3];
    uint32_t triangle;
    uint8_t renderers;
    uint8_t refuted; /* how many finds of this object were leaks */
} find;

/* What the scans over all objects ask of a find and a leak, so that these are not touched for the many objects that
 * have none. A byte each renderer and object, written by one worker at a time. */
enum {
    FLAG_SEEN = 1u << 0,     /* finds: ray is not NO_RAY */
    FLAG_VERIFIED = 1u << 1, /* finds: verified */
    FLAG_LEAK = 1u << 2,     /* leaks: there is one */
    FLAG_WITHDRAWN = 1u << 3 /* there was one, and the object is proven hidden */
};

typedef struct find_event {
    find what;
    uint32_t object;
} find_event;

typedef struct worker {
    struct search *s;
    oracle_trace trace;
    uint64_t ray;      /* number of the ray being cast */
    uint8_t *reported; /* per object: renderers that this worker has an event for; two bits up,
                                those by rays along edges */
    find_event *events;
    size_t event_count, event_capacity;
    uint64_t *triangles; /* seen triangles, some more than once */
    size_t triangle_count, triangle_capacity;
    uint64_t recent[256]; /* triangles put there lately */
    bool along_edge; /* the rays being cast may slip through cracks of floats: what they see gets no
                                borders walked */
    bool failed;
} worker;

typedef struct search {
    truth *t;
    const truth_options *options;
    oracle_view view;
    find *finds[2];   /* per object: for TRUTH_CULLING, for TRUTH_TWO_SIDED */
    uint8_t *flags[2]; /* per object: FLAG_... */
    uint8_t *near;     /* per object: how near it is to being seen (nearness.c), plus one; 0: not looked at yet */
    uint8_t *in_view; /* per object: its box meets the view */
    uint64_t *known;  /* bits: triangles seen */
    uint64_t *fresh;  /* triangles seen since the borders were last walked, ascending */
    size_t fresh_count, fresh_capacity;
    uint64_t *border; /* triangles whose borders the running phase walks */
    size_t border_capacity;
    uint32_t *targets; /* objects that the running phase aims at */
    uint32_t target_count;
    uint32_t *grid;    /* object seen through each grid cell, both sides shown */
    float *grid_depth; /* view depth beyond near up to which either renderer sees there */
    uint32_t grid_width, grid_height;
    truth_witness *proven[2]; /* per object: verified finds */
    find *leaks[2];           /* per object: the first refuted find, where flags say so */
    uint32_t asked; /* targets to be decided that nothing speaks against; suspected ones follow */
    uint8_t *verdicts; /* cover_verdict, two per target of the last phase */
    worker *workers;
    uint32_t worker_count;
    uint64_t phase, round;
    uint64_t guided, budget; /* rays of the guided phases so far */
    uint64_t news;           /* verified finds of objects not seen before, of the running round */
    bool spent, failed;
} search;

typedef void (*search_item)(worker *w, uint64_t item);

/* Do items [0, count) in blocks; guided phases stop between blocks when the budget is spent. */
void search_phase(search *s, search_item item, uint64_t count, bool guided);
/* Cast the ray through a point and note what it shows. w->trace keeps it. False: not in the
 * picture. */
bool search_cast(worker *w, const double through[3]);
/* The same, aimed at a point of a triangle: the object counts as seen too when what the ray met
 * lies at the same depth as the point or behind it. Returns for which renderers the ray showed
 * the object. */
uint8_t search_aim(worker *w, const double through[3], uint32_t object, uint32_t triangle);
/* Renderers for which the object had been seen when the running block began. */
uint8_t search_known(const search *s, uint32_t object);

/* Leave of the targets at most so many, those nearest to being seen (nearness.c). */
void search_choose_nearest(search *s, uint32_t most);

/* Rays just outside the silhouette edges of a newly seen triangle (borders.c). */
void border_item(worker *w, uint64_t item);

#endif

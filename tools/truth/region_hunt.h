/* What the files of the search from a region share.
 *
 * Work comes as phases of numbered items, in blocks of REGION_HANDS tasks. What an item casts
 * depends on its number, the seed and what was known when its block began; what the tasks of a
 * block find is joined in their order. So nothing depends on the number of workers.
 */
#ifndef REGION_HUNT_H
#define REGION_HUNT_H

#include "oracle.h"
#include "region_truth.h"

#define REGION_HANDS 64u

/* Per triangle: seen; how many of its finds were refuted; how many even rays met it, up to 3. */
enum { REGION_SEEN = 1, REGION_LEAK = 2, REGION_LEAKS = 7 * REGION_LEAK, REGION_EVEN = 16 };

/* Per object, what speaks for aiming at it: it was named, or it lies right behind what is seen or may
 * be seen as far as the method knows. */
enum { REGION_POSSIBLE = 1, REGION_LIKELY = 2 };

/* A ray's word that a triangle is seen, until exact arithmetic looks into it. */
typedef struct region_find {
    double eye[3], through[3]; /* a point of the cell, a point of the triangle */
    double near_depth;
    uint32_t object, triangle;
    uint8_t renderer;
    bool proven;
    region_witness witness; /* where proven */
} region_find;

struct region_hunt;

/* What one task of a block works with. */
typedef struct region_hand {
    struct region_hunt *hunt;
    oracle_trace trace;
    region_find *finds;
    uint32_t find_count, find_capacity;
    uint64_t recent[1024]; /* triangles that it found lately */
    uint32_t *behind;      /* objects that lie right behind what is seen, some more than once */
    uint32_t behind_count, behind_capacity;
    uint64_t rays, even;
    bool failed;
} region_hand;

typedef struct region_hunt {
    truth *t;
    const region_cell *cell;
    const region_options *options;
    oracle_view reach; /* how far rays go; nothing else of it is used */
    double area[3];  /* of the cell's faces across each axis, and what an evenly drawn one takes */
    bool occupied;   /* something lies in the cell: rays start inside too */
    uint8_t *states; /* per triangle */
    uint32_t *witness_of;
    region_witness *witnesses;
    uint32_t witness_count, witness_capacity;
    region_find *leaks; /* per accused object with refuted finds, by number: the first one */
    uint32_t leak_count, leak_capacity;
    uint32_t *leak_of;                                         /* per object */
    uint64_t next_even, next_spread, next_border, next_target; /* items not done yet */
    uint8_t *candidate;                                        /* per object */
    uint32_t *targets;                                         /* likely ones first */
    uint32_t target_count, likely_count;
    uint32_t *hidden; /* accused objects that nothing was seen of, those right behind what is seen first */
    uint32_t hidden_count, near_hidden;
    uint64_t phase, round, cast, budget;
    region_hand *hands;
    uint64_t first_item, item_count, items_per_task; /* of the running block */
    void (*item)(region_hand *hand, uint64_t item);
    region_find **pending; /* finds of a block, one a triangle */
    uint32_t pending_count, pending_capacity;
    bool failed;
} region_hunt;

typedef void (*region_item)(region_hand *hand, uint64_t item);

/* Do items [first, first + count), each of about so many rays, until so many rays are cast or the
 * budget is spent; returns how many items were done. */
uint64_t region_phase(region_hunt *h, region_item item, uint64_t first, uint64_t count,
                      uint32_t rays_each, uint64_t most);

/* Even rays: a point of the cell's boundary and a direction out of it. One item is a run of them. */
#define REGION_EVEN_RUN 64u
void region_even_item(region_hand *hand, uint64_t item);
/* From anywhere of the cell towards somewhere in an object's box. */
void region_spread_item(region_hand *hand, uint64_t item);
/* Around the border of a seen triangle (region_guide.c). Item: number of a witness. */
void region_border_item(region_hand *hand, uint64_t item);
/* At objects that are not seen, and at triangles that are not seen of objects that are. */
void region_target_item(region_hand *hand, uint64_t item);

/* Many rays from one eye at one hidden object (region_volley.c). */
#define REGION_VOLLEY 64u
void region_volley_item(region_hand *hand, uint64_t item);
/* Who is hidden, as known now. False when memory is short. */
bool region_volley_prepare(region_hunt *h);

/* A point of the cell: `random` chooses among its corners, edges, faces and, where something lies
 * in it, its inside. */
void region_eye(const region_hunt *h, uint64_t random, double out[3]);
/* Where the line from `from` through `by` first meets the cell beyond `by`; false: it does not. */
bool region_line_eye(const region_cell *cell, const double from[3], const double by[3],
                     double eye[3]);

/* Cast from an eye of the cell through a point and note what is seen. The hand's trace keeps what was
 * met. */
void region_cast(region_hand *hand, const double eye[3], const double through[3]);
/* The same for a ray aimed at a point of a triangle, which counts as seen too if the ray is stopped
 * at the point's depth or behind. Returns true if the point was reached. */
bool region_aim(region_hand *hand, const double eye[3], const double point[3], uint32_t object,
                uint32_t triangle);

/* A triangle's state while other tasks count even rays. */
uint8_t region_state(const region_hunt *h, uint64_t number);

/* Is the find true? Fills in its witness. */
bool region_confirm(const region_hunt *h, region_find *f);
/* Is no line of sight from the find's eye to its object free? 1: none is; 0: not decided; -1: one is,
 * and the witness is filled in. */
int region_refute(const region_hunt *h, region_find *f);

#endif

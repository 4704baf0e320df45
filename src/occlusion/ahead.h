/* Looking ahead: images of occluders found by other threads before the walk asks for them.
 *
 *   walk      . . A . . . C . D . . .      takes what is ready and merges it; finds the rest itself
 *   helper        [B ] [D  ] [E ]          next guesses, from somewhat ahead of the walk on
 *
 * The walk is serial by nature: what it does next depends on all that it has drawn. But an occluder's image is a
 * function of the view and the occluder alone, and most of the work. Those that the last frame drew, in its order,
 * are a good guess of what this frame draws. An image is the same whoever finds it, and merging it gives the same
 * bits as drawing it; so guesses, threads and timing decide nothing but time. An image that is half found when its
 * turn comes is waited for a little; if its thread has been put to sleep, it is found again. */
#ifndef UMB_AHEAD_H
#define UMB_AHEAD_H

#include <stdatomic.h>

#include "mesh_image.h"

enum { UMB_AHEAD_HELPERS = 7 };

/* One guess. */
typedef struct umb_ahead_image {
    uint32_t occluder;
    _Atomic uint32_t state; /* UMB_AHEAD_*: whoever turns FREE into TAKEN owns the rest until READY */
    bool drawn;             /* it covers something, or nearly */
    uint32_t edge_count;
    umb_tile_list list;
} umb_ahead_image;

enum {
    UMB_AHEAD_FREE,
    UMB_AHEAD_TAKEN, /* a helper is at it */
    UMB_AHEAD_READY,
    UMB_AHEAD_LEFT /* to the walk: it came first, or there was no room */
};

typedef struct umb_ahead_helper {
    umb_mesh_scratch scratch;
    umb_tile *tiles; /* of the lists that it made, one after the other */
    uint32_t *numbers;
    size_t tile_capacity, number_capacity, used;
} umb_ahead_helper;

typedef struct umb_ahead {
    const umb_raster_kernels *kernels;
    const umb_raster_map *map;
    const umb_committed *scene;
    umb_ahead_image *images;
    uint32_t *place;    /* per occluder: where in images it is, if it is; any number else */
    uint32_t *noted;    /* what this frame drew, in order */
    size_t image_capacity, place_capacity, noted_capacity;
    uint32_t image_count, noted_count;
    uint64_t noted_work;
    umb_ahead_helper helpers[UMB_AHEAD_HELPERS];
    uint32_t helper_count;
    bool on;
    _Atomic uint32_t next; /* guess for the next helper */
    _Atomic uint32_t walk; /* guesses that the walk has asked for: about as far as it is */
    _Atomic bool done;     /* the walk has ended */
} umb_ahead;

void umb_ahead_free(umb_ahead *a, const umb_allocator *allocator);

/* Begin a frame, from what the last one noted; map and scene stay the caller's. Returns how many helpers may be
 * called, each from one thread: 0 when there is too little to do, or no memory. */
uint32_t umb_ahead_begin(umb_ahead *a, const umb_allocator *allocator, const umb_raster_kernels *kernels,
                         const umb_raster_map *map, const umb_committed *scene, uint32_t workers);
/* Find images until there are no more guesses or the walk has ended. */
void umb_ahead_help(umb_ahead *a, uint32_t helper);

/* The walk's side. An image that is ready, or NULL: find it. */
const umb_ahead_image *umb_ahead_take(umb_ahead *a, uint32_t occluder);
/* It has drawn an occluder whose outline has so many edges. */
void umb_ahead_note(umb_ahead *a, uint32_t occluder, uint32_t edge_count);
void umb_ahead_end(umb_ahead *a);

#endif

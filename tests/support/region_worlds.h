/* A model with a scene, an index and an engine for view cells, and segments through it: what is reported hidden is not reached by
 * one from the cell. */
#ifndef REGION_WORLDS_H
#define REGION_WORLDS_H

#include "bake/region_state.h"
#include "support/failing.h"
#include "support/segments.h"

typedef struct world {
    model *model;
    umb_scene *scene;
    umb_index *index;
    umb_region *region;
    segments *segments;
    umb_error error;
} world;

/* UMBRAGE_TEST_SIZE is small. */
bool is_small(void);

/* How many cells to look from: so many in a normal run. */
uint32_t cells(uint32_t small, uint32_t normal);

/* In [0, 1). */
double unit(dice *d);

/* Takes the model over. */
void open_model(world *w, model *m, bool weld, bool two_sided);
void open_world(world *w, const char *name, bool weld);
void close_world(world *w);

typedef struct tally {
    uint32_t cells, hidden, rays, objects, wrong;
} tally;

/* No segment from the cell reaches an object that is not among the ids. */
void check_hidden(const world *w, const umb_region_query *q, const uint32_t *ids, uint32_t count, uint32_t rays, dice *d, tally *t);

/* Solve and refine, and check what is hidden. */
void ask(world *w, const umb_region_query *q, uint32_t rays, dice *d, tally *t);

/* A cell somewhere in or around the scene, sometimes flat, sometimes large. */
void draw_cell(dice *d, const umb_aabb *b, umb_region_query *q);

/* How to ask: resolution, squares, vertical and so on. */
void draw_way(dice *d, umb_region_query *q);

/* A copy of a list of ids; its ids are to be freed. */
typedef struct id_set {
    uint32_t *ids, count;
} id_set;

id_set id_set_copy(const uint32_t *ids, uint32_t count);

/* A cube of side one around zero; out: the mesh's number. */
model *model_with_cube(uint32_t *out);

#endif

/* Scenes for tests of indices: sets of boxes of every kind, named indices over them. */
#ifndef INDEX_SETS_H
#define INDEX_SETS_H

#include "random_boxes.h"
#include "umbrage/umbrage.h"

#define INDEX_REACH 100

typedef enum index_set {
    INDEX_SPREAD,    /* of every shape, all over the place */
    INDEX_CROWDED,   /* small ones in clusters */
    INDEX_EQUAL,     /* all the same */
    INDEX_POINTS,    /* all the same point */
    INDEX_COLLINEAR, /* sheets in a row */
    INDEX_NESTED,    /* each in the next */
    INDEX_GEOMETRIC, /* at the powers of two along the axes */
    INDEX_SHEETS,    /* walls of a lattice: faces that coincide */
    INDEX_ABSURD,    /* denormal, huge, endless */
    INDEX_SETS
} index_set;

umb_aabb index_set_box(uint64_t *seed, index_set set, uint32_t i);
umb_transform index_place(uint64_t *seed);
/* Every fifth object of INDEX_SPREAD is a shape's, some occluders stand alone there, and every ninth id is free. */
umb_scene *index_scene(uint64_t seed, index_set set, uint32_t count, const umb_allocator *allocator);
umb_index *index_make(umb_scene *scene, const char *name);
/* Move some objects of such a scene, not far or anywhere. */
void index_move_some(umb_scene *scene, uint64_t *seed, uint32_t count, bool far);

#endif

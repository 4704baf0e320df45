/* What every contestant of a comparison is given: the same objects, the same occluder triangles. */
#ifndef WORLD_H
#define WORLD_H

#include "io/model.h"

/* Triangles of one object that hide. Corners run counter-clockwise seen from the front. */
typedef struct world_occluder {
    uint32_t box; /* its object's place in the list of boxes */
    uint32_t first_vertex, vertex_count;
    uint32_t first_triangle, triangle_count;
} world_occluder;

typedef struct world {
    char name[48];  /* as files and tables call it */
    char spec[256]; /* as model_load was given it */
    model *model;
    umb_scene *scene;     /* welded, committed */
    umb_index *index[2];  /* by umb_index_kind */
    double index_ms[2];   /* to build it */
    uint32_t box_count;   /* objects that have triangles */
    uint32_t *box_object; /* their ids */
    float *box[6];        /* components, room to the next multiple of sixteen */
    world_occluder *occluders;
    uint32_t occluder_count;
    float *vertices; /* 3 each, world space */
    uint32_t vertex_count;
    uint32_t *indices;  /* 3 each, into vertices; no triangle is there twice */
    uint8_t *two_sided; /* per triangle */
    uint32_t triangle_count;
    const struct foundation_interface *foundation; /* takes part too; NULL: it does not */
} world;

/* Read a scene. Objects below occluder_objects hide, for rivals (a rival is told which objects are worth
 * it; the library takes them all). False with error filled in. */
bool world_load(world *w, const char *name, const char *spec, uint32_t occluder_objects,
                umb_error *error);
void world_free(world *w);

/* Wall clock, in ms. */
double world_clock(void);

#endif

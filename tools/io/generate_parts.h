/* What the generators share: random numbers, small meshes, paths, the table of generators.
 *
 * A generated scene is the same to the bit on every machine: random numbers are our own, and all
 * arithmetic is +, -, *, / and square root, which IEEE 754 rounds exactly. (`blocks` alone calls
 * sin and cos, because its recipe does; a libm that differs in their last bit can move a float
 * by one step.) / */
#ifndef GENERATE_PARTS_H
#define GENERATE_PARTS_H

#include "model.h"

#define GENERATE_MAX_KEYS 4

typedef struct generate_key {
    const char *name; /* NULL ends the list */
    uint64_t standard, min, max;
} generate_key;

typedef struct generate_kind {
    const char *name;
    generate_key keys[GENERATE_MAX_KEYS];
    /* Values come in the order of keys. Both return false only when memory is short. */
    bool (*model)(const uint64_t *values, model *m);
    bool (*path)(const uint64_t *values, camera_path *out);
} generate_kind;

extern const generate_kind generate_blocks, generate_city, generate_boxfield, generate_building, generate_sodacity;

/* splitmix64 (Steele, Lea and Flood 2014). */
typedef struct generate_random {
    uint64_t state;
} generate_random;

uint64_t generate_next(generate_random *r);
/* In [0, 1), 24 bits. */
double generate_unit(generate_random *r);
/* In [0, count). */
uint32_t generate_below(generate_random *r, uint32_t count);
/* An independent stream for each (seed, a, b): what stands at one place does not depend on what was
 * made before it. */
generate_random generate_stream(uint64_t seed, int64_t a, int64_t b);

/* A triangle mesh under construction. failed is set when memory is short and sticks. */
typedef struct generate_mesh {
    model_mesh mesh;
    uint32_t position_capacity, triangle_capacity;
    bool failed;
} generate_mesh;

uint32_t generate_vertex(generate_mesh *g, double x, double y, double z);
void generate_triangle(generate_mesh *g, uint32_t a, uint32_t b, uint32_t c);
/* The quadrilateral a b c d, cut from a to c. */
void generate_quad(generate_mesh *g, uint32_t a, uint32_t b, uint32_t c, uint32_t d);
/* Twelve triangles on eight corners whose bits 0, 1, 2 choose the high x, y, z; facing outwards. */
void generate_box_faces(generate_mesh *g, const uint32_t corners[8]);
void generate_box(generate_mesh *g, const double min[3], const double max[3]);
/* Move the mesh into the model and empty g for the next one. MODEL_NONE when memory is or was
 * short. */
uint32_t generate_mesh_add(generate_mesh *g, model *m);
void generate_mesh_free(generate_mesh *g);

/* Append a row. */
bool generate_look(camera_path *p, const double eye[3], const double target[3]);

umb_transform generate_translation(double x, double y, double z);

#endif

/* What the oracle's files share: the traced scene, sight-lines, and one search of a view. */
#ifndef ORACLE_H
#define ORACLE_H

#include <embree3/rtcore.h>
#include <pthread.h>

#include "truth.h"

/* A traced geometry's triangles: primitive number -> object (flattened scenes) and mesh
 * triangle. */
typedef struct oracle_part {
    uint32_t *objects; /* NULL in instanced scenes: the instance says it */
    uint32_t *triangles;
    uint32_t count;
} oracle_part;

/* Geometry numbers: how a triangle blocks. */
enum { PART_BOTH_SIDES = 0, PART_ONE_SIDE = 1, PART_OPEN = 2, PART_KINDS = 3 };

/* Triangles [first, last) of an object and the box around them. */
typedef struct oracle_chunk {
    umb_aabb box;
    uint32_t object, first, last;
} oracle_chunk;

/* A node of the tree over chunks, in the order of a walk; after: the node to go on with when
 * this one is passed over. */
typedef struct oracle_box_node {
    umb_aabb box;
    uint32_t after;
} oracle_box_node;

struct truth {
    const model *model;
    RTCDevice device;
    RTCScene scene;
    bool flat;       /* one soup of world vertices; else instances of mesh scenes */
    float *vertices; /* flat: world vertices of all objects */
    uint32_t *indices[PART_KINDS];
    uint64_t *first_vertex;   /* flat: per object, into vertices */
    uint64_t *first_triangle; /* per object, and the total at the end: numbers triangles of objects */
    bool *mirrored;           /* per object */
    bool has_open;            /* some triangle is open: hits must be looked at one by one */
    oracle_part parts[PART_KINDS];         /* flat */
    oracle_part (*mesh_parts)[PART_KINDS]; /* instanced: per mesh */
    RTCScene *mesh_scenes;
    uint32_t **neighbours; /* per mesh, three per triangle, made when first needed */
    pthread_mutex_t making_neighbours;
    oracle_chunk *chunks; /* in the order of the tree's leaves */
    uint32_t chunk_count;
    oracle_box_node *box_nodes;
};

typedef enum oracle_form {
    ORACLE_EITHER = 0, /* flat where it fits */
    ORACLE_FLAT = 1,
    ORACLE_INSTANCED = 2
} oracle_form;

/* truth_create with the form of the traced scene chosen: answers are to be the same. */
truth *oracle_create(const model *m, oracle_form form, umb_error *error);

/* World corners of a triangle, counter-clockwise seen from its front. */
void oracle_triangle(const truth *t, uint32_t object, uint32_t triangle, float v[3][3]);
uint8_t oracle_flags(const truth *t, uint32_t object, uint32_t triangle);
/* A mesh's neighbours across its edges (corner i to i + 1), found by equal positions; MODEL_NONE
 * where there is no single one. NULL when memory is short. Whoever called it for a mesh may read
 * t->neighbours of it. */
const uint32_t *oracle_neighbours(truth *t, uint32_t mesh);

/* The tree over chunks (boxes.c). */
bool oracle_boxes_build(truth *t);
typedef bool oracle_visit(void *user, const oracle_chunk *chunk);
/* Visit every chunk whose box the segment touches, until visit returns false; returns whether
 * all were visited. */
bool oracle_boxes_walk(const truth *t, const double from[3], const double to[3],
                       oracle_visit *visit, void *user);

typedef bool oracle_meets(const void *where, const umb_aabb *box);
/* The same for every chunk whose box, and all boxes above it, meet what `where` says. */
bool oracle_boxes_visit(const truth *t, oracle_meets *meets, const void *where, oracle_visit *visit,
                        void *user);

/* A view as half-spaces, and how far anything can be. */
typedef struct oracle_view {
    const umb_view *view;
    double planes[6 + UMB_MAX_CLIP_PLANES][4]; /* inside where >= 0 */
    uint32_t plane_count;
    double far_depth; /* the view's, or just beyond the scene where that is nearer */
    double pixel[2];  /* size of a grid cell at depth 1 (orthographic: anywhere) */
} oracle_view;

void oracle_view_make(const truth *t, const umb_view *view, const truth_options *options,
                      oracle_view *out);
bool oracle_view_holds(const oracle_view *v, const double p[3]);
/* False only when no point of the box is in the view. */
bool oracle_view_meets_box(const oracle_view *v, const umb_aabb *box);

/* A point in front of the eye that shows at picture coordinates in [0, 1], y from the top. */
void oracle_picture_point(const oracle_view *v, double x, double y, double out[3]);

/* A sight-line: from + s * along, where s is view depth beyond the near plane. */
typedef struct oracle_sight {
    double from[3], along[3];
    double through[3]; /* a point that names the line exactly: with the eye, or with forward */
} oracle_sight;

/* The sight-line through a point; false when it lies behind the eye or beside the picture. */
bool oracle_sight_make(const oracle_view *v, const double through[3], oracle_sight *out);
void oracle_sight_at(const oracle_sight *s, double depth_beyond_near, double out[3]);

typedef struct oracle_hit {
    uint32_t object; /* MODEL_NONE: nothing */
    uint32_t triangle;
    double depth; /* view depth beyond the near plane */
    int facing;   /* -1 from the front, 1 from the back, 0 edge-on */
} oracle_hit;

/* First blocking hits for either renderer, and the open surfaces before the farther one. The arrays
 * belong to the caller and are used again from ray to ray. */
typedef struct oracle_trace {
    oracle_hit two_sided, culling;
    oracle_hit *open;
    uint32_t open_count, open_capacity;
    uint64_t rays;
    bool out_of_memory;
} oracle_trace;

void oracle_trace_ray(const truth *t, const oracle_view *v, const oracle_sight *sight,
                      oracle_trace *trace);
/* Depth beyond near at which the line crosses the triangle's plane; fallback where it runs
 * along. */
double oracle_plane_depth(float v[3][3], const oracle_sight *sight, double fallback, int *facing);
/* Sign of the eye's side of a triangle, and of the side that is seen along a direction: -1 in front. In doubles: close to the plane
 * it may be wrong. */
int oracle_facing(float v[3][3], const double eye[3]);
int oracle_facing_along(float v[3][3], const double along[3]);
/* True if a triangle so met is shown by TRUTH_CULLING. */
bool oracle_shown(uint8_t flags, int facing);

/* Is the sight-line through this point free up to the object, in exact arithmetic (confirm.c)? */
bool oracle_confirm(const truth *t, const oracle_view *v, const double through[3], uint32_t object,
                    uint8_t renderer, truth_witness *out);
/* The same for a line that rays found to end on a triangle of the object: if it does not hold,
 * lines near it are tried. */
bool oracle_confirm_near(const truth *t, const oracle_view *v, const double through[3],
                         uint32_t object, uint32_t triangle, uint8_t renderer, truth_witness *out);
/* The same, but only the triangle itself will do, not another one of its object. */
bool oracle_confirm_triangle(const truth *t, const oracle_view *v, const double through[3],
                             uint32_t object, uint32_t triangle, uint8_t renderer,
                             truth_witness *out);

/* A triangle cut to the view. */
#define ORACLE_POLYGON 24
typedef struct oracle_polygon {
    double corner[ORACLE_POLYGON][3];
    double centre[3];
    uint32_t count; /* 0: nothing of it is in the view */
} oracle_polygon;

void oracle_clip(const oracle_view *v, float triangle[3][3], oracle_polygon *out);
/* A point of the polygon. which 0: the centre; then corners and edge midpoints, pulled towards the
 * centre by `pull`; from 1 + 2 * count on, spread by `random`. */
void oracle_polygon_point(const oracle_polygon *p, uint32_t which, double pull, uint64_t random,
                          double out[3]);

/* A well mixed number from three. */
uint64_t oracle_mix(uint64_t a, uint64_t b, uint64_t c);
/* [0, 1) */
double oracle_unit(uint64_t bits);

#endif

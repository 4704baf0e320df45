/* A model: what a scene file or a generator gives, before any culling. Tools and tests share it;
 * the oracle reads it directly, the library is fed from it by model_scene.h.
 *
 * Objects are numbered as the command line documents. World vertices are umb_transform applied as
 * geometry.h says (double sums, rounded once), minus nothing: origin has been subtracted already,
 * exactly, when the model was read.
 */
#ifndef MODEL_H
#define MODEL_H

#include "umbrage/umbrage.h"

#define MODEL_NONE UINT32_MAX

/* Triangles shared by instances. flags: UMB_TRIANGLE_* per triangle, never NULL when there are
 * any. */
typedef struct model_mesh {
    float *positions; /* 3 per vertex */
    uint32_t *indices; /* 3 per triangle */
    uint8_t *flags;
    uint32_t position_count, triangle_count;
} model_mesh;

typedef struct model_object {
    char *name;           /* never NULL; may repeat */
    uint32_t mesh;        /* MODEL_NONE: no triangles, zero bounds */
    umb_transform transform;
    umb_aabb bounds;      /* of its world vertices, plus origin gives the file's coordinates */
} model_object;

/* What is wrong with the input, counted. `info` prints these. */
typedef struct model_faults {
    uint64_t non_finite;     /* vertices with NaN or infinity; their triangles are dropped */
    uint64_t degenerate;     /* triangles of exactly zero area (they stay, and never block) */
    uint64_t duplicate;      /* triangles equal to another of the same mesh, same winding */
    uint64_t opposite;       /* triangles equal to another but for the winding */
    uint64_t border_edges;   /* edges with one triangle */
    uint64_t non_manifold_edges; /* edges with three or more, or two that run the same way */
    uint64_t bad_indices;    /* triangles that name a vertex that is not there; dropped */
    uint64_t inverted;       /* closed meshes whose volume is negative: they face inwards */
    uint64_t outlier_objects; /* objects whose box sticks out of the box around the middle 99 % of vertices
                                 by more than its size */
    uint64_t empty_objects;  /* objects without triangles */
} model_faults;

typedef struct model {
    model_mesh *meshes;
    model_object *objects;
    uint32_t mesh_count, object_count;
    uint64_t triangles;   /* of the file, instances counted each time, degenerate ones included, faces that
                             belong to several objects once */
    double origin[3];     /* add to get the file's coordinates */
    double up[3];
    umb_aabb bounds;      /* of all world vertices; zero when there is none */
    model_faults faults;
} model;

typedef struct model_options {
    bool sky;        /* keep sky surfaces, as blockers; else they are left out */
    bool two_sided;  /* trust both sides of every face: sets UMB_TRIANGLE_TWO_SIDED on all that block */
    uint32_t split;  /* cut meshes of more triangles than this into spatial clusters; 0: never */
} model_options;

/* Read SCENE: a file name, `pack.pk3:maps/name.bsp`, or `gen:name,key=value,...`. options may be
 * NULL. On failure returns NULL and error holds one line: what, where, remedy. */
model *model_load(const char *scene, const model_options *options, umb_error *error);
void model_free(model *m);

/* Building blocks for readers and generators. All of them abort the load by returning false /
 * MODEL_NONE when memory is short. model_add_mesh and model_add_object copy. */
model *model_create(void);
uint32_t model_add_mesh(model *m, const model_mesh *mesh);
uint32_t model_add_object(model *m, const char *name, uint32_t mesh, const umb_transform *transform);
/* After the last object: drops bad triangles, computes bounds, faults, splits, two_sided. */
bool model_finish(model *m, const model_options *options, umb_error *error);

/* World vertex v of an object, exactly as the library computes it. */
void model_world_vertex(const model *m, const model_object *o, uint32_t v, float out[3]);
/* True if the object's transform mirrors (negative determinant): fronts are compensated. */
bool model_mirrored(const model_object *o);

/* The same model as a committed scene: object ids are object numbers, every object static with its
 * shape; objects without a mesh get their (zero) bounds and UMB_OBJECT_IGNORED. weld: join static
 * neighbours. tasks may be zeroed. Returns NULL with error filled in. */
umb_scene *model_scene(const model *m, bool weld, umb_tasks tasks, umb_weld_stats *stats, umb_error *error);

/* A camera path: rows of eye and target in the file's coordinates (origin not subtracted). */
typedef struct camera_path {
    double (*rows)[6];
    uint32_t count;
} camera_path;

/* Read `FILE.csv` or `gen:blocks,g=32`. Rows that are no six numbers are errors, except a
 * header. */
bool camera_path_load(const char *name, camera_path *out, umb_error *error);
void camera_path_free(camera_path *p);

#endif

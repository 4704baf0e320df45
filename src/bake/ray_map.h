/* Occlusion maps over horizontal rays (thesis 2.1; docs/conservative.md on regions, section "Rays").
 *
 * A frame looks along one of the four horizontal directions: u forwards, v sideways, z up, from the middle of the
 * cell, which is |u| <= hu, |v| <= hv, z0 <= z <= z1. A map's pixels are sets of horizontal lines
 *     v(u) = alpha(u) s + beta(u) t,    alpha(u) = alpha0 + alpha1 u,    beta(u) = beta0 + beta1 u:
 * two parallel edges of concentric squares, or offset and slope. f = v - alpha(u) s - beta(u) t of a point says on
 * which side of a line it lies. */
#ifndef UMB_RAY_MAP_H
#define UMB_RAY_MAP_H

#include <math.h>
#include <string.h>

#include "base/memory.h"
#include "umbra_kernels.h"

/* Of two numbers, neither of them NAN: the library's are calls. */
static inline double umb_least(double a, double b)
{
    return a < b ? a : b;
}

static inline double umb_most(double a, double b)
{
    return a > b ? a : b;
}

/* The next float, as nextafterf() has it, which is a call. */
static inline float umb_float_above(float x)
{
    int32_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits = x > 0.0f ? bits + 1 : x < 0.0f ? bits - 1 : 1;
    float next;
    memcpy(&next, &bits, sizeof next);
    return x < INFINITY ? next : x;
}

static inline float umb_float_below(float x)
{
    return -umb_float_above(-x);
}

/* A view cell as a frame sees it. */
typedef struct umb_ray_frame {
    double hu, hv, z0, z1;
    double centre[3];   /* of the cell, z too */
    uint32_t axis_u, axis_v, axis_z;
    double sign;        /* of u along axis_u */
    double error;       /* bound of rounding of a coordinate in the frame */
    float steep;        /* rays with |dz| > steep |du| are in other frames: 1, or INFINITY for none */
} umb_ray_frame;

/* In front of the squares' outer edge, alpha changes its sign at uo: nothing depends on that. */
typedef struct umb_ray_map {
    const umb_ray_frame *frame;
    double alpha0, alpha1, beta0, beta1;
    double s0, t0, ds, dt; /* corner of pixel 0, 0 and the size of a pixel */
    uint32_t rows, columns; /* of tiles, along s and along t; columns: a multiple of UMB_TILE */
    uint32_t group_rows;    /* of the rows: a divisor, UMB_TILE at most */
    uint32_t umbrae;
    umb_umbra_tile *intervals;     /* [tile][umbra]; of a tile never drawn into: not set */
    umb_umbra_summary *summaries;  /* per tile */
    umb_umbra_summary *groups;     /* per group_rows x UMB_TILE tiles */
    uint64_t *live;                /* per tile: pixels that rays go through */
    bool *drawn;                   /* per tile */
    bool *stale;                   /* per group: its summary is behind */
    float (*spans)[2];             /* per tile row and group column: ua, ub of the cell in all slices there */
    float (*group_spans)[3];       /* per group: the largest ua, the least and the largest ub */
    double offset_most, slope_most; /* lines have |v| at most offset_most + slope_most |u| */
    size_t bytes;                  /* of the one block behind the arrays */
} umb_ray_map;

typedef enum umb_ray_kind { UMB_RAY_SLAB, UMB_RAY_NEAR, UMB_RAY_FAR } umb_ray_kind;

/* What a map holds. Pixels along s: a multiple of UMB_TILE, above 64 of 64; along t: a multiple of 64. */
typedef struct umb_ray_layout {
    umb_ray_kind kind;
    double outer; /* of the squares */
    uint32_t rows, columns, umbrae;
} umb_ray_layout;

/* Lay out and empty a map. UMB_ERROR_MEMORY leaves nothing behind. A map that was set up before with the same sizes keeps
 * its memory. */
umb_result umb_ray_map_begin(umb_ray_map *map, const umb_allocator *a, const umb_ray_frame *frame,
                             const umb_ray_layout *layout);
void umb_ray_map_free(umb_ray_map *map, const umb_allocator *a);

/* A point in a frame. */
typedef struct umb_ray_point {
    double u, v, z;
} umb_ray_point;

umb_ray_point umb_ray_frame_point(const umb_ray_frame *f, const double p[3]);

/* What is asked about: the hull of points, as a frame sees it. The outline holds their hull in (u, v), in order. */
#define UMB_RAY_POINTS 64
#define UMB_RAY_OUTLINE (UMB_RAY_POINTS + 2)
typedef struct umb_ray_shape {
    umb_ray_point outline[UMB_RAY_OUTLINE];
    uint32_t count;
    double z0, z1; /* lowest and highest */
    double u_min, u_max, v_min, v_max;
    const umb_ray_point *points; /* of a body that does not stand upright: all of them, of the caller; else none */
    uint32_t point_count;
} umb_ray_shape;

/* Of at most UMB_RAY_POINTS points. False: all lie behind the cell. umb_ray_shape_outline() has to follow. */
bool umb_ray_shape_measure(const umb_ray_frame *f, const umb_ray_point *points, uint32_t count, umb_ray_shape *out);

/* The outline of the same points; what lies behind the cell is cut off. in_order: the points are the corners of a convex
 * outline, in order. False: nothing is left. */
bool umb_ray_shape_outline(const umb_ray_frame *f, const umb_ray_point *points, uint32_t count, bool in_order,
                           umb_ray_shape *out);

/* The hull of points in (u, v): their numbers, in order; out has room for UMB_RAY_OUTLINE. Points that rounding leaves
 * out lie within rounding of it, which errors of f and u allow for. */
uint32_t umb_ray_hull(const umb_ray_point *points, uint32_t count, uint8_t *out);

/* False if surely no line of the map meets the shape; it needs no outline. */
bool umb_ray_map_meets(const umb_ray_map *map, const umb_ray_shape *shape);

/* True if every line of the map that meets the shape is blocked before it. Else *tile is one whose lines are not. */
bool umb_ray_map_hides(umb_ray_map *map, const umb_umbra_kernels *kernels, const umb_ray_shape *shape, uint32_t *tile);

/* The same of the lines of one tile. */
bool umb_ray_map_tile_hides(umb_ray_map *map, const umb_umbra_kernels *kernels, const umb_ray_shape *shape,
                            uint32_t tile);

/* An occluder in a frame. Chains run through its vertices; see umb_umbra. */
typedef struct umb_ray_blocker {
    umb_ray_point vertices[UMB_UMBRA_VERTICES];
    uint32_t count;
    bool convex;  /* any chain through the vertices lies in what blocks */
    bool floor;   /* what is lowest of it stands on the ground: nothing passes below */
    uint32_t ring; /* not convex: the border of a disk of triangles, in order, comes first; then its inner vertices */
    bool on_floor[UMB_UMBRA_VERTICES]; /* the vertex lies on the ground or below */
} umb_ray_blocker;

/* Draw it. half: keep tops alone, and draw nothing that does not stand on the ground. */
void umb_ray_map_block(umb_ray_map *map, const umb_umbra_kernels *kernels, const umb_ray_blocker *b, bool half);

/* True if everything at height z_min to z_max that is at least `gap` in front of the cell is hidden. */
bool umb_ray_map_closed(umb_ray_map *map, double z_min, double z_max, double gap);

#endif

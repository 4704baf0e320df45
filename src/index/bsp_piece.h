/* What a BSP tree is built from: pieces of items, and the planes that cut them. */
#ifndef UMB_BSP_PIECE_H
#define UMB_BSP_PIECE_H

#include "cells.h"

/* A corner of a piece that has been cut, and how far it may be off along each axis. */
#define UMB_BSP_CORNERS 12

/* A triangle in world coordinates, and its piece if it has been cut. */
typedef struct umb_bsp_shape {
    float corners[3][3];
} umb_bsp_shape;

typedef struct umb_bsp_outline {
    double corners[UMB_BSP_CORNERS][3]; /* their hull, grown by off, holds the piece */
    double off;
    uint32_t count;
} umb_bsp_outline;

/* Part of an item: of a triangle, or where only its box is known of the box. */
typedef struct umb_bsp_piece {
    umb_aabb box;      /* holds it */
    uint32_t ref;      /* of the item */
    uint32_t triangle; /* UMB_NONE: a box */
    uint32_t outline;  /* UMB_NONE: not cut yet */
} umb_bsp_piece;

/* All that pieces refer to. */
typedef struct umb_bsp_pool {
    const umb_allocator *allocator;
    umb_bsp_shape *triangles;
    umb_bsp_outline *outlines;
    uint32_t triangle_count, outline_count;
    size_t triangle_capacity, outline_capacity;
} umb_bsp_pool;

/* A plane to cut by: across an axis, or through a triangle. */
typedef struct umb_bsp_plane {
    int axis; /* 0 .. 2, UMB_ORDER_TILTED */
    float at;
    uint32_t triangle; /* tilted: a corner of it, its normal, and what bounds the normal's components and their errors */
    double from[3], normal[3], span;
} umb_bsp_plane;

/* Where a piece lies, as bits; neither: in the plane. Exact for whole triangles and for boxes. Of a piece that
 * has been cut it may say both where only one is true, never one where both are. */
enum { UMB_BSP_BELOW = 1, UMB_BSP_ABOVE = 2 };
uint32_t umb_bsp_piece_sides(const umb_bsp_pool *pool, const umb_bsp_piece *piece, const umb_bsp_plane *plane);
/* The same in a hurry, to compare planes by: what is so near to the plane that rounding decides counts as in it. */
uint32_t umb_bsp_piece_sides_about(const umb_bsp_pool *pool, const umb_bsp_piece *piece, const umb_bsp_plane *plane);

/* The part of a piece on one side of a plane that it reaches to both sides of. cut: triangles are cut, too, else only
 * boxes are, by planes across an axis. false: no memory. */
bool umb_bsp_piece_cut(umb_bsp_pool *pool, const umb_bsp_piece *piece, const umb_bsp_plane *plane, uint32_t side,
                       bool cut, umb_bsp_piece *out);

/* The plane of a triangle. */
umb_bsp_plane umb_bsp_piece_plane(const umb_bsp_pool *pool, uint32_t triangle);
void umb_bsp_pool_free(umb_bsp_pool *pool);

#endif

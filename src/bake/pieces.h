/* Occluders cut into pieces that an occlusion map can take (docs/conservative.md, T1): convex bodies, and disks of
 * triangles that are bounded by a ring. */
#ifndef UMB_PIECES_H
#define UMB_PIECES_H

#include "base/memory.h"
#include "scene/scene.h"
#include "umbra_kernels.h"

#define UMB_PIECE_TRIANGLES 48

enum { UMB_SOLID_NO = 1, UMB_SOLID_YES = 2 }; /* what umb_closed_solid() said */

/* A piece in world coordinates. */
typedef struct umb_piece {
    double points[UMB_UMBRA_VERTICES][3];
    uint32_t count;
    bool convex;   /* the hull of the points lies in what blocks; else a disk */
    uint32_t ring; /* disk: the first so many points are its border, in order */
    uint8_t edges[UMB_UMBRA_EDGES][2]; /* convex: the body's; disk: those inside */
    uint32_t edge_count;
} umb_piece;

/* The cell that pieces are for. */
typedef struct umb_pieces {
    const umb_allocator *allocator;
    const double (*corners)[3]; /* of the cell: eight */
    double reach;               /* no coordinate is larger */
    void (*emit)(void *user, const umb_piece *piece);
    void *user;
    uint8_t *known; /* per occluder, for all cells: UMB_SOLID_...; 0: not looked at yet */
    umb_piece piece;
    /* Working memory, by triangles of the largest mesh so far. */
    uint32_t (*neighbours)[3];
    uint8_t *states;
    size_t neighbour_capacity, state_capacity;
} umb_pieces;

/* Hand on the pieces of an occluder that block whatever leaves the cell through them. */
umb_result umb_pieces_cut(umb_pieces *p, const umb_occluder *o, uint32_t number);
void umb_pieces_free(umb_pieces *p);

#endif

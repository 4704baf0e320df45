/* Occlusion trees (Bittner, Havran and Slavik 1998; Gummerus 5.4): the shadows of all chosen occluders merged into one
 * binary tree of lines of the picture. A leaf is a convex cell of the picture, either open or covered; a covered one
 * names occluders that cover all of it together: what is beyond all of them there is hidden.
 *
 *       line 1            1           Every side is decided exactly or not at all (seen.h): cells
 *       |  A  /         -/ \+         that a line shares meet without a crack, and what lies behind
 *       |----/ 2     open   2         several occluders that touch is found hidden.
 *       |   / open        -/ \+
 *       |  /           open   A
 *
 * The plain tree has a line for every edge. The modified one takes out a line between two covered cells where the
 * occluders of each lie behind or in the planes of those of the other: there "beyond all of them" says the same with and
 * without the line (fronts of one convex body, pieces of one wall).
 */
#ifndef UMB_OCCLUSION_TREE_H
#define UMB_OCCLUSION_TREE_H

#include "hull.h"

/* Fronts that are inserted, at most. */
#define UMB_OCCLUSION_TREE_SHADOWS 2048

/* References to cells: those that are open, and the bit of those that a cover is for. Others are nodes. */
#define UMB_OCCLUSION_OPEN_CELL 0xFFFFFFFFu
#define UMB_OCCLUSION_COVERED 0x80000000u

typedef struct umb_occlusion_node {
    umb_seen_line *line;
    uint32_t child[2]; /* on the negative and on the positive side */
} umb_occlusion_node;

/* The occluders of covered cells: beyond all of these, or hidden by another cover of the same cell. */
typedef struct umb_occlusion_cover {
    uint32_t first, count; /* in members */
    uint32_t other;        /* UMB_OCCLUSION_OPEN_CELL: none */
    uint32_t length;       /* of the chain of others */
} umb_occlusion_cover;

typedef struct umb_occlusion_tree {
    umb_shadows *shadows;
    umb_occlusion_node *nodes;
    umb_occlusion_cover *covers;
    uint32_t *members; /* shadows */
    size_t node_capacity, cover_capacity, member_capacity;
    uint32_t node_count, cover_count, member_count;
    uint32_t root;
    bool modified, ready;
    uint32_t planted;  /* fragments that covered a cell, or covered it from nearer */
    uint32_t given_up; /* fragments that were left out because a side was unknown, room was short or a cell had too many covers */
} umb_occlusion_tree;

/* What became of a question. */
typedef enum umb_occlusion_answer {
    UMB_OCCLUSION_HIDDEN,
    UMB_OCCLUSION_OPEN,   /* some of it is in an open cell, or that could not be told */
    UMB_OCCLUSION_BEFORE  /* some of it is in a covered cell and not beyond what covers that */
} umb_occlusion_answer;

/* Room for a tree of so many lines and shadows; it takes what it has, fragments beyond are left out. */
bool umb_occlusion_tree_reserve(umb_occlusion_tree *t, const umb_allocator *a, uint32_t nodes, uint32_t covers);
void umb_occlusion_tree_free(umb_occlusion_tree *t, const umb_allocator *a);

/* An empty tree: all is open, but what is beyond the viewer's frame. The shadows stay with the caller. */
void umb_occlusion_tree_begin(umb_occlusion_tree *t, umb_shadows *shadows, bool modified);
/* Insert one shadow. Nearest first is best: what lies behind others is then left out. */
void umb_occlusion_tree_insert(umb_occlusion_tree *t, uint32_t shadow);
/* Ask about a hull, starting at a node (root, or what *start became in a question about something that holds this one):
 * first its outline, then, if only depth was in doubt, each of its faces, cut where it passes through the planes of occluders.
 * Boxes and triangles that the view does not cut are hidden if and only if each of their points is in a shadow of the tree
 * and strictly beyond it (docs/conservative.md, 15). *start becomes the deepest node in one of whose cells all of it lies.
 * Threads: any number at once. */
umb_occlusion_answer umb_occlusion_tree_ask(const umb_occlusion_tree *t, umb_hull *hull, uint32_t *start);
/* True if a point is surely in an open cell. */
bool umb_occlusion_tree_open_at(const umb_occlusion_tree *t, const float p[3], uint32_t start);

#endif

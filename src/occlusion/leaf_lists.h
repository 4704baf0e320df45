/* Which occluders are large from where, found ahead (Coorg and Teller 1997, 4): a kd-tree divides the places that viewers
 * may be in, and each leaf keeps lists for 26 directions of view:
 *
 *     front   what a viewer in the leaf sees the front of: candidates for a frame from there
 *     back    what something in the leaf has its back to: what may hide it from a viewer in that direction
 *
 * ordered by area-angle, the greatest over the points of the leaf that were looked from: back by the paper's, A (N . V) / |D|^2
 * with V the direction of the list; front by -A (N . D) / |D|^3 times the cosine between D and V, for by N . V a wall along
 * the direction of view counts for nothing, and in corridors such walls hide most. Lists only say what is worth trying. They
 * are made point by point, when they are first asked for or ahead, and follow the scene: what comes near makes a leaf look
 * again. */
#ifndef UMB_LEAF_LISTS_H
#define UMB_LEAF_LISTS_H

#include "select.h"

enum {
    UMB_LEAF_DIRECTIONS = 26,
    UMB_LEAF_POINTS = 9, /* the middle of the leaf and those of its eighths */
    UMB_LEAF_DEPTH = 8   /* of the tree, at most */
};

typedef enum umb_leaf_side { UMB_LEAF_FRONT, UMB_LEAF_BACK } umb_leaf_side;

typedef struct umb_leaf_entry {
    float score;
    uint32_t occluder, facet; /* facet UMB_NONE: a body as a whole */
} umb_leaf_entry;

typedef struct umb_leaf {
    umb_aabb cell;
    umb_leaf_entry *entries; /* of each side and direction `length`; NULL: nobody has asked */
    uint16_t counts[2][UMB_LEAF_DIRECTIONS];
    uint8_t points; /* so many were looked from; 0 again when something has changed */
    uint8_t moves;  /* commits since in which occluders moved */
    float least;    /* what has an area-angle below this was not looked at */
} umb_leaf;

typedef struct umb_leaf_lists {
    umb_allocator allocator;
    umb_vec3 directions[UMB_LEAF_DIRECTIONS];
    umb_leaf *leaves; /* 1 << depth */
    float *at;        /* of the splits above them, children of k at 2 k + 1 and 2 k + 2 */
    uint8_t *axes;
    uint32_t depth, length;
    umb_aabb bounds;
    uint32_t made_for; /* occluders there were */
    uint32_t wanted;   /* a leaf that was asked for and knows nothing */
    uint64_t structure, version, welds; /* of the scene, and of what the selector knows */
    bool made;
    float (*places)[3]; /* of occluders, while the tree is made */
    size_t place_capacity;
} umb_leaf_lists;

void umb_leaf_lists_create(umb_leaf_lists *l, const umb_allocator *a);
void umb_leaf_lists_free(umb_leaf_lists *l);

/* Bring them up to date with the scene, which the selector knows; lists of up to `length`. False without memory. */
bool umb_leaf_lists_follow(umb_leaf_lists *l, const umb_selector *s, const umb_choice *choice, uint32_t length);

/* The leaf that a place is in; UMB_NONE: outside of the scene. */
uint32_t umb_leaf_lists_at(const umb_leaf_lists *l, const double place[3]);
/* Look from one more point of a leaf, if one is left. False without memory. */
bool umb_leaf_lists_look(umb_leaf_lists *l, uint32_t leaf, umb_selector *s, const umb_choice *choice,
                         const umb_box_kernels *kernels);
/* The list for a direction, the best first. */
const umb_leaf_entry *umb_leaf_lists_get(const umb_leaf_lists *l, uint32_t leaf, umb_leaf_side side,
                                         const double direction[3], uint32_t *count);

#endif

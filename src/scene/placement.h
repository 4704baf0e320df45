/* Where a transform puts a mesh: checked, with bounds. */
#ifndef UMB_PLACEMENT_H
#define UMB_PLACEMENT_H

#include "mesh.h"

/* What a transform makes of a shape. */
typedef struct umb_outcome {
    umb_mesh_place place;
    const umb_aabb *bounds;       /* of what can be seen; NULL without a shape */
    const umb_aabb *block_bounds; /* of what blocks; zero when nothing does */
    bool identity, mirrored;
} umb_outcome;

/* See where a transform (NULL or zero: the identity) puts a mesh, which may be NULL. Returns NULL, or what is wrong
 * with it; *out then says nothing. It points into itself: not to be copied. */
const char *umb_outcome_find(const umb_mesh *mesh, const umb_transform *transform, umb_outcome *out);

/* The bounds of an object: those given (NULL or zero: none), or the shape's own. Returns NULL, or what is wrong. */
const char *umb_outcome_bounds(const umb_outcome *outcome, const umb_aabb *given, const umb_aabb **out);

/* The transform to keep: the identity where it is one. */
const umb_transform *umb_outcome_transform(const umb_outcome *outcome, const umb_transform *transform);

/* Finite and not inverted; false for NaN. */
bool umb_box_is_possible(const umb_aabb *b);
bool umb_box_is_zero(const umb_aabb *b);

#endif

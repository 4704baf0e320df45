#include "placement.h"

#include <float.h>
#include <string.h>

#include "geometry/transform.h"

bool umb_box_is_possible(const umb_aabb *b)
{
    bool possible = true;
    for (int i = 0; i < 3; ++i) {
        possible &= (b->min[i] >= -FLT_MAX) & (b->max[i] <= FLT_MAX) & (b->min[i] <= b->max[i]);
    }
    return possible;
}

bool umb_box_is_zero(const umb_aabb *b)
{
    for (int i = 0; i < 3; ++i) {
        if (b->min[i] != 0.0f || b->max[i] != 0.0f) {
            return false;
        }
    }
    return true;
}

/* By the bits: without a branch, and four at once where the compiler can. */
static bool transform_is_finite(const umb_transform *t)
{
    uint32_t bits[12], bad = 0;
    memcpy(bits, t->m, sizeof bits);
    for (int i = 0; i < 12; ++i) {
        bad |= (bits[i] & 0x7F800000u) == 0x7F800000u;
    }
    return bad == 0;
}

const char *umb_outcome_find(const umb_mesh *mesh, const umb_transform *transform, umb_outcome *out)
{
    static const umb_aabb nothing = {{0, 0, 0}, {0, 0, 0}};
    out->identity = transform == NULL || umb_transform_is_identity(transform);
    out->mirrored = false;
    out->bounds = mesh != NULL ? &mesh->bounds : NULL;
    out->block_bounds = mesh != NULL ? &mesh->block_bounds : &nothing;
    if (out->identity) {
        return NULL;
    }
    if (!transform_is_finite(transform)) {
        return "a transform is not finite";
    }
    if (mesh != NULL) {
        out->bounds = &out->place.bounds;
        out->block_bounds = umb_mesh_world_bounds(mesh, transform, &out->place);
        if (!umb_box_is_possible(out->block_bounds)) {
            return "a transform moves vertices out of range";
        }
    }
    out->mirrored = umb_transform_mirrors(transform);
    return NULL;
}

const char *umb_outcome_bounds(const umb_outcome *outcome, const umb_aabb *given, const umb_aabb **out)
{
    bool use_own = outcome->bounds != NULL && (given == NULL || umb_box_is_zero(given));
    *out = use_own ? outcome->bounds : given;
    if (use_own && outcome->bounds == outcome->block_bounds) {
        return NULL; /* found possible already */
    }
    if (*out == NULL) {
        return "an object without a shape needs bounds";
    }
    return umb_box_is_possible(*out) ? NULL : "an object's bounds are not finite or inverted";
}

const umb_transform *umb_outcome_transform(const umb_outcome *outcome, const umb_transform *transform)
{
    static const umb_transform identity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    return outcome->identity ? &identity : transform;
}

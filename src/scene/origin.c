/* Moving a scene's origin: for worlds larger than floats are exact in.
 *
 * A placement keeps its translation as doubles, `at`; the floats that everything else looks at are `at` rounded once, now and
 * after every shift. So shifts add no errors up: where doubles hold the sums exactly, as they do for shifts that are
 * multiples of a step that all positions share, any number of them ends where one would. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "scene_state.h"

/* What a shift makes of a placement: the doubles, and the transform of their floats. */
static umb_transform shifted(const umb_placement *p, const double shift[3], double at[3])
{
    umb_transform t = p->transform;
    for (int i = 0; i < 3; ++i) {
        at[i] = p->at[i] - shift[i];
        t.m[i][3] = (float)at[i];
    }
    return t;
}

/* Outwards by a step of floats, besides the rounding: what was drawn inside is drawn a rounding elsewhere. */
umb_aabb umb_scene_shift_box(const umb_aabb *b, const double shift[3])
{
    umb_aabb out;
    for (int i = 0; i < 3; ++i) {
        out.min[i] = nextafterf(nextafterf((float)(b->min[i] - shift[i]), -FLT_MAX), -FLT_MAX);
        out.max[i] = nextafterf(nextafterf((float)(b->max[i] - shift[i]), FLT_MAX), FLT_MAX);
    }
    return out;
}

/* True if an object's bounds are those of its shape where it stands. */
static bool has_own_bounds(const umb_mesh *mesh, const umb_object_slot *slot)
{
    umb_outcome now;
    return mesh != NULL && umb_outcome_find(mesh, &slot->placement.transform, &now) == NULL &&
           memcmp(now.bounds, &slot->bounds, sizeof slot->bounds) == 0;
}

static bool can_stand(const umb_scene *scene, const umb_placement *p, const double shift[3])
{
    umb_outcome seen;
    double at[3];
    umb_transform t = shifted(p, shift, at);
    const umb_aabb *bounds;
    static const umb_aabb any = {{0, 0, 0}, {1, 1, 1}};
    return umb_outcome_find(umb_scene_mesh(scene, p->shape), &t, &seen) == NULL &&
           umb_outcome_bounds(&seen, &any, &bounds) == NULL;
}

static bool can_shift(const umb_scene *scene, const double shift[3])
{
    bool can = true;
    for (uint32_t i = 0; i < scene->object_ids.used && can; ++i) {
        const umb_object_slot *slot = &scene->objects[i];
        umb_aabb box = slot->state == UMB_SLOT_USED ? umb_scene_shift_box(&slot->bounds, shift) : (umb_aabb){{0, 0, 0}, {0, 0, 0}};
        can = slot->state != UMB_SLOT_USED || (umb_box_is_possible(&box) && can_stand(scene, &slot->placement, shift));
    }
    for (uint32_t i = 0; i < scene->occluder_ids.used && can; ++i) {
        const umb_occluder_slot *slot = &scene->occluders[i];
        can = slot->state != UMB_SLOT_USED || can_stand(scene, &slot->placement, shift);
    }
    return can;
}

static void stand(umb_scene *scene, umb_placement *p, const double shift[3], umb_outcome *seen)
{
    double at[3];
    umb_transform t = shifted(p, shift, at);
    (void)umb_outcome_find(umb_scene_mesh(scene, p->shape), &t, seen);
    umb_scene_place(p, &t, seen);
    memcpy(p->at, at, sizeof at);
}

static void shift_object(umb_scene *scene, uint32_t object, const double shift[3])
{
    umb_object_slot *slot = &scene->objects[object];
    umb_outcome seen;
    bool own = has_own_bounds(umb_scene_mesh(scene, slot->placement.shape), slot);
    umb_weld_dissolve(scene, slot->weld);
    stand(scene, &slot->placement, shift, &seen);
    slot->bounds = own ? *seen.bounds : umb_scene_shift_box(&slot->bounds, shift);
    umb_scene_touch_object(scene, object);
}

umb_result umb_scene_shift_origin(umb_scene *scene, const double shift[3])
{
    for (int i = 0; i < 3; ++i) {
        if (!isfinite(shift[i]) || !isfinite(scene->origin[i] + shift[i])) {
            return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "an origin's shift is not finite");
        }
    }
    if (!can_shift(scene, shift)) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "an origin's shift moves vertices out of range");
    }
    for (uint32_t i = 0; i < scene->object_ids.used; ++i) {
        if (scene->objects[i].state == UMB_SLOT_USED) {
            shift_object(scene, i, shift);
        }
    }
    for (uint32_t i = 0; i < scene->occluder_ids.used; ++i) {
        umb_outcome seen;
        if (scene->occluders[i].state == UMB_SLOT_USED) {
            stand(scene, &scene->occluders[i].placement, shift, &seen);
            umb_scene_renew_occluder(scene, i);
        }
    }
    umb_motion_shift(scene, shift);
    for (int i = 0; i < 3; ++i) {
        scene->origin[i] += shift[i];
    }
    return UMB_OK;
}

void umb_scene_get_origin(const umb_scene *scene, double out[3])
{
    memcpy(out, scene->origin, sizeof scene->origin);
}

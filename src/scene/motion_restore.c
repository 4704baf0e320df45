/* Movers as a capture keeps them: their volumes are the bounds of their objects, and hold as long as they did. */
#include "motion_restore.h"

#include <math.h>

#include "scene_state.h"

/* Poses that the capture does not hold are not known; so nothing is promised that would need them. */
static umb_result add_mover(umb_scene *scene, const umb_stored_mover *stored)
{
    const umb_motion_def anywhere = {.max_speed = INFINITY, .fuzzy = stored->fuzzy};
    bool known = stored->object < scene->object_ids.used && scene->objects[stored->object].mover == UMB_NONE;
    umb_result result = known ? umb_scene_set_motion(scene, stored->object, &anywhere) : UMB_ERROR_ARGUMENT;
    if (result == UMB_OK) {
        umb_mover_slot *slot = &scene->moving.slots[scene->objects[stored->object].mover];
        slot->exact = stored->exact;
        slot->why = 0;
    }
    scene->moving.due_count = 0; /* no volume is to be made anew */
    return result;
}

static bool is_queue(const umb_stored_motion *s)
{
    bool good = s->expiry_count <= s->mover_count;
    for (uint32_t i = 0; i < s->expiry_count && good; ++i) {
        double until = s->expiries[i].until;
        good = until < INFINITY && s->expiries[i].mover < s->mover_count && !s->movers[s->expiries[i].mover].exact &&
               (i == 0 || s->expiries[(i - 1) / 2].until <= until);
    }
    return good;
}

static bool is_exact_list(const umb_stored_motion *s)
{
    uint32_t marked = 0;
    bool good = s->exact_count <= s->mover_count;
    for (uint32_t i = 0; i < s->mover_count; ++i) {
        marked += s->movers[i].exact;
    }
    for (uint32_t i = 0; i < s->exact_count && good; ++i) {
        good = s->exact[i] < s->mover_count && s->movers[s->exact[i]].exact && (i == 0 || s->exact[i] > s->exact[i - 1]);
    }
    return good && marked == s->exact_count;
}

/* The queue to the last entry, for its order is one in which cullers meet movers. False if a mover is in it twice. */
static bool fill_queue(umb_scene *scene, const umb_stored_motion *s)
{
    umb_expiries *e = &scene->moving.expiries;
    for (uint32_t i = 0; i < s->expiry_count; ++i) {
        if (e->places[s->expiries[i].mover] != UMB_NONE) {
            return false;
        }
        e->heap[i] = s->expiries[i];
        e->places[s->expiries[i].mover] = i;
    }
    e->count = s->expiry_count;
    return true;
}

umb_result umb_motion_restore(umb_scene *scene, const umb_stored_motion *stored)
{
    umb_movers_state *m = &scene->moving;
    umb_result result = umb_scene_set_poses(scene, &stored->source);
    if (!is_queue(stored) || !is_exact_list(stored) || !isfinite(stored->time)) {
        result = UMB_ERROR_ARGUMENT;
    }
    for (uint32_t i = 0; i < stored->mover_count && result == UMB_OK; ++i) {
        result = add_mover(scene, &stored->movers[i]);
    }
    m->time = m->made_at = stored->time;
    result = result == UMB_OK ? umb_scene_commit(scene) : result;
    if (result != UMB_OK) {
        return result;
    }
    if (!fill_queue(scene, stored)) {
        return UMB_ERROR_ARGUMENT;
    }
    for (uint32_t i = 0; i < stored->exact_count; ++i) {
        m->exact[i] = stored->exact[i];
    }
    m->exact_count = stored->exact_count;
    scene->committed.motion.expiry_count = m->expiries.count;
    scene->committed.motion.exact_count = m->exact_count;
    return UMB_OK;
}

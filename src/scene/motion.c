/* Objects that move by themselves: what is promised of their motions, and who of them is due. What is due gets a new volume
 * at the next commit (motion_commit.c, motion_volume.c):
 *
 *     a new motion          umb_scene_set_motion()
 *     expiry                the queue, up to the scene's time
 *     seen, and not shown   what cullers were told since the last commit (witnesses.c)
 *     hidden, but large     what cullers tested in vain since it was made
 */
#include <float.h>
#include <math.h>

#include "scene_state.h"

#define FIRST_PERIOD 1.0
#define LEAST_PERIOD 0.125
#define MOST_PERIOD 64.0

/* ---- promises ------------------------------------------------------------------------------- */

static bool is_promise(const umb_motion_def *d)
{
    const double numbers[6] = {d->max_speed,    d->max_acceleration, d->max_spin,
                               d->first_period, d->least_period,     d->most_period};
    bool good = umb_box_is_possible(&d->volume) && (d->kind == UMB_MOTION_SPEED || d->kind == UMB_MOTION_VOLUME);
    for (int i = 0; i < 6; ++i) {
        good = good && numbers[i] >= 0.0;
    }
    for (int i = 0; i < 3; ++i) {
        good = good && fabs(d->pivot[i]) <= FLT_MAX;
    }
    return good;
}

/* With the defaults filled in, and the bounds of the period in order. */
static umb_motion_def complete(const umb_motion_def *given)
{
    umb_motion_def d = *given;
    d.first_period = d.first_period > 0.0 ? d.first_period : FIRST_PERIOD;
    d.least_period = d.least_period > 0.0 ? d.least_period : LEAST_PERIOD;
    d.most_period = d.most_period > 0.0 ? d.most_period : MOST_PERIOD;
    d.most_period = d.most_period > d.least_period ? d.most_period : d.least_period;
    d.first_period = fmin(fmax(d.first_period, d.least_period), d.most_period);
    return d;
}

bool umb_motion_is_exact(const umb_scene *scene, const umb_object_slot *slot)
{
    return slot->mover != UMB_NONE && scene->moving.slots[slot->mover].exact;
}

void umb_motion_make_due(umb_movers_state *m, uint32_t mover, uint8_t why)
{
    if (m->slots[mover].why == 0) {
        m->due[m->due_count++] = mover;
    }
    m->slots[mover].why |= why;
}

static bool reserve(umb_movers_state *m, const umb_allocator *a)
{
    size_t need = (size_t)m->ids.used + 1;
    return umb_ids_reserve(&m->ids, a) &&
           umb_memory_reserve(a, (void **)&m->slots, &m->slot_capacity, need, sizeof *m->slots) &&
           umb_memory_reserve(a, (void **)&m->promises, &m->promise_capacity, need, sizeof *m->promises) &&
           umb_memory_reserve(a, (void **)&m->objects, &m->object_capacity, need, sizeof *m->objects) &&
           umb_memory_reserve(a, (void **)&m->due, &m->due_capacity, need, sizeof *m->due) &&
           umb_memory_reserve(a, (void **)&m->exact, &m->exact_capacity, need, sizeof *m->exact) &&
           umb_memory_reserve(a, (void **)&m->next_exact, &m->next_exact_capacity, need, sizeof *m->next_exact) &&
           umb_expiries_reserve(&m->expiries, a, (uint32_t)need);
}

void umb_motion_publish_arrays(umb_scene *scene)
{
    scene->committed.motion.objects = scene->moving.objects;
    scene->committed.motion.expiries = scene->moving.expiries.heap;
    scene->committed.motion.exact = scene->moving.exact;
}

static umb_result start(umb_scene *scene, uint32_t object, const umb_motion_def *def)
{
    umb_object_slot *slot = &scene->objects[object];
    umb_movers_state *m = &scene->moving;
    if (slot->mover == UMB_NONE) {
        bool room = reserve(m, &scene->allocator);
        umb_motion_publish_arrays(scene);
        if (!room) {
            return umb_scene_fail(scene, UMB_ERROR_MEMORY, "out of memory for a motion");
        }
        slot->mover = umb_ids_take(&m->ids);
        m->slots[slot->mover] = (umb_mover_slot){0};
        m->promises[slot->mover] = (umb_mover_promise){.known = {.holds = 0.0}};
        m->objects[slot->mover] = object;
        m->count += 1;
    }
    umb_mover_slot *mover = &m->slots[slot->mover];
    umb_motion_def *kept = &m->promises[slot->mover].def;
    m->fuzzy += def->fuzzy;
    m->fuzzy -= kept->fuzzy;
    *kept = complete(def);
    mover->period = kept->first_period;
    mover->why &= (uint8_t)~UMB_DUE_STOP;
    umb_motion_make_due(m, slot->mover, UMB_DUE_FRESH);
    return UMB_OK;
}

umb_result umb_scene_set_poses(umb_scene *scene, const umb_pose_source *source)
{
    if (source == NULL || source->pose == NULL) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "no callback that poses come from");
    }
    scene->moving.source = *source;
    scene->committed.motion.source = *source;
    return UMB_OK;
}

umb_result umb_scene_set_motion(umb_scene *scene, uint32_t object, const umb_motion_def *def)
{
    if (object >= scene->object_ids.used || scene->objects[object].state != UMB_SLOT_USED) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "no object has number %u", object);
    }
    umb_object_slot *slot = &scene->objects[object];
    if (def == NULL) {
        if (slot->mover != UMB_NONE) {
            umb_motion_make_due(&scene->moving, slot->mover, UMB_DUE_STOP);
        }
        return UMB_OK;
    }
    if (scene->moving.source.pose == NULL) {
        return umb_scene_fail(scene, UMB_ERROR_STATE, "set where poses come from before the first motion");
    }
    if (!is_promise(def)) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "a motion's numbers are negative or none, or its volume is no box");
    }
    if (def->kind == UMB_MOTION_VOLUME && umb_box_is_zero(&def->volume)) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "a motion within a volume (UMB_MOTION_VOLUME) has none: set its volume");
    }
    umb_result result = start(scene, object, def);
    if (result == UMB_OK) {
        umb_weld_dissolve(scene, slot->weld);
    }
    return result;
}

void umb_motion_shift(umb_scene *scene, const double shift[3])
{
    umb_movers_state *m = &scene->moving;
    for (uint32_t i = 0; i < m->ids.used; ++i) {
        umb_aabb *volume = &m->promises[i].def.volume;
        if (m->objects[i] != UMB_NONE) {
            *volume = umb_box_is_zero(volume) ? *volume : umb_scene_shift_box(volume, shift);
            umb_motion_make_due(m, i, UMB_DUE_FRESH);
        }
    }
}

void umb_motion_reshape(umb_scene *scene, umb_object_slot *slot, const umb_aabb *bounds)
{
    if (slot->mover == UMB_NONE) {
        return;
    }
    umb_motion_make_due(&scene->moving, slot->mover, UMB_DUE_FRESH);
    for (int i = 0; i < 3 && bounds != NULL; ++i) { /* it may be stopped where nobody can tell where it is */
        slot->bounds.min[i] = fminf(slot->bounds.min[i], bounds->min[i]);
        slot->bounds.max[i] = fmaxf(slot->bounds.max[i], bounds->max[i]);
    }
}

void umb_motion_remove(umb_scene *scene, const umb_object_slot *slot)
{
    if (slot->mover != UMB_NONE) {
        umb_motion_make_due(&scene->moving, slot->mover, UMB_DUE_STOP);
    }
}

umb_result umb_scene_set_time(umb_scene *scene, double seconds)
{
    if (!isfinite(seconds)) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "the time is not finite");
    }
    scene->moving.time = seconds;
    return UMB_OK;
}

/* ---- poses ---------------------------------------------------------------------------------- */

bool umb_motion_ask(const umb_pose_source *source, uint32_t object, double time, umb_pose *out)
{
    *out = (umb_pose){0};
    bool known = source->pose(source->user, object, time, out);
    for (int i = 0; i < 3; ++i) {
        known = known && isfinite(out->velocity[i]) && isfinite(out->spin[i]);
    }
    return known && out->holds >= 0.0;
}

/* ---- the rest ------------------------------------------------------------------------------- */

bool umb_scene_is_fuzzy(const umb_scene *scene, uint32_t mover)
{
    return scene->moving.promises[mover].def.fuzzy;
}

void umb_scene_get_motion_stats(const umb_scene *scene, umb_motion_stats *out)
{
    const umb_movers_state *m = &scene->moving;
    *out = m->stats;
    out->movers = m->count;
    out->fuzzy = m->fuzzy;
    out->exact = m->exact_count;
    double sum = 0.0;
    for (uint32_t i = 0; i < m->expiries.count; ++i) {
        sum += m->slots[m->expiries.heap[i].mover].period;
    }
    out->period = m->expiries.count > 0 ? sum / m->expiries.count : 0.0;
}

void umb_motion_free(umb_scene *scene)
{
    umb_movers_state *m = &scene->moving;
    const umb_allocator *a = &scene->allocator;
    umb_ids_free(&m->ids, a);
    umb_memory_free(a, m->slots, m->slot_capacity * sizeof *m->slots);
    umb_memory_free(a, m->promises, m->promise_capacity * sizeof *m->promises);
    umb_memory_free(a, m->objects, m->object_capacity * sizeof *m->objects);
    umb_memory_free(a, m->due, m->due_capacity * sizeof *m->due);
    umb_memory_free(a, m->exact, m->exact_capacity * sizeof *m->exact);
    umb_memory_free(a, m->next_exact, m->next_exact_capacity * sizeof *m->next_exact);
    umb_expiries_free(&m->expiries, a);
}

size_t umb_motion_memory(const umb_scene *scene)
{
    const umb_movers_state *m = &scene->moving;
    return umb_ids_memory(&m->ids) + m->slot_capacity * sizeof *m->slots + m->promise_capacity * sizeof *m->promises +
           m->object_capacity * sizeof *m->objects + m->due_capacity * sizeof *m->due +
           (m->exact_capacity + m->next_exact_capacity) * sizeof *m->exact +
           umb_expiries_memory(&m->expiries);
}

/* Objects that move by themselves: their promises, and the making of their volumes at commits.
 *
 *   due: a list of movers whose volumes are to be made anew. What brings them there:
 *     a new motion          umb_scene_set_motion()
 *     expiry                the queue, up to the scene's time
 *     seen, and not shown   what cullers were told since the last commit
 *
 * What cullers were told is taken in too: a volume that was seen is followed by one that grows from the pose then told. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "scene_state.h"
#include "tbv.h"

#define FIRST_PERIOD 1.0
#define LEAST_PERIOD 0.125
#define MOST_PERIOD 64.0

/* ---- witnesses ------------------------------------------------------------------------------ */

static void lock(umb_scene *scene)
{
    while (atomic_flag_test_and_set_explicit(&scene->moving.witness_lock, memory_order_acquire)) {
    }
}

static void unlock(umb_scene *scene)
{
    atomic_flag_clear_explicit(&scene->moving.witness_lock, memory_order_release);
}

void umb_scene_add_witness(umb_scene *scene, umb_scene_witness *witness)
{
    lock(scene);
    witness->next = scene->moving.witnesses;
    scene->moving.witnesses = witness;
    unlock(scene);
}

void umb_scene_remove_witness(umb_scene *scene, umb_scene_witness *witness)
{
    lock(scene);
    umb_scene_witness **w = &scene->moving.witnesses;
    while (*w != NULL && *w != witness) {
        w = &(*w)->next;
    }
    if (*w != NULL) {
        *w = witness->next;
    }
    unlock(scene);
}

/* ---- promises ------------------------------------------------------------------------------- */

static bool is_promise(const umb_motion_def *d)
{
    const double numbers[6] = {d->max_speed,    d->max_acceleration, d->max_spin,
                               d->first_period, d->least_period,     d->most_period};
    bool good = umb_box_is_possible(&d->volume) &&
                (d->kind == UMB_MOTION_SPEED || (d->kind == UMB_MOTION_VOLUME && !umb_box_is_zero(&d->volume)));
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

static void make_due(umb_movers_state *m, uint32_t mover, uint8_t why)
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
           umb_memory_reserve(a, (void **)&m->objects, &m->object_capacity, need, sizeof *m->objects) &&
           umb_memory_reserve(a, (void **)&m->due, &m->due_capacity, need, sizeof *m->due) &&
           umb_expiries_reserve(&m->expiries, a, (uint32_t)need);
}

/* What readers see moved with the arrays. */
static void publish_arrays(umb_scene *scene)
{
    scene->committed.motion.objects = scene->moving.objects;
    scene->committed.motion.expiries = scene->moving.expiries.heap;
}

static umb_result start(umb_scene *scene, uint32_t object, const umb_motion_def *def)
{
    umb_object_slot *slot = &scene->objects[object];
    umb_movers_state *m = &scene->moving;
    if (slot->mover == UMB_NONE) {
        bool room = reserve(m, &scene->allocator);
        publish_arrays(scene);
        if (!room) {
            return umb_scene_fail(scene, UMB_ERROR_MEMORY, "out of memory for a motion");
        }
        slot->mover = umb_ids_take(&m->ids);
        m->slots[slot->mover] = (umb_mover_slot){0};
        m->objects[slot->mover] = object;
        m->count += 1;
    }
    umb_mover_slot *mover = &m->slots[slot->mover];
    m->fuzzy += def->fuzzy;
    m->fuzzy -= mover->def.fuzzy;
    mover->def = complete(def);
    mover->period = mover->def.first_period;
    mover->why &= (uint8_t)~UMB_DUE_STOP;
    make_due(m, slot->mover, UMB_DUE_FRESH);
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
            make_due(&scene->moving, slot->mover, UMB_DUE_STOP);
        }
        return UMB_OK;
    }
    if (scene->moving.source.pose == NULL) {
        return umb_scene_fail(scene, UMB_ERROR_STATE, "set where poses come from before the first motion");
    }
    if (!is_promise(def)) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT, "a motion's numbers are negative, or its volume is no box");
    }
    umb_result result = start(scene, object, def);
    if (result == UMB_OK) {
        umb_weld_dissolve(scene, slot->weld);
    }
    return result;
}

void umb_motion_remove(umb_scene *scene, const umb_object_slot *slot)
{
    if (slot->mover != UMB_NONE) {
        make_due(&scene->moving, slot->mover, UMB_DUE_STOP);
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

/* ---- volumes -------------------------------------------------------------------------------- */

/* Objects whose motions began together do not expire together: periods are stretched by a factor from 3/4 to 5/4 that
 * depends on the object and how often it was renewed, and on nothing else. */
static double stretch(uint32_t object, double period)
{
    uint64_t bits;
    memcpy(&bits, &period, sizeof bits);
    uint64_t mixed = (bits ^ object) * 0x9E3779B97F4A7C15u;
    mixed = (mixed ^ mixed >> 29) * 0xBF58476D1CE4E5B9u;
    return 0.75 + (double)(mixed >> 40) * 0x1p-25;
}

static void adapt(umb_movers_state *m, umb_mover_slot *mover)
{
    double factor = 1.0;
    if ((mover->why & UMB_DUE_REVEALED) != 0 || ((mover->why & UMB_DUE_EXPIRED) != 0 && mover->seen)) {
        factor = 0.5;
    } else if ((mover->why & UMB_DUE_EXPIRED) != 0) {
        factor = 2.0;
    }
    m->stats.expired += (mover->why & UMB_DUE_EXPIRED) != 0;
    m->stats.revealed += (mover->why & UMB_DUE_REVEALED) != 0;
    mover->period = fmin(fmax(mover->period * factor, mover->def.least_period), mover->def.most_period);
}

/* The latest pose that holds now: one that a culler was told, or a new one. */
static void know(umb_scene *scene, umb_mover_slot *mover, uint32_t object)
{
    umb_movers_state *m = &scene->moving;
    bool told = mover->placed && (mover->why & UMB_DUE_REVEALED) != 0 && (mover->why & UMB_DUE_FRESH) == 0 &&
                mover->known_at <= m->time &&
                (mover->known.holds == 0.0 || mover->known_at + mover->known.holds > m->time);
    if (!told) {
        mover->placed = umb_motion_ask(&m->source, object, m->time, &mover->known);
        mover->known_at = m->time;
        m->stats.asked += 1;
    }
}

/* Until when a volume made now is to hold. */
static double expiry_of(const umb_movers_state *m, const umb_mover_slot *mover, uint32_t object)
{
    double until = m->time + mover->period * stretch(object, mover->known_at);
    return mover->known.holds > 0.0 ? fmin(until, mover->known_at + mover->known.holds) : until;
}

/* The object never leaves a volume: nothing has to be known of where it is. */
static void settle(umb_scene *scene, uint32_t number)
{
    umb_movers_state *m = &scene->moving;
    scene->objects[m->objects[number]].bounds = m->slots[number].def.volume;
    umb_expiries_set(&m->expiries, number, INFINITY);
    umb_scene_touch_object(scene, m->objects[number]);
    m->stats.renewed += 1;
}

/* Where the object's shape was last known to be, and in place of its bounds a volume. */
static void renew(umb_scene *scene, uint32_t number)
{
    umb_movers_state *m = &scene->moving;
    umb_mover_slot *mover = &m->slots[number];
    uint32_t object = m->objects[number];
    umb_object_slot *slot = &scene->objects[object];
    const umb_mesh *mesh = umb_scene_mesh(scene, slot->placement.shape);
    umb_outcome seen;
    const umb_aabb *bounds = NULL;
    adapt(m, mover);
    know(scene, mover, object);
    const umb_pose *pose = &mover->known;
    mover->placed = mover->placed && umb_outcome_find(mesh, &pose->transform, &seen) == NULL &&
                    umb_outcome_bounds(&seen, &pose->bounds, &bounds) == NULL;
    mover->seen = false;
    if (!mover->placed) { /* nothing is known: it is asked for again in every cull and at every commit */
        umb_expiries_set(&m->expiries, number, -INFINITY);
        umb_scene_touch_object(scene, object);
        return;
    }
    umb_scene_place(&slot->placement, &pose->transform, &seen);
    double until = expiry_of(m, mover, object);
    const umb_aabb *local = mesh != NULL && umb_box_is_zero(&pose->bounds) ? &mesh->bounds : NULL;
    umb_tbv_start from = {.local = local, .pose = pose, .bounds = bounds};
    slot->bounds = umb_tbv_swept(&mover->def, &from, nextafter(until - mover->known_at, INFINITY));
    umb_expiries_set(&m->expiries, number, until);
    umb_scene_touch_object(scene, object);
    m->stats.renewed += 1;
}

/* Let it stand where it is now. Its number stays in use until readers no longer know it. */
static void stop(umb_scene *scene, uint32_t number)
{
    umb_movers_state *m = &scene->moving;
    uint32_t object = m->objects[number];
    umb_object_slot *slot = &scene->objects[object];
    umb_pose pose;
    umb_outcome seen;
    const umb_aabb *bounds;
    if (slot->state != UMB_SLOT_USED || slot->mover != number) {
        return;
    }
    slot->mover = UMB_NONE;
    umb_scene_touch_object(scene, object);
    m->stats.asked += 1;
    if (umb_motion_ask(&m->source, object, m->time, &pose) &&
        umb_outcome_find(umb_scene_mesh(scene, slot->placement.shape), &pose.transform, &seen) == NULL &&
        umb_outcome_bounds(&seen, &pose.bounds, &bounds) == NULL) {
        umb_scene_place(&slot->placement, &pose.transform, &seen);
        slot->bounds = *bounds;
    }
}

/* ---- commits -------------------------------------------------------------------------------- */

/* True if a culler's words are about a mover that still is. */
static bool concerns(const umb_movers_state *m, const umb_posed *told)
{
    return told->mover < m->ids.used && m->objects[told->mover] == told->object &&
           (m->slots[told->mover].why & (UMB_DUE_FRESH | UMB_DUE_STOP)) == 0;
}

/* Twice through what all cullers were told: who was shown by any of them, then who was not. The order of cullers
 * decides nothing: the latest pose counts, and poses of one time are one. */
static void listen(umb_scene *scene)
{
    umb_movers_state *m = &scene->moving;
    for (int pass = 0; pass < 2; ++pass) {
        for (umb_scene_witness *w = m->witnesses; w != NULL; w = w->next) {
            uint32_t count;
            const umb_posed *told = w->told(w->user, pass == 1, &count);
            for (uint32_t i = 0; i < count; ++i) {
                if (!concerns(m, &told[i])) {
                    continue;
                }
                umb_mover_slot *mover = &m->slots[told[i].mover];
                if (pass == 0) {
                    mover->shown = told[i].shown ? m->commit : mover->shown;
                    mover->seen = mover->seen || !told[i].expired;
                    if (told[i].known && (!mover->placed || told[i].time >= mover->known_at)) {
                        mover->known = told[i].pose;
                        mover->known_at = told[i].time;
                        mover->placed = true;
                    }
                } else if (mover->shown != m->commit && !told[i].expired &&
                           mover->period > mover->def.least_period && mover->def.kind == UMB_MOTION_SPEED) {
                    make_due(m, told[i].mover, UMB_DUE_REVEALED);
                }
            }
        }
    }
}

static void note_expired(void *user, uint32_t mover)
{
    make_due(user, mover, UMB_DUE_EXPIRED);
}

void umb_motion_commit(umb_scene *scene)
{
    umb_movers_state *m = &scene->moving;
    umb_motion *c = &scene->committed.motion;
    m->stats = (umb_motion_stats){0};
    m->commit += 1;
    listen(scene);
    bool back = m->time < m->made_at;
    m->made_at = m->time;
    if (back) {
        for (uint32_t i = 0; i < m->ids.used; ++i) {
            if (m->objects[i] != UMB_NONE) {
                make_due(m, i, UMB_DUE_FRESH);
            }
        }
    }
    umb_motion queue = {.expiries = m->expiries.heap, .expiry_count = m->expiries.count};
    umb_motion_expired(&queue, m->time, note_expired, m);
    c->time = m->due_count > 0 ? INFINITY : c->time;
    for (uint32_t i = 0; i < m->due_count; ++i) {
        if ((m->slots[m->due[i]].why & UMB_DUE_STOP) != 0) {
            stop(scene, m->due[i]);
        } else if (m->slots[m->due[i]].def.kind == UMB_MOTION_VOLUME) {
            settle(scene, m->due[i]);
        } else {
            renew(scene, m->due[i]);
        }
    }
}

void umb_motion_committed(umb_scene *scene)
{
    umb_movers_state *m = &scene->moving;
    for (uint32_t i = 0; i < m->due_count; ++i) {
        uint32_t number = m->due[i];
        if ((m->slots[number].why & UMB_DUE_STOP) != 0) {
            umb_expiries_set(&m->expiries, number, INFINITY);
            m->objects[number] = UMB_NONE;
            m->count -= 1;
            m->fuzzy -= m->slots[number].def.fuzzy;
            umb_ids_release(&m->ids, number);
        }
        m->slots[number].why = 0;
    }
    m->due_count = 0;
    umb_ids_commit(&m->ids);
    umb_motion *c = &scene->committed.motion;
    publish_arrays(scene);
    c->number_count = m->ids.used;
    c->count = m->count;
    c->expiry_count = m->expiries.count;
    c->fuzzy = m->fuzzy;
    c->time = m->time;
}

/* ---- the rest ------------------------------------------------------------------------------- */

void umb_scene_get_motion_stats(const umb_scene *scene, umb_motion_stats *out)
{
    const umb_movers_state *m = &scene->moving;
    *out = m->stats;
    out->movers = m->count;
    out->fuzzy = m->fuzzy;
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
    umb_memory_free(a, m->objects, m->object_capacity * sizeof *m->objects);
    umb_memory_free(a, m->due, m->due_capacity * sizeof *m->due);
    umb_expiries_free(&m->expiries, a);
}

size_t umb_motion_memory(const umb_scene *scene)
{
    const umb_movers_state *m = &scene->moving;
    return umb_ids_memory(&m->ids) + m->slot_capacity * sizeof *m->slots +
           m->object_capacity * sizeof *m->objects + m->due_capacity * sizeof *m->due +
           umb_expiries_memory(&m->expiries);
}

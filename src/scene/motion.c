/* Objects that move by themselves: their promises, and the making of their volumes at commits.
 *
 *   due: a list of movers whose volumes are to be made anew. What brings them there:
 *     a new motion          umb_scene_set_motion()
 *     expiry                the queue, up to the scene's time
 *     seen, and not shown   what cullers were told since the last commit
 *     hidden, but large     what cullers tested in vain since it was made
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
/* A hidden volume that was tested so often (each count stands for UMB_MOVERS_SAMPLE frames) has cost as much as a new one, which
 * may be out of the walks' way because it is smaller. If it is not, it is asked of it half as often, and so on so many times. */
#define MOST_TESTED 3
#define MOST_VAIN 5
/* Commits without a frame between them that change nothing in who is taken to be in sight. */
#define MOST_BLIND 4

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

bool umb_motion_is_exact(const umb_scene *scene, const umb_object_slot *slot)
{
    return slot->mover != UMB_NONE && scene->moving.slots[slot->mover].exact;
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
           umb_memory_reserve(a, (void **)&m->promises, &m->promise_capacity, need, sizeof *m->promises) &&
           umb_memory_reserve(a, (void **)&m->objects, &m->object_capacity, need, sizeof *m->objects) &&
           umb_memory_reserve(a, (void **)&m->due, &m->due_capacity, need, sizeof *m->due) &&
           umb_memory_reserve(a, (void **)&m->exact, &m->exact_capacity, need, sizeof *m->exact) &&
           umb_memory_reserve(a, (void **)&m->next_exact, &m->next_exact_capacity, need, sizeof *m->next_exact) &&
           umb_expiries_reserve(&m->expiries, a, (uint32_t)need);
}

/* What readers see moved with the arrays. */
static void publish_arrays(umb_scene *scene)
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
        publish_arrays(scene);
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

void umb_motion_shift(umb_scene *scene, const double shift[3])
{
    umb_movers_state *m = &scene->moving;
    for (uint32_t i = 0; i < m->ids.used; ++i) {
        umb_aabb *volume = &m->promises[i].def.volume;
        if (m->objects[i] != UMB_NONE) {
            *volume = umb_box_is_zero(volume) ? *volume : umb_scene_shift_box(volume, shift);
            make_due(m, i, UMB_DUE_FRESH);
        }
    }
}

void umb_motion_reshape(umb_scene *scene, umb_object_slot *slot, const umb_aabb *bounds)
{
    if (slot->mover == UMB_NONE) {
        return;
    }
    make_due(&scene->moving, slot->mover, UMB_DUE_FRESH);
    for (int i = 0; i < 3 && bounds != NULL; ++i) { /* it may be stopped where nobody can tell where it is */
        slot->bounds.min[i] = fminf(slot->bounds.min[i], bounds->min[i]);
        slot->bounds.max[i] = fmaxf(slot->bounds.max[i], bounds->max[i]);
    }
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

static void adapt(umb_movers_state *m, umb_mover_slot *mover, const umb_motion_def *def)
{
    double factor = 1.0;
    bool expired = (mover->why & UMB_DUE_EXPIRED) != 0, costly = (mover->why & UMB_DUE_COSTLY) != 0;
    if (costly || (mover->why & UMB_DUE_REVEALED) != 0 || (expired && mover->seen)) {
        factor = 0.5;
    } else if (expired) {
        factor = 2.0;
    }
    mover->vain = expired && mover->tested == 0 ? 0 : mover->vain;
    mover->vain += costly && mover->vain < MOST_VAIN;
    m->stats.expired += (mover->why & UMB_DUE_EXPIRED) != 0;
    m->stats.revealed += (mover->why & UMB_DUE_REVEALED) != 0;
    m->stats.costly += (mover->why & UMB_DUE_COSTLY) != 0;
    mover->period = fmin(fmax(mover->period * factor, def->least_period), def->most_period);
}

static bool ask(umb_movers_state *m, uint32_t object, umb_pose *out)
{
    m->stats.asked += 1;
    return umb_motion_ask(&m->source, object, m->time, out);
}

/* The latest pose that holds now: one that a culler was told, or a new one. */
static void know(umb_movers_state *m, umb_mover_slot *mover, umb_pose *known, uint32_t object)
{
    bool told = mover->placed && (mover->why & UMB_DUE_REVEALED) != 0 && (mover->why & UMB_DUE_FRESH) == 0 &&
                mover->known_at <= m->time && (known->holds == 0.0 || mover->known_at + known->holds > m->time);
    if (!told) {
        mover->placed = ask(m, object, known);
        mover->known_at = m->time;
    }
}

/* Until when a volume made now is to hold. */
static double expiry_of(const umb_movers_state *m, const umb_mover_slot *mover, const umb_pose *known, uint32_t object)
{
    double until = m->time + mover->period * stretch(object, mover->known_at);
    return known->holds > 0.0 ? fmin(until, mover->known_at + known->holds) : until;
}

/* The object never leaves a volume: nothing has to be known of where it is. */
static void settle(umb_scene *scene, uint32_t number)
{
    umb_movers_state *m = &scene->moving;
    scene->objects[m->objects[number]].bounds = m->promises[number].def.volume;
    m->slots[number].exact = m->slots[number].seen = false;
    umb_expiries_set(&m->expiries, number, INFINITY);
    umb_scene_touch_object(scene, m->objects[number]);
    m->stats.renewed += 1;
}

/* True if volumes can be made that are smaller than the one given. */
static bool grows(const umb_motion_def *def)
{
    return def->kind == UMB_MOTION_SPEED || def->max_speed > 0.0 || def->max_acceleration > 0.0 || def->max_spin > 0.0;
}

/* It was seen of late, and is likely to be seen again: as long as it is, it is put where it is at each commit, like
 * anything that is moved, which costs less than to ask for it in the walk. Where nobody has looked since the last commit, what
 * was seen before counts, but not for long. */
static bool is_shown(const umb_movers_state *m, const umb_mover_slot *mover)
{
    return mover->shown == m->commit || (m->blind > 0 && m->blind <= MOST_BLIND && mover->exact);
}

static bool stays_exact(const umb_movers_state *m, const umb_mover_slot *mover)
{
    return is_shown(m, mover) && (mover->why & UMB_DUE_FRESH) == 0;
}

/* Nothing is known: it is asked for again in every cull and at every commit. */
static void lose(umb_scene *scene, uint32_t number)
{
    umb_movers_state *m = &scene->moving;
    m->slots[number].exact = m->slots[number].placed = false;
    umb_expiries_set(&m->expiries, number, -INFINITY);
    umb_scene_touch_object(scene, m->objects[number]);
}

/* Where a pose puts an object; NULL, or its bounds. */
static const umb_aabb *find_place(const umb_scene *scene, uint32_t object, const umb_pose *pose, umb_outcome *out)
{
    const umb_aabb *bounds;
    const umb_mesh *mesh = umb_scene_mesh(scene, scene->objects[object].placement.shape);
    return umb_outcome_find(mesh, &pose->transform, out) == NULL &&
                   umb_outcome_bounds(out, &pose->bounds, &bounds) == NULL
               ? bounds
               : NULL;
}

/* Put it where it is at the scene's time. */
static void pin(umb_scene *scene, uint32_t number)
{
    umb_movers_state *m = &scene->moving;
    uint32_t object = m->objects[number];
    umb_object_slot *slot = &scene->objects[object];
    umb_pose pose;
    umb_outcome seen;
    const umb_aabb *bounds = ask(m, object, &pose) ? find_place(scene, object, &pose, &seen) : NULL;
    if (bounds == NULL) {
        lose(scene, number);
        return;
    }
    umb_scene_place(&slot->placement, &pose.transform, &seen);
    slot->bounds = *bounds;
    m->slots[number].exact = true;
    m->next_exact[m->next_exact_count++] = number;
    umb_expiries_set(&m->expiries, number, INFINITY);
    umb_scene_touch_object(scene, object);
}

static bool is_box(const umb_aabb *a, const umb_aabb *b)
{
    bool same = true;
    for (int i = 0; i < 3; ++i) {
        same = same && a->min[i] == b->min[i] && a->max[i] == b->max[i];
    }
    return same;
}

/* Put its shape where it was last known to be, and in place of its bounds a volume. */
static void renew(umb_scene *scene, uint32_t number)
{
    umb_movers_state *m = &scene->moving;
    umb_mover_slot *mover = &m->slots[number];
    umb_mover_promise *promise = &m->promises[number];
    uint32_t object = m->objects[number];
    umb_object_slot *slot = &scene->objects[object];
    umb_outcome seen;
    adapt(m, mover, &promise->def);
    know(m, mover, &promise->known, object);
    const umb_pose *pose = &promise->known;
    const umb_aabb *bounds = mover->placed ? find_place(scene, object, pose, &seen) : NULL;
    mover->seen = mover->exact = false;
    mover->tested = 0;
    if (bounds == NULL) {
        promise->def.kind == UMB_MOTION_VOLUME ? settle(scene, number) : lose(scene, number);
        return;
    }
    umb_scene_place(&slot->placement, &pose->transform, &seen);
    double until = expiry_of(m, mover, pose, object);
    const umb_mesh *mesh = umb_scene_mesh(scene, slot->placement.shape);
    const umb_aabb *local = mesh != NULL && umb_box_is_zero(&pose->bounds) ? &mesh->bounds : NULL;
    umb_tbv_start from = {.local = local, .pose = pose, .bounds = bounds};
    slot->bounds = umb_tbv_swept(&promise->def, &from, nextafter(until - mover->known_at, INFINITY));
    if (promise->def.kind == UMB_MOTION_VOLUME && is_box(&slot->bounds, &promise->def.volume)) {
        settle(scene, number);
        return;
    }
    umb_expiries_set(&m->expiries, number, until);
    umb_scene_touch_object(scene, object);
    m->stats.renewed += 1;
}

/* Make the volume of a mover that is due, or what there is in its place. */
static void make_volume(umb_scene *scene, uint32_t number)
{
    const umb_movers_state *m = &scene->moving;
    const umb_motion_def *def = &m->promises[number].def;
    bool fresh = (m->slots[number].why & UMB_DUE_FRESH) != 0;
    if (stays_exact(m, &m->slots[number])) {
        pin(scene, number);
    } else if (def->kind == UMB_MOTION_VOLUME && (fresh || !grows(def))) {
        settle(scene, number);
    } else {
        renew(scene, number);
    }
}

/* Let it stand where it is now. Its number stays in use until readers no longer know it. */
static void stop(umb_scene *scene, uint32_t number)
{
    umb_movers_state *m = &scene->moving;
    uint32_t object = m->objects[number];
    umb_object_slot *slot = &scene->objects[object];
    umb_pose pose;
    umb_outcome seen;
    if (slot->state != UMB_SLOT_USED || slot->mover != number) {
        return;
    }
    slot->mover = UMB_NONE;
    umb_scene_touch_object(scene, object);
    const umb_aabb *bounds = ask(m, object, &pose) ? find_place(scene, object, &pose, &seen) : NULL;
    if (bounds != NULL) {
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

/* What one culler says of who was seen. */
static void hear(umb_movers_state *m, const umb_testimony *t)
{
    for (uint32_t i = 0; i < t->shown_count; ++i) {
        if (t->shown[i] < m->ids.used) {
            m->slots[t->shown[i]].shown = m->commit;
        }
    }
    for (uint32_t i = 0; i < t->tested_count; ++i) {
        if (t->tested[i] < m->ids.used && m->slots[t->tested[i]].tested < UINT8_MAX) {
            m->slots[t->tested[i]].tested += 1;
        }
    }
    for (uint32_t i = 0; i < t->posed_count; ++i) {
        const umb_posed *told = &t->posed[i];
        if (!concerns(m, told)) {
            continue;
        }
        umb_mover_slot *mover = &m->slots[told->mover];
        mover->shown = told->shown ? m->commit : mover->shown;
        mover->seen = mover->seen || !told->expired;
        if (told->known && (!mover->placed || told->time >= mover->known_at)) {
            m->promises[told->mover].known = told->pose;
            mover->known_at = told->time;
            mover->placed = true;
        }
    }
}

/* True if a new volume would be smaller, and that is wanted. */
static bool is_large(const umb_movers_state *m, uint32_t mover)
{
    const umb_motion_def *def = &m->promises[mover].def;
    return m->slots[mover].period > def->least_period && grows(def);
}

/* What follows from it, when all have been heard. */
static void conclude(umb_movers_state *m, const umb_testimony *t)
{
    for (uint32_t i = 0; i < t->tested_count; ++i) {
        uint32_t mover = t->tested[i];
        if (mover < m->ids.used && m->objects[mover] != UMB_NONE && !m->slots[mover].exact &&
            m->slots[mover].tested >= MOST_TESTED << m->slots[mover].vain && is_large(m, mover)) {
            make_due(m, mover, UMB_DUE_COSTLY);
        }
    }
    for (uint32_t i = 0; i < t->posed_count; ++i) {
        const umb_posed *told = &t->posed[i];
        if (!concerns(m, told)) {
            continue;
        }
        const umb_mover_slot *mover = &m->slots[told->mover];
        if (mover->shown == m->commit) {
            make_due(m, told->mover, UMB_DUE_SHOWN);
        } else if (!told->expired && is_large(m, told->mover)) {
            make_due(m, told->mover, UMB_DUE_REVEALED);
        }
    }
}

/* Exact ones are so for a time only, and as long as they are seen. */
static void follow_exact(umb_movers_state *m, bool time_goes_on)
{
    m->next_exact_count = 0;
    for (uint32_t i = 0; i < m->exact_count; ++i) {
        const umb_mover_slot *mover = &m->slots[m->exact[i]];
        if (time_goes_on || !is_shown(m, mover) || mover->why != 0) {
            make_due(m, m->exact[i], UMB_DUE_SHOWN);
        } else {
            m->next_exact[m->next_exact_count++] = m->exact[i];
        }
    }
}

/* The order of cullers decides nothing: the latest pose counts, and poses of one time are one. Exact ones are due first:
 * they are many, and in order. */
static void listen(umb_scene *scene)
{
    umb_movers_state *m = &scene->moving;
    m->blind += m->blind < UINT32_MAX;
    for (umb_scene_witness *w = m->witnesses; w != NULL; w = w->next) {
        umb_testimony t = w->tell(w->user, false);
        m->blind = t.frames > 0 ? 0 : m->blind;
        hear(m, &t);
    }
    follow_exact(m, m->time != m->made_at);
    for (umb_scene_witness *w = m->witnesses; w != NULL; w = w->next) {
        umb_testimony t = w->tell(w->user, true);
        conclude(m, &t);
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
        } else {
            make_volume(scene, m->due[i]);
        }
    }
}

static void sink(uint32_t *numbers, uint32_t at, uint32_t count)
{
    uint32_t number = numbers[at];
    for (uint32_t child = 2 * at + 1; child < count; child = 2 * at + 1) {
        child += child + 1 < count && numbers[child + 1] > numbers[child];
        if (numbers[child] <= number) {
            break;
        }
        numbers[at] = numbers[child];
        at = child;
    }
    numbers[at] = number;
}

/* In place, without memory. */
static void sort_numbers(uint32_t *numbers, uint32_t count)
{
    for (uint32_t i = count / 2; i-- > 0;) {
        sink(numbers, i, count);
    }
    for (uint32_t i = count; i-- > 1;) {
        uint32_t last = numbers[i];
        numbers[i] = numbers[0];
        numbers[0] = last;
        sink(numbers, 0, i);
    }
}

/* Bring the exact ones in order, of which all but a few at the end are: commits then go through memory in order, which for
 * thousands is worth more than anything else. due is room to work in. */
static void order_exact(umb_movers_state *m)
{
    uint32_t *list = m->exact, count = m->exact_count, sorted = count > 0 ? 1 : 0, to = count;
    while (sorted < count && list[sorted] > list[sorted - 1]) {
        ++sorted;
    }
    uint32_t rest = count - sorted;
    sort_numbers(list + sorted, rest);
    for (uint32_t i = 0; i < rest; ++i) {
        m->due[i] = list[sorted + i];
    }
    while (rest > 0) {
        list[--to] = sorted > 0 && list[sorted - 1] > m->due[rest - 1] ? list[--sorted] : m->due[--rest];
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
            m->fuzzy -= m->promises[number].def.fuzzy;
            m->slots[number].exact = false;
            umb_ids_release(&m->ids, number);
        }
        m->slots[number].why = 0;
    }
    m->due_count = 0;
    uint32_t *exact = m->exact;
    size_t exact_capacity = m->exact_capacity;
    m->exact = m->next_exact;
    m->exact_capacity = m->next_exact_capacity;
    m->exact_count = m->next_exact_count;
    m->next_exact = exact;
    m->next_exact_capacity = exact_capacity;
    order_exact(m);
    umb_ids_commit(&m->ids);
    umb_motion *c = &scene->committed.motion;
    publish_arrays(scene);
    c->number_count = m->ids.used;
    c->count = m->count;
    c->expiry_count = m->expiries.count;
    c->exact_count = m->exact_count;
    c->fuzzy = m->fuzzy;
    c->time = m->time;
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

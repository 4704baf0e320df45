/* The volumes of objects that move by themselves: made from what is known of each, for as long as that has paid. What cullers were
 * told is taken in too: a volume that was seen is followed by one that grows from the pose then told. */
#include <math.h>
#include <string.h>

#include "scene_state.h"
#include "tbv.h"

/* How often on end a hidden volume is made smaller because walks came upon it, each time after twice as many of them. */
#define MOST_VAIN 5
/* Commits without a frame between them that change nothing in who is taken to be in sight. */
#define MOST_BLIND 4

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

bool umb_motion_grows(const umb_motion_def *def)
{
    return def->kind == UMB_MOTION_SPEED || def->max_speed > 0.0 || def->max_acceleration > 0.0 || def->max_spin > 0.0;
}

bool umb_motion_is_shown(const umb_movers_state *m, const umb_mover_slot *mover)
{
    return mover->shown == m->commit || (m->blind > 0 && m->blind <= MOST_BLIND && mover->exact);
}

static bool stays_exact(const umb_movers_state *m, const umb_mover_slot *mover)
{
    return umb_motion_is_shown(m, mover) && (mover->why & UMB_DUE_FRESH) == 0;
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

void umb_motion_make_volume(umb_scene *scene, uint32_t number)
{
    const umb_movers_state *m = &scene->moving;
    const umb_motion_def *def = &m->promises[number].def;
    bool fresh = (m->slots[number].why & UMB_DUE_FRESH) != 0;
    if (stays_exact(m, &m->slots[number])) {
        pin(scene, number);
    } else if (def->kind == UMB_MOTION_VOLUME && (fresh || !umb_motion_grows(def))) {
        settle(scene, number);
    } else {
        renew(scene, number);
    }
}

void umb_motion_stop(umb_scene *scene, uint32_t number)
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

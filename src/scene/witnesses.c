/* What cullers say at a commit of those that move by themselves: who was shown, whose volume was tested, what poses they were
 * told. Who is due follows from it. */
#include "scene_state.h"

/* A hidden volume that was tested so often (each count stands for UMB_MOVERS_SAMPLE frames) has cost as much as a new one, which
 * may be out of the walks' way because it is smaller. If it is not, it is asked of it half as often, and so on. */
#define MOST_TESTED 3

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

/* ---- what they say -------------------------------------------------------------------------- */

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
    return m->slots[mover].period > def->least_period && umb_motion_grows(def);
}

/* What follows from it, when all have been heard. */
static void conclude(umb_movers_state *m, const umb_testimony *t)
{
    for (uint32_t i = 0; i < t->tested_count; ++i) {
        uint32_t mover = t->tested[i];
        if (mover < m->ids.used && m->objects[mover] != UMB_NONE && !m->slots[mover].exact &&
            m->slots[mover].tested >= MOST_TESTED << m->slots[mover].vain && is_large(m, mover)) {
            umb_motion_make_due(m, mover, UMB_DUE_COSTLY);
        }
    }
    for (uint32_t i = 0; i < t->posed_count; ++i) {
        const umb_posed *told = &t->posed[i];
        if (!concerns(m, told)) {
            continue;
        }
        const umb_mover_slot *mover = &m->slots[told->mover];
        if (mover->shown == m->commit) {
            umb_motion_make_due(m, told->mover, UMB_DUE_SHOWN);
        } else if (!told->expired && is_large(m, told->mover)) {
            umb_motion_make_due(m, told->mover, UMB_DUE_REVEALED);
        }
    }
}

/* Exact ones are so for a time only, and as long as they are seen. */
static void follow_exact(umb_movers_state *m, bool time_goes_on)
{
    m->next_exact_count = 0;
    for (uint32_t i = 0; i < m->exact_count; ++i) {
        const umb_mover_slot *mover = &m->slots[m->exact[i]];
        if (time_goes_on || !umb_motion_is_shown(m, mover) || mover->why != 0) {
            umb_motion_make_due(m, m->exact[i], UMB_DUE_SHOWN);
        } else {
            m->next_exact[m->next_exact_count++] = m->exact[i];
        }
    }
}

/* Exact ones are due first: they are many, and in order. */
void umb_witnesses_listen(umb_scene *scene)
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

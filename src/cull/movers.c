#include "movers.h"

#include <math.h>
#include <string.h>

#include "contribution.h"
#include "found.h"
#include "in_view.h"
#include "scene/placement.h"

/* ---- the scene as a frame sees it ----------------------------------------------------------- */

static umb_testimony tell(void *user, bool forget)
{
    umb_movers *m = user;
    umb_testimony t = {m->posed, m->shown, m->tested, m->posed_count, m->shown_count, m->tested_count, m->frames};
    if (forget) {
        m->posed_count = m->shown_count = m->tested_count = m->frames = 0;
        m->commit += 1;
    }
    return t;
}

void umb_movers_start(umb_movers *m, umb_scene *scene)
{
    m->commit = 1;
    m->witness.tell = tell;
    m->witness.user = m;
    umb_scene_add_witness(scene, &m->witness);
}

void umb_movers_end(umb_movers *m, umb_scene *scene, const umb_allocator *a)
{
    umb_scene_remove_witness(scene, &m->witness);
    umb_memory_free(a, m->occluders, m->occluder_capacity * sizeof *m->occluders);
    umb_memory_free(a, m->posed, m->posed_capacity * sizeof *m->posed);
    umb_memory_free(a, m->places, m->place_capacity * sizeof *m->places);
    umb_memory_free(a, m->shown, m->shown_capacity * sizeof *m->shown);
    umb_memory_free(a, m->tested, m->tested_capacity * sizeof *m->tested);
    umb_memory_free(a, m->shown_in, m->shown_in_capacity * sizeof *m->shown_in);
}

static void copy_owned(umb_movers *m, const umb_committed *scene, const uint32_t *objects, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t occluder = scene->objects[objects[i]].occluder;
        if (occluder != UMB_NONE) {
            m->occluders[occluder] = scene->occluders[occluder];
        }
    }
}

/* Make the copy of the occluders one of this version: where the last one is known, by what has changed since. Those of
 * movers hold old poses then, which nobody looks at before they are asked for. */
static void copy_occluders(umb_movers *m, const umb_committed *scene)
{
    if (m->version == scene->version) {
        return;
    }
    if (m->version + 1 == scene->version && m->version != 0) {
        copy_owned(m, scene, scene->moved, scene->moved_count);
        for (uint32_t i = 0; m->structure != scene->structure && i < scene->replaced_count; ++i) {
            uint32_t occluder = scene->replaced[i];
            if (occluder < scene->occluder_count) {
                m->occluders[occluder] = scene->occluders[occluder];
            }
        }
    } else if (scene->occluder_count > 0) {
        memcpy(m->occluders, scene->occluders, scene->occluder_count * sizeof *m->occluders);
    }
    m->version = scene->version;
    m->structure = scene->structure;
}

/* At another time than the scene's exact movers are anywhere, as all others: the copies of their occluders say so, and are
 * made anew when they count again. After a commit that failed, nobody can tell which ones they are. */
static void strip_exact(umb_movers *m, const umb_committed *scene)
{
    const umb_motion *motion = &scene->motion;
    bool all = !(motion->time < INFINITY);
    uint32_t count = all ? motion->number_count : motion->exact_count;
    for (uint32_t i = 0; i < count && (m->stripped || !m->now); ++i) {
        uint32_t object = motion->objects[all ? i : motion->exact[i]];
        uint32_t occluder = object < scene->object_count ? scene->objects[object].occluder : UMB_NONE;
        if (occluder != UMB_NONE) {
            m->occluders[occluder] = scene->occluders[occluder];
            m->occluders[occluder].moves = scene->occluders[occluder].moves || !m->now;
        }
    }
    m->stripped = !m->now;
}

static bool reserve(umb_movers *m, const umb_allocator *a, const umb_committed *scene, bool occluders)
{
    size_t numbers = scene->motion.number_count;
    if (!umb_memory_reserve(a, (void **)&m->posed, &m->posed_capacity, numbers, sizeof *m->posed) ||
        !umb_memory_reserve_none(a, &m->places, &m->place_capacity, numbers) ||
        !umb_memory_reserve(a, (void **)&m->shown, &m->shown_capacity, numbers, sizeof *m->shown) ||
        !umb_memory_reserve_zero(a, (void **)&m->shown_in, &m->shown_in_capacity, numbers, sizeof *m->shown_in) ||
        !umb_memory_reserve(a, (void **)&m->tested, &m->tested_capacity, numbers, sizeof *m->tested) ||
        !umb_memory_reserve(a, (void **)&m->occluders, &m->occluder_capacity, occluders ? scene->occluder_count : 0,
                            sizeof *m->occluders)) {
        return false;
    }
    return true;
}

const umb_committed *umb_movers_begin(umb_movers *m, const umb_allocator *a, const umb_committed *scene, double time,
                                      bool occluders)
{
    if (scene->motion.count == 0) {
        m->posed_count = 0;
        m->version = 0;
        return scene;
    }
    if (!reserve(m, a, scene, occluders)) {
        m->posed_count = 0;
        m->version = 0;
        return NULL;
    }
    if (m->told_time != time || m->told_version != scene->version || m->frame == UINT32_MAX) {
        m->posed_count = 0;
    }
    m->now = time == scene->motion.time;
    m->frame = m->frame < UINT32_MAX ? m->frame + 1 : 1;
    m->frames += m->frames < UINT32_MAX;
    m->met = 0;
    m->told_time = time;
    m->told_version = scene->version;
    m->scene = *scene;
    if (occluders) {
        copy_occluders(m, scene);
        strip_exact(m, scene);
        m->scene.occluders = m->occluders;
    }
    return &m->scene;
}

/* ---- poses ---------------------------------------------------------------------------------- */

static bool place(umb_posed *p, const umb_mesh *mesh)
{
    umb_outcome seen;
    const umb_aabb *bounds;
    if (umb_outcome_find(mesh, &p->pose.transform, &seen) != NULL ||
        umb_outcome_bounds(&seen, &p->pose.bounds, &bounds) != NULL) {
        return false;
    }
    p->pose.transform = *umb_outcome_transform(&seen, &p->pose.transform);
    p->bounds = *bounds;
    p->block_bounds = *seen.block_bounds;
    p->identity = seen.identity;
    p->mirrored = seen.mirrored;
    return true;
}

static bool is_within(const umb_aabb *inner, const umb_aabb *outer)
{
    bool within = true;
    for (int i = 0; i < 3; ++i) {
        within = within && inner->min[i] >= outer->min[i] && inner->max[i] <= outer->max[i];
    }
    return within;
}

static umb_posed *ask(umb_movers *m, const umb_object *o, uint32_t object, bool expired, umb_cull_stats *stats)
{
    umb_posed *p = &m->posed[m->posed_count];
    m->places[o->mover] = m->posed_count++;
    *p = (umb_posed){.mover = o->mover, .object = object, .time = m->told_time, .expired = expired};
    p->known = umb_motion_ask(&m->scene.motion.source, object, m->told_time, &p->pose) && place(p, o->mesh);
    stats->poses += 1;
    stats->expired += expired;
    stats->strays += p->known && !expired && !is_within(&p->bounds, &o->bounds);
    if (p->known && o->occluder != UMB_NONE && m->scene.occluders == m->occluders) {
        umb_occluder *occluder = &m->occluders[o->occluder];
        occluder->transform = p->pose.transform;
        occluder->bounds = p->block_bounds;
        occluder->identity = p->identity;
        occluder->mirrored = p->mirrored;
    }
    return p;
}

umb_posed *umb_movers_meet(umb_movers *m, uint32_t object, bool expired, umb_cull_stats *stats)
{
    const umb_object *o = &m->scene.objects[object];
    umb_posed *p = umb_movers_find(m, o->mover);
    p = p != NULL ? p : ask(m, o, object, expired, stats);
    if (p->frame == m->frame) {
        return NULL;
    }
    p->frame = m->frame;
    m->met += 1;
    return p;
}

umb_object umb_movers_object(const umb_movers *m, const umb_posed *posed)
{
    umb_object o = m->scene.objects[posed->object];
    o.bounds = posed->bounds;
    o.transform = posed->pose.transform;
    o.identity = posed->identity;
    o.box = false; /* not known; it only saves a question */
    return o;
}

typedef struct meeting {
    const umb_movers *movers;
    void (*meet)(void *user, uint32_t mover);
    void *user;
} meeting;

/* A number may belong to an object that readers do not know to move, after a commit that failed. */
static void meet_if_there(void *user, uint32_t mover)
{
    const meeting *to = user;
    const umb_committed *scene = &to->movers->scene;
    uint32_t object = scene->motion.objects[mover];
    if (object < scene->object_count && scene->objects[object].live && scene->objects[object].mover == mover) {
        to->meet(to->user, mover);
    }
}

void umb_movers_expired(const umb_movers *m, void (*meet)(void *user, uint32_t mover), void *user)
{
    const umb_motion *motion = &m->scene.motion;
    meeting to = {m, meet, user};
    if (m->told_time >= motion->time) {
        umb_motion_expired(motion, m->told_time, meet_if_there, &to);
        for (uint32_t i = 0; i < motion->exact_count && !m->now; ++i) {
            meet_if_there(&to, motion->exact[i]);
        }
        return;
    }
    for (uint32_t i = 0; i < motion->number_count; ++i) {
        meet_if_there(&to, i);
    }
}

/* ---- without occlusion ---------------------------------------------------------------------- */

static void meet_silently(void *user, uint32_t mover)
{
    const umb_in_view *v = ((void **)user)[1];
    umb_movers *m = ((void **)user)[0];
    (void)umb_movers_meet(m, m->scene.motion.objects[mover], true, v->stats);
}

/* True if an object is in view where it is; *entry becomes what is to be written of it. */
static bool is_in_view(umb_in_view *v, const umb_posed *p, uint64_t *entry)
{
    umb_node box;
    uint16_t left[UMB_NODE_WIDTH];
    umb_projected projected;
    if (!p->known) {
        *entry = umb_found_entry(-INFINITY, p->object, false);
        return true;
    }
    box.count = 1;
    for (uint32_t slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
        box.ref[slot] = slot == 0 ? UMB_REF_OBJECT | p->object : UMB_NONE;
        for (int axis = 0; axis < 3; ++axis) {
            box.min[axis][slot] = p->bounds.min[axis];
            box.max[axis][slot] = p->bounds.max[axis];
        }
    }
    if ((umb_frustum_test_node(&v->frustum, v->kernels, &box, v->frustum.all_planes, NULL, left) & 1u) != 0) {
        return false;
    }
    if (v->view->min_pixels > 0.0 && umb_contribution_small(v->view, &p->bounds)) {
        v->stats->small += 1;
        return false;
    }
    if (v->entries != NULL) {
        v->kernels->project(&box, v->projector, &projected);
    }
    *entry = umb_found_entry(v->entries != NULL ? projected.w_min[0] : 0.0f, p->object, left[0] == 0);
    return true;
}

static void write(umb_in_view *v, uint32_t at, uint64_t entry)
{
    if (v->entries != NULL) {
        v->entries[at] = entry;
    } else {
        v->objects[at] = umb_found_id(entry);
        v->inside[at] = umb_found_inside(entry);
    }
}

/* The one found at a place; false if it is not to be kept. */
static bool keep(umb_movers *m, umb_in_view *v, uint32_t at, uint64_t *entry)
{
    *entry = v->entries != NULL ? v->entries[at] : umb_found_entry(0.0f, v->objects[at], v->inside[at] != 0);
    uint32_t object = umb_found_id(*entry);
    const umb_object *o = &m->scene.objects[object];
    if (!umb_movers_roams(m, o)) {
        umb_movers_show(m, object);
        return true;
    }
    if (v->entries == NULL && umb_found_inside(*entry) && umb_movers_find(m, o->mover) == NULL) {
        return true;
    }
    umb_posed *p = umb_movers_meet(m, object, false, v->stats);
    if (p == NULL || (p->known && !is_in_view(v, p, entry))) {
        return false;
    }
    p->shown = true;
    return true;
}

void umb_movers_in_view(umb_movers *m, umb_in_view *v)
{
    void *both[2] = {m, v};
    uint32_t found = v->count;
    uint64_t entry;
    umb_movers_expired(m, meet_silently, both);
    v->count = 0;
    for (uint32_t i = 0; i < found; ++i) {
        if (keep(m, v, i, &entry)) {
            write(v, v->count++, entry);
        }
    }
    for (uint32_t i = 0; i < m->posed_count; ++i) {
        umb_posed *p = &m->posed[i];
        if (p->expired && p->frame == m->frame && is_in_view(v, p, &entry)) {
            p->shown = true;
            write(v, v->count++, entry);
        }
    }
    v->stats->in_frustum = v->count + v->stats->small;
}

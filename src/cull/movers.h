/* A culler's side of moving objects: the poses that it asked for, which live here until the next commit, and the scene
 * as one frame sees it, in which the occluders of those objects stand where these poses put them. */
#ifndef UMB_MOVERS_H
#define UMB_MOVERS_H

#include "base/memory.h"
#include "scene/scene.h"
#include "umbrage/cull.h"

/* Of hidden volumes that are tested so many are counted as one; each object has its own frames. */
#define UMB_MOVERS_SAMPLE 16u

typedef struct umb_movers {
    umb_committed scene; /* what this frame looks at; its occluders are the culler's own copy */
    umb_occluder *occluders;
    umb_posed *posed;  /* what was told for one time and one version of the scene */
    uint32_t *places;  /* per mover: where in posed it is, if it is; any number else */
    uint32_t *shown;   /* exact movers reported since the last commit, */
    uint64_t *shown_in; /* and for each mover the commit after which it was last put there, counted from 1 */
    uint32_t *tested;  /* volumes tested since the last commit, and hidden: one in UMB_MOVERS_SAMPLE */
    size_t occluder_capacity, posed_capacity, place_capacity, shown_capacity, shown_in_capacity, tested_capacity;
    uint32_t posed_count, shown_count, tested_count;
    uint32_t frame, met; /* the frame that is going on; how many movers were met in it */
    uint32_t frames;     /* since the last commit */
    uint64_t version, structure; /* of the scene that occluders is a copy of; version 0: of none */
    uint64_t told_version;       /* that poses were told for */
    uint64_t commit;
    bool now;      /* the frame is of the scene's time: exact movers are where they are said to be */
    bool stripped; /* the copies of their occluders say that they are not */
    double told_time;
    umb_scene_witness witness;
} umb_movers;

void umb_movers_start(umb_movers *m, umb_scene *scene);
void umb_movers_end(umb_movers *m, umb_scene *scene, const umb_allocator *a);

/* Begin a frame at a time, with room for all that it can need; occluders: they are to be drawn. Returns the scene to look
 * at: the committed one itself if nothing in it moves. NULL without memory. */
const umb_committed *umb_movers_begin(umb_movers *m, const umb_allocator *a, const umb_committed *scene, double time,
                                      bool occluders);

/* What was told of a mover for this frame's time, or NULL. */
static inline umb_posed *umb_movers_find(const umb_movers *m, uint32_t mover)
{
    uint32_t at = m->places[mover];
    return at < m->posed_count && m->posed[at].mover == mover ? &m->posed[at] : NULL;
}

/* An object has been met: ask where it is, unless that has been told for this time, and put its occluder there. NULL if it
 * has been met in this frame before. */
umb_posed *umb_movers_meet(umb_movers *m, uint32_t object, bool expired, umb_cull_stats *stats);

/* True if an object's bounds are no more than a volume. */
static inline bool umb_movers_roams(const umb_movers *m, const umb_object *o)
{
    return o->mover != UMB_NONE && !(o->exact && m->now);
}

/* An object is reported. */
static inline void umb_movers_show(umb_movers *m, uint32_t object)
{
    const umb_object *o = &m->scene.objects[object];
    if (umb_movers_roams(m, o)) {
        umb_posed *p = umb_movers_find(m, o->mover);
        if (p != NULL) {
            p->shown = true;
        }
    } else if (o->mover != UMB_NONE && m->shown_in[o->mover] != m->commit) {
        m->shown_in[o->mover] = m->commit;
        m->shown[m->shown_count++] = o->mover;
    }
}

/* An object's box was tested, and is hidden. */
static inline void umb_movers_pass(umb_movers *m, uint32_t object)
{
    if ((object + m->frame) % UMB_MOVERS_SAMPLE == 0 && m->tested_count < m->tested_capacity) {
        m->tested[m->tested_count] = m->scene.objects[object].mover;
        m->tested_count += m->scene.objects[object].mover != UMB_NONE;
    }
}

/* How many movers neither the frame nor, for it, the commit had to ask for. */
static inline uint32_t umb_movers_hidden(const umb_movers *m)
{
    return m->scene.motion.count - m->met - (m->now ? m->scene.motion.exact_count : 0);
}

/* The object as it was told to be; it is known. */
umb_object umb_movers_object(const umb_movers *m, const umb_posed *posed);

/* Call meet for each mover that is in the index, but whose volume does not hold at this frame's time. */
void umb_movers_expired(const umb_movers *m, void (*meet)(void *user, uint32_t mover), void *user);

/* Put the movers right among what was found in view: those of which only a part of the volume is, and those whose volume
 * does not hold, are where they truly are; with keys, all of them. */
struct umb_in_view;
void umb_movers_in_view(umb_movers *m, struct umb_in_view *v);

#endif

/* Two short ways to what may be seen, in view alone (in_view.h) and past occluders that are chosen first (chosen.h), and what
 * all ways end with: whole objects, without those left out, in order. */
#include "answer.h"

#include <string.h>

#include "found.h"

/* Without occlusion. */
void umb_answer_in_view(umb_walk *w)
{
    umb_culler *c = w->culler;
    umb_in_view v = {.tree = w->tree,
                     .view = w->view,
                     .kernels = c->kernels,
                     .frustum = w->frustum,
                     .room = &c->room,
                     .remember = c->planes,
                     .objects = c->objects,
                     .inside = c->inside,
                     .entries = c->def.unordered ? NULL : c->found,
                     .projector = &w->projector,
                     .scene = w->scene,
                     .once = w->once,
                     .stats = &w->stats};
    umb_in_view_find(&v);
    c->count = v.count;
}

/* Without the best-first walk, which meets movers on its way: put them right afterwards. */
static void settle_movers(umb_walk *w)
{
    umb_culler *c = w->culler;
    umb_in_view v = {.view = w->view,
                     .kernels = c->kernels,
                     .frustum = w->frustum,
                     .objects = c->objects,
                     .inside = c->inside,
                     .entries = c->ops == NULL && c->def.unordered ? NULL : c->found,
                     .projector = &w->projector,
                     .count = c->count,
                     .stats = &w->stats};
    umb_movers_in_view(&c->movers, &v);
    c->count = v.count;
}

static umb_viewer viewer_of(const umb_view *v)
{
    bool parallel = v->projection == UMB_ORTHOGRAPHIC;
    umb_viewer viewer = {.points = parallel ? &v->forward : &v->eye,
                         .point_count = 1,
                         .parallel = parallel,
                         .cut = true,
                         .near_depth = v->near_depth};
    memcpy(viewer.from, v->eye, sizeof viewer.from);
    memcpy(viewer.forward, v->forward, sizeof viewer.forward);
    return viewer;
}

/* With a method that chooses its occluders first. */
umb_result umb_answer_chosen(umb_walk *w)
{
    umb_culler *c = w->culler;
    umb_choice choice = {.viewer = viewer_of(w->view),
                         .view = w->view,
                         .frustum = &w->frustum,
                         .scene = w->scene,
                         .tree = w->tree,
                         .budget = c->def.occluder_budget,
                         .coherence = c->def.coherence,
                         .stats = &w->stats,
                         .mask = c->filter.hides ? (umb_mask){0, false} : c->filter.mask};
    umb_result result = c->ops->choose(c->method, &choice);
    if (result != UMB_OK) {
        return result;
    }
    umb_chosen chosen = {.choice = &choice,
                         .ops = c->ops,
                         .method = c->method,
                         .kernels = c->kernels,
                         .projector = &w->projector,
                         .room = &c->chosen_room,
                         .once = w->once,
                         .remember = c->planes,
                         .entries = c->found};
    umb_chosen_find(&chosen);
    c->count = chosen.count;
    return UMB_OK;
}

/* What was found in parts, as whole objects. */
static void make_whole(umb_walk *w)
{
    umb_culler *c = w->culler;
    umb_once_view v = {w->scene, &w->frustum, c->kernels, &w->projector,
                       w->scene->motion.count > 0 ? &c->movers : NULL};
    bool sorted = c->ops != NULL || !c->def.unordered;
    for (uint32_t i = 0; i < c->count && c->ops != NULL; ++i) {
        c->objects[i] = umb_found_id(c->found[i]);
    }
    c->count = umb_once_finish(&v, c->objects, c->count, sorted ? c->found : NULL, c->objects, c->inside);
    if (c->ops == NULL) {
        w->stats.in_frustum = w->stats.small + c->count;
    }
    w->stats.hidden_objects = w->stats.in_frustum - w->stats.small - c->count;
}

/* The entries found, in order if asked for, as ids and flags. */
static void write_answer(umb_culler *c)
{
    const uint64_t *found = c->def.unordered ? c->found : umb_sort_words(c->found, c->scratch, c->count);
    for (uint32_t i = 0; i < c->count; ++i) {
        c->objects[i] = umb_found_id(found[i]);
        c->inside[i] = umb_found_inside(found[i]);
    }
}

/* Drop what the view's mask and the candidates leave out. */
static void leave_out(umb_walk *w)
{
    umb_culler *c = w->culler;
    bool entries = c->ops != NULL || !c->def.unordered;
    uint32_t left = entries ? umb_filter_entries(&c->filter, c->found, c->count)
                            : umb_filter_ids(&c->filter, c->objects, c->inside, c->count);
    w->stats.left_out += c->count - left;
    w->stats.in_frustum -= c->ops == NULL ? c->count - left : 0;
    c->count = left;
}

/* Once the walk has ended: from what was found to what is answered. */
void umb_answer_finish(umb_walk *w)
{
    umb_culler *c = w->culler;
    bool filters = umb_filter_on(&c->filter);
    if (w->once != NULL) {
        make_whole(w);
    }
    if (filters) {
        leave_out(w);
    }
    if (w->scene->motion.count > 0 && (c->ops == NULL || umb_culler_chooses(c))) {
        settle_movers(w);
        if (filters) { /* those whose volumes did not hold came by themselves */
            leave_out(w);
        }
    }
    if (c->ops != NULL || !c->def.unordered) {
        write_answer(c);
    }
    w->stats.visible = c->count;
    w->stats.hidden_movers = w->scene->motion.count > 0 ? umb_movers_hidden(&c->movers) : 0;
}

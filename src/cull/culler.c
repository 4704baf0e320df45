/* A culler: what it owns, and how a frame goes: made ready, walked, answered. */
#include "answer.h"
#include "best_first.h"

#include <float.h>
#include <string.h>

#include "base/memory.h"

umb_result umb_culler_create(const umb_index *index, const umb_culler_def *def, umb_culler **out)
{
    static const umb_culler_def zero = {0};
    def = def != NULL ? def : &zero;
    *out = NULL;
    const umb_box_kernels *kernels = umb_box_kernels_get(def->isa);
    if (kernels == NULL) {
        return umb_error_set(def->error, UMB_ERROR_ARGUMENT,
                             "instruction set %s is not available here", umb_isa_name(def->isa));
    }
    if (def->method != UMB_METHOD_NONE && umb_method_get(def->method) == NULL) {
        return umb_error_set(def->error, UMB_ERROR_ARGUMENT, "unknown method %d", (int)def->method);
    }
    if ((def->coherence & ~(uint32_t)UMB_COHERENCE_ALL) != 0) {
        return umb_error_set(def->error, UMB_ERROR_ARGUMENT, "unknown coherence switches 0x%x",
                             def->coherence & ~(uint32_t)UMB_COHERENCE_ALL);
    }
    const umb_allocator *allocator = umb_scene_allocator(umb_index_scene(index));
    umb_culler *c = umb_memory_allocate_zero(allocator, 1, sizeof *c);
    if (c == NULL) {
        return umb_error_set(def->error, UMB_ERROR_MEMORY, "no memory for a culler");
    }
    c->allocator = *allocator;
    c->index = index;
    c->def = *def;
    c->kernels = kernels;
    c->ops = umb_method_get(def->method);
    if (c->ops != NULL && !umb_culler_chooses(c)) { /* without occlusion there is nothing to learn */
        c->past.switches = def->coherence & ~(uint32_t)(UMB_COHERENCE_PLANES | UMB_COHERENCE_LEAVES);
        c->past.budget = def->occluder_budget;
    }
    if (c->ops != NULL && c->ops->create(allocator, def->isa, &c->method) != UMB_OK) {
        umb_memory_free(allocator, c, sizeof *c);
        return umb_error_set(def->error, UMB_ERROR_MEMORY, "no memory for a culler");
    }
    umb_movers_start(&c->movers, umb_index_scene(index));
    *out = c;
    return UMB_OK;
}

void umb_culler_destroy(umb_culler *c)
{
    if (c == NULL) {
        return;
    }
    umb_allocator a = c->allocator;
    if (c->ops != NULL) {
        c->ops->destroy(c->method);
    }
    umb_heap_free(&c->heap, &a);
    umb_past_free(&c->past, &a);
    umb_once_free(&c->once, &a);
    umb_movers_end(&c->movers, umb_index_scene(c->index), &a);
    umb_filter_free(&c->filter, &a);
    umb_in_view_free(&c->room, &a);
    umb_chosen_free(&c->chosen_room, &a);
    umb_memory_free(&a, c->found, c->found_capacity * sizeof *c->found);
    umb_memory_free(&a, c->scratch, c->scratch_capacity * sizeof *c->scratch);
    umb_memory_free(&a, c->objects, c->object_capacity * sizeof *c->objects);
    umb_memory_free(&a, c->inside, c->inside_capacity);
    umb_memory_free(&a, c->planes, c->plane_capacity);
    umb_memory_free(&a, c->rows, c->row_capacity * sizeof *c->rows);
    umb_memory_free(&a, c, sizeof *c);
}

/* What answers are written to. */
static bool reserve_answer(umb_culler *c, const umb_tree *tree)
{
    const umb_allocator *a = &c->allocator;
    size_t count = (size_t)tree->object_count + UMB_TREE_SPARE, sorted = c->def.unordered ? 0 : count;
    return umb_memory_reserve(a, (void **)&c->found, &c->found_capacity, c->ops != NULL ? count : sorted,
                              sizeof *c->found) &&
           umb_memory_reserve(a, (void **)&c->scratch, &c->scratch_capacity, sorted, sizeof *c->scratch) &&
           umb_memory_reserve(a, (void **)&c->objects, &c->object_capacity, count, sizeof *c->objects) &&
           umb_memory_reserve(a, (void **)&c->inside, &c->inside_capacity, count, 1);
}

/* Everything that a walk can need, so that it never allocates: each slot and node waits at most
 * once, a moving object once more, and occluders drawn early are gone before the walk begins. */
static bool reserve(umb_culler *c, const umb_view *view, const umb_tree *tree, const umb_committed *scene)
{
    const umb_allocator *a = &c->allocator;
    size_t planes = c->plane_capacity;
    uint32_t width, height;
    umb_raster_map_size(view, &width, &height);
    size_t waiting = (size_t)tree->item_count + tree->node_room + scene->motion.number_count;
    size_t early = scene->occluder_count;
    if (!umb_memory_reserve(a, (void **)&c->rows, &c->row_capacity, umb_raster_map_table(height),
                            sizeof *c->rows) ||
        (tree->several && !umb_once_begin(&c->once, a, scene)) ||
        (c->ops != NULL && !umb_culler_chooses(c) && !umb_heap_reserve(&c->heap, a, waiting > early ? waiting : early)) ||
        (umb_culler_chooses(c) && !umb_chosen_reserve(&c->chosen_room, a, tree)) ||
        (c->ops == NULL && !umb_in_view_reserve(&c->room, a, tree)) || !reserve_answer(c, tree) ||
        !umb_memory_reserve(a, (void **)&c->planes, &c->plane_capacity, umb_in_view_remembers(tree), 1)) {
        return false;
    }
    if (c->plane_capacity > planes) { /* an empty index has no planes at all */
        memset(c->planes + planes, 0, c->plane_capacity - planes);
    }
    return true;
}

static void prepare_projector(umb_projector *p, const umb_raster_map *map)
{
    const double eye[3] = {map->eye.x, map->eye.y, map->eye.z}, x[3] = {map->x.x, map->x.y, map->x.z};
    const double y[3] = {map->y.x, map->y.y, map->y.z}, w[3] = {map->w.x, map->w.y, map->w.z};
    const umb_projector_def def = {.eye = eye,
                                   .x = x,
                                   .y = y,
                                   .w = w,
                                   .cx = map->cx,
                                   .cy = map->cy,
                                   .slope = map->rows.slope,
                                   .extra = map->rows.extra,
                                   .from = map->rows.from,
                                   .span = map->rows.span,
                                   .slack = map->rows.slack,
                                   .width = map->width,
                                   .height = map->height,
                                   .vertical = map->vertical_axis,
                                   .orthographic = map->orthographic};
    umb_projector_prepare(p, &def);
}

static void prepare_walk(umb_walk *w, umb_culler *c, const umb_view *view)
{
    w->culler = c;
    w->view = view;
    w->once = w->tree->several ? &c->once : NULL;
    w->drawn = w->unlikely = w->turns = 0;
    w->plain = w->once == NULL && !(view->min_pixels > 0.0);
    w->stats = (umb_cull_stats){0};
    umb_frustum_prepare(&w->frustum, view);
    if (c->ops == NULL && c->def.unordered) {
        return; /* neither pixels nor depths are wanted */
    }
    umb_raster_map_prepare(&w->map, view, &w->tree->bounds, c->rows);
    prepare_projector(&w->projector, &w->map);
    w->most_w = w->map.most_w < FLT_MAX ? (float)w->map.most_w : INFINITY;
}

umb_result umb_culler_prepare(umb_culler *c)
{
    const umb_tree *tree = umb_index_tree(c->index);
    const umb_committed *scene = umb_scene_committed(umb_index_scene(c->index));
    umb_cull_stats stats;
    umb_choice choice = {.scene = scene, .tree = tree, .budget = c->def.occluder_budget, .coherence = c->def.coherence,
                         .stats = &stats};
    if (!umb_culler_chooses(c)) {
        return UMB_OK;
    }
    if (tree->version != scene->version) {
        return umb_error_set(c->def.error, UMB_ERROR_STATE, "the index found no memory at the last commit: commit again");
    }
    return c->ops->make_ahead(c->method, &choice) == UMB_OK
               ? UMB_OK
               : umb_error_set(c->def.error, UMB_ERROR_MEMORY, "no memory for what is made ahead of frames");
}

umb_result umb_cull(umb_culler *c, const umb_view *view, umb_visible_set *out)
{
    memset(out, 0, sizeof *out);
    c->answered = false;
    c->count = 0;
    umb_result result = umb_view_check(view, c->def.error);
    if (result != UMB_OK) {
        return result;
    }
    umb_walk w;
    w.tree = umb_index_tree(c->index);
    w.scene = umb_scene_committed(umb_index_scene(c->index));
    if (w.tree->version != w.scene->version) {
        return umb_error_set(c->def.error, UMB_ERROR_STATE,
                             "the index found no memory at the last commit: commit again");
    }
    w.scene = umb_movers_begin(&c->movers, &c->allocator, w.scene, view->time, c->ops != NULL);
    bool ready = w.scene != NULL && reserve(c, view, w.tree, w.scene);
    if (ready) {
        w.present = umb_filter_begin(&c->filter, view, w.scene, w.tree);
        prepare_walk(&w, c, view);
        ready = c->ops == NULL || (umb_culler_chooses(c) ? umb_answer_chosen(&w) : c->ops->prepare(c->method, &w.map, w.scene)) == UMB_OK;
        ready = ready && (!umb_past_on(&c->past) ||
                          umb_past_begin(&c->past, &c->allocator, w.tree, w.scene, &w.map));
    }
    if (!ready) {
        return umb_error_set(c->def.error, UMB_ERROR_MEMORY, "no memory for the frame");
    }
    if (c->ops != NULL && !umb_culler_chooses(c)) {
        umb_heap_clear(&c->heap);
        umb_best_first_run(&w);
        if (umb_past_on(&c->past)) {
            umb_past_end(&c->past);
        }
    } else if (c->ops == NULL) {
        umb_answer_in_view(&w);
    }
    umb_answer_finish(&w);
    c->view = *view;
    c->version = w.scene->version;
    c->commit = c->movers.commit;
    c->answered = true;
    out->objects = c->objects;
    out->inside = c->inside;
    out->count = c->count;
    out->class_ = view->min_pixels > 0.0 || w.scene->motion.fuzzy > 0 ? UMB_CLASS_APPROXIMATE
                  : c->ops != NULL       ? c->ops->class_
                                         : UMB_CLASS_STRICT;
    out->stats = w.stats;
    return UMB_OK;
}

umb_result umb_culler_set_candidates(umb_culler *c, const uint32_t *bits, uint32_t object_count)
{
    if (!umb_filter_restrict(&c->filter, &c->allocator, bits, object_count)) {
        return umb_error_set(c->def.error, UMB_ERROR_MEMORY, "no memory for candidates");
    }
    c->answered = false; /* what a capture would hold is not what was asked */
    return UMB_OK;
}

const umb_index *umb_culler_index(const umb_culler *culler)
{
    return culler->index;
}

const umb_coverage *umb_culler_coverage(const umb_culler *culler)
{
    return culler->ops != NULL && culler->ops->buffer != NULL && culler->answered ? culler->ops->buffer(culler->method) : NULL;
}

void *umb_culler_method_state(const umb_culler *culler)
{
    return culler->method;
}

const uint32_t *umb_culler_candidates(const umb_culler *culler, uint32_t *object_count)
{
    *object_count = culler->filter.candidate_count;
    return culler->filter.restricted ? culler->filter.candidates : NULL;
}

const umb_posed *umb_culler_posed(const umb_culler *culler, uint32_t *count)
{
    *count = culler->movers.posed_count;
    return culler->movers.posed;
}

umb_culler_def umb_culler_settings(const umb_culler *culler)
{
    return culler->def;
}

const umb_view *umb_culler_last_view(const umb_culler *culler, const uint32_t **ids, uint32_t *count)
{
    *ids = culler->objects;
    *count = culler->count;
    const umb_committed *scene = umb_scene_committed(umb_index_scene(culler->index));
    bool current = scene->version == culler->version &&
                   (scene->motion.count == 0 || culler->movers.commit == culler->commit);
    return culler->answered && current ? &culler->view : NULL;
}

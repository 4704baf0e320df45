/* The method "occlusion-tree": the chosen occluders' shadows, merged, and boxes filtered down the tree. A token is the
 * node that a box was asked down to: what lies in the box need not be asked from higher up. */
#include <string.h>

#include "base/memory.h"
#include "chooser.h"
#include "fronts.h"
#include "occlusion_tree.h"
#include "shape_hull.h"

/* Occluders that are chosen if nothing is said. */
#define OCCLUDERS 128
#define MOST (UMB_OCCLUSION_TREE_SHADOWS / (TRIES * FRONTS_EACH))
/* So many are looked at for each that covers something. */
#define TRIES 2
/* Of one occluder: fronts and edges, on average, when the near plane cuts none of many. What has no room is left out. */
#define FRONTS_EACH 2
#define EDGES_EACH 12

typedef struct method {
    umb_allocator allocator;
    const umb_box_kernels *kernels;
    umb_chooser chooser;
    umb_shadows shadows;
    umb_occlusion_tree tree;
    umb_front_room room;
    const umb_choice *choice;
} method;

static umb_result create(const umb_allocator *allocator, umb_isa isa, void **state)
{
    method *m = umb_memory_allocate_zero(allocator, 1, sizeof *m);
    if (m == NULL) {
        return UMB_ERROR_MEMORY;
    }
    m->allocator = *allocator;
    m->kernels = umb_box_kernels_get(isa);
    umb_chooser_create(&m->chooser, allocator);
    *state = m;
    return UMB_OK;
}

static void destroy(void *state)
{
    method *m = state;
    umb_allocator a = m->allocator;
    umb_chooser_free(&m->chooser);
    umb_shadows_free(&m->shadows, &a);
    umb_occlusion_tree_free(&m->tree, &a);
    umb_memory_free(&a, m, sizeof *m);
}

static bool reserve(method *m, uint32_t budget)
{
    uint32_t tries = TRIES * budget, fronts = FRONTS_EACH * tries + 16, edges = EDGES_EACH * tries + 64;
    return umb_shadows_reserve(&m->shadows, &m->allocator, fronts, edges, edges) &&
           umb_occlusion_tree_reserve(&m->tree, &m->allocator, 64 * budget + 64, 32 * budget + 32);
}

/* Into the tree at once: occluders that lie behind what is there say so by covering nothing, and do not count. */
static bool insert(method *m, const umb_pick *pick)
{
    uint32_t first = m->shadows.count, before = m->tree.planted, start = m->tree.root;
    umb_hull hull;
    if (umb_hull_of_box(&hull, &m->shadows.viewer, &pick->place->bounds) &&
        umb_occlusion_tree_ask(&m->tree, &hull, &start) == UMB_OCCLUSION_HIDDEN) {
        return false;
    }
    umb_fronts_add(&m->shadows, &m->room, pick);
    for (uint32_t i = first; i < m->shadows.count; ++i) {
        umb_occlusion_tree_insert(&m->tree, i);
    }
    return m->tree.planted != before;
}

static umb_result make_ahead(void *state, const umb_choice *choice)
{
    method *m = state;
    return umb_chooser_prepare(&m->chooser, choice, m->kernels, TRIES * umb_chooser_budget(choice, OCCLUDERS, MOST));
}

static umb_result choose(void *state, const umb_choice *choice)
{
    method *m = state;
    uint32_t budget = umb_chooser_budget(choice, OCCLUDERS, MOST), taken = 0;
    m->choice = choice;
    umb_pick pick;
    if (!reserve(m, budget) || umb_chooser_begin(&m->chooser, choice, m->kernels, TRIES * budget) != UMB_OK) {
        return UMB_ERROR_MEMORY;
    }
    umb_shadow_viewer_prepare(&m->shadows.viewer, choice->view, umb_select_reach(choice));
    umb_shadows_clear(&m->shadows);
    umb_occlusion_tree_begin(&m->tree, &m->shadows, true);
    for (uint32_t tries = 0; tries < TRIES * budget && taken < budget; ++tries) {
        if (!umb_chooser_next(&m->chooser, &pick)) {
            break;
        }
        taken += insert(m, &pick);
    }
    choice->stats->occluders += taken;
    choice->stats->edges += m->tree.node_count;
    return UMB_OK;
}

static uint32_t node_of(const method *m, uint32_t token)
{
    return token == UMB_TOKEN_ALL ? m->tree.root : token - 1;
}

static void ask(void *state, umb_query *query)
{
    const method *m = state;
    query->hidden = 0;
    for (uint32_t left = query->mask; left != 0; left &= left - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(left), start = node_of(m, query->token);
        umb_aabb box;
        umb_hull hull;
        for (int k = 0; k < 3; ++k) {
            box.min[k] = query->boxes->min[k][slot];
            box.max[k] = query->boxes->max[k][slot];
        }
        query->tokens[slot] = query->token;
        if (!umb_hull_of_box(&hull, &m->shadows.viewer, &box)) {
            continue;
        }
        if (umb_occlusion_tree_ask(&m->tree, &hull, &start) == UMB_OCCLUSION_HIDDEN) {
            query->hidden |= 1u << slot;
        }
        query->tokens[slot] = start == UMB_OCCLUSION_OPEN_CELL ? UMB_TOKEN_CLEAR : start + 1;
    }
}

typedef struct asker {
    const method *method;
    uint32_t start;
} asker;

static bool open_at(const void *data, const float p[3])
{
    const asker *a = data;
    return umb_occlusion_tree_open_at(&a->method->tree, p, a->start);
}

static bool hull_hidden(const void *data, umb_hull *hull)
{
    const asker *a = data;
    uint32_t start = a->start;
    return umb_occlusion_tree_ask(&a->method->tree, hull, &start) == UMB_OCCLUSION_HIDDEN;
}

static bool hides_object(void *state, uint32_t object, uint32_t token)
{
    method *m = state;
    asker a = {m, node_of(m, token)};
    umb_shape_question q = {.object = &m->choice->scene->objects[object],
                            .viewer = &m->shadows.viewer,
                            .hidden = hull_hidden,
                            .open_at = open_at,
                            .data = &a,
                            .queries = &m->choice->stats->queries};
    return umb_shape_hull_hidden(&q);
}

const umb_method_ops umb_occlusion_tree_method = {
    .name = "occlusion-tree",
    .class_ = UMB_CLASS_STRICT,
    .create = create,
    .destroy = destroy,
    .choose = choose,
    .make_ahead = make_ahead,
    .ask = ask,
    .hides_object = hides_object,
};

/* Hudson's shadow frusta (1997; Gummerus 5.4): of each chosen occluder the half-spaces through the eye and the edges of
 * its outline, and those beyond its own planes; what lies in all of them is hidden. The paper closes a frustum by
 * one plane through the farthest point of the outline; here it is the planes of the front themselves, which are nearer.
 *
 * Going down the index, each node's boxes are held, eight at a time, against the frusta that its own box meets; a frustum
 * that a box lies beside is not looked at below it. Objects that are their shape are held against them by their parts, boxes
 * under a transform, and single triangles. Occluders are those that look largest, then of these the ones that hold most
 * samples, and with UMB_COHERENCE_LIST first those that hid most in the last frame. */
#include "chooser.h"
#include "power.h"
#include "shape_hull.h"

#include <string.h>

#define CHOSEN 64
/* Candidates for each occluder that is chosen. */
#define CANDIDATES 2
/* Lists of the nodes that wait: as deep as trees are, eight boxes each. */
#define LEVELS 48
#define MOST_SPACES (UMB_BLOCKER_EDGES + 2 * UMB_BLOCKER_PLANES)
#define MOST 16384u

typedef struct frusta {
    umb_allocator allocator;
    const umb_planes_kernels *kernels;
    const umb_box_kernels *box_kernels;
    umb_chooser chooser;
    umb_blockers blockers; /* the candidates */
    umb_power power;
    umb_shadow_viewer viewer;
    const umb_choice *choice;
    uint64_t (*holds)[2]; /* per candidate */
    uint16_t *order;      /* the chosen ones */
    uint32_t chosen;
    uint32_t *hid;        /* per candidate: how many boxes it hid */
    uint32_t *score;      /* per occluder of the scene: how many it hid in the last frame */
    uint64_t structure;   /* of the scene that scores are for */
    uint16_t *arena;      /* lists of frusta: their number, then each */
    uint32_t top;
    size_t hold_capacity, order_capacity, hid_capacity, score_capacity, arena_capacity;
} frusta;

static umb_result create(const umb_allocator *allocator, umb_isa isa, void **state)
{
    frusta *f = umb_memory_allocate_zero(allocator, 1, sizeof *f);
    if (f == NULL) {
        return UMB_ERROR_MEMORY;
    }
    f->allocator = *allocator;
    f->kernels = umb_planes_kernels_get(isa);
    f->box_kernels = umb_box_kernels_get(isa);
    umb_chooser_create(&f->chooser, allocator);
    *state = f;
    return UMB_OK;
}

static void destroy(void *state)
{
    frusta *f = state;
    umb_allocator a = f->allocator;
    umb_chooser_free(&f->chooser);
    umb_blockers_free(&f->blockers, &a);
    umb_memory_free(&a, f->holds, f->hold_capacity * sizeof *f->holds);
    umb_memory_free(&a, f->order, f->order_capacity * sizeof *f->order);
    umb_memory_free(&a, f->hid, f->hid_capacity * sizeof *f->hid);
    umb_memory_free(&a, f->score, f->score_capacity * sizeof *f->score);
    umb_memory_free(&a, f->arena, f->arena_capacity * sizeof *f->arena);
    umb_memory_free(&a, f, sizeof *f);
}

static bool reserve(frusta *f, uint32_t budget, uint32_t candidates, uint32_t occluders)
{
    const umb_allocator *a = &f->allocator;
    size_t lists = (size_t)(budget + 1) * UMB_NODE_WIDTH * LEVELS;
    return umb_memory_reserve(a, (void **)&f->holds, &f->hold_capacity, candidates, sizeof *f->holds) &&
           umb_memory_reserve(a, (void **)&f->order, &f->order_capacity, candidates, sizeof *f->order) &&
           umb_memory_reserve(a, (void **)&f->hid, &f->hid_capacity, candidates, sizeof *f->hid) &&
           umb_memory_reserve(a, (void **)&f->score, &f->score_capacity, occluders, sizeof *f->score) &&
           umb_memory_reserve(a, (void **)&f->arena, &f->arena_capacity, lists, sizeof *f->arena);
}

/* ---- choosing ------------------------------------------------------------------------------------- */

/* What each occluder hid since the last choice. */
static void learn(frusta *f, const umb_committed *scene)
{
    bool same = f->structure == scene->structure;
    memset(f->score, 0, scene->occluder_count * sizeof *f->score);
    for (uint32_t i = 0; i < f->chosen && same; ++i) {
        uint32_t occluder = f->blockers.list[f->order[i]].occluder;
        f->score[occluder] += f->hid[f->order[i]];
    }
    for (uint32_t i = 0; i < f->chosen && same; ++i) {
        uint32_t occluder = f->blockers.list[f->order[i]].occluder;
        umb_select_feedback(&f->chooser.selector, occluder, f->score[occluder]);
    }
    f->structure = scene->structure;
    f->chosen = 0;
}

static void find_candidates(frusta *f, uint32_t most)
{
    umb_pick pick;
    while (f->blockers.count < most && umb_chooser_next(&f->chooser, &pick)) {
        umb_blocker_def def = {pick.place, pick.facets, pick.occluder, pick.set, pick.facet};
        (void)umb_blockers_add(&f->blockers, &def);
    }
    memset(f->hid, 0, f->blockers.count * sizeof *f->hid);
}

/* Those that hid something in the last frame first, the most first; else as they are. */
static void prefer_past(frusta *f)
{
    for (uint32_t i = 1; i < f->chosen; ++i) {
        uint16_t moved = f->order[i];
        uint32_t score = f->score[f->blockers.list[moved].occluder], at = i;
        for (; at > 0 && f->score[f->blockers.list[f->order[at - 1]].occluder] < score; --at) {
            f->order[at] = f->order[at - 1];
        }
        f->order[at] = moved;
    }
}

static umb_result make_ahead(void *state, const umb_choice *choice)
{
    frusta *f = state;
    return umb_chooser_prepare(&f->chooser, choice, f->box_kernels, CANDIDATES * umb_chooser_budget(choice, CHOSEN, MOST));
}

static umb_result choose(void *state, const umb_choice *choice)
{
    frusta *f = state;
    uint32_t budget = umb_chooser_budget(choice, CHOSEN, MOST), most = CANDIDATES * budget;
    f->choice = choice;
    if (!reserve(f, budget, most, choice->scene->occluder_count)) {
        return UMB_ERROR_MEMORY;
    }
    learn(f, choice->scene);
    umb_result result = umb_chooser_begin(&f->chooser, choice, f->box_kernels, most);
    if (result != UMB_OK || !umb_blockers_begin(&f->blockers, &f->allocator, &choice->viewer, most)) {
        return UMB_ERROR_MEMORY;
    }
    umb_shadow_viewer_prepare(&f->viewer, choice->view, umb_select_reach(choice));
    find_candidates(f, most);
    umb_power_sample(&f->power, choice, f->box_kernels, f->kernels, &f->blockers);
    bool past = (choice->coherence & UMB_COHERENCE_LIST) != 0;
    f->chosen = past || f->blockers.count < budget ? f->blockers.count : budget;
    umb_power_choose(&f->power, f->kernels, &f->blockers, f->holds, f->order, f->chosen);
    if (past) {
        prefer_past(f);
        f->chosen = f->chosen < budget ? f->chosen : budget;
    }
    f->arena[0] = (uint16_t)f->chosen;
    memcpy(f->arena + 1, f->order, f->chosen * sizeof *f->arena);
    f->top = f->chosen + 1;
    choice->stats->occluders += f->chosen;
    return UMB_OK;
}

/* ---- asking --------------------------------------------------------------------------------------- */

static uint32_t space_count(const umb_blocker *b)
{
    return (uint32_t)b->edge_count + b->plane_count + b->near_count;
}

/* A node's boxes and one frustum: those that lie in it, and those that lie beside it. */
typedef struct held {
    uint32_t in, beside;
} held;

static held hold(const frusta *f, const umb_near_boxes *boxes, uint32_t blocker, uint32_t mask)
{
    const umb_blocker *b = &f->blockers.list[blocker];
    umb_sides sides[MOST_SPACES];
    uint32_t count = space_count(b);
    uint32_t seen = f->kernels->sides(boxes, f->blockers.spaces + b->first_space, count, count, mask, sides);
    held h = {seen == count ? mask : 0, 0};
    for (uint32_t i = 0; i < seen; ++i) {
        h.in &= sides[i].in;
        h.beside |= sides[i].out;
    }
    return h;
}

static void ask(void *state, umb_query *query)
{
    frusta *f = state;
    umb_near_boxes boxes;
    uint16_t *list = f->arena + query->token;
    uint32_t left = query->mask, met[UMB_NODE_WIDTH] = {0};
    f->top = query->token + list[0] + 1u;
    f->kernels->place(query->boxes, f->blockers.origin_high, f->blockers.origin_low, &boxes);
    uint32_t room = list[0] + 1u, base = f->top;
    bool fits = base + (size_t)room * UMB_NODE_WIDTH <= f->arena_capacity;
    for (uint32_t i = 0; i < list[0] && left != 0; ++i) {
        uint16_t blocker = list[1 + i];
        held h = hold(f, &boxes, blocker, left);
        f->choice->stats->tests += 1;
        f->hid[blocker] += (uint32_t)__builtin_popcount(h.in);
        left &= ~h.in;
        for (uint32_t meets = fits ? left & ~h.beside : 0; meets != 0; meets &= meets - 1) {
            uint32_t slot = (uint32_t)__builtin_ctz(meets);
            f->arena[base + slot * room + 1 + met[slot]++] = blocker;
        }
    }
    query->hidden = query->mask & ~left;
    for (; left != 0; left &= left - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(left), from = base + slot * room;
        if (!fits) {
            query->tokens[slot] = query->token;
            continue;
        }
        f->arena[from] = (uint16_t)met[slot];
        query->tokens[slot] = met[slot] == 0 ? UMB_TOKEN_CLEAR : f->top;
        memmove(f->arena + f->top, f->arena + from, (met[slot] + 1) * sizeof *f->arena);
        f->top += met[slot] + 1;
    }
}

/* ---- parts and triangles ---------------------------------------------------------------------------- */

/* In doubles a half-space is off by less than in floats. */
static bool space_holds(const frusta *f, const umb_half_space *s, const umb_hull *hull)
{
    for (uint32_t i = 0; i < hull->point_count; ++i) {
        double sum = 0.0, reach = 0.0;
        for (int k = 0; k < 3; ++k) {
            double d = hull->points[i][k] - f->blockers.origin[k];
            sum += (double)s->n[k] * d;
            reach += fabs(d);
        }
        if (!(sum - (double)s->at > (double)s->slack * reach + (double)s->room)) {
            return false;
        }
    }
    return true;
}

static bool frustum_holds(const frusta *f, const umb_blocker *b, const umb_hull *hull)
{
    for (uint32_t i = 0; i < space_count(b); ++i) {
        if (!space_holds(f, &f->blockers.spaces[b->first_space + i], hull)) {
            return false;
        }
    }
    return true;
}

typedef struct asker {
    frusta *frusta;
    const uint16_t *list;
} asker;

static bool hull_hidden(const void *data, umb_hull *hull)
{
    const asker *a = data;
    frusta *f = a->frusta;
    for (uint32_t i = 0; i < a->list[0]; ++i) {
        if (frustum_holds(f, &f->blockers.list[a->list[1 + i]], hull)) {
            f->hid[a->list[1 + i]] += 1;
            return true;
        }
    }
    return false;
}

static bool hides_object(void *state, uint32_t object, uint32_t token)
{
    frusta *f = state;
    asker a = {f, f->arena + token};
    umb_shape_question q = {.object = &f->choice->scene->objects[object],
                            .viewer = &f->viewer,
                            .points_only = true,
                            .hidden = hull_hidden,
                            .data = &a,
                            .queries = &f->choice->stats->queries};
    return umb_shape_hull_hidden(&q);
}

const umb_method_ops umb_shadow_frusta_method = {
    .name = "shadow-frusta",
    .class_ = UMB_CLASS_STRICT,
    .create = create,
    .destroy = destroy,
    .choose = choose,
    .make_ahead = make_ahead,
    .ask = ask,
    .hides_object = hides_object,
};

/* Coorg and Teller: large occluders, exact planes (1997; Gummerus 5.4).
 *
 * The occluders of a frame are chosen first, those that look largest. Going down the index, a node's boxes are held
 * against the occluders that the node's own box left: one that a box lies wholly beside is not asked about below it,
 * and a box that is left with none is clear. A box is hidden by one occluder, or by several that share edges.
 *
 * Which side of which plane a box is on is decided in floats where these can tell, else in doubles; where doubles
 * cannot, the box counts as crossing it. docs/conservative.md, 14. */
#include "planes.h"

#include <string.h>

#include "near_blockers.h"
#include "planes_cache.h"

#define CHOSEN 64
#define MOST 65000u
/* Lists of the nodes that wait: as deep as trees are, eight boxes each. */
#define LEVELS 48
/* Occluders that hide a box together. */
#define MOST_TOGETHER 32
/* Occluders near an object that it is held against. */
#define NEAR 6

/* A blocker as a node's boxes see it, a bit for each. */
typedef struct seen {
    uint16_t blocker;
    uint8_t alive;  /* hides a part of the box, as far as one can see */
    uint8_t behind; /* all of the box is beyond its surface, on sight-lines that meet it beyond near */
    uint8_t full;   /* and on the inner side of each edge */
    bool closely;   /* behind and in are known of boxes that are not alive, too */
    uint8_t in[UMB_BLOCKER_EDGES];
} seen;

typedef struct planes {
    umb_allocator allocator;
    const umb_planes_kernels *kernels;
    const umb_box_kernels *box_kernels;
    umb_chooser chooser;
    umb_blockers blockers;
    umb_near_blockers near;
    bool looks_near; /* objects are held against what is near them, too */
    const umb_choice *choice;
    uint16_t *arena; /* lists of blockers: their number, then each */
    uint32_t *hidden; /* per blocker: boxes that it hid, alone or with others */
    uint16_t *seen_of; /* per blocker: its place in seen, if that one is it */
    seen *seen;
    uint32_t seen_count;
    size_t arena_capacity, hidden_capacity, seen_of_capacity, seen_capacity;
    uint32_t arena_top;
    umb_planes_way way, wanted_way;
    umb_planes_cache cache;
    float eye[4]; /* for tangent planes */
} planes;

static umb_result create(const umb_allocator *allocator, umb_isa isa, void **state)
{
    planes *p = umb_memory_allocate_zero(allocator, 1, sizeof *p);
    if (p == NULL) {
        return UMB_ERROR_MEMORY;
    }
    p->allocator = *allocator;
    p->kernels = umb_planes_kernels_get(isa);
    p->box_kernels = umb_box_kernels_get(isa);
    umb_chooser_create(&p->chooser, allocator);
    *state = p;
    return UMB_OK;
}

static void destroy(void *state)
{
    planes *p = state;
    umb_allocator a = p->allocator;
    umb_chooser_free(&p->chooser);
    umb_blockers_free(&p->blockers, &a);
    umb_near_blockers_free(&p->near, &a);
    umb_planes_cache_free(&p->cache, &a);
    umb_memory_free(&a, p->arena, p->arena_capacity * sizeof *p->arena);
    umb_memory_free(&a, p->hidden, p->hidden_capacity * sizeof *p->hidden);
    umb_memory_free(&a, p->seen_of, p->seen_of_capacity * sizeof *p->seen_of);
    umb_memory_free(&a, p->seen, p->seen_capacity * sizeof *p->seen);
    umb_memory_free(&a, p, sizeof *p);
}

static bool reserve(planes *p, uint32_t wanted)
{
    const umb_allocator *a = &p->allocator;
    size_t lists = (size_t)(wanted + 1) * UMB_NODE_WIDTH * LEVELS;
    return umb_memory_reserve(a, (void **)&p->arena, &p->arena_capacity, lists, sizeof *p->arena) &&
           umb_memory_reserve(a, (void **)&p->hidden, &p->hidden_capacity, wanted, sizeof *p->hidden) &&
           umb_memory_reserve(a, (void **)&p->seen_of, &p->seen_of_capacity, wanted, sizeof *p->seen_of) &&
           umb_memory_reserve(a, (void **)&p->seen, &p->seen_capacity, wanted, sizeof *p->seen);
}

/* Feedback of the last frame. */
static void tell_selector(planes *p)
{
    for (uint32_t i = 0; i < p->near.chosen; ++i) {
        umb_select_feedback(&p->chooser.selector, p->blockers.list[i].occluder, p->hidden[i]);
    }
}

/* How this frame compares boxes and edges. A cell's planes are only found directly. */
static bool choose_way(planes *p, const umb_choice *choice)
{
    const umb_viewer *v = &choice->viewer;
    bool keeps = (choice->coherence & UMB_COHERENCE_PLANES) != 0;
    p->way = p->wanted_way != UMB_PLANES_DEFAULT ? p->wanted_way : keeps ? UMB_PLANES_CACHED : UMB_PLANES_DIRECT;
    p->way = v->point_count == 1 ? p->way : UMB_PLANES_DIRECT;
    for (int i = 0; i < 3; ++i) {
        p->eye[i] = (float)(v->parallel ? -v->points[0][i] : v->points[0][i]);
    }
    p->eye[3] = v->parallel ? 0.0f : 1.0f;
    return p->way == UMB_PLANES_DIRECT ||
           umb_planes_cache_begin(&p->cache, &p->allocator, choice->scene, p->way == UMB_PLANES_CACHED);
}

void umb_planes_go(void *state, umb_planes_way way)
{
    ((planes *)state)->wanted_way = way;
}

void umb_planes_count(const void *state, uint64_t *kept, uint64_t *made)
{
    const planes *p = state;
    *kept = p->cache.kept;
    *made = p->cache.made;
}

static umb_result make_ahead(void *state, const umb_choice *choice)
{
    planes *p = state;
    return umb_chooser_prepare(&p->chooser, choice, p->box_kernels, umb_chooser_budget(choice, CHOSEN, MOST));
}

static umb_result choose(void *state, const umb_choice *choice)
{
    planes *p = state;
    uint32_t wanted = umb_chooser_budget(choice, CHOSEN, MOST);
    if ((choice->coherence & UMB_COHERENCE_REST) != 0 && p->chooser.selector.rest_structure == choice->scene->structure) {
        tell_selector(p);
    }
    p->choice = choice;
    p->blockers.count = p->near.chosen = 0;
    p->looks_near = (choice->coherence & UMB_COHERENCE_LEAVES) != 0 && choice->viewer.point_count == 1 && !choice->viewer.parallel;
    if (!choose_way(p, choice) || !reserve(p, wanted) || !umb_blockers_begin(&p->blockers, &p->allocator, &choice->viewer, wanted + UMB_NEAR_BLOCKERS_MOST)) {
        return UMB_ERROR_MEMORY;
    }
    umb_result result = umb_chooser_begin(&p->chooser, choice, p->box_kernels, wanted);
    umb_pick pick;
    while (result == UMB_OK && p->blockers.count < wanted && umb_chooser_next(&p->chooser, &pick)) {
        umb_blockers_add(&p->blockers, &(umb_blocker_def){.place = pick.place,
                                                          .facets = pick.facets,
                                                          .occluder = pick.occluder,
                                                          .set = pick.set,
                                                          .facet = pick.facet});
    }
    if (result != UMB_OK || umb_chooser_failed(&p->chooser) || !umb_near_blockers_begin(&p->near, &p->allocator, &p->blockers)) {
        return UMB_ERROR_MEMORY;
    }
    umb_blockers_join(&p->blockers);
    p->arena[0] = (uint16_t)p->blockers.count;
    for (uint32_t i = 0; i < p->blockers.count; ++i) {
        p->arena[1 + i] = (uint16_t)i;
        p->hidden[i] = 0;
        p->seen_of[i] = 0;
    }
    choice->stats->occluders = p->blockers.count;
    return UMB_OK;
}

static umb_aabb box_of(const umb_node *node, uint32_t slot)
{
    umb_aabb box;
    for (int i = 0; i < 3; ++i) {
        box.min[i] = node->min[i][slot];
        box.max[i] = node->max[i][slot];
    }
    return box;
}

/* What floats left open, by doubles. */
static void decide_edge(const planes *p, const umb_node *boxes, const umb_blocker_edge *edge, uint32_t mask,
                        umb_sides *s)
{
    uint32_t unsure = mask & (~(uint32_t)(s->in | s->open) | ~(uint32_t)(s->out | s->part));
    for (; unsure != 0; unsure &= unsure - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(unsure);
        uint8_t bit = (uint8_t)(1u << slot);
        umb_aabb box = box_of(boxes, slot);
        int side = umb_blockers_edge_side(&p->blockers, edge, &box);
        s->in = (uint8_t)(side > 0 ? s->in | bit : s->in & ~bit);
        s->out = (uint8_t)(side < 0 ? s->out | bit : s->out & ~bit);
    }
}

/* The edges of a blocker: fills in in[] and returns the boxes that are out of one. A cell's edges have a half-space
 * for each of its points: in when in all, out when out of all. */
static uint32_t see_edges(const planes *p, const umb_node *boxes, const umb_blocker *k, umb_sides *sides, uint32_t mask,
                          seen *out)
{
    uint32_t points = p->blockers.viewer.point_count, gone = 0;
    for (uint32_t e = 0; e < k->edge_count; ++e) {
        umb_sides s = sides[e * points];
        for (uint32_t i = 1; i < points; ++i) {
            const umb_sides *t = &sides[e * points + i];
            s.in &= t->in;
            s.out &= t->out;
            s.open |= t->open;
            s.part |= t->part;
        }
        decide_edge(p, boxes, &p->blockers.edges[k->first_edge + e], mask & ~gone, &s);
        out->in[e] = s.in;
        gone |= s.out;
    }
    return gone & mask;
}

static uint32_t see_planes(const planes *p, const umb_node *boxes, const umb_blocker *k, const umb_sides *sides,
                           uint32_t mask, uint32_t *front)
{
    uint32_t behind = mask;
    for (uint32_t i = 0; i < k->plane_count; ++i) {
        umb_sides s = sides[i];
        for (uint32_t unsure = behind & ~(uint32_t)(s.in | s.open); unsure != 0; unsure &= unsure - 1) {
            uint32_t slot = (uint32_t)__builtin_ctz(unsure);
            umb_aabb box = box_of(boxes, slot);
            bool is = umb_blockers_behind(&p->blockers, &p->blockers.planes[k->first_plane + i], &box);
            s.in |= (uint8_t)((is ? 1u : 0u) << slot);
        }
        behind &= s.in;
        *front |= s.out;
    }
    for (uint32_t i = 0; i < k->near_count; ++i) {
        behind &= sides[k->plane_count + i].in;
    }
    return behind;
}

/* The same by tangent planes, of boxes beyond the surface: they have them. */
static uint32_t see_tangents(planes *p, const umb_query *q, const umb_blocker *k, uint32_t behind, seen *out)
{
    uint32_t gone = 0;
    for (uint32_t e = 0; e < k->edge_count; ++e) {
        const umb_blocker_edge *edge = &p->blockers.edges[k->first_edge + e];
        uint32_t asked = behind & ~gone;
        umb_sides s = {0, 0, 0, 0};
        if (asked != 0) {
            s = p->kernels->tangent_sides(umb_planes_cache_get(&p->cache, q->node, q->boxes, edge, asked), p->eye);
            decide_edge(p, q->boxes, edge, asked, &s);
        }
        out->in[e] = s.in;
        gone |= s.out & asked;
    }
    return gone;
}

static bool look_by_tangents(planes *p, const umb_query *q, const umb_near_boxes *boxes, uint32_t blocker, seen *out)
{
    const umb_blocker *k = &p->blockers.list[blocker];
    umb_sides sides[2 * UMB_BLOCKER_PLANES];
    uint32_t count = k->plane_count + k->near_count, front = 0;
    p->kernels->sides(boxes, &p->blockers.spaces[k->first_space + k->edge_count], count, 0, q->mask, sides);
    uint32_t behind = see_planes(p, q->boxes, k, sides, q->mask, &front) & ~front;
    uint32_t gone = see_tangents(p, q, k, behind, out), full = behind & ~gone;
    for (uint32_t e = 0; e < k->edge_count; ++e) {
        full &= out->in[e];
    }
    out->blocker = (uint16_t)blocker;
    out->alive = (uint8_t)(q->mask & ~gone & ~front);
    out->behind = (uint8_t)(behind & ~gone);
    out->full = (uint8_t)full;
    out->closely = false;
    return out->alive != 0;
}

/* False if the blocker hides nothing of any box. */
static bool look(const planes *p, const umb_query *q, const umb_near_boxes *boxes, uint32_t blocker, seen *out)
{
    const umb_blocker *k = &p->blockers.list[blocker];
    uint32_t edge_spaces = k->edge_count * p->blockers.viewer.point_count;
    uint32_t count = edge_spaces + k->plane_count + k->near_count;
    uint32_t may_stop = p->blockers.viewer.point_count == 1 ? edge_spaces : 0;
    umb_sides sides[UMB_BLOCKER_EDGES * 8 + 2 * UMB_BLOCKER_PLANES];
    if (p->kernels->sides(boxes, &p->blockers.spaces[k->first_space], count, may_stop, q->mask, sides) < count) {
        return false;
    }
    uint32_t front = 0;
    uint32_t gone = see_edges(p, q->boxes, k, sides, q->mask, out);
    uint32_t behind = see_planes(p, q->boxes, k, sides + edge_spaces, q->mask & ~gone, &front);
    uint32_t full = behind;
    for (uint32_t e = 0; e < k->edge_count; ++e) {
        full &= out->in[e];
    }
    out->blocker = (uint16_t)blocker;
    out->alive = (uint8_t)(q->mask & ~gone & ~front);
    out->behind = (uint8_t)(behind & out->alive);
    out->full = (uint8_t)(full & out->alive);
    out->closely = false;
    return out->alive != 0;
}

/* Of a blocker that hides nothing of some box by itself, but has an edge in common with one that does. */
static void look_closely(const planes *p, const umb_query *q, const umb_near_boxes *boxes, uint32_t blocker, seen *out)
{
    const umb_blocker *k = &p->blockers.list[blocker];
    uint32_t edge_spaces = k->edge_count * p->blockers.viewer.point_count, front = 0;
    umb_sides sides[UMB_BLOCKER_EDGES * 8 + 2 * UMB_BLOCKER_PLANES];
    p->kernels->sides(boxes, &p->blockers.spaces[k->first_space], edge_spaces + k->plane_count + k->near_count, 0, q->mask,
                      sides);
    (void)see_edges(p, q->boxes, k, sides, q->mask, out);
    out->behind = (uint8_t)see_planes(p, q->boxes, k, sides + edge_spaces, q->mask, &front);
    out->blocker = (uint16_t)blocker;
    out->closely = true;
}

/* Where a blocker is in seen[], with what is known of it and a box. */
static uint32_t find_seen(planes *p, const umb_query *q, const umb_near_boxes *boxes, uint32_t blocker, uint32_t slot)
{
    uint32_t at = p->seen_of[blocker];
    if (at >= p->seen_count || p->seen[at].blocker != blocker) {
        at = p->seen_of[blocker] = (uint16_t)p->seen_count++;
        p->seen[at] = (seen){.blocker = (uint16_t)blocker};
    }
    seen *s = &p->seen[at];
    if (!s->closely && (s->alive >> slot & 1u) == 0) {
        look_closely(p, q, boxes, blocker, s);
    }
    return at;
}

/* The blockers that are joined over the edges which a box crosses, from one of them on: hidden when no edge is left
 * that it crosses. */
static bool hidden_together(planes *p, const umb_query *q, const umb_near_boxes *boxes, uint32_t start, uint32_t slot)
{
    uint16_t todo[MOST_TOGETHER];
    uint32_t count = 0, bit = 1u << slot;
    todo[count++] = (uint16_t)start;
    for (uint32_t i = 0; i < count; ++i) {
        const umb_blocker *k = &p->blockers.list[p->seen[todo[i]].blocker];
        if ((p->seen[todo[i]].behind & bit) == 0) {
            return false;
        }
        for (uint32_t e = 0; e < k->edge_count; ++e) {
            uint32_t beyond = p->blockers.edges[k->first_edge + e].beyond, j = 0;
            if ((p->seen[todo[i]].in[e] & bit) != 0) {
                continue;
            }
            if (beyond == UMB_NONE) {
                return false;
            }
            uint32_t at = find_seen(p, q, boxes, beyond, slot);
            while (j < count && todo[j] != at) {
                ++j;
            }
            if (j == count && count == MOST_TOGETHER) {
                return false;
            }
            todo[j] = (uint16_t)at;
            count += j == count;
        }
    }
    for (uint32_t i = 0; i < count; ++i) {
        p->hidden[p->seen[todo[i]].blocker] += 1;
    }
    return true;
}

static uint32_t find_together(planes *p, const umb_query *q, const umb_near_boxes *boxes, uint32_t mask)
{
    uint32_t hidden = 0, count = p->seen_count;
    for (uint32_t i = 0; i < count; ++i) {
        if (!p->blockers.list[p->seen[i].blocker].joined) {
            continue;
        }
        uint32_t left = p->seen[i].behind & p->seen[i].alive & mask & ~hidden;
        for (; left != 0; left &= left - 1) {
            uint32_t slot = (uint32_t)__builtin_ctz(left);
            hidden |= hidden_together(p, q, boxes, i, slot) ? 1u << slot : 0;
        }
    }
    return hidden;
}

/* The list for a box: the blockers that hide a part of it. */
static uint32_t hand_down(planes *p, uint32_t slot, uint32_t parent)
{
    uint32_t count = 0, at = p->arena_top;
    if (at + 1 + p->seen_count > p->arena_capacity) {
        return parent;
    }
    for (uint32_t i = 0; i < p->seen_count; ++i) {
        if ((p->seen[i].alive >> slot & 1u) != 0) {
            p->arena[at + 1 + count++] = p->seen[i].blocker;
        }
    }
    if (count == 0 && !p->looks_near) {
        return UMB_TOKEN_CLEAR;
    }
    p->arena[at] = (uint16_t)count;
    p->arena_top = at + 1 + count;
    return at;
}

static void ask(void *state, umb_query *q)
{
    planes *p = state;
    const uint16_t *list = p->arena + q->token;
    uint32_t hidden = 0;
    umb_near_boxes boxes;
    if (list[0] == 0) {
        q->hidden = 0;
        for (uint32_t left = q->mask; left != 0; left &= left - 1) {
            q->tokens[__builtin_ctz(left)] = p->looks_near ? q->token : UMB_TOKEN_CLEAR;
        }
        return;
    }
    p->kernels->place(q->boxes, p->blockers.origin_high, p->blockers.origin_low, &boxes);
    p->seen_count = 0;
    p->choice->stats->tests += list[0];
    for (uint32_t i = 0; i < list[0] && (q->mask & ~hidden) != 0; ++i) {
        seen *s = &p->seen[p->seen_count];
        bool part = p->way == UMB_PLANES_DIRECT ? look(p, q, &boxes, list[1 + i], s)
                                                : look_by_tangents(p, q, &boxes, list[1 + i], s);
        if (!part) {
            continue;
        }
        p->seen_of[s->blocker] = (uint16_t)p->seen_count++;
        p->hidden[s->blocker] += (uint32_t)__builtin_popcount(s->full & ~hidden);
        hidden |= s->full;
    }
    hidden |= find_together(p, q, &boxes, q->mask & ~hidden);
    q->hidden = hidden;
    p->arena_top = q->token + 1 + list[0];
    for (uint32_t left = q->mask & ~hidden; left != 0; left &= left - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(left);
        q->tokens[slot] = hand_down(p, slot, q->token);
    }
}

/* One box, eight times. */
static umb_node node_of(const umb_aabb *box)
{
    umb_node node = {.count = 1};
    for (int axis = 0; axis < 3; ++axis) {
        for (uint32_t slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
            node.min[axis][slot] = box->min[axis];
            node.max[axis][slot] = box->max[axis];
        }
    }
    return node;
}

/* What is left is held against what looks large from where it stands, towards the viewer. */
static bool hides_object(void *state, uint32_t object, uint32_t token)
{
    planes *p = state;
    const umb_object *o = &p->choice->scene->objects[object];
    double middle[3];
    uint32_t count = 0, tried = 0;
    (void)token;
    for (int k = 0; k < 3; ++k) {
        middle[k] = 0.5 * ((double)o->bounds.min[k] + o->bounds.max[k]);
    }
    const umb_leaf_entry *list = p->looks_near ? umb_chooser_near(&p->chooser, middle, &count) : NULL;
    if (count == 0) {
        return false;
    }
    umb_node node = node_of(&o->bounds);
    umb_query q = {.boxes = &node, .mask = 1};
    umb_near_boxes boxes;
    p->kernels->place(&node, p->blockers.origin_high, p->blockers.origin_low, &boxes);
    for (uint32_t i = 0; i < count && tried < NEAR; ++i) {
        seen s;
        if (list[i].occluder == o->occluder || !umb_chooser_takes(&p->chooser, list[i].occluder)) {
            continue;
        }
        uint32_t blocker = umb_near_blockers_get(&p->near, &p->blockers, &p->chooser, &list[i]);
        tried += 1;
        p->choice->stats->tests += blocker != UMB_NONE;
        if (blocker != UMB_NONE && look(p, &q, &boxes, blocker, &s) && (s.full & 1u) != 0) {
            return true;
        }
    }
    return false;
}

const umb_method_ops umb_planes_method = {
    .name = "planes",
    .class_ = UMB_CLASS_STRICT,
    .create = create,
    .destroy = destroy,
    .choose = choose,
    .make_ahead = make_ahead,
    .ask = ask,
    .hides_object = hides_object,
};

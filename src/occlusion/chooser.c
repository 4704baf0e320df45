#include "chooser.h"

#include <string.h>

#include "base/sort.h"

void umb_chooser_create(umb_chooser *c, const umb_allocator *a)
{
    memset(c, 0, sizeof *c);
    umb_selector_create(&c->selector, a);
    umb_leaf_lists_create(&c->lists, a);
}

void umb_chooser_free(umb_chooser *c)
{
    umb_selector_free(&c->selector);
    umb_leaf_lists_free(&c->lists);
}

static uint32_t length_for(uint32_t wanted)
{
    uint32_t length = wanted < UMB_CHOOSER_MOST / 3 ? 3 * wanted : UMB_CHOOSER_MOST;
    return length < UMB_CHOOSER_LEAST ? UMB_CHOOSER_LEAST : length;
}

static bool has_lists(const umb_choice *choice)
{
    return (choice->coherence & UMB_COHERENCE_LEAVES) != 0;
}

/* From one more point of the viewer's leaf, or else of one that was asked for. */
static bool look_about(umb_chooser *c, uint32_t leaf)
{
    umb_leaf_lists *l = &c->lists;
    bool done = leaf == UMB_NONE || l->leaves[leaf].points == UMB_LEAF_POINTS;
    uint32_t number = !done ? leaf : l->wanted;
    if (done) {
        l->wanted = UMB_NONE;
    }
    return number == UMB_NONE || umb_leaf_lists_look(l, number, &c->selector, c->choice, c->kernels);
}

/* Which of eight entries from one on are in the frustum. */
static uint32_t find_in(const umb_chooser *c, const umb_leaf_entry *list, uint32_t count)
{
    const umb_choice *choice = c->choice;
    umb_node boxes;
    uint16_t left[UMB_NODE_WIDTH];
    boxes.count = count < UMB_NODE_WIDTH ? count : UMB_NODE_WIDTH;
    for (uint32_t slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
        const umb_aabb *box = &choice->scene->occluders[list[slot < boxes.count ? slot : 0].occluder].bounds;
        for (int axis = 0; axis < 3; ++axis) {
            boxes.min[axis][slot] = box->min[axis];
            boxes.max[axis][slot] = box->max[axis];
        }
    }
    uint32_t out = umb_frustum_test_node(choice->frustum, c->kernels, &boxes, choice->frustum->all_planes, NULL, left);
    return ~out & ((1u << boxes.count) - 1u);
}

bool umb_chooser_takes(const umb_chooser *c, uint32_t occluder)
{
    const umb_committed *scene = c->choice->scene;
    return !scene->occluders[occluder].moves && umb_mask_takes(c->choice->mask, scene->occluder_masks[occluder]);
}

static bool is_wanted(umb_chooser *c, uint32_t occluder)
{
    if (!umb_chooser_takes(c, occluder)) {
        return false;
    }
    bool rests = (c->choice->coherence & UMB_COHERENCE_REST) != 0 && umb_select_rests(&c->selector, occluder);
    c->choice->stats->resting += rests;
    return !rests;
}

umb_pick umb_chooser_pick(const umb_chooser *c, const umb_leaf_entry *e)
{
    return umb_select_pick(&c->selector, c->choice->scene, e->occluder, e->facet, e->score);
}

/* What of the list is in view, by how large it looks from the eye. */
static void rank(umb_chooser *c, uint32_t count)
{
    c->count = c->at = 0;
    umb_select_look_from(&c->selector, c->choice);
    for (uint32_t first = 0; first < count; first += UMB_NODE_WIDTH) {
        for (uint32_t in = find_in(c, c->list + first, count - first); in != 0; in &= in - 1) {
            const umb_leaf_entry *e = &c->list[first + (uint32_t)__builtin_ctz(in)];
            umb_pick pick = umb_chooser_pick(c, e);
            float score = is_wanted(c, e->occluder) ? umb_select_score(&c->selector, &pick) : 0.0f;
            uint32_t bits;
            memcpy(&bits, &score, sizeof bits);
            if (score > 0.0f) {
                c->order[c->count++] = (uint64_t)~bits << 32 | (uint32_t)(e - c->list);
            }
        }
    }
    c->sorted = umb_sort_words(c->order, c->room, c->count);
}

/* The viewer's list, if there is one: none outside of the scene, along a direction, and from a cell. False without memory. */
static bool open_list(umb_chooser *c, uint32_t wanted)
{
    const umb_viewer *v = &c->choice->viewer;
    if (!umb_leaf_lists_follow(&c->lists, &c->selector, c->choice, length_for(wanted))) {
        return false;
    }
    uint32_t leaf = v->point_count == 1 && !v->parallel ? umb_leaf_lists_at(&c->lists, v->points[0]) : UMB_NONE;
    if (!look_about(c, leaf)) {
        return false;
    }
    if (leaf != UMB_NONE) {
        uint32_t count;
        c->list = umb_leaf_lists_get(&c->lists, leaf, UMB_LEAF_FRONT, c->choice->viewer.forward, &count);
        rank(c, count);
    }
    return true;
}

umb_result umb_chooser_begin(umb_chooser *c, const umb_choice *choice, const umb_box_kernels *kernels, uint32_t wanted)
{
    c->choice = choice;
    c->kernels = kernels;
    c->list = NULL;
    c->count = c->at = 0;
    if (!umb_select_follow(&c->selector, choice) || (has_lists(choice) && !open_list(c, wanted))) {
        return UMB_ERROR_MEMORY;
    }
    return c->list != NULL ? UMB_OK : umb_select_begin(&c->selector, choice, kernels);
}

bool umb_chooser_next(umb_chooser *c, umb_pick *out)
{
    if (c->list == NULL) {
        return umb_select_next(&c->selector, out);
    }
    if (c->at == c->count) {
        return false;
    }
    *out = umb_chooser_pick(c, &c->list[(uint32_t)c->sorted[c->at++]]);
    return true;
}

umb_result umb_chooser_prepare(umb_chooser *c, const umb_choice *choice, const umb_box_kernels *kernels, uint32_t wanted)
{
    if (!umb_select_follow(&c->selector, choice)) {
        return UMB_ERROR_MEMORY;
    }
    if (!has_lists(choice)) {
        return UMB_OK;
    }
    bool ok = umb_leaf_lists_follow(&c->lists, &c->selector, choice, length_for(wanted));
    for (uint32_t leaf = 0; ok && leaf < 1u << c->lists.depth; ++leaf) {
        for (uint32_t i = 0; ok && i < UMB_LEAF_POINTS; ++i) {
            ok = umb_leaf_lists_look(&c->lists, leaf, &c->selector, choice, kernels);
        }
    }
    return ok ? UMB_OK : UMB_ERROR_MEMORY;
}

const umb_leaf_entry *umb_chooser_near(umb_chooser *c, const double place[3], uint32_t *count)
{
    const double *eye = c->choice->viewer.points[0];
    const double towards[3] = {eye[0] - place[0], eye[1] - place[1], eye[2] - place[2]};
    uint32_t leaf = umb_leaf_lists_at(&c->lists, place);
    *count = 0;
    if (leaf == UMB_NONE) {
        return NULL;
    }
    if (c->lists.leaves[leaf].points == 0 && c->lists.wanted == UMB_NONE) {
        c->lists.wanted = leaf;
    }
    return umb_leaf_lists_get(&c->lists, leaf, UMB_LEAF_BACK, towards, count);
}

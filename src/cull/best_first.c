/* The pipeline, frustum, occlusion, contribution (Gummerus 2), over a best-first walk of the index:
 *
 *     push the root
 *     pop the nearest waiting entry; hidden by what was drawn since it was tested: drop it
 *       node:     eight boxes at once against the frustum, then the raster; push what is left
 *       occluder: draw it
 *       object:   test the parts of its shape; draw the occluder that it owns; put it by until what may be
 *                 seen of it is settled
 *     now and then: those that were put by until then are asked about once more, and reported
 *
 * Best-first, not depth-first: an occluder that can hide the nearest point of a box has the smaller
 * key, so it is already in the buffer when the box's turn comes; and when an object is settled, all
 * that can hide any of it are. Methods that choose their occluders first have a walk without a queue
 * (chosen.h), and so has frustum culling alone (in_view.h).
 */
#include "best_first.h"

#include <float.h>
#include <string.h>

#include "contribution.h"
#include "detail.h"
#include "found.h"
#include "occlusion/image.h"
#include "volumes.h"

/* Images of boxes whose shorter side, in pixels beyond the first, is less than this cover nothing worth having: a
 * silhouette of two pixels across covers one at most, and one with more edges than a box less. */
#define LEAST_PIXELS 2
#define LEAST_MESH_PIXELS 4
/* Where it is less than this, a sub-tile is hardly ever covered by one occluder alone. */
#define DEPTH_PIXELS 24
/* Of so many drawings one may be unlikely to change anything; an object is counted when it is met and when it is drawn,
 * so that it is half of that. */
#define UNLIKELY_SHARE 4
/* After so many turns those are looked at that wait to be settled: together, so that their memory is fetched ahead. */
#define TURNS_BETWEEN 12

/* How many of eight bits are set. Not every processor that we are compiled for counts them by an instruction: the bits
 * are spread over the nibbles of a word, and a product adds up these. */
static inline uint32_t count_slots(uint32_t bits)
{
    return (bits * 0x08040201u >> 3 & 0x11111111u) * 0x11111111u >> 28;
}

static bool hidden(umb_walk *w, const umb_image *image)
{
    umb_past *past = &w->culler->past;
    bool propagates = umb_past_has(past, UMB_COHERENCE_PROPAGATION);
    if (propagates && umb_past_hides(past, image)) {
        w->stats.saved += 1;
        return true;
    }
    umb_asker asker = {w->culler->ops, w->culler->method, w->culler->kernels, &w->projector, &w->map, &w->stats};
    bool is = umb_detail_hidden(&asker, image, NULL);
    if (is && propagates) {
        umb_past_hidden(past, image);
    }
    return is;
}

static void count_hidden(umb_walk *w, uint32_t ref)
{
    uint32_t kind = ref & UMB_REF_KIND;
    w->stats.hidden_nodes += kind == UMB_REF_NODE;
    w->stats.hidden_objects += kind == UMB_REF_OBJECT;
    if (kind == UMB_REF_OBJECT && w->scene->motion.count > 0) {
        umb_movers_pass(&w->culler->movers, ref & UMB_REF_NUMBER);
    }
}

/* An object in parts is as large as all of it, and a node of parts says nothing. */
static bool whole_too_small(umb_walk *w, uint32_t object)
{
    bool small = umb_contribution_small(w->view, &w->scene->objects[object].bounds);
    if (small && !umb_once_set(w->once, &w->once->objects[object], UMB_ONCE_SETTLED)) {
        w->stats.small += 1;
    }
    return small;
}

static bool too_small(umb_walk *w, const umb_node *node, uint32_t slot)
{
    uint32_t kind = node->ref[slot] & UMB_REF_KIND;
    if (!(w->view->min_pixels > 0.0) || kind == UMB_REF_OCCLUDER) {
        return false;
    }
    if (w->once != NULL) {
        return kind == UMB_REF_OBJECT && whole_too_small(w, node->ref[slot] & UMB_REF_NUMBER);
    }
    bool small = umb_contribution_small_slot(w->view, node, slot);
    w->stats.small += small && kind == UMB_REF_OBJECT;
    return small;
}

/* What waits is wanted soon: have it brought into the cache. Inline, or GCC drops the calls: it takes a function that
 * only fetches ahead for one without effect. */
static inline __attribute__((always_inline)) void fetch(const umb_walk *w, uint32_t ref)
{
    uint32_t number = ref & UMB_REF_NUMBER;
    if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
        const char *p = (const char *)&w->tree->nodes[number];
        for (size_t i = 0; i < sizeof(umb_node); i += 64) {
            __builtin_prefetch(p + i);
        }
    } else if ((ref & UMB_REF_KIND) == UMB_REF_OBJECT) {
        const umb_object *o = &w->scene->objects[number];
        __builtin_prefetch(o);
        __builtin_prefetch((const char *)&o->transform - 1); /* the end of what comes first */
    }
}

/* The shape of an object that may be asked about as a body: the start of its block, which holds a small one's vertices. */
static inline __attribute__((always_inline)) void fetch_shape(const umb_walk *w, uint32_t ref)
{
    const umb_object *o = &w->scene->objects[ref & UMB_REF_NUMBER];
    if ((ref & UMB_REF_KIND) == UMB_REF_OBJECT && o->body && !o->box) {
        const char *p = (const char *)o->mesh;
        for (int i = 0; i < 4; ++i) {
            __builtin_prefetch(p + (size_t)64 * i);
        }
    }
}

/* Eight boxes that are tested together. */
typedef struct opening {
    const umb_node *boxes;
    uint32_t number; /* of the node; UMB_NONE: it is none of the tree's */
    uint16_t planes; /* that its boxes may cross */
    uint8_t *remember;
    uint16_t child_planes[UMB_NODE_WIDTH];
} opening;

static umb_image image_of(const umb_projected *p, uint32_t slot)
{
    return (umb_image){{(int16_t)p->x0[slot], (int16_t)p->y0[slot], (int16_t)p->x1[slot], (int16_t)p->y1[slot]},
                       p->nearness[slot]};
}

static int side_of(const umb_pixel_rect *r)
{
    int wide = r->x1 - r->x0, high = r->y1 - r->y0;
    return wide < high ? wide : high;
}

/* True if every pixel of a rectangle is covered, all but a border of it. */
static bool is_closed(umb_walk *w, const umb_pixel_rect *r, int border)
{
    umb_image within = {{(int16_t)(r->x0 + (r->x0 > 0 ? border : 0)), (int16_t)(r->y0 + (r->y0 > 0 ? border : 0)),
                         (int16_t)(r->x1 - (r->x1 + 1 < (int)w->map.width ? border : 0)),
                         (int16_t)(r->y1 - (r->y1 + 1 < (int)w->map.height ? border : 0))},
                        -FLT_MAX};
    w->stats.queries += 1;
    return w->culler->ops->hidden(w->culler->method, &within, NULL);
}

/* True if drawing an occluder is sure, or all but sure, to change nothing (Gummerus 5.2, redundancy): its box's image
 * is too small, or there is no open pixel left in it. Pixels at the image's border are hardly ever covered wholly, and
 * most of what peeps out from behind something is open there and nowhere else: where only they are open it is drawn if
 * enough was drawn by now for that not to matter. Where every pixel is covered a drawing could still bring the depth of a
 * sub-tile nearer that it covers alone; that takes a large image. */
static bool is_idle(umb_walk *w, bool convex, const umb_waiting *item)
{
    const umb_pixel_rect *r = &item->image.rect;
    if (!item->testable) {
        return false;
    }
    int side = side_of(r);
    if (side < (convex ? LEAST_PIXELS : LEAST_MESH_PIXELS)) {
        return true;
    }
    if (side >= DEPTH_PIXELS || w->drawn == 0 || !is_closed(w, r, 1)) {
        return false;
    }
    bool wanted = UNLIKELY_SHARE * w->unlikely < w->drawn && !is_closed(w, r, 0);
    w->unlikely += wanted;
    return !wanted;
}

/* Images without a border of one pixel, but where they end at the raster's, and which of them is_idle() would ask about;
 * *tiny: those that cover nothing. */
static uint32_t shrink(const umb_walk *w, const umb_projected *p, uint32_t *tiny, umb_projected *out)
{
    int32_t width = (int32_t)w->map.width, height = (int32_t)w->map.height;
    uint32_t less = 0;
    *tiny = 0;
    for (uint32_t i = 0; i < UMB_NODE_WIDTH; ++i) {
        int32_t wide = p->x1[i] - p->x0[i], high = p->y1[i] - p->y0[i], side = wide < high ? wide : high;
        out->x0[i] = p->x0[i] + (p->x0[i] > 0);
        out->y0[i] = p->y0[i] + (p->y0[i] > 0);
        out->x1[i] = p->x1[i] - (p->x1[i] + 1 < width);
        out->y1[i] = p->y1[i] - (p->y1[i] + 1 < height);
        out->nearness[i] = -FLT_MAX;
        *tiny |= (uint32_t)(side < LEAST_PIXELS) << i;
        less |= (uint32_t)(side < DEPTH_PIXELS) << i;
    }
    return less & ~*tiny;
}

/* An object's first turn is for drawing it before what is behind. One that is idle (is_idle, of all eight at once) already
 * needs none: open pixels only become fewer. Where objects move by themselves the first turn asks for their poses, too. */
static uint32_t skip_turns(umb_walk *w, const umb_projected *p, uint32_t objects)
{
    objects &= p->testable;
    if (objects == 0 || w->culler->ops == NULL || w->scene->motion.count != 0 || w->drawn == 0) {
        return 0;
    }
    umb_projected within;
    uint32_t tiny, some = shrink(w, p, &tiny, &within) & objects, skips = tiny & objects;
    w->stats.queries += count_slots(some);
    some = some != 0 ? w->culler->ops->hides(w->culler->method, &within, some) : 0;
    for (; some != 0; some &= some - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(some);
        umb_image image = image_of(p, slot);
        bool wanted = UNLIKELY_SHARE * w->unlikely < w->drawn && !is_closed(w, &image.rect, 0);
        w->unlikely += wanted;
        skips |= (uint32_t)!wanted << slot;
    }
    w->stats.idle += count_slots(skips);
    return skips;
}

static umb_waiting *fill_in(umb_walk *w, const opening *o, const umb_projected *p, uint32_t slot, uint32_t *taken)
{
    umb_heap *heap = &w->culler->heap;
    *taken = umb_heap_take(heap);
    umb_waiting *item = &heap->slots[*taken];
    item->nearest = p->w_min[slot];
    item->settled = p->w_max[slot] < w->most_w ? p->w_max[slot] : w->most_w;
    item->ref = o->boxes->ref[slot];
    item->node = o->number;
    item->stamp = w->drawn;
    item->image = image_of(p, slot);
    item->part = 0;
    item->planes = o->child_planes[slot];
    item->testable = (p->testable >> slot & 1u) != 0;
    item->asked = false;
    item->waited = false;
    fetch(w, item->ref);
    return item;
}

/* Have the boxes of a mask wait: those of skips have had their turn. */
static void push(umb_walk *w, const opening *o, const umb_projected *p, uint32_t left, uint32_t skips)
{
    umb_heap *heap = &w->culler->heap;
    uint32_t taken;
    for (uint32_t turns = left & ~skips; turns != 0; turns &= turns - 1) {
        const umb_waiting *item = fill_in(w, o, p, (uint32_t)__builtin_ctz(turns), &taken);
        umb_heap_push(heap, item->nearest, taken);
    }
    for (uint32_t later = left & skips; later != 0; later &= later - 1) {
        umb_waiting *item = fill_in(w, o, p, (uint32_t)__builtin_ctz(later), &taken);
        item->waited = true;
        umb_heap_put_by(heap, item->settled, taken);
    }
}

/* True if it need not be asked about. */
static bool is_known(const umb_past *past, uint32_t ref)
{
    switch (ref & UMB_REF_KIND) {
    case UMB_REF_NODE:
        return umb_past_node_open(past, ref & UMB_REF_NUMBER);
    case UMB_REF_OBJECT:
        return umb_past_object_seen(past, ref & UMB_REF_NUMBER);
    default:
        return false;
    }
}

static uint32_t all_known(const umb_past *past, const umb_node *boxes, uint32_t mask)
{
    uint32_t known = 0;
    for (; mask != 0; mask &= mask - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(mask);
        known |= is_known(past, boxes->ref[slot]) ? 1u << slot : 0;
    }
    return known;
}

/* Which of the boxes in mask are hidden. */
static uint32_t ask(umb_walk *w, const umb_projected *projected, uint32_t mask)
{
    const umb_culler *c = w->culler;
    w->stats.queries += count_slots(mask);
    return mask != 0 ? c->ops->hides(c->method, projected, mask) : 0;
}

static uint32_t ask_by_neighbours(umb_walk *w, const umb_projected *projected, uint32_t mask)
{
    umb_past *past = &w->culler->past;
    uint32_t hides = 0;
    for (uint32_t left = mask; left != 0; left &= left - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(left);
        umb_image image = image_of(projected, slot);
        hides |= umb_past_hides(past, &image) ? 1u << slot : 0;
    }
    w->stats.saved += count_slots(hides);
    uint32_t found = ask(w, projected, mask & ~hides);
    for (uint32_t left = found; left != 0; left &= left - 1) {
        umb_image image = image_of(projected, (uint32_t)__builtin_ctz(left));
        umb_past_hidden(past, &image);
    }
    return hides | found;
}

/* Count what is in the frustum. False if nothing is left to do about it. */
static bool meet(umb_walk *w, uint32_t ref)
{
    bool object = (ref & UMB_REF_KIND) == UMB_REF_OBJECT;
    if (!object || w->once == NULL) {
        w->stats.in_frustum += object;
        return true;
    }
    uint32_t *entry = &w->once->objects[ref & UMB_REF_NUMBER];
    w->stats.in_frustum += !umb_once_set(w->once, entry, UMB_ONCE_MET);
    return !umb_once_has(w->once, *entry, UMB_ONCE_SETTLED);
}

/* Which of the boxes in left are to wait, where items have several slots, or may be too small. */
static uint32_t sift(umb_walk *w, const umb_node *boxes, uint32_t left, uint32_t hides)
{
    uint32_t waits = 0;
    for (; left != 0; left &= left - 1) {
        uint32_t slot = (uint32_t)__builtin_ctz(left), ref = boxes->ref[slot];
        if (!meet(w, ref)) {
            continue;
        }
        if ((hides >> slot & 1u) != 0) {
            count_hidden(w, ref);
        } else if (!too_small(w, boxes, slot)) {
            waits |= 1u << slot;
        }
    }
    return waits;
}

/* Test eight boxes and have those wait that may be seen. */
static void open_boxes(umb_walk *w, opening *o)
{
    umb_culler *c = w->culler;
    const umb_node *boxes = o->boxes;
    uint32_t outside = umb_frustum_test_node(&w->frustum, c->kernels, boxes, o->planes, o->remember, o->child_planes);
    uint32_t left = ~outside & ((1u << boxes->count) - 1u);
    w->stats.boxes += boxes->count;
    if (w->present != NULL) {
        left = umb_filter_present(w->present, boxes, left, &w->stats);
    }
    if (left == 0) {
        return;
    }
    umb_projected projected;
    c->kernels->project(boxes, &w->projector, &projected);
    uint32_t hides = projected.beside & left, sure = 0;
    if (umb_past_knows(&c->past)) {
        sure = all_known(&c->past, boxes, left & ~hides);
        w->stats.saved += w->drawn != 0 ? count_slots(sure & projected.testable) : 0;
    }
    if (c->ops != NULL && w->drawn != 0) {
        uint32_t mask = projected.testable & left & ~hides & ~sure;
        hides |= umb_past_has(&c->past, UMB_COHERENCE_PROPAGATION) ? ask_by_neighbours(w, &projected, mask)
                                                                     : ask(w, &projected, mask);
    }
    uint32_t objects = projected.objects;
    if (w->plain) {
        w->stats.in_frustum += count_slots(left & objects);
        w->stats.hidden_objects += count_slots(left & hides & objects);
        w->stats.hidden_nodes += count_slots(left & hides & projected.nodes);
        left &= ~hides;
    } else {
        left = sift(w, boxes, left, hides);
    }
    push(w, o, &projected, left, skip_turns(w, &projected, left & objects));
}

static void open_node(umb_walk *w, uint32_t number, uint16_t planes)
{
    opening o = {.boxes = &w->tree->nodes[number],
                 .number = number,
                 .planes = planes,
                 .remember = &w->culler->planes[number]};
    umb_tree_note_open(w->tree, number);
    w->stats.nodes += 1;
    open_boxes(w, &o);
}

/* Draw an occluder, unless it is not worth it. box: its own, if it is one that stands along the axes, else NULL. */
static void draw(umb_walk *w, uint32_t occluder, const umb_aabb *box, const umb_waiting *item)
{
    const umb_culler *c = w->culler;
    if (c->ops == NULL || occluder == UMB_NONE ||
        (w->once != NULL && umb_once_has(w->once, w->once->occluders[occluder], UMB_ONCE_DRAWN))) {
        return;
    }
    bool convex = box != NULL || w->scene->occluders[occluder].mesh->convex;
    if (is_idle(w, convex, item)) {
        w->stats.idle += 1;
        return;
    }
    if (w->once != NULL) {
        umb_once_set(w->once, &w->once->occluders[occluder], UMB_ONCE_DRAWN);
    }
    umb_past *past = &w->culler->past;
    if (!umb_past_judges(past, !convex)) {
        w->drawn += c->ops->occlude(c->method, occluder, box, &w->stats) != 0;
        return;
    }
    const umb_pixel_rect *rect = item->testable ? &item->image.rect : NULL;
    switch (umb_past_judge(past, occluder, rect)) {
    case UMB_PAST_DONE:
        break;
    case UMB_PAST_RESTS:
        w->stats.resting += 1;
        break;
    case UMB_PAST_COSTS:
        w->stats.over_budget += 1;
        break;
    case UMB_PAST_DRAW: {
        uint32_t before = w->stats.occluders, tiles = c->ops->occlude(c->method, occluder, box, &w->stats);
        w->drawn += tiles != 0;
        umb_past_drew(past, occluder, rect, tiles, !convex);
        if (w->scene->occluders[occluder].moves) {
            umb_past_unlist(past, occluder);
        }
        if (w->stats.occluders == before) {
            umb_past_refund(past);
        }
    } break;
    }
}

/* Nothing more is to be found out about an object in this frame. */
static void settle(umb_walk *w, uint32_t object)
{
    if (w->once != NULL) {
        umb_once_set(w->once, &w->once->objects[object], UMB_ONCE_SETTLED);
    }
}

static bool is_settled(const umb_walk *w, uint32_t ref)
{
    return w->once != NULL && (ref & UMB_REF_KIND) == UMB_REF_OBJECT &&
           umb_once_has(w->once, w->once->objects[ref & UMB_REF_NUMBER], UMB_ONCE_SETTLED);
}

static void report(umb_walk *w, const umb_waiting *item)
{
    umb_culler *c = w->culler;
    uint32_t id = item->ref & UMB_REF_NUMBER;
    c->found[c->count++] = umb_found_entry(item->nearest, id, item->planes == 0);
    settle(w, id);
    if (w->scene->motion.count > 0) {
        umb_movers_show(&c->movers, id);
    }
    if (umb_past_knows(&c->past)) {
        umb_past_saw(&c->past, w->tree, id, item->node);
    }
}

/* True if the object may be seen, asked in detail when its shape is all that is drawn. */
static bool object_shows(umb_walk *w, const umb_object *o, umb_waiting *item)
{
    const umb_culler *c = w->culler;
    if (c->ops == NULL) {
        return true;
    }
    umb_asker asker = {c->ops, c->method, w->culler->kernels, &w->projector, &w->map, &w->stats};
    switch (umb_detail_of(o)) {
    case UMB_DETAIL_NONE:
        return true;
    case UMB_DETAIL_BODY:
        if (item->testable) {
            w->stats.queries += 1;
            return !c->ops->hides_body(c->method, o, &item->image);
        }
        break;
    case UMB_DETAIL_PARTS:
        break;
    }
    return umb_detail_shows(&asker, o, &item->part, &item->settled);
}

/* Have moving objects wait, with their true bounds, as if they had come by themselves. */
static void push_posed(umb_walk *w, umb_posed *const *posed, uint32_t count)
{
    umb_node boxes;
    boxes.count = count;
    for (uint32_t slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
        const umb_posed *p = posed[slot < count ? slot : 0];
        boxes.ref[slot] = slot < count ? UMB_REF_OBJECT | p->object : UMB_NONE;
        for (int axis = 0; axis < 3; ++axis) {
            boxes.min[axis][slot] = p->bounds.min[axis];
            boxes.max[axis][slot] = p->bounds.max[axis];
        }
    }
    uint8_t remember = 0;
    opening o = {.boxes = &boxes, .number = UMB_NONE, .planes = w->frustum.all_planes, .remember = &remember};
    open_boxes(w, &o);
}

/* The volume of a moving object is seen: where the object truly is, decides. Of one that nobody can tell, only the volume
 * is known, and that it may be seen. */
static void meet_mover(umb_walk *w, const umb_waiting *item)
{
    umb_posed *p = umb_movers_meet(&w->culler->movers, item->ref & UMB_REF_NUMBER, false, &w->stats);
    if (p != NULL && !p->known) {
        report(w, item);
        return;
    }
    w->stats.in_frustum -= w->once == NULL;
    if (p != NULL) {
        push_posed(w, &p, 1);
    }
}

/* An object whose turn has come. It is reported only when everything that can hide it has been
 * drawn: until then it waits again, for the depth of its far end, and may yet turn out to be
 * hidden. One that hides by its own shape is asked about at once, too, because it is to be drawn
 * before what is behind it; its wait then ends where what may be seen of it ends. True if it
 * waits. */
static bool visit_object(umb_walk *w, umb_waiting *item, float key)
{
    const umb_object *o = &w->scene->objects[item->ref & UMB_REF_NUMBER];
    umb_object posed;
    if (w->scene->motion.count > 0 && umb_movers_roams(&w->culler->movers, o)) {
        if (item->node != UMB_NONE) {
            meet_mover(w, item);
            return false;
        }
        posed = umb_movers_object(&w->culler->movers, umb_movers_find(&w->culler->movers, o->mover));
        o = &posed;
    }
    const umb_aabb *box = o->box ? &o->bounds : NULL;
    if (umb_past_object_seen(&w->culler->past, item->ref & UMB_REF_NUMBER)) {
        draw(w, o->occluder, box, item);
        report(w, item);
        return false;
    }
    bool first = !item->waited, hides = o->occluder != UMB_NONE;
    bool can_wait = w->culler->ops != NULL;
    bool settled = !can_wait || !(item->settled > key);
    bool early = first && hides;
    bool ask = settled ? !item->asked || item->stamp != w->drawn : early;
    item->waited = true;
    item->asked = item->asked || ask;
    if (ask && !object_shows(w, o, item)) {
        w->stats.hidden_objects += 1;
        if (umb_detail_of(o) == UMB_DETAIL_PARTS) { /* all of its shape was asked about, not what is in one box */
            settle(w, item->ref & UMB_REF_NUMBER);
        }
        return false;
    }
    if (first) {
        draw(w, o->occluder, box, item);
    }
    if (!can_wait || !(item->settled > key)) { /* asking may have moved it either way */
        report(w, item);
        return false;
    }
    item->stamp = w->drawn;
    return true;
}

/* An entry that comes up is hidden by now. */
static bool found_hidden(umb_walk *w, const umb_waiting *item)
{
    const umb_past *past = &w->culler->past;
    if (!item->testable || item->stamp == w->drawn) {
        return false;
    }
    if (umb_past_knows(past) && is_known(past, item->ref)) {
        w->stats.saved += 1;
        return false;
    }
    return hidden(w, &item->image);
}

/* A node whose box may be seen: its volume, where it has one. */
static bool volume_shows(umb_walk *w, const umb_waiting *item)
{
    const umb_culler *c = w->culler;
    uint32_t node = item->ref & UMB_REF_NUMBER;
    if (!umb_volumes_in_view(&w->frustum, w->tree, node, item->planes)) {
        return false;
    }
    umb_asker asker = {c->ops, c->method, c->kernels, &w->projector, &w->map, &w->stats};
    bool hides = w->drawn != 0 && umb_volumes_hidden(&asker, w->tree, node);
    w->stats.hidden_nodes += hides;
    return !hides;
}

/* Those whose time has come go to the front, and what will be wanted of them is fetched. How many. */
static size_t gather_due(umb_walk *w, float key)
{
    umb_heap *heap = &w->culler->heap;
    size_t due = 0;
    for (size_t i = 0; i < heap->by_count; ++i) {
        umb_put_by e = heap->by[i];
        if (!(e.until > key)) {
            fetch_shape(w, heap->slots[e.slot].ref);
            heap->by[i] = heap->by[due];
            heap->by[due++] = e;
        }
    }
    return due;
}

/* Report those that were put by until now, unless they are hidden by now; key: of the turn that comes next. */
static void decide_due(umb_walk *w, float key)
{
    umb_heap *heap = &w->culler->heap;
    size_t due = gather_due(w, key), kept = 0;
    for (size_t i = 0; i < due; ++i) {
        umb_put_by e = heap->by[i];
        umb_waiting *item = &heap->slots[e.slot];
        bool waits = false;
        if (is_settled(w, item->ref)) {
            waits = false;
        } else if (found_hidden(w, item)) {
            count_hidden(w, item->ref);
        } else {
            waits = visit_object(w, item, key);
        }
        if (waits) {
            heap->by[kept++] = (umb_put_by){item->settled, e.slot};
        } else {
            umb_heap_give(heap, e.slot);
        }
    }
    umb_heap_close_gap(heap, kept, due);
    w->turns = 0;
}

/* One turn. */
static void take_turn(umb_walk *w, umb_heap_entry entry)
{
    umb_heap *heap = &w->culler->heap;
    umb_waiting *item = &heap->slots[entry.slot];
    if (is_settled(w, item->ref)) {
        umb_heap_give(heap, entry.slot);
        return;
    }
    if (found_hidden(w, item)) {
        count_hidden(w, item->ref);
    } else if ((item->ref & UMB_REF_KIND) == UMB_REF_NODE) {
        if (w->tree->volumes == NULL || volume_shows(w, item)) {
            open_node(w, item->ref & UMB_REF_NUMBER, item->planes);
        }
    } else if ((item->ref & UMB_REF_KIND) == UMB_REF_OCCLUDER) {
        draw(w, item->ref & UMB_REF_NUMBER, NULL, item);
    } else if (visit_object(w, item, umb_heap_key(&entry))) {
        umb_heap_put_by(heap, item->settled, entry.slot);
        return;
    }
    umb_heap_give(heap, entry.slot);
}

static void run_queue(umb_walk *w)
{
    umb_heap *heap = &w->culler->heap;
    while (heap->count > 0) {
        umb_heap_entry entry = umb_heap_pop(heap);
        if (heap->count > 0) {
            fetch_shape(w, heap->slots[heap->entries[0].slot].ref);
        }
        if (++w->turns == TURNS_BETWEEN) {
            decide_due(w, umb_heap_key(&entry));
        }
        take_turn(w, entry);
    }
    decide_due(w, INFINITY);
}

/* The occluders of the last frame's list, eight at a time, as if they were all that there is: nearest first, and
 * not those that are hidden. */
static void draw_early(umb_walk *w)
{
    const umb_past *past = &w->culler->past;
    for (uint32_t i = 0; i < past->early_count; i += UMB_NODE_WIDTH) {
        umb_node boxes;
        boxes.count = past->early_count - i < UMB_NODE_WIDTH ? past->early_count - i : UMB_NODE_WIDTH;
        for (uint32_t slot = 0; slot < UMB_NODE_WIDTH; ++slot) {
            uint32_t number = past->early[i + (slot < boxes.count ? slot : 0)];
            const umb_aabb *box = &w->scene->occluders[number].bounds;
            boxes.ref[slot] = slot < boxes.count ? UMB_REF_OCCLUDER | number : UMB_NONE;
            for (int axis = 0; axis < 3; ++axis) {
                boxes.min[axis][slot] = box->min[axis];
                boxes.max[axis][slot] = box->max[axis];
            }
        }
        uint8_t remember = 0;
        opening o = {.boxes = &boxes, .number = UMB_NONE, .planes = w->frustum.all_planes, .remember = &remember};
        open_boxes(w, &o);
    }
    run_queue(w);
    w->stats.early = w->stats.occluders;
}

/* Moving objects whose volumes do not hold: eight that wait at a time. */
typedef struct expired_movers {
    umb_walk *w;
    umb_posed *waiting[UMB_NODE_WIDTH];
    uint32_t count;
} expired_movers;

static void push_expired(expired_movers *e)
{
    if (e->count > 0) {
        push_posed(e->w, e->waiting, e->count);
        e->count = 0;
    }
}

static void meet_expired(void *user, uint32_t mover)
{
    expired_movers *e = user;
    umb_walk *w = e->w;
    uint32_t object = w->scene->motion.objects[mover];
    if (w->present != NULL && !umb_filter_has(w->present, object)) {
        return;
    }
    umb_posed *p = umb_movers_meet(&w->culler->movers, object, true, &w->stats);
    if (p == NULL) {
        return;
    }
    if (!p->known) {
        umb_waiting nowhere = {.nearest = -INFINITY, .ref = UMB_REF_OBJECT | object, .node = UMB_NONE, .planes = 1};
        w->stats.in_frustum += 1;
        report(w, &nowhere);
        return;
    }
    e->waiting[e->count++] = p;
    if (e->count == UMB_NODE_WIDTH) {
        push_expired(e);
    }
}

static void meet_all_expired(umb_walk *w)
{
    expired_movers e = {.w = w};
    umb_movers_expired(&w->culler->movers, meet_expired, &e);
    push_expired(&e);
}

static void run(umb_walk *w)
{
    uint32_t roots = w->tree->flat ? w->tree->node_count : w->tree->node_count > 0;
    if (umb_past_has(&w->culler->past, UMB_COHERENCE_LIST)) {
        draw_early(w);
    }
    if (w->scene->motion.count > 0) {
        meet_all_expired(w);
    }
    for (uint32_t i = 0; i < roots; ++i) {
        open_node(w, i, w->frustum.all_planes);
    }
    run_queue(w);
}

/* The first task is the walk; the others find ahead what it will want, and return when it has ended. */
static void run_task(void *data, uint32_t i)
{
    umb_walk *w = data;
    umb_culler *c = w->culler;
    if (i > 0) {
        c->ops->help(c->method, i - 1);
        return;
    }
    run(w);
    if (c->ops != NULL) {
        c->ops->finish(c->method);
    }
}

void umb_best_first_run(umb_walk *w)
{
    umb_culler *c = w->culler;
    const umb_tasks *tasks = &c->def.tasks;
    uint32_t helpers = c->ops != NULL && tasks->run != NULL ? c->ops->look_ahead(c->method, tasks->workers) : 0;
    umb_tasks_run(tasks, run_task, w, 1 + helpers);
}

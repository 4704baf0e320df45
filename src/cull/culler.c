/* The pipeline: frustum, occlusion, contribution (Gummerus 2), over a best-first walk of the index.
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
#include "culler.h"

#include <float.h>
#include <string.h>

#include "base/memory.h"
#include "chosen.h"
#include "contribution.h"
#include "detail.h"
#include "filter.h"
#include "found.h"
#include "frustum/box_kernels.h"
#include "frustum/frustum.h"
#include "heap.h"
#include "in_view.h"
#include "index/tree.h"
#include "movers.h"
#include "occlusion/image.h"
#include "occlusion/method.h"
#include "once.h"
#include "past.h"
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

struct umb_culler {
    umb_allocator allocator;
    const umb_index *index;
    umb_culler_def def;
    const umb_box_kernels *kernels;
    const umb_method_ops *ops; /* NULL: no occlusion */
    void *method;
    umb_heap heap;
    umb_in_view_room room; /* without occlusion, instead of the heap */
    umb_chosen_room chosen_room; /* with a method that chooses first, likewise */
    uint64_t *found;       /* entries of found.h as they are reported */
    uint64_t *scratch;     /* to sort them */
    uint32_t *objects;
    uint8_t *inside;
    double *rows;    /* the raster's table of rows */
    uint8_t *planes; /* per node: the plane that all its boxes failed last time (plane coherency) */
    size_t found_capacity, scratch_capacity, object_capacity, inside_capacity, plane_capacity, row_capacity;
    umb_past past;
    umb_once once;
    umb_movers movers;
    umb_filter filter;
    uint32_t count;
    bool answered;
    umb_view view;    /* of the last answer */
    uint64_t version; /* of the scene that it was given for */
    uint64_t commit;  /* after which it was given: the next one takes what was told of moving objects */
};

/* One frame's state. */
typedef struct walk {
    umb_culler *culler;
    const umb_committed *scene;
    const umb_tree *tree;
    umb_frustum frustum;
    umb_raster_map map;
    umb_projector projector;
    const umb_view *view;
    umb_once *once; /* NULL: each item has one slot */
    const umb_filter *present; /* NULL: nothing is left out of the walk */
    float most_w;
    bool plain; /* each item has one slot, and none is too small: what is hidden is only counted */
    uint32_t drawn;
    uint32_t turns; /* since those were looked at that wait to be settled */
    uint32_t unlikely; /* occluders wanted though they hardly change anything */
    umb_cull_stats stats;
} walk;

/* How many of eight bits are set. Not every processor that we are compiled for counts them by an instruction: the bits
 * are spread over the nibbles of a word, and a product adds up these. */
static inline uint32_t count_slots(uint32_t bits)
{
    return (bits * 0x08040201u >> 3 & 0x11111111u) * 0x11111111u >> 28;
}

/* True if the method chooses its occluders before the walk. */
static bool chooses(const umb_culler *c)
{
    return c->ops != NULL && c->ops->choose != NULL;
}

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
    if (c->ops != NULL && !chooses(c)) { /* without occlusion there is nothing to learn */
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
        (c->ops != NULL && !chooses(c) && !umb_heap_reserve(&c->heap, a, waiting > early ? waiting : early)) ||
        (chooses(c) && !umb_chosen_reserve(&c->chosen_room, a, tree)) ||
        (c->ops == NULL && !umb_in_view_reserve(&c->room, a, tree)) || !reserve_answer(c, tree) ||
        !umb_memory_reserve(a, (void **)&c->planes, &c->plane_capacity, umb_in_view_remembers(tree), 1)) {
        return false;
    }
    if (c->plane_capacity > planes) { /* an empty index has no planes at all */
        memset(c->planes + planes, 0, c->plane_capacity - planes);
    }
    return true;
}

static bool hidden(walk *w, const umb_image *image)
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

static void count_hidden(walk *w, uint32_t ref)
{
    uint32_t kind = ref & UMB_REF_KIND;
    w->stats.hidden_nodes += kind == UMB_REF_NODE;
    w->stats.hidden_objects += kind == UMB_REF_OBJECT;
    if (kind == UMB_REF_OBJECT && w->scene->motion.count > 0) {
        umb_movers_pass(&w->culler->movers, ref & UMB_REF_NUMBER);
    }
}

/* An object in parts is as large as all of it, and a node of parts says nothing. */
static bool whole_too_small(walk *w, uint32_t object)
{
    bool small = umb_contribution_small(w->view, &w->scene->objects[object].bounds);
    if (small && !umb_once_set(w->once, &w->once->objects[object], UMB_ONCE_SETTLED)) {
        w->stats.small += 1;
    }
    return small;
}

static bool too_small(walk *w, const umb_node *node, uint32_t slot)
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
static inline __attribute__((always_inline)) void fetch(const walk *w, uint32_t ref)
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
static inline __attribute__((always_inline)) void fetch_shape(const walk *w, uint32_t ref)
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
static bool is_closed(walk *w, const umb_pixel_rect *r, int border)
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
static bool is_idle(walk *w, bool convex, const umb_waiting *item)
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
static uint32_t shrink(const walk *w, const umb_projected *p, uint32_t *tiny, umb_projected *out)
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
static uint32_t skip_turns(walk *w, const umb_projected *p, uint32_t objects)
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

static umb_waiting *fill_in(walk *w, const opening *o, const umb_projected *p, uint32_t slot, uint32_t *taken)
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
static void push(walk *w, const opening *o, const umb_projected *p, uint32_t left, uint32_t skips)
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
static uint32_t ask(walk *w, const umb_projected *projected, uint32_t mask)
{
    const umb_culler *c = w->culler;
    w->stats.queries += count_slots(mask);
    return mask != 0 ? c->ops->hides(c->method, projected, mask) : 0;
}

static uint32_t ask_by_neighbours(walk *w, const umb_projected *projected, uint32_t mask)
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
static bool meet(walk *w, uint32_t ref)
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
static uint32_t sift(walk *w, const umb_node *boxes, uint32_t left, uint32_t hides)
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
static void open_boxes(walk *w, opening *o)
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

static void open_node(walk *w, uint32_t number, uint16_t planes)
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
static void draw(walk *w, uint32_t occluder, const umb_aabb *box, const umb_waiting *item)
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
static void settle(walk *w, uint32_t object)
{
    if (w->once != NULL) {
        umb_once_set(w->once, &w->once->objects[object], UMB_ONCE_SETTLED);
    }
}

static bool is_settled(const walk *w, uint32_t ref)
{
    return w->once != NULL && (ref & UMB_REF_KIND) == UMB_REF_OBJECT &&
           umb_once_has(w->once, w->once->objects[ref & UMB_REF_NUMBER], UMB_ONCE_SETTLED);
}

static void report(walk *w, const umb_waiting *item)
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
static bool object_shows(walk *w, const umb_object *o, umb_waiting *item)
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
static void push_posed(walk *w, umb_posed *const *posed, uint32_t count)
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
static void meet_mover(walk *w, const umb_waiting *item)
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
static bool visit_object(walk *w, umb_waiting *item, float key)
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
static bool found_hidden(walk *w, const umb_waiting *item)
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
static bool volume_shows(walk *w, const umb_waiting *item)
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
static size_t gather_due(walk *w, float key)
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
static void decide_due(walk *w, float key)
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
static void take_turn(walk *w, umb_heap_entry entry)
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

static void run_queue(walk *w)
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
static void draw_early(walk *w)
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
    walk *w;
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
    walk *w = e->w;
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

static void meet_all_expired(walk *w)
{
    expired_movers e = {.w = w};
    umb_movers_expired(&w->culler->movers, meet_expired, &e);
    push_expired(&e);
}

static void run(walk *w)
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
    walk *w = data;
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

static void run_all(walk *w)
{
    umb_culler *c = w->culler;
    const umb_tasks *tasks = &c->def.tasks;
    uint32_t helpers = c->ops != NULL && tasks->run != NULL ? c->ops->look_ahead(c->method, tasks->workers) : 0;
    umb_tasks_run(tasks, run_task, w, 1 + helpers);
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

static void prepare_walk(walk *w, umb_culler *c, const umb_view *view)
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

/* Without occlusion. */
static void find_in_view(walk *w)
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

/* Without the walk of run(), which meets movers on its way: put them right afterwards. */
static void settle_movers(walk *w)
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
static umb_result find_chosen(walk *w)
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
static void make_whole(walk *w)
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
static void leave_out(walk *w)
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
static void finish(walk *w)
{
    umb_culler *c = w->culler;
    bool filters = umb_filter_on(&c->filter);
    if (w->once != NULL) {
        make_whole(w);
    }
    if (filters) {
        leave_out(w);
    }
    if (w->scene->motion.count > 0 && (c->ops == NULL || chooses(c))) {
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

umb_result umb_culler_prepare(umb_culler *c)
{
    const umb_tree *tree = umb_index_tree(c->index);
    const umb_committed *scene = umb_scene_committed(umb_index_scene(c->index));
    umb_cull_stats stats;
    umb_choice choice = {.scene = scene, .tree = tree, .budget = c->def.occluder_budget, .coherence = c->def.coherence,
                         .stats = &stats};
    if (!chooses(c)) {
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
    walk w;
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
        ready = c->ops == NULL || (chooses(c) ? find_chosen(&w) : c->ops->prepare(c->method, &w.map, w.scene)) == UMB_OK;
        ready = ready && (!umb_past_on(&c->past) ||
                          umb_past_begin(&c->past, &c->allocator, w.tree, w.scene, &w.map));
    }
    if (!ready) {
        return umb_error_set(c->def.error, UMB_ERROR_MEMORY, "no memory for the frame");
    }
    if (c->ops != NULL && !chooses(c)) {
        umb_heap_clear(&c->heap);
        run_all(&w);
        if (umb_past_on(&c->past)) {
            umb_past_end(&c->past);
        }
    } else if (c->ops == NULL) {
        find_in_view(&w);
    }
    finish(&w);
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

/* The buffer as the view sees it at a point of its picture: d.right and d.up where d.forward is 1. Both the raster
 * and the view look from the eye, so only the depth must be turned from W into one along forward. */
static float sample_buffer(const umb_coverage *b, const umb_raster_map *map, const umb_view *v, double x, double y)
{
    umb_vec3 right = umb_vec3_scale(umb_vec3_from_double(v->right), x);
    umb_vec3 up = umb_vec3_scale(umb_vec3_from_double(v->up), y);
    umb_vec3 d = umb_vec3_add(umb_vec3_add(right, up), umb_vec3_from_double(v->forward));
    double w = umb_vec3_dot(map->w, d), scale = map->orthographic ? 1.0 : 1.0 / w;
    double px = umb_vec3_dot(map->x, d) * scale + map->cx;
    uint32_t column = px < 0.0 ? 0 : px >= b->width ? b->width - 1 : (uint32_t)px;
    uint32_t row = (uint32_t)umb_raster_map_row_at(map, umb_vec3_dot(map->y, d) * scale + map->cy, 0.0);
    const umb_tile *t = &b->tiles[(size_t)(row / UMB_TILE_HEIGHT) * b->columns + column / UMB_TILE_WIDTH];
    uint32_t r = row % UMB_TILE_HEIGHT, bit = column % UMB_TILE_WIDTH;
    if ((t->mask[r] >> bit & 1u) == 0) {
        return 0.0f;
    }
    float z = t->z[4 * (r / 4) + bit / 8];
    return (float)(map->orthographic ? 1.0 / (1.0 - z - v->near_depth) : z * w);
}

bool umb_culler_read_buffer(const umb_culler *c, float *pixels, size_t capacity, uint32_t *width,
                            uint32_t *height)
{
    *width = *height = 0;
    if (c->ops == NULL || c->ops->buffer == NULL || !c->answered) {
        return false;
    }
    const umb_coverage *b = c->ops->buffer(c->method);
    *width = b->width;
    *height = b->height;
    if (pixels == NULL || capacity < (size_t)b->width * b->height) {
        return false;
    }
    const umb_view *v = &c->view;
    umb_raster_map map;
    umb_raster_map_prepare(&map, v, &umb_index_tree(c->index)->bounds, c->rows);
    for (uint32_t j = 0; j < b->height; ++j) {
        double y = v->y_max - (v->y_max - v->y_min) * (j + 0.5) / b->height;
        for (uint32_t i = 0; i < b->width; ++i) {
            double x = v->x_min + (v->x_max - v->x_min) * (i + 0.5) / b->width;
            pixels[(size_t)j * b->width + i] = sample_buffer(b, &map, v, x, y);
        }
    }
    return true;
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

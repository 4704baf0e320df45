/* The binary half of the build: top-down splits by the surface-area heuristic over bins, and
 * bottom-up the cheapest way to cut the binary tree into wide nodes.
 *
 * Ranges of items up to TASK_ITEMS are independent tasks. Which ranges these are depends on the
 * items alone, and so does everything done in them.
 */
#include <math.h>
#include <string.h>

#include "bvh.h"
#include "cut.h"

#define BINS 16
#define TASK_ITEMS 4096
/* Up to this many items all splits of the sorted order are tried instead of bins. */
#define SWEEP_ITEMS 8
/* Below this depth ranges are halved: the tree is never deeper than this plus log2 of the count. */
#define HALVE_DEPTH 48

typedef struct box4 {
    float min[4], max[4];
} box4;

typedef struct range {
    uint32_t first, end; /* items */
    uint32_t depth;
    uint32_t *link; /* where the number of its root goes */
    box4 box;
} range;

typedef struct build {
    umb_bvh_item *items;
    umb_bvh_split *splits;
    umb_cut_costs costs;
    struct task *tasks;
    size_t task_capacity;
    uint32_t task_count;
    uint32_t task_items; /* ranges of so many, or fewer, are tasks */
    const umb_allocator *allocator;
} build;

/* What the steps share with the build at once: calls would cost that a tenth. */
#define INLINE inline __attribute__((always_inline))

/* ---- boxes ---------------------------------------------------------------------------------- */

static const box4 empty_box = {{INFINITY, INFINITY, INFINITY, INFINITY},
                               {-INFINITY, -INFINITY, -INFINITY, -INFINITY}};

static inline void box_grow(box4 *b, const float min[4], const float max[4])
{
    for (int i = 0; i < 4; ++i) {
        b->min[i] = min[i] < b->min[i] ? min[i] : b->min[i];
    }
    for (int i = 0; i < 4; ++i) {
        b->max[i] = max[i] > b->max[i] ? max[i] : b->max[i];
    }
}

/* A quarter of the sum of the corners: half the centre, so that differences of any two are
 * finite. */
static inline float centroid(const umb_bvh_item *item, int axis)
{
    return 0.25f * item->min[axis] + 0.25f * item->max[axis];
}

static INLINE void grow_centres(box4 *centres, const umb_bvh_item *items, uint32_t first, uint32_t end)
{
    box4 b = *centres;
    for (uint32_t k = first; k < end; ++k) {
        float c[4];
        for (int i = 0; i < 4; ++i) {
            c[i] = 0.25f * items[k].min[i] + 0.25f * items[k].max[i];
        }
        box_grow(&b, c, c);
    }
    *centres = b;
}

/* ---- choosing a split ----------------------------------------------------------------------- */

typedef struct choice {
    double cost;      /* areas times counts; INFINITY: none */
    uint32_t balance; /* the smaller side's count: breaks ties, so that flat sets are halved */
    int axis;
    int bin; /* items in lower bins go left; in a sweep: that many items go left */
    box4 left, right;
} choice;

static void consider(choice *best, double cost, uint32_t left, uint32_t right, int axis, int bin,
                     const box4 *left_box, const box4 *right_box)
{
    uint32_t balance = left < right ? left : right;
    if (cost < best->cost || (cost == best->cost && balance > best->balance)) {
        best->cost = cost;
        best->balance = balance;
        best->axis = axis;
        best->bin = bin;
        best->left = *left_box;
        best->right = *right_box;
    }
}

typedef struct bins {
    box4 box[3][BINS];
    uint32_t count[3][BINS];
    float low[3], scale[3]; /* bin = (centroid - low) * scale; scale 0: the axis cannot be split */
} bins;

static inline int bin_of(const bins *b, const umb_bvh_item *item, int axis)
{
    int k = (int)((centroid(item, axis) - b->low[axis]) * b->scale[axis]);
    return k < BINS ? k : BINS - 1;
}

static void start_bins(bins *b, const box4 *centres)
{
    for (int axis = 0; axis < 3; ++axis) {
        float extent = centres->max[axis] - centres->min[axis];
        float scale = extent > 0.0f ? (float)BINS / extent : 0.0f;
        b->low[axis] = centres->min[axis];
        /* The reciprocal of a denormal extent may overflow: such an axis counts as flat. */
        b->scale[axis] = isfinite(scale) ? scale : 0.0f;
        for (int i = 0; i < BINS; ++i) {
            b->box[axis][i] = empty_box;
            b->count[axis][i] = 0;
        }
    }
}

static INLINE void fill_bins(bins *b, const umb_bvh_item *items, uint32_t first, uint32_t end)
{
    for (uint32_t k = first; k < end; ++k) {
        const umb_bvh_item *item = &items[k];
        for (int axis = 0; axis < 3; ++axis) {
            int i = bin_of(b, item, axis);
            box_grow(&b->box[axis][i], item->min, item->max);
            ++b->count[axis][i];
        }
    }
}

static void choose_bin(const bins *b, int axis, choice *best)
{
    box4 right[BINS];
    uint32_t right_count[BINS];
    box4 box = empty_box;
    uint32_t n = 0;
    for (int i = BINS - 1; i > 0; --i) {
        box_grow(&box, b->box[axis][i].min, b->box[axis][i].max);
        n += b->count[axis][i];
        right[i] = box;
        right_count[i] = n;
    }
    box = empty_box;
    n = 0;
    for (int i = 1; i < BINS; ++i) {
        box_grow(&box, b->box[axis][i - 1].min, b->box[axis][i - 1].max);
        n += b->count[axis][i - 1];
        if (n > 0 && right_count[i] > 0) {
            double cost = umb_half_area(box.min, box.max) * n +
                          umb_half_area(right[i].min, right[i].max) * right_count[i];
            consider(best, cost, n, right_count[i], axis, i, &box, &right[i]);
        }
    }
}

/* The best split between bins; false: there is none. */
static INLINE bool choose_bins(const bins *b, choice *best)
{
    for (int axis = 0; axis < 3; ++axis) {
        if (b->scale[axis] > 0.0f) {
            choose_bin(b, axis, best);
        }
    }
    return best->balance > 0;
}

/* Go on with bringing what belongs left to the left: items before *left are, items from *end on are not. At most so many
 * exchanges. True when it is done: both are the middle. */
static INLINE bool partition(const bins *b, umb_bvh_item *items, uint32_t *left, uint32_t *end, const choice *c, uint32_t most)
{
    uint32_t i = *left, j = *end;
    for (; most > 0; --most) {
        while (i < j && bin_of(b, &items[i], c->axis) < c->bin) {
            ++i;
        }
        while (i < j && bin_of(b, &items[j - 1], c->axis) >= c->bin) {
            --j;
        }
        if (i >= j) {
            break;
        }
        umb_bvh_item t = items[i];
        items[i] = items[j - 1];
        items[j - 1] = t;
    }
    *left = i;
    *end = j;
    return i >= j;
}

/* Sort a few items by centroid; stable, so that the result is one function of the input's order. */
static void sort_items(umb_bvh_item *items, uint32_t n, int axis)
{
    for (uint32_t i = 1; i < n; ++i) {
        umb_bvh_item t = items[i];
        float c = centroid(&t, axis);
        uint32_t j = i;
        for (; j > 0 && centroid(&items[j - 1], axis) > c; --j) {
            items[j] = items[j - 1];
        }
        items[j] = t;
    }
}

static void sweep_axis(const umb_bvh_item *items, uint32_t n, int axis, choice *best)
{
    box4 right[SWEEP_ITEMS];
    box4 box = empty_box;
    for (uint32_t i = n - 1; i > 0; --i) {
        box_grow(&box, items[i].min, items[i].max);
        right[i] = box;
    }
    box = empty_box;
    for (uint32_t i = 1; i < n; ++i) {
        box_grow(&box, items[i - 1].min, items[i - 1].max);
        double cost = umb_half_area(box.min, box.max) * i +
                      umb_half_area(right[i].min, right[i].max) * (n - i);
        consider(best, cost, i, n - i, axis, (int)i, &box, &right[i]);
    }
}

static uint32_t split_by_sweep(umb_bvh_item *items, const range *r, choice *best)
{
    uint32_t n = r->end - r->first;
    umb_bvh_item sorted[3][SWEEP_ITEMS];
    for (int axis = 0; axis < 3; ++axis) {
        memcpy(sorted[axis], items + r->first, n * sizeof(items[0]));
        sort_items(sorted[axis], n, axis);
        sweep_axis(sorted[axis], n, axis, best);
    }
    memcpy(items + r->first, sorted[best->axis], n * sizeof(items[0]));
    return r->first + (uint32_t)best->bin;
}

static uint32_t split_in_half(const umb_bvh_item *items, const range *r, choice *best)
{
    uint32_t middle = r->first + (r->end - r->first) / 2;
    best->left = empty_box;
    best->right = empty_box;
    for (uint32_t k = r->first; k < r->end; ++k) {
        box_grow(k < middle ? &best->left : &best->right, items[k].min, items[k].max);
    }
    return middle;
}

/* Order the items of a range of two or more and return where its right half begins. */
static uint32_t split_range(umb_bvh_item *items, const range *r, choice *best)
{
    best->cost = INFINITY;
    best->balance = 0;
    if (r->end - r->first <= SWEEP_ITEMS) {
        return split_by_sweep(items, r, best);
    }
    if (r->depth < HALVE_DEPTH) {
        bins b;
        box4 centres = empty_box;
        grow_centres(&centres, items, r->first, r->end);
        start_bins(&b, &centres);
        fill_bins(&b, items, r->first, r->end);
        if (choose_bins(&b, best)) {
            uint32_t middle = r->first, end = r->end;
            (void)partition(&b, items, &middle, &end, best, UINT32_MAX);
            return middle;
        }
    }
    return split_in_half(items, r, best);
}

/* ---- recursion ------------------------------------------------------------------------------ */

static INLINE umb_bvh_split *enter_split(build *b, const range *r, uint32_t middle, const choice *best, range halves[2])
{
    umb_bvh_split *s = &b->splits[middle];
    range left = {r->first, middle, r->depth + 1, &s->left, best->left};
    range right = {middle, r->end, r->depth + 1, &s->right, best->right};
    halves[0] = left;
    halves[1] = right;
    *r->link = middle;
    return s;
}

static umb_bvh_split *split_node(build *b, const range *r, range halves[2])
{
    choice best;
    uint32_t middle = split_range(b->items, r, &best);
    return enter_split(b, r, middle, &best, halves);
}

static umb_cut split_all(build *b, const range *r)
{
    if (r->end - r->first == 1) {
        umb_cut item = {{0}};
        *r->link = r->first | UMB_BVH_ITEM;
        return item;
    }
    range halves[2];
    umb_bvh_split *s = split_node(b, r, halves);
    umb_cut left = split_all(b, &halves[0]);
    umb_cut right = split_all(b, &halves[1]);
    return umb_cut_split(&b->costs, s, umb_half_area(r->box.min, r->box.max), &left, &right);
}

typedef struct task {
    range range;
    umb_cut cut;
} task;

static void run_task(void *data, uint32_t i)
{
    build *b = data;
    b->tasks[i].cut = split_all(b, &b->tasks[i].range);
}

/* Split large ranges here and gather the others as tasks, from left to right. */
static bool split_top(build *b, const range *r)
{
    if (r->end - r->first <= b->task_items) {
        if (!umb_memory_reserve(b->allocator, (void **)&b->tasks, &b->task_capacity,
                                (size_t)b->task_count + 1, sizeof(b->tasks[0]))) {
            return false;
        }
        b->tasks[b->task_count++].range = *r;
        return true;
    }
    range halves[2];
    split_node(b, r, halves);
    return split_top(b, &halves[0]) && split_top(b, &halves[1]);
}

/* The cuts of the splits that split_top made, by the same walk; *next counts the tasks met. */
static umb_cut cut_top(build *b, uint32_t node, uint32_t first, uint32_t end, uint32_t *next, box4 *box)
{
    if (end - first <= b->task_items) {
        const task *t = &b->tasks[(*next)++];
        *box = t->range.box;
        return t->cut;
    }
    umb_bvh_split *s = &b->splits[node];
    box4 right_box;
    umb_cut left = cut_top(b, s->left, first, node, next, box);
    umb_cut right = cut_top(b, s->right, node, end, next, &right_box);
    box_grow(box, right_box.min, right_box.max);
    return umb_cut_split(&b->costs, s, umb_half_area(box->min, box->max), &left, &right);
}

umb_result umb_bvh_split_items(const umb_allocator *a, const umb_tasks *tasks, umb_bvh_item *items,
                               uint32_t count, umb_bvh_split *splits, uint32_t *root)
{
    build b = {.items = items, .splits = splits, .task_items = TASK_ITEMS, .allocator = a};
    range all = {0, count, 0, root, empty_box};
    for (uint32_t i = 0; i < count; ++i) {
        box_grow(&all.box, items[i].min, items[i].max);
    }
    b.costs = umb_cut_costs_of(umb_half_area(all.box.min, all.box.max), count);
    umb_result result = UMB_ERROR_MEMORY;
    if (split_top(&b, &all)) {
        uint32_t next = 0;
        box4 box;
        umb_tasks_run(tasks, run_task, &b, b.task_count);
        cut_top(&b, *root, 0, count, &next, &box);
        result = UMB_OK;
    }
    umb_memory_free(a, b.tasks, b.task_capacity * sizeof(b.tasks[0]));
    return result;
}

/* Splits alone, as split_all() makes them: what is below the first level of a range is small as a rule. */
static void split_plainly(build *b, const range *r)
{
    if (r->end - r->first == 1) {
        *r->link = r->first | UMB_BVH_ITEM;
        return;
    }
    range halves[2];
    split_node(b, r, halves);
    split_plainly(b, &halves[0]);
    split_plainly(b, &halves[1]);
}

uint32_t umb_bvh_split_run(umb_bvh_item *items, uint32_t first, uint32_t end, umb_bvh_split *splits)
{
    build b = {.items = items, .splits = splits};
    uint32_t root;
    range all = {first, end, 0, &root, empty_box};
    split_plainly(&b, &all);
    return root;
}

/* ---- in steps ------------------------------------------------------------------------------- */

uint32_t umb_bvh_split_at_once(umb_bvh_item *items, uint32_t count, umb_bvh_split *splits)
{
    build b = {.items = items, .splits = splits};
    uint32_t root;
    range all = {0, count, 0, &root, empty_box};
    for (uint32_t i = 0; i < count; ++i) {
        box_grow(&all.box, items[i].min, items[i].max);
    }
    b.costs = umb_cut_costs_of(umb_half_area(all.box.min, all.box.max), count);
    split_all(&b, &all);
    return root;
}

/* A range of more items than SMALL is split in several steps of at most STEP_ITEMS, a smaller one in one. */
#define STEP_ITEMS 4096u
#define SMALL 256u
/* What an item costs in each kind of step, in about nanoseconds; of a small range, in all its levels. */
#define BOX_COST 4
#define CENTRE_COST 3
#define BIN_COST 16
#define PARTITION_COST 16
#define SMALL_COST 330

typedef enum step_kind {
    STEP_BOX, /* of all items */
    STEP_NEXT,
    STEP_CENTRES,
    STEP_BINS,
    STEP_PARTITION
} step_kind;

struct umb_bvh_steps {
    build build;
    range *waiting; /* the leftmost last */
    size_t capacity;
    uint32_t waiting_count, count, root;
    step_kind kind;  /* of the next step, in: */
    range range;
    uint32_t at, end; /* items of it that have been looked at come before; of a partition: the rest comes from end on */
    box4 centres;
    bins bins;
    choice best;
};

umb_bvh_steps *umb_bvh_steps_create(const umb_allocator *a)
{
    return umb_memory_allocate_zero(a, 1, sizeof(umb_bvh_steps));
}

void umb_bvh_steps_destroy(umb_bvh_steps *steps, const umb_allocator *a)
{
    if (steps != NULL) {
        umb_memory_free(a, steps->waiting, steps->capacity * sizeof(steps->waiting[0]));
        umb_memory_free(a, steps->build.tasks, steps->build.task_capacity * sizeof(steps->build.tasks[0]));
        umb_memory_free(a, steps, sizeof(*steps));
    }
}

size_t umb_bvh_steps_memory(const umb_bvh_steps *steps)
{
    return sizeof(*steps) + steps->capacity * sizeof(steps->waiting[0]) +
           steps->build.task_capacity * sizeof(steps->build.tasks[0]);
}

bool umb_bvh_steps_reserve(umb_bvh_steps *steps, const umb_allocator *a, uint32_t count)
{
    build *b = &steps->build;
    size_t tasks = count / (SMALL / 8) + 8;
    return umb_memory_reserve(a, (void **)&steps->waiting, &steps->capacity, tasks, sizeof(steps->waiting[0])) &&
           umb_memory_reserve(a, (void **)&b->tasks, &b->task_capacity, tasks, sizeof(b->tasks[0]));
}

void umb_bvh_steps_start(umb_bvh_steps *steps, umb_bvh_item *items, uint32_t count, umb_bvh_split *splits)
{
    build *b = &steps->build;
    *b = (build){.items = items, .splits = splits, .task_items = SMALL, .tasks = b->tasks, .task_capacity = b->task_capacity};
    steps->count = count;
    steps->waiting_count = 0;
    steps->range = (range){0, count, 0, &steps->root, empty_box};
    steps->kind = STEP_BOX;
    steps->at = 0;
}

/* The next items of the range; the cursor goes behind them. */
static uint32_t take_items(umb_bvh_steps *steps)
{
    uint32_t from = steps->at, left = steps->range.end - from;
    steps->at += left < STEP_ITEMS ? left : STEP_ITEMS;
    return from;
}

/* What is left to do with all items looked at in one way, begins with the first one again in the next. */
static void go_on(umb_bvh_steps *steps, step_kind kind)
{
    steps->kind = kind;
    steps->at = steps->range.first;
}

static uint32_t step_box(umb_bvh_steps *steps)
{
    range *r = &steps->range;
    uint32_t from = take_items(steps);
    for (uint32_t k = from; k < steps->at; ++k) {
        box_grow(&r->box, steps->build.items[k].min, steps->build.items[k].max);
    }
    uint32_t cost = BOX_COST * (steps->at - from);
    if (steps->at == r->end) {
        steps->build.costs = umb_cut_costs_of(umb_half_area(r->box.min, r->box.max), steps->count);
        steps->waiting[steps->waiting_count++] = *r;
        steps->kind = STEP_NEXT;
    }
    return cost;
}

/* The range has been split: its halves wait. */
static void leave_range(umb_bvh_steps *steps, range halves[2])
{
    steps->waiting[steps->waiting_count++] = halves[1];
    steps->waiting[steps->waiting_count++] = halves[0];
    steps->kind = STEP_NEXT;
}

/* Without bins: what is left is halved. */
static uint32_t step_half(umb_bvh_steps *steps)
{
    range halves[2], *r = &steps->range;
    uint32_t middle = split_in_half(steps->build.items, r, &steps->best);
    enter_split(&steps->build, r, middle, &steps->best, halves);
    leave_range(steps, halves);
    return BOX_COST * (r->end - r->first);
}

static uint32_t step_next(umb_bvh_steps *steps)
{
    build *b = &steps->build;
    range *r = &steps->range;
    *r = steps->waiting[--steps->waiting_count];
    uint32_t count = r->end - r->first;
    if (count <= SMALL) {
        b->tasks[b->task_count].range = *r;
        run_task(b, b->task_count++);
        return SMALL_COST * count;
    }
    if (r->depth >= HALVE_DEPTH) {
        return step_half(steps);
    }
    steps->centres = empty_box;
    go_on(steps, STEP_CENTRES);
    return 1;
}

static uint32_t step_centres(umb_bvh_steps *steps)
{
    uint32_t from = take_items(steps), cost = CENTRE_COST * (steps->at - from);
    grow_centres(&steps->centres, steps->build.items, from, steps->at);
    if (steps->at == steps->range.end) {
        start_bins(&steps->bins, &steps->centres);
        go_on(steps, STEP_BINS);
    }
    return cost;
}

static uint32_t step_bins(umb_bvh_steps *steps)
{
    uint32_t from = take_items(steps), cost = BIN_COST * (steps->at - from);
    fill_bins(&steps->bins, steps->build.items, from, steps->at);
    if (steps->at == steps->range.end) {
        steps->best = (choice){.cost = INFINITY};
        if (!choose_bins(&steps->bins, &steps->best)) {
            return cost + step_half(steps);
        }
        go_on(steps, STEP_PARTITION);
        steps->end = steps->range.end;
    }
    return cost;
}

static uint32_t step_partition(umb_bvh_steps *steps)
{
    uint32_t left = steps->end - steps->at;
    if (partition(&steps->bins, steps->build.items, &steps->at, &steps->end, &steps->best, STEP_ITEMS / 8)) {
        range halves[2];
        enter_split(&steps->build, &steps->range, steps->at, &steps->best, halves);
        leave_range(steps, halves);
    }
    return PARTITION_COST * (left - (steps->end - steps->at)) + 1;
}

uint32_t umb_bvh_steps_run(umb_bvh_steps *steps, const umb_allocator *a)
{
    build *b = &steps->build;
    if (!umb_memory_reserve(a, (void **)&steps->waiting, &steps->capacity, (size_t)steps->waiting_count + 2,
                            sizeof(steps->waiting[0])) ||
        !umb_memory_reserve(a, (void **)&b->tasks, &b->task_capacity, (size_t)b->task_count + 1,
                            sizeof(b->tasks[0]))) {
        return UMB_NONE;
    }
    switch (steps->kind) {
    case STEP_BOX:
        return step_box(steps);
    case STEP_CENTRES:
        return step_centres(steps);
    case STEP_BINS:
        return step_bins(steps);
    case STEP_PARTITION:
        return step_partition(steps);
    default:
        return steps->waiting_count > 0 ? step_next(steps) : 0;
    }
}

uint32_t umb_bvh_steps_finish(umb_bvh_steps *steps)
{
    uint32_t next = 0;
    box4 box;
    cut_top(&steps->build, steps->root, 0, steps->count, &next, &box);
    return steps->root;
}

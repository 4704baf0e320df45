/* BSP trees (Gummerus 3.6). Planes go through triangles, or through faces of boxes where nothing but a box is known. What a
 * plane cuts is cut, or is in both halves as a whole. What lies in the plane is below it, or stays with the node: between
 * the halves, seen from either side. */
#include "bsp.h"

#include <math.h>
#include <string.h>

#include "base/sort.h"
#include "bsp_piece.h"
#include "cut.h"
#include "geometry/transform.h"

/* Cells with pieces of no more items are leaves. */
#define LEAF_ITEMS 4
/* How many planes are tried, fewer in cells of few pieces, which are most cells; and on how many of a cell's pieces. */
#define TRIES 12
#define FEW_TRIES 5
#define FEW_PIECES 64
#define SAMPLE 256
/* A cut costs as much as a difference of so many pieces between the halves (Abrash). */
#define CUT_COST 8.0
/* The pieces that there may be beyond those at first, in units of their count; each cell has a share. */
#define MOST_EXTRA 2

typedef struct bsp {
    umb_cells cells;
    umb_bsp_pool pool;
    const umb_index_def *def;
    const umb_committed *scene;
    umb_bsp_piece *stack; /* as cells.stack, of pieces */
    uint8_t *sides;       /* of the pieces of one cell */
    uint64_t *words, *scratch;
    size_t top, capacity, side_capacity, word_capacity, scratch_capacity;
    uint32_t most_depth;
} bsp;

typedef struct cell {
    umb_cell_run run; /* of pieces */
    uint32_t depth;
    uint64_t extra;
} cell;

static inline float lower(float a, float b)
{
    return a < b ? a : b;
}

static inline float higher(float a, float b)
{
    return a > b ? a : b;
}

/* ---- pieces --------------------------------------------------------------------------------- */

static bool reserve_pieces(bsp *b, size_t count)
{
    const umb_allocator *a = b->cells.allocator;
    bool ok = umb_memory_reserve(a, (void **)&b->stack, &b->capacity, count, sizeof(b->stack[0])) &&
              umb_memory_reserve(a, (void **)&b->sides, &b->side_capacity, count, 1) &&
              umb_memory_reserve(a, (void **)&b->words, &b->word_capacity, count, sizeof(b->words[0])) &&
              umb_memory_reserve(a, (void **)&b->scratch, &b->scratch_capacity, count, sizeof(b->scratch[0]));
    b->cells.failed = b->cells.failed || !ok;
    return ok;
}

static umb_aabb box_of_triangle(const umb_bsp_shape *t)
{
    umb_aabb box;
    for (int i = 0; i < 3; ++i) {
        box.min[i] = lower(t->corners[0][i], lower(t->corners[1][i], t->corners[2][i]));
        box.max[i] = higher(t->corners[0][i], higher(t->corners[1][i], t->corners[2][i]));
    }
    return box;
}

/* Where an item's triangles are; NULL: only its box is known. */
static const umb_mesh *mesh_of(const bsp *b, uint32_t ref, const umb_transform **transform, uint32_t *count)
{
    uint32_t number = ref & UMB_REF_NUMBER;
    if ((ref & UMB_REF_KIND) == UMB_REF_OCCLUDER) {
        const umb_occluder *o = &b->scene->occluders[number];
        *transform = o->identity ? NULL : &o->transform;
        *count = o->mesh->triangle_count;
        return o->mesh;
    }
    const umb_object *o = &b->scene->objects[number];
    *transform = o->identity ? NULL : &o->transform;
    *count = o->refine ? o->mesh->seen_count : 0;
    return *count > 0 ? o->mesh : NULL;
}

static bool add_triangles(bsp *b, uint32_t ref, const umb_mesh *mesh, const umb_transform *transform, uint32_t count)
{
    umb_bsp_pool *pool = &b->pool;
    if (pool->triangle_count + (uint64_t)count >= UMB_BVH_ITEM || !reserve_pieces(b, b->top + count) ||
        !umb_memory_reserve(pool->allocator, (void **)&pool->triangles, &pool->triangle_capacity,
                            (size_t)pool->triangle_count + count, sizeof(pool->triangles[0]))) {
        return false;
    }
    for (uint32_t t = 0; t < count; ++t) {
        umb_bsp_shape *shape = &pool->triangles[pool->triangle_count];
        for (int k = 0; k < 3; ++k) {
            const float *p = mesh->positions[mesh->triangles[t][k]];
            if (transform == NULL) {
                memcpy(shape->corners[k], p, sizeof(shape->corners[k]));
            } else {
                umb_transform_point(transform, p, shape->corners[k]);
            }
        }
        b->stack[b->top++] = (umb_bsp_piece){box_of_triangle(shape), ref, pool->triangle_count++, UMB_NONE};
    }
    return true;
}

static bool add_items(bsp *b, const umb_bvh_item *items, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        const umb_transform *transform;
        uint32_t triangles;
        const umb_mesh *mesh = mesh_of(b, items[i].ref, &transform, &triangles);
        if (mesh != NULL) {
            if (!add_triangles(b, items[i].ref, mesh, transform, triangles)) {
                return false;
            }
            continue;
        }
        if (!reserve_pieces(b, b->top + 1)) {
            return false;
        }
        umb_bsp_piece *piece = &b->stack[b->top++];
        *piece = (umb_bsp_piece){.ref = items[i].ref, .triangle = UMB_NONE, .outline = UMB_NONE};
        memcpy(piece->box.min, items[i].min, sizeof(piece->box.min));
        memcpy(piece->box.max, items[i].max, sizeof(piece->box.max));
    }
    return true;
}

/* ---- leaves --------------------------------------------------------------------------------- */

/* All pieces of an item in a leaf are one part. */
static uint32_t add_leaf(bsp *b, umb_cell_run run)
{
    umb_bsp_piece *pieces = b->stack + run.first;
    umb_cell_run parts = {b->cells.top, 0};
    for (uint32_t i = 0; i < run.count; ++i) {
        b->words[i] = (uint64_t)pieces[i].ref << 32 | i;
    }
    const uint64_t *sorted = umb_sort_words(b->words, b->scratch, run.count);
    umb_bvh_item part = {.ref = UMB_NONE};
    for (uint32_t i = 0; i < run.count; ++i) {
        const umb_bsp_piece *piece = &pieces[(uint32_t)sorted[i]];
        if (piece->ref == part.ref) {
            for (int k = 0; k < 3; ++k) {
                part.min[k] = lower(part.min[k], piece->box.min[k]);
                part.max[k] = higher(part.max[k], piece->box.max[k]);
            }
            continue;
        }
        if (i > 0) {
            umb_cells_push(&b->cells, &part);
        }
        part.ref = piece->ref;
        memcpy(part.min, piece->box.min, sizeof(piece->box.min));
        memcpy(part.max, piece->box.max, sizeof(piece->box.max));
    }
    if (run.count > 0) {
        umb_cells_push(&b->cells, &part);
    }
    parts.count = (uint32_t)(b->cells.top - parts.first);
    uint32_t subtree = umb_cells_add_leaf(&b->cells, parts);
    b->cells.top = parts.first;
    return subtree;
}

/* True if pieces are of few items only. */
static bool few_items(const bsp *b, umb_cell_run run)
{
    uint32_t seen[LEAF_ITEMS], count = 0;
    for (uint32_t i = 0; i < run.count; ++i) {
        uint32_t k = 0, ref = b->stack[run.first + i].ref;
        while (k < count && seen[k] != ref) {
            ++k;
        }
        if (k == count && count == LEAF_ITEMS) {
            return false;
        }
        seen[k] = ref;
        count += k == count;
    }
    return true;
}

/* ---- choosing a plane ----------------------------------------------------------------------- */

static uint32_t scramble(uint32_t x)
{
    x ^= x >> 16;
    x *= 0x7FEB352Du;
    x ^= x >> 15;
    x *= 0x846CA68Bu;
    return x ^ x >> 16;
}

/* The plane of a piece; of a box one of its faces. */
static umb_bsp_plane plane_of(const bsp *b, const umb_bsp_piece *piece, uint32_t dice)
{
    if (piece->triangle != UMB_NONE) {
        return umb_bsp_piece_plane(&b->pool, piece->triangle);
    }
    int axis = (int)(dice % 3);
    float at = (dice / 3) % 2 == 0 ? piece->box.min[axis] : piece->box.max[axis];
    return (umb_bsp_plane){.axis = axis, .at = at, .triangle = UMB_NONE};
}

static double size_of(const bsp *b, const umb_bsp_piece *piece)
{
    if (piece->triangle == UMB_NONE) {
        return umb_half_area(piece->box.min, piece->box.max);
    }
    const float(*c)[3] = b->pool.triangles[piece->triangle].corners;
    double u[3], v[3], sum = 0.0;
    for (int i = 0; i < 3; ++i) {
        u[i] = (double)c[1][i] - c[0][i];
        v[i] = (double)c[2][i] - c[0][i];
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3;
        sum += (u[i] * v[j] - u[j] * v[i]) * (u[i] * v[j] - u[j] * v[i]);
    }
    return 0.5 * sqrt(sum);
}

static uint32_t tries_of(const cell *c)
{
    return c->run.count < FEW_PIECES ? FEW_TRIES : TRIES;
}

/* Large ones first: they are cut least if their planes come first. */
static uint32_t find_largest(const bsp *b, const cell *c, uint32_t out[TRIES])
{
    double size[TRIES];
    uint32_t n = 0, most = tries_of(c);
    for (uint32_t i = 0; i < c->run.count; ++i) {
        double own = size_of(b, &b->stack[c->run.first + i]);
        if (n == most && !(own > size[n - 1])) {
            continue;
        }
        uint32_t at = n < most ? n++ : n - 1;
        for (; at > 0 && size[at - 1] < own; --at) {
            size[at] = size[at - 1];
            out[at] = out[at - 1];
        }
        size[at] = own;
        out[at] = i;
    }
    return n;
}

static uint32_t find_random(const cell *c, uint32_t out[TRIES])
{
    for (uint32_t k = 0; k < tries_of(c); ++k) {
        out[k] = scramble(c->depth * TRIES + k + scramble(c->run.count)) % c->run.count;
    }
    return tries_of(c);
}

/* What a plane does to a cell's pieces. */
typedef struct division {
    uint32_t below, above, both, in;
    umb_aabb box[2];
} division;

static void grow(umb_aabb *box, const umb_aabb *by)
{
    for (int i = 0; i < 3; ++i) {
        box->min[i] = lower(box->min[i], by->min[i]);
        box->max[i] = higher(box->max[i], by->max[i]);
    }
}

static division divide(const bsp *b, const cell *c, const umb_bsp_plane *p, uint32_t step)
{
    const umb_aabb nothing = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    division d = {.box = {nothing, nothing}};
    for (uint32_t i = 0; i < c->run.count; i += step) {
        const umb_bsp_piece *piece = &b->stack[c->run.first + i];
        uint32_t sides = umb_bsp_piece_sides_about(&b->pool, piece, p);
        d.below += sides == UMB_BSP_BELOW;
        d.above += sides == UMB_BSP_ABOVE;
        d.both += sides == (UMB_BSP_BELOW | UMB_BSP_ABOVE);
        d.in += sides == 0;
        if (sides != UMB_BSP_ABOVE) {
            grow(&d.box[0], &piece->box);
        }
        if ((sides & UMB_BSP_ABOVE) != 0) {
            grow(&d.box[1], &piece->box);
        }
    }
    return d;
}

/* INFINITY: it does not divide them. */
static double cost_of(const bsp *b, const division *d)
{
    uint32_t low = d->below + d->both + d->in, high = d->above + d->both, all = d->below + d->above + d->both + d->in;
    if (low == all || high == all || high == 0) {
        return INFINITY;
    }
    if (b->def->rule == UMB_RULE_NAYLOR) {
        return umb_half_area(d->box[0].min, d->box[0].max) * low + umb_half_area(d->box[1].min, d->box[1].max) * high;
    }
    return CUT_COST * d->both + fabs((double)d->below - d->above);
}

static bool choose(const bsp *b, const cell *c, umb_bsp_plane *best)
{
    uint32_t tried[TRIES], step = c->run.count / SAMPLE + 1;
    uint32_t n = b->def->rule == UMB_RULE_NAYLOR ? find_largest(b, c, tried) : find_random(c, tried);
    double least = INFINITY;
    for (uint32_t k = 0; k < n; ++k) {
        umb_bsp_plane p = plane_of(b, &b->stack[c->run.first + tried[k]], scramble(c->depth + k));
        division d = divide(b, c, &p, step);
        double cost = cost_of(b, &d);
        if (cost < least) {
            least = cost;
            *best = p;
        }
    }
    return !isinf(least);
}

/* ---- recursion ------------------------------------------------------------------------------ */

static void swap(umb_bsp_piece *a, umb_bsp_piece *b)
{
    umb_bsp_piece t = *a;
    *a = *b;
    *b = t;
}

/* How a run is sorted: below, both, in the plane, above. */
static uint32_t rank(uint32_t sides)
{
    static const uint8_t ranks[4] = {2, 0, 3, 1};
    return ranks[sides];
}

/* Sort a cell's pieces by their sides; counts by rank. */
static void sort_pieces(bsp *b, const cell *c, const umb_bsp_plane *p, uint32_t counts[4])
{
    umb_bsp_piece *pieces = b->stack + c->run.first;
    memset(counts, 0, 4 * sizeof(counts[0]));
    for (uint32_t i = 0; i < c->run.count; ++i) {
        b->sides[i] = (uint8_t)rank(umb_bsp_piece_sides(&b->pool, &pieces[i], p));
        ++counts[b->sides[i]];
    }
    uint32_t next[4] = {0, counts[0], counts[0] + counts[1], counts[0] + counts[1] + counts[2]}, end[4];
    for (uint32_t r = 0; r < 4; ++r) {
        end[r] = next[r] + counts[r];
    }
    for (uint32_t r = 0; r < 4; ++r) {
        while (next[r] < end[r]) {
            uint32_t own = b->sides[next[r]], to = next[own]++;
            if (own != r) {
                swap(&pieces[next[r]], &pieces[to]);
                b->sides[next[r]] = b->sides[to];
                b->sides[to] = (uint8_t)own;
            }
        }
    }
}

/* The pieces above go to the top of the stack, those below stay; what is cut goes to both. */
static bool part_pieces(bsp *b, const cell *c, const umb_bsp_plane *p, const uint32_t counts[4], umb_cell_run *upper)
{
    bool cut = (b->def->options & UMB_INDEX_SPLIT) != 0;
    *upper = (umb_cell_run){b->top, counts[1] + counts[3]};
    if (!reserve_pieces(b, b->top + upper->count)) {
        return false;
    }
    umb_bsp_piece *pieces = b->stack + c->run.first, *out = b->stack + upper->first;
    for (uint32_t i = 0; i < counts[1]; ++i) {
        umb_bsp_piece whole = pieces[counts[0] + i];
        if (!umb_bsp_piece_cut(&b->pool, &whole, p, UMB_BSP_ABOVE, cut, &out[i]) ||
            !umb_bsp_piece_cut(&b->pool, &whole, p, UMB_BSP_BELOW, cut, &pieces[counts[0] + i])) {
            b->cells.failed = true;
            return false;
        }
    }
    memcpy(out + counts[1], pieces + c->run.count - counts[3], counts[3] * sizeof(out[0]));
    b->top += upper->count;
    return true;
}

static umb_cell_cut cut_of(bsp *b, const umb_bsp_plane *p)
{
    umb_cell_cut cut = {.axis = (uint8_t)p->axis, .at = p->at};
    if (p->axis == (int)UMB_ORDER_TILTED) {
        cut.number = umb_cells_add_plane(&b->cells, (const float(*)[3])b->pool.triangles[p->triangle].corners);
    }
    return cut;
}

static uint32_t build(bsp *b, const cell *c);

/* Below, in the plane, above: seen from below in this order, from above in the opposite one. So two splits by
 * the same plane keep what is in it between them. */
static uint32_t build_halves(bsp *b, const cell *c, const umb_bsp_plane *p)
{
    size_t top = b->top;
    uint32_t counts[4];
    cell lower = {{c->run.first, 0}, c->depth + 1, 0}, upper = lower;
    sort_pieces(b, c, p, counts);
    bool kept = (b->def->options & UMB_INDEX_NODES) != 0;
    umb_cell_run in = {c->run.first + counts[0] + counts[1], kept ? counts[2] : 0};
    if (counts[1] > c->extra) {
        return add_leaf(b, c->run);
    }
    if (!part_pieces(b, c, p, counts, &upper.run)) {
        return UMB_NONE;
    }
    lower.run.count = counts[0] + counts[1] + (kept ? 0 : counts[2]);
    lower.extra = umb_cells_share(c->extra - counts[1], lower.run, upper.run);
    upper.extra = c->extra - counts[1] - lower.extra;
    umb_cell_cut cut = cut_of(b, p);
    uint32_t left = build(b, &lower), middle = b->cells.count;
    uint32_t between = in.count > 0 ? add_leaf(b, in) : UMB_NONE, second = b->cells.count;
    memmove(b->stack + c->run.first, b->stack + upper.run.first, upper.run.count * sizeof(b->stack[0]));
    upper.run.first = c->run.first;
    b->top = top;
    uint32_t right = build(b, &upper);
    right = umb_cells_join(&b->cells, between, second, right, &cut);
    return umb_cells_join(&b->cells, left, middle, right, &cut);
}

static uint32_t build(bsp *b, const cell *c)
{
    umb_bsp_plane p;
    if (c->run.count == 0 || b->cells.failed) {
        return UMB_NONE;
    }
    if (c->depth >= b->most_depth || few_items(b, c->run) || !choose(b, c, &p)) {
        return add_leaf(b, c->run);
    }
    return build_halves(b, c, &p);
}

umb_result umb_bsp_build(const umb_allocator *a, const umb_index_def *def, const umb_committed *scene,
                         const umb_bvh_item *items, uint32_t count, umb_built *out)
{
    bsp b = {.def = def, .scene = scene, .pool = {.allocator = a}};
    umb_result result = UMB_ERROR_MEMORY;
    umb_cells_start(&b.cells, a, NULL, 0);
    *out = (umb_built){0};
    if (add_items(&b, items, count)) {
        uint32_t pieces = (uint32_t)b.top;
        cell all = {{0, pieces}, 0, (uint64_t)MOST_EXTRA * pieces};
        b.most_depth = 16 + 3 * (32u - (uint32_t)__builtin_clz(pieces)) / 2;
        uint32_t root = build(&b, &all);
        result = umb_cells_finish(&b.cells, root, out);
    }
    umb_memory_free(a, b.stack, b.capacity * sizeof(b.stack[0]));
    umb_memory_free(a, b.sides, b.side_capacity);
    umb_memory_free(a, b.words, b.word_capacity * sizeof(b.words[0]));
    umb_memory_free(a, b.scratch, b.scratch_capacity * sizeof(b.scratch[0]));
    umb_bsp_pool_free(&b.pool);
    umb_cells_free(&b.cells);
    return result;
}

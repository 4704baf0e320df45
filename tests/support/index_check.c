#include "index_check.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/transform.h"
#include "random_boxes.h"
#include "scene/mask.h"

/* ---- parts ---------------------------------------------------------------------------------- */

static bool box_holds(const umb_aabb *b, const float p[3])
{
    return b->min[0] <= p[0] && p[0] <= b->max[0] && b->min[1] <= p[1] && p[1] <= b->max[1] && b->min[2] <= p[2] &&
           p[2] <= b->max[2];
}

static void check_padding(const umb_tree *t, const umb_node *n)
{
    umb_aabb first = index_slot_box(n, 0);
    assert_int_equal((uintptr_t)n % 64, 0);
    assert_in_range(n->count, 1, UMB_NODE_WIDTH);
    for (uint32_t s = n->count; s < UMB_NODE_WIDTH; ++s) {
        umb_aabb b = index_slot_box(n, s);
        assert_memory_equal(&b, &first, sizeof(b));
        assert_true(n->ref[s] == UMB_NONE || t->several);
    }
}

/* All slots that name items, by item: objects, then occluders. */
typedef struct part {
    uint32_t item, next; /* of the same item */
    umb_aabb box;
} part;

typedef struct parts {
    part *list;
    uint32_t *first; /* per item */
    uint32_t count, items;
} parts;

static void add_part(parts *p, uint32_t item, const umb_aabb *box)
{
    p->list[p->count] = (part){item, p->first[item], *box};
    p->first[item] = p->count++;
}

/* Every node once, children behind parents, boxes of nodes those of what they hold, empty slots as they should be. */
static uint32_t gather_parts(const umb_tree *t, const umb_committed *c, uint32_t number, parts *out)
{
    const umb_node *n = &t->nodes[number];
    uint32_t nodes = 1;
    for (uint32_t s = 0; s < n->count; ++s) {
        uint32_t ref = n->ref[s], what = ref & UMB_REF_NUMBER;
        umb_aabb box = index_slot_box(n, s);
        if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
            assert_true(what > number && what < t->node_count);
            assert_true(t->nodes[what].parent == number && t->nodes[what].slot == s);
            umb_aabb below = umb_node_bounds(&t->nodes[what]);
            assert_memory_equal(&box, &below, sizeof(box));
            nodes += gather_parts(t, c, what, out);
            assert_true((t->nodes[what].layers & ~n->layers) == 0);
        } else {
            uint32_t mask = (ref & UMB_REF_KIND) == UMB_REF_OBJECT ? c->objects[what].mask : c->occluder_masks[what];
            assert_true((umb_layers_of(mask) & ~n->layers) == 0);
            assert_true(out->count < t->item_count);
            add_part(out, (ref & UMB_REF_KIND) == UMB_REF_OBJECT ? what : c->object_count + what, &box);
        }
    }
    check_padding(t, n);
    return nodes;
}

static float pick_between(uint64_t *seed, float low, float high)
{
    double at = low + random_in(seed, 0, 1) * ((double)high - low);
    uint32_t how = random_below(seed, 4);
    return how == 0 ? low : how == 1 ? high : (float)at < low ? low : (float)at > high ? high : (float)at;
}

/* A corner of an object's or occluder's world triangle. */
void index_world_corner(const umb_mesh *mesh, const umb_transform *t, bool identity, uint32_t at, float out[3])
{
    const float *p = mesh->positions[at];
    if (identity) {
        memcpy(out, p, 3 * sizeof(out[0]));
    } else {
        umb_transform_point(t, p, out);
    }
}

static void random_weights(uint64_t *seed, long double w[3])
{
    w[0] = random_below(seed, 4) == 0 ? 0 : random_in(seed, 0, 1);
    w[1] = random_below(seed, 4) == 0 ? 0 : random_in(seed, 0, 1 - (double)w[0]);
    w[2] = 1 - w[0] - w[1];
}

/* A point of a triangle of an item (objects, then occluders). False if only its box is known. */
bool index_point_of_item(const umb_committed *c, uint32_t item, uint64_t *seed, long double out[3])
{
    bool object = item < c->object_count;
    const umb_object *o = &c->objects[object ? item : 0];
    const umb_occluder *k = object ? NULL : &c->occluders[item - c->object_count];
    const umb_mesh *mesh = object ? (o->refine ? o->mesh : NULL) : k->mesh;
    if (mesh == NULL) {
        return false;
    }
    uint32_t t = random_below(seed, object ? mesh->seen_count : mesh->triangle_count);
    long double w[3];
    float corner[3][3];
    random_weights(seed, w);
    for (int i = 0; i < 3; ++i) {
        index_world_corner(mesh, object ? &o->transform : &k->transform, object ? o->identity : k->identity,
                     mesh->triangles[t][i], corner[i]);
    }
    for (int a = 0; a < 3; ++a) {
        out[a] = w[0] * corner[0][a] + w[1] * corner[1][a] + w[2] * corner[2][a];
    }
    return true;
}

static void check_triangles(const parts *p, const umb_committed *c, uint32_t item, uint64_t *seed)
{
    for (int trial = 0; trial < 12; ++trial) {
        long double at[3];
        bool held = false;
        assert_true(index_point_of_item(c, item, seed, at));
        for (uint32_t k = p->first[item]; k != UMB_NONE; k = p->list[k].next) {
            const umb_aabb *b = &p->list[k].box;
            bool in = true;
            for (int i = 0; i < 3; ++i) {
                long double slack = 1e-17L * (1 + fabsl(at[i])); /* what at itself is rounded by */
                in = in && at[i] >= b->min[i] - slack && at[i] <= b->max[i] + slack;
            }
            held = held || in;
        }
        assert_true(held);
    }
}

/* Parts lie in their item, and every point of the item in one of them. */
static void check_item(const parts *p, uint32_t item, const umb_aabb *whole, bool exact, uint64_t *seed)
{
    assert_true(p->first[item] != UMB_NONE);
    for (uint32_t k = p->first[item]; k != UMB_NONE; k = p->list[k].next) {
        assert_true(box_holds(whole, p->list[k].box.min) && box_holds(whole, p->list[k].box.max));
    }
    for (int trial = 0; trial < 12 && exact; ++trial) {
        float at[3];
        bool held = false;
        for (int i = 0; i < 3; ++i) {
            at[i] = pick_between(seed, whole->min[i], whole->max[i]);
        }
        for (uint32_t k = p->first[item]; k != UMB_NONE; k = p->list[k].next) {
            held = held || box_holds(&p->list[k].box, at);
        }
        assert_true(held);
    }
}

/* ---- lists ---------------------------------------------------------------------------------- */

static uint64_t mix(uint32_t object)
{
    return (object + 1u) * 0x9E3779B97F4A7C15u;
}

/* The objects below a node are those of its range, in any order: as many, with the same sum. A range may be
 * stale, and where objects have parts hold some that have left. */
typedef struct listing {
    const umb_tree *tree;
    uint32_t *stamps, stamp; /* of each object, the last node in whose range it was found */
    uint32_t count;          /* of objects below so far */
} listing;

static uint64_t check_ranges(listing *l, uint32_t number)
{
    const umb_tree *t = l->tree;
    const umb_node *n = &t->nodes[number];
    umb_range range = t->below[number];
    uint64_t sum = 0, listed = 0;
    uint32_t before = l->count, mark = ++l->stamp;
    bool stale = range.count == UMB_RANGE_STALE;
    for (uint32_t i = 0; i < range.count && !stale; ++i) {
        l->stamps[t->objects[range.first + i]] = mark;
        listed += mix(t->objects[range.first + i]);
    }
    for (uint32_t s = 0; s < n->count && !stale; ++s) {
        if ((n->ref[s] & UMB_REF_KIND) == UMB_REF_OBJECT) {
            assert_true(l->stamps[n->ref[s] & UMB_REF_NUMBER] == mark);
        }
    }
    for (uint32_t s = 0; s < n->count; ++s) {
        uint32_t what = n->ref[s] & UMB_REF_NUMBER;
        if ((n->ref[s] & UMB_REF_KIND) == UMB_REF_NODE) {
            umb_range in = t->below[what];
            bool known = !stale && in.count != UMB_RANGE_STALE;
            assert_true(!known || (in.first >= range.first && in.first + in.count <= range.first + range.count));
            sum += check_ranges(l, what);
        } else if ((n->ref[s] & UMB_REF_KIND) == UMB_REF_OBJECT) {
            sum += mix(what);
            l->count += 1;
        }
    }
    assert_true(stale || t->several || (listed == sum && range.count == l->count - before));
    return sum;
}

/* Each block holds the boxes of the next eight rows or blocks, and its range is theirs together. */
static void check_blocks(const umb_tree *t)
{
    uint32_t next = 0;
    for (uint32_t k = 0; k < t->block_count; ++k) {
        const umb_node *block = &t->blocks[k];
        umb_range range = t->below[t->node_count + k];
        check_padding(t, block);
        for (uint32_t s = 0; s < block->count; ++s, ++next) {
            assert_true(next < t->node_count + k);
            assert_int_equal(block->ref[s], UMB_REF_NODE | next);
            umb_aabb box = index_slot_box(block, s), below = umb_node_bounds(umb_tree_node(t, next));
            assert_memory_equal(&box, &below, sizeof(box));
            assert_int_equal(t->below[next].first, range.first);
            range.first += t->below[next].count;
            range.count -= t->below[next].count;
        }
        assert_int_equal(range.count, 0);
    }
    assert_int_equal(next, t->flat && t->node_count > 0 ? t->node_count + t->block_count - 1 : 0);
}

/* ---- all of it ------------------------------------------------------------------------------ */

/* Every node that is in use and every list. Returns the count of nodes. */
static uint32_t check_nodes(const umb_tree *t, const umb_committed *c, parts *p)
{
    listing l = {.tree = t, .stamps = calloc((size_t)c->object_count + 1, sizeof(l.stamps[0]))};
    uint32_t nodes = 0, unused = 0;
    assert_non_null(l.stamps);
    for (uint32_t k = 0; k < t->node_count; ++k) {
        unused += t->nodes[k].count == 0;
        if (t->nodes[k].count > 0 && t->nodes[k].parent == UMB_NONE) {
            assert_true(t->flat || k == 0);
            nodes += gather_parts(t, c, k, p);
            check_ranges(&l, k);
        }
    }
    check_blocks(t);
    assert_int_equal(nodes + unused, t->node_count);
    free(l.stamps);
    return nodes;
}

/* An item of the scene, with its box: there if it should be, in one slot or in parts. bsp: a tree of triangles. */
static void check_there(const umb_tree *t, const parts *p, const umb_committed *c, uint32_t item, bool bsp, uint64_t *seed)
{
    bool object = item < c->object_count;
    const umb_object *o = &c->objects[object ? item : 0];
    const umb_aabb *box = object ? &o->bounds : &c->occluders[item - c->object_count].bounds;
    bool shape = bsp && (!object || (o->refine && o->mesh != NULL));
    check_item(p, item, box, !shape, seed);
    assert_true(box_holds(&t->bounds, box->min) && box_holds(&t->bounds, box->max));
    if (shape) {
        check_triangles(p, c, item, seed);
    }
    if (!t->several) {
        const part *only = &p->list[p->first[item]];
        assert_int_equal(only->next, UMB_NONE);
        assert_memory_equal(&only->box, box, sizeof *box);
    }
}

void index_check(const umb_index *index)
{
    const umb_tree *t = umb_index_tree(index);
    const umb_committed *c = umb_scene_committed(umb_index_scene(index));
    bool bsp = umb_index_settings(index).kind == UMB_INDEX_BSP;
    uint64_t seed = 5;
    parts p = {.items = c->object_count + c->occluder_count};
    uint32_t items = 0;
    p.list = malloc(((size_t)t->item_count + 1) * sizeof(p.list[0]));
    p.first = malloc(((size_t)p.items + 1) * sizeof(p.first[0]));
    assert_true(p.list != NULL && p.first != NULL);
    memset(p.first, 0xFF, ((size_t)p.items + 1) * sizeof(p.first[0]));
    assert_true(t->version == c->version);
    uint32_t nodes = check_nodes(t, c, &p);
    assert_true(t->several ? p.count <= t->item_count : p.count == t->item_count);
    for (uint32_t i = 0; i < p.items; ++i) {
        bool there = i < c->object_count ? c->objects[i].live : i - c->object_count >= c->first_free_occluder;
        assert_true(there || p.first[i] == UMB_NONE);
        if (there) {
            check_there(t, &p, c, i, bsp, &seed);
            ++items;
        }
    }
    umb_index_stats stats;
    umb_index_get_stats(index, &stats);
    assert_true(stats.items == items && stats.nodes == nodes && (stats.depth == 0) == (items == 0));
    assert_true(stats.slots >= items && (stats.slots > items) == t->several && stats.cost >= 0.0 && isfinite(stats.cost));
    assert_true(stats.slots <= 8 * items + 64 && stats.depth < 120);
    free(p.list);
    free(p.first);
}

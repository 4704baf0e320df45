/* Every way to build an index: parts that hold their items, exact front-to-back order against brute force, frustum
 * answers that lie between the exact one and the flat one, motion, captures, failing allocations. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/transform.h"
#include "index/bvh.h"
#include "index/walk.h"
#include "support/box_meets.h"
#include "support/failing.h"
#include "support/random_boxes.h"
#include "umbrage/umbrage.h"

enum { REACH = 100 };

/* ---- scenes --------------------------------------------------------------------------------- */

enum { SPREAD, CROWDED, EQUAL, POINTS, COLLINEAR, NESTED, GEOMETRIC, SHEETS, ABSURD, SETS };

static umb_aabb box_of_set(uint64_t *seed, int set, uint32_t i)
{
    static const double origin[3] = {0, 0, 0};
    umb_aabb b = {{1, 2, 3}, {1, 2, 3}};
    switch (set) {
    case SPREAD:
        return random_box(seed, origin, REACH / 2.0);
    case CROWDED: /* small boxes in clusters */
        for (int a = 0; a < 3; ++a) {
            double at = 10.0 * (double)(random_below(seed, 4) * random_below(seed, 5)) + random_in(seed, 0, 3);
            b.min[a] = (float)at;
            b.max[a] = (float)(at + random_in(seed, 0, 1));
        }
        return b;
    case EQUAL:
        b.max[0] = 4;
        b.max[1] = 5;
        return b;
    case POINTS:
        return b;
    case COLLINEAR:
        b.min[0] = b.max[0] = (float)i;
        return b;
    case NESTED:
        for (int a = 0; a < 3; ++a) {
            b.min[a] = -(float)ldexp(1.0, (int)(i % 100) - 50);
            b.max[a] = -b.min[a];
        }
        return b;
    case GEOMETRIC:
        b.min[i % 3] = b.max[i % 3] = (float)ldexp(1.0, (int)(i / 3 % 250) - 125);
        return b;
    case SHEETS: /* walls of a lattice: faces that coincide */
        for (int a = 0; a < 3; ++a) {
            b.min[a] = (float)random_below(seed, 8);
            b.max[a] = b.min[a] + ((int)(i % 3) == a ? 0.0f : (float)(1 + random_below(seed, 3)));
        }
        return b;
    default:
        return absurd_box(seed);
    }
}

static void add_shape(umb_scene *scene, umb_shape *shape)
{
    static const float corners[12] = {0, 0, 0, 5, 0, 0, 0, 5, 0, 0, 0, 5};
    static const uint32_t sides[12] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};
    umb_shape_def def = {.positions = corners, .position_count = 4, .indices = sides, .index_count = 12};
    assert_int_equal(umb_scene_add_shape(scene, &def, shape), UMB_OK);
}

static umb_transform random_place(uint64_t *seed)
{
    umb_transform t = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    for (int a = 0; a < 3; ++a) {
        t.m[a][3] = (float)random_in(seed, -REACH, REACH);
    }
    return t;
}

/* Every fifth object is a shape's, every ninth id is free; some occluders stand alone. */
static umb_scene *make_scene(uint64_t seed, int set, uint32_t count, const umb_allocator *allocator)
{
    umb_scene *scene;
    umb_scene_def scene_def = {.allocator = allocator != NULL ? *allocator : (umb_allocator){0}};
    umb_shape shape;
    assert_int_equal(umb_scene_create(&scene_def, &scene), UMB_OK);
    add_shape(scene, &shape);
    for (uint32_t i = 0; i < count; ++i) {
        umb_object_def def = {.bounds = box_of_set(&seed, set, i)};
        uint32_t id;
        if (set == SPREAD && i % 5 == 0) {
            def = (umb_object_def){.shape = shape, .transform = random_place(&seed), .flags = UMB_OBJECT_IS_SHAPE};
        }
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
        if (set == SPREAD && i % 11 == 3) {
            umb_transform t = random_place(&seed);
            assert_int_equal(umb_scene_add_occluder(scene, shape, &t, &id), UMB_OK);
        }
    }
    for (uint32_t i = 4; i < count && count > 20; i += 9) {
        assert_int_equal(umb_scene_remove_object(scene, i), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    return scene;
}

static umb_index *make_index(umb_scene *scene, const char *name)
{
    umb_index_def def = {0};
    umb_index *index;
    assert_true(umb_index_parse(name, &def));
    assert_int_equal(umb_index_create(scene, &def, &index), UMB_OK);
    return index;
}

/* ---- structure ------------------------------------------------------------------------------ */

static umb_aabb slot_box(const umb_node *n, uint32_t s)
{
    umb_aabb b;
    for (int i = 0; i < 3; ++i) {
        b.min[i] = n->min[i][s];
        b.max[i] = n->max[i][s];
    }
    return b;
}

static bool box_holds(const umb_aabb *b, const float p[3])
{
    return b->min[0] <= p[0] && p[0] <= b->max[0] && b->min[1] <= p[1] && p[1] <= b->max[1] && b->min[2] <= p[2] &&
           p[2] <= b->max[2];
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
    assert_in_range(n->count, 1, UMB_NODE_WIDTH);
    for (uint32_t s = 0; s < n->count; ++s) {
        uint32_t ref = n->ref[s], what = ref & UMB_REF_NUMBER;
        umb_aabb box = slot_box(n, s);
        if ((ref & UMB_REF_KIND) == UMB_REF_NODE) {
            assert_true(what > number && what < t->node_count);
            assert_true(t->nodes[what].parent == number && t->nodes[what].slot == s);
            umb_aabb below = umb_node_bounds(&t->nodes[what]);
            assert_memory_equal(&box, &below, sizeof(box));
            nodes += gather_parts(t, c, what, out);
        } else {
            assert_true(out->count < t->item_count);
            add_part(out, (ref & UMB_REF_KIND) == UMB_REF_OBJECT ? what : c->object_count + what, &box);
        }
    }
    umb_aabb first = slot_box(n, 0);
    for (uint32_t s = n->count; s < UMB_NODE_WIDTH; ++s) {
        umb_aabb b = slot_box(n, s);
        assert_memory_equal(&b, &first, sizeof(b));
        assert_true(t->nodes[number].ref[s] == UMB_NONE || t->several);
    }
    return nodes;
}

static float pick_between(uint64_t *seed, float low, float high)
{
    double at = low + random_in(seed, 0, 1) * ((double)high - low);
    uint32_t how = random_below(seed, 4);
    return how == 0 ? low : how == 1 ? high : (float)at < low ? low : (float)at > high ? high : (float)at;
}

/* A corner of an object's or occluder's world triangle. */
static void world_corner(const umb_mesh *mesh, const umb_transform *t, bool identity, uint32_t at, float out[3])
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
static bool point_of_item(const umb_committed *c, uint32_t item, uint64_t *seed, long double out[3])
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
        world_corner(mesh, object ? &o->transform : &k->transform, object ? o->identity : k->identity,
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
        assert_true(point_of_item(c, item, seed, at));
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

/* What is below a node is in its range. */
static void check_range(const umb_tree *t, uint32_t number, uint32_t *stamps, uint32_t *stamp)
{
    const umb_node *n = &t->nodes[number];
    uint32_t mark = ++*stamp;
    bool stale = t->below[number].count == UMB_RANGE_STALE;
    for (uint32_t i = 0; i < t->below[number].count && !stale; ++i) {
        stamps[t->objects[t->below[number].first + i]] = mark;
    }
    for (uint32_t s = 0; s < n->count && !stale; ++s) {
        if ((n->ref[s] & UMB_REF_KIND) == UMB_REF_OBJECT) {
            assert_true(stamps[n->ref[s] & UMB_REF_NUMBER] == mark);
        }
    }
    for (uint32_t s = 0; s < n->count; ++s) {
        if ((n->ref[s] & UMB_REF_KIND) == UMB_REF_NODE) {
            umb_range in = t->below[n->ref[s]], all = t->below[number];
            bool known = !stale && in.count != UMB_RANGE_STALE;
            assert_true(!known || (in.first >= all.first && in.first + in.count <= all.first + all.count));
            check_range(t, n->ref[s], stamps, stamp);
        }
    }
}

static void check_index(const umb_index *index)
{
    const umb_tree *t = umb_index_tree(index);
    const umb_committed *c = umb_scene_committed(umb_index_scene(index));
    uint64_t seed = 5;
    parts p = {.items = c->object_count + c->occluder_count};
    p.list = malloc(((size_t)t->item_count + 1) * sizeof(p.list[0]));
    p.first = malloc(((size_t)p.items + 1) * sizeof(p.first[0]));
    uint32_t *stamps = calloc((size_t)c->object_count + 1, sizeof(stamps[0])), stamp = 0, items = 0, nodes = 0;
    assert_true(p.list != NULL && p.first != NULL && stamps != NULL);
    memset(p.first, 0xFF, ((size_t)p.items + 1) * sizeof(p.first[0]));
    assert_true(t->version == c->version);
    for (uint32_t k = 0; k < t->node_count; ++k) {
        if (t->nodes[k].count == 0) { /* a free number */
            ++nodes;
        } else if (t->nodes[k].parent == UMB_NONE) {
            assert_true(t->flat || k == 0);
            nodes += gather_parts(t, c, k, &p);
            check_range(t, k, stamps, &stamp);
        }
    }
    bool shapes = umb_index_settings(index).kind == UMB_INDEX_BSP; /* are taken as triangles */
    assert_int_equal(nodes, t->node_count);
    assert_true(t->several ? p.count <= t->item_count : p.count == t->item_count);
    for (uint32_t i = 0; i < c->object_count; ++i) {
        assert_true(c->objects[i].live || p.first[i] == UMB_NONE);
        if (c->objects[i].live) {
            bool shape = shapes && c->objects[i].refine && c->objects[i].mesh != NULL;
            check_item(&p, i, &c->objects[i].bounds, !shape, &seed);
            if (shape) {
                check_triangles(&p, c, i, &seed);
            }
            ++items;
        }
    }
    for (uint32_t i = 0; i < c->occluder_count; ++i) {
        assert_true(i >= c->first_free_occluder || p.first[c->object_count + i] == UMB_NONE);
        if (i >= c->first_free_occluder) {
            check_item(&p, c->object_count + i, &c->occluders[i].bounds, !shapes, &seed);
            if (shapes) {
                check_triangles(&p, c, c->object_count + i, &seed);
            }
            ++items;
        }
    }
    umb_index_stats stats;
    umb_index_get_stats(index, &stats);
    assert_int_equal(stats.items, items);
    assert_true(stats.slots >= items && (stats.slots > items) == t->several && isfinite(stats.cost));
    assert_true(stats.slots <= 8 * items + 64 && stats.depth < 120);
    free(p.list);
    free(p.first);
    free(stamps);
}

static void test_all_sets(void **state)
{
    (void)state;
    static const uint32_t counts[] = {0, 1, 2, 7, 9, 33, 300, 3000};
    for (int set = 0; set < SETS; ++set) {
        for (size_t i = 0; i < sizeof(counts) / sizeof(counts[0]); ++i) {
            umb_scene *scene = make_scene(71, set, counts[i], NULL);
            const char *name;
            for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
                umb_index *index = make_index(scene, name);
                check_index(index);
                umb_index_destroy(index);
            }
            umb_scene_destroy(scene);
        }
    }
}

static void test_names(void **state)
{
    (void)state;
    const char *name;
    umb_index_def def = {0};
    for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
        assert_true(umb_index_parse(name, &def));
        assert_string_equal(umb_index_name(&def), name);
    }
    assert_true(umb_index_parse("kdtree", &def) && def.kind == UMB_INDEX_KDTREE && def.rule == UMB_RULE_DEFAULT);
    static const char *const bad[] = {"", ",", "bvh,", "kd", "kdtree,", "kdtree,mad", "kdtree,median,median",
                                      "median", "flat,median", "kdtree;median", "kdtree,media,n", "bvhh"};
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); ++i) {
        assert_false(umb_index_parse(bad[i], &def));
    }
    assert_true(def.kind == UMB_INDEX_KDTREE);
}

/* ---- order ---------------------------------------------------------------------------------- */

typedef struct met {
    umb_aabb box;
    uint32_t before;
} met;

typedef struct journey {
    const umb_tree *tree;
    met *list;
    uint32_t count;
} journey;

static bool note(void *user, uint32_t node, uint32_t slot, uint32_t before)
{
    journey *j = user;
    const umb_node *n = &j->tree->nodes[node];
    if ((n->ref[slot] & UMB_REF_KIND) != UMB_REF_NODE) {
        assert_true(j->count < j->tree->item_count);
        j->list[j->count++] = (met){slot_box(n, slot), before};
    }
    return true;
}

/* True if the open box meets the way from a point back to the eye. */
static bool stands_before(const umb_aabb *box, const long double p[3], const umb_walk_eye *eye)
{
    long double from = 0, to = eye->parallel ? INFINITY : 1;
    for (int i = 0; i < 3; ++i) {
        long double step = eye->parallel ? eye->at[i] : eye->at[i] - p[i];
        long double a = (box->min[i] - p[i]) / step, b = (box->max[i] - p[i]) / step;
        if (step == 0) {
            a = p[i] > box->min[i] && p[i] < box->max[i] ? -INFINITY : INFINITY;
            b = -a;
        } else if (a > b) {
            long double t = a;
            a = b;
            b = t;
        }
        from = a > from ? a : from;
        to = b < to ? b : to;
    }
    return to - from > 1e-12L * (1 + fabsl(to));
}

static umb_walk_eye random_eye(uint64_t *seed)
{
    umb_walk_eye eye = {.parallel = random_below(seed, 4) == 0};
    uint32_t how = random_below(seed, 3);
    for (int i = 0; i < 3; ++i) {
        eye.at[i] = how == 0 ? (double)random_below(seed, 12) - 2 : random_in(seed, -1.5 * REACH, 1.5 * REACH);
    }
    if (eye.parallel && eye.at[0] == 0 && eye.at[1] == 0) {
        eye.at[0] = 1;
    }
    return eye;
}

static void check_order(const umb_tree *t, uint64_t *seed, uint64_t *pairs)
{
    umb_walk_eye eye = random_eye(seed);
    journey j = {.tree = t, .list = malloc((t->item_count + 1) * sizeof(met))};
    umb_walk_visitor visitor = {note, &j};
    assert_non_null(j.list);
    bool strict = umb_walk_front_to_back(t, &eye, &visitor);
    assert_int_equal(strict, t->orders != NULL);
    assert_true(j.count == t->item_count || t->several);
    for (uint32_t a = 0; a < j.count && strict; ++a) {
        const met *m = &j.list[a];
        for (int trial = 0; trial < 2; ++trial) {
            long double p[3];
            for (int i = 0; i < 3; ++i) {
                p[i] = m->box.min[i] + random_in(seed, 0, 1) * ((long double)m->box.max[i] - m->box.min[i]);
            }
            for (uint32_t b = 0; b < j.count; ++b) {
                if (j.list[b].before > m->before) {
                    *pairs += 1;
                    assert_false(stands_before(&j.list[b].box, p, &eye));
                }
            }
        }
    }
    free(j.list);
}

/* The batches of slots, as a walk meets them. */
typedef struct ledger {
    uint32_t *before; /* per node and slot */
} ledger;

static bool enter(void *user, uint32_t node, uint32_t slot, uint32_t before)
{
    ledger *l = user;
    l->before[node * UMB_NODE_WIDTH + slot] = before;
    return true;
}

/* A walk in units, as a list with the number of the unit in `before`. */
typedef struct units {
    journey list;
    ledger cells;
    uint32_t *batches; /* beside the list: of the slots, in a walk of single nodes */
    uint32_t count, largest;
} units;

static void note_unit(void *user, const umb_walk_slot *slots, uint32_t count, bool *open)
{
    units *u = user;
    assert_true(count > 0);
    for (uint32_t k = 0; k < count; ++k) {
        assert_true(open[k]);
        u->batches[u->list.count] = u->cells.before[slots[k].node * UMB_NODE_WIDTH + slots[k].slot];
        note(&u->list, slots[k].node, slots[k].slot, u->count);
    }
    u->largest = count > u->largest ? count : u->largest;
    u->count += 1;
}

/* No later unit hides an earlier one, but for what may be in one cell; all parts are in some unit. */
static uint32_t check_units(const umb_tree *t, uint64_t *seed, uint64_t *pairs)
{
    size_t most = umb_walk_unit_slots(t);
    umb_walk_eye eye = random_eye(seed);
    units u = {.list = {.tree = t, .list = malloc((t->item_count + 1) * sizeof(met))}};
    umb_walk_unit_visitor visitor = {note_unit, &u, malloc(most * sizeof(umb_walk_slot)), malloc(most * sizeof(bool))};
    umb_walk_visitor by_node = {enter, &u.cells};
    u.cells.before = malloc(most * sizeof(uint32_t));
    u.batches = malloc(((size_t)t->item_count + 1) * sizeof(uint32_t));
    assert_true(u.list.list != NULL && visitor.room != NULL && visitor.open != NULL && u.cells.before != NULL &&
                u.batches != NULL);
    umb_walk_front_to_back(t, &eye, &by_node);
    bool strict = umb_walk_units(t, &eye, &visitor);
    assert_true(u.list.count == t->item_count || t->several);
    for (uint32_t a = 0; a < u.list.count && strict; ++a) {
        const met *m = &u.list.list[a];
        long double p[3];
        for (int i = 0; i < 3; ++i) {
            p[i] = m->box.min[i] + random_in(seed, 0, 1) * ((long double)m->box.max[i] - m->box.min[i]);
        }
        for (uint32_t b = a + 1; b < u.list.count; ++b) {
            if (u.list.list[b].before > m->before && u.batches[a] != u.batches[b]) {
                *pairs += 1;
                assert_false(stands_before(&u.list.list[b].box, p, &eye));
            }
        }
    }
    free(u.list.list);
    free(u.cells.before);
    free(u.batches);
    free(visitor.room);
    free(visitor.open);
    return u.largest;
}

/* No later batch hides an earlier one. */
static void test_order(void **state)
{
    (void)state;
    static const int sets[] = {SPREAD, CROWDED, SHEETS, NESTED, COLLINEAR};
    uint64_t seed = 72, pairs = 0;
    const char *name;
    for (size_t i = 0; i < sizeof(sets) / sizeof(sets[0]); ++i) {
        umb_scene *scene = make_scene(73, sets[i], 150, NULL);
        for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
            umb_index *index = make_index(scene, name);
            bool tilted = umb_index_settings(index).kind == UMB_INDEX_BSP && sets[i] == SPREAD; /* test_rays() */
            for (int trial = 0; trial < 12 && !tilted; ++trial) {
                check_order(umb_index_tree(index), &seed, &pairs);
                if (umb_index_settings(index).kind != UMB_INDEX_FLAT) {
                    check_units(umb_index_tree(index), &seed, &pairs);
                }
            }
            umb_index_destroy(index);
        }
        umb_scene_destroy(scene);
    }
    assert_true(pairs > 1000000);
}

/* On which side of a split a point lies: 1 above, -1 below, 0 too close to say. */
static int point_side(const umb_tree *t, const umb_order *o, uint32_t split, const long double p[3])
{
    long double h;
    if (o->axis[split] != UMB_ORDER_TILTED) {
        h = p[o->axis[split]] - o->at[split];
    } else {
        const float(*c)[3] = t->planes[o->number[split]].points;
        long double u[3], v[3], d[3], length = 0;
        h = 0;
        for (int i = 0; i < 3; ++i) {
            u[i] = (long double)c[1][i] - c[0][i];
            v[i] = (long double)c[2][i] - c[0][i];
            d[i] = p[i] - c[0][i];
        }
        for (int i = 0; i < 3; ++i) {
            int j = (i + 1) % 3, k = (i + 2) % 3;
            long double n = u[j] * v[k] - u[k] * v[j];
            h += n * d[i];
            length += n * n;
        }
        h /= sqrtl(length);
    }
    return h > 1e-9L ? 1 : h < -1e-9L ? -1 : 0;
}

/* The slots of the cell that a point is in, from a node down: true if the item is among them; *batch is its. */
static bool find_cell(const umb_tree *t, uint32_t number, const long double p[3], uint32_t ref, const ledger *l,
                      uint32_t *batch, bool *sure)
{
    const umb_node *n = &t->nodes[number];
    const umb_order *o = &t->orders[number];
    uint32_t from = 0, end = n->count, split = o->kind == UMB_ORDER_PLANES ? 0 : UMB_ORDER_END;
    while (split != UMB_ORDER_END) {
        int side = point_side(t, o, split, p);
        *sure = *sure && side != 0;
        from = side > 0 ? o->middle[split] : from;
        end = side > 0 ? end : o->middle[split];
        split = o->next[split][side > 0];
    }
    for (uint32_t s = from; s < end; ++s) {
        if (n->ref[s] == ref) {
            *batch = l->before[number * UMB_NODE_WIDTH + s];
            return true;
        }
        if ((n->ref[s] & UMB_REF_KIND) == UMB_REF_NODE && find_cell(t, n->ref[s], p, ref, l, batch, sure)) {
            return true;
        }
    }
    return false;
}

/* Where a ray meets the triangle of an object that has one: its distance, or -1. */
static long double meet(const umb_object *o, const double eye[3], const double d[3], long double p[3])
{
    float c[3][3];
    long double u[3], v[3], w[3], n[3], away = 0, along = 0;
    for (int k = 0; k < 3; ++k) {
        world_corner(o->mesh, &o->transform, o->identity, o->mesh->triangles[0][k], c[k]);
    }
    for (int i = 0; i < 3; ++i) {
        u[i] = (long double)c[1][i] - c[0][i];
        v[i] = (long double)c[2][i] - c[0][i];
    }
    for (int i = 0; i < 3; ++i) {
        n[i] = u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3];
        away += n[i] * (c[0][i] - (long double)eye[i]);
        along += n[i] * d[i];
    }
    if (along == 0 || away / along <= 0) {
        return -1;
    }
    for (int i = 0; i < 3; ++i) {
        p[i] = eye[i] + away / along * d[i];
        w[i] = p[i] - c[0][i];
    }
    int a = fabsl(n[0]) > fabsl(n[1]) ? (fabsl(n[0]) > fabsl(n[2]) ? 0 : 2) : (fabsl(n[1]) > fabsl(n[2]) ? 1 : 2);
    int i = (a + 1) % 3, j = (a + 2) % 3;
    long double s = (w[i] * v[j] - w[j] * v[i]) / n[a], r = (u[i] * w[j] - u[j] * w[i]) / n[a];
    return s > 1e-6L && r > 1e-6L && s + r < 1 - 1e-6L ? away / along : -1;
}

static umb_scene *make_triangles(uint64_t *seed, uint32_t count)
{
    umb_scene *scene;
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    for (uint32_t i = 0; i < count; ++i) {
        static const uint32_t sides[3] = {0, 1, 2};
        float corners[9];
        for (int k = 0; k < 9; ++k) { /* some stand along axes, or share a plane */
            corners[k] = random_below(seed, 3) == 0 ? (float)random_below(seed, 5) * 10 - 20
                                                    : (float)random_in(seed, -30, 30);
        }
        if (i % 3 == 0) {
            corners[i % 9 / 3 + 3] = corners[i % 9 / 3 + 6] = corners[i % 9 / 3];
        }
        umb_shape_def shape_def = {.positions = corners, .position_count = 3, .indices = sides, .index_count = 3};
        umb_object_def def = {.flags = UMB_OBJECT_IS_SHAPE};
        uint32_t id;
        assert_int_equal(umb_scene_add_shape(scene, &shape_def, &def.shape), UMB_OK);
        def.transform = (umb_transform){{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
        assert_int_equal(umb_scene_add_object(scene, &def, &id), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    return scene;
}

/* All that a ray meets, in the order of the tree's batches: never a nearer thing in a later one. */
static uint64_t check_ray(const umb_tree *t, const umb_committed *c, const umb_walk_eye *eye, const double d[3],
                          const ledger *l)
{
    long double place[128];
    uint32_t batch[128], count = 0;
    uint64_t pairs = 0;
    for (uint32_t i = 0; i < c->object_count && count < 128; ++i) {
        long double p[3], away = meet(&c->objects[i], eye->at, d, p);
        bool sure = true;
        if (away > 0) {
            bool found = find_cell(t, 0, p, UMB_REF_OBJECT | i, l, &batch[count], &sure);
            assert_true(found || !sure);
            place[count] = away;
            count += found && sure;
        }
    }
    for (uint32_t a = 0; a < count; ++a) {
        for (uint32_t b = 0; b < count; ++b) {
            assert_false(place[a] < place[b] && batch[a] > batch[b]);
            pairs += batch[a] != batch[b];
        }
    }
    return pairs;
}

/* Trees with planes of any slope, against rays through triangles. */
static void test_rays(void **state)
{
    (void)state;
    uint64_t seed = 81, pairs = 0;
    for (int round = 0; round < 6; ++round) {
        umb_scene *scene = make_triangles(&seed, 20 + 20 * (uint32_t)round);
        const char *name;
        for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
            umb_index *index = make_index(scene, name);
            const umb_tree *t = umb_index_tree(index);
            ledger l = {malloc((t->node_count + (size_t)1) * UMB_NODE_WIDTH * sizeof(uint32_t))};
            umb_walk_visitor visitor = {enter, &l};
            assert_non_null(l.before);
            check_index(index);
            for (int trial = 0; trial < 20 && umb_index_settings(index).kind == UMB_INDEX_BSP; ++trial) {
                umb_walk_eye eye = {{random_in(&seed, -40, 40), random_in(&seed, -40, 40), random_in(&seed, -40, 40)},
                                    false};
                assert_true(umb_walk_front_to_back(t, &eye, &visitor));
                for (int ray = 0; ray < 50; ++ray) {
                    double d[3];
                    for (int i = 0; i < 3; ++i) {
                        d[i] = random_in(&seed, -20, 20) - eye.at[i];
                    }
                    pairs += check_ray(t, umb_scene_committed(scene), &eye, d, &l);
                }
            }
            free(l.before);
            umb_index_destroy(index);
        }
        umb_scene_destroy(scene);
    }
    assert_true(pairs > 10000);
}

/* ---- frusta --------------------------------------------------------------------------------- */

typedef struct crew {
    umb_index *index;
    umb_culler *sorted, *unordered;
    umb_error error;
} crew;

static void make_crew(umb_scene *scene, const char *name, crew *out)
{
    out->index = make_index(scene, name);
    umb_culler_def def = {.method = UMB_METHOD_NONE, .error = &out->error};
    assert_int_equal(umb_culler_create(out->index, &def, &out->sorted), UMB_OK);
    def.unordered = true;
    assert_int_equal(umb_culler_create(out->index, &def, &out->unordered), UMB_OK);
}

static void free_crew(crew *c)
{
    umb_culler_destroy(c->sorted);
    umb_culler_destroy(c->unordered);
    umb_index_destroy(c->index);
}

/* By what the index knows of the object: its box, or in BSP trees its triangles, of which some points are tried. */
static bool surely_meets(const umb_scene *scene, const crew *c, const umb_view *v, uint32_t id)
{
    umb_aabb box;
    half_space h[UMB_FRUSTUM_PLANES + 6];
    long double at[3];
    uint64_t seed = 80 + id;
    const umb_committed *now = umb_scene_committed(scene);
    assert_true(umb_scene_object_bounds(scene, id, &box));
    if (umb_index_settings(c->index).kind != UMB_INDEX_BSP || !point_of_item(now, id, &seed, at)) {
        return box_surely_meets(v, &box, 1e-7L * REACH);
    }
    uint32_t n = half_spaces_of(v, &box, h);
    for (int trial = 0; trial < 100; ++trial) {
        bool in = point_of_item(now, id, &seed, at);
        for (uint32_t k = 0; k < n - 6 && in; ++k) {
            in = half_space_at(&h[k], at) > 1e-7L * REACH;
        }
        if (in) {
            return true;
        }
    }
    return false;
}

/* An index' answer is the flat one's, in its order and with its flags, but for objects that surely do not meet the
 * frustum. The unordered one may leave out others of these. */
static void check_answer(const umb_scene *scene, crew *c, const umb_view *v, const umb_visible_set *flat,
                         uint64_t *left_out)
{
    umb_visible_set seen;
    assert_int_equal(umb_cull(c->sorted, v, &seen), UMB_OK);
    uint32_t at = 0;
    uint8_t *found = calloc((size_t)umb_scene_object_count(scene) + 1, 1);
    assert_non_null(found);
    for (uint32_t i = 0; i < flat->count; ++i) {
        found[flat->objects[i]] = 1;
        if (at < seen.count && seen.objects[at] == flat->objects[i]) {
            assert_int_equal(seen.inside[at], flat->inside[i]);
            ++at;
        } else {
            assert_false(surely_meets(scene, c, v, flat->objects[i]));
            found[flat->objects[i]] = 2;
            *left_out += 1;
        }
    }
    assert_int_equal(at, seen.count);
    assert_int_equal(seen.stats.visible, seen.count);
    assert_int_equal(seen.stats.in_frustum, seen.count + seen.stats.small);
    assert_int_equal(umb_cull(c->unordered, v, &seen), UMB_OK);
    for (uint32_t i = 0; i < seen.count; ++i) {
        assert_true(found[seen.objects[i]] == 1 || found[seen.objects[i]] == 2);
        found[seen.objects[i]] = 3;
    }
    for (uint32_t i = 0; i < umb_scene_object_count(scene); ++i) {
        assert_true(found[i] != 1 || !surely_meets(scene, c, v, i));
    }
    free(found);
}

static void move_some(umb_scene *scene, uint64_t *seed, uint32_t count, bool far)
{
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t id = random_below(seed, umb_scene_object_count(scene));
        umb_aabb box;
        if (!umb_scene_object_bounds(scene, id, &box)) {
            continue;
        }
        umb_transform t = random_place(seed);
        if (!far) {
            for (int a = 0; a < 3; ++a) {
                float step = (float)random_in(seed, -1, 1);
                box.min[a] += step;
                box.max[a] += step;
                t.m[a][3] = box.min[a];
            }
        } else {
            box = box_of_set(seed, SPREAD, 0);
        }
        if (id % 5 == 0) {
            (void)umb_scene_move_object(scene, id, &t, NULL);
        } else {
            (void)umb_scene_move_object(scene, id, NULL, &box);
        }
    }
}

static void check_frusta(int set, int rounds, bool moves)
{
    enum { MOST = 64 };
    uint64_t seed = 74 + (uint64_t)set, left_out = 0;
    umb_scene *scene = make_scene(75, set, 700, NULL);
    crew flat, crews[MOST];
    uint32_t n = 0;
    make_crew(scene, "flat", &flat);
    for (; umb_index_variant(n) != NULL; ++n) {
        assert_true(n < MOST);
        make_crew(scene, umb_index_variant(n), &crews[n]);
    }
    for (int round = 0; round < rounds; ++round) {
        if (moves) {
            move_some(scene, &seed, 1 + random_below(&seed, round % 5 == 4 ? 600 : 20), random_below(&seed, 2) == 0);
            assert_int_equal(umb_scene_commit(scene), UMB_OK);
        }
        umb_view v = random_view(&seed, REACH);
        v.min_pixels = round % 4 == 3 ? random_in(&seed, 1, 200) : 0;
        umb_visible_set seen;
        assert_int_equal(umb_cull(flat.sorted, &v, &seen), UMB_OK);
        for (uint32_t k = 0; k < n; ++k) {
            check_answer(scene, &crews[k], &v, &seen, &left_out);
        }
    }
    for (uint32_t k = 0; k < n; ++k) {
        check_index(crews[k].index);
        free_crew(&crews[k]);
    }
    free_crew(&flat);
    umb_scene_destroy(scene);
    assert_true(left_out > 0 || set != SPREAD);
}

static void test_frusta(void **state)
{
    (void)state;
    static const int sets[] = {SPREAD, CROWDED, SHEETS};
    for (size_t i = 0; i < sizeof(sets) / sizeof(sets[0]); ++i) {
        check_frusta(sets[i], 60, false);
    }
}

static void test_motion(void **state)
{
    (void)state;
    check_frusta(SPREAD, 120, true);
    check_frusta(CROWDED, 60, true);
}

/* ---- captures ------------------------------------------------------------------------------- */

/* What is loaded answers to the bit as what was saved, after moves too. */
static void test_captures(void **state)
{
    (void)state;
    const char *name;
    uint64_t seed = 76;
    for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
        umb_scene *scene = make_scene(77, SPREAD, 400, NULL);
        umb_index *index = make_index(scene, name);
        umb_culler *culler;
        umb_culler_def def = {.method = k % 2 == 0 ? UMB_METHOD_RASTER : UMB_METHOD_NONE};
        assert_int_equal(umb_culler_create(index, &def, &culler), UMB_OK);
        for (int round = 0; round < 6; ++round) {
            umb_view v = random_view(&seed, REACH);
            umb_visible_set seen, again;
            assert_int_equal(umb_cull(culler, &v, &seen), UMB_OK);
            size_t size;
            assert_int_equal(umb_capture_save(culler, NULL, 0, &size), UMB_OK);
            void *bytes = malloc(size);
            assert_non_null(bytes);
            assert_int_equal(umb_capture_save(culler, bytes, size, &size), UMB_OK);
            umb_capture capture;
            umb_error error;
            assert_int_equal(umb_capture_load(bytes, size, UMB_ISA_AUTO, (umb_tasks){0}, &capture, &error), UMB_OK);
            assert_string_equal(umb_index_name(&capture.index_def), name);
            check_index(capture.index);
            assert_int_equal(umb_cull(capture.culler, &capture.view, &again), UMB_OK);
            assert_int_equal(seen.count, again.count);
            assert_memory_equal(seen.objects, again.objects, seen.count * sizeof(seen.objects[0]));
            if (def.method == UMB_METHOD_NONE) { /* fewer: lists below nodes are new in a tree that has been loaded */
                assert_true(again.stats.nodes <= seen.stats.nodes);
                again.stats.nodes = seen.stats.nodes;
            }
            assert_memory_equal(&seen.stats, &again.stats, sizeof(seen.stats));
            umb_capture_free(&capture);
            free(bytes);
            move_some(scene, &seed, 1 + random_below(&seed, 200), round % 2 == 0);
            assert_int_equal(umb_scene_commit(scene), UMB_OK);
        }
        umb_culler_destroy(culler);
        umb_index_destroy(index);
        umb_scene_destroy(scene);
    }
}

/* ---- memory --------------------------------------------------------------------------------- */

static void test_failing_allocations(void **state)
{
    (void)state;
    const char *name;
    for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
        failing f;
        umb_allocator a = failing_allocator(&f, INT64_MAX);
        umb_scene *scene = make_scene(78, SPREAD, 1500, &a);
        umb_index_def def = {0};
        umb_index *index = NULL;
        umb_culler *culler = NULL;
        umb_result result = UMB_ERROR_MEMORY;
        long long held = atomic_load(&f.held), limit = 0;
        assert_true(umb_index_parse(name, &def));
        for (; result != UMB_OK; ++limit) {
            atomic_store(&f.left, limit);
            result = umb_index_create(scene, &def, &index);
            assert_true(result == UMB_OK || (result == UMB_ERROR_MEMORY && index == NULL));
            assert_true(result == UMB_OK || atomic_load(&f.held) == held);
        }
        assert_true(limit > 2);
        check_index(index);
        atomic_store(&f.left, INT64_MAX);
        umb_culler_def culler_def = {.method = k % 2 == 0 ? UMB_METHOD_RASTER : UMB_METHOD_NONE};
        assert_int_equal(umb_culler_create(index, &culler_def, &culler), UMB_OK);
        uint64_t seed = 79;
        umb_view v = random_view(&seed, REACH);
        umb_visible_set seen;
        for (limit = 0, result = UMB_ERROR_MEMORY; result != UMB_OK; ++limit) {
            atomic_store(&f.left, limit);
            result = umb_cull(culler, &v, &seen);
            assert_true(result == UMB_OK || (result == UMB_ERROR_MEMORY && seen.count == 0));
        }
        /* A steady frame allocates nothing, whatever the view. */
        v.min_pixels = 3;
        atomic_store(&f.left, 0);
        assert_int_equal(umb_cull(culler, &v, &seen), UMB_OK);
        atomic_store(&f.left, INT64_MAX);
        umb_culler_destroy(culler);
        umb_index_destroy(index);
        assert_true(atomic_load(&f.held) == held);
        umb_scene_destroy(scene);
        assert_true(atomic_load(&f.held) == 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_names),    cmocka_unit_test(test_all_sets), cmocka_unit_test(test_order),
        cmocka_unit_test(test_rays),
        cmocka_unit_test(test_frusta),   cmocka_unit_test(test_motion),   cmocka_unit_test(test_captures),
        cmocka_unit_test(test_failing_allocations),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

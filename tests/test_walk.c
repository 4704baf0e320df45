/* Exact orders front to back, of every index that has one, against brute force: rays from points of what is found back to the eye,
 * and rays through triangles. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "index/walk.h"
#include "support/index_check.h"
#include "support/index_sets.h"

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
        j->list[j->count++] = (met){index_slot_box(n, slot), before};
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
        eye.at[i] = how == 0 ? (double)random_below(seed, 12) - 2 : random_in(seed, -1.5 * INDEX_REACH, 1.5 * INDEX_REACH);
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
    static const index_set sets[] = {INDEX_SPREAD, INDEX_CROWDED, INDEX_SHEETS, INDEX_NESTED, INDEX_COLLINEAR};
    uint32_t count = for_size(150, 150, 500), trials = for_size(8, 12, 40);
    uint64_t seed = 72, pairs = 0;
    const char *name;
    for (size_t i = 0; i < sizeof(sets) / sizeof(sets[0]); ++i) {
        umb_scene *scene = index_scene(73, sets[i], count, NULL);
        for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
            umb_index *index = index_make(scene, name);
            bool tilted = umb_index_settings(index).kind == UMB_INDEX_BSP && sets[i] == INDEX_SPREAD; /* test_rays() */
            for (uint32_t trial = 0; trial < trials && !tilted; ++trial) {
                check_order(umb_index_tree(index), &seed, &pairs);
                if (umb_index_settings(index).kind != UMB_INDEX_FLAT) {
                    check_units(umb_index_tree(index), &seed, &pairs);
                }
            }
            umb_index_destroy(index);
        }
        umb_scene_destroy(scene);
    }
    printf("# %llu pairs of parts\n", (unsigned long long)pairs);
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
        index_world_corner(o->mesh, &o->transform, o->identity, o->mesh->triangles[0][k], c[k]);
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
    for (uint32_t round = 0; round < for_size(6, 6, 20); ++round) {
        umb_scene *scene = make_triangles(&seed, 20 + 20 * round);
        const char *name;
        for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL; ++k) {
            umb_index *index = index_make(scene, name);
            const umb_tree *t = umb_index_tree(index);
            ledger l = {malloc((t->node_count + (size_t)1) * UMB_NODE_WIDTH * sizeof(uint32_t))};
            umb_walk_visitor visitor = {enter, &l};
            assert_non_null(l.before);
            index_check(index);
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
    printf("# %llu pairs of triangles on rays\n", (unsigned long long)pairs);
    assert_true(pairs > 10000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_order), cmocka_unit_test(test_rays)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Spheres and oriented boxes around nodes: they hold what is below, however the tree follows its scene; and what the
 * frustum holds is the same with them as without, to the last bit of its planes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "cull/volumes.h"
#include "support/failing.h"
#include "support/random_boxes.h"
#include "umbrage/umbrage.h"

enum { REACH = 100, COUNT = 900, MOST = 2 * COUNT };

static const char *const NAMES[] = {"bvh,spheres", "bvh,oriented", "bvh,bottom-up,spheres", "bvh,bottom-up,oriented"};

enum { KINDS = sizeof NAMES / sizeof NAMES[0] };

/* ---- what a volume holds ------------------------------------------------------------------------ */

static long double determinant(long double m[3][3])
{
    long double sum = 0;
    for (int i = 0; i < 3; ++i) {
        sum += m[0][i] * (m[1][(i + 1) % 3] * m[2][(i + 2) % 3] - m[1][(i + 2) % 3] * m[2][(i + 1) % 3]);
    }
    return sum;
}

/* True if a corner of a box is in a volume, up to what long double rounds. */
static bool holds(const umb_node_volume *v, bool sphere, const umb_aabb *b, int corner)
{
    long double d[3], axes[3][3], square = 0;
    for (int i = 0; i < 3; ++i) {
        d[i] = (long double)(corner >> i & 1 ? b->max[i] : b->min[i]) - v->place.m[i][3];
        square += d[i] * d[i];
        for (int j = 0; j < 3; ++j) {
            axes[i][j] = v->place.m[i][j];
        }
    }
    if (sphere) {
        return sqrtl(square) <= v->half[0] * (1 + 1e-17L);
    }
    bool in = true;
    for (int i = 0; i < 3; ++i) { /* its coordinate along the i-th axis, by Cramer's rule */
        long double with[3][3];
        memcpy(with, axes, sizeof with);
        for (int k = 0; k < 3; ++k) {
            with[k][i] = d[k];
        }
        in = in && fabsl(determinant(with) / determinant(axes)) <= v->half[i] * (1 + 1e-15L);
    }
    return in;
}

/* The items below a node are in its volume and in those above it. Returns how many volumes are looked at. */
static uint32_t check_below(const umb_tree *t, uint32_t number)
{
    const umb_node *n = &t->nodes[number];
    uint32_t paying = t->volumes[number].pays;
    for (uint32_t s = 0; s < n->count; ++s) {
        if ((n->ref[s] & UMB_REF_KIND) == UMB_REF_NODE) {
            paying += check_below(t, n->ref[s]);
            continue;
        }
        umb_aabb box = {{n->min[0][s], n->min[1][s], n->min[2][s]}, {n->max[0][s], n->max[1][s], n->max[2][s]}};
        for (uint32_t k = number; k != UMB_NONE; k = t->nodes[k].parent) {
            for (int corner = 0; corner < 8 && t->volumes[k].pays != 0; ++corner) {
                assert_true(holds(&t->volumes[k], t->spheres, &box, corner));
            }
        }
    }
    return paying;
}

/* ---- scenes ------------------------------------------------------------------------------------- */

/* Rods along a diagonal are what oriented boxes are for, crowds around a middle what spheres are for. */
static umb_aabb some_box(uint64_t *seed)
{
    static const double origin[3] = {0, 0, 0};
    uint32_t how = random_below(seed, 40);
    if (how == 0) {
        return absurd_box(seed);
    }
    if (how < 8) {
        return random_box(seed, origin, REACH / 4.0);
    }
    umb_aabb box;
    float along = (float)random_in(seed, -REACH, REACH);
    for (int a = 0; a < 3; ++a) {
        float middle = how % 2 == 0 ? along * (float)(a + 1) / 3.0f : 40.0f;
        box.min[a] = middle + (float)random_in(seed, -1, 1) * (how % 2 == 0 ? 0.05f : 10.0f);
        box.max[a] = box.min[a] + 0.1f;
    }
    return box;
}

typedef struct world {
    umb_scene *scene;
    bool used[MOST];
    uint64_t seed;
} world;

static void add(world *w)
{
    umb_object_def def = {.bounds = some_box(&w->seed)};
    uint32_t id;
    assert_int_equal(umb_scene_add_object(w->scene, &def, &id), UMB_OK);
    assert_true(id < MOST);
    w->used[id] = true;
}

static void set_up(world *w, uint64_t seed, uint32_t count, const umb_allocator *allocator)
{
    memset(w, 0, sizeof *w);
    w->seed = seed;
    umb_scene_def def = {.allocator = allocator != NULL ? *allocator : (umb_allocator){0}};
    assert_int_equal(umb_scene_create(&def, &w->scene), UMB_OK);
    for (uint32_t i = 0; i < count; ++i) {
        add(w);
    }
    assert_int_equal(umb_scene_commit(w->scene), UMB_OK);
}

static void edit(world *w)
{
    uint32_t id = random_below(&w->seed, COUNT), what = random_below(&w->seed, 6);
    umb_aabb box = some_box(&w->seed);
    if (!w->used[id]) {
        add(w);
    } else if (what == 0) {
        assert_int_equal(umb_scene_remove_object(w->scene, id), UMB_OK);
        w->used[id] = false;
    } else {
        assert_int_equal(umb_scene_move_object(w->scene, id, NULL, &box), UMB_OK);
    }
}

/* ---- answers ------------------------------------------------------------------------------------ */

typedef struct crew {
    umb_index *index;
    umb_culler *sorted, *unordered;
} crew;

static void make_crew(umb_scene *scene, const char *name, umb_index_update update, crew *out)
{
    umb_index_def def = {0};
    assert_true(umb_index_parse(name, &def));
    def.update = update;
    assert_int_equal(umb_index_create(scene, &def, &out->index), UMB_OK);
    umb_culler_def culler = {.method = UMB_METHOD_NONE};
    assert_int_equal(umb_culler_create(out->index, &culler, &out->sorted), UMB_OK);
    culler.unordered = true;
    assert_int_equal(umb_culler_create(out->index, &culler, &out->unordered), UMB_OK);
}

static void free_crew(crew *c)
{
    umb_culler_destroy(c->sorted);
    umb_culler_destroy(c->unordered);
    umb_index_destroy(c->index);
}

/* Of four views three have a plane within some units of the last place of a box's corner. */
static umb_view some_view(world *w, uint32_t k)
{
    umb_view v = random_view(&w->seed, REACH);
    umb_aabb box;
    if (k % 4 == 0 || !umb_scene_object_bounds(w->scene, random_below(&w->seed, COUNT), &box)) {
        return v;
    }
    double depth = 0.0;
    for (int i = 0; i < 3; ++i) {
        float at = random_below(&w->seed, 2) == 0 ? box.min[i] : box.max[i];
        depth += v.forward[i] * (at - v.eye[i]);
    }
    depth *= 1.0 + (double)random_below(&w->seed, 9) * 0x1p-25 - 0x1p-23;
    umb_view near_one = v, far_one = v;
    near_one.near_depth = depth;
    far_one.far_depth = depth;
    near_one.far_depth = INFINITY;
    if (k % 4 != 1 && umb_view_check(&far_one, NULL) == UMB_OK) {
        return far_one;
    }
    return umb_view_check(&near_one, NULL) == UMB_OK ? near_one : v;
}

/* The same objects with the same flags, in the same order. */
static void check_same(const crew *flat, const crew *c, const umb_view *v)
{
    umb_visible_set want, seen;
    static uint8_t met[MOST];
    assert_int_equal(umb_cull(flat->sorted, v, &want), UMB_OK);
    assert_int_equal(umb_cull(c->sorted, v, &seen), UMB_OK);
    assert_int_equal(seen.count, want.count);
    assert_memory_equal(seen.objects, want.objects, want.count * sizeof want.objects[0]);
    assert_memory_equal(seen.inside, want.inside, want.count);
    memset(met, 0, sizeof met);
    assert_int_equal(umb_cull(c->unordered, v, &seen), UMB_OK);
    assert_int_equal(seen.count, want.count);
    for (uint32_t i = 0; i < seen.count; ++i) {
        met[seen.objects[i]] = (uint8_t)(1 + seen.inside[i]);
    }
    for (uint32_t i = 0; i < want.count; ++i) {
        assert_int_equal(met[want.objects[i]], 1 + want.inside[i]);
    }
}

static void test_followed(void **state)
{
    (void)state;
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    uint32_t rounds = size != NULL && size[0] == 's' ? 12 : 120, paying = 0, count = 0;
    static world w;
    crew flat, crews[KINDS * 8];
    set_up(&w, 82, COUNT / 2, NULL);
    make_crew(w.scene, "flat", UMB_UPDATE_DEFAULT, &flat);
    for (int k = 0; k < KINDS; ++k) {
        for (int u = 0; umb_index_update_name((umb_index_update)u) != NULL; ++u) {
            if (u != UMB_UPDATE_OVERLAPPING) {
                make_crew(w.scene, NAMES[k], (umb_index_update)u, &crews[count++]);
            }
        }
    }
    for (uint32_t round = 0; round < rounds; ++round) {
        for (uint32_t i = round % 10 == 9 ? 400 : random_below(&w.seed, 30); i > 0; --i) {
            edit(&w);
        }
        assert_int_equal(umb_scene_commit(w.scene), UMB_OK);
        umb_view v = some_view(&w, round);
        for (uint32_t k = 0; k < count; ++k) {
            paying += check_below(umb_index_tree(crews[k].index), 0);
            check_same(&flat, &crews[k], &v);
        }
    }
    for (uint32_t k = 0; k < count; ++k) {
        free_crew(&crews[k]);
    }
    free_crew(&flat);
    umb_scene_destroy(w.scene);
    assert_true(paying > rounds * count * 4);
}

/* The direction in which a node's volume is tight: one of a box's axes, or the way to a sphere's farthest corner. */
static void tight_direction(const umb_tree *t, uint32_t number, uint64_t *seed, double d[3])
{
    const umb_node_volume *v = &t->volumes[number];
    const umb_node *n = &t->nodes[number];
    uint32_t axis = random_below(seed, 3), side = random_below(seed, 2);
    double most = 0.0;
    for (int i = 0; i < 3; ++i) {
        d[i] = (side == 0 ? 1.0 : -1.0) * v->place.m[i][axis];
    }
    for (uint32_t k = 0; k < 8 * n->count && t->spheres; ++k) {
        double to[3], square = 0.0;
        for (int i = 0; i < 3; ++i) {
            to[i] = (double)((k >> i & 1u) != 0 ? n->max : n->min)[i][k / 8] - v->place.m[i][3];
            square += to[i] * to[i];
        }
        if (square > most) {
            memcpy(d, to, sizeof to);
            most = square;
        }
    }
}

/* Views whose near plane touches a node's volume, within some units of the last place: boxes below it that touch the volume there
 * are in the frustum or not by rounding alone. */
static bool touching_view(const umb_tree *t, uint64_t *seed, umb_view *out)
{
    uint32_t number = random_below(seed, t->node_count);
    const umb_node_volume *v = &t->volumes[number];
    double d[3], eye[3], target[3], up[3] = {0.3, 0.5, 0.7}, length = 0.0, along = 0.0, back = random_in(seed, 1, 60);
    if (v->pays == 0) {
        return false;
    }
    tight_direction(t, number, seed, d);
    for (int i = 0; i < 3; ++i) {
        length += d[i] * d[i];
    }
    for (int i = 0; i < 3; ++i) {
        d[i] /= sqrt(length);
        target[i] = v->place.m[i][3];
        eye[i] = target[i] - back * d[i];
    }
    for (int j = 0; j < 3; ++j) {
        double own = d[0] * v->place.m[0][j] + d[1] * v->place.m[1][j] + d[2] * v->place.m[2][j];
        along += t->spheres ? 0.0 : fabs(own) * v->half[j];
    }
    double near_depth = (back + (t->spheres ? v->half[0] : along)) * (1.0 + random_in(seed, -1, 1) * 0x1p-22);
    return umb_view_look_at(out, eye, target, up, 1.5, 1.0, near_depth, INFINITY) == UMB_OK;
}

/* Many views of one scene: nodes are passed over for their volumes, and nothing is missing. */
static void test_views(void **state)
{
    (void)state;
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    uint32_t views = size != NULL && size[0] == 's' ? 200 : 4000, passed = 0;
    static world w;
    crew flat, crews[KINDS];
    set_up(&w, 83, COUNT, NULL);
    make_crew(w.scene, "flat", UMB_UPDATE_DEFAULT, &flat);
    for (int k = 0; k < KINDS; ++k) {
        make_crew(w.scene, NAMES[k], UMB_UPDATE_DEFAULT, &crews[k]);
    }
    for (uint32_t i = 0; i < views; ++i) {
        umb_view v = some_view(&w, i);
        umb_frustum f;
        umb_frustum_prepare(&f, &v);
        for (int k = 0; k < KINDS; ++k) {
            const umb_tree *t = umb_index_tree(crews[k].index);
            umb_view touching;
            check_same(&flat, &crews[k], &v);
            for (int trial = 0; trial < 8; ++trial) {
                if (touching_view(t, &w.seed, &touching)) {
                    check_same(&flat, &crews[k], &touching);
                }
            }
            for (uint32_t n = 0; n < t->node_count; ++n) {
                passed += !umb_volumes_in_view(&f, t, n, f.all_planes);
            }
        }
    }
    for (int k = 0; k < KINDS; ++k) {
        free_crew(&crews[k]);
    }
    free_crew(&flat);
    umb_scene_destroy(w.scene);
    assert_true(passed > views);
}

/* Commits that find no memory leave the index behind, and the next one catches up. */
static void test_failing_commits(void **state)
{
    (void)state;
    static world w;
    for (int k = 0; k < KINDS; ++k) {
        failing memory;
        umb_allocator a = failing_allocator(&memory, 1LL << 60);
        umb_index_def def = {0};
        umb_index *index;
        uint32_t failed = 0;
        set_up(&w, 84, 20, &a);
        assert_true(umb_index_parse(NAMES[k], &def));
        assert_int_equal(umb_index_create(w.scene, &def, &index), UMB_OK);
        for (uint32_t round = 0; round < 60; ++round) {
            for (int i = 0; i < 12; ++i) {
                add(&w);
            }
            atomic_store(&memory.left, round % 20);
            failed += umb_scene_commit(w.scene) != UMB_OK;
            atomic_store(&memory.left, 1LL << 60);
            assert_int_equal(umb_scene_commit(w.scene), UMB_OK);
            check_below(umb_index_tree(index), 0);
        }
        assert_true(failed > 0);
        umb_index_destroy(index);
        umb_scene_destroy(w.scene);
        assert_true(atomic_load(&memory.held) == 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_followed),
        cmocka_unit_test(test_views),
        cmocka_unit_test(test_failing_commits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

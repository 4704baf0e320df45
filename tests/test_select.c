/* Choosing occluders: a selector that follows a scene from commit to commit chooses what a new one does, over any index,
 * after any edits; and commits that it did not see are no harm. Lists of leaves are what looking at every occluder from every
 * point gives, and name nothing that is not there. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "occlusion/chooser.h"
#include "support/failing.h"
#include "support/random_boxes.h"
#include "umbrage/umbrage.h"

enum { SHAPES = 3, OBJECTS = 120, SIDE = 3 };

static int rounds(int normal)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && size[0] == 's' ? normal / 10 : size != NULL && size[0] == 'f' ? normal * 10 : normal;
}

static void add_shapes(umb_scene *scene, umb_shape shapes[SHAPES])
{
    static const float solid[4][3] = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}};
    static const uint32_t faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    float wall[(SIDE + 1) * (SIDE + 1)][3];
    uint32_t quads[6 * SIDE * SIDE], n = 0;
    for (int bend = 0; bend < 2; ++bend) {
        n = 0;
        for (uint32_t k = 0; k < (SIDE + 1) * (SIDE + 1); ++k) {
            wall[k][0] = (float)(k % (SIDE + 1));
            wall[k][1] = (float)(k / (SIDE + 1));
            wall[k][2] = bend ? (float)(k % 3) * 0.25f : 0.0f;
        }
        for (uint32_t k = 0; k < SIDE * SIDE; ++k) {
            uint32_t a = k % SIDE + k / SIDE * (SIDE + 1), up = a + SIDE + 1;
            const uint32_t cut[6] = {a, a + 1, up + 1, a, up + 1, up};
            memcpy(quads + n, cut, sizeof cut);
            n += 6;
        }
        umb_shape_def def = {.positions = wall[0], .position_count = (SIDE + 1) * (SIDE + 1), .indices = quads, .index_count = n};
        assert_int_equal(umb_scene_add_shape(scene, &def, &shapes[bend]), UMB_OK);
    }
    umb_shape_def def = {.positions = solid[0], .position_count = 4, .indices = faces[0], .index_count = 12};
    assert_int_equal(umb_scene_add_shape(scene, &def, &shapes[2]), UMB_OK);
}

static umb_transform place(dice *d)
{
    float size = dice_roll(d, 4) == 0 ? 0.5f * (float)(1 + dice_roll(d, 6)) : 1.0f;
    float mirror = dice_roll(d, 5) == 0 ? -size : size;
    return (umb_transform){{{mirror, 0, 0, (float)dice_roll(d, 40) - 20.0f},
                            {0, size, 0, (float)dice_roll(d, 20) - 10.0f},
                            {0, 0, size, (float)dice_roll(d, 40) - 30.0f}}};
}

static void edit(umb_scene *scene, dice *d, const umb_shape shapes[SHAPES])
{
    uint32_t id = dice_roll(d, OBJECTS), unused, what = dice_roll(d, 20);
    umb_transform t = place(d), whole = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    umb_object_def def = {.shape = shapes[dice_roll(d, SHAPES)], .transform = t,
                          .flags = dice_roll(d, 3) == 0 ? UMB_OBJECT_STATIC : 0};
    if (what < 9) {
        (void)umb_scene_move_object(scene, id, &t, NULL);
    } else if (what < 14) {
        (void)umb_scene_add_object(scene, &def, &unused);
    } else if (what < 16) {
        (void)umb_scene_remove_object(scene, id);
    } else if (what == 16) {
        (void)umb_scene_add_occluder(scene, def.shape, dice_roll(d, 2) == 0 ? &whole : &t, &unused);
    } else if (what == 17) {
        (void)umb_scene_remove_occluder(scene, dice_roll(d, 8));
    } else if (what == 18) {
        (void)umb_scene_flag_object(scene, id, dice_roll(d, 2) == 0 ? UMB_OBJECT_IGNORED : 0);
    } else if (dice_roll(d, 4) == 0) {
        assert_int_equal(umb_scene_weld(scene, NULL, NULL), UMB_OK);
    }
}

static umb_choice choice_of(const umb_scene *scene, const umb_index *index, const umb_view *view, umb_frustum *frustum,
                            umb_cull_stats *stats)
{
    umb_frustum_prepare(frustum, view);
    return (umb_choice){.viewer = {.points = &view->eye, .point_count = 1},
                        .view = view,
                        .frustum = frustum,
                        .scene = umb_scene_committed(scene),
                        .tree = umb_index_tree(index),
                        .stats = stats};
}

/* Returns how many both chose. */
static uint32_t compare(umb_selector *old, const umb_choice *choice)
{
    const umb_box_kernels *kernels = umb_box_kernels_get(UMB_ISA_SCALAR);
    umb_allocator a = umb_memory_allocator(NULL);
    umb_selector fresh;
    umb_pick p, q;
    uint32_t count = 0;
    umb_selector_create(&fresh, &a);
    assert_true(umb_select_follow(old, choice) && umb_select_follow(&fresh, choice));
    assert_int_equal(umb_select_begin(old, choice, kernels), UMB_OK);
    assert_int_equal(umb_select_begin(&fresh, choice, kernels), UMB_OK);
    for (uint32_t i = 0; i < choice->scene->occluder_count; ++i) {
        assert_true(old->known.areas[i] == fresh.known.areas[i]);
    }
    for (uint32_t i = 0; i < choice->tree->node_count; ++i) {
        assert_true(choice->tree->nodes[i].count == 0 || old->known.node_areas[i] == fresh.known.node_areas[i]);
    }
    while (umb_select_next(&fresh, &q)) {
        assert_true(umb_select_next(old, &p));
        assert_int_equal(p.occluder, q.occluder);
        assert_int_equal(p.facet, q.facet);
        assert_int_equal(p.set, q.set);
        assert_true(p.score == q.score && p.place == q.place);
        count += 1;
    }
    assert_false(umb_select_next(old, &p));
    umb_selector_free(&fresh);
    return count;
}

static void follow(uint64_t seed, const char *kind, umb_index_update update, uint64_t *chosen)
{
    dice d = {seed};
    uint64_t random = seed * 2 + 1;
    umb_scene *scene;
    umb_index *index;
    umb_shape shapes[SHAPES];
    umb_index_def def = {0};
    umb_allocator a = umb_memory_allocator(NULL);
    umb_selector s;
    umb_selector_create(&s, &a);
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    add_shapes(scene, shapes);
    assert_true(umb_index_parse(kind, &def));
    def.update = update;
    if (umb_index_create(scene, &def, &index) != UMB_OK) {
        umb_scene_destroy(scene); /* it has no such way */
        return;
    }
    for (int frame = 0; frame < 30; ++frame) {
        for (uint32_t n = frame == 0 ? 100 : dice_roll(&d, 4) == 0 ? dice_roll(&d, 60) : dice_roll(&d, 6); n > 0; --n) {
            edit(scene, &d, shapes);
        }
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        if (dice_roll(&d, 5) == 0) {
            continue; /* it does not see this one */
        }
        umb_view view = random_view(&random, 20.0);
        umb_frustum frustum;
        umb_cull_stats stats = {0};
        if (view.projection == UMB_PERSPECTIVE) {
            umb_choice choice = choice_of(scene, index, &view, &frustum, &stats);
            *chosen += compare(&s, &choice);
        }
    }
    umb_selector_free(&s);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

static void test_follows(void **state)
{
    (void)state;
    uint64_t chosen = 0, seed = 1;
    for (int round = 0; round < rounds(20); ++round) {
        for (uint32_t k = 0; umb_index_variant(k) != NULL; ++k, ++seed) {
            umb_index_update update = (umb_index_update)(seed % 8);
            follow(seed, umb_index_variant(k), k < 2 ? update : UMB_UPDATE_DEFAULT, &chosen);
        }
    }
    printf("# chosen by both: %llu\n", (unsigned long long)chosen);
    assert_true(chosen > 0);
}

/* ---- lists of leaves ---------------------------------------------------------------------------- */

/* A scene after some edits, and who chooses in it. */
typedef struct stand {
    umb_scene *scene;
    umb_index *index;
    umb_shape shapes[SHAPES];
    umb_chooser chooser;
    dice d;
} stand;

static void open_stand(stand *s, uint64_t seed)
{
    umb_allocator a = umb_memory_allocator(NULL);
    s->d = (dice){seed};
    assert_int_equal(umb_scene_create(NULL, &s->scene), UMB_OK);
    add_shapes(s->scene, s->shapes);
    for (int i = 0; i < 150; ++i) {
        edit(s->scene, &s->d, s->shapes);
    }
    assert_int_equal(umb_scene_commit(s->scene), UMB_OK);
    assert_int_equal(umb_index_create(s->scene, NULL, &s->index), UMB_OK);
    umb_chooser_create(&s->chooser, &a);
}

static void close_stand(stand *s)
{
    umb_chooser_free(&s->chooser);
    umb_index_destroy(s->index);
    umb_scene_destroy(s->scene);
}

/* Area vectors of what a pick shows, as seen from a point. */
typedef struct faces {
    double areas[64][3], sizes, centre[3]; /* centre: from the eye */
    bool two_sided[64];
    uint32_t count;
} faces;

static void find_faces(const umb_pick *pick, const double eye[3], faces *out)
{
    bool body = pick->facet == UMB_NONE;
    uint32_t first = body ? 0 : pick->facet, end = body ? pick->facets->facet_count : pick->facet + 1, corners = 0;
    memset(out, 0, sizeof *out);
    for (uint32_t i = first; i < end; ++i) {
        const umb_facet *f = &pick->facets->facets[i];
        double *area = out->areas[out->count], world[UMB_FACET_CORNERS][3], turn = pick->place->mirrored ? -1.0 : 1.0;
        for (uint32_t k = 0; k < f->count; ++k, ++corners) {
            const float *p = pick->facets->positions[pick->facets->corners[f->first + k]];
            for (int x = 0; x < 3; ++x) {
                const float *row = pick->place->transform.m[x];
                world[k][x] = pick->place->identity ? p[x] : (double)row[0] * p[0] + (double)row[1] * p[1] + (double)row[2] * p[2] + row[3];
                out->centre[x] += world[k][x] - eye[x];
            }
        }
        for (uint32_t k = 0; k < f->count; ++k) {
            const double *p = world[k], *q = world[(k + 1) % f->count];
            for (int x = 0; x < 3; ++x) {
                area[x] += turn * 0.5 * (p[(x + 1) % 3] * q[(x + 2) % 3] - p[(x + 2) % 3] * q[(x + 1) % 3]);
            }
        }
        out->sizes += sqrt(area[0] * area[0] + area[1] * area[1] + area[2] * area[2]);
        out->two_sided[out->count++] = f->two_sided;
    }
    for (int x = 0; x < 3; ++x) {
        out->centre[x] /= corners;
    }
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* The measure of a pick from a point, over the square of its distance. Back: the paper's, what it shows along the direction;
 * front: what it shows where it stands, less aside. What is right abreast, or edge-on, counts or not. */
static double shown(const umb_pick *pick, const double eye[3], const double direction[3], bool back, bool counts)
{
    faces f;
    find_faces(pick, eye, &f);
    double square = dot(f.centre, f.centre), ahead = dot(f.centre, direction), sum = 0.0;
    double least = counts ? -1e-5 : 1e-5, near = counts ? 1.0 + 1e-5 : 1.0 - 1e-5;
    for (uint32_t i = 0; i < f.count; ++i) {
        double along = back ? dot(f.areas[i], direction) : -dot(f.areas[i], f.centre) / sqrt(square);
        sum += f.two_sided[i] ? fabs(along) : fmax(0.0, along);
    }
    if (pick->facet != UMB_NONE && !counts && fabs(dot(f.areas[0], f.centre)) <= 1e-5 * f.sizes * sqrt(square)) {
        return 0.0; /* nothing is seen of it from there */
    }
    sum = fmax(0.0, (back ? sum : sum * fmax(0.2, ahead / sqrt(square))) + (counts ? 1e-6 : -1e-6) * f.sizes);
    return ahead > least * sqrt(square) || square <= near * f.sizes ? sum / square : 0.0;
}

static void check_list(stand *s, uint32_t leaf, umb_leaf_side side, const double direction[3], uint64_t *entries)
{
    const umb_committed *scene = umb_scene_committed(s->scene);
    uint32_t count, found = 0;
    const umb_leaf_entry *list = umb_leaf_lists_get(&s->chooser.lists, leaf, side, direction, &count);
    const umb_aabb *cell = &s->chooser.lists.leaves[leaf].cell;
    for (uint32_t i = 0; i < count; ++i) {
        assert_true(list[i].occluder < scene->occluder_count && (i == 0 || list[i].score <= list[i - 1].score));
        umb_pick pick = umb_chooser_pick(&s->chooser, &list[i]);
        assert_true(list[i].facet == UMB_NONE ? umb_occluder_is_body(&s->chooser.selector.known, scene, list[i].occluder)
                                              : list[i].facet < pick.facets->facet_count);
        double most = 0.0, least = 0.0;
        for (uint32_t point = 0; point < UMB_LEAF_POINTS; ++point) {
            double eye[3];
            for (int x = 0; x < 3; ++x) {
                double part = point == 0 ? 0.5 : (point - 1) >> x & 1 ? 0.75 : 0.25;
                eye[x] = cell->min[x] + part * ((double)cell->max[x] - cell->min[x]);
            }
            most = fmax(most, shown(&pick, eye, direction, side == UMB_LEAF_BACK, true));
            least = fmax(least, shown(&pick, eye, direction, side == UMB_LEAF_BACK, false));
        }
        assert_true(list[i].score >= (1.0 - 1e-4) * least && list[i].score <= (1.0 + 1e-4) * most);
        found += 1;
    }
    *entries += found;
}

/* Every list of every leaf, right after its leaf looked about and after edits. */
static void test_leaves(void **state)
{
    (void)state;
    uint64_t entries = 0;
    for (int round = 0; round < rounds(20); ++round) {
        stand s;
        open_stand(&s, (uint64_t)round + 500);
        umb_cull_stats stats = {0};
        for (int frame = 0; frame < 4; ++frame) {
            umb_choice choice = {.scene = umb_scene_committed(s.scene), .tree = umb_index_tree(s.index),
                                 .coherence = UMB_COHERENCE_LEAVES, .stats = &stats};
            assert_int_equal(umb_chooser_prepare(&s.chooser, &choice, umb_box_kernels_get(UMB_ISA_SCALAR), 64), UMB_OK);
            s.chooser.choice = &choice;
            for (uint32_t leaf = 0; leaf < 1u << s.chooser.lists.depth; ++leaf) {
                static const double directions[3][3] = {{0, 0, -1}, {0.5773502691896258, 0.5773502691896258, -0.5773502691896258}, {1, 0, 0}};
                assert_int_equal(s.chooser.lists.leaves[leaf].points, UMB_LEAF_POINTS);
                for (int k = 0; k < 3 && frame == 0; ++k) {
                    check_list(&s, leaf, UMB_LEAF_FRONT, directions[k], &entries);
                    check_list(&s, leaf, UMB_LEAF_BACK, directions[k], &entries);
                }
            }
            for (uint32_t n = 1 + dice_roll(&s.d, 20); n > 0; --n) {
                edit(s.scene, &s.d, s.shapes);
            }
            assert_int_equal(umb_scene_commit(s.scene), UMB_OK);
        }
        close_stand(&s);
    }
    printf("# entries of lists: %llu\n", (unsigned long long)entries);
    assert_true(entries > 0);
}

/* A viewer walks while the scene changes: entries always name what is there, and answers are safe by what hides them. */
static void test_walk(void **state)
{
    (void)state;
    static const umb_method methods[3] = {UMB_METHOD_PLANES, UMB_METHOD_SHADOW_FRUSTA, UMB_METHOD_OCCLUSION_TREE};
    uint64_t reported = 0, random = 9;
    for (int round = 0; round < rounds(30); ++round) {
        stand s;
        open_stand(&s, (uint64_t)round + 900);
        umb_culler *cullers[3];
        for (int m = 0; m < 3; ++m) {
            umb_culler_def def = {.method = methods[m], .coherence = UMB_COHERENCE_LEAVES | UMB_COHERENCE_REST, .occluder_budget = 20};
            assert_int_equal(umb_culler_create(s.index, &def, &cullers[m]), UMB_OK);
        }
        for (int frame = 0; frame < 40; ++frame) {
            umb_view view = random_view(&random, 15.0);
            umb_visible_set seen;
            for (int m = 0; m < 3; ++m) {
                assert_int_equal(umb_cull(cullers[m], &view, &seen), UMB_OK);
                reported += seen.count;
            }
            for (uint32_t n = dice_roll(&s.d, 6); n > 0; --n) {
                edit(s.scene, &s.d, s.shapes);
            }
            assert_int_equal(umb_scene_commit(s.scene), UMB_OK);
        }
        for (int m = 0; m < 3; ++m) {
            umb_culler_destroy(cullers[m]);
        }
        close_stand(&s);
    }
    assert_true(reported > 0);
}

/* Without memory a call says so, and the next one is right; once all is made ahead, frames take none. */
static void test_memory(void **state)
{
    (void)state;
    failing f;
    umb_scene_def scene_def = {.allocator = failing_allocator(&f, 1 << 30)};
    umb_scene *scene;
    umb_index *index;
    umb_shape shapes[SHAPES];
    dice d = {77};
    assert_int_equal(umb_scene_create(&scene_def, &scene), UMB_OK);
    add_shapes(scene, shapes);
    for (int i = 0; i < 90; ++i) {
        edit(scene, &d, shapes);
    }
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_int_equal(umb_index_create(scene, NULL, &index), UMB_OK);
    long long held = atomic_load(&f.held);
    uint64_t random = 3;
    umb_view view = random_view(&random, 10.0);
    bool done = false;
    for (long long limit = 0; !done; ++limit) {
        umb_culler_def def = {.method = UMB_METHOD_PLANES, .coherence = UMB_COHERENCE_LEAVES};
        umb_culler *culler = NULL;
        umb_visible_set seen;
        atomic_store(&f.left, limit);
        if (umb_culler_create(index, &def, &culler) == UMB_OK) {
            umb_result result = umb_culler_prepare(culler);
            assert_true(result == UMB_OK || result == UMB_ERROR_MEMORY);
            result = result == UMB_OK ? umb_cull(culler, &view, &seen) : result;
            assert_true(result == UMB_OK || result == UMB_ERROR_MEMORY);
            done = result == UMB_OK;
            atomic_store(&f.left, 1 << 30);
            assert_int_equal(umb_culler_prepare(culler), UMB_OK);
            assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
            atomic_store(&f.left, 0);
            assert_int_equal(umb_cull(culler, &view, &seen), UMB_OK);
        }
        umb_culler_destroy(culler);
        assert_true(atomic_load(&f.held) == held);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_follows), cmocka_unit_test(test_leaves),
                                       cmocka_unit_test(test_walk), cmocka_unit_test(test_memory)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

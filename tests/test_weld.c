/* Welds: what is blocked stays blocked where it matters, and nothing more is. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/transform.h"
#include "geometry/vec.h"
#include "scene/scene.h"
#include "support/failing.h"
#include "umbrage/umbrage.h"

enum { MOST_HITS = 20000 };

/* World triangles of all occluders, as readers see them. */
typedef struct soup {
    float (*corners)[3][3];
    uint8_t *two_sided;
    uint32_t count;
} soup;

static soup take_soup(const umb_scene *scene)
{
    const umb_committed *c = umb_scene_committed(scene);
    soup s = {0};
    for (uint32_t i = 0; i < c->occluder_count; ++i) {
        s.count += c->occluders[i].mesh->triangle_count;
    }
    s.corners = calloc(s.count + 1, sizeof *s.corners);
    s.two_sided = calloc(s.count + 1, 1);
    assert_non_null(s.corners);
    assert_non_null(s.two_sided);
    uint32_t n = 0;
    for (uint32_t i = 0; i < c->occluder_count; ++i) {
        const umb_occluder *o = &c->occluders[i];
        for (uint32_t t = 0; t < o->mesh->triangle_count; ++t, ++n) {
            for (int k = 0; k < 3; ++k) {
                float *out = s.corners[n][o->mirrored && k > 0 ? 3 - k : k];
                umb_transform_point(&o->transform, o->mesh->positions[o->mesh->triangles[t][k]],
                                    out);
            }
            s.two_sided[n] = o->mesh->two_sided[t];
        }
    }
    return s;
}

static void free_soup(soup *s)
{
    free(s->corners);
    free(s->two_sided);
}

/* Distances at which a line from p along d is blocked, ascending, equal ones once. False when the
 * line passes an edge too closely to tell. */
static bool cast(const soup *s, umb_vec3 p, umb_vec3 d, double *hits, uint32_t *count)
{
    *count = 0;
    for (uint32_t t = 0; t < s->count; ++t) {
        umb_vec3 v[3];
        double side[3];
        for (int k = 0; k < 3; ++k) {
            v[k] = umb_vec3_sub(umb_vec3_from_float(s->corners[t][k]), p);
        }
        for (int k = 0; k < 3; ++k) {
            side[k] = umb_vec3_dot(d, umb_vec3_cross(v[k], v[(k + 1) % 3]));
        }
        bool all_front = side[0] < 0 && side[1] < 0 && side[2] < 0;
        bool all_back = side[0] > 0 && side[1] > 0 && side[2] > 0;
        double least = fmin(fabs(side[0]), fmin(fabs(side[1]), fabs(side[2])));
        if (!all_front && !all_back) {
            /* Near an edge only if the others agree. */
            int positive = (side[0] > 1e-9) + (side[1] > 1e-9) + (side[2] > 1e-9);
            int negative = (side[0] < -1e-9) + (side[1] < -1e-9) + (side[2] < -1e-9);
            if (positive == 0 || negative == 0) {
                return false;
            }
            continue;
        }
        if (least < 1e-9) {
            return false;
        }
        if (all_back && !s->two_sided[t]) {
            continue;
        }
        umb_vec3 n = umb_vec3_cross(umb_vec3_sub(v[1], v[0]), umb_vec3_sub(v[2], v[0]));
        double at = umb_vec3_dot(v[0], n) / umb_vec3_dot(d, n);
        if (fabs(at) < 1e-9) {
            return false;
        }
        if (at > 0.0) {
            assert_true(*count < MOST_HITS);
            hits[(*count)++] = at;
        }
    }
    for (uint32_t i = 1; i < *count; ++i) {
        for (uint32_t j = i; j > 0 && hits[j - 1] > hits[j]; --j) {
            double h = hits[j];
            hits[j] = hits[j - 1];
            hits[j - 1] = h;
        }
    }
    uint32_t n = 0;
    for (uint32_t i = 0; i < *count; ++i) {
        if (n == 0 || hits[i] - hits[n - 1] > 1e-9) {
            hits[n++] = hits[i];
        }
    }
    *count = n;
    return true;
}

enum { ALL_SAME = 1, FIRST_SAME = 2 };

/* Every hit after is a hit before; ALL_SAME: and the other way round; FIRST_SAME: the first hits of
 * lines that start where sure says that no solid is are the same. */
static void compare_soups(const soup *before, const soup *after, dice *d, int how, int lines,
                          double reach)
{
    static double a[MOST_HITS], b[MOST_HITS];
    int done = 0;
    for (int round = 0; round < lines * 20 && done < lines; ++round) {
        double x[6];
        for (int k = 0; k < 6; ++k) {
            x[k] = (dice_roll(d, 1000003) / 1000003.0 - 0.25) * reach * 2.0;
        }
        umb_vec3 p = umb_vec3_make(x[0], x[1], x[2]);
        if (how == FIRST_SAME) {
            p = umb_vec3_make(-reach - x[0], x[1], x[2]); /* from outside */
        }
        umb_vec3 dir = umb_vec3_sub(umb_vec3_make(x[3], x[4], x[5]), p);
        uint32_t na, nb;
        if (!cast(before, p, dir, a, &na) || !cast(after, p, dir, b, &nb)) {
            continue;
        }
        done += 1;
        uint32_t k = 0;
        for (uint32_t i = 0; i < nb; ++i) {
            while (k < na && a[k] < b[i] - 1e-8) {
                ++k;
            }
            assert_true(k < na && fabs(a[k] - b[i]) <= 1e-8);
        }
        if (how == ALL_SAME) {
            assert_int_equal(na, nb);
        } else if (how == FIRST_SAME) {
            assert_int_equal(na > 0, nb > 0);
            assert_true(na == 0 || fabs(a[0] - b[0]) <= 1e-8);
        }
    }
    assert_true(done > lines / 2);
}

static umb_scene *make_scene(void)
{
    umb_scene *scene = NULL;
    assert_int_equal(umb_scene_create(NULL, &scene), UMB_OK);
    return scene;
}

static uint32_t add(umb_scene *scene, const float (*p)[3], uint32_t n, const uint32_t (*t)[3],
                    uint32_t count, uint8_t flag, const umb_transform *transform)
{
    uint8_t flags[64];
    memset(flags, flag, sizeof flags);
    umb_shape shape = 0;
    umb_shape_def def = {.positions = p[0],
                         .position_count = n,
                         .indices = t[0],
                         .index_count = 3 * count,
                         .triangle_flags = flags};
    assert_true(count <= 64);
    assert_int_equal(umb_scene_add_shape(scene, &def, &shape), UMB_OK);
    umb_object_def object = {.shape = shape, .flags = UMB_OBJECT_STATIC};
    if (transform != NULL) {
        object.transform = *transform;
    }
    uint32_t id = UMB_NONE;
    assert_int_equal(umb_scene_add_object(scene, &object, &id), UMB_OK);
    return id;
}

/* A box; bit k of cuts says along which diagonal face k is cut. */
static uint32_t add_box(umb_scene *scene, const float lo[3], const float hi[3], uint32_t cuts)
{
    float p[8][3];
    uint32_t t[12][3], n = 0;
    for (int i = 0; i < 8; ++i) {
        for (int k = 0; k < 3; ++k) {
            p[i][k] = (i >> k & 1) != 0 ? hi[k] : lo[k];
        }
    }
    static const uint32_t faces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                         {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    for (uint32_t f = 0; f < 6; ++f) {
        uint32_t s = cuts >> f & 1;
        const uint32_t *q = faces[f];
        uint32_t x[6] = {q[s], q[s + 1], q[(s + 2) % 4], q[s], q[(s + 2) % 4], q[(s + 3) % 4]};
        memcpy(t[n], x, sizeof x);
        n += 2;
    }
    return add(scene, (const float(*)[3])p, 8, (const uint32_t(*)[3])t, 12, 0, NULL);
}

static void add_quad(umb_scene *scene, const float q[4][3], uint8_t flag)
{
    static const uint32_t t[2][3] = {{0, 1, 2}, {0, 2, 3}};
    (void)add(scene, q, 4, t, 2, flag, NULL);
}

static umb_weld_stats weld(umb_scene *scene, uint32_t cluster)
{
    umb_weld_stats stats;
    umb_weld_def def = {.cluster_triangles = cluster};
    assert_int_equal(umb_scene_weld(scene, &def, &stats), UMB_OK);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    assert_true(stats.triangles_out <= stats.triangles_in + stats.t_junctions * 2);
    return stats;
}

/* The only occluder is a closed surface of so many triangles. */
static void assert_closed_box(const umb_scene *scene, uint32_t triangles)
{
    assert_int_equal(umb_scene_occluder_count(scene), 1);
    const umb_mesh *m = umb_scene_committed(scene)->occluders[0].mesh;
    assert_int_equal(m->triangle_count, triangles);
    assert_int_equal(m->edge_count, triangles * 3 / 2);
    for (uint32_t i = 0; i < m->edge_count; ++i) {
        assert_true(m->edges[i].f1 < triangles);
    }
}

/* A solid block of boxes, each face cut at random: one closed shell is left, of outer faces only,
 * and these are flat. */
static void test_stack_becomes_a_box(void **state)
{
    (void)state;
    dice d = {21};
    for (int round = 0; round < 10; ++round) {
        umb_scene *scene = make_scene();
        int size[3];
        for (int k = 0; k < 3; ++k) {
            size[k] = 1 + (int)dice_roll(&d, 4);
        }
        size[0] += size[0] * size[1] * size[2] == 1 ? 1 : 0;
        uint32_t boxes = 0;
        for (int i = 0; i < size[0] * size[1] * size[2]; ++i) {
            float lo[3] = {(float)(i % size[0]), (float)(i / size[0] % size[1]),
                           (float)(i / size[0] / size[1])};
            float hi[3] = {lo[0] + 1, lo[1] + 1, lo[2] + 1};
            (void)add_box(scene, lo, hi, dice_roll(&d, 64));
            boxes += 1;
        }
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        soup before = take_soup(scene);
        umb_weld_stats stats = weld(scene, 1u << 20);
        uint32_t outer = 4 * (uint32_t)(size[0] * size[1] + size[1] * size[2] + size[2] * size[0]);
        assert_int_equal(stats.groups, 1);
        assert_int_equal(stats.objects, boxes);
        assert_int_equal(stats.triangles_out, 12);
        assert_int_equal(stats.merged,
                         outer / 2 + 2 - 8); /* Euler's: 2 vertices more than half the triangles */
        assert_int_equal(stats.sealed, 12 * boxes - outer);
        assert_closed_box(scene, 12);
        soup after = take_soup(scene);
        compare_soups(&before, &after, &d, FIRST_SAME, 300, 6.0);
        free_soup(&before);
        free_soup(&after);
        umb_scene_destroy(scene);
    }
}

/* One floor of a building: walls under and over the plan (corners counter-clockwise seen from +z),
 * and both ends; flats are the triangles of the plan. */
static void add_floor(umb_scene *scene, dice *d, const float (*plan)[2], uint32_t n,
                      const uint32_t (*flats)[3], float low, float high)
{
    float p[16][3];
    uint32_t t[32][3], count = 0;
    for (uint32_t i = 0; i < n; ++i) {
        for (uint32_t k = 0; k < 2; ++k) {
            p[2 * i + k][0] = plan[i][0];
            p[2 * i + k][1] = plan[i][1];
            p[2 * i + k][2] = k ? high : low;
        }
        uint32_t q[4] = {2 * i, 2 * ((i + 1) % n), 2 * ((i + 1) % n) + 1, 2 * i + 1},
                 s = dice_roll(d, 2);
        uint32_t x[6] = {q[s], q[s + 1], q[(s + 2) % 4], q[s], q[(s + 2) % 4], q[(s + 3) % 4]};
        memcpy(t[count], x, sizeof x);
        count += 2;
    }
    for (uint32_t i = 0; i + 2 < n; ++i) {
        for (uint32_t k = 0; k < 3; ++k) {
            t[count][k] = 2 * flats[i][k] + 1;
            t[count + 1][k] = 2 * flats[i][2 - k];
        }
        count += 2;
    }
    (void)add(scene, (const float(*)[3])p, 2 * n, (const uint32_t(*)[3])t, count, 0, NULL);
}

/* Floors of one plan, turned so that nothing but up is along an axis: a wall is two triangles,
 * however many floors there are. */
static void test_floors_become_a_building(void **state)
{
    (void)state;
    static const float box[4][2] = {{0, 0}, {3, 0}, {3, 2}, {0, 2}};
    static const float bent[6][2] = {{0, 0}, {4, 0}, {4, 1}, {2, 1}, {2, 3}, {0, 3}};
    static const uint32_t box_flats[2][3] = {{0, 1, 2}, {0, 2, 3}};
    static const uint32_t bent_flats[4][3] = {{0, 1, 3}, {1, 2, 3}, {0, 3, 4}, {0, 4, 5}};
    dice d = {29};
    for (int round = 0; round < 40; ++round) {
        umb_scene *scene = make_scene();
        uint32_t n = round % 2 ? 6 : 4, floors = 2 + dice_roll(&d, 20);
        double angle = dice_roll(&d, 1000) / 100.0;
        float plan[6][2], z = 0.0f;
        for (uint32_t i = 0; i < n; ++i) {
            double x = n == 6 ? bent[i][0] : box[i][0], y = n == 6 ? bent[i][1] : box[i][1];
            plan[i][0] = (float)(x * cos(angle) - y * sin(angle));
            plan[i][1] = (float)(x * sin(angle) + y * cos(angle));
        }
        for (uint32_t f = 0; f < floors; ++f) {
            float high = z + 0.3f + (float)dice_roll(&d, 7) * 0.1f;
            add_floor(scene, &d, (const float(*)[2])plan, n, n == 6 ? bent_flats : box_flats, z,
                      high);
            z = high;
        }
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        soup before = take_soup(scene);
        umb_weld_stats stats = weld(scene, 1u << 20);
        assert_int_equal(stats.merged, n * (floors - 1));
        assert_int_equal(stats.triangles_out, 4 * n - 4);
        assert_closed_box(scene, 4 * n - 4);
        soup after = take_soup(scene);
        compare_soups(&before, &after, &d, FIRST_SAME, 100, 12.0);
        free_soup(&before);
        free_soup(&after);
        umb_scene_destroy(scene);
    }
}

enum { GRID = 9 };

/* Rings repeat the triangles of other clusters: keep each once. */
static void drop_repeated(soup *s)
{
    uint32_t n = 0;
    for (uint32_t t = 0; t < s->count; ++t) {
        uint32_t k = 0;
        while (k < n && memcmp(s->corners[k], s->corners[t], sizeof s->corners[t]) != 0) {
            ++k;
        }
        if (k == n) {
            memmove(s->corners[n], s->corners[t], sizeof s->corners[t]);
            s->two_sided[n++] = s->two_sided[t];
        }
    }
    s->count = n;
}

/* How often a point of the grid's plane is covered, by one-sided (0) and by two-sided (1)
 * triangles. All numbers are small integers over 4096: nothing is rounded. Triangles turn one
 * way. */
static void count_cover(const soup *s, double x, double y, int cover[2])
{
    cover[0] = cover[1] = 0;
    for (uint32_t t = 0; t < s->count; ++t) {
        bool inside = true;
        for (int k = 0; k < 3; ++k) {
            const float *a = s->corners[t][k], *b = s->corners[t][(k + 1) % 3];
            double side = ((double)b[0] - a[0]) * (y - a[1]) - ((double)b[1] - a[1]) * (x - a[0]);
            assert_true(side != 0.0);
            inside = inside && side > 0.0;
        }
        cover[s->two_sided[t] ? 1 : 0] += inside ? 1 : 0;
    }
}

/* The corner where cells a, b, c, d meet in turn is one of no outline, or lies on straight ones
 * only. */
static bool is_spare(int a, int b, int c, int d)
{
    return (a == b && c == d) || (b == c && d == a);
}

/* A flat grid with holes and two-sided cells in a slanted plane: each point of it is covered as
 * before and once, and what vertices stay are the corners of the outlines. */
static void test_flat_grids(void **state)
{
    (void)state;
    dice d = {30};
    for (int round = 0; round < 120; ++round) {
        umb_scene *scene = make_scene();
        int cells[GRID + 2][GRID + 2] = {{0}}; /* 0: a hole; 1: one-sided; 2: two-sided */
        double slope = (double)dice_roll(&d, 5), lean = (double)dice_roll(&d, 5);
        uint32_t holes = 2 + dice_roll(&d, 20), spare = 0;
        for (int i = 1; i <= GRID; ++i) {
            for (int j = 1; j <= GRID; ++j) {
                cells[i][j] = dice_roll(&d, holes) == 0 ? 0 : dice_roll(&d, holes) == 0 ? 2 : 1;
                float q[4][3];
                uint32_t first = dice_roll(&d, 2);
                for (uint32_t k = 0; k < 4; ++k) {
                    uint32_t c = (k + first) % 4;
                    q[k][0] = (float)(i + (c == 1 || c == 2));
                    q[k][1] = (float)(j + (c >= 2));
                    q[k][2] = (float)(slope * q[k][0] - lean * q[k][1]);
                }
                if (cells[i][j] != 0) {
                    add_quad(scene, (const float(*)[3])q,
                             cells[i][j] == 2 ? UMB_TRIANGLE_TWO_SIDED : 0);
                }
            }
        }
        for (int i = 0; i <= GRID; ++i) {
            for (int j = 0; j <= GRID; ++j) {
                int a = cells[i][j], b = cells[i + 1][j], c = cells[i + 1][j + 1],
                    e = cells[i][j + 1];
                bool any = a + b + c + e > 0;
                spare += any && is_spare(a, b, c, e) ? 1 : 0;
            }
        }
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        umb_weld_stats stats = weld(scene, 1u << 20);
        assert_int_equal(stats.merged, spare);
        soup after = take_soup(scene);
        drop_repeated(&after);
        assert_int_equal(after.count, stats.triangles_out);
        for (int i = 0; i <= GRID + 1; ++i) {
            for (int j = 0; j <= GRID + 1; ++j) {
                for (int k = 0; k < 4; ++k) {
                    int cover[2];
                    count_cover(&after, i + (k % 2 ? 2903 : 947) / 4096.0,
                                j + (k / 2 ? 2749 : 1531) / 4096.0, cover);
                    assert_int_equal(cover[0], cells[i][j] == 1);
                    assert_int_equal(cover[1], cells[i][j] == 2);
                }
            }
        }
        free_soup(&after);
        umb_scene_destroy(scene);
    }
}

static bool uses_point(const umb_scene *scene, float x, float y, float z)
{
    soup s = take_soup(scene);
    bool found = false;
    for (uint32_t t = 0; t < s.count; ++t) {
        for (int k = 0; k < 3; ++k) {
            const float *p = s.corners[t][k];
            found = found || (p[0] == x && p[1] == y && p[2] == z);
        }
    }
    free_soup(&s);
    return found;
}

/* Four squares around (1, 1, 0). What else is at that point speaks against taking it out, unless it
 * is flat too; so does one bit of height. */
static void test_what_touches_stays(void **state)
{
    (void)state;
    enum { NOTHING, SPIKE, SPIKE_OF_OTHERS, FIN, BENT_FIN, TURNED, BUMP, CASES };
    static const bool stays[CASES] = {false, true, true, false, true, true, true};
    static const uint32_t merged[CASES] = {5, 3, 4, 3, 2, 2, 0};
    for (int how = 0; how < CASES; ++how) {
        umb_scene *scene = make_scene();
        for (int i = 0; i < 4; ++i) {
            float x = (float)(i % 2), y = (float)(i / 2);
            float q[4][3] = {{x, y, 0}, {x + 1, y, 0}, {x + 1, y + 1, 0}, {x, y + 1, 0}};
            for (int k = 0; k < 4 && how == BUMP; ++k) {
                q[k][2] = q[k][0] == 1 && q[k][1] == 1 ? 0x1p-149f : 0.0f;
            }
            if (how == TURNED && i == 3) {
                float swapped[3];
                memcpy(swapped, q[1], sizeof swapped);
                memcpy(q[1], q[3], sizeof swapped);
                memcpy(q[3], swapped, sizeof swapped);
            }
            add_quad(scene, (const float(*)[3])q, 0);
        }
        static const uint32_t one[1][3] = {{0, 1, 2}}, two[2][3] = {{0, 1, 3}, {1, 2, 3}};
        const float spike[3][3] = {{1, 1, 0}, {1.5f, 1, 3}, {1, 1.5f, 3}};
        const float shared[3][3] = {{1, 1, 0}, {2, 1, 0}, {1, 1.5f, 3}};
        const float fin[4][3] = {{0, 1, 0}, {1, 1, 0}, {2, 1, 0}, {1, how == BENT_FIN ? 1.5f : 1, 3}};
        if (how == SPIKE_OF_OTHERS) {
            (void)add(scene, spike, 3, one, 1, 0, NULL);
        } else if (how == SPIKE) {
            (void)add(scene, shared, 3, one, 1, 0, NULL);
        } else if (how == FIN) {
            (void)add(scene, fin, 4, two, 2, 0, NULL);
        } else if (how == BENT_FIN) {
            /* Each half flat, together not. */
            const float bent[5][3] = {{0, 1, 0}, {1, 1, 0}, {2, 1, 0}, {1, 1.5f, 3}, {1, 0.5f, 3}};
            static const uint32_t halves[2][3] = {{0, 1, 3}, {1, 2, 4}};
            (void)add(scene, bent, 5, halves, 2, 0, NULL);
        }
        umb_weld_stats stats = weld(scene, 1000);
        assert_int_equal(stats.groups, 1);
        assert_int_equal(uses_point(scene, 1, 1, how == BUMP ? 0x1p-149f : 0.0f), stays[how]);
        /* With it go the middles of the four sides, but not where a fin ends, an edge of a triangle out of
           the plane begins, squares of unlike turn meet or the plane is bent. */
        assert_int_equal(stats.merged, merged[how]);
        umb_scene_destroy(scene);
    }
}

/* Random boxes and sheets on a lattice, touching, overlapping, repeated, turned over, with
 * T-junctions. */
static void make_mess(umb_scene *scene, dice *d, int boxes, int sheets)
{
    for (int i = 0; i < boxes; ++i) {
        float lo[3], hi[3];
        for (int k = 0; k < 3; ++k) {
            lo[k] = (float)dice_roll(d, 6);
            hi[k] = lo[k] + 1.0f + (float)dice_roll(d, 3);
        }
        (void)add_box(scene, lo, hi, dice_roll(d, 64));
    }
    for (int i = 0; i < sheets; ++i) {
        int axis = (int)dice_roll(d, 3), u = (axis + 1) % 3, v = (axis + 2) % 3;
        float q[4][3], lo[3], hi[3];
        for (int k = 0; k < 3; ++k) {
            lo[k] = (float)dice_roll(d, 6);
            hi[k] = lo[k] + 1.0f + (float)dice_roll(d, 3);
        }
        float lean = dice_roll(d, 2) ? (float)dice_roll(d, 3)
                                     : 0.0f; /* slanted: edges along no axis */
        for (int c = 0; c < 4; ++c) {
            q[c][u] = c == 1 || c == 2 ? hi[u] : lo[u];
            q[c][v] = c >= 2 ? hi[v] : lo[v];
            q[c][axis] = lo[axis] + (c == 1 || c == 2 ? lean : 0.0f);
        }
        if (dice_roll(d, 2)) {
            float t[3];
            memcpy(t, q[1], sizeof t);
            memcpy(q[1], q[3], sizeof t);
            memcpy(q[3], t, sizeof t);
        }
        add_quad(scene, (const float(*)[3])q, dice_roll(d, 4) == 0 ? UMB_TRIANGLE_TWO_SIDED : 0);
    }
}

static void test_mess_blocks_the_same(void **state)
{
    (void)state;
    dice d = {22};
    umb_weld_stats sum = {0};
    for (int round = 0; round < 150; ++round) {
        umb_scene *scene = make_scene();
        make_mess(scene, &d, round % 3 == 0 ? 0 : 2 + (int)dice_roll(&d, 12),
                  2 + (int)dice_roll(&d, 20));
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        soup before = take_soup(scene);
        umb_weld_stats stats = weld(scene, 8 + dice_roll(&d, 60));
        soup after = take_soup(scene);
        compare_soups(&before, &after, &d, stats.sealed == 0 ? ALL_SAME : 0, 200, 8.0);
        sum.sealed += stats.sealed;
        sum.duplicates += stats.duplicates;
        sum.t_junctions += stats.t_junctions;
        sum.groups += stats.groups;
        sum.merged += stats.merged;
        free_soup(&before);
        free_soup(&after);
        umb_scene_destroy(scene);
    }
    assert_true(sum.duplicates > 20 && sum.t_junctions > 100 && sum.groups > 50 && sum.merged > 10);
}

/* Boxes that do not overlap: from outside nothing changes at all, whatever was sealed. */
static void test_sealing_from_outside(void **state)
{
    (void)state;
    dice d = {23};
    uint32_t sealed = 0, merged = 0;
    for (int round = 0; round < 60; ++round) {
        umb_scene *scene = make_scene();
        for (int i = 0; i < 27; ++i) {
            float lo[3] = {(float)(i % 3) * 2, (float)(i / 3 % 3) * 2, (float)(i / 9) * 2};
            float hi[3] = {lo[0] + 2, lo[1] + 2, lo[2] + (dice_roll(&d, 3) ? 2.0f : 1.0f)};
            if (dice_roll(&d, 3) != 0) {
                (void)add_box(scene, lo, hi, dice_roll(&d, 64));
            }
        }
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        soup before = take_soup(scene);
        umb_weld_stats stats = weld(scene, 40);
        sealed += stats.sealed;
        merged += stats.merged;
        soup after = take_soup(scene);
        compare_soups(&before, &after, &d, FIRST_SAME, 200, 8.0);
        free_soup(&before);
        free_soup(&after);
        umb_scene_destroy(scene);
    }
    assert_true(sealed > 1000 && merged > 500);
}

/* Length of the edges of all occluders that have one triangle only. */
static double open_length(const umb_scene *scene)
{
    const umb_committed *c = umb_scene_committed(scene);
    double sum = 0.0;
    for (uint32_t i = 0; i < c->occluder_count; ++i) {
        const umb_mesh *m = c->occluders[i].mesh;
        for (uint32_t e = 0; e < m->edge_count; ++e) {
            if (m->edges[e].f1 == UMB_NONE) {
                umb_vec3 u = umb_vec3_from_float(m->positions[m->edges[e].v0]);
                sum += umb_vec3_length(
                    umb_vec3_sub(umb_vec3_from_float(m->positions[m->edges[e].v1]), u));
            }
        }
    }
    return sum;
}

/* A wide sheet above many narrow ones: one surface with nothing open but its rim. Along an axis,
 * and slanted; the ends in the middle of the row lie on the wide sheet's edge alone. Flat, the
 * sheets are one in the end; folded, every end stays. */
static void test_t_junctions(void **state)
{
    (void)state;
    for (int how = 0; how < 4; ++how) {
        umb_scene *scene = make_scene();
        bool slanted = how % 2 != 0, folded = how >= 2;
        float dx = slanted ? 3.0f : 5.0f, dy = slanted ? 4.0f : 0.0f;
        float wide[4][3] = {{0, 0, 1}, {dx * 7, dy * 7, 1}, {dx * 7, dy * 7, 2}, {0, 0, 2}};
        add_quad(scene, (const float(*)[3])wide, 0);
        for (int i = 0; i < 7; ++i) {
            float a = (float)i, b = a + 1;
            float fold = folded ? 1.0f : 0.0f, fa = i % 2 ? 0.0f : fold, fb = i % 2 ? fold : 0.0f;
            float q[4][3] = {{dx * a - dy * fa, dy * a + dx * fa, 0},
                             {dx * b - dy * fb, dy * b + dx * fb, 0},
                             {dx * b, dy * b, 1},
                             {dx * a, dy * a, 1}};
            add_quad(scene, (const float(*)[3])q, 0);
        }
        umb_weld_stats stats = weld(scene, 1000);
        assert_int_equal(stats.t_junctions, 6);
        assert_int_equal(stats.groups, 1);
        assert_int_equal(stats.occluders, 1);
        assert_int_equal(stats.merged, folded ? 0 : 14);
        assert_int_equal(stats.triangles_out, folded ? 16 + 6 : 2);
        /* A folded end is moved by one length of (dx, dy) across: 5. */
        double rim = folded ? 7 * sqrt(50.0) + 35.0 + 2.0 + 1.0 + sqrt(26.0) : 2 * 35.0 + 2 * 2.0;
        assert_true(fabs(open_length(scene) - rim) < 1e-9);
        umb_scene_destroy(scene);
    }
}

/* A wall without thickness, made of two sheets back to back: in the open, and across a closed room.
 * It must go on to block from both sides. */
static void test_thin_walls_stay(void **state)
{
    (void)state;
    dice d = {24};
    for (int room = 0; room < 2; ++room) {
        umb_scene *scene = make_scene();
        float q[4][3] = {{2, 0, 0}, {2, 2, 0}, {2, 2, 2}, {2, 0, 2}}, r[4][3];
        for (int i = 0; i < 4; ++i) {
            memcpy(r[i], q[3 - i], sizeof r[i]);
        }
        add_quad(scene, (const float(*)[3])q, 0);
        add_quad(scene, (const float(*)[3])r, 0);
        for (int half = 0; half < 2 && room; ++half) {
            /* The room's shell looks inwards: corners run the other way than those of a box, and the two
               faces at the wall are left out. */
            static const uint32_t faces[6][4] = {{0, 2, 6, 4}, {1, 5, 7, 3}, {0, 4, 5, 1},
                                                 {2, 3, 7, 6}, {0, 1, 3, 2}, {4, 6, 7, 5}};
            for (int f = 0; f < 6; ++f) {
                float p[4][3];
                for (int c = 0; c < 4; ++c) {
                    p[c][0] = (faces[f][c] & 1) ? 2.0f + 2.0f * (float)half : 2.0f * (float)half;
                    p[c][1] = (faces[f][c] & 2) ? 2.0f : 0.0f;
                    p[c][2] = (faces[f][c] & 4) ? 2.0f : 0.0f;
                }
                if (f != (half ? 0 : 1)) {
                    add_quad(scene, (const float(*)[3])p, 0);
                }
            }
        }
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        soup before = take_soup(scene);
        umb_weld_stats stats = weld(scene, 100);
        soup after = take_soup(scene);
        assert_int_equal(stats.sealed, 0);
        assert_int_equal(stats.duplicates, 2);
        compare_soups(&before, &after, &d, ALL_SAME, 500, 4.0);
        free_soup(&before);
        free_soup(&after);
        umb_scene_destroy(scene);
    }
}

static uint64_t hash_scene(const umb_scene *scene)
{
    const umb_committed *c = umb_scene_committed(scene);
    uint64_t h = 14695981039346656037u;
    for (uint32_t i = 0; i < c->occluder_count; ++i) {
        const umb_mesh *m = c->occluders[i].mesh;
        const unsigned char *parts[3] = {(const unsigned char *)m->positions,
                                         (const unsigned char *)m->triangles,
                                         (const unsigned char *)m->edges};
        size_t sizes[3] = {m->position_count * sizeof *m->positions,
                           m->triangle_count * sizeof *m->triangles,
                           m->edge_count * sizeof *m->edges};
        for (int k = 0; k < 3; ++k) {
            for (size_t b = 0; b < sizes[k]; ++b) {
                h = (h ^ parts[k][b]) * 1099511628211u;
            }
        }
        h = (h ^ c->occluders[i].owner) * 1099511628211u;
    }
    return h;
}

static void test_workers_change_nothing(void **state)
{
    (void)state;
    uint64_t wanted = 0;
    static const uint32_t workers[] = {0, 1, 2, 8};
    for (int k = 0; k < 4; ++k) {
        umb_scene *scene = make_scene();
        dice d = {25};
        make_mess(scene, &d, 120, 200);
        umb_pool *pool = NULL;
        umb_weld_def def = {.cluster_triangles = 24};
        if (workers[k] > 0) {
            assert_int_equal(umb_pool_create(workers[k], &pool), UMB_OK);
            def.tasks = umb_pool_tasks(pool);
        }
        assert_int_equal(umb_scene_weld(scene, &def, NULL), UMB_OK);
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        uint64_t h = hash_scene(scene);
        wanted = k == 0 ? h : wanted;
        assert_true(h == wanted);
        umb_pool_destroy(pool);
        umb_scene_destroy(scene);
    }
    printf("golden weld_mess %016llx\n", (unsigned long long)wanted);
}

/* A bumpy sheet of single quads cut into small clusters: every vertex of it is in some cluster that
 * has all the triangles around it, so no pinhole is left. */
static void test_rings_leave_no_pinholes(void **state)
{
    (void)state;
    enum { SIDE = 24 };
    dice d = {26};
    static float z[SIDE + 1][SIDE + 1];
    for (int i = 0; i <= SIDE; ++i) {
        for (int j = 0; j <= SIDE; ++j) {
            z[i][j] = (float)dice_roll(&d, 100) / 50.0f;
        }
    }
    umb_scene *scene = make_scene();
    static uint32_t around[SIDE + 1][SIDE + 1], best[SIDE + 1][SIDE + 1], here[SIDE + 1][SIDE + 1];
    for (int i = 0; i < SIDE; ++i) {
        for (int j = 0; j < SIDE; ++j) {
            float q[4][3] = {{(float)i, (float)j, z[i][j]},
                             {(float)i + 1, (float)j, z[i + 1][j]},
                             {(float)i + 1, (float)j + 1, z[i + 1][j + 1]},
                             {(float)i, (float)j + 1, z[i][j + 1]}};
            add_quad(scene, (const float(*)[3])q, 0);
            around[i][j] += 2;
            around[i + 1][j] += 1;
            around[i + 1][j + 1] += 2;
            around[i][j + 1] += 1;
        }
    }
    umb_weld_stats stats = weld(scene, 20);
    assert_int_equal(stats.groups, 1);
    assert_int_equal(stats.triangles_out, 2 * SIDE * SIDE);
    assert_true(stats.occluders >= 2 * SIDE * SIDE / 20 && stats.occluders < 2 * SIDE * SIDE / 3);
    const umb_committed *c = umb_scene_committed(scene);
    for (uint32_t o = 0; o < c->occluder_count; ++o) {
        memset(here, 0, sizeof here);
        const umb_mesh *m = c->occluders[o].mesh;
        for (uint32_t t = 0; t < m->triangle_count; ++t) {
            for (int k = 0; k < 3; ++k) {
                const float *p = m->positions[m->triangles[t][k]];
                here[(int)p[0]][(int)p[1]] += 1;
            }
        }
        for (int i = 0; i <= SIDE; ++i) {
            for (int j = 0; j <= SIDE; ++j) {
                best[i][j] = here[i][j] > best[i][j] ? here[i][j] : best[i][j];
            }
        }
    }
    assert_memory_equal(best, around, sizeof best);
    umb_scene_destroy(scene);
}

/* One big object is cut too; a mirrored one is turned round. */
static void test_big_and_mirrored(void **state)
{
    (void)state;
    dice d = {27};
    umb_scene *scene = make_scene();
    float p[64][3];
    uint32_t t[62][3];
    for (uint32_t i = 0; i < 64; ++i) {
        p[i][0] = (float)(i / 2);
        p[i][1] = (float)(i % 2) * 3.0f;
        p[i][2] = (float)dice_roll(&d, 10) / 7.0f;
    }
    for (uint32_t i = 0; i < 62; ++i) {
        uint32_t s = i % 2;
        t[i][0] = i;
        t[i][1] = i + 1 + s;
        t[i][2] = i + 2 - s;
    }
    umb_transform mirror = {{{-1, 0, 0, 0.5f}, {0, 1, 0, 0}, {0, 0, 1, 0.1f}}};
    (void)add(scene, (const float(*)[3])p, 64, (const uint32_t(*)[3])t, 62, 0, &mirror);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    soup before = take_soup(scene);
    umb_weld_stats stats = weld(scene, 3);
    assert_int_equal(stats.groups, 1);
    assert_true(stats.occluders >= 8 && stats.occluders < 62);
    assert_int_equal(umb_scene_committed(scene)->first_free_occluder, 0);
    soup after = take_soup(scene);
    compare_soups(&before, &after, &d, ALL_SAME, 300, 20.0);
    assert_true(before.count == 62 && after.count > 62);
    stats = weld(scene, 16); /* not big for this size: its own shape again */
    assert_int_equal(stats.groups, 0);
    assert_int_equal(umb_scene_committed(scene)->first_free_occluder, 1);
    free_soup(&before);
    free_soup(&after);
    umb_scene_destroy(scene);
}

/* Three boxes in a row, a pair apart: moving, flagging or removing one member ends its weld
 * only. */
static void test_dissolve(void **state)
{
    (void)state;
    for (int how = 0; how < 3; ++how) {
        umb_scene *scene = make_scene();
        uint32_t ids[5];
        for (int i = 0; i < 5; ++i) {
            float x = (float)i + (i >= 3 ? 10.0f : 0.0f);
            float lo[3] = {x, 0, 0}, hi[3] = {x + 1, 1, 1};
            ids[i] = add_box(scene, lo, hi, 0);
        }
        umb_weld_stats stats = weld(scene, 0);
        assert_int_equal(stats.groups, 2);
        assert_int_equal(stats.occluders, 2);
        const umb_committed *c = umb_scene_committed(scene);
        assert_int_equal(c->occluder_count, 2);
        assert_int_equal(c->first_free_occluder, 0);
        assert_int_equal(c->objects[ids[0]].occluder, UMB_NONE);
        umb_transform away = {{{1, 0, 0, 0}, {0, 1, 0, 50}, {0, 0, 1, 0}}};
        switch (how) {
        case 0:
            assert_int_equal(umb_scene_move_object(scene, ids[1], &away, NULL), UMB_OK);
            break;
        case 1:
            assert_int_equal(umb_scene_flag_object(scene, ids[1], UMB_OBJECT_NEVER_HIDES), UMB_OK);
            break;
        default:
            assert_int_equal(umb_scene_remove_object(scene, ids[1]), UMB_OK);
            break;
        }
        assert_int_equal(c->occluder_count, 2); /* not before the commit */
        assert_int_equal(c->occluders[0].mesh->triangle_count, 12);
        assert_int_equal(umb_scene_commit(scene), UMB_OK);
        assert_int_equal(c->first_free_occluder, how == 0 ? 3 : 2);
        assert_int_equal(c->occluder_count, c->first_free_occluder + 1);
        assert_true(c->objects[ids[0]].occluder != UMB_NONE);
        assert_int_equal(c->objects[ids[3]].occluder, UMB_NONE);
        umb_scene_destroy(scene);
    }
}

/* What must not take part does not. */
static void test_members(void **state)
{
    (void)state;
    umb_scene *scene = make_scene();
    float lo[3] = {0, 0, 0}, hi[3] = {1, 1, 1};
    for (int i = 0; i < 4; ++i) {
        lo[0] = (float)i;
        hi[0] = lo[0] + 1;
        uint32_t id = add_box(scene, lo, hi, 0);
        static const uint32_t flags[4] = {UMB_OBJECT_STATIC, 0,
                                          UMB_OBJECT_STATIC | UMB_OBJECT_NEVER_HIDES,
                                          UMB_OBJECT_STATIC | UMB_OBJECT_IGNORED};
        assert_int_equal(umb_scene_flag_object(scene, id, flags[i]), UMB_OK);
    }
    umb_weld_stats stats = weld(scene, 0);
    assert_int_equal(stats.objects, 1);
    assert_int_equal(stats.groups, 0);
    assert_int_equal(stats.triangles_in, 12);
    assert_int_equal(stats.triangles_out, 12);
    assert_int_equal(umb_scene_occluder_count(scene), 2);
    umb_weld_def def = {.ring = 1000};
    assert_int_equal(umb_scene_weld(scene, &def, NULL), UMB_ERROR_ARGUMENT);
    umb_scene_destroy(scene);
    scene = make_scene(); /* nothing at all */
    stats = weld(scene, 0);
    assert_int_equal(stats.objects + stats.groups + stats.occluders, 0);
    umb_scene_destroy(scene);
}

/* Whatever request fails, the scene stays as it was and can go on. */
static void test_failing_memory(void **state)
{
    (void)state;
    failing f;
    umb_scene_def scene_def = {.allocator = failing_allocator(&f, INT64_MAX)};
    umb_scene *scene = NULL;
    assert_int_equal(umb_scene_create(&scene_def, &scene), UMB_OK);
    dice d = {28};
    make_mess(scene, &d, 12, 12);
    assert_int_equal(umb_scene_commit(scene), UMB_OK);
    uint64_t before = hash_scene(scene);
    umb_weld_def def = {.cluster_triangles = 10};
    umb_result result = UMB_ERROR_MEMORY;
    for (long long limit = 0; result != UMB_OK; ++limit) {
        assert_true(limit < 20000);
        long long held = atomic_load(&f.held);
        atomic_store(&f.left, limit);
        result = umb_scene_weld(scene, &def, NULL);
        atomic_store(&f.left, INT64_MAX);
        if (result != UMB_OK) {
            assert_int_equal(result, UMB_ERROR_MEMORY);
            /* Only room made for the list of groups may stay. */
            assert_true(atomic_load(&f.held) - held < 1000);
            assert_int_equal(umb_scene_commit(scene), UMB_OK);
            assert_true(hash_scene(scene) == before);
        }
    }
    for (long long limit = 0; limit < 10; ++limit) {
        atomic_store(&f.left, limit);
        result = umb_scene_commit(scene);
        if (result == UMB_OK) {
            break;
        }
        assert_true(hash_scene(scene) == before);
    }
    assert_int_equal(result, UMB_OK);
    assert_true(hash_scene(scene) != before);
    atomic_store(&f.left, INT64_MAX);
    umb_scene_destroy(scene);
    assert_int_equal(atomic_load(&f.held), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_stack_becomes_a_box),
        cmocka_unit_test(test_mess_blocks_the_same),
        cmocka_unit_test(test_sealing_from_outside),
        cmocka_unit_test(test_t_junctions),
        cmocka_unit_test(test_thin_walls_stay),
        cmocka_unit_test(test_workers_change_nothing),
        cmocka_unit_test(test_rings_leave_no_pinholes),
        cmocka_unit_test(test_big_and_mirrored),
        cmocka_unit_test(test_dissolve),
        cmocka_unit_test(test_members),
        cmocka_unit_test(test_failing_memory),
        cmocka_unit_test(test_floors_become_a_building),
        cmocka_unit_test(test_flat_grids),
        cmocka_unit_test(test_what_touches_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Nothing that can be seen is hidden in views that lights have: micro scenes under views of
 * eight kinds, three raster sizes, against the oracle; and what throws a shadow into a light's
 * volume is answered. UMBRAGE_LIGHT_SCENES sets how many views
 * (800; small 48; full 20,000), UMBRAGE_LIGHT_FIRST the number of the first one. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "support/light_views.h"
#include "support/random_boxes.h"
#include "support/strict.h"
#include "umbrage/light.h"

#define MAX_KINDS 16

static const uint32_t SIZES[3][2] = {{64, 40}, {256, 144}, {1024, 288}};

static uint64_t number(const char *name, uint64_t otherwise)
{
    const char *text = getenv(name);
    return text != NULL ? strtoull(text, NULL, 10) : otherwise;
}

static uint64_t wanted(void)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && size[0] == 'f' ? 20000 : size != NULL && size[0] == 's' ? 48 : 800;
}

static umb_culler *answer(const umb_index *index, umb_method method, const umb_view *view,
                          umb_visible_set *seen)
{
    umb_culler *culler = NULL;
    umb_culler_def def = {.method = method};
    assert_int_equal(umb_culler_create(index, &def, &culler), UMB_OK);
    assert_int_equal(umb_cull(culler, view, seen), UMB_OK);
    return culler;
}

/* One view of one scene. The last answer is that of the frustum alone. */
static void check_view(uint64_t i, strict_count *sums)
{
    micro_scene micro;
    umb_error error = {0};
    umb_view view;
    uint32_t kind = (uint32_t)(i % light_view_kinds());
    /* Every kind of view meets every kind of scene. */
    assert_true(micro_scene_make(50000 + i / light_view_kinds(), &micro));
    assert_true(light_view_make(kind, i, &micro, &view));
    umb_scene *scene = model_scene(micro.model, micro.weld, (umb_tasks){0}, NULL, &error);
    truth *oracle = truth_create(micro.model, &error);
    assert_true(scene != NULL && oracle != NULL);
    umb_index *index = NULL;
    assert_int_equal(umb_index_create(scene, &(umb_index_def){0}, &index), UMB_OK);
    umb_culler *cullers[4];
    umb_visible_set seen[4];
    strict_answer answers[4];
    char labels[4][96];
    for (int s = 0; s < 4; ++s) {
        view.buffer_width = s < 3 ? SIZES[s][0] : 0;
        view.buffer_height = s < 3 ? SIZES[s][1] : 0;
        cullers[s] = answer(index, s < 3 ? UMB_METHOD_RASTER : UMB_METHOD_NONE, &view, &seen[s]);
        (void)snprintf(labels[s], sizeof labels[s], "view %llu (%s of %s), answer %d",
                       (unsigned long long)i, light_view_name(kind), micro.kind, s);
        answers[s] = (strict_answer){seen[s].objects, seen[s].count, labels[s],
                                     &sums[s < 3 ? kind : MAX_KINDS + kind]};
    }
    truth_options options = {
        .grid_width = 64, .grid_height = 64, .guided_rays = 80000, .threads = 1};
    assert_true(strict_check_all(oracle, micro.model, &view, answers, 4, &options));
    sums[kind].in_frustum += 3 * (uint64_t)seen[3].count;
    for (int s = 0; s < 4; ++s) {
        umb_culler_destroy(cullers[s]);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    truth_destroy(oracle);
    micro_scene_free(&micro);
}

static void test_light_views(void **state)
{
    (void)state;
    strict_count sums[2 * MAX_KINDS] = {{0}};
    assert_true(light_view_kinds() <= MAX_KINDS);
    uint64_t first = number("UMBRAGE_LIGHT_FIRST", 0);
    uint64_t count = number("UMBRAGE_LIGHT_SCENES", wanted()), wrong = 0;
    for (uint64_t i = first; i < first + count; ++i) {
        check_view(i, sums);
    }
    for (uint32_t k = 0; k < light_view_kinds(); ++k) {
        const strict_count *c = &sums[k];
        wrong += c->wrongly_hidden + sums[MAX_KINDS + k].wrongly_hidden;
        printf("# %-9s views %llu objects %llu in frustum %llu reported %llu seen %llu wrongly "
               "hidden %llu, by the frustum %llu, unconfirmed %llu\n",
               light_view_name(k), (unsigned long long)c->views, (unsigned long long)c->objects,
               (unsigned long long)c->in_frustum, (unsigned long long)c->reported,
               (unsigned long long)c->truth_visible, (unsigned long long)c->wrongly_hidden,
               (unsigned long long)sums[MAX_KINDS + k].wrongly_hidden,
               (unsigned long long)c->unconfirmed);
        /* It would pass if nothing were ever hidden, or nothing ever seen. */
        assert_true(c->reported < c->in_frustum && c->in_frustum < c->objects);
        assert_true(c->truth_visible > 0);
    }
    assert_int_equal(wrong, 0);
}

/* ---- shadows --------------------------------------------------------------------------------- */

/* Every triangle that throws a shadow, in world coordinates. */
typedef struct casters {
    double (*corner)[3][3];
    uint32_t *object;
    uint32_t count;
} casters;

static void make_casters(const model *m, casters *c)
{
    c->count = 0;
    c->corner = malloc((size_t)m->triangles * sizeof *c->corner + 1);
    c->object = malloc((size_t)m->triangles * sizeof *c->object + 1);
    assert_true(c->corner != NULL && c->object != NULL);
    for (uint32_t o = 0; o < m->object_count; ++o) {
        const model_mesh *mesh = &m->meshes[m->objects[o].mesh];
        for (uint32_t t = 0; t < mesh->triangle_count; ++t) {
            if ((mesh->flags[t] & UMB_TRIANGLE_OPEN) != 0) {
                continue;
            }
            for (int k = 0; k < 3; ++k) {
                float v[3];
                model_world_vertex(m, &m->objects[o], mesh->indices[3 * t + (uint32_t)k], v);
                for (int i = 0; i < 3; ++i) {
                    c->corner[c->count][k][i] = v[i];
                }
            }
            c->object[c->count++] = o;
        }
    }
}

static double triple(const double a[3], const double b[3], const double c[3])
{
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
           a[2] * (b[0] * c[1] - b[1] * c[0]);
}

/* Where from + s * way passes well inside a triangle; NAN where it does not, or not clearly. */
static double pass(const double from[3], const double way[3], double corner[3][3])
{
    double e[3], f[3], d[3], back[3];
    for (int i = 0; i < 3; ++i) {
        e[i] = corner[1][i] - corner[0][i];
        f[i] = corner[2][i] - corner[0][i];
        d[i] = from[i] - corner[0][i];
        back[i] = -way[i];
    }
    double det = triple(e, f, back);
    double u = triple(d, f, back) / det, v = triple(e, d, back) / det;
    return u > 1e-6 && v > 1e-6 && u + v < 1.0 - 1e-6 ? triple(e, f, d) / det : NAN;
}

/* Of all that lies between a point and its light, what the light meets first: at the greatest s
 * below most, by a clear margin. UMB_NONE: the point is lit, or two things are as near. */
static uint32_t first_caster(const casters *c, const double from[3], const double way[3],
                             double most)
{
    double farthest = 0.0, second = 0.0;
    uint32_t first = UMB_NONE;
    for (uint32_t k = 0; k < c->count; ++k) {
        double s = pass(from, way, c->corner[k]);
        if (s > farthest && s < most * (1.0 - 1e-9)) {
            second = c->object[k] != first ? farthest : second;
            farthest = s;
            first = c->object[k];
        } else if (s > second && s <= farthest && c->object[k] != first) {
            second = s;
        }
    }
    return farthest - second > 1e-6 * most ? first : UMB_NONE;
}

/* Where a way from a point crosses the light's near plane. */
static double way_to_near(const umb_view *light, const double from[3], const double way[3])
{
    double depth = 0.0, slope = 0.0;
    for (int i = 0; i < 3; ++i) {
        depth += (from[i] - light->eye[i]) * light->forward[i];
        slope += way[i] * light->forward[i];
    }
    return (light->near_depth - depth) / slope;
}

/* A point of the view, anywhere between its six sides. */
static void point_in(uint64_t *seed, const umb_view *v, double low, double high, double out[3])
{
    double z = random_in(seed, low, high);
    double k = v->projection == UMB_PERSPECTIVE ? z : 1.0;
    double x = k * random_in(seed, v->x_min, v->x_max), y = k * random_in(seed, v->y_min, v->y_max);
    for (int i = 0; i < 3; ++i) {
        out[i] = v->eye[i] + x * v->right[i] + y * v->up[i] + z * v->forward[i];
    }
}

/* The points' shadows: each is thrown by something that the light's answer holds. */
static uint32_t check_shadows(const umb_index *index, const casters *c, const umb_view *light,
                              const double (*points)[3], const double (*ways)[3],
                              uint32_t count)
{
    umb_visible_set seen;
    uint32_t shadows = 0;
    umb_culler *culler = answer(index, UMB_METHOD_RASTER, light, &seen);
    for (uint32_t k = 0; k < count; ++k) {
        uint32_t by = first_caster(c, points[k], ways[k],
                                   way_to_near(light, points[k], ways[k]));
        bool held = by == UMB_NONE;
        for (uint32_t i = 0; i < seen.count && !held; ++i) {
            held = seen.objects[i] == by;
        }
        if (!held) {
            fail_msg("object %u throws a shadow and is not answered", by);
        }
        shadows += by != UMB_NONE;
    }
    umb_culler_destroy(culler);
    return shadows;
}

enum { POINTS = 60 };

static uint32_t sun_shadows(uint64_t *seed, const umb_index *index, const casters *c)
{
    umb_view camera = random_view(seed, 4.0), light;
    umb_sun_def def = {.camera = &camera, .reach = random_in(seed, 1.0, 20.0)};
    double points[POINTS][3], ways[POINTS][3], length = 0.0;
    camera.plane_count = 0;
    def.slice_near = camera.near_depth + random_in(seed, 0.0, 1.0);
    def.slice_far = fmin(camera.far_depth, def.slice_near + 6.0);
    for (int i = 0; i < 3; ++i) {
        def.direction[i] = random_in(seed, -1.0, 1.0);
        length += def.direction[i] * def.direction[i];
    }
    if (umb_view_sun(&light, &def, NULL) != UMB_OK) {
        return 0; /* the slice begins beyond the camera's far plane */
    }
    for (int k = 0; k < POINTS; ++k) {
        point_in(seed, &camera, def.slice_near, def.slice_far, points[k]);
        for (int i = 0; i < 3; ++i) {
            ways[k][i] = -def.direction[i] / sqrt(length);
        }
    }
    return check_shadows(index, c, &light, points, ways, POINTS);
}

static uint32_t spot_shadows(uint64_t *seed, const umb_index *index, const casters *c)
{
    umb_spot_def def = {.near_depth = 0.05};
    def.angle = random_in(seed, 0.2, 2.8);
    def.range = random_in(seed, 3.0, 30.0);
    umb_view light;
    double points[POINTS][3], ways[POINTS][3];
    uint32_t count = 0;
    for (int i = 0; i < 3; ++i) {
        def.eye[i] = random_in(seed, -2.0, 2.0);
        def.direction[i] = random_in(seed, -1.0, 1.0);
    }
    assert_int_equal(umb_view_spot(&light, &def, NULL), UMB_OK);
    for (int k = 0; k < POINTS; ++k) {
        double across = 0.0, along = 0.0, *p = points[count];
        point_in(seed, &light, 0.5, def.range, p);
        for (int i = 0; i < 3; ++i) {
            ways[count][i] = def.eye[i] - p[i];
            along -= ways[count][i] * light.forward[i];
            across += ways[count][i] * ways[count][i];
        }
        bool in_cone = along > cos(0.5 * def.angle) * sqrt(across);
        in_cone = in_cone && across < def.range * def.range;
        count += in_cone;
    }
    return check_shadows(index, c, &light, points, ways, count);
}

static void test_shadows(void **state)
{
    (void)state;
    uint64_t seed = 31, count = wanted() / 4, shadows[2] = {0, 0};
    for (uint64_t i = 0; i < count; ++i) {
        micro_scene micro;
        umb_error error = {0};
        umb_index *index = NULL;
        casters c;
        assert_true(micro_scene_make(90000 + i, &micro));
        umb_scene *scene = model_scene(micro.model, micro.weld, (umb_tasks){0}, NULL, &error);
        assert_non_null(scene);
        assert_int_equal(umb_index_create(scene, &(umb_index_def){0}, &index), UMB_OK);
        make_casters(micro.model, &c);
        for (int k = 0; k < 4; ++k) {
            shadows[0] += sun_shadows(&seed, index, &c);
            shadows[1] += spot_shadows(&seed, index, &c);
        }
        free(c.corner);
        free(c.object);
        umb_index_destroy(index);
        umb_scene_destroy(scene);
        micro_scene_free(&micro);
    }
    printf("# points in the shadow of something answered: %llu of suns, %llu of spots\n",
           (unsigned long long)shadows[0], (unsigned long long)shadows[1]);
    /* How many there are varies with the scenes that a compiler's order of arguments makes. */
    assert_true(shadows[0] > 5 * count && shadows[1] > 2 * count);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_light_views),
                                       cmocka_unit_test(test_shadows)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Who casts a shadow: one scene seen by a camera, by the sun for two cascades, and by a lamp.
 *
 *      sun \  \             tower |##|
 *           \  \                  |##|  shed          lamp
 *            \  \                 |##| |##|            |
 *        mast |                                      table
 *     ________|_____________________________________cat___
 *              ^ camera, beside the mast, looks past the tower and the table
 *
 * Each shadow map needs what casts into the part of the picture that it is for, also what the
 * camera does not see itself: the mast. What is hidden from a light throws no shadow of its
 * own: the shed stands in the shadow of the tower, the cat sits under the table. One scene and
 * one index serve all views; each viewer has its own culler. */
#include <stdio.h>
#include <stdlib.h>
#include <umbrage/umbrage.h>

/* A box, from its least corner to its greatest. */
typedef struct thing {
    const char *name;
    float min[3], max[3];
} thing;

static const thing THINGS[] = {
    {"ground", {-200, -1, -200}, {200, 0, 200}}, {"mast", {-12, 0, 4}, {-11, 20, 5}},
    {"tower", {-40, 0, -30}, {-30, 40, -20}},    {"shed", {-20, 0, -27}, {-16, 4, -23}},
    {"table", {8, 2, -10}, {12, 2.25f, -6}},     {"cat", {9.5f, 0, -8.5f}, {10.5f, 0.5f, -7.5f}},
    {"barn", {20, 0, 60}, {40, 10, 80}},
};
enum { THING_COUNT = sizeof THINGS / sizeof THINGS[0], CASCADES = 2 };

static void must(umb_result result, const umb_error *why, const char *what)
{
    if (result != UMB_OK) {
        (void)fprintf(stderr, "%s: %s %s\n", what, umb_result_name(result), why->text);
        exit(1);
    }
}

/* A box from (0, 0, 0) to (1, 1, 1): seen from outside its corners run counter-clockwise. */
static umb_shape add_unit_box(umb_scene *scene, const umb_error *why)
{
    static const float corners[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                        {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    static const uint32_t triangles[] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                         3, 7, 6, 3, 6, 2, 0, 4, 7, 0, 7, 3, 1, 2, 6, 1, 6, 5};
    umb_shape_def def = {
        .positions = corners[0], .position_count = 8, .indices = triangles, .index_count = 36};
    umb_shape box;
    must(umb_scene_add_shape(scene, &def, &box), why, "a box");
    return box;
}

/* Objects are numbered as the things are. */
static umb_scene *build(umb_error *why)
{
    umb_scene *scene;
    must(umb_scene_create(&(umb_scene_def){.error = why}, &scene), why, "the scene");
    umb_shape box = add_unit_box(scene, why);
    for (int i = 0; i < THING_COUNT; ++i) {
        umb_object_def def = {.shape = box};
        uint32_t id;
        for (int k = 0; k < 3; ++k) {
            def.transform.m[k][k] = THINGS[i].max[k] - THINGS[i].min[k];
            def.transform.m[k][3] = THINGS[i].min[k];
        }
        must(umb_scene_add_object(scene, &def, &id), why, THINGS[i].name);
    }
    must(umb_scene_commit(scene), why, "the commit");
    return scene;
}

static void look(umb_culler *culler, const umb_view *view, const char *name, const umb_error *why)
{
    umb_visible_set seen;
    bool answered[THING_COUNT] = {false};
    must(umb_cull(culler, view, &seen), why, name);
    for (uint32_t k = 0; k < seen.count; ++k) {
        answered[seen.objects[k]] = true;
    }
    printf("%s:", name);
    for (int i = 0; i < THING_COUNT; ++i) {
        printf("%s%s", answered[i] ? " " : "", answered[i] ? THINGS[i].name : "");
    }
    printf("\n");
}

int main(void)
{
    umb_error why = {0};
    umb_scene *scene = build(&why);
    umb_index *index;
    must(umb_index_create(scene, &(umb_index_def){0}, &index), &why, "the index");
    umb_culler *cullers[CASCADES + 2];
    for (int i = 0; i < CASCADES + 2; ++i) {
        must(umb_culler_create(index, &(umb_culler_def){.error = &why}, &cullers[i]), &why,
             "a culler");
    }

    umb_view camera, view;
    const double eye[3] = {0, 1.7, 12}, target[3] = {0, 1.7, 0}, up[3] = {0, 1, 0};
    must(umb_view_look_at(&camera, eye, target, up, 1.0, 1.6, 0.1, 120), &why, "the camera");
    look(cullers[0], &camera, "camera", &why);

    /* The near part of the picture and the rest, each with all that casts into it from as far
     * as the highest thing can. */
    static const double depths[CASCADES + 1] = {0.1, 20, 120};
    static const char *const names[CASCADES] = {"sun, near", "sun, far"};
    for (int i = 0; i < CASCADES; ++i) {
        umb_sun_def sun = {.camera = &camera,
                           .slice_near = depths[i],
                           .slice_far = depths[i + 1],
                           .direction = {1, -1, 0},
                           .reach = 100};
        must(umb_view_sun(&view, &sun, &why), &why, names[i]);
        look(cullers[1 + i], &view, names[i], &why);
    }

    umb_spot_def lamp = {
        .eye = {10, 8, -8}, .direction = {0, -1, 0}, .angle = 1.2, .near_depth = 0.1, .range = 25};
    must(umb_view_spot(&view, &lamp, &why), &why, "the lamp");
    look(cullers[CASCADES + 1], &view, "lamp", &why);

    for (int i = 0; i < CASCADES + 2; ++i) {
        umb_culler_destroy(cullers[i]);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    return 0;
}

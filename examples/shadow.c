/* Who casts a shadow: a street in the morning, seen by a camera, by the sun for two cascades,
 * and by a lamp.
 *
 *              sun  \ \ \ \
 *        ____        \ \ \ \      ____
 *       |    |  lamp  \ \ \ \    |    |     towers stand left and right of a street that the
 *       |    |   T     \ \ \ \   |    |     camera looks along
 *     __|____|___|_______________|____|__
 *
 * Each shadow map needs the objects that cast into what the camera sees, also those that the
 * camera does not see itself; an object that is hidden from the light throws no shadow of its
 * own. One scene and one index serve all views; each viewer has its own culler. */
#include <stdio.h>
#include <stdlib.h>
#include <umbrage/umbrage.h>

enum { TOWERS = 20, CASCADES = 2 };

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
    umb_shape box;
    must(umb_scene_add_shape(scene,
                             &(umb_shape_def){.positions = corners[0],
                                              .position_count = 8,
                                              .indices = triangles,
                                              .index_count = 36},
                             &box),
         why, "a box");
    return box;
}

static void add_box(umb_scene *scene, umb_shape box, const float at[3], const float size[3],
                    const umb_error *why)
{
    umb_transform t = {
        .m = {{size[0], 0, 0, at[0]}, {0, size[1], 0, at[1]}, {0, 0, size[2], at[2]}}};
    uint32_t id;
    must(umb_scene_add_object(scene, &(umb_object_def){.shape = box, .transform = t}, &id), why,
         "an object");
}

/* The ground, two rows of towers along -z, and a crate beside each. */
static umb_scene *build(umb_error *why)
{
    umb_scene *scene;
    must(umb_scene_create(&(umb_scene_def){.error = why}, &scene), why, "the scene");
    umb_shape box = add_unit_box(scene, why);
    add_box(scene, box, (float[]){-200, -1, -300}, (float[]){400, 1, 400}, why);
    for (int i = 0; i < TOWERS; ++i) {
        float z = -15.0f * (float)(i / 2);
        float x = i % 2 == 0 ? -16.0f : 6.0f;
        add_box(scene, box, (float[]){x, 0, z}, (float[]){10, 12 + (float)(7 * i % 18), 10}, why);
        add_box(scene, box, (float[]){x + 4, 0, z + 11}, (float[]){2, 2, 2}, why);
    }
    must(umb_scene_commit(scene), why, "the commit");
    return scene;
}

static void look(umb_culler *culler, const umb_view *view, const char *name, const umb_error *why)
{
    umb_visible_set seen;
    must(umb_cull(culler, view, &seen), why, name);
    printf("%-15s %2u of %u objects, %u in its volume\n", name, (unsigned)seen.count,
           1 + 2 * TOWERS, (unsigned)seen.stats.in_frustum);
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

    umb_view camera;
    const double eye[3] = {0, 1.7, 12}, target[3] = {0, 1.7, 0}, up[3] = {0, 1, 0};
    if (umb_view_look_at(&camera, eye, target, up, 1.0, 1.6, 0.1, 120) != UMB_OK) {
        return 1;
    }
    look(cullers[0], &camera, "the camera", &why);

    /* Cascades: the near part of the picture and the rest, each with all that casts into it
     * from as far as the highest tower can. */
    static const double depths[CASCADES + 1] = {0.1, 20, 120};
    static const char *const names[CASCADES] = {"sun, near", "sun, far"};
    for (int i = 0; i < CASCADES; ++i) {
        umb_sun_def sun = {.camera = &camera,
                           .slice_near = depths[i],
                           .slice_far = depths[i + 1],
                           .direction = {1, -0.8, 0.3},
                           .reach = 60};
        umb_view view;
        must(umb_view_sun(&view, &sun, &why), &why, names[i]);
        look(cullers[1 + i], &view, names[i], &why);
    }

    umb_spot_def lamp = {.eye = {0, 8, -20},
                         .direction = {-1, -1, -0.5},
                         .angle = 1.2,
                         .near_depth = 0.1,
                         .range = 25};
    umb_view view;
    must(umb_view_spot(&view, &lamp, &why), &why, "the lamp");
    look(cullers[CASCADES + 1], &view, "the lamp", &why);

    for (int i = 0; i < CASCADES + 2; ++i) {
        umb_culler_destroy(cullers[i]);
    }
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    return 0;
}

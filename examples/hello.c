#include <stdio.h>
#include <umbrage/umbrage.h>

int main(void)
{
    static const char *names[] = {"a wall", "a box behind the wall", "a box beside the wall"};
    static const float xyz[] = {-4, 0, 0, 4, 0, 0, 4, 3, 0, -4, 3, 0};
    static const uint32_t tri[] = {0, 1, 2, 0, 2, 3};
    umb_shape_def plate = {.positions = xyz, .position_count = 4, .indices = tri, .index_count = 6};
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
    umb_shape wall;
    umb_view view;
    umb_visible_set seen;
    uint32_t id;

    umb_scene_create(&(umb_scene_def){0}, &scene);
    umb_scene_add_shape(scene, &plate, &wall);
    umb_scene_add_object(scene, &(umb_object_def){.shape = wall}, &id);
    umb_scene_add_object(scene, &(umb_object_def){.bounds = {{-1, 0, -3}, {1, 2, -1}}}, &id);
    umb_scene_add_object(scene, &(umb_object_def){.bounds = {{5, 0, -3}, {7, 2, -1}}}, &id);
    umb_scene_commit(scene);
    umb_index_create(scene, &(umb_index_def){0}, &index);
    umb_culler_create(index, &(umb_culler_def){0}, &culler);

    const double eye[] = {0, 1.5, 10}, target[] = {0, 1.5, 0}, up[] = {0, 1, 0};
    umb_view_look_at(&view, eye, target, up, 1.0, 2.0, 0.1, 100.0);
    umb_cull(culler, &view, &seen);
    for (uint32_t k = 0; k < seen.count; ++k) {
        printf("visible: %s\n", names[seen.objects[k]]);
    }
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
}

/* The life of welded groups; weld.c makes them. */
#include "scene_state.h"

void umb_weld_group_free(const umb_allocator *allocator, umb_weld_group *group)
{
    if (group == NULL) {
        return;
    }
    for (uint32_t i = 0; i < group->mesh_count; ++i) {
        umb_mesh_destroy(allocator, group->meshes[i]);
    }
    umb_memory_free(allocator, group, group->bytes);
}

void umb_weld_dissolve(umb_scene *scene, uint32_t group)
{
    if (group == UMB_NONE || scene->groups[group] == NULL) {
        return;
    }
    umb_weld_group *g = scene->groups[group];
    for (uint32_t i = 0; i < g->member_count; ++i) {
        scene->objects[g->members[i]].weld = UMB_NONE;
        umb_scene_touch_object(scene, g->members[i]);
    }
    g->next = scene->retired;
    scene->retired = g;
    scene->groups[group] = NULL;
    scene->structure_changed = true;
}

void umb_weld_free_retired(umb_scene *scene)
{
    while (scene->retired != NULL) {
        umb_weld_group *next = scene->retired->next;
        umb_weld_group_free(&scene->allocator, scene->retired);
        scene->retired = next;
    }
}

#include "scene_state.h"

umb_result umb_scene_weld(umb_scene *scene, const umb_weld_def *def, umb_weld_stats *stats)
{
    (void)def;
    umb_weld_stats s = {0};
    for (uint32_t i = 0; i < scene->object_ids.used; ++i) {
        const umb_object_slot *slot = &scene->objects[i];
        if (umb_scene_object_hides(scene, slot) && (slot->flags & UMB_OBJECT_STATIC) != 0) {
            uint32_t triangles = umb_scene_mesh(scene, slot->placement.shape)->triangle_count;
            s.objects += 1;
            s.triangles_in += triangles;
            s.triangles_out += triangles;
        }
    }
    if (stats != NULL) {
        *stats = s;
    }
    return UMB_OK;
}

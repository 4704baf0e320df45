/* Joining static objects that touch: umb_scene_weld(). The steps are in weld_seal.c, weld_split.c,
 * weld_merge.c and weld_cluster.c; weld_group.c says how welds end. */
#include "weld_soup.h"

#define DEFAULT_CLUSTER 16u
#define DEFAULT_RING 1u

/* Splitting an edge can make triangles equal that were not: then they are matched once more. */
static bool clean(umb_weld_soup *soup)
{
    if (!umb_weld_seal(soup) || !umb_weld_split(soup)) {
        return false;
    }
    return soup->stats.t_junctions == 0 || umb_weld_seal(soup);
}

/* Put the new groups in the place of the old ones. Room for them has been made. */
static void replace_groups(umb_scene *scene, umb_weld_group **groups, uint32_t count)
{
    for (uint32_t g = 0; g < scene->group_count; ++g) {
        umb_weld_dissolve(scene, g);
    }
    for (uint32_t g = 0; g < count; ++g) {
        scene->groups[g] = groups[g];
        for (uint32_t i = 0; i < groups[g]->member_count; ++i) {
            scene->objects[groups[g]->members[i]].weld = g;
            umb_scene_touch_object(scene, groups[g]->members[i]);
        }
    }
    scene->group_count = count;
    scene->groups_changed = true;
    scene->structure_changed = true;
}

/* Triangles of the static objects that still hide by their own shapes. */
static uint32_t count_own(const umb_scene *scene)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < scene->object_ids.used; ++i) {
        const umb_object_slot *slot = &scene->objects[i];
        if (slot->weld == UMB_NONE && (slot->flags & UMB_OBJECT_STATIC) != 0 && slot->mover == UMB_NONE &&
            umb_scene_object_hides(scene, slot)) {
            count += umb_scene_mesh(scene, slot->placement.shape)->triangle_count;
        }
    }
    return count;
}

static umb_result weld(umb_scene *scene, umb_weld_soup *soup, umb_scratch *scratch,
                       uint32_t cluster_triangles, uint32_t ring)
{
    umb_result result = umb_weld_soup_collect(soup, scene);
    if (result != UMB_OK) {
        return result;
    }
    umb_weld_group **groups = NULL;
    uint32_t count = 0;
    if (!clean(soup) || !umb_weld_unite(soup) || !umb_weld_merge(soup) ||
        !umb_weld_cluster(soup, scratch, cluster_triangles, ring, &groups, &count)) {
        return UMB_ERROR_MEMORY;
    }
    if (!umb_memory_reserve(&scene->allocator, (void **)&scene->groups, &scene->group_capacity,
                            count, sizeof *scene->groups)) {
        for (uint32_t g = 0; g < count; ++g) {
            umb_weld_group_free(&scene->allocator, groups[g]);
        }
        return UMB_ERROR_MEMORY;
    }
    replace_groups(scene, groups, count);
    soup->stats.triangles_out += count_own(scene);
    return UMB_OK;
}

umb_result umb_scene_weld(umb_scene *scene, const umb_weld_def *def, umb_weld_stats *stats)
{
    static const umb_weld_def defaults = {0};
    def = def != NULL ? def : &defaults;
    uint32_t cluster = def->cluster_triangles != 0 ? def->cluster_triangles : DEFAULT_CLUSTER;
    uint32_t ring = def->ring != 0 ? def->ring : DEFAULT_RING;
    if (cluster > (1u << 20) || ring > 64) {
        return umb_scene_fail(scene, UMB_ERROR_ARGUMENT,
                              "a welded occluder has at most 2^20 triangles and 64 rings");
    }
    umb_weld_soup soup = {.allocator = &scene->allocator, .tasks = &def->tasks};
    umb_scratch scratch = {.allocator = &scene->allocator};
    umb_result result = weld(scene, &soup, &scratch, cluster, ring);
    umb_scratch_free(&scratch);
    umb_weld_soup_free(&soup);
    if (result == UMB_OK) {
        if (stats != NULL) {
            *stats = soup.stats;
        }
        return UMB_OK;
    }
    return umb_scene_fail(scene, result, "%s for welding static objects", umb_result_name(result));
}

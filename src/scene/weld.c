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
        if (slot->weld == UMB_NONE && umb_weld_is_member(scene, slot)) {
            count += umb_scene_mesh(scene, slot->placement.shape)->triangle_count;
        }
    }
    return count;
}

/* What is found, mask after mask: objects of different layers do not hide together. */
typedef struct welding {
    umb_scene *scene;
    const umb_tasks *tasks;
    uint32_t cluster_triangles, ring;
    umb_weld_group **groups;
    size_t group_capacity;
    uint32_t group_count;
    umb_weld_stats stats;
} welding;

static void add_stats(umb_weld_stats *sum, const umb_weld_stats *one)
{
    sum->objects += one->objects;
    sum->groups += one->groups;
    sum->occluders += one->occluders;
    sum->triangles_in += one->triangles_in;
    sum->triangles_out += one->triangles_out;
    sum->duplicates += one->duplicates;
    sum->sealed += one->sealed;
    sum->t_junctions += one->t_junctions;
    sum->merged += one->merged;
}

static umb_result weld_soup(welding *w, umb_weld_soup *soup, umb_scratch *scratch)
{
    umb_result result = umb_weld_soup_collect(soup, w->scene);
    if (result != UMB_OK) {
        return result;
    }
    umb_weld_group **groups = NULL;
    uint32_t count = 0;
    if (!clean(soup) || !umb_weld_unite(soup) || !umb_weld_merge(soup) ||
        !umb_weld_cluster(soup, scratch, w->cluster_triangles, w->ring, &groups, &count)) {
        return UMB_ERROR_MEMORY;
    }
    bool room = umb_memory_reserve(&w->scene->allocator, (void **)&w->groups, &w->group_capacity,
                                   (size_t)w->group_count + count, sizeof *w->groups);
    for (uint32_t g = 0; g < count; ++g) {
        groups[g]->mask = soup->mask;
        if (room) {
            w->groups[w->group_count++] = groups[g];
        } else {
            umb_weld_group_free(&w->scene->allocator, groups[g]);
        }
    }
    add_stats(&w->stats, &soup->stats);
    return room ? UMB_OK : UMB_ERROR_MEMORY;
}

/* Objects of one mask. */
static umb_result weld_mask(welding *w, uint32_t mask)
{
    umb_weld_soup soup = {.allocator = &w->scene->allocator, .tasks = w->tasks, .mask = mask};
    umb_scratch scratch = {.allocator = &w->scene->allocator};
    umb_result result = weld_soup(w, &soup, &scratch);
    umb_scratch_free(&scratch);
    umb_weld_soup_free(&soup);
    return result;
}

/* The least mask of an object from one on; false if there is none. */
static bool next_mask(const umb_scene *scene, uint64_t from, uint32_t *out)
{
    bool any = false;
    for (uint32_t i = 0; i < scene->object_ids.used; ++i) {
        const umb_object_slot *slot = &scene->objects[i];
        if (umb_weld_is_member(scene, slot) && slot->mask >= from && (!any || slot->mask < *out)) {
            *out = slot->mask;
            any = true;
        }
    }
    return any;
}

static umb_result weld(welding *w)
{
    umb_scene *scene = w->scene;
    uint32_t mask = 0;
    for (uint64_t from = 0; next_mask(scene, from, &mask); from = (uint64_t)mask + 1) {
        umb_result result = weld_mask(w, mask);
        if (result != UMB_OK) {
            return result;
        }
    }
    if (!umb_memory_reserve(&scene->allocator, (void **)&scene->groups, &scene->group_capacity, w->group_count,
                            sizeof *scene->groups)) {
        return UMB_ERROR_MEMORY;
    }
    replace_groups(scene, w->groups, w->group_count);
    w->group_count = 0; /* they are the scene's now */
    w->stats.triangles_out += count_own(scene);
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
    welding w = {.scene = scene, .tasks = &def->tasks, .cluster_triangles = cluster, .ring = ring};
    umb_result result = weld(&w);
    for (uint32_t g = 0; g < w.group_count; ++g) {
        umb_weld_group_free(&scene->allocator, w.groups[g]);
    }
    umb_memory_free(&scene->allocator, w.groups, w.group_capacity * sizeof *w.groups);
    if (result == UMB_OK) {
        if (stats != NULL) {
            *stats = w.stats;
        }
        return UMB_OK;
    }
    return umb_scene_fail(scene, result, "%s for welding static objects", umb_result_name(result));
}

#include "weld_soup.h"

#include <string.h>

#include "base/sort.h"
#include "geometry/collinear.h"
#include "geometry/transform.h"
#include "position_hash.h"

#define MAX_TRIANGLES (1u << 30)

typedef struct collect_task {
    umb_scene *scene;
    const uint32_t *members; /* objects looked at */
    const uint32_t *offsets; /* first world position of each */
    float (*world)[3];
} collect_task;

static void transform_member(void *data, uint32_t i)
{
    const collect_task *c = data;
    const umb_placement *p = &c->scene->objects[c->members[i]].placement;
    const umb_mesh *mesh = umb_scene_mesh(c->scene, p->shape);
    float(*out)[3] = c->world + c->offsets[i];
    for (uint32_t k = 0; k < mesh->block_position_count; ++k) {
        if (p->identity) {
            memcpy(out[k], mesh->positions[k], sizeof out[k]);
        } else {
            umb_transform_point(&p->transform, mesh->positions[k], out[k]);
        }
        for (int j = 0; j < 3; ++j) {
            out[k][j] += 0.0f; /* -0 becomes 0 */
        }
    }
}

/* Number world positions by first use; numbers[i] is the vertex of world[i]. */
static bool merge_positions(umb_weld_soup *soup, umb_scratch *scratch, const float (*world)[3],
                            uint32_t count, uint32_t *numbers)
{
    size_t size = 16;
    while (size < 2 * (size_t)count) {
        size *= 2;
    }
    uint32_t *table = umb_scratch_get(scratch, size, sizeof *table);
    if (table == NULL ||
        !umb_memory_reserve(soup->allocator, (void **)&soup->positions, &soup->position_capacity,
                            count, sizeof *soup->positions)) {
        return false;
    }
    memset(table, 0xFF, size * sizeof *table);
    for (uint32_t i = 0; i < count; ++i) {
        size_t slot = umb_position_hash(world[i]) & (size - 1);
        while (table[slot] != UMB_NONE &&
               memcmp(soup->positions[table[slot]], world[i], sizeof world[i]) != 0) {
            slot = (slot + 1) & (size - 1);
        }
        if (table[slot] == UMB_NONE) {
            table[slot] = soup->position_count;
            memcpy(soup->positions[soup->position_count++], world[i], sizeof world[i]);
        }
        numbers[i] = table[slot];
    }
    umb_scratch_drop(scratch, table);
    return true;
}

/* Rounding a world vertex may flatten a triangle; such a one covers nothing. */
static bool is_flat(const umb_weld_soup *soup, const uint32_t v[3])
{
    return umb_collinear(soup->positions[v[0]], soup->positions[v[1]], soup->positions[v[2]]);
}

static void add_triangles(umb_weld_soup *soup, const umb_scene *scene, uint32_t object,
                          const uint32_t *numbers)
{
    const umb_placement *p = &scene->objects[object].placement;
    const umb_mesh *mesh = umb_scene_mesh(scene, p->shape);
    for (uint32_t t = 0; t < mesh->triangle_count; ++t) {
        const uint32_t *c = mesh->triangles[t];
        umb_weld_triangle w = {
            {numbers[c[0]], numbers[c[p->mirrored ? 2 : 1]], numbers[c[p->mirrored ? 1 : 2]]},
            object,
            mesh->two_sided[t]};
        if (!is_flat(soup, w.v)) {
            soup->triangles[soup->triangle_count++] = w;
        }
    }
}

static umb_result collect(umb_weld_soup *soup, umb_scene *scene, umb_scratch *scratch)
{
    uint32_t *members = umb_scratch_get(scratch, soup->object_count, sizeof *members);
    uint32_t *offsets = umb_scratch_get(scratch, soup->object_count, sizeof *offsets);
    if (scratch->failed) {
        return UMB_ERROR_MEMORY;
    }
    uint64_t position_count = 0, triangle_count = 0;
    uint32_t count = 0;
    for (uint32_t i = 0; i < soup->object_count; ++i) {
        if (scene->objects[i].mask == soup->mask && umb_weld_is_member(scene, &scene->objects[i])) {
            const umb_mesh *mesh = umb_scene_mesh(scene, scene->objects[i].placement.shape);
            members[count] = i;
            offsets[count++] = (uint32_t)position_count;
            position_count += mesh->block_position_count;
            triangle_count += mesh->triangle_count;
            if (position_count > MAX_TRIANGLES || triangle_count > MAX_TRIANGLES) {
                return UMB_ERROR_LIMIT;
            }
        }
    }
    float(*world)[3] = umb_scratch_get(scratch, (size_t)position_count, sizeof *world);
    uint32_t *numbers = umb_scratch_get(scratch, (size_t)position_count, sizeof *numbers);
    if (scratch->failed ||
        !umb_memory_reserve(soup->allocator, (void **)&soup->triangles, &soup->triangle_capacity,
                            (size_t)triangle_count + 1, sizeof *soup->triangles)) {
        return UMB_ERROR_MEMORY;
    }
    collect_task task = {scene, members, offsets, world};
    umb_tasks_run(soup->tasks, transform_member, &task, count);
    if (!merge_positions(soup, scratch, (const float(*)[3])world, (uint32_t)position_count,
                         numbers)) {
        return UMB_ERROR_MEMORY;
    }
    for (uint32_t i = 0; i < count; ++i) {
        add_triangles(soup, scene, members[i], numbers + offsets[i]);
    }
    soup->stats.objects = count;
    soup->stats.triangles_in = (uint32_t)triangle_count;
    return UMB_OK;
}

umb_result umb_weld_soup_collect(umb_weld_soup *soup, umb_scene *scene)
{
    soup->object_count = scene->object_ids.used;
    soup->parents = umb_memory_allocate_zero(soup->allocator, soup->object_count,
                                             sizeof *soup->parents);
    soup->merged = umb_memory_allocate_zero(soup->allocator, soup->object_count,
                                            sizeof *soup->merged);
    if (soup->parents == NULL || soup->merged == NULL) {
        return UMB_ERROR_MEMORY;
    }
    for (uint32_t i = 0; i < soup->object_count; ++i) {
        soup->parents[i] = i;
    }
    umb_scratch scratch = {.allocator = soup->allocator};
    umb_result result = collect(soup, scene, &scratch);
    umb_scratch_free(&scratch);
    return result;
}

void umb_weld_soup_free(umb_weld_soup *soup)
{
    umb_memory_free(soup->allocator, soup->positions,
                    soup->position_capacity * sizeof *soup->positions);
    umb_memory_free(soup->allocator, soup->triangles,
                    soup->triangle_capacity * sizeof *soup->triangles);
    umb_memory_free(soup->allocator, soup->parents, soup->object_count * sizeof *soup->parents);
    umb_memory_free(soup->allocator, soup->merged, soup->object_count * sizeof *soup->merged);
}

uint32_t umb_weld_soup_root(umb_weld_soup *soup, uint32_t object)
{
    while (soup->parents[object] != object) {
        soup->parents[object] = soup->parents[soup->parents[object]];
        object = soup->parents[object];
    }
    return object;
}

void umb_weld_soup_unite(umb_weld_soup *soup, uint32_t a, uint32_t b)
{
    a = umb_weld_soup_root(soup, a);
    b = umb_weld_soup_root(soup, b);
    /* The lowest object stands for all, whatever the order of the calls. */
    if (a < b) {
        soup->parents[b] = a;
    } else {
        soup->parents[a] = b;
    }
}

void umb_weld_soup_compact(umb_weld_soup *soup)
{
    uint32_t count = 0;
    for (uint32_t t = 0; t < soup->triangle_count; ++t) {
        if (soup->triangles[t].v[0] != UMB_NONE) {
            soup->triangles[count++] = soup->triangles[t];
        }
    }
    soup->triangle_count = count;
}

bool umb_weld_edges_build(umb_weld_edges *edges, umb_scratch *scratch, const umb_weld_soup *soup)
{
    size_t n = (size_t)soup->triangle_count * 3;
    edges->count = (uint32_t)n;
    edges->keys = umb_scratch_get(scratch, n, sizeof *edges->keys);
    edges->halves = umb_scratch_get(scratch, n, sizeof *edges->halves);
    uint64_t *key_scratch = umb_scratch_get(scratch, n, sizeof *key_scratch);
    uint32_t *value_scratch = umb_scratch_get(scratch, n, sizeof *value_scratch);
    if (scratch->failed) {
        return false;
    }
    for (uint32_t h = 0; h < n; ++h) {
        const uint32_t *v = soup->triangles[h / 3].v;
        uint32_t from = v[h % 3], to = v[(h % 3 + 1) % 3];
        edges->keys[h] = from < to ? (uint64_t)from << 32 | to : (uint64_t)to << 32 | from;
        edges->halves[h] = h;
    }
    umb_sort_keys(edges->keys, edges->halves, key_scratch, value_scratch, n);
    umb_scratch_drop(scratch, key_scratch);
    umb_scratch_drop(scratch, value_scratch);
    return true;
}

void umb_weld_edges_drop(umb_weld_edges *edges, umb_scratch *scratch)
{
    umb_scratch_drop(scratch, edges->keys);
    umb_scratch_drop(scratch, edges->halves);
}

bool umb_weld_unite(umb_weld_soup *soup)
{
    umb_scratch scratch = {.allocator = soup->allocator};
    umb_weld_edges edges;
    bool ok = umb_weld_edges_build(&edges, &scratch, soup);
    for (uint32_t i = 1; ok && i < edges.count; ++i) {
        if (edges.keys[i] == edges.keys[i - 1]) {
            umb_weld_soup_unite(soup, soup->triangles[edges.halves[i] / 3].object,
                                soup->triangles[edges.halves[i - 1] / 3].object);
        }
    }
    umb_scratch_free(&scratch);
    return ok;
}

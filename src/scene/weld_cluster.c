/* Groups of objects that touch, cut into clusters: occluders small enough to be found, ordered and
 * hidden one by one.
 *
 * A cut between clusters P and Q would be a border edge of both, and no pixel that it meets would
 * be covered by either: a crack. So each cluster carries a ring of the triangles around it:
 *
 *      +---+---+---+---+---+---+         P's own triangles are left of the cut, Q's right of it. P with
 *      | P | P |(P)|(Q)| Q | Q |         its ring reaches one triangle further, so does Q. What meets
 *      |   |   |   |   |   |   |         the cut is inside both; P's new border lies inside Q.
 *      +---+---+---+---+---+---+
 *            ring of Q ^ ^ ring of P
 *
 * The ring holds the triangles that share a vertex with the cluster, not only those that share an
 * edge: where the corners of three clusters meet, the corner too must lie inside one occluder, or a
 * pinhole stays there. Every point of the group's surface is then inside some cluster with all the
 * triangles around it. */
#include <pthread.h>
#include <string.h>

#include "mesh_parts.h"
#include "weld_soup.h"

#define SMALL_GROUP 16u  /* groups of up to so many clusters may stay whole; larger ones never do */
#define RING_LIMIT 512u  /* most triangles of a ring: fans */
#define LEAST_CLUSTER 8u /* smaller ones cost more to draw than they bring nearer */

typedef struct clusterer {
    umb_weld_soup *soup;
    umb_scratch *scratch;
    uint32_t target, ring;
    uint32_t *group_of; /* per object, UMB_NONE: hides by its own shape */
    uint32_t *order;    /* triangles of groups, clusters in a row */
    uint32_t order_count;
    uint32_t *starts; /* first triangle of each cluster in order */
    uint32_t *owners; /* group of each cluster */
    uint32_t cluster_count, group_count;
    uint32_t *lists; /* triangles of each cluster, its ring at the end */
    size_t list_capacity;
    uint32_t *list_starts;
    uint32_t *vertex_starts, *vertex_triangles; /* triangles around each vertex */
} clusterer;

/* The tasks share the caller's allocator: one at a time. */
typedef struct shared_allocator {
    umb_allocator inner;
    pthread_mutex_t mutex;
} shared_allocator;

typedef struct mesh_task {
    const clusterer *c;
    const umb_allocator *allocator;
    umb_mesh **meshes;
} mesh_task;

/* Which sets of objects become groups, numbered by their lowest object. */
static bool choose_groups(clusterer *c)
{
    umb_weld_soup *soup = c->soup;
    c->group_of = umb_scratch_get(c->scratch, soup->object_count, sizeof *c->group_of);
    uint32_t *members = umb_scratch_get_zero(c->scratch, soup->object_count, sizeof *members);
    uint32_t *triangles = umb_scratch_get_zero(c->scratch, soup->object_count, sizeof *triangles);
    if (c->scratch->failed) {
        return false;
    }
    for (uint32_t i = 0; i < soup->object_count; ++i) {
        members[umb_weld_soup_root(soup, i)] += 1;
    }
    for (uint32_t t = 0; t < soup->triangle_count; ++t) {
        triangles[umb_weld_soup_root(soup, soup->triangles[t].object)] += 1;
    }
    for (uint32_t i = 0; i < soup->object_count; ++i) {
        /* The root is the lowest object of its set, so its number is known by now. */
        uint32_t root = umb_weld_soup_root(soup, i);
        if (root != i) {
            c->group_of[i] = c->group_of[root];
        } else if (triangles[i] > 0 && (members[i] > 1 || (uint64_t)triangles[i] + soup->merged[i] >
                                                              (uint64_t)SMALL_GROUP * c->target)) {
            c->group_of[i] = c->group_count++;
            c->order_count += triangles[i];
        } else {
            c->group_of[i] = UMB_NONE;
        }
    }
    umb_scratch_drop(c->scratch, members);
    umb_scratch_drop(c->scratch, triangles);
    return true;
}

static uint32_t group_of_triangle(const clusterer *c, uint32_t t)
{
    return c->group_of[c->soup->triangles[t].object];
}

/* Cut the triangles [begin, end) of one group into clusters: parts, as of an object's shape. A
 * small solid is one cluster; a level's walls become clusters of their own, because an occluder
 * that is there several times along a sight-line is only as near as the farthest. */
static bool cut_group(clusterer *c, uint32_t group, uint32_t begin, uint32_t end)
{
    uint32_t n = end - begin, part_count = 0, *part_order = NULL;
    uint32_t(*triangles)[3] = umb_scratch_get(c->scratch, n, sizeof *triangles);
    uint32_t *order = umb_scratch_get(c->scratch, n, sizeof *order);
    for (uint32_t i = 0; i < n && !c->scratch->failed; ++i) {
        memcpy(triangles[i], c->soup->triangles[c->order[begin + i]].v, sizeof triangles[i]);
        order[i] = c->order[begin + i];
    }
    umb_parts_rule rule = {c->target < LEAST_CLUSTER ? c->target : LEAST_CLUSTER,
                           n <= SMALL_GROUP * c->target ? n : c->target};
    const umb_part *parts = c->scratch->failed
                                ? NULL
                                : umb_mesh_parts_build(c->scratch,
                                                       (const float(*)[3])c->soup->positions,
                                                       (const uint32_t(*)[3])triangles, n, rule,
                                                       &part_count, &part_order);
    if (parts == NULL || c->scratch->failed) {
        return false;
    }
    for (uint32_t i = 0; i < n; ++i) {
        c->order[begin + i] = order[part_order[i]];
    }
    for (uint32_t i = 0; i < part_count; ++i) {
        if (parts[i].skip == i + 1) {
            c->starts[c->cluster_count] = begin + parts[i].begin;
            c->owners[c->cluster_count++] = group;
        }
    }
    umb_scratch_drop(c->scratch, (void *)(uintptr_t)parts);
    umb_scratch_drop(c->scratch, part_order);
    umb_scratch_drop(c->scratch, order);
    umb_scratch_drop(c->scratch, triangles);
    return true;
}

static bool cut_groups(clusterer *c)
{
    size_t n = c->order_count;
    uint32_t *group_starts = umb_scratch_get_zero(c->scratch, (size_t)c->group_count + 2,
                                                  sizeof *group_starts);
    c->order = umb_scratch_get(c->scratch, n, sizeof *c->order);
    c->starts = umb_scratch_get(c->scratch, n + 1, sizeof *c->starts);
    c->owners = umb_scratch_get(c->scratch, n, sizeof *c->owners);
    if (c->scratch->failed) {
        return false;
    }
    for (uint32_t t = 0; t < c->soup->triangle_count; ++t) {
        uint32_t g = group_of_triangle(c, t);
        group_starts[g == UMB_NONE ? c->group_count + 1 : g + 2] += g == UMB_NONE ? 0 : 1;
    }
    for (uint32_t g = 2; g <= c->group_count; ++g) {
        group_starts[g] += group_starts[g - 1];
    }
    for (uint32_t t = 0; t < c->soup->triangle_count; ++t) {
        uint32_t g = group_of_triangle(c, t);
        if (g != UMB_NONE) {
            c->order[group_starts[g + 1]++] = t;
        }
    }
    for (uint32_t g = 0; g < c->group_count; ++g) {
        if (!cut_group(c, g, group_starts[g], group_starts[g + 1])) {
            return false;
        }
    }
    c->starts[c->cluster_count] = c->order_count;
    umb_scratch_drop(c->scratch, group_starts);
    return true;
}

static bool list_vertices(clusterer *c)
{
    const umb_weld_soup *soup = c->soup;
    c->vertex_starts = umb_scratch_get_zero(c->scratch, (size_t)soup->position_count + 2,
                                            sizeof *c->vertex_starts);
    c->vertex_triangles = umb_scratch_get(c->scratch, (size_t)soup->triangle_count * 3,
                                          sizeof *c->vertex_triangles);
    if (c->scratch->failed) {
        return false;
    }
    for (uint32_t t = 0; t < soup->triangle_count; ++t) {
        for (int k = 0; k < 3; ++k) {
            c->vertex_starts[soup->triangles[t].v[k] + 2] += 1;
        }
    }
    for (uint32_t v = 2; v <= soup->position_count + 1; ++v) {
        c->vertex_starts[v] += c->vertex_starts[v - 1];
    }
    for (uint32_t t = 0; t < soup->triangle_count; ++t) {
        for (int k = 0; k < 3; ++k) {
            c->vertex_triangles[c->vertex_starts[soup->triangles[t].v[k] + 1]++] = t;
        }
    }
    return true;
}

/* Append the triangles around vertex v that are of the cluster's group and not in its list yet. */
static uint32_t add_around(const clusterer *c, uint32_t v, uint32_t cluster, uint32_t *stamps,
                           uint32_t *list, uint32_t count, uint32_t limit)
{
    for (uint32_t i = c->vertex_starts[v]; i < c->vertex_starts[v + 1] && count < limit; ++i) {
        uint32_t t = c->vertex_triangles[i];
        if (stamps[t] != cluster && group_of_triangle(c, t) == c->owners[cluster]) {
            stamps[t] = cluster;
            list[count++] = t;
        }
    }
    return count;
}

static bool add_rings(clusterer *c)
{
    uint32_t *stamps = umb_scratch_get(c->scratch, c->soup->triangle_count, sizeof *stamps);
    uint32_t *vertex_stamps = umb_scratch_get(c->scratch, c->soup->position_count,
                                              sizeof *vertex_stamps);
    c->list_starts = umb_scratch_get(c->scratch, (size_t)c->cluster_count + 1,
                                     sizeof *c->list_starts);
    if (c->scratch->failed || !list_vertices(c)) {
        return false;
    }
    memset(stamps, 0xFF, c->soup->triangle_count * sizeof *stamps);
    memset(vertex_stamps, 0xFF, c->soup->position_count * sizeof *vertex_stamps);
    uint64_t total = 0;
    for (uint32_t k = 0; k < c->cluster_count; ++k) {
        uint32_t own = c->starts[k + 1] - c->starts[k];
        uint64_t limit = (uint64_t)own + RING_LIMIT;
        if (total + limit > UINT32_MAX ||
            !umb_memory_reserve(c->soup->allocator, (void **)&c->lists, &c->list_capacity,
                                (size_t)(total + limit), sizeof *c->lists)) {
            return false;
        }
        uint32_t *list = c->lists + total;
        uint32_t count = own, done = 0;
        memcpy(list, c->order + c->starts[k], own * sizeof *list);
        for (uint32_t i = 0; i < own; ++i) {
            stamps[list[i]] = k;
        }
        for (uint32_t r = 0; r < c->ring && done < count; ++r) {
            uint32_t end = count;
            for (; done < end; ++done) {
                for (int j = 0; j < 3; ++j) {
                    uint32_t v = c->soup->triangles[list[done]].v[j];
                    if (vertex_stamps[v] != k) {
                        vertex_stamps[v] = k;
                        count = add_around(c, v, k, stamps, list, count, (uint32_t)limit);
                    }
                }
            }
        }
        c->list_starts[k] = (uint32_t)total;
        total += count;
    }
    c->list_starts[c->cluster_count] = (uint32_t)total;
    umb_scratch_drop(c->scratch, stamps);
    umb_scratch_drop(c->scratch, vertex_stamps);
    return true;
}

static void *shared_reallocate(void *user, void *old, size_t old_size, size_t new_size)
{
    shared_allocator *s = user;
    pthread_mutex_lock(&s->mutex);
    void *p = s->inner.reallocate(s->inner.user, old, old_size, new_size);
    pthread_mutex_unlock(&s->mutex);
    return p;
}

static void make_mesh(void *data, uint32_t k)
{
    const mesh_task *task = data;
    const clusterer *c = task->c;
    const uint32_t *list = c->lists + c->list_starts[k];
    uint32_t n = c->list_starts[k + 1] - c->list_starts[k];
    umb_scratch scratch = {.allocator = task->allocator};
    float(*positions)[3] = umb_scratch_get(&scratch, (size_t)n * 3, sizeof *positions);
    uint32_t *indices = umb_scratch_get(&scratch, (size_t)n * 3, sizeof *indices);
    uint8_t *flags = umb_scratch_get(&scratch, n, sizeof *flags);
    if (!scratch.failed) {
        for (uint32_t i = 0; i < n; ++i) {
            const umb_weld_triangle *t = &c->soup->triangles[list[i]];
            flags[i] = t->two_sided ? UMB_TRIANGLE_TWO_SIDED : 0;
            for (uint32_t j = 0; j < 3; ++j) {
                memcpy(positions[3 * i + j], c->soup->positions[t->v[j]], sizeof *positions);
                indices[3 * i + j] = 3 * i + j;
            }
        }
        umb_shape_def def = {.positions = positions[0],
                             .position_count = 3 * n,
                             .indices = indices,
                             .index_count = 3 * n,
                             .triangle_flags = flags};
        (void)umb_mesh_create_occluder(task->allocator, &def, &task->meshes[k]);
    }
    umb_scratch_free(&scratch);
}

/* A mesh for each cluster; on failure those made are destroyed. */
static bool make_meshes(const clusterer *c, umb_mesh **meshes)
{
    shared_allocator shared = {.inner = *c->soup->allocator};
    if (pthread_mutex_init(&shared.mutex, NULL) != 0) {
        return false;
    }
    umb_allocator allocator = {shared_reallocate, &shared};
    mesh_task task = {c, &allocator, meshes};
    umb_tasks_run(c->soup->tasks, make_mesh, &task, c->cluster_count);
    pthread_mutex_destroy(&shared.mutex);
    bool all = true;
    for (uint32_t k = 0; k < c->cluster_count; ++k) {
        all = all && meshes[k] != NULL;
    }
    for (uint32_t k = 0; !all && k < c->cluster_count; ++k) {
        umb_mesh_destroy(c->soup->allocator, meshes[k]);
        meshes[k] = NULL;
    }
    return all;
}

static umb_weld_group *make_group(const clusterer *c, uint32_t member_count, uint32_t mesh_count)
{
    size_t bytes = sizeof(umb_weld_group) + mesh_count * sizeof(umb_mesh *) +
                   ((size_t)member_count + mesh_count) * sizeof(uint32_t);
    char *block = umb_memory_allocate(c->soup->allocator, bytes);
    if (block == NULL) {
        return NULL;
    }
    umb_weld_group *g = (umb_weld_group *)(void *)block;
    *g = (umb_weld_group){.bytes = bytes};
    g->meshes = (umb_mesh **)(void *)(block + sizeof *g);
    g->members = (uint32_t *)(void *)(block + sizeof *g + mesh_count * sizeof(umb_mesh *));
    g->numbers = g->members + member_count;
    return g;
}

/* Empty groups with room for their members and meshes. */
static bool make_groups(const clusterer *c, umb_weld_group **groups)
{
    uint32_t *members = umb_scratch_get_zero(c->scratch, c->group_count, sizeof *members);
    uint32_t *meshes = umb_scratch_get_zero(c->scratch, c->group_count, sizeof *meshes);
    bool ok = !c->scratch->failed;
    for (uint32_t i = 0; ok && i < c->soup->object_count; ++i) {
        if (c->group_of[i] != UMB_NONE) {
            members[c->group_of[i]] += 1;
        }
    }
    for (uint32_t k = 0; ok && k < c->cluster_count; ++k) {
        meshes[c->owners[k]] += 1;
    }
    for (uint32_t g = 0; ok && g < c->group_count; ++g) {
        groups[g] = make_group(c, members[g], meshes[g]);
        ok = groups[g] != NULL;
    }
    for (uint32_t i = 0; ok && i < c->soup->object_count; ++i) {
        if (c->group_of[i] != UMB_NONE) {
            umb_weld_group *g = groups[c->group_of[i]];
            g->members[g->member_count++] = i;
        }
    }
    for (uint32_t g = 0; !ok && groups != NULL && g < c->group_count; ++g) {
        umb_weld_group_free(c->soup->allocator, groups[g]);
        groups[g] = NULL;
    }
    return ok;
}

static bool build(clusterer *c, umb_weld_group ***out)
{
    if (!choose_groups(c) || !cut_groups(c) || !add_rings(c)) {
        return false;
    }
    umb_mesh **meshes = umb_scratch_get_zero(c->scratch, c->cluster_count, sizeof *meshes);
    umb_weld_group **groups = umb_scratch_get_zero(c->scratch, c->group_count, sizeof *groups);
    if (c->scratch->failed || !make_groups(c, groups)) {
        return false;
    }
    if (!make_meshes(c, meshes)) {
        for (uint32_t g = 0; g < c->group_count; ++g) {
            umb_weld_group_free(c->soup->allocator, groups[g]);
        }
        return false;
    }
    for (uint32_t k = 0; k < c->cluster_count; ++k) {
        umb_weld_group *g = groups[c->owners[k]];
        g->meshes[g->mesh_count++] = meshes[k];
    }
    *out = groups;
    return true;
}

bool umb_weld_cluster(umb_weld_soup *soup, umb_scratch *scratch, uint32_t cluster_triangles,
                      uint32_t ring, umb_weld_group ***groups, uint32_t *group_count)
{
    clusterer c = {.soup = soup, .scratch = scratch, .target = cluster_triangles, .ring = ring};
    bool ok = build(&c, groups);
    umb_memory_free(soup->allocator, c.lists, c.list_capacity * sizeof *c.lists);
    *group_count = ok ? c.group_count : 0;
    soup->stats.groups = c.group_count;
    soup->stats.occluders = c.cluster_count;
    soup->stats.triangles_out = c.order_count;
    return ok;
}

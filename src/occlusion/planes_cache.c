#include "planes_cache.h"

#include <string.h>

enum { LEAST_SETS = 64, MOST_SETS = 8192 };

/* About one for each object: nodes are fewer, and edges of several are held against each. */
static uint32_t sets_for(const umb_planes_cache *c, uint32_t objects)
{
    uint32_t n = c->set_count > LEAST_SETS ? c->set_count : LEAST_SETS;
    while (n < MOST_SETS && n < objects) {
        n *= 2;
    }
    return n;
}

bool umb_planes_cache_begin(umb_planes_cache *c, const umb_allocator *a, const umb_committed *scene, bool keep)
{
    uint32_t sets = keep ? sets_for(c, scene->object_count) : 0;
    if (c->frame == 0) {
        umb_tangent_table_make(&c->table);
    }
    bool stale = c->version != scene->version || c->frame == 0 || sets != c->set_count;
    if (keep && (!umb_memory_reserve(a, (void **)&c->sets, &c->set_capacity, sets, sizeof *c->sets) ||
                 !umb_memory_reserve(a, (void **)&c->entries, &c->entry_capacity, (size_t)sets * UMB_PLANES_WAYS,
                                     sizeof *c->entries))) {
        c->set_count = 0;
        return false;
    }
    c->frame = c->frame < UINT32_MAX ? c->frame + 1 : 1;
    stale = stale || c->frame == 1;
    c->set_count = sets;
    if (stale && keep) {
        memset(c->sets, 0, sets * sizeof *c->sets);
    }
    c->version = keep ? scene->version : 0;
    return true;
}

void umb_planes_cache_free(umb_planes_cache *c, const umb_allocator *a)
{
    umb_memory_free(a, c->sets, c->set_capacity * sizeof *c->sets);
    umb_memory_free(a, c->entries, c->entry_capacity * sizeof *c->entries);
    memset(c, 0, sizeof *c);
}

/* The entry of a node and an edge, or room for it: the one that was asked for longest ago. */
static umb_edge_planes *find(umb_planes_cache *c, uint32_t node, uint64_t edge)
{
    if (c->set_count == 0) {
        c->spare.known = 0;
        return &c->spare;
    }
    uint64_t h = (edge ^ (uint64_t)node * 0x9E3779B97F4A7C15u) * 0xBF58476D1CE4E5B9u;
    uint32_t at = (uint32_t)(h >> 40) & (c->set_count - 1), oldest = 0;
    umb_planes_set *set = &c->sets[at];
    for (uint32_t i = 0; i < UMB_PLANES_WAYS; ++i) {
        if (set->frames[i] != 0 && set->edges[i] == edge && set->nodes[i] == node) {
            set->frames[i] = c->frame;
            return &c->entries[at * UMB_PLANES_WAYS + i];
        }
        oldest = set->frames[i] < set->frames[oldest] ? i : oldest;
    }
    set->edges[oldest] = edge;
    set->nodes[oldest] = node;
    set->frames[oldest] = c->frame;
    umb_edge_planes *entry = &c->entries[at * UMB_PLANES_WAYS + oldest];
    entry->known = 0;
    return entry;
}

/* The plane through a, along d and through the box's corner; false if doubles hardly know its direction. */
static bool make_plane(const float a[3], umb_vec3 d, umb_vec3 to_corner, float out[4][UMB_NODE_WIDTH], uint32_t slot)
{
    umb_vec3 n = umb_vec3_cross(d, to_corner);
    double size = fmax(fabs(n.x), fmax(fabs(n.y), fabs(n.z)));
    if (!(size > 0x1p-24 * umb_vec3_sum_abs(d) * umb_vec3_sum_abs(to_corner)) || !(size < 1e300) || size < 1e-300) {
        return false;
    }
    n = umb_vec3_scale(n, 1.0 / size);
    const float rounded[3] = {(float)n.x, (float)n.y, (float)n.z};
    for (int i = 0; i < 3; ++i) {
        out[i][slot] = rounded[i];
    }
    out[3][slot] = (float)umb_vec3_dot(umb_vec3_from_float(rounded), umb_vec3_from_float(a));
    return true;
}

static umb_vec3 corner_from(const umb_aabb *box, uint8_t k, const float a[3])
{
    return umb_vec3_make((k & 1 ? box->max[0] : box->min[0]) - (double)a[0],
                         (k & 2 ? box->max[1] : box->min[1]) - (double)a[1],
                         (k & 4 ? box->max[2] : box->min[2]) - (double)a[2]);
}

static void fill(const umb_planes_cache *c, umb_edge_planes *e, const umb_node *boxes, const umb_blocker_edge *edge,
                 uint32_t slot)
{
    umb_aabb box;
    umb_tangents t;
    for (int i = 0; i < 3; ++i) {
        box.min[i] = boxes->min[i][slot];
        box.max[i] = boxes->max[i][slot];
    }
    umb_vec3 d = umb_vec3_sub(umb_vec3_from_float(edge->b), umb_vec3_from_float(edge->a));
    bool ok = umb_tangents_find(&c->table, edge->a, edge->b, &box, &t) &&
              make_plane(edge->a, d, corner_from(&box, t.supporting, edge->a), e->supporting, slot) &&
              make_plane(edge->a, d, corner_from(&box, t.separating, edge->a), e->separating, slot);
    e->known |= (uint8_t)(1u << slot);
    e->unsure = (uint8_t)(ok ? e->unsure & ~(1u << slot) : e->unsure | 1u << slot);
}

const umb_edge_planes *umb_planes_cache_get(umb_planes_cache *c, uint32_t node, const umb_node *boxes,
                                            const umb_blocker_edge *edge, uint32_t mask)
{
    umb_edge_planes *e = find(c, node, edge->id);
    uint32_t missing = mask & ~(uint32_t)e->known;
    c->kept += (uint32_t)__builtin_popcount(mask & e->known);
    c->made += (uint32_t)__builtin_popcount(missing);
    if (e->known == 0) {
        memset(e, 0, sizeof *e);
        e->size = fabsf(edge->a[0]) + fabsf(edge->a[1]) + fabsf(edge->a[2]);
    }
    for (; missing != 0; missing &= missing - 1) {
        fill(c, e, boxes, edge, (uint32_t)__builtin_ctz(missing));
    }
    return e;
}

/* All planes: of the edge and each corner, each held against all corners. */
bool umb_tangents_search(const float a[3], const float b[3], const umb_aabb *box, umb_tangents *out)
{
    umb_vec3 d = umb_vec3_sub(umb_vec3_from_float(b), umb_vec3_from_float(a));
    *out = (umb_tangents){UMB_TANGENT_NONE, UMB_TANGENT_NONE};
    for (uint8_t k = 0; k < 8; ++k) {
        umb_vec3 n = umb_vec3_cross(d, corner_from(box, k, a));
        bool before = true, behind = true;
        for (uint8_t other = 0; other < 8; ++other) {
            double side = other != k ? umb_vec3_dot(n, corner_from(box, other, a)) : 0.0;
            before = before && side >= 0.0;
            behind = behind && side <= 0.0;
        }
        out->supporting = before ? k : out->supporting;
        out->separating = behind ? k : out->separating;
    }
    return out->supporting != UMB_TANGENT_NONE && out->separating != UMB_TANGENT_NONE;
}

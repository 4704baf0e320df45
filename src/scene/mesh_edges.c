#include "mesh_edges.h"

#include "base/sort.h"

/* Above this many triangles at one edge, pairs are taken in order instead of by search. */
#define SEARCH_LIMIT 64u

typedef struct edges_builder {
    const uint32_t (*triangles)[3];
    const uint8_t *two_sided;
    uint64_t *keys;   /* lower vertex, higher vertex; sorted */
    uint32_t *halves; /* 3 * triangle + corner where the half-edge starts; beside the keys */
    uint8_t *used;    /* beside the keys */
    umb_edge *edges;
    uint32_t edge_count;
} edges_builder;

static uint32_t start_of(const edges_builder *b, uint32_t i)
{
    return b->triangles[b->halves[i] / 3][b->halves[i] % 3];
}

static uint32_t third_of(const edges_builder *b, uint32_t i)
{
    return b->triangles[b->halves[i] / 3][(b->halves[i] % 3 + 2) % 3];
}

static bool is_forward(const edges_builder *b, uint32_t i)
{
    return start_of(b, i) == (uint32_t)(b->keys[i] >> 32);
}

static void add_edge(edges_builder *b, uint32_t first, uint32_t f1)
{
    uint32_t low = (uint32_t)(b->keys[first] >> 32), high = (uint32_t)b->keys[first];
    bool forward = is_forward(b, first);
    umb_edge e = {forward ? low : high, forward ? high : low, b->halves[first] / 3, f1};
    b->edges[b->edge_count++] = e;
    b->used[first] = 1;
}

/* The best partner that runs the other way: not the same triangle turned over if there is another
 * (such a pair would tie a solid to its neighbour instead of to itself), else the nearest in the
 * file, which is likely of the same solid. */
static uint32_t find_opposite(const edges_builder *b, uint32_t i, uint32_t begin, uint32_t end)
{
    uint32_t best = UMB_NONE, best_distance = 0;
    bool best_turned = false;
    for (uint32_t j = begin; j < end; ++j) {
        if (b->used[j] || j == i || is_forward(b, j) == is_forward(b, i)) {
            continue;
        }
        bool turned = third_of(b, j) == third_of(b, i);
        uint32_t f = b->halves[i] / 3, g = b->halves[j] / 3;
        uint32_t distance = f < g ? g - f : f - g;
        if (best == UMB_NONE || (best_turned && !turned) ||
            (best_turned == turned && distance < best_distance)) {
            best = j;
            best_distance = distance;
            best_turned = turned;
        }
    }
    return best;
}

static void pair_opposite_in_order(edges_builder *b, uint32_t begin, uint32_t end)
{
    uint32_t i = begin, j = begin;
    for (;;) {
        while (i < end && !is_forward(b, i)) {
            ++i;
        }
        while (j < end && is_forward(b, j)) {
            ++j;
        }
        if (i >= end || j >= end) {
            return;
        }
        add_edge(b, i++, b->halves[j] / 3);
        b->used[j++] = 1;
    }
}

/* What has no opposite all runs one way. Two of these can still cancel when one is seen from
 * behind, which takes a two-sided one. */
static void pair_same(edges_builder *b, uint32_t begin, uint32_t end)
{
    uint32_t waiting = UMB_NONE;
    for (uint32_t i = begin; i < end; ++i) {
        if (b->used[i]) {
            continue;
        }
        if (waiting == UMB_NONE) {
            waiting = i;
            continue;
        }
        if (b->two_sided[b->halves[i] / 3] || b->two_sided[b->halves[waiting] / 3]) {
            add_edge(b, waiting, b->halves[i] / 3 | UMB_EDGE_SAME);
            b->used[i] = 1;
            waiting = UMB_NONE;
        } else {
            add_edge(b, waiting, UMB_NONE);
            waiting = i;
        }
    }
    if (waiting != UMB_NONE) {
        add_edge(b, waiting, UMB_NONE);
    }
}

static void pair_group(edges_builder *b, uint32_t begin, uint32_t end)
{
    if (end - begin > SEARCH_LIMIT) {
        pair_opposite_in_order(b, begin, end);
    } else {
        for (uint32_t i = begin; i < end; ++i) {
            if (b->used[i]) {
                continue;
            }
            uint32_t j = find_opposite(b, i, begin, end);
            if (j != UMB_NONE) {
                add_edge(b, i, b->halves[j] / 3);
                b->used[j] = 1;
            }
        }
    }
    pair_same(b, begin, end);
}

umb_edge *umb_mesh_edges_build(umb_scratch *scratch, const uint32_t (*triangles)[3],
                               const uint8_t *two_sided, uint32_t triangle_count,
                               uint32_t *edge_count)
{
    size_t n = (size_t)triangle_count * 3;
    uint64_t *keys = umb_scratch_get(scratch, n, sizeof *keys);
    uint64_t *key_scratch = umb_scratch_get(scratch, n, sizeof *key_scratch);
    uint32_t *halves = umb_scratch_get(scratch, n, sizeof *halves);
    uint32_t *value_scratch = umb_scratch_get(scratch, n, sizeof *value_scratch);
    uint8_t *used = umb_scratch_get_zero(scratch, n, sizeof *used);
    umb_edge *edges = umb_scratch_get(scratch, n, sizeof *edges);
    if (scratch->failed) {
        return NULL;
    }
    for (uint32_t h = 0; h < n; ++h) {
        uint32_t from = triangles[h / 3][h % 3], to = triangles[h / 3][(h % 3 + 1) % 3];
        keys[h] = from < to ? (uint64_t)from << 32 | to : (uint64_t)to << 32 | from;
        halves[h] = h;
    }
    umb_sort_keys(keys, halves, key_scratch, value_scratch, n);
    edges_builder b = {triangles, two_sided, keys, halves, used, edges, 0};
    for (uint32_t begin = 0, end; begin < n; begin = end) {
        end = begin + 1;
        while (end < n && keys[end] == keys[begin]) {
            ++end;
        }
        pair_group(&b, begin, end);
    }
    *edge_count = b.edge_count;
    umb_scratch_drop(scratch, keys);
    umb_scratch_drop(scratch, key_scratch);
    umb_scratch_drop(scratch, halves);
    umb_scratch_drop(scratch, value_scratch);
    umb_scratch_drop(scratch, used);
    return edges;
}

#include "mesh.h"

#include <math.h>
#include <string.h>

#include "base/scratch.h"
#include "geometry/collinear.h"
#include "geometry/transform.h"
#include "mesh_convex.h"
#include "mesh_edges.h"
#include "mesh_parts.h"
#include "position_hash.h"

#define MAX_COUNT (1u << 30)
#define ALIGNMENT 64u

/* Everything known of a shape before its size is known. */
typedef struct mesh_builder {
    const umb_shape_def *def;
    uint32_t stride, triangle_count;
    uint32_t *merged; /* per position of the definition: its vertex, or UMB_NONE */
    uint32_t *table;  /* hash table of vertices, UMB_NONE where empty */
    uint32_t table_mask;
    float (*positions)[3];
    uint32_t position_count, block_position_count;
    uint32_t (*triangles)[3]; /* blocking ones first */
    uint8_t *two_sided;
    uint32_t blocking_count;
} mesh_builder;

static void read_position(const mesh_builder *b, uint32_t i, float out[3])
{
    memcpy(out, (const char *)b->def->positions + (size_t)i * b->stride, 3 * sizeof(float));
    for (int k = 0; k < 3; ++k) {
        out[k] += 0.0f; /* -0 becomes 0 */
    }
}

static umb_result check_def(const umb_shape_def *def)
{
    if (def == NULL || def->positions == NULL || def->position_count == 0 ||
        def->index_count % 3 != 0 || (def->indices == NULL && def->index_count > 0) ||
        (def->position_stride != 0 && def->position_stride < 3 * sizeof(float))) {
        return UMB_ERROR_ARGUMENT;
    }
    if (def->position_count > MAX_COUNT || def->index_count / 3 > MAX_COUNT) {
        return UMB_ERROR_LIMIT;
    }
    for (uint32_t i = 0; i < def->index_count; ++i) {
        if (def->indices[i] >= def->position_count) {
            return UMB_ERROR_ARGUMENT;
        }
    }
    return UMB_OK;
}

static bool all_finite(const mesh_builder *b)
{
    for (uint32_t i = 0; i < b->def->position_count; ++i) {
        float p[3];
        read_position(b, i, p);
        if (!isfinite(p[0]) || !isfinite(p[1]) || !isfinite(p[2])) {
            return false;
        }
    }
    return true;
}

/* The vertex of position i of the definition, numbered by first use. */
static uint32_t merge_position(mesh_builder *b, uint32_t i)
{
    if (b->merged[i] != UMB_NONE) {
        return b->merged[i];
    }
    float p[3];
    read_position(b, i, p);
    uint32_t slot = umb_position_hash(p) & b->table_mask;
    while (b->table[slot] != UMB_NONE && memcmp(b->positions[b->table[slot]], p, sizeof p) != 0) {
        slot = (slot + 1) & b->table_mask;
    }
    if (b->table[slot] == UMB_NONE) {
        b->table[slot] = b->position_count;
        memcpy(b->positions[b->position_count], p, sizeof p);
        b->position_count += 1;
    }
    b->merged[i] = b->table[slot];
    return b->merged[i];
}

static bool blocks(const mesh_builder *b, uint32_t t)
{
    const uint8_t *flags = b->def->triangle_flags;
    if (flags != NULL && (flags[t] & UMB_TRIANGLE_OPEN) != 0) {
        return false;
    }
    float p[3][3];
    for (int c = 0; c < 3; ++c) {
        read_position(b, b->def->indices[3 * (size_t)t + c], p[c]);
    }
    return !umb_collinear(p[0], p[1], p[2]);
}

/* Blocking triangles first, then the others, each kind in the order of the definition. */
static void merge_triangles(mesh_builder *b)
{
    uint32_t count = 0;
    for (uint32_t t = 0; t < b->triangle_count; ++t) {
        if (blocks(b, t)) {
            const uint8_t *flags = b->def->triangle_flags;
            b->two_sided[count] = flags != NULL && (flags[t] & UMB_TRIANGLE_TWO_SIDED) != 0;
            for (int c = 0; c < 3; ++c) {
                b->triangles[count][c] = merge_position(b, b->def->indices[3 * (size_t)t + c]);
            }
            count += 1;
        }
    }
    b->blocking_count = count;
    b->block_position_count = b->position_count;
    for (uint32_t t = 0; t < b->triangle_count; ++t) {
        if (!blocks(b, t)) {
            for (int c = 0; c < 3; ++c) {
                b->triangles[count][c] = merge_position(b, b->def->indices[3 * (size_t)t + c]);
            }
            count += 1;
        }
    }
    if (b->triangle_count == 0) {
        for (uint32_t i = 0; i < b->def->position_count; ++i) {
            (void)merge_position(b, i);
        }
    }
}

static bool allocate_builder(mesh_builder *b, umb_scratch *scratch)
{
    size_t n = b->def->position_count, size = 16;
    while (size < 2 * n) {
        size *= 2;
    }
    b->table_mask = (uint32_t)(size - 1);
    b->merged = umb_scratch_get(scratch, n, sizeof *b->merged);
    b->table = umb_scratch_get(scratch, size, sizeof *b->table);
    b->positions = umb_scratch_get(scratch, n, sizeof *b->positions);
    b->triangles = umb_scratch_get(scratch, b->triangle_count, sizeof *b->triangles);
    b->two_sided = umb_scratch_get_zero(scratch, b->triangle_count, sizeof *b->two_sided);
    if (scratch->failed) {
        return false;
    }
    memset(b->merged, 0xFF, n * sizeof *b->merged);
    memset(b->table, 0xFF, size * sizeof *b->table);
    return true;
}

static umb_aabb bounds_of(const float (*positions)[3], uint32_t count)
{
    umb_aabb box = {{0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f}};
    for (uint32_t i = 0; i < count; ++i) {
        for (int k = 0; k < 3; ++k) {
            float x = positions[i][k];
            box.min[k] = i == 0 || x < box.min[k] ? x : box.min[k];
            box.max[k] = i == 0 || x > box.max[k] ? x : box.max[k];
        }
    }
    return box;
}

static size_t round_up(size_t bytes)
{
    return (bytes + ALIGNMENT - 1) & ~(size_t)(ALIGNMENT - 1);
}

umb_mesh *umb_mesh_allocate(const umb_allocator *allocator, const umb_mesh *sizes)
{
    size_t positions = round_up(sizeof(umb_mesh));
    size_t triangles = positions + round_up(sizes->position_count * sizeof *sizes->positions);
    size_t two_sided = triangles + round_up(sizes->seen_count * sizeof *sizes->triangles);
    size_t edges = two_sided + round_up(sizes->triangle_count * sizeof *sizes->two_sided);
    size_t parts = edges + round_up(sizes->edge_count * sizeof *sizes->edges);
    size_t order = parts + round_up(sizes->part_count * sizeof *sizes->parts);
    size_t bytes = order + round_up(sizes->seen_count * sizeof *sizes->part_order);
    char *block = umb_memory_allocate(allocator, bytes);
    if (block == NULL) {
        return NULL;
    }
    umb_mesh *m = (umb_mesh *)(void *)block;
    *m = *sizes;
    m->positions = (float(*)[3])(void *)(block + positions);
    m->triangles = (uint32_t(*)[3])(void *)(block + triangles);
    m->two_sided = (uint8_t *)(block + two_sided);
    m->edges = (umb_edge *)(void *)(block + edges);
    m->parts = (umb_part *)(void *)(block + parts);
    m->part_order = (uint32_t *)(void *)(block + order);
    m->bytes = bytes;
    return m;
}

/* Copy what was built into one block. */
static umb_mesh *pack(const umb_allocator *allocator, const mesh_builder *b, const umb_edge *edges,
                      uint32_t edge_count, const umb_part *parts, uint32_t part_count,
                      const uint32_t *part_order)
{
    umb_mesh sizes = {0};
    sizes.position_count = b->position_count;
    sizes.block_position_count = b->block_position_count;
    sizes.triangle_count = b->blocking_count;
    sizes.seen_count = b->triangle_count;
    sizes.edge_count = edge_count;
    sizes.part_count = part_count;
    umb_mesh *m = umb_mesh_allocate(allocator, &sizes);
    if (m == NULL) {
        return NULL;
    }
    memcpy(m->positions, b->positions, b->position_count * sizeof *m->positions);
    memcpy(m->triangles, b->triangles, b->triangle_count * sizeof *m->triangles);
    memcpy(m->two_sided, b->two_sided, b->blocking_count * sizeof *m->two_sided);
    memcpy(m->edges, edges, edge_count * sizeof *m->edges);
    memcpy(m->parts, parts, part_count * sizeof *m->parts);
    for (uint32_t t = 0; t < m->seen_count; ++t) {
        m->part_order[t] = part_order != NULL ? part_order[t] : t;
    }
    for (uint32_t t = 0; t < m->triangle_count; ++t) {
        m->any_two_sided |= m->two_sided[t];
    }
    m->bounds = bounds_of((const float(*)[3])m->positions, m->position_count);
    m->block_bounds = bounds_of((const float(*)[3])m->positions, m->block_position_count);
    m->convex = umb_mesh_convex_test(m);
    m->box = m->convex && umb_mesh_convex_is_box(m);
    return m;
}

/* A box of twelve triangles stays one part; what is open or bent is cut down to pairs. */
static const umb_parts_rule PARTS = {2, 12};

static umb_result create(const umb_allocator *allocator, const umb_shape_def *def, bool one_part,
                         umb_mesh **out)
{
    *out = NULL;
    umb_result result = check_def(def);
    if (result != UMB_OK) {
        return result;
    }
    mesh_builder b = {.def = def, .triangle_count = def->index_count / 3};
    b.stride = def->position_stride != 0 ? def->position_stride : (uint32_t)(3 * sizeof(float));
    if (!all_finite(&b)) {
        return UMB_ERROR_ARGUMENT;
    }
    umb_scratch scratch = {.allocator = allocator};
    if (allocate_builder(&b, &scratch)) {
        merge_triangles(&b);
        umb_scratch_drop(&scratch, b.merged);
        umb_scratch_drop(&scratch, b.table);
        uint32_t edge_count = 0, part_count = 1;
        const uint32_t(*triangles)[3] = (const uint32_t(*)[3])b.triangles;
        umb_edge *edges = umb_mesh_edges_build(&scratch, triangles, b.two_sided, b.blocking_count,
                                               &edge_count);
        umb_part whole = {bounds_of((const float(*)[3])b.positions, b.position_count), 1, 0,
                          b.triangle_count};
        const umb_part *parts = &whole;
        uint32_t *part_order = NULL;
        if (b.triangle_count > 0 && !one_part) {
            parts = umb_mesh_parts_build(&scratch, (const float(*)[3])b.positions, triangles,
                                         b.triangle_count, PARTS, &part_count, &part_order);
        }
        if (!scratch.failed) {
            *out = pack(allocator, &b, edges, edge_count, parts, part_count, part_order);
        }
    }
    umb_scratch_free(&scratch);
    return *out != NULL ? UMB_OK : UMB_ERROR_MEMORY;
}

umb_result umb_mesh_create(const umb_allocator *allocator, const umb_shape_def *def, umb_mesh **out)
{
    return create(allocator, def, false, out);
}

umb_result umb_mesh_create_occluder(const umb_allocator *allocator, const umb_shape_def *def,
                                    umb_mesh **out)
{
    return create(allocator, def, true, out);
}

void umb_mesh_destroy(const umb_allocator *allocator, umb_mesh *mesh)
{
    if (mesh != NULL) {
        umb_memory_free(allocator, mesh, mesh->bytes);
    }
}

/* ---- in the world --------------------------------------------------------------------------- */

/* True if each axis stays itself: things that are shifted, the most common of all moves. */
static bool keeps_axes(const umb_transform *t)
{
    uint32_t bits[12];
    memcpy(bits, t->m, sizeof bits);
    return (bits[1] | bits[2] | bits[4] | bits[6] | bits[8] | bits[9]) << 1 == 0;
}

/* True if each row looks at one axis at most. */
static bool keeps_boxes(const umb_transform *t)
{
    uint32_t oblique = 0;
    for (int i = 0; i < 3; ++i) {
        uint32_t bits[3];
        memcpy(bits, t->m[i], sizeof bits);
        bool x = bits[0] << 1 != 0, y = bits[1] << 1 != 0, z = bits[2] << 1 != 0;
        oblique |= (uint32_t)((x & y) | (y & z) | (z & x));
    }
    return oblique == 0;
}

static inline double lower(double a, double b)
{
    return a < b ? a : b;
}

static inline double higher(double a, double b)
{
    return a > b ? a : b;
}

/* Box of the images of a box's corners. Rounding keeps order, in every step of the sum: the least
 * of the eight sums is the sum of the least products. */
static inline void move_corners(const umb_aabb *box, const umb_transform *t, umb_aabb *out)
{
    for (int i = 0; i < 3; ++i) {
        const float *m = t->m[i];
        double x0 = (double)m[0] * box->min[0], x1 = (double)m[0] * box->max[0];
        double y0 = (double)m[1] * box->min[1], y1 = (double)m[1] * box->max[1];
        double z0 = (double)m[2] * box->min[2], z1 = (double)m[2] * box->max[2];
        out->min[i] = (float)(lower(x0, x1) + lower(y0, y1) + lower(z0, z1) + (double)m[3]);
        out->max[i] = (float)(higher(x0, x1) + higher(y0, y1) + higher(z0, z1) + (double)m[3]);
    }
}

/* The same when the axes stay: the other products are zeros, which change no sum. */
static inline void move_along_axes(const umb_aabb *box, const umb_transform *t, umb_aabb *out)
{
    for (int i = 0; i < 3; ++i) {
        double a = (double)t->m[i][i] * box->min[i] + (double)t->m[i][3];
        double b = (double)t->m[i][i] * box->max[i] + (double)t->m[i][3];
        out->min[i] = (float)lower(a, b);
        out->max[i] = (float)higher(a, b);
    }
}

typedef struct extent {
    double low, high;
} extent;

static inline extent grow(extent e, const float m[4], const double p[3])
{
    double x = m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + (double)m[3];
    return (extent){lower(x, e.low), higher(x, e.high)};
}

/* Box of the images of points. Rounding keeps order: it can wait for the end. */
static void move_points(const float (*points)[3], uint32_t count, const umb_transform *t,
                        umb_aabb *out)
{
    extent x = {INFINITY, -INFINITY}, y = x, z = x;
    for (uint32_t i = 0; i < count; ++i) {
        const double p[3] = {points[i][0], points[i][1], points[i][2]};
        x = grow(x, t->m[0], p);
        y = grow(y, t->m[1], p);
        z = grow(z, t->m[2], p);
    }
    *out = (umb_aabb){{(float)x.low, (float)y.low, (float)z.low},
                      {(float)x.high, (float)y.high, (float)z.high}};
}

typedef enum way { ALONG_AXES, BY_CORNERS, BY_POINTS } way;

static inline void move_box(way w, const umb_mesh *mesh, const umb_aabb *box, uint32_t count,
                            const umb_transform *t, umb_aabb *out)
{
    if (w == ALONG_AXES) {
        move_along_axes(box, t, out);
    } else if (w == BY_CORNERS) {
        move_corners(box, t, out);
    } else {
        move_points((const float(*)[3])mesh->positions, count, t, out);
    }
}

const umb_aabb *umb_mesh_world_bounds(const umb_mesh *mesh, const umb_transform *transform,
                                      umb_mesh_place *out)
{
    uint32_t all = mesh->position_count, blocking = mesh->block_position_count;
    way w = BY_POINTS;
    if (keeps_axes(transform)) {
        w = ALONG_AXES;
    } else if ((mesh->box && blocking == all) || keeps_boxes(transform)) {
        w = BY_CORNERS;
    }
    move_box(w, mesh, &mesh->bounds, all, transform, &out->bounds);
    if (blocking == all) {
        return &out->bounds;
    }
    if (blocking == 0) {
        memset(&out->block_bounds, 0, sizeof out->block_bounds);
    } else {
        move_box(w, mesh, &mesh->block_bounds, blocking, transform, &out->block_bounds);
    }
    return &out->block_bounds;
}

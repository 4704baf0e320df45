/* Hertel and Mehlhorn's way: begin with the triangles, and take out every edge between two flat neighbours that
 * leaves no dent, the longest first. Half-edge 3 t + k runs from corner k of triangle t to the next one. */
#include "facets.h"

#include <string.h>

#include "base/scratch.h"
#include "base/sort.h"
#include "geometry/vec.h"

/* Sines of angles up to which what ought to be straight counts as straight: far above what rounding of a few
 * thousand units does, far below what anyone models. */
#define FLAT 1e-5
#define PASSES 6

typedef struct maker {
    const umb_facet_source *source;
    umb_scratch scratch;
    uint32_t halves;
    uint32_t *twin, *next, *prev; /* twin UMB_NONE: nothing, or nothing clear, on the other side */
    uint32_t *face;               /* per triangle: union-find */
    umb_vec3 *normal;             /* per triangle, of length 1; zero: too thin to say */
    uint8_t *gone;                /* half-edges inside of a facet */
    uint32_t *size;               /* per root: corners of its loop */
    uint32_t *start;              /* per root: a half-edge of its loop */
} maker;

static uint32_t from_of(const maker *m, uint32_t h)
{
    return m->source->triangles[h / 3][h % 3];
}

static uint32_t to_of(const maker *m, uint32_t h)
{
    return m->source->triangles[h / 3][(h % 3 + 1) % 3];
}

static umb_vec3 position(const maker *m, uint32_t vertex)
{
    return umb_vec3_from_float(m->source->positions[vertex]);
}

static umb_vec3 along(const maker *m, uint32_t h)
{
    return umb_vec3_sub(position(m, to_of(m, h)), position(m, from_of(m, h)));
}

static uint32_t root_of(maker *m, uint32_t t)
{
    while (m->face[t] != t) {
        m->face[t] = m->face[m->face[t]];
        t = m->face[t];
    }
    return t;
}

static umb_vec3 area_of(const maker *m, uint32_t t)
{
    umb_vec3 cross = umb_vec3_cross(along(m, 3 * t), umb_vec3_scale(along(m, 3 * t + 2), -1.0));
    return umb_vec3_scale(cross, 0.5);
}

/* Half-edges of an edge that exactly two triangles have, in opposite directions, are twins. */
static bool find_twins(maker *m)
{
    uint64_t *keys = umb_scratch_get(&m->scratch, m->halves, sizeof *keys);
    uint64_t *other_keys = umb_scratch_get(&m->scratch, m->halves, sizeof *other_keys);
    uint32_t *halves = umb_scratch_get(&m->scratch, m->halves, sizeof *halves);
    uint32_t *other = umb_scratch_get(&m->scratch, m->halves, sizeof *other);
    if (m->scratch.failed) {
        return false;
    }
    for (uint32_t h = 0; h < m->halves; ++h) {
        uint64_t a = from_of(m, h), b = to_of(m, h);
        keys[h] = a < b ? a << 32 | b : b << 32 | a;
        halves[h] = h;
        m->twin[h] = UMB_NONE;
    }
    umb_sort_keys(keys, halves, other_keys, other, m->halves);
    for (uint32_t i = 0, end; i < m->halves; i = end) {
        for (end = i + 1; end < m->halves && keys[end] == keys[i]; ++end) {
        }
        uint32_t g = halves[i], h = halves[end - 1];
        bool sides = m->source->two_sided[g / 3] == m->source->two_sided[h / 3];
        if (end == i + 2 && sides && from_of(m, g) == to_of(m, h)) {
            m->twin[g] = h;
            m->twin[h] = g;
        }
    }
    umb_scratch_drop(&m->scratch, other);
    umb_scratch_drop(&m->scratch, halves);
    umb_scratch_drop(&m->scratch, other_keys);
    umb_scratch_drop(&m->scratch, keys);
    return true;
}

/* Where two loops join when an edge goes: from half-edge p on to half-edge n. Edges that then run to and fro go
 * with it. False if nothing would be left. */
typedef struct joint {
    uint32_t p, n;
} joint;

static bool find_joint(const maker *m, uint32_t h, joint *j)
{
    j->p = m->prev[h];
    j->n = m->next[m->twin[h]];
    for (int turns = 0; m->twin[j->p] == j->n; ++turns) {
        if (turns == 2 * UMB_FACET_CORNERS) {
            return false;
        }
        j->p = m->prev[j->p];
        j->n = m->next[j->n];
    }
    return true;
}

static bool is_straight_or_left(const maker *m, joint j, umb_vec3 normal)
{
    umb_vec3 a = along(m, j.p), b = along(m, j.n);
    double turn = umb_vec3_dot(normal, umb_vec3_cross(a, b));
    double size = umb_vec3_length(a) * umb_vec3_length(b);
    return turn > FLAT * size || (turn >= -FLAT * size && umb_vec3_dot(a, b) > 0.0);
}

static uint32_t loop_length(const maker *m, uint32_t start)
{
    uint32_t count = 0, h = start;
    do {
        h = m->next[h];
        count += 1;
    } while (h != start && count <= 3 * UMB_FACET_CORNERS);
    return count;
}

static void link_to(maker *m, joint j)
{
    m->next[j.p] = j.n;
    m->prev[j.n] = j.p;
}

static void drop_between(maker *m, uint32_t h, joint j)
{
    m->gone[h] = m->gone[m->twin[h]] = 1;
    for (uint32_t k = m->prev[h]; k != j.p; k = m->prev[k]) {
        m->gone[k] = m->gone[m->twin[k]] = 1;
    }
}

/* Take an edge out, if what it joins is flat and stays convex. */
static bool take_out(maker *m, uint32_t h)
{
    uint32_t g = m->twin[h], a = root_of(m, h / 3), b = root_of(m, g / 3);
    if (m->gone[h] || a == b || m->size[a] + m->size[b] > UMB_FACET_CORNERS + 2) {
        return false;
    }
    umb_vec3 na = m->normal[a], nb = m->normal[b];
    umb_vec3 bend = umb_vec3_cross(na, nb);
    if (!(umb_vec3_dot(na, nb) > 0.5) || umb_vec3_sum_abs(bend) > FLAT) {
        return false;
    }
    joint at_start, at_end;
    if (!find_joint(m, h, &at_start) || !find_joint(m, g, &at_end) || !is_straight_or_left(m, at_start, na) ||
        !is_straight_or_left(m, at_end, na)) {
        return false;
    }
    drop_between(m, h, at_start);
    drop_between(m, g, at_end);
    link_to(m, at_start);
    link_to(m, at_end);
    m->face[b] = a;
    m->start[a] = at_start.n;
    m->size[a] = loop_length(m, at_start.n);
    return true;
}

/* The longest first: what was quads becomes quads again. Where two rows meet, an edge can go once both are whole. */
static bool merge(maker *m)
{
    uint64_t *words = umb_scratch_get(&m->scratch, m->halves, sizeof *words);
    uint64_t *other = umb_scratch_get(&m->scratch, m->halves, sizeof *other);
    if (m->scratch.failed) {
        return false;
    }
    uint32_t count = 0;
    for (uint32_t h = 0; h < m->halves; ++h) {
        if (m->twin[h] != UMB_NONE && h < m->twin[h]) {
            umb_vec3 d = along(m, h);
            float length = (float)umb_vec3_dot(d, d);
            words[count++] = (uint64_t)~umb_sort_float(length) << 32 | h;
        }
    }
    const uint64_t *sorted = umb_sort_words(words, other, count);
    bool more = true;
    for (uint32_t pass = 0; more && pass < PASSES; ++pass) {
        more = false;
        for (uint32_t i = 0; i < count; ++i) {
            more |= take_out(m, (uint32_t)sorted[i]);
        }
    }
    umb_scratch_drop(&m->scratch, other);
    umb_scratch_drop(&m->scratch, words);
    return true;
}

static bool prepare(maker *m)
{
    uint32_t n = m->source->triangle_count;
    m->halves = 3 * n;
    m->twin = umb_scratch_get(&m->scratch, m->halves, sizeof *m->twin);
    m->next = umb_scratch_get(&m->scratch, m->halves, sizeof *m->next);
    m->prev = umb_scratch_get(&m->scratch, m->halves, sizeof *m->prev);
    m->face = umb_scratch_get(&m->scratch, n, sizeof *m->face);
    m->normal = umb_scratch_get(&m->scratch, n, sizeof *m->normal);
    m->gone = umb_scratch_get_zero(&m->scratch, m->halves, 1);
    m->size = umb_scratch_get(&m->scratch, n, sizeof *m->size);
    m->start = umb_scratch_get(&m->scratch, n, sizeof *m->start);
    if (m->scratch.failed) {
        return false;
    }
    for (uint32_t t = 0; t < n; ++t) {
        umb_vec3 area = area_of(m, t);
        double length = umb_vec3_length(area);
        m->normal[t] = length > 0.0 && length < 1e300 ? umb_vec3_scale(area, 1.0 / length) : (umb_vec3){0, 0, 0};
        m->face[t] = t;
        m->size[t] = 3;
        m->start[t] = 3 * t;
        for (uint32_t k = 0; k < 3; ++k) {
            m->next[3 * t + k] = 3 * t + (k + 1) % 3;
            m->prev[3 * t + k] = 3 * t + (k + 2) % 3;
        }
    }
    return find_twins(m) && merge(m);
}

/* Facets in the order they are kept in, by their roots; and for each root the number it gets. */
static bool put_in_order(maker *m, umb_facets *out, const umb_vec3 *areas, uint32_t *number)
{
    uint32_t n = m->source->triangle_count, count = out->facet_count;
    uint64_t *keys = umb_scratch_get(&m->scratch, count, sizeof *keys);
    uint64_t *other_keys = umb_scratch_get(&m->scratch, count, sizeof *other_keys);
    uint32_t *roots = umb_scratch_get(&m->scratch, count, sizeof *roots);
    uint32_t *other = umb_scratch_get(&m->scratch, count, sizeof *other);
    if (m->scratch.failed) {
        return false;
    }
    for (uint32_t t = 0, i = 0; t < n; ++t) {
        if (m->face[t] == t) {
            uint32_t tag = m->source->tags != NULL ? m->source->tags[t] : 0;
            keys[i] = (uint64_t)tag << 32 | (uint32_t)~umb_sort_float((float)umb_vec3_length(areas[t]));
            roots[i++] = t;
        }
    }
    umb_sort_keys(keys, roots, other_keys, other, count);
    for (uint32_t i = 0; i < count; ++i) {
        number[roots[i]] = i;
        out->facets[i].tag = (uint32_t)(keys[i] >> 32);
        out->sizes[i] = (float)umb_vec3_length(areas[roots[i]]);
    }
    return true;
}

static void write_loop(maker *m, umb_facets *out, uint32_t root, const uint32_t *number)
{
    umb_facet *f = &out->facets[number[root]];
    umb_vec3 sum = {0, 0, 0};
    uint32_t h = m->start[root];
    f->first = out->corner_count;
    do {
        uint32_t at = out->corner_count++;
        out->corners[at] = from_of(m, h);
        out->beyond[at] = m->twin[h] != UMB_NONE ? number[root_of(m, m->twin[h] / 3)] : UMB_NONE;
        sum = umb_vec3_add(sum, position(m, from_of(m, h)));
        h = m->next[h];
    } while (h != m->start[root]);
    f->count = out->corner_count - f->first;
    sum = umb_vec3_scale(sum, 1.0 / f->count);
    f->centre[0] = (float)sum.x;
    f->centre[1] = (float)sum.y;
    f->centre[2] = (float)sum.z;
}

static bool write_out(maker *m, umb_facets *out, const umb_allocator *a)
{
    uint32_t n = m->source->triangle_count;
    umb_vec3 *areas = umb_scratch_get_zero(&m->scratch, n, sizeof *areas);
    uint32_t *number = umb_scratch_get(&m->scratch, n, sizeof *number);
    out->triangle_count = n;
    for (uint32_t t = 0; t < n && !m->scratch.failed; ++t) {
        uint32_t root = root_of(m, t);
        out->facet_count += root == t;
        areas[root] = umb_vec3_add(areas[root], area_of(m, t));
    }
    out->facets = umb_memory_allocate_zero(a, out->facet_count, sizeof *out->facets);
    out->sizes = umb_memory_allocate_zero(a, out->facet_count, sizeof *out->sizes);
    out->corners = umb_memory_allocate_zero(a, m->halves, sizeof *out->corners);
    out->beyond = umb_memory_allocate_zero(a, m->halves, sizeof *out->beyond);
    out->members = umb_memory_allocate_zero(a, n, sizeof *out->members);
    if (out->facets == NULL || out->sizes == NULL || out->corners == NULL || out->beyond == NULL ||
        out->members == NULL || m->scratch.failed || !put_in_order(m, out, areas, number)) {
        return false;
    }
    for (uint32_t t = 0; t < n; ++t) {
        umb_facet *f = &out->facets[number[root_of(m, t)]];
        f->triangle_count += 1;
        if (m->face[t] == t) {
            f->two_sided = m->source->two_sided[t] != 0;
            f->area[0] = (float)areas[t].x;
            f->area[1] = (float)areas[t].y;
            f->area[2] = (float)areas[t].z;
            write_loop(m, out, t, number);
        }
    }
    for (uint32_t i = 0, at = 0; i < out->facet_count; ++i) {
        out->facets[i].first_triangle = at;
        at += out->facets[i].triangle_count;
        out->facets[i].triangle_count = 0;
    }
    for (uint32_t t = 0; t < n; ++t) {
        umb_facet *f = &out->facets[number[root_of(m, t)]];
        out->members[f->first_triangle + f->triangle_count++] = t;
    }
    return true;
}

bool umb_facets_build(umb_facets *out, const umb_allocator *a, const umb_facet_source *source)
{
    memset(out, 0, sizeof *out);
    out->positions = source->positions;
    out->triangles = source->triangles;
    if (source->triangle_count == 0) {
        return true;
    }
    maker m = {.source = source, .scratch = {.allocator = a}};
    bool ok = prepare(&m) && write_out(&m, out, a);
    umb_scratch_free(&m.scratch);
    if (!ok) {
        out->triangle_count = source->triangle_count;
        umb_facets_free(out, a);
    }
    return ok;
}

void umb_facets_free(umb_facets *f, const umb_allocator *a)
{
    size_t n = f->triangle_count;
    umb_memory_free(a, f->facets, f->facet_count * sizeof *f->facets);
    umb_memory_free(a, f->sizes, f->facet_count * sizeof *f->sizes);
    umb_memory_free(a, f->corners, 3 * n * sizeof *f->corners);
    umb_memory_free(a, f->beyond, 3 * n * sizeof *f->beyond);
    umb_memory_free(a, f->members, n * sizeof *f->members);
    memset(f, 0, sizeof *f);
}

size_t umb_facets_bytes(const umb_facets *f)
{
    return f->facet_count * (sizeof *f->facets + sizeof *f->sizes) +
           f->triangle_count * (6 * sizeof(uint32_t) + sizeof(uint32_t));
}

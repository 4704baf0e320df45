/* What is wrong with the input, counted. Vertices are one when their positions are equal,
 * whatever their indices: files split vertices for normals and texture coordinates, and such a
 * seam is no border. Each mesh is counted once, however many instances it has. */
#include "model_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Distinct triples, numbered from 0 in the order of their first appearance. */
typedef struct triples {
    uint32_t (*keys)[3];
    uint32_t *slots; /* number + 1; 0: empty */
    uint32_t mask, count;
} triples;

static bool triples_start(triples *t, size_t capacity)
{
    size_t slots = 16;
    while (slots < 2 * capacity) {
        slots *= 2;
    }
    t->keys = malloc((capacity + 1) * sizeof *t->keys);
    t->slots = slots <= UINT32_MAX ? calloc(slots, sizeof *t->slots) : NULL;
    t->mask = (uint32_t)(slots - 1);
    t->count = 0;
    return t->keys != NULL && t->slots != NULL;
}

static void triples_end(triples *t)
{
    free(t->keys);
    free(t->slots);
}

static uint32_t triples_add(triples *t, uint32_t a, uint32_t b, uint32_t c)
{
    uint64_t hash = a * 0x9E3779B97F4A7C15u ^ (b + 0x7F4A7C15u) * 0xC2B2AE3D27D4EB4Fu;
    hash = (hash ^ (hash >> 29) ^ c) * 0xBF58476D1CE4E5B9u;
    uint32_t slot = (uint32_t)(hash >> 32) & t->mask;
    while (t->slots[slot] != 0) {
        const uint32_t *key = t->keys[t->slots[slot] - 1];
        if (key[0] == a && key[1] == b && key[2] == c) {
            return t->slots[slot] - 1;
        }
        slot = (slot + 1) & t->mask;
    }
    uint32_t *key = t->keys[t->count];
    key[0] = a;
    key[1] = b;
    key[2] = c;
    t->slots[slot] = ++t->count;
    return t->count - 1;
}

/* Everything that one mesh needs while it is looked at. */
typedef struct inspection {
    triples points, edges, faces;
    uint32_t *point_of;        /* vertex -> distinct position */
    uint32_t (*edge_runs)[2];  /* per edge: triangles that run up and down it */
    uint32_t (*face_turns)[2]; /* per set of corners: triangles of either winding */
} inspection;

static void inspection_end(inspection *s)
{
    triples_end(&s->points);
    triples_end(&s->edges);
    triples_end(&s->faces);
    free(s->point_of);
    free(s->edge_runs);
    free(s->face_turns);
}

static bool inspection_start(inspection *s, const model_mesh *mesh)
{
    size_t triangles = mesh->triangle_count;
    memset(s, 0, sizeof *s);
    bool started = triples_start(&s->points, mesh->position_count);
    started = triples_start(&s->edges, 3 * triangles) && started;
    started = triples_start(&s->faces, triangles) && started;
    s->point_of = malloc(((size_t)mesh->position_count + 1) * sizeof *s->point_of);
    s->edge_runs = calloc(3 * triangles + 1, sizeof *s->edge_runs);
    s->face_turns = calloc(triangles + 1, sizeof *s->face_turns);
    if (!started || s->point_of == NULL || s->edge_runs == NULL || s->face_turns == NULL) {
        inspection_end(s);
        return false;
    }
    for (uint32_t v = 0; v < mesh->position_count; ++v) {
        uint32_t bits[3];
        for (int i = 0; i < 3; ++i) {
            float x = mesh->positions[3 * (size_t)v + i] + 0.0f; /* -0 is 0 */
            memcpy(&bits[i], &x, sizeof x);
        }
        s->point_of[v] = triples_add(&s->points, bits[0], bits[1], bits[2]);
    }
    return true;
}

static void add_face(inspection *s, const uint32_t corner[3], model_faults *faults)
{
    uint32_t a = corner[0];
    uint32_t b = corner[1];
    uint32_t c = corner[2];
    /* Turn the least corner to the front; then the order of the other two is the winding. */
    while (a > b || a > c) {
        uint32_t first = a;
        a = b;
        b = c;
        c = first;
    }
    int turn = b > c;
    uint32_t *turns = s->face_turns[triples_add(&s->faces, a, turn ? c : b, turn ? b : c)];
    if (turns[turn] != 0) {
        ++faults->duplicate;
    } else if (turns[!turn] != 0) {
        ++faults->opposite;
    }
    ++turns[turn];
    for (int i = 0; i < 3; ++i) {
        uint32_t v0 = corner[i];
        uint32_t v1 = corner[(i + 1) % 3];
        bool down = v0 > v1;
        ++s->edge_runs[triples_add(&s->edges, down ? v1 : v0, down ? v0 : v1, 0)][down];
    }
}

/* Six times the signed volume of the cone from the mesh's first vertex to a triangle. */
static double cone_volume(const float *base, const float *a, const float *b, const float *c)
{
    double p[3];
    double q[3];
    double r[3];
    for (int i = 0; i < 3; ++i) {
        p[i] = (double)a[i] - base[i];
        q[i] = (double)b[i] - base[i];
        r[i] = (double)c[i] - base[i];
    }
    return p[0] * (q[1] * r[2] - q[2] * r[1]) + p[1] * (q[2] * r[0] - q[0] * r[2]) +
           p[2] * (q[0] * r[1] - q[1] * r[0]);
}

static void look_at_edges(const inspection *s, double volume, model_faults *faults)
{
    bool closed = s->edges.count != 0;
    for (uint32_t e = 0; e < s->edges.count; ++e) {
        uint32_t up = s->edge_runs[e][0];
        uint32_t down = s->edge_runs[e][1];
        faults->border_edges += up + down == 1;
        faults->non_manifold_edges += up + down > 2 || (up + down == 2 && up != 1);
        closed = closed && up == down;
    }
    faults->inverted += closed && volume < 0.0;
}

static bool inspect_mesh(const model_mesh *mesh, model_faults *faults)
{
    inspection s;
    if (!inspection_start(&s, mesh)) {
        return false;
    }
    double volume = 0.0;
    for (uint32_t t = 0; t < mesh->triangle_count; ++t) {
        const uint32_t *index = mesh->indices + 3 * (size_t)t;
        const float *p[3];
        uint32_t corner[3];
        for (int i = 0; i < 3; ++i) {
            p[i] = mesh->positions + 3 * (size_t)index[i];
            corner[i] = s.point_of[index[i]];
        }
        if (corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0] ||
            model_zero_area(p[0], p[1], p[2])) {
            ++faults->degenerate;
            continue;
        }
        add_face(&s, corner, faults);
        volume += cone_volume(mesh->positions, p[0], p[1], p[2]);
    }
    look_at_edges(&s, volume, faults);
    inspection_end(&s);
    return true;
}

/* The k-th smallest of n floats; reorders them (Hoare's selection). */
static float select_float(float *values, size_t n, size_t k)
{
    size_t low = 0;
    size_t high = n - 1;
    while (low < high) {
        float pivot = values[low + (high - low) / 2];
        size_t i = low;
        size_t j = high;
        for (;;) {
            while (values[i] < pivot) {
                ++i;
            }
            while (values[j] > pivot) {
                --j;
            }
            if (i >= j) {
                break;
            }
            float kept = values[i];
            values[i++] = values[j];
            values[j--] = kept;
        }
        /* Hoare's partition: everything up to j is at most the pivot, everything after at least. */
        if (k <= j) {
            high = j;
        } else {
            low = j + 1;
        }
    }
    return values[k];
}

/* Every stride-th world vertex of the scene, one axis; returns how many. */
static size_t gather_axis(const model *m, int axis, size_t stride, float *values)
{
    size_t count = 0;
    size_t phase = 0;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        const model_object *o = &m->objects[i];
        size_t vertices = o->mesh != MODEL_NONE ? m->meshes[o->mesh].position_count : 0;
        for (; phase < vertices; phase += stride) {
            float p[3];
            model_world_vertex(m, o, (uint32_t)phase, p);
            if (isfinite(p[axis])) {
                values[count++] = p[axis];
            }
        }
        phase -= vertices;
    }
    return count;
}

/* A large scene is sampled: the middle 99 % of a million vertices is that of all of them. */
#define OUTLIER_SAMPLE ((size_t)1 << 20)

static bool count_outliers(model *m)
{
    size_t vertices = 0;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        vertices += m->objects[i].mesh != MODEL_NONE ? m->meshes[m->objects[i].mesh].position_count
                                                     : 0;
    }
    size_t stride = vertices / OUTLIER_SAMPLE + 1;
    float *values = malloc((vertices / stride + 2) * sizeof *values);
    if (values == NULL) {
        return false;
    }
    float low[3] = {0};
    float high[3] = {0};
    size_t count = 0;
    for (int k = 0; k < 3; ++k) {
        count = gather_axis(m, k, stride, values);
        if (count != 0) {
            low[k] = select_float(values, count, count / 200);
            high[k] = select_float(values, count, count - 1 - count / 200);
        }
    }
    free(values);
    for (uint32_t i = 0; i < m->object_count && count != 0; ++i) {
        const model_object *o = &m->objects[i];
        bool outside = false;
        for (int k = 0; k < 3; ++k) {
            double size = (double)high[k] - low[k];
            outside = outside || o->bounds.max[k] > high[k] + size ||
                      o->bounds.min[k] < low[k] - size;
        }
        m->faults.outlier_objects += outside && o->mesh != MODEL_NONE;
    }
    return true;
}

bool model_count_faults(model *m)
{
    for (uint32_t i = 0; i < m->mesh_count; ++i) {
        if (!inspect_mesh(&m->meshes[i], &m->faults)) {
            return false;
        }
    }
    return count_outliers(m);
}

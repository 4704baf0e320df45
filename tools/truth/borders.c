/* What lies just beside the silhouettes of seen triangles.
 *
 * A part of an object that can be seen is bounded, in the picture, by silhouette edges of what
 * is in front of it or by its own. So rays just outside every silhouette edge of everything seen
 * find most of what a grid misses: slits, and tips behind corners. What they find has borders of
 * its own, which the next round walks.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "search.h"

#define MAX_SAMPLES 256
#define SAMPLE_PIXELS 1.0
#define HALVINGS 5

/* How far beside an edge, in grid cells: each ray anywhere between, evenly in the logarithm,
 * since slits have no natural width. 0: along the edge itself, where cracks between triangles
 * that only nearly meet (T-junctions) let rays through; shared edges do not. */
static const double beside[][2] = {{0.0, 0.0}, {1e-5, 1e-2}, {1e-2, 0.5}};

typedef struct half_edge {
    uint32_t low, high; /* corners, welded by position */
    uint32_t slot;      /* 3 * triangle + corner */
} half_edge;

static int by_corners(const void *a, const void *b)
{
    const half_edge *x = a, *y = b;
    if (x->low != y->low) {
        return x->low < y->low ? -1 : 1;
    }
    if (x->high != y->high) {
        return x->high < y->high ? -1 : 1;
    }
    return x->slot < y->slot ? -1 : x->slot > y->slot;
}

/* For each vertex, the first one with an equal position. */
static uint32_t *weld(const model_mesh *mesh)
{
    size_t size = 16;
    while (size < 2 * (size_t)mesh->position_count) {
        size *= 2;
    }
    uint32_t *table = malloc(size * sizeof(*table));
    uint32_t *same = malloc(((size_t)mesh->position_count + 1) * sizeof(*same));
    if (!table || !same) {
        free(table);
        free(same);
        return NULL;
    }
    memset(table, 0xFF, size * sizeof(*table));
    for (uint32_t i = 0; i < mesh->position_count; ++i) {
        uint32_t bits[3];
        float p[3];
        for (int k = 0; k < 3; ++k) {
            p[k] = mesh->positions[3 * (size_t)i + (size_t)k] + 0.0f; /* -0 becomes 0 */
        }
        memcpy(bits, p, sizeof(bits));
        size_t slot = (size_t)oracle_mix(bits[0], bits[1], bits[2]) & (size - 1);
        for (; table[slot] != MODEL_NONE; slot = (slot + 1) & (size - 1)) {
            const float *q = mesh->positions + 3 * (size_t)table[slot];
            if (q[0] == p[0] && q[1] == p[1] && q[2] == p[2]) {
                break;
            }
        }
        if (table[slot] == MODEL_NONE) {
            table[slot] = i;
        }
        same[i] = table[slot];
    }
    free(table);
    return same;
}

static uint32_t *find_neighbours(const model_mesh *mesh)
{
    size_t count = 3 * (size_t)mesh->triangle_count;
    uint32_t *same = weld(mesh);
    half_edge *edges = malloc((count + 1) * sizeof(*edges));
    uint32_t *out = malloc((count + 1) * sizeof(*out));
    if (!same || !edges || !out) {
        free(same);
        free(edges);
        free(out);
        return NULL;
    }
    for (size_t i = 0; i < count; ++i) {
        uint32_t a = same[mesh->indices[i]];
        uint32_t b = same[mesh->indices[i - i % 3 + (i + 1) % 3]];
        edges[i] = (half_edge){a < b ? a : b, a < b ? b : a, (uint32_t)i};
        out[i] = MODEL_NONE;
    }
    qsort(edges, count, sizeof(*edges), by_corners);
    for (size_t i = 0, next; i < count; i = next) {
        for (next = i + 1;
             next < count && edges[next].low == edges[i].low && edges[next].high == edges[i].high;
             ++next) {
        }
        if (next == i + 2) {
            out[edges[i].slot] = edges[i + 1].slot / 3;
            out[edges[i + 1].slot] = edges[i].slot / 3;
        }
    }
    free(same);
    free(edges);
    return out;
}

const uint32_t *oracle_neighbours(truth *t, uint32_t mesh)
{
    pthread_mutex_lock(&t->making_neighbours);
    if (!t->neighbours[mesh]) {
        t->neighbours[mesh] = find_neighbours(&t->model->meshes[mesh]);
    }
    const uint32_t *out = t->neighbours[mesh];
    pthread_mutex_unlock(&t->making_neighbours);
    return out;
}

/* Sign of the view's side of a triangle: -1 when its front is seen. */
static int facing(const search *s, float v[3][3])
{
    const umb_view *view = s->view.view;
    return view->projection == UMB_PERSPECTIVE ? oracle_facing(v, view->eye) : oracle_facing_along(v, view->forward);
}

static double depth_of(const umb_view *view, const double p[3])
{
    double depth = 0.0;
    for (int i = 0; i < 3; ++i) {
        depth += (p[i] - view->eye[i]) * view->forward[i];
    }
    return depth;
}

/* A silhouette edge cut to the view, and the direction away from its triangle. */
typedef struct border {
    double a[3], b[3], away[3];
    double pixel; /* the size of a grid cell, per unit of depth in perspective */
    uint32_t samples;
} border;

static bool cut_edge(const search *s, const float a[3], const float b[3], border *out)
{
    const oracle_view *v = &s->view;
    double low = 0.0, high = 1.0;
    for (uint32_t i = 0; i < v->plane_count; ++i) {
        const double *k = v->planes[i];
        double da = k[0] * a[0] + k[1] * a[1] + k[2] * a[2] + k[3];
        double db = k[0] * b[0] + k[1] * b[1] + k[2] * b[2] + k[3];
        if (da < 0.0 && db < 0.0) {
            return false;
        }
        if (da < 0.0) {
            low = fmax(low, da / (da - db));
        } else if (db < 0.0) {
            high = fmin(high, da / (da - db));
        }
    }
    if (!(low < high)) {
        return false;
    }
    for (int i = 0; i < 3; ++i) {
        out->a[i] = a[i] + low * ((double)b[i] - a[i]);
        out->b[i] = a[i] + high * ((double)b[i] - a[i]);
    }
    return true;
}

/* Normal of the plane through the edge and the eye (orthographic: along forward), away from c. */
static bool outwards(const umb_view *view, const float c[3], border *out)
{
    double e[3], f[3], n[3], length = 0.0, side = 0.0;
    for (int i = 0; i < 3; ++i) {
        e[i] = out->b[i] - out->a[i];
        f[i] = view->projection == UMB_PERSPECTIVE ? out->a[i] - view->eye[i] : view->forward[i];
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        n[i] = e[j] * f[k] - e[k] * f[j];
        length += n[i] * n[i];
        side += n[i] * (c[i] - out->a[i]);
    }
    if (!(length > 0.0)) {
        return false;
    }
    length = (side > 0.0 ? -1.0 : 1.0) / sqrt(length);
    for (int i = 0; i < 3; ++i) {
        out->away[i] = n[i] * length;
    }
    return true;
}

static void plan_samples(const search *s, border *out)
{
    const umb_view *view = s->view.view;
    const double *axes[2] = {view->right, view->up};
    double length = 0.0;
    double da = depth_of(view, out->a), db = depth_of(view, out->b);
    for (int k = 0; k < 2; ++k) {
        double x = 0.0, y = 0.0;
        for (int i = 0; i < 3; ++i) {
            x += (out->a[i] - view->eye[i]) * axes[k][i];
            y += (out->b[i] - view->eye[i]) * axes[k][i];
        }
        if (view->projection == UMB_PERSPECTIVE) {
            x /= da;
            y /= db;
        }
        length += fabs(x - y) / s->view.pixel[k];
    }
    out->pixel = fmin(s->view.pixel[0], s->view.pixel[1]);
    out->samples = (uint32_t)fmin(1.0 + length / SAMPLE_PIXELS, MAX_SAMPLES);
}

/* Cast beside the point at fraction x of the edge; returns what is seen there. */
static uint32_t cast_beside(worker *w, const border *b, double x, double pixels)
{
    const umb_view *view = w->s->view.view;
    double p[3];
    for (int i = 0; i < 3; ++i) {
        p[i] = b->a[i] + x * (b->b[i] - b->a[i]);
    }
    double scale = view->projection == UMB_PERSPECTIVE ? depth_of(view, p) : 1.0;
    for (int i = 0; i < 3; ++i) {
        p[i] += b->away[i] * pixels * b->pixel * scale;
    }
    return search_cast(w, p) ? w->trace.two_sided.object : MODEL_NONE;
}

/* Two neighbouring samples that saw different things: halve towards where the change is. */
static void halve(worker *w, const border *b, double x0, double x1, uint32_t seen0, uint32_t seen1,
                  double pixels)
{
    for (int i = 0; i < HALVINGS; ++i) {
        double middle = 0.5 * (x0 + x1);
        uint32_t seen = cast_beside(w, b, middle, pixels);
        if (seen == seen1) {
            x1 = middle;
        } else {
            x0 = middle;
            if (seen != seen0) {
                seen0 = seen;
            }
        }
    }
}

static void walk(worker *w, const border *b, uint64_t seed, const double range[2])
{
    uint32_t before = MODEL_NONE;
    double x_before = 0.0;
    w->along_edge = range[1] == 0.0;
    for (uint32_t i = 0; i < b->samples; ++i) {
        double x = (i + 0.02 + 0.96 * oracle_unit(oracle_mix(seed, i, 7))) / b->samples;
        double pixels = 0.0;
        if (!w->along_edge) {
            pixels = range[0] * pow(range[1] / range[0], oracle_unit(oracle_mix(seed, i, 8)));
        }
        uint32_t seen = cast_beside(w, b, x, pixels);
        if (i > 0 && seen != before) {
            halve(w, b, x_before, x, before, seen, pixels);
        }
        before = seen;
        x_before = x;
    }
    w->along_edge = false;
}

void border_item(worker *w, uint64_t item)
{
    search *s = w->s;
    const truth *t = s->t;
    uint64_t number = s->border[item];
    /* Last object whose first triangle is not beyond it. */
    uint32_t low = 0, high = t->model->object_count;
    while (high - low > 1) {
        uint32_t middle = low + (high - low) / 2;
        if (t->first_triangle[middle] <= number) {
            low = middle;
        } else {
            high = middle;
        }
    }
    uint32_t triangle = (uint32_t)(number - t->first_triangle[low]);
    const uint32_t *neighbours = t->neighbours[t->model->objects[low].mesh];
    float v[3][3];
    oracle_triangle(t, low, triangle, v);
    int side = facing(s, v);
    for (int i = 0; i < 3; ++i) {
        /* Corners 1 and 2 of mirrored objects are swapped: edge i of the mesh is edge 2 - i
         * here. */
        int e = t->mirrored[low] ? 2 - i : i;
        uint32_t other = neighbours[3 * (size_t)triangle + (size_t)i];
        float u[3][3];
        border b;
        if (other != MODEL_NONE) {
            oracle_triangle(t, low, other, u);
            if (side != 0 && facing(s, u) == side) {
                continue;
            }
        }
        if (!cut_edge(s, v[e], v[(e + 1) % 3], &b) || !outwards(s->view.view, v[(e + 2) % 3], &b)) {
            continue;
        }
        plan_samples(s, &b);
        for (uint32_t k = 0; k < sizeof(beside) / sizeof(beside[0]); ++k) {
            walk(w, &b, oracle_mix(number, (uint64_t)i, k), beside[k]);
        }
    }
}

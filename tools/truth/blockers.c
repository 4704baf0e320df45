/* Single questions: what stands in front of an object, and what a picture point shows. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "oracle.h"

#define BLOCKER_RAYS 2048u

typedef struct tally {
    uint32_t *hits; /* per object */
    oracle_trace trace;
    const truth *t;
    oracle_view view;
} tally;

/* What blocks from its front blocks for every renderer, so those are the hits that explain. */
static void tally_point(tally *w, uint32_t object, const double p[3])
{
    oracle_sight sight;
    if (!oracle_sight_make(&w->view, p, &sight)) {
        return;
    }
    oracle_trace_ray(w->t, &w->view, &sight, &w->trace);
    const oracle_hit *hit = &w->trace.culling;
    double along = 0.0, square = 0.0;
    for (int i = 0; i < 3; ++i) {
        along += (p[i] - sight.from[i]) * sight.along[i];
        square += sight.along[i] * sight.along[i];
    }
    if (hit->object != MODEL_NONE && hit->object != object && hit->depth < along / square) {
        ++w->hits[hit->object];
    }
}

static void tally_object(tally *w, uint32_t object)
{
    uint32_t count = w->t->model->meshes[w->t->model->objects[object].mesh].triangle_count;
    for (uint32_t k = 0; k < BLOCKER_RAYS; ++k) {
        uint64_t random = oracle_mix(object, k, 11);
        uint32_t triangle = count <= BLOCKER_RAYS ? k % count : (uint32_t)(random % count);
        float v[3][3];
        double p[3];
        oracle_polygon polygon;
        oracle_triangle(w->t, object, triangle, v);
        oracle_clip(&w->view, v, &polygon);
        if (polygon.count) {
            oracle_polygon_point(&polygon, k < count ? 0 : UINT32_MAX, 0.0, random, p);
            tally_point(w, object, p);
        }
    }
}

uint32_t truth_blockers(truth *t, const umb_view *view, uint32_t object, uint32_t *objects,
                        uint32_t *hits, uint32_t capacity)
{
    const model *m = t->model;
    tally w = {.t = t};
    uint32_t written = 0;
    if (object >= m->object_count || m->objects[object].mesh == MODEL_NONE ||
        m->meshes[m->objects[object].mesh].triangle_count == 0) {
        return 0;
    }
    w.hits = calloc(m->object_count, sizeof(*w.hits));
    if (!w.hits) {
        return 0;
    }
    oracle_view_make(t, view, NULL, &w.view);
    tally_object(&w, object);
    for (; written < capacity; ++written) {
        uint32_t best = 0;
        for (uint32_t i = 1; i < m->object_count; ++i) {
            best = w.hits[i] > w.hits[best] ? i : best;
        }
        if (w.hits[best] == 0) {
            break;
        }
        objects[written] = best;
        hits[written] = w.hits[best];
        w.hits[best] = 0;
    }
    free(w.hits);
    free(w.trace.open);
    return written;
}

uint32_t truth_pixel(truth *t, const umb_view *view, double x, double y, double *depth,
                     double normal[3])
{
    oracle_view v;
    oracle_sight sight;
    oracle_trace trace = {0};
    double p[3];
    oracle_view_make(t, view, NULL, &v);
    oracle_picture_point(&v, x, y, p);
    if (!oracle_sight_make(&v, p, &sight)) {
        return MODEL_NONE;
    }
    oracle_trace_ray(t, &v, &sight, &trace);
    oracle_hit hit = trace.two_sided;
    for (uint32_t i = 0; i < trace.open_count; ++i) {
        if (hit.object == MODEL_NONE || trace.open[i].depth < hit.depth) {
            hit = trace.open[i];
        }
    }
    free(trace.open);
    if (hit.object == MODEL_NONE) {
        return MODEL_NONE;
    }
    float c[3][3];
    double length = 0.0;
    oracle_triangle(t, hit.object, hit.triangle, c);
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        normal[i] = ((double)c[1][j] - c[0][j]) * ((double)c[2][k] - c[0][k]) -
                    ((double)c[1][k] - c[0][k]) * ((double)c[2][j] - c[0][j]);
        length += normal[i] * normal[i];
    }
    length = length > 0.0 ? sqrt(length) : 1.0;
    for (int i = 0; i < 3; ++i) {
        normal[i] /= length;
    }
    *depth = hit.depth + view->near_depth;
    return hit.object;
}

#include "segments.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct segment_triangle {
    double a[3], e1[3], e2[3], n[3];
    float min[3], max[3];
    uint32_t object;
    bool two_sided, open;
} segment_triangle;

/* Sixteen triangles of one object and the box around them. */
typedef struct segment_box {
    float min[3], max[3];
    uint32_t first, count;
} segment_box;

struct segments {
    const model *model;
    segment_triangle *triangles;
    segment_box *boxes;
    uint32_t triangle_count, box_count;
};

static void corner(const model *m, const model_object *o, uint32_t t, int c, double out[3])
{
    float p[3];
    model_world_vertex(m, o, m->meshes[o->mesh].indices[3 * t + (uint32_t)c], p);
    for (int k = 0; k < 3; ++k) {
        out[k] = p[k];
    }
}

void segments_triangle(const segments *s, uint32_t object, uint32_t triangle, double out[3][3])
{
    for (int c = 0; c < 3; ++c) {
        corner(s->model, &s->model->objects[object], triangle, c, out[c]);
    }
}

static void add(segments *s, uint32_t object, uint32_t t, bool two_sided)
{
    const model *m = s->model;
    const model_object *o = &m->objects[object];
    segment_triangle *x = &s->triangles[s->triangle_count];
    double p[3][3];
    segments_triangle(s, object, t, p);
    bool turn = model_mirrored(o);
    for (int k = 0; k < 3; ++k) {
        x->a[k] = p[0][k];
        x->e1[k] = p[turn ? 2 : 1][k] - p[0][k];
        x->e2[k] = p[turn ? 1 : 2][k] - p[0][k];
        x->min[k] = (float)fmin(p[0][k], fmin(p[1][k], p[2][k]));
        x->max[k] = (float)fmax(p[0][k], fmax(p[1][k], p[2][k]));
    }
    for (int k = 0; k < 3; ++k) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        x->n[k] = x->e1[i] * x->e2[j] - x->e1[j] * x->e2[i];
    }
    uint8_t flags = m->meshes[o->mesh].flags[t];
    x->object = object;
    x->two_sided = two_sided || (flags & UMB_TRIANGLE_TWO_SIDED) != 0;
    x->open = (flags & UMB_TRIANGLE_OPEN) != 0;
    if (s->box_count == 0 || s->boxes[s->box_count - 1].count == 16 ||
        s->triangles[s->triangle_count - 1].object != object) {
        segment_box *b = &s->boxes[s->box_count++];
        memcpy(b->min, x->min, sizeof b->min);
        memcpy(b->max, x->max, sizeof b->max);
        b->first = s->triangle_count;
        b->count = 0;
    }
    segment_box *b = &s->boxes[s->box_count - 1];
    for (int k = 0; k < 3; ++k) {
        b->min[k] = fminf(b->min[k], x->min[k]);
        b->max[k] = fmaxf(b->max[k], x->max[k]);
    }
    b->count += 1;
    s->triangle_count += 1;
}

segments *segments_create(const model *m, bool two_sided)
{
    uint64_t count = 0;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        count += m->objects[i].mesh != MODEL_NONE ? m->meshes[m->objects[i].mesh].triangle_count : 0;
    }
    segments *s = calloc(1, sizeof *s);
    s->model = m;
    s->triangles = malloc((size_t)(count + 1) * sizeof *s->triangles);
    s->boxes = malloc((size_t)(count + 1) * sizeof *s->boxes);
    for (uint32_t i = 0; i < m->object_count; ++i) {
        uint32_t n = m->objects[i].mesh != MODEL_NONE ? m->meshes[m->objects[i].mesh].triangle_count : 0;
        for (uint32_t t = 0; t < n; ++t) {
            add(s, i, t, two_sided);
        }
    }
    return s;
}

void segments_free(segments *s)
{
    free(s->triangles);
    free(s->boxes);
    free(s);
}

static bool box_met(const segment_box *b, const double a[3], const double inverse[3])
{
    double from = 0.0, to = 1.0;
    for (int k = 0; k < 3; ++k) {
        double x = (b->min[k] - a[k]) * inverse[k], y = (b->max[k] - a[k]) * inverse[k];
        from = fmax(from, fmin(x, y) - 1e-9);
        to = fmin(to, fmax(x, y) + 1e-9);
    }
    return from <= to;
}

/* Where the segment meets the triangle, widened by 1e-7 of itself; -1: nowhere. *front: from its front. */
static double met(const segment_triangle *x, const double a[3], const double d[3], bool *front)
{
    double nd = x->n[0] * d[0] + x->n[1] * d[1] + x->n[2] * d[2];
    double r[3] = {a[0] - x->a[0], a[1] - x->a[1], a[2] - x->a[2]};
    double na = x->n[0] * r[0] + x->n[1] * r[1] + x->n[2] * r[2];
    if (nd == 0.0) {
        return -1.0;
    }
    double t = -na / nd, p[3];
    for (int k = 0; k < 3; ++k) {
        p[k] = r[k] + t * d[k];
    }
    double nn = x->n[0] * x->n[0] + x->n[1] * x->n[1] + x->n[2] * x->n[2], u = 0.0, v = 0.0;
    for (int k = 0; k < 3; ++k) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        u += x->n[k] * (p[i] * x->e2[j] - p[j] * x->e2[i]);
        v += x->n[k] * (x->e1[i] * p[j] - x->e1[j] * p[i]);
    }
    double slack = 1e-7 * nn;
    *front = nd < 0.0;
    return u >= -slack && v >= -slack && u + v <= nn + slack ? t : -1.0;
}

typedef bool visit(void *user, const segment_triangle *x, double t, bool front);

static bool walk(const segments *s, const double a[3], const double b[3], visit *f, void *user)
{
    double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, inverse[3];
    for (int k = 0; k < 3; ++k) {
        inverse[k] = 1.0 / (d[k] != 0.0 ? d[k] : 1e-300);
    }
    for (uint32_t i = 0; i < s->box_count; ++i) {
        if (!box_met(&s->boxes[i], a, inverse)) {
            continue;
        }
        for (uint32_t k = 0; k < s->boxes[i].count; ++k) {
            const segment_triangle *x = &s->triangles[s->boxes[i].first + k];
            bool front;
            double t = met(x, a, d, &front);
            if (t >= 0.0 && t <= 1.0 && !f(user, x, t, front)) {
                return false;
            }
        }
    }
    return true;
}

static bool passes(void *user, const segment_triangle *x, double t, bool front)
{
    (void)user;
    return x->open || !(front || x->two_sided) || t > 1.0 - 1e-9;
}

bool segments_free_way(const segments *s, const double a[3], const double b[3])
{
    return walk(s, a, b, passes, NULL);
}

typedef struct nearest {
    double t;
    uint32_t object;
} nearest;

static bool note(void *user, const segment_triangle *x, double t, bool front)
{
    nearest *n = user;
    (void)front;
    if (t < n->t) {
        n->t = t;
        n->object = x->object;
    }
    return true;
}

uint32_t segments_first(const segments *s, const double a[3], const double b[3])
{
    nearest n = {INFINITY, MODEL_NONE};
    (void)walk(s, a, b, note, &n);
    return n.object;
}

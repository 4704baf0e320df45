#include "exact_shadows.h"

#include <stdlib.h>
#include <string.h>

__extension__ typedef __int128 whole;

typedef struct vec {
    whole c[3];
} vec;

static vec cross(vec a, vec b)
{
    vec out;
    for (int k = 0; k < 3; ++k) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        out.c[k] = a.c[i] * b.c[j] - a.c[j] * b.c[i];
    }
    return out;
}

static int side(vec a, vec b)
{
    whole s = a.c[0] * b.c[0] + a.c[1] * b.c[1] + a.c[2] * b.c[2];
    return s > 0 ? 1 : s < 0 ? -1 : 0;
}

static vec from(const int p[3], const int eye[3])
{
    vec v = {{p[0] - eye[0], p[1] - eye[1], p[2] - eye[2]}};
    return v;
}

static vec times(vec v, whole s)
{
    vec out = {{v.c[0] * s, v.c[1] * s, v.c[2] * s}};
    return out;
}

static vec minus(vec a, vec b)
{
    vec out = {{a.c[0] - b.c[0], a.c[1] - b.c[1], a.c[2] - b.c[2]}};
    return out;
}

static whole dot(vec a, vec b)
{
    return a.c[0] * b.c[0] + a.c[1] * b.c[1] + a.c[2] * b.c[2];
}

/* A piece of a face: corners in the picture, and the lines of the edges that leave them. */
typedef struct piece {
    vec at[40], edge[40];
    int count;
} piece;

/* Divide by what the components have in common, so that numbers stay short. */
static vec shorten(vec v)
{
    whole a = 0;
    for (int k = 0; k < 3; ++k) {
        whole b = v.c[k] < 0 ? -v.c[k] : v.c[k];
        while (b != 0) {
            whole t = a % b;
            a = b;
            b = t;
        }
    }
    for (int k = 0; a > 1 && k < 3; ++k) {
        v.c[k] /= a;
    }
    return v;
}

static piece keep_side(const piece *p, vec line, int keep)
{
    piece out = {.count = 0};
    for (int i = 0; i < p->count; ++i) {
        int j = (i + 1) % p->count, s = keep * side(line, p->at[i]), t = keep * side(line, p->at[j]);
        vec cut = times(line, keep);
        if (s >= 0) {
            out.at[out.count] = p->at[i];
            out.edge[out.count++] = s == 0 && t < 0 ? cut : p->edge[i];
        }
        if (s * t < 0) {
            vec x = times(cross(p->edge[i], line), (whole)s * keep);
            out.at[out.count] = shorten(x);
            out.edge[out.count++] = s > 0 ? cut : p->edge[i];
        }
    }
    return out;
}

static bool reaches(const piece *p, vec line, int sign)
{
    for (int i = 0; i < p->count; ++i) {
        if (side(line, p->at[i]) == sign) {
            return true;
        }
    }
    return false;
}

typedef struct occluder {
    vec edges[EXACT_CORNERS]; /* inside is positive */
    int count;
    vec n; /* away from the eye */
    whole h;
} occluder;

static vec normal(const int a[3], const int b[3], const int c[3])
{
    vec p = {{b[0] - a[0], b[1] - a[1], b[2] - a[2]}}, q = {{c[0] - a[0], c[1] - a[1], c[2] - a[2]}};
    return cross(p, q);
}

int exact_shadows_facing(const exact_polygon *p, const int eye[3])
{
    return side(normal(p->corners[0], p->corners[1], p->corners[2]), times(from(p->corners[0], eye), -1));
}

static occluder make_occluder(const exact_polygon *p, const int eye[3])
{
    occluder o = {.count = p->count};
    int facing = exact_shadows_facing(p, eye);
    o.n = times(normal(p->corners[0], p->corners[1], p->corners[2]), -facing);
    o.h = dot(o.n, from(p->corners[0], eye));
    for (int i = 0; i < p->count; ++i) {
        vec a = from(p->corners[i], eye), b = from(p->corners[(i + 1) % p->count], eye);
        o.edges[i] = times(cross(a, b), -facing);
    }
    return o;
}

typedef struct face {
    vec n;
    whole h;
    piece outline;
} face;

static bool make_face(const int eye[3], const int box_min[3], const int box_max[3], int axis, face *out)
{
    bool low = eye[axis] < box_min[axis];
    if (!low && eye[axis] <= box_max[axis]) {
        return false;
    }
    int at = low ? box_min[axis] : box_max[axis], i = (axis + 1) % 3, j = (axis + 2) % 3;
    memset(out, 0, sizeof *out);
    out->n.c[axis] = low ? 1 : -1;
    out->h = (whole)(at - eye[axis]) * (low ? 1 : -1);
    out->outline.count = 4;
    for (int k = 0; k < 4; ++k) {
        int p[3];
        p[axis] = at;
        p[i] = k == 0 || k == 3 ? box_min[i] : box_max[i];
        p[j] = k < 2 ? box_min[j] : box_max[j];
        out->outline.at[low ? k : 3 - k] = from(p, eye);
    }
    for (int k = 0; k < 4; ++k) {
        out->outline.edge[k] = cross(out->outline.at[k], out->outline.at[(k + 1) % 4]);
    }
    return true;
}

typedef struct clipping {
    const face *face;
    const occluder *occluders;
    int count;
} clipping;

static bool consumed(const clipping *c, const piece *p, int next, int again);

/* What is not beyond the plane of an occluder is left for those after it. If that is no more than an edge or a corner of what
 * is, those before it may hide it too: edges belong to both sides of a cut. */
static bool consumed_before(const clipping *c, const piece *inside, vec depth, int next, int again)
{
    bool partly = reaches(inside, depth, 1), rim = partly && !reaches(inside, depth, -1);
    piece before = partly ? keep_side(inside, depth, -1) : *inside;
    return consumed(c, &before, next, again) || (rim && again < 2 && consumed(c, &before, 0, again + 1));
}

/* Take the shadow of occluder number `next` and of those after it from a piece; true if nothing is left. */
static bool consumed(const clipping *c, const piece *p, int next, int again)
{
    if (next == c->count) {
        return false;
    }
    const occluder *o = &c->occluders[next];
    piece inside = *p;
    for (int i = 0; i < o->count; ++i) {
        if (!reaches(&inside, o->edges[i], 1) && reaches(&inside, o->edges[i], -1)) {
            return consumed(c, &inside, next + 1, again);
        }
        if (reaches(&inside, o->edges[i], -1)) {
            piece outside = keep_side(&inside, o->edges[i], -1);
            if (!consumed(c, &outside, next + 1, again)) {
                return false;
            }
            inside = keep_side(&inside, o->edges[i], 1);
        }
    }
    vec depth = shorten(minus(times(o->n, c->face->h), times(c->face->n, o->h)));
    if (!reaches(&inside, depth, -1) && !reaches(&inside, depth, 0)) {
        return true;
    }
    return consumed_before(c, &inside, depth, next + 1, again);
}

bool exact_shadows_hide(const exact_polygon *polygons, int count, const int eye[3], const int box_min[3],
                        const int box_max[3])
{
    occluder *occluders = calloc((size_t)count + 1, sizeof *occluders);
    bool all = occluders != NULL;
    for (int i = 0; i < count && all; ++i) {
        occluders[i] = make_occluder(&polygons[i], eye);
    }
    for (int axis = 0; axis < 3 && all; ++axis) {
        face f;
        if (make_face(eye, box_min, box_max, axis, &f)) {
            all = consumed(&(clipping){&f, occluders, count}, &f.outline, 0, 0);
        }
    }
    free(occluders);
    return all;
}

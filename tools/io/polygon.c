#include "polygon.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A corner in the plane. Bridges to holes put corners into the list twice. */
typedef struct point {
    double x, y;
    uint32_t corner, next, previous;
} point;

typedef struct outline {
    point *points;
    uint32_t count, start, left; /* points in use; one of the list; length of the list */
} outline;

/* Twice the area of a, b, c; positive when they turn counter-clockwise. */
static double turn(const point *a, const point *b, const point *c)
{
    return (b->x - a->x) * (c->y - a->y) - (b->y - a->y) * (c->x - a->x);
}

static bool same_place(const point *a, const point *b)
{
    return a->x == b->x && a->y == b->y;
}

/* Newell's normal of the outer ring, corners taken from the first for the sake of precision. */
static void newell_normal(const polygon *p, double normal[3])
{
    const double *base = p->corners[p->starts[0]];
    memset(normal, 0, 3 * sizeof *normal);
    for (uint32_t i = p->starts[0]; i < p->starts[1]; ++i) {
        const double *a = p->corners[i];
        const double *b = p->corners[i + 1 < p->starts[1] ? i + 1 : p->starts[0]];
        for (int k = 0; k < 3; ++k) {
            int u = (k + 1) % 3;
            int v = (k + 2) % 3;
            normal[k] += (a[u] - base[u]) * (b[v] - base[v]) - (a[v] - base[v]) * (b[u] - base[u]);
        }
    }
}

static double ring_area(const point *points, uint32_t first, uint32_t end)
{
    double area = 0.0;
    for (uint32_t i = first + 1; i + 1 < end; ++i) {
        area += turn(&points[first], &points[i], &points[i + 1]);
    }
    return area;
}

/* Link [first, end) into a closed list, backwards if asked. */
static void link_ring(point *points, uint32_t first, uint32_t end, bool backwards)
{
    for (uint32_t i = first; i < end; ++i) {
        uint32_t after = i + 1 < end ? i + 1 : first;
        uint32_t before = i > first ? i - 1 : end - 1;
        points[i].next = backwards ? before : after;
        points[i].previous = backwards ? after : before;
    }
}

/* True if the open segments a-b and c-d cross, or c lies on a-b and is neither of its ends. */
static bool blocks(const point *a, const point *b, const point *c, const point *d)
{
    double c_side = turn(a, b, c);
    double d_side = turn(a, b, d);
    if (c_side == 0.0 && (a->x - c->x) * (b->x - c->x) + (a->y - c->y) * (b->y - c->y) < 0.0) {
        return true;
    }
    double a_side = turn(c, d, a);
    double b_side = turn(c, d, b);
    return ((c_side > 0.0 && d_side < 0.0) || (c_side < 0.0 && d_side > 0.0)) &&
           ((a_side > 0.0 && b_side < 0.0) || (a_side < 0.0 && b_side > 0.0));
}

/* True if the way from list point q to m starts into the polygon. */
static bool in_cone(const point *points, const point *q, const point *m)
{
    const point *before = &points[q->previous];
    const point *after = &points[q->next];
    if (turn(before, q, after) > 0.0) {
        return turn(q, after, m) >= 0.0 && turn(before, q, m) >= 0.0;
    }
    return turn(q, after, m) > 0.0 || turn(before, q, m) > 0.0;
}

static bool list_blocks(const outline *o, uint32_t start, const point *a, const point *b)
{
    uint32_t i = start;
    do {
        if (blocks(a, b, &o->points[i], &o->points[o->points[i].next])) {
            return true;
        }
        i = o->points[i].next;
    } while (i != start);
    return false;
}

/* The list point nearest to m that m sees, walking the list once for each try in order of
 * distance would cost a sort; a candidate is tested only when it is nearer than the best so far. */
static uint32_t find_bridge(const outline *o, uint32_t m)
{
    const point *from = &o->points[m];
    uint32_t best = UINT32_MAX;
    double best_distance = INFINITY;
    uint32_t i = o->start;
    do {
        const point *to = &o->points[i];
        double distance = (to->x - from->x) * (to->x - from->x) +
                          (to->y - from->y) * (to->y - from->y);
        if (distance < best_distance && in_cone(o->points, to, from) &&
            in_cone(o->points, from, to) && !list_blocks(o, o->start, from, to) &&
            !list_blocks(o, m, from, to)) {
            best = i;
            best_distance = distance;
        }
        i = to->next;
    } while (i != o->start);
    return best;
}

/* Cut the polygon open along the bridge: list ... q, m, hole ..., m', q', ... */
static void bridge(outline *o, uint32_t q, uint32_t m)
{
    point *points = o->points;
    uint32_t m2 = o->count++;
    uint32_t q2 = o->count++;
    points[m2] = points[m];
    points[q2] = points[q];
    points[points[m].previous].next = m2;
    points[m2].next = q2;
    points[q2].previous = m2;
    points[points[q].next].previous = q2;
    points[q].next = m;
    points[m].previous = q;
}

typedef struct hole {
    double reach; /* its largest x */
    uint32_t at;  /* the corner there */
    uint32_t size;
} hole;

static int compare_holes(const void *a, const void *b)
{
    const hole *p = a;
    const hole *q = b;
    if (p->reach != q->reach) {
        return p->reach > q->reach ? -1 : 1;
    }
    return p->at < q->at ? -1 : p->at > q->at;
}

/* Join all holes to the outer ring, the one that reaches farthest to the right first: nothing
 * but the list itself stands to the right of that corner, so the list has a point that it sees.
 * Holes without such a point lie outside; false then. */
static bool join_holes(outline *o, const polygon *p, hole *holes)
{
    uint32_t count = 0;
    bool joined = true;
    for (uint32_t r = 1; r < p->rings; ++r) {
        uint32_t first = p->starts[r];
        uint32_t end = p->starts[r + 1];
        if (end - first < 3) {
            joined = joined && end == first;
            continue;
        }
        link_ring(o->points, first, end, ring_area(o->points, first, end) > 0.0);
        hole *h = &holes[count++];
        h->at = first;
        h->size = end - first;
        for (uint32_t i = first + 1; i < end; ++i) {
            h->at = o->points[i].x > o->points[h->at].x ? i : h->at;
        }
        h->reach = o->points[h->at].x;
    }
    qsort(holes, count, sizeof *holes, compare_holes);
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t q = find_bridge(o, holes[i].at);
        if (q == UINT32_MAX) {
            joined = false;
            continue;
        }
        bridge(o, q, holes[i].at);
        o->left += holes[i].size + 2;
    }
    return joined;
}

/* A corner may be cut off when it turns left and no point of the list lies in its triangle. */
static bool is_ear(const outline *o, uint32_t i)
{
    const point *b = &o->points[i];
    const point *a = &o->points[b->previous];
    const point *c = &o->points[b->next];
    if (!(turn(a, b, c) > 0.0)) {
        return false;
    }
    for (uint32_t k = c->next; k != b->previous; k = o->points[k].next) {
        const point *q = &o->points[k];
        if (turn(a, b, q) >= 0.0 && turn(b, c, q) >= 0.0 && turn(c, a, q) >= 0.0 &&
            !same_place(q, a) && !same_place(q, b) && !same_place(q, c)) {
            return false;
        }
    }
    return true;
}

/* A point whose neighbours lie in one line with it: cut off last, as part of a triangle of area;
 * or, where the line turns back on itself, a spike of no area that may go at once. */
static bool is_spike(const outline *o, uint32_t i)
{
    const point *b = &o->points[i];
    const point *a = &o->points[b->previous];
    const point *c = &o->points[b->next];
    return turn(a, b, c) == 0.0 &&
           (a->x - b->x) * (c->x - b->x) + (a->y - b->y) * (c->y - b->y) >= 0.0;
}

static uint32_t cut_off(outline *o, uint32_t i, uint32_t out[3], bool *sound)
{
    point *points = o->points;
    uint32_t before = points[i].previous;
    uint32_t after = points[i].next;
    out[0] = points[before].corner;
    out[1] = points[i].corner;
    out[2] = points[after].corner;
    *sound = *sound && turn(&points[before], &points[i], &points[after]) >= 0.0;
    points[before].next = after;
    points[after].previous = before;
    --o->left;
    return after;
}

/* Cut ears until a triangle is left. Where a whole round finds none, the rings are at fault: the
 * next corner goes, ear or not, and the turn of its triangle tells whether that did harm. */
static uint32_t cut_ears(outline *o, uint32_t (*out)[3], bool *sound)
{
    uint32_t count = 0;
    uint32_t at = o->start;
    uint32_t tries = 0;
    while (o->left > 3) {
        if (is_ear(o, at) || is_spike(o, at) || tries > o->left) {
            at = cut_off(o, at, out[count++], sound);
            tries = 0;
        } else {
            at = o->points[at].next;
            ++tries;
        }
    }
    if (o->left == 3) {
        cut_off(o, at, out[count++], sound);
    }
    return count;
}

/* The corners in the plane of the two axes where the surface is largest, turned so that the
 * outer ring runs counter-clockwise. */
static void flatten(const polygon *p, point *points)
{
    double normal[3];
    newell_normal(p, normal);
    int axis = 0;
    for (int k = 1; k < 3; ++k) {
        axis = fabs(normal[k]) > fabs(normal[axis]) ? k : axis;
    }
    int u = (axis + 1) % 3;
    int v = (axis + 2) % 3;
    if (normal[axis] < 0.0) {
        int kept = u;
        u = v;
        v = kept;
    }
    const double *base = p->corners[p->starts[0]];
    for (uint32_t i = p->starts[0]; i < p->starts[p->rings]; ++i) {
        points[i].x = p->corners[i][u] - base[u];
        points[i].y = p->corners[i][v] - base[v];
        points[i].corner = i;
    }
}

uint32_t polygon_triangulate(const polygon *p, uint32_t (*out)[3], bool *sound)
{
    *sound = true;
    if (p->rings == 0 || p->starts[1] - p->starts[0] < 3) {
        return 0;
    }
    outline o = {
        .count = p->starts[p->rings], .start = p->starts[0], .left = p->starts[1] - p->starts[0]};
    o.points = malloc(((size_t)o.count + 2 * (size_t)p->rings) * sizeof *o.points);
    hole *holes = malloc(p->rings * sizeof *holes);
    uint32_t count = UINT32_MAX;
    if (o.points != NULL && holes != NULL) {
        flatten(p, o.points);
        link_ring(o.points, p->starts[0], p->starts[1], false);
        *sound = join_holes(&o, p, holes);
        count = cut_ears(&o, out, sound);
    }
    free(o.points);
    free(holes);
    return count;
}

/* Rays that learn from what others met, after Wonka and others, Guided Visibility Sampling (2006):
 * around the borders of what is seen, and, where something stands before the point that a ray was
 * meant for, from another eye, past that thing's edge.
 *
 * What can be seen from a cell ends where a line of sight touches edges of one or two other things.
 * Lines just beside an edge of something seen, from many eyes, and lines that slip past the edge of
 * what blocks them, are near all of those.
 */
#include <math.h>
#include <stdlib.h>

#include "region_hunt.h"

enum { EDGE_SAMPLES = 3, HALVINGS = 3, SLIPS = 3, TARGET_TRIES = 2, SCANNED = 16 };

static double unit(uint64_t random, uint64_t which)
{
    return oracle_unit(oracle_mix(random, which, 31));
}

/* From low to high, evenly in the logarithm: slits have no natural width. */
static double spread(uint64_t random, uint64_t which, double low, double high)
{
    return low * pow(high / low, unit(random, which));
}

static double distance(const double a[3], const double b[3])
{
    double sum = 0.0;
    for (int i = 0; i < 3; ++i) {
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    }
    return sqrt(sum);
}

/* What stopped the hand's last ray before it came to a point so far from the eye. */
static const oracle_hit *blocker(const region_hand *hand, double far)
{
    const oracle_hit *hit = &hand->trace.culling;
    double near_depth = hand->hunt->cell->near_distance;
    bool before = hit->object != MODEL_NONE && hit->depth + near_depth < far * (1.0 - 1e-6);
    return before ? hit : NULL;
}

/* A point just outside of an edge of the triangle, the one that `random` names, near `hit`. */
static void beside_edge(float v[3][3], const double hit[3], uint64_t random, double out[3])
{
    unsigned k = (unsigned)(random % 3);
    const float *a = v[k], *b = v[(k + 1) % 3], *c = v[(k + 2) % 3];
    double along = 0.0, square = 0.0;
    for (int i = 0; i < 3; ++i) {
        along += (hit[i] - a[i]) * ((double)b[i] - a[i]);
        square += ((double)b[i] - a[i]) * ((double)b[i] - a[i]);
    }
    double share = square > 0.0 ? fmin(fmax(along / square, 0.0), 1.0) : 0.0;
    if (random >> 8 & 1) {
        share = unit(random, 1);
    }
    double out_of = spread(random, 2, 1e-6, 0.1);
    for (int i = 0; i < 3; ++i) {
        double p = a[i] + share * ((double)b[i] - a[i]);
        out[i] = p + out_of * (p - c[i]);
    }
}

/* A point just outside of an object: beside a corner of it that lies far to one side of the line. */
static void beside_object(const region_hand *hand, uint32_t object, const double from[3],
                          const double to[3], uint64_t random, double out[3])
{
    const truth *t = hand->hunt->t;
    uint32_t count = t->model->meshes[t->model->objects[object].mesh].triangle_count;
    double way[3], along = 0.0, square = 0.0, best = -INFINITY, least = INFINITY;
    for (int i = 0; i < 3; ++i) {
        way[i] = unit(random, (uint64_t)i + 3) - 0.5;
        along += way[i] * (to[i] - from[i]);
        square += (to[i] - from[i]) * (to[i] - from[i]);
    }
    for (int i = 0; i < 3 && square > 0.0; ++i) {
        way[i] -= along / square * (to[i] - from[i]);
    }
    uint32_t scanned = count < SCANNED ? count : SCANNED;
    for (uint32_t k = 0; k < scanned; ++k) {
        uint32_t triangle = count <= SCANNED ? k : (uint32_t)(oracle_mix(random, k, 32) % count);
        float v[3][3];
        oracle_triangle(t, object, triangle, v);
        for (int c = 0; c < 3; ++c) {
            double reach = v[c][0] * way[0] + v[c][1] * way[1] + v[c][2] * way[2];
            least = fmin(least, reach);
            if (reach > best) {
                best = reach;
                out[0] = v[c][0];
                out[1] = v[c][1];
                out[2] = v[c][2];
            }
        }
    }
    double size = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
    double push = size > 0.0 ? spread(random, 7, 1e-6, 0.03) * (best - least) / size : 0.0;
    for (int i = 0; i < 3; ++i) {
        out[i] += push * way[i];
    }
}

/* The hand's last ray, from an eye to a point, was stopped before it. Try from eyes that see the point
 * past what stopped it. With an object the point is one of its triangle's. */
static void slip(region_hand *hand, const double eye[3], const double point[3], uint32_t object,
                 uint32_t triangle, uint64_t random)
{
    double from[3] = {eye[0], eye[1], eye[2]};
    for (uint64_t k = 0; k < SLIPS; ++k) {
        const oracle_hit *hit = blocker(hand, distance(from, point));
        double by[3], met[3];
        float v[3][3];
        if (hit == NULL) {
            return;
        }
        uint64_t choice = oracle_mix(random, k, 33);
        double share = (hit->depth + hand->hunt->cell->near_distance) / distance(from, point);
        for (int i = 0; i < 3; ++i) {
            met[i] = from[i] + share * (point[i] - from[i]);
        }
        oracle_triangle(hand->hunt->t, hit->object, hit->triangle, v);
        if (choice >> 20 & 1) {
            beside_object(hand, hit->object, from, point, choice, by);
        } else {
            beside_edge(v, met, choice, by);
        }
        if (!region_line_eye(hand->hunt->cell, point, by, from)) {
            region_eye(hand->hunt, choice, from);
        }
        if (object != MODEL_NONE) {
            region_aim(hand, from, point, object, triangle);
        } else {
            region_cast(hand, from, point);
        }
    }
}

/* A point beside `at`, which lies on the edge from a to b, away from c as the eye sees it. */
static bool beside(const double eye[3], const float a[3], const float b[3], const float c[3],
                   const double at[3], double angle, double out[3])
{
    double e[3], f[3], n[3], length = 0.0, side = 0.0;
    for (int i = 0; i < 3; ++i) {
        e[i] = (double)b[i] - a[i];
        f[i] = at[i] - eye[i];
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        n[i] = e[j] * f[k] - e[k] * f[j];
        length += n[i] * n[i];
        side += n[i] * (c[i] - at[i]);
    }
    if (!(length > 0.0)) {
        return false;
    }
    double scale = (side > 0.0 ? -angle : angle) * distance(eye, at) / sqrt(length);
    for (int i = 0; i < 3; ++i) {
        out[i] = at[i] + scale * n[i];
    }
    return true;
}

/* An edge of a seen triangle. */
typedef struct border {
    const float *a, *b, *c;
    uint64_t random;
} border;

static void edge_point(const border *b, double share, double out[3])
{
    for (int i = 0; i < 3; ++i) {
        out[i] = b->a[i] + share * ((double)b->b[i] - b->a[i]);
    }
}

/* What is seen beside the edge, numbered; UINT64_MAX: nothing. */
static uint64_t look_beside(region_hand *hand, const border *b, const double eye[3], double share,
                            double angle)
{
    double at[3], point[3];
    edge_point(b, share, at);
    if (!beside(eye, b->a, b->b, b->c, at, angle, point)) {
        return UINT64_MAX;
    }
    region_cast(hand, eye, point);
    const oracle_hit *hit = &hand->trace.culling;
    uint64_t met = hit->object == MODEL_NONE
                       ? UINT64_MAX
                       : hand->hunt->t->first_triangle[hit->object] + hit->triangle;
    slip(hand, eye, point, MODEL_NONE, 0, oracle_mix(b->random, (uint64_t)(share * 1e9), 34));
    return met;
}

static void walk_edge(region_hand *hand, const border *b, const double eye[3])
{
    double angle = spread(b->random, 1, 1e-6, 0.03), last_share = 0.0;
    uint64_t last = 0;
    for (uint64_t s = 0; s < EDGE_SAMPLES; ++s) {
        double share = ((double)s + unit(b->random, 10 + s)) / EDGE_SAMPLES, other[3];
        uint64_t met = look_beside(hand, b, eye, share, angle);
        double low = last_share, high = share;
        for (int i = 0; i < HALVINGS && s > 0 && met != last; ++i) {
            double middle = 0.5 * (low + high);
            uint64_t there = look_beside(hand, b, eye, middle, angle);
            low = there == met ? low : middle;
            high = there == met ? middle : high;
        }
        region_eye(hand->hunt, oracle_mix(b->random, s, 35), other);
        look_beside(hand, b, other, share, spread(b->random, 20 + s, 1e-6, 0.03));
        last = met;
        last_share = share;
    }
}

/* A neighbour that is not seen yet: most of those are as visible as this one. */
static void try_neighbour(region_hand *hand, const double eye[3], uint32_t object,
                          uint32_t triangle, float v[3][3], uint64_t random)
{
    double point[3], p = unit(random, 2), q = unit(random, 3);
    bool over = p + q > 1.0;
    p = over ? 1.0 - p : p;
    q = over ? 1.0 - q : q;
    for (int i = 0; i < 3; ++i) {
        point[i] = v[0][i] + p * ((double)v[1][i] - v[0][i]) + q * ((double)v[2][i] - v[0][i]);
    }
    region_aim(hand, eye, point, object, triangle);
    slip(hand, eye, point, object, triangle, random);
}

void region_border_item(region_hand *hand, uint64_t item)
{
    region_hunt *h = hand->hunt;
    const region_witness *w = &h->witnesses[item % h->witness_count];
    uint32_t mesh = h->t->model->objects[w->object].mesh;
    const uint32_t *neighbours = oracle_neighbours(h->t, mesh);
    float v[3][3], u[3][3];
    if (neighbours == NULL) {
        hand->failed = true;
        return;
    }
    oracle_triangle(h->t, w->object, w->triangle, v);
    int side = oracle_facing(v, w->eye);
    for (int i = 0; i < 3; ++i) {
        /* Corners 1 and 2 of mirrored objects are swapped: edge i of the mesh is edge 2 - i here. */
        int e = h->t->mirrored[w->object] ? 2 - i : i;
        uint32_t other = neighbours[3 * (size_t)w->triangle + (size_t)i];
        uint64_t random = oracle_mix(oracle_mix(item, h->options->seed, 36), (uint64_t)i, h->round);
        if (other != MODEL_NONE) {
            oracle_triangle(h->t, w->object, other, u);
            uint8_t state = region_state(h, h->t->first_triangle[w->object] + other);
            if ((state & REGION_SEEN) == 0) {
                try_neighbour(hand, w->eye, w->object, other, u, random);
            }
            /* Not in the outline from here, and most likely not from elsewhere. */
            if (side != 0 && oracle_facing(u, w->eye) == side && (random & 7) != 0) {
                continue;
            }
        }
        border b = {v[e], v[(e + 1) % 3], v[(e + 2) % 3], random};
        walk_edge(hand, &b, w->eye);
    }
}

static void aim_at(region_hand *hand, uint32_t object, uint32_t triangle, uint64_t random)
{
    float v[3][3];
    double eye[3], point[3], p = unit(random, 2), q = unit(random, 3);
    unsigned kind = random >> 16 & 3, corner = (unsigned)(random >> 18) % 3;
    oracle_triangle(hand->hunt->t, object, triangle, v);
    /* Anywhere in the triangle, or close to a corner or a middle of an edge. */
    bool over = p + q > 1.0;
    p = over ? 1.0 - p : p;
    q = over ? 1.0 - q : q;
    double weight[3] = {1.0 - p - q, p, q};
    if (kind < 2) {
        double pull = kind == 0 ? 1e-4 : 1e-2, half = random >> 22 & 1 ? 0.5 : 0.0;
        for (unsigned i = 0; i < 3; ++i) {
            double goal = i == corner ? 1.0 - half : i == (corner + 1) % 3 ? half : 0.0;
            weight[i] = goal + pull * (1.0 / 3.0 - goal);
        }
    }
    for (int i = 0; i < 3; ++i) {
        point[i] = v[0][i] + weight[1] * ((double)v[1][i] - v[0][i]) +
                   weight[2] * ((double)v[2][i] - v[0][i]);
    }
    region_eye(hand->hunt, oracle_mix(random, 4, 37), eye);
    region_aim(hand, eye, point, object, triangle);
    slip(hand, eye, point, object, triangle, random);
}

/* A triangle of a seen object that is not seen. */
static void aim_at_unseen_triangle(region_hand *hand, uint64_t random)
{
    region_hunt *h = hand->hunt;
    uint32_t object = h->witnesses[random % h->witness_count].object;
    uint64_t first = h->t->first_triangle[object];
    uint64_t count = h->t->first_triangle[object + 1] - first;
    for (uint64_t k = 0; k < 8; ++k) {
        uint64_t triangle = oracle_mix(random, k, 38) % count;
        if ((region_state(h, first + triangle) & REGION_SEEN) == 0) {
            aim_at(hand, object, (uint32_t)triangle, oracle_mix(random, k, 39));
            return;
        }
    }
}

void region_target_item(region_hand *hand, uint64_t item)
{
    region_hunt *h = hand->hunt;
    uint64_t random = oracle_mix(item, h->options->seed, 40);
    if ((item & 3) == 3 || h->target_count == 0) {
        if (h->witness_count != 0) {
            aim_at_unseen_triangle(hand, random);
        }
        return;
    }
    /* Three of four at likely ones. */
    uint64_t from = oracle_mix(random, 1, 42);
    bool likely = h->likely_count == h->target_count || (h->likely_count != 0 && (from & 3) != 0);
    uint64_t first = likely ? 0 : h->likely_count;
    uint64_t among = likely ? h->likely_count : h->target_count - h->likely_count;
    uint32_t object = h->targets[first + (from >> 2) % among];
    uint64_t count = h->t->first_triangle[object + 1] - h->t->first_triangle[object];
    for (uint64_t k = 0; k < TARGET_TRIES && h->witness_of[object] == MODEL_NONE; ++k) {
        uint64_t choice = oracle_mix(random, k, 41);
        aim_at(hand, object, (uint32_t)(choice % count), choice);
    }
}

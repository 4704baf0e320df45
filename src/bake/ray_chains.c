#include "ray_chains.h"

#include <math.h>
#include <string.h>

typedef struct sight {
    double t, top, bottom; /* as seen from where all lines of the row nearly meet */
    uint8_t vertex;
} sight;

/* A chain of a convex body that is highest (sign 1) or lowest (-1) as seen from there. Any chain would be
 * right. */
static uint32_t hull_chain(const sight *p, uint32_t count, double sign, uint8_t *chain)
{
    uint32_t kept[UMB_UMBRA_VERTICES], n = 0;
    for (uint32_t i = 0; i < count; ++i) {
        double y = sign > 0.0 ? p[i].top : -p[i].bottom;
        if (n > 0 && p[kept[n - 1]].t == p[i].t) {
            double last = sign > 0.0 ? p[kept[n - 1]].top : -p[kept[n - 1]].bottom;
            if (last >= y) {
                continue;
            }
            --n;
        }
        while (n >= 2) {
            const sight *a = &p[kept[n - 2]], *b = &p[kept[n - 1]];
            double ya = sign > 0.0 ? a->top : -a->bottom, yb = sign > 0.0 ? b->top : -b->bottom;
            if ((yb - ya) * (p[i].t - a->t) > (y - ya) * (b->t - a->t)) {
                break;
            }
            --n;
        }
        kept[n++] = i;
    }
    for (uint32_t i = 0; i < n; ++i) {
        chain[i] = p[kept[i]].vertex;
    }
    return n;
}

void umb_ray_chains_convex(const umb_ray_map *m, const umb_ray_blocker *b, double s, umb_ray_chains *out)
{
    sight sights[UMB_UMBRA_VERTICES];
    for (uint32_t i = 0; i < b->count; ++i) {
        const umb_ray_point *p = &b->vertices[i];
        double alpha = m->alpha0 + m->alpha1 * p->u, beta = m->beta0 + m->beta1 * p->u;
        sight x = {(p->v - alpha * s) / beta, (p->z - m->frame->z1) / beta,
                   (p->z - m->frame->z0) / beta, (uint8_t)i};
        uint32_t k = i;
        for (; k > 0 && sights[k - 1].t > x.t; --k) {
            sights[k] = sights[k - 1];
        }
        sights[k] = x;
    }
    out->top_count = hull_chain(sights, b->count, 1.0, out->top);
    out->bottom_count = hull_chain(sights, b->count, -1.0, out->bottom);
}

static double value_at(const umb_ray_map *m, const umb_ray_point *p, double s, double t)
{
    return p->v - (m->alpha0 + m->alpha1 * p->u) * s - (m->beta0 + m->beta1 * p->u) * t;
}

/* Walk the ring from a vertex to another; the mean height of what lies between, NAN for nothing. */
static uint32_t walk_ring(const umb_ray_blocker *b, uint32_t from, uint32_t to, uint32_t step, uint8_t *chain, double *mean)
{
    uint32_t n = 0;
    double sum = 0.0;
    for (uint32_t i = from; i != to; i = (i + step) % b->ring) {
        sum += n > 0 ? b->vertices[i].z : 0.0;
        chain[n++] = (uint8_t)i;
    }
    chain[n++] = (uint8_t)to;
    *mean = n > 2 ? sum / (n - 2) : NAN;
    return n;
}

/* Lines that have one end of an edge on a side have the other there too: an end without a length, seen from above,
 * is never crossed. */
static uint32_t trim(const umb_ray_blocker *b, uint8_t *chain, uint32_t count)
{
    uint32_t first = 0;
    const umb_ray_point *p = b->vertices;
    while (count > 2 && p[chain[first]].u == p[chain[first + 1]].u && p[chain[first]].v == p[chain[first + 1]].v) {
        ++first;
        --count;
    }
    memmove(chain, chain + first, count);
    while (count > 2 && p[chain[count - 1]].u == p[chain[count - 2]].u && p[chain[count - 1]].v == p[chain[count - 2]].v) {
        --count;
    }
    return count;
}

void umb_ray_chains_ring(const umb_ray_map *m, const umb_ray_blocker *b, double s, double t0, double t1,
                         umb_ray_chains *out)
{
    double least = INFINITY, most = -INFINITY, up, down;
    uint32_t low = 0, high = 0;
    for (uint32_t i = 0; i < b->ring; ++i) {
        double f0 = value_at(m, &b->vertices[i], s, t0), f1 = value_at(m, &b->vertices[i], s, t1);
        low = f0 < least ? i : low;
        least = f0 < least ? f0 : least;
        high = f1 > most ? i : high;
        most = f1 > most ? f1 : most;
    }
    out->top_count = walk_ring(b, low, high, 1, out->top, &up);
    out->bottom_count = walk_ring(b, low, high, b->ring - 1, out->bottom, &down);
    /* A chain without inner vertices is a straight edge between the two. */
    double middle = 0.5 * (b->vertices[low].z + b->vertices[high].z);
    if ((out->top_count > 2 ? up : middle) < (out->bottom_count > 2 ? down : middle)) {
        umb_ray_chains turned = {.top_count = out->bottom_count, .bottom_count = out->top_count};
        memcpy(turned.top, out->bottom, sizeof turned.top);
        memcpy(turned.bottom, out->top, sizeof turned.bottom);
        *out = turned;
    }
    out->top_count = trim(b, out->top, out->top_count);
    out->bottom_count = trim(b, out->bottom, out->bottom_count);
}

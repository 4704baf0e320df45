#include "beam.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LEAST_PART 0x1p-19
#define TRIALS 96
#define MOST_CUTS 64 /* one after another: UMB_BEAM_MARGIN says why not more */
/* What a cut is worth: segments that it parts, a half that needs no further cut, how long what is cut is. These left the fewest
 * objects undecided in cities and box fields. */
#define WHOLE 64
#define HALVED 16

void umb_beam_corners(const umb_beam_part *p, double out[8][3])
{
    for (int c = 0; c < 8 && p->triangle; ++c) {
        memcpy(out[c], c % 3 == 0 ? p->middle : p->axes[c % 3 - 1], sizeof out[c]);
    }
    for (int c = 0; c < 8 && !p->triangle; ++c) {
        for (int k = 0; k < 3; ++k) {
            double x = p->middle[k];
            for (int a = 0; a < 3; ++a) {
                x += (c >> a & 1) != 0 ? p->axes[a][k] : -p->axes[a][k];
            }
            out[c][k] = x;
        }
    }
}

static double length_squared(const double v[3])
{
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

/* Of a triangle half the edge from its corner a to the next. */
static double axis_squared(const umb_beam_part *p, int a)
{
    if (!p->triangle) {
        return length_squared(p->axes[a]);
    }
    const double *from = a == 0 ? p->middle : p->axes[a - 1], *to = a == 2 ? p->middle : p->axes[a];
    double half[3] = {0.5 * (to[0] - from[0]), 0.5 * (to[1] - from[1]), 0.5 * (to[2] - from[2])};
    return length_squared(half);
}

umb_beam_part umb_beam_cut(const umb_beam_part *p, int axis, double share, bool upper)
{
    umb_beam_part h = *p;
    double *from = axis == 0 ? h.middle : h.axes[axis - 1], *to = axis == 2 ? h.middle : h.axes[axis];
    double size = upper ? 1.0 - share : share, at = upper ? share : share - 1.0;
    for (int k = 0; k < 3; ++k) {
        if (p->triangle) {
            double middle = 0.5 * (from[k] + to[k]);
            double at_share = share < 0.5 ? 0.5 * (from[k] + middle) : share > 0.5 ? 0.5 * (middle + to[k]) : middle;
            *(upper ? &from[k] : &to[k]) = at_share;
        } else {
            h.axes[axis][k] = size * p->axes[axis][k] * (1.0 + 0x1p-24);
            h.middle[k] = p->middle[k] + at * p->axes[axis][k];
        }
    }
    return h;
}

static void box_of(const double corners[8][3], double min[3], double max[3])
{
    for (int k = 0; k < 3; ++k) {
        min[k] = max[k] = corners[0][k];
        for (int c = 1; c < 8; ++c) {
            min[k] = corners[c][k] < min[k] ? corners[c][k] : min[k];
            max[k] = corners[c][k] > max[k] ? corners[c][k] : max[k];
        }
    }
}

void umb_beam_bounds(const umb_beam_part *p, double min[3], double max[3])
{
    double corners[8][3];
    umb_beam_corners(p, corners);
    box_of((const double(*)[3])corners, min, max);
}

umb_beam_part umb_beam_box(const double min[3], const double max[3], double more)
{
    umb_beam_part p = {.triangle = false};
    for (int k = 0; k < 3; ++k) {
        p.middle[k] = 0.5 * (min[k] + max[k]);
        p.axes[k][k] = fmax(max[k] - p.middle[k], p.middle[k] - min[k]) + more;
    }
    return p;
}

umb_beam_part umb_beam_triangle(const double corners[3][3])
{
    umb_beam_part p = {.triangle = true};
    memcpy(p.middle, corners[0], sizeof p.middle);
    memcpy(p.axes, corners[1], 2 * sizeof p.axes[0]);
    return p;
}

/* What of a beam's 64 segments between corners bodies block. */
typedef enum verdict { OPEN, BLOCKED, SHARED } verdict; /* SHARED: all are, but by no single body */

typedef struct looked_at {
    const umb_solids *solids;
    double from[8][3], to[8][3];
    uint64_t own[UMB_BEAM_BODIES]; /* segments that each body blocks */
    bool known[UMB_BEAM_BODIES];   /* own is */
} looked_at;

static bool blocks_segment(const looked_at *l, const uint32_t *bodies, uint32_t i, uint32_t segment)
{
    return l->known[i] ? (l->own[i] >> segment & 1) != 0
                       : umb_solid_meets(l->solids, &l->solids->items[bodies[i]], l->from[segment >> 3], l->to[segment & 7]);
}

/* One segment after another: who blocks it is asked about the others too. Most of what can be seen shows in the first
 * few. SHARED: what blocks most comes first, and *most of them. */
static verdict look(looked_at *l, uint32_t *bodies, uint32_t count, uint64_t *most)
{
    uint64_t blocked = 0;
    uint32_t best = 0, weight = 0;
    memset(l->known, 0, sizeof l->known);
    for (uint32_t n = 0; n < 64; ++n) {
        uint32_t segment = n * 37 & 63, i = 0; /* corners far apart first */
        if ((blocked >> segment & 1) != 0) {
            continue;
        }
        while (i < count && !blocks_segment(l, bodies, i, segment)) {
            ++i;
        }
        if (i == count) {
            return OPEN;
        }
        l->known[i] = true;
        l->own[i] = umb_solid_blocks(l->solids, &l->solids->items[bodies[i]], (const double(*)[3])l->from,
                                     (const double(*)[3])l->to) | UINT64_C(1) << segment;
        if (l->own[i] == UINT64_MAX) {
            return BLOCKED;
        }
        blocked |= l->own[i];
        uint32_t own = (uint32_t)__builtin_popcountll(l->own[i]);
        best = own > weight ? i : best;
        weight = own > weight ? own : weight;
    }
    /* One that was not asked yet may do it alone. */
    for (uint32_t i = 0; i < count; ++i) {
        if (!l->known[i] && blocks_segment(l, bodies, i, 0) && blocks_segment(l, bodies, i, 63) &&
            umb_solid_blocks(l->solids, &l->solids->items[bodies[i]], (const double(*)[3])l->from,
                             (const double(*)[3])l->to) == UINT64_MAX) {
            return BLOCKED;
        }
    }
    uint32_t first = bodies[0];
    *most = l->own[best];
    bodies[0] = bodies[best];
    bodies[best] = first;
    return SHARED;
}

/* Bodies that may meet a segment of the beam come first: *n of them. */
static __attribute__((noinline)) verdict look_at(const umb_solids *solids, const umb_beam_part *a, const umb_beam_part *b,
                                                 uint32_t *bodies, uint32_t count, uint32_t *n, uint64_t *most)
{
    looked_at l = {.solids = solids};
    double min[2][3], max[2][3];
    umb_shaft shaft;
    umb_beam_corners(a, l.from);
    umb_beam_corners(b, l.to);
    box_of((const double(*)[3])l.from, min[0], max[0]);
    box_of((const double(*)[3])l.to, min[1], max[1]);
    umb_shaft_make(&shaft, (const double(*)[3])min, (const double(*)[3])max);
    *n = 0;
    for (uint32_t i = 0; i < count; ++i) {
        uint32_t body = bodies[i];
        if (!umb_shaft_beside(&shaft, &solids->items[body].bounds)) {
            bodies[i] = bodies[*n];
            bodies[(*n)++] = body;
        }
    }
    return look(&l, bodies, *n, most);
}

/* A point of a part: six numbers in [-1, 1) make a segment. */
static void point_of(const umb_beam_part *p, const double share[3], double out[3])
{
    double u = 0.5 + 0.5 * share[0], v = 0.5 + 0.5 * share[1], over = u + v > 1.0 ? 1.0 : 0.0;
    u = over + (1.0 - 2.0 * over) * u;
    v = over + (1.0 - 2.0 * over) * v;
    for (int k = 0; k < 3 && p->triangle; ++k) {
        out[k] = p->middle[k] + u * (p->axes[0][k] - p->middle[k]) + v * (p->axes[1][k] - p->middle[k]);
    }
    if (p->triangle) {
        return;
    }
    for (int k = 0; k < 3; ++k) {
        out[k] = p->middle[k] + share[0] * p->axes[0][k] + share[1] * p->axes[1][k] + share[2] * p->axes[2][k];
    }
}

/* Some segments of the beam, spread evenly (multiples of the powers of 1/x with x^7 = x + 1): false if no body meets one of
 * them. What shows in the middle of a part would be found late by cutting. */
static bool trials_blocked(const umb_solids *solids, const umb_beam_part *a, const umb_beam_part *b, const uint32_t *bodies,
                           uint32_t count)
{
    static const double steps[6] = {0.89865371264453, 0.80757849521866, 0.72573341300846,
                                    0.65218302601174, 0.58608669787303, 0.52668898694889};
    uint32_t last = 0;
    for (int n = 1; n <= TRIALS; ++n) {
        double share[2][3], from[3], to[3];
        for (int k = 0; k < 6; ++k) {
            double x = n * steps[k];
            share[k / 3][k % 3] = 2.0 * (x - floor(x)) - 1.0;
        }
        point_of(a, share[0], from);
        point_of(b, share[1], to);
        uint32_t i = 0;
        while (i < count && !umb_solid_meets(solids, &solids->items[bodies[(last + i) % count]], from, to)) {
            ++i;
        }
        if (i == count) {
            return false;
        }
        last = (last + i) % count;
    }
    return true;
}

/* Where a beam is cut: one of the axes of both parts; more is blocked towards its end (upper) or its beginning. */
typedef struct place {
    bool target, upper;
    int axis;
} place;

/* Segments of the 64 whose end in a part has the axis's other end: bit `axis` of a box's corner; corner `axis` of a triangle, and the
 * one after it. */
static uint64_t segments_at(const umb_beam_part *p, bool target, int axis, bool upper)
{
    uint64_t mask = 0;
    for (int c = 0; c < 8; ++c) {
        bool here = p->triangle ? c % 3 == (axis + (upper ? 1 : 0)) % 3 : (c >> axis & 1) == (upper ? 1 : 0);
        mask |= !here ? 0 : target ? UINT64_C(0x0101010101010101) << c : UINT64_C(0xFF) << (8 * c);
    }
    return mask;
}

/* Across what best parts the segments that the body which blocks most lets by from those that it blocks, but not what is short
 * beside others. False: all are short. */
static bool find_place(const umb_beam_part *a, const umb_beam_part *b, uint64_t most, double least, place *out)
{
    int best = INT32_MIN;
    for (int k = 0; k < 6; ++k) {
        const umb_beam_part *p = k < 3 ? a : b;
        double size = axis_squared(p, k % 3);
        if (!(size > least * least)) {
            continue;
        }
        int low = __builtin_popcountll(most & segments_at(p, k >= 3, k % 3, false));
        int high = __builtin_popcountll(most & segments_at(p, k >= 3, k % 3, true));
        int whole = low == 32 || high == 32 ? WHOLE : 0; /* one half is blocked by one body */
        int score = abs(high - low) + whole + HALVED * ilogb(size) / 2;
        if (score > best) {
            best = score;
            *out = (place){k >= 3, high > low, k % 3};
        }
    }
    return best > INT32_MIN;
}

/* Where to cut so that a body blocks all of what is on the better side, as much as it can; 0: it blocks not even a quarter. */
static double trim(const umb_solids *s, const umb_beam_part *a, const umb_beam_part *b, uint32_t body, const place *at)
{
    for (double size = 0.75; size > 0.0; size -= 0.25) {
        double share = at->upper ? 1.0 - size : size, from[8][3], to[8][3];
        umb_beam_part part = umb_beam_cut(at->target ? b : a, at->axis, share, at->upper);
        umb_beam_corners(at->target ? a : &part, from);
        umb_beam_corners(at->target ? &part : b, to);
        if (umb_solid_blocks_all(s, &s->items[body], (const double(*)[3])from, (const double(*)[3])to)) {
            return share;
        }
    }
    return 0.0;
}

/* Whatever of the segments between corners no body meets will still be there in some part, however small: then it is no
 * use to go on. */
static bool blocked(umb_beam_search *s, const umb_beam_part *a, const umb_beam_part *b, uint32_t *bodies, uint32_t count,
                    uint32_t cuts)
{
    uint32_t n;
    uint64_t most;
    if (s->effort == 0 || cuts == MOST_CUTS) {
        return false;
    }
    s->effort -= 1;
    verdict v = look_at(s->solids, a, b, bodies, count, &n, &most);
    if (v == SHARED && cuts == 0 && !trials_blocked(s->solids, a, b, bodies, n)) {
        v = OPEN;
    }
    s->open = s->open || v == OPEN;
    if (v != SHARED) {
        return v == BLOCKED;
    }
    place at;
    if (!find_place(a, b, most, LEAST_PART * s->solids->reach, &at)) {
        return false;
    }
    double share = trim(s->solids, a, b, bodies[0], &at);
    for (int side = 0; side < 2; ++side) {
        bool upper = side == 0 ? !at.upper : at.upper;
        if (side == 1 && share > 0.0) {
            break; /* blocked, as trim found */
        }
        umb_beam_part part = umb_beam_cut(at.target ? b : a, at.axis, share > 0.0 ? share : 0.5, upper);
        if (!blocked(s, at.target ? a : &part, at.target ? &part : b, bodies, n, cuts + 1)) {
            return false;
        }
    }
    return true;
}

bool umb_beam_blocked(umb_beam_search *s, const umb_beam_part *a, const umb_beam_part *b, uint32_t *bodies, uint32_t count)
{
    return blocked(s, a, b, bodies, count, 0);
}

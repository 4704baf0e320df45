/* Refinement: what the maps left is asked about once more, in all directions alike (docs/conservative.md, T5). A beam is
 * all segments from a part of the cell to a part of an object. One body that meets every segment between the corners of
 * both parts meets them all; else the larger part is cut in two. A segment that no body meets ends the search: then
 * nothing can be proved. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "region_state.h"
#include "solid_inner.h"

#define MOST_BODIES 128
#define DEFAULT_EFFORT 512
#define CHUNK 16
/* Parts are larger than what they stand for by this much of the reach, hundreds of times what sums of their corners
 * lose on the way down; none is cut whose halves would overlap by less than that. */
#define PART_MARGIN 0x1p-44
#define LEAST_PART 0x1p-19

/* A part of the cell or of an object: a middle and three half axes. */
typedef struct part {
    double middle[3], axes[3][3];
} part;

typedef struct search {
    const umb_solids *solids;
    uint32_t effort; /* left */
} search;

static void corners_of(const part *p, double out[8][3])
{
    for (int c = 0; c < 8; ++c) {
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

static int longest_axis(const part *p, double *length)
{
    int longest = 0;
    for (int a = 1; a < 3; ++a) {
        longest = length_squared(p->axes[a]) > length_squared(p->axes[longest]) ? a : longest;
    }
    *length = length_squared(p->axes[longest]);
    return longest;
}

/* Half of a part along an axis; halves overlap by far more than rounding can part them. */
static part half_of(const part *p, int axis, double side)
{
    part h = *p;
    for (int k = 0; k < 3; ++k) {
        h.axes[axis][k] = 0.5 * p->axes[axis][k] * (1.0 + 0x1p-24);
        h.middle[k] = p->middle[k] + side * 0.5 * p->axes[axis][k];
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

typedef struct shaft {
    double min[2][3], max[2][3]; /* boxes around both ends */
} shaft;

/* True if the box is surely beside the hull of both ends, as seen along one of the axes: only saves work. */
static bool beside(const shaft *s, const umb_aabb *b)
{
    for (int k = 0; k < 3; ++k) {
        if (b->max[k] < fmin(s->min[0][k], s->min[1][k]) || b->min[k] > fmax(s->max[0][k], s->max[1][k])) {
            return true;
        }
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3;
        for (int c = 0; c < 4; ++c) {
            double x0 = (c & 1) != 0 ? s->max[0][i] : s->min[0][i], y0 = (c & 2) != 0 ? s->max[0][j] : s->min[0][j];
            double x1 = (c & 1) != 0 ? s->max[1][i] : s->min[1][i], y1 = (c & 2) != 0 ? s->max[1][j] : s->min[1][j];
            /* The normal that points out of both ends at this corner. */
            double nx = y1 - y0, ny = x0 - x1, sx = (c & 1) != 0 ? 1.0 : -1.0, sy = (c & 2) != 0 ? 1.0 : -1.0;
            if (nx * sx < 0.0 || ny * sy < 0.0) {
                nx = -nx;
                ny = -ny;
            }
            if (nx * sx < 0.0 || ny * sy < 0.0 || (nx == 0.0 && ny == 0.0)) {
                continue;
            }
            double bx = nx > 0.0 ? b->min[i] : b->max[i], by = ny > 0.0 ? b->min[j] : b->max[j];
            if (nx * (bx - x0) + ny * (by - y0) > 0.0) {
                return true;
            }
        }
    }
    return false;
}

/* True if every segment from a to b is blocked. bodies: those that may meet one. Whatever of the 64 segments between
 * corners no body meets will still be there in some part, however small: then it is no use to go on. */
static bool beam_blocked(search *s, const part *a, const part *b, const uint32_t *bodies, uint32_t count)
{
    double from[8][3], to[8][3];
    uint32_t kept[MOST_BODIES], n = 0, most = 0, best = 0;
    uint64_t blocked = 0;
    shaft ends;
    if (s->effort == 0) {
        return false;
    }
    s->effort -= 1;
    corners_of(a, from);
    corners_of(b, to);
    box_of((const double(*)[3])from, ends.min[0], ends.max[0]);
    box_of((const double(*)[3])to, ends.min[1], ends.max[1]);
    for (uint32_t i = 0; i < count; ++i) {
        const umb_solid *body = &s->solids->items[bodies[i]];
        if (beside(&ends, &body->bounds)) {
            continue;
        }
        uint64_t own = umb_solid_blocks(s->solids, body, (const double(*)[3])from, (const double(*)[3])to);
        if (own == UINT64_MAX) {
            return true;
        }
        uint32_t weight = (uint32_t)__builtin_popcountll(own);
        best = weight > most ? n : best;
        most = weight > most ? weight : most;
        blocked |= own;
        kept[n++] = bodies[i];
    }
    if (blocked != UINT64_MAX) {
        return false;
    }
    uint32_t first = kept[0]; /* what blocks most is asked first */
    kept[0] = kept[best];
    kept[best] = first;
    double la, lb;
    int axis_a = longest_axis(a, &la), axis_b = longest_axis(b, &lb);
    double least = LEAST_PART * s->solids->reach;
    if (!(fmax(la, lb) > least * least)) {
        return false;
    }
    for (int side = -1; side <= 1; side += 2) {
        part half = la > lb ? half_of(a, axis_a, side) : half_of(b, axis_b, side);
        if (!beam_blocked(s, la > lb ? &half : a, la > lb ? b : &half, kept, n)) {
            return false;
        }
    }
    return true;
}

/* ---- objects ---------------------------------------------------------------------------------- */

static part part_of_box(const double min[3], const double max[3], double more)
{
    part p = {{0.0}, {{0.0}}};
    for (int k = 0; k < 3; ++k) {
        p.middle[k] = 0.5 * (min[k] + max[k]);
        p.axes[k][k] = fmax(max[k] - p.middle[k], p.middle[k] - min[k]) + more;
    }
    return p;
}

/* The shape's box where it stands, if its axes stay at right angles; rounding of world vertices moves them by less than
 * `more` along each. Else the object's bounds. */
static part part_of_object(const umb_object *o, double reach)
{
    double more = 0x1p-22 * reach;
    double min[3], max[3];
    for (int k = 0; k < 3; ++k) {
        min[k] = o->bounds.min[k];
        max[k] = o->bounds.max[k];
    }
    part p = part_of_box(min, max, PART_MARGIN * reach);
    if (!o->refine || o->identity) {
        return p;
    }
    part turned = {{0.0}, {{0.0}}};
    double lengths[3];
    for (int a = 0; a < 3; ++a) {
        double half = 0.5 * ((double)o->mesh->bounds.max[a] - o->mesh->bounds.min[a]);
        double centre = 0.5 * ((double)o->mesh->bounds.max[a] + o->mesh->bounds.min[a]);
        for (int k = 0; k < 3; ++k) {
            turned.axes[a][k] = o->transform.m[k][a] * half;
            turned.middle[k] += o->transform.m[k][a] * centre + (a == 0 ? o->transform.m[k][3] : 0.0);
        }
        lengths[a] = sqrt(length_squared(turned.axes[a]));
    }
    for (int a = 0; a < 3; ++a) {
        const double *u = turned.axes[a], *v = turned.axes[(a + 1) % 3];
        double dot = u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
        if (!(lengths[a] > 8.0 * more) || !(fabs(dot) <= 1e-3 * lengths[a] * lengths[(a + 1) % 3])) {
            return p;
        }
    }
    for (int a = 0; a < 3; ++a) {
        for (int k = 0; k < 3; ++k) {
            turned.axes[a][k] *= 1.0 + 2.0 * more / lengths[a];
        }
    }
    return turned;
}

typedef struct refinement {
    umb_region *region;
    const umb_object *objects;
    part cell;
    double cell_min[3], cell_max[3];
    uint32_t effort;
    uint8_t *states; /* per object of the set: what came out */
} refinement;

enum { STAYS = 0, HIDDEN = 1, UNDECIDED = 2 };

static uint8_t decide(const refinement *f, const umb_object *o)
{
    const umb_solids *solids = &f->region->solids;
    part target = part_of_object(o, f->region->reach);
    uint32_t bodies[MOST_BODIES], count = 0;
    double to[8][3];
    shaft ends;
    corners_of(&target, to);
    box_of((const double(*)[3])to, ends.min[1], ends.max[1]);
    memcpy(ends.min[0], f->cell_min, sizeof ends.min[0]);
    memcpy(ends.max[0], f->cell_max, sizeof ends.max[0]);
    for (size_t i = 0; i < solids->count && count < MOST_BODIES; ++i) {
        if (!beside(&ends, &solids->items[i].bounds)) {
            bodies[count++] = (uint32_t)i;
        }
    }
    search s = {solids, f->effort};
    if (beam_blocked(&s, &f->cell, &target, bodies, count)) {
        return HIDDEN;
    }
    return s.effort == 0 ? UNDECIDED : STAYS;
}

static void decide_chunk(void *data, uint32_t chunk)
{
    const refinement *f = data;
    const umb_region_answer *a = &f->region->answer;
    for (uint32_t i = chunk * CHUNK; i < a->pvs_count && i < (chunk + 1) * CHUNK; ++i) {
        f->states[i] = decide(f, &f->objects[a->pvs[i]]);
    }
}

static umb_result find_bodies(umb_region *r)
{
    const umb_committed *c = umb_scene_committed(umb_index_scene(r->index));
    const double(*corners)[3] = (const double(*)[3])r->corners;
    umb_result result = UMB_OK;
    r->solids.count = r->solids.plane_count = 0;
    for (size_t i = 0; i < r->used_count && result == UMB_OK; ++i) {
        const umb_occluder *o = &c->occluders[r->used[i]];
        bool added;
        result = umb_solids_add(&r->solids, o, r->used[i], corners, &added);
        if (result == UMB_OK && !added && r->known[r->used[i]] == UMB_SOLID_YES) {
            result = umb_solids_add_inner(&r->solids, o, r->used[i], corners);
        }
    }
    return result;
}

umb_result umb_region_decide(umb_region *r, uint32_t effort)
{
    umb_region_answer *a = &r->answer;
    refinement f = {.region = r, .effort = effort != 0 ? effort : DEFAULT_EFFORT};
    f.objects = umb_scene_committed(umb_index_scene(r->index))->objects;
    f.states = umb_memory_allocate_zero(&r->allocator, (size_t)a->pvs_count + 1, sizeof *f.states);
    if (f.states == NULL || find_bodies(r) != UMB_OK) {
        umb_memory_free(&r->allocator, f.states, (size_t)a->pvs_count + 1);
        return UMB_ERROR_MEMORY;
    }
    f.cell = part_of_box(r->query.min, r->query.max, PART_MARGIN * r->reach);
    for (int k = 0; k < 3; ++k) {
        f.cell_min[k] = f.cell.middle[k] - f.cell.axes[k][k];
        f.cell_max[k] = f.cell.middle[k] + f.cell.axes[k][k];
    }
    umb_tasks_run(&r->tasks, decide_chunk, &f, (a->pvs_count + CHUNK - 1) / CHUNK);
    a->refined_count = a->stats.undecided = 0;
    for (uint32_t i = 0; i < a->pvs_count; ++i) {
        if (f.states[i] != HIDDEN) {
            r->refined[a->refined_count++] = a->pvs[i];
        }
        a->stats.undecided += f.states[i] == UNDECIDED ? 1 : 0;
    }
    umb_memory_free(&r->allocator, f.states, (size_t)a->pvs_count + 1);
    return UMB_OK;
}

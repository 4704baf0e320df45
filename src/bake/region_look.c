/* After the walk: bodies of the occluders that it used, and each object that the maps left held against them one by one
 * (docs/conservative.md, T5, without cutting). A map's pixel is a beam that widens with the distance; a body's corners are exact
 * however far away it is. One segment is asked first, to the object's highest point from the top of the cell, since most of
 * what can be seen shows above what stands before it:
 *
 *            cell                body A        body B      object
 *        .---------.              ___                       ___
 *        |         |- - - - - - -|   |- - - - - - - - - - -|   |
 *        '---------'             |   |     ___             |   |
 *
 * Bodies that it meets are the only ones that may hide all of the object; if there are none it can be seen, as far as bodies tell. */
#include <math.h>
#include <string.h>

#include "geometry/transform.h"
#include "region_state.h"

#define CHUNK 64
#define MOST_VERTICES 64  /* of an object whose highest one is looked for */
#define MOST_BODIES 256   /* along a segment */
#define MOST_PLANES 2000000 /* that are kept from one cell to the next */

/* Bodies are found once for each version of the scene; those that this cell may use are copied, in the order of the walk. */
umb_result umb_region_find_bodies(umb_region *r)
{
    const umb_committed *c = umb_scene_committed(umb_index_scene(r->index));
    const double(*corners)[3] = (const double(*)[3])r->corners;
    umb_solids *found = &r->found, *own = &r->solids;
    bool stale = found->runs == NULL || r->found_version != c->version || found->reach != r->reach || found->plane_count > MOST_PLANES;
    if (stale && !umb_solids_begin(found, c->occluder_count, r->reach)) {
        return UMB_ERROR_MEMORY;
    }
    r->found_version = c->version;
    own->count = 0;
    for (size_t i = 0; i < r->used_count; ++i) {
        const umb_occluder *o = &c->occluders[r->used[i]];
        if (umb_solids_find(found, o, r->used[i]) != UMB_OK) {
            return UMB_ERROR_MEMORY;
        }
        struct umb_solid_run run = found->runs[r->used[i]];
        if (run.count == 0 || !umb_solids_apart(found, o, r->used[i], corners)) {
            continue;
        }
        if (!umb_memory_reserve(&r->allocator, (void **)&own->items, &own->capacity, own->count + run.count, sizeof *own->items)) {
            return UMB_ERROR_MEMORY;
        }
        memcpy(own->items + own->count, found->items + run.first, run.count * sizeof *own->items);
        own->count += run.count;
    }
    own->planes = found->planes; /* which stay where they are until the next cell */
    own->reach = r->reach;
    return umb_solid_tree_build(&r->solid_tree, &r->allocator, own) ? UMB_OK : UMB_ERROR_MEMORY;
}

/* The shape's box where it stands, if its axes stay at right angles; rounding of world vertices moves them by less than
 * `more` along each. Else the object's bounds. */
umb_beam_part umb_region_target(const umb_object *o, double reach)
{
    double more = 0x1p-22 * reach;
    double min[3], max[3];
    for (int k = 0; k < 3; ++k) {
        min[k] = o->bounds.min[k];
        max[k] = o->bounds.max[k];
    }
    umb_beam_part p = umb_beam_box(min, max, UMB_BEAM_MARGIN * reach);
    if (!o->refine || o->identity) {
        return p;
    }
    umb_beam_part turned = {.triangle = false};
    double lengths[3];
    for (int a = 0; a < 3; ++a) {
        double half = 0.5 * ((double)o->mesh->bounds.max[a] - o->mesh->bounds.min[a]);
        double centre = 0.5 * ((double)o->mesh->bounds.max[a] + o->mesh->bounds.min[a]);
        for (int k = 0; k < 3; ++k) {
            turned.axes[a][k] = o->transform.m[k][a] * half;
            turned.middle[k] += o->transform.m[k][a] * centre + (a == 0 ? o->transform.m[k][3] : 0.0);
        }
        lengths[a] = umb_vec3_length(umb_vec3_from_double(turned.axes[a]));
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

typedef struct looking {
    umb_region *region;
    const umb_object *objects;
    const double (*cell)[3]; /* its corners */
    uint32_t up;
} looking;

/* The highest vertex of the object's triangles, which use all positions. False: it has none that are its own, or very many. */
static bool highest_point(const umb_object *o, uint32_t up, double out[3])
{
    const umb_mesh *m = o->mesh;
    if (!o->refine || m->seen_count == 0 || m->position_count > MOST_VERTICES) {
        return false;
    }
    float highest[3] = {0.0f, 0.0f, 0.0f};
    for (uint32_t i = 0; i < m->position_count; ++i) {
        float w[3];
        umb_transform_vertex(&o->transform, o->identity, m->positions[i], w);
        if (i == 0 || w[up] > highest[up]) {
            memcpy(highest, w, sizeof w);
        }
    }
    for (int k = 0; k < 3; ++k) {
        out[k] = highest[k];
    }
    return true;
}

/* The highest corner; of several the farthest from a point. */
static void highest_corner(const double (*corners)[3], uint32_t up, const double from[3], double out[3])
{
    int best = 0;
    double most = -INFINITY;
    for (int c = 0; c < 8; ++c) {
        double away = 0.0;
        for (uint32_t k = 0; k < 3; ++k) {
            away += k != up ? fabs(corners[c][k] - from[k]) : 0.0;
        }
        bool higher = corners[c][up] > corners[best][up];
        if (higher || (corners[c][up] == corners[best][up] && away > most)) {
            best = c;
            most = away;
        }
    }
    memcpy(out, corners[best], 3 * sizeof *out);
}

/* Most bodies that meet the first segment are found out by one of four others. */
static bool hides(const umb_solids *s, const umb_solid *body, const double (*a)[3], const double (*b)[3])
{
    return umb_solid_meets(s, body, a[0], b[7]) && umb_solid_meets(s, body, a[7], b[0]) && umb_solid_meets(s, body, a[1], b[1]) &&
           umb_solid_meets(s, body, a[4], b[4]) && umb_solid_blocks_all(s, body, a, b);
}

/* *last: a body that hid another object: what it is beside is mostly hidden by the same one. */
static uint8_t look_at(const looking *l, const umb_object *o, uint32_t *last)
{
    const umb_region *r = l->region;
    umb_beam_part target = umb_region_target(o, r->reach);
    double corners[8][3], first[2][3], second[2][3];
    uint32_t bodies[MOST_BODIES];
    umb_beam_corners(&target, corners);
    const double(*to)[3] = (const double(*)[3])corners;
    if (*last != UMB_NONE && hides(&r->solids, &r->solids.items[*last], l->cell, to)) {
        return UMB_HIDDEN;
    }
    bool own = highest_point(o, l->up, first[1]);
    if (!own) {
        highest_corner(to, l->up, l->cell[0], first[1]);
    }
    highest_corner(l->cell, l->up, first[1], first[0]);
    memcpy(second[0], l->cell[7], sizeof second[0]);
    memcpy(second[1], corners[0], sizeof second[1]);
    umb_solids_along n = umb_solid_tree_along(&r->solid_tree, (const double(*)[3])first, (const double(*)[3])second, MOST_BODIES, bodies);
    bool met = n.both_end == n.first_begin;
    for (uint32_t i = 0; i < n.both_end; ++i) {
        const umb_solid *body = &r->solids.items[bodies[i]];
        bool meets = umb_solid_meets(&r->solids, body, first[0], first[1]);
        met = met || meets;
        if (meets && hides(&r->solids, body, l->cell, to)) {
            *last = bodies[i];
            return UMB_HIDDEN;
        }
    }
    for (uint32_t i = n.first_begin; i < MOST_BODIES && own && !met; ++i) {
        met = umb_solid_meets(&r->solids, &r->solids.items[bodies[i]], first[0], first[1]);
    }
    return met || !own ? UMB_LEFT : UMB_STAYS;
}

static void look_at_chunk(void *data, uint32_t chunk)
{
    const looking *l = data;
    const umb_region *r = l->region;
    uint32_t last = UMB_NONE;
    for (uint32_t i = chunk * CHUNK; i < r->answer.pvs_count && i < (chunk + 1) * CHUNK; ++i) {
        r->verdicts[i] = look_at(l, &l->objects[r->pvs[i]], &last);
    }
}

umb_result umb_region_look(umb_region *r)
{
    umb_region_answer *a = &r->answer;
    looking l = {.region = r, .objects = umb_scene_committed(umb_index_scene(r->index))->objects, .up = r->frames[0].axis_z};
    if (umb_region_find_bodies(r) != UMB_OK) {
        return UMB_ERROR_MEMORY;
    }
    double corners[8][3];
    umb_beam_part cell = umb_beam_box(r->query.min, r->query.max, UMB_BEAM_MARGIN * r->reach);
    umb_beam_corners(&cell, corners);
    l.cell = (const double(*)[3])corners;
    umb_tasks_run(&r->tasks, look_at_chunk, &l, (a->pvs_count + CHUNK - 1) / CHUNK);
    uint32_t kept = 0;
    for (uint32_t i = 0; i < a->pvs_count; ++i) {
        if (r->verdicts[i] != UMB_HIDDEN) {
            r->verdicts[kept] = r->verdicts[i];
            r->pvs[kept++] = r->pvs[i];
        }
    }
    a->pvs_count = kept;
    return UMB_OK;
}

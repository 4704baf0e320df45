/* Refinement: what the maps left is asked about once more, in all directions alike (docs/conservative.md, T5): the box of each
 * object first, then, where that shows something, its triangles. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "beam.h"
#include "geometry/transform.h"
#include "region_state.h"
#include "solid_inner.h"

#define DEFAULT_EFFORT 512
#define CHUNK 16
#define MOST_TRIANGLES 64 /* of an object that is asked about triangle by triangle */

/* ---- objects ---------------------------------------------------------------------------------- */

/* The shape's box where it stands, if its axes stay at right angles; rounding of world vertices moves them by less than
 * `more` along each. Else the object's bounds. */
static umb_beam_part part_of_object(const umb_object *o, double reach)
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

typedef struct refinement {
    umb_region *region;
    const umb_object *objects;
    umb_beam_part cell;
    double cell_min[3], cell_max[3];
    uint32_t effort;
    uint8_t *states; /* per object of the set: what came out */
} refinement;

enum { STAYS = 0, HIDDEN = 1, UNDECIDED = 2 };

static uint8_t decide_part(const refinement *f, const umb_beam_part *target, uint32_t *effort)
{
    const umb_solids *solids = &f->region->solids;
    uint32_t bodies[UMB_BEAM_BODIES];
    double min[2][3], max[2][3];
    umb_shaft shaft;
    memcpy(min[0], f->cell_min, sizeof min[0]);
    memcpy(max[0], f->cell_max, sizeof max[0]);
    umb_beam_bounds(target, min[1], max[1]);
    umb_shaft_make(&shaft, (const double(*)[3])min, (const double(*)[3])max);
    uint32_t count = umb_solid_tree_find(&f->region->solid_tree, solids, &shaft, UMB_BEAM_BODIES, bodies);
    umb_beam_search s = {solids, *effort};
    bool hidden = umb_beam_blocked(&s, &f->cell, target, bodies, count);
    *effort = s.effort;
    return hidden ? HIDDEN : s.effort == 0 ? UNDECIDED : STAYS;
}

/* All of its triangles, as the scene shows them. */
static uint8_t decide_triangles(const refinement *f, const umb_object *o)
{
    const umb_mesh *m = o->mesh;
    uint32_t effort = f->effort + m->seen_count;
    for (uint32_t t = 0; t < m->seen_count; ++t) {
        double p[3][3];
        for (int c = 0; c < 3; ++c) {
            float w[3];
            const float *v = m->positions[m->triangles[t][c]];
            memcpy(w, v, sizeof w);
            if (!o->identity) {
                umb_transform_point(&o->transform, v, w);
            }
            for (int k = 0; k < 3; ++k) {
                p[c][k] = w[k];
            }
        }
        umb_beam_part target = umb_beam_triangle((const double(*)[3])p);
        uint8_t state = decide_part(f, &target, &effort);
        if (state != HIDDEN) {
            return state;
        }
    }
    return HIDDEN;
}

static uint8_t decide(const refinement *f, const umb_object *o)
{
    umb_beam_part target = part_of_object(o, f->region->reach);
    uint32_t effort = f->effort;
    uint8_t state = decide_part(f, &target, &effort);
    bool by_triangles = o->refine && o->mesh->seen_count <= MOST_TRIANGLES && (state == UNDECIDED || !o->mesh->box);
    return state != HIDDEN && by_triangles ? decide_triangles(f, o) : state;
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
        if (result == UMB_OK && !added) {
            result = umb_solids_add_inner(&r->solids, o, r->used[i], corners);
        }
    }
    if (result == UMB_OK && !umb_solid_tree_build(&r->solid_tree, &r->allocator, &r->solids)) {
        result = UMB_ERROR_MEMORY;
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
    f.cell = umb_beam_box(r->query.min, r->query.max, UMB_BEAM_MARGIN * r->reach);
    umb_beam_bounds(&f.cell, f.cell_min, f.cell_max);
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

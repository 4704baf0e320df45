/* Refinement: what the maps left is asked about once more, in all directions alike (docs/conservative.md, T5): the box of each
 * object first, then, where that shows something, its triangles. */
#include <stdlib.h>
#include <string.h>

#include "beam.h"
#include "geometry/transform.h"
#include "region_state.h"

#define CHUNK 16
#define MOST_TRIANGLES 64 /* of an object that is asked about triangle by triangle */

typedef struct refinement {
    umb_region *region;
    const umb_object *objects;
    umb_beam_part cell;
    double cell_min[3], cell_max[3];
    uint32_t effort;
} refinement;

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
    umb_beam_search s = {solids, *effort, false};
    bool hidden = umb_beam_blocked(&s, &f->cell, target, bodies, count);
    *effort = s.effort;
    return hidden ? UMB_HIDDEN : s.open ? UMB_STAYS : UMB_UNDECIDED;
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
            umb_transform_vertex(&o->transform, o->identity, m->positions[m->triangles[t][c]], w);
            for (int k = 0; k < 3; ++k) {
                p[c][k] = w[k];
            }
        }
        umb_beam_part target = umb_beam_triangle((const double(*)[3])p);
        uint8_t state = decide_part(f, &target, &effort);
        if (state != UMB_HIDDEN) {
            return state;
        }
    }
    return UMB_HIDDEN;
}

static uint8_t decide(const refinement *f, const umb_object *o)
{
    umb_beam_part target = umb_region_target(o, f->region->reach);
    uint32_t effort = f->effort;
    uint8_t state = decide_part(f, &target, &effort);
    bool by_triangles = o->refine && o->mesh->seen_count <= MOST_TRIANGLES && (state == UMB_UNDECIDED || !o->mesh->box);
    return state != UMB_HIDDEN && by_triangles ? decide_triangles(f, o) : state;
}

static void decide_chunk(void *data, uint32_t chunk)
{
    const refinement *f = data;
    umb_region *r = f->region;
    for (uint32_t i = chunk * CHUNK; i < r->answer.pvs_count && i < (chunk + 1) * CHUNK; ++i) {
        if (r->verdicts[i] == UMB_LEFT || r->verdicts[i] == UMB_UNDECIDED) {
            r->verdicts[i] = decide(f, &f->objects[r->pvs[i]]);
        }
    }
}

void umb_region_decide(umb_region *r, uint32_t effort)
{
    refinement f = {.region = r, .effort = effort};
    f.objects = umb_scene_committed(umb_index_scene(r->index))->objects;
    f.cell = umb_beam_box(r->query.min, r->query.max, UMB_BEAM_MARGIN * r->reach);
    umb_beam_bounds(&f.cell, f.cell_min, f.cell_max);
    umb_tasks_run(&r->tasks, decide_chunk, &f, (r->answer.pvs_count + CHUNK - 1) / CHUNK);
}

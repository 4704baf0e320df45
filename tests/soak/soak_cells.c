/* View cells of the long run: each is answered by the region engine and held against rays from it.
 *
 * A cell comes from the scene and a number alone, by turns: where one would walk, in what is solid, across
 * surfaces, flat ones and lines, points, large ones, at the border of the scene and beyond, with faces in the
 * planes that indices split at, with corners on vertices. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "soak.h"
#include "support/micro_scenes.h"
#include "truth/region_truth.h"
#include "umbrage/region.h"

#define CORNER_COSINE 0.2588190451025207 /* of 75 degrees: umb_region_query.near_depth */

/* Small sets are refined with the library's effort; of others some cells with little: else nearly all of the time would go
 * there. */
enum { SMALL_SET = 2000, LARGE_SET = 20000, QUICK_EFFORT = 32 };

enum { WALKED, INSIDE, ACROSS, FLAT, LARGE, BORDER, PLANES, VERTEX, POINT };
static const char *const kind_names[SOAK_KINDS] = {"walked", "inside",    "across",      "flat", "large",
                                                   "border", "on planes", "at a vertex", "a point"};

const char *soak_cell_kind(uint64_t number)
{
    return kind_names[number % SOAK_KINDS];
}

/* Something of the scene to make a cell from. */
typedef struct place {
    umb_aabb box;        /* of an object */
    float corners[3][3]; /* of a triangle of it */
    double size;         /* of the scene */
} place;

static bool pick(const model *m, soak_dice *dice, place *out)
{
    double sum = 0.0;
    for (int i = 0; i < 3; ++i) {
        double side = (double)m->bounds.max[i] - m->bounds.min[i];
        sum += side * side;
    }
    out->size = sqrt(sum);
    for (int tries = 0; tries < 1000 && m->object_count != 0; ++tries) {
        const model_object *o = &m->objects[soak_below(dice, m->object_count)];
        if (o->mesh == MODEL_NONE || m->meshes[o->mesh].triangle_count == 0) {
            continue;
        }
        const model_mesh *mesh = &m->meshes[o->mesh];
        uint32_t triangle = soak_below(dice, mesh->triangle_count);
        for (uint32_t i = 0; i < 3; ++i) {
            model_world_vertex(m, o, mesh->indices[3 * (size_t)triangle + i], out->corners[i]);
        }
        out->box = o->bounds;
        return true;
    }
    return false;
}

static double magnitude(soak_dice *dice, double low, double high)
{
    return exp(soak_between(dice, log(low), log(high)));
}

static void around(const double at[3], const double half[3], umb_region_query *q)
{
    for (int i = 0; i < 3; ++i) {
        q->min[i] = at[i] - half[i];
        q->max[i] = at[i] + half[i];
    }
}

static int up_axis(const model *m)
{
    return fabs(m->up[2]) > 0.5 ? 2 : fabs(m->up[1]) > 0.5 ? 1 : 0;
}

/* Each kind takes an eye's place `at` and half sizes of a walk's cell, and changes what it needs. */
static void shape_cell(const model *m, const place *p, uint64_t number, soak_dice *dice,
                       double at[3], double half[3])
{
    double share = magnitude(dice, 1e-3, 1.0);
    switch (number % SOAK_KINDS) {
    case INSIDE:
        for (int i = 0; i < 3; ++i) {
            at[i] = 0.5 * ((double)p->box.min[i] + p->box.max[i]);
            half[i] = share * 0.49 * ((double)p->box.max[i] - p->box.min[i]);
        }
        break;
    case ACROSS:
        for (int i = 0; i < 3; ++i) {
            at[i] = ((double)p->corners[0][i] + p->corners[1][i] + p->corners[2][i]) / 3.0;
        }
        break;
    case FLAT:
        half[soak_below(dice, 3)] = 0.0;
        half[soak_below(dice, 3)] *= soak_below(dice, 2);
        break;
    case POINT:
        half[0] = half[1] = half[2] = 0.0;
        break;
    case LARGE:
        for (int i = 0; i < 3; ++i) {
            double side = (double)m->bounds.max[i] - m->bounds.min[i];
            half[i] = side * soak_between(dice, 0.05, 0.5);
        }
        break;
    case BORDER: {
        uint32_t axis = soak_below(dice, 3);
        at[axis] = soak_below(dice, 2) ? m->bounds.max[axis] : m->bounds.min[axis];
        at[axis] += (double)(soak_below(dice, 5)) * soak_between(dice, -1.0, 1.0) * half[axis];
        break;
    }
    case VERTEX:
        for (int i = 0; i < 3; ++i) {
            at[i] = p->corners[0][i] + (soak_below(dice, 2) ? half[i] : -half[i]);
        }
        break;
    default:
        break;
    }
}

/* Faces exactly in the planes of an object's box, beside it or at one of its sides. */
static void snap_to_planes(const place *p, soak_dice *dice, umb_region_query *q)
{
    for (int i = 0; i < 3; ++i) {
        double size = q->max[i] - q->min[i];
        switch (soak_below(dice, 3)) {
        case 0:
            q->min[i] = p->box.max[i];
            q->max[i] = p->box.max[i] + size;
            break;
        case 1:
            q->max[i] = p->box.min[i];
            q->min[i] = p->box.min[i] - size;
            break;
        default:
            q->min[i] = p->box.min[i];
            q->max[i] = p->box.max[i];
        }
    }
}

/* Of every setting of the method a share. */
static void choose_settings(const model *m, soak_dice *dice, umb_region_query *q)
{
    static const umb_region_up ups[3] = {UMB_UP_X, UMB_UP_Y, UMB_UP_Z};
    static const uint32_t resolutions[6] = {64, 64, 128, 128, 256, 512};
    static const double outers[6] = {0.0, 0.0, 0.0, 2.0, 8.0, 1.05};
    q->up = ups[soak_below(dice, 6) ? (uint32_t)up_axis(m) : soak_below(dice, 3)];
    q->resolution = resolutions[soak_below(dice, 6)];
    q->umbrae = soak_below(dice, 2) ? 0 : 1 + soak_below(dice, 8);
    q->outer = outers[soak_below(dice, 6)];
    q->half_umbra = soak_below(dice, 4) == 0;
    if (q->outer == 0.0 && !q->half_umbra && soak_below(dice, 2) == 0) {
        q->up = UMB_UP_NONE;
    }
}

bool soak_cell(const model *m, const camera_path *path, uint64_t number, umb_region_query *out)
{
    soak_dice dice = {number * 0x9E3779B97F4A7C15u + 0xce11};
    place p;
    double at[3], half[3];
    if (!pick(m, &dice, &p)) {
        return false;
    }
    *out = (umb_region_query){0};
    double width = p.size * magnitude(&dice, 1e-4, 0.05);
    int up = up_axis(m);
    for (int i = 0; i < 3; ++i) {
        at[i] = soak_between(&dice, m->bounds.min[i], m->bounds.max[i]);
        half[i] = 0.5 * width *
                  (i == up ? soak_between(&dice, 0.05, 0.5) : soak_between(&dice, 0.3, 1.0));
    }
    if (path->count != 0 && soak_below(&dice, 8) != 0) {
        memcpy(at, path->rows[soak_below(&dice, path->count)], sizeof at);
    }
    shape_cell(m, &p, number, &dice, at, half);
    around(at, half, out);
    if (number % SOAK_KINDS == PLANES) {
        snap_to_planes(&p, &dice, out);
    }
    choose_settings(m, &dice, out);
    if (soak_below(&dice, 5) == 0) {
        out->near_depth = p.size * magnitude(&dice, 1e-5, 0.01);
    }
    return true;
}

/* ---- one answer ----------------------------------------------------------------------------- */

static void tell(const soak_judge *j, const char *what, uint64_t number, const region_witness *w)
{
    char name[1300];
    (void)snprintf(name, sizeof name, "%.1000s/%s.txt", j->folder, what);
    FILE *files[2] = {strcmp(what, "wrongly-hidden") == 0 ? stderr : NULL, fopen(name, "a")};
    for (int k = 0; k < 2; ++k) {
        if (files[k] != NULL) {
            (void)fprintf(files[k],
                          "%s: part %s cell %" PRIu64 " (%s) object %u triangle %u, from "
                          "%.17g,%.17g,%.17g at %.17g,%.17g,%.17g\n",
                          what, j->part->name, number, soak_cell_kind(number), w->object,
                          w->triangle, w->from[0], w->from[1], w->from[2], w->to[0], w->to[1],
                          w->to[2]);
        }
    }
    if (files[1] != NULL) {
        (void)fclose(files[1]);
    }
}

/* Ids of the model's objects; planted scenes have others after them. */
static uint32_t mark(const uint32_t *ids, uint32_t count, uint32_t objects, uint8_t *set)
{
    uint32_t kept = 0;
    memset(set, 0, objects);
    for (uint32_t k = 0; k < count; ++k) {
        if (ids[k] < objects) {
            set[ids[k]] = 1;
            ++kept;
        }
    }
    return kept;
}

static void count_objects(const soak_judge *j, const region_result *r, const uint8_t *accused,
                          uint64_t number, soak_count *sum)
{
    const model *m = j->model;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        bool counts = m->objects[i].mesh != MODEL_NONE && m->meshes[m->objects[i].mesh].triangle_count != 0;
        sum->pairs += counts;
        sum->kinds[number % SOAK_KINDS].hidden += counts && accused[i];
        if (accused[i] && r->witness_of[i] != MODEL_NONE) {
            const region_witness *w = &r->witnesses[r->witness_of[i]];
            tell(j, w->confirmed ? "wrongly-hidden" : "unconfirmed", number, w);
        }
    }
    sum->wrong += r->wrong;
    sum->unconfirmed += r->unconfirmed;
    sum->seen += r->seen_objects;
    sum->rays += r->rays;
    soak_kind *kind = &sum->kinds[number % SOAK_KINDS];
    kind->cells += 1;
    kind->rays += r->rays;
    kind->wrong += r->wrong;
}

static bool judge(const soak_judge *j, const umb_region_query *q, const umb_region_answer *a,
                  uint64_t number, soak_count *sum, umb_error *error)
{
    uint32_t objects = j->model->object_count;
    uint8_t *accused = malloc((size_t)objects + 1), *doubtful = malloc((size_t)objects + 1);
    region_result r;
    region_cell cell = {.near_distance = q->near_depth / CORNER_COSINE * (1.0 - 1e-9)};
    memcpy(cell.min, q->min, sizeof cell.min);
    memcpy(cell.max, q->max, sizeof cell.max);
    bool ok = accused != NULL && doubtful != NULL;
    if (ok) {
        sum->proven += mark(a->pvs, a->pvs_count, objects, accused);
        sum->open += a->stats.undecided;
        sum->reported += mark(a->refined, a->refined_count, objects, doubtful);
        for (uint32_t i = 0; i < objects; ++i) {
            accused[i] = !doubtful[i];
        }
        region_options options = {.rays = j->part->rays / 4,
                                  .volleys = j->part->rays - j->part->rays / 4,
                                  .seed = number,
                                  .exhaust = true,
                                  .accused = accused,
                                  .doubtful = doubtful};
        ok = region_search(j->oracle, &cell, &options, &r, error);
    } else {
        (void)snprintf(error->text, sizeof error->text, "not enough memory");
    }
    if (ok) {
        count_objects(j, &r, accused, number, sum);
        sum->views += 1;
        if (j->print) {
            printf("cell %" PRIu64 " (%s): pvs %u, refined %u, seen %u, wrong %u, unconfirmed %u, "
                   "withdrawn %u, rays %" PRIu64 "\n",
                   number, soak_cell_kind(number), a->pvs_count, a->refined_count, r.seen_objects,
                   r.wrong, r.unconfirmed, r.withdrawn, r.rays);
        }
        region_result_free(&r);
    }
    free(accused);
    free(doubtful);
    return ok;
}

/* Kinds take turns of nine: a fourth and a sixteenth of the cells are of all kinds. */
static bool is_refined(uint32_t pvs_count, uint64_t number)
{
    return pvs_count <= SMALL_SET || number % (pvs_count <= LARGE_SET ? 4 : 16) == 0;
}

bool soak_judge_cell(const soak_judge *j, umb_region *region, const camera_path *path,
                     uint64_t number, soak_count *sum, umb_error *error)
{
    umb_region_query q;
    umb_region_answer a;
    if (!soak_cell(j->model, path, number, &q)) {
        (void)snprintf(error->text, sizeof error->text, "no cell can be made");
        return false;
    }
    umb_result result = umb_region_solve(region, &q, &a);
    if (result == UMB_OK && is_refined(a.pvs_count, number)) {
        result = umb_region_refine(region, a.pvs_count <= SMALL_SET ? 0 : QUICK_EFFORT, &a);
    } else {
        a.refined = a.pvs;
        a.refined_count = a.pvs_count;
    }
    if (result != UMB_OK) {
        (void)snprintf(error->text, sizeof error->text, "the engine refused cell %" PRIu64, number);
        return false;
    }
    return judge(j, &q, &a, number, sum, error);
}

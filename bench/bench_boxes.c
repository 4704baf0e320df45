/* What a box costs: the strict frustum test and the projection of eight boxes at once, for each
 * instruction set, beside the yardstick (yardstick.h), all on one set of boxes that fits no cache
 * level but the last, and on one that fits the first.
 *
 *     bench_boxes [boxes]
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "frustum/box_kernels.h"
#include "occlusion/raster_map.h"
#include "yardstick.h"

static uint64_t random_state = 88172645463325252u;

static double random_in(double low, double high)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return low + (high - low) * ((double)(random_state >> 11) * 0x1p-53);
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

typedef struct boxes {
    umb_node *nodes;
    float *soa[6];
    uint8_t *mask;
    uint32_t count; /* a multiple of eight */
} boxes;

static bool make_boxes(boxes *b, uint32_t count)
{
    b->count = count;
    b->nodes = calloc(count / 8, sizeof(b->nodes[0]));
    b->mask = malloc(count / 8);
    bool made = b->nodes != NULL && b->mask != NULL;
    for (int k = 0; k < 6; ++k) {
        b->soa[k] = malloc(count * sizeof(float));
        made = made && b->soa[k] != NULL;
    }
    for (uint32_t i = 0; made && i < count; ++i) {
        b->nodes[i / 8].count = 8;
        for (int axis = 0; axis < 3; ++axis) {
            double at = random_in(-1000.0, 1000.0);
            float low = (float)at;
            float high = (float)(at + random_in(0.0, 10.0));
            b->soa[axis][i] = b->nodes[i / 8].min[axis][i % 8] = low;
            b->soa[axis + 3][i] = b->nodes[i / 8].max[axis][i % 8] = high;
        }
    }
    return made;
}

static void free_boxes(boxes *b)
{
    free(b->nodes);
    free(b->mask);
    for (int k = 0; k < 6; ++k) {
        free(b->soa[k]);
    }
}

enum { UPRIGHT, TURNED, PARALLEL, FORMS };

typedef struct job {
    boxes *boxes;
    umb_view view;
    umb_frustum frustum;
    umb_projector projectors[FORMS];
    int form;
    const umb_box_kernels *kernels;
    float planes[6][4];
    uint64_t sum; /* of answers, so that no work can be left out */
} job;

static void run_yardstick(job *j)
{
    yardstick_frustum_pass((const float **)j->boxes->soa, j->boxes->count,
                           (const float(*)[4])j->planes, j->boxes->mask);
    j->sum += j->boxes->mask[0];
}

static void run_cull(job *j)
{
    for (uint32_t i = 0; i < j->boxes->count / 8; ++i) {
        uint16_t left[8];
        uint32_t tests;
        j->sum += j->kernels->cull(&j->frustum, &j->boxes->nodes[i], j->frustum.all_planes, NULL,
                                   left, &tests);
    }
}

static void run_project(job *j)
{
    for (uint32_t i = 0; i < j->boxes->count / 8; ++i) {
        umb_projected out;
        j->kernels->project(&j->boxes->nodes[i], &j->projectors[j->form], &out);
        j->sum += out.testable;
    }
}

/* The best of several rounds, in ns a box. */
static double measure(job *j, void (*run)(job *))
{
    double best = 1e30;
    uint32_t repeats = 1 + 400000 / j->boxes->count;
    for (int round = 0; round < 7; ++round) {
        double start = now();
        for (uint32_t r = 0; r < repeats; ++r) {
            run(j);
        }
        double t = (now() - start) / ((double)repeats * j->boxes->count);
        best = t < best ? t : best;
    }
    return best * 1e9;
}

/* As a culler lays its raster: upright, turned, parallel. */
static void prepare_projectors(job *j)
{
    for (int form = 0; form < FORMS; ++form) {
        umb_view view = j->view;
        double table[288 + 8], x[3], y[3], w[3];
        umb_raster_map map;
        if (form != UPRIGHT) {
            memset(view.vertical, 0, sizeof(view.vertical));
        }
        view.projection = form == PARALLEL ? UMB_ORTHOGRAPHIC : UMB_PERSPECTIVE;
        umb_raster_map_prepare(&map, &view, NULL, table);
        const umb_vec3 rows[3] = {map.x, map.y, map.w};
        double *out[3] = {x, y, w};
        for (int i = 0; i < 3; ++i) {
            out[i][0] = rows[i].x;
            out[i][1] = rows[i].y;
            out[i][2] = rows[i].z;
        }
        umb_projector_def def = {.eye = view.eye,
                                 .x = x,
                                 .y = y,
                                 .w = w,
                                 .cx = map.cx,
                                 .cy = map.cy,
                                 .slope = map.rows.slope,
                                 .extra = map.rows.extra,
                                 .from = map.rows.from,
                                 .span = map.rows.span,
                                 .slack = map.rows.slack,
                                 .width = map.width,
                                 .height = map.height,
                                 .vertical = map.vertical_axis,
                                 .orthographic = map.orthographic};
        umb_projector_prepare(&j->projectors[form], &def);
    }
}

static bool set_view(job *j)
{
    double eye[3] = {0, 20, 0}, target[3] = {300, 10, 400}, up[3] = {0, 1, 0};
    if (umb_view_look_at(&j->view, eye, target, up, 1.0, 16.0 / 9.0, 0.1, 3000.0) != UMB_OK) {
        return false;
    }
    double planes[16][4];
    umb_view_planes(&j->view, planes);
    for (int k = 0; k < 6; ++k) {
        for (int i = 0; i < 4; ++i) {
            j->planes[k][i] = (float)planes[k][i];
        }
    }
    umb_frustum_prepare(&j->frustum, &j->view);
    prepare_projectors(j);
    return true;
}

static bool bench(uint32_t count)
{
    static const umb_isa isas[] = {UMB_ISA_SCALAR, UMB_ISA_SSE4, UMB_ISA_AVX2, UMB_ISA_NEON};
    boxes b;
    job j = {.boxes = &b};
    bool good = set_view(&j);
    good = make_boxes(&b, count) && good;
    if (good) {
        double unit = measure(&j, run_yardstick);
        printf("%u boxes, ns a box (passes)\n  %-8s %-18s %-18s\n", count, "", "frustum test",
               "projection");
        printf("  %-8s %6.2f\n", "pass", unit);
        for (int i = 0; i < 4; ++i) {
            j.kernels = umb_box_kernels_get(isas[i]);
            if (j.kernels != NULL) {
                double cull = measure(&j, run_cull);
                double project[FORMS];
                for (j.form = 0; j.form < FORMS; ++j.form) {
                    project[j.form] = measure(&j, run_project);
                }
                printf("  %-8s %6.2f (%4.1f)      upright %6.2f (%4.1f), turned %6.2f, parallel %6.2f\n",
                       umb_isa_name(isas[i]), cull, cull / unit, project[UPRIGHT], project[UPRIGHT] / unit,
                       project[TURNED], project[PARALLEL]);
            }
        }
        fprintf(stderr, "sum of answers %llu\n", (unsigned long long)j.sum);
    }
    free_boxes(&b);
    return good;
}

int main(int argc, char **argv)
{
    long large = argc > 1 ? atol(argv[1]) : 400000;
    if (large < 8 || large > 100000000) {
        fprintf(stderr, "bench_boxes: the number of boxes must lie between 8 and 100000000\n");
        return 2;
    }
    return bench(800) && bench((uint32_t)large & ~7u) ? 0 : 1;
}

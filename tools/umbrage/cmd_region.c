/* umbrage region: what may be seen from a view cell. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "part_file.h"
#include "progress.h"
#include "region_check.h"
#include "region_picture.h"

/* The vertical is one of the axes here. */
static int read_axis(const options *o, const double up[3], umb_region_up *out)
{
    static const umb_region_up axes[3] = {UMB_UP_X, UMB_UP_Y, UMB_UP_Z};
    int found = -1;
    for (int k = 0; k < 3; ++k) {
        if (up[k] != 0.0) {
            found = found == -1 ? k : 3;
        }
    }
    if (found == 3 || found == -1) {
        return fail(o, EXIT_USAGE, "needs a vertical that is an axis: --up x, y or z");
    }
    *out = axes[found];
    return EXIT_DONE;
}

static int make_query(const setup *s, const options *o, umb_region_query *out)
{
    *out = (umb_region_query){.resolution = o->resolution,
                              .umbrae = o->umbrae,
                              .outer = o->outer,
                              .half_umbra = options_given(o, "half-umbra"),
                              .maps_only = options_given(o, "maps-only"),
                              .near_depth = options_given(o, "near") ? o->near_depth : 0.0};
    for (int k = 0; k < 3; ++k) {
        double a = o->cell[k], b = o->cell[3 + k];
        if (a > b) {
            return fail(o, EXIT_USAGE, "--cell: %c1 lies below %c0", "XYZ"[k], "XYZ"[k]);
        }
        /* The origin was taken off rounded coordinates exactly; off these it is rounded, so outwards. */
        double lower = a - s->model->origin[k], upper = b - s->model->origin[k];
        bool exact = lower + s->model->origin[k] == a && upper + s->model->origin[k] == b;
        out->min[k] = exact ? lower : nextafter(lower, -INFINITY);
        out->max[k] = exact ? upper : nextafter(upper, INFINITY);
    }
    if (options_given(o, "all-round")) {
        if (options_given(o, "up") || options_given(o, "outer") || options_given(o, "half-umbra")) {
            return fail(o, EXIT_USAGE, "--all-round: there is no vertical then, so not with --up, --outer or --half-umbra");
        }
        out->up = UMB_UP_NONE;
        return EXIT_DONE;
    }
    return read_axis(o, options_given(o, "up") ? o->up : s->model->up, &out->up);
}

/* An answer with what is told beside it. */
typedef struct report {
    const umb_region_answer *answer;
    double solve_ms, refine_ms;
    region_check check;
} report;

static int print_json(const setup *s, const options *o, const report *r)
{
    const umb_region_answer *a = r->answer;
    json_text j = {0};
    json_text_open(&j, NULL, '{');
    json_text_count(&j, "objects", a->stats.objects);
    json_text_count(&j, "maps", a->stats.mapped);
    json_text_count(&j, "pvs", a->pvs_count);
    json_text_count(&j, "upper", a->refined_count);
    json_text_count(&j, "objects_triangles", a->stats.triangles);
    json_text_count(&j, "maps_triangles", a->stats.mapped_triangles);
    json_text_count(&j, "pvs_triangles", a->stats.pvs_triangles);
    json_text_count(&j, "upper_triangles", a->stats.refined_triangles);
    json_text_count(&j, "undecided", a->stats.undecided);
    json_text_count(&j, "occluders", a->stats.occluders);
    json_text_count(&j, "queries", a->stats.queries);
    json_text_number(&j, "time_ms", r->solve_ms);
    json_text_number(&j, "refine_ms", r->refine_ms);
    region_check_json(&r->check, s, &j);
    if (options_given(o, "list")) {
        json_text_ids(&j, "ids", a->refined, a->refined_count);
    }
    json_text_close(&j, '}');
    return part_file_print(o, &j);
}

static int print_text(const setup *set, const options *o, const report *r)
{
    const umb_region_answer *a = r->answer;
    const umb_region_stats *s = &a->stats;
    printf("%-12s %12s %12s\n", "", "objects", "triangles");
    printf("%-12s %12u %12llu\n", "scene", s->objects, (unsigned long long)s->triangles);
    printf("%-12s %12u %12llu\n", "maps", s->mapped, (unsigned long long)s->mapped_triangles);
    printf("%-12s %12u %12llu   %.3f ms\n", "pvs", a->pvs_count, (unsigned long long)s->pvs_triangles,
           r->solve_ms);
    printf("%-12s %12u %12llu   %.3f ms\n", "refined", a->refined_count,
           (unsigned long long)s->refined_triangles, r->refine_ms);
    region_check_row(&r->check);
    region_check_text(&r->check, set, o);
    for (uint32_t i = 0; options_given(o, "list") && i < a->refined_count; ++i) {
        printf("%u\n", a->refined[i]);
    }
    return EXIT_DONE;
}

static double since(double start)
{
    return nearbyint((progress_clock() - start) * 1e3) / 1e3;
}

/* The time is the least of --repeat answers after one that grows buffers. */
static umb_result solve(const options *o, umb_region *region, const umb_region_query *query,
                        umb_region_answer *a, report *out)
{
    out->solve_ms = INFINITY;
    umb_result result = umb_region_solve(region, query, a);
    for (uint32_t i = 0; result == UMB_OK && i < o->repeat; ++i) {
        double start = progress_clock();
        result = umb_region_solve(region, query, a);
        out->solve_ms = fmin(out->solve_ms, since(start));
    }
    if (result == UMB_OK) {
        double start = progress_clock();
        result = umb_region_refine(region, 0, a);
        out->refine_ms = since(start);
    }
    return result;
}

static int paint(const setup *s, const options *o, const umb_region *region, const umb_region_query *q,
                 const report *r)
{
    bitmap im = {0};
    uint8_t *states = malloc((size_t)s->model->object_count + 1);
    int code = EXIT_DONE;
    if (states != NULL) {
        region_check_states(&r->check, r->answer, s->model, states);
    }
    if (states == NULL || !bitmap_create(&im, o->width, o->height) ||
        !region_picture(&im, s->model, region, q, states)) {
        code = fail(o, EXIT_INPUT, "not enough memory for the picture");
    } else {
        code = part_file_picture(o, &im, o->output);
    }
    bitmap_free(&im);
    free(states);
    return code;
}

static int answer(const setup *s, const options *o, umb_region *region, const umb_region_query *query)
{
    umb_region_answer a;
    report r = {.answer = &a};
    umb_result result = solve(o, region, query, &a, &r);
    if (result != UMB_OK) {
        return fail(o, result == UMB_ERROR_ARGUMENT ? EXIT_USAGE : EXIT_INPUT, "%s", s->error.text);
    }
    int code = region_check_run(s, o, query, &a, &r.check);
    if (code == EXIT_DONE) {
        code = options_given(o, "json") ? print_json(s, o, &r) : print_text(s, o, &r);
    }
    if (code == EXIT_DONE && options_given(o, "picture")) {
        code = paint(s, o, region, query, &r);
    }
    if (code == EXIT_DONE) {
        code = region_check_code(&r.check);
    }
    region_check_free(&r.check);
    return code;
}

int cmd_region(const options *o)
{
    if (!options_given(o, "cell")) {
        return fail(o, EXIT_USAGE, "needs a view cell: --cell X0,Y0,Z0,X1,Y1,Z1");
    }
    setup s;
    umb_region_query query;
    umb_region *region = NULL;
    int code = setup_scene(&s, o);
    if (code == EXIT_DONE) {
        code = make_query(&s, o, &query);
    }
    if (code == EXIT_DONE) {
        umb_region_def def = {.isa = o->isa, .tasks = s.tasks, .error = &s.error};
        umb_result result = umb_region_create(s.index, &def, &region);
        code = result == UMB_OK ? answer(&s, o, region, &query) : fail(o, EXIT_INPUT, "%s", s.error.text);
    }
    umb_region_destroy(region);
    setup_free(&s);
    return code;
}

/* Tables, CSV and JSON. */
#include "report.h"

#include <jansson.h>
#include <string.h>
#include <unistd.h>

#include "io/output.h"

#if defined(__clang__)
#define UMB_COMPILER __VERSION__
#else
#define UMB_COMPILER "GCC " __VERSION__
#endif

void report_machine(char *text, size_t size)
{
    char line[256];
    (void)snprintf(text, size, "unknown processor");
    FILE *f = fopen("/proc/cpuinfo", "r");
    while (f != NULL && fgets(line, sizeof line, f) != NULL) {
        const char *colon = strchr(line, ':');
        if (strncmp(line, "model name", 10) == 0 && colon != NULL) {
            line[strcspn(line, "\n")] = 0;
            (void)snprintf(text, size, "%.200s, %ld cores online, kernels %s", colon + 2,
                           sysconf(_SC_NPROCESSORS_ONLN), umb_isa_name(UMB_ISA_AUTO));
            break;
        }
    }
    if (f != NULL) {
        (void)fclose(f);
    }
}

void report_print(const contest *c, FILE *f)
{
    (void)fprintf(f, "\n%s, %s: %s\n", c->world, c->cameras, c->about);
    (void)fprintf(
        f,
        "  %u objects, %.1f in the frustum, %.1f visible (%ux%u rays); rivals' occluders: %u "
        "triangles\n  1 unit = %.4f ms, least of %u rounds, medians over the views\n",
        (unsigned)c->objects, c->in_frustum, c->exact, (unsigned)c->width, (unsigned)c->height,
        (unsigned)c->occluder_triangles, c->unit_ms, (unsigned)c->rounds);
    (void)fprintf(f, "  %-30s %9s %7s %7s %8s %8s %9s %9s %8s %7s\n", "", "reported", "wrong",
                  "a view", "worst px", "hidden", "median ms", "worst ms", "units", "x ours");
    for (uint32_t i = 0; i < c->row_count; ++i) {
        const contest_row *r = &c->rows[i];
        (void)fprintf(f, "  %-30s %9.1f %7llu %7.2f %8u %7.2f%% %9.4f %9.4f %8.2f %7.2f\n", r->name,
                      r->reported, (unsigned long long)r->wrong, (double)r->wrong / c->view_count,
                      (unsigned)r->worst_pixels, 100.0 * r->hidden_share, r->median_ms, r->worst_ms,
                      r->units, r->to_ours);
        if (r->apart != NULL) {
            (void)fprintf(f, "  %-30s   apart: %s, %.3f ms\n", "", r->apart, r->apart_ms);
        }
    }
    for (uint32_t i = 0; i < c->row_count; ++i) {
        const contest_row *r = &c->rows[i];
        if (r->ours && r->wrong != 0) {
            (void)fprintf(f, "  WRONG: %s hid object %u of view %u\n", r->name,
                          (unsigned)r->worst_object, (unsigned)r->worst_view);
        }
        if (r->standard && c->limit > 0.0 && r->units > c->limit) {
            (void)fprintf(f, "  TOO SLOW: %s costs %.2f units; the limit is %.2f\n", r->name,
                          r->units, c->limit);
        }
    }
}

static bool write_csv(const contest *contests, uint32_t count, const char *file, umb_error *error)
{
    FILE *f = output_open(file, error);
    if (f == NULL) {
        return false;
    }
    (void)fprintf(
        f,
        "scene,views,contestant,promise,objects,in_frustum,exact,reported,wrong_total,"
        "wrong_mean,worst_pixels,hidden_share,median_ms,worst_ms,units,to_ours,apart,apart_ms\n");
    for (uint32_t i = 0; i < count; ++i) {
        const contest *c = &contests[i];
        (void)fprintf(f, "%s,%s,yardstick,none,%u,%.3f,%.3f,,,,,,%.6f,,1,,,\n", c->world,
                      c->cameras, (unsigned)c->objects, c->in_frustum, c->exact, c->unit_ms);
        for (uint32_t k = 0; k < c->row_count; ++k) {
            const contest_row *r = &c->rows[k];
            (void)fprintf(
                f,
                "%s,%s,\"%s\",%s,%u,%.3f,%.3f,%.3f,%llu,%.4f,%u,%.5f,%.6f,%.6f,%.4f,%.4f,%s,%.4f\n",
                c->world, c->cameras, r->name, r->about, (unsigned)c->objects, c->in_frustum,
                c->exact, r->reported, (unsigned long long)r->wrong,
                (double)r->wrong / c->view_count, (unsigned)r->worst_pixels, r->hidden_share,
                r->median_ms, r->worst_ms, r->units, r->to_ours, r->apart != NULL ? r->apart : "",
                r->apart_ms);
        }
    }
    return output_close(f, file, true, error);
}

static json_t *row_json(const contest_row *r, uint32_t view_count)
{
    json_t *row = json_pack(
        "{s:s, s:s, s:b, s:f, s:I, s:f, s:i, s:f, s:f, s:f, s:f, s:f}", "contestant", r->name,
        "promise", r->about, "ours", (int)r->ours, "reported", r->reported, "wrong_total",
        (json_int_t)r->wrong, "wrong_mean", (double)r->wrong / view_count, "worst_pixels",
        (int)r->worst_pixels, "hidden_share", r->hidden_share, "median_ms", r->median_ms,
        "worst_ms", r->worst_ms, "units", r->units, "to_ours", r->to_ours);
    if (row != NULL && r->apart != NULL) {
        (void)json_object_set_new(row, "apart", json_string(r->apart));
        (void)json_object_set_new(row, "apart_ms", json_real(r->apart_ms));
    }
    return row;
}

static bool write_json(const contest *contests, uint32_t count, const char *file, umb_error *error)
{
    char machine[320];
    report_machine(machine, sizeof machine);
    json_t *list = json_array();
    for (uint32_t i = 0; i < count; ++i) {
        const contest *c = &contests[i];
        json_t *rows = json_array();
        for (uint32_t k = 0; k < c->row_count; ++k) {
            (void)json_array_append_new(rows, row_json(&c->rows[k], c->view_count));
        }
        (void)json_array_append_new(
            list, json_pack("{s:s, s:s, s:s, s:s, s:i, s:i, s:i, s:[i,i], s:i, s:f, s:f, s:f, s:o}",
                            "scene", c->world, "spec", c->spec, "views", c->cameras, "about",
                            c->about, "objects", (int)c->objects, "view_count", (int)c->view_count,
                            "rounds", (int)c->rounds, "oracle", (int)c->width, (int)c->height,
                            "occluder_triangles", (int)c->occluder_triangles, "in_frustum",
                            c->in_frustum, "exact", c->exact, "unit_ms", c->unit_ms, "rows", rows));
    }
    json_t *root = json_pack("{s:s, s:s, s:s, s:o}", "version", umb_version(), "machine", machine,
                             "compiler", UMB_COMPILER, "contests", list);
    FILE *f = root != NULL ? output_open(file, error) : NULL;
    bool ok = f != NULL && json_dumpf(root, f, JSON_INDENT(1) | JSON_REAL_PRECISION(6)) == 0;
    json_decref(root);
    return f != NULL && output_close(f, file, ok, error);
}

bool report_data(const contest *contests, uint32_t count, const char *prefix, umb_error *error)
{
    char file[512];
    (void)snprintf(file, sizeof file, "%s.csv", prefix);
    if (!write_csv(contests, count, file, error)) {
        return false;
    }
    (void)snprintf(file, sizeof file, "%s.json", prefix);
    return write_json(contests, count, file, error);
}

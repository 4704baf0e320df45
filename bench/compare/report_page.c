/* The page of results and its plots. */
#include "report.h"

#include <string.h>

#include "io/output.h"
#include "svg_dots.h"

enum { SERIES_MOST = 8, LINES_MOST = 64, DOTS_MOST = LINES_MOST * SERIES_MOST };

static const char *const colours[SERIES_MOST] = {"#1763c6", "#c4501b", "#dba01f", "#7b4cb0",
                                                 "#2f8f4e", "#555555", "#b03060", "#2a9fb0"};

static const char *const introduction[] = {
    "*Unit*: one plain float pass over all boxes of the scene against six planes, bit mask out "
    "(the ",
    "yardstick), timed in the same run. *Visible*: objects that own at least one of the oracle's ",
    "rays, one through every pixel's centre, first hits of all triangles. *Wrong*: objects hidden ",
    "that own a ray, over all views; of ours, if there were any, those that exact arithmetic ",
    "confirms. *Worst px*: rays owned by the largest of them. *Hidden*: of the objects in the ",
    "frustum. Times are whole frames on one thread: medians over the views of the least of "
    "several ",
    "rounds; all contestants take turns in every round.\n\n",
    "- *umbrage*: the default method over the default index; every object hides.\n",
    "- *foundation*: the library when it was first whole (`scripts/foundation` builds it from the ",
    "history), with its own reader, default method and index; it knew no vertical.\n",
    "- *frustum test*: the library's strict test of boxes alone, ids in no order.\n",
    "- *z-buffer*: occluders front to back, each tested before it is drawn, per triangle at pixel ",
    "centres, in vectors of eight; then every box by rectangle and nearest depth, with a far "
    "bound ",
    "for each 8 x 8 pixels.\n",
    "- *tree*: the same z-buffer fed by a tree, nearest first; what hidden nodes hold is never "
    "looked ",
    "at.\n",
    "- *ray buffer*: rays through an Embree tree of the occluders, a chain of farthest depths, "
    "boxes ",
    "by rectangle, in the way of a game engine's raycast occlusion culling. It needs a new tree ",
    "whenever an occluder moves.\n\n",
    "The flat rivals start with the yardstick's frustum pass. Rivals' occluders are the buildings "
    "in ",
    "`blocks`, elsewhere every object that blocks, each face once.\n\n"};

static const char head[] = "| scene | views | | reported | visible | wrong | worst px | hidden | "
                           "median ms | worst ms | units | x ours |\n"
                           "|---|---|---|---|---|---|---|---|---|---|---|---|\n";

static void print_rows(const contest *c, FILE *f)
{
    for (uint32_t i = 0; i < c->row_count; ++i) {
        const contest_row *r = &c->rows[i];
        (void)fprintf(
            f, "| %s | %s | %s | %.1f | %.1f | %llu | %u | %.2f %% | %.4f | %.4f | %.2f | %.2f |\n",
            c->world, c->cameras, r->name, r->reported, c->exact, (unsigned long long)r->wrong,
            (unsigned)r->worst_pixels, 100.0 * r->hidden_share, r->median_ms, r->worst_ms, r->units,
            r->to_ours);
    }
}

static void print_apart(const contest *c, FILE *f)
{
    for (uint32_t i = 0; i < c->row_count; ++i) {
        if (c->rows[i].apart != NULL) {
            (void)fprintf(f, "| %s | %s | %s | %s | %.3f | %.2f |\n", c->world, c->cameras,
                          c->rows[i].name, c->rows[i].apart, c->rows[i].apart_ms,
                          c->rows[i].to_ours);
        }
    }
}

static void print_settings(const contest *c, FILE *f)
{
    (void)fprintf(f, "| %s | %s | %s | %u | %.1f | %u | %ux%u | %.4f | %u |\n", c->world, c->cameras,
                  c->about, (unsigned)c->objects, c->in_frustum, (unsigned)c->occluder_triangles,
                  (unsigned)c->width, (unsigned)c->height, c->unit_ms, (unsigned)c->rounds);
}

typedef enum figure { COST, TIGHTNESS } figure;

typedef struct drawing {
    svg_dots plot;
    svg_dots_series series[SERIES_MOST];
    svg_dots_dot dots[DOTS_MOST];
    const char *lines[LINES_MOST];
    char labels[LINES_MOST][100];
} drawing;

static uint32_t series_of(drawing *d, const char *name)
{
    for (uint32_t i = 0; i < d->plot.series_count; ++i) {
        if (strcmp(d->series[i].name, name) == 0) {
            return i;
        }
    }
    if (d->plot.series_count == SERIES_MOST) {
        return SERIES_MOST;
    }
    d->series[d->plot.series_count] = (svg_dots_series){name, colours[d->plot.series_count], false};
    return d->plot.series_count++;
}

static void draw_contest(drawing *d, const contest *c, figure what)
{
    uint32_t line = d->plot.line_count++;
    (void)snprintf(d->labels[line], sizeof d->labels[line], "%s, %s", c->world, c->cameras);
    d->lines[line] = d->labels[line];
    /* From last to first: where dots meet, the first contestant's lies on top. */
    for (uint32_t i = c->row_count; i-- > 0;) {
        const contest_row *r = &c->rows[i];
        double value = what == COST ? r->median_ms : c->exact > 0.0 ? r->reported / c->exact : 0.0;
        if (!r->charted || !(value > 0.0)) {
            continue;
        }
        uint32_t series = series_of(d, r->name);
        if (series < SERIES_MOST) {
            d->dots[d->plot.dot_count++] = (svg_dots_dot){line, series, value, r->wrong != 0};
        }
    }
}

static bool draw(const contest *contests, uint32_t count, figure what, const char *file,
                 umb_error *error)
{
    static drawing d;
    memset(&d, 0, sizeof d);
    for (uint32_t i = 0; i < contests[0].row_count; ++i) {
        if (contests[0].rows[i].charted) {
            (void)series_of(&d, contests[0].rows[i].name);
        }
    }
    for (uint32_t i = 0; i < count && i < LINES_MOST; ++i) {
        draw_contest(&d, &contests[i], what);
    }
    if (d.plot.series_count < SERIES_MOST) {
        d.series[d.plot.series_count++] = (svg_dots_series){"a ring: it hid something visible",
                                                            "#888", true};
    }
    d.plot.title = what == COST ? "Cost of a frame" : "Objects reported for each visible one";
    d.plot.axis = what == COST ? "median of whole frames, ms, one thread"
                               : "reported / visible; 1 is exact, a safe answer is never below";
    d.plot.lines = d.lines;
    d.plot.series = d.series;
    d.plot.dots = d.dots;
    return svg_dots_write(&d.plot, file, error);
}

static void print_page(const contest *contests, uint32_t count, FILE *f)
{
    char machine[320];
    report_machine(machine, sizeof machine);
    (void)fprintf(f, "# Frames compared\n\nMade by `make results`: umbrage %s, %s.\n\n",
                  umb_version(), machine);
    for (size_t i = 0; i < sizeof introduction / sizeof introduction[0]; ++i) {
        (void)fputs(introduction[i], f);
    }
    (void)fprintf(f, "![cost](compare-cost.svg)\n\n![tightness](compare-tightness.svg)\n\n");
    for (uint32_t kind = 0; kind < 3; ++kind) {
        static const char *const titles[] = {"Views by themselves", "A moving camera",
                                             "Real scenes"};
        static const uint32_t whys[] = {ENTRY_STILL, ENTRY_MOTION, ENTRY_SCENE};
        uint32_t printed = 0;
        for (uint32_t i = 0; i < count; ++i) {
            if (contests[i].why == whys[kind]) {
                if (printed++ == 0) {
                    (void)fprintf(f, "## %s\n\n%s", titles[kind], head);
                }
                print_rows(&contests[i], f);
            }
        }
        (void)fputs(printed != 0 ? "\n" : "", f);
    }
    (void)fprintf(
        f, "## Apart from the frame\n\nOnce for every frame in which an occluder moved.\n\n"
           "| scene | views | | what | ms | its frame, x ours |\n|---|---|---|---|---|---|\n");
    for (uint32_t i = 0; i < count; ++i) {
        print_apart(&contests[i], f);
    }
    (void)fprintf(f, "\n## Settings\n\n| scene | views | | objects | in the frustum | rivals' "
                     "triangles | rays | "
                     "unit ms | rounds |\n|---|---|---|---|---|---|---|---|---|\n");
    for (uint32_t i = 0; i < count; ++i) {
        print_settings(&contests[i], f);
    }
}

bool report_page(const contest *contests, uint32_t count, const char *dir, umb_error *error)
{
    char file[512];
    (void)snprintf(file, sizeof file, "%s/compare.md", dir);
    FILE *f = output_open(file, error);
    if (f == NULL) {
        return false;
    }
    print_page(contests, count, f);
    if (!output_close(f, file, true, error)) {
        return false;
    }
    (void)snprintf(file, sizeof file, "%s/compare-cost.svg", dir);
    if (count == 0 || !draw(contests, count, COST, file, error)) {
        return count == 0;
    }
    (void)snprintf(file, sizeof file, "%s/compare-tightness.svg", dir);
    return draw(contests, count, TIGHTNESS, file, error);
}

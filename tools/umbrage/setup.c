#include "setup.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "moving.h"
#include "progress.h"
#include "selection.h"

/* ---- scene ---------------------------------------------------------------------------------- */

static bool is_generated(const char *name)
{
    return strncmp(name, "gen:", 4) == 0;
}

/* With --seed, a generator's name with the seed added; the last of equal keys counts. NULL
 * without. */
static char *seeded(const options *o, const char *name)
{
    if (!o->seed || !is_generated(name)) {
        return NULL;
    }
    size_t length = strlen(name) + strlen(o->seed) + 8;
    char *out = malloc(length);
    if (out) {
        snprintf(out, length, "%s,seed=%s", name, o->seed);
    }
    return out;
}

static model *load_model(const options *o, umb_error *error)
{
    model *m = NULL;
    char *name = seeded(o, o->input);
    if (name) {
        m = model_load(name, &o->model, error);
        free(name);
    }
    /* Not every generator draws numbers: one that has no seed is the same for all of them. */
    return m ? m : model_load(o->input, &o->model, error);
}

/* A wrong name or number of a generator is wrong usage; what a file holds is an input. */
static int load_failure(const options *o, const char *name, const umb_error *error)
{
    bool usage = is_generated(name) && error->code == UMB_ERROR_ARGUMENT;
    return fail(o, usage ? EXIT_USAGE : EXIT_INPUT, "%s", error->text);
}

int setup_model(setup *s, const options *o)
{
    memset(s, 0, sizeof *s);
    double start = progress_clock();
    progress_note(o, "reading the scene");
    s->model = load_model(o, &s->error);
    progress_note(o, NULL);
    if (!s->model) {
        return load_failure(o, o->input, &s->error);
    }
    s->load_ms = nearbyint((progress_clock() - start) * 1e3) / 1e3;
    return EXIT_DONE;
}

/* What is told of the objects once they are in, then the weld that had to wait for it. */
static int complete_scene(setup *s, const options *o, bool weld)
{
    int code = selection_start(s, o);
    if (code != EXIT_DONE || options_given(o, "moving")) {
        return code == EXIT_DONE ? moving_start(s, o, weld) : code;
    }
    umb_weld_def def = {.tasks = s->tasks};
    umb_result result = weld && o->without ? umb_scene_weld(s->scene, &def, &s->weld) : UMB_OK;
    result = result == UMB_OK ? umb_scene_commit(s->scene) : result;
    return result == UMB_OK ? EXIT_DONE : fail(o, EXIT_INPUT, "%s: %s", o->input, umb_result_name(result));
}

int setup_scene(setup *s, const options *o)
{
    int code = setup_model(s, o);
    if (code != EXIT_DONE) {
        return code;
    }
    double start = progress_clock();
    if (o->threads > 1) {
        if (umb_pool_create(o->threads, &s->pool) != UMB_OK) {
            return fail(o, EXIT_INPUT, "%u threads cannot be started; ask for fewer", o->threads);
        }
        s->tasks = umb_pool_tasks(s->pool);
    }
    bool weld = !options_given(o, "no-weld"), later = options_given(o, "moving") || o->without;
    progress_note(o, "building scene and index");
    s->scene = model_scene(s->model, weld && !later, s->tasks, &s->weld, &s->error);
    if (!s->scene) {
        return fail(o, EXIT_INPUT, "%s: %s", o->input, s->error.text);
    }
    code = complete_scene(s, o, weld);
    if (code != EXIT_DONE) {
        return code;
    }
    umb_index_def def = o->index;
    def.tasks = s->tasks;
    umb_result result = umb_index_create(s->scene, &def, &s->index);
    if (result != UMB_OK) {
        return fail(o, EXIT_INPUT, "%s: the index: %s", o->input, umb_result_name(result));
    }
    progress_note(o, NULL);
    s->build_ms = nearbyint((progress_clock() - start) * 1e3) / 1e3;
    return EXIT_DONE;
}

static int setup_cullers(setup *s, const options *o)
{
    int code = setup_scene(s, o);
    if (code != EXIT_DONE) {
        return code;
    }
    umb_culler_def def = {.method = o->method,
                          .isa = o->isa,
                          .error = &s->error,
                          .tasks = s->tasks,
                          .coherence = o->coherence,
                          .occluder_budget = o->occluder_budget};
    umb_result result = umb_culler_create(s->index, &def, &s->culler);
    if (result == UMB_OK && (o->coherence & UMB_COHERENCE_LEAVES) != 0) {
        result = umb_culler_prepare(s->culler);
    }
    def.method = UMB_METHOD_NONE;
    if (result == UMB_OK) {
        result = umb_culler_create(s->index, &def, &s->frustum);
    }
    result = result == UMB_OK ? selection_restrict(s, s->culler) : result;
    result = result == UMB_OK ? selection_restrict(s, s->frustum) : result;
    return result == UMB_OK ? EXIT_DONE
                            : fail(o, EXIT_INPUT, "the culler: %s", umb_result_name(result));
}

void setup_free(setup *s)
{
    umb_culler_destroy(s->frustum);
    umb_culler_destroy(s->culler);
    umb_index_destroy(s->index);
    umb_scene_destroy(s->scene);
    moving_free(s->moving);
    selection_free(s->selection);
    umb_pool_destroy(s->pool);
    model_free(s->model);
    memset(s, 0, sizeof *s);
}

void setup_to_file(const model *m, const double in[3], double out[3])
{
    for (int i = 0; i < 3; ++i) {
        out[i] = in[i] + m->origin[i];
    }
}

/* ---- views ---------------------------------------------------------------------------------- */

static int check_views(const setup *s, const options *o, const views *v)
{
    umb_view view;
    umb_error why_not;
    for (uint32_t k = 0; k < v->count; ++k) {
        uint32_t r = setup_row(v, k);
        const char *why = setup_make_view(s->model, o, v->path.rows[r], &view, &why_not);
        if (!why) {
            continue;
        }
        return v->is_path ? fail(o, EXIT_USAGE, "impossible view: row %u of %s: %s", r, o->path, why)
                          : fail(o, EXIT_USAGE, "impossible view: %s", why);
    }
    return EXIT_DONE;
}

static int load_path(const options *o, umb_error *error, views *out)
{
    bool loaded = false;
    char *name = seeded(o, o->path);
    if (name) {
        loaded = camera_path_load(name, &out->path, error);
        free(name);
    }
    if (!loaded && !camera_path_load(o->path, &out->path, error)) {
        return load_failure(o, o->path, error);
    }
    out->is_path = true;
    return out->path.count > 0 ? EXIT_DONE : fail(o, EXIT_INPUT, "%s: holds no view", o->path);
}

static int choose_rows(const options *o, bool single, views *out)
{
    uint32_t from = single ? o->row : o->from;
    uint32_t last = out->path.count - 1;
    uint32_t to = single ? from : o->to < last ? o->to : last;
    if (from > last || to < from) {
        return fail(o, EXIT_USAGE, "no such rows: %s has rows 0 to %u", o->path, last);
    }
    out->first = from;
    out->every = o->every;
    out->count = (to - from) / o->every + 1;
    return EXIT_DONE;
}

static int single_row(const options *o, views *out)
{
    bool aimed = options_given(o, "target") || options_given(o, "cube");
    if (!options_given(o, "eye") || !aimed) {
        return fail(o, EXIT_USAGE, "needs a view: --eye X,Y,Z --target X,Y,Z, or --path FILE");
    }
    out->path.rows = malloc(sizeof *out->path.rows);
    if (!out->path.rows) {
        return fail(o, EXIT_INPUT, "not enough memory");
    }
    memcpy(out->path.rows[0], o->eye, sizeof o->eye);
    memcpy(out->path.rows[0] + 3, o->target, sizeof o->target);
    out->path.count = out->count = out->every = 1;
    return EXIT_DONE;
}

/* What contradicts itself, whatever the scene. */
static int check_choices(const options *o)
{
    bool eye = options_given(o, "eye") || options_given(o, "target");
    if (o->path && eye) {
        return fail(o, EXIT_USAGE, "takes --eye and --target, or --path, not both");
    }
    static const char *const shapes[][2] = {{"fov", "ortho"},  {"fov", "spot"},   {"fov", "cube"},
                                            {"ortho", "spot"}, {"ortho", "cube"}, {"spot", "cube"},
                                            {"spot", "sun"},   {"cube", "sun"}};
    for (size_t i = 0; i < sizeof shapes / sizeof shapes[0]; ++i) {
        if (options_given(o, shapes[i][0]) && options_given(o, shapes[i][1])) {
            return fail(o, EXIT_USAGE, "takes --%s or --%s, not both", shapes[i][0], shapes[i][1]);
        }
    }
    if (!options_given(o, "sun") && (options_given(o, "slice") || options_given(o, "reach"))) {
        return fail(o, EXIT_USAGE, "--%s needs --sun",
                    options_given(o, "slice") ? "slice" : "reach");
    }
    if (options_given(o, "step") && !options_given(o, "moving")) {
        return fail(o, EXIT_USAGE, "--step needs --moving");
    }
    static const char *const row_options[] = {"row", "from", "to", "every"};
    for (int i = 0; i < 4; ++i) {
        if (!o->path && options_given(o, row_options[i])) {
            return fail(o, EXIT_USAGE, "--%s needs --path", row_options[i]);
        }
    }
    return EXIT_DONE;
}

/* What needs no scene is refused before one is read. */
static int read_rows(const options *o, bool single, views *out)
{
    umb_error error = {0};
    int code = check_choices(o);
    if (code == EXIT_DONE) {
        code = o->path ? load_path(o, &error, out) : single_row(o, out);
    }
    return code == EXIT_DONE && o->path ? choose_rows(o, single, out) : code;
}

int setup_views(setup *s, const options *o, bool single, views *out)
{
    memset(s, 0, sizeof *s);
    memset(out, 0, sizeof *out);
    int code = read_rows(o, single, out);
    if (code == EXIT_DONE) {
        code = setup_cullers(s, o);
    }
    return code == EXIT_DONE ? check_views(s, o, out) : code;
}

uint32_t setup_row(const views *v, uint32_t k)
{
    return v->first + k * v->every;
}

umb_view setup_view(const setup *s, const options *o, const views *v, uint32_t k)
{
    umb_view view;
    umb_error error;
    setup_make_view(s->model, o, v->path.rows[setup_row(v, k)], &view, &error);
    view.time = setup_row(v, k) * o->step;
    selection_mask_view(s, &view);
    return view;
}

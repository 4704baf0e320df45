/* What a run consists of, and the scenes of its parts. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "soak.h"
#include "support/real_scenes.h"

/* A scene with the views of either style, and the cells, that the full and the short run take of it. */
typedef struct scene_row {
    const char *family, *name, *scene;
    double shift;
    bool weld;
    uint32_t ordinary, adversarial;             /* of the full run */
    uint32_t short_ordinary, short_adversarial; /* of the short one */
    uint32_t cells, short_cells;
} scene_row;

static const scene_row ROWS[] = {
    {"blocks", "blocks-316", "gen:blocks,g=316", 0.0, true, 3200, 0, 0, 0, 0, 0},
    {"blocks", "blocks-100", "gen:blocks,g=100", 0.0, true, 800, 300, 0, 0, 0, 0},
    {"blocks", "blocks-32", "gen:blocks,g=32", 0.0, true, 800, 500, 24, 0, 18, 0},
    {"blocks", "blocks-32-moved", "gen:blocks,g=32", 50.0, true, 160, 300, 0, 0, 0, 0},
    {"boxfield", "boxfield-20M", "gen:boxfield,polygons=20M", 0.0, true, 1600, 0, 0, 0, 0, 0},
    {"boxfield", "boxfield-200k", "gen:boxfield,polygons=200k", 0.0, true, 800, 500, 0, 0, 9, 0},
    {"boxfield", "boxfield-200k-moved", "gen:boxfield,polygons=200k", 50.0, true, 160, 300, 0, 0, 9, 0},
    {"boxfield", "boxfield-50k", "gen:boxfield,polygons=50k", 0.0, true, 0, 0, 0, 0, 36, 0},
    {"city", "city-20M", "gen:city,triangles=20M", 0.0, true, 1600, 0, 0, 0, 0, 0},
    {"city", "city-1M", "gen:city,triangles=1M", 0.0, true, 800, 600, 0, 0, 18, 0},
    {"city", "city-200k", "gen:city,triangles=200k", 0.0, true, 0, 0, 0, 0, 36, 0},
    {"city", "city-200k-moved", "gen:city,triangles=200k", 50.0, true, 160, 300, 0, 0, 18, 0},
    {"building", "building-40", "gen:building,floors=40", 0.0, true, 800, 500, 0, 0, 9, 0},
    {"building", "building-8", "gen:building,floors=8", 0.0, true, 0, 0, 0, 0, 18, 0},
    {"building", "building-1-moved", "gen:building,floors=1", 50.0, true, 160, 300, 0, 16, 18, 18},
    {"medley", "medley-1M", "medley:1000000", 0.0, true, 1200, 0, 0, 0, 0, 0},
    {"medley", "medley-20k", "medley:20000", 0.0, false, 800, 600, 0, 0, 18, 0},
    {"medley", "medley-2k", "medley:2000", 0.0, true, 400, 500, 16, 16, 18, 18},
    {"medley", "medley-2k-moved", "medley:2000", 5000.0, true, 160, 300, 0, 0, 0, 0},
};
enum { ROW_COUNT = sizeof ROWS / sizeof ROWS[0] };

/* Views of each real scene, and of the micro scenes, two each. */
enum {
    REAL_ORDINARY = 160,
    REAL_ADVERSARIAL = 320,
    REAL_CELLS = 9,
    MICRO_VIEWS = 6000,
    MICRO_CELLS = 1000,
    SHORT_MICRO = 48
};

/* Rays of a cell, and of one of a micro scene. */
enum { CELL_RAYS = 4500000, SHORT_CELL_RAYS = 30000, MICRO_CELL_RAYS = 20000 };

static uint32_t rays_of(soak_style style, bool full)
{
    switch (style) {
    case SOAK_MICRO:
        return 60000;
    case SOAK_CELLS:
        return full ? CELL_RAYS : SHORT_CELL_RAYS;
    case SOAK_MICRO_CELLS:
        return MICRO_CELL_RAYS;
    default:
        return 100000;
    }
}

static bool add(soak_plan *p, const scene_row *row, soak_style style, bool full, double views)
{
    if (views < 1.0) {
        return true;
    }
    soak_part *more = realloc(p->parts, (p->count + 1) * sizeof *more);
    if (more == NULL) {
        return false;
    }
    p->parts = more;
    soak_part *part = &more[p->count++];
    memset(part, 0, sizeof *part);
    static const char *const suffixes[] = {"", "-adversarial", "", "-cells", "-cells"};
    (void)snprintf(part->name, sizeof part->name, "%s%s", row->name, suffixes[style]);
    (void)snprintf(part->scene, sizeof part->scene, "%s", row->scene);
    part->family = row->family;
    part->style = style;
    part->views = (uint32_t)views;
    part->shift = row->shift;
    part->weld = row->weld;
    part->most_targets = style == SOAK_MICRO ? 4000 : 400;
    part->rays = rays_of(style, full);
    part->most_decided = style == SOAK_ADVERSARIAL ? 8 : 16;
    return true;
}

static bool add_styles(soak_plan *p, const scene_row *row, bool full, double scale)
{
    uint32_t adversarial = full ? row->adversarial : row->short_adversarial;
    return add(p, row, SOAK_ORDINARY, full, scale * (full ? row->ordinary : row->short_ordinary)) &&
           add(p, row, SOAK_ADVERSARIAL, full, scale * adversarial) &&
           add(p, row, SOAK_CELLS, full, scale * (full ? row->cells : row->short_cells));
}

static bool add_real(soak_plan *p, double scale, umb_error *error)
{
    const char *folder = getenv("UMBRAGE_SCENES");
    real_scenes all;
    if (folder == NULL || folder[0] == '\0') {
        (void)fprintf(stderr,
                      "UMBRAGE_SCENES names no folder of real scenes: none are looked at\n");
        return true;
    }
    if (!real_scenes_find(folder, &all, error)) {
        return false;
    }
    bool ok = true;
    for (uint32_t i = 0; ok && i < all.count; ++i) {
        scene_row row = {.family = "real scenes",
                         .name = all.scenes[i].name,
                         .scene = all.scenes[i].file,
                         .weld = true,
                         .ordinary = REAL_ORDINARY,
                         .adversarial = REAL_ADVERSARIAL,
                         .cells = REAL_CELLS};
        ok = add_styles(p, &row, true, scale);
    }
    real_scenes_free(&all);
    return ok;
}

bool soak_plan_make(bool full, double scale, soak_plan *out, umb_error *error)
{
    *out = (soak_plan){0};
    bool ok = true;
    for (int k = 0; ok && k < ROW_COUNT; ++k) {
        ok = add_styles(out, &ROWS[k], full, scale);
    }
    ok = ok && (!full || add_real(out, scale, error));
    scene_row micro = {.family = "micro scenes", .name = "micro", .scene = "micro"};
    ok = ok && add(out, &micro, SOAK_MICRO, full, scale * (full ? MICRO_VIEWS : SHORT_MICRO));
    ok = ok && add(out, &micro, SOAK_MICRO_CELLS, full, scale * (full ? MICRO_CELLS : SHORT_MICRO));
    if (!ok) {
        soak_plan_free(out);
        if (error->text[0] == '\0') {
            (void)snprintf(error->text, sizeof error->text, "not enough memory for the plan");
        }
    }
    return ok;
}

void soak_plan_free(soak_plan *p)
{
    free(p->parts);
    *p = (soak_plan){0};
}

/* Move everything by so many of the scene's own sizes, each world vertex rounded where it then is. */
static void move_model(model *m, double shift)
{
    double extent = 0.0;
    for (int i = 0; i < 3; ++i) {
        double side = (double)m->bounds.max[i] - m->bounds.min[i];
        extent = side > extent ? side : extent;
    }
    const double way[3] = {1.0, -0.25, 0.625};
    for (uint32_t k = 0; k < m->object_count; ++k) {
        model_object *o = &m->objects[k];
        uint32_t vertices = o->mesh != MODEL_NONE ? m->meshes[o->mesh].position_count : 0;
        for (int i = 0; i < 3; ++i) {
            o->transform.m[i][3] = (float)(o->transform.m[i][3] + way[i] * shift * extent);
        }
        for (uint32_t v = 0; v < vertices; ++v) {
            float p[3];
            model_world_vertex(m, o, v, p);
            for (int i = 0; i < 3; ++i) {
                o->bounds.min[i] = v == 0 || p[i] < o->bounds.min[i] ? p[i] : o->bounds.min[i];
                o->bounds.max[i] = v == 0 || p[i] > o->bounds.max[i] ? p[i] : o->bounds.max[i];
            }
        }
    }
    bool first = true;
    for (uint32_t k = 0; k < m->object_count; ++k) {
        const model_object *o = &m->objects[k];
        for (int i = 0; i < 3 && o->mesh != MODEL_NONE; ++i) {
            m->bounds.min[i] = first || o->bounds.min[i] < m->bounds.min[i] ? o->bounds.min[i]
                                                                            : m->bounds.min[i];
            m->bounds.max[i] = first || o->bounds.max[i] > m->bounds.max[i] ? o->bounds.max[i]
                                                                            : m->bounds.max[i];
        }
        first = first && o->mesh == MODEL_NONE;
    }
}

/* The scene's own path, if it has one: a generator's, or the file's NAME.path.csv. */
static bool load_path(soak_scene *s, umb_error *error)
{
    char name[600];
    if (s->shift != 0.0 || strncmp(s->scene, "medley:", 7) == 0) {
        return true;
    }
    (void)snprintf(name, sizeof name, "%s", s->scene);
    if (strncmp(name, "gen:", 4) != 0) {
        char *base = strrchr(name, '/'), *dot = strchr(base != NULL ? base : name, '.');
        dot = dot != NULL ? dot : name + strlen(name);
        (void)snprintf(dot, sizeof name - (size_t)(dot - name), ".path.csv");
    }
    if (!camera_path_load(name, &s->path, error)) {
        return false;
    }
    for (uint32_t k = 0; k < s->path.count; ++k) {
        for (int i = 0; i < 6; ++i) {
            s->path.rows[k][i] -= s->model->origin[i % 3];
        }
    }
    return true;
}

bool soak_scene_load(const soak_part *part, plant planted, soak_scene *out, umb_error *error)
{
    umb_tasks tasks = {0};
    umb_index_def flat = {.kind = UMB_INDEX_FLAT}, kd = {.kind = UMB_INDEX_KDTREE};
    memset(out, 0, sizeof *out);
    memcpy(out->scene, part->scene, sizeof out->scene);
    out->shift = part->shift;
    out->weld = part->weld;
    out->planted = planted;
    if (part->style == SOAK_MICRO || part->style == SOAK_MICRO_CELLS) {
        return true;
    }
    (void)snprintf(error->text, sizeof error->text, "%.200s: not enough memory", part->scene);
    bool medley = strncmp(part->scene, "medley:", 7) == 0;
    out->model = medley ? soak_medley((uint32_t)strtoul(part->scene + 7, NULL, 10), 1)
                        : model_load(part->scene, NULL, error);
    bool ok = out->model != NULL && load_path(out, error);
    if (ok && part->shift != 0.0) {
        move_model(out->model, part->shift);
    }
    if (ok) {
        out->built = planted == PLANT_NONE ? model_scene(out->model, part->weld, tasks, NULL, error)
                                           : planted_scene(out->model, planted, part->weld);
    }
    ok = ok && out->built != NULL && umb_index_create(out->built, NULL, &out->index) == UMB_OK;
    if (ok && out->model->object_count < 50000) {
        ok = umb_index_create(out->built, &flat, &out->flat) == UMB_OK;
        ok = ok && umb_index_create(out->built, &kd, &out->kd) == UMB_OK;
    }
    out->oracle = ok ? truth_create(out->model, error) : NULL;
    if (out->oracle == NULL) {
        soak_scene_free(out);
        return false;
    }
    return true;
}

void soak_scene_free(soak_scene *s)
{
    camera_path_free(&s->path);
    umb_index_destroy(s->index);
    umb_index_destroy(s->flat);
    umb_index_destroy(s->kd);
    umb_scene_destroy(s->built);
    if (s->oracle != NULL) {
        truth_destroy(s->oracle);
    }
    if (s->model != NULL) {
        model_free(s->model);
    }
    memset(s, 0, sizeof *s);
}

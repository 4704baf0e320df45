/* From the command line to something that can be asked: model, scene, index, cullers, views. */
#ifndef SETUP_H
#define SETUP_H

#include "options.h"

typedef struct moving moving; /* moving.h */
typedef struct selection selection; /* selection.h */

typedef struct setup {
    model *model;
    umb_scene *scene;
    moving *moving;      /* with --moving, else NULL */
    selection *selection; /* with --only or --without, else NULL */
    umb_index *index;
    umb_culler *culler;  /* the method that was asked for */
    umb_culler *frustum; /* method none: what meets the frustum at all */
    umb_pool *pool;      /* NULL with one thread */
    umb_tasks tasks;
    umb_weld_stats weld;
    umb_error error;
    double load_ms, build_ms;
} setup;

/* Each returns EXIT_DONE, or another code with the message printed; end with setup_free either
 * way. */
int setup_model(setup *s, const options *o); /* the model only */
int setup_scene(setup *s, const options *o); /* with scene and index */
void setup_free(setup *s);

/* The views that the command line names: one from --eye and --target, or rows of a path. */
typedef struct views {
    camera_path path; /* one row when given by --eye and --target */
    uint32_t first, every, count;
    bool is_path; /* rows were asked for with --path */
} views;

/* Everything: scene, index, cullers and the views, each of which is checked. single: --row picks
 * one. Free with camera_path_free(&out->path) and setup_free. */
int setup_views(setup *s, const options *o, bool single, views *out);
/* Row of view k of the list. */
uint32_t setup_row(const views *v, uint32_t k);
/* View k of the list, in the model's coordinates. */
umb_view setup_view(const setup *s, const options *o, const views *v, uint32_t k);

/* The view that the options make of a row: eye and target in the file's coordinates. NULL, or what is
 * wrong with it, perhaps in *error; *out is then of no use. */
const char *setup_make_view(const model *m, const options *o, const double row[6], umb_view *out,
                            umb_error *error);

/* A point of the model in the file's coordinates. */
void setup_to_file(const model *m, const double in[3], double out[3]);

#endif

/* umbrage render: pictures of a view. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "frame.h"
#include "part_file.h"
#include "picture.h"
#include "progress.h"

static const struct {
    uint32_t bit;
    const char *name;
} kinds[] = {{PICTURE_EYE, "eye"},
             {PICTURE_IDS, "ids"},
             {PICTURE_OCCLUSION, "occlusion"},
             {PICTURE_MAP, "map"}};
enum { KIND_COUNT = sizeof kinds / sizeof kinds[0] };

/* What a picture is painted from. */
typedef struct easel {
    const setup *s;
    const options *o;
    umb_view view;
    truth *oracle;
    uint8_t *states;
} easel;

/* FILE for one picture; for several the kind goes before the ending. NULL: no memory. */
static char *file_name(const options *o, const char *kind)
{
    size_t length = strlen(o->output);
    char *name = malloc(length + strlen(kind) + 8);
    if (!name) {
        return NULL;
    }
    size_t stem = length > 4 && strcmp(o->output + length - 4, ".png") == 0 ? length - 4 : length;
    if (o->pictures == PICTURE_ALL) {
        snprintf(name, length + strlen(kind) + 8, "%.*s-%s.png", (int)stem, o->output, kind);
    } else {
        snprintf(name, length + 1, "%s", o->output);
    }
    return name;
}

static bool paint(const easel *e, uint32_t kind, bitmap *im)
{
    switch (kind) {
    case PICTURE_EYE:
        return picture_eye(im, e->s->model, e->oracle, &e->view);
    case PICTURE_IDS:
        return picture_ids(im, e->oracle, &e->view, e->states);
    case PICTURE_OCCLUSION:
        return picture_occlusion(im, e->s->model, e->s->culler, &e->view, NULL, 0);
    default:
        return picture_map(im, e->s->model, &e->view, e->states);
    }
}

static int paint_one(const easel *e, int k)
{
    const options *o = e->o;
    bitmap im = {0};
    char *name = file_name(o, kinds[k].name);
    int code = EXIT_DONE;
    if (!name || !bitmap_create(&im, o->width, o->height) || !paint(e, kinds[k].bit, &im)) {
        code = fail(o, EXIT_INPUT, "not enough memory for the picture");
    } else {
        code = part_file_picture(o, &im, name);
    }
    if (code == EXIT_DONE && !options_given(o, "json")) {
        printf("%s\n", name);
    }
    bitmap_free(&im);
    free(name);
    return code;
}

static int paint_all(const easel *e)
{
    int code = EXIT_DONE;
    uint32_t done = 0;
    progress p = progress_begin(e->o, "pictures", e->o->pictures == PICTURE_ALL ? KIND_COUNT : 1);
    for (int k = 0; code == EXIT_DONE && k < KIND_COUNT; ++k) {
        if (e->o->pictures & kinds[k].bit) {
            code = paint_one(e, k);
            progress_step(&p, ++done);
        }
    }
    progress_end(&p);
    return code;
}

static int report(const options *o)
{
    json_text j = {0};
    json_text_open(&j, NULL, '{');
    json_text_open(&j, "files", '[');
    for (int k = 0; k < KIND_COUNT; ++k) {
        if (o->pictures & kinds[k].bit) {
            char *name = file_name(o, kinds[k].name);
            json_text_string(&j, NULL, name);
            free(name);
        }
    }
    json_text_close(&j, ']');
    json_text_close(&j, '}');
    return part_file_print(o, &j);
}

/* The method's answer, and the oracle where a picture needs rays. */
static int prepare(easel *e)
{
    const options *o = e->o;
    const model *m = e->s->model;
    umb_visible_set set;
    umb_error error = {0};
    frame f;
    int code = frame_answer(e->s, o, &e->view, false, &f, &set);
    if (code != EXIT_DONE) {
        return code;
    }
    e->states = malloc((size_t)m->object_count + 1);
    if (!e->states) {
        return fail(o, EXIT_INPUT, "not enough memory");
    }
    if (options_given(o, "up")) {
        memcpy(e->s->model->up, o->up, sizeof o->up);
    }
    picture_states(m, &e->view, set.objects, set.count, e->states);
    if (o->pictures & (PICTURE_EYE | PICTURE_IDS)) {
        e->oracle = truth_create(m, &error);
        if (!e->oracle) {
            return fail(o, EXIT_INPUT, "the oracle: %s", error.text);
        }
    }
    return EXIT_DONE;
}

int cmd_render(const options *o)
{
    setup s;
    views v;
    if (!o->output) {
        return fail(o, EXIT_USAGE, "needs a file to write: -o FILE.png");
    }
    int code = setup_views(&s, o, true, &v);
    easel e = {.s = &s, .o = o};
    if (code == EXIT_DONE) {
        e.view = setup_view(&s, o, &v, 0);
        code = prepare(&e);
    }
    if (code == EXIT_DONE) {
        code = paint_all(&e);
    }
    if (code == EXIT_DONE && options_given(o, "json")) {
        code = report(o);
    }
    truth_destroy(e.oracle);
    free(e.states);
    camera_path_free(&v.path);
    setup_free(&s);
    return code;
}

#include "real_scenes.h"

#include <dirent.h>
#include <float.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
#define MAX_NAME 1024

static bool fail(umb_error *error, const char *what, const char *why)
{
    error->code = UMB_ERROR_FORMAT;
    (void)snprintf(error->text, sizeof error->text, "%.150s: %.80s", what, why);
    return false;
}

static char *copy_text(const char *text)
{
    char *copy = malloc(strlen(text) + 1);
    if (copy != NULL) {
        memcpy(copy, text, strlen(text) + 1);
    }
    return copy;
}

static bool ends_with(const char *text, const char *end)
{
    size_t n = strlen(text), k = strlen(end);
    return n >= k && strcmp(text + n - k, end) == 0;
}

static bool read_numbers(const json_t *root, const char *key, double *out, size_t count)
{
    const json_t *list = json_object_get(root, key);
    if (json_array_size(list) != count) {
        return false;
    }
    for (size_t i = 0; i < count; ++i) {
        const json_t *number = json_array_get(list, i);
        if (!json_is_number(number)) {
            return false;
        }
        out[i] = json_number_value(number);
    }
    return true;
}

static bool describe(const char *file, real_scene *s, umb_error *error)
{
    json_error_t why;
    json_t *root = json_load_file(file, 0, &why);
    if (root == NULL) {
        return fail(error, file, why.text);
    }
    double box[6];
    const json_t *fov = json_object_get(root, "fov_y_deg"),
                 *nasty = json_object_get(root, "nasty_from");
    const json_t *near_depth = json_object_get(root, "near");
    bool ok = read_numbers(root, "up", s->up, 3) && read_numbers(root, "walk_box", box, 6) &&
              json_is_number(fov) && json_is_number(near_depth) && json_is_integer(nasty);
    if (ok) {
        s->fov_y = json_number_value(fov) * (PI / 180.0);
        s->near_depth = json_number_value(near_depth);
        s->nasty_from = (uint32_t)json_integer_value(nasty);
        s->ortho_height = (box[3] - box[0]) / 4;
    }
    json_decref(root);
    return ok || fail(error, file, "up, fov_y_deg, near, walk_box or nasty_from is missing");
}

/* The scene is the file of the same name that is no path. */
static bool find_file(const char *folder, const char *base, char *out)
{
    DIR *d = opendir(folder);
    size_t n = strlen(base);
    bool found = false;
    for (struct dirent *e; d != NULL && !found && (e = readdir(d)) != NULL;) {
        found = strncmp(e->d_name, base, n) == 0 && e->d_name[n] == '.' &&
                strncmp(e->d_name + n, ".path.", 6) != 0;
        if (found) {
            (void)snprintf(out, MAX_NAME, "%s/%s", folder, e->d_name);
        }
    }
    if (d != NULL) {
        (void)closedir(d);
    }
    return found;
}

static bool add_scene(real_scenes *all, const char *folder, const char *path_name, umb_error *error)
{
    char base[256], text[MAX_NAME], file[MAX_NAME];
    real_scene s = {0};
    (void)snprintf(base, sizeof base, "%.*s", (int)(strlen(path_name) - strlen(".path.csv")),
                   path_name);
    (void)snprintf(s.name, sizeof s.name, "%.63s", base);
    (void)snprintf(text, sizeof text, "%s/%s.path.json", folder, base);
    if (!describe(text, &s, error)) {
        return false;
    }
    if (!find_file(folder, base, file)) {
        return fail(error, text, "no scene of this name beside it");
    }
    (void)snprintf(text, sizeof text, "%s/%s", folder, path_name);
    real_scene *more = realloc(all->scenes, (all->count + 1) * sizeof *more);
    if (more == NULL) {
        return fail(error, file, "no memory");
    }
    all->scenes = more;
    s.level = ends_with(file, ".bsp");
    s.file = copy_text(file);
    s.path = copy_text(text);
    more[all->count++] = s;
    return (s.file != NULL && s.path != NULL) || fail(error, file, "no memory");
}

static bool look_into(real_scenes *all, const char *folder, umb_error *error)
{
    DIR *d = opendir(folder);
    bool ok = true;
    for (struct dirent *e; d != NULL && ok && (e = readdir(d)) != NULL;) {
        if (ends_with(e->d_name, ".path.csv")) {
            ok = add_scene(all, folder, e->d_name, error);
        }
    }
    if (d != NULL) {
        (void)closedir(d);
    }
    return ok;
}

static int by_path(const void *a, const void *b)
{
    return strcmp(((const real_scene *)a)->path, ((const real_scene *)b)->path);
}

bool real_scenes_find(const char *folder, real_scenes *out, umb_error *error)
{
    *out = (real_scenes){0};
    DIR *d = opendir(folder);
    if (d == NULL) {
        return fail(error, folder, "cannot be opened; UMBRAGE_SCENES names a folder");
    }
    bool ok = look_into(out, folder, error);
    for (struct dirent *e; ok && (e = readdir(d)) != NULL;) {
        char below[MAX_NAME];
        if (e->d_name[0] != '.') {
            (void)snprintf(below, sizeof below, "%.700s/%s", folder, e->d_name);
            ok = look_into(out, below, error);
        }
    }
    (void)closedir(d);
    if (ok && out->count > 0) {
        qsort(out->scenes, out->count, sizeof *out->scenes, by_path);
    }
    if (!ok) {
        real_scenes_free(out);
    }
    return ok;
}

void real_scenes_free(real_scenes *s)
{
    for (uint32_t i = 0; i < s->count; ++i) {
        free(s->scenes[i].file);
        free(s->scenes[i].path);
    }
    free(s->scenes);
    *s = (real_scenes){0};
}

/* Sixteen epsilons more than the roundings of the sum, the root and of forward. */
double real_scene_far(const model *m, const double eye[3], double near_depth)
{
    double square = 0.0;
    for (int i = 0; i < 3; ++i) {
        double reach = fmax(fabs((double)m->bounds.min[i] - eye[i]),
                            fabs((double)m->bounds.max[i] - eye[i]));
        square += reach * reach;
    }
    double distance = sqrt(square) * (1.0 + 16.0 * DBL_EPSILON);
    return distance > near_depth ? distance : near_depth + 1.0;
}

bool real_scene_view(const real_scene *s, const model *m, const double row[6], bool ortho,
                     umb_view *out)
{
    double eye[3], target[3];
    for (int i = 0; i < 3; ++i) {
        eye[i] = row[i] - m->origin[i];
        target[i] = row[i + 3] - m->origin[i];
    }
    double far_depth = real_scene_far(m, eye, s->near_depth);
    return (ortho ? umb_view_look_at_ortho(out, eye, target, s->up, s->ortho_height, 2.0,
                                           s->near_depth, far_depth)
                  : umb_view_look_at(out, eye, target, s->up, s->fov_y, 2.0, s->near_depth,
                                     far_depth)) == UMB_OK;
}

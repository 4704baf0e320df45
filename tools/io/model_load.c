/* From a name to a model: which reader, which generator. */
#include <string.h>

#include "generate.h"
#include "input.h"
#include "model_parts.h"
#include "readers.h"

/* Quake maps tell their kind by their first four bytes. */
static model *read_bsp(const input *in, const char *name, const model_options *options,
                       umb_error *error)
{
    static const uint8_t quake3[4] = {'I', 'B', 'S', 'P'};
    static const uint8_t quake1[4] = {29, 0, 0, 0};
    if (in->size >= 4 && memcmp(in->data, quake3, 4) == 0) {
        return read_q3bsp(in->data, in->size, name, options, error);
    }
    if (in->size >= 4 && memcmp(in->data, quake1, 4) == 0) {
        return read_q1bsp(in->data, in->size, name, options, error);
    }
    model_fail(error, UMB_ERROR_FORMAT,
               "%s: at byte 0: neither IBSP (Quake 3) nor version 29 (Quake); use another map",
               name);
    return NULL;
}

static model *load_bytes(const char *scene, const model_options *options, umb_error *error)
{
    input in;
    if (!input_read(scene, &in, error)) {
        return NULL;
    }
    model *m = input_ends_with(scene, ".bsp")
                   ? read_bsp(&in, scene, options, error)
                   : read_cityjson(in.data, in.size, scene, options, error);
    input_free(&in);
    return m;
}

static model *load_packed(const char *scene, const char *colon, const model_options *options,
                          umb_error *error)
{
    char archive[4096];
    size_t length = colon != NULL ? (size_t)(colon - scene) : strlen(scene);
    if (length >= sizeof archive) {
        model_fail(error, UMB_ERROR_ARGUMENT, "the archive's name is too long; use a shorter path");
        return NULL;
    }
    memcpy(archive, scene, length);
    archive[length] = '\0';
    input in;
    if (!input_read_packed(archive, colon != NULL ? colon + 1 : NULL, &in, error)) {
        return NULL;
    }
    model *m = read_bsp(&in, scene, options, error);
    input_free(&in);
    return m;
}

model *model_load(const char *scene, const model_options *options, umb_error *error)
{
    static const model_options defaults;
    options = options != NULL ? options : &defaults;
    if (strncmp(scene, "gen:", 4) == 0) {
        return generate_model(scene, options, error);
    }
    const char *colon = input_packed_name(scene);
    if (colon != NULL || input_ends_with(scene, ".pk3")) {
        return load_packed(scene, colon, options, error);
    }
    if (input_ends_with(scene, ".bsp") || input_ends_with(scene, ".json")) {
        return load_bytes(scene, options, error);
    }
    return read_assimp(scene, options, error);
}

/* One reader a format. Each makes a finished model, or returns NULL with one line in error. */
#ifndef READERS_H
#define READERS_H

#include "model.h"

/* What name stands for in error texts; data and size hold the whole file. */
model *read_q3bsp(const uint8_t *data, size_t size, const char *name, const model_options *options,
                  umb_error *error);
model *read_q1bsp(const uint8_t *data, size_t size, const char *name, const model_options *options,
                  umb_error *error);
model *read_cityjson(const uint8_t *data, size_t size, const char *name,
                     const model_options *options, umb_error *error);
/* By file name: the importer looks for material libraries beside the scene. */
model *read_assimp(const char *path, const model_options *options, umb_error *error);

/* A path's text, name for error texts. */
bool read_camera_path(const char *text, size_t size, const char *name, camera_path *out,
                      umb_error *error);

#endif

/* Scenes and camera paths made from a seed: `gen:NAME,key=value,...`. */
#ifndef GENERATE_H
#define GENERATE_H

#include "model.h"

/* Make the scene that spec names; options as for model_load, may be NULL. Numbers may carry k or M.
 * On failure returns NULL and error holds one line that lists what there is. */
model *generate_model(const char *spec, const model_options *options, umb_error *error);

/* The scene's own camera path, from the same spec. Free with camera_path_free. */
bool generate_path(const char *spec, camera_path *out, umb_error *error);

#endif

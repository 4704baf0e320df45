/* What the files of the model and its readers share among themselves. */
#ifndef MODEL_PARTS_H
#define MODEL_PARTS_H

#include "model.h"

/* Fill in error, if there is one, and return false: `return model_fail(error, ...)`. */
bool model_fail(umb_error *error, umb_result code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* The same for what always reads alike: "SCENE: out of memory". */
bool model_fail_memory(umb_error *error, const char *scene);

/* Drops triangles that name vertices that are not there or not finite, then vertices that no
 * triangle uses, then meshes and links to meshes without triangles. */
bool model_clean(model *m);

/* Rebasing. Axes on which the box lies far from the origin (its centre farther than eight times
 * the scene's extent) get an origin near the centre, the others 0. The offset is a multiple of
 * the float step at the box's far end and of a power of two near an eighth of the extent, so
 * every float coordinate in the box minus the offset is a float again (both lie within a factor
 * of two). */
void model_choose_origin(const double min[3], const double max[3], double origin[3]);
/* Rebase a model of floats, if that can be done exactly for every mesh and transform. False: no
 * memory. */
bool model_rebase(model *m);

/* Count everything of model_faults but non_finite, bad_indices and empty_objects. False: no
 * memory. */
bool model_count_faults(model *m);

/* Cut meshes of more than limit triangles, objects numbered in place. False: no memory. */
bool model_split(model *m, uint32_t limit);

/* Exactly zero area, decided without rounding. Finite input. */
bool model_zero_area(const float a[3], const float b[3], const float c[3]);

#endif

/* Scenes with a planted mistake: a culler that looks at one must be caught by the oracle, which
 * looks at the true model. */
#ifndef PLANTED_H
#define PLANTED_H

#include "io/model.h"

typedef enum plant { PLANT_NONE, PLANT_SMALL_OBJECTS, PLANT_LARGE_OCCLUDERS, PLANT_COUNT } plant;

/* For people: "no mistake", "objects shrunk by 1%", "occluders inflated by 1%". */
const char *plant_name(plant what);

/* Each object of the model twice: numbered as in the model what is tested and never hides, after
 * those what hides. Either can have its mistake. NULL when memory is short. */
umb_scene *planted_scene(const model *m, plant what, bool weld);
/* Of an answer's ids those of the model's objects, in their order; returns how many. out has room
 * for all of the answer's. */
uint32_t planted_answer(const umb_visible_set *seen, uint32_t objects, uint32_t *out);

#endif

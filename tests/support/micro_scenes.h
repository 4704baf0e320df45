/* Small scenes meant to break a culler, from a seed: random and adversarial by turns. Tests and the
 * soak run share them, so that a failing seed can be looked at. */
#ifndef MICRO_SCENES_H
#define MICRO_SCENES_H

#include "io/model.h"

typedef struct micro_scene {
    model *model;
    umb_view view;
    const char *kind;
    bool weld;
} micro_scene;

/* Number of kinds; scene i is of kind i % count. */
uint32_t micro_scene_kinds(void);
/* Make scene number i. False when memory is short. */
bool micro_scene_make(uint64_t i, micro_scene *out);
void micro_scene_free(micro_scene *s);

#endif

/* Test programs over the real scenes of UMBRAGE_SCENES. */
#ifndef SCENE_TESTS_H
#define SCENE_TESTS_H

#include "real_scenes.h"

/* [PART PARTS [NAME]]: every PARTS-th scene from PART on, so that parts run side by side, of those whose name contains NAME. */
void scene_tests_arguments(int argc, char **argv);
/* Check these. Fails, as cmocka does, unless all checks return 0, the number of objects wrongly hidden; skips without scenes. */
void scene_tests_run(uint64_t (*check)(const real_scene *scene));

/* A sum over so many views, a view; 0 for none. */
double scene_tests_mean(uint64_t sum, uint64_t count);

#endif

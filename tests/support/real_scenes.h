/* The real scenes of UMBRAGE_SCENES: each a file with NAME.path.csv and NAME.path.json beside it.
 * Tests and the soak run look at them the way the command line does. */
#ifndef REAL_SCENES_H
#define REAL_SCENES_H

#include "io/model.h"

typedef struct real_scene {
    char *file; /* what model_load takes */
    char *path; /* what camera_path_load takes */
    char name[64];
    double up[3], fov_y, near_depth; /* fov_y in radians */
    double ortho_height;             /* for parallel views: a quarter of the walked width */
    uint32_t nasty_from;             /* rows from here on are nasty eyes */
    bool level;                      /* a game level: Quake or Quake 3 BSP */
} real_scene;

typedef struct real_scenes {
    real_scene *scenes; /* by path name */
    uint32_t count;
} real_scenes;

/* All scenes below folder. False with one line in error when a description cannot be read. */
bool real_scenes_find(const char *folder, real_scenes *out, umb_error *error);
void real_scenes_free(real_scenes *s);

/* The view of a path's row, as the command line makes it: far is the scene's farthest corner. */
bool real_scene_view(const real_scene *s, const model *m, const double row[6], bool ortho,
                     umb_view *out);
/* Nothing of the model is deeper than this, seen from eye. */
double real_scene_far(const model *m, const double eye[3], double near_depth);

#endif

/* The views of a comparison: 16:9, 60 degrees high, near 0.1, far 2000 unless a scene says otherwise. */
#ifndef CAMERAS_H
#define CAMERAS_H

#include "world.h"

typedef struct cameras {
    char name[48];   /* as tables call them: "recipe", "walking", ... */
    char about[160]; /* one line for people */
    umb_view *views;
    uint32_t count;
} cameras;

typedef struct camera_turn {
    double pitch, roll; /* degrees; pitch up is positive */
    double height;      /* of the eye along the scene's up; 0: as the path has it */
} camera_turn;

/* Every every-th row of a path, turned. lens: NULL, or the .path.json beside the path, which gives the
 * field of view and the depths. */
bool cameras_path(cameras *c, const world *w, const char *name, const char *path, const char *lens,
                  uint32_t every, uint32_t last, camera_turn turn, umb_error *error);

/* count frames at 60 a second along the eyes of a path at speed metres a second, looking ahead and about;
 * speed 0: jumps all over it. */
bool cameras_motion(cameras *c, const world *w, const char *name, const char *path, double speed,
                    uint32_t count, umb_error *error);

void cameras_free(cameras *c);

#endif

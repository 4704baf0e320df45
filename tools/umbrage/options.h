/* The command line: one table of options, which subcommands take them, and what they say. */
#ifndef OPTIONS_H
#define OPTIONS_H

#include "io/model.h"
#include "umbrage/light.h"

/* Exit codes (docs/umbrage.1). */
enum {
    EXIT_DONE = 0,
    EXIT_CHECK = 1, /* something visible was hidden, answers differ */
    EXIT_USAGE = 2, /* unknown name, impossible view */
    EXIT_INPUT = 3, /* an input cannot be read, an output cannot be written */
    EXIT_INTERRUPTED = 4
};

/* What `render --what` paints. */
enum {
    PICTURE_EYE = 1u << 0,
    PICTURE_IDS = 1u << 1,
    PICTURE_OCCLUSION = 1u << 2,
    PICTURE_MAP = 1u << 3,
    PICTURE_ALL = 15u
};

/* Everything that can be said on the command line. given has a bit for each option of the table
 * that was used: see options_given(). */
typedef struct options {
    const char *command; /* the subcommand's name, for messages */
    const char *input;   /* the one argument that is no option; NULL when there is none */
    uint64_t given;

    model_options model;
    const char *seed; /* digits, or NULL */
    const char *path, *output, *capture;
    const char *only, *without; /* lists of objects; NULL: not given */

    double eye[3], target[3], up[3];
    double fov, ortho_height, near_depth, far_depth, min_pixels;
    double spot, sun[3], slice[2], reach; /* degrees; direction; depths; towards the light */
    umb_cube_face cube;
    double planes[UMB_MAX_CLIP_PLANES][4]; /* in the file's coordinates */
    uint32_t plane_count;
    uint32_t width, height, buffer_width, buffer_height;
    uint32_t row, from, to, every;
    double moving[2], step; /* share of the objects, speed; seconds from row to row */

    umb_method method;
    umb_index_def index;
    umb_index_update update; /* index.update too, once all is read */
    umb_isa isa;
    uint32_t coherence, occluder_budget; /* umb_culler_def */
    uint32_t threads, repeat;

    double cell[6], outer; /* region: X0,Y0,Z0,X1,Y1,Z1 in the file's coordinates */
    uint32_t resolution, umbrae;

    uint32_t grid_width, grid_height;
    uint64_t rays;
    uint32_t object;
    uint32_t pictures;
} options;

/* A subcommand. Its place in the list of main.c is the bit that the option table knows it by. */
typedef struct command {
    const char *name;
    const char *input; /* what its argument is called: "SCENE" */
    const char *usage; /* what usually follows it */
    const char *summary;
    int (*run)(const options *o);
} command;

enum {
    COMMAND_INFO,
    COMMAND_CULL,
    COMMAND_WALK,
    COMMAND_CHECK,
    COMMAND_EXPLAIN,
    COMMAND_RENDER,
    COMMAND_GENERATE,
    COMMAND_REPLAY,
    COMMAND_REGION,
    COMMAND_COUNT
};

int cmd_info(const options *o);
int cmd_cull(const options *o);
int cmd_walk(const options *o);
int cmd_check(const options *o);
int cmd_explain(const options *o);
int cmd_render(const options *o);
int cmd_generate(const options *o);
int cmd_replay(const options *o);
int cmd_region(const options *o);

/* Read the words after the subcommand. EXIT_DONE, or EXIT_USAGE with the message printed. *help is
 * set when help was asked for; nothing else is meaningful then. */
int options_read(const command *c, int which, int count, char **words, options *out, bool *help);
/* True if the option of that name (without dashes) was used. */
bool options_given(const options *o, const char *name);
/* The subcommand's help, on standard output. */
void options_help(const command *c, int which);

/* "umbrage cull: text" on standard error; returns code. */
int fail(const options *o, int code, const char *format, ...) __attribute__((format(printf, 3, 4)));

#endif

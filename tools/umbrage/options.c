#include "options.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define BIT(command) (1u << COMMAND_##command)

enum {
    ALL = (1u << COMMAND_COUNT) - 1,
    ONE_VIEW = BIT(CULL) | BIT(EXPLAIN) | BIT(RENDER),
    MANY_VIEWS = BIT(WALK) | BIT(CHECK),
    VIEWS = ONE_VIEW | MANY_VIEWS,
    SCENES = BIT(INFO) | VIEWS | BIT(REGION)
};

/* ---- values --------------------------------------------------------------------------------- */
/* Each reader returns NULL, or what it had wanted to read. */

static bool read_number(const char *text, const char **end, double *out)
{
    char *stop;
    size_t span = strspn(
        text, "+-.0123456789eE"); /* strtod also takes blanks, hexadecimal digits, words */
    if (span == 0) {
        return false;
    }
    *out = strtod(text, &stop);
    *end = stop;
    return stop != text && (size_t)(stop - text) <= span && isfinite(*out);
}

static const char *number(const char *text, double *out)
{
    const char *end;
    return read_number(text, &end, out) && *end == '\0' ? NULL : "a number";
}

/* Numbers with commas between them. */
static bool numbers(const char *text, int how_many, double *out)
{
    for (int i = 0; i < how_many; ++i) {
        if (!read_number(text, &text, &out[i]) || *text != (i < how_many - 1 ? ',' : '\0')) {
            return false;
        }
        ++text;
    }
    return true;
}

static const char *point(const char *text, double out[3])
{
    return numbers(text, 3, out) ? NULL : "three numbers X,Y,Z";
}

/* Digits, perhaps k or M. */
static bool whole(const char *text, uint64_t max, uint64_t *out)
{
    uint64_t value = 0;
    if (*text < '0' || *text > '9') {
        return false;
    }
    for (; *text >= '0' && *text <= '9'; ++text) {
        uint64_t digit = (uint64_t)(*text - '0');
        if (value > (UINT64_MAX - digit) / 10) {
            return false;
        }
        value = value * 10 + digit;
    }
    uint64_t scale = *text == 'k' ? 1000 : *text == 'M' ? 1000000 : 1;
    text += scale > 1 ? 1 : 0;
    *out = value <= UINT64_MAX / scale ? value * scale : UINT64_MAX;
    return *text == '\0' && *out <= max;
}

static bool count(const char *text, uint32_t min, uint32_t max, uint32_t *out)
{
    uint64_t value;
    if (!whole(text, max, &value) || value < min) {
        return false;
    }
    *out = (uint32_t)value;
    return true;
}

static bool size(const char *text, uint32_t max, uint32_t *width, uint32_t *height)
{
    char first[16];
    const char *cross = strchr(text, 'x');
    size_t length = cross ? (size_t)(cross - text) : sizeof first;
    if (length >= sizeof first) {
        return false;
    }
    memcpy(first, text, length);
    first[length] = '\0';
    return count(first, 1, max, width) && count(cross + 1, 1, max, height);
}

static const char *read_eye(options *o, const char *text)
{
    return point(text, o->eye);
}

static const char *read_target(options *o, const char *text)
{
    return point(text, o->target);
}

static const char *read_up(options *o, const char *text)
{
    static const char axes[] = "xyz";
    const char *axis = strlen(text) == 1 ? strchr(axes, text[0]) : NULL;
    if (axis) {
        o->up[0] = o->up[1] = o->up[2] = 0.0;
        o->up[axis - axes] = 1.0;
        return NULL;
    }
    if (point(text, o->up) || (o->up[0] == 0.0 && o->up[1] == 0.0 && o->up[2] == 0.0)) {
        return "x, y, z or three numbers X,Y,Z that are not all zero";
    }
    return NULL;
}

static const char *read_fov(options *o, const char *text)
{
    return number(text, &o->fov) || !(o->fov > 0.0 && o->fov < 180.0) ? "degrees between 0 and 180"
                                                                      : NULL;
}

static const char *read_ortho(options *o, const char *text)
{
    return number(text, &o->ortho_height) || !(o->ortho_height > 0.0) ? "a height above 0" : NULL;
}

static const char *read_spot(options *o, const char *text)
{
    return number(text, &o->spot) || !(o->spot > 0.0 && o->spot < 180.0)
               ? "degrees between 0 and 180"
               : NULL;
}

static const char *read_cube(options *o, const char *text)
{
    static const char *const names[] = {"+x", "-x", "+y", "-y", "+z", "-z"};
    for (int i = 0; i < 6; ++i) {
        if (strcmp(text, names[i]) == 0) {
            o->cube = (umb_cube_face)i;
            return NULL;
        }
    }
    return "one of +x, -x, +y, -y, +z, -z";
}

static const char *read_sun(options *o, const char *text)
{
    return point(text, o->sun) || (o->sun[0] == 0.0 && o->sun[1] == 0.0 && o->sun[2] == 0.0)
               ? "three numbers X,Y,Z that are not all zero"
               : NULL;
}

static const char *read_slice(options *o, const char *text)
{
    return numbers(text, 2, o->slice) && o->slice[0] < o->slice[1] ? NULL
                                                                   : "two depths A,B, A below B";
}

static const char *read_reach(options *o, const char *text)
{
    return number(text, &o->reach) || !(o->reach >= 0.0) ? "a distance from 0" : NULL;
}

/* Each one given is another plane. */
static const char *read_plane(options *o, const char *text)
{
    if (o->plane_count == UMB_MAX_CLIP_PLANES) {
        return "no more than 10 planes";
    }
    double *p = o->planes[o->plane_count];
    if (!numbers(text, 4, p) || (p[0] == 0.0 && p[1] == 0.0 && p[2] == 0.0)) {
        return "four numbers A,B,C,D, the first three not all zero";
    }
    o->plane_count++;
    return NULL;
}

static const char *read_size(options *o, const char *text)
{
    return size(text, 32768, &o->width, &o->height) ? NULL : "WxH, both from 1 to 32768";
}

static const char *read_near(options *o, const char *text)
{
    return number(text, &o->near_depth);
}

static const char *read_far(options *o, const char *text)
{
    if (strcmp(text, "inf") == 0) {
        o->far_depth = INFINITY;
        return NULL;
    }
    return number(text, &o->far_depth) ? "a number, or inf" : NULL;
}

static const char *read_path(options *o, const char *text)
{
    o->path = text;
    return *text ? NULL : "a file or gen:NAME,key=value";
}

static const char *read_row(options *o, const char *text)
{
    return count(text, 0, UINT32_MAX - 1, &o->row) ? NULL : "a row number, from 0";
}

static const char *read_from(options *o, const char *text)
{
    return count(text, 0, UINT32_MAX - 1, &o->from) ? NULL : "a row number, from 0";
}

static const char *read_to(options *o, const char *text)
{
    return count(text, 0, UINT32_MAX - 1, &o->to) ? NULL : "a row number, from 0";
}

static const char *read_every(options *o, const char *text)
{
    return count(text, 1, UINT32_MAX - 1, &o->every) ? NULL : "a whole number from 1";
}

static const char *read_moving(options *o, const char *text)
{
    return numbers(text, 2, o->moving) && o->moving[0] >= 0.0 && o->moving[0] <= 1.0 && o->moving[1] > 0.0
               ? NULL
               : "a share from 0 to 1 and a speed above 0: 0.1,3";
}

static const char *read_step(options *o, const char *text)
{
    return number(text, &o->step) || !(o->step > 0.0) ? "seconds above 0" : NULL;
}

static const char *read_method(options *o, const char *text)
{
    for (int m = UMB_METHOD_RASTER; m <= UMB_METHOD_OCCLUSION_TREE; ++m) {
        if (strcmp(text, umb_method_name((umb_method)m)) == 0) {
            o->method = (umb_method)m;
            return NULL;
        }
    }
    return "one of raster, none, planes, shadow-frusta, occlusion-tree";
}

static const char *read_index(options *o, const char *text)
{
    static char names[320];
    if (umb_index_parse(text, &o->index)) {
        return NULL;
    }
    size_t used = (size_t)snprintf(names, sizeof names, "one of"), kind = strcspn(text, ","), listed = 0;
    for (int round = 0; round < 2 && listed == 0; ++round) { /* of a known kind all there are, else the plain ones */
        const char *name;
        for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL && used < sizeof names; ++k) {
            bool own = strcspn(name, ",") == kind && strncmp(name, text, kind) == 0;
            if (round == 0 ? own : strchr(name, ',') == NULL) {
                used += (size_t)snprintf(names + used, sizeof names - used, "%s %s", listed++ > 0 ? ";" : "", name);
            }
        }
    }
    return names;
}

static const char *read_update(options *o, const char *text)
{
    return umb_index_update_parse(text, &o->update)
               ? NULL
               : "one of default, refit, delete-insert, lca, lazy, deepest, incremental, overlapping";
}

static const char *read_isa(options *o, const char *text)
{
    static const char *const names[] = {"auto", "scalar", "sse4", "avx2", "neon"};
    for (int i = 0; i < 5; ++i) {
        if (strcmp(text, names[i]) == 0) {
            o->isa = (umb_isa)i;
            return umb_isa_available(o->isa) ? NULL
                                             : "another: this machine or build does not have it";
        }
    }
    return "one of auto, scalar, sse4, avx2, neon";
}

/* Names with commas between them. */
static const char *read_coherence(options *o, const char *text)
{
    static const struct {
        const char *name;
        uint32_t bits;
    } names[] = {{"none", 0},
                 {"list", UMB_COHERENCE_LIST},
                 {"hierarchy", UMB_COHERENCE_HIERARCHY},
                 {"propagation", UMB_COHERENCE_PROPAGATION},
                 {"conservative", UMB_COHERENCE_CONSERVATIVE},
                 {"rest", UMB_COHERENCE_REST},
                 {"planes", UMB_COHERENCE_PLANES},
                 {"leaves", UMB_COHERENCE_LEAVES},
                 {"all", UMB_COHERENCE_ALL}};
    for (;;) {
        size_t length = strcspn(text, ","), i = 0;
        while (i < sizeof names / sizeof names[0] &&
               (strlen(names[i].name) != length || memcmp(names[i].name, text, length) != 0)) {
            ++i;
        }
        if (i == sizeof names / sizeof names[0]) {
            return "none, all, or some of list, hierarchy, propagation, conservative, rest, planes, leaves, with commas";
        }
        o->coherence |= names[i].bits;
        if (text[length] == '\0') {
            return NULL;
        }
        text += length + 1;
    }
}

static const char *read_budget(options *o, const char *text)
{
    return count(text, 1, UINT32_MAX, &o->occluder_budget) ? NULL : "a whole number from 1";
}

static const char *read_threads(options *o, const char *text)
{
    return count(text, 1, 256, &o->threads) ? NULL : "a whole number from 1 to 256";
}

static const char *read_buffer(options *o, const char *text)
{
    return size(text, 8192, &o->buffer_width, &o->buffer_height) ? NULL : "WxH, both from 1 to 8192";
}

static const char *read_min_pixels(options *o, const char *text)
{
    return number(text, &o->min_pixels) || !(o->min_pixels >= 0.0) ? "a number from 0" : NULL;
}

static const char *read_split(options *o, const char *text)
{
    return count(text, 1, 1u << 30, &o->model.split) ? NULL : "a number of triangles from 1";
}

static const char *read_two_sided(options *o, const char *text)
{
    (void)text;
    o->model.two_sided = true;
    return NULL;
}

static const char *read_sky(options *o, const char *text)
{
    (void)text;
    o->model.sky = true;
    return NULL;
}

static const char *read_seed(options *o, const char *text)
{
    uint32_t value;
    o->seed = text;
    return count(text, 0, UINT32_MAX, &value) ? NULL : "a whole number from 0 to 4294967295";
}

static const char *read_repeat(options *o, const char *text)
{
    return count(text, 1, 100000, &o->repeat) ? NULL : "a whole number from 1 to 100000";
}

static const char *read_capture(options *o, const char *text)
{
    o->capture = text;
    return *text ? NULL : "a file name";
}

static const char *read_grid(options *o, const char *text)
{
    return size(text, 32768, &o->grid_width, &o->grid_height) ? NULL : "WxH, both from 1 to 32768";
}

static const char *read_rays(options *o, const char *text)
{
    bool none = strcmp(o->command, "region") == 0; /* may cast none */
    if (whole(text, (uint64_t)1 << 40, &o->rays) && (o->rays > 0 || none)) {
        return NULL;
    }
    return none ? "a number of rays" : "a number of rays from 1";
}

static const char *read_only(options *o, const char *text)
{
    o->only = text;
    return *text ? NULL : "numbers of objects and ranges of them: 3,17,40-60";
}

static const char *read_without(options *o, const char *text)
{
    o->without = text;
    return *text ? NULL : "numbers of objects and ranges of them: 3,17,40-60";
}

static const char *read_object(options *o, const char *text)
{
    return count(text, 0, UINT32_MAX - 1, &o->object) ? NULL : "an object's number, from 0";
}

static const char *read_output(options *o, const char *text)
{
    o->output = text;
    return *text ? NULL : "a file name";
}

static const char *read_what(options *o, const char *text)
{
    static const struct {
        const char *name;
        uint32_t pictures;
    } kinds[] = {{"eye", PICTURE_EYE},
                 {"ids", PICTURE_IDS},
                 {"occlusion", PICTURE_OCCLUSION},
                 {"map", PICTURE_MAP},
                 {"all", PICTURE_ALL}};
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; ++i) {
        if (strcmp(text, kinds[i].name) == 0) {
            o->pictures = kinds[i].pictures;
            return NULL;
        }
    }
    return "one of eye, ids, occlusion, map, all";
}

static const char *read_cell(options *o, const char *text)
{
    return numbers(text, 6, o->cell) ? NULL : "six numbers X0,Y0,Z0,X1,Y1,Z1";
}

static const char *read_resolution(options *o, const char *text)
{
    return count(text, 64, 2048, &o->resolution) ? NULL : "64 to 2048";
}

static const char *read_umbrae(options *o, const char *text)
{
    return count(text, 1, 8, &o->umbrae) ? NULL : "1 to 8";
}

static const char *read_outer(options *o, const char *text)
{
    return number(text, &o->outer) || !(o->outer > 1.0 && o->outer <= 1e6) ? "a number above 1" : NULL;
}

/* Only that it was given matters. */
static const char *read_flag(options *o, const char *text)
{
    (void)o;
    (void)text;
    return NULL;
}

/* ---- the table ------------------------------------------------------------------------------ */

typedef struct option_spec {
    const char *name;
    char letter;       /* 0: none */
    uint32_t commands; /* who takes it */
    const char *value; /* NULL: takes none */
    const char *(*read)(options *o, const char *text);
    const char *help;
} option_spec;

static const option_spec specs[] = {
    {"eye", 0, VIEWS & ~BIT(WALK), "X,Y,Z", read_eye, "where the eye is, in the file's coordinates"},
    {"target", 0, VIEWS & ~BIT(WALK), "X,Y,Z", read_target, "what it looks at"},
    {"path", 0, VIEWS, "FILE", read_path, "views from a CSV file or a generator: gen:NAME,key=value"},
    {"row", 0, ONE_VIEW, "N", read_row, "which row of the path is the view (default 0)"},
    {"from", 0, MANY_VIEWS, "N", read_from, "first row of the path (default 0)"},
    {"to", 0, MANY_VIEWS, "N", read_to, "last row of the path, included (default: its end)"},
    {"every", 0, MANY_VIEWS, "N", read_every, "take every N-th row only (default 1)"},
    {"cell", 0, BIT(REGION), "X0,Y0,Z0,X1,Y1,Z1", read_cell, "the view cell, in the file's coordinates"},
    {"resolution", 0, BIT(REGION), "N", read_resolution, "pixels along a side of the occlusion maps (default 512)"},
    {"umbrae", 0, BIT(REGION), "K", read_umbrae, "intervals kept a direction, 1 to 8 (default 2; all round: 8)"},
    {"outer", 0, BIT(REGION), "R", read_outer, "rays by two squares, the outer R times the inner (default: slabs)"},
    {"half-umbra", 0, BIT(REGION), NULL, read_flag, "only what stands on the ground hides, and only its top counts"},
    {"maps-only", 0, BIT(REGION), NULL, read_flag, "answer from the occlusion maps alone: no look at single bodies"},
    {"all-round", 0, BIT(REGION), NULL, read_flag, "no vertical: rays in six directions, for scenes as high as wide"},
    {"only", 0, BIT(CULL) | MANY_VIEWS, "IDS", read_only, "ask about these objects alone: 3,17,40-60; the others still hide"},
    {"without", 0, BIT(CULL) | MANY_VIEWS, "IDS", read_without, "as if these objects were not there: they hide nothing"},
    {"moving", 0, BIT(CULL) | MANY_VIEWS, "P,V", read_moving, "a part P of the objects goes round by itself, V units a second"},
    {"step", 0, BIT(CULL) | MANY_VIEWS, "S", read_step, "--moving: seconds from row to row (default 1/60)"},
    {"up", 0, VIEWS | BIT(REGION), "DIR", read_up, "up: x, y, z or X,Y,Z (default: as info says)"},
    {"fov", 0, VIEWS, "DEG", read_fov, "vertical field of view (default 60)"},
    {"ortho", 0, VIEWS, "HEIGHT", read_ortho, "parallel lines; height of the view instead of --fov"},
    {"spot", 0, VIEWS, "DEG", read_spot, "a spot light's cone, DEG wide, --far long"},
    {"cube", 0, VIEWS, "FACE", read_cube, "a cube map's face at the eye: +x, -x, +y, -y, +z, -z"},
    {"sun", 0, VIEWS, "X,Y,Z", read_sun, "the sun's view, light going X,Y,Z, of what the view shows"},
    {"slice", 0, VIEWS, "A,B", read_slice, "--sun: only what lies at depths A to B of the view"},
    {"reach", 0, VIEWS, "D", read_reach, "--sun: how far towards it casters are (default: all)"},
    {"plane", 0, VIEWS, "A,B,C,D", read_plane,
     "cut by Ax + By + Cz + D >= 0; may be given ten times"},
    {"size", 0, VIEWS | BIT(REGION), "WxH", read_size, "the picture, square pixels (default 1024x512)"},
    {"near", 0, VIEWS | BIT(REGION), "D", read_near, "depth of the near plane (default 0.1; region: 0)"},
    {"far", 0, VIEWS, "D|inf", read_far,
     "depth of the far plane (default: the scene's farthest corner)"},

    {"method", 0, VIEWS, "NAME", read_method, "raster; planes, shadow-frusta, occlusion-tree: large occluders; none: frustum only (default raster)"},
    {"index", 0, SCENES, "NAME", read_index, "bvh, flat, kdtree, octree, quadtree, bsp, grid: how objects are found (default bvh)"},
    {"update", 0, SCENES, "NAME", read_update, "how the index follows what moves: refit, delete-insert, lca, lazy, deepest, incremental, overlapping"},
    {"buffer", 0, VIEWS, "WxH", read_buffer, "the method's own raster (default 1024x288)"},
    {"coherence", 0, MANY_VIEWS, "NAMES", read_coherence,
     "carry over: list, hierarchy, propagation, conservative, rest, planes, leaves, all (default none)"},
    {"occluder-budget", 0, MANY_VIEWS, "N", read_budget, "draw at most N occluders a frame (default: all)"},
    {"min-pixels", 0, VIEWS, "P", read_min_pixels,
     "drop objects under P pixels both ways (default 0: none)"},
    {"no-weld", 0, SCENES, NULL, read_flag, "do not join touching objects into common occluders"},
    {"threads", 0, SCENES | BIT(REPLAY), "N", read_threads,
     "threads to build and trace with (default 1)"},
    {"isa", 0, VIEWS | BIT(REPLAY) | BIT(REGION), "NAME", read_isa,
     "auto, scalar, sse4, avx2 or neon (default auto)"},

    {"two-sided", 0, SCENES, NULL, read_two_sided, "faces block from both sides"},
    {"sky", 0, SCENES, NULL, read_sky, "keep sky surfaces; they block"},
    {"split", 0, SCENES, "N", read_split, "cut meshes into clusters of at most N triangles"},
    {"seed", 0, SCENES | BIT(GENERATE), "N", read_seed,
     "seed of a generated scene and path that have one"},

    {"list", 0, BIT(INFO) | BIT(CULL) | BIT(WALK) | BIT(REGION), NULL, read_flag, "list the objects too"},
    {"repeat", 0, BIT(CULL) | BIT(REGION), "N", read_repeat,
     "answers that the time is the median of (default 5; region: the least)"},
    {"capture", 0, BIT(CULL), "FILE", read_capture, "write the frame for umbrage replay"},
    {"grid", 0, BIT(CHECK) | BIT(EXPLAIN), "WxH", read_grid,
     "first rays of the oracle (default: --size)"},
    {"picture", 0, BIT(REGION), "FILE", read_output, "write a picture of the scene from above and the occlusion maps"},
    {"check", 0, BIT(REGION), NULL, read_flag, "hold the answer against many rays from the cell"},
    {"rays", 0, BIT(CHECK) | BIT(EXPLAIN) | BIT(REGION), "N", read_rays,
     "most guided rays a view (default 4M); from a cell 0.5M, to check 4M"},
    {"object", 0, BIT(EXPLAIN), "ID", read_object, "the object to explain"},
    {"what", 0, BIT(RENDER), "KIND", read_what, "eye, ids, occlusion, map or all (default eye)"},
    {"output", 'o', BIT(RENDER) | BIT(GENERATE), "FILE", read_output, "the file to write"},

    {"json", 0, ALL, NULL, read_flag, "one JSON object on one line instead of text"},
    {"progress", 0, ALL, NULL, read_flag, "show progress though standard error is no terminal"},
    {"help", 'h', ALL, NULL, read_flag, "this text"},
};
enum { SPEC_COUNT = sizeof specs / sizeof specs[0] };
_Static_assert(SPEC_COUNT <= 64, "options.given has a bit for each");

/* ---- reading -------------------------------------------------------------------------------- */

int fail(const options *o, int code, const char *format, ...)
{
    va_list arguments;
    /* Over whatever progress a terminal shows. */
    fprintf(stderr, "%sumbrage %s: ", isatty(STDERR_FILENO) ? "\r\033[K" : "", o->command);
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputc('\n', stderr);
    return code;
}

bool options_given(const options *o, const char *name)
{
    for (int i = 0; i < SPEC_COUNT; ++i) {
        if (strcmp(specs[i].name, name) == 0) {
            return (o->given >> i & 1) != 0;
        }
    }
    return false;
}

/* The option that a word starting with a minus names, for this subcommand; NULL: none. *value is
 * what follows an equals sign. */
static const option_spec *find(const char *word, int which, const char **value)
{
    size_t length = strcspn(word, "=");
    *value = word[length] == '=' ? word + length + 1 : NULL;
    for (int i = 0; i < SPEC_COUNT; ++i) {
        const option_spec *s = &specs[i];
        bool named = word[1] == '-' ? length == strlen(s->name) + 2 &&
                                          memcmp(word + 2, s->name, length - 2) == 0
                                    : length == 2 && s->letter && word[1] == s->letter;
        if (named && (s->commands >> which & 1)) {
            return s;
        }
    }
    return NULL;
}

static int read_option(const option_spec *s, const char *value, options *out)
{
    const char *wanted = s->read(out, value);
    if (wanted) {
        return fail(out, EXIT_USAGE, "--%s '%.60s': takes %s", s->name, value, wanted);
    }
    out->given |= (uint64_t)1 << (s - specs);
    return EXIT_DONE;
}

static int read_input(const command *c, const char *word, options *out)
{
    if (out->input) {
        return fail(out, EXIT_USAGE, "takes one %s; '%.60s' is too many", c->input, word);
    }
    out->input = word;
    return EXIT_DONE;
}

static void set_defaults(const command *c, options *out)
{
    *out = (options){.command = c->name,
                     .fov = 60.0,
                     .width = 1024,
                     .height = 512,
                     .near_depth = 0.1,
                     .to = UINT32_MAX,
                     .every = 1,
                     .step = 1.0 / 60,
                     .threads = 1,
                     .repeat = 5,
                     .pictures = PICTURE_EYE};
}

/* --update and --index come in any order. */
static int choose_update(options *out)
{
    out->index.update = out->update;
    if (umb_index_can_update(&out->index)) {
        return EXIT_DONE;
    }
    return fail(out, EXIT_USAGE, "--update %s: index %s cannot follow what moves this way", umb_index_update_name(out->update),
                umb_index_name(&out->index));
}

int options_read(const command *c, int which, int word_count, char **words, options *out, bool *help)
{
    bool only_inputs = false;
    set_defaults(c, out);
    *help = false;
    for (int i = 0; i < word_count; ++i) {
        const char *word = words[i], *value;
        int code;
        if (only_inputs || word[0] != '-' || word[1] == '\0') {
            code = read_input(c, word, out);
        } else if (strcmp(word, "--") == 0) {
            only_inputs = true;
            code = EXIT_DONE;
        } else {
            const option_spec *s = find(word, which, &value);
            if (!s) {
                return fail(out, EXIT_USAGE, "no option '%.60s'; umbrage %s --help lists them",
                            word, c->name);
            }
            if (!s->value && value) {
                return fail(out, EXIT_USAGE, "--%s takes no value", s->name);
            }
            if (s->value && !value) {
                if (++i == word_count) {
                    return fail(out, EXIT_USAGE, "--%s needs a value: --%s %s", s->name, s->name,
                                s->value);
                }
                value = words[i];
            }
            code = read_option(s, value, out);
            if (strcmp(s->name, "help") == 0) {
                *help = true;
                return EXIT_DONE;
            }
        }
        if (code != EXIT_DONE) {
            return code;
        }
    }
    if (!out->input || !*out->input) {
        return fail(out, EXIT_USAGE, "needs a %s: umbrage %s %s %s", c->input, c->name, c->input,
                    c->usage);
    }
    return choose_update(out);
}

void options_help(const command *c, int which)
{
    printf("usage: umbrage %s %s %s\n\n%s.\n\n", c->name, c->input, c->usage, c->summary);
    for (int i = 0; i < SPEC_COUNT; ++i) {
        const option_spec *s = &specs[i];
        if (s->commands >> which & 1) {
            char left[64];
            int used = s->letter ? snprintf(left, sizeof left, "-%c, ", s->letter) : 0;
            snprintf(left + used, sizeof left - (size_t)used, "--%s%s%s", s->name,
                     s->value ? " " : "", s->value ? s->value : "");
            printf("  %-20s %s\n", left, s->help);
        }
    }
}

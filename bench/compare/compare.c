/* The comparison: the library, its rivals and the oracle over the same views, in one run.
 *
 *     compare [--quick] [--only NAME] [--rounds N] [--foundation FILE] [--docs DIR] [--out DIR]
 *
 * Real scenes are those of the folder that UMBRAGE_SCENES names. Exit code: 0; 1 when a configuration of
 * the library hides what can be seen, or the standard one costs more units than its limit; 2 wrong usage; 3
 * something cannot be read or measured. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "foundation_entry.h"
#include "report.h"

typedef struct settings {
    bool quick;
    const char *only, *docs, *out;
    const char *foundation; /* what scripts/foundation built: it runs over the real scenes, too */
    uint32_t rounds;
} settings;

typedef struct view_set {
    const char *name;
    uint32_t every;   /* that many rows of the path on */
    uint32_t frames;  /* of a sequence instead, */
    double speed;     /* at metres a second; 0: jumps */
    camera_turn turn; /* not of sequences */
    double limit;     /* units; 0: none */
    bool quick;       /* in quick runs too */
} view_set;

typedef struct scene_case {
    const char *name, *spec;
    const char *path, *lens; /* of real scenes; NULL: the generator's path */
    uint32_t occluders;      /* objects below this number hide, for rivals */
    uint32_t width;          /* the oracle's picture, 16:9 */
    uint32_t rounds;
    bool moved; /* also with every occluder moved before each frame of the first set */
    view_set sets[8];
} scene_case;

/* Limits are about twice what was measured last: they catch what went wrong, not noise. */
static const scene_case generated[] = {
    {.name = "blocks-32",
     .spec = "gen:blocks,g=32",
     .occluders = 32 * 32,
     .width = 3840,
     .rounds = 15,
     .sets = {{.name = "recipe", .every = 1, .limit = 16.0, .quick = true}}},
    {.name = "blocks-100",
     .spec = "gen:blocks,g=100",
     .occluders = 100 * 100,
     .width = 3840,
     .rounds = 9,
     .moved = true,
     .sets = {{.name = "recipe", .every = 1, .limit = 3.2, .quick = true},
              {.name = "rolled", .every = 1, .turn = {.pitch = -12.0, .roll = 17.0}, .quick = true},
              {.name = "above", .every = 1, .turn = {.pitch = -20.0, .height = 60.0}, .quick = true},
              {.name = "walking", .frames = 180, .speed = 1.5},
              {.name = "running", .frames = 180, .speed = 6.0},
              {.name = "jumping", .frames = 180}}},
    {.name = "blocks-316",
     .spec = "gen:blocks,g=316",
     .occluders = 316 * 316,
     .width = 3840,
     .rounds = 5,
     .sets = {{.name = "recipe", .every = 1, .limit = 0.7},
              {.name = "rolled", .every = 1, .turn = {.pitch = 5.0, .roll = -30.0}}}},
    {.name = "city",
     .spec = "gen:city,triangles=1M",
     .occluders = UINT32_MAX,
     .width = 1920,
     .rounds = 5,
     .sets = {{.name = "path", .every = 2},
              {.name = "walking", .frames = 120, .speed = 1.5},
              {.name = "running", .frames = 120, .speed = 6.0},
              {.name = "jumping", .frames = 120}}},
};

typedef struct real_scene {
    const char *name, *file;
} real_scene;

static const real_scene real_scenes[] = {
    {"castle", "castle/castle.glb"},
    {"carrier", "carrier/truman.ac"},
    {"delft-terrain", "delft/delft_3dfier_lod1_terrain.obj"},
    {"delft-buildings", "delft/delft_3dbag_5910_lod22.city.json"},
    {"street", "street1/street-1.acc"},
    {"czest3ctf", "openarena/czest3ctf.bsp"},
    {"ctf_inyard", "openarena/ctf_inyard.bsp"},
    {"oa_dm1", "openarena/oa_dm1.bsp"},
    {"oa_dm2", "openarena/oa_dm2.bsp"},
    {"oa_dm3", "openarena/oa_dm3.bsp"},
    {"e1m1", "quake/e1m1.bsp"},
    {"e1m3", "quake/e1m3.bsp"},
    {"e1m4", "quake/e1m4.bsp"},
    {"start", "quake/start.bsp"},
    {"house-structure", "schependomlaan/V_L_Constructief.ifc"},
    {"house-walls", "schependomlaan/WILLEMSEN-Laagbouw.ifc"},
};

enum { SETS = 8, CONTESTS_MOST = 64, WALKED_ROWS = 479 };

typedef struct results {
    contest *contests;
    uint32_t count;
} results;

static bool one_set(const settings *s, const scene_case *sc, const view_set *set, const world *w,
                    results *r, umb_error *error)
{
    cameras c;
    item_buffer truth;
    bool sequence = set->frames != 0;
    const char *path = sc->path != NULL ? sc->path : sc->spec;
    uint32_t rounds = s->rounds != 0 ? s->rounds : s->quick ? 3 : sc->rounds;
    uint32_t why = sequence ? ENTRY_MOTION : sc->lens != NULL ? ENTRY_SCENE : ENTRY_STILL;
    contest *out = &r->contests[r->count];
    if (sequence ? !cameras_motion(&c, w, set->name, path, set->speed, set->frames, error)
                 : !cameras_path(&c, w, set->name, path, sc->lens, set->every, WALKED_ROWS,
                                 set->turn, error)) {
        return false;
    }
    out->limit = set->limit;
    bool ok = false;
    uint32_t width = sequence ? 1280 : sc->width;
    if (item_buffer_make(&truth, w, &c, width, width / 16 * 9, s->out, error)) {
        ok = contest_run(out, w, &c, &truth, why, rounds, error) &&
             (!sc->moved || sequence || set != sc->sets ||
              contest_moved(out, w, &c, &truth, 2 * ((rounds + 3) / 4), error));
        item_buffer_free(&truth);
    }
    if (ok) {
        report_print(out, stdout);
        (void)fflush(stdout);
        ++r->count;
    }
    cameras_free(&c);
    return ok;
}

static bool one_case(const settings *s, const scene_case *sc, results *r, umb_error *error)
{
    world w;
    bool ok = true;
    bool any = false;
    for (uint32_t i = 0; i < SETS && sc->sets[i].name != NULL; ++i) {
        any = any || !s->quick || sc->sets[i].quick;
    }
    if (!any || (s->only != NULL && strstr(sc->name, s->only) == NULL)) {
        return true;
    }
    if (!world_load(&w, sc->name, sc->spec, sc->occluders, error)) {
        return false;
    }
    if (s->foundation != NULL && (w.foundation = foundation_open(s->foundation, error)) == NULL) {
        world_free(&w);
        return false;
    }
    for (uint32_t i = 0; ok && i < SETS && sc->sets[i].name != NULL && r->count < CONTESTS_MOST;
         ++i) {
        if (!s->quick || sc->sets[i].quick) {
            ok = one_set(s, sc, &sc->sets[i], &w, r, error);
        }
    }
    world_free(&w);
    return ok;
}

/* NAME.EXT has its path in NAME.path.csv and its lens in NAME.path.json. */
static bool one_real_scene(const settings *s, const char *folder, const real_scene *scene,
                           results *r, umb_error *error)
{
    char spec[512];
    char path[540];
    char lens[540];
    (void)snprintf(spec, sizeof spec, "%s/%s", folder, scene->file);
    const char *ending = strstr(spec, ".city.json");
    ending = ending != NULL ? ending : strrchr(spec, '.');
    size_t stem = ending != NULL ? (size_t)(ending - spec) : strlen(spec);
    (void)snprintf(path, sizeof path, "%.*s.path.csv", (int)stem, spec);
    (void)snprintf(lens, sizeof lens, "%.*s.path.json", (int)stem, spec);
    const scene_case sc = {.name = scene->name,
                           .spec = spec,
                           .path = path,
                           .lens = lens,
                           .occluders = UINT32_MAX,
                           .width = 1920,
                           .rounds = 5,
                           .sets = {{.name = "path", .every = 8}}};
    return one_case(s, &sc, r, error);
}

static bool run_all(const settings *s, results *r, umb_error *error)
{
    const char *folder = getenv("UMBRAGE_SCENES");
    for (size_t i = 0; i < sizeof generated / sizeof generated[0]; ++i) {
        if (!one_case(s, &generated[i], r, error)) {
            return false;
        }
    }
    if (s->quick) {
        return true;
    }
    if (folder == NULL || *folder == 0) {
        (void)puts("\nUMBRAGE_SCENES names no folder: real scenes are left out");
        return true;
    }
    for (size_t i = 0; i < sizeof real_scenes / sizeof real_scenes[0]; ++i) {
        if (!one_real_scene(s, folder, &real_scenes[i], r, error)) {
            return false;
        }
    }
    return true;
}

static bool read_settings(settings *s, int argc, char **argv)
{
    *s = (settings){.out = "out/bench"};
    for (int i = 1; i < argc; ++i) {
        bool more = i + 1 < argc;
        if (strcmp(argv[i], "--quick") == 0) {
            s->quick = true;
        } else if (strcmp(argv[i], "--only") == 0 && more) {
            s->only = argv[++i];
        } else if (strcmp(argv[i], "--foundation") == 0 && more) {
            s->foundation = argv[++i];
        } else if (strcmp(argv[i], "--docs") == 0 && more) {
            s->docs = argv[++i];
        } else if (strcmp(argv[i], "--out") == 0 && more) {
            s->out = argv[++i];
        } else if (strcmp(argv[i], "--rounds") == 0 && more) {
            s->rounds = (uint32_t)strtoul(argv[++i], NULL, 10);
        } else {
            return false;
        }
    }
    return true;
}

static int say(const results *r, const settings *s, umb_error *error)
{
    char prefix[512];
    int code = 0;
    (void)snprintf(prefix, sizeof prefix, "%s/compare", s->out);
    if (!report_data(r->contests, r->count, prefix, error) ||
        (s->docs != NULL && !report_page(r->contests, r->count, s->docs, error))) {
        return 3;
    }
    for (uint32_t i = 0; i < r->count; ++i) {
        code = r->contests[i].failed ? 1 : code;
    }
    return code;
}

int main(int argc, char **argv)
{
    settings s;
    umb_error error = {0};
    char machine[320];
    if (!read_settings(&s, argc, argv)) {
        (void)fputs("compare: [--quick] [--only NAME] [--rounds N] [--foundation FILE] [--docs DIR] [--out DIR]\n",
                    stderr);
        return 2;
    }
#if defined(__x86_64__)
    if (!__builtin_cpu_supports("avx2")) {
        (void)fputs("compare: the rivals are built for AVX2, which this processor lacks\n", stderr);
        return 3;
    }
#endif
    (void)mkdir(s.out, 0777);
    report_machine(machine, sizeof machine);
    (void)printf("umbrage %s on %s; one thread\n", umb_version(), machine);
    results r = {calloc(CONTESTS_MOST, sizeof(contest)), 0};
    int code = 3;
    if (r.contests != NULL && run_all(&s, &r, &error)) {
        code = say(&r, &s, &error);
    }
    if (code == 3) {
        (void)fprintf(stderr, "compare: %s\n", error.text);
    }
    free(r.contests);
    return code;
}

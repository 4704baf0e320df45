/* What objects that move by themselves cost, hidden and seen, with temporal bounding volumes and without, as tables in
 * Markdown.
 *
 *     bench_motion hidden [SECONDS]  100,000 movers, most of them hidden; each world runs for so many seconds before it is timed (60)
 *     bench_motion more [SECONDS]    more and more walkers
 *     bench_motion hour              an hour of motion, in which walkers come and go: does anything grow, does a frame get slower?
 *
 * The town is gen:blocks,g=72. Walkers go round its blocks, for ever. A crowd walks to and fro in the street that the
 * viewer stands in, six units above the ground, where he sees most of it. A frame is what an engine calls for it: the
 * time, the commit, the cull; moved by hand, a move for everybody before. Times are processor time of one thread; every
 * configuration answers every frame in turn, so that what else the machine does meets all of them.
 */
#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "io/model.h"

#define PITCH 18.0
#define GRID 72
#define WALK 1.4
#define FRAME (1.0 / 60)
#define EYE_HEIGHT 6.0

enum { CROWD = 5000, ROUNDS = 600 };

static void must(bool ok, const char *what)
{
    if (!ok) {
        (void)fprintf(stderr, "bench_motion: %s\n", what);
        exit(1);
    }
}

static double now_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* ---- who walks where ------------------------------------------------------------------------ */

typedef enum promise { BY_HAND, SPEED, VELOCITY, ROUND_VOLUME } promise;

typedef struct world {
    const char *name;
    uint32_t crowd, walkers; /* how many */
    promise promise;
    const uint8_t *there; /* of the crowd and the walkers, which are; NULL: all */
    uint32_t movers;      /* how many are */
    uint32_t first; /* id of the first of them: the crowd comes first */
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
    double *times;
    uint32_t frames;
    uint64_t visible, poses, asked, renewed, hidden;
    double period;
} world;

static double hashed(uint32_t n, uint32_t salt)
{
    uint64_t x = (n * 2654435761u + salt) * 0x9E3779B97F4A7C15u;
    x = (x ^ x >> 31) * 0xBF58476D1CE4E5B9u;
    return (double)(x >> 40) * 0x1p-24;
}

static double to_and_fro(double way, double length)
{
    double on = fmod(way, 2.0 * length);
    return on < length ? on : 2.0 * length - on;
}

typedef struct place {
    double x, z, vx, vz, holds;
} place;

/* To and fro along the street, each over twenty units. */
static place crowd_place(uint32_t n, double time)
{
    double length = 20.0, way = WALK * time + 2.0 * length * hashed(n, 1), on = fmod(way, 2.0 * length);
    place p = {.x = 4.0 + 560.0 * hashed(n, 2) + to_and_fro(way, length),
               .z = 6.0 * hashed(n, 3) - 3.0,
               .vx = on < length ? WALK : -WALK,
               .holds = (on < length ? length - on : 2.0 * length - on) / WALK};
    return p;
}

/* Round a block, in the middle of the streets. */
static place walker_place(uint32_t n, double time)
{
    double side = PITCH - 2.0 * hashed(n, 4), way = WALK * time + 4.0 * side * hashed(n, 5);
    double on = fmod(way, 4.0 * side), rest = fmod(on, side);
    uint32_t block = (uint32_t)(hashed(n, 6) * GRID * GRID), edge = (uint32_t)(on / side) % 4;
    static const double dx[4] = {1, 0, -1, 0}, dz[4] = {0, 1, 0, -1};
    static const double sx[4] = {0, 1, 1, 0}, sz[4] = {0, 0, 1, 1};
    place p = {.x = (block % GRID - GRID / 2.0) * PITCH + side * sx[edge] + dx[edge] * rest,
               .z = (block / GRID - GRID / 2.0) * PITCH + side * sz[edge] + dz[edge] * rest,
               .vx = WALK * dx[edge],
               .vz = WALK * dz[edge],
               .holds = (side - rest) / WALK};
    return p;
}

static place place_of(const world *w, uint32_t object, double time)
{
    uint32_t n = object - w->first;
    return n < w->crowd ? crowd_place(n, time) : walker_place(n - w->crowd + CROWD, time);
}

static umb_transform stand_at(const place *p)
{
    return (umb_transform){.m = {{0.5f, 0, 0, (float)p->x}, {0, 1.8f, 0, 0}, {0, 0, 0.4f, (float)p->z}}};
}

static bool where_is(void *user, uint32_t object, double time, umb_pose *out)
{
    const world *w = user;
    place p = place_of(w, object, time);
    out->transform = stand_at(&p);
    if (w->promise == VELOCITY) {
        out->velocity[0] = p.vx;
        out->velocity[2] = p.vz;
        out->holds = p.holds > 0.0 ? p.holds : 1e-9;
    }
    return true;
}

/* ---- worlds --------------------------------------------------------------------------------- */

static umb_shape add_box(umb_scene *scene)
{
    static const float corners[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                        {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    static const uint32_t triangles[] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                         3, 7, 6, 3, 6, 2, 0, 4, 7, 0, 7, 3, 1, 2, 6, 1, 6, 5};
    umb_shape_def def = {.positions = corners[0], .position_count = 8, .indices = triangles, .index_count = 36};
    umb_shape box;
    must(umb_scene_add_shape(scene, &def, &box) == UMB_OK, "no memory for a box");
    return box;
}

static umb_motion_def promise_of(const world *w, uint32_t object)
{
    place p = place_of(w, object, 0.0);
    umb_motion_def def = {.max_speed = w->promise == VELOCITY ? 1e-6 : WALK + 1e-3};
    if (w->promise == ROUND_VOLUME && object - w->first >= w->crowd) {
        /* The walk round his block: where he is at times a side apart. */
        def.kind = UMB_MOTION_VOLUME;
        double low[2] = {p.x, p.z}, high[2] = {p.x, p.z};
        for (int k = 0; k < 64; ++k) {
            p = place_of(w, object, k * 0.8);
            low[0] = fmin(low[0], p.x);
            low[1] = fmin(low[1], p.z);
            high[0] = fmax(high[0], p.x);
            high[1] = fmax(high[1], p.z);
        }
        def.volume = (umb_aabb){{(float)low[0] - 1.2f, 0, (float)low[1] - 1.2f},
                                {(float)high[0] + 1.7f, 1.8f, (float)high[1] + 1.6f}};
    }
    return def;
}

static bool is_there(const world *w, uint32_t i)
{
    return w->there == NULL || w->there[i] != 0;
}

static void world_make(world *w)
{
    umb_error error = {0};
    char spec[40];
    (void)snprintf(spec, sizeof spec, "gen:blocks,g=%d", GRID);
    model *m = model_load(spec, NULL, &error);
    must(m != NULL, error.text);
    umb_tasks tasks = {0};
    w->scene = model_scene(m, true, tasks, NULL, &error);
    must(w->scene != NULL, error.text);
    w->first = m->object_count;
    model_free(m);
    umb_shape box = add_box(w->scene);
    umb_pose_source source = {where_is, w};
    must(umb_scene_set_poses(w->scene, &source) == UMB_OK, "poses");
    for (uint32_t i = 0; i < w->crowd + w->walkers; ++i) {
        place p = place_of(w, w->first + i, 0.0);
        uint32_t flags = is_there(w, i) ? UMB_OBJECT_IS_SHAPE : UMB_OBJECT_IS_SHAPE | UMB_OBJECT_IGNORED, id;
        umb_object_def def = {.shape = box, .transform = stand_at(&p), .flags = flags};
        must(umb_scene_add_object(w->scene, &def, &id) == UMB_OK, "no memory for a walker");
        must(id == w->first + i, "ids in order");
        w->movers += is_there(w, i);
        if (w->promise != BY_HAND && is_there(w, i)) {
            umb_motion_def motion = promise_of(w, id);
            must(umb_scene_set_motion(w->scene, id, &motion) == UMB_OK, "a motion");
        }
    }
    must(umb_scene_commit(w->scene) == UMB_OK, "a commit");
    must(umb_index_create(w->scene, NULL, &w->index) == UMB_OK, "an index");
    must(umb_culler_create(w->index, NULL, &w->culler) == UMB_OK, "a culler");
    w->times = calloc(ROUNDS, sizeof *w->times);
    must(w->times != NULL, "no memory for times");
}

static void world_free(world *w)
{
    umb_culler_destroy(w->culler);
    umb_index_destroy(w->index);
    umb_scene_destroy(w->scene);
    free(w->times);
}

static umb_view view_at(double time)
{
    static const double up[3] = {0, 1, 0};
    double eye[3] = {to_and_fro(WALK * time, 8.0) - 8.0, EYE_HEIGHT, 0.0};
    double target[3] = {eye[0] + 100.0, EYE_HEIGHT - 2.0, 5.0 * (to_and_fro(time, 20.0) / 10.0 - 1.0)};
    umb_view view;
    must(umb_view_look_at(&view, eye, target, up, 60.0 * 3.14159265358979323846 / 180.0, 2.0, 0.1, 3000.0) == UMB_OK,
         "a view");
    view.time = time;
    return view;
}

static double frame(world *w, double time, umb_visible_set *seen)
{
    umb_view view = view_at(time);
    double start = now_ms();
    for (uint32_t i = 0; w->promise == BY_HAND && i < w->crowd + w->walkers; ++i) {
        umb_pose pose = {.holds = 0.0};
        (void)where_is(w, w->first + i, time, &pose);
        must(umb_scene_move_object(w->scene, w->first + i, &pose.transform, NULL) == UMB_OK, "a move");
    }
    must(umb_scene_set_time(w->scene, time) == UMB_OK, "the time");
    must(umb_scene_commit(w->scene) == UMB_OK, "a commit");
    must(umb_cull(w->culler, &view, seen) == UMB_OK, "a cull");
    return now_ms() - start;
}

static void note(world *w, double time, double ms, const umb_visible_set *seen)
{
    umb_motion_stats stats;
    umb_scene_get_motion_stats(w->scene, &stats);
    must(seen->stats.strays == 0, "a promise was not kept");
    (void)time;
    w->times[w->frames++] = ms;
    w->visible += seen->count;
    w->poses += seen->stats.poses;
    w->hidden += seen->stats.hidden_movers;
    w->asked += stats.asked;
    w->renewed += stats.renewed;
    w->period = stats.period;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double quantile(const double *times, uint32_t count, double part)
{
    double *sorted = malloc(count * sizeof *sorted);
    must(sorted != NULL, "no memory");
    memcpy(sorted, times, count * sizeof *sorted);
    qsort(sorted, count, sizeof *sorted, compare);
    double at = sorted[(uint32_t)(part * (count - 1))];
    free(sorted);
    return at;
}

/* ---- tables --------------------------------------------------------------------------------- */

static void run_all(world *worlds, uint32_t count, double before)
{
    umb_visible_set seen;
    uint32_t untimed = (uint32_t)(before / FRAME);
    for (uint32_t k = 0; k < count; ++k) {
        world_make(&worlds[k]);
        for (uint32_t i = 0; i < untimed; ++i) {
            /* By hand a frame depends on the one before by its tree alone: a few will do. */
            if (worlds[k].promise != BY_HAND || i % 60 == 0) {
                (void)frame(&worlds[k], i * FRAME, &seen);
            }
        }
    }
    for (uint32_t i = 0; i < ROUNDS; ++i) {
        double time = (untimed + i) * FRAME;
        for (uint32_t k = 0; k < count; ++k) {
            double ms = frame(&worlds[k], time, &seen);
            note(&worlds[k], time, ms, &seen);
        }
    }
}

static void print_row(const world *w, const world *unit)
{
    double median = quantile(w->times, w->frames, 0.5), base = quantile(unit->times, unit->frames, 0.5);
    printf("| %s | %u | %.0f | %.3f | %.3f | %.2f | %.0f | %.0f | %.1f | %.1f |\n", w->name, w->movers,
           (double)w->visible / w->frames, median, quantile(w->times, w->frames, 0.99), median / base,
           (double)w->poses / w->frames, (double)w->asked / w->frames, (double)w->renewed / w->frames, w->period);
}

static void print_head(void)
{
    printf("| who moves, and how | movers | reported | ms, median | ms, p99 | ratio | poses a cull | poses a commit | volumes "
           "renewed | period, s |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
}

/* Of the crowd and the walkers, those that are reported in any of the timed frames, and the crowd. */
static void find_seen(double before, uint32_t walkers, uint8_t *there)
{
    world w = {.crowd = CROWD, .walkers = walkers};
    uint32_t untimed = (uint32_t)(before / FRAME);
    umb_visible_set seen;
    world_make(&w);
    memset(there, 1, CROWD);
    for (uint32_t i = 0; i < ROUNDS; ++i) {
        (void)frame(&w, (untimed + i) * FRAME, &seen);
        for (uint32_t k = 0; k < seen.count; ++k) {
            if (seen.objects[k] >= w.first) {
                there[seen.objects[k] - w.first] = 1;
            }
        }
    }
    world_free(&w);
}

static void mostly_hidden(double before)
{
    enum { WALKERS = 95000 };
    static uint8_t there[CROWD + WALKERS];
    find_seen(before, WALKERS, there);
    world worlds[] = {
        {.name = "nobody"},
        {.name = "the crowd, by hand", .crowd = CROWD},
        {.name = "the crowd, volumes by speed", .crowd = CROWD, .promise = SPEED},
        {.name = "the crowd and the walkers that are seen, volumes by speed",
         .crowd = CROWD, .walkers = WALKERS, .promise = SPEED, .there = there},
        {.name = "the crowd and 95,000 walkers, by hand", .crowd = CROWD, .walkers = WALKERS},
        {.name = "the same, volumes by speed", .crowd = CROWD, .walkers = WALKERS, .promise = SPEED},
        {.name = "the same, by velocity", .crowd = CROWD, .walkers = WALKERS, .promise = VELOCITY},
        {.name = "the same, walkers' rounds given", .crowd = CROWD, .walkers = WALKERS, .promise = ROUND_VOLUME},
    };
    enum { COUNT = sizeof worlds / sizeof worlds[0] };
    run_all(worlds, COUNT, before);
    printf("### 100,000 movers, most of them hidden\n\nRatio: to the same frames without the walkers that are reported in none of them "
           "(the crowd and the walkers that are seen, volumes by speed).\n\n");
    print_head();
    for (uint32_t k = 0; k < COUNT; ++k) {
        print_row(&worlds[k], &worlds[3]);
    }
    const world *all = &worlds[5];
    printf("\nOf the 100,000, %.1f %% were asked for by no cull in the mean frame; the town itself has %u objects. To the crowd "
           "alone, volumes by speed, whose frames show less, volumes by speed are %.2f.\n",
           100.0 * (double)all->hidden / all->frames / all->movers, all->first,
           quantile(all->times, all->frames, 0.5) / quantile(worlds[2].times, worlds[2].frames, 0.5));
    for (uint32_t k = 0; k < COUNT; ++k) {
        world_free(&worlds[k]);
    }
}

static void more_and_more(double before)
{
    world scale[] = {
        {.name = "walkers, volumes by speed", .walkers = 1000, .promise = SPEED},
        {.name = "walkers, volumes by speed", .walkers = 10000, .promise = SPEED},
        {.name = "walkers, volumes by speed", .walkers = 100000, .promise = SPEED},
        {.name = "walkers, by hand", .walkers = 1000},
        {.name = "walkers, by hand", .walkers = 10000},
        {.name = "walkers, by hand", .walkers = 100000},
    };
    enum { SCALES = sizeof scale / sizeof scale[0] };
    run_all(scale, SCALES, before);
    printf("### More and more walkers in the same town\n\nRatio: to 1,000 walkers with volumes.\n\n");
    print_head();
    for (uint32_t k = 0; k < SCALES; ++k) {
        print_row(&scale[k], &scale[0]);
    }
    for (uint32_t k = 0; k < SCALES; ++k) {
        world_free(&scale[k]);
    }
}

/* ---- an hour -------------------------------------------------------------------------------- */

/* Bytes that the program holds, of all kinds: scene, index and culler are all that grows. */
static size_t held_bytes(void)
{
    struct mallinfo2 m = mallinfo2();
    return m.uordblks + m.hblkhd;
}

/* A walker leaves, and another comes, who gets the number of the one who left in the frame before. */
static void exchange(world *w, uint32_t count, umb_shape box, double time, uint32_t *gone)
{
    uint32_t id = w->first + w->crowd + count * 7919u % (w->walkers + 1), again;
    id = id != *gone ? id : w->first + w->crowd;
    must(umb_scene_remove_object(w->scene, id) == UMB_OK, "a walker who leaves");
    place p = place_of(w, *gone, time);
    umb_object_def def = {.shape = box, .transform = stand_at(&p), .flags = UMB_OBJECT_IS_SHAPE};
    must(umb_scene_add_object(w->scene, &def, &again) == UMB_OK && again == *gone, "a walker who comes");
    umb_motion_def motion = promise_of(w, again);
    must(umb_scene_set_motion(w->scene, again, &motion) == UMB_OK, "a motion");
    *gone = id;
}

static void print_minute(world *w, uint32_t minute)
{
    umb_index_stats stats;
    umb_index_get_stats(w->index, &stats);
    printf("| %u | %.3f | %.3f | %.0f | %.0f | %.1f | %.1f | %.1f | %zu |\n", minute + 1,
           quantile(w->times, w->frames, 0.5), quantile(w->times, w->frames, 0.99), (double)w->visible / w->frames,
           (double)w->poses / w->frames, (double)w->renewed / w->frames, w->period, stats.cost, held_bytes());
    (void)fflush(stdout);
}

static void hour(void)
{
    enum { MINUTES = 60, A_MINUTE = 3600 };
    world w = {.crowd = CROWD / 5, .walkers = 19000, .promise = SPEED};
    world_make(&w);
    umb_shape box = add_box(w.scene);
    uint32_t gone = w.first + w.crowd + w.walkers; /* the number that nobody has */
    w.times = realloc(w.times, A_MINUTE * sizeof *w.times);
    must(w.times != NULL, "no memory for times");
    printf("### An hour of 20,000 walkers, 60 frames a second\n\nIn each frame one of them leaves, and another comes. Bytes are those "
           "of the whole program.\n\n| minute | ms, median | ms, p99 | reported | poses a cull | volumes renewed | "
           "period, s | tree's cost | bytes held |\n|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
    for (uint32_t minute = 0; minute < MINUTES; ++minute) {
        w.frames = 0;
        w.visible = w.poses = w.renewed = 0;
        for (uint32_t i = 0; i < A_MINUTE; ++i) {
            umb_visible_set seen;
            double time = minute * 60.0 + i * FRAME;
            exchange(&w, minute * A_MINUTE + i, box, time, &gone);
            double ms = frame(&w, time, &seen);
            note(&w, time, ms, &seen);
        }
        if (minute < 2 || minute % 10 == 9) {
            print_minute(&w, minute);
        }
    }
    world_free(&w);
}

int main(int argc, char **argv)
{
    double before = argc > 2 ? atof(argv[2]) : 60.0;
    if (argc > 1 && strcmp(argv[1], "hour") == 0) {
        hour();
    } else if (argc > 1 && strcmp(argv[1], "hidden") == 0) {
        mostly_hidden(before);
    } else if (argc > 1 && strcmp(argv[1], "more") == 0) {
        more_and_more(before);
    } else {
        (void)fprintf(stderr, "usage: bench_motion hidden|more|hour [seconds before what is timed]\n");
        return 2;
    }
    return 0;
}

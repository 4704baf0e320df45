/* A town of watchmen on their rounds: objects that move by themselves, and are asked for only when they may be seen.
 *
 *     +---+  +---+  +---+     each block of houses has a watchman who walks around it, for ever.
 *     |   |w |   |  |   |     He never leaves the ring of street around his block: that is the first
 *     +---+  +---+  +-w-+     promise. The second, of the couriers who run along the streets, is a
 *      c        c             greatest speed.
 *     +---+  +---+  +---+
 *     |   |  | eye  |   |     Nobody tells the scene where they are. It asks.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <umbrage/umbrage.h>

enum { BLOCKS = 16, WATCHMEN = BLOCKS * BLOCKS, COURIERS = BLOCKS - 1, FRAMES = 600, A_SECOND = 60 };

#define PITCH 30.0  /* from block to block */
#define HOUSE 20.0
#define STREET (PITCH - HOUSE)
#define WALK 1.5    /* units a second */
#define RUN 5.0

typedef struct town {
    uint32_t first_watchman, first_courier;
} town;

static void must(umb_result result, const char *what)
{
    if (result != UMB_OK) {
        (void)fprintf(stderr, "%s: %s\n", what, umb_result_name(result));
        exit(1);
    }
}

/* Around a square of this side: the place after so long a way, from a corner on. */
static void around(double side, double way, double *x, double *z)
{
    double on = fmod(way, 4.0 * side), rest = fmod(on, side);
    int edge = (int)(on / side);
    *x = edge == 0 ? rest : edge == 1 ? side : edge == 2 ? side - rest : 0.0;
    *z = edge == 0 ? 0.0 : edge == 1 ? rest : edge == 2 ? side : side - rest;
}

/* To and fro over the length of the town. */
static double to_and_fro(double way)
{
    double length = BLOCKS * PITCH, on = fmod(way, 2.0 * length);
    return on < length ? on : 2.0 * length - on;
}

/* Where somebody is at a time: a pure function of both, which several threads may call at once. */
static bool where_is(void *user, uint32_t object, double time, umb_pose *out)
{
    const town *t = user;
    double x, z;
    if (object >= t->first_courier) {
        uint32_t street = object - t->first_courier;
        x = to_and_fro(RUN * time + 97.0 * street);
        z = (street + 1) * PITCH - STREET / 2;
    } else {
        uint32_t block = object - t->first_watchman;
        around(HOUSE + STREET / 2, WALK * time + 7.0 * block, &x, &z);
        x += block % BLOCKS * PITCH - STREET / 4;
        z += block / BLOCKS * PITCH - STREET / 4;
    }
    out->transform = (umb_transform){.m = {{0.6f, 0, 0, (float)x}, {0, 1.8f, 0, 0}, {0, 0, 0.6f, (float)z}}};
    return true;
}

static umb_shape add_unit_box(umb_scene *scene)
{
    static const float corners[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                        {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    static const uint32_t triangles[] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                         3, 7, 6, 3, 6, 2, 0, 4, 7, 0, 7, 3, 1, 2, 6, 1, 6, 5};
    umb_shape_def def = {
        .positions = corners[0], .position_count = 8, .indices = triangles, .index_count = 36};
    umb_shape box;
    must(umb_scene_add_shape(scene, &def, &box), "a box");
    return box;
}

static uint32_t add(umb_scene *scene, umb_shape box, umb_transform at, uint32_t flags)
{
    uint32_t id;
    umb_object_def def = {.shape = box, .transform = at, .flags = flags | UMB_OBJECT_IS_SHAPE};
    must(umb_scene_add_object(scene, &def, &id), "an object");
    return id;
}

static void add_houses(umb_scene *scene, umb_shape box)
{
    for (int i = 0; i < BLOCKS * BLOCKS; ++i) {
        float x = (float)(i % BLOCKS * PITCH), z = (float)(i / BLOCKS * PITCH);
        umb_transform at = {.m = {{(float)HOUSE, 0, 0, x}, {0, 12, 0, 0}, {0, 0, (float)HOUSE, z}}};
        (void)add(scene, box, at, UMB_OBJECT_STATIC);
    }
}

/* People are added wherever; where they really are comes out at the commit. */
static void add_people(umb_scene *scene, umb_shape box, town *t)
{
    umb_transform anywhere = {.m = {{0.6f, 0, 0, 0}, {0, 1.8f, 0, 0}, {0, 0, 0.6f, 0}}};
    must(umb_scene_set_poses(scene, &(umb_pose_source){where_is, t}), "poses");
    t->first_watchman = BLOCKS * BLOCKS;
    t->first_courier = t->first_watchman + WATCHMEN;
    for (int i = 0; i < WATCHMEN; ++i) {
        float x = (float)(i % BLOCKS * PITCH), z = (float)(i / BLOCKS * PITCH);
        umb_motion_def round = {
            .kind = UMB_MOTION_VOLUME,
            .volume = {{x - 3, 0, z - 3}, {x + (float)HOUSE + 3.5f, 2, z + (float)HOUSE + 3.5f}}};
        must(umb_scene_set_motion(scene, add(scene, box, anywhere, 0), &round), "a watchman");
    }
    for (int i = 0; i < COURIERS; ++i) {
        umb_motion_def run = {.max_speed = RUN + 0.001};
        must(umb_scene_set_motion(scene, add(scene, box, anywhere, 0), &run), "a courier");
    }
}

typedef struct sums {
    uint64_t people, poses, hidden, renewed;
} sums;

static void watch(umb_scene *scene, umb_culler *culler, double time, sums *s)
{
    static const double up[3] = {0, 1, 0};
    double eye[3] = {BLOCKS / 2 * PITCH - STREET / 2, 1.7, BLOCKS / 2 * PITCH - STREET / 2};
    double target[3] = {eye[0] + 100, 1.7, eye[2] + 10 - 2 * time};
    umb_view view;
    umb_visible_set seen;
    umb_motion_stats stats;
    must(umb_scene_set_time(scene, time), "the time");
    must(umb_scene_commit(scene), "a commit");
    must(umb_view_look_at(&view, eye, target, up, 1.0, 2.0, 0.1, 1000.0), "a view");
    view.time = time;
    must(umb_cull(culler, &view, &seen), "a cull");
    umb_scene_get_motion_stats(scene, &stats);
    for (uint32_t k = 0; k < seen.count; ++k) {
        s->people += seen.objects[k] >= BLOCKS * BLOCKS;
    }
    s->poses += seen.stats.poses;
    s->hidden += seen.stats.hidden_movers;
    s->renewed += stats.renewed;
}

int main(void)
{
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
    town t;
    must(umb_scene_create(NULL, &scene), "a scene");
    umb_shape box = add_unit_box(scene);
    add_houses(scene, box);
    add_people(scene, box, &t);
    must(umb_scene_commit(scene), "a commit");
    must(umb_index_create(scene, NULL, &index), "an index");
    must(umb_culler_create(index, NULL, &culler), "a culler");
    printf("%d people; a frame, on average:\n", WATCHMEN + COURIERS);
    for (int second = 0; second < FRAMES / A_SECOND; ++second) {
        sums s = {0};
        for (int frame = 0; frame < A_SECOND; ++frame) {
            watch(scene, culler, second + frame / (double)A_SECOND, &s);
        }
        printf("second %2d: %4.1f people seen, %4.1f asked where they are, %5.1f left alone; %4.2f volumes renewed\n",
               second, (double)s.people / A_SECOND, (double)s.poses / A_SECOND, (double)s.hidden / A_SECOND,
               (double)s.renewed / A_SECOND);
    }
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    umb_scene_destroy(scene);
    return 0;
}

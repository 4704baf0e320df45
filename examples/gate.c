/* Two guards, one gate: a moving occluder, moving objects, and two cullers that run in parallel.
 *
 *        north   o  looks south
 *     ~~~~~~~~~~~~~~~~~~~~  a lantern is carried along here
 *     ======[ gate ]======  two towers with a gate between them that slides up, frame by frame
 *        south   o  looks north
 *
 * Cullers only read the index, so each guard's culler may run on a thread of its own between two
 * commits. The answers are the same for any number of threads. */
#include <stdio.h>
#include <stdlib.h>
#include <umbrage/umbrage.h>

enum { FRAMES = 6, GUARDS = 2 };

typedef struct castle {
    umb_scene *scene;
    umb_index *index;
    uint32_t gate, lantern;
} castle;

typedef struct guard {
    const char *name;
    umb_culler *culler;
    umb_view view;
    bool sees_lantern;
    uint32_t seen;
} guard;

/* Every call that can fail returns an umb_result; a program that cannot go on says why and
 * stops. */
static void must(umb_result result, const char *what)
{
    if (result != UMB_OK) {
        (void)fprintf(stderr, "%s: %s\n", what, umb_result_name(result));
        exit(1);
    }
}

/* A box from (0, 0, 0) to (1, 1, 1): seen from outside its corners run counter-clockwise. */
static umb_shape add_unit_box(umb_scene *scene)
{
    static const float corners[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                        {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    static const uint32_t triangles[] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                         3, 7, 6, 3, 6, 2, 0, 4, 7, 0, 7, 3, 1, 2, 6, 1, 6, 5};
    umb_shape box;
    must(umb_scene_add_shape(scene,
                             &(umb_shape_def){.positions = corners[0],
                                              .position_count = 8,
                                              .indices = triangles,
                                              .index_count = 36},
                             &box),
         "a box");
    return box;
}

/* Size and place of a unit box. */
static umb_transform placed(float x, float y, float z, float sx, float sy, float sz)
{
    return (umb_transform){.m = {{sx, 0, 0, x}, {0, sy, 0, y}, {0, 0, sz, z}}};
}

static uint32_t add_box(umb_scene *scene, umb_shape box, umb_transform where)
{
    uint32_t id;
    must(umb_scene_add_object(scene, &(umb_object_def){.shape = box, .transform = where}, &id),
         "an object");
    return id;
}

static void build(castle *c)
{
    must(umb_scene_create(&(umb_scene_def){0}, &c->scene), "the scene");
    umb_shape box = add_unit_box(c->scene);
    add_box(c->scene, box, placed(-30, 0, -1, 28, 12, 2));
    add_box(c->scene, box, placed(2, 0, -1, 28, 12, 2));
    add_box(c->scene, box, placed(-3, 4, -1, 6, 8, 2)); /* the arch above the gate */
    c->gate = add_box(c->scene, box, placed(-3, -1, -0.5f, 6, 6, 1));
    c->lantern = add_box(c->scene, box, placed(-1, 1, -8, 0.5f, 0.5f, 0.5f));
    must(umb_scene_commit(c->scene), "the commit");
    must(umb_index_create(c->scene, &(umb_index_def){0}, &c->index), "the index");
}

/* The gate rises, the lantern is carried to the right, both a little each frame. */
static void step(castle *c, int frame)
{
    umb_transform gate = placed(-3, -1 + (float)frame, -0.5f, 6, 6, 1);
    umb_transform lantern = placed(-1 + 0.25f * (float)frame, 1, -8, 0.5f, 0.5f, 0.5f);
    must(umb_scene_move_object(c->scene, c->gate, &gate, NULL), "the gate");
    must(umb_scene_move_object(c->scene, c->lantern, &lantern, NULL), "the lantern");
    must(umb_scene_commit(c->scene), "the commit");
}

typedef struct watch {
    guard *guards;
    uint32_t lantern;
} watch;

/* One guard looks. Runs on any thread; touches nothing but its own guard. */
static void look(void *data, uint32_t i)
{
    const watch *w = data;
    guard *g = &w->guards[i];
    umb_visible_set seen;
    must(umb_cull(g->culler, &g->view, &seen), g->name);
    g->seen = seen.count;
    g->sees_lantern = false;
    for (uint32_t k = 0; k < seen.count; ++k) {
        g->sees_lantern = g->sees_lantern || seen.objects[k] == w->lantern;
    }
}

int main(void)
{
    castle c;
    build(&c);

    guard guards[GUARDS] = {{.name = "south"}, {.name = "north"}};
    const double up[3] = {0, 1, 0}, south[3] = {0, 1.7, 14}, north[3] = {0, 1.7, -24};
    must(umb_view_look_at(&guards[0].view, south, north, up, 1.0, 2.0, 0.1, 100),
         "the southern view");
    must(umb_view_look_at(&guards[1].view, north, south, up, 1.0, 2.0, 0.1, 100),
         "the northern view");
    for (int i = 0; i < GUARDS; ++i) {
        must(umb_culler_create(c.index, &(umb_culler_def){0}, &guards[i].culler), "a culler");
    }
    umb_pool *pool;
    must(umb_pool_create(2, &pool), "two threads");
    umb_tasks tasks = umb_pool_tasks(pool);

    watch w = {guards, c.lantern};
    for (int frame = 0; frame < FRAMES; ++frame) {
        step(&c, frame);
        tasks.run(tasks.user, look, &w, GUARDS);
        printf("frame %d:", frame);
        for (int i = 0; i < GUARDS; ++i) {
            printf(" %s sees %u objects, lantern %s%s", guards[i].name, (unsigned)guards[i].seen,
                   guards[i].sees_lantern ? "visible" : "hidden", i + 1 < GUARDS ? ";" : "\n");
        }
    }

    umb_pool_destroy(pool);
    for (int i = 0; i < GUARDS; ++i) {
        umb_culler_destroy(guards[i].culler);
    }
    umb_index_destroy(c.index);
    umb_scene_destroy(c.scene);
    return 0;
}

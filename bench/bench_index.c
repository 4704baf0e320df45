/* Every index by every rule over the same boxes: what building takes, what it holds, what culling costs without occlusion and
 * with it, and what following motion costs; as rows of a table in Markdown. And the default beside Embree's hierarchy over the
 * same boxes.
 *
 *     bench_index [MOST [ROUNDS [SET [INDEX]]]]
 *     bench_index only COUNT ROUNDS SET INDEX
 *     bench_index embree COUNT ROUNDS SET
 *
 * MOST: the largest number of objects (1000, 10000, 100000 or 1000000; default 100000). SET: uniform, clustered or both. INDEX:
 * names with blanks between them, or all; with "only", of one number of objects, and without the table's head. All objects are boxes that hide. Times are
 * processor time, of one thread, the least of the rounds; culling is the mean over 32 views. Following: a share of the objects
 * goes up to a fifth of a unit along each axis before each frame; the mean over the second half of the frames of the commit and of
 * the cull after it, without occlusion. BSP trees have twelve triangles an object, so they stop at 10,000 objects.
 * scripts/index-report makes docs/results/index.md of it.
 */
#include <embree3/rtcore.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "index/bvh.h"
#include "index/cut.h"
#include "index/tree.h"
#include "umbrage/umbrage.h"

enum { VIEWS = 32, MOST_TRIANGLES = 10000 };

static double now_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* ---- scenes --------------------------------------------------------------------------------- */

static double dice(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) * 0x1p-53;
}

/* A unit cube, fronts outwards. */
static umb_result add_cube(umb_scene *scene, umb_shape *out)
{
    static const float p[24] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1, 1, 1, 1};
    static const uint32_t t[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                   2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    umb_shape_def def = {.positions = p, .position_count = 8, .indices = t, .index_count = 36};
    return umb_scene_add_shape(scene, &def, out);
}

/* So large that objects are as dense whatever their number: 1 in 8 units of volume, or around points, of which there is one
 * for a thousand. Sides of 0.2 to 1, one box in sixteen three times as large. */
static umb_scene *make_scene(uint32_t count, bool clustered, double *reach)
{
    umb_scene *scene = NULL;
    umb_shape cube = 0;
    uint64_t seed = 7 + clustered;
    *reach = cbrt(8.0 * count);
    if (umb_scene_create(NULL, &scene) != UMB_OK || add_cube(scene, &cube) != UMB_OK) {
        return NULL;
    }
    double middle[3] = {0, 0, 0};
    for (uint32_t i = 0; i < count; ++i) {
        umb_object_def def = {.shape = cube, .flags = UMB_OBJECT_IS_SHAPE};
        double size = i % 16 == 0 ? 3.0 : 1.0;
        for (int a = 0; a < 3; ++a) {
            if (i % 1000 == 0) {
                middle[a] = *reach * dice(&seed);
            }
            double near_to = dice(&seed) + dice(&seed) + dice(&seed) + dice(&seed) - 2.0;
            double at = clustered ? middle[a] + 6.0 * near_to : *reach * dice(&seed);
            def.transform.m[a][a] = (float)(size * (0.2 + 0.8 * dice(&seed)));
            def.transform.m[a][3] = (float)at;
        }
        uint32_t id;
        if (umb_scene_add_object(scene, &def, &id) != UMB_OK) {
            return NULL;
        }
    }
    return umb_scene_commit(scene) == UMB_OK ? scene : NULL;
}

/* From within the scene to all sides. */
static bool make_views(double reach, umb_view views[VIEWS])
{
    uint64_t seed = 3;
    static const double up[3] = {0, 1, 0};
    for (int k = 0; k < VIEWS; ++k) {
        double eye[3], target[3];
        for (int a = 0; a < 3; ++a) {
            eye[a] = reach * dice(&seed);
            target[a] = reach * dice(&seed);
        }
        if (umb_view_look_at(&views[k], eye, target, up, 1.0, 16.0 / 9.0, 0.1, 2.0 * reach) != UMB_OK) {
            return false;
        }
    }
    return true;
}

/* ---- one index ------------------------------------------------------------------------------ */

typedef struct figures {
    umb_index_stats stats;
    double build_ms, frustum_ms, raster_ms;
    double in_frustum, visible; /* objects a view */
} figures;

static bool time_views(const umb_index *index, umb_method method, const umb_view views[VIEWS], int rounds, double *ms,
                       double *found)
{
    umb_culler *culler = NULL;
    umb_culler_def def = {.method = method, .unordered = method == UMB_METHOD_NONE};
    bool ok = umb_culler_create(index, &def, &culler) == UMB_OK;
    *ms = INFINITY;
    for (int round = 0; round <= rounds && ok; ++round) { /* the first one is not timed */
        double begin = now_ms();
        *found = 0.0;
        for (int k = 0; k < VIEWS && ok; ++k) {
            umb_visible_set seen;
            ok = umb_cull(culler, &views[k], &seen) == UMB_OK;
            *found += seen.count / (double)VIEWS;
        }
        *ms = round > 0 ? fmin(*ms, (now_ms() - begin) / VIEWS) : *ms;
    }
    umb_culler_destroy(culler);
    return ok;
}

static bool measure(umb_scene *scene, const char *name, const umb_view views[VIEWS], int rounds, figures *out)
{
    umb_index *index = NULL;
    umb_index_def def = {0};
    bool ok = umb_index_parse(name, &def);
    out->build_ms = INFINITY;
    for (int round = 0; round < rounds && ok; ++round) {
        umb_index_destroy(index);
        index = NULL;
        double begin = now_ms();
        ok = umb_index_create(scene, &def, &index) == UMB_OK;
        out->build_ms = fmin(out->build_ms, now_ms() - begin);
    }
    if (ok) {
        umb_index_get_stats(index, &out->stats);
        ok = time_views(index, UMB_METHOD_NONE, views, rounds, &out->frustum_ms, &out->in_frustum) &&
             time_views(index, UMB_METHOD_RASTER, views, rounds, &out->raster_ms, &out->visible);
    }
    umb_index_destroy(index);
    return ok;
}

/* ---- motion --------------------------------------------------------------------------------- */

enum { MOST_FRAMES = 60, LEAST_FRAMES = 8, SHARES = 3 };

static const uint32_t SHARE[SHARES] = {10, 50, 100}; /* percent that moves */

/* Where objects were when the scene was made: of unit cubes, the corner and the size. */
static umb_aabb *keep_boxes(const umb_scene *scene, uint32_t count)
{
    umb_aabb *boxes = malloc(count * sizeof *boxes);
    for (uint32_t i = 0; boxes != NULL && i < count; ++i) {
        (void)umb_scene_object_bounds(scene, i, &boxes[i]);
    }
    return boxes;
}

/* The first ones of each hundred objects take a step, each its own way: 32 there and 32 back. In frame 0 all are at home. */
static bool step(umb_scene *scene, const umb_aabb *home, uint32_t percent, uint32_t frame)
{
    uint32_t count = umb_scene_object_count(scene), on = frame % 64;
    bool ok = true;
    for (uint32_t i = 0; i < count && ok; ++i) {
        if (i % 100 >= percent) {
            continue;
        }
        umb_transform t = {{{0}}};
        uint64_t seed = 1 + i * (uint64_t)0x9E3779B97F4A7C15u;
        for (int a = 0; a < 3; ++a) {
            t.m[a][a] = home[i].max[a] - home[i].min[a];
            t.m[a][3] = home[i].min[a] + (float)((0.4 * dice(&seed) - 0.2) * (on < 32 ? on : 64 - on));
        }
        ok = umb_scene_move_object(scene, i, &t, NULL) == UMB_OK;
    }
    return ok;
}

/* What all indices are measured over. */
typedef struct stage {
    umb_scene *scene;
    umb_aabb *home;
    umb_view views[VIEWS];
} stage;

typedef struct following {
    double update_ms, cull_ms;
} following;

/* The scene is at home again at the end. */
static bool follow(const stage *s, const umb_index_def *def, uint32_t percent, following *out)
{
    umb_index *index = NULL;
    umb_culler *culler = NULL;
    umb_culler_def none = {.method = UMB_METHOD_NONE, .unordered = true};
    uint32_t frames = 0;
    double update[MOST_FRAMES], cull[MOST_FRAMES], begun = now_ms();
    bool ok = umb_index_create(s->scene, def, &index) == UMB_OK && umb_culler_create(index, &none, &culler) == UMB_OK;
    while (ok && frames < MOST_FRAMES && (frames < LEAST_FRAMES || now_ms() - begun < 1000.0)) {
        umb_visible_set seen;
        ok = step(s->scene, s->home, percent, frames + 1);
        double begin = now_ms();
        ok = ok && umb_scene_commit(s->scene) == UMB_OK;
        double middle = now_ms();
        ok = ok && umb_cull(culler, &s->views[frames % VIEWS], &seen) == UMB_OK;
        cull[frames] = now_ms() - middle;
        update[frames++] = middle - begin;
    }
    *out = (following){0.0, 0.0};
    for (uint32_t f = frames / 2; f < frames; ++f) {
        out->update_ms += update[f] / (frames - frames / 2);
        out->cull_ms += cull[f] / (frames - frames / 2);
    }
    umb_culler_destroy(culler);
    umb_index_destroy(index);
    return step(s->scene, s->home, percent, 0) && umb_scene_commit(s->scene) == UMB_OK && ok;
}

/* ---- a table -------------------------------------------------------------------------------- */

static void print_head(uint32_t count, bool clustered)
{
    printf("\n%u objects, %s\n\n| index | build ms | MiB | slots an object | nodes | cost | frustum ms | in frustum | raster ms | "
           "reported |", count, clustered ? "clustered" : "uniform");
    for (int k = 0; k < SHARES; ++k) {
        printf(" %u %%: update + cull ms |", SHARE[k]);
    }
    printf(" rebuild + cull over it |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
}

static bool print_row(const stage *s, const char *name, int rounds)
{
    figures f;
    following moving[SHARES];
    umb_index_def def = {0};
    bool ok = umb_index_parse(name, &def) && measure(s->scene, name, s->views, rounds, &f);
    for (int k = 0; k < SHARES && ok; ++k) {
        ok = follow(s, &def, SHARE[k], &moving[k]);
    }
    if (!ok) {
        return false;
    }
    printf("| %s | %.2f | %.2f | %.2f | %u | %.1f | %.4f | %.0f | %.4f | %.1f |", name, f.build_ms,
           (double)f.stats.bytes / 1048576.0, f.stats.slots / (double)f.stats.items, f.stats.nodes, f.stats.cost,
           f.frustum_ms, f.in_frustum, f.raster_ms, f.visible);
    for (int k = 0; k < SHARES; ++k) {
        printf(" %.3g + %.3g |", moving[k].update_ms, moving[k].cull_ms);
    }
    const following *all = &moving[SHARES - 1];
    printf(" %.1f |\n", (f.build_ms + f.frustum_ms) / (all->update_ms + all->cull_ms));
    (void)fflush(stdout);
    return true;
}

/* wanted: names with blanks between them, or all. */
static bool is_wanted(const char *name, uint32_t count, const char *wanted)
{
    bool fits = count <= MOST_TRIANGLES || strncmp(name, "bsp", 3) != 0, found = strcmp(wanted, "all") == 0;
    for (const char *at = wanted; *at != '\0' && !found; at += strspn(at, " ")) {
        size_t length = strcspn(at, " ");
        found = length == strlen(name) && strncmp(at, name, length) == 0;
        at += length;
    }
    return fits && found;
}

static bool measure_all(uint32_t count, bool clustered, int rounds, const char *wanted, bool head)
{
    stage s = {0};
    double reach;
    s.scene = make_scene(count, clustered, &reach);
    s.home = s.scene != NULL ? keep_boxes(s.scene, count) : NULL;
    bool ok = s.home != NULL && make_views(reach, s.views);
    const char *name;
    if (head) {
        print_head(count, clustered);
    }
    for (uint32_t k = 0; (name = umb_index_variant(k)) != NULL && ok; ++k) {
        ok = !is_wanted(name, count, wanted) || print_row(&s, name, rounds);
    }
    free(s.home);
    umb_scene_destroy(s.scene);
    return ok;
}

/* ---- beside Embree -------------------------------------------------------------------------- */

static void bounds_of(const struct RTCBoundsFunctionArguments *args)
{
    const umb_aabb *b = (const umb_aabb *)args->geometryUserPtr + args->primID;
    *args->bounds_o = (struct RTCBounds){b->min[0], b->min[1], b->min[2], 0, b->max[0], b->max[1], b->max[2], 0};
}

/* The time to commit a scene of user geometry, medium quality. */
static double time_embree(RTCDevice device, const umb_aabb *boxes, uint32_t count)
{
    RTCScene scene = rtcNewScene(device);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, count);
    rtcSetGeometryUserData(geometry, (void *)(uintptr_t)boxes);
    rtcSetGeometryBoundsFunction(geometry, bounds_of, NULL);
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_MEDIUM);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    double begin = now_ms();
    rtcCommitScene(scene);
    double ms = now_ms() - begin;
    rtcReleaseGeometry(geometry);
    rtcReleaseScene(scene);
    return ms;
}

/* A node of Embree's builder as its callbacks tell it: so many boxes, each node's with what is below. */
typedef struct mirror {
    uint32_t count;
    bool leaf;
    struct RTCBounds bounds[8];
    struct mirror *child[8];
} mirror;

static void *make_node(RTCThreadLocalAllocator a, unsigned int count, void *user)
{
    (void)user;
    mirror *m = rtcThreadLocalAlloc(a, sizeof *m, 16);
    m->count = count;
    m->leaf = false;
    return m;
}

static void set_children(void *node, void **children, unsigned int count, void *user)
{
    (void)user;
    for (unsigned int k = 0; k < count; ++k) {
        ((mirror *)node)->child[k] = children[k];
    }
}

static void set_bounds(void *node, const struct RTCBounds **bounds, unsigned int count, void *user)
{
    (void)user;
    for (unsigned int k = 0; k < count; ++k) {
        ((mirror *)node)->bounds[k] = *bounds[k];
    }
}

static void *make_leaf(RTCThreadLocalAllocator a, const struct RTCBuildPrimitive *primitives, size_t count, void *user)
{
    (void)primitives;
    mirror *m = make_node(a, (unsigned int)count, user);
    m->leaf = true;
    return m;
}

static double area_of(const struct RTCBounds *b)
{
    const float min[3] = {b->lower_x, b->lower_y, b->lower_z}, max[3] = {b->upper_x, b->upper_y, b->upper_z};
    return umb_half_area(min, max);
}

/* Boxes tested by a random ray that meets the root: umb_index_stats.cost. */
static double cost_below(const mirror *m, double area)
{
    double cost = area * m->count;
    for (uint32_t k = 0; k < m->count && !m->leaf; ++k) {
        cost += cost_below(m->child[k], area_of(&m->bounds[k]));
    }
    return cost;
}

static double cost_of_embree(RTCDevice device, const umb_aabb *boxes, uint32_t count)
{
    struct RTCBuildPrimitive *p = aligned_alloc(32, count * sizeof *p);
    RTCBVH bvh = rtcNewBVH(device);
    struct RTCBounds all = {INFINITY, INFINITY, INFINITY, 0, -INFINITY, -INFINITY, -INFINITY, 0};
    for (uint32_t i = 0; p != NULL && i < count; ++i) {
        const umb_aabb *b = &boxes[i];
        p[i] = (struct RTCBuildPrimitive){b->min[0], b->min[1], b->min[2], 0, b->max[0], b->max[1], b->max[2], i};
        all.lower_x = fminf(all.lower_x, b->min[0]);
        all.lower_y = fminf(all.lower_y, b->min[1]);
        all.lower_z = fminf(all.lower_z, b->min[2]);
        all.upper_x = fmaxf(all.upper_x, b->max[0]);
        all.upper_y = fmaxf(all.upper_y, b->max[1]);
        all.upper_z = fmaxf(all.upper_z, b->max[2]);
    }
    struct RTCBuildArguments args = rtcDefaultBuildArguments();
    args.byteSize = sizeof args;
    args.buildQuality = RTC_BUILD_QUALITY_MEDIUM;
    args.maxBranchingFactor = UMB_NODE_WIDTH;
    args.sahBlockSize = 1;
    args.minLeafSize = 1;
    args.maxLeafSize = UMB_NODE_WIDTH;
    args.traversalCost = 1.0f;
    args.intersectionCost = 1.0f;
    args.bvh = bvh;
    args.primitives = p;
    args.primitiveCount = args.primitiveArrayCapacity = count;
    args.createNode = make_node;
    args.setNodeChildren = set_children;
    args.setNodeBounds = set_bounds;
    args.createLeaf = make_leaf;
    const mirror *root = p != NULL ? rtcBuildBVH(&args) : NULL;
    double cost = root != NULL ? cost_below(root, area_of(&all)) / area_of(&all) : NAN;
    rtcReleaseBVH(bvh);
    free(p);
    return cost;
}

static bool compare(RTCDevice device, uint32_t count, bool clustered, int rounds)
{
    double reach, ours = INFINITY, theirs = INFINITY;
    umb_scene *scene = make_scene(count, clustered, &reach);
    umb_aabb *boxes = malloc(count * sizeof *boxes);
    umb_index_stats stats = {0};
    bool ok = scene != NULL && boxes != NULL;
    for (uint32_t i = 0; i < count && ok; ++i) {
        ok = umb_scene_object_bounds(scene, i, &boxes[i]);
    }
    for (int round = 0; round < rounds && ok; ++round) {
        umb_index *index = NULL;
        double begin = now_ms();
        ok = umb_index_create(scene, NULL, &index) == UMB_OK;
        ours = fmin(ours, now_ms() - begin);
        theirs = fmin(theirs, time_embree(device, boxes, count));
        if (ok) {
            umb_index_get_stats(index, &stats);
        }
        umb_index_destroy(index);
    }
    if (ok) {
        double cost = cost_of_embree(device, boxes, count);
        printf("| %u | %s | %.2f | %.2f | %.2f | %.1f | %.1f | %.3f |\n", count, clustered ? "clustered" : "uniform", ours,
               theirs, ours / theirs, stats.cost, cost, stats.cost / cost);
        (void)fflush(stdout);
    }
    free(boxes);
    umb_scene_destroy(scene);
    return ok;
}

/* ---- the command line ----------------------------------------------------------------------- */

static void print_embree_head(void)
{
    printf("\nThe default beside Embree's hierarchy of user geometry, medium quality, one thread\n\n| objects | set | ms | "
           "Embree ms | ratio | cost | Embree's cost | ratio |\n|--:|---|--:|--:|--:|--:|--:|--:|\n");
}

static bool is_set(const char *set, bool clustered)
{
    return strcmp(set, "both") == 0 || strcmp(set, clustered ? "clustered" : "uniform") == 0;
}

/* Both sets, or the one named. */
static bool compare_sets(uint32_t count, int rounds, const char *set)
{
    RTCDevice device = rtcNewDevice("threads=1,set_affinity=0");
    bool ok = true;
    for (int clustered = 0; clustered < 2 && ok; ++clustered) {
        ok = !is_set(set, clustered != 0) || compare(device, count, clustered != 0, rounds);
    }
    rtcReleaseDevice(device);
    return ok;
}

static bool measure_sets(uint32_t count, int rounds, const char *set, const char *wanted, bool head)
{
    bool ok = true;
    for (int clustered = 0; clustered < 2 && ok; ++clustered) {
        ok = !is_set(set, clustered != 0) || measure_all(count, clustered != 0, rounds, wanted, head);
    }
    return ok;
}

static const char *word(int argc, char **argv, int k, const char *otherwise)
{
    return argc > k ? argv[k] : otherwise;
}

int main(int argc, char **argv)
{
    bool only = argc > 1 && strcmp(argv[1], "only") == 0, embree = argc > 1 && strcmp(argv[1], "embree") == 0;
    int from = only || embree ? 2 : 1, rounds = atoi(word(argc, argv, from + 1, "3"));
    uint32_t most = (uint32_t)strtoul(word(argc, argv, from, "100000"), NULL, 10);
    const char *set = word(argc, argv, from + 2, "both"), *wanted = word(argc, argv, from + 3, "all");
    bool ok = most >= 1000 && rounds > 0 && (is_set(set, false) || is_set(set, true));
    if (only) {
        ok = ok && measure_sets(most, rounds, set, wanted, false);
    } else if (embree) {
        ok = ok && compare_sets(most, rounds, set);
    } else {
        for (uint32_t count = 1000; count <= most && ok; count *= 10) {
            ok = measure_sets(count, rounds, set, wanted, true);
        }
        print_embree_head();
        for (uint32_t count = 1000; count <= most && ok; count *= 10) {
            ok = compare_sets(count, rounds, set);
        }
    }
    if (!ok) {
        (void)fprintf(stderr, "bench_index: no memory, or no such number\n");
    }
    return ok ? 0 : 1;
}

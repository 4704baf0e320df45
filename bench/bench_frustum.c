/* Assarsson and Möller's experiment again (Gummerus 4.4): plane coherency, octant test, masking and TR coherency, in all
 * combinations, with spheres, boxes and oriented boxes, along paths that turn, go, or both; as a table in Markdown.
 * Then what a test of each kind of volume costs, by planes, by a swept frustum, and exactly.
 *
 *     bench_frustum [ROUNDS [SCENE]]
 *
 * The hierarchy is a binary tree of boxes split in the middle of the longest side, as a program of its own would have
 * one: a volume is tested at a time, a node that is inside is taken whole. Real scenes are found below $UMBRAGE_SCENES.
 * Times are processor time: the least of the rounds for each frame, then the sum over the frames.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "io/model.h"

enum { FRAMES = 120, COMBINATIONS = 16, MASKING = 1u << 3, SHAPES = 3, PATHS = 3 };

typedef struct bench_scene {
    const char *name, *spec, *path; /* below $UMBRAGE_SCENES unless generated */
} bench_scene;

static const bench_scene SCENES[] = {
    {"blocks-100", "gen:blocks,g=100", "gen:blocks,g=100"},
    {"city-1M", "gen:city,triangles=1M", "gen:city,triangles=1M"},
    {"castle", "castle/castle.glb", "castle/castle.path.csv"},
};

static const char *const SHAPE_NAMES[SHAPES] = {"sphere", "box", "oriented box"};
static const char *const PATH_NAMES[PATHS] = {"turning", "going", "free"};

typedef struct tree_node {
    umb_volume volume[SHAPES];
    umb_bounds_past past;
    uint32_t left, right; /* 0: a leaf */
    uint32_t objects;     /* below */
} tree_node;

typedef struct tree {
    tree_node *nodes;
    uint32_t count;
} tree;

static double now_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* ---- the tree ------------------------------------------------------------------------------- */

static void shape_box(tree_node *n, const umb_aabb *box)
{
    double squares = 0.0;
    memset(n->volume, 0, sizeof n->volume);
    for (int s = 0; s < SHAPES; ++s) {
        n->volume[s].kind = (umb_volume_kind[]){UMB_VOLUME_SPHERE, UMB_VOLUME_BOX, UMB_VOLUME_ORIENTED_BOX}[s];
        n->volume[s].box = *box;
        for (int i = 0; i < 3; ++i) {
            n->volume[s].center[i] = 0.5 * ((double)box->min[i] + box->max[i]);
            n->volume[s].axis[i][i] = 0.5 * ((double)box->max[i] - box->min[i]);
        }
    }
    for (int i = 0; i < 3; ++i) {
        squares += n->volume[0].axis[i][i] * n->volume[0].axis[i][i];
    }
    n->volume[0].radius = sqrt(squares) * (1.0 + 1e-12);
}

/* A leaf's oriented box is its mesh's own box under its transform. */
static void shape_object(tree_node *n, const model *m, const model_object *o)
{
    shape_box(n, &o->bounds);
    n->objects = 1;
    if (o->mesh == MODEL_NONE) {
        return;
    }
    const model_mesh *mesh = &m->meshes[o->mesh];
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t v = 0; v < mesh->position_count; ++v) {
        for (int i = 0; i < 3; ++i) {
            low[i] = fmin(low[i], mesh->positions[3 * v + (uint32_t)i]);
            high[i] = fmax(high[i], mesh->positions[3 * v + (uint32_t)i]);
        }
    }
    umb_volume *box = &n->volume[2];
    for (int i = 0; i < 3; ++i) {
        box->center[i] = o->transform.m[i][3];
        for (int j = 0; j < 3; ++j) {
            box->center[i] += o->transform.m[i][j] * 0.5 * (low[j] + high[j]);
            /* World vertices are rounded to floats, which the box must hold: a little more. */
            box->axis[j][i] = o->transform.m[i][j] * 0.5 * (high[j] - low[j]) * (1.0 + 1e-6);
        }
    }
}

static int middle_axis; /* of the split that is going on: qsort has no context */
static const model *sorted;

static int by_middle(const void *a, const void *b)
{
    const umb_aabb *p = &sorted->objects[*(const uint32_t *)a].bounds, *q = &sorted->objects[*(const uint32_t *)b].bounds;
    float x = p->min[middle_axis] + p->max[middle_axis], y = q->min[middle_axis] + q->max[middle_axis];
    return (x > y) - (x < y);
}

static uint32_t build(tree *t, const model *m, uint32_t *ids, uint32_t count)
{
    uint32_t number = t->count++;
    tree_node *n = &t->nodes[number];
    memset(n, 0, sizeof *n);
    if (count == 1) {
        shape_object(n, m, &m->objects[ids[0]]);
        return number;
    }
    umb_aabb box = m->objects[ids[0]].bounds;
    for (uint32_t k = 1; k < count; ++k) {
        const umb_aabb *b = &m->objects[ids[k]].bounds;
        for (int i = 0; i < 3; ++i) {
            box.min[i] = fminf(box.min[i], b->min[i]);
            box.max[i] = fmaxf(box.max[i], b->max[i]);
        }
    }
    shape_box(n, &box);
    n->objects = count;
    middle_axis = 0;
    for (int i = 1; i < 3; ++i) {
        middle_axis = box.max[i] - box.min[i] > box.max[middle_axis] - box.min[middle_axis] ? i : middle_axis;
    }
    sorted = m;
    qsort(ids, count, sizeof ids[0], by_middle);
    uint32_t left = build(t, m, ids, count / 2), right = build(t, m, ids + count / 2, count - count / 2);
    t->nodes[number].left = left;
    t->nodes[number].right = right;
    return number;
}

static bool make_tree(tree *t, const model *m)
{
    uint32_t *ids = malloc(m->object_count * sizeof *ids), count = 0;
    t->count = 0;
    t->nodes = malloc((size_t)2 * m->object_count * sizeof *t->nodes);
    bool ok = ids != NULL && t->nodes != NULL;
    for (uint32_t k = 0; ok && k < m->object_count; ++k) {
        if (m->objects[k].mesh != MODEL_NONE) {
            ids[count++] = k;
        }
    }
    if (ok && count > 0) {
        (void)build(t, m, ids, count);
    }
    free(ids);
    return ok && count > 0;
}

/* ---- views ---------------------------------------------------------------------------------- */

/* From an eye: a turn on the spot, a straight way, or a curve looking about. */
static bool make_view(umb_view *v, const model *m, const double from[3], int path, int frame)
{
    double extent = 0.0, eye[3], target[3], side[3], s = frame / (double)FRAMES;
    const umb_aabb *b = &m->bounds;
    int up = m->up[2] > 0.5 ? 2 : 1, x = up == 2 ? 0 : 2, y = up == 2 ? 1 : 0;
    for (int i = 0; i < 3; ++i) {
        extent = fmax(extent, (double)b->max[i] - b->min[i]);
        eye[i] = from[i];
        side[i] = 0.0;
    }
    double turn = path == 0 ? 1.5 * s : path == 1 ? 0.3 : sin(9.0 * s) + s, way = path == 0 ? 0.0 : 0.1 * extent * s;
    side[x] = cos(turn);
    side[y] = sin(turn);
    for (int i = 0; i < 3; ++i) {
        eye[i] += path == 1 ? way * (i == x ? 0.8 : i == y ? 0.6 : 0.0) : way * side[i];
        target[i] = eye[i] + side[i];
    }
    return umb_view_look_at(v, eye, target, m->up, 1.0471975511965976, 16.0 / 9.0, 1e-4 * extent, 0.5 * extent) == UMB_OK;
}

/* ---- the walk ------------------------------------------------------------------------------- */

typedef struct walk {
    tree *tree;
    umb_bounds_frustum frustum;
    uint32_t switches; /* UMB_BOUNDS_... and MASKING */
    int shape;
    const double *eye; /* the first one */
    uint64_t tests, found;
} walk;

static void visit(walk *w, uint32_t number, uint16_t planes)
{
    tree_node *n = &w->tree->nodes[number];
    uint32_t switches = w->switches & ~(uint32_t)MASKING;
    w->tests += 1;
    umb_place place = umb_bounds_test_again(&w->frustum, &n->volume[w->shape], switches,
                                            switches != 0 ? &n->past : NULL,
                                            (w->switches & MASKING) != 0 ? &planes : NULL);
    if (place == UMB_PLACE_OUTSIDE) {
        return;
    }
    if (place == UMB_PLACE_INSIDE || n->left == 0) {
        w->found += n->objects;
        return;
    }
    visit(w, n->left, planes);
    visit(w, n->right, planes);
}

typedef struct figures {
    double ms;
    uint64_t tests, found;
} figures;

static bool measure(walk *w, const model *m, int path, int rounds, figures *out)
{
    double least[FRAMES];
    umb_view view;
    for (int r = 0; r < rounds; ++r) {
        w->tests = w->found = 0;
        for (uint32_t k = 0; k < w->tree->count; ++k) {
            w->tree->nodes[k].past = (umb_bounds_past){0};
        }
        for (int f = 0; f < FRAMES; ++f) {
            if (!make_view(&view, m, w->eye, path, f) ||
                umb_bounds_prepare(&w->frustum, &view, f > 0 ? &w->frustum : NULL) != UMB_OK) {
                return false;
            }
            double start = now_ms();
            visit(w, 0, UINT16_MAX);
            double ms = now_ms() - start;
            least[f] = r == 0 || ms < least[f] ? ms : least[f];
        }
    }
    *out = (figures){0.0, w->tests, w->found};
    for (int f = 1; f < FRAMES; ++f) { /* the first frame follows none */
        out->ms += least[f];
    }
    return true;
}

static void head(void)
{
    printf("\n| scene | path | volume | tests a frame | found a frame | ms, none |");
    for (uint32_t c = 1; c < COMBINATIONS; ++c) {
        printf(" %s%s%s%s |", (c & UMB_BOUNDS_PLANE) ? "P" : "", (c & UMB_BOUNDS_OCTANT) ? "O" : "",
               (c & MASKING) ? "M" : "", (c & UMB_BOUNDS_MOTION) ? "T" : "");
    }
    printf("\n|---|---|---|---|---|---|");
    for (uint32_t c = 1; c < COMBINATIONS; ++c) {
        printf("---|");
    }
    printf("\n");
}

static bool experiment(const bench_scene *s, const model *m, tree *t, const double eye[3], int rounds)
{
    bool ok = true;
    for (int path = 0; path < PATHS && ok; ++path) {
        for (int shape = 0; shape < SHAPES && ok; ++shape) {
            walk w = {.tree = t, .shape = shape, .eye = eye};
            figures none = {0};
            for (uint32_t c = 0; c < COMBINATIONS && ok; ++c) {
                figures f;
                w.switches = c;
                ok = measure(&w, m, path, rounds, &f);
                if (ok && c == 0) {
                    none = f;
                    printf("| %s | %s | %s | %.0f | %.1f | %.4f |", s->name, PATH_NAMES[path], SHAPE_NAMES[shape],
                           (double)f.tests / FRAMES, (double)f.found / FRAMES, f.ms / (FRAMES - 1));
                } else if (ok) {
                    printf(" %.2f%s |", f.ms / none.ms, f.found == none.found ? "" : " (differs)");
                }
                (void)fflush(stdout);
            }
            printf("\n");
        }
    }
    return ok;
}

/* ---- single tests --------------------------------------------------------------------------- */

static uint64_t random_state = 88172645463325252u;

static double random_in(double low, double high)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return low + (high - low) * ((double)(random_state >> 11) * 0x1p-53);
}

enum { VOLUMES = 4096, HULL_POINTS = 16, KINDS = UMB_VOLUME_HULL + 1 };

static const char *const KIND_NAMES[KINDS] = {"box",      "oriented box", "sphere",    "capsule",
                                              "lozenge",  "cylinder",     "ellipsoid", "hull of 16 points"};

typedef struct crowd {
    umb_volume volumes[VOLUMES];
    float points[VOLUMES][HULL_POINTS][3];
} crowd;

/* Of sizes like the frustum's own, where the planes alone are wrong most often. */
static void make_crowd(crowd *c, umb_volume_kind kind)
{
    for (int k = 0; k < VOLUMES; ++k) {
        umb_volume *v = &c->volumes[k];
        *v = (umb_volume){.kind = kind, .radius = random_in(0.1, 1.0), .points = &c->points[k][0][0],
                          .point_count = HULL_POINTS};
        for (int i = 0; i < 3; ++i) {
            v->center[i] = random_in(-4.0, 4.0);
            float half = (float)random_in(0.1, 2.0);
            v->box.min[i] = (float)v->center[i] - half;
            v->box.max[i] = (float)v->center[i] + half;
            for (int j = 0; j < 3; ++j) {
                v->axis[i][j] = random_in(-1.0, 1.0);
            }
            for (int p = 0; p < HULL_POINTS; ++p) {
                c->points[k][p][i] = (float)(v->center[i] + random_in(-1.0, 1.0));
            }
        }
    }
}

typedef enum way { BY_PLANES, BY_POINT, EXACTLY, WAYS } way;

static double time_way(const crowd *c, const umb_bounds_frustum *f, const umb_bounds_swept *s, way how, int rounds,
                       uint32_t *outside)
{
    double least = INFINITY;
    for (int r = 0; r < rounds; ++r) {
        double start = now_ms();
        *outside = 0;
        for (int k = 0; k < VOLUMES; ++k) {
            const umb_volume *v = &c->volumes[k];
            umb_place place = how == BY_PLANES ? umb_bounds_test(f, v)
                              : how == BY_POINT ? umb_bounds_test_point(s, v->center)
                                                : umb_bounds_test_exact(f, v);
            *outside += place == UMB_PLACE_OUTSIDE;
        }
        least = fmin(least, now_ms() - start);
    }
    return least * 1e6 / VOLUMES;
}

static bool single_tests(int rounds)
{
    crowd *c = malloc(sizeof *c);
    const double eye[3] = {0, 0, 3}, target[3] = {0, 0, 0}, up[3] = {0, 1, 0};
    umb_view view;
    umb_bounds_frustum f;
    if (c == NULL || umb_view_look_at(&view, eye, target, up, 1.0, 1.5, 0.5, 5.0) != UMB_OK ||
        umb_bounds_prepare(&f, &view, NULL) != UMB_OK) {
        free(c);
        return false;
    }
    printf("\n| volume | ns by planes | outside, of %d | ns by a point | ns exact | outside, exact |\n", VOLUMES);
    printf("|---|---|---|---|---|---|\n");
    for (int kind = 0; kind < KINDS; ++kind) {
        umb_bounds_swept s;
        uint32_t planes, point, exact;
        make_crowd(c, (umb_volume_kind)kind);
        umb_bounds_sweep(&s, &f, &c->volumes[0]);
        double by_planes = time_way(c, &f, &s, BY_PLANES, rounds, &planes);
        double by_point = time_way(c, &f, &s, BY_POINT, rounds, &point);
        printf("| %s | %.1f | %u | %.1f |", KIND_NAMES[kind], by_planes, planes, by_point);
        if (kind == UMB_VOLUME_BOX || kind == UMB_VOLUME_ORIENTED_BOX) {
            double exactly = time_way(c, &f, &s, EXACTLY, rounds, &exact);
            printf(" %.1f | %u |\n", exactly, exact);
        } else {
            printf(" | |\n");
        }
    }
    free(c);
    return true;
}

int main(int argc, char **argv)
{
    int rounds = argc > 1 ? atoi(argv[1]) : 5;
    const char *folder = getenv("UMBRAGE_SCENES");
    bool ok = rounds > 0;
    head();
    for (size_t k = 0; k < sizeof SCENES / sizeof SCENES[0] && ok; ++k) {
        const bench_scene *s = &SCENES[k];
        bool generated = strncmp(s->spec, "gen:", 4) == 0;
        if ((argc > 2 && strcmp(argv[2], s->name) != 0) || (!generated && folder == NULL)) {
            continue;
        }
        char file[600], rows[600];
        const char *at = generated ? "" : folder, *slash = generated ? "" : "/";
        (void)snprintf(file, sizeof file, "%s%s%s", at, slash, s->spec);
        (void)snprintf(rows, sizeof rows, "%s%s%s", at, slash, s->path);
        umb_error error = {0};
        camera_path path = {0};
        model *m = model_load(file, NULL, &error);
        tree t = {0};
        ok = m != NULL && camera_path_load(rows, &path, &error) && make_tree(&t, m);
        if (ok) {
            double eye[3];
            for (int i = 0; i < 3; ++i) {
                eye[i] = path.rows[path.count / 3][i] - m->origin[i];
            }
            ok = experiment(s, m, &t, eye, rounds);
        }
        camera_path_free(&path);
        if (!ok) {
            (void)fprintf(stderr, "bench_frustum: %s\n", error.text[0] != '\0' ? error.text : "no memory, or no view");
        }
        free(t.nodes);
        if (m != NULL) {
            model_free(m);
        }
    }
    ok = ok && single_tests(20 * rounds);
    return ok ? 0 : 1;
}

/* One convex occluder and boxes, in whole numbers, where every answer is known: planes and shadow frusta hide exactly what is
 * hidden, but for what touches a tangent plane; occlusion trees that, too, but for what has no width and lies on the outline;
 * the raster never hides more. Eyes on planes and edges of the occluder, boxes that touch its tangents. In whole numbers as small as these nothing is within the bounds of
 * docs/conservative.md, 14, but what touches. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/random_boxes.h"
#include "umbrage/umbrage.h"

__extension__ typedef __int128 wide;

enum { BOXES = 150, CORNERS = 8, FACES = 8 };

static const umb_method METHODS[] = {UMB_METHOD_PLANES, UMB_METHOD_SHADOW_FRUSTA, UMB_METHOD_OCCLUSION_TREE,
                                     UMB_METHOD_RASTER};
enum { METHOD_COUNT = sizeof METHODS / sizeof METHODS[0] };

typedef struct point {
    wide c[3];
} point;

/* A face, its corners counter-clockwise from outside. */
typedef struct face {
    int corners[CORNERS];
    int count;
} face;

/* A polygon is one face, seen from its front alone. */
typedef struct body {
    int points[CORNERS][3];
    face faces[FACES];
    int point_count, face_count;
} body;

typedef struct lattice {
    body occluder;
    int low[BOXES][3], high[BOXES][3];
    umb_scene *scene;
    umb_index *index;
} lattice;

static uint64_t seed = 4711;

static int between(int low, int high)
{
    return low + (int)random_below(&seed, (uint32_t)(high - low + 1));
}

static int rounds(int normal)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size != NULL && size[0] == 's' ? normal / 10 : size != NULL && size[0] == 'f' ? normal * 20 : normal;
}

/* ---- exactly ------------------------------------------------------------------------------------ */

static point whole(const int p[3])
{
    return (point){{p[0], p[1], p[2]}};
}

static point minus(point a, point b)
{
    return (point){{a.c[0] - b.c[0], a.c[1] - b.c[1], a.c[2] - b.c[2]}};
}

static wide dot(point a, point b)
{
    return a.c[0] * b.c[0] + a.c[1] * b.c[1] + a.c[2] * b.c[2];
}

static point cross(point a, point b)
{
    point out;
    for (int k = 0; k < 3; ++k) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        out.c[k] = a.c[i] * b.c[j] - a.c[j] * b.c[i];
    }
    return out;
}

static point corner(const body *b, int f, int k)
{
    return whole(b->points[b->faces[f].corners[k % b->faces[f].count]]);
}

static point normal(const body *b, int f)
{
    return cross(minus(corner(b, f, 1), corner(b, f, 0)), minus(corner(b, f, 2), corner(b, f, 0)));
}

/* Whether the sight-line from p along d, which ends after one d, meets a face from its front before its end; and *touches
 * becomes true if it meets no more than the rim. */
static bool meets(const body *b, int f, point p, point d, bool *touches)
{
    point n = normal(b, f);
    wide over = dot(n, minus(p, corner(b, f, 0))), falls = -dot(n, d);
    if (over <= 0 || over >= falls) { /* the place is over / falls of the way */
        return false;
    }
    bool inside = true;
    for (int k = 0; k < b->faces[f].count; ++k) {
        point a = corner(b, f, k), in = cross(n, minus(corner(b, f, k + 1), a));
        wide side = dot(in, minus(p, a)) * falls + dot(in, d) * over;
        if (side < 0) {
            return false;
        }
        inside = inside && side > 0;
    }
    *touches = !inside;
    return true;
}

/* Well within the picture. */
static bool in_view(const umb_view *v, const int at[3])
{
    double d[3], x = 0.0, y = 0.0, depth = 0.0;
    for (int i = 0; i < 3; ++i) {
        d[i] = at[i] - v->eye[i];
        x += v->right[i] * d[i];
        y += v->up[i] * d[i];
        depth += v->forward[i] * d[i];
    }
    double scale = v->projection == UMB_ORTHOGRAPHIC ? 1.0 : depth;
    return depth > 0x1p-7 && fabs(x) < 0.999 * v->x_max * scale && fabs(y) < 0.999 * v->y_max * scale;
}

/* What is so of a box. */
enum {
    SEEN,
    OUTSIDE,  /* seen, but not in the picture */
    ON_RIM,   /* hidden, and no more than rims of faces are met: it is without width, and seen as a part of the outline */
    TOUCHING, /* hidden, a sight-line touches the rim of a face */
    HIDDEN
};

/* A convex occluder that hides the corners of a box hides it. */
static int look_for(const body *b, const int eye[3], const umb_view *v, const int low[3], const int high[3])
{
    int all = HIDDEN, most = SEEN;
    for (int k = 0; k < 8; ++k) {
        const int at[3] = {k & 1 ? high[0] : low[0], k & 2 ? high[1] : low[1], k & 4 ? high[2] : low[2]};
        const int from[3] = {at[0], at[1], at[2] + 200}; /* parallel ones run along -z */
        point p = whole(v->projection == UMB_ORTHOGRAPHIC ? from : eye), d = minus(whole(at), p);
        int one = in_view(v, at) ? SEEN : OUTSIDE;
        for (int f = 0; f < b->face_count; ++f) {
            bool touches;
            if (meets(b, f, p, d, &touches)) {
                one = !touches ? HIDDEN : one != HIDDEN ? TOUCHING : one;
            }
        }
        all = one < all ? one : all;
        most = one > most ? one : most;
    }
    return all == TOUCHING && most == TOUCHING ? ON_RIM : all;
}

/* ---- scenes -------------------------------------------------------------------------------------- */

/* No volume: not a body. */
static bool flat(const body *b)
{
    bool deep = b->face_count == 1;
    for (int p = 0; p < b->point_count; ++p) {
        deep = deep || dot(normal(b, 0), minus(whole(b->points[p]), corner(b, 0, 0))) != 0;
    }
    for (int f = 0; f < b->face_count && deep; ++f) {
        point n = normal(b, f);
        if (dot(n, n) == 0) {
            return true;
        }
    }
    return !deep;
}

static void add_face(body *b, const int *corners, int count)
{
    face *f = &b->faces[b->face_count++];
    memcpy(f->corners, corners, (size_t)count * sizeof *corners);
    f->count = count;
}

static void place(body *b, int count, const int (*shape)[3])
{
    int at[3] = {between(-3, 3), between(-3, 3), between(-3, 3)}, m[3][3];
    for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k) {
            m[i][k] = between(0, 2) == 0 ? between(-2, 2) : i == k ? between(1, 4) : 0;
        }
    }
    b->point_count = count;
    for (int p = 0; p < count; ++p) {
        for (int i = 0; i < 3; ++i) {
            b->points[p][i] = at[i] + m[i][0] * shape[p][0] + m[i][1] * shape[p][1] + m[i][2] * shape[p][2];
        }
    }
}

static void make_polygon(body *b)
{
    static const int shapes[4][6][3] = {{{-1, -1, 0}, {2, -1, 0}, {-1, 2, 0}},
                                        {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}},
                                        {{-2, -1, 0}, {0, -2, 0}, {2, -1, 0}, {2, 1, 0}, {0, 2, 0}, {-2, 1, 0}},
                                        {{-2, -1, 0}, {1, -1, 0}, {2, 0, 0}, {1, 1, 0}, {-2, 1, 0}}};
    static const int counts[4] = {3, 4, 6, 5}, corners[6] = {0, 1, 2, 3, 4, 5};
    int k = between(0, 3);
    place(b, counts[k], shapes[k]);
    add_face(b, corners, counts[k]);
}

/* A box or an octahedron under any matrix, its faces turned outwards. */
static void make_solid(body *b)
{
    static const int cube[8][3] = {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {1, 1, -1},
                                   {-1, -1, 1},  {1, -1, 1},  {-1, 1, 1},  {1, 1, 1}};
    static const int octahedron[6][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
    static const int quads[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    bool box = between(0, 2) != 0;
    place(b, box ? 8 : 6, box ? cube : octahedron);
    for (int q = 0; q < 6 && box; ++q) {
        add_face(b, quads[q], 4);
    }
    for (int s = 0; s < 8 && !box; ++s) {
        int t[3] = {s & 1 ? 3 : 0, s & 2 ? 4 : 1, s & 4 ? 5 : 2};
        bool turn = ((s ^ s >> 1 ^ s >> 2) & 1) != 0;
        const int corners[3] = {t[0], t[turn ? 2 : 1], t[turn ? 1 : 2]};
        add_face(b, corners, 3);
    }
    point n = normal(b, 0), to = minus(corner(b, 0, 0), (point){{0, 0, 0}});
    point centre = {{0, 0, 0}};
    for (int p = 0; p < b->point_count; ++p) {
        for (int i = 0; i < 3; ++i) {
            centre.c[i] += b->points[p][i];
        }
    }
    to = (point){{to.c[0] * b->point_count - centre.c[0], to.c[1] * b->point_count - centre.c[1],
                  to.c[2] * b->point_count - centre.c[2]}};
    for (int f = 0; f < b->face_count && dot(n, to) < 0; ++f) {
        face turned = b->faces[f];
        for (int k = 0; k < turned.count; ++k) {
            b->faces[f].corners[k] = turned.corners[turned.count - 1 - k];
        }
    }
}

static void add_occluder(lattice *l)
{
    static const umb_transform identity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    const body *b = &l->occluder;
    float positions[CORNERS][3];
    uint32_t indices[3 * FACES * CORNERS], n = 0, id;
    for (int p = 0; p < b->point_count; ++p) {
        for (int i = 0; i < 3; ++i) {
            positions[p][i] = (float)b->points[p][i];
        }
    }
    for (int f = 0; f < b->face_count; ++f) {
        for (int k = 2; k < b->faces[f].count; ++k) {
            indices[n++] = (uint32_t)b->faces[f].corners[0];
            indices[n++] = (uint32_t)b->faces[f].corners[k - 1];
            indices[n++] = (uint32_t)b->faces[f].corners[k];
        }
    }
    umb_shape shape;
    umb_shape_def def = {.positions = positions[0], .position_count = (uint32_t)b->point_count, .indices = indices,
                         .index_count = n};
    assert_int_equal(umb_scene_add_shape(l->scene, &def, &shape), UMB_OK);
    assert_int_equal(umb_scene_add_occluder(l->scene, shape, &identity, &id), UMB_OK);
}

static void make(lattice *l)
{
    do {
        memset(&l->occluder, 0, sizeof l->occluder);
        if (between(0, 1) == 0) {
            make_polygon(&l->occluder);
        } else {
            make_solid(&l->occluder);
        }
    } while (flat(&l->occluder));
    assert_int_equal(umb_scene_create(&(umb_scene_def){.error = NULL}, &l->scene), UMB_OK);
    add_occluder(l);
    for (int n = 0; n < BOXES; ++n) {
        umb_object_def def = {.bounds = {{0, 0, 0}, {0, 0, 0}}};
        uint32_t id;
        for (int i = 0; i < 3; ++i) {
            l->low[n][i] = between(-30, 28);
            l->high[n][i] = l->low[n][i] + between(0, between(0, 1) == 0 ? 1 : 4);
            def.bounds.min[i] = (float)l->low[n][i];
            def.bounds.max[i] = (float)l->high[n][i];
        }
        assert_int_equal(umb_scene_add_object(l->scene, &def, &id), UMB_OK);
    }
    assert_int_equal(umb_scene_commit(l->scene), UMB_OK);
    assert_int_equal(umb_index_create(l->scene, NULL, &l->index), UMB_OK);
}

/* Every third eye lies in the plane of a face, now and then on one of its edges' lines. */
static void place_eye(const body *b, int eye[3])
{
    for (int i = 0; i < 3; ++i) {
        eye[i] = between(-12, 12);
    }
    if (between(0, 2) == 0) {
        int f = between(0, b->face_count - 1), s = between(-3, 3), t = between(-1, 1) * between(0, 3);
        for (int i = 0; i < 3; ++i) {
            const int *p = b->points[b->faces[f].corners[0]], *q = b->points[b->faces[f].corners[1]];
            const int *r = b->points[b->faces[f].corners[2]];
            eye[i] = p[i] + s * (q[i] - p[i]) + t * (r[i] - p[i]);
        }
    }
}

/* Looks at the occluder; false if the near plane cuts it, which then hides less. */
static bool look(const lattice *l, int eye[3], bool parallel, umb_view *v)
{
    static const double up[3] = {0.1, 1.0, 0.05};
    const int *at = l->occluder.points[0];
    double from[3] = {eye[0], eye[1], eye[2]}, to[3] = {at[0] + 0.25, at[1] + 0.5, at[2] + 0.125};
    if (parallel) {
        const double above[3] = {0, 0, 64}, origin[3] = {0, 0, 0};
        assert_int_equal(umb_view_look_at_ortho(v, above, origin, up, 100.0, 1.0, 0.0, 256.0), UMB_OK);
        return true;
    }
    assert_int_equal(umb_view_look_at(v, from, to, up, 2.6, 1.0, 0x1p-8, 256.0), UMB_OK);
    for (int p = 0; p < l->occluder.point_count; ++p) {
        double depth = 0.0;
        for (int i = 0; i < 3; ++i) {
            depth += v->forward[i] * (l->occluder.points[p][i] - from[i]);
        }
        if (depth < 0x1p-7) {
            return false;
        }
    }
    return true;
}

typedef struct tally {
    uint64_t asked, hidden, touching;
    uint64_t wrong[METHOD_COUNT], missed[METHOD_COUNT], missed_touching[METHOD_COUNT], missed_on_rim[METHOD_COUNT];
} tally;

/* seen[0]: without occlusion */
static void judge(const lattice *l, const int eye[3], const umb_view *view, bool whole_occluder,
                  uint8_t seen[1 + METHOD_COUNT][BOXES], tally *sum)
{
    for (int n = 0; n < BOXES; ++n) {
        int exact = look_for(&l->occluder, eye, view, l->low[n], l->high[n]);
        if (seen[0][n] == 0 || exact == OUTSIDE) {
            continue;
        }
        sum->asked += 1;
        sum->hidden += exact == HIDDEN;
        sum->touching += exact == TOUCHING || exact == ON_RIM;
        for (int m = 0; m < METHOD_COUNT; ++m) {
            bool shown = seen[1 + m][n] != 0;
            sum->wrong[m] += exact == SEEN && !shown;
            sum->missed[m] += whole_occluder && exact == HIDDEN && shown;
            sum->missed_touching[m] += whole_occluder && exact == TOUCHING && shown;
            sum->missed_on_rim[m] += whole_occluder && exact == ON_RIM && shown;
        }
    }
}

static void check(const lattice *l, bool parallel, tally *sum)
{
    static uint8_t seen[1 + METHOD_COUNT][BOXES];
    int eye[3];
    umb_view view;
    place_eye(&l->occluder, eye);
    if (!parallel && memcmp(eye, l->occluder.points[0], sizeof eye) == 0) {
        return;
    }
    bool whole_occluder = look(l, eye, parallel, &view);
    memset(seen, 0, sizeof seen);
    for (int m = 0; m <= METHOD_COUNT; ++m) {
        umb_culler_def def = {.method = m == 0 ? UMB_METHOD_NONE : METHODS[m - 1]};
        umb_culler *culler;
        umb_visible_set answer;
        assert_int_equal(umb_culler_create(l->index, &def, &culler), UMB_OK);
        assert_int_equal(umb_cull(culler, &view, &answer), UMB_OK);
        for (uint32_t i = 0; i < answer.count; ++i) {
            seen[m][answer.objects[i]] = 1;
        }
        umb_culler_destroy(culler);
    }
    judge(l, eye, &view, whole_occluder, seen, sum);
}

static void test_exact(void **state)
{
    (void)state;
    tally sum = {0};
    for (int round = 0; round < rounds(1500); ++round) {
        lattice l;
        make(&l);
        for (int i = 0; i < 6; ++i) {
            check(&l, i == 5, &sum);
        }
        umb_index_destroy(l.index);
        umb_scene_destroy(l.scene);
    }
    printf("# one occluder: boxes %llu, hidden %llu, hidden and touching a tangent %llu\n", (unsigned long long)sum.asked,
           (unsigned long long)sum.hidden, (unsigned long long)sum.touching);
    for (int m = 0; m < METHOD_COUNT; ++m) {
        printf("# one occluder, %s: wrongly hidden %llu, not found hidden %llu, touching and not found hidden %llu, on the rim alone %llu\n",
               umb_method_name(METHODS[m]), (unsigned long long)sum.wrong[m], (unsigned long long)sum.missed[m],
               (unsigned long long)sum.missed_touching[m], (unsigned long long)sum.missed_on_rim[m]);
        assert_int_equal(sum.wrong[m], 0);
        assert_true(METHODS[m] != UMB_METHOD_OCCLUSION_TREE || sum.missed_touching[m] == 0);
        assert_true(METHODS[m] == UMB_METHOD_RASTER || sum.missed[m] == 0);
    }
    assert_true(sum.hidden > sum.asked / 100 && sum.touching > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_exact)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

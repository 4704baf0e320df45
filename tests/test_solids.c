/* What the refinement stands on: which surfaces are solids, bodies inside them, segments that only touch a body, beams with a
 * hole in what blocks them; against winding numbers, whole numbers and known holes. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "bake/beam.h"
#include "bake/closed_solid.h"
#include "bake/pieces.h"
#include "bake/solid_inner.h"
#include "geometry/transform.h"
#include "scene/mesh.h"
#include "support/surfaces.h"

static uint32_t times(uint32_t small)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size == NULL ? 4 * small : size[0] == 's' ? small : 40 * small;
}

/* ---- which surfaces are solids --------------------------------------------------------------------- */

enum { CUBE, L_SHAPE, U_SHAPE, DENTED, APART, SOLIDS, /* and those that are none: */
       LACKING = SOLIDS, TURNED, INSIDE_OUT, CROSSING, HOLLOW, TWO_SIDED, SHARED_EDGE, CROSSED, FLAT, CASES };

static void make_surface(int kind, surface *s)
{
    static const int none[3] = {0, 0, 0}, apart[3] = {20, 3, 1}, across[3] = {3, 2, 5}, inside[3] = {2, 1, 3}, beside[3] = {8, 8, 0};
    static const outline small = {{{0, 0}, {3, 0}, {3, 3}, {0, 3}}, 4, {{0, 1, 2}, {0, 2, 3}}, 2};
    const outline *first = kind == L_SHAPE ? &CORNER : kind == U_SHAPE ? &YARD : kind == DENTED ? &ARROW : kind == CROSSED ? &BOW : &SQUARE;
    memset(s, 0, sizeof *s);
    add_outline(s, first, none, kind == FLAT ? 0 : 7);
    uint32_t faces = s->face_count;
    if (kind == APART || kind == CROSSING || kind == SHARED_EDGE) {
        add_outline(s, &SQUARE, kind == APART ? apart : kind == CROSSING ? across : beside, 7);
    } else if (kind == HOLLOW) {
        add_outline(s, &small, inside, 2);
    }
    for (uint32_t i = kind == HOLLOW ? faces : 0; i < s->face_count && (kind == HOLLOW || kind == INSIDE_OUT); ++i) {
        turn_face(s, i);
    }
    if (kind == TURNED) {
        turn_face(s, 5);
    }
    s->face_count -= kind == LACKING ? 1 : 0;
    s->flags[3] = kind == TWO_SIDED ? UMB_TRIANGLE_TWO_SIDED : 0;
}

static void test_known_surfaces(void **state)
{
    (void)state;
    dice d = {71};
    for (int n = 0; n < 12 * CASES; ++n) {
        surface s;
        solid_case c;
        bool mirrored = n / CASES % 2 == 1;
        umb_transform t = draw_transform(&d, mirrored);
        make_surface(n % CASES, &s);
        open_case(&s, n < CASES ? NULL : &t, n >= CASES && mirrored, &c);
        assert_int_equal(umb_closed_solid(&c.occluder, (const float(*)[3])c.points), n % CASES < SOLIDS);
        close_case(&c);
    }
}

/* Points of whole numbers moved at random: what is called a solid goes nowhere round a point the wrong way. */
static void test_moved_surfaces(void **state)
{
    (void)state;
    dice d = {72};
    uint32_t solids = 0, others = 0;
    for (uint32_t n = 0; n < times(2000); ++n) {
        surface s;
        solid_case c;
        static const int kinds[] = {CUBE, L_SHAPE, U_SHAPE, DENTED, APART, CROSSED, CROSSING};
        make_surface(kinds[n % 7], &s);
        for (uint32_t i = dice_roll(&d, 4); i > 0; --i) {
            s.points[dice_roll(&d, s.point_count)][dice_roll(&d, 3)] += (float)dice_roll(&d, 15) - 7.0f;
        }
        open_case(&s, NULL, false, &c);
        if (!umb_closed_solid(&c.occluder, (const float(*)[3])c.points)) {
            others += 1;
        } else {
            solids += 1;
            for (int i = 0; i < 60; ++i) {
                double x[3];
                point_in(&d, &c.occluder.bounds, x);
                assert_true(winding(&c, x) > -0.5);
            }
        }
        close_case(&c);
    }
    assert_true(solids > 100 && others > 100);
}

/* ---- bodies inside ---------------------------------------------------------------------------------- */

/* What bodies hold is inside what they come from: solids, and surfaces of all kinds, from which none may come. */
static void test_inner_bodies(void **state)
{
    (void)state;
    dice d = {73};
    uint32_t inside = 0, bodies = 0;
    for (uint32_t n = 0; n < times(1200); ++n) {
        surface s;
        solid_case c;
        uint32_t way = dice_roll(&d, 3);
        umb_transform t = draw_transform(&d, way == 2);
        make_surface((int)(n % CASES), &s);
        for (uint32_t i = dice_roll(&d, 3); i > 0; --i) {
            s.points[dice_roll(&d, s.point_count)][dice_roll(&d, 3)] += (float)dice_roll(&d, 5) - 2.0f;
        }
        open_case(&s, way == 0 ? NULL : &t, way == 2, &c);
        umb_solids found = {.allocator = &c.allocator, .reach = 200.0};
        assert_int_equal(umb_solids_add_inner(&found, &c.occluder, 0), UMB_OK);
        bodies += (uint32_t)found.count;
        inside += check_bodies(&d, &c, &found);
        umb_solids_free(&found);
        close_case(&c);
    }
    assert_true(bodies > 500 && inside > 5000);
}

/* ---- pieces that block ---------------------------------------------------------------------------------- */

/* Where a segment meets a triangle from a side that blocks, if only just: 2 for nowhere. */
static double front_at(const solid_case *c, uint32_t triangle, const double from[3], const double to[3])
{
    const uint32_t *t = c->mesh->triangles[triangle];
    const float *p = c->points[t[0]], *q = c->points[t[c->occluder.mirrored ? 2 : 1]], *r = c->points[t[c->occluder.mirrored ? 1 : 2]];
    double e[3], f[3], way[3], s[3], n[3], m[3];
    for (int k = 0; k < 3; ++k) {
        e[k] = (double)q[k] - p[k];
        f[k] = (double)r[k] - p[k];
        way[k] = to[k] - from[k];
        s[k] = from[k] - p[k];
    }
    for (int k = 0; k < 3; ++k) {
        n[k] = e[(k + 1) % 3] * f[(k + 2) % 3] - e[(k + 2) % 3] * f[(k + 1) % 3];
        m[k] = s[(k + 1) % 3] * way[(k + 2) % 3] - s[(k + 2) % 3] * way[(k + 1) % 3];
    }
    double det = -(n[0] * way[0] + n[1] * way[1] + n[2] * way[2]);
    double x = (f[0] * m[0] + f[1] * m[1] + f[2] * m[2]) / det, y = -(e[0] * m[0] + e[1] * m[1] + e[2] * m[2]) / det;
    double at = (s[0] * n[0] + s[1] * n[1] + s[2] * n[2]) / det;
    return (det > 0.0 || c->mesh->two_sided[triangle] != 0) && x > -1e-9 && y > -1e-9 && x + y < 1.0 + 1e-9 && at > -1e-9 && at < 1.0 + 1e-9 ? at : 2.0;
}

static bool is_stopped(const solid_case *c, const double from[3], const double to[3])
{
    for (uint32_t t = 0; t < c->mesh->triangle_count; ++t) {
        if (front_at(c, t, from, to) < 2.0) {
            return true;
        }
    }
    return false;
}

typedef struct pieces_check {
    const solid_case *c;
    dice *d;
    double min[3], max[3]; /* the cell */
    uint32_t convex, disks;
} pieces_check;

static uint32_t find_point(const umb_piece *piece, const float p[3])
{
    for (uint32_t i = 0; i < piece->count; ++i) {
        if (piece->points[i][0] == p[0] && piece->points[i][1] == p[1] && piece->points[i][2] == p[2]) {
            return i;
        }
    }
    return UMB_NONE;
}

/* An edge of a disk's border, or inside it. */
static bool has_edge(const umb_piece *piece, uint32_t a, uint32_t b)
{
    bool border = a < piece->ring && b < piece->ring && ((a + 1) % piece->ring == b || (b + 1) % piece->ring == a);
    for (uint32_t i = 0; i < piece->edge_count && !border; ++i) {
        const uint8_t *e = piece->edges[i];
        border = (e[0] == a && e[1] == b) || (e[0] == b && e[1] == a);
    }
    return border;
}

/* Whatever leaves the cell through a triangle of a disk has met a front. */
static void check_disk(pieces_check *x, const umb_piece *piece)
{
    for (uint32_t t = 0; t < x->c->mesh->triangle_count; ++t) {
        uint32_t i[3];
        for (int k = 0; k < 3; ++k) {
            i[k] = find_point(piece, x->c->points[x->c->mesh->triangles[t][k]]);
        }
        if (i[0] == UMB_NONE || i[1] == UMB_NONE || i[2] == UMB_NONE || !has_edge(piece, i[0], i[1]) || !has_edge(piece, i[1], i[2]) ||
            !has_edge(piece, i[2], i[0])) {
            continue;
        }
        for (int n = 0; n < 10; ++n) {
            double a = dice_between(x->d, 0.05, 0.9), b = dice_between(x->d, 0.05, 0.95 - a), from[3], to[3];
            for (int k = 0; k < 3; ++k) {
                from[k] = dice_between(x->d, x->min[k], x->max[k]);
                to[k] = (1 - a - b) * piece->points[i[0]][k] + a * piece->points[i[1]][k] + b * piece->points[i[2]][k];
                to[k] += 1e-6 * (to[k] - from[k]);
            }
            x->disks += 1;
            assert_true(is_stopped(x->c, from, to));
        }
    }
}

/* Whatever gets into a convex piece has met a front. */
static void check_convex(pieces_check *x, const umb_piece *piece)
{
    for (int n = 0; n < 40; ++n) {
        double shares[UMB_UMBRA_VERTICES], sum = 0.0, from[3], to[3] = {0, 0, 0};
        for (uint32_t i = 0; i < piece->count; ++i) {
            shares[i] = dice_between(x->d, 0.01, 1);
            sum += shares[i];
        }
        for (int k = 0; k < 3; ++k) {
            from[k] = dice_between(x->d, x->min[k], x->max[k]);
            for (uint32_t i = 0; i < piece->count; ++i) {
                to[k] += shares[i] / sum * piece->points[i][k];
            }
        }
        x->convex += 1;
        assert_true(is_stopped(x->c, from, to));
    }
}

static void check_piece(void *user, const umb_piece *piece)
{
    pieces_check *x = user;
    if (piece->convex) {
        check_convex(x, piece);
    } else {
        check_disk(x, piece);
    }
}

/* Cells beside, across and inside: pieces block what leaves the cell through them. */
static void test_pieces(void **state)
{
    (void)state;
    dice d = {76};
    uint32_t convex = 0, disks = 0;
    for (uint32_t n = 0; n < times(1500); ++n) {
        surface s;
        solid_case c;
        bool mirrored = dice_roll(&d, 2) == 0;
        umb_transform t = draw_transform(&d, mirrored);
        uint8_t known[1] = {0};
        double corners[8][3];
        make_surface((int)(n % CASES), &s);
        open_case(&s, &t, mirrored, &c);
        pieces_check x = {.c = &c, .d = &d};
        point_in(&d, &c.occluder.bounds, x.min);
        for (int k = 0; k < 3; ++k) {
            x.min[k] += dice_roll(&d, 2) == 0 ? 0.0 : dice_between(&d, -40, 40);
            x.max[k] = x.min[k] + dice_between(&d, 0, dice_roll(&d, 3) == 0 ? 8 : 1);
        }
        umb_box_corners(x.min, x.max, corners);
        umb_pieces p = {.allocator = &c.allocator, .corners = (const double(*)[3])corners, .reach = 200.0, .emit = check_piece, .user = &x,
                        .known = known};
        assert_int_equal(umb_pieces_cut(&p, &c.occluder, 0), UMB_OK);
        convex += x.convex;
        disks += x.disks;
        umb_pieces_free(&p);
        close_case(&c);
    }
    assert_true(convex > 1000 && disks > 10000);
}

/* ---- segments that touch ----------------------------------------------------------------------------- */

static void make_convex(dice *d, surface *s)
{
    static const int none[3] = {0, 0, 0};
    memset(s, 0, sizeof *s);
    if (dice_roll(d, 2) == 0) {
        add_outline(s, &SQUARE, none, 5);
        return;
    }
    for (int i = 0; i < 4; ++i) {
        for (int k = 0; k < 3; ++k) {
            s->points[i][k] = (float)dice_roll(d, 12) + (i == k ? 20.0f : 0.0f);
        }
    }
    s->point_count = 4;
    add_face(s, 0, 1, 2);
    add_face(s, 3, 1, 0);
    add_face(s, 3, 2, 1);
    add_face(s, 3, 0, 2);
}

/* Two points exactly in the plane of a face. */
static void points_on_plane(dice *d, const solid_case *c, double out[2][3])
{
    const uint32_t *t = c->mesh->triangles[dice_roll(d, c->mesh->triangle_count)];
    for (int e = 0; e < 2; ++e) {
        int x = (int)dice_roll(d, 7) - 3, y = (int)dice_roll(d, 7) - 3;
        for (int k = 0; k < 3; ++k) {
            double a = c->points[t[0]][k];
            out[e][k] = a + x * (c->points[t[1]][k] - a) + y * (c->points[t[2]][k] - a);
        }
    }
}

/* A segment in the plane of a face, along an edge or through a corner only touches: it meets nothing. One through the middle
 * does. */
static void test_touching(void **state)
{
    (void)state;
    dice d = {74};
    uint32_t bodies = 0;
    for (uint32_t n = 0; n < times(400); ++n) {
        surface s;
        solid_case c;
        double corners[8][3], min[3] = {-90, -90, -90}, max[3] = {-80, -81, -82};
        make_convex(&d, &s);
        open_case(&s, NULL, false, &c);
        umb_solids found = {.allocator = &c.allocator};
        umb_box_corners(min, max, corners);
        assert_true(umb_solids_begin(&found, 1, 128.0));
        assert_int_equal(umb_solids_find(&found, &c.occluder, 0), UMB_OK);
        assert_true(umb_solids_apart(&found, &c.occluder, 0, (const double(*)[3])corners));
        bool added = found.count > 0 && c.mesh->convex;
        bodies += added ? 1 : 0;
        for (int i = 0; i < 40 && added; ++i) {
            double p[2][3], a[8][3], b[8][3];
            points_on_plane(&d, &c, p);
            for (int j = 0; j < 8; ++j) {
                memcpy(a[j], p[0], sizeof a[j]);
                memcpy(b[j], p[1], sizeof b[j]);
            }
            assert_false(umb_solid_meets(&found, &found.items[0], p[0], p[1]));
            assert_true(umb_solid_blocks(&found, &found.items[0], (const double(*)[3])a, (const double(*)[3])b) == 0);
            for (int k = 0; k < 3; ++k) {
                p[1][k] = found.items[0].inner[k] + (found.items[0].inner[k] - corners[i % 8][k]);
            }
            assert_true(umb_solid_meets(&found, &found.items[0], corners[i % 8], p[1]));
        }
        umb_solids_free(&found);
        close_case(&c);
    }
    assert_true(bodies > 50);
}

/* ---- the cell beside an occluder ------------------------------------------------------------------- */

/* The box has nothing in common with the bounds of the points, or lies beyond all of them as a triangle's plane sees it. Whole
 * numbers and their 1024ths: nothing of it is rounded. */
static bool surely_apart(const solid_case *c, const double box[8][3], bool planes)
{
    const umb_aabb *b = &c->occluder.bounds;
    bool apart = false;
    for (int k = 0; k < 3; ++k) {
        apart = apart || box[0][k] > b->max[k] || box[7][k] < b->min[k];
    }
    for (uint32_t t = 0; t < c->mesh->triangle_count && planes && !apart; ++t) {
        const uint32_t *v = c->mesh->triangles[t];
        double e[2][3], n[3], most = -INFINITY, least = INFINITY;
        for (int k = 0; k < 3; ++k) {
            e[0][k] = (double)c->points[v[1]][k] - c->points[v[0]][k];
            e[1][k] = (double)c->points[v[2]][k] - c->points[v[0]][k];
        }
        for (int k = 0; k < 3; ++k) {
            n[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
        }
        for (uint32_t i = 0; i < c->mesh->position_count; ++i) {
            most = fmax(most, n[0] * c->points[i][0] + n[1] * c->points[i][1] + n[2] * c->points[i][2]);
        }
        for (int i = 0; i < 8; ++i) {
            least = fmin(least, n[0] * box[i][0] + n[1] * box[i][1] + n[2] * box[i][2]);
        }
        apart = least > most;
    }
    return apart;
}

/* Somewhere near a corner of the occluder, by whole numbers or a little off. */
static void draw_beside(dice *d, const solid_case *c, double box[8][3])
{
    double min[3], max[3];
    const float *p = c->points[dice_roll(d, c->mesh->position_count)];
    bool touching = dice_roll(d, 2) == 0;
    for (int k = 0; k < 3; ++k) {
        double size = dice_roll(d, 6), off = touching ? 0.0 : ((int)dice_roll(d, 3) - 1) / 1024.0;
        min[k] = p[k] + (int)dice_roll(d, 9) - 4.0 + off;
        max[k] = min[k] + size;
        if (dice_roll(d, 4) == 0) { /* a corner that is the point's */
            min[k] = dice_roll(d, 2) == 0 ? p[k] + off : p[k] + off - size;
            max[k] = min[k] + size;
        }
    }
    umb_box_corners(min, max, box);
}

/* A box is apart if the reference says so: by planes too if the occluder is one body that is convex. */
static void test_apart(void **state)
{
    (void)state;
    dice d = {77};
    uint32_t apart = 0, by_planes = 0, near = 0;
    for (uint32_t n = 0; n < times(800); ++n) {
        surface s;
        solid_case c;
        if (n % 2 == 0) {
            make_convex(&d, &s);
        } else {
            make_surface((int)(n / 2 % CASES), &s);
        }
        open_case(&s, NULL, false, &c);
        umb_solids found = {.allocator = &c.allocator};
        assert_true(umb_solids_begin(&found, 1, 128.0));
        assert_int_equal(umb_solids_find(&found, &c.occluder, 0), UMB_OK);
        for (int i = 0; i < 40; ++i) {
            double box[8][3];
            draw_beside(&d, &c, box);
            bool is = umb_solids_apart(&found, &c.occluder, 0, (const double(*)[3])box);
            bool planes = c.mesh->convex && found.count == 1;
            assert_int_equal(is, surely_apart(&c, (const double(*)[3])box, planes));
            apart += is ? 1 : 0;
            near += is ? 0 : 1;
            by_planes += is && !surely_apart(&c, (const double(*)[3])box, false) ? 1 : 0;
        }
        umb_solids_free(&found);
        close_case(&c);
    }
    printf("%u apart, %u of them by planes, %u not\n", apart, by_planes, near);
    assert_true(apart > 3000 && by_planes > 500 && near > 3000);
}

/* ---- all segments at once --------------------------------------------------------------------------- */

/* Planes around a ball. */
static void draw_ball(dice *d, uint32_t planes, umb_solid *body, umb_solid_plane *out)
{
    double radius = dice_between(d, 1, 5);
    *body = (umb_solid){.plane_count = planes};
    for (uint32_t i = 0; i < planes; ++i) {
        double n[3], length = 0.0;
        for (int k = 0; k < 3; ++k) {
            n[k] = i < 6 ? (i / 2 == (uint32_t)k ? (i % 2 == 0 ? 1.0 : -1.0) : 0.0) : dice_between(d, -1, 1);
            length += n[k] * n[k];
        }
        for (int k = 0; k < 3; ++k) {
            out[i].plane[k] = n[k] / sqrt(length);
        }
        out[i].plane[3] = -radius * dice_between(d, 0.9, 1.1);
        out[i].beyond = INFINITY;
    }
}

/* Eight points: a box, flat ones too, or any. */
static void draw_eight(dice *d, double x, double out[8][3])
{
    double min[3], max[3], size = exp(dice_between(d, log(1e-3), log(3.0)));
    uint32_t kind = dice_roll(d, 5);
    for (int k = 0; k < 3; ++k) {
        min[k] = (k == 0 ? x : 0.0) + (kind == 4 ? (double)((int)dice_roll(d, 7) - 3) : dice_between(d, -3, 3));
        max[k] = min[k] + (kind == 0 ? 0.0 : kind == 4 ? (double)dice_roll(d, 3) : size * dice_between(d, 0, 1));
    }
    umb_box_corners(min, max, out);
    for (int i = 0; i < 8 && kind == 1; ++i) {
        for (int k = 0; k < 3; ++k) {
            out[i][k] += size * dice_between(d, -1, 1);
        }
    }
}

static void test_blocks_all(void **state)
{
    (void)state;
    dice d = {78};
    uint32_t all[2] = {0, 0}, some[2] = {0, 0};
    umb_solid body;
    umb_solid_plane planes[64];
    umb_solids solids = {.items = &body, .planes = planes, .count = 1};
    for (uint32_t n = 0; n < times(20000); ++n) {
        double a[8][3], b[8][3];
        uint32_t count = n % 4 == 0 ? 31 + dice_roll(&d, 4) : n % 2 == 0 ? 40 + dice_roll(&d, 24) : 6 + dice_roll(&d, 8);
        memset(planes, 0, sizeof planes);
        draw_ball(&d, count, &body, planes);
        draw_eight(&d, dice_roll(&d, 8) == 0 ? 0.0 : -8.0, a);
        draw_eight(&d, dice_roll(&d, 8) == 0 ? 0.0 : 9.0, b);
        uint64_t blocked = umb_solid_blocks(&solids, &body, (const double(*)[3])a, (const double(*)[3])b);
        assert_int_equal(umb_solid_blocks_all(&solids, &body, (const double(*)[3])a, (const double(*)[3])b), blocked == UINT64_MAX);
        for (int i = 0; i < 64; i += 9) {
            assert_int_equal(blocked >> i & 1, umb_solid_meets(&solids, &body, a[i / 8], b[i % 8]));
        }
        all[count > 32] += blocked == UINT64_MAX ? 1 : 0;
        some[count > 32] += blocked != UINT64_MAX && blocked != 0 ? 1 : 0;
    }
    printf("%u and %u all blocked, %u and %u in part\n", all[0], all[1], some[0], some[1]);
    assert_true(all[0] > 500 && all[1] > 500 && some[0] > 100 && some[1] > 100);
}

/* ---- beams ------------------------------------------------------------------------------------------ */

typedef struct wall {
    umb_solid items[5];
    umb_solid_plane planes[30];
    umb_solids solids;
} wall;

/* Boxes along the axes. */
static void add_box(wall *w, const double min[3], const double max[3])
{
    size_t at = w->solids.count++;
    w->items[at] = (umb_solid){.first_plane = (uint32_t)(6 * at), .plane_count = 6};
    for (int k = 0; k < 3; ++k) {
        w->items[at].bounds.min[k] = nextafterf((float)min[k], -INFINITY);
        w->items[at].bounds.max[k] = nextafterf((float)max[k], INFINITY);
        w->items[at].inner[k] = 0.5 * (min[k] + max[k]);
        umb_solid_plane *low = &w->planes[6 * at + 2 * (size_t)k], *high = low + 1;
        low->plane[k] = -1.0;
        low->plane[3] = min[k];
        high->plane[k] = 1.0;
        high->plane[3] = -max[k];
        low->beyond = high->beyond = INFINITY;
    }
}

/* Four boxes around a hole at a point of the plane x = at[0], which may be filled. */
static void make_wall(dice *d, const double at[3], double wide, double far, bool filled, wall *w)
{
    memset(w, 0, sizeof *w);
    w->solids.items = w->items;
    w->solids.planes = w->planes;
    w->solids.reach = 100.0;
    double left = wide * dice_between(d, 0.05, 0.95), low = wide * dice_between(d, 0.05, 0.95), thick = 0.02 * wide;
    double y[2] = {at[1] - left, at[1] - left + wide}, z[2] = {at[2] - low, at[2] - low + wide}, x[2] = {at[0] - thick, at[0] + thick};
    add_box(w, (double[3]){x[0], -far, -far}, (double[3]){x[1], y[0], far});
    add_box(w, (double[3]){x[0], y[1], -far}, (double[3]){x[1], far, far});
    add_box(w, (double[3]){x[0], -far, -far}, (double[3]){x[1], far, z[0]});
    add_box(w, (double[3]){x[0], -far, z[1]}, (double[3]){x[1], far, far});
    if (filled) {
        add_box(w, (double[3]){x[0], y[0] - 2.0, z[0] - 2.0}, (double[3]){x[1], y[1] + 2.0, z[1] + 2.0});
    }
}

static umb_beam_part draw_part(dice *d, double x)
{
    umb_beam_part p = {{x, dice_between(d, -2, 2), dice_between(d, -2, 2)}, {{0}}, false};
    bool flat = dice_roll(d, 4) == 0, turned = dice_roll(d, 2) == 0;
    for (int a = 0; a < 3; ++a) {
        for (int k = 0; k < 3; ++k) {
            p.axes[a][k] = a == k || turned ? dice_between(d, -1, 1) : 0.0;
        }
    }
    for (int k = 0; k < 3 && flat; ++k) {
        p.axes[dice_roll(d, 3)][k] = 0.0;
    }
    return p;
}

static umb_beam_part draw_triangle(dice *d, double x)
{
    double p[3][3];
    bool thin = dice_roll(d, 4) == 0;
    for (int c = 0; c < 3; ++c) {
        for (int k = 0; k < 3; ++k) {
            p[c][k] = thin && c == 2 ? 0.5 * (p[0][k] + p[1][k]) + dice_between(d, -1e-4, 1e-4)
                                     : (k == 0 ? x : 0.0) + dice_between(d, -2, 2);
        }
    }
    return umb_beam_triangle((const double(*)[3])p);
}

/* A corner, a point of an edge, or any. */
static void point_of_triangle(dice *d, const umb_beam_part *p, double out[3])
{
    double weights[3] = {dice_between(d, 0, 1), dice_between(d, 0, 1), dice_between(d, 0, 1)};
    uint32_t kind = dice_roll(d, 4);
    if (kind < 2) { /* a corner, or in the middle of an edge */
        memset(weights, 0, sizeof weights);
        weights[dice_roll(d, 3)] += 1.0;
        weights[dice_roll(d, 3)] += kind;
    }
    double sum = weights[0] + weights[1] + weights[2];
    for (int k = 0; k < 3; ++k) {
        out[k] = (weights[0] * p->middle[k] + weights[1] * p->axes[0][k] + weights[2] * p->axes[1][k]) / sum;
    }
}

static void point_of_part(dice *d, const umb_beam_part *p, double out[3])
{
    if (p->triangle) {
        point_of_triangle(d, p, out);
        return;
    }
    uint32_t kind = dice_roll(d, 4);
    memcpy(out, p->middle, 3 * sizeof *out);
    for (int a = 0; a < 3; ++a) { /* a corner, where halves of halves meet, or any */
        double x = kind == 0 ? (dice_roll(d, 2) == 0 ? -1.0 : 1.0) : kind == 1 ? (int)dice_roll(d, 9) / 4.0 - 1.0 : dice_between(d, -1, 1);
        for (int k = 0; k < 3; ++k) {
            out[k] += x * p->axes[a][k];
        }
    }
}

/* Corner i of a triangle. */
static const double *corner(const umb_beam_part *p, int i)
{
    return i % 3 == 0 ? p->middle : p->axes[i % 3 - 1];
}

static void check_triangle_cut(const umb_beam_part *p, int axis, double share, const umb_beam_part *lower, const umb_beam_part *upper)
{
    const double *from = corner(p, axis), *to = corner(p, axis + 1), *at = corner(lower, axis + 1);
    assert_memory_equal(corner(lower, axis), from, 3 * sizeof *from);
    assert_memory_equal(corner(upper, axis + 1), to, 3 * sizeof *to);
    assert_memory_equal(corner(upper, axis), at, 3 * sizeof *at);
    assert_memory_equal(corner(lower, axis + 2), corner(p, axis + 2), 3 * sizeof *at);
    assert_memory_equal(corner(upper, axis + 2), corner(p, axis + 2), 3 * sizeof *at);
    for (int k = 0; k < 3; ++k) {
        assert_true(fabs(at[k] - (from[k] + share * (to[k] - from[k]))) <= 0x1p-52 * (fabs(from[k]) + fabs(to[k])));
    }
}

/* From one end of the axis to the other: every point is in a part, and the parts are no larger than they should be. */
static void check_box_cut(const umb_beam_part *p, int axis, double share, const umb_beam_part *lower, const umb_beam_part *upper)
{
    int k = 0;
    for (int i = 0; i < 3; ++i) {
        k = fabs(p->axes[axis][i]) > fabs(p->axes[axis][k]) ? i : k;
        if (i != axis) {
            assert_memory_equal(lower->axes[i], p->axes[i], sizeof p->axes[i]);
            assert_memory_equal(upper->axes[i], p->axes[i], sizeof p->axes[i]);
        }
    }
    for (int i = 0; i <= 64 && p->axes[axis][k] != 0.0; ++i) {
        double x = i / 32.0 - 1.0, at = p->middle[k] + x * p->axes[axis][k];
        bool in[2] = {fabs(at - lower->middle[k]) <= fabs(lower->axes[axis][k]), fabs(at - upper->middle[k]) <= fabs(upper->axes[axis][k])};
        assert_int_equal(in[0], x <= 2.0 * share - 1.0);
        assert_int_equal(in[1], x >= 2.0 * share - 1.0);
    }
}

/* Both parts of what is cut have all of it. */
static void test_cuts(void **state)
{
    (void)state;
    dice d = {79};
    for (uint32_t n = 0; n < times(2000); ++n) {
        umb_beam_part p = n % 2 == 0 ? draw_part(&d, dice_between(&d, -9, 9)) : draw_triangle(&d, dice_between(&d, -9, 9));
        int axis = (int)dice_roll(&d, 3);
        double share = 0.25 * (1.0 + dice_roll(&d, 3));
        umb_beam_part lower = umb_beam_cut(&p, axis, share, false), upper = umb_beam_cut(&p, axis, share, true);
        if (p.triangle) {
            check_triangle_cut(&p, axis, share, &lower, &upper);
        } else {
            check_box_cut(&p, axis, share, &lower, &upper);
        }
    }
}

/* No beam is blocked through whose wall a segment goes. */
static void test_beams(void **state)
{
    (void)state;
    dice d = {75};
    uint32_t blocked = 0, tries = times(1500);
    for (uint32_t n = 0; n < tries; ++n) {
        uint32_t all[5] = {0, 1, 2, 3, 4};
        double far = dice_between(&d, 12, 40);
        umb_beam_part a = dice_roll(&d, 3) > 0 ? draw_part(&d, 0.0) : draw_triangle(&d, 0.0);
        umb_beam_part b = dice_roll(&d, 2) == 0 ? draw_part(&d, far) : draw_triangle(&d, far);
        uint32_t effort = n % 8 == 0 ? 60000 : 3000;
        double from[3], to[3], at[3], part = dice_between(&d, 0.3, 0.7), wide = exp(dice_between(&d, log(1e-3), log(0.7)));
        point_of_part(&d, &a, from);
        point_of_part(&d, &b, to);
        for (int k = 0; k < 3; ++k) {
            at[k] = from[k] + part * (to[k] - from[k]);
        }
        wall w;
        dice same = d;
        make_wall(&d, at, wide, 60.0, false, &w);
        umb_beam_search s = {&w.solids, effort, false};
        bool thin = fabs(to[1] - from[1]) + fabs(to[2] - from[2]) < to[0] - from[0]; /* then it is through before it meets a side */
        assert_false(thin && umb_beam_blocked(&s, &a, &b, all, 4));
        make_wall(&same, at, wide, 60.0, true, &w);
        s = (umb_beam_search){&w.solids, effort, false};
        blocked += umb_beam_blocked(&s, &a, &b, all, 5) ? 1 : 0;
    }
    printf("%u of %u blocked without a hole\n", blocked, tries);
    assert_true(blocked > tries / 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_known_surfaces), cmocka_unit_test(test_moved_surfaces), cmocka_unit_test(test_inner_bodies),
        cmocka_unit_test(test_touching),       cmocka_unit_test(test_pieces),          cmocka_unit_test(test_apart),
        cmocka_unit_test(test_blocks_all),     cmocka_unit_test(test_cuts),           cmocka_unit_test(test_beams),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

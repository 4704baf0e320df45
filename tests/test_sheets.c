/* Bodies that go through floors and ceilings that touch: storeys of all kinds above one another, against winding numbers and, along
 * segments, exact signs. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "bake/solid_inner.h"
#include "geometry/orient.h"
#include "support/surfaces.h"

static uint32_t times(uint32_t small)
{
    const char *size = getenv("UMBRAGE_TEST_SIZE");
    return size == NULL ? 4 * small : size[0] == 's' ? small : 40 * small;
}

/* ---- storeys -------------------------------------------------------------------------------------- */

/* What stands on a storey. */
enum { EQUAL, SMALLER, CORNERED, OVERHANGING, GAPPED, INSIDE_OUT, DOUBLED, EMPTY, HOLLOW, HOLLOW_ON_SHEET, CROSSING, PLATED, KINDS };

#define HEIGHT 8

static const outline SMALL = {{{0, 0}, {3, 0}, {3, 3}, {0, 3}}, 4, {{0, 1, 2}, {0, 2, 3}}, 2};

static void turn_from(surface *s, uint32_t face)
{
    for (uint32_t i = face; i < s->face_count; ++i) {
        turn_face(s, i);
    }
}

/* One float step higher than it is. */
static void lift_from(surface *s, uint32_t point)
{
    for (uint32_t i = point; i < s->point_count; ++i) {
        s->points[i][2] = nextafterf(s->points[i][2], INFINITY);
    }
}

static void add_storey(surface *s, dice *d, int kind, const outline *below, int level)
{
    int at[3] = {0, 0, HEIGHT * level}, in[3] = {1, 1, HEIGHT * level}, out[3] = {3, -2, HEIGHT * level}, room[3] = {1, 1, HEIGHT * level + 2};
    int crossing[3] = {1, 2, HEIGHT * level - 3};
    uint32_t point = s->point_count, face = s->face_count;
    const outline *upper = kind == SMALLER || kind == CROSSING ? &SMALL : kind == CORNERED ? &CORNER : below;
    const int *shift = kind == SMALLER ? in : kind == OVERHANGING ? out : kind == CROSSING ? crossing : at;
    add_outline(s, upper, shift, HEIGHT);
    if (kind == INSIDE_OUT) {
        turn_from(s, face);
    } else if (kind == GAPPED) {
        lift_from(s, point);
    } else if (kind == DOUBLED || kind == EMPTY) {
        face = s->face_count;
        add_outline(s, upper, shift, HEIGHT);
        turn_from(s, kind == EMPTY ? face : s->face_count);
    } else if (kind == HOLLOW || kind == HOLLOW_ON_SHEET) {
        face = s->face_count;
        add_outline(s, &SMALL, kind == HOLLOW ? room : in, 1 + (int)dice_roll(d, 4));
        turn_from(s, face);
    } else if (kind == PLATED) { /* of no thickness, over a part of what is above it */
        add_outline(s, &SMALL, room, 0);
    }
}

/* Two to four storeys; *kinds: a bit for each kind that is among them. */
static void make_house(surface *s, dice *d, uint32_t first, uint32_t *kinds)
{
    static const outline *const outlines[] = {&SQUARE, &CORNER, &YARD, &ARROW};
    static const int ground[3] = {0, 0, 0};
    const outline *o = outlines[dice_roll(d, 4)];
    memset(s, 0, sizeof *s);
    add_outline(s, o, ground, HEIGHT);
    *kinds = 0;
    for (int level = 1; level < 2 + (int)dice_roll(d, 2) || level == 1; ++level) {
        int kind = (int)(level == 1 ? first % KINDS : dice_roll(d, KINDS));
        *kinds |= 1u << kind;
        add_storey(s, d, kind, o, level);
    }
}

/* ---- what bodies are held against ------------------------------------------------------------------ */

/* Just above, on the way to and just below where storeys meet. */
static uint32_t check_near_sheets(dice *d, const solid_case *c, const umb_solids *s)
{
    uint32_t inside = 0;
    for (int n = 0; n < 200; ++n) {
        static const double away[] = {0x1p-20, 0x1p-21, 3e-6, 1e-5, 1e-4, 1e-3};
        double x[3], depth = -INFINITY;
        point_in(d, &c->occluder.bounds, x);
        x[2] = HEIGHT * (1.0 + dice_roll(d, 3)) + (dice_roll(d, 2) == 0 ? 1.0 : -1.0) * away[dice_roll(d, 6)];
        for (size_t i = 0; i < s->count; ++i) {
            depth = fmax(depth, depth_in(s, &s->items[i], x));
        }
        if (depth >= 0.0) {
            inside += 1;
            assert_true(winding(c, x) > 0.5);
        }
    }
    return inside;
}

static int side_of(const solid_case *c, const uint32_t t[3], const float x[3])
{
    int side = umb_orient(c->points[t[0]], c->points[t[1]], c->points[t[2]], x);
    return c->occluder.mirrored ? -side : side;
}

/* The segment comes to a triangle from its front, or ends on it: exact. `front`: the sign of what is before a triangle. */
static bool comes_to_front(const solid_case *c, const float from[3], const float to[3], int front)
{
    for (uint32_t i = 0; i < c->mesh->triangle_count; ++i) {
        const uint32_t *t = c->mesh->triangles[i];
        int sides[3];
        if (side_of(c, t, from) != front || side_of(c, t, to) == front) {
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            sides[k] = umb_orient(from, to, c->points[t[k]], c->points[t[(k + 1) % 3]]);
        }
        if ((sides[0] >= 0 && sides[1] >= 0 && sides[2] >= 0) || (sides[0] <= 0 && sides[1] <= 0 && sides[2] <= 0)) {
            return true;
        }
    }
    return false;
}

static int sign_of_front(void)
{
    static const float a[3] = {0, 0, 0}, b[3] = {1, 0, 0}, c[3] = {0, 1, 0}, before[3] = {0, 0, 1};
    return umb_orient(a, b, c, before);
}

/* From outside into each body. */
static uint32_t check_segments(dice *d, const solid_case *c, const umb_solids *s)
{
    uint32_t asked = 0;
    int front = sign_of_front();
    for (size_t i = 0; i < s->count; ++i) {
        for (int n = 0; n < 20; ++n) {
            float from[3], to[3];
            double x[3], inside[3];
            int out = (int)dice_roll(d, 3);
            point_in(d, &s->items[i].bounds, x);
            for (int k = 0; k < 3; ++k) {
                to[k] = (float)x[k];
                inside[k] = to[k];
            }
            if (depth_in(s, &s->items[i], inside) < 0.0) {
                continue;
            }
            point_in(d, &c->occluder.bounds, x);
            for (int k = 0; k < 3; ++k) {
                from[k] = (float)x[k];
            }
            from[out] = dice_roll(d, 2) == 0 ? c->occluder.bounds.min[out] - 20.0f : c->occluder.bounds.max[out] + 20.0f;
            asked += 1;
            assert_true(comes_to_front(c, from, to, front));
        }
    }
    return asked;
}

/* Bodies that hold something of two storeys. */
static uint32_t count_through(const solid_case *c, const umb_solids *s)
{
    uint32_t through = 0;
    for (size_t i = 0; i < s->count && c->occluder.identity; ++i) {
        double low[3], high[3];
        memcpy(low, s->items[i].inner, sizeof low);
        memcpy(high, low, sizeof high);
        low[2] = HEIGHT - 0.5;
        high[2] = HEIGHT + 0.5;
        through += depth_in(s, &s->items[i], low) >= 0.0 && depth_in(s, &s->items[i], high) >= 0.0 ? 1 : 0;
    }
    return through;
}

static void test_storeys(void **state)
{
    (void)state;
    dice d = {81};
    uint32_t inside = 0, near = 0, segments = 0, through[KINDS] = {0};
    for (uint32_t n = 0; n < times(1800); ++n) {
        surface s;
        solid_case c;
        uint32_t way = dice_roll(&d, 3), kinds;
        umb_transform t = draw_transform(&d, way == 2);
        make_house(&s, &d, n, &kinds);
        open_case(&s, way == 0 ? NULL : &t, way == 2, &c);
        umb_solids found = {.allocator = &c.allocator, .reach = 200.0};
        assert_int_equal(umb_solids_add_inner(&found, &c.occluder, 0), UMB_OK);
        inside += check_bodies(&d, &c, &found);
        segments += check_segments(&d, &c, &found);
        if (way == 0) {
            near += check_near_sheets(&d, &c, &found);
            for (int k = 0; k < KINDS; ++k) {
                through[k] += kinds == 1u << k ? count_through(&c, &found) : 0;
            }
        }
        umb_solids_free(&found);
        close_case(&c);
    }
    printf("%u points, %u near sheets, %u segments; bodies through a sheet:", inside, near, segments);
    for (int k = 0; k < KINDS; ++k) {
        printf(" %u", through[k]);
    }
    printf("\n");
    assert_true(inside > 20000 && near > 5000 && segments > 10000);
    assert_true(through[EQUAL] > 20 && through[SMALLER] > 5 && through[CORNERED] > 5 && through[PLATED] > 5);
    assert_true(through[GAPPED] == 0 && through[INSIDE_OUT] == 0 && through[EMPTY] == 0);
}

/* Not through a gap that is one float step wide, wherever it is and whatever stands above; and through it when it is closed. */
static void test_gaps(void **state)
{
    (void)state;
    dice d = {82};
    uint32_t through = 0;
    for (uint32_t n = 0; n < times(400); ++n) {
        surface s;
        solid_case c;
        bool gap = n % 2 == 0;
        static const int ground[3] = {0, 0, 0}, upper[3] = {0, 0, HEIGHT}, top[3] = {0, 0, 2 * HEIGHT};
        const outline *o = n % 3 == 0 ? &SQUARE : n % 3 == 1 ? &CORNER : &YARD;
        memset(&s, 0, sizeof s);
        add_outline(&s, o, ground, HEIGHT);
        uint32_t point = s.point_count;
        add_outline(&s, o, upper, HEIGHT);
        if (dice_roll(&d, 2) == 0) {
            add_outline(&s, o, top, HEIGHT);
        }
        if (gap) {
            lift_from(&s, point);
        }
        open_case(&s, NULL, false, &c);
        umb_solids found = {.allocator = &c.allocator, .reach = 100.0};
        assert_int_equal(umb_solids_add_inner(&found, &c.occluder, 0), UMB_OK);
        assert_true(found.count > 0);
        for (int i = 0; i < 40 && gap; ++i) {
            double x[3];
            point_in(&d, &c.occluder.bounds, x);
            x[2] = HEIGHT + 0x1p-21 * dice_between(&d, 0.01, 1.99);
            for (size_t b = 0; b < found.count; ++b) {
                assert_true(depth_in(&found, &found.items[b], x) < 0.0);
            }
        }
        through += gap ? 0 : count_through(&c, &found);
        umb_solids_free(&found);
        close_case(&c);
    }
    assert_true(through > 100);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_storeys), cmocka_unit_test(test_gaps)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

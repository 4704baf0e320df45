/* Is an object covered from sight, exactly?
 *
 * In the space of sight-lines (shade.h) the part of a triangle that the view holds is a convex polygon
 * bounded by covectors. The
 * images of blockers are taken out of it one by one, which leaves convex polygons bounded by
 * covectors: never a constructed point, only signs of determinants of three covectors, in exact
 * arithmetic behind a filter in double. A blocker is taken out only where it is strictly nearer
 * than the triangle, beyond the near plane and, for renderers that cull, faces the eye: at every
 * corner of its intersection with a piece, hence all over it.
 *
 * Pieces are kept while they have an inside. What closed blockers leave of a closed polygon is open
 * in it: if it has no inside, it is empty. So no piece left means that no line to the triangle is
 * free; that holds for touching edges and T-junctions, where rays of floats slip through. A piece
 * that is left is tried by the line through its middle, which confirm.c judges.
 */
#include "cover.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "shade.h"

#define MOST_LINES 8192u
#define MOST_SIDES 40u
#define MOST_PIECES 256u
#define MOST_BLOCKERS 8192u
#define MOST_CUTS 60000u  /* blockers against pieces, for an object */
#define STRIP_WIDTH 1e-11 /* half of it, of the slopes' size */
#define MOST_TRIED 24u    /* middles of pieces, for an object */

typedef struct piece {
    uint32_t count;
    uint16_t line[MOST_SIDES]; /* in an order in which line[i] x line[i + 1] is the corner between */
} piece;

typedef struct suspect {
    uint32_t object, triangle;
    double depth;
} suspect;

typedef struct cover {
    const truth *t;
    sight_space space;
    uint32_t object;
    uint8_t renderer;
    covector *lines;
    uint32_t line_count;
    /* Lines of the blocker at hand, by one more than their numbers; 0: not in the list. */
    uint32_t side_line[3][2]; /* along its sides, either way round */
    uint32_t meet_line;       /* where it passes through the target */
    piece *pieces;
    uint32_t piece_count;
    suspect *suspects;
    uint32_t suspect_count;
    double rect[2][2], deepest; /* image of the triangle in slopes, and how deep it is */
    uint32_t effort, shades, cuts, tried;
} cover;

/* ---- pieces ---- */

static uint16_t add_line(cover *c, const covector *l)
{
    if (c->line_count == MOST_LINES) {
        c->space.lost = true;
        return 0;
    }
    c->lines[c->line_count] = *l;
    return (uint16_t)c->line_count++;
}

static void add_piece(cover *c, const piece *p)
{
    if (c->piece_count == MOST_PIECES) {
        c->space.lost = true;
        return;
    }
    c->pieces[c->piece_count++] = *p;
}

/* The part of p, with an inside, where the line's covector has the sign `side`; line_side names the
 * covector that is positive there. Returns false when there is none. at: signs at p's corners. */
static bool part_of(cover *c, const piece *p, const int *at, int side, uint16_t line, piece *out)
{
    uint32_t n = p->count;
    bool any = false, cut = false;
    for (uint32_t i = 0; i < n; ++i) {
        any = any || at[i] == side;
        cut = cut || at[i] == -side;
    }
    if (!any || !cut) {
        *out = *p;
        return any;
    }
    out->count = 0;
    for (uint32_t i = 0; i < n; ++i) {
        /* Line i runs from corner i - 1 to corner i. */
        int from = at[(i + n - 1) % n], to = at[i];
        if (from != side && to != side) {
            continue;
        }
        if (out->count + 2 > MOST_SIDES) {
            c->space.lost = true;
            return false;
        }
        out->line[out->count++] = p->line[i];
        /* The new line comes where the outline leaves. */
        int next = at[(i + 1) % n];
        if (from == side && (to == -side || (to == 0 && next != side))) {
            out->line[out->count++] = line;
        }
    }
    return true;
}

static void signs_at_corners(cover *c, const piece *p, const covector *f, int *at)
{
    for (uint32_t i = 0; i < p->count; ++i) {
        at[i] = shade_sign(&c->space, f, &c->lines[p->line[i]],
                           &c->lines[p->line[(i + 1) % p->count]]);
    }
}

typedef enum cut_result { CUT_INSIDE, CUT_BORDER, CUT_NOTHING } cut_result;

/* Keep of the piece what lies where f is at least zero: something with an inside, part of its border
 * only (then it stays as it was), or nothing. */
static cut_result cut_away(cover *c, piece *p, const covector *f)
{
    int at[MOST_SIDES];
    piece in;
    bool cut = false, touches = false;
    signs_at_corners(c, p, f, at);
    for (uint32_t i = 0; i < p->count; ++i) {
        cut = cut || at[i] < 0;
        touches = touches || at[i] >= 0;
    }
    if (!touches) {
        return CUT_NOTHING;
    }
    uint16_t line = cut ? add_line(c, f) : 0;
    if (!part_of(c, p, at, 1, line, &in)) {
        return CUT_BORDER;
    }
    *p = in;
    return CUT_INSIDE;
}

typedef enum hides { HIDES_NOT, HIDES_IN_PART, HIDES } hides;

/* Does the blocker lie before the triangle, and beyond the near plane, all over the piece? In part:
 * beyond the near plane it is everywhere, before the triangle only at some corners. */
static hides hides_piece(cover *c, const piece *p, const shade *blocker, const shade *target)
{
    uint32_t nearer = 0;
    for (uint32_t i = 0; i < p->count; ++i) {
        const covector *l = &c->lines[p->line[i]], *m = &c->lines[p->line[(i + 1) % p->count]];
        nearer += shade_nearer(&c->space, blocker, target, l, m);
        if (blocker->crosses_near && shade_sign(&c->space, &blocker->beyond, l, m) < 0) {
            return HIDES_NOT;
        }
    }
    return nearer == p->count ? HIDES : nearer != 0 ? HIDES_IN_PART : HIDES_NOT;
}

/* The part of the piece where the blocker is not before the triangle: the two pass through one
 * another. False when that has no inside: then the line where they meet belongs to no piece that is
 * left, and is no blocker's either. */
static bool not_before(cover *c, const piece *p, const shade *blocker, const shade *target,
                       piece *out)
{
    if (c->meet_line == 0) {
        covector meet;
        shade_behind(blocker, target, &meet);
        c->meet_line = 1u + add_line(c, &meet);
    }
    int at[MOST_SIDES];
    uint16_t line = (uint16_t)(c->meet_line - 1);
    signs_at_corners(c, p, &c->lines[line], at);
    return part_of(c, p, at, 1, line, out);
}

/* The line along a side of the blocker at hand, positive inside it or, with back, outside. */
static uint16_t side_line(cover *c, const shade *blocker, int s, int back)
{
    if (c->side_line[s][back] == 0) {
        covector l = blocker->side[s];
        for (int i = 0; i < 3 && back; ++i) {
            shade_negate(&l.n[i]);
            l.about[i] = -l.about[i];
        }
        c->side_line[s][back] = 1u + add_line(c, &l);
    }
    return (uint16_t)(c->side_line[s][back] - 1);
}

/* Take the blocker's image out of piece number k; what is left of it goes to the end of the list.
 * False when nothing is taken. */
static bool subtract(cover *c, uint32_t k, const shade *blocker, const shade *target)
{
    piece rest[4], inside = c->pieces[k];
    uint32_t rests = 0;
    for (int s = 0; s < 3; ++s) {
        int at[MOST_SIDES];
        piece in, out;
        bool cut = false;
        signs_at_corners(c, &inside, &blocker->side[s], at);
        for (uint32_t i = 0; i < inside.count; ++i) {
            cut = cut || at[i] < 0;
        }
        if (!cut) {
            continue;
        }
        bool any = part_of(c, &inside, at, 1, side_line(c, blocker, s, 0), &in);
        if (part_of(c, &inside, at, -1, side_line(c, blocker, s, 1), &out)) {
            rest[rests++] = out;
        }
        if (!any || c->space.lost) {
            return false;
        }
        inside = in;
    }
    hides how = hides_piece(c, &inside, blocker, target);
    if (how == HIDES_NOT || (how == HIDES_IN_PART && c->space.parallel)) {
        return false; /* parallel: the line where they meet has too many bits */
    }
    if (how == HIDES_IN_PART && !not_before(c, &inside, blocker, target, &rest[rests++])) {
        return false;
    }
    if (c->space.lost) {
        return false;
    }
    c->pieces[k] = c->pieces[--c->piece_count];
    for (uint32_t i = 0; i < rests; ++i) {
        add_piece(c, &rest[i]);
    }
    return true;
}

/* ---- blockers ---- */

/* Depth and slopes of a point, plainly; in parallel views places for slopes. */
static double slopes(const cover *c, const double p[3], double out[2])
{
    const umb_view *view = c->space.v->view;
    double depth = 0.0;
    out[0] = out[1] = 0.0;
    for (int i = 0; i < 3; ++i) {
        double d = p[i] - view->eye[i];
        depth += d * view->forward[i];
        out[0] += d * view->right[i];
        out[1] += d * view->up[i];
    }
    return depth;
}

/* May any of these points' hull have a place in the rectangle, before the target's depth? */
static bool hull_meets_rect(const cover *c, const double (*points)[3], uint32_t count)
{
    uint32_t outside[4] = {0}, behind = 0, nearer = 0;
    for (uint32_t k = 0; k < count; ++k) {
        double at[2], depth = slopes(c, points[k], at), scale = c->space.parallel ? 1.0 : depth;
        behind += depth > c->deepest;
        nearer += depth < c->space.v->view->near_depth;
        for (int i = 0; i < 2; ++i) {
            outside[i] += at[i] < c->rect[i][0] * scale;
            outside[2 + i] += at[i] > c->rect[i][1] * scale;
        }
    }
    bool out = behind == count || nearer == count;
    for (int i = 0; i < 4; ++i) {
        out = out || outside[i] == count;
    }
    return !out;
}

static bool box_meets_rect(const void *where, const umb_aabb *box)
{
    double corner[8][3];
    for (int k = 0; k < 8; ++k) {
        for (int i = 0; i < 3; ++i) {
            corner[k][i] = k >> i & 1 ? box->max[i] : box->min[i];
        }
    }
    return hull_meets_rect(where, (const double(*)[3])corner, 8);
}

static bool gather_chunk(void *user, const oracle_chunk *chunk)
{
    cover *c = user;
    for (uint32_t k = chunk->first; k < chunk->last; ++k) {
        float v[3][3];
        double p[3][3], nearest = INFINITY;
        if (oracle_flags(c->t, chunk->object, k) & UMB_TRIANGLE_OPEN) {
            continue;
        }
        oracle_triangle(c->t, chunk->object, k, v);
        for (int j = 0; j < 3; ++j) {
            double at[2];
            for (int i = 0; i < 3; ++i) {
                p[j][i] = v[j][i];
            }
            nearest = fmin(nearest, slopes(c, p[j], at));
        }
        if (!hull_meets_rect(c, (const double(*)[3])p, 3)) {
            continue;
        }
        if (c->suspect_count == MOST_BLOCKERS) {
            return false; /* fewer blockers: less is covered */
        }
        c->suspects[c->suspect_count++] = (suspect){chunk->object, k, nearest};
    }
    return true;
}

static int by_depth(const void *a, const void *b)
{
    const suspect *x = a, *y = b;
    if (x->depth != y->depth) {
        return x->depth < y->depth ? -1 : 1;
    }
    if (x->object != y->object) {
        return x->object < y->object ? -1 : 1;
    }
    return x->triangle < y->triangle ? -1 : x->triangle > y->triangle;
}

/* The blockers in front of the triangle, nearest first. Only a choice: none has to be there. */
static void gather(cover *c, float v[3][3])
{
    const umb_view *view = c->space.v->view;
    double ends[2][2] = {{view->x_min, view->x_max}, {view->y_min, view->y_max}};
    bool behind = false;
    c->deepest = -INFINITY;
    for (int i = 0; i < 2; ++i) {
        c->rect[i][0] = INFINITY;
        c->rect[i][1] = -INFINITY;
    }
    for (int k = 0; k < 3; ++k) {
        double p[3] = {v[k][0], v[k][1], v[k][2]}, at[2], depth = slopes(c, p, at);
        double scale = c->space.parallel ? 1.0 : depth;
        behind = behind || !(scale > 0.0);
        c->deepest = fmax(c->deepest, depth);
        for (int i = 0; i < 2; ++i) {
            c->rect[i][0] = fmin(c->rect[i][0], at[i] / scale);
            c->rect[i][1] = fmax(c->rect[i][1], at[i] / scale);
        }
    }
    for (int i = 0; i < 2; ++i) {
        c->rect[i][0] = behind ? ends[i][0] : fmax(c->rect[i][0], ends[i][0]);
        c->rect[i][1] = behind ? ends[i][1] : fmin(c->rect[i][1], ends[i][1]);
    }
    c->suspect_count = 0;
    oracle_boxes_visit(c->t, box_meets_rect, c, gather_chunk, c);
    if (c->suspect_count) {
        qsort(c->suspects, c->suspect_count, sizeof(*c->suspects), by_depth);
    }
}

static void cover_by_all(cover *c, const shade *target)
{
    for (uint32_t s = 0; s < c->suspect_count && c->piece_count && !c->space.lost; ++s) {
        const suspect *b = &c->suspects[s];
        float v[3][3];
        double p[3][3];
        shade blocker;
        bool turned;
        if (++c->shades > c->effort) {
            c->space.lost = true;
            return;
        }
        oracle_triangle(c->t, b->object, b->triangle, v);
        shade_scale(&c->space, v, p);
        if (!shade_make(&c->space, p, &blocker, &turned) ||
            (c->renderer == TRUTH_CULLING &&
             !oracle_shown(oracle_flags(c->t, b->object, b->triangle), blocker.facing))) {
            continue;
        }
        uint32_t lines = c->line_count;
        bool taken = false;
        memset(c->side_line, 0, sizeof(c->side_line));
        c->meet_line = 0;
        for (uint32_t k = c->piece_count; k-- > 0 && !c->space.lost;) {
            taken = subtract(c, k, &blocker, target) || taken;
            c->space.lost = c->space.lost || ++c->cuts > MOST_CUTS;
        }
        c->line_count = taken ? c->line_count : lines;
    }
}

/* ---- the object's triangles ---- */

static bool all_outside(cover *c, const exact value[3])
{
    bool out = true;
    for (int k = 0; k < 3; ++k) {
        out = out && exact_sign(&value[k], &c->space.lost) < 0;
    }
    return out;
}

/* The line through the middle of a piece that is left: is it free? */
static bool try_middle(cover *c, const piece *p, truth_witness *out)
{
    const umb_view *view = c->space.v->view;
    double d[3] = {0.0, 0.0, 0.0}, through[3], reach = 1.0;
    for (uint32_t i = 0; i < p->count; ++i) {
        exact corner[3];
        double at[3], size = 0.0;
        shade_cross(corner, c->lines[p->line[i]].n, c->lines[p->line[(i + 1) % p->count]].n);
        for (int k = 0; k < 3; ++k) {
            at[k] = exact_estimate(&corner[k]);
            size = fmax(size, fabs(at[k]));
        }
        size = c->space.parallel ? at[2] : size;
        for (int k = 0; k < 3 && size > 0.0; ++k) {
            d[k] += at[k] / size / p->count;
        }
    }
    for (int i = 0; i < 3; ++i) {
        reach = fmax(reach, 4.0 * fabs(view->eye[i]));
    }
    for (int i = 0; i < 3; ++i) {
        through[i] = view->eye[i] + (c->space.parallel ? 0.0 : reach * d[i]);
    }
    if (c->space.parallel) {
        double f = view->forward[c->space.drop];
        for (int i = 0; i < 2; ++i) {
            through[c->space.other[i]] += ldexp(d[i] / (f * SHADE_AXIS_SCALE), -c->space.up);
        }
    }
    return oracle_confirm(c->t, c->space.v, through, c->object, c->renderer, out);
}

static cover_verdict left_over(cover *c, truth_witness *out)
{
    for (uint32_t k = 0; k < c->piece_count && !c->space.lost; ++k) {
        if (++c->tried > MOST_TRIED) {
            return COVER_OPEN;
        }
        if (try_middle(c, &c->pieces[k], out)) {
            return COVER_SEEN;
        }
    }
    return COVER_OPEN;
}

/* What is seen edge-on or has no area has a stretch of a line for its image. It is hidden if a thin
 * strip around that is covered, nearer than the triangle's nearest corner. */
static bool make_strip(cover *c, float v[3][3], const exact corner[3][3], exact out[4][3])
{
    const umb_view *view = c->space.v->view;
    double at[3][2], longest = -1.0, along[2] = {1.0, 0.0};
    int from = 0, to = 0;
    for (int k = 0; k < 3; ++k) {
        double p[3] = {v[k][0], v[k][1], v[k][2]}, depth = slopes(c, p, at[k]);
        for (int i = 0; i < 2; ++i) {
            at[k][i] = c->space.parallel ? exact_estimate(&corner[k][i]) : at[k][i] / depth;
        }
    }
    for (int k = 0; k < 3; ++k) {
        double x = at[(k + 1) % 3][0] - at[k][0], y = at[(k + 1) % 3][1] - at[k][1];
        double length = sqrt(x * x + y * y);
        if (length > longest) {
            longest = length;
            from = k;
            to = (k + 1) % 3;
            along[0] = length > 0.0 ? x / length : 1.0;
            along[1] = length > 0.0 ? y / length : 0.0;
        }
    }
    double size = fabs(at[from][0]) + fabs(at[from][1]) + longest + (c->space.parallel ? 0.0 : 1.0);
    double wide = STRIP_WIDTH * size;
    static const double turns[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (int k = 0; k < 4; ++k) {
        const double *end = at[turns[k][0] < 0 ? from : to];
        double x = end[0] + wide * (turns[k][0] * along[0] - turns[k][1] * along[1]);
        double y = end[1] + wide * (turns[k][0] * along[1] + turns[k][1] * along[0]);
        double d[3] = {nearbyint(x), nearbyint(y), 1.0}, largest = 0.0;
        for (int i = 0; i < 3 && !c->space.parallel; ++i) {
            d[i] = view->forward[i] + x * view->right[i] + y * view->up[i];
            largest = fmax(largest, fabs(d[i]));
        }
        for (int i = 0; i < 3; ++i) {
            /* Few enough bits for exact products. */
            exact_set(&out[k][i],
                      c->space.parallel ? d[i] : ldexp(nearbyint(ldexp(d[i] / largest, 60)), -20));
        }
    }
    return isfinite(size);
}

static cover_verdict cover_edge_on(cover *c, float v[3][3], double p[3][3])
{
    const umb_view *view = c->space.v->view;
    exact corner[3][3], strip[4][3], depth;
    shade target = {.facing = 0};
    piece first = {.count = 4};
    double nearest = INFINITY;
    for (int k = 0; k < 3; ++k) {
        shade_sight(&c->space, p[k], corner[k]);
        shade_value(&c->space, view->forward, p[k], view->near_depth, &depth);
        if (exact_sign(&depth, &c->space.lost) < 0) {
            return COVER_OPEN;
        }
        double about = exact_estimate(&depth);
        if (about < nearest) {
            nearest = about;
            shade_value(&c->space, view->forward, p[k], c->space.parallel ? view->near_depth : 0.0,
                        &target.det);
        }
    }
    /* The plane at a depth that is less than any corner's by more than the estimates' rounding. */
    double less = exact_estimate(&target.det);
    exact_set(&target.det, less - ldexp(fabs(less), -48));
    for (int i = 0; i < 3; ++i) {
        exact_set(&target.nearness.n[i],
                  c->space.parallel ? 0.0 : view->forward[i] * SHADE_AXIS_SCALE);
    }
    if (c->space.parallel) {
        target.nearness.n[2] = target.det;
        shade_negate(&target.nearness.n[2]);
        exact_set(&target.det, 1.0);
    }
    shade_about(&target.nearness);
    target.det_about = exact_estimate(&target.det);
    if (!(target.det_about > 0.0) || !make_strip(c, v, (const exact(*)[3])corner, strip)) {
        return COVER_OPEN;
    }
    /* Which way round the strip's corners run depends on the view's handedness. */
    covector side[4];
    exact across;
    shade_cross(side[0].n, strip[0], strip[1]);
    shade_dot(&across, strip[2], side[0].n);
    bool turned = exact_sign(&across, &c->space.lost) < 0;
    c->line_count = 0;
    c->piece_count = 0;
    for (uint32_t k = 0; k < 4; ++k) {
        uint32_t a = turned ? 3 - k : k, b = turned ? (6 - k) % 4 : (k + 1) % 4;
        shade_cross(side[k].n, strip[a], strip[b]);
        shade_about(&side[k]);
        first.line[k] = add_line(c, &side[k]);
        for (int j = 0; j < 3; ++j) {
            exact inside;
            shade_dot(&inside, side[k].n, corner[j]);
            if (exact_sign(&inside, &c->space.lost) <= 0) {
                return COVER_OPEN;
            }
        }
    }
    add_piece(c, &first);
    gather(c, v);
    cover_by_all(c, &target);
    return c->piece_count == 0 && !c->space.lost ? COVER_HIDDEN : COVER_OPEN;
}

static cover_verdict cover_triangle(cover *c, uint32_t triangle, truth_witness *out)
{
    float v[3][3];
    double p[3][3];
    exact values[SHADE_VIEW_PLANES][3];
    shade target;
    bool turned;
    oracle_triangle(c->t, c->object, triangle, v);
    shade_scale(&c->space, v, p);
    for (int k = 0; k < 3; ++k) {
        if (!shade_holds(&c->space, p[k])) {
            return COVER_OPEN;
        }
    }
    uint32_t planes = shade_view_values(&c->space, p, values);
    for (uint32_t i = 0; i < planes; ++i) {
        if (all_outside(c, values[i])) {
            return c->space.lost ? COVER_OPEN : COVER_HIDDEN;
        }
    }
    uint8_t flags = oracle_flags(c->t, c->object, triangle);
    if (!shade_make(&c->space, p, &target, &turned)) {
        return cover_edge_on(c, v, p);
    }
    if (c->renderer == TRUTH_CULLING && !oracle_shown(flags, target.facing)) {
        return COVER_HIDDEN;
    }
    piece first = {.count = 3};
    c->line_count = 0;
    c->piece_count = 0;
    for (uint32_t k = 0; k < 3; ++k) {
        first.line[k] = add_line(c, &target.side[turned ? (3 - k) % 3 : k]);
    }
    for (uint32_t i = 0; i < planes; ++i) {
        covector f;
        shade_spread(&target, values[i], &f);
        cut_result cut = cut_away(c, &first, &f);
        if (cut != CUT_INSIDE || c->space.lost) {
            return cut == CUT_NOTHING && !c->space.lost ? COVER_HIDDEN : COVER_OPEN;
        }
    }
    add_piece(c, &first);
    gather(c, v);
    cover_by_all(c, &target);
    if (c->space.lost) {
        return COVER_OPEN;
    }
    return c->piece_count == 0 ? COVER_HIDDEN : left_over(c, out);
}

static cover_verdict cover_all(cover *c, truth_witness *out)
{
    const model_object *o = &c->t->model->objects[c->object];
    cover_verdict all = COVER_HIDDEN;
    for (uint32_t k = 0; k < c->t->model->meshes[o->mesh].triangle_count; ++k) {
        cover_verdict one = cover_triangle(c, k, out);
        if (one == COVER_SEEN || c->space.lost || (one == COVER_OPEN && c->effort <= COVER_ASKED)) {
            return one;
        }
        all = one == COVER_OPEN ? COVER_OPEN : all;
    }
    return all;
}

cover_verdict oracle_cover(const truth *t, const oracle_view *v, uint32_t object, uint8_t renderer,
                           uint32_t effort, truth_witness *out)
{
    cover c = {.t = t, .object = object, .renderer = renderer, .effort = effort};
    cover_verdict verdict = COVER_OPEN;
    c.lines = malloc(MOST_LINES * sizeof(*c.lines));
    c.pieces = malloc(MOST_PIECES * sizeof(*c.pieces));
    c.suspects = malloc(MOST_BLOCKERS * sizeof(*c.suspects));
    if (c.lines && c.pieces && c.suspects && shade_start(&c.space, t, v)) {
        verdict = cover_all(&c, out);
    }
    free(c.lines);
    free(c.pieces);
    free(c.suspects);
    return verdict;
}

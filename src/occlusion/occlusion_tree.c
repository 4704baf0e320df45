#include "occlusion_tree.h"

#include <math.h>
#include <string.h>

#include "base/memory.h"
#include "geometry/orient.h"

/* Corners of all fragments on the way down from a polygon, while it is inserted or asked about. */
enum { ROOM = 640, MOST_CORNERS = UMB_SHADOW_LINES + 8, MOST_MEMBERS = 12, MOST_DEPTH = 1000, MOST_COVERS = 16, MOST_DETOURS = 64 };

typedef struct polygon {
    umb_seen_corner *corners;
    uint32_t count;
} polygon;

/* ---- room ---------------------------------------------------------------------------------------- */

bool umb_occlusion_tree_reserve(umb_occlusion_tree *t, const umb_allocator *a, uint32_t nodes, uint32_t covers)
{
    return umb_memory_reserve(a, (void **)&t->nodes, &t->node_capacity, nodes, sizeof *t->nodes) &&
           umb_memory_reserve(a, (void **)&t->covers, &t->cover_capacity, covers, sizeof *t->covers) &&
           umb_memory_reserve(a, (void **)&t->members, &t->member_capacity, 2 * (size_t)covers, sizeof *t->members);
}

void umb_occlusion_tree_free(umb_occlusion_tree *t, const umb_allocator *a)
{
    umb_memory_free(a, t->nodes, t->node_capacity * sizeof *t->nodes);
    umb_memory_free(a, t->covers, t->cover_capacity * sizeof *t->covers);
    umb_memory_free(a, t->members, t->member_capacity * sizeof *t->members);
    memset(t, 0, sizeof *t);
}

static bool is_leaf(uint32_t ref)
{
    return (ref & UMB_OCCLUSION_COVERED) != 0;
}

static bool is_open(uint32_t ref)
{
    return ref == UMB_OCCLUSION_OPEN_CELL;
}

static const umb_occlusion_cover *cover_of(const umb_occlusion_tree *t, uint32_t ref)
{
    return &t->covers[ref & ~UMB_OCCLUSION_COVERED];
}

/* UMB_OCCLUSION_OPEN_CELL if there is no room. other: a cell's cover that stays, or UMB_OCCLUSION_OPEN_CELL. */
static uint32_t add_cover(umb_occlusion_tree *t, const uint32_t *members, uint32_t count, uint32_t other)
{
    uint32_t length = is_open(other) ? 0 : 1 + cover_of(t, other)->length;
    if (t->cover_count >= t->cover_capacity || t->member_count + (size_t)count > t->member_capacity) {
        t->given_up += 1;
        return UMB_OCCLUSION_OPEN_CELL;
    }
    t->covers[t->cover_count] = (umb_occlusion_cover){t->member_count, count, other, length};
    for (uint32_t i = 0; i < count; ++i) {
        t->members[t->member_count++] = members[i];
    }
    return UMB_OCCLUSION_COVERED | t->cover_count++;
}

/* ---- fragments ------------------------------------------------------------------------------------ */

typedef struct sides {
    bool negative, zero, positive, unknown;
} sides;

static sides find_sides(const umb_occlusion_tree *t, const polygon *p, const umb_seen_line *line, int8_t *out)
{
    sides s = {false, false, false, false};
    for (uint32_t i = 0; i < p->count; ++i) {
        int side = umb_seen_side(&t->shadows->viewer.sight, line, &p->corners[i]);
        s.negative = s.negative || side == -1;
        s.zero = s.zero || side == 0;
        s.positive = s.positive || side == 1;
        s.unknown = s.unknown || side == UMB_SEEN_UNKNOWN;
        out[i] = (int8_t)side;
    }
    return s;
}

/* Edges along a line of the tree need no line of their own. */
static void close_edges(polygon *p, const int8_t *side)
{
    for (uint32_t i = 0; i < p->count; ++i) {
        if (side[i] == 0 && side[i + 1 < p->count ? i + 1 : 0] == 0) {
            p->corners[i].closed = true;
        }
    }
}

/* The part on one side, written behind the polygon; false if the room ends before top does. */
static bool cut(const umb_occlusion_tree *t, const polygon *p, umb_seen_line *line, const int8_t *side, int keep,
                const umb_seen_corner *top, polygon *out)
{
    out->corners = p->corners + p->count;
    if (out->corners + p->count + 2 > top || p->count + 2 > MOST_CORNERS) {
        return false;
    }
    umb_seen_cut c = {&t->shadows->viewer.sight, line, p->corners, side, p->count};
    out->count = umb_seen_clip(&c, keep, out->corners);
    return true;
}

/* ---- building ------------------------------------------------------------------------------------- */

/* True if no point of shadow a's front is before the plane of any triangle of b's: where both are in the picture, what is
 * beyond a is beyond b. */
static bool lies_behind(const umb_shadows *s, uint32_t a, uint32_t b)
{
    const umb_shadow *x = &s->items[a], *y = &s->items[b];
    for (uint32_t i = 0; i < y->plane_count; ++i) {
        const umb_shadow_plane *p = &s->planes[y->first_plane + i];
        for (uint32_t k = 0; k < x->plane_count; ++k) {
            const umb_shadow_plane *q = &s->planes[x->first_plane + k];
            if (umb_orient(p->a, p->b, p->c, q->a) > 0 || umb_orient(p->a, p->b, p->c, q->b) > 0 ||
                umb_orient(p->a, p->b, p->c, q->c) > 0) {
                return false;
            }
        }
        for (uint32_t k = 0; k < x->line_count; ++k) { /* corners whose triangles share a plane */
            const umb_seen_line *l = &s->lines[x->first_line + k];
            if (!l->free && umb_orient(p->a, p->b, p->c, l->a) > 0) {
                return false;
            }
        }
    }
    return true;
}

static bool all_behind(const umb_occlusion_tree *t, const umb_occlusion_cover *c, uint32_t shadow, bool cover_behind)
{
    for (uint32_t i = 0; i < c->count; ++i) {
        uint32_t other = t->members[c->first + i];
        if (!(cover_behind ? lies_behind(t->shadows, other, shadow) : lies_behind(t->shadows, shadow, other))) {
            return false;
        }
    }
    return true;
}

/* One cover for the cells of both, or UMB_OCCLUSION_OPEN_CELL if that would say less. */
static uint32_t join_covers(umb_occlusion_tree *t, uint32_t a, uint32_t b)
{
    const umb_occlusion_cover *x = cover_of(t, a), *y = cover_of(t, b);
    uint32_t members[MOST_MEMBERS], count = 0;
    if (x->count == 0 || y->count == 0 || x->length != 0 || y->length != 0 || x->count + y->count > MOST_MEMBERS) {
        return UMB_OCCLUSION_OPEN_CELL; /* what is beyond the frame stays as it is */
    }
    for (uint32_t i = 0; i < x->count; ++i) {
        members[count++] = t->members[x->first + i];
    }
    for (uint32_t i = 0; i < y->count; ++i) {
        uint32_t member = t->members[y->first + i];
        bool known = false;
        for (uint32_t k = 0; k < x->count; ++k) {
            known = known || members[k] == member;
            if (members[k] != member && !(lies_behind(t->shadows, member, members[k]) &&
                                          lies_behind(t->shadows, members[k], member))) {
                return UMB_OCCLUSION_OPEN_CELL;
            }
        }
        if (!known) {
            members[count++] = member;
        }
    }
    return count == x->count ? a : count == y->count ? b : add_cover(t, members, count, UMB_OCCLUSION_OPEN_CELL);
}

/* What stands for a node after its children have changed. */
static uint32_t close_node(umb_occlusion_tree *t, uint32_t number)
{
    const umb_occlusion_node *n = &t->nodes[number];
    uint32_t a = n->child[0], b = n->child[1];
    if (!t->modified || !is_leaf(a) || !is_leaf(b) || is_open(a) || is_open(b)) {
        return number;
    }
    uint32_t joined = join_covers(t, a, b);
    return is_open(joined) ? number : joined;
}

/* The tree of one fragment in a cell: a line for each edge that no line above it stands for. */
static uint32_t plant(umb_occlusion_tree *t, const polygon *p, uint32_t shadow, uint32_t outside, uint32_t other)
{
    uint32_t open = 0, below;
    for (uint32_t i = 0; i < p->count; ++i) {
        open += !p->corners[i].closed;
    }
    if (t->node_count + (size_t)open > t->node_capacity) {
        t->given_up += 1;
        return outside;
    }
    below = add_cover(t, &shadow, 1, other);
    if (is_open(below)) {
        return outside;
    }
    for (uint32_t i = 0; i < p->count; ++i) {
        const umb_seen_corner *c = &p->corners[i];
        if (c->closed) {
            continue;
        }
        umb_occlusion_node *n = &t->nodes[t->node_count];
        n->line = c->edge;
        n->child[c->flip ? 0 : 1] = below;
        n->child[c->flip ? 1 : 0] = outside;
        below = t->node_count++;
    }
    t->planted += 1;
    return below;
}

/* A front on its way down. */
typedef struct seed {
    umb_occlusion_tree *tree;
    uint32_t shadow;
    const umb_seen_corner *top;
} seed;

static uint32_t insert_in_cell(const seed *s, uint32_t ref, const polygon *p)
{
    umb_occlusion_tree *t = s->tree;
    if (is_open(ref)) {
        return plant(t, p, s->shadow, ref, ref);
    }
    bool nearer = true;
    for (uint32_t k = ref; !is_open(k); k = cover_of(t, k)->other) {
        const umb_occlusion_cover *c = cover_of(t, k);
        if (c->count == 0 || all_behind(t, c, s->shadow, false)) {
            return ref; /* out of view, or behind what is there */
        }
        nearer = nearer && all_behind(t, c, s->shadow, true);
    }
    if (!nearer && cover_of(t, ref)->length + 1 == MOST_COVERS) {
        t->given_up += 1;
        return ref;
    }
    return plant(t, p, s->shadow, ref, nearer ? UMB_OCCLUSION_OPEN_CELL : ref);
}

/* What stands for ref after a fragment has come down to it. */
static uint32_t insert(const seed *s, uint32_t ref, polygon *p, uint32_t depth)
{
    umb_occlusion_tree *t = s->tree;
    if (is_leaf(ref)) {
        return insert_in_cell(s, ref, p);
    }
    umb_seen_line *line = t->nodes[ref].line;
    int8_t side[MOST_CORNERS];
    sides found = find_sides(t, p, line, side);
    if (found.unknown || (!found.negative && !found.positive) || depth == MOST_DEPTH) {
        t->given_up += 1;
        return ref;
    }
    if (!found.negative || !found.positive) {
        close_edges(p, side);
        uint32_t below = insert(s, t->nodes[ref].child[found.positive], p, depth + 1);
        t->nodes[ref].child[found.positive] = below;
        return close_node(t, ref);
    }
    for (int k = 0; k < 2; ++k) {
        polygon part;
        if (!cut(t, p, line, side, k == 0 ? -1 : 1, s->top, &part)) {
            t->given_up += 1;
            continue;
        }
        uint32_t below = insert(s, t->nodes[ref].child[k], &part, depth + 1);
        t->nodes[ref].child[k] = below;
    }
    return close_node(t, ref);
}

void umb_occlusion_tree_insert(umb_occlusion_tree *t, uint32_t shadow)
{
    umb_seen_corner room[ROOM];
    const umb_shadow *item = &t->shadows->items[shadow];
    if (shadow >= UMB_OCCLUSION_TREE_SHADOWS || item->corner_count > MOST_CORNERS || !t->ready) {
        t->given_up += 1;
        return;
    }
    seed s = {t, shadow, room + ROOM};
    polygon p = {room, item->corner_count};
    memcpy(room, t->shadows->corners + item->first_corner, item->corner_count * sizeof *room);
    t->root = insert(&s, t->root, &p, 0);
}

void umb_occlusion_tree_begin(umb_occlusion_tree *t, umb_shadows *shadows, bool modified)
{
    t->shadows = shadows;
    t->modified = modified;
    t->node_count = t->cover_count = t->member_count = t->planted = t->given_up = 0;
    t->root = UMB_OCCLUSION_OPEN_CELL;
    t->ready = !shadows->viewer.framed || (t->node_capacity >= 4 && t->cover_capacity >= 1);
    if (!shadows->viewer.framed || !t->ready) {
        return;
    }
    uint32_t beyond = add_cover(t, NULL, 0, UMB_OCCLUSION_OPEN_CELL);
    for (int i = 0; i < 4; ++i) {
        t->nodes[t->node_count] = (umb_occlusion_node){&shadows->viewer.frame[i], {beyond, t->root}};
        t->root = t->node_count++;
    }
}

/* ---- asking --------------------------------------------------------------------------------------- */

#define ALL_FACES UINT32_MAX

typedef struct question {
    const umb_occlusion_tree *tree;
    umb_hull *hull;
    uint32_t face;    /* that is asked about; ALL_FACES: the outline, and any of them may say that it is beyond an occluder */
    uint32_t detours; /* that may still be taken */
    uint32_t again;   /* times that less than all of it was asked about anew */
    const umb_seen_corner *top;
    uint8_t beyond[UMB_OCCLUSION_TREE_SHADOWS]; /* the whole hull: 0 not asked, 1 yes, 2 no */
} question;

/* True if the part of the hull in a polygon is strictly beyond a plane, by one of its faces. */
static bool part_beyond(const question *q, const polygon *p, const umb_shadow_plane *plane)
{
    for (uint32_t f = 0; f < q->hull->face_count; ++f) {
        umb_seen_vector depth;
        const umb_shadow_viewer *v = &q->tree->shadows->viewer;
        umb_hull_depth(&v->sight, umb_hull_face_plane(q->hull, v, f), plane, &depth);
        bool all = true;
        for (uint32_t i = 0; i < p->count && all; ++i) {
            const umb_seen_vector *at = &p->corners[i].v;
            double sum = 0.0, off = 0.0;
            for (int k = 0; k < 3; ++k) {
                sum += depth.at[k] * at->at[k];
                off += fabs(depth.at[k]) * (at->off[k] + 0x1p-50 * fabs(at->at[k])) +
                       depth.off[k] * (fabs(at->at[k]) + at->off[k]);
            }
            all = sum > off * (1.0 + 0x1p-40) + 0x1p-1000;
        }
        if (all) {
            return true;
        }
    }
    return false;
}

static bool hull_beyond(question *q, uint32_t shadow)
{
    const umb_shadows *s = q->tree->shadows;
    const umb_shadow *item = &s->items[shadow];
    if (q->beyond[shadow] == 0) {
        bool all = true;
        for (uint32_t i = 0; i < item->plane_count && all; ++i) {
            all = umb_hull_beyond(q->hull, &s->planes[item->first_plane + i]);
        }
        q->beyond[shadow] = all || q->hull->nearest > item->farthest ? 1 : 2;
    }
    return q->beyond[shadow] == 1;
}

static bool beyond_cover(question *q, const umb_occlusion_cover *c, const polygon *p)
{
    const umb_occlusion_tree *t = q->tree;
    for (uint32_t i = 0; i < c->count; ++i) {
        const umb_shadow *item = &t->shadows->items[t->members[c->first + i]];
        if (hull_beyond(q, t->members[c->first + i])) {
            continue;
        }
        for (uint32_t k = 0; k < item->plane_count; ++k) {
            if (!part_beyond(q, p, &t->shadows->planes[item->first_plane + k])) {
                return false;
            }
        }
    }
    return true;
}

static umb_occlusion_answer ask_cover(question *q, uint32_t ref, const polygon *p)
{
    for (; !is_open(ref); ref = cover_of(q->tree, ref)->other) {
        if (beyond_cover(q, cover_of(q->tree, ref), p)) {
            return UMB_OCCLUSION_HIDDEN;
        }
    }
    return UMB_OCCLUSION_BEFORE;
}

/* 1 or -1: the hull is surely all on that side of a line, by the middle of its bounds and half their size; 0 says nothing.
 * Fewer steps than to look at its corners. */
static int side_of_bounds(const question *q, const umb_seen_line *line)
{
    const umb_seen_from *from = &q->tree->shadows->viewer.sight;
    const umb_aabb *b = &q->hull->bounds;
    double sum = 0.0, room = 0.0;
    for (int k = 0; k < 3; ++k) {
        double low = (double)b->min[k] - from->eye[k], high = (double)b->max[k] - from->eye[k], n = line->n.at[k];
        sum += n * (low + high);
        room += fabs(n) * (high - low) + (line->n.off[k] + 0x1p-49 * fabs(n)) * (fabs(low) + fabs(high));
    }
    room = room * (1.0 + 0x1p-40) + 0x1p-990;
    return sum > room ? 1 : sum < -room ? -1 : 0;
}

bool umb_occlusion_tree_open_at(const umb_occlusion_tree *t, const float p[3], uint32_t start)
{
    umb_seen_corner c;
    umb_seen_corner_at(&t->shadows->viewer.sight, p, &c);
    while (!is_leaf(start)) {
        int side = umb_seen_side(&t->shadows->viewer.sight, t->nodes[start].line, &c);
        if (side != 1 && side != -1) {
            return false;
        }
        start = t->nodes[start].child[side > 0];
    }
    return is_open(start);
}

/* Where a polygon without width lies on a line, each part of it may be hidden on either side: what is not on the one is asked
 * about on the other. */
typedef struct detour {
    uint32_t ref;
    const struct detour *next;
} detour;

static umb_occlusion_answer filter(question *q, uint32_t ref, const polygon *p, const detour *other);

/* A plane of a cover, and those after it. */
typedef struct plane_at {
    const umb_occlusion_cover *cover;
    uint32_t member, plane;
} plane_at;

/* The next plane from here on that the hull is not wholly beyond; NULL: there is none. */
static const umb_shadow_plane *find_plane(question *q, plane_at *at)
{
    const umb_shadows *s = q->tree->shadows;
    for (; at->member < at->cover->count; ++at->member, at->plane = 0) {
        uint32_t shadow = q->tree->members[at->cover->first + at->member];
        if (!hull_beyond(q, shadow) && at->plane < s->items[shadow].plane_count) {
            return &s->planes[s->items[shadow].first_plane + at->plane];
        }
    }
    return NULL;
}

/* 1: the face is all beyond a plane; -1: nothing of it is; 0: some is. */
static int face_side(const question *q, const umb_shadow_plane *plane)
{
    const umb_hull_face *f = &q->hull->faces[q->face];
    uint32_t beyond = 0;
    for (uint32_t i = 0; i < f->count; ++i) {
        beyond += umb_orient(plane->a, plane->b, plane->c, q->hull->points[f->loop[i]]) < 0;
    }
    return beyond == f->count ? 1 : beyond == 0 ? -1 : 0;
}

static bool face_hidden_by(question *q, plane_at at, const polygon *p, const detour *other);

/* By one of the covers from ref on, or on the other side, at each place of the polygon. */
static bool face_hidden(question *q, uint32_t ref, const polygon *p, const detour *other)
{
    if (is_open(ref)) {
        return other != NULL && filter(q, other->ref, p, other->next) == UMB_OCCLUSION_HIDDEN;
    }
    return face_hidden_by(q, (plane_at){cover_of(q->tree, ref), 0, 0}, p, other);
}

/* What is left is an edge or a corner of what was asked about. If that is on the rim of the cell, what is beyond the rim may
 * hide it. */
static bool hidden_beside(question *q, const polygon *p)
{
    if (q->again == 2) {
        return false;
    }
    q->again += 1;
    bool hidden = filter(q, q->tree->root, p, NULL) == UMB_OCCLUSION_HIDDEN;
    q->again -= 1;
    return hidden;
}

/* A polygon of which a part may be beyond a plane. Where it is not, another cover must hide it; where it is, what is left of
 * this one. */
static bool face_hidden_in_part(question *q, plane_at at, const umb_shadow_plane *back, const polygon *p, const detour *other)
{
    const umb_shadow_viewer *v = &q->tree->shadows->viewer;
    const umb_shadow_plane *front = umb_hull_face_plane(q->hull, v, q->face);
    const umb_seen_depth depth = {{front->a, front->b, front->c}, {back->a, back->b, back->c}};
    uint32_t next = at.cover->other;
    umb_seen_vector n;
    umb_seen_line line;
    int8_t side[MOST_CORNERS];
    polygon part;
    umb_hull_depth(&v->sight, front, back, &n);
    umb_seen_line_depth(&n, &depth, &line);
    sides s = find_sides(q->tree, p, &line, side);
    if (s.unknown || !s.positive) {
        return face_hidden(q, next, p, other);
    }
    if (!s.negative && !s.zero) {
        return face_hidden_by(q, at, p, other);
    }
    if ((s.negative && is_open(next) && other == NULL) || !cut(q->tree, p, &line, side, -1, q->top, &part)) {
        return false;
    }
    if (!face_hidden(q, next, &part, other) && (s.negative || !hidden_beside(q, &part))) {
        return false;
    }
    return cut(q->tree, p, &line, side, 1, q->top, &part) && face_hidden_by(q, at, &part, other);
}

static bool face_hidden_by(question *q, plane_at at, const polygon *p, const detour *other)
{
    for (const umb_shadow_plane *plane = find_plane(q, &at); plane != NULL; plane = find_plane(q, &at)) {
        int side = face_side(q, plane);
        at.plane += 1;
        if (side <= 0) {
            return side < 0 ? face_hidden(q, at.cover->other, p, other) : face_hidden_in_part(q, at, plane, p, other);
        }
    }
    return true;
}

static umb_occlusion_answer ask_cell(question *q, uint32_t ref, const polygon *p, const detour *other)
{
    umb_occlusion_answer open = is_open(ref) ? UMB_OCCLUSION_OPEN : UMB_OCCLUSION_BEFORE;
    if (q->face != ALL_FACES) {
        return face_hidden(q, ref, p, other) ? UMB_OCCLUSION_HIDDEN : open;
    }
    umb_occlusion_answer answer = is_open(ref) ? open : ask_cover(q, ref, p);
    return answer != UMB_OCCLUSION_HIDDEN && other != NULL ? filter(q, other->ref, p, other->next) : answer;
}

/* Both parts, until one is not hidden. */
static umb_occlusion_answer filter_parts(question *q, const umb_occlusion_node *n, const polygon *p, const int8_t *side,
                                         const detour *other)
{
    if ((is_open(n->child[0]) || is_open(n->child[1])) && other == NULL) {
        return UMB_OCCLUSION_OPEN;
    }
    umb_occlusion_answer answer = UMB_OCCLUSION_HIDDEN;
    for (int k = 0; k < 2 && answer == UMB_OCCLUSION_HIDDEN; ++k) {
        polygon part;
        if (!cut(q->tree, p, n->line, side, k == 0 ? -1 : 1, q->top, &part)) {
            return UMB_OCCLUSION_OPEN;
        }
        answer = filter(q, n->child[k], &part, other);
    }
    return answer;
}

static umb_occlusion_answer filter(question *q, uint32_t ref, const polygon *p, const detour *other)
{
    while (!is_leaf(ref)) {
        const umb_occlusion_node *n = &q->tree->nodes[ref];
        int8_t side[MOST_CORNERS];
        sides s = find_sides(q->tree, p, n->line, side);
        if (s.unknown) {
            return UMB_OCCLUSION_OPEN;
        }
        if (s.negative && s.positive) {
            return filter_parts(q, n, p, side, other);
        }
        if (!s.negative && !s.positive && q->detours > 0) {
            detour positive = {n->child[1], other};
            q->detours -= 1;
            return filter(q, n->child[0], p, &positive);
        }
        ref = n->child[s.positive];
    }
    return ask_cell(q, ref, p, other);
}

/* The deepest node that all of the hull comes down to; for most of the way its bounds tell the side. */
static uint32_t descend(const question *q, uint32_t ref, const polygon *p)
{
    while (!is_leaf(ref)) {
        const umb_occlusion_node *n = &q->tree->nodes[ref];
        int all = q->tree->shadows->viewer.sight.parallel ? 0 : side_of_bounds(q, n->line);
        if (all == 0) {
            int8_t side[MOST_CORNERS];
            sides s = find_sides(q->tree, p, n->line, side);
            if (s.unknown || s.negative == s.positive) {
                return ref;
            }
            all = s.positive ? 1 : -1;
        }
        ref = n->child[all > 0];
    }
    return ref;
}

umb_occlusion_answer umb_occlusion_tree_ask(const umb_occlusion_tree *t, umb_hull *hull, uint32_t *start)
{
    umb_seen_corner room[ROOM];
    umb_seen_line lines[4];
    question q; /* most of it stays as it is */
    q.tree = t;
    q.hull = hull;
    q.face = ALL_FACES;
    q.detours = MOST_DETOURS;
    q.again = 0;
    q.top = room + ROOM;
    memset(q.beyond, 0, t->shadows->count < UMB_OCCLUSION_TREE_SHADOWS ? t->shadows->count : UMB_OCCLUSION_TREE_SHADOWS);
    polygon p = {room, hull->count};
    memcpy(room, hull->corners, hull->count * sizeof *room);
    *start = descend(&q, *start, &p);
    umb_occlusion_answer answer = hull->flat ? UMB_OCCLUSION_BEFORE : filter(&q, *start, &p, NULL);
    if (answer != UMB_OCCLUSION_BEFORE || hull->face_count == 0) {
        return answer;
    }
    for (uint32_t f = 0; f < hull->face_count; ++f) {
        /* Each is asked about by itself; if none is in doubt, all are hidden. */
        q.face = f;
        p.count = umb_hull_face_polygon(hull, &t->shadows->viewer, f, lines, room);
        q.detours = MOST_DETOURS;
        umb_occlusion_answer face = filter(&q, hull->flat ? t->root : *start, &p, NULL);
        if (face != UMB_OCCLUSION_HIDDEN) {
            return face;
        }
    }
    return UMB_OCCLUSION_HIDDEN;
}

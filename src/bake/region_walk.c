/* The walk: nearest first, everything is asked about once, and what is not hidden hides what comes later. */
#include <math.h>
#include <string.h>

#include "geometry/transform.h"
#include "region_state.h"

/* ---- the queue: a heap of keys, each with what it is for ---------------------------------------- */

/* What is waiting; at equal distances in this order, then by number. */
typedef enum turn { NODE, OCCLUDER, OBJECT, DRAWING, LEAVING, TAKING } turn;

/* Bits of what is waiting for, and of a distance, which is not negative: it has no use for a sign. */
#define TURN_BITS 3
#define NUMBER_BITS 30

static uint64_t order_of(float key, turn what, uint32_t number)
{
    uint32_t bits;
    memcpy(&bits, &key, sizeof bits);
    return ((uint64_t)bits << TURN_BITS | (uint64_t)what) << NUMBER_BITS | number;
}

static float key_of(uint64_t order)
{
    uint32_t bits = (uint32_t)(order >> (TURN_BITS + NUMBER_BITS));
    float key;
    memcpy(&key, &bits, sizeof key);
    return key;
}

static turn turn_of(uint64_t order)
{
    return (turn)(order >> NUMBER_BITS & ((1u << TURN_BITS) - 1));
}

static umb_result push(umb_region *r, uint64_t order)
{
    if (!umb_memory_reserve(&r->allocator, (void **)&r->queue, &r->queue_capacity, r->queue_count + 1,
                            sizeof *r->queue)) {
        return UMB_ERROR_MEMORY;
    }
    size_t i = r->queue_count++;
    for (; i > 0 && r->queue[(i - 1) / 2] > order; i = (i - 1) / 2) {
        r->queue[i] = r->queue[(i - 1) / 2];
    }
    r->queue[i] = order;
    return UMB_OK;
}

static uint64_t pop(umb_region *r)
{
    uint64_t first = r->queue[0], last = r->queue[--r->queue_count];
    size_t n = r->queue_count, i = 0;
    for (size_t k = 1; k < n; k = 2 * i + 1) {
        k += k + 1 < n && r->queue[k + 1] < r->queue[k] ? 1 : 0;
        if (r->queue[k] >= last) {
            break;
        }
        r->queue[i] = r->queue[k];
        i = k;
    }
    r->queue[i] = last;
    return first;
}

/* ---- frames and maps ----------------------------------------------------------------------------- */

static void set_frames(umb_region *r)
{
    const umb_region_query *q = &r->query;
    bool none = q->up == UMB_UP_NONE;
    uint32_t up = q->up == UMB_UP_Y ? 1 : q->up == UMB_UP_Z ? 2 : 0;
    /* A coordinate less the centre is rounded once, by half a unit of at most twice the reach; points where an occluder
       is cut, three times more. */
    double error = 0x1p-49 * r->reach;
    r->frame_count = none ? 6 : 4;
    for (uint32_t k = 0; k < r->frame_count; ++k) {
        umb_ray_frame *f = &r->frames[k];
        uint32_t u = none ? k / 2 : (up + 1 + k / 2) % 3, z = none ? (u + 2) % 3 : up;
        *f = (umb_ray_frame){.axis_u = u, .axis_v = 3 - u - z, .axis_z = z, .sign = (k & 1) != 0 ? -1.0 : 1.0,
                             .error = error, .steep = none ? 1.0f : INFINITY};
        for (int i = 0; i < 3; ++i) {
            f->centre[i] = 0.5 * (q->min[i] + q->max[i]);
        }
        f->hu = umb_most(q->max[f->axis_u] - f->centre[f->axis_u], f->centre[f->axis_u] - q->min[f->axis_u]) + error;
        f->hv = umb_most(q->max[f->axis_v] - f->centre[f->axis_v], f->centre[f->axis_v] - q->min[f->axis_v]) + error;
        f->z0 = q->min[f->axis_z] - f->centre[f->axis_z] - error;
        f->z1 = q->max[f->axis_z] - f->centre[f->axis_z] + error;
    }
}

static umb_result begin_maps(umb_region *r)
{
    const umb_region_query *q = &r->query;
    umb_ray_layout layout = {.outer = q->outer, .umbrae = q->umbrae};
    umb_region_grain(r, &layout.rows, &layout.columns);
    r->map_count = q->outer != 0.0 ? 8 : r->frame_count;
    for (uint32_t k = 0; k < r->map_count; ++k) {
        layout.kind = q->outer == 0.0 ? UMB_RAY_SLAB : k < 4 ? UMB_RAY_NEAR : UMB_RAY_FAR;
        umb_result result = umb_ray_map_begin(&r->maps[k], &r->allocator, &r->frames[k % r->frame_count], &layout);
        if (result != UMB_OK) {
            return result;
        }
    }
    return UMB_OK;
}

/* ---- asking ------------------------------------------------------------------------------------- */

/* Where something was found not to be hidden. */
typedef struct opening {
    uint32_t map, tile;
} opening;

/* True if nothing of the hull of points of frame k can be seen. */
static bool frame_hides(umb_region *r, uint32_t k, const umb_ray_point *p, uint32_t count, bool in_order, opening *open)
{
    const umb_ray_frame *f = &r->frames[k];
    umb_ray_shape shape;
    bool made = false;
    if (!umb_ray_shape_measure(f, p, count, &shape)) {
        return true;
    }
    for (open->map = k; open->map < r->map_count; open->map += r->frame_count) {
        umb_ray_map *m = &r->maps[open->map];
        if (!umb_ray_map_meets(m, &shape)) {
            continue;
        }
        made = made || umb_ray_shape_outline(f, p, count, in_order, &shape);
        if (made && !umb_ray_map_hides(m, r->kernels, &shape, &open->tile)) {
            return false;
        }
    }
    return true;
}

/* True if nothing of the hull of points (in the scene's coordinates) can be seen. in_order: they are corners of an outline,
 * as seen from above. */
static bool points_hidden(umb_region *r, const double (*points)[3], uint32_t count, bool in_order, opening *open)
{
    umb_ray_point p[UMB_RAY_POINTS];
    for (uint32_t k = 0; k < r->frame_count; ++k) {
        const umb_ray_frame *f = &r->frames[k];
        for (uint32_t i = 0; i < count; ++i) {
            p[i] = umb_ray_frame_point(f, points[i]);
        }
        if (!frame_hides(r, k, p, count, in_order, open)) {
            return false;
        }
    }
    return true;
}

/* The same of the rays of one tile alone. */
static bool points_hidden_at(umb_region *r, const double (*points)[3], uint32_t count, const opening *at)
{
    umb_ray_point p[UMB_RAY_POINTS];
    umb_ray_shape shape;
    const umb_ray_frame *f = r->maps[at->map].frame;
    for (uint32_t i = 0; i < count; ++i) {
        p[i] = umb_ray_frame_point(f, points[i]);
    }
    return !umb_ray_shape_measure(f, p, count, &shape) || !umb_ray_shape_outline(f, p, count, false, &shape) ||
           umb_ray_map_tile_hides(&r->maps[at->map], r->kernels, &shape, at->tile);
}

/* Four corners that have all the coordinates of a box. */
static bool box_hidden(umb_region *r, const umb_aabb *box, opening *open)
{
    umb_ray_point p[4];
    r->answer.stats.queries += 1;
    for (uint32_t k = 0; k < r->frame_count; ++k) {
        const umb_ray_frame *f = &r->frames[k];
        for (int i = 0; i < 4; ++i) {
            double x[3];
            x[f->axis_u] = i == 0 || i == 3 ? box->min[f->axis_u] : box->max[f->axis_u];
            x[f->axis_v] = i < 2 ? box->min[f->axis_v] : box->max[f->axis_v];
            x[f->axis_z] = (i & 1) != 0 ? box->min[f->axis_z] : box->max[f->axis_z];
            p[i] = umb_ray_frame_point(f, x);
        }
        if (!frame_hides(r, k, p, 4, true, open)) {
            return false;
        }
    }
    return true;
}

/* The box, in the world, of a part's box under a transform whose world vertices are rounded. */
static umb_aabb part_box(const umb_object *o, const umb_aabb *box)
{
    umb_aabb out = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int c = 0; c < 8; ++c) {
        float p[3], w[3];
        for (int k = 0; k < 3; ++k) {
            p[k] = (c >> k & 1) != 0 ? box->max[k] : box->min[k];
        }
        umb_transform_point(&o->transform, p, w);
        for (int k = 0; k < 3; ++k) {
            out.min[k] = w[k] < out.min[k] ? w[k] : out.min[k];
            out.max[k] = w[k] > out.max[k] ? w[k] : out.max[k];
        }
    }
    return out;
}

static bool parts_hidden(umb_region *r, const umb_object *o)
{
    const umb_mesh *m = o->mesh;
    opening open;
    for (uint32_t i = 0; i < m->part_count;) {
        const umb_part *part = &m->parts[i];
        umb_aabb box = o->identity ? part->box : part_box(o, &part->box);
        if (box_hidden(r, &box, &open)) {
            i = part->skip;
        } else if (part->skip == i + 1) {
            return false;
        } else {
            i += 1;
        }
    }
    return true;
}

static bool object_hidden(umb_region *r, const umb_object *o)
{
    opening open;
    if (box_hidden(r, &o->bounds, &open)) {
        return true;
    }
    if (!o->refine || o->box) {
        return false;
    }
    const umb_mesh *m = o->mesh;
    if (m->position_count > UMB_RAY_POINTS) {
        return parts_hidden(r, o);
    }
    double p[UMB_RAY_POINTS][3];
    for (uint32_t i = 0; i < m->position_count; ++i) {
        float w[3];
        umb_transform_vertex(&o->transform, o->identity, m->positions[i], w);
        for (int k = 0; k < 3; ++k) {
            p[i][k] = w[k];
        }
    }
    const double(*points)[3] = (const double(*)[3])p;
    return points_hidden_at(r, points, m->position_count, &open) &&
           points_hidden(r, points, m->position_count, false, &open);
}

/* ---- blocking ------------------------------------------------------------------------------------ */

static void add_point(const umb_region *r, umb_ray_blocker *b, umb_ray_point p, bool on_floor)
{
    (void)r;
    if (b->count < UMB_UMBRA_VERTICES) {
        b->on_floor[b->count] = on_floor;
        b->vertices[b->count++] = p;
    }
}

/* What of a convex body lies in front of the cell: vertices, and where its edges enter. */
static void cut_convex(const umb_region *r, const umb_ray_frame *f, const umb_piece *piece,
                       const umb_ray_point *p, const bool *on_floor, umb_ray_blocker *b)
{
    double most = f->hu;
    for (uint32_t i = 0; i < piece->count; ++i) {
        most = umb_most(most, fabs(p[i].u));
    }
    double least = f->hu * (1.0 + 0x1p-16) + 0x1p-14 * most;
    for (uint32_t i = 0; i < piece->count; ++i) {
        if (p[i].u >= least) {
            add_point(r, b, p[i], on_floor[i]);
        }
    }
    for (uint32_t i = 0; i < piece->edge_count; ++i) {
        umb_ray_point a = p[piece->edges[i][0]], z = p[piece->edges[i][1]];
        if ((a.u >= least) != (z.u >= least)) {
            double part = (least - a.u) / (z.u - a.u);
            umb_ray_point at = {least, a.v + part * (z.v - a.v), a.z + part * (z.z - a.z)};
            add_point(r, b, at, on_floor[piece->edges[i][0]] && on_floor[piece->edges[i][1]]);
        }
    }
}

static void block_frame(umb_region *r, uint32_t k, const umb_piece *piece)
{
    const umb_ray_frame *f = &r->frames[k];
    umb_ray_point p[UMB_UMBRA_VERTICES];
    bool on_floor[UMB_UMBRA_VERTICES];
    double most = -INFINITY, low = INFINITY, high = -INFINITY;
    umb_ray_blocker b = {.convex = piece->convex, .floor = true};
    for (uint32_t i = 0; i < piece->count; ++i) {
        p[i] = umb_ray_frame_point(f, piece->points[i]);
        on_floor[i] = piece->points[i][f->axis_z] <= r->floor;
        low = umb_least(low, p[i].z);
        high = umb_most(high, p[i].z);
        most = umb_most(most, p[i].u);
    }
    double away = umb_most(low - f->z1, f->z0 - high);
    if (!(most > f->hu) || away > f->steep * (most + f->hu)) {
        return; /* behind the cell, or no ray of the frame is as steep */
    }
    if (piece->convex) {
        cut_convex(r, f, piece, p, on_floor, &b);
    } else {
        memcpy(b.vertices, p, piece->count * sizeof *p);
        memcpy(b.on_floor, on_floor, piece->count * sizeof *on_floor);
        b.count = piece->count;
        b.ring = piece->ring;
    }
    for (uint32_t m = k; m < r->map_count && b.count >= 2; m += r->frame_count) {
        umb_ray_map_block(&r->maps[m], r->kernels, &b, r->query.half_umbra);
    }
}

static void block_piece(void *user, const umb_piece *piece)
{
    umb_region *r = user;
    r->answer.stats.patches += 1;
    for (uint32_t k = 0; k < r->frame_count; ++k) {
        block_frame(r, k, piece);
    }
}

/* Square of the distance between a box and the cell. */
static double gap_squared(const umb_region_query *q, const umb_aabb *b)
{
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) {
        double gap = umb_most(0.0, umb_most(q->min[k] - b->max[k], b->min[k] - q->max[k]));
        sum += gap * gap;
    }
    return sum;
}

static umb_result block(umb_region *r, const umb_occluder *o)
{
    double least = 4.0 * r->query.near_depth * (1.0 + 0x1p-40);
    if (gap_squared(&r->query, &o->bounds) < least * least) {
        return UMB_OK;
    }
    r->answer.stats.occluders += 1;
    if (!umb_memory_reserve(&r->allocator, (void **)&r->used, &r->used_capacity, r->used_count + 1, sizeof *r->used)) {
        return UMB_ERROR_MEMORY;
    }
    uint32_t number = (uint32_t)(o - umb_scene_committed(umb_index_scene(r->index))->occluders);
    r->used[r->used_count++] = number;
    return umb_pieces_cut(&r->pieces, o, number);
}

/* ---- the walk ------------------------------------------------------------------------------------ */

#define SHORT (1.0f / 8.0f) /* for a distance */

/* How far a box is from the cell, along the farthest of the axes that rays are sorted by. */
static float gap_of(const umb_region *r, const umb_aabb *b)
{
    double gap = 0.0;
    for (uint32_t i = 0; i < r->frame_count; i += 2) {
        uint32_t k = r->frames[i].axis_u;
        gap = umb_most(gap, umb_most(r->query.min[k] - b->max[k], b->min[k] - r->query.max[k]));
    }
    return (float)gap;
}

static umb_result push_children(umb_region *r, const umb_node *n)
{
    r->answer.stats.nodes += 1;
    for (uint32_t s = 0; s < n->count; ++s) {
        umb_aabb box;
        for (int k = 0; k < 3; ++k) {
            box.min[k] = n->min[k][s];
            box.max[k] = n->max[k][s];
        }
        uint32_t kind = n->ref[s] & UMB_REF_KIND;
        turn what = kind == UMB_REF_NODE ? NODE : kind == UMB_REF_OCCLUDER ? OCCLUDER : OBJECT;
        umb_result result = push(r, order_of(gap_of(r, &box), what, n->ref[s] & UMB_REF_NUMBER));
        if (result != UMB_OK) {
            return result;
        }
    }
    return UMB_OK;
}

static umb_aabb node_box(const umb_node *n)
{
    umb_aabb box;
    for (int k = 0; k < 3; ++k) {
        box.min[k] = n->min[k][0];
        box.max[k] = n->max[k][0];
        for (uint32_t s = 1; s < n->count; ++s) {
            box.min[k] = n->min[k][s] < box.min[k] ? n->min[k][s] : box.min[k];
            box.max[k] = n->max[k][s] > box.max[k] ? n->max[k][s] : box.max[k];
        }
    }
    return box;
}

/* How far a box's far side is from the cell. */
static float far_of(const umb_region *r, const umb_aabb *b)
{
    double far = 0.0;
    for (uint32_t i = 0; i < r->frame_count; i += 2) {
        uint32_t k = r->frames[i].axis_u;
        far = umb_most(far, umb_most(r->query.min[k] - b->min[k], b->max[k] - r->query.max[k]));
    }
    return (float)far;
}

/* When the walk has come to the far side of what was not hidden. An occluder is drawn then: what is asked about before that lies
 * beside it or in front of it, and would find intervals joined with it to begin too far away. An object is asked about once more
 * then, for what lies in front of it has been drawn by then: little has, if it is short for its distance, and it is taken. */
static umb_result later(umb_region *r, const umb_aabb *b, turn what, uint32_t number)
{
    float near = gap_of(r, b), far = far_of(r, b);
    return push(r, order_of(far, what == LEAVING && far - near <= SHORT * near ? TAKING : what, number));
}

static umb_result visit(umb_region *r, const umb_tree *tree, const umb_committed *c, uint64_t order)
{
    uint32_t number = (uint32_t)order & UMB_REF_NUMBER;
    turn what = turn_of(order);
    opening open;
    if (what == NODE) {
        const umb_node *n = umb_tree_node(tree, number);
        umb_aabb box = node_box(n);
        return box_hidden(r, &box, &open) ? UMB_OK : push_children(r, n);
    }
    if (what == DRAWING) {
        return block(r, &c->occluders[number]);
    }
    if (what == OCCLUDER) {
        const umb_occluder *o = &c->occluders[number];
        return box_hidden(r, &o->bounds, &open) ? UMB_OK : later(r, &o->bounds, DRAWING, number);
    }
    const umb_object *o = &c->objects[number];
    if (what != TAKING && object_hidden(r, o)) {
        return UMB_OK;
    }
    if (what == OBJECT) {
        return later(r, &o->bounds, LEAVING, number);
    }
    r->pvs[r->answer.pvs_count++] = number;
    return o->occluder != UMB_NONE ? block(r, &c->occluders[o->occluder]) : UMB_OK;
}

/* The walk ends: of what is waiting only objects that were seen before may be seen. */
static void leave_all(umb_region *r, const umb_committed *c)
{
    for (size_t i = 0; i < r->queue_count; ++i) {
        uint32_t number = (uint32_t)r->queue[i] & UMB_REF_NUMBER;
        turn what = turn_of(r->queue[i]);
        if (what == TAKING || (what == LEAVING && !object_hidden(r, &c->objects[number]))) {
            r->pvs[r->answer.pvs_count++] = number;
        }
    }
}

/* Nothing that far out can be seen any more, in any direction. */
static bool all_closed(umb_region *r, const umb_tree *tree, float gap)
{
    for (uint32_t m = 0; m < r->map_count; ++m) {
        uint32_t up = r->maps[m].frame->axis_z;
        if (!umb_ray_map_closed(&r->maps[m], tree->bounds.min[up], tree->bounds.max[up], gap)) {
            return false;
        }
    }
    return true;
}

umb_result umb_region_walk(umb_region *r)
{
    const umb_tree *tree = umb_index_tree(r->index);
    const umb_committed *c = umb_scene_committed(umb_index_scene(r->index));
    set_frames(r);
    uint32_t up = r->frames[0].axis_z;
    r->floor = umb_least(r->query.min[up], tree->node_count > 0 ? tree->bounds.min[up] : r->query.min[up]);
    r->floor = r->query.up == UMB_UP_NONE ? -INFINITY : r->floor;
    r->pieces.corners = (const double(*)[3])r->corners;
    r->pieces.reach = r->reach;
    r->pieces.emit = block_piece;
    r->pieces.user = r;
    r->queue_count = r->used_count = 0;
    umb_result result = begin_maps(r);
    for (uint32_t k = 0; k < (tree->flat ? tree->node_count : tree->node_count > 0 ? 1u : 0u) && result == UMB_OK; ++k) {
        result = push_children(r, &tree->nodes[k]);
    }
    float checked = 0.0f;
    while (result == UMB_OK && r->queue_count > 0) {
        uint64_t order = pop(r);
        float gap = key_of(order);
        if (gap > 1.05f * checked) {
            checked = gap;
            if (all_closed(r, tree, gap)) {
                leave_all(r, c);
                break;
            }
        }
        result = visit(r, tree, c, order);
    }
    return result;
}

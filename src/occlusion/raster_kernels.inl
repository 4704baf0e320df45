/* The raster's inner loops: raster_kernels_ISA.c includes this with KERNELS defined and is compiled with
 * that instruction set's flags. docs/conservative.md proves what they do; section numbers are its. */
#include <math.h>

#include "base/simd.h"
#include "geometry/transform.h"
#include "raster_kernels.h"

/* ---- testing -------------------------------------------------------------------------------- */

/* Lanes of a tile's masks are rows 0..7; lanes of its z are sub-tiles:   0 1 2 3
 *                                                                        4 5 6 7
 * So a vector of four lanes has the masks and depths of the same half. */
static const int32_t ROW[8] = {0, 1, 2, 3, 4, 5, 6, 7};
static const int32_t SUB_ROW[8] = {0, 0, 0, 0, 4, 4, 4, 4};
static const uint32_t SUB_BYTE[8] = {0xFF, 0xFF00, 0xFF0000, 0xFF000000, 0xFF, 0xFF00, 0xFF0000, 0xFF000000};
static const float SUB_X[8] = {0, 8, 16, 24, 0, 8, 16, 24};

/* Rows r0..r1 and the columns of need, all within one tile, are covered by something nearer. */
static inline bool tile_hides(const umb_tile *tile, int32_t r0, int32_t r1, uint32_t need, float nearness)
{
    umb_iv open = umb_iv_set(0);
    umb_iv columns = umb_iv_set((int32_t)need);
    for (int at = 0; at < 8; at += UMB_LANES) {
        umb_iv row = umb_iv_load(ROW + at);
        umb_iv sub_row = umb_iv_load(SUB_ROW + at);
        umb_iv asked = ((columns & umb_iv_load(SUB_BYTE + at)) != 0) & (sub_row + 3 >= r0) & (sub_row <= r1);
        open |= columns & (row >= r0) & (row <= r1) & ~umb_iv_load(tile->mask + at);
        open |= asked & (umb_fv_load(tile->z + at) < nearness);
    }
    return !umb_iv_any(open);
}

static inline bool rect_hidden(const umb_coverage *c, uint32_t x0, uint32_t y0, uint32_t x1, uint32_t y1,
                               float nearness)
{
    uint32_t tx0 = x0 / UMB_TILE_WIDTH;
    uint32_t tx1 = x1 / UMB_TILE_WIDTH;
    uint32_t ty0 = y0 / UMB_TILE_HEIGHT;
    uint32_t ty1 = y1 / UMB_TILE_HEIGHT;
    uint32_t first = ~0u << (x0 % UMB_TILE_WIDTH);
    uint32_t last = ~0u >> (UMB_TILE_WIDTH - 1 - x1 % UMB_TILE_WIDTH);
    for (uint32_t ty = ty0; ty <= ty1; ++ty) {
        int32_t r0 = ty == ty0 ? (int32_t)(y0 % UMB_TILE_HEIGHT) : 0;
        int32_t r1 = ty == ty1 ? (int32_t)(y1 % UMB_TILE_HEIGHT) : UMB_TILE_HEIGHT - 1;
        const umb_tile *row = c->tiles + (size_t)ty * c->columns;
        const float *coarse = c->coarse + (size_t)ty * c->columns;
        for (uint32_t tx = tx0; tx <= tx1; ++tx) {
            if (coarse[tx] >= nearness) {
                continue;
            }
            uint32_t need = (tx == tx0 ? first : ~0u) & (tx == tx1 ? last : ~0u);
            if (!tile_hides(&row[tx], r0, r1, need, nearness)) {
                return false;
            }
        }
    }
    return true;
}

static bool hides_rect(const umb_coverage *c, umb_pixel_rect rect, float nearness)
{
    return rect_hidden(c, (uint32_t)rect.x0, (uint32_t)rect.y0, (uint32_t)rect.x1, (uint32_t)rect.y1,
                       nearness);
}

static uint32_t hides(const umb_coverage *c, const umb_projected *b, uint32_t mask)
{
    uint32_t hidden = 0;
    for (uint32_t left = mask; left != 0; left &= left - 1) {
        uint32_t i = (uint32_t)__builtin_ctz(left);
        if (rect_hidden(c, (uint32_t)b->x0[i], (uint32_t)b->y0[i], (uint32_t)b->x1[i], (uint32_t)b->y1[i],
                        b->nearness[i])) {
            hidden |= 1u << i;
        }
    }
    return hidden;
}

/* ---- merging -------------------------------------------------------------------------------- */

/* Section 6. New bits with a farther bound lower z. An occluder that alone covers every bit of the sub-tile
 * sets it: with new bits in any case, without only to something nearer. */
typedef struct tile_part {
    umb_iv mask;
    umb_fv z;
} tile_part;

static inline bool merge_parts(umb_coverage *c, size_t number, const tile_part parts[UMB_PARTS])
{
    umb_tile *tile = &c->tiles[number];
    umb_iv any = umb_iv_set(0);
    umb_iv open = any;
    umb_fv least = umb_fv_set(INFINITY);
    for (int i = 0; i < UMB_PARTS; ++i) {
        int at = i * UMB_LANES;
        umb_iv mask = parts[i].mask;
        umb_fv z = parts[i].z;
        umb_iv old = umb_iv_load(tile->mask + at);
        umb_fv old_z = umb_fv_load(tile->z + at);
        umb_iv byte = umb_iv_load(SUB_BYTE + at);
        umb_iv touched = (umb_iv_or_fours(mask) & byte) != 0;
        umb_iv fresh = (umb_iv_or_fours(mask & ~old) & byte) != 0;
        umb_iv lone = (umb_iv_or_fours(old & ~mask) & byte) != 0;
        umb_iv raise = touched & ~lone & (fresh | (z > old_z));
        umb_iv lower = fresh & lone & (z < old_z);
        umb_iv change = raise | lower;
        umb_iv now = old | mask;
        umb_fv new_z = umb_fv_select(change, z, old_z);
        any |= fresh | change;
        open |= ~now;
        least = umb_fv_min(least, new_z);
        umb_iv_store(tile->mask + at, now);
        umb_fv_store(tile->z + at, new_z);
    }
    if (!umb_iv_any(open)) {
        c->coarse[number] = umb_fv_least(least);
    }
    return umb_iv_any(any);
}

static bool merge(umb_coverage *c, uint32_t tile, const uint32_t mask[UMB_TILE_HEIGHT], const float z[8])
{
    tile_part parts[UMB_PARTS];
    for (int i = 0; i < UMB_PARTS; ++i) {
        parts[i].mask = umb_iv_load(mask + i * UMB_LANES);
        parts[i].z = umb_fv_load(z + i * UMB_LANES);
    }
    return merge_parts(c, tile, parts);
}

/* ---- convex shapes: set-up ------------------------------------------------------------------ */

/* Vertices of the shape on the raster. */
typedef struct corners {
    double x[UMB_CONVEX_VERTICES], y[UMB_CONVEX_VERTICES];
    /* Nearness, rounded away from the eye by more than its error, and towards it. */
    double near_least[UMB_CONVEX_VERTICES], near_most[UMB_CONVEX_VERTICES];
    double error;                           /* of each x and y */
    double x_min, y_min, x_max, y_max;      /* of the computed ones */
    double most;                            /* nearness, rounded towards the eye */
    double near_size;                       /* largest absolute nearness */
} corners;

/* World vertices, relative to the eye, component by component; the last one again up to a whole vector. */
static uint32_t place(const umb_raster_map *map, const umb_occluder *o, double d[3][UMB_CONVEX_VERTICES])
{
    const umb_mesh *mesh = o->mesh;
    uint32_t count = mesh->block_position_count;
    for (uint32_t v = 0; v < count; ++v) {
        const float *p = mesh->positions[v];
        float world[3];
        if (!o->identity) {
            umb_transform_point(&o->transform, p, world);
            p = world;
        }
        d[0][v] = p[0] - map->eye.x;
        d[1][v] = p[1] - map->eye.y;
        d[2][v] = p[2] - map->eye.z;
    }
    uint32_t whole = (count + UMB_WIDE - 1) & ~(uint32_t)(UMB_WIDE - 1);
    for (uint32_t v = count; v < whole; ++v) {
        for (int axis = 0; axis < 3; ++axis) {
            d[axis][v] = d[axis][count - 1];
        }
    }
    return whole;
}

/* Bounds of section 3, for several vertices at once. False if one of them may be nearer than the cut. */
static bool project_corners(const umb_raster_map *m, const double d[3][UMB_CONVEX_VERTICES], uint32_t count,
                            corners *out)
{
    umb_dv x_min = umb_dv_set(INFINITY), y_min = x_min, most = -x_min;
    umb_dv x_max = -x_min, y_max = -x_min, error = umb_dv_set(0.0), reach_most = error, w_min = x_min;
    umb_dv near_size = error;
    for (uint32_t v = 0; v < count; v += UMB_WIDE) {
        umb_dv dx = umb_dv_load(d[0] + v), dy = umb_dv_load(d[1] + v), dz = umb_dv_load(d[2] + v);
        umb_dv reach = (umb_dv_abs(dx) + umb_dv_abs(dy)) + umb_dv_abs(dz);
        umb_dv w = (m->w.x * dx + m->w.y * dy) + m->w.z * dz;
        umb_dv x = (m->x.x * dx + m->x.y * dy) + m->x.z * dz;
        umb_dv y = (m->y.x * dx + m->y.y * dy) + m->y.z * dz;
        umb_dv off = (5.0 * UMB_U) * reach;
        umb_dv near_least, near_most, e;
        if (m->orthographic) {
            x += m->cx;
            y += m->cy;
            e = (2.0 * UMB_U) * ((5.0 * m->scale) * reach + (umb_dv_abs(x) + umb_dv_abs(y)));
            near_least = -(w + off);
            near_least -= (4.0 * UMB_U) * umb_dv_abs(near_least);
            near_most = off - w;
        } else {
            umb_dv r = 1.0 / w;
            x *= r;
            y *= r;
            umb_dv a = umb_dv_abs(x) + umb_dv_abs(y);
            e = (2.0 * UMB_U) * (5.0 * (reach * r) * (m->scale + a) +
                                 4.0 * (a + (fabs(m->cx) + fabs(m->cy))));
            x += m->cx;
            y += m->cy;
            /* 1 / (w + off), and the other way: r is off by one unit and off r^2 at most doubled. */
            near_least = r - r * (2.0 * off * r + 4.0 * UMB_U);
            near_most = r + r * (2.0 * off * r + 4.0 * UMB_U);
        }
        umb_dv_store(out->x + v, x);
        umb_dv_store(out->y + v, y);
        umb_dv_store(out->near_least + v, near_least);
        umb_dv_store(out->near_most + v, near_most);
        most = umb_dv_max(most, near_most);
        near_size = umb_dv_max(near_size, umb_dv_max(umb_dv_abs(near_least), umb_dv_abs(near_most)));
        error = umb_dv_max(error, e);
        reach_most = umb_dv_max(reach_most, reach);
        w_min = umb_dv_min(w_min, w);
        x_min = umb_dv_min(x_min, x);
        y_min = umb_dv_min(y_min, y);
        x_max = umb_dv_max(x_max, x);
        y_max = umb_dv_max(y_max, y);
    }
    out->error = -umb_dv_least(-error);
    out->x_min = umb_dv_least(x_min);
    out->y_min = umb_dv_least(y_min);
    out->x_max = -umb_dv_least(-x_max);
    out->y_max = -umb_dv_least(-y_max);
    out->most = -umb_dv_least(-most);
    out->near_size = -umb_dv_least(-near_size);
    double reach = -umb_dv_least(-reach_most);
    double cut = m->near_cut + 64.0 * UMB_U * (reach + fabs(m->near_cut));
    return umb_dv_least(w_min) >= cut && (m->orthographic || umb_dv_least(w_min) > 0x1p-20 * reach);
}

/* Which triangles surely face the eye, a bit each. With rows that turn right-handed, a triangle whose corners
 * run counter-clockwise as seen has a negative area on the raster (y grows downwards). Corners are off by
 * error e in each coordinate: the area by 2 e S + 8 e^2 with S the sum of the four differences, and by
 * 8 units of S^2 for rounding. */
static uint32_t find_front(const umb_raster_map *map, const umb_occluder *o, const corners *c)
{
    const umb_mesh *mesh = o->mesh;
    double turn = o->mirrored ? map->turn : -map->turn;
    double e = 4.0 * c->error;
    uint32_t front = 0;
    for (uint32_t i = 0; i < mesh->triangle_count; ++i) {
        const uint32_t *k = mesh->triangles[i];
        double x1 = c->x[k[1]] - c->x[k[0]];
        double y1 = c->y[k[1]] - c->y[k[0]];
        double x2 = c->x[k[2]] - c->x[k[0]];
        double y2 = c->y[k[2]] - c->y[k[0]];
        double sum = (fabs(x1) + fabs(y1)) + (fabs(x2) + fabs(y2));
        double area = turn * (x1 * y2 - x2 * y1);
        front |= (uint32_t)(area > e * (sum + e) + 0x1p-50 * (sum * sum)) << i;
    }
    return front;
}

/* The silhouette: edges of which one side faces the eye. */
static bool find_lines(umb_convex *out, const umb_raster_map *map, const umb_occluder *o, const corners *c,
                       uint32_t front, umb_convex_frame *frame)
{
    const umb_mesh *mesh = o->mesh;
    int turn = o->mirrored ? -map->turn : map->turn;
    out->left.count = out->right.count = out->edge_count = 0;
    for (uint32_t i = 0; i < mesh->edge_count; ++i) {
        const umb_edge *e = &mesh->edges[i];
        uint32_t one = front >> e->f0 & 1u;
        if (one == (front >> e->f1 & 1u)) {
            continue;
        }
        bool along = (one != 0) == (turn > 0);
        uint32_t from = along ? e->v0 : e->v1;
        uint32_t to = along ? e->v1 : e->v0;
        if (!umb_convex_add_line(out, frame, c->x[from], c->y[from], c->x[to], c->y[to])) {
            return false;
        }
    }
    return true;
}

/* Move the outer lines until no corner is beyond them. */
static void hold_corners(umb_convex_lines *lines, const corners *c, uint32_t count, double height, double side)
{
    for (uint32_t i = 0; i < lines->count; ++i) {
        double slope = lines->slope[i];
        umb_dv beyond = umb_dv_set(-INFINITY);
        for (uint32_t v = 0; v < count; v += UMB_WIDE) {
            umb_dv x = umb_dv_load(c->x + v), y = umb_dv_load(c->y + v);
            beyond = umb_dv_max(beyond, side * (x - slope * y));
        }
        double most = -umb_dv_least(-beyond);
        double size = fabs(slope) * (height + fabs(c->y_min) + fabs(c->y_max)) + fabs(c->x_min) + fabs(c->x_max);
        most += c->error * (1.0 + fabs(slope)) + 16.0 * UMB_U * (size + fabs(most));
        lines->out_at[i] = side * most;
    }
}

/* The plane of a triangle as the raster has it: the affine function through its computed corners, whatever
 * their errors, moved until it is nowhere above the nearness of the true ones (low), or nowhere below that of any
 * corner of the body (high). */
typedef struct plane {
    double gx, gy, low, high, least;
} plane;

/* How much gx x + gy y may be off at a corner. */
static double plane_error(const plane *p, const corners *c)
{
    double size = fabs(p->gx) * (fabs(c->x_min) + fabs(c->x_max)) + fabs(p->gy) * (fabs(c->y_min) + fabs(c->y_max));
    return (fabs(p->gx) + fabs(p->gy)) * c->error + 0x1p-50 * (size + c->near_size);
}

static double least_of_triangle(const corners *c, const uint32_t k[3])
{
    double a = c->near_least[k[0]], b = c->near_least[k[1]], d = c->near_least[k[2]];
    a = a < b ? a : b;
    return a < d ? a : d;
}

/* The least and the greatest of near_least - (gx x + gy y) at a triangle's corners. */
static void plane_offsets(const plane *p, const corners *c, const uint32_t k[3], double *least, double *most)
{
    *least = INFINITY;
    *most = -INFINITY;
    for (int i = 0; i < 3; ++i) {
        double at = c->near_least[k[i]] - (p->gx * c->x[k[i]] + p->gy * c->y[k[i]]);
        *least = at < *least ? at : *least;
        *most = at > *most ? at : *most;
    }
}

static void plane_of(plane *p, const corners *c, const uint32_t k[3])
{
    double x1 = c->x[k[1]] - c->x[k[0]], y1 = c->y[k[1]] - c->y[k[0]];
    double x2 = c->x[k[2]] - c->x[k[0]], y2 = c->y[k[2]] - c->y[k[0]];
    double z1 = c->near_least[k[1]] - c->near_least[k[0]], z2 = c->near_least[k[2]] - c->near_least[k[0]];
    double scale = 1.0 / (x1 * y2 - x2 * y1), most;
    p->gx = (z1 * y2 - z2 * y1) * scale;
    p->gy = (z2 * x1 - z1 * x2) * scale;
    p->least = least_of_triangle(c, k);
    plane_offsets(p, c, k, &p->low, &most);
    p->low -= plane_error(p, c);
}

/* Two triangles of one flat side share a plane: the second lowers the first by what it must. */
static bool share_plane(plane *planes, uint32_t count, const corners *c, const uint32_t k[3])
{
    for (uint32_t i = 0; i < count; ++i) {
        plane *p = &planes[i];
        double least, most, alike = 0x1p-12 * fabs(p->least);
        plane_offsets(p, c, k, &least, &most);
        if (fabs(least - p->low) < alike && fabs(most - p->low) < alike) {
            least -= plane_error(p, c);
            p->low = least < p->low ? least : p->low;
            double far_corner = least_of_triangle(c, k);
            p->least = far_corner < p->least ? far_corner : p->least;
            return true;
        }
    }
    return false;
}

static void raise_plane(plane *p, const corners *c, uint32_t count)
{
    umb_dv above = umb_dv_set(-INFINITY);
    for (uint32_t v = 0; v < count; v += UMB_WIDE) {
        umb_dv at = p->gx * umb_dv_load(c->x + v) + p->gy * umb_dv_load(c->y + v);
        above = umb_dv_max(above, umb_dv_load(c->near_most + v) - at);
    }
    p->high = -umb_dv_least(-above) + plane_error(p, c);
}

/* Images of fewer pixels than this take one depth, their farthest corner's. */
#define PLANE_PIXELS 128.0

static void find_planes(umb_convex *out, const umb_raster_map *map, const umb_occluder *o, const corners *c,
                        uint32_t vertices, uint32_t front)
{
    plane planes[UMB_CONVEX_TRIANGLES];
    uint32_t count = 0;
    double least = INFINITY;
    bool small = (out->x_max - out->x_min) * ((double)out->row1 - out->row0 + 1.0) < PLANE_PIXELS;
    out->plane_count = 0;
    for (uint32_t left = front; left != 0; left &= left - 1) {
        const uint32_t *k = o->mesh->triangles[__builtin_ctz(left)];
        if (small) {
            double z = least_of_triangle(c, k);
            least = z < least ? z : least;
        } else if (!share_plane(planes, count, c, k)) {
            plane_of(&planes[count++], c, k);
        }
    }
    if (small && front != 0) {
        umb_convex_add_plane(out, map, 0.0, 0.0, least, c->most, least);
    }
    for (uint32_t i = 0; i < count; ++i) {
        raise_plane(&planes[i], c, vertices);
        umb_convex_add_plane(out, map, planes[i].gx, planes[i].gy, planes[i].low, planes[i].high,
                             planes[i].least);
    }
}

static umb_convex_result find_convex(const umb_raster_map *map, const umb_occluder *o, umb_convex *out)
{
    double d[3][UMB_CONVEX_VERTICES];
    corners c;
    uint32_t count = place(map, o, d);
    if (!project_corners(map, (const double(*)[UMB_CONVEX_VERTICES])d, count, &c)) {
        return UMB_CONVEX_OTHER;
    }
    uint32_t front = find_front(map, o, &c);
    umb_convex_frame frame = {c.error, c.x_max - c.x_min, map->height, c.y_min, c.y_max};
    if (!find_lines(out, map, o, &c, front, &frame)) {
        return UMB_CONVEX_OTHER;
    }
    hold_corners(&out->left, &c, count, map->height, -1.0);
    hold_corners(&out->right, &c, count, map->height, 1.0);
    bool covers = umb_convex_place(out, map, &frame, c.x_min, c.x_max);
    out->most = (float)(c.most + 0x1p-22 * fabs(c.most));
    find_planes(out, map, o, &c, count, front);
    return covers ? UMB_CONVEX_READY : UMB_CONVEX_NOTHING;
}

/* ---- convex shapes: filling ----------------------------------------------------------------- */

/* Covered columns from left up to right, of eight rows. */
typedef struct spans {
    umb_iv left[UMB_PARTS], right[UMB_PARTS];
} spans;

/* A row takes the worse of a line's x at its two ends. Columns are rounded inwards: in_at holds 2^-20 more
 * than it must, which is what the rounding upwards needs. */
static inline bool find_spans(const umb_convex *v, const double *edge, int32_t first, spans *out)
{
    umb_dv most = umb_dv_set(v->x_max), zero = umb_dv_set(0.0);
    double up = 1.0 - 0x1p-20;
    umb_iv any = umb_iv_set(0);
    for (int i = 0; i < UMB_PARTS; ++i) {
        umb_dv left[2], right[2];
        for (int half = 0; half < 2; ++half) {
            const double *at = edge + i * UMB_LANES + half * UMB_WIDE;
            umb_dv top = umb_dv_load(at), low = umb_dv_load(at + 1);
            umb_dv l = umb_dv_set(v->x_min), r = most;
            for (uint32_t k = 0; k < v->left.count; ++k) {
                double slope = v->left.slope[k];
                l = umb_dv_max(l, slope * (slope > 0.0 ? low : top) + v->left.in_at[k]);
            }
            for (uint32_t k = 0; k < v->right.count; ++k) {
                double slope = v->right.slope[k];
                r = umb_dv_min(r, slope * (slope > 0.0 ? top : low) + v->right.in_at[k]);
            }
            left[half] = umb_dv_min(l, most) + up;
            right[half] = umb_dv_max(r, zero);
        }
        umb_iv row = umb_iv_load(ROW + i * UMB_LANES) + first;
        umb_iv inside = (row >= (int32_t)v->row0) & (row <= (int32_t)v->row1);
        out->left[i] = umb_dv_trunc(left[0], left[1]);
        out->right[i] = umb_dv_trunc(right[0], right[1]) & inside;
        any |= out->left[i] < out->right[i];
    }
    return umb_iv_any(any);
}

/* The n lowest bits, n of 0 to 32 in each lane; shifts by 32 have no meaning in C. */
static inline umb_iv low_bits(umb_iv n)
{
    umb_iv half = n >> 1;
    return ~((umb_iv_set(-1) << half) << (n - half));
}

/* The planes over a row of tiles, but for the term of x. */
typedef struct row_planes {
    umb_fv at[UMB_CONVEX_TRIANGLES][UMB_PARTS];
} row_planes;

/* At the corner of each sub-tile where they are farthest; upper: where the body's bounds are nearest. */
static inline void place_planes(const umb_convex *v, const double *edge, bool upper, row_planes *out)
{
    const float y[3] = {(float)edge[0], (float)edge[4], (float)edge[8]};
    for (uint32_t k = 0; k < v->plane_count; ++k) {
        for (int i = 0; i < UMB_PARTS; ++i) {
            const float *end = (v->gy[k] < 0.0f) != upper ? y + 1 : y;
            umb_fv row = umb_fv_fours(end[0], end[1], i);
            umb_fv column = umb_fv_load(SUB_X + i * UMB_LANES) + ((v->gx[k] < 0.0f) != upper ? 8.0f : 0.0f);
            out->at[k][i] = ((upper ? v->high[k] : v->low[k]) + v->gy[k] * row) + v->gx[k] * column;
        }
    }
}

/* Pixels of a span that lie in the 32 columns from x on. */
static inline umb_iv span_mask(umb_iv left, umb_iv right, int32_t x)
{
    umb_iv zero = umb_iv_set(0), full = umb_iv_set(UMB_TILE_WIDTH);
    umb_iv from = umb_iv_min(umb_iv_max(left - x, zero), full);
    umb_iv to = umb_iv_min(umb_iv_max(right - x, zero), full);
    return low_bits(to) & ~low_bits(from);
}

static bool fill_convex(umb_coverage *c, const umb_raster_map *map, const umb_convex *v)
{
    row_planes planes;
    spans s;
    bool changed = false;
    uint32_t tx0 = (uint32_t)v->x_min / UMB_TILE_WIDTH;
    uint32_t tx1 = ((uint32_t)v->x_max - 1) / UMB_TILE_WIDTH;
    for (uint32_t ty = v->row0 / UMB_TILE_HEIGHT; ty <= v->row1 / UMB_TILE_HEIGHT; ++ty) {
        const double *edge = map->rows.edge + (size_t)ty * UMB_TILE_HEIGHT;
        if (!find_spans(v, edge, (int32_t)(ty * UMB_TILE_HEIGHT), &s)) {
            continue;
        }
        bool ready = false;
        for (uint32_t tx = tx0; tx <= tx1; ++tx) {
            size_t t = (size_t)ty * c->columns + tx;
            if (c->coarse[t] >= v->most) {
                continue;
            }
            tile_part parts[UMB_PARTS];
            umb_iv any = umb_iv_set(0);
            for (int i = 0; i < UMB_PARTS; ++i) {
                parts[i].mask = span_mask(s.left[i], s.right[i], (int32_t)(tx * UMB_TILE_WIDTH));
                any |= parts[i].mask;
            }
            if (!umb_iv_any(any)) {
                continue;
            }
            if (!ready) {
                place_planes(v, edge, false, &planes);
                ready = true;
            }
            float x = (float)(tx * UMB_TILE_WIDTH);
            for (int i = 0; i < UMB_PARTS; ++i) {
                umb_fv z = umb_fv_set(INFINITY);
                for (uint32_t k = 0; k < v->plane_count; ++k) {
                    z = umb_fv_min(z, umb_fv_max(planes.at[k][i] + v->gx[k] * x, umb_fv_set(v->least[k])));
                }
                parts[i].z = z;
            }
            changed |= merge_parts(c, t, parts);
        }
    }
    return changed;
}

/* Columns of eight rows that the body may touch: between the outer lines at their widest in the row, from the
 * one to before the other. */
static inline void find_outer_spans(const umb_convex *v, const double *edge, const umb_pixel_rect *rect,
                                    spans *out)
{
    umb_dv first = umb_dv_set(rect->x0), last = umb_dv_set(rect->x1 + 0.5);
    for (int i = 0; i < UMB_PARTS; ++i) {
        umb_dv left[2], right[2];
        for (int half = 0; half < 2; ++half) {
            const double *at = edge + i * UMB_LANES + half * UMB_WIDE;
            umb_dv top = umb_dv_load(at), low = umb_dv_load(at + 1);
            umb_dv l = first, r = last;
            for (uint32_t k = 0; k < v->left.count; ++k) {
                double slope = v->left.slope[k];
                l = umb_dv_max(l, slope * (slope > 0.0 ? top : low) + v->left.out_at[k]);
            }
            for (uint32_t k = 0; k < v->right.count; ++k) {
                double slope = v->right.slope[k];
                r = umb_dv_min(r, slope * (slope > 0.0 ? low : top) + v->right.out_at[k]);
            }
            /* Beside the rectangle: an empty span. */
            left[half] = umb_dv_min(l, last + 1.0);
            right[half] = umb_dv_max(r, first - 1.0) + 1.0;
        }
        out->left[i] = umb_dv_trunc(left[0], left[1]);
        out->right[i] = umb_dv_trunc(right[0], right[1]);
    }
}

static bool hides_convex(const umb_coverage *c, const umb_raster_map *map, const umb_convex *v,
                         umb_pixel_rect rect)
{
    uint32_t tx0 = (uint32_t)rect.x0 / UMB_TILE_WIDTH, tx1 = (uint32_t)rect.x1 / UMB_TILE_WIDTH;
    uint32_t ty0 = (uint32_t)rect.y0 / UMB_TILE_HEIGHT, ty1 = (uint32_t)rect.y1 / UMB_TILE_HEIGHT;
    row_planes planes;
    spans s;
    for (uint32_t ty = ty0; ty <= ty1; ++ty) {
        const double *edge = map->rows.edge + (size_t)ty * UMB_TILE_HEIGHT;
        bool ready = false;
        find_outer_spans(v, edge, &rect, &s);
        int32_t first = (int32_t)(ty * UMB_TILE_HEIGHT);
        for (uint32_t tx = tx0; tx <= tx1; ++tx) {
            size_t t = (size_t)ty * c->columns + tx;
            if (c->coarse[t] >= v->most) {
                continue;
            }
            const umb_tile *tile = &c->tiles[t];
            float x = (float)(tx * UMB_TILE_WIDTH);
            umb_iv open = umb_iv_set(0);
            for (int i = 0; i < UMB_PARTS; ++i) {
                int at = i * UMB_LANES;
                umb_iv row = umb_iv_load(ROW + at) + first;
                umb_iv need = span_mask(s.left[i], s.right[i], (int32_t)(tx * UMB_TILE_WIDTH)) &
                              (row >= rect.y0) & (row <= rect.y1);
                umb_iv asked = (umb_iv_or_fours(need) & umb_iv_load(SUB_BYTE + at)) != 0;
                open |= need & ~umb_iv_load(tile->mask + at);
                umb_fv z = umb_fv_set(v->most);
                if (!ready) {
                    place_planes(v, edge, true, &planes);
                    ready = true;
                }
                for (uint32_t k = 0; k < v->plane_count; ++k) {
                    z = umb_fv_min(z, planes.at[k][i] + v->gx[k] * x);
                }
                open |= asked & (umb_fv_load(tile->z + at) < z);
            }
            if (umb_iv_any(open)) {
                return false;
            }
        }
    }
    return true;
}

const umb_raster_kernels KERNELS = {ISA,         hides,       hides_rect,  merge,
                                    find_convex, fill_convex, hides_convex};

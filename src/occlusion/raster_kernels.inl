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

/* Rows of a tile that are asked about, and its sub-tiles that have such rows. */
typedef struct asked_rows {
    umb_iv row[UMB_PARTS], sub_tile[UMB_PARTS];
} asked_rows;

UMB_INLINE asked_rows ask_rows(int32_t r0, int32_t r1)
{
    asked_rows a;
    for (int i = 0; i < UMB_PARTS; ++i) {
        umb_iv row = umb_iv_load(ROW + i * UMB_LANES), sub_row = umb_iv_load(SUB_ROW + i * UMB_LANES);
        a.row[i] = (row >= r0) & (row <= r1);
        a.sub_tile[i] = (sub_row + 3 >= r0) & (sub_row <= r1);
    }
    return a;
}

/* Not zero in lanes of which something is open, or covered by what is farther than nearness: rows asked for, columns
 * of need. */
UMB_INLINE umb_iv open_lanes(const umb_tile *tile, const asked_rows *rows, uint32_t need, float nearness)
{
    umb_iv open = umb_iv_set(0), columns = umb_iv_set((int32_t)need);
    for (int i = 0; i < UMB_PARTS; ++i) {
        int at = i * UMB_LANES;
        umb_iv asked = ((columns & umb_iv_load(SUB_BYTE + at)) != 0) & rows->sub_tile[i];
        open |= columns & rows->row[i] & ~umb_iv_load(tile->mask + at);
        open |= asked & (umb_fv_load(tile->z + at) < nearness);
    }
    return open;
}

/* Bits 0 .. n - 1, n of 0 to 32. */
static inline uint32_t low_mask(int32_t n)
{
    return (uint32_t)((1ull << n) - 1);
}

/* A bit for each of eight tiles from here on that is not closed by something nearer. */
UMB_INLINE uint32_t open_eight(const float *coarse, float nearness)
{
    uint32_t open = 0;
    for (int i = 0; i < 8; i += UMB_LANES) {
        open |= umb_iv_bits(umb_fv_load(coarse + i) < nearness) << i;
    }
    return open;
}

/* A rectangle in tiles: columns and rows of tiles, the pixel columns asked for in the first and the last. */
typedef struct tile_rect {
    uint32_t tx0, ty0, tx1, ty1;
    uint32_t first, last;
    int32_t r0, r1; /* rows in the first row of tiles from r0 on, in the last one up to r1 */
} tile_rect;

UMB_INLINE tile_rect find_tiles(uint32_t x0, uint32_t y0, uint32_t x1, uint32_t y1)
{
    return (tile_rect){.tx0 = x0 / UMB_TILE_WIDTH,
                       .ty0 = y0 / UMB_TILE_HEIGHT,
                       .tx1 = x1 / UMB_TILE_WIDTH,
                       .ty1 = y1 / UMB_TILE_HEIGHT,
                       .first = ~0u << (x0 % UMB_TILE_WIDTH),
                       .last = ~0u >> (UMB_TILE_WIDTH - 1 - x1 % UMB_TILE_WIDTH),
                       .r0 = (int32_t)(y0 % UMB_TILE_HEIGHT),
                       .r1 = (int32_t)(y1 % UMB_TILE_HEIGHT)};
}

/* At most two tiles wide and high, as most are: all four are looked at, without a branch between them. What is there
 * twice is asked twice, or nothing of it the second time. */
UMB_INLINE bool small_hidden(const umb_coverage *c, const tile_rect *t, float nearness)
{
    int32_t wide = (int32_t)(t->tx1 - t->tx0), high = (int32_t)(t->ty1 - t->ty0);
    uint32_t first = t->first & (t->last | (uint32_t)-wide);
    asked_rows top = ask_rows(t->r0, t->r1 | 7 * high), low = ask_rows(t->r0 * (1 - high), t->r1);
    const umb_tile *tile = c->tiles + (size_t)t->ty0 * c->columns + t->tx0;
    const umb_tile *below = tile + (size_t)high * c->columns;
    uint32_t last = t->last & (t->first | (uint32_t)-wide);
    umb_iv open = open_lanes(tile, &top, first, nearness) | open_lanes(tile + wide, &top, last, nearness);
    open |= open_lanes(below, &low, first, nearness) | open_lanes(below + wide, &low, last, nearness);
    return !umb_iv_any(open);
}

/* The tiles of a row that are open, bit 0 for the one at base. */
static bool row_hidden(const umb_coverage *c, const tile_rect *t, uint32_t ty, uint32_t base, uint32_t open,
                       float nearness)
{
    const umb_tile *row = c->tiles + (size_t)ty * c->columns;
    asked_rows rows = ask_rows(ty == t->ty0 ? t->r0 : 0, ty == t->ty1 ? t->r1 : UMB_TILE_HEIGHT - 1);
    for (; open != 0; open &= open - 1) {
        uint32_t tx = base + (uint32_t)__builtin_ctz(open);
        uint32_t need = (tx == t->tx0 ? t->first : ~0u) & (tx == t->tx1 ? t->last : ~0u);
        if (umb_iv_any(open_lanes(&row[tx], &rows, need, nearness))) {
            return false;
        }
    }
    return true;
}

/* Eight columns of tiles at a time: rows of them that are closed by something nearer are passed over quickly. */
static bool large_hidden(const umb_coverage *c, const tile_rect *t, float nearness)
{
    for (uint32_t base = t->tx0; base <= t->tx1; base += 8) {
        uint32_t count = t->tx1 - base + 1, columns = low_mask(count < 8 ? (int32_t)count : 8);
        const float *coarse = c->coarse + (size_t)t->ty0 * c->columns + base;
        for (uint32_t ty = t->ty0; ty <= t->ty1; ++ty, coarse += c->columns) {
            uint32_t open = open_eight(coarse, nearness) & columns;
            if (open != 0 && !row_hidden(c, t, ty, base, open, nearness)) {
                return false;
            }
        }
    }
    return true;
}

UMB_INLINE bool rect_hidden(const umb_coverage *c, uint32_t x0, uint32_t y0, uint32_t x1, uint32_t y1,
                            float nearness)
{
    tile_rect t = find_tiles(x0, y0, x1, y1);
    if (((t.tx1 - t.tx0) | (t.ty1 - t.ty0)) <= 1) {
        return small_hidden(c, &t, nearness);
    }
    return large_hidden(c, &t, nearness);
}

static bool hides_rect(const umb_coverage *c, umb_pixel_rect rect, float nearness)
{
    return rect_hidden(c, (uint32_t)rect.x0, (uint32_t)rect.y0, (uint32_t)rect.x1, (uint32_t)rect.y1,
                       nearness);
}

/* A bit for each box whose image is at most two tiles wide and high. */
UMB_INLINE uint32_t small_images(const umb_projected *b)
{
    uint32_t bits = 0;
    for (int i = 0; i < UMB_NODE_WIDTH; i += UMB_LANES) {
        umb_iv wide = (umb_iv_load(b->x1 + i) >> 5) - (umb_iv_load(b->x0 + i) >> 5);
        umb_iv high = (umb_iv_load(b->y1 + i) >> 3) - (umb_iv_load(b->y0 + i) >> 3);
        bits |= umb_iv_bits((wide | high) <= 1) << i;
    }
    return bits;
}

UMB_INLINE tile_rect tiles_of(const umb_projected *b, uint32_t i)
{
    return find_tiles((uint32_t)b->x0[i], (uint32_t)b->y0[i], (uint32_t)b->x1[i], (uint32_t)b->y1[i]);
}

/* First the small ones, then the large ones: which comes when cannot be guessed. */
static uint32_t hides(const umb_coverage *c, const umb_projected *b, uint32_t mask)
{
    uint32_t hidden = 0, small = small_images(b);
    for (uint32_t left = mask & small; left != 0; left &= left - 1) {
        uint32_t i = (uint32_t)__builtin_ctz(left);
        tile_rect t = tiles_of(b, i);
        hidden |= (uint32_t)small_hidden(c, &t, b->nearness[i]) << i;
    }
    for (uint32_t left = mask & ~small; left != 0; left &= left - 1) {
        uint32_t i = (uint32_t)__builtin_ctz(left);
        tile_rect t = tiles_of(b, i);
        hidden |= (uint32_t)large_hidden(c, &t, b->nearness[i]) << i;
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

/* ---- vertices ------------------------------------------------------------------------------- */

/* Several vertices of a mesh from v on, axis by axis; the last one again where there are no more. */
typedef struct some_points {
    umb_dv at[3];
} some_points;

UMB_INLINE some_points load_points(const umb_mesh *mesh, uint32_t v)
{
    typedef float few __attribute__((vector_size(4 * UMB_WIDE)));
    const float *p[UMB_WIDE];
    uint32_t last = mesh->block_position_count - 1;
    for (uint32_t i = 0; i < UMB_WIDE; ++i) {
        p[i] = mesh->positions[v + i < last ? v + i : last];
    }
    some_points out;
    for (int axis = 0; axis < 3; ++axis) {
#if UMB_WIDE == 4
        few c = {p[0][axis], p[1][axis], p[2][axis], p[3][axis]};
#else
        few c = {p[0][axis], p[1][axis]};
#endif
        out.at[axis] = __builtin_convertvector(c, umb_dv);
    }
    return out;
}

/* umb_transform_point(), several at once. */
UMB_INLINE some_points transform_points(const umb_transform *t, some_points p)
{
    typedef float few __attribute__((vector_size(4 * UMB_WIDE)));
    some_points out;
    for (int i = 0; i < 3; ++i) {
        umb_dv at = (double)t->m[i][0] * p.at[0] + (double)t->m[i][1] * p.at[1] + (double)t->m[i][2] * p.at[2] +
                    (double)t->m[i][3];
        out.at[i] = __builtin_convertvector(__builtin_convertvector(at, few), umb_dv);
    }
    return out;
}

/* World vertices relative to the eye, component by component, and W; the last one again up to a whole vector.
 *
 * The cut is placed 64 units of the mesh's reach beyond near_cut: then what is kept, rounding included, is
 * truly beyond it, and W is large enough for the bounds of a division. */
static void approach(umb_silhouette *s, const umb_raster_map *m, const umb_occluder *o)
{
    uint32_t count = o->mesh->block_position_count;
    umb_dv most = umb_dv_set(0.0), w_min = umb_dv_set(INFINITY), w_max = -w_min;
    s->vertex_count = count;
    s->padded_count = (count + UMB_WIDE - 1) & ~(uint32_t)(UMB_WIDE - 1);
    for (uint32_t v = 0; v < s->padded_count; v += UMB_WIDE) {
        some_points p = load_points(o->mesh, v);
        if (!o->identity) {
            p = transform_points(&o->transform, p);
        }
        umb_dv dx = p.at[0] - m->eye.x, dy = p.at[1] - m->eye.y, dz = p.at[2] - m->eye.z;
        umb_dv w = (m->w.x * dx + m->w.y * dy) + m->w.z * dz;
        umb_dv_store(s->d[0] + v, dx);
        umb_dv_store(s->d[1] + v, dy);
        umb_dv_store(s->d[2] + v, dz);
        umb_dv_store(s->w + v, w);
        most = umb_dv_max(most, (umb_dv_abs(dx) + umb_dv_abs(dy)) + umb_dv_abs(dz));
        w_min = umb_dv_min(w_min, w);
        w_max = umb_dv_max(w_max, w);
    }
    s->reach = -umb_dv_least(-most);
    s->cut_depth = m->near_cut + 64.0 * UMB_U * (s->reach + fabs(m->near_cut));
    s->cut = umb_dv_least(w_min) < s->cut_depth;
    s->any = -umb_dv_least(-w_max) >= s->cut_depth;
}

/* Bounds of section 3, for several vertices at once. What is cut away is left out of extremes by making it a copy
 * of the cut depth in its own direction: no infinity arises, and nobody looks at it. */
static void place(umb_silhouette *s, const umb_raster_map *m)
{
    if (!s->any) {
        return;
    }
    umb_dv huge = umb_dv_set(INFINITY), zero = umb_dv_set(0.0), cut = umb_dv_set(s->cut_depth);
    umb_dv x_min = huge, y_min = huge, x_max = -huge, y_max = -huge, most = -huge, least = huge;
    umb_dv error = zero, near_size = zero;
    for (uint32_t v = 0; v < s->padded_count; v += UMB_WIDE) {
        umb_dv dx = umb_dv_load(s->d[0] + v), dy = umb_dv_load(s->d[1] + v), dz = umb_dv_load(s->d[2] + v);
        umb_dv reach = (umb_dv_abs(dx) + umb_dv_abs(dy)) + umb_dv_abs(dz);
        umb_dv w = umb_dv_load(s->w + v);
        umb_lv keep = w >= cut;
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
            umb_dv r = 1.0 / umb_dv_select(keep, w, cut);
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
        umb_dv_store(s->x + v, x);
        umb_dv_store(s->y + v, y);
        umb_dv_store(s->off + v, e);
        umb_dv_store(s->near_least + v, near_least);
        umb_dv_store(s->near_most + v, near_most);
        umb_dv size = umb_dv_max(umb_dv_abs(near_least), umb_dv_abs(near_most));
        near_size = umb_dv_max(near_size, umb_dv_select(keep, size, zero));
        error = umb_dv_max(error, umb_dv_select(keep, e, zero));
        most = umb_dv_max(most, umb_dv_select(keep, near_most, -huge));
        least = umb_dv_min(least, umb_dv_select(keep, near_least, huge));
        x_min = umb_dv_min(x_min, umb_dv_select(keep, x, huge));
        y_min = umb_dv_min(y_min, umb_dv_select(keep, y, huge));
        x_max = umb_dv_max(x_max, umb_dv_select(keep, x, -huge));
        y_max = umb_dv_max(y_max, umb_dv_select(keep, y, -huge));
    }
    s->error = -umb_dv_least(-error);
    s->near_size = -umb_dv_least(-near_size);
    s->most = -umb_dv_least(-most);
    s->far_corner = umb_dv_least(least);
    s->x_min = umb_dv_least(x_min);
    s->y_min = umb_dv_least(y_min);
    s->x_max = -umb_dv_least(-x_max);
    s->y_max = -umb_dv_least(-y_max);
}

/* place() without bounds of errors, then the pixel of each vertex, as open_at() in raster.c finds it. */
static bool shows_corner(const umb_coverage *c, umb_silhouette *s, const umb_raster_map *m)
{
    if (s->cut) {
        return true;
    }
    umb_dv zero = umb_dv_set(0.0), width = umb_dv_set(m->width), height = umb_dv_set(m->height);
    umb_dv span = umb_dv_set(m->rows.span);
    for (uint32_t v = 0; v < s->padded_count; v += UMB_WIDE) {
        umb_dv dx = umb_dv_load(s->d[0] + v), dy = umb_dv_load(s->d[1] + v), dz = umb_dv_load(s->d[2] + v);
        umb_dv reach = (umb_dv_abs(dx) + umb_dv_abs(dy)) + umb_dv_abs(dz);
        umb_dv w = umb_dv_load(s->w + v), off = (5.0 * UMB_U) * reach;
        umb_dv x = (m->x.x * dx + m->x.y * dy) + m->x.z * dz;
        umb_dv y = (m->y.x * dx + m->y.y * dy) + m->y.z * dz;
        umb_dv near_least;
        if (m->orthographic) {
            near_least = -(w + off);
            near_least -= (4.0 * UMB_U) * umb_dv_abs(near_least);
        } else {
            umb_dv r = 1.0 / w;
            x *= r;
            y *= r;
            near_least = r - r * (2.0 * off * r + 4.0 * UMB_U);
        }
        x += m->cx;
        y += m->cy;
        umb_dv into = umb_dv_min(umb_dv_max(y - m->rows.from, zero), span);
        umb_dv row = umb_dv_max(m->rows.slope * y + m->rows.extra * into, zero);
        umb_lv on = (x >= zero) & (x < width) & (y >= zero) & (y < height);
        umb_dv_store(s->x + v, umb_dv_select(on, x, umb_dv_set(-1.0))); /* beside the raster */
        umb_dv_store(s->y + v, umb_dv_min(row, height - 1.0));
        umb_dv_store(s->near_least + v, near_least);
    }
    for (uint32_t v = 0; v < s->vertex_count; ++v) {
        if (s->x[v] < 0.0) {
            continue;
        }
        uint32_t column = (uint32_t)(int32_t)s->x[v], row = (uint32_t)(int32_t)s->y[v];
        const umb_tile *t = &c->tiles[(size_t)(row / UMB_TILE_HEIGHT) * c->columns + column / UMB_TILE_WIDTH];
        uint32_t r = row % UMB_TILE_HEIGHT, bit = column % UMB_TILE_WIDTH;
        if ((t->mask[r] >> bit & 1u) == 0 || t->z[4 * (r / 4) + bit / 8] < s->near_least[v]) {
            return true;
        }
    }
    return false;
}

/* ---- convex shapes: set-up ------------------------------------------------------------------ */

/* Which triangles surely face the eye, a bit each: silhouette.c has the bound. */
static uint32_t find_front(const umb_raster_map *map, const umb_occluder *o, const umb_silhouette *c)
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

/* The silhouette: edges of which one side faces the eye. They are listed first: which they are cannot be guessed. */
static bool find_lines(umb_convex *out, const umb_raster_map *map, const umb_occluder *o,
                       const umb_silhouette *c, uint32_t front, umb_convex_frame *frame)
{
    const umb_mesh *mesh = o->mesh;
    uint32_t turned = (o->mirrored ? -map->turn : map->turn) > 0 ? 0 : 1, count = 0;
    uint8_t edges[UMB_CONVEX_EDGES];
    for (uint32_t i = 0; i < mesh->edge_count; ++i) {
        const umb_edge *e = &mesh->edges[i];
        edges[count] = (uint8_t)i;
        count += (front >> e->f0 ^ front >> e->f1) & 1u;
    }
    out->left.count = out->right.count = out->edge_count = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const umb_edge *e = &mesh->edges[edges[i]];
        bool along = ((front >> e->f0 ^ turned) & 1u) != 0;
        uint32_t from = along ? e->v0 : e->v1, to = along ? e->v1 : e->v0;
        if (!umb_convex_add_line(out, frame, c->x[from], c->y[from], c->x[to], c->y[to])) {
            return false;
        }
    }
    return true;
}

/* Move the outer lines until no corner is beyond them. */
static void hold_corners(umb_convex_lines *lines, const umb_silhouette *c, double height, double side)
{
    for (uint32_t i = 0; i < lines->count; ++i) {
        double slope = lines->slope[i];
        umb_dv beyond = umb_dv_set(-INFINITY);
        for (uint32_t v = 0; v < c->padded_count; v += UMB_WIDE) {
            umb_dv x = umb_dv_load(c->x + v), y = umb_dv_load(c->y + v);
            beyond = umb_dv_max(beyond, side * (x - slope * y));
        }
        double most = -umb_dv_least(-beyond);
        double size = fabs(slope) * (height + fabs(c->y_min) + fabs(c->y_max)) + fabs(c->x_min) + fabs(c->x_max);
        most += c->error * (1.0 + fabs(slope)) + 16.0 * UMB_U * (size + fabs(most));
        lines->out_at[i] = side * most;
    }
}

/* What must be added to a plane so that it is nowhere below the nearness of any vertex. */
static double plane_height(const umb_silhouette *c, const umb_silhouette_plane *p)
{
    umb_dv above = umb_dv_set(-INFINITY);
    for (uint32_t v = 0; v < c->padded_count; v += UMB_WIDE) {
        umb_dv at = p->gx * umb_dv_load(c->x + v) + p->gy * umb_dv_load(c->y + v);
        above = umb_dv_max(above, umb_dv_load(c->near_most + v) - at);
    }
    return -umb_dv_least(-above) + umb_silhouette_plane_error(c, p, c->error);
}

static void find_planes(umb_convex *out, const umb_raster_map *map, const umb_occluder *o,
                        const umb_silhouette *c, uint32_t front)
{
    umb_silhouette_plane planes[UMB_CONVEX_TRIANGLES];
    uint32_t count = 0;
    double least = INFINITY;
    bool small = (out->x_max - out->x_min) * ((double)out->row1 - out->row0 + 1.0) < UMB_PLANE_PIXELS;
    out->plane_count = 0;
    for (uint32_t left = front; left != 0; left &= left - 1) {
        uint32_t i = (uint32_t)__builtin_ctz(left);
        const uint32_t *k = o->mesh->triangles[i];
        bool shared = false;
        for (int j = 0; j < 3; ++j) {
            least = c->near_least[k[j]] < least ? c->near_least[k[j]] : least;
        }
        for (uint32_t p = 0; p < count && !shared && !small; ++p) {
            shared = umb_silhouette_shares_plane(c, &planes[p], k);
        }
        if (!shared && !small) {
            umb_silhouette_plane_of(c, map, o, i, &planes[count++]);
        }
    }
    if (small && front != 0) {
        umb_convex_add_plane(out, map, 0.0, 0.0, least, c->most, least);
    }
    for (uint32_t i = 0; i < count; ++i) {
        const umb_silhouette_plane *p = &planes[i];
        umb_convex_add_plane(out, map, p->gx, p->gy, p->low, plane_height(c, p), p->far_corner);
    }
}

static umb_convex_result find_convex(const umb_raster_map *map, const umb_occluder *o,
                                     const umb_silhouette *c, umb_convex *out)
{
    uint32_t front = find_front(map, o, c);
    umb_convex_frame frame = {c->error, c->x_max - c->x_min, map->height, c->y_min, c->y_max};
    if (!find_lines(out, map, o, c, front, &frame)) {
        return UMB_CONVEX_OTHER;
    }
    hold_corners(&out->left, c, map->height, -1.0);
    hold_corners(&out->right, c, map->height, 1.0);
    bool covers = umb_convex_place(out, map, &frame, c->x_min, c->x_max);
    out->most = (float)(c->most + 0x1p-22 * fabs(c->most));
    find_planes(out, map, o, c, front);
    return covers ? UMB_CONVEX_READY : UMB_CONVEX_NOTHING;
}

#include "box_image.inl"

/* ---- convex shapes: filling ----------------------------------------------------------------- */

/* Covered columns from left up to right, of eight rows. */
typedef struct spans {
    umb_iv left[UMB_PARTS], right[UMB_PARTS];
} spans;

/* A row takes the worse of a line's x at its two ends. Columns are rounded inwards: in_at holds 2^-20 more
 * than it must, which is what the rounding upwards needs. */
static inline void find_spans(const umb_convex *v, const double *edge, int32_t first, spans *out)
{
    enum { HALVES = 2 * UMB_PARTS };
    umb_dv most = umb_dv_set(v->x_max), zero = umb_dv_set(0.0);
    umb_dv left[HALVES], right[HALVES];
    for (int h = 0; h < HALVES; ++h) {
        left[h] = umb_dv_set(v->x_min);
        right[h] = most;
    }
    for (uint32_t k = 0; k < v->left.count; ++k) {
        double slope = v->left.slope[k], at = v->left.in_at[k];
        const double *y = edge + (int)(slope > 0.0);
        for (int h = 0; h < HALVES; ++h) {
            left[h] = umb_dv_max(left[h], slope * umb_dv_load(y + h * UMB_WIDE) + at);
        }
    }
    for (uint32_t k = 0; k < v->right.count; ++k) {
        double slope = v->right.slope[k], at = v->right.in_at[k];
        const double *y = edge + (int)!(slope > 0.0);
        for (int h = 0; h < HALVES; ++h) {
            right[h] = umb_dv_min(right[h], slope * umb_dv_load(y + h * UMB_WIDE) + at);
        }
    }
    double up = 1.0 - 0x1p-20;
    for (int i = 0; i < UMB_PARTS; ++i) {
        umb_iv row = umb_iv_load(ROW + i * UMB_LANES) + first;
        umb_iv inside = (row >= (int32_t)v->row0) & (row <= (int32_t)v->row1);
        out->left[i] = umb_dv_trunc(umb_dv_min(left[2 * i], most) + up, umb_dv_min(left[2 * i + 1], most) + up);
        out->right[i] = umb_dv_trunc(umb_dv_max(right[2 * i], zero), umb_dv_max(right[2 * i + 1], zero)) & inside;
    }
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
    const float *bound = upper ? v->high : v->low;
    for (uint32_t k = 0; k < v->plane_count; ++k) {
        const float *end = y + ((v->gy[k] < 0.0f) != upper);
        float right = 8.0f * ((v->gx[k] < 0.0f) != upper);
        for (int i = 0; i < UMB_PARTS; ++i) {
            umb_fv row = umb_fv_fours(end[0], end[1], i);
            umb_fv column = umb_fv_load(SUB_X + i * UMB_LANES) + right;
            out->at[k][i] = (bound[k] + v->gy[k] * row) + v->gx[k] * column;
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

/* What a row of tiles is filled with: spans, of which the first and the last tile are met, and tiles from full0 up to
 * full1 are covered whole. */
typedef struct filled_row {
    spans s;
    int32_t tx0, tx1, full0, full1;
} filled_row;

/* An empty row has tx1 before tx0. */
static inline void find_row(const umb_convex *v, const double *edge, int32_t first, filled_row *r)
{
    find_spans(v, edge, first, &r->s);
    umb_iv low = umb_iv_set(INT32_MAX), high = low, inner_low = low, inner_high = low;
    for (int i = 0; i < UMB_PARTS; ++i) {
        umb_iv beside = r->s.left[i] >= r->s.right[i];
        low = umb_iv_min(low, r->s.left[i] | (beside & INT32_MAX));
        high = umb_iv_min(high, -(r->s.right[i] & ~beside));
        inner_low = umb_iv_min(inner_low, -r->s.left[i]);
        inner_high = umb_iv_min(inner_high, r->s.right[i]);
    }
    int32_t ends[4];
    umb_iv_least_each(low, high, inner_low, inner_high, ends);
    r->tx0 = ends[0] >> 5;
    r->tx1 = (-ends[1] - 1) >> 5;
    r->full0 = -(ends[2] >> 5);
    r->full1 = ends[3] >> 5;
}

/* The bound of the body in the sub-tiles of the tile at x. */
UMB_INLINE umb_fv depth_of(const umb_convex *v, const row_planes *p, uint32_t count, int part, float x)
{
    umb_fv z = umb_fv_max(p->at[0][part] + v->gx[0] * x, umb_fv_set(v->least[0]));
    for (uint32_t k = 1; k < count; ++k) {
        z = umb_fv_min(z, umb_fv_max(p->at[k][part] + v->gx[k] * x, umb_fv_set(v->least[k])));
    }
    return z;
}

/* merge_parts() of a whole tile. */
UMB_INLINE bool merge_whole(umb_coverage *c, size_t number, const umb_convex *v, const row_planes *p, uint32_t count,
                            float x)
{
    umb_tile *tile = &c->tiles[number];
    umb_iv any = umb_iv_set(0);
    umb_fv least = umb_fv_set(INFINITY);
    for (int i = 0; i < UMB_PARTS; ++i) {
        int at = i * UMB_LANES;
        umb_fv z = depth_of(v, p, count, i, x), old_z = umb_fv_load(tile->z + at);
        umb_iv fresh = (umb_iv_or_fours(~umb_iv_load(tile->mask + at)) & umb_iv_load(SUB_BYTE + at)) != 0;
        umb_iv change = fresh | (z > old_z);
        z = umb_fv_select(change, z, old_z);
        any |= change;
        least = umb_fv_min(least, z);
        umb_iv_store(tile->mask + at, umb_iv_set(-1));
        umb_fv_store(tile->z + at, z);
    }
    c->coarse[number] = umb_fv_least(least);
    return umb_iv_any(any);
}

/* The bits from a up to b, of which b is at least 0 and a at most 32. */
static inline uint32_t bits_between(int32_t a, int32_t b)
{
    return low_mask(b < 32 ? b : 32) & ~low_mask(a > 0 ? a : 0);
}

/* A bit for each of the 32 tiles from here on that is not closed by something nearer. */
static inline uint32_t open_tiles(const float *coarse, float most)
{
    uint32_t open = 0;
    for (int i = 0; i < 32; i += UMB_LANES) {
        open |= umb_iv_bits(umb_fv_load(coarse + i) < most) << i;
    }
    return open;
}

/* 32 tiles from base on. */
UMB_INLINE uint32_t fill_tiles(umb_coverage *c, size_t row, const umb_convex *v, const filled_row *r,
                               const row_planes *p, int32_t base, uint32_t open, uint32_t count)
{
    uint32_t changed = 0, whole = 0;
    if (r->full0 < r->full1 && r->full0 - base < 32 && r->full1 > base) {
        whole = open & bits_between(r->full0 - base, r->full1 - base);
    }
    for (uint32_t left = open & ~whole; left != 0; left &= left - 1) {
        int32_t tx = base + __builtin_ctz(left);
        tile_part parts[UMB_PARTS];
        for (int i = 0; i < UMB_PARTS; ++i) {
            parts[i].mask = span_mask(r->s.left[i], r->s.right[i], tx * UMB_TILE_WIDTH);
            parts[i].z = depth_of(v, p, count, i, (float)(tx * UMB_TILE_WIDTH));
        }
        changed += merge_parts(c, row + (size_t)tx, parts);
    }
    for (; whole != 0; whole &= whole - 1) {
        int32_t tx = base + __builtin_ctz(whole);
        changed += merge_whole(c, row + (size_t)tx, v, p, count, (float)(tx * UMB_TILE_WIDTH));
    }
    return changed;
}

static inline uint32_t fill_row(umb_coverage *c, const double *edge, uint32_t ty, const umb_convex *v,
                                const filled_row *r)
{
    size_t row = (size_t)ty * c->columns;
    uint32_t changed = 0;
    for (int32_t base = r->tx0 & ~31; base <= r->tx1; base += 32) {
        uint32_t open = open_tiles(c->coarse + row + base, v->most) & bits_between(r->tx0 - base, r->tx1 + 1 - base);
        if (open == 0) {
            continue;
        }
        row_planes planes;
        place_planes(v, edge, false, &planes);
        switch (v->plane_count) { /* three at most for a box: loops of known length */
        case 1:
            changed += fill_tiles(c, row, v, r, &planes, base, open, 1);
            break;
        case 2:
            changed += fill_tiles(c, row, v, r, &planes, base, open, 2);
            break;
        case 3:
            changed += fill_tiles(c, row, v, r, &planes, base, open, 3);
            break;
        default:
            changed += fill_tiles(c, row, v, r, &planes, base, open, v->plane_count);
        }
    }
    return changed;
}

/* So many rows of tiles are found before they are filled: how far they reach is known late, and nobody can guess it;
 * together, none waits for another. */
#define FOUND_ROWS 16

static uint32_t fill_convex(umb_coverage *c, const umb_raster_map *map, const umb_convex *v)
{
    filled_row rows[FOUND_ROWS];
    uint32_t changed = 0, last = v->row1 / UMB_TILE_HEIGHT;
    for (uint32_t from = v->row0 / UMB_TILE_HEIGHT; from <= last; from += FOUND_ROWS) {
        uint32_t count = last - from < FOUND_ROWS ? last - from + 1 : FOUND_ROWS;
        const double *edge = map->rows.edge + (size_t)from * UMB_TILE_HEIGHT;
        for (uint32_t i = 0; i < count; ++i) {
            uint32_t row = i * UMB_TILE_HEIGHT;
            find_row(v, edge + row, (int32_t)(from * UMB_TILE_HEIGHT + row), &rows[i]);
        }
        for (uint32_t i = 0; i < count; ++i) {
            changed += fill_row(c, edge + (size_t)i * UMB_TILE_HEIGHT, from + i, v, &rows[i]);
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

/* ---- any mesh ------------------------------------------------------------------------------- */

/* One tile of the row of tiles that is being filled: pixels that an edge touches; how often the outline winds
 * around each pixel more than around the one left of it, summed from the tile's left border, modulo 8, in three
 * planes of bits; what is covered, and its depth: the least of all triangles that touch a sub-tile, and the
 * greatest of those that hold all of it.
 *
 * Where no edge passes, the winding number is the number of front triangles over the pixel: never negative, so
 * that it is not 0 if it is not 0 modulo 8; eight layers exactly count as none, which is safe. */
struct umb_row_tile {
    umb_iv touched[UMB_PARTS], one[UMB_PARTS], two[UMB_PARTS], four[UMB_PARTS];
    umb_iv mask[UMB_PARTS], wanted[UMB_PARTS];
    umb_fv z[UMB_PARTS], held[UMB_PARTS];
};

typedef struct row_window {
    struct umb_row_tile *tiles; /* from the first column of the raster on */
    uint8_t *state; /* per tile */
    uint16_t *list; /* tiles of which something is wanted, left to right */
    uint32_t count; /* of list */
    uint32_t tx0, tx1;
    uint32_t first, last; /* tiles that an edge has written to lie between these */
} row_window;

enum { TILE_IDLE = 0, TILE_EDGED = 1, TILE_WANTED = 2 };

/* Pixels touched by an edge in eight rows, and the column from which on it counts; both as columns from first on,
 * cut to the window [first, end). */
typedef struct edge_spans {
    umb_iv left, right; /* touched: left up to right */
    umb_iv column, crosses;
} edge_spans;

static inline edge_spans span_edge(const umb_outline_edge *e, const double *edge, int part, double first,
                                   double end)
{
    umb_dv left[2], right[2], column[2];
    umb_lv near_row[2], crossed[2];
    umb_dv y_min = umb_dv_set(e->y_min), y_max = umb_dv_set(e->y_max);
    umb_dv x_min = umb_dv_set(e->x_top < e->x_low ? e->x_top : e->x_low);
    umb_dv x_max = umb_dv_set(e->x_top < e->x_low ? e->x_low : e->x_top);
    umb_dv from = umb_dv_set(first), to = umb_dv_set(end);
    for (int half = 0; half < 2; ++half) {
        const double *at = edge + part * UMB_LANES + half * UMB_WIDE;
        umb_dv top = umb_dv_load(at), low = umb_dv_load(at + 1);
        umb_dv ya = umb_dv_min(umb_dv_max(top - e->error, y_min), y_max);
        umb_dv yb = umb_dv_min(umb_dv_max(low + e->error, y_min), y_max);
        umb_dv xa = e->x_top + (ya - y_min) * e->slope, xb = e->x_top + (yb - y_min) * e->slope;
        umb_dv l = umb_dv_max(umb_dv_min(xa, xb), x_min), r = umb_dv_min(umb_dv_max(xa, xb), x_max);
        if (e->flat) {
            l = x_min;
            r = x_max;
        }
        l -= e->error + 0x1p-30; /* a closed pixel ends where the next one begins */
        r += e->error;
        near_row[half] = (low + e->error >= y_min) & (top - e->error <= y_max) & (r >= from) & (l < to);
        umb_dv middle = 0.5 * (top + low);
        umb_dv x = umb_dv_min(umb_dv_max(e->x_top + (middle - y_min) * e->slope, x_min), x_max) + 1.0;
        crossed[half] = (middle >= y_min) & (middle < y_max) & (x < to);
        left[half] = umb_dv_min(umb_dv_max(l, from), to);
        right[half] = umb_dv_min(umb_dv_max(r, from), to - 1.0);
        column[half] = umb_dv_min(umb_dv_max(x, from), to);
    }
    edge_spans s;
    umb_iv rows = umb_lv_narrow(near_row[0], near_row[1]);
    s.left = umb_dv_trunc(left[0], left[1]);
    s.right = (umb_dv_trunc(right[0], right[1]) + 1) & rows;
    s.column = umb_dv_trunc(column[0], column[1]);
    s.crosses = umb_lv_narrow(crossed[0], crossed[1]);
    return s;
}

/* Add 1 or -1, modulo 8, to the pixels of a mask. */
static inline void count_pixels(struct umb_row_tile *t, int part, umb_iv mask, bool up)
{
    umb_iv one = t->one[part], two = t->two[part];
    umb_iv carry = mask & (up ? one : ~one);
    umb_iv carry2 = carry & (up ? two : ~two);
    t->one[part] = one ^ mask;
    t->two[part] = two ^ carry;
    t->four[part] ^= carry2;
}

/* The columns that an edge may reach within a row of tiles, scalar: its ends there, as span_edge has them. */
static inline void edge_columns(const umb_outline_edge *e, const double *edge, double *low, double *high)
{
    double x_min = e->x_top < e->x_low ? e->x_top : e->x_low;
    double x_max = e->x_top < e->x_low ? e->x_low : e->x_top;
    *low = x_min;
    *high = x_max;
    if (!e->flat) {
        double ya = edge[0] - e->error, yb = edge[8] + e->error;
        ya = ya < e->y_min ? e->y_min : ya;
        yb = yb > e->y_max ? e->y_max : yb;
        double xa = e->x_top + (ya - e->y_min) * e->slope, xb = e->x_top + (yb - e->y_min) * e->slope;
        double l = xa < xb ? xa : xb, r = xa < xb ? xb : xa;
        *low = l > x_min ? l : x_min;
        *high = r < x_max ? r : x_max;
    }
    /* One column on for the crossing, and one for rounding. */
    *low -= e->error + 1.0;
    *high += e->error + 2.0;
}

static inline void clear_tile(struct umb_row_tile *t)
{
    umb_iv zero = umb_iv_set(0);
    for (int i = 0; i < UMB_PARTS; ++i) {
        t->touched[i] = t->one[i] = t->two[i] = t->four[i] = zero;
    }
}

static inline void draw_edge(row_window *w, const umb_outline_edge *e, const double *edge)
{
    double first = w->tx0 * (double)UMB_TILE_WIDTH, end = (w->tx1 + 1.0) * UMB_TILE_WIDTH;
    double low, high;
    edge_columns(e, edge, &low, &high);
    if (low >= end) {
        return;
    }
    low = low > first ? low : first;
    high = high > first ? high : first;
    high = high < end - 1.0 ? high : end - 1.0;
    uint32_t t0 = (uint32_t)low / UMB_TILE_WIDTH, t1 = (uint32_t)high / UMB_TILE_WIDTH;
    edge_spans s[UMB_PARTS];
    for (int i = 0; i < UMB_PARTS; ++i) {
        s[i] = span_edge(e, edge, i, first, end);
    }
    int32_t times = e->count < 0 ? -e->count : e->count;
    w->first = t0 < w->first ? t0 : w->first;
    w->last = t1 > w->last ? t1 : w->last;
    for (uint32_t tx = t0; tx <= t1; ++tx) {
        struct umb_row_tile *t = &w->tiles[tx];
        int32_t x = (int32_t)(tx * UMB_TILE_WIDTH);
        if (w->state[tx] == TILE_IDLE) {
            w->state[tx] = TILE_EDGED;
            clear_tile(t);
        }
        for (int i = 0; i < UMB_PARTS; ++i) {
            t->touched[i] |= span_mask(s[i].left, s[i].right, x);
            umb_iv column = s[i].column - x;
            umb_iv here = s[i].crosses & (column >= 0) & (column < UMB_TILE_WIDTH);
            umb_iv on = here & ~low_bits(column & 31);
            for (int32_t k = 0; k < times; ++k) {
                count_pixels(t, i, on, e->count > 0);
            }
        }
    }
}

/* What is covered in a row of tiles, left to right; the winding number at a tile's last column goes on into the
 * next. Tiles without edges are all alike. A tile is wanted if the occluder covers open pixels there, or closed ones
 * perhaps from nearer. Without a buffer whatever is covered is wanted: merging more gives the same bits, because no
 * bound is above most where a pixel is covered, so that one which is not wanted raises nothing. */
static inline void sweep(const umb_coverage *c, row_window *w, size_t row, float most)
{
    umb_iv zero = umb_iv_set(0);
    umb_iv one[UMB_PARTS], two[UMB_PARTS], four[UMB_PARTS], inside[UMB_PARTS];
    bool covers = false; /* a tile without edges here would be covered somewhere */
    for (int i = 0; i < UMB_PARTS; ++i) {
        one[i] = two[i] = four[i] = inside[i] = zero;
    }
    w->count = 0;
    for (uint32_t tx = w->first; tx <= w->tx1 && (covers || tx <= w->last); ++tx) {
        struct umb_row_tile *t = &w->tiles[tx];
        bool edged = w->state[tx] == TILE_EDGED;
        bool closed = c != NULL && c->coarse[row + tx] >= most;
        if (!edged && (closed || !covers)) {
            continue;
        }
        umb_iv wanted = zero, on = zero;
        w->state[tx] = TILE_IDLE;
        for (int i = 0; i < UMB_PARTS; ++i) {
            umb_iv mask = inside[i];
            if (edged) {
                umb_iv a = t->one[i] ^ one[i], carry = t->one[i] & one[i];
                umb_iv half = t->two[i] ^ two[i];
                umb_iv b = half ^ carry;
                carry = (t->two[i] & two[i]) | (half & carry);
                umb_iv d = t->four[i] ^ four[i] ^ carry;
                mask = (a | b | d) & ~t->touched[i];
                one[i] = a >> 31;
                two[i] = b >> 31;
                four[i] = d >> 31;
                inside[i] = one[i] | two[i] | four[i];
                on |= inside[i];
            }
            int at = i * UMB_LANES;
            umb_iv byte = umb_iv_load(SUB_BYTE + at);
            umb_iv want = (umb_iv_or_fours(mask) & byte) != 0;
            if (c != NULL) {
                const umb_tile *tile = &c->tiles[row + tx];
                umb_iv fresh = (umb_iv_or_fours(mask & ~umb_iv_load(tile->mask + at)) & byte) != 0;
                umb_iv nearer = umb_fv_load(tile->z + at) < most;
                want = fresh | (want & nearer);
            }
            t->wanted[i] = want;
            /* Pixels of sub-tiles that nothing is wanted of are dropped. */
            t->mask[i] = mask & umb_iv_spread(want);
            wanted |= want;
        }
        if (edged) {
            covers = umb_iv_any(on);
        }
        if (!closed && umb_iv_any(wanted)) {
            w->state[tx] = TILE_WANTED;
            w->list[w->count++] = (uint16_t)tx;
        }
    }
}

/* Depth where the triangles' own images decide: all that touch a sub-tile bound it together, from the farthest;
 * one that holds all of it does so alone, however far the others are. */
static inline void lower_row(const row_window *w, const umb_front_triangle *f, const double *edge)
{
    const float y[3] = {(float)edge[0], (float)edge[4], (float)edge[8]};
    umb_fv most[3][UMB_PARTS], least[3][UMB_PARTS], plane[UMB_PARTS];
    for (int i = 0; i < UMB_PARTS; ++i) {
        umb_fv column = umb_fv_load(SUB_X + i * UMB_LANES);
        for (int k = 0; k < 3 && f->sided; ++k) {
            const float *far_end = f->ey[k] > 0.0f ? y + 1 : y, *near_end = f->ey[k] > 0.0f ? y : y + 1;
            float far_x = f->ex[k] > 0.0f ? 8.0f : 0.0f, near_x = 8.0f - far_x;
            most[k][i] = (f->most[k] + f->ey[k] * umb_fv_fours(far_end[0], far_end[1], i)) +
                         f->ex[k] * (column + far_x);
            least[k][i] = (f->least[k] + f->ey[k] * umb_fv_fours(near_end[0], near_end[1], i)) +
                          f->ex[k] * (column + near_x);
        }
        const float *end = f->gy < 0.0f ? y + 1 : y;
        plane[i] = (f->low + f->gy * umb_fv_fours(end[0], end[1], i)) +
                   f->gx * (column + (f->gx < 0.0f ? 8.0f : 0.0f));
    }
    uint32_t t0 = f->tx0 > w->list[0] ? f->tx0 : w->list[0];
    uint32_t t1 = f->tx1 < w->list[w->count - 1] ? f->tx1 : w->list[w->count - 1];
    for (uint32_t tx = t0; tx <= t1; ++tx) {
        struct umb_row_tile *t = &w->tiles[tx];
        float x = (float)(tx * UMB_TILE_WIDTH);
        for (int i = 0; i < UMB_PARTS && w->state[tx] == TILE_WANTED; ++i) {
            umb_iv touches = t->wanted[i], holds = umb_iv_set(0);
            if (f->sided) {
                holds = touches;
                for (int k = 0; k < 3; ++k) {
                    touches &= ~(most[k][i] + f->ex[k] * x < 0.0f);
                    holds &= least[k][i] + f->ex[k] * x > 0.0f;
                }
            }
            umb_fv z = umb_fv_max(plane[i] + f->gx * x, umb_fv_set(f->far_corner));
            t->z[i] = umb_fv_select(touches & (z < t->z[i]), z, t->z[i]);
            t->held[i] = umb_fv_select(holds & (z > t->held[i]), z, t->held[i]);
        }
    }
}

/* Depth by planes. A covered point lies on some triangle, which is no farther than its own plane: the least of all
 * planes is a bound, a tight one where the front bulges towards the eye. And each plane that is nowhere above the
 * front is a bound by itself: the greatest of them is tight in a corner that is looked into. */
static inline void lower_row_by_planes(const row_window *w, const umb_mesh_fill *f, const double *edge)
{
    const float y[3] = {(float)edge[0], (float)edge[4], (float)edge[8]};
    for (int i = 0; i < UMB_PARTS; ++i) {
        umb_fv at[UMB_FILL_PLANES];
        for (uint32_t k = 0; k < f->plane_count; ++k) {
            const umb_fill_plane *p = &f->planes[k];
            const float *end = p->gy < 0.0f ? y + 1 : y;
            umb_fv column = umb_fv_load(SUB_X + i * UMB_LANES) + (p->gx < 0.0f ? 8.0f : 0.0f);
            at[k] = p->gy * umb_fv_fours(end[0], end[1], i) + p->gx * column;
        }
        for (uint32_t n = 0; n < w->count; ++n) {
            struct umb_row_tile *t = &w->tiles[w->list[n]];
            float x = (float)(w->list[n] * UMB_TILE_WIDTH);
            umb_fv some = umb_fv_set(INFINITY), every = -some;
            for (uint32_t k = 0; k < f->plane_count; ++k) {
                const umb_fill_plane *p = &f->planes[k];
                umb_fv v = at[k] + p->gx * x;
                some = umb_fv_min(some, umb_fv_max(v + p->low, umb_fv_set(p->least)));
                every = umb_fv_max(every, v + p->every);
            }
            t->z[i] = umb_fv_max(some, every);
        }
    }
}

/* Where a row of tiles goes: into the buffer, or into a list. */
typedef struct row_sink {
    umb_coverage *coverage; /* NULL: into the list */
    umb_tile_list *list;
    size_t columns;
    uint32_t changed; /* tiles of the buffer */
} row_sink;

static inline void append_parts(umb_tile_list *l, size_t number, const tile_part parts[UMB_PARTS])
{
    if (l->count >= l->capacity) {
        l->full = true;
        return;
    }
    umb_tile *tile = &l->tiles[l->count];
    l->numbers[l->count++] = (uint32_t)number;
    for (int i = 0; i < UMB_PARTS; ++i) {
        umb_iv_store(tile->mask + i * UMB_LANES, parts[i].mask);
        umb_fv_store(tile->z + i * UMB_LANES, parts[i].z);
    }
}

static inline void put_row(row_sink *sink, row_window *w, size_t row, bool held)
{
    for (uint32_t n = 0; n < w->count; ++n) {
        uint32_t tx = w->list[n];
        struct umb_row_tile *t = &w->tiles[tx];
        tile_part parts[UMB_PARTS];
        w->state[tx] = TILE_IDLE;
        for (int i = 0; i < UMB_PARTS; ++i) {
            parts[i].mask = t->mask[i];
            parts[i].z = held ? umb_fv_max(t->z[i], t->held[i]) : t->z[i];
        }
        if (sink->coverage != NULL) {
            sink->changed += merge_parts(sink->coverage, row + tx, parts);
        } else {
            append_parts(sink->list, row + tx, parts);
        }
    }
}

static inline float most_of(const umb_silhouette *s)
{
    return (float)(s->most + 0x1p-22 * fabs(s->most));
}

static void draw_mesh(row_sink *sink, const umb_raster_map *map, umb_silhouette *s, umb_mesh_fill *fill)
{
    row_window w = {fill->tiles, fill->state, fill->list, 0, fill->tx0, fill->tx1, 0, 0};
    umb_fv far = umb_fv_set(INFINITY);
    float most = most_of(s);
    uint32_t edges = UMB_NONE, triangles = UMB_NONE; /* those that this row of tiles meets */
    bool by_plane = fill->plane_count > 0;
    for (uint32_t ty = fill->ty0; ty <= fill->ty1; ++ty) {
        const double *edge = map->rows.edge + (size_t)ty * UMB_TILE_HEIGHT;
        size_t row = ty * sink->columns;
        w.first = w.tx1 + 1;
        w.last = w.tx0;
        /* The lists of this row join what is still there of those before. */
        for (uint32_t i = fill->edges[ty], next; i != UMB_NONE; i = next) {
            next = s->edges[i].next;
            s->edges[i].next = edges;
            edges = i;
        }
        for (uint32_t *at = &edges; *at != UMB_NONE;) {
            umb_outline_edge *e = &s->edges[*at];
            draw_edge(&w, e, edge);
            if (e->row1 <= ty) {
                *at = e->next;
            } else {
                at = &e->next;
            }
        }
        sweep(sink->coverage, &w, row, most);
        bool wanted = w.count > 0;
        if (!by_plane) {
            for (uint32_t i = fill->triangles[ty], next; i != UMB_NONE; i = next) {
                next = s->triangles[i].next;
                s->triangles[i].next = triangles;
                triangles = i;
            }
            for (uint32_t n = 0; n < w.count; ++n) {
                for (int i = 0; i < UMB_PARTS; ++i) {
                    w.tiles[w.list[n]].z[i] = far;
                    w.tiles[w.list[n]].held[i] = -far;
                }
            }
            for (uint32_t *at = &triangles; *at != UMB_NONE;) {
                umb_front_triangle *f = &s->triangles[*at];
                if (wanted) {
                    lower_row(&w, f, edge);
                }
                if (f->ty1 <= ty) {
                    *at = f->next;
                } else {
                    at = &f->next;
                }
            }
        } else if (wanted) {
            lower_row_by_planes(&w, fill, edge);
        }
        if (wanted) {
            put_row(sink, &w, row, !by_plane);
        }
    }
}

static uint32_t fill_mesh(umb_coverage *c, const umb_raster_map *map, umb_silhouette *s, umb_mesh_fill *fill)
{
    row_sink sink = {.coverage = c, .columns = c->columns};
    draw_mesh(&sink, map, s, fill);
    return sink.changed;
}

static bool list_mesh(umb_tile_list *list, const umb_raster_map *map, umb_silhouette *s, umb_mesh_fill *fill)
{
    row_sink sink = {.list = list, .columns = (map->width + UMB_TILE_WIDTH - 1) / UMB_TILE_WIDTH};
    list->count = 0;
    list->full = false;
    list->most = most_of(s);
    draw_mesh(&sink, map, s, fill);
    return !list->full;
}

/* Tiles that are closed by what is nearer than all of the occluder would not change. */
static uint32_t merge_list(umb_coverage *c, const umb_tile_list *list)
{
    uint32_t changed = 0;
    for (uint32_t k = 0; k < list->count; ++k) {
        size_t number = list->numbers[k];
        if (c->coarse[number] >= list->most) {
            continue;
        }
        tile_part parts[UMB_PARTS];
        for (int i = 0; i < UMB_PARTS; ++i) {
            parts[i].mask = umb_iv_load(list->tiles[k].mask + i * UMB_LANES);
            parts[i].z = umb_fv_load(list->tiles[k].z + i * UMB_LANES);
        }
        changed += merge_parts(c, number, parts);
    }
    return changed;
}

const umb_raster_kernels KERNELS = {ISA,      hides,       hides_rect,   approach,  shows_corner, place,     find_convex,
                                    find_box, fill_convex, hides_convex, fill_mesh, list_mesh,    merge_list};

/* The strict silhouette raster, after the incremental occlusion maps of Gummerus 5.5: each
 * occluder's silhouette is filled into a window of its own, its depth bounded a sub-tile at a time,
 * and the result merged into one buffer of covered pixels. docs/conservative.md proves that nothing
 * seen is hidden. */
#include <string.h>

#include "base/memory.h"
#include "fill.h"
#include "method.h"
#include "raster_kernels.h"
#include "silhouette.h"

/* One tile of the occluder being drawn. */
typedef struct window_tile {
    uint32_t mask[UMB_TILE_HEIGHT];
    float z[8];    /* least of all triangles that touch the sub-tile */
    float held[8]; /* greatest of those that hold all of it; -infinity: none */
} window_tile;

typedef struct raster {
    umb_allocator allocator;
    const umb_raster_kernels *kernels;
    umb_raster_map map;
    const umb_committed *scene;
    uint64_t structure; /* of the scene that the scratch was sized for; 0: none */
    umb_coverage coverage;
    umb_fill fill;
    umb_silhouette silhouette;
    umb_convex convex; /* of the occluder convex_of, UMB_NONE: of none */
    umb_convex_result convex_found;
    uint32_t convex_of;
    window_tile *window; /* one per tile of the buffer; masks all zero between draws */
    uint8_t *wanted;     /* per tile: the sub-tiles that the occluder changes, a bit each */
    uint32_t *row;       /* one row of covered words */
    size_t window_capacity, wanted_capacity, row_capacity;
} raster;

static umb_result create(const umb_allocator *allocator, umb_isa isa, void **state)
{
    raster *r = umb_memory_allocate_zero(allocator, 1, sizeof *r);
    if (r == NULL) {
        return UMB_ERROR_MEMORY;
    }
    r->allocator = *allocator;
    r->kernels = umb_raster_kernels_get(isa);
    *state = r;
    return UMB_OK;
}

static void destroy(void *state)
{
    raster *r = state;
    umb_allocator a = r->allocator;
    umb_coverage_free(&r->coverage, &a);
    umb_fill_free(&r->fill, &a);
    umb_silhouette_free(&r->silhouette, &a);
    umb_memory_free(&a, r->window, r->window_capacity * sizeof *r->window);
    umb_memory_free(&a, r->wanted, r->wanted_capacity);
    umb_memory_free(&a, r->row, r->row_capacity * sizeof *r->row);
    umb_memory_free(&a, r, sizeof *r);
}

static bool reserve_window(raster *r)
{
    size_t tiles = (size_t)r->coverage.columns * r->coverage.rows;
    size_t before = r->window_capacity;
    if (!umb_memory_reserve(&r->allocator, (void **)&r->window, &r->window_capacity, tiles,
                            sizeof *r->window)) {
        return false;
    }
    memset(r->window + before, 0, (r->window_capacity - before) * sizeof *r->window);
    return umb_memory_reserve(&r->allocator, (void **)&r->wanted, &r->wanted_capacity, tiles, 1) &&
           umb_memory_reserve(&r->allocator, (void **)&r->row, &r->row_capacity,
                              r->coverage.columns, sizeof *r->row);
}

static bool reserve_silhouette(raster *r, const umb_committed *scene)
{
    if (r->structure == scene->structure + 1) {
        return true;
    }
    uint32_t vertices = 0, triangles = 0, edges = 0;
    for (uint32_t i = 0; i < scene->occluder_count; ++i) {
        const umb_mesh *m = scene->occluders[i].mesh;
        vertices = m->block_position_count > vertices ? m->block_position_count : vertices;
        triangles = m->triangle_count > triangles ? m->triangle_count : triangles;
        edges = m->edge_count > edges ? m->edge_count : edges;
    }
    if (!umb_silhouette_reserve(&r->silhouette, &r->allocator, vertices, triangles, edges)) {
        return false;
    }
    r->structure = scene->structure + 1;
    return true;
}

static umb_result prepare(void *state, const umb_raster_map *map, const umb_committed *scene)
{
    raster *r = state;
    r->map = *map;
    r->scene = scene;
    r->convex_of = UMB_NONE;
    if (!umb_coverage_resize(&r->coverage, &r->allocator, map->width, map->height) ||
        !umb_fill_resize(&r->fill, &r->allocator, map->width, map->height) || !reserve_window(r) ||
        !reserve_silhouette(r, scene)) {
        return UMB_ERROR_MEMORY;
    }
    umb_coverage_clear(&r->coverage);
    return UMB_OK;
}

static uint32_t hides(const void *state, const umb_projected *boxes, uint32_t mask)
{
    const raster *r = state;
    return r->kernels->hides(&r->coverage, boxes, mask);
}

static bool hidden(const void *state, const umb_image *image, const umb_outline *outline)
{
    const raster *r = state;
    return image->rect.x0 > image->rect.x1 ||
           r->kernels->hides_rect(&r->coverage, image->rect, image->nearness) ||
           (outline != NULL &&
            umb_coverage_hides_outline(&r->coverage, r->map.rows.edge, image->rect, outline));
}

static bool open_at(const void *state, double x, double y, double nearness)
{
    const umb_coverage *c = &((const raster *)state)->coverage;
    if (!(x >= 0.0 && y >= 0.0 && x < c->width && y < c->height)) {
        return false;
    }
    uint32_t column = (uint32_t)x, row = (uint32_t)umb_raster_map_row_at(&((const raster *)state)->map, y, 0.0);
    const umb_tile
        *t = &c->tiles[(size_t)(row / UMB_TILE_HEIGHT) * c->columns + column / UMB_TILE_WIDTH];
    uint32_t r = row % UMB_TILE_HEIGHT, bit = column % UMB_TILE_WIDTH;
    return (t->mask[r] >> bit & 1u) == 0 || t->z[4 * (r / 4) + bit / 8] < nearness;
}

/* Pixels and tiles of the silhouette's box. */
typedef struct window {
    uint32_t x0, y0, x1, y1;
    uint32_t tx0, ty0, tx1, ty1;
} window;

static uint32_t clamp_pixel(double v, uint32_t size)
{
    return v < 0.0 ? 0 : v >= size ? size - 1 : (uint32_t)v;
}

static window window_of(const raster *r, double x_min, double y_min, double x_max, double y_max)
{
    window w;
    w.x0 = clamp_pixel(x_min, r->map.width);
    w.y0 = (uint32_t)umb_raster_map_row_at(&r->map, y_min, -r->map.rows.slack);
    w.x1 = clamp_pixel(x_max, r->map.width);
    w.y1 = (uint32_t)umb_raster_map_row_at(&r->map, y_max, r->map.rows.slack);
    w.tx0 = w.x0 / UMB_TILE_WIDTH;
    w.ty0 = w.y0 / UMB_TILE_HEIGHT;
    w.tx1 = w.x1 / UMB_TILE_WIDTH;
    w.ty1 = w.y1 / UMB_TILE_HEIGHT;
    return w;
}

/* Rows of covered pixels into tiles; clamped pixels beyond the raster's right border are cut
 * off. */
static void gather_tiles(raster *r, const window *w)
{
    uint32_t last = r->map.width - 1;
    uint32_t last_mask = ~0u >> (31 - last % 32);
    for (uint32_t y = w->y0; y <= w->y1; ++y) {
        umb_fill_row(&r->fill, y, r->row);
        if (w->tx1 == last / 32) {
            r->row[w->tx1] &= last_mask;
        }
        window_tile *tiles = r->window + (size_t)(y / UMB_TILE_HEIGHT) * r->coverage.columns;
        for (uint32_t tx = w->tx0; tx <= w->tx1; ++tx) {
            tiles[tx].mask[y % UMB_TILE_HEIGHT] = r->row[tx];
        }
    }
}

/* Which sub-tiles of a tile an occluder changes: it covers pixels there that were open, or may
 * cover closed ones from nearer. Its pixels in the others are dropped. */
static uint8_t want_tile(const umb_tile *tile, uint32_t mask[UMB_TILE_HEIGHT], double most)
{
    uint32_t bits[2] = {0, 0}, fresh[2] = {0, 0}, keep[2] = {0, 0};
    for (uint32_t i = 0; i < UMB_TILE_HEIGHT; ++i) {
        bits[i / 4] |= mask[i];
        fresh[i / 4] |= mask[i] & ~tile->mask[i];
    }
    if ((bits[0] | bits[1]) == 0) {
        return 0;
    }
    uint8_t wanted = 0;
    for (uint32_t s = 0; s < 8; ++s) {
        uint32_t byte = 0xFFu << (8 * (s % 4));
        if ((fresh[s / 4] & byte) != 0 || ((bits[s / 4] & byte) != 0 && most > tile->z[s])) {
            wanted = (uint8_t)(wanted | 1u << s);
            keep[s / 4] |= byte;
        }
    }
    for (uint32_t i = 0; i < UMB_TILE_HEIGHT; ++i) {
        mask[i] &= keep[i / 4];
    }
    return wanted;
}

/* Depth of a wanted tile starts as "nearest"; each triangle that may reach it lowers it. */
static bool want_tiles(raster *r, const window *w)
{
    bool any = false;
    for (uint32_t ty = w->ty0; ty <= w->ty1; ++ty) {
        for (uint32_t tx = w->tx0; tx <= w->tx1; ++tx) {
            size_t t = (size_t)ty * r->coverage.columns + tx;
            window_tile *tile = &r->window[t];
            r->wanted[t] = want_tile(&r->coverage.tiles[t], tile->mask, r->silhouette.most);
            any |= r->wanted[t] != 0;
            for (uint32_t s = 0; s < 8 && r->wanted[t] != 0; ++s) {
                tile->z[s] = INFINITY;
                tile->held[s] = -INFINITY;
            }
        }
    }
    return any;
}

/* A rectangle of the raster. */
typedef struct area {
    double x, y, width, height;
} area;

/* Least nearness of a triangle over a sub-tile: its plane at the corner where it is farthest, or
 * its farthest vertex where that is nearer. The loss of 2^-21 covers the plane's 2^-22 and the
 * float. */
static float farthest_in(const umb_depth_triangle *t, const area *a)
{
    double gx = t->gx < 0.0 ? t->gx * a->width : 0.0, gy = t->gy < 0.0 ? t->gy * a->height : 0.0;
    double z = t->g0 + (t->gx * a->x + gx) + (t->gy * a->y + gy);
    z = z > t->least ? z : t->least;
    return (float)(z - 0x1p-21 * fabs(z));
}

typedef enum overlap { BESIDE, TOUCHES, HOLDS } overlap;

/* How a triangle's image lies to a closed rectangle of the raster, as far as its sides tell. */
static overlap place_rect(const umb_depth_triangle *t, const area *a)
{
    bool holds = t->side_count > 0;
    for (uint32_t i = 0; i < t->side_count; ++i) {
        double at = t->ex[i] * a->x + t->ey[i] * a->y + t->e0[i];
        double wide = t->ex[i] * a->width, high = t->ey[i] * a->height;
        double most = at + (wide > 0.0 ? wide : 0.0) + (high > 0.0 ? high : 0.0);
        double least = at + (wide < 0.0 ? wide : 0.0) + (high < 0.0 ? high : 0.0);
        if (most < -t->margin[i]) {
            return BESIDE;
        }
        holds = holds && least > t->margin[i];
    }
    return holds ? HOLDS : TOUCHES;
}

/* First and last of count sub-tiles of a size, from an origin, that [low, high] meets; none if first is
 * beyond last. Images reach far beyond the raster, so ends are cut before they become whole numbers. */
static void sub_tile_range(double low, double high, double origin, double size, int count,
                           int *first, int *last)
{
    double f = (low - origin) / size - 1e-9, l = (high - origin) / size + 1e-9;
    *first = f >= count ? count : f > 0.0 ? (int)f : 0;
    *last = l < 0.0 ? -1 : l < count ? (int)l : count - 1;
}

/* All that touch a sub-tile bound its depth together, from the farthest; one that holds all of it
 * does so alone, however far the others are. */
static void lower_tile(window_tile *tile, uint8_t wanted, const umb_front_triangle *front,
                       const umb_depth_triangle *t, const double *edge, uint32_t tx, const window *v,
                       uint32_t ty)
{
    double x0 = tx * UMB_TILE_WIDTH;
    const area all = {x0, edge[0], UMB_TILE_WIDTH, edge[UMB_TILE_HEIGHT] - edge[0]};
    overlap whole = place_rect(t, &all);
    if (whole == BESIDE) {
        return;
    }
    int i0, i1;
    sub_tile_range(front->x_min, front->x_max, x0, 8.0, 4, &i0, &i1);
    int j0 = v->y0 > ty * UMB_TILE_HEIGHT + 3, j1 = v->y1 >= ty * UMB_TILE_HEIGHT + 4;
    for (int j = j0; j <= j1; ++j) {
        for (int i = i0; i <= i1; ++i) {
            int s = 4 * j + i;
            if ((wanted >> s & 1) == 0) {
                continue;
            }
            const area sub = {x0 + 8.0 * i, edge[4 * j], 8.0, edge[4 * j + 4] - edge[4 * j]};
            overlap place = whole == HOLDS ? HOLDS : place_rect(t, &sub);
            if (place == BESIDE) {
                continue;
            }
            float z = farthest_in(t, &sub);
            tile->z[s] = z < tile->z[s] ? z : tile->z[s];
            tile->held[s] = place == HOLDS && z > tile->held[s] ? z : tile->held[s];
        }
    }
}

static void bound_depth(raster *r, const window *w)
{
    const umb_silhouette *s = &r->silhouette;
    for (uint32_t i = 0; i < s->triangle_count; ++i) {
        const umb_front_triangle *front = &s->triangles[i];
        window v = window_of(r, front->x_min, front->y_min, front->x_max, front->y_max);
        uint32_t tx1 = v.tx1 < w->tx1 ? v.tx1 : w->tx1, ty1 = v.ty1 < w->ty1 ? v.ty1 : w->ty1;
        umb_depth_triangle t;
        bool ready = false;
        for (uint32_t ty = v.ty0 > w->ty0 ? v.ty0 : w->ty0; ty <= ty1; ++ty) {
            for (uint32_t tx = v.tx0 > w->tx0 ? v.tx0 : w->tx0; tx <= tx1; ++tx) {
                size_t tile = (size_t)ty * r->coverage.columns + tx;
                if (r->wanted[tile] == 0) {
                    continue;
                }
                if (!ready) {
                    umb_silhouette_depth(s, &r->map, front, &t);
                    ready = true;
                }
                lower_tile(&r->window[tile], r->wanted[tile], front, &t,
                           r->map.rows.edge + (size_t)ty * UMB_TILE_HEIGHT, tx, &v, ty);
            }
        }
    }
}

static void merge_tiles(raster *r, const window *w)
{
    for (uint32_t ty = w->ty0; ty <= w->ty1; ++ty) {
        for (uint32_t tx = w->tx0; tx <= w->tx1; ++tx) {
            uint32_t t = ty * r->coverage.columns + tx;
            if (r->wanted[t] != 0) {
                window_tile *tile = &r->window[t];
                for (uint32_t s = 0; s < 8; ++s) {
                    tile->z[s] = tile->held[s] > tile->z[s] ? tile->held[s] : tile->z[s];
                }
                (void)r->kernels->merge(&r->coverage, t, tile->mask, tile->z);
                memset(tile->mask, 0, sizeof tile->mask);
            }
        }
    }
}

/* The convex image of an occluder; asked for and drawn one after the other, it is found once. */
static umb_convex_result find_convex(raster *r, uint32_t occluder)
{
    if (r->convex_of != occluder) {
        r->convex_of = occluder;
        r->convex_found = r->kernels->find_convex(&r->map, &r->scene->occluders[occluder], &r->convex);
    }
    return r->convex_found;
}

static bool hides_body(void *state, uint32_t occluder, const umb_image *image)
{
    raster *r = state;
    const umb_mesh *mesh = r->scene->occluders[occluder].mesh;
    if (!mesh->convex || mesh->triangle_count > UMB_CONVEX_TRIANGLES ||
        find_convex(r, occluder) == UMB_CONVEX_OTHER) {
        return false;
    }
    return r->kernels->hides_convex(&r->coverage, &r->map, &r->convex, image->rect);
}

static bool occlude(void *state, uint32_t occluder, umb_cull_stats *stats)
{
    raster *r = state;
    const umb_occluder *o = &r->scene->occluders[occluder];
    bool convex = o->mesh->convex && o->mesh->triangle_count <= UMB_CONVEX_TRIANGLES;
    umb_convex_result found = convex ? find_convex(r, occluder) : UMB_CONVEX_OTHER;
    umb_silhouette *s = &r->silhouette;
    if (found == UMB_CONVEX_OTHER) {
        r->convex_of = UMB_NONE;
        if (!umb_silhouette_find(s, &r->map, o)) {
            return false;
        }
        found = convex ? umb_convex_of_silhouette(s, &r->map, &r->convex) : UMB_CONVEX_OTHER;
    }
    if (found != UMB_CONVEX_OTHER) {
        stats->occluders += found == UMB_CONVEX_READY;
        stats->edges += found == UMB_CONVEX_READY ? r->convex.edge_count : 0;
        return found == UMB_CONVEX_READY &&
               r->kernels->fill_convex(&r->coverage, &r->map, &r->convex);
    }
    window w = window_of(r, s->x_min, s->y_min, s->x_max, s->y_max);
    umb_fill_begin(&r->fill, &r->map, w.x0, w.y0, w.x1, w.y1);
    for (uint32_t i = 0; i < s->edge_count; ++i) {
        umb_fill_edge(&r->fill, &s->edges[i]);
    }
    gather_tiles(r, &w);
    stats->occluders += 1;
    stats->edges += s->edge_count;
    if (!want_tiles(r, &w)) {
        return false;
    }
    bound_depth(r, &w);
    merge_tiles(r, &w);
    return true;
}

static const umb_coverage *buffer(const void *state)
{
    return &((const raster *)state)->coverage;
}

const umb_method_ops umb_raster_method = {
    "raster", UMB_CLASS_STRICT, create, destroy, prepare, hides, hidden, hides_body, open_at, occlude, buffer,
};

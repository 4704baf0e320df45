/* Depths are kept as 1 / view depth, row by row: it is affine over the picture, and 0 is nothing. One far
 * bound for each 8 x 8 pixels, made anew when it is asked for after something was drawn there. */
#include "zbuffer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lanes.h"

enum { TILE = 8, MANY_TRIANGLES = 16 };

typedef struct corner3 {
    float x, y, w;
} corner3;

struct zbuffer {
    const world *world;
    screen_lens lens;
    screen_boxes boxes;
    uint32_t width, height, stride, tiles_x, tiles_y;
    float *depth;
    float *tile; /* least of its 64 depths, unless changed */
    uint8_t *changed;
    uint32_t *order, *scratch; /* occluders, nearest first */
    float *occluder_depth;
    corner3 *corners; /* of one occluder, in the view's axes */
    bool many;        /* it has many triangles: most of them lie behind others */
    uint32_t *visible;
};

static void *room(size_t bytes)
{
    return aligned_alloc(64, (bytes + 127) / 64 * 64);
}

zbuffer *zbuffer_create(const world *w, uint32_t width, uint32_t height)
{
    zbuffer *z = calloc(1, sizeof *z);
    if (z == NULL) {
        return NULL;
    }
    uint32_t most = 1;
    for (uint32_t i = 0; i < w->occluder_count; ++i) {
        most = w->occluders[i].vertex_count > most ? w->occluders[i].vertex_count : most;
    }
    z->world = w;
    z->width = width;
    z->height = height;
    z->tiles_x = (width + TILE - 1) / TILE;
    z->tiles_y = (height + TILE - 1) / TILE;
    z->stride = z->tiles_x * TILE;
    z->depth = room((size_t)z->stride * z->tiles_y * TILE * sizeof(float));
    z->tile = room((size_t)z->tiles_x * z->tiles_y * sizeof(float));
    z->changed = room((size_t)z->tiles_x * z->tiles_y);
    z->order = room(w->occluder_count * sizeof(uint32_t));
    z->scratch = room(w->occluder_count * sizeof(uint32_t));
    z->occluder_depth = room(w->occluder_count * sizeof(float));
    z->corners = room(most * sizeof(corner3));
    z->visible = room(w->box_count * sizeof(uint32_t));
    if (z->depth == NULL || z->tile == NULL || z->changed == NULL || z->order == NULL ||
        z->scratch == NULL || z->occluder_depth == NULL || z->corners == NULL ||
        z->visible == NULL || !screen_boxes_make(&z->boxes, w)) {
        zbuffer_destroy(z);
        return NULL;
    }
    return z;
}

void zbuffer_destroy(zbuffer *z)
{
    if (z == NULL) {
        return;
    }
    free(z->depth);
    free(z->tile);
    free(z->changed);
    free(z->order);
    free(z->scratch);
    free(z->occluder_depth);
    free(z->corners);
    free(z->visible);
    screen_boxes_free(&z->boxes);
    free(z);
}

static void clear(zbuffer *z)
{
    memset(z->depth, 0, (size_t)z->stride * z->tiles_y * TILE * sizeof(float));
    memset(z->tile, 0, (size_t)z->tiles_x * z->tiles_y * sizeof(float));
    memset(z->changed, 0, (size_t)z->tiles_x * z->tiles_y);
}

/* The depth of a triangle over the picture. */
typedef struct gradient {
    float at, dx, dy; /* at pixel (0, 0)'s centre */
    float most;       /* its nearest corner: slivers have wild slopes */
} gradient;

static void draw_row(zbuffer *z, uint32_t y, uint32_t x_begin, uint32_t x_end, const gradient *g)
{
    float *row = z->depth + (size_t)y * z->stride;
    uint32_t x = x_begin & ~(TILE - 1u);
    lanes value = g->at + g->dy * (float)y + g->dx * ((float)x + lanes_count);
    lanes most = {g->most, g->most, g->most, g->most, g->most, g->most, g->most, g->most};
    float step = g->dx * TILE;
    int32_t begin = (int32_t)x_begin;
    int32_t end = (int32_t)x_end;
    for (; x < x_end; x += TILE, value += step) {
        lanes_mask pixel = (int32_t)x + lanes_number;
        lanes in = lanes_keep(lanes_least(value, most), (pixel >= begin) & (pixel < end));
        lanes_store(row + x, lanes_most(in, lanes_load(row + x)));
    }
}

static uint32_t clamp_pixel(float value, uint32_t end)
{
    return value > 0.0f ? (value < (float)end ? (uint32_t)value : end) : 0;
}

/* One edge as a bound of each row: x = x0 + (row's centre - y0) * slope. */
typedef struct edge {
    float x0, y0, slope;
    bool left;
} edge;

static bool set_up(const float p[3][3], edge e[3], uint32_t *edges, gradient *g)
{
    float ax = p[1][0] - p[0][0];
    float ay = p[1][1] - p[0][1];
    float bx = p[2][0] - p[0][0];
    float by = p[2][1] - p[0][1];
    float area = ax * by - bx * ay;
    if (area == 0.0f) {
        return false;
    }
    float az = p[1][2] - p[0][2];
    float bz = p[2][2] - p[0][2];
    g->dx = (az * by - bz * ay) / area;
    g->dy = (bz * ax - az * bx) / area;
    g->at = p[0][2] + g->dx * (0.5f - p[0][0]) + g->dy * (0.5f - p[0][1]);
    g->most = fmaxf(p[0][2], fmaxf(p[1][2], p[2][2]));
    *edges = 0;
    for (int i = 0; i < 3; ++i) {
        const float *a = p[i];
        const float *b = p[(i + 1) % 3];
        float rise = b[1] - a[1];
        if (rise != 0.0f) {
            e[(*edges)++] = (edge){a[0], a[1], (b[0] - a[0]) / rise, (rise < 0.0f) == (area > 0.0f)};
        }
    }
    return true;
}

static void bound_tile(zbuffer *z, uint32_t tx, uint32_t ty)
{
    size_t t = (size_t)ty * z->tiles_x + tx;
    const float *row = z->depth + (size_t)ty * TILE * z->stride + (size_t)tx * TILE;
    lanes least = lanes_load(row);
    for (uint32_t y = 1; y < TILE; ++y) {
        least = lanes_least(least, lanes_load(row + y * z->stride));
    }
    float bound = least[0];
    for (uint32_t j = 1; j < TILE; ++j) {
        bound = least[j] < bound ? least[j] : bound;
    }
    z->tile[t] = bound;
    z->changed[t] = 0;
}

static inline float tile_bound(zbuffer *z, uint32_t tx, uint32_t ty)
{
    size_t t = (size_t)ty * z->tiles_x + tx;
    if (z->changed[t]) {
        bound_tile(z, tx, ty);
    }
    return z->tile[t];
}

/* Is everything in these pixels nearer already than the triangle's nearest corner? */
static bool buried(zbuffer *z, uint32_t x_first, uint32_t x_last, uint32_t y_begin, uint32_t y_end,
                   float most)
{
    for (uint32_t ty = y_begin / TILE; ty <= (y_end - 1) / TILE; ++ty) {
        for (uint32_t tx = x_first / TILE; tx <= (x_last - 1) / TILE; ++tx) {
            if (tile_bound(z, tx, ty) < most) {
                return false;
            }
        }
    }
    return true;
}

/* p: x, y in pixels and 1 / depth of three corners. */
static void draw_triangle(zbuffer *z, const float p[3][3])
{
    edge e[3];
    gradient g;
    uint32_t edges;
    float low = fminf(p[0][1], fminf(p[1][1], p[2][1]));
    float high = fmaxf(p[0][1], fmaxf(p[1][1], p[2][1]));
    float west = fminf(p[0][0], fminf(p[1][0], p[2][0]));
    float east = fmaxf(p[0][0], fmaxf(p[1][0], p[2][0]));
    uint32_t y_begin = clamp_pixel(ceilf(low - 0.5f), z->height);
    uint32_t y_end = clamp_pixel(ceilf(high - 0.5f), z->height);
    uint32_t x_first = clamp_pixel(ceilf(west - 0.5f), z->width);
    uint32_t x_last = clamp_pixel(ceilf(east - 0.5f), z->width);
    if (y_begin >= y_end || x_first >= x_last ||
        (z->many &&
         buried(z, x_first, x_last, y_begin, y_end, fmaxf(p[0][2], fmaxf(p[1][2], p[2][2])))) ||
        !set_up(p, e, &edges, &g)) {
        return;
    }
    for (uint32_t y = y_begin; y < y_end; ++y) {
        float begin = (float)x_first;
        float end = (float)x_last;
        float middle = (float)y + 0.5f;
        for (uint32_t i = 0; i < edges; ++i) {
            float x = e[i].x0 + (middle - e[i].y0) * e[i].slope - 0.5f;
            begin = e[i].left ? fmaxf(begin, x) : begin;
            end = e[i].left ? end : fminf(end, x);
        }
        uint32_t x_begin = clamp_pixel(ceilf(begin), z->width);
        uint32_t x_end = clamp_pixel(ceilf(end), z->width);
        if (x_begin < x_end) {
            draw_row(z, y, x_begin, x_end, &g);
        }
    }
    for (uint32_t ty = y_begin / TILE; ty <= (y_end - 1) / TILE; ++ty) {
        uint32_t first = x_first / TILE;
        memset(z->changed + (size_t)ty * z->tiles_x + first, 1, (x_last - 1) / TILE - first + 1);
    }
}

static void to_pixels(const zbuffer *z, const corner3 *c, float out[3])
{
    out[2] = 1.0f / c->w;
    out[0] = c->x * out[2] + z->lens.centre[0];
    out[1] = c->y * out[2] + z->lens.centre[1];
}

static corner3 meet_near(const zbuffer *z, const corner3 *a, const corner3 *b)
{
    float s = (z->lens.near_depth - a->w) / (b->w - a->w);
    return (corner3){a->x + s * (b->x - a->x), a->y + s * (b->y - a->y), z->lens.near_depth};
}

/* y grows downwards, so fronts run the other way round. */
static bool faces_away(const float p[3][3])
{
    return (p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) - (p[2][0] - p[0][0]) * (p[1][1] - p[0][1]) >=
           0.0f;
}

static void draw_clipped(zbuffer *z, const corner3 *c[3], bool two_sided)
{
    float polygon[4][3];
    uint32_t n = 0;
    for (int i = 0; i < 3; ++i) {
        const corner3 *a = c[i];
        const corner3 *b = c[(i + 1) % 3];
        if (a->w >= z->lens.near_depth) {
            to_pixels(z, a, polygon[n++]);
        }
        if ((a->w >= z->lens.near_depth) != (b->w >= z->lens.near_depth)) {
            corner3 cut = meet_near(z, a, b);
            to_pixels(z, &cut, polygon[n++]);
        }
    }
    for (uint32_t i = 2; i < n; ++i) {
        float p[3][3];
        memcpy(p[0], polygon[0], sizeof p[0]);
        memcpy(p[1], polygon[i - 1], sizeof p[1]);
        memcpy(p[2], polygon[i], sizeof p[2]);
        if (two_sided || !faces_away((const float(*)[3])p)) {
            draw_triangle(z, (const float(*)[3])p);
        }
    }
}

static void draw_occluder(zbuffer *z, const world_occluder *o)
{
    const world *w = z->world;
    const screen_lens *lens = &z->lens;
    bool crosses = false;
    z->many = o->triangle_count > MANY_TRIANGLES;
    for (uint32_t v = 0; v < o->vertex_count; ++v) {
        const float *p = w->vertices + 3 * ((size_t)o->first_vertex + v);
        float d[3] = {p[0] - lens->eye[0], p[1] - lens->eye[1], p[2] - lens->eye[2]};
        corner3 *c = &z->corners[v];
        c->x = lens->x[0] * d[0] + lens->x[1] * d[1] + lens->x[2] * d[2];
        c->y = lens->y[0] * d[0] + lens->y[1] * d[1] + lens->y[2] * d[2];
        c->w = lens->w[0] * d[0] + lens->w[1] * d[1] + lens->w[2] * d[2];
        crosses = crosses || c->w < lens->near_depth;
    }
    for (uint32_t k = 0; k < o->triangle_count; ++k) {
        const uint32_t *index = w->indices + 3 * ((size_t)o->first_triangle + k);
        bool two_sided = w->two_sided[o->first_triangle + k];
        const corner3 *c[3] = {&z->corners[index[0] - o->first_vertex],
                               &z->corners[index[1] - o->first_vertex],
                               &z->corners[index[2] - o->first_vertex]};
        float p[3][3];
        if (crosses && (c[0]->w < lens->near_depth || c[1]->w < lens->near_depth ||
                        c[2]->w < lens->near_depth)) {
            draw_clipped(z, c, two_sided);
            continue;
        }
        for (int i = 0; i < 3; ++i) {
            to_pixels(z, c[i], p[i]);
        }
        if (two_sided || !faces_away((const float(*)[3])p)) {
            draw_triangle(z, (const float(*)[3])p);
        }
    }
}

typedef struct rectangle {
    uint32_t x0, x1, y0, y1; /* pixels, both ends in it */
} rectangle;

/* Is every pixel of the rectangle within one tile nearer than this? */
static bool tile_hides(const zbuffer *z, const rectangle *r, uint32_t tx, uint32_t ty, float inverse)
{
    uint32_t x0 = r->x0 > tx * TILE ? r->x0 : tx * TILE;
    uint32_t x1 = r->x1 < tx * TILE + TILE - 1 ? r->x1 : tx * TILE + TILE - 1;
    uint32_t y0 = r->y0 > ty * TILE ? r->y0 : ty * TILE;
    uint32_t y1 = r->y1 < ty * TILE + TILE - 1 ? r->y1 : ty * TILE + TILE - 1;
    lanes_mask pixel = (int32_t)(tx * TILE) + lanes_number;
    lanes_mask in = (pixel >= (int32_t)x0) & (pixel <= (int32_t)x1);
    for (uint32_t y = y0; y <= y1; ++y) {
        const float *row = z->depth + (size_t)y * z->stride + (size_t)tx * TILE;
        if (lanes_any((lanes_load(row) <= inverse) & in)) {
            return false;
        }
    }
    return true;
}

bool zbuffer_hides(zbuffer *z, const zbuffer_box *box)
{
    if (box->nearest < z->lens.near_depth) {
        return false;
    }
    if (!(box->x_max >= 0.0f && box->y_max >= 0.0f && box->x_min < (float)z->width &&
          box->y_min < (float)z->height)) {
        return true; /* beside the picture */
    }
    const rectangle r = {
        clamp_pixel(box->x_min, z->width - 1), clamp_pixel(box->x_max, z->width - 1),
        clamp_pixel(box->y_min, z->height - 1), clamp_pixel(box->y_max, z->height - 1)};
    float inverse = 1.0f / box->nearest;
    for (uint32_t ty = r.y0 / TILE; ty <= r.y1 / TILE; ++ty) {
        for (uint32_t tx = r.x0 / TILE; tx <= r.x1 / TILE; ++tx) {
            if (tile_bound(z, tx, ty) <= inverse && !tile_hides(z, &r, tx, ty, inverse)) {
                return false;
            }
        }
    }
    return true;
}

static bool hidden(zbuffer *z, uint32_t place)
{
    const screen_boxes *s = &z->boxes;
    const zbuffer_box box = {s->x_min[place], s->x_max[place], s->y_min[place], s->y_max[place],
                             s->nearest[place]};
    return zbuffer_hides(z, &box);
}

static bool in_frustum(const screen_boxes *s, uint32_t box)
{
    return (s->mask[box / 8] >> (box % 8) & 1) != 0;
}

static void draw_all(zbuffer *z)
{
    const world *w = z->world;
    uint32_t count = 0;
    for (uint32_t i = 0; i < w->occluder_count; ++i) {
        if (in_frustum(&z->boxes, w->occluders[i].box)) {
            z->occluder_depth[i] = z->boxes.nearest[z->boxes.place[w->occluders[i].box]];
            z->order[count++] = i;
        }
    }
    screen_boxes_sort(z->occluder_depth, z->order, z->scratch, count);
    for (uint32_t i = 0; i < count; ++i) {
        const world_occluder *o = &w->occluders[z->order[i]];
        if (!hidden(z, z->boxes.place[o->box])) {
            draw_occluder(z, o);
        }
    }
}

const screen_lens *zbuffer_begin(zbuffer *z, const umb_view *view)
{
    screen_lens_make(&z->lens, view, z->width, z->height);
    clear(z);
    return &z->lens;
}

void zbuffer_draw(zbuffer *z, uint32_t occluder)
{
    draw_occluder(z, &z->world->occluders[occluder]);
}

uint32_t zbuffer_frame(zbuffer *z, const umb_view *view, const uint32_t **objects)
{
    uint32_t count = 0;
    screen_boxes_frame(&z->boxes, z->world, zbuffer_begin(z, view));
    draw_all(z);
    for (uint32_t i = 0; i < z->boxes.count; ++i) {
        if (!hidden(z, i)) {
            z->visible[count++] = z->world->box_object[z->boxes.box[i]];
        }
    }
    *objects = z->visible;
    return count;
}

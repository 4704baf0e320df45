#include "coverage.h"

#include <math.h>
#include <string.h>

bool umb_coverage_resize(umb_coverage *c, const umb_allocator *a, uint32_t width, uint32_t height)
{
    uint32_t columns = (width + UMB_TILE_WIDTH - 1) / UMB_TILE_WIDTH;
    uint32_t rows = (height + UMB_TILE_HEIGHT - 1) / UMB_TILE_HEIGHT;
    size_t need = (size_t)columns * rows;
    if (need > c->tile_capacity) {
        umb_tile *tiles = umb_memory_allocate(a, need * sizeof(umb_tile));
        float *coarse = umb_memory_allocate(a, need * sizeof(float));
        if (tiles == NULL || coarse == NULL) {
            umb_memory_free(a, tiles, need * sizeof(umb_tile));
            umb_memory_free(a, coarse, need * sizeof(float));
            return false;
        }
        umb_coverage_free(c, a);
        c->tiles = tiles;
        c->coarse = coarse;
        c->tile_capacity = need;
    }
    c->width = width;
    c->height = height;
    c->columns = columns;
    c->rows = rows;
    return true;
}

void umb_coverage_free(umb_coverage *c, const umb_allocator *a)
{
    umb_memory_free(a, c->tiles, c->tile_capacity * sizeof(umb_tile));
    umb_memory_free(a, c->coarse, c->tile_capacity * sizeof(float));
    memset(c, 0, sizeof *c);
}

void umb_coverage_clear(umb_coverage *c)
{
    uint32_t last_column = c->columns - 1;
    uint32_t used = c->width - last_column * UMB_TILE_WIDTH;
    uint32_t beyond = used == UMB_TILE_WIDTH ? 0 : ~0u << used;
    for (uint32_t ty = 0; ty < c->rows; ++ty) {
        umb_tile *row = c->tiles + (size_t)ty * c->columns;
        for (uint32_t tx = 0; tx < c->columns; ++tx) {
            uint32_t pad = tx == last_column ? beyond : 0;
            for (uint32_t r = 0; r < UMB_TILE_HEIGHT; ++r) {
                row[tx].mask[r] = ty * UMB_TILE_HEIGHT + r < c->height ? pad : ~0u;
            }
            for (uint32_t s = 0; s < 8; ++s) {
                row[tx].z[s] = INFINITY;
            }
        }
    }
    for (size_t t = 0; t < (size_t)c->columns * c->rows; ++t) {
        c->coarse[t] = -INFINITY;
    }
}

/* Columns that an outline enters in a row, [*first, *last]; false if none. The row's closed band
 * and the outline are grown by the error; interpolating adds fewer than 16 units of the
 * coordinates. */
static bool outline_span(const umb_outline *o, const double *edge, uint32_t width, uint32_t *first,
                         uint32_t *last)
{
    double low = INFINITY, high = -INFINITY, y0 = edge[0] - o->error, y1 = edge[1] + o->error;
    for (uint32_t i = 0; i < o->count; ++i) {
        uint32_t k = i + 1 < o->count ? i + 1 : 0;
        double px = o->x[i], py = o->y[i], qx = o->x[k], qy = o->y[k];
        if ((py < y0 && qy < y0) || (py > y1 && qy > y1)) {
            continue;
        }
        double x[2] = {px, qx}, y[2] = {py, qy};
        for (int end = 0; end < 2; ++end) {
            double cut = y[end] < y0 ? y0 : y[end] > y1 ? y1 : y[end];
            /* An end outside the band: move it to the border along the edge, never past the other
             * end. */
            double at = cut == y[end] ? x[end] : px + (cut - py) * ((qx - px) / (qy - py));
            double lo = px < qx ? px : qx, hi = px < qx ? qx : px;
            at = at < lo ? lo : at > hi ? hi : at;
            double slack = 0x1p-49 * (fabs(px) + fabs(qx));
            low = at - slack < low ? at - slack : low;
            high = at + slack > high ? at + slack : high;
        }
    }
    low -= o->error;
    high += o->error;
    if (!(high >= 0.0 && low <= width)) {
        return false;
    }
    int32_t end = (int32_t)width - 1;
    int32_t from = umb_pixel_floor(low - UMB_PIXEL_SLACK),
            to = umb_pixel_floor(high + UMB_PIXEL_SLACK);
    from = from < 0 ? 0 : from > end ? end : from;
    to = to < from ? from : to > end ? end : to;
    *first = (uint32_t)from;
    *last = (uint32_t)to;
    return true;
}

/* Most nearness of an outline over eight columns from x on, between two heights, up by what covers the
 * plane's relative 2^-22. */
static double outline_nearness(const umb_outline *o, double x, double y0, double y1)
{
    double z = o->g0 + (o->gx * x + (o->gx > 0.0 ? o->gx * 8.0 : 0.0)) + o->gy * (o->gy > 0.0 ? y1 : y0);
    z += 0x1p-21 * fabs(z);
    return z < o->most ? z : o->most;
}

static bool outline_row_hidden(const umb_coverage *c, const umb_outline *o, const double *edge,
                               uint32_t row, uint32_t first, uint32_t last)
{
    const umb_tile *tiles = c->tiles + (size_t)(row / UMB_TILE_HEIGHT) * c->columns;
    uint32_t r = row % UMB_TILE_HEIGHT, half = r / 4;
    for (uint32_t tx = first / UMB_TILE_WIDTH; tx <= last / UMB_TILE_WIDTH; ++tx) {
        uint32_t x = tx * UMB_TILE_WIDTH;
        uint32_t need = first > x ? ~0u << (first - x) : ~0u;
        need &= last < x + 31 ? ~0u >> (x + 31 - last) : ~0u;
        if ((need & ~tiles[tx].mask[r]) != 0) {
            return false;
        }
        for (uint32_t s = 0; s < 4; ++s) {
            float z = tiles[tx].z[4 * half + s];
            if ((need >> (8 * s) & 0xFFu) != 0 && z < o->most &&
                z < outline_nearness(o, x + 8.0 * s, edge[row], edge[row + 1])) {
                return false;
            }
        }
    }
    return true;
}

bool umb_coverage_hides_outline(const umb_coverage *c, const double *edge, umb_pixel_rect rect,
                                const umb_outline *outline)
{
    for (int row = rect.y0; row <= rect.y1; ++row) {
        uint32_t first, last;
        if (outline_span(outline, edge + row, c->width, &first, &last) &&
            !outline_row_hidden(c, outline, edge, (uint32_t)row, first, last)) {
            return false;
        }
    }
    return true;
}

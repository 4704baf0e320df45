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

/* Rows r0..r1 and the columns of need, all within one tile. */
static bool tile_hides(const umb_tile *tile, uint32_t r0, uint32_t r1, uint32_t need, float nearness)
{
    uint32_t open = 0;
    for (uint32_t r = r0; r <= r1; ++r) {
        open |= need & ~tile->mask[r];
    }
    if (open != 0) {
        return false;
    }
    for (uint32_t half = r0 / 4; half <= r1 / 4; ++half) {
        for (uint32_t s = 0; s < 4; ++s) {
            if ((need >> (8 * s) & 0xFFu) != 0 && tile->z[4 * half + s] < nearness) {
                return false;
            }
        }
    }
    return true;
}

bool umb_coverage_hides(const umb_coverage *c, umb_pixel_rect rect, float nearness)
{
    uint32_t tx0 = (uint32_t)rect.x0 / UMB_TILE_WIDTH, tx1 = (uint32_t)rect.x1 / UMB_TILE_WIDTH;
    uint32_t ty0 = (uint32_t)rect.y0 / UMB_TILE_HEIGHT, ty1 = (uint32_t)rect.y1 / UMB_TILE_HEIGHT;
    uint32_t first = ~0u << ((uint32_t)rect.x0 % UMB_TILE_WIDTH);
    uint32_t last = ~0u >> (UMB_TILE_WIDTH - 1 - (uint32_t)rect.x1 % UMB_TILE_WIDTH);
    for (uint32_t ty = ty0; ty <= ty1; ++ty) {
        uint32_t r0 = ty == ty0 ? (uint32_t)rect.y0 % UMB_TILE_HEIGHT : 0;
        uint32_t r1 = ty == ty1 ? (uint32_t)rect.y1 % UMB_TILE_HEIGHT : UMB_TILE_HEIGHT - 1;
        for (uint32_t tx = tx0; tx <= tx1; ++tx) {
            size_t t = (size_t)ty * c->columns + tx;
            if (c->coarse[t] >= nearness) {
                continue;
            }
            uint32_t need = (tx == tx0 ? first : ~0u) & (tx == tx1 ? last : ~0u);
            if (!tile_hides(&c->tiles[t], r0, r1, need, nearness)) {
                return false;
            }
        }
    }
    return true;
}

void umb_coverage_merge(umb_coverage *c, uint32_t tile, const uint32_t mask[UMB_TILE_HEIGHT],
                        const float z[8])
{
    umb_tile *t = &c->tiles[tile];
    uint32_t fresh[2] = {0, 0}, lone[2] = {0, 0}; /* bits that only mask has; bits that only the tile has */
    uint32_t all = ~0u;
    for (uint32_t r = 0; r < UMB_TILE_HEIGHT; ++r) {
        fresh[r / 4] |= mask[r] & ~t->mask[r];
        lone[r / 4] |= t->mask[r] & ~mask[r];
        t->mask[r] |= mask[r];
        all &= t->mask[r];
    }
    for (uint32_t s = 0; s < 8; ++s) {
        uint32_t byte = 0xFFu << (8 * (s % 4));
        bool has_fresh = (fresh[s / 4] & byte) != 0;
        bool has_lone = (lone[s / 4] & byte) != 0;
        if (!has_lone && (has_fresh || z[s] > t->z[s])) {
            /* The occluder alone covers all that is covered here, or there was nothing: without new bits
               it does so from nearer. */
            t->z[s] = z[s];
        } else if (has_fresh && z[s] < t->z[s]) {
            t->z[s] = z[s];
        }
    }
    if (all == ~0u) {
        float least = t->z[0];
        for (uint32_t s = 1; s < 8; ++s) {
            least = t->z[s] < least ? t->z[s] : least;
        }
        c->coarse[tile] = least;
    }
}

#include "coverage.h"

#include <math.h>
#include <string.h>

/* Kernels look at 32 entries at a time. */
static size_t coarse_bytes(size_t tiles)
{
    return (tiles + UMB_COARSE_SPARE) * sizeof(float);
}

bool umb_coverage_resize(umb_coverage *c, const umb_allocator *a, uint32_t width, uint32_t height)
{
    uint32_t columns = (width + UMB_TILE_WIDTH - 1) / UMB_TILE_WIDTH;
    uint32_t rows = (height + UMB_TILE_HEIGHT - 1) / UMB_TILE_HEIGHT;
    size_t need = (size_t)columns * rows;
    if (need > c->tile_capacity) {
        umb_tile *tiles = umb_memory_allocate(a, need * sizeof(umb_tile));
        float *coarse = umb_memory_allocate(a, coarse_bytes(need));
        if (tiles == NULL || coarse == NULL) {
            umb_memory_free(a, tiles, need * sizeof(umb_tile));
            umb_memory_free(a, coarse, coarse_bytes(need));
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
    umb_memory_free(a, c->coarse, coarse_bytes(c->tile_capacity));
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
    for (size_t t = 0; t < (size_t)c->columns * c->rows + UMB_COARSE_SPARE; ++t) {
        c->coarse[t] = -INFINITY;
    }
}

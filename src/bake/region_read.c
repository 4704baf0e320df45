/* Copies of the occlusion maps, to look at. */
#include <math.h>

#include "region_state.h"

/* Endless intervals are told as such. */
static float slope_of(float x)
{
    return x >= UMB_UMBRA_ENDLESS ? INFINITY : x <= -UMB_UMBRA_ENDLESS ? -INFINITY : x;
}

/* The interval that reaches highest, of a pixel. */
static void read_pixel(const umb_ray_map *m, uint32_t s, uint32_t t, bool half, umb_region_pixel *out)
{
    size_t tile = (size_t)(s / UMB_TILE) * m->columns + t / UMB_TILE;
    uint32_t pixel = s % UMB_TILE * UMB_TILE + t % UMB_TILE;
    *out = (umb_region_pixel){.bottom = INFINITY, .top = -INFINITY, .live = (m->live[tile] >> pixel & 1) != 0};
    if (!out->live || !m->drawn[tile]) {
        return;
    }
    for (uint32_t k = 0; k < m->umbrae; ++k) {
        const umb_umbra_tile *u = &m->intervals[tile * m->umbrae + k];
        if (u->top[pixel] > out->top) {
            out->top = slope_of(u->top[pixel]);
            out->bottom = half ? -INFINITY : slope_of(u->bottom[pixel]);
        }
    }
}

bool umb_region_read_map(const umb_region *region, uint32_t map, umb_region_pixel *pixels, size_t capacity,
                         uint32_t *side)
{
    bool there = region->solved && map < region->map_count;
    const umb_ray_map *m = &region->maps[there ? map : 0];
    *side = there ? region->query.resolution : 0;
    if (!there || pixels == NULL || capacity < (size_t)*side * *side) {
        return false;
    }
    for (uint32_t s = 0; s < *side; ++s) {
        for (uint32_t t = 0; t < *side; ++t) {
            uint32_t row = s * UMB_TILE * m->rows / *side, column = t * UMB_TILE * m->columns / *side;
            read_pixel(m, row, column, region->query.half_umbra, &pixels[(size_t)s * *side + t]);
        }
    }
    return true;
}

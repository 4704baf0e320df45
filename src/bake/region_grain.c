/* How fine occlusion maps are along their two sides. */
#include <math.h>

#include "region_state.h"

#define MOST_COLUMNS 8192

double umb_region_width(const umb_region *r)
{
    return r->objects > 0 ? sqrt(r->surface / (6.0 * r->objects)) : 0.0;
}

/* What a ray goes through in the mean before it ends, were the scene's objects spread evenly over its bounds: a body's
 * shadow is a quarter of its surface, averaged over all directions. */
static double free_path(const umb_region *r, const umb_aabb *b)
{
    double volume = 1.0;
    for (int k = 0; k < 3; ++k) {
        volume *= (double)b->max[k] - b->min[k];
    }
    double path = 4.0 * volume / r->surface;
    return path > 0.0 && path < INFINITY ? path : 0.0;
}

/* How far before the scene the cell lies. */
static double gap_of(const umb_region *r)
{
    const umb_aabb *b = &umb_index_tree(r->index)->bounds;
    double gap = 0.0;
    for (int k = 0; k < 3; ++k) {
        gap = fmax(gap, fmax(r->query.min[k] - b->max[k], b->min[k] - r->query.max[k]));
    }
    return gap;
}

/* How far away the scene's farthest side is. */
static double extent_of(const umb_region *r)
{
    const umb_aabb *b = &umb_index_tree(r->index)->bounds;
    double far = 0.0;
    for (uint32_t i = 0; i < r->frame_count; i += 2) {
        uint32_t k = r->frames[i].axis_u;
        far = fmax(far, fmax(r->query.min[k] - b->min[k], b->max[k] - r->query.max[k]));
    }
    return far;
}

/* Lines of a slab's pixel are a beam as wide as its step in offset and its step in slope times the distance: for the same
 * number of pixels it is thinnest, where things are seen (five free paths into the scene), when both are equal. */
static uint32_t fineness(const umb_region *r, bool none)
{
    double size = r->frames[0].hu + r->frames[0].hv, extent = extent_of(r) / (48.0 * size);
    double sight = (gap_of(r) + 5.0 * free_path(r, &umb_index_tree(r->index)->bounds)) / size;
    uint32_t fine = sight > 48.0 && !none ? 16 : sight > 24.0 ? 4 : sight > 6.0 ? 2 : 1;
    while (fine > 1 && fine > extent) {
        fine /= 2;
    }
    return fine;
}

static uint32_t round_up(double x, uint32_t step, uint32_t most)
{
    return x < most ? ((uint32_t)x + step - 1) / step * step : most / step * step;
}

/* Where only a few intervals are kept, steps along the offset are about an eighth of an object's width: finer ones find little more that is
 * hidden, coarser ones leave cracks between neighbours. Bodies tell what is hidden far away (region_look.c), so slopes may be
 * coarse, unless all of the scene is far. */
static void grain_of_objects(const umb_region *r, uint32_t most, uint32_t *rows, uint32_t *columns)
{
    double size = r->frames[0].hu + r->frames[0].hv, share = r->query.resolution / 512.0, width = umb_region_width(r);
    *columns = round_up(share * fmax(704.0, 8.0 * gap_of(r) / width), UMB_TILE * UMB_TILE, most);
    *rows = (uint32_t)fmin(ceil(share * 15.0 * size / width), r->query.resolution * r->query.resolution / 5.0 / *columns);
}

/* Answers do not depend on being right: the limits here are those that left the smallest sets in the same time in cities and box
 * fields of all sizes. */
void umb_region_grain(const umb_region *r, uint32_t *rows, uint32_t *columns)
{
    uint32_t n = r->query.resolution, side = UMB_TILE * UMB_TILE;
    *rows = *columns = n;
    if (r->query.outer != 0.0) {
        return;
    }
    bool none = r->query.up == UMB_UP_NONE;
    uint32_t most = n * n / 4 / UMB_TILE; /* a quarter of n x n pixels in one row of tiles */
    most = most < MOST_COLUMNS ? most : MOST_COLUMNS;
    if (!none && r->query.umbrae <= 2 && umb_region_width(r) > 0.0) {
        grain_of_objects(r, most, rows, columns);
    } else {
        *columns = n * fineness(r, none);
        *columns = *columns < most ? *columns : most / side * side;
        *rows = n * n / (none ? 16 : 5) / *columns;
    }
    *rows = *rows <= UMB_TILE ? UMB_TILE : (*rows + UMB_TILE - 1) / UMB_TILE * UMB_TILE;
    *rows = *rows > side ? (*rows + side - 1) / side * side : *rows;
}

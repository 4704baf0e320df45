/* The method's buffer as a picture. */
#include "culler_state.h"

/* The buffer as the view sees it at a point of its picture: d.right and d.up where d.forward is 1. Both the raster
 * and the view look from the eye, so only the depth must be turned from W into one along forward. */
static float sample_buffer(const umb_coverage *b, const umb_raster_map *map, const umb_view *v, double x, double y)
{
    umb_vec3 right = umb_vec3_scale(umb_vec3_from_double(v->right), x);
    umb_vec3 up = umb_vec3_scale(umb_vec3_from_double(v->up), y);
    umb_vec3 d = umb_vec3_add(umb_vec3_add(right, up), umb_vec3_from_double(v->forward));
    double w = umb_vec3_dot(map->w, d), scale = map->orthographic ? 1.0 : 1.0 / w;
    double px = umb_vec3_dot(map->x, d) * scale + map->cx;
    uint32_t column = px < 0.0 ? 0 : px >= b->width ? b->width - 1 : (uint32_t)px;
    uint32_t row = (uint32_t)umb_raster_map_row_at(map, umb_vec3_dot(map->y, d) * scale + map->cy, 0.0);
    const umb_tile *t = &b->tiles[(size_t)(row / UMB_TILE_HEIGHT) * b->columns + column / UMB_TILE_WIDTH];
    uint32_t r = row % UMB_TILE_HEIGHT, bit = column % UMB_TILE_WIDTH;
    if ((t->mask[r] >> bit & 1u) == 0) {
        return 0.0f;
    }
    float z = t->z[4 * (r / 4) + bit / 8];
    return (float)(map->orthographic ? 1.0 / (1.0 - z - v->near_depth) : z * w);
}

bool umb_culler_read_buffer(const umb_culler *c, float *pixels, size_t capacity, uint32_t *width,
                            uint32_t *height)
{
    *width = *height = 0;
    if (c->ops == NULL || c->ops->buffer == NULL || !c->answered) {
        return false;
    }
    const umb_coverage *b = c->ops->buffer(c->method);
    *width = b->width;
    *height = b->height;
    if (pixels == NULL || capacity < (size_t)b->width * b->height) {
        return false;
    }
    const umb_view *v = &c->view;
    umb_raster_map map;
    umb_raster_map_prepare(&map, v, &umb_index_tree(c->index)->bounds, c->rows);
    for (uint32_t j = 0; j < b->height; ++j) {
        double y = v->y_max - (v->y_max - v->y_min) * (j + 0.5) / b->height;
        for (uint32_t i = 0; i < b->width; ++i) {
            double x = v->x_min + (v->x_max - v->x_min) * (i + 0.5) / b->width;
            pixels[(size_t)j * b->width + i] = sample_buffer(b, &map, v, x, y);
        }
    }
    return true;
}

#include "convex.h"

bool umb_convex_place(umb_convex *c, const umb_raster_map *map, const umb_convex_frame *f, double x_min,
                      double x_max)
{
    c->x_min = x_min > 0.0 ? x_min : 0.0;
    c->x_max = x_max < map->width ? x_max : map->width;
    double y_min = f->y_min > 0.0 ? f->y_min : 0.0, y_max = f->y_max < map->height ? f->y_max : map->height;
    c->row0 = 1;
    c->row1 = 0;
    if (!(c->x_max - c->x_min >= 1.0) || !(y_max > y_min) || c->left.count == 0 || c->right.count == 0) {
        return false;
    }
    /* Rows that lie wholly between y_min and y_max. */
    const double *edge = map->rows.edge;
    int32_t row0 = umb_raster_map_row_at(map, y_min, -map->rows.slack);
    int32_t row1 = umb_raster_map_row_at(map, y_max, map->rows.slack);
    while (row0 <= row1 && edge[row0] < y_min) {
        ++row0;
    }
    while (row1 >= row0 && edge[row1 + 1] > y_max) {
        --row1;
    }
    if (row0 > row1) {
        return false;
    }
    c->row0 = (uint32_t)row0;
    c->row1 = (uint32_t)row1;
    return true;
}

umb_convex_result umb_convex_of_silhouette(const umb_silhouette *s, const umb_raster_map *map,
                                           const umb_occluder *o, umb_convex *out)
{
    if (s->front_count > UMB_CONVEX_TRIANGLES || s->edge_count > UMB_CONVEX_EDGES) {
        return UMB_CONVEX_OTHER;
    }
    umb_convex_frame f = {.error = s->error,
                          .extent = s->x_max - s->x_min,
                          .height = map->height,
                          .y_min = s->y_min,
                          .y_max = s->y_max};
    out->left.count = out->right.count = out->edge_count = out->plane_count = 0;
    for (uint32_t i = 0; i < s->edge_count; ++i) {
        const umb_outline_edge *e = &s->edges[i];
        bool down = e->count > 0;
        if (!umb_convex_add_line(out, &f, down ? e->x_top : e->x_low, down ? e->y_min : e->y_max,
                                 down ? e->x_low : e->x_top, down ? e->y_max : e->y_min)) {
            return UMB_CONVEX_OTHER;
        }
    }
    if (!umb_convex_place(out, map, &f, s->x_min, s->x_max)) {
        return UMB_CONVEX_NOTHING;
    }
    for (uint32_t i = 0; i < s->front_count; ++i) {
        umb_silhouette_plane p;
        umb_silhouette_plane_of(s, map, o, s->front[i], &p);
        umb_convex_add_plane(out, map, p.gx, p.gy, p.low, p.low, p.far_corner);
    }
    out->most = (float)(s->most + 0x1p-22 * fabs(s->most));
    return UMB_CONVEX_READY;
}

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

/* The line of a side at which no corner is beyond it: of the two that are parallel to the side and hold the polygon
 * the one near the side, whichever way round the corners run. Evaluating it is off by less than 16 units of its
 * terms. */
static void hold_outline(umb_convex *c, const umb_outline *o, double height, double x0, double y0, double slope)
{
    double least = INFINITY, most = -INFINITY, at = x0 - slope * y0, size = 0.0;
    for (uint32_t i = 0; i < o->count; ++i) {
        double v = o->x[i] - slope * o->y[i];
        least = v < least ? v : least;
        most = v > most ? v : most;
        size = fabs(o->x[i]) + fabs(slope * o->y[i]) > size ? fabs(o->x[i]) + fabs(slope * o->y[i]) : size;
    }
    double off = o->error * (1.0 + fabs(slope)) + 16.0 * UMB_U * (size + fabs(slope) * height);
    bool left = fabs(least - at) < fabs(most - at);
    umb_convex_lines *lines = left ? &c->left : &c->right;
    uint32_t i = lines->count++;
    lines->slope[i] = slope;
    lines->out_at[i] = left ? least - off : most + off;
}

void umb_convex_of_outline(const umb_outline *o, const umb_raster_map *map, umb_convex *out)
{
    out->left.count = out->right.count = out->plane_count = 0;
    for (uint32_t i = 0; i < o->count; ++i) {
        uint32_t k = i + 1 < o->count ? i + 1 : 0;
        double dx = o->x[k] - o->x[i], dy = o->y[k] - o->y[i];
        if (fabs(dy) > UMB_CONVEX_FLAT * fabs(dx)) {
            hold_outline(out, o, map->height, o->x[i], o->y[i], dx / dy);
        }
    }
    /* The plane's relative 2^-22 is less than this part of its largest value over the raster. */
    double size = fabs(o->gx) * (map->width + 32.0) + fabs(o->gy) * (map->height + 8.0) + fabs(o->g0);
    umb_convex_add_plane(out, map, o->gx, o->gy, o->g0, o->g0 + 0x1p-22 * size, o->most);
    out->most = (float)(o->most + 0x1p-22 * fabs(o->most));
}

#include "volumes.h"

#include <math.h>

/* How far a volume reaches: along a plane's normal, and in all along the axes. */
typedef struct reach {
    double along, all;
} reach;

static reach reach_of(const umb_node_volume *v, bool sphere, const float n[3])
{
    reach r = {0.0, 0.0};
    if (sphere) {
        double square = (double)n[0] * n[0] + (double)n[1] * n[1] + (double)n[2] * n[2];
        return (reach){v->half[0] * sqrt(square), 3.0 * v->half[0]};
    }
    for (int j = 0; j < 3; ++j) {
        double along = 0.0;
        for (int i = 0; i < 3; ++i) {
            along += (double)n[i] * v->place.m[i][j];
            r.all += fabs((double)v->place.m[i][j]) * v->half[j];
        }
        r.along += fabs(along) * v->half[j];
    }
    return r;
}

/* With the plane's own floats, g' = n.(p - high - low) + c, and the bounds of frustum.c: a kernel leaves a box out if its G
 * at the corner farthest along n is below -(E + slack), E = 2^-23 D. That G is within E + slack of g' there, and the box
 * lies in the volume: g' is at most its maximum over the volume, D at most |centre - eye| and the volume's reach, summed
 * over the axes. So if that maximum is below -2 (E + slack) for the volume's D, G is below -(E + slack) for each box.
 * Twice that again in E pays for what doubles lose here, 2^-45 of D, and as much of c, which slack has 2^-23 of. */
static bool is_beyond(const umb_frustum *f, uint32_t k, const umb_node_volume *v, bool sphere)
{
    const umb_frustum_plane *p = &f->planes[k];
    reach r = reach_of(v, sphere, p->n);
    double g = p->c, size = r.all;
    for (int i = 0; i < 3; ++i) {
        double d = v->place.m[i][3] - ((double)f->eye_high[i] + f->eye_low[i]);
        g += p->n[i] * d;
        size += fabs(d);
    }
    return g + r.along < -(0x1p-21 * size + 2.0 * p->slack);
}

bool umb_volumes_in_view(const umb_frustum *f, const umb_tree *tree, uint32_t node, uint16_t planes)
{
    const umb_node_volume *v = &tree->volumes[node];
    for (uint32_t left = v->pays ? planes : 0; left != 0; left &= left - 1) {
        if (is_beyond(f, (uint32_t)__builtin_ctz(left), v, tree->spheres)) {
            return false;
        }
    }
    return true;
}

bool umb_volumes_hidden(const umb_asker *a, const umb_tree *tree, uint32_t node)
{
    const umb_node_volume *v = &tree->volumes[node];
    if (!v->pays || tree->spheres) {
        return false;
    }
    const umb_aabb box = {{-v->half[0], -v->half[1], -v->half[2]}, {v->half[0], v->half[1], v->half[2]}};
    umb_image_bounds b;
    switch (umb_image_of_part(a->map, &box, &v->place, false, &b)) {
    case UMB_DEPTH_OUTSIDE:
        return true;
    case UMB_DEPTH_CROSSING:
        return false;
    default: {
        umb_image image = umb_image_of_bounds(a->map, &b);
        return umb_detail_hidden(a, &image, NULL);
    }
    }
}

#include "tangent.h"

#include <string.h>

/* Corner k of the box of half sizes 1. */
static umb_vec3 unit_corner(uint32_t k)
{
    return umb_vec3_make(k & 1 ? 1.0 : -1.0, k & 2 ? 1.0 : -1.0, k & 4 ? 1.0 : -1.0);
}

/* The six corners of the hexagon, counter-clockwise about d. */
static void find_hexagon(umb_vec3 d, uint8_t out[6])
{
    umb_vec3 x = umb_vec3_cross(d, umb_vec3_make(0.3, -0.7, 0.2)), y = umb_vec3_cross(d, x);
    double angles[6];
    uint32_t count = 0;
    for (uint8_t k = 0; k < 8; ++k) {
        umb_vec3 c = unit_corner(k);
        if (fabs(umb_vec3_dot(c, d)) > 2.9) {
            continue; /* the corners nearest and farthest along d are inside */
        }
        double angle = atan2(umb_vec3_dot(c, y), umb_vec3_dot(c, x));
        uint32_t at = count++;
        for (; at > 0 && angles[at - 1] > angle; --at) {
            angles[at] = angles[at - 1];
            out[at] = out[at - 1];
        }
        angles[at] = angle;
        out[at] = k;
    }
}

/* True if a line along d with these states lies outside of the hexagon's side from corner u to v. */
static bool is_outside(umb_vec3 d, uint8_t u, uint8_t v, const int state[3])
{
    uint8_t along = u ^ v; /* the bit of the axis that the side runs along */
    uint32_t axis = along == 1 ? 0 : along == 2 ? 1 : 2;
    umb_vec3 e = umb_vec3_make(axis == 0, axis == 1, axis == 2);
    double place = umb_vec3_dot(umb_vec3_cross(d, e), unit_corner(u));
    return place > 0.0 ? state[axis] > 0 : state[axis] < 0;
}

static umb_tangents tangents_of(umb_vec3 d, const uint8_t hexagon[6], const int state[3])
{
    umb_tangents t = {UMB_TANGENT_NONE, UMB_TANGENT_NONE};
    uint32_t runs = 0;
    for (uint32_t i = 0; i < 6; ++i) {
        uint8_t u = hexagon[(i + 5) % 6], v = hexagon[i], w = hexagon[(i + 1) % 6];
        bool before = is_outside(d, u, v, state), after = is_outside(d, v, w, state);
        if (!before && after) {
            t.separating = v;
            runs += 1;
        } else if (before && !after) {
            t.supporting = v;
        }
    }
    return runs == 1 ? t : (umb_tangents){UMB_TANGENT_NONE, UMB_TANGENT_NONE};
}

void umb_tangent_table_make(umb_tangent_table *table)
{
    for (uint32_t octant = 0; octant < 8; ++octant) {
        umb_vec3 d = umb_vec3_make(octant & 1 ? -1.0 : 1.0, octant & 2 ? -1.0 : 1.0, octant & 4 ? -1.0 : 1.0);
        uint8_t hexagon[6] = {0};
        find_hexagon(d, hexagon);
        for (int code = 0; code < 27; ++code) {
            const int state[3] = {code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1};
            table->at[octant][code] = tangents_of(d, hexagon, state);
        }
    }
}

/* Without a branch but for what is too close to tell. Of g and r each term is a product of two numbers with at most three
 * roundings behind them, relative to a box's distance and to the place of its faces. */
bool umb_tangents_find(const umb_tangent_table *table, const float a[3], const float b[3], const umb_aabb *box,
                       umb_tangents *out)
{
    double d[3], w[3], h[3], length[3], far[3];
    uint32_t octant = 0;
    for (int i = 0; i < 3; ++i) {
        double low = box->min[i], high = box->max[i], middle = 0.5 * (high + low);
        d[i] = (double)b[i] - a[i];
        h[i] = 0.5 * (high - low);
        w[i] = a[i] - middle;
        length[i] = fabs(d[i]);
        far[i] = fabs(w[i]) + h[i] + fabs(middle);
        octant |= (uint32_t)(d[i] < 0.0) << i;
    }
    int code = 13;
    bool unsure = false;
    static const int weight[3] = {1, 3, 9};
    for (int k = 0; k < 3; ++k) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        double g = d[j] * w[i] - d[i] * w[j], r = length[j] * h[i] + length[i] * h[j];
        double bound = 0x1p-49 * (length[j] * far[i] + length[i] * far[j]);
        code += weight[k] * ((g > r) - (g < -r));
        unsure |= fabs(fabs(g) - r) < bound;
    }
    *out = table->at[octant][code];
    for (int k = 0; k < 3 && out->supporting == UMB_TANGENT_NONE; ++k) {
        /* Along an axis two sides of the hexagon have no length: outside when both their neighbours are. */
        if (length[(k + 1) % 3] == 0.0 && length[(k + 2) % 3] == 0.0 && code != 13) {
            umb_tangents up = table->at[octant][code + weight[k]], down = table->at[octant][code - weight[k]];
            *out = up.supporting != UMB_TANGENT_NONE ? up : down;
        }
    }
    return !unsure && out->supporting != UMB_TANGENT_NONE;
}

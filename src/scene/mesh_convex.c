/* Every step is an exact predicate on the mesh's own float positions.
 *
 * Why the count of vertices settles what the planes leave open. Let H be the hull of the vertices.
 * When no vertex is in front of a triangle's plane, every triangle lies in the surface of H and
 * faces outwards, and when every edge has one triangle on each side the triangles cover that
 * surface evenly, d times, turning around a vertex perhaps more than once: a branched cover of a
 * sphere. Each of the h >= 4 extreme points of H is one vertex, because equal positions are one
 * vertex, so all d sheets meet there; counting sheets (Riemann-Hurwitz) gives
 *     vertices - edges + triangles <= 2d - h (d - 1).
 * The left side is 2 only if d is 1: the triangles are the surface of H, once, in one piece.
 */
#include "mesh_convex.h"

#include "geometry/orient.h"

#define MOST_TRIANGLES 128

/* One triangle on each side of every edge, and the counts of a sphere. */
static bool is_closed(const umb_mesh *m)
{
    uint32_t n = m->triangle_count;
    if (n < 4 || n > MOST_TRIANGLES || n % 2 != 0 || m->any_two_sided != 0 ||
        m->edge_count != n / 2 * 3 || m->block_position_count != n / 2 + 2) {
        return false;
    }
    for (uint32_t i = 0; i < m->edge_count; ++i) {
        if (m->edges[i].f1 == UMB_NONE || (m->edges[i].f1 & UMB_EDGE_SAME) != 0) {
            return false;
        }
    }
    return true;
}

/* No vertex lies in front of the triangle's plane, and some behind it. */
static bool all_behind(const umb_mesh *m, const uint32_t triangle[3])
{
    const float *a = m->positions[triangle[0]];
    const float *b = m->positions[triangle[1]];
    const float *c = m->positions[triangle[2]];
    bool solid = false;
    for (uint32_t i = 0; i < m->block_position_count; ++i) {
        if (i == triangle[0] || i == triangle[1] || i == triangle[2]) {
            continue;
        }
        int side = umb_orient(a, b, c, m->positions[i]);
        if (side > 0) {
            return false;
        }
        solid = solid || side < 0;
    }
    return solid;
}

bool umb_mesh_convex_test(const umb_mesh *mesh)
{
    if (!is_closed(mesh)) {
        return false;
    }
    for (uint32_t t = 0; t < mesh->triangle_count; ++t) {
        if (!all_behind(mesh, mesh->triangles[t])) {
            return false;
        }
    }
    return true;
}

bool umb_mesh_convex_is_box(const umb_mesh *mesh)
{
    if (mesh->block_position_count != 8) {
        return false;
    }
    /* Positions are all different: eight corners are all eight. */
    for (uint32_t i = 0; i < 8; ++i) {
        for (int k = 0; k < 3; ++k) {
            float x = mesh->positions[i][k];
            if (x != mesh->block_bounds.min[k] && x != mesh->block_bounds.max[k]) {
                return false;
            }
        }
    }
    return true;
}
